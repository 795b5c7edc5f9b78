!> The motion of all links, as values: what the steps of the kinematics find and everything else reads.
!>
!> Links that only slide on each other share their *turning*. Rates and accelerations of a turning, and the
!> acceleration of a link's origin, stand in world axes, in the link's own axes, or in both, as they were found; who asks
!> for the axes in which they are not yet known gets them by the rotation. All accelerations are those less gravity: the
!> frame accelerates upward, and weights need no terms of their own.
module linkdyn_bodies
    use linkdyn_value, only: value, operator(+), operator(-), operator(*)
    use linkdyn_vector, only: vector, rotation, zero_vector, identity_rotation, operator(+), operator(-), operator(*), &
        operator(.cross.), operator(.rotate.), operator(.unrotate.)
    implicit none (type, external)
    private
    public :: world_axes, own_axes
    public :: bodies_type, in_two_axes
    public :: make_bodies, set_vector, forget_vector
    public :: arm_of, point_position, point_velocity, point_acceleration, omega_of, alpha_of, rotation_of, acceleration_field
    public :: acceleration_of_origin, field_times, carried_velocity, carried_acceleration

    integer, parameter :: world_axes = 1, own_axes = 2

    !> A vector in world axes, in a link's own axes, or in both.
    type :: in_two_axes
        type(vector) :: v(2)
        logical :: is_known(2) = .false.
    end type in_two_axes

    !> How links of one orientation turn.
    type :: turning_type
        type(rotation) :: r                            !! from own to world axes
        type(in_two_axes) :: omega                     !! [rad/s]
        type(in_two_axes) :: alpha                     !! [rad/s2]
    end type turning_type

    !> How one link moves.
    type :: body_type
        integer :: turning = 0
        type(vector) :: position                       !! of its origin, world axes [m]
        type(vector) :: velocity                       !! [m/s]
        type(in_two_axes) :: acceleration              !! less gravity [m/s2]
    end type body_type

    type :: bodies_type
        type(turning_type), allocatable :: turning(:)  !! (0:), 0 is the frame's
        type(body_type), allocatable :: body(:)        !! (0:), 0 is the frame
    end type bodies_type

    !> Accelerations of points of a turning body from that of its origin: a(r) = a(0) + F r, with the matrix
    !> F = [alpha]x + [omega]x [omega]x, whose rows these are.
    type :: field_type
        type(vector) :: row(3)
    end type field_type

