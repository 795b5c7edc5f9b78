!> Forward dynamics as a system of differential equations: the place where dynamics meets integrators.
module linkdyn_forward_system
    use linkdyn_carried_assembly, only: carried_assembly, begin_assembly, evaluate_on_assembly, accept_assembly
    use linkdyn_coordinate_watch, only: coordinate_watch, compare_rates, is_near_dead_point, dead_coordinate, &
        may_be_near
    use linkdyn_drives, only: evaluate_drive, needs_motion, coordinate_of_actuator
    use linkdyn_equations, only: equations_type, equation_workspace, unknown_choice, build_equations, &
        prepare_workspace, solve_equations, solver_elimination, solver_reduced
    use linkdyn_forward_state, only: state_layout, plan_layout, choose_free, unpack_state, pack_rates
    use linkdyn_joint_rates, only: actuator_rates
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state
    use linkdyn_lane_count, only: lanes
    use linkdyn_lane_system, only: lane_system
    use linkdyn_led_mechanism, only: evaluate_kinematics
    use linkdyn_model, only: model_type
    use linkdyn_motion, only: evaluate_motion, evaluate_loads
    use linkdyn_scene, only: drive_inverse
    use linkdyn_status, only: status_type, sample_ok
    implicit none (type, external)
    private
    public :: forward_system, build_forward_system, choose_unknowns

    type, extends(lane_system) :: forward_system
        type(model_type), pointer :: model => null()
        type(state_layout) :: layout
        type(equations_type) :: equations              !! of every stage: accelerations, and unknown driving forces
        type(equation_workspace) :: workspace
        type(carried_assembly) :: assembly
        logical :: wants_work = .true.
        type(coordinate_watch) :: watch                !! on the coordinates; off unless the caller prepares it
        ! ---- drives `inverse` of free coordinates: the force that the scene's motion law asks for
        type(model_type), pointer :: motion_model => null()    !! with the coordinates that the law speaks of
        logical, allocatable :: by_inverse(:)          !! (n_actuator)
        type(equations_type) :: inverse_equations
        type(equation_workspace) :: inverse_workspace
        type(carried_assembly) :: inverse_assembly     !! of that motion
        real(wp) :: inverse_time(lanes) = -huge(1.0_wp)    !! instants of the forces found last
    contains
        procedure :: evaluate => evaluate_forward
        procedure :: accept => accept_forward
        procedure :: begin
        procedure :: take_over
        procedure :: look_at
        procedure :: release
    end type forward_system

