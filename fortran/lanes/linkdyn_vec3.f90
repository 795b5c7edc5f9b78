!> Vectors and rotations in space, on a block of lanes: every component holds `lanes` samples side by side.
!>
!> The operators let the mechanics read like the formulas while each line compiles to plain vector
!> instructions. Procedures are tiny on purpose.
module linkdyn_vec3
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    implicit none (type, external)
    private
    public :: vec3, mat3
    public :: operator(+), operator(-), operator(*), operator(.dot.), operator(.cross.)
    public :: operator(.rotate.), operator(.unrotate.)
    public :: vec3_of, zero_vec3, identity_mat3, unit, component, lane_of, same_lanes, mat3_lane

    !> A vector on lanes.
    type :: vec3
        real(wp) :: x(lanes), y(lanes), z(lanes)
    end type vec3

    !> A rotation matrix on lanes, by columns: the images of the link's own x, y, z axes.
    type :: mat3
        type(vec3) :: x, y, z
    end type mat3

    interface operator(+)
        module procedure add_vec3
    end interface operator(+)
    interface operator(-)
        module procedure subtract_vec3, negate_vec3
    end interface operator(-)
    !> Scaling by lanes or by one number, and the product of two rotations.
    interface operator(*)
        module procedure scale_by_lanes, scale_by_number, multiply_mat3
    end interface operator(*)
    interface operator(.dot.)
        module procedure dot_vec3, dot_fixed
    end interface operator(.dot.)
    interface operator(.cross.)
        module procedure cross_vec3, cross_fixed
    end interface operator(.cross.)
    !> Link axes to world axes; the vector may be on lanes or fixed in the link (three numbers).
    interface operator(.rotate.)
        module procedure rotate_vec3, rotate_fixed
    end interface operator(.rotate.)
    !> World axes to link axes.
    interface operator(.unrotate.)
        module procedure unrotate_vec3
    end interface operator(.unrotate.)

