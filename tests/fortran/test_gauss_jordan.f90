!> linkdyn_gauss_jordan: every lane its own system, pivots and failure.
module test_gauss_jordan
    use, intrinsic :: ieee_arithmetic, only: ieee_is_nan
    use linkdyn_gauss_jordan, only: solve_gauss_jordan
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_test_numbers, only: random_stream, eps, condition_number, dense_solution
    use linkdyn_testing, only: test_error, unit_test, new_test, check, check_close
    implicit none (type, external)
    private
    public :: collect_gauss_jordan

contains

    subroutine collect_gauss_jordan(tests)
        type(unit_test), allocatable, intent(out) :: tests(:)

        tests = [ &
            new_test("random systems", test_random), &
            new_test("zero diagonal", test_zero_diagonal), &
            new_test("several right-hand sides", test_inverse), &
            new_test("a singular lane among others", test_singular_lane), &
            new_test("a lane that is not a number", test_nan_lane), &
            new_test("pivot growth", test_growth)]
    end subroutine collect_gauss_jordan

    subroutine test_random(error)
        type(test_error), intent(inout) :: error
        type(random_stream) :: stream
        real(wp), allocatable :: a(:, :, :), b(:, :, :)
        integer :: n

        do n = 1, 21, 5
            allocate (a(lanes, n, n), b(lanes, n, 1))
            a = reshape(stream%vector(size(a)), shape(a))
            b = reshape(stream%vector(size(b)), shape(b))
            call compare(error, n, a, b, "random")
            deallocate (a, b)
        end do
    end subroutine test_random

    !> Without an exchange of rows the first pivot would be zero on every lane, or tiny on one; and is, if none is allowed.
    subroutine test_zero_diagonal(error)
        type(test_error), intent(inout) :: error
        integer, parameter :: n = 6
        type(random_stream) :: stream
        real(wp) :: a(lanes, n, n), b(lanes, n, 1), growth(lanes)
        logical :: is_singular(lanes)
        integer :: k

        a = reshape(stream%vector(size(a)), shape(a))
        b = reshape(stream%vector(size(b)), shape(b))
        do k = 1, n
            a(:, k, k) = 0
        end do
        a(lanes, 1, 1) = eps
        call compare(error, n, a, b, "zero diagonal")
        call solve_gauss_jordan(n, 1, a, b, growth, is_singular, pivoting=.false.)
        call check(error, all(is_singular(:lanes - 1)) .and. all(ieee_is_nan(b(:lanes - 1, :, :))), "flagged without pivoting")
        call check(error, .not. is_singular(lanes) .and. growth(lanes) < 1.0e6_wp*eps, "a tiny pivot shows in the growth")
    end subroutine test_zero_diagonal

    !> Every lane against the dense solver; also: the flags and the growth of a regular system.
    subroutine compare(error, n, a, b, what)
        type(test_error), intent(inout) :: error
        integer, intent(in) :: n
        real(wp), intent(in) :: a(:, :, :), b(:, :, :)
        character(len=*), intent(in) :: what
        real(wp) :: work(lanes, n, n), x(lanes, n, 1), growth(lanes), want(n)
        logical :: is_singular(lanes)
        integer :: l

        work = a
        x = b
        call solve_gauss_jordan(n, 1, work, x, growth, is_singular)
        call check(error, .not. any(is_singular), what//": not singular")
        call check(error, all(growth > 0) .and. all(growth <= 1 + eps), what//": growth between 0 and 1")
        do l = 1, lanes
            want = dense_solution(a(l, :, :), b(l, :, 1))
            call check_close(error, x(l, :, 1), want, 100*eps*condition_number(a(l, :, :))*maxval(abs(want)), what)
        end do
    end subroutine compare

    subroutine test_inverse(error)
        type(test_error), intent(inout) :: error
        integer, parameter :: n = 7
        type(random_stream) :: stream
        real(wp) :: a(lanes, n, n), work(lanes, n, n), x(lanes, n, n), growth(lanes), product(n, n)
        logical :: is_singular(lanes)
        integer :: l, k

        a = reshape(stream%vector(size(a)), shape(a))
        x = 0
        do k = 1, n
            x(:, k, k) = 1
        end do
        work = a
        call solve_gauss_jordan(n, n, work, x, growth, is_singular)
        do l = 1, lanes
            product = matmul(a(l, :, :), x(l, :, :))
            do k = 1, n
                product(k, k) = product(k, k) - 1
            end do
            call check(error, maxval(abs(product)) <= 100*eps*condition_number(a(l, :, :)), "A A^-1 = 1")
        end do
    end subroutine test_inverse

    subroutine test_singular_lane(error)
        type(test_error), intent(inout) :: error
        integer, parameter :: n = 8
        type(random_stream) :: stream
        real(wp) :: a(lanes, n, n), b(lanes, n, 1)
        integer :: bad

        bad = max(1, lanes - 1)
        a = reshape(stream%vector(size(a)), shape(a))
        b = reshape(stream%vector(size(b)), shape(b))
        call refuse_lane(error, n, a, b, bad, 0.0_wp, "zero column")
    end subroutine test_singular_lane

    subroutine test_nan_lane(error)
        use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan
        type(test_error), intent(inout) :: error
        integer, parameter :: n = 5
        type(random_stream) :: stream
        real(wp) :: a(lanes, n, n), b(lanes, n, 1)

        a = reshape(stream%vector(size(a)), shape(a))
        b = reshape(stream%vector(size(b)), shape(b))
        call refuse_lane(error, n, a, b, lanes, ieee_value(1.0_wp, ieee_quiet_nan), "NaN column")
    end subroutine test_nan_lane

    !> Spoil column 3 of one lane: it alone is flagged, and the others keep every bit.
    subroutine refuse_lane(error, n, a, b, bad, value, what)
        type(test_error), intent(inout) :: error
        integer, intent(in) :: n, bad
        real(wp), intent(in) :: a(:, :, :), b(:, :, :), value
        character(len=*), intent(in) :: what
        real(wp) :: work(lanes, n, n), good(lanes, n, 1), x(lanes, n, 1), growth(lanes)
        logical :: is_singular(lanes)
        integer :: l

        work = a
        good = b
        call solve_gauss_jordan(n, 1, work, good, growth, is_singular)
        work = a
        work(bad, :, 3) = value
        x = b
        call solve_gauss_jordan(n, 1, work, x, growth, is_singular)
        call check(error, is_singular(bad), what//": flagged")
        call check(error, count(is_singular) == 1, what//": the others are not")
        call check(error, all(ieee_is_nan(x(bad, :, 1))), what//": no numbers")
        call check(error, growth(bad) <= 0, what//": growth is zero")
        do l = 1, lanes
            if (l /= bad) call check_close(error, x(l, :, 1), good(l, :, 1), 0.0_wp, what//": neighbours untouched")
        end do
    end subroutine refuse_lane

    !> An orthogonal matrix does not let elements grow; Wilkinson's lets them double with every column.
    subroutine test_growth(error)
        type(test_error), intent(inout) :: error
        integer, parameter :: n = 24
        type(random_stream) :: stream
        real(wp) :: a(lanes, n, n), b(lanes, n, 1), growth(lanes), v(n)
        logical :: is_singular(lanes)
        integer :: l, i, j

        do l = 1, lanes
            v = stream%vector(n)
            v = v/norm2(v)
            do j = 1, n
                a(l, :, j) = -2*v*v(j)
                a(l, j, j) = a(l, j, j) + 1
            end do
        end do
        b = reshape(stream%vector(size(b)), shape(b))
        call solve_gauss_jordan(n, 1, a, b, growth, is_singular)
        call check(error, all(growth > 1.0_wp/n), "a reflection grows little")

        a = 0
        do i = 1, n
            a(:, i, :i - 1) = -1
            a(:, i, i) = 1
            a(:, i, n) = 1
        end do
        b = 1
        call solve_gauss_jordan(n, 1, a, b, growth, is_singular)
        call check_close(error, growth, spread(2.0_wp**(1 - n), 1, lanes), eps, "Wilkinson's matrix: 2^(n-1)")
    end subroutine test_growth
end module test_gauss_jordan
