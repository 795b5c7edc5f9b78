!> What end stops do where joint variables strike them: impulses, rest, release (`linkdyn_impacts` has the laws).
submodule (linkdyn_forward_system) linkdyn_forward_stops
    use linkdyn_clutch_states, only: set_guard
    use linkdyn_contact_forces, only: solve_contacts, solve_held
    use linkdyn_event_log, only: kind_release, kind_impact, kind_rest, kind_slip
    use linkdyn_followed_angles, only: angles_about
    use linkdyn_held_variables, only: n_held, away_from_stops, slips, push_coordinates, still_rates
    use linkdyn_impacts, only: find_impacts, find_resting
    use linkdyn_impulse_path, only: begin_path, most_trials, same_way, no_way
    use linkdyn_measures, only: find_events
    use linkdyn_planar_motion, only: level_velocity, level_given
    use linkdyn_slip_parts, only: goes_with_others, slip_speeds, slip_senses
    use linkdyn_stop_starts, only: touch_width
    use linkdyn_stop_states, only: hard_gaps, begin_gaps, rest_at_stop, leave_stop
    implicit none (type, external)

contains

    !> Joint variables strike stops. All whose gaps are closed there take part, those that rest as well (`linkdyn_impacts`). What
    !> has no speed left then rests, if it is pressed against its stop.
    module procedure meet_stops
        real(wp), dimension(lanes, n_stop(self%model%scene)) :: before, impulse, after, change
        real(wp) :: response(lanes, n_stop(self%model%scene), n_stop(self%model%scene))
        real(wp) :: of_coordinates(lanes, self%model%n_q, n_stop(self%model%scene))
        real(wp) :: rate(lanes, self%n), y_before(lanes, self%n), loss(lanes)
        logical, dimension(lanes, n_stop(self%model%scene)) :: touches, has_struck, is_closed, rested, rests, is_idle
        logical :: failed(lanes), is_struck(lanes)
        integer :: i, lane

        is_struck = any(strikes, dim=2)
        rested = self%way%stops%rests
        y_before = y
        call self%evaluate_on_lanes(t, y, rate, failed)
        call self%look_closely(t, y)
        before = away_from_stops(self%model, self%look, level_velocity)
        call note_slips_at_impact()
        call find_touching(self, t, is_struck, strikes, touches)
        call find_impulses()
        call push_coordinates(self%layout, touches, impulse, of_coordinates, y)
        y(:, self%layout%supplied) = y(:, self%layout%supplied) - loss
        call loosen_clutches(self, t, y, y_before, is_struck)
        if (holds_anywhere(self%way%clutch)) call still_rates(self%model, self%layout, self%way%clutch%holds, y)
        call self%look_closely(t, y)
        after = away_from_stops(self%model, self%look, level_velocity)
        do i = 1, size(before, 2)
            where (strikes(:, i) .and. after(:, i) < before(:, i)/2 .and. before(:, i) < 0)
                self%way%is_driven_through = .true.
                self%way%final_event = self%model%scene%stop(i)%event
            end where
        end do
        is_closed = is_closed .and. .not. is_idle
        call choose_resting(self, t, y, is_struck, touches, after, response, is_closed, rests)
        rests = rests .and. .not. is_idle
        call take_last_speed()
        call change_rests(self, is_struck, touches, rested, rests)
        call tell_from_rounding(self, is_idle)
        call tell()
        call renew_gaps(self, t, y, is_struck, rested)

    contains

        !> What comes to rest here moves by rounding of these speeds: no clutch that closes later slips by that.
        subroutine note_slips_at_impact()
            real(wp) :: slip(lanes, n_clutch(self%model%scene))

            if (size(slip, 2) == 0) return
            slip = slip_speeds(self%model, slips(self%model, self%look, level_velocity))
            where (spread(is_struck, 2, size(slip, 2))) self%way%clutch%fastest = max(self%way%clutch%fastest, slip)
        end subroutine note_slips_at_impact

        !> Impulses, and the responses to them along which they go.
        subroutine find_impulses()
            real(wp), dimension(lanes, size(before, 2)) :: speed, fastest, ratio
            real(wp) :: of_held(lanes, n_clutch(self%model%scene), size(before, 2))
            real(wp) :: along(lanes, n_held(self%model)), hardest(lanes), change_of_path(lanes)
            type(impulse_path) :: path
            logical :: jams(lanes), has_given_up
            integer :: trial

            speed = before
            fastest = self%way%stops%fastest
            hardest = self%way%stops%hardest
            along = 0
            along(:, :size(before, 2)) = merge(1.0_wp, 0.0_wp, strikes)
            ratio = spread(self%model%scene%stop%restitution, 1, lanes)
            call begin_path(along, motor_rates(self), path)
            do trial = 1, most_trials
                before = speed
                self%way%stops%fastest = fastest
                self%way%stops%hardest = hardest
                call find_stop_responses(self, touches, path, response, of_coordinates, of_held)
                call find_idle(self, touches, before, response, is_idle)
                where (is_idle) before = 0
                call throw_back(ratio)
                if (size(self%equations%lossy) == 0) return
                call path%let_rest(is_struck, ratio, has_given_up)
                if (has_given_up) cycle
                change_of_path = path%follow(is_struck, all_impulses(impulse, of_held))
                if (any(change_of_path > same_way)) cycle
                call path%throw_back(before, self%model%scene%stop%restitution, ratio, change_of_path)
                if (all(change_of_path <= same_way)) exit
            end do
            loss = loss + path%loss_beside_mean(path%along)
            jams = path%jams .or. change_of_path > no_way
            do i = 1, size(before, 2)
                jams = jams .or. (touches(:, i) .and. .not. response(:, i, i) >= 0)
            end do
            jams = jams .and. is_struck
            do i = 1, size(before, 2)
                where (jams)
                    impulse(:, i) = 0
                    after(:, i) = before(:, i)
                end where
                where (jams .and. strikes(:, i)) self%way%final_event = self%model%scene%stop(i)%event
            end do
            where (jams) loss = 0
            self%way%is_driven_through = self%way%is_driven_through .or. jams
            self%way%is_jammed = self%way%is_jammed .or. jams
        end subroutine find_impulses

        !> Impulses, lane by lane.
        subroutine throw_back(ratio)
            real(wp), intent(in) :: ratio(:, :)        !! of speeds behind and before (lane, n_stop)

            after = before
            impulse = 0
            loss = 0
            has_struck = .false.
            is_closed = .false.
            do lane = 1, lanes
                if (.not. is_struck(lane)) cycle
                call find_impacts(response(lane, :, :), ratio(lane, :), touches(lane, :), strikes(lane, :), &
                                  self%way%stops%fastest(lane, :), self%way%stops%hardest(lane), after(lane, :), impulse(lane, :), &
                                  has_struck(lane, :), is_closed(lane, :), loss(lane))
            end do
        end subroutine throw_back

        !> What comes to rest has no speed, to the last digit.
        subroutine take_last_speed()
            do lane = 1, lanes
                is_closed(lane, :) = rests(lane, :) .and. is_struck(lane)
            end do
            call solve_contacts(response, is_closed, -after, change)
            call push_coordinates(self%layout, touches, change, of_coordinates, y)
            impulse = impulse + change
            if (holds_anywhere(self%way%clutch)) call still_rates(self%model, self%layout, self%way%clutch%holds, y)
            y(:, self%layout%supplied) = y(:, self%layout%supplied) + sum(change*after, dim=2)/2
            loss = loss - sum(change*after, dim=2)/2
        end subroutine take_last_speed

        subroutine tell()
            do i = 1, size(before, 2)
                do lane = 1, lanes
                    if (.not. is_struck(lane)) cycle
                    if (has_struck(lane, i) .or. (rests(lane, i) .and. .not. rested(lane, i))) &
                        call note(merge(kind_rest, kind_impact, rests(lane, i)))
                    if (rested(lane, i) .and. .not. (rests(lane, i) .or. has_struck(lane, i))) call note(kind_release)
                end do
            end do
        end subroutine tell

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
    end procedure meet_stops

    module procedure meet_touched_stops
        real(wp), parameter :: rounded = 1.0e-12_wp    !! of the fastest impact: that is no speed
        real(wp) :: away(lanes, n_stop(self%model%scene))
        logical, dimension(lanes, n_stop(self%model%scene)) :: strikes, touches

        call self%look_closely(t, y)
        strikes = .false.
        call find_touching(self, t, is_wanted, strikes, touches)
        away = away_from_stops(self%model, self%look, level_velocity)
        strikes = touches .and. .not. self%way%stops%rests .and. away <= rounded*self%way%stops%fastest
        if (any(strikes)) call self%meet_stops(t, y, strikes)
    end procedure meet_touched_stops

    !> Contacts that take part in an impact: those that strike, those that rest, and all whose gaps are closed.
    subroutine find_touching(self, t, is_struck, strikes, touches)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t(lanes)
        logical, intent(in) :: is_struck(lanes)
        logical, intent(in) :: strikes(:, :)           !! (lane, n_stop)
        logical, intent(out) :: touches(:, :)          !! (lane, n_stop)
        real(wp), parameter :: near = 1.0e-12_wp       !! of the widest gap so far: that is closed
        real(wp) :: gap(lanes, size(touches, 2))
        integer :: i

        call measure_gaps(self, t, gap)
        do i = 1, size(gap, 2)
            associate (stop => self%model%scene%stop(i))
                touches(:, i) = is_struck .and. stop%is_hard .and. (strikes(:, i) .or. self%way%stops%rests(:, i) &
                                .or. gap(:, i) + self%way%stops%yielded(:, i) <= near*self%guard_scale(:, stop%event))
            end associate
        end do
    end subroutine find_touching

    !> Joint variables come to rest at stops, or leave them.
    subroutine change_rests(self, is_struck, touches, rested, rests)
        class(forward_system), intent(inout) :: self
        logical, intent(in) :: is_struck(lanes)
        logical, intent(in), dimension(:, :) :: touches, rested, rests     !! before and from here (lane, n_stop)
        integer :: lane, i

        do i = 1, size(rests, 2)
            do lane = 1, lanes
                if (.not. is_struck(lane)) cycle
                associate (e => self%model%scene%stop(i)%event)
                    if (rests(lane, i) .and. .not. rested(lane, i)) &
                        call rest_at_stop(lane, i, self%way%stops, self%guard_side(lane, e), self%guard_scale(lane, e))
                    if (.not. rests(lane, i) .and. (rested(lane, i) .or. touches(lane, i))) &
                        call leave_stop(lane, i, self%way%stops, self%guard_side(lane, e), self%guard_scale(lane, e))
                end associate
            end do
        end do
    end subroutine change_rests

    !> What a unit push of each stop in contact gives at stops and coordinates while clutches without capacity hold what they hold.
    subroutine find_stop_responses(self, touches, path, response, of_coordinates, of_held)
        class(forward_system), intent(inout) :: self
        logical, intent(in) :: touches(:, :)           !! (lane, n_stop)
        type(impulse_path), intent(inout) :: path
        real(wp), intent(out) :: response(:, :, :)     !! (lane, of stop, by stop)
        real(wp), intent(out) :: of_coordinates(:, :, :)    !! (lane, n_q, by stop)
        real(wp), intent(out) :: of_held(:, :, :)      !! impulses of these clutches (lane, n_clutch, by stop)
        real(wp) :: of_all(lanes, n_held(self%model), n_held(self%model))
        real(wp) :: coordinates_by_all(lanes, self%model%n_q, n_held(self%model))
        logical :: takes_part(lanes, n_held(self%model))
        real(wp), allocatable :: force(:)
        integer, allocatable :: held(:)
        integer :: lane, i, n

        n = size(touches, 2)
        takes_part(:, :n) = touches
        takes_part(:, n + 1:) = self%way%clutch%holds .and. spread(self%model%scene%clutch%is_positive, 1, lanes) &
                                .and. spread(any(touches, dim=2), 2, n_clutch(self%model%scene))
        call find_responses(self, takes_part, .true., of_all, coordinates_by_all, path)
        of_held = 0
        do lane = 1, lanes
            held = pack([(i, i=n + 1, n_held(self%model))], takes_part(lane, n + 1:))
            do i = 1, n
                force = solve_held(of_all(lane, held, held), of_all(lane, held, i))
                response(lane, :, i) = of_all(lane, :n, i) - matmul(of_all(lane, :n, held), force)
                of_coordinates(lane, :, i) = coordinates_by_all(lane, :, i) - matmul(coordinates_by_all(lane, :, held), force)
                of_held(lane, held - n, i) = -force
            end do
        end do
        call drop_rounding(sum(self%model%link%mass), touches, response, of_coordinates)
    end subroutine find_stop_responses

    !> Those of stops, and of the clutches that hold for them.
    pure function all_impulses(impulse, of_held) result(all)
        real(wp), intent(in) :: impulse(:, :)          !! (lane, n_stop)
        real(wp), intent(in) :: of_held(:, :, :)       !! see `find_stop_responses`
        real(wp) :: all(lanes, size(impulse, 2) + size(of_held, 2))
        integer :: i, n

        n = size(impulse, 2)
        all(:, :n) = impulse
        do i = 1, size(of_held, 2)
            all(:, n + i) = sum(of_held(:, i, :)*impulse, dim=2)
        end do
    end function all_impulses

    !> A push that acts on a lever of rounding has no response: an impulse that would make up for it were any number.
    pure subroutine drop_rounding(mass, touches, response, of_coordinates)
        real(wp), intent(in) :: mass                   !! of all links [kg]
        logical, intent(in) :: touches(:, :)           !! (lane, n_stop)
        real(wp), intent(inout) :: response(:, :, :)   !! (lane, of stop, by stop)
        real(wp), intent(inout) :: of_coordinates(:, :, :)  !! (lane, n_q, by stop)
        real(wp), parameter :: least_lever = 1.0e-10_wp     !! of one at which the stop acts on all links
        integer :: lane, i

        do i = 1, size(touches, 2)
            do lane = 1, lanes
                if (.not. touches(lane, i) .or. response(lane, i, i)*mass > least_lever**2) cycle
                response(lane, :, i) = 0
                response(lane, i, :) = 0
                of_coordinates(lane, :, i) = 0
            end do
        end do
    end subroutine drop_rounding

    !> Stops that no force of theirs moves away, and that nothing moves either: what they bound does not change, as the distance of
    !> two markers of one link does not, and comes to its stop by rounding alone. Nothing strikes them.
    subroutine find_idle(self, touches, speed, response, is_idle)
        class(forward_system), intent(in) :: self
        logical, intent(in) :: touches(:, :)           !! (lane, n_stop)
        real(wp), intent(in) :: speed(:, :)            !! apart (lane, n_stop)
        real(wp), intent(in) :: response(:, :, :)      !! (lane, of stop, by stop)
        logical, intent(out) :: is_idle(:, :)          !! (lane, n_stop)
        integer :: i

        do i = 1, size(touches, 2)
            is_idle(:, i) = touches(:, i) .and. .not. response(:, i, i) > 0 &
                            .and. abs(speed(:, i))*max(self%span, 1.0_wp) <= touch_width(self%model%scene%stop(i))
        end do
    end subroutine find_idle

    !> What comes to its stop by rounding alone does so no more: its gap has a sign beyond the rounding of what it is a difference
    !> of.
    subroutine tell_from_rounding(self, is_idle)
        class(forward_system), intent(inout) :: self
        logical, intent(in) :: is_idle(:, :)           !! (lane, n_stop)
        integer :: i

        do i = 1, size(is_idle, 2)
            associate (stop => self%model%scene%stop(i))
                where (is_idle(:, i)) self%guard_scale(:, stop%event) = max(self%guard_scale(:, stop%event), abs(stop%bound))
            end associate
        end do
    end subroutine tell_from_rounding

    !> An impact is more than any capacity: clutches with one slip from there, if it has moved their sides apart, and those that
    !> slipped slip the way that it has left them. Those that it has brought to rest are told so by their guards.
    subroutine loosen_clutches(self, t, y, y_before, is_struck)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t(lanes)
        real(wp), intent(in) :: y(:, :), y_before(:, :)
        logical, intent(in) :: is_struck(lanes)
        real(wp), parameter :: still = 1.0e-12_wp      !! of the hardest impact
        real(wp), dimension(lanes, n_clutch(self%model%scene)) :: before, after, change, speed, sense
        type(event_entry) :: entry
        real(wp) :: least
        logical :: held, is_part(n_clutch(self%model%scene))
        integer :: lane, i

        if (.not. any(self%way%clutch%is_closed)) return
        call self%look_closely(t, y_before)
        before = slips(self%model, self%look, level_velocity)
        call self%look_closely(t, y)
        after = slips(self%model, self%look, level_velocity)
        is_part = goes_with_others(self%model%scene)
        change = slip_speeds(self%model, after - before)
        speed = slip_speeds(self%model, after)
        sense = slip_senses(self%model, after)
        associate (of => self%way%clutch)
            do i = 1, size(after, 2)
                if (self%model%scene%clutch(i)%is_positive) cycle
                do lane = 1, lanes
                    if (.not. (is_struck(lane) .and. of%is_closed(lane, i))) cycle
                    held = of%holds(lane, i)
                    least = still*max(maxval(self%way%stops%fastest(lane, :)), of%fastest(lane, i))
                    if (held .and. change(lane, i) <= least) cycle
                    if (.not. held .and. is_part(i) .and. speed(lane, i) <= least) cycle
                    if (.not. (held .or. is_part(i)) .and. of%sense(lane, i)*after(lane, i) >= -least) cycle
                    of%holds(lane, i) = .false.
                    of%was_held(lane, i) = .false.
                    of%sense(lane, i) = sense(lane, i)
                    of%fastest(lane, i) = max(of%fastest(lane, i), speed(lane, i))
                    associate (e => self%model%scene%clutch(i)%event)
                        call set_guard(lane, i, is_part(i), of, self%guard_side(lane, e), self%guard_scale(lane, e))
                    end associate
                    if (.not. held .or. self%model%scene%clutch(i)%lead /= i) cycle
                    entry = event_entry(kind=kind_slip, direction=merge(0, nint(of%sense(lane, i)), is_part(i)))
                    call note_entry(self, t, y_before, lane, self%model%scene%clutch(i)%event, entry, y)
                end do
            end do
        end associate
    end subroutine loosen_clutches

    !> Which of the contacts that have no speed rest, by the accelerations that they have without any push of those struck.
    subroutine choose_resting(self, t, y, is_struck, touches, speed, response, is_closed, rests)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t(lanes)
        real(wp), intent(in) :: y(:, :)
        logical, intent(in) :: is_struck(lanes)
        logical, intent(in) :: touches(:, :)           !! (lane, n_stop)
        real(wp), intent(in) :: speed(:, :)            !! apart (lane, n_stop)
        real(wp), intent(in) :: response(:, :, :)      !! (lane, of, by)
        logical, intent(inout) :: is_closed(:, :)      !! it has no speed (lane, n_stop)
        logical, intent(out) :: rests(:, :)            !! (lane, n_stop)
        integer, parameter :: in_gap = 4, in_time = 256    !! last places: a bounce of so few cannot be told from rest
        real(wp), dimension(lanes, n_stop(self%model%scene)) :: away, widest
        real(wp) :: rate(lanes, self%n), least_gap(n_stop(self%model%scene)), least_time(lanes)
        logical :: failed(lanes), rested(lanes, n_stop(self%model%scene))
        integer :: lane, i

        rested = self%way%stops%rests
        rests = rested
        do lane = 1, lanes
            if (is_struck(lane)) self%way%stops%rests(lane, :) = .false.
        end do
        call self%evaluate_on_lanes(t, y, rate, failed)
        call self%look_closely(t, y, self%workspace%acceleration)
        away = away_from_stops(self%model, self%look, level_given)
        self%way%stops%rests = rested
        do i = 1, size(widest, 2)
            widest(:, i) = merge(self%way%stops%widest(:, i), self%guard_scale(:, self%model%scene%stop(i)%event), rested(:, i))
        end do
        least_gap = in_gap*epsilon(1.0_wp)*abs(self%model%scene%stop%bound)
        least_time = in_time*epsilon(1.0_wp)*max(abs(t), self%time_scale)
        do lane = 1, lanes
            if (is_struck(lane)) call find_resting(response(lane, :, :), touches(lane, :), speed(lane, :), away(lane, :), &
                                                   widest(lane, :), least_gap, least_time(lane), is_closed(lane, :), rests(lane, :))
        end do
    end subroutine choose_resting

    !> Gaps of hard stops, of states whose motion is in `look`.
    subroutine measure_gaps(self, t, gap)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t(lanes)
        real(wp), intent(out) :: gap(:, :)             !! (lane, n_stop); of other stops: none is closed
        real(wp) :: guard(lanes, self%n_guard)

        call find_events(self%model, self%look, angles_about(self%way%angles, t), guard)
        call hard_gaps(self%model, guard, gap)
    end subroutine measure_gaps

    !> Contacts that are closed behind what has happened begin their gaps there.
    module procedure renew_gaps
        real(wp) :: gap(lanes, n_stop(self%model%scene))

        call self%look_closely(t, y)
        call measure_gaps(self, t, gap)
        call begin_gaps(self%model, gap, is_wanted, rested, self%way%stops)
    end procedure renew_gaps
end submodule linkdyn_forward_stops
