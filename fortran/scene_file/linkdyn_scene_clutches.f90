!> The tables [[clutch]] of a scene file: clutches, brakes and locks of joint variables, and what joins links, in forward runs.
!>
!> A clutch is an event besides, whose formula is its slip. What is held together at once is a clutch for each part, and one event.
module linkdyn_scene_clutches
    use linkdyn_formula, only: formula_node, add_node, node_number, node_symbol, node_subtract, node_multiply
    use linkdyn_joint_table, only: joint_universal, joint_spherical, joint_planar, joint_gear, joint_rack, joint_belt, &
        joint_n_variable
    use linkdyn_kinds, only: wp
    use linkdyn_scene, only: scene_type, event_spec, clutch_spec, friction_spec, joint_spec
    use linkdyn_scene_brakes, only: read_switch, find_switch_event, switch_key
    use linkdyn_scene_forces, only: force_quantity
    use linkdyn_scene_holds, only: held_part, parts_of_joint, read_parts_between
    use linkdyn_scene_joints, only: variable_quantity
    use linkdyn_scene_keys, only: scene_place, refuse, refuse_value, allow_keys, get_quantity, get_name
    use linkdyn_scene_laws, only: table_shelf
    use linkdyn_scene_names, only: find_joint, find_variable
    use linkdyn_scene_pattern, only: repeated_tables, list_repeated, repeated_at
    use linkdyn_scene_state_laws, only: add_joint_measure, add_place_measure, read_force_law
    use linkdyn_status, only: status_type
    use linkdyn_text, only: to_text, quoted
    use linkdyn_toml, only: toml_node
    use linkdyn_units, only: quantity_type, plain_number
    implicit none (type, external)
    private
    public :: read_clutches, add_sticking

    character(len=*), parameter :: joint_key(2) = [character(len=5) :: "joint", "to"]
    character(len=*), parameter :: variable_key(2) = [character(len=11) :: "variable", "to_variable"]

