!> One step of damped least squares, by the normal equations and their Cholesky factors.
!>
!> Constraint rows touch two bodies each, so most of the matrix is zero; with the bodies in the order of a chain, of its factors,
!> too.
!>
!> **Source**: G. H. Golub, C. F. Van Loan, *Matrix Computations*, 4th ed. (2013), sections 4.2 and 5.3.
module linkdyn_damped_step
    use linkdyn_kinds, only: wp
    implicit none (type, external)
    private
    public :: find_damped_step

contains

    !> The x that makes |Jᵀ x + f|² + damping |x|² least.
    pure subroutine find_damped_step(j, f, damping, x, is_found)
        real(wp), intent(in) :: j(:, :)                 !! (unknowns, rows)
        real(wp), intent(in) :: f(:)                    !! (rows)
        real(wp), intent(in) :: damping                 !! above zero
        real(wp), intent(out) :: x(:)                   !! (unknowns)
        logical, intent(out) :: is_found                !! false: what is below rounding has more weight than the damping
        real(wp), allocatable :: normal(:, :)           ! its lower triangle, then the factor
        integer :: n, i, k, row

        n = size(j, 1)
        allocate (normal(n, n), source=0.0_wp)
        do row = 1, size(j, 2)
            do k = 1, n
                if (.not. abs(j(k, row)) > 0) cycle
                normal(k:, k) = normal(k:, k) + j(k, row)*j(k:, row)
            end do
        end do
        do k = 1, n
            normal(k, k) = normal(k, k) + damping
        end do
        x = -matmul(j, f)
        is_found = .false.
        do k = 1, n
            if (.not. normal(k, k) > 0) return
            normal(k:, k) = normal(k:, k)/sqrt(normal(k, k))
            do i = k + 1, n
                if (abs(normal(i, k)) > 0) normal(i:, i) = normal(i:, i) - normal(i, k)*normal(i:, k)
            end do
        end do
        do k = 1, n
            x(k) = x(k)/normal(k, k)
            x(k + 1:) = x(k + 1:) - x(k)*normal(k + 1:, k)
        end do
        do k = n, 1, -1
            x(k) = (x(k) - dot_product(normal(k + 1:, k), x(k + 1:)))/normal(k, k)
        end do
        is_found = .true.
    end subroutine find_damped_step
end module linkdyn_damped_step
