!> Inverse dynamics between flat arrays of a caller: checked, and computed straight into them.
module linkdyn_inverse_call
    use, intrinsic :: iso_c_binding, only: c_double, c_int
    use, intrinsic :: iso_fortran_env, only: int64
    use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
    use linkdyn_assembly_trail, only: assembly_trail
    use linkdyn_finite, only: all_are_finite
    use linkdyn_given_attitudes, only: refuse_way_past_pole, turn_by_quaternion, attitude_size
    use linkdyn_inverse, only: inverse_options, inverse_results, inverse_solver, motion_batch, run_prepared, solver_lapack
    use linkdyn_inverse_results, only: result_width, is_of_inverse
    use linkdyn_lane_count, only: lanes
    use linkdyn_lock, only: hold_texts, release_texts
    use linkdyn_model, only: model_type
    use linkdyn_open_scene, only: open_scene, find_solver
    use linkdyn_results, only: find_driving_power, find_motor_loads
    use linkdyn_result_kinds, only: result_name, result_driving_force, result_driving_speed, result_driving_power, &
        result_reaction, result_joint_variable, result_joint_rate, result_power_imbalance, result_rcond, &
        result_singularity_distance, result_error, result_driving_force_error, result_reaction_error, &
        result_transmission_angle, result_growth, result_assembly, result_friction, result_friction_power, &
        result_transmission_force, result_motor_torque, result_motor_speed, result_motor_power, result_motor_current, &
        result_transmission_loss, result_torque_margin, result_contact_force, result_pressure_angle, result_strand_force
    use linkdyn_roads, only: road_counts
    use linkdyn_scene, only: scene_type, takes_time, payload_changes, has_limits
    use linkdyn_status, only: status_type, fail, status_bad_input, sample_ok, sample_undefined, message_len
    use linkdyn_text, only: to_text, quoted
    use linkdyn_turns, only: turn_count
    implicit none (type, external)
    private
    public :: flat_motion, shaped, room_type, inverse_report, n_room, room_id, room_width, compute_inverse, check_size, &
        check_finite, check_count

    !> What inverse dynamics can give, whoever asks for it: the number of a room is its place here.
    integer, parameter :: n_room = 27
    integer, parameter :: room_id(n_room) = [result_driving_force, result_driving_speed, result_driving_power, result_reaction, &
        result_joint_variable, result_joint_rate, result_power_imbalance, result_rcond, result_singularity_distance, &
        result_error, result_driving_force_error, result_reaction_error, result_transmission_angle, result_growth, &
        result_assembly, result_friction, result_friction_power, result_transmission_force, result_motor_torque, &
        result_motor_speed, result_motor_power, result_transmission_loss, result_motor_current, result_torque_margin, &
        result_contact_force, result_pressure_angle, result_strand_force]

    !> What a caller gives, sample after sample.
    type :: flat_motion
        integer :: n = 0                                 !! samples
        integer :: first = 0                             !! number of the first one in messages
        real(c_double), pointer, contiguous, dimension(:) :: q => null(), qd => null(), qdd => null()    !! (n_q*n) [m, rad]
        real(c_double), pointer, contiguous :: load(:) => null()       !! (6*n_load*n), or (6*n_load) for all [N, N m]
        real(c_double), pointer, contiguous :: t(:) => null()          !! instants [s], for laws over the state that ask for them
                                                                       !! (n), or one for all; null: not given
        real(c_double), pointer, contiguous :: attitude(:) => null()   !! of `take_attitudes` (attitude_size*n_attitude*n),
                                                                       !! or one 0; null: all go by their angles
    end type flat_motion

    !> Where a result goes; null: it is not wanted.
    type :: room_type
        real(c_double), pointer, contiguous :: real(:) => null()       !! (width*n), sample after sample
        integer(c_int), pointer, contiguous :: integer(:) => null()    !! in its place for what is a whole number
    end type room_type

    !> What a batch tells of itself.
    type :: inverse_report
        type(road_counts) :: roads
        integer :: lost_sample = 0                       !! the first to which the assembly was not followed; 0: none
        character(len=message_len) :: lost_in_words = ""
        integer :: n_passed = 0                          !! change points, where the samples follow each other
    end type inverse_report

