!> Look-ups of records in closed curves: what they find, that all ways of running them give the same bits, and their derivatives.
module test_look_ups
    use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan, ieee_positive_inf, ieee_is_nan
    use linkdyn_block, only: program_type, block_space, make_program, free_program, make_space, free_space, block_lanes, &
        run_block, run_single, gather, scatter, gather_single, scatter_single, forms_multiply_adds
    use linkdyn_cam, only: pieces_of
    use linkdyn_code, only: choose_code, code_name
    use linkdyn_constants, only: two_pi
    use linkdyn_curve, only: curve_type, curve_point, make_polar_curve, make_curve, foot_of, touching_point
    use linkdyn_curve_values, only: curve_point_values
    use linkdyn_gradient, only: gradient
    use linkdyn_interpreter, only: interpret
    use linkdyn_kernel, only: kernel_type, compile_kernel
    use linkdyn_kinds, only: wp
    use linkdyn_operation, only: op_piece, op_nearest, op_farthest
    use linkdyn_piecewise, only: piecewise_curve, look_up
    use linkdyn_random_record, only: number, compare_with_differences
    use linkdyn_rates, only: rate_map, set_rate, rate_of
    use linkdyn_record, only: record_type, open_record, close_record, new_input, add_curve
    use linkdyn_status, only: status_type
    use linkdyn_testing, only: test_error, unit_test, new_test, check, check_close
    use linkdyn_value, only: value, constant, piece_at, nearest_place, farthest_place, operator(+), operator(-), operator(*)
    implicit none (type, external)
    private
    public :: collect_look_ups

    real(wp), parameter :: eps = epsilon(1.0_wp)
    integer, parameter :: n_point = 150

