!> The universal joint: the second marker turns about z of the first, then about its own z, which is y of the first
!> marker while the first angle is zero.
module linkdyn_universal
    use linkdyn_attitude, only: rotation_about_z
    use linkdyn_joint_kind, only: joint_kind, marker_pair, joint_shift
    use linkdyn_value, only: value, sin, cos, atan2, zero, operator(-)
    use linkdyn_vector, only: vector, rotation, components, zero_vector, unit_vector, operator(*), operator(-), operator(.dot.)
    implicit none (type, external)
    private
    public :: universal

    type, extends(joint_kind) :: universal
    contains
        procedure :: constraints
        procedure :: shift
        procedure :: variables
        procedure :: axis_side
    end type universal

contains

    !> The points meet, the axes are square to each other.
    function constraints(self, pair) result(c)
        class(universal), intent(in) :: self
        type(marker_pair), intent(in) :: pair
        type(value), allocatable :: c(:)

        c = [components(pair%gap), pair%second%z .dot.pair%first%z]
    end function constraints

    !> Rz(angle1) Rx(-90 deg) Rz(angle2)
    function shift(self, q) result(s)
        class(universal), intent(in) :: self
        type(value), intent(in) :: q(:)
        type(joint_shift) :: s
        type(rotation) :: cross_piece

        cross_piece%x = vector(cos(q(1)), sin(q(1)), zero())
        cross_piece%y = -unit_vector(3)
        cross_piece%z = vector(-sin(q(1)), cos(q(1)), zero())
        s%turn = cross_piece*rotation_about_z(q(2))
        s%slide = zero_vector()
        s%axis(1) = unit_vector(3)
        s%axis(2) = cross_piece%z
    end function shift

    function variables(self, pair) result(q)
        class(universal), intent(in) :: self
        type(marker_pair), intent(in) :: pair
        type(value), allocatable :: q(:)

        associate (a => pair%first, b => pair%second)
            q = [atan2(-(b%z .dot.a%x), b%z .dot.a%y), atan2(-(b%x .dot.a%z), -(b%y .dot.a%z))]
        end associate
    end function variables

    integer function axis_side(self, k)
        class(universal), intent(in) :: self
        integer, intent(in) :: k

        axis_side = k
    end function axis_side
end module linkdyn_universal
