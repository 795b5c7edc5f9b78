!> The law that any motion keeps, whatever computes it: kinetic energy and that of gravity change by what all other forces
!> supply.
module linkdyn_energy_balance
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state
    use linkdyn_lane_count, only: lanes
    use linkdyn_model, only: model_type
    use linkdyn_motion_measures, only: measure_energy, spring_energy
    implicit none (type, external)
    private
    public :: energy_of_motion

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
end module linkdyn_energy_balance
