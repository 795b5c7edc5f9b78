!> linkdyn_laws: values, exact derivatives, splines.
module test_laws
    use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan
    use linkdyn_kinds, only: wp
    use linkdyn_constants, only: pi, two_pi
    use linkdyn_testing, only: test_error, unit_test, new_test, check, check_close
    use linkdyn_scene, only: law_spec, law_none, law_constant, law_cycloidal_start, law_cycloidal, law_polynomial_345, &
        law_harmonic, law_table
    use linkdyn_laws, only: evaluate_law, law_instants, most_instants, set_instants, evaluate_at_instants, have_same_course, &
        law_end, law_kinks
    use linkdyn_spline, only: fit_spline
    use linkdyn_table, only: interval_of
    implicit none (type, external)
    private
    public :: collect_laws

contains

    subroutine collect_laws(tests)
        type(unit_test), allocatable, intent(out) :: tests(:)

        tests = [ &
            new_test("derivatives against differences", test_derivatives), &
            new_test("cycloidal start", test_start), &
            new_test("digits near the ends", test_small), &
            new_test("rest to rest through knots", test_knots), &
            new_test("harmonic", test_harmonic), &
            new_test("spline gives a cubic back", test_cubic), &
            new_test("spline is C2", test_smoothness), &
            new_test("few points", test_few_points), &
            new_test("outside a table", test_outside), &
            new_test("straight lines", test_lines), &
            new_test("intervals found from anywhere", test_intervals), &
            new_test("laws at many instants", test_many_instants), &
            new_test("ends and kinks", test_ends)]
    end subroutine collect_laws

    !> Central differences of value and rate, at instants inside every piece of every law.
    subroutine test_derivatives(error)
        type(test_error), intent(inout) :: error
        real(wp), parameter :: instants(*) = [0.05_wp, 0.31_wp, 0.77_wp, 1.2_wp, 1.9_wp, 2.6_wp]
        type(law_spec) :: law
        integer :: kind, i

        do kind = law_none, law_table
            law = sample_law(kind)
            do i = 1, size(instants)
                call check_differences(error, law, instants(i))
            end do
        end do
    end subroutine test_derivatives

    subroutine check_differences(error, law, t)
        type(test_error), intent(inout) :: error
        type(law_spec), intent(in) :: law
        real(wp), intent(in) :: t
        real(wp) :: h, tolerance, value(-1:1), rate(-1:1), acceleration(-1:1)
        character(len=40) :: what
        integer :: k

        ! Truncation h**2 f'''/6 and rounding eps f/h meet at h = eps**(1/3). The fourth derivative
        ! of these laws stays below 3500, the lower ones below 500.
        h = epsilon(h)**(1/3.0_wp)
        tolerance = (3500/6.0_wp + 500)*h**2
        do k = -1, 1
            call evaluate_law(law, t + k*h, value(k), rate(k), acceleration(k))
        end do
        write (what, "(a, i0, a, f5.2)") "law ", law%kind, " at t = ", t
        call check_close(error, rate(0), (value(1) - value(-1))/(2*h), tolerance, "rate of "//what)
        call check_close(error, acceleration(0), (rate(1) - rate(-1))/(2*h), tolerance, "acceleration of "//what)
    end subroutine check_differences

    !> The formulas, plainly written.
    subroutine test_start(error)
        type(test_error), intent(inout) :: error
        type(law_spec) :: law
        real(wp) :: value, rate, acceleration, u
        real(wp), parameter :: tolerance = 16*epsilon(1.0_wp)

        law = sample_law(law_cycloidal_start)     ! start 1, speed 3, duration 2
        u = 0.35_wp
        call evaluate_law(law, 2*u, value, rate, acceleration)
        call check_close(error, value, 1 + 6*(u**2/2 + (cos(two_pi*u) - 1)/two_pi**2), tolerance, "value")
        call check_close(error, rate, 3*(u - sin(two_pi*u)/two_pi), tolerance, "rate")
        call check_close(error, acceleration, 1.5_wp*(1 - cos(two_pi*u)), tolerance, "acceleration")
        call evaluate_law(law, 5.0_wp, value, rate, acceleration)
        call check_close(error, [value, rate, acceleration], [13.0_wp, 3.0_wp, 0.0_wp], tolerance, "after the start-up")
        call evaluate_law(law, -1.0_wp, value, rate, acceleration)
        call check_close(error, [value, rate, acceleration], [1.0_wp, 0.0_wp, 0.0_wp], tolerance, "before it")
        call evaluate_law(law, 2*(1 - epsilon(u)), value, rate, acceleration)
        call check_close(error, [value, rate, acceleration], [4.0_wp, 3.0_wp, 0.0_wp], tolerance, "at its end")
    end subroutine test_start

    !> Leading terms of the series: relative precision where the plain formula has lost all digits.
    subroutine test_small(error)
        type(test_error), intent(inout) :: error
        type(law_spec) :: law
        real(wp), parameter :: u = 2.0_wp**(-40), tolerance = 16*epsilon(1.0_wp)
        real(wp) :: value, rate, acceleration

        ! The next terms of the series are u**2 times smaller: 1e-24, far below double precision only.
        law = sample_law(law_cycloidal_start)
        law%value(1) = 0
        call evaluate_law(law, 2*u, value, rate, acceleration)
        call check_close(error, value/(6*two_pi**2*u**4/24), 1.0_wp, max(tolerance, 10*u**2), "start: value")
        call check_close(error, rate/(3*two_pi**2*u**3/6), 1.0_wp, max(tolerance, 10*u**2), "start: rate")
        call check_close(error, acceleration/(3*pi**2*u**2), 1.0_wp, max(tolerance, 10*u**2), "start: acceleration")
        law = law_spec(kind=law_cycloidal, time=[0.0_wp, 1.0_wp], knot=[0.0_wp, 1.0_wp])
        call evaluate_law(law, u, value, rate, acceleration)
        call check_close(error, value/(two_pi**2*u**3/6), 1.0_wp, max(tolerance, 10*u**2), "cycloidal: value")
        call check_close(error, rate/(2*(pi*u)**2), 1.0_wp, max(tolerance, 10*u**2), "cycloidal: rate")
        call evaluate_law(law, 1 - u, value, rate, acceleration)
        call check_close(error, rate/(2*(pi*u)**2), 1.0_wp, max(tolerance, 10*u**2), "cycloidal: rate at the end")
        call check_close(error, acceleration/(-two_pi**2*u), 1.0_wp, max(tolerance, 10*u**2), "cycloidal: acceleration there")
        law%kind = law_polynomial_345
        call evaluate_law(law, 1 - u, value, rate, acceleration)
        call check_close(error, rate/(30*u**2*(1 - u)**2), 1.0_wp, max(tolerance, 10*u**2), "3-4-5: rate at the end")
    end subroutine test_small

    subroutine test_knots(error)
        type(test_error), intent(inout) :: error
        type(law_spec) :: law
        real(wp) :: value, rate, acceleration, u
        integer :: kind, i

        do kind = law_cycloidal, law_polynomial_345
            law = sample_law(kind)
            do i = 1, size(law%time)
                call evaluate_law(law, law%time(i), value, rate, acceleration)
                call check_close(error, [value, rate, acceleration], [law%knot(i), 0.0_wp, 0.0_wp], 0.0_wp, "at rest in a knot")
            end do
            call evaluate_law(law, 1.9_wp, value, rate, acceleration)
            call check_close(error, [value, rate, acceleration], [2.0_wp, 0.0_wp, 0.0_wp], 0.0_wp, "dwell")
            call evaluate_law(law, 99.0_wp, value, rate, acceleration)
            call check_close(error, [value, rate, acceleration], [-1.0_wp, 0.0_wp, 0.0_wp], 0.0_wp, "after the end")
        end do
        law = law_spec(kind=law_polynomial_345, time=[0.0_wp, 1.0_wp], knot=[0.0_wp, 1.0_wp])
        u = 0.8_wp
        call evaluate_law(law, u, value, rate, acceleration)
        call check_close(error, value, 10*u**3 - 15*u**4 + 6*u**5, 16*epsilon(u), "3-4-5 polynomial")
        law%kind = law_cycloidal
        call evaluate_law(law, u, value, rate, acceleration)
        call check_close(error, value, u - sin(two_pi*u)/two_pi, 4*epsilon(u), "cycloid")
    end subroutine test_knots

    subroutine test_harmonic(error)
        type(test_error), intent(inout) :: error
        real(wp) :: value, rate, acceleration
        real(wp), parameter :: t = 0.7_wp

        call evaluate_law(sample_law(law_harmonic), t, value, rate, acceleration)
        call check_close(error, value, 0.5_wp + 2*sin(3*t + 0.25_wp), 4*epsilon(t), "value")
        call check_close(error, rate, 6*cos(3*t + 0.25_wp), 8*epsilon(t), "rate")
        call check_close(error, acceleration, -18*sin(3*t + 0.25_wp), 32*epsilon(t), "acceleration")
    end subroutine test_harmonic

    !> Not-a-knot ends: any cubic comes back, whatever the spacing, from four points on.
    subroutine test_cubic(error)
        type(test_error), intent(inout) :: error
        real(wp), parameter :: knots(*) = [0.0_wp, 0.3_wp, 0.35_wp, 1.5_wp, 1.6_wp, 3.0_wp]
        real(wp) :: value, rate, acceleration, t
        type(law_spec) :: law
        integer :: n, i

        do n = 4, size(knots)
            law = table_of(knots(:n), cubic(knots(:n)))
            do i = 0, 50
                t = knots(n)*i/50
                call evaluate_law(law, t, value, rate, acceleration)
                ! Second differences over the closest knots (0.05 apart) magnify roundings by 4/0.05**2.
                call check_close(error, value, cubic(t), 200*epsilon(t), "value")
                call check_close(error, rate, 6*t**2 - 6*t + 1, 2000*epsilon(t), "rate")
                call check_close(error, acceleration, 12*t - 6, 16000*epsilon(t), "acceleration")
            end do
        end do
    end subroutine test_cubic

    !> Value, rate and acceleration agree on both sides of every inner knot, for data that jump.
    subroutine test_smoothness(error)
        type(test_error), intent(inout) :: error
        type(law_spec) :: law
        real(wp) :: left(3), right(3), t
        integer :: i

        law = sample_law(law_table)
        do i = 2, size(law%time) - 1
            t = law%time(i)
            call evaluate_law(law, t*(1 - epsilon(t)), left(1), left(2), left(3))
            call evaluate_law(law, t, right(1), right(2), right(3))
            ! One rounding of t away; the third derivative is below 1000.
            call check_close(error, left, right, 1000*epsilon(t)*4, "both sides of a knot")
            call check_close(error, right(1), law%knot(i), 4*epsilon(t), "through the knot")
        end do
        call check(error, abs(law%curvature(3) - law%curvature(2)) > 1, "these data have a curvature that changes")
    end subroutine test_smoothness

    subroutine test_few_points(error)
        type(test_error), intent(inout) :: error
        real(wp) :: value, rate, acceleration
        real(wp), parameter :: t(3) = [0.0_wp, 1.0_wp, 3.0_wp]

        call evaluate_law(table_of(t, t**2), 2.0_wp, value, rate, acceleration)
        call check_close(error, [value, rate, acceleration], [4.0_wp, 4.0_wp, 2.0_wp], 16*epsilon(t), "parabola")
        call evaluate_law(table_of(t(:2), 5*t(:2)), 0.5_wp, value, rate, acceleration)
        call check_close(error, [value, rate, acceleration], [2.5_wp, 5.0_wp, 0.0_wp], 4*epsilon(t), "straight line")
        call evaluate_law(table_of(t(:1), [7.0_wp]), 0.5_wp, value, rate, acceleration)
        call check_close(error, [value, rate, acceleration], [7.0_wp, 0.0_wp, 0.0_wp], 0.0_wp, "one point")
    end subroutine test_few_points

    subroutine test_outside(error)
        type(test_error), intent(inout) :: error
        type(law_spec) :: law
        real(wp) :: value, rate, acceleration, at_end(3)

        law = sample_law(law_table)
        call evaluate_law(law, 99.0_wp, value, rate, acceleration)
        call check_close(error, [value, rate, acceleration], [law%knot(5), 0.0_wp, 0.0_wp], 0.0_wp, "held after the end")
        call evaluate_law(law, -99.0_wp, value, rate, acceleration)
        call check_close(error, [value, rate, acceleration], [law%knot(1), 0.0_wp, 0.0_wp], 0.0_wp, "held before the start")
        call evaluate_law(law, law%time(5), at_end(1), at_end(2), at_end(3))
        call check(error, abs(at_end(2)) > 0.1_wp, "in motion at the end")
        call evaluate_law(law, law%time(5)*(1 + epsilon(value)), value, rate, acceleration)
        call check_close(error, [value, rate, acceleration], at_end, 0.0_wp, "a rounding past the end is the end")
    end subroutine test_outside

    subroutine test_lines(error)
        type(test_error), intent(inout) :: error
        type(law_spec) :: law
        real(wp) :: value, rate, acceleration

        law = law_spec(kind=law_table, time=[0.0_wp, 1.0_wp, 2.0_wp], knot=[0.0_wp, 4.0_wp, 2.0_wp])
        call evaluate_law(law, 1.25_wp, value, rate, acceleration)
        call check_close(error, [value, rate, acceleration], [3.5_wp, -2.0_wp, 0.0_wp], 8*epsilon(value), "second line")
    end subroutine test_lines

    !> From any guess, also one outside the table, the search ends where plain counting does.
    subroutine test_intervals(error)
        type(test_error), intent(inout) :: error
        real(wp) :: time(40), t
        integer :: i, near, n

        time = [(real(i, wp)**1.5_wp, i=1, size(time))]
        do n = 2, size(time)
            do i = 0, 3*n
                t = time(1) + (time(n) - time(1))*(real(i, wp)/n - 1)
                if (modulo(i, 3) == 0) t = time(1 + modulo(7*i, n))
                do near = -1, n + 1
                    call check(error, interval_of(time(:n), t, near) == max(1, min(n - 1, count(time(:n) <= t))), "the interval")
                end do
            end do
        end do
    end subroutine test_intervals

    !> Law after law at the same instants gives what each gives alone, to the last bit: instants in any order, repeated, in
    !> knots, outside, beside the ends by a rounding, no numbers at all; laws that share their courses and others between them.
    subroutine test_many_instants(error)
        type(test_error), intent(inout) :: error
        integer, parameter :: n = most_instants
        integer, parameter :: shared(4) = [law_cycloidal_start, law_cycloidal, law_polynomial_345, law_harmonic]
        type(law_spec) :: law(15)
        type(law_instants) :: instants
        real(wp) :: t(n), value(n), rate(n), acceleration(n), expected(3), nan
        integer :: i, k, turn

        law = sample_law(law_table)
        law(1)%course = 1
        law(2)%course = 1
        law(2)%knot = 3*law(2)%knot
        deallocate (law(2)%curvature)                 ! straight lines share with splines
        law(3) = table_of([-2.0_wp, 0.1_wp, 9.0_wp, 9.5_wp], [1.0_wp, -2.0_wp, 0.5_wp, 0.0_wp])
        law(3)%course = 2
        law(4) = table_of([1.0_wp], [4.0_wp])         ! nobody has looked at the knots of two
        law(5) = table_of([0.0_wp, 3.0_wp], [1.0_wp, 2.0_wp])
        law(6) = sample_law(law_harmonic)
        law(7)%course = 1                             ! first and last, at other instants
        do k = 1, size(shared)
            law(2*k + 6:2*k + 7) = sample_law(shared(k))
            law(2*k + 6:2*k + 7)%course = 2 + k
            law(2*k + 7)%value(:2) = -3*law(2*k + 7)%value(:2)
            if (allocated(law(2*k + 7)%knot)) law(2*k + 7)%knot = 0.3_wp - 2*law(2*k + 7)%knot
            call check(error, have_same_course(law(2*k + 6), law(2*k + 7)), "of other sizes")
            call check(error, .not. have_same_course(law(2*k + 6), law(2*k + 4)), "of another kind")
        end do
        call check(error, .not. have_same_course(law(1), law(3)), "of other knots")
        nan = ieee_value(nan, ieee_quiet_nan)
        do turn = 1, 3
            do i = 1, n
                t(i) = 4*modulo(i*0.6180339887_wp, 1.0_wp) - 0.5_wp
                if (turn == 2) t(i) = -1 + 5*real(i, wp)/n
            end do
            if (turn == 3) t(:15) = [law(1)%time, law(1)%time(5:1:-1), law(1)%time(5)*(1 + epsilon(t)), -99.0_wp, nan, &
                                     0.55_wp, 0.55_wp]
            call set_instants(instants, t(:n - turn))
            do k = 1, size(law)
                call evaluate_at_instants(law(k), instants, value(:n - turn), rate(:n - turn), acceleration(:n - turn))
                do i = 1, n - turn
                    call evaluate_law(law(k), t(i), expected(1), expected(2), expected(3))
                    call check(error, all(are_same([value(i), rate(i), acceleration(i)], expected)), "as alone")
                end do
                call evaluate_at_instants(law(k), instants, acceleration(:n - turn))
                call check(error, all(are_same(acceleration(:n - turn), value(:n - turn))), "values alone")
            end do
        end do
    end subroutine test_many_instants

    !> Equal, or both no numbers.
    elemental logical function are_same(a, b)
        real(wp), intent(in) :: a, b

        are_same = a == b .or. (a /= a .and. b /= b)
    end function are_same

    subroutine test_ends(error)
        type(test_error), intent(inout) :: error
        real(wp), allocatable :: kinks(:)
        type(law_spec) :: law

        call check_close(error, law_end(sample_law(law_constant)), 0.0_wp, 0.0_wp, "constant")
        call check_close(error, law_end(sample_law(law_cycloidal_start)), 2.0_wp, 0.0_wp, "start-up")
        call check_close(error, law_end(sample_law(law_cycloidal)), 2.8_wp, 0.0_wp, "knots")
        call check_close(error, law_end(sample_law(law_harmonic)), two_pi/3, 4*epsilon(1.0_wp), "a period")
        call law_kinks(sample_law(law_cycloidal_start), kinks)
        call check_close(error, kinks, [0.0_wp, 2.0_wp], 0.0_wp, "kinks of a start-up")
        call law_kinks(sample_law(law_harmonic), kinks)
        call check(error, size(kinks) == 0, "a harmonic has none")
        law = sample_law(law_table)
        call law_kinks(law, kinks)
        call check_close(error, kinks, law%time([1, 5]), 0.0_wp, "ends of a spline")
        deallocate (law%curvature)
        call law_kinks(law, kinks)
        call check_close(error, kinks, law%time, 0.0_wp, "corners of straight lines")
    end subroutine test_ends

    !> A law of each kind.
    function sample_law(kind) result(law)
        integer, intent(in) :: kind
        type(law_spec) :: law

        select case (kind)
        case (law_table)
            law = table_of([0.0_wp, 0.5_wp, 0.6_wp, 1.7_wp, 2.8_wp], [1.0_wp, 2.0_wp, -1.0_wp, 0.5_wp, 3.0_wp])
        case (law_cycloidal, law_polynomial_345)
            law = law_spec(kind=kind, time=[0.0_wp, 1.5_wp, 2.1_wp, 2.8_wp], knot=[1.0_wp, 2.0_wp, 2.0_wp, -1.0_wp])
        case (law_harmonic)
            law = law_spec(kind=kind, value=[0.5_wp, 2.0_wp, 3.0_wp, 0.25_wp])
        case default
            law = law_spec(kind=kind, value=[1.0_wp, 3.0_wp, 2.0_wp, 0.0_wp])
        end select
    end function sample_law

    function table_of(time, knot) result(law)
        real(wp), intent(in) :: time(:), knot(:)
        type(law_spec) :: law

        law%kind = law_table
        law%time = time
        law%knot = knot
        allocate (law%curvature(size(time)))
        call fit_spline(time, knot, law%curvature)
    end function table_of

    pure elemental real(wp) function cubic(t)
        real(wp), intent(in) :: t

        cubic = 2*t**3 - 3*t**2 + t - 0.5_wp
    end function cubic
end module test_laws
