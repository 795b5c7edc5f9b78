!> Steps on which all guards stay far from zero: nothing has to be looked for there.
!>
!> Most guards are never reached, and to look through each step for their zeros (`linkdyn_crossings`) takes more than the step. Here
!> they are taken at quarters of a step, its ends among them, on the cubic that meets solution and rates at the ends, or on
!> the curve of a long one. They are far from zero if
!>
!> - the cubic is a solution, more or less: at each place it goes on as the system has it there, but for a part of how far each
!>   component moves in the step; a swing that returns within it would show by this, and
!> - each guard keeps its sign, and comes no nearer to zero than some times what it changes by in the step.
!>
!> All else is looked through. So steps and instants of crossings are what they would be without this look.
module linkdyn_far_guards
    use linkdyn_crossings, only: step_taken, find_crossing
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_lane_system, only: lane_system
    implicit none (type, external)
    private
    public :: look_afar, look_for_crossing

    integer, parameter :: n_quarter = 4

contains

    !> The first crossing in a step, which is looked through only where it has to be.
    subroutine look_for_crossing(system, step, n_part, share, has_crossed, are_far)
        class(lane_system), intent(inout) :: system
        class(step_taken), intent(inout) :: step
        integer, intent(in) :: n_part                      !! to be looked at, at least
        real(wp), intent(out) :: share(lanes)              !! of its length, just behind the crossing; 1: there is none
        logical, intent(out) :: has_crossed(:, :)          !! there (lane, n_guard)
        logical, intent(out) :: are_far                    !! all guards, from zero

        share = 1
        has_crossed = .false.
        call look_afar(system, step, n_part, are_far)
        if (.not. are_far) call find_crossing(system, step, share, has_crossed, n_part)
    end subroutine look_for_crossing

    !> Do all guards stay far from zero in a step that all lanes share? What they have been then counts for their scales.
    subroutine look_afar(system, step, n_part, are_far)
        class(lane_system), intent(inout) :: system
        class(step_taken), intent(inout) :: step
        integer, intent(in) :: n_part                      !! of the step, each to be looked at by quarters
        logical, intent(out) :: are_far
        real(wp) :: share(0:n_quarter*n_part)
        real(wp), dimension(0:n_quarter*n_part, system%n) :: y, rate
        real(wp) :: guard(0:n_quarter*n_part, system%n_guard)
        logical :: is_sure
        integer :: k

        are_far = step%is_one .and. .not. any(system%guard_is_fresh(1, :)) .and. all(abs(system%guard_side(1, :)) > 0)
        if (.not. are_far) return
        ! the end comes first: it is the state evaluated last
        share = [(1 - real(k, wp)/ubound(share, 1), k=0, ubound(share, 1))]
        call step%follow(system, n_part > 1, share, y, is_sure)
        call survey_places(system, step, share, y, rate, guard, are_far)
        if (are_far .and. .not. is_sure) are_far = is_solution(system, step, share, y, rate)
        if (are_far) are_far = keep_away(system, guard)
        if (.not. are_far) return
        do k = 1, system%n_guard
            system%guard_scale(:, k) = max(system%guard_scale(:, k), maxval(abs(guard(:, k))))
        end do
    end subroutine look_afar

    !> Rates and guards at the places, side by side on lanes. It is a trial of its own, and jumps of the rates have been counted.
    subroutine survey_places(system, step, share, y, rate, guard, are_known)
        class(lane_system), intent(inout) :: system
        class(step_taken), intent(inout) :: step
        real(wp), intent(in) :: share(:)                   !! (place)
        real(wp), intent(in) :: y(:, :)                    !! (place, n)
        real(wp), intent(out) :: rate(:, :)                !! (place, n)
        real(wp), intent(out) :: guard(:, :)               !! (place, n_guard)
        logical, intent(out) :: are_known
        real(wp), dimension(lanes, size(y, 2)) :: state, found
        real(wp) :: found_guard(lanes, size(guard, 2)), mode(lanes)
        integer :: n_jump, first, last, n, place(lanes), lane

        n_jump = system%n_jump
        mode = system%mode
        call system%begin_trial()
        ! the block with the end comes last
        last = 1 + ((size(share) - 1)/lanes)*lanes
        do first = last, 1, -lanes
            n = min(lanes, size(share) - first + 1)
            place = [(first + min(lane, n) - 1, lane=1, lanes)]
            state = y(place, :)
            call system%survey(step%t(1) + share(place)*step%length(1), state, n, found, found_guard, are_known)
            step%n_evaluation = step%n_evaluation + 1
            if (.not. are_known) exit
            rate(place(:n), :) = found(:n, :)
            guard(place(:n), :) = found_guard(:n, :)
        end do
        call system%begin_trial()
        system%n_jump = n_jump
        system%mode = mode
    end subroutine survey_places

    !> Is the cubic of a step a solution, more or less?
    logical function is_solution(system, step, share, y, rate)
        class(lane_system), intent(in) :: system
        class(step_taken), intent(in) :: step
        real(wp), intent(in) :: share(:), y(:, :), rate(:, :)      !! (place), (place, n)
        real(wp), parameter :: part = 0.25_wp              !! of its way that a component may be off
        real(wp), parameter :: nothing = 1.0e-8_wp         !! of its size: such a way tells nothing
        real(wp), dimension(size(y, 2)) :: allowed
        integer :: k

        allowed = part*(maxval(y, dim=1) - minval(y, dim=1)) + nothing*maxval(abs(y), dim=1)
        if (allocated(system%is_book)) where (system%is_book) allowed = huge(1.0_wp)
        is_solution = .true.
        do k = 1, size(share)
            is_solution = is_solution .and. all(abs(step%length(1)*rate(k, :) - step%cubic_rate_at(share(k))) <= allowed)
        end do
    end function is_solution

    !> Does each guard keep its sign at these places, and stay away from zero by some times what it changes by?
    pure logical function keep_away(system, guard)
        class(lane_system), intent(in) :: system
        real(wp), intent(in) :: guard(:, :)                !! (place, n_guard)
        real(wp), parameter :: away = 4                    !! of the change
        real(wp), parameter :: resting = 1.0e-6_wp         !! of its largest size so far: so near a guard has come to zero
        real(wp) :: kept(size(guard, 1)), nearest
        integer :: i

        keep_away = all(abs(guard) <= huge(1.0_wp))        ! what is no number tells nothing
        do i = 1, merge(size(guard, 2), 0, keep_away)
            kept = system%guard_side(1, i)*guard(:, i)
            nearest = minval(kept)
            keep_away = keep_away .and. nearest > max(away*(maxval(kept) - nearest), resting*system%guard_scale(1, i))
        end do
    end function keep_away
end module linkdyn_far_guards
