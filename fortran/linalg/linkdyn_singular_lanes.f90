!> What lanes get that no elimination could solve.
module linkdyn_singular_lanes
    use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    implicit none (type, external)
    private
    public :: void_singular

contains

    !> Leave no number in the solutions of singular lanes; others stay. Called where there is one alone: what uses `ieee_arithmetic`
    !> keeps the processor's state on its way in and out, which takes as long as a hundred operations.
    pure subroutine void_singular(n, n_rhs, is_singular, x)
        integer, intent(in) :: n, n_rhs
        logical, intent(in) :: is_singular(lanes)
        real(wp), intent(inout) :: x(lanes, n, n_rhs)
        integer :: i, j

        do j = 1, n_rhs
            do i = 1, n
                where (is_singular) x(:, i, j) = ieee_value(1.0_wp, ieee_quiet_nan)
            end do
        end do
    end subroutine void_singular
end module linkdyn_singular_lanes
