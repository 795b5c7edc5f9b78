!> What acts on links: wrenches, each in the axes of some turning, at a joint or at a point of one link.
!>
!> Loads, springs, drives and joint reactions all become this; the balance of a link adds it up without asking what it is.
module linkdyn_acting
    use linkdyn_attitude, only: rates_of_angles
    use linkdyn_bodies, only: bodies_type, point_position
    use linkdyn_joint_kind, only: axis_of
    use linkdyn_mechanism, only: mechanism_type, told_marker_frame, scene_rotation
    use linkdyn_place_variables, only: place_point, place_gap, seeing_axis, relative_attitude, tilt_direction, twist_direction
    use linkdyn_scene, only: measure_spec, measure_joint, measure_marker, measure_distance, measure_tilt, &
        measure_twist, measure_turn
    use linkdyn_value, only: value, zero, operator(+), operator(*), sqrt, reciprocal
    use linkdyn_vector, only: vector, rotation, zero_vector, unit_vector, components, operator(-), operator(*), operator(.dot.), &
        operator(.rotate.), operator(.unrotate.)
    implicit none (type, external)
    private
    public :: acting_type, turned, at_joint_variable, at_place, sums_at_joints

    !> A force and a moment. At a joint: on the second link at its marker's point, the opposite on the first.
    type :: acting_type
        integer :: joint = 0                           !! 0: on one link
        integer :: link = 0                            !! that link
        type(vector) :: point                          !! of that link, own axes [m]
        integer :: turning = 0                         !! in whose axes force and moment stand; 0: world axes
        type(vector) :: force, moment                  !! [N, N m]
    end type acting_type

contains

    !> A vector from the axes of one turning to those of another; 0 are the world's.
    function turned(bodies, v, from, to) result(w)
        type(bodies_type), intent(in) :: bodies
        type(vector), intent(in) :: v
        integer, intent(in) :: from, to
        type(vector) :: w

        w = v
        if (from == to) return
        if (from > 0) w = bodies%turning(from)%r.rotate.w
        if (to > 0) w = bodies%turning(to)%r.unrotate.w
    end function turned

    !> A force or torque at a joint variable, positive when it drives the variable up.
    function at_joint_variable(mechanism, joint, variable, effort) result(acting)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: joint, variable
        type(value), intent(in) :: effort              !! [N, N m]
        type(acting_type) :: acting
        type(rotation) :: frame
        integer :: side

        acting%joint = joint
        associate (link => mechanism%model%joint(joint)%link, kind => mechanism%told_kind(joint)%is)
            side = kind%axis_side(variable)
            ! a hinge's or a slide's axis is fixed in both links: that of a moving one may stand in simpler axes
            if (link(side) == 0 .and. kind%n_variable < 2) side = 3 - side
            frame = told_marker_frame(mechanism, joint, side)
            acting%turning = mechanism%bodies%body(link(side))%turning
            acting%force = zero_vector()
            acting%moment = zero_vector()
            if (kind%is_slide(variable)) then
                acting%force = effort*axis_of(frame, kind%axis(variable))
            else
                acting%moment = effort*axis_of(frame, kind%axis(variable))
            end if
        end associate
    end function at_joint_variable

    !> What acts at joints, added up: on the second link at its marker, world axes; in a plane Fx Fy Mz.
    function sums_at_joints(mechanism, acting) result(v)
        type(mechanism_type), intent(in) :: mechanism
        type(acting_type), intent(in) :: acting(:)     !! at joints
        type(value), allocatable :: v(:)               !! joint after joint
        type(value) :: all(6, mechanism%model%n_joint), part(6)
        integer :: i, m

        all = zero()
        do i = 1, size(acting)
            associate (a => acting(i), bodies => mechanism%bodies)
                part(:3) = components(turned(bodies, a%force, a%turning, 0))
                part(4:) = components(turned(bodies, a%moment, a%turning, 0))
                do m = 1, 6
                    all(m, a%joint) = all(m, a%joint) + part(m)
                end do
            end associate
        end do
        if (mechanism%model%is_planar) then
            v = [all([1, 2, 6], :)]
        else
            v = [all]
        end if
    end function sums_at_joints

    !> A force or moment along a place that a measure tells, positive when it drives it up: its power is effort times the place's
    !> rate.
    function at_place(mechanism, spec, effort) result(acting)
        type(mechanism_type), intent(in) :: mechanism
        type(measure_spec), intent(in) :: spec
        type(value), intent(in) :: effort              !! [N, N m]
        type(acting_type), allocatable :: acting(:)    ! one at a joint, else one on each link
        type(vector) :: gap, push

        select case (spec%kind)
        case (measure_joint)
            acting = [at_joint_variable(mechanism, spec%joint, spec%variable, effort)]
        case (measure_marker)
            push = effort*seeing_axis(mechanism, spec)
            acting = between_links(mechanism, spec, push, zero_vector())
        case (measure_distance)
            gap = place_gap(mechanism, spec)
            acting = between_links(mechanism, spec, (effort*reciprocal(sqrt(gap.dot.gap)))*gap, zero_vector())
        case default
            acting = between_links(mechanism, spec, zero_vector(), effort*angle_gradient(mechanism, spec))
        end select
    end function at_place

    !> A force at the second point of a measure and a moment, world axes, and the opposite on the first link, in the same place.
    function between_links(mechanism, spec, force, moment) result(acting)
        type(mechanism_type), intent(in) :: mechanism
        type(measure_spec), intent(in) :: spec
        type(vector), intent(in) :: force, moment      !! [N], [N m]
        type(acting_type) :: acting(2)
        type(rotation) :: first

        associate (link => spec%link, bodies => mechanism%bodies)
            acting%link = link
            acting(2)%point = place_point(mechanism, spec, 2)
            acting(2)%force = force
            acting(2)%moment = moment
            first = bodies%turning(bodies%body(link(1))%turning)%r
            acting(1)%point = first.unrotate.(point_position(bodies, link(2), acting(2)%point) - bodies%body(link(1))%position)
            acting(1)%force = -force
            acting(1)%moment = -moment
        end associate
    end function between_links

    !> How the rate of an angle between links, or of a turn, changes with the angular velocity: the moment of a unit effort, world
    !> axes.
    function angle_gradient(mechanism, spec) result(gradient)
        type(mechanism_type), intent(in) :: mechanism
        type(measure_spec), intent(in) :: spec
        type(vector) :: gradient

        select case (spec%kind)
        case (measure_tilt)
            gradient = tilt_direction(mechanism, spec)
        case (measure_twist)
            gradient = twist_direction(mechanism, spec)
        case (measure_turn)
            gradient = seeing_axis(mechanism, spec)
        case default
            gradient = attitude_gradient(mechanism, spec)
        end select
    end function angle_gradient

    !> The same of one of an attitude's angles.
    function attitude_gradient(mechanism, spec) result(gradient)
        type(mechanism_type), intent(in) :: mechanism
        type(measure_spec), intent(in) :: spec
        type(vector) :: gradient
        type(value) :: rate(3), part(3)
        integer :: k

        do k = 1, 3
            rate = rates_of_angles(relative_attitude(mechanism, spec), unit_vector(k))
            part(k) = rate(spec%component)
        end do
        gradient = scene_rotation(mechanism, spec%link(1)) .rotate.vector(part(1), part(2), part(3))
    end function attitude_gradient
end module linkdyn_acting
