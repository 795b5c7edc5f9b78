!> Arithmetic in the numbers of a scene file: "L/2 + 12 mm", "2*rho*A", "-L*cos(alpha)".
!>
!>     sum     = product { ("+" | "-") product }
!>     product = signed { ("*" | "/") signed }
!>     signed  = [ "+" | "-" ] signed | power
!>     power   = primary [ "^" signed ]
!>     primary = number [ unit ] | name | function "(" sum { "," sum } ")" | "(" sum ")"
!>
!> A number and its unit are one: "1/2 mm" is one divided by two millimetres. Behind a unit, names of units go on the unit, also
!> after "*" and "/"; behind a plain number and "*", a variable goes before a unit: "0.5*m*v^2". Each value carries its
!> dimension; a sum wants equal ones. Where names stand for what the mechanism does (symbols), what is found is no number but a
!> formula, with a dimension all the same. What has met no unit counts like a number in the file: it is in SI, whatever is wanted.
module linkdyn_expression
    use linkdyn_kinds, only: wp
    use linkdyn_constants, only: pi
    use linkdyn_formula, only: formula_type, formula_node, add_node, node_number, node_symbol, node_add, node_subtract, &
        node_multiply, node_divide, node_negate, node_power, node_whole_power, node_sqrt, node_sin, node_cos, node_tan, &
        node_asin, node_acos, node_atan2, node_abs, node_min, node_max, node_sign, node_step, node_exp, node_log, node_tanh, node_if
    use linkdyn_input, only: parse_number
    use linkdyn_suggest, only: suggestion
    use linkdyn_text, only: lower_case, quoted, to_text
    use linkdyn_units, only: n_dimension, counts_turns, names_minutes, read_unit, dimension_text, ascii_unit, &
        is_unit, unknown_unit, two_units
    implicit none (type, external)
    private
    public :: measured_value, name_source, evaluate_expression, is_reserved, is_unit_name, name_letters

    !> Brackets, signs, exponents and names inside each other: few enough for the smallest stack of a thread.
    integer, parameter :: deepest = 100
    integer, parameter :: longest = 1000                !! letters of a text
    integer, parameter :: largest_power = 99            !! of a dimension
    character(len=*), parameter :: letters = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ"
    character(len=*), parameter :: figures = "0123456789"
    character(len=*), parameter :: name_letters = letters//figures//"_"
    character(len=5), parameter :: function_name(*) = [character(len=5) :: "sqrt", "sin", "cos", "tan", "asin", "acos", "atan2", &
        "abs", "min", "max"]
    !> Functions that came later: variables may be called so, and a bracket tells the function.
    character(len=4), parameter :: late_function_name(*) = [character(len=4) :: "sign", "step", "exp", "log", "tanh", "if"]
    integer, parameter :: is_angle(n_dimension) = [0, 0, 0, 0, 1]

    !> A number with its dimension.
    type :: measured_value
        real(wp) :: value = 0                           !! SI
        integer :: power(n_dimension) = 0               !! of kg m s A rad
        logical :: has_unit = .false.                   !! a unit was met on the way
        logical :: has_pi = .false.                     !! a plain number of which pi is a factor
        logical :: counts_turns = .false.               !! a factor is given in Hz, rpm or rev
        logical :: in_minutes = .false.                 !! a minute was among the units
        integer :: symbol = 0                           !! no number, but this symbol of formulas
        integer :: node = 0                             !! no number, but this node of the formula
    end type measured_value

    !> Names that stand for values.
    type, abstract :: name_source
    contains
        procedure(has_name), deferred :: has
        procedure(find_value), deferred :: find
        procedure(list_names), deferred :: list
    end type name_source

    abstract interface
        logical function has_name(self, name)
            import :: name_source
            class(name_source), intent(in) :: self
            character(len=*), intent(in) :: name
        end function has_name

        recursive subroutine find_value(self, name, depth, found, problem)
            import :: name_source, measured_value
            class(name_source), intent(inout) :: self
            character(len=*), intent(in) :: name        !! one that it has
            integer, intent(in) :: depth                !! how deep inside others it stands
            type(measured_value), intent(out) :: found
            character(len=:), allocatable, intent(inout) :: problem
        end subroutine find_value

        subroutine list_names(self, names)
            import :: name_source
            class(name_source), intent(in) :: self
            character(len=64), allocatable, intent(out) :: names(:)
        end subroutine list_names
    end interface

    !> A text being read.
    type :: reader_type
        character(len=:), allocatable :: text
        integer :: next = 1
        character(len=:), allocatable :: problem        !! empty while all is well
        type(formula_type) :: formula                   !! what hangs on symbols
    end type reader_type

