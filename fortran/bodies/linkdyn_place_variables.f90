!> Places that measures tell, and their rates: joint variables, coordinates of markers, distances, tilts, twists, attitudes.
module linkdyn_place_variables
    use linkdyn_attitude, only: angles_of_rotation, rates_of_angles
    use linkdyn_bodies, only: world_axes, omega_of, point_position, point_velocity
    use linkdyn_constants, only: pi
    use linkdyn_joint_variables, only: variable_near, variable_rate
    use linkdyn_mechanism, only: mechanism_type, in_own_axes, scene_point_of_origin, scene_rotation
    use linkdyn_scene, only: measure_spec, measure_joint, measure_marker, measure_distance, measure_tilt, &
        measure_twist, least_openness, marker_at, marker_axes_at, seeing_axes_at
    use linkdyn_kinds, only: wp
    use linkdyn_value, only: value, constant, zero, nearest_whole, operator(+), operator(-), operator(*), sqrt, max, atan2, &
        reciprocal, select
    use linkdyn_vector, only: vector, rotation, vector_of, operator(+), operator(-), operator(*), operator(.dot.), &
        operator(.cross.), operator(.rotate.), operator(.unrotate.)
    implicit none (type, external)
    private
    public :: place_value, place_rate, place_point, place_gap, seeing_axis, relative_attitude, tilt_direction, twist_direction

