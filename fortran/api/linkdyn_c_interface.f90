!> What linkdyn.h declares: C's pointers become checked arrays here, status and message a code and the thread's last error.
!>
!> The names in C are others than those of modules: in Fortran both are global, and gfortran would mix them up.
module linkdyn_c_interface
    use, intrinsic :: iso_c_binding, only: c_associated, c_char, c_double, c_f_pointer, c_int, c_intptr_t, c_loc, &
        c_null_char, c_null_ptr, c_ptr, c_size_t
    use, intrinsic :: ieee_arithmetic, only: ieee_is_finite, ieee_value, ieee_quiet_nan
    use linkdyn_forward, only: forward_options, choose_method, method_gbs
    use linkdyn_handles, only: close_handle
    use linkdyn_given_attitudes, only: take_attitudes, attitudes_of_matrices, attitude_size, rotation_size
    use linkdyn_inverse, only: inverse_options, inverse_solver, choose_solver, solver_name
    use linkdyn_inverse_call, only: flat_motion, shaped, room_type, inverse_report, n_room, room_id, room_width, compute_inverse, &
        check_count, check_finite
    use linkdyn_lock, only: hold_texts, release_texts
    use linkdyn_heard_tables, only: refuse_short_tables
    use linkdyn_motion, only: evaluate_motion
    use linkdyn_motion_batch, only: motion_batch
    use linkdyn_name_lists, only: name_list, list_names, find_room, find_result, result_width
    use linkdyn_open_run, only: open_run, start_run, take_run, leave_run, go_to_instant, read_state, set_state
    use linkdyn_open_scene, only: open_scene, open_scene_text, open_scene_file, take_scene, leave_scene, find_placing
    use linkdyn_poses, only: find_poses
    use linkdyn_results, only: wanted_type, all_wanted
    use linkdyn_result_kinds, only: result_name, result_assembly
    use linkdyn_status, only: status_type, fail, status_bad_input, sample_ok
    use linkdyn_text, only: to_text, quoted, printable
    implicit none (type, external)
    private

    !> linkdyn_result
    type, bind(c) :: c_result
        type(c_ptr) :: name
        type(c_ptr) :: values
        integer(c_size_t) :: size
    end type c_result

    !> linkdyn_inverse_settings
    type, bind(c) :: c_inverse_settings
        type(c_ptr) :: solver
        integer(c_int) :: threads, in_order
    end type c_inverse_settings

    !> linkdyn_run_settings
    type, bind(c) :: c_run_settings
        type(c_ptr) :: method, solver
        real(c_double) :: t_end, step, rtol, atol
        integer(c_int) :: threads, keep_coordinates, errors
    end type c_run_settings

    interface
        pure integer(c_size_t) function c_length(text) bind(c, name="strlen")
            import :: c_ptr, c_size_t
            type(c_ptr), value :: text
        end function c_length

        subroutine note_error(text, size) bind(c, name="linkdyn_note_error")
            import :: c_char, c_size_t
            character(kind=c_char), intent(in) :: text(*)
            integer(c_size_t), value :: size
        end subroutine note_error
    end interface

