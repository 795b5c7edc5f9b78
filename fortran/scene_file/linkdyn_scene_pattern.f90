!> Parts that are there several times: `repeat = 6, about = "z"`, `angles = [..]`, `mirror = "xz"`.
!>
!> A table with `repeat` is read once for each copy: `#` in its texts is the number of the copy (`scene_place%copy`). Where a part
!> has a place, copies are turned about an axis through the origin, by equal parts of a turn or by given angles; with `mirror`
!> each is followed by its mirror image.
module linkdyn_scene_pattern
    use linkdyn_constants, only: two_pi
    use linkdyn_kinds, only: wp
    use linkdyn_scene_keys, only: scene_place, place_at, pattern_key, refuse_value, refuse_missing, table_list, &
        get_integer, get_word, list_of, direction_of
    use linkdyn_status, only: status_type
    use linkdyn_text, only: to_text
    use linkdyn_toml, only: toml_node, toml_string
    use linkdyn_units, only: angle
    implicit none (type, external)
    private
    public :: repeated_tables, list_repeated, repeated_at, pattern_type, read_pattern, mirrored_tensor, turned_tensor

    integer, parameter :: most_copies = 1000        !! of one part: more than mechanisms have
    integer, parameter :: only_repeat = 1, all_keys = size(pattern_key)

    !> The tables of a list, each as often as it says.
    type :: repeated_tables
        type(toml_node) :: list
        integer, allocatable :: table(:)            !! in the list
        integer, allocatable :: copy(:)             !! 0: a table that is not repeated
        integer :: n_key = 0                        !! of `pattern_key` that it may have
    end type repeated_tables

    !> Where copies of a part are.
    type :: pattern_type
        logical :: is_given = .false.
        integer :: n = 1                            !! copies in all
        real(wp), allocatable :: turn(:, :, :)      !! (3, 3, n) from the part to its copy; of an image with the reflection
        real(wp) :: reflection(3) = 1               !! diagonal; all 1: no images
    contains
        procedure :: is_image
    end type pattern_type

