!> Numbers of a scene file by their path, and other numbers in their place.
!>
!> A path goes down from the top: `link.platform.mass`, `frame.markers.B1[0]`, `chain.leg.lower.mass`,
!> `load.platform.tool.force[2]`. In a list of tables the one is taken whose name, joint, link or load follows; in a list
!> of values `[0]` is the first, as in Python.
module linkdyn_scene_parameters
    use linkdyn_kinds, only: wp
    use linkdyn_scene_keys, only: scene_place, refuse
    use linkdyn_scene_names, only: unnamed_chain
    use linkdyn_status, only: status_type
    use linkdyn_suggest, only: suggestion
    use linkdyn_sweep_spec, only: axis_spec, axis_parameter, multiply_by, add_to
    use linkdyn_text, only: quoted, to_text
    use linkdyn_toml, only: toml_node, toml_table, toml_array, toml_string
    use linkdyn_input, only: number_length, put_number
    use linkdyn_units, only: si_unit_text
    use linkdyn_scene_variables, only: read_variables
    use linkdyn_variables, only: variable_table, measured_of_text
    use linkdyn_expression, only: measured_value
    implicit none (type, external)
    private
    public :: varied_numbers, check_parameter, is_there, find_numbers, vary_numbers, added_unit, add_unit

    integer, parameter :: key_len = 256

    !> A value and where it stands.
    type :: number_at
        type(toml_node) :: node
        type(toml_node) :: parent
        character(len=key_len) :: key = ""      !! in a table
        integer :: item = 0                     !! in a list, from 1
        character(len=:), allocatable :: text   !! as it is written; absent if it is a number
        logical :: is_variable = .false.        !! of [variables]: what refers to it wants its unit
        character(len=64) :: unit = ""
    end type number_at

    !> The unit of an axis's values where the number in the file has none.
    type :: added_unit
        logical :: is_there = .false.           !! the values have one
        character(len=64) :: text = ""          !! SI; empty: of a plain number
    end type added_unit

    !> What one axis does to one number.
    type :: change_type
        integer :: axis = 0
        integer :: number = 0
        integer :: operation = 0
        real(wp) :: weight = 1
    end type change_type

    !> The numbers of a document that a sweep changes. What the places hold is not their node: a new value is a new one.
    type :: varied_numbers
        type(number_at), allocatable :: place(:)
        real(wp), allocatable :: original(:)            !! SI
        type(change_type), allocatable :: change(:)     !! in the order in which they are made
    end type varied_numbers

