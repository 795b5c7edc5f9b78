!> Ready-made chains of a scene file: [[chain]] tables turned into links, joints and actuators.
!>
!> `UPS` legs: a universal joint at the base, a slide, a spherical joint at the platform. Origin of the
!> lower link at the universal joint, of the upper one at the spherical joint; z of both along the leg.
module linkdyn_scene_chain
    use linkdyn_kinds, only: wp
    use linkdyn_status, only: status_type
    use linkdyn_text, only: to_text, quoted
    use linkdyn_scene, only: scene_type, link_spec, joint_spec, marker_spec, name_len, frame_link, &
        joint_universal, joint_prismatic, joint_spherical
    use linkdyn_toml, only: toml_node, toml_array, toml_string, toml_table
    use linkdyn_scene_keys, only: scene_place, place_at, refuse, refuse_value, refuse_missing, counted, allow_keys, &
        require_table, direction_of, text_of, get_name, get_word, get_flag, require_name
    use linkdyn_scene_names, only: find_marker
    use linkdyn_scene_links, only: read_mass_properties, new_marker, add_marker
    use linkdyn_scene_joints, only: require_two_links
    use linkdyn_scene_pattern, only: repeated_tables, list_repeated, repeated_at, pattern_type, read_pattern
    implicit none (type, external)
    private
    public :: count_legs, read_chains

