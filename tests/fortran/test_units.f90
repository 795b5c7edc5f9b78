!> linkdyn_units: units turned into SI, wrong dimensions refused by name.
module test_units
    use linkdyn_kinds, only: wp
    use linkdyn_constants, only: pi
    use linkdyn_testing, only: test_error, unit_test, new_test, check, check_close
    use linkdyn_units, only: quantity_type, unit_factor, per_second, plain_number, length, angle, &
        mass, inertia, time_span, force, moment, speed, angular_rate, acceleration, stiffness, angular_stiffness, &
        damping, resistance, volt_second
    use linkdyn_variables, only: variable_table, quantity_of_text
    implicit none (type, external)
    private
    public :: collect_units

    real(wp), parameter :: tolerance = 4*epsilon(1.0_wp)   !! of the value: a rounding for each factor of a unit

contains

    subroutine collect_units(tests)
        type(unit_test), allocatable, intent(out) :: tests(:)

        tests = [ &
            new_test("plain units", test_plain), &
            new_test("products and quotients", test_products), &
            new_test("turns or radians a minute", test_minutes), &
            new_test("angles are no numbers", test_angles), &
            new_test("wrong dimensions", test_wrong), &
            new_test("what is no quantity", test_nonsense), &
            new_test("prefixes that are meant", test_prefixes), &
            new_test("unit of a column", test_factor)]
    end subroutine collect_units

    subroutine test_plain(error)
        type(test_error), intent(inout) :: error

        call expect(error, "12 mm", length, 12/1000.0_wp)
        call expect(error, "12mm", length, 12/1000.0_wp)
        call expect(error, " -1.5e2 um ", length, -150/1.0e6_wp)
        call expect(error, "1.25 t", mass, 1250.0_wp)
        call expect(error, "850 kg", mass, 850.0_wp)
        call expect(error, "3 g", mass, 3/1000.0_wp)
        call expect(error, "10 kN", force, 10000.0_wp)
        call expect(error, "2 min", time_span, 120.0_wp)
        call expect(error, "5 ms", time_span, 5/1000.0_wp)
        call expect(error, "1 in", length, 254/10000.0_wp)
        call expect(error, "80 %", plain_number, 80/100.0_wp)
        call expect(error, "0.5", plain_number, 0.5_wp)
        call expect(error, "3 ohm", resistance, 3.0_wp)
        ! minus and blanks as data sheets have them
        call expect(error, char(226)//char(136)//char(146)//"20"//char(194)//char(160)//"mm", length, -20/1000.0_wp)
        call expect(error, "20"//char(226)//char(128)//char(175)//"N"//char(226)//char(128)//char(137)//"m", moment, 20.0_wp)
    end subroutine test_plain

    subroutine test_minutes(error)
        type(test_error), intent(inout) :: error
        character(len=:), allocatable :: problem
        real(wp) :: factor

        call unit_factor("rpm", angular_rate, factor, problem)
        call check(error, problem == "", "rpm of a column "//problem)
        call unit_factor("1/min", angular_rate, factor, problem)
        call check(error, index(problem, "may be turns or radians a minute") > 0, "1/min of a column "//problem)
        call unit_factor("1/s", angular_rate, factor, problem)
        call check(error, problem == "", "1/s of a column "//problem)
    end subroutine test_minutes

    subroutine test_products(error)
        type(test_error), intent(inout) :: error

        call expect(error, "250 N*m", moment, 250.0_wp)
        call expect(error, "250 N m", moment, 250.0_wp)
        call expect(error, "250 Nm", moment, 250.0_wp)
        call expect(error, "250 N"//char(194)//char(183)//"m", moment, 250.0_wp)
        call expect(error, "2 kNm", moment, 2000.0_wp)
        call expect(error, "5 kg*m^2", inertia, 5.0_wp)
        call expect(error, "5 kg m2", inertia, 5.0_wp)
        call expect(error, "5 kg*m**2", inertia, 5.0_wp)
        call expect(error, "5 kg m"//char(194)//char(178), inertia, 5.0_wp)
        call expect(error, "5e6 kg*mm^2", inertia, 5.0_wp)
        call expect(error, "2 m/s^2", acceleration, 2.0_wp)
        call expect(error, "2 m s^-2", acceleration, 2.0_wp)
        call expect(error, "2 m/s/s", acceleration, 2.0_wp)
        call expect(error, "1e5 N/m", stiffness, 1.0e5_wp)
        call expect(error, "3 N/(m/s)", damping, 3.0_wp)
        call expect(error, "20 N*m/rad", angular_stiffness, 20.0_wp)
        call expect(error, "20 N*m", angular_stiffness, 20.0_wp)
        call expect(error, "0.5 V*s/rad", volt_second, 0.5_wp)
        call expect(error, "36 m/h", speed, 36/3600.0_wp)
        call expect(error, "2 kN/s", per_second(force), 2000.0_wp)
    end subroutine test_products

    subroutine test_angles(error)
        type(test_error), intent(inout) :: error

        call expect(error, "30 deg", angle, pi/6)
        call expect(error, "30"//char(194)//char(176), angle, pi/6)
        call expect(error, "0.25 rev", angle, pi/2)
        call expect(error, "60 rpm", angular_rate, 2*pi)
        call expect(error, "0.5 Hz", angular_rate, pi)
        call expect(error, "3 rad/s", angular_rate, 3.0_wp)
        call expect(error, "3 1/s", angular_rate, 3.0_wp)
        call expect(error, "180 deg/s", angular_rate, pi)
        call expect(error, "180 deg/s", per_second(angle), pi)
    end subroutine test_angles

    subroutine test_wrong(error)
        type(test_error), intent(inout) :: error

        call refused(error, "3 kg", length, "'3 kg' is a mass")
        call refused(error, "30 deg", length, "'30 deg' is an angle")
        call refused(error, "30 mm", angle, "'30 mm' is a length")
        call refused(error, "3 N", moment, "'3 N' is a force")
        call refused(error, "3 N*m/rad", moment, "'3 N*m/rad' is something in kg m^2 s^-2 rad^-1")
        call refused(error, "3 rad*m", length, "something in m rad")
        call refused(error, "3 kg*m/s", force, "something in kg m s^-1")
        call refused(error, "3", length, "'3' has no unit")
    end subroutine test_wrong

    subroutine test_nonsense(error)
        type(test_error), intent(inout) :: error

        call refused(error, "3 furlong", length, "'furlong' is not a unit")
        call refused(error, "mm", length, "does not start with a number")
        call refused(error, "", length, "does not start with a number")
        call refused(error, "nan mm", length, "is not a finite number")
        call refused(error, "1e999 mm", length, "is not a finite number")
        call refused(error, "3 N/", force, "ends where a number")
        call refused(error, "3 m^", length, "is not a unit")
        call refused(error, "3 (m", length, "has '(m' where an operator")
        call refused(error, "3 m)", length, "has ')' where an operator")
        call refused(error, "3 m//s", speed, "has '/s' where a number")
        call refused(error, "3 12 m", length, "has '12 m' where an operator")
        call refused(error, "3 kdeg", angle, "is not a unit")
    end subroutine test_nonsense

    subroutine test_prefixes(error)
        type(test_error), intent(inout) :: error
        real(wp) :: factor
        character(len=:), allocatable :: problem

        call refused(error, "90 Grad", angle, "'Grad' is not a unit that linkdyn knows; did you mean 'deg'?")
        call refused(error, "90 grad", angle, "did you mean 'deg'?")
        call refused(error, "1 Mrad", angle, "did you mean 'mrad'?")
        call refused(error, "1 krad", angle, "is not a unit")
        call refused(error, "1 Mm", length, "did you mean 'mm'?")
        call refused(error, "1 Ms", time_span, "did you mean 'ms'?")
        call refused(error, "3 dag", mass, "is not a unit")
        call refused(error, "1 mt", mass, "is not a unit")
        call unit_factor("Grad", angle, factor, problem)
        call check(error, index(problem, "did you mean 'deg'?") > 0, "Grad of a column "//problem)
        call expect(error, "3 mrad", angle, 3/1000.0_wp)
        call expect(error, "3 daN", force, 30.0_wp)
        call expect(error, "3 cNm", moment, 3/100.0_wp)
        call expect(error, "2 Mg", mass, 2000.0_wp)
        call expect(error, "3 Mohm", resistance, 3.0e6_wp)
        call expect(error, "3 MN", force, 3.0e6_wp)
        call expect(error, "1 kHz", angular_rate, 2000*pi)
    end subroutine test_prefixes

    subroutine test_factor(error)
        type(test_error), intent(inout) :: error
        real(wp) :: factor
        character(len=:), allocatable :: problem

        call unit_factor("mm", length, factor, problem)
        call check(error, problem == "", problem)
        call check_close(error, factor, 1/1000.0_wp, tolerance/1000, "mm")
        call unit_factor("", length, factor, problem)
        call check(error, problem == "", "no unit is SI: "//problem)
        call check_close(error, factor, 1.0_wp, 0.0_wp, "no unit")
        call unit_factor("deg", length, factor, problem)
        call check(error, problem == "'deg' is the unit of an angle", problem)
    end subroutine test_factor

    subroutine expect(error, text, quantity, want)
        type(test_error), intent(inout) :: error
        character(len=*), intent(in) :: text
        type(quantity_type), intent(in) :: quantity
        real(wp), intent(in) :: want
        type(variable_table) :: none
        real(wp) :: value
        character(len=:), allocatable :: problem

        call quantity_of_text(text, quantity, none, value, problem)
        call check(error, problem == "", text//": "//problem)
        call check_close(error, value, want, tolerance*abs(want), text)
    end subroutine expect

    subroutine refused(error, text, quantity, fragment)
        type(test_error), intent(inout) :: error
        character(len=*), intent(in) :: text
        type(quantity_type), intent(in) :: quantity
        character(len=*), intent(in) :: fragment       !! of the message
        type(variable_table) :: none
        real(wp) :: value
        character(len=:), allocatable :: problem

        call quantity_of_text(text, quantity, none, value, problem)
        call check(error, index(problem, fragment) > 0, text//": got '"//problem//"', want '"//fragment//"'")
    end subroutine refused
end module test_units
