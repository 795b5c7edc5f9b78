!> Inverse dynamics of a batch: motion given; driving forces, joint reactions and joint motion out.
!>
!> Samples are independent. They are taken in blocks of `lanes`, blocks are shared out to threads, and a block's
!> arithmetic does not depend on which thread runs it, so the results do not either. A sample that fails is NaN.
!> Scratch stays with the solver from one batch to the next, so that a batch of one sample costs little.
module linkdyn_inverse
    use linkdyn_agreement, only: agreement, are_alike
    use linkdyn_assembly_trail, only: assembly_trail, sample_assembly, follow_assembly, make_room, place_sample, &
        reached_straight, judges_like_lanes
    use linkdyn_base_motion, only: base_size, evaluate_base
    use linkdyn_catalogue, only: result_driving_force, result_reaction, result_contact_force, result_power_imbalance, &
        result_friction, result_friction_power, result_position, result_joint_push
    use linkdyn_closing_programs, only: closing_programs
    use linkdyn_condition, only: condition_type, condition_space, make_condition, free_condition, prepare_condition, &
        eliminate_block, &
        find_rcond
    use linkdyn_constants, only: golden, least_accuracy
    use linkdyn_dense, only: hold_blas_threads, release_blas_threads
    use linkdyn_belt_measures, only: measure_strands
    use linkdyn_cam_measures, only: measure_pressure_angles
    use linkdyn_closed_forms, only: transmission_angles
    use linkdyn_equation_kernels, only: kernel_family
    use linkdyn_equations, only: equations_type, equation_workspace, build_equations, build_no_equations, build_given_equations, &
        share_equations, free_equations, prepare_workspace, want_of, solve_block, found_of, &
        solver_gauss_jordan, solver_lapack, solver_elimination, solver_reduced, solver_gauss_jordan_plain, solver_name, &
        choose_solver
    use linkdyn_error_probe, only: error_probe, probe_space, make_probe, free_probe, prepare_probe_space, estimate_errors
    use linkdyn_failure, only: lost_in_words, failure_at, lock_in_words
    use linkdyn_group_motion, only: group_closer
    use linkdyn_inputs, only: in_q, in_qd, in_qdd, in_load, in_branch, in_place, in_pull, in_base, &
        in_payload
    use linkdyn_interrupt, only: is_interrupted
    use linkdyn_inverse_results, only: inverse_results, part_of_results, list_results, clear_measures, make_undefined
    use linkdyn_joint_rates, only: measure_joints, measure_variable, actuator_rates, joint_rate
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state, prepare_kinematics, link_position, link_rotation
    use linkdyn_led_mechanism, only: evaluate_kinematics
    use linkdyn_lane_count, only: lanes
    use linkdyn_load_laws, only: evaluate_load_laws
    use linkdyn_lock, only: hold_lock, release_lock, hold_texts, release_texts, hold_records, release_records
    use linkdyn_model, only: model_type, step_pose, is_dyad, has_assemblies, gives_attitude, attitude_angles, &
        drives_share, scene_size
    use linkdyn_motion_measures, only: measure_energy, measure_closure
    use linkdyn_planar_motion, only: level_given
    use linkdyn_payload_measures, only: find_payloads, add_payload_energy
    use linkdyn_payloads, only: evaluate_payloads
    use linkdyn_pose, only: rpy_rotation, rotate_rpy, rates_of_rpy, angular_acceleration_rpy
    use linkdyn_recorded_forces, only: recorded_forces, record_shelf, record_forces, run_recorded
    use linkdyn_margin_source, only: margin_source
    use linkdyn_recorded_margins, only: recorded_margins, of_margins
    use linkdyn_representatives, only: representative_poses, need_poses, make_closer, few_links
    use linkdyn_roads, only: road_counts
    use linkdyn_second_look, only: second_look, need_look, free_look, surely_certain
    use linkdyn_samples, only: sample_arrays, result_list, set_block
    use linkdyn_singularity, only: singularity_space, prepare_singularity, find_singularity_distance
    use linkdyn_settled_samples, only: settle_samples, known_nodes
    use linkdyn_shared_reactions, only: share_reactions
    use linkdyn_status, only: status_type, fail, status_bad_input, sample_ok, sample_singular, sample_undefined, sample_locked
    use linkdyn_text, only: quoted
    use linkdyn_threads, only: team_size
    use linkdyn_turns, only: turn_count
    use linkdyn_uncertainty, only: is_surely_certain
    use linkdyn_vec3, only: vec3, operator(-)
    implicit none (type, external)
    private
    public :: shared_places, inverse_options, inverse_results, inverse_solver
    public :: prepare_inverse, run_inverse, run_prepared, part_of_results
    public :: solver_gauss_jordan, solver_lapack, solver_elimination, solver_reduced, solver_gauss_jordan_plain
    public :: solver_name, choose_solver, look_for_record, samples_to_come, place_by_record

    !> A program of Newton's steps takes some tens of milliseconds to make, as these samples take without. Who keeps a solver for the
    !> calls to come expects as many, at least: loops closed by iteration then take their steps from the first call on.
    integer, parameter :: worth_closing = 256, samples_to_come = worth_closing
    integer, parameter :: largest_share = 8    !! blocks that a thread takes at a time: their work outweighs the taking

    !> How links are led to their places: whatever is asked of the equations, all solvers of a model do it alike.
    type :: shared_places
        type(closing_programs), pointer :: closing => null()    !! there if the scene has groups closed by iteration
        type(known_nodes), pointer :: nodes => null()           !! beside these: from where they close samples on their own
        type(representative_poses), pointer :: poses => null()
    contains
        procedure :: prepare => prepare_places
        procedure :: free => free_places
    end type shared_places

    type :: inverse_options
        integer :: solver = solver_elimination
        integer :: threads = 1
        logical :: in_order = .false.        !! samples follow each other along a motion
        logical :: wants_forces = .true.     !! false: kinematics alone, without equations; what is wanted then is no force
        integer :: n_expected = 0            !! samples of all batches together, if that is known: it decides what is worth making
        logical :: wants_errors = .false.    !! error estimates of the forces
        logical :: wants_rcond = .false.     !! condition number of the equations; solver lapack always has it
        logical :: wants_distance = .false.  !! distance to the next singular position
        logical :: by_record = .true.        !! elimination by a record of the scene, where it has one; false: by lanes alone
        type(kernel_family), pointer :: family => null()    !! of models that share kernels; null: there is none
        type(shared_places), pointer :: places => null()    !! shared by this model's solvers, which it outlives; null: none are
    end type inverse_options

    !> Scratch of one thread.
    type :: thread_space
        type(equation_workspace) :: workspace
        real(wp), allocatable :: reaction(:, :, :)              !! (lane, 6, n_joint)
        real(wp), allocatable :: friction(:, :, :)              !! (lane, n_component, n_joint)
        real(wp), allocatable :: friction_power(:, :)           !! (lane, n_joint)
        real(wp), allocatable :: variable(:, :), rate(:, :)     !! (lane, n_variable)
        type(probe_space) :: probe                              !! if errors are wanted
        type(probe_space) :: doubt                              !! if samples have been looked at again
        type(condition_space) :: condition                      !! if the condition number or the distance is
        type(singularity_space) :: singularity                  !! if the distance is
        type(thread_space), pointer :: next => null()           !! idle as well
    end type thread_space

    !> Where links are at samples that no record has done.
    type :: left_places
        real(wp), allocatable :: position(:, :, :)              !! (3, n_link, sample)
        real(wp), allocatable :: rotation(:, :, :, :)           !! (3, 3, n_link, sample)
        integer, allocatable :: status(:)                       !! `sample_*` (sample)
        real(wp), allocatable :: push(:, :, :)                  !! what acts at joints beside reactions; there if links give way
                                                                !! (n_component, n_joint, sample)
    end type left_places

    !> Scratch that no thread is using: a list, changed by one thread at a time.
    type :: space_pool
        type(thread_space), pointer :: first => null()
    end type space_pool

    !> Equations planned once for many batches of the same kind, also at the same time. Freed by `free`.
    type :: inverse_solver
        type(equations_type) :: equations
        type(error_probe), allocatable :: probe                 !! there if errors are wanted
        type(second_look), pointer :: look => null()            !! there if samples may want one
        type(condition_type), pointer :: condition => null()    !! there if the condition number or the distance is
        logical :: wants_distance = .false.
        integer :: n_expected = 0                               !! samples of all batches together; 0: not known
        type(record_shelf), pointer :: records => null()        !! there if the scene may be recorded
        type(shared_places) :: places                           !! there if it may, or if records close its groups
        logical, private :: owns_places = .false.
        type(sample_assembly) :: at_start                       !! of samples outside a motion; not there: made anew
        type(space_pool), pointer, private :: pool => null()    !! not there: scratch is made for every batch
    contains
        procedure :: free => free_solver
    end type inverse_solver

    ! How is said in `linkdyn_inverse_turns`.
    interface
        !> Joint angles of samples get the turns that they have where somebody says that they are about.
        module subroutine count_turns_about(model, variable, turns)
            type(model_type), intent(in) :: model
            real(wp), intent(inout) :: variable(:, :)      !! (n_variable, n); samples that failed are NaN
            type(turn_count), intent(inout) :: turns
        end subroutine count_turns_about

        !> Joint angles of samples that follow each other get the turns that they make on the straight way from one to the next.
        module subroutine count_turns_on_way(model, closing, q, qd, rate, assembly, variable, turns)
            type(model_type), intent(in) :: model
            type(closing_programs), pointer, intent(in) :: closing    !! of the groups' steps; null: there are none
            real(wp), intent(in) :: q(:, :), qd(:, :)      !! (n_q, n)
            real(wp), intent(in) :: rate(:, :)             !! of the joint variables (n_variable, n)
            type(sample_assembly), intent(in) :: assembly  !! of the samples; empty: there is but one
            real(wp), intent(inout) :: variable(:, :)      !! (n_variable, n); samples that failed are NaN
            type(turn_count), intent(inout) :: turns       !! of the samples before, then of the last of these
        end subroutine count_turns_on_way
    end interface

