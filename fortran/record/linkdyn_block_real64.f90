!> Kernels run on blocks of samples side by side, by the interpreters in `c/linkdyn_lanes.c`. Twin of
!> linkdyn_block_real128.f90.
module linkdyn_block
    use, intrinsic :: iso_c_binding, only: c_ptr, c_null_ptr, c_int, c_int32_t, c_int64_t, c_long, c_double, c_f_pointer
    use linkdyn_kernel, only: kernel_type
    use linkdyn_kinds, only: wp
    use linkdyn_piecewise, only: packed, curve_of, which_of
    implicit none (type, external)
    private
    public :: program_type, block_space, make_program, free_program, make_space, free_space
    public :: block_lanes, forms_multiply_adds, run_block, run_single, gather, expect, scatter, gather_single, scatter_single
    public :: put_lanes, take_lanes, put_columns, take_columns, hand_on, hand_inputs_on

    !> A kernel in the form that runs. Constant: threads share it.
    type :: program_type
        integer :: n_input = 0
        integer :: n_output = 0
        integer(c_int32_t), allocatable :: output_slot(:)  !! (output) counted from 0
        integer(c_int32_t), allocatable :: output_sign(:)
        integer(c_int32_t), allocatable :: group_end(:)    !! (group) its last output; they are made one after the other
        type(c_ptr), private :: packed = c_null_ptr
        integer, private :: n_slot = 0
    end type program_type

    !> Slots of one thread.
    type :: block_space
        real(wp), pointer, contiguous :: slot(:, :) => null()    !! (lane, slot counted from 0)
        type(c_ptr), private :: memory = c_null_ptr
    end type block_space

    interface
        function machine_lanes() bind(c, name="linkdyn_machine_lanes") result(n)
            import :: c_int
            integer(c_int) :: n
        end function machine_lanes

        function machine_fuses() bind(c, name="linkdyn_machine_fuses") result(fuses)
            import :: c_int
            integer(c_int) :: fuses
        end function machine_fuses

        function pack_kernel(n_step, step, output, n_group, output_end, step_end, n_slot, first_constant, n_constant, constant, &
                             n_table, table) &
            bind(c, name="linkdyn_pack") result(packed)
            import :: c_int, c_int32_t, c_double, c_ptr
            integer(c_int), value :: n_step, n_group, n_slot, first_constant, n_constant, n_table
            integer(c_int32_t), intent(in) :: step(7, *), output(*), output_end(*), step_end(*)
            real(c_double), intent(in) :: constant(*), table(*)
            type(c_ptr) :: packed
        end function pack_kernel

        subroutine unpack(packed) bind(c, name="linkdyn_unpack")
            import :: c_ptr
            type(c_ptr), value :: packed
        end subroutine unpack

        function make_slots(packed, one) bind(c, name="linkdyn_make_slots") result(slot)
            import :: c_ptr, c_int
            type(c_ptr), value :: packed
            integer(c_int), value :: one
            type(c_ptr) :: slot
        end function make_slots

        subroutine free_slots(slot) bind(c, name="linkdyn_free_slots")
            import :: c_ptr
            type(c_ptr), value :: slot
        end subroutine free_slots

        subroutine run_lanes(packed, group, slot, count) bind(c, name="linkdyn_run_lanes")
            import :: c_ptr, c_int
            type(c_ptr), value :: packed, slot
            integer(c_int), value :: group, count
        end subroutine run_lanes

        subroutine run_one(packed, group, slot) bind(c, name="linkdyn_run_one")
            import :: c_ptr, c_int
            type(c_ptr), value :: packed, slot
            integer(c_int), value :: group
        end subroutine run_one

        subroutine gather_rows(source, ld, count, n, slot, first) bind(c, name="linkdyn_gather")
            import :: c_double, c_long, c_int, c_ptr
            real(c_double), intent(in) :: source(*)
            integer(c_long), value :: ld
            integer(c_int), value :: count, n, first
            type(c_ptr), value :: slot
        end subroutine gather_rows

        subroutine expect_rows(target, ld, n, count) bind(c, name="linkdyn_expect")
            import :: c_double, c_long, c_int
            real(c_double), intent(in) :: target(*)
            integer(c_long), value :: ld
            integer(c_int), value :: n, count
        end subroutine expect_rows

        function scatter_rows(slot, which, sign, n, target, ld, count) bind(c, name="linkdyn_scatter") result(bad)
            import :: c_double, c_long, c_int, c_int32_t, c_int64_t, c_ptr
            type(c_ptr), value :: slot
            integer(c_int32_t), intent(in) :: which(*), sign(*)
            integer(c_int), value :: n, count
            integer(c_long), value :: ld
            real(c_double), intent(inout) :: target(*)
            integer(c_int64_t) :: bad
        end function scatter_rows

        function scatter_columns(slot, which, sign, n, target, ld, count) bind(c, name="linkdyn_scatter_columns") result(bad)
            import :: c_double, c_long, c_int, c_int32_t, c_int64_t, c_ptr
            type(c_ptr), value :: slot
            integer(c_int32_t), intent(in) :: which(*), sign(*)
            integer(c_int), value :: n, count
            integer(c_long), value :: ld
            real(c_double), intent(inout) :: target(*)
            integer(c_int64_t) :: bad
        end function scatter_columns
    end interface

