!> Laws of time: value and two exact derivatives of the motions and loads of a scene.
!>
!> Outside its knots a table, a point-to-point motion and the start of a start-up stay at rest at
!> their end value.
module linkdyn_laws
    use, intrinsic :: iso_fortran_env, only: int64
    use linkdyn_kinds, only: wp
    use linkdyn_constants, only: pi, two_pi
    use linkdyn_scene, only: law_spec, law_none, law_constant, law_constant_rate, law_cycloidal_start, &
        law_cycloidal, law_polynomial_345, law_harmonic, law_table
    implicit none (type, external)
    private
    public :: evaluate_law, fit_spline, law_end, law_kinks

contains

    !> Value of a law and its first two derivatives in time.
    pure subroutine evaluate_law(law, t, value, rate, acceleration)
        type(law_spec), intent(in) :: law
        real(wp), intent(in) :: t              !! instant [s]
        real(wp), intent(out) :: value         !! in the unit of the quantity (m, rad, N, N m)
        real(wp), intent(out) :: rate          !! unit/s
        real(wp), intent(out) :: acceleration  !! unit/s2
        real(wp) :: phase

        value = law%value(1)
        rate = 0
        acceleration = 0
        select case (law%kind)
        case (law_none)
            value = 0
        case (law_constant_rate)
            value = law%value(1) + law%value(2)*t
            rate = law%value(2)
        case (law_cycloidal_start)
            call evaluate_start(law%value(2), law%value(3), t, value, rate, acceleration)
            value = law%value(1) + value
        case (law_cycloidal, law_polynomial_345)
            call evaluate_rest_to_rest(law, t, value, rate, acceleration)
        case (law_harmonic)
            phase = law%value(3)*t + law%value(4)
            value = law%value(1) + law%value(2)*sin(phase)
            rate = law%value(2)*law%value(3)*cos(phase)
            acceleration = -law%value(2)*law%value(3)**2*sin(phase)
        case (law_table)
            call evaluate_table(law, t, value, rate, acceleration)
        end select
    end subroutine evaluate_law

    !> Cycloidal start-up: the rate climbs as speed*(u - sin(2 pi u)/(2 pi)), u = t/duration, then stays.
    pure subroutine evaluate_start(speed, duration, t, value, rate, acceleration)
        real(wp), intent(in) :: speed          !! final rate [unit/s]
        real(wp), intent(in) :: duration       !! of the start-up [s]
        real(wp), intent(in) :: t              !! [s]
        real(wp), intent(out) :: value, rate, acceleration
        real(wp) :: x

        if (t <= 0) then
            value = 0
            rate = 0
            acceleration = 0
        else if (t >= duration) then
            value = speed*(t - duration/2)
            rate = speed
            acceleration = 0
        else
            x = two_pi*(t/duration)
            value = speed*duration*cosine_excess(x)/two_pi**2
            rate = speed*sine_deficit(x)/two_pi
            acceleration = 2*speed/duration*sin_half_turn(t/duration)**2
        end if
    end subroutine evaluate_start

    !> Rest to rest from knot to knot; knots of equal value are a dwell.
    pure subroutine evaluate_rest_to_rest(law, t, value, rate, acceleration)
        type(law_spec), intent(in) :: law
        real(wp), intent(in) :: t              !! [s]
        real(wp), intent(out) :: value, rate, acceleration
        real(wp) :: duration, stroke, u, shape(0:2)
        logical :: is_second_half
        integer :: i, n

        n = size(law%time)
        rate = 0
        acceleration = 0
        if (t <= law%time(1)) then
            value = law%knot(1)
            return
        else if (t >= law%time(n)) then
            value = law%knot(n)
            return
        end if
        i = interval_of(law%time, t)
        duration = law%time(i + 1) - law%time(i)
        stroke = law%knot(i + 1) - law%knot(i)
        ! Both shapes are point-symmetric: the second half is the first one seen from the end, so that
        ! what is left to go keeps its digits as well.
        is_second_half = 2*(t - law%time(i)) > duration
        if (is_second_half) then
            u = (law%time(i + 1) - t)/duration
        else
            u = (t - law%time(i))/duration
        end if
        if (law%kind == law_cycloidal) then
            shape = [sine_deficit(two_pi*u)/two_pi, 2*sin_half_turn(u)**2, two_pi*sin(two_pi*u)]
        else
            shape = [u**3*(10 - u*(15 - 6*u)), 30*(u*(1 - u))**2, 60*u*(1 - u)*(1 - 2*u)]
        end if
        rate = stroke*shape(1)/duration
        if (is_second_half) then
            value = law%knot(i + 1) - stroke*shape(0)
            acceleration = -stroke*shape(2)/duration**2
        else
            value = law%knot(i) + stroke*shape(0)
            acceleration = stroke*shape(2)/duration**2
        end if
    end subroutine evaluate_rest_to_rest

    !> Cubic spline or straight lines through the knots.
    pure subroutine evaluate_table(law, t, value, rate, acceleration)
        type(law_spec), intent(in) :: law
        real(wp), intent(in) :: t              !! [s]
        real(wp), intent(out) :: value, rate, acceleration
        real(wp) :: h, a, b, instant
        integer :: i, n

        n = size(law%time)
        rate = 0
        acceleration = 0
        ! An instant that misses the end by rounding alone (0.1*20 for 2) is the end, in motion.
        instant = t
        if (t < law%time(1) .and. t >= law%time(1) - slack(law%time)) instant = law%time(1)
        if (t > law%time(n) .and. t <= law%time(n) + slack(law%time)) instant = law%time(n)
        if (n == 1 .or. instant < law%time(1)) then
            value = law%knot(1)
            return
        else if (instant > law%time(n)) then
            value = law%knot(n)
            return
        end if
        i = interval_of(law%time, instant)
        h = law%time(i + 1) - law%time(i)
        a = (law%time(i + 1) - instant)/h
        b = (instant - law%time(i))/h
        value = a*law%knot(i) + b*law%knot(i + 1)
        rate = (law%knot(i + 1) - law%knot(i))/h
        if (.not. allocated(law%curvature)) return
        value = value + ((a**3 - a)*law%curvature(i) + (b**3 - b)*law%curvature(i + 1))*h**2/6
        rate = rate + ((3*b**2 - 1)*law%curvature(i + 1) - (3*a**2 - 1)*law%curvature(i))*h/6
        acceleration = a*law%curvature(i) + b*law%curvature(i + 1)
    end subroutine evaluate_table

    !> Second derivatives at the knots of the C2 cubic spline with not-a-knot ends.
    !>
    !> Three points give the parabola, two the straight line. The tridiagonal matrix is diagonally
    !> dominant whatever the spacing, so that it is eliminated without pivoting.
    !>
    !> **Source**: C. de Boor, A Practical Guide to Splines, rev. ed., Springer 2001, ch. IV.
    pure subroutine fit_spline(time, knot, curvature)
        real(wp), intent(in) :: time(:)        !! knots [s] (n), increasing
        real(wp), intent(in) :: knot(:)        !! values (n)
        real(wp), intent(out) :: curvature(:)  !! second derivatives (n)
        real(wp), allocatable :: h(:), slope(:), diagonal(:), upper(:)
        real(wp) :: lower
        integer :: i, n

        n = size(time)
        curvature = 0
        if (n < 3) return
        allocate (h(n - 1), slope(n - 1), diagonal(n), upper(n))
        h = time(2:) - time(:n - 1)
        slope = (knot(2:) - knot(:n - 1))/h
        if (n == 3) then
            curvature = 2*(slope(2) - slope(1))/(h(1) + h(2))
            return
        end if
        do i = 2, n - 1
            lower = h(i - 1)
            diagonal(i) = 2*(h(i - 1) + h(i))
            upper(i) = h(i)
            curvature(i) = 6*(slope(i) - slope(i - 1))
            ! The end curvatures continue the line through their two neighbours: put them in here.
            if (i == 2) then
                diagonal(i) = diagonal(i) + h(1)*(h(1) + h(2))/h(2)
                upper(i) = (h(2) - h(1))*(h(2) + h(1))/h(2)
            end if
            if (i == n - 1) then
                diagonal(i) = diagonal(i) + h(n - 1)*(h(n - 1) + h(n - 2))/h(n - 2)
                lower = (h(n - 2) - h(n - 1))*(h(n - 2) + h(n - 1))/h(n - 2)
            end if
            if (i > 2) then
                diagonal(i) = diagonal(i) - lower*upper(i - 1)/diagonal(i - 1)
                curvature(i) = curvature(i) - lower*curvature(i - 1)/diagonal(i - 1)
            end if
        end do
        curvature(n - 1) = curvature(n - 1)/diagonal(n - 1)
        do i = n - 2, 2, -1
            curvature(i) = (curvature(i) - upper(i)*curvature(i + 1))/diagonal(i)
        end do
        curvature(1) = curvature(2) + (curvature(2) - curvature(3))*h(1)/h(2)
        curvature(n) = curvature(n - 1) + (curvature(n - 1) - curvature(n - 2))*h(n - 1)/h(n - 2)
    end subroutine fit_spline

    !> The instant after which a law does nothing new: end of its knots or its start-up, one period of
    !> a harmonic; 0 if it is the same for ever.
    pure real(wp) function law_end(law)
        type(law_spec), intent(in) :: law

        law_end = 0
        select case (law%kind)
        case (law_cycloidal_start)
            law_end = law%value(3)
        case (law_cycloidal, law_polynomial_345, law_table)
            law_end = law%time(size(law%time))
        case (law_harmonic)
            if (law%value(3) /= 0) law_end = two_pi/abs(law%value(3))
        end select
    end function law_end

    !> Instants at which the formula of a law changes, increasing: an integrator must not step over them.
    !>
    !> The inner knots of a spline are not among them: it is smooth enough there for error control.
    pure subroutine law_kinks(law, kinks)
        type(law_spec), intent(in) :: law
        real(wp), allocatable, intent(out) :: kinks(:)  !! [s]

        select case (law%kind)
        case (law_cycloidal_start)
            kinks = [0.0_wp, law%value(3)]
        case (law_cycloidal, law_polynomial_345)
            kinks = law%time
        case (law_table)
            if (allocated(law%curvature)) then
                kinks = [law%time(1), law%time(size(law%time))]
            else
                kinks = law%time
            end if
        case default
            allocate (kinks(0))
        end select
    end subroutine law_kinks

    !> The i with time(i) <= t < time(i + 1), kept within 1 .. n - 1.
    pure integer function interval_of(time, t) result(low)
        real(wp), intent(in) :: time(:)        !! increasing (n), n > 1
        real(wp), intent(in) :: t
        integer :: high, middle

        low = 1
        high = size(time)
        do while (high - low > 1)
            middle = low + (high - low)/2
            if (t >= time(middle)) then
                low = middle
            else
                high = middle
            end if
        end do
    end function interval_of

    !> By how much an instant may miss the range of a table and still be its end: some roundings.
    pure real(wp) function slack(time)
        real(wp), intent(in) :: time(:)

        slack = 16*epsilon(slack)*max(abs(time(1)), abs(time(size(time))))
    end function slack

    !> sin(pi u), with its zero at u = 1 as sharp as the one at 0.
    pure elemental real(wp) function sin_half_turn(u)
        real(wp), intent(in) :: u              !! 0 .. 1

        sin_half_turn = sin(pi*min(u, 1 - u))
    end function sin_half_turn

    !> x - sin(x) without cancellation for small x.
    pure elemental real(wp) function sine_deficit(x)
        real(wp), intent(in) :: x

        if (abs(x) > 1) then
            sine_deficit = x - sin(x)
        else
            sine_deficit = alternating_series(x**3/6, x, 3)
        end if
    end function sine_deficit

    !> x**2/2 - (1 - cos(x)) without cancellation for small x.
    pure elemental real(wp) function cosine_excess(x)
        real(wp), intent(in) :: x

        if (abs(x) > 1) then
            cosine_excess = x**2/2 - 2*sin(x/2)**2
        else
            cosine_excess = alternating_series(x**4/24, x, 4)
        end if
    end function cosine_excess

    !> The rest of the sine or cosine series from its term x**order/order! on, signs alternating.
    pure real(wp) function alternating_series(first_term, x, order) result(total)
        real(wp), intent(in) :: first_term, x
        integer, intent(in) :: order           !! power of the first term
        real(wp) :: term
        integer(int64) :: k

        term = first_term
        total = term
        k = order
        do while (abs(term) > epsilon(term)*abs(total))
            term = -term*x**2/real((k + 1)*(k + 2), wp)
            total = total + term
            k = k + 2
        end do
    end function alternating_series
end module linkdyn_laws
