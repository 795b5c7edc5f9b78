!> A method that knows nothing of the steps before: what the control of its steps has to know of it.
module linkdyn_one_step
    use linkdyn_kinds, only: wp
    use linkdyn_lane_system, only: lane_system
    implicit none (type, external)
    private
    public :: one_step_method

    type, abstract :: one_step_method
        integer :: n_evaluation = 0                       !! right-hand sides (blocks)
    contains
        procedure(try_step), deferred :: try_step
        procedure(propose_step), deferred :: propose
        procedure :: error_unseen
        procedure :: compares_end
        procedure :: forget
        procedure :: is_of_fortran
        procedure :: release
    end type one_step_method

    abstract interface
        !> One step from y at t, ahead or back.
        !>
        !> The way is told, not where it leads: so its rounding is that of the way, however large y is.
        subroutine try_step(self, system, t, step, y, rate, way, error, failed, again)
            import :: one_step_method, lane_system, wp
            class(one_step_method), intent(inout) :: self
            class(lane_system), intent(inout) :: system
            real(wp), intent(in) :: t, step
            real(wp), intent(in) :: y(:), rate(:)         !! solution and its rates at t (n)
            real(wp), intent(out) :: way(:)               !! to the solution at t + step (n)
            real(wp), intent(out) :: error(:)             !! of the way, estimated; of either sign (n)
            logical, intent(out) :: failed                !! a right-hand side could not be evaluated
            logical, intent(in) :: again                  !! by the same formula as the last step tried
        end subroutine try_step

        !> What is learnt from the step tried last: how long the next one should be.
        subroutine propose_step(self, step, allowed, is_accepted, next)
            import :: one_step_method, wp
            class(one_step_method), intent(inout) :: self
            real(wp), intent(in) :: step
            real(wp), intent(in) :: allowed(:)            !! error (n)
            logical, intent(in) :: is_accepted            !! otherwise the next try is shorter
            real(wp), intent(out) :: next
        end subroutine propose_step
    end interface

contains

    !> What may have been left out of the step tried last, beside its error: stages, or their differences, need not have met all
    !> that lies within it.
    subroutine error_unseen(self, step, start_rate, end_rate, error)
        class(one_step_method), intent(inout) :: self
        real(wp), intent(in) :: step
        real(wp), intent(in) :: start_rate(:), end_rate(:)    !! where it begins and ends (n)
        real(wp), intent(out) :: error(:)                 !! of its way (n)

        error = 0*(step + start_rate + end_rate)
    end subroutine error_unseen

    !> Does that need the rates where the step ends?
    pure logical function compares_end(self)
        class(one_step_method), intent(in) :: self

        compares_end = .false.
    end function compares_end

    !> What was learnt from steps so far does not hold beyond.
    subroutine forget(self)
        class(one_step_method), intent(inout) :: self
    end subroutine forget

    !> Is all that it is in Fortran, so that a copy of it remembers the same? Else it remembers nothing from step to step.
    pure logical function is_of_fortran(self)
        class(one_step_method), intent(in) :: self

        is_of_fortran = .true.
    end function is_of_fortran

    !> Give back what the method holds outside of Fortran.
    subroutine release(self)
        class(one_step_method), intent(inout) :: self
    end subroutine release
end module linkdyn_one_step
