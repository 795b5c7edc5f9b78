!> How far joint angles turn between samples.
module test_turns
    use linkdyn_constants, only: pi
    use linkdyn_kinds, only: wp
    use linkdyn_test_numbers, only: random_stream
    use linkdyn_testing, only: test_error, unit_test, new_test, check, check_close
    use linkdyn_turns, only: turning_angles, turn_at_mean_rates, keeps_turns, count_sample
    implicit none (type, external)
    private
    public :: collect_turns

contains

    subroutine collect_turns(tests)
        type(unit_test), allocatable, intent(out) :: tests(:)

        tests = [new_test("a ball at its pole is not asked", test_pole), &
                 new_test("samples that surely keep their turns", test_keeping)]
    end subroutine collect_turns

    !> There rounding decides what roll and yaw are, and how fast they turn: to look closer tells no more.
    subroutine test_pole(error)
        type(test_error), intent(inout) :: error
        real(wp) :: turned(3), away(3)
        logical :: is_sure

        call turn(pi/2, is_sure, turned)
        call check(error, is_sure, "sure at the pole")
        call check_close(error, turned(1), 1.0_wp, 1.0e-5_wp, "roll, as measured")
        call check_close(error, turned(3), -2.0_wp, 1.0e-5_wp, "yaw, as measured")
        call turn(1.0_wp, is_sure, away)
        call check(error, .not. is_sure, "a look elsewhere")
    end subroutine test_pole

    !> What is said to keep its turns without a look at each angle has them by that look, too.
    subroutine test_keeping(error)
        type(test_error), intent(inout) :: error
        integer, parameter :: n_draw = 20000
        type(turning_angles) :: angles
        type(random_stream) :: stream
        real(wp) :: q(2), q_there(2), qd(2), qd_there(2), draw(2)
        real(wp), dimension(6) :: rate, rate_there, value, value_there, turned, counted
        logical :: is_sure
        integer :: i, n_kept

        ! a hinge that is led, a hinge, a ball and a slide
        angles%joint = [1, 2, 3, 3]
        angles%of_joint = [1, 1, 1, 3]
        angles%variable = [1, 2, 3, 5]
        angles%coordinate = [2, 0, 0, 0]
        angles%is_idle = [.false., .false., .false., .false.]
        angles%middle = [0, 0, 4, 4]
        angles%weight = [1.0_wp, 1.0_wp]
        n_kept = 0
        do i = 1, n_draw
            draw = stream%vector(2)
            q = 20*stream%vector(2)
            q_there = q + 2*abs(draw(1))*stream%vector(2)
            qd = (q_there - q)*(1 + 0.1_wp*stream%vector(2))
            qd_there = (q_there - q)*(1 + 0.1_wp*stream%vector(2))
            rate = abs(draw(2))*stream%vector(6)
            rate_there = rate + abs(draw(2))*stream%vector(6)
            value = pi*stream%vector(6)
            value(1) = q(2)
            value_there = value + abs(draw(1))*stream%vector(6)
            value_there(1) = modulo(q_there(2) + pi, 2*pi) - pi
            if (modulo(i, 2) == 0) value_there(1) = q_there(2)
            if (modulo(i, 3) == 0) value_there(2) = modulo(value_there(2), 2*pi) - pi
            if (.not. keeps_turns(angles, q, q_there, qd, qd_there, rate, rate_there, value, value_there)) cycle
            n_kept = n_kept + 1
            call turn_at_mean_rates(angles, q, q_there, qd, qd_there, rate, rate_there, value, value_there, turned, is_sure)
            counted = value_there
            call count_sample(angles, value + turned, counted, q_there)
            call check(error, is_sure .and. all(counted == value_there), "they have the turns that they are told with")
        end do
        call check(error, n_kept > n_draw/50, "there are many of them")
    end subroutine test_keeping

    !> A step of a tenth of a coordinate, as a ball sees it whose middle angle stays.
    subroutine turn(pitch, is_sure, turned)
        real(wp), intent(in) :: pitch
        logical, intent(out) :: is_sure
        real(wp), intent(out) :: turned(3)
        type(turning_angles) :: angles

        angles%joint = [1, 1]
        angles%of_joint = [1, 3]
        angles%variable = [1, 3]
        angles%coordinate = [0, 0]
        angles%is_idle = [.false., .false.]
        angles%middle = [2, 2]
        angles%weight = [1.0_wp]
        call turn_at_mean_rates(angles, [0.0_wp], [0.1_wp], [1.0_wp], [1.0_wp], [1.0e9_wp, 0.0_wp, -1.0e9_wp], &
                                [-3.0e8_wp, 0.0_wp, 3.0e8_wp], [1.8_wp, pitch, -0.6_wp], [2.8_wp, pitch, -2.6_wp], turned, is_sure)
    end subroutine turn
end module test_turns
