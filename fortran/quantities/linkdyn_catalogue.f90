!> The results that there are, and how each is computed from a traced scene.
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
    use linkdyn_system, only: solved
    use linkdyn_trace, only: traced_type, pushes_of
    use linkdyn_value, only: value, operator(+)
    implicit none (type, external)
    private
    public :: quantity_values, needs_equations, n_results
    public :: result_q, result_qd, result_qdd, result_driving_force, result_driving_speed, result_driving_power
    public :: result_reaction, result_joint_variable, result_joint_rate, result_status, result_rcond
    public :: result_error, result_growth, result_power_imbalance, result_time
    public :: result_driving_force_error, result_reaction_error
    public :: result_kinetic_energy, result_potential_energy, result_work, result_closure, result_step
    public :: result_transmission_angle, result_stand_in, result_singularity_distance, result_assembly
    public :: result_q_error, result_qd_error, result_qdd_error, result_joint_rate_error
    public :: result_position, result_rotation, result_margin, result_margin_rate
    public :: result_joint_push
    public :: result_velocity, result_angular_velocity, result_driving_position
    public :: result_friction, result_friction_power
    public :: result_contact_force, result_pressure_angle, result_strand_force
    public :: result_transmission_force, result_motor_torque, result_motor_speed, result_motor_power, result_motor_current
    public :: result_transmission_loss, result_torque_margin, result_brake_torque
    public :: result_controller_target, result_controller_error, result_controller_output, result_controller_limited
    public :: result_clutch_force, result_clutch_slip, result_clutch_state
    public :: result_cylinder_pressure, result_cylinder_flow

    integer, parameter :: result_time = 1
    integer, parameter :: result_q = 2
    integer, parameter :: result_qd = 3
    integer, parameter :: result_qdd = 4
    integer, parameter :: result_driving_force = 5
    integer, parameter :: result_driving_speed = 6
    integer, parameter :: result_driving_power = 7
    integer, parameter :: result_reaction = 8
    integer, parameter :: result_joint_variable = 9
    integer, parameter :: result_joint_rate = 10
    integer, parameter :: result_status = 11
    integer, parameter :: result_rcond = 12
    integer, parameter :: result_error = 13
    integer, parameter :: result_growth = 14
    integer, parameter :: result_power_imbalance = 15
    integer, parameter :: result_kinetic_energy = 16        ! of forward dynamics, as the rest
    integer, parameter :: result_potential_energy = 17
    integer, parameter :: result_work = 18
    integer, parameter :: result_closure = 19
    integer, parameter :: result_step = 20
    integer, parameter :: result_driving_force_error = 21   ! on demand
    integer, parameter :: result_reaction_error = 22
    integer, parameter :: result_transmission_angle = 23    ! of planar dyads
    integer, parameter :: result_stand_in = 24              ! of a forward run
    integer, parameter :: result_q_error = 25               ! of forward dynamics, on demand
    integer, parameter :: result_qd_error = 26
    integer, parameter :: result_qdd_error = 27
    integer, parameter :: result_joint_rate_error = 28
    integer, parameter :: result_singularity_distance = 29  ! of inverse dynamics, on demand
    integer, parameter :: result_assembly = 30              ! along a motion, where a mechanism has several
    ! ---- of the record alone
    integer, parameter :: result_position = 31
    integer, parameter :: result_rotation = 32
    integer, parameter :: result_margin = 33                ! of groups in closed form: from where assemblies meet
    integer, parameter :: result_margin_rate = 34
    integer, parameter :: result_velocity = 35              ! of links' origins
    integer, parameter :: result_angular_velocity = 36
    integer, parameter :: result_driving_position = 37      ! driven joint variables; coordinates count turns
    integer, parameter :: result_joint_push = 58            ! what acts at joints beside reactions
    ! ---- of scenes with friction
    integer, parameter :: result_friction = 38
    integer, parameter :: result_friction_power = 39
    ! ---- of drives with a motor
    integer, parameter :: result_transmission_force = 40    ! what gets to the links
    integer, parameter :: result_motor_torque = 41          ! these follow from it and from the driving force (`linkdyn_motor_loads`)
    integer, parameter :: result_motor_speed = 42
    integer, parameter :: result_motor_power = 43
    integer, parameter :: result_motor_current = 44
    integer, parameter :: result_transmission_loss = 45
    integer, parameter :: result_torque_margin = 46
    integer, parameter :: result_brake_torque = 47
    ! ---- of cams
    integer, parameter :: result_contact_force = 48         ! with which follower and curve press
    integer, parameter :: result_pressure_angle = 49
    ! ---- of belts that stretch
    integer, parameter :: result_strand_force = 57
    ! ---- of controllers, in forward dynamics
    integer, parameter :: result_controller_target = 50
    integer, parameter :: result_controller_error = 51
    integer, parameter :: result_controller_output = 52
    integer, parameter :: result_controller_limited = 53
    ! ---- of clutches, in forward dynamics
    integer, parameter :: result_clutch_force = 54
    integer, parameter :: result_clutch_slip = 55
    integer, parameter :: result_clutch_state = 56
    ! ---- of cylinders, in forward dynamics
    integer, parameter :: result_cylinder_pressure = 59
    integer, parameter :: result_cylinder_flow = 60
    integer, parameter :: n_results = 60                    !! the largest of these numbers

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
