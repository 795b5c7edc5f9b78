!> Records: what folds away, that equal expressions are one node, that every way of running a kernel gives the same bits,
!> and that derivatives are derivatives.
module test_record
    use linkdyn_block, only: program_type, block_space, make_program, free_program, make_space, free_space, block_lanes, &
        run_block, run_single, gather, scatter, gather_single, scatter_single, take_columns, forms_multiply_adds
    use linkdyn_folding, only: product_in_any_order
    use linkdyn_gradient, only: gradient
    use linkdyn_interpreter, only: interpret
    use linkdyn_kernel, only: kernel_type, compile_kernel, count_of, find_boundary
    use linkdyn_kinds, only: wp
    use linkdyn_operation, only: op_add, op_subtract, op_multiply, op_reciprocal, op_root, op_minimum, op_absolute, op_select
    use linkdyn_random_record, only: number, some_inputs, random_record, compare_with_differences
    use linkdyn_rates, only: rate_map, set_rate, rate_of
    use linkdyn_record, only: record_type, open_record, close_record
    use linkdyn_substitution, only: substitution, replace, substituted
    use linkdyn_testing, only: test_error, unit_test, new_test, check, check_close
    use linkdyn_value, only: value, constant, zero, one, is_zero, is_one, operator(+), operator(-), operator(*), operator(/), &
        sqrt, sin, cos, atan2, min, max, abs, reciprocal, select, square, nearest_whole, declare_inverse
    implicit none (type, external)
    private
    public :: collect_record

    real(wp), parameter :: eps = epsilon(1.0_wp)

