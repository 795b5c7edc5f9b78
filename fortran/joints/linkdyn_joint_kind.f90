!> What a kind of joint must tell: everything else follows from it.
!>
!> A joint holds two markers together. Each has a frame, z along its axis. A kind knows the second marker's frame as a
!> function of the joint variables, the joint variables as functions of both frames, and the values that vanish while the
!> joint holds (constraints). Its names and the directions in which it transmits forces and moments stand in
!> `linkdyn_joint_table`. Velocities, accelerations, Newton's matrix and equations are derived from these.
module linkdyn_joint_kind
    use linkdyn_joint_table, only: joint_n_variable, variable_is_slide, variable_axis, wraps, n_slide, is_threaded, &
        force_directions, &
        moment_directions
    use linkdyn_value, only: value, operator(-)
    use linkdyn_vector, only: vector, rotation, operator(.dot.)
    implicit none (type, external)
    private
    public :: joint_kind, marker_pair, joint_shift, axis_of

    !> Two markers as they stand, world axes.
    type :: marker_pair
        type(rotation) :: first, second        !! frames of the markers
        type(vector) :: gap                    !! from the first marker's point to the second's [m]
    end type marker_pair

    !> The second marker seen from the first, in the first marker's axes.
    type :: joint_shift
        type(rotation) :: turn                 !! from the second marker's axes to the first's
        type(vector) :: slide                  !! from the first point to the second [m]
        type(vector) :: axis(3)                !! about or along which each variable moves the second marker
    end type joint_shift

    type, abstract :: joint_kind
        integer :: n_variable = 0
        logical :: is_slide(3) = .false.       !! else an angle
        logical :: wraps(3) = .false.          !! an angle that looks the same after a turn
        integer :: axis(3) = 0                 !! of its marker, 1 to 3, about or along which a variable moves the second link
        logical :: slides = .false.            !! the second marker moves away from the first
        integer :: forces = 0, moments = 0     !! one of `along_*` of the table
        logical :: is_threaded = .false.       !! besides, a force along the axis comes with a moment
        type(value) :: pitch                   !! of a thread: slide per angle [m/rad]
    contains
        procedure :: describe
        procedure(constraints_interface), deferred :: constraints
        procedure(shift_interface), deferred :: shift
        procedure(variables_interface), deferred :: variables
        procedure :: standing
        procedure :: variable_constraints
        procedure :: n_implied
        procedure :: axis_side
        procedure :: drive_axis
        procedure :: rates
    end type joint_kind

    abstract interface
        !> Values that are zero while the joint holds.
        function constraints_interface(self, pair) result(c)
            import :: joint_kind, marker_pair, value
            class(joint_kind), intent(in) :: self
            type(marker_pair), intent(in) :: pair
            type(value), allocatable :: c(:)
        end function constraints_interface

        !> The second marker by the joint variables.
        function shift_interface(self, q) result(s)
            import :: joint_kind, joint_shift, value
            class(joint_kind), intent(in) :: self
            type(value), intent(in) :: q(:)    !! (n_variable) [m, rad]
            type(joint_shift) :: s
        end function shift_interface

        !> The joint variables by the markers; angles in (-pi, pi].
        function variables_interface(self, pair) result(q)
            import :: joint_kind, marker_pair, value
            class(joint_kind), intent(in) :: self
            type(marker_pair), intent(in) :: pair
            type(value), allocatable :: q(:)
        end function variables_interface
    end interface

contains

    !> What the table says of the kind.
    subroutine describe(self, kind)
        class(joint_kind), intent(inout) :: self
        integer, intent(in) :: kind            !! one of `joint_*`

        self%n_variable = joint_n_variable(kind)
        self%is_slide = variable_is_slide(:, kind)
        self%wraps = wraps(kind, [1, 2, 3])
        self%axis = variable_axis(:, kind)
        self%slides = n_slide(kind) > 0
        self%is_threaded = is_threaded(kind)
        self%forces = force_directions(kind)
        self%moments = moment_directions(kind)
    end subroutine describe

    !> Values in the constraints whose rates are left out of these, for what they do to them vanishes. Nearly all joints have none.
    function standing(self, pair) result(v)
        class(joint_kind), intent(in) :: self
        type(marker_pair), intent(in) :: pair
        type(value), allocatable :: v(:)

        allocate (v(0))
    end function standing

    !> What vanishes while a variable is q. Of an angle that wraps full turns do not count.
    function variable_constraints(self, pair, k, q) result(c)
        class(joint_kind), intent(in) :: self
        type(marker_pair), intent(in) :: pair
        integer, intent(in) :: k               !! which variable
        type(value), intent(in) :: q           !! [m, rad]
        type(value), allocatable :: c(:)
        type(value), allocatable :: all(:)

        all = self%variables(pair)
        c = [all(k) - q]
    end function variable_constraints

    !> How many of the joint's own constraints, the last ones, say nothing more where its variable is given.
    pure integer function n_implied(self)
        class(joint_kind), intent(in) :: self

        n_implied = merge(1, 0, self%is_threaded)
    end function n_implied

    !> Whose marker has the axis about or along which a variable moves the second link: there a drive, a spring, a
    !> damper acts.
    integer function axis_side(self, k)
        class(joint_kind), intent(in) :: self
        integer, intent(in) :: k               !! which variable

        axis_side = 1
    end function axis_side

    !> That axis as it stands.
    function drive_axis(self, pair, k) result(axis)
        class(joint_kind), intent(in) :: self
        type(marker_pair), intent(in) :: pair
        integer, intent(in) :: k
        type(vector) :: axis

        if (self%axis_side(k) == 2) then
            axis = axis_of(pair%second, self%axis(k))
        else
            axis = axis_of(pair%first, self%axis(k))
        end if
    end function drive_axis

    !> Axis k of a frame.
    function axis_of(frame, k) result(axis)
        type(rotation), intent(in) :: frame
        integer, intent(in) :: k               !! 1 to 3: x, y, z
        type(vector) :: axis

        select case (k)
        case (1)
            axis = frame%x
        case (2)
            axis = frame%y
        case default
            axis = frame%z
        end select
    end function axis_of

    !> Rates of the joint variables, if the axes of its drives are square to each other.
    function rates(self, pair, omega, gap_rate) result(qd)
        class(joint_kind), intent(in) :: self
        type(marker_pair), intent(in) :: pair
        type(vector), intent(in) :: omega      !! angular velocity of the second link less that of the first [rad/s]
        type(vector), intent(in) :: gap_rate   !! of the gap, seen from the first link [m/s]
        type(value), allocatable :: qd(:)
        integer :: k

        allocate (qd(self%n_variable))
        do k = 1, self%n_variable
            if (self%is_slide(k)) then
                qd(k) = gap_rate.dot.self%drive_axis(pair, k)
            else
                qd(k) = omega.dot.self%drive_axis(pair, k)
            end if
        end do
    end function rates
end module linkdyn_joint_kind
