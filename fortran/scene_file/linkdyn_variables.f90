!> Named values of a scene, and numbers that may refer to them.
module linkdyn_variables
    use linkdyn_kinds, only: wp
    use linkdyn_expression, only: measured_value, name_source, evaluate_expression, is_unit_name, name_letters
    use linkdyn_formula, only: formula_type
    use linkdyn_scene, only: name_len
    use linkdyn_text, only: quoted
    use linkdyn_units, only: quantity_type, n_dimension, counts_turns, names_minutes, is_same_dimension, read_value, &
        misfit
    implicit none (type, external)
    private
    public :: variable_table, variable_entry, symbol_entry, quantity_of_text, measured_of_text, formula_of_text

    integer, parameter :: unknown = 0, in_progress = 1, known = 2

    !> A name and what stands behind it.
    type :: variable_entry
        character(len=name_len) :: name = ""
        character(len=:), allocatable :: text           !! as it is written
        logical :: is_number = .false.                  !! there is no text, `found` is given
        type(measured_value) :: found
        integer :: state = unknown
        logical :: was_used = .false.                   !! before the values were forgotten last
    end type variable_entry

    !> A name for what the mechanism does, or for a law: formulas know it, numbers do not.
    type :: symbol_entry
        character(len=name_len) :: name = ""
        integer :: symbol = 0                           !! above zero a measure, below a law
        integer :: power(n_dimension) = 0
        logical :: has_unit = .true.                    !! false: a law of numbers without unit
    end type symbol_entry

    !> The variables of a scene.
    type, extends(name_source) :: variable_table
        type(variable_entry), allocatable :: entry(:)
        integer :: culprit = 0                          !! the one in which the last problem lies; 0: in what refers to it
        logical :: has_unit_names = .false.             !! some are called as a unit is
        type(symbol_entry), allocatable :: symbol(:)
        logical :: sees_symbols = .false.               !! a formula is being read
    contains
        procedure :: has => has_variable
        procedure :: find => find_variable_value
        procedure :: list => list_variable_names
        procedure :: forget => forget_values
        procedure :: is_used
        procedure :: was_used
        procedure :: set_entries
        procedure :: add_symbol
        procedure :: drop_symbols
        procedure :: mentions_symbol
    end type variable_table

