!> linkdyn_dense: solution, reciprocal condition number, error bound, singular systems.
module test_dense
    use linkdyn_dense, only: dense_workspace, solve_dense
    use linkdyn_kinds, only: wp
    use linkdyn_test_numbers, only: random_stream, eps, condition_number
    use linkdyn_testing, only: test_error, unit_test, new_test, check, check_close
    implicit none (type, external)
    private
    public :: collect_dense

contains

    subroutine collect_dense(tests)
        type(unit_test), allocatable, intent(out) :: tests(:)

        tests = [ &
            new_test("known solution", test_known), &
            new_test("condition number and error bound", test_condition), &
            new_test("badly scaled rows", test_scaling), &
            new_test("singular", test_singular), &
            new_test("one workspace, several sizes", test_sizes)]
    end subroutine collect_dense

    subroutine test_known(error)
        type(test_error), intent(inout) :: error
        integer, parameter :: n = 20
        type(random_stream) :: stream
        type(dense_workspace) :: workspace
        real(wp) :: a(n, n), kept(n, n), b(n), x(n), rcond, bound
        logical :: is_singular

        kept = reshape(stream%vector(n*n), [n, n])
        x = stream%vector(n)
        a = kept
        b = matmul(kept, x)
        call solve_dense(workspace, a, b, rcond, bound, is_singular)
        call check(error, .not. is_singular, "regular")
        call check_close(error, b, x, 100*eps*condition_number(kept), "solution")
    end subroutine test_known

    !> Systems with a given smallest singular value: rcond follows it, and the bound covers the true error.
    subroutine test_condition(error)
        type(test_error), intent(inout) :: error
        integer, parameter :: n = 10
        type(random_stream) :: stream
        type(dense_workspace) :: workspace
        real(wp) :: a(n, n), b(n), x(n), u(n), v(n), smallest, rcond, bound, true_error
        logical :: is_singular
        integer :: k, i, j

        do k = 0, 3
            smallest = eps**(0.2_wp*k)
            u = stream%vector(n)
            v = stream%vector(n)
            u = u/norm2(u)
            v = v/norm2(v)
            ! Two reflections with diag(1, ..., 1, smallest) between them.
            do j = 1, n
                do i = 1, n
                    a(i, j) = entry(i, j)
                end do
            end do
            x = stream%vector(n)
            ! A right-hand side that the machine holds exactly need not belong to x: the error counts from x within
            ! the condition number.
            b = matmul(a, x)
            call solve_dense(workspace, a, b, rcond, bound, is_singular)
            true_error = maxval(abs(b - x))/maxval(abs(x))
            call check(error, .not. is_singular, "regular")
            call check(error, rcond > smallest/(10*n**2), "rcond is not far below the truth")
            call check(error, rcond < smallest*10*n**2 .and. rcond <= 1 + eps, "rcond is not far above the truth")
            call check(error, true_error <= 100*eps/smallest*n, "error within the condition number")
            call check(error, bound >= 0 .and. bound <= 1000*eps/smallest*n, "error bound within the condition number")
        end do

    contains

        pure real(wp) function entry(i, j)
            integer, intent(in) :: i, j
            integer :: m
            real(wp) :: d

            entry = 0
            do m = 1, n
                d = merge(smallest, 1.0_wp, m == n)
                entry = entry + (merge(1, 0, i == m) - 2*u(i)*u(m))*d*(merge(1, 0, m == j) - 2*v(m)*v(j))
            end do
        end function entry
    end subroutine test_condition

    !> Rows in newtons beside rows in giganewtons: equilibration must make nothing of it.
    subroutine test_scaling(error)
        type(test_error), intent(inout) :: error
        integer, parameter :: n = 12
        type(random_stream) :: stream
        type(dense_workspace) :: workspace
        real(wp) :: a(n, n), kept(n, n), b(n), x(n), rcond, bound
        logical :: is_singular
        integer :: i

        kept = reshape(stream%vector(n*n), [n, n])
        x = stream%vector(n)
        a = kept
        b = matmul(kept, x)
        do i = 1, n
            a(i, :) = a(i, :)*2.0_wp**(8*(i - 6))
            b(i) = b(i)*2.0_wp**(8*(i - 6))
        end do
        call solve_dense(workspace, a, b, rcond, bound, is_singular)
        call check(error, .not. is_singular, "regular")
        call check_close(error, b, x, 100*eps*condition_number(kept), "solution")
        call check(error, rcond > 0.001_wp/condition_number(kept), "rcond is that of the equilibrated matrix")
    end subroutine test_scaling

    subroutine test_singular(error)
        type(test_error), intent(inout) :: error
        integer, parameter :: n = 6
        type(random_stream) :: stream
        type(dense_workspace) :: workspace
        real(wp) :: a(n, n), b(n), rcond, bound
        logical :: is_singular

        a = reshape(stream%vector(n*n), [n, n])
        a(:, 4) = 0
        b = 1
        call solve_dense(workspace, a, b, rcond, bound, is_singular)
        call check(error, is_singular, "zero column")
        call check(error, rcond <= 0, "zero column: rcond")

        ! Whole numbers: the elimination is exact until the pivots are gone.
        a = 1
        b = 1
        call solve_dense(workspace, a, b, rcond, bound, is_singular)
        call check(error, is_singular, "equal rows")
    end subroutine test_singular

    subroutine test_sizes(error)
        type(test_error), intent(inout) :: error
        type(random_stream) :: stream
        type(dense_workspace) :: workspace
        real(wp), allocatable :: a(:, :), kept(:, :), b(:), x(:)
        real(wp) :: rcond, bound
        logical :: is_singular
        integer, parameter :: sizes(4) = [3, 9, 1, 9]
        integer :: i, n

        do i = 1, size(sizes)
            n = sizes(i)
            kept = reshape(stream%vector(n*n), [n, n])
            x = stream%vector(n)
            a = kept
            b = matmul(kept, x)
            call solve_dense(workspace, a, b, rcond, bound, is_singular)
            call check_close(error, b, x, 100*eps*condition_number(kept), "solution")
        end do
    end subroutine test_sizes
end module test_dense
