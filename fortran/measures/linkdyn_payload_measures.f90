!> Payloads on lanes: their masses at instants, and their energy.
module linkdyn_payload_measures
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state
    use linkdyn_lane_count, only: lanes
    use linkdyn_link_inertia, only: inertia_times
    use linkdyn_model, only: model_type
    use linkdyn_payloads, only: evaluate_payloads
    use linkdyn_planar_motion, only: level_velocity
    use linkdyn_planar_point, only: carried
    use linkdyn_vec2, only: vec2, operator(+), operator(.dot.), operator(.rotate.), vec2_of
    use linkdyn_vec3, only: vec3, operator(+), operator(.dot.), operator(.cross.), operator(.rotate.), operator(.unrotate.)
    implicit none (type, external)
    private
    public :: find_payloads, add_payload_energy

contains

    !> Masses at the instants of the lanes.
    subroutine find_payloads(model, state)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(inout) :: state
        real(wp) :: now(size(model%payload), 1)
        integer :: lane

        if (size(model%payload) == 0) return
        do lane = 1, lanes
            if (lane == 1) then
                call evaluate_payloads(model, state%time(1:1), now)
            else if (state%time(lane) /= state%time(lane - 1)) then
                call evaluate_payloads(model, state%time(lane:lane), now)
            end if
            state%payload(lane, :) = now(:, 1)
        end do
    end subroutine find_payloads

    !> Add kinetic energy and that of gravity.
    subroutine add_payload_energy(model, state, kinetic, potential)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        real(wp), intent(inout) :: kinetic(lanes), potential(lanes)
        type(vec3) :: velocity
        type(vec2) :: flat_velocity, arm
        integer :: i, o

        do i = 1, size(model%payload)
            associate (l => model%payload(i)%link, body => model%payload(i)%body, mass => state%payload(:, i))
                o = model%link(l)%orientation
                if (model%is_planar) then
                    arm = state%plane%rotation(o).rotate.body%cog(:2)
                    flat_velocity = carried(state%plane, level_velocity, l, o, arm)
                    kinetic = kinetic + mass*((flat_velocity.dot.flat_velocity) &
                                              + body%inertia(3, 3)*state%plane%angular(:, level_velocity, o)**2)/2
                    potential = potential - mass*((state%plane%position(l) + arm).dot.vec2_of(model%gravity(:2)))
                else
                    velocity = (state%rotation(o).unrotate.state%velocity(l)) + (state%omega_body(o).cross.body%cog)
                    kinetic = kinetic + mass*((velocity.dot.velocity) &
                                              + (state%omega_body(o).dot.inertia_times(body, state%omega_body(o))))/2
                    potential = potential - mass*((state%position(l) + (state%rotation(o).rotate.body%cog)).dot.model%gravity)
                end if
            end associate
        end do
    end subroutine add_payload_energy
end module linkdyn_payload_measures
