!> Controllers in a forward run: what they see of states, and what they put on top of the forces of drives.
module linkdyn_controlled_drives
    use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan
    use linkdyn_carried_assembly, only: carried_assembly
    use linkdyn_constants, only: two_pi
    use linkdyn_control_law, only: control_sight
    use linkdyn_controllers, only: controllers_type, run_continuous
    use linkdyn_drives, only: law_on_lanes, effort_scale
    use linkdyn_forward_state, only: state_layout
    use linkdyn_holding_forces, only: holding_forces, plan_holding_forces, find_holding_forces, free_holding_forces
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_model, only: model_type
    use linkdyn_motion_forces, only: motion_forces, find_motion_forces, measure_motion
    use linkdyn_scene, only: controller_spec, n_controller, is_sampled, side_joint, law_over, feed_law, feed_gravity, feed_inverse
    use linkdyn_status, only: status_type, sample_ok
    implicit none (type, external)
    private
    public :: controlled_drives, plan_control, wants_motion, find_demands, see_states, run_controllers, add_outputs, &
        pack_control_rates, free_control

    type :: controlled_drives
        type(controllers_type) :: state                !! what controllers remember and put out
        logical :: has_continuous = .false., has_sampled = .false.
        type(holding_forces), private :: holding       !! where one of them wants these
        real(wp), allocatable, private :: in_motion(:, :)      !! measures in the scene's motion, where one follows it (lane,
                                                               !! measure)
    end type controlled_drives

