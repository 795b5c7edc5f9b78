!> Virtual work: one equation a coordinate, without any reaction.
!>
!> While the mechanism moves as coordinate k alone would move it, at a unit rate, drives supply what the links' inertia asks for
!> beyond gravity, loads and all else that acts:
!>
!>     sum of driving force * rate of its variable = sum over the links of force . velocity + moment . angular velocity
!>
!> What is unknown of forces and accelerations stands in it as in the equations of the links, of which these are sums.
module linkdyn_virtual_work
    use linkdyn_bodies, only: own_axes, omega_of, rotation_of
    use linkdyn_inputs, only: trace_request
    use linkdyn_joint_variables, only: variable_rate
    use linkdyn_link_wrenches, only: link_wrenches
    use linkdyn_substitution, only: substitution, substituted
    use linkdyn_system, only: require
    use linkdyn_trace, only: traced_type, trace_what_acts, trace_sharing, in_motion_of
    use linkdyn_value, only: value, zero, one, operator(+), operator(-), operator(*)
    use linkdyn_vector, only: vector, vector_of, components, operator(.dot.), operator(.unrotate.)
    implicit none (type, external)
    private
    public :: trace_work

contains

    !> Equations of all coordinates.
    subroutine trace_work(request, traced)
        type(trace_request), intent(in) :: request
        type(traced_type), intent(inout) :: traced

        call trace_what_acts(request, traced)
        call trace_sharing(request, traced)
        call balance_work(traced)
    end subroutine trace_work

    !> Links are placed and move, and what acts is known but for the unknowns.
    subroutine balance_work(traced)
        type(traced_type), intent(inout) :: traced
        type(vector), dimension(traced%mechanism%model%n_link) :: force, moment
        type(value) :: rate(traced%mechanism%model%n_q), work
        type(substitution) :: map
        integer :: i, k, l

        call link_wrenches(traced, force, moment)
        associate (model => traced%mechanism%model, bodies => traced%mechanism%bodies)
            do k = 1, model%n_q
                rate = zero()
                rate(k) = one()
                map = substitution()
                call in_motion_of(traced, rate, map)
                work = zero()
                do l = 1, model%n_link
                    if (.not. model%moves(k, l)) cycle
                    work = work - (force(l) .dot.moved(rotation_of(bodies, l) .unrotate.bodies%body(l)%velocity)) &
                           - (moment(l) .dot.moved(omega_of(bodies, l, own_axes)))
                end do
                do i = 1, model%n_actuator
                    associate (actuator => model%scene%actuator(i))
                        work = work + traced%unknowns%transmitted(i) &
                               *substituted(map, variable_rate(traced%mechanism, actuator%joint, actuator%variable))
                    end associate
                end do
                call require(traced%system, work)
            end do
        end associate

    contains

        !> A velocity while the coordinate moves.
        function moved(v)
            type(vector), intent(in) :: v
            type(vector) :: moved

            moved = vector_of(substituted(map, components(v)))
        end function moved
    end subroutine balance_work
end module linkdyn_virtual_work
