!> States from a CSV file in place of the scene's own motion: a row a sample, columns as in the results.
!>
!> Columns are called "q NAME", "qd NAME", "qdd NAME" for every coordinate, with a unit in brackets if it is not SI; other
!> columns are passed over, but not those that seem to be meant. With a column "time" the samples follow each other along a motion, and the scene's loads act at
!> these instants. A motion of positions alone gets its rates from the spline that tables of motions have; one with some of
!> the rates is refused: nothing says whether the others are zero or were forgotten. Without times each sample is on its own,
!> at 0, and a derivative that has no column is zero. Results written
!> with `--csv` are such a file, and what one executable computed from them another one computes from exactly the same
!> numbers: they are read as doubles, whatever the working precision.
module linkdyn_states_file
    use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
    use linkdyn_csv, only: read_csv
    use linkdyn_kinds, only: wp
    use linkdyn_laws, only: evaluate_law
    use linkdyn_scene, only: scene_type, table_spec, law_spec, name_len, wants_instants
    use linkdyn_scene_laws, only: column_in_si, table_law, spline
    use linkdyn_status, only: status_type, fail, status_bad_input
    use linkdyn_suggest, only: suggestion
    use linkdyn_text, only: to_text, quoted
    use linkdyn_units, only: quantity_type, length, angle, time_span, per_second
    implicit none (type, external)
    private
    public :: states_type, read_states

    !> A batch of states.
    type :: states_type
        logical :: is_motion = .false.                 !! samples follow each other
        logical :: has_spline_rates = .false.          !! qd and qdd are those of a spline through q
        real(wp), allocatable :: time(:)               !! [s] (n)
        real(wp), allocatable :: q(:, :), qd(:, :), qdd(:, :)    !! (n_q, n)
    end type states_type

contains

    !> Read the states of a scene's coordinates.
    !>
    !> **Errors**: bad input for a missing column, a wrong unit, a value that is no finite number; file and line.
    subroutine read_states(file, scene, states, status)
        character(len=*), intent(in) :: file
        type(scene_type), intent(in) :: scene
        type(states_type), intent(out) :: states
        type(status_type), intent(inout) :: status
        type(table_spec) :: table
        type(quantity_type) :: quantity
        integer :: n, k

        call read_csv(file, "--states: "//quoted(file), table, status, takes_text=.true.)
        if (.not. status%is_ok()) return
        call refuse_misnamed(table, scene, status)
        if (.not. status%is_ok()) return
        n = size(table%value, 1)
        states%is_motion = any(table%column == "time")
        if (states%is_motion) call find_out_rates(table, scene, states%has_spline_rates, status)
        allocate (states%time(n), states%q(size(scene%coordinate), n), states%qd(size(scene%coordinate), n), &
                  states%qdd(size(scene%coordinate), n))
        call take_column(table, "time", wants_instants(scene), time_span, states%time, status)
        do k = 1, size(scene%coordinate)
            associate (coordinate => scene%coordinate(k))
                quantity = length
                if (coordinate%unit == "rad") quantity = angle
                call take_column(table, "q "//trim(coordinate%name), .true., quantity, states%q(k, :), status)
                call take_column(table, "qd "//trim(coordinate%name), .false., per_second(quantity), states%qd(k, :), status)
                call take_column(table, "qdd "//trim(coordinate%name), .false., per_second(per_second(quantity)), &
                                 states%qdd(k, :), status)
            end associate
        end do
        if (states%has_spline_rates .and. status%is_ok()) call add_spline_rates(table, states, status)
    end subroutine read_states

    !> A column that is meant for a state must not be passed over: without its times a motion is a row of poses at rest.
    subroutine refuse_misnamed(table, scene, status)
        type(table_spec), intent(in) :: table
        type(scene_type), intent(in) :: scene
        type(status_type), intent(inout) :: status
        integer :: i, blank

        do i = 1, size(table%column)
            associate (column => table%column(i))
                blank = index(column, " ")
                if (all(column(:blank) /= ["q  ", "qd ", "qdd"])) then
                    if (all(table%column /= "time") .and. looks_like_time(column)) call fail(status, status_bad_input, &
                        trim(table%file)//": column "//quoted(column)//": instants are not called so (expected 'time')")
                else if (all(scene%coordinate%name /= adjustl(column(blank:)))) then
                    call fail(status, status_bad_input, trim(table%file)//": column "//quoted(column)//": there is no coordinate " &
                        //quoted(adjustl(column(blank:)))//suggestion(adjustl(column(blank:)), scene%coordinate%name))
                end if
            end associate
            if (.not. status%is_ok()) return
        end do
    end subroutine refuse_misnamed

    pure logical function looks_like_time(column)
        character(len=*), intent(in) :: column

        looks_like_time = any(column == ["t   ", "T   ", "Time", "TIME"]) .or. suggestion(column, ["time"]) /= ""
    end function looks_like_time

    !> All rates of a motion are there, or none.
    subroutine find_out_rates(table, scene, has_none, status)
        type(table_spec), intent(in) :: table
        type(scene_type), intent(in) :: scene
        logical, intent(out) :: has_none
        type(status_type), intent(inout) :: status
        character(len=name_len + 4), allocatable :: rate(:)
        logical, allocatable :: is_there(:)
        integer :: k

        rate = [character(len=name_len + 4) :: ("qd "//scene%coordinate(k)%name, "qdd "//scene%coordinate(k)%name, &
                                                k=1, size(scene%coordinate))]
        is_there = [(any(table%column == rate(k)), k=1, size(rate))]
        has_none = .not. any(is_there)
        if (has_none .or. all(is_there)) return
        call fail(status, status_bad_input, trim(table%file)//": a motion with some of the rates, but no column " &
                  //quoted(rate(findloc(is_there, .false., dim=1)))//" (expected all of them, or positions alone)")
    end subroutine find_out_rates

    !> Rates at the instants of a table that has positions alone.
    subroutine add_spline_rates(table, states, status)
        type(table_spec), intent(in) :: table
        type(states_type), intent(inout) :: states
        type(status_type), intent(inout) :: status
        type(law_spec) :: law
        real(wp) :: position
        integer :: i, k

        do k = 1, size(states%q, 1)
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
        real(wp), allocatable :: found(:)
        integer :: i

        values = 0
        if (.not. status%is_ok()) return
        if (.not. is_needed .and. .not. any(table%column == name)) return
        call column_in_si(table, name, quantity, found, status)
        if (.not. status%is_ok()) return
        values = found
        do i = 1, size(values)
            if (ieee_is_finite(values(i))) cycle
            call fail(status, status_bad_input, trim(table%file)//":"//to_text(table%line(i))//": column "//quoted(name) &
                      //": not a finite number (expected one, with a decimal point)")
            return
        end do
    end subroutine take_column
end module linkdyn_states_file
