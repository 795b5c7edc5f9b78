!> How each result is computed from a traced scene.
module linkdyn_catalogue
    use linkdyn_acting, only: sums_at_joints
    use linkdyn_belts, only: strand_forces
    use linkdyn_cam_quantities, only: contact_forces, pressure_angles
    use linkdyn_force_system, only: reaction_of
    use linkdyn_friction_quantities, only: friction_wrenches, friction_powers
    use linkdyn_joint_variables, only: one_variable, variable_rate
    use linkdyn_margins, only: assembly_margins
    use linkdyn_motion_quantities, only: all_joint_variables, all_joint_rates, transmission_angles, kinetic_energy, &
        potential_energy, largest_gap, scene_position, scene_rotation, scene_velocity, scene_angular_velocity
    use linkdyn_power_balance, only: power_imbalance
    use linkdyn_result_kinds, only: result_qdd, result_driving_force, result_driving_speed, result_reaction, &
        result_joint_variable, result_joint_rate, result_power_imbalance, result_kinetic_energy, result_potential_energy, &
        result_closure, result_transmission_angle, result_position, result_rotation, result_margin, result_margin_rate, &
        result_velocity, result_angular_velocity, result_driving_position, result_joint_push, result_friction, &
        result_friction_power, result_transmission_force, result_contact_force, result_pressure_angle, result_strand_force
    use linkdyn_system, only: solved
    use linkdyn_trace, only: traced_type, pushes_of
    use linkdyn_value, only: value, operator(+)
    implicit none (type, external)
    private
    public :: quantity_values, needs_equations

contains

    !> Does a result need forces, or accelerations that are not given?
    elemental logical function needs_equations(id)
        integer, intent(in) :: id                       !! one of `result_*`

        needs_equations = any(id == [result_qdd, result_driving_force, result_reaction, result_power_imbalance, &
                                     result_friction, result_friction_power, result_transmission_force, result_contact_force, &
                                     result_joint_push])
    end function needs_equations

    !> The values of one result, as samples store them; none for what no kernel computes.
    function quantity_values(traced, id) result(v)
        type(traced_type), intent(inout) :: traced
        integer, intent(in) :: id                       !! one of `result_*`
        type(value), allocatable :: v(:)
        type(value) :: r(6)
        type(value), allocatable :: drift(:)
        integer :: i

        allocate (v(0))
        associate (mechanism => traced%mechanism, model => traced%mechanism%model)
            select case (id)
            case (result_qdd)
                v = solved(traced%system, traced%acceleration)
            case (result_driving_force)
                v = solved(traced%system, traced%unknowns%effort)
            case (result_transmission_force)
                v = solved(traced%system, traced%unknowns%transmitted(model%motor%actuator))
            case (result_reaction)
                do i = 1, model%n_joint
                    r = reaction_of(mechanism, traced%unknowns, traced%system, i)
                    if (allocated(traced%shared)) r = r + traced%shared(:, i)
                    if (model%is_planar) then
                        v = [v, r([1, 2, 6])]
                    else
                        v = [v, r]
                    end if
                end do
            case (result_joint_push)
                v = solved(traced%system, sums_at_joints(mechanism, pushes_of(traced)))
            case (result_driving_position)
                do i = 1, model%n_actuator
                    v = [v, one_variable(mechanism, model%scene%actuator(i)%joint, model%scene%actuator(i)%variable)]
                end do
            case (result_driving_speed)
                do i = 1, model%n_actuator
                    v = [v, variable_rate(mechanism, model%scene%actuator(i)%joint, model%scene%actuator(i)%variable)]
                end do
            case (result_joint_variable)
                v = all_joint_variables(mechanism)
            case (result_joint_rate)
                v = all_joint_rates(mechanism)
            case (result_transmission_angle)
                v = transmission_angles(mechanism)
            case (result_power_imbalance)
                v = [power_imbalance(traced)]
            case (result_friction)
                v = friction_wrenches(traced)
            case (result_friction_power)
                v = friction_powers(traced)
            case (result_contact_force)
                v = contact_forces(traced)
            case (result_pressure_angle)
                v = pressure_angles(mechanism)
            case (result_strand_force)
                do i = 1, size(model%belt)
                    v = [v, strand_forces(mechanism, i)]
                end do
            case (result_kinetic_energy)
                v = [kinetic_energy(mechanism)]
            case (result_potential_energy)
                v = [potential_energy(mechanism)]
            case (result_closure)
                v = [largest_gap(mechanism)]
            case (result_position)
                do i = 1, model%n_link
                    v = [v, scene_position(mechanism, i)]
                end do
            case (result_rotation)
                do i = 1, model%n_link
                    v = [v, scene_rotation(mechanism, i)]
                end do
            case (result_velocity)
                do i = 1, model%n_link
                    v = [v, scene_velocity(mechanism, i)]
                end do
            case (result_angular_velocity)
                do i = 1, model%n_link
                    v = [v, scene_angular_velocity(mechanism, i)]
                end do
            case (result_margin, result_margin_rate)
                deallocate (v)
                allocate (v(model%n_branch), drift(model%n_branch))
                call assembly_margins(mechanism, v, drift)
                if (id == result_margin_rate) v = drift
            end select
        end associate
    end function quantity_values
end module linkdyn_catalogue
