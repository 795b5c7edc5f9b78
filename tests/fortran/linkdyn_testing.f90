!> A small test harness: a test is a subroutine with one argument, the failure it found.
!>
!> A suite is a module `test_NAME` with a public `collect_NAME(tests)` that lists its tests:
!>
!>     tests = [new_test("integers", test_integers), new_test("reals", test_reals)]
!>
!> In a test, `call check(...)` may follow one another; the first that fails is reported.
module linkdyn_testing
    use linkdyn_kinds, only: wp
    implicit none (type, external)
    private
    public :: test_error, unit_test, new_test, check, check_close, run_suite

    !> What went wrong in a test; unallocated while nothing did.
    type :: test_error
        character(len=:), allocatable :: message
    end type test_error

    abstract interface
        subroutine test_procedure(error)
            import :: test_error
            type(test_error), intent(inout) :: error
        end subroutine test_procedure
    end interface

    type :: unit_test
        character(len=80) :: name = ""     !! of fixed length: gfortran 12 leaks allocatable parts of function results in a list
        procedure(test_procedure), pointer, nopass :: run => null()
    end type unit_test

    abstract interface
        subroutine collect_procedure(tests)
            import :: unit_test
            type(unit_test), allocatable, intent(out) :: tests(:)
        end subroutine collect_procedure
    end interface

    !> |got - want| <= tol for every element; tol is absolute. A NaN fails.
    interface check_close
        module procedure check_close_scalar, check_close_vector, check_close_matrix
    end interface check_close

contains

    function new_test(name, run) result(test)
        character(len=*), intent(in) :: name
        procedure(test_procedure) :: run
        type(unit_test) :: test

        test%name = name
        test%run => run
    end function new_test

    subroutine check(error, condition, what)
        type(test_error), intent(inout) :: error
        logical, intent(in) :: condition      !! must be true
        character(len=*), intent(in) :: what  !! printed if it is not

        if (condition .or. allocated(error%message)) return
        error%message = what
    end subroutine check

    subroutine check_close_scalar(error, got, want, tol, what)
        type(test_error), intent(inout) :: error
        real(wp), intent(in) :: got, want
        real(wp), intent(in) :: tol           !! largest difference allowed
        character(len=*), intent(in) :: what

        call check_close_vector(error, [got], [want], tol, what)
    end subroutine check_close_scalar

    subroutine check_close_matrix(error, got, want, tol, what)
        type(test_error), intent(inout) :: error
        real(wp), intent(in) :: got(:, :), want(:, :)
        real(wp), intent(in) :: tol           !! largest difference allowed
        character(len=*), intent(in) :: what

        call check(error, all(shape(got) == shape(want)), what//": shapes differ")
        if (allocated(error%message)) return
        call check_close_vector(error, reshape(got, [size(got)]), reshape(want, [size(want)]), tol, what)
    end subroutine check_close_matrix

    subroutine check_close_vector(error, got, want, tol, what)
        type(test_error), intent(inout) :: error
        real(wp), intent(in) :: got(:), want(:)
        real(wp), intent(in) :: tol           !! largest difference allowed
        character(len=*), intent(in) :: what
        character(len=160) :: numbers
        integer :: i

        call check(error, size(got) == size(want), what//": sizes differ")
        if (allocated(error%message)) return
        do i = 1, size(got)
            if (abs(got(i) - want(i)) <= tol) cycle
            write (numbers, "(a, i0, 2(a, es26.17e3), 2(a, es11.2e3))") &
                " (element ", i, "): got ", got(i), ", want ", want(i), ", off by", got(i) - want(i), ", tolerance", tol
            call check(error, .false., what//trim(numbers))
            return
        end do
    end subroutine check_close_vector

    !> Run every test of a suite; one line for each that fails.
    subroutine run_suite(name, collect, n_passed, n_failed)
        character(len=*), intent(in) :: name
        procedure(collect_procedure) :: collect
        integer, intent(inout) :: n_passed, n_failed  !! counts to add to
        type(unit_test), allocatable :: tests(:)
        type(test_error) :: error
        integer :: i

        call collect(tests)
        do i = 1, size(tests)
            error = test_error()
            call tests(i)%run(error)
            if (allocated(error%message)) then
                n_failed = n_failed + 1
                print "(a)", "FAILED "//name//"/"//trim(tests(i)%name)//": "//error%message
            else
                n_passed = n_passed + 1
            end if
        end do
    end subroutine run_suite
end module linkdyn_testing
