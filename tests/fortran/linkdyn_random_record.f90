!> Records of random operations, always the same, and derivatives of records against differences.
module linkdyn_random_record
    use, intrinsic :: iso_fortran_env, only: int64
    use linkdyn_folding, only: result_of
    use linkdyn_interpreter, only: interpret
    use linkdyn_kernel, only: kernel_type, compile_kernel
    use linkdyn_kinds, only: wp
    use linkdyn_hash, only: counter_uniform
    use linkdyn_operation, only: op_root, op_reciprocal
    use linkdyn_record, only: new_input, record_type
    use linkdyn_testing, only: test_error, check_close
    use linkdyn_value, only: value, constant, operator(+), operator(-), sin, abs
    implicit none (type, external)
    private
    public :: number, some_inputs, random_record, compare_with_differences

contains

    !> Numbers in (-1, 1), always the same.
    real(wp) function number(i)
        integer, intent(in) :: i

        number = 2*counter_uniform(17_int64, 4_int64, int(i, int64)) - 1
    end function number

    function some_inputs(n) result(x)
        integer, intent(in) :: n
        type(value) :: x(n)
        integer :: i

        do i = 1, n
            x(i) = new_input([number(i), number(100 + i)])
        end do
    end function some_inputs

    !> A record of random operations on n_input inputs; outputs are its last values.
    subroutine random_record(seed, n_input, n_step, kinds, x, output, n_output)
        integer, intent(in) :: seed, n_input, n_step
        integer, intent(in) :: kinds(:)
        type(value), intent(out) :: x(n_input)
        type(value), allocatable, intent(out) :: output(:)
        integer, intent(in), optional :: n_output      !! absent: 12
        type(value) :: made(n_input + n_step), a, b, c
        integer :: i, kind, n

        x = some_inputs(n_input)
        made(:n_input) = x
        do i = 1, n_step
            kind = kinds(1 + int(size(kinds)*draw(1)))
            a = made(1 + int((n_input + i - 1)*draw(2)))
            b = made(1 + int((n_input + i - 1)*draw(3)))
            c = made(1 + int((n_input + i - 1)*draw(4)))
            if (draw(5) < 0.3_wp) a = -a
            if (draw(6) < 0.1_wp) b = constant(draw(7) - 0.5_wp)
            ! roots and reciprocals of what is far from zero
            if (kind == op_root) a = abs(a) + constant(0.5_wp)
            if (kind == op_reciprocal) a = abs(a) + constant(1)
            made(n_input + i) = result_of(kind, a, b, c)
            ! nothing grows without bound
            if (modulo(i, 7) == 0) made(n_input + i) = sin(made(n_input + i))
        end do
        n = 12
        if (present(n_output)) n = n_output
        output = made(n_input + n_step - min(n_step, n) + 1:)

    contains

        real(wp) function draw(k)
            integer, intent(in) :: k

            draw = counter_uniform(int(seed, int64), int(k, int64), int(i, int64))
        end function draw
    end subroutine random_record

    !> The second half of the outputs against central differences of the first along a way.
    subroutine compare_with_differences(record, output, point, way, factor, power, error)
        type(record_type), intent(in) :: record
        type(value), intent(in) :: output(:)
        real(wp), intent(in) :: point(:, :)            !! where (n_input, n_point)
        real(wp), intent(in) :: way(:)                 !! (n_input)
        real(wp), intent(in) :: factor                 !! an error is at most this times the step squared, ...
        integer, intent(in) :: power                   !! and times one and this power of the largest value
        type(test_error), intent(inout) :: error
        type(kernel_type) :: kernel
        real(wp), dimension(size(output)) :: here, after, before
        real(wp), parameter :: h = epsilon(1.0_wp)**(1.0_wp/3)
        integer :: i, half

        half = size(output)/2
        call compile_kernel(record, output, .false., kernel)
        do i = 1, size(point, 2)
            call interpret(kernel, point(:, i), here)
            call interpret(kernel, point(:, i) + h*way, after)
            call interpret(kernel, point(:, i) - h*way, before)
            call check_close(error, here(half + 1:), (after(:half) - before(:half))/(2*h), &
                             factor*h**2*(1 + maxval(abs(here))**power), "derivative")
        end do
    end subroutine compare_with_differences
end module linkdyn_random_record
