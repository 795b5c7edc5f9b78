!> Values with some of their leaves replaced: the same formula of other arguments.
module linkdyn_substitution
    use linkdyn_folding, only: result_of
    use linkdyn_node_values, only: node_values
    use linkdyn_operation, only: n_operand
    use linkdyn_record, only: record_type, open_record_of_thread
    use linkdyn_value, only: value
    implicit none (type, external)
    private
    public :: substitution, replace, substituted

    !> What stands for what, and what followed from it so far.
    type :: substitution
        type(node_values), private :: image = node_values()    !! nodes before its first do not depend on any that are replaced
    end type substitution

    interface replace
        module procedure replace_one, replace_many
    end interface replace
    interface substituted
        module procedure substitute_in_one, substitute_in_many
    end interface substituted

contains

    subroutine replace_many(map, old, new)
        type(substitution), intent(inout) :: map
        type(value), intent(in) :: old(:), new(:)
        integer :: k

        do k = 1, size(old)
            call replace_one(map, old(k), new(k))
        end do
    end subroutine replace_many

    !> From here on `new` stands for `old`.
    subroutine replace_one(map, old, new)
        type(substitution), intent(inout) :: map
        type(value), intent(in) :: old, new

        call map%image%put(old, new)
    end subroutine replace_one

    function substitute_in_many(map, v) result(w)
        type(substitution), intent(inout) :: map
        type(value), intent(in) :: v(:)
        type(value) :: w(size(v))
        integer :: k

        do k = 1, size(v)
            w(k) = substitute_in_one(map, v(k))
        end do
    end function substitute_in_many

    !> The value with all replacements made. A stack instead of recursion, since records are long.
    function substitute_in_one(map, v) result(w)
        type(substitution), intent(inout) :: map
        type(value), intent(in) :: v
        type(value) :: w
        type(record_type), pointer :: record
        integer, allocatable :: stack(:)
        type(value) :: x(3)
        integer :: n, node, i, operand
        logical :: is_ready

        w = v
        if (v%node < map%image%first) return
        record => open_record_of_thread()
        call map%image%make_room(v%node)
        allocate (stack(64))
        stack(1) = v%node
        n = 1
        do while (n > 0)
            node = stack(n)
            if (map%image%has(node)) then
                n = n - 1
                cycle
            end if
            is_ready = .true.
            x = value(node, 1)
            do i = 1, n_operand(record%kind(node))
                operand = record%operand(i, node)
                x(i) = value(operand, 1)
                if (operand < map%image%first) cycle
                if (map%image%has(operand)) then
                    x(i) = map%image%get(x(i))
                    cycle
                end if
                is_ready = .false.
                n = n + 1
                if (n > size(stack)) stack = [stack, stack]
                stack(n) = operand
            end do
            if (.not. is_ready) cycle
            w = value(node, 1)
            if (n_operand(record%kind(node)) > 0) w = result_of(record%kind(node), x(1), x(2), x(3), record%operand(3, node))
            call map%image%put(value(node, 1), w)
            n = n - 1
        end do
        w = map%image%get(v)
    end function substitute_in_one
end module linkdyn_substitution
