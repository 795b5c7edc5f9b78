!> Motion of a link whose pose is given: position and roll-pitch-yaw angles with their derivatives.
!>
!> R = Rx(roll) Ry(pitch) Rz(yaw) takes link axes to world axes, as in the lecture. The angular velocity is the sum
!> of the three rates, each about the axis that its rotation turns about: roll about the world's x axis, pitch about
!> y turned by roll, yaw about the link's own z axis.
module linkdyn_pose
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_trigonometry, only: sine_cosine
    use linkdyn_vec3, only: vec3, mat3, vec3_of, operator(+), operator(-), operator(*), operator(.cross.)
    implicit none (type, external)
    private
    public :: rpy_rotation, rotate_rpy, angular_velocity_rpy, angular_acceleration_rpy, rates_of_rpy
    public :: rotation_about_x, rotation_about_z

    !> A rotation by roll-pitch-yaw angles, with the axis of pitch: y turned by roll.
    type :: rpy_rotation
        type(mat3) :: r
        type(vec3) :: pitch_axis
    end type rpy_rotation

    real(wp), parameter :: x_axis(3) = [1.0_wp, 0.0_wp, 0.0_wp], z_axis(3) = [0.0_wp, 0.0_wp, 1.0_wp]

contains

    !> Rotation matrix of roll-pitch-yaw angles.
    pure subroutine rotate_rpy(roll, pitch, yaw, rotation)
        real(wp), intent(in) :: roll(lanes), pitch(lanes), yaw(lanes)    !! [rad]
        type(rpy_rotation), intent(out) :: rotation
        real(wp), dimension(lanes) :: ca, sa, cb, sb, cg, sg

        call sine_cosine(roll, sa, ca)
        call sine_cosine(pitch, sb, cb)
        call sine_cosine(yaw, sg, cg)
        rotation%r%x%x = cb*cg
        rotation%r%x%y = ca*sg + sa*sb*cg
        rotation%r%x%z = sa*sg - ca*sb*cg
        rotation%r%y%x = -cb*sg
        rotation%r%y%y = ca*cg - sa*sb*sg
        rotation%r%y%z = sa*cg + ca*sb*sg
        rotation%r%z%x = sb
        rotation%r%z%y = -sa*cb
        rotation%r%z%z = ca*cb
        rotation%pitch_axis%x = 0
        rotation%pitch_axis%y = ca
        rotation%pitch_axis%z = sa
    end subroutine rotate_rpy

    !> Angular velocity in world axes [rad/s].
    pure function angular_velocity_rpy(rotation, rate) result(omega)
        type(rpy_rotation), intent(in) :: rotation
        real(wp), intent(in) :: rate(lanes, 3)     !! rates of roll, pitch, yaw [rad/s]
        type(vec3) :: omega

        omega = rate(:, 1)*vec3_of(x_axis) + rate(:, 2)*rotation%pitch_axis + rate(:, 3)*rotation%r%z
    end function angular_velocity_rpy

    !> Rates of roll, pitch, yaw from the angular velocity: the inverse of `angular_velocity_rpy`. Not finite at
    !> pitch = 90 degrees.
    pure function rates_of_rpy(roll, pitch, omega) result(rate)
        real(wp), intent(in) :: roll(lanes), pitch(lanes)    !! [rad]
        type(vec3), intent(in) :: omega                      !! world axes [rad/s]
        real(wp) :: rate(lanes, 3)
        real(wp), dimension(lanes) :: ca, sa, cb, sb

        call sine_cosine(roll, sa, ca)
        call sine_cosine(pitch, sb, cb)
        rate(:, 2) = ca*omega%y + sa*omega%z
        rate(:, 3) = (ca*omega%z - sa*omega%y)/cb
        rate(:, 1) = omega%x - sb*rate(:, 3)
    end function rates_of_rpy

    !> Angular acceleration in world axes [rad/s2].
    pure function angular_acceleration_rpy(rotation, rate, rate2) result(alpha)
        type(rpy_rotation), intent(in) :: rotation
        real(wp), intent(in) :: rate(lanes, 3)     !! rates of roll, pitch, yaw [rad/s]
        real(wp), intent(in) :: rate2(lanes, 3)    !! their derivatives [rad/s2]
        type(vec3) :: alpha, roll_axis, turning

        ! The pitch axis is carried round by roll, the yaw axis by roll and pitch.
        roll_axis = vec3_of(x_axis)
        turning = rate(:, 1)*roll_axis + rate(:, 2)*rotation%pitch_axis
        alpha = angular_velocity_rpy(rotation, rate2) &
                + (rate(:, 1)*rate(:, 2))*(roll_axis.cross.rotation%pitch_axis) &
                + rate(:, 3)*(turning.cross.rotation%r%z)
    end function angular_acceleration_rpy

    !> Rotation by an angle about z.
    pure function rotation_about_z(angle) result(r)
        real(wp), intent(in) :: angle(lanes)    !! [rad]
        type(mat3) :: r

        call sine_cosine(angle, r%x%y, r%x%x)
        r%x%z = 0
        r%y%x = -r%x%y
        r%y%y = r%x%x
        r%y%z = 0
        r%z = vec3_of(z_axis)
    end function rotation_about_z

    !> Rotation by an angle about x.
    pure function rotation_about_x(angle) result(r)
        real(wp), intent(in) :: angle(lanes)    !! [rad]
        type(mat3) :: r

        r%x = vec3_of(x_axis)
        r%y%x = 0
        call sine_cosine(angle, r%y%z, r%y%y)
        r%z%x = 0
        r%z%y = -r%y%z
        r%z%z = r%y%y
    end function rotation_about_x
end module linkdyn_pose
