!> When a computation is to come back to its caller though it is not done.
module linkdyn_pause
    use, intrinsic :: iso_fortran_env, only: int64
    use linkdyn_kinds, only: wp
    implicit none (type, external)
    private
    public :: pause_type

    type :: pause_type
        integer(int64), private :: at = huge(1_int64)     !! count of the system clock
        logical, private :: has_worked = .false.          !! something was done since the pause was set: however slow it is,
                                                          !! a computation gets on from call to call
    contains
        procedure :: set
        procedure :: note_work
        procedure :: is_due
    end type pause_type

contains

    !> Some seconds from now; absent: never.
    subroutine set(self, seconds)
        class(pause_type), intent(inout) :: self
        real(wp), intent(in), optional :: seconds
        integer(int64) :: now, rate

        self%at = huge(self%at)
        self%has_worked = .false.
        if (.not. present(seconds)) return
        call system_clock(now, rate)
        self%at = now + int(seconds*real(rate, wp), int64)
    end subroutine set

    pure subroutine note_work(self)
        class(pause_type), intent(inout) :: self

        self%has_worked = .true.
    end subroutine note_work

    logical function is_due(self)
        class(pause_type), intent(in) :: self
        integer(int64) :: now

        is_due = .false.
        if (self%at == huge(self%at) .or. .not. self%has_worked) return
        call system_clock(now)
        is_due = now >= self%at
    end function is_due
end module linkdyn_pause
