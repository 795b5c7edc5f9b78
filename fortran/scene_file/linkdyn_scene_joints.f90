!> Joints of a scene file.
module linkdyn_scene_joints
    use linkdyn_joint_table, only: n_joint_kind, joint_in_plane, is_slide, is_threaded, is_geared, joint_prismatic, joint_cam
    use linkdyn_status, only: status_type
    use linkdyn_text, only: to_text, quoted, join
    use linkdyn_scene, only: share_by_stiffness, scene_type, joint_spec, frame_link, joint_kind_name, joint_n_variable, &
        variable_name
    use linkdyn_toml, only: toml_node, toml_array, toml_table
    use linkdyn_units, only: quantity_type, length, angle, stiffness, angular_stiffness
    use linkdyn_scene_keys, only: scene_place, place_at, refuse_value, refuse_missing, allow_keys, get_quantity, get_vector, &
        quantity_of, get_name, get_word, get_integer
    use linkdyn_scene_cams, only: read_cam, cam_key
    use linkdyn_scene_gears, only: read_wheels, gear_key
    use linkdyn_scene_laws, only: table_shelf
    use linkdyn_scene_names, only: find_marker
    use linkdyn_scene_pattern, only: repeated_tables, list_repeated, repeated_at
    use linkdyn_scene_slots, only: joint_word, slot_word, split_slot
    implicit none (type, external)
    private
    public :: read_joints, require_two_links, variable_quantity, start_of_joint, stiffness_of_joint

