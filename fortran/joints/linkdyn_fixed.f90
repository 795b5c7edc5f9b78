!> The fixed joint, a weld: the second marker stands where the first does.
module linkdyn_fixed
    use linkdyn_joint_kind, only: joint_kind, marker_pair, joint_shift
    use linkdyn_value, only: value
    use linkdyn_vector, only: components, identity_rotation, zero_vector, operator(.dot.)
    implicit none (type, external)
    private
    public :: fixed

    type, extends(joint_kind) :: fixed
    contains
        procedure :: constraints
        procedure :: shift
        procedure :: variables
    end type fixed

contains

    !> The points meet, the frames are parallel.
    function constraints(self, pair) result(c)
        class(fixed), intent(in) :: self
        type(marker_pair), intent(in) :: pair
        type(value), allocatable :: c(:)

        associate (a => pair%first, b => pair%second)
            c = [components(pair%gap), b%z .dot.a%x, b%z .dot.a%y, b%x .dot.a%y]
        end associate
    end function constraints

    function shift(self, q) result(s)
        class(fixed), intent(in) :: self
        type(value), intent(in) :: q(:)
        type(joint_shift) :: s

        s%turn = identity_rotation()
        s%slide = zero_vector()
    end function shift

    function variables(self, pair) result(q)
        class(fixed), intent(in) :: self
        type(marker_pair), intent(in) :: pair
        type(value), allocatable :: q(:)

        allocate (q(0))
    end function variables
end module linkdyn_fixed
