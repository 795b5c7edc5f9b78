!> What the actuators do in forward dynamics: driving forces from time and from the motion of their joints.
module linkdyn_drives
    use linkdyn_joint_rates, only: measure_variable, coordinate_of
    use linkdyn_joint_table, only: is_slide
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state
    use linkdyn_lane_count, only: lanes
    use linkdyn_laws, only: evaluate_law
    use linkdyn_model, only: model_type
    use linkdyn_scene, only: drive_spec, law_spec, drive_inverse, drive_constant, drive_table, &
        drive_spring_damper, drive_dc_motor, drive_pd, drive_over, side_torque, side_voltage
    implicit none (type, external)
    private
    public :: evaluate_drive, law_on_lanes, needs_motion, coordinate_of_actuator, effort_scale

contains

    !> What the law of actuator i gives, for every law but `inverse`: its driving force, or what is told by `side`. Laws over the state
    !> have their values there.
    subroutine evaluate_drive(model, i, t, state, force)
        type(model_type), intent(in) :: model
        integer, intent(in) :: i
        real(wp), intent(in) :: t(lanes)              !! [s]
        type(kinematic_state), intent(in) :: state    !! positions and velocities are up to date
        real(wp), intent(out) :: force(lanes)         !! [N, N m]
        real(wp) :: position(lanes), rate(lanes), target(lanes), target_rate(lanes), target_rate2(lanes)

        associate (drive => model%scene%actuator(i)%drive)
            target = drive%value(3)
            if (any(drive%kind == [drive_table, drive_dc_motor, drive_pd])) &
                call law_on_lanes(drive%target, t, target, target_rate, target_rate2)
            associate (spec => model%scene%actuator(i))
                if (needs_motion(drive)) call measure_variable(model, state, spec%joint, spec%variable, target, position, rate)
            end associate
            select case (drive%kind)
            case (drive_constant)
                force = drive%value(1)
            case (drive_table)
                force = target
            case (drive_over)
                force = state%law(:, drive%target%law)*effort_scale(model, i)
            case (drive_spring_damper)
                force = -(drive%value(1)*(position - target) + drive%value(2)*rate)
            case (drive_dc_motor)
                force = motor_force(drive%value(1:6), target - position, rate)
            case (drive_pd)
                force = drive%value(1)*(target - position) + drive%value(2)*(target_rate - rate)
            case default
                force = 0
            end select
        end associate
    end subroutine evaluate_drive

    !> Of a similar mechanism: its force over that of a law, or its torque. A voltage is to its torque constant as its speed is to one.
    pure real(wp) function effort_scale(model, i) result(scale)
        type(model_type), intent(in) :: model
        integer, intent(in) :: i

        associate (spec => model%scene%actuator(i))
            select case (spec%drive%side)
            case (side_torque)
                scale = model%scene%laws%scale**2
            case (side_voltage)
                scale = model%scene%laws%scale
            case default
                scale = model%scene%laws%scale**merge(1, 2, is_slide(model%joint(spec%joint)%told_kind, spec%variable))
            end select
        end associate
    end function effort_scale

    !> A DC motor behind a reducer under position feedback: the voltage K_P*(target - position), less what the turning
    !> rotor induces, drives the current through the armature.
    !>
    !> **Source**: the lecture: tau = n eta K_T (K_P (target - position) - K_E n rate)/R_a.
    pure function motor_force(constant, lag, rate) result(force)
        real(wp), intent(in) :: constant(6)           !! n eta K_T K_E K_P R_a
        real(wp), intent(in) :: lag(lanes)            !! target less position [m, rad]
        real(wp), intent(in) :: rate(lanes)
        real(wp) :: force(lanes)

        associate (n => constant(1), eta => constant(2), k_t => constant(3), k_e => constant(4), k_p => constant(5), &
                   r_a => constant(6))
            force = (n*eta*k_t/r_a)*(k_p*lag - (k_e*n)*rate)
        end associate
    end function motor_force

    !> Does the force depend on the motion of the joint?
    pure elemental logical function needs_motion(drive)
        type(drive_spec), intent(in) :: drive

        needs_motion = drive%kind == drive_spring_damper .or. drive%kind == drive_dc_motor .or. drive%kind == drive_pd
    end function needs_motion

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
