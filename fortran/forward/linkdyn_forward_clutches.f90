!> What clutches do where they close, open, come to rest or break loose: impulses of those without capacity, and who holds from
!> there (`linkdyn_clutch_states` has the rule).
submodule (linkdyn_forward_system) linkdyn_forward_clutches
    use linkdyn_clutch_friction, only: carried_load
    use linkdyn_clutch_states, only: is_clutched, share_load, response_beside, set_guard
    use linkdyn_contact_forces, only: solve_contacts
    use linkdyn_event_log, only: kind_close, kind_open, kind_stick, kind_slip, kind_release
    use linkdyn_followed_angles, only: angles_about
    use linkdyn_held_variables, only: n_held, rates_held, slips, speed_of_sides, push_coordinates, still_rates
    use linkdyn_impacts, only: find_locking
    use linkdyn_impulse_path, only: begin_path, most_trials, same_way, no_way
    use linkdyn_measures, only: find_kept
    use linkdyn_motor_laws, only: is_on
    use linkdyn_planar_motion, only: level_velocity, level_given
    use linkdyn_scene, only: scene_type
    use linkdyn_slip_parts, only: goes_with_others, slip_levers, still_speeds, slip_speeds, slip_senses, &
        with_lead, find_way_loose, list_held
    use linkdyn_stop_starts, only: touch_width
    use linkdyn_stop_states, only: leave_stop
    implicit none (type, external)

