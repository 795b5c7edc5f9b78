!> Numbers that somebody has written down: with seven digits they are those that they stand for.
module linkdyn_written_numbers
    use linkdyn_kinds, only: wp
    use linkdyn_whole_turns, only: least_angle
    implicit none (type, external)
    private
    public :: is_at

    real(wp), parameter :: fit = 1.0e-6_wp     !! seven digits; of numbers below one so many places

contains

    !> Is a coordinate, a joint variable or a rate where it was to be?
    elemental logical function is_at(wanted, found, is_exact)
        real(wp), intent(in) :: wanted, found
        logical, intent(in) :: is_exact        !! whole turns count
        real(wp) :: apart

        apart = abs(wanted - found)
        if (.not. is_exact) apart = abs(least_angle(apart))
        is_at = apart <= fit*max(1.0_wp, abs(wanted))
    end function is_at
end module linkdyn_written_numbers
