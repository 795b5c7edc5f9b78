!> Coordinates that come to dead points: when the caller has to do something about one, and which steps lead too far.
submodule (linkdyn_forward_system) linkdyn_forward_watch
    use linkdyn_bounce_watch, only: measure_end, look_at_end, gains_of, watch_loose_steps
    use linkdyn_coordinate_watch, only: compare_rates, note_rates, is_well_past, is_near_dead_point, dead_coordinate, largest_growth
    implicit none (type, external)

contains

    !> Compare the rates at an accepted state.
    module procedure look_at
        call unpack_state(self%model, self%layout, t, y, self%turns, self%watch%state)
        call evaluate_assembled(self%model, t, self%way%assembly, self%watch%state)
        call compare_rates(self%model, self%watch%state, self%watch)
    end procedure look_at

    !> The last stage of the step, its columns at hand, tells whether to look at the accepted state itself.
    module procedure watch_coordinates
        call note_rates(self%watch)
        if (self%watch%is_compared) then
            self%watch%ratio = self%watch%ratio_tried
        else
            call compare_there(self)
        end if
        if (is_near_dead_point(self%watch) .or. dead_coordinate(self%watch, .false.) > 0) call look_and_decide(self, t, y)
    end procedure watch_coordinates

    !> Has the caller to do something about a coordinate?
    module procedure look_and_decide
        call self%look_at(t, y)
        if (self%watch%may_exchange) then
            self%wants_rest = is_near_dead_point(self%watch)
        else
            self%wants_rest = dead_coordinate(self%watch, .false.) > 0
        end if
    end procedure look_and_decide

    !> Note by which tolerances steps will be taken: whether a mechanism thrown back is looked for at their ends.
    module procedure watch_ends
        call watch_loose_steps(self%model, self%equations%unknown%acceleration, rtol, atol, self%way%bounce)
        self%looks_at_ends = self%way%bounce%is_on
    end procedure watch_ends

    !> Has a coordinate come past where it should be exchanged, or the mechanism been thrown back at its dead point?
    module procedure leads_too_far
        real(wp), allocatable :: accepted(:, :)

        leads_too_far = .false.
        if (self%way%bounce%is_on) leads_too_far = bounces_there(self, t)
        if (leads_too_far) return
        if (.not. self%watch%is_on) return
        accepted = self%watch%ratio
        call compare_there(self)
        leads_too_far = is_well_past(self%watch, accepted)
        self%watch%ratio_tried = self%watch%ratio
        self%watch%is_compared = .true.
        self%watch%ratio = accepted
    end procedure leads_too_far

    !> What a unit rate of it makes has grown most since the start, and as much as no coordinate in use may.
    module procedure stalled_coordinate
        type(kinematic_state) :: state
        type(carried_assembly) :: start
        real(wp), dimension(self%model%n_q) :: before, now

        stalled = 0
        if (.not. self%way%bounce%is_on) return
        call prepare_kinematics(self%model, self%model%n_q, state)
        call begin_assembly(self%model, t, start)
        state%q = spread(self%model%start_q, 1, lanes)
        call evaluate_assembled(self%model, spread(t, 1, lanes), start, state)
        before = gains_of(self%model, state, self%way%bounce)
        call unpack_state(self%model, self%layout, spread(t, 1, lanes), y, self%turns, state)
        call evaluate_assembled(self%model, spread(t, 1, lanes), self%way%assembly, state)
        now = gains_of(self%model, state, self%way%bounce)
        where (self%layout%rate > 0 .and. now <= huge(1.0_wp) .and. before > 0)
            now = now/before
        elsewhere
            now = 0
        end where
        if (any(now > largest_growth)) stalled = maxloc(now, 1)
    end procedure stalled_coordinate

    !> Is the mechanism thrown back in the state evaluated last?
    logical function bounces_there(self, t) result(bounces)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t                      !! of it [s]
        real(wp), dimension(3, size(self%way%bounce%joint) + size(self%way%bounce%link)) :: rate, acceleration

        if (self%way%bounce%is_recorded .and. sees_end(self)) then
            rate = seen_motion(self, is_acceleration=.false.)
            acceleration = seen_motion(self, is_acceleration=.true.)
        else
            call catch_up(self)
            call measure_end(self%model, self%workspace%state, self%workspace%acceleration(1, :), self%way%bounce, rate, &
                             acceleration)
        end if
        call look_at_end(t, rate, acceleration, self%way%bounce, bounces)
    end function bounces_there

    !> Compare the rates in the state evaluated last.
    subroutine compare_there(self)
        class(forward_system), intent(inout) :: self

        if (sees_end(self)) then
            call compare_seen(self)
        else
            call catch_up(self)
            call compare_rates(self%model, self%workspace%state, self%watch)
        end if
    end subroutine compare_there

    !> Motion of the state evaluated last in the workspace: of a run's one solution, on all lanes.
    subroutine catch_up(self)
        class(forward_system), intent(inout) :: self
        real(wp) :: t(lanes)

        if (.not. self%is_behind) return
        t = self%t_tried
        call unpack_state(self%model, self%layout, t, spread(self%y_tried, 1, lanes), self%turns, self%workspace%state)
        call evaluate_assembled(self%model, t, self%way%assembly, self%workspace%state)
        self%held%is_measured = .false.
        self%is_behind = .false.
    end subroutine catch_up
end submodule linkdyn_forward_watch
