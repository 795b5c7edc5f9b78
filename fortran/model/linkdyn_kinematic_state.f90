!> Scratch of the kinematics of one block of lanes, one per thread.
!>
!> Index 0 is the frame. Links that only slide on each other share an orientation, so rotations and angular rates
!> are kept per orientation, points per link. Column 0 of an acceleration is what the coordinates' motion gives,
!> column k what a unit acceleration of coordinate k adds (for a pose: of the velocity and the angular velocity).
!> A planar scene keeps its motion in `plane`; the arrays for space are then not allocated.
module linkdyn_kinematic_state
    use linkdyn_group_motion, only: group_motion, prepare_groups
    use linkdyn_joint_table, only: most_slides
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_model, only: model_type
    use linkdyn_planar_motion, only: planar_motion, prepare_planar_motion
    use linkdyn_scene, only: n_stop, n_clutch
    use linkdyn_status, only: sample_ok
    use linkdyn_vec3, only: vec3, mat3, identity_mat3, zero_vec3, lane_of, mat3_lane
    implicit none (type, external)
    private
    public :: kinematic_state, prepare_kinematics, keep_slide, link_position, link_rotation, velocities_only

    integer, parameter :: velocities_only = -1                !! in place of a number of columns: accelerations are not wanted

    type :: kinematic_state
        integer :: n_column = 0                               !! columns besides column 0, or `velocities_only`
        ! ---- INPUT
        real(wp), allocatable :: q(:, :), qd(:, :), qdd(:, :) !! coordinates, rates, accelerations    (lane, n_q)
        real(wp), allocatable :: turns(:, :)                  !! that coordinates have made besides   (lane, n_q)
        real(wp), allocatable :: counted(:, :)                !! about what a coordinate stands in for: an angle knows its turns
                                                              !!                                      (lane, n_q)
        logical, allocatable :: by_quaternion(:)              !! an attitude comes as quaternion: its angles q are not read,
                                                              !! of qd and qdd they are angular rates, of a pose in world axes,
                                                              !! of a joint in those of its first marker (n_attitude)
        real(wp), allocatable :: quaternion(:, :, :)          !! w x y z of such an attitude          (lane, 4, n_attitude)
        real(wp) :: time(lanes) = 0                           !! the instant [s]
        real(wp), allocatable :: payload(:, :)                !! masses that links carry [kg]         (lane, n_payload)
        real(wp), allocatable :: branch(:, :)                 !! of the closed forms, +1 or -1        (lane, n_branch)
        ! ---- HOW CLOSED FORMS CLOSE, of dyads where accelerations were not wanted: see `closed_margin`
        logical :: has_margins = .false.
        real(wp), allocatable :: margin(:, :), drift(:, :)    !!                                      (lane, n_branch)
        ! ---- POSITION
        type(mat3), allocatable :: rotation(:)                !! link axes to world                   (0:n_orientation)
        type(vec3), allocatable :: position(:)                !! origin, world [m]                    (0:n_link)
        real(wp), allocatable :: slide(:, :, :)               !! first to second marker along axes [m] (lane, slide, n_joint)
        logical :: unreachable(lanes) = .false.               !! a loop could not be closed
        logical :: out_of_reach(lanes) = .false.              !! nor could it on any branch: no way leads there
        logical :: singular(lanes) = .false.                  !! at a dead point: rates are not determined
        logical :: not_converged(lanes) = .false.             !! an iteration ran out of steps
        logical :: branch_lost(lanes) = .false.               !! two assemblies meet on the way
        integer :: way_status(lanes) = sample_ok              !! how following the assembly to here came out: one of `sample_*`
        logical :: undefined(lanes) = .false.                 !! a spring has no direction
        integer :: holding(lanes) = 0                         !! the contact whose friction holds the mechanism fast; 0: none does
        real(wp) :: uncertainty(lanes) = 0                    !! largest relative one of what groups found
        type(planar_motion) :: plane
        type(group_motion) :: group                           !! closed by Newton's method
        ! ---- LAWS over the state
        real(wp), allocatable :: law(:, :)                    !! their values                         (lane, n_law)
        real(wp) :: mode(lanes) = 0                           !! changes where a law jumps
        ! ---- PUSH of end stops at which joint variables rest, force of clutches
        real(wp), allocatable :: stop_force(:, :)             !! away from the stop [N, N m]          (lane, n_stop)
        real(wp), allocatable :: touch(:, :)                  !! of stops' sides, see `measure_touch`  (lane, n_stop)
        real(wp), allocatable :: clutch_force(:, :)           !! of clutches, at their first variable [N, N m] (lane, n_clutch)
        ! ---- VELOCITY, world and link axes
        type(vec3), allocatable :: omega(:), omega_body(:)    !! angular [rad/s]                      (0:n_orientation)
        type(vec3), allocatable :: velocity(:)                !! origin, world [m/s]                  (0:n_link)
        ! ---- ACCELERATION columns, world and link axes
        type(vec3), allocatable :: alpha(:, :), alpha_body(:, :)                !! (0:n_column, 0:n_orientation)
        type(vec3), allocatable :: acceleration(:, :), acceleration_body(:, :)  !! origin (0:n_column, 0:n_link)
    end type kinematic_state

