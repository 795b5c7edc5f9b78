!> Pushes: what stops at which joint variables rest and clutches that hold have to give, so that these stay where they are.
!>
!> Accelerations are linear in pushes. What a unit of each gives is found by solving the equations of motion once more for each of them.
submodule (linkdyn_forward_system) linkdyn_forward_contacts
    use linkdyn_contact_forces, only: solve_contacts
    use linkdyn_equations, only: solve_again
    use linkdyn_followed_angles, only: angles_about
    use linkdyn_friction_state, only: pressing_forces
    use linkdyn_held_variables, only: n_held, measure_held, accelerations_with, slips, led_by, still_coordinates
    use linkdyn_measures, only: find_kept
    use linkdyn_planar_motion, only: level_velocity
    use linkdyn_status, only: sample_not_converged
    implicit none (type, external)

contains

    !> Accelerations away from stops and of the slips of clutches, and those of the coordinates, while stops and clutches push; on top
    !> of that clutches rub. Kinematics, loads and drives of the state are in the workspace.
    module procedure accelerate
        associate (state => self%workspace%state, n => n_stop(self%model%scene))
            if (.not. self%held%is_measured) call measure_held(self%model, state, self%held)
            state%stop_force = push(:, :n)
            state%clutch_force = self%clutch%rub + push(:, n + 1:)
            call solve_again(self%model, self%equations, self%workspace)
            state%stop_force = 0
            state%clutch_force = self%clutch%rub
            away = accelerations_with(self%held, self%workspace%acceleration - state%qdd)
        end associate
    end procedure accelerate

    !> What a unit push of each stop in contact, and of each clutch asked for, gives: accelerations away from all stops, of all slips, and
    !> of the coordinates. They are linear in the push; one that outdoes all other forces leaves its digits to the difference.
    !> Where friction follows the reactions they are linear near by alone: `about` pushes that there are small ones beside these are taken,
    !> but none below what forces count by (`least`): their difference would be rounding.
    module procedure find_responses
        real(wp), parameter :: much = 1.0e4_wp, little = 1.0e-2_wp
        real(wp), dimension(lanes, size(is_in_contact, 2)) :: push, base, at_rest, away
        real(wp) :: own(lanes, self%model%n_q), unit(lanes), largest(lanes), factor(lanes, size(self%model%contact))
        integer :: k, i, turn, n

        n = size(factor, 2)
        factor = self%workspace%friction%factor(:, :n)
        if (is_impact) self%workspace%friction%factor(:, :n) = 0
        base = 0
        if (present(about)) base = about
        response = 0
        of_coordinates = 0
        call accelerate(self, base, at_rest)
        own = self%workspace%acceleration
        largest = maxval(abs(own), dim=2)
        do k = 1, size(push, 2)
            if (.not. any(is_in_contact(:, k))) cycle
            unit = 1
            if (present(about)) unit = max(little*maxval(abs(base), dim=2), least)
            where (.not. unit > 0) unit = 1
            do turn = 1, merge(1, 2, present(about))
                push = base
                push(:, k) = base(:, k) + unit
                call accelerate(self, push, away)
                do i = 1, size(push, 2)
                    response(:, i, k) = (away(:, i) - at_rest(:, i))/unit
                end do
                do i = 1, self%model%n_q
                    of_coordinates(:, i, k) = (self%workspace%acceleration(:, i) - own(:, i))/unit
                end do
                unit = much*max(1.0_wp, largest)/max(maxval(abs(of_coordinates(:, :, k)), dim=2), tiny(1.0_wp))
                where (.not. unit <= huge(1.0_wp)) unit = 1
            end do
        end do
        self%workspace%friction%factor(:, :n) = factor
    end procedure find_responses

    !> Push of the stops at which joint variables rest and of the clutches that hold: as much as keeps them there. The accelerations in
    !> the workspace become those with it.
    module procedure hold_variables
        integer, parameter :: n_turn = 2               !! the second mends what the first has rounded
        integer, parameter :: n_far = 2                !! turns with responses to large pushes, mostly enough
        integer, parameter :: most_turns = 30          !! friction in joints changes with what is pushed
        real(wp), parameter :: enough = 1.0e-14_wp     !! of the pushes
        real(wp), parameter :: rounding = 1.0e-9_wp    !! of them, if it gets no less any more
        real(wp), parameter :: small = 1.0e-4_wp       !! of what presses: forces that count
        real(wp), dimension(lanes, n_held(self%model)) :: push, away, change, wanted
        real(wp) :: response(lanes, n_held(self%model), n_held(self%model))
        real(wp) :: press(lanes, size(self%equations%rub))
        real(wp), dimension(lanes) :: apart, part, part_before, pressed
        real(wp) :: of_coordinates(lanes, self%model%n_q, n_held(self%model))
        logical :: is_held(lanes, n_held(self%model)), rubs
        integer :: turn

        is_held(:, :n_stop(self%model%scene)) = self%stops%rests
        is_held(:, n_stop(self%model%scene) + 1:) = self%clutch%holds
        call find_responses(self, is_held, .false., response, of_coordinates)
        rubs = size(self%equations%rub) > 0
        push = 0
        call accelerate(self, push, away)
        wanted = 0
        if (holds_anywhere(self%clutch)) wanted(:, n_stop(self%model%scene) + 1:) = way_back(self, t)
        apart = maxval(abs(wanted - away), dim=2, mask=is_held)
        part_before = huge(1.0_wp)
        pressed = 0                                    ! what holds may have but rounding of this to hold
        if (rubs) then
            call pressing_forces(self%equations%rub, self%workspace%friction, press)
            pressed = maxval(press, dim=2)
        end if
        do turn = 1, merge(most_turns, n_turn, rubs)
            if (turn > n_far) call find_responses(self, is_held, .false., response, of_coordinates, push, small*pressed)
            call solve_contacts(response, is_held, wanted - away, change)
            push = push + change
            call accelerate(self, push, away)
            part = maxval(abs(change), dim=2)/max(maxval(abs(push), dim=2), small*pressed, tiny(1.0_wp))
            if (turn >= n_turn .and. all(part <= enough .or. (part >= part_before .and. part <= rounding))) then
                if (.not. rubs) exit
                if (all(stays())) exit
            end if
            part_before = part
        end do
        ! Where friction changes so fast with what is pushed that no push was found, nothing that follows of it is true.
        if (rubs) then
            where (self%workspace%status == sample_ok .and. .not. stays()) self%workspace%status = sample_not_converged
        end if
        call still_coordinates(self%model, self%layout, self%clutch%holds, self%workspace%acceleration)
        self%stops%push = push(:, :n_stop(self%model%scene))
        self%clutch%applied = self%clutch%rub + push(:, n_stop(self%model%scene) + 1:)
        self%clutch%force = self%clutch%applied

    contains

        !> Is what is held where it should be, but for rounding of what the pushes take away?
        function stays()
            logical :: stays(lanes)
            real(wp), parameter :: still = 1.0e-8_wp
            real(wp) :: taken(lanes)
            integer :: k

            taken = apart
            do k = 1, size(push, 2)
                taken = max(taken, maxval(abs(response(:, :, k)), dim=2)*max(abs(push(:, k)), small*pressed))
            end do
            stays = .not. any(is_held, dim=2) .or. maxval(abs(wanted - away), dim=2, mask=is_held) <= still*taken
        end function stays
    end procedure hold_variables

    !> Accelerations of slips that lead joint variables back which errors of the steps have carried off while they are held. Where both are
    !> coordinates steps keep what is linear in them, and there is nothing to mend.
    function way_back(self, t) result(wanted)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t(lanes)
        real(wp) :: wanted(lanes, n_clutch(self%model%scene))
        real(wp) :: here(lanes, size(wanted, 2)), slip(lanes, size(wanted, 2)), pace(lanes)
        logical :: is_led(size(wanted, 2))
        integer :: i

        is_led = led_by(self%model, self%model%scene%clutch)

        wanted = 0
        pace = merge(0.25_wp/max(self%clutch%longest, tiny(1.0_wp)), 0.0_wp, self%clutch%longest > 0)
        if (all(is_led) .or. .not. any(pace > 0)) return
        call find_kept(self%model, self%workspace%state, angles_about(self%angles, t), here)
        slip = slips(self%model, self%workspace%state, level_velocity)
        do i = 1, size(wanted, 2)
            if (is_led(i)) cycle
            here(:, i) = here(:, i) - self%clutch%kept(:, i)
            if (self%model%scene%clutch(i)%unit == "N") here(:, i) = self%model%scene%laws%scale*here(:, i)
            where (self%clutch%holds(:, i)) wanted(:, i) = -pace*(2*slip(:, i) + pace*here(:, i))
        end do
    end function way_back
end submodule linkdyn_forward_contacts
