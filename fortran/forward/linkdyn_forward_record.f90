!> Rates of forward dynamics from a record of the scene: which scenes have one, what it takes from a state, what it gives.
module linkdyn_forward_record
    use linkdyn_assembly_trail, only: sample_assembly
    use linkdyn_base_motion, only: evaluate_base
    use linkdyn_carried_assembly, only: carried_assembly, accept_seen, note_doubt, secant, take_branches, note_far, &
        farthest_way
    use linkdyn_closing_programs, only: make_closing_programs
    use linkdyn_constants, only: two_pi
    use linkdyn_effort_laws, only: follows_target, is_given
    use linkdyn_drives, only: coordinate_of_actuator
    use linkdyn_equations, only: unknown_choice
    use linkdyn_following, only: look_ahead
    use linkdyn_forward_state, only: state_layout, fill_start
    use linkdyn_group_stride, only: close_places
    use linkdyn_inputs, only: trace_request, sample_set, in_q, in_quaternion, in_branch, in_place
    use linkdyn_joint_rates, only: coordinate_of
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_lane_sizes, only: find_sizes
    use linkdyn_laws, only: law_instants, set_instants, evaluate_at_instants, motion_at_instants
    use linkdyn_led_groups, only: lead_places
    use linkdyn_led_mechanism, only: follows_assembly
    use linkdyn_linear_program, only: make_linear_program
    use linkdyn_look_program, only: look_choice
    use linkdyn_lock, only: hold_texts, release_texts
    use linkdyn_model, only: model_type, link_freedom, place_size
    use linkdyn_motion, only: evaluate_loads, loads_are_constant, is_constant
    use linkdyn_newton_group, only: sizes_away
    use linkdyn_payloads, only: evaluate_payloads
    use linkdyn_recorded_rates, only: recorded_rates, rate_samples, record_rates, make_rate_samples, &
        free_rate_samples, run_rates, run_columns_of_states, apply_laws, take_measures, record_steps
    use linkdyn_recorded_motors, only: settle_losses
    use linkdyn_representatives, only: representative_poses, need_poses, few_links
    use linkdyn_scene, only: effort_law, effort_spring_damper, effort_inverse, effort_constant, measure_joint, measure_touch
    use linkdyn_scene_program, only: input_wiring, wire_inputs
    use linkdyn_stage_places, only: stage_places, prepare_stage_places, predict_stage, keep_stage
    use linkdyn_step_program, only: state_places, step_judge
    use linkdyn_state_wires, only: state_wires, lay_wires, columns_of_states, carry, carry_with_turns, rates_of_states
    use linkdyn_uncertainty, only: is_surely_certain
    implicit none (type, external)
    private
    public :: forward_record, evaluations_before_record, evaluations_on_lanes, make_forward_rates, make_forward_steps, &
        make_forward_columns, use_forward_rates, free_forward_record
    public :: place_states, place_still, carry_states, place_touches, close_states, close_near, run_states, take_rates, &
        leave_doubtful, doubt_far, keep_stages, apply_record_laws, measure_states, run_losing, &
        is_led_there, accept_recorded

    real(wp), parameter :: unknown_branch = 0      ! branches are 1 or -1

    !> The record that a run uses, and its samples of it.
    type :: forward_record
        type(recorded_rates), pointer :: recorded => null()
        type(rate_samples) :: samples
        type(stage_places) :: stage                    !! of groups
        logical, private :: is_led(lanes) = .false.    !! groups there, step by step: their margins have been looked at
        real(wp), allocatable, private :: branch(:, :) !! of the samples as lanes have them; the first is unknown: others have been
                                                       !! there since (lane, n_branch)
        real(wp), allocatable :: given_force(:, :)     !! of drives whose forces somebody gives (lane, n_actuator)
        type(state_wires) :: wires
        logical, private :: by_columns = .false.       !! coordinates and attitudes are not in the samples: the rates take states as
                                                       !! they are
        logical :: motion_stands_still = .false.       !! time changes nothing, nor do turns: states and branches alone tell the
                                                       !! motion
        logical :: stands_still = .false.              !! nothing in the samples but branches changes from one evaluation to the
                                                       !! next
        type(input_wiring), private :: wiring
        type(law_instants), private :: instant         !! of the samples
        real(wp), allocatable, private :: constant(:)  !! what actuators give that no law of time tells (n_actuator) [N, N m, V]
        integer, allocatable, private :: timed(:)      !! the other actuators that follow laws
        real(wp), private :: ignored(lanes) = 0        !! accelerations by these laws
        ! ---- places in y of coordinates whose turns, which are not in y, count for something
        integer, allocatable, private :: followed(:)   !! that an actuator's law compares with a position that it wants; 0: none
                                                       !! (n_actuator)
        integer, allocatable, private :: measured(:)   !! that a measure is; 0: none (measure)
        integer, allocatable, private :: sprung(:)     !! that springs compare with their rests: a record cannot be told of turns
    end type forward_record

