!> Time as it passes.
module linkdyn_clock
    use, intrinsic :: iso_fortran_env, only: int64
    use linkdyn_kinds, only: wp
    implicit none (type, external)
    private
    public :: seconds_since

contains

    !> What has passed since `system_clock` counted so far [s].
    real(wp) function seconds_since(start)
        integer(int64), intent(in) :: start
        integer(int64) :: now, rate

        call system_clock(now, rate)
        seconds_since = real(now - start, wp)/real(rate, wp)
    end function seconds_since
end module linkdyn_clock
