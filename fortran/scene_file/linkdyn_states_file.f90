!> States from a CSV file in place of the scene's own motion: a row a sample, columns as in the results.
!>
!> Columns are called "q NAME", "qd NAME", "qdd NAME" for every coordinate, with a unit in brackets if it is not SI; results
!> and words are passed over, other columns refused (`linkdyn_stray_columns`). With a column "time" the samples follow each
!> other along a motion, and the scene's loads act at these instants. A motion of positions alone gets its rates from the
!> spline that tables of motions have; one with some of the rates is refused: nothing says whether the others are zero or
!> were forgotten. Without times each sample is on its own, at 0, and a derivative that has no column is zero. An attitude,
!> of a link or a ball joint, may be told by its quaternion, "q NAME.qw", .., "q NAME.qz", with "omega NAME.x", .. and
!> "alpha NAME.x", .., angular velocity and acceleration, in place of its three angles and their rates, or by its rotation
!> matrix, "q NAME.r11", "q NAME.r12", .., "q NAME.r33", row by row. Results written with `--csv` are such a file, and what
!> one executable computed from them another one computes from exactly the same numbers: they are read as doubles,
!> whatever the working precision.
module linkdyn_states_file
    use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
    use linkdyn_angles, only: quaternion_of_matrix, find_rotation_fault
    use linkdyn_constants, only: two_pi
    use linkdyn_csv, only: read_csv
    use linkdyn_given_attitudes, only: attitude_name, take_attitudes, attitude_size
    use linkdyn_kinds, only: wp
    use linkdyn_laws, only: evaluate_law
    use linkdyn_model, only: model_type, gives_attitude, attitude_angles
    use linkdyn_scene, only: scene_type, table_spec, law_spec, name_len, wants_instants
    use linkdyn_scene_attitudes, only: laws_through, quaternion_column
    use linkdyn_scene_laws, only: column_in_si, table_law, spline
    use linkdyn_status, only: status_type, fail, status_bad_input
    use linkdyn_stray_columns, only: bracket_remedy, result_words, what_is_meant, word_len
    use linkdyn_suggest, only: suggestion
    use linkdyn_table, only: table_place, find_places, attitude_at
    use linkdyn_text, only: to_text, quoted
    use linkdyn_units, only: quantity_type, length, angle, time_span, plain_number, per_second
    implicit none (type, external)
    private
    public :: states_type, read_states

    character, parameter :: axis_name(3) = ["x", "y", "z"]
    character(len=3), parameter :: rotation_column(9) = ["r11", "r12", "r13", "r21", "r22", "r23", "r31", "r32", "r33"]

    !> A batch of states.
    type :: states_type
        logical :: is_motion = .false.                 !! samples follow each other
        logical :: has_spline_rates = .false.          !! qd and qdd are those of a spline through q
        real(wp), allocatable :: time(:)               !! [s] (n)
        real(wp), allocatable :: q(:, :), qd(:, :), qdd(:, :)    !! (n_q, n)
        real(wp), allocatable :: attitude(:, :, :)     !! of samples near poles, as of `take_attitudes`
                                                       !! (attitude_size, n_attitude, n); not allocated: no quaternions are given
    end type states_type

