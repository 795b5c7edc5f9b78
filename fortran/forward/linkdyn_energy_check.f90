!> Energy as a witness of steps: what is there, less what was supplied, stays as it is. A step that makes energy of nothing, or
!> loses it, has erred more than its own estimate knows, or has come to another assembly.
module linkdyn_energy_check
    use linkdyn_carried_assembly, only: carried_assembly, evaluate_on_assembly
    use linkdyn_energy_balance, only: energy_of_motion
    use linkdyn_forward_state, only: state_layout, unpack_state
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_model, only: model_type
    use linkdyn_whole_turns, only: with_turns
    implicit none (type, external)
    private
    public :: energy_check, weigh_energy, note_record, is_by_record, leave_turns_out, weigh_again, judge_steps, &
        list_neighbours, find_surplus, compare_surplus

    integer, parameter :: n_nudge = 3                  !! states a very little further on

    type :: energy_check
        private
        real(wp) :: surplus(lanes) = 0                 !! energy of the accepted state, less what was supplied [J]
        real(wp) :: gained(lanes) = 0                  !! of it by the step that led there [J]
        real(wp) :: moved(lanes) = 0                   !! energy that was in motion or exchanged in that step [J]
        real(wp) :: kinetic(lanes) = 0                 !! of the accepted state [J]
        real(wp) :: supplied(lanes) = 0                !! until then [J]
        real(wp) :: resolved(lanes) = 0                !! what rounding leaves of these [J]
        real(wp) :: usual_error(lanes) = 0             !! part that steps gain of what is moved, away from change points
        real(wp) :: margin(lanes) = huge(1.0_wp)       !! least one of the accepted state, when it was looked at last
        integer :: n_crossed(lanes) = 0                !! and change points passed by then
        real(wp) :: noise = 0                          !! what rounding makes of the surplus [J]
        real(wp) :: noise_tried = 0                    !! the same of the state looked at last [J]
        ! ---- energies that lanes find, and those by a record, differ by rounding: only those of one of them are compared
        logical :: is_by_record = .false.              !! that of the accepted state, which is then here:
        real(wp) :: t = 0                              !! [s]
        real(wp), allocatable :: y(:), turns(:, :)     !! (n), (lane, n)
    end type energy_check

