!> Roll, pitch and yaw of a single attitude: R = Rx(roll) Ry(pitch) Rz(yaw), and what they have to do with matrices, quaternions,
!> angular velocity and acceleration.
!>
!> Where pitch is a right angle, at the pole, roll and yaw turn about one line: angles still tell the attitude, but their rates not
!> every angular velocity, and near there they are large and take digits away. Whoever knows an attitude otherwise then goes by it.
module linkdyn_angles
    use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
    use linkdyn_cross, only: cross
    use linkdyn_kinds, only: wp
    use linkdyn_text, only: to_text
    implicit none (type, external)
    private
    public :: matrix_of_angles, angles_of_matrix, matrix_of_quaternion, quaternion_of_matrix, find_rotation_fault, &
        spin_of_quaternion, spin_of_angles, angles_by_spin, is_near_pole

    real(wp), parameter :: near_pole = 0.05_wp    !! cosine of pitch: rates from there on lose a factor of 400 to rounding at most

contains

    pure function matrix_of_angles(angle) result(r)
        real(wp), intent(in) :: angle(3)       !! roll, pitch, yaw [rad]
        real(wp) :: r(3, 3)
        real(wp), dimension(3) :: s, c

        s = sin(angle)
        c = cos(angle)
        r(:, 1) = [c(2)*c(3), c(1)*s(3) + s(1)*s(2)*c(3), s(1)*s(3) - c(1)*s(2)*c(3)]
        r(:, 2) = [-c(2)*s(3), c(1)*c(3) - s(1)*s(2)*s(3), s(1)*c(3) + c(1)*s(2)*s(3)]
        r(:, 3) = [s(2), -s(1)*c(2), c(1)*c(2)]
    end function matrix_of_angles

    !> Pitch within a right angle. Yaw is what is left once roll and pitch are taken away, so that the three tell the matrix however
    !> near the pole they are: there roll alone is not certain.
    pure function angles_of_matrix(r) result(angle)
        real(wp), intent(in) :: r(3, 3)
        real(wp) :: angle(3)
        real(wp) :: s, c

        angle(1) = 0
        if (any(abs(r(2:3, 3)) > 0)) angle(1) = atan2(-r(2, 3), r(3, 3))
        angle(2) = atan2(r(1, 3), hypot(r(2, 3), r(3, 3)))
        s = sin(angle(1))
        c = cos(angle(1))
        angle(3) = atan2(c*r(2, 1) + s*r(3, 1), c*r(2, 2) + s*r(3, 2))
    end function angles_of_matrix

    pure logical function is_near_pole(angle)
        real(wp), intent(in) :: angle(3)

        is_near_pole = abs(cos(angle(2))) < near_pole
    end function is_near_pole

    !> Rotation matrix of a quaternion w x y z of any length but zero.
    pure function matrix_of_quaternion(p) result(r)
        real(wp), intent(in) :: p(4)
        real(wp) :: r(3, 3)
        real(wp) :: v(3), q(4)

        q = p/maxval(abs(p))
        v = q(2:)*(2/sum(q**2))
        r(:, 1) = [1 - (q(3)*v(2) + q(4)*v(3)), q(2)*v(2) + q(1)*v(3), q(2)*v(3) - q(1)*v(2)]
        r(:, 2) = [q(2)*v(2) - q(1)*v(3), 1 - (q(2)*v(1) + q(4)*v(3)), q(3)*v(3) + q(1)*v(1)]
        r(:, 3) = [q(2)*v(3) + q(1)*v(2), q(3)*v(3) - q(1)*v(1), 1 - (q(2)*v(1) + q(3)*v(2))]
    end function matrix_of_quaternion

    !> The unit quaternion of a rotation, from whichever of its components is largest.
    pure function quaternion_of_matrix(r) result(p)
        real(wp), intent(in) :: r(3, 3)
        real(wp) :: p(4)
        real(wp) :: times(4, 4)                ! column k: 4 times component k times (w, x, y, z)
        integer :: k

        times(:, 1) = [1 + r(1, 1) + r(2, 2) + r(3, 3), r(3, 2) - r(2, 3), r(1, 3) - r(3, 1), r(2, 1) - r(1, 2)]
        times(:, 2) = [r(3, 2) - r(2, 3), 1 + r(1, 1) - r(2, 2) - r(3, 3), r(2, 1) + r(1, 2), r(1, 3) + r(3, 1)]
        times(:, 3) = [r(1, 3) - r(3, 1), r(2, 1) + r(1, 2), 1 - r(1, 1) + r(2, 2) - r(3, 3), r(3, 2) + r(2, 3)]
        times(:, 4) = [r(2, 1) - r(1, 2), r(1, 3) + r(3, 1), r(3, 2) + r(2, 3), 1 - r(1, 1) - r(2, 2) + r(3, 3)]
        k = maxloc([(times(k, k), k=1, 4)], dim=1)
        p = times(:, k)/norm2(times(:, k))
    end function quaternion_of_matrix

    !> What keeps a matrix from being a rotation, of which six digits may be written; empty: nothing does.
    subroutine find_rotation_fault(r, fault)
        real(wp), intent(in) :: r(3, 3)
        character(len=:), allocatable, intent(out) :: fault
        real(wp), parameter :: unit(3, 3) = reshape([1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 1.0_wp], &
                                                    [3, 3])
        real(wp), parameter :: off = 1.0e-5_wp
        real(wp) :: most

        fault = ""
        most = maxval(abs(matmul(r, transpose(r)) - unit))
        if (.not. all(ieee_is_finite(r))) then
            fault = "is not of finite numbers"
        else if (.not. most <= off) then
            fault = "is not a rotation: its rows are not orthonormal, by "//to_text(most)
        else if (dot_product(r(1, :), cross(r(2, :), r(3, :))) < 0) then
            fault = "mirrors (expected a rotation, whose determinant is 1)"
        end if
    end subroutine find_rotation_fault

    !> Angular velocity and acceleration, in the axes that the attitude starts from, of a quaternion of any length with its rates:
    !> omega is the vector of 2 p' p^-1, which how its length changes has no part in.
    pure subroutine spin_of_quaternion(p, rate, rate2, omega, alpha)
        real(wp), intent(in) :: p(4), rate(4), rate2(4)
        real(wp), intent(out) :: omega(3), alpha(3)
        real(wp) :: square

        square = sum(p**2)
        omega = 2*turning(p, rate)/square
        alpha = 2*turning(p, rate2)/square - omega*(2*sum(p*rate)/square)

    contains

        !> The vector of b times the conjugate of a.
        pure function turning(a, b) result(v)
            real(wp), intent(in) :: a(4), b(4)
            real(wp) :: v(3)

            v = a(1)*b(2:) - b(1)*a(2:) - cross(b(2:), a(2:))
        end function turning
    end subroutine spin_of_quaternion

    !> Angular velocity and acceleration from the rates of the angles.
    pure subroutine spin_of_angles(angle, rate, rate2, omega, alpha)
        real(wp), intent(in) :: angle(3), rate(3), rate2(3)
        real(wp), intent(out) :: omega(3), alpha(3)
        real(wp) :: axis(3, 3)

        axis = axes_of(angle)
        omega = matmul(axis, rate)
        alpha = matmul(axis, rate2) + carried(axis, rate)
    end subroutine spin_of_angles

    !> The other way round. Not finite at the pole.
    pure subroutine angles_by_spin(angle, omega, alpha, rate, rate2)
        real(wp), intent(in) :: angle(3), omega(3), alpha(3)
        real(wp), intent(out) :: rate(3), rate2(3)

        rate = shares(omega)
        rate2 = shares(alpha - carried(axes_of(angle), rate))

    contains

        !> Parts of a vector along the axes of the three angles.
        pure function shares(v)
            real(wp), intent(in) :: v(3)
            real(wp) :: shares(3)
            real(wp) :: s, c

            s = sin(angle(1))
            c = cos(angle(1))
            shares(2) = c*v(2) + s*v(3)
            shares(3) = (c*v(3) - s*v(2))/cos(angle(2))
            shares(1) = v(1) - sin(angle(2))*shares(3)
        end function shares
    end subroutine angles_by_spin

    !> Axes that the three angles turn about.
    pure function axes_of(angle) result(axis)
        real(wp), intent(in) :: angle(3)
        real(wp) :: axis(3, 3)

        axis(:, 1) = [1.0_wp, 0.0_wp, 0.0_wp]
        axis(:, 2) = [0.0_wp, cos(angle(1)), sin(angle(1))]
        axis(:, 3) = [sin(angle(2)), -sin(angle(1))*cos(angle(2)), cos(angle(1))*cos(angle(2))]
    end function axes_of

    !> What rates that stay give: roll carries the axis of pitch round, roll and pitch that of yaw.
    pure function carried(axis, rate) result(alpha)
        real(wp), intent(in) :: axis(3, 3), rate(3)
        real(wp) :: alpha(3)

        alpha = rate(1)*rate(2)*cross(axis(:, 1), axis(:, 2)) &
                + rate(3)*cross(rate(1)*axis(:, 1) + rate(2)*axis(:, 2), axis(:, 3))
    end function carried
end module linkdyn_angles
