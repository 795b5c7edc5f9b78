!> A forward run from its start to its end.
module linkdyn_whole_run
    use linkdyn_forward, only: forward_options, forward_results, forward_run, start_forward, advance_forward, finish_forward
    use linkdyn_kinds, only: wp
    use linkdyn_model, only: model_type
    use linkdyn_status, only: status_type
    implicit none (type, external)
    private
    public :: run_forward

contains

    !> A whole run: t are the output instants, increasing. A run that stops early is no error: see `run`.
    subroutine run_forward(model, options, t, results, run, status)
        type(model_type), intent(in), target :: model
        type(forward_options), intent(in) :: options
        real(wp), intent(in) :: t(:)                   !! [s] (n)
        type(forward_results), intent(inout) :: results
        type(forward_run), intent(inout) :: run        !! statistics; why and where it stopped
        type(status_type), intent(inout) :: status
        integer :: n_done

        call start_forward(model, options, run, status)
        if (status%is_ok()) call advance_forward(run, t, results, n_done)
        call finish_forward(run)
    end subroutine run_forward
end module linkdyn_whole_run
