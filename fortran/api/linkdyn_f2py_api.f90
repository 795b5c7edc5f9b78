!> Flat layer for f2py: handles instead of objects, explicit shapes, code and message last.
!>
!> Text goes in and comes out as its bytes (UTF-8), one integer each, so that any character survives
!> and f2py need not know texts of unknown length. Batches go as flat arrays in C order (sample
!> slowest), which is Fortran order with the sample last: nothing is copied. An array that
!> is not wanted, or empty, has one element: f2py refuses none.
!> Kinds here are c_double and c_int only: f2py takes any other real kind for a C float.
module linkdyn_f2py_api
    use, intrinsic :: iso_c_binding, only: c_double, c_int
    use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
    use linkdyn_assembly_trail, only: assembly_trail
    use linkdyn_builder, only: build_model
    use linkdyn_dataset, only: dataset_type, sample_variable
    use linkdyn_description, only: scene_as_json, layout_as_json, dataset_as_json
    use linkdyn_explain, only: explain_model
    use linkdyn_explain_matrix, only: explain_first_instant
    use linkdyn_force_map, only: typical_length
    use linkdyn_forward, only: forward_options, choose_method, coordinates_in_words, rounding_in_words, method_rk4, run_ensemble
    use linkdyn_interrupt, only: is_interrupted, start_listening, stop_listening
    use linkdyn_inverse, only: inverse_options, inverse_results, inverse_solver, prepare_inverse, run_prepared, &
        choose_solver, solver_name
    use linkdyn_led_mechanism, only: follows_assembly
    use linkdyn_model, only: model_type, dyad_names
    use linkdyn_motion, only: evaluate_motion
    use linkdyn_poses, only: find_poses, poses_of_joints
    use linkdyn_report, only: open_report, read_report
    use linkdyn_results, only: layout_type, block_type, wanted_type, describe_results, prepare_block, choose_wanted, &
        all_wanted, add_free, find_driving_power
    use linkdyn_roads, only: road_counts
    use linkdyn_scene, only: scene_type, load_spec, name_len
    use linkdyn_scene_reader, only: parse_scene, check_actuators
    use linkdyn_status, only: status_type, fail, status_bad_input, status_interrupted, sample_ok, sample_undefined
    use linkdyn_suggest, only: suggestion
    use linkdyn_sweep, only: sweep_run
    use linkdyn_sweep_handles, only: open_sweep, find_sweep, close_sweep, advance_sweep, kept_width, copy_numbers
    use linkdyn_sweep_results, only: sweep_dataset, kept_variables
    use linkdyn_text, only: to_text, quoted, printable
    use linkdyn_turns, only: turn_count
    use linkdyn_version, only: version
    use linkdyn_watched_run, only: watched_run, start_watched, advance_watched, finish_watched, time_reached
    implicit none
    private
    public :: api_version, api_open, api_add_loads, api_close, api_sizes, api_describe_scene, api_describe_results
    public :: api_explain, api_motion, api_inverse, api_forward, api_advance, api_finish, api_poses, api_ensemble
    public :: api_sweep_open, api_sweep_advance, api_sweep_describe, api_sweep_values, api_sweep_close

    integer, parameter :: status_stale_handle = 7   !! beside the engine's codes: the scene was closed

    !> Equations planned for one solver; absent until they are asked for.
    type :: solver_box
        type(inverse_solver), pointer :: solver => null()
    end type solver_box

    !> An open scene with what was planned for it.
    type :: open_scene
        type(model_type) :: model
        type(layout_type) :: layout                                 !! of all results
        type(solver_box) :: planned(2, 2, 2, 2, size(solver_name))  !! without and with reactions, error estimates, rcond, distance; by solver
    end type open_scene

    !> Pointed to, so that the list can grow while a batch runs.
    type :: scene_box
        type(open_scene), pointer :: scene => null()
    end type scene_box

    !> A forward run under way.
    type :: run_box
        type(watched_run), pointer :: run => null()
    end type run_box

    type(run_box), allocatable, save :: runs(:)       !! place = handle
    type(scene_box), allocatable, save :: opened(:)   !! place = handle; a closed one stays empty

