!> Actuators with their drives, loads and springs of a scene file.
module linkdyn_scene_forces
    use linkdyn_kinds, only: wp
    use linkdyn_status, only: status_type
    use linkdyn_text, only: to_text, quoted
    use linkdyn_scene, only: scene_type, actuator_spec, effort_law, load_spec, law_spec, spring_spec, &
        joint_cylindrical, joint_spherical, frame_link, axes_world, effort_inverse, effort_constant, effort_table, &
        effort_spring_damper, effort_dc_motor, effort_pd, effort_over, law_constant, law_over, side_torque, &
        side_voltage, side_opening, is_at_motor, has_limits, name_len, at_force, at_stiffness, at_damping, at_rest, at_ratio, &
        at_efficiency, at_torque_constant, at_voltage_constant, at_gain, at_resistance
    use linkdyn_toml, only: toml_node, toml_array, toml_table
    use linkdyn_units, only: quantity_type, plain_number, force, moment, length, stiffness, angular_stiffness, &
        damping, angular_damping, torque_per_current, volt_second, volt_per_angle, volt_per_length, voltage, resistance, &
        valve_opening
    use linkdyn_scene_keys, only: scene_place, place_at, line_text, refuse, refuse_value, refuse_missing, allow_keys, counted, &
        get_quantity, get_name, get_word, get_text, require_table
    use linkdyn_scene_names, only: find_marker, find_joint, find_variable
    use linkdyn_scene_joints, only: require_two_links, variable_quantity
    use linkdyn_scene_motors, only: read_motor_drive
    use linkdyn_scene_cylinders, only: read_cylinder
    use linkdyn_scene_motion, only: joint_variable_name
    use linkdyn_scene_pattern, only: repeated_tables, list_repeated, repeated_at
    use linkdyn_scene_state_laws, only: read_force_law, read_spring_law
    use linkdyn_scene_laws, only: table_shelf, table_reading, read_law, read_table_keys, law_of_column, &
        has_column, constant_law, spline, straight_lines, require_positive
    implicit none (type, external)
    private
    public :: read_actuators, read_loads, read_springs, read_stiffness, force_quantity

    integer, parameter :: effort_voltage = 8        !! any law of the voltage at a motor; it is kept as the law that it is
    integer, parameter :: effort_valve = 9          !! any law of how far a valve is open, likewise
    character(len=13), parameter :: effort_law_name(9) = [character(len=13) :: "inverse", "constant", "table", &
        "spring-damper", "dc-motor", "pd", "formula", "voltage", "valve"]

