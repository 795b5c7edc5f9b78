!> Forward dynamics of a scene: driving forces given; motion, joint reactions, energies out.
!>
!> A run is started, advanced from chunk to chunk of output instants, so that a caller can write as it goes, and
!> finished. Kinks of the laws are hit exactly. The states of a chunk are turned into forces afterwards, on all lanes,
!> by the equations of inverse dynamics with the accelerations for unknowns. A run that cannot go on stops at its last
!> good instant and says so.
!>
!> Where a coordinate comes to its dead point, another joint variable is integrated in its place: the run goes on in
!> another phase. Results are told in the user's coordinates all the same.
module linkdyn_forward
    use linkdyn_result_kinds, only: result_joint_variable
    use linkdyn_failure, only: failure_at
    use linkdyn_forward_course, only: start_integrator, go_to
    use linkdyn_forward_phase, only: forward_options, plan_phase
    use linkdyn_forward_run, only: forward_run, finish_forward
    use linkdyn_forward_samples, only: forward_results, output_samples, begin_samples, end_samples_here, add_sample, take_samples, &
        find_forces
    use linkdyn_forward_state, only: fill_start, scene_start
    use linkdyn_forward_words, only: coordinates_in_words, tolerance_in_words, rounding_in_words
    use linkdyn_heard_tables, only: refuse_short_tables
    use linkdyn_integrator, only: integrator_options, choose_method, check_options, tightened, method_name, default_method, &
        method_rk4, method_rkf45, method_rk8pd, method_msbdf, method_gbs, method_seulex
    use linkdyn_interrupt, only: start_listening, stop_listening
    use linkdyn_joint_rates, only: coordinate_of
    use linkdyn_joint_table, only: is_geared
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state
    use linkdyn_lane_count, only: lanes
    use linkdyn_lock, only: hold_texts, release_texts
    use linkdyn_model, only: model_type, repeats
    use linkdyn_motion, only: evaluate_motion
    use linkdyn_roads, only: road_counts
    use linkdyn_run_tables, only: list_run_tables
    use linkdyn_scene, only: frame_link, law_none, has_hard_stops
    use linkdyn_status, only: status_type, fail, status_bad_input, sample_singular
    use linkdyn_stop_starts, only: refuse_beyond_stops, find_passed
    use linkdyn_text, only: to_text, quoted
    use linkdyn_written_numbers, only: is_at
    implicit none (type, external)
    private
    public :: forward_options, forward_results, forward_run, start_forward, advance_forward, interrupt_forward, finish_forward
    public :: coordinates_in_words, tolerance_in_words, rounding_in_words, integrator_options, &
        choose_method, method_name, default_method
    public :: method_rk4, method_rkf45, method_rk8pd, method_msbdf, method_gbs, method_seulex


