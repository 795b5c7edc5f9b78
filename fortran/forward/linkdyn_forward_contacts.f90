!> Pushes: what stops at which joint variables rest and clutches that hold have to give, so that these stay where they are.
!>
!> Accelerations are linear in pushes. What a unit of each gives is found by solving the equations of motion once more for each of
!> them.
submodule (linkdyn_forward_system) linkdyn_forward_contacts
    use linkdyn_contact_balance, only: contact_responses, balance_contacts
    use linkdyn_contact_forces, only: solve_contacts
    use linkdyn_equations, only: solve_again, solve_with_amounts, flag_locked, forces_at_work
    use linkdyn_followed_angles, only: angles_about
    use linkdyn_friction_state, only: pressing_forces
    use linkdyn_held_places, only: carried_off
    use linkdyn_held_variables, only: n_held, measure_held, accelerations_with, slips, led_by, still_coordinates
    use linkdyn_planar_motion, only: level_velocity
    use linkdyn_slip_parts, only: list_held
    use linkdyn_status, only: sample_ok, sample_not_converged
    implicit none (type, external)

contains

    !> Accelerations away from stops and of the slips of clutches, and those of the coordinates, while stops and clutches push; on
    !> top of that clutches rub. Kinematics, loads and drives of the state are in the workspace.
    module procedure accelerate
        call push_and_rub(self, push, .true., away)
    end procedure accelerate

    !> The same with the friction that fits, or with as much as the workspace says.
    subroutine push_and_rub(self, push, finds_friction, away)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: push(:, :)             !! (lane, n_held)
        logical, intent(in) :: finds_friction
        real(wp), intent(out) :: away(:, :)            !! (lane, n_held)

        associate (state => self%workspace%state, n => n_stop(self%model%scene))
            if (.not. self%held%is_measured) call measure_held(self%model, state, self%held)
            state%stop_force = push(:, :n)
            state%clutch_force = self%way%clutch%rub + push(:, n + 1:)
            if (finds_friction) then
                call solve_again(self%model, self%equations, self%workspace)
            else
                call solve_with_amounts(self%model, self%equations, self%workspace)
            end if
            state%stop_force = 0
            state%clutch_force = self%way%clutch%rub
            away = accelerations_with(self%held, self%workspace%acceleration - state%qdd)
        end associate
    end subroutine push_and_rub

    !> What a unit push of each stop in contact, and of each clutch asked for, gives: accelerations away from all stops, of all
    !> slips, and of the coordinates. They are linear in the push; one that outdoes all other forces leaves its digits to the
    !> difference.
    !>
    !> Of impulses there are no other forces, and joints do not rub by them. Transmissions lose of what they transmit, and how they
    !> do depends on its sign, which impulses give it, and on how motors turn meanwhile: their responses are those along the `path`
    !> of the impulses themselves, which is told of them.
    module procedure find_responses
        real(wp), parameter :: much = 1.0e4_wp
        real(wp), dimension(lanes, size(is_in_contact, 2)) :: base, at_rest
        real(wp) :: own(lanes, self%model%n_q), unit(lanes), factor(lanes, size(self%workspace%friction%factor, 2)), part(lanes)
        real(wp), dimension(lanes, size(self%equations%lossy)) :: sense, of_motor
        logical :: has_path
        integer :: k, phase

        factor = self%workspace%friction%factor
        if (is_impact) self%workspace%friction%factor(:, :size(self%model%contact)) = 0
        has_path = .false.
        if (present(path)) has_path = size(self%equations%lossy) > 0
        base = 0
        part = 1
        response = 0
        of_coordinates = 0
        if (has_path) then
            sense = self%workspace%sense
            self%workspace%friction%factor(:, size(self%model%contact) + 1:) = 1
            path%jams = .false.
            call set_out_along()
            do phase = 1, path%n_phase()
                if (.not. path%is_used(phase)) cycle
                part = path%part_of_phase(phase)
                self%workspace%sense = path%sense_in_phase(phase)
                self%workspace%friction%has_slope = .false.
                call measure_all()
            end do
            self%workspace%sense = sense
            self%workspace%friction%has_slope = .false.
        else
            call measure_all()
        end if
        self%workspace%friction%factor = factor

    contains

        !> Responses, or those of a phase, to each push.
        subroutine measure_all()
            call accelerate(self, base, at_rest)
            own = self%workspace%acceleration
            if (has_path) then
                of_motor = motor_accelerations(self)
                path%jams = path%jams .or. (part > 0 .and. self%workspace%status /= sample_ok .and. any(is_in_contact, dim=2))
            end if
            do k = 1, size(base, 2)
                if (.not. any(is_in_contact(:, k))) cycle
                if (.not. has_path) unit = much*max(1.0_wp, maxval(abs(own), dim=2))/unit_answer()
                where (.not. unit <= huge(1.0_wp)) unit = 1
                call measure()
            end do
        end subroutine measure_all

        !> How much a push of one changes, at the most.
        function unit_answer() result(change)
            real(wp) :: change(lanes), away(lanes, size(base, 2)), push(lanes, size(base, 2))

            push = base
            push(:, k) = push(:, k) + 1
            call accelerate(self, push, away)
            change = max(maxval(abs(self%workspace%acceleration - own), dim=2), tiny(1.0_wp))
        end function unit_answer

        !> What a unit more of push k changes.
        subroutine measure()
            real(wp), dimension(lanes, size(base, 2)) :: push, away
            integer :: i

            push = base
            push(:, k) = push(:, k) + unit
            call accelerate(self, push, away)
            do i = 1, size(push, 2)
                away(:, i) = (away(:, i) - at_rest(:, i))/unit
                response(:, i, k) = response(:, i, k) + part*away(:, i)
            end do
            if (has_path) then
                path%response(:, :, k, phase) = away
                path%gain(:, :, k, phase) = (motor_accelerations(self) - of_motor)/spread(unit, 2, size(of_motor, 2))
            end if
            do i = 1, self%model%n_q
                of_coordinates(:, i, k) = of_coordinates(:, i, k) + part*((self%workspace%acceleration(:, i) - own(:, i))/unit)
            end do
        end subroutine measure

        !> A push beside which all other forces are nothing, and units that are a small part of it.
        subroutine set_out_along()
            real(wp), parameter :: of_all = 1.0e-3_wp, beyond_all = 1.0e8_wp
            real(wp), dimension(lanes) :: size_of, largest
            integer :: i

            size_of = maxval(abs(path%along), dim=2)
            largest = [(beyond_all*max(1.0_wp, forces_at_work(self%model, self%workspace, i)), i=1, lanes)]
            where (.not. largest <= huge(1.0_wp)) largest = beyond_all
            do i = 1, size(base, 2)
                where (size_of > 0) base(:, i) = largest*(path%along(:, i)/max(size_of, tiny(1.0_wp)))
            end do
            unit = of_all*largest
        end subroutine set_out_along
    end procedure find_responses

    !> Of the joint variables of motors whose transmissions lose: rotors take what they give and do not transmit. Where there is no
    !> rotor nothing of an impulse is transmitted.
    function motor_accelerations(self) result(acceleration)
        class(forward_system), intent(in) :: self
        real(wp) :: acceleration(lanes, size(self%equations%lossy))
        integer :: i

        acceleration = 0
        do i = 1, size(self%equations%lossy)
            associate (motor => self%model%motor(self%equations%lossy(i)))
                if (motor%inertia > 0) acceleration(:, i) = (self%workspace%driving_force(:, motor%actuator) &
                                                             - self%workspace%transmitted(:, motor%actuator))/motor%inertia
            end associate
        end do
    end function motor_accelerations

    !> Rates of these joint variables.
    module procedure motor_rates
        integer :: i

        rate = reshape([(self%workspace%driving_rate(:, self%model%motor(self%equations%lossy(i))%actuator), &
                         i=1, size(self%equations%lossy))], shape(rate))
    end procedure motor_rates

    !> Push of the stops at which joint variables rest and of the clutches that hold: as much as keeps them there. The accelerations
    !> in the workspace become those with it.
    module procedure hold_variables
        real(wp), dimension(lanes, n_held(self%model)) :: push, wanted
        logical :: is_held(lanes, n_held(self%model))

        associate (n => n_stop(self%model%scene))
            is_held(:, :n) = self%way%stops%rests
            is_held(:, n + 1:) = self%way%clutch%holds
            wanted = 0
            if (holds_anywhere(self%way%clutch)) wanted(:, n + 1:) = way_back(self, t)
            if (size(self%equations%rub) > 0) then
                call hold_what_rubs(self, is_held, wanted, push)
            else
                call hold_freely(self, is_held, wanted, push)
            end if
            call still_coordinates(self%model, self%layout, self%way%clutch%holds, self%workspace%acceleration)
            self%way%stops%push = push(:, :n)
            self%way%clutch%applied = self%way%clutch%rub + push(:, n + 1:)
            self%way%clutch%force = self%way%clutch%applied
        end associate
    end procedure hold_variables

    !> Where nothing rubs accelerations are linear in pushes.
    subroutine hold_freely(self, is_held, wanted, push)
        class(forward_system), intent(inout) :: self
        logical, intent(in) :: is_held(:, :)           !! (lane, n_held)
        real(wp), intent(in) :: wanted(:, :)           !! accelerations of what is held (lane, n_held)
        real(wp), intent(out) :: push(:, :)            !! (lane, n_held)
        integer, parameter :: n_turn = 2               !! the second mends what the first has rounded
        real(wp), dimension(lanes, size(push, 2)) :: away, change
        real(wp) :: response(lanes, size(push, 2), size(push, 2)), of_coordinates(lanes, self%model%n_q, size(push, 2))
        integer :: turn

        call find_responses(self, is_held, .false., response, of_coordinates)
        push = 0
        call accelerate(self, push, away)
        do turn = 1, n_turn
            call solve_contacts(response, is_held, wanted - away, change)
            push = push + change
            call accelerate(self, push, away)
        end do
    end subroutine hold_freely

    !> Where joints rub, how much depends on what presses, and that on the pushes. What presses and how what is held accelerates is
    !> linear in pushes and in amounts of friction together: with what a unit of each does no equations of motion are left to be
    !> solved, but one for each held variable and one for each contact.
    subroutine hold_what_rubs(self, is_held, wanted, push)
        class(forward_system), intent(inout) :: self
        logical, intent(in) :: is_held(:, :)           !! (lane, n_held)
        real(wp), intent(in) :: wanted(:, :)           !! accelerations of what is held (lane, n_held)
        real(wp), intent(out) :: push(:, :)            !! (lane, n_held)
        integer, parameter :: n_turn = 2               !! the second mends what the first has rounded
        real(wp), dimension(lanes, size(push, 2)) :: away, asked
        real(wp) :: lever(size(push, 2))
        type(contact_responses) :: found
        logical :: is_kept(size(push, 2))
        integer :: turn, lane, lead(size(push, 2))

        push = 0
        asked = wanted
        is_kept(:n_stop(self%model%scene)) = .true.
        is_kept(n_stop(self%model%scene) + 1:) = are_led(self)
        call list_held(self%model, lead, lever)
        associate (workspace => self%workspace, friction => self%workspace%friction)
            workspace%status = workspace%status_of_motion
            call find_contact_responses(self, is_held, found)
            do lane = 1, self%n_used
                call found%yield_to_kept(lane, is_kept, is_held(lane, :), asked(lane, :))
            end do
            workspace%status = workspace%status_of_motion
            do turn = 1, n_turn
                do lane = 1, self%n_used
                    if (workspace%status_of_motion(lane) /= sample_ok) cycle
                    call balance_contacts(lead, lever, self%equations%rub, friction%factor(lane, :), is_held(lane, :), &
                                          asked(lane, :), lane, found, push(lane, :), friction%amount(lane, :), &
                                          workspace%state%holding(lane))
                    call flag_locked(self%model, self%equations, lane, workspace)
                end do
                call spread_over_spare_lanes()
                call push_and_rub(self, push, .false., away)
                call found%begin_there(away, friction, push)
            end do
            do lane = 1, self%n_used
                if (workspace%status(lane) /= sample_ok) cycle
                ! Where friction changes so fast with what is pushed that no push was found, nothing that follows of it is true.
                if (.not. found%fits(self%equations%rub, friction%factor(lane, :), is_held(lane, :), asked(lane, :), lane, &
                                     push(lane, :), friction%amount(lane, :), friction%press(lane, :, :), &
                                     forces_at_work(self%model, workspace, lane))) &
                    workspace%status(lane) = sample_not_converged
            end do
        end associate

    contains

        !> Lanes that nobody looks at are like the last of the others.
        subroutine spread_over_spare_lanes()
            integer :: spare

            do spare = self%n_used + 1, lanes
                push(spare, :) = push(self%n_used, :)
                self%workspace%friction%amount(spare, :) = self%workspace%friction%amount(self%n_used, :)
            end do
        end subroutine spread_over_spare_lanes
    end subroutine hold_what_rubs

    !> What a unit push of each that holds does, and a unit of each contact's friction.
    subroutine find_contact_responses(self, is_held, found)
        class(forward_system), intent(inout) :: self
        logical, intent(in) :: is_held(:, :)           !! (lane, n_held)
        type(contact_responses), intent(out) :: found
        real(wp), parameter :: much = 1.0e4_wp         !! of all forces: what they leave of the digits does not matter
        real(wp), dimension(lanes, size(is_held, 2)) :: push, away
        real(wp) :: force(lanes, size(self%equations%rub)), unit(lanes), largest(lanes)
        integer :: k

        associate (workspace => self%workspace, friction => self%workspace%friction, rub => self%equations%rub)
            friction%amount = 0
            push = 0
            call push_and_rub(self, push, .false., away)
            call found%begin(self%model%driven, away, friction)
            call pressing_forces(rub, friction, force)
            largest = max(1.0_wp, maxval(abs(force), dim=2), [(forces_at_work(self%model, workspace, k), k=1, lanes)])
            where (.not. largest <= huge(1.0_wp)) largest = 1
            unit = much*largest
            do k = 1, size(push, 2)
                if (.not. any(is_held(:self%n_used, k))) cycle
                push = 0
                push(:, k) = unit
                call push_and_rub(self, push, .false., away)
                call found%note_push(k, unit, away, friction)
            end do
            push = 0
            do k = 1, size(rub)
                ! as much as it can be, whatever presses now: what is held may press more
                unit = friction%factor(:, k)*largest
                if (.not. any(unit(:self%n_used) > 0)) cycle
                friction%amount = 0
                friction%amount(:, k) = unit
                call push_and_rub(self, push, .false., away)
                call found%note_amount(k, unit, away, friction)
            end do
            friction%amount = 0
        end associate
    end subroutine find_contact_responses

    !> Accelerations of slips that lead joint variables back which errors of the steps have carried off while they are held. Where
    !> both are coordinates steps keep what is linear in them, and there is nothing to mend. Nor is what places are rounded by: led
    !> back as fast as short steps ask for, it would be accelerations that no push can give several joints at once.
    function way_back(self, t) result(wanted)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t(lanes)
        real(wp) :: wanted(lanes, n_clutch(self%model%scene))
        real(wp) :: off(lanes, size(wanted, 2)), slip(lanes, size(wanted, 2)), pace(lanes)
        logical :: is_led(size(wanted, 2))
        integer :: i

        is_led = are_led(self)
        wanted = 0
        pace = merge(0.25_wp/max(self%way%clutch%longest, tiny(1.0_wp)), 0.0_wp, self%way%clutch%longest > 0)
        if (all(is_led) .or. .not. any(pace > 0)) return
        off = carried_off(self%model, self%workspace%state, angles_about(self%way%angles, t), self%way%clutch%kept)
        slip = slips(self%model, self%workspace%state, level_velocity)
        do i = 1, size(wanted, 2)
            if (is_led(i)) cycle
            if (self%model%scene%clutch(i)%unit == "N") off(:, i) = self%model%scene%laws%scale*off(:, i)
            where (self%way%clutch%holds(:, i)) wanted(:, i) = -pace*(2*slip(:, i) + pace*off(:, i))
        end do
    end function way_back

    !> Clutches whose joint variables are coordinates, or linear in them.
    function are_led(self) result(are)
        class(forward_system), intent(in) :: self
        logical :: are(n_clutch(self%model%scene))
        integer :: i

        are = [(led_by(self%model, self%model%scene%clutch(i)), i=1, size(are))]
    end function are_led
end submodule linkdyn_forward_contacts
