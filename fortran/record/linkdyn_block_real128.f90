!> Kernels run on blocks of samples, here one after the other by the reference interpreter, in quadruple precision. Twin of
!> linkdyn_block_real64.f90.
module linkdyn_block
    use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
    use linkdyn_interpreter, only: run_steps
    use linkdyn_kernel, only: kernel_type
    use linkdyn_kinds, only: wp
    implicit none (type, external)
    private
    public :: program_type, block_space, make_program, free_program, make_space, free_space
    public :: block_lanes, forms_multiply_adds, run_block, run_single, gather, expect, scatter, gather_single, scatter_single
    public :: put_lanes, take_lanes, put_columns, take_columns, hand_on, hand_inputs_on

    integer, parameter :: lanes = 8

    !> A kernel in the form that runs. Constant: threads share it.
    type :: program_type
        integer :: n_input = 0
        integer :: n_output = 0
        integer, allocatable :: group_end(:)               !! (group) its last output; they are made one after the other
        type(kernel_type), private :: kernel = kernel_type()
    end type program_type

    !> Slots of one thread.
    type :: block_space
        real(wp), pointer, contiguous :: slot(:, :) => null()    !! (slot, lane); slot 0: of operands that are not there
    end type block_space

contains

    !> Samples side by side in a block.
    pure integer function block_lanes()
        block_lanes = lanes
    end function block_lanes

    !> Does this machine round a product and a sum once?
    pure logical function forms_multiply_adds()
        forms_multiply_adds = .false.
    end function forms_multiply_adds

    subroutine make_program(kernel, program)
        type(kernel_type), intent(in) :: kernel
        type(program_type), intent(out) :: program

        program%n_input = kernel%n_input
        program%n_output = kernel%n_output
        program%group_end = kernel%group_end
        program%kernel = kernel
    end subroutine make_program

    subroutine free_program(program)
        type(program_type), intent(inout) :: program

        program = program_type()
    end subroutine free_program

    !> Slots for blocks, or for single samples.
    subroutine make_space(program, is_single, space)
        type(program_type), intent(in) :: program
        logical, intent(in) :: is_single
        type(block_space), intent(out) :: space
        integer :: first

        associate (kernel => program%kernel)
            allocate (space%slot(0:kernel%n_slot, merge(1, lanes, is_single)), source=0.0_wp)
            first = kernel%n_input + 1
            space%slot(first:first + kernel%n_constant - 1, :) = spread(kernel%constant, 2, size(space%slot, 2))
        end associate
    end subroutine make_space

    subroutine free_space(space)
        type(block_space), intent(inout) :: space

        if (associated(space%slot)) deallocate (space%slot)
    end subroutine free_space

    !> Make the outputs of one group; they must be taken before the next one is made.
    subroutine run_block(program, group, space, count)
        type(program_type), intent(in) :: program
        integer, intent(in) :: group
        type(block_space), intent(in) :: space
        integer, intent(in), optional :: count         !! lanes that are wanted, from the first; absent: all
        integer :: lane, first, last

        last = size(space%slot, 2)
        if (present(count)) last = count
        first = 1
        if (group > 1) first = program%kernel%step_end(group - 1) + 1
        do lane = 1, last
            call run_steps(program%kernel, first, program%kernel%step_end(group), space%slot(:, lane))
        end do
    end subroutine run_block

    subroutine run_single(program, group, space)
        type(program_type), intent(in) :: program
        integer, intent(in) :: group
        type(block_space), intent(in) :: space

        call run_block(program, group, space)
    end subroutine run_single

    !> `count` samples of n numbers, `stride` apart, to the inputs from `first` on; lanes beyond are wanted by nobody.
    subroutine gather(source, stride, count, n, first, space)
        real(wp), intent(in) :: source(*)
        integer, intent(in) :: stride, count, n, first
        type(block_space), intent(in) :: space
        integer :: lane, at

        do lane = 1, count
            at = stride*(lane - 1)
            space%slot(first:first + n - 1, lane) = source(at + 1:at + n)
        end do
    end subroutine gather

    !> That numbers will soon be written: nothing here waits for the memory.
    subroutine expect(target, stride, n, count)
        real(wp), intent(in) :: target(*)
        integer, intent(in) :: stride, n, count
    end subroutine expect

    !> Outputs first, ..., first + n - 1 to `count` samples; says in which of them a number is not finite.
    subroutine scatter(program, space, first, n, target, stride, count, is_bad)
        type(program_type), intent(in) :: program
        type(block_space), intent(in) :: space
        integer, intent(in) :: first, n, stride, count
        real(wp), intent(inout) :: target(*)
        logical, intent(inout) :: is_bad(:)            !! (count) set where a number is not finite
        integer :: lane, k

        do lane = 1, count
            do k = 1, n
                target(stride*(lane - 1) + k) = output_of(program%kernel, first + k - 1, space%slot(:, lane))
            end do
            if (.not. all(ieee_is_finite(target(stride*(lane - 1) + 1:stride*(lane - 1) + n)))) is_bad(lane) = .true.
        end do
    end subroutine scatter

    pure real(wp) function output_of(kernel, k, slot)
        type(kernel_type), intent(in) :: kernel
        integer, intent(in) :: k
        real(wp), intent(in) :: slot(0:)

        output_of = kernel%output_sign(k)*slot(kernel%output_slot(k))
    end function output_of

    subroutine gather_single(source, first, space)
        real(wp), intent(in) :: source(:)
        integer, intent(in) :: first
        type(block_space), intent(in) :: space

        space%slot(first:first + size(source) - 1, 1) = source
    end subroutine gather_single

    subroutine scatter_single(program, space, first, target)
        type(program_type), intent(in) :: program
        type(block_space), intent(in) :: space
        integer, intent(in) :: first
        real(wp), intent(out) :: target(:)
        integer :: k

        do k = 1, size(target)
            target(k) = output_of(program%kernel, first + k - 1, space%slot(:, 1))
        end do
    end subroutine scatter_single

    !> One number of n samples that stand side by side to an input; further lanes repeat the last.
    subroutine put_lanes(n, x, input, space)
        integer, intent(in) :: n                       !! no more than there are lanes
        real(wp), intent(in) :: x(n)
        integer, intent(in) :: input
        type(block_space), intent(in) :: space

        space%slot(input, :n) = x
        space%slot(input, n + 1:) = x(n)
    end subroutine put_lanes

    !> One output of samples that stand side by side.
    subroutine take_lanes(program, space, output, n, x)
        type(program_type), intent(in) :: program
        type(block_space), intent(in) :: space
        integer, intent(in) :: output
        integer, intent(in) :: n                       !! samples, no more than there are lanes
        real(wp), intent(out) :: x(n)
        integer :: lane

        do lane = 1, n
            x(lane) = output_of(program%kernel, output, space%slot(:, lane))
        end do
    end subroutine take_lanes

    !> The same of m numbers, to the inputs from `first` on.
    subroutine put_columns(n, stride, x, m, first, space)
        integer, intent(in) :: n, stride, m, first
        real(wp), intent(in) :: x(stride, *)           !! (n or more, m)
        type(block_space), intent(in) :: space
        integer :: k

        do k = 1, m
            call put_lanes(n, x(1, k), first + k - 1, space)
        end do
    end subroutine put_columns

    !> Outputs first, ..., first + m - 1 of n samples that stand side by side; says in which of them a number is not finite.
    subroutine take_columns(program, space, first, m, n, stride, x, is_bad)
        type(program_type), intent(in) :: program
        type(block_space), intent(in) :: space
        integer, intent(in) :: first, m, n, stride
        real(wp), intent(inout) :: x(stride, *)        !! (n or more, m)
        logical, intent(inout) :: is_bad(:)            !! (n) set where a number is not finite
        integer :: k

        do k = 1, m
            call take_lanes(program, space, first + k - 1, n, x(1, k))
            is_bad(:n) = is_bad(:n) .or. .not. ieee_is_finite(x(:n, k))
        end do
    end subroutine take_columns

    !> Outputs first, ..., first + m - 1 of all lanes, straight to another program's inputs from `input` on.
    subroutine hand_on(program, space, first, m, input, next)
        type(program_type), intent(in) :: program
        type(block_space), intent(in) :: space, next
        integer, intent(in) :: first, m, input
        integer :: k, lane

        do lane = 1, lanes
            do k = 1, m
                next%slot(input + k - 1, lane) = output_of(program%kernel, first + k - 1, space%slot(:, lane))
            end do
        end do
    end subroutine hand_on

    !> Inputs first, ..., first + m - 1, which stay, to those of another program from `input` on.
    subroutine hand_inputs_on(space, first, m, input, next)
        type(block_space), intent(in) :: space, next
        integer, intent(in) :: first, m, input

        next%slot(input:input + m - 1, :) = space%slot(first:first + m - 1, :)
    end subroutine hand_inputs_on
end module linkdyn_block
