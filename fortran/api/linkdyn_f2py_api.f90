!> Flat layer for f2py over what C and Fortran programs use, too: explicit shapes, code and message last.
!>
!> Text goes in and comes out as its bytes (UTF-8), one integer each, so that any character survives
!> and f2py need not know texts of unknown length. Batches go as flat arrays in C order (sample
!> slowest), which is Fortran order with the sample last: nothing is copied. An array that
!> is not wanted, or empty, has one element: f2py refuses none.
!> Kinds here are c_double and c_int only: f2py takes any other real kind for a C float.
module linkdyn_f2py_api
    use, intrinsic :: iso_c_binding, only: c_double, c_f_pointer, c_int, c_intptr_t, c_loc, c_null_ptr
    use, intrinsic :: iso_fortran_env, only: int64
    use linkdyn_assemblies, only: find_assemblies
    use linkdyn_assembly_words, only: assembly_list
    use linkdyn_assembly_trail, only: assembly_trail
    use linkdyn_base_motion, only: evaluate_base_pose
    use linkdyn_code_texts, only: make_code_texts
    use linkdyn_csv_writer, only: add_table_rows
    use linkdyn_dataset, only: dataset_type, sample_variable
    use linkdyn_description, only: scene_as_json, layout_as_json, dataset_as_json, assemblies_as_json
    use linkdyn_explain, only: explain_model
    use linkdyn_explain_matrix, only: explain_first_instant
    use linkdyn_event_log, only: event_log
    use linkdyn_event_sides, only: sort_by_events
    use linkdyn_ensemble, only: run_ensemble
    use linkdyn_forward, only: forward_options, choose_method, coordinates_in_words, tolerance_in_words, &
        rounding_in_words, default_method, &
        method_name, method_rk4
    use linkdyn_generate, only: code_wish, choose_kernel, choose_code_results
    use linkdyn_handles, only: close_handle
    use linkdyn_integrator, only: integrator_options
    use linkdyn_interrupt, only: is_interrupted, start_listening, stop_listening
    use linkdyn_inverse, only: inverse_options, inverse_results, inverse_solver, choose_solver, run_inverse
    use linkdyn_inverse_call, only: flat_motion, shaped, room_type, inverse_report, n_room, room_id, room_width, compute_inverse, &
        check_size, check_finite
    use linkdyn_given_attitudes, only: take_attitudes, attitude_size
    use linkdyn_heard_tables, only: refuse_short_tables
    use linkdyn_motion, only: evaluate_motion, evaluate_loads
    use linkdyn_linearization, only: linearization
    use linkdyn_motion_batch, only: motion_batch
    use linkdyn_open_run, only: open_run, start_run, take_run, leave_run
    use linkdyn_open_simulator, only: open_simulator, start_simulator, set_simulator, take_simulator, leave_simulator, &
        keep_simulator, put_simulator_back, linearize_simulator
    use linkdyn_open_scene, only: open_scene, open_scene_text, open_with_loads, take_scene, leave_scene, find_placing, layout_of
    use linkdyn_open_sweep, only: open_sweep, start_open_sweep, take_sweep, leave_sweep, advance_sweep, take_kept, copy_numbers
    use linkdyn_payloads, only: evaluate_payloads
    use linkdyn_poses, only: find_poses, poses_of_joints
    use linkdyn_report, only: open_report, read_report
    use linkdyn_results, only: block_type, wanted_type, prepare_block, choose_wanted, refuse_absent, all_wanted, add_free
    use linkdyn_result_kinds, only: result_name, result_assembly
    use linkdyn_roads, only: road_counts
    use linkdyn_scene, only: n_chamber
    use linkdyn_scene_reader, only: check_actuators
    use linkdyn_coarse_sampling, only: coarse_in_words
    use linkdyn_status, only: status_type, fail, status_bad_input, status_interrupted
    use linkdyn_sweep_results, only: sweep_dataset, kept_variables
    use linkdyn_sweep_rounds, only: kept_width, most_kept
    use linkdyn_table, only: spline_through
    use linkdyn_text, only: printable, to_text
    use linkdyn_build, only: version
    use linkdyn_code, only: choose_code, code_in_use
    use linkdyn_forward_errors, only: advance_watched, time_reached
    implicit none
    private
    public :: api_version, api_choose_code, api_code, api_default_method, api_csv_rows, api_spline
    public :: api_open, api_add_loads, api_close, api_sizes, api_describe_scene, api_assemblies
    public :: api_describe_results, api_explain, api_motion, api_frame_motion, api_payloads, api_loads, api_state_loads, &
              api_attitudes, api_sampling
    public :: api_result_names, api_inverse, api_forward, api_advance, api_events, api_event_results, api_finish, api_poses
    public :: api_ensemble, api_generate
    public :: api_simulator, api_set_simulator, api_step_simulator, api_close_simulator
    public :: api_simulator_pressures, api_linearize, api_keep_simulator, api_put_simulator_back, api_close_state
    public :: api_sweep_open, api_sweep_advance, api_sweep_kept, api_sweep_describe, api_sweep_values, api_sweep_close

