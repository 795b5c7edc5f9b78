!> Tables in CSV files: a header row with column names, then numbers.
!>
!> A column name may carry its unit in brackets: `roll [deg]`. Blank lines and lines that start with
!> `#` are passed over. Fields are separated by commas, or by the semicolons or tabs of the header; those within double
!> quotes are text, as in names that hold a comma. What spreadsheets
!> write otherwise (decimal commas, units in round brackets or in a row of their own) is refused with its remedy.
module linkdyn_csv
    use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan
    use linkdyn_kinds, only: wp
    use linkdyn_status, only: status_type, status_bad_input, fail
    use linkdyn_text, only: to_text, quoted, join
    use linkdyn_scene, only: table_spec, name_len
    use linkdyn_input, only: is_utf16, read_file_text, parse_number
    use linkdyn_suggest, only: suggestion
    use linkdyn_units, only: is_unit
    implicit none (type, external)
    private
    public :: read_csv, parse_csv, column_of, as_shown, unit_behind

    character(len=*), parameter :: newline = achar(10), tab = achar(9), return_sign = achar(13)

contains

    !> Read a table from a file.
    subroutine read_csv(file, where, table, status, takes_text, is_foreign, but_in)
        character(len=*), intent(in) :: file
        character(len=*), intent(in) :: where     !! start of the message if the file cannot be read
        type(table_spec), intent(out) :: table
        type(status_type), intent(inout) :: status
        logical, intent(in), optional :: takes_text    !! a field that is no number is NaN; absent: a failure
        logical, intent(in), optional :: is_foreign    !! messages must not quote it
        character(len=*), intent(in), optional :: but_in    !! column of numbers, though the others take text
        character(len=:), allocatable :: text

        call read_file_text(file, where, text, status)
        if (status%is_ok()) call parse_csv(text, file, table, status, takes_text, is_foreign, but_in)
    end subroutine read_csv

    !> Read a table from a text.
    subroutine parse_csv(text, file, table, status, takes_text, is_foreign, but_in)
        character(len=*), intent(in) :: text
        character(len=*), intent(in) :: file      !! for messages
        type(table_spec), intent(out) :: table
        type(status_type), intent(inout) :: status
        logical, intent(in), optional :: takes_text, is_foreign    !! as in `read_csv`
        character(len=*), intent(in), optional :: but_in
        character(len=1) :: separator
        logical, allocatable :: is_strict(:)           !! nothing but finite numbers in a column
        integer :: n_row, n_column, line, first, last, next, row, most_rows

        table%file = file
        if (present(is_foreign)) table%is_foreign = is_foreign
        if (is_utf16(text)) then
            call fail(status, status_bad_input, trim(file)//": this is UTF-16 (expected a text saved as UTF-8)")
            return
        end if
        if (index(text, "PK"//achar(3)//achar(4)) == 1) then
            call fail(status, status_bad_input, trim(file)//": this is a workbook or archive (expected it saved as CSV)")
            return
        end if
        next = 1
        if (len(text) >= 3) then
            if (text(1:3) == char(239)//char(187)//char(191)) next = 4   ! byte order mark
        end if
        line = 0
        call next_line(text, next, line, first, last)
        if (last < first) then
            call fail(status, status_bad_input, trim(file)//": the table is empty (expected a header row with column names)")
            return
        end if
        call read_header(text(first:last), file, line, table, separator, status)
        if (.not. status%is_ok()) return
        n_column = size(table%column)
        allocate (is_strict(n_column), source=.true.)
        if (present(takes_text)) is_strict = .not. takes_text
        if (present(but_in)) is_strict = is_strict .or. table%column == but_in
        most_rows = n_line(text(next:))
        allocate (table%value(most_rows, n_column), table%line(most_rows))
        row = 0
        do
            call next_line(text, next, line, first, last)
            if (last < first) exit
            row = row + 1
            table%line(row) = line
            call read_row(text(first:last), separator, row, is_strict, table, status)
            if (.not. status%is_ok()) return
        end do
        n_row = row
        if (n_row == 0) call fail(status, status_bad_input, trim(file)//": the table has no rows below its header")
        if (n_row == most_rows) return
        table%value = table%value(:n_row, :)
        table%line = table%line(:n_row)
    end subroutine parse_csv

    !> The number of a column; 0 and a failure if the table has none of that name.
    subroutine column_of(table, name, column, status)
        type(table_spec), intent(in) :: table
        character(len=*), intent(in) :: name
        integer, intent(out) :: column
        type(status_type), intent(inout) :: status

        do column = 1, size(table%column)
            if (table%column(column) == name) return
        end do
        column = 0
        if (table%is_foreign) then
            call fail(status, status_bad_input, trim(table%file)//": no column "//quoted(name))
        else
            call fail(status, status_bad_input, trim(table%file)//": no column "//quoted(name)// &
                " (found "//join(table%column)//bracket_hint(table, name)//")")
        end if
    end subroutine column_of

    !> The remedy if a column has the name and then its unit, but not in square brackets; else the name that is nearest.
    function bracket_hint(table, name) result(hint)
        type(table_spec), intent(in) :: table
        character(len=*), intent(in) :: name
        character(len=:), allocatable :: hint, unit
        integer :: i

        hint = suggestion(name, table%column)
        do i = 1, size(table%column)
            unit = unit_behind(table%column(i), name)
            if (unit == "") cycle
            hint = "; the unit belongs in square brackets: '"//trim(name)//" ["//unit//"]'"
            return
        end do
    end function bracket_hint

    !> The unit that a column has behind its name, but not in square brackets: "x (mm)", "x_mm", "x / mm"; empty: none.
    pure function unit_behind(column, name) result(unit)
        character(len=*), intent(in) :: column, name
        character(len=:), allocatable :: unit, rest

        unit = ""
        if (index(column, trim(name)) /= 1) return
        rest = trim(column(len_trim(name) + 1:))//" "
        if (scan(rest(1:1), " (/_,-") == 0) return
        unit = word_in(rest, " ()_,-")
        if (index(unit, "/") == 1) unit = unit(2:)
        if (index(unit, "in ") == 1) unit = unit(4:)
        if (.not. is_unit(unit)) unit = ""
    end function unit_behind

    !> What stands in a table, for a message: a scene from elsewhere must not make us read out any file of the machine.
    pure function as_shown(table, content) result(text)
        type(table_spec), intent(in) :: table
        character(len=*), intent(in) :: content
        character(len=:), allocatable :: text

        text = "(not shown: the file lies outside the scene's folder)"
        if (.not. table%is_foreign) text = quoted(content)
    end function as_shown

    !> Names, units and separator from the header row.
    subroutine read_header(text, file, line, table, separator, status)
        character(len=*), intent(in) :: text, file
        integer, intent(in) :: line
        type(table_spec), intent(inout) :: table
        character(len=1), intent(out) :: separator
        type(status_type), intent(inout) :: status
        character(len=len(text)) :: bare
        character(len=:), allocatable :: where, field
        integer :: n, i, first, last, bracket

        where = trim(file)//":"//to_text(line)//": "
        call blank_quoted(text, bare)
        separator = ","
        if (index(bare, ",") == 0 .and. index(bare, ";") > 0) separator = ";"
        if (scan(bare, ",;") == 0 .and. index(bare, tab) > 0) separator = tab
        n = 1
        do i = 1, len(bare)
            if (bare(i:i) == separator) n = n + 1
        end do
        allocate (table%column(n), table%unit(n))
        first = 1
        do i = 1, n
            last = field_end(bare, first, separator)
            field = unquoted(text(first:last))
            table%unit(i) = ""
            bracket = index(field, "[", back=.true.)
            if (bracket > 0 .and. index(field, "]", back=.true.) == len(field)) then
                table%unit(i) = field(bracket + 1:len(field) - 1)
                field = trim(field(:bracket - 1))
            end if
            table%column(i) = field
            if (field == "") then
                call fail(status, status_bad_input, where//"column "//to_text(i)//" has no name")
            else if (len(field) > name_len) then
                call fail(status, status_bad_input, where//"the name of column "//to_text(i)//" is longer than " &
                    //to_text(name_len)//" letters")
            else if (verify(field, "+-.,;0123456789eE") == 0) then
                call fail(status, status_bad_input, where//"the header holds the number "//as_shown(table, field)// &
                    " (expected a first row with column names)")
            else if (any(table%column(:i - 1) == field)) then
                call fail(status, status_bad_input, where//"two columns are called "//as_shown(table, field))
            end if
            first = last + 2
        end do
    end subroutine read_header

    !> The numbers of a row.
    subroutine read_row(text, separator, row, is_strict, table, status)
        character(len=*), intent(in) :: text
        character(len=1), intent(in) :: separator
        integer, intent(in) :: row
        logical, intent(in) :: is_strict(:)       !! nothing but finite numbers in a column
        type(table_spec), intent(inout) :: table
        type(status_type), intent(inout) :: status
        character(len=len(text)) :: bare
        real(wp) :: value
        integer :: i, first, last, n_used, n_column

        n_column = size(table%column)
        call blank_quoted(text, bare)
        first = 1
        last = 0
        do i = 1, n_column
            last = field_end(bare, first, separator)
            if (i < n_column .and. last == len(text)) then
                call refuse_row("has "//to_text(i)//" of "//to_text(n_column)//" fields (expected all)")
                return
            end if
            call parse_field(text(first:last), value, n_used)
            if (.not. is_strict(i)) then
                if (n_used == 0) value = ieee_value(value, ieee_quiet_nan)
            else if (n_used == 0) then
                call refuse_value(as_shown(table, adjustl(text(first:last)))//" is not a number ("// &
                                  remedy(text(first:last))//")")
                return
            else if (.not. abs(value) <= huge(value)) then
                call refuse_value(as_shown(table, adjustl(text(first:last)))//" is not a finite number (expected one)")
                return
            end if
            table%value(row, i) = value
            first = last + 2
        end do
        if (last < len(text)) call refuse_row("has more than "//to_text(n_column)//" fields (expected no more"//comma_hint()//")")

    contains

        !> The remedy for a value that is no number.
        function remedy(content) result(hint)
            character(len=*), intent(in) :: content
            character(len=:), allocatable :: hint

            hint = "expected one"
            if (scan(content, """'") > 0) hint = "expected numbers without quotes"
            if (is_decimal_comma(content)) then
                hint = "expected a decimal point, not a comma"
            else if (row == 1 .and. is_unit(word_in(content, "[]() "))) then
                hint = "expected the unit behind the column's name: x [mm]"
            end if
        end function remedy

        !> Each number with a decimal comma makes two fields out of one.
        function comma_hint() result(hint)
            character(len=:), allocatable :: hint
            integer :: k

            hint = ""
            if (separator /= ",") return
            if (count([(text(k:k) == separator, k=1, len(text))]) + 1 > 2*n_column) return
            if (verify(text, " +-.,0123456789eE"//tab) == 0) &
                hint = "; if these are decimal commas: a decimal point, or semicolons between the fields and decimal points"
        end function comma_hint

        subroutine refuse_row(problem)
            character(len=*), intent(in) :: problem

            call fail(status, status_bad_input, trim(table%file)//":"//to_text(table%line(row))//": the row "//problem)
        end subroutine refuse_row

        subroutine refuse_value(problem)
            character(len=*), intent(in) :: problem

            character(len=:), allocatable :: column

            column = to_text(i)
            if (.not. table%is_foreign) column = quoted(table%column(i))
            call fail(status, status_bad_input, trim(table%file)//":"//to_text(table%line(row))//": column "//column//": " &
                //problem)
        end subroutine refuse_value
    end subroutine read_row

    !> A number that fills its field but for blanks; `n_used` = 0 if it is none.
    pure subroutine parse_field(text, value, n_used)
        character(len=*), intent(in) :: text
        real(wp), intent(out) :: value
        integer, intent(out) :: n_used
        integer :: first, last

        value = 0
        n_used = 0
        last = len_trim(text)
        do first = 1, last
            if (text(first:first) /= " " .and. text(first:first) /= tab) exit
        end do
        if (first > last) return
        call parse_number(text(first:last), value, n_used)
        if (n_used /= last - first + 1) n_used = 0
    end subroutine parse_field

    !> "1,5": a number but for its comma.
    pure logical function is_decimal_comma(text)
        character(len=*), intent(in) :: text
        character(len=len(text)) :: copy
        real(wp) :: value
        integer :: comma, n_used

        comma = index(text, ",")
        is_decimal_comma = .false.
        if (comma == 0) return
        copy = text
        copy(comma:comma) = "."
        call parse_field(copy, value, n_used)
        is_decimal_comma = n_used > 0
    end function is_decimal_comma

    !> A text without the characters given around it.
    pure function word_in(text, around) result(word)
        character(len=*), intent(in) :: text, around
        character(len=:), allocatable :: word

        word = text(max(1, verify(text, around)):verify(text, around, back=.true.))
    end function word_in

    !> The next line that says something, without its end; `last` < `first` when there is none.
    pure subroutine next_line(text, next, line, first, last)
        character(len=*), intent(in) :: text
        integer, intent(inout) :: next            !! where to go on
        integer, intent(inout) :: line            !! number of the line found
        integer, intent(out) :: first, last
        integer :: line_end

        do while (next <= len(text))
            line = line + 1
            first = next
            line_end = field_end(text, first, newline)
            next = line_end + 2
            last = line_end
            do while (last >= first)
                if (scan(text(last:last), " "//tab//return_sign) == 0) exit
                last = last - 1
            end do
            do while (first <= last)
                if (text(first:first) /= " ") exit
                first = first + 1
            end do
            if (first > last) cycle
            if (text(first:first) /= "#") return
        end do
        first = 1
        last = 0
    end subroutine next_line

    !> Number of lines in a text; a newline at its very end starts none.
    pure integer function n_line(text)
        character(len=*), intent(in) :: text
        integer :: i

        n_line = min(len(text), 1)
        do i = 1, len(text) - 1
            if (text(i:i) == newline) n_line = n_line + 1
        end do
    end function n_line

    !> Position of the last character of the field that starts at `first`.
    pure integer function field_end(text, first, separator) result(last)
        character(len=*), intent(in) :: text
        integer, intent(in) :: first
        character(len=1), intent(in) :: separator

        do last = first, len(text)
            if (text(last:last) == separator) exit
        end do
        last = last - 1
    end function field_end

    !> A line whose double quotes, and what stands between them, are blanks; a quote that nothing closes is a letter.
    pure subroutine blank_quoted(text, bare)
        character(len=*), intent(in) :: text
        character(len=*), intent(out) :: bare     !! as long as the text
        integer :: first, length

        bare = text
        first = index(bare, '"')
        do while (first > 0)
            length = index(bare(first + 1:), '"')
            if (length == 0) return
            bare(first:first + length) = " "
            first = index(bare, '"')
        end do
    end subroutine blank_quoted

    !> A header field without blanks and double quotes around it; two quotes within these are one.
    pure function unquoted(text) result(field)
        character(len=*), intent(in) :: text
        character(len=:), allocatable :: field
        integer :: i

        field = trim(adjustl(text))
        if (len(field) < 2) return
        if (field(1:1) /= '"' .or. field(len(field):) /= '"') return
        field = trim(adjustl(field(2:len(field) - 1)))
        i = index(field, '""')
        do while (i > 0)
            field = field(:i)//field(i + 2:)
            i = following(field, i + 1)
        end do

    contains

        !> Where the next two quotes stand, from a place on; 0 if nowhere.
        pure integer function following(content, from) result(place)
            character(len=*), intent(in) :: content
            integer, intent(in) :: from

            place = index(content(from:), '""')
            if (place > 0) place = place + from - 1
        end function following
    end function unquoted
end module linkdyn_csv
