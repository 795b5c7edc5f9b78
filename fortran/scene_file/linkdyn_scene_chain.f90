!> Ready-made chains of a scene file: [[chain]] tables turned into links, joints and actuators.
!>
!> What kinds there are stands in `linkdyn_chain_kinds`, what a leg is made of in `linkdyn_chain_parts`; here the keys are read.
!> Of legs that are words of joint letters `linkdyn_chain_words` has both.
module linkdyn_scene_chain
    use linkdyn_chain_kinds, only: chain_kind, list_chain_kinds, links_of_leg, joints_of_leg, is_crank_kind, is_rail_kind, &
        is_telescope, drive_of, in_plane, in_space, is_chain_word, kind_of_word
    use linkdyn_chain_parts, only: leg_spec, build_leg
    use linkdyn_chain_words, only: word_key, read_word_leg, read_stiffnesses
    use linkdyn_kinds, only: wp
    use linkdyn_status, only: status_type
    use linkdyn_text, only: to_text, quoted, join
    use linkdyn_scene, only: scene_type, link_spec, name_len, frame_link
    use linkdyn_toml, only: toml_node, toml_array, toml_string
    use linkdyn_scene_keys, only: scene_place, place_at, refuse, refuse_value, refuse_missing, counted, allow_keys, &
        require_table, direction_of, text_of, get_name, get_text, get_flag, get_integer, get_quantity, require_name
    use linkdyn_scene_names, only: find_marker, unnamed_chain
    use linkdyn_scene_elastic, only: read_elastic
    use linkdyn_scene_links, only: read_mass_properties, carried_x
    use linkdyn_scene_joints, only: require_two_links
    use linkdyn_scene_pattern, only: repeated_tables, list_repeated, repeated_at, pattern_type, read_pattern, turned_tensor
    use linkdyn_suggest, only: suggestion
    use linkdyn_units, only: quantity_type, length, angle
    implicit none (type, external)
    private
    public :: count_chain_parts, read_chains

