!> Forward dynamics as a system of differential equations: the place where dynamics meets integrators.
!>
!> Rates come from a record of the scene, where it has one; a state that the record does not serve, near a dead point or where
!> the assembly may change, is computed on lanes, and so is whatever is looked at beside the rates.
module linkdyn_forward_system
    use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan
    use linkdyn_assembly_trail, only: sample_assembly
    use linkdyn_bounce_watch, only: bounce_watch, prepare_bounce_watch, look_at_end, note_start
    use linkdyn_carried_assembly, only: carried_assembly, begin_assembly, evaluate_on_assembly, evaluate_assembled, &
        accept_assembly
    use linkdyn_clutch_states, only: clutch_states, prepare_clutches, share_load
    use linkdyn_constants, only: golden, two_pi
    use linkdyn_contact, only: sliding_coefficient, lever_of
    use linkdyn_control_law, only: control_sight
    use linkdyn_controllers, only: controllers_type, begin_controllers, next_instant, take_samples, &
        put_out_samples, run_continuous
    use linkdyn_coordinate_watch, only: coordinate_watch, compare_rates, note_rates, forget_rates, is_well_past, &
        is_near_dead_point, dead_coordinate
    use linkdyn_drives, only: evaluate_drive, law_on_lanes, needs_motion, coordinate_of_actuator, effort_scale
    use linkdyn_contact_forces, only: solve_contacts, solve_complementary, solve_held
    use linkdyn_event_log, only: event_log, event_entry, add_entry, kind_crossing, kind_end, kind_contact, kind_release, &
        kind_impact, kind_rest, kind_close, kind_open, kind_stick, kind_slip
    use linkdyn_energy_balance, only: energy_of_motion, applied_power
    use linkdyn_equations, only: equations_type, equation_workspace, unknown_choice, build_equations, &
        prepare_workspace, solve_equations, choose_poses, solver_elimination, solver_reduced
    use linkdyn_forward_record, only: forward_record, make_forward_record, share_forward_record, free_forward_record, &
        place_states, close_states, run_states, may_change_assembly, apply_record_laws, settle_record_losses
    use linkdyn_forward_state, only: state_layout, plan_layout, angles_of_state, choose_free, fill_start, unpack_state, &
        pack_rates, counted_rates, read_coordinates
    use linkdyn_holding_forces, only: holding_forces, plan_holding_forces, find_holding_forces, free_holding_forces
    use linkdyn_impacts, only: find_impacts
    use linkdyn_inverse, only: are_alike
    use linkdyn_exchange, only: coordinate_now
    use linkdyn_joint_friction, only: pressing_forces
    use linkdyn_joint_rates, only: actuator_rates, joint_rate, coordinate_of
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state, prepare_kinematics
    use linkdyn_lane_count, only: lanes
    use linkdyn_lane_system, only: lane_system
    use linkdyn_led_mechanism, only: measure_margins
    use linkdyn_measures, only: find_laws, find_measures, find_events, find_kept, follow_angle
    use linkdyn_model, only: model_type
    use linkdyn_motion, only: lane_loads
    use linkdyn_motion_forces, only: motion_forces, plan_motion_forces, begin_motion_forces, go_on_from, accept_motion, &
        find_motion_forces, record_motion_forces, share_motion_forces, free_motion_forces, measure_motion
    use linkdyn_motor_laws, only: torque_of_law, brake_torque, current_rate, is_on
    use linkdyn_payload_forces, only: add_payload_power
    use linkdyn_planar_motion, only: level_velocity, level_given
    use linkdyn_scene, only: clutch_spec, drive_inverse, drive_over, side_joint, n_event, n_stop, n_clutch, n_controller, &
        is_sampled, controller_spec, law_over, feed_law, feed_gravity, feed_inverse
    use linkdyn_status, only: status_type, sample_branch_lost, sample_ok, sample_undefined
    use linkdyn_whole_turns, only: with_turns
    implicit none (type, external)
    private
    public :: forward_system, build_forward_system, choose_unknowns, evaluations_before_record

    type, extends(lane_system) :: forward_system
        type(model_type), pointer :: model => null()
        type(state_layout) :: layout
        type(equations_type) :: equations              !! of every stage: accelerations, and unknown driving forces
        type(equation_workspace) :: workspace
        type(carried_assembly) :: assembly
        logical :: wants_work = .true.
        real(wp) :: surplus(lanes) = 0                 !! energy of the accepted state, less what was supplied [J]
        real(wp) :: gained(lanes) = 0                  !! of it by the step that led there [J]
        real(wp) :: moved(lanes) = 0                   !! energy that was in motion or exchanged in that step [J]
        real(wp) :: kinetic(lanes) = 0                 !! of the accepted state [J]
        real(wp) :: supplied(lanes) = 0                !! until then [J]
        real(wp) :: resolved(lanes) = 0                !! what rounding leaves of these [J]
        real(wp) :: usual_error(lanes) = 0             !! part that steps gain of what is moved, away from change points
        real(wp) :: margin(lanes) = huge(1.0_wp)       !! least one of the accepted state, when it was looked at last
        integer :: n_crossed(lanes) = 0                !! and change points passed by then
        real(wp) :: surplus_noise = 0                  !! what rounding makes of it [J]
        real(wp), private :: surplus_noise_tried = 0   !! the same of the state looked at last
        type(coordinate_watch) :: watch                !! on the coordinates; off unless the caller prepares it
        type(bounce_watch) :: bounce                   !! on the other coordinates
        logical, private :: is_compared = .false.      !! the watch's ratios at the state evaluated last are known:
        real(wp), allocatable, private :: ratio_tried(:, :)    !! these (n_variable, n_q)
        ! ---- drives `inverse` of free coordinates: the force that the scene's motion law asks for
        logical, allocatable :: by_inverse(:)          !! (n_actuator)
        type(motion_forces) :: of_motion
        real(wp), allocatable :: given_force(:)        !! in its place, by whoever steps the system (n_actuator); absent: nobody gives any
        ! ---- controllers
        type(controllers_type) :: control              !! what they remember and put out
        type(holding_forces), private :: holding       !! where one of them wants these
        logical, private :: has_continuous = .false., has_sampled = .false.
        ! ---- laws at motors
        real(wp), allocatable :: brake(:, :)           !! taken of motors' torques at the state evaluated last (lane, n_actuator) [N m]
        real(wp), allocatable :: current_rate(:, :)            !! in windings, at the states evaluated last (lane, n_actuator) [A/s]
        real(wp), private :: t_braked(lanes) = 0       !! end of the accepted step: a brake that comes on there was off until then [s]
        real(wp), allocatable, private :: switched(:, :)    !! last event that switched a brake (lane, n_actuator) [s]; -huge: none
        logical, allocatable, private :: is_on(:, :)   !! since then (lane, n_actuator)
        ! ---- events and end stops
        type(model_type), pointer :: own => null()     !! with the coordinates that events are told in; null: model
        logical :: may_end = .true.                    !! an event that ends runs ends this one
        integer :: final_event(lanes) = 0              !! that did; 0: none
        logical :: is_driven_through(lanes) = .false.  !! it is a stop that cannot hold: what strikes it is driven
        type(event_log) :: log
        integer :: n_told = 1                          !! lanes whose events are told
        logical, allocatable :: rests(:, :)            !! a joint variable rests at a stop (lane, n_stop)
        real(wp), allocatable :: push(:, :)            !! of stops at the state evaluated last, away from them (lane, n_stop) [N, N m]
        real(wp), allocatable, private :: fastest(:, :)    !! impact so far (lane, n_stop) [m/s, rad/s]
        real(wp), private :: hardest(lanes) = 0            !! of all: speed by the root of the response to a push [sqrt(J)]
        real(wp), allocatable, private :: yielded(:, :)    !! depth at which contacts were found, by rounding and drift: their gaps
                                                           !! begin there (lane, n_stop) [m, rad]
        real(wp), allocatable, private :: widest(:, :)     !! gap so far, of stops at which something rests (lane, n_stop) [m, rad]
        type(clutch_states) :: clutch
        type(kinematic_state), private :: look         !! scratch: of states that are looked at
        integer, allocatable, private :: turning(:)    !! measures that wrap; events count their turns: at the accepted state
        real(wp), allocatable, private :: angle(:, :), spin(:, :)    !! they are here and turn so fast (lane, measure) [rad, rad/s]
        real(wp), private :: t_accepted(lanes) = 0     !! [s]
        integer :: obstacle(lanes) = sample_ok         !! what rates failed of first since the last accepted state
        ! ---- the record
        logical :: may_record = .false.                !! once that is worth while; the caller says so
        type(forward_record) :: record
        integer :: n_accepted = 0                      !! steps so far
        integer :: n_output = 0                        !! instants of output so far, each with a step of its own; 0 where there are events
        integer :: n_by_record = 0                     !! evaluations by the record alone
        logical, private :: is_behind = .false.        !! the state evaluated last is not in the workspace, but here:
        real(wp), private :: t_tried(lanes) = 0        !! [s]
        real(wp), allocatable, private :: y_tried(:, :)        !! (lane, n)
    contains
        procedure :: evaluate => evaluate_forward
        procedure :: evaluate_on_lanes
        procedure :: make_record
        procedure :: share_record
        procedure :: accept => accept_forward
        procedure :: note_turns => note_turns_forward
        procedure :: broken_law, has_broken_law
        procedure :: leads_too_far
        procedure :: evaluate_guards => evaluate_events
        procedure :: meet_crossings => meet_events
        procedure :: meet_stops
        procedure :: begin_with_clutches
        procedure :: switch_now
        procedure :: slips_at
        procedure :: next_control
        procedure :: control_now
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
        call choose_unknowns(model, unknown, status)
        if (.not. status%is_ok()) return
        stage_solver = solver
        if (solver == 0) stage_solver = fastest_solver(model, unknown)
        call build_equations(model, stage_solver, .false., system%equations, status, unknown, has_motor_laws=.true.)
        if (.not. status%is_ok()) return
        call prepare_workspace(model, system%equations, system%workspace)
        system%workspace%checks_accuracy = .false.     ! steps judge it, and pass such places
        call plan_layout(model, unknown%acceleration, system%layout)
        system%n = system%layout%n
        system%is_angle = angles_of_state(model, system%layout)
        allocate (system%turns(lanes, system%n), source=0.0_wp)
        allocate (system%is_book(system%n), source=.false.)
        system%is_book(system%layout%supplied) = .true.
        system%by_inverse = model%scene%actuator%drive%kind == drive_inverse .and. .not. unknown%drive
        system%workspace%state%world_rates = system%workspace%state%world_rates .or. measures_joints(model)
        system%may_jump = size(model%scene%laws%law) > 0
        call prepare_bounce_watch(model, unknown%acceleration, system%bounce)
        if (system%bounce%is_on) system%workspace%state%world_rates = .true.
        call prepare_events(model, system)
        call prepare_controllers(model, system, status)
        allocate (system%brake(lanes, model%n_actuator), system%current_rate(lanes, model%n_actuator), source=0.0_wp)
        allocate (system%switched(lanes, model%n_actuator), source=-huge(1.0_wp))
        allocate (system%is_on(lanes, model%n_actuator), source=.false.)
        if (.not. (wants_motion(model) .or. (any(system%by_inverse) .and. .not. allocated(system%given_force)))) return
        if (present(motion_model)) then
            call plan_motion_forces(motion_model, system%of_motion, status)
        else
            call plan_motion_forces(model, system%of_motion, status)
        end if
    end subroutine build_forward_system

    !> What the run is to look out for.
    subroutine prepare_events(model, system)
        type(model_type), intent(in) :: model
        type(forward_system), intent(inout) :: system
        integer :: i

        system%n_guard = n_event(model%scene)
        if (system%n_guard == 0) return
        system%guard_direction = model%scene%event%direction
        allocate (system%guard_side(lanes, system%n_guard), system%guard_scale(lanes, system%n_guard), source=0.0_wp)
        call prepare_clutches(n_clutch(model%scene), system%clutch)
        allocate (system%rests(lanes, n_stop(model%scene)), source=.false.)
        allocate (system%push(lanes, n_stop(model%scene)), system%yielded(lanes, n_stop(model%scene)), &
                  system%fastest(lanes, n_stop(model%scene)), system%widest(lanes, n_stop(model%scene)), source=0.0_wp)
        call prepare_kinematics(model, 0, system%look)
        system%look%world_rates = .true.
        associate (measure => model%scene%laws%measure)
            allocate (system%angle(lanes, size(measure)), system%spin(lanes, size(measure)), source=0.0_wp)
            system%turning = pack([(i, i=1, size(measure))], measure%wraps)
            do i = 1, size(measure)
                system%angle(:, i) = measure(i)%near
            end do
        end associate
    end subroutine prepare_events

    !> What controllers need beside the state.
    subroutine prepare_controllers(model, system, status)
        type(model_type), intent(in) :: model
        type(forward_system), intent(inout) :: system
        type(status_type), intent(inout) :: status

        if (n_controller(model%scene) == 0) return
        associate (spec => model%scene%controller)
            system%has_sampled = any(is_sampled(spec))
            system%has_continuous = .not. all(is_sampled(spec))
            if (any(spec%feed == feed_gravity)) call plan_holding_forces(model, system%holding, status)
        end associate
        if (system%n_guard > 0) return
        call prepare_kinematics(model, 0, system%look)
        system%look%world_rates = .true.
    end subroutine prepare_controllers

    !> Does a controller look at the scene's motion?
    pure logical function wants_motion(model)
        type(model_type), intent(in) :: model

        wants_motion = .false.
        if (n_controller(model%scene) == 0) return
        wants_motion = any(model%scene%controller%follows_motion .or. model%scene%controller%feed == feed_inverse)
    end function wants_motion

    !> Where the angles that events count have got to.
    subroutine follow_angles(self, t, y, is_accepted)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t(lanes)
        real(wp), intent(in) :: y(:, :)
        logical, intent(in) :: is_accepted(lanes)
        real(wp) :: about(lanes, size(self%angle, 2)), value(lanes), rate(lanes)
        integer :: i

        about = angles_about(self, t)
        call look_closely(self, t, y)
        do i = 1, size(self%turning)
            associate (k => self%turning(i))
                call follow_angle(self%model, self%look, k, about(:, k), value, rate)
                where (is_accepted .and. abs(value) <= huge(1.0_wp))
                    self%angle(:, k) = value
                    self%spin(:, k) = rate
                end where
            end associate
        end do
        where (is_accepted) self%t_accepted = t
    end subroutine follow_angles

    !> About where these angles are at other instants.
    pure function angles_about(self, t) result(about)
        class(forward_system), intent(in) :: self
        real(wp), intent(in) :: t(lanes)
        real(wp) :: about(lanes, size(self%angle, 2))

        about = self%angle + self%spin*spread(t - self%t_accepted, 2, size(self%angle, 2))
    end function angles_about

    !> Virtual work where a link carries legs, which then need three columns instead of n; the planned elimination else.
    pure integer function fastest_solver(model, unknown) result(solver)
        type(model_type), intent(in) :: model
        type(unknown_choice), intent(in) :: unknown
        integer, parameter :: many = 20                    !! links a coordinate

        solver = solver_elimination
        if (.not. all(unknown%acceleration) .or. size(model%contact) > 0) return     ! friction comes from reactions
        if (any(model%scene%actuator%drive%side /= side_joint)) return
        ! Where a plan fails, near a change point, the dense solver of a long chain would take 100 times as long.
        if (any(model%leg%is_carried) .or. model%n_link > many*model%n_q) solver = solver_reduced
    end function fastest_solver

    !> Does a drive, or may a law, need a joint variable that is neither a coordinate nor the length of a leg?
    pure logical function measures_joints(model)
        type(model_type), intent(in) :: model
        integer :: i

        measures_joints = size(model%scene%laws%law) > 0 .or. n_controller(model%scene) > 0
        do i = 1, model%n_actuator
            associate (spec => model%scene%actuator(i))
                measures_joints = measures_joints .or. spec%drive%side /= side_joint
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
        self%t_accepted = t
        self%t_braked = t
        call begin_motion_forces(t, self%of_motion)
        call self%accept(spread(t, 1, lanes), y, spread(.true., 1, lanes))
        if (n_controller(self%model%scene) > 0) then
            call begin_controllers(self%model%scene%controller, t, self%control)
            call self%control_now(t, y)
        end if
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
        call go_on_from(other%of_motion, self%of_motion)
        self%own => other%own
        self%control = other%control
        self%switched = other%switched
        self%is_on = other%is_on
        self%may_end = other%may_end
        self%log = other%log
        if (self%n_guard > 0) then
            self%clutch = other%clutch
            self%rests = other%rests
            self%push = other%push
            self%fastest = other%fastest
            self%hardest = other%hardest
            self%yielded = other%yielded
            self%widest = other%widest
            self%guard_side = other%guard_side
            self%guard_scale = other%guard_scale
            self%guard_is_fresh = other%guard_is_fresh
            self%angle = other%angle
            self%spin = other%spin
            self%t_accepted = other%t_accepted
        end if
        call free_forward_record(self%record)          ! whose plan is that of the start before
        self%watch%may_exchange = .true.
        self%watch%is_on = .false.
        call self%accept(spread(t, 1, lanes), y, spread(.true., 1, lanes))
        self%watch%is_on = .true.
        call forget_rates(self%watch)
        call look_and_decide(self, spread(t, 1, lanes), y)
    end subroutine take_over

    !> Compare the rates at an accepted state.
    subroutine look_at(self, t, y)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t(lanes)
        real(wp), intent(in) :: y(:, :)

        call unpack_state(self%model, self%layout, t, y, self%turns, self%watch%state)
        call evaluate_assembled(self%model, t, self%assembly, self%watch%state)
        call compare_rates(self%model, self%watch%state, self%watch)
    end subroutine look_at

    !> The mechanism has got to y: its assembly there is where the next steps set out from.
    subroutine accept_forward(self, t, y, is_accepted)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t(lanes)
        real(wp), intent(in) :: y(:, :)
        logical, intent(in) :: is_accepted(lanes)

        self%n_accepted = self%n_accepted + 1
        if (holds_anywhere(self)) then
            where (is_accepted) self%clutch%longest = max(self%clutch%longest, t - self%clutch%t_accepted)
        end if
        where (is_accepted) self%clutch%t_accepted = t
        where (is_accepted) self%t_braked = t
        where (is_accepted) self%obstacle = sample_ok
        self%control%blind = 0
        if (self%assembly%is_needed) then
            call unpack_state(self%model, self%layout, t, y, self%turns, self%assembly%state)
            call accept_assembly(self%model, t, is_accepted, self%assembly)
            call weigh_energy(self, y)
            self%surplus_noise = self%surplus_noise_tried
        end if
        if (self%bounce%is_on) call note_start(self%model, self%assembly%state, t(1), self%bounce)
        call accept_motion(t, is_accepted, self%of_motion)
        if (allocated(self%turning)) then
            if (size(self%turning) > 0) call follow_angles(self, t, y, is_accepted)
        end if
        if (self%watch%is_on) call watch_coordinates(self, t, y)
    end subroutine accept_forward

    !> Energy of the accepted state, and what the step that led there has made of it.
    subroutine weigh_energy(self, y)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: y(:, :)                !! there
        real(wp), dimension(lanes) :: energy, kinetic, surplus

        call energy_of_motion(self%model, self%assembly%state, energy, kinetic)
        associate (supplied => y(:, self%layout%supplied))
            surplus = energy - supplied
            self%gained = surplus - self%surplus
            self%moved = kinetic + self%kinetic + abs(supplied - self%supplied)
            self%resolved = epsilon(1.0_wp)*(abs(energy) + kinetic + abs(supplied))
            self%surplus = surplus
            self%kinetic = kinetic
            self%supplied = supplied
        end associate
    end subroutine weigh_energy

    !> Has the last step made energy of nothing, or lost it? A method that estimates its errors, or takes steps that are short
    !> enough, errs by far less. Where two assemblies meet rates may be nothing but rounding: a step there may err little more
    !> than those before it have done.
    function has_broken_law(self) result(is_broken)
        class(forward_system), intent(inout) :: self
        logical :: is_broken(lanes)
        real(wp), parameter :: gross = 0.01_wp         !! part of the energy in motion: a hundred such steps, and nothing is left
        real(wp), parameter :: gross_far = 0.1_wp      !! where no other assembly is near: a stiff drive that sets in costs so much
        real(wp), parameter :: fine = 1.0e-5_wp        !! likewise where rates are rounding: five digits of the speed
        real(wp), parameter :: more = 100
        real(wp), parameter :: rounding = 1.0e6_wp     !! of positions near a change point, in units in the last place
        real(wp), parameter :: near = 1.0e-3_wp        !! margin at which rates lose digits
        real(wp), parameter :: far = 0.3_wp            !! and at which a step leads to no other assembly
        real(wp), dimension(lanes) :: error, margin, bound
        logical :: is_near(lanes)

        is_broken = .false.
        if (.not. (self%assembly%is_needed .and. self%wants_work)) return
        margin = minval(abs(self%assembly%margin), dim=2)
        is_near = min(margin, self%margin) < near .or. self%assembly%n_crossed > self%n_crossed
        error = max(abs(self%gained) - rounding*self%resolved, 0.0_wp)/max(self%moved, tiny(1.0_wp))
        bound = merge(gross_far, gross, min(margin, self%margin) > far .and. self%assembly%n_crossed == self%n_crossed)
        is_broken = error > merge(min(max(fine, more*self%usual_error), gross), bound, is_near)
        where (.not. is_near) self%usual_error = error
        self%margin = margin
        self%n_crossed = self%assembly%n_crossed
        where (is_broken .and. self%obstacle == sample_ok) self%obstacle = sample_branch_lost
    end function has_broken_law

    !> Ways to the next states begin where these have their turns left out.
    subroutine note_turns_forward(self, turns)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: turns(:, :)
        integer :: k

        self%turns = self%turns + turns
        if (.not. self%assembly%is_needed) return
        do k = 1, self%model%n_q
            associate (p => self%layout%position(k))
                if (p > 0) self%assembly%q(:, k) = with_turns(self%assembly%q(:, k), -turns(:, p))
            end associate
        end do
    end subroutine note_turns_forward

    !> The last stage of the step, its columns at hand, tells whether to look at the accepted state itself.
    subroutine watch_coordinates(self, t, y)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t(lanes)
        real(wp), intent(in) :: y(:, :)

        call note_rates(self%watch)
        if (self%is_compared) then
            self%watch%ratio = self%ratio_tried
        else
            call catch_up(self)
            call compare_rates(self%model, self%workspace%state, self%watch)
        end if
        if (is_near_dead_point(self%watch) .or. dead_coordinate(self%watch, .false.) > 0) call look_and_decide(self, t, y)
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

    !> dy/dt on all lanes.
    subroutine evaluate_forward(self, t, y, rate, failed)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t(lanes)
        real(wp), intent(in) :: y(:, :)
        real(wp), intent(out) :: rate(:, :)
        logical, intent(out) :: failed(lanes)
        real(wp) :: by_record(lanes, self%n)
        logical :: is_left(lanes)
        integer, parameter :: evaluations_a_step = 10  !! about
        integer :: k

        if (rests_anywhere(self) .or. is_clutched(self)) then
            call self%evaluate_on_lanes(t, y, rate, failed)
            return
        end if
        if (self%may_record .and. .not. associated(self%record%recorded)) then
            ! Steps and instants tell how long the run is whenever it comes back for want of time; evaluations, some made anew
            ! then, do not.
            if ((self%n_accepted + self%n_output)*evaluations_a_step >= evaluations_before_record(self%model)) &
                call self%make_record(t(1))
        end if
        if (.not. (self%may_record .and. associated(self%record%recorded))) then
            call self%evaluate_on_lanes(t, y, rate, failed)
            return
        end if
        call evaluate_by_record(self, t, y, by_record, is_left)
        if (any(is_left)) then
            call self%evaluate_on_lanes(t, y, rate, failed)
            where (.not. is_left) failed = .false.
            do k = 1, self%n
                where (.not. is_left) rate(:, k) = by_record(:, k)
            end do
        else
            rate = by_record
            failed = .false.
            self%n_by_record = self%n_by_record + 1
            self%workspace%status = sample_ok
            self%is_compared = .false.
            self%is_behind = .true.
            self%t_tried = t
            self%y_tried = y
        end if
    end subroutine evaluate_forward

    !> dy/dt on all lanes, and everything else of these states in the workspace.
    subroutine evaluate_on_lanes(self, t, y, rate, failed)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t(lanes)
        real(wp), intent(in) :: y(:, :)
        real(wp), intent(out) :: rate(:, :)
        logical, intent(out) :: failed(lanes)
        integer :: k

        self%is_compared = .false.
        self%is_behind = .false.
        associate (model => self%model, workspace => self%workspace)
            call unpack_state(model, self%layout, t, y, self%turns, workspace%state)
            call lane_loads(model, t, workspace%load)
            call evaluate_assembled(model, t, self%assembly, workspace%state)
            if (applies_motion_forces(self)) call find_motion_forces(t, lanes, self%of_motion)
            workspace%state%time = t
            if (any(model%scene%actuator%drive%kind == drive_over) .or. self%has_continuous) call find_laws(model, workspace%state)
            do k = 1, model%n_actuator
                if (self%equations%unknown%drive(k)) cycle
                if (allocated(self%given_force)) then
                    workspace%driving_force(:, k) = self%given_force(k)
                else if (self%by_inverse(k)) then
                    workspace%driving_force(:, k) = self%of_motion%force(:, k)
                else
                    call evaluate_drive(model, k, t, workspace%state, workspace%driving_force(:, k))
                end if
            end do
            if (self%control%n > 0) call drive_by_controllers(self, t, y)
            if (any(model%scene%actuator%drive%side /= side_joint)) call drive_by_motors(self, t, y)
            workspace%n_used = self%n_used
            if (n_clutch(model%scene) > 0) call rub_clutches(self, t)
            call solve_equations(model, self%equations, workspace)
            if (rests_anywhere(self) .or. holds_anywhere(self)) call hold_variables(self, t, y)
            if (has_sticking(self)) call measure_grip(self)
            call pack_rates(model, self%layout, y, workspace%acceleration, counted_rates(model, workspace%state), rate)
            call pack_control_rates(self, rate)
            call pack_current_rates(self, rate)
            call find_powers(self, rate(:, self%layout%work), rate(:, self%layout%supplied))
            if (self%may_jump) call self%note_mode(workspace%state%mode, rate)
            failed = workspace%status /= sample_ok
            if (applies_motion_forces(self)) failed = failed .or. self%of_motion%status /= sample_ok
            do k = 1, model%n_q
                failed = failed .or. .not. abs(workspace%acceleration(:, k)) <= huge(1.0_wp)
            end do
            where (failed .and. self%obstacle == sample_ok) self%obstacle = workspace%status
            if (applies_motion_forces(self)) then
                where (failed .and. self%obstacle == sample_ok) self%obstacle = self%of_motion%status
            end if
            where (failed .and. self%obstacle == sample_ok) self%obstacle = sample_undefined
        end associate
    end subroutine evaluate_on_lanes

    !> Do drives apply the forces that the scene's motion asks for?
    pure logical function applies_motion_forces(self)
        class(forward_system), intent(in) :: self

        applies_motion_forces = self%of_motion%is_needed .and. any(self%by_inverse) .and. .not. allocated(self%given_force)
    end function applies_motion_forces

    ! ---------------------------------------------------------------- controllers

    !> The next instant at which a controller takes a sample, or one takes effect; huge: none. Steps must end there.
    pure real(wp) function next_control(self) result(next)
        class(forward_system), intent(in) :: self

        next = huge(next)
        if (self%has_sampled) next = next_instant(self%model%scene%controller, self%control)
    end function next_control

    !> An accepted state: controllers take the samples that are due there, and put out those whose delay has passed.
    subroutine control_now(self, t, y)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t                      !! [s]
        real(wp), intent(in) :: y(:, :)                !! (lane, n)
        type(control_sight) :: sight(lanes, self%control%n)
        real(wp) :: measure(lanes, size(self%model%scene%laws%measure))

        if (.not. self%has_sampled) return
        call look_closely(self, spread(t, 1, lanes), y)
        call find_laws(self%model, self%look)
        call find_measures(self%model, self%look, measure)
        call see(self, spread(t, 1, lanes), y, measure, self%look%law, is_sampled(self%model%scene%controller), sight)
        call take_samples(self%model%scene%controller, t, sight, self%control)
        call put_out_samples(self%model%scene%controller, t, self%control)
    end subroutine control_now

    !> What controllers see at states, of which measures and laws over the state are known. A similar mechanism's see the scene's size.
    subroutine see(self, t, y, measure, law, is_wanted, sight)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t(lanes)               !! [s]
        real(wp), intent(in) :: y(:, :)                !! (lane, n)
        real(wp), intent(in) :: measure(:, :), law(:, :)       !! (lane, measure), (lane, law)
        logical, intent(in) :: is_wanted(:)            !! (n)
        type(control_sight), intent(out) :: sight(:, :)        !! (lane, n)
        real(wp) :: in_motion(lanes, size(measure, 2)), ignored(lanes)
        integer :: i

        associate (spec => self%model%scene%controller)
            if (any(is_wanted .and. spec%follows_motion)) call measure_motion(t, self%of_motion, in_motion)
            if (any(is_wanted .and. spec%feed == feed_inverse)) call find_motion_forces(t, self%n_used, self%of_motion)
            if (any(is_wanted .and. spec%feed == feed_gravity)) call find_holding_forces(self%model, self%layout, t, y, &
                self%turns, self%assembly, self%holding)
            do i = 1, size(spec)
                if (.not. is_wanted(i)) cycle
                associate (target => spec(i)%target)
                    if (spec(i)%follows_motion) then
                        sight(:, i)%target = in_motion(:, spec(i)%measure)
                        if (spec(i)%rate_measure > 0) sight(:, i)%target_rate = in_motion(:, spec(i)%rate_measure)
                    else if (target%kind == law_over) then
                        sight(:, i)%target = law(:, target%law)
                    else
                        call law_on_lanes(target, t, sight(:, i)%target, sight(:, i)%target_rate, ignored)
                    end if
                end associate
                sight(:, i)%measured = measure(:, spec(i)%measure)
                if (spec(i)%rate_measure > 0) sight(:, i)%measured_rate = measure(:, spec(i)%rate_measure)
                if (self%model%scene%laws%measure(spec(i)%measure)%wraps) sight(:, i)%measured = sight(:, i)%measured &
                    - two_pi*anint((sight(:, i)%measured - sight(:, i)%target)/two_pi)
                sight(:, i)%feed = feed_forward(self, spec(i), t, law)
            end do
        end associate
    end subroutine see

    !> What a controller puts out beside what its error asks for.
    function feed_forward(self, spec, t, law) result(feed)
        class(forward_system), intent(in) :: self
        type(controller_spec), intent(in) :: spec
        real(wp), intent(in) :: t(lanes)               !! [s]
        real(wp), intent(in) :: law(:, :)              !! (lane, law)
        real(wp), dimension(lanes) :: feed, rate, rate2
        real(wp) :: ratio, none

        none = ieee_value(1.0_wp, ieee_quiet_nan)
        ratio = effort_scale(self%model, spec%actuator)
        if (spec%side /= side_joint) ratio = ratio*self%model%scene%actuator(spec%actuator)%motor%ratio
        select case (spec%feed)
        case (feed_law)
            if (spec%feed_law%kind == law_over) then
                feed = law(:, spec%feed_law%law)
            else
                call law_on_lanes(spec%feed_law, t, feed, rate, rate2)
            end if
        case (feed_gravity)
            feed = merge(self%holding%force(:, spec%actuator)/ratio, none, self%holding%status == sample_ok)
        case (feed_inverse)
            feed = merge(self%of_motion%force(:, spec%actuator)/ratio, none, self%of_motion%status == sample_ok)
        case default
            feed = 0
        end select
    end function feed_forward

    !> Outputs of all controllers on top of what drives give; continuous ones look at the state, which is in the workspace.
    subroutine drive_by_controllers(self, t, y)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t(lanes)               !! [s]
        real(wp), intent(in) :: y(:, :)                !! (lane, n)
        real(wp) :: measure(lanes, size(self%model%scene%laws%measure))
        integer :: i

        if (self%has_continuous) then
            call find_measures(self%model, self%workspace%state, measure)
            call run_controllers(self, t, y, measure, self%workspace%state%law)
        end if
        do i = 1, self%control%n
            associate (k => self%model%scene%controller(i)%actuator, force => self%workspace%driving_force)
                force(:, k) = force(:, k) + effort_scale(self%model, k)*self%control%output(:, i)
            end associate
        end do
    end subroutine drive_by_controllers

    !> Continuous controllers at states.
    subroutine run_controllers(self, t, y, measure, law)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t(lanes)               !! [s]
        real(wp), intent(in) :: y(:, :)                !! (lane, n)
        real(wp), intent(in) :: measure(:, :), law(:, :)       !! (lane, measure), (lane, law)
        type(control_sight) :: sight(lanes, self%control%n)
        real(wp), dimension(lanes, self%control%n) :: integral, slope
        integer :: i

        integral = 0
        slope = 0
        do i = 1, self%control%n
            if (self%layout%integral(i) > 0) integral(:, i) = y(:, self%layout%integral(i))
            if (self%layout%slope(i) > 0) slope(:, i) = y(:, self%layout%slope(i))
        end do
        associate (spec => self%model%scene%controller)
            call see(self, t, y, measure, law, .not. is_sampled(spec), sight)
            call run_continuous(spec, sight, integral, slope, self%control)
        end associate
    end subroutine run_controllers

    !> Rates of what continuous controllers have in y.
    subroutine pack_control_rates(self, rate)
        class(forward_system), intent(in) :: self
        real(wp), intent(inout) :: rate(:, :)          !! (lane, n)
        integer :: i

        do i = 1, self%control%n
            if (self%layout%integral(i) > 0) rate(:, self%layout%integral(i)) = self%control%integral_rate(:, i)
            if (self%layout%slope(i) > 0) rate(:, self%layout%slope(i)) = self%control%slope_rate(:, i)
        end do
    end subroutine pack_control_rates

    !> The same as `drive_by_controllers` in a record's samples, whose laws are applied.
    subroutine drive_record_by_controllers(self, n, t, y)
        class(forward_system), intent(inout) :: self
        integer, intent(in) :: n
        real(wp), intent(in) :: t(lanes)               !! [s]
        real(wp), intent(in) :: y(:, :)                !! (lane, n)
        integer :: i, lane(lanes)

        lane = [(min(i, n), i=1, lanes)]
        associate (samples => self%record%samples)
            if (self%has_continuous) call run_controllers(self, t(lane), y(lane, :), transpose(samples%measured(:, lane)), &
                                                          transpose(samples%law(:, lane)))
            do i = 1, self%control%n
                associate (k => self%model%scene%controller(i)%actuator)
                    samples%effort(k, :n) = samples%effort(k, :n) + effort_scale(self%model, k)*self%control%output(:n, i)
                end associate
            end do
            samples%is_left(:n) = samples%is_left(:n) .or. .not. sum(abs(self%control%output(:n, :)), 2) <= huge(1.0_wp)
        end associate
    end subroutine drive_record_by_controllers

    ! ---------------------------------------------------------------- motors

    !> The same in a record's samples, whose states are placed; what is lost is taken off.
    subroutine drive_record_by_motors(self, n, t, y)
        class(forward_system), intent(inout) :: self
        integer, intent(in) :: n
        real(wp), intent(in) :: t(lanes)               !! [s]
        real(wp), intent(in) :: y(:, :)                !! (lane, n)
        real(wp) :: speed, braked
        integer :: i, k, lane

        do i = 1, self%model%n_actuator
            associate (drive => self%model%scene%actuator(i)%drive, motor => self%model%scene%actuator(i)%motor)
                if (self%equations%unknown%drive(i) .or. drive%side == side_joint) cycle
                k = coordinate_of_actuator(self%model, i)
                do lane = 1, n
                    associate (effort => self%record%samples%effort(i, lane))
                        speed = motor%ratio*self%record%samples%qd(k, lane)
                        braked = brake_torque(motor, min(t(lane), self%t_braked(lane)), self%switched(lane, i), &
                                              self%is_on(lane, i), speed)
                        effort = motor%ratio*(motor_torque(self, i, lane, y, effort, speed) - braked)
                    end associate
                end do
            end associate
        end do
        associate (lossy => self%equations%lossy, rub => self%equations%rub)
            call settle_record_losses(self%model, lossy, rub(size(rub) - size(lossy) + 1:), n, self%record)
        end associate
    end subroutine drive_record_by_motors

    !> What motors give at their joint variables, where laws are about them, less what brakes take of it.
    subroutine drive_by_motors(self, t, y)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t(lanes)               !! [s]
        real(wp), intent(in) :: y(:, :)                !! (lane, n)
        real(wp) :: speed(lanes), torque(lanes)
        integer :: i, lane

        associate (model => self%model, workspace => self%workspace)
            call actuator_rates(model, workspace%state, workspace%driving_rate)
            do i = 1, model%n_actuator
                associate (drive => model%scene%actuator(i)%drive, motor => model%scene%actuator(i)%motor, &
                           force => workspace%driving_force(:, i))
                    if (self%equations%unknown%drive(i) .or. drive%side == side_joint) cycle
                    speed = motor%ratio*workspace%driving_rate(:, i)
                    self%brake(:, i) = brake_torque(motor, min(t, self%t_braked), self%switched(:, i), self%is_on(:, i), speed)
                    do lane = 1, lanes
                        torque(lane) = motor_torque(self, i, lane, y, force(lane), speed(lane))
                    end do
                    force = motor%ratio*(torque - self%brake(:, i))
                end associate
            end do
            workspace%motor_force = workspace%driving_force
        end associate
    end subroutine drive_by_motors

    !> Torque of a motor by its law; by its current, whose rate is found on the way, if the winding has an inductance.
    real(wp) function motor_torque(self, i, lane, y, law, speed) result(torque)
        class(forward_system), intent(inout) :: self
        integer, intent(in) :: i, lane                 !! actuator, lane
        real(wp), intent(in) :: y(:, :)                !! (lane, n)
        real(wp), intent(in) :: law                    !! what its law gives [N m, V]
        real(wp), intent(in) :: speed                  !! of the motor [rad/s]

        associate (motor => self%model%scene%actuator(i)%motor, drive => self%model%scene%actuator(i)%drive, &
                   place => self%layout%current(i))
            if (place == 0) then
                torque = torque_of_law(motor, drive%side, law, speed)
                return
            end if
            self%current_rate(lane, i) = current_rate(motor, law, y(lane, place), speed)
            torque = motor%torque_constant*y(lane, place)
        end associate
    end function motor_torque

    !> Rates of the currents that are in y. Lanes that are not used are like the last one.
    subroutine pack_current_rates(self, rate)
        class(forward_system), intent(in) :: self
        real(wp), intent(inout) :: rate(:, :)          !! (lane, n)
        integer :: i, lane

        do i = 1, self%model%n_actuator
            if (self%layout%current(i) > 0) &
                rate(:, self%layout%current(i)) = self%current_rate([(min(lane, self%n_used), lane=1, lanes)], i)
        end do
    end subroutine pack_current_rates

    !> An event switches the brakes that wait for it.
    subroutine switch_brakes(self, lane, event, t, has_changed)
        class(forward_system), intent(inout) :: self
        integer, intent(in) :: lane, event
        real(wp), intent(in) :: t                      !! [s]
        logical, intent(inout) :: has_changed
        integer :: i

        do i = 1, self%model%n_actuator
            associate (brake => self%model%scene%actuator(i)%motor%brake)
                if (.not. brake%is_given .or. .not. any([brake%from_event, brake%until_event] == event)) cycle
                self%is_on(lane, i) = brake%from_event == event
                self%switched(lane, i) = t
                self%t_braked(lane) = t
                has_changed = .true.
            end associate
        end do
    end subroutine switch_brakes

    !> And clutches.
    subroutine switch_clutches(self, lane, event, t, is_closed)
        class(forward_system), intent(inout) :: self
        integer, intent(in) :: lane, event
        real(wp), intent(in) :: t                      !! [s]
        logical, intent(inout) :: is_closed(:, :)      !! (lane, n_clutch)
        integer :: i

        do i = 1, size(is_closed, 2)
            associate (clutch => self%model%scene%clutch(i))
                if (.not. any([clutch%from_event, clutch%until_event] == event)) cycle
                is_closed(lane, i) = clutch%from_event == event
                self%clutch%was_closed(lane, i) = is_closed(lane, i)
                self%clutch%switched(lane, i) = t
            end associate
        end do
    end subroutine switch_clutches

    !> Motion of the state evaluated last in the workspace.
    subroutine catch_up(self)
        class(forward_system), intent(inout) :: self

        if (.not. self%is_behind) return
        call unpack_state(self%model, self%layout, self%t_tried, self%y_tried, self%turns, self%workspace%state)
        call evaluate_assembled(self%model, self%t_tried, self%assembly, self%workspace%state)
        self%is_behind = .false.
    end subroutine catch_up

    ! ---------------------------------------------------------------- by a record of the scene

    !> Evaluations on lanes that take about as long as the making of a record: a run of fewer has none.
    pure integer function evaluations_before_record(model) result(n)
        type(model_type), intent(in) :: model
        integer, parameter :: evaluations_a_link = 100     !! measured: 50 (of a hundred links) to 300
        integer, parameter :: of_legs = 300                !! which the lanes carry in few columns

        n = merge(of_legs, evaluations_a_link, any(model%leg%is_carried))*model%n_link
    end function evaluations_before_record

    !> Make the record and use it from now on, if the scene has one and it finds what the lanes find.
    subroutine make_record(self, t)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t                      !! [s]

        call make_forward_record(self%model, self%layout, self%equations%unknown, self%wants_work, self%record)
        self%may_record = self%record%recorded%is_usable
        if (self%may_record) self%may_record = agrees_with_lanes(self, t)
        if (self%may_record) call record_motion_forces(self%of_motion)
        if (self%may_record) call help_lanes(self)
    end subroutine make_record

    !> Groups are closed by the record's programs where lanes look at a state, too.
    subroutine help_lanes(self)
        class(forward_system), intent(inout) :: self

        nullify (self%assembly%closer)
        if (self%record%recorded%closing%is_usable) self%assembly%closer => self%record%recorded%closing
    end subroutine help_lanes

    !> Use the record of another system of the same scene.
    subroutine share_record(self, other)
        class(forward_system), intent(inout) :: self
        type(forward_system), intent(in) :: other

        self%may_record = other%may_record
        if (.not. self%may_record) return
        call share_forward_record(self%model, other%record%recorded, self%record)
        call share_motion_forces(other%of_motion, self%of_motion)
        call help_lanes(self)
    end subroutine share_record

    !> dy/dt of the lanes used; the others are like the last of these.
    subroutine evaluate_by_record(self, t, y, rate, is_left)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t(lanes)
        real(wp), intent(in) :: y(:, :)
        real(wp), intent(out) :: rate(:, :)
        logical, intent(out) :: is_left(lanes)         !! that the record does not serve
        real(wp) :: branch(lanes, self%model%n_branch), inverse_force(lanes, self%model%n_actuator), counted(lanes, self%model%n_q)
        integer :: lane, n
        logical :: has_motor_laws, changes_efforts

        n = self%n_used
        has_motor_laws = any(self%model%scene%actuator%drive%side /= side_joint)
        inverse_force = 0
        if (applies_motion_forces(self)) then
            call find_motion_forces(t, n, self%of_motion)
            inverse_force = self%of_motion%force
        end if
        if (allocated(self%given_force)) inverse_force = spread(self%given_force, 1, lanes)
        if (self%assembly%is_needed) then
            branch = self%assembly%branch
        else
            branch = spread(self%model%branch(:self%model%n_branch), 1, lanes)
        end if
        associate (samples => self%record%samples)
            call place_states(self%model, self%layout, n, t, y, self%turns, branch, self%by_inverse, inverse_force, self%record)
            if (applies_motion_forces(self)) samples%is_left(:n) = samples%is_left(:n) .or. self%of_motion%status(:n) /= sample_ok
            call close_states(self%model, self%assembly, n, self%record)
            changes_efforts = has_motor_laws .or. self%control%n > 0
            if (changes_efforts) call apply_record_laws(n, self%record)
            if (self%control%n > 0) call drive_record_by_controllers(self, n, t, y)
            if (has_motor_laws) call drive_record_by_motors(self, n, t, y)
            call run_states(n, self%record, self%workspace%acceleration, counted, rate(:, self%layout%work), &
                            rate(:, self%layout%supplied), laws_are_there=changes_efforts)
            if (self%assembly%is_needed) then
                do lane = 1, n
                    samples%is_left(lane) = samples%is_left(lane) &
                                            .or. may_change_assembly(self%model, self%assembly, lane, t(lane), self%record)
                end do
            end if
            is_left = samples%is_left([(min(lane, n), lane=1, lanes)])
        end associate
        call pack_rates(self%model, self%layout, y, self%workspace%acceleration, counted, rate)
        call pack_control_rates(self, rate)
        call pack_current_rates(self, rate)
        if (self%may_jump) &
            call self%note_mode(self%record%samples%mode([(min(lane, n), lane=1, lanes)]), rate)
    end subroutine evaluate_by_record

    !> Does the record find what the lanes find? Asked once, at representative poses in motion: a difference would be a defect,
    !> and the lanes are believed.
    logical function agrees_with_lanes(self, t) result(agrees)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t                      !! [s]
        type(carried_assembly) :: carried
        type(sample_assembly) :: assembly
        real(wp), allocatable :: pose(:, :)
        real(wp) :: y(lanes, self%n), by_lanes(lanes, self%n), by_record(lanes, self%n), stand(3, 4, 0:self%model%n_link)
        real(wp), dimension(lanes, self%model%n_q) :: q, qd
        real(wp), dimension(lanes, self%model%n_branch + size(self%model%group)) :: margin, drift
        real(wp), allocatable :: turns(:, :)
        integer :: obstacle(lanes), first, i, k, lane, n_used, n_compared, n_alike
        logical :: failed(lanes), is_left(lanes)

        carried = self%assembly
        obstacle = self%obstacle
        turns = self%turns
        n_used = self%n_used
        self%n_used = lanes
        call begin_assembly(self%model, t, self%assembly)
        self%turns = 0
        call choose_poses(self%model, spread(self%model%start_q, 2, 1), pose, assembly, stand)
        n_compared = 0
        n_alike = 0
        do first = 1, size(pose, 2), lanes
            do lane = 1, lanes
                i = min(first + lane - 1, size(pose, 2))
                q(lane, :) = pose(:, i)
                qd(lane, :) = [(modulo((i*self%model%n_q + k)*golden, 1.0_wp) - 0.5_wp, k=1, self%model%n_q)]
            end do
            call fill_start(self%model, self%layout, q, qd, y)
            call self%evaluate_on_lanes(spread(t, 1, lanes), y, by_lanes, failed)
            if (self%assembly%is_needed) call measure_margins(self%model, self%workspace%state, margin, drift)
            if (size(self%model%group) > 0) call stand_there()
            call evaluate_by_record(self, spread(t, 1, lanes), y, by_record, is_left)
            do lane = 1, min(lanes, size(pose, 2) - first + 1)
                if (failed(lane) .or. is_left(lane)) cycle
                n_compared = n_compared + 1
                if (are_alike(by_lanes(lane, :), by_record(lane, :)) .and. has_same_margins(lane)) n_alike = n_alike + 1
            end do
        end do
        self%assembly = carried
        self%obstacle = obstacle
        self%turns = turns
        self%n_used = n_used
        ! A defect shows everywhere; near a dead point both may have few digits.
        agrees = n_compared > 0 .and. 2*n_alike > n_compared

    contains

        !> The record closes groups from where the lanes have found them, far from the start.
        subroutine stand_there()
            self%assembly%q = q
            self%assembly%place = self%workspace%state%group%place
            self%assembly%margin = margin
            self%assembly%drift = 0
        end subroutine stand_there

        logical function has_same_margins(lane)
            integer, intent(in) :: lane

            has_same_margins = .true.
            if (.not. self%assembly%is_needed) return
            associate (found => self%record%samples%found(:, lane), out => self%record%recorded%out, n => self%model%n_branch)
                ! either may vanish: sines compare with one, and so do their rates while coordinates have rates of about one
                has_same_margins = are_alike([1.0_wp, margin(lane, :n)], [1.0_wp, found(out%margin:out%margin + n - 1)]) &
                                   .and. are_alike([1.0_wp, drift(lane, :n)], [1.0_wp, found(out%drift:out%drift + n - 1)])
            end associate
        end function has_same_margins
    end function agrees_with_lanes

    ! ---------------------------------------------------------------- on lanes

    !> Power of the driving forces, and of all forces but gravity.
    subroutine find_powers(self, driving, supplied)
        class(forward_system), intent(inout) :: self
        real(wp), intent(out), dimension(lanes) :: driving, supplied    !! [W]
        real(wp) :: speed(lanes, self%model%n_actuator)
        integer :: i

        driving = 0
        supplied = 0
        if (.not. self%wants_work) return
        call actuator_rates(self%model, self%workspace%state, speed)
        call applied_power(self%model, self%workspace%state, self%workspace%load, supplied)
        if (size(self%model%payload) > 0) call add_payload_power(self%model, self%workspace%state, &
            self%workspace%acceleration - self%workspace%state%qdd, supplied)
        do i = 1, self%model%n_actuator
            driving = driving + self%workspace%driving_force(:, i)*speed(:, i)
            if (self%equations%unknown%drive(i)) supplied = supplied + self%workspace%driving_force(:, i)*speed(:, i)
        end do
    end subroutine find_powers

    !> Energy that is there but was not supplied, since the last accepted state, over what the errors allowed and rounding
    !> would make.
    function broken_law(self, t, y, nudge, error) result(part)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t, y(:)
        real(wp), intent(in) :: nudge(:), error(:)
        real(wp) :: part
        real(wp), parameter :: many = 10               !! errors in a row, of one sign
        integer, parameter :: n_nudge = 3
        real(wp) :: changed(self%n, 0:n_nudge + self%n), surplus(0:n_nudge + self%n), noise
        integer :: k

        part = 0
        if (.not. (self%assembly%is_needed .and. self%wants_work)) return
        changed = spread(y, 2, size(surplus))
        do k = 1, n_nudge
            changed(:, k) = y + (k - 2.5_wp)*nudge
        end do
        do k = 1, self%n
            changed(k, n_nudge + k) = y(k) + error(k)
        end do
        call find_surplus(self, t, changed, surplus)
        noise = maxval(abs(surplus(1:n_nudge) - surplus(0)))
        part = abs(surplus(0) - self%surplus(1)) &
               /max(many*(sum(abs(surplus(n_nudge + 1:) - surplus(0))) + noise + self%surplus_noise), tiny(1.0_wp))
        if (.not. part <= huge(1.0_wp)) part = huge(1.0_wp)
        self%surplus_noise_tried = noise
    end function broken_law

    !> Has a coordinate come past where it should be exchanged, or the mechanism been thrown back at its dead point?
    logical function leads_too_far(self, t)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t                      !! [s]
        real(wp), allocatable :: accepted(:, :)

        leads_too_far = .false.
        if (self%bounce%is_on) then
            call catch_up(self)
            call look_at_end(self%model, self%workspace%state, t, self%workspace%acceleration(1, :), self%bounce, leads_too_far)
            if (leads_too_far) return
        end if
        if (.not. (self%watch%is_on .and. self%watch%may_exchange)) return
        accepted = self%watch%ratio
        call catch_up(self)
        call compare_rates(self%model, self%workspace%state, self%watch)
        leads_too_far = is_well_past(self%watch, accepted)
        self%ratio_tried = self%watch%ratio
        self%is_compared = .true.
        self%watch%ratio = accepted
    end function leads_too_far

    !> Energy of states on the accepted assembly, less what was supplied.
    subroutine find_surplus(self, t, y, surplus)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t, y(:, :)             !! (n, state)
        real(wp), intent(out) :: surplus(:)            !! [J] (state)
        real(wp) :: lane_y(lanes, self%n), energy(lanes), instant(lanes)
        integer :: first, lane

        instant = t
        do first = 1, size(surplus), lanes
            do lane = 1, lanes
                lane_y(lane, :) = y(:, min(first + lane - 1, size(surplus)))
            end do
            call unpack_state(self%model, self%layout, instant, lane_y, self%turns, self%assembly%state)
            call evaluate_on_assembly(self%model, instant, self%assembly, self%assembly%state)
            call energy_of_motion(self%model, self%assembly%state, energy)
            energy = energy - lane_y(:, self%layout%supplied)
            do lane = 1, min(lanes, size(surplus) - first + 1)
                surplus(first + lane - 1) = energy(lane)
            end do
        end do
    end subroutine find_surplus

    ! ---------------------------------------------------------------- events and end stops

    pure logical function rests_anywhere(self)
        class(forward_system), intent(in) :: self

        rests_anywhere = .false.
        if (allocated(self%rests)) rests_anywhere = any(self%rests)
    end function rests_anywhere

    !> The scene's events at these states. That of a stop at which its joint variable rests is its push: when that vanishes
    !> the variable leaves. That of a clutch that holds is what it could hold besides; that of an open one never happens.
    subroutine evaluate_events(self, t, y, guard)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t(lanes)
        real(wp), intent(in) :: y(:, :)
        real(wp), intent(out) :: guard(:, :)
        real(wp) :: rate(lanes, self%n)
        logical :: failed(lanes)
        integer :: i

        call look_closely(self, t, y)
        call find_events(self%model, self%look, angles_about(self, t), guard)
        failed = self%look%unreachable .or. self%look%not_converged .or. self%look%way_status /= sample_ok
        do i = 1, size(guard, 2)
            where (failed) guard(:, i) = ieee_value(1.0_wp, ieee_quiet_nan)
        end do
        do i = 1, size(self%rests, 2)
            associate (stop => self%model%scene%stop(i))
                if (stop%is_hard) guard(:, stop%event) = guard(:, stop%event) + self%yielded(:, i)
            end associate
        end do
        do i = 1, n_clutch(self%model%scene)
            where (.not. self%clutch%is_closed(:, i)) guard(:, self%model%scene%clutch(i)%event) = 1
        end do
        if (.not. (rests_anywhere(self) .or. holds_anywhere(self))) return
        call self%evaluate_on_lanes(t, y, rate, failed)
        do i = 1, n_clutch(self%model%scene)
            where (self%clutch%holds(:, i)) guard(:, self%model%scene%clutch(i)%event) = reserve(self, i)
        end do
        do i = 1, size(self%rests, 2)
            associate (e => self%model%scene%stop(i)%event)
                where (self%rests(:, i)) guard(:, e) = self%push(:, i)
            end associate
        end do
    end subroutine evaluate_events

    !> Motion of states; with the accelerations of the coordinates, if they are told.
    subroutine look_closely(self, t, y, acceleration)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t(lanes)
        real(wp), intent(in) :: y(:, :)
        real(wp), intent(in), optional :: acceleration(:, :)    !! (lane, n_q)

        call unpack_state(self%model, self%layout, t, y, self%turns, self%look)
        if (present(acceleration)) self%look%qdd = acceleration
        self%look%time = t
        call evaluate_assembled(self%model, t, self%assembly, self%look)
    end subroutine look_closely

    !> Velocities or accelerations of joint variables away from their stops, of the state looked at.
    function away_from_stops(self, level) result(rate)
        class(forward_system), intent(in) :: self
        integer, intent(in) :: level
        real(wp) :: rate(lanes, size(self%rests, 2))
        integer :: i

        do i = 1, size(rate, 2)
            associate (stop => self%model%scene%stop(i))
                rate(:, i) = 0
                if (stop%is_hard) rate(:, i) = -stop%side*joint_rate(self%model, self%look, stop%joint, stop%variable, level)
            end associate
        end do
    end function away_from_stops

    !> Accelerations away from stops and of the slips of clutches, and those of the coordinates, while stops and clutches push; on top
    !> of that clutches rub. Kinematics, loads and drives of the state are in the workspace.
    subroutine accelerate(self, t, y, push, away)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t(lanes)
        real(wp), intent(in) :: y(:, :)
        real(wp), intent(in) :: push(:, :)             !! (lane, n_stop + n_clutch)
        real(wp), intent(out) :: away(:, :)            !! (lane, n_stop + n_clutch)

        associate (state => self%workspace%state, n => size(self%rests, 2))
            state%stop_force = push(:, :n)
            state%clutch_force = self%clutch%rub + push(:, n + 1:)
            call solve_equations(self%model, self%equations, self%workspace)
            state%stop_force = 0
            state%clutch_force = self%clutch%rub
        end associate
        call look_closely(self, t, y, self%workspace%acceleration)
        away = rates_held(self, level_given)
    end subroutine accelerate

    !> What a unit push of each stop in contact, and of each clutch asked for, gives: accelerations away from all stops, of all slips, and
    !> of the coordinates. They are linear in the push; one that outdoes all other forces leaves its digits to the difference.
    subroutine find_responses(self, t, y, is_in_contact, response, of_coordinates)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t(lanes)
        real(wp), intent(in) :: y(:, :)
        logical, intent(in) :: is_in_contact(:, :)     !! (lane, n_stop + n_clutch)
        real(wp), intent(out) :: response(:, :, :)     !! (lane, of, by)
        real(wp), intent(out) :: of_coordinates(:, :, :)    !! (lane, n_q, by)
        real(wp), parameter :: much = 1.0e4_wp
        real(wp), dimension(lanes, size(is_in_contact, 2)) :: push, at_rest, away
        real(wp) :: own(lanes, self%model%n_q), unit(lanes), largest(lanes)
        integer :: k, i, turn

        push = 0
        response = 0
        of_coordinates = 0
        call accelerate(self, t, y, push, at_rest)
        own = self%workspace%acceleration
        largest = maxval(abs(own), dim=2)
        do k = 1, size(push, 2)
            if (.not. any(is_in_contact(:, k))) cycle
            unit = 1
            do turn = 1, 2
                push = 0
                push(:, k) = unit
                call accelerate(self, t, y, push, away)
                do i = 1, size(push, 2)
                    response(:, i, k) = (away(:, i) - at_rest(:, i))/unit
                end do
                do i = 1, self%model%n_q
                    of_coordinates(:, i, k) = (self%workspace%acceleration(:, i) - own(:, i))/unit
                end do
                unit = much*max(1.0_wp, largest)/max(maxval(abs(of_coordinates(:, :, k)), dim=2), tiny(1.0_wp))
                where (.not. unit <= huge(1.0_wp)) unit = 1
            end do
        end do
    end subroutine find_responses

    !> Push of the stops at which joint variables rest and of the clutches that hold: as much as keeps them there. The accelerations in
    !> the workspace become those with it.
    subroutine hold_variables(self, t, y)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t(lanes)
        real(wp), intent(in) :: y(:, :)
        integer, parameter :: n_turn = 2               !! the second mends what the first has rounded
        integer, parameter :: most_turns = 20          !! friction in joints changes with what is pushed
        real(wp), parameter :: enough = 1.0e-14_wp
        real(wp), dimension(lanes, n_held(self)) :: push, away, change, wanted
        real(wp) :: response(lanes, n_held(self), n_held(self))
        real(wp) :: of_coordinates(lanes, self%model%n_q, n_held(self))
        logical :: is_held(lanes, n_held(self)), rubs
        integer :: turn

        is_held(:, :size(self%rests, 2)) = self%rests
        is_held(:, size(self%rests, 2) + 1:) = self%clutch%holds
        call find_responses(self, t, y, is_held, response, of_coordinates)
        rubs = size(self%equations%rub) > 0
        push = 0
        call accelerate(self, t, y, push, away)
        wanted = 0
        if (holds_anywhere(self)) wanted(:, size(self%rests, 2) + 1:) = way_back(self, t)
        do turn = 1, merge(most_turns, n_turn, rubs)
            call solve_contacts(response, is_held, wanted - away, change)
            push = push + change
            call accelerate(self, t, y, push, away)
            if (turn >= n_turn .and. all(abs(change) <= enough*abs(push))) exit
        end do
        call still_coordinates(self, self%workspace%acceleration)
        self%push = push(:, :size(self%rests, 2))
        self%clutch%applied = self%clutch%rub + push(:, size(self%rests, 2) + 1:)
        self%clutch%force = self%clutch%applied
    end subroutine hold_variables

    ! ---------------------------------------------------------------- clutches

    !> Stops and clutches together.
    pure integer function n_held(self)
        class(forward_system), intent(in) :: self

        n_held = size(self%rests, 2) + n_clutch(self%model%scene)
    end function n_held

    !> Does a clutch hold?
    pure logical function holds_anywhere(self)
        class(forward_system), intent(in) :: self

        holds_anywhere = .false.
        if (allocated(self%clutch%holds)) holds_anywhere = any(self%clutch%holds)
    end function holds_anywhere

    !> Is one closed?
    pure logical function is_clutched(self)
        class(forward_system), intent(in) :: self

        is_clutched = .false.
        if (allocated(self%clutch%is_closed)) is_clutched = any(self%clutch%is_closed)
    end function is_clutched

    !> Velocities or accelerations away from stops, and of the slips of clutches, of the state looked at.
    function rates_held(self, level) result(rate)
        class(forward_system), intent(in) :: self
        integer, intent(in) :: level
        real(wp) :: rate(lanes, n_held(self))

        rate(:, :size(self%rests, 2)) = away_from_stops(self, level)
        rate(:, size(self%rests, 2) + 1:) = slips(self, level)
    end function rates_held

    !> Slips of clutches, or how fast they change.
    function slips(self, level) result(rate)
        class(forward_system), intent(in) :: self
        integer, intent(in) :: level
        real(wp) :: rate(lanes, n_clutch(self%model%scene))
        integer :: i

        do i = 1, size(rate, 2)
            associate (clutch => self%model%scene%clutch(i))
                rate(:, i) = joint_rate(self%model, self%look, clutch%joint(1), clutch%variable(1), level)
                if (clutch%n_side == 2) rate(:, i) = rate(:, i) &
                    - clutch%ratio*joint_rate(self%model, self%look, clutch%joint(2), clutch%variable(2), level)
            end associate
        end do
    end function slips

    !> Rates on both sides of a clutch of two, of the state looked at.
    function speed_of_sides(self, i) result(speed)
        class(forward_system), intent(in) :: self
        integer, intent(in) :: i                       !! clutch
        real(wp) :: speed(lanes)

        speed = 0
        associate (clutch => self%model%scene%clutch(i))
            if (clutch%n_side == 2) speed = &
                abs(joint_rate(self%model, self%look, clutch%joint(1), clutch%variable(1), level_velocity)) &
                + abs(clutch%ratio*joint_rate(self%model, self%look, clutch%joint(2), clutch%variable(2), level_velocity))
        end associate
    end function speed_of_sides

    !> Slips of a state, on lane 1.
    function slips_at(self, t, y) result(slip)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t                      !! [s]
        real(wp), intent(in) :: y(:, :)
        real(wp) :: slip(n_clutch(self%model%scene)), of_all(lanes, n_clutch(self%model%scene))

        call look_closely(self, spread(t, 1, lanes), y)
        of_all = slips(self, level_velocity)
        slip = of_all(1, :)
    end function slips_at

    !> Capacities of closed clutches, and the force of those that slip. Kinematics of the state are in the workspace.
    subroutine rub_clutches(self, t)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t(lanes)               !! [s]
        real(wp), dimension(lanes) :: rate, rate2
        integer :: i

        associate (state => self%workspace%state, of => self%clutch)
            of%rub = 0
            if (any(of%is_closed) .and. any(self%model%scene%clutch%capacity%kind == law_over)) call find_laws(self%model, state)
            do i = 1, size(of%rub, 2)
                associate (clutch => self%model%scene%clutch(i))
                    if (clutch%friction > 0) call let_contacts_slide(i)
                    if (clutch%is_positive .or. clutch%friction > 0 .or. .not. any(of%is_closed(:, i))) cycle
                    if (clutch%capacity%kind == law_over) then
                        of%capacity(:, i) = state%law(:, clutch%capacity%law) &
                                            *self%model%scene%laws%scale**merge(1, 2, clutch%unit == "N")
                    else
                        call law_on_lanes(clutch%capacity, t, of%capacity(:, i), rate, rate2)
                    end if
                    where (of%capacity(:, i) < 0) of%capacity(:, i) = 0
                    where (of%is_closed(:, i) .and. .not. of%holds(:, i)) of%rub(:, i) = -of%sense(:, i)*of%capacity(:, i)
                end associate
            end do
            of%force = of%rub
            of%applied = of%rub
            state%clutch_force = of%rub
        end associate

    contains

        !> Joints that may stick rub by their reactions, the way they slip.
        subroutine let_contacts_slide(i)
            integer, intent(in) :: i                   !! clutch
            integer :: k

            do k = 1, size(self%model%contact)
                if (self%model%contact(k)%joint /= self%model%scene%clutch(i)%joint(1)) cycle
                self%workspace%friction%sense(:, k) = merge(self%clutch%sense(:, i), 2.0_wp, abs(self%clutch%sense(:, i)) > 0)
            end do
        end subroutine let_contacts_slide
    end subroutine rub_clutches

    !> Are there joints whose friction sticks?
    pure logical function has_sticking(self)
        class(forward_system), intent(in) :: self

        has_sticking = .false.
        if (n_clutch(self%model%scene) > 0) has_sticking = any(self%model%scene%clutch%friction > 0)
    end function has_sticking

    !> What joints that may stick could hold, or rub with, by the reactions just found.
    subroutine measure_grip(self)
        class(forward_system), intent(inout) :: self
        real(wp) :: press(lanes, size(self%equations%rub)), slip(lanes, n_clutch(self%model%scene))
        integer :: i, k

        call pressing_forces(self%equations%rub, self%workspace%friction, press)
        associate (of => self%clutch, state => self%workspace%state)
            do i = 1, size(slip, 2)
                associate (clutch => self%model%scene%clutch(i))
                    if (clutch%friction == 0) cycle
                    slip(:, i) = abs(joint_rate(self%model, state, clutch%joint(1), clutch%variable(1), level_velocity))
                    where (of%holds(:, i)) slip(:, i) = 0
                    of%capacity(:, i) = 0
                    do k = 1, size(self%model%contact)
                        associate (contact => self%model%contact(k))
                            if (contact%joint == clutch%joint(1)) of%capacity(:, i) = of%capacity(:, i) &
                                + lever_of(contact)*press(:, k)*sliding_coefficient(contact, lever_of(contact)*slip(:, i))
                        end associate
                    end do
                    where (.not. of%holds(:, i)) of%force(:, i) = -of%sense(:, i)*of%capacity(:, i)
                end associate
            end do
        end associate
    end subroutine measure_grip

    !> What a clutch could hold beside what it does: it begins to slip where that is gone. Rounding is none of it.
    function reserve(self, i)
        class(forward_system), intent(in) :: self
        integer, intent(in) :: i                       !! clutch
        real(wp) :: reserve(lanes)
        real(wp), parameter :: slack = 1.0e-12_wp

        associate (clutch => self%model%scene%clutch(i), most => self%model%scene%clutch(i)%static*self%clutch%capacity(:, i))
            reserve = 1
            if (.not. clutch%is_positive) reserve = most*(1 + slack) - abs(self%clutch%force(:, i))
        end associate
    end function reserve

    !> Accelerations of slips that lead joint variables back which errors of the steps have carried off while they are held. Where both are
    !> coordinates steps keep what is linear in them, and there is nothing to mend.
    function way_back(self, t) result(wanted)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t(lanes)
        real(wp) :: wanted(lanes, n_clutch(self%model%scene))
        real(wp) :: here(lanes, size(wanted, 2)), slip(lanes, size(wanted, 2)), pace(lanes)
        logical :: is_led(size(wanted, 2))
        integer :: i

        is_led = led_by(self%model, self%model%scene%clutch)

        wanted = 0
        pace = merge(0.25_wp/max(self%clutch%longest, tiny(1.0_wp)), 0.0_wp, self%clutch%longest > 0)
        if (all(is_led) .or. .not. any(pace > 0)) return
        call find_kept(self%model, self%look, angles_about(self, t), here)
        slip = slips(self, level_velocity)
        do i = 1, size(wanted, 2)
            if (is_led(i)) cycle
            here(:, i) = here(:, i) - self%clutch%kept(:, i)
            if (self%model%scene%clutch(i)%unit == "N") here(:, i) = self%model%scene%laws%scale*here(:, i)
            where (self%clutch%holds(:, i)) wanted(:, i) = -pace*(2*slip(:, i) + pace*here(:, i))
        end do
    end function way_back

    !> A coordinate that is held has no velocity and no acceleration, to the last digit: so it does not creep, however long.
    subroutine still_coordinates(self, rate)
        class(forward_system), intent(in) :: self
        real(wp), intent(inout) :: rate(:, :)          !! velocities or accelerations of coordinates (lane, n_q)
        integer :: i, k

        do i = 1, n_clutch(self%model%scene)
            associate (clutch => self%model%scene%clutch(i))
                if (clutch%n_side == 2) cycle
                k = coordinate_of(self%model, clutch%joint(1), clutch%variable(1))
                if (k == 0) cycle
                if (self%layout%rate(k) == 0) cycle    ! it is driven
                where (self%clutch%holds(:, i)) rate(:, k) = 0
            end associate
        end do
    end subroutine still_coordinates

    !> The same of the velocities in y.
    subroutine still_rates(self, y)
        class(forward_system), intent(in) :: self
        real(wp), intent(inout) :: y(:, :)
        real(wp) :: rates(lanes, self%model%n_q)
        integer :: k

        associate (place => self%layout%rate)
            rates = 0
            do k = 1, size(place)
                if (place(k) > 0) rates(:, k) = y(:, place(k))
            end do
            call still_coordinates(self, rates)
            do k = 1, size(place)
                if (place(k) > 0) y(:, place(k)) = rates(:, k)
            end do
        end associate
    end subroutine still_rates

    !> Are a clutch's joint variables coordinates?
    pure elemental logical function led_by(model, clutch)
        type(model_type), intent(in) :: model
        type(clutch_spec), intent(in) :: clutch

        led_by = coordinate_of(model, clutch%joint(1), clutch%variable(1)) > 0
        if (clutch%n_side == 2) led_by = led_by .and. coordinate_of(model, clutch%joint(2), clutch%variable(2)) > 0
    end function led_by

    !> The run begins here: clutches are open or closed, and what has no slip may be held.
    subroutine begin_with_clutches(self, t, y)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t                      !! [s]
        real(wp), intent(inout) :: y(:, :)

        if (n_clutch(self%model%scene) == 0) return
        self%clutch%t_accepted = t
        call note_ease(self, spread(t, 1, lanes), y)
        self%clutch%begins = .true.
        call self%switch_now(t, y)
        self%clutch%begins = .false.
    end subroutine begin_with_clutches

    !> How much clutches have to hold, where the run begins.
    subroutine note_ease(self, t, y)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t(lanes)
        real(wp), intent(in) :: y(:, :)
        real(wp) :: response(lanes, n_held(self), n_held(self)), rate(lanes, self%n)
        real(wp) :: of_coordinates(lanes, self%model%n_q, n_held(self))
        logical :: takes_part(lanes, n_held(self)), failed(lanes)
        integer :: i

        takes_part(:, :size(self%rests, 2)) = .false.
        takes_part(:, size(self%rests, 2) + 1:) = .true.
        call self%evaluate_on_lanes(t, y, rate, failed)
        call find_responses(self, t, y, takes_part, response, of_coordinates)
        do i = 1, n_clutch(self%model%scene)
            self%clutch%ease(:, i) = response(:, size(self%rests, 2) + i, size(self%rests, 2) + i)
        end do
    end subroutine note_ease

    !> An instant at which clutches may close or open.
    subroutine switch_now(self, t, y, is_changed)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t                      !! [s]
        real(wp), intent(inout) :: y(:, :)
        logical, intent(out), optional :: is_changed   !! y is another one
        logical, dimension(lanes, n_clutch(self%model%scene)) :: is_closed, none
        integer :: i

        if (present(is_changed)) is_changed = .false.
        if (n_clutch(self%model%scene) == 0) return
        do i = 1, size(is_closed, 2)
            is_closed(:, i) = is_on(self%model%scene%clutch(i)%switch_spec, t + 4*spacing(t), self%clutch%switched(:, i), &
                                    self%clutch%was_closed(:, i))
        end do
        if (all(is_closed .eqv. self%clutch%is_closed)) return
        none = .false.
        call engage(self, spread(t, 1, lanes), y, is_closed, none)
        if (present(is_changed)) is_changed = .true.
    end subroutine switch_now

    !> Clutches close, open, come to rest or break loose. Those without capacity close by an impulse; then it is decided who holds.
    subroutine engage(self, t, y, is_closed, has_crossed)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t(lanes)
        real(wp), intent(inout) :: y(:, :)
        logical, intent(in) :: is_closed(:, :)         !! from here (lane, n_clutch)
        logical, intent(in) :: has_crossed(:, :)       !! came to rest, or breaks loose (lane, n_clutch)
        real(wp), parameter :: still = 1.0e-12_wp      !! of the fastest slip so far, and of what an impulse has changed
        real(wp), parameter :: rounded = 1.0e-14_wp    !! of the rates whose difference the slip is
        real(wp), dimension(lanes, size(is_closed, 2)) :: slip, impulse
        real(wp) :: y_before(lanes, self%n), loss(lanes), least(lanes)
        logical, dimension(lanes, size(is_closed, 2)) :: held, was_closed, must_slip, locks, is_free
        logical :: is_concerned(lanes)
        integer :: i, lane

        y_before = y
        associate (of => self%clutch, positive => self%model%scene%clutch%is_positive)
            held = of%holds
            was_closed = of%is_closed
            must_slip = has_crossed .and. of%holds .and. is_closed
            is_concerned = any((is_closed .neqv. was_closed) .or. has_crossed, dim=2)
            call look_closely(self, t, y)
            slip = slips(self, level_velocity)
            do i = 1, size(slip, 2)
                where (was_closed(:, i)) of%fastest(:, i) = max(of%fastest(:, i), self%guard_scale(:, event_of(i)), abs(slip(:, i)))
                where (held(:, i)) of%fastest(:, i) = max(of%fastest(:, i), abs(slip(:, i)))
            end do
            of%is_closed = is_closed
            of%holds = of%holds .and. is_closed
            where (.not. is_closed) of%sense = 0
            do i = 1, size(slip, 2)
                locks(:, i) = is_closed(:, i) .and. .not. was_closed(:, i) .and. positive(i)
            end do
            impulse = 0
            loss = 0
            if (any(locks)) call lock(self, t, y, spread(positive, 1, lanes) .and. is_closed .and. spread(any(locks, dim=2), 2, &
                                                                                              size(slip, 2)), impulse, loss)
            call look_closely(self, t, y)
            slip = slips(self, level_velocity)
            do i = 1, size(slip, 2)
                where (locks(:, i)) of%fastest(:, i) = max(of%fastest(:, i), abs(slip(:, i)))
            end do
            do i = 1, size(slip, 2)
                least = max(still*max(of%fastest(:, i), merge(maxval(of%fastest, dim=2), 0.0_wp, any(locks, dim=2))), &
                            rounded*speed_of_sides(self, i))
                ! What an impulse has passed by is held as before, and what others do concerns none that has a slip.
                is_free(:, i) = is_closed(:, i) .and. (has_crossed(:, i) .or. positive(i) .or. abs(slip(:, i)) <= least &
                                                       .or. (held(:, i) .and. .not. any(locks, dim=2)))
                where (is_concerned .and. is_closed(:, i) .and. .not. is_free(:, i))
                    of%holds(:, i) = .false.
                    of%sense(:, i) = sign(1.0_wp, slip(:, i))
                end where
            end do
            call decide(self, t, y, is_concerned, is_free, must_slip, spread(positive, 1, lanes))
            do lane = 1, lanes
                if (.not. is_concerned(lane)) cycle
                of%longest(lane) = 0
                do i = 1, size(slip, 2)
                    call set_guard(self, lane, i)
                end do
            end do
            do lane = 1, lanes
                if (.not. is_concerned(lane) .or. (of%begins .and. .not. any(abs(impulse(lane, :)) > 0))) cycle
                do i = 1, size(slip, 2)
                    if (was_closed(lane, i) .and. .not. is_closed(lane, i)) then
                        call note(kind_open)
                    else if (of%holds(lane, i) .and. .not. held(lane, i)) then
                        call note(merge(kind_close, kind_stick, locks(lane, i)))
                    else if (held(lane, i) .and. .not. of%holds(lane, i)) then
                        call note(kind_slip)
                    else if (is_closed(lane, i) .and. .not. was_closed(lane, i)) then
                        call note(kind_close)
                    end if
                end do
            end do
        end associate

    contains

        pure integer function event_of(i)
            integer, intent(in) :: i

            event_of = self%model%scene%clutch(i)%event
        end function event_of

        subroutine note(kind)
            integer, intent(in) :: kind
            type(event_entry) :: entry

            entry%kind = kind
            entry%direction = nint(self%clutch%sense(lane, i))
            entry%impulse = abs(impulse(lane, i))
            if (findloc(locks(lane, :), .true., dim=1) == i) entry%loss = loss(lane)
            call note_entry(self, t, y_before, lane, event_of(i), entry, y)
        end subroutine note
    end subroutine engage

    !> Clutches without capacity take away all slip between their sides, those that hold already among them.
    subroutine lock(self, t, y, locks, impulse, loss)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t(lanes)
        real(wp), intent(inout) :: y(:, :)
        logical, intent(in) :: locks(:, :)             !! (lane, n_clutch)
        real(wp), intent(out) :: impulse(:, :)         !! [N s, N m s] (lane, n_clutch)
        real(wp), intent(out) :: loss(lanes)           !! of energy [J]
        real(wp), parameter :: small = 1.0e-9_wp       !! of the largest slip that there was: none is left
        real(wp), dimension(lanes, size(locks, 2)) :: before, after
        real(wp), dimension(lanes, n_held(self)) :: push, wanted
        real(wp) :: response(lanes, n_held(self), n_held(self)), rate(lanes, self%n)
        real(wp) :: of_coordinates(lanes, self%model%n_q, n_held(self))
        logical :: takes_part(lanes, n_held(self)), failed(lanes)
        integer :: i

        takes_part = .false.
        takes_part(:, size(self%rests, 2) + 1:) = locks
        call self%evaluate_on_lanes(t, y, rate, failed)
        call look_closely(self, t, y)
        before = slips(self, level_velocity)
        call find_responses(self, t, y, takes_part, response, of_coordinates)
        wanted = 0
        wanted(:, size(self%rests, 2) + 1:) = -before
        call solve_contacts(response, takes_part, wanted, push)
        call push_coordinates(self, takes_part, push, of_coordinates, y)
        impulse = push(:, size(self%rests, 2) + 1:)
        call look_closely(self, t, y)
        after = slips(self, level_velocity)
        loss = -sum(impulse*(before + after), dim=2)/2
        y(:, self%layout%supplied) = y(:, self%layout%supplied) - loss
        do i = 1, size(locks, 2)
            where (locks(:, i) .and. abs(after(:, i)) > small*maxval(abs(before), dim=2, mask=locks))
                self%is_driven_through = .true.
                self%final_event = self%model%scene%clutch(i)%event
            end where
        end do
    end subroutine lock

    !> Rates of coordinates behind pushes or impulses.
    subroutine push_coordinates(self, takes_part, impulse, of_coordinates, y)
        class(forward_system), intent(in) :: self
        logical, intent(in) :: takes_part(:, :)        !! (lane, by)
        real(wp), intent(in) :: impulse(:, :)          !! (lane, by)
        real(wp), intent(in) :: of_coordinates(:, :, :)     !! (lane, n_q, by)
        real(wp), intent(inout) :: y(:, :)
        integer :: i, k

        do i = 1, size(impulse, 2)
            do k = 1, self%model%n_q
                if (self%layout%rate(k) == 0) cycle
                where (takes_part(:, i)) &
                    y(:, self%layout%rate(k)) = y(:, self%layout%rate(k)) + impulse(:, i)*of_coordinates(:, k, i)
            end do
        end do
    end subroutine push_coordinates

    !> Which of the clutches without slip hold from here; what rounding has left of the slip of those goes.
    subroutine decide(self, t, y, is_concerned, is_free, must_slip, positive)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t(lanes)
        real(wp), intent(inout) :: y(:, :)
        logical, intent(in) :: is_concerned(lanes)
        logical, intent(in) :: is_free(:, :)           !! without slip (lane, n_clutch)
        logical, intent(in) :: must_slip(:, :)         !! break loose (lane, n_clutch)
        logical, intent(in) :: positive(:, :)          !! whatever comes is held (lane, n_clutch)
        real(wp), dimension(lanes, n_held(self)) :: none, away, change, most, capacity, sense, here
        real(wp) :: response(lanes, n_held(self), n_held(self)), rate(lanes, self%n)
        real(wp) :: of_coordinates(lanes, self%model%n_q, n_held(self)), grip(lanes, n_clutch(self%model%scene))
        logical, dimension(lanes, n_held(self)) :: takes_part, holds
        real(wp), parameter :: rigid = 1.0e-10_wp      !! of the largest response so far: where a joint turns back while others move on,
                                                       !! nothing at it stops them
        logical :: failed(lanes), may_hold(lanes, n_clutch(self%model%scene))
        integer, allocatable :: of(:)
        integer :: lane, i, n

        n = size(self%rests, 2)
        takes_part(:, :n) = self%rests
        takes_part(:, n + 1:) = is_free
        holds = takes_part
        holds(:, n + 1:) = is_free .and. .not. must_slip
        sense = 0
        where (must_slip) sense(:, n + 1:) = -sign(1.0_wp, self%clutch%force)
        do lane = 1, lanes
            if (.not. is_concerned(lane)) cycle
            where (is_free(lane, :)) self%clutch%holds(lane, :) = .false.
            where (is_free(lane, :)) self%clutch%sense(lane, :) = 0
        end do
        if (any(is_free .and. spread(is_concerned, 2, size(is_free, 2)))) then
            call self%evaluate_on_lanes(t, y, rate, failed)
            call find_responses(self, t, y, takes_part, response, of_coordinates)
            may_hold = is_free
            do i = 1, size(is_free, 2)
                associate (ease => response(:, n + i, n + i))
                    where (is_free(:, i)) self%clutch%ease(:, i) = max(self%clutch%ease(:, i), ease)
                    may_hold(:, i) = is_free(:, i) .and. ease > rigid*self%clutch%ease(:, i)
                end associate
            end do
            grip = find_grip()
            call self%evaluate_on_lanes(t, y, rate, failed)
            none = 0
            call accelerate(self, t, y, none, away)
            where (is_free .and. .not. (may_hold .or. positive))
                holds(:, n + 1:) = .false.
                sense(:, n + 1:) = sign(1.0_wp, away(:, n + 1:))
            end where
            do i = 1, size(is_free, 2)
                if (self%model%scene%clutch(i)%friction > 0) self%clutch%capacity(:, i) = grip(:, i)
            end do
            most = huge(1.0_wp)
            capacity = 0
            capacity(:, n + 1:) = merge(0.0_wp, self%clutch%capacity, positive)
            do i = 1, size(is_free, 2)
                where (.not. positive(:, i)) most(:, n + i) = self%model%scene%clutch(i)%static*self%clutch%capacity(:, i)
            end do
            do lane = 1, lanes
                if (.not. is_concerned(lane)) cycle
                of = pack([(i, i=1, size(holds, 2))], takes_part(lane, :))
                if (size(of) == 0) cycle
                call share(lane)
            end do
            call look_closely(self, t, y)
            call solve_contacts(response, takes_part .and. holds .and. spread(is_concerned, 2, n_held(self)), &
                                -rates_held(self, level_velocity), change)
            call push_coordinates(self, takes_part, change, of_coordinates, y)
            call still_rates(self, y)
        end if
        call look_closely(self, t, y)
        call find_kept(self%model, self%look, angles_about(self, t), here(:, n + 1:))
        do i = 1, size(is_free, 2)
            where (is_concerned .and. self%clutch%holds(:, i) .and. .not. self%clutch%was_held(:, i)) &
                self%clutch%kept(:, i) = here(:, n + i)
            where (is_concerned) self%clutch%was_held(:, i) = self%clutch%holds(:, i)
        end do

    contains

        !> What joints that may stick could hold: by the reactions while all that could hold do.
        function find_grip() result(grip)
            real(wp) :: grip(lanes, size(is_free, 2))
            logical :: held(lanes, size(is_free, 2))

            grip = 0
            if (.not. has_sticking(self)) return
            held = self%clutch%holds
            self%clutch%holds = held .or. may_hold
            call self%evaluate_on_lanes(t, y, rate, failed)
            grip = self%clutch%capacity
            self%clutch%holds = held
        end function find_grip

        subroutine share(lane)
            integer, intent(in) :: lane
            logical :: part_holds(size(of))
            real(wp) :: part_sense(size(of))

            part_holds = holds(lane, of)
            part_sense = sense(lane, of)
            call share_load(response(lane, of, of), away(lane, of), most(lane, of), capacity(lane, of), of > n, &
                            part_holds, part_sense)
            holds(lane, of) = part_holds
            where (is_free(lane, :)) self%clutch%holds(lane, :) = holds(lane, n + 1:)
            sense(lane, of) = part_sense
            where (is_free(lane, :)) self%clutch%sense(lane, :) = sense(lane, n + 1:)
        end subroutine share
    end subroutine decide

    !> What is looked out for of a clutch from here.
    subroutine set_guard(self, lane, i)
        class(forward_system), intent(inout) :: self
        integer, intent(in) :: lane, i                 !! clutch

        associate (e => self%model%scene%clutch(i)%event, of => self%clutch)
            self%guard_side(lane, e) = 1
            self%guard_scale(lane, e) = 0
            if (.not. of%is_closed(lane, i) .or. of%holds(lane, i)) return
            self%guard_side(lane, e) = of%sense(lane, i)
            self%guard_scale(lane, e) = of%fastest(lane, i)
        end associate
    end subroutine set_guard

    ! ---------------------------------------------------------------- what happens

    !> Events have come: they are noted, end the run, or stops throw back, catch and let go.
    subroutine meet_events(self, t, y, has_crossed, has_changed, is_over)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t(lanes)
        real(wp), intent(inout) :: y(:, :)
        logical, intent(in) :: has_crossed(:, :)
        logical, intent(out) :: has_changed(lanes), is_over(lanes)
        real(wp), parameter :: rounded = 1.0e-12_wp    !! of the fastest impact: that is no speed
        logical, dimension(lanes, size(self%rests, 2)) :: strikes, rested
        logical, dimension(lanes, n_clutch(self%model%scene)) :: is_closed, has_slipped
        real(wp) :: away(lanes, size(self%rests, 2))
        integer :: lane, i

        is_closed = self%clutch%is_closed
        has_slipped = .false.
        rested = self%rests
        has_changed = .false.
        is_over = .false.
        strikes = .false.
        call look_closely(self, t, y)
        do i = 1, self%n_guard
            associate (event => self%model%scene%event(i))
                do lane = 1, lanes
                    if (.not. has_crossed(lane, i)) cycle
                    if (event%clutch > 0) then
                        has_slipped(lane, event%clutch) = .true.
                        cycle
                    else if (event%stop == 0) then
                        is_over(lane) = is_over(lane) .or. (event%ends_run .and. self%may_end)
                        if (event%ends_run .and. self%may_end) self%final_event(lane) = i
                        call note(merge(kind_end, kind_crossing, event%ends_run))
                        call switch_brakes(self, lane, i, t(lane), has_changed(lane))
                        call switch_clutches(self, lane, i, t(lane), is_closed)
                    else if (.not. self%model%scene%stop(event%stop)%is_hard) then
                        call note(merge(kind_contact, kind_release, self%guard_side(lane, i) > 0))
                        has_changed(lane) = .true.
                    else if (self%rests(lane, event%stop)) then
                        call note(kind_release)
                        call leave_stop(self, lane, event%stop)
                        has_changed(lane) = .true.
                        cycle
                    else
                        strikes(lane, event%stop) = .true.
                        cycle
                    end if
                    self%guard_side(lane, i) = -self%guard_side(lane, i)
                end do
            end associate
        end do
        has_slipped = has_slipped .and. is_closed
        if (any(has_slipped) .or. any(is_closed .neqv. self%clutch%is_closed)) then
            has_changed = has_changed .or. any(has_slipped .or. (is_closed .neqv. self%clutch%is_closed), dim=2)
            call engage(self, t, y, is_closed, has_slipped)
            is_over = is_over .or. self%is_driven_through
        end if
        if (any(strikes)) then
            ! What is on its way out was thrown back a moment ago: rounding has its gap still closed.
            away = away_from_stops(self, level_velocity)
            do i = 1, size(strikes, 2)
                strikes(:, i) = strikes(:, i) .and. .not. away(:, i) > rounded*self%fastest(:, i)
            end do
        end if
        if (any(strikes)) then
            call self%meet_stops(t, y, strikes)
            has_changed = has_changed .or. any(strikes, dim=2)
            is_over = is_over .or. self%is_driven_through
        end if
        if (any(has_changed)) call begin_gaps(self, t, y, has_changed, rested)

    contains

        subroutine note(kind)
            integer, intent(in) :: kind
            type(event_entry) :: entry

            entry%kind = kind
            entry%direction = nint(-self%guard_side(lane, i))
            call note_entry(self, t, y, lane, i, entry)
        end subroutine note
    end subroutine meet_events

    !> A joint variable comes to rest at a stop: the stop's push is looked out for from here.
    subroutine rest_at_stop(self, lane, stop)
        class(forward_system), intent(inout) :: self
        integer, intent(in) :: lane, stop

        associate (e => self%model%scene%stop(stop)%event)
            self%rests(lane, stop) = .true.
            self%widest(lane, stop) = self%guard_scale(lane, e)
            self%guard_scale(lane, e) = 0
            self%guard_side(lane, e) = 1
        end associate
    end subroutine rest_at_stop

    !> A joint variable rests at a stop no more, if it did: its gap is looked out for.
    subroutine leave_stop(self, lane, stop)
        class(forward_system), intent(inout) :: self
        integer, intent(in) :: lane, stop

        associate (e => self%model%scene%stop(stop)%event)
            if (self%rests(lane, stop)) self%guard_scale(lane, e) = self%widest(lane, stop)
            self%rests(lane, stop) = .false.
            self%push(lane, stop) = 0
            self%guard_side(lane, e) = 1
        end associate
    end subroutine leave_stop

    !> Gaps of hard stops, of states whose motion is in `look`.
    subroutine measure_gaps(self, t, gap)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t(lanes)
        real(wp), intent(out) :: gap(:, :)             !! (lane, n_stop); of other stops: none is closed
        real(wp) :: guard(lanes, self%n_guard)
        integer :: i

        call find_events(self%model, self%look, angles_about(self, t), guard)
        gap = huge(1.0_wp)
        do i = 1, size(gap, 2)
            associate (stop => self%model%scene%stop(i))
                if (stop%is_hard) gap(:, i) = guard(:, stop%event)
            end associate
        end do
    end subroutine measure_gaps

    !> Contacts that are closed and do not rest begin their gaps where they are: a variable that has drifted a little beyond its stop
    !> while it rested there, or that rounding leaves there, is not to come out first. One that is further beyond was lost.
    subroutine begin_gaps(self, t, y, is_wanted, rested)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t(lanes)
        real(wp), intent(in) :: y(:, :)
        logical, intent(in) :: is_wanted(lanes)
        logical, intent(in) :: rested(:, :)            !! until now (lane, n_stop)
        real(wp), parameter :: small = 1.0e-7_wp       !! of the bound, 1e-10 at least
        real(wp) :: gap(lanes, size(self%rests, 2)), deepest
        integer :: i

        call look_closely(self, t, y)
        call measure_gaps(self, t, gap)
        do i = 1, size(gap, 2)
            associate (stop => self%model%scene%stop(i), yielded => self%yielded(:, i))
                deepest = small*max(1.0e-3_wp, abs(stop%bound))
                where (is_wanted .and. gap(:, i) > 0)
                    yielded = 0
                elsewhere (is_wanted .and. (rested(:, i) .or. (gap(:, i) + yielded < 0 .and. gap(:, i) + yielded > -deepest)))
                    yielded = max(0.0_wp, -gap(:, i))
                end where
            end associate
        end do
    end subroutine begin_gaps

    !> Joint variables strike stops. All whose gaps are closed there take part, those that rest as well (`linkdyn_impacts`). What
    !> has no speed left then rests, if it is pressed against its stop.
    subroutine meet_stops(self, t, y, strikes)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t(lanes)
        real(wp), intent(inout) :: y(:, :)
        logical, intent(in) :: strikes(:, :)           !! (lane, n_stop)
        real(wp), parameter :: near = 1.0e-12_wp       !! of the widest gap so far: that is closed
        real(wp), dimension(lanes, size(self%rests, 2)) :: gap, before, impulse, after, change
        real(wp) :: response(lanes, size(self%rests, 2), size(self%rests, 2))
        real(wp) :: of_coordinates(lanes, self%model%n_q, size(self%rests, 2))
        real(wp) :: rate(lanes, self%n), y_before(lanes, self%n), loss(lanes)
        logical, dimension(lanes, size(self%rests, 2)) :: touches, has_struck, is_closed, rested, rests
        logical :: failed(lanes), is_struck(lanes)
        integer :: i, lane

        is_struck = any(strikes, dim=2)
        rested = self%rests
        call self%evaluate_on_lanes(t, y, rate, failed)
        call look_closely(self, t, y)
        before = away_from_stops(self, level_velocity)
        call measure_gaps(self, t, gap)
        do i = 1, size(gap, 2)
            associate (stop => self%model%scene%stop(i))
                touches(:, i) = is_struck .and. stop%is_hard .and. (strikes(:, i) .or. rested(:, i) &
                                .or. gap(:, i) + self%yielded(:, i) <= near*self%guard_scale(:, stop%event))
            end associate
        end do
        call find_stop_responses(self, t, y, touches, response, of_coordinates)
        after = before
        impulse = 0
        loss = 0
        has_struck = .false.
        is_closed = .false.
        do lane = 1, lanes
            if (.not. is_struck(lane)) cycle
            call find_impacts(response(lane, :, :), self%model%scene%stop%restitution, touches(lane, :), strikes(lane, :), &
                              self%fastest(lane, :), self%hardest(lane), after(lane, :), impulse(lane, :), &
                              has_struck(lane, :), is_closed(lane, :), loss(lane))
        end do
        y_before = y
        call push_coordinates(self, touches, impulse, of_coordinates, y)
        y(:, self%layout%supplied) = y(:, self%layout%supplied) - loss
        call loosen_clutches(self, t, y, y_before, is_struck)
        if (holds_anywhere(self)) call still_rates(self, y)
        call look_closely(self, t, y)
        after = away_from_stops(self, level_velocity)
        do i = 1, size(before, 2)
            where (strikes(:, i) .and. after(:, i) < before(:, i)/2 .and. before(:, i) < 0)
                self%is_driven_through = .true.
                self%final_event = self%model%scene%stop(i)%event
            end where
        end do
        call find_resting(self, t, y, is_struck, touches, after, response, is_closed, rests)
        do lane = 1, lanes
            is_closed(lane, :) = rests(lane, :) .and. is_struck(lane)
        end do
        call solve_contacts(response, is_closed, -after, change)
        call push_coordinates(self, touches, change, of_coordinates, y)
        impulse = impulse + change
        if (holds_anywhere(self)) call still_rates(self, y)
        y(:, self%layout%supplied) = y(:, self%layout%supplied) + sum(change*after, dim=2)/2
        loss = loss - sum(change*after, dim=2)/2
        do i = 1, size(before, 2)
            do lane = 1, lanes
                if (.not. is_struck(lane)) cycle
                if (rests(lane, i) .and. .not. rested(lane, i)) call rest_at_stop(self, lane, i)
                if (.not. rests(lane, i) .and. (rested(lane, i) .or. touches(lane, i))) call leave_stop(self, lane, i)
            end do
        end do
        do i = 1, size(before, 2)
            do lane = 1, lanes
                if (.not. is_struck(lane)) cycle
                if (has_struck(lane, i) .or. (rests(lane, i) .and. .not. rested(lane, i))) &
                    call note(merge(kind_rest, kind_impact, rests(lane, i)))
                if (rested(lane, i) .and. .not. (rests(lane, i) .or. has_struck(lane, i))) call note(kind_release)
            end do
        end do
        call begin_gaps(self, t, y, is_struck, rested)

    contains

        subroutine note(kind)
            integer, intent(in) :: kind
            type(event_entry) :: entry

            entry%kind = kind
            entry%direction = -1
            entry%impulse = impulse(lane, i)
            if (kind == kind_release) entry%impulse = 0
            if (findloc(has_struck(lane, :), .true., dim=1) == i) entry%loss = loss(lane)
            call note_entry(self, t, y_before, lane, self%model%scene%stop(i)%event, entry, y)
        end subroutine note
    end subroutine meet_stops

    !> What a unit push of each stop in contact gives at stops and coordinates while clutches without capacity hold what they hold.
    subroutine find_stop_responses(self, t, y, touches, response, of_coordinates)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t(lanes)
        real(wp), intent(in) :: y(:, :)
        logical, intent(in) :: touches(:, :)           !! (lane, n_stop)
        real(wp), intent(out) :: response(:, :, :)     !! (lane, of stop, by stop)
        real(wp), intent(out) :: of_coordinates(:, :, :)    !! (lane, n_q, by stop)
        real(wp) :: of_all(lanes, n_held(self), n_held(self)), coordinates_by_all(lanes, self%model%n_q, n_held(self))
        logical :: takes_part(lanes, n_held(self))
        real(wp), allocatable :: force(:)
        integer, allocatable :: held(:)
        integer :: lane, i, n

        n = size(touches, 2)
        takes_part(:, :n) = touches
        takes_part(:, n + 1:) = self%clutch%holds .and. spread(self%model%scene%clutch%is_positive, 1, lanes) &
                                .and. spread(any(touches, dim=2), 2, n_clutch(self%model%scene))
        call find_responses(self, t, y, takes_part, of_all, coordinates_by_all)
        do lane = 1, lanes
            held = pack([(i, i=n + 1, n_held(self))], takes_part(lane, n + 1:))
            do i = 1, n
                force = solve_held(of_all(lane, held, held), of_all(lane, held, i))
                response(lane, :, i) = of_all(lane, :n, i) - matmul(of_all(lane, :n, held), force)
                of_coordinates(lane, :, i) = coordinates_by_all(lane, :, i) - matmul(coordinates_by_all(lane, :, held), force)
            end do
        end do
    end subroutine find_stop_responses

    !> An impact is more than any capacity: clutches with one slip from there, if it has moved their sides apart.
    subroutine loosen_clutches(self, t, y, y_before, is_struck)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t(lanes)
        real(wp), intent(in) :: y(:, :), y_before(:, :)
        logical, intent(in) :: is_struck(lanes)
        real(wp), parameter :: still = 1.0e-12_wp      !! of the hardest impact
        real(wp), dimension(lanes, n_clutch(self%model%scene)) :: before, after
        type(event_entry) :: entry
        integer :: lane, i

        if (.not. holds_anywhere(self)) return
        call look_closely(self, t, y_before)
        before = slips(self, level_velocity)
        call look_closely(self, t, y)
        after = slips(self, level_velocity)
        associate (of => self%clutch)
            do i = 1, size(after, 2)
                if (self%model%scene%clutch(i)%is_positive) cycle
                do lane = 1, lanes
                    if (.not. (is_struck(lane) .and. of%holds(lane, i))) cycle
                    if (abs(after(lane, i) - before(lane, i)) <= still*max(maxval(self%fastest(lane, :)), of%fastest(lane, i))) &
                        cycle
                    of%holds(lane, i) = .false.
                    of%was_held(lane, i) = .false.
                    of%sense(lane, i) = sign(1.0_wp, after(lane, i))
                    of%fastest(lane, i) = max(of%fastest(lane, i), abs(after(lane, i)))
                    call set_guard(self, lane, i)
                    entry = event_entry(kind=kind_slip, direction=nint(of%sense(lane, i)))
                    call note_entry(self, t, y_before, lane, self%model%scene%clutch(i)%event, entry, y)
                end do
            end do
        end associate
    end subroutine loosen_clutches

    !> Which of the contacts that have no speed rest: those that push, of accelerations apart and pushes, none negative. One that leaves
    !> so slowly that it would come back before rounding let its gap be seen has no speed either.
    subroutine find_resting(self, t, y, is_struck, touches, speed, response, is_closed, rests)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t(lanes)
        real(wp), intent(in) :: y(:, :)
        logical, intent(in) :: is_struck(lanes)
        logical, intent(in) :: touches(:, :)           !! (lane, n_stop)
        real(wp), intent(in) :: speed(:, :)            !! apart (lane, n_stop)
        real(wp), intent(in) :: response(:, :, :)      !! (lane, of, by)
        logical, intent(inout) :: is_closed(:, :)      !! it has no speed (lane, n_stop)
        logical, intent(out) :: rests(:, :)            !! (lane, n_stop)
        real(wp), parameter :: low = 1.0e-13_wp        !! of the widest gap so far: a bounce of that height is none
        real(wp), dimension(lanes, size(self%rests, 2)) :: away, widest
        real(wp) :: rate(lanes, self%n), left(size(self%rests, 2))
        real(wp), allocatable :: push(:)
        logical :: failed(lanes), rested(lanes, size(self%rests, 2)), is_low(size(self%rests, 2))
        integer, allocatable :: contact(:)
        integer :: lane, i, turn

        rested = self%rests
        rests = rested
        do lane = 1, lanes
            if (is_struck(lane)) self%rests(lane, :) = .false.
        end do
        call self%evaluate_on_lanes(t, y, rate, failed)
        call look_closely(self, t, y, self%workspace%acceleration)
        away = away_from_stops(self, level_given)
        self%rests = rested
        do i = 1, size(widest, 2)
            widest(:, i) = merge(self%widest(:, i), self%guard_scale(:, self%model%scene%stop(i)%event), rested(:, i))
        end do
        do lane = 1, lanes
            if (.not. is_struck(lane)) cycle
            do turn = 1, size(rests, 2) + 1
                contact = pack([(i, i=1, size(rests, 2))], is_closed(lane, :))
                if (allocated(push)) deallocate (push)
                allocate (push(size(contact)))
                call solve_complementary(response(lane, contact, contact), away(lane, contact), push)
                left = away(lane, :) + matmul(response(lane, :, contact), push)
                is_low = touches(lane, :) .and. .not. is_closed(lane, :) .and. left < 0 .and. speed(lane, :) >= 0 &
                         .and. speed(lane, :)**2 <= 2*low*widest(lane, :)*abs(left)
                if (.not. any(is_low)) exit
                is_closed(lane, :) = is_closed(lane, :) .or. is_low
            end do
            rests(lane, :) = .false.
            rests(lane, contact) = push > 0 .or. left(contact) <= 0
        end do
    end subroutine find_resting

    !> An entry of the log, in the user's coordinates. Lanes that nobody asks for have none.
    subroutine note_entry(self, t, y, lane, event, entry, y_after)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t(lanes)
        real(wp), intent(in) :: y(:, :)
        integer, intent(in) :: lane, event
        type(event_entry), intent(inout) :: entry
        real(wp), intent(in), optional :: y_after(:, :)    !! behind an impact; absent: as before
        real(wp), allocatable :: ignored(:)

        if (lane > self%n_told) return
        entry%lane = lane
        entry%t = t(lane)
        entry%event = event
        call coordinates_of(y, entry%q, entry%qd)
        entry%qd_after = entry%qd
        if (present(y_after)) call coordinates_of(y_after, ignored, entry%qd_after)
        call add_entry(self%log, entry)

    contains

        subroutine coordinates_of(state, q, qd)
            real(wp), intent(in) :: state(:, :)
            real(wp), allocatable, intent(out) :: q(:), qd(:)
            real(wp), dimension(lanes, self%model%n_q) :: lane_q, lane_qd, lane_qdd
            integer :: k

            call look_closely(self, t, state)
            call read_coordinates(self%model, self%layout, t, state, self%turns, self%look, lane_q, lane_qd, lane_qdd)
            q = lane_q(lane, :)
            qd = lane_qd(lane, :)
            if (.not. associated(self%own)) return
            do k = 1, size(q)
                if (self%model%scene%coordinate(k)%for_joint > 0) &
                    call coordinate_now(self%own, self%model, self%look, k, q(k), qd(k))
            end do
        end subroutine coordinates_of
    end subroutine note_entry

    subroutine release(self)
        class(forward_system), intent(inout) :: self

        if (associated(self%workspace%slot%value)) call self%workspace%free()
        call free_motion_forces(self%of_motion)
        call free_holding_forces(self%holding)
        call free_forward_record(self%record)
    end subroutine release
end module linkdyn_forward_system
