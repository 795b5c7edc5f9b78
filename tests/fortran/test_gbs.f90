!> Extrapolation on lanes, its steps controlled: an orbit that closes, and a system that ends.
module test_gbs
    use linkdyn_constants, only: two_pi
    use linkdyn_gbs, only: gbs_method
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_lane_system, only: lane_system
    use linkdyn_pause, only: pause_type
    use linkdyn_step_control, only: step_control, controlled_step, step_accepted, step_too_short
    use linkdyn_step_curve, only: step_curve
    use linkdyn_test_numbers, only: spoil_spare_lanes
    use linkdyn_testing, only: test_error, unit_test, new_test, check
    implicit none (type, external)
    private
    public :: collect_gbs

    !> A block on a plane whose friction sticks within a creep speed: place and speed.
    type, extends(lane_system) :: sliding_block
        real(wp) :: deceleration = 0, creep = 0
    contains
        procedure :: evaluate => evaluate_block
    end type sliding_block

    !> A planet: position and velocity in the plane, attraction 1/r**2.
    type, extends(lane_system) :: orbit
        real(wp) :: ends_at = huge(1.0_wp)        !! no rates beyond this instant
        real(wp) :: kick_at = huge(1.0_wp)        !! from then on something pulls aside
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
                 new_test("the solution within steps", test_within), &
                 new_test("a curve with a kink is refused", test_kink), &
                 new_test("stops where rates end", test_end), &
                 new_test("a block slides to rest", test_slide)]
    end subroutine collect_gbs

    subroutine evaluate_orbit(self, t, y, rate, failed)
        class(orbit), intent(inout) :: self
        real(wp), intent(in) :: t(lanes)
        real(wp), intent(in), contiguous :: y(:, :)
        real(wp), intent(out), contiguous :: rate(:, :)
        logical, intent(out) :: failed(lanes)
        real(wp) :: cube(lanes)

        failed = t > self%ends_at
        cube = sqrt(y(:, 1)**2 + y(:, 2)**2)**3
        rate(:, 1) = y(:, 3)
        rate(:, 2) = y(:, 4)
        rate(:, 3) = -y(:, 1)/cube
        rate(:, 4) = -y(:, 2)/cube + merge(0.1_wp, 0.0_wp, t > self%kick_at)
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

    !> The curve of every step against steps that end at its instants, and at its ends.
    subroutine test_within(error)
        type(test_error), intent(inout) :: error
        real(wp), parameter :: tolerance(3) = 10.0_wp**[-4, -8, -12], share(4) = [0.1_wp, 0.35_wp, 0.77_wp, 1.0_wp]
        type(orbit) :: system
        type(step_control), target :: control
        type(controlled_step) :: step
        type(pause_type) :: pause
        real(wp), dimension(lanes, 4) :: y, retaken
        integer :: i, k, outcome

        system%n = 4
        do i = 1, size(tolerance)
            step%n_evaluation = 0
            call prepare(control, [0.5_wp, 0.0_wp, 0.0_wp, sqrt(3.0_wp)], tolerance(i))
            do while (control%t < two_pi)
                call control%begin_taken(system, step)
                call control%take_step(system, two_pi, huge(1.0_wp), pause, outcome)
                if (outcome /= step_accepted) exit
                call control%end_taken(step)
                do k = 1, size(share)
                    call step%look_within(system, step%t(1) + share(k)*step%length(1), y)
                    call step%retake(system, spread(share(k), 1, lanes), retaken)
                    call check(error, maxval(abs(y - retaken)) <= tolerance(i), "a curve meets a shorter step")
                end do
            end do
            call check(error, control%t >= two_pi, "the round is done")
            call check(error, step%n_evaluation > 0, "curves were laid")
        end do
    end subroutine test_within

    !> Where f jumps the solution is no polynomial; before and behind it is.
    subroutine test_kink(error)
        type(test_error), intent(inout) :: error
        type(orbit) :: system
        type(step_curve) :: curve
        real(wp), parameter :: start(4) = [1.0_wp, 0.0_wp, 0.0_wp, 1.0_wp], length = 0.1_wp, kick(3) = [-1.0_wp, 0.043_wp, 1.0_wp]
        real(wp), dimension(4) :: way, rate, rate_end, error_of_way
        type(gbs_method) :: method
        logical :: failed
        integer :: k

        system%n = 4
        call method%start(4, 1.0e-10_wp)
        do k = 1, size(kick)
            system%kick_at = kick(k)
            call system%evaluate_alone(0.0_wp, start, rate, failed)
            call method%try_step(system, 0.0_wp, length, start, rate, way, error_of_way, failed, .false.)
            call system%evaluate_alone(length, start + way, rate_end, failed)
            call curve%lay(system, 0.0_wp, length, start, way, rate, rate_end, spread(1.0e-10_wp, 1, 4))
            call check(error, curve%is_there .neqv. k == 2, "a curve is laid where there is one")
            call check(error, curve%is_refused .eqv. k == 2, "or refused")
        end do
    end subroutine test_kink

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

    subroutine evaluate_block(self, t, y, rate, failed)
        class(sliding_block), intent(inout) :: self
        real(wp), intent(in) :: t(lanes)
        real(wp), intent(in), contiguous :: y(:, :)
        real(wp), intent(out), contiguous :: rate(:, :)
        logical, intent(out) :: failed(lanes)

        failed = t > huge(1.0_wp)
        rate(:, 1) = y(:, 2)
        rate(:, 2) = -self%deceleration*tanh(y(:, 2)/self%creep)
        call spoil_spare_lanes(self%n_used, rate, failed)
    end subroutine evaluate_block

    !> sinh(v/creep) dies out as exp(-deceleration t/creep). Steps are long when the block comes to rest, and substeps on either
    !> side of that have a mean of no friction.
    subroutine test_slide(error)
        type(test_error), intent(inout) :: error
        type(sliding_block) :: block
        type(step_control) :: control
        type(pause_type) :: pause
        real(wp), parameter :: tolerance(3) = 10.0_wp**[-6, -9, -12]
        real(wp) :: speed, decay, t_end
        integer, parameter :: n_block = 20, most_steps = 5000
        integer :: i, j, k, outcome

        block%n = 2
        do k = 1, n_block
            speed = 0.5_wp + modulo(3.7_wp*k, 7.0_wp)
            block%deceleration = 1 + modulo(2.3_wp*k, 6.0_wp)
            block%creep = 0.002_wp*2**modulo(k, 6)
            t_end = 1.3_wp*speed/block%deceleration
            do j = 1, size(tolerance)
                call prepare(control, [0.0_wp, speed], tolerance(j))
                do i = 1, most_steps
                    call control%take_step(block, t_end, t_end, pause, outcome)
                    if (outcome /= step_accepted) exit
                    decay = (speed - block%deceleration*control%t)/block%creep
                    ! of asinh(exp(decay)/2), as far as numbers reach
                    if (decay < 30) decay = asinh(exp(decay)/2)
                    call check(error, abs(control%y(2) - block%creep*decay) < 100*tolerance(j), "the block slows down and rests")
                    if (control%t >= t_end) exit
                end do
                call check(error, control%t >= t_end, "the end is reached")
            end do
        end do
    end subroutine test_slide
end module test_gbs
