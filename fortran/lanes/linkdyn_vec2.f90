!> Vectors and rotations in the plane, on a block of lanes: the planar twin of `linkdyn_vec3`.
!>
!> What is a vector along z in space (angular rates, moments, cross products) is one number a lane here.
module linkdyn_vec2
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_trigonometry, only: sine_cosine
    implicit none (type, external)
    private
    public :: vec2, rot2
    public :: operator(+), operator(-), operator(*), operator(.dot.), operator(.cross.)
    public :: operator(.rotate.), operator(.unrotate.)
    public :: vec2_of, zero_vec2, perp, lane_of, identity_rot2, rot2_by_angle, rot2_of_directions, direction_of

    !> A vector on lanes.
    type :: vec2
        real(wp) :: x(lanes), y(lanes)
    end type vec2

    !> A rotation on lanes: cosine and sine of its angle.
    type :: rot2
        real(wp) :: c(lanes), s(lanes)
    end type rot2

    interface operator(+)
        module procedure add_vec2
    end interface operator(+)
    interface operator(-)
        module procedure subtract_vec2, negate_vec2
    end interface operator(-)
    !> Scaling by lanes or by one number, and the product of two rotations.
    interface operator(*)
        module procedure scale_by_lanes, scale_by_number, multiply_rot2
    end interface operator(*)
    interface operator(.dot.)
        module procedure dot_vec2
    end interface operator(.dot.)
    !> The z component of the cross product.
    interface operator(.cross.)
        module procedure cross_vec2
    end interface operator(.cross.)
    !> Link axes to world axes; the vector may be on lanes or fixed in the link (two numbers).
    interface operator(.rotate.)
        module procedure rotate_vec2, rotate_fixed
    end interface operator(.rotate.)
    !> World axes to link axes.
    interface operator(.unrotate.)
        module procedure unrotate_vec2
    end interface operator(.unrotate.)
    interface lane_of
        module procedure vec2_lane
    end interface lane_of

contains

    pure function add_vec2(a, b) result(c)
        type(vec2), intent(in) :: a, b
        type(vec2) :: c

        c%x = a%x + b%x
        c%y = a%y + b%y
    end function add_vec2

    pure function subtract_vec2(a, b) result(c)
        type(vec2), intent(in) :: a, b
        type(vec2) :: c

        c%x = a%x - b%x
        c%y = a%y - b%y
    end function subtract_vec2

    pure function negate_vec2(a) result(c)
        type(vec2), intent(in) :: a
        type(vec2) :: c

        c%x = -a%x
        c%y = -a%y
    end function negate_vec2

    pure function scale_by_lanes(s, a) result(c)
        real(wp), intent(in) :: s(lanes)
        type(vec2), intent(in) :: a
        type(vec2) :: c

        c%x = s*a%x
        c%y = s*a%y
    end function scale_by_lanes

    pure function scale_by_number(s, a) result(c)
        real(wp), intent(in) :: s
        type(vec2), intent(in) :: a
        type(vec2) :: c

        c%x = s*a%x
        c%y = s*a%y
    end function scale_by_number

    pure function dot_vec2(a, b) result(c)
        type(vec2), intent(in) :: a, b
        real(wp) :: c(lanes)

        c = a%x*b%x + a%y*b%y
    end function dot_vec2

    pure function cross_vec2(a, b) result(c)
        type(vec2), intent(in) :: a, b
        real(wp) :: c(lanes)

        c = a%x*b%y - a%y*b%x
    end function cross_vec2

    pure function rotate_vec2(r, v) result(c)
        type(rot2), intent(in) :: r
        type(vec2), intent(in) :: v
        type(vec2) :: c

        c%x = r%c*v%x - r%s*v%y
        c%y = r%s*v%x + r%c*v%y
    end function rotate_vec2

    pure function rotate_fixed(r, v) result(c)
        type(rot2), intent(in) :: r
        real(wp), intent(in) :: v(2)
        type(vec2) :: c

        c%x = r%c*v(1) - r%s*v(2)
        c%y = r%s*v(1) + r%c*v(2)
    end function rotate_fixed

    pure function unrotate_vec2(r, v) result(c)
        type(rot2), intent(in) :: r
        type(vec2), intent(in) :: v
        type(vec2) :: c

        c%x = r%c*v%x + r%s*v%y
        c%y = r%c*v%y - r%s*v%x
    end function unrotate_vec2

    pure function multiply_rot2(a, b) result(c)
        type(rot2), intent(in) :: a, b
        type(rot2) :: c

        c%c = a%c*b%c - a%s*b%s
        c%s = a%s*b%c + a%c*b%s
    end function multiply_rot2

    !> The vector turned by +90 degrees: z x a.
    pure function perp(a) result(c)
        type(vec2), intent(in) :: a
        type(vec2) :: c

        c%x = -a%y
        c%y = a%x
    end function perp

    !> One vector on all lanes.
    pure function vec2_of(v) result(c)
        real(wp), intent(in) :: v(2)
        type(vec2) :: c

        c%x = v(1)
        c%y = v(2)
    end function vec2_of

    pure function zero_vec2() result(c)
        type(vec2) :: c

        c%x = 0
        c%y = 0
    end function zero_vec2

    pure function identity_rot2() result(c)
        type(rot2) :: c

        c%c = 1
        c%s = 0
    end function identity_rot2

    pure function rot2_by_angle(angle) result(c)
        real(wp), intent(in) :: angle(lanes)    !! [rad]
        type(rot2) :: c

        call sine_cosine(angle, c%s, c%c)
    end function rot2_by_angle

    !> The rotation that takes a vector fixed in a link to a vector of the same length in the world.
    pure function rot2_of_directions(fixed, v) result(c)
        real(wp), intent(in) :: fixed(2)    !! link axes; not zero
        type(vec2), intent(in) :: v         !! world axes
        type(rot2) :: c
        real(wp) :: inverse_square

        inverse_square = 1/(fixed(1)**2 + fixed(2)**2)
        c%c = inverse_square*(fixed(1)*v%x + fixed(2)*v%y)
        c%s = inverse_square*(fixed(1)*v%y - fixed(2)*v%x)
    end function rot2_of_directions

    !> The image of the x axis.
    pure function direction_of(r) result(c)
        type(rot2), intent(in) :: r
        type(vec2) :: c

        c%x = r%c
        c%y = r%s
    end function direction_of

    !> The vector of one lane.
    pure function vec2_lane(a, lane) result(v)
        type(vec2), intent(in) :: a
        integer, intent(in) :: lane
        real(wp) :: v(2)

        v = [a%x(lane), a%y(lane)]
    end function vec2_lane
end module linkdyn_vec2
