!> What stops and clutches push and how much contacts rub at once, of one state.
!>
!> Accelerations of what is held and what presses contacts are linear in both. Pushes are taken out by what they have to do, then
!> the friction that is left is that of a mechanism that rubs and is held by nothing (`linkdyn_friction_balance`).
module linkdyn_contact_balance
    use linkdyn_contact, only: contact_type, n_press, pressing
    use linkdyn_contact_forces, only: solve_held
    use linkdyn_friction_balance, only: balance_friction, driven_press
    use linkdyn_friction_state, only: friction_state, linear_press, rubs_as_pressed
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_model, only: driven_type
    use linkdyn_slip_parts, only: solve_together
    implicit none (type, external)
    private
    public :: contact_responses, balance_contacts

    !> What a unit of each cause adds.
    type :: unit_effects
        real(wp), allocatable :: away(:, :, :)         !! (lane, held, cause)
        real(wp), allocatable :: press(:, :, :, :)     !! (lane, n_press, contact, cause)
        real(wp), allocatable :: mesh(:, :, :)         !! (lane, driven, cause)
    end type unit_effects

    !> How what is held accelerates and what presses, with no push and no friction, and what a unit of each adds.
    type :: contact_responses
        private
        real(wp), allocatable :: away(:, :)            !! (lane, held)
        real(wp), allocatable :: press(:, :, :)        !! but for what drives wheels apart (lane, n_press, contact) [N]
        real(wp), allocatable :: mesh(:, :)            !! forces of teeth that do (lane, driven) [N]
        type(driven_type), allocatable :: driven(:)    !! contacts that feel it
        real(wp), allocatable :: part(:, :, :)         !! of each newton (lane, n_press, driven)
        type(unit_effects) :: of_push, of_amount
    contains
        procedure :: begin => begin_responses
        procedure :: note_push
        procedure :: note_amount
        procedure :: begin_there
        procedure :: yield_to_kept
        procedure :: fits
    end type contact_responses

