!> Legs of a chain that are a word of joint letters, "PRRR": drawn joint by joint.
!>
!> A leg is drawn as it is where all its joint variables are zero, in the axes of the base link: `axes` has the direction of each
!> joint, of a universal joint both, of a ball none; in a plane those of slides alone. `to` of a link leads from its first joint
!> to its next. There each link's axes are those of the base link, its origin is in its first joint, and `cog` and `inertia` are as
!> in the drawing. Of a copy the drawing is turned; an image is the mirrored drawing with links whose form is mirrored in their own
!> axes, as links are elsewhere.
module linkdyn_chain_words
    use linkdyn_chain_kinds, only: chain_kind, joint_kind_of, joint_suffix, joints_of_leg, most_letters
    use linkdyn_chain_parts, only: leg_spec, add_beside
    use linkdyn_kinds, only: wp
    use linkdyn_scene, only: scene_type, joint_spec, link_spec, marker_spec, joint_revolute, joint_cylindrical, joint_universal, &
        joint_spherical
    use linkdyn_scene_elastic, only: read_elastic
    use linkdyn_scene_joints, only: start_of_joint, stiffness_of_joint
    use linkdyn_scene_keys, only: scene_place, place_at, refuse_value, refuse_missing, counted, allow_keys, require_table, &
        direction_of, get_direction, get_vector
    use linkdyn_scene_links, only: read_mass_properties, new_marker, add_marker, carried_x
    use linkdyn_scene_pattern, only: pattern_type, read_pattern, mirrored_tensor
    use linkdyn_status, only: status_type
    use linkdyn_text, only: to_text, quoted
    use linkdyn_toml, only: toml_node, toml_array
    use linkdyn_units, only: length
    implicit none (type, external)
    private
    public :: word_key, read_word_leg, read_stiffnesses

    character(len=10), parameter :: word_key(4) = [character(len=10) :: "axes", "links", "top_axis", "stiffness"]
    real(wp), parameter :: origin(3) = 0, x_axis(3) = [1, 0, 0], z_axis(3) = [0, 0, 1]
    real(wp), parameter :: square_enough = 1.0e-6_wp   !! cosine between both axes of a universal joint

    !> How the joints of a leg lie in the drawing.
    type :: drawn_leg
        real(wp) :: axis(3, most_letters) = 0          !! of each joint; of a universal joint the first
        real(wp) :: second(3, most_letters) = 0        !! of a universal joint
        real(wp) :: top(3) = 0                         !! of the last joint, in the platform's axes
        logical :: has_top = .false.
        real(wp) :: turn(3, 3) = 0                     !! from the drawing to the base link, of an image with the reflection
        real(wp) :: image(3) = 1                       !! of an image the reflection in the links' own axes
        real(wp) :: handedness = 1                     !! -1: an image
    end type drawn_leg

