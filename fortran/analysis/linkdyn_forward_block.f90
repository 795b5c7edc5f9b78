!> A chunk of a forward run as a block of results.
module linkdyn_forward_block
    use linkdyn_forward, only: forward_results, forward_run, advance_forward
    use linkdyn_kinds, only: wp
    use linkdyn_results, only: layout_type, block_type, view_values, find_driving_power, flag_unsound, result_time, &
        result_q, result_qd, result_qdd, result_driving_force, result_driving_speed, result_driving_power, result_reaction, &
        result_joint_variable, result_joint_rate, result_status, result_rcond, result_error, result_growth, &
        result_transmission_angle, result_power_imbalance, result_kinetic_energy, result_potential_energy, result_work, &
        result_closure, result_step, result_stand_in, result_assembly, result_friction, result_friction_power, &
        result_transmission_force, result_brake_torque, result_contact_force, result_pressure_angle, result_strand_force, &
        result_controller_target, result_controller_error, result_controller_output, result_controller_limited, view_motor_loads, &
        result_clutch_force, result_clutch_slip, result_clutch_state
    use linkdyn_roads, only: road_counts
    implicit none (type, external)
    private
    public :: advance_block

contains

    !> Go on through some instants.
    subroutine advance_block(run, layout, t, block, roads, n_done, seconds)
        type(forward_run), intent(inout) :: run
        type(layout_type), intent(in) :: layout
        real(wp), intent(in) :: t(:)                  !! [s]
        type(block_type), intent(inout), target :: block
        type(road_counts), intent(out) :: roads
        integer, intent(out) :: n_done                !! instants dealt with; the others of the block are not filled
        real(wp), intent(in), optional :: seconds     !! come back after about that time
        type(forward_results) :: results
        real(wp), pointer :: time(:), speed(:, :), power(:, :)
        real(wp), allocatable, target :: driving_force(:, :), joint_rate(:, :), brake(:, :)    ! if they are not among the results
        integer :: n

        n = size(t)
        call view_values(layout, result_time, n, block, time)
        call view_values(layout, result_q, n, block, results%q)
        call view_values(layout, result_qd, n, block, results%qd)
        call view_values(layout, result_work, n, block, results%work)
        call view_values(layout, result_step, n, block, results%step)
        call view_values(layout, result_stand_in, n, block, results%stand_in)
        call view_values(layout, result_controller_target, n, block, results%target)
        call view_values(layout, result_controller_error, n, block, results%control_error)
        call view_values(layout, result_controller_output, n, block, results%control_output)
        call view_values(layout, result_controller_limited, n, block, results%is_limited)
        call view_values(layout, result_clutch_force, n, block, results%clutch_force)
        call view_values(layout, result_clutch_slip, n, block, results%clutch_slip)
        call view_values(layout, result_clutch_state, n, block, results%clutch_state)
        call view_values(layout, result_driving_speed, n, block, speed)
        call view_values(layout, result_driving_power, n, block, power)
        call view_values(layout, result_brake_torque, n, block, results%brake)
        if (.not. associated(results%brake)) then
            allocate (brake(size(run%model%motor), n))
            results%brake => brake
        end if
        associate (forces => results%forces)
            call view_values(layout, result_qdd, n, block, forces%acceleration)
            call view_values(layout, result_status, n, block, forces%status)
            call view_values(layout, result_assembly, n, block, forces%assembly)
            call view_values(layout, result_driving_force, n, block, forces%driving_force)
            call view_values(layout, result_reaction, n, block, forces%reaction)
            call view_values(layout, result_friction, n, block, forces%friction)
            call view_values(layout, result_friction_power, n, block, forces%friction_power)
            call view_values(layout, result_transmission_force, n, block, forces%transmission_force)
            call view_values(layout, result_joint_variable, n, block, forces%joint_variable)
            call view_values(layout, result_joint_rate, n, block, forces%joint_rate)
            call view_values(layout, result_rcond, n, block, forces%rcond)
            call view_values(layout, result_error, n, block, forces%error)
            call view_values(layout, result_growth, n, block, forces%growth)
            call view_values(layout, result_power_imbalance, n, block, forces%power_imbalance)
            call view_values(layout, result_transmission_angle, n, block, forces%transmission_angle)
            call view_values(layout, result_contact_force, n, block, forces%contact_force)
            call view_values(layout, result_pressure_angle, n, block, forces%pressure_angle)
            call view_values(layout, result_strand_force, n, block, forces%strand_force)
            call view_values(layout, result_kinetic_energy, n, block, forces%kinetic_energy)
            call view_values(layout, result_potential_energy, n, block, forces%potential_energy)
            call view_values(layout, result_closure, n, block, forces%closure)
            if (.not. associated(forces%driving_force)) then
                allocate (driving_force(run%model%n_actuator, n))
                forces%driving_force => driving_force
            end if
            if (.not. associated(forces%joint_rate)) then
                allocate (joint_rate(run%model%n_variable, n))
                forces%joint_rate => joint_rate
            end if
        end associate
        time = t
        results%time => time
        call advance_forward(run, t, results, n_done, seconds)
        roads = results%forces%roads
        if (associated(power)) &
            call find_driving_power(layout, results%forces%driving_force(:, :n_done), results%forces%joint_rate(:, :n_done), &
                                    speed(:, :n_done), power(:, :n_done))
        call tell_motors()
        call flag_unsound(layout, n_done, block)

    contains

        subroutine tell_motors()
            real(wp), pointer, contiguous :: force(:, :), transmitted(:, :), rate(:, :)

            nullify (force, transmitted, rate)
            associate (forces => results%forces)
                force => forces%driving_force(:, :n_done)
                rate => forces%joint_rate(:, :n_done)
                if (associated(forces%transmission_force)) transmitted => forces%transmission_force(:, :n_done)
            end associate
            call view_motor_loads(layout, force, transmitted, rate, n_done, block, results%brake(:, :n_done))
        end subroutine tell_motors
    end subroutine advance_block
end module linkdyn_forward_block