contains

    !> The tables [[actuator]], then the joints that chains drive.
    subroutine read_actuators(root, driven, shelf, scene, status)
        type(scene_place), intent(in) :: root
        integer, intent(in) :: driven(:)               !! joints that chains drive
        type(table_shelf), intent(inout) :: shelf
        type(scene_type), intent(inout) :: scene
        type(status_type), intent(inout) :: status
        type(repeated_tables) :: tables
        type(scene_place) :: place
        integer :: i, n

        call list_repeated(root, "actuator", scene%planar, .false., tables, status)
        if (.not. status%is_ok()) return
        n = size(tables%table)
        allocate (scene%actuator(n + size(driven)))
        do i = 1, n
            place = repeated_at(root, tables, i, "actuator")
            call read_actuator(place, shelf, scene, scene%actuator(i), status)
            if (.not. status%is_ok()) return
            call compare_motors(place, scene, i, status)
            if (.not. status%is_ok()) return
        end do
        do i = 1, size(driven)
            scene%actuator(n + i)%joint = driven(i)
            ! what a chain drives is a slide or an angle; of a cylindrical joint the slide
            if (scene%joint(driven(i))%kind == joint_cylindrical) scene%actuator(n + i)%variable = 2
            scene%actuator(n + i)%line = scene%joint(driven(i))%line
            call name_actuator(scene, scene%actuator(n + i))
        end do
        call refuse_doubles(root, scene%actuator, status)
    end subroutine read_actuators

    subroutine read_actuator(place, shelf, scene, actuator, status)
        type(scene_place), intent(inout) :: place
        type(table_shelf), intent(inout) :: shelf
        type(scene_type), intent(in) :: scene
        type(actuator_spec), intent(inout) :: actuator
        type(status_type), intent(inout) :: status
        type(toml_node) :: node
        logical :: found

        call find_joint(scene, place, actuator%joint, status)
        if (.not. status%is_ok()) return
        actuator%line = place%line
        place%what = "actuator "//quoted(scene%joint(actuator%joint)%name)
        call allow_keys(place, [character(len=8) :: "joint", "variable", "name", "law", "share", "preload", "drive", "cylinder"], &
                        status)
        if (status%is_ok() .and. scene%joint(actuator%joint)%kind == joint_spherical) call refuse_value(place, "joint", &
            place%node%get("joint"), "names a spherical joint, which no single torque drives "// &
            "(expected a joint with an axis)", status)
        call find_variable(scene, place, actuator%joint, actuator%variable, status)
        call name_actuator(scene, actuator)
        call read_own_name(place, actuator, status)
        place%what = "actuator "//quoted(actuator%name)
        call get_quantity(place, "share", plain_number, actuator%share, status, found)
        if (status%is_ok() .and. actuator%share <= 0) call refuse_value(place, "share", place%node%get("share"), &
            "is not above zero (expected the part of this drive in the work that several share, for example 2)", status)
        if (found) call refuse_unshared(place, scene, status)
        call get_quantity(place, "preload", force_quantity(scene%joint(actuator%joint)%kind, actuator%variable), &
                          actuator%preload, status, found)
        node = place%node%get("law")
        actuator%has_law = node%is_present()
        if (node%is_present()) call read_drive(place, node, scene%joint(actuator%joint)%kind, actuator, shelf, status)
        node = place%node%get("drive")
        if (status%is_ok() .and. node%is_present()) call read_motor_drive(place, node, scene%joint(actuator%joint)%kind, &
            actuator%unit /= "N", shelf, actuator, status)
        if (status%is_ok() .and. is_at_motor(actuator%law%side) .and. .not. node%is_present()) call refuse_missing(place, &
            "drive", "the motor that the law is about: { ratio = 50, .. }", status)
        if (node%is_present()) call refuse_idle_creep(place, node, actuator, status)
        node = place%node%get("cylinder")
        if (status%is_ok() .and. node%is_present()) call read_cylinder(place, node, actuator, status)
        if (status%is_ok() .and. actuator%law%side == side_opening .and. .not. node%is_present()) call refuse_missing(place, &
            "cylinder", "the cylinder that the valve feeds: { bore = '80 mm', .. }", status)
    end subroutine read_actuator

    !> Drives share the work where there are more of them than coordinates.
    subroutine refuse_unshared(place, scene, status)
        type(scene_place), intent(in) :: place
        type(scene_type), intent(in) :: scene
        type(status_type), intent(inout) :: status

        if (status%is_ok() .and. size(scene%actuator) <= size(scene%coordinate)) call refuse_value(place, "share", &
            place%node%get("share"), "is for drives that share their work, and "//counted(size(scene%actuator), "actuator")// &
            " for "//counted(size(scene%coordinate), "coordinate")//" leave nothing to share (expected more drives, or no "// &
            "'share')", status)
    end subroutine refuse_unshared

    !> Below the creep speed goes to zero what a transmission loses of a law's torque at the motor.
    subroutine refuse_idle_creep(place, drive, actuator, status)
        type(scene_place), intent(in) :: place
        type(toml_node), intent(in) :: drive
        type(actuator_spec), intent(in) :: actuator
        type(status_type), intent(inout) :: status
        type(toml_node) :: creep

        creep = drive%get("creep_speed")
        if (.not. (creep%is_present() .and. actuator%has_law) .or. is_at_motor(actuator%law%side)) return
        if (status%is_ok()) call refuse_value(place, "creep_speed", creep, "is for laws at the motor, and this law gives what "// &
            "acts at the joint (expected at = ""motor"" in the law, or no 'creep_speed')", status)
    end subroutine refuse_idle_creep

    !> Read the own name of an actuator: of several at one joint variable each but one has a name of its own: "crank:brake".
    subroutine read_own_name(place, actuator, status)
        type(scene_place), intent(in) :: place
        type(actuator_spec), intent(inout) :: actuator
        type(status_type), intent(inout) :: status
        character(len=name_len) :: own
        logical :: found

        if (.not. status%is_ok()) return
        call get_name(place, "name", own, status, found)
        if (.not. (status%is_ok() .and. found)) return
        if (len_trim(actuator%name) + 1 + len_trim(own) > name_len) then
            call refuse_value(place, "name", place%node%get("name"), "makes "//quoted(trim(actuator%name)//":"//trim(own)) &
                //", which is too long (expected a shorter one)", status)
        else if (index(own, ":") > 0) then
            call refuse_value(place, "name", place%node%get("name"), "holds a colon (expected letters, digits, signs but ':')", &
                status)
        else
            actuator%name = trim(actuator%name)//":"//own
        end if
    end subroutine read_own_name

    !> Currents and margins are told of all motors or of none.
    subroutine compare_motors(place, scene, i, status)
        type(scene_place), intent(in) :: place
        type(scene_type), intent(in) :: scene
        integer, intent(in) :: i                       !! the actuator read last
        type(status_type), intent(inout) :: status
        integer :: k

        if (.not. scene%actuator(i)%motor%is_given) return
        k = findloc(scene%actuator(:i - 1)%motor%is_given, .true., dim=1)
        if (k == 0) return
        if ((scene%actuator(i)%motor%torque_constant > 0) .neqv. (scene%actuator(k)%motor%torque_constant > 0)) then
            call refuse(place, "of its drive and that of actuator "//quoted(scene%actuator(k)%name)// &
                " only one has a 'torque_constant' (expected all drives with one, or none)", status, scene%actuator(i)%motor%line)
        else if (has_limits(scene%actuator(i)%motor) .neqv. has_limits(scene%actuator(k)%motor)) then
            call refuse(place, "of its drive and that of actuator "//quoted(scene%actuator(k)%name)// &
                " only one has limits (expected all drives with one of 'torque_limit', 'current_limit', 'torque_curve', or "// &
                "none)", status, scene%actuator(i)%motor%line)
        end if
    end subroutine compare_motors

    !> Name and unit of an actuator follow from its joint variable.
    pure subroutine name_actuator(scene, actuator)
        type(scene_type), intent(in) :: scene
        type(actuator_spec), intent(inout) :: actuator
        type(quantity_type) :: quantity

        actuator%name = joint_variable_name(scene, actuator%joint, actuator%variable)
        quantity = force_quantity(scene%joint(actuator%joint)%kind, actuator%variable)
        actuator%unit = quantity%unit(:4)
    end subroutine name_actuator

    !> What the actuator does in forward dynamics.
    subroutine read_drive(place, node, joint_kind, actuator, shelf, status)
        type(scene_place), intent(in) :: place
        type(toml_node), intent(in) :: node
        integer, intent(in) :: joint_kind
        type(actuator_spec), intent(inout) :: actuator
        type(table_shelf), intent(inout) :: shelf
        type(status_type), intent(inout) :: status
        type(scene_place) :: inner
        type(quantity_type) :: position, effort
        logical :: is_angle, found

        inner = place_at(place, node, trim(place%what)//", law")
        call require_table(inner, "a table, { type = .. }", status)
        call get_word(inner, "type", effort_law_name, actuator%law%kind, status)
        if (.not. status%is_ok()) return
        position = variable_quantity(joint_kind, actuator%variable)
        effort = force_quantity(joint_kind, actuator%variable)
        is_angle = position%unit == "rad"
        associate (drive => actuator%law)
            call read_side(inner, drive, effort, status)
            select case (drive%kind)
            case (effort_inverse)
                call allow_keys(inner, [character(len=4) :: "type"], status)
            case (effort_constant)
                call allow_keys(inner, [character(len=5) :: "type", "value", "at"], status)
                call get_quantity(inner, "value", effort, drive%value(at_force), status)
            case (effort_table)
                call read_driving_table(place, node, inner, effort, actuator%name, shelf, drive, status)
            case (effort_over)
                call allow_keys(inner, [character(len=5) :: "type", "value", "at"], status)
                call read_driving_formula(inner, effort, shelf, drive, status)
            case (effort_voltage)
                call allow_keys(inner, [character(len=5) :: "type", "value"], status)
                drive%kind = effort_over
                drive%side = side_voltage
                call read_driving_formula(inner, voltage, shelf, drive, status)
            case (effort_valve)
                call allow_keys(inner, [character(len=5) :: "type", "value"], status)
                drive%kind = effort_over
                drive%side = side_opening
                call read_driving_formula(inner, valve_opening, shelf, drive, status)
            case (effort_spring_damper)
                call allow_keys(inner, [character(len=9) :: "type", "stiffness", "damping", "rest"], status)
                call read_stiffness(inner, is_angle, drive%value(at_stiffness:at_damping), status)
                call get_quantity(inner, "rest", position, drive%value(at_rest), status, found)
                call refuse_rest_of_none(inner, status)
            case (effort_dc_motor)
                call allow_keys(inner, [character(len=6) :: "type", "n", "eta", "K_T", "K_E", "K_P", "R_a", "target"], status)
                call read_motor(inner, is_angle, drive%value, status)
                call read_target(inner, position, actuator%name, shelf, drive%target, status)
            case (effort_pd)
                call allow_keys(inner, [character(len=9) :: "type", "stiffness", "damping", "target"], status)
                call read_stiffness(inner, is_angle, drive%value(at_stiffness:at_damping), status)
                call read_target(inner, position, actuator%name, shelf, drive%target, status)
            end select
        end associate
    end subroutine read_drive

    !> Does the law give the driving force, or the torque of the motor?
    subroutine read_side(place, drive, effort, status)
        type(scene_place), intent(in) :: place         !! of the law
        type(effort_law), intent(inout) :: drive
        type(quantity_type), intent(inout) :: effort   !! what the law gives
        type(status_type), intent(inout) :: status
        integer :: choice
        logical :: found

        if (.not. any(drive%kind == [effort_constant, effort_table, effort_over])) return
        choice = 1
        call get_word(place, "at", [character(len=5) :: "joint", "motor"], choice, status, found)
        if (choice == 1) return
        drive%side = side_torque
        effort = moment
    end subroutine read_side

    !> A driving force from a table over time, or over the state.
    subroutine read_driving_table(place, node, inner, effort, usual_column, shelf, drive, status)
        type(scene_place), intent(in) :: place         !! of the actuator
        type(toml_node), intent(in) :: node            !! the law
        type(scene_place), intent(in) :: inner         !! its place
        type(quantity_type), intent(in) :: effort
        character(len=*), intent(in) :: usual_column
        type(table_shelf), intent(inout) :: shelf
        type(effort_law), intent(inout) :: drive
        type(status_type), intent(inout) :: status
        type(toml_node) :: over

        over = node%get("over")
        if (over%is_present()) then
            drive%kind = effort_over
            call allow_keys(inner, [character(len=13) :: "type", "table", "column", "over", "argument", "interpolation", &
                "period", "at"], status)
            call read_force_law(place, "law", node, effort, usual_column, shelf, drive%target, status)
        else
            call allow_keys(inner, [character(len=13) :: "type", "table", "column", "time", "interpolation", "at"], status)
            call read_force_table(inner, effort, usual_column, shelf, drive%target, status)
        end if
    end subroutine read_driving_table

    !> A driving force by a formula; one that nothing varies in is constant.
    subroutine read_driving_formula(place, effort, shelf, drive, status)
        type(scene_place), intent(in) :: place
        type(quantity_type), intent(in) :: effort
        type(table_shelf), intent(inout) :: shelf
        type(effort_law), intent(inout) :: drive
        type(status_type), intent(inout) :: status
        type(toml_node) :: node

        if (.not. status%is_ok()) return
        node = place%node%get("value")
        if (.not. node%is_present()) call refuse_missing(place, "value", trim(effort%name)//" or a formula of measures and laws", &
            status)
        if (.not. status%is_ok()) return
        call read_force_law(place, "value", node, effort, "", shelf, drive%target, status)
        if (.not. status%is_ok() .or. drive%target%kind == law_over) return
        if (drive%target%kind == law_constant) then
            drive%kind = effort_constant
            drive%value(at_force) = drive%target%value(1)
        else
            drive%kind = effort_table
        end if
    end subroutine read_driving_formula

    !> Driving force from a column of a table.
    subroutine read_force_table(place, effort, usual_column, shelf, law, status)
        type(scene_place), intent(in) :: place
        type(quantity_type), intent(in) :: effort
        character(len=*), intent(in) :: usual_column   !! if the file names none
        type(table_shelf), intent(inout) :: shelf
        type(law_spec), intent(out) :: law
        type(status_type), intent(inout) :: status
        type(table_reading) :: reading
        character(len=:), allocatable :: column
        logical :: found

        call read_table_keys(place, straight_lines, shelf, reading, status)
        call get_text(place, "column", column, status, found)
        if (.not. found) column = trim(usual_column)
        call law_of_column(shelf, reading, column, effort, law, status)
    end subroutine read_force_table

    !> Constants of a DC motor with reducer; a motor without resistance or torque constant is none.
    subroutine read_motor(place, is_angle, value, status)
        type(scene_place), intent(in) :: place
        logical, intent(in) :: is_angle                !! the joint turns
        real(wp), intent(inout) :: value(:)            !! at the places of a dc-motor's numbers
        type(status_type), intent(inout) :: status
        type(quantity_type) :: ratio, gain

        ratio = plain_number
        gain = volt_per_angle
        if (.not. is_angle) then
            ratio = quantity_type("a ratio in radians per metre", "3000 rad/m", "rad/m", [0, -1, 0, 0, 1])
            gain = volt_per_length
        end if
        call get_quantity(place, "n", ratio, value(at_ratio), status)
        call get_quantity(place, "eta", plain_number, value(at_efficiency), status)
        call get_quantity(place, "K_T", torque_per_current, value(at_torque_constant), status)
        call get_quantity(place, "K_E", volt_second, value(at_voltage_constant), status)
        call get_quantity(place, "K_P", gain, value(at_gain), status)
        call get_quantity(place, "R_a", resistance, value(at_resistance), status)
        call require_positive(place, "n", value(at_ratio), "", status)
        call require_positive(place, "eta", value(at_efficiency), "", status)
        if (status%is_ok() .and. value(at_efficiency) > 1) call refuse_value(place, "eta", place%node%get("eta"), &
            "= "//to_text(value(at_efficiency))//" (expected an efficiency of at most 1)", status)
        call require_positive(place, "K_T", value(at_torque_constant), "N m/A", status)
        call require_positive(place, "R_a", value(at_resistance), "ohm", status)
    end subroutine read_motor

    !> stiffness and damping, each zero if left out, but not both unless there is another force, of the key `force`.
    subroutine read_stiffness(place, is_angle, value, status, has_other)
        type(scene_place), intent(in) :: place
        logical, intent(in) :: is_angle
        real(wp), intent(inout) :: value(2)
        type(status_type), intent(inout) :: status
        logical, intent(in), optional :: has_other     !! absent: there can be none
        logical :: has_stiffness, has_damping

        if (is_angle) then
            call get_quantity(place, "stiffness", angular_stiffness, value(1), status, has_stiffness)
            call get_quantity(place, "damping", angular_damping, value(2), status, has_damping)
        else
            call get_quantity(place, "stiffness", stiffness, value(1), status, has_stiffness)
            call get_quantity(place, "damping", damping, value(2), status, has_damping)
        end if
        if (.not. status%is_ok() .or. has_stiffness .or. has_damping) return
        if (.not. present(has_other)) then
            call refuse(place, "missing key 'stiffness' or 'damping' (expected at least one)", status)
        else if (.not. has_other) then
            call refuse(place, "missing key 'stiffness', 'damping' or 'force' (expected at least one)", status)
        end if
    end subroutine read_stiffness

    !> The wanted position: a number or any law.
    subroutine read_target(place, position, usual_column, shelf, law, status)
        type(scene_place), intent(in) :: place
        type(quantity_type), intent(in) :: position
        character(len=*), intent(in) :: usual_column
        type(table_shelf), intent(inout) :: shelf
        type(law_spec), intent(inout) :: law
        type(status_type), intent(inout) :: status
        type(toml_node) :: node

        if (.not. status%is_ok()) return
        node = place%node%get("target")
        if (node%is_present()) then
            call read_law(place, "target", node, position, 0.0_wp, usual_column, spline, shelf, law, status)
        else
            call refuse_missing(place, "target", "the wanted position: "//trim(position%name)//" or a law", status)
        end if
    end subroutine read_target

    !> The tables [[load]].
    subroutine read_loads(root, shelf, scene, status)
        type(scene_place), intent(in) :: root
        type(table_shelf), intent(inout) :: shelf
        type(scene_type), intent(inout) :: scene
        type(status_type), intent(inout) :: status
        type(repeated_tables) :: tables
        type(scene_place) :: place
        integer :: i, n

        call list_repeated(root, "load", scene%planar, .false., tables, status)
        if (.not. status%is_ok()) return
        n = size(tables%table)
        allocate (scene%load(n))
        do i = 1, n
            place = repeated_at(root, tables, i, "load")
            call read_load(place, shelf, scene, scene%load(i), status)
            if (.not. status%is_ok()) return
        end do
    end subroutine read_loads

    subroutine read_load(place, shelf, scene, load, status)
        type(scene_place), intent(inout) :: place
        type(table_shelf), intent(inout) :: shelf
        type(scene_type), intent(in) :: scene
        type(load_spec), intent(inout) :: load
        type(status_type), intent(inout) :: status
        type(toml_node) :: node, table
        character(len=:), allocatable :: text
        logical :: found

        load%line = place%line
        call get_text(place, "on", text, status)
        if (.not. status%is_ok()) return
        load%name = text
        place%what = "load on "//quoted(load%name)
        call allow_keys(place, [character(len=13) :: "on", "force", "moment", "axes", "table", "time", &
            "interpolation"], status)
        call find_marker(scene, place, "on", place%node%get("on"), load%link, load%marker, status)
        if (status%is_ok() .and. load%link == frame_link) call refuse_value(place, "on", place%node%get("on"), &
            "= "//quoted(text)//": a load on the frame moves nothing (expected a marker of a moving link)", status)
        load%axes = axes_world
        call get_word(place, "axes", [character(len=5) :: "world", "link"], load%axes, status, found)
        if (.not. status%is_ok()) return
        load%force = constant_law(0.0_wp)
        load%moment = constant_law(0.0_wp)
        table = place%node%get("table")
        node = place%node%get("force")
        found = node%is_present()
        node = place%node%get("moment")
        found = found .or. node%is_present()
        if (table%is_present() .and. found) then
            call refuse(place, "has a table and 'force' or 'moment' (expected one or the other)", status)
        else if (table%is_present()) then
            call read_load_table(place, scene%planar, shelf, load, status)
        else if (.not. found) then
            call refuse(place, "missing key 'force' (expected 'force', 'moment' or 'table')", status)
        else
            call allow_keys(place, [character(len=6) :: "on", "force", "moment", "axes"], status)
            call read_components(place, "force", scene%planar, force, shelf, load%force, status)
            call read_components(place, "moment", scene%planar, moment, shelf, load%moment, status)
        end if
    end subroutine read_load

    !> Components of a force or moment, each a number, a text with unit or a law.
    subroutine read_components(place, key, planar, quantity, shelf, law, status)
        type(scene_place), intent(in) :: place
        character(len=*), intent(in) :: key            !! force or moment
        logical, intent(in) :: planar
        type(quantity_type), intent(in) :: quantity
        type(table_shelf), intent(inout) :: shelf
        type(law_spec), intent(inout) :: law(3)        !! left alone if the key is not there
        type(status_type), intent(inout) :: status
        character(len=*), parameter :: axis_name(3) = ["x", "y", "z"]
        type(scene_place) :: inner
        type(toml_node) :: node, item
        integer :: i, n

        if (.not. status%is_ok()) return
        node = place%node%get(key)
        if (.not. node%is_present()) return
        if (planar .and. key == "moment" .and. node%kind() /= toml_array) then
            call read_force_law(place, key, node, quantity, "", shelf, law(3), status)
            return
        end if
        n = merge(2, 3, planar)
        if (planar .and. key == "moment") n = 1
        select case (node%kind())
        case (toml_array)
            if (node%count() /= n) then
                call refuse_value(place, key, node, "has "//counted(node%count(), "element")//" (expected "//to_text(n)// &
                    ", each "//trim(quantity%name)//" or a law)", status)
                return
            end if
            do i = 1, n
                call read_force_law(place, key, node%at(i), quantity, "", shelf, law(merge(3, i, n == 1)), status)
            end do
        case (toml_table)
            inner = place_at(place, node, trim(place%what)//", "//key)
            call allow_keys(inner, axis_name(:n), status)
            do i = 1, n
                item = node%get(axis_name(i))
                if (item%is_present()) call read_force_law(inner, axis_name(i), item, quantity, "", shelf, &
                    law(i), status)
            end do
        case default
            call refuse_value(place, key, node, "is "//node%kind_text()//" (expected a list of "//to_text(n)// &
                ", each "//trim(quantity%name)//" or a law)", status)
        end select
    end subroutine read_components

    !> Columns Fx Fy Fz Mx My Mz of a table; those that it lacks are zero.
    subroutine read_load_table(place, planar, shelf, load, status)
        type(scene_place), intent(in) :: place
        logical, intent(in) :: planar
        type(table_shelf), intent(inout) :: shelf
        type(load_spec), intent(inout) :: load
        type(status_type), intent(inout) :: status
        character(len=*), parameter :: force_name(3) = ["Fx", "Fy", "Fz"], moment_name(3) = ["Mx", "My", "Mz"]
        type(table_reading) :: reading
        logical :: has_force(3), has_moment(3)
        integer :: i

        call read_table_keys(place, straight_lines, shelf, reading, status)
        if (.not. status%is_ok()) return
        do i = 1, 3
            has_force(i) = has_column(shelf, reading, force_name(i))
            has_moment(i) = has_column(shelf, reading, moment_name(i))
        end do
        if (planar .and. (has_force(3) .or. any(has_moment(:2)))) then
            call refuse(place, "the table has a column Fz, Mx or My, which planar scenes do not have (expected Fx Fy Mz)", status)
        else if (.not. any(has_force .or. has_moment)) then
            call refuse(place, "the table has no column of a load (expected some of Fx Fy Fz Mx My Mz)", status)
        end if
        do i = 1, 3
            if (has_force(i)) call law_of_column(shelf, reading, force_name(i), force, load%force(i), status)
            if (has_moment(i)) call law_of_column(shelf, reading, moment_name(i), moment, load%moment(i), status)
        end do
    end subroutine read_load_table

    !> The tables [[spring]]: springs and dampers that nothing drives.
    subroutine read_springs(root, shelf, scene, status)
        type(scene_place), intent(in) :: root
        type(table_shelf), intent(inout) :: shelf
        type(scene_type), intent(inout) :: scene
        type(status_type), intent(inout) :: status
        type(repeated_tables) :: tables
        type(scene_place) :: place
        integer :: i, n

        call list_repeated(root, "spring", scene%planar, .false., tables, status)
        if (.not. status%is_ok()) return
        n = size(tables%table)
        allocate (scene%spring(n))
        do i = 1, n
            place = repeated_at(root, tables, i, "spring")
            call read_spring(place, i, shelf, scene, scene%spring(i), status)
            if (.not. status%is_ok()) return
        end do
    end subroutine read_springs

    subroutine read_spring(place, number, shelf, scene, spring, status)
        type(scene_place), intent(inout) :: place
        integer, intent(in) :: number
        type(table_shelf), intent(inout) :: shelf
        type(scene_type), intent(in) :: scene
        type(spring_spec), intent(inout) :: spring
        type(status_type), intent(inout) :: status
        character(len=*), parameter :: expected = "two markers, [""link1.marker"", ""link2.marker""]"
        type(toml_node) :: joint, between, node
        type(quantity_type) :: position, effort
        real(wp) :: value(2)
        logical :: found
        integer :: i

        spring%line = place%line
        call get_name(place, "name", spring%name, status)
        if (.not. status%is_ok()) return
        place%what = "spring "//quoted(spring%name)
        call allow_keys(place, [character(len=9) :: "name", "joint", "variable", "between", "stiffness", "damping", &
            "rest", "force"], status)
        joint = place%node%get("joint")
        between = place%node%get("between")
        position = length
        if (joint%is_present() .eqv. between%is_present()) then
            call refuse(place, "needs either 'joint' or 'between' (expected one of them)", status)
        else if (joint%is_present()) then
            call find_joint(scene, place, spring%joint, status)
            if (.not. status%is_ok()) return
            call find_variable(scene, place, spring%joint, spring%variable, status)
            position = variable_quantity(scene%joint(spring%joint)%kind, spring%variable)
        else if (between%kind() /= toml_array .or. between%count() /= 2) then
            call refuse_value(place, "between", between, "is not a pair (expected "//expected//")", status)
        else
            do i = 1, 2
                call find_marker(scene, place, "between", between%at(i), spring%link(i), spring%marker(i), status)
            end do
            call require_two_links(place, "between", between, scene, spring%link, status)
        end if
        value = 0
        node = place%node%get("force")
        call read_stiffness(place, position%unit == "rad", value, status, node%is_present())
        spring%stiffness = value(1)
        spring%damping = value(2)
        call get_quantity(place, "rest", position, spring%rest, status, found)
        if (.not. node%is_present()) call refuse_rest_of_none(place, status)
        effort = force
        if (position%unit == "rad") effort = moment
        if (node%is_present()) call read_spring_law(place, node, position, effort, number, shelf, spring%force, status)
    end subroutine read_spring

    !> A damper has no place where it rests.
    subroutine refuse_rest_of_none(place, status)
        type(scene_place), intent(in) :: place
        type(status_type), intent(inout) :: status
        type(toml_node) :: rest, stiffness

        if (.not. status%is_ok()) return
        rest = place%node%get("rest")
        stiffness = place%node%get("stiffness")
        if (rest%is_present() .and. .not. stiffness%is_present()) call refuse_value(place, "rest", rest, &
            "has no meaning without 'stiffness': a damper has no rest position (expected 'stiffness' beside it)", status)
    end subroutine refuse_rest_of_none

    !> Force at a slide, moment at an angle.
    pure type(quantity_type) function force_quantity(joint_kind, variable) result(quantity)
        integer, intent(in) :: joint_kind, variable
        type(quantity_type) :: position

        position = variable_quantity(joint_kind, variable)
        quantity = force
        if (position%unit == "rad") quantity = moment
    end function force_quantity

    subroutine refuse_doubles(root, actuator, status)
        type(scene_place), intent(in) :: root
        type(actuator_spec), intent(in) :: actuator(:)
        type(status_type), intent(inout) :: status
        type(scene_place) :: place
        integer :: i, j, first, second

        do i = 2, size(actuator)
            do j = 1, i - 1
                if (actuator(i)%name /= actuator(j)%name) cycle
                place = root
                first = min(actuator(i)%line, actuator(j)%line)
                second = max(actuator(i)%line, actuator(j)%line)
                place%what = "actuator "//quoted(actuator(i)%name)
                call refuse(place, "this joint variable is already driven on "// &
                    line_text(place, first, second)//" (expected a 'name' of its own for one of both)", status, second)
                return
            end do
        end do
    end subroutine refuse_doubles
end module linkdyn_scene_forces