contains

    !> Number of links and joints of all chains, for the scene's lists.
    subroutine count_chain_parts(root, planar, n_link, n_joint, status)
        type(scene_place), intent(in) :: root
        logical, intent(in) :: planar
        integer, intent(out) :: n_link, n_joint
        type(status_type), intent(inout) :: status
        type(repeated_tables) :: tables
        type(scene_place) :: place
        type(chain_kind) :: kind
        type(status_type) :: of_kind
        integer :: i, n_leg

        n_link = 0
        n_joint = 0
        call list_repeated(root, "chain", planar, .true., tables, status)
        if (.not. status%is_ok()) return
        do i = 1, size(tables%table)
            place = repeated_at(root, tables, i, "chain")
            of_kind = status_type()
            call read_kind(place, planar, kind, of_kind)
            if (.not. of_kind%is_ok()) cycle               ! told when the chain is read
            n_leg = n_marker(place%node%get("base"))
            n_link = n_link + links_of_leg(kind)*n_leg
            n_joint = n_joint + joints_of_leg(kind)*n_leg
        end do
    end subroutine count_chain_parts

    !> The key `type`: a kind that the space has, or a word of its joints.
    subroutine read_kind(place, planar, kind, status)
        type(scene_place), intent(in) :: place
        logical, intent(in) :: planar
        type(chain_kind), intent(out) :: kind
        type(status_type), intent(inout) :: status
        type(chain_kind), allocatable :: kinds(:)
        character(len=:), allocatable :: word
        type(toml_node) :: links
        integer :: k

        kinds = list_chain_kinds()
        call get_text(place, "type", word, status)
        if (.not. status%is_ok()) return
        k = findloc(kinds%name == word, .true., dim=1)
        if (k > 0) then
            kind = kinds(k)
            if (kind%space /= merge(in_space, in_plane, planar)) return
        end if
        links = place%node%get("links")
        if (is_chain_word(word, planar) .and. links%is_present()) then
            kind = kind_of_word(word)
        else if (planar .and. (k > 0 .or. is_chain_word(word, .false.)) .and. .not. is_chain_word(word, .true.)) then
            call refuse(place, "a "//word//" chain does not exist in a plane (expected space = ""spatial"")", status)
        else if (k > 0) then
            call refuse(place, "a "//word//" chain exists in a plane only (expected space = ""planar"", or 'axes' and 'links' "// &
                "that draw it in space)", status)
        else
            call refuse_value(place, "type", place%node%get("type"), "= "//quoted(word)//" is unknown (expected one of "// &
                join(kinds%name)//", or a row of two to eight joints with 'links' between them)"// &
                suggestion(word, kinds%name), status)
        end if
    end subroutine read_kind

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
        type(chain_kind) :: kind
        type(leg_spec) :: leg
        type(toml_node) :: base, platform
        logical :: is_driven, found
        integer :: i

        chain_name = unnamed_chain
        if (place%copy > 0) chain_name = unnamed_chain//to_text(place%copy)
        call get_name(place, "name", chain_name, status, found)
        if (.not. status%is_ok()) return
        place%what = "chain "//quoted(chain_name)
        call read_kind(place, scene%planar, kind, status)
        if (.not. status%is_ok()) return
        call allow_keys(place, [character(len=10) :: "type", "name", "names", "base", "platform", "actuated", "start", &
            own_keys(kind)], status)
        base = marker_list(place, "base", -1, status)
        platform = marker_list(place, "platform", n_marker(base), status)
        call leg_names(place, chain_name, kind, base, names, status)
        is_driven = .true.
        call get_flag(place, "actuated", is_driven, status)
        do i = 1, n_marker(base)
            if (.not. status%is_ok()) return
            leg = leg_spec(line=place%line)
            leg%name = trim(names(i))              ! in the constructor gfortran would not free it
            call read_ends(place, marker_at(base, i), marker_at(platform, i), scene, leg, status)
            if (kind%is_word) then
                call read_word_leg(place, kind, leg, next_link, next_joint, scene, status)
            else
                call read_leg(place, i, kind, next_link, scene, leg, status)
            end if
            if (.not. status%is_ok()) return
            if (.not. kind%is_word) then
                call build_leg(kind, leg, next_link, next_joint, scene)
                call read_stiffnesses(place, scene, next_joint, joints_of_leg(kind), status)
                call read_arms(place, i, kind, next_link, scene, status)
            end if
            if (is_driven .and. drive_of(kind) > 0) driven = [driven, next_joint + drive_of(kind) - 1]
            next_link = next_link + links_of_leg(kind)
            next_joint = next_joint + joints_of_leg(kind)
        end do
    end subroutine read_chain

    !> The keys that legs of a kind have and not all: their links, and how these lie.
    pure function own_keys(kind) result(key)
        type(chain_kind), intent(in) :: kind
        character(len=10), allocatable :: key(:)

        if (kind%is_word) then
            key = word_key
            return
        end if
        key = [character(len=10) :: kind%link, "stiffness"]
        if (is_rail_kind(kind)) key = [character(len=10) :: key, "rail"]
        if (has_axis(kind)) key = [character(len=10) :: key, "axis"]
        if (is_crank_kind(kind)) key = [character(len=10) :: key, "zero", "elbow"]
        if (has_top_axis(kind)) key = [character(len=10) :: key, "top_axis"]
        if (kind%is_parallelogram) key = [character(len=10) :: key, "width"]
    end function own_keys

    !> Has a leg an axis that the scene must give, of its first universal joint or of its hinge on the base?
    pure logical function has_axis(kind)
        type(chain_kind), intent(in) :: kind

        has_axis = kind%space == in_space .and. scan(kind%letters(:2), "RU") > 0
    end function has_axis

    !> Has it one fixed in the platform?
    pure logical function has_top_axis(kind)
        type(chain_kind), intent(in) :: kind

        has_top_axis = kind%letters(3:3) == "U" .or. kind%is_parallelogram
    end function has_top_axis

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
    subroutine leg_names(place, chain_name, kind, base, names, status)
        type(scene_place), intent(in) :: place
        character(len=*), intent(in) :: chain_name
        type(chain_kind), intent(in) :: kind
        type(toml_node), intent(in) :: base            !! list of markers
        character(len=name_len), allocatable, intent(out) :: names(:)
        type(status_type), intent(inout) :: status
        character(len=:), allocatable :: text
        type(toml_node) :: list, item
        logical :: is_text
        integer :: i, n_leg

        n_leg = n_marker(base)
        allocate (names(n_leg))
        if (.not. status%is_ok()) return
        list = place%node%get("names")
        if (list%is_present() .and. list%count() /= n_leg) call refuse_value(place, "names", list, "has "// &
            counted(list%count(), "element")//" (expected "//to_text(n_leg)//", one a leg)", status)
        do i = 1, n_leg
            text = trim(chain_name)//to_text(i)
            if ((place%copy > 0 .or. base%kind() == toml_string) .and. n_leg == 1) text = trim(chain_name)
            if (list%is_present()) then
                item = list%at(i)
                call text_of(place, item, text, is_text)
                if (.not. is_text) call refuse_value(place, "names", list, "holds "//item%kind_text()// &
                    " (expected names in quotes)", status)
            end if
            ! the longest name made of it, that of one of two rods
            call require_name(place, text//"."//trim(kind%link(1))//repeat("1", merge(1, 0, kind%is_parallelogram)), list%line(), &
                              status)
            names(i) = text
        end do
    end subroutine leg_names

    !> Where a leg begins and ends: markers of two links.
    subroutine read_ends(place, base, platform, scene, leg, status)
        type(scene_place), intent(in) :: place
        type(toml_node), intent(in) :: base, platform
        type(scene_type), intent(in) :: scene
        type(leg_spec), intent(inout) :: leg
        type(status_type), intent(inout) :: status

        call find_marker(scene, place, "base", base, leg%end_link(1), leg%end_marker(1), status)
        call find_marker(scene, place, "platform", platform, leg%end_link(2), leg%end_marker(2), status)
        call require_two_links(place, "platform", platform, scene, leg%end_link, status)
    end subroutine read_ends

    !> What else the scene says of leg i, and the mass properties of its links.
    subroutine read_leg(place, i, kind, link, scene, leg, status)
        type(scene_place), intent(in) :: place
        integer, intent(in) :: i                       !! number of the leg
        type(chain_kind), intent(in) :: kind
        integer, intent(in) :: link                    !! where the leg's own begin
        type(scene_type), intent(inout) :: scene
        type(leg_spec), intent(inout) :: leg
        type(status_type), intent(inout) :: status
        type(pattern_type) :: pattern
        character(len=:), allocatable :: link_name
        real(wp) :: carry(3, 3)
        logical :: found
        integer :: k

        if (place%copy > 0) call read_pattern(place, scene%planar, .true., pattern, status)
        call read_directions(place, i, kind, scene%planar, pattern, leg, status)
        if (kind%is_parallelogram) then
            call get_quantity(place, "width", length, leg%width, status)
            if (status%is_ok() .and. .not. leg%width > 0) call refuse_value(place, "width", place%node%get("width"), "= " &
                //to_text(leg%width)//" m (expected the distance between both rods, more than zero)", status)
        end if
        call get_quantity(place, "start", drive_quantity(kind), leg%start, status, leg%has_start)
        call get_integer(place, "elbow", leg%elbow, status, found)
        if (status%is_ok() .and. found .and. abs(leg%elbow) /= 1) call refuse_value(place, "elbow", place%node%get("elbow"), &
            "= "//to_text(leg%elbow)//" (expected 1 or -1)", status)
        if (.not. status%is_ok()) return
        if (scene%planar .and. place%copy > 0) then
            ! an image turns the other way
            if (pattern%is_image(place%copy)) leg%elbow = -leg%elbow
            if (pattern%is_image(place%copy) .and. is_crank_kind(kind)) leg%start = -leg%start
        end if
        if (is_telescope(kind) .and. .not. leg%has_start) then
            leg%start = about_length(scene, leg)
            leg%has_start = .true.
        end if
        do k = 1, links_of_leg(kind)
            link_name = trim(kind%link(min(k, 2)))
            associate (its => scene%link(link + k - 1))
                its%name = leg%name//"."//link_name
                if (kind%is_parallelogram .and. k > 1) its%name = trim(its%name)//to_text(k - 1)
                call read_leg_link(place, link_name, i, scene%planar, has_length(), leg%length(min(k, 2)), its, status)
                carry = carry_of(kind, k, scene%planar, pattern, place%copy)
                its%cog = matmul(carry, its%cog)
                its%inertia = turned_tensor(its%inertia, carry)
            end associate
        end do

    contains

        pure logical function has_length()

            has_length = link_name == "crank" .or. (link_name == "rod" .and. .not. is_telescope(kind))
        end function has_length
    end subroutine read_leg

    !> How the links of leg i give way: their markers are there now.
    subroutine read_arms(place, i, kind, link, scene, status)
        type(scene_place), intent(in) :: place
        integer, intent(in) :: i
        type(chain_kind), intent(in) :: kind
        integer, intent(in) :: link                    !! where the leg's own begin
        type(scene_type), intent(inout) :: scene
        type(status_type), intent(inout) :: status
        type(pattern_type) :: pattern
        type(scene_place) :: inner
        integer :: k

        if (place%copy > 0) call read_pattern(place, scene%planar, .true., pattern, status)
        do k = 1, links_of_leg(kind)
            if (.not. status%is_ok()) return
            associate (its => scene%link(link + k - 1))
                inner = place_at(place, table_of_leg(place, trim(kind%link(min(k, 2))), i), "link "//quoted(its%name))
                call read_elastic(inner, scene%planar, scene%redundancy, its, status, carry_of(kind, k, scene%planar, pattern, &
                                                                                              place%copy))
            end associate
        end do
    end subroutine read_arms

    !> From the axes in which the file describes link k of a leg that is a copy, to that link's. Those of a carriage are its base
    !> link's, in which it turns. The others' go along with the leg; they are right-handed, so that one of an image's is reversed:
    !> y, where it is square to what is mirrored (see `linkdyn_chain_parts`) or along the hinge of a crank, which turns the other
    !> way; else x.
    pure function carry_of(kind, k, planar, pattern, copy) result(carry)
        type(chain_kind), intent(in) :: kind
        integer, intent(in) :: k, copy                 !! copy 0: none
        logical, intent(in) :: planar
        type(pattern_type), intent(in) :: pattern
        real(wp) :: carry(3, 3)
        logical :: y_is_hinge, reverses_x
        integer :: i

        carry = 0
        do i = 1, 3
            carry(i, i) = 1
        end do
        if (copy == 0) return
        if (is_rail_kind(kind) .and. k == 1) then
            carry = pattern%turn(:, :, copy)
        else if (pattern%is_image(copy)) then
            y_is_hinge = kind%letters(min(k, 2):min(k, 2)) == "R" .or. (is_telescope(kind) .and. kind%letters(1:1) == "R")
            reverses_x = .not. planar .and. (y_is_hinge .neqv. is_crank_kind(kind))
            i = merge(1, 2, reverses_x)
            carry(i, i) = -1
        end if
    end function carry_of

    !> Unit of the driven variable.
    pure type(quantity_type) function drive_quantity(kind) result(quantity)
        type(chain_kind), intent(in) :: kind

        quantity = length
        if (is_crank_kind(kind)) quantity = angle
    end function drive_quantity

    !> Drawn out, not pushed through: any length of the mechanism's size says so.
    pure real(wp) function about_length(scene, leg)
        type(scene_type), intent(in) :: scene
        type(leg_spec), intent(in) :: leg
        integer :: side

        about_length = 0
        do side = 1, 2
            associate (l => leg%end_link(side), m => leg%end_marker(side))
                if (l == frame_link) then
                    about_length = max(about_length, maxval(abs(scene%frame%marker(m)%at)))
                else
                    about_length = max(about_length, maxval(abs(scene%link(l)%marker(m)%at)))
                end if
            end associate
        end do
        if (.not. about_length > 0) about_length = 1
    end function about_length

    !> Directions of leg i, of a copy turned with it. The axis of a hinge turns an image the other way, as a mirror does.
    subroutine read_directions(place, i, kind, planar, pattern, leg, status)
        type(scene_place), intent(in) :: place
        integer, intent(in) :: i
        type(chain_kind), intent(in) :: kind
        logical, intent(in) :: planar
        type(pattern_type), intent(in) :: pattern
        type(leg_spec), intent(inout) :: leg
        type(status_type), intent(inout) :: status
        real(wp) :: hinge_sign
        logical :: found

        if (is_rail_kind(kind)) call read_direction("rail", "the direction of the slide in the base link, [1, 0, 0]", leg%rail)
        if (has_axis(kind)) call read_direction("axis", "the axis of the hinge, or the first one of the universal joint, in the " &
                                                //"base link, [0, 1, 0]", leg%axis)
        leg%top_axis = leg%axis
        if (has_top_axis(kind)) call read_direction("top_axis", "", leg%top_axis, found)
        if (is_crank_kind(kind)) then
            if (.not. planar) leg%zero = carried_x(leg%axis)
            call read_direction("zero", "", leg%zero, found)
            if (.not. status%is_ok()) return
            if (.not. planar) leg%zero = leg%zero - dot_product(leg%zero, leg%axis)*leg%axis
            if (.not. norm2(leg%zero) > 1.0e-6_wp) then
                call refuse_value(place, "zero", place%node%get("zero"), "lies along 'axis' (expected where the crank points "// &
                    "at angle zero, square to its hinge)", status)
                return
            end if
            leg%zero = leg%zero/norm2(leg%zero)
        end if
        if (place%copy == 0 .or. .not. status%is_ok()) return
        associate (turn => pattern%turn(:, :, place%copy))
            hinge_sign = merge(-1, 1, is_crank_kind(kind) .and. pattern%is_image(place%copy))
            leg%axis = hinge_sign*matmul(turn, leg%axis)
            leg%top_axis = hinge_sign*matmul(turn, leg%top_axis)
            leg%rail = matmul(turn, leg%rail)
            leg%zero = matmul(turn, leg%zero)
        end associate

    contains

        !> One for all legs, or one a leg.
        subroutine read_direction(key, expected, axis, found)
            character(len=*), intent(in) :: key, expected
            real(wp), intent(inout) :: axis(3)
            logical, intent(out), optional :: found
            type(toml_node) :: node, base, item
            integer :: n

            if (present(found)) found = .false.
            if (.not. status%is_ok()) return
            n = merge(2, 3, planar)
            node = place%node%get(key)
            base = place%node%get("base")
            item = node%at(1)
            if (.not. node%is_present()) then
                if (.not. present(found)) call refuse_missing(place, key, expected, status)
                return
            end if
            axis = 0
            if (item%kind() /= toml_array) then
                call direction_of(place, key, node, axis(:n), status)
            else if (node%count() /= n_marker(base)) then
                call refuse_value(place, key, node, "has "//to_text(node%count())//" axes (expected one, or "// &
                    to_text(n_marker(base))//", one a leg)", status)
            else
                call direction_of(place, key, node%at(i), axis(:n), status)
            end if
            if (present(found)) found = .true.
        end subroutine read_direction
    end subroutine read_directions

    !> Mass properties of one link of leg i: one table for all, or one a leg. Cranks and rods have a length, too, and are thin and
    !> uniform if nothing else is said.
    subroutine read_leg_link(place, key, i, planar, has_length, link_length, link, status)
        type(scene_place), intent(in) :: place
        character(len=*), intent(in) :: key            !! lower, rod, ...
        integer, intent(in) :: i
        logical, intent(in) :: planar, has_length
        real(wp), intent(out) :: link_length           !! [m]
        type(link_spec), intent(inout) :: link
        type(status_type), intent(inout) :: status
        character(len=:), allocatable :: expected
        type(scene_place) :: inner
        type(toml_node) :: node, base

        link_length = 0
        if (.not. status%is_ok()) return
        link%line = place%line
        node = place%node%get(key)
        base = place%node%get("base")
        expected = "{ mass = .., cog = [..], inertia = [..] }"
        if (has_length) expected = "{ length = .., mass = .. }"
        if (.not. node%is_present()) then
            if (.not. has_length) expected = expected//", or { mass = 0 }"
            call refuse_missing(place, key, expected, status)
            return
        end if
        if (node%kind() == toml_array) then
            if (node%count() /= n_marker(base)) then
                call refuse_value(place, key, node, "has "//counted(node%count(), "element")//" (expected one table, or "// &
                    to_text(n_marker(base))//", one a leg)", status)
                return
            end if
        end if
        inner = place_at(place, table_of_leg(place, key, i), "link "//quoted(link%name))
        call require_table(inner, "a table, "//expected, status)
        if (has_length) then
            call allow_keys(inner, [character(len=13) :: "length", "mass", "cog", "inertia", "inertia_check", "elastic"], status)
            call get_quantity(inner, "length", length, link_length, status)
            if (status%is_ok() .and. .not. link_length > 0) call refuse_value(inner, "length", inner%node%get("length"), "= "// &
                to_text(link_length)//" m (expected a length of more than zero)", status)
            call read_mass_properties(inner, planar, link, status, rod_length=link_length)
        else
            call allow_keys(inner, [character(len=13) :: "mass", "cog", "inertia", "inertia_check", "elastic"], status)
            call read_mass_properties(inner, planar, link, status)
        end if
    end subroutine read_leg_link

    !> The table of one of leg i's links: the same for all, or one a leg.
    type(toml_node) function table_of_leg(place, key, i) result(table)
        type(scene_place), intent(in) :: place
        character(len=*), intent(in) :: key            !! lower, rod, ...
        integer, intent(in) :: i

        table = place%node%get(key)
        if (table%kind() == toml_array) table = table%at(i)
    end function table_of_leg
end module linkdyn_scene_chain
