!> The kinematic program: positions, velocities and acceleration columns of all links, step by step.
!>
!> One pass serves every analysis. Column 0 always carries the motion prescribed by q, qd, qdd; the further columns
!> are computed only if the state was prepared for them.
module linkdyn_kinematic_pass
    use linkdyn_csp_step, only: close_csp
    use linkdyn_given, only: given_position, given_rate, given_acceleration, given_column, given_moves, &
        has_lost_turns
    use linkdyn_kinds, only: wp
    use linkdyn_joint_motion, only: relative_motion, relative_by_variables, relative_by_quaternion, marker_axis, turn_frame, &
        turn_frame_back
    use linkdyn_joint_table, only: is_slide, is_threaded, slide_axis, n_slide
    use linkdyn_kinematic_state, only: kinematic_state
    use linkdyn_lane_count, only: lanes
    use linkdyn_model, only: model_type, step_type, step_pose, step_joint, step_ups, step_group, orientation_of
    use linkdyn_newton_group, only: close_group
    use linkdyn_planar_pass, only: run_planar_step
    use linkdyn_point, only: point_velocity, point_acceleration, point_column
    use linkdyn_pose, only: rpy_rotation, rotate_rpy, angular_velocity_rpy, angular_acceleration_rpy
    use linkdyn_quaternion, only: rotation_of_quaternion
    use linkdyn_status, only: sample_unreachable, sample_singular, sample_not_converged, sample_branch_lost
    use linkdyn_ups_leg, only: locate_ups_leg, move_ups_leg, accelerate_ups_leg, map_ups_column
    use linkdyn_vec3, only: vec3, mat3, operator(+), operator(-), operator(*), operator(.dot.), operator(.cross.), &
        operator(.rotate.), operator(.unrotate.), vec3_of
    implicit none (type, external)
    private
    public :: run_program, run_step, clear_flags

