!> The UPS leg: universal, prismatic and spherical joint between two known links, in closed form on all levels. Likewise the
!> UCU leg, with a cylindrical joint between two universal ones.
!>
!> U is the centre of the universal joint on the base, S that of the spherical joint. Both links turn together. Axes of
!> both: z = s, the direction from U to S; y = unit(s x u), the second axis of the universal joint; x = y x z, so that the
!> first axis is u = (m, 0, c) in leg axes. docs/theory.md derives the formulas. Of a UCU leg the upper link turns about s as the
!> universal joint at S wants it, by the same formulas with the first axis of that.
module linkdyn_leg
    use linkdyn_bodies, only: bodies_type, world_axes, own_axes, set_vector, omega_of, alpha_of, point_position, point_velocity, &
        point_acceleration, rotation_of
    use linkdyn_line_turning, only: turning_of_line, turning_of_line_2
    use linkdyn_mechanism, only: mechanism_type, marker_point, marker_frame, set_slide, must_be_positive, least_square
    use linkdyn_model, only: step_type, side_of, turns_in_two
    use linkdyn_system, only: system_type, unknown, require
    use linkdyn_value, only: value, zero, declare_inverse, operator(+), operator(-), operator(*), sqrt, square, reciprocal
    use linkdyn_vector, only: vector, rotation, components, operator(+), operator(-), operator(*), operator(.dot.), &
        operator(.cross.), operator(.rotate.), operator(.unrotate.)
    implicit none (type, external)
    private
    public :: close_leg

