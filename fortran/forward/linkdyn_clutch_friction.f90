!> What clutches rub with while they slip, and what they could hold: by laws of their own, or by the reactions in joints whose
!> friction sticks.
module linkdyn_clutch_friction
    use linkdyn_clutch_states, only: clutch_states
    use linkdyn_contact, only: contact_type, sliding_coefficient, lever_of, no_speed, part_of, holds_contact, is_mesh, &
        pressing, n_press
    use linkdyn_drives, only: law_on_lanes
    use linkdyn_equations, only: equations_type, equation_workspace
    use linkdyn_friction_state, only: pressing_forces
    use linkdyn_held_variables, only: slips
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_measures, only: find_laws
    use linkdyn_model, only: model_type
    use linkdyn_planar_motion, only: level_velocity
    use linkdyn_scene, only: scene_type, law_over, n_clutch
    use linkdyn_slip_parts, only: slip_levers
    implicit none (type, external)
    private
    public :: rub_clutches, tell_contacts, has_sticking, measure_grip, reserve, carried_load

contains

    !> Capacities of closed clutches, and the force of those that slip. Kinematics of the state are in the workspace.
    subroutine rub_clutches(model, t, workspace, clutches)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: t(lanes)               !! [s]
        type(equation_workspace), intent(inout) :: workspace
        type(clutch_states), intent(inout) :: clutches
        real(wp), dimension(lanes) :: rate, rate2
        integer :: i

        associate (state => workspace%state, of => clutches)
            of%rub = 0
            call tell_contacts(model, of%sense, workspace%friction%sense)
            if (any(of%is_closed) .and. any(model%scene%clutch%capacity%kind == law_over)) call find_laws(model, state)
            do i = 1, size(of%rub, 2)
                associate (clutch => model%scene%clutch(i))
                    if (clutch%is_positive .or. clutch%friction > 0 .or. .not. any(of%is_closed(:, i))) cycle
                    if (clutch%capacity%kind == law_over) then
                        of%capacity(:, i) = state%law(:, clutch%capacity%law) &
                                            *model%scene%laws%scale**merge(1, 2, clutch%unit == "N")
                    else
                        call law_on_lanes(clutch%capacity, t, of%capacity(:, i), rate, rate2)
                    end if
                    where (of%capacity(:, i) < 0) of%capacity(:, i) = 0
                    where (of%is_closed(:, i) .and. .not. of%holds(:, i)) of%rub(:, i) = -of%sense(:, i)*of%capacity(:, i)
                end associate
            end do
            of%force = of%rub
            of%applied = of%rub
            state%clutch_force = of%rub
        end associate
    end subroutine rub_clutches

    !> Joints that may stick rub by their reactions, the way they slip.
    subroutine tell_contacts(model, sense, of_contacts)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: sense(:, :)            !! of all slips (lane, n_clutch)
        real(wp), intent(inout) :: of_contacts(:, :, :)    !! see `friction_state` (lane, n_part, contact)
        real(wp) :: at_rest
        integer :: i, k

        do i = 1, n_clutch(model%scene)
            associate (clutch => model%scene%clutch(i))
                if (clutch%friction == 0) cycle
                at_rest = merge(2.0_wp, 0.0_wp, clutch%lead == i)
                do k = 1, size(model%contact)
                    associate (contact => model%contact(k))
                        if (holds_contact(clutch, contact)) of_contacts(:, part_of(contact, clutch), k) = &
                            merge(sense(:, i), at_rest, slips_some_way(model%scene, i, sense))
                    end associate
                end do
            end associate
        end do
    end subroutine tell_contacts

    !> Has a clutch a slip, or one that goes with it?
    pure function slips_some_way(scene, i, sense) result(slips)
        type(scene_type), intent(in) :: scene
        integer, intent(in) :: i                       !! clutch
        real(wp), intent(in) :: sense(:, :)            !! of all slips (lane, n_clutch)
        logical :: slips(lanes)
        integer :: k

        slips = .false.
        do k = 1, size(sense, 2)
            if (scene%clutch(k)%lead == scene%clutch(i)%lead) slips = slips .or. abs(sense(:, k)) > 0
        end do
    end function slips_some_way

    !> Are there joints whose friction sticks?
    pure logical function has_sticking(model)
        type(model_type), intent(in) :: model

        has_sticking = .false.
        if (n_clutch(model%scene) > 0) has_sticking = any(model%scene%clutch%friction > 0)
    end function has_sticking

    !> What joints that may stick could hold, or rub with, by the reactions just found.
    subroutine measure_grip(model, equations, workspace, clutches)
        type(model_type), intent(in) :: model
        type(equations_type), intent(in) :: equations
        type(equation_workspace), intent(in) :: workspace
        type(clutch_states), intent(inout) :: clutches
        real(wp) :: press(lanes, size(equations%rub)), slip(lanes, n_clutch(model%scene))
        real(wp), dimension(lanes) :: square, missing
        logical :: has_sense(lanes)
        integer :: i, k

        call pressing_forces(equations%rub, workspace%friction, press)
        slip = slips(model, workspace%state, level_velocity)
        associate (of => clutches)
            do i = 1, size(slip, 2)
                associate (clutch => model%scene%clutch(i))
                    if (clutch%friction == 0) cycle
                    where (of%holds(:, i)) slip(:, i) = 0
                    of%capacity(:, i) = 0
                    where (.not. of%holds(:, i)) of%force(:, i) = 0
                end associate
            end do
            do k = 1, size(model%contact)
                associate (contact => model%contact(k))
                    call look_along(contact)
                    if (is_mesh(contact)) call press_as_held()
                    do i = 1, size(slip, 2)
                        associate (clutch => model%scene%clutch(i))
                            if (holds_contact(clutch, contact)) &
                                call rub(contact, lever_of(contact, part_of(contact, clutch)), of%sense(:, i), slip(:, i), &
                                         of%holds(:, i), of%capacity(:, i), of%force(:, i))
                        end associate
                    end do
                end associate
            end do
        end associate

    contains

        !> How fast the surface slides, and what it lacks of sliding the way it does, as in `linkdyn_friction`.
        subroutine look_along(contact)
            type(contact_type), intent(in) :: contact
            real(wp) :: along(lanes), lever(size(slip, 2))

            lever = 0
            do i = 1, size(slip, 2)
                associate (clutch => model%scene%clutch(i))
                    if (holds_contact(clutch, contact)) lever(i) = lever_of(contact, part_of(contact, clutch))
                end associate
            end do
            along = matmul(slip*clutches%sense, lever)
            has_sense = matmul(abs(clutches%sense), lever) > 0
            missing = merge(max(no_speed(contact) - along, 0.0_wp), 0.0_wp, has_sense)
            square = 0
            do i = 1, size(slip, 2)
                if (lever(i) > 0) square = square + (lever(i)*slip(:, i) + missing*clutches%sense(:, i))**2
            end do
        end subroutine look_along

        !> What presses teeth that are held by what they lose the way in which they would break loose, against what holds them: that
        !> hangs on who would drive.
        subroutine press_as_held()
            real(wp) :: feels(n_press)
            integer :: lane

            do i = 1, size(slip, 2)
                if (.not. holds_contact(model%scene%clutch(i), model%contact(k))) cycle
                do lane = 1, lanes
                    if (.not. clutches%holds(lane, i)) cycle
                    feels = -sign(1.0_wp, clutches%force(lane, i))*workspace%friction%press(lane, :, k)
                    press(lane, k) = pressing(model%contact(k), feels)
                end do
            end do
        end subroutine press_as_held

        subroutine rub(contact, lever, sense, slip, holds, capacity, force)
            type(contact_type), intent(in) :: contact
            real(wp), intent(in) :: lever
            real(wp), intent(in), dimension(lanes) :: sense, slip
            logical, intent(in) :: holds(lanes)
            real(wp), intent(inout), dimension(lanes) :: capacity, force
            real(wp) :: speed(lanes), most(lanes)

            speed = merge(0.0_wp, sqrt(square), holds)
            most = lever*press(:, k)*sliding_coefficient(contact, speed)
            capacity = capacity + most
            where (has_sense .and. .not. holds) force = force - most*(lever*slip + missing*sense)/speed
        end subroutine rub
    end subroutine measure_grip

    !> What a clutch could hold beside what it does: it begins to slip where that is gone. Rounding is none of it.
    function reserve(model, i, clutches)
        type(model_type), intent(in) :: model
        integer, intent(in) :: i                       !! clutch
        type(clutch_states), intent(in) :: clutches
        real(wp) :: reserve(lanes)
        real(wp), parameter :: slack = 1.0e-12_wp

        associate (clutch => model%scene%clutch(i), most => model%scene%clutch(i)%static*clutches%capacity(:, i))
            reserve = 1
            if (.not. clutch%is_positive) reserve = most*(1 + slack) - carried_load(model, i, clutches)
        end associate
    end function reserve

    !> The force of a clutch; of one that goes with others that of all of them, as if it were at its joint variable.
    function carried_load(model, i, clutches) result(load)
        type(model_type), intent(in) :: model
        integer, intent(in) :: i                       !! clutch
        type(clutch_states), intent(in) :: clutches
        real(wp) :: load(lanes), lever(n_clutch(model%scene))
        integer :: k

        load = abs(clutches%force(:, i))
        if (count(model%scene%clutch%lead == model%scene%clutch(i)%lead) == 1) return
        lever = slip_levers(model)
        load = 0
        do k = 1, size(lever)
            if (model%scene%clutch(k)%lead == model%scene%clutch(i)%lead) load = load + (clutches%force(:, k)*lever(i)/lever(k))**2
        end do
        load = sqrt(load)
    end function carried_load
end module linkdyn_clutch_friction
