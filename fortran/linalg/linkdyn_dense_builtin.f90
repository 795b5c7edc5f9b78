!> One dense system by own elimination with row scaling, partial pivoting and one refinement step.
!>
!> Twin of linkdyn_dense_lapack.f90 for builds whose kind LAPACK does not serve (quadruple precision).
module linkdyn_dense
    use linkdyn_equilibration, only: measure_matrix
    use linkdyn_kinds, only: wp
    implicit none (type, external)
    private
    public :: dense_workspace, solve_dense, solve_scaled, dense_name, hold_blas_threads, release_blas_threads

    character(len=*), parameter :: dense_name = "built-in elimination"

    !> Room for one system of n unknowns, kept between calls.
    type :: dense_workspace
        integer :: n = 0
        real(wp), allocatable :: factors(:, :), right(:), correction(:), row_size(:), column_size(:)
        integer, allocatable :: pivot(:)
    contains
        procedure :: prepare
    end type dense_workspace

contains

    !> No BLAS here.
    subroutine hold_blas_threads()
    end subroutine hold_blas_threads

    subroutine release_blas_threads()
    end subroutine release_blas_threads

    !> Make room for n unknowns.
    pure subroutine prepare(self, n)
        class(dense_workspace), intent(inout) :: self
        integer, intent(in) :: n

        if (self%n == n) return
        if (allocated(self%factors)) deallocate (self%factors, self%right, self%correction, self%pivot, &
                                                 self%row_size, self%column_size)
        allocate (self%factors(n, n), self%right(n), self%correction(n), self%pivot(n), self%row_size(n), self%column_size(n))
        self%n = n
    end subroutine prepare

    !> Solve A x = b; A and b are scaled in place, b is overwritten by x. Arguments as in the LAPACK twin.
    subroutine solve_dense(workspace, a, b, rcond, error_bound, is_singular)
        type(dense_workspace), intent(inout) :: workspace
        real(wp), intent(inout), contiguous :: a(:, :)    !! (n, n)
        real(wp), intent(inout), contiguous :: b(:)       !! (n)
        real(wp), intent(out) :: rcond                    !! reciprocal condition number, rows and columns scaled
        real(wp), intent(out) :: error_bound              !! size of the last correction over the solution
        logical, intent(out) :: is_singular
        real(wp) :: norm, norm_of_inverse
        integer :: n, i

        n = size(b)
        call workspace%prepare(n)
        call measure_matrix(a, workspace%row_size, workspace%column_size, norm)
        do i = 1, n
            a(i, :) = a(i, :)/workspace%row_size(i)
            b(i) = b(i)/workspace%row_size(i)
        end do
        workspace%factors = a
        call factorize(workspace%factors, workspace%pivot, is_singular)
        rcond = 0
        error_bound = huge(1.0_wp)
        if (is_singular) return
        call find_norm_of_inverse(workspace, norm_of_inverse)
        rcond = 1/(norm*norm_of_inverse)
        workspace%right = b
        call substitute(workspace%factors, workspace%pivot, b)
        workspace%correction = workspace%right - matmul(a, b)
        call substitute(workspace%factors, workspace%pivot, workspace%correction)
        b = b + workspace%correction
        error_bound = maxval(abs(workspace%correction))/max(maxval(abs(b)), tiny(1.0_wp))
    end subroutine solve_dense

    !> Solve once more with the factors of the last `solve_dense`, for the matrix with every row divided by its largest entry, then
    !> every column; or for its transpose.
    pure subroutine solve_scaled(workspace, is_transposed, x)
        type(dense_workspace), intent(inout) :: workspace
        logical, intent(in) :: is_transposed
        real(wp), intent(inout), contiguous :: x(:)

        if (is_transposed) then
            x = workspace%column_size*x
            call substitute_transposed(workspace%factors, workspace%pivot, x)
        else
            call substitute(workspace%factors, workspace%pivot, x)
            x = workspace%column_size*x
        end if
    end subroutine solve_scaled

    !> 1-norm of the inverse of the scaled matrix, column by column.
    pure subroutine find_norm_of_inverse(workspace, norm)
        type(dense_workspace), intent(inout) :: workspace
        real(wp), intent(out) :: norm
        real(wp) :: column(workspace%n)
        integer :: k

        norm = 0
        do k = 1, workspace%n
            column = 0
            column(k) = 1
            call solve_scaled(workspace, .false., column)
            norm = max(norm, sum(abs(column)))
        end do
    end subroutine find_norm_of_inverse

    !> LU by columns with partial pivoting; rows are swapped in place.
    pure subroutine factorize(a, pivot, is_singular)
        real(wp), intent(inout) :: a(:, :)
        integer, intent(out) :: pivot(:)
        logical, intent(out) :: is_singular
        real(wp) :: kept(size(a, 2))
        integer :: k, j, n

        n = size(a, 1)
        is_singular = .true.
        do k = 1, n
            pivot(k) = k - 1 + maxloc(abs(a(k:, k)), dim=1)
            if (.not. abs(a(pivot(k), k)) > 0) return
            kept = a(k, :)
            a(k, :) = a(pivot(k), :)
            a(pivot(k), :) = kept
            a(k + 1:, k) = a(k + 1:, k)/a(k, k)
            do j = k + 1, n
                a(k + 1:, j) = a(k + 1:, j) - a(k + 1:, k)*a(k, j)
            end do
        end do
        is_singular = .false.
    end subroutine factorize

    !> Forward and back substitution.
    pure subroutine substitute(a, pivot, b)
        real(wp), intent(in) :: a(:, :)
        integer, intent(in) :: pivot(:)
        real(wp), intent(inout) :: b(:)
        real(wp) :: kept
        integer :: k, n

        n = size(b)
        ! Whole rows were exchanged, multipliers included: so all exchanges come before the elimination.
        do k = 1, n
            kept = b(pivot(k))
            b(pivot(k)) = b(k)
            b(k) = kept
        end do
        do k = 1, n
            b(k + 1:) = b(k + 1:) - a(k + 1:, k)*b(k)
        end do
        do k = n, 1, -1
            b(k) = b(k)/a(k, k)
            b(:k - 1) = b(:k - 1) - a(:k - 1, k)*b(k)
        end do
    end subroutine substitute

    !> The same with the transpose: columns of the factors are rows, and the exchanges come last, turned round.
    pure subroutine substitute_transposed(a, pivot, b)
        real(wp), intent(in) :: a(:, :)
        integer, intent(in) :: pivot(:)
        real(wp), intent(inout) :: b(:)
        real(wp) :: kept
        integer :: k, n

        n = size(b)
        do k = 1, n
            b(k) = (b(k) - dot_product(a(:k - 1, k), b(:k - 1)))/a(k, k)
        end do
        do k = n, 1, -1
            b(k) = b(k) - dot_product(a(k + 1:, k), b(k + 1:))
        end do
        do k = n, 1, -1
            kept = b(pivot(k))
            b(pivot(k)) = b(k)
            b(k) = kept
        end do
    end subroutine substitute_transposed
end module linkdyn_dense
