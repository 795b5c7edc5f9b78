!> What forward dynamics integrates: for every free coordinate its value and rate, for every free pose position,
!> quaternion, velocity and angular velocity, for every free spherical joint quaternion and angular velocity, since three
!> angles are not regular everywhere; the angles of coordinates that others stand in for, which count their
!> turns; integrals and filters of continuous controllers; currents in windings, pressures in cylinders; last the work of the
!> driving forces, and the energy that all forces but gravity supply.
module linkdyn_forward_state
    use linkdyn_drives, only: law_on_lanes
    use linkdyn_joint_motion, only: variables_of_relative
    use linkdyn_joint_table, only: is_threaded, joint_spherical
    use linkdyn_joint_rates, only: joint_rate
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state
    use linkdyn_lane_count, only: lanes
    use linkdyn_model, only: model_type, step_pose, gives_attitude, attitude_angles, repeats, counts_for_another
    use linkdyn_motor_laws, only: has_winding
    use linkdyn_planar_motion, only: level_velocity
    use linkdyn_pose, only: rpy_rotation, rotate_rpy, angular_velocity_rpy
    use linkdyn_quaternion, only: rotation_of_quaternion, quaternion_rate, quaternion_of_rpy
    use linkdyn_scene, only: scene_type, law_none, n_controller, n_chamber, is_sampled, side_opening
    use linkdyn_status, only: status_type, fail, status_bad_input
    use linkdyn_text, only: quoted
    use linkdyn_vec3, only: vec3, identity_mat3, zero_vec3
    use linkdyn_way_gone, only: family_alone, family_place, family_rate
    use linkdyn_whole_turns, only: with_turns
    implicit none (type, external)
    private
    public :: state_layout, plan_layout, angles_of_state, families_of_state, choose_free, fill_start, unpack_state, pack_rates, &
        read_coordinates, read_attitudes
    public :: scene_start, counted_rates

    !> Where everything stands in y.
    type :: state_layout
        integer :: n = 0
        integer, allocatable :: position(:)      !! of a free coordinate; angles of a free attitude: 0 (n_q)
        integer, allocatable :: rate(:)          !! its rate; of an attitude the angular velocity; 0: driven (n_q)
        integer, allocatable :: quaternion(:)    !! w of a free attitude, x y z follow; 0: by its angles (n_attitude)
        integer, allocatable :: attitude_step(:) !! step of the kinematics that gives the attitude (n_attitude)
        integer, allocatable :: counted(:)       !! angle that a coordinate stands in for; 0: none (n_q)
        integer, allocatable :: integral(:)      !! I part of a continuous controller; 0: it has none (n_controller)
        integer, allocatable :: slope(:)         !! its D part behind a filter; 0: it has none (n_controller)
        integer, allocatable :: current(:)       !! in the winding of a motor; 0: it has no inductance (n_actuator)
        integer, allocatable :: pressure(:)      !! in the head of a cylinder, the other follows; 0: it has none (n_actuator)
        integer :: work = 0                      !! of the driving forces
        integer :: supplied = 0                  !! energy that all forces but gravity have supplied
    end type state_layout

