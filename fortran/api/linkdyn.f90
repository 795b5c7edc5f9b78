!> linkdyn for Fortran programs: what linkdyn.h has for C, with Fortran's arrays and texts.
!>
!> `code` is 0, or says as one of the `linkdyn_*` constants what kind of thing was wrong; then `linkdyn_message()` has one line
!> of text. Each sample of a batch has a status of its own; results of one that is not 0 are NaN. Units are SI and radians.
!> Lists are numbered from 1 here. The sample is the last dimension of every array.
module linkdyn
    use, intrinsic :: iso_c_binding, only: c_char, c_double, c_f_pointer, c_int, c_loc, c_null_char, c_null_ptr, &
        c_ptr, c_size_t
    implicit none (type, external)
    private
    public :: linkdyn_scene, linkdyn_run, linkdyn_result, into, linkdyn_version, linkdyn_message
    public :: linkdyn_ok, linkdyn_bad_input, linkdyn_io_error, linkdyn_unavailable, linkdyn_internal, linkdyn_closed, &
        linkdyn_stopped, linkdyn_no_result

    real(c_double), target, save :: no_attitude(10, 0, 0)

    ! ---- outcome of a call
    integer, parameter :: linkdyn_ok = 0
    integer, parameter :: linkdyn_bad_input = 2      !! the scene or an argument is wrong
    integer, parameter :: linkdyn_io_error = 4       !! a file could not be read
    integer, parameter :: linkdyn_unavailable = 5    !! built without the library that this needs
    integer, parameter :: linkdyn_internal = 6       !! a defect of linkdyn
    integer, parameter :: linkdyn_closed = 7         !! not opened, or closed
    integer, parameter :: linkdyn_stopped = 9        !! a run has ended before the instant
    integer, parameter :: linkdyn_no_result = 10     !! nothing can be told of this instant of a run; it can go on

    integer, parameter :: name_room = 128

    !> An open scene. A copy is the same scene.
    type :: linkdyn_scene
        private
        type(c_ptr) :: handle = c_null_ptr
    contains
        procedure :: open_file, open_text, count => count_entries, name => name_of, unit => unit_of, width, motion, inverse, &
            inverse_at, inverse_attitudes, poses, start, close => close_scene
    end type linkdyn_scene

    !> A forward run. A copy is the same run.
    type :: linkdyn_run
        private
        type(c_ptr) :: handle = c_null_ptr
    contains
        procedure :: advance, get_state, set_state, get_result, finish
    end type linkdyn_run

    !> Where a result goes; see `into`.
    type :: linkdyn_result
        private
        character(kind=c_char, len=name_room) :: name = ""
        type(c_ptr) :: values = c_null_ptr
        integer(c_size_t) :: size = 0
    end type linkdyn_result

    type, bind(c) :: c_result
        type(c_ptr) :: name, values
        integer(c_size_t) :: size
    end type c_result

    type, bind(c) :: c_inverse_settings
        type(c_ptr) :: solver = c_null_ptr
        integer(c_int) :: threads = 0, in_order = 0
    end type c_inverse_settings

    type, bind(c) :: c_run_settings
        type(c_ptr) :: method = c_null_ptr, solver = c_null_ptr
        real(c_double) :: t_end = 0, step = 0, rtol = 0, atol = 0
        integer(c_int) :: threads = 0, keep_coordinates = 0, errors = 0
    end type c_run_settings

    interface
        function c_version() result(text) bind(c, name="linkdyn_version")
            import :: c_ptr
            type(c_ptr) :: text
        end function c_version

        function c_last_error() result(text) bind(c, name="linkdyn_last_error")
            import :: c_ptr
            type(c_ptr) :: text
        end function c_last_error

        integer(c_int) function c_open_file(path, scene) bind(c, name="linkdyn_open_file")
            import :: c_char, c_int, c_ptr
            character(kind=c_char), intent(in) :: path(*)
            type(c_ptr), intent(inout) :: scene
        end function c_open_file

        integer(c_int) function c_open_text(text, size, name, folder, scene) bind(c, name="linkdyn_open_text")
            import :: c_char, c_int, c_ptr, c_size_t
            character(kind=c_char), intent(in) :: text(*), name(*), folder(*)
            integer(c_size_t), value :: size
            type(c_ptr), intent(inout) :: scene
        end function c_open_text

        integer(c_int) function c_close(scene) bind(c, name="linkdyn_close")
            import :: c_int, c_ptr
            type(c_ptr), value :: scene
        end function c_close

        integer(c_int) function c_count(scene, what, n) bind(c, name="linkdyn_count")
            import :: c_char, c_int, c_ptr, c_size_t
            type(c_ptr), value :: scene
            character(kind=c_char), intent(in) :: what(*)
            integer(c_size_t), intent(inout) :: n
        end function c_count

        integer(c_int) function c_name(scene, what, i, name, room) bind(c, name="linkdyn_name")
            import :: c_char, c_int, c_ptr, c_size_t
            type(c_ptr), value :: scene
            character(kind=c_char), intent(in) :: what(*)
            integer(c_size_t), value :: i, room
            character(kind=c_char), intent(inout) :: name(*)
        end function c_name

        integer(c_int) function c_unit(scene, what, i, unit, room) bind(c, name="linkdyn_unit")
            import :: c_char, c_int, c_ptr, c_size_t
            type(c_ptr), value :: scene
            character(kind=c_char), intent(in) :: what(*)
            integer(c_size_t), value :: i, room
            character(kind=c_char), intent(inout) :: unit(*)
        end function c_unit

        integer(c_int) function c_width(scene, result, width) bind(c, name="linkdyn_width")
            import :: c_char, c_int, c_ptr, c_size_t
            type(c_ptr), value :: scene
            character(kind=c_char), intent(in) :: result(*)
            integer(c_size_t), intent(inout) :: width
        end function c_width

        integer(c_int) function c_motion(scene, n, t, n_q, q, qd, qdd, n_load, load) bind(c, name="linkdyn_evaluate_motion")
            import :: c_double, c_int, c_ptr, c_size_t
            type(c_ptr), value :: scene
            integer(c_size_t), value :: n, n_q, n_load
            real(c_double), intent(in) :: t(*)
            real(c_double), intent(inout) :: q(*), qd(*), qdd(*), load(*)
        end function c_motion

        integer(c_int) function c_poses(scene, n, n_q, q, n_link, position, axes, status) bind(c, name="linkdyn_find_poses")
            import :: c_double, c_int, c_ptr, c_size_t
            type(c_ptr), value :: scene
            integer(c_size_t), value :: n, n_q, n_link
            real(c_double), intent(in) :: q(*)
            real(c_double), intent(inout) :: position(*), axes(*)
            integer(c_int), intent(inout) :: status(*)
        end function c_poses

        integer(c_int) function c_start(scene, settings, t, run) bind(c, name="linkdyn_start")
            import :: c_double, c_int, c_ptr, c_run_settings
            type(c_ptr), value :: scene
            type(c_run_settings), intent(in) :: settings
            real(c_double), value :: t
            type(c_ptr), intent(inout) :: run
        end function c_start

        integer(c_int) function c_advance(run, t) bind(c, name="linkdyn_advance")
            import :: c_double, c_int, c_ptr
            type(c_ptr), value :: run
            real(c_double), value :: t
        end function c_advance

        integer(c_int) function c_get_state(run, t, n_q, q, qd, n_variable, variable) bind(c, name="linkdyn_get_state")
            import :: c_double, c_int, c_ptr, c_size_t
            type(c_ptr), value :: run
            integer(c_size_t), value :: n_q, n_variable
            real(c_double), intent(inout) :: t, q(*), qd(*)
            real(c_double), intent(inout), optional :: variable(*)
        end function c_get_state

        integer(c_int) function c_set_state(run, t, n_q, q, qd, n_variable, variable) bind(c, name="linkdyn_set_state")
            import :: c_double, c_int, c_ptr, c_size_t
            type(c_ptr), value :: run
            real(c_double), value :: t
            integer(c_size_t), value :: n_q, n_variable
            real(c_double), intent(in) :: q(*), qd(*)
            real(c_double), intent(in), optional :: variable(*)
        end function c_set_state

        integer(c_int) function c_get_result(run, result) bind(c, name="linkdyn_get_result")
            import :: c_int, c_ptr, c_result
            type(c_ptr), value :: run
            type(c_result), intent(in) :: result
        end function c_get_result

        integer(c_int) function c_finish(run) bind(c, name="linkdyn_finish")
            import :: c_int, c_ptr
            type(c_ptr), value :: run
        end function c_finish

        subroutine note_error(text, size) bind(c, name="linkdyn_note_error")
            import :: c_char, c_size_t
            character(kind=c_char), intent(in) :: text(*)
            integer(c_size_t), value :: size
        end subroutine note_error

        pure integer(c_size_t) function c_length(text) bind(c, name="strlen")
            import :: c_ptr, c_size_t
            type(c_ptr), value :: text
        end function c_length
    end interface

    abstract interface
        !> Inverse dynamics with attitudes in one form or another.
        integer(c_int) function c_inverse_form(scene, settings, n, t, n_q, q, qd, qdd, n_attitude, attitude, n_load, load, &
                n_result, results, status) bind(c)
            import :: c_double, c_int, c_inverse_settings, c_ptr, c_result, c_size_t
            type(c_ptr), value :: scene, t, attitude
            type(c_inverse_settings), intent(in) :: settings
            integer(c_size_t), value :: n, n_q, n_attitude, n_load, n_result
            real(c_double), intent(in) :: q(*), qd(*), qdd(*), load(*)
            type(c_result), intent(in) :: results(*)
            integer(c_int), intent(inout) :: status(*)
        end function c_inverse_form
    end interface

    procedure(c_inverse_form), bind(c, name="linkdyn_compute_inverse_attitudes") :: c_inverse
    procedure(c_inverse_form), bind(c, name="linkdyn_compute_inverse_rotations") :: c_inverse_rotations

