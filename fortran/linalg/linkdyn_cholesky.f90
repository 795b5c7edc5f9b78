!> Symmetric positive definite systems on lanes: L D L^T without pivoting.
module linkdyn_cholesky
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    implicit none (type, external)
    private
    public :: solve_cholesky

contains

    !> Solve matrix x = right; the upper triangle is read, the factors are left in it.
    !>
    !> **Errors**: a lane whose matrix is not positive definite to rounding is flagged.
    pure subroutine solve_cholesky(n, matrix, right, is_singular)
        integer, intent(in) :: n
        real(wp), intent(inout) :: matrix(lanes, n, n)
        real(wp), intent(inout) :: right(lanes, n)        !! in: right-hand side; out: solution
        logical, intent(out) :: is_singular(lanes)
        real(wp) :: inverse(lanes, n), smallest(lanes, n), factor(lanes)
        integer :: i, j, k

        is_singular = .false.
        do k = 1, n
            smallest(:, k) = n*epsilon(1.0_wp)*matrix(:, k, k)     ! what n roundings may leave of nothing
        end do
        ! Row k becomes row k of D L^T. What is left of the diagonal says how definite the matrix is.
        do k = 1, n
            is_singular = is_singular .or. .not. matrix(:, k, k) > smallest(:, k)
            inverse(:, k) = 1/matrix(:, k, k)
            do j = k + 1, n
                factor = matrix(:, k, j)*inverse(:, k)
                do i = k + 1, j
                    matrix(:, i, j) = matrix(:, i, j) - matrix(:, k, i)*factor
                end do
                right(:, j) = right(:, j) - factor*right(:, k)
            end do
        end do
        do k = n, 1, -1
            do j = k + 1, n
                right(:, k) = right(:, k) - matrix(:, k, j)*right(:, j)
            end do
            right(:, k) = right(:, k)*inverse(:, k)
        end do
    end subroutine solve_cholesky
end module linkdyn_cholesky