contains

    pure function add_vec3(a, b) result(c)
        type(vec3), intent(in) :: a, b
        type(vec3) :: c

        c%x = a%x + b%x
        c%y = a%y + b%y
        c%z = a%z + b%z
    end function add_vec3

    pure function subtract_vec3(a, b) result(c)
        type(vec3), intent(in) :: a, b
        type(vec3) :: c

        c%x = a%x - b%x
        c%y = a%y - b%y
        c%z = a%z - b%z
    end function subtract_vec3

    pure function negate_vec3(a) result(c)
        type(vec3), intent(in) :: a
        type(vec3) :: c

        c%x = -a%x
        c%y = -a%y
        c%z = -a%z
    end function negate_vec3

    pure function scale_by_lanes(s, a) result(c)
        real(wp), intent(in) :: s(lanes)
        type(vec3), intent(in) :: a
        type(vec3) :: c

        c%x = s*a%x
        c%y = s*a%y
        c%z = s*a%z
    end function scale_by_lanes

    pure function scale_by_number(s, a) result(c)
        real(wp), intent(in) :: s
        type(vec3), intent(in) :: a
        type(vec3) :: c

        c%x = s*a%x
        c%y = s*a%y
        c%z = s*a%z
    end function scale_by_number

    pure function dot_vec3(a, b) result(c)
        type(vec3), intent(in) :: a, b
        real(wp) :: c(lanes)

        c = a%x*b%x + a%y*b%y + a%z*b%z
    end function dot_vec3

    !> Dot product with one vector that is the same on all lanes.
    pure function dot_fixed(a, b) result(c)
        type(vec3), intent(in) :: a
        real(wp), intent(in) :: b(3)
        real(wp) :: c(lanes)

        c = a%x*b(1) + a%y*b(2) + a%z*b(3)
    end function dot_fixed

    pure function cross_vec3(a, b) result(c)
        type(vec3), intent(in) :: a, b
        type(vec3) :: c

        c%x = a%y*b%z - a%z*b%y
        c%y = a%z*b%x - a%x*b%z
        c%z = a%x*b%y - a%y*b%x
    end function cross_vec3

    !> Cross product with one vector that is the same on all lanes.
    pure function cross_fixed(a, b) result(c)
        type(vec3), intent(in) :: a
        real(wp), intent(in) :: b(3)
        type(vec3) :: c

        c%x = a%y*b(3) - a%z*b(2)
        c%y = a%z*b(1) - a%x*b(3)
        c%z = a%x*b(2) - a%y*b(1)
    end function cross_fixed

    pure function rotate_vec3(r, v) result(c)
        type(mat3), intent(in) :: r
        type(vec3), intent(in) :: v
        type(vec3) :: c

        c%x = r%x%x*v%x + r%y%x*v%y + r%z%x*v%z
        c%y = r%x%y*v%x + r%y%y*v%y + r%z%y*v%z
        c%z = r%x%z*v%x + r%y%z*v%y + r%z%z*v%z
    end function rotate_vec3

    pure function rotate_fixed(r, v) result(c)
        type(mat3), intent(in) :: r
        real(wp), intent(in) :: v(3)
        type(vec3) :: c

        c%x = r%x%x*v(1) + r%y%x*v(2) + r%z%x*v(3)
        c%y = r%x%y*v(1) + r%y%y*v(2) + r%z%y*v(3)
        c%z = r%x%z*v(1) + r%y%z*v(2) + r%z%z*v(3)
    end function rotate_fixed

    pure function unrotate_vec3(r, v) result(c)
        type(mat3), intent(in) :: r
        type(vec3), intent(in) :: v
        type(vec3) :: c

        c%x = r%x%x*v%x + r%x%y*v%y + r%x%z*v%z
        c%y = r%y%x*v%x + r%y%y*v%y + r%y%z*v%z
        c%z = r%z%x*v%x + r%z%y*v%y + r%z%z*v%z
    end function unrotate_vec3

    pure function multiply_mat3(a, b) result(c)
        type(mat3), intent(in) :: a, b
        type(mat3) :: c

        c%x = rotate_vec3(a, b%x)
        c%y = rotate_vec3(a, b%y)
        c%z = rotate_vec3(a, b%z)
    end function multiply_mat3

    !> One vector on all lanes.
    pure function vec3_of(v) result(c)
        real(wp), intent(in) :: v(3)
        type(vec3) :: c

        c%x = v(1)
        c%y = v(2)
        c%z = v(3)
    end function vec3_of

    pure function zero_vec3() result(c)
        type(vec3) :: c

        c%x = 0
        c%y = 0
        c%z = 0
    end function zero_vec3

    pure function identity_mat3() result(c)
        type(mat3) :: c

        c = same_lanes(reshape([real(wp) :: 1, 0, 0, 0, 1, 0, 0, 0, 1], [3, 3]))
    end function identity_mat3

    !> One matrix on all lanes.
    pure function same_lanes(m) result(c)
        real(wp), intent(in) :: m(3, 3)    !! columns are the images of the axes
        type(mat3) :: c

        c%x = vec3_of(m(:, 1))
        c%y = vec3_of(m(:, 2))
        c%z = vec3_of(m(:, 3))
    end function same_lanes

    !> The vector scaled to length one; its length is not checked.
    pure function unit(a) result(c)
        type(vec3), intent(in) :: a
        type(vec3) :: c

        c = scale_by_lanes(1/sqrt(dot_vec3(a, a)), a)
    end function unit

    !> Component 1, 2 or 3 (x, y, z).
    pure function component(a, k) result(c)
        type(vec3), intent(in) :: a
        integer, intent(in) :: k
        real(wp) :: c(lanes)

        select case (k)
        case (1)
            c = a%x
        case (2)
            c = a%y
        case default
            c = a%z
        end select
    end function component

    !> The vector of one lane.
    pure function lane_of(a, lane) result(v)
        type(vec3), intent(in) :: a
        integer, intent(in) :: lane
        real(wp) :: v(3)

        v = [a%x(lane), a%y(lane), a%z(lane)]
    end function lane_of

    !> The matrix of one lane, columns as in `mat3`.
    pure function mat3_lane(r, lane) result(m)
        type(mat3), intent(in) :: r
        integer, intent(in) :: lane
        real(wp) :: m(3, 3)

        m(:, 1) = lane_of(r%x, lane)
        m(:, 2) = lane_of(r%y, lane)
        m(:, 3) = lane_of(r%z, lane)
    end function mat3_lane
end module linkdyn_vec3
