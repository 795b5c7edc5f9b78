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
    !> **Cost**: n^3 + O(n^2) multiply-subtracts a lane.
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
        real(wp) :: largest(lanes), reached(lanes), size_here(lanes), factor(lanes), pivot(lanes)
        integer :: row(lanes), k, i, j, lane, last

        largest = 0
        do j = 1, n
            do i = 1, n
                largest = max(largest, abs(a(:, i, j)))
            end do
        end do
        reached = largest
        is_singular = .false.
        if (present(determinant)) determinant = 1

        do k = 1, n
            row = k
            size_here = abs(a(:, k, k))
            last = n
            if (present(pivoting)) last = merge(n, k, pivoting)
            do i = k + 1, last
                where (abs(a(:, i, k)) > size_here)
                    size_here = abs(a(:, i, k))
                    row = i
                end where
            end do
            reached = max(reached, size_here)
            ! A NaN pivot is refused as well: the comparison is false for it.
            is_singular = is_singular .or. .not. size_here > 0
            do lane = 1, lanes
                if (row(lane) == k) cycle
                call swap(a(lane, k, k:n), a(lane, row(lane), k:n))
                call swap(b(lane, k, :), b(lane, row(lane), :))
            end do
            if (present(determinant)) determinant = determinant*merge(a(:, k, k), -a(:, k, k), row == k)
            pivot = merge(1.0_wp, a(:, k, k), is_singular)
            factor = 1/pivot
            do j = k + 1, n
                reached = max(reached, abs(a(:, k, j)))
                a(:, k, j) = factor*a(:, k, j)
            end do
            do j = 1, n_rhs
                b(:, k, j) = factor*b(:, k, j)
            end do
            ! Jordan: clear the column above the diagonal as well as below it.
            do j = k + 1, n
                call clear(n, k, a(:, :, k), a(:, :, j))
            end do
            do j = 1, n_rhs
                call clear(n, k, a(:, :, k), b(:, :, j))
            end do
        end do

        if (present(determinant)) where (is_singular) determinant = 0
        growth = merge(0.0_wp, largest/max(reached, tiny(1.0_wp)), is_singular)
        do j = 1, n_rhs
            do i = 1, n
                where (is_singular) b(:, i, j) = not_a_number()
            end do
        end do
    end subroutine solve_gauss_jordan

    !> Subtract the multiples of row k that clear the pivot column.
    pure subroutine clear(n, k, pivot_column, column)
        integer, intent(in) :: n, k
        real(wp), intent(in) :: pivot_column(lanes, n)
        real(wp), intent(inout) :: column(lanes, n)
        real(wp) :: head(lanes)
        integer :: i

        head = column(:, k)
        do i = 1, k - 1
            column(:, i) = column(:, i) - pivot_column(:, i)*head
        end do
        do i = k + 1, n
            column(:, i) = column(:, i) - pivot_column(:, i)*head
        end do
    end subroutine clear

    pure subroutine swap(a, b)
        real(wp), intent(inout) :: a(:), b(:)
        real(wp) :: kept(size(a))

        kept = a
        a = b
        b = kept
    end subroutine swap

    pure real(wp) function not_a_number()
        use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan

        not_a_number = ieee_value(1.0_wp, ieee_quiet_nan)
    end function not_a_number
end module linkdyn_gauss_jordan
