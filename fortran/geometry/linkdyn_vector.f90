!> Vectors and rotations of values, with the operators of mechanics. Formulas in space written with them become formulas
!> of the plane by themselves where z components are zero and rotations turn about z.
module linkdyn_vector
    use linkdyn_kinds, only: wp
    use linkdyn_value, only: value, constant, zero, one, is_zero, abs, operator(+), operator(-), operator(*)
    implicit none (type, external)
    private
    public :: vector, rotation, vector_of, zero_vector, unit_vector, identity_rotation, components, sum_of_magnitudes
    public :: operator(+), operator(-), operator(*), operator(.dot.), operator(.cross.), operator(.rotate.), operator(.unrotate.)

    type :: vector
        type(value) :: x, y, z
    end type vector

    !> Columns are the images of the axes: link axes in world axes, for a link's rotation.
    type :: rotation
        type(vector) :: x, y, z
    end type rotation

    !> A vector from three numbers or three values.
    interface vector_of
        module procedure vector_of_numbers, vector_of_values
    end interface vector_of
    interface operator(+)
        module procedure add
    end interface operator(+)
    interface operator(-)
        module procedure subtract, negative
    end interface operator(-)
    interface operator(*)
        module procedure scale_by_value, scale_by_number, chain_rotations
    end interface operator(*)
    interface operator(.dot.)
        module procedure dot
    end interface operator(.dot.)
    interface operator(.cross.)
        module procedure cross
    end interface operator(.cross.)
    !> From the axes of the rotation to those that it starts from: R v.
    interface operator(.rotate.)
        module procedure rotate
    end interface operator(.rotate.)
    !> The other way: R^T v.
    interface operator(.unrotate.)
        module procedure unrotate
    end interface operator(.unrotate.)

contains

    function vector_of_numbers(x) result(v)
        real(wp), intent(in) :: x(3)
        type(vector) :: v

        v = vector(constant(x(1)), constant(x(2)), constant(x(3)))
    end function vector_of_numbers

    function vector_of_values(x) result(v)
        type(value), intent(in) :: x(3)
        type(vector) :: v

        v = vector(x(1), x(2), x(3))
    end function vector_of_values

    function zero_vector() result(v)
        type(vector) :: v

        v = vector(zero(), zero(), zero())
    end function zero_vector

    !> Unit vector along axis k.
    function unit_vector(k) result(v)
        integer, intent(in) :: k
        type(vector) :: v

        v = zero_vector()
        if (k == 1) v%x = one()
        if (k == 2) v%y = one()
        if (k == 3) v%z = one()
    end function unit_vector

    function identity_rotation() result(r)
        type(rotation) :: r

        r = rotation(unit_vector(1), unit_vector(2), unit_vector(3))
    end function identity_rotation

    pure function components(v) result(x)
        type(vector), intent(in) :: v
        type(value) :: x(3)

        x = [v%x, v%y, v%z]
    end function components

    !> Do all components vanish whatever the mechanism does?
    logical function is_null(v)
        type(vector), intent(in) :: v

        is_null = is_zero(v%x) .and. is_zero(v%y) .and. is_zero(v%z)
    end function is_null

    !> How large a vector is, without a root: its length, or up to sqrt(3) times that.
    function sum_of_magnitudes(v) result(total)
        type(vector), intent(in) :: v
        type(value) :: total

        total = abs(v%x) + abs(v%y) + abs(v%z)
    end function sum_of_magnitudes

    impure elemental function add(a, b) result(r)
        type(vector), intent(in) :: a, b
        type(vector) :: r

        r = vector(a%x + b%x, a%y + b%y, a%z + b%z)
    end function add

    impure elemental function subtract(a, b) result(r)
        type(vector), intent(in) :: a, b
        type(vector) :: r

        r = vector(a%x - b%x, a%y - b%y, a%z - b%z)
    end function subtract

    impure elemental function negative(a) result(r)
        type(vector), intent(in) :: a
        type(vector) :: r

        r = vector(-a%x, -a%y, -a%z)
    end function negative

    impure elemental function scale_by_value(k, a) result(r)
        type(value), intent(in) :: k
        type(vector), intent(in) :: a
        type(vector) :: r

        r = vector(k*a%x, k*a%y, k*a%z)
    end function scale_by_value

    impure elemental function scale_by_number(k, a) result(r)
        real(wp), intent(in) :: k
        type(vector), intent(in) :: a
        type(vector) :: r

        r = vector(k*a%x, k*a%y, k*a%z)
    end function scale_by_number

    impure elemental function dot(a, b) result(r)
        type(vector), intent(in) :: a, b
        type(value) :: r

        r = a%x*b%x + a%y*b%y + a%z*b%z
    end function dot

    impure elemental function cross(a, b) result(r)
        type(vector), intent(in) :: a, b
        type(vector) :: r

        r = vector(a%y*b%z - a%z*b%y, a%z*b%x - a%x*b%z, a%x*b%y - a%y*b%x)
    end function cross

    impure elemental function rotate(r, v) result(w)
        type(rotation), intent(in) :: r
        type(vector), intent(in) :: v
        type(vector) :: w

        w = v%x*r%x + v%y*r%y + v%z*r%z
    end function rotate

    impure elemental function unrotate(r, v) result(w)
        type(rotation), intent(in) :: r
        type(vector), intent(in) :: v
        type(vector) :: w

        w = vector(dot(r%x, v), dot(r%y, v), dot(r%z, v))
    end function unrotate

    !> First `b`, then `a`: from the axes of b to those that a starts from.
    impure elemental function chain_rotations(a, b) result(r)
        type(rotation), intent(in) :: a, b
        type(rotation) :: r

        r = rotation(rotate(a, b%x), rotate(a, b%y), rotate(a, b%z))
    end function chain_rotations
end module linkdyn_vector
