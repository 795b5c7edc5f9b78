!> Machine code of kernels: it gives the interpreter's bits, whatever the registers, and is not refused where it can be made.
module test_code
    use linkdyn_block, only: program_type, block_space, make_program, free_program, make_space, free_space, block_lanes, &
        run_block, run_single, gather, scatter, gather_single, scatter_single, forms_multiply_adds
    use linkdyn_code, only: choose_code, code_in_use, code_name
    use linkdyn_kernel, only: kernel_type, compile_kernel
    use linkdyn_kinds, only: wp
    use linkdyn_operation, only: op_add, op_subtract, op_multiply, op_reciprocal, op_root, op_arctangent, op_minimum, &
        op_maximum, op_absolute, op_select, op_whole
    use linkdyn_random_record, only: number, random_record
    use linkdyn_record, only: record_type, open_record, close_record
    use linkdyn_status, only: status_type
    use linkdyn_testing, only: test_error, unit_test, new_test, check
    use linkdyn_value, only: value
    implicit none (type, external)
    private
    public :: collect_code

contains

    subroutine collect_code(tests)
        type(unit_test), allocatable, intent(out) :: tests(:)

        tests = [new_test("code of every kind gives the interpreter's bits", test_bits), &
                 new_test("many values at a time, more than registers", test_pressure), &
                 new_test("an unknown name is refused", test_names)]
    end subroutine collect_code

    subroutine test_bits(error)
        type(test_error), intent(inout) :: error
        integer, parameter :: kinds(13) = [op_add, op_subtract, op_multiply, op_multiply, op_add, op_reciprocal, op_root, &
                                           op_minimum, op_maximum, op_absolute, op_select, op_whole, op_arctangent]
        integer :: seed

        do seed = 1, 12
            call compare_codes(error, seed, 6, 15*seed, kinds, 12)
        end do
    end subroutine test_bits

    subroutine test_pressure(error)
        type(test_error), intent(inout) :: error
        integer, parameter :: sums(4) = [op_add, op_subtract, op_multiply, op_multiply]

        call compare_codes(error, 1, 60, 900, sums, 150)
        call compare_codes(error, 2, 90, 500, [sums, op_select, op_maximum], 40)
    end subroutine test_pressure

    subroutine test_names(error)
        type(test_error), intent(inout) :: error
        type(status_type) :: status

        call choose_code("avx1024", status)
        call check(error, .not. status%is_ok(), "avx1024 is accepted")
        call check(error, index(status%message, "'avx1024'") > 0, "the message does not name it")
        call choose_code("", status)
        call check(error, status%is_ok(), "a choice cannot be taken back")
    end subroutine test_names

    !> The same kernel run as every kind of code.
    subroutine compare_codes(error, seed, n_input, n_step, kinds, n_output)
        type(test_error), intent(inout) :: error
        integer, intent(in) :: seed, n_input, n_step, kinds(:), n_output
        type(record_type), target :: record
        type(value) :: x(n_input)
        type(value), allocatable :: output(:)
        type(kernel_type) :: kernel
        type(status_type) :: status
        real(wp), allocatable :: given(:, :), want(:, :), got(:, :)
        integer :: c, i, k

        allocate (given(n_input, block_lanes()))
        do i = 1, size(given, 2)
            do k = 1, n_input
                given(k, i) = 3*number(1000*i + k + seed)
            end do
        end do
        call open_record(record, 2)
        call random_record(seed, n_input, n_step, kinds, x, output, n_output)
        call compile_kernel(record, output, forms_multiply_adds(), kernel, parts=[size(output) - 5, 2, 3])
        call close_record(record)
        do c = 1, size(code_name)
            call choose_code(trim(code_name(c)), status)
            call run_all(kernel, given, got)
            call check(error, .not. was_refused(code_in_use()), "code was refused: "//code_in_use())
            if (c == 1) want = got
            call check(error, all(got == want), trim(code_name(c))//" gives other bits than the interpreter")
        end do
        call choose_code("", status)
    end subroutine compare_codes

    !> It could not be made, though this build and this processor have machine code.
    pure logical function was_refused(told)
        character(len=*), intent(in) :: told

        was_refused = index(told, "(") > 0 .and. index(told, "(this build has no") == 0 &
                      .and. index(told, "(no machine code for") == 0
    end function was_refused

    !> A block, then each of its samples alone, then the first few as a block, behind each other.
    subroutine run_all(kernel, given, got)
        type(kernel_type), intent(in) :: kernel
        real(wp), intent(in) :: given(:, :)                !! (input, lane)
        real(wp), allocatable, intent(out) :: got(:, :)    !! (output, 2 lanes + few)
        integer, parameter :: few = 2
        type(program_type) :: program
        type(block_space) :: lanes, single
        logical :: is_bad(size(given, 2))
        integer :: n, g, last, i

        n = size(given, 2)
        allocate (got(kernel%n_output, 2*n + few))
        call make_program(kernel, program)
        call make_space(program, .false., lanes)
        call make_space(program, .true., single)
        call gather(given, size(given, 1), n, size(given, 1), 1, lanes)
        last = 0
        do g = 1, size(kernel%group_end)
            call run_block(program, g, lanes)
            call scatter(program, lanes, last + 1, kernel%group_end(g) - last, got(last + 1, 1), kernel%n_output, n, is_bad)
            last = kernel%group_end(g)
        end do
        do i = 1, n
            call gather_single(given(:, i), 1, single)
            last = 0
            do g = 1, size(kernel%group_end)
                call run_single(program, g, single)
                call scatter_single(program, single, last + 1, got(last + 1:kernel%group_end(g), n + i))
                last = kernel%group_end(g)
            end do
        end do
        last = 0
        do g = 1, size(kernel%group_end)
            call run_block(program, g, lanes, few)
            call scatter(program, lanes, last + 1, kernel%group_end(g) - last, got(last + 1, 2*n + 1), kernel%n_output, few, is_bad)
            last = kernel%group_end(g)
        end do
        call free_space(lanes)
        call free_space(single)
        call free_program(program)
    end subroutine run_all
end module test_code
