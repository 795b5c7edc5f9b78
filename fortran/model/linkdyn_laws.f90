!> Laws of time: value and two exact derivatives of the motions and loads of a scene.
!>
!> Outside its knots a table, a point-to-point motion and the start of a start-up stay at rest at
!> their end value.
module linkdyn_laws
    use, intrinsic :: iso_fortran_env, only: int64
    use linkdyn_kinds, only: wp
    use linkdyn_constants, only: pi, two_pi
    use linkdyn_scene, only: scene_type, coordinate_spec, law_spec, law_none, law_constant_rate, law_cycloidal_start, &
        law_cycloidal, law_polynomial_345, law_harmonic, law_table
    use linkdyn_table, only: table_place, find_places, evaluate_table, interval_of
    implicit none (type, external)
    private
    public :: evaluate_law, start_of_coordinate, law_instants, most_instants, set_instants, evaluate_at_instants, &
        motion_at_instants, have_same_course, law_end, law_kinks

    integer, parameter :: most_instants = 64   !! some kilobytes of places: they stay in the first cache

    !> Where in its course a law is, and what it has there in common with all laws that do the same in the same time.
    type :: law_shape
        integer :: interval = 0                !! between its knots; 0: it has not begun
        logical :: from_end = .false.          !! in the second half of an interval: counted back from its end
        real(wp) :: of(0:2) = 0                !! value, rate and acceleration of a course of unit size; of a start-up one of unit
                                               !! duration, too
    end type law_shape

    !> Instants for one law after the other: those that do the same in the same time share the search among these, and what costs
    !> most.
    type :: law_instants
        private
        integer :: n = 0
        real(wp) :: t(most_instants)           !! [s]
        integer :: course = 0                  !! of the laws whose places and shapes these are; 0: of none
        integer :: near = 1                    !! the interval found last
        type(table_place) :: place(most_instants)
        type(law_shape) :: shape(most_instants)
    end type law_instants

