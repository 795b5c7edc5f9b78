!> Joint variables that gears make of those of joints that are placed already.
module linkdyn_led_variables
    use linkdyn_bodies, only: world_axes, omega_of, alpha_of, point_acceleration
    use linkdyn_joint_kind, only: marker_pair, axis_of
    use linkdyn_joint_variables, only: variable_near, variable_rate
    use linkdyn_mechanism, only: mechanism_type, pair_of, marker_point, point_of_action, must_be_positive
    use linkdyn_model, only: counts_turns, most_turned
    use linkdyn_rates, only: set_rate
    use linkdyn_value, only: value, constant, abs, operator(+), operator(-), operator(*)
    use linkdyn_vector, only: vector, operator(-), operator(.dot.)
    implicit none (type, external)
    private
    public :: complete_led

contains

    !> Add to given variables, and to their rates, what other joints lead.
    subroutine complete_led(mechanism, given)
        type(mechanism_type), intent(inout) :: mechanism
        integer, intent(in) :: given(:)                !! numbers of coordinates, and beyond them of what is led
        type(value) :: weight, variable, near
        integer :: i, s

        do i = 1, size(given)
            associate (n_q => mechanism%model%n_q, c => given(i))
                if (c <= n_q) cycle
                if (mechanism%is_led(c - n_q)) cycle
                mechanism%is_led(c - n_q) = .true.
                associate (source => mechanism%model%led(c - n_q)%source)
                    do s = 1, size(source)
                        weight = mechanism%number(mechanism%at%led(c - n_q) + n_q + s)
                        near = constant(mechanism%model%scene%joint(source(s))%start(1))
                        variable = variable_near(mechanism, source(s), 1, near)
                        if (counts_turns(mechanism%model, mechanism%model%led(c - n_q), s)) &
                            call must_be_positive(mechanism, constant(most_turned) - abs(variable - near))
                        mechanism%q(c) = mechanism%q(c) + weight*variable
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
