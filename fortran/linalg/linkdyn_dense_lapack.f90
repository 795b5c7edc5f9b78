!> One dense system by LAPACK's expert driver: equilibration, partial pivoting, refinement, error bounds.
!>
!> Twin of linkdyn_dense_builtin.f90, which serves the quadruple build.
module linkdyn_dense
    use linkdyn_kinds, only: wp
    implicit none (type, external)
    private
    public :: dense_workspace, solve_dense, dense_name, hold_blas_threads, release_blas_threads

    character(len=*), parameter :: dense_name = "LAPACK dgesvx"

    !> Room for one system of n unknowns, kept between calls.
    type :: dense_workspace
        integer :: n = 0
        real(wp), allocatable :: factors(:, :), row_scale(:), column_scale(:), x(:, :), work(:)
        integer, allocatable :: pivot(:), iwork(:)
    contains
        procedure :: prepare
    end type dense_workspace

    interface
        subroutine dgesvx(fact, trans, n, nrhs, a, lda, af, ldaf, ipiv, equed, r, c, b, ldb, x, ldx, &
                          rcond, ferr, berr, work, iwork, info)
            import :: wp
            character(len=1), intent(in) :: fact, trans
            integer, intent(in) :: n, nrhs, lda, ldaf, ldb, ldx
            real(wp), intent(inout) :: a(lda, *), af(ldaf, *), r(*), c(*), b(ldb, *)
            integer, intent(inout) :: ipiv(*)
            character(len=1), intent(inout) :: equed
            real(wp), intent(out) :: x(ldx, *), rcond, ferr(*), berr(*), work(*)
            integer, intent(out) :: iwork(*), info
        end subroutine dgesvx

        subroutine linkdyn_hold_blas() bind(c)
        end subroutine linkdyn_hold_blas

        subroutine linkdyn_release_blas() bind(c)
        end subroutine linkdyn_release_blas
    end interface

contains

    !> From now on BLAS computes in the thread that calls it: a team of its own inside each of our threads costs time.
    subroutine hold_blas_threads()
        call linkdyn_hold_blas()
    end subroutine hold_blas_threads

    !> As many BLAS threads as before, once nobody holds them any more.
    subroutine release_blas_threads()
        call linkdyn_release_blas()
    end subroutine release_blas_threads

    !> Make room for n unknowns.
    pure subroutine prepare(self, n)
        class(dense_workspace), intent(inout) :: self
        integer, intent(in) :: n

        if (self%n == n) return
        if (allocated(self%factors)) deallocate (self%factors, self%row_scale, self%column_scale, self%x, &
                                                 self%work, self%pivot, self%iwork)
        allocate (self%factors(n, n), self%row_scale(n), self%column_scale(n), self%x(n, 1), self%work(4*n))
        allocate (self%pivot(n), self%iwork(n))
        self%n = n
    end subroutine prepare

    !> Solve A x = b; A is scaled in place, b is overwritten by x.
    !>
    !> **Errors**: `is_singular` when a pivot is exactly zero or rcond is below epsilon; x is then not to be used.
    !> **Source**: LAPACK Users' Guide, 3rd ed., section 2.3.1.2 and 4.4 (error bounds).
    subroutine solve_dense(workspace, a, b, rcond, error_bound, is_singular)
        type(dense_workspace), intent(inout) :: workspace
        real(wp), intent(inout), contiguous :: a(:, :)    !! (n, n)
        real(wp), intent(inout), contiguous :: b(:)       !! (n)
        real(wp), intent(out) :: rcond                    !! reciprocal condition number of the equilibrated matrix
        real(wp), intent(out) :: error_bound              !! bound on max|x error| / max|x|
        logical, intent(out) :: is_singular
        real(wp) :: forward(1), backward(1), right(size(b), 1)
        character(len=1) :: equed
        integer :: n, info

        n = size(b)
        call workspace%prepare(n)
        right(:, 1) = b
        equed = "N"
        call dgesvx("E", "N", n, 1, a, n, workspace%factors, n, workspace%pivot, equed, workspace%row_scale, &
                    workspace%column_scale, right, n, workspace%x, n, rcond, forward, backward, &
                    workspace%work, workspace%iwork, info)
        is_singular = info /= 0
        error_bound = forward(1)
        b = workspace%x(:, 1)
    end subroutine solve_dense
end module linkdyn_dense
