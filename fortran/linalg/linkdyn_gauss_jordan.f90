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
    !> nothing to clear: of the 42 unknowns of a platform's six legs closed together a tenth is left.
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
        integer :: row(lanes), cleared(n), k, i, j, last, n_cleared

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
            do j = k, n
                call exchange(n, k, row, a(:, :, j))
            end do
            do j = 1, n_rhs
                call exchange(n, k, row, b(:, :, j))
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
            n_cleared = 0
            do i = 1, n
                if (i == k .or. count(a(:, i, k) /= 0) == 0) cycle
                n_cleared = n_cleared + 1
                cleared(n_cleared) = i
            end do
            do j = k + 1, n
                if (count(a(:, k, j) /= 0) > 0) call clear(n, k, cleared(:n_cleared), a(:, :, k), a(:, :, j))
            end do
            do j = 1, n_rhs
                call clear(n, k, cleared(:n_cleared), a(:, :, k), b(:, :, j))
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

    !> Subtract the multiples of row k that clear the pivot column in these rows.
    pure subroutine clear(n, k, rows, pivot_column, column)
        integer, intent(in) :: n, k
        integer, intent(in) :: rows(:)
        real(wp), intent(in) :: pivot_column(lanes, n)
        real(wp), intent(inout) :: column(lanes, n)
        real(wp) :: head(lanes)
        integer :: i

        head = column(:, k)
        do i = 1, size(rows)
            column(:, rows(i)) = column(:, rows(i)) - pivot_column(:, rows(i))*head
        end do
    end subroutine clear

    !> Exchange row k with each lane's own row; mostly that is the same one.
    pure subroutine exchange(n, k, row, column)
        integer, intent(in) :: n, k
        integer, intent(in) :: row(lanes)
        real(wp), intent(inout) :: column(lanes, n)
        real(wp) :: kept(lanes)
        integer :: lane

        kept = column(:, k)
        if (all(row == row(1))) then
            column(:, k) = column(:, row(1))
            column(:, row(1)) = kept
        else
            do lane = 1, lanes
                column(lane, k) = column(lane, row(lane))
                column(lane, row(lane)) = kept(lane)
            end do
        end if
    end subroutine exchange

    pure real(wp) function not_a_number()
        use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan

        not_a_number = ieee_value(1.0_wp, ieee_quiet_nan)
    end function not_a_number
end module linkdyn_gauss_jordan
