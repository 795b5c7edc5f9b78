!> Rates of forward dynamics by a record of the scene: traced once, run on single samples or on blocks of them.
!>
!> A record serves scenes whose loops all close in closed form. A sample at which it raises its alarm, near a dead point or
!> where a pivot fails, or that is not finite, is left to whoever solves with pivots of its own.
module linkdyn_recorded_rates
    use linkdyn_base_motion, only: base_size
    use linkdyn_block, only: block_lanes
    use linkdyn_closing_programs, only: closing_programs
    use linkdyn_contact, only: n_part
    use linkdyn_inputs, only: trace_request, sample_set, in_q, in_quaternion, in_qd, in_qdd, in_load, in_target, in_effort, &
        in_branch, in_pull, in_base, in_payload, in_place, in_counted, in_sense, n_block
    use linkdyn_kinds, only: wp
    use linkdyn_law_values, only: evaluate_laws
    use linkdyn_linear_program, only: linear_outputs
    use linkdyn_loss_balance, only: lossy_samples
    use linkdyn_look_program, only: look_choice, look_outputs, make_look_program, out_looks
    use linkdyn_measure_program, only: make_measure_program, out_measures
    use linkdyn_model, only: model_type, place_size, pull_power, effort_power
    use linkdyn_rate_program, only: rate_outputs, make_rate_program, out_rates
    use linkdyn_recorded_forces, only: plan_for_records
    use linkdyn_recorded_friction, only: friction_programs, friction_space, settle_block, load_settled, settle_one, &
        free_friction_programs, free_friction_space
    use linkdyn_samples, only: sample_arrays, set_block
    use linkdyn_scene, only: law_spec, law_over, effort_over, side_joint, measure_time, is_sampled, n_event
    use linkdyn_step_program, only: step_outputs, step_judge, state_places, make_step_program
    use linkdyn_scene_program, only: scene_program, program_space, load_samples, run_samples, run_one_sample, output_target, &
        run_columns, most_lanes, goes_to, free_scene_program, free_program_space, input_wiring, column_list, wire_inputs, run_wired
    implicit none (type, external)
    private
    public :: recorded_rates, rate_samples, record_rates, free_rates, make_rate_samples, free_rate_samples, &
        run_rates, run_columns_of_states, apply_laws, take_measures, run_looks, wire_looks, run_looks_on_lanes, record_steps, &
        wire_steps, run_steps_on_lanes

    !> A scene's record. Constant once it is made: threads share it.
    type :: recorded_rates
        logical :: is_usable = .false.                 !! false: the scene has no record
        type(model_type), pointer :: model => null()   !! planned for records
        type(scene_program) :: program
        type(scene_program) :: measures                !! what laws over the state and events depend on; not made if there are none
        logical :: takes_measures = .false.            !! the rates hang on these
        type(rate_outputs) :: out
        type(input_wiring), private :: of_samples      !! all its inputs from samples
        type(scene_program) :: looks                   !! at the ends of steps; not made if nobody wants that
        type(look_outputs) :: look
        type(scene_program) :: steps                   !! whole ones of equal length; not made before somebody asks
        type(step_outputs) :: step
        type(scene_program) :: linear                  !! columns of a linearization; not made before somebody asks
        type(linear_outputs) :: column
        type(friction_programs) :: friction            !! not made if nothing rubs
        type(closing_programs) :: closing              !! Newton's steps of groups, by whoever makes the record; else it takes no
                                                       !! places
    end type recorded_rates

    !> Samples of one thread: what its record takes and gives.
    type :: rate_samples
        real(wp), pointer, contiguous :: q(:, :) => null(), qd(:, :) => null(), qdd(:, :) => null()    !! (n_q, sample)
        real(wp), pointer, contiguous :: quaternion(:, :) => null()    !! of attitudes (4 n_attitude, sample)
        real(wp), pointer, contiguous :: load(:, :) => null()          !! (6 n_load, sample) [N, N m]
        real(wp), pointer, contiguous :: target(:, :) => null()        !! of drives' laws: value and rate (2 n_actuator, sample)
        real(wp), pointer, contiguous :: effort(:, :) => null()        !! driving forces given (n_actuator, sample) [N, N m]
        real(wp), pointer, contiguous :: branch(:, :) => null()        !! (n_branch, sample)
        real(wp), pointer, contiguous :: place(:, :) => null()         !! of links closed by iteration (place_size n_link, sample)
        real(wp), pointer, contiguous :: pull(:, :) => null()          !! of springs' laws over the state (n_spring, sample) [N, N
                                                                       !! m]
        real(wp), pointer, contiguous :: base(:, :) => null()          !! what is felt of the frame's motion (base_size, sample)
        real(wp), pointer, contiguous :: payload(:, :) => null()       !! masses that links carry (n_payload, sample) [kg]
        real(wp), pointer, contiguous :: counted(:, :) => null()       !! angles that coordinates stand in for (n_q, sample) [rad]
        real(wp), pointer, contiguous :: sense(:, :) => null()         !! of contacts that may stick: they slide that way, see
                                                                       !! `in_sense` (n_part n_contact, sample)
        real(wp), pointer, contiguous :: measured(:, :) => null()      !! what laws over the state depend on, then how fast motors
                                                                       !! turn their joint variables (measure + actuator, sample)
        integer :: n_measure = 0
        real(wp), allocatable :: law(:, :)                             !! values of the laws (law, sample)
        real(wp), allocatable :: turned(:, :)                          !! turns of these that the states leave out [rad] (measure,
                                                                       !! sample)
        real(wp), allocatable :: t(:)                                  !! (sample) [s]
        real(wp), allocatable :: mode(:)                               !! of laws that jump (sample)
        real(wp), pointer, contiguous :: found(:, :) => null()         !! as `rate_outputs` tells (sample, value)
        real(wp), pointer, contiguous :: seen(:, :) => null()          !! as `look_outputs` tells (value, sample)
        real(wp), allocatable :: group_margin(:, :)                    !! of the groups closed by iteration, for whoever closes them
                                                                       !! (n_group, sample)
        logical, allocatable :: is_left(:)                             !! nothing of it counts (sample)
        logical :: are_new = .true.                                    !! since the rates were run last; false: they take from the
                                                                       !! arrays what they took then
        type(sample_arrays), private :: arrays
        type(program_space), private :: one, block, one_measured, block_measured, one_seen, block_seen, block_stepped
        type(friction_space), private :: friction
    end type rate_samples

