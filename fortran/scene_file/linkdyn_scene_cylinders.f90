!> The key `cylinder` of an actuator: a hydraulic or pneumatic cylinder and its valve.
module linkdyn_scene_cylinders
    use linkdyn_constants, only: pi
    use linkdyn_cylinder_laws, only: is_within_stroke, is_pressed
    use linkdyn_kinds, only: wp
    use linkdyn_scene, only: scene_type, actuator_spec, cylinder_spec, measure_joint
    use linkdyn_scene_keys, only: scene_place, place_at, refuse, refuse_value, refuse_missing, allow_keys, get_quantity, &
        get_vector, get_flag, require_table
    use linkdyn_scene_motor_limits, only: read_positive
    use linkdyn_status, only: status_type
    use linkdyn_text, only: to_text, quoted
    use linkdyn_toml, only: toml_node
    use linkdyn_units, only: quantity_type, plain_number, length, volume, fluid_pressure, volume_flow, flow_per_pressure
    implicit none (type, external)
    private
    public :: read_cylinder, check_cylinders

    character(len=13), parameter :: cylinder_key(*) = [character(len=13) :: "bore", "rod", "through_rod", "stroke", &
        "dead_volumes", "bulk_modulus", "air", "gas", "supply", "tank", "valve", "leakage", "pressures"]

    real(wp), parameter :: most_exponent = 5.0_wp/3