contains

    !> With no push and no friction `away` and what `friction` says have been found.
    subroutine begin_responses(self, driven, away, friction)
        class(contact_responses), intent(inout) :: self
        type(driven_type), intent(in) :: driven(:)     !! of the model
        real(wp), intent(in) :: away(:, :)             !! (lane, held)
        type(friction_state), intent(in) :: friction

        self%driven = driven
        self%part = friction%driven(:, 1:, :)
        call begin_there(self, away, friction)
        call make_room(size(away, 2), size(friction%press, 3), size(driven), size(away, 2), self%of_push)
        call make_room(size(away, 2), size(friction%press, 3), size(driven), size(friction%press, 3), self%of_amount)
    end subroutine begin_responses

    subroutine make_room(n_held, n_contact, n_driven, n_cause, effects)
        integer, intent(in) :: n_held, n_contact, n_driven, n_cause
        type(unit_effects), intent(inout) :: effects

        allocate (effects%away(lanes, n_held, n_cause), effects%press(lanes, n_press, n_contact, n_cause), &
                  effects%mesh(lanes, n_driven, n_cause), source=0.0_wp)
    end subroutine make_room

    !> What a push alone has made.
    subroutine note_push(self, k, unit, away, friction)
        class(contact_responses), intent(inout) :: self
        integer, intent(in) :: k
        real(wp), intent(in) :: unit(lanes)            !! that push; 0: there is none
        real(wp), intent(in) :: away(:, :)             !! (lane, held)
        type(friction_state), intent(in) :: friction

        call note_effect(self%away, self%press, self%mesh, self%driven, unit, away, friction, k, self%of_push)
    end subroutine note_push

    !> What the friction of a contact alone has made.
    subroutine note_amount(self, k, unit, away, friction)
        class(contact_responses), intent(inout) :: self
        integer, intent(in) :: k
        real(wp), intent(in) :: unit(lanes)            !! that amount; 0: it does not rub
        real(wp), intent(in) :: away(:, :)             !! (lane, held)
        type(friction_state), intent(in) :: friction

        call note_effect(self%away, self%press, self%mesh, self%driven, unit, away, friction, k, self%of_amount)
    end subroutine note_amount

    subroutine note_effect(away_before, press_before, mesh_before, driven, unit, away, friction, k, effects)
        real(wp), intent(in) :: away_before(:, :), press_before(:, :, :), mesh_before(:, :)
        type(driven_type), intent(in) :: driven(:)
        real(wp), intent(in) :: unit(lanes), away(:, :)
        type(friction_state), intent(in) :: friction
        integer, intent(in) :: k
        type(unit_effects), intent(inout) :: effects
        real(wp) :: press(lanes, n_press, size(press_before, 3))
        integer :: lane

        press = linear_press(driven, friction)
        do lane = 1, lanes
            if (.not. unit(lane) > 0) cycle
            effects%away(lane, :, k) = (away(lane, :) - away_before(lane, :))/unit(lane)
            effects%press(lane, :, :, k) = (press(lane, :, :) - press_before(lane, :, :))/unit(lane)
            effects%mesh(lane, :, k) = (friction%driven(lane, 0, :) - mesh_before(lane, :))/unit(lane)
        end do
    end subroutine note_effect

    !> `away` and what `friction` says have been found with these pushes, or none, and its amounts: what there is without both
    !> follows.
    subroutine begin_there(self, away, friction, push)
        class(contact_responses), intent(inout) :: self
        real(wp), intent(in) :: away(:, :)             !! (lane, held)
        type(friction_state), intent(in) :: friction
        real(wp), intent(in), optional :: push(:, :)   !! (lane, held); absent: nothing pushes or rubs

        self%away = away
        self%press = linear_press(self%driven, friction)
        self%mesh = friction%driven(:, 0, :)
        if (.not. present(push)) return
        call take_away(push, self%of_push, self%away, self%press, self%mesh)
        call take_away(friction%amount, self%of_amount, self%away, self%press, self%mesh)
    end subroutine begin_there

    !> What cannot move while others stay as they are goes with them, whatever it is asked for: no push could give both. Friction
    !> changes nothing in that.
    subroutine yield_to_kept(self, lane, is_kept, is_held, wanted)
        class(contact_responses), intent(in) :: self
        integer, intent(in) :: lane
        logical, intent(in) :: is_kept(:)              !! these stay as they are (held)
        logical, intent(in) :: is_held(:)              !! (held)
        real(wp), intent(inout) :: wanted(:)           !! accelerations (held)
        real(wp), parameter :: rigid = 1.0e-10_wp      !! of what it answers to its own push: that is none
        real(wp) :: push(count(is_kept .and. is_held))
        integer, allocatable :: kept(:)
        integer :: i, k

        kept = pack([(k, k=1, size(wanted))], is_kept .and. is_held)
        if (size(kept) == 0) return
        associate (response => self%of_push%away(lane, :, :), away => self%away(lane, :))
            push = solve_held(response(kept, kept), wanted(kept) - away(kept))
            do i = 1, size(wanted)
                if (is_kept(i) .or. .not. is_held(i)) cycle
                if (response(i, i) - dot_product(response(i, kept), solve_held(response(kept, kept), response(kept, i))) &
                    > rigid*abs(response(i, i))) cycle
                wanted(i) = away(i) + dot_product(response(i, kept), push)
            end do
        end associate
    end subroutine yield_to_kept

    !> What causes of these sizes do.
    pure subroutine take_away(amount, effects, away, press, mesh)
        real(wp), intent(in) :: amount(:, :)           !! (lane, cause)
        type(unit_effects), intent(in) :: effects
        real(wp), intent(inout) :: away(:, :), press(:, :, :), mesh(:, :)
        integer :: k, lane

        do k = 1, size(amount, 2)
            do lane = 1, lanes
                away(lane, :) = away(lane, :) - amount(lane, k)*effects%away(lane, :, k)
                press(lane, :, :) = press(lane, :, :) - amount(lane, k)*effects%press(lane, :, :, k)
                mesh(lane, :) = mesh(lane, :) - amount(lane, k)*effects%mesh(lane, :, k)
            end do
        end do
    end subroutine take_away

    !> Pushes that give what is held the accelerations wanted, and the friction that there is with them, of one lane.
    subroutine balance_contacts(lead, lever, contact, factor, is_held, wanted, lane, found, push, amount, holding)
        integer, intent(in) :: lead(:)                 !! both as of `linkdyn_slip_parts` (held)
        real(wp), intent(in) :: lever(:)
        type(contact_type), intent(in) :: contact(:)
        real(wp), intent(in) :: factor(:)              !! friction over pressing force and speed (contact) [s/m]
        logical, intent(in) :: is_held(:)              !! (held)
        real(wp), intent(in) :: wanted(:)              !! (held)
        integer, intent(in) :: lane
        type(contact_responses), intent(in) :: found
        real(wp), intent(out) :: push(:)               !! (held)
        real(wp), intent(out) :: amount(:)             !! (contact) [N s/m]
        integer, intent(out) :: holding                !! the contact that holds the mechanism fast; 0: none does
        real(wp) :: press(n_press, size(contact)), slope(n_press, size(contact), size(contact))
        real(wp) :: by_amount(size(push), size(contact))
        type(driven_press) :: driven
        integer, allocatable :: held(:)
        integer :: i, k

        held = pack([(i, i=1, size(push))], is_held)
        push = 0
        by_amount = 0
        associate (response => found%of_push%away(lane, held, held))
            push(held) = solve_together(lead(held), lever(held), response, wanted(held) - found%away(lane, held))
            do k = 1, size(contact)
                if (factor(k) > 0) by_amount(held, k) = &
                    solve_together(lead(held), lever(held), response, -found%of_amount%away(lane, held, k))
            end do
        end associate
        press = found%press(lane, :, :)
        slope = found%of_amount%press(lane, :, :, :)
        driven%contact = found%driven%contact
        driven%force = found%mesh(lane, :)
        driven%slope = found%of_amount%mesh(lane, :, :)
        driven%part = found%part(lane, :, :)
        do i = 1, size(held)
            press = press + push(held(i))*found%of_push%press(lane, :, :, held(i))
            driven%force = driven%force + push(held(i))*found%of_push%mesh(lane, :, held(i))
            do k = 1, size(contact)
                slope(:, :, k) = slope(:, :, k) + by_amount(held(i), k)*found%of_push%press(lane, :, :, held(i))
                driven%slope(:, k) = driven%slope(:, k) + by_amount(held(i), k)*found%of_push%mesh(lane, :, held(i))
            end do
        end do
        call balance_friction(contact, factor, press, slope, amount, holding, driven)
        push = push + matmul(by_amount, amount)
    end subroutine balance_contacts

    !> Is what is held where it should be, and is friction what presses makes it, but for rounding of what both take away? Of a lane
    !> at which `begin_there` has been told of both.
    logical function fits(self, contact, factor, is_held, wanted, lane, push, amount, press, at_work)
        class(contact_responses), intent(in) :: self
        type(contact_type), intent(in) :: contact(:)
        real(wp), intent(in) :: factor(:)              !! (contact) [s/m]
        logical, intent(in) :: is_held(:)              !! (held)
        real(wp), intent(in) :: wanted(:)              !! (held)
        integer, intent(in) :: lane
        real(wp), intent(in) :: push(:), amount(:)     !! (held), (contact)
        real(wp), intent(in) :: press(:, :)            !! with both (n_press, contact) [N]
        real(wp), intent(in) :: at_work                !! the largest force about, but for what pushes and presses
        real(wp), parameter :: still = 1.0e-8_wp
        real(wp), parameter :: small = 1.0e-4_wp       !! of all forces: that much counts, which what holds may have but rounding of
        real(wp), dimension(size(push)) :: away, taken
        real(wp) :: force(size(contact)), largest
        integer :: k

        away = self%away(lane, :)
        taken = abs(away)
        do k = 1, size(contact)
            force(k) = pressing(contact(k), press(:, k))
            away = away + amount(k)*self%of_amount%away(lane, :, k)
            taken = max(taken, abs(amount(k)*self%of_amount%away(lane, :, k)))
        end do
        largest = max(at_work, maxval(force), maxval(abs(push)))
        do k = 1, size(push)
            away = away + push(k)*self%of_push%away(lane, :, k)
            taken = max(taken, abs(self%of_push%away(lane, :, k))*max(abs(push(k)), small*largest))
        end do
        fits = all(abs(wanted - away) <= still*maxval(taken, mask=is_held) .or. .not. is_held) &
               .and. rubs_as_pressed(factor, force, amount, largest)
    end function fits
end module linkdyn_contact_balance
