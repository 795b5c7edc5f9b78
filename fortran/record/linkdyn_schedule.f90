!> From a record to instructions: only what the outputs need, products and sums joined, in an order that keeps little alive.
module linkdyn_schedule
    use linkdyn_operation, only: n_operand, n_operation, op_constant, op_input, op_unknown, op_add, op_subtract, op_multiply, &
        op_sine, op_cosine, is_look_up
    use linkdyn_record, only: record_type, value
    implicit none (type, external)
    private
    public :: instruction, schedule_type, make_schedule
    public :: op_multiply_add, op_multiply_subtract, op_subtract_product, instruction_name

    ! instructions beyond the operations of a record; each rounds once
    integer, parameter :: op_multiply_add = n_operation + 1       !! a b + c
    integer, parameter :: op_multiply_subtract = n_operation + 2  !! a b - c
    integer, parameter :: op_subtract_product = n_operation + 3   !! c - a b
    character(len=17), parameter :: instruction_name(3) = &
        [character(len=17) :: "multiply_add", "multiply_subtract", "subtract_product"]

    !> One operation on nodes or, later, on slots.
    type :: instruction
        integer :: kind = 0
        integer :: result = 0
        integer :: operand(3) = 0
        integer :: look = 0                            !! of a look-up: in which curve for what
    end type instruction

    type :: schedule_type
        type(instruction), allocatable :: step(:)
        logical, allocatable :: is_needed(:)           !! (node)
        integer, allocatable :: done_after(:)          !! (output) steps after which it is there, and those before it
    end type schedule_type

    !> A sum of many terms, some of them products that stand nowhere else.
    type :: sum_type
        integer :: n = 0
        integer, allocatable :: term(:)                !! nodes
        integer, allocatable :: sign(:)
        logical, allocatable :: is_product(:)
    end type sum_type

