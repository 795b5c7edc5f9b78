!> The check that uses no reaction: the power of drives and loads is what changes the energy.
module linkdyn_power_balance
    use linkdyn_bodies, only: own_axes, omega_of, rotation_of
    use linkdyn_joint_variables, only: variable_rate
    use linkdyn_link_wrenches, only: link_wrenches, wrench_sizes
    use linkdyn_rotor_forces, only: rotor_power
    use linkdyn_system, only: solved
    use linkdyn_trace, only: traced_type
    use linkdyn_value, only: value, zero, one, abs, select, reciprocal, operator(+), operator(-), operator(*)
    use linkdyn_vector, only: vector, sum_of_magnitudes, operator(.dot.), operator(.unrotate.)
    implicit none (type, external)
    private
    public :: power_imbalance

contains

    !> Sum of driving force times rate, less the power of what each link's motion asks for beyond loads and springs,
    !> relative to how large the powers could be: driving powers, and forces and moments in their parts times speeds. So
    !> links in balance, or pushed across their way, show rounding and no share of it. Zero where nothing moves.
    function power_imbalance(traced) result(imbalance)
        type(traced_type), intent(inout) :: traced
        type(value) :: imbalance
        type(value) :: total, size, over_size
        type(vector) :: force(traced%mechanism%model%n_link), moment(traced%mechanism%model%n_link), velocity, omega
        type(value) :: force_size(traced%mechanism%model%n_link), moment_size(traced%mechanism%model%n_link)
        integer :: i, l

        total = zero()
        size = zero()
        associate (model => traced%mechanism%model, bodies => traced%mechanism%bodies)
            do i = 1, model%n_actuator
                associate (actuator => model%scene%actuator(i))
                    call add(solved(traced%system, traced%unknowns%effort(i)) &
                             *variable_rate(traced%mechanism, actuator%joint, actuator%variable))
                end associate
            end do
            do i = 1, ubound(model%motor, 1)
                if (model%motor(i)%inertia > 0) call add(-solved(traced%system, rotor_power(traced%mechanism, i)))
            end do
            call link_wrenches(traced, force, moment)
            call wrench_sizes(traced, force_size, moment_size)
            do l = 1, model%n_link
                velocity = rotation_of(bodies, l) .unrotate.bodies%body(l)%velocity
                omega = omega_of(bodies, l, own_axes)
                total = total - solved(traced%system, (force(l) .dot.velocity) + (moment(l) .dot.omega))
                size = size + force_size(l)*sum_of_magnitudes(velocity) + moment_size(l)*sum_of_magnitudes(omega)
            end do
        end associate
        over_size = reciprocal(select(size, size, one()))
        ! the last factor is one, but not a number where the powers are infinite: no share of infinity is a balance
        imbalance = select(size, (total*over_size)*(size*over_size), zero())

    contains

        subroutine add(term)
            type(value), intent(in) :: term

            total = total + term
            size = size + abs(term)
        end subroutine add
    end function power_imbalance
end module linkdyn_power_balance
