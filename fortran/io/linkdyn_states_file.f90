!> States from a CSV file in place of the scene's own motion: a row a sample, columns as in the results.
!>
!> Columns are called "q NAME", "qd NAME", "qdd NAME" for every coordinate, with a unit in brackets if it is not SI; a
!> derivative that has no column is zero, other columns are passed over. With a column "time" the samples follow each
!> other along a motion, and the scene's loads act at these instants; without, each sample is on its own, at 0. Results written
!> with `--csv` are such a file, and what one executable computed from them another one computes from exactly the same
!> numbers: they are read as doubles, whatever the working precision.
module linkdyn_states_file
    use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
    use linkdyn_csv, only: read_csv
    use linkdyn_kinds, only: wp
    use linkdyn_scene, only: scene_type, table_spec
    use linkdyn_scene_laws, only: column_in_si
    use linkdyn_status, only: status_type, fail, status_bad_input
    use linkdyn_text, only: to_text, quoted
    use linkdyn_units, only: quantity_type, length, angle, time_span, per_second
    implicit none (type, external)
    private
    public :: states_type, read_states

    !> A batch of states.
    type :: states_type
        logical :: is_motion = .false.                 !! samples follow each other
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
        n = size(table%value, 1)
        states%is_motion = any(table%column == "time")
        allocate (states%time(n), states%q(size(scene%coordinate), n), states%qd(size(scene%coordinate), n), &
                  states%qdd(size(scene%coordinate), n))
        call take_column(table, "time", .false., time_span, states%time, status)
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
    end subroutine read_states

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
                      //": not a finite number (expected one)")
            return
        end do
    end subroutine take_column
end module linkdyn_states_file
