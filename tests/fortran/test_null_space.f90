!> linkdyn_null_space, linkdyn_null_space_plan: what a matrix makes zero, with and without a plan.
module test_null_space
    use linkdyn_kinds, only: wp
    use linkdyn_null_space, only: find_null_space
    use linkdyn_null_space_plan, only: null_space_plan, plan_null_space, find_null_space_by_plan
    use linkdyn_test_numbers, only: random_stream, eps
    use linkdyn_testing, only: test_error, unit_test, new_test, check, check_close
    implicit none (type, external)
    private
    public :: collect_null_space

    !> Three equations a body, and three that follow from these; two unknowns a joint.
    integer, parameter :: n_body = 4, n_joint = 8
    integer, parameter :: n_equation = 3*n_body + 3, n_unknown = 2*n_joint, n_free = n_unknown - 3*n_body
    !> That a joint connects; 0: the ground.
    integer, parameter :: body(2, n_joint) = reshape([0, 1, 1, 2, 2, 3, 3, 4, 4, 0, 1, 3, 2, 4, 2, 0], [2, n_joint])

contains

    subroutine collect_null_space(tests)
        type(unit_test), allocatable, intent(out) :: tests(:)

        tests = [ &
            new_test("a plan finds the same as a search", test_same), &
            new_test("another rank is not sure", test_other_rank), &
            new_test("a pivot that has vanished is not sure", test_no_pivot)]
    end subroutine collect_null_space

    subroutine test_same(error)
        type(test_error), intent(inout) :: error
        type(random_stream) :: stream
        type(null_space_plan) :: plan
        real(wp) :: a(n_equation, n_unknown), left(n_equation, n_unknown), basis(n_unknown, n_free)
        real(wp), allocatable :: found(:, :)
        logical :: is_sure
        integer :: k, n_sure

        call make_plan(stream, plan)
        n_sure = 0
        do k = 1, 40
            a = sample(stream)
            left = a
            call find_null_space_by_plan(plan, left, basis, is_sure)
            if (.not. is_sure) cycle
            n_sure = n_sure + 1
            call find_null_space(a, 1.0e-6_wp, found)
            call check(error, size(found, 2) == n_free, "dimension")
            call check_close(error, matmul(transpose(basis), basis), unit_matrix(n_free), 100*eps, "orthonormal")
            ! of entries about one, with multipliers of some hundreds
            call check_close(error, matmul(a, basis), 0*matmul(a, basis), 1.0e4_wp*eps, "zero")
            call check_close(error, matmul(basis, transpose(basis)), matmul(found, transpose(found)), 1.0e4_wp*eps, "the same span")
        end do
        call check(error, n_sure >= 30, "sure of most samples")
    end subroutine test_same

    !> One equation more says something.
    subroutine test_other_rank(error)
        type(test_error), intent(inout) :: error
        type(random_stream) :: stream
        type(null_space_plan) :: plan
        real(wp) :: a(n_equation, n_unknown), basis(n_unknown, n_free)
        logical :: is_sure

        call make_plan(stream, plan)
        a = sample(stream)
        a(n_equation, :) = a(n_equation, :) + 1.0e-3_wp*stream%vector(n_unknown)
        call find_null_space_by_plan(plan, a, basis, is_sure)
        call check(error, .not. is_sure, "sure of what is not so")
    end subroutine test_other_rank

    subroutine test_no_pivot(error)
        type(test_error), intent(inout) :: error
        type(random_stream) :: stream
        type(null_space_plan) :: plan
        real(wp) :: a(n_equation, n_unknown), basis(n_unknown, n_free)
        logical :: is_sure

        call make_plan(stream, plan)
        a = sample(stream)
        a(:, plan%pivot(3)%unknown) = 0
        call find_null_space_by_plan(plan, a, basis, is_sure)
        call check(error, .not. is_sure, "sure without a pivot")
    end subroutine test_no_pivot

    ! ---------------------------------------------------------------- matrices
    subroutine make_plan(stream, plan)
        type(random_stream), intent(inout) :: stream
        type(null_space_plan), intent(out) :: plan
        real(wp) :: samples(n_equation, n_unknown, 3)
        integer :: k

        do k = 1, size(samples, 3)
            samples(:, :, k) = sample(stream)
        end do
        call plan_null_space(samples, pattern(), n_free, plan)
    end subroutine make_plan

    !> Forces of the joints on the bodies; the last equations are sums of others.
    function sample(stream) result(a)
        type(random_stream), intent(inout) :: stream
        real(wp) :: a(n_equation, n_unknown)

        a = merge(reshape(stream%vector(n_equation*n_unknown), [n_equation, n_unknown]), 0.0_wp, pattern())
        a(13:, :) = a(1:3, :) + a(4:6, :) - a(7:9, :)
    end function sample

    pure function pattern() result(has)
        logical :: has(n_equation, n_unknown)
        integer :: i, k

        has = .true.
        do i = 1, 3*n_body
            do k = 1, n_unknown
                has(i, k) = any(body(:, (k + 1)/2) == (i + 2)/3)
            end do
        end do
    end function pattern

    pure function unit_matrix(n) result(one)
        integer, intent(in) :: n
        real(wp) :: one(n, n)
        integer :: i

        one = 0
        do i = 1, n
            one(i, i) = 1
        end do
    end function unit_matrix
end module test_null_space