contains

    !> Samples side by side in a block.
    integer function block_lanes()
        block_lanes = machine_lanes()
    end function block_lanes

    !> Does this machine round a product and a sum once?
    logical function forms_multiply_adds()
        forms_multiply_adds = machine_fuses() /= 0
    end function forms_multiply_adds

    subroutine make_program(kernel, program)
        type(kernel_type), intent(in) :: kernel
        type(program_type), intent(out) :: program
        integer(c_int32_t) :: step(7, size(kernel%step))
        real(wp), allocatable :: table(:)
        integer :: k, first(size(kernel%curve))            ! of each curve in the table, counted from 0

        allocate (table(0))
        do k = 1, size(kernel%curve)
            first(k) = size(table)
            table = [table, packed(kernel%curve(k))]
        end do
        do k = 1, size(kernel%step)
            step(:, k) = [kernel%step(k)%kind, kernel%step(k)%result - 1, kernel%step(k)%operand - 1, 0, 0]
            if (kernel%step(k)%look > 0) step(6:, k) = [first(curve_of(kernel%step(k)%look)), which_of(kernel%step(k)%look)]
        end do
        program%n_input = kernel%n_input
        program%n_output = kernel%n_output
        program%n_slot = kernel%n_slot
        program%output_slot = kernel%output_slot - 1
        program%output_sign = kernel%output_sign
        program%group_end = kernel%group_end
        program%packed = pack_kernel(size(kernel%step), step, program%output_slot, size(kernel%group_end), program%group_end, &
                                     int(kernel%step_end, c_int32_t), kernel%n_slot, kernel%n_input, kernel%n_constant, &
                                     kernel%constant, size(table), table)
    end subroutine make_program

    subroutine free_program(program)
        type(program_type), intent(inout) :: program

        call unpack(program%packed)
        program%packed = c_null_ptr
    end subroutine free_program

    !> Slots for blocks, or for single samples.
    subroutine make_space(program, is_single, space)
        type(program_type), intent(in) :: program
        logical, intent(in) :: is_single
        type(block_space), intent(out) :: space
        real(wp), pointer, contiguous :: slot(:, :)
        integer :: lanes

        lanes = merge(1, block_lanes(), is_single)
        space%memory = make_slots(program%packed, merge(1_c_int, 0_c_int, is_single))
        call c_f_pointer(space%memory, slot, [lanes, program%n_slot])
        space%slot(1:lanes, 0:program%n_slot - 1) => slot
    end subroutine make_space

    subroutine free_space(space)
        type(block_space), intent(inout) :: space

        call free_slots(space%memory)
        space%memory = c_null_ptr
        space%slot => null()
    end subroutine free_space

    !> Make the outputs of one group; they must be taken before the next one is made.
    subroutine run_block(program, group, space, count)
        type(program_type), intent(in) :: program
        integer, intent(in) :: group
        type(block_space), intent(in) :: space
        integer, intent(in), optional :: count         !! lanes that are wanted, from the first; absent: all

        if (present(count)) then
            call run_lanes(program%packed, group - 1, space%memory, count)
        else
            call run_lanes(program%packed, group - 1, space%memory, size(space%slot, 1))
        end if
    end subroutine run_block

    subroutine run_single(program, group, space)
        type(program_type), intent(in) :: program
        integer, intent(in) :: group
        type(block_space), intent(in) :: space

        call run_one(program%packed, group - 1, space%memory)
    end subroutine run_single

    !> `count` samples of n numbers, `stride` apart, to the inputs from `first` on; lanes beyond are wanted by nobody.
    subroutine gather(source, stride, count, n, first, space)
        real(wp), intent(in) :: source(*)
        integer, intent(in) :: stride, count, n, first
        type(block_space), intent(in) :: space

        call gather_rows(source, int(stride, c_long), count, n, space%memory, first - 1)
    end subroutine gather

    !> That n numbers of `count` samples, `stride` apart, will soon be written: their lines of the cache are fetched meanwhile.
    subroutine expect(target, stride, n, count)
        real(wp), intent(in) :: target(*)
        integer, intent(in) :: stride, n, count

        call expect_rows(target, int(stride, c_long), n, count)
    end subroutine expect

    !> Outputs first, ..., first + n - 1 to `count` samples; says in which of them a number is not finite.
    subroutine scatter(program, space, first, n, target, stride, count, is_bad)
        type(program_type), intent(in) :: program
        type(block_space), intent(in) :: space
        integer, intent(in) :: first, n, stride, count
        real(wp), intent(inout) :: target(*)
        logical, intent(inout) :: is_bad(:)            !! (count) set where a number is not finite

        call note_bad(scatter_rows(space%memory, program%output_slot(first:), program%output_sign(first:), n, target, &
                                   int(stride, c_long), count), count, is_bad)
    end subroutine scatter

    pure subroutine note_bad(bad, n, is_bad)
        integer(c_int64_t), intent(in) :: bad          !! one bit a sample
        integer, intent(in) :: n                       !! samples
        logical, intent(inout) :: is_bad(:)
        integer :: lane

        if (bad == 0) return
        do lane = 1, n
            if (btest(bad, lane - 1)) is_bad(lane) = .true.
        end do
    end subroutine note_bad

    subroutine gather_single(source, first, space)
        real(wp), intent(in) :: source(:)
        integer, intent(in) :: first
        type(block_space), intent(in) :: space

        space%slot(1, first - 1:first + size(source) - 2) = source
    end subroutine gather_single

    subroutine scatter_single(program, space, first, target)
        type(program_type), intent(in) :: program
        type(block_space), intent(in) :: space
        integer, intent(in) :: first
        real(wp), intent(out) :: target(:)
        integer :: k

        do k = 1, size(target)
            target(k) = program%output_sign(first + k - 1)*space%slot(1, program%output_slot(first + k - 1))
        end do
    end subroutine scatter_single

    !> One number of n samples that stand side by side to an input; further lanes repeat the last.
    subroutine put_lanes(n, x, input, space)
        integer, intent(in) :: n                       !! no more than there are lanes
        real(wp), intent(in) :: x(n)
        integer, intent(in) :: input
        type(block_space), intent(in) :: space

        space%slot(:n, input - 1) = x
        space%slot(n + 1:, input - 1) = x(n)
    end subroutine put_lanes

    !> One output of samples that stand side by side.
    subroutine take_lanes(program, space, output, n, x)
        type(program_type), intent(in) :: program
        type(block_space), intent(in) :: space
        integer, intent(in) :: output
        integer, intent(in) :: n                       !! samples, no more than there are lanes
        real(wp), intent(out) :: x(n)

        x = program%output_sign(output)*space%slot(:n, program%output_slot(output))
    end subroutine take_lanes

    !> The same of m numbers, to the inputs from `first` on.
    subroutine put_columns(n, stride, x, m, first, space)
        integer, intent(in) :: n, stride, m, first
        real(wp), intent(in) :: x(stride, *)           !! (n or more, m)
        type(block_space), intent(in) :: space
        real(wp) :: last
        integer :: k, lane

        if (n == size(space%slot, 1) .and. n == stride) then       ! all of it in one piece
            associate (slot => space%slot)
                call copy_numbers(n*m, x, slot(1, first - 1))
            end associate
            return
        end if
        do k = 1, m
            do lane = 1, n
                space%slot(lane, first + k - 2) = x(lane, k)
            end do
            last = x(n, k)
            do lane = n + 1, size(space%slot, 1)
                space%slot(lane, first + k - 2) = last
            end do
        end do
    end subroutine put_columns

    !> Outputs first, ..., first + m - 1 of n samples that stand side by side; says in which of them a number is not finite.
    subroutine take_columns(program, space, first, m, n, stride, x, is_bad)
        type(program_type), intent(in) :: program
        type(block_space), intent(in) :: space
        integer, intent(in) :: first, m, n, stride
        real(wp), intent(inout) :: x(stride, *)        !! (n or more, m)
        logical, intent(inout) :: is_bad(:)            !! (n) set where a number is not finite

        call note_bad(scatter_columns(space%memory, program%output_slot(first:), program%output_sign(first:), m, x, &
                                      int(stride, c_long), n), n, is_bad)
    end subroutine take_columns

    !> Outputs first, ..., first + m - 1 of all lanes, straight to another program's inputs from `input` on.
    subroutine hand_on(program, space, first, m, input, next)
        type(program_type), intent(in) :: program
        type(block_space), intent(in) :: space, next
        integer, intent(in) :: first, m, input
        integer :: k

        do k = 1, m
            associate (from => space%slot, to => next%slot, k_out => first + k - 1)
                call copy_signed(size(from, 1), program%output_sign(k_out), from(1, program%output_slot(k_out)), &
                                 to(1, input + k - 2))
            end associate
        end do
    end subroutine hand_on

    !> Inputs first, ..., first + m - 1, which stay, to those of another program from `input` on.
    subroutine hand_inputs_on(space, first, m, input, next)
        type(block_space), intent(in) :: space, next
        integer, intent(in) :: first, m, input

        associate (from => space%slot, to => next%slot)
            call copy_numbers(size(from, 1)*m, from(1, first - 1), to(1, input - 1))
        end associate
    end subroutine hand_inputs_on

    !> Arrays of their own, so that the compiler need not ask whether they overlap.
    pure subroutine copy_numbers(n, from, to)
        integer, intent(in) :: n
        real(wp), intent(in) :: from(n)
        real(wp), intent(inout) :: to(n)

        to = from
    end subroutine copy_numbers

    pure subroutine copy_signed(n, sign, from, to)
        integer, intent(in) :: n
        integer(c_int32_t), intent(in) :: sign         !! 1 or -1
        real(wp), intent(in) :: from(n)
        real(wp), intent(inout) :: to(n)

        if (sign > 0) then
            to = from
        else
            to = -from
        end if
    end subroutine copy_signed
end module linkdyn_block