contains

    !> May the scene have a record? Attitudes must come all in the same way.
    pure logical function can_be_recorded(layout)
        type(state_layout), intent(in) :: layout

        can_be_recorded = all(layout%quaternion > 0) .or. all(layout%quaternion == 0)
    end function can_be_recorded

    !> Evaluations on lanes that take about as long as the making of a record: whoever makes fewer has none.
    pure integer function evaluations_before_record(model) result(n)
        type(model_type), intent(in) :: model
        integer, parameter :: evaluations_a_link = 100     !! measured: 50 (of a hundred links) to 300
        integer, parameter :: of_legs = 30                 !! whose links all move with all coordinates: many columns for the lanes
        integer, parameter :: of_groups = 5                !! that lanes close by iteration: milliseconds each

        n = merge(of_legs, evaluations_a_link, model%n_leg > 0)*model%n_link
        if (size(model%group) > 0) n = of_groups*model%n_link
    end function evaluations_before_record

    !> Evaluations on lanes after which the record of a run is made: of mechanisms of some links it is at once, since whoever runs
    !> them again shares it.
    pure integer function evaluations_on_lanes(model) result(n)
        type(model_type), intent(in) :: model

        n = merge(0, evaluations_before_record(model), model%n_link <= few_links)
    end function evaluations_on_lanes

    !> Trace the scene; ask `recorded%is_usable` whether that has served.
    subroutine make_forward_rates(model, layout, unknown, wants_power, poses, recorded, choice)
        type(model_type), intent(in) :: model
        type(state_layout), intent(in) :: layout
        type(unknown_choice), intent(in) :: unknown
        logical, intent(in) :: wants_power             !! else powers are zero
        type(representative_poses), intent(inout) :: poses
        type(recorded_rates), intent(out) :: recorded
        type(look_choice), intent(in), optional :: choice      !! what steps are judged by; absent: nobody looks

        if (.not. can_be_recorded(layout)) return
        call need_poses(model, spread(model%start_q, 2, 1), poses)
        call hold_texts()
        call record_rates(model, request_of(model, layout, unknown), wants_power, &
                          representatives(model, layout, poses%q, poses%assembly), poses%stand, recorded, choice)
        if (recorded%is_usable .and. places_groups(recorded)) then
            ! from coordinates alone
            associate (n => size(poses%q, 2), there => poses%assembly)
                if (model%n_attitude == 0) call make_closing_programs(model, poses%q, there%place(:, :, :n), there%margin(:, :n), &
                                                                      recorded%closing)
            end associate
            recorded%is_usable = recorded%closing%is_usable
        end if
        call release_texts()
    end subroutine make_forward_rates

    !> What is asked of a trace: accelerations, from states and what acts.
    pure function request_of(model, layout, unknown) result(request)
        type(model_type), intent(in) :: model
        type(state_layout), intent(in) :: layout
        type(unknown_choice), intent(in) :: unknown
        type(trace_request) :: request

        request%by_quaternion = any(layout%quaternion > 0)
        allocate (request%has_load(6, model%n_load))
        request%has_load = .true.
        request%drive_is_unknown = unknown%drive
        request%has_friction = size(model%contact) > 0
        request%acceleration_is_unknown = unknown%acceleration
    end function request_of

    !> Trace whole steps, too, of a scene whose rates hang on the state alone.
    subroutine make_forward_steps(model, layout, unknown, wants_power, poses, recorded)
        type(model_type), intent(in) :: model
        type(state_layout), intent(in) :: layout
        type(unknown_choice), intent(in) :: unknown
        logical, intent(in) :: wants_power             !! else powers are zero
        type(representative_poses), intent(in) :: poses
        type(recorded_rates), intent(inout) :: recorded
        type(state_places) :: places
        type(step_judge) :: judge

        places = state_places(layout%n, layout%position(:model%n_q), layout%rate(:model%n_q), layout%quaternion, layout%work, &
                              layout%supplied)
        judge = step_judge(follows_assembly(model), model%scene%passes_change_points, look_ahead, &
                           model%least_margin(:model%n_branch), farthest_way(model%stride(:model%n_q)))
        call hold_texts()
        call record_steps(request_of(model, layout, unknown), wants_power, places, judge, &
                          representatives(model, layout, poses%q, poses%assembly), recorded)
        call release_texts()
    end subroutine make_forward_steps

    !> Trace the columns of a linearization, too, with the laws of actuators as the scene has them.
    subroutine make_forward_columns(model, layout, unknown, law, poses, recorded)
        type(model_type), intent(in) :: model
        type(state_layout), intent(in) :: layout
        type(unknown_choice), intent(in) :: unknown
        type(effort_law), intent(in) :: law(:)         !! (n_actuator)
        type(representative_poses), intent(in) :: poses
        type(recorded_rates), intent(inout) :: recorded
        type(model_type), allocatable, target :: told
        type(trace_request) :: request
        type(sample_set) :: sample
        integer :: i

        allocate (told)
        told = recorded%model
        do i = 1, size(law)
            told%scene%actuator(i)%law = law(i)
        end do
        request = request_of(model, layout, unknown)
        request%by_quaternion = .false.                ! coordinates are what a linearization is told in
        request%efforts_are_given = .true.
        sample = representatives(model, layout, poses%q, poses%assembly)
        sample%of(in_branch)%x = spread(told%branch, 2, sample%n)
        call hold_texts()
        call make_linear_program(told, request, sample, recorded%linear, recorded%column)
        call release_texts()
    end subroutine make_forward_columns

    !> Are links placed by iteration in the record, too? Some it closes at once that the lanes do not: legs in any axes.
    pure logical function places_groups(recorded)
        type(recorded_rates), intent(in) :: recorded

        places_groups = size(recorded%model%group) > 0
    end function places_groups

    !> Was the state that the record was run on first last led to, step by step?
    pure logical function is_led_there(record)
        type(forward_record), intent(in) :: record

        is_led_there = places_groups(record%recorded) .and. record%is_led(1)
    end function is_led_there

    !> Use a record of the scene from now on.
    subroutine use_forward_rates(model, layout, recorded, by_columns, is_driven, record)
        type(model_type), intent(in) :: model
        type(state_layout), intent(in) :: layout
        type(recorded_rates), intent(in), target :: recorded
        logical, intent(in) :: by_columns              !! states need not be in the samples, where the rates alone hang on them
        logical, intent(in) :: is_driven               !! somebody puts driving forces into the samples that come from no law of
                                                       !! time
        type(forward_record), intent(out) :: record

        record%recorded => recorded
        if (.not. recorded%is_usable) return
        call prepare_samples(model, layout, record)
        record%by_columns = by_columns .and. .not. (recorded%takes_measures .or. recorded%friction%is_made &
                                                    .or. places_groups(recorded))
        if (record%by_columns) call wire_inputs(recorded%program, columns_of_states(model, record%wires), record%wiring)
        record%motion_stands_still = .not. hangs_on_more(model, layout, record)
        record%stands_still = record%by_columns .and. record%motion_stands_still .and. .not. is_driven
        if (record%motion_stands_still) call look_at_laws(model, layout, spread(0.0_wp, 1, lanes), record)
    end subroutine use_forward_rates

    !> Do inputs that are no states change on the way, with time or with turns?
    pure logical function hangs_on_more(model, layout, record)
        type(model_type), intent(in) :: model
        type(state_layout), intent(in) :: layout
        type(forward_record), intent(in) :: record

        hangs_on_more = any(layout%rate(:model%n_q) == 0) .or. any(layout%counted(:model%n_q) > 0) &
                        .or. model%scene%base%moves .or. size(model%payload) > 0 .or. .not. loads_are_constant(model) &
                        .or. .not. all(is_constant(model%scene%actuator(record%timed)%law%target)) &
                        .or. any(record%followed > 0) .or. size(record%sprung) > 0
    end function hangs_on_more

    subroutine free_forward_record(record)
        type(forward_record), intent(inout) :: record

        call free_rate_samples(record%samples)
        nullify (record%recorded)
    end subroutine free_forward_record

    !> Poses as samples of the program's inputs.
    function representatives(model, layout, pose, assembly) result(sample)
        type(model_type), intent(in) :: model
        type(state_layout), intent(in) :: layout
        real(wp), intent(in) :: pose(:, :)             !! (n_q, n)
        type(sample_assembly), intent(in) :: assembly  !! there
        type(sample_set) :: sample
        real(wp) :: y(lanes, layout%n)
        integer :: i, p

        sample%n = size(pose, 2)
        sample%of(in_q)%x = pose
        if (size(model%group) > 0) sample%of(in_place)%x = &
            reshape(assembly%place(:, :, :sample%n), [place_size(model)*model%n_link, sample%n])
        allocate (sample%of(in_quaternion)%x(4*model%n_attitude, sample%n))
        sample%of(in_quaternion)%x = 0
        do i = 1, sample%n
            call fill_start(model, layout, spread(pose(:, i), 1, lanes), spread(0*pose(:, i), 1, lanes), y)
            do p = 1, model%n_attitude
                if (layout%quaternion(p) > 0) &
                    sample%of(in_quaternion)%x(4*p - 3:4*p, i) = y(1, layout%quaternion(p):layout%quaternion(p) + 3)
            end do
        end do
    end function representatives

    !> Where the record's inputs come from: wires of the state, constants, drives over time, springs and targets at coordinates.
    subroutine prepare_samples(model, layout, record)
        type(model_type), intent(in) :: model
        type(state_layout), intent(in) :: layout
        type(forward_record), intent(inout) :: record
        integer :: i

        call make_rate_samples(record%recorded, lanes, record%samples)
        allocate (record%samples%group_margin(size(model%group), lanes), source=0.0_wp)
        if (places_groups(record%recorded)) call prepare_stage_places(model, record%stage)
        call lay_wires(model, layout, record%recorded%out, record%wires)
        allocate (record%given_force(lanes, model%n_actuator), source=0.0_wp)
        allocate (record%branch(lanes, model%n_branch), source=unknown_branch)
        allocate (record%constant(model%n_actuator), source=0.0_wp)
        allocate (record%followed(model%n_actuator), source=0)
        allocate (record%sprung(0), record%timed(0))
        do i = 1, model%n_actuator
            associate (drive => model%scene%actuator(i)%law, place => place_of(coordinate_of_actuator(model, i)))
                if (drive%kind == effort_constant) then
                    record%constant(i) = drive%value(1)                ! of a motor, else nobody asks
                else if (follows_target(drive) .or. (is_given(drive) .and. drive%kind /= effort_inverse)) then
                    record%timed = [record%timed, i]
                end if
                if (follows_target(drive)) record%followed(i) = place
                if (place > 0 .and. drive%kind == effort_spring_damper) record%sprung = [record%sprung, place]
            end associate
        end do
        allocate (record%measured(size(model%scene%laws%measure)))
        record%measured = 0
        do i = 1, size(record%measured)
            associate (measure => model%scene%laws%measure(i))
                if (measure%kind == measure_joint .and. .not. measure%is_rate) &
                    record%measured(i) = place_of(coordinate_of(model, measure%joint, measure%variable))
            end associate
        end do
        do i = 1, size(model%scene%spring)
            associate (spring => model%scene%spring(i))
                if (spring%joint == 0) cycle
                associate (place => place_of(coordinate_of(model, spring%joint, spring%variable)))
                    if (place > 0) record%sprung = [record%sprung, place]
                end associate
            end associate
        end do

    contains

        !> In y, of a coordinate that counts turns; 0: of none. One that stands in for another variable counts none.
        pure integer function place_of(k)
            integer, intent(in) :: k

            place_of = 0
            if (k == 0) return
            if (model%scene%coordinate(k)%for_joint == 0) place_of = layout%position(k)
        end function place_of
    end subroutine prepare_samples

    !> The first n states as samples of the record.
    subroutine place_states(model, layout, assembly, n, t, y, turns, by_inverse, record)
        type(model_type), intent(in) :: model
        type(state_layout), intent(in) :: layout
        type(carried_assembly), intent(in) :: assembly !! of the accepted state
        integer, intent(in) :: n
        real(wp), intent(in) :: t(:)                   !! [s] (lane)
        real(wp), intent(in), contiguous :: y(:, :)    !! (lane, n)
        real(wp), intent(in) :: turns(:, :)            !! of angles that are not in y (lane, n)
        logical, intent(in) :: by_inverse(:)           !! `record%given_force` has their forces (n_actuator)
        type(forward_record), intent(inout) :: record
        integer :: i

        associate (samples => record%samples, wires => record%wires)
            call leave_no_number(n, size(y, 1), size(y, 2), y, samples%is_left)
            samples%are_new = .true.
            call place_branches(model, assembly, n, record)
            if (.not. record%by_columns) call carry_states(n, y, record)
            call carry_with_turns(wires%counted, n, y, turns, samples%counted)
            samples%t(:n) = t(:n)
            call look_at_laws(model, layout, samples%t(:n), record)
            do i = 1, model%n_actuator
                if (by_inverse(i)) samples%effort(i, :n) = record%given_force(:n, i)
                associate (place => record%followed(i))
                    if (place > 0) samples%target(2*i - 1, :n) = samples%target(2*i - 1, :n) - two_pi*turns(:n, place)
                end associate
            end do
            call place_turns(n, turns, record)
            do i = 1, size(record%sprung)
                samples%is_left(:n) = samples%is_left(:n) .or. turns(:n, record%sprung(i)) /= 0
            end do
        end associate
    end subroutine place_states

    !> Turns of measures that the states leave out.
    subroutine place_turns(n, turns, record)
        integer, intent(in) :: n
        real(wp), intent(in) :: turns(:, :)            !! of angles that are not in y (lane, n)
        type(forward_record), intent(inout) :: record
        integer :: i

        do i = 1, size(record%measured)
            record%samples%turned(i, :n) = 0
            if (record%measured(i) > 0) record%samples%turned(i, :n) = two_pi*turns(:n, record%measured(i))
        end do
    end subroutine place_turns

    !> The same where nothing but states and branches changes.
    subroutine place_still(model, layout, assembly, n, stride, y, record)
        type(model_type), intent(in) :: model
        type(state_layout), intent(in) :: layout
        type(carried_assembly), intent(in) :: assembly !! of the accepted state
        integer, intent(in) :: n
        integer, intent(in) :: stride                  !! from one column of y to the next
        real(wp), intent(in) :: y(stride, layout%n)    !! (lane, n)
        type(forward_record), intent(inout) :: record

        call leave_no_number(n, stride, layout%n, y, record%samples%is_left)
        call place_branches(model, assembly, n, record)
    end subroutine place_still

    !> The branches on which states are tried: on all lanes mostly those that they were tried on before.
    subroutine place_branches(model, assembly, n, record)
        type(model_type), intent(in) :: model
        type(carried_assembly), intent(in) :: assembly !! of the accepted state
        integer, intent(in) :: n
        type(forward_record), intent(inout) :: record

        if (model%n_branch == 0) return
        if (.not. (n == lanes .and. assembly%is_needed)) then
            record%branch(1, 1) = unknown_branch
        else if (are_same(model%n_branch, record%branch, assembly%branch)) then
            return
        else
            record%branch = assembly%branch
        end if
        call take_branches(model, assembly, n, record%samples%branch, record%samples%are_new)
    end subroutine place_branches

    pure logical function are_same(n, a, b)
        integer, intent(in) :: n
        real(wp), intent(in) :: a(lanes, n), b(lanes, n)
        integer :: k, n_other

        n_other = 0
        do k = 1, n
            n_other = n_other + count(a(:, k) /= b(:, k))
        end do
        are_same = n_other == 0
    end function are_same

    !> Into the samples, for whoever asks other programs than that of the rates.
    subroutine carry_states(n, y, record)
        integer, intent(in) :: n
        real(wp), intent(in), contiguous :: y(:, :)    !! (lane, n)
        type(forward_record), intent(inout) :: record

        associate (samples => record%samples, wires => record%wires)
            call carry(wires%qd, n, y, samples%qd)
            call carry(wires%q, n, y, samples%q)
            call carry(wires%quaternion, n, y, samples%quaternion)
        end associate
    end subroutine carry_states

    !> What is no number must not pass through a choice of the record.
    pure subroutine leave_no_number(n, stride, n_y, y, is_left)
        integer, intent(in) :: n, n_y
        integer, intent(in) :: stride                  !! from one column of y to the next
        real(wp), intent(in) :: y(stride, n_y)         !! (lane, n)
        logical, intent(inout) :: is_left(n)
        real(wp) :: sizes(lanes)
        integer :: lane

        if (n == lanes .and. stride == lanes) then
            call find_sizes(n_y, y, sizes)
            is_left = .not. sizes(:n) <= huge(1.0_wp)
        else
            do lane = 1, n
                is_left(lane) = .not. sum(abs(y(lane, :))) <= huge(1.0_wp)
            end do
        end if
    end subroutine leave_no_number

    !> What depends on time alone, at the instants of the first samples.
    subroutine look_at_laws(model, layout, t, record)
        type(model_type), intent(in) :: model
        type(state_layout), intent(in) :: layout
        real(wp), intent(in) :: t(:)                   !! [s] (lane)
        type(forward_record), intent(inout) :: record
        real(wp), pointer, contiguous :: load(:, :, :)
        integer :: n, i, k

        n = merge(1, size(t), all(t == t(1)))
        call set_instants(record%instant, t(:n))
        associate (samples => record%samples)
            do i = 1, n
                samples%effort(:, i) = record%constant
            end do
            do i = 1, size(record%timed)
                k = record%timed(i)
                call evaluate_at_instants(model%scene%actuator(k)%law%target, record%instant, samples%effort(k, :n), &
                                          samples%target(2*k, :n), record%ignored(:n))
                samples%target(2*k - 1, :n) = samples%effort(k, :n)
            end do
            call fill(samples%effort)
            call fill(samples%target)
            do k = 1, model%n_q
                if (layout%rate(k) > 0) cycle
                call motion_at_instants(model%scene%coordinate(k), record%instant, samples%q(k, :n), samples%qd(k, :n), &
                                        samples%qdd(k, :n))
                if (n == size(t)) cycle
                call fill(samples%q(k:k, :))
                call fill(samples%qd(k:k, :))
                call fill(samples%qdd(k:k, :))
            end do
            if (model%scene%base%moves) then
                call evaluate_base(model, t(:n), samples%base(:, :n))
                call fill(samples%base)
            end if
            if (size(model%payload) > 0) then
                call evaluate_payloads(model, t(:n), samples%payload(:, :n))
                call fill(samples%payload)
            end if
            if (model%n_load == 0) return
            load(1:6, 1:model%n_load, 1:n) => samples%load(:, :n)
            call evaluate_loads(model, t(:n), load)
            call fill(samples%load)
        end associate

    contains

        !> At one instant all are the same.
        subroutine fill(x)
            real(wp), intent(inout) :: x(:, :)         !! (number, lane)
            integer :: lane

            do lane = n + 1, size(t)
                x(:, lane) = x(:, 1)
            end do
        end subroutine fill
    end subroutine look_at_laws

    !> The record measures nothing of what the run knows: it is added, as turns are.
    subroutine place_touches(model, n, touch, record)
        type(model_type), intent(in) :: model
        integer, intent(in) :: n
        real(wp), intent(in) :: touch(:, :)            !! (lane, n_stop)
        type(forward_record), intent(inout) :: record
        integer :: i

        do i = 1, size(model%scene%laws%measure)
            associate (spec => model%scene%laws%measure(i))
                if (spec%kind == measure_touch) record%samples%turned(i, :n) = touch(:n, spec%stop)
            end associate
        end do
    end subroutine place_touches

    !> Where the links of groups are at the first n states placed, from where those of the accepted state or of the stage before
    !> lead. What does not converge as it must, or lies too near a singular position to be surely certain, is left.
    subroutine close_states(model, assembly, n, record)
        type(model_type), intent(in) :: model
        type(carried_assembly), intent(in) :: assembly !! of the accepted state
        integer, intent(in) :: n
        type(forward_record), intent(inout) :: record

        if (places_groups(record%recorded)) call close_groups(model, assembly, n, record)
    end subroutine close_states

    subroutine close_groups(model, assembly, n, record)
        type(model_type), intent(in) :: model
        type(carried_assembly), intent(in) :: assembly
        integer, intent(in) :: n
        type(forward_record), intent(inout) :: record
        real(wp), dimension(place_size(model), model%n_link, n) :: stand, place
        real(wp) :: from(model%n_q, n)
        logical, dimension(n) :: is_closed, arrives
        integer :: lane

        associate (samples => record%samples, closing => record%recorded%closing)
            do lane = 1, n
                call predict_stage(model, assembly, record%stage, lane, samples%q(:, lane), from(:, lane), stand(:, :, lane), &
                                   place(:, :, lane))
            end do
            is_closed = .not. samples%is_left(:n)
            call close_places(model, closing, samples%q(:, :n), samples%branch(:, :n), place, samples%group_margin(:, :n), &
                              is_closed)
            call lead_places(model, closing, .not. (is_closed .or. samples%is_left(:n)), from, samples%q(:, :n), &
                             samples%branch(:, :n), stand, samples%group_margin(:, :n), arrives)
            record%is_led(:n) = arrives
            do lane = 1, n
                if (arrives(lane)) place(:, :, lane) = stand(:, :, lane)
            end do
        end associate
        call take_places(model, place, is_closed .or. arrives, record)
    end subroutine close_groups

    !> The same at states that lie very near to one that has been evaluated: from there.
    subroutine close_near(model, evaluated, n, record)
        type(model_type), intent(in) :: model
        type(forward_record), intent(in) :: evaluated  !! its first sample
        integer, intent(in) :: n
        type(forward_record), intent(inout) :: record
        real(wp) :: place(place_size(model), model%n_link, n)
        logical :: is_closed(n)
        integer :: lane

        if (.not. places_groups(record%recorded)) return
        associate (samples => record%samples)
            do lane = 1, n
                place(:, :, lane) = reshape(evaluated%samples%place(:, 1), [size(place, 1), size(place, 2)])
            end do
            is_closed = .not. samples%is_left(:n)
            call close_places(model, record%recorded%closing, samples%q(:, :n), samples%branch(:, :n), place, &
                              samples%group_margin(:, :n), is_closed)
        end associate
        call take_places(model, place, is_closed, record)
    end subroutine close_near

    !> Places that were found for the first samples. Of those that are not surely certain there the lanes say how they are.
    subroutine take_places(model, place, is_closed, record)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: place(:, :, :)         !! (place_size, n_link, sample)
        logical, intent(in) :: is_closed(:)            !! (sample)
        type(forward_record), intent(inout) :: record
        integer :: lane, g

        associate (samples => record%samples)
            do lane = 1, size(is_closed)
                samples%place(:, lane) = reshape(place(:, :, lane), [size(samples%place, 1)])
                samples%is_left(lane) = .not. is_closed(lane)
                do g = 1, size(model%group)
                    samples%is_left(lane) = samples%is_left(lane) .or. &
                                            .not. is_surely_certain(samples%group_margin(g, lane), size(model%group(g)%unit), &
                                                                    sizes_away(model, model%group(g), place(:, :, lane)))
                end do
            end do
        end associate
    end subroutine take_places

    !> The first n states have been looked at: the next ones set out from those that the record serves.
    subroutine keep_stages(assembly, n, record)
        type(carried_assembly), intent(in) :: assembly !! of the accepted state
        integer, intent(in) :: n
        type(forward_record), intent(inout) :: record
        integer :: lane

        if (.not. places_groups(record%recorded)) return
        do lane = 1, n
            call keep_stage(assembly, lane, .not. record%samples%is_left(lane), record%samples%q(:, lane), &
                            record%samples%place(:, lane), record%stage)
        end do
    end subroutine keep_stages

    !> States are left that a mechanism may have left its assembly on the way to, of the first n that the record was run on last.
    !> Judged as lanes are.
    pure subroutine leave_doubtful(model, assembly, n, t, doubt, record)
        type(model_type), intent(in) :: model
        type(carried_assembly), intent(in) :: assembly !! of the accepted state
        integer, intent(in) :: n
        real(wp), intent(in) :: t(n)                   !! [s]
        real(wp), intent(inout) :: doubt(n)            !! not 0 where there is some already: see `doubt_far`
        type(forward_record), intent(inout) :: record
        real(wp), dimension(lanes) :: ahead, now, drift_now, of_group
        integer :: m, g, lane

        ahead(:n) = t - assembly%t(:n)
        associate (samples => record%samples, out => record%recorded%out, passes => model%scene%passes_change_points)
            do m = 1, model%n_branch
                call note_doubt(n, passes, model%least_margin(m), assembly%margin(:, m), assembly%drift(:, m), &
                                samples%found(:, out%margin + m - 1), samples%found(:, out%drift + m - 1), ahead, doubt)
            end do
            do g = 1, merge(size(model%group), 0, places_groups(record%recorded))
                m = model%n_branch + g
                now(:n) = samples%group_margin(g, :n)
                drift_now(:n) = secant(assembly%margin(:n, m), now(:n), ahead(:n))
                of_group(:n) = 0
                call note_doubt(n, passes, model%least_margin(m), assembly%margin(:, m), assembly%drift(:, m), now, drift_now, &
                                ahead, of_group)
                where (.not. record%is_led(:n)) doubt = doubt + of_group(:n)
            end do
            do lane = 1, n
                samples%is_left(lane) = merge(.true., samples%is_left(lane), doubt(lane) > 0)
            end do
        end associate
    end subroutine leave_doubtful

    !> Doubt grows where states lie so far from the accepted one that they do not tell of the assembly.
    pure subroutine doubt_far(model, layout, assembly, n, stride, y, doubt)
        type(model_type), intent(in) :: model
        type(state_layout), intent(in) :: layout
        type(carried_assembly), intent(in) :: assembly !! of the accepted state
        integer, intent(in) :: n
        integer, intent(in) :: stride                  !! from one column of y to the next
        real(wp), intent(in) :: y(stride, layout%n)    !! (lane, n)
        real(wp), intent(inout) :: doubt(n)
        integer :: k

        if (model%n_branch == 0) return
        do k = 1, model%n_q
            associate (p => layout%position(k))
                if (p > 0) call note_far(n, assembly%q(:, k), y(:, p), model%stride(k), doubt)
            end associate
        end do
    end subroutine doubt_far

    !> Go on from the first sample, an accepted state that leaves no doubt that it is on the accepted assembly: one for all lanes.
    !> `assembly%state` holds its coordinates.
    subroutine accept_recorded(model, t, margin, drift, record, assembly, is_done)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: t(lanes)               !! [s]
        real(wp), intent(in) :: margin(:), drift(:)    !! of the closed forms there (n_branch)
        type(forward_record), intent(in) :: record
        type(carried_assembly), intent(inout) :: assembly
        logical, intent(out) :: is_done                !! false: the record is not sure of it
        real(wp) :: place(place_size(model), model%n_link), column(link_freedom(model), model%n_link, model%n_q)

        place = 0
        is_done = size(record%recorded%model%group) == size(model%group)
        if (is_done .and. places_groups(record%recorded)) then
            place = reshape(record%samples%place(:, 1), shape(place))
            call find_columns(model, record, place, column, is_done)
        end if
        if (.not. is_done) return
        call accept_seen(model, t, spread(.true., 1, lanes), spread([margin, record%samples%group_margin(:, 1)], 1, lanes), &
                         spread(drift, 1, lanes), place, column, assembly)
    end subroutine accept_recorded

    !> How the groups' links move with each coordinate alone in the first sample.
    subroutine find_columns(model, record, place, column, are_sure)
        type(model_type), intent(in) :: model
        type(forward_record), intent(in) :: record
        real(wp), intent(in) :: place(:, :)            !! there (place_size, n_link)
        real(wp), intent(out) :: column(:, :, :)       !! (link_freedom, n_link, n_q)
        logical, intent(out) :: are_sure
        real(wp), dimension(model%n_q, model%n_q) :: q, unit
        real(wp) :: there(model%n_q, size(place, 1), size(place, 2)), branch(model%n_q, model%n_branch)
        integer :: g, k

        are_sure = .true.
        q = spread(record%samples%q(:, 1), 1, model%n_q)
        branch = spread(record%samples%branch(:, 1), 1, model%n_q)
        there = spread(place, 1, model%n_q)
        unit = 0
        do k = 1, model%n_q
            unit(k, k) = 1
        end do
        do g = 1, size(model%group)
            call take_group(size(model%group(g)%unit))
        end do

    contains

        subroutine take_group(n_row)
            integer, intent(in) :: n_row
            real(wp) :: rate(model%n_q, n_row), margin(model%n_q)
            logical :: is_sure(model%n_q)

            associate (link => model%group(g)%link)
                call record%recorded%closing%make_steps(g, q, unit, branch, there, margin, is_sure, rate=rate)
                are_sure = are_sure .and. all(is_sure)
                column(:, link, :) = reshape(transpose(rate), [size(column, 1), size(link), model%n_q])
            end associate
        end subroutine take_group
    end subroutine find_columns

    !> Values of laws over the state where the record takes them; driving forces are then what laws give.
    subroutine apply_record_laws(n, record)
        integer, intent(in) :: n
        type(forward_record), intent(inout) :: record

        call apply_laws(record%recorded, n, record%samples)
    end subroutine apply_record_laws

    !> Measures of the first n states, of which rates have been found: with turns, as the laws mean them.
    subroutine measure_states(n, t, y, turns, record, measure)
        integer, intent(in) :: n
        real(wp), intent(in) :: t(:)                   !! [s] (lane)
        real(wp), intent(in), contiguous :: y(:, :)    !! (lane, n)
        real(wp), intent(in) :: turns(:, :)            !! of angles that are not in y (lane, n)
        type(forward_record), intent(inout) :: record
        real(wp), intent(out) :: measure(:, :)         !! lanes beyond n are like lane n (lane, measure)
        integer :: lane

        if (.not. record%recorded%takes_measures) then
            if (record%by_columns) call carry_states(n, y, record)
            if (record%stands_still) record%samples%t(:n) = t(:n)
            if (record%stands_still) call place_turns(n, turns, record)
            call take_measures(record%recorded, n, record%samples)
        end if
        do lane = 1, size(measure, 1)
            measure(lane, :) = record%samples%measured(:record%samples%n_measure, min(lane, n))
        end do
    end subroutine measure_states

    !> Run the first n states, whose laws are there, with what transmissions lose taken off; ask `samples%is_left` which do not
    !> count.
    subroutine run_losing(model, lossy, n, record)
        type(model_type), intent(in) :: model
        integer, intent(in) :: lossy(:)                !! motors
        integer, intent(in) :: n
        type(forward_record), intent(inout) :: record

        call settle_losses(model, lossy, record%recorded, n, record%samples)
    end subroutine run_losing

    !> Run the first n states; ask `samples%is_left` which do not count.
    subroutine run_states(n, record, stride, y, laws_are_there)
        integer, intent(in) :: n
        type(forward_record), intent(inout) :: record
        integer, intent(in) :: stride                  !! from one column of y to the next
        real(wp), intent(in) :: y(stride, *)           !! (lane, n)
        logical, intent(in) :: laws_are_there          !! `apply_record_laws` has been called

        if (record%by_columns) then
            call run_columns_of_states(record%recorded, record%wiring, n, stride, y, record%samples)
        else
            call run_rates(record%recorded, n, record%samples, laws_are_there)
        end if
    end subroutine run_states

    !> What has been found of the first n states: accelerations, and all rates of y that the record knows of.
    subroutine take_rates(n, record, stride, y, n_q, acceleration, rate)
        integer, intent(in) :: n, n_q
        type(forward_record), intent(in) :: record
        integer, intent(in) :: stride                  !! from one column of y and its rates to the next
        real(wp), intent(in) :: y(stride, *)           !! (lane, n)
        real(wp), intent(inout) :: acceleration(lanes, n_q)    !! lanes beyond n are like lane n
        real(wp), intent(inout) :: rate(stride, *)     !! (lane, n)
        integer :: k

        associate (found => record%samples%found, first => record%recorded%out%acceleration)
            do k = 1, n_q
                call copy_lanes(n, found(:, first + k - 1), acceleration(:, k))
            end do
            call rates_of_states(record%wires, n, stride, y, size(found, 1), found, rate)
        end associate
    end subroutine take_rates

    !> Numbers of the first n lanes; further ones are like the last of these.
    pure subroutine copy_lanes(n, from, to)
        integer, intent(in) :: n
        real(wp), intent(in) :: from(n)
        real(wp), intent(inout) :: to(lanes)

        to(:n) = from
        to(n + 1:) = from(n)
    end subroutine copy_lanes
end module linkdyn_forward_record
