!> The executable: parse, dispatch, exit status.
program linkdyn
    use linkdyn_cli, only: command_line, argument_type, read_arguments, parse_arguments
    use linkdyn_drive_forward, only: drive_forward
    use linkdyn_drive_generate, only: drive_generate
    use linkdyn_drive_inverse, only: drive_inverse
    use linkdyn_drive_study, only: drive_study
    use linkdyn_drive_sweep, only: drive_sweep
    use linkdyn_explain, only: explain_model
    use linkdyn_explain_matrix, only: explain_first_instant
    use linkdyn_help, only: print_help
    use linkdyn_interrupt, only: settle_signals
    use linkdyn_load_model, only: load_model
    use linkdyn_model, only: model_type
    use linkdyn_options, only: command_inverse, command_forward, command_sweep, command_study, command_explain, command_generate, &
        command_version
    use linkdyn_report, only: open_report, print_report
    use linkdyn_run_output, only: exit_done, exit_bad_input
    use linkdyn_status, only: status_type
    use linkdyn_terminal, only: start_progress, show_stage, end_progress, say, leave_program
    use linkdyn_build, only: version
    implicit none (type, external)
    type(argument_type), allocatable :: arguments(:)
    type(command_line) :: config
    type(status_type) :: status
    integer :: exit_status, unit

    exit_status = exit_done
    call settle_signals()
    call read_arguments(arguments)
    call parse_arguments(arguments, config, status)
    if (status%is_ok()) call open_report(unit, status)
    if (status%is_ok()) then
        call start_progress(config%quiet)
        call run_command(unit, exit_status, status)
        call end_progress()
        call print_report(unit, status)
    end if
    if (.not. status%is_ok()) then
        call say(status%message)
        exit_status = exit_bad_input
    end if
    call leave_program(exit_status)

contains

    !> Do what was asked for; what there is to read goes to `unit`.
    subroutine run_command(unit, exit_status, status)
        integer, intent(in) :: unit
        integer, intent(inout) :: exit_status
        type(status_type), intent(inout) :: status
        type(model_type) :: model

        if (config%help) then
            call print_help(config%command, unit)
            return
        end if
        select case (config%command)
        case (command_version)
            write (unit, "(a)") "linkdyn "//version
        case (command_explain)
            call load_model(config%scene, .false., model, status)
            call show_stage("explaining")
            if (status%is_ok()) call explain_model(model, unit)
            if (status%is_ok() .and. config%matrix) call explain_first_instant(model, unit)
        case (command_inverse)
            call drive_inverse(config, unit, exit_status)
        case (command_forward)
            call drive_forward(config, unit, exit_status)
        case (command_sweep)
            call drive_sweep(config, unit, exit_status)
        case (command_study)
            call drive_study(config, unit, exit_status)
        case (command_generate)
            call drive_generate(config, unit, exit_status)
        end select
    end subroutine run_command
end program linkdyn