contains

    !> Take over names and texts.
    subroutine set_entries(self, entry)
        class(variable_table), intent(inout) :: self
        type(variable_entry), intent(in) :: entry(:)
        integer :: i

        self%entry = entry
        self%has_unit_names = .false.
        do i = 1, size(entry)
            if (is_unit_name(trim(entry(i)%name))) self%has_unit_names = .true.
        end do
    end subroutine set_entries

    !> One more symbol.
    subroutine add_symbol(self, entry)
        class(variable_table), intent(inout) :: self
        type(symbol_entry), intent(in) :: entry

        if (.not. allocated(self%symbol)) allocate (self%symbol(0))
        self%symbol = [self%symbol, entry]
    end subroutine add_symbol

    !> Forget all symbols but the first ones.
    subroutine drop_symbols(self, n_left)
        class(variable_table), intent(inout) :: self
        integer, intent(in) :: n_left

        self%symbol = self%symbol(:n_left)
    end subroutine drop_symbols

    !> Does any name in a text stand for a symbol?
    pure logical function mentions_symbol(self, text)
        class(variable_table), intent(in) :: self
        character(len=*), intent(in) :: text

        mentions_symbol = symbol_in(self, text, .false.) > 0
    end function mentions_symbol

    !> The first symbol whose name stands in a text, or the first of those that share it with a variable; 0: none.
    pure integer function symbol_in(self, text, is_shared) result(symbol)
        class(variable_table), intent(in) :: self
        character(len=*), intent(in) :: text
        logical, intent(in) :: is_shared
        integer :: first, n

        symbol = 0
        if (.not. allocated(self%symbol)) return
        first = 1
        do while (first <= len(text))
            n = verify(text(first:)//" ", name_letters) - 1
            if (n > 0 .and. scan(text(first:first), "0123456789") == 0) then
                associate (name => text(first:first + n - 1))
                    if (.not. is_shared .or. index_of(self, name) > 0) symbol = findloc(self%symbol%name, name, dim=1)
                end associate
                if (symbol > 0) return
            end if
            first = first + max(1, n)
        end do
    end function symbol_in

    !> Variables go before symbols.
    pure integer function symbol_index(self, name)
        class(variable_table), intent(in) :: self
        character(len=*), intent(in) :: name

        symbol_index = 0
        if (.not. allocated(self%symbol) .or. index_of(self, name) > 0) return
        symbol_index = findloc(self%symbol%name, name, dim=1)
    end function symbol_index

    logical function has_variable(self, name) result(has)
        class(variable_table), intent(in) :: self
        character(len=*), intent(in) :: name

        has = index_of(self, name) > 0
        if (self%sees_symbols) has = has .or. symbol_index(self, name) > 0
    end function has_variable

    !> The value of a variable, found when it is first asked for.
    recursive subroutine find_variable_value(self, name, depth, found, problem)
        class(variable_table), intent(inout) :: self
        character(len=*), intent(in) :: name
        integer, intent(in) :: depth
        type(measured_value), intent(out) :: found
        character(len=:), allocatable, intent(inout) :: problem
        integer :: i

        i = index_of(self, name)
        if (i == 0) then
            i = symbol_index(self, name)
            associate (entry => self%symbol(i))
                found = measured_value(power=entry%power, has_unit=entry%has_unit, symbol=entry%symbol)
            end associate
            return
        end if
        self%culprit = 0
        if (self%entry(i)%state == in_progress) then
            self%culprit = i
            problem = "refers to itself ("//circle_of(self)//")"
            return
        else if (self%entry(i)%state == unknown) then
            self%entry(i)%state = in_progress
            if (.not. self%entry(i)%is_number) then
                call value_of_text(self%entry(i)%text, self, depth, found, problem)
                if (problem /= "") then
                    if (self%culprit == 0) self%culprit = i
                    return
                end if
                self%entry(i)%found = found
            end if
            self%entry(i)%state = known
        end if
        found = self%entry(i)%found
    end subroutine find_variable_value

    subroutine list_variable_names(self, names)
        class(variable_table), intent(in) :: self
        character(len=64), allocatable, intent(out) :: names(:)
        integer :: i, n

        n = 0
        if (allocated(self%entry)) n = size(self%entry)
        if (self%sees_symbols) then
            allocate (names(n + size(self%symbol)))
            names(n + 1:) = self%symbol%name
        else
            allocate (names(n))
        end if
        do i = 1, n
            names(i) = self%entry(i)%name
        end do
    end subroutine list_variable_names

    !> Values will be found anew; those that are found are told by `is_used`, those that were by `was_used`.
    subroutine forget_values(self)
        class(variable_table), intent(inout) :: self
        integer :: i

        do i = 1, size(self%entry)
            self%entry(i)%was_used = self%entry(i)%state == known
            self%entry(i)%state = unknown
        end do
    end subroutine forget_values

    !> True if anything asked for this variable before the values were forgotten last.
    logical function was_used(self, name)
        class(variable_table), intent(in) :: self
        character(len=*), intent(in) :: name
        integer :: i

        i = index_of(self, name)
        was_used = .false.
        if (i > 0) was_used = self%entry(i)%was_used
    end function was_used

    !> True if anything asked for this variable, by itself or through others, since the values were forgotten.
    logical function is_used(self, name)
        class(variable_table), intent(in) :: self
        character(len=*), intent(in) :: name
        integer :: i

        i = index_of(self, name)
        is_used = .false.
        if (i > 0) is_used = self%entry(i)%state == known
    end function is_used

    !> A number in SI from a text that says what is expected: "12 mm", "L/2". `problem` is empty if all is well.
    subroutine quantity_of_text(text, quantity, variables, value, problem)
        character(len=*), intent(in) :: text
        type(quantity_type), intent(in) :: quantity     !! what is expected
        class(variable_table), intent(inout) :: variables
        real(wp), intent(out) :: value
        character(len=:), allocatable, intent(out) :: problem
        type(measured_value) :: found
        integer :: power(n_dimension)
        logical :: is_plain, has_unit

        value = 0
        call read_plain(text, variables, value, has_unit, power, is_plain, problem)
        if (is_plain) then
            if (problem == "") problem = misfit(text, has_unit, power, names_minutes(text), quantity)
            return
        end if
        call value_of_text(text, variables, 0, found, problem)
        value = found%value
        if (problem /= "" .or. .not. found%has_unit) return
        problem = misfit(text, .true., found%power, found%in_minutes, quantity)
        if (.not. is_same_dimension(found%power, quantity) .and. all(found%power(:4) == quantity%power(:4))) &
            problem = problem//", with an angle too many or too few: a factor or divisor of '1 rad' mends it"
    end subroutine quantity_of_text

    !> The same whatever is expected, with its dimension.
    subroutine measured_of_text(text, variables, found, problem)
        character(len=*), intent(in) :: text
        class(variable_table), intent(inout) :: variables
        type(measured_value), intent(out) :: found
        character(len=:), allocatable, intent(out) :: problem

        call value_of_text(text, variables, 0, found, problem)
    end subroutine measured_of_text

    !> A text that mentions symbols. `problem` is empty if all is well.
    subroutine formula_of_text(text, variables, found, formula, problem)
        character(len=*), intent(in) :: text
        class(variable_table), intent(inout) :: variables
        type(measured_value), intent(out) :: found      !! its node is 0 if no symbol is left: `if(1, 2, x)`
        type(formula_type), intent(out) :: formula
        character(len=:), allocatable, intent(out) :: problem
        integer :: shared

        variables%culprit = 0
        shared = symbol_in(variables, text, .true.)
        if (shared > 0) then
            problem = quoted(text)//" names "//quoted(trim(variables%symbol(shared)%name))// &
                ", which has a meaning in formulas and is a variable, too: the variable wants another name"
            return
        end if
        variables%sees_symbols = .true.
        call evaluate_expression(text, variables, 0, found, problem, formula)
        variables%sees_symbols = .false.
    end subroutine formula_of_text

    !> The value of a text, be it a number with its unit or arithmetic.
    recursive subroutine value_of_text(text, variables, depth, found, problem)
        character(len=*), intent(in) :: text
        class(variable_table), intent(inout) :: variables
        integer, intent(in) :: depth
        type(measured_value), intent(out) :: found
        character(len=:), allocatable, intent(inout) :: problem
        logical :: is_plain

        call read_plain(text, variables, found%value, found%has_unit, found%power, is_plain, problem)
        found%counts_turns = counts_turns(text, found%power)
        found%in_minutes = names_minutes(text)
        if (is_plain) return
        variables%culprit = 0
        found = measured_value()
        call evaluate_expression(text, variables, depth, found, problem)
    end subroutine value_of_text

    !> A number with its unit is read as such, whatever variables there are, unless one with the name of a unit may be meant:
    !> "2*m".
    subroutine read_plain(text, variables, value, has_unit, power, is_plain, problem)
        character(len=*), intent(in) :: text
        class(variable_table), intent(in) :: variables
        real(wp), intent(out) :: value
        logical, intent(out) :: has_unit
        integer, intent(out) :: power(n_dimension)
        logical, intent(out) :: is_plain                !! nothing else is to be tried
        character(len=:), allocatable, intent(out) :: problem
        character(len=:), allocatable :: behind

        call read_value(text, value, has_unit, power, problem)
        if (problem == "") then
            behind = adjustl(text)
            behind = adjustl(behind(verify(behind//"?", "+-.0123456789eE"):))
            is_plain = .not. variables%has_unit_names .or. scan(behind(:min(1, len(behind))), "*/") == 0
            is_plain = is_plain .and. .not. (takes_off(text) .or. names_variable(text, variables))
        else
            is_plain = len_trim(text) == 0
        end if
    end subroutine read_plain

    !> "10 m/s^2*m1" would do for a unit, too. Does a variable whose name has figures stand behind a sign?
    pure logical function names_variable(text, variables)
        character(len=*), intent(in) :: text
        class(variable_table), intent(in) :: variables
        character(len=:), allocatable :: before
        integer :: first, n

        names_variable = .false.
        first = 1
        do while (first <= len(text))
            n = verify(text(first:)//" ", name_letters) - 1
            if (scan(text(first:first + n - 1), "0123456789") > 1) then
                before = trim("?"//text(:first - 1))
                names_variable = scan(before, "*/", back=.true.) == len(before) &
                                 .and. index_of(variables, text(first:first + n - 1)) > 0
                if (names_variable) return
            end if
            first = first + max(n, 1)
        end do
    end function names_variable

    !> "3 m-1 m" would do for a unit, too, m^-1 m. Where quantities alike stand on both sides of a minus it takes off.
    pure logical function takes_off(text)
        character(len=*), intent(in) :: text
        real(wp) :: value
        logical :: has_unit(2)
        integer :: power(n_dimension, 2), i, length
        character(len=:), allocatable :: problem, other

        takes_off = .false.
        do i = 2, len(text)
            if (text(i:i) /= "-") cycle
            length = index(text(i + 1:)//"-", "-") - 1
            call read_value(text(:i - 1), value, has_unit(1), power(:, 1), problem)
            call read_value(text(i + 1:i + length), value, has_unit(2), power(:, 2), other)
            takes_off = problem == "" .and. other == "" .and. all(has_unit) .and. all(power(:, 1) == power(:, 2))
            if (takes_off) return
        end do
    end function takes_off

    pure integer function index_of(self, name)
        class(variable_table), intent(in) :: self
        character(len=*), intent(in) :: name
        integer :: i

        index_of = 0
        if (.not. allocated(self%entry) .or. len(name) == 0) return
        do i = 1, size(self%entry)
            if (self%entry(i)%name == name) index_of = i
        end do
    end function index_of

    !> The variables that wait for one another.
    function circle_of(self) result(text)
        class(variable_table), intent(in) :: self
        character(len=:), allocatable :: text
        integer :: i

        text = ""
        do i = 1, size(self%entry)
            if (self%entry(i)%state /= in_progress) cycle
            if (len(text) > 200) then
                text = text//", ..."
                return
            end if
            if (text /= "") text = text//", "
            text = text//quoted(self%entry(i)%name)
        end do
    end function circle_of
end module linkdyn_variables