contains

    !> The run begins here: clutches are open or closed, and what has no slip may be held.
    module procedure begin_with_clutches

        if (n_clutch(self%model%scene) == 0) return
        self%way%clutch%t_accepted = t
        call note_ease(self, spread(t, 1, lanes), y)
        self%way%clutch%begins = .true.
        call self%switch_now(t, y)
        call loosen_what_cannot_hold(self, spread(t, 1, lanes), y)
        self%way%clutch%begins = .false.
    end procedure begin_with_clutches

    !> Friction that slides presses joints otherwise than what holds: who is found to hold by more than its grip slips from here.
    subroutine loosen_what_cannot_hold(self, t, y)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t(lanes)
        real(wp), intent(inout) :: y(:, :)
        real(wp), parameter :: rounding = 1.0e-9_wp    !! of the grip
        logical, dimension(lanes, n_clutch(self%model%scene)) :: is_closed, cannot
        real(wp) :: rate(lanes, self%n)
        logical :: failed(lanes)
        integer :: i, k

        if (.not. has_sticking(self%model)) return
        is_closed = self%way%clutch%is_closed
        do i = 1, size(cannot, 2)
            call self%evaluate_on_lanes(t, y, rate, failed)
            do k = 1, size(cannot, 2)
                cannot(:, k) = self%way%clutch%holds(:, k) .and. self%model%scene%clutch(k)%friction > 0 &
                               .and. carried_load(self%model, k, self%way%clutch) > (1 + rounding)*self%way%clutch%capacity(:, k)
            end do
            if (.not. any(cannot)) return
            call engage(self, t, y, is_closed, cannot)
        end do
    end subroutine loosen_what_cannot_hold

    !> How much clutches have to hold, where the run begins.
    subroutine note_ease(self, t, y)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t(lanes)
        real(wp), intent(in) :: y(:, :)
        real(wp) :: response(lanes, n_held(self%model), n_held(self%model)), rate(lanes, self%n)
        real(wp) :: of_coordinates(lanes, self%model%n_q, n_held(self%model))
        logical :: takes_part(lanes, n_held(self%model)), failed(lanes)
        integer :: i

        takes_part(:, :n_stop(self%model%scene)) = .false.
        takes_part(:, n_stop(self%model%scene) + 1:) = .true.
        call self%evaluate_on_lanes(t, y, rate, failed)
        call find_responses(self, takes_part, .false., response, of_coordinates)
        do i = 1, n_clutch(self%model%scene)
            self%way%clutch%ease(:, i) = response(:, n_stop(self%model%scene) + i, n_stop(self%model%scene) + i)
        end do
    end subroutine note_ease

    !> An instant at which clutches may close or open.
    module procedure switch_now
        logical, dimension(lanes, n_clutch(self%model%scene)) :: is_closed, none
        integer :: i

        if (present(is_changed)) is_changed = .false.
        if (n_clutch(self%model%scene) == 0) return
        do i = 1, size(is_closed, 2)
            is_closed(:, i) = is_on(self%model%scene%clutch(i)%switch_spec, t + 4*spacing(t), self%way%clutch%switched(:, i), &
                                    self%way%clutch%was_closed(:, i))
        end do
        if (all(is_closed .eqv. self%way%clutch%is_closed)) return
        none = .false.
        call self%show_side(spread(t, 1, lanes), y, is_behind=.false.)
        call engage(self, spread(t, 1, lanes), y, is_closed, none)
        if (present(is_changed)) is_changed = .true.
    end procedure switch_now

    !> Slips of a state, on lane 1.
    module procedure slips_at
        real(wp) :: of_all(lanes, n_clutch(self%model%scene))

        call self%look_closely(spread(t, 1, lanes), y)
        of_all = slips(self%model, self%look, level_velocity)
        slip = of_all(1, :)
    end procedure slips_at

    !> Which way surfaces slide at an accepted state, once they do.
    module procedure follow_slips
        real(wp), dimension(lanes, n_clutch(self%model%scene)) :: slip, speed, sense
        real(wp) :: still_speed(n_clutch(self%model%scene))
        logical :: is_part(n_clutch(self%model%scene))
        integer :: i

        if (.not. is_clutched(self%way%clutch)) return
        is_part = goes_with_others(self%model%scene)
        if (.not. any(spread(is_part, 1, lanes) .and. abs(self%way%clutch%sense) > 0)) return
        call self%look_closely(t, y)
        slip = slips(self%model, self%look, level_velocity)
        speed = slip_speeds(self%model, slip)
        sense = slip_senses(self%model, slip)
        still_speed = still_speeds(self%model)
        do i = 1, size(slip, 2)
            if (.not. is_part(i)) cycle
            where (is_accepted .and. self%way%clutch%is_closed(:, i) .and. .not. self%way%clutch%holds(:, i) &
                   .and. speed(:, i) > still_speed(i)) self%way%clutch%sense(:, i) = sense(:, i)
        end do
    end procedure follow_slips

    !> Clutches close, open, come to rest or break loose. Those without capacity close by an impulse; then it is decided who holds,
    !> and what the impulse drives onto stops strikes them.
    module procedure engage
        real(wp), parameter :: same_instant = 4096     !! last places of the clock: steps behind an event are some tens long
        real(wp), dimension(lanes, size(is_closed, 2)) :: impulse
        real(wp) :: y_before(lanes, self%n), loss(lanes)
        logical, dimension(lanes, size(is_closed, 2)) :: held, stood, was_closed, must_slip, positive, locks, is_free, alone
        logical, dimension(lanes, n_stop(self%model%scene)) :: opens, rested
        logical :: is_concerned(lanes), is_part(size(is_closed, 2))
        integer :: lane, i

        is_part = goes_with_others(self%model%scene)
        alone = .not. spread(is_part, 1, lanes)
        y_before = y
        held = self%way%clutch%holds
        stood = held .or. self%way%clutch%is_spared
        was_closed = self%way%clutch%is_closed
        must_slip = has_crossed .and. held .and. is_closed
        where (must_slip) self%way%clutch%loosened = spread(t, 2, size(held, 2))
        ! What has broken loose at this instant does not hold again before anything has moved: others that do so then would hold
        ! in turn, without end.
        must_slip = must_slip .or. (is_closed .and. .not. held .and. spread(self%model%scene%clutch%friction > 0, 1, lanes) &
                                    .and. self%way%clutch%loosened >= spread(t - same_instant*spacing(t), 2, size(held, 2)))
        is_concerned = any((is_closed .neqv. was_closed) .or. has_crossed, dim=2)
        positive = spread(self%model%scene%clutch%is_positive, 1, lanes)
        call note_slips(self, t, y, was_closed, held)
        self%way%clutch%is_closed = is_closed
        self%way%clutch%holds = held .and. is_closed
        where (.not. is_closed) self%way%clutch%sense = 0
        self%way%clutch%is_spared = self%way%clutch%is_spared .and. is_closed
        locks = is_closed .and. .not. was_closed .and. positive
        impulse = 0
        loss = 0
        opens = .false.
        rested = self%way%stops%rests
        if (any(locks)) call lock(self, t, y, positive .and. is_closed .and. spread(any(locks, dim=2), 2, size(locks, 2)), &
                                  impulse, loss, opens)
        ! A surface that has turned right round while it slid has slipped at a right angle in between, and had not come to rest.
        call find_free(self, t, y, is_concerned, has_crossed, (has_crossed .and. (alone .or. held)) .or. positive, &
                       stood, locks, is_free)
        call decide(self, t, y, is_concerned, is_free, must_slip, positive)
        do lane = 1, lanes
            if (.not. is_concerned(lane)) cycle
            if (self%way%is_jammed(lane)) y(lane, :) = y_before(lane, :)
            self%way%clutch%longest(lane) = 0
            do i = 1, size(locks, 2)
                associate (e => self%model%scene%clutch(i)%event)
                    call set_guard(lane, i, is_part(i), self%way%clutch, self%guard_side(lane, e), self%guard_scale(lane, e))
                end associate
            end do
        end do
        call tell()
        call tell_opened()
        if (any(opens)) call renew_gaps(self, t, y, any(opens, dim=2), rested)
        if (any(locks)) call self%meet_touched_stops(t, y, any(locks, dim=2))

    contains

        subroutine tell_opened()
            type(event_entry) :: entry

            entry%kind = kind_release
            entry%direction = -1
            do i = 1, size(opens, 2)
                do lane = 1, lanes
                    if (opens(lane, i)) call note_entry(self, t, y_before, lane, self%model%scene%stop(i)%event, entry, y)
                end do
            end do
        end subroutine tell_opened

        subroutine tell()
            do lane = 1, lanes
                if (.not. is_concerned(lane) .or. (self%way%clutch%begins .and. .not. any(abs(impulse(lane, :)) > 0))) cycle
                do i = 1, size(locks, 2)
                    if (.not. tells(self%model%scene, i)) cycle
                    if (was_closed(lane, i) .and. .not. is_closed(lane, i)) then
                        call note(kind_open)
                    else if (stands(lane, i) .and. .not. stood(lane, i)) then
                        call note(merge(kind_close, kind_stick, locks(lane, i)))
                    else if (stood(lane, i) .and. .not. stands(lane, i)) then
                        call note(kind_slip)
                    else if (is_closed(lane, i) .and. .not. was_closed(lane, i)) then
                        call note(kind_close)
                    end if
                end do
            end do
        end subroutine tell

        pure logical function stands(lane, i)
            integer, intent(in) :: lane, i

            stands = self%way%clutch%holds(lane, i) .or. self%way%clutch%is_spared(lane, i)
        end function stands

        subroutine note(kind)
            integer, intent(in) :: kind
            type(event_entry) :: entry

            entry%kind = kind
            if (.not. is_part(i)) entry%direction = nint(self%way%clutch%sense(lane, i))
            entry%impulse = size_of_impulse(self%model%scene, i, impulse(lane, :))
            if (findloc(locks(lane, :), .true., dim=1) == i) entry%loss = loss(lane)
            call note_entry(self, t, y_before, lane, self%model%scene%clutch(i)%event, entry, y)
        end subroutine note
    end procedure engage

    !> Is it the first of those that share an event, which tells of all?
    pure logical function tells(scene, i)
        type(scene_type), intent(in) :: scene
        integer, intent(in) :: i                       !! clutch

        tells = scene%event(scene%clutch(i)%event)%clutch == i
    end function tells

    !> The impulse by which a clutch closes, with all that close with it; where forces are among them, that of the forces.
    pure real(wp) function size_of_impulse(scene, i, impulse) result(length)
        type(scene_type), intent(in) :: scene
        integer, intent(in) :: i                       !! clutch
        real(wp), intent(in) :: impulse(:)             !! of all (n_clutch)
        logical, dimension(size(impulse)) :: is_part, is_force

        is_part = scene%clutch%event == scene%clutch(i)%event
        is_force = scene%clutch%unit == "N"
        length = norm2(pack(impulse, is_part .and. (is_force .eqv. any(is_part .and. is_force))))
    end function size_of_impulse

    !> How fast clutches have slipped so far, before anything happens.
    subroutine note_slips(self, t, y, was_closed, held)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t(lanes)
        real(wp), intent(in) :: y(:, :)
        logical, intent(in), dimension(:, :) :: was_closed, held   !! (lane, n_clutch)
        real(wp) :: slip(lanes, size(held, 2))
        integer :: i

        call self%look_closely(t, y)
        slip = slip_speeds(self%model, slips(self%model, self%look, level_velocity))
        do i = 1, size(slip, 2)
            associate (fastest => self%way%clutch%fastest(:, i), e => self%model%scene%clutch(i)%event)
                where (was_closed(:, i)) fastest = max(fastest, self%guard_scale(:, e), slip(:, i))
                where (held(:, i)) fastest = max(fastest, slip(:, i))
            end associate
        end do
    end subroutine note_slips

    !> Which closed clutches have no slip behind impulses, and may hold; the others slip from here. What an impulse has passed by is
    !> held as before, and what others do concerns none that has a slip.
    subroutine find_free(self, t, y, is_concerned, has_crossed, is_free_anyway, held, locks, is_free)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t(lanes)
        real(wp), intent(in) :: y(:, :)
        logical, intent(in) :: is_concerned(lanes)
        logical, intent(in), dimension(:, :) :: has_crossed, is_free_anyway, held, locks   !! (lane, n_clutch)
        logical, intent(out) :: is_free(:, :)          !! (lane, n_clutch)
        real(wp), parameter :: still = 1.0e-12_wp      !! of the fastest slip so far, and of what an impulse has changed
        real(wp), parameter :: rounded = 1.0e-14_wp    !! of the rates whose difference the slip is
        real(wp), dimension(lanes, size(held, 2)) :: slip, sense
        real(wp) :: least(lanes), still_speed(size(held, 2))
        integer :: i

        call self%look_closely(t, y)
        slip = slips(self%model, self%look, level_velocity)
        sense = slip_senses(self%model, slip)
        slip = slip_speeds(self%model, slip)
        still_speed = still_speeds(self%model)
        associate (of => self%way%clutch)
            do i = 1, size(slip, 2)
                where (locks(:, i)) of%fastest(:, i) = max(of%fastest(:, i), slip(:, i))
                ! what closes where others hold has seen no slip of its own: rounding is left of theirs
                where (.not. of%fastest(:, i) > 0 .and. any(held, dim=2)) of%fastest(:, i) = maxval(of%fastest, dim=2)
            end do
            do i = 1, size(slip, 2)
                least = max(still*max(of%fastest(:, i), merge(maxval(of%fastest, dim=2), 0.0_wp, any(locks, dim=2))), &
                            rounded*speed_of_sides(self%model, self%look, i), merge(still_speed(i), 0.0_wp, has_crossed(:, i)))
                is_free(:, i) = of%is_closed(:, i) .and. (is_free_anyway(:, i) .or. slip(:, i) <= least &
                                                          .or. (held(:, i) .and. .not. any(locks, dim=2)))
                where (is_concerned .and. of%is_closed(:, i) .and. .not. is_free(:, i))
                    of%holds(:, i) = .false.
                    of%is_spared(:, i) = .false.
                    of%sense(:, i) = sense(:, i)
                end where
            end do
        end associate
    end subroutine find_free

    !> Clutches without capacity take away all slip between their sides, those that hold already among them. What rests at stops may
    !> be lifted off, or pressed there.
    subroutine lock(self, t, y, locks, impulse, loss, opens)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t(lanes)
        real(wp), intent(inout) :: y(:, :)
        logical, intent(in) :: locks(:, :)             !! (lane, n_clutch)
        real(wp), intent(out) :: impulse(:, :)         !! [N s, N m s] (lane, n_clutch)
        real(wp), intent(out) :: loss(lanes)           !! of energy [J]
        logical, intent(out) :: opens(:, :)            !! nothing rests there any more (lane, n_stop)
        real(wp), parameter :: small = 1.0e-9_wp       !! of the largest slip that there was: none is left
        real(wp), dimension(lanes, n_held(self%model)) :: before, after, push
        real(wp) :: response(lanes, n_held(self%model), n_held(self%model)), rate(lanes, self%n)
        real(wp) :: of_coordinates(lanes, self%model%n_q, n_held(self%model))
        real(wp), dimension(lanes) :: energy_before, energy_after, kinetic, change
        logical, dimension(lanes, n_held(self%model)) :: takes_part, is_lock, leaves, gives_way
        logical, dimension(lanes) :: has_locked, failed, jams
        type(impulse_path) :: path
        integer :: lane, i, n, trial

        n = n_stop(self%model%scene)
        has_locked = any(locks, dim=2)
        is_lock(:, :n) = .false.
        is_lock(:, n + 1:) = locks
        takes_part = is_lock
        takes_part(:, :n) = self%way%stops%rests .and. spread(has_locked, 2, n)
        call self%evaluate_on_lanes(t, y, rate, failed)
        call self%look_closely(t, y)
        call energy_of_motion(self%model, self%look, energy_before, kinetic)
        before = rates_held(self%model, self%look, level_velocity)
        call begin_path(merge(-before, 0.0_wp, is_lock), motor_rates(self), path)
        do trial = 1, most_trials
            call find_responses(self, takes_part, .true., response, of_coordinates, path)
            do lane = 1, lanes
                call find_locking(response(lane, :, :), is_lock(lane, :), takes_part(lane, :) .and. .not. is_lock(lane, :), &
                                  before(lane, :), self%way%stops%hardest(lane), push(lane, :), leaves(lane, :), &
                                  gives_way(lane, :))
            end do
            change = 0
            if (size(self%equations%lossy) > 0) change = path%follow(has_locked, push)
            if (all(change <= same_way)) exit
        end do
        jams = has_locked .and. size(self%equations%lossy) > 0 &
               .and. (path%jams .or. change > no_way .or. .not. sum(push*before, dim=2) <= 0)
        self%way%is_jammed = self%way%is_jammed .or. jams
        where (spread(jams, 2, size(push, 2)))
            push = 0
            leaves = .false.
            gives_way = .false.
        end where
        call push_coordinates(self%layout, takes_part, push, of_coordinates, y)
        impulse = push(:, n + 1:)
        opens = leaves(:, :n)
        call self%look_closely(t, y)
        after = rates_held(self%model, self%look, level_velocity)
        call energy_of_motion(self%model, self%look, energy_after, kinetic)
        loss = -sum(push*(before + after), dim=2)/2
        if (size(self%equations%lossy) > 0) loss = loss + path%loss_beside_mean(push)
        y(:, self%layout%supplied) = y(:, self%layout%supplied) - loss
        if (any(self%layout%rate(:self%model%n_q) == 0)) &
            call count_drives_work(self%layout, has_locked, energy_after - energy_before, loss, y)
        do i = 1, size(locks, 2)
            where (locks(:, i) .and. abs(after(:, n + i)) > small*maxval(abs(before), dim=2, mask=is_lock))
                self%way%is_driven_through = .true.
                self%way%final_event = self%model%scene%clutch(i)%event
            end where
        end do
        do i = 1, n
            associate (e => self%model%scene%stop(i)%event)
                where (gives_way(:, i))
                    self%way%is_driven_through = .true.
                    self%way%final_event = e
                end where
                do lane = 1, lanes
                    if (opens(lane, i)) &
                        call leave_stop(lane, i, self%way%stops, self%guard_side(lane, e), self%guard_scale(lane, e))
                end do
            end associate
        end do
    end subroutine lock

    !> What is driven keeps its motion while a clutch closes: its drive works in an impulse, by what the mechanism has gained and
    !> the clutch has lost.
    subroutine count_drives_work(layout, has_locked, gained, loss, y)
        type(state_layout), intent(in) :: layout
        logical, intent(in) :: has_locked(lanes)
        real(wp), intent(in), dimension(lanes) :: gained, loss    !! [J]
        real(wp), intent(inout) :: y(:, :)             !! (lane, n)

        where (has_locked)
            y(:, layout%work) = y(:, layout%work) + (gained + loss)
            y(:, layout%supplied) = y(:, layout%supplied) + (gained + loss)
        end where
    end subroutine count_drives_work

    !> Which of the clutches without slip hold from here, and which way the others slip; what rounding has left of a slip that
    !> holds, or goes the other way, goes.
    subroutine decide(self, t, y, is_concerned, is_free, must_slip, positive)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t(lanes)
        real(wp), intent(inout) :: y(:, :)
        logical, intent(in) :: is_concerned(lanes)
        logical, intent(in) :: is_free(:, :)           !! without slip (lane, n_clutch)
        logical, intent(in) :: must_slip(:, :)         !! break loose (lane, n_clutch)
        logical, intent(in) :: positive(:, :)          !! whatever comes is held (lane, n_clutch)
        real(wp) :: response(lanes, n_held(self%model), n_held(self%model)), rate(lanes, self%n)
        real(wp) :: of_coordinates(lanes, self%model%n_q, n_held(self%model)), sense(lanes, n_held(self%model))
        logical, dimension(lanes, n_held(self%model)) :: takes_part, holds, is_part, is_concerned_there
        real(wp) :: against(lanes, size(is_free, 2))
        logical :: failed(lanes)
        integer :: lane, n

        n = n_stop(self%model%scene)
        takes_part(:, :n) = self%way%stops%rests
        takes_part(:, n + 1:) = is_free
        is_concerned_there = takes_part .and. spread(is_concerned, 2, size(takes_part, 2))
        is_part(:, :n) = .false.
        is_part(:, n + 1:) = spread(goes_with_others(self%model%scene), 1, lanes)
        holds = takes_part
        holds(:, n + 1:) = is_free .and. .not. must_slip
        sense = 0
        against = slip_senses(self%model, -self%way%clutch%force/spread(slip_levers(self%model)**2, 1, lanes))
        where (must_slip) sense(:, n + 1:) = against
        do lane = 1, lanes
            if (.not. is_concerned(lane)) cycle
            where (is_free(lane, :)) self%way%clutch%holds(lane, :) = .false.
            where (is_free(lane, :)) self%way%clutch%sense(lane, :) = 0
            where (is_free(lane, :)) self%way%clutch%is_spared(lane, :) = .false.
        end do
        if (any(is_free .and. spread(is_concerned, 2, size(is_free, 2)))) then
            call self%evaluate_on_lanes(t, y, rate, failed)
            call find_responses(self, takes_part, .false., response, of_coordinates)
            if (any(is_part)) call take_last_slip(self, t, is_part, sense, is_concerned_there, takes_part, response, &
                                                  of_coordinates, y)
            call share_loads(self, t, y, is_concerned, is_free, positive, takes_part, response, holds, sense)
            call take_last_slip(self, t, holds .or. is_part, sense, is_concerned_there, takes_part, response, &
                                of_coordinates, y)
            call settle_ways(self, t, y, is_concerned, is_free, response(:, n + 1:, n + 1:))
        end if
        call keep_places(self, t, y, is_concerned)
    end subroutine decide

    !> Loads are shared among what could hold at an instant: stops at which something rests, and the clutches that are free to. The
    !> motion of the state is in the workspace.
    subroutine share_loads(self, t, y, is_concerned, is_free, positive, takes_part, told_response, holds, sense)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t(lanes)
        real(wp), intent(in) :: y(:, :)
        logical, intent(in) :: is_concerned(lanes)
        logical, intent(in), dimension(:, :) :: is_free, positive  !! (lane, n_clutch)
        logical, intent(in) :: takes_part(:, :)        !! (lane, n_held)
        real(wp), intent(in) :: told_response(:, :, :) !! (lane, of, by)
        logical, intent(inout) :: holds(:, :)          !! those that must slip do not; then those that hold (lane, n_held)
        real(wp), intent(inout) :: sense(:, :)         !! of those that must slip; then of all that slip (lane, n_held)
        real(wp), dimension(lanes, size(holds, 2)) :: none, away, told_sense, push
        real(wp), dimension(lanes, size(holds, 2), size(holds, 2)) :: response
        real(wp), dimension(lanes, size(is_free, 2)) :: grip, moves
        real(wp) :: rate(lanes, self%n), first_sense(size(holds, 2)), lever(size(holds, 2))
        integer :: lead(size(holds, 2))
        logical, dimension(lanes, size(is_free, 2)) :: may_hold, seems_held
        logical :: failed(lanes), told_holds(lanes, size(holds, 2)), first_holds(size(holds, 2)), is_part(size(is_free, 2))
        integer :: lane, n

        n = n_stop(self%model%scene)
        is_part = goes_with_others(self%model%scene)
        call list_held(self%model, lead, lever)
        response = told_response
        call find_able(self, is_free, response, may_hold)
        call find_grip(self, t, y, may_hold, grip, push)
        call self%evaluate_on_lanes(t, y, rate, failed)
        none = 0
        call accelerate(self, none, away)
        call lead_through_hold(size(self%equations%lossy) > 0 .or. (has_sticking(self%model) .and. holds_alone()), push, away, &
                               response)
        where (is_free .and. .not. (may_hold .or. positive))
            holds(:, n + 1:) = .false.
            sense(:, n + 1:) = slip_senses(self%model, away(:, n + 1:))
        end where
        told_holds = holds
        told_sense = sense
        do lane = 1, lanes
            if (is_concerned(lane)) call share(lane)
        end do
        if (.not. has_sticking(self%model)) return
        ! Friction that slides presses joints otherwise than what holds all of them: by that, too, they must slip, and the way in
        ! which they then do.
        seems_held = self%way%clutch%holds
        call self%evaluate_on_lanes(t, y, rate, failed)
        grip = self%way%clutch%capacity
        call self%look_closely(t, y, self%workspace%acceleration)
        moves = slips(self%model, self%look, level_given)
        do lane = 1, lanes
            if (.not. is_concerned(lane) .or. .not. any(is_free(lane, :) .and. .not. seems_held(lane, :))) cycle
            first_holds = holds(lane, :)
            first_sense = sense(lane, :)
            holds(lane, :) = told_holds(lane, :)
            sense(lane, :) = told_sense(lane, :)
            call share(lane)
            if (count(holds(lane, :)) > count(first_holds)) cycle
            if (count(holds(lane, :)) == count(first_holds) .and. goes_back(lane)) cycle
            holds(lane, :) = first_holds
            sense(lane, :) = first_sense
            call take(lane)
        end do

    contains

        !> Is there but one that may hold?
        function holds_alone() result(is)
            logical :: is(lanes)

            is = count(may_hold, dim=2) + count(takes_part(:, :n), dim=2) == 1
        end function holds_alone

        !> Does what was found to slip at first go the other way?
        logical function goes_back(lane)
            integer, intent(in) :: lane
            real(wp), parameter :: rounded = 1.0e-9_wp

            goes_back = any(is_free(lane, :) .and. .not. (seems_held(lane, :) .or. goes_with_others(self%model%scene)) &
                            .and. first_sense(n + 1:)*moves(lane, :) < -rounded*maxval(abs(away(lane, :))))
        end function goes_back

        subroutine share(lane)
            integer, intent(in) :: lane
            real(wp), dimension(size(holds, 2)) :: most, capacity
            logical :: may_spare(size(holds, 2))
            logical, allocatable :: part_holds(:)
            real(wp), allocatable :: part_sense(:)
            integer, allocatable :: of(:)
            integer :: i

            most = huge(1.0_wp)
            capacity = 0
            do i = 1, size(is_free, 2)
                if (self%model%scene%clutch(i)%friction > 0) self%way%clutch%capacity(lane, i) = grip(lane, i)
                if (positive(lane, i)) cycle
                capacity(n + i) = self%way%clutch%capacity(lane, i)
                most(n + i) = self%model%scene%clutch(i)%static*capacity(n + i)
            end do
            of = pack([(i, i=1, size(holds, 2))], takes_part(lane, :))
            if (size(of) == 0) return
            part_holds = holds(lane, of)
            part_sense = sense(lane, of)
            ! what joints rub hangs on what is shared here
            may_spare(:n) = .false.
            may_spare(n + 1:) = may_hold(lane, :) .and. self%model%scene%clutch%friction == 0
            call share_load(lead(of), lever(of), response(lane, of, of), away(lane, of), most(of), capacity(of), of > n, &
                            may_spare(of), part_holds, part_sense)
            holds(lane, of) = part_holds
            sense(lane, of) = part_sense
            call take(lane)
        end subroutine share

        subroutine take(lane)
            integer, intent(in) :: lane

            where (is_free(lane, :)) self%way%clutch%holds(lane, :) = holds(lane, n + 1:)
            where (is_free(lane, :)) self%way%clutch%sense(lane, :) = sense(lane, n + 1:)
            where (is_free(lane, :)) self%way%clutch%is_spared(lane, :) = .not. (holds(lane, n + 1:) .or. is_part) &
                                                                         .and. .not. abs(sense(lane, n + 1:)) > 0
        end subroutine take
    end subroutine share_loads

    !> Surfaces that begin to slide along several joint variables press otherwise than they did while they were held: the way that
    !> they keep is that of the accelerations that there are while they slide so.
    subroutine settle_ways(self, t, y, is_concerned, is_free, response)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t(lanes)
        real(wp), intent(in) :: y(:, :)
        logical, intent(in) :: is_concerned(lanes)
        logical, intent(in) :: is_free(:, :)           !! (lane, n_clutch)
        real(wp), intent(in) :: response(:, :, :)      !! of clutches (lane, of, by)
        integer, parameter :: most_turns = 30
        real(wp), parameter :: settled = 1.0e-12_wp
        real(wp) :: rate(lanes, self%n), moves(lanes, size(is_free, 2)), lever(size(is_free, 2)), change
        logical :: failed(lanes), is_part(size(is_free, 2))
        integer :: turn, lane, i

        is_part = goes_with_others(self%model%scene)
        lever = slip_levers(self%model)
        do turn = 1, most_turns
            if (.not. any(begins_to_slide())) return
            call self%evaluate_on_lanes(t, y, rate, failed)
            call self%look_closely(t, y, self%workspace%acceleration)
            moves = slips(self%model, self%look, level_given)
            change = 0
            do lane = 1, lanes
                do i = 1, size(is_free, 2)
                    if (self%model%scene%clutch(i)%lead == i) call turn_way(lane, i)
                end do
            end do
            if (change <= settled) return
        end do

    contains

        function begins_to_slide() result(begins)
            logical :: begins(lanes, size(is_free, 2))

            begins = is_free .and. .not. self%way%clutch%holds .and. spread(is_concerned, 2, size(is_free, 2)) &
                     .and. spread(is_part, 1, lanes)
        end function begins_to_slide

        subroutine turn_way(lane, i)
            integer, intent(in) :: lane, i
            real(wp), allocatable :: own(:, :), way(:)
            integer, allocatable :: part(:), held(:)
            logical :: begins(lanes, size(is_free, 2)), is_held
            integer :: k

            begins = begins_to_slide()
            if (.not. begins(lane, i) .or. failed(lane)) return
            part = pack([(k, k=1, size(is_part))], self%model%scene%clutch%lead == i)
            held = pack([(k, k=1, size(is_part))], is_free(lane, :) .and. self%way%clutch%holds(lane, :))
            own = response_beside(response(lane, :, :), part, held, self%model%scene%clutch%lead, lever)
            way = self%way%clutch%sense(lane, part)
            call find_way_loose(response_beside(response(lane, :, :), part, part(:0), &
                                                self%model%scene%clutch%lead, lever), own, &
                                self%way%clutch%capacity(lane, i)/lever(i), lever(part)*moves(lane, part), way, is_held)
            change = max(change, norm2(way - self%way%clutch%sense(lane, part)))
            self%way%clutch%sense(lane, part) = way
        end subroutine turn_way
    end subroutine settle_ways

    !> Which of the free clutches can hold anything: where a joint turns back while others move on, nothing at it stops them. Of
    !> those that go together one is enough.
    subroutine find_able(self, is_free, response, may_hold)
        class(forward_system), intent(inout) :: self
        logical, intent(in) :: is_free(:, :)           !! (lane, n_clutch)
        real(wp), intent(in) :: response(:, :, :)      !! (lane, of, by)
        logical, intent(out) :: may_hold(:, :)         !! (lane, n_clutch)
        integer :: i

        do i = 1, size(is_free, 2)
            associate (ease => response(:, n_stop(self%model%scene) + i, n_stop(self%model%scene) + i))
                where (is_free(:, i)) self%way%clutch%ease(:, i) = max(self%way%clutch%ease(:, i), ease)
            end associate
        end do
        may_hold = is_free .and. is_movable(self, response)
        do i = 1, size(is_free, 2)
            associate (of_lead => may_hold(:, self%model%scene%clutch(i)%lead))
                of_lead = of_lead .or. may_hold(:, i)
            end associate
        end do
        may_hold = with_lead(self%model%scene, may_hold)
    end subroutine find_able

    !> What transmissions lose of a push bends the answer to it, and so does what joints rub by it. The responses become those
    !> between no push and the one that holds all: who is to hold by himself is judged by what he has to hold then. To a push far
    !> larger joints answer as rubbed by that alone, and at the edge of what friction holds it would be found to let go, and to
    !> come to rest again at once. Of several that hold by friction what each has to hold is not told but by rounding, where they
    !> hold the same: there the responses stay.
    subroutine lead_through_hold(is_bent, push, away, response)
        logical, intent(in) :: is_bent(lanes)
        real(wp), intent(in), dimension(:, :) :: push, away    !! that holds all; accelerations without any (lane, n_held)
        real(wp), intent(inout) :: response(:, :, :)   !! (lane, of, by)
        real(wp) :: missing(size(push, 2)), square
        integer :: lane, i

        do lane = 1, lanes
            if (.not. is_bent(lane)) cycle
            square = dot_product(push(lane, :), push(lane, :))
            if (.not. (square > 0 .and. square <= huge(1.0_wp))) cycle
            missing = merge(-away(lane, :) - matmul(response(lane, :, :), push(lane, :)), 0.0_wp, push(lane, :) /= 0)
            do i = 1, size(push, 2)
                response(lane, :, i) = response(lane, :, i) + missing*(push(lane, i)/square)
            end do
        end do
    end subroutine lead_through_hold

    !> Does anything move by a push of a clutch? Where a joint turns back while others move on, nothing does.
    pure function is_movable(self, response)
        class(forward_system), intent(in) :: self
        real(wp), intent(in) :: response(:, :, :)      !! (lane, of, by)
        logical :: is_movable(lanes, n_clutch(self%model%scene))
        real(wp), parameter :: rigid = 1.0e-10_wp      !! of the largest response so far: nothing is left of it
        integer :: i

        do i = 1, size(is_movable, 2)
            associate (ease => response(:, n_stop(self%model%scene) + i, n_stop(self%model%scene) + i))
                is_movable(:, i) = ease > rigid*self%way%clutch%ease(:, i)
            end associate
        end do
    end function is_movable

    !> What joints that may stick could hold: by the reactions while all that could hold do. And what these have to hold then.
    subroutine find_grip(self, t, y, may_hold, grip, push)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t(lanes)
        real(wp), intent(in) :: y(:, :)
        logical, intent(in) :: may_hold(:, :)          !! (lane, n_clutch)
        real(wp), intent(out) :: grip(:, :)            !! (lane, n_clutch) [N, N m]
        real(wp), intent(out) :: push(:, :)            !! (lane, n_held) [N, N m]; where nothing sticks, and nothing is lost, 0
        real(wp) :: rate(lanes, self%n)
        logical :: held(lanes, size(may_hold, 2)), failed(lanes)

        grip = 0
        push = 0
        if (.not. has_sticking(self%model) .and. size(self%equations%lossy) == 0) return
        held = self%way%clutch%holds
        self%way%clutch%holds = held .or. may_hold
        call self%evaluate_on_lanes(t, y, rate, failed)
        grip = self%way%clutch%capacity
        push(:, :n_stop(self%model%scene)) = merge(self%way%stops%push, 0.0_wp, self%way%stops%rests)
        push(:, n_stop(self%model%scene) + 1:) = merge(self%way%clutch%applied - self%way%clutch%rub, 0.0_wp, self%way%clutch%holds)
        self%way%clutch%holds = held
    end subroutine find_grip

    !> What holds has no slip, and no speed at its stop, to the last digit, nor has what is to slip the other way: else it would
    !> cross zero again at this instant, and so on without end. At a joint that turns back while others move on there is nothing to
    !> take: what rounding is of its speed would be a jump of theirs.
    subroutine take_last_slip(self, t, holds, sense, is_concerned, takes_part, response, of_coordinates, y)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t(lanes)
        logical, intent(in) :: holds(:, :)             !! (lane, n_held)
        real(wp), intent(in) :: sense(:, :)            !! of what slips (lane, n_held)
        logical, intent(in) :: is_concerned(:, :), takes_part(:, :)    !! (lane, n_held)
        real(wp), intent(in) :: response(:, :, :)      !! (lane, of, by)
        real(wp), intent(in) :: of_coordinates(:, :, :)    !! (lane, n_q, by)
        real(wp), intent(inout) :: y(:, :)
        real(wp), dimension(lanes, size(holds, 2)) :: rate, change
        logical :: goes_back(lanes, size(holds, 2))
        integer :: n

        call self%look_closely(t, y)
        rate = rates_held(self%model, self%look, level_velocity)
        call refuse_speed_at_rest(self, is_concerned .and. holds, rate, response)
        n = n_stop(self%model%scene)
        goes_back = sense*rate < 0
        goes_back(:, n + 1:) = goes_back(:, n + 1:) .and. is_movable(self, response)
        call solve_contacts(response, is_concerned .and. (holds .or. goes_back), -rate, change)
        call push_coordinates(self%layout, takes_part, change, of_coordinates, y)
        call still_rates(self%model, self%layout, self%way%clutch%holds, y)
    end subroutine take_last_slip

    !> What rests at a stop has but what rounding and steps have left of its speed: more is not taken from it in silence. The motion
    !> of the state is in `look`.
    subroutine refuse_speed_at_rest(self, holds, rate, response)
        class(forward_system), intent(inout) :: self
        logical, intent(in) :: holds(:, :)             !! (lane, n_held)
        real(wp), intent(in) :: rate(:, :)             !! (lane, n_held) [m/s, rad/s]
        real(wp), intent(in) :: response(:, :, :)      !! (lane, of, by)
        real(wp), parameter :: much = 1.0e-2_wp        !! of the kinetic energy
        real(wp), parameter :: far = 1.0e7_wp          !! over what counts as touching, within the run
        real(wp), dimension(lanes) :: energy, kinetic
        integer :: i

        if (.not. any(holds(:, :n_stop(self%model%scene)))) return
        call energy_of_motion(self%model, self%look, energy, kinetic)
        do i = 1, n_stop(self%model%scene)
            associate (stop => self%model%scene%stop(i), speed => abs(rate(:, i)))
                where (holds(:, i) .and. speed**2 > much*2*kinetic*response(:, i, i) &
                       .and. speed*max(self%span, 1.0_wp) > far*touch_width(stop))
                    self%way%is_driven_through = .true.
                    self%way%final_event = stop%event
                end where
            end associate
        end do
    end subroutine refuse_speed_at_rest

    !> Clutches that hold from here remember where they hold their joint variables.
    subroutine keep_places(self, t, y, is_concerned)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t(lanes)
        real(wp), intent(in) :: y(:, :)
        logical, intent(in) :: is_concerned(lanes)
        real(wp) :: here(lanes, n_clutch(self%model%scene))
        integer :: i

        call self%look_closely(t, y)
        call find_kept(self%model, self%look, angles_about(self%way%angles, t), here)
        associate (of => self%way%clutch)
            do i = 1, size(here, 2)
                where (is_concerned .and. of%holds(:, i) .and. .not. of%was_held(:, i)) of%kept(:, i) = here(:, i)
                where (is_concerned) of%was_held(:, i) = of%holds(:, i)
            end do
        end associate
    end subroutine keep_places
end submodule linkdyn_forward_clutches
