!> Motion handed on through a joint whose variables are known: the step of an open chain, and its inverse, the
!> joint variables between two links of known motion.
!>
!> Each marker has a frame, z along its axis. The second marker's frame follows from the first's:
!> revolute Rz(angle); prismatic parallel, shifted by the slide along z; cylindrical both; universal
!> Rz(angle1) Rx(-90 deg) Rz(angle2), so that the second axis is y of the first marker when angle1 = 0;
!> spherical Rx(roll) Ry(pitch) Rz(yaw); fixed the same frame; planar Rz(angle), shifted along x and y; screw Rz(angle), shifted
!> along z in proportion.
module linkdyn_joint_motion
    use linkdyn_joint_table, only: joint_revolute, joint_prismatic, joint_cylindrical, joint_universal, joint_spherical, &
        joint_fixed, &
        joint_planar, joint_screw, pose_position, pose_attitude, variable_axis
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_pose, only: rpy_rotation, rotate_rpy, angular_velocity_rpy, angular_acceleration_rpy, rates_of_rpy, rotation_about_z
    use linkdyn_vec3, only: vec3, mat3, operator(+), operator(-), operator(*), operator(.dot.), operator(.cross.), &
        operator(.rotate.), operator(.unrotate.), zero_vec3
    implicit none (type, external)
    private
    public :: relative_motion, turn_frame, turn_frame_back
    public :: relative_by_variables, first_by_variables, variables_of_relative, relative_axis, marker_axis

    !> Motion of the second marker's frame seen from the first link, in world axes.
    type :: relative_motion
        type(mat3) :: frame        !! second marker's frame
        type(vec3) :: slide        !! from the first marker's point to the second's [m]
        type(vec3) :: slide_rate   !! its rate seen from the first link [m/s]
        type(vec3) :: slide_rate2  !! [m/s2]
        type(vec3) :: omega        !! relative angular velocity [rad/s]
        type(vec3) :: alpha        !! its derivative seen from the first link [rad/s2]
        type(vec3) :: axis(3)      !! about or along which each joint variable moves the second link
    end type relative_motion

