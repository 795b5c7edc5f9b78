!> A chunk of a forward run as a block of results.
module linkdyn_forward_block
    use linkdyn_block_results, only: put_into_block
    use linkdyn_forward, only: forward_results, forward_run, advance_forward
    use linkdyn_kinds, only: wp
    use linkdyn_results, only: layout_type, block_type, view_values, find_driving_power, flag_unsound, view_motor_loads
    use linkdyn_result_kinds, only: result_time, result_q, result_qd, result_driving_force, result_driving_speed, &
        result_driving_power, result_joint_rate, result_work, result_step, result_stand_in, result_transmission_force, &
        result_brake_torque, result_controller_target, result_controller_error, result_controller_output, &
        result_controller_limited, result_clutch_force, result_clutch_slip, result_clutch_state, result_cylinder_pressure, &
        result_cylinder_flow, result_driving_force_error, result_reaction_error
    use linkdyn_roads, only: road_counts
    implicit none (type, external)
    private
    public :: advance_block, open_block, complete_block

contains

    !> Go on through some instants.
    subroutine advance_block(run, layout, t, block, roads, n_done, seconds)
        type(forward_run), intent(inout), target :: run
        type(layout_type), intent(in) :: layout
        real(wp), intent(in) :: t(:)                  !! [s]
        type(block_type), intent(inout), target :: block
        type(road_counts), intent(out) :: roads
        integer, intent(out) :: n_done                !! instants dealt with; the others of the block are not filled
        real(wp), intent(in), optional :: seconds     !! come back after about that time
        type(forward_results) :: results
        real(wp), pointer :: time(:)
        real(wp), allocatable, target :: brake(:, :)

        call view_values(layout, result_time, size(t), block, time)
        call open_block(run, layout, size(t), block, brake, results)
        time = t
        results%time => time
        call advance_forward(run, t, results, n_done, seconds)
        roads = results%forces%roads
        call complete_block(layout, n_done, block, results)
    end subroutine advance_block

    !> Let the results of samples go where a block keeps them.
    subroutine open_block(run, layout, n, block, brake, results)
        type(forward_run), intent(in) :: run
        type(layout_type), intent(in) :: layout
        integer, intent(in) :: n                      !! samples
        type(block_type), intent(in), target :: block
        real(wp), allocatable, target, intent(out) :: brake(:, :)    !! room for them, if they are not among the results
        type(forward_results), intent(inout) :: results
        !> The run's estimates are made afterwards, and speeds follow from the joints'.
        integer, parameter :: elsewhere(3) = [result_driving_speed, result_driving_force_error, result_reaction_error]

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
        call view_values(layout, result_cylinder_pressure, n, block, results%pressure)
        call view_values(layout, result_cylinder_flow, n, block, results%flow)
        call view_values(layout, result_brake_torque, n, block, results%brake)
        if (.not. associated(results%brake)) then
            allocate (brake(size(run%model%motor), n))
            results%brake => brake
        end if
        call put_into_block(layout, n, block, elsewhere, results%forces)
        call results%forces%add(run%model, result_driving_force, n)
        call results%forces%add(run%model, result_joint_rate, n)
    end subroutine open_block

    !> What follows from the results of samples that are done, and the last look at them. Nothing is put there any more.
    subroutine complete_block(layout, n, block, results)
        type(layout_type), intent(in) :: layout
        integer, intent(in) :: n                      !! samples done
        type(block_type), intent(inout), target :: block
        type(forward_results), intent(inout) :: results
        real(wp), pointer :: speed(:, :), power(:, :)

        call view_values(layout, result_driving_speed, n, block, speed)
        call view_values(layout, result_driving_power, n, block, power)
        if (associated(power)) &
            call find_driving_power(layout, found(result_driving_force), found(result_joint_rate), speed, power)
        call view_motor_loads(layout, found(result_driving_force), found(result_transmission_force), found(result_joint_rate), &
                              n, block, results%brake(:, :n))
        call results%forces%free()
        call flag_unsound(layout, n, block)

    contains

        !> A result of the samples that are done; null: nobody wants it.
        function found(id)
            integer, intent(in) :: id                 !! one of `result_*`
            real(wp), pointer, contiguous :: found(:, :)

            nullify (found)
            if (results%forces%wants(id)) found => results%forces%of(id)%x(:, :n)
        end function found
    end subroutine complete_block
end module linkdyn_forward_block
