!> Joint variables and their rates, from the motion of the links.
module linkdyn_joint_rates
    use linkdyn_joint_motion, only: turn_frame, variables_of_relative, relative_axis, marker_axis
    use linkdyn_joint_table, only: is_slide, wraps, slide_axis, joint_planar, turns_about_point
    use linkdyn_constants, only: two_pi
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state
    use linkdyn_lane_count, only: lanes
    use linkdyn_model, only: model_type, orientation_of
    use linkdyn_planar_motion, only: level_velocity, level_given
    use linkdyn_planar_rates, only: measure_planar_joints, measure_planar_variable, planar_joint_rate
    use linkdyn_point, only: point_velocity
    use linkdyn_scene, only: joint_n_variable, coordinate_joint
    use linkdyn_vec3, only: vec3, mat3, operator(+), operator(-), operator(*), operator(.dot.), operator(.cross.), &
        operator(.rotate.)
    use linkdyn_whole_turns, only: nearest_turns
    implicit none (type, external)
    private
    public :: joint_view, view_joint, told_frame, measure_variable, coordinate_of, joint_rate, slide_column
    public :: measure_joints, measure_one_joint, actuator_rates, actuator_columns, normal_matrix

    !> The two markers of a joint in motion, world axes.
    type :: joint_view
        type(mat3) :: frame(2)
        type(vec3) :: point         !! of the second marker [m]
        type(vec3) :: slide         !! first to second point [m]
        type(vec3) :: slide_rate    !! seen from the first link [m/s]
        type(vec3) :: omega         !! second minus first link [rad/s]
    end type joint_view

