!> Inverse dynamics of a batch: motion given; driving forces, joint reactions and joint motion out.
!>
!> Samples are independent. They are taken in blocks of `lanes`, blocks are shared out to threads, and a block's
!> arithmetic does not depend on which thread runs it, so the results do not either. A sample that fails is NaN.
!> Scratch stays with the solver from one batch to the next, so that a batch of one sample costs little.
module linkdyn_inverse
    use linkdyn_assembly_trail, only: assembly_trail, sample_assembly, follow_assembly, make_room, place_sample, &
        reached_straight
    use linkdyn_catalogue, only: result_reaction, result_joint_push, result_joint_variable, result_joint_rate, result_qdd, &
        result_rcond, result_singularity_distance, result_transmission_angle, result_driving_force_error, result_reaction_error
    use linkdyn_closing_programs, only: closing_programs
    use linkdyn_condition, only: condition_type, condition_space, make_condition, free_condition, prepare_condition, &
        eliminate_block, find_rcond
    use linkdyn_dense, only: hold_blas_threads, release_blas_threads
    use linkdyn_closed_forms, only: transmission_angles
    use linkdyn_equation_kernels, only: kernel_family
    use linkdyn_equations, only: equations_type, equation_workspace, build_equations, build_no_equations, share_equations, &
        free_equations, prepare_workspace, want_of, solve_block, found_of, solver_gauss_jordan, solver_lapack, &
        solver_elimination, solver_reduced, solver_gauss_jordan_plain, solver_name, choose_solver
    use linkdyn_error_probe, only: error_probe, probe_space, make_probe, free_probe, prepare_probe_space, estimate_errors
    use linkdyn_failure, only: lost_in_words, failure_at, lock_in_words
    use linkdyn_group_motion, only: group_closer
    use linkdyn_interrupt, only: is_interrupted
    use linkdyn_inverse_results, only: inverse_results, part_of_results, wanted_ids, forces_beside, make_undefined, &
        may_be_infinite
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state, prepare_kinematics, link_position, link_rotation
    use linkdyn_led_mechanism, only: evaluate_kinematics
    use linkdyn_lane_count, only: lanes
    use linkdyn_lane_results, only: block_measures, prepare_measures, measure_block, values_of_block, tell_accelerations
    use linkdyn_load_laws, only: evaluate_load_laws
    use linkdyn_lock, only: hold_lock, release_lock, hold_texts, release_texts
    use linkdyn_model, only: model_type, friction_is_shared, has_assemblies, drives_share
    use linkdyn_recorded_forces, only: recorded_forces, record_shelf
    use linkdyn_margin_source, only: margin_source
    use linkdyn_recorded_margins, only: recorded_margins
    use linkdyn_representatives, only: representative_poses
    use linkdyn_roads, only: road_counts
    use linkdyn_second_look, only: second_look, need_look, free_look, surely_certain
    use linkdyn_singularity, only: singularity_space, prepare_singularity, find_singularity_distance
    use linkdyn_settled_samples, only: settle_samples, known_nodes
    use linkdyn_shared_reactions, only: share_reactions
    use linkdyn_status, only: status_type, fail, status_bad_input, sample_ok, sample_undefined, sample_locked
    use linkdyn_text, only: quoted
    use linkdyn_threads, only: team_size
    use linkdyn_turns, only: turn_count
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
        type(block_measures) :: measures
        real(wp), allocatable :: reaction(:, :, :)              !! (lane, n_component, n_joint)
        real(wp), allocatable :: values(:, :)                   !! of one result (lane, the widest so far)
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
        module subroutine count_turns_on_way(model, closing, q, qd, rate, turned, assembly, variable, turns)
            type(model_type), intent(in) :: model
            type(closing_programs), pointer, intent(in) :: closing    !! of the groups' steps; null: there are none
            real(wp), intent(in) :: q(:, :), qd(:, :)      !! (n_q, n)
            real(wp), intent(in) :: rate(:, :)             !! of the joint variables (n_variable, n)
            logical, intent(in) :: turned(:)               !! attitudes of a sample go by quaternions (n)
            type(sample_assembly), intent(in) :: assembly  !! of the samples; empty: there is but one
            real(wp), intent(inout) :: variable(:, :)      !! (n_variable, n); samples that failed are NaN
            type(turn_count), intent(inout) :: turns       !! of the samples before, then of the last of these
        end subroutine count_turns_on_way
    end interface

    ! How is said in `linkdyn_inverse_records`.
    interface
        !> Where links are, of a batch large enough for the scene's record, with a solver that was prepared for no forces. Samples `left` are
        !> for the lanes, on their assembly. With a trail the samples follow each other.
        module subroutine place_by_record(model, solver, q, results, assembly, left, trail)
            type(model_type), intent(in) :: model
            type(inverse_solver), intent(in) :: solver
            real(wp), intent(in), contiguous :: q(:, :)             !! (n_q, n)
            type(inverse_results), intent(inout) :: results         !! positions, rotations, status
            type(sample_assembly), intent(out) :: assembly
            integer, allocatable, intent(out) :: left(:)
            type(assembly_trail), intent(inout), optional :: trail
        end subroutine place_by_record

        !> A record takes some milliseconds to make, and as much for every further thirty links or so: of large mechanisms it is
        !> made for large batches only. Groups closed by iteration have to be led to its representative poses, each from the start.
        pure module logical function is_worth_recording(model, solver, n)
            type(model_type), intent(in) :: model
            type(inverse_solver), intent(in) :: solver
            integer, intent(in) :: n                               !! samples
        end function is_worth_recording

        !> The record for the results wanted, made when they are wanted first; null if the scene has none.
        recursive module subroutine need_record(model, solver, results, q, recorded)
            type(model_type), intent(in) :: model
            type(inverse_solver), intent(in) :: solver
            type(inverse_results), intent(in) :: results
            real(wp), intent(in) :: q(:, :)                        !! (n_q, n)
            type(recorded_forces), pointer, intent(out) :: recorded
        end subroutine need_record

        !> The record of margins, by which a motion is followed; null if there is none.
        recursive module subroutine need_margins(model, solver, q, recorded)
            type(model_type), intent(in) :: model
            type(inverse_solver), intent(in) :: solver
            real(wp), intent(in) :: q(:, :)                        !! (n_q, n)
            type(recorded_forces), pointer, intent(out) :: recorded
        end subroutine need_margins

        !> Is there a record for some results of a scene that finds what the lanes find?
        !>
        !> **Errors**: as of `prepare_inverse`.
        module subroutine look_for_record(model, wanted, is_there, is_uncertain, status)
            type(model_type), intent(in) :: model
            integer, intent(in) :: wanted(:)                       !! `result_*` of the catalogue
            logical, intent(out) :: is_there
            logical, intent(out) :: is_uncertain                   !! it leaves all poses to the lanes that it could be asked at
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
        module subroutine run_by_record(model, recorded, threads, q, qd, qdd, load, assembly, results, n_left, left, t)
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
        end subroutine run_by_record
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
        if (status%is_ok() .and. options%wants_errors .and. friction_is_shared(model)) then
            call fail(status, status_bad_input, "joint "//quoted(model%joint(model%contact(1)%joint)%name)//": friction comes of " &
                //"reactions that the equations leave open, and has no error estimate (expected no estimates, or no friction)")
        else if (status%is_ok() .and. options%wants_errors .and. wants_reactions .and. model%share%n > 0) then
            call fail(status, status_bad_input, "joint "//quoted(model%joint(model%share%joint(1))%name) &
                //": the equations leave its reaction open, which has no error estimate then (expected driving forces alone)")
        end if
        if (status%is_ok() .and. options%wants_errors) then
            allocate (solver%probe)
            call make_probe(model, options%solver, wants_reactions, solver%probe, status)
        end if
        ! reactions that the equations leave open have no estimates
        if (options%wants_forces .and. size(model%group) > 0 .and. .not. ((wants_reactions .and. model%share%n > 0) .or. &
                                                                        friction_is_shared(model))) &
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

        call prepare_inverse(model, options, results%wants(result_reaction), solver, status)
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
                                                                !! the others' rates are angular velocities. Samples have all
                                                                !! attitudes so, or none, or the same ones throughout
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
        integer, allocatable :: left(:)                         ! samples for the lanes; absent: all
        logical, allocatable :: turned(:)                       ! attitudes of a sample go by quaternions; absent: nobody asks
        type(left_places) :: stand                              ! there, if these are to share reactions
        integer, allocatable :: wanted(:)                       ! of the forces: `result_*`
        integer, allocatable :: told(:)                         ! all results that are wanted: `result_*`
        integer, allocatable :: holding(:)                      ! contacts that hold samples fast; 0: none does
        integer :: n, n_all, n_left, n_dense, i
        real(wp), allocatable, target :: own_rate(:, :)         ! of joints, if turns need them and nobody else
        logical :: has_stand_ins, is_on_way, shares, counts_turns, some_turned, all_turned

        shares = model%share%n > 0 .and. (model%share%may_gape .or. results%wants(result_reaction))
        n = size(q, 2)
        n_all = max(n, solver%n_expected)
        counts_turns = present(turns) .and. results%wants(result_joint_variable)
        if (counts_turns .and. .not. (present(own) .or. results%wants(result_joint_rate))) then
            allocate (own_rate(model%n_variable, n))
            call results%put(result_joint_rate, own_rate)
        end if
        some_turned = .false.
        if (present(quaternion)) some_turned = any(quaternion /= 0)
        if (some_turned .or. counts_turns) turned = [(is_turned(i), i=1, n)]
        all_turned = .false.
        if (some_turned) all_turned = all(turned)
        has_stand_ins = present(own) .and. any(model%scene%coordinate%for_joint > 0)
        n_dense = 0
        is_on_way = present(known) .or. (present(trail) .and. n > 0)
        nullify (recorded, margins, closer)
        call look_for_programs()
        if (has_assemblies(model) .or. has_stand_ins) call place_links()
        if (associated(results%load)) call tell_loads()
        n_left = n
        if (size(model%contact) > 0) allocate (holding(n), source=0)
        if (associated(recorded)) call run_record()
        call run_lanes()
        call tell_outcome()
        if (counts_turns) call count_turns()

    contains

        !> The records and programs that serve, made when they are wanted first.
        subroutine look_for_programs()
            if (associated(solver%places%closing) .and. n_all >= worth_closing .and. .not. present(known)) &
                call need_closer(model, solver, q, closer)
            if (associated(solver%records) .and. is_worth_recording(model, solver, n_all) .and. .not. &
                (has_stand_ins .or. present(known) .or. all_turned .or. present(given_force))) then
                call need_record(model, solver, results, q, recorded)
                if (is_on_way) call need_margins(model, solver, q, by_record%record)
                by_record%threads = threads
                if (associated(by_record%record)) margins => by_record
            end if
        end subroutine look_for_programs

        !> Where the links of groups are, or on which assembly samples are.
        subroutine place_links()
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
        end subroutine place_links

        subroutine run_record()
            if (is_on_way .or. .not. allocated(solver%at_start%status)) then
                call run_by_record(model, recorded, threads, q, qd, qdd, load, assembly, results, n_left, left, t)
            else
                call run_by_record(model, recorded, threads, q, qd, qdd, load, solver%at_start, results, n_left, left, t)
            end if
        end subroutine run_record

        !> What no record has done. Blocks of lanes have samples of one kind: whose attitudes go by angles, or by quaternions.
        subroutine run_lanes()
            if (some_turned .and. .not. all_turned) then
                if (.not. allocated(left)) left = [(i, i=1, n_left)]
                left = pack(left, .not. turned(left))
                n_left = size(left)
                call run_left()
                left = pack([(i, i=1, n)], turned)
                n_left = size(left)
            end if
            call run_left()
        end subroutine run_lanes

        !> The roads that samples took, and why the first one failed that did.
        subroutine tell_outcome()
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
        end subroutine tell_outcome

        !> Joint angles of samples that follow each other count turns.
        subroutine count_turns()
            if (present(own)) then
                call count_turns_about(own, results%of(result_joint_variable)%x, turns)
            else
                call count_turns_on_way(model, solver%places%closing, q, qd, results%of(result_joint_rate)%x, turned, assembly, &
                                        results%of(result_joint_variable)%x, turns)
            end if
            if (allocated(own_rate)) nullify (results%of(result_joint_rate)%x)
        end subroutine count_turns

        !> Do attitudes of a sample go by quaternions?
        pure logical function is_turned(i)
            integer, intent(in) :: i                    !! sample

            is_turned = .false.
            if (present(quaternion)) is_turned = any(quaternion(:, :, i) /= 0)
        end function is_turned

        !> The samples that are left.
        subroutine run_left()
            type(left_places) :: nobody

            if (n_left == 0) return
            stand = nobody
            if (shares) allocate (stand%position(3, model%n_link, n_left), stand%rotation(3, 3, model%n_link, n_left), &
                                  stand%status(n_left))
            told = wanted_ids(results)
            wanted = forces_beside(results)
            if (shares .and. results%wants(result_reaction) .and. size(model%arm) > 0) then
                wanted = [wanted, result_joint_push]
                allocate (stand%push(model%n_component, model%n_joint, n_left))
            end if
            call run_on_lanes()
            if (shares .and. .not. is_interrupted()) call share()
        end subroutine run_left

        !> What the equations leave open, and whether the joints fit that were released, where no record has told: by where the
        !> lanes have found the links.
        subroutine share()
            real(wp), pointer, contiguous :: reaction(:, :, :)
            integer, allocatable :: which(:)
            integer :: place

            which = [(sample_of(place), place=1, n_left)]
            if (results%wants(result_reaction)) then
                reaction(1:model%n_component, 1:model%n_joint, 1:n) => results%of(result_reaction)%x
                call share_reactions(model, threads, stand%position, stand%rotation, stand%status, which, reaction, stand%push)
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
                call run_block(block, space)
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
        subroutine run_block(block, space)
            integer, intent(in) :: block
            type(thread_space), intent(inout) :: space

            associate (workspace => space%workspace)
                workspace%state%time = 0
                call gather(block, workspace)
                workspace%fell_back = .false.
                call want_of(workspace, wanted)
                call solve_block(model, solver%equations, workspace)
                if (any(workspace%is_doubtful)) call look_again(block, space)
                call take_reactions(workspace, space%reaction)
                if (allocated(solver%probe)) then
                    call estimate_errors(solver%probe, workspace, space%reaction, results%wants(result_reaction), space%probe)
                    workspace%error = space%probe%worst
                end if
                if (associated(solver%condition)) then
                    call eliminate_block(solver%condition, workspace%state, workspace%numbers, space%condition)
                    if (results%wants(result_rcond)) &
                        call find_rcond(solver%condition, workspace%state, space%condition, workspace%rcond)
                    if (results%wants(result_singularity_distance)) call find_singularity_distance( &
                        model, solver%condition, workspace%state, space%condition, space%singularity, space%measures%distance)
                end if
                call measure_block(model, results, workspace%state, space%measures)
                if (results%wants(result_qdd)) call tell_accelerations(model, solver%equations, has_stand_ins, workspace)
            end associate
            call scatter(block, space)
        end subroutine run_block

        !> For estimates and samples alike, if they are wanted.
        subroutine take_reactions(workspace, reaction)
            type(equation_workspace), intent(in) :: workspace
            real(wp), intent(inout) :: reaction(:, :, :)    !! (lane, n_component, n_joint)

            if (results%wants(result_reaction)) &
                reaction = reshape(found_of(workspace, result_reaction, size(reaction)/lanes), shape(reaction))
        end subroutine take_reactions

        !> Lanes that are doubtful are taken where their forces hardly scatter.
        subroutine look_again(block, space)
            integer, intent(in) :: block
            type(thread_space), intent(inout) :: space
            integer :: flagged(lanes)
            logical :: is_doubtful(lanes)

            if (present(given_force) .or. .not. associated(solver%look)) return
            call need_look(model, solver%equations%solver, solver%equations%wants_reactions, solver%look)
            if (.not. solver%look%is_usable) return
            associate (workspace => space%workspace, doubt => space%doubt)
                if (.not. allocated(doubt%workspace)) call prepare_probe_space(solver%look%probe, doubt)
                flagged = workspace%status
                is_doubtful = workspace%is_doubtful
                workspace%checks_accuracy = .false.
                call gather(block, workspace)
                workspace%fell_back = .false.
                call solve_block(model, solver%equations, workspace)
                workspace%checks_accuracy = .true.
                call take_reactions(workspace, space%reaction)
                call estimate_errors(solver%look%probe, workspace, space%reaction, results%wants(result_reaction), doubt)
                where (.not. (is_doubtful .and. doubt%worst <= surely_certain)) workspace%status = flagged
            end associate
        end subroutine look_again

        !> Samples into lanes; lanes beyond the last sample repeat it.
        subroutine gather(block, workspace)
            integer, intent(in) :: block
            type(equation_workspace), intent(inout) :: workspace
            integer :: lane, sample

            workspace%state%by_quaternion = .false.
            if (present(quaternion)) &
                workspace%state%by_quaternion = any(quaternion(:, :, sample_of((block - 1)*lanes + 1)) /= 0, dim=1)
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

        !> Lanes into samples; failed ones become NaN. The last check: nothing that is not finite stands beside a good outcome.
        subroutine scatter(block, space)
            integer, intent(in) :: block
            type(thread_space), intent(inout) :: space
            real(wp) :: total(lanes)
            integer :: first, n_here, i, outcome(lanes)

            first = (block - 1)*lanes
            n_here = min(lanes, n_left - first)
            total = 0
            do i = 1, size(told)
                associate (id => told(i), width => size(results%of(told(i))%x, 1))
                    if (size(space%values, 2) < width) call widen(space, width)
                    associate (values => space%values(:, :width))
                        call find_values(id, space%workspace, space%measures, space%reaction, space%probe, values)
                        if (.not. may_be_infinite(id)) total = total + sum(abs(values), dim=2)
                        call put_lanes(first, n_here, values, results%of(id)%x)
                    end associate
                end associate
            end do
            outcome = space%workspace%status
            where (outcome == sample_ok .and. .not. total <= huge(1.0_wp)) outcome = sample_undefined
            do i = 1, n_here
                if (associated(results%status)) results%status(sample_of(first + i)) = outcome(i)
                if (outcome(i) == sample_locked) holding(sample_of(first + i)) = space%workspace%state%holding(i)
                if (outcome(i) /= sample_ok) call make_undefined(results, sample_of(first + i))
            end do
            if (shares) call note_places(first, n_here, space%workspace, outcome)
        end subroutine scatter

        !> Room for the values of a wider result.
        subroutine widen(space, width)
            type(thread_space), intent(inout) :: space
            integer, intent(in) :: width

            deallocate (space%values)
            allocate (space%values(lanes, width))
        end subroutine widen

        !> One result of a block.
        subroutine find_values(id, workspace, measures, reaction, probe, values)
            integer, intent(in) :: id                   !! one of `result_*`
            type(equation_workspace), intent(in) :: workspace
            type(block_measures), intent(in) :: measures
            real(wp), intent(in) :: reaction(:, :, :)   !! (lane, n_component, n_joint)
            type(probe_space), intent(in) :: probe
            real(wp), intent(out) :: values(:, :)       !! (lane, values of a sample)

            select case (id)
            case (result_reaction)
                values = reshape(reaction, shape(values))
            case (result_driving_force_error)
                values = probe%driving_force_error
            case (result_reaction_error)
                values = reshape(probe%reaction_error, shape(values))
            case (result_transmission_angle)
                if (has_stand_ins) then
                    call transmission_angles(own, workspace%state, values)
                else
                    call transmission_angles(model, workspace%state, values)
                end if
            case default
                call values_of_block(model, id, workspace, measures, values)
            end select
        end subroutine find_values

        !> The values of one result to their samples.
        subroutine put_lanes(first, n_here, values, to)
            integer, intent(in) :: first, n_here        !! places before, and those of the block
            real(wp), intent(in) :: values(:, :)        !! (lane, values of a sample)
            real(wp), intent(inout), contiguous :: to(:, :)    !! (values of a sample, sample)
            integer :: lane

            do lane = 1, n_here
                to(:, sample_of(first + lane)) = values(lane, :)
            end do
        end subroutine put_lanes

        !> For who shares reactions afterwards.
        subroutine note_places(first, n_here, workspace, outcome)
            integer, intent(in) :: first, n_here        !! places before, and those of the block
            type(equation_workspace), intent(in) :: workspace
            integer, intent(in) :: outcome(:)           !! `sample_*` (lane)
            real(wp), allocatable :: push(:, :)
            integer :: lane, l

            if (allocated(stand%push)) push = found_of(workspace, result_joint_push, model%n_component*model%n_joint)
            do lane = 1, n_here
                stand%status(first + lane) = outcome(lane)
                do l = 1, model%n_link
                    stand%position(:, l, first + lane) = link_position(model, workspace%state, l, lane)
                    stand%rotation(:, :, l, first + lane) = link_rotation(model, workspace%state, l, lane)
                end do
                if (allocated(stand%push)) stand%push(:, :, first + lane) = &
                    reshape(push(lane, :), [model%n_component, model%n_joint])
            end do
        end subroutine note_places
    end subroutine run_prepared

    ! ---------------------------------------------------------------- scratch

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
        allocate (space%reaction(lanes, model%n_component, model%n_joint))
        allocate (space%values(lanes, 0))
        call prepare_measures(model, space%measures)
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
end module linkdyn_inverse
