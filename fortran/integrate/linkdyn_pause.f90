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
        ! ---- the clock takes as long as a part of a small step: where such are many it is not looked at before each of them
        integer(int64), private :: looked = 0             !! count when it was looked at last
        integer(int64), private :: little = 0             !! counts that are a small part of the time to the pause
        integer, private :: n_between = 0                 !! questions that are answered without it
        integer, private :: n_left = 0                    !! of these, until the next look
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
        real(wp), parameter :: small_part = 1.0e-3_wp
        integer(int64) :: now, rate

        self%n_between = 0
        self%n_left = 0
        self%at = huge(self%at)
        self%has_worked = .false.
        if (.not. present(seconds)) return
        call system_clock(now, rate)
        self%at = now + int(seconds*real(rate, wp), int64)
        self%little = int(small_part*seconds*real(rate, wp), int64)
        self%looked = now
    end subroutine set

    pure subroutine note_work(self)
        class(pause_type), intent(inout) :: self

        self%has_worked = .true.
    end subroutine note_work

    logical function is_due(self)
        class(pause_type), intent(inout) :: self
        integer, parameter :: most = 15
        integer(int64) :: now

        is_due = .false.
        if (self%at == huge(self%at) .or. .not. self%has_worked) return
        self%n_left = self%n_left - 1
        if (self%n_left >= 0) return
        call system_clock(now)
        is_due = now >= self%at
        self%n_between = merge(min(2*self%n_between + 1, most), 0, now - self%looked < self%little)
        self%n_left = self%n_between
        self%looked = now
    end function is_due
end module linkdyn_pause
