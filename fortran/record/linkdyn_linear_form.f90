!> Values that contain unknowns, taken apart: v = rest + sum of coefficient * unknown.
!>
!> Physics writes equations as expressions in which some values are not known yet; all are linear in these. The
!> coefficients are values themselves, so this is where the entries of every matrix come from.
module linkdyn_linear_form
    use linkdyn_operation, only: n_operand, op_unknown, op_add, op_subtract, op_multiply
    use linkdyn_record, only: record_type, open_record_of_thread
    use linkdyn_value, only: value, zero, one, is_zero, operator(+), operator(-), operator(*)
    implicit none (type, external)
    private
    public :: linear_form, linear_forms, find_linear_form

    type :: linear_form
        type(value) :: rest                            !! what stands without unknowns
        integer, allocatable :: unknown(:)             !! numbers of unknowns, increasing
        type(value), allocatable :: coefficient(:)     !! of each
    end type linear_form

    integer, parameter :: not_seen = 0, is_free = 1, has_form = 2

    !> Forms found so far, for one open record.
    type :: linear_forms
        integer :: first = huge(1)                     !! the oldest node that is an unknown: those before it are free of any
        integer, allocatable, private :: state(:)      !! (node - first + 1) free of unknowns, or in which form
        integer, allocatable, private :: place(:)      !! (node - first + 1) in `form`
        type(linear_form), allocatable, private :: form(:)
        integer, private :: n_form = 0
        logical :: is_linear = .true.                  !! false once a product of unknowns was met
    end type linear_forms