contains

    subroutine plan_control(model, control, status)
        type(model_type), intent(in) :: model
        type(controlled_drives), intent(inout) :: control
        type(status_type), intent(inout) :: status

        if (n_controller(model%scene) == 0) return
        associate (spec => model%scene%controller)
            control%has_sampled = any(is_sampled(spec))
            control%has_continuous = .not. all(is_sampled(spec))
            if (any(spec%feed == feed_gravity)) call plan_holding_forces(model, control%holding, status)
        end associate
        allocate (control%in_motion(lanes, size(model%scene%laws%measure)))
    end subroutine plan_control

    !> Does a controller look at the scene's motion?
    pure logical function wants_motion(model)
        type(model_type), intent(in) :: model

        wants_motion = .false.
        if (n_controller(model%scene) == 0) return
        wants_motion = any(model%scene%controller%follows_motion .or. model%scene%controller%feed == feed_inverse)
    end function wants_motion

    !> What controllers compare with and feed forward at states beside laws: the scene's motion, forces that it asks for, forces
    !> that hold.
    subroutine find_demands(model, layout, t, y, turns, n_used, is_wanted, assembly, of_motion, control)
        type(model_type), intent(in) :: model
        type(state_layout), intent(in) :: layout
        real(wp), intent(in) :: t(lanes)               !! [s]
        real(wp), intent(in) :: y(:, :)                !! (lane, n)
        real(wp), intent(in) :: turns(:, :)            !! of angles that are not in y (lane, n)
        integer, intent(in) :: n_used                  !! lanes
        logical, intent(in) :: is_wanted(:)            !! (n_controller)
        type(carried_assembly), intent(inout) :: assembly
        type(motion_forces), intent(inout) :: of_motion
        type(controlled_drives), intent(inout) :: control

        associate (spec => model%scene%controller)
            if (any(is_wanted .and. spec%follows_motion)) call measure_motion(t, of_motion, control%in_motion)
            if (any(is_wanted .and. spec%feed == feed_inverse)) call find_motion_forces(t, n_used, of_motion)
            if (any(is_wanted .and. spec%feed == feed_gravity)) call find_holding_forces(model, layout, t, y, turns, assembly, &
                control%holding)
        end associate
    end subroutine find_demands

    !> What controllers see at states, of which measures, laws over the state and demands are known. A similar mechanism's see the
    !> scene's size.
    subroutine see_states(model, t, measure, law, is_wanted, of_motion, control, sight)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: t(lanes)               !! [s]
        real(wp), intent(in) :: measure(:, :), law(:, :)       !! (lane, measure), (lane, law)
        logical, intent(in) :: is_wanted(:)            !! (n_controller)
        type(motion_forces), intent(in) :: of_motion
        type(controlled_drives), intent(in) :: control
        type(control_sight), intent(out) :: sight(:, :)        !! (lane, n_controller)
        real(wp) :: ignored(lanes)
        integer :: i

        associate (spec => model%scene%controller)
            do i = 1, size(spec)
                if (.not. is_wanted(i)) cycle
                associate (target => spec(i)%target)
                    if (spec(i)%follows_motion) then
                        sight(:, i)%target = control%in_motion(:, spec(i)%measure)
                        if (spec(i)%rate_measure > 0) sight(:, i)%target_rate = control%in_motion(:, spec(i)%rate_measure)
                    else if (target%kind == law_over) then
                        sight(:, i)%target = law(:, target%law)
                    else
                        call law_on_lanes(target, t, sight(:, i)%target, sight(:, i)%target_rate, ignored)
                    end if
                end associate
                sight(:, i)%measured = measure(:, spec(i)%measure)
                if (spec(i)%rate_measure > 0) sight(:, i)%measured_rate = measure(:, spec(i)%rate_measure)
                if (model%scene%laws%measure(spec(i)%measure)%wraps) sight(:, i)%measured = sight(:, i)%measured &
                    - two_pi*anint((sight(:, i)%measured - sight(:, i)%target)/two_pi)
                sight(:, i)%feed = feed_forward(model, spec(i), t, law, of_motion, control%holding)
            end do
        end associate
    end subroutine see_states

    !> What a controller puts out beside what its error asks for.
    function feed_forward(model, spec, t, law, of_motion, holding) result(feed)
        type(model_type), intent(in) :: model
        type(controller_spec), intent(in) :: spec
        real(wp), intent(in) :: t(lanes)               !! [s]
        real(wp), intent(in) :: law(:, :)              !! (lane, law)
        type(motion_forces), intent(in) :: of_motion
        type(holding_forces), intent(in) :: holding
        real(wp), dimension(lanes) :: feed, rate, rate2
        real(wp) :: ratio, none

        none = ieee_value(1.0_wp, ieee_quiet_nan)
        ratio = effort_scale(model, spec%actuator)
        if (spec%side /= side_joint) ratio = ratio*model%scene%actuator(spec%actuator)%motor%ratio
        select case (spec%feed)
        case (feed_law)
            if (spec%feed_law%kind == law_over) then
                feed = law(:, spec%feed_law%law)
            else
                call law_on_lanes(spec%feed_law, t, feed, rate, rate2)
            end if
        case (feed_gravity)
            feed = merge(holding%force(:, spec%actuator)/ratio, none, holding%status == sample_ok)
        case (feed_inverse)
            feed = of_motion%force(:, spec%actuator)/ratio
            if (of_motion%wants_torques .and. spec%side /= side_joint) &
                feed = of_motion%motor_torque(:, spec%actuator)/effort_scale(model, spec%actuator)
            feed = merge(feed, none, of_motion%status == sample_ok)
        case default
            feed = 0
        end select
    end function feed_forward

    !> Continuous controllers at states that they see.
    subroutine run_controllers(model, layout, y, sight, control)
        type(model_type), intent(in) :: model
        type(state_layout), intent(in) :: layout
        real(wp), intent(in) :: y(:, :)                !! (lane, n)
        type(control_sight), intent(in) :: sight(:, :) !! (lane, n_controller)
        type(controlled_drives), intent(inout) :: control
        real(wp), dimension(lanes, size(sight, 2)) :: integral, slope
        integer :: i

        integral = 0
        slope = 0
        do i = 1, size(sight, 2)
            if (layout%integral(i) > 0) integral(:, i) = y(:, layout%integral(i))
            if (layout%slope(i) > 0) slope(:, i) = y(:, layout%slope(i))
        end do
        call run_continuous(model%scene%controller, sight, integral, slope, control%state)
    end subroutine run_controllers

    !> Outputs of all controllers on top of what drives give.
    subroutine add_outputs(model, control, force)
        type(model_type), intent(in) :: model
        type(controlled_drives), intent(in) :: control
        real(wp), intent(inout) :: force(:, :)         !! (lane, n_actuator) [N, N m]
        integer :: i

        do i = 1, control%state%n
            associate (k => model%scene%controller(i)%actuator)
                force(:, k) = force(:, k) + effort_scale(model, k)*control%state%output(:, i)
            end associate
        end do
    end subroutine add_outputs

    !> Rates of what continuous controllers have in y.
    subroutine pack_control_rates(layout, n, control, rate)
        type(state_layout), intent(in) :: layout
        integer, intent(in) :: n                       !! lanes
        type(controlled_drives), intent(in) :: control
        real(wp), intent(inout) :: rate(:, :)          !! (lane, n)
        integer :: i

        do i = 1, control%state%n
            if (layout%integral(i) > 0) rate(:n, layout%integral(i)) = control%state%integral_rate(:n, i)
            if (layout%slope(i) > 0) rate(:n, layout%slope(i)) = control%state%slope_rate(:n, i)
        end do
    end subroutine pack_control_rates

    subroutine free_control(control)
        type(controlled_drives), intent(inout) :: control

        call free_holding_forces(control%holding)
    end subroutine free_control
end module linkdyn_controlled_drives
