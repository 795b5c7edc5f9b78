!> What cams have of their own in a scene file: the curve, and what rides on it.
module linkdyn_scene_cams
    use linkdyn_constants, only: two_pi
    use linkdyn_curve, only: make_polar_curve, make_curve, curvature_range
    use linkdyn_kinds, only: wp
    use linkdyn_scene, only: joint_spec, cam_spec, joint_cam, joint_kind_name, follower_roller, follower_flat, follower_name
    use linkdyn_scene_keys, only: scene_place, place_at, refuse, refuse_value, refuse_missing, allow_keys, get_quantity, get_word, &
        get_text, list_of, counted
    use linkdyn_scene_laws, only: table_shelf, take_table, column_in_si
    use linkdyn_status, only: status_type
    use linkdyn_text, only: to_text
    use linkdyn_toml, only: toml_node, toml_table
    use linkdyn_units, only: quantity_type, length, angle
    implicit none (type, external)
    private
    public :: read_cam, cam_key

    character(len=8), parameter :: cam_key(*) = [character(len=8) :: "follower", "radius", "side", "curve"]
    character(len=7), parameter :: side_name(3) = [character(len=7) :: "outside", "inside", "groove"]
    integer, parameter :: groove = 3
    integer, parameter :: least_points = 8
    integer, parameter :: of_radius = 1, of_x_and_y = 2, of_height = 3
    character(len=6), parameter :: of_curve(5) = [character(len=6) :: "angle", "radius", "x", "y", "height"]
    character(len=6), parameter :: column(2, 3) = reshape(of_curve([1, 2, 3, 4, 1, 5]), [2, 3])
    real(wp), parameter :: closing = 1.0e-9_wp        !! how near, by its size, a row that closes the curve is to the first

