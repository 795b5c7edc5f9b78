!> Numbers for the tests: repeatable random values, derivatives by differences, condition numbers.
module linkdyn_test_numbers
    use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan
    use, intrinsic :: iso_fortran_env, only: int64
    use linkdyn_dense, only: dense_workspace, solve_dense
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_vec3, only: vec3
    implicit none (type, external)
    private
    public :: random_stream, random_walk, eps
    public :: stencil, difference_step, difference_error, difference
    public :: condition_number, dense_solution, skew_part, random_vec3, largest_vec3, spoil_spare_lanes

    real(wp), parameter :: eps = epsilon(1.0_wp)

    !> Values in (-1, 1) that are the same on every machine and in every precision.
    !>
    !> **Source**: Park, Miller, Comm. ACM 31 (1988) 1192.
    type :: random_stream
        integer(int64) :: state = 4711
    contains
        procedure :: next
        procedure :: vector
    end type random_stream

    !> Central difference of fourth order: derivative = sum of weight(k)*f(t + k*step)/step, k = -2..2.
    real(wp), parameter :: stencil(-2:2) = [1.0_wp, -8.0_wp, 0.0_wp, 8.0_wp, -1.0_wp]/12.0_wp

contains

    !> What a system may leave in lanes that nobody is to look at.
    pure subroutine spoil_spare_lanes(n_used, rate, failed)
        integer, intent(in) :: n_used
        real(wp), intent(inout) :: rate(:, :)          !! (lane, n)
        logical, intent(inout) :: failed(:)            !! (lane)

        rate(n_used + 1:, :) = ieee_value(1.0_wp, ieee_quiet_nan)
        failed(n_used + 1:) = .true.
    end subroutine spoil_spare_lanes

    !> From a start on, each number by small steps of changing speed.
    function random_walk(start, n, reach) result(q)
        real(wp), intent(in) :: start(:)
        integer, intent(in) :: n
        real(wp), intent(in) :: reach                  !! of a step
        real(wp) :: q(size(start), n)
        type(random_stream) :: stream
        real(wp) :: step(size(start))
        integer :: i

        step = 0
        q(:, 1) = start
        do i = 2, n
            step = 0.95_wp*step + 0.3_wp*reach*stream%vector(size(start))
            q(:, i) = q(:, i - 1) + step
        end do
    end function random_walk

    real(wp) function next(self)
        class(random_stream), intent(inout) :: self
        integer(int64), parameter :: modulus = 2147483647_int64

        self%state = modulo(16807_int64*self%state, modulus)
        next = 2*real(self%state, wp)/real(modulus, wp) - 1
    end function next

    function vector(self, n) result(v)
        class(random_stream), intent(inout) :: self
        integer, intent(in) :: n
        real(wp) :: v(n)
        integer :: i

        do i = 1, n
            v(i) = self%next()
        end do
    end function vector

    !> A vector with other values on every lane.
    function random_vec3(stream) result(v)
        type(random_stream), intent(inout) :: stream
        type(vec3) :: v

        v%x = stream%vector(lanes)
        v%y = stream%vector(lanes)
        v%z = stream%vector(lanes)
    end function random_vec3

    pure real(wp) function largest_vec3(v)
        type(vec3), intent(in) :: v

        largest_vec3 = max(maxval(abs(v%x)), maxval(abs(v%y)), maxval(abs(v%z)))
    end function largest_vec3

    !> Step at which rounding (eps/step) and truncation (step**4) of the difference are alike, for a motion whose
    !> derivatives are of order one.
    pure real(wp) function difference_step()
        difference_step = eps**0.2_wp
    end function difference_step

    !> What then remains: eps over the step.
    pure real(wp) function difference_error()
        difference_error = eps/difference_step()
    end function difference_error

    !> Derivative from the values at the five points.
    pure real(wp) function difference(value)
        real(wp), intent(in) :: value(-2:2)

        difference = sum(stencil*value)/difference_step()
    end function difference

    !> ||A|| ||A^-1|| in the row sum norm, from the inverse itself.
    function condition_number(a) result(condition)
        real(wp), intent(in) :: a(:, :)
        real(wp) :: condition
        real(wp) :: inverse(size(a, 1), size(a, 1)), unit_vector(size(a, 1))
        integer :: k

        do k = 1, size(a, 1)
            unit_vector = 0
            unit_vector(k) = 1
            inverse(:, k) = dense_solution(a, unit_vector)
        end do
        condition = maxval(sum(abs(a), dim=2))*maxval(sum(abs(inverse), dim=2))
    end function condition_number

    !> Solution of a small dense system; neither argument is touched.
    function dense_solution(a, b) result(x)
        real(wp), intent(in) :: a(:, :), b(:)
        real(wp) :: x(size(b))
        type(dense_workspace) :: workspace
        real(wp) :: scaled(size(b), size(b)), rcond, bound
        logical :: is_singular

        scaled = a
        x = b
        call solve_dense(workspace, scaled, x, rcond, bound, is_singular)
        if (is_singular) x = huge(1.0_wp)
    end function dense_solution

    !> The vector w of the skew matrix W = Rdot R^T, so that Rdot = w x R.
    pure function skew_part(r, rate) result(w)
        real(wp), intent(in) :: r(3, 3), rate(3, 3)    !! rotation and its derivative
        real(wp) :: w(3)
        real(wp) :: m(3, 3)

        m = matmul(rate, transpose(r))
        w = 0.5_wp*[m(3, 2) - m(2, 3), m(1, 3) - m(3, 1), m(2, 1) - m(1, 2)]
    end function skew_part
end module linkdyn_test_numbers
