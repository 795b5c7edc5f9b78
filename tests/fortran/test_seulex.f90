!> The method for stiff systems: kinks of the rates, wherever in its steps they lie.
module test_seulex
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_lane_system, only: lane_system
    use linkdyn_pause, only: pause_type
    use linkdyn_seulex, only: seulex_method
    use linkdyn_step_control, only: step_control, step_accepted
    use linkdyn_test_numbers, only: spoil_spare_lanes
    use linkdyn_testing, only: test_error, unit_test, new_test, check
    implicit none (type, external)
    private
    public :: collect_seulex

    !> A mass that runs into a spring at `wall`, and what follows it without delay: place, speed, follower.
    type, extends(lane_system) :: spring_ahead
        real(wp) :: wall = 0
        real(wp) :: stiffness = 100          !! over mass
        real(wp) :: haste = 1.0e5_wp         !! of the follower
    contains
        procedure :: evaluate => evaluate_spring
    end type spring_ahead

    !> A mass on a spring, pushed by a force over mass that grows and falls evenly within `width` of an instant: place, speed.
    type, extends(lane_system) :: pushed_mass
        real(wp) :: stiffness = 25           !! over mass
        real(wp) :: push = 50, at = 0, width = 0
    contains
        procedure :: evaluate => evaluate_push
    end type pushed_mass

contains

    subroutine collect_seulex(tests)
        type(unit_test), allocatable, intent(out) :: tests(:)

        tests = [new_test("kinks anywhere in a step are met", test_kinks), &
                 new_test("kinks by the clock are met", test_push)]
    end subroutine collect_seulex

    subroutine evaluate_spring(self, t, y, rate, failed)
        class(spring_ahead), intent(inout) :: self
        real(wp), intent(in) :: t(lanes)
        real(wp), intent(in), contiguous :: y(:, :)
        real(wp), intent(out), contiguous :: rate(:, :)
        logical, intent(out) :: failed(lanes)

        failed = t > huge(1.0_wp)
        rate(:, 1) = y(:, 2)
        rate(:, 2) = -self%stiffness*max(0.0_wp, y(:, 1) - self%wall)
        rate(:, 3) = self%haste*(y(:, 1) - y(:, 3))
        call spoil_spare_lanes(self%n_used, rate, failed)
    end subroutine evaluate_spring

    !> The mass comes with 1 m/s: it is back at the wall half a period of the spring later, and leaves as it came. Steps are long
    !> before and after, and each wall lies elsewhere in them.
    subroutine test_kinks(error)
        type(test_error), intent(inout) :: error
        type(spring_ahead) :: system
        type(step_control) :: control
        type(pause_type) :: pause
        type(seulex_method), allocatable :: method
        real(wp), parameter :: tolerance = 1.0e-8_wp, t_end = 1
        real(wp) :: half_period, place
        integer, parameter :: n_wall = 60, most_steps = 1000
        integer :: i, k, outcome

        half_period = acos(-1.0_wp)/sqrt(system%stiffness)
        system%n = 3
        do k = 1, n_wall
            system%wall = 0.2_wp + 0.3_wp*k/n_wall
            allocate (method)
            call method%start(3, tolerance)
            call move_alloc(method, control%method)
            call control%start(0.0_wp, [0.0_wp, 1.0_wp, 0.0_wp], 0.1_wp, tolerance, tolerance)
            do i = 1, most_steps
                if (control%t >= t_end) exit
                call control%take_step(system, t_end, huge(1.0_wp), pause, outcome)
                if (outcome /= step_accepted) exit
            end do
            call check(error, control%t >= t_end, "the end is reached")
            place = system%wall - (t_end - system%wall - half_period)
            ! Four kinks' steps, each with no more than the tolerance of its speeds, which tells for half a second.
            call check(error, abs(control%y(2) + 1) < 20*tolerance .and. abs(control%y(1) - place) < 20*tolerance, &
                       "the mass leaves as it came")
            ! The follower lags by the speed over its haste.
            call check(error, abs(control%y(3) - (place + 1/system%haste)) < 20*tolerance, "what follows is where the mass is")
        end do
    end subroutine test_kinks

    subroutine evaluate_push(self, t, y, rate, failed)
        class(pushed_mass), intent(inout) :: self
        real(wp), intent(in) :: t(lanes)
        real(wp), intent(in), contiguous :: y(:, :)
        real(wp), intent(out), contiguous :: rate(:, :)
        logical, intent(out) :: failed(lanes)

        failed = t > huge(1.0_wp)
        rate(:, 1) = y(:, 2)
        rate(:, 2) = self%push*max(0.0_wp, 1 - abs(t - self%at)/self%width) - self%stiffness*y(:, 1)
        call spoil_spare_lanes(self%n_used, rate, failed)
    end subroutine evaluate_push

    !> Steps of a mass at rest are long, and so come upon the push's kinks anywhere.
    subroutine test_push(error)
        type(test_error), intent(inout) :: error
        type(pushed_mass) :: system
        type(step_control) :: control
        type(pause_type) :: pause
        type(seulex_method), allocatable :: method
        real(wp), parameter :: tolerance(3) = 10.0_wp**[-8, -10, -12], t_end = 3
        real(wp) :: place
        integer, parameter :: n_push = 40, most_steps = 1000
        integer :: i, j, k, outcome

        system%n = 2
        do k = 1, n_push
            system%at = 0.7_wp + modulo(0.617_wp*k, 1.1_wp)
            system%width = 0.3_wp + modulo(0.0931_wp*k, 0.2_wp)
            ! Three ramps, each answered by the place of a mass that follows it and its swing about that.
            place = ramp_answer(-system%width) - 2*ramp_answer(0.0_wp) + ramp_answer(system%width)
            do j = 1, size(tolerance)
                allocate (method)
                call method%start(2, tolerance(j))
                call move_alloc(method, control%method)
                call control%start(0.0_wp, [0.0_wp, 0.0_wp], 0.01_wp, tolerance(j), tolerance(j))
                do i = 1, most_steps
                    call control%take_step(system, t_end, t_end, pause, outcome)
                    if (outcome /= step_accepted .or. control%t >= t_end) exit
                end do
                call check(error, control%t >= t_end, "the end is reached")
                call check(error, abs(control%y(1) - place) < 100*tolerance(j), "the mass is where the push has brought it")
            end do
        end do

    contains

        !> Place at the end, of a push that grows evenly from an instant on, counted from the peak.
        pure real(wp) function ramp_answer(from)
            real(wp), intent(in) :: from
            real(wp) :: since, frequency

            since = t_end - (system%at + from)
            frequency = sqrt(system%stiffness)
            ramp_answer = system%push/(system%width*system%stiffness)*(since - sin(frequency*since)/frequency)
        end function ramp_answer
    end subroutine test_push
end module test_seulex
