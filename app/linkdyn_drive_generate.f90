!> `linkdyn generate`: a kernel of a scene as C.
module linkdyn_drive_generate
    use linkdyn_cli, only: command_line
    use linkdyn_code_texts, only: make_code_texts
    use linkdyn_load_model, only: load_model
    use linkdyn_generate, only: kernel_name, kernel_inverse
    use linkdyn_model, only: model_type
    use linkdyn_output_file, only: output_file, open_output, write_text, finish_text, discard_output
    use linkdyn_path, only: refuse_inputs
    use linkdyn_run_output, only: default_name, exit_done, exit_bad_input
    use linkdyn_status, only: status_type
    use linkdyn_terminal, only: show_stage, say
    implicit none (type, external)
    private
    public :: drive_generate

contains

    !> Trace, write both files, say which.
    subroutine drive_generate(config, unit, exit_status)
        type(command_line), intent(in) :: config
        integer, intent(in) :: unit
        integer, intent(out) :: exit_status
        type(model_type) :: model
        type(status_type) :: status
        character(len=:), allocatable :: path, header, source

        exit_status = exit_bad_input
        call load_model(config%scene, config%code%kernel == kernel_inverse, model, status)
        if (allocated(config%output)) then
            path = without_ending(config%output)
        else
            path = ""
        end if
        if (path == "" .or. index(path, "/", back=.true.) == len(path)) &    ! a folder
            path = path//default_name(config%scene)//"_"//trim(kernel_name(config%code%kernel))
        if (status%is_ok()) call refuse_inputs(path//".h", model%scene, status)
        if (status%is_ok()) call refuse_inputs(path//".c", model%scene, status)
        if (status%is_ok()) then
            call show_stage("writing code")
            call make_code_texts(model, config%code, path(index(path, "/", back=.true.) + 1:), header, source, status)
            ! messages start with the scene's name
            if (.not. status%is_ok()) status%message = config%scene//": "//trim(status%message)
        end if
        if (status%is_ok()) call write_both(path, header, source, status)
        if (.not. status%is_ok()) then
            call say(status%message)
            return
        end if
        exit_status = exit_done
        if (.not. config%quiet) write (unit, "(a)") "  header           "//path//".h", "  source           "//path//".c"
    end subroutine drive_generate

    !> The name that both files have in common, also if one of them was given.
    pure function without_ending(name) result(path)
        character(len=*), intent(in) :: name
        character(len=:), allocatable :: path

        path = trim(name)
        if (len(path) < 3) return
        if (path(len(path) - 1:) == ".c" .or. path(len(path) - 1:) == ".h") path = path(:len(path) - 2)
    end function without_ending

    !> Neither is replaced where the other cannot be written.
    subroutine write_both(path, header, source, status)
        character(len=*), intent(in) :: path, header, source
        type(status_type), intent(inout) :: status
        type(output_file) :: probe

        call open_output(path//".c", .true., probe, status)
        call discard_output(probe)
        call write_one(path//".h", header, status)
        call write_one(path//".c", source, status)
    end subroutine write_both

    subroutine write_one(path, text, status)
        character(len=*), intent(in) :: path, text
        type(status_type), intent(inout) :: status
        type(output_file) :: file

        if (.not. status%is_ok()) return
        call open_output(path, .true., file, status)
        call write_text(file, text, status)
        call finish_text(file, status)
    end subroutine write_one
end module linkdyn_drive_generate
