!> The executable: parse, dispatch, exit status.
program linkdyn
    use, intrinsic :: iso_fortran_env, only: error_unit, output_unit
    use linkdyn_cli, only: command_line, argument_type, read_arguments, parse_arguments, print_help, &
        command_inverse, command_explain, command_version
    use linkdyn_drive_inverse, only: drive_inverse, load_model
    use linkdyn_explain, only: explain_model
    use linkdyn_model, only: model_type
    use linkdyn_status, only: status_type
    use linkdyn_terminal, only: leave_program
    use linkdyn_version, only: version
    implicit none (type, external)
    integer, parameter :: exit_bad_input = 2
    type(argument_type), allocatable :: arguments(:)
    type(command_line) :: config
    type(model_type) :: model
    type(status_type) :: status
    integer :: exit_status

    exit_status = 0
    call read_arguments(arguments)
    call parse_arguments(arguments, config, status)
    if (status%is_ok()) then
        if (config%help) then
            call print_help(config%command, output_unit)
        else if (config%command == command_version) then
            write (output_unit, "(a)") "linkdyn "//version
        else if (config%command == command_explain) then
            call load_model(config%scene, .false., model, status)
            if (status%is_ok()) call explain_model(model, output_unit)
        else if (config%command == command_inverse) then
            call drive_inverse(config, exit_status)
        end if
    end if
    if (.not. status%is_ok()) then
        write (error_unit, "(a)") trim(status%message)
        exit_status = exit_bad_input
    end if
    call leave_program(exit_status)
end program linkdyn
