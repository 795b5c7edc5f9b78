!> Differentiation of a record, backwards: the derivatives of one value by many.
!>
!> One sweep from the value down to what it is made of gives all its derivatives at the price of a few evaluations.
!> Applied to the solution of linear equations, by their right-hand sides, it solves with the transposed matrix.
module linkdyn_gradient
    use linkdyn_curve_values, only: slopes_of_look_up
    use linkdyn_kinds, only: wp
    use linkdyn_operation, only: n_operand, op_add, op_subtract, op_multiply, op_reciprocal, op_root, op_sine, op_cosine, &
        op_arctangent, op_minimum, op_maximum, op_absolute, op_select, op_piece, op_nearest, op_farthest
    use linkdyn_record, only: record_type, open_record_of_thread
    use linkdyn_value, only: value, zero, one, is_zero, operator(+), operator(-), operator(*), sin, cos, reciprocal, select, square
    implicit none (type, external)
    private
    public :: gradient

contains

    !> Derivatives of `v` by the values of a list, which must be made before whatever depends on them.
    function gradient(v, by) result(derivative)
        type(value), intent(in) :: v
        type(value), intent(in) :: by(:)
        type(value) :: derivative(size(by))
        type(record_type), pointer :: record
        type(value), allocatable :: adjoint(:)         !! (node) derivative of v by it
        logical, allocatable :: depends(:)             !! (node) on the list
        integer :: node, i, n

        record => open_record_of_thread()
        n = v%node
        allocate (adjoint(n), depends(n))
        adjoint = zero()
        depends = .false.
        do i = 1, size(by)
            if (by(i)%node <= n) depends(by(i)%node) = .true.
        end do
        do node = 1, n
            do i = 1, n_operand(record%kind(node))
                depends(node) = depends(node) .or. depends(record%operand(i, node))
            end do
        end do
        adjoint(n) = one()
        adjoint(n)%sign = v%sign
        do node = n, 1, -1
            if (.not. depends(node) .or. is_zero(adjoint(node))) cycle
            call hand_down(node)
        end do
        do i = 1, size(by)
            derivative(i) = zero()
            if (by(i)%node > n) cycle
            derivative(i) = adjoint(by(i)%node)
            if (by(i)%sign < 0) derivative(i) = -derivative(i)
        end do

    contains

        !> To the operands of a node.
        subroutine hand_down(node)
            integer, intent(in) :: node
            type(value) :: a, b, c, d, v, slope(2)

            if (n_operand(record%kind(node)) == 0) return
            a = operand(1)
            b = operand(2)
            c = operand(3)
            v = value(node, 1)
            d = adjoint(node)
            select case (record%kind(node))
            case (op_add)
                call give(1, d)
                call give(2, d)
            case (op_subtract)
                call give(1, d)
                call give(2, -d)
            case (op_multiply)
                call give(1, d*b)
                call give(2, d*a)
            case (op_reciprocal)
                call give(1, -(d*square(v)))
            case (op_root)
                call give(1, (0.5_wp*d)*reciprocal(v))
            case (op_sine)
                call give(1, d*cos(a))
            case (op_cosine)
                call give(1, -(d*sin(a)))
            case (op_arctangent)
                call give(1, (d*b)*reciprocal(a*a + b*b))
                call give(2, -((d*a)*reciprocal(a*a + b*b)))
            case (op_minimum)
                call give(1, select(b - a, d, zero()))
                call give(2, select(b - a, zero(), d))
            case (op_maximum)
                call give(1, select(a - b, d, zero()))
                call give(2, select(a - b, zero(), d))
            case (op_absolute)
                call give(1, select(a, d, -d))
            case (op_piece)
                slope = slopes_of_look_up(op_piece, record%operand(3, node), a, a, v)
                call give(1, d*slope(1))
            case (op_nearest, op_farthest)
                slope = slopes_of_look_up(record%kind(node), record%operand(3, node), a, b, v)
                call give(1, d*slope(1))
                call give(2, d*slope(2))
            case (op_select)
                call give(2, select(a, d, zero()))
                call give(3, select(a, zero(), d))
            end select
        end subroutine hand_down

        function operand(i) result(x)
            integer, intent(in) :: i
            type(value) :: x

            x = value(max(1, record%operand(i, node)), 1)
        end function operand

        subroutine give(i, d)
            integer, intent(in) :: i
            type(value), intent(in) :: d

            associate (x => record%operand(i, node))
                if (depends(x)) adjoint(x) = adjoint(x) + d
            end associate
        end subroutine give
    end function gradient
end module linkdyn_gradient
