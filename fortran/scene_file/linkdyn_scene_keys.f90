!> Keys of a table of the scene file: presence, type, unit, and one line that says what is wrong.
!>
!> Every procedure does nothing once `status` holds a failure, so that calls may follow one another.
module linkdyn_scene_keys
    use linkdyn_kinds, only: wp
    use linkdyn_status, only: status_type, status_bad_input, fail
    use linkdyn_text, only: to_text, quoted, join
    use linkdyn_scene, only: name_len, path_len, source_shelf
    use linkdyn_toml, only: toml_node, toml_table, toml_array
    use linkdyn_units, only: quantity_type
    use linkdyn_variables, only: variable_table, quantity_of_text
    use linkdyn_suggest, only: suggestion
    implicit none (type, external)
    private
    public :: scene_place, place_at, place_text, line_text, refuse, refuse_value, refuse_missing
    public :: allow_keys, require_table, table_list
    public :: get_quantity, quantity_of, get_vector, vector_of, list_of, get_direction, direction_of
    public :: pattern_key, text_of, get_text, get_name, get_word, get_flag, get_integer, require_name, counted

    !> Keys of a table that is there several times.
    character(len=6), parameter :: pattern_key(*) = [character(len=6) :: "repeat", "about", "angles", "mirror"]

    !> A table of the scene file and how to call it.
    type :: scene_place
        type(toml_node) :: node
        character(len=path_len) :: file = ""
        character(len=2*name_len) :: what = ""     !! "link 'rocker'"; blank: the scene itself
        integer :: line = 0
        integer :: copy = 0                        !! number of a table that is there several times, `#` in its texts; 0: once
        integer :: n_pattern_key = 0               !! of `pattern_key` that it may have beside its own
        type(source_shelf), pointer :: sources => null()       !! files that lines count through; none: one file
        type(variable_table), pointer :: variables => null()   !! that numbers may refer to
    end type scene_place