contains

    !> Trace the scene. Poses are representative: pivots are chosen by them.
    subroutine record_rates(model, request, wants_power, pose, stand, recorded, choice)
        type(model_type), intent(in) :: model
        type(trace_request), intent(in) :: request
        logical, intent(in) :: wants_power
        type(sample_set), intent(in) :: pose                   !! at which all loops close on the start's assembly
        real(wp), intent(in) :: stand(:, :, 0:)                !! axes and origins of the links at the first (3, 4, 0:n_link)
        type(recorded_rates), intent(out) :: recorded
        type(look_choice), intent(in), optional :: choice      !! what steps are judged by; absent: nobody looks
        type(sample_set) :: sample

        allocate (recorded%model)
        if (pose%n == 0 .or. .not. plan_for_records(model, stand, recorded%model)) return
        sample = pose
        sample%of(in_branch)%x = spread(recorded%model%branch, 2, sample%n)
        call make_rate_program(recorded%model, request, wants_power, sample, recorded%program, recorded%out, &
                               recorded%friction)
        recorded%is_usable = recorded%program%is_made
        if (recorded%is_usable) call wire_inputs(recorded%program, spread(column_list(), 1, n_block), recorded%of_samples)
        recorded%takes_measures = size(model%scene%laws%law) > 0 .or. measures_for_controllers(model) &
                                  .or. any(model%scene%actuator%law%side /= side_joint)
        if (recorded%is_usable .and. (recorded%takes_measures .or. n_event(model%scene) > 0)) &
            call make_measure_program(recorded%model, request, sample, recorded%measures)
        if (recorded%is_usable .and. present(choice)) &
            call make_look_program(recorded%model, request, choice, sample, recorded%looks, recorded%look)
    end subroutine record_rates

    !> Trace whole steps of a scene whose rates have been recorded, and hang on nothing but the state.
    subroutine record_steps(request, wants_power, places, judge, pose, recorded)
        type(trace_request), intent(in) :: request
        logical, intent(in) :: wants_power
        type(state_places), intent(in) :: places
        type(step_judge), intent(in) :: judge
        type(sample_set), intent(in) :: pose                   !! as for the rates
        type(recorded_rates), intent(inout) :: recorded
        type(sample_set) :: sample

        sample = pose
        sample%of(in_branch)%x = spread(recorded%model%branch, 2, sample%n)
        call make_step_program(recorded%model, request, wants_power, places, judge, sample, recorded%steps, recorded%step)
    end subroutine record_steps

    !> Do continuous controllers look at measures?
    pure logical function measures_for_controllers(model)
        type(model_type), intent(in) :: model

        measures_for_controllers = .false.
        if (allocated(model%scene%controller)) measures_for_controllers = .not. all(is_sampled(model%scene%controller))
    end function measures_for_controllers

    subroutine free_rates(recorded)
        type(recorded_rates), intent(inout) :: recorded

        call free_scene_program(recorded%program)
        call free_scene_program(recorded%measures)
        call free_scene_program(recorded%looks)
        call free_scene_program(recorded%steps)
        call free_scene_program(recorded%linear)
        call free_friction_programs(recorded%friction)
        call recorded%closing%free()
        if (associated(recorded%model)) deallocate (recorded%model)
        recorded%is_usable = .false.
    end subroutine free_rates

    !> Room for n samples.
    subroutine make_rate_samples(recorded, n, samples)
        type(recorded_rates), intent(in) :: recorded
        integer, intent(in) :: n
        type(rate_samples), intent(out) :: samples

        associate (model => recorded%model)
            call add(in_q, model%n_q, samples%q)
            call add(in_qd, model%n_q, samples%qd)
            call add(in_qdd, model%n_q, samples%qdd)
            call add(in_quaternion, 4*model%n_attitude, samples%quaternion)
            call add(in_load, 6*model%n_load, samples%load)
            call add(in_target, 2*model%n_actuator, samples%target)
            call add(in_effort, model%n_actuator, samples%effort)
            call add(in_branch, model%n_branch, samples%branch)
            call add(in_place, merge(place_size(model)*model%n_link, 0, recorded%closing%is_usable), samples%place)
            call add(in_pull, size(model%scene%spring), samples%pull)
            call add(in_base, base_size(model), samples%base)
            call add(in_payload, size(model%payload), samples%payload)
            call add(in_counted, model%n_q, samples%counted)
            call add(in_sense, n_part*size(model%contact), samples%sense)
            allocate (samples%law(size(model%scene%laws%law), n), source=0.0_wp)
            samples%n_measure = size(model%scene%laws%measure)
            allocate (samples%measured(samples%n_measure + 2*model%n_actuator, n), samples%turned(samples%n_measure, n), &
                      source=0.0_wp)
        end associate
        allocate (samples%found(n, recorded%out%n), samples%seen(recorded%look%n, n), samples%is_left(n), samples%t(n), &
                  samples%mode(n))
        samples%t = 0
        samples%mode = 0

    contains

        subroutine add(block, rows, x)
            integer, intent(in) :: block, rows
            real(wp), pointer, contiguous, intent(out) :: x(:, :)

            allocate (x(rows, n), source=0.0_wp)
            call set_block(samples%arrays, block, rows, n, x)
        end subroutine add
    end subroutine make_rate_samples

    subroutine free_rate_samples(samples)
        type(rate_samples), intent(inout) :: samples

        if (.not. associated(samples%found)) return
        deallocate (samples%q, samples%qd, samples%qdd, samples%quaternion, samples%load, samples%target, samples%effort, &
                    samples%branch, samples%place, samples%pull, samples%base, samples%payload, samples%counted, samples%sense, &
                    samples%measured, samples%found, samples%seen)
        call free_friction_space(samples%friction)
        call free_program_space(samples%one_seen)
        call free_program_space(samples%block_seen)
        call free_program_space(samples%block_stepped)
        call free_program_space(samples%one_measured)
        call free_program_space(samples%block_measured)
        call free_program_space(samples%one)
        call free_program_space(samples%block)
    end subroutine free_rate_samples

    !> Measure, evaluate the laws over the state, and put their values where the program takes them: on top of loads that are
    !> there.
    subroutine apply_laws(recorded, n, samples)
        type(recorded_rates), intent(in) :: recorded
        integer, intent(in) :: n
        type(rate_samples), intent(inout), target :: samples
        real(wp), allocatable :: law(:, :)                 !! (sample, law)
        integer :: i, k

        if (.not. (recorded%takes_measures .and. recorded%measures%is_made)) return
        allocate (law(n, size(recorded%model%scene%laws%law)))
        call take_measures(recorded, n, samples)
        associate (model => recorded%model, book => recorded%model%scene%laws, measured => samples%measured(:samples%n_measure, :n))
            call evaluate_laws(book, transpose(measured), law, samples%mode(:n))
            samples%law(:, :n) = transpose(law)
            do i = 1, model%n_load
                do k = 1, 3
                    call add(model%scene%load(i)%force(k), book%scale, samples%load(6*i - 6 + k, :))
                    call add(model%scene%load(i)%moment(k), book%scale**2, samples%load(6*i - 3 + k, :))
                end do
            end do
            do i = 1, size(model%scene%spring)
                associate (spring => model%scene%spring(i))
                    samples%pull(i, :n) = 0
                    call add(spring%force, book%scale**pull_power(model, spring), samples%pull(i, :))
                end associate
            end do
            do i = 1, model%n_actuator
                associate (spec => model%scene%actuator(i))
                    if (spec%law%kind /= effort_over) cycle
                    samples%effort(i, :n) = 0
                    call add(spec%law%target, book%scale**effort_power(model, i), samples%effort(i, :))
                end associate
            end do
        end associate

    contains

        subroutine add(spec, scale, numbers)
            type(law_spec), intent(in) :: spec
            real(wp), intent(in) :: scale
            real(wp), intent(inout) :: numbers(:)

            if (spec%kind == law_over) numbers(:n) = numbers(:n) + scale*law(:, spec%law)
        end subroutine add
    end subroutine apply_laws

    !> Measure the first n samples, as the laws mean it.
    subroutine take_measures(recorded, n, samples)
        type(recorded_rates), intent(in) :: recorded
        integer, intent(in) :: n
        type(rate_samples), intent(inout), target :: samples
        integer :: k

        call run_program(recorded%measures, out_measures, n, samples%arrays, samples%one_measured, samples%block_measured, &
                         samples%measured)
        associate (book => recorded%model%scene%laws, measured => samples%measured(:samples%n_measure, :n))
            measured = measured + samples%turned(:, :n)
            do k = 1, size(book%measure)
                if (book%measure(k)%kind == measure_time) measured(k, :) = samples%t(:n)
                if (book%measure(k)%length_power /= 0) measured(k, :) = measured(k, :)/book%scale**book%measure(k)%length_power
            end do
        end associate
    end subroutine take_measures

    !> Run the first n samples, but those that are left already; says which others are.
    subroutine run_rates(recorded, n, samples, laws_are_there, lossy)
        type(recorded_rates), intent(in) :: recorded
        integer, intent(in) :: n
        type(rate_samples), intent(inout), target :: samples
        logical, intent(in), optional :: laws_are_there    !! `apply_laws` has been called for these samples; absent: false
        type(lossy_samples), intent(inout), optional :: lossy  !! where something rubs: what is lost settles with it
        real(wp) :: none(1, 1)
        logical :: has_laws

        if (all(samples%is_left(:n))) return
        has_laws = .false.
        if (present(laws_are_there)) has_laws = laws_are_there
        if (.not. has_laws) call apply_laws(recorded, n, samples)
        if (recorded%friction%is_made) then
            call run_rubbing(recorded, n, samples, lossy)
        else
            call run_wired(recorded%program, recorded%of_samples, samples%arrays, .true., 1, none, n, samples%one, &
                           samples%block, size(samples%found, 1), size(samples%found, 2), samples%found, samples%is_left)
        end if
        call leave_alarmed(n, samples%found(:, recorded%out%alarm), samples%found(:, recorded%out%reach), samples%is_left)
    end subroutine run_rates

    !> The same of samples of which states come in columns. Nothing rubs, and no law hangs on states.
    subroutine run_columns_of_states(recorded, wiring, n, stride, columns, samples)
        type(recorded_rates), intent(in) :: recorded
        type(input_wiring), intent(in) :: wiring
        integer, intent(in) :: n
        integer, intent(in) :: stride                      !! from one column to the next
        real(wp), intent(in) :: columns(stride, *)         !! that the wiring speaks of (sample, column)
        type(rate_samples), intent(inout), target :: samples

        if (all(samples%is_left(:n))) return
        call run_wired(recorded%program, wiring, samples%arrays, samples%are_new, stride, columns, n, samples%one, &
                       samples%block, size(samples%found, 1), size(samples%found, 2), samples%found, samples%is_left)
        samples%are_new = .false.
        call leave_alarmed(n, samples%found(:, recorded%out%alarm), samples%found(:, recorded%out%reach), samples%is_left)
    end subroutine run_columns_of_states

    !> Samples are left at which a record raises its alarm. Written so that what is no number counts as one.
    pure subroutine leave_alarmed(n, alarm, reach, is_left)
        integer, intent(in) :: n
        real(wp), intent(in) :: alarm(n), reach(n)
        logical, intent(inout) :: is_left(n)
        integer :: i

        do i = 1, n
            is_left(i) = merge(is_left(i), .true., alarm(i) <= 1 .and. reach(i) > 0)
        end do
    end subroutine leave_alarmed

    !> The same where something rubs: what presses is settled first.
    subroutine run_rubbing(recorded, n, samples, lossy)
        type(recorded_rates), intent(in) :: recorded
        integer, intent(in) :: n
        type(rate_samples), intent(inout), target :: samples
        type(lossy_samples), intent(inout), optional :: lossy
        type(sample_arrays) :: settled
        type(output_target) :: to(1)
        logical :: is_left, is_bad(most_lanes)
        integer :: first, count


        if (n == 1) then
            call settle_one(recorded%friction, samples%arrays, samples%friction, settled, is_left, lossy)
            samples%is_left(1) = is_left
            if (is_left) return
            call run_one_sample(recorded%program, settled, samples%one, samples%found(1, :))
            samples%is_left(1) = .not. sum(abs(samples%found(1, :))) <= huge(1.0_wp)
            return
        end if
        to(1) = goes_to(out_rates, samples%found)
        do first = 1, n, block_lanes()
            count = min(block_lanes(), n - first + 1)
            call settle_block(recorded%friction, samples%arrays, first, count, samples%friction, &
                              samples%is_left(first:first + count - 1), lossy)
            call load_settled(recorded%friction, recorded%program, samples%arrays, first, count, samples%friction, &
                              samples%block)
            call run_columns(recorded%program, samples%block, first, count, to, is_bad(:count))
            where (is_bad(:count)) samples%is_left(first:first + count - 1) = .true.
        end do
    end subroutine run_rubbing

    !> All that a program finds, of the first n samples: of one alone by itself, which takes a part of what a block takes.
    subroutine run_program(program, id, n, arrays, one, block, found, is_bad)
        type(scene_program), intent(in) :: program
        integer, intent(in) :: id                          !! of the output
        integer, intent(in) :: n
        type(sample_arrays), intent(in) :: arrays
        type(program_space), intent(inout) :: one, block
        real(wp), intent(inout), target, contiguous :: found(:, :)     !! (value, sample)
        logical, intent(inout), optional :: is_bad(:)      !! set where a number is not finite (sample)
        type(output_target) :: to(1)
        integer :: first, count

        if (n == 1) then
            call run_one_sample(program, arrays, one, found(:, 1))
            if (present(is_bad)) is_bad(1) = is_bad(1) .or. .not. sum(abs(found(:, 1))) <= huge(1.0_wp)
            return
        end if
        to(1) = goes_to(id, found)
        do first = 1, n, block_lanes()
            count = min(block_lanes(), n - first + 1)
            call load_samples(program, arrays, first, count, block)
            if (present(is_bad)) then
                call run_samples(program, block, first, count, to, is_bad(first:first + count - 1))
            else
                call run_samples(program, block, first, count, to)
            end if
        end do
    end subroutine run_program

    !> Look at the first n samples; says which others are left.
    subroutine run_looks(recorded, n, samples)
        type(recorded_rates), intent(in) :: recorded
        integer, intent(in) :: n
        type(rate_samples), intent(inout), target :: samples
        integer :: i

        call run_program(recorded%looks, out_looks, n, samples%arrays, samples%one_seen, samples%block_seen, samples%seen, &
                         samples%is_left)
        do i = 1, n
            samples%is_left(i) = samples%is_left(i) .or. .not. (samples%seen(recorded%look%alarm, i) <= 1 &
                                                                .and. samples%seen(recorded%look%reach, i) > 0)
        end do
    end subroutine run_looks

    !> States come in columns to whoever looks at lanes of them.
    subroutine wire_looks(recorded, column, wiring)
        type(recorded_rates), intent(in) :: recorded
        type(column_list), intent(in) :: column(n_block)
        type(input_wiring), intent(out) :: wiring

        call wire_inputs(recorded%looks, column, wiring)
    end subroutine wire_looks

    !> The same of a whole block of lanes, of which states come in columns, and what is seen goes to columns.
    subroutine run_looks_on_lanes(recorded, wiring, columns, samples, seen)
        type(recorded_rates), intent(in) :: recorded
        type(input_wiring), intent(in) :: wiring
        real(wp), intent(in), contiguous :: columns(:, :)      !! that it speaks of (lane, column)
        type(rate_samples), intent(inout), target :: samples
        real(wp), intent(inout), contiguous :: seen(:, :)      !! (lane, value)

        call run_wired(recorded%looks, wiring, samples%arrays, samples%are_new, size(columns, 1), columns, size(columns, 1), &
                       samples%one_seen, samples%block_seen, size(seen, 1), size(seen, 2), seen, samples%is_left)
        samples%are_new = .false.
        call leave_alarmed(size(seen, 1), seen(:, recorded%look%alarm), seen(:, recorded%look%reach), samples%is_left)
    end subroutine run_looks_on_lanes

    !> States come in columns to whoever takes steps on lanes, and so does what he knows beside them.
    subroutine wire_steps(recorded, column, wiring)
        type(recorded_rates), intent(in) :: recorded
        type(column_list), intent(in) :: column(n_block)
        type(input_wiring), intent(out) :: wiring

        call wire_inputs(recorded%steps, column, wiring)
    end subroutine wire_steps

    !> Take a step on a whole block of lanes: what it takes, and what comes of it, as `step_inputs` tells.
    subroutine run_steps_on_lanes(recorded, wiring, are_new, taken, samples, found, is_left)
        type(recorded_rates), intent(in) :: recorded
        type(input_wiring), intent(in) :: wiring
        logical, intent(in) :: are_new                         !! other inputs may have changed since the last step
        real(wp), intent(in), contiguous :: taken(:, :)        !! (lane, value)
        type(rate_samples), intent(inout) :: samples
        real(wp), intent(inout), contiguous :: found(:, :)     !! (lane, value)
        logical, intent(out) :: is_left(:)                     !! it is not to be believed (lane)

        is_left = .false.
        call run_wired(recorded%steps, wiring, samples%arrays, are_new, size(taken, 1), taken, size(taken, 1), samples%one, &
                       samples%block_stepped, size(found, 1), size(found, 2), found, is_left)
        call leave_uncertain(size(found, 1), found(:, recorded%step%certain), is_left)
    end subroutine run_steps_on_lanes

    pure subroutine leave_uncertain(n, certain, is_left)
        integer, intent(in) :: n
        real(wp), intent(in) :: certain(n)
        logical, intent(inout) :: is_left(n)
        integer :: i

        do i = 1, n
            is_left(i) = merge(is_left(i), .true., certain(i) > 0)
        end do
    end subroutine leave_uncertain
end module linkdyn_recorded_rates