contains

    !> Instructions that compute the outputs.
    subroutine make_schedule(record, output, given, fuses, schedule)
        type(record_type), intent(in) :: record
        type(value), intent(in) :: output(:)
        logical, intent(in) :: given(:)                !! (node) known beforehand, as inputs are
        logical, intent(in) :: fuses                   !! form multiply-adds
        type(schedule_type), intent(out) :: schedule
        type(instruction), allocatable :: how(:)       !! (node) to be executed for it; then those for parts of sums

        call mark_needed(record, output, given, schedule%is_needed)
        call choose_instructions(record, output, given, fuses, schedule%is_needed, how)
        call put_in_order(record, output, how, schedule%step, schedule%done_after)
    end subroutine make_schedule

    !> Nodes are made after their operands: one walk back.
    subroutine mark_needed(record, output, given, is_needed)
        type(record_type), intent(in) :: record
        type(value), intent(in) :: output(:)
        logical, intent(in) :: given(:)
        logical, allocatable, intent(out) :: is_needed(:)
        integer :: node, i

        allocate (is_needed(record%n_node))
        is_needed = .false.
        is_needed(output%node) = .true.
        do node = record%n_node, 1, -1
            if (.not. is_needed(node) .or. given(node)) cycle
            do i = 1, n_operand(record%kind(node))
                is_needed(record%operand(i, node)) = .true.
            end do
        end do
    end subroutine mark_needed

    !> Every node by an instruction of its own, but sums of sums become one sum of many terms, and products that only sums
    !> use become multiply-adds: with p products among n terms n - 1 instructions instead of up to n - 1 + p.
    subroutine choose_instructions(record, output, given, fuses, is_needed, how)
        type(record_type), intent(in) :: record
        type(value), intent(in) :: output(:)
        logical, intent(in) :: given(:)
        logical, intent(in) :: fuses
        logical, intent(in) :: is_needed(:)
        type(instruction), allocatable, intent(out) :: how(:)
        integer :: n_use(record%n_node), n_use_in_sums(record%n_node)
        logical :: is_part(record%n_node)              !! a sum inside another, or a product inside a sum
        integer :: node, i, n, n_how
        type(sum_type) :: sum

        n_use = 0
        n_use(output%node) = 2                         ! an output must be there
        n_use_in_sums = 0
        do node = 1, record%n_node
            if (.not. is_needed(node) .or. given(node)) cycle
            do i = 1, n_operand(record%kind(node))
                associate (operand => record%operand(i, node))
                    n_use(operand) = n_use(operand) + 1
                    if (is_sum(record%kind(node))) n_use_in_sums(operand) = n_use_in_sums(operand) + 1
                end associate
            end do
        end do
        is_part = .false.
        do node = 1, record%n_node
            if (.not. fuses .or. given(node)) cycle
            if (is_sum(record%kind(node))) is_part(node) = n_use(node) == 1 .and. n_use_in_sums(node) == 1
            if (record%kind(node) == op_multiply) is_part(node) = n_use(node) == n_use_in_sums(node)
        end do

        allocate (how(2*record%n_node))
        n_how = record%n_node
        do node = 1, record%n_node
            if (.not. is_needed(node) .or. is_part(node)) cycle
            if (given(node)) then
                how(node)%kind = op_input
            else if (is_sum(record%kind(node)) .and. fuses) then
                call collect_terms(record, node, is_part, sum)
                call chain_terms(record, sum, node, how, n_how)
            else
                n = n_operand(record%kind(node))
                how(node) = instruction(record%kind(node), node, record%operand(:, node))
                how(node)%operand(n + 1:) = 0
                if (is_look_up(record%kind(node))) how(node)%look = record%operand(3, node)
            end if
        end do
        how = how(:n_how)
    end subroutine choose_instructions

    !> The terms of a sum and of the sums inside it, with their signs. The first has a plus.
    subroutine collect_terms(record, top, is_part, sum)
        type(record_type), intent(in) :: record
        integer, intent(in) :: top
        logical, intent(in) :: is_part(:)
        type(sum_type), intent(inout) :: sum
        integer, allocatable :: stack(:), sense(:)
        integer :: n, node, sign, i

        if (.not. allocated(sum%term)) allocate (sum%term(64), sum%sign(64), sum%is_product(64))
        allocate (stack(64), sense(64))
        sum%n = 0
        n = 1
        stack(1) = top
        sense(1) = 1
        do while (n > 0)
            node = stack(n)
            sign = sense(n)
            n = n - 1
            if (node == top .or. (is_part(node) .and. is_sum(record%kind(node)))) then
                if (n + 2 > size(stack)) then
                    stack = [stack, stack]
                    sense = [sense, sense]
                end if
                do i = 2, 1, -1                        ! the first operand is taken from the stack first
                    n = n + 1
                    stack(n) = record%operand(i, node)
                    sense(n) = sign
                    if (i == 2 .and. record%kind(node) == op_subtract) sense(n) = -sign
                end do
            else
                if (sum%n == size(sum%term)) then
                    sum%term = [sum%term, sum%term]
                    sum%sign = [sum%sign, sum%sign]
                    sum%is_product = [sum%is_product, sum%is_product]
                end if
                sum%n = sum%n + 1
                sum%term(sum%n) = node
                sum%sign(sum%n) = sign
                sum%is_product(sum%n) = is_part(node)
            end if
        end do
    end subroutine collect_terms

    !> A sum as a chain: a plain term first, if there is one, then one term an instruction.
    subroutine chain_terms(record, sum, node, how, n_how)
        type(record_type), intent(in) :: record
        type(sum_type), intent(in) :: sum
        integer, intent(in) :: node                    !! the result
        type(instruction), allocatable, intent(inout) :: how(:)
        integer, intent(inout) :: n_how
        integer :: first, k, n_left, last, factor(2)
        logical :: is_negative

        ! the chain starts with a plain term, best one with a plus; the last result's sign is known until a plus comes in
        first = 0
        do k = sum%n, 1, -1
            if (.not. sum%is_product(k) .and. sum%sign(k) < 0) first = k
        end do
        do k = sum%n, 1, -1
            if (.not. sum%is_product(k) .and. sum%sign(k) > 0) first = k
        end do
        n_left = sum%n - 1
        if (first > 0) then
            last = sum%term(first)
            is_negative = sum%sign(first) < 0
        else
            first = 1                                  ! a product with a plus
            n_how = n_how + 1
            last = n_how
            factor = record%operand(:2, sum%term(first))
            how(last) = instruction(op_multiply, last, [factor, 0])
            is_negative = .false.
        end if
        ! while the chain is negative, terms with a plus come first
        if (is_negative) then
            do k = 1, sum%n
                if (k == first .or. sum%sign(k) < 0) cycle
                call add_term(k)
                exit
            end do
            call add_others(except=[first, k])
        else
            call add_others(except=[first, 0])
        end if

    contains

        subroutine add_others(except)
            integer, intent(in) :: except(2)
            integer :: i

            do i = 1, sum%n
                if (any(i == except)) cycle
                call add_term(i)
            end do
        end subroutine add_others

        !> One more term of a sum, fused with a product where it is one. The sum so far may wait with the other sign.
        subroutine add_term(i)
            integer, intent(in) :: i
            integer :: result

            result = node
            if (n_left > 1) then
                n_how = n_how + 1
                if (n_how > size(how)) how = [how, how]
                result = n_how
            end if
            n_left = n_left - 1
            if (sum%is_product(i)) then
                factor = record%operand(:2, sum%term(i))
                if (is_negative) then                  ! the term has a plus
                    how(result) = instruction(op_multiply_subtract, result, [factor, last])
                else
                    how(result) = instruction(merge(op_multiply_add, op_subtract_product, sum%sign(i) > 0), result, [factor, last])
                end if
            else if (is_negative) then
                how(result) = instruction(op_subtract, result, [sum%term(i), last, 0])
            else
                how(result) = instruction(merge(op_add, op_subtract, sum%sign(i) > 0), result, [last, sum%term(i), 0])
            end if
            is_negative = .false.
            last = result
        end subroutine add_term
    end subroutine chain_terms

    pure logical function is_sum(kind)
        integer, intent(in) :: kind

        is_sum = kind == op_add .or. kind == op_subtract
    end function is_sum

    !> Depth first from the outputs: a value is made just before it is first used, an addend just before its sum.
    subroutine put_in_order(record, output, how, step, done_after)
        type(record_type), intent(in) :: record
        type(value), intent(in) :: output(:)
        type(instruction), intent(in) :: how(:)
        type(instruction), allocatable, intent(out) :: step(:)
        integer, allocatable, intent(out) :: done_after(:)
        logical :: is_done(size(how))
        integer, dimension(record%n_node) :: sine_of, cosine_of    !! (node) if they are needed
        integer, allocatable :: stack(:), next(:)
        integer :: k, n, node, operand, n_step

        allocate (step(size(how)), stack(64), next(64), done_after(size(output)))
        n_step = 0
        is_done = .false.
        sine_of = 0
        cosine_of = 0
        do node = 1, record%n_node
            if (how(node)%kind == op_sine) sine_of(how(node)%operand(1)) = node
            if (how(node)%kind == op_cosine) cosine_of(how(node)%operand(1)) = node
        end do
        do k = 1, size(output)
            n = 1
            stack(1) = output(k)%node
            next(1) = 1
            do while (n > 0)
                node = stack(n)
                if (is_done(node)) then
                    n = n - 1
                    cycle
                end if
                if (next(n) <= 3) then
                    operand = how(node)%operand(next(n))
                    next(n) = next(n) + 1
                    if (n_operand_of(how(node)%kind) < next(n) - 1) cycle
                    if (is_done(operand)) cycle
                    n = n + 1
                    if (n > size(stack)) then
                        stack = [stack, stack]
                        next = [next, next]
                    end if
                    stack(n) = operand
                    next(n) = 1
                else
                    n = n - 1
                    if (is_leaf(how(node)%kind)) then
                        is_done(node) = .true.
                        cycle
                    end if
                    if (how(node)%kind == op_sine .or. how(node)%kind == op_cosine) then
                        ! of one angle side by side: they are computed together
                        call put(sine_of(how(node)%operand(1)))
                        call put(cosine_of(how(node)%operand(1)))
                    else
                        call put(node)
                    end if
                end if
            end do
            done_after(k) = n_step
        end do
        step = step(:n_step)

    contains

        subroutine put(node)
            integer, intent(in) :: node            !! 0: nobody needs it

            if (node == 0) return
            is_done(node) = .true.
            n_step = n_step + 1
            step(n_step) = how(node)
        end subroutine put
    end subroutine put_in_order

    pure logical function is_leaf(kind)
        integer, intent(in) :: kind

        is_leaf = kind == op_constant .or. kind == op_input .or. kind == op_unknown
    end function is_leaf

    pure integer function n_operand_of(kind)
        integer, intent(in) :: kind

        if (kind > n_operation) then
            n_operand_of = 3
        else
            n_operand_of = n_operand(kind)
        end if
    end function n_operand_of
end module linkdyn_schedule
