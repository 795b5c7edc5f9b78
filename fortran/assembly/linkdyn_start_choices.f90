!> Which of its ways each step of the plan takes at the start, where several close.
!>
!> Each takes the nearest. Where loops behind it cannot be closed then, the last one before them that has another way takes the next
!> nearest, and so on back to the first: of the assemblies of the whole mechanism that one is taken in which the steps, one after
!> the other, are as near as they can be. Mechanisms without groups closed by iteration have no such choice: their branches are
!> told, or as drawn, or +1, whatever comes of it.
module linkdyn_start_choices
    use linkdyn_kinematic_pass, only: clear_flags
    use linkdyn_kinematic_state, only: kinematic_state
    use linkdyn_model, only: model_type
    use linkdyn_status, only: status_type
    implicit none (type, external)
    private
    public :: start_choices, place_all

    !> Ways multiply; who is not closed after so many is taken as not to be.
    integer, parameter :: most_passes = 64

    type :: start_choices
        integer, allocatable :: passed_over(:)         !! nearer ways of each step, with which steps behind it do not close (n_step)
        integer, allocatable :: n_way(:)               !! that it has; found anew in each pass
    contains
        procedure :: go_back
    end type start_choices

    abstract interface
        !> Place the links of a step of the plan, in the nearest of its ways that are not passed over.
        subroutine place_one(model, i, choices, state, status, like)
            import :: model_type, start_choices, kinematic_state, status_type
            type(model_type), intent(inout) :: model
            integer, intent(in) :: i
            type(start_choices), intent(inout) :: choices
            type(kinematic_state), intent(inout) :: state
            type(status_type), intent(inout) :: status
            type(model_type), intent(in), optional :: like     !! a model that stands as this one will
        end subroutine place_one
    end interface

contains

    !> Steps, each in the nearest of its ways with which those behind it close; without any such, in the nearest of all.
    subroutine place_all(model, state, by_default, place_step, status, like)
        type(model_type), intent(inout) :: model
        type(kinematic_state), intent(inout) :: state
        integer, intent(in) :: by_default                  !! what chooses branches if nothing speaks: one of `by_*`
        procedure(place_one) :: place_step
        type(status_type), intent(inout) :: status
        type(model_type), intent(in), optional :: like     !! a model that stands as this one will
        type(start_choices) :: choices
        type(status_type) :: first
        integer :: pass, stuck
        logical :: goes_on

        call begin_choices(size(model%step), choices)
        do pass = 1, most_passes
            call make_pass(status)
            if (pass == 1) first = status
            if (stuck == 0) return
            call choices%go_back(stuck, goes_on)
            if (.not. goes_on .or. size(model%group) == 0) exit
            status = status_type()
        end do
        status = first
        if (pass == 1 .or. .not. status%is_ok()) return
        call begin_choices(size(model%step), choices)
        call make_pass(status)

    contains

        !> Ends at the first step that cannot be closed with what was chosen for those before. What is only out of reach is told,
        !> and the pass goes on.
        !> the pass goes on.
        subroutine make_pass(status)
            type(status_type), intent(inout) :: status
            logical :: is_lost
            integer :: i

            stuck = 0
            model%branch = 1
            state%branch = 1
            model%chosen_by = by_default
            do i = 1, size(model%group)
                model%group(i)%start = 0
            end do
            call clear_flags(state)
            do i = 1, size(model%step)
                is_lost = state%unreachable(1)
                call place_step(model, i, choices, state, status, like)
                if (stuck == 0 .and. (.not. status%is_ok() .or. (state%unreachable(1) .and. .not. is_lost))) stuck = i
                if (.not. status%is_ok()) return
            end do
        end subroutine make_pass
    end subroutine place_all

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
