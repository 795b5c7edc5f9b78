!> Driving forces that the scene's motion asks for, wherever a forward run really is: what drives `inverse` apply.
!>
!> The motion is followed on its own assembly. Forces come from a record once the run has one, else from the lanes; torques of
!> motors behind transmissions that lose some of them always come from the lanes.
module linkdyn_motion_forces
    use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan
    use linkdyn_agreement, only: agreement, are_alike
    use linkdyn_carried_assembly, only: carried_assembly, begin_assembly, evaluate_assembled, accept_assembly, &
        stand_there
    use linkdyn_equation_kernels, only: kernel_family
    use linkdyn_equations, only: equations_type, equation_workspace, unknown_choice, build_equations, share_equations, &
        free_equations, prepare_workspace, solve_equations, solver_reduced, solver_elimination
    use linkdyn_forward_record, only: forward_record, make_forward_rates, use_forward_rates, free_forward_record, &
        place_states, close_states, leave_doubtful, keep_stages, is_led_there, accept_recorded
    use linkdyn_forward_state, only: state_layout, plan_layout
    use linkdyn_joint_rates, only: joint_rate
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state
    use linkdyn_lane_count, only: lanes
    use linkdyn_measures, only: find_measures
    use linkdyn_model, only: model_type
    use linkdyn_motion, only: evaluate_motion, lane_loads
    use linkdyn_motor_loads, only: motor_torque
    use linkdyn_planar_motion, only: level_velocity, level_given
    use linkdyn_recorded_rates, only: recorded_rates, run_rates
    use linkdyn_representatives, only: representative_poses, set_in_motion
    use linkdyn_scene, only: motor_spec, n_controller, feed_inverse, side_joint
    use linkdyn_stage_places, only: forget_stages
    use linkdyn_status, only: status_type, sample_ok
    implicit none (type, external)
    private
    public :: motion_forces, plan_motion_forces, begin_motion_forces, go_on_from, accept_motion, forget_forces, &
        find_motion_forces, record_motion_forces, leave_motion_record, is_motion_of, &
        free_motion_forces, measure_motion

    type :: motion_forces
        logical :: is_needed = .false.
        real(wp), allocatable :: force(:, :)           !! found last (lane, n_actuator)
        real(wp), allocatable :: motor_torque(:, :)    !! that makes them behind a gear or screw, what these lose included (lane,
                                                       !! n_actuator)
        logical :: wants_torques = .false.             !! controllers feed these forward
        integer :: status(lanes) = sample_ok           !! of these
        type(model_type), pointer, private :: model => null()  !! with the coordinates that the motion speaks of
        type(equations_type), private :: equations
        type(equation_workspace), private :: workspace
        type(carried_assembly) :: assembly
        real(wp), private :: t(lanes) = -huge(1.0_wp)  !! instants of the forces found last [s]
        type(state_layout), private :: layout          !! nothing of the motion is integrated
        logical :: has_record = .false.
        logical, private :: is_by_record = .false.     !! what was found last is the record's
        type(forward_record) :: record
        integer :: n_by_record = 0                     !! evaluations by the record alone
    end type motion_forces

