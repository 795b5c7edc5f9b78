!> A record: the program of a scene as a straight line of arithmetic, written down while the physics is traced.
!>
!> A node is one operation on results of earlier nodes. Equal operations are one node. Every node has numbers at a few
!> representative samples: whoever has to choose (a pivot, a branch) looks at these. They are computed when they are first
!> asked for, since most nodes are steps on the way to others, and nobody ever asks.
!> Constants are kept in quadruple precision and rounded once, when the record is run.
!>
!> One record a thread is open at a time; the operators of `linkdyn_value` write to it.
module linkdyn_record
    use, intrinsic :: iso_c_binding, only: c_ptr, c_null_ptr, c_loc, c_f_pointer
    use, intrinsic :: iso_fortran_env, only: int64, real128
    use linkdyn_kinds, only: wp
    use linkdyn_operation, only: operate, n_operand, is_look_up, op_constant, op_input, op_unknown
    use linkdyn_piecewise, only: piecewise_curve, look_up, curve_of, which_of
    implicit none (type, external)
    private
    public :: value, record_type, open_record, close_record, open_record_of_thread
    public :: constant, constant_in_quad, zero, one, new_input, new_unknown, find_node, known_node, add_curve
    public :: is_constant, is_zero, is_one, number_of, numbers_at, constant_of, declare_inverse, negated

    integer, parameter :: first_capacity = 1024     !! nodes; doubled when full, a power of two

    !> A number of the program: a node, or its negative. Two plain integers, so that expressions leak nothing.
    type :: value
        integer :: node = 0
        integer :: sign = 1                         !! +1 or -1
    end type value

    type :: record_type
        integer :: n_node = 0
        integer :: n_input = 0
        integer :: n_unknown = 0
        integer :: n_constant = 0
        integer :: n_sample = 0
        integer, allocatable :: kind(:)             !! (node) one of `op_*`
        integer, allocatable :: operand(:, :)       !! (3, node); of a constant, an input, an unknown: its index; the third of a
                                                    !! look-up: of which curve what (see `look_at`)
        integer, allocatable :: inverse(:)          !! (node) what it is the reciprocal of, with a sign; 0: not known
        integer, private :: n_known = 0
        integer, allocatable, private :: place(:)   !! (node) of its numbers; 0: not computed yet
        real(wp), allocatable, private :: number(:, :)          !! at the representative samples (sample, place)
        real(real128), allocatable :: constant(:)   !! (constant)
        integer, allocatable :: node_of_unknown(:)  !! (unknown)
        integer, allocatable :: node_of_input(:)    !! (input)
        type(piecewise_curve), allocatable :: curve(:)    !! in which the scene looks up
        integer, allocatable, private :: table(:)   !! nodes by their hash
        integer, private :: node_of_zero = 0, node_of_one = 0   !! of these constants, which are met everywhere; 0: not yet
        type(c_ptr), private :: outer = c_null_ptr  !! the record that was open before
    end type record_type

    interface
        !> The open record of the calling thread.
        function current_record() bind(c, name="linkdyn_current_record")
            import :: c_ptr
            type(c_ptr) :: current_record
        end function current_record

        subroutine set_current_record(record) bind(c, name="linkdyn_set_current_record")
            import :: c_ptr
            type(c_ptr), value :: record
        end subroutine set_current_record
    end interface

    interface constant
        module procedure constant_wp, constant_integer
    end interface constant

