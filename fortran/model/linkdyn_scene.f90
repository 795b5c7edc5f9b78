!> What the user wrote down: links, joints, coordinates, loads, with names resolved to indices.
!>
!> A scene is checked for form (every name exists, every number is finite, every body can exist) by
!> the reader in `io/`; whether the mechanism can be computed is for the planner to say. Everything
!> is SI and radians here. Planar scenes use the x, y components and leave z zero.
module linkdyn_scene
    use linkdyn_joint_table, only: joint_revolute, joint_prismatic, joint_cylindrical, joint_universal, joint_spherical, &
        joint_fixed, joint_planar, joint_screw, joint_gear, joint_rack, joint_belt, joint_cam, joint_kind_name, joint_n_variable, &
        variable_name, is_pose_part, pose_position, pose_attitude
    use linkdyn_cross, only: cross
    use linkdyn_curve, only: curve_type
    use linkdyn_formula, only: formula_type, node_symbol
    use linkdyn_kinds, only: wp
    use linkdyn_sweep_spec, only: sweep_spec
    implicit none (type, external)
    private
    public :: scene_type, link_spec, arm_spec, marker_spec, joint_spec, coordinate_spec, actuator_spec, load_spec
    public :: law_spec, table_spec, effort_law, motor_spec, cylinder_spec, spring_spec, source_spec, source_shelf, &
        n_chamber
    public :: hold_spec, switch_spec, brake_spec, clutch_spec, n_clutch, pulls_in_line
    public :: payload_spec, payload_changes, wants_instants
    public :: friction_spec
    public :: name_len, path_len, frame_link
    public :: joint_revolute, joint_prismatic, joint_cylindrical, joint_universal, joint_spherical
    public :: joint_fixed, joint_planar, joint_screw, joint_gear, joint_rack, joint_belt, joint_cam
    public :: cam_spec, guide_of, follower_name, follower_point, follower_roller, follower_flat
    public :: joint_kind_name, joint_n_variable, variable_name
    public :: coordinate_joint, coordinate_pose, pose_component_name
    public :: law_none, law_constant, law_constant_rate, law_cycloidal_start, law_cycloidal
    public :: law_polynomial_345, law_harmonic, law_table, law_over
    public :: measure_spec, state_law, law_book, takes_time, marker_axis_at, marker_axes_at, marker_frame, seeing_axes_at
    public :: event_spec, stop_spec, n_event, n_stop, has_hard_stops
    public :: measure_time, measure_joint, measure_marker, measure_spring, measure_touch, measure_distance, measure_attitude, &
        measure_tilt, measure_twist, measure_turn, least_openness, is_place, loses_itself_at_pole
    public :: share_refused, share_by_least_norm, share_by_stiffness, share_name
    public :: axes_world, axes_link, put_file_first, idle_spins, n_holding
    public :: pose_position, pose_attitude, is_pose_part
    public :: effort_inverse, effort_constant, effort_table, effort_spring_damper, effort_dc_motor, effort_pd, effort_over, &
        effort_controlled
    public :: at_force, at_stiffness, at_damping, at_rest, at_pretension, at_ratio, at_efficiency, at_torque_constant, &
        at_voltage_constant, at_gain, at_resistance
    public :: controller_spec, n_controller, is_sampled, feed_none, feed_law, feed_gravity, feed_inverse
    public :: windup_none, windup_clamp, windup_back
    public :: side_joint, side_torque, side_voltage, side_opening, is_at_motor, has_limits
    public :: marker_at

    integer, parameter :: name_len = 64     !! longest name of a link, marker, joint, ...
    integer, parameter :: path_len = 1024   !! longest file name
    integer, parameter :: frame_link = 0    !! index of the fixed link

    ! ---- followers of cams
    integer, parameter :: follower_point = 1       !! a knife edge
    integer, parameter :: follower_roller = 2
    integer, parameter :: follower_flat = 3        !! a straight face
    character(len=6), parameter :: follower_name(3) = [character(len=6) :: "point", "roller", "flat"]

    ! ---- kinds of coordinates
    integer, parameter :: coordinate_joint = 1   !! a variable of a joint
    integer, parameter :: coordinate_pose = 2    !! one of x y z roll pitch yaw of a link
    character(len=5), parameter :: pose_component_name(6) = &
        [character(len=5) :: "x", "y", "z", "roll", "pitch", "yaw"]

    ! ---- laws of time
    integer, parameter :: law_none = 0             !! not given
    integer, parameter :: law_constant = 1         !! value(1)
    integer, parameter :: law_constant_rate = 2    !! value(1) + value(2) t
    integer, parameter :: law_cycloidal_start = 3  !! from value(1); rate rises to value(2) over value(3) seconds
    integer, parameter :: law_cycloidal = 4        !! rest to rest through knots (time, value), cycloidal between them
    integer, parameter :: law_polynomial_345 = 5   !! rest to rest through knots, 3-4-5 polynomial between them
    integer, parameter :: law_harmonic = 6         !! value(1) + value(2) sin(value(3) t + value(4))
    integer, parameter :: law_table = 7            !! knots (time, value), spline or straight lines between them
    integer, parameter :: law_over = 8             !! over the state of the mechanism: `law` of the scene's law book; zero as a law
                                                   !! of time

    ! ---- what laws over the state depend on
    integer, parameter :: measure_time = 1         !! the instant
    integer, parameter :: measure_joint = 2        !! a variable of a joint
    integer, parameter :: measure_marker = 3       !! a coordinate of a marker, in the axes of a link that sees it, or of its marker
    integer, parameter :: measure_spring = 4       !! of a spring: by how much it is longer than at rest
    integer, parameter :: measure_touch = 5        !! of a side of a soft stop: 1 in contact, -1 apart, 0 where no run knows it
    integer, parameter :: measure_distance = 6     !! of two markers
    integer, parameter :: measure_attitude = 7     !! roll, pitch or yaw of a link, as another one sees it
    integer, parameter :: measure_tilt = 8         !! angle between the axes of two markers, 0 to pi
    integer, parameter :: measure_twist = 9        !! of one marker against another about their axes, once the tilt is taken back
    integer, parameter :: measure_turn = 10        !! how one marker is turned against another, as a hold wants it: its rate is that
                                                   !! about an axis of the first one
    !> 1 + the cosine of the angle between the axes of a twist, and the cosine of a ball's pitch: below, they are opposite, and at
    !> the pole, and what is told has less than three digits
    real(wp), parameter :: least_openness = 1000*epsilon(1.0_wp)

    ! ---- axes in which a load's components are given
    integer, parameter :: axes_world = 1
    integer, parameter :: axes_link = 2

    ! ---- what becomes of reactions that the equations leave open
    integer, parameter :: share_refused = 1        !! the scene is refused
    integer, parameter :: share_by_least_norm = 2  !! the least sum of squares
    integer, parameter :: share_by_stiffness = 3   !! the least elastic energy
    character(len=12), parameter :: share_name(3) = [character(len=12) :: "refuse", "minimum-norm", "stiffness"]

    ! ---- what an actuator does in forward dynamics
    integer, parameter :: effort_inverse = 1        !! what inverse dynamics of the motion law asks for
    integer, parameter :: effort_constant = 2
    integer, parameter :: effort_table = 3
    integer, parameter :: effort_spring_damper = 4
    integer, parameter :: effort_dc_motor = 5
    integer, parameter :: effort_pd = 6
    integer, parameter :: effort_over = 7           !! a law over the state of the mechanism
    integer, parameter :: effort_controlled = 9     !! the output of a controller (8 is a word of scene files alone)

    ! ---- numbers of these laws, places in `effort_law%value`; of springs and strands as kernels take them
    integer, parameter :: at_force = 1             !! constant [N, N m]
    integer, parameter :: at_stiffness = 1, at_damping = 2, at_rest = 3   !! springs, spring-damper and pd, which has no rest
    integer, parameter :: at_pretension = 3        !! of a strand, behind stiffness and damping
    !> dc-motor: ratio n and efficiency eta of the gear, K_T [N m/A], K_E [V s], K_P [V/rad, V/m], resistance R_a [ohm]
    integer, parameter :: at_ratio = 1, at_efficiency = 2, at_torque_constant = 3, at_voltage_constant = 4, at_gain = 5, &
        at_resistance = 6

    ! ---- what a controller puts out beside what its error asks for
    integer, parameter :: feed_none = 0
    integer, parameter :: feed_law = 1             !! a law of time or over the state
    integer, parameter :: feed_gravity = 2         !! what holds the mechanism where it is, against weight and springs
    integer, parameter :: feed_inverse = 3         !! what inverse dynamics of the scene's motion asks for

    ! ---- what becomes of a controller's integral while its output is limited
    integer, parameter :: windup_none = 1          !! it goes on
    integer, parameter :: windup_clamp = 2         !! it stays as it is where it would lead further beyond the limit
    integer, parameter :: windup_back = 3          !! it is led back in proportion to what the limit takes

    ! ---- what the law of an actuator gives
    integer, parameter :: side_joint = 0           !! the driving force
    integer, parameter :: side_torque = 1          !! the torque of the motor
    integer, parameter :: side_voltage = 2         !! the voltage at the motor's terminals
    integer, parameter :: side_opening = 3         !! how far the valve of the cylinder is open, -1 to 1

    integer, parameter :: n_chamber = 2            !! of a cylinder

    !> A point with an axis, fixed to a link. Its frame has z along `axis`.
    type :: marker_spec
        character(len=name_len) :: name = ""
        real(wp) :: at(3) = 0                     !! position in link axes [m]
        real(wp) :: axis(3) = [0, 0, 1]           !! unit vector in link axes; planar: direction of a slide, default x
        real(wp) :: x_axis(3) = [1, 0, 0]         !! unit vector square to `axis`: where joint angles count from
        logical :: has_axis = .false.             !! written by the user
        logical :: has_x = .false.                !! and so `x_axis`
        integer :: line = 0                       !! in the scene file
    end type marker_spec

    !> How a link gives way between the place where its mass, loads and springs act and its markers.
    type :: arm_spec
        integer :: marker = 0                     !! of the link's list; 0: each that a joint has
        logical :: from_cog = .true.
        real(wp) :: from(3) = 0                   !! else that place, link axes [m]
        real(wp) :: beam(5) = 0                   !! EA [N], G times the area in shear [N], GJ, EIy, EIz [N m2]; 0: rigid
        real(wp) :: y(3) = 0                      !! the section's y, link axes; zero: all directions across the beam are alike
        real(wp) :: compliance(6, 6) = 0          !! instead: way and turn of the marker by force and moment on it [m, rad; N, N m]
        logical :: is_beam = .true.
    end type arm_spec

    !> A rigid body. Link 0 is the frame; its mass properties are ignored.
    type :: link_spec
        character(len=name_len) :: name = ""
        real(wp) :: mass = 0                      !! [kg]
        real(wp) :: cog(3) = 0                    !! centre of mass in link axes [m]
        real(wp) :: inertia(6) = 0                !! Ixx Iyy Izz Ixy Iyz Izx about the cog, link axes [kg m2]; planar: Izz only
        real(wp) :: start(6) = 0                  !! x y z roll pitch yaw near which closure starts [m, rad]
        logical :: has_start = .false.
        type(marker_spec), allocatable :: marker(:)
        character(len=:), allocatable :: mesh     !! file of the body's form, for pictures
        real(wp) :: mesh_unit = 1                 !! of its coordinates [m]
        type(arm_spec), allocatable :: arm(:)     !! absent: rigid
        integer :: line = 0
    end type link_spec

    !> What touches what, where a joint is a cam.
    type :: cam_spec
        integer :: follower = 0                   !! one of `follower_*`
        real(wp) :: radius = 0                    !! of the roller [m]
        integer :: side = 1                       !! of the curve on which it is: +1 outside, -1 inside
        logical :: is_groove = .false.            !! held from both sides
        logical :: is_path = .false.              !! the curve is that of the roller's centre
        type(curve_type) :: curve = curve_type()  !! in the axes of the first marker: its point, its x
        logical :: is_barrel = .false.            !! its radii are heights along the marker's axis over the angle about it
        real(wp) :: ground = 0                    !! of that: height where the radius is zero [m]
    end type cam_spec

    !> Two markers held together.
    type :: joint_spec
        character(len=name_len) :: name = ""
        integer :: kind = 0                       !! one of `joint_*` of `linkdyn_joint_table`
        integer :: link(2) = 0                    !! first and second link; 0 is the frame
        integer :: marker(2) = 0                  !! index into the marker list of that link; 0: its origin and axes
        real(wp) :: start(3) = 0                  !! joint variables near which closure starts [m, rad]
        logical :: has_start = .false.
        real(wp) :: lead = 0                      !! of a screw: how far it goes in a turn [m]; negative: left-handed
        real(wp) :: wheel(2) = 0                  !! of a gear the teeth of both wheels; of a belt their radii [m]
        real(wp) :: flank(2) = 0                  !! of teeth: pressure angle, and helix angle of the first wheel, above zero
                                                  !! right-handed [rad]
        real(wp) :: lead_angle = 0                !! of a worm, the first wheel, above zero right-handed [rad]; 0: it is none
        logical :: is_turned_over = .false.       !! a gear with teeth inside one wheel, a belt that is crossed
        real(wp) :: phase = 0                     !! of a gear, rack or belt: variable of the second where the first is at zero [m,
                                                  !! rad]
        logical :: has_phase = .false.            !! it was written
        real(wp) :: strand(3) = 0                 !! of a belt that stretches: stiffness, damping and pretension of one strand [N/m,
                                                  !! N s/m, N]
        real(wp) :: stiffness(4) = 0              !! radial, axial [N/m], tilt, torsion [N m/rad]; 0: rigid
        real(wp) :: misfit(6) = 0                 !! how far and how much turned it holds its second marker off, free of load; axes
                                                  !! of the first link [m, rad]
        integer :: branch = 0                     !! +1 or -1 forces the assembly of the dyad closed at this joint
        type(cam_spec) :: cam = cam_spec()        !! of a cam
        integer :: line = 0
    end type joint_spec

    !> A function of time with two derivatives.
    type :: law_spec
        integer :: kind = law_none
        real(wp) :: value(4) = 0                  !! see the `law_*` constants
        integer :: law = 0                        !! of the scene's law book (law_over)
        integer :: course = 0                     !! laws of a model with the same number do the same in the same time, if in
                                                  !! other sizes; 0: nobody has looked
        real(wp), allocatable :: time(:)          !! knots [s] (n), increasing
        real(wp), allocatable :: knot(:)          !! value at the knots (n)
        real(wp), allocatable :: curvature(:)     !! second derivative at the knots (n); absent: straight lines
        integer :: angle = 0                      !! roll, pitch or yaw, 1 2 3, of the attitude that quaternions tell; 0: it has
                                                  !! none. Of one the knots are this angle, with its turns
        real(wp), allocatable :: quaternion(:, :) !! w x y z at the knots, of unit length, each near the one before (n, 4)
        real(wp), allocatable :: bend(:, :)       !! second derivatives of the four splines through them (n, 4)
    end type law_spec

    !> A number that the mechanism has in a state of motion. Nothing that takes accelerations: forces would then depend on
    !> themselves.
    type :: measure_spec
        character(len=name_len) :: name = ""
        integer :: kind = 0                       !! one of `measure_*`
        logical :: is_rate = .false.              !! not the number itself, but how fast it changes
        integer :: joint = 0
        integer :: variable = 1                   !! of the joint
        real(wp) :: near = 0                      !! an angle that is no coordinate is taken within half a turn of this [rad]
        logical :: wraps = .false.                !! it is an angle that counts no turns
        integer :: link(2) = 0                    !! of a distance or tilt: of both markers; else the one that sees, then the other
        integer :: marker(2) = 0                  !! of these links; 0: the origin
        integer :: component = 0                  !! 1 2 3: x y z, or roll pitch yaw
        integer :: spring = 0
        integer :: stop = 0                       !! side of one
        integer :: length_power = 0               !! of its dimension
    end type measure_spec

    !> A law over the state: a table over a measure or another law, or a formula.
    type :: state_law
        character(len=2*name_len) :: name = ""    !! "law 'gas'", "load on 'ram.tool', force"
        integer :: over = 0                       !! argument of the table: a measure; below zero another law; 0: a formula
        character(len=name_len) :: over_name = "" !! what messages call it
        character(len=16) :: over_unit = ""       !! its SI unit
        type(law_spec) :: table = law_spec()      !! knots over that
        real(wp) :: period = 0                    !! after which the table begins anew; 0: never
        type(formula_type) :: formula = formula_type()
        logical :: wraps = .false.                !! it comes from an angle that counts no turns
    end type state_law

    !> All laws over the state, each behind those that it takes.
    type :: law_book
        type(measure_spec), allocatable :: measure(:)
        type(state_law), allocatable :: law(:)
        real(wp) :: scale = 1                     !! of a similar mechanism: its lengths over those that the laws mean
    end type law_book

    !> One generalized coordinate.
    type :: coordinate_spec
        character(len=name_len) :: name = ""      !! "platform.x", "J1", "C.slide"
        character(len=4) :: unit = ""             !! "m" or "rad"
        integer :: kind = 0                       !! `coordinate_joint` or `coordinate_pose`
        integer :: joint = 0
        integer :: variable = 0                   !! variable of the joint (1..3), or component of the pose (1..6)
        integer :: link = 0
        integer :: for_joint = 0                  !! joint whose variable it stands in for, in part of a forward run; 0: none
        integer :: for_variable = 0               !! that variable
        real(wp) :: start_position = 0            !! at t = 0, for forward dynamics and for choosing the branch
        real(wp) :: start_velocity = 0
        logical :: has_start = .false.
        logical :: is_driven = .false.            !! forward dynamics too follows its motion law; the drives `inverse` supply the
                                                  !! force
        type(law_spec) :: motion
        integer :: line = 0
    end type coordinate_spec

    !> Parameters of a driving force in forward dynamics.
    type :: effort_law
        integer :: kind = effort_inverse
        integer :: side = side_joint              !! one of `side_*`
        real(wp) :: value(8) = 0                  !! its numbers, at the places `at_*`
        type(law_spec) :: target = law_spec()     !! wanted position (motors, pd), or the force itself (table, over)
    end type effort_law

    !> When something is on.
    type :: switch_spec
        logical :: begins_on = .true.
        real(wp) :: from = huge(1.0_wp)           !! it is on from this instant [s]; huge: none
        real(wp) :: until = huge(1.0_wp)          !! and off from this one [s]; huge: none
        character(len=name_len) :: from_name = "", until_name = ""    !! events by which it comes on and off
        integer :: from_event = 0, until_event = 0                    !! these; 0: none
    end type switch_spec

    !> A brake on the shaft of a motor, in forward dynamics.
    type, extends(switch_spec) :: brake_spec
        logical :: is_given = .false.
        real(wp) :: torque = 0                    !! by which it holds, and brakes [N m]
        integer :: line = 0
    end type brake_spec

    !> A motor and the gear or screw behind which it drives a joint variable.
    type :: motor_spec
        logical :: is_given = .false.
        real(wp) :: ratio = 0                     !! motor angle over joint variable [1, rad/m]
        real(wp) :: inertia = 0                   !! of all that turns with the motor [kg m2]
        real(wp) :: efficiency = 1                !! of the transmission while the motor drives
        real(wp) :: back_efficiency = 1           !! while the load does; zero or less: it cannot
        logical :: creeps = .false.               !! its loads are told of forward dynamics with its torque given
        real(wp) :: creep_speed = 0.1_wp          !! of the motor, below which friction goes to zero in forward dynamics [rad/s]
        real(wp) :: torque_constant = 0           !! [N m/A], and of the voltage that the turning rotor induces [V s]; 0: not known
        real(wp) :: resistance = 0                !! of the winding [ohm]; 0: not known
        real(wp) :: inductance = 0                !! of the winding [H]; 0: left out
        real(wp) :: largest_torque = 0            !! of the motor [N m]; 0: not limited
        real(wp) :: largest_power = 0             !! [W]; 0: not limited
        real(wp) :: largest_current = 0           !! [A]; 0: not limited
        type(law_spec) :: torque_curve            !! largest torque [N m] over speed [rad/s]; law_none: not limited
        type(brake_spec) :: brake
        integer :: line = 0
    end type motor_spec

    !> A hydraulic or pneumatic cylinder behind a slide and the valve that feeds it. Its chambers are the head, without the rod, and
    !> the rod's.
    type :: cylinder_spec
        logical :: is_given = .false.
        real(wp) :: area(n_chamber) = 0              !! of the piston in each chamber [m2]
        logical :: has_gas = .false.              !! in place of oil
        real(wp) :: dead_volume(n_chamber) = 0    !! of each chamber where the piston is at its end there [m3]
        real(wp) :: stroke(2) = 0                 !! joint variable with the rod in, and with it out [m]
        real(wp) :: bulk_modulus = 0              !! of the oil [Pa]
        real(wp) :: air = 0                       !! share of the oil's volume that is air, under the atmosphere
        real(wp) :: supply = 0, tank = 0          !! pressures above the atmosphere's [Pa]
        real(wp) :: flow = 0, drop = 0            !! of an edge of the valve that is wide open: this flow at that drop [m3/s, Pa]
        real(wp) :: laminar_drop = 1.0e5_wp       !! below about that the flow goes with the drop, not with its root [Pa]
        real(wp) :: exponent = 0                  !! polytropic one of the gas
        real(wp) :: conductance = 0               !! of an edge for gas that is wide open [m3/s/Pa]
        real(wp) :: critical_ratio = 0            !! of the pressures behind and before it, below which the gas is as fast as sound
        real(wp) :: leakage = 0                   !! past the piston, over the pressure difference [m3/s/Pa]
        logical :: has_start = .false.
        real(wp) :: start(n_chamber) = 0          !! pressures at the start of a forward run [Pa]
        integer :: line = 0
    end type cylinder_spec

    !> A driven joint variable: in inverse dynamics its force or torque is an unknown.
    type :: actuator_spec
        character(len=name_len) :: name = ""      !! the joint's name
        character(len=4) :: unit = ""             !! "N" or "N m"
        integer :: joint = 0
        integer :: variable = 1                   !! which variable of the joint
        real(wp) :: share = 1                     !! where there are more drives than freedoms: the least sum of
        real(wp) :: preload = 0                   !! (force - preload)^2/share [N, N m]
        type(effort_law) :: law
        logical :: has_law = .false.              !! the file says what it does in forward dynamics
        type(motor_spec) :: motor
        type(cylinder_spec) :: cylinder
        integer :: line = 0
    end type actuator_spec

    !> A controller: it compares what it measures with its target, and drives an actuator in forward dynamics.
    type :: controller_spec
        character(len=name_len) :: name = ""
        integer :: actuator = 0
        integer :: side = side_joint              !! what its output is: one of `side_*`
        character(len=8) :: unit = ""             !! of what is measured: "m", "rad", "m/s", "rad/s"
        character(len=4) :: output_unit = ""      !! "N", "N m" or "V"
        integer :: measure = 0                    !! of the scene's law book, that it keeps at its target
        integer :: rate_measure = 0               !! how fast that changes; 0: nobody knows, it is a rate itself
        type(law_spec) :: target = law_spec()
        logical :: follows_motion = .false.       !! its target is what it measures, in the scene's motion
        real(wp) :: kp = 0, ki = 0, kd = 0        !! gains of error, its integral, its rate
        logical :: damps_measured = .false.       !! kd acts on the rate of what is measured, not of the error
        real(wp) :: filter = 0                    !! time constant of what kd gives [s]; 0: none
        real(wp) :: low = -huge(1.0_wp), high = huge(1.0_wp)    !! limits of the output
        integer :: windup = windup_none           !! one of `windup_*`
        real(wp) :: tracking_time = 0             !! in which the integral is led back [s]
        integer :: feed = feed_none               !! one of `feed_*`
        type(law_spec) :: feed_law = law_spec()
        real(wp) :: period = 0                    !! between samples [s]; 0: it is continuous
        real(wp) :: delay = 0                     !! from a sample to the output that comes of it [s]
        real(wp) :: resolution = 0                !! of what is measured; 0: as fine as can be
        real(wp) :: output_resolution = 0         !! of the output; 0: as fine as can be
        integer :: line = 0
    end type controller_spec

    !> A force and a moment on a marker.
    type :: load_spec
        character(len=name_len) :: name = ""      !! "platform.tool"
        integer :: link = 0
        integer :: marker = 0
        integer :: axes = axes_world              !! axes of the components
        type(law_spec) :: force(3)                !! [N]
        type(law_spec) :: moment(3)               !! [N m]
        integer :: line = 0
    end type load_spec

    !> A mass on a marker of a link, beside the link's own.
    type :: payload_spec
        character(len=name_len) :: name = ""      !! "gripper.tip"
        integer :: link = 0
        integer :: marker = 0
        type(law_spec) :: mass = law_spec()       !! [kg]
        real(wp) :: inertia(6) = 0                !! of a constant mass, about the marker, link axes [kg m2]
        real(wp) :: from = -huge(1.0_wp)          !! it is there from this instant on [s]
        real(wp) :: until = huge(1.0_wp)          !! and no more from this one [s]
        integer :: line = 0
    end type payload_spec

    !> A spring and damper that nothing drives: between two markers, or at a variable of a joint.
    !>
    !> Between markers it pulls along their line: stiffness (d - rest) + damping d(d)/dt at distance d.
    type :: spring_spec
        character(len=name_len) :: name = ""
        integer :: joint = 0                      !! 0: between two markers, or along a measure
        integer :: variable = 1                   !! which variable of the joint
        integer :: measure = 0                    !! of a place that the law `force` pulls back; 0: none
        integer :: link(2) = 0                    !! first and second link of a spring between markers
        integer :: marker(2) = 0
        real(wp) :: stiffness = 0                 !! [N/m], [N m/rad] at an angle
        real(wp) :: damping = 0                   !! [N s/m], [N m s/rad]
        real(wp) :: rest = 0                      !! length or joint variable without force [m, rad]
        type(law_spec) :: force = law_spec()      !! beside stiffness and damping [N, N m]; law_none: nothing
        integer :: line = 0
    end type spring_spec

    !> The prescribed motion of the frame: the pose of its axes in axes at rest, in which gravity is constant.
    type :: base_spec
        logical :: moves = .false.                !! the scene says so
        type(law_spec) :: motion(6)               !! x y z roll pitch yaw [m, rad]; law_none: zero
        integer :: line = 0
    end type base_spec

    !> What a forward run looks out for: a number over the state that crosses zero.
    type :: event_spec
        character(len=2*name_len) :: name = ""
        integer :: direction = 0                  !! +1: upwards, -1: downwards, 0: either way
        logical :: ends_run = .false.
        type(formula_type) :: formula = formula_type()    !! of measures and laws of the scene's book
        integer :: stop = 0                       !! end stop that this is the gap of; 0: none
        integer :: clutch = 0                     !! clutch that this is the slip of; 0: none
        integer :: line = 0
    end type event_spec

    !> One side of an end stop: a place, which a measure tells, does not go past it. A soft one is a spring besides, whose law has
    !> the force.
    type :: stop_spec
        character(len=2*name_len) :: name = ""    !! "buffer.max"
        character(len=2*name_len) :: what = ""    !! it stops, in messages: "joint 'guide'", "measure 'height'"
        integer :: measure = 0                    !! of the place; pushes act along it
        integer :: side = 1                       !! +1: the place does not pass it upwards, -1: downwards
        real(wp) :: bound = 0                     !! [m, rad]
        logical :: is_hard = .false.              !! it throws back
        real(wp) :: restitution = 0               !! speed after an impact over the one before, of a hard one
        integer :: event = 0                      !! whose formula is its gap
        integer :: line = 0
    end type stop_spec

    !> A clutch, brake or lock: it holds a joint variable, or two to each other, by what force it takes up to its capacity, and rubs
    !> against their slip beyond. The slip is the rate of the first variable less `ratio` times that of the second. What holds
    !> several variables of a joint, or markers of two links to each other, is one for each, with an event that they share.
    type, extends(switch_spec) :: clutch_spec
        character(len=name_len) :: name = ""
        integer :: n_side = 1                     !! joint variables: 1 or 2
        integer :: joint(2) = 0                   !! 0: the measure is between markers
        integer :: variable(2) = 1                !! of these joints
        real(wp) :: ratio = 1
        logical :: is_positive = .true.           !! it has no capacity: it holds whatever comes, and never slips
        type(law_spec) :: capacity = law_spec()   !! of one that slips, at the first variable; below zero: none [N, N m]
        real(wp) :: static = 1                    !! what it holds over that
        character(len=4) :: unit = ""             !! "N" or "N m"
        character(len=8) :: slip_unit = ""        !! "m/s" or "rad/s"
        integer :: measure(2) = 0                 !! of what is held: joint variables, or how two markers stand to each other
        integer :: friction = 0                   !! table whose friction it is, by the joint's reaction; 0: it has a capacity of
                                                  !! its own
        logical :: is_bare = .false.              !! the joint has no variables, as gears, belts and cams: what slips are surfaces
        integer :: lead = 0                       !! of all whose joint variables rest and break loose together the first; itself:
                                                  !! it does so alone, or it is the first
        integer :: event = 0                      !! whose formula is the slip; several that close together have one
        integer :: line = 0
    end type clutch_spec

    !> Friction in a joint: of what its reaction presses together. See `linkdyn_contact`.
    type :: friction_spec
        integer :: joint = 0
        real(wp) :: coulomb = 0                   !! coefficient where it slides fast; of teeth with an efficiency 1
        real(wp) :: static = 0                    !! coefficient where it begins to slide
        real(wp) :: stribeck_speed = 0            !! of the surfaces, over which the one falls to the other [m/s]; 0: they are equal
        real(wp) :: creep_speed = 0               !! of the surfaces, below which friction goes to zero [m/s]
        real(wp) :: viscous = 0                   !! beside it [N s/m]; at joints that only turn [N m s/rad]
        real(wp) :: radius = 0                    !! of the surface that slides [m]; 0: it has none
        real(wp) :: length = 0                    !! between the ends that take a tilting moment [m]; 0: it makes no friction
        real(wp) :: collar = 0                    !! mean radius of the face that takes the force along a pin [m]; 0: it makes no
                                                  !! friction
        real(wp) :: preload = 0                   !! by which the surfaces are pressed together besides [N]
        real(wp) :: efficiency = 0                !! of teeth: what comes out of power that goes in; 0: friction makes it
        logical :: sticks = .false.               !! in forward dynamics it holds what rests, and nothing is smoothed
        integer :: line = 0
    end type friction_spec

    !> An idle spin, settled at a ball joint: two directions there stay square to each other. See `linkdyn_idle_spin`.
    type :: hold_spec
        integer :: joint = 0
        integer :: side = 0                       !! of the joint that spins: 1 or 2
        character(len=:), allocatable :: links    !! names of the links that spin, joined by "+"
        real(wp) :: axis(3, 2) = 0                !! the directions, axes of the joint's first and second link
    end type hold_spec

    !> A named number that others in the scene file refer to.
    type :: variable_spec
        character(len=name_len) :: name = ""
        real(wp) :: value = 0                     !! SI
        character(len=64) :: unit = ""            !! SI unit, "kg m^2"; blank: none
    end type variable_spec

    !> Instants of the run along the scene's motion.
    type :: time_spec
        real(wp) :: first = 0                     !! [s]
        real(wp) :: last = 0                      !! [s]
        integer :: n_sample = 0                   !! 0: not given and not to be derived from the motion
    end type time_spec

    !> A CSV file as read: one column a quantity.
    type :: table_spec
        character(len=path_len) :: file = ""
        character(len=name_len), allocatable :: column(:)
        character(len=name_len), allocatable :: unit(:)  !! as in the header's brackets; blank: SI (column)
        real(wp), allocatable :: value(:, :)      !! as written, in the units of the header (row, column)
        integer, allocatable :: line(:)           !! in the file (row)
        logical :: is_foreign = .false.           !! not of the scene's folder: no message quotes what stands in it
    end type table_spec

    !> A file that the scene is made of. Lines count on from one to the next, in the order of reading.
    type :: source_spec
        character(len=path_len) :: file = ""      !! as messages call it
        character(len=:), allocatable :: text
        integer :: lines_before = 0
    end type source_spec

    !> All files that a scene is made of.
    type :: source_shelf
        type(source_spec), allocatable :: item(:)
    end type source_shelf

    !> The whole scene.
    type :: scene_type
        character(len=256) :: title = ""
        character(len=path_len) :: file = ""      !! as given, for messages
        character(len=:), allocatable :: text     !! the scene file itself, with all that it includes, kept in results
        type(source_spec), allocatable :: source(:)  !! the scene file and those that it includes
        character(len=path_len), allocatable :: table_file(:)   !! files read beside it
        logical :: planar = .false.
        real(wp) :: gravity(3) = 0                !! [m/s2]
        logical :: has_gravity = .false.
        integer :: redundancy = share_by_least_norm   !! one of `share_*`: what becomes of reactions that the equations leave open
        type(base_spec) :: base
        logical :: passes_change_points = .true.  !! on the smooth continuation; false: the assembly is lost there
        type(variable_spec), allocatable :: variable(:)
        type(link_spec) :: frame
        type(link_spec), allocatable :: link(:)
        type(joint_spec), allocatable :: joint(:)    !! those that hold something, then parts of poses by which coordinates lead
                                                     !! links
        type(coordinate_spec), allocatable :: coordinate(:)
        type(actuator_spec), allocatable :: actuator(:)
        type(controller_spec), allocatable :: controller(:)
        type(load_spec), allocatable :: load(:)
        type(spring_spec), allocatable :: spring(:)
        type(payload_spec), allocatable :: payload(:)
        type(friction_spec), allocatable :: friction(:)
        type(law_book) :: laws
        type(event_spec), allocatable :: event(:) !! the scene's own, then one for each side of an end stop, and each clutch
        type(stop_spec), allocatable :: stop(:)
        type(clutch_spec), allocatable :: clutch(:)
        type(hold_spec), allocatable :: hold(:)   !! how idle spins are settled; absent: nobody has looked, no file says it
        type(time_spec) :: time
        type(sweep_spec) :: sweep
    end type scene_type

