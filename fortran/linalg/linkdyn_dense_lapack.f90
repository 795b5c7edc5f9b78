!> One dense system by LAPACK's expert driver: equilibration, partial pivoting, refinement, error bounds.
!>
!> Twin of linkdyn_dense_builtin.f90, which serves the quadruple build.
module linkdyn_dense
    use linkdyn_equilibration, only: measure_matrix
    use linkdyn_kinds, only: wp
    implicit none (type, external)
    private
    public :: dense_workspace, solve_dense, solve_scaled, dense_name, hold_blas_threads, release_blas_threads

    character(len=*), parameter :: dense_name = "LAPACK dgesvx"

    !> Room for one system of n unknowns, kept between calls: after `solve_dense` its factors.
    type :: dense_workspace
        integer :: n = 0
        real(wp), allocatable :: factors(:, :), row_scale(:), column_scale(:), x(:, :), work(:)
        real(wp), allocatable :: row_size(:), column_size(:)    !! of the matrix that the factors are of
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

        subroutine dgetrs(trans, n, nrhs, a, lda, ipiv, b, ldb, info)
            import :: wp
            character(len=1), intent(in) :: trans
            integer, intent(in) :: n, nrhs, lda, ldb, ipiv(*)
            real(wp), intent(in) :: a(lda, *)
            real(wp), intent(inout) :: b(ldb, *)
            integer, intent(out) :: info
        end subroutine dgetrs

        subroutine dlacn2(n, v, x, isgn, est, kase, isave)
            import :: wp
            integer, intent(in) :: n
            real(wp), intent(inout) :: v(*), x(*), est
            integer, intent(inout) :: isgn(*), kase, isave(3)
        end subroutine dlacn2

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
                                                 self%work, self%pivot, self%iwork, self%row_size, self%column_size)
        allocate (self%factors(n, n), self%row_scale(n), self%column_scale(n), self%x(n, 1), self%work(4*n))
        allocate (self%pivot(n), self%iwork(n), self%row_size(n), self%column_size(n))
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
        real(wp), intent(out) :: rcond                    !! reciprocal condition number, see `find_rcond`
        real(wp), intent(out) :: error_bound              !! bound on max|x error| / max|x|
        logical, intent(out) :: is_singular
        real(wp) :: norm, forward(1), backward(1), right(size(b), 1)
        character(len=1) :: equed
        integer :: n, info

        n = size(b)
        call workspace%prepare(n)
        right(:, 1) = b
        call measure_matrix(a, workspace%row_size, workspace%column_size, norm)
        equed = "N"
        call dgesvx("E", "N", n, 1, a, n, workspace%factors, n, workspace%pivot, equed, workspace%row_scale, &
                    workspace%column_scale, right, n, workspace%x, n, rcond, forward, backward, &
                    workspace%work, workspace%iwork, info)
        is_singular = info /= 0
        error_bound = forward(1)
        b = workspace%x(:, 1)
        if (any(equed == ["R", "B"])) workspace%row_size = workspace%row_size*workspace%row_scale
        if (any(equed == ["C", "B"])) workspace%column_size = workspace%column_size*workspace%column_scale
        rcond = 0
        if (info == 0 .or. info == n + 1) call find_rcond(workspace, norm, rcond)
    end subroutine solve_dense

    !> Solve once more with the factors of the last `solve_dense`, for the matrix with every row divided by its largest entry, then
    !> every column; or for its transpose.
    subroutine solve_scaled(workspace, is_transposed, x)
        type(dense_workspace), intent(inout) :: workspace
        logical, intent(in) :: is_transposed
        real(wp), intent(inout), contiguous :: x(:)       !! in: right-hand side; out: solution
        integer :: info

        if (is_transposed) then
            x = workspace%column_size*x
        else
            x = workspace%row_size*x
        end if
        call dgetrs(merge("T", "N", is_transposed), workspace%n, 1, workspace%factors, workspace%n, workspace%pivot, x, &
                    workspace%n, info)
        if (is_transposed) then
            x = workspace%row_size*x
        else
            x = workspace%column_size*x
        end if
    end subroutine solve_scaled

    !> Reciprocal condition number in the 1-norm, estimated: of the matrix with every row divided by its largest entry, then
    !> every column. LAPACK itself scales only where it must, so that its own number jumps from one to the other.
    subroutine find_rcond(workspace, norm, rcond)
        type(dense_workspace), intent(inout) :: workspace
        real(wp), intent(in) :: norm                      !! of the scaled matrix
        real(wp), intent(out) :: rcond
        real(wp) :: norm_of_inverse
        integer :: kase, saved(3)

        norm_of_inverse = 0
        kase = 0
        do
            call dlacn2(workspace%n, workspace%work, workspace%x, workspace%iwork, norm_of_inverse, kase, saved)
            if (kase == 0) exit
            call solve_scaled(workspace, kase == 2, workspace%x(:, 1))
        end do
        rcond = 1/(norm*norm_of_inverse)
    end subroutine find_rcond
end module linkdyn_dense
