!> A kernel of a scene in C, as two texts: what the command writes to files and Python returns.
module linkdyn_code_texts
    use linkdyn_generate, only: code_wish, generate_code
    use linkdyn_model, only: model_type
    use linkdyn_report, only: open_report, read_report
    use linkdyn_status, only: status_type
    implicit none (type, external)
    private
    public :: make_code_texts

contains

    !> Header and source.
    !>
    !> **Errors**: those of `generate_code`; no room for the texts on their way.
    subroutine make_code_texts(model, wish, name, header, source, status)
        type(model_type), intent(in) :: model
        type(code_wish), intent(in) :: wish
        character(len=*), intent(in) :: name           !! of the files, without ending
        character(len=:), allocatable, intent(out) :: header, source
        type(status_type), intent(inout) :: status
        integer :: header_unit, source_unit

        if (.not. status%is_ok()) return
        call open_report(header_unit, status)
        if (.not. status%is_ok()) return
        call open_report(source_unit, status)
        if (status%is_ok()) then
            call generate_code(model, wish, name, header_unit, source_unit, status)
            call read_report(source_unit, source, status)
        end if
        call read_report(header_unit, header, status)
    end subroutine make_code_texts
end module linkdyn_code_texts