contains

    !> A marker's frame in world axes: the link's rotation times the frame fixed in the link.
    pure function turn_frame(r, frame) result(turned)
        type(mat3), intent(in) :: r
        real(wp), intent(in) :: frame(3, 3)    !! columns x, y, z in link axes
        type(mat3) :: turned

        turned%x = r.rotate.frame(:, 1)
        turned%y = r.rotate.frame(:, 2)
        turned%z = r.rotate.frame(:, 3)
    end function turn_frame

    !> The link's rotation from its marker's frame in world axes: the inverse of `turn_frame`.
    pure function turn_frame_back(turned, frame) result(r)
        type(mat3), intent(in) :: turned
        real(wp), intent(in) :: frame(3, 3)
        type(mat3) :: r

        r = turn_frame(turned, transpose(frame))
    end function turn_frame_back

    !> Motion through the joint from its variables.
    pure subroutine relative_by_variables(kind, first, q, qd, qdd, motion, pitch)
        integer, intent(in) :: kind                               !! one of `joint_*`
        type(mat3), intent(in) :: first                           !! first marker's frame, world axes
        real(wp), intent(in), dimension(lanes, 3) :: q, qd, qdd   !! joint variables and derivatives [m, rad]
        type(relative_motion), intent(out) :: motion
        real(wp), intent(in), optional :: pitch                   !! of a screw [m/rad]
        type(rpy_rotation) :: turn
        type(vec3) :: second_axis

        motion%slide = zero_vec3()
        motion%slide_rate = motion%slide
        motion%slide_rate2 = motion%slide
        select case (kind)
        case (joint_revolute, joint_cylindrical, joint_screw)
            call turn_about_z(first, q(:, 1), qd(:, 1), qdd(:, 1), motion)
            motion%axis = first%z
            if (kind == joint_cylindrical) call slide_along(first%z, q(:, 2), qd(:, 2), qdd(:, 2), motion)
            if (kind == joint_screw) call slide_along(first%z, pitch*q(:, 1), pitch*qd(:, 1), pitch*qdd(:, 1), motion)
        case (joint_planar)
            call turn_about_z(first, q(:, 3), qd(:, 3), qdd(:, 3), motion)
            motion%axis = [first%x, first%y, first%z]
            call slide_along(first%x, q(:, 1), qd(:, 1), qdd(:, 1), motion)
            call slide_along(first%y, q(:, 2), qd(:, 2), qdd(:, 2), motion)
        case (joint_prismatic, joint_fixed)
            motion%frame = first
            motion%axis = first%z
            motion%omega = motion%slide
            motion%alpha = motion%slide
            if (kind == joint_prismatic) call slide_along(first%z, q(:, 1), qd(:, 1), qdd(:, 1), motion)
        case (joint_universal)
            motion%frame = universal_frame(first, q(:, 1), q(:, 2))
            second_axis = motion%frame%z
            motion%axis = [first%z, second_axis, second_axis]
            motion%omega = qd(:, 1)*first%z + qd(:, 2)*second_axis
            motion%alpha = qdd(:, 1)*first%z + qdd(:, 2)*second_axis &
                           + (qd(:, 1)*qd(:, 2))*(first%z.cross.second_axis)
        case default
            call rotate_rpy(q(:, 1), q(:, 2), q(:, 3), turn)
            motion%frame = first*turn%r
            motion%axis = [first%x, first.rotate.turn%pitch_axis, motion%frame%z]
            motion%omega = first.rotate.angular_velocity_rpy(turn, qd)
            motion%alpha = first.rotate.angular_acceleration_rpy(turn, qd, qdd)
        end select
    end subroutine relative_by_variables

    !> The other way round: the first marker's frame and the way from its point to the second's, from where the second is.
    pure subroutine first_by_variables(kind, second, q, first, slide, pitch)
        integer, intent(in) :: kind                               !! one of `joint_*`
        type(mat3), intent(in) :: second                          !! second marker's frame, world axes
        real(wp), intent(in) :: q(lanes, 3)                       !! joint variables [m, rad]
        type(mat3), intent(out) :: first
        type(vec3), intent(out) :: slide                          !! world axes [m]
        real(wp), intent(in), optional :: pitch                   !! of a screw [m/rad]
        real(wp), dimension(lanes) :: none, one
        type(relative_motion) :: motion

        none = 0
        one = 1
        call relative_by_variables(kind, mat3(vec3(one, none, none), vec3(none, one, none), vec3(none, none, one)), q, 0*q, 0*q, &
                                   motion, pitch)
        ! backwards by the transposed rotation
        associate (f => motion%frame)
            first%x = second.rotate.vec3(f%x%x, f%y%x, f%z%x)
            first%y = second.rotate.vec3(f%x%y, f%y%y, f%z%y)
            first%z = second.rotate.vec3(f%x%z, f%y%z, f%z%z)
        end associate
        slide = first.rotate.motion%slide
    end subroutine first_by_variables

    pure subroutine slide_along(axis, s, sd, sdd, motion)
        type(vec3), intent(in) :: axis
        real(wp), intent(in) :: s(lanes), sd(lanes), sdd(lanes)
        type(relative_motion), intent(inout) :: motion

        motion%slide = motion%slide + s*axis
        motion%slide_rate = motion%slide_rate + sd*axis
        motion%slide_rate2 = motion%slide_rate2 + sdd*axis
    end subroutine slide_along

    pure subroutine turn_about_z(first, angle, rate, rate2, motion)
        type(mat3), intent(in) :: first
        real(wp), intent(in) :: angle(lanes), rate(lanes), rate2(lanes)
        type(relative_motion), intent(inout) :: motion

        motion%frame = first*rotation_about_z(angle)
        motion%omega = rate*first%z
        motion%alpha = rate2*first%z
    end subroutine turn_about_z

    !> Second frame of a universal joint.
    pure function universal_frame(first, angle1, angle2) result(frame)
        type(mat3), intent(in) :: first
        real(wp), intent(in) :: angle1(lanes), angle2(lanes)
        type(mat3) :: frame
        type(mat3) :: middle, turned

        middle = first*rotation_about_z(angle1)
        ! Rx(-90 deg): x stays, y becomes -z, z becomes y.
        turned%x = middle%x
        turned%y = (-1.0_wp)*middle%z
        turned%z = middle%y
        frame = turned*rotation_about_z(angle2)
    end function universal_frame

    !> Axis about or along which the variable of an actuated joint moves the second link, world axes. A spherical joint
    !> has no such axes at pitch = 90 degrees and is never actuated.
    pure function relative_axis(kind, variable, first, second) result(axis)
        integer, intent(in) :: kind, variable
        type(mat3), intent(in) :: first, second   !! marker frames, world axes
        type(vec3) :: axis

        axis = marker_axis(first, variable_axis(variable, kind))
        if (kind == joint_universal .and. variable == 2) axis = second%z
    end function relative_axis

    !> Axis k of a marker's frame.
    pure function marker_axis(frame, k) result(axis)
        type(mat3), intent(in) :: frame
        integer, intent(in) :: k          !! 1 to 3: x, y, z
        type(vec3) :: axis

        select case (k)
        case (1)
            axis = frame%x
        case (2)
            axis = frame%y
        case default
            axis = frame%z
        end select
    end function marker_axis

    !> Joint variables and rates from the motion of both links.
    !>
    !> Angles lie in (-pi, pi], but a screw's, which its slide tells; a spherical joint's rates are not finite at
    !> pitch = 90 degrees.
    pure subroutine variables_of_relative(kind, first, second, slide, slide_rate, omega, q, qd, pitch)
        integer, intent(in) :: kind
        type(mat3), intent(in) :: first, second    !! marker frames, world axes
        type(vec3), intent(in) :: slide            !! first to second marker point, world axes [m]
        type(vec3), intent(in) :: slide_rate       !! its rate seen from the first link [m/s]
        type(vec3), intent(in) :: omega            !! angular velocity of the second minus the first link [rad/s]
        real(wp), intent(out) :: q(lanes, 3), qd(lanes, 3)
        real(wp), intent(in), optional :: pitch    !! of a screw [m/rad]

        q = 0
        qd = 0
        select case (kind)
        case (joint_revolute)
            call angle_about_z(first, second, omega, q(:, 1), qd(:, 1))
        case (joint_prismatic)
            q(:, 1) = slide.dot.first%z
            qd(:, 1) = slide_rate.dot.first%z
        case (joint_cylindrical)
            call angle_about_z(first, second, omega, q(:, 1), qd(:, 1))
            q(:, 2) = slide.dot.first%z
            qd(:, 2) = slide_rate.dot.first%z
        case (joint_universal)
            q(:, 1) = atan2(-(second%z.dot.first%x), second%z.dot.first%y)
            q(:, 2) = atan2(-(second%x.dot.first%z), -(second%y.dot.first%z))
            qd(:, 1) = omega.dot.first%z
            qd(:, 2) = omega.dot.second%z
        case (joint_planar)
            q(:, 1) = slide.dot.first%x
            q(:, 2) = slide.dot.first%y
            qd(:, 1) = slide_rate.dot.first%x
            qd(:, 2) = slide_rate.dot.first%y
            call angle_about_z(first, second, omega, q(:, 3), qd(:, 3))
        case (joint_screw)
            q(:, 1) = (slide.dot.first%z)/pitch
            qd(:, 1) = omega.dot.first%z
        case (pose_position)
            q(:, 1) = slide.dot.first%x
            q(:, 2) = slide.dot.first%y
            q(:, 3) = slide.dot.first%z
            qd(:, 1) = slide_rate.dot.first%x
            qd(:, 2) = slide_rate.dot.first%y
            qd(:, 3) = slide_rate.dot.first%z
        case (joint_spherical, pose_attitude)
            q(:, 1) = atan2(-(second%z.dot.first%y), second%z.dot.first%z)
            q(:, 2) = atan2(second%z.dot.first%x, sqrt((second%z.dot.first%y)**2 + (second%z.dot.first%z)**2))
            ! what is left once roll is taken away: at a right angle of pitch roll alone is not certain
            q(:, 3) = atan2(cos(q(:, 1))*(second%x.dot.first%y) + sin(q(:, 1))*(second%x.dot.first%z), &
                            cos(q(:, 1))*(second%y.dot.first%y) + sin(q(:, 1))*(second%y.dot.first%z))
            qd = rates_of_rpy(q(:, 1), q(:, 2), first.unrotate.omega)
        end select
    end subroutine variables_of_relative

    pure subroutine angle_about_z(first, second, omega, angle, rate)
        type(mat3), intent(in) :: first, second
        type(vec3), intent(in) :: omega
        real(wp), intent(out) :: angle(lanes), rate(lanes)

        angle = atan2(second%x.dot.first%y, second%x.dot.first%x)
        rate = omega.dot.first%z
    end subroutine angle_about_z
end module linkdyn_joint_motion
