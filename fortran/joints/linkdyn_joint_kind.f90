!> What a kind of joint must tell: everything else follows from it.
!>
!> A joint holds two markers together. Each has a frame, z along its axis. A kind knows the second marker's frame as a
!> function of the joint variables, the joint variables as functions of both frames, the values that vanish while the
!> joint holds (constraints), and along which directions it transmits forces and moments. Velocities, accelerations,
!> Newton's matrix and equations are derived from these.
module linkdyn_joint_kind
    use linkdyn_value, only: value
    use linkdyn_vector, only: vector, rotation, operator(.dot.)
    implicit none (type, external)
    private
    public :: joint_kind, marker_pair, joint_shift
    public :: along_axes, along_x_and_y, along_normal, along_nothing

    ! ---- directions of the forces or moments that a joint transmits
    integer, parameter :: along_nothing = 0    !! none
    integer, parameter :: along_normal = 1     !! one, square to both markers' axes
    integer, parameter :: along_x_and_y = 2    !! two, square to the markers' common axis
    integer, parameter :: along_axes = 3       !! all three, in whatever axes suit

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
        character(len=11) :: name = ""         !! its word in a scene
        integer :: n_variable = 0
        character(len=7) :: variable(3) = ""   !! names of the joint variables
        logical :: is_slide(3) = .false.       !! else an angle
        integer :: forces = along_axes         !! one of `along_*`
        integer :: moments = along_nothing
    contains
        procedure(constraints_interface), deferred :: constraints
        procedure(shift_interface), deferred :: shift
        procedure(variables_interface), deferred :: variables
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

    !> Whose marker's z is the axis about or along which a variable moves the second link: there a drive, a spring, a
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

        axis = pair%first%z
        if (self%axis_side(k) == 2) axis = pair%second%z
    end function drive_axis

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