contains

    !> Refuse a path that leads to no number.
    subroutine check_parameter(place, root, path, allows_list, number, status)
        type(scene_place), intent(in) :: place
        type(toml_node), intent(in) :: root
        character(len=*), intent(in) :: path
        logical, intent(in) :: allows_list      !! a list of numbers will do
        type(measured_value), intent(out) :: number    !! that stands there, of a list its last
        type(status_type), intent(inout) :: status
        type(number_at) :: found
        type(variable_table) :: variables       !! a copy: looking is no use of them
        character(len=:), allocatable :: problem

        if (.not. status%is_ok()) return
        variables = place%variables
        call walk(root, trim(path), found, problem)
        if (problem == "") call check_numbers(found%node, variables, allows_list, number, problem)
        if (problem /= "") call refuse(place, "parameter "//quoted(path)//": "//problem, status)
    end subroutine check_parameter

    !> Does a path lead to anything?
    logical function is_there(root, path)
        type(toml_node), intent(in) :: root
        character(len=*), intent(in) :: path
        type(number_at) :: found
        character(len=:), allocatable :: problem

        call walk(root, path, found, problem)
        is_there = problem == ""
    end function is_there

    recursive subroutine check_numbers(node, variables, allows_list, value, problem)
        type(toml_node), intent(in) :: node
        type(variable_table), intent(inout) :: variables
        logical, intent(in) :: allows_list
        type(measured_value), intent(inout) :: value
        character(len=:), allocatable, intent(inout) :: problem
        integer :: i

        if (node%kind() == toml_array .and. allows_list) then
            do i = 1, node%count()
                call check_numbers(node%at(i), variables, .true., value, problem)
            end do
        else
            call number_of(node, variables, value, problem)
        end if
    end subroutine check_numbers

    !> The numbers that the axes of a sweep change, as they stand in a document that has just been read.
    subroutine find_numbers(root, axis, varied)
        type(scene_place), intent(in) :: root
        type(axis_spec), intent(in) :: axis(:)
        type(varied_numbers), intent(out) :: varied
        type(number_at) :: found
        type(variable_table) :: variables
        type(status_type) :: status
        character(len=:), allocatable :: problem
        integer :: i, k

        call read_variables(root, variables, status)
        allocate (varied%place(0), varied%original(0), varied%change(0))
        do i = 1, size(axis)
            if (axis(i)%kind /= axis_parameter) cycle
            do k = 1, size(axis(i)%parameter)
                call walk(root%node, trim(axis(i)%parameter(k)%path), found, problem)
                if (problem /= "") cycle
                found%is_variable = found%parent%is_same_as(root%node%get("variables"))
                call add_numbers(found, variables, change_type(i, 0, axis(i)%operation, axis(i)%parameter(k)%weight), varied)
            end do
        end do
    end subroutine find_numbers

    !> A number, or all in a list.
    recursive subroutine add_numbers(found, variables, change, varied)
        type(number_at), intent(in) :: found
        type(variable_table), intent(inout) :: variables
        type(change_type), intent(in) :: change
        type(varied_numbers), intent(inout) :: varied
        type(change_type) :: own
        character(len=:), allocatable :: problem
        type(number_at) :: place
        type(measured_value) :: number
        logical :: is_text
        integer :: i

        if (found%node%kind() == toml_array) then
            do i = 1, found%node%count()
                call add_numbers(number_at(found%node%at(i), found%node, "", i), variables, change, varied)
            end do
            return
        end if
        problem = ""
        call number_of(found%node, variables, number, problem)
        if (problem /= "") return
        own = change
        do i = 1, size(varied%place)
            if (is_same_place(varied%place(i), found)) own%number = i
        end do
        if (own%number == 0) then
            place = found
            if (found%node%kind() == toml_string) call found%node%get_text(place%text, is_text)
            if (number%has_unit) place%unit = si_unit_text(number%power)
            varied%place = [varied%place, place]
            varied%original = [varied%original, number%value]
            own%number = size(varied%place)
        end if
        varied%change = [varied%change, own]
    end subroutine add_numbers

    logical function is_same_place(a, b)
        type(number_at), intent(in) :: a, b

        is_same_place = a%parent%is_same_as(b%parent) .and. a%key == b%key .and. a%item == b%item
    end function is_same_place

    !> The numbers that an axis changes with the unit of its values behind them: whoever reads them finds out whether it fits.
    subroutine add_unit(root, axis, unit)
        type(scene_place), intent(in) :: root
        type(axis_spec), intent(in) :: axis
        type(added_unit), intent(in) :: unit
        type(varied_numbers) :: varied
        character(len=number_length) :: text
        integer :: i, n

        call find_numbers(root, [axis], varied)
        do i = 1, size(varied%place)
            call put_number(varied%original(i), text, n)
            call put_text(varied%place(i), text(:n)//" "//trim(unit%text))
        end do
    end subroutine add_unit

    !> Put the values of one design into the document, whatever values stand there now.
    !>
    !> A number that arithmetic gives may follow from variables that vary, too. So all variables get their values first, those
    !> that follow from others as often as there may be steps from one to the next.
    subroutine vary_numbers(root, varied, value)
        type(scene_place), intent(in) :: root
        type(varied_numbers), intent(inout) :: varied
        real(wp), intent(in) :: value(:)        !! of the axes
        type(variable_table) :: variables
        integer :: i, pass, n_pass

        do i = 1, size(varied%place)
            if (allocated(varied%place(i)%text)) call put_text(varied%place(i), varied%place(i)%text)
        end do
        do i = 1, size(varied%place)
            if (varied%place(i)%is_variable) call put_value(varied%place(i), changed(varied, i, value))
        end do
        n_pass = 1 + count([(varied%place(i)%is_variable .and. allocated(varied%place(i)%text), i=1, size(varied%place))])
        do pass = 1, n_pass
            if (.not. any([(allocated(varied%place(i)%text), i=1, size(varied%place))])) exit
            call find_variables(root, variables)
            do i = 1, size(varied%place)
                if (allocated(varied%place(i)%text)) call find_original(varied%place(i), variables, varied%original(i))
                if (varied%place(i)%is_variable) call put_value(varied%place(i), changed(varied, i, value))
            end do
        end do
        do i = 1, size(varied%place)
            if (.not. varied%place(i)%is_variable) call put_value(varied%place(i), changed(varied, i, value))
        end do
    end subroutine vary_numbers

    !> The variables as the document has them now; what is wrong in them is told when the scene is read.
    subroutine find_variables(root, variables)
        type(scene_place), intent(in) :: root
        type(variable_table), intent(out) :: variables
        type(status_type) :: status

        call read_variables(root, variables, status)
        call variables%forget()
    end subroutine find_variables

    !> The number that stands in the file where arithmetic gives it.
    subroutine find_original(place, variables, original)
        type(number_at), intent(in) :: place
        type(variable_table), intent(inout) :: variables
        real(wp), intent(inout) :: original
        type(measured_value) :: number
        character(len=:), allocatable :: problem

        call measured_of_text(place%text, variables, number, problem)
        if (problem == "") original = number%value
    end subroutine find_original

    !> What all axes make of a number.
    pure real(wp) function changed(varied, i, value) result(number)
        type(varied_numbers), intent(in) :: varied
        integer, intent(in) :: i
        real(wp), intent(in) :: value(:)
        real(wp) :: given
        integer :: k

        number = varied%original(i)
        do k = 1, size(varied%change)
            associate (change => varied%change(k))
                if (change%number /= i) cycle
                given = change%weight*value(change%axis)
                select case (change%operation)
                case (multiply_by)
                    number = number*given
                case (add_to)
                    number = number + given
                case default
                    number = given
                end select
            end associate
        end do
    end function changed

    !> A number, with its unit where others refer to it.
    subroutine put_value(place, number)
        type(number_at), intent(in) :: place
        real(wp), intent(in) :: number
        character(len=number_length) :: text
        integer :: n

        if (place%is_variable .and. place%unit /= "") then
            call put_number(number, text, n)
            call put_text(place, text(:n)//" "//trim(place%unit))
        else if (place%item > 0) then
            call place%parent%put_at(place%item, number)
        else
            call place%parent%put(place%key, number)
        end if
    end subroutine put_value

    subroutine put_text(place, text)
        type(number_at), intent(in) :: place
        character(len=*), intent(in) :: text

        if (place%item > 0) then
            call place%parent%put_text_at(place%item, text)
        else
            call place%parent%put_text(place%key, text)
        end if
    end subroutine put_text

    !> A number, or a text with a number and its unit, or with arithmetic.
    subroutine number_of(node, variables, value, problem)
        type(toml_node), intent(in) :: node
        type(variable_table), intent(inout) :: variables
        type(measured_value), intent(out) :: value
        character(len=:), allocatable, intent(inout) :: problem
        character(len=:), allocatable :: text, wrong
        logical :: is_one

        call node%get_number(value%value, is_one)
        if (is_one) return
        call node%get_text(text, is_one)
        if (.not. is_one) then
            problem = "leads to "//node%kind_text()//" (expected a number, or a text with its unit)"
            return
        end if
        call measured_of_text(text, variables, value, wrong)
        if (wrong /= "") problem = wrong//" (expected a number, or a text with its unit)"
    end subroutine number_of

    !> Follow a path.
    subroutine walk(root, path, found, problem)
        type(toml_node), intent(in) :: root
        character(len=*), intent(in) :: path
        type(number_at), intent(out) :: found
        character(len=:), allocatable, intent(out) :: problem
        integer :: next, last, item, code
        type(toml_node) :: inner

        problem = ""
        found%node = root
        next = 1
        do while (next <= len(path))
            if (path(next:next) == "[") then
                last = index(path(next:), "]") + next - 1
                item = -1
                if (last > next + 1) then
                    if (verify(path(next + 1:last - 1), "0123456789") == 0) read (path(next + 1:last - 1), *, iostat=code) item
                end if
                inner = found%node%at(item + 1)
                if (item < 0 .or. found%node%kind() /= toml_array .or. .not. inner%is_present()) then
                    problem = "there is nothing at "//quoted(path(:max(last, next)))//" (expected [0] to ["// &
                        to_text(max(0, found%node%count() - 1))//"] of a list)"
                    return
                end if
                found = number_at(inner, found%node, "", item + 1)
                next = last + 1
                if (next <= len(path)) then
                    if (path(next:next) == ".") next = next + 1
                end if
            else
                call step_down(path, next, found, problem)
                if (problem /= "") return
            end if
        end do
    end subroutine walk

    !> To the key, or the named table of a list, that the path goes on with: the longest name that is there.
    subroutine step_down(path, next, found, problem)
        character(len=*), intent(in) :: path
        integer, intent(inout) :: next
        type(number_at), intent(inout) :: found
        character(len=:), allocatable, intent(inout) :: problem
        type(toml_node) :: inner
        character(len=key_len), allocatable :: names(:)
        integer :: last, first_end, item
        logical :: is_one

        first_end = len(path)
        do last = len(path), next, -1
            if (last < len(path)) then
                if (scan(path(last + 1:last + 1), ".[") == 0) cycle
            end if
            first_end = last
            if (found%node%kind() == toml_table) then
                inner = found%node%get(path(next:last))
                item = 0
            else
                call find_named(found%node, found%key, path(next:last), inner, item, is_one)
                if (.not. is_one) then
                    problem = "several in "//quoted(path(:next - 2))//" are called "//quoted(path(next:last)) &
                              //" (expected one of them, by its number: "//path(:next - 2)//"[0] is the first)"
                    return
                end if
            end if
            if (.not. inner%is_present()) cycle
            found = number_at(inner, found%node, path(next:last), item)
            next = last + 1
            if (next <= len(path)) then
                if (path(next:next) == ".") next = next + 1
            end if
            return
        end do
        call list_names(found%node, found%key, names)
        if (found%node%kind() /= toml_table .and. found%node%kind() /= toml_array) then
            problem = quoted(path(:next - 2))//" is "//found%node%kind_text()//" and has no "//quoted(path(next:))
        else
            problem = "there is no "//quoted(path(next:first_end))
            if (next > 2) problem = problem//" in "//quoted(path(:next - 2))
            problem = problem//" (expected the path of a number, such as link.rocker.mass)"
            if (size(names) > 0) problem = problem//suggestion(path(next:first_end), names)
        end if
    end subroutine step_down

    !> The table of a list that bears a name: a joint's may have the variable behind it, `C` or `C.slide`.
    subroutine find_named(list, key, name, found, item, is_one)
        type(toml_node), intent(in) :: list
        character(len=*), intent(in) :: key     !! at which the list stands
        character(len=*), intent(in) :: name
        type(toml_node), intent(out) :: found
        integer, intent(out) :: item
        logical, intent(out) :: is_one          !! no other bears it
        type(toml_node) :: node
        character(len=:), allocatable :: own
        integer :: i

        found = toml_node()
        item = 0
        is_one = .true.
        do i = 1, list%count()
            node = list%at(i)
            own = name_of(node, key)
            if (own == "" .or. (own /= name .and. own//"."//text_of(node, "variable") /= name)) cycle
            if (item > 0) is_one = .false.
            if (item == 0) found = node
            if (item == 0) item = i
        end do
    end subroutine find_named

    !> The text at a key of a table; empty without one.
    function text_of(node, key) result(text)
        type(toml_node), intent(in) :: node
        character(len=*), intent(in) :: key
        character(len=:), allocatable :: text
        type(toml_node) :: inner
        logical :: is_text

        text = ""
        if (node%kind() /= toml_table) return
        inner = node%get(key)
        if (inner%kind() == toml_string) call inner%get_text(text, is_text)
    end function text_of

    !> What a table of a list is called by. A chain without name has the one that its legs are named after.
    function name_of(node, list) result(name)
        type(toml_node), intent(in) :: node
        character(len=*), intent(in) :: list    !! its key
        character(len=:), allocatable :: name
        character(len=8), parameter :: key(*) = [character(len=8) :: "name", "actuator", "joint", "link", "marker", "on"]
        integer :: i

        name = ""
        do i = 1, size(key)
            name = text_of(node, trim(key(i)))
            if (name /= "") return
        end do
        if (list == "chain") name = unnamed_chain
    end function name_of

    subroutine list_names(node, list, names)
        type(toml_node), intent(in) :: node
        character(len=*), intent(in) :: list    !! key at which it stands
        character(len=key_len), allocatable, intent(out) :: names(:)
        character(len=:), allocatable :: key
        integer :: i, line

        if (node%kind() /= toml_table .and. node%kind() /= toml_array) then
            allocate (names(0))
            return
        end if
        allocate (names(node%count()))
        do i = 1, size(names)
            if (node%kind() == toml_table) then
                call node%key(i, key, line)
                names(i) = key
            else
                names(i) = name_of(node%at(i), list)
            end if
        end do
    end subroutine list_names
end module linkdyn_scene_parameters
