!> Arithmetic on values: physics is written with these operators and runs once a scene, to write its record.
!>
!>     type(value) :: a, b, c
!>     c = sqrt(a*a + b*b)        ! two products, a sum and a root in the open record
module linkdyn_value
    use linkdyn_folding, only: sum_of, product_of, reciprocal_of, root_of, sine_of, cosine_of, arctangent_of, smaller_of, &
        larger_of, magnitude_of, selected, whole_of, looked_up
    use linkdyn_kinds, only: wp
    use linkdyn_operation, only: op_piece, op_nearest, op_farthest
    use linkdyn_piecewise, only: look_at
    use linkdyn_record, only: value, constant, zero, one, is_zero, is_one, is_constant, number_of, negated, declare_inverse
    implicit none (type, external)
    private
    public :: value, constant, zero, one, is_zero, is_one, is_constant, number_of, declare_inverse
    public :: operator(+), operator(-), operator(*), operator(/), sqrt, sin, cos, atan2, min, max, abs, reciprocal, select
    public :: square, nearest_whole, piece_at, nearest_place, farthest_place

    interface operator(+)
        module procedure add, add_number, add_to_number
    end interface operator(+)
    interface operator(-)
        module procedure subtract, subtract_number, subtract_from_number, negated
    end interface operator(-)
    interface operator(*)
        module procedure multiply, multiply_by_number, multiply_number
    end interface operator(*)
    interface operator(/)
        module procedure divide, divide_by_number, divide_number
    end interface operator(/)
    interface sqrt
        module procedure root
    end interface sqrt
    interface sin
        module procedure sine
    end interface sin
    interface cos
        module procedure cosine
    end interface cos
    interface atan2
        module procedure arctangent
    end interface atan2
    interface min
        module procedure minimum
    end interface min
    interface max
        module procedure maximum
    end interface max
    interface abs
        module procedure magnitude
    end interface abs
    interface reciprocal
        module procedure reciprocal_value
    end interface reciprocal
    !> `select(condition, yes, no)`: yes where condition > 0, else no.
    interface select
        module procedure select_value
    end interface select

contains

    impure elemental function add(a, b) result(r)
        type(value), intent(in) :: a, b
        type(value) :: r

        r = sum_of(a, b)
    end function add

    impure elemental function add_number(a, x) result(r)
        type(value), intent(in) :: a
        real(wp), intent(in) :: x
        type(value) :: r

        r = sum_of(a, constant(x))
    end function add_number

    impure elemental function add_to_number(x, a) result(r)
        real(wp), intent(in) :: x
        type(value), intent(in) :: a
        type(value) :: r

        r = sum_of(constant(x), a)
    end function add_to_number

    impure elemental function subtract(a, b) result(r)
        type(value), intent(in) :: a, b
        type(value) :: r

        r = sum_of(a, negated(b))
    end function subtract

    impure elemental function subtract_number(a, x) result(r)
        type(value), intent(in) :: a
        real(wp), intent(in) :: x
        type(value) :: r

        r = sum_of(a, constant(-x))
    end function subtract_number

    impure elemental function subtract_from_number(x, a) result(r)
        real(wp), intent(in) :: x
        type(value), intent(in) :: a
        type(value) :: r

        r = sum_of(constant(x), negated(a))
    end function subtract_from_number

    impure elemental function multiply(a, b) result(r)
        type(value), intent(in) :: a, b
        type(value) :: r

        r = product_of(a, b)
    end function multiply

    impure elemental function multiply_by_number(a, x) result(r)
        type(value), intent(in) :: a
        real(wp), intent(in) :: x
        type(value) :: r

        r = product_of(constant(x), a)
    end function multiply_by_number

    impure elemental function multiply_number(x, a) result(r)
        real(wp), intent(in) :: x
        type(value), intent(in) :: a
        type(value) :: r

        r = product_of(constant(x), a)
    end function multiply_number

    impure elemental function divide(a, b) result(r)
        type(value), intent(in) :: a, b
        type(value) :: r

        r = product_of(a, reciprocal_of(b))
    end function divide

    impure elemental function divide_by_number(a, x) result(r)
        type(value), intent(in) :: a
        real(wp), intent(in) :: x
        type(value) :: r

        r = product_of(a, reciprocal_of(constant(x)))
    end function divide_by_number

    impure elemental function divide_number(x, a) result(r)
        real(wp), intent(in) :: x
        type(value), intent(in) :: a
        type(value) :: r

        r = product_of(constant(x), reciprocal_of(a))
    end function divide_number

    impure elemental function root(a) result(r)
        type(value), intent(in) :: a
        type(value) :: r

        r = root_of(a)
    end function root

    impure elemental function sine(a) result(r)
        type(value), intent(in) :: a
        type(value) :: r

        r = sine_of(a)
    end function sine

    impure elemental function cosine(a) result(r)
        type(value), intent(in) :: a
        type(value) :: r

        r = cosine_of(a)
    end function cosine

    !> Angle of the direction (along, across), in (-pi, pi].
    impure elemental function arctangent(across, along) result(r)
        type(value), intent(in) :: across, along
        type(value) :: r

        r = arctangent_of(across, along)
    end function arctangent

    impure elemental function minimum(a, b) result(r)
        type(value), intent(in) :: a, b
        type(value) :: r

        r = smaller_of(a, b)
    end function minimum

    impure elemental function maximum(a, b) result(r)
        type(value), intent(in) :: a, b
        type(value) :: r

        r = larger_of(a, b)
    end function maximum

    impure elemental function magnitude(a) result(r)
        type(value), intent(in) :: a
        type(value) :: r

        r = magnitude_of(a)
    end function magnitude

    impure elemental function reciprocal_value(a) result(r)
        type(value), intent(in) :: a
        type(value) :: r

        r = reciprocal_of(a)
    end function reciprocal_value

    impure elemental function select_value(condition, yes, no) result(r)
        type(value), intent(in) :: condition, yes, no
        type(value) :: r

        r = selected(condition, yes, no)
    end function select_value

    !> The whole number nearest to a.
    impure elemental function nearest_whole(a) result(r)
        type(value), intent(in) :: a
        type(value) :: r

        r = whole_of(a)
    end function nearest_whole

    !> A component of a curve of the record at a place, or a derivative of it by the place.
    function piece_at(curve, component, order, place) result(r)
        integer, intent(in) :: curve               !! its number, as `add_curve` gives it
        integer, intent(in) :: component, order    !! 1, 2; 0 to 3
        type(value), intent(in) :: place
        type(value) :: r

        r = looked_up(op_piece, look_at(curve, component, order), place, place)
    end function piece_at

    !> The place of a curve nearest to a point.
    function nearest_place(curve, x, y) result(r)
        integer, intent(in) :: curve
        type(value), intent(in) :: x, y
        type(value) :: r

        r = looked_up(op_nearest, look_at(curve, 1, 0), x, y)
    end function nearest_place

    !> The place of a curve farthest in a direction.
    function farthest_place(curve, x, y) result(r)
        integer, intent(in) :: curve
        type(value), intent(in) :: x, y            !! of a unit vector
        type(value) :: r

        r = looked_up(op_farthest, look_at(curve, 1, 0), x, y)
    end function farthest_place

    impure elemental function square(a) result(r)
        type(value), intent(in) :: a
        type(value) :: r

        r = product_of(a, a)
    end function square
end module linkdyn_value