contains

    !> Energy of the accepted state, and what the step that led there has made of it.
    pure subroutine weigh_energy(energy, kinetic, supplied, check)
        real(wp), intent(in) :: energy(lanes), kinetic(lanes)    !! of the motion there, and part of it [J]
        real(wp), intent(in) :: supplied(:)            !! so far [J] (lane)
        type(energy_check), intent(inout) :: check
        real(wp) :: surplus(lanes)

        surplus = energy - supplied
        check%gained = surplus - check%surplus
        check%moved = kinetic + check%kinetic + abs(supplied - check%supplied)
        check%resolved = epsilon(1.0_wp)*(abs(energy) + kinetic + abs(supplied))
        check%surplus = surplus
        check%kinetic = kinetic
        check%supplied = supplied
        check%noise = check%noise_tried
        check%is_by_record = .false.
    end subroutine weigh_energy

    !> The accepted state, whose energy a record has just found.
    pure subroutine note_record(t, y, turns, check)
        real(wp), intent(in) :: t, y(:)                !! [s], (n)
        real(wp), intent(in) :: turns(:, :)            !! of angles that are not in y (lane, n)
        type(energy_check), intent(inout) :: check

        check%is_by_record = .true.
        check%t = t
        check%y = y
        check%turns = turns
    end subroutine note_record

    pure logical function is_by_record(check)
        type(energy_check), intent(in) :: check

        is_by_record = check%is_by_record
    end function is_by_record

    !> The next steps set out from where these turns have been left out, and so does the way on which lanes look at it again.
    pure subroutine leave_turns_out(turns, check)
        real(wp), intent(in) :: turns(:, :)            !! (lane, n)
        type(energy_check), intent(inout) :: check

        if (.not. check%is_by_record) return
        check%y = with_turns(check%y, -turns(1, :))
        check%turns = check%turns + turns
    end subroutine leave_turns_out

    !> Lanes look at a state: the accepted one is to have its energy from them, too.
    subroutine weigh_again(model, layout, assembly, check)
        type(model_type), intent(in) :: model
        type(state_layout), intent(in) :: layout
        type(carried_assembly), intent(inout) :: assembly
        type(energy_check), intent(inout) :: check
        real(wp) :: surplus(1), scale

        if (.not. check%is_by_record) return
        call find_surplus(model, layout, check%t, reshape(check%y, [size(check%y), 1]), check%turns, assembly, surplus, scale)
        check%surplus = surplus(1)
        check%is_by_record = .false.
    end subroutine weigh_again

    !> Has the last step made energy of nothing, or lost it? A method that estimates its errors, or takes steps that are short
    !> enough, errs by far less. Where two assemblies meet rates may be nothing but rounding: a step there may err little more
    !> than those before it have done.
    pure subroutine judge_steps(n_map, margins, n_crossed, check, is_broken)
        integer, intent(in) :: n_map
        real(wp), intent(in) :: margins(lanes, n_map)  !! of the accepted state
        integer, intent(in) :: n_crossed(lanes)        !! change points passed until then
        type(energy_check), intent(inout) :: check
        logical, intent(out) :: is_broken(lanes)
        real(wp), parameter :: gross = 0.01_wp         !! part of the energy in motion: a hundred such steps, and nothing is left
        real(wp), parameter :: gross_far = 0.1_wp      !! where no other assembly is near: a stiff drive that sets in costs so much
        real(wp), parameter :: fine = 1.0e-5_wp        !! likewise where rates are rounding: five digits of the speed
        real(wp), parameter :: more = 100
        real(wp), parameter :: rounding = 1.0e6_wp     !! of positions near a change point, in units in the last place
        real(wp), parameter :: near = 1.0e-3_wp        !! margin at which rates lose digits
        real(wp), parameter :: far = 0.3_wp            !! and at which a step leads to no other assembly
        real(wp), dimension(lanes) :: error, margin, bound
        logical :: is_near(lanes)
        integer :: m

        margin = huge(1.0_wp)
        do m = 1, n_map
            margin = min(margin, abs(margins(:, m)))
        end do
        is_near = min(margin, check%margin) < near .or. n_crossed > check%n_crossed
        error = max(abs(check%gained) - rounding*check%resolved, 0.0_wp)/max(check%moved, tiny(1.0_wp))
        bound = merge(gross_far, gross, min(margin, check%margin) > far .and. n_crossed == check%n_crossed)
        is_broken = error > merge(min(max(fine, more*check%usual_error), gross), bound, is_near)
        where (.not. is_near) check%usual_error = error
        check%margin = margin
        check%n_crossed = n_crossed
    end subroutine judge_steps

    !> A state, and those by whose energies its own is judged: a very little further on, and each component in error alone.
    pure function list_neighbours(y, nudge, error) result(state)
        real(wp), intent(in) :: y(:)                   !! (n)
        real(wp), intent(in) :: nudge(:), error(:)     !! (n)
        real(wp) :: state(size(y), 0:n_nudge + size(y))
        integer :: k

        state = spread(y, 2, size(state, 2))
        do k = 1, n_nudge
            state(:, k) = y + (k - 2.5_wp)*nudge
        end do
        do k = 1, size(y)
            state(k, n_nudge + k) = y(k) + error(k)
        end do
    end function list_neighbours

    !> Energy that is there but was not supplied, since the last accepted state, over what the errors allowed and rounding
    !> would make.
    subroutine compare_surplus(surplus, scale, check, part)
        real(wp), intent(in) :: surplus(0:)            !! of the state and its neighbours [J]
        real(wp), intent(in) :: scale                  !! of what the first one is a difference of [J]
        type(energy_check), intent(inout) :: check
        real(wp), intent(out) :: part
        real(wp), parameter :: many = 10               !! errors in a row, of one sign
        real(wp), parameter :: rounding = 64           !! units in the last place that a sum over all links loses
        real(wp) :: noise

        ! coordinates that are driven are not nudged: where all are, only their rounding is there to be seen
        noise = max(maxval(abs(surplus(1:n_nudge) - surplus(0))), rounding*epsilon(1.0_wp)*scale)
        part = abs(surplus(0) - check%surplus(1)) &
               /max(many*(sum(abs(surplus(n_nudge + 1:) - surplus(0))) + noise + check%noise), tiny(1.0_wp))
        if (.not. part <= huge(1.0_wp)) part = huge(1.0_wp)
        check%noise_tried = noise
    end subroutine compare_surplus

    !> Energy of states on the accepted assembly, less what was supplied.
    subroutine find_surplus(model, layout, t, y, turns, assembly, surplus, scale)
        type(model_type), intent(in) :: model
        type(state_layout), intent(in) :: layout
        real(wp), intent(in) :: t, y(:, :)             !! [s], (n, state)
        real(wp), intent(in) :: turns(:, :)            !! of angles that are not in y (lane, n)
        type(carried_assembly), intent(inout) :: assembly
        real(wp), intent(out) :: surplus(:)            !! [J] (state)
        real(wp), intent(out) :: scale                 !! of what the first one is a difference of [J]
        real(wp) :: lane_y(lanes, size(y, 1)), energy(lanes), kinetic(lanes), instant(lanes)
        integer :: first, lane

        instant = t
        do first = 1, size(surplus), lanes
            do lane = 1, lanes
                lane_y(lane, :) = y(:, min(first + lane - 1, size(surplus)))
            end do
            call unpack_state(model, layout, instant, lane_y, turns, assembly%state)
            call evaluate_on_assembly(model, instant, assembly, assembly%state)
            call energy_of_motion(model, assembly%state, energy, kinetic)
            if (first == 1) scale = abs(energy(1)) + kinetic(1) + abs(lane_y(1, layout%supplied))
            energy = energy - lane_y(:, layout%supplied)
            do lane = 1, min(lanes, size(surplus) - first + 1)
                surplus(first + lane - 1) = energy(lane)
            end do
        end do
    end subroutine find_surplus
end module linkdyn_energy_check
