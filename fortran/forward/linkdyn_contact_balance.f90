!> What stops and clutches push and how much contacts rub at once, of one state.
!>
!> Accelerations of what is held and what presses contacts are linear in both. Pushes are taken out by what they have to do, then the
!> friction that is left is that of a mechanism that rubs and is held by nothing (`linkdyn_friction_balance`).
module linkdyn_contact_balance
    use linkdyn_contact, only: contact_type, n_press, pressing
    use linkdyn_contact_forces, only: solve_held
    use linkdyn_friction_balance, only: balance_friction, driven_press
    use linkdyn_friction_state, only: friction_state, linear_press
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_model, only: driven_type
    implicit none (type, external)
    private
    public :: contact_responses, balance_contacts

    !> How what is held accelerates and what presses, with no push and no friction, and what a unit of each adds.
    type :: contact_responses
        real(wp), allocatable :: away(:, :)            !! (lane, held)
        real(wp), allocatable, private :: press(:, :, :)               !! but for what drives wheels apart (lane, n_press, contact) [N]
        real(wp), allocatable, private :: mesh(:, :)                   !! forces of teeth that do (lane, driven) [N]
        real(wp), allocatable, private :: away_by_push(:, :, :)        !! (lane, held, push)
        real(wp), allocatable, private :: press_by_push(:, :, :, :)    !! (lane, n_press, contact, push)
        real(wp), allocatable, private :: mesh_by_push(:, :, :)        !! (lane, driven, push)
        real(wp), allocatable, private :: away_by_amount(:, :, :)      !! (lane, held, contact)
        real(wp), allocatable, private :: press_by_amount(:, :, :, :)  !! (lane, n_press, contact, contact)
        real(wp), allocatable, private :: mesh_by_amount(:, :, :)      !! (lane, driven, contact)
        type(driven_type), allocatable, private :: driven(:)           !! contacts that feel it
        real(wp), allocatable, private :: part(:, :, :)                !! of each newton (lane, n_press, driven)
    contains
        procedure :: begin => begin_responses
        procedure :: note_push
        procedure :: note_amount
        procedure :: begin_there
        procedure :: fits
    end type contact_responses

