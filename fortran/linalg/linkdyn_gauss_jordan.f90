!> The lecture's solver: Gauss-Jordan elimination with partial pivoting, on lanes. Without pivoting it is there for comparison.
!>
!> Every lane picks its own pivots; rows are not moved but remembered, so that the arithmetic stays
!> one stream of vector operations. The reciprocal pivot growth says how much the elements grew on the way:
!> near 1 is good, near 0 means that digits were lost.
module linkdyn_gauss_jordan
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    implicit none (type, external)
    private
    public :: solve_gauss_jordan

contains

    !> Solve A x = b on every lane; A and b are destroyed, x is left in b.
    !>
    !> **Cost**: at most n^3 + O(n^2) multiply-subtracts a lane. What is zero on every lane, in the pivot's column or its row, has
    !> nothing to clear: of the 42 unknowns of a platform's six legs closed together a tenth is left. Lanes that all have the same,
    !> as those of a run on its own, are solved once.
    !> **Errors**: a lane whose pivot column is all zero is flagged, its x is NaN; the others are untouched. Without pivoting it is
    !> flagged when a pivot is zero.
    subroutine solve_gauss_jordan(n, n_rhs, a, b, growth, is_singular, determinant, pivoting)
        integer, intent(in) :: n                              !! unknowns
        integer, intent(in) :: n_rhs                          !! right-hand sides
        real(wp), intent(inout) :: a(lanes, n, n)             !! (lane, row, column)
        real(wp), intent(inout) :: b(lanes, n, n_rhs)         !! in: right-hand sides; out: solutions
        real(wp), intent(out) :: growth(lanes)                !! reciprocal pivot growth: max|a| before / max|pivot row| on the way
        logical, intent(out) :: is_singular(lanes)            !! no pivot was left
        real(wp), intent(out), optional :: determinant(lanes) !! with its sign; 0 where singular
        logical, intent(in), optional :: pivoting             !! absent: true
        real(wp) :: own(1, n, n), solution(1, n, n_rhs), det(lanes)
        logical :: pivots
        integer :: j

        pivots = .true.
        if (present(pivoting)) pivots = pivoting
        if (is_same_on_all(a) .and. is_same_on_all(b)) then
            own = a(:1, :, :)
            solution = b(:1, :, :)
            call eliminate_once(n, n_rhs, pivots, own, solution, growth(:1), is_singular(:1), det(:1))
            do j = 1, n_rhs
                b(:, :, j) = spread(solution(1, :, j), 1, lanes)
            end do
            growth(2:) = growth(1)
            is_singular(2:) = is_singular(1)
            det(2:) = det(1)
        else
            call eliminate_on_lanes(n, n_rhs, pivots, a, b, growth, is_singular, det)
        end if
        if (present(determinant)) determinant = det
    end subroutine solve_gauss_jordan

    pure logical function is_same_on_all(x)
        real(wp), intent(in) :: x(:, :, :)                    !! (lane, any, any)
        integer :: i, j

        is_same_on_all = .false.
        do j = 1, size(x, 3)
            do i = 1, size(x, 2)
                if (.not. all(x(2:, i, j) == x(1, i, j))) return
            end do
        end do
        is_same_on_all = .true.
    end function is_same_on_all

    subroutine eliminate_on_lanes(n, n_rhs, pivots, a, b, growth, is_singular, determinant)
        integer, parameter :: m = lanes
        include "gauss_jordan_on_lanes.inc"
    end subroutine eliminate_on_lanes

    subroutine eliminate_once(n, n_rhs, pivots, a, b, growth, is_singular, determinant)
        integer, parameter :: m = 1
        include "gauss_jordan_on_lanes.inc"
    end subroutine eliminate_once

    pure real(wp) function not_a_number()
        use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan

        not_a_number = ieee_value(1.0_wp, ieee_quiet_nan)
    end function not_a_number
end module linkdyn_gauss_jordan
