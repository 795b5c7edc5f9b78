!> Which of its ways each step of the plan takes at the start, where several close.
!>
!> Each takes the nearest. Where loops behind it cannot be closed then, the last one before them that has another way takes the next
!> nearest, and so on back to the first: of the assemblies of the whole mechanism that one is taken in which the steps, one after
!> the other, are as near as they can be. Mechanisms without groups closed by iteration have no such choice: their branches are
!> told, or as drawn, or +1, whatever comes of it.
module linkdyn_start_choices
    implicit none (type, external)
    private
    public :: start_choices, begin_choices, most_passes

    !> Ways multiply; who is not closed after so many is taken as not to be.
    integer, parameter :: most_passes = 64

    type :: start_choices
        integer, allocatable :: passed_over(:)         !! nearer ways of each step, with which steps behind it do not close (n_step)
        integer, allocatable :: n_way(:)               !! that it has; found anew in each pass
    contains
        procedure :: go_back
    end type start_choices

contains

    pure subroutine begin_choices(n_step, choices)
        integer, intent(in) :: n_step
        type(start_choices), intent(out) :: choices

        allocate (choices%passed_over(n_step), source=0)
        allocate (choices%n_way(n_step), source=1)
    end subroutine begin_choices

    !> A step does not close: the last one before it that has another way is to take that.
    pure subroutine go_back(self, i, is_possible)
        class(start_choices), intent(inout) :: self
        integer, intent(in) :: i                       !! the step
        logical, intent(out) :: is_possible            !! there is such a step
        integer :: last

        last = findloc(self%passed_over(:i - 1) + 1 < self%n_way(:i - 1), .true., dim=1, back=.true.)
        is_possible = last > 0
        if (.not. is_possible) return
        self%passed_over(last) = self%passed_over(last) + 1
        self%passed_over(last + 1:) = 0
        self%n_way(last + 1:) = 1
    end subroutine go_back
end module linkdyn_start_choices
