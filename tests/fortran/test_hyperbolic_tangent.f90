!> Hyperbolic tangents side by side, against the library's in quadruple precision.
module test_hyperbolic_tangent
    use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan, ieee_is_nan
    use, intrinsic :: iso_fortran_env, only: real128
    use linkdyn_hyperbolic_tangent, only: find_tangents
    use linkdyn_kinds, only: wp
    use linkdyn_testing, only: test_error, unit_test, new_test, check
    use linkdyn_text, only: to_text
    implicit none (type, external)
    private
    public :: collect_hyperbolic_tangent

contains

    subroutine collect_hyperbolic_tangent(tests)
        type(unit_test), allocatable, intent(out) :: tests(:)

        tests = [new_test("tangents within two units in the last place", test_errors), &
                 new_test("tangents at the ends", test_ends)]
    end subroutine collect_hyperbolic_tangent

    subroutine test_errors(error)
        type(test_error), intent(inout) :: error
        integer, parameter :: n = 1000
        real(wp), parameter :: reach(*) = [1.0e-300_wp, 1.0e-8_wp, 0.1_wp, 0.5_wp, 1.0_wp, 3.0_wp, 25.0_wp]
        real(wp) :: x(n), y(n), worst
        integer :: i, k

        do k = 1, size(reach)
            x = [(reach(k)*i/n, i=1, n)]
            y = x
            call find_tangents(n, y)
            worst = 0
            do i = 1, n
                worst = max(worst, abs(real(y(i)/tanh(real(x(i), real128)) - 1, wp)))
            end do
            call check(error, worst <= 2*epsilon(1.0_wp), "up to "//to_text(reach(k))//" off by "//to_text(worst))
        end do
    end subroutine test_errors

    subroutine test_ends(error)
        type(test_error), intent(inout) :: error
        real(wp) :: x(5)

        x = [0.0_wp, tiny(1.0_wp), 1.0e6_wp, huge(1.0_wp), ieee_value(1.0_wp, ieee_quiet_nan)]
        call find_tangents(size(x), x)
        call check(error, .not. abs(x(1)) > 0, "of zero")
        call check(error, abs(x(2)/tiny(1.0_wp) - 1) <= epsilon(1.0_wp), "of the least number")
        call check(error, all(abs(x(3:4) - 1) <= 0), "of large numbers")
        call check(error, ieee_is_nan(x(5)), "of what is no number")
    end subroutine test_ends
end module test_hyperbolic_tangent
