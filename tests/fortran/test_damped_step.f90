!> linkdyn_damped_step: against the dense solver, with dependent rows, refused without damping.
module test_damped_step
    use linkdyn_damped_step, only: find_damped_step
    use linkdyn_dense, only: dense_workspace, solve_dense
    use linkdyn_kinds, only: wp
    use linkdyn_test_numbers, only: random_stream, eps
    use linkdyn_testing, only: test_error, unit_test, new_test, check, check_close
    implicit none (type, external)
    private
    public :: collect_damped_step

contains

    subroutine collect_damped_step(tests)
        type(unit_test), allocatable, intent(out) :: tests(:)

        tests = [ &
            new_test("against the dense solver", test_against_dense), &
            new_test("rows that depend on each other", test_dependent_rows), &
            new_test("too little damping is told", test_too_little)]
    end subroutine collect_damped_step

    !> Rows that touch two bodies of a chain each, as those of joints do.
    subroutine test_against_dense(error)
        type(test_error), intent(inout) :: error
        integer, parameter :: n = 18, m = 20
        real(wp), parameter :: damping = 0.3_wp
        type(random_stream) :: stream
        type(dense_workspace) :: workspace
        real(wp) :: j(n, m), f(m), x(n), normal(n, n), expected(n), rcond, bound
        logical :: is_found, is_singular
        integer :: i, first

        j = 0
        do i = 1, m
            first = 6*mod(i, 2)
            j(first + 1:first + 12, i) = stream%vector(12)
        end do
        f = stream%vector(m)
        normal = matmul(j, transpose(j))
        do i = 1, n
            normal(i, i) = normal(i, i) + damping
        end do
        expected = -matmul(j, f)
        call solve_dense(workspace, normal, expected, rcond, bound, is_singular)
        call find_damped_step(j, f, damping, x, is_found)
        call check(error, is_found, "found")
        call check_close(error, x, expected, 100*eps/rcond, "step")
    end subroutine test_against_dense

    !> The same row twice: with little damping the step closes the gap of both.
    subroutine test_dependent_rows(error)
        type(test_error), intent(inout) :: error
        type(random_stream) :: stream
        real(wp) :: j(6, 4), f(4), x(6)
        logical :: is_found

        j(:, 1) = stream%vector(6)
        j(:, 2) = stream%vector(6)
        j(:, 3) = j(:, 1)
        j(:, 4) = 2*j(:, 2)
        f = [0.4_wp, -0.2_wp, 0.4_wp, -0.4_wp]
        call find_damped_step(j, f, 1.0e-8_wp, x, is_found)
        call check(error, is_found, "found")
        call check_close(error, matmul(transpose(j), x), -f, 1.0e-6_wp, "gaps")
    end subroutine test_dependent_rows

    subroutine test_too_little(error)
        type(test_error), intent(inout) :: error
        real(wp) :: j(3, 1), f(1), x(3)
        logical :: is_found

        j(:, 1) = [1.0_wp, 2.0_wp, 2.0_wp]
        f = 1
        call find_damped_step(j, f, 0.0_wp, x, is_found)
        call check(error, .not. is_found, "not found")
    end subroutine test_too_little
end module test_damped_step
