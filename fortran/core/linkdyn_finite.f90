!> Are all of many numbers finite?
module linkdyn_finite
    use, intrinsic :: iso_fortran_env, only: int64
    use linkdyn_kinds, only: wp
    implicit none (type, external)
    private
    public :: all_are_finite

contains

    !> True if none of them is infinite or not a number. They are counted, which a compiler does side by side, as it may neither add
    !> them up nor stop at the first.
    pure logical function all_are_finite(n, x)
        integer(int64), intent(in) :: n
        real(wp), intent(in) :: x(*)           !! (n)
        integer(int64) :: n_bad, i

        n_bad = 0
        do i = 1, n
            if (.not. abs(x(i)) <= huge(1.0_wp)) n_bad = n_bad + 1
        end do
        all_are_finite = n_bad == 0
    end function all_are_finite
end module linkdyn_finite
