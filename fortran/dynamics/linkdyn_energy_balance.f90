!> The law that any motion keeps, whatever computes it: kinetic energy and that of gravity change by what all other forces
!> supply.
module linkdyn_energy_balance
    use linkdyn_applied_wrenches, only: spring_energy
    use linkdyn_assembly, only: subtract_applied
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state
    use linkdyn_lane_count, only: lanes
    use linkdyn_model, only: model_type
    use linkdyn_motion_measures, only: measure_energy
    use linkdyn_planar_assembly, only: subtract_planar_applied
    use linkdyn_planar_motion, only: level_velocity
    use linkdyn_rotors, only: applied_rotor_power
    use linkdyn_vec2, only: vec2, zero_vec2, operator(.dot.)
    use linkdyn_vec3, only: vec3, zero_vec3, operator(.dot.), operator(.unrotate.)
    implicit none (type, external)
    private
    public :: energy_of_motion, applied_power

contains

    !> Kinetic energy, and that of gravity; not that of payloads, whose mass may change.
    subroutine energy_of_motion(model, state, energy, kinetic)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state     !! positions and velocities
        real(wp), intent(out) :: energy(lanes)         !! [J]
        real(wp), intent(out), optional :: kinetic(lanes)    !! part of it [J]
        real(wp), dimension(lanes) :: of_motion, potential, of_springs

        call measure_energy(model, state, of_motion, potential)
        call spring_energy(model, state, of_springs)
        energy = of_motion + (potential - of_springs)
        if (present(kinetic)) kinetic = of_motion
    end subroutine energy_of_motion

    !> Power of loads, springs and given driving forces.
    subroutine applied_power(model, state, load, power)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state     !! springs and given driving forces have been applied
        real(wp), intent(in) :: load(:, :, :)          !! (lane, 6, n_load)
        real(wp), intent(out) :: power(lanes)          !! [W]
        type(vec3) :: force, moment
        type(vec2) :: flat_force
        real(wp) :: flat_moment(lanes), of_rotors(lanes)
        real(wp), parameter :: origin(3) = 0
        integer :: l, o

        power = 0
        if (.not. state%has_applied .and. model%n_load == 0) return
        do l = 1, model%n_link
            o = model%link(l)%orientation
            if (model%is_planar) then
                flat_force = zero_vec2()
                flat_moment = 0
                call subtract_planar_applied(model, l, origin(:2), state, load, flat_force, flat_moment)
                power = power - (flat_force.dot.state%plane%linear(level_velocity, l)) &
                        - flat_moment*state%plane%angular(:, level_velocity, o)
            else
                force = zero_vec3()
                moment = zero_vec3()
                call subtract_applied(model, l, origin, state, load, force, moment)
                power = power - (force.dot.(state%rotation(o).unrotate.state%velocity(l))) - (moment.dot.state%omega_body(o))
            end if
        end do
        call applied_rotor_power(model, state, of_rotors)
        power = power - of_rotors                      ! whose energy is part of that of the motion
    end subroutine applied_power
end module linkdyn_energy_balance