contains

    !> Free are the coordinates that the scene does not drive.
    !>
    !> **Errors**: `status_bad_input` for a pose that is partly driven, and for a driven coordinate without motion.
    subroutine choose_free(model, is_free, status)
        type(model_type), intent(in) :: model
        logical, allocatable, intent(out) :: is_free(:)
        type(status_type), intent(inout) :: status
        integer :: i

        is_free = .not. model%scene%coordinate%is_driven
        do i = 1, model%n_q
            associate (c => model%scene%coordinate(i))
                if (c%is_driven .and. c%motion%kind == law_none) call fail(status, status_bad_input, "coordinate " &
                    //quoted(c%name)//" is driven but has no motion (expected motion = { law = .. })")
            end associate
        end do
        do i = 1, size(model%step)
            if (model%step(i)%kind /= step_pose) cycle
            associate (c => pack(model%step(i)%coordinate, model%step(i)%coordinate > 0))
                if (any(is_free(c)) .and. .not. all(is_free(c))) call fail(status, status_bad_input, "link " &
                    //quoted(model%link(model%step(i)%link(1))%name)//": its pose is driven in part " &
                    //"(expected all its components driven, or none)")
            end associate
        end do
    end subroutine choose_free

    !> Where each number of the state stands: places of free coordinates, their rates, what controllers, motors, cylinders keep.
    subroutine plan_layout(model, is_free, layout)
        type(model_type), intent(in) :: model
        logical, intent(in) :: is_free(:)
        type(state_layout), intent(out) :: layout
        integer :: i, k

        allocate (layout%position(model%n_q), layout%rate(model%n_q), layout%quaternion(model%n_attitude), &
                  layout%attitude_step(model%n_attitude), layout%counted(model%n_q))
        layout%counted = 0
        layout%position = 0
        layout%rate = 0
        layout%quaternion = 0
        do i = 1, size(model%step)
            if (.not. gives_attitude(model, model%step(i))) cycle
            associate (step => model%step(i), angle => attitude_angles(model%step(i)))
                layout%attitude_step(step%first) = i
                if (.not. all(is_free(angle))) cycle
                do k = 1, merge(3, 0, step%kind == step_pose)
                    layout%position(step%coordinate(k)) = layout%n + k
                end do
                layout%n = layout%n + merge(3, 0, step%kind == step_pose)
                layout%quaternion(step%first) = layout%n + 1
                layout%n = layout%n + 4
                layout%position(angle) = -1                   ! taken by the quaternion
            end associate
        end do
        do k = 1, model%n_q
            if (.not. is_free(k) .or. layout%position(k) /= 0) cycle
            layout%n = layout%n + 1
            layout%position(k) = layout%n
        end do
        where (layout%position < 0) layout%position = 0
        do k = 1, model%n_q
            if (.not. is_free(k)) cycle
            layout%n = layout%n + 1
            layout%rate(k) = layout%n
        end do
        do k = 1, model%n_q
            if (.not. counts_for_another(model, k)) cycle
            layout%n = layout%n + 1
            layout%counted(k) = layout%n
        end do
        call plan_controllers(model%scene, layout)
        allocate (layout%current(model%n_actuator), source=0)
        do k = 1, model%n_actuator
            if (.not. has_winding(model%scene%actuator(k))) cycle
            layout%n = layout%n + 1
            layout%current(k) = layout%n
        end do
        allocate (layout%pressure(model%n_actuator), source=0)
        do k = 1, model%n_actuator
            if (model%scene%actuator(k)%law%side /= side_opening) cycle
            layout%pressure(k) = layout%n + 1
            layout%n = layout%n + n_chamber
        end do
        layout%work = layout%n + 1
        layout%supplied = layout%n + 2
        layout%n = layout%n + 2
    end subroutine plan_layout

    !> What continuous controllers have in y.
    subroutine plan_controllers(scene, layout)
        type(scene_type), intent(in) :: scene
        type(state_layout), intent(inout) :: layout
        integer :: i

        allocate (layout%integral(n_controller(scene)), layout%slope(n_controller(scene)), source=0)
        do i = 1, n_controller(scene)
            associate (spec => scene%controller(i))
                if (is_sampled(spec)) cycle
                if (abs(spec%ki) > 0) call take(layout%integral(i))
                if (spec%filter > 0) call take(layout%slope(i))
            end associate
        end do

    contains

        subroutine take(place)
            integer, intent(out) :: place

            layout%n = layout%n + 1
            place = layout%n
        end subroutine take
    end subroutine plan_controllers

    !> Which components of y are angles after a turn of which the mechanism looks alike.
    pure function angles_of_state(model, layout) result(is_angle)
        type(model_type), intent(in) :: model
        type(state_layout), intent(in) :: layout
        logical :: is_angle(layout%n)
        integer :: k

        is_angle = .false.
        do k = 1, model%n_q
            if (layout%position(k) > 0) is_angle(layout%position(k)) = repeats(model, k)
            if (layout%counted(k) > 0) is_angle(layout%counted(k)) = .not. any(is_threaded(model%joint%kind))
        end do
    end function angles_of_state

    !> Which components of y are places, and which the rates of such.
    pure function families_of_state(layout) result(family)
        type(state_layout), intent(in) :: layout
        integer :: family(layout%n)
        integer :: i, k

        family = family_alone
        family(pack(layout%position, layout%position > 0)) = family_place
        family(pack(layout%rate, layout%rate > 0)) = family_rate
        family(pack(layout%counted, layout%counted > 0)) = family_place
        do i = 1, size(layout%quaternion)
            if (layout%quaternion(i) > 0) family([(layout%quaternion(i) + k, k=0, 3)]) = family_place
        end do
    end function families_of_state

    !> Coordinates and rates at the start: as the scene says, or else what the motion law has at t.
    subroutine scene_start(model, t, q, qd)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: t                     !! [s]
        real(wp), intent(out) :: q(:), qd(:)          !! (n_q)
        real(wp), dimension(lanes) :: value, rate, rate2
        integer :: k

        do k = 1, model%n_q
            associate (c => model%scene%coordinate(k))
                q(k) = c%start_position
                qd(k) = c%start_velocity
                if ((c%has_start .and. .not. c%is_driven) .or. c%motion%kind == law_none) cycle
                call law_on_lanes(c%motion, spread(t, 1, lanes), value, rate, rate2)
                q(k) = value(1)
                qd(k) = rate(1)
            end associate
        end do
    end subroutine scene_start

    !> y from coordinates and their rates.
    subroutine fill_start(model, layout, q, qd, y, counted)
        type(model_type), intent(in) :: model
        type(state_layout), intent(in) :: layout
        real(wp), intent(in) :: q(lanes, model%n_q), qd(lanes, model%n_q)
        real(wp), intent(out) :: y(lanes, layout%n)
        real(wp), intent(in), optional :: counted(:)  !! what coordinates stand in for (n_q); absent: none does
        type(rpy_rotation) :: turn
        type(vec3) :: omega
        integer :: k, p

        y = 0
        do k = 1, model%n_q
            if (layout%position(k) > 0) y(:, layout%position(k)) = q(:, k)
            if (layout%rate(k) > 0) y(:, layout%rate(k)) = qd(:, k)
            if (layout%counted(k) > 0 .and. present(counted)) y(:, layout%counted(k)) = counted(k)
        end do
        do p = 1, model%n_attitude
            if (layout%quaternion(p) == 0) cycle
            associate (c => attitude_angles(model%step(layout%attitude_step(p))), first => layout%quaternion(p))
                y(:, first:first + 3) = quaternion_of_rpy(q(:, c(1)), q(:, c(2)), q(:, c(3)))
                call rotate_rpy(q(:, c(1)), q(:, c(2)), q(:, c(3)), turn)
                omega = angular_velocity_rpy(turn, qd(:, c))
                y(:, layout%rate(c(1))) = omega%x
                y(:, layout%rate(c(2))) = omega%y
                y(:, layout%rate(c(3))) = omega%z
            end associate
        end do
    end subroutine fill_start

    !> Input of the kinematics from y, and from the motion laws of driven coordinates. Accelerations of free ones are zero.
    subroutine unpack_state(model, layout, t, y, turns, state)
        type(model_type), intent(in) :: model
        type(state_layout), intent(in) :: layout
        real(wp), intent(in) :: t(lanes)              !! [s]
        real(wp), intent(in), contiguous :: y(:, :)   !! (lane, n)
        real(wp), intent(in), contiguous :: turns(:, :)       !! of angles that are not in y (lane, n)
        type(kinematic_state), intent(inout) :: state
        integer :: k, p

        do k = 1, model%n_q
            if (layout%rate(k) == 0) then
                call law_on_lanes(model%scene%coordinate(k)%motion, t, state%q(:, k), state%qd(:, k), state%qdd(:, k))
            else
                if (layout%position(k) > 0) then
                    state%q(:, k) = y(:, layout%position(k))
                    state%turns(:, k) = turns(:, layout%position(k))
                end if
                state%qd(:, k) = y(:, layout%rate(k))
                state%qdd(:, k) = 0
            end if
            if (layout%counted(k) > 0) &
                state%counted(:, k) = with_turns(y(:, layout%counted(k)), turns(:, layout%counted(k)))
        end do
        do p = 1, model%n_attitude
            state%by_quaternion(p) = layout%quaternion(p) > 0
            if (state%by_quaternion(p)) state%quaternion(:, :, p) = y(:, layout%quaternion(p):layout%quaternion(p) + 3)
        end do
    end subroutine unpack_state

    !> dy/dt from y and the accelerations; the rates of work and energy are left alone.
    subroutine pack_rates(model, layout, n, y, acceleration, counted, rate)
        type(model_type), intent(in) :: model
        type(state_layout), intent(in) :: layout
        integer, intent(in) :: n                      !! lanes that anybody looks at
        real(wp), intent(in) :: y(:, :)               !! (lane, n)
        real(wp), intent(in) :: acceleration(:, :)    !! (lane, n_q); of a pose those of velocity and angular velocity
        real(wp), intent(in) :: counted(:, :)         !! rates of the angles that coordinates stand in for (lane, n_q) [rad/s]
        real(wp), intent(inout) :: rate(:, :)         !! (lane, n)
        integer :: k, p, lane, angle(3)

        do k = 1, model%n_q
            if (layout%rate(k) == 0) cycle
            do lane = 1, n
                if (layout%position(k) > 0) rate(lane, layout%position(k)) = y(lane, layout%rate(k))
                rate(lane, layout%rate(k)) = acceleration(lane, k)
                if (layout%counted(k) > 0) rate(lane, layout%counted(k)) = counted(lane, k)
            end do
        end do
        do p = 1, model%n_attitude
            if (layout%quaternion(p) == 0) cycle
            angle = attitude_angles(model%step(layout%attitude_step(p)))
            associate (first => layout%quaternion(p), omega => layout%rate(angle))
                do lane = 1, n
                    call quaternion_rate(y(lane, first), y(lane, first + 1), y(lane, first + 2), y(lane, first + 3), &
                                         y(lane, omega(1)), y(lane, omega(2)), y(lane, omega(3)), rate(lane, first), &
                                         rate(lane, first + 1), rate(lane, first + 2), rate(lane, first + 3))
                end do
            end associate
        end do
    end subroutine pack_rates

    !> Rates of the angles that coordinates stand in for, on lanes; zero of others.
    function counted_rates(model, state) result(rate)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        real(wp) :: rate(lanes, model%n_q)            !! [rad/s]
        integer :: k

        rate = 0
        do k = 1, model%n_q
            if (counts_for_another(model, k)) rate(:, k) = joint_rate( &
                model, state, model%scene%coordinate(k)%for_joint, model%scene%coordinate(k)%for_variable, level_velocity)
        end do
    end function counted_rates

    !> Attitudes of y at an instant as the kinematics takes them, on lane 1: quaternions, and angular rates in place of those
    !> of angles.
    pure subroutine read_attitudes(model, layout, y, quaternion, qd)
        type(model_type), intent(in) :: model
        type(state_layout), intent(in) :: layout
        real(wp), intent(in) :: y(:)                  !! (n)
        real(wp), intent(out) :: quaternion(:, :)     !! (4, n_attitude); 0: by its angles
        real(wp), intent(inout) :: qd(:)              !! (n_q)
        integer :: p

        quaternion = 0
        do p = 1, model%n_attitude
            if (layout%quaternion(p) == 0) cycle
            quaternion(:, p) = y(layout%quaternion(p):layout%quaternion(p) + 3)
            associate (c => attitude_angles(model%step(layout%attitude_step(p))))
                qd(c) = y(layout%rate(c))
            end associate
        end do
    end subroutine read_attitudes

    !> Coordinates and rates for output: orientation as roll, pitch, yaw in (-pi, pi].
    subroutine read_coordinates(model, layout, t, y, turns, state, q, qd, qdd)
        type(model_type), intent(in) :: model
        type(state_layout), intent(in) :: layout
        real(wp), intent(in) :: t(lanes)              !! [s]
        real(wp), intent(in) :: y(:, :)               !! (lane, n)
        real(wp), intent(in) :: turns(:, :)           !! of angles that are not in y (lane, n)
        type(kinematic_state), intent(inout) :: state !! scratch
        real(wp), intent(out) :: q(:, :), qd(:, :)    !! (lane, n_q)
        real(wp), intent(out) :: qdd(:, :)            !! of driven coordinates; zero for free ones
        real(wp), dimension(lanes, 3) :: angle, angle_rate
        integer :: p

        call unpack_state(model, layout, t, y, turns, state)
        q = with_turns(state%q, state%turns)
        qd = state%qd
        qdd = state%qdd
        do p = 1, model%n_attitude
            if (layout%quaternion(p) == 0) cycle
            associate (c => attitude_angles(model%step(layout%attitude_step(p))))
                call variables_of_relative(joint_spherical, identity_mat3(), rotation_of_quaternion(state%quaternion(:, :, p)), &
                                           zero_vec3(), zero_vec3(), vec3(qd(:, c(1)), qd(:, c(2)), qd(:, c(3))), &
                                           angle, angle_rate)
                q(:, c) = angle
                qd(:, c) = angle_rate
            end associate
        end do
    end subroutine read_coordinates
end module linkdyn_forward_state
