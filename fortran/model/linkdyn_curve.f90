!> A closed smooth curve, the outline of a cam: a periodic cubic spline through given points, with continuous second derivatives.
!>
!> It goes round anticlockwise. In polar coordinates the spline is the radius over the angle, in Cartesian ones x and y over the
!> length of the chords. Two questions are asked of it: where it is nearest to a point, and where it touches a straight line of a
!> given direction. Both are answered from the point alone, by a search among all knots and Newton's method between bounds, so
!> nothing depends on what was asked before.
module linkdyn_curve
    use linkdyn_constants, only: two_pi
    use linkdyn_kinds, only: wp
    use linkdyn_spline, only: fit_periodic_spline
    implicit none (type, external)
    private
    public :: curve_type, curve_point, make_polar_curve, make_curve, scale_curve, foot_of, touching_point, point_at, radius_at
    public :: curvature_range

    integer, parameter :: most_steps = 60
    integer, parameter :: n_look = 8                  !! places between two knots where the curvature is looked at

    type :: curve_type
        logical :: is_polar = .false.
        real(wp), allocatable :: u(:)                 !! parameter at the knots, the last a period behind the first (n + 1) [rad, m]
        real(wp), allocatable :: value(:, :)          !! radius, or x and y there (n + 1, 1 or 2) [m]
        real(wp), allocatable :: second(:, :)         !! and their second derivatives
        real(wp), allocatable :: knot(:, :)           !! the points themselves (2, n) [m]
    end type curve_type

    !> A point of the curve.
    type :: curve_point
        real(wp) :: at(2) = 0                         !! [m]
        real(wp) :: normal(2) = [1, 0]                !! outwards, a unit vector
        real(wp) :: curvature = 0                     !! above zero where the curve is round, below where it is hollow [1/m]
    end type curve_point

