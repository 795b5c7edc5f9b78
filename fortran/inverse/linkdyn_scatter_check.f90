!> Samples whose groups one rule calls uncertain, once more: by how their forces scatter.
!>
!> The rule (`linkdyn_uncertainty`) knows how far a group is from being singular, and takes it that whatever is ill determined
!> there moves all else. Links that may nearly slide along axes almost parallel move nothing else: their forces keep their
!> digits. So a sample that the rule alone flags is computed without it, and on the mechanisms of the error estimates.
module linkdyn_scatter_check
    use linkdyn_error_probe, only: error_probe, make_probe, free_probe
    use linkdyn_kinds, only: wp
    use linkdyn_lock, only: hold_records, release_records
    use linkdyn_model, only: model_type
    use linkdyn_status, only: status_type
    implicit none (type, external)
    private
    public :: second_look, need_look, free_look, surely_certain

    !> Of estimated errors, relative to the largest force: a hundredth of what is flagged, so that no scatter that is small by
    !> chance lets a sample pass.
    real(wp), parameter :: surely_certain = 1.0e-5_wp

    !> Made when it is wanted first, constant from then on.
    type :: second_look
        logical, private :: is_tried = .false.
        logical :: is_usable = .false.
        type(error_probe) :: probe
    end type second_look

contains

    subroutine need_look(model, solver, wants_reactions, look)
        type(model_type), intent(in) :: model
        integer, intent(in) :: solver
        logical, intent(in) :: wants_reactions
        type(second_look), intent(inout) :: look
        type(status_type) :: status

        call hold_records()
        if (.not. look%is_tried) then
            call make_probe(model, solver, wants_reactions, look%probe, status)
            look%is_usable = status%is_ok()
            look%is_tried = .true.
        end if
        call release_records()
    end subroutine need_look

    subroutine free_look(look)
        type(second_look), intent(inout) :: look

        if (look%is_usable) call free_probe(look%probe)
        look%is_usable = .false.
    end subroutine free_look
end module linkdyn_scatter_check
