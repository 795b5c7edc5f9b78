!> From a scene file to a scene: names resolved, units turned into SI, every mistake of form refused.
!>
!> The reference of the file is docs/scene-file.md. A refusal is one line: file, line, the name
!> concerned, what is wrong, what was expected.
module linkdyn_scene_reader
    use linkdyn_kinds, only: wp
    use linkdyn_status, only: status_type, status_bad_input, fail
    use linkdyn_text, only: to_text, quoted
    use linkdyn_scene, only: share_name, share_refused, scene_type, source_spec, source_shelf, path_len, law_none
    use linkdyn_laws, only: evaluate_law
    use linkdyn_toml, only: toml_document, free_toml
    use linkdyn_units, only: acceleration
    use linkdyn_input, only: read_file_text, folder_of
    use linkdyn_scene_keys, only: scene_place, refuse, allow_keys, get_text, get_word, get_vector, &
        counted
    use linkdyn_scene_include, only: open_document, scene_key
    use linkdyn_scene_links, only: read_frame, read_links
    use linkdyn_scene_pattern, only: repeated_tables, list_repeated
    use linkdyn_scene_names, only: refuse_double_links, refuse_double_joints
    use linkdyn_scene_joints, only: read_joints
    use linkdyn_scene_controllers, only: read_controllers
    use linkdyn_scene_chain, only: count_chain_parts, read_chains
    use linkdyn_scene_slots, only: count_slots, make_blocks
    use linkdyn_scene_laws, only: table_shelf, files_of, name_reader
    use linkdyn_scene_motion, only: read_coordinates, read_base
    use linkdyn_scene_state_laws, only: read_measures, read_named_laws
    use linkdyn_scene_brakes, only: find_brake_events
    use linkdyn_scene_clutches, only: read_clutches
    use linkdyn_scene_events, only: read_events, read_stops
    use linkdyn_scene_friction, only: read_frictions
    use linkdyn_scene_cylinders, only: check_cylinders
    use linkdyn_scene_motors, only: check_laws_at_motors
    use linkdyn_scene_forces, only: read_actuators, read_loads, read_springs
    use linkdyn_scene_payloads, only: read_payloads
    use linkdyn_scene_time, only: read_time
    use linkdyn_scene_parameters, only: added_unit, add_unit
    use linkdyn_scene_sweep, only: read_sweep
    use linkdyn_scene_variables, only: read_variables, list_variables
    use linkdyn_variables, only: variable_table
    use linkdyn_written_numbers, only: is_at
    implicit none (type, external)
    private
    public :: read_scene, parse_scene, read_document, root_of, check_actuators

