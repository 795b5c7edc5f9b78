!> What actuators do in forward dynamics: driving forces from time and from the motion of their joints.
!>
!> What depends on time alone, the position wanted and its rate, or the force itself, is given as inputs.
module linkdyn_effort_laws
    use linkdyn_joint_variables, only: variable_near, variable_rate
    use linkdyn_mechanism, only: mechanism_type, drive_numbers
    use linkdyn_scene, only: effort_law, effort_inverse, effort_constant, effort_table, effort_spring_damper, &
        effort_dc_motor, effort_pd, effort_over, effort_controlled, side_joint, at_force, at_stiffness, at_damping, &
        at_rest, at_ratio, at_efficiency, at_torque_constant, at_voltage_constant, at_gain, at_resistance
    use linkdyn_value, only: value, operator(+), operator(-), operator(*), operator(/)
    implicit none (type, external)
    private
    public :: law_effort, follows_target, compares_motion, is_given

contains

    !> Driving force of actuator i.
    function law_effort(mechanism, i, target, target_rate) result(effort)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: i
        type(value), intent(in) :: target, target_rate    !! of the law [m, rad], or the force itself in `target` [N, N m]
        type(value) :: effort                             !! [N, N m]
        type(value) :: k(8), position, rate

        k = drive_numbers(mechanism, i)
        associate (actuator => mechanism%model%scene%actuator(i))
            if (actuator%law%side /= side_joint) then
                effort = target
                return
            end if
            select case (actuator%law%kind)
            case (effort_spring_damper)
                position = variable_near(mechanism, actuator%joint, actuator%variable, k(at_rest))
                rate = variable_rate(mechanism, actuator%joint, actuator%variable)
                effort = -(k(at_stiffness)*(position - k(at_rest)) + k(at_damping)*rate)
            case (effort_dc_motor)
                ! behind a reducer, under position feedback; the lecture: tau = n eta K_T (K_P lag - K_E n rate)/R_a
                position = variable_near(mechanism, actuator%joint, actuator%variable, target)
                rate = variable_rate(mechanism, actuator%joint, actuator%variable)
                effort = (k(at_ratio)*k(at_efficiency)*k(at_torque_constant)/k(at_resistance)) &
                         *(k(at_gain)*(target - position) - (k(at_voltage_constant)*k(at_ratio))*rate)
            case (effort_pd)
                position = variable_near(mechanism, actuator%joint, actuator%variable, target)
                rate = variable_rate(mechanism, actuator%joint, actuator%variable)
                effort = k(at_stiffness)*(target - position) + k(at_damping)*(target_rate - rate)
            case (effort_constant)
                effort = k(at_force)
            case default
                effort = target
            end select
        end associate
    end function law_effort

    !> Does the drive compare a joint variable with a law of time?
    pure elemental logical function follows_target(drive)
        type(effort_law), intent(in) :: drive

        follows_target = drive%kind == effort_dc_motor .or. drive%kind == effort_pd
    end function follows_target

    !> Does the force depend on the motion of the joint?
    pure elemental logical function compares_motion(drive)
        type(effort_law), intent(in) :: drive

        compares_motion = drive%kind == effort_spring_damper .or. follows_target(drive)
    end function compares_motion

    !> Is the force itself given: by a table, a law over the state or a controller, found by inverse dynamics, or by what a motor
    !> makes of its law?
    pure elemental logical function is_given(drive)
        type(effort_law), intent(in) :: drive

        is_given = any(drive%kind == [effort_table, effort_inverse, effort_over, effort_controlled]) .or. drive%side /= side_joint
    end function is_given
end module linkdyn_effort_laws