contains

    !> Value of a law and its first two derivatives in time.
    pure subroutine evaluate_law(law, t, value, rate, acceleration)
        type(law_spec), intent(in) :: law
        real(wp), intent(in) :: t              !! instant [s]
        real(wp), intent(out) :: value         !! in the unit of the quantity (m, rad, N, N m)
        real(wp), intent(out) :: rate          !! unit/s
        real(wp), intent(out) :: acceleration  !! unit/s2
        real(wp) :: at_place(3, 1)
        type(table_place) :: place(1)
        type(law_shape) :: shape
        integer :: near

        if (law%kind == law_table) then
            near = 1
            call find_places(law%time, [t], near, place)
            call evaluate_table(law, place, at_place(1, :), at_place(2, :), at_place(3, :))
            value = at_place(1, 1)
            rate = at_place(2, 1)
            acceleration = at_place(3, 1)
        else
            call find_shape(law, t, shape)
            call take_shape(law, t, shape, value, rate, acceleration)
        end if
    end subroutine evaluate_law

    !> Where a coordinate begins: as written, or where the motion does.
    pure real(wp) function start_of_coordinate(scene, k) result(q)
        type(scene_type), intent(in) :: scene
        integer, intent(in) :: k
        real(wp) :: rate, rate2

        associate (c => scene%coordinate(k))
            q = c%start_position
            if (.not. c%has_start .and. c%motion%kind /= law_none) call evaluate_law(c%motion, scene%time%first, q, rate, rate2)
        end associate
    end function start_of_coordinate

    !> Where in its course a law is; of one that needs no sine, nothing.
    pure subroutine find_shape(law, t, shape)
        type(law_spec), intent(in) :: law
        real(wp), intent(in) :: t              !! [s]
        type(law_shape), intent(out) :: shape
        real(wp) :: phase

        select case (law%kind)
        case (law_cycloidal_start)
            call find_start(law%value(3), t, shape)
        case (law_cycloidal, law_polynomial_345)
            call find_rest_to_rest(law, t, shape)
        case (law_harmonic)
            phase = law%value(3)*t + law%value(4)
            shape%of = [sin(phase), cos(phase), -sin(phase)]
        end select
    end subroutine find_shape

    !> A law of its own size from there.
    pure subroutine take_shape(law, t, shape, value, rate, acceleration)
        type(law_spec), intent(in) :: law
        real(wp), intent(in) :: t              !! [s]
        type(law_shape), intent(in) :: shape
        real(wp), intent(out) :: value, rate, acceleration

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
            call take_start(law%value(2), law%value(3), t, shape, value, rate, acceleration)
            value = law%value(1) + value
        case (law_cycloidal, law_polynomial_345)
            call take_rest_to_rest(law, shape, value, rate, acceleration)
        case (law_harmonic)
            value = law%value(1) + law%value(2)*shape%of(0)
            rate = law%value(2)*law%value(3)*shape%of(1)
            acceleration = law%value(2)*law%value(3)**2*shape%of(2)
        end select
    end subroutine take_shape

    !> Have laws evaluated at these instants.
    pure subroutine set_instants(instants, t)
        type(law_instants), intent(inout) :: instants
        real(wp), intent(in) :: t(:)           !! [s] (n), n <= most_instants

        instants%n = size(t)
        instants%t(:instants%n) = t
        instants%course = 0
    end subroutine set_instants

    !> As `evaluate_law`, at all these instants.
    pure subroutine evaluate_at_instants(law, instants, value, rate, acceleration)
        type(law_spec), intent(in) :: law
        type(law_instants), intent(inout) :: instants
        real(wp), intent(out) :: value(:)      !! (n)
        real(wp), intent(out), optional :: rate(:), acceleration(:)    !! (n), both or none
        real(wp) :: other_rate, other_acceleration
        logical :: is_known
        integer :: i

        is_known = law%course > 0 .and. law%course == instants%course
        instants%course = law%course
        associate (n => instants%n)
            if (law%kind == law_table) then
                if (.not. is_known) call find_places(law%time, instants%t(:n), instants%near, instants%place(:n))
                call evaluate_table(law, instants%place(:n), value, rate, acceleration)
                return
            end if
            do i = 1, n
                if (.not. is_known) call find_shape(law, instants%t(i), instants%shape(i))
                if (present(rate)) then
                    call take_shape(law, instants%t(i), instants%shape(i), value(i), rate(i), acceleration(i))
                else
                    call take_shape(law, instants%t(i), instants%shape(i), value(i), other_rate, other_acceleration)
                end if
            end do
        end associate
    end subroutine evaluate_at_instants

    !> A coordinate's motion at all these instants: one without a law rests at its start.
    pure subroutine motion_at_instants(coordinate, instants, q, qd, qdd)
        type(coordinate_spec), intent(in) :: coordinate
        type(law_instants), intent(inout) :: instants
        real(wp), intent(out) :: q(:), qd(:), qdd(:)   !! (n)

        if (coordinate%motion%kind == law_none) then
            q = coordinate%start_position
            qd = 0
            qdd = 0
        else
            call evaluate_at_instants(coordinate%motion, instants, q, qd, qdd)
        end if
    end subroutine motion_at_instants

    !> Do two laws the same in the same time, if in other sizes? Only of laws whose courses cost something.
    pure logical function have_same_course(a, b)
        type(law_spec), intent(in) :: a, b

        have_same_course = a%kind == b%kind
        if (.not. have_same_course) return
        select case (a%kind)
        case (law_table, law_cycloidal, law_polynomial_345)
            have_same_course = size(a%time) == size(b%time)
            if (have_same_course) have_same_course = all(a%time == b%time)
        case (law_cycloidal_start)
            have_same_course = a%value(3) == b%value(3)
        case (law_harmonic)
            have_same_course = all(a%value(3:4) == b%value(3:4))
        case default
            have_same_course = .false.
        end select
    end function have_same_course

    !> Cycloidal start-up: the rate climbs as speed*(u - sin(2 pi u)/(2 pi)), u = t/duration, then stays.
    pure subroutine find_start(duration, t, shape)
        real(wp), intent(in) :: duration       !! of the start-up [s]
        real(wp), intent(in) :: t              !! [s]
        type(law_shape), intent(inout) :: shape
        real(wp) :: x

        if (t <= 0) then
            shape%interval = 0
        else if (t >= duration) then
            shape%interval = 2
        else
            shape%interval = 1
            x = two_pi*(t/duration)
            shape%of = [cosine_excess(x)/two_pi**2, sine_deficit(x)/two_pi, 2*sin_half_turn(t/duration)**2]
        end if
    end subroutine find_start

    pure subroutine take_start(speed, duration, t, shape, value, rate, acceleration)
        real(wp), intent(in) :: speed          !! final rate [unit/s]
        real(wp), intent(in) :: duration       !! of the start-up [s]
        real(wp), intent(in) :: t              !! [s]
        type(law_shape), intent(in) :: shape
        real(wp), intent(out) :: value, rate, acceleration

        select case (shape%interval)
        case (0)
            value = 0
            rate = 0
            acceleration = 0
        case (1)
            value = speed*duration*shape%of(0)
            rate = speed*shape%of(1)
            acceleration = speed/duration*shape%of(2)
        case default
            value = speed*(t - duration/2)
            rate = speed
            acceleration = 0
        end select
    end subroutine take_start

    !> Rest to rest from knot to knot; knots of equal value are a dwell.
    pure subroutine find_rest_to_rest(law, t, shape)
        type(law_spec), intent(in) :: law
        real(wp), intent(in) :: t              !! [s]
        type(law_shape), intent(inout) :: shape
        real(wp) :: duration, u

        associate (n => size(law%time), i => shape%interval)
            i = 0
            if (t <= law%time(1)) return
            i = n
            if (t >= law%time(n)) return
            i = interval_of(law%time, t, 1)
            duration = law%time(i + 1) - law%time(i)
            ! Both shapes are point-symmetric: the second half is the first one seen from the end, so that
            ! what is left to go keeps its digits as well.
            shape%from_end = 2*(t - law%time(i)) > duration
            u = merge(law%time(i + 1) - t, t - law%time(i), shape%from_end)/duration
        end associate
        if (law%kind == law_cycloidal) then
            shape%of = [sine_deficit(two_pi*u)/two_pi, 2*sin_half_turn(u)**2, two_pi*sin(two_pi*u)]
        else
            shape%of = [u**3*(10 - u*(15 - 6*u)), 30*(u*(1 - u))**2, 60*u*(1 - u)*(1 - 2*u)]
        end if
        shape%of(1) = shape%of(1)/duration
        shape%of(2) = shape%of(2)/duration**2
        if (.not. shape%from_end) return
        shape%of(0) = -shape%of(0)
        shape%of(2) = -shape%of(2)
    end subroutine find_rest_to_rest

    pure subroutine take_rest_to_rest(law, shape, value, rate, acceleration)
        type(law_spec), intent(in) :: law
        type(law_shape), intent(in) :: shape
        real(wp), intent(out) :: value, rate, acceleration
        real(wp) :: stroke

        associate (n => size(law%time), i => shape%interval)
            rate = 0
            acceleration = 0
            value = law%knot(max(i, 1))
            if (i == 0 .or. i == n) return
            stroke = law%knot(i + 1) - law%knot(i)
            value = merge(law%knot(i + 1), law%knot(i), shape%from_end) + stroke*shape%of(0)
            rate = stroke*shape%of(1)
            acceleration = stroke*shape%of(2)
        end associate
    end subroutine take_rest_to_rest

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
