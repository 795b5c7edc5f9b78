!> Stand-in where linkdyn is built without GSL, or in quadruple precision, which GSL does not know. Twin of
!> linkdyn_ode_gsl.f90.
module linkdyn_ode_gsl
    use linkdyn_kinds, only: wp, wp_name
    use linkdyn_lane_system, only: lane_system
    use linkdyn_one_step, only: one_step_method
    use linkdyn_status, only: status_type, fail, status_unavailable
    use linkdyn_text, only: quoted
    implicit none (type, external)
    private
    public :: ode_gsl, runge_kutta_gsl, has_gsl

    logical, parameter :: has_gsl = .false.

    type, extends(one_step_method) :: runge_kutta_gsl
    contains
        procedure :: start => start_runge_kutta
        procedure :: try_step => try_runge_kutta
        procedure :: propose => propose_runge_kutta
    end type runge_kutta_gsl

    type :: ode_gsl
    contains
        procedure :: start, take_step, reset, release
        procedure :: n_rejected, n_evaluation
    end type ode_gsl

contains

    subroutine refuse(name, status)
        character(len=*), intent(in) :: name
        type(status_type), intent(inout) :: status

        call fail(status, status_unavailable, "method "//quoted(name)//" needs the GNU Scientific Library, and this linkdyn (" &
                  //wp_name//") was built without it (expected rk4, gbs or seulex, or a build with -Dgsl=enabled)")
    end subroutine refuse

    subroutine start_runge_kutta(self, name, system, status)
        class(runge_kutta_gsl), intent(inout) :: self
        character(len=*), intent(in) :: name
        class(lane_system), intent(inout), target :: system
        type(status_type), intent(inout) :: status

        call refuse(name, status)
    end subroutine start_runge_kutta

    subroutine try_runge_kutta(self, system, t, step, y, rate, way, error, failed, again)
        class(runge_kutta_gsl), intent(inout) :: self
        class(lane_system), intent(inout) :: system
        real(wp), intent(in) :: t, step
        real(wp), intent(in) :: y(:), rate(:)
        real(wp), intent(out) :: way(:), error(:)
        logical, intent(out) :: failed
        logical, intent(in) :: again

        way = 0
        error = 0
        failed = .true.
    end subroutine try_runge_kutta

    subroutine propose_runge_kutta(self, step, allowed, is_accepted, next)
        class(runge_kutta_gsl), intent(inout) :: self
        real(wp), intent(in) :: step
        real(wp), intent(in) :: allowed(:)
        logical, intent(in) :: is_accepted
        real(wp), intent(out) :: next

        next = step
    end subroutine propose_runge_kutta

    subroutine start(self, system, first_step, rtol, status)
        class(ode_gsl), intent(inout) :: self
        class(lane_system), intent(inout), target :: system
        real(wp), intent(in) :: first_step, rtol
        type(status_type), intent(inout) :: status

        call refuse("msbdf", status)
    end subroutine start

    subroutine take_step(self, t, t_end, h, y, atol, ok)
        class(ode_gsl), intent(inout) :: self
        real(wp), intent(inout) :: t
        real(wp), intent(in) :: t_end
        real(wp), intent(inout) :: h
        real(wp), intent(inout) :: y(:)
        real(wp), intent(in) :: atol(:)
        logical, intent(out) :: ok

        ok = .false.
    end subroutine take_step

    subroutine reset(self)
        class(ode_gsl), intent(inout) :: self
    end subroutine reset

    subroutine release(self)
        class(ode_gsl), intent(inout) :: self
    end subroutine release

    integer function n_rejected(self)
        class(ode_gsl), intent(in) :: self

        n_rejected = 0
    end function n_rejected

    integer function n_evaluation(self)
        class(ode_gsl), intent(in) :: self

        n_evaluation = 0
    end function n_evaluation
end module linkdyn_ode_gsl