contains

    !> A table within another one, under its own name in messages.
    type(scene_place) function place_at(parent, node, what) result(place)
        type(scene_place), intent(in) :: parent
        type(toml_node), intent(in) :: node
        character(len=*), intent(in) :: what

        place%node = node
        place%file = parent%file
        place%copy = parent%copy
        place%sources => parent%sources
        place%variables => parent%variables
        place%what = what
        place%line = node%line()
        if (place%line == 0) place%line = parent%line
    end function place_at

    !> FILE:LINE: WHAT: problem
    subroutine refuse(place, problem, status, line)
        type(scene_place), intent(in) :: place
        character(len=*), intent(in) :: problem        !! with what was expected, in brackets
        type(status_type), intent(inout) :: status
        integer, intent(in), optional :: line          !! default: where the table starts
        character(len=:), allocatable :: text
        integer :: at

        at = place%line
        if (present(line)) then
            if (line > 0) at = line
        end if
        text = place_text(place, at)
        if (place%what /= "") text = text//": "//trim(place%what)
        call fail(status, status_bad_input, text//": "//expected_once(problem))
    end subroutine refuse

    !> A problem with what was expected nearest to the fault. Arithmetic says that of the part of a text that is wrong, and the key
    !> of all of it.
    pure function expected_once(problem) result(text)
        character(len=*), intent(in) :: problem
        character(len=:), allocatable :: text
        character(len=*), parameter :: opening = " (expected "
        integer :: first, second

        text = problem
        first = index(problem, opening)
        if (first == 0) return
        second = index(problem(first + len(opening):), opening)
        if (second > 0) text = problem(:first + len(opening) + second - 2)
    end function expected_once

    !> "FILE:LINE", or the file alone.
    function place_text(place, line) result(text)
        type(scene_place), intent(in) :: place
        integer, intent(in) :: line                    !! counted through all files; 0: unknown
        character(len=:), allocatable :: text
        integer :: own, i

        own = line
        text = trim(place%file)
        i = source_of(place, line)
        if (i > 0) then
            text = trim(place%sources%item(i)%file)
            own = line - place%sources%item(i)%lines_before
        end if
        if (line > 0) text = text//":"//to_text(own)
    end function place_text

    !> "line 12", "line 3 of legs.toml" if that is another file than a second line's.
    function line_text(place, line, beside) result(text)
        type(scene_place), intent(in) :: place
        integer, intent(in) :: line, beside            !! counted through all files
        character(len=:), allocatable :: text
        integer :: i

        text = "line "//to_text(line)
        i = source_of(place, line)
        if (i == 0) return
        text = "line "//to_text(line - place%sources%item(i)%lines_before)
        if (i /= source_of(place, beside)) text = text//" of "//trim(place%sources%item(i)%file)
    end function line_text

    !> The file that a line lies in; 0 if there is but one.
    integer function source_of(place, line) result(i)
        type(scene_place), intent(in) :: place
        integer, intent(in) :: line
        integer :: k

        i = 0
        if (.not. associated(place%sources) .or. line == 0) return
        do k = 1, size(place%sources%item)
            if (line > place%sources%item(k)%lines_before) i = k
        end do
    end function source_of

    !> A key has a value that it cannot have.
    subroutine refuse_value(place, key, node, problem, status)
        type(scene_place), intent(in) :: place
        character(len=*), intent(in) :: key
        type(toml_node), intent(in) :: node
        character(len=*), intent(in) :: problem
        type(status_type), intent(inout) :: status

        call refuse(place, "key "//quoted(key)//" "//problem, status, node%line())
    end subroutine refuse_value

    subroutine refuse_missing(place, key, expected, status)
        type(scene_place), intent(in) :: place
        character(len=*), intent(in) :: key, expected
        type(status_type), intent(inout) :: status

        call refuse(place, "missing key "//quoted(key)//" (expected "//expected//")", status)
    end subroutine refuse_missing

    !> Refuse keys that mean nothing here.
    subroutine allow_keys(place, keys, status)
        type(scene_place), intent(in) :: place
        character(len=*), intent(in) :: keys(:)
        type(status_type), intent(inout) :: status
        character(len=:), allocatable :: key, hint
        integer :: i, line

        if (.not. status%is_ok()) return
        do i = 1, place%node%count()
            call place%node%key(i, key, line)
            if (any(keys == key) .or. any(pattern_key(:place%n_pattern_key) == key)) cycle
            hint = suggestion(key, keys)
            if (hint == "") hint = " (expected one of "//join(keys)//")"
            call refuse(place, "unknown key "//quoted(key)//hint, status, line)
            return
        end do
    end subroutine allow_keys

    subroutine require_table(place, expected, status)
        type(scene_place), intent(in) :: place
        character(len=*), intent(in) :: expected
        type(status_type), intent(inout) :: status

        if (.not. status%is_ok() .or. place%node%kind() == toml_table) return
        call refuse(place, "this is "//place%node%kind_text()//" (expected "//expected//")", status)
    end subroutine require_table

    !> The tables [[key]] of a scene: `n` of them, checked to be tables.
    subroutine table_list(root, key, list, n, status)
        type(scene_place), intent(in) :: root
        character(len=*), intent(in) :: key
        type(toml_node), intent(out) :: list
        integer, intent(out) :: n
        type(status_type), intent(inout) :: status
        type(toml_node) :: item
        integer :: i

        n = 0
        if (.not. status%is_ok()) return
        list = root%node%get(key)
        if (.not. list%is_present()) return
        if (list%kind() /= toml_array) then
            call refuse_value(root, key, list, "is "//list%kind_text()// &
                " (expected an array of tables, written [["//key//"]])", status)
            return
        end if
        n = list%count()
        do i = 1, n
            item = list%at(i)
            if (item%kind() == toml_table) cycle
            call refuse_value(root, key, item, "holds "//item%kind_text()// &
                " (expected tables, written [["//key//"]])", status)
            return
        end do
    end subroutine table_list

    !> A number or a text with unit under a key. Without `found`, the key must be there.
    subroutine get_quantity(place, key, quantity, value, status, found)
        type(scene_place), intent(in) :: place
        character(len=*), intent(in) :: key
        type(quantity_type), intent(in) :: quantity
        real(wp), intent(inout) :: value               !! SI; left alone if the key is not there
        type(status_type), intent(inout) :: status
        logical, intent(out), optional :: found
        type(toml_node) :: node

        if (present(found)) found = .false.
        if (.not. status%is_ok()) return
        node = place%node%get(key)
        if (present(found)) found = node%is_present()
        if (node%is_present()) then
            call quantity_of(place, key, node, quantity, value, status)
        else if (.not. present(found)) then
            call refuse_missing(place, key, expected_text(quantity), status)
        end if
    end subroutine get_quantity

    !> A number, or a text with unit or arithmetic.
    subroutine quantity_of(place, key, node, quantity, value, status)
        type(scene_place), intent(in) :: place
        character(len=*), intent(in) :: key            !! what to call the value in messages
        type(toml_node), intent(in) :: node
        type(quantity_type), intent(in) :: quantity
        real(wp), intent(inout) :: value               !! SI
        type(status_type), intent(inout) :: status
        character(len=:), allocatable :: text, problem
        logical :: is_one
        real(wp) :: number

        if (.not. status%is_ok()) return
        call node%get_number(number, is_one)
        if (is_one) then
            if (.not. abs(number) <= huge(number)) then
                call refuse_value(place, key, node, "is not a finite number (expected "//expected_text(quantity)//")", status)
                return
            end if
            value = number
            return
        end if
        call text_of(place, node, text, is_one)
        if (.not. is_one) then
            call refuse_value(place, key, node, "is "//node%kind_text()//" (expected "//expected_text(quantity)//")", status)
            return
        end if
        call quantity_of_text(text, quantity, place%variables, number, problem)
        if (problem /= "") then
            call refuse_value(place, key, node, "= "//problem//" (expected "//expected_text(quantity)//")", status)
            return
        end if
        value = number
    end subroutine quantity_of

    !> As many quantities as `values` has elements, as a list under a key.
    subroutine get_vector(place, key, quantity, values, status, found)
        type(scene_place), intent(in) :: place
        character(len=*), intent(in) :: key
        type(quantity_type), intent(in) :: quantity
        real(wp), intent(inout) :: values(:)           !! SI; left alone if the key is not there
        type(status_type), intent(inout) :: status
        logical, intent(out), optional :: found
        type(toml_node) :: node

        if (present(found)) found = .false.
        if (.not. status%is_ok()) return
        node = place%node%get(key)
        if (present(found)) found = node%is_present()
        if (node%is_present()) then
            call vector_of(place, key, node, quantity, values, status)
        else if (.not. present(found)) then
            call refuse_missing(place, key, vector_text(quantity, size(values)), status)
        end if
    end subroutine get_vector

    !> As many quantities as `values` has elements, from a list.
    subroutine vector_of(place, key, node, quantity, values, status)
        type(scene_place), intent(in) :: place
        character(len=*), intent(in) :: key
        type(toml_node), intent(in) :: node
        type(quantity_type), intent(in) :: quantity
        real(wp), intent(inout) :: values(:)           !! SI
        type(status_type), intent(inout) :: status
        integer :: i

        if (.not. status%is_ok()) return
        if (node%kind() /= toml_array) then
            call refuse_value(place, key, node, "is "//node%kind_text()//" (expected "// &
                vector_text(quantity, size(values))//")", status)
        else if (node%count() /= size(values)) then
            call refuse_value(place, key, node, "has "//counted(node%count(), "element")//" (expected "// &
                vector_text(quantity, size(values))//")", status)
        else
            do i = 1, size(values)
                call quantity_of(place, key, node%at(i), quantity, values(i), status)
            end do
        end if
    end subroutine vector_of

    !> Quantities from a list of any length.
    subroutine list_of(place, key, node, quantity, values, status)
        type(scene_place), intent(in) :: place
        character(len=*), intent(in) :: key
        type(toml_node), intent(in) :: node
        type(quantity_type), intent(in) :: quantity
        real(wp), allocatable, intent(out) :: values(:)
        type(status_type), intent(inout) :: status
        integer :: i

        allocate (values(node%count()))
        if (.not. status%is_ok()) return
        if (node%kind() /= toml_array) then
            call refuse_value(place, key, node, "is "//node%kind_text()//" (expected a list, each "// &
                expected_text(quantity)//")", status)
            return
        end if
        values = 0
        do i = 1, size(values)
            call quantity_of(place, key, node%at(i), quantity, values(i), status)
        end do
    end subroutine list_of

    !> A unit vector under a key; the file may give it at any length but zero.
    subroutine get_direction(place, key, axis, status, found)
        type(scene_place), intent(in) :: place
        character(len=*), intent(in) :: key
        real(wp), intent(inout) :: axis(:)             !! left alone if the key is not there
        type(status_type), intent(inout) :: status
        logical, intent(out) :: found
        type(toml_node) :: node

        found = .false.
        if (.not. status%is_ok()) return
        node = place%node%get(key)
        found = node%is_present()
        if (found) call direction_of(place, key, node, axis, status)
    end subroutine get_direction

    !> A unit vector from a list.
    subroutine direction_of(place, key, node, axis, status)
        type(scene_place), intent(in) :: place
        character(len=*), intent(in) :: key
        type(toml_node), intent(in) :: node
        real(wp), intent(inout) :: axis(:)
        type(status_type), intent(inout) :: status
        type(quantity_type), parameter :: component = quantity_type(name="a number", example="0.5", unit="1")
        real(wp) :: given(size(axis)), largest

        if (.not. status%is_ok()) return
        given = 0
        call vector_of(place, key, node, component, given, status)
        if (.not. status%is_ok()) return
        largest = maxval(abs(given))
        if (.not. largest > 0) then
            call refuse_value(place, key, node, "has length zero (expected a direction, for example "// &
                trim(merge("[1, 0]   ", "[0, 0, 1]", size(axis) == 2))//")", status)
            return
        end if
        given = given/largest
        axis = given/norm2(given)
    end subroutine direction_of

    !> A text under a key. Without `found`, the key must be there.
    subroutine get_text(place, key, value, status, found)
        type(scene_place), intent(in) :: place
        character(len=*), intent(in) :: key
        character(len=:), allocatable, intent(out) :: value
        type(status_type), intent(inout) :: status
        logical, intent(out), optional :: found
        type(toml_node) :: node
        logical :: is_one

        value = ""
        if (present(found)) found = .false.
        if (.not. status%is_ok()) return
        node = place%node%get(key)
        if (present(found)) found = node%is_present()
        if (.not. node%is_present()) then
            if (.not. present(found)) call refuse_missing(place, key, "a text in quotes", status)
            return
        end if
        call text_of(place, node, value, is_one)
        if (.not. is_one) call refuse_value(place, key, node, "is "//node%kind_text()//" (expected a text in quotes)", status)
    end subroutine get_text

    !> A text of a table; in a copy with the copy's number for `#`.
    subroutine text_of(place, node, text, is_one)
        type(scene_place), intent(in) :: place
        type(toml_node), intent(in) :: node
        character(len=:), allocatable, intent(out) :: text
        logical, intent(out) :: is_one                 !! the node is a text
        character(len=:), allocatable :: rest
        integer :: i

        call node%get_text(text, is_one)
        if (place%copy == 0 .or. .not. is_one) return
        rest = text
        text = ""
        do
            i = index(rest, "#")
            if (i == 0) exit
            text = text//rest(:i - 1)//to_text(place%copy)
            rest = rest(i + 1:)
        end do
        text = text//rest
    end subroutine text_of

    !> The name of a copy: with its number behind it, unless it has the number already.
    function numbered(place, node, text) result(name)
        type(scene_place), intent(in) :: place
        type(toml_node), intent(in) :: node
        character(len=*), intent(in) :: text
        character(len=:), allocatable :: name, written
        logical :: is_one

        call node%get_text(written, is_one)
        name = text
        if (place%copy > 0 .and. index(written, "#") == 0) name = text//to_text(place%copy)
    end function numbered

    !> A name under a key: a text of reasonable length without blanks or control characters.
    subroutine get_name(place, key, value, status, found)
        type(scene_place), intent(in) :: place
        character(len=*), intent(in) :: key
        character(len=name_len), intent(inout) :: value
        type(status_type), intent(inout) :: status
        logical, intent(out), optional :: found
        character(len=:), allocatable :: text
        type(toml_node) :: node

        node = place%node%get(key)
        call get_text(place, key, text, status, found)
        if (present(found)) then
            if (.not. found) return
        end if
        if (key == "name" .and. status%is_ok()) text = numbered(place, node, text)
        call require_name(place, text, node%line(), status)
        if (status%is_ok()) value = text
    end subroutine get_name

    !> Refuse what cannot serve as a name.
    subroutine require_name(place, text, line, status)
        type(scene_place), intent(in) :: place
        character(len=*), intent(in) :: text
        integer, intent(in) :: line
        type(status_type), intent(inout) :: status
        integer :: i

        if (.not. status%is_ok()) return
        if (len(text) == 0) then
            call refuse(place, "a name is empty (expected 1 to "//to_text(name_len)//" letters)", status, line)
        else if (len(text) > name_len) then
            call refuse(place, "the name "//quoted(text)//" is too long (expected 1 to "//to_text(name_len)// &
                " letters; those beyond a to z count as two to four)", status, line)
        else
            do i = 1, len(text)
                if (iachar(text(i:i)) > 32 .and. iachar(text(i:i)) /= 127) cycle
                call refuse(place, "the name "//quoted(text)//" holds a blank or control character "// &
                    "(expected letters, digits, signs)", status, line)
                return
            end do
        end if
    end subroutine require_name

    !> One of some words under a key: its number. Without `found`, the key must be there.
    subroutine get_word(place, key, words, choice, status, found)
        type(scene_place), intent(in) :: place
        character(len=*), intent(in) :: key
        character(len=*), intent(in) :: words(:)
        integer, intent(inout) :: choice               !! left alone if the key is not there
        type(status_type), intent(inout) :: status
        logical, intent(out), optional :: found
        character(len=:), allocatable :: text
        type(toml_node) :: node
        integer :: i

        if (present(found)) found = .false.
        if (.not. status%is_ok()) return
        node = place%node%get(key)
        if (present(found)) found = node%is_present()
        if (.not. node%is_present()) then
            if (.not. present(found)) call refuse_missing(place, key, "one of "//join(words), status)
            return
        end if
        call get_text(place, key, text, status)
        if (.not. status%is_ok()) return
        do i = 1, size(words)
            if (text /= words(i)) cycle
            choice = i
            return
        end do
        call refuse_value(place, key, node, "= "//quoted(text)//" is unknown (expected one of "//join(words)//")" &
            //suggestion(text, words), status)
    end subroutine get_word

    !> true or false under a key.
    subroutine get_flag(place, key, value, status)
        type(scene_place), intent(in) :: place
        character(len=*), intent(in) :: key
        logical, intent(inout) :: value                !! left alone if the key is not there
        type(status_type), intent(inout) :: status
        type(toml_node) :: node
        logical :: flag, is_one

        if (.not. status%is_ok()) return
        node = place%node%get(key)
        if (.not. node%is_present()) return
        call node%get_flag(flag, is_one)
        if (is_one) then
            value = flag
        else
            call refuse_value(place, key, node, "is "//node%kind_text()//" (expected true or false)", status)
        end if
    end subroutine get_flag

    !> An integer under a key.
    subroutine get_integer(place, key, value, status, found)
        type(scene_place), intent(in) :: place
        character(len=*), intent(in) :: key
        integer, intent(inout) :: value                !! left alone if the key is not there
        type(status_type), intent(inout) :: status
        logical, intent(out) :: found
        type(toml_node) :: node
        integer :: number
        logical :: is_one

        found = .false.
        if (.not. status%is_ok()) return
        node = place%node%get(key)
        found = node%is_present()
        if (.not. found) return
        call node%get_integer(number, is_one)
        if (is_one) then
            value = number
        else if (node%is_number()) then
            call refuse_value(place, key, node, "is not an integer, or too large (expected an integer)", status)
        else
            call refuse_value(place, key, node, "is "//node%kind_text()//" (expected an integer)", status)
        end if
    end subroutine get_integer

    !> "a length, for example '12 mm'"
    pure function expected_text(quantity) result(text)
        type(quantity_type), intent(in) :: quantity
        character(len=:), allocatable :: text

        text = trim(quantity%name)
        if (any(quantity%power /= 0)) then
            text = text//", for example "//quoted(quantity%example)
            if (quantity%unit /= "") text = text//" or a number in "//trim(quantity%unit)
        else
            text = text//", for example "//trim(quantity%example)
        end if
    end function expected_text

    pure function vector_text(quantity, n) result(text)
        type(quantity_type), intent(in) :: quantity
        integer, intent(in) :: n
        character(len=:), allocatable :: text

        text = "a list of "//to_text(n)//", each "//expected_text(quantity)
    end function vector_text

    !> "1 element", "3 elements"
    pure function counted(n, noun) result(text)
        integer, intent(in) :: n
        character(len=*), intent(in) :: noun
        character(len=:), allocatable :: text

        text = to_text(n)//" "//noun
        if (n /= 1) text = text//"s"
    end function counted
end module linkdyn_scene_keys