contains

    subroutine plan_motion_forces(model, kernels, forces, status)
        type(model_type), intent(in), target :: model  !! must outlive the forces
        type(kernel_family), pointer, intent(in) :: kernels    !! for its equations; null: it makes its own
        type(motion_forces), intent(inout) :: forces
        type(status_type), intent(inout) :: status

        forces%is_needed = .true.
        forces%model => model
        ! friction comes from reactions
        call build_equations(model, merge(solver_elimination, solver_reduced, size(model%contact) > 0), .false., &
                             forces%equations, status)
        if (.not. status%is_ok()) return
        call share_equations(model, kernels, forces%equations)
        call prepare_workspace(model, forces%equations, forces%workspace)
        forces%workspace%checks_accuracy = .false.     ! steps judge it, and pass such places
        call plan_layout(model, spread(.false., 1, model%n_q), forces%layout)
        allocate (forces%force(lanes, model%n_actuator), forces%motor_torque(lanes, model%n_actuator), source=0.0_wp)
        forces%wants_torques = feeds_losses(model)
    end subroutine plan_motion_forces

    !> Is it this model whose coordinates the motion speaks of?
    pure logical function is_motion_of(forces, model)
        type(motion_forces), intent(in) :: forces
        type(model_type), intent(in), target :: model

        is_motion_of = associated(forces%model, model)
    end function is_motion_of

    !> Does a controller feed forward what a motor gives behind a transmission that loses some of it?
    pure logical function feeds_losses(model)
        type(model_type), intent(in) :: model
        integer :: i

        feeds_losses = .false.
        do i = 1, n_controller(model%scene)
            associate (spec => model%scene%controller(i))
                associate (motor => model%scene%actuator(spec%actuator)%motor)
                    if (spec%feed == feed_inverse .and. spec%side /= side_joint) &
                        feeds_losses = feeds_losses .or. motor%efficiency < 1 .or. motor%back_efficiency < 1
                end associate
            end associate
        end do
    end function feeds_losses

    !> Begin at t on the assembly of the scene's start.
    subroutine begin_motion_forces(t, forces)
        real(wp), intent(in) :: t                      !! [s]
        type(motion_forces), intent(inout) :: forces

        if (forces%is_needed) call begin_assembly(forces%model, t, forces%assembly)
    end subroutine begin_motion_forces

    !> Go on where the forces of another system of the same mechanism stand.
    subroutine go_on_from(other, forces)
        type(motion_forces), intent(in) :: other
        type(motion_forces), intent(inout) :: forces

        forces%assembly = other%assembly
        forces%t = -huge(1.0_wp)
    end subroutine go_on_from

    !> The run has got to t: the motion's assembly there is where the next steps set out from.
    subroutine accept_motion(t, is_accepted, forces)
        real(wp), intent(in) :: t(lanes)               !! [s]
        logical, intent(in) :: is_accepted(lanes)
        type(motion_forces), intent(inout) :: forces

        logical :: is_done

        if (.not. forces%assembly%is_needed) return
        call unpack_motion(forces%model, t, forces%assembly%state)
        is_done = forces%is_by_record .and. all(is_accepted) .and. all(t == t(1) .and. t == forces%t)
        if (is_done) is_done = .not. is_led_there(forces%record)
        if (is_done) then
            associate (found => forces%record%samples%found(1, :), out => forces%record%recorded%out, n => forces%model%n_branch)
                call accept_recorded(forces%model, t, found(out%margin:out%margin + n - 1), found(out%drift:out%drift + n - 1), &
                                     forces%record, forces%assembly, is_done)
            end associate
        end if
        if (.not. is_done) call accept_assembly(forces%model, t, is_accepted, forces%assembly)
    end subroutine accept_motion

    !> What was found before has no part in what is found next.
    subroutine forget_forces(forces)
        type(motion_forces), intent(inout) :: forces

        forces%t = -huge(1.0_wp)
        call forget_stages(forces%record%stage)
    end subroutine forget_forces

    !> Forces at the instants of the lanes, the first n of which are used.
    subroutine find_motion_forces(t, n, forces)
        real(wp), intent(in) :: t(lanes)               !! [s]
        integer, intent(in) :: n
        type(motion_forces), intent(inout) :: forces
        real(wp) :: by_record(lanes, size(forces%force, 2))
        logical :: serves

        if (all(t == forces%t)) return
        serves = forces%has_record
        if (serves) call find_by_record(t, n, forces, by_record, serves)
        if (serves) then
            forces%force = by_record
            forces%status = sample_ok
            forces%n_by_record = forces%n_by_record + 1
        else
            call find_on_lanes(t, forces)
        end if
        forces%t = t
        forces%is_by_record = serves
    end subroutine find_motion_forces

    subroutine find_on_lanes(t, forces)
        real(wp), intent(in) :: t(lanes)
        type(motion_forces), intent(inout) :: forces

        call unpack_motion(forces%model, t, forces%workspace%state)
        call solve_on_lanes(t, forces)
    end subroutine find_on_lanes

    !> Forces of the motion whose coordinates are in the workspace.
    subroutine solve_on_lanes(t, forces)
        real(wp), intent(in) :: t(lanes)
        type(motion_forces), intent(inout) :: forces

        associate (model => forces%model, workspace => forces%workspace)
            call lane_loads(model, t, workspace%load)
            call evaluate_assembled(model, t, forces%assembly, workspace%state)
            workspace%state%time = t
            call solve_equations(model, forces%equations, workspace)
            forces%force = workspace%driving_force
            forces%status = workspace%status
            call find_torques(model, workspace%state, forces)
        end associate
    end subroutine solve_on_lanes

    !> Torques of motors that make the forces found: rotors take their part at the motion's acceleration, and transmissions lose
    !> theirs as the run has it, in the direction of the motion.
    subroutine find_torques(model, state, forces)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state     !! of the motion
        type(motion_forces), intent(inout) :: forces
        type(motor_spec) :: spec
        real(wp), dimension(lanes) :: rate, transmitted
        integer :: i

        if (.not. forces%wants_torques) return
        do i = 1, size(model%motor)
            associate (motor => model%motor(i), k => model%motor(i)%actuator)
                spec = model%scene%actuator(k)%motor
                spec%creeps = .true.
                rate = joint_rate(model, state, motor%joint, motor%variable, level_velocity)
                transmitted = forces%force(:, k) &
                              - motor%inertia*joint_rate(model, state, motor%joint, motor%variable, level_given)
                forces%motor_torque(:, k) = motor_torque(spec, forces%force(:, k), transmitted, rate)
            end associate
        end do
    end subroutine find_torques

    !> What laws over the state depend on, in the motion at the instants of the lanes; not a number where it cannot be placed.
    subroutine measure_motion(t, forces, measure)
        real(wp), intent(in) :: t(lanes)               !! [s]
        type(motion_forces), intent(inout) :: forces
        real(wp), intent(out) :: measure(:, :)         !! (lane, measure)
        logical :: is_lost(lanes)
        integer :: k

        associate (model => forces%model, state => forces%workspace%state)
            call unpack_motion(model, t, state)
            call evaluate_assembled(model, t, forces%assembly, state)
            state%time = t
            call find_measures(model, state, measure)
            is_lost = state%unreachable .or. state%not_converged .or. state%way_status /= sample_ok
        end associate
        do k = 1, size(measure, 2)
            where (is_lost) measure(:, k) = ieee_value(1.0_wp, ieee_quiet_nan)
        end do
    end subroutine measure_motion

    !> Coordinates of the motion at the instants of the lanes.
    subroutine unpack_motion(model, t, state)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: t(lanes)               !! [s]
        type(kinematic_state), intent(inout) :: state
        real(wp) :: q(model%n_q, 1), qd(model%n_q, 1), qdd(model%n_q, 1), load(6, model%n_load, 1)
        integer :: lane

        do lane = 1, lanes
            if (t(lane) /= t(max(1, lane - 1)) .or. lane == 1) call evaluate_motion(model, t(lane:lane), q, qd, qdd, load)
            state%q(lane, :) = q(:, 1)
            state%qd(lane, :) = qd(:, 1)
            state%qdd(lane, :) = qdd(:, 1)
        end do
    end subroutine unpack_motion

    ! ---------------------------------------------------------------- by a record

    !> Use a record from now on, if the scene has one that finds what the lanes find; it is made if nobody has.
    subroutine record_motion_forces(t, forces, poses, recorded)
        real(wp), intent(in) :: t                      !! [s]
        type(motion_forces), intent(inout) :: forces
        type(representative_poses), intent(inout) :: poses
        type(recorded_rates), pointer, intent(inout) :: recorded    !! null: not made yet; must outlive the forces
        type(unknown_choice) :: unknown
        logical :: is_new

        if (.not. forces%is_needed .or. forces%wants_torques) return
        is_new = .not. associated(recorded)
        if (is_new) then
            unknown%acceleration = spread(.false., 1, forces%model%n_q)
            unknown%drive = spread(.true., 1, forces%model%n_actuator)
            allocate (recorded)
            call make_forward_rates(forces%model, forces%layout, unknown, .false., poses, recorded)
        end if
        call use_forward_rates(forces%model, forces%layout, recorded, .false., .false., forces%record)
        if (is_new .and. recorded%is_usable) recorded%is_usable = agrees_with_lanes(t, poses%q, forces)
        forces%has_record = recorded%is_usable
    end subroutine record_motion_forces

    !> On lanes from now on, until `record_motion_forces`: the record's programs may end.
    subroutine leave_motion_record(forces)
        type(motion_forces), intent(inout) :: forces

        call free_forward_record(forces%record)
        forces%has_record = .false.
        forces%is_by_record = .false.
    end subroutine leave_motion_record

    !> Does the record find what the lanes find? Asked once, at representative poses in motion: a difference would be a defect, and
    !> the lanes are believed.
    logical function agrees_with_lanes(t, pose, forces) result(agrees)
        real(wp), intent(in) :: t                      !! [s]
        real(wp), intent(in) :: pose(:, :)             !! representative ones (n_q, n)
        type(motion_forces), intent(inout) :: forces
        type(carried_assembly) :: carried
        real(wp) :: by_record(lanes, size(forces%force, 2))
        type(agreement) :: of_both
        integer :: first, lane

        carried = forces%assembly
        call begin_assembly(forces%model, t, forces%assembly)
        associate (model => forces%model, state => forces%workspace%state)
            do first = 1, size(pose, 2), lanes
                call set_in_motion(pose, first, state%q, state%qd, state%qdd)
                call solve_on_lanes(spread(t, 1, lanes), forces)
                if (size(model%group) > 0) call stand_there(model, state, forces%assembly)
                call place_motion(spread(t, 1, lanes), lanes, forces)
                forces%record%samples%q(:, :lanes) = transpose(state%q)
                forces%record%samples%qd(:, :lanes) = transpose(state%qd)
                forces%record%samples%qdd(:, :lanes) = transpose(state%qdd)
                call run_motion(spread(t, 1, lanes), lanes, forces, by_record)
                do lane = 1, min(lanes, size(pose, 2) - first + 1)
                    if (forces%status(lane) /= sample_ok .or. forces%record%samples%is_left(lane)) cycle
                    call of_both%note(are_alike(forces%force(lane, :), by_record(lane, :)))
                end do
            end do
        end associate
        forces%assembly = carried
        call forget_forces(forces)
        agrees = of_both%is_reached()
    end function agrees_with_lanes

    subroutine find_by_record(t, n, forces, force, serves)
        real(wp), intent(in) :: t(lanes)
        integer, intent(in) :: n
        type(motion_forces), intent(inout) :: forces
        real(wp), intent(out) :: force(:, :)           !! (lane, n_actuator)
        logical, intent(out) :: serves                 !! false: for one of the lanes at least it does not

        call place_motion(t, n, forces)
        call run_motion(t, n, forces, force)
        serves = .not. any(forces%record%samples%is_left(:n))
    end subroutine find_by_record

    !> The motion at the instants of the lanes, as samples of the record.
    subroutine place_motion(t, n, forces)
        real(wp), intent(in) :: t(lanes)
        integer, intent(in) :: n
        type(motion_forces), intent(inout) :: forces
        real(wp) :: nothing(lanes, forces%layout%n)

        nothing = 0
        call place_states(forces%model, forces%layout, forces%assembly, n, t, nothing, nothing, &
                          spread(.false., 1, forces%model%n_actuator), forces%record)
    end subroutine place_motion

    !> Run the record on them; `samples%is_left` says where it does not serve.
    subroutine run_motion(t, n, forces, force)
        real(wp), intent(in) :: t(lanes)
        integer, intent(in) :: n
        type(motion_forces), intent(inout) :: forces
        real(wp), intent(out) :: force(:, :)           !! (lane, n_actuator)
        real(wp) :: doubt(n)
        integer :: lane, i

        call close_states(forces%model, forces%assembly, n, forces%record)
        associate (recorded => forces%record%recorded, samples => forces%record%samples)
            call run_rates(recorded, n, samples)
            if (forces%assembly%is_needed) then
                doubt = 0
                call leave_doubtful(forces%model, forces%assembly, n, t, doubt, forces%record)
                call keep_stages(forces%assembly, n, forces%record)
            end if
            do i = 1, size(force, 2)
                force(:, i) = samples%found([(min(lane, n), lane=1, lanes)], recorded%out%effort + i - 1)
            end do
        end associate
    end subroutine run_motion

    subroutine free_motion_forces(forces)
        type(motion_forces), intent(inout) :: forces

        call forces%workspace%free()
        call free_equations(forces%equations)
        call free_forward_record(forces%record)
    end subroutine free_motion_forces
end module linkdyn_motion_forces
