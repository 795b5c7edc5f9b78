!> Inverse dynamics of a batch: motion given; driving forces, joint reactions and joint motion out.
!>
!> First it is found where the links of each sample are looked for, then the scene's record does what it can, and lanes do the rest
!> (`linkdyn_lane_batch`). Samples are independent: results do not depend on threads. A sample that fails is NaN.
module linkdyn_inverse
    use linkdyn_assembly_trail, only: assembly_trail, sample_assembly, follow_assembly, longest_stride, make_room, &
        place_sample, reached_straight
    use linkdyn_result_kinds, only: result_reaction, result_joint_variable, result_joint_rate
    use linkdyn_closing_programs, only: closing_programs
    use linkdyn_equations, only: solver_gauss_jordan, solver_lapack, solver_elimination, solver_reduced, &
        solver_gauss_jordan_plain, solver_name, choose_solver
    use linkdyn_failure, only: lost_in_words, failure_at, lock_in_words
    use linkdyn_group_motion, only: group_closer
    use linkdyn_inverse_results, only: inverse_results, part_of_results
    use linkdyn_inverse_solver, only: shared_places, inverse_options, inverse_solver, prepare_inverse
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state, prepare_kinematics
    use linkdyn_lane_batch, only: lane_batch, run_on_lanes
    use linkdyn_lane_count, only: lanes
    use linkdyn_led_mechanism, only: evaluate_kinematics
    use linkdyn_load_laws, only: evaluate_load_laws
    use linkdyn_lock, only: hold_texts, release_texts
    use linkdyn_margin_source, only: margin_source
    use linkdyn_model, only: model_type, has_assemblies, place_size
    use linkdyn_motion_batch, only: motion_batch, motion_of
    use linkdyn_recorded_forces, only: recorded_forces
    use linkdyn_recorded_margins, only: recorded_margins
    use linkdyn_roads, only: road_counts, operator(+)
    use linkdyn_settled_samples, only: settle_samples
    use linkdyn_status, only: status_type, sample_undefined
    use linkdyn_turns, only: turn_count, take_turns_off
    implicit none (type, external)
    private
    public :: shared_places, inverse_options, inverse_results, inverse_solver, motion_batch, motion_of
    public :: prepare_inverse, run_inverse, run_prepared, part_of_results
    public :: solver_gauss_jordan, solver_lapack, solver_elimination, solver_reduced, solver_gauss_jordan_plain
    public :: solver_name, choose_solver, look_for_record, samples_to_come, place_by_record

    !> A program of Newton's steps takes some tens of milliseconds to make, as these samples take without. Who keeps a solver for
    !> the calls to come expects as many, at least: loops closed by iteration then take their steps from the first call on.
    integer, parameter :: worth_closing = 256, samples_to_come = worth_closing

    !> What serves a batch beside the lanes.
    type :: programs_at_hand
        type(recorded_forces), pointer :: forces => null()     !! null: lanes do all samples
        type(recorded_margins) :: margins                      !! by which a motion is followed
        class(group_closer), pointer :: closer => null()       !! null: lanes close groups
    end type programs_at_hand

    ! How is said in `linkdyn_inverse_turns`.
    interface
        !> Joint angles of samples get the turns that they have where somebody says that they are about.
        module subroutine count_turns_about(model, variable, turns)
            type(model_type), intent(in) :: model
            real(wp), intent(inout) :: variable(:, :)      !! (n_variable, n); samples that failed are NaN
            type(turn_count), intent(inout) :: turns
        end subroutine count_turns_about

        !> Joint angles of samples that follow each other get the turns that they make on the straight way from one to the next.
        module subroutine count_turns_on_way(model, closing, q, qd, rate, turned, assembly, variable, turns)
            type(model_type), intent(in) :: model
            type(closing_programs), pointer, intent(in) :: closing    !! of the groups' steps; null: there are none
            real(wp), intent(in), contiguous :: q(:, :), qd(:, :)      !! (n_q, n)
            real(wp), intent(in), contiguous :: rate(:, :)         !! of the joint variables (n_variable, n)
            logical, intent(in) :: turned(:)               !! attitudes of a sample go by quaternions (n)
            type(sample_assembly), intent(in) :: assembly  !! of the samples; empty: there is but one
            real(wp), intent(inout), contiguous :: variable(:, :)  !! (n_variable, n); samples that failed are NaN
            type(turn_count), intent(inout) :: turns       !! of the samples before, then of the last of these
        end subroutine count_turns_on_way
    end interface

    ! How is said in `linkdyn_inverse_records`.
    interface
        !> Where links are, by the scene's record where that is worth while, with a solver that was prepared for no forces. Samples
        !> `left` are for the lanes, on their assembly. With a trail the samples follow each other.
        module subroutine place_by_record(model, solver, q, results, assembly, left, trail)
            type(model_type), intent(in) :: model
            type(inverse_solver), intent(in) :: solver
            real(wp), intent(in), contiguous, target :: q(:, :)     !! (n_q, n)
            type(inverse_results), intent(inout) :: results         !! positions, rotations, status
            type(sample_assembly), intent(out) :: assembly
            integer, allocatable, intent(out) :: left(:)
            type(assembly_trail), intent(inout), optional :: trail
        end subroutine place_by_record

        !> The record for the results wanted, made when they are wanted first of a batch that is worth it; null if there is none.
        recursive module subroutine need_record(model, solver, results, q, recorded)
            type(model_type), intent(in) :: model
            type(inverse_solver), intent(in) :: solver
            type(inverse_results), intent(in) :: results
            real(wp), intent(in) :: q(:, :)                        !! (n_q, n)
            type(recorded_forces), pointer, intent(out) :: recorded
        end subroutine need_record

        !> The record of margins, by which a motion is followed, made likewise; null if there is none.
        recursive module subroutine need_margins(model, solver, q, recorded)
            type(model_type), intent(in) :: model
            type(inverse_solver), intent(in) :: solver
            real(wp), intent(in) :: q(:, :)                        !! (n_q, n)
            type(recorded_forces), pointer, intent(out) :: recorded
        end subroutine need_margins

        !> Is there a record for some results of a scene that finds what the lanes find?
        !>
        !> **Errors**: as of `prepare_inverse`.
        module subroutine look_for_record(model, wanted, is_there, is_uncertain, is_refuted, status)
            type(model_type), intent(in) :: model
            integer, intent(in) :: wanted(:)                       !! `result_*` of the catalogue
            logical, intent(out) :: is_there
            logical, intent(out) :: is_uncertain                   !! it leaves all poses to the lanes that it could be asked at
            logical, intent(out) :: is_refuted                     !! it does not find what the lanes find
            type(status_type), intent(inout) :: status
        end subroutine look_for_record

        !> Programs of Newton's steps, made when they are wanted first; null if a group has none.
        module subroutine need_closer(model, solver, q, closer)
            type(model_type), intent(in) :: model
            type(inverse_solver), intent(in) :: solver
            real(wp), intent(in) :: q(:, :)                        !! (n_q, n)
            class(group_closer), pointer, intent(out) :: closer
        end subroutine need_closer

        !> What the record can do of a batch; `left` are the samples that it leaves to the lanes.
        module subroutine run_by_record(model, recorded, threads, motion, assembly, results, n_left, left)
            type(model_type), intent(in) :: model
            type(recorded_forces), intent(in) :: recorded
            integer, intent(in) :: threads
            type(motion_batch), intent(in) :: motion
            type(sample_assembly), intent(in), target :: assembly
            type(inverse_results), intent(inout) :: results
            integer, intent(out) :: n_left
            integer, allocatable, intent(out) :: left(:)           !! absent if there are none
        end subroutine run_by_record
    end interface