contains

    subroutine collect_record(tests)
        type(unit_test), allocatable, intent(out) :: tests(:)

        tests = [new_test("zeros, ones and signs fold", test_folding), &
                 new_test("equal expressions are one node", test_sharing), &
                 new_test("a plane folds out of space", test_plane), &
                 new_test("random kernels: all interpreters, all lanes, the same bits", test_random_kernels), &
                 new_test("fusing changes a few roundings only", test_fusing), &
                 new_test("sine, cosine, arctangent on lanes", test_lane_functions), &
                 new_test("columns of results are rows of them", test_columns), &
                 new_test("rates are derivatives", test_rates), &
                 new_test("gradients are derivatives", test_gradients), &
                 new_test("select does not let the road not taken in", test_select_derivative), &
                 new_test("substitution is the same formula of other arguments", test_substitution), &
                 new_test("a kernel in two parts", test_two_parts), &
                 new_test("records do not mind each other", test_nested_records)]
    end subroutine collect_record

    ! ---------------------------------------------------------------- helpers

    logical function same(a, b)
        type(value), intent(in) :: a, b

        same = a%node == b%node .and. a%sign == b%sign
    end function same

    ! ---------------------------------------------------------------- folding

    subroutine test_folding(error)
        type(test_error), intent(inout) :: error
        type(record_type), target :: record
        type(value) :: x(3)
        integer :: n

        call open_record(record, 2)
        x = some_inputs(3)
        call check(error, same(x(1) + zero(), x(1)) .and. same(zero() + x(1), x(1)), "x + 0 is x")
        call check(error, is_zero(x(1) - x(1)) .and. is_zero(zero()*x(1)), "x - x and 0 x are zero")
        call check(error, same(one()*x(1), x(1)) .and. same((-one())*x(1), -x(1)), "1 x is x, (-1) x is -x")
        call check(error, same(x(1)*(-x(2)), -(x(1)*x(2))), "signs leave products")
        call check(error, same(x(2) - x(1), -(x(1) - x(2))), "a - b is -(b - a)")
        call check(error, same(constant(2.0_wp)*(constant(3.0_wp)*x(1)), constant(6.0_wp)*x(1)), "constants combine")
        call check(error, is_one(x(1)*reciprocal(x(1))), "x/x is one")
        call check(error, same(reciprocal(reciprocal(x(1))), x(1)), "1/(1/x) is x")
        call check(error, same(x(1) + x(1), constant(2.0_wp)*x(1)), "x + x is 2 x")
        call check(error, same(sin(-x(1)), -sin(x(1))) .and. same(cos(-x(1)), cos(x(1))), "sine is odd, cosine even")
        call check(error, same(abs(-x(1)), abs(x(1))) .and. same(min(-x(1), -x(2)), -max(x(1), x(2))), "signs of extremes")
        call check(error, same(select(one(), x(1), x(2)), x(1)) .and. same(select(zero(), x(1), x(2)), x(2)), "known choices")
        call declare_inverse(x(2), -x(3))
        call check(error, is_one(x(2)*x(3)), "a declared inverse meets its original")
        n = record%n_node
        call check(error, same(sqrt(constant(4.0_wp)), constant(2.0_wp)), "functions of constants are constants")
        call check(error, record%n_node <= n + 2, "and make no other node")
        call close_record(record)
    end subroutine test_folding

    subroutine test_sharing(error)
        type(test_error), intent(inout) :: error
        type(record_type), target :: record
        type(value) :: x(3), a, b
        integer :: n

        call open_record(record, 2)
        x = some_inputs(3)
        a = sqrt(x(1)*x(2) + x(3))
        n = record%n_node
        b = sqrt(x(3) + x(2)*x(1))
        call check(error, same(a, b) .and. record%n_node == n, "operands that may change places make the same node")
        a = x(1)*(x(2)*(-x(3)))
        call check(error, same(product_in_any_order(x(2), x(1)*x(3)), -a), "so do factors of three, where order does not count")
        call check(error, .not. same(x(2)*(x(1)*x(3)), -a), "elsewhere they stay: the rate of two may be known, of each not")
        call close_record(record)
    end subroutine test_sharing

    !> Euler's equations about z: one product is left.
    subroutine test_plane(error)
        use linkdyn_vector, only: vector, operator(.cross.), operator(+)
        type(test_error), intent(inout) :: error
        type(record_type), target :: record
        type(value) :: x(2), inertia
        type(vector) :: w, h, m

        call open_record(record, 2)
        x = some_inputs(2)
        inertia = constant(0.3_wp)
        w = vector(zero(), zero(), x(1))
        h = vector(constant(0.1_wp)*w%x, constant(0.2_wp)*w%y, inertia*w%z)
        m = vector(constant(0.1_wp)*zero(), zero(), inertia*x(2)) + (w.cross.h)
        call check(error, is_zero(m%x) .and. is_zero(m%y) .and. same(m%z, inertia*x(2)), "I alpha + omega x I omega is I alpha")
        call close_record(record)
    end subroutine test_plane

    ! ---------------------------------------------------------------- running

    subroutine test_random_kernels(error)
        type(test_error), intent(inout) :: error
        integer, parameter :: arithmetic(10) = [op_add, op_add, op_subtract, op_multiply, op_multiply, op_reciprocal, op_root, &
                                                op_minimum, op_absolute, op_select]
        integer, parameter :: n_input = 5, n_sample = 71
        type(record_type), target :: record
        type(value) :: x(n_input)
        type(value), allocatable :: output(:)
        type(kernel_type) :: kernel
        type(program_type) :: program
        type(block_space) :: lanes, single
        real(wp) :: given(n_input, n_sample)
        real(wp), allocatable :: want(:, :), got(:, :), one_by_one(:)
        logical :: is_bad(n_sample)
        integer :: seed, i, k, first, last, n

        do i = 1, n_sample
            do k = 1, n_input
                given(k, i) = 3*number(1000*i + k)
            end do
        end do
        do seed = 1, 40
            call open_record(record, 2)
            call random_record(seed, n_input, 20 + 8*seed, arithmetic, x, output)
            call compile_kernel(record, output, forms_multiply_adds(), kernel, parts=[size(output) - 5, 2, 3])
            call close_record(record)
            call make_program(kernel, program)
            call make_space(program, .false., lanes)
            call make_space(program, .true., single)
            allocate (want(size(output), n_sample), got(size(output), n_sample), one_by_one(size(output)))
            is_bad = .false.
            do first = 1, n_sample, block_lanes()
                n = min(block_lanes(), n_sample - first + 1)
                call gather(given(:, first:), n_input, n, n_input, 1, lanes)
                last = 0
                do k = 1, size(kernel%group_end)
                    call run_block(program, k, lanes)
                    call scatter(program, lanes, last + 1, kernel%group_end(k) - last, got(last + 1, first), size(output), n, &
                                 is_bad(first:))
                    last = kernel%group_end(k)
                end do
            end do
            do i = 1, n_sample
                call interpret(kernel, given(:, i), want(:, i))
                call gather_single(given(:, i), 1, single)
                last = 0
                do k = 1, size(kernel%group_end)
                    call run_single(program, k, single)
                    call scatter_single(program, single, last + 1, one_by_one(last + 1:kernel%group_end(k)))
                    last = kernel%group_end(k)
                end do
                call check(error, all(one_by_one == got(:, i)), "one sample alone gives the bits of one among many")
            end do
            ! sines every seventh step are the library's in the reference: equal but for their rounding there
            call check_close(error, got, want, 1e4_wp*eps*max(1.0_wp, maxval(abs(want))), "lanes against the reference")
            call check(error, .not. any(is_bad), "finite numbers are not flagged")
            deallocate (want, got, one_by_one)
            call free_space(lanes)
            call free_space(single)
            call free_program(program)
        end do
    end subroutine test_random_kernels

    !> The same record with and without multiply-adds: sums in another order and rounded less often.
    subroutine test_fusing(error)
        type(test_error), intent(inout) :: error
        type(record_type), target :: record
        type(value) :: x(6), output(1)
        type(kernel_type) :: plain, fused
        real(wp) :: given(6), a(1), b(1)
        integer :: i

        call open_record(record, 2)
        x = some_inputs(6)
        output(1) = ((x(1)*x(2) + x(3)*x(4)) - (x(5)*x(6) - x(1)*x(3))) + (x(2) - x(4)*x(6))
        call compile_kernel(record, output, .false., plain)
        call compile_kernel(record, output, .true., fused)
        call close_record(record)
        call check(error, count_of(fused, "") == 5, "six terms, five instructions")
        call check(error, count_of(plain, "") == 10, "one instruction an operation")
        do i = 1, 20
            given = [number(i), number(i + 1), number(i + 2), number(i + 3), number(i + 4), number(i + 5)]
            call interpret(plain, given, a)
            call interpret(fused, given, b)
            call check_close(error, a, b, 12*eps, "fused against plain")
        end do
    end subroutine test_fusing

    subroutine test_lane_functions(error)
        type(test_error), intent(inout) :: error
        integer, parameter :: n = 4096, quad = selected_real_kind(33)
        type(record_type), target :: record
        type(value) :: x(2), output(4)
        type(kernel_type) :: kernel
        type(program_type) :: program
        type(block_space) :: space
        real(wp) :: given(2, n), got(4, n)
        logical :: is_bad(n)
        integer :: i, first, m

        call open_record(record, 2)
        x = some_inputs(2)
        output = [sin(x(1)), cos(x(1)), atan2(x(1), x(2)), nearest_whole(x(1))]
        call compile_kernel(record, output, forms_multiply_adds(), kernel)
        call close_record(record)
        do i = 1, n
            given(1, i) = number(2*i)*10.0_wp**modulo(i, 8)
            given(2, i) = number(2*i + 1)*10.0_wp**modulo(i/8, 5)
        end do
        given(:, 1) = [0.0_wp, -1.0_wp]
        given(:, 2) = [1.0e300_wp, 1.0_wp]
        given(:, 3) = [2.5_wp, 0.0_wp]
        given(:, 4) = [-0.5_wp, -0.5_wp]
        call make_program(kernel, program)
        call make_space(program, .false., space)
        is_bad = .false.
        do first = 1, n, block_lanes()
            m = min(block_lanes(), n - first + 1)
            call gather(given(:, first:), 2, m, 2, 1, space)
            call run_block(program, 1, space)
            call scatter(program, space, 1, 4, got(:, first:), 4, m, is_bad(first:))
        end do
        call free_space(space)
        call free_program(program)
        ! in many digits: side by side, a compiler's own functions may err by some roundings
        call check_close(error, got(1, :), real(sin(real(given(1, :), quad)), wp), 1.1_wp*eps, "sine")
        call check_close(error, got(2, :), real(cos(real(given(1, :), quad)), wp), 1.1_wp*eps, "cosine")
        call check(error, all(abs(got(3, :) - real(atan2(real(given(1, :), quad), real(given(2, :), quad)), wp)) &
                              <= 2*eps*abs(got(3, :)) + tiny(1.0_wp)), "arctangent")
        call check(error, got(4, 3) == 2 .and. got(4, 4) == 0, "whole numbers: ties to even")
        call check(error, all(abs(got(4, :) - given(1, :)) <= 0.5_wp), "the nearest whole number")
    end subroutine test_lane_functions

    !> Columns take what rows take, of any number of samples, and nothing beside; both tell which samples have a number that is not
    !> finite.
    subroutine test_columns(error)
        type(test_error), intent(inout) :: error
        integer, parameter :: n_output = 3, room = 70
        real(wp), parameter :: untouched = -1234
        type(record_type), target :: record
        type(value) :: x(2), output(n_output)
        type(kernel_type) :: kernel
        type(program_type) :: program
        type(block_space) :: space
        real(wp) :: given(2, room), row(n_output, room), column(room, n_output)
        logical :: is_bad(room), is_bad_too(room)
        integer :: n, i

        call open_record(record, 2)
        x = some_inputs(2)
        output = [reciprocal(x(1)), -(x(1) + x(2)), sqrt(x(2))]
        call compile_kernel(record, output, forms_multiply_adds(), kernel)
        call close_record(record)
        given = reshape([(1 + abs(number(i)), i=1, size(given))], shape(given))
        given(1, 2::5) = 0                             ! whose reciprocal is none
        given(2, 4::7) = -1                            ! nor is its root
        call make_program(kernel, program)
        call make_space(program, .false., space)
        do n = 1, block_lanes()
            row = untouched
            column = untouched
            is_bad = .false.
            is_bad_too = .false.
            call gather(given, 2, n, 2, 1, space)
            call run_block(program, 1, space, n)
            call scatter(program, space, 1, n_output, row, n_output, n, is_bad)
            call take_columns(program, space, 1, n_output, n, room, column, is_bad_too)
            do i = 1, n
                call check(error, all(row(:, i) == column(i, :) .or. (row(:, i) /= row(:, i) .and. column(i, :) /= column(i, :))), &
                           "the same numbers")
                call check(error, is_bad(i) .eqv. (given(1, i) == 0 .or. given(2, i) < 0), "not finite, in rows")
            end do
            call check(error, all(is_bad .eqv. is_bad_too), "the same samples are not finite")
            call check(error, all(column(n + 1:, :) == untouched), "nothing of other samples")
        end do
        call free_space(space)
        call free_program(program)
    end subroutine test_columns

    ! ---------------------------------------------------------------- derivatives

    !> Every operation once, against differences.
    subroutine expression(x, y)
        type(value), intent(in) :: x(3)
        type(value), intent(out) :: y(6)

        y(1) = x(1)*x(2) - x(3)/x(1)
        y(2) = sqrt(square(x(1)) + square(x(2)))*sin(x(3))
        y(3) = atan2(x(1)*x(2), x(3) + constant(2))
        y(4) = max(x(1), x(2)) + min(x(2), x(3))*abs(x(1))
        y(5) = select(x(1), x(2)*x(2), x(3))*cos(x(2))
        y(6) = nearest_whole(constant(5)*x(1)) + x(2)
    end subroutine expression

    subroutine test_rates(error)
        type(test_error), intent(inout) :: error
        type(record_type), target :: record
        type(value) :: x(3), y(6), output(12)
        type(rate_map) :: rates
        real(wp), parameter :: way(3) = [0.3_wp, -0.7_wp, 0.2_wp]
        integer :: i

        call open_record(record, 2)
        x = some_inputs(3)
        call expression(x, y)
        do i = 1, 3
            call set_rate(rates, x(i), constant(way(i)))
        end do
        output(:6) = y
        do i = 1, 6
            output(6 + i) = rate_of(rates, y(i))
        end do
        call compare_with_differences(record, output, some_points(), way, 200.0_wp, 3, error)
        call close_record(record)
    end subroutine test_rates

    subroutine test_gradients(error)
        type(test_error), intent(inout) :: error
        type(record_type), target :: record
        type(value) :: x(3), y(6), output(12), d(3)
        real(wp), parameter :: way(3) = [0.3_wp, -0.7_wp, 0.2_wp]
        integer :: i

        call open_record(record, 2)
        x = some_inputs(3)
        call expression(x, y)
        output(:6) = y
        do i = 1, 6
            d = gradient(y(i), x)
            output(6 + i) = constant(way(1))*d(1) + constant(way(2))*d(2) + constant(way(3))*d(3)
        end do
        call compare_with_differences(record, output, some_points(), way, 200.0_wp, 3, error)
        call close_record(record)
    end subroutine test_gradients

    function some_points() result(x)
        real(wp) :: x(3, 10)
        integer :: i

        x = reshape([(number(i), i=3, 32)], [3, 10])
    end function some_points

    !> The root of what is negative where the other road is taken.
    subroutine test_select_derivative(error)
        type(test_error), intent(inout) :: error
        type(record_type), target :: record
        type(value) :: x(1), y, d(1)
        type(kernel_type) :: kernel
        real(wp) :: output(2)

        call open_record(record, 2)
        x = some_inputs(1)
        y = select(x(1), sqrt(select(x(1), x(1), one())), zero())
        d = gradient(y, x)
        call compile_kernel(record, [y, d(1)], .false., kernel)
        call close_record(record)
        call interpret(kernel, [-1.0_wp], output)
        call check(error, all(output == 0), "the other road has no derivative, and is no NaN")
        call interpret(kernel, [0.0_wp], output)
        call check(error, all(output == 0), "at the branching")
        call interpret(kernel, [4.0_wp], output)
        call check_close(error, output, [2.0_wp, 0.25_wp], eps, "the road taken")
    end subroutine test_select_derivative

    subroutine test_substitution(error)
        type(test_error), intent(inout) :: error
        type(record_type), target :: record
        type(value) :: x(3), y(6), z(6)
        type(substitution) :: map

        call open_record(record, 2)
        x = some_inputs(3)
        call expression(x, y)
        call expression([x(2), -x(1), x(3)*x(3)], z)
        call replace(map, x, [x(2), -x(1), x(3)*x(3)])
        y = substituted(map, y)
        call check(error, all(y%node == z%node .and. y%sign == z%sign), "substituted against written")
        call close_record(record)
    end subroutine test_substitution

    !> What does not depend on a late input is found once.
    subroutine test_two_parts(error)
        type(test_error), intent(inout) :: error
        type(record_type), target :: record
        type(value) :: x(3), output(1)
        type(kernel_type) :: whole, early, late
        integer, allocatable :: boundary(:)
        real(wp) :: given(3), a(1), b(1)
        real(wp), allocatable :: found(:)
        integer :: k

        call open_record(record, 2)
        x = some_inputs(3)
        output(1) = sqrt(x(1)*x(1) + x(2)*x(2))*x(3) + x(1)/x(2)
        call compile_kernel(record, output, .false., whole)
        call find_boundary(record, output, x(3:), boundary)
        call check(error, size(boundary) == 2, "a root and a quotient stand at the boundary")
        call compile_kernel(record, [(value(boundary(k), 1), k=1, size(boundary))], .false., early)
        call compile_kernel(record, output, .false., late, boundary)
        call close_record(record)
        given = [0.3_wp, -0.8_wp, 1.7_wp]
        call interpret(whole, given, a)
        allocate (found(size(boundary)))
        call interpret(early, given, found)
        call interpret(late, [given, found], b)
        call check(error, a(1) == b(1), "in two parts the same bits")
        call check(error, count_of(late, "") == 2, "a product and a sum are left")
    end subroutine test_two_parts

    subroutine test_nested_records(error)
        type(test_error), intent(inout) :: error
        type(record_type), target :: outer, inner
        type(value) :: x(2), y(1), a
        integer :: n

        call open_record(outer, 2)
        x = some_inputs(2)
        a = x(1)*x(2)
        n = outer%n_node
        call open_record(inner, 2)
        y = some_inputs(1)
        y(1) = sin(y(1))
        call close_record(inner)
        call check(error, outer%n_node == n .and. inner%n_node == 2, "each has its own nodes")
        call check(error, same(a, x(2)*x(1)), "the outer one goes on")
        call close_record(outer)
    end subroutine test_nested_records
end module test_record
