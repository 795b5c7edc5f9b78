!> Gears, racks and belts: no marker is held, and the wheels' variables are given (see `linkdyn_gearing`), so nothing is left
!> to close. Nobody asks for their variables, of which there are none, as a weld has none.
module linkdyn_wheels
    use linkdyn_fixed, only: fixed
    use linkdyn_joint_kind, only: marker_pair
    use linkdyn_value, only: value
    implicit none (type, external)
    private
    public :: wheels

    type, extends(fixed) :: wheels
    contains
        procedure :: constraints
    end type wheels

contains

    function constraints(self, pair) result(c)
        class(wheels), intent(in) :: self
        type(marker_pair), intent(in) :: pair
        type(value), allocatable :: c(:)

        allocate (c(0))
    end function constraints
end module linkdyn_wheels