contains

    !> Run the program on the block whose coordinates are in the state. Closed forms are on the branches of the state;
    !> groups are closed by iteration from where their links are.
    subroutine run_program(model, state)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(inout) :: state
        integer :: i

        call clear_flags(state)
        do i = 1, size(model%step)
            call run_step(model, model%step(i), state)
        end do
        call flag_lost(state)
    end subroutine run_program

    !> Whatever went wrong in an earlier block is forgotten.
    pure subroutine clear_flags(state)
        type(kinematic_state), intent(inout) :: state

        state%unreachable = .false.
        state%singular = .false.
        state%not_converged = .false.
        state%branch_lost = .false.
        state%uncertainty = 0
        if (allocated(state%group%contraction)) state%group%contraction = 0
    end subroutine clear_flags

    !> Lanes to which their assembly could not be followed.
    pure subroutine flag_lost(state)
        type(kinematic_state), intent(inout) :: state

        state%unreachable = state%unreachable .or. state%way_status == sample_unreachable
        state%singular = state%singular .or. state%way_status == sample_singular
        state%not_converged = state%not_converged .or. state%way_status == sample_not_converged
        state%branch_lost = state%branch_lost .or. state%way_status == sample_branch_lost
    end subroutine flag_lost

    !> One step of the program; the steps before it have been run.
    subroutine run_step(model, step, state)
        type(model_type), intent(in) :: model
        type(step_type), intent(in) :: step
        type(kinematic_state), intent(inout) :: state
        integer :: i

        if (step%kind == step_group) then
            call close_group(model, step%first, state)
            call flag_turned(model%group(step%first)%coordinate(1, :))
            if (model%is_planar) return
            do i = 1, size(model%group(step%first)%link)
                call turn_into_link(model, model%group(step%first)%link(i), state)
            end do
            return
        end if
        if (model%is_planar) then
            call run_planar_step(model, step, state)
            return
        end if
        select case (step%kind)
        case (step_pose)
            call take_pose(model, step, state)
        case (step_joint)
            call walk_joint(model, step, state)
        case (step_ups)
            call close_ups_leg(model, step, state)
        case default
            call close_csp(model, step, state)
            call turn_into_link(model, step%link(1), state)
            call turn_into_link(model, step%link(2), state)
        end select

    contains

        !> What gears give from angles whose turns may be others.
        subroutine flag_turned(given)
            integer, intent(in) :: given(:)
            integer :: k

            do k = 1, size(given)
                if (given(k) > model%n_q) state%branch_lost = state%branch_lost .or. has_lost_turns(model, state, given(k))
            end do
        end subroutine flag_turned
    end subroutine run_step

    !> Does the attitude that a step gives come as quaternion?
    pure logical function is_by_quaternion(state, step)
        type(kinematic_state), intent(in) :: state
        type(step_type), intent(in) :: step

        is_by_quaternion = .false.
        if (step%first > 0) is_by_quaternion = state%by_quaternion(step%first)
    end function is_by_quaternion

    !> A link whose pose is given by six coordinates.
    subroutine take_pose(model, step, state)
        type(model_type), intent(in) :: model
        type(step_type), intent(in) :: step
        type(kinematic_state), intent(inout) :: state
        type(rpy_rotation) :: turn
        real(wp) :: axis(3)
        integer :: link, o, k

        link = step%link(1)
        o = model%link(link)%orientation
        associate (c => step%coordinate)
            if (is_by_quaternion(state, step)) then
                state%rotation(o) = rotation_of_quaternion(state%quaternion(:, :, step%first))
                state%omega(o) = from_components(columns(state%qd, c(4:6)))
                state%alpha(0, o) = from_components(columns(state%qdd, c(4:6)))
            else
                call rotate_rpy(state%q(:, c(4)), state%q(:, c(5)), state%q(:, c(6)), turn)
                state%rotation(o) = turn%r
                state%omega(o) = angular_velocity_rpy(turn, columns(state%qd, c(4:6)))
                state%alpha(0, o) = angular_acceleration_rpy(turn, columns(state%qd, c(4:6)), columns(state%qdd, c(4:6)))
            end if
            state%position(link) = from_components(columns(state%q, c(1:3)))
            state%velocity(link) = from_components(columns(state%qd, c(1:3)))
            state%acceleration(0, link) = from_components(columns(state%qdd, c(1:3)))
            if (state%n_column > 0) then
                do k = 1, 3
                    axis = 0
                    axis(k) = 1
                    state%acceleration(c(k), link) = vec3_of(axis)
                    state%alpha(c(k + 3), o) = vec3_of(axis)
                end do
            end if
        end associate
        call turn_into_link(model, link, state)
    end subroutine take_pose

    !> Three columns of some coordinates' values: a vector subscript would make room for them on the heap.
    pure function columns(values, c) result(three)
        real(wp), intent(in) :: values(:, :)            !! (lane, n_q)
        integer, intent(in) :: c(3)
        real(wp) :: three(lanes, 3)
        integer :: k

        do k = 1, 3
            three(:, k) = values(:, c(k))
        end do
    end function columns

    !> Open chain: the second link of a joint whose variables are coordinates (or the first, seen from the second).
    subroutine walk_joint(model, step, state)
        type(model_type), intent(in) :: model
        type(step_type), intent(in) :: step
        type(kinematic_state), intent(inout) :: state
        type(relative_motion) :: motion
        type(mat3) :: first
        type(vec3) :: arm, point, slide
        real(wp), dimension(lanes, 3) :: q, qd, qdd
        real(wp) :: sense, part(lanes)
        integer :: from, to, known, link, o_known, o, i, k

        associate (joint => model%joint(step%joint(1)))
            ! Walked backwards, the joint is the same joint with its variables reversed.
            from = merge(2, 1, step%from_second)
            to = 3 - from
            sense = merge(-1.0_wp, 1.0_wp, step%from_second)
            known = joint%link(from)
            link = joint%link(to)
            o_known = orientation_of(model, known)
            o = model%link(link)%orientation
            q = 0
            qd = 0
            qdd = 0
            do i = 1, 3
                if (step%coordinate(i) == 0) exit
                q(:, i) = sense*given_position(model, state, step%coordinate(i))
                state%branch_lost = state%branch_lost .or. has_lost_turns(model, state, step%coordinate(i))
                qd(:, i) = sense*given_rate(model, state, step%coordinate(i))
                qdd(:, i) = sense*given_acceleration(model, state, step%coordinate(i))
            end do
            first = turn_frame(state%rotation(o_known), joint%frame(:, :, from))
            if (is_by_quaternion(state, step)) then
                call relative_by_quaternion(first, state%quaternion(:, :, step%first), from_components(qd), &
                                            from_components(qdd), motion)
            else
                call relative_by_variables(joint%kind, first, q, qd, qdd, motion, joint%pitch)
            end if
            do i = 1, n_slide(joint%kind)
                state%slide(:, i, step%joint(1)) = sense*(motion%slide.dot.marker_axis(first, slide_axis(i, joint%kind)))
            end do

            ! Angular motion: seen from the known link, so its own rotation turns the relative rates as well.
            ! Links that only slide on each other share it.
            if (o /= o_known) then
                state%omega(o) = state%omega(o_known) + motion%omega
                state%alpha(0, o) = state%alpha(0, o_known) + motion%alpha + (state%omega(o_known).cross.motion%omega)
                state%rotation(o) = turn_frame_back(motion%frame, joint%frame(:, :, to))
            end if

            ! The other marker's point, then the origin of its link. 2 omega x slide_rate is the Coriolis part.
            slide = (state%rotation(o_known).rotate.joint%point(:, from)) + motion%slide
            arm = (-1.0_wp)*(state%rotation(o).rotate.joint%point(:, to))
            point = state%position(known) + slide
            state%position(link) = point + arm
            point = point_velocity(state%velocity(known), state%omega(o_known), slide) + motion%slide_rate
            state%velocity(link) = point_velocity(point, state%omega(o), arm)
            point = point_acceleration(state%acceleration(0, known), state%omega(o_known), &
                                       state%alpha(0, o_known), slide) &
                    + motion%slide_rate2 + 2.0_wp*(state%omega(o_known).cross.motion%slide_rate)
            state%acceleration(0, link) = point_acceleration(point, state%omega(o), state%alpha(0, o), arm)

            do k = 1, state%n_column
                if (o /= o_known) state%alpha(k, o) = state%alpha(k, o_known)
                point = point_column(state%acceleration(k, known), state%alpha(k, o_known), slide)
                do i = 1, 3
                    if (step%coordinate(i) == 0) exit
                    if (.not. given_moves(model, step%coordinate(i), k)) cycle
                    part = sense*given_column(model, state, step%coordinate(i), k)
                    if (is_slide(joint%kind, i)) then
                        point = point + part*motion%axis(i)
                    else if (is_threaded(joint%kind)) then
                        point = point + (part*joint%pitch)*motion%axis(i)
                        state%alpha(k, o) = state%alpha(k, o) + part*motion%axis(i)
                    else
                        state%alpha(k, o) = state%alpha(k, o) + part*motion%axis(i)
                    end if
                end do
                state%acceleration(k, link) = point_column(point, state%alpha(k, o), arm)
            end do
        end associate
        call turn_into_link(model, link, state)
    end subroutine walk_joint

    !> A UPS leg between two known links.
    subroutine close_ups_leg(model, step, state)
        type(model_type), intent(in) :: model
        type(step_type), intent(in) :: step
        type(kinematic_state), intent(inout) :: state
        type(vec3) :: base_arm, top_arm, base_point, top_point, axis, a, base_a
        integer :: base, top, o_base, o_top, o, k

        associate (universal => model%joint(step%joint(1)), spherical => model%joint(step%joint(3)), &
                   lower => step%link(1), upper => step%link(2))
            base = universal%link(1)
            top = spherical%link(2)
            o_base = orientation_of(model, base)
            o_top = orientation_of(model, top)
            o = model%link(lower)%orientation
            associate (leg => state%leg(step%first))
                top_arm = state%rotation(o_top).rotate.spherical%point(:, 2)
                top_point = state%position(top) + top_arm
                if (step%base_moves) then
                    base_arm = state%rotation(o_base).rotate.universal%point(:, 1)
                    base_point = state%position(base) + base_arm
                    axis = state%rotation(o_base).rotate.universal%frame(:, 3, 1)
                else
                    base_point = vec3_of(universal%point(:, 1))
                    axis = vec3_of(universal%frame(:, 3, 1))
                end if
                call locate_ups_leg(top_point - base_point, axis, leg)
                state%unreachable = state%unreachable .or. .not. (leg%length > 0 .and. abs(leg%tilt) <= huge(1.0_wp))
                state%rotation(o) = leg%axes
                state%position(lower) = base_point
                state%position(upper) = top_point
                state%slide(:, 1, step%joint(2)) = leg%length

                state%velocity(upper) = point_velocity(state%velocity(top), state%omega(o_top), top_arm)
                a = state%velocity(upper)
                if (step%base_moves) then
                    state%velocity(lower) = point_velocity(state%velocity(base), state%omega(o_base), base_arm)
                    a = a - state%velocity(lower)
                end if
                call move_ups_leg(a, state%omega(o_base), step%base_moves, leg)
                state%omega_body(o) = leg%omega

                state%acceleration(0, upper) = point_acceleration(state%acceleration(0, top), state%omega(o_top), &
                                                                  state%alpha(0, o_top), top_arm)
                state%acceleration_body(0, upper) = leg%axes.unrotate.state%acceleration(0, upper)
                a = state%acceleration_body(0, upper)
                if (step%base_moves) then
                    base_a = point_acceleration(state%acceleration(0, base), state%omega(o_base), &
                                                state%alpha(0, o_base), base_arm)
                    state%acceleration(0, lower) = base_a
                    state%acceleration_body(0, lower) = leg%axes.unrotate.base_a
                    a = a - state%acceleration_body(0, lower)
                end if
                call accelerate_ups_leg(leg, a, state%omega(o_base), state%alpha(0, o_base), step%base_moves, &
                                        state%alpha_body(0, o))

                do k = 1, state%n_column
                    state%acceleration(k, upper) = point_column(state%acceleration(k, top), state%alpha(k, o_top), top_arm)
                    state%acceleration_body(k, upper) = leg%axes.unrotate.state%acceleration(k, upper)
                    a = state%acceleration_body(k, upper)
                    if (step%base_moves) then
                        base_a = point_column(state%acceleration(k, base), state%alpha(k, o_base), base_arm)
                        state%acceleration(k, lower) = base_a
                        state%acceleration_body(k, lower) = leg%axes.unrotate.base_a
                        a = a - state%acceleration_body(k, lower)
                    end if
                    call map_ups_column(leg, a, state%alpha(k, o_base), step%base_moves, state%alpha_body(k, o))
                end do

                if (state%world_rates .or. model%link(lower)%needs_world .or. model%link(upper)%needs_world) then
                    state%omega(o) = leg%axes.rotate.leg%omega
                    do k = 0, state%n_column
                        state%alpha(k, o) = leg%axes.rotate.state%alpha_body(k, o)
                    end do
                end if
            end associate
        end associate
    end subroutine close_ups_leg

    !> Angular rates and the origin's acceleration in link axes, from those in world axes.
    subroutine turn_into_link(model, link, state)
        type(model_type), intent(in) :: model
        integer, intent(in) :: link
        type(kinematic_state), intent(inout) :: state
        integer :: o, k

        o = model%link(link)%orientation
        state%omega_body(o) = state%rotation(o).unrotate.state%omega(o)
        do k = 0, state%n_column
            state%alpha_body(k, o) = state%rotation(o).unrotate.state%alpha(k, o)
            state%acceleration_body(k, link) = state%rotation(o).unrotate.state%acceleration(k, link)
        end do
    end subroutine turn_into_link

    pure function from_components(c) result(v)
        real(wp), intent(in) :: c(lanes, 3)
        type(vec3) :: v

        v%x = c(:, 1)
        v%y = c(:, 2)
        v%z = c(:, 3)
    end function from_components
end module linkdyn_kinematic_pass
