!> One door to all integrators: advance a lane system from instant to instant, each hit exactly.
module linkdyn_integrator
    use, intrinsic :: iso_fortran_env, only: int64
    use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan
    use linkdyn_crossings, only: step_taken, find_crossing, note_sides, most_pieces
    use linkdyn_far_guards, only: look_afar, look_for_crossing
    use linkdyn_gbs, only: gbs_method
    use linkdyn_interrupt, only: is_interrupted
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_lane_system, only: lane_system
    use linkdyn_ode_gsl, only: ode_gsl, runge_kutta_gsl, has_gsl
    use linkdyn_one_step, only: one_step_method
    use linkdyn_pause, only: pause_type
    use linkdyn_rk4, only: rk4_workspace, rk4_step, rk4_steps, rk4_taken, note_rk4_start, watch_step
    use linkdyn_seulex, only: seulex_method
    use linkdyn_step_control, only: step_control, controlled_step, step_accepted, step_paused, step_too_rough, step_breaks_law
    use linkdyn_status, only: status_type, fail, status_bad_input
    use linkdyn_text, only: to_text, quoted
    use linkdyn_way_gone, only: way_gone_type
    implicit none (type, external)
    private
    public :: integrator_type, integrator_options, recall_integrator, method_rk4, method_rkf45, method_rk8pd, method_msbdf, &
        method_gbs, method_seulex
    public :: default_method, method_name, choose_method, check_options, tightened
    public :: reason_of_solution, stop_none, stop_no_rates, stop_growth, stop_roughness, stop_pace, stop_law, &
        stop_event, stop_length

    integer, parameter :: method_rk4 = 1       !! order 4, fixed step; all lanes
    integer, parameter :: method_rkf45 = 2     !! order 4(5), adaptive
    integer, parameter :: method_rk8pd = 3     !! order 8(9), adaptive
    integer, parameter :: method_msbdf = 4     !! implicit, for stiff systems
    integer, parameter :: method_gbs = 5       !! extrapolation, order and step adaptive, columns on lanes
    integer, parameter :: method_seulex = 6    !! extrapolation of an implicit rule, for stiff systems; columns on lanes
    character(len=6), parameter :: method_name(6) = [character(len=6) :: "rk4", "rkf45", "rk8pd", "msbdf", "gbs", "seulex"]
    integer, parameter :: default_method = merge(method_rk8pd, method_gbs, has_gsl)    !! one that every build has

    !> Steps that a run may take at most: hours, whatever the mechanism.
    real(wp), parameter :: most_steps = 1.0e9_wp

    ! Why a run stops.
    integer, parameter :: stop_none = 0
    integer, parameter :: stop_no_rates = 1        !! the right-hand side cannot be evaluated ahead
    integer, parameter :: stop_growth = 2          !! the solution grows without bound
    integer, parameter :: stop_roughness = 3       !! rounding leaves too few digits
    integer, parameter :: stop_pace = 4            !! more steps are needed than anyone would wait for
    integer, parameter :: stop_law = 5             !! the solution would break the law of the system
    integer, parameter :: stop_event = 6           !! a guard has crossed, and that is its end
    integer, parameter :: stop_length = 7          !! equal steps are too long

    type :: integrator_options
        integer :: method = default_method
        real(wp) :: step = 1.0e-3_wp           !! fixed step (no longer than this); first step tried by the adaptive ones
        real(wp) :: rtol = 1.0e-9_wp           !! local error allowed, relative to y
        real(wp) :: atol = 1.0e-9_wp           !! and absolute: see `linkdyn_way_gone`
        real(wp) :: span = 0                   !! how long the run is to be; 0: not known
        real(wp) :: asked(2) = 0               !! relative and absolute errors that were asked for and are not allowed; 0: they are
    end type integrator_options

    !> A run under way, and its statistics.
    type :: integrator_type
        type(integrator_options) :: options
        real(wp) :: t = 0                      !! reached by the steps
        real(wp) :: next_step = 0              !! proposed
        logical :: is_there = .false.          !! the instant asked for has been reached, or lost
        logical :: is_lost = .false.           !! no solution can be had there, though the run goes on
        logical :: failed(lanes) = .false.     !! stopped for good
        integer :: reason = stop_none          !! why
        real(wp) :: good_until(lanes) = 0      !! instant of the last good y
        integer :: n_step = 0                  !! accepted
        integer :: n_rejected = 0
        integer :: n_evaluation = 0            !! right-hand sides (blocks)
        integer :: n_rough = 0                 !! steps that rounding left with more than the error allowed
        real(wp) :: roughest = 0               !! largest error of these, relative
        real(wp) :: rough_in_all = 0           !! sum of their errors, relative
        logical :: is_paused = .false.         !! `advance` came back before its end: call it again
        type(pause_type) :: pause
        real(wp) :: last_step = 0, shortest_step = huge(1.0_wp), longest_step = 0
        real(wp), private :: length = 0        !! of the run, or of the way asked for, of one that is to be of any length
        integer, private :: n_short = 0        !! steps in a row at which it would not come to its end
        integer, private :: n_still = 0        !! and of these the last of no length at all
        integer, private :: n_jump = 0         !! jumps of the rates before the last step
        integer, private :: n_jumping = 0      !! steps that have come upon some, since `t_jumping`
        real(wp), private :: t_jumping = 0
        integer, private :: rejected_before = 0, evaluated_before = 0    !! by the systems exchanged
        integer, private :: rough_before = 0
        real(wp), private :: rough_in_all_before = 0
        integer(int64), private :: i_step = 0, n_span = 0    !! rk4: steps done, and in all, of the span under way
        real(wp), private :: span_start = 0
        type(rk4_workspace), private :: work
        type(ode_gsl), private :: gsl
        type(step_control), private :: control
        type(way_gone_type), private :: gone                     !! with msbdf
        ! ---- where guards cross (all methods but rk4 look back into the last step for instants of output)
        real(wp), private :: first_t = 0                         !! of the run
        type(controlled_step), private :: taken                  !! the last step
        logical, allocatable, private :: has_crossed(:, :)       !! at its end (lane, n_guard)
        logical, private :: is_at_crossing = .false.             !! whose consequences are still to be drawn
        logical, private :: are_far = .false.                    !! all guards have been, from zero, in the last step
    contains
        procedure :: start, advance, reset, go_on_from, exchange_system, finish
        procedure :: too_long_for, without_end
    end type integrator_type

    !> A step of a multistep method.
    type, extends(step_taken) :: multistep_taken
        real(wp) :: rtol = 0, atol = 0
        type(way_gone_type) :: gone
    contains
        procedure :: retake => retake_multistep
    end type multistep_taken

