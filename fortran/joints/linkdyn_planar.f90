!> The planar joint: the second marker lies in the plane square to z of the first, shifts along its x and y and turns about z.
module linkdyn_planar
    use linkdyn_attitude, only: rotation_about_z
    use linkdyn_joint_kind, only: joint_kind, marker_pair, joint_shift
    use linkdyn_revolute, only: angle_about_z
    use linkdyn_value, only: value, zero
    use linkdyn_vector, only: vector, unit_vector, operator(.dot.)
    implicit none (type, external)
    private
    public :: planar

    type, extends(joint_kind) :: planar
    contains
        procedure :: constraints
        procedure :: shift
        procedure :: variables
    end type planar

contains

    !> The second point lies in the plane, the axes are parallel.
    function constraints(self, pair) result(c)
        class(planar), intent(in) :: self
        type(marker_pair), intent(in) :: pair
        type(value), allocatable :: c(:)

        associate (a => pair%first, b => pair%second)
            c = [pair%gap .dot.a%z, b%z .dot.a%x, b%z .dot.a%y]
        end associate
    end function constraints

    function shift(self, q) result(s)
        class(planar), intent(in) :: self
        type(value), intent(in) :: q(:)
        type(joint_shift) :: s

        s%turn = rotation_about_z(q(3))
        s%slide = vector(q(1), q(2), zero())
        s%axis = [unit_vector(1), unit_vector(2), unit_vector(3)]
    end function shift

    function variables(self, pair) result(q)
        class(planar), intent(in) :: self
        type(marker_pair), intent(in) :: pair
        type(value), allocatable :: q(:)

        q = [pair%gap .dot.pair%first%x, pair%gap .dot.pair%first%y, angle_about_z(pair)]
    end function variables
end module linkdyn_planar
