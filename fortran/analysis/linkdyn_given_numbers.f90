!> What the equations take beside the motion of the links, on a block of lanes: coordinates as they are told, loads, what laws over
!> the state give, the frame's motion, payloads, pushes.
module linkdyn_given_numbers
    use linkdyn_base_motion, only: n_base, evaluate_base
    use linkdyn_constants, only: two_pi
    use linkdyn_contact, only: n_part
    use linkdyn_inputs, only: in_q, in_qd, in_qdd, in_load, in_pull, in_base, in_payload, in_friction, in_counted, in_effort, &
        in_target, in_stop, in_clutch, in_sense, in_unknown, in_number, in_shared
    use linkdyn_joint_rates, only: measure_variable
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state
    use linkdyn_lane_count, only: lanes
    use linkdyn_equations_on_lanes, only: lane_numbers
    use linkdyn_measures, only: find_laws
    use linkdyn_model, only: model_type, gives_attitude, attitude_angles, pull_power, friction_is_shared
    use linkdyn_numbers, only: numbers_of
    use linkdyn_payload_measures, only: find_payloads
    use linkdyn_scene, only: law_spec, law_over, coordinate_joint, n_stop, n_clutch
    implicit none (type, external)
    private
    public :: prepare_numbers, take_numbers, take_pushes, take_coordinates

contains

    !> Room for all that kernels are given, block by block, on lanes.
    subroutine prepare_numbers(model, with_model, numbers)
        type(model_type), intent(in) :: model
        logical, intent(in) :: with_model              !! the model's own numbers are among them
        type(lane_numbers), intent(inout) :: numbers

        call make(in_q, model%n_q)
        call make(in_qd, model%n_q)
        call make(in_qdd, model%n_q)
        call make(in_counted, model%n_q)
        call make(in_load, 6*model%n_load)
        call make(in_pull, size(model%scene%spring))
        call make(in_base, n_base)
        call make(in_payload, size(model%payload))
        call make(in_friction, size(model%contact))
        call make(in_sense, n_part*size(model%contact))
        call make(in_shared, merge(6*model%n_joint, 0, friction_is_shared(model)))
        call make(in_effort, model%n_actuator)
        call make(in_target, 2*model%n_actuator)
        call make(in_stop, n_stop(model%scene))
        call make(in_clutch, n_clutch(model%scene))
        call make(in_unknown, model%n_row + model%n_actuator)      ! as many as equations, of drives that share among them
        if (with_model) numbers%of(in_number)%x = spread(numbers_of(model), 1, lanes)

    contains

        subroutine make(block, n)
            integer, intent(in) :: block, n

            allocate (numbers%of(block)%x(lanes, n), source=0.0_wp)
        end subroutine make
    end subroutine prepare_numbers

    !> Numbers of the block whose motion is in the state. A law without a value leaves its lane undefined.
    subroutine take_numbers(model, state, load, numbers)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(inout) :: state
        real(wp), intent(in) :: load(:, :, :)          !! given beside the laws (lane, 6, n_load) [N, N m]
        type(lane_numbers), intent(inout) :: numbers

        state%undefined = .false.
        call take_coordinates(model, state, numbers)
        call find_payloads(model, state)
        numbers%of(in_payload)%x = state%payload
        call take_pushes(state, numbers)
        numbers%of(in_load)%x = reshape(load, [lanes, 6*model%n_load])
        if (size(model%scene%laws%law) > 0) call add_laws(model, state, numbers)
        if (model%scene%base%moves) call find_base(model, state, numbers%of(in_base)%x)
    end subroutine take_numbers

    !> What stops push, and clutches.
    subroutine take_pushes(state, numbers)
        type(kinematic_state), intent(in) :: state
        type(lane_numbers), intent(inout) :: numbers

        numbers%of(in_stop)%x = state%stop_force
        numbers%of(in_clutch)%x = state%clutch_force
    end subroutine take_pushes

    !> Coordinates with their turns; angles of an attitude that comes as quaternion are measured.
    subroutine take_coordinates(model, state, numbers)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        type(lane_numbers), intent(inout) :: numbers
        integer :: i, j

        numbers%of(in_q)%x = state%q + two_pi*state%turns
        numbers%of(in_qd)%x = state%qd
        numbers%of(in_qdd)%x = state%qdd
        numbers%of(in_counted)%x = state%counted
        if (.not. any(state%by_quaternion)) return
        do i = 1, size(model%step)
            if (.not. gives_attitude(model, model%step(i))) cycle
            if (.not. state%by_quaternion(model%step(i)%first)) cycle
            associate (angle => attitude_angles(model%step(i)), c => model%scene%coordinate)
                do j = 1, 3
                    if (c(angle(j))%kind /= coordinate_joint) cycle
                    call measure_variable(model, state, c(angle(j))%joint, c(angle(j))%variable, spread(0.0_wp, 1, lanes), &
                                          numbers%of(in_q)%x(:, angle(j)), numbers%of(in_qd)%x(:, angle(j)))
                end do
            end associate
        end do
    end subroutine take_coordinates

    !> Laws over the state act in loads and springs.
    subroutine add_laws(model, state, numbers)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(inout) :: state
        type(lane_numbers), intent(inout) :: numbers
        integer :: i, k

        call find_laws(model, state)
        associate (scale => model%scene%laws%scale)            ! of a similar mechanism: its force over that of the law
            do i = 1, model%n_load
                do k = 1, 3
                    call add(model%scene%load(i)%force(k), scale, numbers%of(in_load)%x(:, 6*i - 6 + k))
                    call add(model%scene%load(i)%moment(k), scale**2, numbers%of(in_load)%x(:, 6*i - 3 + k))
                end do
            end do
            numbers%of(in_pull)%x = 0
            do i = 1, size(model%scene%spring)
                associate (spring => model%scene%spring(i))
                    call add(spring%force, scale**pull_power(model, spring), numbers%of(in_pull)%x(:, i))
                end associate
            end do
        end associate

    contains

        subroutine add(law, scale, x)
            type(law_spec), intent(in) :: law
            real(wp), intent(in) :: scale
            real(wp), intent(inout) :: x(lanes)

            if (law%kind /= law_over) return
            x = x + scale*state%law(:, law%law)
            state%undefined = state%undefined .or. .not. abs(state%law(:, law%law)) <= huge(1.0_wp)
        end subroutine add
    end subroutine add_laws

    !> What is felt of the frame's motion at the instants of the lanes.
    subroutine find_base(model, state, base)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        real(wp), intent(out) :: base(lanes, n_base)
        real(wp) :: now(n_base, 1)
        integer :: lane

        do lane = 1, lanes
            if (lane == 1) then
                call evaluate_base(model, state%time(1:1), now)
            else if (state%time(lane) /= state%time(lane - 1)) then
                call evaluate_base(model, state%time(lane:lane), now)
            end if
            base(lane, :) = now(:, 1)
        end do
    end subroutine find_base
end module linkdyn_given_numbers
