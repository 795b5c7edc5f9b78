!> `linkdyn study`: every solver and every integrator on one scene, time against error, and what to use.
module linkdyn_drive_study
    use linkdyn_cli, only: command_line
    use linkdyn_load_model, only: load_model
    use linkdyn_kinds, only: wp
    use linkdyn_model, only: model_type
    use linkdyn_motion, only: evaluate_motion, sample_count
    use linkdyn_output_file, only: output_file, open_output, write_text, finish_text, discard_output
    use linkdyn_path, only: refuse_inputs
    use linkdyn_run_output, only: default_name, exit_done, exit_bad_input
    use linkdyn_scene, only: scene_type
    use linkdyn_status, only: status_type, fail, status_bad_input
    use linkdyn_study, only: study_row, study_states, keep_computable, study_inverse, study_forward, recommend, warn_of_growth, &
        warn_of_reference
    use linkdyn_terminal, only: show_stage, say
    use linkdyn_text, only: to_text
    use linkdyn_twin, only: find_twin, ask_inverse, ask_forward
    implicit none (type, external)
    private
    public :: drive_study

    integer, parameter :: most_samples = 48      !! of the inverse part: the twin takes a while for each
    integer, parameter :: n_instant = 11         !! of a forward run at which it is compared
    real(wp), parameter :: failed = 1.0e30_wp    !! an error above this is that of a method that has come to no end