contains

    subroutine read_cylinder(place, node, actuator, status)
        type(scene_place), intent(in) :: place         !! of the actuator
        type(toml_node), intent(in) :: node            !! the value of `cylinder`
        type(actuator_spec), intent(inout) :: actuator
        type(status_type), intent(inout) :: status
        type(scene_place) :: inner

        inner = place_at(place, node, trim(place%what)//", cylinder")
        call require_table(inner, "a table, { bore = '80 mm', .. }", status)
        call allow_keys(inner, cylinder_key, status)
        if (.not. status%is_ok()) return
        if (actuator%unit /= "N") then
            call refuse(inner, "the driven variable turns (expected a slide)", status)
        else if (actuator%motor%is_given) then
            call refuse(inner, "stands beside a 'drive' (expected one of them)", status)
        end if
        associate (cylinder => actuator%cylinder)
            cylinder%is_given = .true.
            cylinder%line = inner%line
            call read_areas(inner, cylinder%area, status)
            call read_chambers(inner, cylinder, status)
            call read_gas(inner, cylinder, status)
            if (.not. cylinder%has_gas) call read_oil(inner, cylinder, status)
            call read_pressures(inner, cylinder, status)
            call read_valve(inner, cylinder, status)
        end associate
    end subroutine read_cylinder

    !> Areas of the piston on the head's side and on the rod's, from their diameters.
    subroutine read_areas(place, area, status)
        type(scene_place), intent(in) :: place
        real(wp), intent(out) :: area(2)               !! [m2]
        type(status_type), intent(inout) :: status
        real(wp) :: bore, rod
        logical :: found, goes_through

        area = 0
        bore = 0
        rod = 0
        goes_through = .false.
        call require_given(place, "bore", length, "the diameter of the piston, for example '80 mm'", bore, status)
        call get_quantity(place, "rod", length, rod, status, found)
        if (status%is_ok() .and. .not. (rod >= 0 .and. rod < bore)) call refuse_value(place, "rod", place%node%get("rod"), "= "// &
            to_text(rod)//" m (expected a diameter from zero on, less than the bore of "//to_text(bore)//" m)", status)
        call get_flag(place, "through_rod", goes_through, status)
        if (status%is_ok() .and. goes_through .and. .not. rod > 0) &
            call refuse_missing(place, "rod", "the diameter of the rod that goes through, for example '50 mm'", status)
        area = pi/4*(bore - rod)*(bore + rod)
        if (.not. goes_through) area(1) = pi/4*bore**2
    end subroutine read_areas

    !> Where the piston's ends are, and what oil stays there.
    subroutine read_chambers(place, cylinder, status)
        type(scene_place), intent(in) :: place
        type(cylinder_spec), intent(inout) :: cylinder
        type(status_type), intent(inout) :: status
        logical :: found

        call get_vector(place, "stroke", length, cylinder%stroke, status, found)
        if (.not. found) call refuse_missing(place, "stroke", "the joint variable with the rod in and with it out, for example "// &
            "['0.6 m', '1.1 m']", status)
        if (status%is_ok() .and. .not. abs(cylinder%stroke(2) - cylinder%stroke(1)) > 0) call refuse_value(place, "stroke", &
            place%node%get("stroke"), "has no length (expected the joint variable with the rod in, then with it out)", status)
        call get_vector(place, "dead_volumes", volume, cylinder%dead_volume, status, found)
        if (.not. found) call refuse_missing(place, "dead_volumes", "what stays in head and rod chamber at their ends, "// &
            "lines to the valve with it, for example ['0.2 litre', '0.2 litre']", status)
        if (status%is_ok() .and. .not. all(cylinder%dead_volume > 0)) call refuse_value(place, "dead_volumes", &
            place%node%get("dead_volumes"), "leaves a chamber without volume at its end (expected two volumes above zero)", status)
    end subroutine read_chambers

    subroutine read_oil(place, cylinder, status)
        type(scene_place), intent(in) :: place
        type(cylinder_spec), intent(inout) :: cylinder
        type(status_type), intent(inout) :: status
        logical :: found

        call require_given(place, "bulk_modulus", fluid_pressure, "that of the oil in its lines, for example '1.4 GPa'", &
                           cylinder%bulk_modulus, status)
        call get_quantity(place, "air", plain_number, cylinder%air, status, found)
        if (status%is_ok() .and. .not. (cylinder%air >= 0 .and. cylinder%air < 1)) &
            call refuse_value(place, "air", place%node%get("air"), "= "//to_text(cylinder%air)// &
            " (expected its share of the volume, from zero on, below 1)", status)
        call get_quantity(place, "leakage", flow_per_pressure, cylinder%leakage, status, found)
        if (status%is_ok() .and. .not. cylinder%leakage >= 0) call refuse_value(place, "leakage", place%node%get("leakage"), &
            "is below zero (expected a flow over a pressure, zero or more)", status)
    end subroutine read_oil

    !> A gas in place of oil.
    subroutine read_gas(place, cylinder, status)
        type(scene_place), intent(in) :: place
        type(cylinder_spec), intent(inout) :: cylinder
        type(status_type), intent(inout) :: status
        character(len=12), parameter :: of_oil(3) = [character(len=12) :: "bulk_modulus", "air", "leakage"]
        type(toml_node) :: node
        type(scene_place) :: inner
        integer :: i

        if (.not. status%is_ok()) return
        node = place%node%get("gas")
        cylinder%has_gas = node%is_present()
        if (.not. cylinder%has_gas) return
        inner = place_at(place, node, trim(place%what)//", gas")
        call require_table(inner, "a table, { exponent = 1.3 }", status)
        call allow_keys(inner, [character(len=8) :: "exponent"], status)
        call require_given(inner, "exponent", plain_number, "the polytropic one, from 1 (isothermal) to 1.4 (air, adiabatic)", &
                           cylinder%exponent, status)
        if (status%is_ok() .and. .not. (cylinder%exponent >= 1 .and. cylinder%exponent <= most_exponent)) call refuse_value(inner, &
            "exponent", inner%node%get("exponent"), "= "//to_text(cylinder%exponent)//" (expected 1, isothermal, to 5/3, "// &
            "monatomic, adiabatic)", status)
        do i = 1, size(of_oil)
            node = place%node%get(trim(of_oil(i)))
            if (status%is_ok() .and. node%is_present()) call refuse_value(place, trim(of_oil(i)), node, "stands beside 'gas' "// &
                "(expected one of them: it is a property of oil)", status)
        end do
    end subroutine read_gas

    !> Before and behind the valve, and at the start.
    subroutine read_pressures(place, cylinder, status)
        type(scene_place), intent(in) :: place
        type(cylinder_spec), intent(inout) :: cylinder
        type(status_type), intent(inout) :: status
        logical :: found

        call require_given(place, "supply", fluid_pressure, "the pressure of the pump, for example '180 bar'", cylinder%supply, &
                           status)
        call get_quantity(place, "tank", fluid_pressure, cylinder%tank, status, found)
        if (status%is_ok() .and. .not. (cylinder%tank >= 0 .and. cylinder%tank < cylinder%supply)) &
            call refuse_value(place, "tank", place%node%get("tank"), "= "//to_text(cylinder%tank)// &
            " Pa (expected a pressure from zero on, below the supply's "// &
            to_text(cylinder%supply)//" Pa)", status)
        call get_vector(place, "pressures", fluid_pressure, cylinder%start, status, cylinder%has_start)
        if (status%is_ok() .and. cylinder%has_start .and. .not. is_pressed(cylinder%start)) call refuse_value(place, "pressures", &
            place%node%get("pressures"), "has one below absolute vacuum (expected gauge pressures, above the atmosphere's)", status)
    end subroutine read_pressures

    !> Flow over an edge that is wide open.
    subroutine read_valve(place, cylinder, status)
        type(scene_place), intent(in) :: place
        type(cylinder_spec), intent(inout) :: cylinder
        type(status_type), intent(inout) :: status
        type(toml_node) :: node
        type(scene_place) :: inner

        if (.not. status%is_ok()) return
        node = place%node%get("valve")
        if (.not. node%is_present()) then
            call refuse_missing(place, "valve", "its flow over an edge and the pressure drop there, for example "// &
                "{ flow = '60 litre/min', drop = '35 bar' }", status)
            return
        end if
        inner = place_at(place, node, trim(place%what)//", valve")
        call require_table(inner, "a table, { flow = '60 litre/min', drop = '35 bar' }", status)
        if (cylinder%has_gas) then
            call read_gas_valve(inner, cylinder, status)
            return
        end if
        call allow_keys(inner, [character(len=12) :: "flow", "drop", "laminar_drop"], status)
        call require_given(inner, "flow", volume_flow, "the flow over an edge that is wide open, for example '60 litre/min'", &
                           cylinder%flow, status)
        call require_given(inner, "drop", fluid_pressure, "the pressure drop over that edge at that flow, for example '35 bar'", &
                           cylinder%drop, status)
        call read_positive(inner, "laminar_drop", fluid_pressure, "Pa", cylinder%laminar_drop, status)
    end subroutine read_valve

    !> The same for gas, by ISO 6358.
    subroutine read_gas_valve(place, cylinder, status)
        type(scene_place), intent(in) :: place
        type(cylinder_spec), intent(inout) :: cylinder
        type(status_type), intent(inout) :: status

        call allow_keys(place, [character(len=14) :: "conductance", "critical_ratio"], status)
        call require_given(place, "conductance", flow_per_pressure, "that of an edge that is wide open, for example "// &
                           "'2 litre/s/bar'", cylinder%conductance, status)
        call require_given(place, "critical_ratio", plain_number, "of the pressures behind and before it, for example 0.3", &
                           cylinder%critical_ratio, status)
        if (status%is_ok() .and. .not. cylinder%critical_ratio < 0.9_wp) call refuse_value(place, "critical_ratio", &
            place%node%get("critical_ratio"), "= "//to_text(cylinder%critical_ratio)//" (expected a ratio below 0.9)", status)
    end subroutine read_gas_valve

    !> A quantity above zero that has to be there.
    subroutine require_given(place, key, quantity, example, value, status)
        type(scene_place), intent(in) :: place
        character(len=*), intent(in) :: key, example
        type(quantity_type), intent(in) :: quantity
        real(wp), intent(inout) :: value
        type(status_type), intent(inout) :: status
        type(toml_node) :: node

        if (.not. status%is_ok()) return
        node = place%node%get(key)
        if (.not. node%is_present()) then
            call refuse_missing(place, key, example, status)
        else
            call read_positive(place, key, quantity, trim(quantity%unit), value, status)
        end if
    end subroutine require_given

    !> No stop of a cylinder's slide may lie beyond its stroke.
    subroutine check_cylinders(root, scene, status)
        type(scene_place), intent(in) :: root
        type(scene_type), intent(in) :: scene
        type(status_type), intent(inout) :: status
        type(scene_place) :: place
        integer :: i, k

        do i = 1, size(scene%actuator)
            if (.not. scene%actuator(i)%cylinder%is_given) cycle
            place = root
            place%what = "actuator "//quoted(scene%actuator(i)%name)//", cylinder"
            place%line = scene%actuator(i)%cylinder%line
            do k = 1, size(scene%stop)
                call check_stop(place, scene, i, k, status)
            end do
        end do
    end subroutine check_cylinders

    subroutine check_stop(place, scene, i, k, status)
        type(scene_place), intent(in) :: place
        type(scene_type), intent(in) :: scene
        integer, intent(in) :: i, k                    !! actuator, side of a stop
        type(status_type), intent(inout) :: status

        associate (actuator => scene%actuator(i), stop => scene%stop(k))
            associate (measure => scene%laws%measure(stop%measure))
                if (measure%kind /= measure_joint .or. measure%is_rate) return
                if (measure%joint /= actuator%joint .or. measure%variable /= actuator%variable) return
            end associate
            if (is_within_stroke(actuator%cylinder, stop%bound)) return
            call refuse(place, "stop "//quoted(stop%name)//" at "//to_text(stop%bound)//" m is not within the stroke "// &
                "(expected a place from "//to_text(actuator%cylinder%stroke(1))//" to "// &
                to_text(actuator%cylinder%stroke(2))//" m)", status)
        end associate
    end subroutine check_stop
end module linkdyn_scene_cylinders