contains

    !> All joint variables and rates. Needs angular rates in world axes.
    subroutine measure_joints(model, state, variable, rate)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        real(wp), intent(out) :: variable(lanes, *), rate(lanes, *)    !! (lane, n_variable) [m, rad]
        real(wp) :: q(lanes, 3), qd(lanes, 3)
        integer :: j, n

        if (model%is_planar) then
            call measure_planar_joints(model, state, variable, rate)
            return
        end if
        do j = 1, model%n_joint
            if (joint_n_variable(model%joint(j)%told_kind) == 0) cycle
            call measure_one_joint(model, state, j, q, qd)
            associate (first => model%joint(j)%first_variable)
                n = joint_n_variable(model%joint(j)%told_kind)
                variable(:, first + 1:first + n) = q(:, :n)
                rate(:, first + 1:first + n) = qd(:, :n)
            end associate
        end do
    end subroutine measure_joints

    !> The variables of one joint and their rates, angles in (-pi, pi]. Needs angular rates in world axes.
    subroutine measure_one_joint(model, state, j, variable, rate)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        integer, intent(in) :: j
        real(wp), intent(out) :: variable(lanes, 3), rate(lanes, 3)    !! [m, rad]
        type(joint_view) :: view

        if (model%is_planar) then
            variable(:, 2:) = 0
            rate(:, 2:) = 0
            call measure_planar_variable(model, state, j, variable(:, 1), rate(:, 1))
        else
            call view_joint(model, state, j, state%velocity, state%omega, view)
            call variables_of_relative(model%joint(j)%told_kind, told_frame(model, state, j, 1, view), &
                                       told_frame(model, state, j, 2, view), view%slide, view%slide_rate, view%omega, variable, &
                                       rate, model%joint(j)%pitch)
        end if
    end subroutine measure_one_joint

    !> One joint variable and its rate. A coordinate is taken as it is: it counts turns. A measured angle does not; of
    !> the values that it may have, the one nearest to `near` is taken. Where one coordinate stands in for another, the
    !> other still counts turns, and the one that stands in does not. Whoever wants to go on from the value takes its turns
    !> apart, lest it be rounded.
    !>
    !> Needs angular rates in world axes, except for coordinates.
    subroutine measure_variable(model, state, j, variable, near, value, rate, turns)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        integer, intent(in) :: j, variable
        real(wp), intent(in) :: near(lanes)                   !! [rad]; a slide does not look at it
        real(wp), intent(out) :: value(lanes), rate(lanes)    !! [m, rad], [m/s, rad/s]
        real(wp), intent(out), optional :: turns(lanes)       !! which are then not in the value
        real(wp) :: reference(lanes), whole(lanes)
        logical :: counts
        integer :: k

        reference = near
        whole = 0
        counts = .false.
        k = coordinate_of(model, j, variable)
        if (k > 0 .and. is_by_quaternion(model, state, j)) then
            call measure_in_space(model, state, j, variable, value, rate)
        else if (k > 0) then
            value = state%q(:, k)
            rate = state%qd(:, k)
            counts = model%scene%coordinate(k)%for_joint == 0
            if (counts) whole = state%turns(:, k)
        else if (model%is_planar) then
            call measure_planar_variable(model, state, j, value, rate)
        else
            call measure_in_space(model, state, j, variable, value, rate)
        end if
        k = stand_in_of(model, j, variable)
        if (k > 0) reference = state%counted(:, k)
        if (.not. counts .and. wraps(model%joint(j)%kind, variable)) whole = -nearest_turns(value - reference)
        if (present(turns)) then
            turns = whole
        else
            value = value + two_pi*whole
        end if
    end subroutine measure_variable

    !> Has a joint an attitude that comes as quaternion? Then its coordinates do not tell its angles.
    pure logical function is_by_quaternion(model, state, j)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        integer, intent(in) :: j

        is_by_quaternion = .false.
        if (model%joint(j)%attitude > 0) is_by_quaternion = state%by_quaternion(model%joint(j)%attitude)
    end function is_by_quaternion

    subroutine measure_in_space(model, state, j, variable, value, rate)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        integer, intent(in) :: j, variable
        real(wp), intent(out) :: value(lanes), rate(lanes)
        real(wp) :: q(lanes, 3), qd(lanes, 3)

        call measure_one_joint(model, state, j, q, qd)
        value = q(:, variable)
        rate = qd(:, variable)
    end subroutine measure_in_space

    !> Rate of a variable of a joint, of a ball how fast it turns about an axis of its first marker; at level k for a unit rate of
    !> coordinate k; at the level of what is given its acceleration. (What Coriolis and centripetal terms add is square to the axis,
    !> but for those of points at a distance, and where a joint has several axes.) Needs angular rates in world axes.
    function joint_rate(model, state, j, variable, level) result(rate)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        integer, intent(in) :: j, variable
        integer, intent(in) :: level                          !! the velocity, what is given, or a column
        real(wp) :: rate(lanes)
        type(joint_view) :: view, moving
        type(vec3) :: axis, pull(2)

        if (model%is_planar) then
            rate = planar_joint_rate(model, state, j, level)
            return
        end if
        if (level == level_velocity) then
            call view_joint(model, state, j, state%velocity, state%omega, view)
        else
            call view_joint(model, state, j, state%acceleration(level, :), state%alpha(level, :), view)
        end if
        if (level == level_given .and. has_several_axes()) then
            ! as the first link sees it, which turns
            call view_joint(model, state, j, state%velocity, state%omega, moving)
            associate (omega => state%omega(orientation_of(model, model%joint(j)%link(1))))
                view%omega = view%omega - (omega.cross.moving%omega)
                view%slide_rate = view%slide_rate - 2.0_wp*(omega.cross.moving%slide_rate)
            end associate
        end if
        axis = driven_axis(model, state, j, variable, view)
        if (.not. is_slide(model%joint(j)%told_kind, variable)) then
            rate = view%omega.dot.axis
            return
        end if
        if (level == level_given) then
            ! Both links are felt at the second marker.
            pull = [centripetal(1), centripetal(2)]
            view%slide_rate = view%slide_rate + (pull(2) - pull(1))
        end if
        rate = view%slide_rate.dot.axis

    contains

        pure logical function has_several_axes()

            has_several_axes = model%joint(j)%told_kind == joint_planar .or. turns_about_point(model%joint(j)%told_kind)
        end function has_several_axes

        function centripetal(side)
            integer, intent(in) :: side
            type(vec3) :: centripetal

            associate (link => model%joint(j)%link(side))
                associate (omega => state%omega(orientation_of(model, link)))
                    centripetal = omega.cross.(omega.cross.(view%point - state%position(link)))
                end associate
            end associate
        end function centripetal
    end function joint_rate

    !> Rate of a joint's slide for a unit rate of a coordinate. Needs the acceleration columns, in world axes.
    function slide_column(model, state, j, slide, k) result(rate)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        integer, intent(in) :: j, slide, k                    !! joint, which slide of it, coordinate
        real(wp) :: rate(lanes)
        type(joint_view) :: view

        if (model%is_planar) then
            rate = planar_joint_rate(model, state, j, k)
            return
        end if
        call view_joint(model, state, j, state%acceleration(k, :), state%alpha(k, :), view)
        rate = view%slide_rate.dot.marker_axis(view%frame(1), slide_axis(slide, model%joint(j)%kind))
    end function slide_column

    !> The coordinate that is a joint's variable; 0 if none is.
    pure integer function coordinate_of(model, j, variable) result(k)
        type(model_type), intent(in) :: model
        integer, intent(in) :: j, variable

        do k = model%n_q, 1, -1
            associate (c => model%scene%coordinate(k))
                if (c%kind == coordinate_joint .and. c%joint == j .and. c%variable == variable) return
            end associate
        end do
    end function coordinate_of

    !> The coordinate that stands in for a joint's variable; 0 if none does.
    pure integer function stand_in_of(model, j, variable) result(k)
        type(model_type), intent(in) :: model
        integer, intent(in) :: j, variable

        do k = model%n_q, 1, -1
            associate (c => model%scene%coordinate(k))
                if (c%for_joint == j .and. c%for_variable == variable) return
            end associate
        end do
    end function stand_in_of

    !> Rate of every driven joint variable.
    subroutine actuator_rates(model, state, rate)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        real(wp), intent(out) :: rate(lanes, *)    !! (lane, n_actuator) [m/s, rad/s]
        integer :: i

        do i = 1, model%n_actuator
            associate (drive => model%scene%actuator(i))
                rate(:, i) = joint_rate(model, state, drive%joint, drive%variable, level_velocity)
            end associate
        end do
    end subroutine actuator_rates

    !> Rate of every driven joint variable for a unit rate of each coordinate: the actuators' Jacobian.
    !> Needs the acceleration columns, which are the velocity columns too.
    subroutine actuator_columns(model, state, rate)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        real(wp), intent(out) :: rate(lanes, model%n_actuator, model%n_q)
        integer :: i, k

        do k = 1, model%n_q
            do i = 1, model%n_actuator
                associate (drive => model%scene%actuator(i))
                    rate(:, i, k) = joint_rate(model, state, drive%joint, drive%variable, k)
                end associate
            end do
        end do
    end subroutine actuator_columns

    !> J^T W J of the actuators' Jacobian, W the drives' shares: how drives that share the work hold the coordinates.
    pure function normal_matrix(model, jacobian) result(normal)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: jacobian(lanes, model%n_actuator, model%n_q)
        real(wp) :: normal(lanes, model%n_q, model%n_q)
        integer :: i, j, k

        normal = 0
        do k = 1, model%n_q
            do j = 1, model%n_q
                do i = 1, model%n_actuator
                    normal(:, j, k) = normal(:, j, k) + model%scene%actuator(i)%share*jacobian(:, i, j)*jacobian(:, i, k)
                end do
            end do
        end do
    end function normal_matrix

    !> About or along which a drive acts on the second link.
    pure function driven_axis(model, state, j, variable, view) result(axis)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        integer, intent(in) :: j, variable
        type(joint_view), intent(in) :: view
        type(vec3) :: axis

        axis = relative_axis(model%joint(j)%told_kind, variable, told_frame(model, state, j, 1, view), &
                             told_frame(model, state, j, 2, view))
    end function driven_axis

    !> A marker's frame as the scene has it.
    pure function told_frame(model, state, j, side, view) result(frame)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        integer, intent(in) :: j, side
        type(joint_view), intent(in) :: view
        type(mat3) :: frame

        frame = view%frame(side)
        if (model%joint(j)%kind /= model%joint(j)%told_kind) &
            frame = turn_frame(state%rotation(orientation_of(model, model%joint(j)%link(side))), &
                               model%joint(j)%told_frame(:, :, side))
    end function told_frame

    subroutine view_joint(model, state, j, link_velocity, link_omega, view)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        integer, intent(in) :: j
        type(vec3), intent(in) :: link_velocity(0:), link_omega(0:)
        type(joint_view), intent(out) :: view
        type(vec3) :: point(2), velocity(2), omega(2), arm
        integer :: side, link, o

        associate (joint => model%joint(j))
            do side = 1, 2
                link = joint%link(side)
                o = 0
                if (link > 0) o = model%link(link)%orientation
                view%frame(side) = turn_frame(state%rotation(o), joint%frame(:, :, side))
                arm = state%rotation(o).rotate.joint%point(:, side)
                point(side) = state%position(link) + arm
                omega(side) = link_omega(o)
                velocity(side) = point_velocity(link_velocity(link), omega(side), arm)
            end do
        end associate
        view%point = point(2)
        view%slide = point(2) - point(1)
        view%slide_rate = velocity(2) - point_velocity(velocity(1), omega(1), view%slide)
        view%omega = omega(2) - omega(1)
    end subroutine view_joint
end module linkdyn_joint_rates