contains

    !> Check, plan, and place the mechanism at its start.
    !>
    !> **Errors**: `status_bad_input` for options or a scene that cannot be run, tables that end before the run does among them; a
    !> start that cannot be assembled;
    !> `status_unavailable` for a method that this build lacks.
    subroutine start_forward(model, options, run, status)
        type(model_type), intent(in), target :: model  !! must outlive the run
        type(forward_options), intent(in) :: options
        type(forward_run), intent(inout) :: run
        type(status_type), intent(inout) :: status
        real(wp) :: q(model%n_q), qd(model%n_q), rate(lanes, 13*model%n_q + 1)
        logical :: failed(lanes)

        run%own => model
        run%model => model
        run%options = options
        run%options%integrator = tightened(options%integrator)
        call check_options(options%integrator, status)
        if (model%n_q == 0) call fail(status, status_bad_input, "nothing moves: the scene has no coordinates (expected a " &
                                      //"mechanism; inverse dynamics finds the forces in a structure)")
        call list_run_tables(model, run%heard, status)
        call refuse_short_tables(run%heard, options%t_start, options%t_start + options%integrator%span, "run", status)
        if (.not. status%is_ok()) return
        allocate (run%known(1), run%later_phase(0), run%entered_at(0))
        allocate (run%known(1)%phase)
        associate (phase => run%known(1)%phase)
            phase%model => model
            phase%choice = spread(0, 1, model%n_q)
            call plan_phase(model, run%options, phase, status)
            run%system => phase%system
        end associate
        if (.not. status%is_ok()) return
        allocate (run%y(lanes, run%system%n))
        call scene_start(model, options%t_start, q, qd)
        call refuse_other_start(run, options%t_start, q, qd, status)
        if (.not. status%is_ok()) return
        call fill_start(model, run%system%layout, spread(q, 1, lanes), spread(qd, 1, lanes), run%y)
        call run%system%fill_cylinders(options%t_start, run%y, status)
        if (.not. status%is_ok()) return
        call run%system%begin(options%t_start, run%y)
        call refuse_beyond_stops(run%system, options%t_start, run%y, status)
        if (.not. status%is_ok()) return
        call run%system%evaluate_on_lanes(spread(options%t_start, 1, lanes), run%y, rate(:, :run%system%n), failed)
        if (failed(1)) then
            call fail(status, status_bad_input, "the mechanism cannot be computed at its start: " &
                      //failure_at(model, run%system%workspace%state, run%system%workspace%status(1), 1) &
                      //advice_at_start(model, run%system%workspace%status(1)))
            return
        end if
        run%good_until = options%t_start
        call run%system%note_energy()
        call start_integrator(run, model, run%options, status)
    end subroutine start_forward

    !> A run that is beyond a stop has lost a contact, as it may where several come at once: better no results than those.
    subroutine stop_where_passed(run, t)
        type(forward_run), intent(inout) :: run
        real(wp), intent(in) :: t                      !! of the output [s]
        integer :: passed(lanes)

        if (.not. has_hard_stops(run%model%scene)) return
        call find_passed(run%system, t, run%output, passed)
        if (passed(1) == 0) return
        run%integrator%failed = .true.
        run%has_stopped = .true.
        call hold_texts()
        run%reason = "stopped at t = "//to_text(t)//" s: stop "//quoted(run%own%scene%stop(passed(1))%name) &
                     //" was passed, where impacts at several stops follow each other too closely"
        call release_texts()
    end subroutine stop_where_passed

    !> Forces that a motion asks for move a mechanism along it only if it starts on it. From elsewhere they would give a table
    !> of a motion that nobody has asked for.
    subroutine refuse_other_start(run, t, q, qd, status)
        type(forward_run), intent(in) :: run
        real(wp), intent(in) :: t                      !! [s]
        real(wp), intent(in) :: q(:), qd(:)            !! at the start
        type(status_type), intent(inout) :: status
        real(wp), dimension(size(q), 1) :: on_q, on_qd, on_qdd
        real(wp), allocatable :: load(:, :, :)
        character(len=:), allocatable :: where
        integer :: k, actuator

        actuator = findloc(run%system%by_inverse, .true., dim=1)
        if (actuator == 0) return
        allocate (load(6, run%own%n_load, 1))
        call evaluate_motion(run%own, [t], on_q, on_qd, on_qdd, load)
        do k = 1, size(q)
            associate (c => run%own%scene%coordinate(k))
                ! A coordinate without a motion is held, if others do not move it.
                if (c%motion%kind == law_none .and. .not. all(run%system%by_inverse)) cycle
                where = ""
                if (.not. is_at(q(k), on_q(k, 1), .not. repeats(run%own, k))) then
                    where = "at "//to_text(q(k))//" "//trim(c%unit)//", its motion at "//to_text(on_q(k, 1))//" "//trim(c%unit)
                else if (.not. is_at(on_qd(k, 1), qd(k), .true.)) then
                    where = "with "//to_text(qd(k))//" "//trim(c%unit)//"/s, its motion with "//to_text(on_qd(k, 1))//" " &
                            //trim(c%unit)//"/s"
                    if (c%motion%kind == law_none) where = "with "//to_text(qd(k))//" "//trim(c%unit)//"/s and has no motion"
                end if
                if (where == "") cycle
                call fail(status, status_bad_input, "coordinate "//quoted(c%name)//" starts "//where &
                    //": the law ""inverse"" of actuator "//quoted(run%own%scene%actuator(actuator)%name) &
                    //" gives the forces of that motion only (expected no 'start', 'driven', or another law)")
                return
            end associate
        end do
    end subroutine refuse_other_start

    !> What to do where coordinates do not say how the mechanism moves, or nothing resists.
    function advice_at_start(model, status) result(text)
        type(model_type), intent(in) :: model
        integer, intent(in) :: status                  !! of the sample
        character(len=:), allocatable :: text
        integer :: j, k

        text = ""
        if (status /= sample_singular) return
        do k = 1, model%n_q
            if (any(model%moves(k, :) .and. .not. model%link%is_massless)) cycle
            text = ": no link that coordinate "//quoted(model%scene%coordinate(k)%name)//" moves has mass (expected 'mass' or " &
                   //"'inertia' of one of them)"
            return
        end do
        if (.not. model%is_planar) return
        do j = 1, model%n_joint
            if (all(model%joint(j)%link /= frame_link) .or. coordinate_of(model, j, 1) > 0 &
                .or. is_geared(model%joint(j)%told_kind)) cycle
            text = " (expected another coordinate, one that moves there, such as joint "//quoted(model%joint(j)%name)//")"
            return
        end do
    end function advice_at_start

    !> Go on through the output instants t, increasing, and fill their results; those beyond where the run stops are NaN.
    !>
    !> With a time limit the run comes back when it has passed, after `n_done` instants, which may be none: call again
    !> with the rest. That changes nothing in the results.
    !>
    !> Where an event ends the run, the last sample is at its instant, which `results%time` has, and none follows.
    subroutine advance_forward(run, instants, results, n_done, seconds)
        type(forward_run), intent(inout), target :: run
        real(wp), intent(in) :: instants(:)            !! [s] (n)
        type(forward_results), intent(inout) :: results
        integer, intent(out) :: n_done                 !! instants dealt with
        real(wp), intent(in), optional :: seconds      !! of computing time, about
        type(output_samples) :: samples
        integer :: i, n_reached

        n_done = 0
        if (run%is_over) return
        call begin_samples(run, instants, results%forces%wants(result_joint_variable), samples)
        call run%integrator%pause%set(seconds)
        results%forces%roads = road_counts()
        n_reached = 0
        do i = 1, size(instants)
            if (run%options%listens) call start_listening()
            if (.not. run%has_stopped) call lead_to(run, i, samples, results)
            if (run%options%listens) call stop_listening()
            if (.not. (run%has_stopped .or. run%integrator%is_paused)) call stop_where_passed(run, instants(i))
            if (run%integrator%is_paused) exit
            if (run%is_over) then
                if (.not. run%good_until > merge(run%t_given, instants(max(1, i - 1)), i == 1)) exit
                call end_samples_here(run, i, samples)
            end if
            call add_sample(run, run%output, i, samples, results)
            n_reached = i
            if (run%is_over) exit
        end do
        call take_samples(run, n_reached, samples, results)
        call find_forces(run, n_reached, samples, results)
        if (n_reached > 0) run%t_given = samples%t(n_reached)
        n_done = samples%n_found
        run%n_passed = samples%n_passed(n_done)
    end subroutine advance_forward

    !> Go to an output instant. Samples that wait are evaluated before the phase changes. What the run has failed of stays to be
    !> told.
    subroutine lead_to(run, i, samples, results)
        type(forward_run), intent(inout), target :: run
        integer, intent(in) :: i                       !! sample
        type(output_samples), intent(inout) :: samples
        type(forward_results), intent(inout) :: results
        type(kinematic_state) :: state
        integer :: status(lanes)

        run%outputs_wait = samples%n_waiting > 0
        call go_to(run, samples%t(i))
        if (.not. run%wants_outputs) return
        run%wants_outputs = .false.
        state = run%system%workspace%state
        status = run%system%workspace%status
        call take_samples(run, i - 1, samples, results)
        run%system%workspace%state = state
        run%system%workspace%status = status
        run%outputs_wait = .false.
        call go_to(run, samples%t(i))
    end subroutine lead_to

    !> End the run where it is, between two steps.
    subroutine interrupt_forward(run)
        type(forward_run), intent(inout) :: run

        run%has_stopped = .true.
        ! The last step may lead beyond what was asked for, and the run wait there for its companions.
        run%good_until = run%integrator%good_until(1)
        if (run%options%integrator%span > 0) &
            run%good_until = min(run%good_until, run%options%t_start + run%options%integrator%span)
        run%reason = "interrupted at t = "//to_text(run%good_until)//" s"
    end subroutine interrupt_forward
end module linkdyn_forward
