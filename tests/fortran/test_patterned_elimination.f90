!> linkdyn_patterned_elimination: sparse systems whose lanes choose pivots of their own, against dense solvers.
module test_patterned_elimination
    use, intrinsic :: ieee_arithmetic, only: ieee_is_nan, ieee_value, ieee_quiet_nan
    use linkdyn_elimination_pattern, only: elimination_pattern, find_pattern
    use linkdyn_gauss_jordan, only: solve_gauss_jordan
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_patterned_elimination, only: eliminate_by_pattern
    use linkdyn_test_numbers, only: random_stream, eps, condition_number, dense_solution
    use linkdyn_testing, only: test_error, unit_test, new_test, check, check_close
    implicit none (type, external)
    private
    public :: collect_patterned_elimination

    !> A matrix with few entries, and right-hand sides.
    type :: sparse_case
        integer :: n = 0
        integer, allocatable :: row(:), column(:)          !! (entry)
        real(wp), allocatable :: entry(:, :)               !! (lane, entry)
        real(wp), allocatable :: right(:, :, :)            !! (lane, row, right-hand side)
    end type sparse_case

contains

    subroutine collect_patterned_elimination(tests)
        type(unit_test), allocatable, intent(out) :: tests(:)

        tests = [ &
            new_test("sparse systems", test_sparse), &
            new_test("lanes that have the same", test_same), &
            new_test("a chain takes few slots", test_chain), &
            new_test("spoilt lanes among others", test_spoilt), &
            new_test("a matrix without a pivot", test_no_pivot)]
    end subroutine collect_patterned_elimination

    !> Three entries a row, one of them on a permuted diagonal: mostly regular, with pivots off the diagonal.
    function random_case(stream, n) result(sparse)
        type(random_stream), intent(inout) :: stream
        integer, intent(in) :: n
        type(sparse_case) :: sparse
        real(wp) :: pick(n, 2)
        integer :: i

        sparse%n = n
        pick = reshape(stream%vector(2*n), [n, 2])
        sparse%row = [([i, i, i], i=1, n)]
        sparse%column = [([1 + modulo(3*i, n), place(pick(i, 1)), place(pick(i, 2))], i=1, n)]
        sparse%entry = reshape(stream%vector(lanes*3*n), [lanes, 3*n])
        sparse%right = reshape(stream%vector(lanes*n*3), [lanes, n, 3])

    contains

        pure integer function place(x)
            real(wp), intent(in) :: x                      ! -1 to 1

            place = min(n, 1 + int(n*abs(x)))
        end function place
    end function random_case

    !> As a full matrix; of entries at one place the last counts.
    pure function full_matrix(sparse) result(a)
        type(sparse_case), intent(in) :: sparse
        real(wp) :: a(lanes, sparse%n, sparse%n)
        integer :: k

        a = 0
        do k = 1, size(sparse%row)
            a(:, sparse%row(k), sparse%column(k)) = sparse%entry(:, k)
        end do
    end function full_matrix

    subroutine solve(sparse, x, is_singular, determinant)
        type(sparse_case), intent(in) :: sparse
        real(wp), allocatable, intent(out) :: x(:, :, :)
        logical, intent(out) :: is_singular(lanes)
        real(wp), intent(out) :: determinant(lanes)
        type(elimination_pattern) :: pattern
        real(wp), allocatable :: a(:, :)
        integer :: k

        call find_pattern(sparse%n, sparse%row, sparse%column, pattern)
        allocate (a(lanes, pattern%n_slot), source=0.0_wp)
        do k = 1, size(sparse%row)
            a(:, pattern%slot(sparse%column(k), sparse%row(k))) = sparse%entry(:, k)
        end do
        x = sparse%right
        call eliminate_by_pattern(pattern, size(x, 3), a, x, is_singular, determinant)
    end subroutine solve

    !> Solutions by the dense solver, determinants by Gauss and Jordan's.
    subroutine compare(error, sparse, what)
        type(test_error), intent(inout) :: error
        type(sparse_case), intent(in) :: sparse
        character(len=*), intent(in) :: what
        real(wp), allocatable :: x(:, :, :)
        real(wp) :: full(lanes, sparse%n, sparse%n), work(lanes, sparse%n, sparse%n), right(lanes, sparse%n, 3)
        real(wp), dimension(lanes) :: determinant, other, growth
        real(wp) :: want(sparse%n), condition
        logical :: is_singular(lanes)
        integer :: l, j

        full = full_matrix(sparse)
        call solve(sparse, x, is_singular, determinant)
        work = full
        right = sparse%right
        call solve_gauss_jordan(sparse%n, 3, work, right, growth, is_singular, other)
        call solve(sparse, x, is_singular, determinant)
        do l = 1, lanes
            condition = condition_number(full(l, :, :))
            if (condition > 1.0e8_wp) cycle
            call check(error, .not. is_singular(l), what//": not singular")
            call check_close(error, determinant(l:l), other(l:l), 100*eps*condition*abs(other(l)), what//": determinant")
            do j = 1, 3
                want = dense_solution(full(l, :, :), sparse%right(l, :, j))
                call check_close(error, x(l, :, j), want, 100*eps*condition*maxval(abs(want)), what)
            end do
        end do
    end subroutine compare

    subroutine test_sparse(error)
        type(test_error), intent(inout) :: error
        type(random_stream) :: stream
        integer :: n

        do n = 2, 40, 2
            call compare(error, random_case(stream, n), "sparse")
        end do
    end subroutine test_sparse

    !> They are solved once: the bits are those that each has among others.
    subroutine test_same(error)
        type(test_error), intent(inout) :: error
        type(random_stream) :: stream
        type(sparse_case) :: sparse, same
        real(wp), allocatable :: x(:, :, :), y(:, :, :)
        real(wp) :: determinant(lanes), of_same(lanes)
        logical :: is_singular(lanes)
        integer :: l

        sparse = random_case(stream, 14)
        call solve(sparse, x, is_singular, determinant)
        do l = 1, lanes
            same = sparse
            same%entry = spread(sparse%entry(l, :), 1, lanes)
            same%right = spread(sparse%right(l, :, :), 1, lanes)
            call solve(same, y, is_singular, of_same)
            call check(error, all(y(1, :, :) == x(l, :, :) .or. ieee_is_nan(x(l, :, :))), "the same solutions")
            call check(error, of_same(1) == determinant(l), "the same determinant")
        end do
    end subroutine test_same

    !> Of a matrix with two diagonals beside its own, whose pivots may come from the row below, each row gets two more entries.
    subroutine test_chain(error)
        type(test_error), intent(inout) :: error
        integer, parameter :: n = 60
        type(elimination_pattern) :: pattern
        integer :: i

        call find_pattern(n, [([i, i, i], i=2, n - 1), 1, 1, n, n], [([i - 1, i, i + 1], i=2, n - 1), 1, 2, n - 1, n], pattern)
        call check(error, pattern%n_slot <= 5*n, "a tridiagonal matrix stays narrow")
        call check(error, size(pattern%below) == n - 1, "one other row for each pivot")
    end subroutine test_chain

    !> One lane has a column of zeros, or of what is no number: it alone is flagged, and the others keep every bit.
    subroutine test_spoilt(error)
        type(test_error), intent(inout) :: error
        type(random_stream) :: stream
        type(sparse_case) :: sparse, spoilt
        real(wp), allocatable :: x(:, :, :), y(:, :, :)
        real(wp) :: determinant(lanes), value(2)
        logical :: was_singular(lanes), is_singular(lanes)
        integer :: l, k, bad

        value = [0.0_wp, ieee_value(1.0_wp, ieee_quiet_nan)]
        bad = max(1, lanes - 1)
        sparse = random_case(stream, 16)
        call solve(sparse, x, was_singular, determinant)
        do k = 1, size(value)
            spoilt = sparse
            where (spoilt%column == 5) spoilt%entry(bad, :) = value(k)
            call solve(spoilt, y, is_singular, determinant)
            call check(error, is_singular(bad), "flagged")
            call check(error, all(ieee_is_nan(y(bad, :, :))), "no numbers")
            call check_close(error, determinant(bad:bad), [0.0_wp], 0.0_wp, "no determinant")
            do l = 1, lanes
                if (l == bad .or. was_singular(l)) cycle
                call check(error, .not. is_singular(l), "the others are not flagged")
                call check(error, all(y(l, :, :) == x(l, :, :)), "the others keep their bits")
            end do
        end do
    end subroutine test_spoilt

    !> Two rows have an entry in one column alone: no lane is solved.
    subroutine test_no_pivot(error)
        type(test_error), intent(inout) :: error
        type(sparse_case) :: sparse
        real(wp), allocatable :: x(:, :, :)
        real(wp) :: determinant(lanes)
        logical :: is_singular(lanes)

        sparse%n = 3
        sparse%row = [1, 2, 3, 3]
        sparse%column = [1, 1, 2, 3]
        allocate (sparse%entry(lanes, 4), sparse%right(lanes, 3, 1), source=2.0_wp)
        call solve(sparse, x, is_singular, determinant)
        call check(error, all(is_singular) .and. all(ieee_is_nan(x)), "flagged on every lane")
    end subroutine test_no_pivot
end module test_patterned_elimination
