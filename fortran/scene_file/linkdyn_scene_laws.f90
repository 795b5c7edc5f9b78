!> Laws of time in a scene file, and the tables they take their columns from.
module linkdyn_scene_laws
    use linkdyn_kinds, only: wp
    use linkdyn_status, only: status_type, status_bad_input, fail
    use linkdyn_text, only: to_text, quoted
    use linkdyn_scene, only: law_spec, table_spec, law_book, path_len, law_constant, law_constant_rate, &
        law_cycloidal_start, law_cycloidal, law_polynomial_345, law_harmonic, law_table
    use linkdyn_spline, only: fit_spline
    use linkdyn_toml, only: toml_node, toml_table
    use linkdyn_units, only: quantity_type, per_second, unit_factor, time_span, angle, angular_rate
    use linkdyn_input, only: path_in_folder
    use linkdyn_path, only: is_inside
    use linkdyn_csv, only: read_csv, column_of, as_shown
    use linkdyn_scene_keys, only: scene_place, place_at, place_text, refuse, refuse_value, refuse_missing, counted, allow_keys, &
        get_quantity, quantity_of, list_of, get_text, get_word
    implicit none (type, external)
    private
    public :: table_shelf, files_of, name_reader, read_law, law_of_column, column_in_si, table_law, constant_law
    public :: spline, straight_lines, table_reading, read_table_keys, take_table, has_column, require_positive

    integer, parameter :: spline = 1           !! between rows: cubic spline with continuous acceleration
    integer, parameter :: straight_lines = 2   !! between rows: straight lines
    character(len=15), parameter :: law_name(7) = [character(len=15) :: "constant", "constant-rate", &
        "cycloidal-start", "cycloidal", "polynomial-345", "harmonic", "table"]
    character(len=13), parameter :: table_key(5) = [character(len=13) :: "law", "table", "column", "time", &
        "interpolation"]

    type :: shelf_place
        type(table_spec), allocatable :: table
        character(len=:), allocatable :: reader        !! file, line and part of the scene that took it last
    end type shelf_place

    !> The tables read so far: six columns of one file are one reading.
    type :: table_shelf
        character(len=path_len) :: folder = ""         !! of the scene file, where names of tables start
        type(shelf_place), allocatable :: place(:)
        type(law_book) :: book                         !! laws over the state that were read
    end type table_shelf

    !> How to read columns of a table.
    type :: table_reading
        integer :: table = 0                           !! on the shelf
        character(len=64) :: time = "t"                !! column of the instants
        integer :: interpolation = spline
    end type table_reading