contains

    !> Make room once; nothing allocates afterwards.
    subroutine prepare_kinematics(model, n_column, state)
        type(model_type), intent(in) :: model
        integer, intent(in) :: n_column                 !! 0: column 0 only; n_q: all columns
        type(kinematic_state), intent(out) :: state
        integer :: i, k

        state%n_column = n_column
        associate (n_q => model%n_q, n_link => model%n_link, n_orientation => model%n_orientation)
            allocate (state%q(lanes, n_q), state%qd(lanes, n_q), state%qdd(lanes, n_q), &
                      state%slide(lanes, most_slides, size(model%joint)), &
                      state%turns(lanes, n_q), state%counted(lanes, n_q))
            allocate (state%by_quaternion(model%n_attitude), state%quaternion(lanes, 4, model%n_attitude), &
                      state%branch(lanes, model%n_branch), state%margin(lanes, model%n_branch), &
                      state%drift(lanes, model%n_branch))
            allocate (state%law(lanes, size(model%scene%laws%law)))
            allocate (state%stop_force(lanes, n_stop(model%scene)))
            state%stop_force = 0
            allocate (state%touch(lanes, n_stop(model%scene)))
            state%touch = 0
            allocate (state%clutch_force(lanes, n_clutch(model%scene)))
            state%clutch_force = 0
            state%law = 0
            allocate (state%payload(lanes, size(model%payload)))
            state%payload = 0
            state%by_quaternion = .false.
            state%q = 0
            state%qd = 0
            state%qdd = 0
            state%turns = 0
            state%counted = 0
            state%slide = 0
            state%branch = 1
            if (allocated(model%branch)) state%branch = spread(model%branch, 1, lanes)
            if (size(model%group) > 0) call prepare_groups(model, n_column, state%group)
            if (model%is_planar) then
                call prepare_planar_motion(model, n_column, state%plane)
                return
            end if
            allocate (state%rotation(0:n_orientation), state%omega(0:n_orientation), state%omega_body(0:n_orientation))
            allocate (state%alpha(0:n_column, 0:n_orientation), state%alpha_body(0:n_column, 0:n_orientation))
            allocate (state%position(0:n_link), state%velocity(0:n_link))
            allocate (state%acceleration(0:n_column, 0:n_link), state%acceleration_body(0:n_column, 0:n_link))
            do i = 0, n_orientation
                state%rotation(i) = identity_mat3()
                state%omega(i) = zero_vec3()
                state%omega_body(i) = zero_vec3()
                do k = 0, n_column
                    state%alpha(k, i) = zero_vec3()
                    state%alpha_body(k, i) = zero_vec3()
                end do
            end do
            do i = 0, n_link
                state%position(i) = zero_vec3()
                state%velocity(i) = zero_vec3()
                do k = 0, n_column
                    state%acceleration(k, i) = zero_vec3()
                    state%acceleration_body(k, i) = zero_vec3()
                end do
            end do
        end associate
    end subroutine prepare_kinematics

    !> How far a joint is slid, and with it the real one, if it is carried over from another link.
    pure subroutine keep_slide(model, j, k, slide, state)
        type(model_type), intent(in) :: model
        integer, intent(in) :: j, k                     !! joint, slide
        real(wp), intent(in) :: slide(lanes)            !! [m]
        type(kinematic_state), intent(inout) :: state

        state%slide(:, k, j) = slide
        associate (told => model%joint(j)%told)
            if (model%joint(told)%kind == model%joint(j)%kind) state%slide(:, k, told) = slide
        end associate
    end subroutine keep_slide

    !> Origin of a link on one lane, world axes; z is 0 in the plane.
    pure function link_position(model, state, link, lane) result(position)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        integer, intent(in) :: link, lane
        real(wp) :: position(3)

        if (model%is_planar) then
            position = [state%plane%position(link)%x(lane), state%plane%position(link)%y(lane), 0.0_wp]
        else
            position = lane_of(state%position(link), lane)
        end if
    end function link_position

    !> Rotation of a link on one lane: columns are the images of its axes.
    pure function link_rotation(model, state, link, lane) result(rotation)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        integer, intent(in) :: link, lane
        real(wp) :: rotation(3, 3)

        if (model%is_planar) then
            associate (r => state%plane%rotation(model%link(link)%orientation))
                rotation = reshape([r%c(lane), r%s(lane), 0.0_wp, -r%s(lane), r%c(lane), 0.0_wp, &
                                    0.0_wp, 0.0_wp, 1.0_wp], [3, 3])
            end associate
        else
            rotation = mat3_lane(state%rotation(model%link(link)%orientation), lane)
        end if
    end function link_rotation
end module linkdyn_kinematic_state