contains

    !> The value of a text. `problem` is empty if all is well.
    recursive subroutine evaluate_expression(text, names, depth, found, problem, formula)
        character(len=*), intent(in) :: text
        class(name_source), intent(inout) :: names
        integer, intent(in) :: depth                    !! how deep inside others it stands: 0 for a text of the file
        type(measured_value), intent(out) :: found
        character(len=:), allocatable, intent(out) :: problem
        type(formula_type), intent(out), optional :: formula    !! if symbols are met; its last node is the value
        type(reader_type) :: reader

        if (len(text) > longest) then
            problem = quoted(text(:24)//"...")//" is longer than "//to_text(longest)//" letters"
            return
        end if
        reader%text = ascii_unit(adjustl(text))
        reader%problem = ""
        call read_sum(reader, names, depth, found)
        if (reader%problem == "" .and. next_letter(reader) /= "") call refuse_rest(reader)
        problem = reader%problem
        if (present(formula)) formula = reader%formula
    end subroutine evaluate_expression

    !> Names that mean something already.
    pure logical function is_reserved(name)
        character(len=*), intent(in) :: name

        is_reserved = name == "pi" .or. any(function_name == name)
    end function is_reserved

    !> True for the name of a unit, with or without prefix.
    pure logical function is_unit_name(name)
        character(len=*), intent(in) :: name

        is_unit_name = verify(name, letters) == 0 .and. is_unit(name)
    end function is_unit_name

    ! ---------------------------------------------------------------- grammar

    !> Products that are added or taken off, all of one dimension.
    recursive subroutine read_sum(reader, names, depth, found)
        type(reader_type), intent(inout) :: reader
        class(name_source), intent(inout) :: names
        integer, intent(in) :: depth
        type(measured_value), intent(out) :: found
        type(measured_value) :: other
        character(len=1) :: operator

        call read_product(reader, names, depth, found)
        do while (reader%problem == "")
            operator = next_letter(reader)
            if (scan(operator, "+-") == 0) return
            reader%next = reader%next + 1
            call read_product(reader, names, depth, other)
            if (reader%problem /= "") return
            if (any(found%power /= other%power)) then
                call fail(reader, trim(merge("adds ", "takes", operator == "+"))//" "//dimension_text(other%power)//" "// &
                    trim(merge("to  ", "from", operator == "+"))//" "//dimension_text(found%power)//angle_hint(found, other))
                return
            end if
            if (found%node > 0 .or. other%node > 0) then
                call join(reader, merge(node_add, node_subtract, operator == "+"), found, other)
            else
                found%value = found%value + merge(other%value, -other%value, operator == "+")
            end if
            found%has_unit = found%has_unit .or. other%has_unit
            found%in_minutes = found%in_minutes .or. other%in_minutes
            found%has_pi = .false.
            found%counts_turns = .false.
            call require_finite(reader, found)
        end do

    contains

        !> What to write for a plain number beside an angle.
        pure function angle_hint(x, y) result(hint)
            type(measured_value), intent(in) :: x, y
            character(len=:), allocatable :: hint

            hint = ""
            if (all(x%power + y%power == is_angle) .and. (all(x%power == 0) .or. all(y%power == 0))) &
                hint = " (expected rad or deg behind the number)"
        end function angle_hint
    end subroutine read_sum

    !> Factors with their signs, whose dimensions multiply.
    recursive subroutine read_product(reader, names, depth, found)
        type(reader_type), intent(inout) :: reader
        class(name_source), intent(inout) :: names
        integer, intent(in) :: depth
        type(measured_value), intent(out) :: found
        type(measured_value) :: other
        character(len=1) :: operator

        call read_signed(reader, names, depth, found)
        do while (reader%problem == "")
            operator = next_letter(reader)
            if (scan(operator, "*/") == 0) return
            reader%next = reader%next + 1
            call read_signed(reader, names, depth, other)
            if (operator == "*") call refuse_turns_twice(reader, found, other)
            if (reader%problem /= "") return
            if (found%node > 0 .or. other%node > 0) then
                if (operator == "/" .and. other%node == 0 .and. .not. abs(other%value) > 0) then
                    call fail(reader, "divides by zero")
                    return
                end if
                call join(reader, merge(node_multiply, node_divide, operator == "*"), found, other)
                found%power = found%power + merge(other%power, -other%power, operator == "*")
            else if (operator == "*") then
                found%value = found%value*other%value
                found%power = found%power + other%power
            else if (abs(other%value) > 0) then
                found%value = found%value/other%value
                found%power = found%power - other%power
            else
                call fail(reader, "divides by zero")
                return
            end if
            found%has_unit = found%has_unit .or. other%has_unit
            found%in_minutes = found%in_minutes .or. other%in_minutes
            found%has_pi = (found%has_pi .or. other%has_pi) .and. all(found%power == 0)
            found%counts_turns = found%counts_turns .or. (operator == "*" .and. other%counts_turns)
            call require_finite(reader, found)
        end do
    end subroutine read_product

    !> "2*pi*3 Hz": radians come of the unit already, and once more of pi.
    subroutine refuse_turns_twice(reader, x, y)
        type(reader_type), intent(inout) :: reader
        type(measured_value), intent(in) :: x, y

        if ((x%has_pi .and. y%counts_turns) .or. (x%counts_turns .and. y%has_pi)) call fail(reader, &
            "multiplies with pi what is given in turns: 1 Hz is 2*pi rad/s already, as rpm and rev are (expected no pi, or rad)")
    end subroutine refuse_turns_twice

    recursive subroutine read_signed(reader, names, depth, found)
        type(reader_type), intent(inout) :: reader
        class(name_source), intent(inout) :: names
        integer, intent(in) :: depth
        type(measured_value), intent(out) :: found
        character(len=1) :: letter

        if (depth >= deepest) then
            call fail(reader, "is nested too deep (more than "//to_text(deepest)// &
                      " brackets, signs or variables inside each other)")
            return
        end if
        letter = next_letter(reader)
        if (scan(letter, "+-") == 0) then
            call read_power(reader, names, depth, found)
            return
        end if
        reader%next = reader%next + 1
        call read_signed(reader, names, depth + 1, found)
        if (letter /= "-" .or. reader%problem /= "") return
        if (found%node > 0) then
            call add_node(reader%formula, formula_node(node_negate, a=found%node))
            found%node = reader%formula%n
        else
            found%value = -found%value
        end if
    end subroutine read_signed

    recursive subroutine read_power(reader, names, depth, found)
        type(reader_type), intent(inout) :: reader
        class(name_source), intent(inout) :: names
        integer, intent(in) :: depth
        type(measured_value), intent(out) :: found
        type(measured_value) :: exponent

        call read_primary(reader, names, depth, found)
        if (reader%problem /= "" .or. next_letter(reader) /= "^") return
        reader%next = reader%next + 1
        call read_signed(reader, names, depth + 1, exponent)
        if (reader%problem == "") call raise(reader, found, exponent)
    end subroutine read_power

    recursive subroutine read_primary(reader, names, depth, found)
        type(reader_type), intent(inout) :: reader
        class(name_source), intent(inout) :: names
        integer, intent(in) :: depth
        type(measured_value), intent(out) :: found
        character(len=1) :: letter

        letter = next_letter(reader)
        if (letter == "") then
            call fail(reader, "ends where a number or a name is expected")
        else if (letter == "(") then
            reader%next = reader%next + 1
            call read_sum(reader, names, depth + 1, found)
            call require_letter(reader, ")")
        else if (scan(letter, figures//".") > 0) then
            call read_quantity(reader, names, found)
        else if (scan(letter, letters//"_") > 0) then
            call read_named(reader, names, depth, found)
        else
            call fail(reader, "has "//quoted(rest_of(reader))//" where a number or a name is expected")
        end if
    end subroutine read_primary

    !> A function of something, pi, or a variable.
    recursive subroutine read_named(reader, names, depth, found)
        type(reader_type), intent(inout) :: reader
        class(name_source), intent(inout) :: names
        integer, intent(in) :: depth
        type(measured_value), intent(out) :: found
        type(measured_value) :: argument(3)
        character(len=:), allocatable :: name, problem
        character(len=64), allocatable :: known(:)
        integer :: i, n

        name = name_at(reader%text, reader%next)
        reader%next = reader%next + len(name)
        if (name == "pi") then
            found%value = pi
            found%has_pi = .true.
        else if (is_function(reader, name)) then
            n = merge(2, 1, any([character(len=5) :: "atan2", "min", "max"] == name))
            if (name == "if") n = 3
            call require_letter(reader, "(")
            do i = 1, n
                if (i > 1) call require_letter(reader, ",")
                if (reader%problem /= "") return
                call read_sum(reader, names, depth + 1, argument(i))
            end do
            call require_letter(reader, ")")
            if (reader%problem /= "") return
            if (name == "if") then
                call choose_between(reader, argument, found)
            else
                call apply(reader, name, argument(1), argument(n), found)
            end if
        else if (names%has(name)) then
            problem = ""
            call names%find(name, depth + 1, found, problem)
            if (problem /= "") reader%problem = problem
            if (found%symbol /= 0) then
                call add_node(reader%formula, formula_node(node_symbol, a=found%symbol))
                found%node = reader%formula%n
                found%symbol = 0
            end if
        else if (any([character(len=8) :: "nan", "inf", "infinity"] == lower_case(name))) then
            call fail(reader, "is not a finite number")
        else
            call names%list(known)
            problem = suggestion(name, known)
            if (problem == "") problem = suggestion(name, function_name)
            if (index(reader%text, name) == 1) then
                call fail(reader, "does not start with a number, and "//quoted(name)//" is no variable"//problem)
            else
                call fail(reader, "has the unknown name "//quoted(name)//problem)
            end if
        end if
    end subroutine read_named

    !> A number and the unit behind it, if there is one.
    subroutine read_quantity(reader, names, found)
        type(reader_type), intent(inout) :: reader
        class(name_source), intent(in) :: names
        type(measured_value), intent(out) :: found
        real(wp) :: unit, factor
        integer :: power(n_dimension), used, before, sign_of_power, first
        logical :: is_one
        character(len=1) :: operator, letter

        call parse_number(reader%text(reader%next:), found%value, used)
        if (used == 0) then
            call fail(reader, "has "//quoted(rest_of(reader))//" where a number is expected")
            return
        end if
        reader%next = reader%next + used
        first = reader%next
        unit = 1
        do
            before = reader%next
            operator = next_letter(reader)
            if (scan(operator, "*/") == 0) operator = ""
            if (operator /= "") reader%next = reader%next + 1
            letter = next_letter(reader)
            if (is_variable(reader, names, operator)) exit
            call check_power(reader, names, operator)
            if (.not. found%has_unit) call check_double_meaning(reader, names, operator)
            if (scan(letter, letters//"%(") == 0 .or. (letter == "(" .and. operator == "")) exit
            call read_unit(reader%text, reader%next, factor, power, is_one)
            if (.not. is_one) exit
            sign_of_power = merge(-1, 1, operator == "/")
            unit = unit*factor**sign_of_power
            found%power = found%power + sign_of_power*power
            found%has_unit = .true.
        end do
        reader%next = before
        found%value = found%value*unit
        found%counts_turns = counts_turns(reader%text(first:before - 1), found%power)
        found%in_minutes = names_minutes(reader%text(first:before - 1))
        call require_finite(reader, found)

    contains

        !> What stands here is no unit: a function, or a variable that multiplies a number without unit.
        logical function is_variable(reader, names, operator)
            type(reader_type), intent(in) :: reader
            class(name_source), intent(in) :: names
            character(len=1), intent(in) :: operator
            character(len=:), allocatable :: name
            integer :: behind

            name = name_at(reader%text, reader%next)
            is_variable = operator == "*" .and. .not. found%has_unit .and. names%has(name)
            ! "13 N*s/m*m0": no unit is called so
            if (operator /= "" .and. verify(name, letters) > 0) &
                is_variable = is_variable .or. (names%has(name) .and. .not. is_power_of_unit(name))
            behind = reader%next + len(name)
            behind = behind + max(0, verify(reader%text(behind:)//".", " ") - 1)
            if (behind <= len(reader%text)) &
                is_variable = is_variable .or. ((any(function_name == name) .or. any(late_function_name == name)) .and. &
                                                reader%text(behind:behind) == "(")
        end function is_variable
    end subroutine read_quantity

    !> "0.5 kg*m2" where m2 is a variable, too.
    subroutine check_power(reader, names, operator)
        type(reader_type), intent(inout) :: reader
        class(name_source), intent(in) :: names
        character(len=1), intent(in) :: operator        !! in front of the name
        character(len=:), allocatable :: name

        if (operator == "") return
        name = name_at(reader%text, reader%next)
        if (.not. is_power_of_unit(name)) return
        if (names%has(name)) call fail(reader, "may mean a power of the unit or the variable "//quoted(name)//" (expected '" &
                                       //name(:len(name) - 1)//"^"//name(len(name):) &
                                       //"' for the unit, the variable in front of the number)")
    end subroutine check_power

    !> "m2": a unit and its exponent, which nobody writes if it is 1.
    pure logical function is_power_of_unit(name)
        character(len=*), intent(in) :: name
        integer :: n

        n = len(name) - 1
        is_power_of_unit = .false.
        if (n < 1) return
        is_power_of_unit = scan(name(n + 1:), "23456789") > 0 .and. is_unit_name(name(:n))
    end function is_power_of_unit

    !> "2/s" where s is a variable, too: nobody knows which one is meant.
    subroutine check_double_meaning(reader, names, operator)
        type(reader_type), intent(inout) :: reader
        class(name_source), intent(in) :: names
        character(len=1), intent(in) :: operator        !! in front of the name
        character(len=:), allocatable :: name
        character(len=1) :: letter
        integer :: i

        letter = next_letter(reader)
        if (operator == "") return
        if (letter == "(") then
            do i = reader%next + 1, len(reader%text)
                if (reader%text(i:i) == ")") return
                if (scan(reader%text(i:i), letters) == 0) cycle
                if (scan(reader%text(i - 1:i - 1), letters) > 0) cycle
                name = name_at(reader%text, i)
                if (names%has(name) .and. is_unit_name(name) .and. .not. is_arithmetic(reader)) call refuse_both(name)
                if (reader%problem /= "") return
            end do
        else
            name = name_at(reader%text, reader%next)
            if (len(name) > 0) then
                if (names%has(name) .and. is_unit_name(name)) call refuse_both(name)
            end if
        end if

    contains

        subroutine refuse_both(name)
            character(len=*), intent(in) :: name

            call fail(reader, "may mean the unit or the variable "//quoted(name)// &
                " (expected '"//name//"^-1' for the unit, brackets round the number for the variable)")
        end subroutine refuse_both
    end subroutine check_double_meaning

    !> Brackets that hold more than units.
    logical function is_arithmetic(reader)
        type(reader_type), intent(in) :: reader
        real(wp) :: factor
        integer :: power(n_dimension), next

        next = reader%next
        call read_unit(reader%text, next, factor, power, is_arithmetic)
        is_arithmetic = .not. is_arithmetic
    end function is_arithmetic

    ! ---------------------------------------------------------------- operations

    !> Base to the power of the exponent, with the dimension that this has.
    subroutine raise(reader, base, exponent)
        type(reader_type), intent(inout) :: reader
        type(measured_value), intent(inout) :: base
        type(measured_value), intent(in) :: exponent
        real(wp) :: power(n_dimension)

        if (exponent%node > 0) then
            call raise_to_formula(reader, base, exponent)
            return
        end if
        power = base%power*exponent%value
        if (any(exponent%power /= 0)) then
            call fail(reader, "raises to "//dimension_text(exponent%power)//" (expected a plain number as exponent)")
        else if (any(abs(power) > largest_power) .or. any(abs(power - anint(power)) > largest_power*epsilon(1.0_wp))) then
            call fail(reader, "raises "//dimension_text(base%power)//" to "//to_text(exponent%value)// &
                ", which leaves a dimension with fractional or huge powers")
        else if (base%node > 0) then
            if (abs(exponent%value - anint(exponent%value)) > 0 .or. abs(exponent%value) > largest_power) then
                call join(reader, node_power, base, measured_value(exponent%value))
            else
                call add_node(reader%formula, formula_node(node_whole_power, a=base%node, b=nint(exponent%value)))
                base%node = reader%formula%n
            end if
            base%power = nint(power)
        else if (exponent%value < 0 .and. .not. abs(base%value) > 0) then
            call fail(reader, "divides by zero")
        else if (base%value < 0 .and. abs(exponent%value - anint(exponent%value)) > 0) then
            call fail(reader, "raises a negative number to "//to_text(exponent%value))
        else
            ! Small whole exponents multiply, so that L^2 is L*L.
            if (abs(exponent%value - anint(exponent%value)) > 0 .or. abs(exponent%value) > largest_power) then
                base%value = base%value**exponent%value
            else
                base%value = base%value**nint(exponent%value)
            end if
            base%power = nint(power)
            base%has_unit = base%has_unit .or. exponent%has_unit
            call require_finite(reader, base)
        end if
    end subroutine raise

    !> Only plain numbers go with an exponent that is not known yet.
    subroutine raise_to_formula(reader, base, exponent)
        type(reader_type), intent(inout) :: reader
        type(measured_value), intent(inout) :: base
        type(measured_value), intent(in) :: exponent

        if (any(exponent%power /= 0)) then
            call fail(reader, "raises to "//dimension_text(exponent%power)//" (expected a plain number as exponent)")
        else if (any(base%power /= 0)) then
            call fail(reader, "raises "//dimension_text(base%power)//" to what varies, which leaves no dimension "// &
                "(expected a plain number, or a fixed exponent)")
        else
            call join(reader, node_power, base, exponent)
        end if
    end subroutine raise_to_formula

    !> An operation of which one side at least is a formula.
    subroutine join(reader, op, x, y)
        type(reader_type), intent(inout) :: reader
        integer, intent(in) :: op
        type(measured_value), intent(inout) :: x        !! and what comes out; of its dimension the caller takes care
        type(measured_value), intent(in) :: y
        integer :: first, second

        first = node_of(reader, x)
        second = node_of(reader, y)
        call add_node(reader%formula, formula_node(op, a=first, b=second))
        x%node = reader%formula%n
    end subroutine join

    !> The node of a value; one is made for a number.
    integer function node_of(reader, x) result(node)
        type(reader_type), intent(inout) :: reader
        type(measured_value), intent(in) :: x

        node = x%node
        if (node > 0) return
        call add_node(reader%formula, formula_node(node_number, number=x%value))
        node = reader%formula%n
    end function node_of

    !> if(x, a, b): a where x is above zero, else b.
    subroutine choose_between(reader, argument, found)
        type(reader_type), intent(inout) :: reader
        type(measured_value), intent(in) :: argument(3)
        type(measured_value), intent(out) :: found
        integer :: node(3), i

        found = argument(2)
        if (any(argument(2)%power /= argument(3)%power)) then
            call fail(reader, "has if between "//dimension_text(argument(2)%power)//" and "// &
                dimension_text(argument(3)%power)//" (expected two of a kind"//unit_of_zero(argument(2:3))//")")
            return
        end if
        found%has_unit = argument(2)%has_unit .or. argument(3)%has_unit
        found%in_minutes = argument(2)%in_minutes .or. argument(3)%in_minutes
        if (argument(1)%node == 0) then
            if (.not. argument(1)%value > 0) found = argument(3)
        else
            do i = 1, 3
                node(i) = node_of(reader, argument(i))
            end do
            call add_node(reader%formula, formula_node(node_if, a=node(1), b=node(2), c=node(3)))
            found%node = reader%formula%n
        end if
    end subroutine choose_between

    !> Is a name that was just read that of a function?
    logical function is_function(reader, name)
        type(reader_type), intent(inout) :: reader
        character(len=*), intent(in) :: name

        is_function = any(function_name == name)
        if (any(late_function_name == name)) is_function = next_letter(reader) == "("
    end function is_function

    !> A function of a formula.
    subroutine apply_to_formula(reader, name, x, y, found)
        type(reader_type), intent(inout) :: reader
        character(len=*), intent(in) :: name
        type(measured_value), intent(in) :: x, y        !! arguments; the same if the function has one
        type(measured_value), intent(inout) :: found    !! with its dimension
        integer, parameter :: op(*) = [node_sqrt, node_sin, node_cos, node_tan, node_asin, node_acos, node_atan2, node_abs, &
            node_min, node_max, node_sign, node_step, node_exp, node_log, node_tanh]
        character(len=5), parameter :: of_op(*) = [character(len=5) :: "sqrt", "sin", "cos", "tan", "asin", "acos", "atan2", &
            "abs", "min", "max", "sign", "step", "exp", "log", "tanh"]
        integer :: first, second

        first = node_of(reader, x)
        second = first
        if (any([character(len=5) :: "atan2", "min", "max"] == name)) second = node_of(reader, y)
        call add_node(reader%formula, formula_node(op(findloc(of_op == name, .true., dim=1)), a=first, b=second))
        found%node = reader%formula%n
    end subroutine apply_to_formula

    !> A zero wants the unit of what it stands beside.
    function unit_of_zero(branch) result(text)
        type(measured_value), intent(in) :: branch(2)
        character(len=:), allocatable :: text

        text = ""
        if (any(is_plain(branch) .and. branch%node == 0 .and. branch%value == 0)) text = "; a zero has a unit, too: 0 N, 0 N m"
    end function unit_of_zero

    elemental logical function is_plain(x)
        type(measured_value), intent(in) :: x

        is_plain = all(x%power == 0)
    end function is_plain

    !> A function of one or two arguments, with the dimension that its value has.
    subroutine apply(reader, name, x, y, found)
        type(reader_type), intent(inout) :: reader
        character(len=*), intent(in) :: name
        type(measured_value), intent(in) :: x, y        !! arguments; the same if the function has one
        type(measured_value), intent(out) :: found

        logical :: is_formula

        is_formula = x%node > 0 .or. y%node > 0
        found = x
        found%has_unit = x%has_unit .or. y%has_unit
        found%in_minutes = x%in_minutes .or. y%in_minutes
        if (any(x%power /= y%power)) then
            call fail(reader, "has "//name//" of "//dimension_text(x%power)//" and "//dimension_text(y%power)// &
                      " (expected two of a kind)")
            return
        end if
        select case (name)
        case ("sqrt")
            if (any(modulo(x%power, 2) /= 0)) then
                call raise(reader, found, measured_value(0.5_wp))
            else if (.not. is_formula) then
                call raise(reader, found, measured_value(0.5_wp))
                if (reader%problem == "") found%value = sqrt(x%value)
            end if
            if (is_formula) found%power = x%power/2
        case ("sin", "cos", "tan")
            if (any(x%power /= 0) .and. any(x%power /= is_angle)) then
                call fail(reader, "has "//name//" of "//dimension_text(x%power)//" (expected an angle)")
                return
            end if
            found = measured_value()
            if (name == "sin") found%value = sin(x%value)
            if (name == "cos") found%value = cos(x%value)
            if (name == "tan") found%value = tan(x%value)
        case ("asin", "acos")
            if (any(x%power /= 0) .or. (abs(x%value) > 1 .and. .not. is_formula)) then
                call fail(reader, "has "//name//" of a value outside [-1, 1]")
                return
            end if
            found = measured_value(power=is_angle, has_unit=.true.)
            if (.not. is_formula) then
                if (name == "asin") found%value = asin(x%value)
                if (name == "acos") found%value = acos(x%value)
            end if
        case ("atan2")
            if (.not. (is_formula .or. abs(x%value) > 0 .or. abs(y%value) > 0)) then
                call fail(reader, "has atan2 of two zeros")
                return
            end if
            found = measured_value(atan2(x%value, y%value), is_angle, .true.)
        case ("abs")
            found%value = abs(x%value)
        case ("min")
            found%value = min(x%value, y%value)
        case ("max")
            found%value = max(x%value, y%value)
        case ("sign", "step")
            found = measured_value()
            found%value = merge(1.0_wp, 0.0_wp, x%value > 0)
            if (name == "sign" .and. x%value < 0) found%value = -1
        case ("exp", "log", "tanh")
            if (any(x%power /= 0)) then
                call fail(reader, "has "//name//" of "//dimension_text(x%power)//" (expected a plain number)")
                return
            else if (name == "log" .and. .not. (is_formula .or. x%value > 0)) then
                call fail(reader, "has log of a number that is not above zero")
                return
            end if
            found = measured_value()
            if (.not. is_formula) then
                if (name == "exp") found%value = exp(x%value)
                if (name == "log") found%value = log(x%value)
                if (name == "tanh") found%value = tanh(x%value)
            end if
        end select
        if (is_formula .and. reader%problem == "") then
            found%value = 0
            call apply_to_formula(reader, name, x, y, found)
        end if
        call require_finite(reader, found)
    end subroutine apply

    ! ---------------------------------------------------------------- words

    !> The next letter that is no blank, which it goes to; blank at the end.
    character(len=1) function next_letter(reader) result(letter)
        type(reader_type), intent(inout) :: reader

        letter = ""
        do while (reader%next <= len(reader%text))
            letter = reader%text(reader%next:reader%next)
            if (letter /= "") return
            reader%next = reader%next + 1
        end do
    end function next_letter

    !> Letters, digits and underlines from a place on.
    pure function name_at(text, first) result(name)
        character(len=*), intent(in) :: text
        integer, intent(in) :: first
        character(len=:), allocatable :: name
        integer :: n

        n = 0
        if (first <= len(text)) n = verify(text(first:)//" ", name_letters) - 1
        name = text(first:first + n - 1)
    end function name_at

    subroutine require_letter(reader, letter)
        type(reader_type), intent(inout) :: reader
        character(len=1), intent(in) :: letter

        if (reader%problem /= "") return
        if (next_letter(reader) == letter) then
            reader%next = reader%next + 1
        else if (next_letter(reader) == "") then
            call fail(reader, "ends without "//quoted(letter))
        else if (scan(next_letter(reader), "<>=") == 1) then
            call fail(reader, "has "//quoted(rest_of(reader))//", a comparison (if(x - y, a, b) is a where x is above y, else b)")
        else
            call fail(reader, "has "//quoted(rest_of(reader))//" where "//quoted(letter)//" is expected")
        end if
    end subroutine require_letter

    !> Something stands where the text ought to end.
    subroutine refuse_rest(reader)
        type(reader_type), intent(inout) :: reader
        character(len=:), allocatable :: name, unit

        name = name_at(reader%text, reader%next)
        unit = name(:verify(name//" ", letters) - 1)           ! "kgcm2" without its exponent
        if (is_unit_name(name) .and. stands_behind_name(reader)) then
            call fail(reader, "has the unit "//quoted(rest_of(reader))//" behind what is no number " &
                      //"(expected it behind one: 'k*2 N' in place of '2*k N')")
        else if (len(name) > 0 .and. (unit == name .or. two_units(unit) /= "")) then
            call fail(reader, unknown_unit(unit))
        else if (index(rest_of(reader), ",") == 1) then
            call fail(reader, "has a comma (decimals have a point)")
        else if (index(rest_of(reader), ":") == 1) then
            call fail(reader, "has a colon (ratios have '/')")
        else
            call fail(reader, "has "//quoted(rest_of(reader))//" where an operator is expected")
        end if
    end subroutine refuse_rest

    !> Is what was read last a name or a bracket, not a number?
    pure logical function stands_behind_name(reader)
        type(reader_type), intent(in) :: reader
        character(len=:), allocatable :: before
        integer :: first

        before = trim(reader%text(:reader%next - 1))
        first = verify(before, name_letters, back=.true.) + 1
        stands_behind_name = index(before, ")", back=.true.) == len(before)
        if (first <= len(before)) stands_behind_name = scan(before(first:first), figures) == 0
    end function stands_behind_name

    function rest_of(reader) result(rest)
        type(reader_type), intent(in) :: reader
        character(len=:), allocatable :: rest
        integer, parameter :: shown = 24

        rest = reader%text(reader%next:min(len(reader%text), reader%next + shown))
    end function rest_of

    subroutine require_finite(reader, found)
        type(reader_type), intent(inout) :: reader
        type(measured_value), intent(in) :: found

        if (reader%problem /= "") return
        if (.not. abs(found%value) <= huge(found%value)) then
            call fail(reader, "is not a finite number")
        else if (any(abs(found%power) > largest_power)) then
            call fail(reader, "has a dimension of more than "//to_text(largest_power)//" powers")
        end if
    end subroutine require_finite

    !> The first fault is the one that is told.
    subroutine fail(reader, problem)
        type(reader_type), intent(inout) :: reader
        character(len=*), intent(in) :: problem

        integer, parameter :: shown = 60
        character(len=:), allocatable :: text

        if (reader%problem /= "") return
        text = reader%text
        if (len(text) > shown) text = text(:shown)//"..."
        reader%problem = quoted(text)//" "//problem
        if (problem(:1) == "'") reader%problem = quoted(text)//": "//problem
    end subroutine fail
end module linkdyn_expression