contains

    subroutine collect_look_ups(tests)
        type(unit_test), allocatable, intent(out) :: tests(:)

        tests = [new_test("pieces are the spline", test_pieces), &
                 new_test("places are those of the model's own search", test_places), &
                 new_test("no other place is nearer, none farther", test_best), &
                 new_test("interpreters and all codes give the same bits", test_bits), &
                 new_test("what is no number reaches into no table", test_no_numbers), &
                 new_test("first and second rates are derivatives", test_rates), &
                 new_test("gradients are derivatives", test_gradients)]
    end subroutine collect_look_ups

    ! ---------------------------------------------------------------- curves

    !> An egg, given by unevenly spaced points: by radii over angles, or by x and y.
    subroutine make_egg(is_polar, curve, n_knot)
        logical, intent(in) :: is_polar
        type(curve_type), intent(out) :: curve
        integer, intent(in), optional :: n_knot        !! absent: 23
        real(wp), allocatable :: angle(:), radius(:)
        integer :: i, n

        n = 23
        if (present(n_knot)) n = n_knot
        angle = [(two_pi*(i + 0.3_wp*number(i))/n, i=0, n - 1)]
        radius = 1 + 0.2_wp*cos(angle) + 0.03_wp*sin(2*angle)
        if (is_polar) then
            call make_polar_curve(angle, radius, curve)
        else
            call make_curve(radius*cos(angle), radius*sin(angle), curve)
        end if
    end subroutine make_egg

    !> Points about the curve, and directions.
    function some_points() result(p)
        real(wp) :: p(2, n_point)
        integer :: i

        do i = 1, n_point
            p(:, i) = (1 + 0.5_wp*number(i))*[cos(two_pi*number(3*i)), sin(two_pi*number(3*i))]
        end do
    end function some_points

    pure function point_at(pieces, place) result(p)
        type(piecewise_curve), intent(in) :: pieces
        real(wp), intent(in) :: place
        real(wp) :: p(2)

        p = [look_up(pieces, op_piece, 0, place, 0.0_wp), look_up(pieces, op_piece, 4, place, 0.0_wp)]
        if (pieces%is_polar) p = p(1)*[cos(p(2)), sin(p(2))]
    end function point_at

    ! ---------------------------------------------------------------- what is found

    !> At knots the spline goes through its points, without a jump in two derivatives by its own parameter.
    subroutine test_pieces(error)
        type(test_error), intent(inout) :: error
        type(curve_type) :: curve
        type(piecewise_curve) :: pieces
        integer :: i, k, order, n
        real(wp) :: h(2), before, after

        do k = 0, 1
            call make_egg(k == 1, curve)
            pieces = pieces_of(curve)
            n = size(curve%u) - 1
            do i = 1, n
                call check_close(error, point_at(pieces, real(i - 1, wp)), curve%knot(:, i), 4*eps, "a knot")
                if (i == n) cycle
                h = [curve%u(i + 1) - curve%u(i), curve%u(i + 2) - curve%u(i + 1)]
                do order = 0, 2
                    ! the end of one piece, as its polynomial goes on, and the beginning of the next
                    associate (c => pieces%c(:, i, 1))
                        before = merge(sum(c), merge(c(2) + 2*c(3) + 3*c(4), 2*c(3) + 6*c(4), order == 1), order == 0)
                    end associate
                    after = look_up(pieces, op_piece, order, real(i, wp), 0.0_wp)
                    call check_close(error, before/h(1)**order, after/h(2)**order, 1e4_wp*eps, "a jump at a knot")
                end do
            end do
        end do
    end subroutine test_pieces

    subroutine test_places(error)
        type(test_error), intent(inout) :: error
        type(curve_type) :: curve
        type(piecewise_curve) :: pieces
        type(curve_point) :: wanted
        real(wp) :: p(2, n_point), unit(2)
        integer :: i, k

        p = some_points()
        do k = 0, 1
            call make_egg(k == 1, curve)
            pieces = pieces_of(curve)
            do i = 1, n_point
                wanted = foot_of(curve, p(:, i))
                call check_close(error, point_at(pieces, look_up(pieces, op_nearest, 0, p(1, i), p(2, i))), wanted%at, 1e3_wp*eps, &
                                 "the nearest place")
                unit = p(:, i)/norm2(p(:, i))
                wanted = touching_point(curve, unit)
                call check_close(error, point_at(pieces, look_up(pieces, op_farthest, 0, unit(1), unit(2))), wanted%at, &
                                 1e3_wp*eps, "the farthest place")
            end do
        end do
    end subroutine test_places

    subroutine test_best(error)
        type(test_error), intent(inout) :: error
        integer, parameter :: n_look = 2000
        type(curve_type) :: curve
        type(piecewise_curve) :: pieces
        real(wp) :: p(2, n_point), there(2, n_look), found(2)
        integer :: i, k, n

        p = some_points()
        do k = 0, 1
            call make_egg(k == 1, curve)
            pieces = pieces_of(curve)
            n = size(curve%knot, 2)
            there = reshape([(point_at(pieces, real(i, wp)*n/n_look), i=1, n_look)], [2, n_look])
            do i = 1, n_point
                found = point_at(pieces, look_up(pieces, op_nearest, 0, p(1, i), p(2, i)))
                call check(error, norm2(found - p(:, i)) <= minval(hypot(there(1, :) - p(1, i), there(2, :) - p(2, i))) + 8*eps, &
                           "there is a nearer place")
                found = point_at(pieces, look_up(pieces, op_farthest, 0, p(1, i), p(2, i)))
                call check(error, dot_product(found, p(:, i)) >= maxval(matmul(p(:, i), there)) - 8*eps, "there is a farther place")
            end do
        end do
    end subroutine test_best

    ! ---------------------------------------------------------------- ways of running

    !> Outputs that use every look-up, with arithmetic around, and values that live across.
    subroutine trace_look_ups(is_polar, record, kernel, n_knot)
        logical, intent(in) :: is_polar
        integer, intent(in), optional :: n_knot        !! of the curve that is polar if is_polar; absent: 23
        type(record_type), intent(inout), target :: record
        type(kernel_type), intent(out) :: kernel
        type(curve_type) :: curve
        type(value) :: x, y, place, out(18)
        type(curve_point_values) :: at
        integer :: id(2), k, order, n

        call open_record(record, 2)
        call make_egg(.not. is_polar, curve)
        id(1) = add_curve(pieces_of(curve))
        call make_egg(is_polar, curve, n_knot)
        id(2) = add_curve(pieces_of(curve))
        x = new_input([0.3_wp, 1.1_wp])
        y = new_input([0.8_wp, -0.4_wp])
        n = 0
        do k = 1, 2
            place = nearest_place(id(k), x - constant(0.1_wp), -(x*y))
            do order = 0, 3
                n = n + 1
                out(n) = piece_at(id(k), 3 - k, order, place)*x + y
            end do
            place = farthest_place(id(k), x + y, y)
            at = curve_point_values(id(k), place)
            out(n + 1) = at%at(1)*y + at%first(2)
            out(n + 2) = at%at(2) - at%second(1)*x
            out(n + 3) = place
            out(n + 4) = nearest_place(id(k), out(n + 1), out(n + 2))
            out(n + 5) = piece_at(id(k), 1, 0, x*y)
            n = n + 5
        end do
        call compile_kernel(record, out, forms_multiply_adds(), kernel, parts=[7, 11])
        call close_record(record)
    end subroutine trace_look_ups

    subroutine test_bits(error)
        type(test_error), intent(inout) :: error
        type(record_type), target :: record
        type(kernel_type) :: kernel
        type(status_type) :: status
        real(wp) :: p(2, n_point), want(18, n_point), got(18, n_point), reference(18)
        integer :: c, i, k
        ! with pieces of more than pi/4, and a table beyond what short instructions can reach
        integer, parameter :: n_knot(4) = [23, 23, 5, 6000]

        p = some_points()
        do k = 1, 4
            call trace_look_ups(k /= 2, record, kernel, n_knot(k))
            do c = 1, size(code_name)
                call choose_code(trim(code_name(c)), status)
                call run_kernel(kernel, p, .false., got)
                if (c == 1) want = got
                call check(error, all(got == want), trim(code_name(c))//" gives other bits than the interpreter")
                call run_kernel(kernel, p, .true., got)
                call check(error, all(got == want), trim(code_name(c))//": one sample alone gives other bits")
            end do
            call choose_code("", status)
            do i = 1, n_point
                ! sine and cosine are the library's in the reference
                call interpret(kernel, p(:, i), reference)
                call check_close(error, want(:, i), reference, 1e4_wp*eps, "lanes against the reference")
            end do
        end do
    end subroutine test_bits

    subroutine run_kernel(kernel, given, one_by_one, got)
        type(kernel_type), intent(in) :: kernel
        real(wp), intent(in) :: given(2, n_point)
        logical, intent(in) :: one_by_one
        real(wp), intent(out) :: got(kernel%n_output, n_point)
        type(program_type) :: program
        type(block_space) :: space
        logical :: is_bad(size(given, 2))
        integer :: first, n, g, last, lanes

        lanes = merge(1, block_lanes(), one_by_one)
        call make_program(kernel, program)
        call make_space(program, one_by_one, space)
        do first = 1, size(given, 2), lanes
            n = min(lanes, size(given, 2) - first + 1)
            if (one_by_one) then
                call gather_single(given(:, first), 1, space)
            else
                call gather(given(:, first:), size(given, 1), n, size(given, 1), 1, space)
            end if
            last = 0
            do g = 1, size(kernel%group_end)
                if (one_by_one) then
                    call run_single(program, g, space)
                    call scatter_single(program, space, last + 1, got(last + 1:kernel%group_end(g), first))
                else
                    call run_block(program, g, space)
                    call scatter(program, space, last + 1, kernel%group_end(g) - last, got(last + 1, first), kernel%n_output, n, &
                                 is_bad)
                end if
                last = kernel%group_end(g)
            end do
        end do
        call free_space(space)
        call free_program(program)
    end subroutine run_kernel

    !> Beside sound samples, which stay as they are.
    subroutine test_no_numbers(error)
        type(test_error), intent(inout) :: error
        type(record_type), target :: record
        type(kernel_type) :: kernel
        real(wp) :: p(2, n_point), sound(18, n_point), got(18, n_point)
        integer :: k, i
        real(wp) :: odd(6)

        odd = [ieee_value(1.0_wp, ieee_quiet_nan), ieee_value(1.0_wp, ieee_positive_inf), &
               -ieee_value(1.0_wp, ieee_positive_inf), huge(1.0_wp), -huge(1.0_wp), 1.0e30_wp]
        do k = 0, 1
            call trace_look_ups(k == 1, record, kernel)
            p = some_points()
            call run_kernel(kernel, p, .false., sound)
            do i = 1, 6
                p(1, 5*i) = odd(i)
                p(2, 5*i + 1) = odd(i)
                p(:, 5*i + 2) = odd(i)
            end do
            call run_kernel(kernel, p, .false., got)
            call check(error, all(ieee_is_nan(got(1, [5, 7]))), "what is no number has a place")
            do i = 1, n_point
                if (i <= 32 .and. any(modulo(i, 5) == [0, 1, 2])) cycle
                call check(error, all(got(:, i) == sound(:, i)), "a sample minds its neighbours")
            end do
        end do
    end subroutine test_no_numbers

    ! ---------------------------------------------------------------- derivatives

    !> Points of the curve, by place, by a point near to it and by a direction.
    subroutine expression(x, y)
        type(value), intent(in) :: x(2)
        type(value), intent(out) :: y(6)
        type(curve_type) :: curve
        type(curve_point_values) :: at
        type(value) :: place
        integer :: id, k

        do k = 0, 1
            call make_egg(k == 1, curve)
            id = add_curve(pieces_of(curve))
            at = curve_point_values(id, nearest_place(id, x(1), x(2)))
            y(3*k + 1) = at%at(1)*x(2)
            at = curve_point_values(id, farthest_place(id, x(1), x(2)))
            y(3*k + 2) = at%at(1) + at%at(2)
            place = constant(7.3_wp) + 0.2_wp*(x(1)*x(2))
            y(3*k + 3) = piece_at(id, 1, 0, place) + piece_at(id, 2, 1, place)
        end do
    end subroutine expression

    subroutine test_rates(error)
        type(test_error), intent(inout) :: error
        type(record_type), target :: record
        type(value) :: x(2), output(12)
        type(rate_map) :: rates
        real(wp), parameter :: way(2) = [0.3_wp, -0.7_wp]
        integer :: i

        call open_record(record, 2)
        x = [new_input([0.3_wp]), new_input([0.8_wp])]
        call expression(x, output(:6))
        do i = 1, 2
            call set_rate(rates, x(i), constant(way(i)))
        end do
        do i = 1, 6
            output(6 + i) = rate_of(rates, output(i))
        end do
        call compare_with_differences(record, output, smooth_points(), way, 1.0e4_wp, 2, error)
        ! once more
        output(:6) = output(7:)
        do i = 1, 6
            output(6 + i) = rate_of(rates, output(i))
        end do
        call compare_with_differences(record, output, smooth_points(), way, 1.0e4_wp, 2, error)
        call close_record(record)
    end subroutine test_rates

    subroutine test_gradients(error)
        type(test_error), intent(inout) :: error
        type(record_type), target :: record
        type(value) :: x(2), output(12), d(2)
        real(wp), parameter :: way(2) = [0.3_wp, -0.7_wp]
        integer :: i

        call open_record(record, 2)
        x = [new_input([0.3_wp]), new_input([0.8_wp])]
        call expression(x, output(:6))
        do i = 1, 6
            d = gradient(output(i), x)
            output(6 + i) = constant(way(1))*d(1) + constant(way(2))*d(2)
        end do
        call compare_with_differences(record, output, smooth_points(), way, 1.0e4_wp, 2, error)
        call close_record(record)
    end subroutine test_gradients

    !> Those of the points near whose centres of curvature nothing is smooth are left out.
    function smooth_points() result(p)
        real(wp), allocatable :: p(:, :)
        real(wp) :: every(2, n_point)
        integer :: i

        every = some_points()
        p = every(:, pack([(i, i=1, n_point)], norm2(every, dim=1) >= 0.8_wp))
    end function smooth_points
end module test_look_ups