contains

    !> Only the frame moves yet: upward, as fast as things fall.
    subroutine make_bodies(turning_of, gravity, bodies)
        integer, intent(in) :: turning_of(:)           !! (link)
        type(vector), intent(in) :: gravity            !! [m/s2]
        type(bodies_type), intent(out) :: bodies
        integer :: l

        allocate (bodies%turning(0:max(0, maxval(turning_of))), bodies%body(0:size(turning_of)))
        do l = 1, size(turning_of)
            bodies%body(l)%turning = turning_of(l)
        end do
        associate (frame => bodies%body(0), turning => bodies%turning(0))
            turning%r = identity_rotation()
            call set_vector(turning%omega, world_axes, zero_vector())
            call set_vector(turning%omega, own_axes, zero_vector())
            call set_vector(turning%alpha, world_axes, zero_vector())
            call set_vector(turning%alpha, own_axes, zero_vector())
            frame%position = zero_vector()
            frame%velocity = zero_vector()
            call set_vector(frame%acceleration, world_axes, -gravity)
            call set_vector(frame%acceleration, own_axes, -gravity)
        end associate
    end subroutine make_bodies

    ! ---------------------------------------------------------------- vectors in two axes

    subroutine set_vector(pair, axes, v)
        type(in_two_axes), intent(inout) :: pair
        integer, intent(in) :: axes                    !! `world_axes` or `own_axes`
        type(vector), intent(in) :: v

        pair%v(axes) = v
        pair%is_known(axes) = .true.
    end subroutine set_vector

    !> Not known in either axes any more.
    subroutine forget_vector(pair)
        type(in_two_axes), intent(inout) :: pair

        pair%is_known = .false.
    end subroutine forget_vector

    !> The vector in the axes wanted.
    function vector_in(pair, axes, r) result(v)
        type(in_two_axes), intent(in) :: pair
        integer, intent(in) :: axes
        type(rotation), intent(in) :: r
        type(vector) :: v

        if (pair%is_known(axes)) then
            v = pair%v(axes)
        else if (axes == world_axes) then
            v = r.rotate.pair%v(own_axes)
        else
            v = r.unrotate.pair%v(world_axes)
        end if
    end function vector_in

    ! ---------------------------------------------------------------- links and their points

    function rotation_of(bodies, link) result(r)
        type(bodies_type), intent(in) :: bodies
        integer, intent(in) :: link
        type(rotation) :: r

        r = bodies%turning(bodies%body(link)%turning)%r
    end function rotation_of

    !> Angular velocity of a link.
    function omega_of(bodies, link, axes) result(omega)
        type(bodies_type), intent(in) :: bodies
        integer, intent(in) :: link, axes
        type(vector) :: omega

        associate (turning => bodies%turning(bodies%body(link)%turning))
            omega = vector_in(turning%omega, axes, turning%r)
        end associate
    end function omega_of

    !> Angular acceleration of a link.
    function alpha_of(bodies, link, axes) result(alpha)
        type(bodies_type), intent(in) :: bodies
        integer, intent(in) :: link, axes
        type(vector) :: alpha

        associate (turning => bodies%turning(bodies%body(link)%turning))
            alpha = vector_in(turning%alpha, axes, turning%r)
        end associate
    end function alpha_of

    function acceleration_of_origin(bodies, link, axes) result(a)
        type(bodies_type), intent(in) :: bodies
        integer, intent(in) :: link, axes
        type(vector) :: a

        a = vector_in(bodies%body(link)%acceleration, axes, rotation_of(bodies, link))
    end function acceleration_of_origin

    !> From a link's origin to a point fixed in it, world axes.
    function arm_of(bodies, link, point) result(arm)
        type(bodies_type), intent(in) :: bodies
        integer, intent(in) :: link
        type(vector), intent(in) :: point              !! link axes [m]
        type(vector) :: arm

        arm = rotation_of(bodies, link) .rotate.point
    end function arm_of

    function point_position(bodies, link, point) result(p)
        type(bodies_type), intent(in) :: bodies
        integer, intent(in) :: link
        type(vector), intent(in) :: point              !! link axes [m]
        type(vector) :: p

        p = bodies%body(link)%position + arm_of(bodies, link, point)
    end function point_position

    function point_velocity(bodies, link, point) result(v)
        type(bodies_type), intent(in) :: bodies
        integer, intent(in) :: link
        type(vector), intent(in) :: point              !! link axes [m]
        type(vector) :: v

        v = bodies%body(link)%velocity + (omega_of(bodies, link, world_axes) .cross.arm_of(bodies, link, point))
    end function point_velocity

    !> Acceleration less gravity of a point fixed in a link.
    function point_acceleration(bodies, link, point, axes) result(a)
        type(bodies_type), intent(in) :: bodies
        integer, intent(in) :: link
        type(vector), intent(in) :: point              !! link axes [m]
        integer, intent(in) :: axes                    !! of the result
        type(vector) :: a
        type(vector) :: arm

        arm = point
        if (axes == world_axes) arm = arm_of(bodies, link, point)
        a = acceleration_of_origin(bodies, link, axes) + field_times(acceleration_field(bodies, link, axes), arm)
    end function point_acceleration

    !> Velocity of the point of a link that is at a place just now.
    function carried_velocity(bodies, link, at) result(v)
        type(bodies_type), intent(in) :: bodies
        integer, intent(in) :: link
        type(vector), intent(in) :: at                     !! world axes [m]
        type(vector) :: v

        v = bodies%body(link)%velocity + (omega_of(bodies, link, world_axes) .cross.(at - bodies%body(link)%position))
    end function carried_velocity

    function carried_acceleration(bodies, link, at) result(a)
        type(bodies_type), intent(in) :: bodies
        integer, intent(in) :: link
        type(vector), intent(in) :: at                     !! world axes [m]
        type(vector) :: a

        a = acceleration_of_origin(bodies, link, world_axes) &
            + field_times(acceleration_field(bodies, link, world_axes), at - bodies%body(link)%position)
    end function carried_acceleration

    function acceleration_field(bodies, link, axes) result(field)
        type(bodies_type), intent(in) :: bodies
        integer, intent(in) :: link, axes
        type(field_type) :: field
        type(vector) :: w, a
        type(value) :: xx, yy, zz, xy, yz, zx

        w = omega_of(bodies, link, axes)
        a = alpha_of(bodies, link, axes)
        xx = w%x*w%x
        yy = w%y*w%y
        zz = w%z*w%z
        xy = w%x*w%y
        yz = w%y*w%z
        zx = w%z*w%x
        field%row(1) = vector(-(yy + zz), xy - a%z, zx + a%y)
        field%row(2) = vector(xy + a%z, -(xx + zz), yz - a%x)
        field%row(3) = vector(zx - a%y, yz + a%x, -(xx + yy))
    end function acceleration_field

    function field_times(field, arm) result(a)
        type(field_type), intent(in) :: field
        type(vector), intent(in) :: arm
        type(vector) :: a
        type(value) :: c(3)
        integer :: k

        do k = 1, 3
            c(k) = field%row(k)%x*arm%x + field%row(k)%y*arm%y + field%row(k)%z*arm%z
        end do
        a = vector(c(1), c(2), c(3))
    end function field_times
end module linkdyn_bodies