contains

    !> Measure, print, write, recommend.
    subroutine drive_study(config, unit, exit_status)
        type(command_line), intent(in) :: config
        integer, intent(in) :: unit
        integer, intent(out) :: exit_status
        type(model_type), target :: model
        type(study_row), allocatable :: inverse(:), forward(:)
        type(output_file) :: file
        type(status_type) :: status, inverse_status, forward_status
        character(len=:), allocatable :: twin
        real(wp) :: tenfold, astray(2)
        logical :: by_twin(2)

        exit_status = exit_bad_input
        call load_model(config%scene, .false., model, status)
        if (status%is_ok() .and. config%has_until .and. .not. config%until > model%scene%time%first) &
            call fail(status, status_bad_input, config%scene//": "//nowhere(model%scene%time%first, config%until))
        if (status%is_ok() .and. .not. config%no_output) call open_table(config, model%scene, file, status)
        if (status%is_ok()) then
            twin = find_twin()
            call show_stage("measuring inverse dynamics")
            call measure_inverse(config, model, twin, inverse, by_twin(1), inverse_status)
            call show_stage("measuring forward dynamics")
            call measure_forward(config, model, twin, forward, tenfold, astray, by_twin(2), forward_status)
            if (size(inverse) + size(forward) == 0) call fail(status, status_bad_input, config%scene &
                //": neither inverse nor forward dynamics can be computed: "//trim(inverse_status%message)//"; " &
                //trim(forward_status%message))
        end if
        if (status%is_ok() .and. .not. config%no_output) call write_rows([inverse, forward], file, status)
        if (.not. status%is_ok()) then
            call discard_output(file)
            call say(status%message)
            return
        end if
        exit_status = exit_done
        if (config%quiet) return
        if (len_trim(model%scene%title) > 0) write (unit, "(a)") trim(model%scene%title)
        write (unit, "(a)") "  errors against "//reference_words(twin /= "", by_twin .or. [size(inverse) == 0, size(forward) == 0])
        if (size(inverse) > 0) call print_inverse(inverse, unit)
        if (size(inverse) == 0) write (unit, "(/, a)") "  no inverse dynamics: "//trim(inverse_status%message)
        if (size(forward) > 0) call print_forward(forward, tenfold, astray, unit)
        if (size(forward) == 0) write (unit, "(/, a)") "  no forward dynamics: "//trim(forward_status%message)
    end subroutine drive_study

    !> What errors are measured against.
    pure function reference_words(has_twin, by_twin) result(words)
        logical, intent(in) :: has_twin
        logical, intent(in) :: by_twin(2)            !! it has answered for inverse and for forward dynamics, or was not asked
        character(len=:), allocatable :: words
        character(len=*), parameter :: own = "the most careful result of its own"
        character(len=*), parameter :: analysis(2) = [character(len=7) :: "inverse", "forward"]

        if (.not. has_twin) then
            words = own//" (the quadruple twin is not built: make real128)"
        else if (all(by_twin)) then
            words = "the quadruple twin"
        else if (any(by_twin)) then
            words = "the quadruple twin, of "//analysis(findloc(by_twin, .false., dim=1))//" dynamics against "//own &
                    //" (the twin gave no answer)"
        else
            words = own//" (the quadruple twin gave no answer)"
        end if
    end function reference_words

    !> Solvers at instants of the scene's motion.
    subroutine measure_inverse(config, model, twin, row, by_twin, status)
        type(command_line), intent(in) :: config
        type(model_type), intent(in) :: model
        character(len=*), intent(in) :: twin
        type(study_row), allocatable, intent(out) :: row(:)
        logical, intent(out) :: by_twin              !! errors are against it
        type(status_type), intent(out) :: status
        type(study_states) :: states
        real(wp), allocatable :: exact(:, :)
        integer :: i, n

        allocate (row(0))
        by_twin = .false.

        n = min(most_samples, sample_count(model))
        allocate (states%q(model%n_q, n), states%qd(model%n_q, n), states%qdd(model%n_q, n), states%load(6, model%n_load, n))
        states%t = [(model%scene%time%first + (model%scene%time%last - model%scene%time%first) &
                     *(real(i - 1, wp)/max(1, n - 1)), i=1, n)]
        call evaluate_motion(model, states%t, states%q, states%qd, states%qdd, states%load)
        call keep_computable(model, states, status)
        if (.not. status%is_ok()) return
        if (twin /= "") then
            allocate (exact(model%n_actuator + model%n_component*model%n_joint, size(states%t)))
            call ask_inverse(twin, config%scene, model, states, exact, by_twin)
        end if
        if (by_twin) then
            call study_inverse(model, states, exact, row, status)
        else
            call study_inverse(model, states, row=row, status=status)
        end if
    end subroutine measure_inverse

    !> Integrators from the scene's start on.
    subroutine measure_forward(config, model, twin, row, tenfold, astray, by_twin, status)
        type(command_line), intent(in) :: config
        type(model_type), intent(in), target :: model
        character(len=*), intent(in) :: twin
        type(study_row), allocatable, intent(out) :: row(:)
        real(wp), intent(out) :: tenfold, astray(2)  !! see `study_forward`
        logical, intent(out) :: by_twin              !! errors are against it
        type(status_type), intent(out) :: status
        real(wp) :: exact(model%n_q, n_instant), first, last, t(n_instant)
        integer :: i

        allocate (row(0))
        by_twin = .false.
        tenfold = 0
        astray = 0
        first = model%scene%time%first
        last = merge(config%until, model%scene%time%last, config%has_until)
        if (.not. last > first) then
            call fail(status, status_bad_input, nowhere(first, last))
            return
        end if
        t = [(first + (last - first)*(real(i - 1, wp)/(n_instant - 1)), i=1, n_instant)]
        t(n_instant) = last
        if (twin /= "") call ask_forward(twin, config%scene, last, n_instant, exact, by_twin)
        if (by_twin) then
            call study_forward(model, t, exact, row, tenfold, astray, status)
        else
            call study_forward(model, t, row=row, tenfold=tenfold, astray=astray, status=status)
        end if
    end subroutine measure_forward

    function nowhere(first, last) result(words)
        real(wp), intent(in) :: first, last          !! [s]
        character(len=:), allocatable :: words

        words = "a run from "//to_text(first)//" s to "//to_text(last)//" s has no duration (expected [time] end, or --until)"
    end function nowhere

    subroutine print_inverse(row, unit)
        type(study_row), intent(in) :: row(:)
        integer, intent(in) :: unit
        integer :: i

        write (unit, "(/, 2x, a24, a16, a12)") [character(len=24) :: "inverse: solver"], "us a sample", "error"
        do i = 1, size(row)
            if (row(i)%error > failed) then
                write (unit, "(2x, a24, f16.3, a12)") [character(len=24) :: row(i)%method], 1.0e6_wp*row(i)%seconds, "failed"
            else
                write (unit, "(2x, a24, f16.3, es12.1)") [character(len=24) :: row(i)%method], 1.0e6_wp*row(i)%seconds, row(i)%error
            end if
        end do
        call print_advice(row, "inverse", [1.0e-12_wp], unit)
    end subroutine print_inverse

    subroutine print_forward(row, tenfold, astray, unit)
        type(study_row), intent(in) :: row(:)
        real(wp), intent(in) :: tenfold, astray(2)
        integer, intent(in) :: unit
        integer :: i

        write (unit, "(/, 2x, a8, 2x, a18, a8, a12, a12)") [character(len=8) :: "forward:"], &
            [character(len=18) :: "setting"], "steps", "ms", "error"
        do i = 1, size(row)
            if (row(i)%error > failed) then
                write (unit, "(2x, a8, 2x, a18, i8, f12.3, a12)") row(i)%method, row(i)%setting, row(i)%n_step, &
                    1.0e3_wp*row(i)%seconds, "failed"
            else
                write (unit, "(2x, a8, 2x, a18, i8, f12.3, es12.1)") row(i)%method, row(i)%setting, row(i)%n_step, &
                    1.0e3_wp*row(i)%seconds, row(i)%error
            end if
        end do
        if (tenfold > 0) write (unit, "(/, a)") "  "//warn_of_growth(tenfold)
        if (astray(1) > 0) write (unit, "(/, a)") "  "//warn_of_reference(astray)
        call print_advice(row, "forward", [1.0e-3_wp, 1.0e-6_wp, 1.0e-9_wp], unit)
    end subroutine print_forward

    subroutine print_advice(row, analysis, target, unit)
        type(study_row), intent(in) :: row(:)
        character(len=*), intent(in) :: analysis
        real(wp), intent(in) :: target(:)
        integer, intent(in) :: unit
        character(len=:), allocatable :: text
        integer :: i

        write (unit, "(a)") ""
        do i = 1, size(target)
            text = recommend(row, analysis, target(i))
            if (text /= "") write (unit, "(a)") "  "//text
        end do
    end subroutine print_advice

    !> Find out at once whether the table can be written.
    subroutine open_table(config, scene, file, status)
        type(command_line), intent(in) :: config
        type(scene_type), intent(in) :: scene
        type(output_file), intent(out) :: file
        type(status_type), intent(inout) :: status
        character(len=:), allocatable :: name

        if (allocated(config%output)) then
            name = config%output
        else
            name = default_name(config%scene)//"_study.csv"
        end if
        call refuse_inputs(name, scene, status)
        call open_output(name, .true., file, status)
    end subroutine open_table

    !> All rows as a table.
    subroutine write_rows(row, file, status)
        type(study_row), intent(in) :: row(:)
        type(output_file), intent(inout) :: file
        type(status_type), intent(inout) :: status
        character(len=64) :: numbers
        integer :: i

        call write_text(file, "analysis,method,setting,seconds [s],error [1],steps [1]"//new_line("a"), status)
        do i = 1, size(row)
            write (numbers, "(es16.8e3, ',', es16.8e3, ',', i0)") row(i)%seconds, row(i)%error, row(i)%n_step
            call write_text(file, trim(row(i)%analysis)//","//trim(row(i)%method)//","//trim(row(i)%setting)//"," &
                            //trim(adjustl(numbers))//new_line("a"), status)
        end do
        call finish_text(file, status)
    end subroutine write_rows
end module linkdyn_drive_study
