!> The screw: the second marker turns about z of the first and shifts along it in proportion. And its thread alone, which is left
!> where others hold the axes.
module linkdyn_screw
    use linkdyn_attitude, only: rotation_about_z
    use linkdyn_joint_kind, only: joint_kind, marker_pair, joint_shift
    use linkdyn_value, only: value, sin, cos, atan2, reciprocal, operator(-), operator(*)
    use linkdyn_vector, only: unit_vector, operator(+), operator(*), operator(-), operator(.dot.)
    implicit none (type, external)
    private
    public :: screw, thread

    type, extends(joint_kind) :: screw
    contains
        procedure :: constraints
        procedure :: shift
        procedure :: variables
        procedure :: variable_constraints
    end type screw

    type, extends(screw) :: thread
    contains
        procedure :: constraints => threaded
    end type thread

contains

    !> The second point lies on the axis, the axes are parallel, and the second x stands where the slide turns the first one to.
    !> The last as a length, the way that the thread is off but for whole turns.
    function constraints(self, pair) result(c)
        class(screw), intent(in) :: self
        type(marker_pair), intent(in) :: pair
        type(value), allocatable :: c(:)

        associate (a => pair%first, b => pair%second)
            c = [pair%gap .dot.a%x, pair%gap .dot.a%y, b%z .dot.a%x, b%z .dot.a%y, &
                 self%pitch*left_to_turn(pair, (pair%gap .dot.a%z)*reciprocal(self%pitch))]
        end associate
    end function constraints

    !> How far the second x is behind an angle by which the first one would be turned, but for whole turns.
    function left_to_turn(pair, angle) result(left)
        type(marker_pair), intent(in) :: pair
        type(value), intent(in) :: angle
        type(value) :: left

        associate (a => pair%first, b => pair%second)
            left = atan2(b%x .dot.(sin(angle)*a%x - cos(angle)*a%y), b%x .dot.(cos(angle)*a%x + sin(angle)*a%y))
        end associate
    end function left_to_turn

    !> The screw's last.
    function threaded(self, pair) result(c)
        class(thread), intent(in) :: self
        type(marker_pair), intent(in) :: pair
        type(value), allocatable :: c(:)

        c = self%screw%constraints(pair)
        c = c(size(c):)
    end function threaded

    function shift(self, q) result(s)
        class(screw), intent(in) :: self
        type(value), intent(in) :: q(:)
        type(joint_shift) :: s

        s%turn = rotation_about_z(q(1))
        s%axis(1) = unit_vector(3)
        s%slide = (self%pitch*q(1))*s%axis(1)
    end function shift

    !> The slide tells the angle, and its turns.
    function variables(self, pair) result(q)
        class(screw), intent(in) :: self
        type(marker_pair), intent(in) :: pair
        type(value), allocatable :: q(:)

        q = [(pair%gap .dot.pair%first%z)*reciprocal(self%pitch)]
    end function variables

    !> The slide as a length, and the turn: that of a fine thread would follow from the slide with digits less.
    function variable_constraints(self, pair, k, q) result(c)
        class(screw), intent(in) :: self
        type(marker_pair), intent(in) :: pair
        integer, intent(in) :: k
        type(value), intent(in) :: q
        type(value), allocatable :: c(:)

        c = [(pair%gap .dot.pair%first%z) - self%pitch*q, left_to_turn(pair, q)]
    end function variable_constraints
end module linkdyn_screw
