!> Rotations from angles and quaternions, on values.
!>
!> R = Rx(roll) Ry(pitch) Rz(yaw) takes link axes to world axes, as in the lecture.
module linkdyn_attitude
    use linkdyn_kinds, only: wp
    use linkdyn_value, only: value, zero, one, operator(+), operator(-), operator(*), sin, cos, atan2, sqrt, reciprocal, square
    use linkdyn_vector, only: vector, rotation, unit_vector, operator(+), operator(*), operator(.cross.)
    implicit none (type, external)
    private
    public :: rotation_about_z, rotation_in_plane, rotation_by_angles, angular_velocity, angular_acceleration, angles_of_rotation
    public :: rates_of_angles, rotation_by_quaternion, quaternion_rates

contains

    function rotation_about_z(angle) result(r)
        type(value), intent(in) :: angle    !! [rad]
        type(rotation) :: r

        r = rotation_in_plane(cos(angle), sin(angle))
    end function rotation_about_z

    !> The same by cosine and sine.
    function rotation_in_plane(c, s) result(r)
        type(value), intent(in) :: c, s
        type(rotation) :: r

        r%x = vector(c, s, zero())
        r%y = vector(-s, c, zero())
        r%z = unit_vector(3)
    end function rotation_in_plane

    function rotation_by_angles(angle) result(r)
        type(value), intent(in) :: angle(3) !! roll, pitch, yaw [rad]
        type(rotation) :: r
        type(value), dimension(3) :: s, c

        s = sin(angle)
        c = cos(angle)
        r%x = vector(c(2)*c(3), c(1)*s(3) + (s(1)*s(2))*c(3), s(1)*s(3) - (c(1)*s(2))*c(3))
        r%y = vector(-(c(2)*s(3)), c(1)*c(3) - (s(1)*s(2))*s(3), s(1)*c(3) + (c(1)*s(2))*s(3))
        r%z = vector(s(2), -(s(1)*c(2)), c(1)*c(2))
    end function rotation_by_angles

    !> The sum of the rates, each about the axis that its angle turns about: roll about x, pitch about y turned by roll,
    !> yaw about z of the turned axes.
    function angular_velocity(angle, rate) result(omega)
        type(value), intent(in) :: angle(3), rate(3)
        type(vector) :: omega
        type(rotation) :: r

        r = rotation_by_angles(angle)
        omega = rate(1)*unit_vector(1) + rate(2)*pitch_axis(angle) + rate(3)*r%z
    end function angular_velocity

    !> Angular acceleration by angles and their rates: roll carries the axis of pitch round, roll and pitch that of yaw.
    function angular_acceleration(angle, rate, rate2) result(alpha)
        type(value), intent(in) :: angle(3), rate(3), rate2(3)
        type(vector) :: alpha
        type(vector) :: x, y
        type(rotation) :: r

        r = rotation_by_angles(angle)
        x = unit_vector(1)
        y = pitch_axis(angle)
        alpha = rate2(1)*x + rate2(2)*y + rate2(3)*r%z + (rate(1)*rate(2))*(x.cross.y) &
                + rate(3)*((rate(1)*x + rate(2)*y).cross.r%z)
    end function angular_acceleration

    function pitch_axis(angle) result(y)
        type(value), intent(in) :: angle(3)
        type(vector) :: y

        y = vector(zero(), cos(angle(1)), sin(angle(1)))
    end function pitch_axis

    !> Roll, pitch, yaw of a rotation, pitch within a right angle. Yaw is what is left once roll is taken away: so the three tell
    !> the rotation at a right angle, too, where roll alone is not certain.
    function angles_of_rotation(r) result(angle)
        type(rotation), intent(in) :: r
        type(value) :: angle(3), c, s

        angle(1) = atan2(-r%z%y, r%z%z)
        angle(2) = atan2(r%z%x, sqrt(square(r%z%y) + square(r%z%z)))
        c = cos(angle(1))
        s = sin(angle(1))
        angle(3) = atan2(c*r%x%y + s*r%x%z, c*r%y%y + s*r%y%z)
    end function angles_of_rotation

    !> Rates of roll, pitch, yaw from the angular velocity. Not finite where pitch is a right angle.
    function rates_of_angles(r, omega) result(rate)
        type(rotation), intent(in) :: r
        type(vector), intent(in) :: omega    !! in the axes that the rotation starts from [rad/s]
        type(value) :: rate(3)
        type(value) :: c2, sine, cosine

        ! z of the turned axes is (sin pitch, -sin roll cos pitch, cos roll cos pitch)
        c2 = reciprocal(sqrt(square(r%z%y) + square(r%z%z)))
        sine = -(r%z%y*c2)
        cosine = r%z%z*c2
        rate(2) = cosine*omega%y + sine*omega%z
        rate(3) = (cosine*omega%z - sine*omega%y)*c2
        rate(1) = omega%x - r%z%x*rate(3)
    end function rates_of_angles

    !> Rotation of a unit quaternion (scalar first).
    function rotation_by_quaternion(p) result(r)
        type(value), intent(in) :: p(4)
        type(rotation) :: r
        type(value) :: scale, x2, y2, z2, w2

        scale = 2.0_wp*reciprocal(square(p(1)) + square(p(2)) + square(p(3)) + square(p(4)))
        x2 = scale*p(2)
        y2 = scale*p(3)
        z2 = scale*p(4)
        w2 = scale*p(1)
        r%x = vector(one() - (p(3)*y2 + p(4)*z2), p(2)*y2 + p(4)*w2, p(2)*z2 - p(3)*w2)
        r%y = vector(p(2)*y2 - p(4)*w2, one() - (p(2)*x2 + p(4)*z2), p(3)*z2 + p(2)*w2)
        r%z = vector(p(2)*z2 + p(3)*w2, p(3)*z2 - p(2)*w2, one() - (p(2)*x2 + p(3)*y2))
    end function rotation_by_quaternion

    !> Rate of a quaternion (scalar first) by an angular velocity in the axes that it turns from: half their product.
    function quaternion_rates(p, omega) result(rate)
        type(value), intent(in) :: p(4)
        type(value), intent(in) :: omega(3)    !! [rad/s]
        type(value) :: rate(4)

        rate(1) = -(0.5_wp*(omega(1)*p(2) + omega(2)*p(3) + omega(3)*p(4)))
        rate(2) = 0.5_wp*(omega(1)*p(1) + omega(2)*p(4) - omega(3)*p(3))
        rate(3) = 0.5_wp*(omega(2)*p(1) + omega(3)*p(2) - omega(1)*p(4))
        rate(4) = 0.5_wp*(omega(3)*p(1) + omega(1)*p(3) - omega(2)*p(2))
    end function quaternion_rates
end module linkdyn_attitude
