!> Places that measures tell, in motion: joint variables, coordinates of markers, distances, tilts, twists, attitudes. Where they
!> are, how fast they change, and how that changes with the coordinates.
!>
!> Velocities and columns of accelerations obey the same linear maps; what is given has centripetal and Coriolis parts besides
!> (levels as in `linkdyn_planar_motion`). Needs positions and velocities, angular rates in world axes.
module linkdyn_place_motion
    use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan
    use linkdyn_constants, only: two_pi
    use linkdyn_joint_motion, only: variables_of_relative
    use linkdyn_joint_rates, only: joint_rate, measure_variable
    use linkdyn_joint_table, only: joint_spherical
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state
    use linkdyn_lane_count, only: lanes
    use linkdyn_marker_motion, only: marker_arm, link_origin, link_axes, link_turning, turning_seen, carried_point
    use linkdyn_model, only: model_type
    use linkdyn_planar_motion, only: level_velocity, level_given
    use linkdyn_pose, only: rpy_rotation, rotate_rpy, rates_of_rpy, angular_acceleration_rpy
    use linkdyn_scene, only: measure_spec, measure_joint, measure_marker, measure_distance, measure_tilt, measure_twist, &
        measure_turn, least_openness, marker_axes_at, seeing_axes_at
    use linkdyn_vec3, only: vec3, mat3, operator(+), operator(-), operator(*), operator(.dot.), operator(.cross.), &
        operator(.rotate.), operator(.unrotate.), zero_vec3
    use linkdyn_whole_turns, only: nearest_turns
    implicit none (type, external)
    private
    public :: place_value, place_rate, standing_of, seen_motion