contains

    !> Keys of other kinds are refused.
    subroutine read_cam(place, planar, shelf, joint, status)
        type(scene_place), intent(in) :: place
        logical, intent(in) :: planar
        type(table_shelf), intent(inout) :: shelf
        type(joint_spec), intent(inout) :: joint
        type(status_type), intent(inout) :: status
        type(toml_node) :: node
        integer :: k

        if (joint%kind == joint_cam) then
            call read_follower(place, joint%cam, status)
            call read_curve(place, planar, shelf, joint%cam, status)
            call check_shape(place, joint%cam, status)
            return
        end if
        do k = 1, size(cam_key)
            if (.not. status%is_ok()) return
            node = place%node%get(trim(cam_key(k)))
            if (node%is_present()) call refuse_value(place, trim(cam_key(k)), node, "has no meaning here: the joint is a "// &
                trim(joint_kind_name(joint%kind))//" joint", status)
        end do
    end subroutine read_cam

    subroutine read_follower(place, cam, status)
        type(scene_place), intent(in) :: place
        type(cam_spec), intent(inout) :: cam
        type(status_type), intent(inout) :: status
        integer :: side
        logical :: found, has_radius

        call get_word(place, "follower", follower_name, cam%follower, status)
        side = 1
        call get_word(place, "side", side_name, side, status, found)
        call get_quantity(place, "radius", length, cam%radius, status, has_radius)
        if (.not. status%is_ok()) return
        cam%side = merge(-1, 1, side == 2)
        cam%is_groove = side == groove
        cam%is_path = cam%is_groove
        if (cam%follower == follower_roller .and. .not. has_radius) then
            call refuse_missing(place, "radius", "that of the roller, for example '10 mm'", status)
        else if (cam%follower /= follower_roller .and. has_radius) then
            call refuse_value(place, "radius", place%node%get("radius"), &
                              "has no meaning here: the follower is not a roller", status)
        else if (has_radius .and. .not. cam%radius > 0) then
            call refuse_value(place, "radius", place%node%get("radius"), "= "//to_text(cam%radius) &
                              //" m (expected more than zero)", status)
        else if (cam%follower == follower_flat .and. side /= 1) then
            call refuse_value(place, "side", place%node%get("side"), "has no meaning here: a flat face lies outside", status)
        end if
    end subroutine read_follower

    ! ---------------------------------------------------------------- the curve

    !> From a file or from lists: radius over angle, or x and y; in space, height over angle, too.
    subroutine read_curve(place, planar, shelf, cam, status)
        type(scene_place), intent(in) :: place
        logical, intent(in) :: planar
        type(table_shelf), intent(inout) :: shelf
        type(cam_spec), intent(inout) :: cam
        type(status_type), intent(inout) :: status
        character(len=*), parameter :: expected = &
            "{ table = ""cam.csv"" }, { angle = [..], radius = [..] }, { x = [..], y = [..] } or { angle = [..], height = [..] }"
        type(toml_node) :: node
        type(scene_place) :: inner
        real(wp), allocatable :: first(:), second(:)
        real(wp) :: base
        logical :: has_of, found
        integer :: of, form

        if (.not. status%is_ok()) return
        node = place%node%get("curve")
        if (.not. node%is_present()) then
            call refuse_missing(place, "curve", expected, status)
        else if (node%kind() /= toml_table) then
            call refuse_value(place, "curve", node, "is "//node%kind_text()//" (expected "//expected//")", status)
        end if
        if (.not. status%is_ok()) return
        inner = place_at(place, node, trim(place%what)//", curve")
        call allow_keys(inner, [character(len=6) :: "table", "angle", "radius", "x", "y", "height", "base", "of"], status)
        of = 1
        call get_word(inner, "of", [character(len=7) :: "profile", "centre"], of, status, has_of)
        if (status%is_ok() .and. has_of .and. cam%is_groove .and. of == 1) call refuse_value(inner, "of", node%get("of"), &
            "= ""profile"" has no meaning here: the curve of a groove is that of the roller's centre", status)
        if (status%is_ok() .and. of == 2 .and. cam%follower == follower_flat) call refuse_value(inner, "of", node%get("of"), &
            "has no meaning here: a flat face has no centre", status)
        cam%is_path = cam%is_path .or. of == 2
        call read_points(inner, shelf, form, first, second, status)
        base = 0
        call get_quantity(inner, "base", length, base, status, found)
        if (.not. status%is_ok()) return
        cam%is_barrel = form == of_height
        if (cam%is_barrel .and. cam%follower == follower_flat) then
            call refuse(inner, "goes over heights, on which a flat face does not lie (expected radii, or x and y)", status)
        else if (cam%is_barrel .and. planar) then
            call refuse(inner, "goes over heights, round a drum in space (expected radii, or x and y)", status)
        else if (cam%is_barrel .and. has_of) then
            call refuse_value(inner, "of", node%get("of"), "has no meaning here: heights are those of the roller's centre", status)
        else if (form == of_x_and_y .and. found) then
            call refuse_value(inner, "base", node%get("base"), "has no meaning here: it is added to radii or heights", status)
        end if
        if (.not. status%is_ok()) return
        if (form == of_x_and_y) then
            call close_points(inner, first, second, status)
            if (status%is_ok()) call make_curve(first, second, cam%curve)
        else
            second = base + second
            call close_turn(inner, merge("height", "radius", cam%is_barrel), first, second, status)
            if (cam%is_barrel .and. status%is_ok()) then
                ! heights as radii, which are above zero
                cam%ground = minval(second) - merge(maxval(second) - minval(second), 1.0_wp, maxval(second) > minval(second))
                second = second - cam%ground
            end if
            if (status%is_ok()) call make_polar_curve(first, second, cam%curve)
        end if
    end subroutine read_curve

    !> Both columns or lists, as written.
    subroutine read_points(place, shelf, form, first, second, status)
        type(scene_place), intent(in) :: place         !! of the curve
        type(table_shelf), intent(inout) :: shelf
        integer, intent(out) :: form                   !! one of `of_*`
        real(wp), allocatable, intent(out) :: first(:), second(:)
        type(status_type), intent(inout) :: status
        character(len=:), allocatable :: file
        type(toml_node) :: node(2)
        logical :: in_file, is_there(size(of_curve))
        integer :: i, table

        form = of_radius
        call get_text(place, "table", file, status, in_file)
        if (.not. status%is_ok()) return
        do i = 1, size(of_curve)
            node(1) = place%node%get(trim(of_curve(i)))
            is_there(i) = node(1)%is_present()
        end do
        if (in_file) then
            i = findloc(is_there, .true., dim=1)
            if (i > 0) call refuse_value(place, trim(of_curve(i)), place%node%get(trim(of_curve(i))), &
                "stands beside 'table' (expected one of both)", status)
            if (status%is_ok()) call take_table(place, file, shelf, table, status)
            if (.not. status%is_ok()) return
            associate (columns => shelf%place(table)%table)
                form = form_of([(any(columns%column == of_curve(i)), i=1, size(of_curve))])
                call column_in_si(columns, trim(column(1, form)), quantity_of_first(form), first, status)
                call column_in_si(columns, trim(column(2, form)), length, second, status)
            end associate
            return
        end if
        form = form_of(is_there)
        do i = 1, size(of_curve)
            if (.not. is_there(i) .or. any(column(:, form) == of_curve(i))) cycle
            call refuse_value(place, trim(of_curve(i)), place%node%get(trim(of_curve(i))), "stands beside '"// &
                trim(column(1, form))//"' or '"//trim(column(2, form))//"' (expected angle and radius, x and y, or angle and "// &
                "height)", status)
            return
        end do
        do i = 1, 2
            node(i) = place%node%get(trim(column(i, form)))
            if (status%is_ok() .and. .not. node(i)%is_present()) &
                call refuse_missing(place, trim(column(i, form)), "a list, or 'table'", status)
        end do
        call list_of(place, trim(column(1, form)), node(1), quantity_of_first(form), first, status)
        call list_of(place, trim(column(2, form)), node(2), length, second, status)
        if (.not. status%is_ok() .or. size(first) == size(second)) return
        call refuse_value(place, trim(column(2, form)), node(2), "has "//counted(size(second), "element") &
                          //" (expected "//to_text(size(first))//", as many as '"//trim(column(1, form))//"')", status)
    end subroutine read_points

    !> Which of them are meant, by what is there. A table may have more columns than one curve has.
    pure integer function form_of(is_there) result(form)
        logical, intent(in) :: is_there(:)             !! of `of_curve`

        form = of_radius
        if (any(is_there(3:4)) .and. .not. any(is_there(1:2))) form = of_x_and_y
        if (is_there(5) .and. .not. is_there(2)) form = of_height
    end function form_of

    pure type(quantity_type) function quantity_of_first(form) result(quantity)
        integer, intent(in) :: form

        quantity = angle
        if (form == of_x_and_y) quantity = length
    end function quantity_of_first

    !> Once round by angle: a last row that is the first one again goes.
    subroutine close_turn(place, what, angle, radius, status)
        type(scene_place), intent(in) :: place
        character(len=*), intent(in) :: what           !! "radius", which is above zero, or "height"
        real(wp), allocatable, intent(inout) :: angle(:), radius(:)
        type(status_type), intent(inout) :: status
        real(wp), parameter :: in_degrees = 360/two_pi
        integer :: i, n

        n = size(angle)
        if (n > 1) then
            if (abs(angle(n) - angle(1) - two_pi) <= closing*two_pi) then
                if (abs(radius(n) - radius(1)) > closing*maxval(abs(radius))) then
                    call refuse(place, "the curve does not close: "//what//" "//to_text(radius(n))//" m a turn behind " &
                                //to_text(radius(1))//" m (expected the same, or the last row left out)", status)
                    return
                end if
                angle = angle(:n - 1)
                radius = radius(:n - 1)
            end if
        end if
        call require_points(place, size(angle), status)
        do i = 1, size(angle)
            if (.not. status%is_ok()) return
            if (what == "radius" .and. .not. radius(i) > 0) &
                call refuse(place, "radius "//to_text(radius(i))//" m at "//to_text(angle(i)*in_degrees) &
                            //" deg (expected more than zero)", status)
            if (i == 1) cycle
            if (.not. angle(i) > angle(i - 1)) call refuse(place, "angles do not increase: "//to_text(angle(i)*in_degrees) &
                //" deg follows "//to_text(angle(i - 1)*in_degrees)//" deg", status)
        end do
        if (angle(size(angle)) - angle(1) >= two_pi) call refuse(place, "angles span "// &
            to_text((angle(size(angle)) - angle(1))*in_degrees)//" deg (expected one turn)", status)
    end subroutine close_turn

    subroutine close_points(place, x, y, status)
        type(scene_place), intent(in) :: place
        real(wp), allocatable, intent(inout) :: x(:), y(:)
        type(status_type), intent(inout) :: status
        real(wp) :: least
        integer :: i, n

        n = size(x)
        least = 0
        if (n > 0) least = closing*max(maxval(abs(x)), maxval(abs(y)))
        if (n > 1) then
            if (hypot(x(n) - x(1), y(n) - y(1)) <= least) then
                x = x(:n - 1)
                y = y(:n - 1)
            end if
        end if
        call require_points(place, size(x), status)
        do i = 2, size(x)
            if (.not. status%is_ok()) return
            if (hypot(x(i) - x(i - 1), y(i) - y(i - 1)) > least) cycle
            call refuse(place, "point "//to_text(i)//" is the one before once more, " &
                        //to_text(x(i))//" "//to_text(y(i))//" m", status)
        end do
    end subroutine close_points

    subroutine require_points(place, n, status)
        type(scene_place), intent(in) :: place
        integer, intent(in) :: n
        type(status_type), intent(inout) :: status

        if (status%is_ok() .and. n < least_points) call refuse(place, "the curve has "//counted(n, "point") &
            //" (expected "//to_text(least_points)//" or more, all the way round)", status)
    end subroutine require_points

    ! ---------------------------------------------------------------- can it be made

    !> A roller must fit into what is hollow, an outline be left of what is round; a flat face touches no hollow.
    subroutine check_shape(place, cam, status)
        type(scene_place), intent(in) :: place
        type(cam_spec), intent(in) :: cam
        type(status_type), intent(inout) :: status
        real(wp) :: range(2)

        if (.not. status%is_ok() .or. cam%is_barrel) return
        range = curvature_range(cam%curve)
        if (cam%follower == follower_flat) then
            if (.not. range(1) > 0) call refuse_value(place, "curve", place%node%get("curve"), "is hollow or straight somewhere " &
                //"(curvature down to "//to_text(range(1))//" /m), where a flat face touches it twice (expected a round one, or " &
                //"follower = ""roller"")", status)
            return
        end if
        if (cam%side < 0) range = -range(2:1:-1)
        if (cam%is_path) then
            if (cam%radius*range(2) >= 1) then
                call refuse_radius("does not leave an outline: the path of its centre has a radius of "//to_text(1/range(2)))
            else if (cam%is_groove .and. -cam%radius*range(1) >= 1) then
                call refuse_radius("does not leave an outline: the path of its centre has a radius of "//to_text(-1/range(1)))
            end if
        else if (-cam%radius*range(1) >= 1) then
            call refuse_radius("does not fit into the curve: it is hollow with a radius of "//to_text(-1/range(1)))
        end if

    contains

        subroutine refuse_radius(why)
            character(len=*), intent(in) :: why

            call refuse_value(place, "radius", place%node%get("radius"), "= "//to_text(cam%radius)//" m "//why &
                              //" m (expected a smaller roller)", status)
        end subroutine refuse_radius
    end subroutine check_shape
end module linkdyn_scene_cams
