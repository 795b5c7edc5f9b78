!> Whole steps of the classical Runge-Kutta method by the scene's record: as one kernel they take half as long as from stage to
!> stage, with all that a run asks between these.
!>
!> A step is judged with the next one, whose kernel looks at the state that it sets out from: so all steps but the last are accepted
!> here, and whoever has asked for them accepts that one as any other. What is not surely right on a lane is left to the stages.
submodule (linkdyn_forward_system) linkdyn_forward_steps
    use linkdyn_agreement, only: agreement, are_alike
    use linkdyn_carried_assembly, only: accept_seen
    use linkdyn_forward_record, only: make_forward_steps, place_still
    use linkdyn_lock, only: hold_records, release_records
    use linkdyn_rk4, only: rk4_workspace, rk4_step
    use linkdyn_steps_at_once, only: use_steps_at_once, set_out, try_step, judge_length, &
        keep_length, take_step, tell_end
    use linkdyn_whole_turns, only: whole_turns, may_any_have_turns
    implicit none (type, external)

contains

    module procedure make_steps_at_once
        if (.not. can_take_steps(self)) return
        call hold_records()
        associate (shared => self%shared)
            if (.not. shared%rates%steps%is_made) then
                call make_forward_steps(self%model, self%layout, self%equations%unknown, self%wants_work, shared%poses, &
                                        shared%rates)
                if (shared%rates%steps%is_made) call compare_with_stages(self, t, length, y, shared%steps_agree)
            end if
        end associate
        call release_records()
    end procedure make_steps_at_once

    module procedure use_steps
        if (.not. self%has_record_now(t)) return
        if (.not. (self%shared%steps_agree .and. can_take_steps(self))) return
        call use_steps_at_once(self%model, self%n, self%record, self%steps)
    end procedure use_steps

    !> Rates that hang on the state alone, lanes that go on from what a record sees, and nothing to be looked out for within steps.
    logical function can_take_steps(self) result(can)
        type(forward_system), intent(in) :: self

        can = self%may_record .and. associated(self%record%recorded)
        if (can) can = self%record%stands_still .and. size(self%model%group) == 0 .and. self%n_guard == 0 &
                       .and. self%record%recorded%model%n_branch == self%model%n_branch .and. .not. self%lanes_are_one
        if (can .and. self%way%assembly%is_needed) can = self%looks%is_usable
        if (can) can = .not. (self%way%bounce%is_on .or. self%watch%is_on .or. self%may_jump .or. wraps_anywhere(self%of_joints) &
                              .or. wraps_anywhere(self%way%angles))
    end function can_take_steps

    !> Do steps at once lead to where the stages lead? Asked once, from about where runs begin: a difference would be a defect.
    subroutine compare_with_stages(self, t, length, y, agree)
        type(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t, length              !! [s]
        real(wp), intent(in), contiguous :: y(:, :)
        logical, intent(out) :: agree
        real(wp), parameter :: spread_of_rates = 0.01_wp       !! from lane to lane, part of them
        type(rk4_workspace) :: work
        type(whole_steps) :: at_once
        type(agreement) :: of_steps
        real(wp), dimension(lanes, self%n) :: by_stages, here
        logical :: failed(lanes)
        integer :: k, lane

        call work%prepare(self%n)
        here = y
        do k = 1, self%model%n_q
            associate (rate => here(:, self%layout%rate(k)))
                rate = rate*(1 + spread_of_rates*[(lane, lane=1, lanes)])
            end associate
        end do
        by_stages = here
        call rk4_step(self, spread(t, 1, lanes), spread(length, 1, lanes), by_stages, work, failed)
        call use_steps_at_once(self%model, self%n, self%record, self%steps)
        work%rest = 0
        call take_steps_by_record(self, t, length, 1, here, work%begin, work%rest, at_once)
        do lane = 1, lanes
            if (failed(lane) .or. .not. (at_once%n == 1 .or. at_once%is_sure(lane))) cycle
            if (at_once%n == 0) here(lane, :) = at_once%y(lane, :)
            call of_steps%note(are_alike(by_stages(lane, :), here(lane, :)))
        end do
        agree = of_steps%is_reached()
        self%steps%is_usable = .false.
    end subroutine compare_with_stages

    module procedure take_steps_by_record
        logical :: goes(lanes)

        steps%n = 0
        steps%is_sure = .false.
        steps%is_accepted = .false.
        if (.not. self%steps%is_usable) return
        call place_still(self%model, self%layout, self%way%assembly, lanes, lanes, y, self%record)
        goes = .not. self%is_idle
        if (any(self%record%samples%is_left(:lanes) .and. goes)) return
        call set_out(length, y, rest, self%way%assembly, self%steps)
        do
            call try_step(self%record, self%steps)
            if (any(self%steps%is_left .and. goes)) exit
            if (steps%n > 0 .and. self%way%assembly%is_needed) call accept_here(self, goes, steps)
            if (steps%is_accepted) exit
            call judge_length(goes, self%steps, steps%watch)
            if (any(steps%watch%is_too_long .and. goes)) exit
            call keep_length(goes, length, self%steps, steps%watch)
            call take_step(self%steps)
            steps%n = steps%n + 1
            if (steps%n == n_most) exit
            if (has_turns(self, self%steps%found(:, :, self%steps%here))) exit
        end do
        if (steps%is_accepted) then
            call go_on_to(self, t + steps%n*length, goes, self%steps%here, self%steps%tried)
        else if (steps%n > 1) then
            call go_on_to(self, t + (steps%n - 1)*length, goes, self%steps%before, self%steps%here)
        else if (steps%n == 0) then
            call tell_tried(self, goes, steps)
            return
        end if
        call tell_end(goes, self%steps, y, begin, rest)
        self%n_by_record = self%n_by_record + 4*steps%n
        self%way%n_accepted = self%way%n_accepted + steps%n - merge(0, 1, steps%is_accepted)
    end procedure take_steps_by_record

    !> The state that has been reached is as the step from it has seen it. One that breaks the law of energy ends the steps.
    subroutine accept_here(self, goes, steps)
        type(forward_system), intent(inout) :: self
        logical, intent(in) :: goes(lanes)
        type(whole_steps), intent(inout) :: steps

        associate (seen => self%steps%found(:, :, self%steps%tried), at => self%steps%at, out => self%steps%out)
            call weigh_energy(seen(:, out%energy), seen(:, out%kinetic), &
                              self%steps%found(:, at%y + self%layout%supplied - 1, self%steps%here), self%way%energy)
            call self%judge_energy(at%drift - at%margin, seen(:, at%margin:at%drift - 1), steps%is_broken)
        end associate
        steps%is_broken = steps%is_broken .and. goes
        steps%is_accepted = any(steps%is_broken)
    end subroutine accept_here

    !> The assembly goes on to the state accepted last, as the step from it has seen it. No change point lies between.
    subroutine go_on_to(self, t, goes, state, seen)
        type(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t                      !! there [s]
        logical, intent(in) :: goes(lanes)
        integer, intent(in) :: state, seen             !! where they are among what is kept
        real(wp) :: instant(lanes), no_place(0, 0), no_column(0, 0, 0)

        if (.not. self%way%assembly%is_needed) return
        instant = t
        associate (found => self%steps%found, at => self%steps%at)
            call unpack_state(self%model, self%layout, instant, found(:, at%y:at%rest - 1, state), self%turns, &
                              self%way%assembly%state)
            call accept_seen(self%model, instant, goes, found(:, at%margin:at%drift - 1, seen), &
                             found(:, at%drift:at%y - 1, seen), no_place, no_column, self%way%assembly)
        end associate
    end subroutine go_on_to

    !> No step can be taken on all lanes: those of the others are told.
    subroutine tell_tried(self, goes, steps)
        type(forward_system), intent(in) :: self
        logical, intent(in) :: goes(lanes)
        type(whole_steps), intent(inout) :: steps

        steps%is_sure = goes .and. .not. self%steps%is_left
        associate (found => self%steps%found(:, :, self%steps%tried), at => self%steps%at)
            steps%y = found(:, at%y:at%rest - 1)
            steps%rest = found(:, at%rest:at%n)
        end associate
    end subroutine tell_tried

    !> Has an angle made a whole turn, which steps that go on leave out?
    pure logical function has_turns(self, found)
        type(forward_system), intent(in) :: self
        real(wp), intent(in), contiguous :: found(:, :)        !! where a step has led
        integer :: k

        has_turns = .false.
        do k = 1, self%n
            if (.not. self%is_angle(k)) cycle
            associate (angle => found(:, self%steps%at%y + k - 1))
                if (may_any_have_turns(lanes, angle)) has_turns = has_turns .or. any(abs(whole_turns(angle)) > 0)
            end associate
        end do
    end function has_turns
end submodule linkdyn_forward_steps
