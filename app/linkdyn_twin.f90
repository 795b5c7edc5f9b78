!> Answers of the quadruple twin: the executable `linkdyn-real128`, if it is built, computes the same.
!>
!> It is looked for where the environment variable LINKDYN_REAL128 says, then beside this executable.
module linkdyn_twin
    use linkdyn_child, only: word_type, run_program
    use linkdyn_csv, only: parse_csv
    use linkdyn_kinds, only: wp
    use linkdyn_model, only: model_type
    use linkdyn_path, only: path_exists
    use linkdyn_scene, only: path_len, table_spec
    use linkdyn_status, only: status_type
    use linkdyn_study, only: study_states
    use linkdyn_text, only: to_text
    implicit none (type, external)
    private
    public :: find_twin, ask_inverse, ask_forward

contains

    !> Path of the quadruple build's command; blank if there is none.
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
        type(table_spec) :: table

        call run_twin([word_type(twin), word_type("inverse"), word_type(scene_file), word_type("--states"), &
                       word_type("/dev/stdin"), word_type("--solver"), word_type("lapack"), word_type("--want"), &
                       word_type("driving_force,reaction")], states_as_csv(model, states), table, is_known)
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
        call run_twin([word_type(twin), word_type("forward"), word_type(scene_file), word_type("--method"), word_type("gbs"), &
                       word_type("--rtol"), word_type("1e-17"), word_type("--atol"), word_type("1e-17"), &
                       word_type("--samples"), word_type(to_text(n)), word_type("--until"), word_type(trim(adjustl(until))), &
                       word_type("--want"), word_type("driving_force")], "", table, is_known)
        if (is_known) call take_columns(table, ["q"], q, is_known)
    end subroutine ask_forward

    !> Run the quadruple build's command; its results come through a pipe.
    subroutine run_twin(word, input, table, is_known)
        type(word_type), intent(in) :: word(:)
        character(len=*), intent(in) :: input
        type(table_spec), intent(out) :: table
        logical, intent(out) :: is_known
        character(len=:), allocatable :: answer
        type(status_type) :: status
        integer :: exit_status

        call run_program([word, word_type("--csv"), word_type("--quiet"), word_type("-o"), word_type("/dev/stdout")], input, &
                         answer, exit_status)
        is_known = exit_status == 0
        if (is_known) call parse_csv(answer, "the quadruple twin", table, status, takes_text=.true.)
        is_known = is_known .and. status%is_ok()
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

    !> What --states reads: 17 digits are exactly the doubles.
    function states_as_csv(model, states) result(text)
        type(model_type), intent(in) :: model
        type(study_states), intent(in) :: states
        character(len=:), allocatable :: text
        character(len=3), parameter :: kind(3) = ["q  ", "qd ", "qdd"]
        character(len=27*(1 + 3*model%n_q)) :: row
        integer :: i, k

        text = "time"
        do i = 1, 3
            do k = 1, model%n_q
                text = text//","//trim(kind(i))//" "//trim(model%scene%coordinate(k)%name)
            end do
        end do
        do i = 1, size(states%t)
            write (row, "(*(es26.17e3, :, ','))") states%t(i), states%q(:, i), states%qd(:, i), states%qdd(:, i)
            text = text//new_line("a")//trim(row)
        end do
    end function states_as_csv
end module linkdyn_twin