contains

    !> Where it is [m, rad]. Of angles that differ by whole turns it is the one nearest to `near`.
    function place_value(model, state, spec) result(value)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        type(measure_spec), intent(in) :: spec         !! one of a place
        real(wp) :: value(lanes)
        real(wp), dimension(lanes, 3) :: angle, rate
        type(vec3) :: gap, axis(2), normal, x(2), y(2)

        select case (spec%kind)
        case (measure_joint)
            call measure_variable(model, state, spec%joint, spec%variable, spread(spec%near, 1, lanes), value, rate(:, 1))
        case (measure_marker)
            gap = gap_of(model, state, spec)
            value = gap.dot.seeing_axis(model, state, spec)
        case (measure_distance)
            gap = gap_of(model, state, spec)
            value = sqrt(gap.dot.gap)
        case (measure_tilt)
            axis = directions_of(model, state, spec, 3)
            normal = axis(1) .cross.axis(2)
            value = atan2(sqrt(normal.dot.normal), axis(1) .dot.axis(2))
        case (measure_twist)
            x = directions_of(model, state, spec, 1)
            y = directions_of(model, state, spec, 2)
            value = near(atan2((x(2) .dot.y(1)) - (y(2) .dot.x(1)), (x(2) .dot.x(1)) + (y(2) .dot.y(1))))
            where (.not. openness(directions_of(model, state, spec, 3)) > 0) value = ieee_value(1.0_wp, ieee_quiet_nan)
        case (measure_turn)
            angle = standing_of(model, state, spec)
            value = angle(:, spec%component)
        case default
            call measure_attitude(model, state, spec, angle, rate)
            value = near(angle(:, spec%component))
        end select

    contains

        elemental real(wp) function near(angle)
            real(wp), intent(in) :: angle

            near = angle - two_pi*nearest_turns(angle - spec%near)
        end function near
    end function place_value

    !> How fast it changes; at level k for a unit rate of coordinate k; at the level of what is given its acceleration [m/s, ..].
    function place_rate(model, state, spec, level) result(rate)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        type(measure_spec), intent(in) :: spec
        integer, intent(in) :: level                   !! the velocity, what is given, or a column
        real(wp) :: rate(lanes)
        real(wp) :: of_angles(lanes, 3)

        select case (spec%kind)
        case (measure_joint)
            rate = joint_rate(model, state, spec%joint, spec%variable, level)
        case (measure_marker)
            rate = seen_motion(model, state, spec, level).dot.seeing_axis(model, state, spec)
        case (measure_distance)
            rate = distance_rate(model, state, spec, level)
        case (measure_tilt)
            rate = tilt_rate(model, state, spec, level)
        case (measure_twist)
            rate = twist_rate(model, state, spec, level)
        case (measure_turn)
            rate = turning_seen(model, state, spec%link, level).dot.seeing_axis(model, state, spec)
        case default
            of_angles = attitude_rate(model, state, spec, level)
            rate = of_angles(:, spec%component)
        end select
    end function place_rate

    !> The axis of the first link of a measure, or of its marker, along which or about which it tells; world axes.
    function seeing_axis(model, state, spec) result(axis)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        type(measure_spec), intent(in) :: spec
        type(vec3) :: axis
        real(wp) :: own(3, 3)                          ! link axes

        own = seeing_axes_at(model%scene, spec%link(1), spec%marker(1))
        axis = link_axes(model, state, spec%link(1)) .rotate.own(:, spec%component)
    end function seeing_axis

    !> From one point of a measure to the other; the first is the origin of the link that sees, or a marker.
    function gap_of(model, state, spec) result(gap)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        type(measure_spec), intent(in) :: spec
        type(vec3) :: gap
        type(vec3) :: point(2)
        integer :: side

        do side = 1, 2
            point(side) = link_origin(model, state, spec%link(side)) + marker_arm(model, state, spec%link(side), spec%marker(side))
        end do
        gap = point(2) - point(1)
    end function gap_of

    !> Motion of the second point as the first link sees it, world axes.
    function seen_motion(model, state, spec, level) result(motion)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        type(measure_spec), intent(in) :: spec
        integer, intent(in) :: level
        type(vec3) :: motion

        motion = against_first(level)
        if (level == level_given) motion = motion &
            - 2.0_wp*(link_turning(model, state, spec%link(1), level_velocity) .cross.against_first(level_velocity))

    contains

        !> The point less that of the first link in the same place.
        function against_first(at_level) result(difference)
            integer, intent(in) :: at_level
            type(vec3) :: difference

            associate (link => spec%link, arm => marker_arm(model, state, spec%link(2), spec%marker(2)))
                difference = carried_point(model, state, link(2), arm, at_level) - carried_point(model, state, link(1), &
                    link_origin(model, state, link(2)) + arm - link_origin(model, state, link(1)), at_level)
            end associate
        end function against_first
    end function seen_motion

    !> Rate of a distance. Where the markers coincide it is zero: no direction is better than another.
    function distance_rate(model, state, spec, level) result(rate)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        type(measure_spec), intent(in) :: spec
        integer, intent(in) :: level
        real(wp) :: rate(lanes)
        real(wp), dimension(lanes) :: distance, nearness
        type(vec3) :: gap, line, velocity

        gap = gap_of(model, state, spec)
        distance = sqrt(gap.dot.gap)
        nearness = merge(1/max(distance, tiny(1.0_wp)), 0.0_wp, distance > 0)
        line = nearness*gap
        rate = line.dot.apart(level)
        if (level /= level_given) return
        ! what moves across the line goes away along it
        velocity = apart(level_velocity)
        rate = rate + nearness*((velocity.dot.velocity) - (velocity.dot.line)**2)

    contains

        function apart(at_level) result(motion)
            integer, intent(in) :: at_level
            type(vec3) :: motion
            type(vec3) :: of_point(2)
            integer :: side

            do side = 1, 2
                of_point(side) = carried_point(model, state, spec%link(side), &
                                               marker_arm(model, state, spec%link(side), spec%marker(side)), at_level)
            end do
            motion = of_point(2) - of_point(1)
        end function apart
    end function distance_rate

    !> Axis x, y or z of both markers of a tilt or a twist, world axes.
    function directions_of(model, state, spec, component) result(axis)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        type(measure_spec), intent(in) :: spec
        integer, intent(in) :: component
        type(vec3) :: axis(2)
        real(wp) :: own(3, 3)                          ! link axes
        integer :: side

        do side = 1, 2
            own = marker_axes_at(model%scene, spec%link(side), spec%marker(side))
            axis(side) = link_axes(model, state, spec%link(side)) .rotate.own(:, component)
        end do
    end function directions_of

    !> Rate of a tilt. Where the axes are parallel it is zero: no direction is better than another. Of axes that joints hold
    !> parallel rounding has one of its own, which may lie along them: what turns about them tilts nothing.
    function tilt_rate(model, state, spec, level) result(rate)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        type(measure_spec), intent(in) :: spec
        integer, intent(in) :: level
        real(wp) :: rate(lanes)
        real(wp), dimension(lanes) :: sine, steepness
        type(vec3) :: axis(2), normal, turning(2), change

        axis = directions_of(model, state, spec, 3)
        normal = axis(1) .cross.axis(2)
        sine = sqrt(normal.dot.normal)
        steepness = merge(1/max(sine, tiny(1.0_wp)), 0.0_wp, sine > 0)
        normal = steepness*normal
        normal = normal - (normal.dot.axis(1))*axis(1)
        rate = normal.dot.turning_apart(model, state, spec, level)
        if (level /= level_given) return
        ! the direction about which the one tilts from the other is carried round by both
        turning = [link_turning(model, state, spec%link(1), level_velocity), &
                   link_turning(model, state, spec%link(2), level_velocity)]
        change = steepness*(((turning(1) .cross.axis(1)) .cross.axis(2)) + (axis(1) .cross.(turning(2) .cross.axis(2))))
        change = change - (normal.dot.change)*normal
        rate = rate + (change.dot.turning_apart(model, state, spec, level_velocity))
    end function tilt_rate

    !> 1 + the cosine of the angle between two axes; 0 where they are opposite.
    pure function openness(axis)
        type(vec3), intent(in) :: axis(2)
        real(wp) :: openness(lanes)

        openness = 1 + (axis(1) .dot.axis(2))
        where (openness < least_openness) openness = 0
    end function openness

    !> Rate of a twist: the angular velocity halfway between the axes. Not finite where these are opposite.
    function twist_rate(model, state, spec, level) result(rate)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        type(measure_spec), intent(in) :: spec
        integer, intent(in) :: level
        real(wp) :: rate(lanes)
        real(wp) :: share(lanes), growth(lanes)
        type(vec3) :: axis(2), way(2), direction
        integer :: side

        axis = directions_of(model, state, spec, 3)
        share = 1/openness(axis)
        direction = share*(axis(1) + axis(2))
        rate = direction.dot.turning_apart(model, state, spec, level)
        if (level /= level_given) return
        ! both axes are carried round
        do side = 1, 2
            way(side) = link_turning(model, state, spec%link(side), level_velocity) .cross.axis(side)
        end do
        growth = (way(1) .dot.axis(2)) + (axis(1) .dot.way(2))
        rate = rate + ((share*(way(1) + way(2)) - (share*growth)*direction) &
                       .dot.turning_apart(model, state, spec, level_velocity))
    end function twist_rate

    !> The turning of the second link less that of the first.
    function turning_apart(model, state, spec, level) result(difference)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        type(measure_spec), intent(in) :: spec
        integer, intent(in) :: level
        type(vec3) :: difference

        difference = link_turning(model, state, spec%link(2), level) - link_turning(model, state, spec%link(1), level)
    end function turning_apart

    !> How the markers of a turn stand: roll, pitch and yaw of the first one as the second one sees it. The first two alone tell
    !> where the first one's z is.
    function standing_of(model, state, spec) result(angle)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        type(measure_spec), intent(in) :: spec
        real(wp) :: angle(lanes, 3)
        real(wp) :: rate(lanes, 3), own(3, 3)
        type(mat3) :: axes(2)
        integer :: side

        do side = 1, 2
            own = seeing_axes_at(model%scene, spec%link(side), spec%marker(side))
            associate (r => link_axes(model, state, spec%link(side)))
                axes(side)%x = r.rotate.own(:, 1)
                axes(side)%y = r.rotate.own(:, 2)
                axes(side)%z = r.rotate.own(:, 3)
            end associate
        end do
        call variables_of_relative(joint_spherical, axes(2), axes(1), zero_vec3(), zero_vec3(), zero_vec3(), angle, rate)
    end function standing_of

    !> Roll, pitch and yaw of the second link as the first one sees it, in (-pi, pi], and their rates.
    subroutine measure_attitude(model, state, spec, angle, rate)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        type(measure_spec), intent(in) :: spec
        real(wp), intent(out), dimension(lanes, 3) :: angle, rate

        associate (link => spec%link)
            call variables_of_relative(joint_spherical, link_axes(model, state, link(1)), link_axes(model, state, link(2)), &
                                       zero_vec3(), zero_vec3(), link_turning(model, state, link(2), level_velocity) &
                                       - link_turning(model, state, link(1), level_velocity), angle, rate)
        end associate
    end subroutine measure_attitude

    !> Rates of roll, pitch and yaw, or their accelerations. Not finite at a pitch of 90 degrees.
    function attitude_rate(model, state, spec, level) result(rate)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        type(measure_spec), intent(in) :: spec
        integer, intent(in) :: level
        real(wp) :: rate(lanes, 3)
        real(wp), dimension(lanes, 3) :: angle, velocity
        type(rpy_rotation) :: turn
        type(vec3) :: turning(2), change

        call measure_attitude(model, state, spec, angle, velocity)
        turning = [link_turning(model, state, spec%link(1), level), link_turning(model, state, spec%link(2), level)]
        change = turning(2) - turning(1)
        if (level == level_given) then
            turning = [link_turning(model, state, spec%link(1), level_velocity), &
                       link_turning(model, state, spec%link(2), level_velocity)]
            change = change - (turning(1) .cross.turning(2))
        end if
        change = link_axes(model, state, spec%link(1)) .unrotate.change
        if (level == level_given) then
            ! the axes about which the angles turn are carried round
            call rotate_rpy(angle(:, 1), angle(:, 2), angle(:, 3), turn)
            change = change - angular_acceleration_rpy(turn, velocity, 0*velocity)
        end if
        rate = rates_of_rpy(angle(:, 1), angle(:, 2), change)
    end function attitude_rate
end module linkdyn_place_motion
