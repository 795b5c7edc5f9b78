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
    use, intrinsic :: iso_fortran_env, only: int64
    use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan
    use linkdyn_assembly_trail, only: sample_assembly, make_room
    use linkdyn_builder, only: build_model
    use linkdyn_carried_assembly, only: keep_evaluated, count_passed
    use linkdyn_clutch_states, only: clutch_states, state_open, state_slips, state_holds
    use linkdyn_constants, only: two_pi
    use linkdyn_controllers, only: controllers_type
    use linkdyn_coordinate_watch, only: dead_coordinate
    use linkdyn_event_log, only: event_log, event_entry, add_entry
    use linkdyn_exchange, only: list_choices, exchange_scene, coordinate_now, number_iterated, choice_names
    use linkdyn_failure, only: failure_at, map_in_words, meeting_in_words
    use linkdyn_forward_kinks, only: kink_list, collect_kinks, next_kink, pass_kink, is_there_by
    use linkdyn_forward_phase, only: forward_options, phase_box, plan_phase, enter_phase, release_phase, &
        rates_by_record
    use linkdyn_forward_state, only: fill_start, read_coordinates, read_attitudes, scene_start
    use linkdyn_forward_record, only: evaluations_before_record
    use linkdyn_forward_system, only: forward_system, build_forward_system
    use linkdyn_integrator, only: integrator_type, integrator_options, choose_method, check_options, method_name, &
        default_method, method_rk4, method_rkf45, method_rk8pd, method_msbdf, method_gbs, method_seulex, &
        stop_growth, stop_roughness, stop_pace, stop_law, stop_event
    use linkdyn_interrupt, only: is_interrupted, start_listening, stop_listening
    use linkdyn_inverse, only: inverse_results, part_of_results, run_prepared
    use linkdyn_joint_rates, only: coordinate_of
    use linkdyn_joint_table, only: is_geared
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_lock, only: hold_texts, release_texts
    use linkdyn_led_mechanism, only: follows_assembly
    use linkdyn_model, only: model_type, has_assemblies, repeats
    use linkdyn_motion, only: evaluate_loads, evaluate_motion
    use linkdyn_roads, only: road_counts, operator(+)
    use linkdyn_scene, only: scene_type, frame_link, law_none, n_event, n_stop, n_clutch, n_controller, &
        has_hard_stops
    use linkdyn_shared_programs, only: shared_programs, hold_programs, leave_programs
    use linkdyn_stop_starts, only: touch_width, refuse_beyond_stops, begin_at_stops, find_passed
    use linkdyn_status, only: status_type, fail, status_bad_input, sample_ok, sample_singular, sample_undefined, &
        sample_unreachable, sample_branch_lost, sample_not_converged
    use linkdyn_stiffest_part, only: find_stiffest
    use linkdyn_text, only: to_text, quoted
    use linkdyn_threads, only: team_size
    use linkdyn_turns, only: turn_count
    use linkdyn_whole_turns, only: least_angle
    implicit none (type, external)
    private
    public :: forward_options, forward_results, forward_run, start_forward, advance_forward, interrupt_forward, finish_forward
    public :: run_forward, run_ensemble, coordinates_in_words, rounding_in_words, integrator_options, choose_method, method_name
    public :: default_method
    public :: method_rk4, method_rkf45, method_rk8pd, method_msbdf, method_gbs, method_seulex

    !> Where the results of a chunk go; what is not associated is not computed.
    type :: forward_results
        real(wp), pointer :: time(:) => null()         !! instants of the samples (n) [s]
        real(wp), pointer :: q(:, :) => null()         !! (n_q, n) [m, rad]
        real(wp), pointer :: qd(:, :) => null()        !! (n_q, n)
        real(wp), pointer :: work(:) => null()         !! (n) of the driving forces since the start [J]
        real(wp), pointer :: step(:) => null()         !! (n) last step before the instant [s]
        integer, pointer :: stand_in(:, :) => null()   !! (n_q, n) joint variable integrated in a coordinate's place; 0: none
        real(wp), pointer :: brake(:, :) => null()     !! (n_motor, n) what brakes take of motors' torques [N m]
        real(wp), pointer :: target(:, :) => null()            !! of controllers, as seen last (n_controller, n) [m, rad, ..]
        real(wp), pointer :: control_error(:, :) => null()     !! (n_controller, n) [m, rad, ..]
        real(wp), pointer :: control_output(:, :) => null()    !! in effect (n_controller, n) [N, N m, V]
        integer, pointer :: is_limited(:, :) => null()         !! 1: that is at a limit (n_controller, n)
        real(wp), pointer :: clutch_force(:, :) => null()      !! at their first joint variable (n_clutch, n) [N, N m]
        real(wp), pointer :: clutch_slip(:, :) => null()       !! (n_clutch, n) [m/s, rad/s]
        integer, pointer :: clutch_state(:, :) => null()       !! one of `state_*` (n_clutch, n)
        type(inverse_results) :: forces                !! accelerations, forces, energies, closure, ... (n)
    end type forward_results

    !> A run under way.
    type :: forward_run
        type(model_type), pointer :: own => null()     !! with the user's coordinates
        type(model_type), pointer :: model => null()   !! with those integrated now
        type(forward_system), pointer :: system => null()
        type(integrator_type) :: integrator
        type(forward_options) :: options
        type(phase_box), allocatable :: known(:)       !! phases planned so far, or refused; none: a member of an ensemble
        integer :: phase = 1                           !! of them the one under way
        integer, allocatable :: later_phase(:)         !! phases entered since the start
        real(wp), allocatable :: entered_at(:)         !! [s]
        integer :: step_entered = -1                   !! steps done when the phase was entered
        integer :: n_exchanged = 0                     !! coordinates since the last step
        integer :: dead_coordinate = 0                 !! that the run has stopped at; 0: none
        real(wp), allocatable :: y(:, :)               !! reached by the steps (lane, n)
        real(wp), allocatable :: output(:, :)          !! at the instant of output (lane, n)
        type(turn_count) :: turns                      !! of the samples given
        integer :: n_crossed = 0                       !! change points passed before the last sample computed
        integer :: n_passed = 0                        !! before the last sample given, or where the run has stopped
        type(kink_list) :: kinks
        logical :: has_stopped = .false.
        logical :: is_over = .false.                   !! an event has ended it, of which the last sample tells
        real(wp) :: good_until = 0                     !! [s]
        real(wp) :: t_given = -huge(1.0_wp)            !! instant of the last sample given [s]
        character(len=256) :: reason = ""              !! why it stopped
    end type forward_run

