!> From names in a scene file to indices, and the refusal of names that are not there or twice there.
module linkdyn_scene_names
    use linkdyn_status, only: status_type
    use linkdyn_text, only: quoted
    use linkdyn_scene, only: scene_type, link_spec, name_len, frame_link, joint_n_variable, joint_kind_name, variable_name, &
        n_holding
    use linkdyn_toml, only: toml_node
    use linkdyn_suggest, only: suggestion
    use linkdyn_scene_keys, only: scene_place, line_text, refuse, refuse_value, refuse_missing, get_name, text_of
    implicit none (type, external)
    private
    public :: find_marker, find_link, find_joint, find_variable, refuse_double_links, refuse_double_joints
    public :: no_index, unnamed_chain

    integer, parameter :: no_index = -1            !! of what was not found
    character(len=*), parameter :: unnamed_chain = "leg"    !! what a chain without name is called

contains

    !> Link and marker of a text "link.marker"; both names may hold dots.
    subroutine find_marker(scene, place, key, node, link, marker, status)
        type(scene_type), intent(in) :: scene
        type(scene_place), intent(in) :: place
        character(len=*), intent(in) :: key
        type(toml_node), intent(in) :: node
        integer, intent(out) :: link, marker
        type(status_type), intent(inout) :: status
        character(len=:), allocatable :: text
        logical :: is_text
        integer :: dot, known_link, last_dot

        link = no_index
        marker = no_index
        if (.not. status%is_ok()) return
        call text_of(place, node, text, is_text)
        if (.not. is_text) then
            call refuse_value(place, key, node, "is "//node%kind_text()//" (expected a marker, ""link.marker"")", status)
            return
        end if
        known_link = no_index
        last_dot = 0
        do dot = len(text), 1, -1
            if (text(dot:dot) /= ".") cycle
            if (last_dot == 0) last_dot = dot
            link = link_index(scene, text(:dot - 1))
            if (link == no_index) cycle
            if (known_link == no_index) known_link = link
            if (link == frame_link) then
                marker = marker_index(scene%frame, text(dot + 1:))
            else
                marker = marker_index(scene%link(link), text(dot + 1:))
            end if
            if (marker > 0) return
        end do
        if (last_dot == 0) then
            call refuse_value(place, key, node, "= "//quoted(text)//" names no marker (expected ""link.marker"")", status)
        else if (known_link == no_index) then
            call refuse_value(place, key, node, "= "//quoted(text)//": there is no link "//quoted(text(:last_dot - 1)) &
                //" (expected ""link.marker"")"//suggestion(text(:last_dot - 1), link_names(scene)), status)
        else if (known_link == frame_link) then
            call refuse_no_marker(scene%frame)
        else
            call refuse_no_marker(scene%link(known_link))
        end if

    contains

        subroutine refuse_no_marker(owner)
            type(link_spec), intent(in) :: owner
            character(len=:), allocatable :: name

            name = text(len_trim(owner%name) + 2:)
            call refuse_value(place, key, node, "= "//quoted(text)//": link "//quoted(owner%name)//" has no marker " &
                //quoted(name)//" (expected the name of one of its markers)"//suggestion(name, marker_names(owner)), status)
        end subroutine refuse_no_marker
    end subroutine find_marker

    !> The link whose name stands under a key.
    subroutine find_link(scene, place, key, link, status)
        type(scene_type), intent(in) :: scene
        type(scene_place), intent(in) :: place
        character(len=*), intent(in) :: key
        integer, intent(out) :: link
        type(status_type), intent(inout) :: status
        character(len=name_len) :: name

        link = no_index
        name = ""
        call get_name(place, key, name, status)
        if (.not. status%is_ok()) return
        link = link_index(scene, name)
        if (link == no_index) call refuse_value(place, key, place%node%get(key), "= "//quoted(name)// &
            ": there is no such link (expected the name of a link)"//suggestion(name, link_names(scene)), status)
    end subroutine find_link

    !> The joint whose name stands under the key `joint`.
    subroutine find_joint(scene, place, joint, status, key)
        type(scene_type), intent(in) :: scene
        type(scene_place), intent(in) :: place
        integer, intent(out) :: joint
        type(status_type), intent(inout) :: status
        character(len=*), intent(in), optional :: key  !! absent: 'joint'
        character(len=name_len) :: name
        character(len=:), allocatable :: its_key
        integer :: i

        joint = no_index
        name = ""
        its_key = "joint"
        if (present(key)) its_key = key
        call get_name(place, its_key, name, status)
        if (.not. status%is_ok()) return
        do i = 1, n_holding(scene)
            if (scene%joint(i)%name == name) joint = i
        end do
        if (joint == no_index) call refuse_value(place, its_key, place%node%get(its_key), "= "//quoted(name)// &
            ": there is no such joint (expected the name of a joint)"//nearest_joint(name, scene%joint(:n_holding(scene))%name), &
            status)
    end subroutine find_joint

    !> The joints of a chain of that name, else the name that is nearest.
    function nearest_joint(name, names) result(hint)
        character(len=*), intent(in) :: name, names(:)
        character(len=:), allocatable :: hint
        integer :: i

        hint = ""
        do i = 1, size(names)
            if (index(names(i), trim(name)//".") == 1) hint = hint//", "//quoted(names(i))
        end do
        if (hint == "") then
            hint = suggestion(name, names)
        else
            hint = "; "//quoted(name)//" is a chain with the joints "//hint(3:)
        end if
    end function nearest_joint

    !> The variable of a joint that the key `variable` names; a joint with one needs no key.
    subroutine find_variable(scene, place, joint, variable, status, key)
        type(scene_type), intent(in) :: scene
        type(scene_place), intent(in) :: place
        integer, intent(in) :: joint
        integer, intent(out) :: variable
        type(status_type), intent(inout) :: status
        character(len=*), intent(in), optional :: key  !! absent: 'variable'
        character(len=name_len) :: name
        character(len=:), allocatable :: its_key
        character(len=len(variable_name)), allocatable :: names(:)
        character(len=:), allocatable :: expected
        logical :: found
        integer :: i

        variable = 1
        if (.not. status%is_ok()) return
        names = variable_name(:joint_n_variable(scene%joint(joint)%kind), scene%joint(joint)%kind)
        if (size(names) == 0) then
            call refuse_value(place, "joint", place%node%get("joint"), "names a "// &
                trim(joint_kind_name(scene%joint(joint)%kind))//" joint, which has no variables (expected a joint that moves)", &
                status)
            return
        end if
        expected = quoted(names(1))
        do i = 2, size(names)
            expected = expected//" or "//quoted(names(i))
        end do
        name = ""
        its_key = "variable"
        if (present(key)) its_key = key
        call get_name(place, its_key, name, status, found)
        if (.not. status%is_ok()) return
        if (.not. found) then
            if (size(names) > 1) call refuse_missing(place, its_key, expected//": joint "// &
                quoted(scene%joint(joint)%name)//" has several", status)
            return
        end if
        do variable = 1, size(names)
            if (names(variable) == name) return
        end do
        variable = 1
        call refuse_value(place, its_key, place%node%get(its_key), "= "//quoted(name)//" is no variable of joint "// &
            quoted(scene%joint(joint)%name)//" (expected "//expected//")", status)
    end subroutine find_variable

    !> Two links of one name, be they written down or made by a chain.
    subroutine refuse_double_links(root, scene, status)
        type(scene_place), intent(in) :: root
        type(scene_type), intent(in) :: scene
        type(status_type), intent(inout) :: status

        call refuse_doubles(root, "link", (scene%link%name), (scene%link%line), status)
    end subroutine refuse_double_links

    !> Two joints of one name.
    subroutine refuse_double_joints(root, scene, status)
        type(scene_place), intent(in) :: root
        type(scene_type), intent(in) :: scene
        type(status_type), intent(inout) :: status

        call refuse_doubles(root, "joint", (scene%joint%name), (scene%joint%line), status)
    end subroutine refuse_double_joints

    subroutine refuse_doubles(root, what, names, lines, status)
        type(scene_place), intent(in) :: root
        character(len=*), intent(in) :: what
        character(len=*), intent(in) :: names(:)
        integer, intent(in) :: lines(:)
        type(status_type), intent(inout) :: status
        type(scene_place) :: place
        integer :: i, j

        if (.not. status%is_ok()) return
        do i = 2, size(names)
            do j = 1, i - 1
                if (names(i) /= names(j)) cycle
                place = root
                place%what = what//" "//quoted(names(i))
                place%line = lines(i)
                call refuse(place, "there is another "//what//" of that name on "//line_text(place, lines(j), lines(i))// &
                    " (expected a name of its own)", status)
                return
            end do
        end do
    end subroutine refuse_doubles

    pure integer function link_index(scene, name)
        type(scene_type), intent(in) :: scene
        character(len=*), intent(in) :: name
        integer :: i

        link_index = no_index
        if (name == "frame") link_index = frame_link
        do i = 1, size(scene%link)
            if (scene%link(i)%name == name) then
                link_index = i
                return
            end if
        end do
    end function link_index

    pure integer function marker_index(link, name)
        type(link_spec), intent(in) :: link
        character(len=*), intent(in) :: name
        integer :: i

        marker_index = no_index
        if (len(name) == 0) return
        do i = 1, size(link%marker)
            if (link%marker(i)%name == name) marker_index = i
        end do
    end function marker_index

    pure function link_names(scene) result(names)
        type(scene_type), intent(in) :: scene
        character(len=name_len), allocatable :: names(:)

        allocate (names(size(scene%link) + 1))
        names(1) = "frame"
        names(2:) = scene%link%name
    end function link_names

    pure function marker_names(link) result(names)
        type(link_spec), intent(in) :: link
        character(len=name_len), allocatable :: names(:)

        allocate (names(size(link%marker)))
        names = link%marker%name
    end function marker_names
end module linkdyn_scene_names
