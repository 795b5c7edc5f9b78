!> The steps of a one-step method: how long they may be for the error allowed, and what to do where rounding, not the method,
!> makes the error.
!>
!> An error above the one allowed has one of two causes. If the method is the cause, as it is in a peak of the rates however
!> narrow, a shorter step is right. If rounding is, as it is near a change point, where rates lose digits, shorter steps gain
!> nothing and lead into the place where it is worst. Errors cannot tell: both may fall slowly or not at all with the step.
!> So the step is taken again some millionths of it later. What its error estimate then differs by *is* rounding; what it has in
!> common is not. These copies lie within the step: laws that begin or end where it does are others beyond. Where rounding explains
!> an error, longer and shorter steps are tried, and the one with the least is taken, if it leaves the result the digits that every
!> result must have. As long as rates are as rough as there, what rounding makes of a step is allowed, within the same bounds.
!>
!> Rates must be known where a step ends, since the next one begins with them. What rounding takes from the solution at a
!> step is added at the next.
module linkdyn_step_control
    use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan
    use linkdyn_constants, only: golden, least_accuracy, two_pi
    use linkdyn_crossings, only: step_taken
    use linkdyn_exact_sum, only: add_exactly
    use linkdyn_interrupt, only: is_interrupted
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_lane_system, only: lane_system
    use linkdyn_one_step, only: one_step_method
    use linkdyn_pause, only: pause_type
    use linkdyn_step_curve, only: step_curve
    use linkdyn_way_gone, only: way_gone_type
    use linkdyn_whole_turns, only: whole_turns, take_off
    implicit none (type, external)
    private
    public :: step_control, controlled_step, step_accepted, step_paused, step_too_short, step_too_rough, step_breaks_law

    integer, parameter :: step_accepted = 0
    integer, parameter :: step_paused = 1          !! come back: the step is under way
    integer, parameter :: step_too_short = 2       !! no step, however short, can be taken
    integer, parameter :: step_too_rough = 3       !! rounding leaves too few digits
    integer, parameter :: step_breaks_law = 4      !! no step, however short, keeps the law of the system

    real(wp), parameter :: cut = 0.25_wp           !! of a step that failed
    real(wp), parameter :: in_reach = 0.45_wp      !! of its length likely serves
    real(wp), parameter :: tried_again = 1.03_wp   !! growth of that length, in a step
    !> Other lengths for a step that rounding or a failure stands against. Longer ones first, in half tones: whoever comes
    !> nearer to a rough place in short steps has it worse before him, and each length has its stages elsewhere.
    real(wp), parameter :: stretch(18) = [1.0_wp, 1.12_wp, 1.26_wp, 1.41_wp, 1.58_wp, 1.78_wp, 2.0_wp, 2.24_wp, 2.52_wp, 2.83_wp, &
                                          3.2_wp, 4.0_wp, 5.0_wp, 6.4_wp, 0.8_wp, 0.6_wp, 0.45_wp, 0.3_wp]
    integer, parameter :: n_longer = 14, most_worse = 4
    !> An error is rounding if copies that round otherwise differ from it by a third of it.
    real(wp), parameter :: explained = 3
    !> Error over the allowed one, which is no less than what many sums round off, that the rounding of a step's terms hardly makes.
    real(wp), parameter :: far_above = 1000
    !> Error over the allowed one that a step has hardly ever if it is as long as the last one's error said it might be.
    real(wp), parameter :: unexpected = 4
    !> Steps that much shorter than the longest so far are looked at more closely.
    real(wp), parameter :: suspicious = 1.0e-3_wp
    !> Steps that much shorter have come to a rough place; where rounding is all that there is they are as long as others.
    real(wp), parameter :: creeping = 1.0e-2_wp
    !> Part of a step over which what differs is rounding. A place that rounds to the same values is much shorter, and one that
    !> makes errors by itself longer, or no step would ever have met it.
    real(wp), parameter :: little = 1.0e-6_wp
    !> What the many sums of an error estimate round off, relative; and tolerances so near to it that the error standing against
    !> a step is mostly rounding.
    real(wp), parameter :: rounding = 20*epsilon(1.0_wp), nearly_rounding = 10*rounding
    !> Between stages of a step, part of it: rkf45's; of rk8pd a quarter.
    real(wp), parameter :: widest_gap = 0.4_wp
    integer, parameter :: most_unseen = 4          !! steps on rough ground before it is measured again

    !> A step tried.
    type :: trial_type
        real(wp) :: step = 0
        real(wp), allocatable :: way(:), error(:)      !! to its end, and the estimate for it (n)
        real(wp), allocatable :: asked(:), allowed(:)  !! error by the tolerances; with what rounding makes (n)
        real(wp), allocatable :: y(:), rest(:)         !! solution at the end, and what it lacks (n)
        real(wp), allocatable :: rate(:)               !! there (n)
        real(wp) :: mode = 0                           !! and its number of the system's
        logical :: has_failed = .false.
        logical :: breaks_law = .false.                !! of the system
        logical :: is_too_far = .false.                !! past where the system would rest
        logical :: has_missed = .false.                !! a kink of the rates within, which is not in its error
        real(wp) :: part = 0                           !! error over the allowed one
    end type trial_type

    !> A solution on its way.
    type :: step_control
        class(one_step_method), allocatable :: method
        real(wp) :: t = 0                              !! reached
        real(wp), allocatable :: y(:)                  !! there (n)
        real(wp) :: next = 0                           !! length of the next step, proposed
        integer :: n_rejected = 0
        integer, private :: most_rejected = huge(1)    !! before no step is tried any more
        integer :: n_rough = 0                         !! steps that rounding left with more than the error allowed
        real(wp) :: roughest = 0                       !! largest error of these, relative
        real(wp) :: rough_in_all = 0                   !! sum of their errors, relative
        integer, private :: n_evaluation = 0           !! besides those of the method
        integer, private :: n_accepted = 0             !! steps
        real(wp), private :: excess = 0                !! sum of errors that rounding has left in them, over those asked for
        real(wp), private :: rtol = 0, atol = 0
        type(way_gone_type), private :: gone           !! which says what part of atol is allowed
        real(wp), allocatable, private :: rest(:)      !! to be added to y, less than its last place (n)
        real(wp), allocatable, private :: allowed(:)   !! error of the last step (n)
        real(wp), allocatable, private :: rate(:)      !! at t (n)
        real(wp), private :: mode = 0                  !! of the system there
        logical, private :: knows_rate = .false.
        real(wp), allocatable, private :: roughness(:) !! error that rounding makes a second (n)
        integer, private :: n_unseen = 0               !! steps since it was measured
        real(wp), private :: longest = 0, last = 0     !! steps so far
        real(wp), private :: out_of_reach = huge(1.0_wp)    !! length at which the system has failed lately
        ! ---- THE STEP UNDER WAY
        logical, private :: is_under_way = .false.
        real(wp), private :: wished = 0                !! length that was tried first
        real(wp), private :: step = 0                  !! length to try now
        integer, private :: n_refused = 0              !! trials in a row
        integer, private :: i_stretch = 0              !! of other lengths, the one tried now; 0: none
        logical, private :: is_rough = .false.         !! an error was rounding
        logical, private :: has_broken_law = .false.   !! the last trial
        real(wp), private :: best_score = 0            !! least error
        integer, private :: n_worse = 0                !! lengths tried in turn whose errors grow and are no rounding
        real(wp), private :: part_before = 0           !! error of the last of them, over what is allowed
        type(trial_type), private :: best              !! with it
        real(wp), allocatable, private :: best_rough(:)    !! what rounding makes of that (n)
    contains
        procedure :: start, take_step, take_turns_off, forget, count_evaluations
        procedure :: begin_taken, end_taken, shorten, exchange_solution
    end type step_control

    !> A step that was accepted: the solution within it.
    type, extends(step_taken) :: controlled_step
        class(one_step_method), pointer, private :: method => null()
        real(wp), allocatable, private :: rest(:), rest_end(:)    !! of y at its ends (n)
        real(wp), allocatable, private :: allowed(:)   !! error (n)
        real(wp), private :: rtol = 0, atol = 0
        type(way_gone_type), private :: gone
        type(step_curve), private :: curve
    contains
        procedure :: retake => retake_controlled
        procedure :: follow => follow_controlled
        procedure :: look_within, look_along, lose_turns
    end type controlled_step

