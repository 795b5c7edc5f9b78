!> What clutches do where they close, open, come to rest or break loose: impulses of those without capacity, and who holds from there
!> (`linkdyn_clutch_states` has the rule).
submodule (linkdyn_forward_system) linkdyn_forward_clutches
    use linkdyn_clutch_states, only: share_load, set_guard
    use linkdyn_contact_forces, only: solve_contacts
    use linkdyn_event_log, only: kind_close, kind_open, kind_stick, kind_slip
    use linkdyn_held_variables, only: n_held, rates_held, slips, speed_of_sides, push_coordinates, still_rates
    use linkdyn_measures, only: find_kept
    use linkdyn_motor_laws, only: is_on
    use linkdyn_planar_motion, only: level_velocity
    implicit none (type, external)

contains

    !> The run begins here: clutches are open or closed, and what has no slip may be held.
    module procedure begin_with_clutches

        if (n_clutch(self%model%scene) == 0) return
        self%clutch%t_accepted = t
        call note_ease(self, spread(t, 1, lanes), y)
        self%clutch%begins = .true.
        call self%switch_now(t, y)
        self%clutch%begins = .false.
    end procedure begin_with_clutches

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
        call find_responses(self, t, y, takes_part, response, of_coordinates)
        do i = 1, n_clutch(self%model%scene)
            self%clutch%ease(:, i) = response(:, n_stop(self%model%scene) + i, n_stop(self%model%scene) + i)
        end do
    end subroutine note_ease

    !> An instant at which clutches may close or open.
    module procedure switch_now
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
    end procedure switch_now

    !> Slips of a state, on lane 1.
    module procedure slips_at
        real(wp) :: of_all(lanes, n_clutch(self%model%scene))

        call self%look_closely(spread(t, 1, lanes), y)
        of_all = slips(self%model, self%look, level_velocity)
        slip = of_all(1, :)
    end procedure slips_at

    !> Clutches close, open, come to rest or break loose. Those without capacity close by an impulse; then it is decided who holds.
    module procedure engage
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
            call self%look_closely(t, y)
            slip = slips(self%model, self%look, level_velocity)
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
            call self%look_closely(t, y)
            slip = slips(self%model, self%look, level_velocity)
            do i = 1, size(slip, 2)
                where (locks(:, i)) of%fastest(:, i) = max(of%fastest(:, i), abs(slip(:, i)))
            end do
            do i = 1, size(slip, 2)
                least = max(still*max(of%fastest(:, i), merge(maxval(of%fastest, dim=2), 0.0_wp, any(locks, dim=2))), &
                            rounded*speed_of_sides(self%model, self%look, i))
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
                    call set_guard(lane, i, of, self%guard_side(lane, event_of(i)), self%guard_scale(lane, event_of(i)))
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
    end procedure engage

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
        real(wp), dimension(lanes, n_held(self%model)) :: push, wanted
        real(wp) :: response(lanes, n_held(self%model), n_held(self%model)), rate(lanes, self%n)
        real(wp) :: of_coordinates(lanes, self%model%n_q, n_held(self%model))
        logical :: takes_part(lanes, n_held(self%model)), failed(lanes)
        integer :: i

        takes_part = .false.
        takes_part(:, n_stop(self%model%scene) + 1:) = locks
        call self%evaluate_on_lanes(t, y, rate, failed)
        call self%look_closely(t, y)
        before = slips(self%model, self%look, level_velocity)
        call find_responses(self, t, y, takes_part, response, of_coordinates)
        wanted = 0
        wanted(:, n_stop(self%model%scene) + 1:) = -before
        call solve_contacts(response, takes_part, wanted, push)
        call push_coordinates(self%layout, takes_part, push, of_coordinates, y)
        impulse = push(:, n_stop(self%model%scene) + 1:)
        call self%look_closely(t, y)
        after = slips(self%model, self%look, level_velocity)
        loss = -sum(impulse*(before + after), dim=2)/2
        y(:, self%layout%supplied) = y(:, self%layout%supplied) - loss
        do i = 1, size(locks, 2)
            where (locks(:, i) .and. abs(after(:, i)) > small*maxval(abs(before), dim=2, mask=locks))
                self%is_driven_through = .true.
                self%final_event = self%model%scene%clutch(i)%event
            end where
        end do
    end subroutine lock

    !> Which of the clutches without slip hold from here; what rounding has left of the slip of those goes.
    subroutine decide(self, t, y, is_concerned, is_free, must_slip, positive)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t(lanes)
        real(wp), intent(inout) :: y(:, :)
        logical, intent(in) :: is_concerned(lanes)
        logical, intent(in) :: is_free(:, :)           !! without slip (lane, n_clutch)
        logical, intent(in) :: must_slip(:, :)         !! break loose (lane, n_clutch)
        logical, intent(in) :: positive(:, :)          !! whatever comes is held (lane, n_clutch)
        real(wp), dimension(lanes, n_held(self%model)) :: none, away, change, most, capacity, sense, here
        real(wp) :: response(lanes, n_held(self%model), n_held(self%model)), rate(lanes, self%n)
        real(wp) :: of_coordinates(lanes, self%model%n_q, n_held(self%model)), grip(lanes, n_clutch(self%model%scene))
        logical, dimension(lanes, n_held(self%model)) :: takes_part, holds
        real(wp), parameter :: rigid = 1.0e-10_wp      !! of the largest response so far: where a joint turns back while others move on,
                                                       !! nothing at it stops them
        logical :: failed(lanes), may_hold(lanes, n_clutch(self%model%scene))
        integer, allocatable :: of(:)
        integer :: lane, i, n

        n = n_stop(self%model%scene)
        takes_part(:, :n) = self%stops%rests
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
            call self%look_closely(t, y)
            call solve_contacts(response, takes_part .and. holds .and. spread(is_concerned, 2, n_held(self%model)), &
                                -rates_held(self%model, self%look, level_velocity), change)
            call push_coordinates(self%layout, takes_part, change, of_coordinates, y)
            call still_rates(self%model, self%layout, self%clutch%holds, y)
        end if
        call self%look_closely(t, y)
        call find_kept(self%model, self%look, angles_about(self%angles, t), here(:, n + 1:))
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
            if (.not. has_sticking(self%model)) return
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
end submodule linkdyn_forward_clutches