contains

    subroutine api_version(text)
        character(len=32), intent(out) :: text

        text = version
    end subroutine api_version

    !> Machine code of the kernels made from now on.
    subroutine api_choose_code(name, code, message)
        character(len=*), intent(in) :: name
        integer(c_int), intent(out) :: code
        character(len=512), intent(out) :: message
        type(status_type) :: status

        call choose_code(name, status)
        call report(status, code, message)
    end subroutine api_choose_code

    !> What kernels run as, and why.
    subroutine api_code(text)
        character(len=128), intent(out) :: text

        text = code_in_use()
    end subroutine api_code

    !> Name of the method that forward runs take if nobody says one.
    subroutine api_default_method(text)
        character(len=5), intent(out) :: text

        text = method_name(default_method)
    end subroutine api_default_method

    !> Rows of a table as CSV, in the form of the program's own files.
    subroutine api_csv_rows(n_column, is_word, width, n_letters, words, n_values, values, capacity, text, length)
        integer(c_int), intent(in) :: n_column, width, n_letters, n_values
        integer(c_int), intent(in) :: is_word(n_column)
        integer(c_int), intent(in) :: words(n_letters)               ! each filled up with blanks to the width
        real(c_double), intent(in) :: values(n_values)               ! row by row; of words their places in the list
        integer(c_int), intent(in) :: capacity
        integer(c_int), intent(inout), target :: text(capacity)      ! filled with bytes, for there are many: 32 for each number,
                                                                     ! for each word twice its width and 3
        integer(c_int), intent(out) :: length                        ! in bytes
        character(len=width) :: word(n_letters/width)
        character(len=4*capacity), pointer :: buffer
        integer :: i

        do i = 1, size(word)
            word(i) = from_bytes(words((i - 1)*width + 1:i*width))
        end do
        call c_f_pointer(c_loc(text), buffer)
        length = 0
        call add_table_rows(reshape(values, [n_column, n_values/n_column]), is_word /= 0, word, buffer, length)
    end subroutine api_csv_rows

    !> Read and plan a scene given as text.
    subroutine api_open(n_text, text, n_file, file, n_folder, folder, original, handle, code, message)
        integer(c_int), intent(in) :: n_text, n_file, n_folder
        integer(c_int), intent(in) :: text(n_text)      ! the scene file
        integer(c_int), intent(in) :: file(n_file)      ! its name in messages
        integer(c_int), intent(in) :: folder(n_folder)  ! where its tables lie
        integer(c_intptr_t), intent(in) :: original     ! scene that this is with other values; 0: none
        integer(c_intptr_t), intent(out) :: handle
        integer(c_int), intent(out) :: code
        character(len=512), intent(out) :: message
        type(open_scene), pointer :: first
        type(status_type) :: status

        handle = 0
        nullify (first)
        if (original /= 0) call take_scene(original, first, status)
        if (status%is_ok()) call open_scene_text(from_bytes(text), from_bytes(file), from_bytes(folder), handle, status, first)
        call leave_scene(original, first)
        call report(status, code, message)
    end subroutine api_open

    !> A second scene: the first one with loads at more markers, given as "link.marker" lines.
    subroutine api_add_loads(handle, n_names, names, new_handle, code, message)
        integer(c_intptr_t), intent(in) :: handle
        integer(c_int), intent(in) :: n_names
        integer(c_int), intent(in) :: names(n_names)
        integer(c_intptr_t), intent(out) :: new_handle
        integer(c_int), intent(out) :: code
        character(len=512), intent(out) :: message
        type(open_scene), pointer :: scene
        type(status_type) :: status

        new_handle = 0
        call take_scene(handle, scene, status)
        if (associated(scene)) call open_with_loads(scene, from_bytes(names), new_handle, status)
        call leave_scene(handle, scene)
        call report(status, code, message)
    end subroutine api_add_loads

    !> Forget a scene.
    subroutine api_close(handle, code, message)
        integer(c_intptr_t), intent(in) :: handle
        integer(c_int), intent(out) :: code
        character(len=512), intent(out) :: message
        type(status_type) :: status

        call close_handle(handle, "scene", status)
        call report(status, code, message)
    end subroutine api_close

    !> Counts that shapes are made of.
    subroutine api_sizes(handle, n_coordinate, n_actuator, n_joint, n_component, n_variable, n_load, n_link, code, message)
        integer(c_intptr_t), intent(in) :: handle
        integer(c_int), intent(out) :: n_coordinate, n_actuator, n_joint, n_component, n_variable, n_load, n_link
        integer(c_int), intent(out) :: code
        character(len=512), intent(out) :: message
        type(open_scene), pointer :: scene
        type(status_type) :: status

        n_coordinate = 0
        n_actuator = 0
        n_joint = 0
        n_component = 0
        n_variable = 0
        n_load = 0
        n_link = 0
        call take_scene(handle, scene, status)
        if (status%is_ok()) then
            n_coordinate = scene%model%n_q
            n_actuator = scene%model%n_actuator
            n_joint = scene%model%n_joint
            n_component = scene%model%n_component
            n_variable = scene%model%n_variable
            n_load = scene%model%n_load
            n_link = scene%model%n_link
        end if
        call leave_scene(handle, scene)
        call report(status, code, message)
    end subroutine api_sizes

    !> The scene as JSON. If `length` exceeds the capacity nothing is copied: call again with room.
    subroutine api_describe_scene(handle, capacity, text, length, code, message)
        integer(c_intptr_t), intent(in) :: handle
        integer(c_int), intent(in) :: capacity
        integer(c_int), intent(inout) :: text(capacity)
        integer(c_int), intent(out) :: length
        integer(c_int), intent(out) :: code
        character(len=512), intent(out) :: message
        type(open_scene), pointer :: scene
        type(status_type) :: status

        length = 0
        call take_scene(handle, scene, status)
        if (status%is_ok()) call to_bytes(scene_as_json(scene%model), text, length)
        call leave_scene(handle, scene)
        call report(status, code, message)
    end subroutine api_describe_scene

    !> Dimensions and variables of the results as JSON; text as in `api_describe_scene`.
    subroutine api_describe_results(handle, solver, want, has_time, has_errors, capacity, text, length, code, message)
        integer(c_intptr_t), intent(in) :: handle
        character(len=*), intent(in) :: solver
        character(len=*), intent(in) :: want               ! "all" or names with commas; blank: all that the solver gives
        integer(c_int), intent(in) :: has_time             ! 1: samples are instants; 2: of a forward run
        integer(c_int), intent(in) :: has_errors           ! 1: error estimates are wanted
        integer(c_int), intent(in) :: capacity
        integer(c_int), intent(inout) :: text(capacity)
        integer(c_int), intent(out) :: length
        integer(c_int), intent(out) :: code
        character(len=512), intent(out) :: message
        type(open_scene), pointer :: scene
        type(wanted_type) :: wanted
        type(status_type) :: status
        integer :: number

        length = 0
        call take_scene(handle, scene, status)
        if (status%is_ok()) call choose_solver(trim(solver), number, status)
        if (status%is_ok() .and. len_trim(want) == 0) wanted = all_wanted(number)
        if (status%is_ok() .and. len_trim(want) > 0) call choose_wanted(want, wanted, status)
        if (status%is_ok()) call refuse_absent(want, scene%model%scene, status)
        if (status%is_ok()) call add_free(number, wanted)
        wanted%errors = has_errors == 1
        if (wanted%distance .and. has_time == 2) call refuse_distance(status)
        if (status%is_ok()) then
            call to_bytes(layout_as_json(layout_of(scene%model, wanted, has_time /= 0, has_time == 2)), text, length)
        end if
        call leave_scene(handle, scene)
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
        integer(c_intptr_t), intent(in) :: handle
        integer(c_int), intent(in) :: with_matrix          ! 1: and the equations at the first instant
        integer(c_int), intent(in) :: capacity
        integer(c_int), intent(inout) :: text(capacity)
        integer(c_int), intent(out) :: length
        integer(c_int), intent(out) :: code
        character(len=512), intent(out) :: message
        type(open_scene), pointer :: scene
        type(status_type) :: status
        character(len=:), allocatable :: written
        integer :: unit

        length = 0
        call take_scene(handle, scene, status)
        if (status%is_ok()) call open_report(unit, status)
        if (status%is_ok()) then
            call explain_model(scene%model, unit)
            if (with_matrix == 1) call explain_first_instant(scene%model, unit)
            call read_report(unit, written, status)
            if (status%is_ok()) call to_bytes(written, text, length)
        end if
        call leave_scene(handle, scene)
        call report(status, code, message)
    end subroutine api_explain

    !> All assemblies at the start as JSON; text as in `api_describe_scene`.
    subroutine api_assemblies(handle, capacity, text, length, code, message)
        integer(c_intptr_t), intent(in) :: handle
        integer(c_int), intent(in) :: capacity
        integer(c_int), intent(inout) :: text(capacity)
        integer(c_int), intent(out) :: length
        integer(c_int), intent(out) :: code
        character(len=512), intent(out) :: message
        type(open_scene), pointer :: scene
        type(assembly_list) :: list
        type(status_type) :: status

        length = 0
        call take_scene(handle, scene, status)
        if (status%is_ok()) then
            call find_assemblies(scene%model, list)
            call to_bytes(assemblies_as_json(scene%model, list), text, length)
        end if
        call leave_scene(handle, scene)
        call report(status, code, message)
    end subroutine api_assemblies

    !> Header and source of a kernel in C, with a zero between them; text as in `api_describe_scene`.
    subroutine api_generate(handle, kernel, want, n_name, name, capacity, text, length, code, message)
        integer(c_intptr_t), intent(in) :: handle
        character(len=*), intent(in) :: kernel             ! inverse, forward or kinematics
        character(len=*), intent(in) :: want               ! "all" or names with commas; blank: what the kernel is usually for
        integer(c_int), intent(in) :: n_name
        integer(c_int), intent(in) :: name(n_name)         ! of the files, without ending
        integer(c_int), intent(in) :: capacity
        integer(c_int), intent(inout) :: text(capacity)
        integer(c_int), intent(out) :: length
        integer(c_int), intent(out) :: code
        character(len=512), intent(out) :: message
        type(open_scene), pointer :: scene
        type(code_wish) :: wish
        type(status_type) :: status
        character(len=:), allocatable :: header, source

        length = 0
        call take_scene(handle, scene, status)
        if (status%is_ok()) call choose_kernel(kernel, wish%kernel, status)
        if (status%is_ok()) call choose_code_results(want, wish, status)
        if (status%is_ok()) call make_code_texts(scene%model, wish, from_bytes(name), header, source, status)
        if (status%is_ok()) call to_bytes(header//achar(0)//source, text, length)
        call leave_scene(handle, scene)
        call report(status, code, message)
    end subroutine api_generate

    !> Coordinates, their derivatives and the loads of the scene at given instants.
    subroutine api_motion(handle, n, t, n_q_values, q, qd, qdd, n_attitude, attitude, n_load_values, load, code, message)
        !f2py threadsafe
        integer(c_intptr_t), intent(in) :: handle
        integer(c_int), intent(in) :: n, n_q_values, n_attitude, n_load_values
        real(c_double), intent(in) :: t(n)                                 ! [s]
        real(c_double), intent(inout), target :: q(n_q_values), qd(n_q_values), qdd(n_q_values)  ! (n_q, n)
        real(c_double), intent(inout), target :: attitude(n_attitude)      ! as of `evaluate_motion` (10, n_attitude, n); one:
                                                                           ! unasked
        real(c_double), intent(inout), target :: load(n_load_values)       ! (6, n_load, n)
        integer(c_int), intent(out) :: code
        character(len=512), intent(out) :: message
        type(open_scene), pointer :: scene
        type(status_type) :: status
        type(flat_motion) :: given
        type(motion_batch) :: motion
        real(c_double), pointer :: attitude3(:, :, :)

        call take_scene(handle, scene, status)
        if (status%is_ok()) call check_size("q", int(n_q_values, int64), scene%model%n_q, n, status)
        if (status%is_ok() .and. n_attitude > 1) call check_size("attitude", int(n_attitude, int64), &
                                                                 attitude_size*scene%model%n_attitude, n, status)
        if (status%is_ok()) call check_size("load", int(used(n_load_values, 6*scene%model%n_load), int64), &
                                            6*scene%model%n_load, n, status)
        if (status%is_ok()) call refuse_short_tables(scene%heard, minval(t), maxval(t), "samples", status)
        if (status%is_ok()) then
            given%n = n
            given%q => q
            given%qd => qd
            given%qdd => qdd
            given%load => load(:used(n_load_values, 6*scene%model%n_load))
            motion = shaped(scene%model, given)
            if (n_attitude > 1) then
                attitude3(1:attitude_size, 1:scene%model%n_attitude, 1:n) => attitude
                call evaluate_motion(scene%model, t, motion%q, motion%qd, motion%qdd, motion%load, attitude3)
            else
                call evaluate_motion(scene%model, t, motion%q, motion%qd, motion%qdd, motion%load)
            end if
        end if
        call leave_scene(handle, scene)
        call report(status, code, message)
    end subroutine api_motion

    !> Whether the samples of a motion are too far from each other, in words: see `coarse_in_words`.
    subroutine api_sampling(handle, n, t, n_q_values, q, qd, qdd, text, code, message)
        !f2py threadsafe
        integer(c_intptr_t), intent(in) :: handle
        integer(c_int), intent(in) :: n, n_q_values
        real(c_double), intent(in) :: t(n)                                 ! [s]
        real(c_double), intent(in), target :: q(n_q_values), qd(n_q_values), qdd(n_q_values)     ! (n_q, n)
        character(len=512), intent(out) :: text
        integer(c_int), intent(out) :: code
        character(len=512), intent(out) :: message
        type(open_scene), pointer :: scene
        type(status_type) :: status
        real(c_double), pointer, dimension(:, :) :: q2, qd2, qdd2

        text = ""
        call take_scene(handle, scene, status)
        if (status%is_ok()) call check_size("q", int(n_q_values, int64), scene%model%n_q, n, status)
        if (status%is_ok()) then
            q2(1:scene%model%n_q, 1:n) => q
            qd2(1:scene%model%n_q, 1:n) => qd
            qdd2(1:scene%model%n_q, 1:n) => qdd
            text = coarse_in_words(scene%model, t, q2, qd2, qdd2)
        end if
        call leave_scene(handle, scene)
        call report(status, code, message)
    end subroutine api_sampling

    !> Attitudes that are known as quaternions, with angular velocity and acceleration, as coordinates: see `take_attitudes`.
    subroutine api_attitudes(handle, n, n_attitude, attitude, n_q_values, q, qd, qdd, code, message)
        !f2py threadsafe
        integer(c_intptr_t), intent(in) :: handle
        integer(c_int), intent(in) :: n, n_attitude, n_q_values
        real(c_double), intent(inout), target :: attitude(n_attitude)      ! (10, n_attitude, n)
        real(c_double), intent(inout), target :: q(n_q_values), qd(n_q_values), qdd(n_q_values)  ! (n_q, n)
        integer(c_int), intent(out) :: code
        character(len=512), intent(out) :: message
        type(open_scene), pointer :: scene
        type(status_type) :: status
        type(flat_motion) :: given
        type(motion_batch) :: motion
        real(c_double), pointer :: attitude3(:, :, :)

        call take_scene(handle, scene, status)
        if (status%is_ok()) call check_size("attitude", int(used(n_attitude, scene%model%n_attitude), int64), &
                                            attitude_size*scene%model%n_attitude, n, status)
        if (status%is_ok()) call check_size("q", int(n_q_values, int64), scene%model%n_q, n, status)
        if (status%is_ok()) then
            given%n = n
            given%q => q
            given%qd => qd
            given%qdd => qdd
            motion = shaped(scene%model, given)
            attitude3(1:attitude_size, 1:scene%model%n_attitude, 1:n) => attitude
            call take_attitudes(scene%model, attitude3, motion%q, motion%qd, motion%qdd)
        end if
        call leave_scene(handle, scene)
        call report(status, code, message)
    end subroutine api_attitudes

    !> The spline that a table of a scene has through these knots, and its first two derivatives, at instants within them.
    subroutine api_spline(n_knot, time, knot, n, t, value, rate, acceleration)
        !f2py threadsafe
        integer(c_int), intent(in) :: n_knot, n
        real(c_double), intent(in) :: time(n_knot), knot(n_knot)           ! time [s] increases; two knots at least
        real(c_double), intent(in) :: t(n)                                 ! [s]
        real(c_double), intent(inout) :: value(n), rate(n), acceleration(n)

        call spline_through(time, knot, t, value, rate, acceleration)
    end subroutine api_spline

    !> How the frame moves: x y z roll pitch yaw with their derivatives.
    subroutine api_frame_motion(handle, n, t, n_pose_values, pose, code, message)
        !f2py threadsafe
        integer(c_intptr_t), intent(in) :: handle
        integer(c_int), intent(in) :: n, n_pose_values
        real(c_double), intent(in) :: t(n)                                 ! [s]
        real(c_double), intent(inout), target :: pose(n_pose_values)       ! (6, 3, n)
        integer(c_int), intent(out) :: code
        character(len=512), intent(out) :: message
        type(open_scene), pointer :: scene
        type(status_type) :: status
        real(c_double), pointer :: pose3(:, :, :)

        call take_scene(handle, scene, status)
        if (status%is_ok()) call check_size("pose", int(n_pose_values, int64), 18, n, status)
        if (status%is_ok()) then
            pose3(1:6, 1:3, 1:n) => pose
            call evaluate_base_pose(scene%model, t, pose3)
        end if
        call leave_scene(handle, scene)
        call report(status, code, message)
    end subroutine api_frame_motion

    !> Masses of the payloads.
    subroutine api_payloads(handle, n, t, n_mass_values, mass, code, message)
        !f2py threadsafe
        integer(c_intptr_t), intent(in) :: handle
        integer(c_int), intent(in) :: n, n_mass_values
        real(c_double), intent(in) :: t(n)                                 ! [s]
        real(c_double), intent(inout), target :: mass(n_mass_values)       ! (n_payload, n) [kg]
        integer(c_int), intent(out) :: code
        character(len=512), intent(out) :: message
        type(open_scene), pointer :: scene
        type(status_type) :: status
        real(c_double), pointer :: mass2(:, :)

        call take_scene(handle, scene, status)
        if (status%is_ok()) call check_size("mass", int(used(n_mass_values, size(scene%model%payload)), int64), &
                                            size(scene%model%payload), n, status)
        if (status%is_ok()) then
            mass2(1:size(scene%model%payload), 1:n) => mass
            call evaluate_payloads(scene%model, t, mass2)
        end if
        call leave_scene(handle, scene)
        call report(status, code, message)
    end subroutine api_payloads

    !> The loads of the scene alone.
    subroutine api_loads(handle, n, t, n_load_values, load, code, message)
        !f2py threadsafe
        integer(c_intptr_t), intent(in) :: handle
        integer(c_int), intent(in) :: n, n_load_values
        real(c_double), intent(in) :: t(n)                                 ! [s]
        real(c_double), intent(inout), target :: load(n_load_values)       ! (6, n_load, n)
        integer(c_int), intent(out) :: code
        character(len=512), intent(out) :: message
        type(open_scene), pointer :: scene
        type(status_type) :: status
        real(c_double), pointer :: load3(:, :, :)

        call take_scene(handle, scene, status)
        if (status%is_ok()) call check_size("load", int(used(n_load_values, 6*scene%model%n_load), int64), &
                                            6*scene%model%n_load, n, status)
        if (status%is_ok()) then
            load3(1:6, 1:scene%model%n_load, 1:n) => load
            call evaluate_loads(scene%model, t, load3)
        end if
        call leave_scene(handle, scene)
        call report(status, code, message)
    end subroutine api_loads

    !> Loads with those that follow the state of the mechanism.
    subroutine api_state_loads(handle, in_order, n, n_q_values, q, qd, t, n_load_values, load, code, message)
        !f2py threadsafe
        integer(c_intptr_t), intent(in) :: handle
        integer(c_int), intent(in) :: in_order             ! 1: the samples follow each other, so does the assembly
        integer(c_int), intent(in) :: n, n_q_values, n_load_values
        real(c_double), intent(in), target :: q(n_q_values), qd(n_q_values)    ! (n_q, n)
        real(c_double), intent(in) :: t(n)                                     ! [s]
        real(c_double), intent(inout), target :: load(n_load_values)           ! (6, n_load, n) those of time, with the others
                                                                               ! behind
        integer(c_int), intent(out) :: code
        character(len=512), intent(out) :: message
        type(open_scene), pointer :: scene
        type(status_type) :: status
        real(c_double), pointer, contiguous :: q2(:, :), qd2(:, :), load3(:, :, :)
        real(c_double), allocatable :: of_time(:, :, :)
        type(inverse_results) :: results
        type(inverse_options) :: options

        call take_scene(handle, scene, status)
        if (status%is_ok()) call check_size("q", int(used(n_q_values, scene%model%n_q), int64), scene%model%n_q, n, status)
        if (status%is_ok()) call check_size("load", int(used(n_load_values, 6*scene%model%n_load), int64), &
                                            6*scene%model%n_load, n, status)
        if (status%is_ok()) then
            options%wants_forces = .false.
            options%in_order = in_order == 1
            q2(1:scene%model%n_q, 1:n) => q
            qd2(1:scene%model%n_q, 1:n) => qd
            load3(1:6, 1:scene%model%n_load, 1:n) => load
            allocate (of_time, mold=load3)
            call evaluate_loads(scene%model, t, of_time)
            results%load => load3
            call run_inverse(scene%model, options, q2, qd2, 0*q2, of_time, results, status, t)
        end if
        call leave_scene(handle, scene)
        call report(status, code, message)
    end subroutine api_state_loads

    !> Names of the results of inverse dynamics, in the order in which `api_inverse` takes their places.
    subroutine api_result_names(names, n)
        character(len=2048), intent(out) :: names          ! with blanks between them
        integer(c_int), intent(out) :: n
        integer :: i

        names = ""
        do i = 1, n_room
            names = trim(names)//" "//result_name(room_id(i))
        end do
        n = n_room
    end subroutine api_result_names

    !> Inverse dynamics of a batch. Where results go is said by addresses, so that there may be any number of them.
    subroutine api_inverse(handle, solver, threads, first, in_order, n_place, place, n, n_q_values, q, qd, qdd, &
            n_load_values, load, n_t, t, n_attitude, attitude, sample_status, roads, n_passed, lost_sample, &
            lost_in_words, code, message)
        !f2py threadsafe
        integer(c_intptr_t), intent(in) :: handle
        character(len=*), intent(in) :: solver
        integer(c_int), intent(in) :: threads
        integer(c_int), intent(in) :: first                ! number of the first sample in messages, from 0
        integer(c_int), intent(in) :: in_order             ! 1: the samples follow each other, so does the assembly
        integer(c_int), intent(in) :: n_place
        integer(c_intptr_t), intent(in) :: place(n_place)  ! of arrays of doubles, of integers for the assembly, each with room for
                                                           ! `room_width` numbers a sample; 0: a result is not wanted
        integer(c_int), intent(in) :: n                    ! samples
        integer(c_int), intent(in) :: n_q_values, n_load_values, n_t, n_attitude
        real(c_double), intent(in), target :: q(n_q_values), qd(n_q_values), qdd(n_q_values)     ! (n_q, n)
        real(c_double), intent(in), target :: load(n_load_values)                                ! (6, n_load, n); one of them: all
        real(c_double), intent(in), target :: t(n_t)                                             ! instants (n); one of them: all
        real(c_double), intent(in), target :: attitude(n_attitude)                               ! of `take_attitudes`; one 0: none
        integer(c_int), intent(inout), target :: sample_status(n)
        integer(c_int), intent(out) :: roads(3)            ! samples closed in closed form, by iteration; handed to the dense solver
        integer(c_int), intent(out) :: n_passed            ! change points, where the samples follow each other
        integer(c_int), intent(out) :: lost_sample         ! the first to which the assembly was not followed, from 1; 0: none
        character(len=512), intent(out) :: lost_in_words   ! why
        integer(c_int), intent(out) :: code
        character(len=512), intent(out) :: message
        type(open_scene), pointer :: scene
        type(status_type) :: status
        type(inverse_options) :: options
        type(flat_motion) :: given
        type(inverse_report) :: found
        type(room_type) :: room(n_room)
        integer :: i

        call start_listening()
        call take_scene(handle, scene, status)
        if (status%is_ok()) call choose_solver(trim(solver), options%solver, status)
        if (status%is_ok() .and. n_place /= n_room) call fail(status, status_bad_input, &
            to_text(n_place)//" places are given (expected one for each of the "//to_text(n_room)//" results)")
        if (status%is_ok()) then
            options%threads = threads
            options%in_order = in_order == 1
            do i = 1, n_room
                if (place(i) /= 0) call open_room(place(i), room_id(i), room_width(scene%model, room_id(i))*int(n, c_intptr_t), &
                                                  room(i))
            end do
            given%n = n
            given%first = first
            given%q => q
            given%qd => qd
            given%qdd => qdd
            given%load => load(:used(n_load_values, 6*scene%model%n_load))
            given%t => t
            given%attitude => attitude(:used(n_attitude, scene%model%n_attitude))
            call compute_inverse(scene, options, given, room, sample_status, found, status)
        end if
        roads = [found%roads%closed, found%roads%iterated, found%roads%dense]
        n_passed = found%n_passed
        lost_sample = found%lost_sample
        lost_in_words = found%lost_in_words
        call leave_scene(handle, scene)
        call report_heard(status, code, message)
    end subroutine api_inverse

    !> Let a result go to an address.
    subroutine open_room(address, id, length, room)
        integer(c_intptr_t), intent(in) :: address
        integer, intent(in) :: id                          ! one of `room_id`
        integer(c_intptr_t), intent(in) :: length          ! numbers
        type(room_type), intent(inout) :: room

        if (id == result_assembly) then
            call c_f_pointer(transfer(address, c_null_ptr), room%integer, [length])
        else
            call c_f_pointer(transfer(address, c_null_ptr), room%real, [length])
        end if
    end subroutine open_room

    !> Start a forward run. It goes on by api_advance and must be ended by api_finish.
    subroutine api_forward(handle, method, solver, threads, step, rtol, atol, switches, want, has_errors, t_start, t_end, &
            run_handle, code, message)
        !f2py threadsafe
        integer(c_intptr_t), intent(in) :: handle
        character(len=*), intent(in) :: method, solver
        integer(c_int), intent(in) :: threads
        real(c_double), intent(in) :: step, rtol, atol
        integer(c_int), intent(in) :: switches             ! 1: coordinates are exchanged at their dead points
        character(len=*), intent(in) :: want               ! "all" or names with commas
        integer(c_int), intent(in) :: has_errors           ! 1: error estimates are wanted
        real(c_double), intent(in) :: t_start, t_end       ! [s]
        integer(c_intptr_t), intent(out) :: run_handle
        integer(c_int), intent(out) :: code
        character(len=512), intent(out) :: message
        type(open_scene), pointer :: scene
        type(status_type) :: status
        type(forward_options) :: options
        type(wanted_type) :: wanted

        run_handle = 0
        call take_scene(handle, scene, status)
        if (status%is_ok()) then                         ! the first failure stays
            call choose_method(trim(method), options%integrator%method, status)
            call choose_solver(trim(solver), options%solver, status)
            if (status%is_ok() .and. len_trim(want) == 0) wanted = all_wanted(options%solver)
            if (status%is_ok() .and. len_trim(want) > 0) call choose_wanted(trim(want), wanted, status)
            if (status%is_ok()) call refuse_absent(want, scene%model%scene, status)
            if (status%is_ok()) call add_free(options%solver, wanted)
            options%integrator%step = step
            options%integrator%rtol = rtol
            options%integrator%atol = atol
            options%t_start = t_start
            options%integrator%span = t_end - t_start
            options%switches = switches == 1
            options%listens = .true.
            options%sees_events = .true.
            options%threads = threads
            options%wants_reactions = wanted%reaction
            options%wants_rcond = wanted%rcond
            wanted%errors = has_errors == 1
        end if
        if (status%is_ok()) then
            options%shared => scene%shared
            call start_run(scene%model, options, wanted, run_handle, status)
        end if
        call leave_scene(handle, scene)
        call report(status, code, message)
    end subroutine api_forward

    !> Go on through some instants, for a time; the rest of the arrays is left alone.
    subroutine api_advance(run_handle, n, t, seconds, n_values, values, n_numbers, numbers, n_done, reached, statistics, roads, &
            n_passed, tolerance, rounding, stopped, coordinates, n_event, is_over, code, message)
        !f2py threadsafe
        integer(c_intptr_t), intent(in) :: run_handle
        integer(c_int), intent(in) :: n, n_values, n_numbers
        real(c_double), intent(in) :: t(n)                 ! instants of output, increasing [s]
        real(c_double), intent(in) :: seconds              ! of computing time, about
        real(c_double), intent(inout) :: values(n_values)  ! real variable after real variable, n samples each
        integer(c_int), intent(inout) :: numbers(n_numbers)  ! the same of the whole numbers
        integer(c_int), intent(out) :: n_done
        real(c_double), intent(out) :: reached             ! [s]
        integer(c_int), intent(out) :: statistics(3)       ! steps, rejected steps, right-hand sides
        integer(c_int), intent(out) :: roads(3)            ! of these instants, as in `api_inverse`
        integer(c_int), intent(out) :: n_passed            ! change points, since the start
        character(len=256), intent(out) :: tolerance       ! of a step; blank of a fixed one
        character(len=256), intent(out) :: rounding        ! what it left of the tolerances; blank if these were met
        character(len=256), intent(out) :: stopped         ! why the run stopped early; blank if it did not
        character(len=512), intent(out) :: coordinates     ! which were integrated when; blank if none was exchanged
        integer(c_int), intent(out) :: n_event             ! that have come so far
        integer(c_int), intent(out) :: is_over             ! 1: an event has ended the run, no instant follows
        integer(c_int), intent(out) :: code
        character(len=512), intent(out) :: message
        type(open_run), pointer :: here
        type(status_type) :: status
        type(block_type) :: block
        type(road_counts) :: taken
        integer :: i

        n_done = 0
        reached = 0
        statistics = 0
        roads = 0
        n_passed = 0
        tolerance = ""
        rounding = ""
        stopped = ""
        coordinates = ""
        n_event = 0
        is_over = 0
        call take_run(run_handle, here, status)
        if (status%is_ok()) then
            call prepare_block(here%watched%layout, n, block)
            call check_rows(block, n_values, n_numbers, status)
        end if
        if (status%is_ok()) then
            call advance_watched(here%watched, t, block, taken, i, seconds)
            n_done = i
            roads = [taken%closed, taken%iterated, taken%dense]
            call flatten(block, values, numbers)
            associate (integrator => here%watched%run%integrator)
                statistics = [integrator%n_step, integrator%n_rejected, integrator%n_evaluation]
            end associate
            reached = time_reached(here%watched)
            n_passed = here%watched%run%n_passed
            if (here%watched%run%has_stopped) stopped = here%watched%run%reason
            coordinates = coordinates_in_words(here%watched%run)
            tolerance = tolerance_in_words(here%watched%run)
            rounding = rounding_in_words(here%watched%run)
            n_event = here%watched%run%system%way%log%n
            if (here%watched%run%is_over .and. here%watched%n_pending == 0) is_over = 1
        end if
        call leave_run(run_handle, here)
        call report(status, code, message)
    end subroutine api_advance

    !> The events that have come so far.
    subroutine api_events(run_handle, n, n_values, kinds, instants, states, code, message)
        integer(c_intptr_t), intent(in) :: run_handle
        integer(c_int), intent(in) :: n, n_values
        integer(c_int), intent(inout) :: kinds(3*n)        ! number of the event, kind, direction: one event after the other
        real(c_double), intent(inout) :: instants(3*n)     ! instant [s], impulse [N s, N m s], energy lost [J]
        real(c_double), intent(inout) :: states(n_values)  ! coordinates, their rates before and behind (n_q, 3, n)
        integer(c_int), intent(out) :: code
        character(len=512), intent(out) :: message
        type(open_run), pointer :: here
        type(status_type) :: status
        integer :: i, n_q

        call take_run(run_handle, here, status)
        if (status%is_ok()) then
            n_q = here%model%n_q
            call check_size("states", int(n_values, int64), 3*n_q, n, status)
            if (status%is_ok() .and. n > here%watched%run%system%way%log%n) &
                call fail(status, status_bad_input, "there are fewer events than that")
        end if
        if (status%is_ok()) then
            do i = 1, n
                associate (entry => here%watched%run%system%way%log%entry(i))
                    kinds(3*i - 2:3*i) = [entry%event, entry%kind, entry%direction]
                    instants(3*i - 2:3*i) = [entry%t, entry%impulse, entry%loss]
                    states(3*n_q*(i - 1) + 1:3*n_q*i) = [entry%q, entry%qd, entry%qd_after]
                end associate
            end do
        end if
        call leave_run(run_handle, here)
        call report(status, code, message)
    end subroutine api_events

    !> Results on both sides of the events that have come so far: of each variable that jumps, in the order of the description.
    subroutine api_event_results(run_handle, n, n_values, values, n_numbers, numbers, code, message)
        integer(c_intptr_t), intent(in) :: run_handle
        integer(c_int), intent(in) :: n, n_values, n_numbers
        real(c_double), intent(inout) :: values(n_values)  ! real variable after real variable (width, side, n)
        integer(c_int), intent(inout) :: numbers(n_numbers)    ! the same of the whole numbers
        integer(c_int), intent(out) :: code
        character(len=512), intent(out) :: message
        type(open_run), pointer :: here
        type(status_type) :: status
        type(block_type) :: block

        call take_run(run_handle, here, status)
        if (status%is_ok()) then
            associate (log => here%watched%run%system%way%log, sides => here%watched%sides)
                if (n > log%n) call fail(status, status_bad_input, "there are fewer events than that")
                if (status%is_ok()) call sort_by_events(sides, log%entry(:n)%beside, block)
            end associate
        end if
        if (status%is_ok() .and. .not. allocated(block%of)) call fail(status, status_bad_input, "nobody has looked at the events")
        if (status%is_ok()) call check_rows(block, n_values, n_numbers, status)
        if (status%is_ok()) call flatten(block, values, numbers)
        call leave_run(run_handle, here)
        call report(status, code, message)
    end subroutine api_event_results

    !> A block as two rows, of its real values and its whole numbers.
    subroutine flatten(block, values, numbers)
        type(block_type), intent(in) :: block
        real(c_double), intent(inout) :: values(:)
        integer(c_int), intent(inout) :: numbers(:)
        integer :: i, place, whole_place

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
    end subroutine flatten

    !> Refuse rows that a block does not fill.
    subroutine check_rows(block, n_values, n_numbers, status)
        type(block_type), intent(in) :: block
        integer(c_int), intent(in) :: n_values, n_numbers
        type(status_type), intent(inout) :: status
        integer :: i, place, whole_place

        place = 0
        whole_place = 0
        do i = 1, size(block%of)
            if (allocated(block%of(i)%real)) place = place + size(block%of(i)%real)
            if (allocated(block%of(i)%integer)) whole_place = whole_place + size(block%of(i)%integer)
        end do
        call check_size("values", int(n_values, int64), place, 1, status)
        call check_size("numbers", int(n_numbers, int64), whole_place, 1, status)
    end subroutine check_rows

    !> End a run; nothing happens to one that was ended before.
    subroutine api_finish(run_handle)
        integer(c_intptr_t), intent(in) :: run_handle
        type(status_type) :: status

        call close_handle(run_handle, "run", status)
    end subroutine api_finish

    !> A simulator of a scene, at its start. It must be closed by api_close_simulator.
    subroutine api_simulator(handle, method, step, rtol, atol, t, simulator_handle, code, message)
        !f2py threadsafe
        integer(c_intptr_t), intent(in) :: handle
        character(len=*), intent(in) :: method
        real(c_double), intent(in) :: step, rtol, atol
        real(c_double), intent(in) :: t                    ! [s]
        integer(c_intptr_t), intent(out) :: simulator_handle
        integer(c_int), intent(out) :: code
        character(len=512), intent(out) :: message
        type(open_scene), pointer :: scene
        type(status_type) :: status
        type(integrator_options) :: options

        simulator_handle = 0
        call take_scene(handle, scene, status)
        if (status%is_ok()) call choose_method(trim(method), options%method, status)
        options%step = step
        options%rtol = rtol
        options%atol = atol
        if (status%is_ok()) call start_simulator(scene%model, options, t, simulator_handle, status)
        call leave_scene(handle, scene)
        call report(status, code, message)
    end subroutine api_simulator

    !> Put the mechanism somewhere else; without pressures, with those by which a run would begin.
    subroutine api_set_simulator(simulator_handle, t, n_q, q, n_qd, qd, has_pressure, n_pressure, pressure, code, message)
        !f2py threadsafe
        integer(c_intptr_t), intent(in) :: simulator_handle
        integer(c_int), intent(in) :: n_q, n_qd, n_pressure
        integer(c_int), intent(in) :: has_pressure         ! 0: none is given
        real(c_double), intent(in) :: t                    ! [s]
        real(c_double), intent(in) :: q(n_q), qd(n_qd)
        real(c_double), intent(in) :: pressure(n_pressure) ! in head and rod chamber of each cylinder [Pa]
        integer(c_int), intent(out) :: code
        character(len=512), intent(out) :: message
        type(open_simulator), pointer :: here
        type(status_type) :: status

        call take_simulator(simulator_handle, here, status)
        if (status%is_ok()) call check_size("q", int(n_q, int64), here%is%model%n_q, 1, status)
        if (status%is_ok()) call check_size("qd", int(n_qd, int64), here%is%model%n_q, 1, status)
        if (status%is_ok() .and. has_pressure /= 0) &
            call check_size("pressure", int(n_pressure, int64), here%is%n_cylinder(), n_chamber, status)
        if (status%is_ok() .and. has_pressure /= 0) then
            call set_simulator(here, t, q, qd, status, reshape(pressure, [n_chamber, here%is%n_cylinder()]))
        else if (status%is_ok()) then
            call set_simulator(here, t, q, qd, status)
        end if
        call leave_simulator(simulator_handle, here)
        call report(status, code, message)
    end subroutine api_set_simulator

    !> Go on to an instant under given forces, or as far as a quarter of a second leads, and tell where the mechanism is then; an
    !> instant that is reached already: only tell. So short a call need not listen to Ctrl-C itself.
    subroutine api_step_simulator(simulator_handle, t_end, n_force, force, n_q, q, n_qd, qd, t, code, message)
        !f2py threadsafe
        integer(c_intptr_t), intent(in) :: simulator_handle
        integer(c_int), intent(in) :: n_force, n_q, n_qd
        real(c_double), intent(in) :: t_end                ! [s]
        real(c_double), intent(in) :: force(n_force)       ! of the actuators
        real(c_double), intent(inout) :: q(n_q), qd(n_qd)
        real(c_double), intent(out) :: t                   ! [s]
        integer(c_int), intent(out) :: code
        character(len=512), intent(out) :: message
        type(open_simulator), pointer :: here
        type(status_type) :: status

        t = 0
        call take_simulator(simulator_handle, here, status)
        if (status%is_ok()) call check_size("force", int(n_force, int64), here%is%model%n_actuator, 1, status)
        if (status%is_ok()) call check_size("q", int(n_q, int64), here%is%model%n_q, 1, status)
        if (status%is_ok()) call check_size("qd", int(n_qd, int64), here%is%model%n_q, 1, status)
        if (status%is_ok()) then
            if (is_ahead(here)) call here%is%step(t_end, force, status)
            if (allocated(here%is%integrator)) call here%is%read(t, q, qd)
        end if
        call leave_simulator(simulator_handle, here)
        call report(status, code, message)

    contains

        !> Or nowhere, which the step will say.
        logical function is_ahead(here)
            type(open_simulator), intent(in) :: here

            is_ahead = .not. allocated(here%is%integrator)
            if (.not. is_ahead) is_ahead = t_end > here%is%integrator%t
        end function is_ahead
    end subroutine api_step_simulator

    !> Pressures in head and rod chamber of each cylinder of a simulator.
    subroutine api_simulator_pressures(simulator_handle, n_pressure, pressure, code, message)
        integer(c_intptr_t), intent(in) :: simulator_handle
        integer(c_int), intent(in) :: n_pressure
        real(c_double), intent(inout) :: pressure(n_pressure)      ! [Pa]
        integer(c_int), intent(out) :: code
        character(len=512), intent(out) :: message
        type(open_simulator), pointer :: here
        type(status_type) :: status
        real(c_double), allocatable :: found(:, :)

        call take_simulator(simulator_handle, here, status)
        if (status%is_ok()) call check_size("pressure", int(n_pressure, int64), here%is%n_cylinder(), n_chamber, status)
        if (status%is_ok()) then
            allocate (found(n_chamber, here%is%n_cylinder()))
            call here%is%read_pressures(found, status)
            if (status%is_ok()) pressure(:size(found)) = reshape(found, [size(found)])
        end if
        call leave_simulator(simulator_handle, here)
        call report(status, code, message)
    end subroutine api_simulator_pressures

    !> How accelerations and joint variables of a simulator's mechanism change where it stands. Efforts are what its actuators are
    !> told; with follows_laws those become it that have laws in the scene. Values: accelerations, joint variables, their rates;
    !> columns: of these, one after the other, by coordinates, their rates and efforts.
    subroutine api_linearize(simulator_handle, follows_laws, n_effort, effort, n_value, value, n_column, column, code, message)
        !f2py threadsafe
        integer(c_intptr_t), intent(in) :: simulator_handle
        integer(c_int), intent(in) :: follows_laws         ! 0: no
        integer(c_int), intent(in) :: n_effort, n_value, n_column
        real(c_double), intent(inout) :: effort(n_effort), value(n_value), column(n_column)
        integer(c_int), intent(out) :: code
        character(len=512), intent(out) :: message
        type(open_simulator), pointer :: here
        type(linearization) :: found
        type(status_type) :: status
        integer :: n

        call take_simulator(simulator_handle, here, status)
        if (status%is_ok()) then
            associate (model => here%is%model)
                n = model%n_q + 2*model%n_variable
                call check_size("effort", int(n_effort, int64), model%n_actuator, 1, status)
                if (status%is_ok()) call check_size("value", int(n_value, int64), n, 1, status)
                if (status%is_ok()) call check_size("column", int(n_column, int64), n, 2*model%n_q + model%n_actuator, status)
            end associate
        end if
        if (status%is_ok()) call linearize_simulator(here, effort, follows_laws /= 0, found, status)
        if (status%is_ok()) then
            value = found%at
            column = reshape(found%column, [size(column)])
        end if
        call leave_simulator(simulator_handle, here)
        call report(status, code, message)
    end subroutine api_linearize

    !> Keep the state of a simulator. It must be closed by api_close_state.
    subroutine api_keep_simulator(simulator_handle, state_handle, code, message)
        integer(c_intptr_t), intent(in) :: simulator_handle
        integer(c_intptr_t), intent(out) :: state_handle
        integer(c_int), intent(out) :: code
        character(len=512), intent(out) :: message
        type(open_simulator), pointer :: here
        type(status_type) :: status

        state_handle = 0
        call take_simulator(simulator_handle, here, status)
        if (status%is_ok()) call keep_simulator(simulator_handle, here, state_handle, status)
        call leave_simulator(simulator_handle, here)
        call report(status, code, message)
    end subroutine api_keep_simulator

    !> Put a simulator back to a state that was kept of it.
    subroutine api_put_simulator_back(simulator_handle, state_handle, code, message)
        integer(c_intptr_t), intent(in) :: simulator_handle, state_handle
        integer(c_int), intent(out) :: code
        character(len=512), intent(out) :: message
        type(open_simulator), pointer :: here
        type(status_type) :: status

        call take_simulator(simulator_handle, here, status)
        if (status%is_ok()) call put_simulator_back(simulator_handle, here, state_handle, status)
        call leave_simulator(simulator_handle, here)
        call report(status, code, message)
    end subroutine api_put_simulator_back

    !> Forget a state; nothing happens to one that was forgotten before.
    subroutine api_close_state(state_handle)
        integer(c_intptr_t), intent(in) :: state_handle
        type(status_type) :: status

        call close_handle(state_handle, "state", status)
    end subroutine api_close_state

    !> End a simulator; nothing happens to one that was ended before.
    subroutine api_close_simulator(simulator_handle)
        integer(c_intptr_t), intent(in) :: simulator_handle
        type(status_type) :: status

        call close_handle(simulator_handle, "simulator", status)
    end subroutine api_close_simulator

    !> Position of the origin and rotation matrix of every moving link.
    subroutine api_poses(handle, in_order, n, n_q_values, q, n_position, position, n_rotation, rotation, sample_status, &
            code, message)
        !f2py threadsafe
        integer(c_intptr_t), intent(in) :: handle
        integer(c_int), intent(in) :: in_order             ! 1: the samples follow each other, so does the assembly;
                                                           ! 2: q holds all joint variables
        integer(c_int), intent(in) :: n, n_q_values, n_position, n_rotation
        real(c_double), intent(in), target :: q(n_q_values)                  ! (n_q, n), (n_variable, n)
        real(c_double), intent(inout), target :: position(n_position)        ! (3, n_link, n)
        real(c_double), intent(inout), target :: rotation(n_rotation)        ! (3, 3, n_link, n)
        integer(c_int), intent(inout), target :: sample_status(n)
        integer(c_int), intent(out) :: code
        character(len=512), intent(out) :: message
        type(open_scene), pointer :: scene
        type(status_type) :: status
        type(assembly_trail) :: trail
        integer :: width
        type(inverse_solver), pointer :: solver
        real(c_double), pointer, contiguous :: q2(:, :), position3(:, :, :), rotation4(:, :, :, :)

        call start_listening()
        call take_scene(handle, scene, status)
        if (status%is_ok()) width = merge(scene%model%n_variable, scene%model%n_q, in_order == 2)
        if (status%is_ok()) call check_size("q", int(n_q_values, int64), width, n, status)
        if (status%is_ok()) call check_size("position", int(n_position, int64), 3*scene%model%n_link, n, status)
        if (status%is_ok()) call check_size("rotation", int(n_rotation, int64), 9*scene%model%n_link, n, status)
        if (status%is_ok() .and. in_order /= 2) call check_finite("q", scene%model, 0, n, q, status)
        if (status%is_ok() .and. in_order /= 2) call find_placing(scene, solver, status)
        if (status%is_ok()) then
            q2(1:width, 1:n) => q
            position3(1:3, 1:scene%model%n_link, 1:n) => position
            rotation4(1:3, 1:3, 1:scene%model%n_link, 1:n) => rotation
            if (in_order == 2) then
                call poses_of_joints(scene%model, q2, position3, rotation4, sample_status)
            else if (in_order == 1) then
                call find_poses(scene%model, solver, q2, position3, rotation4, sample_status, trail)
            else
                call find_poses(scene%model, solver, q2, position3, rotation4, sample_status)
            end if
        end if
        call leave_scene(handle, scene)
        call report_heard(status, code, message)
    end subroutine api_poses

    !> Forward runs by rk4 from many starts.
    subroutine api_ensemble(handle, threads, step, n_t, t, n, good_until, n_members, crossed, n_outcomes, outcome, &
            n_start, q_start, n_start_rate, qd_start, n_q_values, q, n_qd_values, qd, n_kinds, kinds, n_instants, instants, &
            n_states, states, n_event, reason, code, message)
        !f2py threadsafe
        integer(c_intptr_t), intent(in) :: handle
        integer(c_int), intent(in) :: threads
        real(c_double), intent(in) :: step
        integer(c_int), intent(in) :: n_t, n, n_members, n_outcomes, n_start, n_start_rate, n_q_values, n_qd_values
        integer(c_int), intent(in) :: n_kinds, n_instants, n_states
        real(c_double), intent(in) :: t(n_t)                                 ! increasing; the members start at the first [s]
        real(c_double), intent(inout) :: good_until(n)
        integer(c_int), intent(inout) :: crossed(n_members)                  ! change points passed
        integer(c_int), intent(inout) :: outcome(n_outcomes)                 ! why they stopped; 0: they have not
        real(c_double), intent(in), target :: q_start(n_start), qd_start(n_start_rate)     ! (n_q, n)
        real(c_double), intent(inout), target :: q(n_q_values), qd(n_qd_values)            ! (n_q, n_t, n)
        integer(c_int), intent(inout) :: kinds(n_kinds)                      ! of events: member, event, kind, direction, one after
                                                                             ! the other as far as there is room
        real(c_double), intent(inout) :: instants(n_instants)                ! instant [s], impulse, energy lost of each
        real(c_double), intent(inout) :: states(n_states)                    ! coordinates, their rates before and behind
        integer(c_int), intent(out) :: n_event                               ! in all, more than there is room for perhaps
        character(len=512), intent(out) :: reason                            ! why steps are too long; blank: nobody says so
        integer(c_int), intent(out) :: code
        character(len=512), intent(out) :: message
        type(open_scene), pointer :: scene
        type(status_type) :: status
        type(forward_options) :: options
        type(event_log) :: log
        character(len=:), allocatable :: told
        integer :: i, n_q
        real(c_double), pointer :: q_start2(:, :), qd_start2(:, :), q3(:, :, :), qd3(:, :, :)

        reason = ""
        n_event = 0
        call start_listening()
        call take_scene(handle, scene, status)
        if (status%is_ok()) call check_size("room for change points", int(n_members, int64), 1, n, status)
        if (status%is_ok()) call check_size("room for outcomes", int(n_outcomes, int64), 1, n, status)
        if (status%is_ok()) call check_size("q", int(n_start, int64), scene%model%n_q, n, status)
        if (status%is_ok()) call check_size("qd", int(n_start_rate, int64), scene%model%n_q, n, status)
        if (status%is_ok()) call check_size("room for q", int(n_q_values, int64), scene%model%n_q*n_t, n, status)
        if (status%is_ok()) call check_size("room for qd", int(n_qd_values, int64), scene%model%n_q*n_t, n, status)
        if (status%is_ok()) call check_finite("q", scene%model, 0, n, q_start, status)
        if (status%is_ok()) call check_finite("qd", scene%model, 0, n, qd_start, status)
        if (status%is_ok()) then
            q_start2(1:scene%model%n_q, 1:n) => q_start
            qd_start2(1:scene%model%n_q, 1:n) => qd_start
            q3(1:scene%model%n_q, 1:n_t, 1:n) => q
            qd3(1:scene%model%n_q, 1:n_t, 1:n) => qd
            options%integrator%method = method_rk4
            options%integrator%step = step
            options%t_start = t(1)
            options%integrator%span = t(n_t) - t(1)
            options%threads = threads
            options%shared => scene%shared
            call run_ensemble(scene%model, options, q_start2, qd_start2, t, q3, qd3, good_until, crossed, outcome, status, log, &
                              told)
            reason = told
            n_event = log%n
            n_q = scene%model%n_q
            do i = 1, min(log%n, n_kinds/4, n_instants/3, n_states/(3*n_q))
                associate (entry => log%entry(i))
                    kinds(4*i - 3:4*i) = [entry%lane, entry%event, entry%kind, entry%direction]
                    instants(3*i - 2:3*i) = [entry%t, entry%impulse, entry%loss]
                    states(3*n_q*(i - 1) + 1:3*n_q*i) = [entry%q, entry%qd, entry%qd_after]
                end associate
            end do
        end if
        call leave_scene(handle, scene)
        call report_heard(status, code, message)
    end subroutine api_ensemble

    !> Plan the sweep of a scene, and go on where an earlier run stands. It is advanced, read and closed by its own handle.
    subroutine api_sweep_open(handle, n_folder, folder, solver, n_keep, keep, threads, n_output, output, resumes, interval, sweep, &
                              n_sample, n_done, chunk, width, n_next, code, message)
        integer(c_intptr_t), intent(in) :: handle
        integer(c_int), intent(in) :: n_folder, n_keep, n_output
        integer(c_int), intent(in) :: folder(n_folder)     ! where the scene's tables lie
        character(len=*), intent(in) :: solver
        integer(c_int), intent(in) :: keep(n_keep)         ! quantities kept of every sample, with commas; blank: the scene's
        integer(c_int), intent(in) :: threads
        integer(c_int), intent(in) :: output(n_output)     ! file for which the results are; blank: none
        integer(c_int), intent(in) :: resumes              ! not 0: an interrupted run kept there is gone on with
        real(c_double), intent(in) :: interval             ! seconds between two checkpoints
        integer(c_intptr_t), intent(out) :: sweep
        real(c_double), intent(out) :: n_sample, n_done    ! samples in all, chunks that are done; whole numbers, below 2**53
        integer(c_int), intent(out) :: chunk               ! samples of a chunk at most
        integer(c_int), intent(out) :: width               ! values kept of a sample; 0: none
        integer(c_int), intent(out) :: n_next              ! chunks of the next round at most
        integer(c_int), intent(out) :: code
        character(len=512), intent(out) :: message
        type(open_scene), pointer :: scene
        type(open_sweep), pointer :: open
        type(status_type) :: status
        integer :: number

        call start_listening()
        sweep = 0
        n_sample = 0
        n_done = 0
        chunk = 0
        width = 0
        n_next = 0
        nullify (open)
        call take_scene(handle, scene, status)
        if (status%is_ok()) call check_actuators(scene%model%scene, status)
        if (status%is_ok()) call choose_solver(trim(solver), number, status)
        if (status%is_ok()) call start_open_sweep(scene%model%scene, from_bytes(folder), number, trim(from_bytes(keep)), &
            int(threads), trim(from_bytes(output)), resumes /= 0, interval, sweep, status)
        if (status%is_ok()) call take_sweep(sweep, open, status)
        if (status%is_ok()) then
            n_sample = real(open%run%plan%n_sample, c_double)
            n_done = real(open%run%n_done, c_double)
            chunk = int(open%run%plan%chunk, c_int)
            width = kept_width(open%run)
            n_next = open%rounds%n_next
        end if
        call leave_scene(handle, scene)
        call leave_sweep(sweep, open)
        call report_heard(status, code, message)
    end subroutine api_sweep_open

    !> Compute the next round of chunks. What is kept of their samples comes out, sample after sample, unless the results are for a
    !> file.
    subroutine api_sweep_advance(sweep, threads, n_records, records, is_over, n_done, n_kept, n_next, code, message)
        !f2py threadsafe
        integer(c_intptr_t), intent(in) :: sweep
        integer(c_int), intent(in) :: threads
        integer(c_int), intent(in) :: n_records
        real(c_double), intent(inout), target :: records(n_records)  ! (width, samples of a round), room for all
        integer(c_int), intent(out) :: is_over             ! 1: all is computed
        real(c_double), intent(out) :: n_done              ! chunks in all
        integer(c_int), intent(out) :: n_kept              ! samples
        integer(c_int), intent(out) :: n_next              ! chunks of the next round at most
        integer(c_int), intent(out) :: code
        character(len=512), intent(out) :: message
        type(open_sweep), pointer :: open
        type(status_type) :: status
        real(c_double), pointer :: values(:, :)
        integer :: width, most

        call start_listening()
        is_over = 0
        n_done = 0
        n_kept = 0
        n_next = 0
        call take_sweep(sweep, open, status)
        if (status%is_ok()) then
            width = merge(0, kept_width(open%run), allocated(open%rounds%output))
            most = int(most_kept(open%run, open%rounds))
            call check_size("records", int(used(n_records, width*most), int64), width, most, status)
        end if
        if (status%is_ok()) then
            values(1:width, 1:most) => records
            call advance_sweep(open, int(threads), values, n_kept, status)
            n_done = real(open%run%n_done, c_double)
            n_next = open%rounds%n_next
            if (open%run%n_done == open%run%plan%n_chunk) is_over = 1
        end if
        call leave_sweep(sweep, open)
        call report_heard(status, code, message)
    end subroutine api_sweep_advance

    !> Samples kept for the file of the results.
    subroutine api_sweep_kept(sweep, first, width, n, records, code, message)
        !f2py threadsafe
        integer(c_intptr_t), intent(in) :: sweep
        real(c_double), intent(in) :: first                ! a whole number, from 0
        integer(c_int), intent(in) :: width, n
        real(c_double), intent(inout) :: records(width, n)
        integer(c_int), intent(out) :: code
        character(len=512), intent(out) :: message
        type(open_sweep), pointer :: open
        type(status_type) :: status

        call take_sweep(sweep, open, status)
        if (status%is_ok()) then
            if (width /= kept_width(open%run)) call fail(status, status_bad_input, "records have another width")
            if (status%is_ok()) call take_kept(open, int(first, int64), records, status)
        end if
        call leave_sweep(sweep, open)
        call report(status, code, message)
    end subroutine api_sweep_kept

    !> Dimensions, variables, labels of the results as JSON; text as in `api_describe_scene`.
    subroutine api_sweep_describe(sweep, capacity, text, length, code, message)
        integer(c_intptr_t), intent(in) :: sweep
        integer(c_int), intent(in) :: capacity
        integer(c_int), intent(inout) :: text(capacity)
        integer(c_int), intent(out) :: length
        integer(c_int), intent(out) :: code
        character(len=512), intent(out) :: message
        type(open_sweep), pointer :: open
        type(status_type) :: status
        type(dataset_type) :: dataset
        type(sample_variable), allocatable :: kept(:)

        length = 0
        call take_sweep(sweep, open, status)
        if (status%is_ok()) then
            call sweep_dataset(open%run, dataset)
            allocate (kept(0))
            if (kept_width(open%run) > 0) call kept_variables(open%run, dataset, kept)
            call to_bytes(dataset_as_json(dataset, kept), text, length)
        end if
        call leave_sweep(sweep, open)
        call report(status, code, message)
    end subroutine api_sweep_describe

    !> The numbers of the results in the order of their variables.
    subroutine api_sweep_values(sweep, n_real, reals, n_integer, integers, code, message)
        integer(c_intptr_t), intent(in) :: sweep
        integer(c_int), intent(in) :: n_real, n_integer
        real(c_double), intent(inout) :: reals(n_real)
        real(c_double), intent(inout) :: integers(n_integer)   ! whole numbers, below 2**53
        integer(c_int), intent(out) :: code
        character(len=512), intent(out) :: message
        type(open_sweep), pointer :: open
        type(status_type) :: status
        type(dataset_type) :: dataset

        call take_sweep(sweep, open, status)
        if (status%is_ok()) then
            call sweep_dataset(open%run, dataset)
            call copy_numbers(dataset, reals, integers)
        end if
        call leave_sweep(sweep, open)
        call report(status, code, message)
    end subroutine api_sweep_values

    !> Forget a sweep. One that has not come to its end is kept beside its file, if it has one.
    subroutine api_sweep_close(sweep, has_ended)
        integer(c_intptr_t), intent(in) :: sweep
        integer(c_int), intent(in) :: has_ended            ! not 0: the caller has the results
        type(open_sweep), pointer :: open
        type(status_type) :: status

        call take_sweep(sweep, open, status)
        if (status%is_ok()) open%has_ended = has_ended /= 0
        call leave_sweep(sweep, open)
        status = status_type()
        call close_handle(sweep, "sweep", status)
    end subroutine api_sweep_close

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

    !> Values of an array that f2py may have given one element because it refuses none.
    pure integer function used(given, width)
        integer, intent(in) :: given
        integer, intent(in) :: width               !! values of a sample

        used = merge(0, given, width == 0 .and. given == 1)
    end function used

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
