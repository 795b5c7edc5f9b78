!> Differentiation of a record, forwards: the rate of any value from the rates of a few.
!>
!> Whoever makes values whose rate the physics knows (points and directions of a link, velocities, coordinates) says so
!> by `set_rate`; `rate_of` follows the operations down to these. Anything else that nothing depends on stands still.
!> Rates may contain unknowns: the rate of a constraint, with unknown velocities, is a row of equations.
module linkdyn_rates
    use linkdyn_curve_values, only: slopes_of_look_up
    use linkdyn_kinds, only: wp
    use linkdyn_node_values, only: node_values
    use linkdyn_operation, only: n_operand, op_add, op_subtract, op_multiply, op_reciprocal, op_root, op_sine, op_cosine, &
        op_arctangent, op_minimum, op_maximum, op_absolute, op_select, op_piece, op_nearest, op_farthest
    use linkdyn_record, only: record_type, open_record_of_thread
    use linkdyn_value, only: value, zero, operator(+), operator(-), operator(*), sin, cos, reciprocal, select, square
    implicit none (type, external)
    private
    public :: rate_map, set_rate, rate_of

    !> Rates of nodes, found so far. One map serves one way of moving.
    type :: rate_map
        type(node_values), private :: known = node_values()    !! nodes before its first stand still
    end type rate_map

    interface set_rate
        module procedure set_rate_of_one, set_rate_of_many
    end interface set_rate

contains

    subroutine set_rate_of_many(map, v, rate)
        type(rate_map), intent(inout) :: map
        type(value), intent(in) :: v(:), rate(:)
        integer :: k

        do k = 1, size(v)
            call set_rate_of_one(map, v(k), rate(k))
        end do
    end subroutine set_rate_of_many

    !> From here on the rate of `v` is this.
    subroutine set_rate_of_one(map, v, rate)
        type(rate_map), intent(inout) :: map
        type(value), intent(in) :: v, rate

        call map%known%put(v, rate)
    end subroutine set_rate_of_one

    !> Rate of a value. A stack instead of recursion, since records are long.
    function rate_of(map, v) result(rate)
        type(rate_map), intent(inout) :: map
        type(value), intent(in) :: v
        type(value) :: rate
        type(record_type), pointer :: record
        integer, allocatable :: stack(:)
        integer :: n, node, i, operand
        logical :: is_ready

        rate = zero()
        if (v%node < map%known%first) return
        record => open_record_of_thread()
        call map%known%make_room(v%node)
        stack = [v%node]
        n = 1
        do while (n > 0)
            node = stack(n)
            if (is_known(node)) then
                n = n - 1
                cycle
            end if
            is_ready = .true.
            do i = 1, n_operand(record%kind(node))
                operand = record%operand(i, node)
                if (is_known(operand)) cycle
                is_ready = .false.
                n = n + 1
                if (n > size(stack)) stack = [stack, stack]
                stack(n) = operand
            end do
            if (.not. is_ready) cycle
            call map%known%put(value(node, 1), rate_of_node(node))
            n = n - 1
        end do
        rate = map%known%get(v)

    contains

        pure logical function is_known(node)
            integer, intent(in) :: node

            is_known = node < map%known%first
            if (.not. is_known) is_known = map%known%has(node)
        end function is_known

        function rate_of_node(node) result(rate)
            integer, intent(in) :: node
            type(value) :: rate
            type(value) :: a, b, c, da, db, dc, v, slope(2)

            if (n_operand(record%kind(node)) == 0) then
                rate = zero()
                return
            end if
            call take(1, a, da)
            call take(2, b, db)
            call take(3, c, dc)
            v = value(node, 1)
            select case (record%kind(node))
            case (op_add)
                rate = da + db
            case (op_subtract)
                rate = da - db
            case (op_multiply)
                rate = da*b + a*db
            case (op_reciprocal)
                rate = -(da*square(v))
            case (op_root)
                rate = (0.5_wp*da)*reciprocal(v)
            case (op_sine)
                rate = da*cos(a)
            case (op_cosine)
                rate = -(da*sin(a))
            case (op_arctangent)
                rate = (da*b - a*db)*reciprocal(a*a + b*b)
            case (op_minimum)
                rate = select(b - a, da, db)
            case (op_maximum)
                rate = select(a - b, da, db)
            case (op_absolute)
                rate = select(a, da, -da)
            case (op_select)
                rate = select(a, db, dc)
            case (op_piece)
                slope = slopes_of_look_up(op_piece, record%operand(3, node), a, a, v)
                rate = slope(1)*da
            case (op_nearest, op_farthest)
                slope = slopes_of_look_up(record%kind(node), record%operand(3, node), a, b, v)
                rate = slope(1)*da + slope(2)*db
            case default
                rate = zero()    ! whole numbers stand still
            end select
        end function rate_of_node

        !> An operand and its rate, if the node has so many.
        subroutine take(i, operand, rate)
            integer, intent(in) :: i
            type(value), intent(out) :: operand, rate

            if (i > n_operand(record%kind(node))) return
            operand = value(record%operand(i, node), 1)
            rate = zero()
            if (operand%node >= map%known%first) rate = map%known%get(operand)
        end subroutine take
    end function rate_of
end module linkdyn_rates
