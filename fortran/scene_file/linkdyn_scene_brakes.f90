!> The key `brake` of a drive.
module linkdyn_scene_brakes
    use linkdyn_scene, only: scene_type, switch_spec, brake_spec, name_len
    use linkdyn_scene_keys, only: scene_place, place_at, refuse, refuse_value, refuse_missing, allow_keys, get_quantity, get_name, &
        get_word, require_table
    use linkdyn_scene_motor_limits, only: read_positive
    use linkdyn_status, only: status_type
    use linkdyn_suggest, only: suggestion
    use linkdyn_text, only: to_text, quoted
    use linkdyn_toml, only: toml_node
    use linkdyn_units, only: moment, time_span
    implicit none (type, external)
    private
    public :: read_brake, read_switch, find_brake_events, find_switch_event, switch_key

    character(len=11), parameter :: switch_key(*) = [character(len=11) :: "from", "until", "from_event", "until_event", "begins"]

contains

    subroutine read_brake(place, node, brake, status)
        type(scene_place), intent(in) :: place         !! of the drive
        type(toml_node), intent(in) :: node
        type(brake_spec), intent(inout) :: brake
        type(status_type), intent(inout) :: status
        type(scene_place) :: inner

        inner = place_at(place, node, trim(place%what)//", brake")
        call require_table(inner, "a table, { torque = .. }", status)
        call allow_keys(inner, [character(len=11) :: "torque", switch_key], status)
        brake%is_given = .true.
        brake%line = inner%line
        call read_positive(inner, "torque", moment, "N m", brake%torque, status)
        if (status%is_ok() .and. .not. brake%torque > 0) call refuse_missing(inner, "torque", "by which the brake holds, for "// &
            "example '30 N m'", status)
        call read_switch(inner, brake%switch_spec, status)
    end subroutine read_brake

    !> From when until when something is on: instants, and events by which it comes on and off.
    subroutine read_switch(inner, switch, status)
        type(scene_place), intent(in) :: inner
        type(switch_spec), intent(inout) :: switch
        type(status_type), intent(inout) :: status
        logical :: has_from, has_until, has_event, has_begin, found
        integer :: choice

        call get_quantity(inner, "from", time_span, switch%from, status, has_from)
        call get_quantity(inner, "until", time_span, switch%until, status, has_until)
        if (status%is_ok() .and. has_from .and. has_until .and. .not. abs(switch%until - switch%from) > 0) &
            call refuse_value(inner, "until", inner%node%get("until"), "= "//to_text(switch%until)//" s is the instant of "// &
                "'from', too (expected another one)", status)
        call read_name("from_event", switch%from_name)
        has_event = switch%from_name /= ""
        has_from = has_from .or. has_event
        call read_name("until_event", switch%until_name)
        has_event = has_event .or. switch%until_name /= ""
        has_until = has_until .or. switch%until_name /= ""
        choice = 1
        call get_word(inner, "begins", [character(len=3) :: "on", "off"], choice, status, has_begin)
        if (.not. status%is_ok()) return
        if (has_begin) then
            switch%begins_on = choice == 1
        else if (.not. has_from) then
            switch%begins_on = .true.
        else if (.not. has_until) then
            switch%begins_on = .false.
        else if (has_event) then
            call refuse_missing(inner, "begins", "'on' or 'off': the initial state is not defined by events", status)
        else
            switch%begins_on = switch%until < switch%from
        end if

    contains

        subroutine read_name(key, name)
            character(len=*), intent(in) :: key
            character(len=name_len), intent(inout) :: name
            type(toml_node) :: item

            item = inner%node%get(key)
            if (status%is_ok() .and. item%is_present()) call get_name(inner, key, name, status)
        end subroutine read_name
    end subroutine read_switch

    !> Events that switch brakes, once events have been read.
    subroutine find_brake_events(root, scene, status)
        type(scene_place), intent(in) :: root
        type(scene_type), intent(inout) :: scene
        type(status_type), intent(inout) :: status
        type(scene_place) :: place
        integer :: i

        place = root
        do i = 1, size(scene%actuator)
            associate (brake => scene%actuator(i)%motor%brake)
                if (.not. brake%is_given) cycle
                place%what = "actuator "//quoted(scene%actuator(i)%name)//", drive, brake"
                call find_switch_event(place, scene, "from_event", brake%from_name, brake%line, brake%from_event, status)
                call find_switch_event(place, scene, "until_event", brake%until_name, brake%line, brake%until_event, status)
            end associate
        end do
    end subroutine find_brake_events

    !> The event by which something comes on or off.
    subroutine find_switch_event(place, scene, key, name, line, event, status)
        type(scene_place), intent(in) :: place
        type(scene_type), intent(in) :: scene
        character(len=*), intent(in) :: key
        character(len=name_len), intent(in) :: name
        integer, intent(in) :: line
        integer, intent(out) :: event
        type(status_type), intent(inout) :: status

        event = 0
        if (name == "" .or. .not. status%is_ok()) return
        event = findloc(scene%event%name, name, dim=1, mask=scene%event%stop == 0 .and. scene%event%clutch == 0)
        if (event == 0) call refuse(place, "key "//quoted(key)//" = "//quoted(name)//": there is no such event (expected "// &
            "the name of an [[event]])"//suggestion(trim(name), scene%event%name), status, line)
    end subroutine find_switch_event
end module linkdyn_scene_brakes
