!> A link between two known ones that has a single place there, on all levels: the cross between the hinges of a universal joint,
!> or the sleeve between hinge and slide of a cylindrical one. Of a ball in three hinges the first link between has two places, the
!> other one is a cross between that and the last link. docs/theory.md derives the formulas.
module linkdyn_link_between
    use linkdyn_bodies, only: world_axes, omega_of, alpha_of, point_position, point_velocity, point_acceleration, &
        carried_velocity, carried_acceleration, rotation_of
    use linkdyn_joint_table, only: joint_prismatic
    use linkdyn_mechanism, only: mechanism_type, marker_point, marker_frame, must_be_positive, least_square
    use linkdyn_model, only: step_type, side_of
    use linkdyn_open_chain, only: walk_hinge, walk_slide
    use linkdyn_value, only: value, declare_inverse, operator(+), operator(-), operator(*), sqrt, reciprocal
    use linkdyn_vector, only: vector, rotation, operator(+), operator(-), operator(*), operator(.dot.), operator(.cross.), &
        operator(.rotate.), operator(.unrotate.)
    implicit none (type, external)
    private
    public :: close_between, close_gimbal

    !> A joint with the link between: that one's side, and the known link.
    type :: end_type
        integer :: joint = 0, side = 0
        integer :: known = 0
        type(rotation) :: frame                            !! of the marker on the known link, its own axes
        type(vector) :: point                              !! likewise [m]
        type(rotation) :: own_frame                        !! of that on the link between, its own axes
        type(vector) :: own_point                          !! likewise [m]
    end type end_type

contains

    !> Link of the step; joints: by which it is placed, a hinge or slide, and the hinge at its other side.
    subroutine close_between(mechanism, step)
        type(mechanism_type), intent(inout) :: mechanism
        type(step_type), intent(in) :: step
        type(end_type) :: near, far

        near = end_of(mechanism, step%joint(1), step%link(1))
        far = end_of(mechanism, step%joint(2), step%link(1))
        if (mechanism%model%joint(near%joint)%kind == joint_prismatic) then
            call slide_between(mechanism, near, far)
        else
            call turn_between(mechanism, near, far)
        end if
    end subroutine close_between

    function end_of(mechanism, j, link) result(end)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: j, link
        type(end_type) :: end

        end%joint = j
        end%side = side_of(mechanism%model%joint(j), link)
        end%known = mechanism%model%joint(j)%link(3 - end%side)
        end%frame = marker_frame(mechanism, j, 3 - end%side)
        end%point = marker_point(mechanism, j, 3 - end%side)
        end%own_frame = marker_frame(mechanism, j, end%side)
        end%own_point = marker_point(mechanism, j, end%side)
    end function end_of

    !> A cross: its second axis, known from the far link, tells how far it is turned about the first.
    subroutine turn_between(mechanism, near, far)
        type(mechanism_type), intent(inout) :: mechanism
        type(end_type), intent(in) :: near, far
        type(vector) :: first, second, here, own           ! axes in the world's; the second in the markers' of the first
        type(vector) :: turning
        type(value) :: rate, rate_2

        associate (bodies => mechanism%bodies)
            first = rotation_of(bodies, near%known) .rotate.near%frame%z
            second = rotation_of(bodies, far%known) .rotate.far%frame%z
            here = near%frame.unrotate.(rotation_of(bodies, near%known) .unrotate.second)
            own = near%own_frame.unrotate.far%own_frame%z
            turning = omega_of(bodies, far%known, world_axes) - omega_of(bodies, near%known, world_axes)
            rate = turning.dot.first
            rate_2 = ((alpha_of(bodies, far%known, world_axes) - alpha_of(bodies, near%known, world_axes)) .dot.first) &
                     - (turning.dot.second)*((omega_of(bodies, near%known, world_axes) .cross.second) .dot.first)
        end associate
        call walk_hinge(mechanism, near%joint, near%side, here%x*own%x + here%y*own%y, here%y*own%x - here%x*own%y, [rate, rate_2])
    end subroutine turn_between

    !> Link of the step: the first between; joints: the three hinges in their order. Its second axis is square to the first and the
    !> third, which the links at both ends tell, and points as first x third does, or the other way.
    subroutine close_gimbal(mechanism, step)
        type(mechanism_type), intent(inout) :: mechanism
        type(step_type), intent(in) :: step
        type(end_type) :: near, middle, far
        type(vector) :: first, second, third, across, here, own, normal, bend    ! axes in the world's; second in the markers'
        type(vector) :: turning, turns_on
        type(value) :: m, per_m, per, rate, rate_2
        integer :: beyond

        near = end_of(mechanism, step%joint(1), step%link(1))
        middle = end_of(mechanism, step%joint(2), step%link(1))
        beyond = middle%known
        far = end_of(mechanism, step%joint(3), beyond)
        associate (bodies => mechanism%bodies)
            first = rotation_of(bodies, near%known) .rotate.near%frame%z
            third = rotation_of(bodies, far%known) .rotate.far%frame%z
            across = first.cross.third
            ! with the first and the third axis in one line the second is anywhere
            call must_be_positive(mechanism, (across.dot.across) - least_square)
            m = sqrt(across.dot.across)
            per_m = reciprocal(m)
            call declare_inverse(m, per_m)
            per = per_m
            if (step%turn < 0) per = -per
            second = per*across
            here = near%frame.unrotate.(rotation_of(bodies, near%known) .unrotate.second)
            own = near%own_frame.unrotate.middle%own_frame%z
            ! of the second and third axes the second stays square to the third: (w - w of the far link) . normal = 0
            normal = second.cross.third
            turning = omega_of(bodies, far%known, world_axes) - omega_of(bodies, near%known, world_axes)
            rate = -(per*(turning.dot.normal))
            turns_on = omega_of(bodies, near%known, world_axes) + rate*first
            bend = ((turns_on.cross.second) .cross.third) &
                   + (second.cross.(omega_of(bodies, far%known, world_axes) .cross.third))
            rate_2 = -(per*(((alpha_of(bodies, far%known, world_axes) - alpha_of(bodies, near%known, world_axes) &
                              - rate*(omega_of(bodies, near%known, world_axes) .cross.first)) .dot.normal) &
                            - ((turns_on - omega_of(bodies, far%known, world_axes)) .dot.bend)))
        end associate
        call walk_hinge(mechanism, near%joint, near%side, here%x*own%x + here%y*own%y, here%y*own%x - here%x*own%y, [rate, rate_2])
    end subroutine close_gimbal

    !> A sleeve: it is as far along the slide as the far hinge.
    subroutine slide_between(mechanism, near, far)
        type(mechanism_type), intent(inout) :: mechanism
        type(end_type), intent(in) :: near, far
        type(vector) :: along, end, own                    ! axis; the far hinge, world axes; from marker to marker, the near one's
        type(value) :: slide, rate, rate_2

        associate (bodies => mechanism%bodies)
            along = rotation_of(bodies, near%known) .rotate.near%frame%z
            end = point_position(bodies, far%known, far%point)
            own = near%own_frame.unrotate.(far%own_point - near%own_point)
            slide = ((end - point_position(bodies, near%known, near%point)) .dot.along) - own%z
            rate = (point_velocity(bodies, far%known, far%point) - carried_velocity(bodies, near%known, end)) .dot.along
            rate_2 = (point_acceleration(bodies, far%known, far%point, world_axes) &
                      - carried_acceleration(bodies, near%known, end)) .dot.along
        end associate
        call walk_slide(mechanism, near%joint, near%side, [slide, rate, rate_2])
    end subroutine slide_between
end module linkdyn_link_between
