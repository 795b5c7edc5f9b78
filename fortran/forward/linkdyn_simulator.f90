!> A mechanism that is stepped from outside: whoever calls gives the forces of the actuators for the next piece of time, a
!> controller's, and reads where the mechanism is at its end.
!>
!> The forces stay as they are during a step, as those of a controller with a hold do. Steps of the integrator end where
!> the caller's do, and at the kinks of laws between; what it has learnt of their length it keeps.
!>
!> Callers know the scene's coordinates, so none is exchanged at its dead point, as forward runs do: there the simulation ends. It
!> is watched all the same, or steps would lead over that point to a mechanism that was thrown back.
module linkdyn_simulator
    use linkdyn_coordinate_watch, only: prepare_watch, dead_coordinate
    use linkdyn_cylinder_states, only: pressures_of_state, end_of_cylinder
    use linkdyn_failure, only: failure_at
    use linkdyn_forward_kinks, only: kink_list, collect_kinks, next_kink, pass_kink, is_there_by
    use linkdyn_forward_state, only: state_layout, fill_start, read_coordinates, scene_start
    use linkdyn_forward_system, only: forward_system, forward_memory, build_forward_system
    use linkdyn_forward_words, only: driven_through_in_words, no_stand_in, without_end_in_words
    use linkdyn_heard_tables, only: hearing, heard_table, list_tables, refuse_short_tables
    use linkdyn_integrator, only: integrator_type, integrator_options, check_options, tightened, recall_integrator, stop_growth, &
        stop_pace, stop_length
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state, prepare_kinematics
    use linkdyn_lane_count, only: lanes
    use linkdyn_linearization, only: linearization, linearize_system
    use linkdyn_lock, only: hold_texts, release_texts
    use linkdyn_longest_step, only: too_long_steps_in_words
    use linkdyn_model, only: model_type
    use linkdyn_run_tables, only: list_simulator_tables
    use linkdyn_scene, only: effort_law, effort_inverse, side_opening
    use linkdyn_shared_programs, only: shared_programs, hold_programs, leave_programs
    use linkdyn_status, only: status_type, fail, status_bad_input, sample_undefined
    use linkdyn_stop_starts, only: refuse_beyond_stops, begin_at_stops
    use linkdyn_text, only: quoted, to_text
    implicit none (type, external)
    private
    public :: simulator_type, simulator_state

    type :: simulator_type
        type(model_type), pointer :: model => null()   !! of its own: no coordinate is led, every actuator does as it is told
        type(effort_law), allocatable :: law(:)        !! of the scene's actuators, for who asks how they would act (n_actuator)
        type(integrator_options) :: options
        type(integrator_type), allocatable :: integrator
        type(forward_system), pointer :: system => null()
        type(shared_programs), pointer, private :: shared => null()    !! records of the model, wherever the mechanism is put
        real(wp), allocatable :: y(:, :)               !! state (lane, n)
        type(kink_list), private :: kinks
        type(heard_table), allocatable, private :: heard(:)    !! tables beyond whose ends no step leads
        real(wp), private :: t = 0                     !! where it is, as the caller has written it [s]
        type(kinematic_state), private :: scratch
    contains
        procedure :: open, set, step, read, n_cylinder, read_pressures, linearize, keep, put_back, close
    end type simulator_type

    !> Where a simulator has stood, with all that it remembered: going on from there once more takes the same steps.
    type :: simulator_state
        private
        real(wp) :: t = 0                              !! [s]
        real(wp), allocatable :: y(:, :)               !! (lane, n)
        type(forward_memory) :: memory
        type(integrator_type) :: integrator
        type(kink_list) :: kinks
    end type simulator_state

