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
    use linkdyn_table, only: table_place, find_places, evaluate_table, interval_of
    implicit none (type, external)
    private
    public :: evaluate_law, law_instants, most_instants, set_instants, evaluate_at_instants, law_end, law_kinks

    integer, parameter :: most_instants = 64   !! some kilobytes of places: they stay in the first cache

    !> Instants for one law after the other: tables with the same knots share the search among these.
    type :: law_instants
        private
        integer :: n = 0
        real(wp) :: t(most_instants)           !! [s]
        integer :: table = 0                   !! of the laws among whose knots `place` is; 0: of none
        integer :: near = 1                    !! the interval found last
        type(table_place) :: place(most_instants)
    end type law_instants

contains

    !> Value of a law and its first two derivatives in time.
    pure subroutine evaluate_law(law, t, value, rate, acceleration)
        type(law_spec), intent(in) :: law
        real(wp), intent(in) :: t              !! instant [s]
        real(wp), intent(out) :: value         !! in the unit of the quantity (m, rad, N, N m)
        real(wp), intent(out) :: rate          !! unit/s
        real(wp), intent(out) :: acceleration  !! unit/s2
        real(wp) :: phase, at_place(3, 1)
        type(table_place) :: place(1)
        integer :: near

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
            near = 1
            call find_places(law%time, [t], near, place)
            call evaluate_table(law, place, at_place(1, :), at_place(2, :), at_place(3, :))
            value = at_place(1, 1)
            rate = at_place(2, 1)
            acceleration = at_place(3, 1)
        end select
    end subroutine evaluate_law

    !> Have laws evaluated at these instants.
    pure subroutine set_instants(instants, t)
        type(law_instants), intent(inout) :: instants
        real(wp), intent(in) :: t(:)           !! [s] (n), n <= most_instants

        instants%n = size(t)
        instants%t(:instants%n) = t
        instants%table = 0
    end subroutine set_instants

    !> As `evaluate_law`, at all these instants.
    pure subroutine evaluate_at_instants(law, instants, value, rate, acceleration)
        type(law_spec), intent(in) :: law
        type(law_instants), intent(inout) :: instants
        real(wp), intent(out) :: value(:)      !! (n)
        real(wp), intent(out), optional :: rate(:), acceleration(:)    !! (n), both or none
        real(wp) :: other_rate, other_acceleration
        integer :: i

        associate (n => instants%n)
            if (law%kind == law_table) then
                if (law%table == 0 .or. law%table /= instants%table) &
                    call find_places(law%time, instants%t(:n), instants%near, instants%place(:n))
                instants%table = law%table
                call evaluate_table(law, instants%place(:n), value, rate, acceleration)
            else if (present(rate)) then
                do i = 1, n
                    call evaluate_law(law, instants%t(i), value(i), rate(i), acceleration(i))
                end do
            else
                do i = 1, n
                    call evaluate_law(law, instants%t(i), value(i), other_rate, other_acceleration)
                end do
            end if
        end associate
    end subroutine evaluate_at_instants

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
        i = interval_of(law%time, t, 1)
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
