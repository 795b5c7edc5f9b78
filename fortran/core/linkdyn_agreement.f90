!> Do two roads to the same numbers agree? Asked once, at samples of them: a difference would be a defect.
!>
!> A defect shows everywhere, while near a dead point both may have few digits: so most samples decide.
module linkdyn_agreement
    use linkdyn_constants, only: least_accuracy
    use linkdyn_kinds, only: wp
    implicit none (type, external)
    private
    public :: agreement, are_alike

    type :: agreement
        integer, private :: n_compared = 0
        integer, private :: n_alike = 0
    contains
        procedure :: note
        procedure :: is_reached
    end type agreement

contains

    !> One sample more has been compared.
    pure subroutine note(self, is_alike)
        class(agreement), intent(inout) :: self
        logical, intent(in) :: is_alike

        self%n_compared = self%n_compared + 1
        if (is_alike) self%n_alike = self%n_alike + 1
    end subroutine note

    !> Not by nothing compared.
    pure logical function is_reached(self)
        class(agreement), intent(in) :: self

        is_reached = self%n_compared > 0 .and. 2*self%n_alike > self%n_compared
    end function is_reached

    !> Equal but for rounding?
    pure logical function are_alike(a, b)
        real(wp), intent(in) :: a(:), b(:)

        are_alike = maxval(abs(a - b)) <= least_accuracy*max(maxval(abs(a)), maxval(abs(b)), tiny(1.0_wp))
    end function are_alike
end module linkdyn_agreement
