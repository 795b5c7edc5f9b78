!> Samples of a forward run, of one call: they wait for each other, since lanes evaluate several at once, are told in the user's
!> coordinates, and turned into forces by the equations of inverse dynamics, phase by phase.
!>
!> States of output wait until the lanes are full, each with the assembly, turns and angles from which it sets out
!> (`standing_lanes`), so that those of several steps are evaluated together. They do not wait beyond what a step may change
!> (events, clutches, controllers, friction, laws over the state), nor beyond a phase (`wants_outputs`).
module linkdyn_forward_samples
    use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan
    use linkdyn_assembly_trail, only: sample_assembly, make_room
    use linkdyn_carried_assembly, only: keep_evaluated
    use linkdyn_clutch_states, only: clutch_states, state_open, state_slips, state_holds
    use linkdyn_contact, only: n_part
    use linkdyn_controllers, only: controllers_type
    use linkdyn_cylinder_states, only: cylinder_states
    use linkdyn_exchange, only: coordinate_now
    use linkdyn_forward_kinks, only: next_kink, is_there_by
    use linkdyn_forward_run, only: forward_run, passed_now
    use linkdyn_forward_state, only: state_layout, read_coordinates, read_attitudes
    use linkdyn_forward_system, only: standing_lanes
    use linkdyn_interrupt, only: is_interrupted
    use linkdyn_inverse, only: inverse_results, motion_batch, motion_of, part_of_results, run_prepared
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_model, only: has_assemblies
    use linkdyn_motion, only: evaluate_loads
    use linkdyn_motor_states, only: motors_have_laws
    use linkdyn_roads, only: operator(+)
    use linkdyn_scene, only: n_stop, n_clutch, n_controller, has_hard_stops
    use linkdyn_status, only: sample_ok, sample_singular
    implicit none (type, external)
    private
    public :: forward_results, output_samples, begin_samples, end_samples_here, add_sample, take_samples, find_forces

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
        real(wp), pointer :: pressure(:, :, :) => null()       !! in cylinders (chamber, cylinder, n) [Pa]
        real(wp), pointer :: flow(:, :, :) => null()           !! through their valves (chamber, cylinder, n) [m3/s]
        real(wp), pointer :: clutch_slip(:, :) => null()       !! (n_clutch, n) [m/s, rad/s]
        integer, pointer :: clutch_state(:, :) => null()       !! one of `state_*` (n_clutch, n)
        type(inverse_results) :: forces                !! accelerations, forces, energies, closure, ... (n)
    end type forward_results

    !> The samples of a call, and those of them that wait.
    type :: output_samples
        real(wp), allocatable :: t(:)                  !! [s] (n)
        integer :: n_found = 0                         !! samples that have their forces
        integer, allocatable :: n_passed(:)            !! change points until each sample (0:n)
        ! ---- what forces are found from (..., n)
        real(wp), allocatable, dimension(:, :) :: q, qd, qdd, force
        real(wp), allocatable :: rate(:, :)            !! qd with angular rates of attitudes
        real(wp), allocatable :: quaternion(:, :, :)   !! attitudes
        real(wp), allocatable :: load(:, :, :)
        real(wp), allocatable, dimension(:, :) :: stop_force, clutch_force
        real(wp), allocatable :: contact_sense(:, :, :)        !! of joints that may stick (n_part, n_contact, n)
        real(wp), allocatable :: angle(:, :)           !! of joints, their turns counted; if wanted
        logical, allocatable :: is_lost(:)
        logical, allocatable :: is_beyond(:)           !! of where the run has stopped
        integer :: first = 0                           !! sample of the phase that the run is in; 0: none yet
        integer :: phase = 0
        type(sample_assembly) :: assembly              !! of the samples of the phase
        ! ---- those that wait
        integer :: n_waiting = 0
        real(wp), allocatable :: waiting(:, :)         !! solutions (lane, n of the system)
        real(wp) :: last_step(lanes) = 0               !! that has led there [s]
        type(standing_lanes) :: standing               !! from where they are evaluated
        logical :: are_there = .false.                 !! the run has come to them
    end type output_samples

