!> Quantities with units: "60 rpm", "250 N*m", "5 kg m^2", checked against what is expected.
!>
!> A unit is a product and quotient of powers of unit names, each with an SI prefix if it likes:
!> `kN`, `N*m`, `N m`, `m/s^2`, `m/s2`, `N/(m/s)`, `kg·m²`. The angle counts as a dimension, so that
!> "30 deg" is no length; where convention leaves the radian out (N*m for N*m/rad) it may be left out.
module linkdyn_units
    use linkdyn_kinds, only: wp
    use linkdyn_constants, only: pi, two_pi
    use linkdyn_text, only: quoted, to_text
    use linkdyn_input, only: parse_number
    use linkdyn_suggest, only: suggestion
    implicit none (type, external)
    private
    public :: quantity_type, per_second, over, is_unit, unit_factor, counts_turns, names_minutes, is_same_dimension
    public :: n_dimension, read_value, read_unit, misfit, dimension_text, si_unit_text, ascii_unit, unknown_unit
    public :: usual_unit, two_units
    public :: plain_number, length, angle, mass, inertia, time_span, force, moment, speed, angular_rate
    public :: acceleration, stiffness, angular_stiffness, damping, angular_damping
    public :: pressure, area, second_moment, fluid_pressure, volume, volume_flow, flow_per_pressure, valve_opening
    public :: wattage, torque_per_current, volt_second, volt_per_angle, volt_per_length, voltage, resistance, inductance, current

    integer, parameter :: n_dimension = 5          !! kg m s A rad

    character(len=3), parameter :: base_unit(n_dimension) = [character(len=3) :: "kg", "m", "s", "A", "rad"]

    !> What a number stands for.
    type :: quantity_type
        character(len=40) :: name = ""             !! with its article: "a length"
        character(len=16) :: example = ""          !! "12 mm"
        character(len=8) :: unit = ""              !! SI unit
        integer :: power(n_dimension) = 0          !! of kg m s A rad
        logical :: angle_is_optional = .false.     !! the radian may be left out
    end type quantity_type

    type(quantity_type), parameter :: plain_number = &
        quantity_type("a plain number", "0.8", "1", [0, 0, 0, 0, 0])
    type(quantity_type), parameter :: length = &
        quantity_type("a length", "12 mm", "m", [0, 1, 0, 0, 0])
    type(quantity_type), parameter :: angle = &
        quantity_type("an angle", "30 deg", "rad", [0, 0, 0, 0, 1])
    type(quantity_type), parameter :: mass = &
        quantity_type("a mass", "850 kg", "kg", [1, 0, 0, 0, 0])
    type(quantity_type), parameter :: inertia = &
        quantity_type("a moment of inertia", "5 kg*m^2", "kg m2", [1, 2, 0, 0, 0])
    type(quantity_type), parameter :: time_span = &
        quantity_type("a time", "0.5 s", "s", [0, 0, 1, 0, 0])
    type(quantity_type), parameter :: force = &
        quantity_type("a force", "10 kN", "N", [1, 1, -2, 0, 0])
    type(quantity_type), parameter :: moment = &
        quantity_type("a moment", "250 N*m", "N m", [1, 2, -2, 0, 0])
    type(quantity_type), parameter :: speed = &
        quantity_type("a speed", "0.5 m/s", "m/s", [0, 1, -1, 0, 0])
    type(quantity_type), parameter :: angular_rate = &
        quantity_type("an angular rate", "60 rpm", "rad/s", [0, 0, -1, 0, 1], .true.)
    type(quantity_type), parameter :: acceleration = &
        quantity_type("an acceleration", "9.81 m/s^2", "m/s2", [0, 1, -2, 0, 0])
    type(quantity_type), parameter :: stiffness = &
        quantity_type("a stiffness", "1e5 N/m", "N/m", [1, 0, -2, 0, 0])
    type(quantity_type), parameter :: angular_stiffness = &
        quantity_type("an angular stiffness", "20 N*m/rad", "N m/rad", [1, 2, -2, 0, -1], .true.)
    type(quantity_type), parameter :: damping = &
        quantity_type("a damping", "30 N*s/m", "N s/m", [1, 0, -1, 0, 0])
    type(quantity_type), parameter :: angular_damping = &
        quantity_type("an angular damping", "2 N*m*s/rad", "N m s", [1, 2, -1, 0, -1], .true.)
    type(quantity_type), parameter :: torque_per_current = &
        quantity_type("a torque constant", "0.22 N*m/A", "N m/A", [1, 2, -2, -1, 0])
    type(quantity_type), parameter :: volt_second = &
        quantity_type("a back-emf constant", "0.22 V*s/rad", "V s", [1, 2, -2, -1, -1], .true.)
    type(quantity_type), parameter :: volt_per_angle = &
        quantity_type("a gain in volts per radian", "100 V/rad", "V/rad", [1, 2, -3, -1, -1], .true.)
    type(quantity_type), parameter :: volt_per_length = &
        quantity_type("a gain in volts per metre", "100 V/m", "V/m", [1, 1, -3, -1, 0])
    type(quantity_type), parameter :: pressure = &
        quantity_type("a modulus of elasticity", "210 GPa", "Pa", [1, -1, -2, 0, 0])
    type(quantity_type), parameter :: area = &
        quantity_type("an area", "4 cm^2", "m2", [0, 2, 0, 0, 0])
    type(quantity_type), parameter :: second_moment = &
        quantity_type("a second moment of area", "6 cm^4", "m4", [0, 4, 0, 0, 0])
    type(quantity_type), parameter :: fluid_pressure = &
        quantity_type("a pressure", "160 bar", "Pa", [1, -1, -2, 0, 0])
    type(quantity_type), parameter :: volume = &
        quantity_type("a volume", "0.2 litre", "m3", [0, 3, 0, 0, 0])
    type(quantity_type), parameter :: volume_flow = &
        quantity_type("a flow", "40 litre/min", "m3/s", [0, 3, -1, 0, 0])
    type(quantity_type), parameter :: flow_per_pressure = &
        quantity_type("a flow over a pressure", "0.02 litre/min/bar", "m3/s/Pa", [-1, 4, 1, 0, 0])
    type(quantity_type), parameter :: valve_opening = &
        quantity_type("an opening from -1 to 1", "0.4", "1", [0, 0, 0, 0, 0])
    type(quantity_type), parameter :: wattage = &
        quantity_type("a power", "2 kW", "W", [1, 2, -3, 0, 0])
    type(quantity_type), parameter :: voltage = &
        quantity_type("a voltage", "24 V", "V", [1, 2, -3, -1, 0])
    type(quantity_type), parameter :: current = &
        quantity_type("a current", "15 A", "A", [0, 0, 0, 1, 0])
    type(quantity_type), parameter :: inductance = &
        quantity_type("an inductance", "2 mH", "H", [1, 2, -2, -2, 0])
    type(quantity_type), parameter :: resistance = &
        quantity_type("a resistance", "3 ohm", "ohm", [1, 2, -3, -2, 0])

    !> Whose dimension goes by their name in messages; of several with the same one, by the last one's.
    type(quantity_type), parameter :: named(*) = [plain_number, length, angle, mass, inertia, time_span, &
        force, speed, angular_rate, acceleration, stiffness, damping, wattage, resistance, inductance, &
        fluid_pressure, volume, volume_flow]

    !> A unit name, and the SI prefixes that may stand before it: those that somebody uses. Others are slips of the pen or
    !> other words: "Mm" of mm, "Grad", which is German for degree.
    type :: unit_entry
        character(len=6) :: name
        real(wp) :: factor                         !! in SI
        integer :: power(n_dimension)
        character(len=18) :: prefixes              !! with blanks between them
    end type unit_entry

    character(len=*), parameter :: small = "n u m", every_force = "n u m c d da k M", electric = "n u m k", &
        of_ohm = "u m k M G", of_power = "n u m k M G"

    real(wp), parameter :: one = 1
    real(wp), parameter :: inch = 0.0254_wp
    real(wp), parameter :: pound = 0.45359237_wp
    real(wp), parameter :: standard_gravity = 9.80665_wp

    type(unit_entry), parameter :: units(*) = [ &
        unit_entry("m", one, [0, 1, 0, 0, 0], "n u m c d k"), &
        unit_entry("g", 0.001_wp, [1, 0, 0, 0, 0], "n u m k M"), &
        unit_entry("t", 1000*one, [1, 0, 0, 0, 0], "d k"), &
        unit_entry("s", one, [0, 0, 1, 0, 0], small), &
        unit_entry("A", one, [0, 0, 0, 1, 0], electric), &
        unit_entry("rad", one, [0, 0, 0, 0, 1], small), &
        unit_entry("N", one, [1, 1, -2, 0, 0], every_force), &
        unit_entry("Nm", one, [1, 2, -2, 0, 0], every_force), &
        unit_entry("Pa", one, [1, -1, -2, 0, 0], "u m da h k M G"), &
        unit_entry("bar", 1.0e5_wp, [1, -1, -2, 0, 0], "u m d k"), &
        unit_entry("litre", 0.001_wp, [0, 3, 0, 0, 0], ""), &
        unit_entry("J", one, [1, 2, -2, 0, 0], of_power), &
        unit_entry("W", one, [1, 2, -3, 0, 0], of_power), &
        unit_entry("V", one, [1, 2, -3, -1, 0], electric), &
        unit_entry("ohm", one, [1, 2, -3, -2, 0], of_ohm), &
        unit_entry("H", one, [1, 2, -2, -2, 0], small), &
        unit_entry("Ohm", one, [1, 2, -3, -2, 0], of_ohm), &
        unit_entry("Hz", two_pi, [0, 0, -1, 0, 1], of_ohm), &
        unit_entry("deg", pi/180, [0, 0, 0, 0, 1], ""), &
        unit_entry("rev", two_pi, [0, 0, 0, 0, 1], ""), &
        unit_entry("rpm", two_pi/60, [0, 0, -1, 0, 1], ""), &
        unit_entry("min", 60*one, [0, 0, 1, 0, 0], ""), &
        unit_entry("h", 3600*one, [0, 0, 1, 0, 0], ""), &
        unit_entry("in", inch, [0, 1, 0, 0, 0], ""), &
        unit_entry("ft", 12*inch, [0, 1, 0, 0, 0], ""), &
        unit_entry("lb", pound, [1, 0, 0, 0, 0], ""), &
        unit_entry("psi", pound*standard_gravity/inch**2, [1, -1, -2, 0, 0], ""), &
        unit_entry("lbf", pound*standard_gravity, [1, 1, -2, 0, 0], ""), &
        unit_entry("kgf", standard_gravity, [1, 1, -2, 0, 0], ""), &
        unit_entry("%", 0.01_wp, [0, 0, 0, 0, 0], ""), &
        unit_entry("1", one, [0, 0, 0, 0, 0], "")]

    character(len=2), parameter :: prefixes(*) = [character(len=2) :: "n", "u", "m", "c", "d", "da", "h", "k", "M", "G"]
    integer, parameter :: prefix_power(*) = [-9, -6, -3, -2, -1, 1, 2, 3, 6, 9]

    character(len=*), parameter :: letters = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ%", digits = "0123456789"

    !> A unit on its way: text still to read, and what has been read.
    type :: unit_reading
        integer :: next = 1                        !! position in the text
        real(wp) :: factor = 1
        integer :: power(n_dimension) = 0
        logical :: is_good = .true.
        character(len=32) :: culprit = ""          !! the name that is no unit
        logical :: in_formula = .false.            !! a minus behind a unit may take something off
    end type unit_reading

