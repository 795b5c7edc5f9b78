!> What bounds the torque of a motor: keys of `drive`.
module linkdyn_scene_motor_limits
    use linkdyn_kinds, only: wp
    use linkdyn_scene, only: motor_spec, law_spec, law_table
    use linkdyn_scene_keys, only: scene_place, place_at, refuse, refuse_value, refuse_missing, allow_keys, counted, &
        get_quantity, get_text, list_of, require_table
    use linkdyn_scene_laws, only: table_shelf, table_reading, read_table_keys, column_in_si, table_law, straight_lines, &
        require_positive
    use linkdyn_status, only: status_type
    use linkdyn_text, only: to_text
    use linkdyn_toml, only: toml_node
    use linkdyn_units, only: quantity_type, moment, wattage, current, angular_rate
    implicit none (type, external)
    private
    public :: read_motor_limits, read_positive

contains

    !> The largest torque, power and current, and the torque over the speed. The torque constant has been read.
    subroutine read_motor_limits(place, shelf, motor, status)
        type(scene_place), intent(in) :: place         !! of the drive
        type(table_shelf), intent(inout) :: shelf
        type(motor_spec), intent(inout) :: motor
        type(status_type), intent(inout) :: status
        type(toml_node) :: node

        call read_positive(place, "torque_limit", moment, "N m", motor%largest_torque, status)
        call read_positive(place, "power_limit", wattage, "W", motor%largest_power, status)
        call read_positive(place, "current_limit", current, "A", motor%largest_current, status)
        node = place%node%get("torque_curve")
        if (status%is_ok() .and. node%is_present()) call read_curve(place_at(place, node, trim(place%what)//", torque_curve"), &
            shelf, motor%torque_curve, status)
        if (.not. status%is_ok()) return
        if (motor%largest_current > 0 .and. .not. motor%torque_constant > 0) then
            call refuse_missing(place, "torque_constant", "that of the motor whose current is limited, for example "// &
                "'0.08 N m/A'", status)
        else if (motor%largest_power > 0 .and. .not. (motor%largest_torque > 0 .or. motor%largest_current > 0 .or. &
            node%is_present())) then
            call refuse_value(place, "power_limit", place%node%get("power_limit"), "leaves the torque of a slow motor without "// &
                "a limit (expected 'torque_limit', 'current_limit' or 'torque_curve' beside it)", status)
        end if
    end subroutine read_motor_limits

    !> Torque over speed, from two lists or two columns of a table.
    subroutine read_curve(place, shelf, curve, status)
        type(scene_place), intent(in) :: place
        type(table_shelf), intent(inout) :: shelf
        type(law_spec), intent(out) :: curve
        type(status_type), intent(inout) :: status
        type(table_reading) :: reading
        type(toml_node) :: speeds, torques, table
        character(len=:), allocatable :: of_speed, of_torque
        real(wp), allocatable :: speed(:), torque(:)
        logical :: found
        integer :: i

        call require_table(place, "a table, { speeds = [..], torques = [..] } or { table = .. }", status)
        if (.not. status%is_ok()) return
        table = place%node%get("table")
        if (table%is_present()) then
            call allow_keys(place, [character(len=6) :: "table", "speed", "torque"], status)
            call get_text(place, "speed", of_speed, status, found)
            if (.not. found) of_speed = "speed"
            call get_text(place, "torque", of_torque, status, found)
            if (.not. found) of_torque = "torque"
            call read_table_keys(place, straight_lines, shelf, reading, status)
            if (.not. status%is_ok()) return
            associate (of => shelf%place(reading%table)%table)
                call column_in_si(of, of_speed, angular_rate, speed, status)
                call column_in_si(of, of_torque, moment, torque, status)
                if (status%is_ok()) call table_law(of, of_speed, speed, torque, straight_lines, curve, status, "rad/s")
            end associate
        else
            call allow_keys(place, [character(len=7) :: "speeds", "torques", "table"], status)
            speeds = place%node%get("speeds")
            torques = place%node%get("torques")
            if (.not. speeds%is_present()) call refuse_missing(place, "speeds", "a list of speeds of the motor", status)
            if (.not. torques%is_present()) call refuse_missing(place, "torques", "a list of its largest torques", status)
            if (.not. status%is_ok()) return
            call list_of(place, "speeds", speeds, angular_rate, speed, status)
            call list_of(place, "torques", torques, moment, torque, status)
            if (.not. status%is_ok()) return
            if (size(torque) /= size(speed)) then
                call refuse_value(place, "torques", torques, "has "//counted(size(torque), "element")//" (expected "// &
                    to_text(size(speed))//", as many as 'speeds')", status)
                return
            end if
            do i = 2, size(speed)
                if (speed(i) > speed(i - 1)) cycle
                call refuse_value(place, "speeds", speeds, "does not increase: "//to_text(speed(i))//" rad/s follows "// &
                    to_text(speed(i - 1))//" rad/s (expected increasing speeds)", status)
                return
            end do
            curve = rows_of(speed, torque)
        end if
        if (.not. status%is_ok()) return
        if (size(speed) < 2) then
            call refuse(place, "has "//counted(size(speed), "row")//" (expected two or more)", status)
        else if (abs(speed(1)) > 0) then
            call refuse(place, "begins at "//to_text(speed(1))//" rad/s (expected the torque at rest first; the motor "// &
                "turns either way)", status)
        else if (any(torque < 0) .or. .not. torque(1) > 0) then
            call refuse(place, "has a torque of "//to_text(minval(torque))//" N m (expected more than zero at rest, and zero "// &
                "or more elsewhere)", status)
        end if
    end subroutine read_curve

    !> Straight lines through rows.
    pure type(law_spec) function rows_of(speed, torque) result(curve)
        real(wp), intent(in) :: speed(:), torque(:)

        curve%kind = law_table
        curve%time = speed
        curve%knot = torque
    end function rows_of

    !> A quantity above zero, if the key is there.
    subroutine read_positive(place, key, quantity, unit, value, status)
        type(scene_place), intent(in) :: place
        character(len=*), intent(in) :: key, unit
        type(quantity_type), intent(in) :: quantity
        real(wp), intent(inout) :: value
        type(status_type), intent(inout) :: status
        logical :: found

        call get_quantity(place, key, quantity, value, status, found)
        if (found) call require_positive(place, key, value, unit, status)
    end subroutine read_positive
end module linkdyn_scene_motor_limits
