!> Forward dynamics as a system of differential equations: the place where dynamics meets integrators.
!>
!> This file tells the story of a run: how rates come about at a state (`evaluate_forward`, `evaluate_on_lanes`), and what an
!> accepted step brings with it (`accept_forward`). Each part of it keeps its own state in a type with a module of its own, which
!> knows nothing of the system; what needs the whole system is in submodules: pushes of stops and clutches
!> (`linkdyn_forward_contacts`), what happens at an instant (`linkdyn_forward_events`, `linkdyn_forward_stops`,
!> `linkdyn_forward_clutches`), controllers (`linkdyn_forward_control`), how cylinders start (`linkdyn_forward_cylinders`), dead
!> points of coordinates (`linkdyn_forward_watch`).
!>
!> Rates come from a record of the scene, where it has one (`linkdyn_forward_by_record`); a state that the record does not serve,
!> near a dead point or where the assembly may change, is computed on lanes, and so is whatever is looked at beside the rates.
!>
!> gfortran 12 keeps procedures of this file that are not public to itself: what submodules call is bound to the type, or has its
!> body in one of them.
module linkdyn_forward_system
    use linkdyn_bounce_watch, only: prepare_bounce_watch, measure_rates, note_start
    use linkdyn_carried_assembly, only: carried_assembly, begin_assembly, leave_standing, leave_turns_of, evaluate_assembled, &
        accept_assembly, longest_way
    use linkdyn_clutch_friction, only: rub_clutches, has_sticking, measure_grip
    use linkdyn_clutch_states, only: prepare_clutches, holds_anywhere, only_slides
    use linkdyn_controlled_drives, only: controlled_drives, plan_control, wants_motion, pack_control_rates, free_control
    use linkdyn_controllers, only: controllers_type, begin_controllers
    use linkdyn_coordinate_watch, only: coordinate_watch, coordinate_ratios, forget_rates
    use linkdyn_cylinder_states, only: cylinder_states, prepare_cylinders, drive_by_cylinders, pack_pressure_rates
    use linkdyn_equation_programs, only: out_powers
    use linkdyn_equation_kernels, only: kernel_family
    use linkdyn_energy_balance, only: energy_of_motion
    use linkdyn_energy_check, only: weigh_energy, is_by_record, leave_turns_out, weigh_again, judge_steps, &
        list_neighbours, find_surplus, compare_surplus
    use linkdyn_equations, only: equations_type, equation_workspace, unknown_choice, build_equations, share_equations, &
        renew_equations, free_equations, prepare_workspace, want_of, solve_equations, found_of
    use linkdyn_evaluated_drives, only: evaluated_drives, evaluate_drives, leave_drives, free_drives
    use linkdyn_event_log, only: event_entry
    use linkdyn_followed_angles, only: followed_angles, followed_from, prepare_measured_angles, prepare_joint_angles, &
        wraps_anywhere, follow_angles, looks_for_angles, follow_within, note_nearest, angles_at
    use linkdyn_step_ends, only: forward_look, free_looks
    use linkdyn_forward_record, only: forward_record, evaluations_on_lanes, free_forward_record
    use linkdyn_forward_state, only: state_layout, plan_layout, angles_of_state, families_of_state, unpack_state, pack_rates, &
        counted_rates
    use linkdyn_forward_unknowns, only: choose_unknowns, fastest_solver
    use linkdyn_forward_way, only: forward_way
    use linkdyn_held_variables, only: held_accelerations
    use linkdyn_impulse_path, only: impulse_path
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state, prepare_kinematics
    use linkdyn_lane_count, only: lanes
    use linkdyn_lane_system, only: lane_system, lane_way, whole_steps
    use linkdyn_narrow_cams, only: cam_sight, plan_cam_sight
    use linkdyn_led_mechanism, only: follows_assembly
    use linkdyn_narrow_laws, only: plan_law_sight, has_to_look
    use linkdyn_measures, only: find_laws
    use linkdyn_model, only: model_type, scene_size, reach_of
    use linkdyn_motion, only: lane_loads
    use linkdyn_motion_forces, only: motion_forces, plan_motion_forces, begin_motion_forces, go_on_from, accept_motion, &
        forget_forces, find_motion_forces, leave_motion_record, free_motion_forces
    use linkdyn_motor_states, only: prepare_motors, motors_have_laws, drive_by_motors, pack_current_rates
    use linkdyn_scene, only: effort_inverse, effort_over, n_event, n_stop, n_clutch, n_controller
    use linkdyn_shared_programs, only: shared_programs, leave_programs, kernels_of
    use linkdyn_stage_places, only: forget_stages
    use linkdyn_steps_at_once, only: steps_at_once
    use linkdyn_status, only: status_type, sample_branch_lost, sample_ok, sample_undefined
    use linkdyn_stop_states, only: prepare_stops, rests_anywhere
    use linkdyn_time_laws, only: laws_over_time
    implicit none (type, external)
    private
    public :: forward_system, forward_memory, standing_lanes, event_witness, build_forward_system


    !> Where states that are evaluated later set out from, a state a lane.
    type :: standing_lanes
        type(carried_assembly) :: assembly
        real(wp), allocatable :: turns(:, :)           !! of angles that are not in y (lane, n)
        type(followed_from) :: of_joints               !! their angles, if somebody has asked for them
    end type standing_lanes

    !> Who looks at a run just before and just behind the instants at which something happens.
    type, abstract :: event_witness
    contains
        procedure(see_side), deferred :: see
    end type event_witness

    abstract interface
        !> The system stands on one side of such an instant.
        subroutine see_side(self, t, y, is_behind)
            import :: event_witness, wp
            class(event_witness), intent(inout) :: self
            real(wp), intent(in) :: t                  !! [s]
            real(wp), intent(in) :: y(:, :)            !! (lane, n)
            logical, intent(in) :: is_behind
        end subroutine see_side
    end interface

    type, extends(lane_system) :: forward_system
        type(model_type), pointer :: model => null()
        type(state_layout) :: layout
        type(equations_type) :: equations              !! of every stage: accelerations, and unknown driving forces
        type(equation_workspace) :: workspace
        type(forward_way) :: way                       !! what there is to remember of it
        logical :: wants_work = .true.
        type(kinematic_state), private :: look         !! scratch: of states that are looked at
        ! ---- forces of actuators
        logical, allocatable :: by_inverse(:)          !! drives `inverse` of free coordinates, whose force the scene's motion law
                                                       !! asks for (n_actuator)
        type(motion_forces) :: of_motion               !! these forces
        type(evaluated_drives), private :: drives      !! the others, but for those that are given
        type(controlled_drives) :: control
        type(cylinder_states) :: cylinders
        logical, private :: has_motor_laws = .false., has_cylinders = .false.  !! whoever asks the record looks after them
        logical, private :: may_be_torn = .false.      !! chambers may be what they cannot be: two roads are compared
        ! ---- what becomes of steps
        type(coordinate_watch) :: watch                !! on the coordinates; off unless the caller prepares it
        ! ---- events, end stops, clutches
        type(model_type), pointer :: own => null()     !! with the coordinates that events are told in; null: model
        logical :: may_end = .true.                    !! an event that ends runs ends this one
        integer :: n_told = 1                          !! lanes whose events are told
        class(event_witness), pointer :: witness => null()    !! of the first of them; null: nobody looks
        type(followed_angles), private :: of_joints    !! that are results; empty: nobody has asked
        type(held_accelerations) :: held               !! of what stops and clutches hold, at the state in the workspace
        ! ---- the record
        logical :: may_record = .false.                !! once that is worth while; the caller says so
        type(shared_programs), pointer :: shared => null()    !! held; null: nobody has given or needed any
        type(forward_record) :: record
        type(forward_look) :: looks           !! at the ends of steps
        type(steps_at_once), private :: steps !! whole ones, of ensembles
        integer :: n_by_record = 0                     !! evaluations by the record alone
        type(cam_sight), allocatable :: of_cams(:)     !! what the outlines of cams do within steps
        logical, private :: is_by_record = .false.     !! the state evaluated last was so by the record alone, whose first sample it
                                                       !! is; it is here:
        real(wp), private :: t_tried = 0               !! [s]
        real(wp), allocatable, private :: y_tried(:)   !! of lane 1 (n)
        logical, private :: is_behind = .false.        !! it is not in the workspace
        logical, private :: guards_agree = .false., guards_differ = .false.    !! as the record and lanes have them: neither, if
                                                                               !! nobody has
                                                       !! compared them
    contains
        procedure :: evaluate => evaluate_forward
        procedure :: evaluate_alone => evaluate_one
        procedure :: evaluate_on_lanes
        procedure :: make_record
        procedure :: make_steps_at_once
        procedure :: use_steps
        procedure :: take_whole_steps => take_steps_by_record
        procedure :: accept => accept_forward
        procedure :: begin_trial => begin_chain_of_stages
        procedure :: looks_wanted => looks_for_turns
        procedure :: see_within => follow_turns_within
        procedure :: note_turns => note_turns_forward
        procedure :: broken_law, has_broken_law
        procedure, private :: judge_energy
        procedure :: watch_ends
        procedure :: leads_too_far
        procedure :: part_in_sight
        procedure :: longest_step => longest_forward_step
        procedure :: stalled_coordinate
        procedure :: evaluate_guards => evaluate_events
        procedure :: survey => survey_events
        procedure :: meet_crossings => meet_events
        procedure :: show_side => show_side_of_event
        procedure :: meet_stops
        procedure :: meet_touched_stops
        procedure :: begin_with_clutches
        procedure :: switch_now
        procedure :: slips_at
        procedure :: touches
        procedure :: fill_cylinders
        procedure :: next_control
        procedure :: control_now
        procedure :: begin
        procedure :: take_over, note_energy
        procedure :: count_joint_turns
        procedure :: leave_standing_here
        procedure :: joint_angles
        procedure :: look_at
        procedure, private :: look_closely
        procedure, private :: has_record_now
        procedure, private :: find_given_forces
        procedure :: remember
        procedure :: recall
        procedure :: release
        procedure :: renew
    end type forward_system

    !> What a system remembers of its way, with that of its parts.
    type :: forward_memory
        private
        type(lane_way) :: lane_way
        type(forward_way) :: way
        type(carried_assembly) :: of_motion            !! of the forces that the scene's motion asks for
        type(controllers_type) :: controllers
        type(coordinate_ratios) :: ratios
    end type forward_memory

    ! How is said in the submodules. Instants t in s, states y (lane, n).
    interface
        ! ---- linkdyn_forward_by_record
        !> Use the mechanism's record from now on, if it has one and that finds what the lanes find.
        module subroutine make_record(self, t)
            class(forward_system), intent(inout) :: self
            real(wp), intent(in) :: t                      !! [s]
        end subroutine make_record

        module subroutine evaluate_by_record(self, n_lane, t, y, rate, is_left)
            class(forward_system), intent(inout) :: self
            integer, intent(in) :: n_lane                  !! of the arrays: those used at least
            real(wp), intent(in) :: t(n_lane), y(n_lane, self%n)
            real(wp), intent(inout) :: rate(n_lane, self%n)
            logical, intent(inout) :: is_left(n_lane)      !! that the record does not serve
        end subroutine evaluate_by_record

        ! ---- linkdyn_forward_steps
        !> Make whole steps, too, of the length and from the state given, where they serve; the record of the rates is there.
        module subroutine make_steps_at_once(self, t, length, y)
            class(forward_system), intent(inout) :: self
            real(wp), intent(in) :: t, length              !! [s]
            real(wp), intent(in), contiguous :: y(:, :)
        end subroutine make_steps_at_once

        !> Use those that somebody has made.
        module subroutine use_steps(self, t)
            class(forward_system), intent(inout) :: self
            real(wp), intent(in) :: t                      !! [s]
        end subroutine use_steps

        module subroutine take_steps_by_record(self, t, length, n_most, y, begin, rest, steps)
            class(forward_system), intent(inout) :: self
            real(wp), intent(in) :: t                      !! [s]
            real(wp), intent(in) :: length                 !! [s]
            integer, intent(in) :: n_most
            real(wp), intent(inout), contiguous :: y(:, :), begin(:, :), rest(:, :)
            type(whole_steps), intent(inout) :: steps
        end subroutine take_steps_by_record

        ! ---- linkdyn_forward_memory
        module subroutine remember(self, memory)
            class(forward_system), intent(in) :: self
            type(forward_memory), intent(out) :: memory
        end subroutine remember

        module subroutine recall(self, memory)
            class(forward_system), intent(inout) :: self
            type(forward_memory), intent(in) :: memory     !! of this system, or another one of the same model
        end subroutine recall

        ! ---- linkdyn_forward_step_ends
        module logical function sees_end(self)
            class(forward_system), intent(inout) :: self
        end function sees_end

        module subroutine see_surplus(self, t, state, surplus, scale, are_seen)
            class(forward_system), intent(inout) :: self
            real(wp), intent(in) :: t, state(:, :)         !! [s], (n, state)
            real(wp), intent(out) :: surplus(:)            !! [J] (state)
            real(wp), intent(out) :: scale                 !! of what the first one is a difference of [J]
            logical, intent(out) :: are_seen               !! else the rest is nothing
        end subroutine see_surplus

        module logical function sees_accepted(self, t, y, is_accepted)
            class(forward_system), intent(inout) :: self
            real(wp), intent(in) :: t(lanes)
            real(wp), intent(in), contiguous :: y(:, :)
            logical, intent(in) :: is_accepted(lanes)
        end function sees_accepted

        module logical function accept_by_look(self, t, y, is_accepted) result(is_done)
            class(forward_system), intent(inout) :: self
            real(wp), intent(in) :: t(lanes)
            real(wp), intent(in), contiguous :: y(:, :)
            logical, intent(in) :: is_accepted(lanes)
        end function accept_by_look

        !> The energy of an accepted state that the record has seen, though it does not know where the groups' links are.
        module logical function weighs_by_look(self, t, y) result(is_done)
            class(forward_system), intent(inout) :: self
            real(wp), intent(in) :: t(lanes)
            real(wp), intent(in) :: y(:, :)
        end function weighs_by_look

        module logical function accept_lanes_by_look(self, t, y, is_accepted) result(is_done)
            class(forward_system), intent(inout) :: self
            real(wp), intent(in) :: t(lanes)
            real(wp), intent(in), contiguous :: y(:, :)
            logical, intent(in) :: is_accepted(lanes)
        end function accept_lanes_by_look

        module subroutine follow_seen_turns(self, t)
            class(forward_system), intent(inout) :: self
            real(wp), intent(in) :: t                      !! [s]
        end subroutine follow_seen_turns

        module function seen_motion(self, is_acceleration) result(motion)
            class(forward_system), intent(in) :: self
            logical, intent(in) :: is_acceleration         !! else rates
            real(wp) :: motion(3, size(self%way%bounce%joint) + size(self%way%bounce%link))    ! [rad/s, m/s; /s]
        end function seen_motion

        module subroutine compare_seen(self)
            class(forward_system), intent(inout) :: self
        end subroutine compare_seen

        ! ---- linkdyn_forward_cylinders
        !> Pressures of a start whose coordinates are in y: given, or those of the scene, or those that hold it.
        module subroutine fill_cylinders(self, t, y, status, given)
            class(forward_system), intent(inout) :: self
            real(wp), intent(in) :: t                      !! [s]
            real(wp), intent(inout) :: y(:, :)             !! (lane, n)
            type(status_type), intent(inout) :: status
            real(wp), intent(in), optional :: given(:, :)  !! (chamber, n_actuator) [Pa]; of other actuators nothing
        end subroutine fill_cylinders

        ! ---- linkdyn_forward_control
        !> The next instant at which a controller takes a sample, or one takes effect; huge: none.
        pure real(wp) module function next_control(self) result(next)
            class(forward_system), intent(in) :: self
        end function next_control

        !> Controllers take samples at an accepted state, and put out those whose delay has passed.
        module subroutine control_now(self, t, y)
            class(forward_system), intent(inout) :: self
            real(wp), intent(in) :: t                      !! [s]
            real(wp), intent(in) :: y(:, :)                !! (lane, n)
        end subroutine control_now

        module subroutine drive_by_controllers(self, t, y)
            class(forward_system), intent(inout) :: self
            real(wp), intent(in) :: t(lanes)               !! [s]
            real(wp), intent(in) :: y(:, :)                !! (lane, n)
        end subroutine drive_by_controllers

        module subroutine drive_record_by_controllers(self, n, t, y)
            class(forward_system), intent(inout) :: self
            integer, intent(in) :: n
            real(wp), intent(in) :: t(:)                   !! [s] n at least
            real(wp), intent(in) :: y(:, :)                !! (lane, n)
        end subroutine drive_record_by_controllers

        ! ---- linkdyn_forward_watch
        !> Compare the rates at an accepted state.
        module subroutine look_at(self, t, y)
            class(forward_system), intent(inout) :: self
            real(wp), intent(in) :: t(lanes)
            real(wp), intent(in) :: y(:, :)
        end subroutine look_at

        module subroutine watch_coordinates(self, t, y)
            class(forward_system), intent(inout) :: self
            real(wp), intent(in) :: t(lanes)
            real(wp), intent(in) :: y(:, :)
        end subroutine watch_coordinates

        module subroutine look_and_decide(self, t, y)
            class(forward_system), intent(inout) :: self
            real(wp), intent(in) :: t(lanes)
            real(wp), intent(in) :: y(:, :)
        end subroutine look_and_decide

        !> By which tolerances steps will be taken: how closely their ends are watched.
        module subroutine watch_ends(self, rtol, atol)
            class(forward_system), intent(inout) :: self
            real(wp), intent(in) :: rtol, atol             !! of the steps
        end subroutine watch_ends

        !> Has a coordinate come past where it should be exchanged, or the mechanism been thrown back?
        logical module function leads_too_far(self, t)
            class(forward_system), intent(inout) :: self
            real(wp), intent(in) :: t                      !! [s]
        end function leads_too_far

        !> The coordinate that cannot be exchanged and has come to its dead point in an accepted state; 0: none.
        integer module function stalled_coordinate(self, t, y) result(stalled)
            class(forward_system), intent(inout) :: self
            real(wp), intent(in) :: t                      !! [s]
            real(wp), intent(in) :: y(:, :)                !! (lane, n)
        end function stalled_coordinate

        ! ---- linkdyn_forward_laws
        !> How much of a step is to be gone at once: no law may have a peak within it that is narrower than the gaps between
        !> stages, nor an angle that laws depend on turn farther than they are looked at by.
        module function part_in_sight(self, t, length, gap, y, rate, y_end, rate_end) result(part)
            class(forward_system), intent(inout) :: self
            real(wp), intent(in) :: t, length              !! of the step [s]
            real(wp), intent(in) :: gap                    !! the widest one between stages, part of it
            real(wp), intent(in), dimension(:) :: y, rate, y_end, rate_end    !! at its ends (n)
            real(wp) :: part
        end function part_in_sight

        ! ---- linkdyn_forward_contacts
        module subroutine accelerate(self, push, away)
            class(forward_system), intent(inout) :: self
            real(wp), intent(in) :: push(:, :)             !! (lane, n_stop + n_clutch)
            real(wp), intent(out) :: away(:, :)            !! (lane, n_stop + n_clutch)
        end subroutine accelerate

        module subroutine find_responses(self, is_in_contact, is_impact, response, of_coordinates, path)
            class(forward_system), intent(inout) :: self
            logical, intent(in) :: is_in_contact(:, :)     !! (lane, n_stop + n_clutch)
            logical, intent(in) :: is_impact               !! they are impulses: joints do not rub by them
            real(wp), intent(out) :: response(:, :, :)     !! (lane, of, by)
            real(wp), intent(out) :: of_coordinates(:, :, :)    !! (lane, n_q, by)
            type(impulse_path), intent(inout), optional :: path
        end subroutine find_responses

        !> Rates of the joint variables of motors whose transmissions lose.
        module function motor_rates(self) result(rate)
            class(forward_system), intent(in) :: self
            real(wp) :: rate(lanes, size(self%equations%lossy))
        end function motor_rates

        module subroutine hold_variables(self, t)
            class(forward_system), intent(inout) :: self
            real(wp), intent(in) :: t(lanes)
        end subroutine hold_variables

        ! ---- linkdyn_forward_events
        !> The scene's events, as numbers that cross zero.
        module subroutine evaluate_events(self, t, y, guard)
            class(forward_system), intent(inout) :: self
            real(wp), intent(in) :: t(lanes)
            real(wp), intent(in) :: y(:, :)
            real(wp), intent(out) :: guard(:, :)
        end subroutine evaluate_events

        !> The same with the rates, of the first states.
        module subroutine survey_events(self, t, y, n, rate, guard, are_known)
            class(forward_system), intent(inout) :: self
            real(wp), intent(in) :: t(lanes)
            real(wp), intent(in), contiguous :: y(:, :)
            integer, intent(in) :: n
            real(wp), intent(out), contiguous :: rate(:, :)
            real(wp), intent(out) :: guard(:, :)
            logical, intent(out) :: are_known
        end subroutine survey_events

        !> Events have come: what they bring.
        module subroutine meet_events(self, t, y, has_crossed, has_changed, is_over)
            class(forward_system), intent(inout) :: self
            real(wp), intent(in) :: t(lanes)
            real(wp), intent(inout) :: y(:, :)
            logical, intent(in) :: has_crossed(:, :)
            logical, intent(out) :: has_changed(lanes), is_over(lanes)
        end subroutine meet_events

        module subroutine note_entry(self, t, y, lane, event, entry, y_after)
            class(forward_system), intent(inout) :: self
            real(wp), intent(in) :: t(lanes)
            real(wp), intent(in) :: y(:, :)
            integer, intent(in) :: lane, event
            type(event_entry), intent(inout) :: entry
            real(wp), intent(in), optional :: y_after(:, :)    !! behind an impact; absent: as before
        end subroutine note_entry

        ! ---- linkdyn_forward_stops
        !> Joint variables strike stops.
        module subroutine meet_stops(self, t, y, strikes)
            class(forward_system), intent(inout) :: self
            real(wp), intent(in) :: t(lanes)
            real(wp), intent(inout) :: y(:, :)
            logical, intent(in) :: strikes(:, :)           !! (lane, n_stop)
        end subroutine meet_stops

        !> What touches its stop and has been brought to rest there, or drives onto it, behind an impulse of something else.
        module subroutine meet_touched_stops(self, t, y, is_wanted)
            class(forward_system), intent(inout) :: self
            real(wp), intent(in) :: t(lanes)
            real(wp), intent(inout) :: y(:, :)
            logical, intent(in) :: is_wanted(lanes)
        end subroutine meet_touched_stops

        module subroutine renew_gaps(self, t, y, is_wanted, rested)
            class(forward_system), intent(inout) :: self
            real(wp), intent(in) :: t(lanes)
            real(wp), intent(in) :: y(:, :)
            logical, intent(in) :: is_wanted(lanes)
            logical, intent(in) :: rested(:, :)            !! until now (lane, n_stop)
        end subroutine renew_gaps

        ! ---- linkdyn_forward_clutches
        !> The run begins here: clutches are open or closed, and what has no slip may be held.
        module subroutine begin_with_clutches(self, t, y)
            class(forward_system), intent(inout) :: self
            real(wp), intent(in) :: t                      !! [s]
            real(wp), intent(inout) :: y(:, :)
        end subroutine begin_with_clutches

        !> An instant at which clutches may close or open.
        module subroutine switch_now(self, t, y, is_changed)
            class(forward_system), intent(inout) :: self
            real(wp), intent(in) :: t                      !! [s]
            real(wp), intent(inout) :: y(:, :)
            logical, intent(out), optional :: is_changed   !! y is another one
        end subroutine switch_now

        !> Slips of a state, on lane 1.
        module function slips_at(self, t, y) result(slip)
            class(forward_system), intent(inout) :: self
            real(wp), intent(in) :: t                      !! [s]
            real(wp), intent(in) :: y(:, :)
            real(wp) :: slip(n_clutch(self%model%scene))     !! [m/s, rad/s]
        end function slips_at

        module subroutine follow_slips(self, t, y, is_accepted)
            class(forward_system), intent(inout) :: self
            real(wp), intent(in) :: t(lanes)
            real(wp), intent(in) :: y(:, :)
            logical, intent(in) :: is_accepted(lanes)
        end subroutine follow_slips

        module subroutine engage(self, t, y, is_closed, has_crossed)
            class(forward_system), intent(inout) :: self
            real(wp), intent(in) :: t(lanes)
            real(wp), intent(inout) :: y(:, :)
            logical, intent(in) :: is_closed(:, :)         !! from here (lane, n_clutch)
            logical, intent(in) :: has_crossed(:, :)       !! came to rest, or breaks loose (lane, n_clutch)
        end subroutine engage
    end interface

