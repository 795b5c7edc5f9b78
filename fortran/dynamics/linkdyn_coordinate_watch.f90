!> Is a coordinate of a planar mechanism coming to its dead point, and which joint variable could take its place?
!>
!> At a dead point of a coordinate the mechanism moves on while the coordinate stands still: the rates that a unit rate of
!> the coordinate gives to other joint variables grow without bound. They are compared as speeds: a slide has its own, an
!> angle that of the pins that it moves. The ratio of two such speeds has no size and no unit, and it is near one where
!> both coordinates are good.
!>
!> At a change point rates stay finite, though the dyad's map is singular there: it is no dead point of the coordinate.
module linkdyn_coordinate_watch
    use linkdyn_dyad_map, only: transmission_sine
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state, prepare_kinematics
    use linkdyn_model, only: model_type, side_of
    use linkdyn_planar_motion, only: planar_motion
    use linkdyn_planar_rates, only: planar_joint_rate
    use linkdyn_scene, only: coordinate_joint, joint_prismatic, frame_link
    implicit none (type, external)
    private
    public :: coordinate_watch, prepare_watch, compare_rates, is_near_dead_point, dead_coordinate, may_be_near

    real(wp), parameter :: largest_ratio = 10       !! that a coordinate in use may have
    real(wp), parameter :: dead_ratio = 1000        !! beyond it the coordinate says too little of the motion
    real(wp), parameter :: least_sine = 0.3_wp      !! of a transmission angle: no dead point is near
    real(wp), parameter :: good_ratio = 3           !! no dead point is looked for ahead
    integer, parameter :: least_steps = 50          !! before a dead point, where steps are not cut by their error

    type :: coordinate_watch
        logical :: is_on = .false.
        logical :: may_exchange = .true.            !! false: it is only seen whether a coordinate is at its dead point
        logical :: has_equal_steps = .false.        !! a dead point is looked for some steps ahead
        integer, allocatable :: joint(:)            !! of a coordinate that may be exchanged; 0 (n_q)
        logical, allocatable :: is_candidate(:)     !! its variable may become a coordinate (n_joint)
        real(wp), allocatable :: arm(:)             !! what makes the joint's rate a speed: 1 at a slide [m] (n_joint)
        real(wp), allocatable :: ratio(:, :)        !! speed of a joint over that of a coordinate alone (n_joint, n_q)
        real(wp), allocatable :: before(:, :)       !! the same one step before; 0: not known
        type(kinematic_state) :: state              !! at the position looked at
    end type coordinate_watch

