!> The revolute joint, a hinge: the second marker turns about z of the first.
module linkdyn_revolute
    use linkdyn_attitude, only: rotation_about_z
    use linkdyn_joint_kind, only: joint_kind, marker_pair, joint_shift
    use linkdyn_value, only: value, atan2
    use linkdyn_vector, only: components, zero_vector, unit_vector, operator(.dot.)
    implicit none (type, external)
    private
    public :: revolute, angle_about_z

    type, extends(joint_kind) :: revolute
    contains
        procedure :: constraints
        procedure :: shift
        procedure :: variables
    end type revolute

contains

    !> The points meet, the axes are parallel.
    function constraints(self, pair) result(c)
        class(revolute), intent(in) :: self
        type(marker_pair), intent(in) :: pair
        type(value), allocatable :: c(:)

        c = [components(pair%gap), pair%second%z .dot.pair%first%x, pair%second%z .dot.pair%first%y]
    end function constraints

    function shift(self, q) result(s)
        class(revolute), intent(in) :: self
        type(value), intent(in) :: q(:)
        type(joint_shift) :: s

        s%turn = rotation_about_z(q(1))
        s%slide = zero_vector()
        s%axis(1) = unit_vector(3)
    end function shift

    function variables(self, pair) result(q)
        class(revolute), intent(in) :: self
        type(marker_pair), intent(in) :: pair
        type(value), allocatable :: q(:)

        q = [angle_about_z(pair)]
    end function variables

    !> Angle by which the second marker has turned about z of the first.
    function angle_about_z(pair) result(angle)
        type(marker_pair), intent(in) :: pair
        type(value) :: angle

        angle = atan2(pair%second%x .dot.pair%first%y, pair%second%x .dot.pair%first%x)
    end function angle_about_z
end module linkdyn_revolute
