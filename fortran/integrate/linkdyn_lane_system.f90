!> A system of ordinary differential equations on lanes: all that the integrators know of what they integrate.
module linkdyn_lane_system
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_step_length, only: length_watch
    implicit none (type, external)
    private
    public :: lane_system, lane_way, whole_steps

    !> What solutions keep of the way that they have come, beside y.
    type :: lane_way
        logical :: wants_rest = .false.                   !! the integrator comes back to its caller after the step accepted
        real(wp), allocatable :: turns(:, :)              !! not in the y that the steps go on with; there if `is_angle` is
                                                          !! (lane, n)
        real(wp) :: mode(lanes) = 0                       !! a number that changes where f jumps, at the last `evaluate`
        integer :: n_jump = 0                             !! how often it did
        real(wp), allocatable :: guard_side(:, :)         !! sign of a guard at the accepted state; 0: none yet (lane, n_guard)
        real(wp), allocatable :: guard_scale(:, :)        !! its largest size so far (lane, n_guard)
        logical, allocatable :: guard_is_fresh(:, :)      !! it has crossed at the accepted state: zero but for rounding (lane,
                                                          !! n_guard)
    end type lane_way

    !> What has become of equal steps that a system takes by itself.
    type :: whole_steps
        integer :: n = 0                                  !! taken: all but the last have been accepted, too
        logical :: is_accepted = .false.                  !! so has the last
        logical :: is_broken(lanes) = .false.             !! if it has: it breaks the law of the system, see `has_broken_law`
        logical :: is_sure(lanes) = .false.               !! if none was taken: lanes whose step may be taken, and leads here:
        real(wp), allocatable :: y(:, :), rest(:, :)      !! (lane, n)
        type(length_watch) :: watch                       !! on all that are taken, by whomever
    end type whole_steps

    !> dy/dt = f(t, y), `lanes` solutions side by side.
    type, abstract, extends(lane_way) :: lane_system
        integer :: n = 0                                  !! components of y
        integer :: n_used = lanes                         !! lanes that the caller of `evaluate` looks at; the others are copies
        logical :: is_idle(lanes) = .false.               !! lanes whose solutions go no further: nobody looks at these either
        integer :: evaluations_a_step = 10                !! that the method takes, about; blocks of lanes count once
        real(wp) :: span = 0                              !! how long the run is to be; 0: not known
        real(wp) :: time_scale = 0                        !! that long, or the first step that is tried
        logical :: may_leap = .false.                     !! stages may leap over what f does within a step: see `part_in_sight`
        logical, allocatable :: is_angle(:)               !! components whose whole turns are counted apart: these grow turn by
                                                          !! turn, and are asked for no worse; not allocated: none (n)
        integer, allocatable :: family(:)                 !! of each component, one of `family_*`: which have ways of about one
                                                          !! size; not allocated: each is alone (n)
        real(wp), allocatable :: beside(:)                !! sizes of what components change, where these tell by how much they
                                                          !! may be off; not allocated: their own ways do (n)
        real(wp), allocatable :: per_place(:)             !! how much of a component a place is worth, or an angle: it may be off by
                                                          !! what rounding leaves of these, times that; not allocated: nothing (n)
        logical, allocatable :: is_book(:)                !! components that no rate depends on and that only keep books: steps
                                                          !! do not heed their errors; not allocated: none (n)
        logical, allocatable :: is_result(:)              !! components that no rate depends on, these among them; not allocated:
                                                          !! none (n)
        real(wp), allocatable, private :: y_alone(:, :), rate_alone(:, :)    !! room for one solution on all lanes (lane, n)
        ! ---- jumps of f, which an evaluation tells by its `mode`
        logical :: may_jump = .false.
        real(wp), allocatable :: mode_rate(:, :)          !! f where the mode was found (lane, n)
        logical :: has_jumped = .false.                   !! f has, since `watch_jumps`
        real(wp), allocatable :: jump(:)                  !! by how much at most (n)
        logical :: looks_at_ends = .false.                !! `leads_too_far` has something to say
        ! ---- guards: numbers over the state whose sign a run looks out for
        integer :: n_guard = 0
        logical :: lanes_are_one = .false.                !! one solution on all lanes
        integer, allocatable :: guard_direction(:)        !! +1: a crossing upwards counts, -1: downwards, 0: either (n_guard)
    contains
        procedure :: evaluate_guards
        procedure :: survey
        procedure :: meet_crossings
        procedure :: show_side
        procedure(evaluate_rates), deferred :: evaluate
        procedure :: evaluate_alone
        procedure, non_overridable :: evaluate_first, evaluate_spread
        procedure :: take_whole_steps
        procedure :: broken_law, has_broken_law
        procedure :: leads_too_far
        procedure :: part_in_sight
        procedure :: longest_step
        procedure :: accept
        procedure :: begin_trial
        procedure :: looks_wanted, see_within
        procedure :: note_turns
        procedure, non_overridable :: watch_jumps, note_mode
    end type lane_system

    abstract interface
        !> f on all lanes. Lanes are independent; one where f cannot be evaluated is flagged.
        subroutine evaluate_rates(self, t, y, rate, failed)
            import :: lane_system, wp, lanes
            class(lane_system), intent(inout) :: self
            real(wp), intent(in) :: t(lanes)
            real(wp), intent(in), contiguous :: y(:, :)   !! (lane, n)
            real(wp), intent(out), contiguous :: rate(:, :)    !! (lane, n)
            logical, intent(out) :: failed(lanes)
        end subroutine evaluate_rates
    end interface

