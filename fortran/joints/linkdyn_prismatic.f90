!> The prismatic joint, a slide: the second marker shifts along z of the first and does not turn.
module linkdyn_prismatic
    use linkdyn_joint_kind, only: joint_kind, marker_pair, joint_shift
    use linkdyn_value, only: value
    use linkdyn_vector, only: identity_rotation, unit_vector, operator(*), operator(.dot.)
    implicit none (type, external)
    private
    public :: prismatic

    type, extends(joint_kind) :: prismatic
    contains
        procedure :: constraints
        procedure :: shift
        procedure :: variables
    end type prismatic

contains

    !> The second point lies on the axis, the frames are parallel.
    function constraints(self, pair) result(c)
        class(prismatic), intent(in) :: self
        type(marker_pair), intent(in) :: pair
        type(value), allocatable :: c(:)

        associate (a => pair%first, b => pair%second)
            c = [pair%gap .dot.a%x, pair%gap .dot.a%y, b%z .dot.a%x, b%z .dot.a%y, b%x .dot.a%y]
        end associate
    end function constraints

    function shift(self, q) result(s)
        class(prismatic), intent(in) :: self
        type(value), intent(in) :: q(:)
        type(joint_shift) :: s

        s%turn = identity_rotation()
        s%axis(1) = unit_vector(3)
        s%slide = q(1)*s%axis(1)
    end function shift

    function variables(self, pair) result(q)
        class(prismatic), intent(in) :: self
        type(marker_pair), intent(in) :: pair
        type(value), allocatable :: q(:)

        q = [pair%gap .dot.pair%first%z]
    end function variables
end module linkdyn_prismatic
