!> A kernel: a record made ready to run, with its inputs, its outputs and instructions on slots.
!>
!> A slot holds one number a lane. The first slots are the inputs, then come the constants, then whatever the
!> instructions need at a time. Outputs are made in groups, in their order; whoever runs the kernel takes those of a group
!> when it is done, since later instructions use their slots again. A kernel is constant once it is compiled: threads share
!> it, each with slots of its own.
module linkdyn_kernel
    use linkdyn_kinds, only: wp
    use linkdyn_operation, only: operation_name, n_operand, n_operation, op_constant, op_input
    use linkdyn_piecewise, only: piecewise_curve
    use linkdyn_record, only: record_type, value
    use linkdyn_schedule, only: instruction, schedule_type, make_schedule, instruction_name
    implicit none (type, external)
    private
    public :: kernel_type, compile_kernel, find_boundary, count_of

    type :: kernel_type
        integer :: n_input = 0
        logical, allocatable :: uses(:)                !! (input) is it read?
        integer :: n_output = 0
        integer :: n_slot = 0
        integer :: n_constant = 0
        real(wp), allocatable :: constant(:)           !! in slots n_input + 1, ...
        type(piecewise_curve), allocatable :: curve(:) !! in which it looks up
        type(instruction), allocatable :: step(:)      !! operands and results are slots
        integer, allocatable :: output_slot(:)         !! (output)
        integer, allocatable :: output_sign(:)         !! (output) +1 or -1
        integer, allocatable :: group_end(:)           !! (group) its last output
        integer, allocatable :: step_end(:)            !! (group) steps after which its outputs must be taken: later ones reuse
                                                       !! slots
    end type kernel_type

    integer, parameter :: largest_group = 16           !! outputs: what stays in the first cache until it is taken

