!> Laws over the state: formulas, tables, periods, in whatever precision the engine is built.
module test_state_laws
    use linkdyn_constants, only: two_pi
    use linkdyn_formula, only: formula_type, evaluate_formula
    use linkdyn_kinds, only: wp
    use linkdyn_law_values, only: evaluate_laws, is_outside
    use linkdyn_scene, only: law_book, state_law, measure_spec, law_table
    use linkdyn_spline, only: fit_periodic_spline
    use linkdyn_testing, only: test_error, unit_test, new_test, check, check_close
    use linkdyn_variables, only: variable_table, variable_entry, symbol_entry, formula_of_text
    use linkdyn_expression, only: measured_value
    implicit none (type, external)
    private
    public :: collect_state_laws

contains

    subroutine collect_state_laws(tests)
        type(unit_test), allocatable, intent(out) :: tests(:)

        tests = [ &
            new_test("formulas against the compiler", test_formulas), &
            new_test("what has no value stays none", test_no_value), &
            new_test("modes change where a formula jumps", test_modes), &
            new_test("periodic spline is smooth all round", test_periodic_spline), &
            new_test("periods and ranges of tables", test_tables)]
    end subroutine collect_state_laws

    !> A formula of the plain numbers x and y.
    subroutine make_formula(text, formula, problem)
        character(len=*), intent(in) :: text
        type(formula_type), intent(out) :: formula
        character(len=:), allocatable, intent(out) :: problem
        type(variable_table) :: variables
        type(variable_entry) :: none(0)
        type(measured_value) :: found

        call variables%set_entries(none)
        call variables%add_symbol(symbol_entry(name="x", symbol=1, has_unit=.false.))
        call variables%add_symbol(symbol_entry(name="y", symbol=2, has_unit=.false.))
        call formula_of_text(text, variables, found, formula, problem)
    end subroutine make_formula

    !> Its values.
    subroutine evaluate(error, text, x, y, value, mode)
        type(test_error), intent(inout) :: error
        character(len=*), intent(in) :: text
        real(wp), intent(in) :: x(:), y(:)
        real(wp), intent(out) :: value(:), mode(:)
        type(formula_type) :: formula
        character(len=:), allocatable :: problem
        real(wp) :: measure(size(x), 2), none(size(x), 0)

        call make_formula(text, formula, problem)
        call check(error, problem == "", text//": "//problem)
        measure(:, 1) = x
        measure(:, 2) = y
        mode = 0
        call evaluate_formula(formula, measure, none, value, mode)
    end subroutine evaluate

    subroutine test_formulas(error)
        type(test_error), intent(inout) :: error
        real(wp), parameter :: x(*) = [-1.3_wp, -0.2_wp, 0.4_wp, 0.9_wp], y(*) = [0.7_wp, 2.1_wp, -3.2_wp, 0.05_wp]

        call compare("x*y - 2*x/(3 + y^2)", x*y - 2*x/(3 + y**2))
        call compare("-x^3 + 4^(abs(y)/2) - 1.5", -x**3 + 4**(abs(y)/2) - 1.5_wp)
        call compare("sqrt(abs(x))*sin(y) + cos(x)*tan(y/4)", sqrt(abs(x))*sin(y) + cos(x)*tan(y/4))
        call compare("exp(-x^2)*tanh(y) + log(1 + y^2)", exp(-x**2)*tanh(y) + log(1 + y**2))
        call compare("max(x, min(y, 0.5)) + sign(x)*step(y)", max(x, min(y, 0.5_wp)) + sign(1.0_wp, x)*merge(1, 0, y > 0))
        call compare("if(x - y, 2*x, y^2)", merge(2*x, y**2, x > y))
        call compare("asin(x/2)/(1 rad) - acos(y/4)/(1 rad) + atan2(y, x)/(1 rad)", asin(x/2) - acos(y/4) + atan2(y, x))
        ! numbers of a text are read in double precision: such as double and quadruple precision have alike
        call compare("(1 + x^2)^1.5 + abs(y)^0.375", (1 + x**2)**1.5_wp + abs(y)**0.375_wp)

    contains

        subroutine compare(text, wanted)
            character(len=*), intent(in) :: text
            real(wp), intent(in) :: wanted(:)
            real(wp) :: value(size(x)), mode(size(x))

            call evaluate(error, text, x, y, value, mode)
            call check(error, all(abs(value - wanted) <= 16*epsilon(1.0_wp)*(1 + abs(wanted))), text)
        end subroutine compare
    end subroutine test_formulas

    subroutine test_no_value(error)
        type(test_error), intent(inout) :: error
        real(wp) :: value(2), mode(2)

        call expect("sqrt(x)")
        call expect("log(x)")
        call expect("x^0.5")
        call expect("asin(x - 1)/(1 rad)")
        call expect("min(sqrt(x), 1)")
        call expect("max(1, sqrt(x))")
        call expect("sign(sqrt(x))")
        call expect("step(sqrt(x))")
        call expect("if(sqrt(x), 1, 2)")
        call expect("0*sqrt(x)")

    contains

        !> None at x = -1, one at x = 1.
        subroutine expect(text)
            character(len=*), intent(in) :: text

            call evaluate(error, text, [-1.0_wp, 1.0_wp], [0.0_wp, 0.0_wp], value, mode)
            call check(error, .not. abs(value(1)) <= huge(1.0_wp) .and. abs(value(2)) <= huge(1.0_wp), text)
        end subroutine expect
    end subroutine test_no_value

    subroutine test_modes(error)
        type(test_error), intent(inout) :: error
        real(wp) :: value(4), mode(4)
        real(wp), parameter :: x(4) = [-2.0_wp, -1.0_wp, 0.0_wp, 1.0_wp], none(4) = 0

        call evaluate(error, "sign(x)", x, none, value, mode)
        call check(error, mode(1) == mode(2) .and. mode(2) /= mode(3) .and. mode(3) /= mode(4), "sign")
        call evaluate(error, "if(x, 3, 4) + step(x + 1.5)", x, none, value, mode)
        call check(error, mode(1) /= mode(2) .and. mode(2) == mode(3) .and. mode(3) /= mode(4), "if and step")
        call evaluate(error, "abs(x) + max(x, 0)", x, none, value, mode)
        call check(error, all(mode == 0), "no jump")
    end subroutine test_modes

    !> Value, slope and curvature at the end of a period are those at its beginning, with unequal rows; two and three rows, too.
    subroutine test_periodic_spline(error)
        type(test_error), intent(inout) :: error
        real(wp), parameter :: knots(*) = [0.0_wp, 0.3_wp, 0.5_wp, 1.2_wp, 1.9_wp, 2.4_wp, 3.0_wp]
        real(wp) :: sampled(61), phase(61)
        integer :: i

        call check_smooth(knots, [1.0_wp, -2.0_wp, 0.5_wp, 3.0_wp, 0.1_wp, 0.2_wp, 1.0_wp])
        call check_smooth(knots([1, 3, 7]), [1.0_wp, -2.0_wp, 1.0_wp])
        call check_smooth(knots([1, 2, 5, 7]), [1.0_wp, -2.0_wp, 4.0_wp, 1.0_wp])
        ! the error of a cubic spline: 5/384 h**4 in the middle of its intervals at most
        phase = [(two_pi*(i - 1)/60, i=1, 61)]
        sampled = sin(phase)
        sampled(61) = sampled(1)
        call check_sine(phase, sampled)

    contains

        subroutine check_smooth(time, knot)
            real(wp), intent(in) :: time(:), knot(:)
            real(wp) :: curvature(size(time)), slope(2), h(2)
            integer :: n, k

            n = size(time)
            call fit_periodic_spline(time, knot, curvature)
            call check(error, curvature(1) == curvature(n), "curvature closes")
            do k = 1, n - 1
                ! slope at knot k from the interval before and the one behind
                associate (a => merge(n - 1, k - 1, k == 1))
                    h = [time(a + 1) - time(a), time(k + 1) - time(k)]
                    slope(1) = (knot(a + 1) - knot(a))/h(1) + h(1)*(curvature(a) + 2*curvature(a + 1))/6
                    slope(2) = (knot(k + 1) - knot(k))/h(2) - h(2)*(2*curvature(k) + curvature(k + 1))/6
                end associate
                call check_close(error, slope(2), slope(1), 1.0e3_wp*epsilon(1.0_wp), "slope")
            end do
        end subroutine check_smooth

        subroutine check_sine(time, knot)
            real(wp), intent(in) :: time(:), knot(:)
            type(state_law) :: law
            type(law_book) :: book
            real(wp) :: measure(200, 1), value(200, 1), mode(200)
            integer :: k

            law%over = 1
            law%period = two_pi
            law%table%kind = law_table
            law%table%time = time
            law%table%knot = knot
            allocate (law%table%curvature(size(time)))
            call fit_periodic_spline(time, knot, law%table%curvature)
            book%measure = [measure_spec()]
            book%law = [law]
            measure(:, 1) = [(-17 + 0.173_wp*k, k=1, 200)]
            call evaluate_laws(book, measure, value, mode)
            call check(error, maxval(abs(value(:, 1) - sin(measure(:, 1)))) < 5*(two_pi/60)**4/384 + 1.0e-12_wp, "sine")
        end subroutine check_sine
    end subroutine test_periodic_spline

    !> A table over a law over a measure; what lies outside is none.
    subroutine test_tables(error)
        type(test_error), intent(inout) :: error
        type(law_book) :: book
        type(state_law) :: table, double
        character(len=:), allocatable :: problem
        real(wp) :: measure(5, 1), value(5, 2), mode(5)

        call make_formula("2*x", double%formula, problem)
        table%over = -1
        table%table%kind = law_table
        table%table%time = [0.0_wp, 1.0_wp, 3.0_wp]
        table%table%knot = [1.0_wp, 5.0_wp, 1.0_wp]
        book%measure = [measure_spec()]
        book%law = [double, table]
        measure(:, 1) = [0.0_wp, 0.25_wp, 1.0_wp, 1.5_wp, 1.5001_wp]
        call evaluate_laws(book, measure, value, mode)
        call check(error, all(abs(value(:4, 2) - [1.0_wp, 3.0_wp, 3.0_wp, 1.0_wp]) < 1.0e-12_wp), "straight lines")
        call check(error, .not. abs(value(5, 2)) <= huge(1.0_wp), "outside")
        call check(error, is_outside(table, 3.0002_wp) .and. .not. is_outside(table, 3*(1 + epsilon(1.0_wp))), "its end")
        book%law(2)%period = 3
        measure(:, 1) = [-1.5_wp, 0.25_wp + 3, 1.0_wp - 30, 1.5_wp, 1500.25_wp]
        call evaluate_laws(book, measure, value, mode)
        call check(error, all(abs(value(:, 2) - [1.0_wp, 3.0_wp, 3.0_wp, 1.0_wp, 3.0_wp]) < 1.0e-9_wp), "periods")
    end subroutine test_tables
end module test_state_laws
