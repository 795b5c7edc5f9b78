!> The planned mechanism: constant after `build_model`, read by every algorithm, shared by all threads.
module linkdyn_model
    use linkdyn_breadth, only: breadth
    use linkdyn_constants, only: pi
    use linkdyn_contact, only: contact_type
    use linkdyn_joint_table, only: joint_fixed, is_geared, is_pose_part, is_slide, is_threaded, wraps
    use linkdyn_kinds, only: wp
    use linkdyn_null_space_plan, only: null_space_plan
    use linkdyn_scene, only: scene_type, spring_spec, name_len, coordinate_joint, joint_spherical, joint_universal, &
        joint_prismatic, joint_cylindrical, share_refused, &
        side_torque, side_voltage, side_opening
    implicit none (type, external)
    private
    public :: model_type, link_type, joint_type, step_type, part_type, leg_type, group_type, gear_type, belt_type, &
        led_type, loose_type
    public :: take_motors, list_joints_of_links
    public :: open_part_type, arm_type, driven_type
    public :: axes_of_world, axes_of_joint, axes_of_link
    public :: step_pose, step_joint, step_ups, step_csp, step_rus, step_pus, step_rod, step_hung, step_between, step_gimbal, &
        step_rrr, step_rrp, step_rpr, step_prp, step_ppr, step_group, step_parts, step_name
    public :: stride_part, n_probe, by_branch, by_start, by_markers, by_nothing, by_fit
    public :: gives_attitude, attitude_angles, number_attitudes
    public :: holds_spin, is_released, shared_reactions, gapes, parts_slowly, parts_gently, stands_still, friction_is_shared, &
        feels_shares
    public :: is_dyad, is_led_dyad, is_rod_leg, has_rod, may_turn, rod_of, inner_of_rod, outer_of_rod, universal_of_rod
    public :: turns_in_two, beyond_leg, direction_of_leg
    public :: n_hung_rod, base_of_hung, only_shifts
    public :: dyad_names, orientation_of, side_of, point_on, link_freedom, place_size, has_assemblies
    public :: is_length, is_screw, repeats, scene_size, group_size, reach_of, counts_turns, most_turned
    public :: leads_within, drives_share, counts_for_another, pull_power, effort_power

    !> How far a joint may be open where others hold it [mechanism's sizes, rad]: parts are made less exactly, loops close to 1e-12.
    real(wp), parameter :: gapes = 1.0e-6_wp
    !> How fast its sides may part, over the speed of the links there, and how that may change, over their acceleration: as much as
    !> a joint makes of it that gapes by little everywhere, or rounding near a dead point. One that fits in a pose alone parts as
    !> fast as links move.
    real(wp), parameter :: parts_slowly = 1.0e-5_wp, parts_gently = 1.0e-4_wp
    real(wp), parameter :: stands_still = 1.0e-9_wp    !! of the fastest link, or the strongest acceleration: slower is rounding

    real(wp), parameter :: nothing = 1.0e-12_wp     !! is rounding of places, no size [m]

    ! ---- axes in which directions are told
    integer, parameter :: axes_of_world = 1, axes_of_joint = 2, axes_of_link = 3    !! of a joint: of its first marker

    ! ---- steps of the kinematic program, in the order in which the planner looks for them
    integer, parameter :: step_pose = 1      !! a link whose pose is given by coordinates
    integer, parameter :: step_joint = 2     !! open chain: a link behind a joint whose variables are coordinates
    integer, parameter :: step_ups = 3       !! Assur group: UPS or UCU leg between two known links, see `linkdyn_leg`
    integer, parameter :: step_rrr = 4       !! planar dyads, each a closed form
    integer, parameter :: step_rrp = 5
    integer, parameter :: step_rpr = 6
    integer, parameter :: step_prp = 7
    integer, parameter :: step_ppr = 8
    integer, parameter :: step_group = 9     !! any other Assur group, closed by Newton's method
    integer, parameter :: step_csp = 10      !! Assur group: CSP between two known links
    integer, parameter :: step_parts = 11    !! a link whose pose, or that of a marker of it, is given seen from a known link, or
                                             !! bit by bit
    integer, parameter :: step_rus = 12      !! as CSP a crank and the rod behind it, see `linkdyn_rod_leg`
    integer, parameter :: step_pus = 13      !! and a carriage and the rod behind it
    integer, parameter :: step_rod = 14      !! a rod between known links, see `linkdyn_rod_leg`
    integer, parameter :: step_hung = 15     !! a platform on three rods that does not turn, see `linkdyn_hung_platform`
    integer, parameter :: step_between = 16  !! a cross or sleeve between known links, see `linkdyn_link_between`
    integer, parameter :: step_gimbal = 17   !! the first link between the hinges of a ball in parts, likewise
    character(len=24), parameter :: step_name(17) = [character(len=24) :: "pose", "open chain", "UPS leg", &
        "RRR dyad", "RRP dyad", "RPR dyad", "PRP dyad", "PPR dyad", "Assur group", "CSP group", "parts of a pose", &
        "RUS leg", "PUS leg", "rod", "platform on rods", "link between", "gimbal"]

    ! ---- what decides on an assembly at the start
    integer, parameter :: by_branch = 1      !! the key `branch`
    integer, parameter :: by_start = 2       !! it is the nearest to the starts given
    integer, parameter :: by_markers = 3     !! the links close where their markers are written
    integer, parameter :: by_nothing = 4     !! the first of both; or the nearest to joint variables of zero
    integer, parameter :: by_fit = 5         !! only so do joints fit that others hold already
    real(wp), parameter :: stride_part = 0.1_wp   !! stride of a coordinate: of a radian, or of the mechanism's size
    real(wp), parameter :: most_turned = 165*pi/180     !! of an angle from its start whose turns nobody counts [rad]
    integer, parameter :: n_hung_rod = 3     !! rods of such a platform
    integer, parameter :: n_probe = 2        !! vectors with which the margin of a group is measured

    !> Constants of a moving link.
    type :: link_type
        character(len=name_len) :: name = ""
        real(wp) :: mass = 0                  !! [kg]
        real(wp) :: cog(3) = 0                !! link axes [m]
        real(wp) :: inertia(3, 3) = 0         !! about the cog, link axes [kg m2]
        logical :: is_massless = .false.      !! no inertia at all: nothing to compute
        logical :: is_diagonal = .true.       !! no products of inertia
        integer :: orientation = 0            !! index of the rotation it shares with links that slide on it
        integer :: spin = 0                   !! the idle spin that turns it (see linkdyn_idle_spin); 0: none
        real(wp) :: spin_point(3) = 0         !! of the line about which that is, link axes [m]
        real(wp) :: spin_axis(3) = 0          !! unit vector along it, link axes
    end type link_type

    !> A mass that a link carries; how much it is changes with time.
    type :: payload_type
        integer :: link = 0
        type(link_type) :: body               !! of a unit mass, in the link's axes
    end type payload_type

    !> A motor behind a gear or screw.
    type :: motor_type
        integer :: actuator = 0
        integer :: joint = 0, variable = 0
        real(wp) :: inertia = 0               !! of its rotor at the joint variable: ratio squared times that of the rotor [kg, kg
                                              !! m2]
    end type motor_type

    !> Constants of a joint.
    type :: joint_type
        character(len=name_len) :: name = ""
        integer :: kind = 0                   !! by which it closes loops and transmits forces
        integer :: told_kind = 0              !! as the scene has it, and by which its variables are measured
        integer :: told = 0                   !! its number in the scene: its own, but of one carried over from another link, see
                                              !! `linkdyn_welded_links`; of one that joins others that of the first
        integer :: joined = 0                 !! while it is planned: number of the joint that it is a part of, see
                                              !! `linkdyn_joined_joints`; 0: none
        integer :: part = 0                   !! the first, second or third of these, from the first link of that on
        real(wp) :: start(3) = 0              !! variables near which closure starts [m, rad]
        logical :: has_start = .false.        !! the scene says of them
        integer :: link(2) = 0                !! 0 is the frame
        real(wp) :: point(3, 2) = 0           !! markers in link axes [m]
        real(wp) :: frame(3, 3, 2) = 0        !! marker frames in link axes, columns x, y, z
        real(wp) :: told_frame(3, 3, 2) = 0   !! likewise; both differ where a ball holds an idle spin, or a joint is released
        integer :: first_variable = 0         !! its variables are first_variable + 1, ...
        real(wp) :: pitch = 0                 !! of a screw: slide per angle [m/rad]
        integer :: leg = 0                    !! the leg whose length is its slide
        integer :: attitude = 0               !! that its three angles give
        integer :: gear = 0                   !! number of a gear, rack or belt
        integer :: cam = 0                    !! number of a cam
        integer :: belt = 0                   !! number of a belt that stretches
        real(wp) :: reach = 0                 !! of a cam's curve from its marker, the farthest [m]
    end type joint_type

    !> Two wheels, or a wheel and a rack, whose joint variables are tied. See `linkdyn_gearing`.
    type :: gear_type
        integer :: joint = 0
        integer :: carrier = 0                !! the link in which both turn or slide; 0 is the frame
        real(wp) :: direction(3) = 0          !! of the force on the second link, for a unit of the unknown; carrier axes
        real(wp) :: couple(3, 2) = 0          !! with it about the link's own marker; on the first both are reversed [m]
        real(wp) :: radius(2) = 0             !! of both wheels; of a rack 0 [m]
        real(wp) :: pitch(3) = 0              !! where they touch, of a belt the middle; carrier axes [m]
        real(wp) :: marker(3, 2) = 0          !! points of both markers; carrier axes [m]
        real(wp) :: spin(3, 2) = 0            !! angular velocities of the wheels, none of a rack, while the pitch circles go round
                                              !! with unit speed, as a force above zero drives the second; carrier axes [1/m]
        real(wp), allocatable :: pace(:, :)   !! what the joint variables' rates make of that speed, at each wheel (n_variable, 2)
        real(wp) :: curvature(2) = 0          !! of teeth: what each wheel adds to how fast both turn against each other, over the
                                              !! speed of the pitch circles; below zero of a ring, zero of a rack; of a belt
                                              !! 1/radius [1/m]
        real(wp) :: distance = 0              !! between the axes of a belt's wheels [m]
        real(wp) :: push(3) = 0               !! drives the second link off, for a unit of the force's size; carrier axes
        integer, allocatable :: carries(:)    !! joints that hold both wheels against it: j takes it, -j its opposite
        real(wp), allocatable :: weight(:)    !! of the joint variables in the sum that stays (n_variable)
        real(wp) :: second = 0                !! weight of the second wheel's turning, or the rack's way, in it
        real(wp) :: total = 0                 !! that sum [m]
        logical :: follows = .false.          !! it is a sum of those of other gears
    end type gear_type

    !> A contact of a joint that takes what drives a gear's wheels apart.
    type :: driven_type
        integer :: contact = 0
        integer :: gear = 0
        real(wp) :: sense = 1                 !! 1: it takes that, -1: its opposite
    end type driven_type

    !> A belt that stretches: two strands that pull on both wheels. What would be given, were it rigid, is how far it is stretched.
    type :: belt_type
        type(gear_type) :: gear               !! its wheels, as if it were rigid
        real(wp) :: strand(3) = 0             !! stiffness, damping and pretension of one strand [N/m, N s/m, N]
        real(wp) :: line(3) = 0               !! force on the second link for a unit of both tensions' sum; carrier axes
        real(wp) :: lever(3) = 0              !! with it the moment on the second link about its marker [m]
        integer, allocatable :: joint(:)      !! whose variables, each the first, stretch it
        real(wp), allocatable :: weight(:)    !! by how much (joint) [m, 1]
    end type belt_type

    !> A joint variable that gears make a linear function of the coordinates, and of variables of joints that are placed before: as
    !> good as a coordinate. Where coordinates are numbered, such variables follow after the last.
    type :: led_type
        integer :: joint = 0, variable = 0
        real(wp) :: offset = 0                !! [m, rad]
        real(wp), allocatable :: weight(:)    !! (n_q)
        integer, allocatable :: source(:)     !! joints that are placed before, each with one variable
        real(wp), allocatable :: source_weight(:)
    end type led_type

    !> A sum of joint variables that gears keep and that coordinates alone do not tell apart.
    type :: loose_type
        integer :: gear = 0                   !! by which it comes
        integer, allocatable :: joint(:)      !! each with one variable
        real(wp), allocatable :: part(:)      !! in the sum (joint)
        real(wp) :: total = 0
        real(wp), allocatable :: weight(:)    !! what coordinates add to it (n_q)
    end type loose_type

    !> One step of the kinematic program.
    type :: step_type
        integer :: kind = 0
        integer :: n_link = 0
        integer :: link(4) = 0                !! links that the step determines
        integer :: joint(9) = 0               !! joints that it uses: of a dyad outer, inner, outer, then those slides inside it
                                              !! whose variables are given; links beyond the second are at their far ends; of a
                                              !! rod that holds a platform see `linkdyn_parallel_rods`
        integer :: coordinate(6) = 0          !! coordinates that it uses, in the order of the components; of a dyad those of the
                                              !! slides inside it, then x and y of the points of either half that are given in place
                                              !! of outer joints
        integer :: first = 0                  !! index of its own state in the workspace (attitudes, legs, dyads, other closed
                                              !! forms, groups)
        logical :: from_second = .false.      !! an open-chain joint walked from its second link to its first
        logical :: base_moves = .false.       !! the base link of a leg moves
        logical :: has_branches = .false.     !! there are two ways to close at one place: see the model's `branch`
        logical :: has_margin = .false.       !! `branch` tells its assemblies apart, of which a motion may come to the end: see
                                              !! `linkdyn_margins`
        integer :: branch = 0                 !! of a leg: +1, its slide's axis points from its first end to its last, or -1; 0:
                                              !! written as a chain writes it, it has +1 and a turn of +1
        integer :: turn = 0                   !! likewise: +1, its second universal axis points as s x first axis does, or -1; of a
                                              !! rod, too; of a gimbal +1, its second axis points as first x third does, or -1
        integer :: far_turn = 0               !! the same at the last end, if there is a universal joint, too
        integer :: number = 0                 !! in the plan
        real(wp) :: stance(3, 3) = reshape([1, 0, 0, 0, 1, 0, 0, 0, 1], [3, 3])    !! of a link that only shifts: its axes in those
                                              !! of the link against which it does not turn
    end type step_type

    !> What the kernels of a step take from the model, see `linkdyn_step_part`.
    type :: part_type
        character(len=:), allocatable :: key  !! steps with the same one share their kernels
        integer, allocatable :: link(:)       !! that it places
        integer, allocatable :: around(:)     !! these, and then those that they hang on
        logical, allocatable :: turns(:)      !! a link's orientation is its own; else it is that of another one (link)
        integer, allocatable :: joint(:)
        integer, allocatable :: given(:)      !! what gives variables: coordinates, and beyond the last what gears lead
        real(wp), allocatable :: number(:)    !! as kernels take them
    end type part_type

    !> The links of a UPS leg.
    type :: leg_type
        integer :: lower = 0, upper = 0
    end type leg_type

    !> Links placed together by Newton's method.
    type :: group_type
        integer, allocatable :: link(:)
        integer, allocatable :: joint(:)      !! between them, and to known links
        integer, allocatable :: coordinate(:, :)  !! that gives a joint's variable; 0: free (3, n joints)
        logical, allocatable :: turns(:)      !! the link's orientation is its own; else it is that of another link
        real(wp), allocatable :: start(:, :)  !! places of the links at the coordinates' start (place_size, n)
        integer :: n_found = 1                !! assemblies among which that of the start was chosen; 0: others were not looked for
        integer :: n_passed_over = 0          !! nearer ones, with which loops behind the group do not close
        integer :: chosen_by = 0              !! what decided it: one of `by_*`
        real(wp) :: size = 1                  !! how far joints of a link are apart [m], see `group_size`
        real(wp), allocatable :: row_unit(:)  !! of its constraints: its size for a distance, 1 for an angle (row)
        real(wp), allocatable :: probe(:, :)  !! what the margin is measured with (row, n_probe); see linkdyn_newton_group
        real(wp), allocatable :: unit(:)      !! of the corrections (column) [m, rad]
        integer :: n_thread = 0               !! joints in which a turn ties a slide
        real(wp), allocatable :: thread_axis(:, :)    !! of a link's thread, link axes; 0: it has none (3, link)
        real(wp), allocatable :: thread_point(:, :)   !! on that axis (3, link) [m]
        integer :: step = 0                   !! of the plan, that places them
    end type group_type

    !> Along what a joint's force, or its moment, is not determined: what is square to these directions is. See
    !> `linkdyn_open_directions`.
    type :: open_part_type
        logical :: world(3) = .false.         !! it is not along these world axes, in every pose that the mechanism takes
        integer :: n = 0                      !! directions; 0: it is determined
        integer :: axes = axes_of_world       !! in which these directions stay
        integer :: link = 0                   !! whose axes these are
        real(wp) :: direction(3, 3) = 0       !! orthonormal (3, n)
        integer :: n_at_once = 0              !! directions of a single pose: fewer where they turn against all links
    end type open_part_type

    !> Reactions that the equations alone do not determine, because joints hold directions that others hold already. See
    !> `linkdyn_release` and `linkdyn_shared_reactions`.
    type :: share_type
        integer :: n = 0                      !! states of self-stress; 0: all reactions are determined
        logical :: may_gape = .false.         !! joints were let go that fit only if the geometry does; else gears that always do
        integer, allocatable :: joint(:)      !! that take part
        integer, allocatable :: link(:)       !! between them
        logical, allocatable :: of_force(:), of_moment(:)    !! what of these joints is not determined
        type(open_part_type), allocatable :: part(:, :)      !! of it: of the force, of the moment (2, joint)
        type(null_space_plan) :: stress       !! how the states of self-stress follow from the joints' constraint rows
    end type share_type

    !> The elastic part of a link between where its mass acts and the marker of a joint. See `linkdyn_elastic_links`.
    type :: arm_type
        integer :: joint = 0
        integer :: side = 0                   !! of the joint, that is the link
        integer :: n = 0                      !! parts of the energy
        real(wp) :: row(6, 6) = 0             !! of force and moment at the marker, link axes (6, part)
        real(wp) :: weight(6) = 0             !! [m/N, rad/(N m)]
    end type arm_type

    !> A mechanism ready to be computed.
    type :: model_type
        type(scene_type) :: scene
        logical :: is_planar = .false.
        integer :: n_link = 0                 !! moving links
        integer :: n_joint = 0                !! that hold something
        integer :: n_q = 0                    !! generalized coordinates
        integer :: n_actuator = 0
        integer :: n_load = 0
        integer :: n_variable = 0             !! joint variables
        integer :: n_cam = 0                  !! joints that are cams
        integer :: n_orientation = 0
        integer :: n_attitude = 0             !! links turned by three angles: of a pose, or of a spherical joint
        integer :: n_leg = 0
        integer :: n_dyad = 0
        integer :: n_branch = 0               !! closed forms that have a branch: the dyads, in space CSP groups and legs with rods
        logical :: closed_forms = .true.      !! are used where there are some; false: everything by Newton's method, to compare
                                              !! with
        real(wp), allocatable :: least_margin(:)    !! of each map: below it is not told from zero (n_branch + groups)
        integer :: n_row = 0                  !! equations: 3 a planar, 6 a spatial link
        integer :: n_component = 0            !! of a reaction: 3 planar, 6 spatial
        real(wp) :: gravity(3) = 0
        type(link_type), allocatable :: link(:)
        type(joint_type), allocatable :: joint(:)    !! those that hold something, then those by which coordinates lead links, then
                                                     !! those that join others, and those carried over from other links
        type(step_type), allocatable :: step(:)
        type(leg_type), allocatable :: leg(:)
        type(payload_type), allocatable :: payload(:)
        type(gear_type), allocatable :: gear(:)
        type(belt_type), allocatable :: belt(:)      !! those that stretch
        type(motor_type), allocatable :: motor(:)    !! of the actuators that have one
        type(contact_type), allocatable :: contact(:)    !! where joints rub
        type(driven_type), allocatable :: driven(:)      !! those that feel what drives wheels apart
        type(led_type), allocatable :: led(:)
        type(loose_type), allocatable :: loose(:)
        type(part_type), allocatable :: part(:)       !! (step)
        type(group_type), allocatable :: group(:)
        type(share_type) :: share
        type(arm_type), allocatable :: arm(:) !! of links that give way
        logical, allocatable :: moves(:, :)   !! (n_q, n_link): the coordinate moves the link
        integer, allocatable :: first_at(:)   !! joints of link l: joint_at(first_at(l):first_at(l+1)-1)
        integer, allocatable :: joint_at(:)
        real(wp), allocatable :: start_q(:)   !! coordinates at the start (n_q)
        real(wp), allocatable :: stride(:)    !! change of a coordinate through which a group can be followed (n_q) [m, rad]
        real(wp), allocatable :: branch(:)    !! of the closed forms at the start: +1 or -1 (n_branch)
        integer, allocatable :: chosen_by(:)  !! what decided it: one of `by_*` (n_branch)
    end type model_type

contains

    !> The scene's motors.
    pure subroutine take_motors(model)
        type(model_type), intent(inout) :: model
        integer :: i

        allocate (model%motor(0))
        do i = 1, size(model%scene%actuator)
            associate (spec => model%scene%actuator(i))
                if (spec%motor%is_given) model%motor = [model%motor, motor_type(actuator=i, joint=spec%joint, &
                    variable=spec%variable, inertia=spec%motor%ratio**2*spec%motor%inertia)]
            end associate
        end do
    end subroutine take_motors

    !> Which joints a link has, so that nobody need search for them. Gears hold nothing: they are not among them.
    pure subroutine list_joints_of_links(model)
        type(model_type), intent(inout) :: model
        integer :: place(0:model%n_link), i, j, side

        place = 0
        do j = 1, size(model%joint)
            if (is_listed(model%joint(j))) place(model%joint(j)%link) = place(model%joint(j)%link) + 1
        end do
        if (allocated(model%first_at)) deallocate (model%first_at, model%joint_at)
        allocate (model%first_at(model%n_link + 1), model%joint_at(sum(place(1:))))
        model%first_at(1) = 1
        do i = 1, model%n_link
            model%first_at(i + 1) = model%first_at(i) + place(i)
        end do
        place(1:) = model%first_at(:model%n_link)
        do j = 1, size(model%joint)
            if (.not. is_listed(model%joint(j))) cycle
            do side = 1, 2
                i = model%joint(j)%link(side)
                if (i == 0) cycle
                model%joint_at(place(i)) = j
                place(i) = place(i) + 1
            end do
        end do

    contains

        pure logical function is_listed(joint)
            type(joint_type), intent(in) :: joint

            is_listed = .not. (is_geared(joint%told_kind) .or. is_pose_part(joint%kind)) .and. joint%joined == 0
        end function is_listed
    end subroutine list_joints_of_links

    !> The planar dyads by their inner joints, in the order of their states.
    pure function dyad_names(model) result(name)
        type(model_type), intent(in) :: model
        character(len=name_len) :: name(model%n_dyad)
        integer :: i

        name = ""
        do i = 1, size(model%step)
            associate (step => model%step(i))
                if (is_dyad(step%kind)) name(step%first) = model%joint(step%joint(2))%name
            end associate
        end do
    end function dyad_names

    !> Does a ball joint hold an idle spin, as a universal joint would, or a cylindrical one as a slide? The moment that this
    !> takes is none.
    pure logical function holds_spin(joint)
        type(joint_type), intent(in) :: joint

        holds_spin = (joint%kind == joint_universal .and. joint%told_kind == joint_spherical) &
                     .or. (joint%kind == joint_prismatic .and. joint%told_kind == joint_cylindrical)
    end function holds_spin

    !> Reactions that the equations leave open, "J1.force J1.moment J2.force", and driving forces that depend on how joints share
    !> them, "drive.driving_force"; nothing if there are none.
    pure function shared_reactions(model) result(text)
        type(model_type), intent(in) :: model
        character(len=:), allocatable :: text
        integer :: i

        text = ""
        if (model%share%n == 0) return
        do i = 1, size(model%share%joint)
            associate (name => model%joint(model%share%joint(i))%name)
                if (model%share%of_force(i)) text = text//" "//trim(name)//".force"
                if (model%share%of_moment(i)) text = text//" "//trim(name)//".moment"
            end associate
        end do
        if (friction_is_shared(model)) then
            do i = 1, model%n_actuator
                text = text//" "//trim(model%scene%actuator(i)%name)//".driving_force"
            end do
        end if
        text = text(2:)
    end function shared_reactions

    !> Does friction come of reactions that the equations leave open? All forces then depend on how these are shared.
    pure logical function friction_is_shared(model)
        type(model_type), intent(in) :: model
        integer :: i

        friction_is_shared = .false.
        do i = 1, size(model%contact)
            friction_is_shared = friction_is_shared .or. feels_shares(model, model%contact(i)%joint)
        end do
    end function friction_is_shared

    !> Is any of a joint's reaction left open by the equations?
    pure logical function feels_shares(model, joint)
        type(model_type), intent(in) :: model
        integer, intent(in) :: joint

        feels_shares = .false.
        if (model%share%n == 0) return
        feels_shares = any(model%share%joint == joint .and. (model%share%of_force .or. model%share%of_moment))
    end function feels_shares

    !> Does a joint hold less than the scene says, as others hold it already?
    pure logical function is_released(joint)
        type(joint_type), intent(in) :: joint

        is_released = joint%kind /= joint%told_kind .and. .not. (holds_spin(joint) .or. joint%belt > 0)
    end function is_released

    !> Is the step one of the planar dyads?
    pure logical function is_dyad(kind)
        integer, intent(in) :: kind

        is_dyad = kind >= step_rrr .and. kind <= step_ppr
    end function is_dyad

    !> A dyad that coordinates lead: in which slides, whose variables are given, hold links together two by two, or a point of which
    !> is given.
    pure logical function is_led_dyad(step)
        type(step_type), intent(in) :: step

        is_led_dyad = is_dyad(step%kind) .and. any(step%coordinate > 0)
    end function is_led_dyad

    !> Is it a crank or carriage with a rod behind it?
    elemental logical function is_rod_leg(kind)
        integer, intent(in) :: kind

        is_rod_leg = kind == step_rus .or. kind == step_pus
    end function is_rod_leg

    !> May a link of the step be turned in two ways that look alike to the links around?
    elemental logical function may_turn(kind)
        integer, intent(in) :: kind

        may_turn = has_rod(kind) .or. kind == step_gimbal
    end function may_turn

    !> Is there a rod in it, alone or behind such a lead?
    elemental logical function has_rod(kind)
        integer, intent(in) :: kind

        has_rod = is_rod_leg(kind) .or. kind == step_rod
    end function has_rod

    pure integer function rod_of(step) result(link)
        type(step_type), intent(in) :: step

        link = step%link(step%n_link)
    end function rod_of

    !> Where the rod begins: at the lead, which is known if the rod is alone.
    pure integer function inner_of_rod(step) result(joint)
        type(step_type), intent(in) :: step

        joint = step%joint(step%n_link)
    end function inner_of_rod

    !> Where it ends.
    pure integer function outer_of_rod(step) result(joint)
        type(step_type), intent(in) :: step

        joint = step%joint(step%n_link + 1)
    end function outer_of_rod

    !> Universal joint of a rod, on either side of the rod.
    pure integer function universal_of_rod(model, step) result(joint)
        type(model_type), intent(in) :: model
        type(step_type), intent(in) :: step

        joint = merge(inner_of_rod(step), outer_of_rod(step), model%joint(inner_of_rod(step))%kind == joint_universal)
    end function universal_of_rod

    !> Of a leg: do its halves turn about its line on their own, each held by a universal joint (UCU)? Else they turn as one (UPS).
    pure logical function turns_in_two(model, step)
        type(model_type), intent(in) :: model
        type(step_type), intent(in) :: step

        turns_in_two = model%joint(step%joint(3))%kind == joint_universal
    end function turns_in_two

    !> The link on which a half of a leg hangs.
    pure integer function beyond_leg(model, step, half) result(link)
        type(model_type), intent(in) :: model
        type(step_type), intent(in) :: step
        integer, intent(in) :: half                    !! 1 or 2

        associate (joint => model%joint(step%joint(2*half - 1)))
            link = joint%link(3 - side_of(joint, step%link(half)))
        end associate
    end function beyond_leg

    !> Along a leg from its first end to its last, axes of one of its halves.
    pure function direction_of_leg(model, step, half) result(direction)
        type(model_type), intent(in) :: model
        type(step_type), intent(in) :: step
        integer, intent(in) :: half                    !! 1 or 2
        real(wp) :: direction(3)

        associate (slide => model%joint(step%joint(2)))
            direction = slide%frame(:, 3, side_of(slide, step%link(half)))
        end associate
        if (step%branch < 0) direction = -direction
    end function direction_of_leg

    !> As which link a platform on rods turns: that on which the first lead hangs by hinge or slide.
    pure integer function base_of_hung(model, step) result(base)
        type(model_type), intent(in) :: model
        type(step_type), intent(in) :: step
        integer :: rod, lead

        associate (joint => model%joint, inner => step%joint(1), outer => step%joint(2), hinge => step%joint(2*n_hung_rod + 1))
            rod = joint(outer)%link(3 - side_of(joint(outer), step%link(1)))
            lead = joint(inner)%link(3 - side_of(joint(inner), rod))
            base = joint(hinge)%link(3 - side_of(joint(hinge), lead))
        end associate
    end function base_of_hung

    !> Does the step place a link in space that does not turn against one that is known?
    elemental logical function only_shifts(step)
        type(step_type), intent(in) :: step

        only_shifts = step%kind == step_hung .or. (step%kind == step_parts .and. step%joint(2) == 0)
    end function only_shifts

    !> Freedoms of a link on its own.
    pure integer function link_freedom(model)
        type(model_type), intent(in) :: model

        link_freedom = merge(3, 6, model%is_planar)
    end function link_freedom

    !> Numbers that place a link: x, y, angle; in space x, y, z and a quaternion.
    pure integer function place_size(model)
        type(model_type), intent(in) :: model

        place_size = merge(3, 7, model%is_planar)
    end function place_size

    !> Is a coordinate a length, not an angle?
    pure logical function is_length(model, k)
        type(model_type), intent(in) :: model
        integer, intent(in) :: k

        associate (coordinate => model%scene%coordinate(k))
            is_length = coordinate%variable <= 3
            if (coordinate%kind == coordinate_joint) is_length = is_slide(model%joint(coordinate%joint)%kind, coordinate%variable)
        end associate
    end function is_length

    !> Is a coordinate the angle of a screw?
    pure logical function is_screw(model, k)
        type(model_type), intent(in) :: model
        integer, intent(in) :: k

        associate (coordinate => model%scene%coordinate(k))
            is_screw = coordinate%kind == coordinate_joint
            if (is_screw) is_screw = is_threaded(model%joint(coordinate%joint)%kind)
        end associate
    end function is_screw

    !> Is a coordinate an angle after a whole turn of which the mechanism looks alike? With a screw in it a nut has gone
    !> on, with gears some wheel stands elsewhere, and what closes by gears may have come round to another assembly.
    pure logical function repeats(model, k)
        type(model_type), intent(in) :: model
        integer, intent(in) :: k
        integer :: i, j

        repeats = .not. (is_length(model, k) .or. any(is_threaded(model%joint%kind)) .or. closes_by_gears(model))
        do i = 1, size(model%led)
            ! a wheel has turned by its part
            associate (led => model%led(i))
                if (led%weight(k) == 0) cycle
                repeats = repeats .and. .not. is_slide(model%joint(led%joint)%kind, led%variable) &
                          .and. led%weight(k) == anint(led%weight(k))
            end associate
        end do
        ! and a belt that stretches is longer
        do i = 1, size(model%belt)
            do j = 1, size(model%belt(i)%joint)
                repeats = repeats .and. .not. turns_with(model, model%belt(i)%joint(j), k)
            end do
        end do
    end function repeats

    !> Is a coordinate the variable of a joint, or does it lead it?
    pure logical function turns_with(model, j, k)
        type(model_type), intent(in) :: model
        integer, intent(in) :: j, k                    !! joint, coordinate
        integer :: i

        associate (c => model%scene%coordinate(k))
            turns_with = c%kind == coordinate_joint .and. c%joint == j
        end associate
        do i = 1, size(model%led)
            if (model%led(i)%joint == j) turns_with = turns_with .or. abs(model%led(i)%weight(k)) > 0
        end do
    end function turns_with

    !> Does it matter for a led variable how many turns the angle of its source s has made? Not if these are whole turns of it.
    pure logical function counts_turns(model, led, s)
        type(model_type), intent(in) :: model
        type(led_type), intent(in) :: led
        integer, intent(in) :: s
        real(wp), parameter :: rounding = 1.0e-12_wp

        counts_turns = wraps(model%joint(led%source(s))%kind, 1)
        if (.not. counts_turns .or. is_slide(model%joint(led%joint)%kind, led%variable)) return
        counts_turns = abs(led%source_weight(s) - anint(led%source_weight(s))) > rounding
    end function counts_turns

    !> Does a group that is closed by iteration close by way of gears: by a variable that they make of others of the same group?
    pure logical function closes_by_gears(model)
        type(model_type), intent(in) :: model
        integer :: g, i, c

        closes_by_gears = .false.
        do g = 1, size(model%group)
            associate (group => model%group(g))
                do i = 1, size(group%joint)
                    c = group%coordinate(1, i) - model%n_q
                    if (c > 0) closes_by_gears = closes_by_gears .or. any(leads_within(model%led(c), group%joint))
                end do
            end associate
        end do
    end function closes_by_gears

    !> Does a coordinate stand in for an angle, in part of a forward run?
    pure logical function counts_for_another(model, k)
        type(model_type), intent(in) :: model
        integer, intent(in) :: k

        associate (c => model%scene%coordinate(k))
            counts_for_another = c%for_joint > 0
            if (counts_for_another) counts_for_another = wraps(model%joint(c%for_joint)%kind, c%for_variable)
        end associate
    end function counts_for_another

    !> Are there more drives than freedoms, which share the work?
    pure logical function drives_share(model)
        type(model_type), intent(in) :: model

        drives_share = model%n_actuator > model%n_q .and. model%scene%redundancy /= share_refused
    end function drives_share

    !> Which sources of a led variable are among some joints.
    pure function leads_within(led, joint) result(leads)
        type(led_type), intent(in) :: led
        integer, intent(in) :: joint(:)
        logical :: leads(size(led%source))
        integer :: s

        do s = 1, size(led%source)
            leads(s) = any(joint == led%source(s))
        end do
    end function leads_within

    !> A length typical of the mechanism [m], wherever in the world it is drawn; where all joints are at the origins of their links,
    !> as in a spherical linkage drawn from its centre, there is none, and any does. Parts that are placed as one count as one.
    pure real(wp) function scene_size(model)
        type(model_type), intent(in) :: model
        logical :: counts(size(model%joint)), is_plain
        integer :: i, j

        associate (joint => model%joint, last => size(model%joint))
            is_plain = .true.
            if (last > 0) is_plain = joint(last)%told == last
            if (is_plain) then
                scene_size = size_of(joint(:model%n_joint))
                return
            end if
            counts = [(j <= model%n_joint, j=1, last)]
            do j = 1, last
                if (joint(j)%told == j) cycle
                counts(joint(j)%told) = .false.
                counts(j) = joint(j)%kind /= joint_fixed .and. .not. is_pose_part(joint(j)%kind)
            end do
            do i = 1, size(model%step)
                if (all(model%step(i)%kind /= [step_between, step_gimbal])) cycle
                counts = counts .and. joint%link(1) /= model%step(i)%link(1) .and. joint%link(2) /= model%step(i)%link(1)
            end do
            scene_size = size_of(pack(joint, counts))
        end associate
    end function scene_size

    !> How far joints of a link are from its origin, the largest [m].
    pure real(wp) function reach_of(model, joint, link) result(reach)
        type(model_type), intent(in) :: model
        integer, intent(in) :: joint(:), link
        integer :: i, side

        reach = 0
        do i = 1, size(joint)
            do side = 1, 2
                if (model%joint(joint(i))%link(side) == link) reach = max(reach, norm2(model%joint(joint(i))%point(:, side)))
            end do
        end do
    end function reach_of

    !> Size of a group by its joints: what is far from them, a tool at the end of a boom, says nothing of it.
    pure real(wp) function group_size(model, group)
        type(model_type), intent(in) :: model
        type(group_type), intent(in) :: group

        group_size = size_of(model%joint(group%joint))
    end function group_size

    !> How far a joint of a link is from the middle of the link's other joints, how broad the frame is between its joints, or what
    !> their curves reach, the largest [m]. Of a bar it is the length. Where links and the frame have their origins says nothing.
    pure real(wp) function size_of(joint)
        type(joint_type), intent(in) :: joint(:)
        real(wp), parameter :: rounding = 64*epsilon(1.0_wp)
        integer, allocatable :: n(:), held(:)
        real(wp), allocatable :: sum_of(:, :)
        real(wp) :: apart
        integer :: j, side, most

        size_of = 0
        most = 0
        do j = 1, size(joint)
            size_of = max(size_of, joint(j)%reach)
            most = max(most, maxval(joint(j)%link))
        end do
        allocate (n(most), source=0)
        allocate (sum_of(3, most), source=0.0_wp)
        do j = 1, size(joint)
            do side = 1, 2
                associate (link => joint(j)%link(side))
                    if (link == 0) cycle
                    n(link) = n(link) + 1
                    sum_of(:, link) = sum_of(:, link) + joint(j)%point(:, side)
                end associate
            end do
        end do
        do j = 1, size(joint)
            do side = 1, 2
                associate (link => joint(j)%link(side), point => joint(j)%point(:, side))
                    if (link == 0) cycle
                    if (n(link) < 2) cycle
                    apart = norm2(point - (sum_of(:, link) - point)/(n(link) - 1))
                    if (apart > rounding*maxval(abs(point))) size_of = max(size_of, apart)
                end associate
            end do
        end do
        held = pack([(j, j=1, size(joint))], [(any(joint(j)%link == 0) .and. .not. is_pose_part(joint(j)%kind), j=1, size(joint))])
        size_of = max(size_of, breadth(reshape([(joint(held(j))%point(:, findloc(joint(held(j))%link, 0, dim=1)), &
                                                 j=1, size(held))], [3, size(held)])))
        if (size_of < nothing) size_of = 1
    end function size_of

    !> Does a step turn its link by three angles that are coordinates?
    pure logical function gives_attitude(model, step)
        type(model_type), intent(in) :: model
        type(step_type), intent(in) :: step

        gives_attitude = .false.
        if (model%is_planar) return
        gives_attitude = step%kind == step_pose
        if (step%kind == step_parts) gives_attitude = all(step%coordinate(4:) > 0)
        if (step%kind == step_joint) gives_attitude = model%joint(step%joint(1))%kind == joint_spherical
    end function gives_attitude

    !> These coordinates: roll, pitch and yaw.
    pure function attitude_angles(step) result(coordinate)
        type(step_type), intent(in) :: step
        integer :: coordinate(3)

        coordinate = merge(step%coordinate(1:3), step%coordinate(4:6), step%kind == step_joint)
    end function attitude_angles

    !> Steps that turn their links by three angles have a place for the attitude in the workspace.
    pure subroutine number_attitudes(model)
        type(model_type), intent(inout) :: model
        integer :: i

        model%n_attitude = 0
        do i = 1, size(model%step)
            if (.not. gives_attitude(model, model%step(i))) cycle
            model%n_attitude = model%n_attitude + 1
            model%step(i)%first = model%n_attitude
            if (model%step(i)%kind == step_joint) model%joint(model%step(i)%joint(1))%attitude = model%n_attitude
            if (model%step(i)%kind == step_parts) model%joint(model%step(i)%joint(2))%attitude = model%n_attitude
        end do
    end subroutine number_attitudes

    !> Has the mechanism more than one assembly at given coordinates, so that it matters where it comes from?
    pure logical function has_assemblies(model)
        type(model_type), intent(in) :: model

        has_assemblies = model%n_branch > 0 .or. size(model%group) > 0
    end function has_assemblies

    !> The orientation of a link; 0 for the frame.
    pure integer function orientation_of(model, link)
        type(model_type), intent(in) :: model
        integer, intent(in) :: link

        orientation_of = 0
        if (link > 0) orientation_of = model%link(link)%orientation
    end function orientation_of

    !> Power of the size with which a spring's own law goes in a similar mechanism: 1, it grows with the size as forces do, or 2, as
    !> moments do.
    pure integer function pull_power(model, spring)
        type(model_type), intent(in) :: model
        type(spring_spec), intent(in) :: spring
        logical :: turns

        turns = .false.
        if (spring%joint > 0) turns = .not. is_slide(model%joint(spring%joint)%told_kind, spring%variable)
        if (spring%measure > 0) turns = model%scene%laws%measure(spring%measure)%length_power == 0
        pull_power = merge(2, 1, turns)
    end function pull_power

    !> Power of the size with which the law of an actuator goes in a similar mechanism. A voltage is to its torque constant as its
    !> speed is to one; valves open alike: 0.
    pure integer function effort_power(model, i)
        type(model_type), intent(in) :: model
        integer, intent(in) :: i                 !! actuator

        associate (spec => model%scene%actuator(i))
            select case (spec%law%side)
            case (side_torque)
                effort_power = 2
            case (side_voltage)
                effort_power = 1
            case (side_opening)
                effort_power = 0
            case default
                effort_power = merge(1, 2, is_slide(model%joint(spec%joint)%told_kind, spec%variable))
            end select
        end associate
    end function effort_power

    !> Is the link the first (1) or the second (2) of the joint?
    pure integer function side_of(joint, link)
        type(joint_type), intent(in) :: joint
        integer, intent(in) :: link

        side_of = merge(1, 2, joint%link(1) == link)
    end function side_of

    !> The marker of a joint on one of its two links, link axes [m].
    pure function point_on(joint, link) result(point)
        type(joint_type), intent(in) :: joint
        integer, intent(in) :: link
        real(wp) :: point(3)

        point = joint%point(:, side_of(joint, link))
    end function point_on
end module linkdyn_model