contains

    !> f on the first lanes. Those to spare become copies of the last of these: what they held may be nothing at all, and would be
    !> led and iterated on beside the others, whose last digits hang on how often that is done.
    subroutine evaluate_first(self, n, t, y, rate, failed)
        class(lane_system), intent(inout) :: self
        integer, intent(in) :: n                          !! lanes
        real(wp), intent(inout) :: t(lanes)
        real(wp), intent(inout), contiguous :: y(:, :)    !! (lane, n)
        real(wp), intent(out), contiguous :: rate(:, :)   !! (lane, n)
        logical, intent(out) :: failed(lanes)             !! not set where nobody looks
        integer :: k

        t(n + 1:) = t(n)
        do k = 1, size(y, 2)
            y(n + 1:, k) = y(n, k)
        end do
        self%n_used = n
        call self%evaluate(t, y, rate, failed)
        self%n_used = lanes
        failed(n + 1:) = .false.
        do k = 1, size(y, 2)
            rate(n + 1:, k) = rate(n, k)
        end do
    end subroutine evaluate_first

    !> f of one solution.
    subroutine evaluate_alone(self, t, y, rate, failed)
        class(lane_system), intent(inout) :: self
        real(wp), intent(in) :: t, y(:)                   !! (n)
        real(wp), intent(out) :: rate(:)                  !! (n)
        logical, intent(out) :: failed

        call self%evaluate_spread(t, y, rate, failed)
    end subroutine evaluate_alone

    !> The same on all lanes.
    subroutine evaluate_spread(self, t, y, rate, failed)
        class(lane_system), intent(inout) :: self
        real(wp), intent(in) :: t, y(:)                   !! (n)
        real(wp), intent(out) :: rate(:)                  !! (n)
        logical, intent(out) :: failed
        real(wp), allocatable :: ys(:, :), rates(:, :)
        real(wp) :: instant(lanes)
        logical :: lane_failed(lanes)
        integer :: k

        ! taken from one time to the next: it is called by the thousand
        call move_alloc(self%y_alone, ys)
        call move_alloc(self%rate_alone, rates)
        if (.not. allocated(ys)) allocate (ys(lanes, size(y)), rates(lanes, size(y)))
        instant = t
        do k = 1, size(y)
            ys(:, k) = y(k)
        end do
        self%n_used = 1
        call self%evaluate(instant, ys, rates, lane_failed)
        self%n_used = lanes
        rate = rates(1, :)
        failed = lane_failed(1) .or. .not. all(abs(rate) <= huge(1.0_wp))
        call move_alloc(ys, self%y_alone)
        call move_alloc(rates, self%rate_alone)
    end subroutine evaluate_spread

    !> Steps of the classical Runge-Kutta method, with what it adds to a system's numbers: for systems that know a shorter way to
    !> where they lead than from stage to stage.
    subroutine take_whole_steps(self, t, length, n_most, y, begin, rest, steps)
        class(lane_system), intent(inout) :: self
        real(wp), intent(in) :: t                         !! an accepted state
        real(wp), intent(in) :: length
        integer, intent(in) :: n_most                     !! steps
        real(wp), intent(inout), contiguous :: y(:, :)    !! there; where they lead (lane, n)
        real(wp), intent(inout), contiguous :: begin(:, :)     !! where the last one has begun (lane, n)
        real(wp), intent(inout), contiguous :: rest(:, :) !! to be added to y, less than its last place (lane, n)
        type(whole_steps), intent(inout) :: steps

        steps%n = 0
        steps%is_sure = .false.
    end subroutine take_whole_steps

    !> How far y breaks a law that every solution keeps, energy's say, over what the errors allowed would; 0 if none is known.
    !> An error estimate knows only of the places that a step has looked at.
    function broken_law(self, t, y, nudge, error) result(part)
        class(lane_system), intent(inout) :: self
        real(wp), intent(in) :: t, y(:)                   !! (n)
        real(wp), intent(in) :: nudge(:)                  !! a very little further on: what differs there is rounding (n)
        real(wp), intent(in) :: error(:)                  !! allowed since the last accepted y (n)
        real(wp) :: part

        part = 0
    end function broken_law

    !> Does the step to the accepted state break such a law grossly? For methods of no error estimate, or one that sees but
    !> few places of a step.
    function has_broken_law(self) result(is_broken)
        class(lane_system), intent(inout) :: self
        logical :: is_broken(lanes)

        is_broken = .false.
    end function has_broken_law

    !> Does the state evaluated last lie beyond where the caller would have come to rest, or on no way from the accepted one? A
    !> shorter step gets there.
    logical function leads_too_far(self, t)
        class(lane_system), intent(inout) :: self
        real(wp), intent(in) :: t                        !! of that state

        leads_too_far = .false.
    end function leads_too_far

    !> Steps that begin with these rates should be no longer [s].
    pure real(wp) function longest_step(self, rate)
        class(lane_system), intent(in) :: self
        real(wp), intent(in) :: rate(:)                !! (n)

        longest_step = huge(1.0_wp)
    end function longest_step

    !> How much of a step is to be gone at once, since its stages may have leapt over what the system does within it; 1: all of it.
    function part_in_sight(self, t, length, gap, y, rate, y_end, rate_end) result(part)
        class(lane_system), intent(inout) :: self
        real(wp), intent(in) :: t, length                 !! of the step
        real(wp), intent(in) :: gap                       !! the widest one between places that it has looked at, part of it
        real(wp), intent(in), dimension(:) :: y, rate, y_end, rate_end    !! at its ends (n)
        real(wp) :: part

        part = 1
    end function part_in_sight

    !> All guards of these states; not a number where one has no value.
    subroutine evaluate_guards(self, t, y, guard)
        class(lane_system), intent(inout) :: self
        real(wp), intent(in) :: t(lanes)
        real(wp), intent(in) :: y(:, :)                   !! (lane, n)
        real(wp), intent(out) :: guard(:, :)              !! (lane, n_guard)

        guard = 1
    end subroutine evaluate_guards

    !> f and guards of the first states, one a lane, for whoever looks over a step. The first one counts as evaluated last.
    subroutine survey(self, t, y, n, rate, guard, are_known)
        class(lane_system), intent(inout) :: self
        real(wp), intent(in) :: t(lanes)
        real(wp), intent(in), contiguous :: y(:, :)       !! of lanes to spare what the last state is (lane, n)
        integer, intent(in) :: n                          !! states
        real(wp), intent(out), contiguous :: rate(:, :)   !! (lane, n)
        real(wp), intent(out) :: guard(:, :)              !! (lane, n_guard)
        logical, intent(out) :: are_known                 !! else neither counts
        logical :: failed(lanes)

        self%n_used = n
        call self%evaluate(t, y, rate, failed)
        self%n_used = lanes
        call self%evaluate_guards(t, y, guard)
        are_known = .not. any(failed(:n))
    end subroutine survey

    !> The accepted state is where guards have crossed: on which side they are from here, and what comes of it.
    subroutine meet_crossings(self, t, y, has_crossed, has_changed, is_over)
        class(lane_system), intent(inout) :: self
        real(wp), intent(in) :: t(lanes)
        real(wp), intent(inout) :: y(:, :)                !! an impact changes it (lane, n)
        logical, intent(in) :: has_crossed(:, :)          !! (lane, n_guard)
        logical, intent(out) :: has_changed(lanes)        !! y or f is another one from here
        logical, intent(out) :: is_over(lanes)            !! the run ends here

        where (has_crossed) self%guard_side = -self%guard_side
        has_changed = .false.
        is_over = .false.
    end subroutine meet_crossings

    !> Something happens at the accepted state: this is where the system stands just before, or just behind. For systems that tell
    !> what is there; nothing of the steps may hang on it.
    subroutine show_side(self, t, y, is_behind)
        class(lane_system), intent(inout), target :: self
        real(wp), intent(in) :: t(lanes)
        real(wp), intent(in) :: y(:, :)                   !! (lane, n)
        logical, intent(in) :: is_behind
    end subroutine show_side

    !> The integrator goes on from y: for systems that remember where they are. Rates tried before count no more.
    subroutine accept(self, t, y, is_accepted)
        class(lane_system), intent(inout) :: self
        real(wp), intent(in) :: t(lanes)
        real(wp), intent(in), contiguous :: y(:, :)       !! (lane, n)
        logical, intent(in) :: is_accepted(lanes)         !! other lanes have stopped
    end subroutine accept

    !> A step is tried, or looked into: what was evaluated before, by whomever, has no part in it.
    subroutine begin_trial(self)
        class(lane_system), intent(inout) :: self
    end subroutine begin_trial

    !> At how many places within the step to the accepted y, at equal distances, the system wants to see the solution: for systems
    !> that follow something on its way; 0: none. Once it has seen them it may want more. Integrators that can look within a step
    !> ask.
    integer function looks_wanted(self) result(n)
        class(lane_system), intent(inout) :: self

        n = 0
    end function looks_wanted

    !> The solution at the places that were wanted. Nothing of the steps may hang on it.
    subroutine see_within(self, t, y)
        class(lane_system), intent(inout) :: self
        real(wp), intent(in) :: t(:)                      !! increasing (place)
        real(wp), intent(in) :: y(:, :)                   !! not a number where it cannot be had (place, n)
    end subroutine see_within

    !> Look out for jumps of f from a state on: what was evaluated elsewhere counts no more.
    subroutine watch_jumps(self, mode, rate)
        class(lane_system), intent(inout) :: self
        real(wp), intent(in) :: mode                      !! there
        real(wp), intent(in) :: rate(:)                   !! f there (n)

        if (.not. self%may_jump) return
        self%has_jumped = .false.
        self%mode = mode
        self%mode_rate = spread(rate, 1, lanes)
        self%jump = 0*rate
    end subroutine watch_jumps

    !> What an evaluation tells of jumps of f.
    subroutine note_mode(self, mode, rate, is_left)
        class(lane_system), intent(inout) :: self
        real(wp), intent(in) :: mode(:)                   !! of those that are used, at least
        real(wp), intent(in) :: rate(:, :)                !! f (lane, n)
        logical, intent(in), optional :: is_left(:)       !! it is not known there, others will tell it
        integer :: lane

        do lane = 1, self%n_used
            if (present(is_left)) then
                if (is_left(lane)) cycle
            end if
            if (abs(mode(lane) - self%mode(lane)) > 0) then
                self%n_jump = self%n_jump + 1
                if (allocated(self%jump)) then            ! somebody looks out
                    self%has_jumped = .true.
                    self%jump = max(self%jump, abs(rate(lane, :) - self%mode_rate(lane, :)))
                end if
            end if
            self%mode(lane) = mode(lane)
            if (allocated(self%mode_rate)) self%mode_rate(lane, :) = rate(lane, :)
        end do
    end subroutine note_mode

    !> Turns have been taken out of the accepted y: for systems that remember where they are.
    subroutine note_turns(self, turns)
        class(lane_system), intent(inout) :: self
        real(wp), intent(in) :: turns(:, :)               !! (lane, n)

        self%turns = self%turns + turns
    end subroutine note_turns
end module linkdyn_lane_system