contains

    !> With no push and no friction `away` and what `friction` says have been found.
    subroutine begin_responses(self, driven, away, friction)
        class(contact_responses), intent(inout) :: self
        type(driven_type), intent(in) :: driven(:)     !! of the model
        real(wp), intent(in) :: away(:, :)             !! (lane, held)
        type(friction_state), intent(in) :: friction
        integer :: n_held, n_contact

        n_held = size(away, 2)
        n_contact = size(friction%press, 3)
        self%driven = driven
        self%away = away
        self%press = linear_press(driven, friction)
        self%mesh = friction%driven(:, 0, :)
        self%part = friction%driven(:, 1:, :)
        allocate (self%away_by_push(lanes, n_held, n_held), self%press_by_push(lanes, n_press, n_contact, n_held), &
                  self%mesh_by_push(lanes, size(driven), n_held), self%away_by_amount(lanes, n_held, n_contact), &
                  self%press_by_amount(lanes, n_press, n_contact, n_contact), &
                  self%mesh_by_amount(lanes, size(driven), n_contact), source=0.0_wp)
    end subroutine begin_responses

    !> What a push alone has made.
    subroutine note_push(self, k, unit, away, friction)
        class(contact_responses), intent(inout) :: self
        integer, intent(in) :: k
        real(wp), intent(in) :: unit(lanes)            !! that push
        real(wp), intent(in) :: away(:, :)             !! (lane, held)
        type(friction_state), intent(in) :: friction
        real(wp) :: press(lanes, n_press, size(self%press, 3))
        integer :: lane

        press = linear_press(self%driven, friction)
        do lane = 1, lanes
            self%away_by_push(lane, :, k) = (away(lane, :) - self%away(lane, :))/unit(lane)
            self%press_by_push(lane, :, :, k) = (press(lane, :, :) - self%press(lane, :, :))/unit(lane)
            self%mesh_by_push(lane, :, k) = (friction%driven(lane, 0, :) - self%mesh(lane, :))/unit(lane)
        end do
    end subroutine note_push

    !> The same of the friction of one contact alone.
    subroutine note_amount(self, k, unit, away, friction)
        class(contact_responses), intent(inout) :: self
        integer, intent(in) :: k
        real(wp), intent(in) :: unit(lanes)            !! that amount; 0: it does not rub
        real(wp), intent(in) :: away(:, :)             !! (lane, held)
        type(friction_state), intent(in) :: friction
        real(wp) :: press(lanes, n_press, size(self%press, 3))
        integer :: lane

        press = linear_press(self%driven, friction)
        do lane = 1, lanes
            if (.not. unit(lane) > 0) cycle
            self%away_by_amount(lane, :, k) = (away(lane, :) - self%away(lane, :))/unit(lane)
            self%press_by_amount(lane, :, :, k) = (press(lane, :, :) - self%press(lane, :, :))/unit(lane)
            self%mesh_by_amount(lane, :, k) = (friction%driven(lane, 0, :) - self%mesh(lane, :))/unit(lane)
        end do
    end subroutine note_amount

    !> With these pushes and the amounts of `friction` it and `away` have been found: what there is without them follows.
    subroutine begin_there(self, push, away, friction)
        class(contact_responses), intent(inout) :: self
        real(wp), intent(in) :: push(:, :)             !! (lane, held)
        real(wp), intent(in) :: away(:, :)             !! (lane, held)
        type(friction_state), intent(in) :: friction
        integer :: k, lane

        self%away = away
        self%press = linear_press(self%driven, friction)
        self%mesh = friction%driven(:, 0, :)
        do lane = 1, lanes
            do k = 1, size(push, 2)
                self%away(lane, :) = self%away(lane, :) - push(lane, k)*self%away_by_push(lane, :, k)
                self%press(lane, :, :) = self%press(lane, :, :) - push(lane, k)*self%press_by_push(lane, :, :, k)
                self%mesh(lane, :) = self%mesh(lane, :) - push(lane, k)*self%mesh_by_push(lane, :, k)
            end do
            do k = 1, size(friction%amount, 2)
                associate (amount => friction%amount(lane, k))
                    self%away(lane, :) = self%away(lane, :) - amount*self%away_by_amount(lane, :, k)
                    self%press(lane, :, :) = self%press(lane, :, :) - amount*self%press_by_amount(lane, :, :, k)
                    self%mesh(lane, :) = self%mesh(lane, :) - amount*self%mesh_by_amount(lane, :, k)
                end associate
            end do
        end do
    end subroutine begin_there

    !> Pushes that give what is held the accelerations wanted, and the friction that there is with them, of one lane.
    subroutine balance_contacts(contact, factor, is_held, wanted, lane, found, push, amount, holding)
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
        associate (response => found%away_by_push(lane, held, held))
            push(held) = solve_held(response, wanted(held) - found%away(lane, held))
            do k = 1, size(contact)
                if (factor(k) > 0) by_amount(held, k) = solve_held(response, -found%away_by_amount(lane, held, k))
            end do
        end associate
        press = found%press(lane, :, :)
        slope = found%press_by_amount(lane, :, :, :)
        driven%contact = found%driven%contact
        driven%force = found%mesh(lane, :)
        driven%slope = found%mesh_by_amount(lane, :, :)
        driven%part = found%part(lane, :, :)
        do i = 1, size(held)
            press = press + push(held(i))*found%press_by_push(lane, :, :, held(i))
            driven%force = driven%force + push(held(i))*found%mesh_by_push(lane, :, held(i))
            do k = 1, size(contact)
                slope(:, :, k) = slope(:, :, k) + by_amount(held(i), k)*found%press_by_push(lane, :, :, held(i))
                driven%slope(:, k) = driven%slope(:, k) + by_amount(held(i), k)*found%mesh_by_push(lane, :, held(i))
            end do
        end do
        call balance_friction(contact, factor, press, slope, amount, holding, driven)
        push = push + matmul(by_amount, amount)
    end subroutine balance_contacts

    !> Is what is held where it should be, and is friction what presses makes it, but for rounding of what both take away? Of a lane at
    !> which `begin_there` has been told of both.
    logical function fits(self, contact, factor, is_held, wanted, lane, push, amount, press)
        class(contact_responses), intent(in) :: self
        type(contact_type), intent(in) :: contact(:)
        real(wp), intent(in) :: factor(:)              !! (contact) [s/m]
        logical, intent(in) :: is_held(:)              !! (held)
        real(wp), intent(in) :: wanted(:)              !! (held)
        integer, intent(in) :: lane
        real(wp), intent(in) :: push(:), amount(:)     !! (held), (contact)
        real(wp), intent(in) :: press(:, :)            !! with both (n_press, contact) [N]
        real(wp), parameter :: still = 1.0e-8_wp, misfit = 1.0e-6_wp
        real(wp), parameter :: small = 1.0e-4_wp       !! of what presses: forces that count, which what holds may have but rounding of
        real(wp), dimension(size(push)) :: away, taken
        real(wp) :: force(size(contact))
        integer :: k

        away = self%away(lane, :)
        taken = abs(away)
        do k = 1, size(contact)
            force(k) = pressing(contact(k), press(:, k))
            away = away + amount(k)*self%away_by_amount(lane, :, k)
            taken = max(taken, abs(amount(k)*self%away_by_amount(lane, :, k)))
        end do
        do k = 1, size(push)
            away = away + push(k)*self%away_by_push(lane, :, k)
            taken = max(taken, abs(self%away_by_push(lane, :, k))*max(abs(push(k)), small*maxval(force)))
        end do
        fits = all(abs(wanted - away) <= still*maxval(taken, mask=is_held) .or. .not. is_held) &
               .and. all(abs(factor*force - amount) <= misfit*factor*maxval(force))
    end function fits
end module linkdyn_contact_balance