contains

    !> Check, plan, and place the mechanism at its start.
    !>
    !> **Errors**: `status_bad_input` for options or a scene that cannot be run; a start that cannot be assembled;
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
        call check_options(options%integrator, status)
        if (model%n_q == 0) call fail(status, status_bad_input, "nothing moves: the scene has no coordinates (expected a " &
                                      //"mechanism; inverse dynamics finds the forces in a structure)")
        if (.not. status%is_ok()) return
        allocate (run%known(1), run%later_phase(0), run%entered_at(0))
        allocate (run%known(1)%phase)
        associate (phase => run%known(1)%phase)
            phase%model => model
            phase%choice = spread(0, 1, model%n_q)
            call plan_phase(model, options, phase, status)
            run%system => phase%system
        end associate
        if (.not. status%is_ok()) return
        allocate (run%y(lanes, run%system%n))
        call scene_start(model, options%t_start, q, qd)
        call refuse_other_start(run, options%t_start, q, qd, status)
        if (.not. status%is_ok()) return
        call fill_start(model, run%system%layout, spread(q, 1, lanes), spread(qd, 1, lanes), run%y)
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
        call start_integrator(run, model, options, status)
    end subroutine start_forward

    subroutine start_integrator(run, model, options, status)
        type(forward_run), intent(inout) :: run
        type(model_type), intent(in) :: model
        type(forward_options), intent(in) :: options
        type(status_type), intent(inout) :: status

        call collect_kinks(model, options%t_start, options%t_start + options%integrator%span, run%kinks)
        run%output = run%y
        call begin_at_stops(run%system, options%t_start, run%y)
        call run%system%begin_with_clutches(options%t_start, run%y)
        call run%integrator%start(options%integrator, run%system, options%t_start, run%y, status)
        where (run%system%is_driven_through) run%integrator%failed = .true.
    end subroutine start_integrator

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
        real(wp), parameter :: fit = 1.0e-6_wp         !! a start written with seven digits is meant to be on the motion
        real(wp), dimension(size(q), 1) :: on_q, on_qd, on_qdd
        real(wp), allocatable :: load(:, :, :)
        character(len=:), allocatable :: where
        real(wp) :: apart
        integer :: k, actuator

        actuator = findloc(run%system%by_inverse, .true., dim=1)
        if (actuator == 0) return
        allocate (load(6, run%own%n_load, 1))
        call evaluate_motion(run%own, [t], on_q, on_qd, on_qdd, load)
        do k = 1, size(q)
            associate (c => run%own%scene%coordinate(k))
                if (c%motion%kind == law_none) cycle
                apart = abs(q(k) - on_q(k, 1))
                if (repeats(run%own, k)) apart = abs(least_angle(apart))
                where = ""
                if (apart > fit*max(1.0_wp, abs(q(k)))) then
                    where = "at "//to_text(q(k))//" "//trim(c%unit)//", its motion at "//to_text(on_q(k, 1))//" "//trim(c%unit)
                else if (abs(qd(k) - on_qd(k, 1)) > fit*max(1.0_wp, abs(on_qd(k, 1)))) then
                    where = "with "//to_text(qd(k))//" "//trim(c%unit)//"/s, its motion with "//to_text(on_qd(k, 1))//" " &
                            //trim(c%unit)//"/s"
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
        type(forward_run), intent(inout) :: run
        real(wp), intent(in) :: instants(:)            !! [s] (n)
        type(forward_results), intent(inout) :: results
        integer, intent(out) :: n_done                 !! instants dealt with
        real(wp), intent(in), optional :: seconds      !! of computing time, about
        real(wp), allocatable :: q(:, :), qd(:, :), qdd(:, :), force(:, :), load(:, :, :)
        real(wp), allocatable :: quaternion(:, :, :), rate(:, :)    !! attitudes, and qd with angular rates of these
        real(wp), allocatable :: t(:), stop_force(:, :), clutch_force(:, :), contact_sense(:, :)
        real(wp), allocatable :: angle(:, :)           ! of joints, their turns counted (n_variable, n)
        type(sample_assembly) :: assembly
        real(wp), allocatable :: waiting(:, :)         ! solutions at instants that are not evaluated yet (lane, n)
        logical :: is_lost(size(instants))
        integer :: i, first, phase, n_found, n_waiting, n_passed(0:size(instants))

        t = instants
        n_done = 0
        if (run%is_over) return
        if (associated(results%forces%joint_variable)) then
            allocate (angle(run%own%n_variable, size(t)), source=0.0_wp)
            call run%system%count_joint_turns(run%own, run%integrator%t, run%y)
        end if
        associate (m => run%own, n => size(t))
            allocate (stop_force(n_stop(m%scene), n), clutch_force(n_clutch(m%scene), n), contact_sense(size(m%contact), n), &
                      source=0.0_wp)
            allocate (q(m%n_q, n), qd(m%n_q, n), qdd(m%n_q, n), force(m%n_actuator, n), load(6, m%n_load, n), &
                      quaternion(4, m%n_attitude, n), rate(m%n_q, n))
        end associate
        ! A sample that is not reached is computed from NaN, which flags it like any that fails.
        q = ieee_value(1.0_wp, ieee_quiet_nan)
        qd = q
        qdd = q
        rate = q
        quaternion = ieee_value(1.0_wp, ieee_quiet_nan)
        force = ieee_value(1.0_wp, ieee_quiet_nan)
        call evaluate_loads(run%own, t, load)
        call run%integrator%pause%set(seconds)
        results%forces%roads = road_counts()
        n_done = 0
        n_found = 0
        n_passed(0) = run%n_passed
        n_waiting = 0
        first = 0
        do i = 1, size(t)
            if (run%options%listens) call start_listening()
            if (.not. run%has_stopped) call go_to(run, t(i))
            if (run%options%listens) call stop_listening()
            if (.not. (run%has_stopped .or. run%integrator%is_paused)) call stop_where_passed(run, t(i))
            if (run%integrator%is_paused) exit
            if (run%is_over) then
                if (i > 1) then
                    if (.not. run%good_until > t(i - 1)) exit
                end if
                if (i == 1 .and. .not. run%good_until > run%t_given) exit
                t(i) = run%good_until
                run%output = run%y
                call evaluate_loads(run%own, t(i:i), load(:, :, i:i))
            end if
            if (first == 0 .or. phase /= run%phase) then
                call take_samples(i - 1)
                if (first > 0) call find_forces(first, i - 1)
                waiting = run%output
                first = i
                phase = run%phase
                if (has_assemblies(run%model) .or. phase > 1) call make_room(run%model, size(t) - i + 1, assembly)
                if (phase > 1) allocate (assembly%counted, source=0*q(:, i:))
            end if
            is_lost(i) = run%integrator%is_lost
            if (is_lost(i)) call take_samples(i - 1)
            n_waiting = n_waiting + 1
            waiting(n_waiting, :) = run%output(1, :)
            if (.not. may_wait(i)) call take_samples(i)
            n_done = i
            if (run%is_over) exit
        end do
        call take_samples(n_done)
        if (n_done > 0) run%t_given = t(n_done)
        if (first > 0) call find_forces(first, n_done)
        n_done = n_found
        run%n_passed = n_passed(n_done)

    contains

        !> May a sample be evaluated together with the next one? Only within a step, and where nothing happens between the two.
        pure logical function may_wait(i)
            integer, intent(in) :: i

            may_wait = i < size(t) .and. n_waiting < lanes .and. .not. (is_lost(i) .or. run%has_stopped .or. run%is_over)
            if (.not. may_wait) return
            may_wait = run%integrator%t > t(i + 1) .and. &
                       .not. is_there_by(next_kink(run%kinks, run%system), t(i + 1)) &
                       .and. run%system%n_guard == 0 .and. n_clutch(run%model%scene) == 0 &
                       .and. n_controller(run%model%scene) == 0
        end function may_wait

        !> Evaluate the samples that wait, up to one, and tell what is found.
        subroutine take_samples(last)
            integer, intent(in) :: last
            real(wp) :: solution(lanes, run%system%n), on_lanes(lanes, run%own%n_variable)
            integer :: sample, lane, n, before
            logical :: is_there

            n = n_waiting
            n_waiting = 0
            if (n == 0) return
            before = last - n
            is_there = .not. run%has_stopped .or. run%is_over
            solution = waiting([(min(lane, n), lane=1, lanes)], :)
            if (is_there) then
                call take_outputs(run, n, t([(min(before + lane, last), lane=1, lanes)]), is_lost(last), solution, &
                                  q(:, before + 1:last), qd(:, before + 1:last), qdd(:, before + 1:last), &
                                  force(:, before + 1:last))
                if (allocated(angle) .and. .not. is_lost(last)) then
                    on_lanes = run%system%joint_angles(t([(min(before + lane, last), lane=1, lanes)]))
                    angle(:, before + 1:last) = transpose(on_lanes(:n, :))
                end if
            end if
            do lane = 1, n
                sample = before + lane
                if (is_there) call keep_sample(sample, lane, solution(lane, :))
                call tell_sample(sample, lane, solution, is_there)
                n_passed(sample) = passed_now(run)
            end do
        end subroutine take_samples

        !> What the forces are found from.
        subroutine keep_sample(i, lane, solution)
            integer, intent(in) :: i, lane
            real(wp), intent(in) :: solution(:)        !! (n)

            rate(:, i) = qd(:, i)
            call read_attitudes(run%model, run%system%layout, solution, quaternion(:, :, i), rate(:, i))
            associate (state => run%system%workspace%state)
                call keep_evaluated(run%model, t(i), run%system%assembly, state, lane, i - first + 1, assembly, run%n_crossed)
                if (phase > 1) assembly%counted(:, i - first + 1) = state%counted(lane, :)
            end associate
            if (has_hard_stops(run%model%scene)) &
                stop_force(:, i) = merge(run%system%stops%push(1, :), 0.0_wp, run%system%stops%rests(1, :))
            if (n_clutch(run%model%scene) > 0) clutch_force(:, i) = run%system%clutch%applied(1, :)
            if (size(run%model%contact) > 0) contact_sense(:, i) = &
                run%system%workspace%friction%sense(lane, :size(run%model%contact))
        end subroutine keep_sample

        subroutine tell_sample(i, lane, solution, is_there)
            integer, intent(in) :: i, lane
            real(wp), intent(in) :: solution(:, :)     !! (lane, n)
            logical, intent(in) :: is_there            !! the run has come there
            logical :: is_good

            is_good = is_there .and. (.not. is_lost(i) .or. run%is_over)
            if (associated(results%time)) results%time(i) = t(i)
            if (associated(results%work)) results%work(i) = merge(solution(lane, run%system%layout%work), &
                                                                  ieee_value(1.0_wp, ieee_quiet_nan), is_there)
            if (associated(results%brake)) results%brake(:, i) = run%system%motors%brake(lane, run%model%motor%actuator)
            if (associated(results%clutch_slip) .and. is_there) results%clutch_slip(:, i) = run%system%slips_at(t(i), solution)
            call tell_clutches(run%system%clutch, i, is_good, results)
            call tell_controllers(run%system%control%state, i, is_good, results)
            if (associated(results%step)) results%step(i) = run%integrator%last_step
            call tell_coordinates(run, q(:, i), qd(:, i), i, lane, results)
        end subroutine tell_sample

        !> The forces of samples of one phase. An interrupt leaves them unfinished: these samples are not given.
        subroutine find_forces(first, last)
            integer, intent(in) :: first, last
            type(inverse_results) :: part

            part = part_of_results(results%forces, first, last)
            if (allocated(angle)) run%turns%about = angle(:, first:last)
            associate (here => run%known(phase)%phase)
                call run_prepared(here%model, here%output, run%options%threads, q(:, first:last), rate(:, first:last), &
                                  qdd(:, first:last), load(:, :, first:last), part, force(:, first:last), known=assembly, &
                                  own=run%own, turns=run%turns, quaternion=quaternion(:, :, first:last), t=t(first:last), &
                                  stop_force=stop_force(:, first:last), clutch_force=clutch_force(:, first:last), &
                                  contact_sense=contact_sense(:, first:last))
            end associate
            results%forces%roads = results%forces%roads + part%roads
            if (associated(part%status)) where (is_lost(first:last)) part%status = sample_singular
            if (.not. is_interrupted()) n_found = last
        end subroutine find_forces
    end subroutine advance_forward

    !> What clutches do.
    subroutine tell_clutches(clutch, i, is_good, results)
        type(clutch_states), intent(in) :: clutch
        integer, intent(in) :: i                       !! sample
        logical, intent(in) :: is_good                 !! the run has come there
        type(forward_results), intent(inout) :: results

        if (associated(results%clutch_force)) &
            results%clutch_force(:, i) = merge(clutch%force(1, :), ieee_value(1.0_wp, ieee_quiet_nan), is_good)
        if (associated(results%clutch_slip) .and. .not. is_good) results%clutch_slip(:, i) = ieee_value(1.0_wp, ieee_quiet_nan)
        if (.not. associated(results%clutch_state)) return
        results%clutch_state(:, i) = merge(merge(state_holds, merge(state_slips, state_open, clutch%is_closed(1, :)), &
                                                 clutch%holds(1, :)), state_open, is_good)
    end subroutine tell_clutches

    !> What controllers have seen and put out.
    subroutine tell_controllers(control, i, is_good, results)
        type(controllers_type), intent(in) :: control
        integer, intent(in) :: i                       !! sample
        logical, intent(in) :: is_good                 !! the run has come there
        type(forward_results), intent(inout) :: results
        real(wp) :: none

        none = ieee_value(1.0_wp, ieee_quiet_nan)
        if (associated(results%target)) results%target(:, i) = merge(control%target(1, :), none, is_good)
        if (associated(results%control_error)) results%control_error(:, i) = merge(control%error(1, :), none, is_good)
        if (associated(results%control_output)) results%control_output(:, i) = merge(control%output(1, :), none, is_good)
        if (associated(results%is_limited)) results%is_limited(:, i) = merge(1, 0, control%is_limited(1, :) .and. is_good)
    end subroutine tell_controllers

    !> Change points passed up to the sample computed last, or, where the run cannot go on to it, up to where it has stopped.
    pure integer function passed_now(run) result(n)
        type(forward_run), intent(in) :: run

        n = run%n_crossed
        if (run%has_stopped .and. .not. run%is_over) n = max(n, run%system%assembly%n_crossed(1))
    end function passed_now

    !> A sample's coordinates as the user has them, and what was integrated in their place.
    subroutine tell_coordinates(run, q, qd, i, lane, results)
        type(forward_run), intent(in) :: run
        real(wp), intent(in) :: q(:), qd(:)            !! of the coordinates integrated (n_q)
        integer, intent(in) :: i                       !! sample
        integer, intent(in) :: lane                    !! that it is on
        type(forward_results), intent(inout) :: results
        real(wp), dimension(size(q)) :: own_q, own_qd
        integer :: k

        own_q = q
        own_qd = qd
        associate (choice => run%known(run%phase)%phase%choice)
            do k = 1, size(q)
                if (choice(k) > 0 .and. (run%is_over .or. .not. run%has_stopped)) &
                    call coordinate_now(run%own, run%model, run%system%workspace%state, k, own_q(k), own_qd(k), lane=lane)
            end do
            if (associated(results%q)) results%q(:, i) = own_q
            if (associated(results%qd)) results%qd(:, i) = own_qd
            if (associated(results%stand_in)) results%stand_in(:, i) = choice
        end associate
    end subroutine tell_coordinates

    !> Integrate to t, stopping at every kink on the way.
    subroutine go_to(run, t)
        type(forward_run), intent(inout) :: run
        real(wp), intent(in) :: t

        real(wp) :: kink

        do
            kink = next_kink(run%kinks, run%system)
            if (.not. is_there_by(kink, t) .or. all(run%integrator%failed)) exit
            call advance_to(run, kink)
            if (run%integrator%is_paused) return
            call pass_kink(run%kinks, run%system, run%integrator, run%y, kink)
        end do
        call advance_to(run, max(t, run%kinks%passed))
        run%good_until = run%integrator%good_until(1)
        run%has_stopped = run%integrator%failed(1)
        if (.not. run%has_stopped) return
        run%is_over = run%integrator%reason == stop_event .and. .not. run%system%is_driven_through(1)
        call hold_texts()
        run%reason = reason_of_stop(run)
        call release_texts()
    end subroutine go_to

    !> Integrate to t, from phase to phase. A run that cannot go on tries other coordinates, too.
    subroutine advance_to(run, t)
        type(forward_run), intent(inout) :: run
        real(wp), intent(in) :: t
        real(wp) :: kink

        do
            ! Instants behind the last step are looked at before anything changes.
            if ((run%integrator%t > t .or. (run%integrator%t >= t .and. run%system%n_guard > 0)) &
                .and. .not. all(run%integrator%failed)) then
                continue
            else if (all(run%integrator%failed) .and. run%integrator%reason == stop_event) then
                exit
            else if (run%system%wants_rest .or. all(run%integrator%failed)) then
                call change_phase(run)
            end if
            if (all(run%integrator%failed)) exit
            kink = next_kink(run%kinks, run%system)
            if (kink < huge(kink)) then
                call run%integrator%advance(run%system, t, run%y, run%output, max(t, kink))
            else
                call run%integrator%advance(run%system, t, run%y, run%output)
            end if
            if (run%integrator%is_paused .or. run%integrator%is_there) return
        end do
    end subroutine advance_to

    !> Exchange a coordinate that is near its dead point. If none can be had for it the run goes on as it is, until it
    !> is at that point.
    subroutine change_phase(run)
        type(forward_run), intent(inout) :: run
        logical :: is_new

        run%system%wants_rest = .false.
        if (.not. run%system%watch%is_on) return
        ! Between two steps a coordinate is exchanged once.
        if (run%integrator%n_step /= run%step_entered) run%n_exchanged = 0
        if (run%n_exchanged >= run%own%n_q .and. .not. all(run%integrator%failed)) return
        call run%system%look_at(spread(run%integrator%good_until(1), 1, lanes), run%y)
        is_new = .false.
        ! A phase that has failed at its first step is no improvement.
        if (run%options%switches .and. .not. (all(run%integrator%failed) .and. run%integrator%n_step == run%step_entered)) then
            call hold_texts()
            call find_better_phase(run, is_new)
            call release_texts()
        end if
        if (is_new) return
        run%system%watch%may_exchange = .false.
        run%dead_coordinate = dead_coordinate(run%system%watch, all(run%integrator%failed))
        if (run%dead_coordinate > 0) run%integrator%failed = .true.
    end subroutine change_phase

    subroutine find_better_phase(run, is_found)
        type(forward_run), intent(inout) :: run
        logical, intent(out) :: is_found
        real(wp), parameter :: least_ratio = 1.5_wp    !! every exchange is an improvement, so that they come to an end
        type(model_type), allocatable :: model(:)
        type(scene_type) :: scene
        type(status_type) :: status
        integer, allocatable :: choices(:, :), phase(:), n_iterated(:)
        integer :: i

        associate (from => run%known(run%phase)%phase)
            call list_choices(run%own, run%system%watch, from%choice, least_ratio, choices)
        end associate
        allocate (model(size(choices, 2)), phase(size(choices, 2)), n_iterated(size(choices, 2)))
        n_iterated = huge(1)
        do i = 1, size(choices, 2)
            call exchange_scene(run%own, choices(:, i), run%model, run%system%watch%state, scene)
            call build_model(scene, model(i), status)
            if (.not. status%is_ok()) cycle
            phase(i) = find_phase(run, choices(:, i))
            if (run%known(phase(i))%phase%is_refused) cycle
            n_iterated(i) = number_iterated(model(i))
            if (n_iterated(i) == 0) exit               ! all in closed form
        end do
        is_found = .false.
        do while (.not. is_found .and. any(n_iterated < huge(1)))
            i = minloc(n_iterated, 1)
            n_iterated(i) = huge(1)
            call try_phase(run, phase(i), model(i), is_found)
        end do
    end subroutine find_better_phase

    !> The number of a choice's phase, which is new if it was never looked for. A model serves all assemblies.
    integer function find_phase(run, choice) result(number)
        type(forward_run), intent(inout) :: run
        integer, intent(in) :: choice(:)

        do number = 1, size(run%known)
            if (all(run%known(number)%phase%choice == choice)) return
        end do
        run%known = [run%known, phase_box()]
        allocate (run%known(number)%phase)
        run%known(number)%phase%choice = choice
    end function find_phase

    !> Go on in a phase, with a model that starts at the position reached.
    subroutine try_phase(run, number, model, is_entered)
        type(forward_run), intent(inout) :: run
        integer, intent(in) :: number
        type(model_type), intent(in) :: model
        logical, intent(out) :: is_entered
        real(wp), allocatable :: y(:, :)
        type(status_type) :: status

        associate (t => run%integrator%good_until(1), phase => run%known(number)%phase)
            call enter_phase(run%own, run%options, run%known(run%phase)%phase, run%y, t, model, phase, y, is_entered, status)
            phase%is_refused = .not. status%is_ok()
            if (.not. is_entered) return
            run%output = y
            call move_alloc(y, run%y)
            run%model => phase%model
            run%system => phase%system
            run%phase = number
            run%step_entered = run%integrator%n_step
            run%n_exchanged = run%n_exchanged + 1
            run%later_phase = [run%later_phase, number]
            run%entered_at = [run%entered_at, t]
            call run%integrator%exchange_system(run%system, run%y, status)
        end associate
    end subroutine try_phase

    !> "slide of D until 0.251 s, then angle of A"; blank if no coordinate was exchanged.
    function coordinates_in_words(run) result(text)
        type(forward_run), intent(in) :: run
        character(len=:), allocatable :: text
        integer, parameter :: most = 4                 !! exchanges told one by one
        integer :: i, n

        text = ""
        if (.not. allocated(run%later_phase)) return
        n = size(run%later_phase)
        if (n == 0) return
        text = names_of(1)
        do i = 1, n
            if (i > most .and. i < n) cycle
            if (i == n .and. n > most + 1) text = text//", ... ("//to_text(n)//" exchanges)"
            text = text//" until "//to_text(run%entered_at(i))//" s, then "//names_of(run%later_phase(i))
        end do

    contains

        function names_of(phase) result(names)
            integer, intent(in) :: phase
            character(len=:), allocatable :: names

            names = choice_names(run%own, run%known(phase)%phase%choice)
        end function names_of
    end function coordinates_in_words

    !> "left 34 of 441 steps with errors above the tolerance, up to 3e-11"; blank if it did not.
    function rounding_in_words(run) result(text)
        type(forward_run), intent(in) :: run
        character(len=:), allocatable :: text

        text = ""
        associate (i => run%integrator)
            if (i%n_rough > 0) text = "left "//to_text(i%n_rough)//" of "//to_text(i%n_step) &
                                      //" steps with errors above the tolerance, up to "//to_text(i%roughest)
        end associate
    end function rounding_in_words

    function reason_of_stop(run) result(reason)
        type(forward_run), intent(in) :: run
        character(len=:), allocatable :: reason
        integer, parameter :: many_jumps = 100         !! evaluations on the other side than the one before: more than a passage takes
        character(len=*), parameter :: no_stand_in = " comes to its dead point, where it turns back and the " &
            //"mechanism goes on (expected hinges or slides as coordinates: others can take their places)"
        integer :: stalled

        reason = "stopped at t = "//to_text(run%good_until)//" s: "
        ! However the steps have come to their end, by what they lost or by how short they became: this is why.
        stalled = 0
        if (.not. (run%is_over .or. run%system%is_driven_through(1) .or. has_blind_controller(run) &
                   .or. any([stop_growth, stop_pace] == run%integrator%reason))) &
            stalled = run%system%stalled_coordinate(run%good_until, run%y)
        if (run%is_over) then
            reason = reason//"event "//quoted(run%own%scene%event(run%system%final_event(1))%name)
        else if (run%system%is_driven_through(1)) then
            if (run%own%scene%event(run%system%final_event(1))%clutch > 0) then
                reason = reason//"nothing that clutch "//quoted(run%own%scene%event(run%system%final_event(1))%name) &
                         //" could join moves freely: both of its sides are driven, or held"
                return
            end if
            reason = reason//"what strikes stop "//quoted(run%own%scene%event(run%system%final_event(1))%name) &
                     //" is driven: no force of the stop changes its motion"
        else if (run%dead_coordinate > 0) then
            reason = reason//"coordinate "//quoted(run%model%scene%coordinate(run%dead_coordinate)%name) &
                     //" comes to its dead point"
            if (run%options%switches) reason = reason//", and no other joint variable can take its place"
        else if (stalled > 0) then
            reason = reason//"coordinate "//quoted(run%model%scene%coordinate(stalled)%name)//no_stand_in
        else if (run%system%assembly%map_lost(1) > 0 .and. .not. (run%system%bounce%is_ahead &
                                                                  .and. run%model%scene%passes_change_points)) then
            ! where runs end at change points, what turns back there does so for that
            reason = reason//map_in_words(run%model, run%system%assembly%map_lost(1))//" come to a change point" &
                     //meeting_in_words(run%model)
        else if (run%system%bounce%is_ahead) then
            reason = reason//"a coordinate that is part of a pose or of a joint with several axes"//no_stand_in
        else if (has_blind_controller(run)) then
            reason = reason//"controller "//quoted(run%own%scene%controller(run%system%control%state%blind)%name) &
                     //" has nothing to put out: what it measures, its target or its feed-forward has no value beyond"
        else
            select case (run%integrator%reason)
            case (stop_growth)
                reason = reason//"the motion grows without bound"
            case (stop_roughness)
                reason = reason//"rounding leaves too few digits of the rates, as it does where two assemblies meet"
            case (stop_law)
                reason = reason//"the energy would change by more than the forces supply: the links would jump to another assembly"
                reason = reason//too_long_in_words(run)
            case (stop_pace)
                reason = reason//"steps of "//to_text(run%integrator%last_step)//" s would not come to the end"
                if (run%system%n_jump > many_jumps) reason = reason//": a law jumps to and fro, as a sign() does at rest "// &
                    "(expected a law that changes over a small speed, tanh(v/v0))"
            case default
                if (run%system%workspace%status(1) /= sample_ok) then
                    reason = reason//failure_at(run%model, run%system%workspace%state, run%system%workspace%status(1), 1)//" beyond"
                    if (run%system%workspace%status(1) == sample_not_converged) reason = reason//too_long_in_words(run)
                else
                    reason = reason//"the steps shrink to nothing, as they do where the equations of motion are singular"
                end if
            end select
            reason = reason//stiffness_in_words(run)
        end if
    end function reason_of_stop

    !> Has a controller nothing to put out, where the mechanism itself could go on?
    pure logical function has_blind_controller(run)
        type(forward_run), intent(in) :: run

        has_blind_controller = run%system%control%state%blind > 0 .and. &
            .not. any(run%system%obstacle(1) == [sample_unreachable, sample_branch_lost, sample_not_converged])
    end function has_blind_controller

    !> What may be at fault of a method that does not shorten its steps for it; blank of others.
    function too_long_in_words(run) result(text)
        type(forward_run), intent(in) :: run
        character(len=:), allocatable :: text

        text = ""
        associate (method => run%integrator%options%method)
            if (any([method_rk4, method_msbdf] == method)) text = ", or "//trim(method_name(method))//" takes too long steps"
        end associate
    end function too_long_in_words

    !> What is too stiff for the steps of a run that cannot go on; blank if nothing is.
    function stiffness_in_words(run) result(text)
        type(forward_run), intent(in) :: run
        character(len=:), allocatable :: text, name
        real(wp), parameter :: part_of_turn = 1.0e-3_wp    !! [rad] of the fastest motion in the last step
        real(wp), parameter :: endless = 1.0e8_wp          !! [rad] of it in the run
        real(wp) :: rate, step

        text = ""
        if (any([stop_law, stop_roughness] == run%integrator%reason) .or. run%integrator%n_step == run%step_entered) return
        call find_stiffest(run%model, run%good_until, run%y(1, :), name, rate)
        step = run%integrator%last_step
        if (run%options%integrator%method == method_rk4) step = run%options%integrator%step
        if (rate*step < part_of_turn .and. rate*run%options%integrator%span < endless) return
        text = ": "//name//" is too stiff (its motion takes "//to_text(two_pi/rate)//" s)"
    end function stiffness_in_words

    !> Coordinates and given driving forces at instants reached.
    subroutine take_outputs(run, n, t, is_lost, solution, q, qd, qdd, force)
        type(forward_run), intent(inout) :: run
        integer, intent(in) :: n                       !! samples, on the first lanes; the others are like the last of these
        real(wp), intent(in) :: t(lanes)               !! [s]
        logical, intent(in) :: is_lost
        real(wp), intent(inout) :: solution(:, :)      !! not a number where it is lost (lane, n)
        real(wp), intent(out) :: q(:, :), qd(:, :), qdd(:, :), force(:, :)    !! (..., sample)
        real(wp) :: rate(lanes, run%system%n)
        real(wp), dimension(lanes, run%model%n_q) :: lane_q, lane_qd, lane_qdd
        logical :: failed(lanes)

        force = ieee_value(1.0_wp, ieee_quiet_nan)
        if (is_lost) then
            solution = ieee_value(1.0_wp, ieee_quiet_nan)
        else
            run%system%n_used = n
            call run%system%evaluate_on_lanes(t, solution, rate, failed)
            run%system%n_used = lanes
            force = transpose(run%system%workspace%driving_force(:n, :))
        end if
        call read_coordinates(run%model, run%system%layout, t, solution, run%system%turns, run%system%workspace%state, &
                              lane_q, lane_qd, lane_qdd)
        q = transpose(lane_q(:n, :))
        qd = transpose(lane_qd(:n, :))
        qdd = transpose(lane_qdd(:n, :))
    end subroutine take_outputs

    !> End the run where it is, between two steps.
    subroutine interrupt_forward(run)
        type(forward_run), intent(inout) :: run

        run%has_stopped = .true.
        run%good_until = run%integrator%good_until(1)
        run%reason = "interrupted at t = "//to_text(run%good_until)//" s"
    end subroutine interrupt_forward

    !> Release what the run holds.
    subroutine finish_forward(run)
        type(forward_run), intent(inout) :: run
        integer :: i

        call run%integrator%finish()
        if (allocated(run%known)) then
            do i = 1, size(run%known)
                call release_phase(run%known(i)%phase)
                deallocate (run%known(i)%phase)
            end do
            deallocate (run%known)
        else if (associated(run%system)) then
            call run%system%release()
            deallocate (run%system)
        end if
        nullify (run%system)
    end subroutine finish_forward

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

    !> Many runs from different starts by rk4, `lanes` at once: coordinates and rates at the output instants. When the process
    !> is told to stop nothing of it can be used.
    subroutine run_ensemble(model, options, q_start, qd_start, t, q, qd, good_until, n_crossed, outcome, status, log)
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
        type(event_log), allocatable :: of_block(:)
        type(shared_programs), pointer :: shared       ! by all blocks
        type(forward_system) :: teller                 ! that makes the record
        type(status_type) :: block_status
        integer :: block, n_block

        if (options%integrator%method /= method_rk4) call fail(status, status_bad_input, "an ensemble runs at a fixed step, " &
            //"not by "//quoted(trim(method_name(options%integrator%method)))//" (expected method rk4)")
        call check_options(options%integrator, status)
        if (.not. status%is_ok()) return
        n_block = (size(q_start, 2) + lanes - 1)/lanes
        nullify (shared)
        call hold_programs(shared)
        call make_shared_record(status)
        if (.not. status%is_ok()) n_block = 0
        allocate (of_block(n_block))
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
        if (status%is_ok() .and. present(log)) call gather_events(log)

    contains

        !> One record for all blocks, if they evaluate often enough.
        subroutine make_shared_record(status)
            type(status_type), intent(inout) :: status
            integer, parameter :: evaluations_a_step = 4
            real(wp), allocatable :: y(:, :)
            real(wp) :: n_evaluation

            if (.not. rates_by_record(options) .or. size(t) == 0) return
            n_evaluation = evaluations_a_step*n_block*((t(size(t)) - options%t_start)/options%integrator%step)
            if (.not. n_evaluation > evaluations_before_record(model)) return
            call hold_programs(teller%shared, shared)
            call build_forward_system(model, options%stage_solver, teller, status)
            if (.not. status%is_ok()) return
            teller%wants_work = follows_assembly(model)
            allocate (y(lanes, teller%n))
            call fill_start(model, teller%layout, spread(q_start(:, 1), 1, lanes), spread(qd_start(:, 1), 1, lanes), y)
            call teller%begin(options%t_start, y)
            call teller%make_record(options%t_start)
        end subroutine make_shared_record

        !> Of each member as they came.
        subroutine gather_events(log)
            type(event_log), intent(inout) :: log
            type(event_entry) :: entry
            integer :: block, lane, i

            do block = 1, n_block
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

        !> One block of members; lanes beyond the last member repeat it.
        subroutine run_block(block, status)
            integer, intent(in) :: block
            type(status_type), intent(inout) :: status
            type(forward_run) :: run
            integer :: member(lanes), passed(lanes), i

            member = [(min((block - 1)*lanes + i, size(q_start, 2)), i=1, lanes)]
            run%own => model
            run%model => model
            allocate (run%system)
            call hold_programs(run%system%shared, shared)
            call hold_texts()
            call build_forward_system(model, options%stage_solver, run%system, status)
            call release_texts()
            if (status%is_ok()) then
                run%system%wants_work = follows_assembly(model)    ! whose energy tells wrong steps
                run%system%n_told = min(lanes, size(q_start, 2) - (block - 1)*lanes)
                run%system%may_record = teller%may_record
                run%system%n_before_record = 0
                allocate (run%y(lanes, run%system%n))
                call fill_start(model, run%system%layout, transpose(q_start(:, member)), transpose(qd_start(:, member)), run%y)
                call run%system%begin(options%t_start, run%y)
                call start_integrator(run, model, options, status)
                call leave_those_beyond_stops(run)
                do i = 1, size(t)
                    call go_on_to(run, t(i))
                    if (is_interrupted()) exit
                    call leave_those_that_passed(run, t(i))
                    call store(run, member, t(i), i)
                end do
                do i = 1, lanes
                    good_until(member(i)) = run%integrator%good_until(i)
                    outcome(member(i)) = sample_ok
                    ! Rates that were found, and led beyond all numbers.
                    if (run%integrator%failed(i) .and. (run%system%final_event(i) == 0 .or. run%system%is_driven_through(i))) &
                        outcome(member(i)) = merge(run%system%obstacle(i), sample_undefined, &
                                                                             run%system%obstacle(i) /= sample_ok)
                end do
                call count_change_points(run, t(size(t)), passed)
                n_crossed(member) = passed
                of_block(block) = run%system%log
            end if
            call finish_forward(run)
        end subroutine run_block

        !> A member that starts beyond a stop does not run.
        subroutine leave_those_beyond_stops(run)
            type(forward_run), intent(inout) :: run
            real(wp) :: gap(lanes, n_event(model%scene))
            integer :: i

            if (.not. has_hard_stops(model%scene)) return
            call run%system%evaluate_guards(spread(options%t_start, 1, lanes), run%y, gap)
            do i = 1, n_stop(model%scene)
                associate (stop => model%scene%stop(i))
                    if (.not. stop%is_hard) cycle
                    where (gap(:, stop%event) < -touch_width(stop) .and. .not. run%system%stops%rests(:, i))
                        run%integrator%failed = .true.
                        run%system%obstacle = sample_unreachable
                    end where
                end associate
            end do
        end subroutine leave_those_beyond_stops

        !> Nor does one go on that has lost a contact.
        subroutine leave_those_that_passed(run, instant)
            type(forward_run), intent(inout) :: run
            real(wp), intent(in) :: instant
            integer :: passed(lanes)

            if (.not. has_hard_stops(model%scene)) return
            call find_passed(run%system, instant, run%output, passed)
            where (passed > 0 .and. .not. run%integrator%failed)
                run%integrator%failed = .true.
                run%system%obstacle = sample_undefined
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
            if (.not. run%system%assembly%is_needed) return
            call run%system%evaluate_on_lanes(spread(instant, 1, lanes), run%output, rate, failed)
            passed = merge(run%system%assembly%n_crossed, count_passed(model, spread(instant, 1, lanes), run%system%assembly, &
                           run%system%workspace%state), failed .or. run%integrator%failed)
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

        subroutine store(run, member, instant, i)
            type(forward_run), intent(inout) :: run
            integer, intent(in) :: member(lanes), i
            real(wp), intent(in) :: instant
            real(wp), dimension(lanes, model%n_q) :: lane_q, lane_qd, lane_qdd
            integer :: lane

            call read_coordinates(model, run%system%layout, spread(instant, 1, lanes), run%output, run%system%turns, &
                                  run%system%workspace%state, lane_q, lane_qd, lane_qdd)
            do lane = 1, lanes
                if (run%integrator%failed(lane)) then
                    lane_q(lane, :) = ieee_value(1.0_wp, ieee_quiet_nan)
                    lane_qd(lane, :) = lane_q(lane, :)
                end if
                q(:, i, member(lane)) = lane_q(lane, :)
                qd(:, i, member(lane)) = lane_qd(lane, :)
            end do
        end subroutine store
    end subroutine run_ensemble
end module linkdyn_forward
