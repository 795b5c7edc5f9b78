!> Extrapolation on lanes, its steps controlled: an orbit that closes, and a system that ends.
module test_gbs
    use linkdyn_constants, only: two_pi
    use linkdyn_gbs, only: gbs_method
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_lane_system, only: lane_system
    use linkdyn_pause, only: pause_type
    use linkdyn_step_control, only: step_control, step_accepted, step_too_short
    use linkdyn_test_numbers, only: spoil_spare_lanes
    use linkdyn_testing, only: test_error, unit_test, new_test, check
    implicit none (type, external)
    private
    public :: collect_gbs

    !> A planet: position and velocity in the plane, attraction 1/r**2.
    type, extends(lane_system) :: orbit
        real(wp) :: ends_at = huge(1.0_wp)        !! no rates beyond this instant
        integer :: n_beyond = 0
    contains
        procedure :: evaluate => evaluate_orbit
    end type orbit

contains

    subroutine collect_gbs(tests)
        type(unit_test), allocatable, intent(out) :: tests(:)

        tests = [new_test("an orbit closes, to the tolerance", test_orbit), &
                 new_test("high order: digits are cheap", test_cost), &
                 new_test("short output intervals", test_intervals), &
                 new_test("stops where rates end", test_end)]
    end subroutine collect_gbs

    subroutine evaluate_orbit(self, t, y, rate, failed)
        class(orbit), intent(inout) :: self
        real(wp), intent(in) :: t(lanes), y(:, :)
        real(wp), intent(out) :: rate(:, :)
        logical, intent(out) :: failed(lanes)
        real(wp) :: cube(lanes)

        failed = t > self%ends_at
        cube = sqrt(y(:, 1)**2 + y(:, 2)**2)**3
        rate(:, 1) = y(:, 3)
        rate(:, 2) = y(:, 4)
        rate(:, 3) = -y(:, 1)/cube
        rate(:, 4) = -y(:, 2)/cube
        call spoil_spare_lanes(self%n_used, rate, failed)
    end subroutine evaluate_orbit

    !> One round from the point nearest the sun, eccentricity 1/2, in equal pieces: how far from closed, at what cost.
    subroutine go_round(tolerance, n_piece, gap, n_evaluation)
        real(wp), intent(in) :: tolerance
        integer, intent(in) :: n_piece
        real(wp), intent(out) :: gap
        integer, intent(out) :: n_evaluation
        type(orbit) :: system
        type(step_control) :: control
        type(pause_type) :: pause
        real(wp) :: start(4)
        integer :: i, outcome

        system%n = 4
        start = [0.5_wp, 0.0_wp, 0.0_wp, sqrt(3.0_wp)]
        call prepare(control, start, tolerance)
        gap = huge(1.0_wp)
        do i = 1, n_piece
            do while (control%t < two_pi*i/n_piece)
                call control%take_step(system, two_pi*i/n_piece, two_pi*i/n_piece, pause, outcome)
                if (outcome /= step_accepted) return
            end do
        end do
        gap = norm2(control%y - start)
        n_evaluation = control%count_evaluations()
    end subroutine go_round

    subroutine prepare(control, start, tolerance)
        type(step_control), intent(out) :: control
        real(wp), intent(in) :: start(:), tolerance
        type(gbs_method), allocatable :: method

        allocate (method)
        call method%start(size(start), tolerance)
        call move_alloc(method, control%method)
        call control%start(0.0_wp, start, 0.1_wp, tolerance, tolerance)
    end subroutine prepare

    !> The error of a step counts; over a round of this orbit it grows by some hundred.
    subroutine test_orbit(error)
        type(test_error), intent(inout) :: error
        real(wp) :: gap
        integer :: k, n

        do k = 3, min(14, precision(1.0_wp) - 2)
            call go_round(10.0_wp**(-k), 1, gap, n)
            call check(error, gap <= 300*10.0_wp**(-k), "the orbit closes")
        end do
    end subroutine test_orbit

    !> A method of fixed order p pays 10**(1/p) for each digit: eleven digits for less than four times the cost of three
    !> ask for an order above 13.
    subroutine test_cost(error)
        type(test_error), intent(inout) :: error
        real(wp) :: gap
        integer :: n_coarse, n_fine
        integer, parameter :: most_columns = 9

        if (lanes < most_columns) return    ! the columns then take turns
        call go_round(1.0e-3_wp, 1, gap, n_coarse)
        call go_round(1.0e-11_wp, 1, gap, n_fine)
        call check(error, n_fine < 4*n_coarse, "eleven digits cost less than four times as much as three")
    end subroutine test_cost

    !> Steps cut short need fewer columns, not as many for nothing.
    subroutine test_intervals(error)
        type(test_error), intent(inout) :: error
        real(wp) :: gap
        integer :: n

        call go_round(1.0e-9_wp, 200, gap, n)
        call check(error, gap <= 300*1.0e-9_wp, "the orbit closes")
        call check(error, n <= 200*9, "three columns, eight right-hand sides, are enough for most intervals")
    end subroutine test_intervals

    subroutine test_end(error)
        type(test_error), intent(inout) :: error
        type(orbit) :: system
        type(step_control) :: control
        type(pause_type) :: pause
        integer :: i, outcome

        system%n = 4
        system%ends_at = 1
        call prepare(control, [1.0_wp, 0.0_wp, 0.0_wp, 1.0_wp], 1.0e-8_wp)
        do i = 1, 1000
            call control%take_step(system, 3.0_wp, huge(1.0_wp), pause, outcome)
            if (outcome /= step_accepted) exit
        end do
        call check(error, outcome == step_too_short, "no step leads beyond the end")
        call check(error, control%t <= 1 .and. control%t > 1 - 1.0e-6_wp, "steps shorten up to the end")
        call check(error, abs(norm2(control%y(1:2)) - 1) < 1.0e-6_wp, "the last good solution is kept")
    end subroutine test_end
end module test_gbs
