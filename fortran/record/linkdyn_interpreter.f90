!> The reference interpreter: one sample through a kernel, in whatever precision the engine is built. Slow, and simple
!> enough to be believed; the fast ones (`c/linkdyn_lanes.c`) must agree with it to the last bit.
module linkdyn_interpreter
    use linkdyn_kernel, only: kernel_type
    use linkdyn_kinds, only: wp
    use linkdyn_multiply_add, only: multiply_add
    use linkdyn_operation, only: operate, op_piece, op_nearest, op_farthest
    use linkdyn_piecewise, only: look_up, curve_of, which_of
    use linkdyn_schedule, only: op_multiply_add, op_multiply_subtract, op_subtract_product
    implicit none (type, external)
    private
    public :: interpret, run_steps

contains

    !> Outputs for inputs.
    subroutine interpret(kernel, input, output)
        type(kernel_type), intent(in) :: kernel
        real(wp), intent(in) :: input(:)               !! (n_input)
        real(wp), intent(out) :: output(:)             !! (n_output)
        real(wp) :: slot(0:kernel%n_slot)
        integer :: g, first, done

        slot(0) = 0
        slot(1:kernel%n_input) = input
        slot(kernel%n_input + 1:kernel%n_input + kernel%n_constant) = kernel%constant
        first = 1
        done = 0
        do g = 1, size(kernel%group_end)
            call run_steps(kernel, done + 1, kernel%step_end(g), slot)
            done = kernel%step_end(g)
            associate (last => kernel%group_end(g))
                output(first:last) = kernel%output_sign(first:last)*slot(kernel%output_slot(first:last))
                first = last + 1
            end associate
        end do
    end subroutine interpret

    !> Steps first, ..., last on the slots of one sample.
    pure subroutine run_steps(kernel, first, last, slot)
        type(kernel_type), intent(in) :: kernel
        integer, intent(in) :: first, last
        real(wp), intent(inout) :: slot(0:)            !! slot 0: of operands that are not there
        real(wp) :: a, b, c
        integer :: k

        do k = first, last
            associate (s => kernel%step(k))
                a = slot(s%operand(1))
                b = slot(s%operand(2))
                c = slot(s%operand(3))
                select case (s%kind)
                case (op_multiply_add)
                    slot(s%result) = multiply_add(a, b, c)
                case (op_multiply_subtract)
                    slot(s%result) = multiply_add(a, b, -c)
                case (op_subtract_product)
                    slot(s%result) = multiply_add(-a, b, c)
                case (op_piece, op_nearest, op_farthest)
                    slot(s%result) = look_up(kernel%curve(curve_of(s%look)), s%kind, which_of(s%look), a, b)
                case default
                    slot(s%result) = operate(s%kind, a, b, c)
                end select
            end associate
        end do
    end subroutine run_steps
end module linkdyn_interpreter