contains

    !> Plan and run one batch.
    !>
    !> **Errors**: `status_bad_input` if the number of actuators does not fit or the solver cannot give what is wanted.
    subroutine run_inverse(model, options, q, qd, qdd, load, results, status, t)
        type(model_type), intent(in) :: model
        type(inverse_options), intent(in) :: options
        real(wp), intent(in), contiguous, target :: q(:, :), qd(:, :), qdd(:, :)    !! (n_q, n)
        real(wp), intent(in), contiguous, target :: load(:, :, :)    !! (6, n_load, n)
        type(inverse_results), intent(inout) :: results
        type(status_type), intent(out) :: status
        real(wp), intent(in), optional, target :: t(:)          !! instants, for laws that ask for them [s] (n); absent: 0
        type(motion_batch) :: motion
        type(inverse_solver) :: solver
        type(assembly_trail) :: trail

        call prepare_inverse(model, options, results%wants(result_reaction), solver, status)
        if (.not. status%is_ok()) return
        motion = motion_of(q, qd, qdd, load)
        if (present(t)) motion%t => t
        if (options%in_order) then
            call run_prepared(model, solver, options%threads, motion, results, trail=trail)
        else
            call run_prepared(model, solver, options%threads, motion, results)
        end if
        call solver%free()
    end subroutine run_inverse

    !> Run one batch with equations planned before. Several threads may call this with one solver.
    !>
    !> With equations of forward dynamics the accelerations of the free coordinates are found instead: give zero for
    !> them, and the driving forces that are known. With a trail the samples follow each other, and those of the last
    !> batch with the same trail: the assembly is then followed by continuity. A caller who knows the assembly of each
    !> sample gives it instead. Without either each sample is on the branch of the start.
    !>
    !> Where coordinates of the model stand in for those of another one, accelerations and transmission angles found are
    !> told of that one's coordinates and dyads.
    !>
    !> When the process is told to stop the batch is left unfinished: ask `is_interrupted`.
    recursive subroutine run_prepared(model, solver, threads, motion, results, trail, known, own, turns)
        type(model_type), intent(in) :: model
        type(inverse_solver), intent(in), target :: solver
        integer, intent(in) :: threads                          !! at most; a short batch takes fewer
        type(motion_batch), intent(in) :: motion
        type(inverse_results), intent(inout) :: results
        type(assembly_trail), intent(inout), optional :: trail
        type(sample_assembly), intent(in), optional, target :: known
        type(model_type), intent(in), optional, target :: own   !! that other model; absent: no coordinate stands in
        type(turn_count), intent(inout), optional :: turns      !! of the samples before; absent: joint angles are within half a
                                                                !! turn
        type(programs_at_hand) :: programs
        type(inverse_results) :: part
        real(wp), allocatable, target :: own_rate(:, :)         ! of joints, if turns need them and nobody else
        integer :: n, first, last, length

        n = size(motion%q, 2)
        if (needs_rates()) then                                 ! before a record is chosen, which has to tell them
            allocate (own_rate(model%n_variable, n))
            call results%put(result_joint_rate, own_rate)
        end if
        call look_for_programs(max(n, solver%n_expected))
        length = n
        if (.not. present(known)) length = samples_of_a_round(model, n)
        if (length == n) then
            call run_round(model, solver, threads, motion, programs, results, trail, known, own, turns)
        else
            call run_rounds()
        end if
        if (allocated(own_rate)) nullify (results%of(result_joint_rate)%x)

    contains

        !> Turns are counted by the rates of joints.
        logical function needs_rates()
            needs_rates = .false.
            if (.not. present(turns) .or. present(own)) return
            needs_rates = results%wants(result_joint_variable) .and. .not. results%wants(result_joint_rate)
        end function needs_rates

        subroutine run_rounds()
            results%roads = road_counts()
            results%lost_sample = 0
            do first = 1, n, length
                last = min(n, first + length - 1)
                part = part_of_results(results, first, last)
                if (associated(results%load)) part%load => results%load(:, :, first:last)
                call run_round(model, solver, threads, motion%part(first, last), programs, part, trail, own=own, turns=turns)
                results%roads = results%roads + part%roads
                if (results%lost_sample > 0 .or. part%lost_sample == 0) cycle
                results%lost_sample = first - 1 + part%lost_sample
                results%lost_in_words = part%lost_in_words
            end do
        end subroutine run_rounds

        !> The records and programs that serve, made when they are wanted first.
        subroutine look_for_programs(n_all)
            integer, intent(in) :: n_all                        !! samples of this batch and those to come
            logical :: all_turned
            integer :: i

            all_turned = .false.
            if (associated(motion%quaternion)) all_turned = all([(motion%is_turned(i), i=1, n)])
            if (associated(solver%places%closing) .and. n_all >= worth_closing .and. .not. present(known)) &
                call need_closer(model, solver, motion%q, programs%closer)
            if (associated(solver%records) .and. .not. &
                (stands_in(model, own) .or. present(known) .or. all_turned .or. associated(motion%given_force))) then
                call need_record(model, solver, results, motion%q, programs%forces)
                if (present(trail) .and. n > 0) call need_margins(model, solver, motion%q, programs%margins%record)
                programs%margins%threads = threads
            end if
        end subroutine look_for_programs
    end subroutine run_prepared

    !> Do coordinates of the model stand in for those of another one?
    pure logical function stands_in(model, own)
        type(model_type), intent(in) :: model
        type(model_type), intent(in), optional :: own          !! that one

        stands_in = .false.
        if (present(own)) stands_in = any(model%scene%coordinate%for_joint > 0)
    end function stands_in

    !> Where links are closed by iteration their places are found first, then the forces: what stands between has to stay in the
    !> cache.
    pure integer function samples_of_a_round(model, n) result(length)
        type(model_type), intent(in) :: model
        integer, intent(in) :: n                                !! samples of the batch
        integer, parameter :: room = 65536                      !! numbers, half of a core's own cache on most processors

        length = n
        if (size(model%group) == 0) return
        associate (stride => longest_stride(model))
            length = min(n, stride*max(1, room/(stride*place_size(model)*model%n_link)))
        end associate
    end function samples_of_a_round

    !> Samples that follow each other, or of which each is on its own, with the programs at hand.
    recursive subroutine run_round(model, solver, threads, motion, programs, results, trail, known, own, turns)
        type(model_type), intent(in) :: model
        type(inverse_solver), intent(in), target :: solver
        integer, intent(in) :: threads
        type(motion_batch), intent(in) :: motion
        type(programs_at_hand), intent(in), target :: programs
        type(inverse_results), intent(inout) :: results
        type(assembly_trail), intent(inout), optional :: trail
        type(sample_assembly), intent(in), optional, target :: known
        type(model_type), intent(in), optional, target :: own
        type(turn_count), intent(inout), optional :: turns
        type(lane_batch) :: batch
        type(sample_assembly), target :: assembly
        class(margin_source), pointer :: margins
        logical, allocatable :: turned(:)                       ! attitudes of a sample go by quaternions; absent: nobody asks
        integer :: n, i
        logical :: has_stand_ins, is_on_way, counts_turns, some_turned, all_turned

        n = size(motion%q, 2)
        has_stand_ins = stands_in(model, own)
        is_on_way = present(known) .or. (present(trail) .and. n > 0)
        counts_turns = .false.
        if (present(turns)) counts_turns = results%wants(result_joint_variable)
        some_turned = .false.
        if (associated(motion%quaternion)) some_turned = any(motion%quaternion /= 0)
        if (some_turned .or. counts_turns) turned = [(motion%is_turned(i), i=1, n)]
        all_turned = .false.
        if (some_turned) all_turned = all(turned)
        nullify (margins)
        if (associated(programs%margins%record)) margins => programs%margins
        call place_links()
        if (associated(results%load)) call tell_loads()
        call plan_lanes()
        if (associated(programs%forces)) &
            call run_by_record(model, programs%forces, threads, motion, batch%stand, results, batch%n, batch%sample)
        call run_lanes()
        call tell_outcome(model, motion, batch, present(trail), is_on_way, results)
        if (counts_turns) then
            call count_turns()
        else if (results%wants(result_joint_variable)) then
            call take_turns_off(model, results%of(result_joint_variable)%x)
        end if

    contains

        !> Where the links of groups are, or on which assembly samples are.
        subroutine place_links()
            batch%stand => assembly
            if (.not. (has_assemblies(model) .or. has_stand_ins)) return
            if (present(known)) then
                batch%stand => known
            else if (is_on_way) then
                call follow_assembly(model, motion%q, trail, assembly, margins, programs%closer)
            else if (needs_places()) then
                call settle_samples(model, threads, motion%q, assembly, programs%closer, solver%places%nodes)
                is_on_way = .true.
            else if (allocated(solver%at_start%status)) then
                batch%stand => solver%at_start
            else
                call make_room(model, 1, assembly)
            end if
        end subroutine place_links

        !> Do links of groups have to be placed before the record runs?
        logical function needs_places()
            needs_places = .false.
            if (associated(programs%forces)) needs_places = programs%forces%needs_places
        end function needs_places

        !> The loads, with those that follow the state.
        subroutine tell_loads()
            real(wp) :: pull(size(model%scene%spring), n)

            if (associated(motion%t)) then
                call evaluate_load_laws(model, threads, motion%q, motion%qd, motion%t, motion%load, batch%stand, results%load, pull)
            else
                call evaluate_load_laws(model, threads, motion%q, motion%qd, [0.0_wp], motion%load, batch%stand, results%load, &
                                        pull)
            end if
        end subroutine tell_loads

        !> Lanes do all samples, unless a record does some.
        subroutine plan_lanes()
            batch%motion = motion
            batch%threads = threads
            batch%has_own_stand = is_on_way
            if (has_stand_ins) batch%own => own
            batch%shares = model%share%n > 0 .and. (model%share%may_gape .or. results%wants(result_reaction))
            batch%n = n
            if (size(model%contact) > 0) allocate (batch%holding(n), source=0)
        end subroutine plan_lanes

        !> What no record has done. Blocks of lanes have samples of one kind: whose attitudes go by angles, or by quaternions.
        subroutine run_lanes()
            if (some_turned .and. .not. all_turned) then
                if (.not. allocated(batch%sample)) batch%sample = [(i, i=1, batch%n)]
                batch%sample = pack(batch%sample, .not. turned(batch%sample))
                batch%n = size(batch%sample)
                call run_on_lanes(model, solver, batch, results)
                batch%sample = pack([(i, i=1, n)], turned)
                batch%n = size(batch%sample)
            end if
            call run_on_lanes(model, solver, batch, results)
        end subroutine run_lanes

        !> Joint angles of samples that follow each other count turns.
        subroutine count_turns()
            if (present(own)) then
                call count_turns_about(own, results%of(result_joint_variable)%x, turns)
            else
                call count_turns_on_way(model, solver%places%closing, motion%q, motion%qd, results%of(result_joint_rate)%x, &
                                        turned, batch%stand, results%of(result_joint_variable)%x, turns)
            end if
        end subroutine count_turns
    end subroutine run_round

    ! ---------------------------------------------------------------- what is told of a batch

    !> The roads that samples took, and why the first one failed that did.
    subroutine tell_outcome(model, motion, batch, is_followed, is_on_way, results)
        type(model_type), intent(in) :: model
        type(motion_batch), intent(in) :: motion
        type(lane_batch), intent(in) :: batch                   !! done
        logical, intent(in) :: is_followed                      !! along a trail
        logical, intent(in) :: is_on_way                        !! the assembly of each sample is known
        type(inverse_results), intent(inout) :: results
        integer :: n

        n = size(motion%q, 2)
        results%roads = road_counts(merge(n, 0, size(model%group) == 0), merge(0, n, size(model%group) == 0), batch%n_dense)
        if (associated(results%assembly)) then
            results%assembly = reached_straight
            if (is_on_way .and. allocated(batch%stand%reached)) results%assembly = batch%stand%reached(:n)
        end if
        results%lost_sample = batch%stand%lost%sample
        if (results%lost_sample > 0) then
            call hold_texts()
            results%lost_in_words = lost_in_words(model, batch%stand%lost)
            call release_texts()
        end if
        if (is_followed .and. results%lost_sample == 0 .and. associated(results%status)) &
            call tell_undefined(model, motion, batch%stand, results)
        if (results%lost_sample == 0 .and. allocated(batch%holding)) call tell_locked(model, batch%holding, results)
    end subroutine tell_outcome

    !> Why the first sample that has no forces has none: a law left its table, a spring lost its direction.
    subroutine tell_undefined(model, motion, assembly, results)
        type(model_type), intent(in) :: model
        type(motion_batch), intent(in) :: motion
        type(sample_assembly), intent(in) :: assembly           !! of the samples
        type(inverse_results), intent(inout) :: results
        type(kinematic_state) :: state
        integer :: sample

        sample = findloc(results%status(:size(motion%q, 2)), sample_undefined, dim=1)
        if (sample == 0 .or. size(model%scene%laws%law) + size(model%scene%spring) + size(model%scene%payload) == 0) return
        call prepare_kinematics(model, 0, state)
        state%q = spread(motion%q(:, sample), 1, lanes)
        state%qd = spread(motion%qd(:, sample), 1, lanes)
        state%qdd = spread(motion%qdd(:, sample), 1, lanes)
        if (associated(motion%t)) state%time = motion%t(min(sample, size(motion%t)))
        if (has_assemblies(model)) call place_sample(model, assembly, sample, 1, state)
        call evaluate_kinematics(model, state)
        call hold_texts()
        results%lost_in_words = failure_at(model, state, sample_undefined, 1)
        call release_texts()
        results%lost_sample = sample
    end subroutine tell_undefined

    !> Which joint holds the first sample fast that one does.
    subroutine tell_locked(model, holding, results)
        type(model_type), intent(in) :: model
        integer, intent(in) :: holding(:)                       !! contact that holds a sample fast; 0: none does
        type(inverse_results), intent(inout) :: results
        integer :: sample

        sample = findloc(holding > 0, .true., dim=1)
        if (sample == 0) return
        call hold_texts()
        results%lost_in_words = lock_in_words(model, holding(sample))
        call release_texts()
        results%lost_sample = sample
    end subroutine tell_locked
end module linkdyn_inverse
