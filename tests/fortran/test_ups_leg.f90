!> linkdyn_ups_leg: rates of the leg's axes against differences in time, spin included, base at rest and moving.
module test_ups_leg
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_pose, only: rpy_rotation, rotate_rpy, angular_velocity_rpy, angular_acceleration_rpy
    use linkdyn_test_numbers, only: random_stream, eps, stencil, difference_step, difference_error, skew_part, &
        random_vec3, largest_vec3
    use linkdyn_testing, only: test_error, unit_test, new_test, check, check_close
    use linkdyn_ups_leg, only: ups_leg, locate_ups_leg, move_ups_leg, accelerate_ups_leg, map_ups_column
    use linkdyn_vec3, only: vec3, mat3, operator(+), operator(-), operator(*), operator(.dot.), operator(.cross.), &
        operator(.rotate.), operator(.unrotate.), lane_of, mat3_lane, vec3_of, unit
    implicit none (type, external)
    private
    public :: collect_ups_leg

    !> A leg in motion: U and S run along smooth paths, the base turns (or not).
    type :: leg_motion
        real(wp) :: path(lanes, 9) = 0      !! span: mean, amplitude, phase
        real(wp) :: turn(lanes, 9) = 0      !! base angles: mean, amplitude, phase
        real(wp) :: axis(3) = 0
        logical :: base_moves = .false.
    end type leg_motion

    !> What it is at one instant.
    type :: leg_instant
        type(ups_leg) :: leg
        type(vec3) :: axis                            !! first universal axis, world
        type(vec3) :: span_rate2                      !! world [m/s2]
        type(vec3) :: omega_base, alpha_base          !! world
        type(vec3) :: alpha                           !! leg axes
    end type leg_instant

