!> A system of ordinary differential equations on lanes: all that the integrators know of what they integrate.
module linkdyn_lane_system
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    implicit none (type, external)
    private
    public :: lane_system

    !> dy/dt = f(t, y), `lanes` solutions side by side.
    type, abstract :: lane_system
        integer :: n = 0                                  !! components of y
        logical :: wants_rest = .false.                   !! the integrator comes back to its caller after the step accepted
    contains
        procedure(evaluate_rates), deferred :: evaluate
        procedure :: accept
    end type lane_system

    abstract interface
        !> f on all lanes. Lanes are independent; one where f cannot be evaluated is flagged.
        subroutine evaluate_rates(self, t, y, rate, failed)
            import :: lane_system, wp, lanes
            class(lane_system), intent(inout) :: self
            real(wp), intent(in) :: t(lanes)
            real(wp), intent(in) :: y(:, :)               !! (lane, n)
            real(wp), intent(out) :: rate(:, :)           !! (lane, n)
            logical, intent(out) :: failed(lanes)
        end subroutine evaluate_rates
    end interface

contains

    !> The integrator goes on from y: for systems that remember where they are. Rates tried before count no more.
    subroutine accept(self, t, y, is_accepted)
        class(lane_system), intent(inout) :: self
        real(wp), intent(in) :: t(lanes)
        real(wp), intent(in) :: y(:, :)                   !! (lane, n)
        logical, intent(in) :: is_accepted(lanes)         !! other lanes have stopped
    end subroutine accept
end module linkdyn_lane_system
