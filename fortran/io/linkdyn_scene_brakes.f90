!> The key `brake` of a drive.
module linkdyn_scene_brakes
    use linkdyn_kinds, only: wp
    use linkdyn_scene, only: scene_type, brake_spec, name_len
    use linkdyn_scene_keys, only: scene_place, place_at, refuse, refuse_missing, allow_keys, get_quantity, get_name, get_word, &
        require_table
    use linkdyn_scene_motor_limits, only: read_positive
    use linkdyn_status, only: status_type
    use linkdyn_suggest, only: suggestion
    use linkdyn_text, only: quoted
    use linkdyn_toml, only: toml_node
    use linkdyn_units, only: moment, time_span
    implicit none (type, external)
    private
    public :: read_brake, find_brake_events

contains

    subroutine read_brake(place, node, brake, status)
        type(scene_place), intent(in) :: place         !! of the drive
        type(toml_node), intent(in) :: node
        type(brake_spec), intent(inout) :: brake
        type(status_type), intent(inout) :: status
        type(scene_place) :: inner
        logical :: has_from, has_until, has_event, has_begin, found
        integer :: choice

        inner = place_at(place, node, trim(place%what)//", brake")
        call require_table(inner, "a table, { torque = .. }", status)
        call allow_keys(inner, [character(len=11) :: "torque", "from", "until", "from_event", "until_event", "begins"], status)
        brake%is_given = .true.
        brake%line = inner%line
        call read_positive(inner, "torque", moment, "N m", brake%torque, status)
        if (status%is_ok() .and. .not. brake%torque > 0) call refuse_missing(inner, "torque", "by which the brake holds, for "// &
            "example '30 N m'", status)
        call get_quantity(inner, "from", time_span, brake%from, status, has_from)
        call get_quantity(inner, "until", time_span, brake%until, status, has_until)
        call read_name("from_event", brake%from_name)
        has_event = brake%from_name /= ""
        has_from = has_from .or. has_event
        call read_name("until_event", brake%until_name)
        has_event = has_event .or. brake%until_name /= ""
        has_until = has_until .or. brake%until_name /= ""
        choice = 1
        call get_word(inner, "begins", [character(len=3) :: "on", "off"], choice, status, has_begin)
        if (.not. status%is_ok()) return
        if (has_begin) then
            brake%begins_on = choice == 1
        else if (.not. has_from) then
            brake%begins_on = .true.
        else if (.not. has_until) then
            brake%begins_on = .false.
        else if (has_event) then
            call refuse_missing(inner, "begins", "'on' or 'off': with an event nobody knows which comes first", status)
        else
            brake%begins_on = brake%until < brake%from
        end if

    contains

        subroutine read_name(key, name)
            character(len=*), intent(in) :: key
            character(len=name_len), intent(inout) :: name
            type(toml_node) :: item

            item = inner%node%get(key)
            if (status%is_ok() .and. item%is_present()) call get_name(inner, key, name, status)
        end subroutine read_name
    end subroutine read_brake

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
                call find("from_event", brake%from_name, brake%from_event)
                call find("until_event", brake%until_name, brake%until_event)
            end associate
        end do

    contains

        subroutine find(key, name, event)
            character(len=*), intent(in) :: key
            character(len=name_len), intent(in) :: name
            integer, intent(out) :: event

            event = 0
            if (name == "" .or. .not. status%is_ok()) return
            event = findloc(scene%event%name, name, dim=1)
            if (event == 0) call refuse(place, "key "//quoted(key)//" = "//quoted(name)//": there is no such event (expected "// &
                "the name of an [[event]])"//suggestion(trim(name), scene%event%name), status, &
                scene%actuator(i)%motor%brake%line)
        end subroutine find
    end subroutine find_brake_events
end module linkdyn_scene_brakes
