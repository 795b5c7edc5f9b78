!> Controllers of a run: sampled ones act at accepted states, continuous ones at every state evaluated.
submodule (linkdyn_forward_system) linkdyn_forward_control
    use linkdyn_control_law, only: control_sight
    use linkdyn_controlled_drives, only: find_demands, see_states, run_controllers, add_outputs
    use linkdyn_controllers, only: next_instant, take_samples, put_out_samples
    use linkdyn_drives, only: effort_scale
    use linkdyn_measures, only: find_measures
    use linkdyn_scene, only: is_sampled
    implicit none (type, external)

contains

    !> The next instant at which a controller takes a sample, or one takes effect; huge: none. Steps must end there.
    module procedure next_control
        next = huge(next)
        if (self%control%has_sampled) next = next_instant(self%model%scene%controller, self%control%state)
    end procedure next_control

    !> An accepted state: controllers take the samples that are due there, and put out those whose delay has passed.
    module procedure control_now
        type(control_sight) :: sight(lanes, self%control%state%n)
        real(wp) :: measure(lanes, size(self%model%scene%laws%measure))

        if (.not. self%control%has_sampled) return
        call self%look_closely(spread(t, 1, lanes), y)
        call find_laws(self%model, self%look)
        call find_measures(self%model, self%look, measure)
        call show_states(self, spread(t, 1, lanes), y, measure, self%look%law, is_sampled(self%model%scene%controller), sight)
        call take_samples(self%model%scene%controller, t, sight, self%control%state)
        call put_out_samples(self%model%scene%controller, t, self%control%state)
    end procedure control_now

    !> What controllers see at states, of which measures and laws over the state are known.
    subroutine show_states(self, t, y, measure, law, is_wanted, sight)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t(lanes)               !! [s]
        real(wp), intent(in) :: y(:, :)                !! (lane, n)
        real(wp), intent(in) :: measure(:, :), law(:, :)       !! (lane, measure), (lane, law)
        logical, intent(in) :: is_wanted(:)            !! (n_controller)
        type(control_sight), intent(out) :: sight(:, :)        !! (lane, n_controller)

        call find_demands(self%model, self%layout, t, y, self%turns, self%n_used, is_wanted, self%way%assembly, self%of_motion, &
                          self%control)
        call see_states(self%model, t, measure, law, is_wanted, self%of_motion, self%control, sight)
    end subroutine show_states

    !> Continuous controllers at states.
    subroutine let_control(self, t, y, measure, law)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t(lanes)               !! [s]
        real(wp), intent(in) :: y(:, :)                !! (lane, n)
        real(wp), intent(in) :: measure(:, :), law(:, :)       !! (lane, measure), (lane, law)
        type(control_sight) :: sight(lanes, self%control%state%n)

        call show_states(self, t, y, measure, law, .not. is_sampled(self%model%scene%controller), sight)
        call run_controllers(self%model, self%layout, y, sight, self%control)
    end subroutine let_control

    !> Outputs of all controllers on top of what drives give; continuous ones look at the state, which is in the workspace.
    module procedure drive_by_controllers
        real(wp) :: measure(lanes, size(self%model%scene%laws%measure))

        if (self%control%has_continuous) then
            call find_measures(self%model, self%workspace%state, measure)
            call let_control(self, t, y, measure, self%workspace%state%law)
        end if
        call add_outputs(self%model, self%control, self%workspace%driving_force)
    end procedure drive_by_controllers

    !> The same as `drive_by_controllers` in a record's samples, whose laws are applied.
    module procedure drive_record_by_controllers
        integer :: i, lane(lanes)

        lane = [(min(i, n), i=1, lanes)]
        associate (samples => self%record%samples)
            if (self%control%has_continuous) call let_control(self, t(lane), y(lane, :), &
                transpose(samples%measured(:samples%n_measure, lane)), transpose(samples%law(:, lane)))
            do i = 1, self%control%state%n
                associate (k => self%model%scene%controller(i)%actuator)
                    samples%effort(k, :n) = samples%effort(k, :n) + effort_scale(self%model, k)*self%control%state%output(:n, i)
                end associate
            end do
            samples%is_left(:n) = samples%is_left(:n) .or. .not. sum(abs(self%control%state%output(:n, :)), 2) <= huge(1.0_wp)
        end associate
    end procedure drive_record_by_controllers
end submodule linkdyn_forward_control