contains

    subroutine api_version(text)
        character(len=32), intent(out) :: text

        text = version
    end subroutine api_version

    !> Read and plan a scene given as text.
    subroutine api_open(n_text, text, n_file, file, n_folder, folder, handle, code, message)
        integer(c_int), intent(in) :: n_text, n_file, n_folder
        integer(c_int), intent(in) :: text(n_text)      ! the scene file
        integer(c_int), intent(in) :: file(n_file)      ! its name in messages
        integer(c_int), intent(in) :: folder(n_folder)  ! where its tables lie
        integer(c_int), intent(out) :: handle
        integer(c_int), intent(out) :: code
        character(len=512), intent(out) :: message
        type(scene_type) :: scene
        type(status_type) :: status

        handle = 0
        call parse_scene(from_bytes(text), from_bytes(file), from_bytes(folder), scene, status)
        if (status%code == 0) call register_scene(scene, handle, status)
        if (status%code /= 0) call name_file(from_bytes(file), status)
        call report(status, code, message)
    end subroutine api_open

    !> A second scene: the first one with loads at more markers, given as "link.marker" lines.
    subroutine api_add_loads(handle, n_names, names, new_handle, code, message)
        integer(c_int), intent(in) :: handle, n_names
        integer(c_int), intent(in) :: names(n_names)
        integer(c_int), intent(out) :: new_handle
        integer(c_int), intent(out) :: code
        character(len=512), intent(out) :: message
        type(model_type), pointer :: model
        type(scene_type) :: scene
        type(status_type) :: status
        character(len=:), allocatable :: rest
        integer :: line_end

        new_handle = 0
        call find_model(handle, model, status)
        if (status%code == 0) then
            scene = model%scene
            rest = from_bytes(names)
            do while (len(rest) > 0 .and. status%code == 0)
                line_end = index(rest, new_line("a"))
                if (line_end == 0) line_end = len(rest) + 1
                call add_load(rest(:line_end - 1), scene, status)
                rest = rest(min(line_end, len(rest)) + 1:)
            end do
            if (status%code == 0) call register_scene(scene, new_handle, status)
        end if
        call report(status, code, message)
    end subroutine api_add_loads

    !> Forget a scene.
    subroutine api_close(handle, code, message)
        integer(c_int), intent(in) :: handle
        integer(c_int), intent(out) :: code
        character(len=512), intent(out) :: message
        type(open_scene), pointer :: scene
        type(status_type) :: status

        call find_scene(handle, scene, status)
        if (status%code == 0) then
            !$omp critical (linkdyn_registry)
            nullify (opened(handle)%scene)
            !$omp end critical (linkdyn_registry)
            call free_solvers(size(scene%planned), scene%planned)
            deallocate (scene)
        end if
        call report(status, code, message)
    end subroutine api_close

    !> Counts that shapes are made of.
    subroutine api_sizes(handle, n_coordinate, n_actuator, n_joint, n_component, n_variable, n_load, n_link, code, message)
        integer(c_int), intent(in) :: handle
        integer(c_int), intent(out) :: n_coordinate, n_actuator, n_joint, n_component, n_variable, n_load, n_link
        integer(c_int), intent(out) :: code
        character(len=512), intent(out) :: message
        type(model_type), pointer :: model
        type(status_type) :: status

        n_coordinate = 0
        n_actuator = 0
        n_joint = 0
        n_component = 0
        n_variable = 0
        n_load = 0
        n_link = 0
        call find_model(handle, model, status)
        if (status%code == 0) then
            n_coordinate = model%n_q
            n_actuator = model%n_actuator
            n_joint = model%n_joint
            n_component = model%n_component
            n_variable = model%n_variable
            n_load = model%n_load
            n_link = model%n_link
        end if
        call report(status, code, message)
    end subroutine api_sizes

    !> The scene as JSON. If `length` exceeds the capacity nothing is copied: call again with room.
    subroutine api_describe_scene(handle, capacity, text, length, code, message)
        integer(c_int), intent(in) :: handle
        integer(c_int), intent(in) :: capacity
        integer(c_int), intent(inout) :: text(capacity)
        integer(c_int), intent(out) :: length
        integer(c_int), intent(out) :: code
        character(len=512), intent(out) :: message
        type(model_type), pointer :: model
        type(status_type) :: status

        length = 0
        call find_model(handle, model, status)
        if (status%code == 0) call to_bytes(scene_as_json(model%scene), text, length)
        call report(status, code, message)
    end subroutine api_describe_scene

    !> Dimensions and variables of the results as JSON; text as in `api_describe_scene`.
    subroutine api_describe_results(handle, solver, want, has_time, has_errors, capacity, text, length, code, message)
        integer(c_int), intent(in) :: handle
        character(len=*), intent(in) :: solver
        character(len=*), intent(in) :: want               ! "all" or names with commas; blank: all that the solver gives
        integer(c_int), intent(in) :: has_time             ! 1: samples are instants; 2: of a forward run
        integer(c_int), intent(in) :: has_errors           ! 1: error estimates are wanted
        integer(c_int), intent(in) :: capacity
        integer(c_int), intent(inout) :: text(capacity)
        integer(c_int), intent(out) :: length
        integer(c_int), intent(out) :: code
        character(len=512), intent(out) :: message
        type(model_type), pointer :: model
        type(layout_type) :: layout
        type(wanted_type) :: wanted
        type(status_type) :: status
        integer :: number

        length = 0
        call find_model(handle, model, status)
        if (status%code == 0) call choose_solver(trim(solver), number, status)
        if (status%code == 0 .and. len_trim(want) == 0) wanted = all_wanted(number)
        if (status%code == 0 .and. len_trim(want) > 0) call choose_wanted(want, wanted, status)
        if (status%code == 0) call add_free(number, wanted)
        wanted%errors = has_errors == 1
        if (wanted%distance .and. has_time == 2) call refuse_distance(status)
        if (status%code == 0) then
            call describe_results(model%scene, wanted, has_time /= 0, layout, is_forward=has_time == 2, dyad=dyad_names(model), &
                                  length=typical_length(model), follows_assembly=follows_assembly(model))
            call to_bytes(layout_as_json(layout), text, length)
        end if
        call report(status, code, message)
    end subroutine api_describe_results

    !> A forward run does not look for singular positions.
    subroutine refuse_distance(status)
        type(status_type), intent(inout) :: status

        call fail(status, status_bad_input, "want: 'singularity_distance' is not a result of forward runs (expected inverse " &
                  //"for the motion found)")
    end subroutine refuse_distance

    !> The report of `linkdyn explain`; text as in `api_describe_scene`.
    subroutine api_explain(handle, with_matrix, capacity, text, length, code, message)
        integer(c_int), intent(in) :: handle
        integer(c_int), intent(in) :: with_matrix          ! 1: and the equations at the first instant
        integer(c_int), intent(in) :: capacity
        integer(c_int), intent(inout) :: text(capacity)
        integer(c_int), intent(out) :: length
        integer(c_int), intent(out) :: code
        character(len=512), intent(out) :: message
        type(model_type), pointer :: model
        type(status_type) :: status
        character(len=:), allocatable :: written
        integer :: unit

        length = 0
        call find_model(handle, model, status)
        if (status%code == 0) call open_report(unit, status)
        if (status%code == 0) then
            call explain_model(model, unit)
            if (with_matrix == 1) call explain_first_instant(model, unit)
            call read_report(unit, written, status)
            if (status%code == 0) call to_bytes(written, text, length)
        end if
        call report(status, code, message)
    end subroutine api_explain

    !> Coordinates, their derivatives and the loads of the scene at given instants.
    subroutine api_motion(handle, n, t, n_q_values, q, qd, qdd, n_load_values, load, code, message)
        !f2py threadsafe
        integer(c_int), intent(in) :: handle
        integer(c_int), intent(in) :: n, n_q_values, n_load_values
        real(c_double), intent(in) :: t(n)                                 ! [s]
        real(c_double), intent(inout), target :: q(n_q_values), qd(n_q_values), qdd(n_q_values)  ! (n_q, n)
        real(c_double), intent(inout), target :: load(n_load_values)       ! (6, n_load, n)
        integer(c_int), intent(out) :: code
        character(len=512), intent(out) :: message
        type(model_type), pointer :: model
        type(status_type) :: status
        real(c_double), pointer :: q2(:, :), qd2(:, :), qdd2(:, :), load3(:, :, :)

        call find_model(handle, model, status)
        if (status%code == 0) call check_size("q", n_q_values, model%n_q*n, status)
        if (status%code == 0) call check_size("load", n_load_values, max(1, 6*model%n_load*n), status)
        if (status%code == 0) then
            q2(1:model%n_q, 1:n) => q
            qd2(1:model%n_q, 1:n) => qd
            qdd2(1:model%n_q, 1:n) => qdd
            load3(1:6, 1:model%n_load, 1:n) => load
            call evaluate_motion(model, t, q2, qd2, qdd2, load3)
        end if
        call report(status, code, message)
    end subroutine api_motion

    !> Inverse dynamics of a batch.
    subroutine api_inverse(handle, solver, threads, first, in_order, wanted, n, n_q_values, q, qd, qdd, n_load_values, load, &
            n_driving, driving_force, n_power, driving_speed, driving_power, n_reaction, reaction, &
            n_variable, joint_variable, joint_rate, n_check, power_imbalance, n_rcond, rcond, &
            n_distance, distance, n_error, error, &
            n_driving_error, driving_force_error, n_reaction_error, reaction_error, n_transmission, transmission_angle, &
            n_growth, growth, n_assembly, assembly, sample_status, roads, lost_sample, lost_in_words, code, message)
        !f2py threadsafe
        integer(c_int), intent(in) :: handle
        character(len=*), intent(in) :: solver
        integer(c_int), intent(in) :: threads
        integer(c_int), intent(in) :: first                ! number of the first sample in messages, from 0
        integer(c_int), intent(in) :: in_order             ! 1: the samples follow each other, so does the assembly
        integer(c_int), intent(in) :: wanted(13)           ! 1: driving force, power, reaction, joint variables, checks, rcond,
                                                           ! distance, relative error, errors of driving forces, of
                                                           ! reactions, transmission angles, growth, assembly
        integer(c_int), intent(in) :: n                    ! samples
        integer(c_int), intent(in) :: n_q_values, n_load_values, n_driving, n_power, n_reaction, n_variable, n_check
        integer(c_int), intent(in) :: n_rcond, n_distance, n_error, n_driving_error, n_reaction_error, n_transmission, n_growth
        integer(c_int), intent(in) :: n_assembly
        real(c_double), intent(in), target :: q(n_q_values), qd(n_q_values), qdd(n_q_values)     ! (n_q, n)
        real(c_double), intent(in), target :: load(n_load_values)                                ! (6, n_load, n)
        real(c_double), intent(inout), target :: driving_force(n_driving)                        ! (n_actuator, n)
        real(c_double), intent(inout), target :: driving_speed(n_power), driving_power(n_power)  ! (n_actuator, n)
        real(c_double), intent(inout), target :: reaction(n_reaction)                            ! (n_component, n_joint, n)
        real(c_double), intent(inout), target :: joint_variable(n_variable), joint_rate(n_variable)  ! (n_variable, n)
        real(c_double), intent(inout), target :: growth(n_growth), power_imbalance(n_check)      ! (n)
        real(c_double), intent(inout), target :: rcond(n_rcond), distance(n_distance), error(n_error)  ! (n)
        real(c_double), intent(inout), target :: driving_force_error(n_driving_error)            ! (n_actuator, n)
        real(c_double), intent(inout), target :: reaction_error(n_reaction_error)                ! (n_component, n_joint, n)
        real(c_double), intent(inout), target :: transmission_angle(n_transmission)              ! (n_dyad, n)
        integer(c_int), intent(inout), target :: assembly(n_assembly)                            ! (n)
        integer(c_int), intent(inout), target :: sample_status(n)
        integer(c_int), intent(out) :: roads(3)            ! samples closed in closed form, by iteration; handed to the dense solver
        integer(c_int), intent(out) :: lost_sample         ! the first to which the assembly was not followed, from 1; 0: none
        character(len=512), intent(out) :: lost_in_words   ! why
        integer(c_int), intent(out) :: code
        character(len=512), intent(out) :: message
        type(open_scene), pointer :: scene
        type(model_type), pointer :: model
        type(inverse_solver), pointer :: planned
        type(status_type) :: status
        type(assembly_trail) :: trail
        type(turn_count) :: turns
        type(inverse_results) :: results
        real(c_double), pointer :: q2(:, :), qd2(:, :), qdd2(:, :), load3(:, :, :), speed2(:, :), power2(:, :)
        real(c_double), allocatable, target :: own_force(:, :), own_rate(:, :)

        call start_listening()
        roads = 0
        lost_sample = 0
        lost_in_words = ""
        call find_scene(handle, scene, status)
        if (status%code == 0) then                         ! the first failure stays
            model => scene%model
            call find_solver(scene, trim(solver), wanted(3) == 1, any(wanted(9:10) == 1), wanted(6:7) == 1, planned, status)
            call check_size("q", n_q_values, model%n_q*n, status)
            call check_size("load", n_load_values, max(1, 6*model%n_load*n), status)
            call check_size("driving_force", n_driving, model%n_actuator*n, status, wanted(1))
            call check_size("driving_power", n_power, model%n_actuator*n, status, wanted(2))
            call check_size("reaction", n_reaction, model%n_component*model%n_joint*n, status, wanted(3))
            call check_size("joint_variable", n_variable, model%n_variable*n, status, wanted(4))
            call check_size("power_imbalance", n_check, n, status, wanted(5))
            call check_size("rcond", n_rcond, n, status, wanted(6))
            call check_size("singularity_distance", n_distance, n, status, wanted(7))
            call check_size("error", n_error, n, status, wanted(8))
            call check_size("driving_force_error", n_driving_error, model%n_actuator*n, status, wanted(9))
            call check_size("reaction_error", n_reaction_error, model%n_component*model%n_joint*n, status, wanted(10))
            call check_size("transmission_angle", n_transmission, model%n_dyad*n, status, wanted(11))
            call check_size("growth", n_growth, n, status, wanted(12))
            call check_size("assembly", n_assembly, n, status, wanted(13))
        end if
        if (status%code == 0) then
            call check_finite("q", model, first, n, q, status)
            call check_finite("qd", model, first, n, qd, status)
            call check_finite("qdd", model, first, n, qdd, status)
            call check_finite_loads(model, first, n, load, status)
        end if
        if (status%code == 0) then
            q2(1:model%n_q, 1:n) => q
            qd2(1:model%n_q, 1:n) => qd
            qdd2(1:model%n_q, 1:n) => qdd
            load3(1:6, 1:model%n_load, 1:n) => load
            results%status => sample_status
            if (wanted(1) == 1) results%driving_force(1:model%n_actuator, 1:n) => driving_force
            if (wanted(3) == 1) results%reaction(1:model%n_component, 1:model%n_joint, 1:n) => reaction
            if (wanted(4) == 1) then
                results%joint_variable(1:model%n_variable, 1:n) => joint_variable
                results%joint_rate(1:model%n_variable, 1:n) => joint_rate
            end if
            if (wanted(5) == 1) results%power_imbalance => power_imbalance
            if (wanted(6) == 1) results%rcond => rcond
            if (wanted(7) == 1) results%singularity_distance => distance
            if (wanted(8) == 1) results%error => error
            if (wanted(9) == 1) results%driving_force_error(1:model%n_actuator, 1:n) => driving_force_error
            if (wanted(10) == 1) results%reaction_error(1:model%n_component, 1:model%n_joint, 1:n) => reaction_error
            if (wanted(11) == 1) results%transmission_angle(1:model%n_dyad, 1:n) => transmission_angle
            if (wanted(12) == 1) results%growth => growth
            if (wanted(13) == 1) results%assembly => assembly
            if (wanted(2) == 1 .and. wanted(1) /= 1) then
                allocate (own_force(model%n_actuator, n))
                results%driving_force => own_force
            end if
            if (wanted(2) == 1 .and. wanted(4) /= 1) then
                allocate (own_rate(model%n_variable, n))
                results%joint_rate => own_rate
            end if
            if (in_order == 1) then
                call run_prepared(model, planned, int(threads), q2, qd2, qdd2, load3, results, trail=trail, turns=turns)
            else
                call run_prepared(model, planned, int(threads), q2, qd2, qdd2, load3, results)
            end if
            roads = [results%roads%closed, results%roads%iterated, results%roads%dense]
            lost_sample = results%lost_sample
            lost_in_words = results%lost_in_words
            if (wanted(2) == 1) then
                speed2(1:model%n_actuator, 1:n) => driving_speed
                power2(1:model%n_actuator, 1:n) => driving_power
                call find_driving_power(scene%layout, results%driving_force, results%joint_rate, speed2, power2)
                where (sample_status == sample_ok .and. .not. all(abs(power2) <= huge(1.0_c_double), dim=1)) &
                    sample_status = sample_undefined
            end if
        end if
        call report_heard(status, code, message)
    end subroutine api_inverse

    !> Start a forward run. It goes on by api_advance and must be ended by api_finish.
    subroutine api_forward(handle, method, solver, threads, step, rtol, atol, switches, want, has_errors, t_start, t_end, &
            run_handle, code, message)
        !f2py threadsafe
        integer(c_int), intent(in) :: handle
        character(len=*), intent(in) :: method, solver
        integer(c_int), intent(in) :: threads
        real(c_double), intent(in) :: step, rtol, atol
        integer(c_int), intent(in) :: switches             ! 1: coordinates are exchanged at their dead points
        character(len=*), intent(in) :: want               ! "all" or names with commas
        integer(c_int), intent(in) :: has_errors           ! 1: error estimates are wanted
        real(c_double), intent(in) :: t_start, t_end       ! [s]
        integer(c_int), intent(out) :: run_handle
        integer(c_int), intent(out) :: code
        character(len=512), intent(out) :: message
        type(model_type), pointer :: model
        type(status_type) :: status
        type(forward_options) :: options
        type(wanted_type) :: wanted
        type(watched_run), pointer :: new
        type(run_box), allocatable :: longer(:)

        run_handle = 0
        call find_model(handle, model, status)
        if (status%code == 0) then                         ! the first failure stays
            call choose_method(trim(method), options%integrator%method, status)
            call choose_solver(trim(solver), options%solver, status)
            if (status%code == 0 .and. len_trim(want) == 0) wanted = all_wanted(options%solver)
            if (status%code == 0 .and. len_trim(want) > 0) call choose_wanted(trim(want), wanted, status)
            if (status%code == 0) call add_free(options%solver, wanted)
            options%integrator%step = step
            options%integrator%rtol = rtol
            options%integrator%atol = atol
            options%t_start = t_start
            options%integrator%span = t_end - t_start
            options%switches = switches == 1
            options%threads = threads
            options%wants_reactions = wanted%reaction
            options%wants_rcond = wanted%rcond
            wanted%errors = has_errors == 1
        end if
        if (status%code == 0) then
            allocate (new)
            call start_watched(model, options, wanted, new, status)
            if (status%code == 0) then
                !$omp critical (linkdyn_registry)
                if (.not. allocated(runs)) allocate (runs(0))
                do run_handle = size(runs), 1, -1          ! a place left free
                    if (.not. associated(runs(run_handle)%run)) exit
                end do
                if (run_handle == 0) then
                    allocate (longer(size(runs) + 1))
                    longer(:size(runs)) = runs
                    call move_alloc(longer, runs)
                    run_handle = size(runs)
                end if
                runs(run_handle)%run => new
                !$omp end critical (linkdyn_registry)
            else
                call finish_watched(new)
                deallocate (new)
            end if
        end if
        call report(status, code, message)
    end subroutine api_forward

    !> Go on through some instants, for a time; the rest of the arrays is left alone.
    subroutine api_advance(run_handle, n, t, seconds, n_values, values, n_numbers, numbers, n_done, reached, statistics, roads, &
            rounding, stopped, coordinates, code, message)
        !f2py threadsafe
        integer(c_int), intent(in) :: run_handle
        integer(c_int), intent(in) :: n, n_values, n_numbers
        real(c_double), intent(in) :: t(n)                 ! instants of output, increasing [s]
        real(c_double), intent(in) :: seconds              ! of computing time, about
        real(c_double), intent(inout) :: values(n_values)  ! real variable after real variable, n samples each
        integer(c_int), intent(inout) :: numbers(n_numbers)  ! the same of the whole numbers
        integer(c_int), intent(out) :: n_done
        real(c_double), intent(out) :: reached             ! [s]
        integer(c_int), intent(out) :: statistics(3)       ! steps, rejected steps, right-hand sides
        integer(c_int), intent(out) :: roads(3)            ! of these instants, as in `api_inverse`
        character(len=256), intent(out) :: rounding        ! what it left of the tolerances; blank if these were met
        character(len=256), intent(out) :: stopped         ! why the run stopped early; blank if it did not
        character(len=512), intent(out) :: coordinates     ! which were integrated when; blank if none was exchanged
        integer(c_int), intent(out) :: code
        character(len=512), intent(out) :: message
        type(watched_run), pointer :: here
        type(status_type) :: status
        type(block_type) :: block
        type(road_counts) :: taken
        integer :: i, place, whole_place

        n_done = 0
        reached = 0
        statistics = 0
        roads = 0
        rounding = ""
        stopped = ""
        coordinates = ""
        call find_run(run_handle, here, status)
        if (status%code == 0) then
            call prepare_block(here%layout, n, block)
            place = 0
            whole_place = 0
            do i = 1, size(block%of)
                if (allocated(block%of(i)%real)) place = place + size(block%of(i)%real)
                if (allocated(block%of(i)%integer)) whole_place = whole_place + size(block%of(i)%integer)
            end do
            call check_size("values", n_values, place, status)
            call check_size("numbers", n_numbers, whole_place, status)
        end if
        if (status%code == 0) then
            call advance_watched(here, t, block, taken, i, seconds)
            n_done = i
            roads = [taken%closed, taken%iterated, taken%dense]
            place = 0
            whole_place = 0
            do i = 1, size(block%of)
                if (allocated(block%of(i)%integer)) then
                    numbers(whole_place + 1:whole_place + size(block%of(i)%integer)) = block%of(i)%integer
                    whole_place = whole_place + size(block%of(i)%integer)
                else
                    values(place + 1:place + size(block%of(i)%real)) = block%of(i)%real
                    place = place + size(block%of(i)%real)
                end if
            end do
            associate (integrator => here%run%integrator)
                statistics = [integrator%n_step, integrator%n_rejected, integrator%n_evaluation]
            end associate
            reached = time_reached(here)
            if (here%run%has_stopped) stopped = here%run%reason
            coordinates = coordinates_in_words(here%run)
            rounding = rounding_in_words(here%run)
        end if
        call report(status, code, message)
    end subroutine api_advance

    !> End a run; nothing happens to one that was ended before.
    subroutine api_finish(run_handle)
        integer(c_int), intent(in) :: run_handle
        type(watched_run), pointer :: here
        type(status_type) :: status

        call find_run(run_handle, here, status)
        if (status%code /= 0) return
        !$omp critical (linkdyn_registry)
        nullify (runs(run_handle)%run)
        !$omp end critical (linkdyn_registry)
        call finish_watched(here)
        deallocate (here)
    end subroutine api_finish

    subroutine find_run(run_handle, here, status)
        integer(c_int), intent(in) :: run_handle
        type(watched_run), pointer, intent(out) :: here
        type(status_type), intent(out) :: status

        nullify (here)
        !$omp critical (linkdyn_registry)
        if (allocated(runs)) then
            if (run_handle >= 1 .and. run_handle <= size(runs)) here => runs(run_handle)%run
        end if
        !$omp end critical (linkdyn_registry)
        if (.not. associated(here)) call fail(status, status_stale_handle, "this run was ended")
    end subroutine find_run

    !> Position of the origin and rotation matrix of every moving link.
    subroutine api_poses(handle, in_order, n, n_q_values, q, n_position, position, n_rotation, rotation, sample_status, &
            code, message)
        !f2py threadsafe
        integer(c_int), intent(in) :: handle
        integer(c_int), intent(in) :: in_order             ! 1: the samples follow each other, so does the assembly;
                                                           ! 2: q holds all joint variables
        integer(c_int), intent(in) :: n, n_q_values, n_position, n_rotation
        real(c_double), intent(in), target :: q(n_q_values)                  ! (n_q, n), (n_variable, n)
        real(c_double), intent(inout), target :: position(n_position)        ! (3, n_link, n)
        real(c_double), intent(inout), target :: rotation(n_rotation)        ! (3, 3, n_link, n)
        integer(c_int), intent(inout), target :: sample_status(n)
        integer(c_int), intent(out) :: code
        character(len=512), intent(out) :: message
        type(model_type), pointer :: model
        type(status_type) :: status
        type(assembly_trail) :: trail
        integer :: width
        real(c_double), pointer :: q2(:, :), position3(:, :, :), rotation4(:, :, :, :)

        call start_listening()
        call find_model(handle, model, status)
        if (status%code == 0) width = merge(model%n_variable, model%n_q, in_order == 2)
        if (status%code == 0) call check_size("q", n_q_values, width*n, status)
        if (status%code == 0) call check_size("position", n_position, 3*model%n_link*n, status)
        if (status%code == 0) call check_size("rotation", n_rotation, 9*model%n_link*n, status)
        if (status%code == 0 .and. in_order /= 2) call check_finite("q", model, 0, n, q, status)
        if (status%code == 0) then
            q2(1:width, 1:n) => q
            position3(1:3, 1:model%n_link, 1:n) => position
            rotation4(1:3, 1:3, 1:model%n_link, 1:n) => rotation
            if (in_order == 2) then
                call poses_of_joints(model, q2, position3, rotation4, sample_status)
            else if (in_order == 1) then
                call find_poses(model, q2, position3, rotation4, sample_status, trail)
            else
                call find_poses(model, q2, position3, rotation4, sample_status)
            end if
        end if
        call report_heard(status, code, message)
    end subroutine api_poses

    !> Forward runs by rk4 from many starts.
    subroutine api_ensemble(handle, threads, step, n_t, t, n, good_until, n_members, crossed, n_outcomes, outcome, &
            n_start, q_start, n_start_rate, qd_start, n_q_values, q, n_qd_values, qd, code, message)
        !f2py threadsafe
        integer(c_int), intent(in) :: handle, threads
        real(c_double), intent(in) :: step
        integer(c_int), intent(in) :: n_t, n, n_members, n_outcomes, n_start, n_start_rate, n_q_values, n_qd_values
        real(c_double), intent(in) :: t(n_t)                                 ! increasing; the members start at the first [s]
        real(c_double), intent(inout) :: good_until(n)
        integer(c_int), intent(inout) :: crossed(n_members)                  ! change points passed
        integer(c_int), intent(inout) :: outcome(n_outcomes)                 ! why they stopped; 0: they have not
        real(c_double), intent(in), target :: q_start(n_start), qd_start(n_start_rate)     ! (n_q, n)
        real(c_double), intent(inout), target :: q(n_q_values), qd(n_qd_values)            ! (n_q, n_t, n)
        integer(c_int), intent(out) :: code
        character(len=512), intent(out) :: message
        type(model_type), pointer :: model
        type(status_type) :: status
        type(forward_options) :: options
        real(c_double), pointer :: q_start2(:, :), qd_start2(:, :), q3(:, :, :), qd3(:, :, :)

        call start_listening()
        call find_model(handle, model, status)
        if (status%code == 0) call check_size("room for change points", n_members, n, status)
        if (status%code == 0) call check_size("room for outcomes", n_outcomes, n, status)
        if (status%code == 0) call check_size("q", n_start, model%n_q*n, status)
        if (status%code == 0) call check_size("qd", n_start_rate, model%n_q*n, status)
        if (status%code == 0) call check_size("room for q", n_q_values, model%n_q*n_t*n, status)
        if (status%code == 0) call check_size("room for qd", n_qd_values, model%n_q*n_t*n, status)
        if (status%code == 0) call check_finite("q", model, 0, n, q_start, status)
        if (status%code == 0) call check_finite("qd", model, 0, n, qd_start, status)
        if (status%code == 0) then
            q_start2(1:model%n_q, 1:n) => q_start
            qd_start2(1:model%n_q, 1:n) => qd_start
            q3(1:model%n_q, 1:n_t, 1:n) => q
            qd3(1:model%n_q, 1:n_t, 1:n) => qd
            options%integrator%method = method_rk4
            options%integrator%step = step
            options%t_start = t(1)
            options%integrator%span = t(n_t) - t(1)
            options%threads = threads
            call run_ensemble(model, options, q_start2, qd_start2, t, q3, qd3, good_until, crossed, outcome, status)
        end if
        call report_heard(status, code, message)
    end subroutine api_ensemble

    !> Plan the sweep of a scene. It is advanced, read and closed by its own handle.
    subroutine api_sweep_open(handle, n_folder, folder, solver, n_keep, keep, sweep, n_sample, n_chunk, chunk, width, code, &
            message)
        integer(c_int), intent(in) :: handle
        integer(c_int), intent(in) :: n_folder, n_keep
        integer(c_int), intent(in) :: folder(n_folder)     ! where the scene's tables lie
        character(len=*), intent(in) :: solver
        integer(c_int), intent(in) :: keep(n_keep)         ! quantities kept of every sample, with commas; blank: the scene's
        integer(c_int), intent(out) :: sweep
        real(c_double), intent(out) :: n_sample, n_chunk   ! whole numbers, below 2**53
        integer(c_int), intent(out) :: chunk               ! samples of a chunk at most
        integer(c_int), intent(out) :: width               ! values kept of a sample; 0: none
        integer(c_int), intent(out) :: code
        character(len=512), intent(out) :: message
        type(model_type), pointer :: model
        type(sweep_run), pointer :: run
        type(status_type) :: status
        integer :: number

        call start_listening()
        sweep = 0
        n_sample = 0
        n_chunk = 0
        chunk = 0
        width = 0
        call find_model(handle, model, status)
        if (status%code == 0) call check_actuators(model%scene, status)
        if (status%code == 0) call choose_solver(trim(solver), number, status)
        if (status%code == 0) call open_sweep(model%scene, from_bytes(folder), number, trim(from_bytes(keep)), sweep, status)
        if (status%code == 0) call find_sweep(sweep, run, status)
        if (status%code == 0) then
            n_sample = real(run%plan%n_sample, c_double)
            n_chunk = real(run%plan%n_chunk, c_double)
            chunk = int(run%plan%chunk, c_int)
            width = kept_width(run)
        end if
        call report_heard(status, code, message)
    end subroutine api_sweep_open

    !> Compute the next chunks. What is kept of their samples comes out, sample after sample.
    subroutine api_sweep_advance(sweep, n_chunk, threads, n_records, records, n_done, n_kept, code, message)
        !f2py threadsafe
        integer(c_int), intent(in) :: sweep
        integer(c_int), intent(in) :: n_chunk              ! at most
        integer(c_int), intent(in) :: threads
        integer(c_int), intent(in) :: n_records
        real(c_double), intent(inout), target :: records(n_records)  ! (width, samples of the chunks), room for all
        real(c_double), intent(out) :: n_done              ! chunks in all
        integer(c_int), intent(out) :: n_kept              ! samples
        integer(c_int), intent(out) :: code
        character(len=512), intent(out) :: message
        type(sweep_run), pointer :: run
        type(status_type) :: status
        real(c_double), pointer :: values(:, :)

        call start_listening()
        n_done = 0
        n_kept = 0
        call find_sweep(sweep, run, status)
        if (status%code == 0) call check_size("records", n_records, &
            max(1, kept_width(run)*n_chunk*int(run%plan%chunk)), status)
        if (status%code == 0) then
            values(1:kept_width(run), 1:n_chunk*int(run%plan%chunk)) => records
            call advance_sweep(run, n_chunk, int(threads), values, n_kept)
            n_done = real(run%n_done, c_double)
        end if
        call report_heard(status, code, message)
    end subroutine api_sweep_advance

    !> Dimensions, variables, labels of the results as JSON; text as in `api_describe_scene`.
    subroutine api_sweep_describe(sweep, capacity, text, length, code, message)
        integer(c_int), intent(in) :: sweep
        integer(c_int), intent(in) :: capacity
        integer(c_int), intent(inout) :: text(capacity)
        integer(c_int), intent(out) :: length
        integer(c_int), intent(out) :: code
        character(len=512), intent(out) :: message
        type(sweep_run), pointer :: run
        type(status_type) :: status
        type(dataset_type) :: dataset
        type(sample_variable), allocatable :: kept(:)

        length = 0
        call find_sweep(sweep, run, status)
        if (status%code == 0) then
            call sweep_dataset(run, dataset)
            allocate (kept(0))
            if (kept_width(run) > 0) call kept_variables(run, dataset, kept)
            call to_bytes(dataset_as_json(dataset, kept), text, length)
        end if
        call report(status, code, message)
    end subroutine api_sweep_describe

    !> The numbers of the results in the order of their variables.
    subroutine api_sweep_values(sweep, n_real, reals, n_integer, integers, code, message)
        integer(c_int), intent(in) :: sweep
        integer(c_int), intent(in) :: n_real, n_integer
        real(c_double), intent(inout) :: reals(n_real)
        real(c_double), intent(inout) :: integers(n_integer)   ! whole numbers, below 2**53
        integer(c_int), intent(out) :: code
        character(len=512), intent(out) :: message
        type(sweep_run), pointer :: run
        type(status_type) :: status
        type(dataset_type) :: dataset

        call find_sweep(sweep, run, status)
        if (status%code == 0) then
            call sweep_dataset(run, dataset)
            call copy_numbers(dataset, reals, integers)
        end if
        call report(status, code, message)
    end subroutine api_sweep_values

    !> Forget a sweep.
    subroutine api_sweep_close(sweep)
        integer(c_int), intent(in) :: sweep

        call close_sweep(int(sweep))
    end subroutine api_sweep_close

    !> Plan a scene and keep it.
    subroutine register_scene(scene, handle, status)
        type(scene_type), intent(in) :: scene
        integer(c_int), intent(out) :: handle
        type(status_type), intent(inout) :: status
        type(open_scene), pointer :: new
        type(scene_box), allocatable :: longer(:)

        handle = 0
        allocate (new)
        call build_model(scene, new%model, status)
        if (status%code /= 0) then
            deallocate (new)
            return
        end if
        call describe_results(new%model%scene, wanted_type(), .false., new%layout)
        !$omp critical (linkdyn_registry)
        if (.not. allocated(opened)) allocate (opened(0))
        allocate (longer(size(opened) + 1))
        longer(:size(opened)) = opened
        call move_alloc(longer, opened)
        handle = size(opened)
        opened(handle)%scene => new
        !$omp end critical (linkdyn_registry)
    end subroutine register_scene

    subroutine find_scene(handle, scene, status)
        integer(c_int), intent(in) :: handle
        type(open_scene), pointer, intent(out) :: scene
        type(status_type), intent(out) :: status

        nullify (scene)
        !$omp critical (linkdyn_registry)
        if (allocated(opened)) then
            if (handle >= 1 .and. handle <= size(opened)) scene => opened(handle)%scene
        end if
        !$omp end critical (linkdyn_registry)
        if (.not. associated(scene)) call fail(status, status_stale_handle, "this scene was closed")
    end subroutine find_scene

    subroutine find_model(handle, model, status)
        integer(c_int), intent(in) :: handle
        type(model_type), pointer, intent(out) :: model
        type(status_type), intent(out) :: status
        type(open_scene), pointer :: scene

        nullify (model)
        call find_scene(handle, scene, status)
        if (associated(scene)) model => scene%model
    end subroutine find_model

    !> The equations for a solver, planned when they are first asked for. Threads that ask at the same time may both
    !> plan; the first one's plan is kept.
    subroutine find_solver(scene, name, wants_reactions, wants_errors, wants, solver, status)
        type(open_scene), pointer, intent(in) :: scene
        character(len=*), intent(in) :: name
        logical, intent(in) :: wants_reactions, wants_errors, wants(2)    ! 2: rcond, distance
        type(inverse_solver), pointer, intent(out) :: solver
        type(status_type), intent(inout) :: status
        type(inverse_solver), pointer :: new
        type(solver_box), pointer :: box
        type(inverse_options) :: options

        nullify (solver)
        call choose_solver(name, options%solver, status)
        if (status%code /= 0) return
        options%wants_errors = wants_errors
        options%wants_rcond = wants(1)
        options%wants_distance = wants(2)
        box => scene%planned(merge(2, 1, wants_reactions), merge(2, 1, wants_errors), merge(2, 1, wants(1)), &
                             merge(2, 1, wants(2)), options%solver)
        !$omp critical (linkdyn_registry)
        solver => box%solver
        !$omp end critical (linkdyn_registry)
        if (associated(solver)) return
        call check_actuators(scene%model%scene, status)
        if (status%code /= 0) return
        allocate (new)
        call prepare_inverse(scene%model, options, wants_reactions, new, status)
        !$omp critical (linkdyn_registry)
        if (status%code == 0 .and. .not. associated(box%solver)) then
            box%solver => new
            nullify (new)
        end if
        solver => box%solver
        !$omp end critical (linkdyn_registry)
        if (.not. associated(new)) return
        call new%free()
        deallocate (new)
    end subroutine find_solver

    subroutine free_solvers(n, boxes)
        integer, intent(in) :: n
        type(solver_box), intent(inout) :: boxes(n)
        integer :: i

        do i = 1, n
            if (.not. associated(boxes(i)%solver)) cycle
            call boxes(i)%solver%free()
            deallocate (boxes(i)%solver)
        end do
    end subroutine free_solvers

    !> A load of unknown value on the marker "link.marker".
    subroutine add_load(name, scene, status)
        character(len=*), intent(in) :: name
        type(scene_type), intent(inout) :: scene
        type(status_type), intent(inout) :: status
        type(load_spec) :: load
        character(len=2*name_len), allocatable :: known(:)
        integer :: i, j

        allocate (known(0))
        do i = 1, size(scene%link)
            do j = 1, size(scene%link(i)%marker)
                known = [character(len=2*name_len) :: known, &
                    trim(scene%link(i)%name)//"."//trim(scene%link(i)%marker(j)%name)]
                if (known(size(known)) /= name) cycle
                load%name = name
                load%link = i
                load%marker = j
                scene%load = [scene%load, load]
                return
            end do
        end do
        call fail(status, status_bad_input, "wrench: no marker "//quoted(name)// &
            " on a moving link (expected ""link.marker"")"//suggestion(name, known))
    end subroutine add_load

    subroutine check_size(name, given, expected, status, wanted)
        character(len=*), intent(in) :: name
        integer, intent(in) :: given, expected
        type(status_type), intent(inout) :: status
        integer(c_int), intent(in), optional :: wanted     ! 0: any size will do

        if (present(wanted)) then
            if (wanted == 0) return
        end if
        if (given /= expected) call fail(status, status_bad_input, name//": "//to_text(given)// &
            " values given (expected "//to_text(expected)//")")
    end subroutine check_size

    !> NaN or infinite input is refused by name and place.
    subroutine check_finite(name, model, first, n, values, status)
        character(len=*), intent(in) :: name
        type(model_type), intent(in) :: model
        integer, intent(in) :: first, n
        real(c_double), intent(in) :: values(model%n_q, n)
        type(status_type), intent(inout) :: status
        integer :: i, k

        do i = 1, n
            if (all(ieee_is_finite(values(:, i)))) cycle
            do k = 1, model%n_q
                if (.not. ieee_is_finite(values(k, i))) call fail(status, status_bad_input, name//"["// &
                    to_text(first + i - 1)//", "//to_text(k - 1)//"] (coordinate "// &
                    quoted(model%scene%coordinate(k)%name)//") is not a finite number")
            end do
            return
        end do
    end subroutine check_finite

    subroutine check_finite_loads(model, first, n, values, status)
        type(model_type), intent(in) :: model
        integer, intent(in) :: first, n
        real(c_double), intent(in) :: values(6, model%n_load, n)
        type(status_type), intent(inout) :: status
        integer :: i, k

        do i = 1, n
            if (all(ieee_is_finite(values(:, :, i)))) cycle
            do k = 1, model%n_load
                if (.not. all(ieee_is_finite(values(:, k, i)))) call fail(status, status_bad_input, "wrench "// &
                    quoted(model%scene%load(k)%name)//": sample "//to_text(first + i - 1)//" is not a finite number")
            end do
            return
        end do
    end subroutine check_finite_loads

    !> The planner knows no file: put its name in front.
    subroutine name_file(file, status)
        character(len=*), intent(in) :: file
        type(status_type), intent(inout) :: status

        if (index(status%message, trim(file)//":") /= 1) status%message = trim(file)//": "//status%message
    end subroutine name_file

    !> The end of a call that listened to Ctrl-C: an interrupt that came on the way is its outcome, whatever else was found.
    subroutine report_heard(status, code, message)
        type(status_type), intent(in) :: status
        integer(c_int), intent(out) :: code
        character(len=*), intent(out) :: message

        call report(status, code, message)
        if (is_interrupted()) then
            code = status_interrupted
            message = "interrupted"
        end if
        call stop_listening()
    end subroutine report_heard

    subroutine report(status, code, message)
        type(status_type), intent(in) :: status
        integer(c_int), intent(out) :: code
        character(len=*), intent(out) :: message

        code = status%code
        message = printable(trim(status%message))
    end subroutine report

    function from_bytes(bytes) result(text)
        integer(c_int), intent(in) :: bytes(:)     ! 0 .. 255
        character(len=size(bytes)) :: text
        integer :: i

        do i = 1, size(bytes)
            text(i:i) = achar(bytes(i))
        end do
    end function from_bytes

    subroutine to_bytes(text, bytes, length)
        character(len=*), intent(in) :: text
        integer(c_int), intent(inout) :: bytes(:)
        integer(c_int), intent(out) :: length
        integer :: i

        length = len(text)
        if (length > size(bytes)) return
        do i = 1, length
            bytes(i) = iachar(text(i:i))
        end do
    end subroutine to_bytes
end module linkdyn_f2py_api
