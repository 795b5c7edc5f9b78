!> The smallest transmission angle of each planar dyad along the scene's motion.
module linkdyn_transmission
    use linkdyn_assembly_trail, only: assembly_trail, sample_assembly, follow_assembly, place_sample
    use linkdyn_dyad_map, only: transmission_angle
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state, prepare_kinematics
    use linkdyn_lane_count, only: lanes
    use linkdyn_led_mechanism, only: evaluate_kinematics
    use linkdyn_model, only: model_type
    use linkdyn_motion, only: evaluate_motion
    implicit none (type, external)
    private
    public :: smallest_transmission

    integer, parameter :: n_instant = 721     !! half a degree of a crank's turn

contains

    !> Instants at which the mechanism cannot be assembled do not count; a dyad that never can keeps a huge angle.
    subroutine smallest_transmission(model, angle, time)
        type(model_type), intent(in) :: model
        real(wp), intent(out) :: angle(model%n_dyad)    !! [rad]
        real(wp), intent(out) :: time(model%n_dyad)     !! when [s]
        type(kinematic_state) :: state
        type(assembly_trail) :: trail
        type(sample_assembly) :: assembly
        real(wp), dimension(model%n_q, n_instant) :: q, qd, qdd
        real(wp) :: load(6, model%n_load, n_instant), t(n_instant), angles(lanes)
        integer :: first, lane, sample, d

        angle = huge(1.0_wp)
        time = 0
        associate (range => model%scene%time)
            t = [(range%first + (range%last - range%first)*(real(sample - 1, wp)/(n_instant - 1)), sample=1, n_instant)]
        end associate
        call evaluate_motion(model, t, q, qd, qdd, load)
        call follow_assembly(model, q, trail, assembly)
        call prepare_kinematics(model, 0, state)
        state%qd = 0
        state%qdd = 0
        do first = 1, n_instant, lanes
            do lane = 1, lanes
                sample = min(first + lane - 1, n_instant)
                state%q(lane, :) = q(:, sample)
                call place_sample(model, assembly, sample, lane, state)
            end do
            call evaluate_kinematics(model, state)
            do d = 1, model%n_dyad
                angles = transmission_angle(state%plane%dyad(d))
                do lane = 1, min(lanes, n_instant - first + 1)
                    if (state%unreachable(lane) .or. state%not_converged(lane) .or. state%branch_lost(lane) &
                        .or. angles(lane) >= angle(d)) cycle
                    angle(d) = angles(lane)
                    time(d) = t(first + lane - 1)
                end do
            end do
        end do
    end subroutine smallest_transmission
end module linkdyn_transmission