contains

    !> The method of a name.
    subroutine choose_method(text, method, status)
        character(len=*), intent(in) :: text
        integer, intent(out) :: method
        type(status_type), intent(inout) :: status

        do method = 1, size(method_name)
            if (text == method_name(method)) return
        end do
        method = default_method
        call fail(status, status_bad_input, "method "//quoted(text)// &
                  " is not known (expected rk4, rkf45, rk8pd, msbdf, gbs or seulex)")
    end subroutine choose_method

    !> Refuse what no integrator can work with.
    subroutine check_options(options, status)
        type(integrator_options), intent(in) :: options
        type(status_type), intent(inout) :: status

        if (.not. (options%step > 0 .and. options%step <= huge(1.0_wp))) then
            call fail(status, status_bad_input, "step = "//to_text(options%step)//" (expected a positive time in s)")
        else if (.not. (options%rtol > 0 .and. options%rtol < 1)) then
            call fail(status, status_bad_input, "rtol = "//to_text(options%rtol)//" (expected a number between 0 and 1)")
        else if (.not. (options%atol > 0 .and. options%atol <= huge(1.0_wp))) then
            call fail(status, status_bad_input, "atol = "//to_text(options%atol)//" (expected a positive number)")
        else if (options%method == method_rk4 .and. options%span > most_steps*options%step) then
            call fail(status, status_bad_input, "step = "//to_text(options%step)//" s makes more than " &
                      //to_text(most_steps)//" steps of "//to_text(options%span)//" s (expected a longer step)")
        end if
    end subroutine check_options

    !> Tolerances that steps can be judged by. Looser ones leap over what happens, a change point or a stop, without a trace in the
    !> error that they estimate: of runs through these at 1e-1 to 1e-3 some took another way, of those at 1e-4 none did. The many
    !> small steps of `msbdf` add up what each leaves.
    pure function tightened(options) result(own)
        type(integrator_options), intent(in) :: options
        type(integrator_options) :: own
        real(wp), parameter :: loosest = 1.0e-4_wp, loosest_of_many = 1.0e-5_wp

        own = options
        associate (most => merge(loosest_of_many, loosest, options%method == method_msbdf))
            if (own%rtol > most) own%asked(1) = own%rtol
            if (own%atol > most) own%asked(2) = own%atol
            own%rtol = min(own%rtol, most)
            own%atol = min(own%atol, most)
        end associate
    end function tightened

    !> Begin at t with y. The adaptive methods integrate lane 1 and copy it to the others.
    subroutine start(self, options, system, t, y, status)
        class(integrator_type), intent(inout) :: self
        type(integrator_options), intent(in) :: options
        class(lane_system), intent(inout), target :: system     !! must outlive the run
        real(wp), intent(in) :: t
        real(wp), intent(in) :: y(:, :)                         !! (lane, n)
        type(status_type), intent(inout) :: status

        call check_options(options, status)
        if (.not. status%is_ok()) return
        self%options = options
        self%t = t
        self%good_until = t
        self%first_t = t
        self%next_step = options%step
        call prepare_method(self, system, y, status)
        if (system%n_guard > 0 .and. status%is_ok()) call begin_guards(self, system, y)
    end subroutine start

    !> On which sides guards begin. One that begins at zero has no side yet.
    subroutine begin_guards(self, system, y)
        type(integrator_type), intent(inout) :: self
        class(lane_system), intent(inout) :: system
        real(wp), intent(in) :: y(:, :)

        if (allocated(self%has_crossed)) deallocate (self%has_crossed)
        allocate (self%has_crossed(lanes, system%n_guard), source=.false.)
        self%is_at_crossing = .false.
        self%are_far = .false.
        call note_sides(system, spread(self%t, 1, lanes), y, self%has_crossed)
    end subroutine begin_guards

    !> The method that is asked for, made anew for a system.
    subroutine prepare_method(self, system, y, status)
        type(integrator_type), intent(inout) :: self
        class(lane_system), intent(inout), target :: system
        real(wp), intent(in) :: y(:, :)
        type(status_type), intent(inout) :: status
        integer, parameter :: extrapolated = 30, taken_by_stages = 10  !! evaluations a step, those of rejected ones among them
        type(gbs_method), allocatable :: gbs
        type(seulex_method), allocatable :: seulex
        type(runge_kutta_gsl), allocatable :: runge_kutta

        if (allocated(self%control%method)) then
            call self%control%method%release()
            deallocate (self%control%method)
        end if
        associate (options => self%options, control => self%control)
            system%span = options%span
            system%time_scale = max(options%span, options%step)
            call self%gone%start(y(1, :), system%family, system%beside, system%per_place)
            system%evaluations_a_step = merge(extrapolated, taken_by_stages, any(options%method == [method_gbs, method_seulex]))
            select case (options%method)
            case (method_rk4)
                call self%work%prepare(system%n)
                call self%work%watch_length(system, y)
                return
            case (method_msbdf)
                call self%gsl%start(system, self%next_step, options%rtol, status)
                return
            case (method_gbs)
                allocate (gbs)
                call gbs%start(system%n, options%rtol)
                call move_alloc(gbs, control%method)
            case (method_seulex)
                allocate (seulex)
                call seulex%start(system%n, options%rtol)
                call move_alloc(seulex, control%method)
            case default
                allocate (runge_kutta)
                call runge_kutta%start(trim(method_name(options%method)), system, status)
                call move_alloc(runge_kutta, control%method)
            end select
            call control%start(self%t, y(1, :), self%next_step, options%rtol, options%atol, self%gone)
            self%taken%n_evaluation = 0
        end associate
    end subroutine prepare_method

    !> Go on with another system and y at the last good instant, where the old one may have failed. Equal steps stay
    !> those that they were.
    subroutine exchange_system(self, system, y, status)
        class(integrator_type), intent(inout) :: self
        class(lane_system), intent(inout), target :: system     !! must outlive the run
        real(wp), intent(in) :: y(:, :)                         !! (lane, n)
        type(status_type), intent(inout) :: status

        call count_work(self)
        self%rejected_before = self%n_rejected
        self%evaluated_before = self%n_evaluation
        self%rough_before = self%n_rough
        self%rough_in_all_before = self%rough_in_all
        if (all(self%failed)) then
            if (self%options%method == method_rk4) self%i_step = self%i_step - 1
            self%t = self%good_until(1)
        end if
        self%failed = .false.
        self%reason = stop_none
        self%n_short = 0
        self%n_still = 0
        self%n_jumping = 0
        self%is_at_crossing = self%is_at_crossing .and. system%n_guard > 0
        self%are_far = .false.
        if (.not. (self%next_step > 0 .and. self%next_step <= huge(1.0_wp))) self%next_step = self%options%step
        call prepare_method(self, system, y, status)
    end subroutine exchange_system

    !> Rejected steps and right-hand sides, which the adaptive methods count themselves.
    subroutine count_work(self)
        type(integrator_type), intent(inout) :: self

        select case (self%options%method)
        case (method_rk4)
        case (method_msbdf)
            self%n_rejected = self%rejected_before + self%gsl%n_rejected()
            self%n_evaluation = self%evaluated_before + self%gsl%n_evaluation()
        case default
            self%n_rejected = self%rejected_before + self%control%n_rejected
            self%n_evaluation = self%evaluated_before + self%control%count_evaluations() + self%taken%n_evaluation
            self%n_rough = self%rough_before + self%control%n_rough
            self%roughest = max(self%roughest, self%control%roughest)
            self%rough_in_all = self%rough_in_all_before + self%control%rough_in_all
        end select
    end subroutine count_work

    !> Go on to t_end; a lane that cannot keeps its last good y. Methods of one step that choose its length pass t_end, and look
    !> back into the step: so instants of output, however many, do not change the way. Where the clock says so, or the system
    !> wants a rest, the call comes back before it is there.
    subroutine advance(self, system, t_end, y, y_end, t_kink)
        class(integrator_type), intent(inout) :: self
        class(lane_system), intent(inout) :: system
        real(wp), intent(in) :: t_end
        real(wp), intent(inout), contiguous :: y(:, :)                      !! at self%t (lane, n)
        real(wp), intent(inout) :: y_end(:, :)                  !! at t_end, if it is there and not lost (lane, n)
        real(wp), intent(in), optional :: t_kink                !! t_end or later: steps end there and do not pass it

        self%is_paused = .false.
        self%is_there = .false.
        self%is_lost = .false.
        if (all(self%failed)) return
        self%length = self%options%span
        if (.not. self%length > 0) self%length = t_end - self%t
        select case (self%options%method)
        case (method_rk4)
            if (t_end > self%t) call advance_rk4(self, system, t_end, y)
            self%is_there = self%t >= t_end
            y_end = y
        case (method_msbdf)
            call advance_multistep(self, system, t_end, y)
            self%is_there = self%t >= t_end
            y_end = y
        case default
            call advance_controlled(self, system, t_end, y, y_end, t_kink)
        end select
    end subroutine advance

    !> Equal steps no longer than the one asked for.
    subroutine advance_rk4(self, system, t_end, y)
        type(integrator_type), intent(inout) :: self
        class(lane_system), intent(inout) :: system
        real(wp), intent(in) :: t_end
        real(wp), intent(inout), contiguous :: y(:, :)
        real(wp), parameter :: slack = 1.0e-6_wp    !! of a step: a span that is a whole number of steps but for rounding
        integer(int64), parameter :: most_at_once = 200    !! steps of large mechanisms then take milliseconds
        real(wp) :: h, instant(lanes)
        logical :: failed(lanes)
        integer :: k, n_jump

        if (self%i_step == self%n_span) then
            self%span_start = self%t
            if ((t_end - self%t)/self%options%step > 1/epsilon(h)) then
                self%failed = .true.            ! the clock would stand still
                return
            end if
            self%n_span = max(1_int64, ceiling((t_end - self%t)/self%options%step - slack, int64))
            self%i_step = 0
        end if
        h = (t_end - self%span_start)/self%n_span
        do while (self%i_step < self%n_span)
            if (must_pause(self)) return
            system%is_idle = self%failed
            if (system%n_guard > 0) then
                call step_watching(self, system, h, t_end, y)
                if (all(self%failed) .or. system%wants_rest) return
                cycle
            end if
            n_jump = system%n_jump
            call rk4_steps(system, self%t, h, int(min(self%n_span - self%i_step, most_at_once)), y, self%work, failed)
            call self%pause%note_work()
            self%n_evaluation = self%n_evaluation + 4*self%work%steps%n
            if (any(self%failed)) then
                do k = 1, system%n
                    y(:, k) = merge(self%work%begin(:, k), y(:, k), self%failed)
                end do
            end if
            self%failed = self%failed .or. failed
            self%n_step = self%n_step + self%work%steps%n - 1          ! the last is noted when it has been accepted
            self%i_step = self%i_step + self%work%steps%n
            self%t = self%span_start + self%i_step*h
            if (self%i_step == self%n_span) self%t = t_end
            if (self%work%steps%n > 1) where (.not. self%failed) self%good_until = self%span_start + (self%i_step - 1)*h
            if (all(self%failed)) self%reason = reason_of_solution(y(1, :))
            if (all(self%failed)) call tell_length(self)
            if (all(self%failed)) return
            if (self%work%steps%is_accepted) then
                call undo_steps(self, self%work%steps%is_broken, self%work%begin, y)
            else
                instant = self%t
                call system%accept(instant, y, .not. self%failed)
                call undo_broken_steps(self, system, n_jump, self%work%begin, y)
            end if
            if (all(self%failed)) return
            where (.not. self%failed) self%good_until = self%t
            call take_turns_off(self, system, y)
            call note_step(self, h)
            self%failed = self%failed .or. self%work%steps%watch%is_too_long
            if (all(self%failed)) call tell_length(self)
            if (system%wants_rest .or. all(self%failed)) return
        end do
    end subroutine advance_rk4

    !> A run has come to its end since its steps are too long, if it has.
    pure subroutine tell_length(self)
        type(integrator_type), intent(inout) :: self

        if (self%work%steps%watch%is_too_long(1)) self%reason = stop_length
    end subroutine tell_length

    !> The component that a lane's steps have been too long for; 0: they were not.
    pure elemental integer function too_long_for(self, lane) result(component)
        class(integrator_type), intent(in) :: self
        integer, intent(in) :: lane

        component = 0
        if (self%work%steps%watch%is_too_long(lane)) component = self%work%steps%watch%component(lane)
    end function too_long_for

    !> Lanes that a step has led against the law of the system stay where they were. Where rates jump nothing is said: the stages
    !> of a step weigh the energy of both sides.
    subroutine undo_broken_steps(self, system, n_jump, kept, y)
        type(integrator_type), intent(inout) :: self
        class(lane_system), intent(inout) :: system
        integer, intent(in) :: n_jump                           !! of the system, before the step
        real(wp), intent(in) :: kept(:, :)                      !! solution there (lane, n)
        real(wp), intent(inout) :: y(:, :)                      !! after it

        if (system%n_jump > n_jump) return
        call undo_steps(self, system%has_broken_law(), kept, y)
    end subroutine undo_broken_steps

    !> Lanes stay where they were.
    subroutine undo_steps(self, are_broken, kept, y)
        type(integrator_type), intent(inout) :: self
        logical, intent(in) :: are_broken(lanes)
        real(wp), intent(in) :: kept(:, :)                      !! solution there (lane, n)
        real(wp), intent(inout) :: y(:, :)                      !! after it
        logical :: is_broken(lanes)
        integer :: k

        is_broken = are_broken .and. .not. self%failed
        if (.not. any(is_broken)) return
        do k = 1, size(y, 2)
            where (is_broken) y(:, k) = kept(:, k)
        end do
        self%failed = self%failed .or. is_broken
        if (all(self%failed)) self%reason = stop_law
    end subroutine undo_steps

    !> One of the equal steps, in parts where guards cross: each lane has its own.
    subroutine step_watching(self, system, h, t_end, y)
        type(integrator_type), intent(inout) :: self
        class(lane_system), intent(inout) :: system
        real(wp), intent(in) :: h, t_end
        real(wp), intent(inout), contiguous :: y(:, :)
        integer, parameter :: most_parts = 1000        !! of one step: guards that cross more often do so without end
        integer, parameter :: most_idle = 30           !! of them without getting on
        type(rk4_taken) :: taken
        real(wp), dimension(lanes) :: t, length, share
        logical, dimension(lanes) :: failed, is_moving, is_hit, has_changed, is_over
        real(wp) :: t_next, t_before(lanes)
        integer :: part, k, n_idle, n_jump

        t_next = self%span_start + (self%i_step + 1)*h
        if (self%i_step + 1 == self%n_span) t_next = t_end
        t = self%t
        length = merge(0.0_wp, h, self%failed)
        is_over = .false.
        n_idle = 0
        taken%is_one = system%lanes_are_one
        do part = 1, most_parts
            t_before = t
            is_moving = length > 0 .and. .not. self%failed
            if (.not. any(is_moving)) exit
            call note_rk4_start(system, t, length, y, self%work, taken)
            n_jump = system%n_jump
            call rk4_step(system, t, length, y, self%work, failed)
            call watch_step(self%work, is_moving, length, y, failed)
            self%n_evaluation = self%n_evaluation + 5
            taken%rate = self%work%first
            call self%pause%note_work()
            do k = 1, system%n
                where (.not. is_moving) y(:, k) = taken%y(:, k)
            end do
            self%failed = self%failed .or. (failed .and. is_moving)
            taken%y_end = y
            call look_through_rk4(self, system, taken, share)
            is_moving = is_moving .and. .not. self%failed
            do k = 1, system%n_guard
                self%has_crossed(:, k) = self%has_crossed(:, k) .and. is_moving
            end do
            is_hit = any(self%has_crossed, dim=2)
            where (.not. is_hit) share = 1
            call self%work%steps%watch%forget(is_hit)
            call taken%retake(system, share, y)
            t = t + share*length
            where (.not. is_hit .and. is_moving) t = t_next
            call system%accept(t, y, is_moving)
            call undo_broken_steps(self, system, n_jump, taken%y, y)
            is_moving = is_moving .and. .not. self%failed
            is_hit = is_hit .and. is_moving
            do k = 1, system%n_guard
                self%has_crossed(:, k) = self%has_crossed(:, k) .and. is_moving
            end do
            where (is_moving) self%good_until = t
            has_changed = .false.
            is_over = .false.
            if (any(is_hit)) then
                call system%show_side(t, y, is_behind=.false.)
                call system%meet_crossings(t, y, self%has_crossed, has_changed, is_over)
                if (any(has_changed)) call system%accept(t, y, has_changed)
                do k = 1, system%n
                    where (has_changed) self%work%rest(:, k) = 0
                end do
                self%failed = self%failed .or. is_over
                if (any(is_over)) self%reason = stop_event
            end if
            if (.not. self%are_far) call note_sides(system, t, y, self%has_crossed)
            if (any(is_hit)) call system%show_side(t, y, is_behind=.true.)
            call take_turns_off(self, system, y)
            length = merge(t_next - t, 0.0_wp, is_hit)
            n_idle = merge(0, n_idle + 1, any(t > t_before))
            if (n_idle > most_idle) exit
        end do
        where (length > 0) self%failed = .true.
        if (any(length > 0 .and. .not. is_over)) self%reason = stop_pace
        self%i_step = self%i_step + 1
        self%t = t_next
        if (all(self%failed)) then
            if (self%reason == stop_none) self%reason = reason_of_solution(y(1, :))
            call tell_length(self)
            self%t = maxval(self%good_until)
            return
        end if
        call note_step(self, h)
    end subroutine step_watching

    !> Where guards cross in a part of the equal steps, whose end is known but for the rates there.
    subroutine look_through_rk4(self, system, taken, share)
        type(integrator_type), intent(inout) :: self
        class(lane_system), intent(inout) :: system
        type(rk4_taken), intent(inout) :: taken
        real(wp), intent(out) :: share(lanes)                   !! of it, just behind the first crossing; 1: there is none
        logical :: failed(lanes)
        real(wp) :: rate(system%n)

        if (taken%is_one) then
            call system%evaluate_alone(taken%t(1) + taken%length(1), taken%y_end(1, :), rate, failed(1))
            taken%rate_end = spread(rate, 1, lanes)
            failed = failed(1)
        else
            call system%evaluate(taken%t + taken%length, taken%y_end, taken%rate_end, failed)
        end if
        self%are_far = .false.
        if (.not. any(failed)) call look_afar(system, taken, 1, self%are_far)
        self%n_evaluation = self%n_evaluation + taken%n_evaluation
        taken%n_evaluation = 0
        share = 1
        self%has_crossed = .false.
        if (.not. self%are_far) call find_crossing(system, taken, share, self%has_crossed)
    end subroutine look_through_rk4

    !> Steps of a method that controls them itself, each cut where it would lead beyond t_end.
    subroutine advance_multistep(self, system, t_end, y)
        type(integrator_type), intent(inout) :: self
        class(lane_system), intent(inout) :: system
        real(wp), intent(in) :: t_end
        real(wp), intent(inout) :: y(:, :)
        integer, parameter :: most_unsound = 5         !! steps tried from one place
        real(wp), parameter :: fine = 1.0e-4_wp        !! at a coarser tolerance shorter steps, each allowed its error, add up to
                                                       !! what ends the run now
        real(wp) :: h, h_seen, t_before, t_next, solution(size(y, 2)), kept(lanes, size(y, 2))
        logical :: ok, is_sound
        integer :: n_jump, n_unsound

        solution = y(1, :)
        n_unsound = 0
        do while (self%t < t_end)
            if (must_pause(self)) exit
            h = self%next_step
            t_before = self%t
            kept = y
            n_jump = system%n_jump
            t_next = end_of_looking(self, system, t_end)
            call self%gsl%take_step(self%t, t_next, h, solution, self%gone%absolute_error(solution, self%options%atol), ok)
            call self%pause%note_work()
            if (.not. ok .and. is_interrupted()) then
                self%t = t_before
                self%is_paused = .true.
                call self%gsl%reset()
                exit
            end if
            if (.not. ok .or. .not. all(abs(solution) <= huge(1.0_wp)) .or. self%t <= t_before) then
                self%t = t_before
                self%failed = .true.
                self%reason = reason_of_solution(y(1, :))
                exit
            end if
            h_seen = length_in_sight(system, t_before, self%t, y(1, :), solution)
            if (h_seen < self%t - t_before) then
                self%t = t_before
                solution = y(1, :)
                self%next_step = h_seen
                call self%gsl%reset()
                cycle
            end if
            if (system%n_guard > 0) call look_through(self, system, t_before, y, solution)
            is_sound = keeps_law(self, system, solution)
            n_unsound = merge(0, n_unsound + 1, is_sound .or. system%n_jump > n_jump)
            if (leads_back(self, system, solution) .or. &
                (self%options%rtol <= fine .and. modulo(n_unsound, most_unsound) > 0)) then
                call take_back(self, t_before, y, solution)
                cycle
            end if
            call go_on(self, system, solution, self%t - t_before, y)
            call self%gone%note(solution)
            if (.not. (is_sound .or. all(self%failed))) call undo_broken_steps(self, system, n_jump, kept, y)
            if (all(self%failed) .and. self%reason == stop_law) self%good_until = t_before
            if (all(self%failed)) exit
            if (self%is_at_crossing) then
                call meet(self, system, y)
            else if (system%n_guard > 0 .and. .not. self%are_far) then
                call note_sides(system, spread(self%t, 1, lanes), y, self%has_crossed)
            end if
            if (system%n_guard > 0) solution = y(1, :)
            if (all(self%failed)) exit
            ! A step cut short by where it had to end says nothing against the longer one proposed before.
            if (self%t >= t_next .and. self%last_step < self%next_step) h = max(h, self%next_step)
            self%next_step = h
            if (system%wants_rest .or. all(self%failed)) exit
        end do
        call count_work(self)
    end subroutine advance_multistep

    !> A step of the multistep method is none. Its Newton iteration keeps a Jacobian for fifty steps; once f hardly depends on y
    !> any more, one of stiffer times makes corrections of next to nothing, and the history is taken for the solution. Begun anew
    !> the method has a Jacobian of here.
    subroutine take_back(self, t_before, y, solution)
        type(integrator_type), intent(inout) :: self
        real(wp), intent(in) :: t_before
        real(wp), intent(in) :: y(:, :)                         !! there (lane, n)
        real(wp), intent(out) :: solution(:)
        real(wp), parameter :: shorter = 0.2_wp

        self%next_step = shorter*(self%t - t_before)
        self%t = t_before
        solution = y(1, :)
        self%is_at_crossing = .false.
        call self%gsl%reset()
    end subroutine take_back

    !> How long a step may be whose stages leap over nothing that the system does within it.
    real(wp) function length_in_sight(system, t, t_end, y, y_end) result(length)
        class(lane_system), intent(inout) :: system
        real(wp), intent(in) :: t, t_end
        real(wp), intent(in) :: y(:), y_end(:)                  !! there (n)
        real(wp), parameter :: whole_step = 1                   !! the multistep method looks at its end alone
        real(wp) :: rate(size(y)), rate_end(size(y))
        logical :: has_failed(2)

        length = t_end - t
        if (.not. system%may_leap) return
        call system%evaluate_alone(t, y, rate, has_failed(1))
        call system%evaluate_alone(t_end, y_end, rate_end, has_failed(2))
        if (.not. any(has_failed)) length = length*system%part_in_sight(t, length, whole_step, y, rate, y_end, rate_end)
    end function length_in_sight

    !> Does a step to a solution keep the law of the system as far as the tolerances ask? The first steps of the multistep method,
    !> which are of low order, do so by no more.
    logical function keeps_law(self, system, solution)
        type(integrator_type), intent(in) :: self
        class(lane_system), intent(inout) :: system
        real(wp), intent(in) :: solution(:)                     !! at self%t
        real(wp) :: allowed(size(solution))

        allowed = self%gone%absolute_error(solution, self%options%atol) + self%options%rtol*abs(solution)
        keeps_law = .not. system%broken_law(self%t, solution, 4*spacing(solution), allowed) > 1
    end function keeps_law

    !> Does a step to a solution end where no way from the accepted one leads? A shorter one is to be taken.
    logical function leads_back(self, system, solution)
        type(integrator_type), intent(in) :: self
        class(lane_system), intent(inout) :: system
        real(wp), intent(in) :: solution(:)                     !! at self%t
        real(wp) :: rate(size(solution))
        logical :: failed

        leads_back = .false.
        if (.not. system%looks_at_ends) return
        call system%evaluate_alone(self%t, solution, rate, failed)
        if (.not. failed) leads_back = system%leads_too_far(self%t)
    end function leads_back

    !> A step of the multistep method, looked through by another one that takes parts of it from its beginning, at the same
    !> tolerances. Where guards cross the step ends. The two methods come to different ends, as the tolerances allow: a crossing
    !> that lies between these would leave the solution behind it, and be met again and again. So a step that seems to cross is the
    !> other method's to its end.
    subroutine look_through(self, system, t_before, y, solution)
        type(integrator_type), intent(inout) :: self
        class(lane_system), intent(inout) :: system
        real(wp), intent(in) :: t_before
        real(wp), intent(in) :: y(:, :)                         !! before the step
        real(wp), intent(inout) :: solution(:)                  !! after it
        type(multistep_taken) :: taken
        real(wp) :: rate(size(solution)), by_other(lanes, size(solution))
        real(wp) :: share(lanes)
        logical :: failed
        integer :: n_part

        taken%is_one = .true.
        taken%t = t_before
        taken%length = self%t - t_before
        taken%rtol = self%options%rtol
        taken%atol = self%options%atol
        taken%gone = self%gone
        taken%y = y
        taken%y_end = spread(solution, 1, lanes)
        call system%evaluate_alone(t_before, y(1, :), rate, failed)
        taken%rate = spread(rate, 1, lanes)
        call system%evaluate_alone(self%t, solution, rate, failed)
        taken%rate_end = spread(rate, 1, lanes)
        self%is_at_crossing = .false.
        n_part = parts_to_look_at(self, taken%length(1))
        call look_for_crossing(system, taken, n_part, share, self%has_crossed, self%are_far)
        if (self%are_far) return                                ! the end of the step is what has been evaluated last
        if (any(self%has_crossed)) then
            call solve_part(taken, system, 1.0_wp, by_other)
            if (all(abs(by_other) <= huge(1.0_wp))) then
                taken%y_end = by_other
                call system%evaluate_alone(self%t, by_other(1, :), rate, failed)
                taken%rate_end = spread(rate, 1, lanes)
                call find_crossing(system, taken, share, self%has_crossed, n_part)
            end if
            call taken%retake(system, share, taken%y_end)
            solution = taken%y_end(1, :)
            if (share(1) < 1) self%t = t_before + share(1)*taken%length(1)
            call self%gsl%reset()                               ! which stands where its own step had ended
        end if
        self%is_at_crossing = any(self%has_crossed)
        call system%evaluate_alone(self%t, solution, rate, failed)
    end subroutine look_through

    subroutine retake_multistep(self, system, share, y)
        class(multistep_taken), intent(inout) :: self
        class(lane_system), intent(inout) :: system
        real(wp), intent(in) :: share(lanes)
        real(wp), intent(out) :: y(:, :)

        y = self%y_end
        if (share(1) < 1) call solve_part(self, system, share(1), y)
    end subroutine retake_multistep

    !> The solution at a part of a step, or at its end, by the method that looks through it.
    subroutine solve_part(self, system, share, y)
        class(multistep_taken), intent(in) :: self
        class(lane_system), intent(inout) :: system
        real(wp), intent(in) :: share
        real(wp), intent(out) :: y(:, :)                        !! not a number where it cannot be had
        type(seulex_method), allocatable :: seulex
        type(step_control) :: control
        type(pause_type) :: never
        real(wp) :: t_end
        integer :: outcome

        y = self%y
        t_end = self%t(1) + share*self%length(1)
        if (.not. t_end > self%t(1)) return
        allocate (seulex)
        call seulex%start(system%n, self%rtol)
        call move_alloc(seulex, control%method)
        call control%start(self%t(1), self%y(1, :), t_end - self%t(1), self%rtol, self%atol, self%gone)
        do while (control%t < t_end)
            call control%take_step(system, t_end, t_end, never, outcome)
            if (outcome /= step_accepted) exit
        end do
        y = spread(control%y, 1, lanes)
        if (control%t < t_end) y = ieee_value(1.0_wp, ieee_quiet_nan)
    end subroutine solve_part

    !> Draw the consequences of crossings at the instant reached.
    subroutine meet(self, system, y)
        type(integrator_type), intent(inout) :: self
        class(lane_system), intent(inout) :: system
        real(wp), intent(inout) :: y(:, :)
        logical, dimension(lanes) :: has_changed, is_over
        real(wp) :: instant(lanes)

        instant = self%t
        self%is_at_crossing = .false.
        self%are_far = .false.
        call system%show_side(instant, y, is_behind=.false.)
        call system%meet_crossings(instant, y, self%has_crossed, has_changed, is_over)
        if (has_changed(1)) then
            call system%accept(instant, y, has_changed)
            if (self%options%method == method_msbdf) then
                call self%gsl%reset()
                self%next_step = min(self%next_step, self%options%step)
            else
                call self%control%exchange_solution(y(1, :))
            end if
        end if
        call note_sides(system, instant, y, self%has_crossed)
        call system%show_side(instant, y, is_behind=.true.)
        self%failed = is_over
        if (all(is_over)) self%reason = stop_event
    end subroutine meet

    !> Steps as long as their error allows and guards do not cross, until one has reached t_end; the solution there is told from
    !> the last step. So instants of output change neither steps nor crossings. The last step ends with the run, and where there
    !> are guards none is so long a part of it that what they do between its places would go unseen.
    subroutine advance_controlled(self, system, t_end, y, y_end, t_kink)
        type(integrator_type), intent(inout), target :: self
        class(lane_system), intent(inout) :: system
        real(wp), intent(in) :: t_end
        real(wp), intent(inout) :: y(:, :), y_end(:, :)
        real(wp), intent(in), optional :: t_kink
        real(wp) :: limit, t_last, t_next, t_before, turns(lanes, system%n)
        integer :: outcome

        limit = huge(limit)
        if (present(t_kink)) limit = t_kink
        t_last = max(t_end, self%first_t + self%options%span)
        if (t_last - t_end <= 4*spacing(t_end)) t_last = t_end
        t_last = min(t_last, limit)
        do
            if (must_pause(self)) exit
            if (self%t >= t_end) then
                y_end = y
                if (self%t > t_end) call self%taken%look_within(system, t_end, y_end)
                self%is_there = .true.
                self%is_lost = .not. all(abs(y_end(1, :)) <= huge(1.0_wp))
                call self%pause%note_work()
                exit
            end if
            if (self%is_at_crossing) call meet(self, system, y)
            if (all(self%failed)) exit
            call self%control%begin_taken(system, self%taken)
            t_before = self%t
            t_next = end_of_looking(self, system, t_last)
            call self%control%take_step(system, t_next, limit, self%pause, outcome)
            self%is_paused = outcome == step_paused
            if (self%is_paused) exit
            if (outcome /= step_accepted) then
                self%failed = .true.
                self%reason = reason_of_solution(y(1, :))
                if (outcome == step_too_rough) self%reason = stop_roughness
                if (outcome == step_breaks_law) self%reason = stop_law
                exit
            end if
            call self%control%end_taken(self%taken)
            if (system%n_guard > 0) call end_at_crossing(self, system)
            self%t = self%control%t
            self%next_step = self%control%next
            turns = 0
            if (allocated(system%turns)) turns = system%turns
            call go_on(self, system, self%control%y, self%t - t_before, y)
            if (allocated(system%turns)) call self%taken%lose_turns(system%turns(1, :) - turns(1, :))
            call show_within(self, system)
            if (system%n_guard > 0 .and. .not. (self%is_at_crossing .or. self%are_far)) &
                call note_sides(system, spread(self%t, 1, lanes), y, self%has_crossed)
            if ((system%wants_rest .and. self%t < t_end) .or. all(self%failed)) exit
        end do
        call count_work(self)
    end subroutine advance_controlled

    !> Show the system the solution within the step, at as many places as it wants. The steps do not feel it.
    subroutine show_within(self, system)
        type(integrator_type), intent(inout) :: self
        class(lane_system), intent(inout) :: system
        real(wp), allocatable :: t(:), y(:, :)                  ! (place), (place, n)
        integer :: n, i

        do
            n = system%looks_wanted()
            if (n == 0 .or. is_interrupted()) return
            t = self%taken%t(1) + ([(i, i=1, n)]/(n + 1.0_wp))*self%taken%length(1)
            allocate (y(n, system%n))
            call self%taken%look_along(system, t, y)
            call system%see_within(t, y)
            deallocate (y)
        end do
    end subroutine show_within

    !> Where a step ends at the latest, so that what guards do between its places is seen. Where all were far from zero in the last
    !> one it may be as long as it can be looked at by its pieces.
    pure real(wp) function end_of_looking(self, system, t_last) result(t_next)
        type(integrator_type), intent(in) :: self
        class(lane_system), intent(in) :: system
        real(wp), intent(in) :: t_last                          !! where it ends at the latest anyway

        t_next = t_last
        if (system%n_guard > 0 .and. self%options%span > 0) &
            t_next = min(t_last, self%t + part_seen(self)*merge(most_pieces, 1, self%are_far))
    end function end_of_looking

    !> How long a step may be that is looked at in one piece: less than that of the run.
    pure real(wp) function part_seen(self)
        type(integrator_type), intent(in) :: self
        integer, parameter :: fewest_pieces = 50                !! of a run

        part_seen = self%options%span/fewest_pieces
    end function part_seen

    !> In how many pieces a step is to be looked at.
    pure integer function parts_to_look_at(self, length) result(n)
        type(integrator_type), intent(in) :: self
        real(wp), intent(in) :: length
        real(wp), parameter :: slack = 1.0e-6_wp

        n = 1
        if (self%options%span > 0) n = max(1, min(most_pieces, ceiling(length/part_seen(self) - slack)))
    end function parts_to_look_at

    !> A step in which guards cross ends there.
    subroutine end_at_crossing(self, system)
        type(integrator_type), intent(inout) :: self
        class(lane_system), intent(inout) :: system
        real(wp) :: share(lanes)

        call look_for_crossing(system, self%taken, parts_to_look_at(self, self%taken%length(1)), share, self%has_crossed, &
                               self%are_far)
        self%is_at_crossing = any(self%has_crossed)
        if (.not. self%are_far) call self%control%shorten(system, self%taken, share(1))
    end subroutine end_at_crossing

    !> From an accepted step to the next.
    subroutine go_on(self, system, solution, h, y)
        type(integrator_type), intent(inout) :: self
        class(lane_system), intent(inout) :: system
        real(wp), intent(in) :: solution(:)
        real(wp), intent(in) :: h                               !! the step
        real(wp), intent(inout) :: y(:, :)
        integer, parameter :: most_short = 100                  !! in a row: more than a peak takes
        integer, parameter :: most_still = 20                   !! and more than what happens at an instant follows on itself there
        integer :: k

        do k = 1, size(solution)
            y(:, k) = solution(k)
        end do
        call system%accept(spread(self%t, 1, lanes), y, .not. self%failed)
        call take_turns_off(self, system, y)
        self%good_until = self%t
        call note_step(self, h)
        self%n_short = merge(self%n_short + 1, 0, h*most_steps < self%length)
        self%n_still = merge(self%n_still + 1, 0, .not. h > 0)
        if (self%n_short <= most_short .and. self%n_still <= most_still + 2*system%n_guard &
            .and. .not. crawls_over_jumps(self, system)) return
        self%failed = .true.
        self%reason = stop_pace
    end subroutine go_on

    !> What guards do at an instant beyond which no step leads, on a lane: it follows on itself there without end.
    function without_end(self, lane) result(guard)
        class(integrator_type), intent(in) :: self
        integer, intent(in) :: lane
        integer, allocatable :: guard(:)
        integer :: k

        guard = [integer ::]
        if (self%reason == stop_pace .and. self%n_still > 0 .and. allocated(self%has_crossed)) &
            guard = pack([(k, k=1, size(self%has_crossed, 2))], self%has_crossed(lane, :))
    end function without_end

    !> Do the rates jump to and fro, step by step, and the solution hardly comes on?
    logical function crawls_over_jumps(self, system) result(crawls)
        type(integrator_type), intent(inout) :: self
        class(lane_system), intent(in) :: system
        integer, parameter :: n_looked_at = 100
        real(wp), parameter :: most_jumps = 1.0e7_wp            !! of a run: hours, since each takes some dozens of steps

        crawls = .false.
        if (system%n_jump == self%n_jump) return
        self%n_jump = system%n_jump
        if (self%n_jumping == 0) self%t_jumping = self%t
        self%n_jumping = self%n_jumping + 1
        if (self%n_jumping <= n_looked_at) return
        self%n_jumping = 0
        crawls = (self%t - self%t_jumping)*most_jumps < n_looked_at*self%length
    end function crawls_over_jumps

    !> Angles go on without the whole turns that they have made, so that they round as those of the first turn do. The
    !> history of a multistep method stands in the way of it.
    subroutine take_turns_off(self, system, y)
        type(integrator_type), intent(inout) :: self
        class(lane_system), intent(inout) :: system
        real(wp), intent(inout) :: y(:, :)                      !! (lane, n)
        integer :: k

        select case (self%options%method)
        case (method_rk4)
            call self%work%take_turns_off(system, y)
        case (method_msbdf)
        case default
            call self%control%take_turns_off(system)
            do k = 1, size(y, 2)
                y(:, k) = self%control%y(k)
            end do
        end select
    end subroutine take_turns_off

    !> No step, however short, leads on from a solution: because of its size?
    pure integer function reason_of_solution(solution) result(reason)
        real(wp), intent(in) :: solution(:)
        real(wp), parameter :: beyond_measure = 1.0e30_wp

        reason = merge(stop_growth, stop_no_rates, any(abs(solution) > beyond_measure))
    end function reason_of_solution

    !> Has the caller's time run out?
    logical function must_pause(self)
        type(integrator_type), intent(inout) :: self

        self%is_paused = self%pause%is_due()
        must_pause = self%is_paused
    end function must_pause

    subroutine note_step(self, h)
        type(integrator_type), intent(inout) :: self
        real(wp), intent(in) :: h

        self%n_step = self%n_step + 1
        self%last_step = h
        self%shortest_step = min(self%shortest_step, h)
        self%longest_step = max(self%longest_step, h)
    end subroutine note_step

    !> Go on from another y at the instant reached, where something has happened that no guard tells.
    subroutine go_on_from(self, system, y)
        class(integrator_type), intent(inout) :: self
        class(lane_system), intent(inout) :: system
        real(wp), intent(in) :: y(:, :)                         !! (lane, n)
        logical :: has_crossed(lanes, system%n_guard)

        call system%accept(spread(self%t, 1, lanes), y, .not. self%failed)
        select case (self%options%method)
        case (method_rk4)
            self%work%rest = 0
            call self%work%steps%watch%forget(spread(.true., 1, lanes))
        case (method_msbdf)
            self%next_step = min(self%next_step, self%options%step)
        case default
            call self%control%exchange_solution(y(1, :))
        end select
        has_crossed = .false.
        if (system%n_guard > 0) call note_sides(system, spread(self%t, 1, lanes), y, has_crossed)
        call self%reset()
    end subroutine go_on_from


    !> Be what an integrator of the same system was when it was copied. What lies outside of Fortran stays: steppers there remember
    !> nothing, but the multistep method begins its history anew.
    subroutine recall_integrator(copy, self)
        type(integrator_type), intent(in) :: copy
        type(integrator_type), intent(inout) :: self
        class(one_step_method), allocatable :: method
        type(ode_gsl) :: gsl

        call move_alloc(self%control%method, method)
        gsl = self%gsl
        self = copy
        self%gsl = gsl
        if (self%options%method == method_msbdf) call self%gsl%reset()
        if (.not. allocated(method)) return
        if (method%is_of_fortran()) return
        method%n_evaluation = copy%control%method%n_evaluation
        call move_alloc(method, self%control%method)
    end subroutine recall_integrator

    !> The right-hand side has a kink at the instant reached.
    subroutine reset(self)
        class(integrator_type), intent(inout) :: self

        select case (self%options%method)
        case (method_rk4)
            call self%work%steps%watch%forget(spread(.true., 1, lanes))
        case (method_msbdf)
            call self%gsl%reset()
        case default
            call self%control%forget()
        end select
    end subroutine reset

    subroutine finish(self)
        class(integrator_type), intent(inout) :: self

        call self%gsl%release()
        if (allocated(self%control%method)) call self%control%method%release()
    end subroutine finish
end module linkdyn_integrator
