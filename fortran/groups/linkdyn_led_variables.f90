!> Joint variables that gears make of those of other joints: what these add once they are placed, and whether their turns are known.
module linkdyn_led_variables
    use linkdyn_bodies, only: world_axes, alpha_of, point_acceleration
    use linkdyn_joint_kind, only: marker_pair, axis_of
    use linkdyn_joint_variables, only: variable_near, variable_rate
    use linkdyn_mechanism, only: mechanism_type, pair_of, marker_point, point_of_action, must_be_positive
    use linkdyn_model, only: counts_turns, most_turned
    use linkdyn_rates, only: set_rate
    use linkdyn_value, only: value, constant, abs, operator(+), operator(-), operator(*)
    use linkdyn_vector, only: vector, operator(-), operator(.dot.)
    implicit none (type, external)
    private
    public :: complete_led, watch_own_turns

contains

    !> Add to given variables, and to their rates, what other joints lead.
    subroutine complete_led(mechanism, given, own)
        type(mechanism_type), intent(inout) :: mechanism
        integer, intent(in) :: given(:)                !! numbers of coordinates, and beyond them of what is led
        integer, intent(in) :: own(:)                  !! joints that are not placed yet, but together with what they lead: their
                                                       !! part is in the constraints
        type(value) :: weight
        integer :: i, s

        do i = 1, size(given)
            associate (n_q => mechanism%model%n_q, c => given(i))
                if (c <= n_q) cycle
                if (mechanism%is_led(c - n_q)) cycle
                mechanism%is_led(c - n_q) = .true.
                associate (source => mechanism%model%led(c - n_q)%source)
                    do s = 1, size(source)
                        if (any(own == source(s))) cycle
                        weight = mechanism%number(mechanism%at%led(c - n_q) + n_q + s)
                        call watch_turns(mechanism, c - n_q, s)
                        mechanism%q(c) = mechanism%q(c) + weight*leading(mechanism, source(s))
                        mechanism%qd(c) = mechanism%qd(c) + weight*variable_rate(mechanism, source(s), 1)
                        mechanism%qdd(c) = mechanism%qdd(c) + weight*second_rate(mechanism, source(s))
                    end do
                    if (size(source) == 0) cycle
                    call set_rate(mechanism%rates, mechanism%q(c), mechanism%qd(c))
                    call set_rate(mechanism%rates, mechanism%qd(c), mechanism%qdd(c))
                end associate
            end associate
        end do
    end subroutine complete_led

    !> Watch the turns of given variables: those of joints that lead them and are placed together with them.
    subroutine watch_own_turns(mechanism, given, own)
        type(mechanism_type), intent(inout) :: mechanism
        integer, intent(in) :: given(:), own(:)        !! as above
        integer :: i, s

        do i = 1, size(given)
            associate (c => given(i) - mechanism%model%n_q)
                if (c <= 0) cycle
                do s = 1, size(mechanism%model%led(c)%source)
                    if (any(own == mechanism%model%led(c)%source(s))) call watch_turns(mechanism, c, s)
                end do
            end associate
        end do
    end subroutine watch_own_turns

    !> Where turns count, source s of a led variable must stay so near to its start that they are known.
    subroutine watch_turns(mechanism, led, s)
        type(mechanism_type), intent(inout) :: mechanism
        integer, intent(in) :: led, s

        associate (model => mechanism%model, j => mechanism%model%led(led)%source(s))
            if (counts_turns(model, model%led(led), s)) call must_be_positive( &
                mechanism, constant(most_turned) - abs(leading(mechanism, j) - constant(model%scene%joint(j)%start(1))))
        end associate
    end subroutine watch_turns

    !> Variable of a joint that leads, as near to its start as turns make it.
    function leading(mechanism, j) result(variable)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: j
        type(value) :: variable

        variable = variable_near(mechanism, j, 1, constant(mechanism%model%scene%joint(j)%start(1)))
    end function leading

    !> Second rate of the variable of a hinge or slide. What turns with the first link and what Coriolis adds is square to the axis.
    function second_rate(mechanism, j) result(qdd)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: j
        type(value) :: qdd
        type(marker_pair) :: pair
        type(vector) :: axis

        pair = pair_of(mechanism, j)
        axis = axis_of(pair%first, 3)
        associate (link => mechanism%model%joint(j)%link, bodies => mechanism%bodies)
            if (mechanism%kind(j)%is%is_slide(1)) then
                qdd = (point_acceleration(bodies, link(2), marker_point(mechanism, j, 2), world_axes) &
                       - point_acceleration(bodies, link(1), point_of_action(mechanism, j, 1), world_axes)) .dot.axis
            else
                qdd = (alpha_of(bodies, link(2), world_axes) - alpha_of(bodies, link(1), world_axes)) .dot.axis
            end if
        end associate
    end function second_rate
end module linkdyn_led_variables