contains

    function linkdyn_version() result(text)
        character(len=:), allocatable :: text

        text = text_at(c_version())
    end function linkdyn_version

    !> Why the last call that failed in this thread did.
    function linkdyn_message() result(text)
        character(len=:), allocatable :: text

        text = text_at(c_last_error())
    end function linkdyn_message

    !> The result of a name goes into an array, which must be contiguous and stay where it is during the call.
    function into(name, values) result(result)
        character(len=*), intent(in) :: name                        !! as `scene%name("result", i)` or `("run_result", i)`
        real(c_double), intent(in), target, contiguous :: values(..)    !! `scene%width(name)` numbers of each sample
        type(linkdyn_result) :: result

        result%name = name
        result%values = c_loc(values)
        result%size = size(values, kind=c_size_t)
    end function into

    ! ---------------------------------------------------------------- scenes

    !> Open a scene file; the tables it names lie beside it.
    subroutine open_file(self, path, code)
        class(linkdyn_scene), intent(inout) :: self
        character(len=*), intent(in) :: path
        integer, intent(out) :: code

        code = c_open_file(trim(path)//c_null_char, self%handle)
    end subroutine open_file

    !> Open a scene given as text.
    subroutine open_text(self, text, code, name, folder)
        class(linkdyn_scene), intent(inout) :: self
        character(len=*), intent(in) :: text
        integer, intent(out) :: code
        character(len=*), intent(in), optional :: name      !! what to call it in messages; default: "scene"
        character(len=*), intent(in), optional :: folder    !! where its tables lie; default: the current one

        code = c_open_text(text, len(text, c_size_t), given(name, "scene")//c_null_char, given(folder, "")//c_null_char, &
                           self%handle)
    end subroutine open_text

    subroutine close_scene(self, code)
        class(linkdyn_scene), intent(inout) :: self
        integer, intent(out) :: code

        code = c_close(self%handle)
        self%handle = c_null_ptr
    end subroutine close_scene

    !> How many entries a list has: "link", "joint", "coordinate", "actuator", "load", "variable", "component", "dyad", "result",
    !> "run_result". -1: the call has failed.
    integer function count_entries(self, what) result(n)
        class(linkdyn_scene), intent(in) :: self
        character(len=*), intent(in) :: what
        integer(c_size_t) :: count

        n = -1
        if (c_count(self%handle, trim(what)//c_null_char, count) == linkdyn_ok) n = int(count)
    end function count_entries

    !> Name of entry i; blank: the call has failed.
    function name_of(self, what, i) result(text)
        class(linkdyn_scene), intent(in) :: self
        character(len=*), intent(in) :: what
        integer, intent(in) :: i
        character(len=:), allocatable :: text
        character(kind=c_char), target :: name(name_room)

        text = ""
        if (c_name(self%handle, trim(what)//c_null_char, i - 1_c_size_t, name, size(name, kind=c_size_t)) == linkdyn_ok) &
            text = text_at(c_loc(name))
    end function name_of

    !> Unit of entry i of "coordinate", "actuator", "variable", "component"; blank: the call has failed.
    function unit_of(self, what, i) result(text)
        class(linkdyn_scene), intent(in) :: self
        character(len=*), intent(in) :: what
        integer, intent(in) :: i
        character(len=:), allocatable :: text
        character(kind=c_char), target :: unit(name_room)

        text = ""
        if (c_unit(self%handle, trim(what)//c_null_char, i - 1_c_size_t, unit, size(unit, kind=c_size_t)) == linkdyn_ok) &
            text = text_at(c_loc(unit))
    end function unit_of

    !> Numbers that a result has in each sample; -1: the call has failed.
    integer function width(self, result)
        class(linkdyn_scene), intent(in) :: self
        character(len=*), intent(in) :: result
        integer(c_size_t) :: n

        width = -1
        if (c_width(self%handle, trim(result)//c_null_char, n) == linkdyn_ok) width = int(n)
    end function width

    ! ---------------------------------------------------------------- inverse dynamics and positions

    !> The scene's own motion at some instants. Every array has one entry of its last dimension for each of t.
    subroutine motion(self, t, q, qd, qdd, load, code)
        class(linkdyn_scene), intent(in) :: self
        real(c_double), intent(in), contiguous :: t(:)                                    !! (n) [s]
        real(c_double), intent(inout), contiguous :: q(:, :), qd(:, :), qdd(:, :)         !! (n_coordinate, n)
        real(c_double), intent(inout), contiguous :: load(:, :, :)                        !! (6, n_load, n)
        integer, intent(out) :: code

        code = linkdyn_bad_input
        if (.not. agree([size(t), size(q, 2), size(qd, 2), size(qdd, 2), size(load, 3)], &
                        "t, q, qd, qdd and load differ in their samples")) return
        if (.not. agree([size(q, 1), size(qd, 1), size(qdd, 1)], "q, qd and qdd differ in their coordinates")) return
        if (.not. agree([size(load, 1), 6], "a load has other than 6 components")) return
        code = c_motion(self%handle, size(t, kind=c_size_t), t, size(q, 1, c_size_t), q, qd, qdd, size(load, 2, c_size_t), load)
    end subroutine motion

    !> Driving forces, reactions, ... of a motion.
    subroutine inverse(self, q, qd, qdd, load, results, status, code, solver, threads, in_order)
        class(linkdyn_scene), intent(in) :: self
        real(c_double), intent(in), contiguous :: q(:, :), qd(:, :), qdd(:, :)            !! (n_coordinate, n)
        real(c_double), intent(in), contiguous :: load(:, :, :)                           !! (6, n_load, n)
        type(linkdyn_result), intent(in), target :: results(:)
        integer(c_int), intent(inout), contiguous :: status(:)                            !! (n)
        integer, intent(out) :: code
        character(len=*), intent(in), optional :: solver       !! default: elimination
        integer, intent(in), optional :: threads               !! default: one
        logical, intent(in), optional :: in_order              !! the samples follow each other along a motion; default: no

        call compute(self, c_null_ptr, q, qd, qdd, no_attitude, load, results, status, code, solver, threads, in_order)
    end subroutine inverse

    !> The same at instants, for scenes that ask for them: frames that move, payloads and forces over the state that change
    !> with time.
    subroutine inverse_at(self, t, q, qd, qdd, load, results, status, code, solver, threads, in_order)
        class(linkdyn_scene), intent(in) :: self
        real(c_double), intent(in), contiguous, target :: t(:)                            !! (n) [s]
        real(c_double), intent(in), contiguous :: q(:, :), qd(:, :), qdd(:, :)            !! (n_coordinate, n)
        real(c_double), intent(in), contiguous :: load(:, :, :)                           !! (6, n_load, n)
        type(linkdyn_result), intent(in), target :: results(:)
        integer(c_int), intent(inout), contiguous :: status(:)                            !! (n)
        integer, intent(out) :: code
        character(len=*), intent(in), optional :: solver       !! default: elimination
        integer, intent(in), optional :: threads               !! default: one
        logical, intent(in), optional :: in_order              !! the samples follow each other along a motion; default: no

        code = linkdyn_bad_input
        if (.not. agree([size(t), size(q, 2)], "t and q differ in their samples")) return
        call compute(self, c_loc(t), q, qd, qdd, no_attitude, load, results, status, code, solver, threads, in_order)
    end subroutine inverse_at

    !> The same with attitudes as quaternions in place of roll, pitch and yaw: w x y z, angular velocity and angular
    !> acceleration of each of the list "attitude"; where w x y z are zero the angles count. Of 15 numbers the first nine are
    !> a rotation matrix, row by row, instead.
    subroutine inverse_attitudes(self, q, qd, qdd, attitude, load, results, status, code, t, solver, threads, in_order)
        class(linkdyn_scene), intent(in) :: self
        real(c_double), intent(in), contiguous :: q(:, :), qd(:, :), qdd(:, :)            !! (n_coordinate, n)
        real(c_double), intent(in), contiguous, target :: attitude(:, :, :)               !! (10 or 15, n_attitude, n)
        real(c_double), intent(in), contiguous :: load(:, :, :)                           !! (6, n_load, n)
        type(linkdyn_result), intent(in), target :: results(:)
        integer(c_int), intent(inout), contiguous :: status(:)                            !! (n)
        integer, intent(out) :: code
        real(c_double), intent(in), contiguous, target, optional :: t(:)    !! (n) [s]; wanted of samples in order
        character(len=*), intent(in), optional :: solver       !! default: elimination
        integer, intent(in), optional :: threads               !! default: one
        logical, intent(in), optional :: in_order              !! the samples follow each other along a motion; default: no
        type(c_ptr) :: instants

        code = linkdyn_bad_input
        if (.not. agree([size(attitude, 1), merge(15, 10, size(attitude, 1) == 15)], &
                        "an attitude has other than 10 or 15 numbers")) return
        if (.not. agree([size(attitude, 3), size(q, 2)], "attitude and q differ in their samples")) return
        instants = c_null_ptr
        if (present(t)) then
            if (.not. agree([size(t), size(q, 2)], "t and q differ in their samples")) return
            instants = c_loc(t)
        end if
        call compute(self, instants, q, qd, qdd, attitude, load, results, status, code, solver, threads, in_order)
    end subroutine inverse_attitudes

    subroutine compute(self, t, q, qd, qdd, attitude, load, results, status, code, solver, threads, in_order)
        class(linkdyn_scene), intent(in) :: self
        type(c_ptr), intent(in) :: t                           !! instants; null: none
        real(c_double), intent(in), contiguous :: q(:, :), qd(:, :), qdd(:, :), load(:, :, :)
        real(c_double), intent(in), contiguous, target :: attitude(:, :, :)
        type(linkdyn_result), intent(in), target :: results(:)
        integer(c_int), intent(inout), contiguous :: status(:)
        integer, intent(out) :: code
        character(len=*), intent(in), optional :: solver
        integer, intent(in), optional :: threads
        logical, intent(in), optional :: in_order
        character(kind=c_char, len=:), allocatable, target :: word
        type(c_inverse_settings) :: settings
        type(c_ptr) :: turned                                  ! the attitudes; null: none
        procedure(c_inverse_form), pointer :: run
        character(kind=c_char, len=name_room + 1), target :: names(size(results))
        integer :: i

        word = given(solver, "elimination")//c_null_char
        settings%solver = c_loc(word)
        if (present(threads)) settings%threads = threads
        if (present(in_order)) settings%in_order = merge(1, 0, in_order)
        code = linkdyn_bad_input
        if (.not. agree([size(q, 2), size(qd, 2), size(qdd, 2), size(load, 3), size(status)], &
                        "q, qd, qdd, load and status differ in their samples")) return
        if (.not. agree([size(q, 1), size(qd, 1), size(qdd, 1)], "q, qd and qdd differ in their coordinates")) return
        if (.not. agree([size(load, 1), 6], "a load has other than 6 components")) return
        do i = 1, size(results)
            names(i) = trim(results(i)%name)//c_null_char
        end do
        turned = c_null_ptr
        if (size(attitude) > 0) turned = c_loc(attitude)
        run => c_inverse
        if (size(attitude, 1) == 15) run => c_inverse_rotations
        code = run(self%handle, settings, size(q, 2, c_size_t), t, size(q, 1, c_size_t), q, qd, qdd, &
                   size(attitude, 2, c_size_t), turned, size(load, 2, c_size_t), load, size(results, kind=c_size_t), &
                   [(c_result(c_loc(names(i)), results(i)%values, results(i)%size), i=1, size(results))], status)
    end subroutine compute

    !> Where the moving links are, each sample on the assembly of the scene's start.
    subroutine poses(self, q, position, axes, status, code)
        class(linkdyn_scene), intent(in) :: self
        real(c_double), intent(in), contiguous :: q(:, :)               !! (n_coordinate, n)
        real(c_double), intent(inout), contiguous :: position(:, :, :)  !! (3, n_link, n) origins [m]
        real(c_double), intent(inout), contiguous :: axes(:, :, :, :)   !! (3, 3, n_link, n) columns: the link's axes
        integer(c_int), intent(inout), contiguous :: status(:)          !! (n)
        integer, intent(out) :: code

        code = linkdyn_bad_input
        if (.not. agree([size(q, 2), size(position, 3), size(axes, 4), size(status)], &
                        "q, position, axes and status differ in their samples")) return
        if (.not. agree([size(position, 2), size(axes, 3)], "position and axes differ in their links")) return
        if (.not. agree([size(position, 1), size(axes, 1), size(axes, 2), 3], "position and axes have other than 3 components")) &
            return
        code = c_poses(self%handle, size(q, 2, c_size_t), size(q, 1, c_size_t), q, size(position, 2, c_size_t), position, axes, &
                       status)
    end subroutine poses

    ! ---------------------------------------------------------------- forward dynamics

    !> Start a run where the scene does. Defaults as in linkdyn.h.
    subroutine start(self, t, run, code, method, solver, t_end, step, rtol, atol, threads, keep_coordinates, errors)
        class(linkdyn_scene), intent(in) :: self
        real(c_double), intent(in) :: t                        !! [s]
        type(linkdyn_run), intent(inout) :: run
        integer, intent(out) :: code
        character(len=*), intent(in), optional :: method, solver
        real(c_double), intent(in), optional :: t_end, step    !! [s]
        real(c_double), intent(in), optional :: rtol, atol
        integer, intent(in), optional :: threads
        logical, intent(in), optional :: keep_coordinates, errors
        character(kind=c_char, len=:), allocatable, target :: method_word, solver_word
        type(c_run_settings) :: settings

        method_word = given(method, "gbs")//c_null_char
        solver_word = given(solver, "elimination")//c_null_char
        settings%method = c_loc(method_word)
        settings%solver = c_loc(solver_word)
        if (present(t_end)) settings%t_end = t_end
        if (present(step)) settings%step = step
        if (present(rtol)) settings%rtol = rtol
        if (present(atol)) settings%atol = atol
        if (present(threads)) settings%threads = threads
        if (present(keep_coordinates)) settings%keep_coordinates = merge(1, 0, keep_coordinates)
        if (present(errors)) settings%errors = merge(1, 0, errors)
        code = c_start(self%handle, settings, t, run%handle)
    end subroutine start

    !> Integrate to the instant t [s], not before that of the run.
    subroutine advance(self, t, code)
        class(linkdyn_run), intent(inout) :: self
        real(c_double), intent(in) :: t
        integer, intent(out) :: code

        code = c_advance(self%handle, t)
    end subroutine advance

    !> Where the run is.
    subroutine get_state(self, t, q, qd, code, joint_variable)
        class(linkdyn_run), intent(inout) :: self
        real(c_double), intent(inout) :: t                                 !! [s]
        real(c_double), intent(inout), contiguous :: q(:), qd(:)           !! (n_coordinate)
        integer, intent(out) :: code
        real(c_double), intent(inout), contiguous, optional :: joint_variable(:)  !! (n_variable)

        code = linkdyn_bad_input
        if (.not. agree([size(q), size(qd)], "q and qd differ in their coordinates")) return
        code = c_get_state(self%handle, t, size(q, kind=c_size_t), q, qd, size_of(joint_variable), joint_variable)
    end subroutine get_state

    !> Put the run somewhere: with the joint variables of `get_state` on that assembly; without them on that of the scene's start.
    subroutine set_state(self, t, q, qd, code, joint_variable)
        class(linkdyn_run), intent(inout) :: self
        real(c_double), intent(in) :: t                                    !! [s]
        real(c_double), intent(in), contiguous :: q(:), qd(:)              !! (n_coordinate)
        integer, intent(out) :: code
        real(c_double), intent(in), contiguous, optional :: joint_variable(:)     !! (n_variable)

        code = linkdyn_bad_input
        if (.not. agree([size(q), size(qd)], "q and qd differ in their coordinates")) return
        code = c_set_state(self%handle, t, size(q, kind=c_size_t), q, qd, size_of(joint_variable), joint_variable)
    end subroutine set_state

    !> A result at the run's instant.
    subroutine get_result(self, result, code)
        class(linkdyn_run), intent(inout) :: self
        type(linkdyn_result), intent(in) :: result
        integer, intent(out) :: code
        character(kind=c_char, len=name_room + 1), target :: name

        name = trim(result%name)//c_null_char
        code = c_get_result(self%handle, c_result(c_loc(name), result%values, result%size))
    end subroutine get_result

    subroutine finish(self, code)
        class(linkdyn_run), intent(inout) :: self
        integer, intent(out) :: code

        code = c_finish(self%handle)
        self%handle = c_null_ptr
    end subroutine finish

    ! ---------------------------------------------------------------- between Fortran and C

    function given(text, default) result(word)
        character(len=*), intent(in), optional :: text
        character(len=*), intent(in) :: default
        character(len=:), allocatable :: word

        word = default
        if (present(text)) word = trim(text)
    end function given

    function text_at(pointer) result(text)
        type(c_ptr), intent(in) :: pointer
        character(len=:), allocatable :: text
        character(kind=c_char), pointer :: from(:)
        integer :: i

        call c_f_pointer(pointer, from, [c_length(pointer)])
        allocate (character(len=size(from)) :: text)
        do i = 1, size(from)
            text(i:i) = from(i)
        end do
    end function text_at

    integer(c_size_t) function size_of(values) result(n)
        real(c_double), intent(in), optional :: values(:)

        n = 0
        if (present(values)) n = size(values, kind=c_size_t)
    end function size_of

    !> Do some arrays agree in a size? The message says of which.
    logical function agree(sizes, what)
        integer, intent(in) :: sizes(:)
        character(len=*), intent(in) :: what

        agree = all(sizes == sizes(1))
        if (.not. agree) call note_error(what, len(what, c_size_t))
    end function agree
end module linkdyn