contains

    !> Numbers that a sample has in a room.
    pure integer function room_width(model, id) result(width)
        type(model_type), intent(in) :: model
        integer, intent(in) :: id                        !! one of `room_id`

        select case (id)
        case (result_driving_power)
            width = model%n_actuator
        case (result_motor_torque, result_motor_speed, result_motor_power, result_transmission_loss)
            width = size(model%motor)
        case (result_torque_margin)
            width = count(has_limits(model%scene%actuator%motor))
        case (result_motor_current)
            width = count(model%scene%actuator%motor%torque_constant > 0)
        case default
            width = result_width(model, id)
        end select
    end function room_width

    !> A batch. A sample that fails has its status, and NaN for results.
    !>
    !> **Errors**: arrays of a wrong size, input that is not finite, a scene or solver that cannot give what is wanted.
    subroutine compute_inverse(scene, options, given, room, sample_status, report, status)
        type(open_scene), intent(inout) :: scene
        type(inverse_options), intent(in) :: options     !! what is wanted of its errors, rcond, distance is seen from the rooms
        type(flat_motion), intent(in) :: given
        type(room_type), intent(in) :: room(n_room)
        integer(c_int), intent(inout), target, contiguous :: sample_status(:)   !! (n)
        type(inverse_report), intent(inout) :: report
        type(status_type), intent(inout) :: status
        type(inverse_solver), pointer :: solver
        type(assembly_trail) :: trail
        type(turn_count) :: turns
        type(inverse_results) :: results
        type(inverse_options) :: own
        type(motion_batch) :: motion
        real(c_double), pointer, contiguous :: speed2(:, :), power2(:, :)
        real(c_double), allocatable, target :: turned(:, :, :), spin(:, :), spin_rate(:, :)

        own = options
        call see_estimates(room, own)
        call hold_texts()
        call check_count(given%n, status)
        if (status%is_ok()) call find_solver(scene, own, is_wanted(room, result_reaction) &
                                             .or. is_wanted(room, result_contact_force), solver, status)
        if (status%is_ok()) call check_arrays(scene%model, given, room, sample_status, status)
        if (status%is_ok()) call check_input(scene%model, given, status)
        if (status%is_ok() .and. .not. associated(given%t)) call require_no_instants(scene%model%scene, status)
        if (goes_by_quaternions(given)) call check_attitudes(scene%model, given, own%in_order, status)
        call release_texts()
        if (.not. status%is_ok()) return
        results%status => sample_status
        call use_rooms(scene%model, given%n, room, results)
        call add_sources(scene%model, room, given%n, results)
        call take_motion(scene%model, given, turned, spin, spin_rate, motion)
        if (own%in_order) then
            call run_prepared(scene%model, solver, own%threads, motion, results, trail=trail, turns=turns)
        else
            call run_prepared(scene%model, solver, own%threads, motion, results)
        end if
        report%roads = results%roads
        report%lost_sample = results%lost_sample
        report%lost_in_words = results%lost_in_words
        report%n_passed = trail%n_crossed
        if (is_wanted(room, result_driving_power) .or. is_wanted(room, result_driving_speed)) &
            call give_power(scene%model%n_actuator)
        if (results%wants(result_transmission_force)) call give_motor_loads(size(scene%model%motor))
        call results%free()

    contains

        !> Speed and power of the actuators; one of them may be unwanted.
        subroutine give_power(n_actuator)
            integer, intent(in) :: n_actuator
            real(c_double), allocatable, target :: unwanted(:)

            if (.not. (is_wanted(room, result_driving_power) .and. is_wanted(room, result_driving_speed))) &
                allocate (unwanted(n_actuator*given%n))
            call view(result_driving_speed, n_actuator, unwanted, speed2)
            call view(result_driving_power, n_actuator, unwanted, power2)
            call find_driving_power(scene%layout, results%of(result_driving_force)%x, results%of(result_joint_rate)%x, &
                                    speed2, power2)
            if (all_are_finite(size(power2, kind=int64), power2)) return
            where (sample_status == sample_ok .and. .not. all(abs(power2) <= huge(1.0_c_double), dim=1)) &
                sample_status = sample_undefined
        end subroutine give_power

        !> What follows of the motors.
        subroutine give_motor_loads(n_motor)
            integer, intent(in) :: n_motor
            real(c_double), dimension(:, :), allocatable :: torque, speed, power, loss, current, margin

            allocate (torque(n_motor, given%n), speed(n_motor, given%n), power(n_motor, given%n), loss(n_motor, given%n))
            if (is_wanted(room, result_motor_current)) allocate (current(n_motor, given%n))
            if (is_wanted(room, result_torque_margin)) allocate (margin(n_motor, given%n))
            call find_motor_loads(scene%layout, results%of(result_driving_force)%x, results%of(result_transmission_force)%x, &
                                  results%of(result_joint_rate)%x, torque, speed, power, loss, current, margin)
            call give(result_motor_torque, torque)
            call give(result_motor_speed, speed)
            call give(result_motor_power, power)
            call give(result_transmission_loss, loss)
            if (allocated(current)) call give(result_motor_current, current)
            if (allocated(margin)) call give(result_torque_margin, margin)
            where (sample_status == sample_ok .and. .not. all(abs(power) + abs(torque) <= huge(1.0_c_double), dim=1)) &
                sample_status = sample_undefined
        end subroutine give_motor_loads

        subroutine give(id, values)
            integer, intent(in) :: id
            real(c_double), intent(in) :: values(:, :)

            if (is_wanted(room, id)) room(findloc(room_id, id, dim=1))%real = reshape(values, [size(values)])
        end subroutine give

        subroutine view(id, n_actuator, unwanted, values)
            integer, intent(in) :: id, n_actuator
            real(c_double), allocatable, intent(in), target :: unwanted(:)
            real(c_double), pointer, contiguous, intent(out) :: values(:, :)

            if (is_wanted(room, id)) then
                values(1:n_actuator, 1:given%n) => room(findloc(room_id, id, dim=1))%real
            else
                values(1:n_actuator, 1:given%n) => unwanted
            end if
        end subroutine view
    end subroutine compute_inverse

    !> Estimates and conditions that somebody has made room for.
    pure subroutine see_estimates(room, options)
        type(room_type), intent(in) :: room(n_room)
        type(inverse_options), intent(inout) :: options

        ! the bound of LAPACK needs no probe
        options%wants_errors = is_wanted(room, result_driving_force_error) .or. is_wanted(room, result_reaction_error) &
                               .or. (is_wanted(room, result_error) .and. options%solver /= solver_lapack)
        options%wants_rcond = is_wanted(room, result_rcond)
        options%wants_distance = is_wanted(room, result_singularity_distance)
    end subroutine see_estimates

    pure logical function is_wanted(room, id)
        type(room_type), intent(in) :: room(n_room)
        integer, intent(in) :: id                        !! one of `room_id`

        associate (place => findloc(room_id, id, dim=1))
            is_wanted = associated(room(place)%real) .or. associated(room(place)%integer)
        end associate
    end function is_wanted

    !> Results that wanted ones follow from, where they have no room of their own.
    subroutine add_sources(model, room, n, results)
        type(model_type), intent(in) :: model
        type(room_type), intent(in) :: room(n_room)
        integer, intent(in) :: n
        type(inverse_results), intent(inout) :: results
        integer :: i

        if (any([(is_motor_load(room_id(i)) .and. is_wanted(room, room_id(i)), i=1, n_room)])) &
            call results%add(model, result_transmission_force, n)
        if (.not. (is_wanted(room, result_driving_power) .or. is_wanted(room, result_driving_speed) &
                   .or. results%wants(result_transmission_force))) return
        call results%add(model, result_driving_force, n)
        call results%add(model, result_joint_rate, n)
    end subroutine add_sources

    pure logical function goes_by_quaternions(given)
        type(flat_motion), intent(in) :: given

        goes_by_quaternions = .false.
        if (associated(given%attitude)) goes_by_quaternions = any(given%attitude /= 0)
    end function goes_by_quaternions

    !> The caller's arrays as the engine takes them. Where attitudes go by quaternions rates are turned, in arrays of their own.
    subroutine take_motion(model, given, turned, spin, spin_rate, motion)
        type(model_type), intent(in) :: model
        type(flat_motion), intent(in) :: given
        real(c_double), allocatable, target, intent(out) :: turned(:, :, :)    !! quaternions; not allocated: all go by their angles
        real(c_double), allocatable, target, intent(out) :: spin(:, :), spin_rate(:, :)
        type(motion_batch), intent(out) :: motion

        motion = shaped(model, given)
        if (.not. goes_by_quaternions(given)) return
        call turn_by_quaternion(model, reshape(given%attitude, [attitude_size, model%n_attitude, given%n]), motion%qd, motion%qdd, &
                                spin, spin_rate, turned)
        motion%qd => spin
        motion%qdd => spin_rate
        if (allocated(turned)) motion%quaternion => turned
    end subroutine take_motion

    !> The same numbers as arrays whose last dimension is the sample.
    function shaped(model, given) result(motion)
        type(model_type), intent(in) :: model
        type(flat_motion), intent(in) :: given
        type(motion_batch) :: motion

        if (associated(given%q)) motion%q(1:model%n_q, 1:given%n) => given%q
        if (associated(given%qd)) motion%qd(1:model%n_q, 1:given%n) => given%qd
        if (associated(given%qdd)) motion%qdd(1:model%n_q, 1:given%n) => given%qdd
        if (associated(given%load)) motion%load(1:6, 1:model%n_load, 1:n_loads(model, given)) => given%load
        motion%t => given%t
    end function shaped

    !> Loads are given for each sample, or once for all; where there are none, there are none of each sample.
    pure integer function n_loads(model, given) result(n)
        type(model_type), intent(in) :: model
        type(flat_motion), intent(in) :: given

        n = merge(1, given%n, model%n_load > 0 .and. size(given%load) == 6*model%n_load)
    end function n_loads

    !> Does a result follow from what a motor's transmission passes on?
    pure logical function is_motor_load(id)
        integer, intent(in) :: id                        !! one of `room_id`

        is_motor_load = any(id == [result_motor_torque, result_motor_speed, result_motor_power, result_motor_current, &
                                   result_transmission_loss, result_torque_margin])
    end function is_motor_load

    !> Have the engine write into the rooms.
    subroutine use_rooms(model, n, room, results)
        type(model_type), intent(in) :: model
        integer, intent(in) :: n
        type(room_type), intent(in) :: room(n_room)
        type(inverse_results), intent(inout) :: results
        integer :: i

        do i = 1, n_room
            if (associated(room(i)%integer)) results%assembly => room(i)%integer    ! the only one
            associate (id => room_id(i), width => room_width(model, room_id(i)))
                if (.not. associated(room(i)%real) .or. width == 0 .or. .not. is_of_inverse(id)) cycle
                if (id /= result_driving_speed) results%of(id)%x(1:width, 1:n) => room(i)%real    ! that follows from the joints'
            end associate
        end do
    end subroutine use_rooms

    ! ---------------------------------------------------------------- checks

    !> Samples are counted in whole blocks, by a default integer.
    subroutine check_count(n, status)
        integer, intent(in) :: n
        type(status_type), intent(inout) :: status
        integer, parameter :: most = huge(1) - lanes

        if (n < 0 .or. n > most) call fail(status, status_bad_input, to_text(n)//" samples (expected 0 to "//to_text(most)//")")
    end subroutine check_count

    !> Without instants nothing can be computed that depends on time besides the motion and the loads of the call.
    subroutine require_no_instants(scene, status)
        type(scene_type), intent(in) :: scene
        type(status_type), intent(inout) :: status
        character(len=*), parameter :: expected = ", and no instants are given (expected the instant of each sample)"

        if (scene%base%moves) then
            call fail(status, status_bad_input, "the frame of the scene moves with time"//expected)
        else if (any(payload_changes(scene%payload))) then
            call fail(status, status_bad_input, "the mass of a payload of the scene changes with time"//expected)
        else if (takes_time(scene)) then
            call fail(status, status_bad_input, "a law of the scene asks for the time as well as the state"//expected)
        end if
    end subroutine require_no_instants

    subroutine check_arrays(model, given, room, sample_status, status)
        type(model_type), intent(in) :: model
        type(flat_motion), intent(in) :: given
        type(room_type), intent(in) :: room(n_room)
        integer(c_int), intent(in) :: sample_status(:)
        type(status_type), intent(inout) :: status
        integer :: i

        call check_size("q", size(given%q, kind=int64), model%n_q, given%n, status)
        call check_size("qd", size(given%qd, kind=int64), model%n_q, given%n, status)
        call check_size("qdd", size(given%qdd, kind=int64), model%n_q, given%n, status)
        call check_size("load", size(given%load, kind=int64), 6*model%n_load, n_loads(model, given), status)
        call check_size("status", size(sample_status, kind=int64), 1, given%n, status)
        do i = 1, n_room
            associate (width => room_width(model, room_id(i)))
                if (associated(room(i)%real)) &
                    call check_size(result_name(room_id(i)), size(room(i)%real, kind=int64), width, given%n, status)
                if (associated(room(i)%integer)) &
                    call check_size(result_name(room_id(i)), size(room(i)%integer, kind=int64), width, given%n, status)
            end associate
        end do
    end subroutine check_arrays

    subroutine check_size(name, given, width, n, status)
        character(len=*), intent(in) :: name
        integer(int64), intent(in) :: given
        integer, intent(in) :: width, n                  !! numbers of a sample, samples
        type(status_type), intent(inout) :: status

        if (given == int(width, int64)*n .or. (width == 0 .and. given <= 1)) return    ! numpy's empty arrays come as one number
        call fail(status, status_bad_input, trim(name)//": "//long_to_text(given)//" values given (expected " &
                  //long_to_text(int(width, int64)*n)//")")
    end subroutine check_size

    function long_to_text(number) result(text)
        integer(int64), intent(in) :: number
        character(len=:), allocatable :: text
        character(len=20) :: buffer

        write (buffer, "(i0)") number
        text = trim(buffer)
    end function long_to_text

    subroutine check_input(model, given, status)
        type(model_type), intent(in) :: model
        type(flat_motion), intent(in) :: given
        type(status_type), intent(inout) :: status

        call check_finite("q", model, given%first, given%n, given%q, status)
        call check_finite("qd", model, given%first, given%n, given%qd, status)
        call check_finite("qdd", model, given%first, given%n, given%qdd, status)
        call check_finite_loads(model, given%first, n_loads(model, given), given%load, status)
    end subroutine check_input

    !> Quaternions are there for all samples, and samples in order may not go past a pole unseen.
    subroutine check_attitudes(model, given, in_order, status)
        type(model_type), intent(in) :: model
        type(flat_motion), intent(in) :: given
        logical, intent(in) :: in_order
        type(status_type), intent(inout) :: status

        call check_size("attitude", size(given%attitude, kind=int64), attitude_size*model%n_attitude, given%n, status)
        if (in_order .and. status%is_ok()) &
            call refuse_way_past_pole(model, reshape(given%attitude, [attitude_size, model%n_attitude, given%n]), given%t, status)
    end subroutine check_attitudes

    !> NaN or infinite input is refused by name and place.
    subroutine check_finite(name, model, first, n, values, status)
        character(len=*), intent(in) :: name
        type(model_type), intent(in) :: model
        integer, intent(in) :: first, n
        real(c_double), intent(in) :: values(model%n_q, n)
        type(status_type), intent(inout) :: status
        integer :: i, k

        if (all_are_finite(size(values, kind=int64), values)) return
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

        if (all_are_finite(size(values, kind=int64), values)) return
        do i = 1, n
            if (all(ieee_is_finite(values(:, :, i)))) cycle
            do k = 1, model%n_load
                if (.not. all(ieee_is_finite(values(:, k, i)))) call fail(status, status_bad_input, "wrench "// &
                    quoted(model%scene%load(k)%name)//": sample "//to_text(first + i - 1)//" is not a finite number")
            end do
            return
        end do
    end subroutine check_finite_loads
end module linkdyn_inverse_call