contains

    !> The same quantity per second: "a length" becomes "a speed".
    pure type(quantity_type) function per_second(quantity) result(rate)
        type(quantity_type), intent(in) :: quantity

        if (all(quantity%power == length%power)) then
            rate = speed
        else if (all(quantity%power == angle%power)) then
            rate = angular_rate
        else
            rate = quantity
            rate%name = trim(quantity%name)//" per second"
            rate%example = trim(quantity%example)//"/s"
            rate%unit = trim(quantity%unit)//"/s"
            rate%power(3) = rate%power(3) - 1
        end if
    end function per_second

    !> The quotient of two quantities, under a name of its own.
    pure type(quantity_type) function over(upper, lower, name, example) result(quotient)
        type(quantity_type), intent(in) :: upper, lower
        character(len=*), intent(in) :: name, example

        quotient%name = name
        quotient%example = example
        quotient%power = upper%power - lower%power
        quotient%angle_is_optional = .true.
    end function over

    !> True for units of turns, or turns in a time, whose numbers are not in radians.
    pure logical function counts_turns(words, power)
        character(len=*), intent(in) :: words               !! of the units
        integer, intent(in) :: power(n_dimension)           !! and their dimension

        counts_turns = power(n_dimension) > 0 .and. index(words, "Hz") + index(words, "rpm") + index(words, "rev") > 0
    end function counts_turns

    !> True for a unit of whatever quantity; a plain number has none.
    pure logical function is_unit(text)
        character(len=*), intent(in) :: text
        type(unit_reading) :: reading

        call read_product(ascii_unit(text), reading, 0)
        is_unit = reading%is_good .and. any(reading%power /= 0)
    end function is_unit

    !> Factor from a unit to SI. `problem` is empty if the unit is one of this quantity.
    pure subroutine unit_factor(text, quantity, factor, problem)
        character(len=*), intent(in) :: text           !! "mm", "N*m/rad"; empty: SI
        type(quantity_type), intent(in) :: quantity    !! what is expected
        real(wp), intent(out) :: factor
        character(len=:), allocatable, intent(out) :: problem
        type(unit_reading) :: reading

        problem = ""
        factor = 1
        if (len_trim(text) == 0) return
        call read_product(ascii_unit(text), reading, 0)
        if (.not. reading%is_good) then
            problem = unknown_unit(reading%culprit)
        else if (.not. is_same_dimension(reading%power, quantity)) then
            problem = quoted(adjustl(text))//" is the unit of "//dimension_text(reading%power)
        else if (may_be_turns(names_minutes(text), reading%power, quantity)) then
            problem = turns_or_radians(text)
        end if
        factor = reading%factor
    end subroutine unit_factor

    !> Why a value is not what is expected; empty if it is.
    pure function misfit(text, has_unit, power, in_minutes, quantity) result(problem)
        character(len=*), intent(in) :: text           !! as it is written
        logical, intent(in) :: has_unit
        integer, intent(in) :: power(n_dimension)
        logical, intent(in) :: in_minutes              !! a minute was among the units, of a variable perhaps
        type(quantity_type), intent(in) :: quantity    !! what is expected
        character(len=:), allocatable :: problem

        problem = ""
        if (.not. has_unit) then
            if (any(quantity%power /= 0)) problem = quoted(trim(adjustl(text)))//" has no unit"
        else if (.not. is_same_dimension(power, quantity)) then
            problem = quoted(trim(adjustl(text)))//" is "//dimension_text(power)
        else if (may_be_turns(in_minutes, power, quantity)) then
            problem = turns_or_radians(text)
        end if
    end function misfit

    pure function turns_or_radians(text) result(problem)
        character(len=*), intent(in) :: text
        character(len=:), allocatable :: problem

        problem = quoted(trim(adjustl(text)))//" may be turns or radians a minute: write rpm or rad/min"
    end function turns_or_radians

    !> An angular rate "1/min", which data sheets mean as turns, though the radian may be left out elsewhere.
    pure logical function may_be_turns(in_minutes, power, quantity)
        logical, intent(in) :: in_minutes
        integer, intent(in) :: power(n_dimension)
        type(quantity_type), intent(in) :: quantity

        may_be_turns = in_minutes .and. all(quantity%power == angular_rate%power) .and. power(5) == 0
    end function may_be_turns

    !> Is a minute among units?
    pure logical function names_minutes(words)
        character(len=*), intent(in) :: words          !! no names of variables

        names_minutes = index(words, "min") > 0
    end function names_minutes

    !> A number and its unit, if it has one.
    pure subroutine read_value(text, value, has_unit, power, problem)
        character(len=*), intent(in) :: text
        real(wp), intent(out) :: value                 !! SI
        logical, intent(out) :: has_unit
        integer, intent(out) :: power(n_dimension)
        character(len=:), allocatable, intent(out) :: problem
        real(wp) :: number
        type(unit_reading) :: reading
        character(len=:), allocatable :: trimmed, plain
        integer :: n_used

        value = 0
        has_unit = .false.
        power = 0
        trimmed = trim(adjustl(text))
        plain = trim(adjustl(ascii_unit(text)))
        call parse_number(plain, number, n_used)
        problem = ""
        if (n_used == 0) then
            problem = quoted(trimmed)//" does not start with a number"
            return
        end if
        if (.not. abs(number) <= huge(number)) then
            problem = quoted(trimmed)//" is not a finite number"
            return
        end if
        has_unit = n_used < len(plain)
        if (has_unit) then
            call read_product(plain(n_used + 1:), reading, 0)
            if (.not. reading%is_good) problem = quoted(trimmed)//": "//unknown_unit(reading%culprit)
        end if
        power = reading%power
        value = number*reading%factor
    end subroutine read_value

    !> What is wrong with a name that is no unit, and which one may be meant.
    pure function unknown_unit(name) result(problem)
        character(len=*), intent(in) :: name
        character(len=:), allocatable :: problem

        problem = quoted(name)//" is not a unit that linkdyn knows"
        if (two_units(name) /= "") then
            problem = problem//"; two units stand apart: "//quoted(two_units(name))
        else
            problem = problem//suggestion(name, [character(len=7) :: units%name, &
                      "k"//pack(units%name, index(units%prefixes, "k") > 0), &
                      "m"//pack(units%name, index(units%prefixes, "m") > 0), &
                      "M"//pack(units%name, index(units%prefixes, "M") > 0)])
        end if
    end function unknown_unit

    !> "kg cm" of "kgcm", as data sheets write it; empty if the name is no unit with a length behind it.
    pure function two_units(name) result(apart)
        character(len=*), intent(in) :: name
        character(len=:), allocatable :: apart
        type(unit_reading) :: first, second
        integer :: n

        apart = ""
        do n = 1, len_trim(name) - 1
            first = unit_reading()
            second = unit_reading()
            call look_up(name(:n), first)
            call look_up(trim(name(n + 1:)), second)
            if (.not. (first%is_good .and. second%is_good)) cycle
            if (any(second%power /= length%power)) cycle
            apart = name(:n)//" "//trim(name(n + 1:))
            return
        end do
    end function two_units

    pure logical function is_same_dimension(power, quantity)
        integer, intent(in) :: power(n_dimension)
        type(quantity_type), intent(in) :: quantity

        is_same_dimension = all(power(:4) == quantity%power(:4))
        if (power(5) == quantity%power(5)) return
        is_same_dimension = is_same_dimension .and. quantity%angle_is_optional .and. power(5) == 0
    end function is_same_dimension

    !> The name of a dimension: "a mass", or its SI unit if it has no name here.
    pure function dimension_text(power) result(text)
        integer, intent(in) :: power(n_dimension)
        character(len=:), allocatable :: text
        character(len=8) :: exponent
        integer :: i

        text = ""
        do i = 1, size(named)
            if (all(power == named(i)%power)) text = trim(named(i)%name)
        end do
        if (all(power == [1, 2, -2, 0, 0])) text = "a moment or an energy"
        if (all(power == [0, 2, 0, 0, 0])) text = "an area"
        if (len(text) > 0) return
        text = "something in"
        do i = 1, n_dimension
            if (power(i) == 0) cycle
            text = text//" "//trim(base_unit(i))
            write (exponent, "(i0)") power(i)
            if (power(i) /= 1) text = text//"^"//trim(exponent)
        end do
    end function dimension_text

    !> The SI unit by which people call numbers of a dimension: "N", "kg m2"; blank: there is none here.
    pure function usual_unit(power) result(unit)
        integer, intent(in) :: power(n_dimension)
        character(len=8) :: unit
        type(quantity_type), parameter :: known(*) = [plain_number, length, angle, mass, inertia, time_span, force, moment, &
            speed, angular_rate, acceleration, stiffness, angular_stiffness, damping, wattage, fluid_pressure, area, volume]
        integer :: i

        unit = ""
        do i = 1, size(known)
            if (all(power == known(i)%power)) unit = known(i)%unit
        end do
    end function usual_unit

    !> The SI unit of a dimension, as a text has it behind its number: "kg m^2 s^-2"; empty for a plain number.
    pure function si_unit_text(power) result(text)
        integer, intent(in) :: power(n_dimension)
        character(len=:), allocatable :: text
        integer, parameter :: largest = 9              !! exponents have one digit
        integer :: i, left, part

        text = ""
        do i = 1, n_dimension
            left = power(i)
            do while (left /= 0)
                part = sign(min(abs(left), largest), left)
                text = text//" "//trim(base_unit(i))
                if (part /= 1) text = text//"^"//to_text(part)
                left = left - part
            end do
        end do
        text = trim(adjustl(text))
    end function si_unit_text

    !> The unit name, or units in brackets, at a place of a text, with its exponent.
    pure subroutine read_unit(text, next, factor, power, is_one)
        character(len=*), intent(in) :: text           !! as `ascii_unit` gives it
        integer, intent(inout) :: next                 !! where it starts; behind it, if it is one
        real(wp), intent(out) :: factor
        integer, intent(out) :: power(n_dimension)
        logical, intent(out) :: is_one
        type(unit_reading) :: reading

        reading%next = next
        reading%in_formula = .true.
        call read_factor(text, reading, 0)
        factor = reading%factor
        power = reading%power
        is_one = reading%is_good
        if (is_one) next = reading%next
    end subroutine read_unit

    !> Factors and divisors up to the end of the text or a closing bracket.
    pure recursive subroutine read_product(text, reading, depth)
        character(len=*), intent(in) :: text
        type(unit_reading), intent(inout) :: reading
        integer, intent(in) :: depth                   !! open brackets
        type(unit_reading) :: part
        integer :: sign_of_power
        logical :: is_first

        is_first = .true.
        do
            call skip_blanks(text, reading%next)
            if (reading%next > len(text) .or. .not. reading%is_good) exit
            if (text(reading%next:reading%next) == ")") exit
            sign_of_power = 1
            if (scan(text(reading%next:reading%next), "*/") == 1) then
                if (is_first .and. depth > 0) reading%is_good = .false.
                if (text(reading%next:reading%next) == "/") sign_of_power = -1
                reading%next = reading%next + 1
                call skip_blanks(text, reading%next)
            end if
            part = unit_reading(next=reading%next)
            call read_factor(text, part, depth)
            reading%next = part%next
            reading%factor = reading%factor*part%factor**sign_of_power
            reading%power = reading%power + sign_of_power*part%power
            reading%is_good = reading%is_good .and. part%is_good
            reading%culprit = part%culprit
            is_first = .false.
        end do
        if (depth == 0 .and. reading%next <= len(text)) reading%is_good = .false.
        if (is_first) reading%is_good = .false.
        if (.not. reading%is_good .and. reading%culprit == "") reading%culprit = adjustl(text)
    end subroutine read_product

    !> A unit name or a bracket, with its exponent.
    pure recursive subroutine read_factor(text, reading, depth)
        character(len=*), intent(in) :: text
        type(unit_reading), intent(inout) :: reading
        integer, intent(in) :: depth
        integer :: first, exponent

        first = reading%next
        if (first > len(text) .or. depth > 8) then
            reading%is_good = .false.
            return
        end if
        if (text(first:first) == "(") then
            reading%next = first + 1
            call read_product(text, reading, depth + 1)
            if (reading%next > len(text)) reading%is_good = .false.
            reading%next = reading%next + 1
        else
            do while (reading%next <= len(text))
                if (index(letters, text(reading%next:reading%next)) == 0) exit
                reading%next = reading%next + 1
            end do
            if (reading%next == first) then
                ! No name; a 1 may stand where there is nothing but a divisor: 1/s.
                reading%next = first + 1
                reading%is_good = text(first:first) == "1" .and. index(adjustl(text(first + 1:)), "/") == 1
                reading%culprit = text(first:)
                if (.not. reading%is_good) return
            end if
            call look_up(text(first:reading%next - 1), reading)
        end if
        if (.not. reading%is_good) return
        if (reading%in_formula) then
            if (is_minus(text, reading%next)) return
        end if
        call read_exponent(text, reading%next, exponent, reading%is_good)
        if (.not. reading%is_good) reading%culprit = text(first:)
        reading%factor = reading%factor**exponent
        reading%power = reading%power*exponent
    end subroutine read_factor

    !> Does a minus at a place of a formula take off what follows, "1 m-2 m"? It is an exponent's if a digit alone follows: "9.81 m
    !> s-2".
    pure logical function is_minus(text, place)
        character(len=*), intent(in) :: text
        integer, intent(in) :: place
        integer :: behind

        is_minus = .false.
        if (place > len(text)) return
        if (text(place:place) /= "-") return
        is_minus = .true.
        if (place == len(text)) return
        if (index("123456789", text(place + 1:place + 1)) == 0) return
        behind = place + 2
        call skip_blanks(text, behind)
        is_minus = .false.
        if (behind > len(text)) return
        is_minus = index(letters//"(", text(behind:behind)) > 0
        if (behind == place + 2) is_minus = is_minus .or. index(digits//".", text(behind:behind)) > 0
    end function is_minus

    !> "^2", "^-1", "2", or nothing (1).
    pure subroutine read_exponent(text, next, exponent, is_good)
        character(len=*), intent(in) :: text
        integer, intent(inout) :: next
        integer, intent(out) :: exponent
        logical, intent(out) :: is_good
        logical :: is_negative, is_marked

        exponent = 1
        is_good = .true.
        is_marked = .false.
        is_negative = .false.
        if (next <= len(text)) is_marked = text(next:next) == "^"
        if (is_marked) next = next + 1
        if (next <= len(text)) is_negative = text(next:next) == "-"
        if (is_negative) next = next + 1
        if (next <= len(text)) then
            if (index("123456789", text(next:next)) > 0) then
                exponent = iachar(text(next:next)) - iachar("0")
                next = next + 1
                if (is_negative) exponent = -exponent
                return
            end if
        end if
        is_good = .not. (is_marked .or. is_negative)
    end subroutine read_exponent

    !> A unit by its name, or by a prefix and its name.
    pure subroutine look_up(name, reading)
        character(len=*), intent(in) :: name
        type(unit_reading), intent(inout) :: reading
        integer :: i, j, n

        do i = 1, size(units)
            if (name /= units(i)%name) cycle
            reading%factor = units(i)%factor
            reading%power = units(i)%power
            return
        end do
        do j = 1, size(prefixes)
            n = len_trim(prefixes(j))
            if (n >= len(name)) cycle
            if (name(:n) /= prefixes(j)) cycle
            do i = 1, size(units)
                if (name(n + 1:) /= units(i)%name .or. .not. takes_prefix(units(i), prefixes(j))) cycle
                ! A whole power of ten divides exactly where its negative power would round.
                if (prefix_power(j) > 0) reading%factor = units(i)%factor*10.0_wp**prefix_power(j)
                if (prefix_power(j) < 0) reading%factor = units(i)%factor/10.0_wp**(-prefix_power(j))
                if (name == "kg") reading%factor = 1
                reading%power = units(i)%power
                return
            end do
        end do
        reading%is_good = .false.
        reading%culprit = name
    end subroutine look_up

    pure logical function takes_prefix(unit, prefix)
        type(unit_entry), intent(in) :: unit
        character(len=*), intent(in) :: prefix

        takes_prefix = index(" "//unit%prefixes//" ", " "//trim(prefix)//" ") > 0
    end function takes_prefix

    pure subroutine skip_blanks(text, next)
        character(len=*), intent(in) :: text
        integer, intent(inout) :: next

        do while (next <= len(text))
            if (text(next:next) /= " ") exit
            next = next + 1
        end do
    end subroutine skip_blanks

    !> The same unit with the typographer's signs spelt in ASCII.
    pure function ascii_unit(text) result(plain)
        character(len=*), intent(in) :: text
        character(len=:), allocatable :: plain
        character(len=*), parameter :: c2 = char(194), ce = char(206), e2 = char(226)

        plain = replaced(trim(text), "**", "^")
        plain = replaced(plain, c2//char(183), "*")              ! middle dot
        plain = replaced(plain, e2//char(139)//char(133), "*")  ! dot operator
        plain = replaced(plain, c2//char(178), "^2")
        plain = replaced(plain, c2//char(179), "^3")
        plain = replaced(plain, c2//char(176), "deg")
        plain = replaced(plain, c2//char(181), "u")              ! micro sign
        plain = replaced(plain, ce//char(188), "u")              ! Greek mu
        plain = replaced(plain, ce//char(169), "ohm")
        plain = replaced(plain, e2//char(136)//char(146), "-")  ! minus sign
        plain = replaced(plain, c2//char(160), " ")              ! blanks that do not break, and narrow ones, of data sheets
        plain = replaced(plain, e2//char(128)//char(175), " ")
        plain = replaced(plain, e2//char(128)//char(137), " ")
        plain = replaced(plain, achar(9), " ")
    end function ascii_unit

    pure function replaced(text, old, new) result(changed)
        character(len=*), intent(in) :: text, old, new
        character(len=:), allocatable :: changed
        integer :: i

        changed = text
        do
            i = index(changed, old)
            if (i == 0) exit
            changed = changed(:i - 1)//new//changed(i + len(old):)
        end do
    end function replaced
end module linkdyn_units