contains

    subroutine prepare_watch(model, is_free, watch)
        type(model_type), intent(in) :: model
        logical, intent(in) :: is_free(:)           !! coordinates that are not driven (n_q)
        type(coordinate_watch), intent(out) :: watch
        integer :: k

        allocate (watch%joint(model%n_q), watch%is_candidate(model%n_joint), watch%arm(model%n_joint), &
                  watch%ratio(model%n_joint, model%n_q), watch%before(model%n_joint, model%n_q))
        watch%joint = 0
        watch%is_candidate = .true.
        watch%ratio = 0
        watch%before = 0
        do k = 1, model%n_q
            associate (c => model%scene%coordinate(k))
                if (c%kind /= coordinate_joint) cycle
                watch%is_candidate(c%joint) = .false.
                if (is_free(k)) watch%joint(k) = c%joint
            end associate
        end do
        call find_arms(model, watch%arm)
        watch%is_on = model%is_planar .and. any(watch%joint > 0) .and. (model%n_dyad > 0 .or. size(model%group) > 0)
        if (watch%is_on) call prepare_kinematics(model, model%n_q, watch%state)
    end subroutine prepare_watch

    !> Of a hinge: how far the pins that it moves are away, on the smaller of its moving links.
    subroutine find_arms(model, arm)
        type(model_type), intent(in) :: model
        real(wp), intent(out) :: arm(:)             !! [m]
        real(wp) :: reach
        integer :: j, side

        do j = 1, model%n_joint
            arm(j) = 0
            do side = 1, 2
                reach = reach_of(model, j, model%joint(j)%link(side))
                if (reach > 0 .and. (arm(j) == 0 .or. reach < arm(j))) arm(j) = reach
            end do
        end do
        where (arm == 0) arm = max(maxval(arm), tiny(1.0_wp))
        where (model%joint%kind == joint_prismatic) arm = 1
    end subroutine find_arms

    !> Largest distance of a joint from the others of a moving link, or from its centre of mass.
    pure real(wp) function reach_of(model, j, link) result(reach)
        type(model_type), intent(in) :: model
        integer, intent(in) :: j, link
        integer :: i

        reach = 0
        if (link == frame_link) return
        associate (here => model%joint(j)%point(:2, side_of(model%joint(j), link)))
            do i = model%first_at(link), model%first_at(link + 1) - 1
                associate (other => model%joint(model%joint_at(i)))
                    reach = max(reach, norm2(other%point(:2, side_of(other, link)) - here))
                end associate
            end do
            if (reach == 0) reach = norm2(model%link(link)%cog(:2) - here)
        end associate
    end function reach_of

    !> Could a coordinate be near a dead point, as far as the dyads tell?
    pure logical function may_be_near(model, plane)
        type(model_type), intent(in) :: model
        type(planar_motion), intent(in) :: plane    !! positions are up to date
        integer :: d

        may_be_near = size(model%group) > 0
        do d = 1, model%n_dyad
            may_be_near = may_be_near .or. minval(transmission_sine(plane%dyad(d))) < least_sine
        end do
    end function may_be_near

    !> Speeds of all joints for a unit speed of each coordinate, on lane 1 of the state, whose columns are up to date.
    subroutine compare_rates(model, watch)
        type(model_type), intent(in) :: model
        type(coordinate_watch), intent(inout) :: watch
        integer :: j, k

        watch%before = watch%ratio
        watch%ratio = 0
        if (watch%state%unreachable(1) .or. watch%state%singular(1) .or. watch%state%not_converged(1)) return
        do k = 1, model%n_q
            if (watch%joint(k) == 0) cycle
            do j = 1, model%n_joint
                if (watch%is_candidate(j)) watch%ratio(j, k) = lane_1(planar_joint_rate(model, watch%state, j, k)) &
                                                               *watch%arm(j)/watch%arm(watch%joint(k))
            end do
        end do

    contains

        pure real(wp) function lane_1(values)
            real(wp), intent(in) :: values(:)

            lane_1 = values(1)
        end function lane_1
    end subroutine compare_rates

    !> The coordinate that is at its dead point, for all that it can be used; 0: none.
    pure integer function dead_coordinate(watch, has_failed) result(k)
        type(coordinate_watch), intent(in) :: watch
        logical, intent(in) :: has_failed           !! the run cannot go on: near is enough

        do k = size(watch%joint), 1, -1
            if (any(abs(watch%ratio(:, k)) > merge(good_ratio, dead_ratio, has_failed))) return
        end do
    end function dead_coordinate

    !> Does any joint move much faster than a coordinate, or will it, before some more steps are done?
    pure logical function is_near_dead_point(watch) result(is_near)
        type(coordinate_watch), intent(in) :: watch

        is_near = any(abs(watch%ratio) > largest_ratio)
        if (.not. watch%has_equal_steps .or. is_near) return
        ! The coordinate's own speed, in that of the other, goes through zero at a dead point.
        is_near = any(abs(watch%ratio) > good_ratio .and. watch%before /= 0 &
                      .and. least_steps*(abs(watch%ratio) - abs(watch%before)) > abs(watch%before) &
                      .and. watch%ratio*watch%before > 0)
    end function is_near_dead_point
end module linkdyn_coordinate_watch
