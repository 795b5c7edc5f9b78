!> Elimination while tracing: against dense solution, with pivots that must be chosen, turned, watched or given up.
module test_elimination
    use, intrinsic :: iso_fortran_env, only: int64
    use linkdyn_dense, only: dense_workspace, solve_dense
    use linkdyn_interpreter, only: interpret
    use linkdyn_kernel, only: kernel_type, compile_kernel, count_of
    use linkdyn_kinds, only: wp
    use linkdyn_least_squares, only: find_least
    use linkdyn_hash, only: counter_uniform
    use linkdyn_null_states, only: null_states, find_null_states
    use linkdyn_record, only: record_type, open_record, close_record, new_input
    use linkdyn_system, only: system_type, unknown, require, solve, solved
    use linkdyn_testing, only: test_error, unit_test, new_test, check, check_close
    use linkdyn_value, only: value, zero, operator(+), operator(-), operator(*), sin, cos, square
    implicit none (type, external)
    private
    public :: collect_elimination

    real(wp), parameter :: eps = epsilon(1.0_wp)

contains

    subroutine collect_elimination(tests)
        type(unit_test), allocatable, intent(out) :: tests(:)

        tests = [new_test("random sparse systems against the dense solver", test_random_systems), &
                 new_test("what is not wanted is not computed", test_wanted), &
                 new_test("constants and ones cost nothing", test_constants), &
                 new_test("a full turn: rows turned into each other", test_full_turn), &
                 new_test("a pivot that fails elsewhere raises the alarm", test_alarm), &
                 new_test("representative samples that are singular are given up", test_singular_samples), &
                 new_test("a system that is singular everywhere is not solved", test_singular_system), &
                 new_test("unknowns of another system stay in the solution", test_foreign_unknowns), &
                 new_test("products of unknowns are noticed", test_not_linear), &
                 new_test("states that equations leave open", test_states), &
                 new_test("equations that follow from others here, not there", test_rest), &
                 new_test("least squares to the last digits", test_least_squares)]
    end subroutine collect_elimination

    real(wp) function number(i, k)
        integer, intent(in) :: i, k

        number = 2*counter_uniform(int(i, int64), 3_int64, int(k, int64)) - 1
    end function number

    subroutine test_random_systems(error)
        type(test_error), intent(inout) :: error
        integer, parameter :: n_sample = 6
        integer :: seed

        do seed = 1, 30
            call compare(seed, 4 + seed, error)
        end do

    contains

        !> A system with a full diagonal and some entries beside it, each entry an input of its own.
        subroutine compare(seed, n, error)
            integer, intent(in) :: seed, n
            type(test_error), intent(inout) :: error
            type(record_type), target :: record
            type(system_type) :: system
            type(value) :: x(n), row(n)
            type(kernel_type) :: kernel
            type(dense_workspace) :: dense
            real(wp), allocatable :: given(:, :)
            real(wp) :: matrix(n, n), right(n), got(n), rcond, bound
            integer :: place(2, 5*n + n), i, j, k, m, s
            logical :: is_singular

            m = 0
            allocate (given(6*n, n_sample))
            call open_record(record, n_sample)
            do i = 1, n
                x(i) = unknown(system)
            end do
            row = zero()
            do i = 1, n
                do k = 1, 4
                    j = i
                    if (k > 1) j = 1 + int(n*counter_uniform(int(seed, int64), int(k, int64), int(i, int64)))
                    if (k > 1 .and. any(place(1, :m) == i .and. place(2, :m) == j)) cycle
                    m = m + 1
                    place(:, m) = [i, j]
                    given(m, :) = [(number(1000*seed + m, s) + merge(2, 0, i == j), s=1, n_sample)]
                    row(i) = row(i) + new_input(given(m, :))*x(j)
                end do
            end do
            do i = 1, n
                given(m + i, :) = [(number(2000*seed + i, s), s=1, n_sample)]
                call require(system, row(i) - new_input(given(m + i, :)))
            end do
            call solve(system)
            call check(error, system%is_solved, "solved")
            if (.not. system%is_solved) return
            call compile_kernel(record, solved(system, x), .true., kernel)
            call close_record(record)
            do s = 1, n_sample
                matrix = 0
                do k = 1, m
                    matrix(place(1, k), place(2, k)) = given(k, s)
                end do
                right = given(m + 1:m + n, s)
                call interpret(kernel, given(:m + n, s), got)
                call dense%prepare(n)
                call solve_dense(dense, matrix, right, rcond, bound, is_singular)
                call check_close(error, got, right, 100*eps*maxval(abs(right))/max(rcond, eps), "elimination against dense")
            end do
        end subroutine compare
    end subroutine test_random_systems

    subroutine test_wanted(error)
        type(test_error), intent(inout) :: error
        type(record_type), target :: record
        type(system_type) :: system
        type(value) :: x(3), a(3), one_wanted(1)
        type(kernel_type) :: kernel
        integer :: i

        call open_record(record, 2)
        do i = 1, 3
            a(i) = new_input([1.0_wp + i, 2.0_wp + i])
            x(i) = unknown(system)
        end do
        call require(system, x(1)*a(1) - a(2))
        call require(system, x(2)*a(3) + x(1) - a(1))
        call require(system, x(3) + x(2)*a(2))
        call solve(system, [.true., .false., .false.])
        one_wanted = solved(system, x(:1))
        call compile_kernel(record, one_wanted, .true., kernel)
        call close_record(record)
        call check(error, count_of(kernel, "") == 2, "a quotient is left")
    end subroutine test_wanted

    subroutine test_constants(error)
        type(test_error), intent(inout) :: error
        type(record_type), target :: record
        type(system_type) :: system
        type(value) :: x(3), b
        type(kernel_type) :: kernel
        integer :: i

        call open_record(record, 2)
        do i = 1, 3
            x(i) = unknown(system)
        end do
        b = new_input([1.0_wp, 2.0_wp])
        call require(system, x(1) + x(2) - b)
        call require(system, x(2) - x(3) - 2.0_wp)
        call require(system, 2.0_wp*x(3) + x(1))
        call solve(system)
        call compile_kernel(record, solved(system, x), .true., kernel)
        call close_record(record)
        call check(error, count_of(kernel, "reciprocal") == 0, "constant pivots are divided by beforehand")
        call check(error, size(system%watched) == 0, "and need not be watched")
    end subroutine test_constants

    !> A crank that turns all the way round: neither sine nor cosine serves as pivot everywhere.
    subroutine test_full_turn(error)
        type(test_error), intent(inout) :: error
        integer, parameter :: n = 16
        type(record_type), target :: record
        type(system_type) :: system
        type(value) :: q, x, y, alarm
        type(kernel_type) :: kernel
        real(wp) :: angle(n), got(3)
        integer :: i

        angle = [(6.283185307179586_wp*(i - 1)/n, i=1, n)]
        call open_record(record, n)
        q = new_input(angle)
        x = unknown(system)
        y = unknown(system)
        call require(system, cos(q)*x - sin(q)*y - 1.0_wp)
        call require(system, sin(q)*x + cos(q)*y - 2.0_wp)
        call solve(system)
        call check(error, system%is_solved, "solved")
        if (.not. system%is_solved) return
        alarm = zero()
        do i = 1, size(system%watched)
            alarm = alarm + square(system%watched(i))
        end do
        call compile_kernel(record, [solved(system, x), solved(system, y), alarm], .true., kernel)
        call close_record(record)
        do i = 1, 64
            associate (a => 0.1_wp*i)
                call interpret(kernel, [a], got)
                call check_close(error, got(:2), [cos(a) + 2*sin(a), -sin(a) + 2*cos(a)], 20*eps, "rotation undone")
                call check(error, got(3) <= 1, "no alarm anywhere")
            end associate
        end do
    end subroutine test_full_turn

    !> Far from where it was traced the pivot vanishes.
    subroutine test_alarm(error)
        type(test_error), intent(inout) :: error
        type(record_type), target :: record
        type(system_type) :: system
        type(value) :: a, b, x, y, alarm
        type(kernel_type) :: kernel
        real(wp) :: got(3)
        integer :: i

        call open_record(record, 4)
        a = new_input([2.0_wp, 2.2_wp, 1.8_wp, 2.1_wp])
        b = new_input([0.5_wp, 0.4_wp, 0.6_wp, 0.5_wp])
        x = unknown(system)
        y = unknown(system)
        call require(system, a*x + b*y - 1.0_wp)
        call require(system, b*x - a*y - 2.0_wp)
        call solve(system)
        alarm = zero()
        do i = 1, size(system%watched)
            alarm = alarm + square(system%watched(i))
        end do
        call compile_kernel(record, [solved(system, x), solved(system, y), alarm], .true., kernel)
        call close_record(record)
        call interpret(kernel, [1.0_wp, 1.0_wp], got)
        call check(error, got(3) <= 1, "no alarm nearby")
        call interpret(kernel, [1.0e-6_wp, 1.0_wp], got)
        call check(error, .not. got(3) <= 1, "an alarm where the pivot is small")
        call interpret(kernel, [0.0_wp, 1.0_wp], got)
        call check(error, .not. got(3) <= 1, "an alarm where it is zero, number or not")
    end subroutine test_alarm

    subroutine test_singular_samples(error)
        type(test_error), intent(inout) :: error
        type(record_type), target :: record
        type(system_type) :: system
        type(value) :: a, x
        type(kernel_type) :: kernel
        real(wp) :: got(1)

        call open_record(record, 4)
        a = new_input([0.0_wp, 1.0_wp, 2.0_wp, 0.0_wp])
        x = unknown(system)
        call require(system, a*x - 1.0_wp)
        call solve(system)
        call check(error, system%is_solved, "solved for the other samples")
        if (.not. system%is_solved) return
        call compile_kernel(record, [solved(system, x)], .true., kernel)
        call close_record(record)
        call interpret(kernel, [4.0_wp], got)
        call check_close(error, got(1), 0.25_wp, eps, "1/4")
    end subroutine test_singular_samples

    subroutine test_singular_system(error)
        type(test_error), intent(inout) :: error
        type(record_type), target :: record
        type(system_type) :: system
        type(value) :: a, x, y

        call open_record(record, 3)
        a = new_input([1.0_wp, 2.0_wp, 3.0_wp])
        x = unknown(system)
        y = unknown(system)
        call require(system, a*x + y)
        call require(system, (2.0_wp*a)*x + 2.0_wp*y - a)
        call solve(system)
        call close_record(record)
        call check(error, .not. system%is_solved, "no solution is made up")
    end subroutine test_singular_system

    subroutine test_foreign_unknowns(error)
        type(test_error), intent(inout) :: error
        type(record_type), target :: record
        type(system_type) :: inner, outer
        type(value) :: a, x, y
        type(kernel_type) :: kernel
        real(wp) :: got(2)

        call open_record(record, 2)
        a = new_input([2.0_wp, 3.0_wp])
        y = unknown(outer)
        x = unknown(inner)
        call require(inner, a*x - y)
        call solve(inner)
        x = solved(inner, x)
        call require(outer, x + y - a)
        call solve(outer)
        call compile_kernel(record, [solved(outer, x), solved(outer, y)], .true., kernel)
        call close_record(record)
        call interpret(kernel, [2.0_wp], got)
        call check_close(error, got, [2/3.0_wp, 4/3.0_wp], 4*eps, "x = y/a, x + y = a")
    end subroutine test_foreign_unknowns

    subroutine test_not_linear(error)
        type(test_error), intent(inout) :: error
        type(record_type), target :: record
        type(system_type) :: system
        type(value) :: x

        call open_record(record, 2)
        x = unknown(system)
        call require(system, x*x - 2.0_wp)
        call solve(system)
        call close_record(record)
        call check(error, .not. system%is_solved, "x x is refused")
    end subroutine test_not_linear

    !> Six equations, one of them the sum of two, for nine unknowns: what is found of another sample solves its equations.
    subroutine test_states(error)
        type(test_error), intent(inout) :: error
        integer, parameter :: n_sample = 5, n = 9, m = 5, n_state = n - m
        type(record_type), target :: record
        type(system_type) :: system
        type(null_states) :: states
        type(value) :: x(n), entry(m, n)
        type(kernel_type) :: kernel
        real(wp) :: matrix(m, n), got(n*n_state), state(n, n_state)
        integer :: i, j, s

        call open_record(record, n_sample)
        do j = 1, n
            x(j) = unknown(system)
        end do
        do j = 1, n
            do i = 1, m
                entry(i, j) = new_input([(number(100*s, i + m*(j - 1)), s=1, n_sample)])
            end do
        end do
        do i = 1, m
            call require(system, sum_of(entry(i, :), x))
        end do
        call require(system, sum_of(entry(1, :), x) + sum_of(entry(3, :), x))
        call find_null_states(system, n_state, [(j == 2 .or. j == 7, j=1, n)], [(1.0_wp, j=1, n)], &
                              [(.true., s=1, n_sample)], states)
        call check(error, states%is_found, "there are pivots")
        if (.not. states%is_found) then
            call close_record(record)
            return
        end if
        call check(error, states%is_free(2) .and. states%is_free(7), "those that are to be free are")
        call compile_kernel(record, [states%state], .true., kernel)
        call close_record(record)
        matrix = reshape([(number(99, i), i=1, m*n)], [m, n])
        call interpret(kernel, [matrix], got)
        state = reshape(got, [n, n_state])
        call check_close(error, matmul(matrix, state), 0*matmul(matrix, state), 1.0e3_wp*eps*maxval(abs(state)), "A N = 0")
        do j = 1, n_state
            i = findloc([(states%is_free(i) .and. count(states%is_free(:i)) == j, i=1, n)], .true., dim=1)
            call check_close(error, state(i, :), [(merge(1.0_wp, 0.0_wp, s == j), s=1, n_state)], 0.0_wp, &
                             "a one in each free unknown")
        end do
    end subroutine test_states

    !> At the samples an equation follows from the others; where it does not, what is watched says so.
    subroutine test_rest(error)
        type(test_error), intent(inout) :: error
        type(record_type), target :: record
        type(system_type) :: system
        type(null_states) :: states
        type(value) :: x(3), a, b
        type(kernel_type) :: kernel
        real(wp), allocatable :: got(:)

        call open_record(record, 2)
        x = [unknown(system), unknown(system), unknown(system)]
        a = new_input([0.3_wp, 0.7_wp])
        b = new_input([0.6_wp, 1.4_wp])
        call require(system, x(1) + a*x(2) + 0.5_wp*x(3))
        call require(system, x(1) - x(3))
        call require(system, 2.0_wp*x(1) + b*x(2) + x(3))
        call find_null_states(system, 1, [.false., .false., .false.], [1.0_wp, 1.0_wp, 1.0_wp], [.true., .true.], states)
        call compile_kernel(record, states%watched, .true., kernel)
        call close_record(record)
        call check(error, states%is_found, "one equation follows")
        allocate (got(size(states%watched)))
        call interpret(kernel, [0.4_wp, 0.8_wp], got)
        call check(error, all(abs(got) < 1), "it does elsewhere, too")
        call interpret(kernel, [0.4_wp, 0.8_wp + 1.0e-4_wp], got)
        call check(error, any(abs(got) > 1), "and here it does not")
    end subroutine test_rest

    !> Columns nearly along each other: without the correction thousands of roundings are lost.
    subroutine test_least_squares(error)
        type(test_error), intent(inout) :: error
        type(record_type), target :: record
        type(value) :: n(3, 2), start(3), z(2)
        type(value), allocatable :: watched(:)
        type(kernel_type) :: kernel
        real(wp), parameter :: apart = 2.0e-3_wp, x(3) = [1.0_wp, 0.3_wp, -0.7_wp]
        real(wp) :: got(2), wanted(2)
        integer :: i

        call open_record(record, 1)
        allocate (watched(0))
        n = zero()
        n(1, :) = new_input([1.0_wp])
        n(2, 1) = new_input([apart])
        n(3, 2) = n(2, 1)
        start = [(new_input([x(i)]), i=1, 3)]
        call find_least(n, [2.0_wp, 2.0_wp, 2.0_wp], start, z, watched)
        call compile_kernel(record, z, .true., kernel)
        call close_record(record)
        call interpret(kernel, [1.0_wp, apart, x], got)
        ! of equations with 1 + d d on the diagonal and a one beside it
        wanted = [-x(1) - apart*x(2) - (x(2) - x(3))/apart, -x(1) - apart*x(3) + (x(2) - x(3))/apart]/(2 + apart**2)
        call check_close(error, got, wanted, 1.0e3_wp*eps*maxval(abs(wanted)), "least squares")
        call check(error, size(watched) == 1, "what is left of the second column is watched")
    end subroutine test_least_squares

    function sum_of(a, x) result(total)
        type(value), intent(in) :: a(:), x(:)
        type(value) :: total
        integer :: k

        total = zero()
        do k = 1, size(a)
            total = total + a(k)*x(k)
        end do
    end function sum_of
end module test_elimination
