!> The spherical joint, a ball: the markers' points meet. Its variables roll, pitch, yaw count the second frame against
!> the first, Rx(roll) Ry(pitch) Rz(yaw).
module linkdyn_spherical
    use linkdyn_attitude, only: rotation_by_angles, angles_of_rotation, rates_of_angles
    use linkdyn_joint_kind, only: joint_kind, marker_pair, joint_shift
    use linkdyn_value, only: value, sin, cos, zero
    use linkdyn_vector, only: vector, rotation, components, zero_vector, unit_vector, operator(.unrotate.)
    implicit none (type, external)
    private
    public :: spherical

    type, extends(joint_kind) :: spherical
    contains
        procedure :: constraints
        procedure :: shift
        procedure :: variables
        procedure :: rates
    end type spherical

contains

    function constraints(self, pair) result(c)
        class(spherical), intent(in) :: self
        type(marker_pair), intent(in) :: pair
        type(value), allocatable :: c(:)

        c = components(pair%gap)
    end function constraints

    function shift(self, q) result(s)
        class(spherical), intent(in) :: self
        type(value), intent(in) :: q(:)
        type(joint_shift) :: s

        s%turn = rotation_by_angles(q(:3))
        s%slide = zero_vector()
        s%axis(1) = unit_vector(1)
        s%axis(2) = vector(zero(), cos(q(1)), sin(q(1)))
        s%axis(3) = s%turn%z
    end function shift

    function variables(self, pair) result(q)
        class(spherical), intent(in) :: self
        type(marker_pair), intent(in) :: pair
        type(value), allocatable :: q(:)

        q = angles_of_rotation(relative_rotation(pair))
    end function variables

    !> Not finite where pitch is a right angle.
    function rates(self, pair, omega, gap_rate) result(qd)
        class(spherical), intent(in) :: self
        type(marker_pair), intent(in) :: pair
        type(vector), intent(in) :: omega, gap_rate
        type(value), allocatable :: qd(:)

        qd = rates_of_angles(relative_rotation(pair), pair%first.unrotate.omega)
    end function rates

    !> From the second marker's axes to the first's.
    function relative_rotation(pair) result(r)
        type(marker_pair), intent(in) :: pair
        type(rotation) :: r

        associate (a => pair%first, b => pair%second)
            r = rotation(a.unrotate.b%x, a.unrotate.b%y, a.unrotate.b%z)
        end associate
    end function relative_rotation
end module linkdyn_spherical
