!> The operations of a record: their names, how many operands they take, what they compute.
module linkdyn_operation
    use, intrinsic :: iso_fortran_env, only: real64, real128
    implicit none (type, external)
    private
    public :: operate, operation_name, n_operand, n_operation
    public :: op_constant, op_input, op_unknown, op_add, op_subtract, op_multiply, op_reciprocal, op_root
    public :: op_sine, op_cosine, op_arctangent, op_minimum, op_maximum, op_absolute, op_select, op_whole
    public :: op_piece, op_nearest, op_farthest, is_look_up

    integer, parameter :: op_constant = 1      !! a number that the scene fixes
    integer, parameter :: op_input = 2         !! a number given when the record is run
    integer, parameter :: op_unknown = 3       !! stands in equations until they are solved
    integer, parameter :: op_add = 4           !! a + b
    integer, parameter :: op_subtract = 5      !! a - b
    integer, parameter :: op_multiply = 6      !! a b
    integer, parameter :: op_reciprocal = 7    !! 1/a
    integer, parameter :: op_root = 8          !! square root of a
    integer, parameter :: op_sine = 9
    integer, parameter :: op_cosine = 10
    integer, parameter :: op_arctangent = 11   !! angle of the direction (b, a), in (-pi, pi]
    integer, parameter :: op_minimum = 12      !! a if a < b, else b
    integer, parameter :: op_maximum = 13      !! a if a > b, else b
    integer, parameter :: op_absolute = 14     !! |a|
    integer, parameter :: op_select = 15       !! b if a > 0, else c
    integer, parameter :: op_whole = 16        !! the whole number nearest to a; to the even one of two
    ! ---- look-ups in a closed curve (see `linkdyn_piecewise`); the third operand says in which, and is no node
    integer, parameter :: op_piece = 17        !! a component at place a, or a derivative of it
    integer, parameter :: op_nearest = 18      !! the place nearest to the point (a, b)
    integer, parameter :: op_farthest = 19     !! the place farthest in the direction (a, b)
    integer, parameter :: n_operation = 19
    character(len=10), parameter :: operation_name(n_operation) = [character(len=10) :: "constant", "input", "unknown", &
        "add", "subtract", "multiply", "reciprocal", "root", "sine", "cosine", "arctangent", "minimum", "maximum", &
        "absolute", "select", "whole", "piece", "nearest", "farthest"]
    integer, parameter :: n_operand(n_operation) = [0, 0, 0, 2, 2, 2, 1, 1, 1, 1, 2, 2, 2, 1, 3, 1, 1, 2, 2]

    !> Result of an operation on numbers; operands that it does not take are ignored.
    interface operate
        module procedure operate_real64, operate_real128
    end interface operate

contains

    !> Does an operation read a curve?
    elemental logical function is_look_up(kind)
        integer, intent(in) :: kind             !! one of `op_*`, or of what a schedule adds

        is_look_up = kind == op_piece .or. kind == op_nearest .or. kind == op_farthest
    end function is_look_up

    elemental function operate_real64(kind, a, b, c) result(r)
        integer, intent(in) :: kind             !! one of `op_*` with operands
        real(real64), intent(in) :: a, b, c
        integer, parameter :: rk = real64
        real(rk) :: r

        include "linkdyn_operate.inc"
    end function operate_real64

    elemental function operate_real128(kind, a, b, c) result(r)
        integer, intent(in) :: kind
        real(real128), intent(in) :: a, b, c
        integer, parameter :: rk = real128
        real(rk) :: r

        include "linkdyn_operate.inc"
    end function operate_real128
end module linkdyn_operation