contains

    !> The tables [[joint]] into the first places of `scene%joint`.
    subroutine read_joints(root, first_block, first_pin, shelf, scene, status)
        type(scene_place), intent(in) :: root
        integer, intent(in) :: first_block             !! among the links, of the blocks that slots have
        integer, intent(in) :: first_pin               !! among the joints, of their hinges
        type(table_shelf), intent(inout) :: shelf
        type(scene_type), intent(inout) :: scene       !! %joint allocated for these, for the chains and the slots
        type(status_type), intent(inout) :: status
        type(repeated_tables) :: tables
        type(scene_place) :: place
        logical :: is_slot
        integer :: i, n_slot

        call list_repeated(root, "joint", scene%planar, .false., tables, status)
        n_slot = 0
        do i = 1, size(tables%table)
            place = repeated_at(root, tables, i, "joint")
            call read_joint(place, scene, shelf, scene%joint(i), is_slot, status)
            if (.not. status%is_ok()) return
            if (.not. is_slot) cycle
            call split_slot(first_block + n_slot, scene%planar, scene%joint(i), scene%joint(first_pin + n_slot))
            n_slot = n_slot + 1
        end do
    end subroutine read_joints

    subroutine read_joint(place, scene, shelf, joint, is_slot, status)
        type(scene_place), intent(inout) :: place
        type(scene_type), intent(in) :: scene
        type(table_shelf), intent(inout) :: shelf
        type(joint_spec), intent(out) :: joint
        logical, intent(out) :: is_slot                !! read as a slide, its block left out
        type(status_type), intent(inout) :: status
        character(len=*), parameter :: expected = "two markers, [""link1.marker"", ""link2.marker""]"
        type(toml_node) :: between
        logical :: found
        integer :: i

        joint%line = place%line
        call get_name(place, "name", joint%name, status)
        if (.not. status%is_ok()) return
        place%what = "joint "//quoted(joint%name)
        call allow_keys(place, [character(len=14) :: "name", "type", "between", "start", "branch", "lead", &
                                "stiffness", "misfit", gear_key, cam_key], status)
        call get_word(place, "type", joint_word, joint%kind, status)
        is_slot = joint%kind == slot_word
        if (.not. status%is_ok()) return
        if (is_slot) then
            joint%kind = joint_prismatic
            call allow_keys(place, [character(len=7) :: "name", "type", "between", "start", "branch"], status)
        else if (scene%planar .and. .not. joint_in_plane(joint%kind)) then
            call refuse_value(place, "type", place%node%get("type"), "= "//quoted(joint_kind_name(joint%kind))// &
                " does not exist in a plane (expected one of "// &
                join([pack(joint_kind_name(:n_joint_kind), joint_in_plane), joint_word(slot_word:)])//")", status)
        end if
        if (.not. status%is_ok()) return
        call read_lead(place, joint, status)
        call read_wheels(place, scene%planar, joint, status)
        call read_cam(place, scene%planar, shelf, joint, status)
        between = place%node%get("between")
        if (.not. between%is_present()) then
            call refuse_missing(place, "between", expected, status)
        else if (between%kind() /= toml_array) then
            call refuse_value(place, "between", between, "is "//between%kind_text()//" (expected "//expected//")", status)
        else if (between%count() /= 2) then
            call refuse_value(place, "between", between, "has "//to_text(between%count())// &
                " elements (expected "//expected//")", status)
        end if
        do i = 1, 2
            call find_marker(scene, place, "between", between%at(i), joint%link(i), joint%marker(i), status)
        end do
        call require_two_links(place, "between", between, scene, joint%link, status)
        call start_of_joint(place, place%node%get("start"), joint, status)
        call stiffness_of_joint(place, place%node%get("stiffness"), scene, joint, status)
        call read_misfit(place, scene, joint, status)
        call get_integer(place, "branch", joint%branch, status, found)
        if (.not. status%is_ok() .or. .not. found) return
        if (abs(joint%branch) /= 1) call refuse_value(place, "branch", place%node%get("branch"), &
            "= "//to_text(joint%branch)//" (expected 1 or -1)", status)
    end subroutine read_joint

    !> How far a screw goes in a turn.
    subroutine read_lead(place, joint, status)
        type(scene_place), intent(in) :: place
        type(joint_spec), intent(inout) :: joint
        type(status_type), intent(inout) :: status
        character(len=*), parameter :: expected = "the way that the screw goes in a turn, for example '5 mm'"
        type(toml_node) :: node
        logical :: found

        if (.not. status%is_ok()) return
        node = place%node%get("lead")
        if (.not. is_threaded(joint%kind)) then
            if (node%is_present()) call refuse_value(place, "lead", node, "has no meaning here: a "// &
                trim(joint_kind_name(joint%kind))//" joint has no thread", status)
            return
        end if
        call get_quantity(place, "lead", length, joint%lead, status, found)
        if (.not. status%is_ok()) return
        if (.not. found) call refuse_missing(place, "lead", expected, status)
        if (status%is_ok() .and. joint%lead == 0) call refuse_value(place, "lead", node, "= 0 (expected "//expected// &
            ", negative for a left-handed one)", status)
    end subroutine read_lead

    !> How a joint gives way along the directions that it holds: the rest is rigid.
    subroutine stiffness_of_joint(place, node, scene, joint, status)
        type(scene_place), intent(in) :: place
        type(toml_node), intent(in) :: node                !! what its key `stiffness` says
        type(scene_type), intent(in) :: scene
        type(joint_spec), intent(inout) :: joint
        type(status_type), intent(inout) :: status
        character(len=10), parameter :: of_joint(4) = [character(len=10) :: "radial", "axial", "tilt", "torsion"], &
            of_gear(1) = [character(len=10) :: "tangential"]
        character(len=10), allocatable :: key(:)
        type(scene_place) :: inner
        logical :: found
        integer :: i

        if (.not. status%is_ok() .or. .not. node%is_present()) return
        key = of_joint
        if (is_geared(joint%kind)) key = of_gear
        if (scene%redundancy /= share_by_stiffness) then
            call refuse_value(place, "stiffness", node, "has no meaning here: it is for scenes with redundancy = ""stiffness""", &
                status)
        else if (node%kind() /= toml_table) then
            call refuse_value(place, "stiffness", node, "is "//node%kind_text()//" (expected a table with some of "//join(key)// &
                ", for example { "//trim(key(1))//" = '2e8 N/m' })", status)
        end if
        if (.not. status%is_ok()) return
        inner = place_at(place, node, trim(place%what)//", stiffness")
        call allow_keys(inner, key, status)
        do i = 1, size(key)
            if (i <= 2) call get_quantity(inner, trim(key(i)), stiffness, joint%stiffness(i), status, found)
            if (i > 2) call get_quantity(inner, trim(key(i)), angular_stiffness, joint%stiffness(i), status, found)
            if (.not. status%is_ok() .or. .not. found) cycle
            if (joint%stiffness(i) <= 0) call refuse_value(inner, trim(key(i)), inner%node%get(trim(key(i))), &
                "is not above zero (what is rigid is left out)", status)
        end do
    end subroutine stiffness_of_joint

    !> How far off from its first marker a joint holds the second, as it was made.
    subroutine read_misfit(place, scene, joint, status)
        type(scene_place), intent(in) :: place
        type(scene_type), intent(in) :: scene
        type(joint_spec), intent(inout) :: joint
        type(status_type), intent(inout) :: status
        type(scene_place) :: inner
        type(toml_node) :: node
        logical :: found(2)

        if (.not. status%is_ok()) return
        node = place%node%get("misfit")
        if (.not. node%is_present()) return
        if (scene%redundancy /= share_by_stiffness) then
            call refuse_value(place, "misfit", node, "has no meaning here: it is for scenes with redundancy = ""stiffness""", &
                              status)
        else if (is_geared(joint%kind) .or. joint%kind == joint_cam) then
            call refuse_value(place, "misfit", node, "has no meaning here: a "//trim(joint_kind_name(joint%kind)) &
                              //" joint holds no marker at another", status)
        else if (node%kind() /= toml_table) then
            call refuse_value(place, "misfit", node, "is "//node%kind_text()//" (expected a table with 'shift' or 'turn', " &
                              //"for example { shift = ['0.1 mm', 0"//trim(merge("]   ", ", 0]", scene%planar))//" })", status)
        end if
        if (.not. status%is_ok()) return
        inner = place_at(place, node, trim(place%what)//", misfit")
        call allow_keys(inner, [character(len=5) :: "shift", "turn"], status)
        call get_vector(inner, "shift", length, joint%misfit(:merge(2, 3, scene%planar)), status, found(1))
        if (scene%planar) then
            call get_quantity(inner, "turn", angle, joint%misfit(6), status, found(2))
        else
            call get_vector(inner, "turn", angle, joint%misfit(4:), status, found(2))
        end if
        if (status%is_ok() .and. .not. any(found)) call refuse_missing(inner, "shift", "how far it is off, or 'turn'", status)
    end subroutine read_misfit

    !> A joint, a spring or a leg joins two different links.
    subroutine require_two_links(place, key, node, scene, link, status)
        type(scene_place), intent(in) :: place
        character(len=*), intent(in) :: key
        type(toml_node), intent(in) :: node
        type(scene_type), intent(in) :: scene
        integer, intent(in) :: link(2)
        type(status_type), intent(inout) :: status

        if (.not. status%is_ok() .or. link(1) /= link(2)) return
        if (link(1) == frame_link) then
            call refuse_value(place, key, node, "names two markers of the frame (expected two different links)", status)
        else
            call refuse_value(place, key, node, "names two markers of link "//quoted(scene%link(link(1))%name)// &
                " (expected two different links)", status)
        end if
    end subroutine require_two_links

    !> Joint variables near which closure starts: a number, or a table if the joint has several.
    subroutine start_of_joint(place, node, joint, status)
        type(scene_place), intent(in) :: place
        type(toml_node), intent(in) :: node                !! what its key `start` says
        type(joint_spec), intent(inout) :: joint
        type(status_type), intent(inout) :: status
        type(scene_place) :: inner
        logical :: found
        integer :: i, n

        if (.not. status%is_ok() .or. .not. node%is_present()) return
        joint%has_start = .true.
        n = joint_n_variable(joint%kind)
        if (n == 0) then
            call refuse_value(place, "start", node, "has no meaning here: a "//trim(joint_kind_name(joint%kind))// &
                " joint has no variables", status)
        else if (node%kind() == toml_table) then
            inner = place_at(place, node, trim(place%what)//", start")
            call allow_keys(inner, variable_name(:n, joint%kind), status)
            do i = 1, n
                call get_quantity(inner, trim(variable_name(i, joint%kind)), variable_quantity(joint%kind, i), &
                    joint%start(i), status, found)
            end do
        else if (n == 1) then
            call quantity_of(place, "start", node, variable_quantity(joint%kind, 1), joint%start(1), status)
        else
            call refuse_value(place, "start", node, "is "//node%kind_text()//" (expected a table with some of "// &
                join(variable_name(:n, joint%kind))//")", status)
        end if
    end subroutine start_of_joint

    !> Length or angle: what a joint variable is.
    pure type(quantity_type) function variable_quantity(kind, variable) result(quantity)
        integer, intent(in) :: kind, variable

        quantity = angle
        if (is_slide(kind, variable)) quantity = length
    end function variable_quantity
end module linkdyn_scene_joints