contains

    ! ---------------------------------------------------------------- scenes

    integer(c_int) function c_open_file(path, handle) result(code) bind(c, name="linkdyn_open_file")
        type(c_ptr), value :: path
        type(c_ptr), value :: handle
        integer(c_intptr_t), pointer :: place
        integer(c_intptr_t) :: new
        type(status_type) :: status

        call hold_texts()
        call see_handle(handle, "scene", place, status)
        call expect("path", path, status)
        if (status%is_ok()) call open_scene_file(text_of(path), new, status)
        if (status%is_ok()) place = new
        code = outcome(status)
    end function c_open_file

    integer(c_int) function c_open_text(text, size, name, folder, handle) result(code) bind(c, name="linkdyn_open_text")
        type(c_ptr), value :: text
        integer(c_size_t), value :: size
        type(c_ptr), value :: name, folder
        type(c_ptr), value :: handle
        integer(c_intptr_t), pointer :: place
        integer(c_intptr_t) :: new
        integer :: n
        type(status_type) :: status

        call hold_texts()
        call see_handle(handle, "scene", place, status)
        call expect("text", text, status)
        n = count_from("size", size, status)
        if (status%is_ok()) call open_scene_text(characters(text, n), text_of(name, "scene"), text_of(folder, ""), new, status)
        if (status%is_ok()) place = new
        code = outcome(status)
    end function c_open_text

    integer(c_int) function c_close(handle) result(code) bind(c, name="linkdyn_close")
        integer(c_intptr_t), value :: handle
        type(open_scene), pointer :: scene
        type(status_type) :: status

        call hold_texts()
        call take_scene(handle, scene, status)
        if (associated(scene)) call close_handle(handle, "scene", status)
        call leave_scene(handle, scene)
        code = outcome(status)
    end function c_close

    ! ---------------------------------------------------------------- sizes and names

    integer(c_int) function c_count(handle, what, n) result(code) bind(c, name="linkdyn_count")
        integer(c_intptr_t), value :: handle
        type(c_ptr), value :: what, n
        integer(c_size_t), pointer :: place
        type(open_scene), pointer :: scene
        type(name_list) :: list
        type(status_type) :: status

        call hold_texts()
        call take_scene(handle, scene, status)
        call expect("what", what, status)
        call expect("count", n, status)
        if (status%is_ok()) call list_names(scene, text_of(what), list, status)
        if (status%is_ok()) then
            call c_f_pointer(n, place)
            place = size(list%name)
        end if
        call leave_scene(handle, scene)
        code = outcome(status)
    end function c_count

    integer(c_int) function c_name(handle, what, i, name, room) result(code) bind(c, name="linkdyn_name")
        integer(c_intptr_t), value :: handle
        type(c_ptr), value :: what
        integer(c_size_t), value :: i
        type(c_ptr), value :: name
        integer(c_size_t), value :: room
        type(open_scene), pointer :: scene
        type(name_list) :: list
        type(status_type) :: status

        call hold_texts()
        call take_scene(handle, scene, status)
        call expect("what", what, status)
        if (status%is_ok()) call list_names(scene, text_of(what), list, status)
        if (status%is_ok()) call give_entry("name", what, list%name, i, name, room, status)
        call leave_scene(handle, scene)
        code = outcome(status)
    end function c_name

    integer(c_int) function c_unit(handle, what, i, unit, room) result(code) bind(c, name="linkdyn_unit")
        integer(c_intptr_t), value :: handle
        type(c_ptr), value :: what
        integer(c_size_t), value :: i
        type(c_ptr), value :: unit
        integer(c_size_t), value :: room
        type(open_scene), pointer :: scene
        type(name_list) :: list
        type(status_type) :: status

        call hold_texts()
        call take_scene(handle, scene, status)
        call expect("what", what, status)
        if (status%is_ok()) call list_names(scene, text_of(what), list, status)
        if (status%is_ok() .and. .not. allocated(list%unit)) call fail(status, status_bad_input, "the list " &
            //quoted(text_of(what))//" has no units (expected ""coordinate"", ""actuator"", ""variable"" or ""component"")")
        if (status%is_ok()) call give_entry("unit", what, list%unit, i, unit, room, status)
        call leave_scene(handle, scene)
        code = outcome(status)
    end function c_unit

    integer(c_int) function c_width(handle, result, width) result(code) bind(c, name="linkdyn_width")
        integer(c_intptr_t), value :: handle
        type(c_ptr), value :: result, width
        integer(c_size_t), pointer :: place
        type(open_scene), pointer :: scene
        type(status_type) :: status
        integer :: n

        call hold_texts()
        call take_scene(handle, scene, status)
        call expect("result", result, status)
        call expect("width", width, status)
        if (status%is_ok()) call result_width(scene, text_of(result), n, status)
        if (status%is_ok()) then
            call c_f_pointer(width, place)
            place = n
        end if
        call leave_scene(handle, scene)
        code = outcome(status)
    end function c_width

    ! ---------------------------------------------------------------- inverse dynamics and positions

    integer(c_int) function c_motion(handle, n_sample, t, n_q, q, qd, qdd, n_load, load) result(code) &
        bind(c, name="linkdyn_evaluate_motion")
        integer(c_intptr_t), value :: handle
        integer(c_size_t), value :: n_sample, n_q, n_load
        type(c_ptr), value :: t, q, qd, qdd, load
        type(open_scene), pointer :: scene
        type(status_type) :: status
        type(flat_motion) :: given
        type(motion_batch) :: motion

        call hold_texts()
        call take_scene(handle, scene, status)
        given%n = count_from("n", n_sample, status)
        call see_instants(t, given%n, given%t, status)
        if (status%is_ok()) then
            call see_motion(scene, n_q, q, qd, qdd, n_load, load, given, status)
            call refuse_short_tables(scene%heard, minval(given%t), maxval(given%t), "samples", status)
        end if
        if (status%is_ok()) then
            motion = shaped(scene%model, given)
            call release_texts()
            call evaluate_motion(scene%model, given%t, motion%q, motion%qd, motion%qdd, motion%load)
            call hold_texts()
        end if
        call leave_scene(handle, scene)
        code = outcome(status)
    end function c_motion

    integer(c_int) function c_inverse(handle, settings, n_sample, n_q, q, qd, qdd, n_load, load, n_result, results, &
            sample_status) result(code) bind(c, name="linkdyn_compute_inverse")
        integer(c_intptr_t), value :: handle
        type(c_ptr), value :: settings
        integer(c_size_t), value :: n_sample, n_q, n_load, n_result
        type(c_ptr), value :: q, qd, qdd, load, results, sample_status

        code = c_inverse_at(handle, settings, n_sample, c_null_ptr, n_q, q, qd, qdd, n_load, load, n_result, results, sample_status)
    end function c_inverse

    integer(c_int) function c_inverse_at(handle, settings, n_sample, t, n_q, q, qd, qdd, n_load, load, n_result, results, &
            sample_status) result(code) bind(c, name="linkdyn_compute_inverse_at")
        integer(c_intptr_t), value :: handle
        type(c_ptr), value :: settings
        integer(c_size_t), value :: n_sample, n_q, n_load, n_result
        type(c_ptr), value :: t, q, qd, qdd, load, results, sample_status

        code = c_inverse_attitudes(handle, settings, n_sample, t, n_q, q, qd, qdd, 0_c_size_t, c_null_ptr, n_load, load, n_result, &
                                   results, sample_status)
    end function c_inverse_at

    integer(c_int) function c_inverse_attitudes(handle, settings, n_sample, t, n_q, q, qd, qdd, n_attitude, attitude, n_load, &
            load, n_result, results, sample_status) result(code) bind(c, name="linkdyn_compute_inverse_attitudes")
        integer(c_intptr_t), value :: handle
        type(c_ptr), value :: settings
        integer(c_size_t), value :: n_sample, n_q, n_attitude, n_load, n_result
        type(c_ptr), value :: t                          !! null: none are given
        type(c_ptr), value :: attitude                   !! null: all go by their angles
        type(c_ptr), value :: q, qd, qdd, load, results, sample_status
        type(open_scene), pointer :: scene
        type(status_type) :: status
        type(inverse_options) :: options
        type(inverse_report) :: report
        type(room_type) :: room(n_room)
        type(flat_motion) :: given
        real(c_double), pointer, contiguous :: assembly(:), attitude1(:)
        real(c_double), allocatable, target :: turned(:), own(:, :)    ! attitudes, and coordinates with theirs
        integer(c_int), pointer, contiguous :: status1(:)
        integer(c_int), allocatable, target :: whole(:)

        nullify (assembly, attitude1)
        call hold_texts()
        call take_scene(handle, scene, status)
        given%n = count_from("n", n_sample, status)
        if (status%is_ok()) then
            call see_motion(scene, n_q, q, qd, qdd, n_load, load, given, status)
            if (c_associated(t)) call see_instants(t, given%n, given%t, status)
            call see_integers("status", sample_status, given%n, status1, status)
            call read_inverse_settings(settings, options, status)
            call see_rooms(scene, results, n_result, given%n, room, assembly, status)
        end if
        if (status%is_ok() .and. (n_attitude > 0 .or. c_associated(attitude))) call see_attitudes()
        if (status%is_ok() .and. associated(assembly)) then
            allocate (whole(given%n), source=0_c_int)
            room(findloc(room_id, result_assembly, dim=1))%integer => whole
        end if
        call release_texts()
        if (status%is_ok() .and. associated(attitude1)) call turn_to_angles()
        if (status%is_ok()) call compute_inverse(scene, options, given, room, status1, report, status)
        call hold_texts()
        if (status%is_ok() .and. associated(assembly)) assembly = whole
        call leave_scene(handle, scene)
        code = outcome(status)

    contains

        subroutine see_attitudes()

            call check_width("attitude", n_attitude, scene%model%n_attitude, status)
            call see("attitude", attitude, attitude_size*scene%model%n_attitude, given%n, attitude1, status)
            if (status%is_ok() .and. options%in_order .and. .not. associated(given%t)) &
                call fail(status, status_bad_input, "no instants are given (expected t, of samples in order whose attitudes are)")
            if (.not. status%is_ok()) return
            if (.not. all(ieee_is_finite(attitude1))) call fail(status, status_bad_input, "attitude[" &
                //to_text(findloc(ieee_is_finite(attitude1), .false., dim=1) - 1)//"] is not a finite number")
        end subroutine see_attitudes

        !> The caller's arrays stay as they are.
        subroutine turn_to_angles()
            real(c_double), pointer :: attitude3(:, :, :)
            type(motion_batch) :: motion

            turned = attitude1
            allocate (own(size(given%q), 3))
            own(:, 1) = given%q
            own(:, 2) = given%qd
            own(:, 3) = given%qdd
            given%q => own(:, 1)
            given%qd => own(:, 2)
            given%qdd => own(:, 3)
            given%attitude => turned
            motion = shaped(scene%model, given)
            attitude3(1:attitude_size, 1:scene%model%n_attitude, 1:given%n) => turned
            call take_attitudes(scene%model, attitude3, motion%q, motion%qd, motion%qdd)
        end subroutine turn_to_angles
    end function c_inverse_attitudes

    !> With rotation matrices in place of quaternions.
    integer(c_int) function c_inverse_rotations(handle, settings, n_sample, t, n_q, q, qd, qdd, n_attitude, rotation, n_load, &
            load, n_result, results, sample_status) result(code) bind(c, name="linkdyn_compute_inverse_rotations")
        integer(c_intptr_t), value :: handle
        type(c_ptr), value :: settings
        integer(c_size_t), value :: n_sample, n_q, n_attitude, n_load, n_result
        type(c_ptr), value :: t, q, qd, qdd, rotation, load, results, sample_status
        type(open_scene), pointer :: scene
        type(status_type) :: status
        real(c_double), pointer, contiguous :: rotation1(:), rotation3(:, :, :)
        real(c_double), allocatable, target :: attitude(:, :, :)
        type(c_ptr) :: turned
        integer :: n

        turned = c_null_ptr
        call hold_texts()
        call take_scene(handle, scene, status)
        n = count_from("n", n_sample, status)
        if (status%is_ok()) then
            call check_width("attitude", n_attitude, scene%model%n_attitude, status)
            call see("rotation", rotation, rotation_size*scene%model%n_attitude, n, rotation1, status)
        end if
        if (status%is_ok() .and. n_attitude > 0 .and. n > 0) then
            allocate (attitude(attitude_size, scene%model%n_attitude, n))
            rotation3(1:rotation_size, 1:scene%model%n_attitude, 1:n) => rotation1
            call attitudes_of_matrices(scene%model, rotation3, attitude, status)
            turned = c_loc(attitude)
        end if
        call leave_scene(handle, scene)
        code = outcome(status)
        if (code /= 0) return
        code = c_inverse_attitudes(handle, settings, n_sample, t, n_q, q, qd, qdd, n_attitude, turned, n_load, load, n_result, &
                                   results, sample_status)
    end function c_inverse_rotations

    integer(c_int) function c_poses(handle, n_sample, n_q, q, n_link, position, axes, sample_status) result(code) &
        bind(c, name="linkdyn_find_poses")
        integer(c_intptr_t), value :: handle
        integer(c_size_t), value :: n_sample, n_q, n_link
        type(c_ptr), value :: q, position, axes, sample_status
        type(open_scene), pointer :: scene
        type(status_type) :: status
        real(c_double), pointer, contiguous :: q1(:), position1(:), axes1(:)
        real(c_double), pointer, contiguous :: q2(:, :), position3(:, :, :), axes4(:, :, :, :)
        type(inverse_solver), pointer :: solver
        integer(c_int), pointer, contiguous :: status1(:)
        integer :: n

        call hold_texts()
        call take_scene(handle, scene, status)
        n = count_from("n", n_sample, status)
        if (status%is_ok()) then
            call check_width("coordinate", n_q, scene%model%n_q, status)
            call check_width("link", n_link, scene%model%n_link, status)
            call see("q", q, scene%model%n_q, n, q1, status)
            call see("position", position, 3*scene%model%n_link, n, position1, status)
            call see("axes", axes, 9*scene%model%n_link, n, axes1, status)
            call see_integers("status", sample_status, n, status1, status)
        end if
        if (status%is_ok()) call check_finite("q", scene%model, 0, n, q1, status)
        if (status%is_ok()) call find_placing(scene, solver, status)
        if (status%is_ok()) then
            associate (model => scene%model)
                q2(1:model%n_q, 1:n) => q1
                position3(1:3, 1:model%n_link, 1:n) => position1
                axes4(1:3, 1:3, 1:model%n_link, 1:n) => axes1
                call release_texts()
                call find_poses(model, solver, q2, position3, axes4, status1)
                call hold_texts()
                call drop_failed(position3, axes4, status1)
            end associate
        end if
        call leave_scene(handle, scene)
        code = outcome(status)
    end function c_poses

    !> What cannot be assembled is nowhere.
    pure subroutine drop_failed(position, axes, sample_status)
        real(c_double), intent(inout) :: position(:, :, :), axes(:, :, :, :)
        integer(c_int), intent(in) :: sample_status(:)
        integer :: i

        do i = 1, size(sample_status)
            if (sample_status(i) == sample_ok) cycle
            position(:, :, i) = ieee_value(1.0_c_double, ieee_quiet_nan)
            axes(:, :, :, i) = ieee_value(1.0_c_double, ieee_quiet_nan)
        end do
    end subroutine drop_failed

    ! ---------------------------------------------------------------- forward dynamics

    integer(c_int) function c_start(handle, settings, t, run) result(code) bind(c, name="linkdyn_start")
        integer(c_intptr_t), value :: handle
        type(c_ptr), value :: settings
        real(c_double), value :: t
        type(c_ptr), value :: run
        type(open_scene), pointer :: scene
        type(open_run), pointer :: started
        type(forward_options) :: options
        type(wanted_type) :: wanted
        type(status_type) :: status
        integer(c_intptr_t), pointer :: place
        integer(c_intptr_t) :: new

        call hold_texts()
        call take_scene(handle, scene, status)
        call see_handle(run, "run", place, status)
        if (.not. ieee_is_finite(t)) call fail(status, status_bad_input, "t is not a finite number")
        options%t_start = t
        call read_run_settings(settings, options, wanted, status)
        if (status%is_ok()) then
            options%shared => scene%shared
            call start_run(scene%model, options, wanted, new, status)
        end if
        if (status%is_ok()) then
            call take_run(new, started, status)
            call release_texts()
            if (associated(started)) call go_to_instant(started, t, status)
            call hold_texts()
            call leave_run(new, started)
            if (.not. status%is_ok()) call close_handle(new, "run", status)
        end if
        if (status%is_ok()) place = new
        call leave_scene(handle, scene)
        code = outcome(status)
    end function c_start

    integer(c_int) function c_advance(handle, t) result(code) bind(c, name="linkdyn_advance")
        integer(c_intptr_t), value :: handle
        real(c_double), value :: t
        type(open_run), pointer :: run
        type(status_type) :: status

        call hold_texts()
        call take_run(handle, run, status)
        call release_texts()
        if (associated(run)) call go_to_instant(run, t, status)
        call hold_texts()
        call leave_run(handle, run)
        code = outcome(status)
    end function c_advance

    integer(c_int) function c_get_state(handle, t, n_q, q, qd, n_variable, variable) result(code) &
        bind(c, name="linkdyn_get_state")
        integer(c_intptr_t), value :: handle
        integer(c_size_t), value :: n_q, n_variable
        type(c_ptr), value :: t, q, qd, variable
        type(open_run), pointer :: run
        type(status_type) :: status
        real(c_double), pointer, contiguous :: t1(:), q1(:), qd1(:), variable1(:)
        real(c_double), allocatable :: all(:)
        real(c_double) :: instant

        call hold_texts()
        call take_run(handle, run, status)
        call see("t", t, 1, 1, t1, status)
        call see_state(run, n_q, q, qd, n_variable, variable, q1, qd1, variable1, status)
        if (status%is_ok()) then
            allocate (all(run%own%n_variable))
            call read_state(run, instant, q1, qd1, all, status)
        end if
        if (status%is_ok()) then
            t1 = instant
            if (n_variable > 0) variable1 = all
        end if
        call leave_run(handle, run)
        code = outcome(status)
    end function c_get_state

    integer(c_int) function c_set_state(handle, t, n_q, q, qd, n_variable, variable) result(code) &
        bind(c, name="linkdyn_set_state")
        integer(c_intptr_t), value :: handle
        real(c_double), value :: t
        integer(c_size_t), value :: n_q, n_variable
        type(c_ptr), value :: q, qd, variable
        type(open_run), pointer :: run
        type(status_type) :: status
        real(c_double), pointer, contiguous :: q1(:), qd1(:), variable1(:)

        call hold_texts()
        call take_run(handle, run, status)
        call see_state(run, n_q, q, qd, n_variable, variable, q1, qd1, variable1, status)
        if (status%is_ok()) then
            if (.not. ieee_is_finite(t)) call fail(status, status_bad_input, "t is not a finite number")
            call check_finite("q", run%own, 0, 1, q1, status)
            call check_finite("qd", run%own, 0, 1, qd1, status)
            if (.not. all(ieee_is_finite(variable1))) call fail(status, status_bad_input, "joint_variable[" &
                //to_text(findloc(ieee_is_finite(variable1), .false., dim=1) - 1)//"] is not a finite number")
        end if
        if (status%is_ok()) then
            if (n_variable > 0) then
                call set_state(run, t, q1, qd1, status, variable1)
            else
                call set_state(run, t, q1, qd1, status)
            end if
        end if
        call leave_run(handle, run)
        code = outcome(status)
    end function c_set_state

    integer(c_int) function c_get_result(handle, result) result(code) bind(c, name="linkdyn_get_result")
        integer(c_intptr_t), value :: handle
        type(c_ptr), value :: result
        type(open_run), pointer :: run
        type(c_result), pointer :: wanted
        type(status_type) :: status
        real(c_double), pointer, contiguous :: values(:)
        integer :: place

        call hold_texts()
        call take_run(handle, run, status)
        call expect("result", result, status)
        if (status%is_ok()) call c_f_pointer(result, wanted)
        if (status%is_ok()) call expect("name of the result", wanted%name, status)
        if (status%is_ok()) call find_result(run%watched%layout, text_of(wanted%name), place, status)
        if (status%is_ok()) call go_to_instant(run, run%t, status)
        if (status%is_ok()) then
            associate (found => run%block%of(place))
                if (allocated(found%integer)) then
                    call see_result(text_of(wanted%name), wanted, size(found%integer), 1, values, status)
                    if (status%is_ok()) values = found%integer
                else
                    call see_result(text_of(wanted%name), wanted, size(found%real), 1, values, status)
                    if (status%is_ok()) values = found%real
                end if
            end associate
        end if
        call leave_run(handle, run)
        code = outcome(status)
    end function c_get_result

    integer(c_int) function c_finish(handle) result(code) bind(c, name="linkdyn_finish")
        integer(c_intptr_t), value :: handle
        type(open_run), pointer :: run
        type(status_type) :: status

        call hold_texts()
        call take_run(handle, run, status)
        if (associated(run)) call close_handle(handle, "run", status)
        call leave_run(handle, run)
        code = outcome(status)
    end function c_finish

    ! ---------------------------------------------------------------- settings

    subroutine read_inverse_settings(settings, options, status)
        type(c_ptr), intent(in) :: settings                !! null: those described
        type(inverse_options), intent(inout) :: options
        type(status_type), intent(inout) :: status
        type(c_inverse_settings), pointer :: given

        if (.not. c_associated(settings)) return
        call c_f_pointer(settings, given)
        if (c_associated(given%solver)) then
            if (.not. is_text(given%solver, solver_name(options%solver))) &
                call choose_solver(text_of(given%solver), options%solver, status)
        end if
        call read_threads(given%threads, options%threads, status)
        options%in_order = given%in_order /= 0
    end subroutine read_inverse_settings

    subroutine read_threads(given, threads, status)
        integer(c_int), intent(in) :: given                !! 0: one
        integer, intent(out) :: threads
        type(status_type), intent(inout) :: status

        threads = max(1, given)
        if (given < 0) call fail(status, status_bad_input, "threads = "//to_text(given)//" (expected 0 or more)")
    end subroutine read_threads

    subroutine read_run_settings(settings, options, wanted, status)
        type(c_ptr), intent(in) :: settings                !! null: those described
        type(forward_options), intent(inout) :: options
        type(wanted_type), intent(out) :: wanted
        type(status_type), intent(inout) :: status
        type(c_run_settings), pointer :: given

        options%integrator%method = method_gbs
        if (c_associated(settings)) then
            call c_f_pointer(settings, given)
            if (c_associated(given%method)) call choose_method(text_of(given%method), options%integrator%method, status)
            if (c_associated(given%solver)) call choose_solver(text_of(given%solver), options%solver, status)
            call read_threads(given%threads, options%threads, status)
            options%switches = given%keep_coordinates == 0
            if (given%step /= 0) options%integrator%step = given%step
            if (given%rtol /= 0) options%integrator%rtol = given%rtol
            if (given%atol /= 0) options%integrator%atol = given%atol
            if (given%t_end /= 0) options%integrator%span = given%t_end - options%t_start
            if (.not. (options%integrator%span >= 0 .and. options%integrator%span <= huge(1.0_c_double))) call fail(status, &
                status_bad_input, "t_end = "//to_text(given%t_end)//" s (expected an instant after the start, or 0)")
        end if
        wanted = all_wanted(options%solver)
        if (c_associated(settings)) wanted%errors = given%errors /= 0
        options%wants_reactions = wanted%reaction
        options%wants_rcond = wanted%rcond
    end subroutine read_run_settings

    ! ---------------------------------------------------------------- pointers of C

    subroutine expect(name, pointer, status)
        character(len=*), intent(in) :: name
        type(c_ptr), intent(in) :: pointer
        type(status_type), intent(inout) :: status

        if (.not. c_associated(pointer)) call fail(status, status_bad_input, trim(name)//" is a null pointer")
    end subroutine expect

    !> Where a new handle goes.
    subroutine see_handle(pointer, kind, place, status)
        type(c_ptr), intent(in) :: pointer
        character(len=*), intent(in) :: kind
        integer(c_intptr_t), pointer, intent(out) :: place
        type(status_type), intent(inout) :: status

        nullify (place)
        call expect("the place for the "//kind, pointer, status)
        if (c_associated(pointer)) call c_f_pointer(pointer, place)
    end subroutine see_handle

    !> C's count as a default integer.
    integer function count_from(name, given, status) result(n)
        character(len=*), intent(in) :: name
        integer(c_size_t), intent(in) :: given
        type(status_type), intent(inout) :: status

        n = 0
        if (given < 0 .or. given > huge(n)) then
            call fail(status, status_bad_input, name//" is too large (expected at most "//to_text(huge(n))//")")
        else
            n = int(given)
            call check_count(n, status)
        end if
    end function count_from

    !> Do caller and scene agree on how many there are?
    subroutine check_width(what, given, expected, status)
        character(len=*), intent(in) :: what
        integer(c_size_t), intent(in) :: given
        integer, intent(in) :: expected
        type(status_type), intent(inout) :: status

        if (given /= expected) call fail(status, status_bad_input, "n_"//what//" does not fit the scene (expected " &
                                         //to_text(expected)//")")
    end subroutine check_width

    !> An array of n samples. A null pointer is an array of nothing.
    subroutine see(name, pointer, width, n, values, status)
        character(len=*), intent(in) :: name
        type(c_ptr), intent(in) :: pointer
        integer, intent(in) :: width, n
        real(c_double), pointer, contiguous, intent(out) :: values(:)
        type(status_type), intent(inout) :: status
        real(c_double), target, save :: nothing(0)

        values => nothing
        if (width == 0 .or. n == 0) return
        call expect(name, pointer, status)
        if (c_associated(pointer)) call c_f_pointer(pointer, values, [int(width, c_size_t)*n])
    end subroutine see

    !> Coordinates with their derivatives, and loads, of n samples.
    subroutine see_motion(scene, n_q, q, qd, qdd, n_load, load, given, status)
        type(open_scene), intent(in) :: scene
        integer(c_size_t), intent(in) :: n_q, n_load
        type(c_ptr), intent(in) :: q, qd, qdd, load
        type(flat_motion), intent(inout) :: given          !! n is there
        type(status_type), intent(inout) :: status

        associate (model => scene%model)
            call check_width("coordinate", n_q, model%n_q, status)
            call check_width("load", n_load, model%n_load, status)
            call see("q", q, model%n_q, given%n, given%q, status)
            call see("qd", qd, model%n_q, given%n, given%qd, status)
            call see("qdd", qdd, model%n_q, given%n, given%qdd, status)
            call see("load", load, 6*model%n_load, given%n, given%load, status)
        end associate
    end subroutine see_motion

    subroutine see_instants(pointer, n, t, status)
        type(c_ptr), intent(in) :: pointer
        integer, intent(in) :: n
        real(c_double), pointer, contiguous, intent(out) :: t(:)
        type(status_type), intent(inout) :: status

        call see("t", pointer, 1, n, t, status)
        if (.not. status%is_ok()) return
        if (.not. all(ieee_is_finite(t))) call fail(status, status_bad_input, "t[" &
            //to_text(findloc(ieee_is_finite(t), .false., dim=1) - 1)//"] is not a finite number")
    end subroutine see_instants

    subroutine see_integers(name, pointer, n, values, status)
        character(len=*), intent(in) :: name
        type(c_ptr), intent(in) :: pointer
        integer, intent(in) :: n
        integer(c_int), pointer, contiguous, intent(out) :: values(:)
        type(status_type), intent(inout) :: status
        integer(c_int), target, save :: nothing(0)

        values => nothing
        if (n == 0) return
        call expect(name, pointer, status)
        if (c_associated(pointer)) call c_f_pointer(pointer, values, [n])
    end subroutine see_integers

    !> Coordinates, rates and joint variables of a state; none of the last if the caller has none.
    subroutine see_state(run, n_q, q, qd, n_variable, variable, q1, qd1, variable1, status)
        type(open_run), pointer, intent(in) :: run         !! null: the call has failed
        integer(c_size_t), intent(in) :: n_q, n_variable
        type(c_ptr), intent(in) :: q, qd, variable
        real(c_double), pointer, contiguous, intent(out) :: q1(:), qd1(:), variable1(:)
        type(status_type), intent(inout) :: status

        nullify (q1, qd1, variable1)
        if (.not. associated(run)) return
        call check_width("coordinate", n_q, run%own%n_q, status)
        if (n_variable /= 0) call check_width("variable", n_variable, run%own%n_variable, status)
        call see("q", q, run%own%n_q, 1, q1, status)
        call see("qd", qd, run%own%n_q, 1, qd1, status)
        call see("joint_variable", variable, merge(run%own%n_variable, 0, n_variable > 0), 1, variable1, status)
    end subroutine see_state

    !> The rooms of some results of inverse dynamics.
    subroutine see_rooms(scene, results, n_result, n, room, assembly, status)
        type(open_scene), intent(in) :: scene
        type(c_ptr), intent(in) :: results
        integer(c_size_t), intent(in) :: n_result
        integer, intent(in) :: n
        type(room_type), intent(inout) :: room(n_room)
        real(c_double), pointer, contiguous, intent(inout) :: assembly(:)    !! it alone is a whole number in the engine
        type(status_type), intent(inout) :: status
        type(c_result), pointer :: wanted(:)
        real(c_double), pointer, contiguous :: values(:)
        integer :: i, place

        if (n_result == 0) return
        if (n_result < 0 .or. n_result > n_room) call fail(status, status_bad_input, "n_result is too large (expected at most " &
                                                           //to_text(n_room)//")")
        call expect("results", results, status)
        if (.not. status%is_ok()) return
        call c_f_pointer(results, wanted, [n_result])
        do i = 1, size(wanted)
            call expect("the name of a result", wanted(i)%name, status)
            if (.not. status%is_ok()) return
            do place = n_room, 1, -1
                if (is_text(wanted(i)%name, result_name(room_id(place)))) exit
            end do
            if (place == 0) call find_room(scene, text_of(wanted(i)%name), place, status)
            if (.not. status%is_ok()) return
            call see_result(result_name(room_id(place)), wanted(i), room_width(scene%model, room_id(place)), n, values, status)
            if (.not. status%is_ok()) return
            if (associated(room(place)%real) .or. (room_id(place) == result_assembly .and. associated(assembly))) &
                call fail(status, status_bad_input, "result "//quoted(trim(result_name(room_id(place))))// &
                          " is asked for twice (expected each result once)")
            if (.not. status%is_ok()) return
            if (room_id(place) == result_assembly) then
                assembly => values
            else
                room(place)%real => values
            end if
        end do
    end subroutine see_rooms

    !> The array of a result.
    subroutine see_result(name, wanted, width, n, values, status)
        character(len=*), intent(in) :: name
        type(c_result), intent(in) :: wanted
        integer, intent(in) :: width, n
        real(c_double), pointer, contiguous, intent(out) :: values(:)
        type(status_type), intent(inout) :: status

        if (wanted%size < 0 .or. wanted%size /= int(width, c_size_t)*n) call fail(status, status_bad_input, "the size of " &
            //quoted(trim(name))//" does not fit (expected "//to_text(n)//" x "//to_text(width)//", samples by numbers of each)")
        call see(name, wanted%values, width, n, values, status)
    end subroutine see_result

    !> The text of an entry, with its end.
    subroutine give_entry(name, what, entries, i, text, room, status)
        character(len=*), intent(in) :: name               !! of the argument
        type(c_ptr), intent(in) :: what                    !! of which list
        character(len=*), intent(in) :: entries(:)
        integer(c_size_t), intent(in) :: i                 !! from 0
        type(c_ptr), intent(in) :: text
        integer(c_size_t), intent(in) :: room
        type(status_type), intent(inout) :: status
        character(kind=c_char), pointer :: to(:)
        integer :: k, n

        call expect(name, text, status)
        if (i < 0 .or. i >= size(entries)) call fail(status, status_bad_input, "there is no such "//quoted(text_of(what)) &
            //" (expected a number below "//to_text(size(entries))//")")
        if (.not. status%is_ok()) return
        n = len_trim(entries(i + 1))
        if (room <= n) then
            call fail(status, status_bad_input, "no room for "//quoted(entries(i + 1))//" (expected "//to_text(n + 1) &
                      //" characters)")
            return
        end if
        call c_f_pointer(text, to, [n + 1])
        do k = 1, n
            to(k) = entries(i + 1)(k:k)
        end do
        to(n + 1) = c_null_char
    end subroutine give_entry

    !> A text of C; `absent` for a null pointer.
    function text_of(pointer, absent) result(text)
        type(c_ptr), intent(in) :: pointer
        character(len=*), intent(in), optional :: absent
        character(len=:), allocatable :: text

        if (c_associated(pointer)) then
            text = characters(pointer, int(min(c_length(pointer), int(huge(1), c_size_t))))
        else
            text = ""
            if (present(absent)) text = absent
        end if
    end function text_of

    !> Is a text of C this word? Without a copy.
    logical function is_text(pointer, word)
        type(c_ptr), intent(in) :: pointer
        character(len=*), intent(in) :: word
        character(kind=c_char), pointer :: from(:)
        integer :: i

        is_text = c_length(pointer) == len_trim(word)
        if (.not. is_text) return
        call c_f_pointer(pointer, from, [len_trim(word)])
        do i = 1, size(from)
            is_text = is_text .and. from(i) == word(i:i)
        end do
    end function is_text

    function characters(pointer, n) result(text)
        type(c_ptr), intent(in) :: pointer
        integer, intent(in) :: n
        character(len=:), allocatable :: text
        character(kind=c_char), pointer :: from(:)
        integer :: i

        call c_f_pointer(pointer, from, [n])
        allocate (character(len=n) :: text)
        do i = 1, n
            text(i:i) = from(i)
        end do
    end function characters

    !> The end of a call: its code. Its message becomes the thread's last error.
    integer(c_int) function outcome(status) result(code)
        type(status_type), intent(in) :: status
        character(len=:), allocatable :: line

        code = status%code
        if (.not. status%is_ok()) then
            line = printable(trim(status%message))
            call note_error(line, int(len(line), c_size_t))
        end if
        call release_texts()
    end function outcome
end module linkdyn_c_interface