contains

    !> Plan a scene's mechanism and put it at its start.
    !>
    !> **Errors**: what the equations refuse; a start that cannot be assembled, or for which a table has no rows; options that make
    !> no sense.
    subroutine open(self, model, options, t, status)
        class(simulator_type), intent(inout) :: self
        type(model_type), intent(in) :: model
        type(integrator_options), intent(in) :: options
        real(wp), intent(in) :: t                      !! [s]
        type(status_type), intent(inout) :: status
        real(wp) :: q(model%n_q), qd(model%n_q)
        integer :: i

        if (model%n_q == 0) then
            call fail(status, status_bad_input, "nothing moves: the scene has no coordinates (expected a mechanism)")
            return
        end if
        call refuse_start_beyond_tables(model, t, status)
        if (.not. status%is_ok()) return
        call scene_start(model, t, q, qd)
        allocate (self%model)
        self%model = model
        self%model%scene%coordinate%is_driven = .false.
        allocate (self%law(model%n_actuator))
        do i = 1, model%n_actuator
            self%law(i) = model%scene%actuator(i)%law
        end do
        self%model%scene%actuator%law%kind = effort_inverse
        call check_options(options, status)
        if (.not. status%is_ok()) return
        self%options = tightened(options)
        call list_simulator_tables(self%model, self%heard)
        call prepare_kinematics(model, 0, self%scratch)
        call hold_programs(self%shared)
        call self%set(t, q, qd, status)
    end subroutine open

    !> A motion tells where it begins.
    subroutine refuse_start_beyond_tables(model, t, status)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: t                      !! [s]
        type(status_type), intent(inout) :: status
        type(heard_table), allocatable :: heard(:)

        call list_tables(model%scene, hearing(motions=.false., starts=.true.), heard)
        call refuse_short_tables(heard, t, t, "start", status)
    end subroutine refuse_start_beyond_tables

    !> Go on from other coordinates and rates, on the assembly that the way from the scene's start leads to.
    subroutine set(self, t, q, qd, status, pressure)
        class(simulator_type), intent(inout) :: self
        real(wp), intent(in) :: t                      !! [s]
        real(wp), intent(in) :: q(:), qd(:)            !! (n_q) [m, rad; /s]
        type(status_type), intent(inout) :: status
        real(wp), intent(in), optional :: pressure(:, :)   !! (chamber, cylinder) [Pa]; absent: as a run would begin
        real(wp), allocatable :: rate(:, :)
        logical :: failed(lanes)

        call refuse_short_tables(self%heard, t, t, "start", status)
        if (.not. status%is_ok()) return
        call leave(self)
        allocate (self%system)
        self%system%way%given_force = spread(0.0_wp, 1, self%model%n_actuator)
        call hold_programs(self%system%shared, self%shared)
        call build_forward_system(self%model, 0, self%system, status)
        self%system%may_end = .false.
        self%system%lanes_are_one = .true.
        if (.not. status%is_ok()) return
        ! Nobody is told it, and forces come later: steps do not heed it.
        self%system%is_book(self%system%layout%work) = .true.
        self%system%may_record = .true.
        call prepare_watch(self%model, spread(.true., 1, self%model%n_q), self%system%watch)
        call self%system%watch_ends(self%options%rtol, self%options%atol)
        if (allocated(self%y)) deallocate (self%y)
        allocate (self%y(lanes, self%system%n), rate(lanes, self%system%n))
        call fill_start(self%model, self%system%layout, spread(q, 1, lanes), spread(qd, 1, lanes), self%y)
        if (present(pressure)) then
            call self%system%fill_cylinders(t, self%y, status, of_actuators(self%system%layout, pressure))
        else
            call self%system%fill_cylinders(t, self%y, status)
        end if
        if (.not. status%is_ok()) return
        call self%system%begin(t, self%y)
        call refuse_beyond_stops(self%system, t, self%y, status)
        if (.not. status%is_ok()) return
        call self%system%evaluate_on_lanes(spread(t, 1, lanes), self%y, rate, failed)
        if (failed(1)) then
            call fail(status, status_bad_input, "the mechanism cannot be computed there: " &
                      //failure_at(self%model, self%system%workspace%state, self%system%workspace%status(1), 1))
            return
        end if
        call begin_at_stops(self%system, t, self%y)
        call self%system%begin_with_clutches(t, self%y)
        call collect_kinks(self%model, t, huge(t), self%kinks)
        self%t = t
        allocate (self%integrator)
        call self%integrator%start(self%options, self%system, t, self%y, status)
    end subroutine set

    !> Pressures of cylinders as those of actuators; of other ones zero.
    pure function of_actuators(layout, pressure) result(given)
        type(state_layout), intent(in) :: layout
        real(wp), intent(in) :: pressure(:, :)         !! (chamber, cylinder) [Pa]
        real(wp) :: given(size(pressure, 1), size(layout%pressure))     !! (chamber, n_actuator)

        given = 0
        given(:, cylinders_of(layout)) = pressure
    end function of_actuators

    !> Actuators that are cylinders whose pressures are states.
    pure function cylinders_of(layout) result(actuator)
        type(state_layout), intent(in) :: layout
        integer, allocatable :: actuator(:)
        integer :: i

        actuator = pack([(i, i=1, size(layout%pressure))], layout%pressure > 0)
    end function cylinders_of

    !> Give back all but the model: the mechanism stands nowhere.
    subroutine leave(self)
        type(simulator_type), intent(inout) :: self

        if (allocated(self%integrator)) then
            call self%integrator%finish()
            deallocate (self%integrator)
        end if
        if (.not. associated(self%system)) return
        call self%system%release()
        deallocate (self%system)
    end subroutine leave

    !> Keep where it stands, with what controllers, brakes, clutches and stops remember, turns that are counted, and what the
    !> integrator has learnt.
    !>
    !> **Errors**: it stands nowhere.
    subroutine keep(self, state, status)
        class(simulator_type), intent(in) :: self
        type(simulator_state), intent(inout) :: state
        type(status_type), intent(inout) :: status

        call need_place(self, status)
        if (.not. status%is_ok()) return
        state%t = self%t
        state%y = self%y
        call self%system%remember(state%memory)
        state%integrator = self%integrator
        state%kinks = self%kinks
    end subroutine keep

    !> Stand there again.
    !>
    !> **Errors**: it stands nowhere.
    subroutine put_back(self, state, status)
        class(simulator_type), intent(inout) :: self
        type(simulator_state), intent(in) :: state     !! that this simulator has kept
        type(status_type), intent(inout) :: status

        call need_place(self, status)
        if (.not. status%is_ok()) return
        self%t = state%t
        self%y = state%y
        call self%system%recall(state%memory)
        call recall_integrator(state%integrator, self%integrator)
        self%kinks = state%kinks
    end subroutine put_back

    subroutine need_place(self, status)
        class(simulator_type), intent(in) :: self
        type(status_type), intent(inout) :: status

        if (.not. allocated(self%integrator)) &
            call fail(status, status_bad_input, "the simulator has no valid state after a failed reset "// &
                      "(expected another reset first)")
    end subroutine need_place

    !> Go on to an instant under these forces, for a quarter of a second of computing at most: `read` says how far it got.
    !>
    !> **Errors**: a step that leaves a table, which is not begun; a place beyond which the mechanism cannot be computed; the state
    !> is then that of the last good instant.
    subroutine step(self, t_end, force, status)
        class(simulator_type), intent(inout) :: self
        real(wp), intent(in) :: t_end                  !! [s]
        real(wp), intent(in) :: force(:)               !! of the actuators (n_actuator) [N, N m, V; openings of valves]
        type(status_type), intent(inout) :: status
        real(wp), parameter :: breath = 0.25_wp        !! [s]
        real(wp), parameter :: rounded = 1.0e-9_wp     !! part of a step that instants miss whose steps a caller has added up
        logical :: is_there

        call need_place(self, status)
        if (.not. status%is_ok()) return
        if (all(self%integrator%failed)) then
            call refuse_to_go_on(self, status)
            return
        end if
        call refuse_short_tables(self%heard, self%t, t_end - rounded*(t_end - self%t), "step", status)
        if (.not. status%is_ok()) return
        if (any(force /= self%system%way%given_force)) then
            self%system%way%given_force = force
            call self%integrator%reset()
        end if
        call self%integrator%pause%set(breath)
        call go_to(self, t_end, is_there)
        self%t = merge(max(t_end, self%integrator%t), self%integrator%t, is_there)
        if (any(self%integrator%failed) .or. self%integrator%is_lost) call refuse_to_go_on(self, status)
    end subroutine step

    !> Integrate to t_end, in pieces that end at the kinks on the way. From one that only rounding keeps from t_end no step leads
    !> there.
    subroutine go_to(self, t_end, is_there)
        type(simulator_type), intent(inout) :: self
        real(wp), intent(in) :: t_end                  !! [s]
        logical, intent(out) :: is_there               !! not stopped or paused on the way
        real(wp) :: kink

        is_there = .true.
        do
            kink = next_kink(self%kinks, self%system)
            if (.not. is_there_by(kink, t_end)) exit
            call advance_to(self, kink, is_there)
            if (.not. is_there) return
            call pass_kink(self%kinks, self%system, self%integrator, self%y, kink)
        end do
        if (.not. is_there_by(t_end, self%kinks%passed)) call advance_to(self, t_end, is_there)
        is_there = is_there .and. .not. any(self%integrator%failed)
    end subroutine go_to

    !> Integrate to an instant at which a step ends. Near a dead point the integrator comes back after each step.
    subroutine advance_to(self, t, is_there)
        type(simulator_type), intent(inout) :: self
        real(wp), intent(in) :: t                      !! [s]
        logical, intent(out) :: is_there
        real(wp) :: y_end(lanes, self%system%n)

        do
            self%system%wants_rest = .false.
            call self%integrator%advance(self%system, t, self%y, y_end, t_kink=t)
            if (self%system%wants_rest .and. dead_coordinate(self%system%watch, .false.) > 0) self%integrator%failed = .true.
            if (self%integrator%is_there .or. self%integrator%is_paused .or. any(self%integrator%failed) &
                .or. .not. self%system%wants_rest) exit
        end do
        is_there = self%integrator%is_there .and. .not. (any(self%integrator%failed) .or. self%integrator%is_lost)
    end subroutine advance_to

    !> Why the integrator stopped, in the words of a caller who steps.
    subroutine refuse_to_go_on(self, status)
        type(simulator_type), intent(inout) :: self
        type(status_type), intent(inout) :: status
        character(len=:), allocatable :: why
        integer :: dead, stalled

        call hold_texts()
        select case (self%integrator%reason)
        case (stop_growth)
            why = "the motion grows without bound"
        case (stop_pace)
            why = "the step limit is reached"
            if (size(self%integrator%without_end(1)) > 0) why = without_end_in_words(self%model, self%integrator%without_end(1))
        case (stop_length)
            why = too_long_steps_in_words(self%system, 1, self%integrator%too_long_for(1), self%integrator%good_until(1), &
                                          self%integrator%options%step, self%y)
        case default
            why = failure_at(self%model, self%system%workspace%state, self%system%way%obstacle(1), 1)
            if (self%system%cylinders%culprit > 0 .and. self%system%way%obstacle(1) == sample_undefined) &
                why = end_of_cylinder(self%system%cylinders, self%model)
            if (self%system%watch%is_on) then
                dead = dead_coordinate(self%system%watch, .true.)
                if (dead > 0) why = "coordinate "//quoted(self%model%scene%coordinate(dead)%name)//" comes to its dead point, " &
                    //"where it turns back and the mechanism goes on (expected a coordinate that does not, or a forward run)"
            end if
            stalled = self%system%stalled_coordinate(self%integrator%good_until(1), self%y)
            if (stalled > 0) then
                if (self%system%watch%variable(stalled) == 0) &
                    why = "coordinate "//quoted(self%model%scene%coordinate(stalled)%name)//no_stand_in
            end if
            if (self%system%way%is_driven_through(1)) &
                why = driven_through_in_words(self%model, self%system%way%final_event(1), self%system%way%is_jammed(1))
        end select
        call fail(status, status_bad_input, "the simulation cannot go on beyond t = "//to_text(self%integrator%good_until(1)) &
                  //" s: "//why)
        call release_texts()
    end subroutine refuse_to_go_on

    !> Where the mechanism is.
    subroutine read(self, t, q, qd)
        class(simulator_type), intent(inout) :: self
        real(wp), intent(out) :: t                     !! [s]
        real(wp), intent(out) :: q(:), qd(:)           !! (n_q)
        real(wp), dimension(lanes, size(q)) :: position, rate, acceleration

        t = self%t
        call read_coordinates(self%model, self%system%layout, spread(self%integrator%t, 1, lanes), self%y, self%system%turns, &
                              self%scratch, position, rate, acceleration)
        q = position(1, :)
        qd = rate(1, :)
    end subroutine read

    !> How accelerations change with the state and what drives, where it stands.
    !>
    !> **Errors**: it stands nowhere; what no linearization has.
    subroutine linearize(self, effort, follows_laws, found, status)
        class(simulator_type), intent(inout) :: self
        real(wp), intent(inout) :: effort(:)           !! of the actuators, as for `step`; of those that follow laws, theirs
                                                       !! afterwards
        logical, intent(in) :: follows_laws            !! of those actuators that have one in the scene
        type(linearization), intent(out) :: found
        type(status_type), intent(inout) :: status
        real(wp), dimension(self%model%n_q) :: q, qd
        real(wp) :: t

        call need_place(self, status)
        if (.not. status%is_ok()) return
        call self%read(t, q, qd)
        call linearize_system(self%system, self%law, t, self%y(1, :), q, qd, effort, follows_laws, found, status)
    end subroutine linearize

    !> Cylinders whose pressures are states.
    pure integer function n_cylinder(self)
        class(simulator_type), intent(in) :: self

        n_cylinder = count(self%model%scene%actuator%law%side == side_opening)
    end function n_cylinder

    !> Pressures in its cylinders.
    !>
    !> **Errors**: it stands nowhere.
    subroutine read_pressures(self, pressure, status)
        class(simulator_type), intent(in) :: self
        real(wp), intent(inout) :: pressure(:, :)      !! (chamber, cylinder) [Pa]
        type(status_type), intent(inout) :: status
        integer, allocatable :: at(:)
        integer :: k

        call need_place(self, status)
        if (.not. status%is_ok()) return
        associate (layout => self%system%layout)
            at = cylinders_of(layout)
            do k = 1, size(at)
                pressure(:, k) = pressures_of_state(self%model%scene%actuator(at(k))%cylinder, layout%pressure(at(k)), self%y(1, :))
            end do
        end associate
    end subroutine read_pressures

    subroutine close(self)
        class(simulator_type), intent(inout) :: self

        call leave(self)
        call leave_programs(self%shared)
        if (associated(self%model)) deallocate (self%model)
    end subroutine close
end module linkdyn_simulator
