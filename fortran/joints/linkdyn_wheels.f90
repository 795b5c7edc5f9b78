!> Gears, racks and belts: no marker is held, and the wheels' variables are given (see `linkdyn_gearing`), so nothing is left
!> to close.
module linkdyn_wheels
    use linkdyn_joint_kind, only: joint_kind, marker_pair, joint_shift
    use linkdyn_value, only: value
    use linkdyn_vector, only: zero_vector, identity_rotation
    implicit none (type, external)
    private
    public :: wheels

    type, extends(joint_kind) :: wheels
    contains
        procedure :: constraints
        procedure :: shift
        procedure :: variables
    end type wheels

contains

    function constraints(self, pair) result(c)
        class(wheels), intent(in) :: self
        type(marker_pair), intent(in) :: pair
        type(value), allocatable :: c(:)

        allocate (c(0))
    end function constraints

    !> Nobody asks.
    function shift(self, q) result(s)
        class(wheels), intent(in) :: self
        type(value), intent(in) :: q(:)
        type(joint_shift) :: s

        s%turn = identity_rotation()
        s%slide = zero_vector()
    end function shift

    function variables(self, pair) result(q)
        class(wheels), intent(in) :: self
        type(marker_pair), intent(in) :: pair
        type(value), allocatable :: q(:)

        allocate (q(0))
    end function variables
end module linkdyn_wheels
