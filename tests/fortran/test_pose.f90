!> linkdyn_pose: rotation by roll-pitch-yaw and its rates against differences in time.
module test_pose
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_pose, only: rpy_rotation, rotate_rpy, angular_velocity_rpy, angular_acceleration_rpy, rotation_about_x, &
        rotation_about_z
    use linkdyn_test_numbers, only: random_stream, eps, stencil, difference_step, difference_error, skew_part
    use linkdyn_testing, only: test_error, unit_test, new_test, check_close
    use linkdyn_vec3, only: lane_of, mat3_lane
    implicit none (type, external)
    private
    public :: collect_pose

contains

    subroutine collect_pose(tests)
        type(unit_test), allocatable, intent(out) :: tests(:)

        tests = [ &
            new_test("R = Rx Ry Rz", test_matrix), &
            new_test("angular velocity", test_velocity), &
            new_test("angular acceleration", test_acceleration)]
    end subroutine collect_pose

    subroutine test_matrix(error)
        type(test_error), intent(inout) :: error
        type(random_stream) :: stream
        type(rpy_rotation) :: turn
        real(wp) :: q(lanes, 3), rx(3, 3), ry(3, 3), rz(3, 3)
        integer :: l

        q = 3*reshape(stream%vector(3*lanes), [lanes, 3])
        call rotate_rpy(q(:, 1), q(:, 2), q(:, 3), turn)
        do l = 1, lanes
            associate (a => q(l, 1), b => q(l, 2), c => q(l, 3))
                rx = reshape([1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, cos(a), sin(a), 0.0_wp, -sin(a), cos(a)], [3, 3])
                ry = reshape([cos(b), 0.0_wp, -sin(b), 0.0_wp, 1.0_wp, 0.0_wp, sin(b), 0.0_wp, cos(b)], [3, 3])
                rz = reshape([cos(c), sin(c), 0.0_wp, -sin(c), cos(c), 0.0_wp, 0.0_wp, 0.0_wp, 1.0_wp], [3, 3])
            end associate
            call check_close(error, mat3_lane(turn%r, l), matmul(rx, matmul(ry, rz)), 10*eps, "Rx Ry Rz")
            call check_close(error, lane_of(turn%pitch_axis, l), rx(:, 2), 2*eps, "axis of pitch")
            call check_close(error, mat3_lane(rotation_about_x(q(:, 1)), l), rx, 2*eps, "about x")
            call check_close(error, mat3_lane(rotation_about_z(q(:, 3)), l), rz, 2*eps, "about z")
        end do
    end subroutine test_matrix

    !> Angles along a smooth motion of its own on every lane, at time t.
    subroutine motion(seed, t, q, qd, qdd)
        real(wp), intent(in) :: seed(lanes, 9), t
        real(wp), intent(out), dimension(lanes, 3) :: q, qd, qdd

        q = seed(:, 1:3) + seed(:, 4:6)*sin(t + seed(:, 7:9))
        qd = seed(:, 4:6)*cos(t + seed(:, 7:9))
        qdd = -seed(:, 4:6)*sin(t + seed(:, 7:9))
    end subroutine motion

    subroutine test_velocity(error)
        type(test_error), intent(inout) :: error
        type(random_stream) :: stream
        type(rpy_rotation) :: turn
        real(wp) :: seed(lanes, 9), rate(3, 3, lanes)
        real(wp), dimension(lanes, 3) :: q, qd, qdd
        integer :: k, l

        seed = reshape(stream%vector(size(seed)), shape(seed))
        rate = 0
        do k = -2, 2
            call motion(seed, k*difference_step(), q, qd, qdd)
            call rotate_rpy(q(:, 1), q(:, 2), q(:, 3), turn)
            do l = 1, lanes
                rate(:, :, l) = rate(:, :, l) + stencil(k)/difference_step()*mat3_lane(turn%r, l)
            end do
        end do
        call motion(seed, 0.0_wp, q, qd, qdd)
        call rotate_rpy(q(:, 1), q(:, 2), q(:, 3), turn)
        do l = 1, lanes
            call check_close(error, lane_of(angular_velocity_rpy(turn, qd), l), skew_part(mat3_lane(turn%r, l), rate(:, :, l)), &
                             100*difference_error(), "angular velocity")
        end do
    end subroutine test_velocity

    subroutine test_acceleration(error)
        type(test_error), intent(inout) :: error
        type(random_stream) :: stream
        type(rpy_rotation) :: turn
        real(wp) :: seed(lanes, 9), rate(3, lanes)
        real(wp), dimension(lanes, 3) :: q, qd, qdd
        integer :: k, l

        seed = reshape(stream%vector(size(seed)), shape(seed))
        rate = 0
        do k = -2, 2
            call motion(seed, k*difference_step(), q, qd, qdd)
            call rotate_rpy(q(:, 1), q(:, 2), q(:, 3), turn)
            do l = 1, lanes
                rate(:, l) = rate(:, l) + stencil(k)/difference_step()*lane_of(angular_velocity_rpy(turn, qd), l)
            end do
        end do
        call motion(seed, 0.0_wp, q, qd, qdd)
        call rotate_rpy(q(:, 1), q(:, 2), q(:, 3), turn)
        do l = 1, lanes
            call check_close(error, lane_of(angular_acceleration_rpy(turn, qd, qdd), l), rate(:, l), &
                             100*difference_error(), "angular acceleration")
        end do
    end subroutine test_acceleration
end module test_pose
