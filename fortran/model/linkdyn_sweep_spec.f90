!> What the table [sweep] of a scene asks for: axes, what is reduced, bounds, with names resolved.
module linkdyn_sweep_spec
    use, intrinsic :: iso_fortran_env, only: int64
    use linkdyn_kinds, only: wp
    implicit none (type, external)
    private
    public :: sweep_spec, axis_spec, bound_spec, segment_spec, swing_spec
    public :: axis_coordinate, axis_rate, axis_acceleration, axis_load, axis_parameter, axis_time
    public :: sampling_linspace, sampling_values, sampling_random, sampling_sobol, sampling_latin, sampling_name
    public :: set_value, multiply_by, add_to, operation_name
    public :: quantity_driving_force, quantity_driving_position, quantity_driving_speed, quantity_driving_power
    public :: quantity_reaction, quantity_reaction_force, quantity_reaction_moment, quantity_joint_variable
    public :: quantity_joint_rate, quantity_force_amplification, quantity_moment_amplification, quantity_condition
    public :: quantity_determinant, quantity_swing, quantity_clearance, quantity_motor_torque, quantity_motor_speed
    public :: quantity_contact_force, quantity_pressure_angle
    public :: quantity_motor_power, quantity_motor_current, quantity_torque_margin, n_quantity, quantity_name, needs_forces

    integer, parameter :: axis_name_len = 128
    integer, parameter :: path_name_len = 256
    integer, parameter :: usual_chunk = 16384

    ! ---- what an axis varies
    integer, parameter :: axis_coordinate = 1, axis_rate = 2, axis_acceleration = 3
    integer, parameter :: axis_load = 4          !! a component of a load
    integer, parameter :: axis_parameter = 5     !! numbers of the scene: one model for each design
    integer, parameter :: axis_time = 6          !! along the scene's motion

    ! ---- where its values come from
    integer, parameter :: sampling_linspace = 1, sampling_values = 2, sampling_random = 3, sampling_sobol = 4, &
        sampling_latin = 5
    character(len=15), parameter :: sampling_name(5) = [character(len=15) :: &
        "linspace", "values", "random", "sobol", "latin-hypercube"]

    ! ---- what a value does to a number of the scene
    integer, parameter :: set_value = 1, multiply_by = 2, add_to = 3
    character(len=6), parameter :: operation_name(3) = [character(len=6) :: "value", "factor", "offset"]

    ! ---- what is computed of every sample, and reduced
    integer, parameter :: quantity_driving_force = 1
    integer, parameter :: quantity_driving_position = 2
    integer, parameter :: quantity_driving_speed = 3
    integer, parameter :: quantity_driving_power = 4
    integer, parameter :: quantity_reaction = 5
    integer, parameter :: quantity_reaction_force = 6
    integer, parameter :: quantity_reaction_moment = 7
    integer, parameter :: quantity_joint_variable = 8
    integer, parameter :: quantity_joint_rate = 9
    integer, parameter :: quantity_force_amplification = 10
    integer, parameter :: quantity_moment_amplification = 11
    integer, parameter :: quantity_condition = 12
    integer, parameter :: quantity_determinant = 13
    integer, parameter :: quantity_swing = 14
    integer, parameter :: quantity_clearance = 15
    integer, parameter :: quantity_motor_torque = 16
    integer, parameter :: quantity_motor_speed = 17
    integer, parameter :: quantity_motor_power = 18
    integer, parameter :: quantity_motor_current = 19
    integer, parameter :: quantity_torque_margin = 20
    integer, parameter :: quantity_contact_force = 21      !! of cams, as the next
    integer, parameter :: quantity_pressure_angle = 22
    integer, parameter :: n_quantity = 22

    type :: quantity_kind
        integer :: id = 0                         !! one of `quantity_*`
        character(len=20) :: name = ""
        logical :: needs_forces = .false.         !! else it follows from position and velocity alone
    end type quantity_kind

    type(quantity_kind), parameter :: kinds(n_quantity) = [ &
        quantity_kind(quantity_driving_force, "driving_force", .true.), &
        quantity_kind(quantity_driving_position, "driving_position", .false.), &
        quantity_kind(quantity_driving_speed, "driving_speed", .false.), &
        quantity_kind(quantity_driving_power, "driving_power", .true.), &
        quantity_kind(quantity_reaction, "reaction", .true.), &
        quantity_kind(quantity_reaction_force, "reaction_force", .true.), &
        quantity_kind(quantity_reaction_moment, "reaction_moment", .true.), &
        quantity_kind(quantity_joint_variable, "joint_variable", .false.), &
        quantity_kind(quantity_joint_rate, "joint_rate", .false.), &
        quantity_kind(quantity_force_amplification, "force_amplification", .false.), &
        quantity_kind(quantity_moment_amplification, "moment_amplification", .false.), &
        quantity_kind(quantity_condition, "condition", .false.), &
        quantity_kind(quantity_determinant, "determinant", .false.), &
        quantity_kind(quantity_swing, "swing", .false.), &
        quantity_kind(quantity_clearance, "clearance", .false.), &
        quantity_kind(quantity_motor_torque, "motor_torque", .true.), &
        quantity_kind(quantity_motor_speed, "motor_speed", .true.), &
        quantity_kind(quantity_motor_power, "motor_power", .true.), &
        quantity_kind(quantity_motor_current, "motor_current", .true.), &
        quantity_kind(quantity_torque_margin, "torque_margin", .true.), &
        quantity_kind(quantity_contact_force, "contact_force", .true.), &
        quantity_kind(quantity_pressure_angle, "pressure_angle", .true.)]
    integer :: i
    character(len=20), parameter :: quantity_name(n_quantity) = [(kinds(i)%name, i=1, n_quantity)]
    logical, parameter :: needs_forces(n_quantity) = kinds%needs_forces

    !> A number of the scene, or a list of them.
    type :: parameter_spec
        character(len=path_name_len) :: path = ""  !! "link.platform.mass", "frame.markers.B1[0]"
        real(wp) :: weight = 1                    !! of the axis value
    end type parameter_spec

    !> One axis: its values run with those of its group.
    type :: axis_spec
        character(len=axis_name_len) :: name = "" !! "platform.x", "rate of platform.x", "Fz on platform.tool", ...
        character(len=8) :: unit = ""
        integer :: kind = 0                       !! one of `axis_*`
        integer :: target = 0                     !! coordinate or load
        integer :: component = 0                  !! of a load: Fx Fy Fz Mx My Mz
        type(parameter_spec), allocatable :: parameter(:)
        integer :: operation = set_value
        integer :: group = 0                      !! axes of one group advance together
        integer :: sampling = 0                   !! one of `sampling_*`
        integer(int64) :: n = 0                   !! values
        real(wp) :: from = 0, to = 0
        real(wp), allocatable :: value(:)         !! of a list
        integer(int64) :: seed = 0
        integer :: dimension = 1                  !! of a sampled sequence
        logical :: is_shifted = .false.           !! a Sobol sequence moved by the seed
        integer :: line = 0
    end type axis_spec

    !> Between which values quantities must stay.
    type :: bound_spec
        character(len=axis_name_len) :: name = "" !! the reason in results
        integer :: quantity = 0
        integer, allocatable :: entry(:)          !! of the quantity: actuators, joints, ...
        real(wp) :: low = -huge(1.0_wp), high = huge(1.0_wp)
        logical :: is_limit = .false.             !! a pose beyond it is still part of the reductions
        integer :: line = 0
    end type bound_spec

    !> A straight body between two markers.
    type :: segment_spec
        integer :: link(2) = 0, marker(2) = 0
        real(wp) :: diameter = 0                  !! [m]
    end type segment_spec

    !> Where a universal or spherical joint swings from.
    type :: swing_spec
        integer :: joint = 0
        real(wp) :: neutral(3) = 0                !! direction of the leg in the axes of the other link; 0: that of the start
    end type swing_spec

    !> The whole table.
    type :: sweep_spec
        logical :: is_given = .false.
        type(axis_spec), allocatable :: axis(:)
        integer :: n_group = 0
        logical :: wants(n_quantity) = .false.
        logical :: extremes_only = .false.        !! no means, no rms
        logical :: has_histogram(n_quantity) = .false.
        integer :: n_bin = 64
        real(wp) :: bin_from(n_quantity) = 0, bin_to(n_quantity) = 0   !! equal: from a first coarse pass
        integer, allocatable :: map_axis(:)       !! axes over which a map of peaks is kept
        logical :: keeps(n_quantity) = .false.    !! for every sample, in the file
        integer :: tool_link = 0, tool_marker = 0 !! where unit wrenches act
        character(len=axis_name_len) :: tool = ""
        real(wp) :: length = 0                    !! characteristic length [m]; 0: from the scene
        type(bound_spec), allocatable :: bound(:) !! in the order in which they are checked
        type(segment_spec), allocatable :: segment(:)  !! whose distance is measured; none given: the legs
        real(wp) :: leg_diameter = 0              !! of the legs [m]
        type(swing_spec), allocatable :: swing(:)
        integer :: chunk = usual_chunk            !! samples reduced one after the other
    end type sweep_spec
end module linkdyn_sweep_spec
