!> Stand-in where linkdyn is built without GSL, or in quadruple precision, which GSL does not know. Twin of
!> linkdyn_ode_gsl.f90.
module linkdyn_ode_gsl
    use linkdyn_kinds, only: wp, wp_name
    use linkdyn_lane_system, only: lane_system
    use linkdyn_status, only: status_type, fail, status_unavailable
    use linkdyn_text, only: quoted
    implicit none (type, external)
    private
    public :: ode_gsl

    type :: ode_gsl
    contains
        procedure :: start, take_step, reset, release
        procedure :: n_rejected, n_evaluation
    end type ode_gsl

contains

    subroutine start(self, stepper, system, first_step, rtol, atol, status)
        class(ode_gsl), intent(inout) :: self
        character(len=*), intent(in) :: stepper
        class(lane_system), intent(inout), target :: system
        real(wp), intent(in) :: first_step, rtol, atol
        type(status_type), intent(inout) :: status

        call fail(status, status_unavailable, "method "//quoted(stepper)//" needs the GNU Scientific Library, and this linkdyn (" &
                  //wp_name//") was built without it (expected rk4, or a build with -Dgsl=enabled)")
    end subroutine start

    subroutine take_step(self, t, t_end, h, y, ok)
        class(ode_gsl), intent(inout) :: self
        real(wp), intent(inout) :: t
        real(wp), intent(in) :: t_end
        real(wp), intent(inout) :: h
        real(wp), intent(inout) :: y(:)
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
