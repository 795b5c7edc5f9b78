!> The ends of steps, seen by the scene's record: who judges a step, and who goes on from it, shares what has been seen once.
submodule (linkdyn_forward_system) linkdyn_forward_step_ends
    use linkdyn_carried_assembly, only: accept_seen
    use linkdyn_coordinate_watch, only: take_rates
    use linkdyn_energy_check, only: note_record
    use linkdyn_followed_angles, only: follow_seen
    use linkdyn_step_ends, only: see_end, see_energies, see_lanes, seen_angles, is_seen
    use linkdyn_forward_record, only: accept_recorded
    implicit none (type, external)

contains

    !> Has the state evaluated last been seen by the record, or can it be seen now?
    module procedure sees_end
        sees_end = self%looks%is_usable .and. self%is_by_record
        if (.not. sees_end) return
        sees_end = is_seen(self%looks, self%t_tried, self%y_tried)
        if (sees_end) return
        call see_end(self%model, self%layout, self%t_tried, self%y_tried, self%turns, self%way%assembly, &
                     self%workspace%acceleration(1, :), self%record, self%looks)
        sees_end = is_seen(self%looks, self%t_tried, self%y_tried)
    end procedure sees_end

    !> Energies, less what was supplied, of the state evaluated last and of its neighbours.
    module procedure see_surplus
        real(wp), dimension(size(state, 2)) :: energy, kinetic

        are_seen = self%looks%is_usable .and. self%is_by_record .and. is_by_record(self%way%energy)
        if (are_seen) are_seen = t == self%t_tried .and. all(state(:, 1) == self%y_tried)
        if (.not. are_seen) return
        call see_energies(self%model, self%layout, t, state, self%turns, self%way%assembly, self%workspace%acceleration(1, :), &
                          self%record, self%looks, energy, kinetic, are_seen)
        if (.not. are_seen) return
        surplus = energy - state(self%layout%supplied, :)
        scale = abs(energy(1)) + kinetic(1) + abs(state(self%layout%supplied, 1))
    end procedure see_surplus

    !> Has an accepted state been seen by the record, or can it be seen now? Methods that begin their next step by the rates there
    !> have just evaluated it.
    module procedure sees_accepted
        sees_accepted = self%looks%is_usable .and. self%lanes_are_one .and. all(is_accepted)
        if (.not. sees_accepted) return
        sees_accepted = is_seen(self%looks, t(1), y(1, :))
        if (sees_accepted .or. .not. self%is_by_record) return
        if (.not. (t(1) == self%t_tried .and. all(y(1, :) == self%y_tried))) call evaluate_again()
        sees_accepted = sees_end(self)

    contains

        subroutine evaluate_again()
            real(wp) :: rate(self%n)
            logical :: failed

            call self%evaluate_alone(t(1), y(1, :), rate, failed)
        end subroutine evaluate_again
    end procedure sees_accepted

    !> Go on from an accepted state that the record has seen. That it is on the accepted assembly was judged when its rates were
    !> found.
    module procedure accept_by_look
        associate (record => self%looks%record, out => self%looks%record%recorded%look, n => self%model%n_branch)
            associate (seen => record%samples%seen(:, 1))
                call accept_recorded(self%model, t, seen(out%margin:out%margin + n - 1), seen(out%drift:out%drift + n - 1), &
                                     record, self%way%assembly, is_done)
            end associate
        end associate
        if (is_done) is_done = weighs_by_look(self, t, y)
    end procedure accept_by_look

    module procedure weighs_by_look
        real(wp), dimension(lanes) :: energy, kinetic

        is_done = self%lanes_are_one .and. is_seen(self%looks, t(1), y(1, :))
        if (.not. is_done) return
        associate (out => self%looks%record%recorded%look, seen => self%looks%record%samples%seen(:, 1))
            energy = seen(out%energy)
            kinetic = seen(out%kinetic)
        end associate
        call weigh_energy(energy, kinetic, y(:, self%layout%supplied), self%way%energy)
        call note_record(t(1), y(1, :), self%turns, self%way%energy)
    end procedure weighs_by_look

    !> The same of states that differ from lane to lane, of which the record sees nothing but assemblies and energies.
    module procedure accept_lanes_by_look
        real(wp) :: no_place(0, 0), no_column(0, 0, 0)

        is_done = self%looks%is_usable .and. size(self%model%group) == 0 .and. .not. self%lanes_are_one
        if (is_done) is_done = .not. (self%way%bounce%is_on .or. self%watch%is_on .or. wraps_anywhere(self%of_joints) .or. &
                                      wraps_anywhere(self%way%angles))
        if (.not. is_done) return
        call see_lanes(self%model, self%layout, t, y, self%turns, is_accepted, self%way%assembly, self%looks)
        is_done = self%looks%of_lanes%counts
        if (.not. is_done) return
        associate (seen => self%looks%of_lanes%value, out => self%looks%record%recorded%look, n => self%model%n_branch)
            call accept_seen(self%model, t, is_accepted, seen(:, out%margin:out%margin + n - 1), &
                             seen(:, out%drift:out%drift + n - 1), no_place, no_column, self%way%assembly)
            call weigh_energy(seen(:, out%energy), seen(:, out%kinetic), y(:, self%layout%supplied), self%way%energy)
        end associate
    end procedure accept_lanes_by_look

    !> Joint angles have turned on the way to the accepted state that the record has seen.
    module procedure follow_seen_turns
        real(wp), dimension(self%model%n_variable) :: angle, spin

        call seen_angles(self%looks, angle, spin)
        call follow_seen(self%model, t, angle, spin, self%of_joints)
    end procedure follow_seen_turns

    !> How joints and links move that are watched for bounces.
    module procedure seen_motion
        integer :: n_joint, first

        associate (out => self%looks%record%recorded%look, seen => self%looks%record%samples%seen(:, 1))
            n_joint = size(self%way%bounce%joint)
            first = merge(out%acceleration, out%rate, is_acceleration)
            motion = 0
            motion(1, :n_joint) = seen(first:first + n_joint - 1)
            motion(:, n_joint + 1:) = reshape(seen(first + n_joint:first + n_joint + 3*size(self%way%bounce%link) - 1), &
                                              [3, size(self%way%bounce%link)])
        end associate
    end procedure seen_motion

    !> Rates of joint variables by coordinates that may be exchanged.
    module procedure compare_seen
        associate (out => self%looks%record%recorded%look)
            call take_rates(self%looks%record%samples%seen(out%compared:out%n, 1), self%watch)
        end associate
    end procedure compare_seen
end submodule linkdyn_forward_step_ends