contains

    !> Plan the equations for the results wanted.
    subroutine prepare_inverse(model, options, wants_reactions, solver, status)
        type(model_type), intent(in) :: model
        type(inverse_options), intent(in) :: options
        logical, intent(in) :: wants_reactions
        type(inverse_solver), intent(out) :: solver
        type(status_type), intent(inout) :: status

        solver%n_expected = options%n_expected
        if (options%wants_forces) then
            call build_equations(model, options%solver, wants_reactions, solver%equations, status)
            if (status%is_ok()) call share_equations(model, options%family, solver%equations)
        else
            call build_no_equations(model, solver%equations)
        end if
        if (status%is_ok() .and. options%wants_errors .and. wants_reactions .and. model%share%n > 0) call fail(status, &
            status_bad_input, "joint "//quoted(model%joint(model%share%joint(1))%name)//": the equations leave its reaction " &
            //"open, which has no error estimate then (expected driving forces alone)")
        if (status%is_ok() .and. options%wants_errors) then
            allocate (solver%probe)
            call make_probe(model, options%solver, wants_reactions, solver%probe, status)
        end if
        ! reactions that the equations leave open have no estimates
        if (options%wants_forces .and. size(model%group) > 0 .and. .not. (wants_reactions .and. model%share%n > 0)) &
            allocate (solver%look)
        solver%wants_distance = options%wants_distance
        if (options%wants_distance) solver%equations%needs_columns = .true.
        if (status%is_ok() .and. (options%wants_distance .or. (options%wants_rcond .and. options%solver /= solver_lapack))) then
            if (drives_share(model)) then
                call fail(status, status_bad_input, "actuator "//quoted(model%scene%actuator(model%n_actuator)%name) &
                          //": there are more actuators than coordinates, which leaves no square matrix, no condition number and " &
                          //"no distance to a singular position")
                return
            end if
            allocate (solver%condition)
            call make_condition(model, solver%equations%unknown, solver%condition)
        end if
        if (.not. status%is_ok()) return
        if (has_assemblies(model)) call make_room(model, 1, solver%at_start)
        allocate (solver%pool)
        if (options%by_record .and. any(options%solver == [solver_elimination, solver_reduced]) .and. .not. (options%wants_errors &
            .or. options%wants_rcond .or. options%wants_distance)) then
            allocate (solver%records)
        end if
        if (.not. options%by_record) return
        solver%owns_places = .not. associated(options%places)
        if (solver%owns_places) then
            call solver%places%prepare(model)
        else
            solver%places = options%places
        end if
    end subroutine prepare_inverse

    !> Room for what is made when it is wanted first.
    subroutine prepare_places(self, model)
        class(shared_places), intent(inout) :: self
        type(model_type), intent(in) :: model

        if (size(model%group) > 0) allocate (self%closing, self%nodes)
        allocate (self%poses)
    end subroutine prepare_places

    !> Nobody may be using them.
    subroutine free_places(self)
        class(shared_places), intent(inout) :: self

        if (associated(self%closing)) then
            call self%closing%free()
            deallocate (self%closing)
        end if
        if (associated(self%nodes)) deallocate (self%nodes)
        if (associated(self%poses)) deallocate (self%poses)
    end subroutine free_places

    !> Give the scratch back. No batch may be running.
    subroutine free_solver(self)
        class(inverse_solver), intent(inout) :: self
        type(thread_space), pointer :: space

        call free_equations(self%equations)
        if (allocated(self%probe)) call free_probe(self%probe)
        if (associated(self%look)) then
            call free_look(self%look)
            deallocate (self%look)
        end if
        if (associated(self%condition)) then
            call free_condition(self%condition)
            deallocate (self%condition)
        end if
        if (associated(self%records)) then
            call self%records%free()
            deallocate (self%records)
        end if
        if (self%owns_places) call self%places%free()
        if (.not. associated(self%pool)) return
        do while (associated(self%pool%first))
            space => self%pool%first
            self%pool%first => space%next
            call free_space(space)
        end do
        deallocate (self%pool)
    end subroutine free_solver

    !> Plan and run one batch.
    !>
    !> **Errors**: `status_bad_input` if the number of actuators does not fit or the solver cannot give what is wanted.
    subroutine run_inverse(model, options, q, qd, qdd, load, results, status, t)
        type(model_type), intent(in) :: model
        type(inverse_options), intent(in) :: options
        real(wp), intent(in) :: q(:, :), qd(:, :), qdd(:, :)    !! (n_q, n)
        real(wp), intent(in) :: load(:, :, :)                   !! (6, n_load, n)
        type(inverse_results), intent(inout) :: results
        type(status_type), intent(out) :: status
        real(wp), intent(in), optional :: t(:)                  !! instants, for laws that ask for them [s] (n); absent: 0
        type(inverse_solver) :: solver
        type(assembly_trail) :: trail

        call prepare_inverse(model, options, associated(results%reaction), solver, status)
        if (.not. status%is_ok()) return
        if (options%in_order) then
            call run_prepared(model, solver, options%threads, q, qd, qdd, load, results, trail=trail, t=t)
        else
            call run_prepared(model, solver, options%threads, q, qd, qdd, load, results, t=t)
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
    recursive subroutine run_prepared(model, solver, threads, q, qd, qdd, load, results, given_force, trail, known, own, turns, &
                                      quaternion, t, stop_force, clutch_force, contact_sense)
        type(model_type), intent(in) :: model
        type(inverse_solver), intent(in) :: solver
        integer, intent(in) :: threads                          !! at most; a short batch takes fewer
        real(wp), intent(in), contiguous :: q(:, :), qd(:, :), qdd(:, :)    !! (n_q, n)
        real(wp), intent(in), contiguous :: load(:, :, :)       !! (6, n_load, n), or one for all
        type(inverse_results), intent(inout) :: results
        real(wp), intent(in), optional :: given_force(:, :)     !! (n_actuator, n), read where not unknown
        type(assembly_trail), intent(inout), optional :: trail
        type(sample_assembly), intent(in), optional :: known
        type(model_type), intent(in), optional :: own           !! that other model; absent: no coordinate stands in
        type(turn_count), intent(inout), optional :: turns      !! of the samples before; absent: joint angles are within half a turn
        real(wp), intent(in), optional :: quaternion(:, :, :)   !! (4, n_attitude, n), 0 where an attitude is given by its angles;
                                                                !! the others' rates are angular velocities
        real(wp), intent(in), optional :: t(:)                  !! instants, for laws over the state that ask for them [s] (n), or one
                                                                !! for all; absent: 0
        real(wp), intent(in), optional :: stop_force(:, :)      !! of stops at which something rests (n_stop, n) [N, N m]; absent: none
        real(wp), intent(in), optional :: clutch_force(:, :)    !! of clutches (n_clutch, n) [N, N m]; absent: none
        real(wp), intent(in), optional :: contact_sense(:, :)   !! of joints that may stick, as of `friction_space` (n_contact, n); absent: 0
        type(sample_assembly) :: assembly
        type(recorded_forces), pointer :: recorded
        type(recorded_margins), target :: by_record
        class(margin_source), pointer :: margins
        class(group_closer), pointer :: closer
        integer, allocatable :: left(:)                         ! samples that no record has done; absent: all
        type(left_places) :: stand                              ! there, if these are to share reactions
        integer, allocatable :: wanted(:)                       ! of the forces: `result_*`
        integer, allocatable :: holding(:)                      ! contacts that hold samples fast; 0: none does
        integer :: n, n_all, n_left, n_dense
        real(wp), allocatable, target :: own_rate(:, :)         ! of joints, if turns need them and nobody else
        logical :: wants_rates, wants_driven, has_stand_ins, is_on_way, shares, counts_turns

        shares = model%share%n > 0 .and. (model%share%may_gape .or. associated(results%reaction))
        n = size(q, 2)
        n_all = max(n, solver%n_expected)
        counts_turns = present(turns) .and. associated(results%joint_variable)
        if (counts_turns .and. .not. (present(own) .or. associated(results%joint_rate))) then
            allocate (own_rate(model%n_variable, n))
            results%joint_rate => own_rate
        end if
        wants_rates = associated(results%joint_variable) .or. associated(results%joint_rate)
        wants_driven = associated(results%driving_position) .or. associated(results%driving_speed)
        has_stand_ins = present(own) .and. any(model%scene%coordinate%for_joint > 0)
        n_dense = 0
        is_on_way = present(known) .or. (present(trail) .and. n > 0)
        nullify (recorded, margins, closer)
        if (associated(solver%places%closing) .and. n_all >= worth_closing .and. .not. (present(known) .or. present(quaternion))) &
            call need_closer(model, solver, q, closer)
        if (associated(solver%records) .and. is_worth_recording(model, solver, n_all) .and. .not. &
            (has_stand_ins .or. present(known) .or. present(quaternion) .or. present(given_force))) then
            call need_record(model, solver, results, q, recorded)
            if (is_on_way) call need_margins(model, solver, q, by_record%record)
            by_record%threads = threads
            if (associated(by_record%record)) margins => by_record
        end if
        if (has_assemblies(model) .or. has_stand_ins) then
            if (present(known)) then
                assembly = known
            else if (is_on_way) then
                call follow_assembly(model, q, trail, assembly, margins, closer)
            else if (needs_places(recorded)) then
                call settle_samples(model, threads, q, assembly, closer, solver%places%nodes)
                is_on_way = .true.
            else if (.not. allocated(solver%at_start%status)) then
                call make_room(model, 1, assembly)
            end if
        end if
        if (associated(results%load)) call tell_loads()
        n_left = n
        if (size(model%contact) > 0) allocate (holding(n), source=0)
        if (associated(recorded)) then
            if (is_on_way .or. .not. allocated(solver%at_start%status)) then
                call run_by_record(model, recorded, threads, q, qd, qdd, load, assembly, results, n_left, left, t)
            else
                call run_by_record(model, recorded, threads, q, qd, qdd, load, solver%at_start, results, n_left, left, t)
            end if
        end if
        if (n_left > 0) then
            if (shares) allocate (stand%position(3, model%n_link, n_left), stand%rotation(3, 3, model%n_link, n_left), &
                                  stand%status(n_left))
            wanted = wanted_forces(results)
            if (shares .and. associated(results%reaction) .and. size(model%arm) > 0) then
                wanted = [wanted, result_joint_push]
                allocate (stand%push(model%n_component, model%n_joint, n_left))
            end if
            call run_on_lanes()
            if (shares .and. .not. is_interrupted()) call share()
        end if
        results%roads = road_counts(merge(n, 0, size(model%group) == 0), merge(0, n, size(model%group) == 0), n_dense)
        if (associated(results%assembly)) then
            results%assembly = reached_straight
            if (is_on_way .and. allocated(assembly%reached)) results%assembly = assembly%reached(:n)
        end if
        results%lost_sample = assembly%lost%sample
        if (results%lost_sample > 0) then
            call hold_texts()
            results%lost_in_words = lost_in_words(model, assembly%lost)
            call release_texts()
        end if
        if (present(trail) .and. results%lost_sample == 0 .and. associated(results%status)) call tell_undefined()
        if (results%lost_sample == 0 .and. allocated(holding)) call tell_locked()
        if (counts_turns) then
            if (present(own)) then
                call count_turns_about(own, results%joint_variable, turns)
            else
                call count_turns_on_way(model, solver%places%closing, q, qd, results%joint_rate, assembly, &
                                        results%joint_variable, turns)
            end if
            if (allocated(own_rate)) nullify (results%joint_rate)
        end if

    contains

        !> What the equations leave open, and whether the joints fit that were released, where no record has told: by where the
        !> lanes have found the links.
        subroutine share()
            integer, allocatable :: which(:)
            integer :: place

            which = [(sample_of(place), place=1, n_left)]
            if (associated(results%reaction)) then
                call share_reactions(model, threads, stand%position, stand%rotation, stand%status, which, results%reaction, &
                                     stand%push)
            else
                call share_reactions(model, threads, stand%position, stand%rotation, stand%status, which)
            end if
            do place = 1, n_left
                if (stand%status(place) == sample_ok) cycle
                if (associated(results%status)) results%status(which(place)) = stand%status(place)
                call make_undefined(results, which(place))
            end do
        end subroutine share

        !> Which joint holds the first sample fast that one does.
        subroutine tell_locked()
            integer :: sample

            sample = findloc(holding > 0, .true., dim=1)
            if (sample == 0) return
            call hold_texts()
            results%lost_in_words = lock_in_words(model, holding(sample))
            call release_texts()
            results%lost_sample = sample
        end subroutine tell_locked

        !> Why the first sample that has no forces has none: a law left its table, a spring lost its direction.
        subroutine tell_undefined()
            type(kinematic_state) :: state
            integer :: sample

            sample = findloc(results%status(:n), sample_undefined, dim=1)
            if (sample == 0 .or. size(model%scene%laws%law) + size(model%scene%spring) == 0) return
            call prepare_kinematics(model, 0, state)
            state%q = spread(q(:, sample), 1, lanes)
            state%qd = spread(qd(:, sample), 1, lanes)
            state%qdd = spread(qdd(:, sample), 1, lanes)
            if (present(t)) state%time = t(min(sample, size(t)))
            if (has_assemblies(model)) call place_sample(model, assembly, sample, 1, state)
            call evaluate_kinematics(model, state)
            call hold_texts()
            results%lost_in_words = failure_at(model, state, sample_undefined, 1)
            call release_texts()
            results%lost_sample = sample
        end subroutine tell_undefined

        !> The loads, with those that follow the state.
        subroutine tell_loads()
            real(wp) :: pull(size(model%scene%spring), n)
            real(wp), allocatable :: instant(:)

            instant = [0.0_wp]
            if (present(t)) instant = t
            if (allocated(solver%at_start%status) .and. .not. is_on_way) then
                call evaluate_load_laws(model, threads, q, qd, instant, load, solver%at_start, results%load, pull)
            else
                call evaluate_load_laws(model, threads, q, qd, instant, load, assembly, results%load, pull)
            end if
        end subroutine tell_loads

        !> Those that are left, in blocks shared out to threads.
        subroutine run_on_lanes()
            type(thread_space), pointer :: space
            integer :: n_block, n_thread, share, block

            n_block = (n_left + lanes - 1)/lanes
            n_thread = team_size(threads, n_block)
            share = max(1, min(largest_share, n_block/(2*n_thread)))
            call hold_blas_threads()
            !$omp parallel num_threads(n_thread) default(shared) private(space)
            call take_space(model, solver, space)
            !$omp do schedule(dynamic, share) reduction(+:n_dense)
            do block = 1, n_block
                if (is_interrupted()) cycle
                call run_block(block, space%workspace, space%reaction, space%friction, space%friction_power, space%variable, &
                               space%rate, space%probe, space%doubt, space%condition, space%singularity)
                n_dense = n_dense + count(space%workspace%fell_back(:min(lanes, n_left - (block - 1)*lanes)))
            end do
            !$omp end do
            call return_space(solver, space)
            !$omp end parallel
            call release_blas_threads()
        end subroutine run_on_lanes

        !> Do links of groups have to be placed before the record runs?
        logical function needs_places(recorded)
            type(recorded_forces), pointer, intent(in) :: recorded

            needs_places = .false.
            if (associated(recorded)) needs_places = recorded%needs_places
        end function needs_places

        !> Of those that are left.
        pure integer function sample_of(place)
            integer, intent(in) :: place

            sample_of = place
            if (allocated(left)) sample_of = left(place)
        end function sample_of

        !> One block from samples to samples.
        subroutine run_block(block, workspace, reaction, friction, friction_power, variable, rate, probe, doubt, condition, &
                             singularity)
            integer, intent(in) :: block
            type(equation_workspace), intent(inout) :: workspace
            real(wp), intent(inout) :: reaction(:, :, :), friction(:, :, :), friction_power(:, :), variable(:, :), rate(:, :)
            type(probe_space), intent(inout) :: probe, doubt
            type(condition_space), intent(inout) :: condition
            type(singularity_space), intent(inout) :: singularity
            real(wp), dimension(lanes) :: imbalance, kinetic, potential, gap, distance
            real(wp), dimension(lanes, model%n_actuator) :: driven, driven_rate
            real(wp), allocatable :: of_own(:, :)

            workspace%state%time = 0
            call gather(block, workspace)
            workspace%fell_back = .false.
            call want_of(workspace, wanted)
            call solve_block(model, solver%equations, workspace)
            if (any(workspace%is_doubtful)) call look_again(block, workspace, reaction, doubt)
            if (associated(results%reaction)) &
                reaction = reshape(found_of(workspace, result_reaction, size(reaction)/lanes), shape(reaction))
            if (associated(results%friction)) &
                friction = reshape(found_of(workspace, result_friction, size(friction)/lanes), shape(friction))
            if (associated(results%friction_power)) friction_power = found_of(workspace, result_friction_power, model%n_joint)
            if (allocated(solver%probe)) then
                call estimate_errors(solver%probe, workspace, reaction, associated(results%reaction), probe)
                workspace%error = probe%worst
            end if
            if (associated(solver%condition)) then
                call eliminate_block(solver%condition, workspace%state, workspace%numbers, condition)
                if (associated(results%rcond)) call find_rcond(solver%condition, workspace%state, condition, workspace%rcond)
                if (associated(results%singularity_distance)) call find_singularity_distance( &
                    model, solver%condition, workspace%state, condition, singularity, distance)
            end if
            if (wants_rates) call measure_joints(model, workspace%state, variable, rate)
            if (wants_driven) call measure_driven(model, workspace%state, driven, driven_rate)
            if (associated(results%kinetic_energy) .or. associated(results%potential_energy)) then
                call measure_energy(model, workspace%state, kinetic, potential)
                call find_payloads(model, workspace%state)
                call add_payload_energy(model, workspace%state, kinetic, potential)
            end if
            if (associated(results%closure)) call measure_closure(model, workspace%state, gap)
            if (has_stand_ins) then
                allocate (of_own(lanes, model%n_q))
                call tell_accelerations(model, workspace, of_own)
            end if
            if (associated(results%power_imbalance)) imbalance = reshape(found_of(workspace, result_power_imbalance, 1), [lanes])
            if (associated(results%acceleration)) call turn_to_rpy(model, solver%equations, workspace)
            if (has_stand_ins) workspace%acceleration = of_own
            call scatter(block, workspace, reaction, friction, friction_power, variable, rate, driven, driven_rate, probe, &
                         imbalance, kinetic, potential, gap, distance)
        end subroutine run_block

        !> Lanes that are doubtful are taken where their forces hardly scatter.
        subroutine look_again(block, workspace, reaction, doubt)
            integer, intent(in) :: block
            type(equation_workspace), intent(inout) :: workspace
            real(wp), intent(inout) :: reaction(:, :, :)
            type(probe_space), intent(inout) :: doubt
            integer :: flagged(lanes)
            logical :: is_doubtful(lanes)

            if (present(given_force) .or. .not. associated(solver%look)) return
            call need_look(model, solver%equations%solver, solver%equations%wants_reactions, solver%look)
            if (.not. solver%look%is_usable) return
            if (.not. allocated(doubt%workspace)) call prepare_probe_space(solver%look%probe, doubt)
            flagged = workspace%status
            is_doubtful = workspace%is_doubtful
            workspace%checks_accuracy = .false.
            call gather(block, workspace)
            workspace%fell_back = .false.
            call solve_block(model, solver%equations, workspace)
            workspace%checks_accuracy = .true.
            if (associated(results%reaction)) &
                reaction = reshape(found_of(workspace, result_reaction, size(reaction)/lanes), shape(reaction))
            call estimate_errors(solver%look%probe, workspace, reaction, associated(results%reaction), doubt)
            where (.not. (is_doubtful .and. doubt%worst <= surely_certain)) workspace%status = flagged
        end subroutine look_again

        !> Samples into lanes; lanes beyond the last sample repeat it.
        subroutine gather(block, workspace)
            integer, intent(in) :: block
            type(equation_workspace), intent(inout) :: workspace
            integer :: lane, sample

            workspace%state%by_quaternion = .false.
            if (present(quaternion)) workspace%state%by_quaternion = any(quaternion(:, :, (block - 1)*lanes + 1) /= 0, dim=1)
            do lane = 1, lanes
                sample = sample_of(min((block - 1)*lanes + lane, n_left))
                workspace%state%q(lane, :) = q(:, sample)
                workspace%state%qd(lane, :) = qd(:, sample)
                workspace%state%qdd(lane, :) = qdd(:, sample)
                if (present(t)) workspace%state%time(lane) = t(min(sample, size(t)))
                if (present(stop_force)) workspace%state%stop_force(lane, :) = stop_force(:, sample)
                if (present(clutch_force)) workspace%state%clutch_force(lane, :) = clutch_force(:, sample)
                if (present(contact_sense) .and. size(model%contact) > 0) &
                    workspace%friction%sense(lane, :size(model%contact)) = contact_sense(:, sample)
                if (model%n_load > 0) workspace%load(lane, :, :) = load(:, :, min(sample, size(load, 3)))
                if (present(quaternion)) workspace%state%quaternion(lane, :, :) = quaternion(:, :, sample)
                if (present(given_force)) workspace%driving_force(lane, :) = given_force(:, sample)
                if (.not. (has_assemblies(model) .or. has_stand_ins)) cycle
                if (is_on_way) then
                    call place_sample(model, assembly, sample, lane, workspace%state)
                else if (allocated(solver%at_start%status)) then
                    call place_sample(model, solver%at_start, 1, lane, workspace%state)
                else
                    call place_sample(model, assembly, 1, lane, workspace%state)
                end if
            end do
        end subroutine gather

        !> Lanes into samples; failed ones become NaN.
        subroutine scatter(block, workspace, reaction, friction, friction_power, variable, rate, driven, driven_rate, probe, &
                           imbalance, kinetic, potential, gap, distance)
            integer, intent(in) :: block
            type(equation_workspace), intent(in) :: workspace
            real(wp), intent(in) :: reaction(:, :, :), friction(:, :, :), friction_power(:, :)
            real(wp), intent(in) :: variable(:, :), rate(:, :), driven(:, :), driven_rate(:, :)
            type(probe_space), intent(in) :: probe
            real(wp), dimension(lanes), intent(in) :: imbalance, kinetic, potential, gap, distance
            real(wp) :: total(lanes)
            real(wp), allocatable :: transmission(:, :)
            real(wp), dimension(lanes, model%n_cam) :: press, pressure
            real(wp) :: strand(lanes, 2*size(model%belt))
            real(wp), allocatable :: push(:, :)
            integer :: lane, sample, i, outcome(lanes)
            logical :: failed

            if (associated(results%transmission_angle)) then
                allocate (transmission(lanes, size(results%transmission_angle, 1)))
                if (has_stand_ins) then
                    call transmission_angles(own, workspace%state, transmission)
                else
                    call transmission_angles(model, workspace%state, transmission)
                end if
            end if
            if (allocated(stand%push)) push = found_of(workspace, result_joint_push, model%n_component*model%n_joint)
            if (associated(results%contact_force)) press = found_of(workspace, result_contact_force, model%n_cam)
            if (associated(results%pressure_angle)) call measure_pressure_angles(model, workspace%state, pressure)
            do i = 1, merge(size(model%belt), 0, associated(results%strand_force))
                call measure_strands(model, i, workspace%state, strand(:, 2*i - 1:2*i))
            end do
            ! The last check: nothing that is not finite stands beside a good outcome.
            total = 0
            if (associated(results%contact_force)) call add_sizes(press, total)
            if (associated(results%pressure_angle)) call add_sizes(pressure, total)
            if (associated(results%strand_force)) call add_sizes(strand, total)
            if (associated(results%driving_force)) call add_sizes(workspace%driving_force, total)
            if (associated(results%acceleration)) call add_sizes(workspace%acceleration, total)
            if (associated(results%joint_variable)) call add_sizes(variable, total)
            if (associated(results%joint_rate)) call add_sizes(rate, total)
            if (associated(results%driving_position)) call add_sizes(driven, total)
            if (associated(results%driving_speed)) call add_sizes(driven_rate, total)
            if (associated(results%power_imbalance)) total = total + abs(imbalance)
            if (associated(results%kinetic_energy)) total = total + abs(kinetic)
            if (associated(results%potential_energy)) total = total + abs(potential)
            if (associated(results%closure)) total = total + abs(gap)
            if (allocated(transmission)) call add_sizes(transmission, total)
            if (associated(results%reaction)) then
                do i = 1, size(reaction, 3)
                    call add_sizes(reaction(:, :, i), total)
                end do
            end if
            outcome = workspace%status
            where (outcome == sample_ok .and. .not. total <= huge(1.0_wp)) outcome = sample_undefined
            do lane = 1, min(lanes, n_left - (block - 1)*lanes)
                sample = sample_of((block - 1)*lanes + lane)
                failed = outcome(lane) /= sample_ok
                if (associated(results%status)) results%status(sample) = outcome(lane)
                if (shares) call note_place(workspace%state, lane, (block - 1)*lanes + lane, outcome(lane))
                if (allocated(push)) stand%push(:, :, (block - 1)*lanes + lane) = &
                    reshape(push(lane, :), [model%n_component, model%n_joint])
                if (associated(results%driving_force)) then
                    results%driving_force(:, sample) = workspace%driving_force(lane, :)
                end if
                if (associated(results%transmission_force)) then
                    results%transmission_force(:, sample) = workspace%transmitted(lane, model%motor%actuator)
                end if
                if (associated(results%reaction)) then
                    results%reaction(:, :, sample) = reaction(lane, :, :)
                end if
                if (associated(results%friction)) then
                    results%friction(:, :, sample) = friction(lane, :, :)
                end if
                if (associated(results%friction_power)) then
                    results%friction_power(:, sample) = friction_power(lane, :)
                end if
                if (outcome(lane) == sample_locked) holding(sample) = workspace%state%holding(lane)
                if (associated(results%driving_force_error)) then
                    results%driving_force_error(:, sample) = probe%driving_force_error(lane, :)
                end if
                if (associated(results%reaction_error)) then
                    results%reaction_error(:, :, sample) = probe%reaction_error(lane, :, :)
                end if
                if (associated(results%joint_variable)) then
                    results%joint_variable(:, sample) = variable(lane, :)
                end if
                if (associated(results%joint_rate)) then
                    results%joint_rate(:, sample) = rate(lane, :)
                end if
                if (associated(results%driving_position)) then
                    results%driving_position(:, sample) = driven(lane, :)
                end if
                if (associated(results%driving_speed)) then
                    results%driving_speed(:, sample) = driven_rate(lane, :)
                end if
                if (associated(results%rcond)) results%rcond(sample) = workspace%rcond(lane)
                if (associated(results%singularity_distance)) results%singularity_distance(sample) = distance(lane)
                if (associated(results%error)) results%error(sample) = workspace%error(lane)
                if (associated(results%growth)) results%growth(sample) = workspace%growth(lane)
                if (associated(results%power_imbalance)) results%power_imbalance(sample) = imbalance(lane)
                if (associated(results%transmission_angle)) then
                    results%transmission_angle(:, sample) = transmission(lane, :)
                end if
                if (associated(results%contact_force)) results%contact_force(:, sample) = press(lane, :)
                if (associated(results%pressure_angle)) results%pressure_angle(:, sample) = pressure(lane, :)
                if (associated(results%strand_force)) results%strand_force(:, sample) = strand(lane, :)
                if (associated(results%acceleration)) then
                    results%acceleration(:, sample) = workspace%acceleration(lane, :)
                end if
                if (associated(results%kinetic_energy)) results%kinetic_energy(sample) = kinetic(lane)
                if (associated(results%potential_energy)) results%potential_energy(sample) = potential(lane)
                if (associated(results%closure)) results%closure(sample) = gap(lane)
                if (associated(results%position)) then
                    do i = 1, model%n_link
                        results%position(:, i, sample) = link_position(model, workspace%state, i, lane)
                    end do
                end if
                if (associated(results%rotation)) then
                    do i = 1, model%n_link
                        results%rotation(:, :, i, sample) = link_rotation(model, workspace%state, i, lane)
                    end do
                end if
                if (failed) call make_undefined(results, sample)
            end do
        end subroutine scatter

        !> For who shares reactions afterwards.
        subroutine note_place(state, lane, place, outcome)
            type(kinematic_state), intent(in) :: state
            integer, intent(in) :: lane
            integer, intent(in) :: place                !! of those that are left
            integer, intent(in) :: outcome              !! one of `sample_*`
            integer :: l

            stand%status(place) = outcome
            do l = 1, model%n_link
                stand%position(:, l, place) = link_position(model, state, l, lane)
                stand%rotation(:, :, l, place) = link_rotation(model, state, l, lane)
            end do
        end subroutine note_place
    end subroutine run_prepared

    !> Where links are, of a batch large enough for the scene's record, with a solver that was prepared for no forces. Samples `left` are
    !> for the lanes, on their assembly. With a trail the samples follow each other.
    subroutine place_by_record(model, solver, q, results, assembly, left, trail)
        type(model_type), intent(in) :: model
        type(inverse_solver), intent(in) :: solver
        real(wp), intent(in), contiguous :: q(:, :)             !! (n_q, n)
        type(inverse_results), intent(inout) :: results         !! positions, rotations, status
        type(sample_assembly), intent(out) :: assembly
        integer, allocatable, intent(out) :: left(:)
        type(assembly_trail), intent(inout), optional :: trail
        type(recorded_forces), pointer :: recorded
        type(recorded_margins), target :: by_record
        class(margin_source), pointer :: margins
        class(group_closer), pointer :: closer
        real(wp) :: load(6, model%n_load, 1)
        integer :: n, i, n_left

        n = size(q, 2)
        nullify (recorded, margins, closer)
        if (is_worth_placing(model, n)) then
            if (associated(solver%places%closing)) call need_closer(model, solver, q, closer)
            call need_record(model, solver, results, q, recorded)
            if (present(trail)) call need_margins(model, solver, q, by_record%record)
            if (associated(by_record%record)) margins => by_record
        end if
        if (has_assemblies(model)) then
            if (present(trail)) then
                call follow_assembly(model, q, trail, assembly, margins, closer)
            else if (associated(closer)) then
                call settle_samples(model, 1, q, assembly, closer, solver%places%nodes)
            else
                call make_room(model, n, assembly)
            end if
        end if
        if (associated(recorded)) then
            load = 0
            call run_by_record(model, recorded, 1, q, spread(spread(0.0_wp, 1, size(q, 1)), 2, n), &
                               spread(spread(0.0_wp, 1, size(q, 1)), 2, n), load, assembly, results, n_left, left)
            if (n_left == 0) allocate (left(0))
        else
            left = [(i, i=1, n)]
        end if
    end subroutine place_by_record

    !> Of the time that lanes take to place that many samples about as much goes into making the programs.
    pure logical function is_worth_placing(model, n)
        type(model_type), intent(in) :: model
        integer, intent(in) :: n                               !! samples
        integer, parameter :: worth_recording = 4096

        is_worth_placing = n >= merge(worth_closing, worth_recording, size(model%group) > 0)
    end function is_worth_placing

    !> What is asked of the forces beside driving forces and accelerations.
    pure function wanted_forces(results) result(wanted)
        type(inverse_results), intent(in) :: results
        integer, allocatable :: wanted(:)                      !! `result_*`

        wanted = pack([result_reaction, result_contact_force, result_power_imbalance, result_friction, result_friction_power], &
                      [associated(results%reaction), associated(results%contact_force), associated(results%power_imbalance), &
                       associated(results%friction), associated(results%friction_power)])
    end function wanted_forces

    ! ---------------------------------------------------------------- by a record of the scene

    !> A record takes some milliseconds to make, and as much for every further thirty links or so: of large mechanisms it is
    !> made for large batches only. Groups closed by iteration have to be led to its representative poses, each from the start.
    pure logical function is_worth_recording(model, solver, n)
        type(model_type), intent(in) :: model
        type(inverse_solver), intent(in) :: solver
        integer, intent(in) :: n                               !! samples
        integer, parameter :: samples_a_link = 50, worth_leading = 128
        integer, parameter :: worth_tracing = 2000             !! virtual work, whose equations the lanes write in a part of that time

        is_worth_recording = (model%n_link <= few_links .or. n >= samples_a_link*model%n_link) &
                             .and. (size(model%group) == 0 .or. n >= worth_leading) &
                             .and. (solver%equations%solver /= solver_reduced .or. n >= worth_tracing)
    end function is_worth_recording

    !> The record for the results wanted, made when they are wanted first; null if the scene has none.
    recursive subroutine need_record(model, solver, results, q, recorded)
        type(model_type), intent(in) :: model
        type(inverse_solver), intent(in) :: solver
        type(inverse_results), intent(in) :: results
        real(wp), intent(in) :: q(:, :)                        !! (n_q, n)
        type(recorded_forces), pointer, intent(out) :: recorded
        type(result_list) :: list

        call list_results(results, 0, list)
        nullify (recorded)
        if (list%n > 0) call find_or_make(model, solver, list%id(:list%n), q, recorded)
    end subroutine need_record

    !> The record of margins, by which a motion is followed; null if there is none.
    recursive subroutine need_margins(model, solver, q, recorded)
        type(model_type), intent(in) :: model
        type(inverse_solver), intent(in) :: solver
        real(wp), intent(in) :: q(:, :)                        !! (n_q, n)
        type(recorded_forces), pointer, intent(out) :: recorded
        integer, parameter :: many = 200                       !! samples: their lanes' time is about that of a trace

        nullify (recorded)
        if (model%n_branch > 0 .and. size(q, 2) >= many) &
            call find_or_make(model, solver, of_margins, q, recorded)
    end subroutine need_margins

    recursive subroutine find_or_make(model, solver, wanted, q, recorded)
        type(model_type), intent(in) :: model
        type(inverse_solver), intent(in) :: solver
        integer, intent(in) :: wanted(:)                       !! `result_*` of the catalogue
        real(wp), intent(in) :: q(:, :)                        !! (n_q, n)
        type(recorded_forces), pointer, intent(out) :: recorded

        call hold_records()
        recorded => solver%records%find(wanted)
        if (.not. associated(recorded)) call make_record(model, solver, wanted, q, recorded)
        call release_records()
        if (.not. recorded%is_usable) nullify (recorded)
    end subroutine find_or_make

    !> Is there a record for some results of a scene that finds what the lanes find?
    !>
    !> **Errors**: as of `prepare_inverse`.
    subroutine look_for_record(model, wanted, is_there, status)
        type(model_type), intent(in) :: model
        integer, intent(in) :: wanted(:)                       !! `result_*` of the catalogue
        logical, intent(out) :: is_there
        type(status_type), intent(inout) :: status
        type(inverse_solver) :: solver
        type(recorded_forces), pointer :: recorded

        is_there = .false.
        call prepare_inverse(model, inverse_options(solver=solver_elimination), any(wanted == result_reaction), solver, status)
        if (.not. status%is_ok()) return
        call find_or_make(model, solver, wanted, spread(model%start_q, 2, 1), recorded)
        is_there = associated(recorded)
        call solver%free()
    end subroutine look_for_record

    !> Programs of Newton's steps, made when they are wanted first; null if a group has none.
    subroutine need_closer(model, solver, q, closer)
        type(model_type), intent(in) :: model
        type(inverse_solver), intent(in) :: solver
        real(wp), intent(in) :: q(:, :)                        !! (n_q, n)
        class(group_closer), pointer, intent(out) :: closer

        nullify (closer)
        call hold_records()
        if (.not. solver%places%closing%is_tried) call make_closer(model, q, solver%places%poses, solver%places%closing)
        call release_records()
        if (solver%places%closing%is_usable) closer => solver%places%closing
    end subroutine need_closer

    recursive subroutine make_record(model, solver, wanted, q, recorded)
        type(model_type), intent(in) :: model
        type(inverse_solver), intent(in) :: solver
        integer, intent(in) :: wanted(:)                       !! `result_*` of the catalogue
        real(wp), intent(in) :: q(:, :)                        !! (n_q, n)
        type(recorded_forces), pointer, intent(out) :: recorded
        type(recorded_margins) :: margins

        recorded => solver%records%add()
        associate (poses => solver%places%poses)
            call need_poses(model, q, poses)
            call hold_texts()
            call record_forces(model, wanted, poses%q, poses%stand, recorded, poses%assembly%place, &
                               solver%equations%solver == solver_reduced)
            call release_texts()
            if (.not. recorded%is_usable) return
            if (any(wanted == of_margins(1))) then
                margins%record => recorded
                recorded%is_usable = judges_like_lanes(model, margins, poses%q)
            else
                recorded%is_usable = agrees_with_lanes(model, solver, recorded, poses%q, poses%assembly)
            end if
        end associate
    end subroutine make_record

    !> Does the record find what the lanes find? Asked once for each record, at representative poses in motion: a difference
    !> would be a defect, and the lanes are believed. Equations have both the same, so it is the motion that is looked at: by the balance of
    !> power, which no link is left out of. Where friction or states of self-stress come in forces are compared one by one, and places
    !> where nothing else is wanted.
    recursive logical function agrees_with_lanes(model, solver, recorded, pose, assembly) result(agrees)
        type(model_type), intent(in) :: model
        type(inverse_solver), intent(in) :: solver
        type(recorded_forces), intent(in) :: recorded
        real(wp), intent(in) :: pose(:, :)                     !! (n_q, pose)
        type(sample_assembly), intent(in) :: assembly          !! there
        type(inverse_solver) :: by_lanes
        type(inverse_results) :: found(2), balance
        real(wp), allocatable :: qd(:, :), qdd(:, :), load(:, :, :), t(:)
        integer, allocatable :: left(:)
        type(agreement) :: of_both
        integer :: i, k, n, n_left
        logical :: by_power, by_places

        n = size(pose, 2)
        qd = reshape([(modulo(k*golden, 1.0_wp) - 0.5_wp, k=1, size(pose))], shape(pose))
        qdd = reshape([(modulo(k*golden + 0.3_wp, 1.0_wp) - 0.5_wp, k=1, size(pose))], shape(pose))
        allocate (load(6, model%n_load, n))
        load = reshape([(modulo(k*golden + 0.7_wp, 1.0_wp) - 0.5_wp, k=1, size(load))], shape(load))
        associate (time => model%scene%time)
            t = [(time%first + modulo(k*golden, 1.0_wp)*(time%last - time%first), k=1, n)]
        end associate
        agrees = .true.
        by_places = any(recorded%wanted == result_position)
        if (.not. any(by_places .or. recorded%wanted == result_driving_force .or. recorded%wanted == result_reaction)) return
        do i = 1, 2
            allocate (found(i)%status(n))
            if (by_places) allocate (found(i)%position(3, model%n_link, n), found(i)%rotation(3, 3, model%n_link, n))
            if (any(recorded%wanted == result_driving_force)) allocate (found(i)%driving_force(model%n_actuator, n))
            if (any(recorded%wanted == result_reaction)) allocate (found(i)%reaction(model%n_component, model%n_joint, n))
        end do
        call run_by_record(model, recorded, 1, pose, qd, qdd, load, assembly, found(2), n_left, left, t)
        by_power = size(model%contact) == 0 .and. model%share%n == 0 .and. associated(found(2)%driving_force)
        if (by_power) then
            allocate (balance%status(n), balance%power_imbalance(n))
            call build_given_equations(model, by_lanes%equations)
            call run_prepared(model, by_lanes, 1, pose, qd, qdd, load, balance, found(2)%driving_force, known=assembly, t=t)
            call free_equations(by_lanes%equations)
            found(1)%status = balance%status
        else
            by_lanes%equations = solver%equations
            call run_prepared(model, by_lanes, 1, pose, qd, qdd, load, found(1), known=assembly, t=t)
        end if
        do i = 1, n
            if (found(1)%status(i) /= sample_ok) cycle
            if (n_left > 0) then
                if (any(left == i)) cycle
            end if
            if (by_power) then
                call of_both%note(abs(balance%power_imbalance(i)) <= least_accuracy)
            else if (by_places) then
                call of_both%note(are_alike(place_of(found(1), i), place_of(found(2), i)))
            else
                call of_both%note(has_same_forces(i))
            end if
        end do
        agrees = of_both%is_reached()
        do i = 1, 2
            deallocate (found(i)%status)
            if (associated(found(i)%driving_force)) deallocate (found(i)%driving_force)
            if (associated(found(i)%reaction)) deallocate (found(i)%reaction)
            if (by_places) deallocate (found(i)%position, found(i)%rotation)
        end do
        if (by_power) deallocate (balance%status, balance%power_imbalance)

    contains

        logical function has_same_forces(i)
            integer, intent(in) :: i                           !! sample

            has_same_forces = .true.
            if (associated(found(1)%driving_force)) &
                has_same_forces = are_alike(found(1)%driving_force(:, i), found(2)%driving_force(:, i))
            if (has_same_forces .and. associated(found(1)%reaction)) &
                has_same_forces = are_alike([found(1)%reaction(:, :, i)], [found(2)%reaction(:, :, i)])
        end function has_same_forces

        !> Of all links, lengths by the mechanism's size.
        function place_of(results, i) result(place)
            type(inverse_results), intent(in) :: results
            integer, intent(in) :: i                           !! sample
            real(wp), allocatable :: place(:)

            place = [results%position(:, :, i)/scene_size(model), results%rotation(:, :, :, i)]
        end function place_of
    end function agrees_with_lanes

    !> What the record can do of a batch; `left` are the samples that it leaves to the lanes.
    subroutine run_by_record(model, recorded, threads, q, qd, qdd, load, assembly, results, n_left, left, t)
        type(model_type), intent(in) :: model
        type(recorded_forces), intent(in) :: recorded
        integer, intent(in) :: threads
        real(wp), intent(in), contiguous, target :: q(:, :), qd(:, :), qdd(:, :)    !! (n_q, n)
        real(wp), intent(in), contiguous, target :: load(:, :, :)                   !! (6, n_load, n), or one for all
        type(sample_assembly), intent(in), target :: assembly
        type(inverse_results), intent(inout) :: results
        integer, intent(out) :: n_left
        integer, allocatable, intent(out) :: left(:)           !! absent if there are none
        real(wp), intent(in), optional :: t(:)                 !! [s] (n), or one for all; absent: 0
        real(wp), allocatable, target :: with_laws(:, :, :), pull(:, :), base(:, :), payload(:, :)
        type(sample_arrays) :: arrays
        type(result_list) :: list
        integer :: n

        n = size(q, 2)
        call set_block(arrays, in_q, size(q, 1), n, q)
        call set_block(arrays, in_qd, size(q, 1), n, qd)
        call set_block(arrays, in_qdd, size(q, 1), n, qdd)
        if (size(model%scene%laws%law) > 0) then
            allocate (with_laws(6, size(load, 2), n), pull(size(model%scene%spring), n))
            if (present(t)) then
                call evaluate_load_laws(model, threads, q, qd, t, load, assembly, with_laws, pull)
            else
                call evaluate_load_laws(model, threads, q, qd, [0.0_wp], load, assembly, with_laws, pull)
            end if
            call set_block(arrays, in_load, 6*size(load, 2), n, with_laws)
            call set_block(arrays, in_pull, size(pull, 1), n, pull)
        else
            call set_block(arrays, in_load, 6*size(load, 2), size(load, 3), load)
        end if
        if (model%scene%base%moves) then
            if (present(t)) then
                allocate (base(base_size(model), size(t)))
                call evaluate_base(model, t, base)
            else
                allocate (base(base_size(model), 1))
                call evaluate_base(model, [0.0_wp], base)
            end if
            call set_block(arrays, in_base, size(base, 1), size(base, 2), base)
        end if
        if (size(model%payload) > 0) then
            if (present(t)) then
                allocate (payload(size(model%payload), size(t)))
                call evaluate_payloads(model, t, payload)
            else
                allocate (payload(size(model%payload), 1))
                call evaluate_payloads(model, [0.0_wp], payload)
            end if
            call set_block(arrays, in_payload, size(payload, 1), size(payload, 2), payload)
        end if
        call list_results(results, n, list)
        call clear_measures(results)
        if (recorded%needs_branches) &
            call set_block(arrays, in_branch, size(assembly%branch, 1), size(assembly%branch, 2), assembly%branch)
        if (recorded%needs_places) then
            call set_block(arrays, in_place, size(assembly%place, 1)*model%n_link, n, assembly%place)
            call run_recorded(recorded, threads, n, arrays, status_for_record(model, assembly), list, n_left, left)
        else if (recorded%needs_branches) then
            call run_recorded(recorded, threads, n, arrays, assembly%status, list, n_left, left)
        else
            call run_recorded(recorded, threads, n, arrays, [sample_ok], list, n_left, left)
        end if
    end subroutine run_by_record

    !> Samples at which a group is too near to a singular position for its motion to be surely certain are for the lanes, which
    !> look closer.
    pure function status_for_record(model, assembly) result(status)
        type(model_type), intent(in) :: model
        type(sample_assembly), intent(in) :: assembly
        integer :: status(size(assembly%status))               !! one of `sample_*`
        integer :: g

        status = assembly%status
        do g = 1, size(model%group)
            where (status == sample_ok .and. .not. is_surely_certain(assembly%margin(g, :), size(model%group(g)%unit))) &
                status = sample_singular
        end do
    end function status_for_record

    !> Sizes of values, lane by lane: their sum is finite if they all are.
    pure subroutine add_sizes(value, total)
        real(wp), intent(in) :: value(:, :)            !! (lane, any)
        real(wp), intent(inout) :: total(lanes)
        integer :: k

        do k = 1, size(value, 2)
            total = total + abs(value(:, k))
        end do
    end subroutine add_sizes

    !> Idle scratch, or new.
    subroutine take_space(model, solver, space)
        type(model_type), intent(in) :: model
        type(inverse_solver), intent(in) :: solver
        type(thread_space), pointer, intent(out) :: space

        nullify (space)
        if (associated(solver%pool)) then
            call hold_lock()
            space => solver%pool%first
            if (associated(space)) solver%pool%first => space%next
            call release_lock()
        end if
        if (associated(space)) return
        allocate (space)
        call prepare_workspace(model, solver%equations, space%workspace)
        allocate (space%reaction(lanes, model%n_component, model%n_joint), space%variable(lanes, model%n_variable), &
                  space%rate(lanes, model%n_variable))
        allocate (space%friction(lanes, model%n_component, model%n_joint), space%friction_power(lanes, model%n_joint))
        if (allocated(solver%probe)) call prepare_probe_space(solver%probe, space%probe)
        if (associated(solver%condition)) call prepare_condition(solver%condition, space%condition)
        if (solver%wants_distance) then
            call prepare_singularity(model, solver%condition, space%singularity)
        end if
    end subroutine take_space

    subroutine return_space(solver, space)
        type(inverse_solver), intent(in) :: solver
        type(thread_space), pointer, intent(inout) :: space

        if (.not. associated(solver%pool)) then
            call free_space(space)
            return
        end if
        call hold_lock()
        space%next => solver%pool%first
        solver%pool%first => space
        call release_lock()
    end subroutine return_space

    subroutine free_space(space)
        type(thread_space), pointer, intent(inout) :: space

        call space%workspace%free()
        call space%probe%free()
        call space%doubt%free()
        call space%condition%free()
        call space%singularity%free()
        deallocate (space)
    end subroutine free_space

    !> The driven joint variables and their rates.
    subroutine measure_driven(model, state, variable, rate)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        real(wp), intent(out) :: variable(:, :), rate(:, :)    !! (lane, n_actuator)
        real(wp) :: zero(lanes), ignored(lanes)
        integer :: i

        zero = 0
        do i = 1, model%n_actuator
            associate (actuator => model%scene%actuator(i))
                call measure_variable(model, state, actuator%joint, actuator%variable, zero, variable(:, i), ignored)
            end associate
        end do
        call actuator_rates(model, state, rate)
    end subroutine measure_driven

    !> Accelerations of the coordinates that others stand in for, from those found. Column 0 must be as it was.
    subroutine tell_accelerations(model, workspace, acceleration)
        type(model_type), intent(in) :: model
        type(equation_workspace), intent(in) :: workspace
        real(wp), intent(out) :: acceleration(:, :)    !! (lane, n_q)
        integer :: i, k

        acceleration = workspace%acceleration
        do k = 1, model%n_q
            associate (c => model%scene%coordinate(k))
                if (c%for_joint == 0) cycle
                acceleration(:, k) = joint_rate(model, workspace%state, c%for_joint, c%for_variable, level_given)
                do i = 1, model%n_q
                    acceleration(:, k) = acceleration(:, k) + (workspace%acceleration(:, i) - workspace%state%qdd(:, i)) &
                                         *joint_rate(model, workspace%state, c%for_joint, c%for_variable, i)
                end do
            end associate
        end do
    end subroutine tell_accelerations

    !> Angular accelerations found for an attitude become second derivatives of roll, pitch, yaw. What the rates of angles
    !> give is in column 0 already; what those of a quaternion's are not is taken away.
    subroutine turn_to_rpy(model, equations, workspace)
        type(model_type), intent(in) :: model
        type(equations_type), intent(in) :: equations
        type(equation_workspace), intent(inout) :: workspace
        type(rpy_rotation) :: turn
        type(vec3) :: alpha
        real(wp) :: rate(lanes, 3)
        integer :: i

        do i = 1, size(model%step)
            if (.not. gives_attitude(model, model%step(i))) cycle
            associate (c => attitude_angles(model%step(i)), a => workspace%acceleration, state => workspace%state)
                if (.not. equations%unknown%acceleration(c(1))) cycle
                alpha = vec3(a(:, c(1)), a(:, c(2)), a(:, c(3)))
                if (state%by_quaternion(model%step(i)%first)) then
                    rate = rates_of_rpy(state%q(:, c(1)), state%q(:, c(2)), &
                                        vec3(state%qd(:, c(1)), state%qd(:, c(2)), state%qd(:, c(3))))
                    call rotate_rpy(state%q(:, c(1)), state%q(:, c(2)), state%q(:, c(3)), turn)
                    alpha = alpha - angular_acceleration_rpy(turn, rate, 0*rate)
                else if (model%step(i)%kind /= step_pose) then
                    cycle                              ! columns of a joint are those of its angles
                end if
                a(:, c) = rates_of_rpy(state%q(:, c(1)), state%q(:, c(2)), alpha)
            end associate
        end do
    end subroutine turn_to_rpy
end module linkdyn_inverse