contains

    !> The tables [[key]] of a scene. `has_place`: copies may be turned and mirrored.
    subroutine list_repeated(root, key, planar, has_place, tables, status)
        type(scene_place), intent(in) :: root
        character(len=*), intent(in) :: key
        logical, intent(in) :: planar, has_place
        type(repeated_tables), intent(out) :: tables
        type(status_type), intent(inout) :: status
        type(scene_place) :: place
        type(pattern_type) :: pattern
        type(toml_node) :: item
        integer :: i, k, n

        allocate (tables%table(0), tables%copy(0))
        tables%n_key = merge(all_keys, only_repeat, has_place)
        call table_list(root, key, tables%list, n, status)
        if (.not. status%is_ok()) return
        do i = 1, n
            item = tables%list%at(i)
            place = place_at(root, item, key//" "//to_text(i))
            call read_pattern(place, planar, has_place, pattern, status)
            if (.not. status%is_ok()) return
            tables%table = [tables%table, (i, k=1, pattern%n)]
            tables%copy = [tables%copy, (merge(k, 0, pattern%is_given), k=1, pattern%n)]
        end do
    end subroutine list_repeated

    !> The i-th of them; `what` it is for messages.
    type(scene_place) function repeated_at(root, tables, i, what) result(place)
        type(scene_place), intent(in) :: root
        type(repeated_tables), intent(in) :: tables
        integer, intent(in) :: i
        character(len=*), intent(in) :: what

        place = place_at(root, tables%list%at(tables%table(i)), what//" "//to_text(i))
        place%copy = tables%copy(i)
        if (place%copy > 0) place%n_pattern_key = tables%n_key
    end function repeated_at

    !> The copies that a table asks for; one, where it is, if it asks for none.
    subroutine read_pattern(place, planar, has_place, pattern, status)
        type(scene_place), intent(in) :: place
        logical, intent(in) :: planar, has_place
        type(pattern_type), intent(out) :: pattern
        type(status_type), intent(inout) :: status
        character(len=2), parameter :: plane(3) = ["yz", "xz", "xy"]
        real(wp) :: axis(3)
        real(wp), allocatable :: by(:)
        type(toml_node) :: node
        logical :: is_repeated, is_turned, is_mirrored
        integer :: n, mirror, k

        if (.not. status%is_ok()) return
        n = 1
        call get_integer(place, "repeat", n, status, is_repeated)
        if (status%is_ok() .and. (n < 1 .or. n > most_copies)) call refuse_value(place, "repeat", place%node%get("repeat"), &
            "= "//to_text(n)//" (expected 1 to "//to_text(most_copies)//")", status)
        if (.not. status%is_ok()) return
        is_turned = .false.
        is_mirrored = .false.
        axis = [0, 0, 1]
        mirror = 0
        if (has_place) then
            node = place%node%get("angles")
            is_turned = node%is_present()
            if (is_turned) call read_angles(place, node, is_repeated, n, by, status)
            call get_word(place, "mirror", plane(:merge(2, 3, planar)), mirror, status, is_mirrored)
            node = place%node%get("about")
            if (node%is_present() .and. .not. (is_repeated .or. is_turned)) &
                call refuse_missing(place, "repeat", "how many there are round the axis, or 'angles'", status)
            if (node%is_present()) call read_about(place, node, planar, axis, status)
            is_turned = is_turned .or. node%is_present()
        end if
        if (.not. status%is_ok()) return
        pattern%is_given = is_repeated .or. is_turned .or. is_mirrored
        if (.not. allocated(by)) by = [(merge(two_pi*(k - 1)/n, 0.0_wp, is_turned), k=1, n)]
        if (is_mirrored) pattern%reflection(mirror) = -1
        pattern%n = merge(2*n, n, is_mirrored)
        allocate (pattern%turn(3, 3, pattern%n))
        do k = 1, n
            if (is_mirrored) then
                pattern%turn(:, :, 2*k - 1) = rotation(axis, by(k))
                pattern%turn(:, :, 2*k) = rotation(axis, by(k))*spread(pattern%reflection, 1, 3)
            else
                pattern%turn(:, :, k) = rotation(axis, by(k))
            end if
        end do
    end subroutine read_pattern

    !> Angles, one for each copy.
    subroutine read_angles(place, node, is_repeated, n, by, status)
        type(scene_place), intent(in) :: place
        type(toml_node), intent(in) :: node
        logical, intent(in) :: is_repeated
        integer, intent(inout) :: n                 !! copies; their number if it is not given
        real(wp), allocatable, intent(out) :: by(:)
        type(status_type), intent(inout) :: status
        character(len=:), allocatable :: expected

        call list_of(place, "angles", node, angle, by, status)
        if (.not. status%is_ok()) return
        if (size(by) < 1 .or. size(by) > most_copies .or. (is_repeated .and. size(by) /= n)) then
            expected = "1 to "//to_text(most_copies)
            if (is_repeated) expected = to_text(n)//", as many as 'repeat'"
            call refuse_value(place, "angles", node, "has "//to_text(size(by))//" elements (expected "//expected//")", status)
            return
        end if
        n = size(by)
    end subroutine read_angles

    !> The axis: x, y, z or a direction.
    subroutine read_about(place, node, planar, axis, status)
        type(scene_place), intent(in) :: place
        type(toml_node), intent(in) :: node
        logical, intent(in) :: planar
        real(wp), intent(out) :: axis(3)
        type(status_type), intent(inout) :: status
        character(len=1), parameter :: name(3) = ["z", "x", "y"]
        integer :: i

        axis = [0, 0, 1]
        if (node%kind() == toml_string .or. planar) then
            i = 1
            call get_word(place, "about", name(:merge(1, 3, planar)), i, status)
            axis = cshift([0.0_wp, 0.0_wp, 1.0_wp], merge(0, 4 - i, i == 1))
        else
            call direction_of(place, "about", node, axis, status)
        end if
    end subroutine read_about

    !> True if a copy is a mirror image.
    pure logical function is_image(self, copy)
        class(pattern_type), intent(in) :: self
        integer, intent(in) :: copy

        is_image = any(self%reflection < 0) .and. mod(copy, 2) == 0
    end function is_image

    !> A tensor Ixx Iyy Izz Ixy Iyz Izx of the image of a body.
    pure function mirrored_tensor(tensor, reflection) result(image)
        real(wp), intent(in) :: tensor(6), reflection(3)
        real(wp) :: image(6)

        image(:3) = tensor(:3)
        image(4:) = tensor(4:)*reflection*cshift(reflection, 1)
    end function mirrored_tensor

    !> A tensor of a body that is turned, or turned and mirrored, in axes that are not.
    pure function turned_tensor(tensor, turn) result(turned)
        real(wp), intent(in) :: tensor(6), turn(3, 3)
        real(wp) :: turned(6), whole(3, 3)
        integer :: i, next

        do i = 1, 3
            next = mod(i, 3) + 1
            whole(i, i) = tensor(i)
            whole(i, next) = tensor(3 + i)
            whole(next, i) = tensor(3 + i)
        end do
        whole = matmul(turn, matmul(whole, transpose(turn)))
        do i = 1, 3
            turned(i) = whole(i, i)
            turned(3 + i) = whole(i, mod(i, 3) + 1)
        end do
    end function turned_tensor

    !> Rotation about a unit vector.
    pure function rotation(axis, by) result(matrix)
        real(wp), intent(in) :: axis(3), by
        real(wp) :: matrix(3, 3)
        integer :: i, j

        do j = 1, 3
            do i = 1, 3
                matrix(i, j) = axis(i)*axis(j)*(1 - cos(by))
            end do
            matrix(j, j) = matrix(j, j) + cos(by)
            i = mod(j, 3) + 1
            matrix(6 - i - j, j) = matrix(6 - i - j, j) - sin(by)*axis(i)
            matrix(i, j) = matrix(i, j) + sin(by)*axis(6 - i - j)
        end do
    end function rotation
end module linkdyn_scene_pattern
