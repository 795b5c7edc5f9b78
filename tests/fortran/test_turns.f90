!> How far joint angles turn between samples.
module test_turns
    use linkdyn_constants, only: pi
    use linkdyn_kinds, only: wp
    use linkdyn_testing, only: test_error, unit_test, new_test, check, check_close
    use linkdyn_turns, only: turning_angles, turn_at_mean_rates
    implicit none (type, external)
    private
    public :: collect_turns

contains

    subroutine collect_turns(tests)
        type(unit_test), allocatable, intent(out) :: tests(:)

        tests = [new_test("a ball at its pole is not asked", test_pole)]
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
