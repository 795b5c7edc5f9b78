!> Rates of forward dynamics from a record of the scene: which scenes have one, what it takes from a state, what it gives.
module linkdyn_forward_record
    use linkdyn_assembly_trail, only: sample_assembly
    use linkdyn_base_motion, only: evaluate_base
    use linkdyn_carried_assembly, only: carried_assembly, accept_seen, leaves_doubt, secant, take_branches
    use linkdyn_closing_programs, only: make_closing_programs
    use linkdyn_constants, only: two_pi
    use linkdyn_contact, only: contact_type
    use linkdyn_drive_laws, only: follows_target, is_given
    use linkdyn_drives, only: coordinate_of_actuator
    use linkdyn_equations, only: unknown_choice
    use linkdyn_forward_state, only: state_layout, fill_start
    use linkdyn_group_stride, only: close_places
    use linkdyn_inputs, only: trace_request, sample_set, in_q, in_quaternion, in_place
    use linkdyn_joint_rates, only: coordinate_of
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_laws, only: law_instants, set_instants, evaluate_at_instants
    use linkdyn_led_groups, only: lead_places
    use linkdyn_look_program, only: look_choice
    use linkdyn_lock, only: hold_texts, release_texts
    use linkdyn_model, only: model_type, step_pose, gives_attitude, link_freedom, place_size
    use linkdyn_motion, only: evaluate_loads
    use linkdyn_payloads, only: evaluate_payloads
    use linkdyn_rate_program, only: rate_outputs
    use linkdyn_recorded_rates, only: recorded_rates, rate_samples, record_rates, make_rate_samples, &
        free_rate_samples, run_rates, apply_laws
    use linkdyn_recorded_motors, only: motors_can_be_recorded, settle_losses
    use linkdyn_representatives, only: representative_poses, need_poses, few_links
    use linkdyn_scene, only: drive_spring_damper, drive_inverse, drive_constant, measure_joint, measure_touch
    use linkdyn_stage_places, only: stage_places, prepare_stage_places, predict_stage, keep_stage
    use linkdyn_uncertainty, only: is_surely_certain
    use linkdyn_whole_turns, only: with_turns
    implicit none (type, external)
    private
    public :: forward_record, can_be_recorded, evaluations_before_record, evaluations_on_lanes, make_forward_rates, &
        use_forward_rates, free_forward_record
    public :: place_states, place_touches, close_states, close_near, run_states, may_change_assembly, keep_stages, &
        apply_record_laws, settle_record_losses, is_led_there, accept_recorded

    !> The record that a run uses, and its samples of it.
    type :: forward_record
        type(recorded_rates), pointer :: recorded => null()
        type(rate_samples) :: samples
        type(stage_places) :: stage                    !! of groups
        logical, private :: is_led(lanes) = .false.    !! groups there, step by step: their margins have been looked at
        real(wp), allocatable :: given_force(:, :)     !! of drives whose forces somebody gives (lane, n_actuator)
        real(wp), allocatable :: counted(:, :)         !! rates of angles that coordinates stand in for (lane, n_q) [rad/s]
        real(wp), allocatable, private :: law(:, :)    !! what drives' laws give at an instant, their rates and accelerations
                                                       !! (3, n_actuator)
        type(law_instants), private :: instant         !! it
        integer, allocatable, private :: followed(:)   !! coordinate that an actuator's law compares with a position that it wants;
                                                       !! 0: none (n_actuator)
        integer, allocatable, private :: measured(:)   !! coordinate that a measure is: its turns are told apart; 0: none (measure)
        logical, allocatable, private :: is_sprung(:)  !! coordinates that a spring compares with its rest: a record cannot be told
                                                       !! of turns that are not in y (n_q)
    end type forward_record

