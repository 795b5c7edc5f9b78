!> A kernel of a scene, ready to run on samples: blocks of arrays go in, blocks of arrays come out.
module linkdyn_scene_program
    use linkdyn_block, only: program_type, block_space, make_program, free_program, make_space, free_space, &
        forms_multiply_adds, block_lanes, run_block, run_single, gather, expect, scatter, gather_single, scatter_single, &
        put_columns, take_columns, hand_on, hand_inputs_on
    use linkdyn_inputs, only: input_blocks, n_block, in_found
    use linkdyn_kernel, only: kernel_type, compile_kernel
    use linkdyn_kinds, only: wp
    use linkdyn_record, only: record_type
    use linkdyn_value, only: value
    implicit none (type, external)
    private
    public :: scene_program, sample_arrays, output_list, add_output, make_scene_program, free_scene_program
    public :: load_samples, load_block, run_samples, output_target, goes_to, has_output, program_space, free_program_space
    public :: run_one_sample, load_one_sample, run_loaded_one
    public :: load_columns, run_columns, run_ahead, hand_found_on, most_lanes
    public :: input_wiring, column_list, wire_inputs, run_wired

    integer, parameter :: most_lanes = 64              !! bits that tell which samples of a block are not finite

    !> Values that a program gives, sorted by what they are.
    type :: output_list
        integer, allocatable :: id(:)                  !! who they belong to, one a segment
        integer, allocatable :: n(:)                   !! how many of them
        type(value), allocatable :: v(:)
    end type output_list

    !> Numbers of a block that stand side by side among the inputs.
    type :: input_segment
        integer :: block = 0
        integer :: first = 0                           !! in the block
        integer :: n = 0
        integer :: slot = 0                            !! of the first, among the inputs
    end type input_segment

    !> Numbers of a block that somebody else has in columns.
    type :: column_list
        integer, allocatable :: of(:)                  !! column of each number; 0: it is in the arrays of samples. Not allocated:
                                                       !! all are
    end type column_list

    !> From where inputs come.
    type :: input_wiring
        type(input_segment), allocatable, private :: row(:)    !! from the arrays of samples
        type(input_segment), allocatable, private :: column(:) !! from columns: `first` is one of these
    end type input_wiring

    type :: scene_program
        type(program_type) :: program
        type(input_segment), allocatable :: input(:)
        integer, allocatable :: id(:), first(:), n(:)  !! of the outputs; parts of one may be wanted alone: these stand one after
                                                       !! the other
        integer :: n_found = 0, first_found = 0        !! numbers of block `in_found`, which stand side by side among the inputs
        type(kernel_type) :: kernel                    !! for whoever wants to read it
        logical :: is_made = .false.
    end type scene_program

    type :: array_pointer
        real(wp), pointer, contiguous :: x(:, :) => null()    !! (number of the block, sample); one sample serves all
        integer :: before = 0                          !! samples of the batch before the first one that is here
    end type array_pointer

    !> Where the blocks of the samples are.
    type :: sample_arrays
        type(array_pointer) :: of(n_block)
    end type sample_arrays

    !> Where the values of one output go.
    type :: output_target
        integer :: id = 0
        real(wp), pointer, contiguous :: x(:, :) => null()    !! (value, sample)
        logical :: is_of_block = .false.               !! a block's samples begin at the first; false: all samples have a place
    end type output_target

    !> Slots of one thread for one program.
    type :: program_space
        type(block_space) :: block
        integer :: lanes = 0                           !! 0: not made yet
        integer :: n_loaded = 0                        !! samples whose inputs from arrays are still there
    end type program_space

