!> Where a link is, seen from another, without anything that holds it there: the position of a point along the first marker's
!> axes, and three angles, Rx(roll) Ry(pitch) Rz(yaw). Coordinates lead links by these.
module linkdyn_pose_parts
    use linkdyn_joint_kind, only: joint_kind, marker_pair, joint_shift
    use linkdyn_spherical, only: spherical
    use linkdyn_value, only: value
    use linkdyn_vector, only: vector, rotation, unit_vector, operator(.dot.)
    implicit none (type, external)
    private
    public :: position_part, attitude_part

    type, extends(joint_kind) :: position_part
    contains
        procedure :: constraints => no_constraints
        procedure :: shift
        procedure :: variables
    end type position_part

    !> As a ball counts them.
    type, extends(spherical) :: attitude_part
    contains
        procedure :: constraints => no_constraints_either
    end type attitude_part

contains

    function no_constraints(self, pair) result(c)
        class(position_part), intent(in) :: self
        type(marker_pair), intent(in) :: pair
        type(value), allocatable :: c(:)

        allocate (c(0))
    end function no_constraints

    function shift(self, q) result(s)
        class(position_part), intent(in) :: self
        type(value), intent(in) :: q(:)
        type(joint_shift) :: s

        s%turn = rotation(unit_vector(1), unit_vector(2), unit_vector(3))
        s%slide = vector(q(1), q(2), q(3))
        s%axis = [unit_vector(1), unit_vector(2), unit_vector(3)]
    end function shift

    function variables(self, pair) result(q)
        class(position_part), intent(in) :: self
        type(marker_pair), intent(in) :: pair
        type(value), allocatable :: q(:)

        q = [pair%gap .dot.pair%first%x, pair%gap .dot.pair%first%y, pair%gap .dot.pair%first%z]
    end function variables

    function no_constraints_either(self, pair) result(c)
        class(attitude_part), intent(in) :: self
        type(marker_pair), intent(in) :: pair
        type(value), allocatable :: c(:)

        allocate (c(0))
    end function no_constraints_either
end module linkdyn_pose_parts
