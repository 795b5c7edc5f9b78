!> Frame, links and markers of a scene file.
module linkdyn_scene_links
    use, intrinsic :: iso_fortran_env, only: real64
    use linkdyn_kinds, only: wp
    use linkdyn_status, only: status_type
    use linkdyn_text, only: to_text, quoted
    use linkdyn_scene, only: scene_type, link_spec, marker_spec
    use linkdyn_toml, only: toml_node, toml_array, toml_table
    use linkdyn_units, only: length, angle, mass, inertia
    use linkdyn_scene_elastic, only: read_elastic, carry_arms
    use linkdyn_angles, only: angles_of_matrix, matrix_of_angles
    use linkdyn_scene_attitudes, only: attitude_key, get_attitude
    use linkdyn_scene_pattern, only: repeated_tables, list_repeated, repeated_at, pattern_type, read_pattern, mirrored_tensor
    use linkdyn_scene_keys, only: scene_place, place_at, line_text, pattern_key, refuse, refuse_value, refuse_missing, allow_keys, &
        require_table, get_quantity, quantity_of, get_vector, vector_of, get_direction, &
        get_name, get_text, get_word, get_flag, require_name
    implicit none (type, external)
    private
    public :: read_frame, read_links, read_mass_properties, read_inertia, new_marker, add_marker, carried_x

    character(len=*), parameter :: mesh_units(4) = [character(len=2) :: "m", "cm", "mm", "in"]