contains

    subroutine add_output(list, id, v)
        type(output_list), intent(inout) :: list
        integer, intent(in) :: id
        type(value), intent(in) :: v(:)

        if (.not. allocated(list%v)) allocate (list%id(0), list%n(0), list%v(0))
        list%id = [list%id, id]
        list%n = [list%n, size(v)]
        list%v = [list%v, v]
    end subroutine add_output

    !> Compile an open record. Values that another program has found come in as block `in_found`.
    subroutine make_scene_program(record, in, out, program, found)
        type(record_type), intent(in) :: record
        type(input_blocks), intent(in) :: in
        type(output_list), intent(in) :: out
        type(scene_program), intent(inout) :: program
        integer, intent(in), optional :: found(:)      !! nodes
        integer :: b, k

        call free_scene_program(program)
        call compile_kernel(record, out%v, forms_multiply_adds(), program%kernel, found, out%n)
        call make_program(program%kernel, program%program)
        allocate (program%input(0))
        do b = 1, n_block
            if (.not. allocated(in%of(b)%which)) cycle
            do k = 1, size(in%of(b)%which)
                call add_input(b, in%of(b)%which(k), in%of(b)%first + k - 1)
            end do
        end do
        if (present(found)) then
            program%n_found = size(found)
            program%first_found = record%n_input + 1
            do k = 1, size(found)
                call add_input(in_found, k, record%n_input + k)
            end do
        end if
        program%id = out%id
        program%n = out%n
        program%first = [(1 + sum(out%n(:k - 1)), k=1, size(out%n))]
        program%is_made = .true.

    contains

        subroutine add_input(block, place, slot)
            integer, intent(in) :: block, place, slot

            if (program%kernel%uses(slot)) call add_segment(block, place, slot, program%input)
        end subroutine add_input
    end subroutine make_scene_program

    !> One more number; beside the last one, if that is its neighbour.
    pure subroutine add_segment(block, place, slot, segment)
        integer, intent(in) :: block, place, slot
        type(input_segment), allocatable, intent(inout) :: segment(:)
        integer :: last

        last = size(segment)
        if (last > 0) then
            associate (s => segment(last))
                if (s%block == block .and. s%first + s%n == place .and. s%slot + s%n == slot) then
                    s%n = s%n + 1
                    return
                end if
            end associate
        end if
        segment = [segment, input_segment(block, place, 1, slot)]
    end subroutine add_segment

    !> Which inputs come from columns, (sample, column), that somebody else has them in.
    pure subroutine wire_inputs(program, column, wiring)
        type(scene_program), intent(in) :: program
        type(column_list), intent(in) :: column(n_block)
        type(input_wiring), intent(out) :: wiring
        integer :: k, i, place

        allocate (wiring%row(0), wiring%column(0))
        do k = 1, size(program%input)
            associate (s => program%input(k))
                do i = 0, s%n - 1
                    place = 0
                    if (allocated(column(s%block)%of)) place = column(s%block)%of(s%first + i)
                    if (place > 0) then
                        call add_segment(0, place, s%slot + i, wiring%column)
                    else
                        call add_segment(s%block, s%first + i, s%slot + i, wiring%row)
                    end if
                end do
            end associate
        end do
    end subroutine wire_inputs

    subroutine free_scene_program(program)
        type(scene_program), intent(inout) :: program

        if (program%is_made) call free_program(program%program)
        program%is_made = .false.
        if (allocated(program%input)) deallocate (program%input)
    end subroutine free_scene_program

    !> Room for a block of samples, from whoever comes first.
    subroutine need_block(program, space)
        type(scene_program), intent(in) :: program
        type(program_space), intent(inout) :: space

        if (space%lanes > 0) return
        call make_space(program%program, .false., space%block)
        space%lanes = block_lanes()
    end subroutine need_block

    !> Samples first, ..., first + count - 1 of the arrays to the slots.
    subroutine load_samples(program, arrays, first, count, space, without)
        type(scene_program), intent(in) :: program
        type(sample_arrays), intent(in) :: arrays
        integer, intent(in) :: first, count
        type(program_space), intent(inout) :: space
        integer, intent(in), optional :: without(:)    !! blocks that come otherwise
        integer :: k

        call need_block(program, space)
        do k = 1, size(program%input)
            if (present(without)) then
                if (any(without == program%input(k)%block)) cycle
            end if
            call load_segment(program%input(k), arrays, first, count, space)
        end do
    end subroutine load_samples

    !> One block of inputs, of which the first `count` samples lie in columns.
    subroutine load_block(program, block, stride, columns, count, space)
        type(scene_program), intent(in) :: program
        integer, intent(in) :: block                   !! one of `in_*`
        integer, intent(in) :: stride                  !! from one column to the next
        real(wp), intent(in) :: columns(stride, *)     !! (sample, number of the block)
        integer, intent(in) :: count
        type(program_space), intent(inout) :: space
        integer :: k

        call need_block(program, space)
        do k = 1, size(program%input)
            associate (s => program%input(k))
                if (s%block == block) &
                    call put_columns(count, stride, columns(1, s%first), s%n, s%slot, space%block)
            end associate
        end do
    end subroutine load_block

    subroutine load_segment(segment, arrays, first, count, space)
        type(input_segment), intent(in) :: segment
        type(sample_arrays), intent(in) :: arrays
        integer, intent(in) :: first, count
        type(program_space), intent(in) :: space

        associate (s => segment, x => arrays%of(segment%block)%x, before => arrays%of(segment%block)%before)
            if (size(x, 2) == 1) then
                call gather(x(s%first, 1), 0, count, s%n, s%slot, space%block)
            else
                call gather(x(s%first, first - before), size(x, 1), count, s%n, s%slot, space%block)
            end if
        end associate
    end subroutine load_segment

    subroutine free_program_space(space)
        type(program_space), intent(inout) :: space

        if (space%lanes > 0) call free_space(space%block)
        space%lanes = 0
    end subroutine free_program_space

    !> Which of the outputs an id is; 0: none.
    pure integer function has_output(program, id)
        type(scene_program), intent(in) :: program
        integer, intent(in) :: id

        has_output = findloc(program%id, id, dim=1)
    end function has_output

    !> Where one output goes, by its id.
    function goes_to(id, x, is_of_block) result(target)
        integer, intent(in) :: id
        real(wp), intent(in), target, contiguous :: x(:, :)    !! (value, sample)
        logical, intent(in), optional :: is_of_block           !! scratch of one block; absent: of all samples
        type(output_target) :: target

        target%id = id
        target%x => x
        if (present(is_of_block)) target%is_of_block = is_of_block
    end function goes_to

    !> Run the loaded samples first, ..., first + count - 1; outputs go where they are wanted as soon as they are there. Says in
    !> which samples one of these is not finite.
    subroutine run_samples(program, space, first, count, target, is_bad)
        type(scene_program), intent(in) :: program
        type(program_space), intent(in) :: space
        integer, intent(in) :: first, count
        type(output_target), intent(in) :: target(:)   !! those of other programs do not matter
        logical, intent(inout), optional :: is_bad(:)  !! (count) set where a number is not finite
        logical :: not_finite(most_lanes)
        integer :: g, k, t, begin, n, column

        not_finite(:count) = .false.
        k = 1
        begin = 1
        do g = 1, size(program%program%group_end)
            call find_group(program, g, begin, k, n)
            do t = 1, size(target)
                if (target(t)%id == program%id(k)) exit
            end do
            if (t > size(target)) then                 ! nobody wants it
                call run_block(program%program, g, space%block, count)
            else
                column = merge(1, first, target(t)%is_of_block)
                associate (x => target(t)%x, k1 => begin - program%first(has_output(program, program%id(k))) + 1)
                    if (.not. target(t)%is_of_block) call expect(x(k1, column), size(x, 1), n, count)
                    call run_block(program%program, g, space%block, count)
                    call scatter(program%program, space%block, begin, n, x(k1, column), size(x, 1), count, not_finite)
                end associate
            end if
            begin = begin + n
        end do
        if (present(is_bad)) is_bad(:count) = is_bad(:count) .or. not_finite(:count)
    end subroutine run_samples

    !> The output k that group g is of, from that of the group before on, and how many of its numbers the group finds.
    pure subroutine find_group(program, g, begin, k, n)
        type(scene_program), intent(in) :: program
        integer, intent(in) :: g
        integer, intent(in) :: begin                   !! first number of the group
        integer, intent(inout) :: k
        integer, intent(out) :: n

        do while (program%first(k) + program%n(k) <= begin)
            k = k + 1
        end do
        n = program%program%group_end(g) - begin + 1
    end subroutine find_group

    !> Samples first, ..., first + count - 1 of arrays (sample, number of the block) to the slots.
    subroutine load_columns(program, arrays, first, count, space)
        type(scene_program), intent(in) :: program
        type(sample_arrays), intent(in) :: arrays
        integer, intent(in) :: first, count
        type(program_space), intent(inout) :: space
        integer :: k

        call need_block(program, space)
        do k = 1, size(program%input)
            associate (s => program%input(k), x => arrays%of(program%input(k)%block)%x)
                call put_columns(count, size(x, 1), x(first, s%first), s%n, s%slot, space%block)
            end associate
        end do
    end subroutine load_columns

    !> Run them, as far as outputs are wanted; these go to arrays (sample, value). Says in which samples one is not finite.
    subroutine run_columns(program, space, first, count, target, is_bad)
        type(scene_program), intent(in) :: program
        type(program_space), intent(in) :: space
        integer, intent(in) :: first, count
        type(output_target), intent(in) :: target(:)
        logical, intent(out) :: is_bad(:)              !! (count)
        integer :: g, k, t, begin, n, row, n_wanted

        n_wanted = 0
        do t = 1, size(target)
            k = has_output(program, target(t)%id)
            if (k > 0) n_wanted = max(n_wanted, program%first(k) + program%n(k) - 1)
        end do
        is_bad = .false.
        k = 1
        begin = 1
        do g = 1, size(program%program%group_end)
            if (begin > n_wanted) exit
            call find_group(program, g, begin, k, n)
            call run_block(program%program, g, space%block, count)
            do t = 1, size(target)
                if (target(t)%id /= program%id(k)) cycle
                row = merge(1, first, target(t)%is_of_block)
                associate (x => target(t)%x)
                    call take_columns(program%program, space%block, begin, n, count, size(x, 1), &
                                      x(row, begin - program%first(k) + 1), is_bad)
                end associate
                exit
            end do
            begin = begin + n
        end do
    end subroutine run_columns

    !> Run the loaded samples. What one output finds goes straight to another program, as all of its inputs `in_found`; a second
    !> output goes to columns of the block.
    subroutine run_ahead(program, space, count, id, next, next_space, target)
        type(scene_program), intent(in) :: program, next
        type(program_space), intent(in) :: space
        integer, intent(in) :: count
        integer, intent(in) :: id                      !! of the first
        type(program_space), intent(inout) :: next_space
        type(output_target), intent(in) :: target      !! of the second
        logical :: is_bad(most_lanes)                  !! of no matter here
        integer :: g, k, begin, n

        call need_block(next, next_space)
        k = 1
        begin = 1
        do g = 1, size(program%program%group_end)
            call find_group(program, g, begin, k, n)
            call run_block(program%program, g, space%block, count)
            if (program%id(k) == id) then
                call hand_on(program%program, space%block, begin, n, next%first_found + begin - program%first(k), next_space%block)
            else if (program%id(k) == target%id) then
                associate (x => target%x)
                    call take_columns(program%program, space%block, begin, n, count, size(x, 1), &
                                      x(1, begin - program%first(k) + 1), is_bad(:count))
                end associate
            end if
            begin = begin + n
        end do
    end subroutine run_ahead

    !> Inputs `in_found` of one program to another, which has the same.
    subroutine hand_found_on(program, space, next, next_space)
        type(scene_program), intent(in) :: program, next
        type(program_space), intent(in) :: space
        type(program_space), intent(inout) :: next_space

        call need_block(next, next_space)
        call hand_inputs_on(space%block, program%first_found, program%n_found, next%first_found, next_space%block)
    end subroutine hand_found_on

    !> The first sample of the arrays alone, which takes a part of what a block takes. All outputs come in their order.
    subroutine run_one_sample(program, arrays, space, output)
        type(scene_program), intent(in) :: program
        type(sample_arrays), intent(in) :: arrays
        type(program_space), intent(inout) :: space    !! for single samples only
        real(wp), intent(out) :: output(:)             !! (value)

        call load_one_sample(program, arrays, space)
        call run_loaded_one(program, space, output)
    end subroutine run_one_sample

    !> The first sample of the arrays to the slots; of one block only, if the others are there already.
    subroutine load_one_sample(program, arrays, space, only_block)
        type(scene_program), intent(in) :: program
        type(sample_arrays), intent(in) :: arrays
        type(program_space), intent(inout) :: space    !! for single samples only
        integer, intent(in), optional :: only_block    !! one of `in_*`
        integer :: k

        call need_single(program, space)
        do k = 1, size(program%input)
            if (present(only_block)) then
                if (program%input(k)%block /= only_block) cycle
            end if
            call load_single(program%input(k), arrays, space)
        end do
    end subroutine load_one_sample

    !> Room for single samples, from whoever comes first.
    subroutine need_single(program, space)
        type(scene_program), intent(in) :: program
        type(program_space), intent(inout) :: space

        if (space%lanes > 0) return
        call make_space(program%program, .true., space%block)
        space%lanes = 1
    end subroutine need_single

    subroutine load_single(segment, arrays, space)
        type(input_segment), intent(in) :: segment
        type(sample_arrays), intent(in) :: arrays
        type(program_space), intent(in) :: space

        associate (s => segment)
            call gather_single(arrays%of(s%block)%x(s%first:s%first + s%n - 1, 1), s%slot, space%block)
        end associate
    end subroutine load_single

    !> The sample in the slots. As many outputs as there is room for come in their order.
    subroutine run_loaded_one(program, space, output)
        type(scene_program), intent(in) :: program
        type(program_space), intent(in) :: space
        real(wp), intent(out) :: output(:)             !! (value)
        integer :: g, first

        first = 1
        do g = 1, size(program%program%group_end)
            if (first > size(output)) exit
            call run_single(program%program, g, space%block)
            call scatter_single(program%program, space%block, first, output(first:program%program%group_end(g)))
            first = program%program%group_end(g) + 1
        end do
    end subroutine run_loaded_one

    !> The first n samples, of which a part of the inputs lies in columns; outputs go to columns, too, in their order. One sample
    !> alone takes a part of what a block takes. Says in which further samples a number is not finite.
    subroutine run_wired(program, wiring, arrays, are_new, stride, columns, n, one, block, room, n_value, found, is_bad)
        type(scene_program), intent(in) :: program
        type(input_wiring), intent(in) :: wiring
        type(sample_arrays), intent(in) :: arrays
        logical, intent(in) :: are_new                 !! arrays; false: they are as they were, and the slots keep what came from
                                                       !! them
        integer, intent(in) :: stride                  !! from one column to the next
        real(wp), intent(in) :: columns(stride, *)     !! (sample, column)
        integer, intent(in) :: n
        type(program_space), intent(inout) :: one, block
        integer, intent(in) :: room                    !! for samples: from one value to the next
        integer, intent(in) :: n_value                 !! wanted, of the first outputs
        real(wp), intent(inout) :: found(room, n_value)        !! (sample, value)
        logical, intent(inout) :: is_bad(:)            !! (sample)
        integer :: k

        if (are_new) then
            one%n_loaded = 0
            block%n_loaded = 0
        end if
        if (n == 1) then
            call run_alone()
        else
            call run_blocks()
        end if

    contains

        subroutine run_alone()
            if (one%n_loaded == 0) then
                call need_single(program, one)
                do k = 1, size(wiring%row)
                    call load_single(wiring%row(k), arrays, one)
                end do
                one%n_loaded = 1
            end if
            call put(1, 1, one)
            call run_loaded_one(program, one, found(1, :))
            is_bad(1) = is_bad(1) .or. .not. sum(abs(found(1, :))) <= huge(1.0_wp)
        end subroutine run_alone

        subroutine run_blocks()
            integer :: first, count

            call need_block(program, block)
            do first = 1, n, block%lanes
                count = min(block%lanes, n - first + 1)
                if (block%n_loaded /= n) then
                    do k = 1, size(wiring%row)
                        call load_segment(wiring%row(k), arrays, first, count, block)
                    end do
                end if
                call put(first, count, block)
                call run_groups(first, count)
            end do
            block%n_loaded = merge(n, 0, n <= block%lanes)
        end subroutine run_blocks

        subroutine put(first, count, space)
            integer, intent(in) :: first, count
            type(program_space), intent(in) :: space

            do k = 1, size(wiring%column)
                associate (s => wiring%column(k))
                    call put_columns(count, stride, columns(first, s%first), s%n, s%slot, space%block)
                end associate
            end do
        end subroutine put

        subroutine run_groups(first, count)
            integer, intent(in) :: first, count
            integer :: g, begin

            begin = 1
            do g = 1, size(program%program%group_end)
                if (begin > n_value) exit
                associate (end => program%program%group_end(g))
                    call run_block(program%program, g, block%block, count)
                    call take_columns(program%program, block%block, begin, end - begin + 1, count, room, &
                                      found(first, begin), is_bad(first:first + count - 1))
                    begin = end + 1
                end associate
            end do
        end subroutine run_groups
    end subroutine run_wired
end module linkdyn_scene_program
