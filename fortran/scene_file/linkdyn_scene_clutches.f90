!> The tables [[clutch]] of a scene file: clutches, brakes and locks of joint variables, in forward runs.
!>
!> A clutch is an event besides, whose formula is its slip.
module linkdyn_scene_clutches
    use linkdyn_formula, only: formula_node, add_node, node_number, node_symbol, node_subtract, node_multiply
    use linkdyn_joint_table, only: joint_revolute, joint_prismatic, joint_cylindrical, joint_screw, joint_universal, &
        joint_spherical, joint_planar, joint_n_variable, variable_name
    use linkdyn_kinds, only: wp
    use linkdyn_scene, only: scene_type, event_spec, clutch_spec, friction_spec, joint_kind_name
    use linkdyn_scene_brakes, only: read_switch, find_switch_event, switch_key
    use linkdyn_scene_forces, only: force_quantity
    use linkdyn_scene_joints, only: variable_quantity
    use linkdyn_scene_keys, only: scene_place, refuse, refuse_value, allow_keys, get_quantity, get_name
    use linkdyn_scene_laws, only: table_shelf
    use linkdyn_scene_names, only: find_joint, find_variable
    use linkdyn_scene_pattern, only: repeated_tables, list_repeated, repeated_at
    use linkdyn_scene_state_laws, only: add_joint_measure, read_force_law
    use linkdyn_status, only: status_type
    use linkdyn_text, only: to_text, quoted
    use linkdyn_toml, only: toml_node
    use linkdyn_units, only: quantity_type, plain_number
    implicit none (type, external)
    private
    public :: read_clutches, add_sticking

    character(len=*), parameter :: joint_key(2) = [character(len=5) :: "joint", "to"]
    character(len=*), parameter :: about_axis(3) = ["x", "y", "z"]
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
            call read_clutch(place, shelf, scene, clutch, status)
            if (.not. status%is_ok()) return
            call add_slip(clutch, shelf, scene)
        end do
    end subroutine read_clutches

    subroutine read_clutch(place, shelf, scene, clutch, status)
        type(scene_place), intent(in) :: place
        type(table_shelf), intent(inout) :: shelf
        type(scene_type), intent(in) :: scene
        type(clutch_spec), intent(inout) :: clutch
        type(status_type), intent(inout) :: status
        type(quantity_type) :: quantity
        type(toml_node) :: node
        logical :: has_ratio, has_static

        call allow_keys(place, [character(len=11) :: "name", joint_key, variable_key, "ratio", "capacity", "static", &
                                switch_key], status)
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
        call read_switch(place, clutch%switch_spec, status)
        call find_switch_event(place, scene, "from_event", clutch%from_name, clutch%line, clutch%from_event, status)
        call find_switch_event(place, scene, "until_event", clutch%until_name, clutch%line, clutch%until_event, status)
    end subroutine read_clutch

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
            call find_variable(scene, place, clutch%joint(k), clutch%variable(k), status, trim(variable_key(k)))
            if (.not. status%is_ok()) return
            associate (joint => scene%joint(clutch%joint(k)))
                if (all(joint%kind /= [joint_revolute, joint_prismatic, joint_cylindrical, joint_screw])) then
                    call refuse_value(place, trim(joint_key(k)), place%node%get(trim(joint_key(k))), "is a "// &
                        trim(joint_kind_name(joint%kind))//" joint (expected a revolute, prismatic, cylindrical or screw joint)", &
                        status)
                    return
                end if
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

    !> Friction that sticks is a clutch, which has the joint's name; of joints with several variables one for each, with the name of that
    !> behind a dot. Where they rub along one surface they go together, and have one event, of the joint's name.
    subroutine add_sticking(place, friction, number, shelf, scene, status)
        type(scene_place), intent(in) :: place
        type(friction_spec), intent(in) :: friction
        integer, intent(in) :: number                  !! of the friction
        type(table_shelf), intent(inout) :: shelf
        type(scene_type), intent(inout) :: scene
        type(status_type), intent(inout) :: status
        type(clutch_spec) :: clutch
        type(quantity_type) :: quantity
        character(len=len(variable_name)) :: part
        integer :: k, n, first

        first = size(scene%clutch) + 1
        associate (joint => scene%joint(friction%joint))
            n = joint_n_variable(joint%kind)
            if (joint%kind == joint_planar .and. .not. friction%radius > 0) n = 2  ! nothing keeps its plate from turning
            do k = 1, n
                part = variable_name(k, joint%kind)
                if (joint%kind == joint_spherical) part = about_axis(k)
                if (n == 1) then
                    clutch%name = joint%name
                else if (len_trim(joint%name) + 1 + len_trim(part) > len(clutch%name)) then
                    call refuse(place, "sticks along several variables, whose names follow that of the joint (expected a "// &
                        "shorter one)", status)
                    return
                else
                    clutch%name = trim(joint%name)//"."//part
                end if
                clutch%joint(1) = friction%joint
                clutch%variable(1) = k
                clutch%friction = number
                clutch%is_positive = .false.
                clutch%line = friction%line
                quantity = force_quantity(joint%kind, k)
                clutch%unit = quantity%unit(:4)
                quantity = variable_quantity(joint%kind, k)
                clutch%slip_unit = trim(quantity%unit)//"/s"
                if (n == 1 .or. joint%kind == joint_universal) then
                    call refuse_taken(clutch%name)
                    if (status%is_ok()) call add_slip(clutch, shelf, scene)
                else
                    if (k == 1) call refuse_taken(joint%name)
                    if (status%is_ok()) call add_part(clutch, joint%name, first, shelf, scene)
                end if
                if (.not. status%is_ok()) return
            end do
        end associate

    contains

        subroutine refuse_taken(name)
            character(len=*), intent(in) :: name

            if (any(scene%event%name == name)) call refuse(place, "sticks, and its events have the name "//quoted(name)// &
                ", which another event or clutch has (expected another name of that)", status)
        end subroutine refuse_taken
    end subroutine add_sticking

    !> One of several joint variables that slip as one: the first has the event, which is looked at as a whole.
    subroutine add_part(clutch, name, first, shelf, scene)
        type(clutch_spec), intent(inout) :: clutch
        character(len=*), intent(in) :: name           !! of the joint
        integer, intent(in) :: first                   !! of these clutches
        type(table_shelf), intent(inout) :: shelf
        type(scene_type), intent(inout) :: scene
        type(event_spec) :: event

        call add_joint_measure(scene, clutch%joint(1), clutch%variable(1), 0.0_wp, .false., shelf, clutch%measure(1))
        clutch%lead = first
        if (first == size(scene%clutch) + 1) then
            event%name = name
            event%line = clutch%line
            event%clutch = first
            call add_node(event%formula, formula_node(node_number, number=1.0_wp))
            scene%event = [scene%event, event]
        end if
        clutch%event = size(scene%event)
        scene%clutch = [scene%clutch, clutch]
    end subroutine add_part

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
