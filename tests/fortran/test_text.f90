!> linkdyn_text: numbers and names as people read them.
module test_text
    use linkdyn_kinds, only: wp
    use linkdyn_testing, only: test_error, unit_test, new_test, check
    use linkdyn_text, only: to_text, quoted, join
    implicit none (type, external)
    private
    public :: collect_text

contains

    subroutine collect_text(tests)
        type(unit_test), allocatable, intent(out) :: tests(:)

        tests = [ &
            new_test("integers", test_integers), &
            new_test("plain reals", test_plain_reals), &
            new_test("reals with exponent", test_exponents), &
            new_test("names", test_names)]
    end subroutine collect_text

    subroutine test_integers(error)
        type(test_error), intent(inout) :: error

        call check(error, to_text(0) == "0", "zero")
        call check(error, to_text(-huge(1)) == "-2147483647", "the longest integer")
    end subroutine test_integers

    subroutine test_plain_reals(error)
        type(test_error), intent(inout) :: error

        call check(error, to_text(0.0_wp) == "0", "zero: "//to_text(0.0_wp))
        call check(error, to_text(9.805_wp) == "9.805", "no trailing zeros: "//to_text(9.805_wp))
        call check(error, to_text(-12.0_wp) == "-12", "no trailing point: "//to_text(-12.0_wp))
        call check(error, to_text(120.0_wp) == "120", "zeros before the point stay: "//to_text(120.0_wp))
    end subroutine test_plain_reals

    subroutine test_exponents(error)
        type(test_error), intent(inout) :: error

        call check(error, to_text(1.0e6_wp) == "1e6", "large: "//to_text(1.0e6_wp))
        call check(error, to_text(-2.5e-4_wp) == "-2.5e-4", "small: "//to_text(-2.5e-4_wp))
        call check(error, to_text(2.5e-231_wp) == "2.5e-231", "smallest: "//to_text(2.5e-231_wp))
    end subroutine test_exponents

    subroutine test_names(error)
        type(test_error), intent(inout) :: error

        call check(error, quoted("rocker  ") == "'rocker'", "trailing blanks go")
        call check(error, quoted(repeat("x", 200)) == "'"//repeat("x", 200)//"'", "a long path is whole")
        call check(error, quoted(repeat("x", 201)) == "'"//repeat("x", 60)//"...'", "of what is longer the beginning")
        call check(error, quoted("x"//repeat("ü", 200)) == "'x"//repeat("ü", 29)//"...'", "letters stay whole")
        call check(error, join([character(len=3) :: "a", "bcd"]) == "'a', 'bcd'", "names in a row")
        call check(error, len(join([character(len=3) ::])) == 0, "no names, no text")
    end subroutine test_names
end module test_text