contains

    !> May the scene have a record? Attitudes must come all in the same way; motors that laws are about must drive coordinates.
    pure logical function can_be_recorded(model, layout)
        type(model_type), intent(in) :: model
        type(state_layout), intent(in) :: layout
        integer :: i

        can_be_recorded = (all(layout%quaternion > 0) .or. all(layout%quaternion == 0)) &
                          .and. motors_can_be_recorded(model)
        do i = 1, size(model%step)
            if (.not. gives_attitude(model, model%step(i)) .or. model%step(i)%kind == step_pose) cycle
            can_be_recorded = can_be_recorded .and. layout%quaternion(model%step(i)%first) == 0
        end do
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

    !> Evaluations on lanes after which the record of a run is made: of mechanisms of some links it is at once, since whoever runs them
    !> again shares it.
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
        type(trace_request) :: request

        if (.not. can_be_recorded(model, layout)) return
        call need_poses(model, spread(model%start_q, 2, 1), poses)
        request%by_quaternion = any(layout%quaternion > 0)
        allocate (request%has_load(6, model%n_load))
        request%has_load = .true.
        request%drive_is_unknown = unknown%drive
        request%has_friction = size(model%contact) > 0
        request%acceleration_is_unknown = unknown%acceleration
        call hold_texts()
        call record_rates(model, request, wants_power, representatives(model, layout, poses%q, poses%assembly), &
                          poses%stand, recorded, choice)
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
    subroutine use_forward_rates(model, recorded, record)
        type(model_type), intent(in) :: model
        type(recorded_rates), intent(in), target :: recorded
        type(forward_record), intent(out) :: record

        record%recorded => recorded
        if (recorded%is_usable) call prepare_samples(model, record)
    end subroutine use_forward_rates

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

    subroutine prepare_samples(model, record)
        type(model_type), intent(in) :: model
        type(forward_record), intent(inout) :: record
        integer :: i, k

        call make_rate_samples(record%recorded, lanes, record%samples)
        allocate (record%samples%group_margin(size(model%group), lanes), source=0.0_wp)
        if (places_groups(record%recorded)) call prepare_stage_places(model, record%stage)
        allocate (record%followed(model%n_actuator), record%law(3, model%n_actuator), record%is_sprung(model%n_q))
        allocate (record%given_force(lanes, model%n_actuator), record%counted(lanes, model%n_q), source=0.0_wp)
        record%followed = 0
        record%is_sprung = .false.
        do i = 1, model%n_actuator
            k = counting(coordinate_of_actuator(model, i))
            associate (drive => model%scene%actuator(i)%drive)
                if (follows_target(drive)) record%followed(i) = k
                if (k > 0 .and. drive%kind == drive_spring_damper) record%is_sprung(k) = .true.
            end associate
        end do
        allocate (record%measured(size(model%scene%laws%measure)))
        record%measured = 0
        do i = 1, size(record%measured)
            associate (measure => model%scene%laws%measure(i))
                if (measure%kind == measure_joint .and. .not. measure%is_rate) &
                    record%measured(i) = counting(coordinate_of(model, measure%joint, measure%variable))
            end associate
        end do
        do i = 1, size(model%scene%spring)
            associate (spring => model%scene%spring(i))
                if (spring%joint == 0) cycle
                k = counting(coordinate_of(model, spring%joint, spring%variable))
                if (k > 0) record%is_sprung(k) = .true.
            end associate
        end do

    contains

        !> A coordinate that stands in for another variable counts no turns: 0.
        pure integer function counting(k)
            integer, intent(in) :: k

            counting = k
            if (k == 0) return
            if (model%scene%coordinate(k)%for_joint > 0) counting = 0
        end function counting
    end subroutine prepare_samples

    !> The first n states as samples of the record.
    subroutine place_states(model, layout, assembly, n, t, y, turns, by_inverse, record)
        type(model_type), intent(in) :: model
        type(state_layout), intent(in) :: layout
        type(carried_assembly), intent(in) :: assembly !! of the accepted state
        integer, intent(in) :: n
        real(wp), intent(in) :: t(lanes)               !! [s]
        real(wp), intent(in) :: y(:, :)                !! (lane, n)
        real(wp), intent(in) :: turns(:, :)            !! of angles that are not in y (lane, n)
        logical, intent(in) :: by_inverse(:)           !! `record%given_force` has their forces (n_actuator)
        type(forward_record), intent(inout) :: record
        real(wp), pointer, contiguous :: load(:, :, :)
        integer :: lane, i, k, p

        associate (samples => record%samples, law => record%law)
            do lane = 1, n
                ! what is no number must not pass through a choice of the record
                samples%is_left(lane) = .not. sum(abs(y(lane, :))) <= huge(1.0_wp)
                if (lane == 1) then
                    call look_at_laws()
                else if (t(lane) /= t(lane - 1)) then
                    call look_at_laws()
                else
                    call copy_laws()
                end if
                do k = 1, model%n_q
                    if (layout%rate(k) == 0) cycle
                    samples%qd(k, lane) = y(lane, layout%rate(k))
                    p = layout%position(k)
                    if (p == 0) cycle
                    samples%q(k, lane) = y(lane, p)
                    samples%is_left(lane) = samples%is_left(lane) .or. (record%is_sprung(k) .and. turns(lane, p) /= 0)
                end do
                do k = 1, model%n_q
                    p = layout%counted(k)
                    if (p > 0) samples%counted(k, lane) = with_turns(y(lane, p), turns(lane, p))
                end do
                do i = 1, model%n_attitude
                    p = layout%quaternion(i)
                    if (p > 0) samples%quaternion(4*i - 3:4*i, lane) = y(lane, p:p + 3)
                end do
                do i = 1, model%n_actuator
                    samples%target(2*i - 1:2*i, lane) = law(:2, i)
                    k = record%followed(i)
                    if (k > 0) samples%target(2*i - 1, lane) = law(1, i) - turns_of(k)
                    samples%effort(i, lane) = law(1, i)
                    if (by_inverse(i)) samples%effort(i, lane) = record%given_force(lane, i)
                end do
                call take_branches(model, assembly, lane, samples%branch(:, lane))
                samples%t(lane) = t(lane)
                do i = 1, size(record%measured)
                    samples%turned(i, lane) = 0
                    if (record%measured(i) > 0) samples%turned(i, lane) = turns_of(record%measured(i))
                end do
            end do
        end associate

    contains

        !> What depends on time alone.
        subroutine look_at_laws()
            record%law = 0
            call set_instants(record%instant, t(lane:lane))
            do i = 1, model%n_actuator
                associate (drive => model%scene%actuator(i)%drive, law => record%law)
                    if (drive%kind == drive_constant) then
                        law(1, i) = drive%value(1)     ! of a motor, else nobody asks
                    else if (follows_target(drive) .or. (is_given(drive) .and. drive%kind /= drive_inverse)) then
                        call evaluate_at_instants(drive%target, record%instant, law(1:1, i), law(2:2, i), law(3:3, i))
                    end if
                end associate
            end do
            do k = 1, model%n_q
                if (layout%rate(k) > 0) cycle
                associate (samples => record%samples)
                    call evaluate_at_instants(model%scene%coordinate(k)%motion, record%instant, samples%q(k:k, lane), &
                                              samples%qd(k:k, lane), samples%qdd(k:k, lane))
                end associate
            end do
            if (model%scene%base%moves) call evaluate_base(model, t(lane:lane), record%samples%base(:, lane:lane))
            if (size(model%payload) > 0) call evaluate_payloads(model, t(lane:lane), record%samples%payload(:, lane:lane))
            if (model%n_load == 0) return
            load(1:6, 1:model%n_load, 1:1) => record%samples%load(:, lane)
            call evaluate_loads(model, t(lane:lane), load)
        end subroutine look_at_laws

        !> Those of the state before, at the same instant.
        subroutine copy_laws()
            associate (samples => record%samples)
                samples%q(:, lane) = samples%q(:, lane - 1)
                samples%qd(:, lane) = samples%qd(:, lane - 1)
                samples%qdd(:, lane) = samples%qdd(:, lane - 1)
                samples%load(:, lane) = samples%load(:, lane - 1)
                samples%base(:, lane) = samples%base(:, lane - 1)
                samples%payload(:, lane) = samples%payload(:, lane - 1)
            end associate
        end subroutine copy_laws

        !> Angle of a coordinate that is not in y [rad].
        real(wp) function turns_of(k)
            integer, intent(in) :: k

            turns_of = 0
            if (layout%position(k) > 0) turns_of = two_pi*turns(lane, layout%position(k))
        end function turns_of
    end subroutine place_states

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
                                            .not. is_surely_certain(samples%group_margin(g, lane), size(model%group(g)%unit))
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

    !> May a mechanism have left its assembly on the way to the state that the record was run on last in a lane? Judged as lanes
    !> are.
    pure logical function may_change_assembly(model, assembly, lane, t, record) result(may)
        type(model_type), intent(in) :: model
        type(carried_assembly), intent(in) :: assembly !! of the accepted state
        integer, intent(in) :: lane
        real(wp), intent(in) :: t                      !! [s]
        type(forward_record), intent(in) :: record
        real(wp) :: ahead
        integer :: n_group

        n_group = merge(size(model%group), 0, places_groups(record%recorded))
        associate (found => record%samples%found(:, lane), out => record%recorded%out, n => model%n_branch, &
                   of_groups => record%samples%group_margin(:, lane))
            ahead = t - assembly%t(lane)
            may = any(leaves_doubt(model%scene%passes_change_points, model%least_margin(:n), assembly%margin(lane, :n), &
                                   ahead*assembly%drift(lane, :n), found(out%margin:out%margin + n - 1), &
                                   ahead*found(out%drift:out%drift + n - 1)))
            if (n_group == 0 .or. record%is_led(lane)) return
            associate (least => model%least_margin(n + 1:n + n_group), before => assembly%margin(lane, n + 1:n + n_group), &
                       drift => assembly%drift(lane, n + 1:n + n_group))
                may = may .or. any(leaves_doubt(model%scene%passes_change_points, least, before, ahead*drift, of_groups, &
                                                ahead*secant(before, of_groups, ahead)))
            end associate
        end associate
    end function may_change_assembly

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
        call accept_seen(model, t, spread(.true., 1, lanes), [margin, record%samples%group_margin(:, 1)], drift, place, column, &
                         assembly)
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

    !> What transmissions lose is taken off the driving forces.
    subroutine settle_record_losses(model, lossy, contact, n, record)
        type(model_type), intent(in) :: model
        integer, intent(in) :: lossy(:)
        type(contact_type), intent(in) :: contact(:)
        integer, intent(in) :: n
        type(forward_record), intent(inout) :: record

        if (size(lossy) > 0) call settle_losses(model, lossy, contact, record%recorded, n, record%samples)
    end subroutine settle_record_losses

    !> Run the first n states; asks `samples%is_left` which do not count.
    subroutine run_states(n, record, acceleration, work, supplied, laws_are_there)
        integer, intent(in) :: n
        type(forward_record), intent(inout) :: record
        logical, intent(in) :: laws_are_there                  !! `apply_record_laws` has been called
        real(wp), intent(inout) :: acceleration(:, :)          !! (lane, n_q); lanes beyond n are like lane n
        real(wp), intent(out), dimension(lanes) :: work, supplied    !! powers [W]
        type(rate_outputs) :: out
        integer :: k

        out = record%recorded%out
        call run_rates(record%recorded, n, record%samples, laws_are_there)
        do k = 1, size(acceleration, 2)
            call take(out%acceleration + k - 1, acceleration(:, k))
            call take(out%counted + k - 1, record%counted(:, k))
        end do
        call take(out%work, work)
        call take(out%supplied, supplied)

    contains

        !> A number that was found.
        subroutine take(number, x)
            integer, intent(in) :: number
            real(wp), intent(inout) :: x(lanes)

            x(:n) = record%samples%found(number, :n)
            x(n + 1:) = x(n)
        end subroutine take
    end subroutine run_states
end module linkdyn_forward_record