contains

    ! ---------------------------------------------------------------- opening and closing

    !> Start a record; the thread's operators write to it until it is closed.
    subroutine open_record(record, n_sample)
        type(record_type), intent(inout), target :: record
        integer, intent(in) :: n_sample             !! representative samples

        record%n_node = 0
        record%n_input = 0
        record%n_unknown = 0
        record%n_constant = 0
        record%n_known = 0
        record%n_sample = n_sample
        record%node_of_zero = 0
        record%node_of_one = 0
        if (allocated(record%kind)) deallocate (record%kind, record%operand, record%inverse, record%place, record%number, &
                                                record%constant, record%table, record%node_of_unknown, record%node_of_input)
        if (allocated(record%curve)) deallocate (record%curve)
        allocate (record%curve(0))
        allocate (record%kind(first_capacity), record%operand(3, first_capacity), record%inverse(first_capacity), &
                  record%place(first_capacity), record%number(n_sample, first_capacity/2), record%constant(first_capacity/8), &
                  record%table(4*first_capacity), record%node_of_unknown(64), record%node_of_input(64))
        record%table = 0
        record%outer = current_record()
        call set_current_record(c_loc(record))
    end subroutine open_record

    !> The record stays; the one that was open before is open again.
    subroutine close_record(record)
        type(record_type), intent(inout) :: record

        call set_current_record(record%outer)
        record%outer = c_null_ptr
    end subroutine close_record

    !> The record that the calling thread is writing.
    function open_record_of_thread() result(record)
        type(record_type), pointer :: record

        call c_f_pointer(current_record(), record)
    end function open_record_of_thread

    ! ---------------------------------------------------------------- leaves

    !> A number that the scene fixes.
    impure elemental function constant_wp(x) result(v)
        real(wp), intent(in) :: x
        type(value) :: v

        v = constant_in_quad(real(x, real128))
    end function constant_wp

    impure elemental function constant_integer(x) result(v)
        integer, intent(in) :: x
        type(value) :: v

        v = constant_in_quad(real(x, real128))
    end function constant_integer

    function zero() result(v)
        type(value) :: v
        type(record_type), pointer :: record

        record => open_record_of_thread()
        v%node = record%node_of_zero
        if (v%node == 0) v = constant_in_quad(0.0_real128)
    end function zero

    function one() result(v)
        type(value) :: v
        type(record_type), pointer :: record

        record => open_record_of_thread()
        v%node = record%node_of_one
        if (v%node == 0) v = constant_in_quad(1.0_real128)
    end function one

    !> A number given when the record is run.
    function new_input(number) result(v)
        real(wp), intent(in) :: number(:)           !! at the representative samples, or one for all
        type(value) :: v
        type(record_type), pointer :: record
        integer :: place

        record => open_record_of_thread()
        record%n_input = record%n_input + 1
        v%node = append(record, op_input, [record%n_input, 0, 0])
        if (record%n_input > size(record%node_of_input)) record%node_of_input = [record%node_of_input, record%node_of_input]
        record%node_of_input(record%n_input) = v%node
        place = new_place(record, v%node)
        if (size(number) == record%n_sample) then
            record%number(:, place) = number
        else
            record%number(:, place) = number(1)
        end if
    end function new_input

    !> One more curve to look up in; its number.
    integer function add_curve(curve)
        type(piecewise_curve), intent(in) :: curve
        type(piecewise_curve), allocatable :: more(:)
        type(record_type), pointer :: record
        integer :: i, n

        record => open_record_of_thread()
        n = size(record%curve)
        allocate (more(n + 1))
        do i = 1, n
            call move_alloc(record%curve(i)%c, more(i)%c)
            call move_alloc(record%curve(i)%knot, more(i)%knot)
            if (allocated(record%curve(i)%axis)) call move_alloc(record%curve(i)%axis, more(i)%axis)
            more(i)%is_polar = record%curve(i)%is_polar
        end do
        more(n + 1) = curve
        call move_alloc(more, record%curve)
        add_curve = n + 1
    end function add_curve

    !> A number that equations will determine.
    function new_unknown() result(v)
        type(value) :: v
        type(record_type), pointer :: record

        record => open_record_of_thread()
        record%n_unknown = record%n_unknown + 1
        v%node = append(record, op_unknown, [record%n_unknown, 0, 0])
        if (record%n_unknown > size(record%node_of_unknown)) &
            record%node_of_unknown = [record%node_of_unknown, record%node_of_unknown]
        record%node_of_unknown(record%n_unknown) = v%node
    end function new_unknown

    ! ---------------------------------------------------------------- nodes

    !> The node of an operation; operands are nodes, not their negatives. The same operation is made once.
    function find_node(record, kind, operand) result(node)
        type(record_type), intent(inout) :: record
        integer, intent(in) :: kind                 !! one of `op_*` with operands
        integer, intent(in) :: operand(3)           !! nodes; 0 where the operation takes none; the third of a look-up: in what
        integer :: node

        node = record%table(place_of(record, kind, operand))
        if (node == 0) node = append(record, kind, operand)
    end function find_node

    !> The node of an operation if it has been made; 0: it has not.
    pure integer function known_node(record, kind, operand)
        type(record_type), intent(in) :: record
        integer, intent(in) :: kind
        integer, intent(in) :: operand(3)           !! nodes; 0: there is no such operand, and no such node

        known_node = 0
        if (operand(1) > 0) known_node = record%table(place_of(record, kind, operand))
    end function known_node

    function constant_in_quad(x) result(v)
        real(real128), intent(in) :: x
        type(value) :: v
        type(record_type), pointer :: record
        integer :: place

        record => open_record_of_thread()
        place = place_of_constant(record, abs(x))
        v%sign = merge(-1, 1, x < 0)
        v%node = record%table(place)
        if (v%node > 0) return
        record%n_constant = record%n_constant + 1
        if (record%n_constant > size(record%constant)) record%constant = [record%constant, record%constant]
        record%constant(record%n_constant) = abs(x)
        v%node = append(record, op_constant, [record%n_constant, 0, 0])
        if (x == 0) record%node_of_zero = v%node
        if (abs(x) == 1) record%node_of_one = v%node
    end function constant_in_quad

    !> A new node at the end.
    function append(record, kind, operand) result(node)
        type(record_type), intent(inout) :: record
        integer, intent(in) :: kind, operand(3)
        integer :: node

        if (record%n_node == size(record%kind)) call grow(record)
        node = record%n_node + 1
        record%n_node = node
        record%kind(node) = kind
        record%operand(:, node) = operand
        record%inverse(node) = 0
        record%place(node) = 0
        record%table(free_place(record, hash_of_node(record, node))) = node
    end function append

    subroutine grow(record)
        type(record_type), intent(inout) :: record
        integer, allocatable :: kind(:), operand(:, :), inverse(:), place(:)
        integer :: n, i

        n = size(record%kind)
        allocate (kind(2*n), operand(3, 2*n), inverse(2*n), place(2*n))
        kind(:n) = record%kind
        operand(:, :n) = record%operand
        inverse(:n) = record%inverse
        place(:n) = record%place
        call move_alloc(kind, record%kind)
        call move_alloc(operand, record%operand)
        call move_alloc(inverse, record%inverse)
        call move_alloc(place, record%place)
        deallocate (record%table)
        allocate (record%table(8*n))
        record%table = 0
        do i = 1, record%n_node
            record%table(free_place(record, hash_of_node(record, i))) = i
        end do
    end subroutine grow

    ! ---------------------------------------------------------------- numbers at the representative samples

    !> Those of a node. A stack instead of recursion, since records are long.
    function numbers_at(record, node) result(x)
        type(record_type), intent(inout) :: record
        integer, intent(in) :: node
        real(wp) :: x(record%n_sample)
        integer, allocatable :: stack(:)
        integer :: n, n_before

        if (record%place(node) == 0) then
            stack = [node]
            n = 1
            do while (n > 0)
                n_before = n
                if (record%place(stack(n)) == 0) call ask_for_operands(record, stack, n)
                if (n > n_before) cycle
                if (record%place(stack(n)) == 0) call compute(record, stack(n))
                n = n - 1
            end do
        end if
        x = record%number(:, record%place(node))
    end function numbers_at

    !> Operands of the node on top that are not known yet come before it.
    subroutine ask_for_operands(record, stack, n)
        type(record_type), intent(in) :: record
        integer, allocatable, intent(inout) :: stack(:)
        integer, intent(inout) :: n
        integer :: i, node, operand

        node = stack(n)
        do i = 1, n_operand(record%kind(node))
            operand = record%operand(i, node)
            if (record%place(operand) > 0) cycle
            n = n + 1
            if (n > size(stack)) stack = [stack, stack]
            stack(n) = operand
        end do
    end subroutine ask_for_operands

    !> The numbers of a node whose operands have theirs.
    subroutine compute(record, node)
        type(record_type), intent(inout) :: record
        integer, intent(in) :: node
        integer :: place, s, o(3)

        place = new_place(record, node)
        associate (kind => record%kind(node), operand => record%operand(:, node), number => record%number)
            if (kind == op_constant) then
                number(:, place) = real(record%constant(operand(1)), wp)
                return
            else if (kind == op_unknown) then
                number(:, place) = 0
                return
            end if
            o = record%place(operand(1))
            o(:n_operand(kind)) = record%place(operand(:n_operand(kind)))
            if (is_look_up(kind)) then
                do s = 1, record%n_sample
                    number(s, place) = look_up(record%curve(curve_of(operand(3))), kind, which_of(operand(3)), number(s, o(1)), &
                                               number(s, o(2)))
                end do
            else
                do s = 1, record%n_sample
                    number(s, place) = operate(kind, number(s, o(1)), number(s, o(2)), number(s, o(3)))
                end do
            end if
        end associate
    end subroutine compute

    function new_place(record, node) result(place)
        type(record_type), intent(inout) :: record
        integer, intent(in) :: node
        integer :: place
        real(wp), allocatable :: number(:, :)

        if (record%n_known == size(record%number, 2)) then
            allocate (number(record%n_sample, 2*record%n_known))
            number(:, :record%n_known) = record%number
            call move_alloc(number, record%number)
        end if
        record%n_known = record%n_known + 1
        place = record%n_known
        record%place(node) = place
    end function new_place

    ! ---------------------------------------------------------------- finding nodes

    !> Where a node with these contents stands in the table, or the free place where it belongs.
    pure function place_of(record, kind, operand) result(place)
        type(record_type), intent(in) :: record
        integer, intent(in) :: kind, operand(3)
        integer :: place, node

        place = first_place(record, hash_of(kind, operand))
        do
            node = record%table(place)
            if (node == 0) return
            if (record%kind(node) == kind) then
                if (all(record%operand(:, node) == operand)) return
            end if
            place = next_place(record, place)
        end do
    end function place_of

    pure function place_of_constant(record, x) result(place)
        type(record_type), intent(in) :: record
        real(real128), intent(in) :: x
        integer :: place, node

        place = first_place(record, hash_of_constant(x))
        do
            node = record%table(place)
            if (node == 0) return
            if (record%kind(node) == op_constant) then
                if (record%constant(record%operand(1, node)) == x) return
            end if
            place = next_place(record, place)
        end do
    end function place_of_constant

    pure function free_place(record, hash) result(place)
        type(record_type), intent(in) :: record
        integer(int64), intent(in) :: hash
        integer :: place

        place = first_place(record, hash)
        do while (record%table(place) > 0)
            place = next_place(record, place)
        end do
    end function free_place

    pure integer function first_place(record, hash)
        type(record_type), intent(in) :: record
        integer(int64), intent(in) :: hash

        first_place = 1 + int(iand(hash, int(size(record%table) - 1, int64)))
    end function first_place

    pure integer function next_place(record, place)
        type(record_type), intent(in) :: record
        integer, intent(in) :: place

        next_place = 1 + iand(place, size(record%table) - 1)
    end function next_place

    pure function hash_of_node(record, node) result(hash)
        type(record_type), intent(in) :: record
        integer, intent(in) :: node
        integer(int64) :: hash

        if (record%kind(node) == op_constant) then
            hash = hash_of_constant(record%constant(record%operand(1, node)))
        else
            hash = hash_of(record%kind(node), record%operand(:, node))
        end if
    end function hash_of_node

    pure function hash_of(kind, operand) result(hash)
        integer, intent(in) :: kind, operand(3)
        integer(int64) :: hash

        hash = mixed(mixed(mixed(int(kind, int64), operand(1)), operand(2)), operand(3))
    end function hash_of

    pure function hash_of_constant(x) result(hash)
        real(real128), intent(in) :: x
        integer(int64) :: hash
        integer :: bits(4)

        bits = transfer(x, bits)
        hash = mixed(mixed(mixed(mixed(int(op_constant, int64), bits(1)), bits(2)), bits(3)), bits(4))
    end function hash_of_constant

    !> Exclusive or with shifts and a rotation: no product that could overflow, and small changes reach all bits.
    pure function mixed(hash, word) result(h)
        integer(int64), intent(in) :: hash
        integer, intent(in) :: word
        integer(int64) :: h

        h = ieor(ishftc(hash, 23), int(word, int64))
        h = ieor(h, ishft(h, 13))
        h = ieor(h, ishft(h, -7))
        h = ieor(h, ishft(h, 17))
    end function mixed

    ! ---------------------------------------------------------------- looking at values

    logical function is_constant(v)
        type(value), intent(in) :: v
        type(record_type), pointer :: record

        record => open_record_of_thread()
        is_constant = record%kind(v%node) == op_constant
    end function is_constant

    impure elemental logical function is_zero(v)
        type(value), intent(in) :: v
        type(record_type), pointer :: record

        record => open_record_of_thread()
        is_zero = v%node == record%node_of_zero .and. v%node > 0
    end function is_zero

    !> Is it 1 or -1?
    impure elemental logical function is_one(v)
        type(value), intent(in) :: v
        type(record_type), pointer :: record

        record => open_record_of_thread()
        is_one = v%node == record%node_of_one .and. v%node > 0
    end function is_one

    !> The number of a constant.
    function constant_of(v) result(x)
        type(value), intent(in) :: v
        real(real128) :: x
        type(record_type), pointer :: record

        record => open_record_of_thread()
        x = v%sign*record%constant(record%operand(1, v%node))
    end function constant_of

    !> Numbers at the representative samples.
    function number_of(v) result(x)
        type(value), intent(in) :: v
        real(wp), allocatable :: x(:)
        type(record_type), pointer :: record

        record => open_record_of_thread()
        x = v%sign*numbers_at(record, v%node)
    end function number_of

    impure elemental function negated(v) result(w)
        type(value), intent(in) :: v
        type(value) :: w

        w = v
        if (.not. is_zero(v)) w%sign = -v%sign
    end function negated

    !> The physics knows that a b = 1: neither is computed from the other.
    subroutine declare_inverse(a, b)
        type(value), intent(in) :: a, b
        type(record_type), pointer :: record

        record => open_record_of_thread()
        if (record%inverse(a%node) == 0) record%inverse(a%node) = a%sign*b%sign*b%node
        if (record%inverse(b%node) == 0) record%inverse(b%node) = a%sign*b%sign*a%node
    end subroutine declare_inverse
end module linkdyn_record
