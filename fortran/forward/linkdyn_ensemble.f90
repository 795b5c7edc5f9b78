!> Many forward runs from different starts, side by side on lanes: at a fixed step, since lanes keep pace.
module linkdyn_ensemble
    use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan
    use linkdyn_carried_assembly, only: count_passed
    use linkdyn_event_log, only: event_log, event_entry, add_entry
    use linkdyn_forward_course, only: start_integrator, go_to
    use linkdyn_forward_phase, only: forward_options, rates_by_record
    use linkdyn_forward_record, only: evaluations_before_record, evaluations_on_lanes
    use linkdyn_forward_run, only: forward_run, finish_forward
    use linkdyn_forward_state, only: fill_start, read_coordinates
    use linkdyn_forward_system, only: forward_system, build_forward_system
    use linkdyn_heard_tables, only: heard_table, refuse_short_tables
    use linkdyn_integrator, only: check_options, method_name, method_rk4, reason_of_solution, stop_growth
    use linkdyn_interrupt, only: is_interrupted
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_led_mechanism, only: follows_assembly
    use linkdyn_lock, only: hold_texts, release_texts
    use linkdyn_longest_step, only: too_long_steps_in_words
    use linkdyn_model, only: model_type
    use linkdyn_run_tables, only: list_run_tables
    use linkdyn_scene, only: n_event, n_stop, has_hard_stops
    use linkdyn_shared_programs, only: shared_programs, hold_programs, leave_programs
    use linkdyn_status, only: status_type, fail, status_bad_input, sample_ok, sample_undefined, sample_unreachable, &
        sample_not_converged
    use linkdyn_stop_starts, only: touch_width, find_passed
    use linkdyn_text, only: quoted, to_text
    use linkdyn_threads, only: team_size
    implicit none (type, external)
    private
    public :: run_ensemble

