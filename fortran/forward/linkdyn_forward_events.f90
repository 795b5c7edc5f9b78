!> Events of a run: the guards that are looked out for, what comes of their zeros, and the log.
submodule (linkdyn_forward_system) linkdyn_forward_events
    use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan
    use linkdyn_clutch_friction, only: reserve
    use linkdyn_clutch_states, only: switch_clutches
    use linkdyn_constants, only: least_accuracy
    use linkdyn_event_log, only: add_entry, kind_crossing, kind_end, kind_contact, kind_release
    use linkdyn_exchange, only: coordinate_now
    use linkdyn_followed_angles, only: angles_about
    use linkdyn_forward_state, only: read_coordinates
    use linkdyn_held_variables, only: away_from_stops, slips, led_by
    use linkdyn_forward_record, only: measure_states
    use linkdyn_measures, only: find_events, tell_events
    use linkdyn_motor_states, only: switch_brakes
    use linkdyn_planar_motion, only: level_velocity
    use linkdyn_slip_parts, only: goes_with_others, slip_levers, slip_speeds, with_lead
    use linkdyn_stop_states, only: leave_stop
    implicit none (type, external)

contains

    !> The scene's events at these states.
    module procedure evaluate_events
        real(wp) :: rate(lanes, self%n)
        logical :: failed(lanes)

        call self%look_closely(t, y)
        call find_guards(self, t, self%look, guard)
        if (.not. holds_something(self)) return
        call self%evaluate_on_lanes(t, y, rate, failed)
        call take_held(self, guard)
    end procedure evaluate_events

    !> The same with the rates, in one go: by the record, where that serves and has shown that it measures what the lanes do.
    module procedure survey_events
        real(wp) :: by_record(lanes, self%n_guard)
        logical :: failed(lanes)

        self%n_used = n
        call self%evaluate(t, y, rate, failed)
        self%n_used = lanes
        are_known = .not. any(failed(:n))
        if (.not. are_known) return
        if (.not. self%is_by_record) then
            call find_guards(self, t, self%workspace%state, guard)
            if (holds_something(self)) call take_held(self, guard)
        else if (.not. has_guards(self)) then
            call self%evaluate_guards(t, y, guard)
        else
            call guards_by_record(self, t, y, n, by_record)
            guard = by_record
            if (self%guards_agree) return
            call self%evaluate_guards(t, y, guard)
            self%guards_agree = all(are_alike_on_lanes(guard, by_record))
            self%guards_differ = .not. self%guards_agree
        end if
    end procedure survey_events

    !> Guards by motion that has been computed on lanes. That of a clutch that is open, or spared, never vanishes.
    subroutine find_guards(self, t, state, guard)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t(lanes)               !! [s]
        type(kinematic_state), intent(inout) :: state
        real(wp), intent(out) :: guard(:, :)           !! (lane, n_guard)
        logical :: failed(lanes)
        integer :: i

        call find_events(self%model, state, angles_about(self%way%angles, t), guard)
        failed = state%unreachable .or. state%not_converged .or. state%way_status /= sample_ok
        do i = 1, size(guard, 2)
            where (failed) guard(:, i) = ieee_value(1.0_wp, ieee_quiet_nan)
        end do
        call let_stops_yield(self, guard)
        if (n_clutch(self%model%scene) > 0) call see_surfaces(self, state, guard)
        do i = 1, n_clutch(self%model%scene)
            where (.not. self%way%clutch%is_closed(:, i) .or. self%way%clutch%is_spared(:, i)) &
                guard(:, self%model%scene%clutch(i)%event) = 1
            call keep_what_is_held(self, i, guard)
        end do
    end subroutine find_guards

    !> Does the record measure what guards are made of? It knows nothing of clutches.
    logical function has_guards(self)
        class(forward_system), intent(in) :: self

        has_guards = self%record%recorded%measures%is_made .and. n_clutch(self%model%scene) == 0 .and. .not. self%guards_differ
    end function has_guards

    !> Guards at the first states, of which the record has just found the rates.
    subroutine guards_by_record(self, t, y, n, guard)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t(lanes)               !! [s]
        real(wp), intent(in), contiguous :: y(:, :)    !! (lane, n)
        integer, intent(in) :: n
        real(wp), intent(out) :: guard(:, :)           !! (lane, n_guard)
        real(wp) :: measure(lanes, size(self%model%scene%laws%measure))

        call measure_states(n, t, y, self%turns, self%record, measure)
        call tell_events(self%model, angles_about(self%way%angles, t), measure, guard)
        call let_stops_yield(self, guard)
    end subroutine guards_by_record

    !> A stop that has been struck is where its variable rests.
    subroutine let_stops_yield(self, guard)
        class(forward_system), intent(in) :: self
        real(wp), intent(inout) :: guard(:, :)         !! (lane, n_guard)
        integer :: i

        do i = 1, n_stop(self%model%scene)
            associate (stop => self%model%scene%stop(i))
                if (stop%is_hard) guard(:, stop%event) = guard(:, stop%event) + self%way%stops%yielded(:, i)
            end associate
        end do
    end subroutine let_stops_yield

    logical function holds_something(self)
        class(forward_system), intent(in) :: self

        holds_something = rests_anywhere(self%way%stops) .or. holds_anywhere(self%way%clutch)
    end function holds_something

    !> The guard of a stop at which its variable rests is its push: when that vanishes the variable leaves. That of a clutch that
    !> holds is what it could hold besides. Both at the states evaluated last.
    subroutine take_held(self, guard)
        class(forward_system), intent(in) :: self
        real(wp), intent(inout) :: guard(:, :)         !! (lane, n_guard)
        integer :: i

        do i = 1, n_clutch(self%model%scene)
            if (self%model%scene%clutch(i)%lead /= i) cycle
            where (self%way%clutch%holds(:, i)) guard(:, self%model%scene%clutch(i)%event) = reserve(self%model, i, self%way%clutch)
        end do
        do i = 1, n_stop(self%model%scene)
            associate (e => self%model%scene%stop(i)%event)
                where (self%way%stops%rests(:, i)) guard(:, e) = self%way%stops%push(:, i)
            end associate
        end do
    end subroutine take_held

    !> Are guards by two roads the same, for what they are compared with zero? They are numbers of any size.
    elemental logical function are_alike_on_lanes(one, other) result(are_alike)
        real(wp), intent(in) :: one, other

        are_alike = abs(one - other) <= least_accuracy*max(1.0_wp, abs(one))
    end function are_alike_on_lanes

    !> What closes a clutch that then holds links where they are may tell how far apart these are: it has come to rest at zero, and
    !> what errors of the steps carry off and back is no crossing.
    subroutine keep_what_is_held(self, i, guard)
        class(forward_system), intent(in) :: self
        integer, intent(in) :: i                       !! clutch
        real(wp), intent(inout) :: guard(:, :)         !! (lane, n_guard)
        real(wp), parameter :: at_rest = 1.0e-7_wp     !! of its largest value so far
        real(wp) :: least(lanes)

        associate (clutch => self%model%scene%clutch(i))
            if (clutch%from_event == 0 .or. .not. clutch%is_positive .or. led_by(self%model, clutch)) return
            least = at_rest*self%guard_scale(:, clutch%from_event)
            associate (of => guard(:, clutch%from_event))
                where (self%way%clutch%holds(:, i) .and. abs(of) < least) of = sign(least, self%guard_side(:, clutch%from_event))
            end associate
        end associate
    end subroutine keep_what_is_held

    !> Watch surfaces that slide along several joint variables: how fast they still slide the way they did at the accepted
    !> state: that vanishes when they come to rest. Those of joints without variables tell themselves how they slip.
    subroutine see_surfaces(self, state, guard)
        class(forward_system), intent(in) :: self
        type(kinematic_state), intent(in) :: state
        real(wp), intent(inout) :: guard(:, :)         !! (lane, n_guard)
        real(wp), dimension(lanes, n_clutch(self%model%scene)) :: slip
        real(wp) :: lever(size(slip, 2))
        logical :: is_part(size(slip, 2))
        integer :: i

        is_part = goes_with_others(self%model%scene)
        if (.not. any(is_part .or. self%model%scene%clutch%is_bare)) return
        slip = slips(self%model, state, level_velocity)
        lever = slip_levers(self%model)
        do i = 1, size(slip, 2)
            associate (clutch => self%model%scene%clutch(i))
                if (is_part(i) .and. clutch%lead == i) guard(:, clutch%event) = 0*guard(:, clutch%event)
                if (clutch%is_bare) guard(:, clutch%event) = 0*guard(:, clutch%event) + slip(:, i)
            end associate
        end do
        do i = 1, size(slip, 2)
            associate (along => guard(:, self%model%scene%clutch(i)%event))
                if (is_part(i)) along = along + lever(i)*slip(:, i)*self%way%clutch%sense(:, i)
            end associate
        end do
    end subroutine see_surfaces

    !> Events have come: they are noted, end the run, or stops throw back, catch and let go.
    module procedure meet_events
        logical, dimension(lanes, n_stop(self%model%scene)) :: strikes, rested
        logical, dimension(lanes, n_clutch(self%model%scene)) :: is_closed, has_slipped

        rested = self%way%stops%rests
        call self%look_closely(t, y)
        call tell_apart(self, t, y, has_crossed, has_changed, is_over, strikes, is_closed, has_slipped)
        call ask_what_stops_held(self, rested .and. .not. self%way%stops%rests, has_slipped)
        has_slipped = with_lead(self%model%scene, has_slipped) .and. is_closed
        if (any(has_slipped) .or. any(is_closed .neqv. self%way%clutch%is_closed)) then
            has_changed = has_changed .or. any(has_slipped .or. (is_closed .neqv. self%way%clutch%is_closed), dim=2)
            call engage(self, t, y, is_closed, has_slipped)
            is_over = is_over .or. self%way%is_driven_through
            strikes = strikes .and. .not. self%way%stops%rests     ! what locks have driven there has struck
        end if
        if (any(strikes)) call forget_leaving(self, strikes)
        if (any(strikes)) then
            call self%meet_stops(t, y, strikes)
            has_changed = has_changed .or. any(strikes, dim=2)
            is_over = is_over .or. self%way%is_driven_through
        end if
        if (any(has_changed)) call renew_gaps(self, t, y, has_changed, rested)
    end procedure meet_events

    !> A stop lets go of what rested there, and of what that kept at rest: clutches are asked anew whether they hold. Each still
    !> rubs as it slid before it came to the stop, and where the load would move it the other way now it would come to rest again
    !> at this instant, and so on without end.
    subroutine ask_what_stops_held(self, lets_go, has_slipped)
        class(forward_system), intent(in) :: self      !! the motion of the state is in `look`
        logical, intent(in) :: lets_go(:, :)           !! (lane, n_stop)
        logical, intent(inout) :: has_slipped(:, :)    !! (lane, n_clutch)
        real(wp), parameter :: still = 1.0e-9_wp       !! of the fastest slip so far: what steps have left of it
        real(wp) :: slip(lanes, size(has_slipped, 2))
        integer :: i

        if (.not. (any(lets_go) .and. any(self%way%clutch%is_closed))) return
        slip = slip_speeds(self%model, slips(self%model, self%look, level_velocity))
        associate (of => self%way%clutch)
            do i = 1, size(slip, 2)
                associate (fastest => max(of%fastest(:, i), self%guard_scale(:, self%model%scene%clutch(i)%event)))
                    has_slipped(:, i) = has_slipped(:, i) .or. (any(lets_go, dim=2) .and. of%is_closed(:, i) &
                                                                .and. .not. of%holds(:, i) .and. slip(:, i) <= still*fastest)
                end associate
            end do
        end associate
    end subroutine ask_what_stops_held

    !> Each crossing by what it is one of. What is over at once is done: ends of runs, brakes that are switched, contacts that give
    !> way, releases. What clutches and stops make of theirs comes later, of all together.
    subroutine tell_apart(self, t, y, has_crossed, has_changed, is_over, strikes, is_closed, has_slipped)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t(lanes)
        real(wp), intent(in) :: y(:, :)
        logical, intent(in) :: has_crossed(:, :)       !! (lane, n_guard)
        logical, intent(out) :: has_changed(lanes), is_over(lanes)
        logical, intent(out) :: strikes(:, :)          !! (lane, n_stop)
        logical, intent(out) :: is_closed(:, :)        !! from here (lane, n_clutch)
        logical, intent(out) :: has_slipped(:, :)      !! comes to rest, or breaks loose (lane, n_clutch)
        integer :: lane, i

        has_changed = .false.
        is_over = .false.
        strikes = .false.
        is_closed = self%way%clutch%is_closed
        has_slipped = .false.
        do i = 1, self%n_guard
            associate (event => self%model%scene%event(i))
                do lane = 1, lanes
                    if (.not. has_crossed(lane, i)) cycle
                    if (event%clutch > 0) then
                        has_slipped(lane, event%clutch) = .true.
                        cycle
                    else if (event%stop == 0) then
                        is_over(lane) = is_over(lane) .or. (event%ends_run .and. self%may_end)
                        if (event%ends_run .and. self%may_end) self%way%final_event(lane) = i
                        call note(merge(kind_end, kind_crossing, event%ends_run))
                        call switch_brakes(self%model, lane, i, t(lane), self%way%motors, has_changed(lane))
                        call switch_clutches(self%model%scene, lane, i, t(lane), self%way%clutch, is_closed)
                    else if (.not. self%model%scene%stop(event%stop)%is_hard) then
                        call note(merge(kind_contact, kind_release, self%guard_side(lane, i) > 0))
                        has_changed(lane) = .true.
                    else if (self%way%stops%rests(lane, event%stop)) then
                        call note(kind_release)
                        call leave_stop(lane, event%stop, self%way%stops, self%guard_side(lane, i), self%guard_scale(lane, i))
                        has_changed(lane) = .true.
                        cycle
                    else
                        strikes(lane, event%stop) = .true.
                        cycle
                    end if
                    self%guard_side(lane, i) = side_behind(lane, i)
                end do
            end associate
        end do

    contains

        subroutine note(kind)
            integer, intent(in) :: kind
            type(event_entry) :: entry

            entry%kind = kind
            entry%direction = nint(side_behind(lane, i))
            call note_entry(self, t, y, lane, i, entry)
        end subroutine note

        !> On which side a guard is behind its crossing. Before one that counts it may have crossed the other way within the step.
        real(wp) function side_behind(lane, i)
            integer, intent(in) :: lane, i

            side_behind = -self%guard_side(lane, i)
            if (self%guard_direction(i) /= 0) side_behind = self%guard_direction(i)
        end function side_behind
    end subroutine tell_apart

    !> What is on its way out was thrown back a moment ago: rounding has its gap still closed.
    subroutine forget_leaving(self, strikes)
        class(forward_system), intent(in) :: self
        logical, intent(inout) :: strikes(:, :)        !! (lane, n_stop)
        real(wp), parameter :: rounded = 1.0e-12_wp    !! of the fastest impact: that is no speed
        real(wp) :: away(lanes, size(strikes, 2))
        integer :: i

        away = away_from_stops(self%model, self%look, level_velocity)
        do i = 1, size(strikes, 2)
            strikes(:, i) = strikes(:, i) .and. .not. away(:, i) > rounded*self%way%stops%fastest(:, i)
        end do
    end subroutine forget_leaving

    !> An entry of the log, in the user's coordinates. Lanes that nobody asks for have none.
    module procedure note_entry
        real(wp), allocatable :: ignored(:)

        if (lane > self%n_told) return
        entry%lane = lane
        entry%t = t(lane)
        entry%event = event
        call coordinates_of(y, entry%q, entry%qd)
        entry%qd_after = entry%qd
        if (present(y_after)) call coordinates_of(y_after, ignored, entry%qd_after)
        call add_entry(self%way%log, entry)

    contains

        subroutine coordinates_of(state, q, qd)
            real(wp), intent(in) :: state(:, :)
            real(wp), allocatable, intent(out) :: q(:), qd(:)
            real(wp), dimension(lanes, self%model%n_q) :: lane_q, lane_qd, lane_qdd
            integer :: k

            call self%look_closely(t, state)
            call read_coordinates(self%model, self%layout, t, state, self%turns, self%look, lane_q, lane_qd, lane_qdd)
            q = lane_q(lane, :)
            qd = lane_qd(lane, :)
            if (.not. associated(self%own)) return
            do k = 1, size(q)
                if (self%model%scene%coordinate(k)%for_joint > 0) &
                    call coordinate_now(self%own, self%model, self%look, k, q(k), qd(k))
            end do
        end subroutine coordinates_of
    end procedure note_entry
end submodule linkdyn_forward_events