contains

    !> Read the states of a scene's coordinates.
    !>
    !> **Errors**: bad input for a missing column, a wrong unit, a value that is no finite number; file and line.
    subroutine read_states(file, model, states, status)
        character(len=*), intent(in) :: file
        type(model_type), intent(in) :: model
        type(states_type), intent(out) :: states
        type(status_type), intent(inout) :: status
        type(table_spec) :: table

        call read_csv(file, "--states: "//quoted(file), table, status, takes_text=.true.)
        if (.not. status%is_ok()) return
        call read_columns(model, model%scene, turned_attitudes(model, table), table, states, status)
    end subroutine read_states

    !> The attitudes of which there is a quaternion or a rotation matrix.
    pure function turned_attitudes(model, table) result(is_turned)
        type(model_type), intent(in) :: model
        type(table_spec), intent(in) :: table
        logical :: is_turned(model%n_attitude)
        integer :: i

        is_turned = [(has_any(table, quaternion_columns(model, i)) .or. has_any(table, rotation_columns(model, i)), &
                      i=1, model%n_attitude)]
    end function turned_attitudes

    pure logical function has_any(table, column)
        type(table_spec), intent(in) :: table
        character(len=*), intent(in) :: column(:)
        integer :: k

        has_any = any([(any(table%column == column(k)), k=1, size(column))])
    end function has_any

    subroutine read_columns(model, scene, is_turned, table, states, status)
        type(model_type), intent(in) :: model
        type(scene_type), intent(in) :: scene
        logical, intent(in) :: is_turned(:)            !! (attitude)
        type(table_spec), intent(in) :: table
        type(states_type), intent(inout) :: states
        type(status_type), intent(inout) :: status
        type(quantity_type) :: quantity
        logical :: by_angle(size(scene%coordinate))
        integer :: n, k

        by_angle = are_by_angle(model, is_turned)
        call refuse_misnamed(model, is_turned, by_angle, table, scene, status)
        if (.not. status%is_ok()) return
        n = size(table%value, 1)
        states%is_motion = any(table%column == "time")
        if (states%is_motion) call find_out_rates(model, is_turned, by_angle, table, scene, states%has_spline_rates, status)
        allocate (states%time(n), states%q(size(scene%coordinate), n), states%qd(size(scene%coordinate), n), &
                  states%qdd(size(scene%coordinate), n))
        call take_column(table, "time", wants_instants(scene), time_span, states%time, status)
        states%q = 0
        states%qd = 0
        states%qdd = 0
        do k = 1, size(scene%coordinate)
            if (.not. by_angle(k)) cycle
            associate (coordinate => scene%coordinate(k))
                quantity = length
                if (coordinate%unit == "rad") quantity = angle
                call take_column(table, trim(position_column(coordinate%name)), .true., quantity, states%q(k, :), status)
                call take_column(table, "qd "//trim(coordinate%name), .false., per_second(quantity), states%qd(k, :), status)
                call take_column(table, "qdd "//trim(coordinate%name), .false., per_second(per_second(quantity)), &
                                 states%qdd(k, :), status)
            end associate
        end do
        if (states%has_spline_rates .and. status%is_ok()) call add_spline_rates(table, by_angle, states, status)
        if (any(is_turned) .and. status%is_ok()) call read_attitudes(model, is_turned, table, states, status)
    end subroutine read_columns

    !> Coordinates but the angles of attitudes that are told otherwise.
    pure function are_by_angle(model, is_turned) result(by_angle)
        type(model_type), intent(in) :: model
        logical, intent(in) :: is_turned(:)
        logical :: by_angle(model%n_q)
        integer :: s

        by_angle = .true.
        do s = 1, size(model%step)
            if (.not. gives_attitude(model, model%step(s))) cycle
            if (is_turned(model%step(s)%first)) by_angle(attitude_angles(model%step(s))) = .false.
        end do
    end function are_by_angle

    !> Attitudes by their quaternions or matrices, as angles with their turns; what has to go by quaternions stays in `attitude`.
    subroutine read_attitudes(model, is_turned, table, states, status)
        type(model_type), intent(in) :: model
        logical, intent(in) :: is_turned(:)
        type(table_spec), intent(in) :: table
        type(states_type), intent(inout) :: states
        type(status_type), intent(inout) :: status
        character(len=:), allocatable :: name
        real(wp) :: p(size(states%time), 4)
        integer :: i, k, s, c(3)

        allocate (states%attitude(attitude_size, model%n_attitude, size(states%time)), source=0.0_wp)
        do i = 1, model%n_attitude
            if (.not. is_turned(i)) cycle
            name = trim(attitude_name(model, i))
            if (has_any(table, rotation_columns(model, i))) then
                call take_matrices(model, i, table, p, status)
            else
                call take_quaternions(model, i, table, p, status)
            end if
            do k = 1, 3
                call take_column(table, "omega "//name//"."//axis_name(k), .false., per_second(angle), &
                                 states%attitude(4 + k, i, :), status)
                call take_column(table, "alpha "//name//"."//axis_name(k), .false., per_second(per_second(angle)), &
                                 states%attitude(7 + k, i, :), status)
            end do
            if (.not. status%is_ok()) return
            states%attitude(:4, i, :) = transpose(p)
            if (states%has_spline_rates) call take_spline(i)
        end do
        if (.not. status%is_ok()) return
        call take_attitudes(model, states%attitude, states%q, states%qd, states%qdd)
        if (.not. states%is_motion) return
        do s = 1, size(model%step)
            if (.not. gives_attitude(model, model%step(s))) cycle
            if (.not. is_turned(model%step(s)%first)) cycle
            c = attitude_angles(model%step(s))
            do i = 2, size(states%time)
                states%q(c, i) = states%q(c, i) + two_pi*anint((states%q(c, i - 1) - states%q(c, i))/two_pi)
            end do
        end do

    contains

        !> Angular velocity and acceleration of the spline that tables of quaternions have.
        subroutine take_spline(i)
            integer, intent(in) :: i
            type(law_spec) :: law(3)
            type(table_place) :: place(size(states%time))
            integer :: k, near

            call laws_through(table, "time", states%time, p, law, status)
            if (.not. status%is_ok()) return
            near = 1
            call find_places(law(1)%time, states%time, near, place)
            do k = 1, size(place)
                associate (its => states%attitude(:, i, k))
                    call attitude_at(law(1), place(k), its(:4), its(5:7), its(8:10))
                end associate
            end do
        end subroutine take_spline
    end subroutine read_attitudes

    !> The quaternions of an attitude, of any length but zero.
    subroutine take_quaternions(model, i, table, p, status)
        type(model_type), intent(in) :: model
        integer, intent(in) :: i                       !! attitude
        type(table_spec), intent(in) :: table
        real(wp), intent(out) :: p(:, :)               !! (row, 4)
        type(status_type), intent(inout) :: status
        character(len=name_len + 8) :: column(4)
        integer :: k

        column = quaternion_columns(model, i)
        do k = 1, size(column)
            call take_column(table, trim(column(k)), .true., plain_number, p(:, k), status)
        end do
        do k = 1, size(p, 1)
            if (.not. status%is_ok()) return
            if (.not. norm2(p(k, :)) > 0) call fail(status, status_bad_input, trim(table%file)//":"//to_text(table%line(k)) &
                //": the quaternion of "//quoted(trim(attitude_name(model, i)))//" is zero (expected one of any length but zero)")
        end do
    end subroutine take_quaternions

    !> The quaternions of the rotations that are nearest to an attitude's matrices.
    subroutine take_matrices(model, i, table, p, status)
        type(model_type), intent(in) :: model
        integer, intent(in) :: i                       !! attitude
        type(table_spec), intent(in) :: table
        real(wp), intent(out) :: p(:, :)               !! (row, 4)
        type(status_type), intent(inout) :: status
        character(len=name_len + 8) :: column(9)
        character(len=:), allocatable :: fault
        real(wp) :: r(3, 3), element(size(p, 1), 9)
        integer :: k

        p = 0
        column = rotation_columns(model, i)
        do k = 1, size(column)
            call take_column(table, trim(column(k)), .true., plain_number, element(:, k), status)
        end do
        do k = 1, size(p, 1)
            if (.not. status%is_ok()) return
            r = transpose(reshape(element(k, :), [3, 3]))
            call find_rotation_fault(r, fault)
            if (fault /= "") call fail(status, status_bad_input, trim(table%file)//":"//to_text(table%line(k)) &
                                       //": the rotation of "//quoted(trim(attitude_name(model, i)))//" "//fault)
            p(k, :) = quaternion_of_matrix(r)
        end do
    end subroutine take_matrices

    !> A column that is meant for a state must not be passed over: without its times a motion is a row of poses at rest,
    !> and a rate that is not found is zero.
    subroutine refuse_misnamed(model, is_turned, by_angle, table, scene, status)
        type(model_type), intent(in) :: model
        logical, intent(in) :: is_turned(:), by_angle(:)    !! (attitude), (coordinate)
        type(table_spec), intent(in) :: table
        type(scene_type), intent(in) :: scene
        type(status_type), intent(inout) :: status
        character(len=name_len + 8), allocatable :: own(:)
        character(len=word_len), allocatable :: words(:)
        character(len=:), allocatable :: name, remedy
        logical :: is_of_coordinate
        integer :: i, k, blank

        words = result_words(scene)
        own = [character(len=name_len + 8) :: "time"]
        do k = 1, size(by_angle)
            if (by_angle(k)) own = [own, position_column(scene%coordinate(k)%name), rate_columns(scene%coordinate(k)%name)]
        end do
        do i = 1, size(is_turned)
            if (.not. is_turned(i)) cycle
            own = [own, quaternion_columns(model, i), rotation_columns(model, i), spin_columns(model, i)]
            if (has_any(table, quaternion_columns(model, i)) .and. has_any(table, rotation_columns(model, i))) &
                call fail(status, status_bad_input, trim(table%file)//": "//quoted(trim(attitude_name(model, i))) &
                          //" has columns of a quaternion and of a rotation matrix (expected one or the other)")
        end do
        do i = 1, size(table%column)
            if (any(own == table%column(i))) cycle
            associate (column => table%column(i))
                blank = index(column, " ")
                name = trim(adjustl(column(blank:)))
                is_of_coordinate = any(column(:blank) == ["q  ", "qd ", "qdd"])
                k = findloc(scene%coordinate%name == name, .true., dim=1)
                remedy = bracket_remedy(column, own)
                if (remedy /= "") then
                    call refuse(remedy)
                else if (any(column(:blank) == ["omega", "alpha"])) then
                    call refuse("no attitude of that name is told by its quaternion or matrix (expected columns 'q NAME.qw' to " &
                                //"'q NAME.qz', or 'q NAME.r11' to 'q NAME.r33', beside it)")
                else if (is_of_coordinate .and. k == 0) then
                    call refuse("there is no coordinate "//quoted(name)//suggestion(name, scene%coordinate%name))
                else if (is_of_coordinate .and. .not. by_angle(max(k, 1))) then
                    call refuse("stands beside the quaternion or matrix of the same attitude (expected one or the other)")
                else
                    call refuse(what_is_meant(table, i, own, words))
                end if
            end associate
            if (.not. status%is_ok()) return
        end do

    contains

        subroutine refuse(problem)
            character(len=*), intent(in) :: problem    !! empty: there is none

            if (problem /= "") call fail(status, status_bad_input, trim(table%file)//": column "//quoted(table%column(i)) &
                                         //": "//problem)
        end subroutine refuse
    end subroutine refuse_misnamed

    !> All rates of a motion are there, or none.
    subroutine find_out_rates(model, is_turned, by_angle, table, scene, has_none, status)
        type(model_type), intent(in) :: model
        logical, intent(in) :: is_turned(:), by_angle(:)
        type(table_spec), intent(in) :: table
        type(scene_type), intent(in) :: scene
        logical, intent(out) :: has_none
        type(status_type), intent(inout) :: status
        character(len=name_len + 8), allocatable :: rate(:)
        logical, allocatable :: is_there(:)
        integer :: k

        rate = [character(len=name_len + 8) ::]
        do k = 1, size(scene%coordinate)
            if (by_angle(k)) rate = [rate, rate_columns(scene%coordinate(k)%name)]
        end do
        do k = 1, size(is_turned)
            if (is_turned(k)) rate = [rate, spin_columns(model, k)]
        end do
        is_there = [(any(table%column == rate(k)), k=1, size(rate))]
        has_none = .not. any(is_there)
        if (has_none .or. all(is_there)) return
        call fail(status, status_bad_input, trim(table%file)//": a motion with some of the rates, but no column " &
                  //quoted(rate(findloc(is_there, .false., dim=1)))//" (expected all of them, or positions alone)")
    end subroutine find_out_rates

    !> Name of the column that has a coordinate.
    pure function position_column(coordinate) result(column)
        character(len=*), intent(in) :: coordinate
        character(len=name_len + 8) :: column

        column = "q "//coordinate
    end function position_column

    !> Names of the columns that have a coordinate's rate and acceleration.
    pure function rate_columns(coordinate) result(column)
        character(len=*), intent(in) :: coordinate
        character(len=name_len + 8) :: column(2)

        column(1) = "qd "//coordinate
        column(2) = "qdd "//coordinate
    end function rate_columns

    !> Names of the columns that have an attitude's quaternion.
    pure function quaternion_columns(model, attitude) result(column)
        type(model_type), intent(in) :: model
        integer, intent(in) :: attitude
        character(len=name_len + 8) :: column(4)
        integer :: k

        column = [("q "//trim(attitude_name(model, attitude))//"."//quaternion_column(k), k=1, 4)]
    end function quaternion_columns

    !> Columns that have an attitude's rotation matrix, row by row.
    pure function rotation_columns(model, attitude) result(column)
        type(model_type), intent(in) :: model
        integer, intent(in) :: attitude
        character(len=name_len + 8) :: column(9)
        integer :: k

        column = [("q "//trim(attitude_name(model, attitude))//"."//rotation_column(k), k=1, 9)]
    end function rotation_columns

    !> Columns that have an attitude's angular velocity and acceleration.
    pure function spin_columns(model, attitude) result(column)
        type(model_type), intent(in) :: model
        integer, intent(in) :: attitude
        character(len=name_len + 8) :: column(6)
        integer :: k

        column(:3) = [("omega "//trim(attitude_name(model, attitude))//"."//axis_name(k), k=1, 3)]
        column(4:) = [("alpha "//trim(attitude_name(model, attitude))//"."//axis_name(k), k=1, 3)]
    end function spin_columns

    !> Rates at the instants of a table that has positions alone.
    subroutine add_spline_rates(table, by_angle, states, status)
        type(table_spec), intent(in) :: table
        logical, intent(in) :: by_angle(:)
        type(states_type), intent(inout) :: states
        type(status_type), intent(inout) :: status
        type(law_spec) :: law
        real(wp) :: position
        integer :: i, k

        do k = 1, size(states%q, 1)
            if (.not. by_angle(k)) cycle
            call table_law(table, "time", states%time, states%q(k, :), spline, law, status)
            if (.not. status%is_ok()) return
            do i = 1, size(states%time)
                call evaluate_law(law, states%time(i), position, states%qd(k, i), states%qdd(k, i))
            end do
        end do
    end subroutine add_spline_rates

    !> One column in SI; zero if there is none and none is needed.
    subroutine take_column(table, name, is_needed, quantity, values, status)
        type(table_spec), intent(in) :: table
        character(len=*), intent(in) :: name
        logical, intent(in) :: is_needed
        type(quantity_type), intent(in) :: quantity
        real(wp), intent(out) :: values(:)
        type(status_type), intent(inout) :: status
        type(table_spec) :: strict
        real(wp), allocatable :: found(:)

        values = 0
        if (.not. status%is_ok()) return
        if (.not. is_needed .and. .not. any(table%column == name)) return
        call column_in_si(table, name, quantity, found, status)
        if (.not. status%is_ok()) return
        values = found
        if (all(ieee_is_finite(values))) return
        ! Words were let through; the reader of tables says which stands here in place of a number.
        call read_csv(table%file, "--states: "//quoted(table%file), strict, status, takes_text=.true., but_in=name)
        if (status%is_ok()) call fail(status, status_bad_input, trim(table%file)//": column "//quoted(name) &
                                      //": not a finite number (expected one)")
    end subroutine take_column
end module linkdyn_states_file