contains

    !> Radius over angle; angles increase, the last one less than a turn ahead of the first.
    pure subroutine make_polar_curve(angle, radius, curve)
        real(wp), intent(in) :: angle(:), radius(:)   !! (n) [rad, m]
        type(curve_type), intent(out) :: curve

        curve%is_polar = .true.
        curve%u = [angle, angle(1) + two_pi]
        curve%value = reshape([radius, radius(1)], [size(radius) + 1, 1])
        call fit(curve)
    end subroutine make_polar_curve

    !> Through points, in either sense.
    pure subroutine make_curve(x, y, curve)
        real(wp), intent(in) :: x(:), y(:)            !! (n) [m]
        type(curve_type), intent(out) :: curve
        integer :: i, n
        real(wp) :: area

        n = size(x)
        area = sum(x*cshift(y, 1) - y*cshift(x, 1))
        curve%value = reshape([x, x(1), y, y(1)], [n + 1, 2])
        if (area < 0) curve%value = curve%value(n + 1:1:-1, :)
        allocate (curve%u(n + 1))
        curve%u(1) = 0
        do i = 1, n
            curve%u(i + 1) = curve%u(i) + norm2(curve%value(i + 1, :) - curve%value(i, :))
        end do
        call fit(curve)
    end subroutine make_curve

    pure subroutine fit(curve)
        type(curve_type), intent(inout) :: curve
        integer :: i, n

        n = size(curve%u) - 1
        allocate (curve%second, mold=curve%value)
        do i = 1, size(curve%value, 2)
            call fit_periodic_spline(curve%u, curve%value(:, i), curve%second(:, i))
        end do
        if (curve%is_polar) then
            curve%knot = reshape([(curve%value(i, 1)*[cos(curve%u(i)), sin(curve%u(i))], i=1, n)], [2, n])
        else
            curve%knot = transpose(curve%value(:n, :))
        end if
    end subroutine fit

    !> The same curve of another size, fitted anew: its second derivatives have the rounding of all points in them.
    pure subroutine scale_curve(scale, rounding, curve)
        real(wp), intent(in) :: scale
        real(wp), intent(in) :: rounding(:)           !! factors near 1 of the angles, which have no size (n)
        type(curve_type), intent(inout) :: curve
        integer :: n

        n = size(rounding)
        curve%value = scale*curve%value
        if (curve%is_polar) then
            curve%u(:n) = rounding*curve%u(:n)
            curve%u(n + 1) = curve%u(1) + two_pi
        else
            curve%u = scale*curve%u
        end if
        deallocate (curve%second)
        call fit(curve)
    end subroutine scale_curve

    ! ---------------------------------------------------------------- points

    !> Place and two derivatives by the parameter at u, which lies between knots i and i + 1 or a little beyond.
    pure subroutine evaluate(curve, i, u, c, c1, c2)
        type(curve_type), intent(in) :: curve
        integer, intent(in) :: i
        real(wp), intent(in) :: u
        real(wp), intent(out) :: c(2), c1(2), c2(2)
        real(wp) :: s(3, size(curve%value, 2)), along(2), across(2)

        s = spline_at(curve, i, u)
        if (.not. curve%is_polar) then
            c = s(1, :)
            c1 = s(2, :)
            c2 = s(3, :)
            return
        end if
        along = [cos(u), sin(u)]
        across = [-along(2), along(1)]
        c = s(1, 1)*along
        c1 = s(2, 1)*along + s(1, 1)*across
        c2 = (s(3, 1) - s(1, 1))*along + 2*s(2, 1)*across
    end subroutine evaluate

    !> What is splined, radius or x and y, with two derivatives.
    pure function spline_at(curve, i, u) result(s)
        type(curve_type), intent(in) :: curve
        integer, intent(in) :: i
        real(wp), intent(in) :: u
        real(wp) :: s(3, size(curve%value, 2))
        real(wp) :: h, a, b
        integer :: k

        h = curve%u(i + 1) - curve%u(i)
        a = (curve%u(i + 1) - u)/h
        b = (u - curve%u(i))/h
        do k = 1, size(curve%value, 2)
            associate (y => curve%value(i:i + 1, k), m => curve%second(i:i + 1, k))
                s(1, k) = a*y(1) + b*y(2) + ((a**3 - a)*m(1) + (b**3 - b)*m(2))*h**2/6
                s(2, k) = (y(2) - y(1))/h + ((1 - 3*a**2)*m(1) + (3*b**2 - 1)*m(2))*h/6
                s(3, k) = a*m(1) + b*m(2)
            end associate
        end do
    end function spline_at

    !> The radius at an angle, and its derivative, of a curve in polar coordinates.
    pure subroutine radius_at(curve, angle, radius, slope)
        type(curve_type), intent(in) :: curve
        real(wp), intent(in) :: angle                 !! [rad]
        real(wp), intent(out) :: radius, slope        !! [m, m/rad]
        real(wp) :: u, s(3, 1)
        integer :: n

        n = size(curve%u) - 1
        u = curve%u(1) + modulo(angle - curve%u(1), two_pi)
        s = spline_at(curve, max(1, min(n, count(curve%u(:n) <= u))), u)
        radius = s(1, 1)
        slope = s(2, 1)
    end subroutine radius_at

    !> What is told of a point from these derivatives.
    pure type(curve_point) function told(c, c1, c2) result(point)
        real(wp), intent(in) :: c(2), c1(2), c2(2)
        real(wp) :: speed

        speed = norm2(c1)
        point%at = c
        point%normal = [c1(2), -c1(1)]/speed
        point%curvature = (c1(1)*c2(2) - c1(2)*c2(1))/speed**3
    end function told

    !> The point between knots i and i + 1, a part of the way.
    pure type(curve_point) function point_at(curve, i, part) result(point)
        type(curve_type), intent(in) :: curve
        integer, intent(in) :: i                      !! 1 to the number of knots
        real(wp), intent(in) :: part                  !! 0 to 1
        real(wp) :: c(2), c1(2), c2(2)

        call evaluate(curve, i, curve%u(i) + part*(curve%u(i + 1) - curve%u(i)), c, c1, c2)
        point = told(c, c1, c2)
    end function point_at

    !> Smallest and largest curvature, as far as one sees by looking at many places.
    pure function curvature_range(curve) result(range)
        type(curve_type), intent(in) :: curve
        real(wp) :: range(2)
        type(curve_point) :: point
        integer :: i, k

        range = [huge(1.0_wp), -huge(1.0_wp)]
        do i = 1, size(curve%u) - 1
            do k = 0, n_look - 1
                point = point_at(curve, i, real(k, wp)/n_look)
                range = [min(range(1), point%curvature), max(range(2), point%curvature)]
            end do
        end do
    end function curvature_range

    ! ---------------------------------------------------------------- nearest, touching

    !> Where the curve is nearest to a point.
    pure type(curve_point) function foot_of(curve, p) result(point)
        type(curve_type), intent(in) :: curve
        real(wp), intent(in) :: p(2)                  !! [m]
        integer :: nearest

        nearest = minloc((curve%knot(1, :) - p(1))**2 + (curve%knot(2, :) - p(2))**2, dim=1)
        point = settled(curve, max(1, nearest), p, [0.0_wp, 0.0_wp])     ! of what is no number none is the nearest
    end function foot_of

    !> Where it goes farthest in a direction: a straight line square to that touches it there.
    pure type(curve_point) function touching_point(curve, direction) result(point)
        type(curve_type), intent(in) :: curve
        real(wp), intent(in) :: direction(2)          !! a unit vector
        integer :: farthest

        farthest = maxloc(curve%knot(1, :)*direction(1) + curve%knot(2, :)*direction(2), dim=1)
        point = settled(curve, max(1, farthest), [0.0_wp, 0.0_wp], direction)
    end function touching_point

    !> From the best knot to the best point about it: the zero of what grows along the curve there. With a direction that is how
    !> far the curve has gone from it, else half the rate of the distance's square from p.
    pure type(curve_point) function settled(curve, knot, p, direction) result(point)
        type(curve_type), intent(in) :: curve
        integer, intent(in) :: knot
        real(wp), intent(in) :: p(2), direction(2)
        real(wp) :: c(2), c1(2), c2(2), slope, growth, low, high, part, next
        integer :: i, n, step

        n = size(curve%u) - 1
        ! on which side of the knot
        i = knot
        call look(curve, i, 0.0_wp, p, direction, c, c1, c2, slope, growth)
        if (slope > 0) i = merge(n, knot - 1, knot == 1)
        low = 0
        high = 1
        part = merge(1.0_wp, 0.0_wp, slope > 0)
        do step = 1, most_steps
            call look(curve, i, part, p, direction, c, c1, c2, slope, growth)
            if (slope > 0) then
                high = part
            else
                low = part
            end if
            next = part - slope/growth
            if (.not. (growth > 0 .and. next >= low .and. next <= high)) next = (low + high)/2
            if (abs(next - part) <= epsilon(1.0_wp)) exit
            part = next
        end do
        point = told(c, c1, c2)
    end function settled

    !> What vanishes at the best point, and how it grows with the part of the way from knot i to the next.
    pure subroutine look(curve, i, part, p, direction, c, c1, c2, slope, growth)
        type(curve_type), intent(in) :: curve
        integer, intent(in) :: i
        real(wp), intent(in) :: part, p(2), direction(2)
        real(wp), intent(out) :: c(2), c1(2), c2(2), slope, growth

        associate (h => curve%u(i + 1) - curve%u(i))
            call evaluate(curve, i, curve%u(i) + part*h, c, c1, c2)
            if (any(direction /= 0)) then
                slope = -dot_product(c1, direction)*h
                growth = -dot_product(c2, direction)*h**2
            else
                slope = dot_product(c - p, c1)*h
                growth = (dot_product(c1, c1) + dot_product(c - p, c2))*h**2
            end if
        end associate
    end subroutine look
end module linkdyn_curve
