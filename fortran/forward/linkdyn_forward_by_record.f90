!> Rates by a record of the scene, shared by the run's evaluations, and the judgement whether it may be used.
submodule (linkdyn_forward_system) linkdyn_forward_by_record
    use linkdyn_agreement, only: agreement, are_alike
    use linkdyn_carried_assembly, only: stand_there
    use linkdyn_clutch_friction, only: tell_contacts
    use linkdyn_constants, only: least_accuracy
    use linkdyn_contact, only: n_part
    use linkdyn_cylinder_states, only: drive_record_by_cylinders
    use linkdyn_energy_balance, only: energy_of_motion
    use linkdyn_step_ends, only: wants_looks, choose_looks, use_looks, angles_seen
    use linkdyn_forward_record, only: make_forward_rates, use_forward_rates, place_states, place_still, &
        close_states, run_states, carry_states, take_rates, place_touches, leave_doubtful, doubt_far, keep_stages, &
        apply_record_laws, run_losing
    use linkdyn_forward_state, only: fill_start
    use linkdyn_joint_rates, only: measure_joints
    use linkdyn_led_mechanism, only: measure_margins
    use linkdyn_lock, only: hold_records, release_records
    use linkdyn_look_program, only: look_choice
    use linkdyn_motion_forces, only: record_motion_forces, is_motion_of
    use linkdyn_motor_states, only: drive_record_by_motors
    use linkdyn_recorded_rates, only: run_looks
    use linkdyn_representatives, only: representative_poses, set_in_motion
    use linkdyn_shared_programs, only: shared_programs, hold_programs
    use linkdyn_stage_places, only: forget_stages
    use linkdyn_whole_turns, only: least_angle
    implicit none (type, external)