contains

    !> One leg: its links with their mass properties, its joints with their markers.
    subroutine read_word_leg(place, kind, leg, first_link, first_joint, scene, status)
        type(scene_place), intent(in) :: place
        type(chain_kind), intent(in) :: kind
        type(leg_spec), intent(in) :: leg                  !! its name and its ends
        integer, intent(in) :: first_link, first_joint     !! where the leg's own begin
        type(scene_type), intent(inout) :: scene
        type(status_type), intent(inout) :: status
        type(drawn_leg) :: drawn
        type(scene_place) :: inner
        type(toml_node) :: list
        real(wp) :: to(3, most_letters)                    ! of each link [m]
        integer :: k, n

        n = joints_of_leg(kind)
        to = 0
        call read_copy(place, scene%planar, drawn, status)
        call read_axes(place, kind, scene%planar, drawn, status)
        if (.not. status%is_ok()) return
        do k = 1, n - 1
            call read_link(place, leg, k, n - 1, scene%planar, drawn, scene%link(first_link + k - 1), to(:, k), status)
        end do
        do k = 1, n
            associate (joint => scene%joint(first_joint + k - 1))
                joint = joint_spec(kind=joint_kind_of(kind%letters(k:k)), line=leg%line)
                joint%name = leg%name//"."//joint_suffix(kind%letters, k)
            end associate
        end do
        call read_starts(place, scene%planar, drawn, scene%joint(first_joint:first_joint + n - 1), status)
        call read_stiffnesses(place, scene, first_joint, n, status)
        if (.not. status%is_ok()) return
        do k = 1, n
            call join_links(k)
        end do
        list = place%node%get("links")
        do k = 1, n - 1
            inner = place_at(place, list%at(k), "link "//quoted(scene%link(first_link + k - 1)%name))
            call read_elastic(inner, scene%planar, scene%redundancy, scene%link(first_link + k - 1), status, diagonal(drawn%image))
        end do

    contains

        !> The k-th joint: between the link before it, or the base, and the link behind it, or the platform.
        subroutine join_links(k)
            integer, intent(in) :: k
            type(marker_spec) :: marker
            logical :: is_end, is_top                      ! on base or platform; on the platform
            integer :: side, at(2), link(2)

            link = first_link + k - 2 + [0, 1]
            if (k == 1) link(1) = leg%end_link(1)
            if (k == n) link(2) = leg%end_link(2)
            do side = 1, 2
                is_top = k == n .and. side == 2
                is_end = is_top .or. k == 1 .and. side == 1
                marker = marker_of(scene%joint(first_joint + k - 1)%kind, drawn, k, side, scene%planar, is_end, is_top)
                marker%line = leg%line
                marker%name = joint_suffix(kind%letters, k)
                if (is_end) then
                    marker%name = leg%name//"."//marker%name
                    call add_beside(leg%end_marker(side), link(side), marker, scene, at(side))
                    cycle
                end if
                if (side == 1) marker%at = drawn%image*to(:, k - 1)
                call add_marker(scene%link(link(side)), marker)
                at(side) = size(scene%link(link(side))%marker)
            end do
            scene%joint(first_joint + k - 1)%link = link
            scene%joint(first_joint + k - 1)%marker = at
        end subroutine join_links
    end subroutine read_word_leg

    !> Where a copy of the drawing is.
    subroutine read_copy(place, planar, drawn, status)
        type(scene_place), intent(in) :: place
        logical, intent(in) :: planar
        type(drawn_leg), intent(inout) :: drawn
        type(status_type), intent(inout) :: status
        type(pattern_type) :: pattern
        integer :: i

        drawn%turn = 0
        do i = 1, 3
            drawn%turn(i, i) = 1
        end do
        if (place%copy == 0) return
        call read_pattern(place, planar, .true., pattern, status)
        if (.not. status%is_ok()) return
        drawn%turn = pattern%turn(:, :, place%copy)
        if (.not. pattern%is_image(place%copy)) return
        drawn%image = pattern%reflection
        drawn%handedness = -1
    end subroutine read_copy

    !> The directions of the joints.
    subroutine read_axes(place, kind, planar, drawn, status)
        type(scene_place), intent(in) :: place
        type(chain_kind), intent(in) :: kind
        logical, intent(in) :: planar
        type(drawn_leg), intent(inout) :: drawn
        type(status_type), intent(inout) :: status
        character(len=:), allocatable :: expected, of_what
        type(toml_node) :: list
        integer :: k, m, n, n_axes

        if (.not. status%is_ok()) return
        n = joints_of_leg(kind)
        list = place%node%get("axes")
        n_axes = count([(has_axis(kind%letters(k:k), planar), k=1, n)])
        of_what = "each joint"
        if (n_axes < n) of_what = "each joint but balls"
        if (planar) of_what = "each slide"
        expected = "directions in the drawing, one for "//of_what//" of "//trim(kind%name)
        if (n_axes == 0) then
            if (list%is_present()) call refuse_value(place, "axes", list, "has no meaning here: no joint of "//trim(kind%name)// &
                " has a direction of its own", status)
        else if (.not. list%is_present()) then
            call refuse_missing(place, "axes", expected, status)
        else if (list%kind() /= toml_array) then
            call refuse_value(place, "axes", list, "is "//list%kind_text()//" (expected "//expected//")", status)
        else if (list%count() /= n_axes) then
            call refuse_value(place, "axes", list, "has "//counted(list%count(), "element")//" (expected "//to_text(n_axes)//" "// &
                expected//")", status)
        end if
        m = 0
        do k = 1, n
            if (.not. status%is_ok()) return
            if (.not. has_axis(kind%letters(k:k), planar)) cycle
            m = m + 1
            if (kind%letters(k:k) == "U") then
                call read_cross(place, list%at(m), drawn%axis(:, k), drawn%second(:, k), status)
            else
                call direction_of(place, "axes", list%at(m), drawn%axis(:merge(2, 3, planar), k), status)
            end if
        end do
        if (.not. has_axis(kind%letters(n:n), planar)) then
            list = place%node%get("top_axis")
            if (list%is_present()) call refuse_value(place, "top_axis", list, "has no meaning here: the last joint of "// &
                trim(kind%name)//" has no direction in the platform", status)
            return
        end if
        call get_direction(place, "top_axis", drawn%top(:merge(2, 3, planar)), status, drawn%has_top)
    end subroutine read_axes

    !> Has a joint a direction that the scene gives?
    pure logical function has_axis(letter, planar)
        character, intent(in) :: letter
        logical, intent(in) :: planar

        has_axis = letter /= "S"
        if (planar) has_axis = letter == "P"
    end function has_axis

    !> Both axes of a universal joint, that on the side of the base first.
    subroutine read_cross(place, pair, first, second, status)
        type(scene_place), intent(in) :: place
        type(toml_node), intent(in) :: pair
        real(wp), intent(inout) :: first(3), second(3)
        type(status_type), intent(inout) :: status
        character(len=*), parameter :: expected = " (expected both axes of the universal joint, for example [[1, 0, 0], [0, 1, 0]])"
        type(toml_node) :: item

        item = pair%at(1)
        if (item%kind() /= toml_array .or. pair%count() /= 2) then
            call refuse_value(place, "axes", pair, "is one direction"//expected, status)
            return
        end if
        call direction_of(place, "axes", item, first, status)
        call direction_of(place, "axes", pair%at(2), second, status)
        if (.not. status%is_ok()) return
        if (abs(dot_product(first, second)) > square_enough) then
            call refuse_value(place, "axes", pair, "has axes that are not square to each other"//expected, status)
            return
        end if
        second = second - dot_product(first, second)*first
        second = second/norm2(second)
    end subroutine read_cross

    !> The k-th link of a leg: its mass properties, and where its next joint is.
    subroutine read_link(place, leg, k, n, planar, drawn, link, to, status)
        type(scene_place), intent(in) :: place
        type(leg_spec), intent(in) :: leg
        integer, intent(in) :: k, n                        !! which of how many
        logical, intent(in) :: planar
        type(drawn_leg), intent(in) :: drawn
        type(link_spec), intent(inout) :: link
        real(wp), intent(inout) :: to(3)                   !! from its first joint, as drawn [m]
        type(status_type), intent(inout) :: status
        character(len=*), parameter :: expected = "a table for each link, { to = [..], mass = .. }"
        type(toml_node) :: list, node
        type(scene_place) :: inner
        logical :: found

        if (.not. status%is_ok()) return
        link%name = leg%name//".link"//to_text(k)
        link%line = leg%line
        list = place%node%get("links")
        if (list%kind() /= toml_array) then
            call refuse_value(place, "links", list, "is "//list%kind_text()//" (expected "//expected//")", status)
        else if (list%count() /= n) then
            call refuse_value(place, "links", list, "has "//counted(list%count(), "element")//" (expected "//to_text(n)// &
                ", one for each link between two joints)", status)
        end if
        if (.not. status%is_ok()) return
        inner = place_at(place, list%at(k), "link "//quoted(link%name))
        call require_table(inner, "a table, { to = [..], mass = .. }", status)
        call allow_keys(inner, [character(len=13) :: "to", "mass", "cog", "inertia", "inertia_check", "elastic"], status)
        call get_vector(inner, "to", length, to(:merge(2, 3, planar)), status, found)
        if (norm2(to) > 0) then
            call read_mass_properties(inner, planar, link, status, rod_length=norm2(to))
        else
            call read_mass_properties(inner, planar, link, status)
        end if
        if (.not. status%is_ok()) return
        node = inner%node%get("cog")
        if (.not. node%is_present()) link%cog = to/2
        node = inner%node%get("inertia")
        if (.not. node%is_present() .and. .not. planar) link%inertia = link%mass/12*[dot_product(to, to) - to**2, -to*cshift(to, 1)]
        link%cog = drawn%image*link%cog
        link%inertia = mirrored_tensor(link%inertia, drawn%image)
    end subroutine read_link

    pure function diagonal(v)
        real(wp), intent(in) :: v(3)
        real(wp) :: diagonal(3, 3)
        integer :: i

        diagonal = 0
        do i = 1, 3
            diagonal(i, i) = v(i)
        end do
    end function diagonal

    !> About where the joints are at the start, if the scene says so. What turns the other way in an image does so here.
    subroutine read_starts(place, planar, drawn, joint, status)
        type(scene_place), intent(in) :: place
        logical, intent(in) :: planar
        type(drawn_leg), intent(in) :: drawn
        type(joint_spec), intent(inout) :: joint(:)
        type(status_type), intent(inout) :: status
        type(toml_node) :: list
        integer :: k

        if (.not. status%is_ok()) return
        list = place%node%get("start")
        if (.not. list%is_present()) return
        call require_one_a_joint(place, "start", list, size(joint), status)
        do k = 1, size(joint)
            call start_of_joint(place, list%at(k), joint(k), status)
            if (drawn%handedness > 0) cycle
            if (joint(k)%kind == joint_revolute .and. planar) joint(k)%start = -joint(k)%start
            if (joint(k)%kind == joint_cylindrical) joint(k)%start(1) = -joint(k)%start(1)
            if (joint(k)%kind == joint_spherical) joint(k)%start = -drawn%image*joint(k)%start
        end do
    end subroutine read_starts

    !> How the joints give way: one table for all, or a list.
    subroutine read_stiffnesses(place, scene, first_joint, n, status)
        type(scene_place), intent(in) :: place
        type(scene_type), intent(inout) :: scene
        integer, intent(in) :: first_joint, n
        type(status_type), intent(inout) :: status
        type(toml_node) :: list, node
        type(joint_spec) :: joint
        integer :: k

        if (.not. status%is_ok()) return
        list = place%node%get("stiffness")
        if (.not. list%is_present()) return
        if (list%kind() == toml_array) call require_one_a_joint(place, "stiffness", list, n, status)
        do k = 1, n
            node = list
            if (list%kind() == toml_array) node = list%at(k)
            joint = scene%joint(first_joint + k - 1)
            call stiffness_of_joint(place, node, scene, joint, status)
            scene%joint(first_joint + k - 1) = joint
        end do
    end subroutine read_stiffnesses

    subroutine require_one_a_joint(place, key, list, n, status)
        type(scene_place), intent(in) :: place
        character(len=*), intent(in) :: key
        type(toml_node), intent(in) :: list
        integer, intent(in) :: n
        type(status_type), intent(inout) :: status

        if (list%kind() /= toml_array) then
            call refuse_value(place, key, list, "is "//list%kind_text()//" (expected a list, one for each of "//to_text(n)// &
                " joints)", status)
        else if (list%count() /= n) then
            call refuse_value(place, key, list, "has "//counted(list%count(), "element")//" (expected "//to_text(n)// &
                ", one for each joint)", status)
        end if
    end subroutine require_one_a_joint

    !> The marker of joint k on one side of it: in the links' own axes, or in those of base or platform.
    pure function marker_of(kind, drawn, k, side, planar, is_end, is_top) result(marker)
        integer, intent(in) :: kind, k, side
        type(drawn_leg), intent(in) :: drawn
        logical, intent(in) :: planar, is_end, is_top
        type(marker_spec) :: marker
        real(wp) :: axis(3), x(3), handed

        axis = drawn%axis(:, k)
        x = carried_x(axis)
        handed = 1                                         ! an axis that is turned about is mirrored as turning is
        if (kind == joint_revolute .or. kind == joint_universal) handed = drawn%handedness
        select case (kind)
        case (joint_spherical)
            ! axes of links, mirrored once more in a link's own: its angles are zero where links are parallel
            axis = drawn%image*z_axis
            x = drawn%image*x_axis
        case (joint_universal)
            x = handed*across(drawn%second(:, k), axis)
            if (side == 2) axis = drawn%second(:, k)
        case (joint_revolute)
            if (planar) axis = x_axis
            if (planar) x = x_axis
            if (planar) handed = 1
        case default
        end select
        if (is_top .and. drawn%has_top) then
            axis = drawn%top
            x = carried_x(axis)
        end if
        if (is_end) then
            marker = new_marker("", origin, handed*matmul(drawn%turn, axis), 0)
            marker%x_axis = matmul(drawn%turn, x)
        else
            marker = new_marker("", origin, handed*drawn%image*axis, 0)
            marker%x_axis = drawn%image*x
        end if
    end function marker_of

    pure function across(a, b)
        real(wp), intent(in) :: a(3), b(3)
        real(wp) :: across(3)

        across = cshift(a, 1)*cshift(b, -1) - cshift(a, -1)*cshift(b, 1)
    end function across
end module linkdyn_chain_words