contains

    !> Where it is [m, rad]; of angles that differ by whole turns the one nearest to `near`.
    function place_value(mechanism, spec) result(number)
        type(mechanism_type), intent(in) :: mechanism
        type(measure_spec), intent(in) :: spec         !! one of a place
        type(value) :: number
        type(value) :: angle(3), open
        type(vector) :: gap, normal
        type(rotation) :: axes(2)

        select case (spec%kind)
        case (measure_joint)
            number = variable_near(mechanism, spec%joint, spec%variable, constant(spec%near))
        case (measure_marker)
            number = place_gap(mechanism, spec) .dot.seeing_axis(mechanism, spec)
        case (measure_distance)
            gap = place_gap(mechanism, spec)
            number = sqrt(gap.dot.gap)
        case (measure_tilt)
            axes = marker_axes(mechanism, spec)
            normal = axes(1)%z .cross.axes(2)%z
            number = atan2(sqrt(normal.dot.normal), axes(1)%z .dot.axes(2)%z)
        case (measure_twist)
            axes = marker_axes(mechanism, spec)
            number = near(atan2((axes(2)%x .dot.axes(1)%y) - (axes(2)%y .dot.axes(1)%x), &
                                (axes(2)%x .dot.axes(1)%x) + (axes(2)%y .dot.axes(1)%y)))
            open = openness(axes)
            number = select(open, number, reciprocal(open))
        case default
            angle = angles_of_rotation(relative_attitude(mechanism, spec))
            number = near(angle(spec%component))
        end select

    contains

        function near(angle)
            type(value), intent(in) :: angle
            type(value) :: near

            near = angle + (2*pi)*nearest_whole((1/(2*pi))*(constant(spec%near) - angle))
        end function near
    end function place_value

    !> How fast it changes [m/s, rad/s].
    function place_rate(mechanism, spec) result(rate)
        type(mechanism_type), intent(in) :: mechanism
        type(measure_spec), intent(in) :: spec         !! one of a place
        type(value) :: rate
        type(value) :: of_angles(3)
        type(vector) :: gap, velocity, omega

        associate (link => spec%link, bodies => mechanism%bodies)
            if (spec%kind == measure_joint) then
                rate = variable_rate(mechanism, spec%joint, spec%variable)
                return
            end if
            omega = omega_of(bodies, link(2), world_axes) - omega_of(bodies, link(1), world_axes)
            if (spec%kind == measure_tilt) then
                rate = tilt_direction(mechanism, spec) .dot.omega
                return
            else if (spec%kind == measure_twist) then
                rate = twist_direction(mechanism, spec) .dot.omega
                return
            end if
            gap = place_gap(mechanism, spec)
            velocity = point_velocity(bodies, link(2), place_point(mechanism, spec, 2)) &
                       - point_velocity(bodies, link(1), place_point(mechanism, spec, 1))
            select case (spec%kind)
            case (measure_marker)
                velocity = velocity - (omega_of(bodies, link(1), world_axes) .cross.gap)
                rate = velocity.dot.seeing_axis(mechanism, spec)
            case (measure_distance)
                rate = reciprocal(sqrt(gap.dot.gap))*(gap.dot.velocity)
            case default
                of_angles = rates_of_angles(relative_attitude(mechanism, spec), scene_rotation(mechanism, link(1)) .unrotate.omega)
                rate = of_angles(spec%component)
            end select
        end associate
    end function place_rate

    !> The axis of the first link of a measure, or of its marker, along which or about which it tells; world axes.
    function seeing_axis(mechanism, spec) result(axis)
        type(mechanism_type), intent(in) :: mechanism
        type(measure_spec), intent(in) :: spec
        type(vector) :: axis
        real(wp) :: own(3, 3)                          ! link axes

        own = seeing_axes_at(mechanism%model%scene, spec%link(1), spec%marker(1))
        axis = scene_rotation(mechanism, spec%link(1)) .rotate.vector_of(own(:, spec%component))
    end function seeing_axis

    !> The axes x, y and z of the markers of a tilt or a twist, world axes.
    function marker_axes(mechanism, spec) result(axes)
        type(mechanism_type), intent(in) :: mechanism
        type(measure_spec), intent(in) :: spec
        type(rotation) :: axes(2)
        real(wp) :: own(3, 3)                          ! link axes
        integer :: side

        do side = 1, 2
            own = marker_axes_at(mechanism%model%scene, spec%link(side), spec%marker(side))
            associate (r => scene_rotation(mechanism, spec%link(side)))
                axes(side) = rotation(r.rotate.vector_of(own(:, 1)), r.rotate.vector_of(own(:, 2)), r.rotate.vector_of(own(:, 3)))
            end associate
        end do
    end function marker_axes

    !> About which the second link of a tilt turns away from the first; none where the axes are parallel. Of axes that joints hold
    !> parallel rounding has a direction of its own, which may lie along them: what turns about them tilts nothing.
    function tilt_direction(mechanism, spec) result(direction)
        type(mechanism_type), intent(in) :: mechanism
        type(measure_spec), intent(in) :: spec
        type(vector) :: direction
        type(rotation) :: axes(2)

        axes = marker_axes(mechanism, spec)
        direction = axes(1)%z .cross.axes(2)%z
        direction = reciprocal(max(sqrt(direction.dot.direction), constant(sqrt(tiny(1.0_wp)))))*direction
        direction = direction - (direction.dot.axes(1)%z)*axes(1)%z
    end function tilt_direction

    !> Along which an angular velocity twists: halfway between the axes, the longer the more they are tilted. Not finite where they
    !> are opposite.
    function twist_direction(mechanism, spec) result(direction)
        type(mechanism_type), intent(in) :: mechanism
        type(measure_spec), intent(in) :: spec
        type(vector) :: direction
        type(rotation) :: axes(2)

        axes = marker_axes(mechanism, spec)
        direction = reciprocal(openness(axes))*(axes(1)%z + axes(2)%z)
    end function twist_direction

    !> 1 + the cosine of the angle between two axes; 0 where they are opposite, within what leaves a twist three digits.
    function openness(axes)
        type(rotation), intent(in) :: axes(2)
        type(value) :: openness

        openness = constant(1.0_wp) + (axes(1)%z .dot.axes(2)%z)
        openness = select(openness - least_openness, openness, zero())
    end function openness

    !> One of the two points of a measure, in its link's own axes: the origin of the link that sees, or a marker.
    function place_point(mechanism, spec, side) result(point)
        type(mechanism_type), intent(in) :: mechanism
        type(measure_spec), intent(in) :: spec
        integer, intent(in) :: side
        type(vector) :: point

        if (spec%marker(side) == 0) then
            point = scene_point_of_origin(mechanism, spec%link(side))
        else
            point = in_own_axes(mechanism, spec%link(side), &
                                vector_of(marker_at(mechanism%model%scene, spec%link(side), spec%marker(side))))
        end if
    end function place_point

    !> From the first point to the second, world axes [m].
    function place_gap(mechanism, spec) result(gap)
        type(mechanism_type), intent(in) :: mechanism
        type(measure_spec), intent(in) :: spec
        type(vector) :: gap

        gap = point_position(mechanism%bodies, spec%link(2), place_point(mechanism, spec, 2)) &
              - point_position(mechanism%bodies, spec%link(1), place_point(mechanism, spec, 1))
    end function place_gap

    !> From the axes of the link that is seen to those of the one that sees it.
    function relative_attitude(mechanism, spec) result(r)
        type(mechanism_type), intent(in) :: mechanism
        type(measure_spec), intent(in) :: spec
        type(rotation) :: r

        associate (a => scene_rotation(mechanism, spec%link(1)), b => scene_rotation(mechanism, spec%link(2)))
            r = rotation(a.unrotate.b%x, a.unrotate.b%y, a.unrotate.b%z)
        end associate
    end function relative_attitude
end module linkdyn_place_variables