contains

    !> The table [frame]: markers; its motion is for `read_base`. A scene may do without.
    subroutine read_frame(root, scene, status)
        type(scene_place), intent(in) :: root
        type(scene_type), intent(inout) :: scene
        type(status_type), intent(inout) :: status
        type(scene_place) :: place
        type(toml_node) :: node

        if (.not. status%is_ok()) return
        scene%frame%name = "frame"
        allocate (scene%frame%marker(0))
        node = root%node%get("frame")
        if (.not. node%is_present()) return
        place = place_at(root, node, "frame")
        scene%frame%line = place%line
        call require_table(place, "a table with markers, written [frame]", status)
        call allow_keys(place, [character(len=7) :: "markers", "motion"], status)
        call read_markers(place, scene%planar, scene%frame, status)
    end subroutine read_frame

    !> The tables [[link]] into the first places of `scene%link`.
    subroutine read_links(root, scene, status)
        type(scene_place), intent(in) :: root
        type(scene_type), intent(inout) :: scene       !! %link allocated for these and for the chains
        type(status_type), intent(inout) :: status
        type(repeated_tables) :: tables
        type(scene_place) :: place
        integer :: i

        call list_repeated(root, "link", scene%planar, .true., tables, status)
        do i = 1, size(tables%table)
            place = repeated_at(root, tables, i, "link")
            call read_link(place, scene%planar, scene%redundancy, scene%link(i), status)
            if (.not. status%is_ok()) return
        end do
    end subroutine read_links

    subroutine read_link(place, planar, redundancy, link, status)
        type(scene_place), intent(inout) :: place
        logical, intent(in) :: planar
        integer, intent(in) :: redundancy              !! of the scene
        type(link_spec), intent(inout) :: link
        type(status_type), intent(inout) :: status

        link%line = place%line
        call get_name(place, "name", link%name, status)
        if (.not. status%is_ok()) return
        place%what = "link "//quoted(link%name)
        if (link%name == "frame") call refuse(place, "this name belongs to the fixed link (expected another name)", status)
        call allow_keys(place, [character(len=13) :: "name", "markers", "mass", "cog", "inertia", "inertia_check", &
            "elastic", "start", "mesh", "mesh_unit"], status)
        call read_markers(place, planar, link, status)
        call read_mass_properties(place, planar, link, status)
        call read_elastic(place, planar, redundancy, link, status)
        call read_start(place, planar, link, status)
        call read_mesh(place, link, status)
        if (place%copy > 0) call move_copy(place, planar, link, status)
    end subroutine read_link

    !> Turn the start of a copy, mirror an image.
    subroutine move_copy(place, planar, link, status)
        type(scene_place), intent(in) :: place
        logical, intent(in) :: planar
        type(link_spec), intent(inout) :: link
        type(status_type), intent(inout) :: status
        type(pattern_type) :: pattern
        real(wp) :: turn(3, 3), image(3), mirror(3, 3)
        integer :: i

        call read_pattern(place, planar, .true., pattern, status)
        if (.not. status%is_ok()) return
        image = 1
        if (pattern%is_image(place%copy)) image = pattern%reflection
        mirror = 0
        do i = 1, 3
            mirror(i, i) = image(i)
        end do
        do i = 1, size(link%marker)
            call move_marker(mirror, planar, link%marker(i))
        end do
        link%cog = link%cog*image
        link%inertia = mirrored_tensor(link%inertia, image)
        if (allocated(link%arm)) call carry_arms(mirror, link%arm)
        if (any(image < 0) .and. allocated(link%mesh)) call refuse_value(place, "mesh", place%node%get("mesh"), &
            "cannot be mirrored (expected a link of its own for the image)", status)
        turn = pattern%turn(:, :, place%copy)
        link%start(:3) = matmul(turn, link%start(:3))
        ! The image has its form mirrored in its own axes, and its axes are mirrored in space: together a rotation.
        link%start(4:) = angles_of_matrix(matmul(turn, matmul(matrix_of_angles(link%start(4:)), mirror)))
        if (planar) link%start(3:5) = 0
    end subroutine move_copy

    !> The body's form is for pictures.
    subroutine read_mesh(place, link, status)
        type(scene_place), intent(in) :: place
        type(link_spec), intent(inout) :: link
        type(status_type), intent(inout) :: status
        real(wp), parameter :: factor(4) = [1.0_wp, 0.01_wp, 0.001_wp, 0.0254_wp]
        character(len=:), allocatable :: file
        integer :: unit
        logical :: has_file, has_unit

        unit = 1
        call get_text(place, "mesh", file, status, has_file)
        if (has_file) link%mesh = file
        call get_word(place, "mesh_unit", mesh_units, unit, status, has_unit)
        if (status%is_ok() .and. has_unit .and. .not. has_file) &
            call refuse_missing(place, "mesh", "a file of the body's form, which 'mesh_unit' is the unit of", status)
        link%mesh_unit = factor(unit)
    end subroutine read_mesh

    !> Mass, centre of mass and inertia, for a body that can exist.
    subroutine read_mass_properties(place, planar, link, status, rod_length)
        type(scene_place), intent(in) :: place
        logical, intent(in) :: planar
        type(link_spec), intent(inout) :: link
        type(status_type), intent(inout) :: status
        real(wp), intent(in), optional :: rod_length   !! [m] what is not said is that of a thin uniform rod, from the origin
                                                       !! along z, in a plane x
        type(toml_node) :: node
        logical :: is_checked, found

        call get_quantity(place, "mass", mass, link%mass, status)
        if (.not. status%is_ok()) return
        if (link%mass < 0) call refuse_value(place, "mass", place%node%get("mass"), &
            "= "//to_text(link%mass)//" kg is negative (expected a mass of zero or more)", status)
        call get_vector(place, "cog", length, link%cog(:merge(2, 3, planar)), status, found)
        if (present(rod_length) .and. .not. found) link%cog(merge(1, 3, planar)) = rod_length/2
        is_checked = .true.
        call get_flag(place, "inertia_check", is_checked, status)
        node = place%node%get("inertia")
        if (.not. node%is_present()) then
            if (present(rod_length)) then
                if (planar) link%inertia(3) = link%mass*rod_length**2/12
                if (.not. planar) link%inertia(:2) = link%mass*rod_length**2/12
            else if (link%mass > 0 .and. .not. planar) then
                call refuse_missing(place, "inertia", &
                    "Ixx Iyy Izz Ixy Iyz Izx about the cog, or { diagonal = [Ixx, Iyy, Izz] }", status)
            end if
            return
        end if
        call read_inertia(place, node, planar, .false., link%inertia, status)
        if (.not. status%is_ok()) return
        if (.not. link%mass > 0 .and. any(abs(link%inertia) > 0)) call refuse_value(place, "inertia", node, &
            "is not zero though the mass is (expected none for a massless link)", status)
        if (is_checked) call check_inertia(place, node, planar, link%inertia, status)
    end subroutine read_mass_properties

    !> A tensor, in a plane one moment of inertia.
    subroutine read_inertia(place, node, planar, is_checked, tensor, status)
        type(scene_place), intent(in) :: place
        type(toml_node), intent(in) :: node
        logical, intent(in) :: planar
        logical, intent(in) :: is_checked              !! for a body that can exist
        real(wp), intent(inout) :: tensor(6)           !! Ixx Iyy Izz Ixy Iyz Izx
        type(status_type), intent(inout) :: status

        if (.not. status%is_ok()) return
        if (planar) then
            call quantity_of(place, "inertia", node, inertia, tensor(3), status)
        else
            call read_tensor(place, node, tensor, status)
        end if
        if (is_checked) call check_inertia(place, node, planar, tensor, status)
    end subroutine read_inertia

    !> Six elements, or a table with the diagonal.
    subroutine read_tensor(place, node, tensor, status)
        type(scene_place), intent(in) :: place
        type(toml_node), intent(in) :: node
        real(wp), intent(inout) :: tensor(6)           !! Ixx Iyy Izz Ixy Iyz Izx
        type(status_type), intent(inout) :: status
        type(scene_place) :: inner

        if (node%kind() == toml_table) then
            inner = place_at(place, node, trim(place%what)//", inertia")
            call allow_keys(inner, [character(len=8) :: "diagonal"], status)
            call get_vector(inner, "diagonal", inertia, tensor(:3), status)
        else if (node%kind() == toml_array .and. node%count() /= 6) then
            call refuse_value(place, "inertia", node, "has "//to_text(node%count())// &
                " elements (expected six, Ixx Iyy Izz Ixy Iyz Izx, or { diagonal = [Ixx, Iyy, Izz] })", status)
        else
            call vector_of(place, "inertia", node, inertia, tensor, status)
        end if
    end subroutine read_tensor

    !> A rigid body has principal moments of zero or more, none above the sum of the other two.
    !>
    !> Both hold if and only if trace/2 - I is positive semidefinite, rounding allowed for.
    subroutine check_inertia(place, node, planar, tensor, status)
        type(scene_place), intent(in) :: place
        type(toml_node), intent(in) :: node
        logical, intent(in) :: planar
        real(wp), intent(in) :: tensor(6)              !! Ixx Iyy Izz Ixy Iyz Izx
        type(status_type), intent(inout) :: status
        character(len=*), parameter :: advice = "; inertia_check = false lets it through)"
        real(wp) :: half_trace

        if (.not. status%is_ok()) return
        if (planar) then
            if (tensor(3) < 0) call refuse_value(place, "inertia", node, &
                "is negative (expected a moment of inertia of zero or more"//advice, status)
            return
        end if
        half_trace = sum(tensor(:3))/2
        if (.not. is_semidefinite(tensor(:3), tensor(4:))) then
            call refuse_value(place, "inertia", node, "is not positive definite: no body has it "// &
                "(expected a tensor with positive principal moments"//advice, status)
        else if (.not. is_semidefinite(half_trace - tensor(:3), -tensor(4:))) then
            call refuse_value(place, "inertia", node, "breaks the triangle inequality: no body has it "// &
                "(expected no principal moment above the sum of the other two"//advice, status)
        end if
    end subroutine check_inertia

    !> Cholesky's factorization goes through, the diagonal raised by some roundings.
    pure logical function is_semidefinite(diagonal, product)
        real(wp), intent(in) :: diagonal(3)            !! xx yy zz
        real(wp), intent(in) :: product(3)             !! xy yz zx
        real(wp) :: a(3), b(3)

        is_semidefinite = .false.
        ! The file's decimal digits are rounded to double precision in every build.
        a = diagonal + 64*epsilon(1.0_real64)*(sum(abs(diagonal)) + sum(abs(product))) + tiny(1.0_wp)
        b = product
        if (.not. a(1) > 0) return
        b(2) = b(2) - b(1)*b(3)/a(1)
        a(3) = a(3) - b(3)**2/a(1)
        a(2) = a(2) - b(1)**2/a(1)
        if (.not. a(2) > 0) return
        is_semidefinite = a(3) - b(2)**2/a(2) > 0
    end function is_semidefinite

    !> Where a link is, roughly, at the start: closure of loops looks near there.
    subroutine read_start(place, planar, link, status)
        type(scene_place), intent(in) :: place
        logical, intent(in) :: planar
        type(link_spec), intent(inout) :: link
        type(status_type), intent(inout) :: status
        type(scene_place) :: inner
        type(toml_node) :: node
        logical :: found

        if (.not. status%is_ok()) return
        node = place%node%get("start")
        if (.not. node%is_present()) return
        inner = place_at(place, node, trim(place%what)//", start")
        call require_table(inner, "a table, { position = [..], angles = [..] }", status)
        link%has_start = .true.
        if (planar) then
            call allow_keys(inner, [character(len=8) :: "position", "angle"], status)
            call get_vector(inner, "position", length, link%start(:2), status, found)
            call get_quantity(inner, "angle", angle, link%start(6), status, found)
        else
            call allow_keys(inner, [character(len=10) :: "position", attitude_key], status)
            call get_vector(inner, "position", length, link%start(:3), status, found)
            call get_attitude(inner, link%start(4:), status, found)
        end if
    end subroutine read_start

    !> The table `markers` of a link.
    subroutine read_markers(place, planar, link, status)
        type(scene_place), intent(in) :: place
        logical, intent(in) :: planar
        type(link_spec), intent(inout) :: link
        type(status_type), intent(inout) :: status
        type(scene_place) :: inner
        type(toml_node) :: list
        type(pattern_type) :: pattern
        type(marker_spec) :: marker
        character(len=:), allocatable :: name
        integer :: i, k, line

        if (.not. allocated(link%marker)) allocate (link%marker(0))
        if (.not. status%is_ok()) return
        list = place%node%get("markers")
        if (.not. list%is_present()) return
        if (list%kind() /= toml_table) then
            call refuse_value(place, "markers", list, "is "//list%kind_text()// &
                " (expected a table of points, { A = [0, 0, 0], ... })", status)
            return
        end if
        do i = 1, list%count()
            call list%key(i, name, line)
            call require_name(place, name, line, status)
            if (.not. status%is_ok()) return
            inner = place_at(place, list%get(name), "marker "//quoted(trim(link%name)//"."//name))
            marker = marker_spec(name=name, line=line)
            if (planar) marker%axis = [1, 0, 0]
            call read_marker_pattern(inner, planar, pattern, status)
            call read_marker(inner, planar, marker, status)
            if (.not. status%is_ok()) return
            if (.not. pattern%is_given) then
                call add_marker(link, marker)
                cycle
            end if
            do k = 1, pattern%n
                call require_name(place, name//to_text(k), line, status)
                call add_marker(link, marker)
                call move_marker(pattern%turn(:, :, k), planar, link%marker(size(link%marker)))
                link%marker(size(link%marker))%name = name//to_text(k)
            end do
        end do
        call refuse_double_markers(place, link, status)
    end subroutine read_markers

    !> Copies of a marker, which want a way to differ.
    subroutine read_marker_pattern(place, planar, pattern, status)
        type(scene_place), intent(inout) :: place
        logical, intent(in) :: planar
        type(pattern_type), intent(out) :: pattern
        type(status_type), intent(inout) :: status
        type(toml_node) :: about, angles

        if (place%node%kind() /= toml_table) return
        place%n_pattern_key = size(pattern_key)
        call read_pattern(place, planar, .true., pattern, status)
        about = place%node%get("about")
        angles = place%node%get("angles")
        if (status%is_ok() .and. pattern%n > 1 .and. all(pattern%reflection > 0) .and. &
            .not. (about%is_present() .or. angles%is_present())) &
            call refuse_missing(place, "about", "the axis that the markers stand around, ""z""", status)
    end subroutine read_marker_pattern

    !> What the file says of a marker by a rotation, or rotation and reflection; what it leaves out stays as it is without.
    pure subroutine move_marker(turn, planar, marker)
        real(wp), intent(in) :: turn(3, 3)
        logical, intent(in) :: planar
        type(marker_spec), intent(inout) :: marker

        marker%at = matmul(turn, marker%at)
        if (marker%has_axis) marker%axis = matmul(turn, marker%axis)
        if (marker%has_x) then
            marker%x_axis = matmul(turn, marker%x_axis)
        else if (.not. planar) then
            marker%x_axis = carried_x(marker%axis)
        end if
    end subroutine move_marker

    !> A copy may be called as another marker is.
    subroutine refuse_double_markers(place, link, status)
        type(scene_place), intent(in) :: place
        type(link_spec), intent(in) :: link
        type(status_type), intent(inout) :: status
        integer :: i, j

        if (.not. status%is_ok()) return
        do i = 2, size(link%marker)
            do j = 1, i - 1
                if (link%marker(i)%name /= link%marker(j)%name) cycle
                call refuse(place, "there is another marker "//quoted(link%marker(i)%name)//" on "// &
                    line_text(place, link%marker(j)%line, link%marker(i)%line)//" (expected a name of its own)", status, &
                    link%marker(i)%line)
                return
            end do
        end do
    end subroutine refuse_double_markers

    !> A point, or a table with a point and directions.
    subroutine read_marker(place, planar, marker, status)
        type(scene_place), intent(in) :: place
        logical, intent(in) :: planar
        type(marker_spec), intent(inout) :: marker
        type(status_type), intent(inout) :: status
        integer :: n

        if (.not. status%is_ok()) return
        n = merge(2, 3, planar)
        select case (place%node%kind())
        case (toml_array)
            call vector_of(place, "at", place%node, length, marker%at(:n), status)
        case (toml_table)
            call allow_keys(place, [character(len=4) :: "at", "axis", "x"], status)
            call get_vector(place, "at", length, marker%at(:n), status)
            call get_direction(place, "axis", marker%axis(:n), status, marker%has_axis)
            call get_direction(place, "x", marker%x_axis(:n), status, marker%has_x)
            if (.not. status%is_ok() .or. planar) return
            if (marker%has_x) then
                call square_up(place, marker, status)
            else
                marker%x_axis = carried_x(marker%axis)
            end if
        case default
            call refuse(place, "this is "//place%node%kind_text()//" (expected a point, "// &
                trim(merge("[x, y]   ", "[x, y, z]", planar))//", or { at = .., axis = .. })", status)
        end select
    end subroutine read_marker

    !> Take from `x_axis` what lies along `axis`.
    subroutine square_up(place, marker, status)
        type(scene_place), intent(in) :: place
        type(marker_spec), intent(inout) :: marker
        type(status_type), intent(inout) :: status
        real(wp) :: across(3)

        across = marker%x_axis - dot_product(marker%x_axis, marker%axis)*marker%axis
        if (norm2(across) < 1.0e-6_wp) then
            call refuse_value(place, "x", place%node%get("x"), "is parallel to 'axis' (expected a direction across it)", status)
            return
        end if
        across = across/norm2(across)
        across = across - dot_product(across, marker%axis)*marker%axis
        marker%x_axis = across/norm2(across)
    end subroutine square_up

    !> Where the smallest rotation that takes e_z to `axis` carries e_x.
    pure function carried_x(axis) result(x)
        real(wp), intent(in) :: axis(3)                !! unit vector
        real(wp) :: x(3)
        real(wp) :: square, inverse

        x = [1, 0, 0]
        square = axis(1)**2 + axis(2)**2
        if (.not. square > 0) return
        ! 1/(1 + axis_z), also where axis_z is near -1.
        if (axis(3) > 0) then
            inverse = 1/(1 + axis(3))
        else
            inverse = (1 - axis(3))/square
        end if
        x = [1 - axis(1)**2*inverse, -axis(1)*axis(2)*inverse, -axis(1)]
        x = x/norm2(x)
    end function carried_x

    !> A marker that the file does not name: part of a chain.
    pure type(marker_spec) function new_marker(name, at, axis, line) result(marker)
        character(len=*), intent(in) :: name
        real(wp), intent(in) :: at(3)                  !! [m]
        real(wp), intent(in) :: axis(3)                !! unit vector
        integer, intent(in) :: line

        marker%name = name
        marker%at = at
        marker%axis = axis
        marker%x_axis = carried_x(axis)
        marker%has_axis = .true.
        marker%line = line
    end function new_marker

    !> Append a marker to a link.
    pure subroutine add_marker(link, marker)
        type(link_spec), intent(inout) :: link
        type(marker_spec), intent(in) :: marker
        type(marker_spec), allocatable :: longer(:)
        integer :: n

        n = 0
        if (allocated(link%marker)) n = size(link%marker)
        allocate (longer(n + 1))
        if (n > 0) longer(:n) = link%marker
        longer(n + 1) = marker
        call move_alloc(longer, link%marker)
    end subroutine add_marker
end module linkdyn_scene_links