contains

    !> Make a record ready to run. All its inputs are inputs of the kernel, in the order in which they were made; then come
    !> values that are given, as another kernel has found them.
    subroutine compile_kernel(record, output, fuses, kernel, given, parts)
        type(record_type), intent(in) :: record
        type(value), intent(in) :: output(:)
        logical, intent(in) :: fuses                   !! form multiply-adds
        type(kernel_type), intent(out) :: kernel
        integer, intent(in), optional :: given(:)      !! nodes
        integer, intent(in), optional :: parts(:)      !! numbers of outputs that belong together; absent: all do
        type(schedule_type) :: schedule
        integer, allocatable :: slot(:)                !! of each node, also of those that the schedule added; 0: none yet
        logical :: is_given(record%n_node)
        integer :: node

        is_given = .false.
        if (present(given)) is_given(given) = .true.
        call make_schedule(record, output, is_given, fuses, schedule)
        allocate (slot(max(record%n_node, maxval([schedule%step%result, 0]))))
        slot = 0
        kernel%n_input = record%n_input
        kernel%n_output = size(output)
        kernel%curve = record%curve
        slot(record%node_of_input(:record%n_input)) = [(node, node=1, record%n_input)]
        kernel%uses = schedule%is_needed(record%node_of_input(:record%n_input))
        if (present(given)) then
            slot(given) = [(kernel%n_input + node, node=1, size(given))]
            kernel%n_input = kernel%n_input + size(given)
            kernel%uses = [kernel%uses, [(.true., node=1, size(given))]]
        end if
        allocate (kernel%constant(0))
        do node = 1, record%n_node
            if (record%kind(node) /= op_constant .or. .not. schedule%is_needed(node)) cycle
            kernel%n_constant = kernel%n_constant + 1
            slot(node) = kernel%n_input + kernel%n_constant
            kernel%constant = [kernel%constant, real(record%constant(record%operand(1, node)), wp)]
        end do
        kernel%n_slot = kernel%n_input + kernel%n_constant
        if (present(parts)) then
            call form_groups(parts, kernel%group_end)
        else
            call form_groups([size(output)], kernel%group_end)
        end if
        allocate (kernel%step_end(size(kernel%group_end)))
        if (size(kernel%group_end) > 0) kernel%step_end = schedule%done_after(kernel%group_end)
        call place_results(schedule%step, output%node, kernel%group_end, kernel%step_end, slot, kernel%n_slot)
        call move_alloc(schedule%step, kernel%step)
        kernel%output_slot = slot(output%node)
        kernel%output_sign = output%sign
    end subroutine compile_kernel

    !> What depends on some late inputs, and what the rest has to find for it: an iteration need not repeat what stays.
    subroutine find_boundary(record, output, late, boundary)
        type(record_type), intent(in) :: record
        type(value), intent(in) :: output(:)
        type(value), intent(in) :: late(:)             !! inputs that change
        integer, allocatable, intent(out) :: boundary(:)    !! nodes that do not depend on these, but are used by some that do
        logical, dimension(record%n_node) :: depends, is_needed, is_boundary
        integer :: node, i

        depends = .false.
        depends(late%node) = .true.
        do node = 1, record%n_node
            do i = 1, n_operand(record%kind(node))
                depends(node) = depends(node) .or. depends(record%operand(i, node))
            end do
        end do
        is_needed = .false.
        is_needed(output%node) = .true.
        is_boundary = .false.
        do node = record%n_node, 1, -1
            if (.not. is_needed(node)) cycle
            if (depends(node)) then
                do i = 1, n_operand(record%kind(node))
                    is_needed(record%operand(i, node)) = .true.
                end do
            else
                is_boundary(node) = record%kind(node) /= op_constant .and. record%kind(node) /= op_input
            end if
        end do
        boundary = pack([(node, node=1, record%n_node)], is_boundary)
    end subroutine find_boundary

    !> Outputs in groups of limited size, none across two parts.
    pure subroutine form_groups(parts, group_end)
        integer, intent(in) :: parts(:)
        integer, allocatable, intent(out) :: group_end(:)
        integer :: p, first, last, k

        allocate (group_end(0))
        first = 0
        do p = 1, size(parts)
            last = first + parts(p)
            do k = first + largest_group, last - 1, largest_group
                group_end = [group_end, k]
            end do
            if (last > first) group_end = [group_end, last]
            first = last
        end do
    end subroutine form_groups

    !> Give every result a slot; that of a value used for the last time is free for the next result, also for the one
    !> that uses it. An output is used when its group is taken.
    subroutine place_results(step, output, group_end, step_end, slot, n_slot)
        type(instruction), intent(inout) :: step(:)
        integer, intent(in) :: output(:)               !! nodes
        integer, intent(in) :: group_end(:), step_end(:)
        integer, intent(inout) :: slot(:)              !! (node)
        integer, intent(inout) :: n_slot
        integer :: last_use(size(slot)), taken_after(size(slot)), free(size(slot)), n_free, n_given, k, i, g

        n_given = n_slot
        last_use = 0
        do k = 1, size(step)
            do i = 1, 3
                if (step(k)%operand(i) > 0) last_use(step(k)%operand(i)) = k
            end do
        end do
        taken_after = -1
        do g = 1, size(group_end)
            do i = merge(1, group_end(max(g - 1, 1)) + 1, g == 1), group_end(g)
                taken_after(output(i)) = max(taken_after(output(i)), step_end(g))
            end do
        end do
        n_free = 0
        g = 1
        do k = 1, size(step)
            ! outputs that were taken and are not used any more
            do while (g <= size(group_end))
                if (step_end(g) >= k) exit
                do i = merge(1, group_end(max(g - 1, 1)) + 1, g == 1), group_end(g)
                    if (taken_after(output(i)) == step_end(g) .and. last_use(output(i)) < k) call release(output(i))
                end do
                g = g + 1
            end do
            associate (s => step(k))
                do i = 1, 3
                    if (s%operand(i) == 0) cycle
                    if (last_use(s%operand(i)) == k .and. taken_after(s%operand(i)) < k) call release(s%operand(i))
                end do
                s%operand = merge(slot(max(s%operand, 1)), 0, s%operand > 0)
                if (n_free > 0) then
                    slot(s%result) = free(n_free)
                    n_free = n_free - 1
                else
                    n_slot = n_slot + 1
                    slot(s%result) = n_slot
                end if
                s%result = slot(s%result)
            end associate
        end do

    contains

        subroutine release(node)
            integer, intent(in) :: node

            if (slot(node) <= n_given .or. last_use(node) == huge(1)) return
            n_free = n_free + 1
            free(n_free) = slot(node)
            last_use(node) = huge(1)                   ! once
        end subroutine release
    end subroutine place_results

    !> How many instructions of a kind, by its name; all if the name is empty.
    pure integer function count_of(kernel, name)
        type(kernel_type), intent(in) :: kernel
        character(len=*), intent(in) :: name
        integer :: k

        count_of = 0
        do k = 1, size(kernel%step)
            if (name == "" .or. name == name_of(kernel%step(k)%kind)) count_of = count_of + 1
        end do
    end function count_of

    pure function name_of(kind) result(name)
        integer, intent(in) :: kind
        character(len=len(instruction_name)) :: name

        if (kind > n_operation) then
            name = instruction_name(kind - n_operation)
        else
            name = operation_name(kind)
        end if
    end function name_of
end module linkdyn_kernel
