!> The program of inverse dynamics: from a motion and loads to driving forces, reactions and what else is wanted, with all
!> eliminations inside.
module linkdyn_force_program
    use linkdyn_catalogue, only: quantity_values, needs_equations
    use linkdyn_result_kinds, only: result_reaction, result_contact_force, result_margin, result_position, result_rotation
    use linkdyn_fit_watch, only: watch_fit, watch_parting
    use linkdyn_inputs, only: trace_request, sample_set
    use linkdyn_layout, only: sparse_layout
    use linkdyn_model, only: model_type, friction_is_shared
    use linkdyn_reaction_sharing, only: share_reactions
    use linkdyn_record, only: record_type, open_record, close_record
    use linkdyn_scene_program, only: scene_program, output_list, add_output, make_scene_program
    use linkdyn_trace, only: traced_type, trace_motion, trace_equations, solve_equations, are_among, &
        alarm_of, reach_of, pushes_of
    use linkdyn_virtual_work, only: trace_work
    implicit none (type, external)
    private
    public :: make_force_program, trace_forces, trace_redundancy, list_forces, out_alarm, out_reach

    ! ---- outputs beside the results of the catalogue
    integer, parameter :: out_alarm = 101      !! beyond one, rounding may have grown; not a number if anything was none
    integer, parameter :: out_reach = 102      !! not above zero: a loop does not close, or hardly

contains

    !> Trace a scene and compile what is wanted of it. Without pivots that serve the samples no program is made.
    subroutine make_force_program(model, request, wanted, sample, program)
        type(model_type), intent(in) :: model
        type(trace_request), intent(in) :: request
        integer, intent(in) :: wanted(:)           !! `result_*` of the catalogue
        type(sample_set), intent(in) :: sample     !! representative: pivots are chosen by them
        type(scene_program), intent(inout) :: program
        type(record_type), target :: record
        type(traced_type) :: traced
        type(output_list) :: out

        call open_record(record, sample%n)
        call trace_forces(model, request, wanted, sample, traced)
        if (traced%mechanism%is_solved) then
            call list_forces(wanted, traced, out)
            call make_scene_program(record, traced%in, out, program)
        end if
        call close_record(record)
    end subroutine make_force_program

    !> Trace into the open record what is wanted; ask `mechanism%is_solved` whether pivots have served.
    subroutine trace_forces(model, request, wanted, sample, traced)
        type(model_type), intent(in) :: model
        type(trace_request), intent(in) :: request
        integer, intent(in) :: wanted(:)           !! `result_*`
        type(sample_set), intent(in) :: sample
        type(traced_type), intent(inout) :: traced

        call trace_motion(model, request, sample, traced, merged=.false.)
        if (any(needs_equations(wanted))) then
            if (request%by_work) then
                call trace_work(request, traced)
            else
                call trace_equations(request, sparse_layout(model), traced)
            end if
            call solve_equations(traced, is_last=wanted_last(traced, wanted))
        end if
        call trace_redundancy(wanted, traced)
    end subroutine trace_forces

    !> Trace what an over-constrained mechanism needs: do its joints fit, and what are the reactions that its equations have left
    !> open?
    subroutine trace_redundancy(wanted, traced)
        integer, intent(in) :: wanted(:)           !! `result_*`
        type(traced_type), intent(inout) :: traced
        integer, parameter :: places(*) = [result_position, result_rotation, result_margin]
        logical :: shares, moves
        integer :: i

        moves = .not. all([(any(wanted(i) == places), i=1, size(wanted))])
        associate (share => traced%mechanism%model%share)
            shares = share%n > 0 .and. (any(wanted == result_reaction) .or. (allocated(traced%contact) .and. &
                                                                            friction_is_shared(traced%mechanism%model)))
            if (shares .or. (share%may_gape .and. all(wanted /= result_margin))) then
                call watch_fit(traced%mechanism)
                if (shares .or. any(needs_equations(wanted))) then
                    call watch_parting(traced%mechanism, traced%system)
                else if (moves) then
                    call watch_parting(traced%mechanism)
                end if
            end if
        end associate
        if (.not. shares) return
        allocate (traced%shared(6, traced%mechanism%model%n_joint))
        call share_reactions(traced%mechanism, traced%unknowns, pushes_of(traced), traced%system, traced%shared)
    end subroutine trace_redundancy

    !> What is wanted of a traced scene, and what says whether it counts.
    subroutine list_forces(wanted, traced, out)
        integer, intent(in) :: wanted(:)           !! `result_*`
        type(traced_type), intent(inout) :: traced
        type(output_list), intent(out) :: out
        integer :: i

        do i = 1, size(wanted)
            call add_output(out, wanted(i), quantity_values(traced, wanted(i)))
        end do
        call add_output(out, out_alarm, [alarm_of(traced)])
        call add_output(out, out_reach, [reach_of(traced)])
    end subroutine list_forces

    !> If no reaction is wanted, driving forces are solved for last, and nothing is computed behind them.
    function wanted_last(traced, wanted) result(is_last)
        type(traced_type), intent(in) :: traced
        integer, intent(in) :: wanted(:)
        logical :: is_last(traced%system%n_unknown)

        is_last = .false.
        if (allocated(traced%contact)) return      ! friction comes from reactions
        if (any(wanted == result_reaction .or. wanted == result_contact_force)) return
        is_last = are_among(traced, [traced%unknowns%transmitted, traced%virtual])
    end function wanted_last
end module linkdyn_force_program
