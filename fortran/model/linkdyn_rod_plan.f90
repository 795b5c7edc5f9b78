!> Recognise a crank or carriage and the rod behind it: a hinge or slide, then a universal joint and a ball, either first.
module linkdyn_rod_plan
    use linkdyn_dyad_plan, only: turn_round
    use linkdyn_kinds, only: wp
    use linkdyn_model, only: model_type, step_type, step_rus, step_pus, side_of, universal_of_rod
    use linkdyn_scene, only: joint_revolute, joint_prismatic, joint_universal, joint_spherical
    implicit none (type, external)
    private
    public :: name_rod_leg

    real(wp), parameter :: alignment = 64*epsilon(1.0_wp)   !! how far from exact a given direction may be by rounding

contains

    !> Make it a step of such a leg, if it is one: its two links with their three joints are given, in either order.
    pure subroutine name_rod_leg(model, step, found)
        type(model_type), intent(in) :: model
        type(step_type), intent(inout) :: step
        logical, intent(out) :: found

        found = .false.
        if (is_hinge_or_slide(step%joint(3))) call turn_round(step)
        if (.not. is_hinge_or_slide(step%joint(1))) return
        if (count(model%joint(step%joint(2:3))%kind == joint_universal) /= 1) return
        if (count(model%joint(step%joint(2:3))%kind == joint_spherical) /= 1) return
        step%kind = merge(step_rus, step_pus, model%joint(step%joint(1))%kind == joint_revolute)
        found = is_closed_form(model, step)

    contains

        pure logical function is_hinge_or_slide(joint)
            integer, intent(in) :: joint

            is_hinge_or_slide = any(model%joint(joint)%kind == [joint_revolute, joint_prismatic])
        end function is_hinge_or_slide
    end subroutine name_rod_leg

    !> The rod has a length, the crank an arm, and the second axis of the universal joint is square to the rod.
    pure logical function is_closed_form(model, step)
        type(model_type), intent(in) :: model
        type(step_type), intent(in) :: step
        real(wp) :: rod(3), arm(3), axis(3)

        associate (joint => model%joint, u => universal_of_rod(model, step))
            rod = own_point(3, 2) - own_point(2, 2)
            axis = joint(u)%frame(:, 3, side_of(joint(u), step%link(2)))
            arm = matmul(own_point(2, 1) - own_point(1, 1), &
                         joint(step%joint(1))%frame(:, :, side_of(joint(step%joint(1)), step%link(1))))
            is_closed_form = norm2(rod) > 0 .and. abs(dot_product(rod, axis)) <= alignment*norm2(rod)
            if (step%kind == step_rus) is_closed_form = is_closed_form .and. norm2(arm(:2)) > alignment*norm2(arm)
        end associate

    contains

        !> Of a joint of the step on one of its links, link axes.
        pure function own_point(j, l) result(point)
            integer, intent(in) :: j, l
            real(wp) :: point(3)

            associate (joint => model%joint(step%joint(j)))
                point = joint%point(:, side_of(joint, step%link(l)))
            end associate
        end function own_point
    end function is_closed_form
end module linkdyn_rod_plan
