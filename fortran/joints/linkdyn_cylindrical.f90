!> The cylindrical joint: the second marker turns about z of the first and shifts along it.
module linkdyn_cylindrical
    use linkdyn_attitude, only: rotation_about_z
    use linkdyn_joint_kind, only: joint_kind, marker_pair, joint_shift
    use linkdyn_revolute, only: angle_about_z
    use linkdyn_value, only: value
    use linkdyn_vector, only: unit_vector, operator(*), operator(.dot.)
    implicit none (type, external)
    private
    public :: cylindrical

    type, extends(joint_kind) :: cylindrical
    contains
        procedure :: constraints
        procedure :: shift
        procedure :: variables
    end type cylindrical

contains

    !> The second point lies on the axis, the axes are parallel.
    function constraints(self, pair) result(c)
        class(cylindrical), intent(in) :: self
        type(marker_pair), intent(in) :: pair
        type(value), allocatable :: c(:)

        associate (a => pair%first, b => pair%second)
            c = [pair%gap .dot.a%x, pair%gap .dot.a%y, b%z .dot.a%x, b%z .dot.a%y]
        end associate
    end function constraints

    function shift(self, q) result(s)
        class(cylindrical), intent(in) :: self
        type(value), intent(in) :: q(:)
        type(joint_shift) :: s

        s%turn = rotation_about_z(q(1))
        s%axis(1) = unit_vector(3)
        s%axis(2) = unit_vector(3)
        s%slide = q(2)*s%axis(2)
    end function shift

    function variables(self, pair) result(q)
        class(cylindrical), intent(in) :: self
        type(marker_pair), intent(in) :: pair
        type(value), allocatable :: q(:)

        q = [angle_about_z(pair), pair%gap .dot.pair%first%z]
    end function variables
end module linkdyn_cylindrical
