!> The key `drive` of an actuator: a motor and its gear or screw.
module linkdyn_scene_motors
    use linkdyn_constants, only: two_pi
    use linkdyn_joint_table, only: has_one_axis
    use linkdyn_kinds, only: wp
    use linkdyn_scene, only: scene_type, actuator_spec, motor_spec, joint_kind_name, effort_dc_motor, side_joint, side_voltage, &
        at_ratio, at_efficiency
    use linkdyn_scene_brakes, only: read_brake
    use linkdyn_scene_keys, only: scene_place, place_at, refuse, refuse_value, refuse_missing, allow_keys, get_quantity, &
        require_table
    use linkdyn_scene_laws, only: table_shelf, require_positive
    use linkdyn_scene_motor_limits, only: read_motor_limits, read_positive
    use linkdyn_status, only: status_type
    use linkdyn_text, only: to_text, quoted
    use linkdyn_toml, only: toml_node
    use linkdyn_units, only: quantity_type, plain_number, length, inertia, torque_per_current, angular_rate, resistance, &
        inductance
    implicit none (type, external)
    private
    public :: read_motor_drive, check_laws_at_motors

    integer, parameter :: key_len = 15

contains

    !> Motor and transmission.
    subroutine read_motor_drive(place, node, joint_kind, is_angle, shelf, actuator, status)
        type(scene_place), intent(in) :: place         !! of the actuator
        type(toml_node), intent(in) :: node            !! the value of `drive`
        integer, intent(in) :: joint_kind
        logical, intent(in) :: is_angle                !! the driven variable turns
        type(table_shelf), intent(inout) :: shelf
        type(actuator_spec), intent(inout) :: actuator
        type(status_type), intent(inout) :: status
        type(scene_place) :: inner
        type(toml_node) :: brake
        logical :: has_lead, has_back

        inner = place_at(place, node, trim(place%what)//", drive")
        call require_table(inner, "a table, { ratio = .. }", status)
        call allow_keys(inner, [character(len=key_len) :: "ratio", "lead", "rotor_inertia", "screw_inertia", "efficiency", &
            "back_efficiency", "torque_constant", "resistance", "inductance", "creep_speed", "torque_limit", "power_limit", &
            "current_limit", "torque_curve", "brake"], status)
        associate (motor => actuator%motor)
            motor%is_given = .true.
            motor%line = inner%line
            call read_ratio(inner, is_angle, motor%ratio, has_lead, status)
            call read_inertia(inner, joint_kind, has_lead, motor%inertia, status)
            call read_efficiencies(inner, has_lead, motor, has_back, status)
            call read_positive(inner, "torque_constant", torque_per_current, "N m/A", motor%torque_constant, status)
            call read_positive(inner, "resistance", resistance, "ohm", motor%resistance, status)
            call read_positive(inner, "inductance", inductance, "H", motor%inductance, status)
            call read_positive(inner, "creep_speed", angular_rate, "rad/s", motor%creep_speed, status)
            call read_motor_limits(inner, shelf, motor, status)
            brake = inner%node%get("brake")
            if (status%is_ok() .and. brake%is_present()) call read_brake(inner, brake, motor%brake, status)
            if (status%is_ok() .and. motor%inductance > 0 .and. .not. (motor%torque_constant > 0 .and. motor%resistance > 0)) &
                call refuse_value(inner, "inductance", inner%node%get("inductance"), "has no meaning without 'torque_constant' "// &
                    "and 'resistance' beside it", status)
            if (.not. status%is_ok()) return
            if (actuator%law%kind == effort_dc_motor) call compare_with_law(inner, actuator, has_back, status)
        end associate
    end subroutine read_motor_drive

    !> Motors and what is said at them, once controllers are known.
    subroutine check_laws_at_motors(root, scene, status)
        type(scene_place), intent(in) :: root
        type(scene_type), intent(in) :: scene
        type(status_type), intent(inout) :: status
        type(scene_place) :: place
        integer :: i

        do i = 1, size(scene%actuator)
            associate (actuator => scene%actuator(i), motor => scene%actuator(i)%motor)
                if (.not. (status%is_ok() .and. motor%is_given)) cycle
                place = root
                place%what = "actuator "//quoted(actuator%name)//", drive"
                place%line = motor%line
                if (actuator%law%side /= side_joint) call require_for_law(place, actuator, status)
                if (motor%resistance > 0 .and. .not. motor%torque_constant > 0) call refuse(place, "key 'resistance' has no "// &
                    "meaning without 'torque_constant' beside it", status)
                if (actuator%law%side == side_joint .and. motor%brake%is_given) call refuse(place, "key 'brake' "// &
                    "acts on the shaft of the motor in forward dynamics (expected a law at the motor beside it: "// &
                    "law = { .., at = ""motor"" }, or a controller there)", status, motor%brake%line)
            end associate
        end do
    end subroutine check_laws_at_motors

    !> What laws at the motor take for granted.
    subroutine require_for_law(place, actuator, status)
        type(scene_place), intent(in) :: place
        type(actuator_spec), intent(in) :: actuator
        type(status_type), intent(inout) :: status

        associate (motor => actuator%motor)
            if (actuator%law%side == side_voltage .and. .not. motor%torque_constant > 0) then
                call refuse_missing(place, "torque_constant", "that of the motor whose voltage the law gives, for example "// &
                    "'0.08 N m/A'", status)
            else if (actuator%law%side == side_voltage .and. .not. motor%resistance > 0) then
                call refuse_missing(place, "resistance", "that of the motor whose voltage the law gives, for example "// &
                    "'0.5 ohm'", status)
            else if (.not. (motor%back_efficiency > 0 .or. motor%inertia > 0)) then
                call refuse(place, "it locks itself and has no inertia, so that nothing says how it comes to rest under a law "// &
                    "at the motor (expected 'rotor_inertia', or a 'back_efficiency' above zero)", status)
            end if
        end associate
    end subroutine require_for_law

    !> Motor angle over joint variable.
    subroutine read_ratio(place, is_angle, ratio, has_lead, status)
        type(scene_place), intent(in) :: place
        logical, intent(in) :: is_angle
        real(wp), intent(out) :: ratio                 !! [1, rad/m]
        logical, intent(out) :: has_lead
        type(status_type), intent(inout) :: status
        type(quantity_type) :: unit
        type(toml_node) :: of_ratio, of_lead
        character(len=:), allocatable :: key
        logical :: found

        ratio = 0
        of_ratio = place%node%get("ratio")
        of_lead = place%node%get("lead")
        has_lead = of_lead%is_present()
        if (.not. status%is_ok()) return
        if (has_lead .and. is_angle) then
            call refuse_value(place, "lead", of_lead, "has no meaning here: the driven variable turns "// &
                "(expected 'ratio', motor angle over joint angle)", status)
        else if (has_lead .and. of_ratio%is_present()) then
            call refuse_value(place, "lead", of_lead, "stands beside 'ratio' (expected one of them)", status)
        else if (.not. (has_lead .or. of_ratio%is_present()) .and. is_angle) then
            call refuse_missing(place, "ratio", "motor angle over joint angle, for example 50", status)
        else if (.not. (has_lead .or. of_ratio%is_present())) then
            call refuse(place, "missing key 'lead' or 'ratio' (expected the way of the slide in a turn of the motor, "// &
                "for example '5 mm', or motor angle over way, for example '1200 rad/m')", status)
        end if
        if (.not. status%is_ok()) return
        unit = plain_number
        if (.not. is_angle) unit = quantity_type("a ratio in radians per metre", "1200 rad/m", "rad/m", [0, -1, 0, 0, 1])
        key = "ratio"
        if (has_lead) then
            key = "lead"
            unit = length
        end if
        call get_quantity(place, key, unit, ratio, status, found)
        if (status%is_ok() .and. .not. abs(ratio) > 0) call refuse_value(place, key, place%node%get(key), &
            "= 0 (expected another number; below zero, the motor turns the other way)", status)
        if (status%is_ok() .and. has_lead) ratio = two_pi/ratio
    end subroutine read_ratio

    !> Read the inertia of all that turns with the motor.
    subroutine read_inertia(place, joint_kind, has_lead, total, status)
        type(scene_place), intent(in) :: place
        integer, intent(in) :: joint_kind
        logical, intent(in) :: has_lead
        real(wp), intent(out) :: total                 !! [kg m2]
        type(status_type), intent(inout) :: status
        type(toml_node) :: node
        real(wp) :: of_screw
        logical :: found

        total = 0
        of_screw = 0
        call get_quantity(place, "rotor_inertia", inertia, total, status, found)
        call refuse_negative("rotor_inertia", total)
        node = place%node%get("screw_inertia")
        if (status%is_ok() .and. node%is_present() .and. .not. has_lead) call refuse_value(place, "screw_inertia", node, &
            "has no meaning here: there is no screw (expected 'lead' beside it, or 'rotor_inertia')", status)
        call get_quantity(place, "screw_inertia", inertia, of_screw, status, found)
        call refuse_negative("screw_inertia", of_screw)
        total = total + of_screw
        if (.not. status%is_ok() .or. .not. total > 0) return
        if (has_one_axis(joint_kind)) return
        node = place%node%get("rotor_inertia")
        call refuse_value(place, "rotor_inertia", node, "is not known at a "//trim(joint_kind_name(joint_kind))// &
            " joint (expected one with a single axis: revolute, prismatic, cylindrical, screw)", status)

    contains

        subroutine refuse_negative(key, found)
            character(len=*), intent(in) :: key
            real(wp), intent(in) :: found

            if (status%is_ok() .and. found < 0) call refuse_value(place, key, place%node%get(key), "= "//to_text(found)// &
                " kg m2 (expected zero or more)", status)
        end subroutine refuse_negative
    end subroutine read_inertia

    !> Both ways. Without a word a gear has the same efficiency either way, a screw 2 - 1/efficiency: that of the same friction.
    subroutine read_efficiencies(place, has_lead, motor, has_back, status)
        type(scene_place), intent(in) :: place
        logical, intent(in) :: has_lead
        type(motor_spec), intent(inout) :: motor
        logical, intent(out) :: has_back
        type(status_type), intent(inout) :: status
        logical :: found

        call get_quantity(place, "efficiency", plain_number, motor%efficiency, status, found)
        call require_positive(place, "efficiency", motor%efficiency, "", status)
        call refuse_above_one("efficiency", motor%efficiency)
        if (.not. status%is_ok()) return
        motor%back_efficiency = motor%efficiency
        if (has_lead) motor%back_efficiency = 2 - 1/motor%efficiency
        call get_quantity(place, "back_efficiency", plain_number, motor%back_efficiency, status, has_back)
        call refuse_above_one("back_efficiency", motor%back_efficiency)

    contains

        subroutine refuse_above_one(key, efficiency)
            character(len=*), intent(in) :: key
            real(wp), intent(in) :: efficiency

            if (status%is_ok() .and. efficiency > 1) call refuse_value(place, key, place%node%get(key), "= "// &
                to_text(efficiency)//" (expected an efficiency of at most 1)", status)
        end subroutine refuse_above_one
    end subroutine read_efficiencies

    !> A law `dc-motor` knows of a gear, too: both are one, and it loses nothing that the other does not know of.
    subroutine compare_with_law(place, actuator, has_back, status)
        type(scene_place), intent(in) :: place
        type(actuator_spec), intent(in) :: actuator
        logical, intent(in) :: has_back
        type(status_type), intent(inout) :: status
        real(wp), parameter :: close = 1.0e-12_wp

        associate (law => actuator%law%value, motor => actuator%motor)
            if (abs(law(at_ratio) - motor%ratio) > close*abs(law(at_ratio))) then
                call refuse(place, "its ratio "//to_text(motor%ratio)//" is not n = "//to_text(law(at_ratio))// &
                    " of the law dc-motor (expected the same)", status)
            else if (law(at_efficiency) < 1 .or. motor%efficiency < 1 .or. has_back) then
                call refuse(place, "the law dc-motor beside it is of a gear without losses (expected eta = 1 there, "// &
                    "and no efficiency here)", status)
            end if
        end associate
    end subroutine compare_with_law
end module linkdyn_scene_motors