contains

    !> Is what a motor can give bounded?
    elemental logical function has_limits(motor)
        type(motor_spec), intent(in) :: motor

        has_limits = motor%largest_torque > 0 .or. motor%largest_power > 0 .or. motor%largest_current > 0 &
                     .or. motor%torque_curve%kind /= law_none
    end function has_limits

    !> Is a law about the motor behind a joint variable?
    elemental logical function is_at_motor(side)
        integer, intent(in) :: side                 !! one of `side_*`

        is_at_motor = side == side_torque .or. side == side_voltage
    end function is_at_motor

    !> Does a payload's mass change with time?
    elemental logical function payload_changes(payload)
        type(payload_spec), intent(in) :: payload

        payload_changes = payload%mass%kind /= law_constant .or. payload%from > -huge(1.0_wp) .or. payload%until < huge(1.0_wp)
    end function payload_changes

    !> Does the frame move, or a payload change? States do not tell that.
    pure logical function wants_instants(scene)
        type(scene_type), intent(in) :: scene

        wants_instants = scene%base%moves
        if (allocated(scene%payload)) wants_instants = wants_instants .or. any(payload_changes(scene%payload))
    end function wants_instants

    !> Does the frame move, a payload change, or does any law over the state ask for the instant, too?
    pure logical function takes_time(scene)
        type(scene_type), intent(in) :: scene
        integer :: i, k

        takes_time = wants_instants(scene)
        do i = 1, size(scene%laws%law)
            associate (law => scene%laws%law(i))
                if (law%over > 0) takes_time = takes_time .or. scene%laws%measure(law%over)%kind == measure_time
                do k = 1, law%formula%n
                    associate (node => law%formula%node(k))
                        if (node%op == node_symbol .and. node%a > 0) takes_time = takes_time .or. &
                            scene%laws%measure(max(1, node%a))%kind == measure_time
                    end associate
                end do
            end associate
        end do
    end function takes_time

    !> Links whose idle spins are settled, with blanks between them; those that spin as one are joined by "+".
    pure function idle_spins(scene) result(text)
        type(scene_type), intent(in) :: scene
        character(len=:), allocatable :: text
        integer :: i

        text = ""
        if (.not. allocated(scene%hold)) return
        do i = 1, size(scene%hold)
            if (i > 1) text = text//" "
            text = text//scene%hold(i)%links
        end do
    end function idle_spins

    !> What a forward run looks out for.
    pure integer function n_event(scene)
        type(scene_type), intent(in) :: scene

        n_event = 0
        if (allocated(scene%event)) n_event = size(scene%event)
    end function n_event

    !> Controllers of actuators.
    pure integer function n_controller(scene)
        type(scene_type), intent(in) :: scene

        n_controller = 0
        if (allocated(scene%controller)) n_controller = size(scene%controller)
    end function n_controller

    !> Does a controller take samples? Else it is continuous.
    elemental logical function is_sampled(controller)
        type(controller_spec), intent(in) :: controller

        is_sampled = controller%period > 0
    end function is_sampled

    !> Sides of end stops.
    pure integer function n_stop(scene)
        type(scene_type), intent(in) :: scene

        n_stop = 0
        if (allocated(scene%stop)) n_stop = size(scene%stop)
    end function n_stop

    !> Clutches, brakes and locks of joint variables.
    pure integer function n_clutch(scene)
        type(scene_type), intent(in) :: scene

        n_clutch = 0
        if (allocated(scene%clutch)) n_clutch = size(scene%clutch)
    end function n_clutch

    !> Does a spring pull along the line of its markers with a force that does not vanish where they coincide?
    pure elemental logical function pulls_in_line(spring)
        type(spring_spec), intent(in) :: spring

        pulls_in_line = spring%joint == 0 .and. spring%measure == 0 &
                        .and. (spring%rest /= 0 .or. spring%damping /= 0 .or. spring%force%kind /= law_none)
    end function pulls_in_line

    !> Is a measure roll or yaw of a ball, or its rate? Where the ball's pitch is a right angle they have no value of their own; but
    !> as coordinates they are what is given.
    pure logical function loses_itself_at_pole(scene, measure)
        type(scene_type), intent(in) :: scene
        type(measure_spec), intent(in) :: measure
        integer, parameter :: pitch = 2

        loses_itself_at_pole = .false.
        if (measure%kind /= measure_joint) return
        if (scene%joint(measure%joint)%kind /= joint_spherical .or. measure%variable == pitch) return
        loses_itself_at_pole = .not. any(scene%coordinate%kind == coordinate_joint .and. scene%coordinate%joint == measure%joint &
                                         .and. scene%coordinate%variable == measure%variable)
    end function loses_itself_at_pole

    !> Does a measure tell where something is, by coordinates alone? Forces and impulses may act along such a one.
    pure elemental logical function is_place(measure)
        type(measure_spec), intent(in) :: measure

        is_place = any(measure%kind == [measure_joint, measure_marker, measure_distance, measure_attitude, measure_tilt, &
                                        measure_twist]) .and. .not. measure%is_rate
    end function is_place

    !> Where a marker of a link or of the frame is, link axes [m].
    pure function marker_at(scene, link, marker) result(point)
        type(scene_type), intent(in) :: scene
        integer, intent(in) :: link, marker
        real(wp) :: point(3)

        if (link == frame_link) then
            point = scene%frame%marker(marker)%at
        else
            point = scene%link(link)%marker(marker)%at
        end if
    end function marker_at

    !> Axes x, y and z of a marker of a link or the frame, link axes, in columns.
    pure function marker_axes_at(scene, link, marker) result(axes)
        type(scene_type), intent(in) :: scene
        integer, intent(in) :: link, marker
        real(wp) :: axes(3, 3)

        if (link == frame_link) then
            axes = marker_frame(scene%frame%marker(marker))
        else
            axes = marker_frame(scene%link(link)%marker(marker))
        end if
    end function marker_axes_at

    !> The axes in which one link sees another, in columns, own axes: the link's, or those of its marker. In a plane the axis of a
    !> marker is its x.
    pure function seeing_axes_at(scene, link, marker) result(axes)
        type(scene_type), intent(in) :: scene
        integer, intent(in) :: link, marker            !! marker 0: the link's own
        real(wp) :: axes(3, 3)

        axes = reshape([1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 1.0_wp], [3, 3])
        if (marker == 0) return
        if (scene%planar) then
            axes(:, 1) = marker_axis_at(scene, link, marker)
            axes(:, 2) = cross(axes(:, 3), axes(:, 1))
        else
            axes = marker_axes_at(scene, link, marker)
        end if
    end function seeing_axes_at

    !> A marker's frame in columns: z along the axis, x as given, y completing it.
    pure function marker_frame(marker) result(frame)
        type(marker_spec), intent(in) :: marker
        real(wp) :: frame(3, 3)

        frame(:, 1) = marker%x_axis
        frame(:, 2) = cross(marker%axis, marker%x_axis)
        frame(:, 3) = marker%axis
    end function marker_frame

    !> Axis of a marker of a link or the frame, link axes (unit vector).
    pure function marker_axis_at(scene, link, marker) result(axis)
        type(scene_type), intent(in) :: scene
        integer, intent(in) :: link, marker
        real(wp) :: axis(3)

        if (link == frame_link) then
            axis = scene%frame%marker(marker)%axis
        else
            axis = scene%link(link)%marker(marker)%axis
        end if
    end function marker_axis_at

    !> Are there stops that throw back?
    pure logical function has_hard_stops(scene)
        type(scene_type), intent(in) :: scene

        has_hard_stops = .false.
        if (allocated(scene%stop)) has_hard_stops = any(scene%stop%is_hard)
    end function has_hard_stops

    !> How many joints hold something; they come first.
    pure integer function n_holding(scene)
        type(scene_type), intent(in) :: scene

        n_holding = count(.not. is_pose_part(scene%joint%kind))
    end function n_holding

    !> The file in front of a message, unless it begins with one of the scene's already.
    pure subroutine put_file_first(file, scene, message)
        character(len=*), intent(in) :: file
        type(scene_type), intent(in) :: scene
        character(len=*), intent(inout) :: message
        integer :: i

        if (index(message, trim(file)//":") == 1) return
        if (allocated(scene%source)) then
            do i = 2, size(scene%source)
                if (index(message, trim(scene%source(i)%file)//":") == 1) return
            end do
        end if
        message = trim(file)//": "//trim(message)
    end subroutine put_file_first

    !> The hinge or slide in which the follower of a cam is guided: the one on the frame, else the only one; 0: there is none, or
    !> more than one.
    pure integer function guide_of(scene, cam) result(guide)
        type(scene_type), intent(in) :: scene
        integer, intent(in) :: cam                !! the joint
        integer :: n(2), found(2), i, k

        n = 0
        found = 0
        do i = 1, n_holding(scene)
            associate (joint => scene%joint(i), follower => scene%joint(cam)%link(2))
                if (.not. any(joint%kind == [joint_revolute, joint_prismatic]) .or. .not. any(joint%link == follower)) cycle
                if (follower == frame_link) cycle
                k = merge(1, 2, any(joint%link == frame_link))
                n(k) = n(k) + 1
                found(k) = i
            end associate
        end do
        guide = 0
        if (n(1) == 1) then
            guide = found(1)
        else if (n(1) == 0 .and. n(2) == 1) then
            guide = found(2)
        end if
    end function guide_of
end module linkdyn_scene
