!> Attitudes in a scene file: by the three angles, as quaternion, as rotation matrix; tables of quaternions.
module linkdyn_scene_attitudes
    use linkdyn_angles, only: angles_of_matrix, matrix_of_quaternion, quaternion_of_matrix, find_rotation_fault
    use linkdyn_constants, only: two_pi
    use linkdyn_kinds, only: wp
    use linkdyn_scene, only: law_spec, table_spec
    use linkdyn_scene_keys, only: scene_place, refuse, refuse_value, get_vector, vector_of
    use linkdyn_scene_laws, only: table_shelf, table_reading, table_law, column_in_si, has_column, spline
    use linkdyn_spline, only: fit_spline
    use linkdyn_status, only: status_type, fail, status_bad_input
    use linkdyn_text, only: to_text
    use linkdyn_toml, only: toml_node, toml_array
    use linkdyn_units, only: plain_number, angle, time_span
    implicit none (type, external)
    private
    public :: get_attitude, has_quaternions, quaternion_laws, laws_through

    character(len=10), parameter, public :: attitude_key(3) = [character(len=10) :: "angles", "quaternion", "rotation"]
    character(len=2), parameter, public :: quaternion_column(4) = ["qw", "qx", "qy", "qz"]

contains

    !> Roll, pitch and yaw from one of the three keys.
    subroutine get_attitude(place, angles, status, found)
        type(scene_place), intent(in) :: place
        real(wp), intent(inout) :: angles(3)           !! left alone if none is there [rad]
        type(status_type), intent(inout) :: status
        logical, intent(out) :: found
        type(toml_node) :: node(3)
        real(wp) :: p(4), r(3, 3)
        logical :: is_given(3)
        integer :: k

        do k = 1, 3
            node(k) = place%node%get(trim(attitude_key(k)))
            is_given(k) = node(k)%is_present()
        end do
        found = any(is_given)
        if (.not. status%is_ok() .or. .not. found) return
        if (count(is_given) > 1) then
            k = findloc(is_given, .true., dim=1, back=.true.)
            call refuse_value(place, trim(attitude_key(k)), node(k), "stands beside another attitude (expected one of "// &
                "'angles', 'quaternion' and 'rotation')", status)
        else if (is_given(1)) then
            call get_vector(place, "angles", angle, angles, status)
        else if (is_given(2)) then
            call get_vector(place, "quaternion", plain_number, p, status)
            if (.not. status%is_ok()) return
            if (.not. norm2(p) > 0) call refuse_value(place, "quaternion", node(2), &
                "is zero (expected w, x, y, z of any length but zero)", status)
            if (status%is_ok()) angles = angles_of_matrix(matrix_of_quaternion(p))
        else
            call read_matrix(place, node(3), r, status)
            ! as near a rotation as can be
            if (status%is_ok()) angles = angles_of_matrix(matrix_of_quaternion(quaternion_of_matrix(r)))
        end if
    end subroutine get_attitude

    subroutine read_matrix(place, node, r, status)
        type(scene_place), intent(in) :: place
        type(toml_node), intent(in) :: node
        real(wp), intent(out) :: r(3, 3)
        type(status_type), intent(inout) :: status
        character(len=:), allocatable :: fault
        integer :: k

        r = 0
        if (node%kind() /= toml_array .or. node%count() /= 3) then
            call refuse_value(place, "rotation", node, "is not a list of three rows (expected [[..], [..], [..]], from "// &
                "link axes to world axes)", status)
            return
        end if
        do k = 1, 3
            call vector_of(place, "rotation", node%at(k), plain_number, r(k, :), status)
        end do
        if (.not. status%is_ok()) return
        call find_rotation_fault(r, fault)
        if (fault /= "") call refuse_value(place, "rotation", node, fault, status)
    end subroutine read_matrix

    !> Does a table tell attitudes as quaternions?
    logical function has_quaternions(shelf, reading)
        type(table_shelf), intent(in) :: shelf
        type(table_reading), intent(in) :: reading
        integer :: k

        has_quaternions = any([(has_column(shelf, reading, quaternion_column(k)), k=1, 4)])
    end function has_quaternions

    !> Laws of roll, pitch and yaw from the columns qw qx qy qz: splines through them, whose length means nothing.
    subroutine quaternion_laws(place, shelf, reading, law, status)
        type(scene_place), intent(in) :: place
        type(table_shelf), intent(in) :: shelf
        type(table_reading), intent(in) :: reading
        type(law_spec), intent(out) :: law(3)
        type(status_type), intent(inout) :: status
        real(wp), allocatable :: time(:), values(:), p(:, :)
        integer :: k

        if (.not. status%is_ok()) return
        if (reading%interpolation /= spline) then
            call refuse(place, "quaternions are interpolated by splines only (expected interpolation = ""spline"")", status)
            return
        end if
        associate (table => shelf%place(reading%table)%table)
            call column_in_si(table, trim(reading%time), time_span, time, status)
            if (.not. status%is_ok()) return
            allocate (p(size(time), 4))
            do k = 1, 4
                call column_in_si(table, quaternion_column(k), plain_number, values, status)
                if (.not. status%is_ok()) return
                p(:, k) = values
            end do
            call laws_through(table, trim(reading%time), time, p, law, status)
        end associate
    end subroutine quaternion_laws

    !> Laws of roll, pitch and yaw from quaternions at the instants of a table.
    subroutine laws_through(table, time_name, time, p, law, status)
        type(table_spec), intent(in) :: table
        character(len=*), intent(in) :: time_name
        real(wp), intent(in) :: time(:)                !! [s]
        real(wp), intent(inout) :: p(:, :)             !! (row, 4), made unit quaternions on one side
        type(law_spec), intent(out) :: law(3)
        type(status_type), intent(inout) :: status
        real(wp) :: bend(size(time), 4), knot(size(time), 3)
        integer :: k, i

        call line_up(trim(table%file), table%line, p, status)
        if (.not. status%is_ok()) return
        do i = 1, size(time)
            knot(i, :) = angles_of_matrix(matrix_of_quaternion(p(i, :)))
            if (i > 1) knot(i, :) = knot(i, :) + two_pi*anint((knot(i - 1, :) - knot(i, :))/two_pi)
        end do
        do k = 1, 3
            call table_law(table, time_name, time, knot(:, k), spline, law(k), status)
        end do
        if (.not. status%is_ok()) return
        do k = 1, 4
            call fit_spline(time, p(:, k), bend(:, k))
        end do
        do k = 1, 3
            law(k)%angle = k
            law(k)%quaternion = p
            law(k)%bend = bend
        end do
    end subroutine laws_through

    !> Unit quaternions, each on the side of the one before: p and -p are one attitude.
    subroutine line_up(file, line, p, status)
        character(len=*), intent(in) :: file
        integer, intent(in) :: line(:)                 !! of the rows
        real(wp), intent(inout) :: p(:, :)             !! (row, 4)
        type(status_type), intent(inout) :: status
        real(wp), parameter :: too_far = 0.5_wp        !! cosine of half of 120 degrees
        real(wp) :: near
        integer :: i

        do i = 1, size(p, 1)
            if (.not. norm2(p(i, :)) > 0) then
                call fail(status, status_bad_input, file//":"//to_text(line(i))//": qw, qx, qy, qz are zero (expected a "// &
                    "quaternion of any length but zero)")
                return
            end if
            p(i, :) = p(i, :)/norm2(p(i, :))
            if (i == 1) cycle
            near = dot_product(p(i, :), p(i - 1, :))
            if (abs(near) < too_far) then
                call fail(status, status_bad_input, file//":"//to_text(line(i))//": the attitude is more than 120 degrees from "// &
                    "that of the row before (expected rows near enough to define the rotation between them)")
                return
            end if
            p(i, :) = sign(1.0_wp, near)*p(i, :)
        end do
    end subroutine line_up
end module linkdyn_scene_attitudes
