!> linkdyn_joint_motion: frames by definition, rates by differences, and the way back to the variables.
module test_joint_motion
    use linkdyn_joint_motion, only: relative_motion, relative_by_variables, variables_of_relative, relative_axis, turn_frame, &
        turn_frame_back
    use linkdyn_joint_table, only: is_slide, joint_revolute, joint_prismatic, joint_cylindrical, joint_universal, &
        joint_spherical, joint_fixed, joint_planar, joint_screw, n_joint_kind, is_geared
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_pose, only: rpy_rotation, rotate_rpy
    use linkdyn_scene, only: joint_n_variable, joint_kind_name
    use linkdyn_test_numbers, only: random_stream, eps, stencil, difference_step, difference_error, skew_part
    use linkdyn_testing, only: test_error, unit_test, new_test, check, check_close
    use linkdyn_vec3, only: vec3, mat3, operator(-), operator(*), lane_of, mat3_lane
    implicit none (type, external)
    private
    public :: collect_joint_motion

    real(wp), parameter :: pitch = -0.3_wp     !! of a screw [m/rad]

contains

    subroutine collect_joint_motion(tests)
        type(unit_test), allocatable, intent(out) :: tests(:)

        tests = [ &
            new_test("frames by definition", test_frames), &
            new_test("variables and back", test_round_trip), &
            new_test("rates against differences", test_rates), &
            new_test("axes of the variables", test_axes), &
            new_test("marker frame and back", test_turn_frame)]
    end subroutine collect_joint_motion

    !> Frames of the first link's marker, and variables away from where angles jump.
    subroutine start(stream, first, seed)
        type(random_stream), intent(inout) :: stream
        type(mat3), intent(out) :: first
        real(wp), intent(out) :: seed(lanes, 9)
        type(rpy_rotation) :: turn

        call rotate_rpy(3*stream%vector(lanes), stream%vector(lanes), 3*stream%vector(lanes), turn)
        first = turn%r
        seed = 0.7_wp*reshape(stream%vector(9*lanes), [lanes, 9])
    end subroutine start

    pure subroutine wave(seed, t, q, qd, qdd)
        real(wp), intent(in) :: seed(lanes, 9), t
        real(wp), intent(out), dimension(lanes, 3) :: q, qd, qdd

        q = seed(:, 1:3) + seed(:, 4:6)*sin(t + seed(:, 7:9))
        qd = seed(:, 4:6)*cos(t + seed(:, 7:9))
        qdd = -seed(:, 4:6)*sin(t + seed(:, 7:9))
    end subroutine wave

    pure function about_z(angle) result(r)
        real(wp), intent(in) :: angle
        real(wp) :: r(3, 3)

        r = reshape([cos(angle), sin(angle), 0.0_wp, -sin(angle), cos(angle), 0.0_wp, 0.0_wp, 0.0_wp, 1.0_wp], [3, 3])
    end function about_z

    subroutine test_frames(error)
        type(test_error), intent(inout) :: error
        real(wp), parameter :: minus_quarter(3, 3) = &
            reshape([1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, -1.0_wp, 0.0_wp, 1.0_wp, 0.0_wp], [3, 3])
        type(random_stream) :: stream
        type(relative_motion) :: motion
        type(rpy_rotation) :: turn
        type(mat3) :: first
        real(wp) :: seed(lanes, 9), f(3, 3), want(3, 3)
        real(wp), dimension(lanes, 3) :: q, qd, qdd
        integer :: kind, l

        call start(stream, first, seed)
        call wave(seed, 0.0_wp, q, qd, qdd)
        call rotate_rpy(q(:, 1), q(:, 2), q(:, 3), turn)
        do kind = 1, n_joint_kind
            if (is_geared(kind)) cycle      ! moves nothing
            call relative_by_variables(kind, first, q, qd, qdd, motion, pitch)
            do l = 1, lanes
                f = mat3_lane(first, l)
                select case (kind)
                case (joint_revolute, joint_cylindrical, joint_screw)
                    want = matmul(f, about_z(q(l, 1)))
                case (joint_planar)
                    want = matmul(f, about_z(q(l, 3)))
                case (joint_prismatic, joint_fixed)
                    want = f
                case (joint_universal)
                    want = matmul(f, matmul(about_z(q(l, 1)), matmul(minus_quarter, about_z(q(l, 2)))))
                case default
                    want = matmul(f, mat3_lane(turn%r, l))
                end select
                call check_close(error, mat3_lane(motion%frame, l), want, 30*eps, joint_kind_name(kind)//": frame")
                want(:, 1) = 0
                if (kind == joint_prismatic) want(:, 1) = q(l, 1)*f(:, 3)
                if (kind == joint_cylindrical) want(:, 1) = q(l, 2)*f(:, 3)
                if (kind == joint_screw) want(:, 1) = pitch*q(l, 1)*f(:, 3)
                if (kind == joint_planar) want(:, 1) = q(l, 1)*f(:, 1) + q(l, 2)*f(:, 2)
                call check_close(error, lane_of(motion%slide, l), want(:, 1), 4*eps, joint_kind_name(kind)//": slide")
            end do
        end do
    end subroutine test_frames

    subroutine test_round_trip(error)
        type(test_error), intent(inout) :: error
        type(random_stream) :: stream
        type(relative_motion) :: motion
        type(mat3) :: first
        real(wp) :: seed(lanes, 9)
        real(wp), dimension(lanes, 3) :: q, qd, qdd, q_back, qd_back
        integer :: kind, n

        call start(stream, first, seed)
        call wave(seed, 0.0_wp, q, qd, qdd)
        do kind = 1, n_joint_kind
            if (is_geared(kind)) cycle      ! moves nothing
            n = joint_n_variable(kind)
            call relative_by_variables(kind, first, q, qd, qdd, motion, pitch)
            call variables_of_relative(kind, first, motion%frame, motion%slide, motion%slide_rate, motion%omega, q_back, qd_back, &
                                       pitch)
            ! The pitch stays below 1.4 rad: its cosine divides the rates of a spherical joint.
            call check_close(error, q_back(:, :n), q(:, :n), 100*eps, joint_kind_name(kind)//": variables")
            call check_close(error, qd_back(:, :n), qd(:, :n), 200*eps, joint_kind_name(kind)//": rates")
            call check(error, all(abs(q_back(:, n + 1:)) <= 0), joint_kind_name(kind)//": no more variables")
        end do
    end subroutine test_round_trip

    !> The first frame rests, so derivatives seen from it are derivatives.
    subroutine test_rates(error)
        type(test_error), intent(inout) :: error
        type(random_stream) :: stream
        type(relative_motion) :: motion
        type(mat3) :: first
        real(wp) :: seed(lanes, 9), frame_rate(3, 3, lanes), vector_rate(3, 3, lanes), part
        real(wp), dimension(lanes, 3) :: q, qd, qdd
        integer :: kind, k, l

        call start(stream, first, seed)
        do kind = 1, n_joint_kind
            if (is_geared(kind)) cycle      ! moves nothing
            frame_rate = 0
            vector_rate = 0
            do k = -2, 2
                call wave(seed, k*difference_step(), q, qd, qdd)
                call relative_by_variables(kind, first, q, qd, qdd, motion, pitch)
                part = stencil(k)/difference_step()
                do l = 1, lanes
                    frame_rate(:, :, l) = frame_rate(:, :, l) + part*mat3_lane(motion%frame, l)
                    vector_rate(:, 1, l) = vector_rate(:, 1, l) + part*lane_of(motion%slide, l)
                    vector_rate(:, 2, l) = vector_rate(:, 2, l) + part*lane_of(motion%slide_rate, l)
                    vector_rate(:, 3, l) = vector_rate(:, 3, l) + part*lane_of(motion%omega, l)
                end do
            end do
            call wave(seed, 0.0_wp, q, qd, qdd)
            call relative_by_variables(kind, first, q, qd, qdd, motion, pitch)
            do l = 1, lanes
                call check_close(error, lane_of(motion%omega, l), skew_part(mat3_lane(motion%frame, l), frame_rate(:, :, l)), &
                                 100*difference_error(), joint_kind_name(kind)//": omega")
                call check_close(error, lane_of(motion%slide_rate, l), vector_rate(:, 1, l), 100*difference_error(), &
                                 joint_kind_name(kind)//": slide rate")
                call check_close(error, lane_of(motion%slide_rate2, l), vector_rate(:, 2, l), 100*difference_error(), &
                                 joint_kind_name(kind)//": slide acceleration")
                call check_close(error, lane_of(motion%alpha, l), vector_rate(:, 3, l), 100*difference_error(), &
                                 joint_kind_name(kind)//": alpha")
            end do
        end do
    end subroutine test_rates

    !> A unit rate of one variable moves the second link about or along the axis told.
    subroutine test_axes(error)
        type(test_error), intent(inout) :: error
        type(random_stream) :: stream
        type(relative_motion) :: motion
        type(mat3) :: first
        type(vec3) :: axis
        real(wp) :: seed(lanes, 9), want(3)
        real(wp), dimension(lanes, 3) :: q, qd, qdd
        integer :: kind, k, l

        call start(stream, first, seed)
        do kind = 1, n_joint_kind
            if (is_geared(kind)) cycle      ! moves nothing
            do k = 1, joint_n_variable(kind)
                call wave(seed, 0.0_wp, q, qd, qdd)
                qd = 0
                qd(:, k) = 1
                call relative_by_variables(kind, first, q, qd, qdd, motion, pitch)
                axis = motion%axis(k)
                if (kind /= joint_spherical) axis = relative_axis(kind, k, first, motion%frame)
                do l = 1, lanes
                    want = lane_of(axis, l)
                    call check_close(error, lane_of(motion%axis(k), l), want, 0.0_wp, joint_kind_name(kind)//": one axis")
                    if (is_slide(kind, k)) then
                        call check_close(error, lane_of(motion%slide_rate, l), want, 4*eps, joint_kind_name(kind)//": slide axis")
                        want = 0
                    end if
                    if (kind == joint_screw) &
                        call check_close(error, lane_of(motion%slide_rate, l), pitch*want, 4*eps, "screw: slide")
                    call check_close(error, lane_of(motion%omega, l), want, 20*eps, joint_kind_name(kind)//": turning axis")
                end do
            end do
        end do
    end subroutine test_axes

    subroutine test_turn_frame(error)
        type(test_error), intent(inout) :: error
        type(random_stream) :: stream
        type(mat3) :: r, turned
        real(wp) :: seed(lanes, 9), frame(3, 3)
        integer :: l

        call start(stream, r, seed)
        frame = matmul(about_z(0.3_wp), transpose(mat3_lane(r, 1)))
        turned = turn_frame(r, frame)
        do l = 1, lanes
            call check_close(error, mat3_lane(turned, l), matmul(mat3_lane(r, l), frame), 10*eps, "R F")
            call check_close(error, mat3_lane(turn_frame_back(turned, frame), l), mat3_lane(r, l), 30*eps, "and back")
        end do
    end subroutine test_turn_frame
end module test_joint_motion
