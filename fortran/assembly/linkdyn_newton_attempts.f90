!> Newton's method from many places, to see which of them lead to an assembly. A lane whose attempt has come to its end, whichever,
!> takes up the next one, so that no attempt waits for others. Steps and rules are those of `close_group`.
module linkdyn_newton_attempts
    use linkdyn_group_closing, only: put_links, assemble_errors, look_at_joints
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state
    use linkdyn_lane_count, only: lanes
    use linkdyn_steps_on_lanes, only: kernel_use, begin_use, end_use
    use linkdyn_model, only: model_type, group_type
    use linkdyn_newton_group, only: correct, rounding_of, solve_with_probe, most_steps
    use linkdyn_newton_rules, only: is_small, least_group_margin
    use linkdyn_patterned_elimination, only: eliminate_by_pattern
    implicit none (type, external)
    private
    public :: close_attempts, look_at_place

contains

    !> Lead every attempt as far as it goes. Where links stand in the state afterwards says nothing.
    subroutine close_attempts(model, g, place, state, has_arrived)
        type(model_type), intent(in) :: model
        integer, intent(in) :: g                         !! the group's number
        real(wp), intent(inout) :: place(:, :, :)        !! where links are (place_size, n_link, attempt)
        type(kinematic_state), intent(inout) :: state    !! the steps before have been run, all lanes alike
        logical, intent(out) :: has_arrived(:)           !! (attempt)
        real(wp) :: correction(lanes, size(model%group(g)%unit)), largest(lanes), noise(lanes)
        integer :: attempt(lanes), n_step(lanes)         ! 0: none is left for the lane
        integer :: next, lane
        logical :: is_at_end
        type(kernel_use) :: use

        call begin_use(model, model%group(g)%step, state, use)
        has_arrived = .false.
        next = 0
        do lane = 1, lanes
            ! lanes to spare repeat the last attempt
            state%group%place(lane, :, :) = place(:, :, min(lane, size(place, 3)))
            call take_next(attempt(lane))
        end do
        n_step = 0
        do while (any(attempt > 0))
            noise = rounding_of(model, model%group(g), state%group%place)
            call find_step(model, g, use, state, correction)
            call take_step(model, model%group(g), attempt > 0, correction, state, largest)
            call weigh_noise(model, g, use, attempt > 0, largest, state, noise)
            n_step = n_step + 1
            do lane = 1, lanes
                if (attempt(lane) == 0) cycle
                is_at_end = is_small(largest(lane), noise(lane))
                has_arrived(attempt(lane)) = is_at_end
                ! what is no number stays so
                is_at_end = is_at_end .or. n_step(lane) == most_steps .or. largest(lane) == huge(1.0_wp)
                if (.not. is_at_end) cycle
                place(:, :, attempt(lane)) = state%group%place(lane, :, :)
                call take_next(attempt(lane))
                n_step(lane) = 0
                if (attempt(lane) > 0) state%group%place(lane, :, :) = place(:, :, attempt(lane))
            end do
        end do
        call end_use(use)

    contains

        subroutine take_next(attempt)
            integer, intent(out) :: attempt

            attempt = 0
            if (next == size(place, 3)) return
            next = next + 1
            attempt = next
        end subroutine take_next
    end subroutine close_attempts

    !> Put a group's links where the iteration stands, and see how far their joints are slid; flagged `not_converged` where an axis
    !> is turned end for end.
    subroutine look_at_place(model, g, state)
        type(model_type), intent(in) :: model
        integer, intent(in) :: g                         !! the group's number
        type(kinematic_state), intent(inout) :: state
        type(kernel_use) :: use

        call begin_use(model, model%group(g)%step, state, use)
        call put_links(model, model%group(g), state)
        call look_at_joints(model, use, state)
        call end_use(use)
    end subroutine look_at_place

    !> Errors where the links stand, and what would take them away.
    subroutine find_step(model, g, use, state, correction)
        type(model_type), intent(in) :: model
        integer, intent(in) :: g
        type(kernel_use), intent(in) :: use
        type(kinematic_state), intent(inout) :: state
        real(wp), intent(out) :: correction(:, :)        !! (lane, row)
        real(wp) :: determinant(lanes)
        logical :: is_singular(lanes)

        call put_links(model, model%group(g), state)
        call assemble_errors(model, use, state, state%group%matrix, correction)
        call eliminate_by_pattern(use%kernels%pattern, 1, state%group%matrix, correction, is_singular, determinant)
    end subroutine find_step

    subroutine take_step(model, group, takes, correction, state, largest)
        type(model_type), intent(in) :: model
        type(group_type), intent(in) :: group
        logical, intent(in) :: takes(lanes)
        real(wp), intent(in) :: correction(:, :)         !! (lane, row)
        type(kinematic_state), intent(inout) :: state
        real(wp), intent(out) :: largest(lanes)          !! of the corrections; huge: it is no number

        largest = 0
        call correct(model, group, correction, takes, state%group%place, largest)
    end subroutine take_step

    !> What rounding makes of a correction grows as the margin vanishes. The margin is asked for only where it decides.
    subroutine weigh_noise(model, g, use, is_under_way, largest, state, noise)
        type(model_type), intent(in) :: model
        integer, intent(in) :: g
        type(kernel_use), intent(in) :: use
        logical, intent(in) :: is_under_way(lanes)
        real(wp), intent(in) :: largest(lanes)
        type(kinematic_state), intent(inout) :: state    !! rotations and positions are those before the step
        real(wp), intent(inout) :: noise(lanes)          !! in: at a margin of one
        real(wp) :: margin(lanes)
        logical :: is_singular(lanes)
        integer :: n

        margin = least_group_margin
        if (any(is_under_way .and. is_small(largest, noise/margin) .and. .not. is_small(largest, 0.0_wp))) then
            n = size(model%group(g)%unit)
            call assemble_errors(model, use, state, state%group%matrix, state%group%right(:, :n, 1))
            call solve_with_probe(model%group(g), use, state, margin, is_singular)
        end if
        noise = noise/max(abs(margin), least_group_margin)
    end subroutine weigh_noise
end module linkdyn_newton_attempts
