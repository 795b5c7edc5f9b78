!> Laws of drives: what they give at instants, of similar mechanisms too.
module linkdyn_drives
    use linkdyn_joint_rates, only: coordinate_of
    use linkdyn_joint_table, only: is_slide
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_laws, only: evaluate_law
    use linkdyn_model, only: model_type
    use linkdyn_scene, only: law_spec, side_torque, side_voltage, side_opening
    implicit none (type, external)
    private
    public :: law_on_lanes, coordinate_of_actuator, effort_scale

contains

    !> Of a similar mechanism: its force over that of a law, or its torque. A voltage is to its torque constant as its speed is to
    !> one; valves open alike.
    pure real(wp) function effort_scale(model, i) result(scale)
        type(model_type), intent(in) :: model
        integer, intent(in) :: i

        associate (spec => model%scene%actuator(i))
            select case (spec%drive%side)
            case (side_torque)
                scale = model%scene%laws%scale**2
            case (side_voltage)
                scale = model%scene%laws%scale
            case (side_opening)
                scale = 1
            case default
                scale = model%scene%laws%scale**merge(1, 2, is_slide(model%joint(spec%joint)%told_kind, spec%variable))
            end select
        end associate
    end function effort_scale

    !> The coordinate that an actuator drives directly; 0 if its joint variable is none.
    pure integer function coordinate_of_actuator(model, i) result(k)
        type(model_type), intent(in) :: model
        integer, intent(in) :: i

        associate (spec => model%scene%actuator(i))
            k = coordinate_of(model, spec%joint, spec%variable)
        end associate
    end function coordinate_of_actuator

    !> A law at the instants of all lanes, which are mostly one.
    pure subroutine law_on_lanes(law, t, value, rate, rate2)
        type(law_spec), intent(in) :: law
        real(wp), intent(in) :: t(lanes)              !! [s]
        real(wp), intent(out) :: value(lanes), rate(lanes), rate2(lanes)
        integer :: lane

        call evaluate_law(law, t(1), value(1), rate(1), rate2(1))
        do lane = 2, lanes
            if (t(lane) == t(lane - 1)) then
                value(lane) = value(lane - 1)
                rate(lane) = rate(lane - 1)
                rate2(lane) = rate2(lane - 1)
            else
                call evaluate_law(law, t(lane), value(lane), rate(lane), rate2(lane))
            end if
        end do
    end subroutine law_on_lanes
end module linkdyn_drives
