!> What is left of joints that let go of what others hold already: a point in a groove, a point on a plate, a key, nothing. Their
!> variables are those of the joints that they are left of.
module linkdyn_partial_joints
    use linkdyn_joint_kind, only: joint_kind, marker_pair, joint_shift
    use linkdyn_value, only: value
    use linkdyn_vector, only: rotation, unit_vector, zero_vector, operator(.dot.)
    implicit none (type, external)
    private
    public :: groove, plate, key, loose

    !> Nothing, and what all four have in common.
    type, extends(joint_kind) :: loose
    contains
        procedure :: constraints => no_constraints
        procedure :: shift
        procedure :: variables
    end type loose

    !> The second point on the first marker's z axis.
    type, extends(loose) :: groove
    contains
        procedure :: constraints => on_line
    end type groove

    !> The second point in the plane square to the first marker's z axis.
    type, extends(loose) :: plate
    contains
        procedure :: constraints => in_plane
    end type plate

    !> No turning about the axis square to the z axes of both markers.
    type, extends(loose) :: key
    contains
        procedure :: constraints => keyed
    end type key

contains

    function no_constraints(self, pair) result(c)
        class(loose), intent(in) :: self
        type(marker_pair), intent(in) :: pair
        type(value), allocatable :: c(:)

        allocate (c(0))
    end function no_constraints

    function on_line(self, pair) result(c)
        class(groove), intent(in) :: self
        type(marker_pair), intent(in) :: pair
        type(value), allocatable :: c(:)

        c = [pair%gap .dot.pair%first%x, pair%gap .dot.pair%first%y]
    end function on_line

    function in_plane(self, pair) result(c)
        class(plate), intent(in) :: self
        type(marker_pair), intent(in) :: pair
        type(value), allocatable :: c(:)

        c = [pair%gap .dot.pair%first%z]
    end function in_plane

    function keyed(self, pair) result(c)
        class(key), intent(in) :: self
        type(marker_pair), intent(in) :: pair
        type(value), allocatable :: c(:)

        c = [pair%second%z .dot.pair%first%z]
    end function keyed

    !> No link hangs on such a joint.
    function shift(self, q) result(s)
        class(loose), intent(in) :: self
        type(value), intent(in) :: q(:)
        type(joint_shift) :: s

        s%turn = rotation(unit_vector(1), unit_vector(2), unit_vector(3))
        s%slide = zero_vector()
    end function shift

    function variables(self, pair) result(q)
        class(loose), intent(in) :: self
        type(marker_pair), intent(in) :: pair
        type(value), allocatable :: q(:)

        allocate (q(0))
    end function variables
end module linkdyn_partial_joints