contains

    !> A law from a number, a text with unit, or a table with the key `law` or `table`.
    recursive subroutine read_law(place, key, node, quantity, start, usual_column, interpolation, shelf, law, status)
        type(scene_place), intent(in) :: place
        character(len=*), intent(in) :: key            !! what to call the law in messages
        type(toml_node), intent(in) :: node
        type(quantity_type), intent(in) :: quantity    !! what the law gives
        real(wp), intent(in) :: start                  !! where it starts if it does not say so itself
        character(len=*), intent(in) :: usual_column   !! of a table that names none; blank: it must
        integer, intent(in) :: interpolation           !! of a table that does not say
        type(table_shelf), intent(inout) :: shelf
        type(law_spec), intent(out) :: law
        type(status_type), intent(inout) :: status
        type(scene_place) :: inner
        type(toml_node) :: table_node
        integer :: kind
        logical :: found

        if (.not. status%is_ok()) return
        if (node%kind() /= toml_table) then
            law = constant_law(start)
            call quantity_of(place, key, node, quantity, law%value(1), status)
            return
        end if
        inner = place_at(place, node, trim(place%what)//", "//key)
        table_node = node%get("table")
        kind = law_table
        call get_word(inner, "law", law_name, kind, status, found)
        if (status%is_ok() .and. .not. (found .or. table_node%is_present())) &
            call refuse_missing(inner, "law", "law = ""harmonic"", ""cycloidal"", ..., or table = ""file.csv""", status)
        law%kind = kind
        law%value(1) = start
        if (.not. status%is_ok()) return
        select case (kind)
        case (law_constant)
            call allow_keys(inner, [character(len=5) :: "law", "value"], status)
            call get_quantity(inner, "value", quantity, law%value(1), status)
        case (law_constant_rate)
            call allow_keys(inner, [character(len=5) :: "law", "rate", "start"], status)
            call get_quantity(inner, "rate", per_second(quantity), law%value(2), status)
            call get_quantity(inner, "start", quantity, law%value(1), status, found)
        case (law_cycloidal_start)
            call allow_keys(inner, [character(len=8) :: "law", "speed", "duration", "start"], status)
            call get_quantity(inner, "speed", per_second(quantity), law%value(2), status)
            call get_quantity(inner, "duration", time_span, law%value(3), status)
            call require_positive(inner, "duration", law%value(3), "s", status)
            call get_quantity(inner, "start", quantity, law%value(1), status, found)
        case (law_cycloidal, law_polynomial_345)
            call read_rest_to_rest(inner, quantity, start, law, status)
        case (law_harmonic)
            call allow_keys(inner, [character(len=9) :: "law", "mean", "amplitude", "frequency", "phase"], status)
            law%value(1) = 0
            call get_quantity(inner, "mean", quantity, law%value(1), status, found)
            call get_quantity(inner, "amplitude", quantity, law%value(2), status)
            call get_quantity(inner, "frequency", angular_rate, law%value(3), status)
            call get_quantity(inner, "phase", angle, law%value(4), status, found)
        case (law_table)
            call read_table_law(inner, quantity, usual_column, interpolation, shelf, law, status)
        end select
    end subroutine read_law

    !> Knots of a motion from rest to rest: two of them by from, to, begin, duration, or lists.
    subroutine read_rest_to_rest(place, quantity, start, law, status)
        type(scene_place), intent(in) :: place
        type(quantity_type), intent(in) :: quantity
        real(wp), intent(in) :: start
        type(law_spec), intent(inout) :: law
        type(status_type), intent(inout) :: status
        type(toml_node) :: times, values
        real(wp) :: begin, duration, ends(2)
        logical :: found
        integer :: i

        times = place%node%get("times")
        values = place%node%get("values")
        if (times%is_present() .or. values%is_present()) then
            call allow_keys(place, [character(len=6) :: "law", "times", "values"], status)
            if (.not. times%is_present()) call refuse_missing(place, "times", "a list of instants in s", status)
            if (.not. values%is_present()) call refuse_missing(place, "values", "a list, each "//quantity%name, status)
            call list_of(place, "times", times, time_span, law%time, status)
            call list_of(place, "values", values, quantity, law%knot, status)
            if (.not. status%is_ok()) return
            if (size(law%time) < 2) then
                call refuse_value(place, "times", times, "has fewer than two elements (expected two or more)", status)
            else if (size(law%knot) /= size(law%time)) then
                call refuse_value(place, "values", values, "has "//counted(size(law%knot), "element")//" (expected "// &
                    to_text(size(law%time))//", as many as 'times')", status)
            end if
            do i = 2, size(law%time)
                if (law%time(i) > law%time(i - 1)) cycle
                call refuse_value(place, "times", times, "does not increase: "//to_text(law%time(i))//" s follows "// &
                    to_text(law%time(i - 1))//" s (expected increasing times)", status)
                return
            end do
        else
            call allow_keys(place, [character(len=8) :: "law", "from", "to", "duration", "begin", "times", "values"], status)
            ends(1) = start
            begin = 0
            duration = 0
            call get_quantity(place, "from", quantity, ends(1), status, found)
            call get_quantity(place, "to", quantity, ends(2), status)
            call get_quantity(place, "duration", time_span, duration, status)
            call require_positive(place, "duration", duration, "s", status)
            call get_quantity(place, "begin", time_span, begin, status, found)
            if (.not. status%is_ok()) return
            law%time = [begin, begin + duration]
            law%knot = ends
        end if
    end subroutine read_rest_to_rest

    !> One column of a table.
    subroutine read_table_law(place, quantity, usual_column, interpolation, shelf, law, status)
        type(scene_place), intent(in) :: place
        type(quantity_type), intent(in) :: quantity
        character(len=*), intent(in) :: usual_column
        integer, intent(in) :: interpolation
        type(table_shelf), intent(inout) :: shelf
        type(law_spec), intent(out) :: law
        type(status_type), intent(inout) :: status
        type(table_reading) :: reading
        character(len=:), allocatable :: column
        logical :: found

        call allow_keys(place, table_key, status)
        call read_table_keys(place, interpolation, shelf, reading, status)
        call get_text(place, "column", column, status, found)
        if (.not. status%is_ok()) return
        if (.not. found) then
            column = trim(usual_column)
            if (column == "") call refuse_missing(place, "column", "the name of a column of the table", status)
        end if
        call law_of_column(shelf, reading, column, quantity, law, status)
    end subroutine read_table_law

    !> The keys `table`, `time` and `interpolation`; the table comes onto the shelf.
    subroutine read_table_keys(place, interpolation, shelf, reading, status)
        type(scene_place), intent(in) :: place
        integer, intent(in) :: interpolation           !! if the file does not say
        type(table_shelf), intent(inout) :: shelf
        type(table_reading), intent(out) :: reading
        type(status_type), intent(inout) :: status
        character(len=:), allocatable :: text
        logical :: found, names_time

        reading%interpolation = interpolation
        call get_text(place, "time", text, status, names_time)
        if (names_time) reading%time = text
        call get_word(place, "interpolation", [character(len=6) :: "spline", "linear"], reading%interpolation, status, found)
        call get_text(place, "table", text, status)
        if (status%is_ok()) call take_table(place, text, shelf, reading%table, status)
        if (status%is_ok() .and. .not. names_time) reading%time = usual_time(shelf%place(reading%table)%table, reading%time)
    end subroutine read_table_keys

    !> The column of the instants where none is named: the usual one, or that which results and other programs have.
    pure function usual_time(table, usual) result(name)
        type(table_spec), intent(in) :: table
        character(len=*), intent(in) :: usual
        character(len=len(usual)) :: name
        character(len=4), parameter :: other(3) = ["time", "Time", "TIME"]
        integer :: i

        name = usual
        if (any(table%column == usual)) return
        do i = 1, size(other)
            if (.not. any(table%column == other(i))) cycle
            name = other(i)
            return
        end do
    end function usual_time

    !> Read a file unless it was read before.
    subroutine take_table(place, file, shelf, i, status)
        type(scene_place), intent(in) :: place
        character(len=*), intent(in) :: file           !! as the scene names it
        type(table_shelf), intent(inout) :: shelf
        integer, intent(out) :: i                      !! the table's place on the shelf
        type(status_type), intent(inout) :: status
        type(shelf_place), allocatable :: longer(:)
        character(len=:), allocatable :: path, where
        integer :: j, n

        n = 0
        i = 0
        if (allocated(shelf%place)) n = size(shelf%place)
        path = path_in_folder(shelf%folder, file)
        do i = 1, n
            if (shelf%place(i)%table%file /= path) cycle
            shelf%place(i)%reader = reader_of(place)
            return
        end do
        allocate (longer(n + 1))
        do j = 1, n
            call move_alloc(shelf%place(j)%table, longer(j)%table)
            call move_alloc(shelf%place(j)%reader, longer(j)%reader)
        end do
        allocate (longer(n + 1)%table)
        call move_alloc(longer, shelf%place)
        if (len(path) > path_len) then
            call refuse(place, "table "//quoted(path(:24)//"...")//": the name of the file is longer than "//to_text(path_len) &
                //" letters", status)
            return
        end if
        shelf%place(n + 1)%reader = reader_of(place)
        where = reader_of(place)//": table "//quoted(path)
        call read_csv(path, where, shelf%place(n + 1)%table, status, is_foreign=.not. is_inside(path, trim(shelf%folder)))
    end subroutine take_table

    function reader_of(place) result(text)
        type(scene_place), intent(in) :: place
        character(len=:), allocatable :: text

        text = place_text(place, place%line)//": "//trim(place%what)
    end function reader_of

    !> Before a message that begins with a table: which part of the scene asked for it. Reading ends at the first failure, so that
    !> is who took the table last.
    subroutine name_reader(shelf, status)
        type(table_shelf), intent(in) :: shelf
        type(status_type), intent(inout) :: status
        integer :: i

        if (status%is_ok() .or. .not. allocated(shelf%place)) return
        do i = 1, size(shelf%place)
            if (.not. allocated(shelf%place(i)%reader)) cycle
            if (index(status%message, trim(shelf%place(i)%table%file)//":") /= 1) cycle
            status%message = shelf%place(i)%reader//": "//trim(status%message)
            return
        end do
    end subroutine name_reader

    !> Names of the files that were read.
    pure function files_of(shelf) result(files)
        type(table_shelf), intent(in) :: shelf
        character(len=path_len), allocatable :: files(:)
        integer :: i

        allocate (files(0))
        if (allocated(shelf%place)) files = [(shelf%place(i)%table%file, i=1, size(shelf%place))]
    end function files_of

    !> True if a table has a column of that name.
    logical function has_column(shelf, reading, column)
        type(table_shelf), intent(in) :: shelf
        type(table_reading), intent(in) :: reading
        character(len=*), intent(in) :: column

        has_column = any(shelf%place(reading%table)%table%column == column)
    end function has_column

    !> The law that a column of a table gives.
    subroutine law_of_column(shelf, reading, column, quantity, law, status)
        type(table_shelf), intent(in) :: shelf
        type(table_reading), intent(in) :: reading
        character(len=*), intent(in) :: column
        type(quantity_type), intent(in) :: quantity
        type(law_spec), intent(out) :: law
        type(status_type), intent(inout) :: status
        real(wp), allocatable :: time(:), knot(:)

        if (.not. status%is_ok()) return
        associate (table => shelf%place(reading%table)%table)
            call column_in_si(table, trim(reading%time), time_span, time, status)
            call column_in_si(table, column, quantity, knot, status)
            if (status%is_ok()) call table_law(table, trim(reading%time), time, knot, reading%interpolation, law, status)
        end associate
    end subroutine law_of_column

    !> The law that goes through the values of a table's rows.
    subroutine table_law(table, time_column, time, knot, interpolation, law, status, unit)
        type(table_spec), intent(in) :: table          !! for messages
        character(len=*), intent(in) :: time_column
        real(wp), intent(in) :: time(:), knot(:)       !! [s], SI
        integer, intent(in) :: interpolation           !! `spline` or `straight_lines`
        type(law_spec), intent(out) :: law
        type(status_type), intent(inout) :: status
        character(len=*), intent(in), optional :: unit !! of what the table is over; absent: s
        character(len=:), allocatable :: s
        integer :: i

        s = "s"
        if (present(unit)) s = unit
        law%kind = law_table
        law%time = time
        law%knot = knot
        do i = 2, size(time)
            if (time(i) > time(i - 1)) cycle
            call fail(status, status_bad_input, trim(table%file)//":"//to_text(table%line(i))//": column "// &
                quoted(time_column)//" does not increase: "//to_text(time(i))//" "//s//" follows "// &
                to_text(time(i - 1))//" "//s//" (expected increasing "//trim(merge("values", "times ", present(unit)))//")")
            return
        end do
        if (interpolation /= spline) return
        allocate (law%curvature(size(time)))
        call fit_spline(time, knot, law%curvature)
    end subroutine table_law

    !> A column, its unit turned into SI.
    subroutine column_in_si(table, column, quantity, values, status)
        type(table_spec), intent(in) :: table
        character(len=*), intent(in) :: column
        type(quantity_type), intent(in) :: quantity
        real(wp), allocatable, intent(out) :: values(:)
        type(status_type), intent(inout) :: status
        character(len=:), allocatable :: problem
        real(wp) :: factor
        integer :: i

        if (.not. status%is_ok()) return
        call column_of(table, column, i, status)
        if (.not. status%is_ok()) return
        call unit_factor(table%unit(i), quantity, factor, problem)
        if (problem /= "") then
            if (table%is_foreign) problem = "a unit that does not fit "//as_shown(table, table%unit(i))
            call fail(status, status_bad_input, trim(table%file)//": column "//quoted(column)//": "//problem// &
                " (expected the unit of "//trim(quantity%name)//")")
            return
        end if
        values = table%value(:, i)*factor
    end subroutine column_in_si

    !> A value that stays.
    pure type(law_spec) function constant_law(value) result(law)
        real(wp), intent(in) :: value

        law%kind = law_constant
        law%value(1) = value
    end function constant_law

    subroutine require_positive(place, key, value, unit, status)
        type(scene_place), intent(in) :: place
        character(len=*), intent(in) :: key, unit
        real(wp), intent(in) :: value
        type(status_type), intent(inout) :: status

        if (.not. status%is_ok() .or. value > 0) return
        call refuse_value(place, key, place%node%get(key), "= "//trim(to_text(value)//" "//unit)// &
            " (expected more than zero)", status)
    end subroutine require_positive
end module linkdyn_scene_laws
