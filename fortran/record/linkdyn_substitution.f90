!> Values with some of their leaves replaced: the same formula of other arguments.
module linkdyn_substitution
    use linkdyn_folding, only: result_of
    use linkdyn_operation, only: n_operand
    use linkdyn_record, only: record_type, open_record_of_thread
    use linkdyn_value, only: value, operator(-)
    implicit none (type, external)
    private
    public :: substitution, replace, substituted

    !> What stands for what, and what followed from it so far.
    type :: substitution
        integer, private :: first = 0                       !! the oldest node replaced: those before it do not depend on any
        type(value), allocatable, private :: image(:)       !! (node - first + 1); node 0: not known yet
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

        call make_room(map, old%node)
        associate (image => map%image(old%node - map%first + 1))
            image = new
            if (old%sign < 0) image = -new
        end associate
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
        if (v%node < map%first) return
        record => open_record_of_thread()
        call make_room(map, v%node)
        allocate (stack(64))
        stack(1) = v%node
        n = 1
        do while (n > 0)
            node = stack(n)
            if (image_of(node) > 0) then
                n = n - 1
                cycle
            end if
            is_ready = .true.
            x = value(node, 1)
            do i = 1, n_operand(record%kind(node))
                operand = record%operand(i, node)
                if (operand < map%first) then
                    x(i) = value(operand, 1)
                    cycle
                end if
                x(i) = map%image(operand - map%first + 1)
                if (x(i)%node > 0) cycle
                is_ready = .false.
                n = n + 1
                if (n > size(stack)) stack = [stack, stack]
                stack(n) = operand
            end do
            if (.not. is_ready) cycle
            associate (image => map%image(node - map%first + 1))
                image = value(node, 1)
                if (n_operand(record%kind(node)) > 0) image = result_of(record%kind(node), x(1), x(2), x(3))
            end associate
            n = n - 1
        end do
        w = map%image(v%node - map%first + 1)
        if (v%sign < 0) w = -w

    contains

        pure integer function image_of(node)
            integer, intent(in) :: node

            image_of = map%image(node - map%first + 1)%node
        end function image_of
    end function substitute_in_one

    subroutine make_room(map, node)
        type(substitution), intent(inout) :: map
        integer, intent(in) :: node
        type(value), allocatable :: image(:)
        integer :: first, last

        if (.not. allocated(map%image)) then
            map%first = node
            allocate (map%image(0))
        end if
        last = map%first + size(map%image) - 1
        if (node >= map%first .and. node <= last) return
        first = min(map%first, node)
        allocate (image(2*(max(last, node) - first + 1)))
        image(map%first - first + 1:map%first - first + size(map%image)) = map%image
        call move_alloc(image, map%image)
        map%first = first
    end subroutine make_room
end module linkdyn_substitution
