!> Answers of the quadruple twin: the executable `linkdyn-real128`, if it is built, computes the same in files.
!>
!> It is looked for where the environment variable LINKDYN_REAL128 says, then beside this executable.
module linkdyn_twin
    use linkdyn_csv, only: read_csv
    use linkdyn_kinds, only: wp
    use linkdyn_model, only: model_type
    use linkdyn_output_file, only: path_exists, remove_file
    use linkdyn_scene, only: path_len, table_spec
    use linkdyn_status, only: status_type
    use linkdyn_study, only: study_states
    use linkdyn_text, only: to_text
    implicit none (type, external)
    private
    public :: find_twin, ask_inverse, ask_forward

contains

    !> Its path; blank if there is none.
    function find_twin() result(path)
        character(len=:), allocatable :: path
        character(len=path_len) :: text
        integer :: slash

        call get_environment_variable("LINKDYN_REAL128", text)
        path = trim(text)
        if (len(path) == 0) then
            call get_command_argument(0, text)
            slash = index(text, "/", back=.true.)
            if (slash == 0) return
            path = text(:slash)//"linkdyn-real128"
        end if
        if (.not. path_exists(path)) path = ""
    end function find_twin

    !> Driving forces and reactions at some states, in the order of our own results.
    subroutine ask_inverse(twin, scene_file, model, states, value, is_known)
        character(len=*), intent(in) :: twin, scene_file
        type(model_type), intent(in) :: model
        type(study_states), intent(in) :: states
        real(wp), intent(out) :: value(:, :)             !! (n_actuator + components, n)
        logical, intent(out) :: is_known                 !! it answered
        character(len=:), allocatable :: states_file, answer_file
        type(table_spec) :: table

        states_file = scratch_name("states")
        answer_file = scratch_name("forces")
        call write_states(states_file, model, states)
        call run_twin(shell_word(twin)//" inverse "//shell_word(scene_file)//" --states "//shell_word(states_file) &
                      //" --solver lapack --want driving_force,reaction", answer_file, table, is_known)
        call remove_file(states_file)
        if (is_known) call take_columns(table, [character(len=13) :: "driving_force", "reaction"], value, is_known)
    end subroutine ask_inverse

    !> Coordinates at evenly spaced instants of a forward run.
    subroutine ask_forward(twin, scene_file, t_end, n, q, is_known)
        character(len=*), intent(in) :: twin, scene_file
        real(wp), intent(in) :: t_end                    !! [s]
        integer, intent(in) :: n                         !! instants
        real(wp), intent(out) :: q(:, :)                 !! (n_q, n)
        logical, intent(out) :: is_known
        character(len=40) :: until
        type(table_spec) :: table

        write (until, "(es40.17e3)") t_end
        call run_twin(shell_word(twin)//" forward "//shell_word(scene_file)//" --method gbs --rtol 1e-17 --atol 1e-17 --samples " &
                      //to_text(n)//" --until "//trim(adjustl(until))//" --want driving_force", scratch_name("motion"), table, &
                      is_known)
        if (is_known) call take_columns(table, ["q"], q, is_known)
    end subroutine ask_forward

    subroutine run_twin(command, answer_file, table, is_known)
        character(len=*), intent(in) :: command, answer_file
        type(table_spec), intent(out) :: table
        logical, intent(out) :: is_known
        type(status_type) :: status
        integer :: exit_status, outcome

        call execute_command_line(command//" --csv --quiet -o "//shell_word(answer_file)//" 2>/dev/null", &
                                  exitstat=exit_status, cmdstat=outcome)
        is_known = outcome == 0 .and. exit_status == 0
        if (is_known) call read_csv(answer_file, answer_file, table, status, takes_text=.true.)
        is_known = is_known .and. status%is_ok()
        call remove_file(answer_file)
    end subroutine run_twin

    !> Columns whose names start with one of some words, in their order.
    subroutine take_columns(table, start, value, is_known)
        type(table_spec), intent(in) :: table
        character(len=*), intent(in) :: start(:)
        real(wp), intent(out) :: value(:, :)             !! (column, row)
        logical, intent(out) :: is_known
        integer :: i, k, n

        n = 0
        value = 0
        is_known = size(table%value, 1) == size(value, 2)
        do i = 1, size(table%column)
            if (.not. is_known) return
            do k = 1, size(start)
                if (index(table%column(i), trim(start(k))//" ") /= 1) cycle
                n = n + 1
                is_known = n <= size(value, 1)
                if (is_known) value(n, :) = table%value(:, i)
            end do
        end do
        is_known = n == size(value, 1)
    end subroutine take_columns

    !> A file for --states: 17 digits are exactly the doubles.
    subroutine write_states(file, model, states)
        character(len=*), intent(in) :: file
        type(model_type), intent(in) :: model
        type(study_states), intent(in) :: states
        integer :: unit, i, k

        open (newunit=unit, file=file, action="write", status="replace")
        write (unit, "(a)", advance="no") "time"
        do i = 1, 3
            do k = 1, model%n_q
                write (unit, "(a)", advance="no") ","//trim(merge("q  ", merge("qd ", "qdd", i == 2), i == 1))//" " &
                    //trim(model%scene%coordinate(k)%name)
            end do
        end do
        write (unit, "(a)") ""
        do i = 1, size(states%t)
            write (unit, "(*(es26.17e3, :, ','))") states%t(i), states%q(:, i), states%qd(:, i), states%qdd(:, i)
        end do
        close (unit)
    end subroutine write_states

    function scratch_name(what) result(name)
        character(len=*), intent(in) :: what
        character(len=:), allocatable :: name
        character(len=path_len) :: folder
        integer :: count

        call get_environment_variable("TMPDIR", folder)
        if (folder == "") folder = "/tmp"
        call system_clock(count)
        name = trim(folder)//"/linkdyn_"//what//"_"//to_text(count)//".csv"
    end function scratch_name

    !> In single quotes for the shell.
    pure function shell_word(text) result(word)
        character(len=*), intent(in) :: text
        character(len=:), allocatable :: word
        integer :: i

        word = "'"
        do i = 1, len_trim(text)
            if (text(i:i) == "'") then
                word = word//"'\''"
            else
                word = word//text(i:i)
            end if
        end do
        word = word//"'"
    end function shell_word
end module linkdyn_twin