contains

    subroutine collect_ups_leg(tests)
        type(unit_test), allocatable, intent(out) :: tests(:)

        tests = [ &
            new_test("axes and length", test_axes), &
            new_test("velocity, base at rest", test_velocity_fixed), &
            new_test("velocity, base moving", test_velocity_moving), &
            new_test("acceleration, base at rest", test_acceleration_fixed), &
            new_test("acceleration, base moving", test_acceleration_moving), &
            new_test("column is the difference of accelerations", test_column), &
            new_test("no length, or axis along the leg", test_failure)]
    end subroutine collect_ups_leg

    subroutine make_motion(base_moves, motion)
        logical, intent(in) :: base_moves
        type(leg_motion), intent(out) :: motion
        type(random_stream) :: stream

        motion%path = 0.4_wp*reshape(stream%vector(9*lanes), [lanes, 9])
        motion%path(:, 3) = motion%path(:, 3) + 1.5_wp
        motion%turn = reshape(stream%vector(9*lanes), [lanes, 9])
        motion%base_moves = base_moves
        if (.not. base_moves) motion%turn(:, 1:6) = 0
        motion%axis = [0.6_wp, 0.7_wp, 0.2_wp]
        motion%axis = motion%axis/norm2(motion%axis)
    end subroutine make_motion

    subroutine evaluate(motion, t, now)
        type(leg_motion), intent(in) :: motion
        real(wp), intent(in) :: t
        type(leg_instant), intent(out) :: now
        type(rpy_rotation) :: turn
        real(wp), dimension(lanes, 3) :: q, qd, qdd

        call wave(motion%turn, t, q, qd, qdd)
        call rotate_rpy(q(:, 1), q(:, 2), q(:, 3), turn)
        now%axis = turn%r.rotate.motion%axis
        now%omega_base = angular_velocity_rpy(turn, qd)
        now%alpha_base = angular_acceleration_rpy(turn, qd, qdd)
        call wave(motion%path, t, q, qd, qdd)
        now%span_rate2 = vec3(qdd(:, 1), qdd(:, 2), qdd(:, 3))
        call locate_ups_leg(vec3(q(:, 1), q(:, 2), q(:, 3)), now%axis, now%leg)
        call move_ups_leg(vec3(qd(:, 1), qd(:, 2), qd(:, 3)), now%omega_base, motion%base_moves, now%leg)
        call accelerate_ups_leg(now%leg, now%leg%axes.unrotate.now%span_rate2, now%omega_base, now%alpha_base, &
                                motion%base_moves, now%alpha)
    end subroutine evaluate

    pure subroutine wave(seed, t, q, qd, qdd)
        real(wp), intent(in) :: seed(lanes, 9), t
        real(wp), intent(out), dimension(lanes, 3) :: q, qd, qdd

        q = seed(:, 1:3) + seed(:, 4:6)*sin(t + seed(:, 7:9))
        qd = seed(:, 4:6)*cos(t + seed(:, 7:9))
        qdd = -seed(:, 4:6)*sin(t + seed(:, 7:9))
    end subroutine wave

    subroutine test_axes(error)
        type(test_error), intent(inout) :: error
        type(leg_motion) :: motion
        type(leg_instant) :: now
        real(wp) :: q(lanes, 3), qd(lanes, 3), qdd(lanes, 3), r(3, 3), product(3, 3), span(3), u(3)
        integer :: l, k

        call make_motion(.true., motion)
        call evaluate(motion, 0.0_wp, now)
        call wave(motion%path, 0.0_wp, q, qd, qdd)
        do l = 1, lanes
            r = mat3_lane(now%leg%axes, l)
            span = q(l, :)
            u = lane_of(now%axis, l)
            call check_close(error, now%leg%length(l), norm2(span), 8*eps*norm2(span), "length")
            call check_close(error, r(:, 3), span/norm2(span), 8*eps, "z along the leg")
            product = matmul(transpose(r), r)
            do k = 1, 3
                product(k, k) = product(k, k) - 1
            end do
            call check(error, maxval(abs(product)) <= 20*eps, "axes are square")
            call check_close(error, dot_product(r(:, 2), u), 0.0_wp, 20*eps, "second universal axis square to the first")
            call check_close(error, r(:, 1), [r(2, 2)*r(3, 3) - r(3, 2)*r(2, 3), r(3, 2)*r(1, 3) - r(1, 2)*r(3, 3), &
                                              r(1, 2)*r(2, 3) - r(2, 2)*r(1, 3)], 20*eps, "right-handed")
        end do
    end subroutine test_axes

    subroutine test_velocity_fixed(error)
        type(test_error), intent(inout) :: error

        call compare_velocity(error, .false.)
    end subroutine test_velocity_fixed

    subroutine test_velocity_moving(error)
        type(test_error), intent(inout) :: error

        call compare_velocity(error, .true.)
    end subroutine test_velocity_moving

    subroutine compare_velocity(error, base_moves)
        type(test_error), intent(inout) :: error
        logical, intent(in) :: base_moves
        type(leg_motion) :: motion
        type(leg_instant) :: now
        type(vec3) :: omega
        real(wp) :: turning(3, 3, lanes), stretching(lanes)
        integer :: k, l

        call make_motion(base_moves, motion)
        turning = 0
        stretching = 0
        do k = -2, 2
            call evaluate(motion, k*difference_step(), now)
            stretching = stretching + stencil(k)/difference_step()*now%leg%length
            do l = 1, lanes
                turning(:, :, l) = turning(:, :, l) + stencil(k)/difference_step()*mat3_lane(now%leg%axes, l)
            end do
        end do
        call evaluate(motion, 0.0_wp, now)
        omega = now%leg%axes.rotate.now%leg%omega
        call check_close(error, now%leg%rate, stretching, 1000*difference_error(), "rate of the length")
        do l = 1, lanes
            call check_close(error, lane_of(omega, l), skew_part(mat3_lane(now%leg%axes, l), turning(:, :, l)), &
                             1000*difference_error(), "angular velocity")
        end do
    end subroutine compare_velocity

    subroutine test_acceleration_fixed(error)
        type(test_error), intent(inout) :: error

        call compare_acceleration(error, .false.)
    end subroutine test_acceleration_fixed

    subroutine test_acceleration_moving(error)
        type(test_error), intent(inout) :: error

        call compare_acceleration(error, .true.)
    end subroutine test_acceleration_moving

    subroutine compare_acceleration(error, base_moves)
        type(test_error), intent(inout) :: error
        logical, intent(in) :: base_moves
        type(leg_motion) :: motion
        type(leg_instant) :: now
        type(vec3) :: alpha
        real(wp) :: rate(3, lanes)
        integer :: k, l

        call make_motion(base_moves, motion)
        rate = 0
        do k = -2, 2
            call evaluate(motion, k*difference_step(), now)
            do l = 1, lanes
                rate(:, l) = rate(:, l) + stencil(k)/difference_step()*lane_of(now%leg%axes.rotate.now%leg%omega, l)
            end do
        end do
        call evaluate(motion, 0.0_wp, now)
        alpha = now%leg%axes.rotate.now%alpha
        do l = 1, lanes
            ! The fifth derivative, which the differences leave out, reaches thousands for the shortest of the random legs.
            call check_close(error, lane_of(alpha, l), rate(:, l), 3000*difference_error(), "angular acceleration")
        end do
    end subroutine compare_acceleration

    !> The acceleration map is affine: its linear part maps differences.
    subroutine test_column(error)
        type(test_error), intent(inout) :: error
        type(leg_motion) :: motion
        type(leg_instant) :: now
        type(random_stream) :: stream
        type(vec3) :: da, dalpha, shifted, column
        logical :: base_moves
        integer :: k

        do k = 1, 2
            base_moves = k == 2
            call make_motion(base_moves, motion)
            call evaluate(motion, 0.3_wp, now)
            da = random_vec3(stream)
            dalpha = random_vec3(stream)
            call accelerate_ups_leg(now%leg, (now%leg%axes.unrotate.now%span_rate2) + da, now%omega_base, &
                                    now%alpha_base + dalpha, base_moves, shifted)
            call map_ups_column(now%leg, da, dalpha, base_moves, column)
            call check(error, largest_vec3(shifted - now%alpha - column) <= 500*eps, "column")
            call check(error, largest_vec3(column) > 0.1_wp, "the column is not zero")
        end do
    end subroutine test_column

    !> Neither passes for a number.
    subroutine test_failure(error)
        type(test_error), intent(inout) :: error
        type(ups_leg) :: leg

        call locate_ups_leg(vec3_of([0.0_wp, 0.0_wp, 0.0_wp]), vec3_of([1.0_wp, 0.0_wp, 0.0_wp]), leg)
        call check(error, .not. any(leg%length > 0 .and. abs(leg%tilt) <= huge(1.0_wp)), "no length")
        call locate_ups_leg(vec3_of([0.0_wp, 0.0_wp, 2.0_wp]), vec3_of([0.0_wp, 0.0_wp, 1.0_wp]), leg)
        call check(error, .not. any(abs(leg%tilt) <= huge(1.0_wp)), "axis along the leg")
    end subroutine test_failure
end module test_ups_leg
