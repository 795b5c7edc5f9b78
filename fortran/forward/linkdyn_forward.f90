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
    use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan
    use linkdyn_catalogue, only: result_joint_variable
    use linkdyn_assembly_trail, only: sample_assembly, make_room
    use linkdyn_carried_assembly, only: keep_evaluated
    use linkdyn_clutch_states, only: clutch_states, state_open, state_slips, state_holds
    use linkdyn_controllers, only: controllers_type
    use linkdyn_exchange, only: coordinate_now
    use linkdyn_failure, only: failure_at
    use linkdyn_forward_course, only: start_integrator, go_to
    use linkdyn_forward_kinks, only: next_kink, is_there_by
    use linkdyn_forward_phase, only: forward_options, plan_phase
    use linkdyn_forward_run, only: forward_run, finish_forward, passed_now
    use linkdyn_forward_state, only: fill_start, read_coordinates, read_attitudes, scene_start
    use linkdyn_forward_system, only: standing_lanes
    use linkdyn_forward_words, only: coordinates_in_words, rounding_in_words
    use linkdyn_integrator, only: integrator_options, choose_method, check_options, tightened, method_name, default_method, &
        method_rk4, method_rkf45, method_rk8pd, method_msbdf, method_gbs, method_seulex
    use linkdyn_interrupt, only: is_interrupted, start_listening, stop_listening
    use linkdyn_inverse, only: inverse_results, part_of_results, run_prepared
    use linkdyn_joint_rates, only: coordinate_of
    use linkdyn_joint_table, only: is_geared
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state
    use linkdyn_lane_count, only: lanes
    use linkdyn_lock, only: hold_texts, release_texts
    use linkdyn_model, only: model_type, has_assemblies, repeats
    use linkdyn_motion, only: evaluate_loads, evaluate_motion
    use linkdyn_motor_states, only: motors_have_laws
    use linkdyn_roads, only: road_counts, operator(+)
    use linkdyn_scene, only: frame_link, law_none, n_stop, n_clutch, n_controller, has_hard_stops
    use linkdyn_status, only: status_type, fail, status_bad_input, sample_singular
    use linkdyn_stop_starts, only: refuse_beyond_stops, find_passed
    use linkdyn_text, only: to_text, quoted
    use linkdyn_whole_turns, only: least_angle
    implicit none (type, external)
    private
    public :: forward_options, forward_results, forward_run, start_forward, advance_forward, interrupt_forward, finish_forward
    public :: run_forward, coordinates_in_words, rounding_in_words, integrator_options, choose_method, method_name, default_method
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
        run%options%integrator = tightened(options%integrator)
        call check_options(options%integrator, status)
        if (model%n_q == 0) call fail(status, status_bad_input, "nothing moves: the scene has no coordinates (expected a " &
                                      //"mechanism; inverse dynamics finds the forces in a structure)")
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
        type(standing_lanes) :: standing               ! from where these are
        real(wp) :: last_step(lanes)                   ! that has led there [s]
        logical :: are_there                           ! the run has come to them
        logical :: is_lost(size(instants))
        integer :: i, first, phase, n_found, n_waiting, n_passed(0:size(instants))

        t = instants
        n_done = 0
        if (run%is_over) return
        if (results%forces%wants(result_joint_variable)) then
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
            if (.not. run%has_stopped) call lead_to(i)
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
                standing = standing_lanes()
                first = i
                phase = run%phase
                if (has_assemblies(run%model) .or. phase > 1) call make_room(run%model, size(t) - i + 1, assembly)
                if (phase > 1) allocate (assembly%counted, source=0*q(:, i:))
            end if
            is_lost(i) = run%integrator%is_lost
            if (is_lost(i) .or. run%has_stopped) call take_samples(i - 1)
            n_waiting = n_waiting + 1
            are_there = .not. run%has_stopped .or. run%is_over
            waiting(n_waiting, :) = run%output(1, :)
            last_step(n_waiting) = run%integrator%last_step
            call run%system%leave_standing_here(t(i), n_waiting, standing)
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

        !> Samples that wait are evaluated before the phase changes. What the run has failed of stays to be told.
        subroutine lead_to(i)
            integer, intent(in) :: i                   !! sample
            type(kinematic_state) :: state
            integer :: status(lanes)

            run%outputs_wait = n_waiting > 0
            call go_to(run, t(i))
            if (.not. run%wants_outputs) return
            run%wants_outputs = .false.
            state = run%system%workspace%state
            status = run%system%workspace%status
            call take_samples(i - 1)
            run%system%workspace%state = state
            run%system%workspace%status = status
            run%outputs_wait = .false.
            call go_to(run, t(i))
        end subroutine lead_to

        !> May a sample be evaluated together with the next one? Only where nothing happens between the two.
        pure logical function may_wait(i)
            integer, intent(in) :: i

            may_wait = i < size(t) .and. n_waiting < lanes .and. .not. (is_lost(i) .or. run%has_stopped .or. run%is_over)
            if (.not. may_wait) return
            may_wait = (run%integrator%t > t(i + 1) .or. may_wait_for_steps(run)) .and. &
                       .not. is_there_by(next_kink(run%kinks, run%system), t(i + 1)) &
                       .and. run%system%n_guard == 0 .and. n_clutch(run%model%scene) == 0 &
                       .and. n_controller(run%model%scene) == 0
        end function may_wait

        !> Evaluate the samples that wait, up to one, and tell what is found.
        subroutine take_samples(last)
            integer, intent(in) :: last
            real(wp) :: solution(lanes, run%system%n), on_lanes(lanes, run%own%n_variable)
            integer :: sample, lane, n, before, obstacle(lanes)

            n = n_waiting
            n_waiting = 0
            if (n == 0) return
            before = last - n
            obstacle = run%system%obstacle
            solution = waiting([(min(lane, n), lane=1, lanes)], :)
            if (are_there) then
                call take_outputs(run, n, t([(min(before + lane, last), lane=1, lanes)]), is_lost(last), standing, solution, &
                                  q(:, before + 1:last), qd(:, before + 1:last), qdd(:, before + 1:last), &
                                  force(:, before + 1:last))
                if (allocated(angle) .and. .not. is_lost(last)) then
                    on_lanes = run%system%joint_angles(t([(min(before + lane, last), lane=1, lanes)]), standing)
                    angle(:, before + 1:last) = transpose(on_lanes(:n, :))
                end if
            end if
            do lane = 1, n
                sample = before + lane
                if (are_there) call keep_sample(sample, lane, solution(lane, :))
                call tell_sample(sample, lane, solution, are_there)
                n_passed(sample) = run%n_crossed
                if (.not. are_there) n_passed(sample) = passed_now(run)
            end do
            run%system%obstacle = obstacle
        end subroutine take_samples

        !> What the forces are found from.
        subroutine keep_sample(i, lane, solution)
            integer, intent(in) :: i, lane
            real(wp), intent(in) :: solution(:)        !! (n)

            rate(:, i) = qd(:, i)
            call read_attitudes(run%model, run%system%layout, solution, quaternion(:, :, i), rate(:, i))
            associate (state => run%system%workspace%state)
                call keep_evaluated(run%model, t(i), standing%assembly, state, lane, i - first + 1, assembly, run%n_crossed)
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
            if (associated(results%step)) results%step(i) = last_step(lane)
            call tell_coordinates(run, is_there, q(:, i), qd(:, i), i, lane, results)
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

    !> May samples of several steps be evaluated together? Not where something beside the assembly goes along with the steps: friction,
    !> laws over the state, brakes, the assembly of a motion whose forces drives apply. Nor before the records are there by which forces
    !> are found and groups closed: no bit of a sample may depend on when it is evaluated.
    pure logical function may_wait_for_steps(run) result(may)
        type(forward_run), intent(in) :: run

        may = size(run%model%contact) == 0 .and. size(run%model%scene%laws%law) == 0 .and. .not. motors_have_laws(run%model)
        if (run%system%of_motion%is_needed) may = may .and. run%system%of_motion%has_record .and. .not. has_assemblies(run%own)
        if (size(run%model%group) > 0) may = may .and. associated(run%system%assembly%closer)
    end function may_wait_for_steps

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

    !> A sample's coordinates as the user has them, and what was integrated in their place.
    subroutine tell_coordinates(run, is_there, q, qd, i, lane, results)
        type(forward_run), intent(in) :: run
        logical, intent(in) :: is_there                !! the run has come to the sample
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
                if (choice(k) > 0 .and. is_there) &
                    call coordinate_now(run%own, run%model, run%system%workspace%state, k, own_q(k), own_qd(k), lane=lane)
            end do
            if (associated(results%q)) results%q(:, i) = own_q
            if (associated(results%qd)) results%qd(:, i) = own_qd
            if (associated(results%stand_in)) results%stand_in(:, i) = choice
        end associate
    end subroutine tell_coordinates

    !> Coordinates and given driving forces at instants reached.
    subroutine take_outputs(run, n, t, is_lost, standing, solution, q, qd, qdd, force)
        type(forward_run), intent(inout) :: run
        integer, intent(in) :: n                       !! samples, on the first lanes; the others are like the last of these
        real(wp), intent(in) :: t(lanes)               !! [s]
        logical, intent(in) :: is_lost
        type(standing_lanes), intent(inout) :: standing    !! from where the samples are evaluated
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
            call run%system%evaluate_on_lanes(t, solution, rate, failed, standing)
            run%system%n_used = lanes
            force = transpose(run%system%workspace%driving_force(:n, :))
        end if
        call read_coordinates(run%model, run%system%layout, t, solution, standing%turns, run%system%workspace%state, &
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
end module linkdyn_forward