contains

    !> Take a value apart.
    subroutine find_linear_form(forms, v, form)
        type(linear_forms), intent(inout) :: forms
        type(value), intent(in) :: v
        type(linear_form), intent(out) :: form

        call explore(forms, v%node)
        if (state_of(forms, v%node) == is_free) then
            form%rest = v
            allocate (form%unknown(0), form%coefficient(0))
            return
        end if
        form = forms%form(forms%place(v%node - forms%first + 1))
        if (v%sign > 0) return
        form%rest = -form%rest
        form%coefficient = -form%coefficient
    end subroutine find_linear_form

    !> Is a node free of unknowns, or is its form known?
    impure elemental integer function state_of(forms, node) result(state)
        type(linear_forms), intent(in) :: forms
        integer, intent(in) :: node

        state = is_free
        if (node >= forms%first) state = forms%state(node - forms%first + 1)
    end function state_of

    !> Forms of a node and of all that it is made of. A stack instead of recursion, since records are long.
    subroutine explore(forms, top)
        type(linear_forms), intent(inout) :: forms
        integer, intent(in) :: top
        type(record_type), pointer :: record
        integer, allocatable :: stack(:)
        integer :: n, node, i, operand
        logical :: is_ready

        if (top < forms%first) return
        record => open_record_of_thread()
        call make_room(forms, top)
        stack = [top]
        n = 1
        do while (n > 0)
            node = stack(n)
            if (state_of(forms, node) /= not_seen) then
                n = n - 1
                cycle
            end if
            is_ready = .true.
            do i = 1, n_operand(record%kind(node))
                operand = record%operand(i, node)
                if (state_of(forms, operand) /= not_seen) cycle
                is_ready = .false.
                n = n + 1
                if (n > size(stack)) stack = [stack, stack]
                stack(n) = operand
            end do
            if (.not. is_ready) cycle
            call take_apart(forms, record, node)
            n = n - 1
        end do
    end subroutine explore

    !> One node whose operands are known.
    subroutine take_apart(forms, record, node)
        type(linear_forms), intent(inout) :: forms
        type(record_type), intent(in) :: record
        integer, intent(in) :: node
        type(linear_form) :: form
        integer :: kind, a, b

        kind = record%kind(node)
        a = record%operand(1, node)
        b = record%operand(2, node)
        if (kind == op_unknown) then
            form%rest = zero()
            form%unknown = [a]
            form%coefficient = [one()]
        else if (all(state_of(forms, record%operand(:n_operand(kind), node)) == is_free)) then
            forms%state(node - forms%first + 1) = is_free
            return
        else
            select case (kind)
            case (op_add)
                form = combined(part(forms, a), part(forms, b), one())
            case (op_subtract)
                form = combined(part(forms, a), part(forms, b), -one())
            case (op_multiply)
                if (state_of(forms, a) == is_free) then
                    form = scaled(part(forms, b), value(a, 1))
                else if (state_of(forms, b) == is_free) then
                    form = scaled(part(forms, a), value(b, 1))
                else
                    forms%is_linear = .false.
                    form = part(forms, a)
                end if
            case default
                forms%is_linear = .false.
                form = part(forms, a)
            end select
        end if
        call store(forms, node, form)
    end subroutine take_apart

    function part(forms, node) result(form)
        type(linear_forms), intent(in) :: forms
        integer, intent(in) :: node
        type(linear_form) :: form

        if (state_of(forms, node) == has_form) then
            form = forms%form(forms%place(node - forms%first + 1))
        else
            form%rest = value(node, 1)
            allocate (form%unknown(0), form%coefficient(0))
        end if
    end function part

    function scaled(form, factor) result(r)
        type(linear_form), intent(in) :: form
        type(value), intent(in) :: factor
        type(linear_form) :: r

        r%rest = factor*form%rest
        r%unknown = form%unknown
        r%coefficient = factor*form%coefficient
    end function scaled

    !> a + sense b, the unknowns of both in order.
    function combined(a, b, sense) result(r)
        type(linear_form), intent(in) :: a, b
        type(value), intent(in) :: sense
        type(linear_form) :: r
        integer :: unknown(size(a%unknown) + size(b%unknown)), i, j, n
        type(value) :: coefficient(size(a%unknown) + size(b%unknown)), c

        r%rest = a%rest + sense*b%rest
        n = 0
        i = 1
        j = 1
        do while (i <= size(a%unknown) .or. j <= size(b%unknown))
            if (j > size(b%unknown)) then
                call put(a%unknown(i), a%coefficient(i))
                i = i + 1
            else if (i > size(a%unknown)) then
                call put(b%unknown(j), sense*b%coefficient(j))
                j = j + 1
            else if (a%unknown(i) < b%unknown(j)) then
                call put(a%unknown(i), a%coefficient(i))
                i = i + 1
            else if (a%unknown(i) > b%unknown(j)) then
                call put(b%unknown(j), sense*b%coefficient(j))
                j = j + 1
            else
                c = a%coefficient(i) + sense*b%coefficient(j)
                if (.not. is_zero(c)) call put(a%unknown(i), c)
                i = i + 1
                j = j + 1
            end if
        end do
        r%unknown = unknown(:n)
        r%coefficient = coefficient(:n)

    contains

        subroutine put(u, c)
            integer, intent(in) :: u
            type(value), intent(in) :: c

            n = n + 1
            unknown(n) = u
            coefficient(n) = c
        end subroutine put
    end function combined

    subroutine store(forms, node, form)
        type(linear_forms), intent(inout) :: forms
        integer, intent(in) :: node
        type(linear_form), intent(in) :: form
        type(linear_form), allocatable :: more(:)
        integer :: i

        if (.not. allocated(forms%form)) allocate (forms%form(64))
        if (forms%n_form == size(forms%form)) then
            allocate (more(2*forms%n_form))
            do i = 1, forms%n_form
                call move_alloc(forms%form(i)%unknown, more(i)%unknown)
                call move_alloc(forms%form(i)%coefficient, more(i)%coefficient)
                more(i)%rest = forms%form(i)%rest
            end do
            call move_alloc(more, forms%form)
        end if
        forms%n_form = forms%n_form + 1
        forms%form(forms%n_form) = form
        forms%place(node - forms%first + 1) = forms%n_form
        forms%state(node - forms%first + 1) = has_form
    end subroutine store

    subroutine make_room(forms, node)
        type(linear_forms), intent(inout) :: forms
        integer, intent(in) :: node
        integer, allocatable :: state(:), place(:)
        integer :: n, needed

        if (.not. allocated(forms%state)) allocate (forms%state(0), forms%place(0))
        n = size(forms%state)
        needed = node - forms%first + 1
        if (needed <= n) return
        allocate (state(2*needed), place(2*needed))
        state(:n) = forms%state
        state(n + 1:) = not_seen
        place(:n) = forms%place
        place(n + 1:) = 0
        call move_alloc(state, forms%state)
        call move_alloc(place, forms%place)
    end subroutine make_room
end module linkdyn_linear_form
