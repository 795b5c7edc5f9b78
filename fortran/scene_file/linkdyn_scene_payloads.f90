!> The tables [[payload]] of a scene file: masses on markers of links, constant or laws of time.
module linkdyn_scene_payloads
    use linkdyn_kinds, only: wp
    use linkdyn_scene, only: scene_type, payload_spec, frame_link, law_constant
    use linkdyn_scene_keys, only: scene_place, refuse_value, allow_keys, get_quantity, get_text, refuse_missing
    use linkdyn_scene_laws, only: table_shelf, read_law, straight_lines
    use linkdyn_scene_links, only: read_inertia
    use linkdyn_scene_names, only: find_marker
    use linkdyn_scene_pattern, only: repeated_tables, list_repeated, repeated_at
    use linkdyn_status, only: status_type
    use linkdyn_text, only: to_text, quoted
    use linkdyn_toml, only: toml_node
    use linkdyn_units, only: mass, time_span
    implicit none (type, external)
    private
    public :: read_payloads

contains

    subroutine read_payloads(root, shelf, scene, status)
        type(scene_place), intent(in) :: root
        type(table_shelf), intent(inout) :: shelf
        type(scene_type), intent(inout) :: scene
        type(status_type), intent(inout) :: status
        type(repeated_tables) :: tables
        type(scene_place) :: place
        integer :: i

        call list_repeated(root, "payload", scene%planar, .false., tables, status)
        if (.not. status%is_ok()) return
        allocate (scene%payload(size(tables%table)))
        do i = 1, size(scene%payload)
            place = repeated_at(root, tables, i, "payload")
            call read_payload(place, shelf, scene, scene%payload(i), status)
            if (.not. status%is_ok()) return
        end do
    end subroutine read_payloads

    subroutine read_payload(place, shelf, scene, payload, status)
        type(scene_place), intent(inout) :: place
        type(table_shelf), intent(inout) :: shelf
        type(scene_type), intent(in) :: scene
        type(payload_spec), intent(inout) :: payload
        type(status_type), intent(inout) :: status
        type(toml_node) :: node
        character(len=:), allocatable :: text
        logical :: found

        payload%line = place%line
        call get_text(place, "on", text, status)
        if (.not. status%is_ok()) return
        payload%name = text
        place%what = "payload on "//quoted(payload%name)
        call allow_keys(place, [character(len=7) :: "on", "mass", "inertia", "from", "until"], status)
        call find_marker(scene, place, "on", place%node%get("on"), payload%link, payload%marker, status)
        if (status%is_ok() .and. payload%link == frame_link) call refuse_value(place, "on", place%node%get("on"), &
            "= "//quoted(text)//": what the frame carries moves nothing (expected a marker of a moving link)", status)
        if (.not. status%is_ok()) return
        node = place%node%get("mass")
        if (.not. node%is_present()) then
            call refuse_missing(place, "mass", "a mass, for example '5 kg', or a law of time", status)
            return
        end if
        call read_law(place, "mass", node, mass, 0.0_wp, "mass", straight_lines, shelf, payload%mass, status)
        if (status%is_ok() .and. payload%mass%kind == law_constant .and. payload%mass%value(1) < 0) call refuse_value(place, &
            "mass", node, "= "//to_text(payload%mass%value(1))//" kg is negative (expected a mass of zero or more)", status)
        call get_quantity(place, "from", time_span, payload%from, status, found)
        call get_quantity(place, "until", time_span, payload%until, status, found)
        if (status%is_ok() .and. .not. payload%until > payload%from) call refuse_value(place, "until", &
            place%node%get("until"), "= "//to_text(payload%until)//" s is not after 'from', "//to_text(payload%from) &
            //" s (expected a later instant)", status)
        node = place%node%get("inertia")
        if (.not. status%is_ok() .or. .not. node%is_present()) return
        if (payload%mass%kind /= law_constant) then
            call refuse_value(place, "inertia", node, "is that of a mass that changes "// &
                "(expected a point mass, without 'inertia', or a mass that is a number)", status)
        else if (.not. payload%mass%value(1) > 0) then
            call refuse_value(place, "inertia", node, &
                              "has no meaning without a mass (expected a mass above zero, or no 'inertia')", status)
        end if
        call read_inertia(place, node, scene%planar, .true., payload%inertia, status)
    end subroutine read_payload
end module linkdyn_scene_payloads
