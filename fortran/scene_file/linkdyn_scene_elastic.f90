!> The key `elastic` of a link: how it gives way where reactions are shared by stiffness.
module linkdyn_scene_elastic
    use linkdyn_cross, only: cross
    use linkdyn_kinds, only: wp
    use linkdyn_scene, only: link_spec, arm_spec, share_by_stiffness
    use linkdyn_scene_keys, only: scene_place, place_at, refuse_missing, refuse_value, allow_keys, get_quantity, &
        get_direction, vector_of, text_of
    use linkdyn_status, only: status_type
    use linkdyn_text, only: quoted, to_text, join
    use linkdyn_toml, only: toml_node, toml_array, toml_table
    use linkdyn_units, only: quantity_type, plain_number, length, pressure, area, second_moment
    implicit none (type, external)
    private
    public :: read_elastic, carry_arms

    character(len=10), parameter :: beam_key(9) = [character(len=10) :: "E", "G", "area", "shear_area", "I", "Iy", "Iz", "y", "J"]
    character(len=10), parameter :: planar_key(5) = [character(len=10) :: "E", "G", "area", "shear_area", "I"]
    real(wp), parameter :: unlike = 1.0e-6_wp       !! of the two halves of a compliance, and of what of it may be below zero

contains

    !> A table, or a list of tables each for some markers.
    subroutine read_elastic(place, planar, redundancy, link, status, carry)
        type(scene_place), intent(in) :: place
        logical, intent(in) :: planar
        integer, intent(in) :: redundancy              !! of the scene
        type(link_spec), intent(inout) :: link         !! with its markers
        type(status_type), intent(inout) :: status
        real(wp), intent(in), optional :: carry(3, 3)  !! from axes in which the file writes to the link's, in which markers are
        type(toml_node) :: node, part
        integer :: i

        if (.not. status%is_ok()) return
        node = place%node%get("elastic")
        if (.not. node%is_present()) return
        if (redundancy /= share_by_stiffness) then
            call refuse_value(place, "elastic", node, "has no meaning here: it is for scenes with redundancy = ""stiffness""", &
                status)
            return
        end if
        allocate (link%arm(0))
        if (node%kind() == toml_array) then
            if (node%count() == 0) call refuse_value(place, "elastic", node, &
                "is an empty list (expected tables with 'to', or no such key: then the link is rigid)", status)
            do i = 1, node%count()
                part = node%at(i)
                call read_part(part)
            end do
        else
            call read_part(node)
        end if

    contains

        subroutine read_part(node)
            type(toml_node), intent(in) :: node
            type(scene_place) :: inner
            type(toml_node) :: given

            if (.not. status%is_ok()) return
            if (node%kind() /= toml_table) then
                call refuse_value(place, "elastic", node, "is "//node%kind_text()//" (expected a table, for example " &
                                  //"{ E = '210 GPa', area = '4 cm^2', I = '6 cm^4' }, or a list of such)", status)
                return
            end if
            inner = place_at(place, node, trim(place%what)//", elastic")
            given = node%get("compliance")
            if (given%is_present()) then
                call read_compliance(inner, planar, link, status, carry)
            else
                call read_beam(inner, planar, link, status, carry)
            end if
        end subroutine read_part
    end subroutine read_elastic

    !> Arms in other axes: turned, or mirrored. Moments, and turns, are mirrored as axes are about which something turns.
    pure subroutine carry_arms(carry, arm)
        real(wp), intent(in) :: carry(3, 3)
        type(arm_spec), intent(inout) :: arm(:)
        integer :: k

        do k = 1, size(arm)
            arm(k)%from = matmul(carry, arm(k)%from)
            call carry_section(carry, arm(k))
        end do
    end subroutine carry_arms

    !> All but the place where they begin.
    pure subroutine carry_section(carry, arm)
        real(wp), intent(in) :: carry(3, 3)
        type(arm_spec), intent(inout) :: arm
        real(wp) :: both(6, 6)

        both = 0
        both(:3, :3) = carry
        both(4:, 4:) = handedness(carry)*carry
        arm%y = matmul(carry, arm%y)
        arm%compliance = matmul(both, matmul(arm%compliance, transpose(both)))
    end subroutine carry_section

    !> 1 of a rotation, -1 of one with a reflection.
    pure real(wp) function handedness(carry)
        real(wp), intent(in) :: carry(3, 3)

        handedness = sign(1.0_wp, dot_product(carry(:, 1), cross(carry(:, 2), carry(:, 3))))
    end function handedness

    !> Beams from one place to markers.
    subroutine read_beam(place, planar, link, status, carry)
        type(scene_place), intent(in) :: place
        logical, intent(in) :: planar
        type(link_spec), intent(inout) :: link
        type(status_type), intent(inout) :: status
        real(wp), intent(in), optional :: carry(3, 3)
        type(arm_spec) :: arm
        real(wp) :: e, g, section(6)                   ! area, shear_area, I, Iy, Iz, J
        logical :: has_e, has_g, found(6), has_y

        call allow_keys(place, [character(len=10) :: "from", "to", pick(planar)], status)
        has_y = .false.
        section = 0
        call get_positive("E", pressure, e, has_e)
        call get_positive("G", pressure, g, has_g)
        call get_positive("area", area, section(1), found(1))
        call get_positive("shear_area", area, section(2), found(2))
        call get_positive("I", second_moment, section(3), found(3))
        call get_positive("Iy", second_moment, section(4), found(4))
        call get_positive("Iz", second_moment, section(5), found(5))
        call get_positive("J", second_moment, section(6), found(6))
        call get_direction(place, "y", arm%y, status, has_y)
        if (.not. status%is_ok()) return
        if (.not. any(found)) then
            call refuse_missing(place, "area", "how it gives way: 'area', 'I', in space 'J', or a 'compliance'", status)
        else if (any(found([1, 3, 4, 5])) .and. .not. has_e) then
            call refuse_missing(place, "E", "the modulus of elasticity, for example '210 GPa'", status)
        else if (any(found([2, 6])) .and. .not. has_g) then
            call refuse_missing(place, "G", "the shear modulus, for example '80 GPa'", status)
        else if (found(3) .and. any(found(4:5))) then
            call refuse_value(place, "I", place%node%get("I"), "stands beside 'Iy' or 'Iz' (expected one or the other)", status)
        else if (any(found(4:5)) .neqv. has_y) then
            call refuse_missing(place, trim(merge("Iy", "y ", has_y)), "a direction 'y' of the section beside 'Iy' and 'Iz'", &
                                status)
        end if
        if (found(3)) section(4:5) = section(3)
        arm%beam = [e*section(1), g*section(2), g*section(6), e*section(4), e*section(5)]
        if (present(carry)) call carry_section(carry, arm)
        call read_from(place, planar, link, arm, status, carry)
        call add_to_markers(place, link, arm, status)

    contains

        subroutine get_positive(key, quantity, value, found)
            character(len=*), intent(in) :: key
            type(quantity_type), intent(in) :: quantity
            real(wp), intent(inout) :: value
            logical, intent(out) :: found

            if (key == "E" .or. key == "G") value = 0
            call get_quantity(place, key, quantity, value, status, found)
            if (.not. (status%is_ok() .and. found)) return
            if (.not. value > 0) call refuse_value(place, key, place%node%get(key), &
                                                   "is not above zero (what is rigid is left out)", status)
        end subroutine get_positive
    end subroutine read_beam

    !> Keys of a beam in a plane, or in space.
    pure function pick(planar) result(keys)
        logical, intent(in) :: planar
        character(len=len(beam_key)), allocatable :: keys(:)

        if (planar) then
            keys = planar_key
        else
            keys = beam_key
        end if
    end function pick

    !> Where the beams begin: a marker or a point; else the centre of mass.
    subroutine read_from(place, planar, link, arm, status, carry)
        type(scene_place), intent(in) :: place
        logical, intent(in) :: planar
        type(link_spec), intent(in) :: link
        type(arm_spec), intent(inout) :: arm
        type(status_type), intent(inout) :: status
        real(wp), intent(in), optional :: carry(3, 3)
        type(toml_node) :: node
        integer :: marker

        if (.not. status%is_ok()) return
        node = place%node%get("from")
        arm%from_cog = .not. node%is_present()
        if (arm%from_cog) return
        if (node%kind() == toml_array) then
            call vector_of(place, "from", node, length, arm%from(:merge(2, 3, planar)), status)
            if (present(carry)) arm%from = matmul(carry, arm%from)
            return
        end if
        call find_own_marker(place, "from", node, link, marker, status)
        if (status%is_ok()) arm%from = link%marker(marker)%at
    end subroutine read_from

    !> One arm for each marker named, or one for all.
    subroutine add_to_markers(place, link, arm, status)
        type(scene_place), intent(in) :: place
        type(link_spec), intent(inout) :: link
        type(arm_spec), intent(in) :: arm
        type(status_type), intent(inout) :: status
        type(toml_node) :: node
        integer :: i

        if (.not. status%is_ok()) return
        node = place%node%get("to")
        if (.not. node%is_present()) then
            call add(0, node)
        else if (node%kind() == toml_array) then
            if (node%count() == 0) call refuse_value(place, "to", node, &
                "names no marker (expected one at least, or no such key: then it leads to all that have joints)", status)
            do i = 1, node%count()
                call add_named(node%at(i))
            end do
        else
            call add_named(node)
        end if

    contains

        subroutine add_named(node)
            type(toml_node), intent(in) :: node
            integer :: marker

            call find_own_marker(place, "to", node, link, marker, status)
            if (status%is_ok()) call add(marker, node)
        end subroutine add_named

        subroutine add(marker, node)
            integer, intent(in) :: marker
            type(toml_node), intent(in) :: node
            type(arm_spec), allocatable :: longer(:)
            integer :: n

            if (any(link%arm%marker == marker)) then
                if (marker == 0) then
                    call refuse_missing(place, "to", "the markers that it leads to: another table leads to all", status)
                else
                    call refuse_value(place, "to", node, "names a marker that another table leads to, too", status)
                end if
                return
            end if
            n = size(link%arm)
            allocate (longer(n + 1))
            longer(:n) = link%arm
            longer(n + 1) = arm
            longer(n + 1)%marker = marker
            call move_alloc(longer, link%arm)
        end subroutine add
    end subroutine add_to_markers

    !> How a marker gives way by force and moment on it: symmetric, and no force is given back more than it does.
    subroutine read_compliance(place, planar, link, status, carry)
        type(scene_place), intent(in) :: place
        logical, intent(in) :: planar
        type(link_spec), intent(inout) :: link
        type(status_type), intent(inout) :: status
        real(wp), intent(in), optional :: carry(3, 3)
        type(arm_spec) :: arm
        type(toml_node) :: node, rows
        integer, allocatable :: at(:)
        real(wp), allocatable :: c(:, :)
        integer :: i, n

        call allow_keys(place, [character(len=10) :: "to", "compliance"], status)
        if (.not. status%is_ok()) return
        at = [1, 2, 3, 4, 5, 6]
        if (planar) at = [1, 2, 6]
        n = size(at)
        allocate (c(n, n))
        node = place%node%get("to")
        rows = place%node%get("compliance")
        if (.not. node%is_present()) call refuse_missing(place, "to", "the marker that gives way so", status)
        if (status%is_ok() .and. (rows%kind() /= toml_array .or. rows%count() /= n)) call refuse_value(place, "compliance", rows, &
            "is not a list of "//to_text(n)//" rows with "//to_text(n)//" numbers (expected ways and turns along " &
            //trim(merge("x y and about z          ", "x y z and about x y z    ", planar))//", in SI)", status)
        do i = 1, merge(n, 0, status%is_ok())
            call vector_of(place, "compliance", rows%at(i), plain_number, c(:, i), status)
        end do
        if (.not. status%is_ok()) return
        if (maxval(abs(c - transpose(c))) > unlike*maxval(abs(c))) then
            call refuse_value(place, "compliance", rows, "is not symmetric", status)
        else if (gives_back(c)) then
            call refuse_value(place, "compliance", rows, "is not positive semidefinite (expected no direction in which a force " &
                              //"moves the marker against itself)", status)
        end if
        arm%is_beam = .false.
        arm%compliance(at, at) = (c + transpose(c))/2
        if (present(carry)) call carry_section(carry, arm)
        call add_to_markers(place, link, arm, status)
    end subroutine read_compliance

    !> Is it not positive semidefinite?
    pure logical function gives_back(c)
        real(wp), intent(in) :: c(:, :)
        real(wp) :: left(size(c, 1), size(c, 1)), scale(size(c, 1))
        integer :: i, k, n

        n = size(c, 1)
        gives_back = any([(c(k, k) < 0, k=1, n)])
        if (gives_back) return
        ! each direction by its own size
        scale = [(merge(1/sqrt(c(k, k)), 0.0_wp, c(k, k) > 0), k=1, n)]
        left = c*spread(scale, 2, n)*spread(scale, 1, n)
        gives_back = any([((.not. c(k, k) > 0 .and. any(abs(c(:, k)) > 0)), k=1, n)])
        do k = 1, n
            gives_back = gives_back .or. left(k, k) < -unlike
            if (.not. left(k, k) > unlike) cycle
            do i = k + 1, n
                left(:, i) = left(:, i) - left(k, i)/left(k, k)*left(:, k)
            end do
        end do
    end function gives_back

    !> A marker by its name on the link.
    subroutine find_own_marker(place, key, node, link, marker, status)
        type(scene_place), intent(in) :: place
        character(len=*), intent(in) :: key
        type(toml_node), intent(in) :: node
        type(link_spec), intent(in) :: link
        integer, intent(out) :: marker
        type(status_type), intent(inout) :: status
        character(len=:), allocatable :: name
        logical :: is_text
        integer :: i

        marker = 0
        if (.not. status%is_ok()) return
        call text_of(place, node, name, is_text)
        if (is_text) then
            do i = 1, size(link%marker)
                if (link%marker(i)%name == name) marker = i
            end do
            if (marker > 0) return
            call refuse_value(place, key, node, "= "//quoted(name)//" is no marker of link "//quoted(link%name)//" (expected " &
                              //"the name alone, one of "//join(link%marker%name)//")", status)
        else
            call refuse_value(place, key, node, "is "//node%kind_text()//" (expected the name of a marker of the link)", status)
        end if
    end subroutine find_own_marker
end module linkdyn_scene_elastic