contains

    !> Read a scene file; the tables it names lie beside it.
    subroutine read_scene(file, scene, status)
        character(len=*), intent(in) :: file
        type(scene_type), intent(out) :: scene
        type(status_type), intent(out) :: status
        character(len=:), allocatable :: text

        if (len_trim(file) > path_len) then
            call fail(status, status_bad_input, "the name of the scene file is longer than "//to_text(path_len)//" letters")
            return
        end if
        call read_file_text(file, trim(file), text, status)
        if (status%is_ok()) call parse_scene(text, trim(file), folder_of(trim(file)), scene, status)
    end subroutine read_scene

    !> Read a scene from its text.
    subroutine parse_scene(text, file, folder, scene, status)
        character(len=*), intent(in) :: text
        character(len=*), intent(in) :: file           !! what to call the text in messages
        character(len=*), intent(in) :: folder         !! where the tables lie; blank: the current folder
        type(scene_type), intent(out) :: scene
        type(status_type), intent(out) :: status
        type(toml_document) :: document
        type(source_spec), allocatable :: source(:)
        type(added_unit), allocatable :: added(:)

        call open_document(text, file, folder, document, source, status)
        if (status%is_ok()) call read_document(document, source, folder, .true., scene, status, added)
        if (status%is_ok()) call check_units_of_axes(document, source, folder, scene, added, status)
        scene%source = source                          ! whatever came of it, so that its files are known
        scene%text = text
        if (status%is_ok() .and. size(source) > 1) scene%text = document%as_text()
        call free_toml(document)
    end subroutine parse_scene

    !> Values of an axis may have a unit where the number in the file has none. Which unit it may be the key knows: the scene is
    !> read once more, with that unit behind the number. The document is not to be read again.
    subroutine check_units_of_axes(document, source, folder, scene, added, status)
        type(toml_document), intent(in) :: document
        type(source_spec), intent(in) :: source(:)
        character(len=*), intent(in) :: folder
        type(scene_type), intent(in) :: scene
        type(added_unit), intent(in) :: added(:)       !! of its axes
        type(status_type), intent(inout) :: status
        type(scene_type), allocatable :: with_units
        type(status_type) :: trial
        type(scene_place) :: place
        integer :: i

        do i = 1, size(scene%sweep%axis)
            associate (axis => scene%sweep%axis(i))
                if (.not. added(i)%is_there) cycle
                place = root_of(document, source)
                call add_unit(place, axis, added(i))
                allocate (with_units)
                call read_document(document, source, folder, .false., with_units, trial)
                deallocate (with_units)
                if (trial%is_ok()) cycle
                place%what = "sweep axis "//quoted(axis%name)
                call refuse(place, "the unit of its values does not fit: "//trim(trial%message), status, axis%line)
                return
            end associate
        end do
    end subroutine check_units_of_axes

    !> Read a scene from a document.
    subroutine read_document(document, source, folder, wants_sweep, scene, status, added)
        type(toml_document), intent(in) :: document
        type(source_spec), intent(in) :: source(:)     !! files that it is made of
        character(len=*), intent(in) :: folder         !! as in `parse_scene`
        logical, intent(in) :: wants_sweep             !! read the table [sweep], too
        type(scene_type), intent(out) :: scene
        type(status_type), intent(inout) :: status
        type(added_unit), allocatable, intent(out), optional :: added(:)    !! of the sweep's axes
        type(scene_place) :: root
        type(added_unit), allocatable :: of_axes(:)
        type(variable_table), target :: variables
        type(source_shelf), target :: sources

        scene%file = source(1)%file
        scene%source = source
        sources%item = source
        root = root_of(document, source)
        root%sources => sources
        root%variables => variables
        call read_variables(root, variables, status)
        call list_variables(variables, scene)
        call variables%forget()                        ! what refers to them is known from here on
        call read_tables(root, folder, scene, status)
        if (wants_sweep) call read_sweep(root, scene, of_axes, status)
        if (present(added)) call move_alloc(of_axes, added)
        if (status%is_ok()) call start_on_motion(root, scene, status)
    end subroutine read_document

    !> The table at the top.
    type(scene_place) function root_of(document, source) result(root)
        type(toml_document), intent(in) :: document
        type(source_spec), intent(in) :: source(:)

        root%file = source(1)%file
        root%node = document%root()
    end function root_of

    !> Inverse dynamics finds one driving force for each coordinate: refuse any other number of actuators.
    subroutine check_actuators(scene, status)
        type(scene_type), intent(in) :: scene
        type(status_type), intent(inout) :: status
        integer :: n_actuator, n_coordinate

        n_actuator = size(scene%actuator)
        n_coordinate = size(scene%coordinate)
        if (n_actuator == n_coordinate) return
        if (n_actuator > n_coordinate .and. scene%redundancy /= share_refused) return
        call fail(status, status_bad_input, trim(scene%file)//": "// &
            trim(merge("too few actuators: ", "too many actuators:", n_actuator < n_coordinate))//" "// &
            counted(n_actuator, "actuator")//" for "//counted(n_coordinate, "coordinate")// &
            " (expected as many actuators as coordinates for inverse dynamics)")
    end subroutine check_actuators

    !> The tables of a scene, in the order in which they refer to one another.
    subroutine read_tables(root, folder, scene, status)
        type(scene_place), intent(in) :: root
        character(len=*), intent(in) :: folder
        type(scene_type), intent(inout) :: scene
        type(status_type), intent(inout) :: status
        type(table_shelf) :: shelf
        type(repeated_tables) :: links, joints
        integer, allocatable :: driven(:)
        integer :: n_link, n_joint, n_chain_link, n_chain_joint, n_slot

        shelf%folder = folder
        call read_head(root, scene, status)
        call list_repeated(root, "link", scene%planar, .true., links, status)
        call list_repeated(root, "joint", scene%planar, .false., joints, status)
        call count_chain_parts(root, scene%planar, n_chain_link, n_chain_joint, status)
        n_slot = count_slots(root, scene%planar, status)
        n_link = size(links%table)
        n_joint = size(joints%table)
        if (status%is_ok() .and. n_link == 0) &
            call refuse(root, "the scene has no links (expected at least one [[link]])", status)
        if (.not. status%is_ok()) return
        allocate (scene%link(n_link + n_chain_link + n_slot), scene%joint(n_joint + n_chain_joint + n_slot))
        call read_frame(root, scene, status)
        call read_links(root, scene, status)
        call read_chains(root, n_link + 1, n_joint + 1, scene, driven, status)
        call make_blocks(root, n_link + n_chain_link + 1, scene, status)
        call refuse_double_links(root, scene, status)
        call read_joints(root, n_link + n_chain_link + 1, n_joint + n_chain_joint + 1, shelf, scene, status)
        call refuse_double_joints(root, scene, status)
        call read_coordinates(root, shelf, scene, status)
        call read_base(root, shelf, scene, status)
        call read_measures(root, scene, shelf, status)
        call read_named_laws(root, shelf, status)
        call read_actuators(root, driven, shelf, scene, status)
        call read_controllers(root, shelf, scene, status)
        if (status%is_ok()) call check_laws_at_motors(root, scene, status)
        call read_loads(root, shelf, scene, status)
        call read_springs(root, shelf, scene, status)
        call read_payloads(root, shelf, scene, status)
        call read_events(root, scene, status)
        if (status%is_ok()) call find_brake_events(root, scene, status)
        call read_stops(root, shelf, scene, status)
        call read_clutches(root, shelf, scene, status)
        call read_frictions(root, shelf, scene, status)
        call name_reader(shelf, status)
        scene%laws = shelf%book
        if (status%is_ok()) call check_cylinders(root, scene, status)
        scene%table_file = files_of(shelf)
        call read_time(root, scene, status)
    end subroutine read_tables

    !> Title, space, gravity, what to do at change points.
    subroutine read_head(root, scene, status)
        type(scene_place), intent(in) :: root
        type(scene_type), intent(inout) :: scene
        type(status_type), intent(inout) :: status
        character(len=:), allocatable :: title
        logical :: found
        integer :: space, at_change_point

        if (root%node%count() == 0) then
            call refuse(root, "the scene is empty (expected 'space', links, joints, coordinates)", status)
            return
        end if
        call allow_keys(root, scene_key, status)
        call get_text(root, "title", title, status, found)
        scene%title = title
        call get_word(root, "space", [character(len=7) :: "planar", "spatial"], space, status)
        if (.not. status%is_ok()) return
        scene%planar = space == 1
        call get_vector(root, "gravity", acceleration, scene%gravity(:merge(2, 3, scene%planar)), status, scene%has_gravity)
        at_change_point = 1
        call get_word(root, "change_points", [character(len=4) :: "pass", "stop"], at_change_point, status, found)
        scene%passes_change_points = at_change_point == 1
        call get_word(root, "redundancy", share_name, scene%redundancy, status, found)
    end subroutine read_head

    !> Coordinates without a start begin on their motion, and so do driven ones: a velocity of another start would be heard by
    !> nobody.
    subroutine start_on_motion(root, scene, status)
        type(scene_place), intent(in) :: root
        type(scene_type), intent(inout) :: scene
        type(status_type), intent(inout) :: status
        type(scene_place) :: place
        real(wp) :: position, velocity, acceleration
        integer :: i

        do i = 1, size(scene%coordinate)
            associate (coordinate => scene%coordinate(i))
                if ((coordinate%has_start .and. .not. coordinate%is_driven) .or. coordinate%motion%kind == law_none) cycle
                call evaluate_law(coordinate%motion, scene%time%first, position, velocity, acceleration)
                if (abs(coordinate%start_velocity) > 0 .and. .not. is_at(velocity, coordinate%start_velocity, .true.)) then
                    place = root
                    place%what = "coordinate "//quoted(coordinate%name)
                    call refuse(place, "starts with the "//to_text(velocity)//" "//trim(coordinate%unit)// &
                        "/s of its motion, not with the "//to_text(coordinate%start_velocity)//" "//trim(coordinate%unit)// &
                        "/s of 'start' (expected a start that says a place, too, of a coordinate that is not driven)", status, &
                        coordinate%line)
                    return
                end if
                if (coordinate%has_start) cycle
                coordinate%start_position = position
                coordinate%start_velocity = velocity
            end associate
        end do
    end subroutine start_on_motion
end module linkdyn_scene_reader
