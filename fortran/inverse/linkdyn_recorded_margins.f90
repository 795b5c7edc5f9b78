!> Margins by a record of the scene.
module linkdyn_recorded_margins
    use linkdyn_result_kinds, only: result_margin, result_margin_rate
    use linkdyn_inputs, only: in_q, in_qd, in_branch, in_place
    use linkdyn_kinds, only: wp
    use linkdyn_margin_source, only: margin_source
    use linkdyn_recorded_forces, only: recorded_forces, run_recorded
    use linkdyn_samples, only: sample_arrays, result_list, set_block, add_target
    use linkdyn_status, only: sample_ok
    implicit none (type, external)
    private
    public :: recorded_margins, of_margins

    integer, parameter :: of_margins(2) = [result_margin, result_margin_rate]    !! what the record gives

    type, extends(margin_source) :: recorded_margins
        type(recorded_forces), pointer :: record => null()
        integer :: threads = 1                             !! at most
    contains
        procedure :: find => find_by_record
    end type recorded_margins

contains

    subroutine find_by_record(self, at, way, branch, place, margin, drift, is_closed)
        class(recorded_margins), intent(in) :: self
        real(wp), intent(in), contiguous, target :: at(:, :), way(:, :)
        real(wp), intent(in), contiguous, target :: branch(:)
        real(wp), intent(in), contiguous, target :: place(:, :, :)
        real(wp), intent(out), contiguous, target :: margin(:, :), drift(:, :)
        logical, intent(out) :: is_closed(:)
        type(sample_arrays) :: arrays
        type(result_list) :: list
        integer, allocatable :: left(:)
        integer :: n_left

        associate (n => size(at, 2), n_q => size(at, 1), n_branch => size(branch))
            call set_block(arrays, in_q, n_q, n, at)
            call set_block(arrays, in_qd, n_q, n, way)
            call set_block(arrays, in_branch, n_branch, 1, branch)
            if (size(place) > 0) call set_block(arrays, in_place, size(place, 1)*size(place, 2), n, place)
            call add_target(list, result_margin, n_branch, n, margin)
            call add_target(list, result_margin_rate, n_branch, n, drift)
            call run_recorded(self%record, self%threads, n, arrays, [sample_ok], list, n_left, left)
        end associate
        is_closed = .true.
        if (n_left > 0) is_closed(left) = .false.
    end subroutine find_by_record
end module linkdyn_recorded_margins
