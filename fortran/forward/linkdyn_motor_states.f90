!> Motors in a run: what brakes take of their torques, and how currents in their windings change.
module linkdyn_motor_states
    use linkdyn_equations, only: equations_type, equation_workspace
    use linkdyn_forward_record, only: forward_record
    use linkdyn_forward_state, only: state_layout
    use linkdyn_joint_rates, only: actuator_rates
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_model, only: model_type
    use linkdyn_motor_laws, only: torque_of_law, brake_torque, current_rate
    use linkdyn_scene, only: is_at_motor
    implicit none (type, external)
    private
    public :: motor_states, prepare_motors, motors_have_laws, drive_by_motors, drive_record_by_motors, pack_current_rates, &
        switch_brakes

    type :: motor_states
        real(wp), allocatable :: brake(:, :)           !! taken of motors' torques at the state evaluated last (lane, n_actuator) [N
                                                       !! m]
        real(wp), allocatable :: current_rate(:, :)    !! in windings, at the states evaluated last (lane, n_actuator) [A/s]
        real(wp) :: t_braked(lanes) = 0                !! end of the accepted step: a brake that comes on there was off until then
                                                       !! [s]
        real(wp), allocatable :: switched(:, :)        !! last event that switched a brake (lane, n_actuator) [s]; -huge: none
        logical, allocatable :: is_on(:, :)            !! since then (lane, n_actuator)
    end type motor_states

contains

    subroutine prepare_motors(n_actuator, motors)
        integer, intent(in) :: n_actuator
        type(motor_states), intent(inout) :: motors

        allocate (motors%brake(lanes, n_actuator), motors%current_rate(lanes, n_actuator), source=0.0_wp)
        allocate (motors%switched(lanes, n_actuator), source=-huge(1.0_wp))
        allocate (motors%is_on(lanes, n_actuator), source=.false.)
    end subroutine prepare_motors

    !> Are there laws that are about motors?
    pure logical function motors_have_laws(model)
        type(model_type), intent(in) :: model

        motors_have_laws = any(is_at_motor(model%scene%actuator%law%side))
    end function motors_have_laws

    !> What motors give at their joint variables, where laws are about them, less what brakes take of it.
    subroutine drive_by_motors(model, equations, layout, t, y, workspace, motors)
        type(model_type), intent(in) :: model
        type(equations_type), intent(in) :: equations
        type(state_layout), intent(in) :: layout
        real(wp), intent(in) :: t(lanes)               !! [s]
        real(wp), intent(in) :: y(:, :)                !! (lane, n)
        type(equation_workspace), intent(inout) :: workspace   !! motion of the states, and what laws give
        type(motor_states), intent(inout) :: motors
        real(wp) :: speed(lanes), torque(lanes)
        integer :: i, lane

        call actuator_rates(model, workspace%state, workspace%driving_rate)
        do i = 1, model%n_actuator
            associate (drive => model%scene%actuator(i)%law, motor => model%scene%actuator(i)%motor, &
                       force => workspace%driving_force(:, i))
                if (equations%unknown%drive(i) .or. .not. is_at_motor(drive%side)) cycle
                speed = motor%ratio*workspace%driving_rate(:, i)
                motors%brake(:, i) = brake_torque(motor, min(t, motors%t_braked), motors%switched(:, i), motors%is_on(:, i), speed)
                do lane = 1, lanes
                    call find_torque(model, layout, i, lane, y, force(lane), speed(lane), motors, torque(lane))
                end do
                force = motor%ratio*(torque - motors%brake(:, i))
            end associate
        end do
        workspace%motor_force = workspace%driving_force
    end subroutine drive_by_motors

    !> The same in a record's samples, whose states are placed.
    subroutine drive_record_by_motors(model, equations, layout, n, t, y, record, motors)
        type(model_type), intent(in) :: model
        type(equations_type), intent(in) :: equations
        type(state_layout), intent(in) :: layout
        integer, intent(in) :: n                       !! samples
        real(wp), intent(in) :: t(:)                   !! [s] (lane)
        real(wp), intent(in) :: y(:, :)                !! (lane, n)
        type(forward_record), intent(inout) :: record
        type(motor_states), intent(inout) :: motors
        real(wp) :: speed, braked, torque
        integer :: i, lane

        do i = 1, model%n_actuator
            associate (drive => model%scene%actuator(i)%law, motor => model%scene%actuator(i)%motor, samples => record%samples)
                if (equations%unknown%drive(i) .or. .not. is_at_motor(drive%side)) cycle
                do lane = 1, n
                    associate (effort => samples%effort(i, lane))
                        speed = motor%ratio*samples%measured(samples%n_measure + i, lane)
                        braked = brake_torque(motor, min(t(lane), motors%t_braked(lane)), motors%switched(lane, i), &
                                              motors%is_on(lane, i), speed)
                        call find_torque(model, layout, i, lane, y, effort, speed, motors, torque)
                        effort = motor%ratio*(torque - braked)
                    end associate
                end do
            end associate
        end do
    end subroutine drive_record_by_motors

    !> Torque of a motor by its law; by its current, whose rate is found on the way, if the winding has an inductance.
    subroutine find_torque(model, layout, i, lane, y, law, speed, motors, torque)
        type(model_type), intent(in) :: model
        type(state_layout), intent(in) :: layout
        integer, intent(in) :: i, lane                 !! actuator, lane
        real(wp), intent(in) :: y(:, :)                !! (lane, n)
        real(wp), intent(in) :: law                    !! what its law gives [N m, V]
        real(wp), intent(in) :: speed                  !! of the motor [rad/s]
        type(motor_states), intent(inout) :: motors
        real(wp), intent(out) :: torque                !! [N m]

        associate (motor => model%scene%actuator(i)%motor, drive => model%scene%actuator(i)%law, &
                   place => layout%current(i))
            if (place == 0) then
                torque = torque_of_law(motor, drive%side, law, speed)
                return
            end if
            motors%current_rate(lane, i) = current_rate(motor, law, y(lane, place), speed)
            torque = motor%torque_constant*y(lane, place)
        end associate
    end subroutine find_torque

    !> Rates of the currents that are in y. Lanes that are not used are like the last one.
    subroutine pack_current_rates(layout, n_used, motors, rate)
        type(state_layout), intent(in) :: layout
        integer, intent(in) :: n_used                  !! lanes
        type(motor_states), intent(in) :: motors
        real(wp), intent(inout) :: rate(:, :)          !! (lane, n)
        integer :: i, lane

        do i = 1, size(layout%current)
            if (layout%current(i) > 0) &
                rate(:, layout%current(i)) = motors%current_rate([(min(lane, n_used), lane=1, size(rate, 1))], i)
        end do
    end subroutine pack_current_rates

    !> An event switches the brakes that wait for it.
    subroutine switch_brakes(model, lane, event, t, motors, has_changed)
        type(model_type), intent(in) :: model
        integer, intent(in) :: lane, event
        real(wp), intent(in) :: t                      !! [s]
        type(motor_states), intent(inout) :: motors
        logical, intent(inout) :: has_changed
        integer :: i

        do i = 1, model%n_actuator
            associate (brake => model%scene%actuator(i)%motor%brake)
                if (.not. brake%is_given .or. .not. any([brake%from_event, brake%until_event] == event)) cycle
                motors%is_on(lane, i) = brake%from_event == event
                motors%switched(lane, i) = t
                motors%t_braked(lane) = t
                has_changed = .true.
            end associate
        end do
    end subroutine switch_brakes
end module linkdyn_motor_states