contains

    !> Use the mechanism's record from now on, if it has one that finds what the lanes find. Whoever comes first makes it: the
    !> others wait.
    module procedure make_record
        type(look_choice) :: choice

        if (.not. allocated(self%y_tried)) allocate (self%y_tried(self%n))
        self%has_motor_laws = motors_have_laws(self%model)
        self%has_cylinders = any(self%layout%pressure > 0)
        call hold_records()
        if (.not. associated(self%shared)) call hold_programs(self%shared)
        associate (shared => self%shared)
            if (.not. associated(shared%rates)) then
                allocate (shared%rates)
                if (wants_looks(self%model)) then
                    call choose_looks(self%model, self%equations%unknown%acceleration, choice)
                    call make_forward_rates(self%model, self%layout, self%equations%unknown, self%wants_work, shared%poses, &
                                            shared%rates, choice)
                else
                    call make_forward_rates(self%model, self%layout, self%equations%unknown, self%wants_work, shared%poses, &
                                            shared%rates)
                end if
                call use_forward_rates(self%model, self%layout, shared%rates, .true., drives_record(self), self%record)
                if (shared%rates%is_usable) call compare_with_lanes(self, t, shared%poses%q, shared%agrees, shared%sees)
                call forget_stages(self%record%stage)
            else
                call use_forward_rates(self%model, self%layout, shared%rates, .true., drives_record(self), self%record)
            end if
            self%may_record = shared%agrees
            if (self%may_record .and. shared%sees) call use_looks(self%model, self%layout, shared%rates, self%looks)
            if (self%may_record) call record_motion(self, t, shared)
        end associate
        call release_records()
        self%way%n_before_record = min(self%way%n_before_record, self%way%n_accepted*self%evaluations_a_step)
        if (self%may_record) call help_lanes(self)
    end procedure make_record

    !> Does the run put driving forces into the record's samples?
    pure logical function drives_record(self)
        class(forward_system), intent(in) :: self

        drives_record = any(self%by_inverse) .or. self%has_motor_laws .or. self%has_cylinders .or. self%control%state%n > 0
    end function drives_record

    !> Forces of the scene's motion by a record, too; where coordinates stand in for others it is another model that the motion is
    !> of.
    subroutine record_motion(self, t, shared)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t                      !! [s]
        type(shared_programs), intent(inout) :: shared
        type(representative_poses) :: poses

        if (is_motion_of(self%of_motion, self%model)) then
            call record_motion_forces(t, self%of_motion, shared%poses, shared%of_motion)
        else
            call record_motion_forces(t, self%of_motion, poses, shared%of_motion)
        end if
    end subroutine record_motion

    !> Groups are closed by the record's programs where lanes look at a state, too.
    subroutine help_lanes(self)
        class(forward_system), intent(inout) :: self

        nullify (self%way%assembly%closer)
        if (self%record%recorded%closing%is_usable) self%way%assembly%closer => self%record%recorded%closing
    end subroutine help_lanes

    !> dy/dt of the lanes used; the arrays may end there.
    module procedure evaluate_by_record
        if (self%record%stands_still) then
            call run_still(self, n_lane, t, y, is_left)
        else
            call run_moving(self, n_lane, t, y, is_left)
        end if
        associate (n => self%n_used)
            call take_rates(n, self%record, n_lane, y, self%model%n_q, self%workspace%acceleration, rate)
            if (self%record%stands_still) return
            call pack_control_rates(self%layout, n, self%control, rate)
            if (self%has_motor_laws) call pack_current_rates(self%layout, n, self%way%motors, rate)
            if (self%has_cylinders) call pack_pressure_rates(self%model, self%layout, n, self%cylinders, rate)
            if (self%may_jump) call self%note_mode(self%record%samples%mode(:n), rate, is_left)
        end associate
    end procedure evaluate_by_record

    !> Run the record where nothing but states and branches changes.
    subroutine run_still(self, n_lane, t, y, is_left)
        class(forward_system), intent(inout) :: self
        integer, intent(in) :: n_lane                  !! of the arrays: those used at least
        real(wp), intent(in) :: t(n_lane), y(n_lane, self%n)
        logical, intent(inout) :: is_left(n_lane)      !! that the record does not serve

        associate (n => self%n_used)
            call place_still(self%model, self%layout, self%way%assembly, n, n_lane, y, self%record)
            call run_states(n, self%record, n_lane, y, laws_are_there=.true.)
            if (self%way%assembly%is_needed) call look_for_doubt(self, n_lane, t, y)
            is_left(:n) = self%record%samples%is_left(:n)
        end associate
    end subroutine run_still

    !> Leave the states that a mechanism may have left its assembly on the way to, or that lie too far to tell.
    subroutine look_for_doubt(self, n_lane, t, y)
        class(forward_system), intent(inout) :: self
        integer, intent(in) :: n_lane
        real(wp), intent(in) :: t(n_lane), y(n_lane, self%n)
        real(wp) :: doubt(lanes)

        associate (n => self%n_used, assembly => self%way%assembly)
            doubt(:n) = 0
            call doubt_far(self%model, self%layout, assembly, n, n_lane, y, doubt)
            call leave_doubtful(self%model, assembly, n, t, doubt, self%record)
        end associate
    end subroutine look_for_doubt

    !> The same where time, turns, laws over the state, or what the run knows beside the states come into it.
    subroutine run_moving(self, n_lane, t, y, is_left)
        class(forward_system), intent(inout) :: self
        integer, intent(in) :: n_lane
        real(wp), intent(in) :: t(n_lane), y(n_lane, self%n)
        logical, intent(inout) :: is_left(n_lane)
        logical :: changes_efforts

        associate (n => self%n_used, samples => self%record%samples)
            call self%find_given_forces(t(:n), self%record%given_force, is_left)
            call place_states(self%model, self%layout, self%way%assembly, n, t, y, self%turns, self%by_inverse, self%record)
            if (n_stop(self%model%scene) > 0) call place_touches(self%model, n, self%touches(), self%record)
            if (has_sticking(self%model)) call place_senses(self, n)
            samples%is_left(:n) = samples%is_left(:n) .or. is_left(:n)
            call close_states(self%model, self%way%assembly, n, self%record)
            changes_efforts = self%has_motor_laws .or. self%has_cylinders .or. self%control%state%n > 0
            if (changes_efforts) call apply_record_laws(n, self%record)
            if (self%control%state%n > 0) call drive_record_by_controllers(self, n, t, y)
            if (self%has_cylinders) &
                call drive_record_by_cylinders(self%model, self%layout, n, y, self%record, self%cylinders)
            if (self%has_motor_laws) &
                call drive_record_by_motors(self%model, self%equations, self%layout, n, t, y, self%record, self%way%motors)
            if (size(self%equations%lossy) > 0) then
                call run_losing(self%model, self%equations%lossy, n, self%record)
            else
                call run_states(n, self%record, n_lane, y, laws_are_there=changes_efforts)
            end if
            if (self%way%assembly%is_needed) then
                call look_for_doubt(self, n_lane, t, y)
                call keep_stages(self%way%assembly, n, self%record)
            end if
            is_left(:n) = samples%is_left(:n)
        end associate
    end subroutine run_moving

    !> Which way joints slide that may stick.
    subroutine place_senses(self, n)
        class(forward_system), intent(inout) :: self
        integer, intent(in) :: n
        real(wp) :: sense(lanes, n_part, size(self%model%contact))

        sense = 0
        call tell_contacts(self%model, self%way%clutch%sense, sense)
        self%record%samples%sense(:, :n) = transpose(reshape(sense(:n, :, :), [n, n_part*size(sense, 3)]))
    end subroutine place_senses

    !> Does the record find what the lanes find? Asked once, at representative poses in motion: a difference would be a defect,
    !> and the lanes are believed.
    subroutine compare_with_lanes(self, t, pose, agrees, sees)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t                      !! [s]
        real(wp), intent(in) :: pose(:, :)             !! representative ones (n_q, n)
        logical, intent(out) :: agrees                 !! on the rates
        logical, intent(out) :: sees                   !! and on what is seen of the ends of steps
        type(carried_assembly) :: carried
        real(wp), dimension(lanes, self%n) :: y, by_lanes, by_record
        real(wp), dimension(lanes, self%model%n_q) :: q, qd
        real(wp), dimension(lanes, self%model%n_branch + size(self%model%group)) :: margin, drift
        real(wp), allocatable :: turns(:, :)
        real(wp), dimension(lanes) :: energy, kinetic
        real(wp), dimension(lanes, self%model%n_variable) :: variable, variable_rate
        type(agreement) :: of_rates, of_looks
        integer :: obstacle(lanes), first, lane, n_used
        logical :: failed(lanes), is_left(lanes)

        carried = self%way%assembly
        obstacle = self%way%obstacle
        turns = self%turns
        n_used = self%n_used
        self%n_used = lanes
        call begin_assembly(self%model, t, self%way%assembly)
        self%turns = 0
        self%may_be_torn = .true.
        do first = 1, size(pose, 2), lanes
            call set_in_motion(pose, first, q, qd)
            call fill_start(self%model, self%layout, q, qd, y)
            ! Groups are led from the start; closed forms have no way to there.
            if (self%way%assembly%is_needed .and. size(self%model%group) == 0) self%way%assembly%q = q
            call self%evaluate_on_lanes(spread(t, 1, lanes), y, by_lanes, failed)
            if (self%way%assembly%is_needed) call measure_margins(self%model, self%workspace%state, margin, drift)
            if (size(self%model%group) > 0) call stand_there(self%model, self%workspace%state, self%way%assembly)
            call evaluate_by_record(self, lanes, spread(t, 1, lanes), y, by_record, is_left)
            if (self%record%recorded%looks%is_made) then
                call energy_of_motion(self%model, self%workspace%state, energy, kinetic)
                call measure_joints(self%model, self%workspace%state, variable, variable_rate)
                call carry_states(lanes, y, self%record)
                call run_looks(self%record%recorded, lanes, self%record%samples)
            end if
            do lane = 1, min(lanes, size(pose, 2) - first + 1)
                if (failed(lane) .or. is_left(lane)) cycle
                call of_rates%note(are_alike(by_lanes(lane, :), by_record(lane, :)) .and. has_same_margins(lane))
                call of_looks%note(sees_the_same(lane))
            end do
        end do
        self%way%assembly = carried
        self%way%obstacle = obstacle
        self%turns = turns
        self%n_used = n_used
        self%may_be_torn = .false.
        agrees = of_rates%is_reached()
        sees = agrees .and. of_looks%is_reached()

    contains

        logical function has_same_margins(lane)
            integer, intent(in) :: lane

            has_same_margins = .true.
            if (.not. self%way%assembly%is_needed) return
            associate (found => self%record%samples%found(lane, :), out => self%record%recorded%out, n => self%model%n_branch)
                ! either may vanish: sines compare with one, and so do their rates while coordinates have rates of about one
                has_same_margins = are_alike([1.0_wp, margin(lane, :n)], [1.0_wp, found(out%margin:out%margin + n - 1)]) &
                                   .and. are_alike([1.0_wp, drift(lane, :n)], [1.0_wp, found(out%drift:out%drift + n - 1)])
            end associate
        end function has_same_margins

        logical function sees_the_same(lane)
            integer, intent(in) :: lane

            sees_the_same = self%record%recorded%looks%is_made
            if (.not. sees_the_same) return
            associate (seen => self%record%samples%seen(:, lane), out => self%record%recorded%look, n => self%model%n_branch)
                sees_the_same = are_alike([kinetic(lane), energy(lane)], [seen(out%kinetic), seen(out%energy)]) &
                                .and. are_alike([1.0_wp, margin(lane, :n)], [1.0_wp, seen(out%margin:out%margin + n - 1)]) &
                                .and. are_alike([1.0_wp, drift(lane, :n)], [1.0_wp, seen(out%drift:out%drift + n - 1)])
            end associate
            if (sees_the_same) sees_the_same = sees_the_same_angles(lane)
        end function sees_the_same

        logical function sees_the_same_angles(lane)
            integer, intent(in) :: lane
            integer, allocatable :: k(:)

            k = angles_seen(self%model)
            associate (out => self%record%recorded%look, n => size(k))
                associate (angle => self%record%samples%seen(out%angle:out%angle + n - 1, lane), &
                           spin => self%record%samples%seen(out%spin:out%spin + n - 1, lane))
                    sees_the_same_angles = all(abs(least_angle(variable(lane, k) - angle)) <= least_accuracy) &
                                           .and. are_alike([1.0_wp, variable_rate(lane, k)], [1.0_wp, spin])
                end associate
            end associate
        end function sees_the_same_angles
    end subroutine compare_with_lanes
end submodule linkdyn_forward_by_record
