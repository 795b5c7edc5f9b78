!> Motion of a point fixed to a link: from the motion of the link's origin.
module linkdyn_point
    use linkdyn_vec3, only: vec3, operator(+), operator(.cross.)
    implicit none (type, external)
    private
    public :: point_velocity, point_acceleration, point_column

contains

    !> Velocity of the point at `arm` from the origin (world axes).
    pure function point_velocity(velocity, omega, arm) result(v)
        type(vec3), intent(in) :: velocity    !! of the origin [m/s]
        type(vec3), intent(in) :: omega       !! angular velocity [rad/s]
        type(vec3), intent(in) :: arm         !! from the origin to the point [m]
        type(vec3) :: v

        v = velocity + (omega.cross.arm)
    end function point_velocity

    !> Acceleration of the point at `arm` from the origin (all vectors in the same axes).
    pure function point_acceleration(acceleration, omega, alpha, arm) result(a)
        type(vec3), intent(in) :: acceleration    !! of the origin [m/s2]
        type(vec3), intent(in) :: omega, alpha    !! angular velocity [rad/s] and acceleration [rad/s2]
        type(vec3), intent(in) :: arm             !! [m]
        type(vec3) :: a

        a = acceleration + (alpha.cross.arm) + (omega.cross.(omega.cross.arm))
    end function point_acceleration

    !> One column of the acceleration of a point: the part linear in a generalized acceleration.
    pure function point_column(acceleration, alpha, arm) result(a)
        type(vec3), intent(in) :: acceleration    !! column of the origin
        type(vec3), intent(in) :: alpha           !! column of the angular acceleration
        type(vec3), intent(in) :: arm             !! [m]
        type(vec3) :: a

        a = acceleration + (alpha.cross.arm)
    end function point_column
end module linkdyn_point