contains

    !> Room for the samples of a call.
    subroutine begin_samples(run, t, has_angles, samples)
        type(forward_run), intent(inout) :: run
        real(wp), intent(in) :: t(:)                   !! [s] (n)
        logical, intent(in) :: has_angles              !! angles of joints are wanted
        type(output_samples), intent(out) :: samples
        real(wp) :: none

        samples%t = t
        allocate (samples%n_passed(0:size(t)), samples%is_lost(size(t)), samples%is_beyond(size(t)))
        samples%is_beyond = .false.
        samples%n_passed(0) = run%n_passed
        ! A sample that is not reached is computed from NaN, which flags it like any that fails.
        none = ieee_value(1.0_wp, ieee_quiet_nan)
        associate (m => run%own, n => size(t))
            if (has_angles) then
                allocate (samples%angle(m%n_variable, n), source=0.0_wp)
                call run%system%count_joint_turns(m, run%integrator%t, run%y)
            end if
            allocate (samples%stop_force(n_stop(m%scene), n), samples%clutch_force(n_clutch(m%scene), n), &
                      samples%contact_sense(n_part, size(m%contact), n), source=0.0_wp)
            allocate (samples%q(m%n_q, n), samples%qd(m%n_q, n), samples%qdd(m%n_q, n), samples%rate(m%n_q, n), &
                      samples%force(m%n_actuator, n), source=none)
            allocate (samples%quaternion(4, m%n_attitude, n), source=none)
            allocate (samples%load(6, m%n_load, n))
        end associate
        call evaluate_loads(run%own, t, samples%load)
    end subroutine begin_samples

    !> An event has ended the run before sample i, which is where it did.
    subroutine end_samples_here(run, i, samples)
        type(forward_run), intent(inout) :: run
        integer, intent(in) :: i
        type(output_samples), intent(inout) :: samples

        samples%t(i) = run%good_until
        run%output = run%y
        call evaluate_loads(run%own, samples%t(i:i), samples%load(:, :, i:i))
    end subroutine end_samples_here

    !> The next sample, to which the run has come. It may wait for others.
    subroutine add_sample(run, y, i, samples, results)
        type(forward_run), intent(inout) :: run
        real(wp), intent(in) :: y(:, :)                !! solution there (lane, n of the system)
        integer, intent(in) :: i
        type(output_samples), intent(inout) :: samples
        type(forward_results), intent(inout) :: results

        if (samples%first == 0 .or. samples%phase /= run%phase) call begin_phase(run, y, i, samples, results)
        samples%is_lost(i) = run%integrator%is_lost
        if (samples%is_lost(i) .or. run%has_stopped) call take_samples(run, i - 1, samples, results)
        samples%n_waiting = samples%n_waiting + 1
        samples%are_there = .not. run%has_stopped .or. run%is_over
        samples%waiting(samples%n_waiting, :) = y(1, :)
        samples%last_step(samples%n_waiting) = run%integrator%last_step
        call run%system%leave_standing_here(samples%t(i), samples%n_waiting, samples%standing)
        if (.not. may_wait(run, samples, i)) call take_samples(run, i, samples, results)
    end subroutine add_sample

    !> The run has entered another phase before sample i: the samples of the one before are complete.
    subroutine begin_phase(run, y, i, samples, results)
        type(forward_run), intent(inout) :: run
        real(wp), intent(in) :: y(:, :)                !! solution there (lane, n of the system)
        integer, intent(in) :: i
        type(output_samples), intent(inout) :: samples
        type(forward_results), intent(inout) :: results
        type(standing_lanes) :: unknown

        call take_samples(run, i - 1, samples, results)
        call find_forces(run, i - 1, samples, results)
        samples%waiting = y
        samples%standing = unknown
        samples%first = i
        samples%phase = run%phase
        associate (n_left => size(samples%t) - i + 1, phase => samples%phase)
            if (has_assemblies(run%model) .or. phase > 1) call make_room(run%model, n_left, samples%assembly)
            if (phase > 1) allocate (samples%assembly%counted(size(samples%q, 1), n_left), source=0.0_wp)
        end associate
    end subroutine begin_phase

    !> May a sample be evaluated together with the next one? Only where nothing happens between the two.
    logical function may_wait(run, samples, i) result(may)
        type(forward_run), intent(in) :: run
        type(output_samples), intent(in) :: samples
        integer, intent(in) :: i

        may = i < size(samples%t) .and. samples%n_waiting < lanes &
              .and. .not. (samples%is_lost(i) .or. run%has_stopped .or. run%is_over)
        if (.not. may) return
        associate (t_next => samples%t(i + 1))
            may = (run%integrator%t > t_next .or. may_wait_for_steps(run)) &
                  .and. .not. is_there_by(next_kink(run%kinks, run%system), t_next) &
                  .and. run%system%n_guard == 0 .and. n_clutch(run%model%scene) == 0 .and. n_controller(run%model%scene) == 0
        end associate
    end function may_wait

    !> May samples of several steps be evaluated together? Not where something beside the assembly goes along with the steps:
    !> friction, laws over the state, brakes, the assembly of a motion whose forces drives apply. Nor before the records are there
    !> by which forces are found and groups closed: no bit of a sample may depend on when it is evaluated.
    pure logical function may_wait_for_steps(run) result(may)
        type(forward_run), intent(in) :: run

        may = size(run%model%contact) == 0 .and. size(run%model%scene%laws%law) == 0 .and. .not. motors_have_laws(run%model)
        if (run%system%of_motion%is_needed) may = may .and. run%system%of_motion%has_record .and. .not. has_assemblies(run%own)
        if (size(run%model%group) > 0) may = may .and. associated(run%system%way%assembly%closer)
    end function may_wait_for_steps

    !> Evaluate the samples that wait, up to one, and tell what is found.
    subroutine take_samples(run, last, samples, results)
        type(forward_run), intent(inout) :: run
        integer, intent(in) :: last
        type(output_samples), intent(inout) :: samples
        type(forward_results), intent(inout) :: results
        real(wp) :: solution(lanes, run%system%n), on_lanes(lanes, run%own%n_variable), t(lanes)
        integer :: sample, lane, n, before, obstacle(lanes)

        n = samples%n_waiting
        samples%n_waiting = 0
        if (n == 0) return
        before = last - n
        obstacle = run%system%way%obstacle
        solution = samples%waiting([(min(lane, n), lane=1, lanes)], :)
        t = samples%t([(min(before + lane, last), lane=1, lanes)])
        if (samples%are_there) then
            call take_outputs(run, n, t, samples%is_lost(last), samples%standing, solution, samples%q(:, before + 1:last), &
                              samples%qd(:, before + 1:last), samples%qdd(:, before + 1:last), samples%force(:, before + 1:last))
            if (allocated(samples%angle) .and. .not. samples%is_lost(last)) then
                on_lanes = run%system%joint_angles(t, samples%standing)
                samples%angle(:, before + 1:last) = transpose(on_lanes(:n, :))
            end if
        end if
        do lane = 1, n
            sample = before + lane
            samples%is_beyond(sample) = .not. samples%are_there
            if (samples%are_there) call keep_sample(run, sample, lane, solution(lane, :), samples)
            call tell_sample(run, sample, lane, solution, samples, results)
            samples%n_passed(sample) = run%n_crossed
            if (.not. samples%are_there) samples%n_passed(sample) = passed_now(run)
        end do
        run%system%way%obstacle = obstacle
    end subroutine take_samples

    !> What the forces are found from.
    subroutine keep_sample(run, i, lane, solution, samples)
        type(forward_run), intent(inout) :: run
        integer, intent(in) :: i, lane                 !! sample, and where it is
        real(wp), intent(in) :: solution(:)            !! (n of the system)
        type(output_samples), intent(inout) :: samples

        samples%rate(:, i) = samples%qd(:, i)
        call read_attitudes(run%model, run%system%layout, solution, samples%quaternion(:, :, i), samples%rate(:, i))
        associate (state => run%system%workspace%state, of_phase => i - samples%first + 1)
            call keep_evaluated(run%model, samples%t(i), samples%standing%assembly, state, lane, of_phase, samples%assembly, &
                                run%n_crossed)
            if (samples%phase > 1) samples%assembly%counted(:, of_phase) = state%counted(lane, :)
        end associate
        if (has_hard_stops(run%model%scene)) &
            samples%stop_force(:, i) = merge(run%system%way%stops%push(1, :), 0.0_wp, run%system%way%stops%rests(1, :))
        if (n_clutch(run%model%scene) > 0) samples%clutch_force(:, i) = run%system%way%clutch%applied(1, :)
        if (size(run%model%contact) > 0) samples%contact_sense(:, :, i) = &
            run%system%workspace%friction%sense(lane, :, :size(run%model%contact))
    end subroutine keep_sample

    subroutine tell_sample(run, i, lane, solution, samples, results)
        type(forward_run), intent(inout) :: run
        integer, intent(in) :: i, lane                 !! sample, and where it is
        real(wp), intent(in) :: solution(:, :)         !! (lane, n of the system)
        type(output_samples), intent(in) :: samples
        type(forward_results), intent(inout) :: results
        logical :: is_good

        associate (is_there => samples%are_there, t => samples%t(i))
            is_good = is_there .and. (.not. samples%is_lost(i) .or. run%is_over)
            if (associated(results%time)) results%time(i) = t
            if (associated(results%work)) results%work(i) = merge(solution(lane, run%system%layout%work), &
                                                                  ieee_value(1.0_wp, ieee_quiet_nan), is_there)
            if (associated(results%brake)) results%brake(:, i) = run%system%way%motors%brake(lane, run%model%motor%actuator)
            if (associated(results%clutch_slip) .and. is_there) results%clutch_slip(:, i) = run%system%slips_at(t, solution)
            call tell_cylinders(run%system%layout, run%system%cylinders, i, lane, is_good, results)
            call tell_clutches(run%system%way%clutch, i, is_good, results)
            call tell_controllers(run%system%control%state, i, is_good, results)
            if (associated(results%step)) results%step(i) = samples%last_step(lane)
            call tell_coordinates(run, is_there, samples%q(:, i), samples%qd(:, i), i, lane, results)
        end associate
    end subroutine tell_sample

    !> The forces of the samples of a phase, up to the last. An interrupt leaves them unfinished: these samples are not given.
    subroutine find_forces(run, last, samples, results)
        type(forward_run), intent(inout) :: run
        integer, intent(in) :: last
        type(output_samples), intent(inout), target :: samples
        type(forward_results), intent(inout) :: results
        type(inverse_results) :: part

        if (samples%first == 0) return
        associate (of => samples, here => run%known(samples%phase)%phase, first => samples%first)
            part = part_of_results(results%forces, first, last)
            if (allocated(of%angle)) run%turns%about = of%angle(:, first:last)
            call run_prepared(here%model, here%output, run%options%threads, motion_of_samples(samples, first, last), part, &
                              known=of%assembly, own=run%own, turns=run%turns)
            results%forces%roads = results%forces%roads + part%roads
            if (associated(part%status)) where (of%is_lost(first:last)) part%status = sample_singular
            if (associated(part%status) .and. run%beyond /= sample_ok) where (of%is_beyond(first:last)) part%status = run%beyond
            if (.not. is_interrupted()) samples%n_found = last
        end associate
    end subroutine find_forces

    !> The states of samples, with what acts there.
    function motion_of_samples(samples, first, last) result(motion)
        type(output_samples), intent(in), target :: samples
        integer, intent(in) :: first, last
        type(motion_batch) :: motion

        motion = motion_of(samples%q(:, first:last), samples%rate(:, first:last), samples%qdd(:, first:last), &
                           samples%load(:, :, first:last))
        motion%t => samples%t(first:last)
        motion%quaternion => samples%quaternion(:, :, first:last)
        motion%given_force => samples%force(:, first:last)
        motion%stop_force => samples%stop_force(:, first:last)
        motion%clutch_force => samples%clutch_force(:, first:last)
        motion%contact_sense => samples%contact_sense(:, :, first:last)
    end function motion_of_samples

    !> What is in cylinders.
    subroutine tell_cylinders(layout, cylinders, i, lane, is_good, results)
        type(state_layout), intent(in) :: layout
        type(cylinder_states), intent(in) :: cylinders
        integer, intent(in) :: i, lane                 !! sample, and where it is
        logical, intent(in) :: is_good                 !! the run has come there
        type(forward_results), intent(inout) :: results
        integer :: k, cylinder

        cylinder = 0
        do k = 1, size(layout%pressure)
            if (layout%pressure(k) == 0) cycle
            cylinder = cylinder + 1
            if (associated(results%pressure)) results%pressure(:, cylinder, i) = &
                merge(cylinders%pressure(lane, :, k), ieee_value(1.0_wp, ieee_quiet_nan), is_good)
            if (associated(results%flow)) results%flow(:, cylinder, i) = &
                merge(cylinders%flow(lane, :, k), ieee_value(1.0_wp, ieee_quiet_nan), is_good)
        end do
    end subroutine tell_cylinders

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
                                                 clutch%holds(1, :) .or. clutch%is_spared(1, :)), state_open, is_good)
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
end module linkdyn_forward_samples
