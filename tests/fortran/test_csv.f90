!> linkdyn_csv: tables read as written, and what is no table refused with file and line.
module test_csv
    use linkdyn_kinds, only: wp
    use linkdyn_testing, only: test_error, unit_test, new_test, check, check_close
    use linkdyn_status, only: status_type
    use linkdyn_scene, only: table_spec
    use linkdyn_csv, only: parse_csv, column_of
    implicit none (type, external)
    private
    public :: collect_csv

    character(len=1), parameter :: lf = achar(10), tab = achar(9)
    character(len=2), parameter :: crlf = achar(13)//achar(10)

contains

    subroutine collect_csv(tests)
        type(unit_test), allocatable, intent(out) :: tests(:)

        tests = [ &
            new_test("plain table", test_plain), &
            new_test("line ends, blanks, comments", test_layout), &
            new_test("separators", test_separators), &
            new_test("refusals", test_refusals), &
            new_test("as spreadsheets write it", test_spreadsheets), &
            new_test("quoted names", test_quoted), &
            new_test("columns by name", test_columns), &
            new_test("long table", test_long)]
    end subroutine collect_csv

    subroutine test_plain(error)
        type(test_error), intent(inout) :: error
        type(table_spec) :: table
        type(status_type) :: status

        call parse_csv("t [ms],x"//lf//"0,1.5"//lf//"10,-2e-3"//lf, "a.csv", table, status)
        call check(error, status%is_ok(), status%message)
        call check(error, all(table%column == ["t", "x"]), "columns")
        call check(error, table%unit(1) == "ms" .and. table%unit(2) == "", "units")
        ! The nearest double of -0.002, in every build.
        call check_close(error, table%value, reshape([0.0_wp, 10.0_wp, 1.5_wp, real(-0.002d0, wp)], [2, 2]), 0.0_wp, "values")
        call check(error, all(table%line == [2, 3]), "lines")
    end subroutine test_plain

    subroutine test_layout(error)
        type(test_error), intent(inout) :: error
        type(table_spec) :: table
        type(status_type) :: status

        call parse_csv(char(239)//char(187)//char(191)//"# by hand"//crlf//crlf//' "t" , x [mm] '//crlf//"0 , +1"//crlf// &
            "  # half way"//crlf//"   "//crlf//tab//" 1,"//tab//"2", "a.csv", table, status)
        call check(error, status%is_ok(), status%message)
        call check(error, all(table%column == ["t", "x"]), "columns")
        call check_close(error, table%value, reshape([0.0_wp, 1.0_wp, 1.0_wp, 2.0_wp], [2, 2]), 0.0_wp, "values")
        call check(error, all(table%line == [4, 7]), "lines")
    end subroutine test_layout

    subroutine test_separators(error)
        type(test_error), intent(inout) :: error
        type(table_spec) :: table
        type(status_type) :: status

        call parse_csv("t;x"//lf//"0;1"//lf, "a.csv", table, status)
        call check(error, status%is_ok() .and. size(table%column) == 2, "semicolons "//status%message)
        call parse_csv("t"//tab//"x"//lf//"0"//tab//"1"//lf, "a.csv", table, status)
        call check(error, status%is_ok() .and. size(table%column) == 2, "tabs "//status%message)
        call expect(error, char(255)//char(254)//"t"//char(0), "a.csv: this is UTF-16 (expected a text saved as UTF-8)")
        call expect(error, "PK"//char(3)//char(4)//"xl"//lf, "a.csv: this is a workbook or archive (expected it saved as CSV)")
        call expect(error, "t;x"//lf//"0;1,5"//lf, "a.csv:2: column 'x': '1,5' is not a number")
        call expect(error, "t;x"//lf//"0;""1"""//lf, &
                    "a.csv:2: column 'x': '""1""' is not a number (expected numbers without quotes)")
    end subroutine test_separators

    subroutine test_refusals(error)
        type(test_error), intent(inout) :: error

        call expect(error, "", "a.csv: the table is empty")
        call expect(error, "# nothing"//lf, "a.csv: the table is empty")
        call expect(error, "t,x"//lf, "a.csv: the table has no rows")
        call expect(error, "t,"//lf//"0,1", "a.csv:1: column 2 has no name")
        call expect(error, "t,t"//lf//"0,1", "a.csv:1: two columns are called 't'")
        call expect(error, "0,1"//lf//"2,3", "a.csv:1: the header holds the number '0'")
        call expect(error, "t,x"//lf//"0,1"//lf//"1", "a.csv:3: the row has 1 of 2 fields")
        call expect(error, "t,x"//lf//"0,1,2", "a.csv:2: the row has more than 2 fields")
        call expect(error, "t,x"//lf//"0,", "a.csv:2: column 'x': '' is not a number")
        call expect(error, "t,x"//lf//"0,one", "a.csv:2: column 'x': 'one' is not a number")
        call expect(error, "t,x"//lf//"0,1 2", "a.csv:2: column 'x': '1 2' is not a number")
        call expect(error, "t,x"//lf//"0,0x10", "a.csv:2: column 'x': '0x10' is not a number")
        call expect(error, "t,x"//lf//"0,NaN", "a.csv:2: column 'x': 'NaN' is not a finite number")
        call expect(error, "t,x"//lf//"0,-inf", "a.csv:2: column 'x': '-inf' is not a finite number")
        call expect(error, "t,x"//lf//"0,1e400", "a.csv:2: column 'x': '1e400' is not a finite number")
    end subroutine test_refusals

    !> Decimal commas, units elsewhere than in square brackets: the message has the remedy.
    subroutine test_spreadsheets(error)
        type(test_error), intent(inout) :: error
        character(len=*), parameter :: comma = " is not a number (expected a decimal point, not a comma)"
        character(len=*), parameter :: unit_row = " is not a number (expected the unit behind the column's name: x [mm])"

        call expect(error, "t;x"//lf//"0;1,5"//lf, "a.csv:2: column 'x': '1,5'"//comma)
        call expect(error, "t;x"//lf//"0,1;-1,5e-3"//lf, "a.csv:2: column 't': '0,1'"//comma)
        call expect(error, "t;x"//lf//"0;1,5 m"//lf, "a.csv:2: column 'x': '1,5 m' is not a number (expected one)")
        call expect(error, "0;1,5"//lf//"1;1,6"//lf, "a.csv:1: the header holds the number '0;1'")
        call expect(error, "t,x"//lf//"0,1,1,5"//lf, "a.csv:2: the row has more than 2 fields (expected no more; if these are "// &
            "decimal commas: a decimal point")
        call expect(error, "t,x"//lf//"0,1,2,3,4,5"//lf, "a.csv:2: the row has more than 2 fields (expected no more)")
        call expect(error, "t;x"//lf//"s;mm"//lf//"0;1"//lf, "a.csv:2: column 't': 's'"//unit_row)
        call expect(error, "t;x"//lf//"[s];[mm]"//lf//"0;1"//lf, "a.csv:2: column 't': '[s]'"//unit_row)
        call expect(error, "t;x"//lf//"0;1"//lf//"s;mm"//lf, "a.csv:3: column 't': 's' is not a number (expected one)")
        call expect_unit(error, "roll (deg)", "deg")
        call expect_unit(error, "roll/deg", "deg")
        call expect_unit(error, "roll in deg", "deg")
        call expect_unit(error, "roll_deg", "deg")
        call expect_unit(error, "roll (deg/s)", "deg/s")
    end subroutine test_spreadsheets

    subroutine expect_unit(error, heading, unit)
        type(test_error), intent(inout) :: error
        character(len=*), intent(in) :: heading, unit
        character(len=:), allocatable :: want
        type(table_spec) :: table
        type(status_type) :: status
        integer :: column

        call parse_csv("t,"//heading//lf//"0,1"//lf, "a.csv", table, status)
        call column_of(table, "roll", column, status)
        want = "a.csv: no column 'roll' (found 't', '"//heading//"'; the unit belongs in square brackets: 'roll ["//unit//"]')"
        call check(error, status%message == want, "got '"//trim(status%message)//"', want '"//want//"'")
    end subroutine expect_unit

    !> As our own writer quotes them: a name may hold the separator, brackets and quotes.
    subroutine test_quoted(error)
        type(test_error), intent(inout) :: error
        type(table_spec) :: table
        type(status_type) :: status

        call parse_csv('time [s],"q arm,[2]#1 [rad]","q ""a"" b [mm]"'//lf//"0,1,2"//lf, "a.csv", table, status)
        call check(error, status%is_ok(), status%message)
        call check(error, size(table%column) == 3, "number of columns")
        call check(error, table%column(2) == "q arm,[2]#1" .and. table%unit(2) == "rad", "separator and brackets in a name")
        call check(error, table%column(3) == 'q "a" b' .and. table%unit(3) == "mm", "quotes in a name")
        call parse_csv('t;"x,1";y'//lf//"0;1;2"//lf, "a.csv", table, status)
        call check(error, status%is_ok() .and. size(table%column) == 3, "semicolons and a quoted comma "//status%message)
        call parse_csv('t,name,x'//lf//'0,"arm,2",5'//lf, "a.csv", table, status, takes_text=.true.)
        call check(error, status%is_ok() .and. size(table%column) == 3, "quoted text in a row "//status%message)
        call check_close(error, table%value(1, 3:), [5.0_wp], 0.0_wp, "number behind quoted text")
        call parse_csv('t,x 5"'//lf//"0,1"//lf, "a.csv", table, status)
        call check(error, status%is_ok() .and. size(table%column) == 2, "a quote that nothing closes "//status%message)
    end subroutine test_quoted

    subroutine test_columns(error)
        type(test_error), intent(inout) :: error
        type(table_spec) :: table
        type(status_type) :: status
        integer :: column

        call parse_csv("t,roll"//lf//"0,1"//lf, "a.csv", table, status)
        call column_of(table, "roll", column, status)
        call check(error, column == 2, "second column")
        call column_of(table, "rol", column, status)
        call check(error, index(status%message, "no column 'rol' (found 't', 'roll'; did you mean 'roll'?)") > 0, status%message)
    end subroutine test_columns

    !> No limit on rows, and the last row is the last line, ended or not.
    subroutine test_long(error)
        type(test_error), intent(inout) :: error
        integer, parameter :: n = 20000
        type(table_spec) :: table
        type(status_type) :: status
        character(len=:), allocatable :: text
        integer :: i

        allocate (character(len=14*n) :: text)
        do i = 1, n
            write (text(14*i - 13:14*i), "(i6, ',', i6, a1)") i, -i, lf
        end do
        call parse_csv("t,x"//lf//text, "a.csv", table, status)
        call check(error, status%is_ok(), status%message)
        call check(error, all(shape(table%value) == [n, 2]), "shape")
        call check_close(error, table%value(n, :), [real(n, wp), -real(n, wp)], 0.0_wp, "last row")
        call parse_csv("t,x"//lf//text(:14*n - 1), "a.csv", table, status)
        call check(error, size(table%value, 1) == n, "without the last newline")
    end subroutine test_long

    subroutine expect(error, text, fragment)
        type(test_error), intent(inout) :: error
        character(len=*), intent(in) :: text
        character(len=*), intent(in) :: fragment       !! of the message
        type(table_spec) :: table
        type(status_type) :: status

        call parse_csv(text, "a.csv", table, status)
        call check(error, index(status%message, fragment) == 1, &
            "got '"//trim(status%message)//"', want '"//fragment//"'")
    end subroutine expect
end module test_csv
