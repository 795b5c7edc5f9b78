!> What a block of lanes tells once its equations are solved, result by result.
module linkdyn_lane_results
    use linkdyn_belt_measures, only: measure_strands
    use linkdyn_cam_measures, only: measure_pressure_angles
    use linkdyn_result_kinds, only: result_driving_force, result_transmission_force, result_joint_variable, &
        result_joint_rate, result_driving_position, result_driving_speed, result_rcond, result_error, result_growth, &
        result_singularity_distance, result_qdd, result_kinetic_energy, result_potential_energy, result_closure, &
        result_position, result_rotation, result_pressure_angle, result_strand_force
    use linkdyn_equations, only: equations_type, equation_workspace, found_of
    use linkdyn_inverse_results, only: inverse_results
    use linkdyn_joint_rates, only: measure_joints, measure_variable, actuator_rates, joint_rate
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state, link_position, link_rotation
    use linkdyn_lane_count, only: lanes
    use linkdyn_model, only: model_type, step_pose, gives_attitude, attitude_angles
    use linkdyn_motion_measures, only: measure_energy, measure_closure
    use linkdyn_payload_measures, only: find_payloads, add_payload_energy
    use linkdyn_planar_motion, only: level_given
    use linkdyn_pose, only: rpy_rotation, rotate_rpy, rates_of_rpy, angular_acceleration_rpy
    use linkdyn_vec3, only: vec3, operator(-)
    implicit none (type, external)
    private
    public :: block_measures, prepare_measures, measure_block, values_of_block, tell_accelerations

    !> What is measured for several results at a time.
    type :: block_measures
        real(wp), allocatable :: variable(:, :), rate(:, :)    !! (lane, n_variable)
        real(wp), dimension(lanes) :: kinetic = 0, potential = 0, distance = 0
    end type block_measures

contains

    subroutine prepare_measures(model, measures)
        type(model_type), intent(in) :: model
        type(block_measures), intent(out) :: measures

        allocate (measures%variable(lanes, model%n_variable), measures%rate(lanes, model%n_variable), source=0.0_wp)
    end subroutine prepare_measures

    !> Measure what the results want. Where energies are wanted the state learns the masses of payloads.
    subroutine measure_block(model, results, state, measures)
        type(model_type), intent(in) :: model
        type(inverse_results), intent(in) :: results
        type(kinematic_state), intent(inout) :: state
        type(block_measures), intent(inout) :: measures

        if (any(results%wants([result_joint_variable, result_joint_rate]))) &
            call measure_joints(model, state, measures%variable, measures%rate)
        if (.not. any(results%wants([result_kinetic_energy, result_potential_energy]))) return
        call measure_energy(model, state, measures%kinetic, measures%potential)
        call find_payloads(model, state)
        call add_payload_energy(model, state, measures%kinetic, measures%potential)
    end subroutine measure_block

    !> The values of one result.
    subroutine values_of_block(model, id, workspace, measures, values)
        type(model_type), intent(in) :: model
        integer, intent(in) :: id                      !! one of `result_*`
        type(equation_workspace), intent(in) :: workspace
        type(block_measures), intent(in) :: measures
        real(wp), intent(out) :: values(:, :)          !! (lane, values of a sample)
        integer :: i

        select case (id)
        case (result_driving_force)
            values = workspace%driving_force
        case (result_transmission_force)
            values = workspace%transmitted(:, model%motor%actuator)
        case (result_qdd)
            values = workspace%acceleration
        case (result_rcond)
            values(:, 1) = workspace%rcond
        case (result_error)
            values(:, 1) = workspace%error
        case (result_growth)
            values(:, 1) = workspace%growth
        case (result_singularity_distance)
            values(:, 1) = measures%distance
        case (result_joint_variable)
            values = measures%variable
        case (result_joint_rate)
            values = measures%rate
        case (result_driving_position)
            call measure_driven(model, workspace%state, values)
        case (result_driving_speed)
            call actuator_rates(model, workspace%state, values)
        case (result_kinetic_energy)
            values(:, 1) = measures%kinetic
        case (result_potential_energy)
            values(:, 1) = measures%potential
        case (result_closure)
            call measure_closure(model, workspace%state, values(:, 1))
        case (result_position)
            call tell_positions(model, workspace%state, values)
        case (result_rotation)
            call tell_rotations(model, workspace%state, values)
        case (result_pressure_angle)
            call measure_pressure_angles(model, workspace%state, values)
        case (result_strand_force)
            do i = 1, size(model%belt)
                call measure_strands(model, i, workspace%state, values(:, 2*i - 1:2*i))
            end do
        case default                                   ! the equations' kernels tell it
            values = found_of(workspace, id, size(values, 2))
        end select
    end subroutine values_of_block

    !> Origins of the links.
    subroutine tell_positions(model, state, values)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        real(wp), intent(out) :: values(:, :)          !! (lane, 3 n_link)
        integer :: l, lane

        do l = 1, model%n_link
            do lane = 1, lanes
                values(lane, 3*l - 2:3*l) = link_position(model, state, l, lane)
            end do
        end do
    end subroutine tell_positions

    !> Axes of the links.
    subroutine tell_rotations(model, state, values)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        real(wp), intent(out) :: values(:, :)          !! (lane, 9 n_link)
        integer :: l, lane

        do l = 1, model%n_link
            do lane = 1, lanes
                values(lane, 9*l - 8:9*l) = reshape(link_rotation(model, state, l, lane), [9])
            end do
        end do
    end subroutine tell_rotations

    !> The driven joint variables; coordinates count turns.
    subroutine measure_driven(model, state, variable)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        real(wp), intent(out) :: variable(:, :)        !! (lane, n_actuator)
        real(wp) :: zero(lanes), ignored(lanes)
        integer :: i

        zero = 0
        do i = 1, model%n_actuator
            associate (actuator => model%scene%actuator(i))
                call measure_variable(model, state, actuator%joint, actuator%variable, zero, variable(:, i), ignored)
            end associate
        end do
    end subroutine measure_driven

    !> Accelerations found, as they are told: of attitudes as second derivatives of their angles, and of coordinates that others
    !> stand in for. Column 0 must be as it was.
    subroutine tell_accelerations(model, equations, has_stand_ins, workspace)
        type(model_type), intent(in) :: model
        type(equations_type), intent(in) :: equations
        logical, intent(in) :: has_stand_ins
        type(equation_workspace), intent(inout) :: workspace
        real(wp), allocatable :: of_own(:, :)

        if (has_stand_ins) of_own = own_accelerations(model, workspace)
        call turn_to_rpy(model, equations, workspace)
        if (.not. has_stand_ins) return
        associate (replaced => model%scene%coordinate%for_joint > 0)
            workspace%acceleration = merge(of_own, workspace%acceleration, spread(replaced, 1, lanes))
        end associate
    end subroutine tell_accelerations

    !> Accelerations of the scene's own coordinates: of those that others stand in for from these, of the others what is found.
    function own_accelerations(model, workspace) result(acceleration)
        type(model_type), intent(in) :: model
        type(equation_workspace), intent(in) :: workspace
        real(wp), allocatable :: acceleration(:, :)    !! (lane, n_q)
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
    end function own_accelerations

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
end module linkdyn_lane_results
