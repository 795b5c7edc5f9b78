!> What an operation becomes before it is written down: nothing, a constant, another operation, or itself.
!>
!> Zeros, ones and signs vanish, constants combine, reciprocals meet their originals. What a scene does not need is
!> therefore never computed: a massless link, a force along an axis, the third dimension of a plane.
!> Rules stand from special to general.
module linkdyn_folding
    use, intrinsic :: iso_fortran_env, only: real128
    use linkdyn_operation, only: operate, op_constant, op_add, op_subtract, op_multiply, op_reciprocal, op_root, op_sine, &
        op_cosine, op_arctangent, op_minimum, op_maximum, op_absolute, op_select, op_whole, op_piece, op_nearest, op_farthest
    use linkdyn_record, only: value, record_type, open_record_of_thread, find_node, known_node, constant_in_quad, is_zero, &
        is_one, is_constant, constant_of, declare_inverse, negated, zero, one
    implicit none (type, external)
    private
    public :: sum_of, product_of, product_in_any_order, reciprocal_of, root_of, sine_of, cosine_of, arctangent_of
    public :: smaller_of, larger_of, magnitude_of, selected, whole_of, looked_up, result_of

contains

    !> a + b
    function sum_of(a, b) result(r)
        type(value), intent(in) :: a, b
        type(value) :: r
        type(value) :: first, second

        if (is_zero(a)) then
            r = b
        else if (is_zero(b)) then
            r = a
        else if (a%node == b%node) then
            if (a%sign == b%sign) then
                r = product_of(constant_in_quad(2.0_real128), a)
            else
                r = zero()
            end if
        else if (is_constant(a) .and. is_constant(b)) then
            r = constant_in_quad(constant_of(a) + constant_of(b))
        else
            ! one order, and the first with a plus
            first = a
            second = b
            if (a%node > b%node) then
                first = b
                second = a
            end if
            r%node = new_node(merge(op_add, op_subtract, first%sign == second%sign), first%node, second%node)
            r%sign = first%sign
        end if
    end function sum_of

    !> a b
    recursive function product_of(a, b) result(r)
        type(value), intent(in) :: a, b
        type(value) :: r
        type(value) :: factor
        type(record_type), pointer :: record
        integer :: inverse

        record => open_record_of_thread()
        if (is_constant(b) .and. .not. is_constant(a)) then
            r = product_of(b, a)
            return
        end if
        if (is_zero(a) .or. is_zero(b)) then
            r = zero()
            return
        end if
        if (is_one(a)) then
            r = value(b%node, a%sign*b%sign)
            return
        end if
        if (is_constant(a)) then
            if (is_constant(b)) then
                r = constant_in_quad(constant_of(a)*constant_of(b))
                return
            end if
            ! c1 (c2 x) = (c1 c2) x
            if (record%kind(b%node) == op_multiply) then
                factor = value(record%operand(1, b%node), b%sign)
                if (is_constant(factor)) then
                    r = product_of(constant_in_quad(constant_of(a)*constant_of(factor)), value(record%operand(2, b%node), 1))
                    return
                end if
            end if
            r = value(new_node(op_multiply, a%node, b%node), a%sign*b%sign)
            return
        end if
        inverse = record%inverse(a%node)
        if (abs(inverse) == b%node) then
            r = one()
            r%sign = a%sign*b%sign*sign(1, inverse)
            return
        end if
        r = value(new_node(op_multiply, min(a%node, b%node), max(a%node, b%node)), a%sign*b%sign)
    end function product_of

    !> a b, or what has been made of their factors in another order: (a c) d or (a d) c for a (c d). Forces are eliminated by the
    !> transposed matrix of velocities: the pivots are the same, their factors meet in another order.
    !>
    !> For what nobody asks the rate of: that of c d may be known where those of c and d are not.
    function product_in_any_order(a, b) result(r)
        type(value), intent(in) :: a, b
        type(value) :: r
        type(record_type), pointer :: record
        integer :: pair(2), k

        record => open_record_of_thread()
        pair = [a%node, b%node]
        do k = 1, 2
            if (record%kind(pair(3 - k)) /= op_multiply) cycle
            associate (factor => record%operand(:2, pair(3 - k)), other => pair(k))
                r = value(known_product(record, known_product(record, other, factor(1)), factor(2)), a%sign*b%sign)
                if (r%node == 0) r%node = known_product(record, known_product(record, other, factor(2)), factor(1))
            end associate
            if (r%node > 0) return
        end do
        r = product_of(a, b)
    end function product_in_any_order

    !> The node of a product; 0: it is not known, or a factor is not.
    integer function known_product(record, a, b) result(node)
        type(record_type), intent(in) :: record
        integer, intent(in) :: a, b                 !! nodes; not both constants
        integer :: operand(3)

        node = 0
        if (min(a, b) == 0) return
        operand = [min(a, b), max(a, b), 0]
        if (record%kind(operand(2)) == op_constant) operand(:2) = operand(2:1:-1)
        node = known_node(record, op_multiply, operand)
    end function known_product

    !> 1/a
    function reciprocal_of(a) result(r)
        type(value), intent(in) :: a
        type(value) :: r
        type(record_type), pointer :: record

        record => open_record_of_thread()
        if (is_constant(a) .and. .not. is_zero(a)) then
            r = constant_in_quad(1/constant_of(a))
        else if (record%inverse(a%node) /= 0) then
            r = value(abs(record%inverse(a%node)), a%sign*sign(1, record%inverse(a%node)))
        else
            r = value(new_node(op_reciprocal, a%node), a%sign)
            call declare_inverse(a, r)
        end if
    end function reciprocal_of

    function root_of(a) result(r)
        type(value), intent(in) :: a
        type(value) :: r

        r = of_one(op_root, a)
    end function root_of

    function sine_of(a) result(r)
        type(value), intent(in) :: a
        type(value) :: r

        r = of_one(op_sine, value(a%node, 1))
        if (a%sign < 0) r = negated(r)
    end function sine_of

    function cosine_of(a) result(r)
        type(value), intent(in) :: a
        type(value) :: r

        r = of_one(op_cosine, value(a%node, 1))
    end function cosine_of

    function magnitude_of(a) result(r)
        type(value), intent(in) :: a
        type(value) :: r

        r = of_one(op_absolute, value(a%node, 1))
    end function magnitude_of

    function whole_of(a) result(r)
        type(value), intent(in) :: a
        type(value) :: r

        r = of_one(op_whole, value(a%node, 1))
        if (a%sign < 0) r = negated(r)
    end function whole_of

    !> Angle of the direction with components `along` and `across`.
    function arctangent_of(across, along) result(r)
        type(value), intent(in) :: across, along
        type(value) :: r

        r = of_two(op_arctangent, across, along)
    end function arctangent_of

    recursive function smaller_of(a, b) result(r)
        type(value), intent(in) :: a, b
        type(value) :: r

        if (a%node == b%node .and. a%sign == b%sign) then
            r = a
        else if (a%sign < 0 .and. b%sign < 0) then
            r = negated(larger_of(negated(a), negated(b)))
        else
            r = of_two(op_minimum, a, b)
        end if
    end function smaller_of

    recursive function larger_of(a, b) result(r)
        type(value), intent(in) :: a, b
        type(value) :: r

        if (a%node == b%node .and. a%sign == b%sign) then
            r = a
        else if (a%sign < 0 .and. b%sign < 0) then
            r = negated(smaller_of(negated(a), negated(b)))
        else
            r = of_two(op_maximum, a, b)
        end if
    end function larger_of

    !> `yes` where the condition is positive, else `no`.
    recursive function selected(condition, yes, no) result(r)
        type(value), intent(in) :: condition, yes, no
        type(value) :: r
        type(value) :: c, y, n

        if (yes%node == no%node .and. yes%sign == no%sign) then
            r = yes
        else if (is_constant(condition)) then
            r = no
            if (constant_of(condition) > 0) r = yes
        else if (yes%sign < 0 .and. no%sign < 0) then
            r = negated(selected(condition, negated(yes), negated(no)))
        else
            c = positive(condition)
            y = positive(yes)
            n = positive(no)
            r = value(new_node(op_select, c%node, y%node, n%node), 1)
        end if
    end function selected

    !> What stands in a curve; b is ignored where the look-up takes one operand.
    function looked_up(kind, look, a, b) result(r)
        integer, intent(in) :: kind                 !! a look-up
        integer, intent(in) :: look                 !! in which curve for what
        type(value), intent(in) :: a, b
        type(value) :: r
        type(value) :: first, second

        first = positive(a)
        second%node = 0
        if (kind /= op_piece) second = positive(b)
        r = value(new_node(kind, first%node, second%node, look), 1)
    end function looked_up

    !> Any operation, by its kind; operands that it does not take are ignored.
    function result_of(kind, a, b, c, look) result(r)
        integer, intent(in) :: kind                 !! one of `op_*` with operands
        type(value), intent(in) :: a, b, c
        integer, intent(in), optional :: look       !! of a look-up: in which curve for what
        type(value) :: r

        select case (kind)
        case (op_add)
            r = sum_of(a, b)
        case (op_subtract)
            r = sum_of(a, negated(b))
        case (op_multiply)
            r = product_of(a, b)
        case (op_reciprocal)
            r = reciprocal_of(a)
        case (op_root)
            r = root_of(a)
        case (op_sine)
            r = sine_of(a)
        case (op_cosine)
            r = cosine_of(a)
        case (op_arctangent)
            r = arctangent_of(a, b)
        case (op_minimum)
            r = smaller_of(a, b)
        case (op_maximum)
            r = larger_of(a, b)
        case (op_absolute)
            r = magnitude_of(a)
        case (op_whole)
            r = whole_of(a)
        case (op_piece, op_nearest, op_farthest)
            r = looked_up(kind, look, a, b)
        case default
            r = selected(a, b, c)
        end select
    end function result_of

    ! ---------------------------------------------------------------- helpers

    !> The same number with a plus sign, for operations to which signs matter.
    function positive(a) result(r)
        type(value), intent(in) :: a
        type(value) :: r
        type(value) :: nothing

        r = a
        if (a%sign > 0) return
        nothing = zero()
        r = value(new_node(op_subtract, nothing%node, a%node), 1)
    end function positive

    function of_one(kind, a) result(r)
        integer, intent(in) :: kind
        type(value), intent(in) :: a
        type(value) :: r
        type(value) :: operand

        if (is_constant(a)) then
            r = constant_in_quad(operate(kind, constant_of(a), 0.0_real128, 0.0_real128))
        else
            operand = positive(a)
            r = value(new_node(kind, operand%node), 1)
        end if
    end function of_one

    function of_two(kind, a, b) result(r)
        integer, intent(in) :: kind
        type(value), intent(in) :: a, b
        type(value) :: r
        type(value) :: first, second

        if (is_constant(a) .and. is_constant(b)) then
            r = constant_in_quad(operate(kind, constant_of(a), constant_of(b), 0.0_real128))
        else
            first = positive(a)
            second = positive(b)
            r = value(new_node(kind, first%node, second%node), 1)
        end if
    end function of_two

    function new_node(kind, a, b, c) result(node)
        integer, intent(in) :: kind, a
        integer, intent(in), optional :: b, c
        integer :: node
        integer :: operand(3)
        type(record_type), pointer :: record

        record => open_record_of_thread()
        operand = 0
        operand(1) = a
        if (present(b)) operand(2) = b
        if (present(c)) operand(3) = c
        node = find_node(record, kind, operand)
    end function new_node
end module linkdyn_folding