contains

    !> Joints of the step: universal, prismatic, spherical, or universal, cylindrical, universal; links: lower, at U, and upper,
    !> at S.
    subroutine close_leg(mechanism, step, equations)
        type(mechanism_type), intent(inout) :: mechanism
        type(step_type), intent(in) :: step
        type(system_type), intent(inout), optional :: equations    !! where accelerations stay unknown, if they do
        type(rotation) :: axes, base_frame
        type(vector) :: u_point, s_point, u, span, across, v, w, b, beta, a_u, a_s, a, alpha
        type(value) :: length, per_length, across_length, per_across, per_both, c, m, per_m, k, rate
        integer :: base, top, base_side, top_side

        associate (bodies => mechanism%bodies, model => mechanism%model, lower => step%link(1), upper => step%link(2))
            base_side = 3 - side_of(model%joint(step%joint(1)), lower)
            top_side = 3 - side_of(model%joint(step%joint(3)), upper)
            base = model%joint(step%joint(1))%link(base_side)
            top = model%joint(step%joint(3))%link(top_side)
            u_point = marker_point(mechanism, step%joint(1), base_side)
            s_point = marker_point(mechanism, step%joint(3), top_side)
            base_frame = marker_frame(mechanism, step%joint(1), base_side)
            u = rotation_of(bodies, base) .rotate.base_frame%z

            ! position; one division serves both lengths
            bodies%body(lower)%position = point_position(bodies, base, u_point)
            bodies%body(upper)%position = point_position(bodies, top, s_point)
            span = bodies%body(upper)%position - bodies%body(lower)%position
            length = sqrt(span.dot.span)
            across = span.cross.u
            ! a leg along the first axis of its universal joint has lost its second
            call must_be_positive(mechanism, (across.dot.across) - least_square*(span.dot.span))
            across_length = sqrt(across.dot.across)
            per_both = reciprocal(length*across_length)
            per_length = across_length*per_both
            per_across = length*per_both
            call declare_inverse(length, per_length)
            call declare_inverse(across_length, per_across)
            axes%z = per_length*span
            axes%y = per_across*across
            c = per_length*(span.dot.u)
            m = across_length*per_length
            per_m = length*per_across
            call declare_inverse(m, per_m)
            k = c*per_m
            axes%x = per_m*u - k*axes%z
            call set_slide(mechanism, step%joint(2), slide_of_length(mechanism, step, length))
            mechanism%universal_axis(step%joint(1)) = vector(m, zero(), c)

            ! velocity
            bodies%body(lower)%velocity = point_velocity(bodies, base, u_point)
            bodies%body(upper)%velocity = point_velocity(bodies, top, s_point)
            v = axes.unrotate.(bodies%body(upper)%velocity - bodies%body(lower)%velocity)
            b = axes.unrotate.omega_of(bodies, base, world_axes)
            rate = v%z
            w = turning_of_line(per_length, k, v, b)

            ! acceleration
            a_s = point_acceleration(bodies, top, s_point, world_axes)
            a_u = point_acceleration(bodies, base, u_point, world_axes)
            call set_vector(bodies%body(upper)%acceleration, world_axes, a_s)
            call set_vector(bodies%body(lower)%acceleration, world_axes, a_u)
            if (present(equations)) then
                call set_vector(bodies%body(upper)%acceleration, own_axes, named(equations, axes.unrotate.a_s))
            else
                call set_vector(bodies%body(upper)%acceleration, own_axes, axes.unrotate.a_s)
            end if
            call set_vector(bodies%body(lower)%acceleration, own_axes, axes.unrotate.a_u)
            a = bodies%body(upper)%acceleration%v(own_axes) - bodies%body(lower)%acceleration%v(own_axes)
            beta = axes.unrotate.alpha_of(bodies, base, world_axes)
            alpha = turning_of_line_2(per_length, k, rate, w, a, b, beta)

            call set_turning(bodies, lower, axes, w, alpha)
            if (turns_in_two(model, step)) &
                call turn_upper(mechanism, step, axes, per_length, rate, v, a)
        end associate
    end subroutine close_leg

    !> The upper half of a UCU leg.
    subroutine turn_upper(mechanism, step, axes, per_length, rate, v, a)
        type(mechanism_type), intent(inout) :: mechanism
        type(step_type), intent(in) :: step
        type(rotation), intent(in) :: axes             !! of the lower half
        type(value), intent(in) :: per_length, rate    !! of the leg's length [1/m], [m/s]
        type(vector), intent(in) :: v, a               !! of S against U, axes of the lower half [m/s], [m/s2]
        type(rotation) :: frame, own
        type(vector) :: u, w, b, beta
        type(value) :: m, per_m, k
        integer :: top, side

        associate (bodies => mechanism%bodies, upper => step%link(2), joint => mechanism%model%joint(step%joint(3)))
            side = 3 - side_of(joint, upper)
            top = joint%link(side)
            frame = marker_frame(mechanism, step%joint(3), side)
            u = axes.unrotate.(rotation_of(bodies, top) .rotate.frame%z)
            ! a leg along the first axis of this universal joint has lost the second
            call must_be_positive(mechanism, square(u%x) + square(u%y) - least_square)
            m = sqrt(square(u%x) + square(u%y))
            per_m = reciprocal(m)
            call declare_inverse(m, per_m)
            k = u%z*per_m
            mechanism%universal_axis(step%joint(3)) = vector(m, zero(), u%z)
            own%x = (per_m*u%x)*axes%x + (per_m*u%y)*axes%y
            own%y = (per_m*u%x)*axes%y - (per_m*u%y)*axes%x
            own%z = axes%z
            b = own.unrotate.omega_of(bodies, top, world_axes)
            beta = own.unrotate.alpha_of(bodies, top, world_axes)
            w = turning_of_line(per_length, k, in_own(v), b)
            call set_turning(bodies, upper, own, w, turning_of_line_2(per_length, k, rate, w, in_own(a), b, beta))
            call set_vector(bodies%body(upper)%acceleration, own_axes, in_own(bodies%body(upper)%acceleration%v(own_axes)))
        end associate

    contains

        !> From the axes of the lower half: both have the same z.
        function in_own(vector_of_lower) result(x)
            type(vector), intent(in) :: vector_of_lower
            type(vector) :: x

            associate (of_lower => vector_of_lower)
                x = vector(per_m*(u%x*of_lower%x + u%y*of_lower%y), per_m*(u%x*of_lower%y - u%y*of_lower%x), of_lower%z)
            end associate
        end function in_own
    end subroutine turn_upper

    !> A half has own axes, angular velocity and acceleration.
    subroutine set_turning(bodies, link, axes, w, alpha)
        type(bodies_type), intent(inout) :: bodies
        integer, intent(in) :: link
        type(rotation), intent(in) :: axes
        type(vector), intent(in) :: w, alpha           !! own axes

        associate (turning => bodies%turning(bodies%body(link)%turning))
            turning%r = axes
            call set_vector(turning%omega, own_axes, w)
            call set_vector(turning%alpha, own_axes, alpha)
        end associate
    end subroutine set_turning

    !> Unknown accelerations that many unknowns stand in become unknowns themselves: the leg's equations then have three of
    !> them instead of all that move S.
    function named(equations, a) result(b)
        type(system_type), intent(inout) :: equations
        type(vector), intent(in) :: a
        type(vector) :: b

        b = vector(unknown(equations), unknown(equations), unknown(equations))
        call require(equations, components(b - a))
    end function named

    !> The slide's variable from the distance of U and S.
    function slide_of_length(mechanism, step, length) result(slide)
        type(mechanism_type), intent(in) :: mechanism
        type(step_type), intent(in) :: step
        type(value), intent(in) :: length
        type(value) :: slide
        type(vector) :: lower, upper                   ! markers from U and S, leg axes
        integer :: side

        side = side_of(mechanism%model%joint(step%joint(2)), step%link(1))
        lower = marker_point(mechanism, step%joint(2), side)
        upper = marker_point(mechanism, step%joint(2), 3 - side)
        slide = length + (upper%z - lower%z)
        if ((side == 1) .neqv. (step%branch >= 0)) slide = -slide
    end function slide_of_length
end module linkdyn_leg