contains

    subroutine read_clutches(root, shelf, scene, status)
        type(scene_place), intent(in) :: root
        type(table_shelf), intent(inout) :: shelf
        type(scene_type), intent(inout) :: scene
        type(status_type), intent(inout) :: status
        type(repeated_tables) :: tables
        type(scene_place) :: place
        type(clutch_spec) :: clutch
        type(held_part), allocatable :: part(:)
        integer :: i

        if (.not. status%is_ok()) return
        allocate (scene%clutch(0))
        call list_repeated(root, "clutch", scene%planar, .false., tables, status)
        if (.not. status%is_ok()) return
        do i = 1, size(tables%table)
            place = repeated_at(root, tables, i, "clutch")
            clutch = clutch_spec(line=place%line)
            call get_name(place, "name", clutch%name, status)
            if (.not. status%is_ok()) return
            place%what = "clutch "//quoted(clutch%name)
            if (any(scene%event%name == clutch%name)) &
                call refuse(place, "there is an event or a clutch of that name (expected another name)", status)
            call read_clutch(place, shelf, scene, clutch, part, status)
            if (.not. status%is_ok()) return
            if (size(part) == 0) then
                call add_slip(clutch, shelf, scene)
            else
                call add_parts(place, clutch, part, shelf, scene, status)
            end if
            if (.not. status%is_ok()) return
        end do
    end subroutine read_clutches

    subroutine read_clutch(place, shelf, scene, clutch, part, status)
        type(scene_place), intent(in) :: place
        type(table_shelf), intent(inout) :: shelf
        type(scene_type), intent(in) :: scene
        type(clutch_spec), intent(inout) :: clutch
        type(held_part), allocatable, intent(out) :: part(:)   !! of what it holds at once; none: it holds one variable, or two
        type(status_type), intent(inout) :: status

        allocate (part(0))
        call allow_keys(place, [character(len=11) :: "name", joint_key, variable_key, "between", "type", "ratio", "capacity", &
                                "static", switch_key], status)
        if (.not. status%is_ok()) return
        if (has_key(place, "between")) then
            call refuse_joint_keys(place, status)
            if (status%is_ok()) call read_parts_between(place, scene, part, status)
        else if (has_key(place, "type")) then
            call refuse_value(place, "type", place%node%get("type"), "has no meaning at a joint (expected 'between')", status)
        else
            call read_at_joint(place, shelf, scene, clutch, part, status)
        end if
        call read_switch(place, clutch%switch_spec, status)
        call find_switch_event(place, scene, "from_event", clutch%from_name, clutch%line, clutch%from_event, status)
        call find_switch_event(place, scene, "until_event", clutch%until_name, clutch%line, clutch%until_event, status)
    end subroutine read_clutch

    logical function has_key(place, key)
        type(scene_place), intent(in) :: place
        character(len=*), intent(in) :: key
        type(toml_node) :: node

        node = place%node%get(key)
        has_key = node%is_present()
    end function has_key

    !> Markers are held to each other whatever it takes.
    subroutine refuse_joint_keys(place, status)
        type(scene_place), intent(in) :: place
        type(status_type), intent(inout) :: status
        character(len=*), parameter :: key(*) = [character(len=11) :: joint_key, variable_key, "ratio", "capacity", "static"]
        integer :: i

        do i = 1, size(key)
            if (status%is_ok() .and. has_key(place, trim(key(i)))) call refuse_value(place, trim(key(i)), &
                place%node%get(trim(key(i))), "has no meaning between markers, which are held to each other whatever it takes "// &
                "(expected either 'between' or 'joint')", status)
        end do
    end subroutine refuse_joint_keys

    !> What holds one variable of a joint, two variables to each other, or all variables of a joint.
    subroutine read_at_joint(place, shelf, scene, clutch, part, status)
        type(scene_place), intent(in) :: place
        type(table_shelf), intent(inout) :: shelf
        type(scene_type), intent(in) :: scene
        type(clutch_spec), intent(inout) :: clutch
        type(held_part), allocatable, intent(inout) :: part(:)
        type(status_type), intent(inout) :: status
        type(quantity_type) :: quantity
        type(toml_node) :: node
        logical :: has_ratio, has_static
        integer :: n

        call find_joint(scene, place, clutch%joint(1), status)
        if (.not. status%is_ok()) return
        n = joint_n_variable(scene%joint(clutch%joint(1))%kind)
        if (n > 1 .and. .not. (has_key(place, "variable") .or. has_key(place, "to") .or. has_key(place, "capacity"))) then
            call refuse_alone(["to_variable", "ratio      ", "static     "])
            if (status%is_ok()) part = parts_of_joint(scene, clutch%joint(1), n)
            return
        end if
        call read_sides(place, scene, clutch, status)
        if (.not. status%is_ok()) return
        call get_quantity(place, "ratio", plain_number, clutch%ratio, status, has_ratio)
        if (status%is_ok() .and. has_ratio) then
            if (clutch%n_side == 1) then
                call refuse_value(place, "ratio", place%node%get("ratio"), "has no meaning without a second joint "// &
                    "(expected 'to')", status)
            else if (.not. abs(clutch%ratio) > 0) then
                call refuse_value(place, "ratio", place%node%get("ratio"), "= 0 leaves joint "// &
                    quoted(scene%joint(clutch%joint(2))%name)//" out (expected another number)", status)
            end if
        end if
        quantity = force_quantity(scene%joint(clutch%joint(1))%kind, clutch%variable(1))
        clutch%unit = quantity%unit(:4)
        node = place%node%get("capacity")
        clutch%is_positive = .not. node%is_present()
        if (node%is_present()) then
            call read_force_law(place, "capacity", node, quantity, "", shelf, clutch%capacity, status)
        end if
        call get_quantity(place, "static", plain_number, clutch%static, status, has_static)
        if (.not. status%is_ok()) return
        if (has_static .and. clutch%is_positive) then
            call refuse_value(place, "static", place%node%get("static"), "has no meaning without 'capacity': the clutch never "// &
                "slips (expected 'capacity')", status)
        else if (.not. (clutch%static >= 1 .and. clutch%static <= huge(1.0_wp))) then
            call refuse_value(place, "static", place%node%get("static"), "= "//to_text(clutch%static)// &
                " (expected 1 or more: what it holds, over what it takes when it slips)", status)
        end if

    contains

        !> Keys that ask for others.
        subroutine refuse_alone(key)
            character(len=*), intent(in) :: key(:)
            integer :: i

            do i = 1, size(key)
                if (status%is_ok() .and. has_key(place, trim(key(i)))) call refuse_value(place, trim(key(i)), &
                    place%node%get(trim(key(i))), "has no meaning where all variables of joint "// &
                    quoted(scene%joint(clutch%joint(1))%name)//" are held (expected 'variable')", status)
            end do
        end subroutine refuse_alone
    end subroutine read_at_joint

    !> One joint variable, or two that are of one kind.
    subroutine read_sides(place, scene, clutch, status)
        type(scene_place), intent(in) :: place
        type(scene_type), intent(in) :: scene
        type(clutch_spec), intent(inout) :: clutch
        type(status_type), intent(inout) :: status
        type(quantity_type) :: quantity(2)
        type(toml_node) :: node
        integer :: k

        node = place%node%get("to")
        if (node%is_present()) clutch%n_side = 2
        do k = 1, clutch%n_side
            call find_joint(scene, place, clutch%joint(k), status, trim(joint_key(k)))
            if (.not. status%is_ok()) return
            associate (joint => scene%joint(clutch%joint(k)))
                if (joint%kind == joint_spherical) then
                    call refuse_value(place, trim(joint_key(k)), place%node%get(trim(joint_key(k))), "is a spherical joint, "// &
                        "which is held as a whole (expected a joint of another type, or no 'variable', 'to' and 'capacity')", &
                        status)
                    return
                end if
                call find_variable(scene, place, clutch%joint(k), clutch%variable(k), status, trim(variable_key(k)))
                if (.not. status%is_ok()) return
                quantity(k) = variable_quantity(joint%kind, clutch%variable(k))
            end associate
        end do
        clutch%slip_unit = trim(quantity(1)%unit)//"/s"
        if (clutch%n_side == 1) then
            node = place%node%get("to_variable")
            if (node%is_present()) call refuse_value(place, "to_variable", node, "has no meaning without a second joint "// &
                "(expected 'to')", status)
        else if (quantity(1)%unit /= quantity(2)%unit) then
            call refuse_value(place, "to", node, "does not move as joint "//quoted(scene%joint(clutch%joint(1))%name)// &
                " does (expected two angles, or two slides)", status)
        else if (clutch%joint(1) == clutch%joint(2) .and. clutch%variable(1) == clutch%variable(2)) then
            call refuse_value(place, "to", node, "is the same joint variable (expected another one)", status)
        end if
    end subroutine read_sides

    !> Friction that sticks is a clutch, which has the joint's name; of joints with several variables one for each, with the name of
    !> that behind a dot. Where they rub along one surface they go together, and have one event, of the joint's name. Of joints
    !> without variables it holds what slips there.
    subroutine add_sticking(place, friction, number, shelf, scene, status)
        type(scene_place), intent(in) :: place
        type(friction_spec), intent(in) :: friction
        integer, intent(in) :: number                  !! of the friction
        type(table_shelf), intent(inout) :: shelf
        type(scene_type), intent(inout) :: scene
        type(status_type), intent(inout) :: status
        type(clutch_spec) :: clutch
        type(held_part), allocatable :: part(:)
        integer :: k, n

        clutch%friction = number
        clutch%is_positive = .false.
        clutch%line = friction%line
        associate (joint => scene%joint(friction%joint))
            clutch%name = joint%name
            n = joint_n_variable(joint%kind)
            if (n == 0) then
                call refuse_taken(joint%name)
                if (status%is_ok()) call add_surfaces(joint, friction%joint, clutch, scene)
                return
            end if
            if (joint%kind == joint_planar .and. .not. friction%radius > 0) n = 2  ! nothing keeps its plate from turning
            part = parts_of_joint(scene, friction%joint, n)
            if (n > 1 .and. joint%kind /= joint_universal) then
                call refuse_taken(joint%name)
                if (status%is_ok()) call add_parts(place, clutch, part, shelf, scene, status)
                return
            end if
            clutch%joint(1) = friction%joint
            do k = 1, n
                if (n > 1) call name_part(place, joint%name, part(k), clutch%name, status)
                if (status%is_ok()) call refuse_taken(clutch%name)
                if (.not. status%is_ok()) return
                clutch%variable(1) = k
                clutch%unit = part(k)%of_force%unit(:4)
                clutch%slip_unit = trim(part(k)%of_place%unit)//"/s"
                call add_slip(clutch, shelf, scene)
            end do
        end associate

    contains

        subroutine refuse_taken(name)
            character(len=*), intent(in) :: name

            if (any(scene%event%name == name)) call refuse(place, "sticks, and its events have the name "//quoted(name)// &
                ", which another event or clutch has (expected another name of that)", status)
        end subroutine refuse_taken
    end subroutine add_sticking

    !> What slips between teeth, at a belt or a cam: an event of the joint's name, which is looked at as such.
    subroutine add_surfaces(joint, j, clutch, scene)
        type(joint_spec), intent(in) :: joint
        integer, intent(in) :: j                       !! its number
        type(clutch_spec), intent(inout) :: clutch
        type(scene_type), intent(inout) :: scene

        clutch%is_bare = .true.
        clutch%joint(1) = j
        clutch%unit = trim(merge("N m", "N  ", turns_at_teeth(joint)))
        clutch%slip_unit = trim(merge("rad/s", "m/s  ", turns_at_teeth(joint)))
        call add_event_of_whole(clutch, scene)
        clutch%event = size(scene%event)
        clutch%lead = size(scene%clutch) + 1
        scene%clutch = [scene%clutch, clutch]
    end subroutine add_surfaces

    !> Do wheels turn against each other where teeth or a belt rub, or do surfaces slide: a worm's thread, an open belt's wheels
    !> where they pass each other, a cam? As `is_bare` of `linkdyn_contact` has it.
    pure logical function turns_at_teeth(joint)
        type(joint_spec), intent(in) :: joint

        select case (joint%kind)
        case (joint_gear, joint_rack)
            turns_at_teeth = joint%lead_angle == 0
        case (joint_belt)
            turns_at_teeth = joint%is_turned_over
        case default
            turns_at_teeth = .false.
        end select
    end function turns_at_teeth

    !> Parts have the name of the whole and their own behind a dot.
    subroutine name_part(place, whole, part, name, status)
        type(scene_place), intent(in) :: place
        character(len=*), intent(in) :: whole
        type(held_part), intent(in) :: part
        character(len=*), intent(out) :: name
        type(status_type), intent(inout) :: status

        name = trim(whole)//"."//part%name
        if (len_trim(whole) + 1 + len_trim(part%name) > len(name)) call refuse(place, "holds several parts, whose names "// &
            "follow "//quoted(whole)//" (expected a shorter name)", status)
    end subroutine name_part

    !> What is held together: a clutch for each part, and an event of the name of the whole, which is looked at as such. Where they
    !> rub, they do along one surface.
    subroutine add_parts(place, whole, part, shelf, scene, status)
        type(scene_place), intent(in) :: place
        type(clutch_spec), intent(in) :: whole
        type(held_part), intent(in) :: part(:)
        type(table_shelf), intent(inout) :: shelf
        type(scene_type), intent(inout) :: scene
        type(status_type), intent(inout) :: status
        type(clutch_spec) :: clutch
        integer :: k, first

        first = size(scene%clutch) + 1
        call add_event_of_whole(whole, scene)
        do k = 1, size(part)
            clutch = whole
            call name_part(place, whole%name, part(k), clutch%name, status)
            if (.not. status%is_ok()) return
            clutch%joint(1) = part(k)%place%joint
            clutch%variable(1) = part(k)%place%variable
            clutch%unit = part(k)%of_force%unit(:4)
            clutch%slip_unit = trim(part(k)%of_place%unit)//"/s"
            clutch%event = size(scene%event)
            clutch%lead = first
            if (clutch%is_positive) clutch%lead = size(scene%clutch) + 1   ! each holds what it has to
            call add_place_measure(scene, part(k)%place, 0.0_wp, .false., shelf, clutch%measure(1))
            scene%clutch = [scene%clutch, clutch]
        end do
    end subroutine add_parts

    !> An event without a formula of its own, of the clutches that come next.
    subroutine add_event_of_whole(whole, scene)
        type(clutch_spec), intent(in) :: whole
        type(scene_type), intent(inout) :: scene
        type(event_spec) :: event

        event%name = whole%name
        event%line = whole%line
        event%clutch = size(scene%clutch) + 1
        call add_node(event%formula, formula_node(node_number, number=1.0_wp))
        scene%event = [scene%event, event]
    end subroutine add_event_of_whole

    !> The slip as an event, and the joint variables measured.
    subroutine add_slip(clutch, shelf, scene)
        type(clutch_spec), intent(inout) :: clutch
        type(table_shelf), intent(inout) :: shelf
        type(scene_type), intent(inout) :: scene
        type(event_spec) :: event
        integer :: k, rate(2)

        do k = 1, clutch%n_side
            call add_joint_measure(scene, clutch%joint(k), clutch%variable(k), 0.0_wp, .false., shelf, clutch%measure(k))
            call add_joint_measure(scene, clutch%joint(k), clutch%variable(k), 0.0_wp, .true., shelf, rate(k))
        end do
        event%name = clutch%name
        event%line = clutch%line
        event%clutch = size(scene%clutch) + 1
        clutch%lead = event%clutch
        call add_node(event%formula, formula_node(node_symbol, a=rate(1)))
        if (clutch%n_side == 2) then
            call add_node(event%formula, formula_node(node_symbol, a=rate(2)))
            call add_node(event%formula, formula_node(node_number, number=clutch%ratio))
            call add_node(event%formula, formula_node(node_multiply, a=3, b=2))
            call add_node(event%formula, formula_node(node_subtract, a=1, b=4))
        end if
        clutch%event = size(scene%event) + 1
        scene%event = [scene%event, event]
        scene%clutch = [scene%clutch, clutch]
    end subroutine add_slip
end module linkdyn_scene_clutches
