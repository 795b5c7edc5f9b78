!> The CSP group as a step of the kinematic program: from markers to points and axes, and back to links.
module linkdyn_csp_step
    use linkdyn_csp, only: locate_csp, move_csp, accelerate_csp, map_csp_column, uncertainty_csp
    use linkdyn_joint_motion, only: turn_frame, turn_frame_back
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state
    use linkdyn_lane_count, only: lanes
    use linkdyn_model, only: model_type, step_type, orientation_of
    use linkdyn_point, only: point_velocity, point_acceleration, point_column
    use linkdyn_vec3, only: vec3, mat3, operator(+), operator(-), operator(*), operator(.dot.), operator(.cross.), &
        operator(.rotate.), vec3_of
    implicit none (type, external)
    private
    public :: close_csp

    !> What the step needs of the model, sides sorted: the known links' markers and the group's.
    type :: csp_geometry
        integer :: coupler = 0, output = 0, axis_link = 0, slide_link = 0
        integer :: axis_side = 0, slide_side = 0, coupler_side = 0    !! side of the known link at C, at P; of the coupler at S
        real(wp) :: offset(3) = 0            !! of S in the coupler's marker at C: radial x, y, axial z [m]
        real(wp) :: radius = 0
    end type csp_geometry

contains

    !> Positions, velocities and acceleration columns of coupler and output, world axes.
    subroutine close_csp(model, step, state)
        type(model_type), intent(in) :: model
        type(step_type), intent(in) :: step
        type(kinematic_state), intent(inout) :: state
        type(csp_geometry) :: geometry
        type(mat3) :: axis_frame, slide_frame, coupler_frame, r
        type(vec3) :: axis_arm, slide_arm, to_s, carried, arm, s_point, s_velocity, s_acceleration, a, drag
        real(wp), dimension(lanes) :: slide_rate2, turn_rate2
        integer :: o_axis, o_slide, o_coupler, o_output, k

        call sort_sides(model, step, geometry)
        associate (c => model%joint(step%joint(1)), s => model%joint(step%joint(2)), p => model%joint(step%joint(3)), &
                   g => geometry, group => state%csp(step%first))
            o_axis = orientation_of(model, g%axis_link)
            o_slide = orientation_of(model, g%slide_link)
            o_coupler = model%link(g%coupler)%orientation
            o_output = model%link(g%output)%orientation
            axis_frame = turn_frame(state%rotation(o_axis), c%frame(:, :, g%axis_side))
            slide_frame = turn_frame(state%rotation(o_slide), p%frame(:, :, g%slide_side))
            if (o_output /= o_slide) state%rotation(o_output) = turn_frame_back(slide_frame, p%frame(:, :, 3 - g%slide_side))

            ! ---- position
            axis_arm = state%rotation(o_axis).rotate.c%point(:, g%axis_side)
            slide_arm = state%rotation(o_slide).rotate.p%point(:, g%slide_side)
            to_s = state%rotation(o_output).rotate.(s%point(:, 3 - g%coupler_side) - p%point(:, 3 - g%slide_side))
            call locate_csp(state%position(g%slide_link) + slide_arm + to_s - state%position(g%axis_link) - axis_arm, &
                            axis_frame%z, slide_frame%z, g%radius, &
                            state%branch(:, step%first), group)
            state%unreachable = state%unreachable .or. .not. abs(group%slide) <= huge(1.0_wp)
            s_point = state%position(g%axis_link) + axis_arm + group%w
            coupler_frame%x = group%per_radius2*(g%offset(1)*group%n - g%offset(2)*group%m)
            coupler_frame%y = group%per_radius2*(g%offset(2)*group%n + g%offset(1)*group%m)
            coupler_frame%z = group%u
            r = turn_frame_back(coupler_frame, c%frame(:, :, 3 - g%axis_side))
            state%rotation(o_coupler) = r
            state%slide(:, 1, step%joint(1)) = merge(1, -1, g%axis_side == 1)*(group%sigma - g%offset(3))
            state%slide(:, 1, step%joint(3)) = merge(1, -1, g%slide_side == 1)*group%slide

            ! ---- velocity
            carried = slide_arm + to_s + group%slide*group%y      ! to S, from the origin of the link with the slide
            s_velocity = point_velocity(state%velocity(g%slide_link), state%omega(o_slide), carried)
            call move_csp(s_velocity - point_velocity(state%velocity(g%axis_link), state%omega(o_axis), axis_arm), &
                          state%omega(o_axis), state%omega(o_slide), group)
            s_velocity = s_velocity + group%slide_rate*group%y
            state%omega(o_coupler) = state%omega(o_axis) + group%turn_rate*group%u
            state%omega(o_output) = state%omega(o_slide)

            ! ---- acceleration; the drag is the Coriolis part of the slide
            drag = (2*group%slide_rate)*(state%omega(o_slide).cross.group%y)
            s_acceleration = point_acceleration(state%acceleration(0, g%slide_link), state%omega(o_slide), &
                                                state%alpha(0, o_slide), carried) + drag
            a = point_acceleration(state%acceleration(0, g%axis_link), state%omega(o_axis), state%alpha(0, o_axis), axis_arm)
            call accelerate_csp(group, s_acceleration - a, state%omega(o_axis), state%alpha(0, o_axis), slide_rate2, turn_rate2)
            state%uncertainty = max(state%uncertainty, uncertainty_csp(group, slide_rate2, turn_rate2))
            s_acceleration = s_acceleration + slide_rate2*group%y
            state%alpha(0, o_coupler) = state%alpha(0, o_axis) + turn_rate2*group%u + group%turn_rate*group%u_rate
            state%alpha(0, o_output) = state%alpha(0, o_slide)

            ! ---- origins of both links, from S
            arm = (-1.0_wp)*(r.rotate.s%point(:, g%coupler_side))
            call place_origin(g%coupler, o_coupler, arm)
            arm = (-1.0_wp)*(state%rotation(o_output).rotate.s%point(:, 3 - g%coupler_side))
            call place_origin(g%output, o_output, arm)

            do k = 1, state%n_column
                s_acceleration = point_column(state%acceleration(k, g%slide_link), state%alpha(k, o_slide), carried)
                a = point_column(state%acceleration(k, g%axis_link), state%alpha(k, o_axis), axis_arm)
                call map_csp_column(group, s_acceleration - a, state%alpha(k, o_axis), slide_rate2, turn_rate2)
                s_acceleration = s_acceleration + slide_rate2*group%y
                state%alpha(k, o_coupler) = state%alpha(k, o_axis) + turn_rate2*group%u
                state%alpha(k, o_output) = state%alpha(k, o_slide)
                arm = (-1.0_wp)*(r.rotate.s%point(:, g%coupler_side))
                state%acceleration(k, g%coupler) = point_column(s_acceleration, state%alpha(k, o_coupler), arm)
                arm = (-1.0_wp)*(state%rotation(o_output).rotate.s%point(:, 3 - g%coupler_side))
                state%acceleration(k, g%output) = point_column(s_acceleration, state%alpha(k, o_output), arm)
            end do
        end associate

    contains

        subroutine place_origin(link, o, arm)
            integer, intent(in) :: link, o
            type(vec3), intent(in) :: arm

            state%position(link) = s_point + arm
            state%velocity(link) = point_velocity(s_velocity, state%omega(o), arm)
            state%acceleration(0, link) = point_acceleration(s_acceleration, state%omega(o), state%alpha(0, o), arm)
        end subroutine place_origin
    end subroutine close_csp

    subroutine sort_sides(model, step, geometry)
        type(model_type), intent(in) :: model
        type(step_type), intent(in) :: step
        type(csp_geometry), intent(out) :: geometry

        associate (c => model%joint(step%joint(1)), s => model%joint(step%joint(2)), p => model%joint(step%joint(3)))
            geometry%coupler = step%link(1)
            geometry%output = step%link(2)
            geometry%axis_side = merge(1, 2, c%link(2) == step%link(1))
            geometry%slide_side = merge(1, 2, p%link(2) == step%link(2))
            geometry%coupler_side = merge(1, 2, s%link(1) == step%link(1))
            geometry%axis_link = c%link(geometry%axis_side)
            geometry%slide_link = p%link(geometry%slide_side)
            geometry%offset = matmul(transpose(c%frame(:, :, 3 - geometry%axis_side)), &
                                     s%point(:, geometry%coupler_side) - c%point(:, 3 - geometry%axis_side))
            geometry%radius = norm2(geometry%offset(1:2))
        end associate
    end subroutine sort_sides
end module linkdyn_csp_step