contains

    !> Many runs from different starts by rk4, `lanes` at once: coordinates and rates at the output instants. When the process
    !> is told to stop nothing of it can be used.
    !>
    !> **Errors**: `status_bad_input` for options or a scene that cannot be run, tables that end before the run does among them.
    subroutine run_ensemble(model, options, q_start, qd_start, t, q, qd, good_until, n_crossed, outcome, status, log, told)
        type(model_type), intent(in), target :: model
        type(forward_options), intent(in) :: options   !! the method must be rk4
        real(wp), intent(in) :: q_start(:, :), qd_start(:, :)    !! (n_q, n_member)
        real(wp), intent(in) :: t(:)                   !! [s] (n)
        real(wp), intent(out) :: q(:, :, :), qd(:, :, :)         !! (n_q, n, n_member); NaN once a member has stopped
        real(wp), intent(out) :: good_until(:)         !! last good instant (n_member) [s]
        integer, intent(out) :: n_crossed(:)           !! change points passed (n_member)
        integer, intent(out) :: outcome(:)             !! sample_ok, or why a member has stopped (n_member)
        type(status_type), intent(inout) :: status
        type(event_log), intent(inout), optional :: log    !! events of all members, member after member; lanes are members
        character(len=:), allocatable, intent(out), optional :: told     !! why the steps of the first member that says so are too
                                                                         !! long; blank: nobody says so
        type(event_log), allocatable :: of_block(:)
        character(len=:), allocatable :: reason
        type(shared_programs), pointer :: shared       ! by all blocks
        type(forward_system) :: teller                 ! that makes the record
        type(heard_table), allocatable :: heard(:)
        type(status_type) :: block_status
        integer :: block, n_block, teller_of_length

        if (present(told)) told = ""
        if (options%integrator%method /= method_rk4) call fail(status, status_bad_input, "an ensemble runs at a fixed step, " &
            //"not by "//quoted(trim(method_name(options%integrator%method)))//" (expected method rk4)")
        call check_options(options%integrator, status)
        call hold_texts()
        call list_run_tables(model, heard, status)
        call release_texts()
        if (size(t) > 0) call refuse_short_tables(heard, options%t_start, t(size(t)), "run", status)
        if (.not. status%is_ok()) return
        n_block = (size(q_start, 2) + lanes - 1)/lanes
        nullify (shared)
        if (associated(options%shared)) then
            call hold_programs(shared, options%shared)
        else
            call hold_programs(shared)
        end if
        call make_shared_record(status)
        if (.not. status%is_ok()) n_block = 0
        allocate (of_block(n_block))
        teller_of_length = huge(teller_of_length)
        reason = ""
        !$omp parallel do num_threads(team_size(options%threads, n_block)) private(block_status) schedule(dynamic)
        do block = 1, n_block
            block_status = status_type()
            call run_block(block, block_status)
            !$omp critical (linkdyn_ensemble_status)
            if (status%is_ok()) status = block_status
            !$omp end critical (linkdyn_ensemble_status)
        end do
        !$omp end parallel do
        call teller%release()
        call leave_programs(shared)
        if (status%is_ok() .and. present(log)) call gather_events(of_block, log)
        if (present(told)) call move_alloc(reason, told)

    contains

        !> One record for all blocks, if they evaluate often enough: that of the scene's single runs, if somebody shares it. It
        !> finds the work, too, which these need.
        subroutine make_shared_record(status)
            type(status_type), intent(inout) :: status
            integer, parameter :: evaluations_a_step = 4
            real(wp), allocatable :: y(:, :)
            real(wp) :: n_evaluation
            integer :: first(lanes), i

            if (.not. rates_by_record(options) .or. size(t) == 0) return
            n_evaluation = evaluations_a_step*n_block*((t(size(t)) - options%t_start)/options%integrator%step)
            associate (least => merge(evaluations_on_lanes(model), evaluations_before_record(model), associated(options%shared)))
                if (.not. n_evaluation > least) return
            end associate
            call hold_programs(teller%shared, shared)
            call build_forward_system(model, options%stage_solver, teller, status)
            if (.not. status%is_ok()) return
            allocate (y(lanes, teller%n))
            first = [(min(i, size(q_start, 2)), i=1, lanes)]
            call fill_start(model, teller%layout, transpose(q_start(:, first)), transpose(qd_start(:, first)), y)
            call teller%begin(options%t_start, y)
            call teller%make_record(options%t_start)
            call teller%make_steps_at_once(options%t_start, options%integrator%step, y)
        end subroutine make_shared_record

        !> One block of members; lanes beyond the last member repeat it.
        subroutine run_block(block, status)
            integer, intent(in) :: block
            type(status_type), intent(inout) :: status
            type(forward_run) :: run
            integer :: member(lanes), i

            member = [(min((block - 1)*lanes + i, size(q_start, 2)), i=1, lanes)]
            call start_block(run, block, member, status)
            if (status%is_ok()) then
                call run%system%begin(options%t_start, run%y)
                call run%system%use_steps(options%t_start)
                call start_integrator(run, model, options, status)
                call leave_those_beyond_stops(run, options%t_start)
                do i = 1, size(t)
                    call go_on_to(run, t(i))
                    if (is_interrupted()) exit
                    call leave_those_that_passed(run, t(i))
                    call store(run, member, t(i), q(:, i, :), qd(:, i, :))
                end do
                call tell_members(run, member)
                call tell_length(run, member)
                of_block(block) = run%system%way%log
            end if
            call finish_forward(run)
        end subroutine run_block

        !> A system of its own, with what all share, and the starts of its members.
        subroutine start_block(run, block, member, status)
            type(forward_run), intent(inout) :: run
            integer, intent(in) :: block, member(lanes)
            type(status_type), intent(inout) :: status

            run%own => model
            run%model => model
            allocate (run%system)
            call hold_programs(run%system%shared, shared)
            call hold_texts()
            call build_forward_system(model, options%stage_solver, run%system, status)
            call release_texts()
            if (.not. status%is_ok()) return
            run%system%wants_work = follows_assembly(model)    ! whose energy tells wrong steps
            run%system%n_told = min(lanes, size(q_start, 2) - (block - 1)*lanes)
            run%system%may_record = teller%may_record
            run%system%way%n_before_record = 0
            allocate (run%y(lanes, run%system%n))
            call fill_start(model, run%system%layout, transpose(q_start(:, member)), transpose(qd_start(:, member)), run%y)
            call run%system%fill_cylinders(options%t_start, run%y, status)
        end subroutine start_block

        !> How far they came, and why no farther.
        subroutine tell_members(run, member)
            type(forward_run), intent(inout) :: run
            integer, intent(in) :: member(lanes)
            integer :: passed(lanes), lane

            do lane = 1, lanes
                good_until(member(lane)) = run%integrator%good_until(lane)
                outcome(member(lane)) = sample_ok
                if (.not. run%integrator%failed(lane)) cycle
                if (run%system%way%final_event(lane) == 0 .or. run%system%way%is_driven_through(lane)) &
                    outcome(member(lane)) = why_stopped(run, lane)
            end do
            call count_change_points(run, t(size(t)), passed)
            n_crossed(member) = passed
        end subroutine tell_members

        !> What steps are too long for, by the first member that has found out.
        subroutine tell_length(run, member)
            type(forward_run), intent(inout) :: run
            integer, intent(in) :: member(lanes)
            character(len=:), allocatable :: of_block
            integer :: lane

            lane = findloc(run%integrator%too_long_for([(lane, lane=1, lanes)]) > 0, .true., dim=1)
            if (lane == 0) return
            call hold_texts()
            associate (t => run%integrator%good_until(lane))
                of_block = "a member stopped at t = "//to_text(t)//" s: " &
                           //too_long_steps_in_words(run%system, lane, run%integrator%too_long_for(lane), t, &
                                                     options%integrator%step, run%y)
            end associate
            call release_texts()
            !$omp critical (linkdyn_ensemble_status)
            if (member(lane) < teller_of_length) reason = of_block
            teller_of_length = min(teller_of_length, member(lane))
            !$omp end critical (linkdyn_ensemble_status)
        end subroutine tell_length
    end subroutine run_ensemble

    !> Gather the events of each member as they came.
    subroutine gather_events(of_block, log)
        type(event_log), intent(in) :: of_block(:)
        type(event_log), intent(inout) :: log
        type(event_entry) :: entry
        integer :: block, lane, i

        do block = 1, size(of_block)
            do lane = 1, lanes
                do i = 1, of_block(block)%n
                    if (of_block(block)%entry(i)%lane /= lane) cycle
                    entry = of_block(block)%entry(i)
                    entry%lane = (block - 1)*lanes + lane
                    call add_entry(log, entry)
                end do
            end do
        end do
    end subroutine gather_events

    !> What was in the way. Of rates that were found and led beyond all numbers nothing was; and what fails of numbers near that
    !> is not why.
    pure integer function why_stopped(run, lane) result(outcome)
        type(forward_run), intent(in) :: run
        integer, intent(in) :: lane

        outcome = sample_not_converged
        if (run%integrator%too_long_for(lane) > 0) return
        outcome = run%system%way%obstacle(lane)
        if (outcome == sample_ok .or. reason_of_solution(run%y(lane, :)) == stop_growth) outcome = sample_undefined
    end function why_stopped

    !> A member that starts beyond a stop does not run.
    subroutine leave_those_beyond_stops(run, t_start)
        type(forward_run), intent(inout) :: run
        real(wp), intent(in) :: t_start                !! [s]
        real(wp) :: gap(lanes, n_event(run%model%scene))
        integer :: i

        if (.not. has_hard_stops(run%model%scene)) return
        call run%system%evaluate_guards(spread(t_start, 1, lanes), run%y, gap)
        do i = 1, n_stop(run%model%scene)
            associate (stop => run%model%scene%stop(i))
                if (.not. stop%is_hard) cycle
                where (gap(:, stop%event) < -touch_width(stop) .and. .not. run%system%way%stops%rests(:, i))
                    run%integrator%failed = .true.
                    run%system%way%obstacle = sample_unreachable
                end where
            end associate
        end do
    end subroutine leave_those_beyond_stops

    !> Nor does one go on that has lost a contact.
    subroutine leave_those_that_passed(run, instant)
        type(forward_run), intent(inout) :: run
        real(wp), intent(in) :: instant
        integer :: passed(lanes)

        if (.not. has_hard_stops(run%model%scene)) return
        call find_passed(run%system, instant, run%output, passed)
        where (passed > 0 .and. .not. run%integrator%failed)
            run%integrator%failed = .true.
            run%system%way%obstacle = sample_undefined
        end where
    end subroutine leave_those_that_passed

    !> Those that each lane has passed up to the last instant of output, or up to where it failed.
    subroutine count_change_points(run, instant, passed)
        type(forward_run), intent(inout) :: run
        real(wp), intent(in) :: instant
        integer, intent(out) :: passed(lanes)
        real(wp) :: rate(lanes, run%system%n)
        logical :: failed(lanes)

        passed = 0
        if (.not. run%system%way%assembly%is_needed) return
        call run%system%evaluate_on_lanes(spread(instant, 1, lanes), run%output, rate, failed)
        associate (assembly => run%system%way%assembly)
            passed = merge(assembly%n_crossed, count_passed(run%model, spread(instant, 1, lanes), assembly, &
                                                            run%system%workspace%state), failed .or. run%integrator%failed)
        end associate
    end subroutine count_change_points

    !> With a pause now and then to hear whether to stop.
    subroutine go_on_to(run, t)
        type(forward_run), intent(inout) :: run
        real(wp), intent(in) :: t
        real(wp), parameter :: breath = 0.25_wp    !! [s]

        do
            call run%integrator%pause%set(breath)
            call go_to(run, t)
            if (.not. run%integrator%is_paused .or. is_interrupted()) return
        end do
    end subroutine go_on_to

    !> Where the members of a block are at an instant; NaN once one has stopped.
    subroutine store(run, member, instant, q, qd)
        type(forward_run), intent(inout) :: run
        integer, intent(in) :: member(lanes)
        real(wp), intent(in) :: instant                !! [s]
        real(wp), intent(inout) :: q(:, :), qd(:, :)   !! (n_q, n_member)
        real(wp), dimension(lanes, run%model%n_q) :: lane_q, lane_qd, lane_qdd
        integer :: lane

        call read_coordinates(run%model, run%system%layout, spread(instant, 1, lanes), run%output, run%system%turns, &
                              run%system%workspace%state, lane_q, lane_qd, lane_qdd)
        do lane = 1, lanes
            if (run%integrator%failed(lane)) then
                lane_q(lane, :) = ieee_value(1.0_wp, ieee_quiet_nan)
                lane_qd(lane, :) = lane_q(lane, :)
            end if
            q(:, member(lane)) = lane_q(lane, :)
            qd(:, member(lane)) = lane_qd(lane, :)
        end do
    end subroutine store
end module linkdyn_ensemble
