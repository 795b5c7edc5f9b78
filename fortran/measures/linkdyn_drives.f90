!> Laws of drives: what they give at instants, of similar mechanisms too.
module linkdyn_drives
    use linkdyn_joint_rates, only: coordinate_of
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_laws, only: evaluate_law
    use linkdyn_model, only: model_type, effort_power
    use linkdyn_scene, only: law_spec
    implicit none (type, external)
    private
    public :: law_on_lanes, coordinate_of_actuator, effort_scale

contains

    !> Scale of efforts in a similar mechanism: what its actuator does over what the law gives.
    pure real(wp) function effort_scale(model, i) result(scale)
        type(model_type), intent(in) :: model
        integer, intent(in) :: i

        scale = model%scene%laws%scale**effort_power(model, i)
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