contains

    !> Number of legs of all chains, for the scene's lists.
    subroutine count_legs(root, planar, n_leg, status)
        type(scene_place), intent(in) :: root
        logical, intent(in) :: planar
        integer, intent(out) :: n_leg
        type(status_type), intent(inout) :: status
        type(repeated_tables) :: tables
        type(scene_place) :: place
        integer :: i

        n_leg = 0
        call list_repeated(root, "chain", planar, .true., tables, status)
        if (.not. status%is_ok()) return
        do i = 1, size(tables%table)
            place = repeated_at(root, tables, i, "chain")
            n_leg = n_leg + n_marker(place%node%get("base"))
        end do
    end subroutine count_legs

    !> Expand the chains behind the links and joints that the scene file names itself.
    subroutine read_chains(root, first_link, first_joint, scene, driven, status)
        type(scene_place), intent(in) :: root
        integer, intent(in) :: first_link, first_joint !! first free places in the scene's lists
        type(scene_type), intent(inout) :: scene
        integer, allocatable, intent(out) :: driven(:) !! joints that chains drive
        type(status_type), intent(inout) :: status
        type(repeated_tables) :: tables
        type(scene_place) :: place
        integer :: i, next_link, next_joint

        allocate (driven(0))
        next_link = first_link
        next_joint = first_joint
        call list_repeated(root, "chain", scene%planar, .true., tables, status)
        do i = 1, size(tables%table)
            place = repeated_at(root, tables, i, "chain")
            call read_chain(place, next_link, next_joint, scene, driven, status)
            if (.not. status%is_ok()) return
        end do
    end subroutine read_chains

    subroutine read_chain(place, next_link, next_joint, scene, driven, status)
        type(scene_place), intent(inout) :: place
        integer, intent(inout) :: next_link, next_joint
        type(scene_type), intent(inout) :: scene
        integer, allocatable, intent(inout) :: driven(:)
        type(status_type), intent(inout) :: status
        character(len=name_len) :: chain_name
        character(len=name_len), allocatable :: names(:)
        type(toml_node) :: base, platform
        logical :: is_driven, found
        integer :: kind, i

        chain_name = "leg"
        if (place%copy > 0) chain_name = "leg"//to_text(place%copy)
        call get_name(place, "name", chain_name, status, found)
        if (.not. status%is_ok()) return
        place%what = "chain "//quoted(chain_name)
        call allow_keys(place, [character(len=8) :: "type", "name", "names", "base", "platform", "axis", "lower", &
            "upper", "actuated"], status)
        call get_word(place, "type", ["UPS"], kind, status)
        if (status%is_ok() .and. scene%planar) call refuse(place, &
            "a UPS chain does not exist in a plane (expected space = ""spatial"")", status)
        base = marker_list(place, "base", -1, status)
        platform = marker_list(place, "platform", n_marker(base), status)
        call leg_names(place, chain_name, n_marker(base), names, status)
        is_driven = .true.
        call get_flag(place, "actuated", is_driven, status)
        do i = 1, n_marker(base)
            if (.not. status%is_ok()) return
            call read_leg(place, i, trim(names(i)), base, platform, next_link, next_joint, scene, status)
            if (is_driven) driven = [driven, next_joint + 1]
            next_link = next_link + 2
            next_joint = next_joint + 3
        end do
    end subroutine read_chain

    !> The list of markers under `base` or `platform`, one a leg.
    type(toml_node) function marker_list(place, key, n_leg, status) result(list)
        type(scene_place), intent(in) :: place
        character(len=*), intent(in) :: key
        integer, intent(in) :: n_leg                   !! number expected; -1: any
        type(status_type), intent(inout) :: status

        list = place%node%get(key)
        if (.not. status%is_ok()) return
        if (.not. list%is_present()) then
            call refuse_missing(place, key, "a list of markers, one a leg", status)
        else if (list%kind() == toml_string) then
            if (n_leg > 1) call refuse_value(place, key, list, "is one marker (expected "//to_text(n_leg)//", as many as 'base')", &
                                             status)
        else if (list%kind() /= toml_array) then
            call refuse_value(place, key, list, "is "//list%kind_text()//" (expected a list of markers, one a leg)", status)
        else if (n_leg >= 0 .and. list%count() /= n_leg) then
            call refuse_value(place, key, list, "has "//counted(list%count(), "marker")//" (expected "//to_text(n_leg)// &
                ", as many as 'base')", status)
        else if (list%count() == 0) then
            call refuse_value(place, key, list, "is empty (expected a marker for each leg)", status)
        end if
    end function marker_list

    !> Markers in a list; a name alone is one.
    integer function n_marker(list)
        type(toml_node), intent(in) :: list

        n_marker = list%count()
        if (list%kind() == toml_string) n_marker = 1
    end function n_marker

    !> The i-th of them.
    type(toml_node) function marker_at(list, i) result(marker)
        type(toml_node), intent(in) :: list
        integer, intent(in) :: i

        marker = list%at(i)
        if (list%kind() == toml_string) marker = list
    end function marker_at

    !> Names of the legs: the chain's name and a number, or as the file has them.
    subroutine leg_names(place, chain_name, n_leg, names, status)
        type(scene_place), intent(in) :: place
        character(len=*), intent(in) :: chain_name
        integer, intent(in) :: n_leg
        character(len=name_len), allocatable, intent(out) :: names(:)
        type(status_type), intent(inout) :: status
        character(len=*), parameter :: longest_suffix = ".lower"
        character(len=:), allocatable :: text
        type(toml_node) :: list, item
        logical :: is_text
        integer :: i

        allocate (names(n_leg))
        if (.not. status%is_ok()) return
        list = place%node%get("names")
        if (list%is_present() .and. list%count() /= n_leg) call refuse_value(place, "names", list, "has "// &
            counted(list%count(), "element")//" (expected "//to_text(n_leg)//", one a leg)", status)
        do i = 1, n_leg
            text = trim(chain_name)//to_text(i)
            if (place%copy > 0 .and. n_leg == 1) text = trim(chain_name)
            if (list%is_present()) then
                item = list%at(i)
                call text_of(place, item, text, is_text)
                if (.not. is_text) call refuse_value(place, "names", list, "holds "//item%kind_text()// &
                    " (expected names in quotes)", status)
            end if
            call require_name(place, text//longest_suffix, list%line(), status)
            names(i) = text
        end do
    end subroutine leg_names

    !> One leg: links lower and upper, joints U, P and S.
    subroutine read_leg(place, i, name, base, platform, link, joint, scene, status)
        type(scene_place), intent(in) :: place
        integer, intent(in) :: i                       !! number of the leg
        character(len=*), intent(in) :: name
        type(toml_node), intent(in) :: base, platform  !! lists of markers
        integer, intent(in) :: link, joint             !! where the leg's own begin
        type(scene_type), intent(inout) :: scene
        type(status_type), intent(inout) :: status
        real(wp), parameter :: origin(3) = 0, y_axis(3) = [0, 1, 0], z_axis(3) = [0, 0, 1]
        real(wp) :: axis(3), at(3)
        integer :: base_link, base_marker, top_link, top_marker

        call find_marker(scene, place, "base", marker_at(base, i), base_link, base_marker, status)
        call find_marker(scene, place, "platform", marker_at(platform, i), top_link, top_marker, status)
        call require_two_links(place, "platform", marker_at(platform, i), scene, [base_link, top_link], status)
        call read_axis(place, i, axis, status)
        call read_leg_link(place, "lower", i, name, scene%link(link), status)
        call read_leg_link(place, "upper", i, name, scene%link(link + 1), status)
        if (.not. status%is_ok()) return

        call add_marker(scene%link(link), new_marker("U", origin, y_axis, place%line))
        call add_marker(scene%link(link), new_marker("P", origin, z_axis, place%line))
        call add_marker(scene%link(link + 1), new_marker("P", origin, z_axis, place%line))
        call add_marker(scene%link(link + 1), new_marker("S", origin, z_axis, place%line))
        ! Legs may share a point of the base and yet differ in their axes: each brings its own marker.
        if (base_link == frame_link) then
            at = scene%frame%marker(base_marker)%at
            call add_marker(scene%frame, new_marker(name//".U", at, axis, place%line))
            base_marker = size(scene%frame%marker)
        else
            at = scene%link(base_link)%marker(base_marker)%at
            call add_marker(scene%link(base_link), new_marker(name//".U", at, axis, place%line))
            base_marker = size(scene%link(base_link)%marker)
        end if

        scene%joint(joint) = joint_spec(name=name//".U", kind=joint_universal, line=place%line, &
            link=[base_link, link], marker=[base_marker, 1])
        scene%joint(joint + 1) = joint_spec(name=name//".P", kind=joint_prismatic, line=place%line, &
            link=[link, link + 1], marker=[2, 1])
        scene%joint(joint + 2) = joint_spec(name=name//".S", kind=joint_spherical, line=place%line, &
            link=[link + 1, top_link], marker=[2, top_marker])
    end subroutine read_leg

    !> First axis of the universal joint of leg i: one for all, or one a leg.
    subroutine read_axis(place, i, axis, status)
        type(scene_place), intent(in) :: place
        integer, intent(in) :: i
        real(wp), intent(out) :: axis(3)
        type(status_type), intent(inout) :: status
        type(toml_node) :: node, base, item
        type(pattern_type) :: pattern

        axis = [0, 1, 0]
        if (.not. status%is_ok()) return
        node = place%node%get("axis")
        base = place%node%get("base")
        item = node%at(1)
        if (.not. node%is_present()) then
            call refuse_missing(place, "axis", "the universal joint's first axis in the base link, [0, 1, 0]", status)
        else if (item%kind() /= toml_array) then
            call direction_of(place, "axis", node, axis, status)
        else if (node%count() /= n_marker(base)) then
            call refuse_value(place, "axis", node, "has "//to_text(node%count())//" axes (expected one, or "// &
                to_text(n_marker(base))//", one a leg)", status)
        else
            call direction_of(place, "axis", node%at(i), axis, status)
        end if
        if (place%copy == 0) return
        call read_pattern(place, .false., .true., pattern, status)
        if (status%is_ok()) axis = matmul(pattern%turn(:, :, place%copy), axis)
    end subroutine read_axis

    !> Mass properties of one half of leg i: one table for all, or one a leg.
    subroutine read_leg_link(place, key, i, leg_name, link, status)
        type(scene_place), intent(in) :: place
        character(len=*), intent(in) :: key            !! lower or upper
        integer, intent(in) :: i
        character(len=*), intent(in) :: leg_name
        type(link_spec), intent(inout) :: link
        type(status_type), intent(inout) :: status
        character(len=*), parameter :: expected = "{ mass = .., cog = [..], inertia = [..] }"
        type(scene_place) :: inner
        type(toml_node) :: node, base

        if (.not. status%is_ok()) return
        link%name = leg_name//"."//key
        link%line = place%line
        node = place%node%get(key)
        base = place%node%get("base")
        if (.not. node%is_present()) then
            call refuse_missing(place, key, expected//", or { mass = 0 }", status)
            return
        end if
        if (node%kind() == toml_array) then
            if (node%count() /= n_marker(base)) then
                call refuse_value(place, key, node, "has "//counted(node%count(), "element")//" (expected one table, or "// &
                    to_text(n_marker(base))//", one a leg)", status)
                return
            end if
            node = node%at(i)
        end if
        inner = place_at(place, node, "link "//quoted(link%name))
        call require_table(inner, "a table, "//expected, status)
        call allow_keys(inner, [character(len=13) :: "mass", "cog", "inertia", "inertia_check"], status)
        call read_mass_properties(inner, .false., link, status)
    end subroutine read_leg_link
end module linkdyn_scene_chain