contains

    !> Which accelerations and driving forces are unknown: driven coordinates get their force from the drives `inverse`.
    subroutine choose_unknowns(model, unknown, status)
        type(model_type), intent(in) :: model
        type(unknown_choice), intent(out) :: unknown
        type(status_type), intent(inout) :: status

        call choose_free(model, unknown%acceleration, status)
        allocate (unknown%drive(model%n_actuator))
        unknown%drive = model%scene%actuator%drive%kind == drive_inverse .and. .not. all(unknown%acceleration)
    end subroutine choose_unknowns

    !> Plan the equations of the stages.
    subroutine build_forward_system(model, solver, system, status, motion_model)
        type(model_type), intent(in), target :: model      !! must outlive the system
        integer, intent(in) :: solver                      !! of the stages; no reaction is computed there; 0: the fastest
        type(forward_system), intent(inout) :: system
        type(status_type), intent(inout) :: status
        type(model_type), intent(in), target, optional :: motion_model  !! whose coordinates have the scene's motion; absent: model
        type(unknown_choice) :: unknown
        integer :: stage_solver

        system%model => model
        system%motion_model => model
        if (present(motion_model)) system%motion_model => motion_model
        call choose_unknowns(model, unknown, status)
        if (.not. status%is_ok()) return
        stage_solver = solver
        if (solver == 0) stage_solver = fastest_solver(model, unknown)
        call build_equations(model, stage_solver, .false., system%equations, status, unknown)
        if (.not. status%is_ok()) return
        call prepare_workspace(model, system%equations, system%workspace)
        call plan_layout(model, unknown%acceleration, system%layout)
        system%n = system%layout%n
        system%by_inverse = model%scene%actuator%drive%kind == drive_inverse .and. .not. unknown%drive
        system%workspace%state%world_rates = system%workspace%state%world_rates .or. measures_joints(model)
        if (any(system%by_inverse)) then
            call build_equations(system%motion_model, solver_reduced, .false., system%inverse_equations, status)
            if (status%is_ok()) &
                call prepare_workspace(system%motion_model, system%inverse_equations, system%inverse_workspace)
        end if
    end subroutine build_forward_system

    !> Virtual work where a link carries legs, which then need three columns instead of n; the planned elimination else.
    pure integer function fastest_solver(model, unknown) result(solver)
        type(model_type), intent(in) :: model
        type(unknown_choice), intent(in) :: unknown
        integer, parameter :: many = 20                    !! links a coordinate

        solver = solver_elimination
        if (.not. all(unknown%acceleration)) return
        ! Where a plan fails, near a change point, the dense solver of a long chain would take 100 times as long.
        if (any(model%leg%is_carried) .or. model%n_link > many*model%n_q) solver = solver_reduced
    end function fastest_solver

    !> Does a drive need a joint variable that is neither a coordinate nor the length of a leg?
    pure logical function measures_joints(model)
        type(model_type), intent(in) :: model
        integer :: i

        measures_joints = .false.
        do i = 1, model%n_actuator
            associate (spec => model%scene%actuator(i))
                measures_joints = measures_joints .or. (needs_motion(spec%drive) .and. model%joint(spec%joint)%leg == 0 &
                                                        .and. coordinate_of_actuator(model, i) == 0)
            end associate
        end do
    end function measures_joints

    !> Begin at t on the assembly of the scene's start.
    subroutine begin(self, t, y)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t                      !! [s]
        real(wp), intent(in) :: y(:, :)

        call begin_assembly(self%model, t, self%assembly)
        if (any(self%by_inverse)) call begin_assembly(self%motion_model, t, self%inverse_assembly)
        call self%accept(spread(t, 1, lanes), y, spread(.true., 1, lanes))
        if (self%watch%is_on) call look_and_decide(self, spread(t, 1, lanes), y)
    end subroutine begin

    !> Go on at t where another system of the same mechanism stands: the model's start is that place.
    subroutine take_over(self, other, t, y)
        class(forward_system), intent(inout) :: self
        type(forward_system), intent(in) :: other
        real(wp), intent(in) :: t                      !! [s]
        real(wp), intent(in) :: y(:, :)

        call begin_assembly(self%model, t, self%assembly)
        self%assembly%n_crossed = other%assembly%n_crossed
        self%inverse_assembly = other%inverse_assembly
        self%inverse_time = -huge(1.0_wp)
        self%watch%may_exchange = .true.
        call self%accept(spread(t, 1, lanes), y, spread(.true., 1, lanes))
        self%watch%before = 0
        call look_and_decide(self, spread(t, 1, lanes), y)
    end subroutine take_over

    !> Compare the rates at an accepted state.
    subroutine look_at(self, t, y)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t(lanes)
        real(wp), intent(in) :: y(:, :)

        call unpack_state(self%model, self%layout, t, y, self%watch%state)
        call evaluate_assembled(self%model, t, self%assembly, self%watch%state)
        call compare_rates(self%model, self%watch%state, self%watch)
    end subroutine look_at

    !> The mechanism has got to y: its assembly there is where the next steps set out from.
    subroutine accept_forward(self, t, y, is_accepted)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t(lanes)
        real(wp), intent(in) :: y(:, :)
        logical, intent(in) :: is_accepted(lanes)

        if (self%assembly%is_needed) then
            call unpack_state(self%model, self%layout, t, y, self%assembly%state)
            call accept_assembly(self%model, t, is_accepted, self%assembly)
        end if
        if (self%inverse_assembly%is_needed) then
            call unpack_motion(self%motion_model, t, self%inverse_assembly%state)
            call accept_assembly(self%motion_model, t, is_accepted, self%inverse_assembly)
        end if
        if (self%watch%is_on) call watch_coordinates(self, t, y)
    end subroutine accept_forward

    !> The last stage of the step, its columns at hand, tells whether to look at the accepted state itself.
    subroutine watch_coordinates(self, t, y)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t(lanes)
        real(wp), intent(in) :: y(:, :)

        self%watch%before = self%watch%ratio
        call compare_rates(self%model, self%workspace%state, self%watch)
        if (may_be_near(self%watch)) call look_and_decide(self, t, y)
    end subroutine watch_coordinates

    !> Has the caller to do something about a coordinate?
    subroutine look_and_decide(self, t, y)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t(lanes)
        real(wp), intent(in) :: y(:, :)

        call self%look_at(t, y)
        if (self%watch%may_exchange) then
            self%wants_rest = is_near_dead_point(self%watch)
        else
            self%wants_rest = dead_coordinate(self%watch, .false.) > 0
        end if
    end subroutine look_and_decide

    !> Coordinates of the scene's own motion at the instants of the lanes.
    subroutine unpack_motion(model, t, state)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: t(lanes)              !! [s]
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

    !> dy/dt on all lanes.
    subroutine evaluate_forward(self, t, y, rate, failed)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t(lanes)
        real(wp), intent(in) :: y(:, :)
        real(wp), intent(out) :: rate(:, :)
        logical, intent(out) :: failed(lanes)
        integer :: k

        associate (model => self%model, workspace => self%workspace)
            call unpack_state(model, self%layout, t, y, workspace%state)
            call take_loads(model, t, workspace)
            call evaluate_assembled(model, t, self%assembly, workspace%state)
            if (any(self%by_inverse)) call find_inverse_forces(self, t)
            do k = 1, model%n_actuator
                if (self%equations%unknown%drive(k)) cycle
                if (self%by_inverse(k)) then
                    workspace%driving_force(:, k) = self%inverse_workspace%driving_force(:, k)
                else
                    call evaluate_drive(model, k, t, workspace%state, workspace%driving_force(:, k))
                end if
            end do
            call solve_equations(model, self%equations, workspace)
            call pack_rates(model, self%layout, y, workspace%acceleration, workspace%state, rate)
            call work_rate(self, rate(:, self%layout%work))
            failed = workspace%status /= sample_ok
            if (any(self%by_inverse)) failed = failed .or. self%inverse_workspace%status /= sample_ok
            do k = 1, model%n_q
                failed = failed .or. .not. abs(workspace%acceleration(:, k)) <= huge(1.0_wp)
            end do
        end associate
    end subroutine evaluate_forward

    subroutine evaluate_assembled(model, t, assembly, state)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: t(lanes)
        type(carried_assembly), intent(inout) :: assembly
        type(kinematic_state), intent(inout) :: state

        if (assembly%is_needed) then
            call evaluate_on_assembly(model, t, assembly, state)
        else
            call evaluate_kinematics(model, state)
        end if
    end subroutine evaluate_assembled

    !> Loads of the scene at the instants of the lanes.
    subroutine take_loads(model, t, workspace)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: t(lanes)
        type(equation_workspace), intent(inout) :: workspace
        real(wp) :: load(6, model%n_load, 1)
        integer :: lane

        if (model%n_load == 0) return
        do lane = 1, lanes
            if (lane == 1) then
                call evaluate_loads(model, t(1:1), load)
            else if (t(lane) /= t(lane - 1)) then
                call evaluate_loads(model, t(lane:lane), load)
            end if
            workspace%load(lane, :, :) = load(:, :, 1)
        end do
    end subroutine take_loads

    !> Driving forces that the scene's motion asks for at these instants, wherever the mechanism really is.
    subroutine find_inverse_forces(self, t)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t(lanes)

        if (all(t == self%inverse_time)) return
        associate (model => self%motion_model, workspace => self%inverse_workspace)
            call unpack_motion(model, t, workspace%state)
            workspace%load = self%workspace%load
            call evaluate_assembled(model, t, self%inverse_assembly, workspace%state)
            call solve_equations(model, self%inverse_equations, workspace)
        end associate
        self%inverse_time = t
    end subroutine find_inverse_forces

    !> Power of the driving forces, integrated to their work.
    subroutine work_rate(self, rate)
        class(forward_system), intent(inout) :: self
        real(wp), intent(out) :: rate(lanes)
        real(wp) :: speed(lanes, self%model%n_actuator)
        integer :: i

        rate = 0
        if (.not. self%wants_work) return
        call actuator_rates(self%model, self%workspace%state, speed)
        do i = 1, self%model%n_actuator
            rate = rate + self%workspace%driving_force(:, i)*speed(:, i)
        end do
    end subroutine work_rate

    subroutine release(self)
        class(forward_system), intent(inout) :: self

        if (associated(self%workspace%slot%value)) call self%workspace%free()
        if (associated(self%inverse_workspace%slot%value)) call self%inverse_workspace%free()
    end subroutine release
end module linkdyn_forward_system
