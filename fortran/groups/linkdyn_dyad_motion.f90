!> How the links of planar dyads move, in closed form. The dyad is placed, its ways are found, the links that it hangs on move.
!>
!> Each link lets the inner joint move one way: turned about an outer hinge, or along an outer slide. Known links would carry the
!> joint's two sides apart, and so do slides inside the dyad, whose rates are given; the rates along both ways close that gap, of
!> velocities first, then of accelerations.
module linkdyn_dyad_motion
    use linkdyn_bodies, only: bodies_type, world_axes, set_vector, point_position, omega_of, alpha_of, carried_velocity, &
        carried_acceleration, rotation_of
    use linkdyn_dyads, only: half_type, half_of, outer_point, led_shift, inner_point, led_axis, left_of
    use linkdyn_kinds, only: wp
    use linkdyn_mechanism, only: mechanism_type
    use linkdyn_model, only: step_type, step_rrr, step_rpr, step_prp, step_ppr
    use linkdyn_value, only: value, zero, operator(+), operator(-), operator(*), reciprocal
    use linkdyn_vector, only: vector, zero_vector, operator(+), operator(-), operator(*), operator(.rotate.)
    implicit none (type, external)
    private
    public :: move_dyad

contains

    subroutine move_dyad(mechanism, step)
        type(mechanism_type), intent(inout) :: mechanism
        type(step_type), intent(in) :: step
        type(half_type) :: half(2)
        integer :: i

        half = [(half_of(mechanism, step, i), i=1, 2)]
        select case (step%kind)
        case (step_rpr)
            call move_rpr(mechanism, half, mechanism%ways(:, step%first))
        case (step_ppr)
            call move_ppr(mechanism, half, mechanism%ways(:, step%first))
        case default
            call move_by_hinge(mechanism, step, half)
        end select
        call move_tips(mechanism, half)
    end subroutine move_dyad

    !> RRR, RRP, PRP: both links move the hinge between them.
    subroutine move_by_hinge(mechanism, step, half)
        type(mechanism_type), intent(inout) :: mechanism
        type(step_type), intent(in) :: step
        type(half_type), intent(in) :: half(2)
        type(vector) :: way(2), from(2), hinge, carried(2), drawn(2)
        type(value) :: rate(2), second(2)
        logical :: turns(2)
        integer :: i

        turns = [step%kind /= step_prp, step%kind == step_rrr]
        way = mechanism%ways(:, step%first)
        if (step%kind == step_rrr) way = [left_of(way(1)), left_of(way(2))]
        hinge = point_position(mechanism%bodies, half(1)%link, inner_point(mechanism, half(1)))
        do i = 1, 2
            from(i) = hinge
            if (turns(i)) from(i) = outer_point(mechanism, half(i))
            drawn(i) = drawn_out(mechanism, half(i), mechanism%qd)
            carried(i) = velocity_at(mechanism, half(i), from(i)) + drawn(i)
        end do
        rate = closing_rates(way(1), -way(2), carried(2) - carried(1))
        do i = 1, 2
            carried(i) = acceleration_at(mechanism, half(i), from(i)) + drawn_out(mechanism, half(i), mechanism%qdd)
            if (turns(i)) then
                carried(i) = carried(i) - (rate(i)*rate(i))*(hinge - from(i)) + (2.0_wp*rate(i))*left_of(drawn(i))
            else
                carried(i) = carried(i) + coriolis(mechanism%bodies, half(i)%known, rate(i)*way(i) + drawn(i))
            end if
        end do
        second = closing_rates(way(1), -way(2), carried(2) - carried(1))
        do i = 1, 2
            if (turns(i)) then
                call turn_about(mechanism, half(i), rate(i), second(i))
            else
                call slide_along(mechanism%bodies, half(i)%link, half(i)%known, rate(i)*way(i), second(i)*way(i))
            end if
        end do
    end subroutine move_by_hinge

    !> Both links turn as one about their hinges, which slide apart.
    subroutine move_rpr(mechanism, half, way)
        type(mechanism_type), intent(inout) :: mechanism
        type(half_type), intent(in) :: half(2)
        type(vector), intent(in) :: way(2)
        type(vector) :: hinge(2), gap, drawn
        type(value) :: rate(2), second(2)
        integer :: i

        hinge = [(outer_point(mechanism, half(i)), i=1, 2)]
        drawn = drawn_out(mechanism, half(1), mechanism%qd) - drawn_out(mechanism, half(2), mechanism%qd)
        gap = velocity_at(mechanism, half(2), hinge(2)) - velocity_at(mechanism, half(1), hinge(1)) - drawn
        rate = closing_rates(way(1), way(2), gap)
        gap = acceleration_at(mechanism, half(2), hinge(2)) - acceleration_at(mechanism, half(1), hinge(1))
        gap = gap - (drawn_out(mechanism, half(1), mechanism%qdd) - drawn_out(mechanism, half(2), mechanism%qdd)) &
              + (rate(1)*rate(1))*(hinge(2) - hinge(1)) - (2.0_wp*rate(1))*left_of(rate(2)*way(2) + drawn)
        second = closing_rates(way(1), way(2), gap)
        do i = 1, 2
            call turn_about(mechanism, half(i), rate(1), second(1))
        end do
    end subroutine move_rpr

    !> A link slides on a known one, and one on that: both turn with it.
    subroutine move_ppr(mechanism, half, way)
        type(mechanism_type), intent(inout) :: mechanism
        type(half_type), intent(in) :: half(2)
        type(vector), intent(in) :: way(2)
        type(vector) :: hinge, gap, drawn
        type(value) :: rate(2), second(2)

        hinge = outer_point(mechanism, half(2))
        drawn = drawn_out(mechanism, half(1), mechanism%qd) - drawn_out(mechanism, half(2), mechanism%qd)
        associate (bodies => mechanism%bodies)
            gap = velocity_at(mechanism, half(2), hinge) - carried_velocity(bodies, half(1)%known, hinge) - drawn
            rate = closing_rates(way(1), way(2), gap)
            gap = acceleration_at(mechanism, half(2), hinge) - carried_acceleration(bodies, half(1)%known, hinge) &
                  - (drawn_out(mechanism, half(1), mechanism%qdd) - drawn_out(mechanism, half(2), mechanism%qdd)) &
                  - coriolis(bodies, half(1)%known, rate(1)*way(1) + rate(2)*way(2) + drawn)
            second = closing_rates(way(1), way(2), gap)
            call slide_along(bodies, half(1)%link, half(1)%known, rate(1)*way(1), second(1)*way(1))
            call slide_along(bodies, half(2)%link, half(1)%link, rate(2)*way(2) + drawn, second(2)*way(2) &
                             + drawn_out(mechanism, half(1), mechanism%qdd) - drawn_out(mechanism, half(2), mechanism%qdd))
        end associate
    end subroutine move_ppr

    !> What a slide inside a half adds to a rate of the inner joint, seen from the link: its axis times a rate of its variable;
    !> nothing of a half without one.
    function drawn_out(mechanism, half, rate) result(v)
        type(mechanism_type), intent(in) :: mechanism
        type(half_type), intent(in) :: half
        type(value), intent(in) :: rate(:)                 !! of all that is given
        type(vector) :: v

        v = zero_vector()
        if (half%led == 0) return
        v = rate(half%given)*(rotation_of(mechanism%bodies, half%link) .rotate.led_axis(mechanism, half))
    end function drawn_out

    !> Tips of halves whose links move.
    subroutine move_tips(mechanism, half)
        type(mechanism_type), intent(inout) :: mechanism
        type(half_type), intent(in) :: half(2)
        integer :: i

        do i = 1, 2
            if (half(i)%led == 0) cycle
            call slide_along(mechanism%bodies, half(i)%tip, half(i)%link, drawn_out(mechanism, half(i), mechanism%qd), &
                             drawn_out(mechanism, half(i), mechanism%qdd))
        end do
    end subroutine move_tips

    !> gap = rate(1)*first + rate(2)*second, in the plane.
    function closing_rates(first, second, gap) result(rate)
        type(vector), intent(in) :: first, second, gap
        type(value) :: rate(2)
        type(value) :: per

        per = reciprocal(across(first, second))
        rate = [per*across(gap, second), per*across(first, gap)]
    end function closing_rates

    function across(a, b) result(z)
        type(vector), intent(in) :: a, b
        type(value) :: z

        z = a%x*b%y - a%y*b%x
    end function across

    ! ---------------------------------------------------------------- carried by a link

    !> How a point of a half would move if that moved with the known link alone; one that coordinates give moves as these say.
    function velocity_at(mechanism, half, point) result(v)
        type(mechanism_type), intent(in) :: mechanism
        type(half_type), intent(in) :: half
        type(vector), intent(in) :: point                  !! world axes [m]
        type(vector) :: v

        v = carried_velocity(mechanism%bodies, half%known, point)
        if (half%shift(1) > 0) v = v + led_shift(mechanism, half, mechanism%qd)
    end function velocity_at

    function acceleration_at(mechanism, half, point) result(a)
        type(mechanism_type), intent(in) :: mechanism
        type(half_type), intent(in) :: half
        type(vector), intent(in) :: point                  !! world axes [m]
        type(vector) :: a

        a = carried_acceleration(mechanism%bodies, half%known, point)
        if (half%shift(1) > 0) a = a + led_shift(mechanism, half, mechanism%qdd) &
            + coriolis(mechanism%bodies, half%known, led_shift(mechanism, half, mechanism%qd))
    end function acceleration_at

    !> Coriolis acceleration of what slides on a link.
    function coriolis(bodies, link, velocity) result(a)
        type(bodies_type), intent(in) :: bodies
        integer, intent(in) :: link
        type(vector), intent(in) :: velocity               !! on it [m/s]
        type(vector) :: a, omega

        omega = omega_of(bodies, link, world_axes)
        a = (2.0_wp*omega%z)*left_of(velocity)
    end function coriolis

    ! ---------------------------------------------------------------- the links

    !> A link on an outer hinge.
    subroutine turn_about(mechanism, half, rate, second)
        type(mechanism_type), intent(inout) :: mechanism
        type(half_type), intent(in) :: half
        type(value), intent(in) :: rate, second            !! of its angle
        type(vector) :: hinge, arm

        hinge = outer_point(mechanism, half)
        associate (bodies => mechanism%bodies)
            call turn(bodies, half%link, vector(zero(), zero(), rate), vector(zero(), zero(), second))
            arm = bodies%body(half%link)%position - hinge
            bodies%body(half%link)%velocity = velocity_at(mechanism, half, hinge) + rate*left_of(arm)
            call set_vector(bodies%body(half%link)%acceleration, world_axes, acceleration_at(mechanism, half, hinge) &
                            + second*left_of(arm) - (rate*rate)*arm)
        end associate
    end subroutine turn_about

    !> A link on a slide of another one.
    subroutine slide_along(bodies, link, on, velocity, acceleration)
        type(bodies_type), intent(inout) :: bodies
        integer, intent(in) :: link, on
        type(vector), intent(in) :: velocity, acceleration !! along the slide, seen from the other link [m/s, m/s2]

        call turn(bodies, link, omega_of(bodies, on, world_axes), alpha_of(bodies, on, world_axes))
        associate (body => bodies%body(link))
            body%velocity = carried_velocity(bodies, on, body%position) + velocity
            call set_vector(body%acceleration, world_axes, carried_acceleration(bodies, on, body%position) + acceleration &
                            + coriolis(bodies, on, velocity))
        end associate
    end subroutine slide_along

    !> Links that do not turn on others share their turning, which may be known already.
    subroutine turn(bodies, link, omega, alpha)
        type(bodies_type), intent(inout) :: bodies
        integer, intent(in) :: link
        type(vector), intent(in) :: omega, alpha

        associate (turning => bodies%turning(bodies%body(link)%turning))
            if (any(turning%omega%is_known)) return
            call set_vector(turning%omega, world_axes, omega)
            call set_vector(turning%alpha, world_axes, alpha)
        end associate
    end subroutine turn
end module linkdyn_dyad_motion