contains

    !> Begin at t with y; the method has been prepared.
    subroutine start(self, t, y, first_step, rtol, atol, gone)
        class(step_control), intent(inout) :: self
        real(wp), intent(in) :: t, y(:)
        real(wp), intent(in) :: first_step             !! to try
        real(wp), intent(in) :: rtol, atol             !! local error allowed
        type(way_gone_type), intent(in), optional :: gone   !! by the solution so far; absent: it begins here

        self%t = t
        self%y = y
        self%next = first_step
        self%rtol = rtol
        self%atol = atol
        if (present(gone)) then
            self%gone = gone
        else
            call self%gone%start(y)
        end if
        self%rest = 0*y
        self%rate = 0*y
        self%roughness = 0*y
        self%n_rejected = 0
        self%n_rough = 0
        self%roughest = 0
        self%rough_in_all = 0
        self%n_evaluation = 0
        call self%forget()
    end subroutine start

    !> The right-hand side has a kink here: rates before are not those beyond.
    subroutine forget(self)
        class(step_control), intent(inout) :: self

        self%knows_rate = .false.
        self%is_under_way = .false.
        self%out_of_reach = huge(1.0_wp)
        call self%method%forget()
    end subroutine forget

    !> Right-hand sides so far (blocks).
    integer function count_evaluations(self) result(n)
        class(step_control), intent(in) :: self

        n = self%n_evaluation + self%method%n_evaluation
    end function count_evaluations

    !> One accepted step. It ends at t_end or before, unless it has to pass a place where rates are rough.
    subroutine take_step(self, system, t_end, t_kink, pause, outcome)
        class(step_control), intent(inout) :: self
        class(lane_system), intent(inout) :: system
        real(wp), intent(in) :: t_end
        real(wp), intent(in) :: t_kink                 !! never beyond; not before t_end
        type(pause_type), intent(inout) :: pause       !! looked at before every trial; nothing in the results changes. A trial
                                                       !! during which the process is told to stop is none
        integer, intent(out) :: outcome                !! one of `step_*`; t and y are as before if not accepted
        type(trial_type) :: trial
        real(wp) :: part

        outcome = step_too_short
        if (.not. self%is_under_way) call begin_step(self, system, t_end)
        if (.not. self%knows_rate) return
        do
            outcome = step_paused
            if (pause%is_due() .or. is_interrupted()) return
            outcome = step_too_short
            if (self%has_broken_law) outcome = step_breaks_law
            if (self%t + self%step == self%t .or. .not. self%step > 0 .or. self%n_rejected >= self%most_rejected) exit
            call try_length(self, system, self%step, t_end, trial)
            if (is_interrupted()) cycle
            call pause%note_work()
            if (trial%part <= 1) call look_at_step(self, system, trial, part)
            if (trial%part <= 1 .and. .not. trial%has_failed) then
                if (part < 1) then
                    self%n_rejected = self%n_rejected + 1
                    self%step = part*trial%step
                    cycle
                end if
                if (any(self%roughness > 0)) call watch_roughness(self, system, trial)
                call keep(self, trial, .false.)
                outcome = step_accepted
                exit
            end if
            self%n_rejected = self%n_rejected + 1
            call refuse(self, system, trial, t_kink - self%t, outcome)
            if (outcome == step_accepted .or. outcome == step_too_rough) exit
            self%has_broken_law = trial%breaks_law
        end do
        self%is_under_way = .false.
    end subroutine take_step

    subroutine begin_step(self, system, t_end)
        type(step_control), intent(inout) :: self
        class(lane_system), intent(inout) :: system
        real(wp), intent(in) :: t_end

        call find_rates(self, system)
        self%is_under_way = .true.
        if (self%longest == 0) self%next = min(self%next, time_of_change(self, system))
        self%wished = min(self%next, t_end - self%t, system%longest_step(self%rate))
        self%step = self%wished
        self%n_refused = 0
        self%i_stretch = 0
        self%is_rough = .false.
        self%has_broken_law = .false.
    end subroutine begin_step

    !> Rates where the solution has got to.
    subroutine find_rates(self, system)
        type(step_control), intent(inout) :: self
        class(lane_system), intent(inout) :: system
        logical :: has_failed

        if (self%knows_rate) return
        call system%begin_trial()
        call system%evaluate_alone(self%t, self%y, self%rate, has_failed)
        self%n_evaluation = self%n_evaluation + 1
        self%knows_rate = .not. has_failed
        self%mode = system%mode(1)
    end subroutine find_rates

    !> How long until some component has changed by its own size: longer first steps would try places far beyond.
    pure real(wp) function time_of_change(self, system) result(time)
        type(step_control), intent(in) :: self
        class(lane_system), intent(in) :: system
        real(wp) :: size_of(size(self%y))

        size_of = abs(self%y) + self%atol/self%rtol
        if (allocated(system%is_book)) where (system%is_book) size_of = huge(1.0_wp)
        time = minval(size_of/max(abs(self%rate), tiny(1.0_wp)))
    end function time_of_change

    !> The step of a length, and its error.
    subroutine try_length(self, system, length, t_end, trial)
        type(step_control), intent(inout) :: self
        class(lane_system), intent(inout) :: system
        real(wp), intent(in) :: length, t_end
        type(trial_type), intent(inout) :: trial
        real(wp) :: t_next

        t_next = self%t + length
        if (abs(t_next - t_end) <= epsilon(t_end)*abs(t_end)) t_next = t_end
        ! What the clock makes of the step: it would lose time otherwise.
        trial%step = t_next - self%t
        call take_room(trial, size(self%y))
        call system%watch_jumps(self%mode, self%rate)
        call system%begin_trial()
        call self%method%try_step(system, self%t, trial%step, self%y, self%rate, trial%way, trial%error, trial%has_failed, &
                                  .false.)
        trial%has_failed = trial%has_failed .or. .not. all(abs(trial%way) <= huge(1.0_wp))
        trial%part = huge(1.0_wp)
        trial%breaks_law = .false.
        trial%is_too_far = .false.
        trial%has_missed = .false.
        if (trial%has_failed) return
        trial%y = self%y
        trial%rest = 0
        call add_exactly(trial%way + self%rest, trial%y, trial%rest)
        if (system%has_jumped) trial%error = max(abs(trial%error), error_of_jump(self, system, trial%step))
        call find_allowed(self, system, trial)
        trial%part = maxval(abs(trial%error)/trial%allowed)
        if (.not. trial%part <= huge(1.0_wp)) trial%part = huge(1.0_wp)
    end subroutine try_length

    !> What a jump of the rates within a step may leave in it. Stages that come upon either side in turn agree on a mean of
    !> both that is none of the solution's, and the estimate, which compares them, may be zero.
    pure function error_of_jump(self, system, step) result(error)
        class(step_control), intent(in) :: self
        class(lane_system), intent(in) :: system
        real(wp), intent(in) :: step
        real(wp) :: error(size(self%y))
        real(wp), parameter :: part = 0.1_wp           !! of it, if the jump lies anywhere within the step
        real(wp), parameter :: least = 64              !! units in the last place of the clock: no step need be shorter

        error = 0
        if (abs(step) > least*spacing(self%t)) error = part*abs(step)*system%jump
    end function error_of_jump

    subroutine take_room(trial, n)
        type(trial_type), intent(inout) :: trial
        integer, intent(in) :: n

        if (allocated(trial%way)) return
        allocate (trial%way(n), trial%error(n), trial%allowed(n), trial%y(n), trial%rest(n), trial%rate(n))
    end subroutine take_room

    !> May a step be gone: does it end well, and has it leapt over nothing?
    subroutine look_at_step(self, system, trial, part)
        type(step_control), intent(inout) :: self
        class(lane_system), intent(inout) :: system
        type(trial_type), intent(inout) :: trial       !! tried last
        real(wp), intent(out) :: part                  !! of it that may be gone at once; 1 if it has failed, too

        part = 1
        call look_at_end(self, system, trial)
        if (.not. trial%has_failed) call look_for_missed(self, trial)
        if (.not. trial%has_failed) &
            part = system%part_in_sight(self%t, trial%step, widest_gap, self%y, self%rate, trial%y, trial%rate)
    end subroutine look_at_step

    !> No step ends where rates cannot be had, nor where the law of the system is broken.
    subroutine look_at_end(self, system, trial)
        type(step_control), intent(inout) :: self
        class(lane_system), intent(inout) :: system
        type(trial_type), intent(inout) :: trial
        real(wp) :: error(size(self%y))

        call system%evaluate_alone(self%t + trial%step, trial%y, trial%rate, trial%has_failed)
        self%n_evaluation = self%n_evaluation + 1
        trial%mode = system%mode(1)
        if (trial%has_failed) return
        trial%is_too_far = system%leads_too_far(self%t + trial%step)
        trial%has_failed = trial%is_too_far
        if (trial%has_failed) return
        error = trial%allowed
        if (allocated(system%is_book)) where (system%is_book) error = trial%error
        trial%breaks_law = system%broken_law(self%t + trial%step, trial%y, (little*trial%step)*trial%rate, error) > 1
        trial%has_failed = trial%breaks_law
    end subroutine look_at_end

    !> No step leads over a kink of the rates that it has not met.
    subroutine look_for_missed(self, trial)
        type(step_control), intent(inout) :: self
        type(trial_type), intent(inout) :: trial       !! the step tried last, with the rates at its end
        real(wp) :: error(size(self%y))

        call self%method%error_unseen(trial%step, self%rate, trial%rate, error)
        trial%has_missed = .not. all(abs(error) <= trial%allowed)
        trial%has_failed = trial%has_missed
    end subroutine look_for_missed

    !> The error that the tolerances ask for, and the one allowed: no less than what the many sums of an error estimate round
    !> off, what rounding makes of rates, if it leaves the digits that every result must have, and a part of the mean that it has
    !> made of the steps so far. To hold others to less gains nothing, and its many steps would meet the places where rounding is
    !> worst.
    pure subroutine find_allowed(self, system, trial)
        type(step_control), intent(in) :: self
        class(lane_system), intent(in) :: system
        type(trial_type), intent(inout) :: trial
        real(wp), dimension(size(self%y)) :: size_of, turned

        size_of = max(abs(self%y), abs(trial%y))
        if (allocated(system%is_angle)) then
            turned = two_pi*system%turns(1, :)
            where (system%is_angle) size_of = min(max(abs(self%y + turned), abs(trial%y + turned)), two_pi)
        end if
        trial%asked = self%gone%absolute_error(trial%y, self%atol) + self%rtol*size_of
        trial%allowed = max(trial%asked*max(1.0_wp, share_of_rounding(self)), rounding*size_of, &
                            rounding*max(abs(trial%way), abs(trial%step*self%rate)), &
                            min(explained*self%roughness*abs(trial%step), bearable(self%rtol, self%atol)*trial%asked))
        if (.not. allocated(system%is_book)) return
        where (system%is_book)
            trial%asked = huge(1.0_wp)
            trial%allowed = huge(1.0_wp)
        end where
    end subroutine find_allowed

    !> A tenth of the mean error that rounding has left in a step so far, over the one asked for.
    pure real(wp) function share_of_rounding(self) result(share)
        type(step_control), intent(in) :: self
        real(wp), parameter :: part = 0.1_wp

        share = part*self%excess/max(1, self%n_accepted)
    end function share_of_rounding

    !> An error relative to what each component counts for, as tolerances are.
    pure real(wp) function relative_error(self, trial) result(relative)
        type(step_control), intent(in) :: self
        type(trial_type), intent(in) :: trial

        relative = maxval(abs(trial%error)/trial%asked)*max(self%rtol, self%atol)
    end function relative_error

    !> What a step on rough ground is off by: an estimate of its error may happen to be less than what rounding makes of it.
    pure real(wp) function error_left(self, trial) result(relative)
        type(step_control), intent(in) :: self
        type(trial_type), intent(in) :: trial

        relative = maxval(max(abs(trial%error), self%roughness*abs(trial%step))/trial%asked)*max(self%rtol, self%atol)
    end function error_left

    !> Go on from the end of a step.
    subroutine keep(self, trial, is_rough)
        type(step_control), intent(inout) :: self
        type(trial_type), intent(in) :: trial
        logical, intent(in) :: is_rough                !! its error is rounding

        real(wp) :: before, part, left

        before = self%next
        self%next = trial%step
        if (self%i_stretch == 0) call self%method%propose(trial%step, trial%allowed, .true., self%next)
        ! A step that was cut short by where it had to end says nothing against a longer one.
        if (self%n_refused == 0 .and. trial%step < before) self%next = max(self%next, before)
        ! Where the system has failed it is likely to fail again, a step further on; it is tried when some shorter ones have been
        ! taken.
        self%next = min(self%next, max(trial%step, in_reach*self%out_of_reach))
        self%out_of_reach = min(tried_again*self%out_of_reach, huge(1.0_wp)/tried_again)
        part = maxval(abs(trial%error)/trial%asked)
        self%n_accepted = self%n_accepted + 1
        if (part > 1) then
            self%n_rough = self%n_rough + 1
            left = error_left(self, trial)
            self%roughest = max(self%roughest, left)
            self%rough_in_all = self%rough_in_all + left
            if (is_rough) self%excess = self%excess + part
        end if
        self%longest = max(self%longest, trial%step)
        self%last = trial%step
        self%t = self%t + trial%step
        self%y = trial%y
        call self%gone%note(trial%y)
        self%rest = trial%rest
        self%rate = trial%rate
        self%mode = trial%mode
        ! Books are allowed any error, but kept as well as everything else.
        self%allowed = trial%allowed
        where (trial%allowed > 0.5_wp*huge(1.0_wp)) self%allowed = max(self%atol + self%rtol*abs(trial%y), abs(trial%error), &
                                                                       rounding*max(abs(trial%y), abs(trial%way)))
    end subroutine keep

    !> Angles go on without the whole turns that they have made.
    subroutine take_turns_off(self, system)
        class(step_control), intent(inout) :: self
        class(lane_system), intent(inout) :: system
        real(wp) :: turns(size(self%y))

        if (.not. allocated(system%is_angle)) return
        turns = merge(whole_turns(self%y), 0.0_wp, system%is_angle)
        if (all(turns == 0)) return
        call take_off(turns, self%y, self%rest)
        call system%note_turns(spread(turns, 1, lanes))
    end subroutine take_turns_off

    !> What to try next; or a step that cannot be had better.
    subroutine refuse(self, system, trial, longest, outcome)
        type(step_control), intent(inout) :: self
        class(lane_system), intent(inout) :: system
        type(trial_type), intent(inout) :: trial
        real(wp), intent(in) :: longest                !! that a step may be
        integer, intent(out) :: outcome
        real(wp) :: rough(size(self%y))
        logical :: is_known, is_better, is_too_long

        outcome = step_paused                          ! go on
        if (self%i_stretch == 0) then
            self%n_refused = self%n_refused + 1
            self%step = cut*trial%step
            if (trial%has_failed .and. .not. (trial%breaks_law .or. trial%is_too_far .or. trial%has_missed)) &
                self%out_of_reach = trial%step
            if (.not. trial%has_failed) call self%method%propose(trial%step, trial%allowed, .false., self%step)
            if (system%has_jumped) self%step = min(self%step, cut*trial%step)
            ! A peak that no stage has met, or a place to stop before: shorter steps will.
            if (trial%breaks_law .or. trial%is_too_far .or. trial%has_missed) return
            if (self%n_refused > 1) self%step = min(self%step, trial%step/2)
            ! An error a little too large is daily bread, unless steps shrink at a tolerance that rounding hardly allows.
            if (trial%part < unexpected .and. trial%step > suspicious*self%longest &
                .and. (trial%step > self%last .or. max(self%rtol, self%atol) > nearly_rounding)) return
            if (.not. trial%has_failed) then
                call measure_rounding(self, system, trial, rough, is_known)
                if (is_interrupted()) return
                ! A jump of the rates: shorter steps come up to it, however much it looks like rounding.
                self%is_rough = is_known .and. is_rounding(self, trial, rough) .and. .not. system%has_jumped
                if (.not. self%is_rough) return
            end if
            self%best_score = huge(1.0_wp)
            self%n_worse = 0
            ! Good enough if no longer one is better, unless it is one of those that come ever nearer to a rough place and have it
            ! worse there.
            if (self%is_rough .and. trial%step > creeping*self%longest) &
                call compare_with_best(self, system, trial, rough, is_better)
            is_better = .false.
        else
            call consider(self, system, trial, is_better)
            if (is_interrupted()) return
        end if
        if (self%is_rough .and. self%best_score < huge(1.0_wp)) then
            if ((is_better .and. self%best_score <= unexpected) .or. self%i_stretch >= n_longer &
                .or. self%n_worse >= most_worse) then
                if (.not. is_good_enough(self, self%best) .or. self%best_score > far_above) then
                    call look_for_shorter(self, system, is_too_long)
                    if (is_interrupted()) return
                    if (is_too_long) then
                        self%is_rough = .false.
                        call start_shorter(self, cut)
                        return
                    end if
                end if
                call keep_best(self, outcome)
                return
            end if
        end if
        do while (self%i_stretch < size(stretch))
            self%i_stretch = self%i_stretch + 1
            self%step = stretch(self%i_stretch)*self%wished
            if (self%step <= longest) return
        end do
        ! Not rounding: shorter steps, and in the end the same search again.
        call start_shorter(self, cut*minval(stretch))
    end subroutine refuse

    !> Begin anew with a shorter step.
    subroutine start_shorter(self, part)
        type(step_control), intent(inout) :: self
        real(wp), intent(in) :: part                   !! of the one that was tried first

        self%i_stretch = 0
        self%n_refused = 0
        self%wished = part*self%wished
        self%step = self%wished
    end subroutine start_shorter

    !> Is it not rates that are rough, but the step too long: for the method to be stable, or over kinks? Then, too, copies part, by
    !> what the step makes of a last place, or of a kink; in a step of a quarter by far less, where rough rates leave a quarter, or
    !> not at all. Or they agree, for what has been found to be rounding was the error of a much shorter step: the step's own
    !> error is none, and falls as fast.
    subroutine look_for_shorter(self, system, is_too_long)
        type(step_control), intent(inout) :: self
        class(lane_system), intent(inout) :: system
        logical, intent(out) :: is_too_long
        integer, parameter :: n_shorter = 6
        type(trial_type) :: trial
        real(wp) :: rough(size(self%y)), apart, before, part_before
        logical :: is_known, is_too_rough
        integer :: i

        is_too_long = .false.
        is_too_rough = .not. is_good_enough(self, self%best)
        before = 0
        part_before = 0
        do i = 0, n_shorter
            call try_length(self, system, cut**i*self%wished, self%t, trial)
            if (trial%has_failed) cycle
            call measure_rounding(self, system, trial, rough, is_known)
            if (is_interrupted()) return
            if (.not. is_known) cycle
            apart = maxval(rough/trial%asked)
            is_too_long = trial%part < cut**4*part_before
            if (is_too_rough) is_too_long = is_too_long .or. apart < cut**4*before &
                                            .or. (i > 0 .and. trial%part <= 1 .and. all(rough <= trial%allowed))
            if (is_too_long) return
            before = apart
            part_before = merge(0.0_wp, trial%part, is_rounding(self, trial, rough))
        end do
    end subroutine look_for_shorter

    !> Is a step better than the others tried?
    subroutine consider(self, system, trial, is_better)
        type(step_control), intent(inout) :: self
        class(lane_system), intent(inout) :: system
        type(trial_type), intent(inout) :: trial
        logical, intent(out) :: is_better
        real(wp) :: rough(size(self%y))
        logical :: is_known, is_explained

        is_better = .false.
        if (trial%has_failed) return
        call measure_rounding(self, system, trial, rough, is_known)
        if (is_interrupted() .or. .not. is_known) return
        is_explained = is_rounding(self, trial, rough)
        self%is_rough = self%is_rough .or. (is_explained .and. .not. system%has_jumped)
        ! Errors that grow with the length, and are no rounding, go on to.
        if (is_explained .or. (self%n_worse > 0 .and. trial%part < self%part_before)) self%n_worse = 0
        if (.not. is_explained) self%n_worse = self%n_worse + 1
        self%part_before = trial%part
        call compare_with_best(self, system, trial, rough, is_better)
    end subroutine consider

    subroutine compare_with_best(self, system, trial, rough, is_better)
        type(step_control), intent(inout) :: self
        class(lane_system), intent(inout) :: system
        type(trial_type), intent(inout) :: trial
        real(wp), intent(in) :: rough(:)               !! what rounding makes of its error (n)
        logical, intent(out) :: is_better
        real(wp) :: score, part

        score = max(trial%part, maxval(rough/trial%allowed))
        is_better = score < self%best_score
        if (.not. is_better) return
        call look_at_step(self, system, trial, part)
        is_better = .not. trial%has_failed .and. part >= 1
        if (.not. is_better) return
        self%best_score = score
        self%best = trial
        self%best_rough = rough
    end subroutine compare_with_best

    !> Does rounding explain the error of a step? Not of one that has hit upon nothing of the solution: whatever is done to that
    !> changes it.
    pure logical function is_rounding(self, trial, rough)
        type(step_control), intent(in) :: self
        type(trial_type), intent(in) :: trial
        real(wp), intent(in) :: rough(:)               !! what rounding makes of it (n)
        real(wp), parameter :: nothing = 1.0e-2_wp     !! relative error of a step that says nothing

        is_rounding = relative_error(self, trial) <= nothing .and. &
                      all(abs(trial%error) <= trial%allowed .or. abs(trial%error) <= explained*rough)
    end function is_rounding

    !> Take the best step, if it is good enough. The ground is rough from here on.
    subroutine keep_best(self, outcome)
        type(step_control), intent(inout) :: self
        integer, intent(out) :: outcome

        outcome = step_too_rough
        if (.not. is_good_enough(self, self%best)) return
        self%roughness = self%best_rough/self%best%step
        call keep(self, self%best, .true.)
        self%n_unseen = most_unseen
        outcome = step_accepted
    end subroutine keep_best

    !> Does rounding leave the digits that a result must have?
    pure logical function is_good_enough(self, trial)
        type(step_control), intent(in) :: self
        type(trial_type), intent(in) :: trial

        is_good_enough = maxval(abs(trial%error)/trial%asked) <= bearable(self%rtol, self%atol)
    end function is_good_enough

    !> Largest error that leaves a result the digits it must have, over the one asked for.
    pure real(wp) function bearable(rtol, atol)
        real(wp), intent(in) :: rtol, atol

        bearable = max(10.0_wp, least_accuracy/max(rtol, atol))
    end function bearable

    !> Is the ground still rough, on a step that is good enough?
    subroutine watch_roughness(self, system, trial)
        type(step_control), intent(inout) :: self
        class(lane_system), intent(inout) :: system
        type(trial_type), intent(in) :: trial
        real(wp) :: rough(size(self%y))
        logical :: is_known

        self%n_unseen = self%n_unseen + 1
        if (self%n_unseen <= most_unseen) return
        self%n_unseen = 0
        call measure_rounding(self, system, trial, rough, is_known)
        if (is_interrupted() .or. .not. is_known) return
        self%roughness = merge(0.0_wp, 1.0_wp, all(explained*rough <= trial%asked))*rough/trial%step
    end subroutine watch_roughness

    !> How much of the error estimate rounding makes: its scatter among steps that begin a very little later, and in the last
    !> place elsewhere. Not known where one of these cannot be taken, which is no matter of rounding. If two of the three agree and
    !> one does not, they have begun on either side of a kink, or their Jacobians were taken there.
    subroutine measure_rounding(self, system, trial, rough, is_known)
        type(step_control), intent(inout) :: self
        class(lane_system), intent(inout) :: system
        type(trial_type), intent(in) :: trial
        real(wp), intent(out) :: rough(:)              !! (n)
        logical, intent(out) :: is_known
        real(wp), parameter :: shift(2) = [0.7_wp, 1.6_wp]*little, shorter = 1 - 2*little
        real(wp), parameter :: alike = 1.0e-3_wp       !! chance hardly ever makes two of three so
        real(wp), dimension(size(self%y)) :: y, rate, way, error, error_before
        real(wp) :: t, apart(3)
        logical :: has_failed
        integer :: copy

        rough = 0
        apart = 1
        is_known = .false.
        do copy = 1, size(shift)
            t = self%t + shift(copy)*trial%step
            y = changed_in_last_place(self%y + (shift(copy)*trial%step)*self%rate, copy)
            call system%evaluate_alone(t, y, rate, has_failed)
            self%n_evaluation = self%n_evaluation + 1
            if (.not. has_failed) &
                call self%method%try_step(system, t, shorter*trial%step, y, rate, way, error, has_failed, .true.)
            if (has_failed) return
            rough = max(rough, abs(error - trial%error))
            apart(copy) = maxval(abs(error - trial%error)/trial%allowed)
            if (copy == 2) apart(3) = maxval(abs(error - error_before)/trial%allowed)
            error_before = error
            if (is_surely_none(trial, rough)) exit
        end do
        if (minval(apart) < alike*maxval(apart)) rough = 0
        is_known = .true.
    end subroutine measure_rounding

    !> Has one copy of a step erred so much alike that another one will not make its error rounding?
    pure logical function is_surely_none(trial, rough)
        type(trial_type), intent(in) :: trial
        real(wp), intent(in) :: rough(:)               !! by which they differ (n)
        real(wp), parameter :: far_from = 1000         !! what explains it

        is_surely_none = any(abs(trial%error) > trial%allowed .and. abs(trial%error) > far_from*explained*rough)
    end function is_surely_none

    !> States changed by one or two units in the last place, up or down, as chance has it.
    pure function changed_in_last_place(y, copy) result(changed)
        real(wp), intent(in) :: y(:)
        integer, intent(in) :: copy
        real(wp) :: changed(size(y))
        real(wp) :: part
        integer :: i

        do i = 1, size(y)
            part = modulo((17*copy + i)*golden, 1.0_wp) - 0.5_wp
            changed(i) = y(i) + sign(1 + anint(abs(2*part)), part)*spacing(y(i))
        end do
    end function changed_in_last_place

    ! ---------------------------------------------------------------- a step that was taken

    !> Note where the next step begins.
    subroutine begin_taken(self, system, taken)
        class(step_control), intent(inout), target :: self     !! must outlive the use of `taken`
        class(lane_system), intent(inout) :: system
        type(controlled_step), intent(inout) :: taken

        call find_rates(self, system)
        taken%is_one = .true.
        taken%method => self%method
        taken%t = self%t
        taken%y = spread(self%y, 1, lanes)
        taken%rate = spread(self%rate, 1, lanes)
        taken%rest = self%rest
    end subroutine begin_taken

    !> Note where it has ended.
    subroutine end_taken(self, taken)
        class(step_control), intent(in) :: self
        type(controlled_step), intent(inout) :: taken

        taken%length = self%last
        taken%y_end = spread(self%y, 1, lanes)
        taken%rest_end = self%rest
        taken%rate_end = spread(self%rate, 1, lanes)
        taken%allowed = self%allowed
        taken%rtol = self%rtol
        taken%atol = self%atol
        taken%gone = self%gone
        call taken%curve%forget()
    end subroutine end_taken

    !> Let the step that was taken end earlier. Rates there are looked at, whatever was looked at since.
    subroutine shorten(self, system, taken, share)
        class(step_control), intent(inout) :: self
        class(lane_system), intent(inout) :: system
        type(controlled_step), intent(inout) :: taken
        real(wp), intent(in) :: share                  !! of its length; 1: it is not shorter
        real(wp), dimension(size(self%y)) :: way, error
        logical :: has_failed

        if (share < 1) then
            call taken%method%try_step(system, taken%t(1), share*taken%length(1), taken%y(1, :), taken%rate(1, :), way, error, &
                                       has_failed, .true.)
            self%y = taken%y(1, :)
            self%rest = 0
            call add_exactly(way + taken%rest, self%y, self%rest)
            self%t = taken%t(1) + share*taken%length(1)
        end if
        self%knows_rate = .false.
        call find_rates(self, system)
        self%last = self%t - taken%t(1)
        taken%length = self%last
        call self%end_taken(taken)
    end subroutine shorten

    !> Go on from another solution at the same instant.
    subroutine exchange_solution(self, y)
        class(step_control), intent(inout) :: self
        real(wp), intent(in) :: y(:)

        self%y = y
        self%rest = 0
        call self%forget()
    end subroutine exchange_solution

    !> The solution at an instant of the step: on its curve, or where that is not to be believed by a shorter step, or by several.
    !> So it does not depend on what else is asked of the step.
    subroutine look_within(self, system, t, y)
        class(controlled_step), intent(inout) :: self
        class(lane_system), intent(inout) :: system
        real(wp), intent(in) :: t
        real(wp), intent(out) :: y(:, :)               !! not a number where it cannot be had (lane, n)
        real(wp) :: solution(size(y, 2)), share

        share = (t - self%t(1))/self%length(1)
        if (share >= 1) then
            y = self%y_end
            return
        end if
        call lay_curve(self, system)
        if (self%curve%is_there) then
            solution = moved(self%y(1, :), self%rest, self%curve%way_at(share))
        else
            call step_within(self, system, t, solution)
        end if
        y = spread(solution, 1, lanes)
    end subroutine look_within

    !> About the same at many places, for whoever follows the way: on the curve, or by steps of their own, each from the place
    !> before; where these cannot be taken on the cubic that meets solution and rates at both ends.
    subroutine look_along(self, system, t, solution)
        class(controlled_step), intent(inout) :: self
        class(lane_system), intent(inout) :: system
        real(wp), intent(in) :: t(:)                   !! within the step, increasing (place)
        real(wp), intent(out) :: solution(:, :)        !! (place, n)
        real(wp) :: share
        integer :: i

        call lay_curve(self, system)
        if (.not. self%curve%is_there) call walk_within(self, system, t, solution)
        do i = 1, size(t)
            share = (t(i) - self%t(1))/self%length(1)
            if (self%curve%is_there) then
                solution(i, :) = moved(self%y(1, :), self%rest, self%curve%way_at(share))
            else if (.not. all(abs(solution(i, :)) <= huge(1.0_wp))) then
                solution(i, :) = self%cubic_at(share)
            end if
        end do
    end subroutine look_along

    !> The same for whoever looks over the step: on the curve where that is worth laying, and serves.
    subroutine follow_controlled(self, system, is_long, share, y, is_sure)
        class(controlled_step), intent(inout) :: self
        class(lane_system), intent(inout) :: system
        logical, intent(in) :: is_long
        real(wp), intent(in) :: share(:)               !! of the length (place)
        real(wp), intent(out) :: y(:, :)               !! (place, n)
        logical, intent(out) :: is_sure
        integer :: i

        if (is_long) call lay_curve(self, system)
        is_sure = self%curve%is_there
        do i = 1, size(share)
            if (is_sure) then
                y(i, :) = moved(self%y(1, :), self%rest, self%curve%way_at(share(i)))
            else
                y(i, :) = self%cubic_at(share(i))
            end if
        end do
    end subroutine follow_controlled

    !> The curve of the step, unless that has been tried.
    subroutine lay_curve(self, system)
        class(controlled_step), intent(inout) :: self
        class(lane_system), intent(inout) :: system

        if (self%curve%is_there .or. self%curve%is_refused) return
        call system%begin_trial()
        call self%curve%lay(system, self%t(1), self%length(1), self%y(1, :), &
                            (self%y_end(1, :) - self%y(1, :)) + (self%rest_end - self%rest), self%rate(1, :), &
                            self%rate_end(1, :), self%allowed)
        self%n_evaluation = self%n_evaluation + self%curve%n_evaluation
    end subroutine lay_curve

    !> The same by one step, ahead from the beginning or back from the end, or by several; at last by the better one of the first
    !> two, if it leaves the digits that a result must have. It is a trial of its own: no bit of it may hang on what was looked at
    !> before.
    subroutine step_within(self, system, t, solution)
        class(controlled_step), intent(inout) :: self
        class(lane_system), intent(inout) :: system
        real(wp), intent(in) :: t
        real(wp), intent(out) :: solution(:)           !! not a number where it cannot be had (n)
        real(wp) :: ahead(size(solution)), back(size(solution)), most, part(2)

        call system%begin_trial()
        call step_from(self, system, self%t(1), self%y(1, :), self%rest, self%rate(1, :), t, ahead, part(1))
        solution = ahead
        if (part(1) <= 1) return
        call step_from(self, system, self%t(1) + self%length(1), self%y_end(1, :), self%rest_end, self%rate_end(1, :), t, back, &
                       part(2))
        solution = back
        if (part(2) <= 1) return
        call go_within(self, system, t, solution)
        if (all(abs(solution) <= huge(1.0_wp))) return
        most = bearable(self%rtol, self%atol)
        if (part(1) <= min(part(2), most)) then
            solution = ahead
        else if (part(2) <= most) then
            solution = back
        end if
    end subroutine step_within

    !> One step within the step that was taken, and its error over the allowed one.
    subroutine step_from(self, system, t, y, rest, rate, t_end, solution, part)
        class(controlled_step), intent(inout) :: self
        class(lane_system), intent(inout) :: system
        real(wp), intent(in) :: t, y(:), rest(:), rate(:)
        real(wp), intent(in) :: t_end                  !! later or earlier than t
        real(wp), intent(out) :: solution(:), part
        real(wp), dimension(size(y)) :: way, error, rate_end
        logical :: has_failed

        part = huge(1.0_wp)
        call self%method%try_step(system, t, t_end - t, y, rate, way, error, has_failed, .true.)
        solution = moved(y, rest, way)
        if (has_failed .or. .not. all(abs(error) <= huge(1.0_wp))) return
        part = maxval(abs(error)/self%allowed)
        if (part > 1) return
        ! a kink that it has not met
        rate_end = rate
        if (self%method%compares_end()) then
            call system%evaluate_alone(t_end, solution, rate_end, has_failed)
            self%n_evaluation = self%n_evaluation + 1
        end if
        if (.not. has_failed) call self%method%error_unseen(t_end - t, rate, rate_end, error)
        if (has_failed .or. .not. all(abs(error) <= self%allowed)) part = huge(1.0_wp)
    end subroutine step_from

    !> Where a way leads.
    pure function moved(y, rest, way) result(solution)
        real(wp), intent(in) :: y(:), rest(:), way(:)  !! rest: what y lacks (n)
        real(wp) :: solution(size(y)), lost(size(y))

        solution = y
        lost = 0
        call add_exactly(way + rest, solution, lost)
    end function moved

    !> The same by steps of their own from the beginning.
    subroutine go_within(self, system, t, solution)
        class(controlled_step), intent(inout) :: self
        class(lane_system), intent(inout) :: system
        real(wp), intent(in) :: t
        real(wp), intent(out) :: solution(:)           !! not a number where it cannot be had (n)
        real(wp) :: places(1, size(solution))

        call walk_within(self, system, [t], places)
        solution = places(1, :)
    end subroutine go_within

    !> The same at several places, one after the other.
    subroutine walk_within(self, system, t, solution)
        class(controlled_step), intent(inout) :: self
        class(lane_system), intent(inout) :: system
        real(wp), intent(in) :: t(:)                   !! increasing (place)
        real(wp), intent(out) :: solution(:, :)        !! not a number where it cannot be had (place, n)
        integer, parameter :: most_steps = 1000        !! beside those to the places
        integer, parameter :: most_rejected = 60       !! a way that ends where no rates are to be had takes ever shorter ones
        type(step_control) :: control
        type(pause_type) :: never
        integer :: place, n_step, outcome

        solution = ieee_value(1.0_wp, ieee_quiet_nan)
        allocate (control%method, source=self%method)
        call control%start(self%t(1), self%y(1, :), t(1) - self%t(1), self%rtol, self%atol, self%gone)
        control%rest = self%rest
        control%most_rejected = most_rejected
        place = 1
        do n_step = 1, most_steps + size(t)
            call control%take_step(system, t(place), t(place), never, outcome)
            if (outcome /= step_accepted) exit
            if (control%t < t(place)) cycle
            solution(place, :) = control%y
            place = place + 1
            if (place > size(t)) exit
        end do
        self%method%n_evaluation = control%method%n_evaluation
        self%n_evaluation = self%n_evaluation + control%n_evaluation
    end subroutine walk_within

    !> Turns have been taken out of the accepted solution: out of the step before it, too.
    subroutine lose_turns(self, turns)
        class(controlled_step), intent(inout) :: self
        real(wp), intent(in) :: turns(:)               !! (n)

        if (all(turns == 0)) return
        call take_off(turns, self%y(1, :), self%rest)
        call take_off(turns, self%y_end(1, :), self%rest_end)
        self%y = spread(self%y(1, :), 1, lanes)
        self%y_end = spread(self%y_end(1, :), 1, lanes)
    end subroutine lose_turns

    subroutine retake_controlled(self, system, share, y)
        class(controlled_step), intent(inout) :: self
        class(lane_system), intent(inout) :: system
        real(wp), intent(in) :: share(lanes)
        real(wp), intent(out) :: y(:, :)
        real(wp), dimension(size(y, 2)) :: way, error, solution
        logical :: has_failed

        if (share(1) >= 1) then
            y = self%y_end
            return
        end if
        call self%method%try_step(system, self%t(1), share(1)*self%length(1), self%y(1, :), self%rate(1, :), way, error, &
                                  has_failed, .true.)
        solution = moved(self%y(1, :), self%rest, way)
        if (has_failed) solution = ieee_value(1.0_wp, ieee_quiet_nan)
        y = spread(solution, 1, lanes)
    end subroutine retake_controlled
end module linkdyn_step_control
