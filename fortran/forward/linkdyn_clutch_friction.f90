!> What clutches rub with while they slip, and what they could hold: by laws of their own, or by the reactions in joints whose friction
!> sticks.
module linkdyn_clutch_friction
    use linkdyn_clutch_states, only: clutch_states
    use linkdyn_contact, only: sliding_coefficient, lever_of
    use linkdyn_drives, only: law_on_lanes
    use linkdyn_equations, only: equations_type, equation_workspace
    use linkdyn_friction_state, only: pressing_forces
    use linkdyn_joint_rates, only: joint_rate
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_measures, only: find_laws
    use linkdyn_model, only: model_type
    use linkdyn_planar_motion, only: level_velocity
    use linkdyn_scene, only: law_over, n_clutch
    implicit none (type, external)
    private
    public :: rub_clutches, has_sticking, measure_grip, reserve

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
            if (any(of%is_closed) .and. any(model%scene%clutch%capacity%kind == law_over)) call find_laws(model, state)
            do i = 1, size(of%rub, 2)
                associate (clutch => model%scene%clutch(i))
                    if (clutch%friction > 0) call let_contacts_slide(model, i, of%sense(:, i), workspace)
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
    subroutine let_contacts_slide(model, i, sense, workspace)
        type(model_type), intent(in) :: model
        integer, intent(in) :: i                       !! clutch
        real(wp), intent(in) :: sense(lanes)           !! of its slip
        type(equation_workspace), intent(inout) :: workspace
        integer :: k

        do k = 1, size(model%contact)
            if (model%contact(k)%joint /= model%scene%clutch(i)%joint(1)) cycle
            workspace%friction%sense(:, k) = merge(sense, 2.0_wp, abs(sense) > 0)
        end do
    end subroutine let_contacts_slide

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
        integer :: i, k

        call pressing_forces(equations%rub, workspace%friction, press)
        associate (of => clutches, state => workspace%state)
            do i = 1, size(slip, 2)
                associate (clutch => model%scene%clutch(i))
                    if (clutch%friction == 0) cycle
                    slip(:, i) = abs(joint_rate(model, state, clutch%joint(1), clutch%variable(1), level_velocity))
                    where (of%holds(:, i)) slip(:, i) = 0
                    of%capacity(:, i) = 0
                    do k = 1, size(model%contact)
                        associate (contact => model%contact(k))
                            if (contact%joint == clutch%joint(1)) of%capacity(:, i) = of%capacity(:, i) &
                                + lever_of(contact)*press(:, k)*sliding_coefficient(contact, lever_of(contact)*slip(:, i))
                        end associate
                    end do
                    where (.not. of%holds(:, i)) of%force(:, i) = -of%sense(:, i)*of%capacity(:, i)
                end associate
            end do
        end associate
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
            if (.not. clutch%is_positive) reserve = most*(1 + slack) - abs(clutches%force(:, i))
        end associate
    end function reserve
end module linkdyn_clutch_friction
