!> Orientation as a quaternion, for integrating free links.
!>
!> The rotation is read off q/|q|, so it is a rotation to rounding whatever |q| is: the exact solution keeps the length,
!> a numerical one lets it drift without harm, and nothing needs to be projected between steps.
module linkdyn_quaternion
    use linkdyn_cross, only: cross
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_trigonometry, only: sine_cosine
    use linkdyn_vec3, only: vec3, mat3
    implicit none (type, external)
    private
    public :: rotation_of_quaternion, quaternion_of_rotation, quaternion_rate, quaternion_of_rpy
    public :: turned_by, turn_between, turned_vector

contains

    !> Link axes to world axes.
    pure function rotation_of_quaternion(q) result(r)
        real(wp), intent(in) :: q(lanes, 4)    !! w x y z, of any length but zero
        type(mat3) :: r
        real(wp), dimension(lanes) :: scale, sx, sy, sz, wx, wy, wz, xx, xy, xz, yy, yz, zz

        scale = 2/(q(:, 1)**2 + q(:, 2)**2 + q(:, 3)**2 + q(:, 4)**2)
        sx = scale*q(:, 2)
        sy = scale*q(:, 3)
        sz = scale*q(:, 4)
        wx = sx*q(:, 1)
        wy = sy*q(:, 1)
        wz = sz*q(:, 1)
        xx = sx*q(:, 2)
        xy = sx*q(:, 3)
        xz = sx*q(:, 4)
        yy = sy*q(:, 3)
        yz = sy*q(:, 4)
        zz = sz*q(:, 4)
        r%x = vec3(1 - (yy + zz), xy + wz, xz - wy)
        r%y = vec3(xy - wz, 1 - (xx + zz), yz + wx)
        r%z = vec3(xz + wy, yz - wx, 1 - (xx + yy))
    end function rotation_of_quaternion

    !> The unit quaternion of a rotation, from whichever of its components is largest.
    pure function quaternion_of_rotation(r) result(q)
        type(mat3), intent(in) :: r            !! link axes to world axes
        real(wp) :: q(lanes, 4)
        real(wp) :: way(lanes, 4), size_here(lanes)
        integer :: k, i

        q = 0
        size_here = -1
        do k = 1, 4
            select case (k)                    ! 4 times component k times (w, x, y, z)
            case (1)
                way(:, 1) = 1 + r%x%x + r%y%y + r%z%z
                way(:, 2) = r%y%z - r%z%y
                way(:, 3) = r%z%x - r%x%z
                way(:, 4) = r%x%y - r%y%x
            case (2)
                way(:, 1) = r%y%z - r%z%y
                way(:, 2) = 1 + r%x%x - r%y%y - r%z%z
                way(:, 3) = r%x%y + r%y%x
                way(:, 4) = r%z%x + r%x%z
            case (3)
                way(:, 1) = r%z%x - r%x%z
                way(:, 2) = r%x%y + r%y%x
                way(:, 3) = 1 - r%x%x + r%y%y - r%z%z
                way(:, 4) = r%y%z + r%z%y
            case default
                way(:, 1) = r%x%y - r%y%x
                way(:, 2) = r%z%x + r%x%z
                way(:, 3) = r%y%z + r%z%y
                way(:, 4) = 1 - r%x%x - r%y%y + r%z%z
            end select
            do i = 1, 4
                where (way(:, k) > size_here) q(:, i) = way(:, i)
            end do
            size_here = max(size_here, way(:, k))
        end do
        q = q/spread(sqrt(sum(q**2, dim=2)), 2, 4)
    end function quaternion_of_rotation

    !> dq/dt = (0, omega) q / 2.
    elemental subroutine quaternion_rate(w, x, y, z, a, b, c, rate_w, rate_x, rate_y, rate_z)
        real(wp), intent(in) :: w, x, y, z     !! q
        real(wp), intent(in) :: a, b, c        !! omega, world axes [rad/s]
        real(wp), intent(out) :: rate_w, rate_x, rate_y, rate_z

        rate_w = -(a*x + b*y + c*z)/2
        rate_x = (a*w + b*z - c*y)/2
        rate_y = (b*w + c*x - a*z)/2
        rate_z = (c*w + a*y - b*x)/2
    end subroutine quaternion_rate

    !> A quaternion turned about a fixed axis of the world.
    pure function turned_by(q, turn) result(turned)
        real(wp), intent(in) :: q(lanes, 4)
        real(wp), intent(in) :: turn(lanes, 3)    !! along the axis, as long as the angle [rad]
        real(wp) :: turned(lanes, 4)
        real(wp) :: angle(lanes), s(lanes), c(lanes), per_angle(lanes)

        angle = sqrt(sum(turn**2, dim=2))
        call sine_cosine(angle/2, s, c)
        per_angle = merge(s/max(angle, tiny(1.0_wp)), 0.5_wp, angle > 0)
        call quaternion_rate(q(:, 1), q(:, 2), q(:, 3), q(:, 4), turn(:, 1), turn(:, 2), turn(:, 3), &
                             turned(:, 1), turned(:, 2), turned(:, 3), turned(:, 4))
        turned = spread(c, 2, 4)*q + spread(2*per_angle, 2, 4)*turned
    end function turned_by

    !> A vector turned by a quaternion of length one.
    pure function turned_vector(q, x) result(y)
        real(wp), intent(in) :: q(4), x(3)
        real(wp) :: y(3)

        y = x + 2*cross(q(2:), q(1)*x + cross(q(2:), x))
    end function turned_vector

    !> The turn, at most half a one, that takes one orientation to another: along its axis, world axes [rad].
    pure function turn_between(from, to) result(turn)
        real(wp), intent(in) :: from(lanes, 4), to(lanes, 4)
        real(wp) :: turn(lanes, 3)
        real(wp) :: w(lanes), length(lanes)

        ! to times the conjugate of from
        w = sum(to*from, dim=2)
        turn(:, 1) = from(:, 1)*to(:, 2) - to(:, 1)*from(:, 2) + from(:, 3)*to(:, 4) - from(:, 4)*to(:, 3)
        turn(:, 2) = from(:, 1)*to(:, 3) - to(:, 1)*from(:, 3) - from(:, 2)*to(:, 4) + from(:, 4)*to(:, 2)
        turn(:, 3) = from(:, 1)*to(:, 4) - to(:, 1)*from(:, 4) + from(:, 2)*to(:, 3) - from(:, 3)*to(:, 2)
        length = sqrt(sum(turn**2, dim=2))
        turn = turn*spread(merge(2*atan2(length, abs(w))/max(length, tiny(1.0_wp)), 0.0_wp, length > 0) &
                           *sign(1.0_wp, w), 2, 3)
    end function turn_between

    !> The unit quaternion of Rx(roll) Ry(pitch) Rz(yaw).
    pure function quaternion_of_rpy(roll, pitch, yaw) result(q)
        real(wp), intent(in) :: roll(lanes), pitch(lanes), yaw(lanes)    !! [rad]
        real(wp) :: q(lanes, 4)
        real(wp), dimension(lanes) :: ca, sa, cb, sb, cg, sg

        call sine_cosine(roll/2, sa, ca)
        call sine_cosine(pitch/2, sb, cb)
        call sine_cosine(yaw/2, sg, cg)
        q(:, 1) = ca*cb*cg - sa*sb*sg
        q(:, 2) = sa*cb*cg + ca*sb*sg
        q(:, 3) = ca*sb*cg - sa*cb*sg
        q(:, 4) = ca*cb*sg + sa*sb*cg
    end function quaternion_of_rpy
end module linkdyn_quaternion