contains

    ! ---------------------------------------------------------------- plan

    !> Plan the equations of the stages.
    subroutine build_forward_system(model, solver, system, status, motion_model)
        type(model_type), intent(in), target :: model      !! must outlive the system
        integer, intent(in) :: solver                      !! of the stages; no reaction is computed there; 0: the fastest
        type(forward_system), intent(inout) :: system
        type(status_type), intent(inout) :: status
        type(model_type), intent(in), target, optional :: motion_model  !! whose coordinates have the scene's motion; absent: model
        type(unknown_choice) :: unknown
        type(kernel_family), pointer :: kernels
        integer :: stage_solver, i

        system%model => model
        call choose_unknowns(model, unknown, status)
        if (.not. status%is_ok()) return
        stage_solver = solver
        if (solver == 0) stage_solver = fastest_solver(model, unknown)
        call build_equations(model, stage_solver, .false., system%equations, status, unknown, has_motor_laws=.true.)
        if (.not. status%is_ok()) return
        call kernels_of(model, system%shared, kernels)
        call share_equations(model, kernels, system%equations)
        call prepare_workspace(model, system%equations, system%workspace)
        call want_of(system%workspace, [out_powers])
        system%workspace%checks_accuracy = .false.     ! steps judge it, and pass such places
        call plan_layout(model, unknown%acceleration, system%layout)
        system%n = system%layout%n
        system%is_angle = angles_of_state(model, system%layout)
        system%family = families_of_state(system%layout)
        allocate (system%turns(lanes, system%n), source=0.0_wp)
        allocate (system%beside(system%n), source=0.0_wp)
        allocate (system%per_place(system%n), source=0.0_wp)
        allocate (system%is_book(system%n), source=.false.)
        system%is_book(system%layout%supplied) = .true.
        system%is_result = system%is_book
        system%is_result(system%layout%work) = .true.
        system%by_inverse = model%scene%actuator%law%kind == effort_inverse .and. .not. unknown%drive
        system%may_jump = size(model%scene%laws%law) > 0
        system%way%n_before_record = evaluations_on_lanes(model)
        call plan_law_sight(model%scene%laws, laws_over_time(model%scene), &
                            scene_size(model) + reach_of(model, [(i, i=1, model%n_joint)], 0), system%way%sight)
        call plan_cam_sight(model, system%of_cams)
        system%may_leap = has_to_look(system%way%sight) .or. model%n_cam > 0 .or. follows_assembly(model)
        call prepare_bounce_watch(model, unknown%acceleration, system%way%bounce)
        call prepare_events(model, system)
        call plan_control(model, system%control, status)
        if (system%n_guard > 0 .or. n_controller(model%scene) > 0 .or. size(model%scene%laws%law) > 0 .or. model%n_cam > 0 &
            .or. follows_assembly(model)) then
            call prepare_kinematics(model, 0, system%look)
        end if
        call prepare_motors(model%n_actuator, system%way%motors)
        call prepare_cylinders(model%n_actuator, system%cylinders)
        if (.not. (wants_motion(model) .or. (any(system%by_inverse) .and. .not. allocated(system%way%given_force)))) return
        if (present(motion_model)) then
            call plan_motion_forces(motion_model, kernels, system%of_motion, status)
        else
            call plan_motion_forces(model, kernels, system%of_motion, status)
        end if
    end subroutine build_forward_system

    !> What the run is to look out for.
    subroutine prepare_events(model, system)
        type(model_type), intent(in) :: model
        type(forward_system), intent(inout) :: system

        system%n_guard = n_event(model%scene)
        if (system%n_guard == 0) return
        system%guard_direction = model%scene%event%direction
        allocate (system%guard_side(lanes, system%n_guard), system%guard_scale(lanes, system%n_guard), source=0.0_wp)
        call prepare_clutches(n_clutch(model%scene), system%way%clutch)
        call prepare_stops(n_stop(model%scene), system%way%stops)
        call prepare_measured_angles(model, system%way%angles)
    end subroutine prepare_events

    ! ---------------------------------------------------------------- run

    !> Begin at t on the assembly of the scene's start.
    subroutine begin(self, t, y)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t                      !! [s]
        real(wp), intent(in), contiguous :: y(:, :)

        call begin_assembly(self%model, t, self%way%assembly)
        self%way%angles%t = t
        self%way%motors%t_braked = t
        call begin_motion_forces(t, self%of_motion)
        call self%accept(spread(t, 1, lanes), y, spread(.true., 1, lanes))
        if (n_controller(self%model%scene) > 0) then
            call begin_controllers(self%model%scene%controller, t, self%control%state)
            call self%control_now(t, y)
        end if
        if (self%watch%is_on) call look_and_decide(self, spread(t, 1, lanes), y)
    end subroutine begin

    !> Something happens: whoever looks at that sees this side of it.
    subroutine show_side_of_event(self, t, y, is_behind)
        class(forward_system), intent(inout), target :: self
        real(wp), intent(in) :: t(lanes)               !! [s]
        real(wp), intent(in) :: y(:, :)
        logical, intent(in) :: is_behind

        if (associated(self%witness)) call self%witness%see(t(1), y, is_behind)
    end subroutine show_side_of_event

    !> By the kinetic energy of the state evaluated last on the lanes the work of drives is judged, which counts from zero.
    subroutine note_energy(self)
        class(forward_system), intent(inout) :: self
        real(wp), dimension(lanes) :: energy, kinetic

        call energy_of_motion(self%model, self%workspace%state, energy, kinetic)
        self%beside(self%layout%work) = kinetic(1)
        self%per_place(self%layout%work) = sum(abs(self%workspace%driving_force(1, :)))
    end subroutine note_energy

    !> Go on at t where another system of the same mechanism stands: the model's start is that place.
    subroutine take_over(self, other, t, y)
        class(forward_system), intent(inout) :: self
        type(forward_system), intent(in) :: other
        real(wp), intent(in) :: t                      !! [s]
        real(wp), intent(in), contiguous :: y(:, :)

        call begin_assembly(self%model, t, self%way%assembly)
        self%way%assembly%n_crossed = other%way%assembly%n_crossed
        call go_on_from(other%of_motion, self%of_motion)
        self%of_joints = other%of_joints
        if (wraps_anywhere(self%of_joints)) call need_look(self)
        self%own => other%own
        self%witness => other%witness
        self%beside(self%layout%work) = other%beside(other%layout%work)
        self%per_place(self%layout%work) = other%per_place(other%layout%work)
        self%is_book(self%layout%work) = other%is_book(other%layout%work)
        self%control%state = other%control%state
        self%way%motors%switched = other%way%motors%switched
        self%way%motors%is_on = other%way%motors%is_on
        self%may_end = other%may_end
        self%way%log = other%way%log
        if (self%n_guard > 0) then
            self%way%clutch = other%way%clutch
            self%way%stops = other%way%stops
            self%guard_side = other%guard_side
            self%guard_scale = other%guard_scale
            self%guard_is_fresh = other%guard_is_fresh
            self%way%angles = other%way%angles
        end if
        call free_forward_record(self%record)          ! whose plan is that of the start before
        self%guards_agree = .false.
        self%guards_differ = .false.
        call free_looks(self%looks)
        call leave_drives(self%drives)
        call leave_motion_record(self%of_motion)
        call leave_programs(self%shared)
        self%watch%may_exchange = .true.
        self%watch%is_on = .false.
        call self%accept(spread(t, 1, lanes), y, spread(.true., 1, lanes))
        self%watch%is_on = .true.
        call forget_rates(self%watch)
        call look_and_decide(self, spread(t, 1, lanes), y)
    end subroutine take_over

    subroutine release(self)
        class(forward_system), intent(inout) :: self

        call self%workspace%free()
        call free_equations(self%equations)
        call free_drives(self%drives)
        call free_motion_forces(self%of_motion)
        call free_control(self%control)
        call free_forward_record(self%record)
        call free_looks(self%looks)
        call leave_programs(self%shared)
    end subroutine release

    !> Numbers of the model have changed, nothing else of it.
    subroutine renew(self)
        class(forward_system), intent(inout) :: self

        call renew_equations(self%equations, self%workspace)
    end subroutine renew

    ! ---------------------------------------------------------------- one evaluation

    !> dy/dt on all lanes: by the record, if there is one that serves, and on lanes else.
    subroutine evaluate_forward(self, t, y, rate, failed)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t(lanes)
        real(wp), intent(in), contiguous :: y(:, :)
        real(wp), intent(out), contiguous :: rate(:, :)
        logical, intent(out) :: failed(lanes)
        logical :: is_left(lanes)

        if (.not. self%has_record_now(t(1))) then
            self%way%n_left = self%way%n_left + 1
            call self%evaluate_on_lanes(t, y, rate, failed)
            return
        end if
        associate (n => self%n_used)
            call evaluate_by_record(self, lanes, t, y, rate, is_left)
            if (self%has_cylinders) is_left(:n) = is_left(:n) .or. self%cylinders%impossible(:n) > 0
            is_left(n + 1:) = is_left(n)
        end associate
        if (any(is_left .and. .not. self%is_idle)) then
            call evaluate_rest(self, t, y, is_left, rate, failed)
        else
            failed = is_left
            call note_evaluated(self, t(1), y(1, :))
        end if
    end subroutine evaluate_forward

    !> The same of one state: the record needs no lanes.
    subroutine evaluate_one(self, t, y, rate, failed)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t, y(:)                !! (n)
        real(wp), intent(out) :: rate(:)               !! (n)
        logical, intent(out) :: failed

        failed = .true.
        if (self%has_record_now(t)) then
            self%n_used = 1
            call evaluate_as_lane(self, [t], y, rate, failed)
            self%n_used = lanes
        end if
        if (.not. failed) return
        self%way%n_left = self%way%n_left + 1
        call self%evaluate_spread(t, y, rate, failed)
    end subroutine evaluate_one

    !> Steps are not meant to go where states no longer tell of the assembly.
    pure real(wp) function longest_forward_step(self, rate) result(longest)
        class(forward_system), intent(in) :: self
        real(wp), intent(in) :: rate(:)                !! (n)
        integer :: k

        longest = huge(1.0_wp)
        if (.not. self%way%assembly%is_needed .or. self%model%n_branch == 0) return
        do k = 1, self%model%n_q
            associate (p => self%layout%position(k))
                if (p > 0) longest = min(longest, longest_way(self%model%stride(k))/max(abs(rate(p)), tiny(1.0_wp)))
            end associate
        end do
    end function longest_forward_step

    !> One lane of states, by the record.
    subroutine evaluate_as_lane(self, t, y, rate, is_left)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t(1), y(1, self%n)
        real(wp), intent(inout) :: rate(1, self%n)
        logical, intent(out) :: is_left
        logical :: lane_is_left(1)

        call evaluate_by_record(self, 1, t, y, rate, lane_is_left)
        is_left = lane_is_left(1) .or. .not. sum(abs(rate)) <= huge(1.0_wp)
        if (self%has_cylinders) is_left = is_left .or. self%cylinders%impossible(1) > 0
        if (.not. is_left) call note_evaluated(self, t(1), y(1, :))
    end subroutine evaluate_as_lane

    !> The record alone has found the rates of a state, the first of its samples.
    subroutine note_evaluated(self, t, y)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t, y(:)                !! (n)

        self%n_by_record = self%n_by_record + 1
        self%workspace%status = sample_ok
        self%watch%is_compared = .false.
        self%is_by_record = .true.
        self%is_behind = .true.
        self%t_tried = t
        self%y_tried(:) = y
    end subroutine note_evaluated

    !> What the record has left, on lanes.
    subroutine evaluate_rest(self, t, y, is_left, rate, failed)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t(lanes)
        real(wp), intent(in) :: y(:, :)
        logical, intent(in) :: is_left(lanes)
        real(wp), intent(inout) :: rate(:, :)
        logical, intent(out) :: failed(lanes)
        real(wp) :: on_lanes(lanes, self%n)
        integer :: k

        self%way%n_left = self%way%n_left + 1
        call self%evaluate_on_lanes(t, y, on_lanes, failed)
        failed = failed .and. is_left
        do k = 1, self%n
            where (is_left) rate(:, k) = on_lanes(:, k)
        end do
    end subroutine evaluate_rest

    !> Is there a record that serves? It is made once that is worth while; it knows nothing of what stops and clutches hold, but how
    !> joints slide that may stick.
    logical function has_record_now(self, t) result(has_one)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t                      !! [s]

        has_one = .false.
        if (rests_anywhere(self%way%stops) .or. .not. only_slides(self%model%scene, self%way%clutch)) return
        ! Steps tell how long the run is whatever is looked at, and whenever it comes back for want of time.
        if (self%way%n_accepted*self%evaluations_a_step < self%way%n_before_record) return
        if (self%may_record .and. .not. associated(self%record%recorded)) call self%make_record(t)
        has_one = self%may_record .and. associated(self%record%recorded)
    end function has_record_now

    !> dy/dt on all lanes, and everything else of these states in the workspace.
    subroutine evaluate_on_lanes(self, t, y, rate, failed, there)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t(lanes)
        real(wp), intent(in) :: y(:, :)
        real(wp), intent(out) :: rate(:, :)
        logical, intent(out) :: failed(lanes)
        type(standing_lanes), intent(inout), optional :: there    !! where they set out from; absent: from the accepted state
        logical :: is_held

        self%watch%is_compared = .false.
        self%is_by_record = .false.
        self%is_behind = .false.
        associate (model => self%model, workspace => self%workspace)
            call lane_loads(model, t, workspace%load)
            if (present(there)) then
                call unpack_state(model, self%layout, t, y, there%turns, workspace%state)
                call evaluate_assembled(model, t, there%assembly, workspace%state)
                ! no bit of a sample may hang on the ones evaluated before it: the motion's groups set out from the accepted state
                call forget_forces(self%of_motion)
            else
                call unpack_state(model, self%layout, t, y, self%turns, workspace%state)
                call evaluate_assembled(model, t, self%way%assembly, workspace%state)
            end if
            self%held%is_measured = .false.
            if (applies_motion_forces(self)) call find_motion_forces(t, lanes, self%of_motion)
            workspace%state%time = t
            if (n_stop(model%scene) > 0) workspace%state%touch = self%touches()
            if (any(model%scene%actuator%law%kind == effort_over) .or. self%control%has_continuous) &
                call find_laws(model, workspace%state)
            call drive_actuators(self, t, y)
            workspace%n_used = self%n_used
            if (n_clutch(model%scene) > 0) call rub_clutches(model, t, workspace, self%way%clutch)
            is_held = rests_anywhere(self%way%stops) .or. holds_anywhere(self%way%clutch)
            call solve_equations(model, self%equations, workspace, is_free_of_friction=is_held .and. size(self%equations%rub) > 0)
            if (is_held) call hold_variables(self, t)
            if (has_sticking(model)) call measure_grip(model, self%equations, workspace, self%way%clutch)
            call pack_rates(model, self%layout, lanes, y, workspace%acceleration, counted_rates(model, workspace%state), rate)
            call pack_control_rates(self%layout, lanes, self%control, rate)
            call pack_current_rates(self%layout, self%n_used, self%way%motors, rate)
            call pack_pressure_rates(model, self%layout, self%n_used, self%cylinders, rate)
            call find_powers(self, rate(:, self%layout%work), rate(:, self%layout%supplied))
            if (self%may_jump) call self%note_mode(workspace%state%mode, rate)
        end associate
        call note_failures(self, failed)
    end subroutine evaluate_on_lanes

    !> Forces of actuators at states whose motion is in the workspace: what drives give, what controllers put on top of it, and what
    !> motors and cylinders make of both.
    subroutine drive_actuators(self, t, y)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t(lanes)
        real(wp), intent(in) :: y(:, :)
        integer :: k

        associate (workspace => self%workspace, given => .not. self%equations%unknown%drive)
            if (allocated(self%way%given_force)) then
                do k = 1, self%model%n_actuator
                    if (given(k)) workspace%driving_force(:, k) = self%way%given_force(k)
                end do
            else
                call evaluate_drives(self%model, given .and. .not. self%by_inverse, t, self%n_used, workspace%state, self%shared, &
                                     self%drives, workspace%driving_force)
                do k = 1, self%model%n_actuator
                    if (given(k) .and. self%by_inverse(k)) workspace%driving_force(:, k) = self%of_motion%force(:, k)
                end do
            end if
            if (self%control%state%n > 0) call drive_by_controllers(self, t, y)
            call drive_by_cylinders(self%model, self%layout, y, workspace, self%cylinders)
            if (motors_have_laws(self%model)) &
                call drive_by_motors(self%model, self%equations, self%layout, t, y, workspace, self%way%motors)
        end associate
    end subroutine drive_actuators

    !> Which lanes have no rates, and what was in the way first.
    subroutine note_failures(self, failed)
        class(forward_system), intent(inout) :: self
        logical, intent(out) :: failed(lanes)
        integer :: k

        call note_lost_drives(self)
        failed = self%workspace%status /= sample_ok
        if (applies_motion_forces(self)) failed = failed .or. self%of_motion%status /= sample_ok
        do k = 1, self%model%n_q
            failed = failed .or. .not. abs(self%workspace%acceleration(:, k)) <= huge(1.0_wp)
        end do
        where (failed .and. self%way%obstacle == sample_ok) self%way%obstacle = self%workspace%status
        if (applies_motion_forces(self)) then
            where (failed .and. self%way%obstacle == sample_ok) self%way%obstacle = self%of_motion%status
        end if
        if (.not. self%may_be_torn) failed = failed .or. self%cylinders%impossible > 0
        where (failed .and. self%way%obstacle == sample_ok) self%way%obstacle = sample_undefined
    end subroutine note_failures

    !> States at which a drive that is given has no force, whose equations have been solved all the same.
    subroutine note_lost_drives(self)
        class(forward_system), intent(inout) :: self
        integer :: k

        do k = 1, self%model%n_actuator
            if (self%equations%unknown%drive(k)) cycle
            where (self%workspace%status == sample_ok .and. .not. abs(self%workspace%driving_force(:, k)) <= huge(1.0_wp)) &
                self%workspace%status = sample_undefined
        end do
    end subroutine note_lost_drives

    !> Forces that drives apply whatever the state: of a record's samples these are inputs.
    subroutine find_given_forces(self, t, force, has_failed)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t(:)                   !! of the first lanes
        real(wp), intent(inout) :: force(:, :)         !! (lane, n_actuator) [N, N m]
        logical, intent(out) :: has_failed(:)          !! (lane)
        real(wp) :: instant(lanes)

        has_failed = .false.
        associate (n => size(t))
            if (applies_motion_forces(self)) then
                instant = t(n)
                instant(:n) = t
                call find_motion_forces(instant, n, self%of_motion)
                force(:n, :) = self%of_motion%force(:n, :)
                has_failed(:n) = self%of_motion%status(:n) /= sample_ok
            else if (allocated(self%way%given_force)) then
                force(:n, :) = spread(self%way%given_force, 1, n)
            end if
        end associate
    end subroutine find_given_forces

    !> Do drives apply the forces that the scene's motion asks for?
    pure logical function applies_motion_forces(self)
        class(forward_system), intent(in) :: self

        applies_motion_forces = self%of_motion%is_needed .and. any(self%by_inverse) .and. .not. allocated(self%way%given_force)
    end function applies_motion_forces

    !> Which sides of stops are touched: events decide it from one accepted state to the next. Their forces so stay what they are up
    !> to the very end of a step, where the last stage may lie on either side.
    function touches(self) result(touch)
        class(forward_system), intent(in) :: self
        real(wp) :: touch(lanes, n_stop(self%model%scene))     ! see `measure_touch` (lane, side of a stop)
        integer :: i

        do i = 1, size(touch, 2)
            touch(:, i) = -self%guard_side(:, self%model%scene%stop(i)%event)
        end do
    end function touches

    !> Power of the driving forces, and of all forces but gravity.
    subroutine find_powers(self, driving, supplied)
        class(forward_system), intent(inout) :: self
        real(wp), intent(out), dimension(lanes) :: driving, supplied    !! [W]
        real(wp) :: power(lanes, 2)

        power = 0
        if (self%wants_work) power = found_of(self%workspace, out_powers, 2)
        driving = power(:, 1)
        supplied = power(:, 2)
    end subroutine find_powers

    !> Motion of states; with the accelerations of the coordinates, if they are told.
    subroutine look_closely(self, t, y, acceleration)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t(lanes)
        real(wp), intent(in) :: y(:, :)
        real(wp), intent(in), optional :: acceleration(:, :)    !! (lane, n_q)

        call unpack_state(self%model, self%layout, t, y, self%turns, self%look)
        if (present(acceleration)) self%look%qdd = acceleration
        self%look%time = t
        call evaluate_assembled(self%model, t, self%way%assembly, self%look)
    end subroutine look_closely

    ! ---------------------------------------------------------------- one accepted step

    !> The mechanism has got to y: its assembly there is where the next steps set out from.
    subroutine accept_forward(self, t, y, is_accepted)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t(lanes)
        real(wp), intent(in), contiguous :: y(:, :)
        logical, intent(in) :: is_accepted(lanes)
        real(wp), dimension(lanes) :: energy, kinetic
        logical :: is_seen

        self%way%n_accepted = self%way%n_accepted + 1
        self%way%n_left = 0
        if (holds_anywhere(self%way%clutch)) then
            where (is_accepted) self%way%clutch%longest = max(self%way%clutch%longest, t - self%way%clutch%t_accepted)
        end if
        where (is_accepted) self%way%clutch%t_accepted = t
        if (n_clutch(self%model%scene) > 0) call follow_slips(self, t, y, is_accepted)
        where (is_accepted) self%way%motors%t_braked = t
        where (is_accepted) self%way%obstacle = sample_ok
        if (is_accepted(1)) self%cylinders%culprit = 0
        self%control%state%blind = 0
        is_seen = .false.
        if (self%way%assembly%is_needed .or. wraps_anywhere(self%of_joints)) then
            if (self%way%bounce%is_recorded .or. .not. self%way%bounce%is_on) is_seen = sees_accepted(self, t, y, is_accepted)
        end if
        if (self%way%assembly%is_needed) then
            call unpack_state(self%model, self%layout, t, y, self%turns, self%way%assembly%state)
            if (is_seen) is_seen = accept_by_look(self, t, y, is_accepted)
            if (.not. is_seen) is_seen = accept_lanes_by_look(self, t, y, is_accepted)
            if (.not. is_seen) then
                call accept_assembly(self%model, t, is_accepted, self%way%assembly)
                if (.not. weighs_by_look(self, t, y)) then
                    call energy_of_motion(self%model, self%way%assembly%state, energy, kinetic)
                    call weigh_energy(energy, kinetic, y(:, self%layout%supplied), self%way%energy)
                end if
            end if
        end if
        if (self%way%bounce%is_on .and. is_seen) then
            call note_start(t(1), seen_motion(self, is_acceleration=.false.), self%way%bounce)
        else if (self%way%bounce%is_on) then
            call note_start(t(1), measure_rates(self%model, self%way%assembly%state, self%way%bounce), self%way%bounce)
        end if
        call accept_motion(t, is_accepted, self%of_motion)
        if (wraps_anywhere(self%way%angles) .or. wraps_anywhere(self%of_joints)) &
            call follow_turns(self, t, y, is_accepted, is_seen)
        if (self%watch%is_on) call watch_coordinates(self, t, y)
    end subroutine accept_forward

    !> Groups are led from stage to stage of a step; those of a new one set out from the accepted state, so do forces of the motion.
    subroutine begin_chain_of_stages(self)
        class(forward_system), intent(inout) :: self

        call forget_stages(self%record%stage)
        call forget_forces(self%of_motion)
    end subroutine begin_chain_of_stages

    !> Angles have turned on the way to an accepted state.
    subroutine follow_turns(self, t, y, is_accepted, is_seen)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t(lanes)
        real(wp), intent(in) :: y(:, :)
        logical, intent(in) :: is_accepted(lanes)
        logical, intent(in) :: is_seen                 !! by the record; else it has just been computed on lanes, if it had to be

        if (.not. wraps_anywhere(self%way%angles)) then
            if (is_seen) then
                call follow_seen_turns(self, t(1))
                return
            else if (self%way%assembly%is_needed) then
                call follow_angles(self%model, self%way%assembly%state, t, is_accepted, self%of_joints)
                return
            end if
        end if
        call self%look_closely(t, y)
        if (wraps_anywhere(self%way%angles)) call follow_angles(self%model, self%look, t, is_accepted, self%way%angles)
        if (wraps_anywhere(self%of_joints)) call follow_angles(self%model, self%look, t, is_accepted, self%of_joints)
    end subroutine follow_turns

    !> Places within the step that tell the turns made on the way, where its ends do not.
    integer function looks_for_turns(self) result(n)
        class(forward_system), intent(inout) :: self

        n = max(looks_for_angles(self%way%angles), looks_for_angles(self%of_joints))
    end function looks_for_turns

    !> Angles have turned on the way through these places.
    subroutine follow_turns_within(self, t, y)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t(:)
        real(wp), intent(in) :: y(:, :)
        integer :: first, lane, place(lanes)

        do first = 1, size(t), lanes
            place = [(min(first + lane - 1, size(t)), lane=1, lanes)]
            call self%look_closely(t(place), y(place, :))
            associate (n => min(lanes, size(t) - first + 1))
                if (wraps_anywhere(self%way%angles)) &
                    call follow_within(self%model, self%look, t(place), n, first, size(t), self%way%angles)
                if (wraps_anywhere(self%of_joints)) &
                    call follow_within(self%model, self%look, t(place), n, first, size(t), self%of_joints)
            end associate
        end do
    end subroutine follow_turns_within

    !> Count the turns of all joint angles from an accepted state on, unless that has begun.
    subroutine count_joint_turns(self, own, t, y)
        class(forward_system), intent(inout) :: self
        type(model_type), intent(in) :: own            !! with the coordinates that results are told in
        real(wp), intent(in) :: t                      !! [s]
        real(wp), intent(in) :: y(:, :)

        if (wraps_anywhere(self%of_joints)) return
        call prepare_joint_angles(own, self%of_joints)
        if (.not. wraps_anywhere(self%of_joints)) return
        call need_look(self)
        self%of_joints%t = t
        call self%look_closely(spread(t, 1, lanes), y)
        call follow_angles(self%model, self%look, spread(t, 1, lanes), spread(.true., 1, lanes), self%of_joints)
    end subroutine count_joint_turns

    subroutine need_look(self)
        class(forward_system), intent(inout) :: self

        if (.not. allocated(self%look%q)) call prepare_kinematics(self%model, 0, self%look)
    end subroutine need_look

    !> A state of the last step is evaluated later: from a lane on, others set out from here.
    subroutine leave_standing_here(self, t, lane, there)
        class(forward_system), intent(in) :: self
        real(wp), intent(in) :: t                      !! of the state [s]
        integer, intent(in) :: lane
        type(standing_lanes), intent(inout) :: there

        integer :: k

        if (.not. allocated(there%turns)) there%turns = self%turns
        do k = 1, self%n
            there%turns(lane:, k) = self%turns(1, k)
        end do
        call leave_standing(self%way%assembly, lane, there%assembly)
        call note_nearest(self%of_joints, t, lane, there%of_joints)
    end subroutine leave_standing_here

    !> Joint angles with their turns, of the states evaluated last on lanes; other joint variables: 0.
    function joint_angles(self, t, there) result(angle)
        class(forward_system), intent(in) :: self
        real(wp), intent(in) :: t(lanes)               !! of the states [s]
        type(standing_lanes), intent(in) :: there      !! where they have set out from
        real(wp) :: angle(lanes, self%model%n_variable)       ! [rad]

        angle = angles_at(self%model, self%workspace%state, t, self%of_joints, there%of_joints)
    end function joint_angles

    !> Has the last step made energy of nothing, or lost it?
    function has_broken_law(self) result(is_broken)
        class(forward_system), intent(inout) :: self
        logical :: is_broken(lanes)

        is_broken = .false.
        if (.not. self%way%assembly%is_needed) return
        call self%judge_energy(size(self%way%assembly%margin, 2), self%way%assembly%margin, is_broken)
    end function has_broken_law

    !> The same of accepted states with these margins, whose energy has been weighed.
    subroutine judge_energy(self, n_map, margin, is_broken)
        class(forward_system), intent(inout) :: self
        integer, intent(in) :: n_map
        real(wp), intent(in) :: margin(lanes, n_map)
        logical, intent(out) :: is_broken(lanes)

        is_broken = .false.
        if (.not. self%wants_work) return
        call judge_steps(n_map, margin, self%way%assembly%n_crossed, self%way%energy, is_broken)
        where (is_broken .and. self%way%obstacle == sample_ok) self%way%obstacle = sample_branch_lost
    end subroutine judge_energy

    !> Energy that is there but was not supplied, since the last accepted state, over what the errors allowed and rounding
    !> would make.
    function broken_law(self, t, y, nudge, error) result(part)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t, y(:)
        real(wp), intent(in) :: nudge(:), error(:)
        real(wp) :: part, scale
        real(wp), allocatable :: state(:, :), surplus(:)
        logical :: are_seen

        part = 0
        if (.not. (self%way%assembly%is_needed .and. self%wants_work)) return
        state = list_neighbours(y, nudge, error)
        allocate (surplus(size(state, 2)))
        call see_surplus(self, t, state, surplus, scale, are_seen)
        if (.not. are_seen) then
            call weigh_again(self%model, self%layout, self%way%assembly, self%way%energy)
            call find_surplus(self%model, self%layout, t, state, self%turns, self%way%assembly, surplus, scale)
        end if
        call compare_surplus(surplus, scale, self%way%energy, part)
    end function broken_law

    !> Ways to the next states begin where these have their turns left out.
    subroutine note_turns_forward(self, turns)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: turns(:, :)
        integer :: k

        self%turns = self%turns + turns
        if (.not. self%way%assembly%is_needed) return
        call leave_turns_out(turns, self%way%energy)
        do k = 1, self%model%n_q
            associate (p => self%layout%position(k))
                if (p > 0) call leave_turns_of(k, turns(:, p), self%way%assembly)
            end associate
        end do
    end subroutine note_turns_forward
end module linkdyn_forward_system
