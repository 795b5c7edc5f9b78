!> Where a mechanism cannot be computed, in words: the links and joints concerned.
module linkdyn_failure
    use linkdyn_applied_wrenches, only: spring_without_direction
    use linkdyn_kinematic_pass, only: run_step, clear_flags
    use linkdyn_kinematic_state, only: kinematic_state
    use linkdyn_model, only: model_type, step_type, step_group
    use linkdyn_status, only: sample_unreachable, sample_singular, sample_not_converged, sample_undefined
    use linkdyn_text, only: join, quoted
    implicit none (type, external)
    private
    public :: failure_at

contains

    !> "links 'coupler', 'follower' cannot be closed at joint 'J3'" for a lane of a state evaluated before.
    function failure_at(model, state, status, lane) result(text)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(inout) :: state    !! its positions are computed anew
        integer, intent(in) :: status                    !! of the sample
        integer, intent(in) :: lane
        character(len=:), allocatable :: text
        integer :: i

        i = failing_step(model, state, lane)
        if (i > 0) then
            text = links_of(model, model%step(i))
            select case (status)
            case (sample_singular)
                text = text//" at a dead point: their rates are not determined"
            case (sample_not_converged)
                text = text//" cannot be closed: Newton's method does not converge"
            case default
                text = text//" cannot be closed"
            end select
        else if (status == sample_undefined .and. spring_without_direction(model, state, lane) > 0) then
            text = "spring "//quoted(model%scene%spring(spring_without_direction(model, state, lane))%name) &
                   //" has no direction, its ends coincide"
        else if (status == sample_undefined) then
            text = "a force is beyond all numbers"
        else if (status == sample_singular) then
            text = "the equations of motion are singular"
        else if (status == sample_unreachable) then
            text = "the motion is not finite"
        else
            text = "the mechanism cannot be computed"
        end if
    end function failure_at

    !> The first step that fails; 0 if none does.
    integer function failing_step(model, state, lane) result(i)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(inout) :: state
        integer, intent(in) :: lane

        call clear_flags(state)
        do i = 1, size(model%step)
            call run_step(model, model%step(i), state)
            if (state%unreachable(lane) .or. state%singular(lane) .or. state%not_converged(lane)) return
        end do
        i = 0
    end function failing_step

    function links_of(model, step) result(text)
        type(model_type), intent(in) :: model
        type(step_type), intent(in) :: step
        character(len=:), allocatable :: text

        if (step%kind == step_group) then
            text = "links "//join(model%link(model%group(step%first)%link)%name)
        else
            text = "links "//join(model%link(pack(step%link, step%link > 0))%name)
        end if
    end function links_of
end module linkdyn_failure
