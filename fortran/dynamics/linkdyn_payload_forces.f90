!> Payloads on lanes: their masses at the lanes' instants, and what their motion asks for, beside that of the links that carry them.
module linkdyn_payload_forces
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state
    use linkdyn_lane_count, only: lanes
    use linkdyn_model, only: model_type
    use linkdyn_newton_euler, only: inertia_wrench, inertia_column, inertia_times
    use linkdyn_payloads, only: evaluate_payloads
    use linkdyn_planar_motion, only: level_velocity, level_given
    use linkdyn_planar_point, only: carried
    use linkdyn_vec2, only: vec2, operator(+), operator(-), operator(*), operator(.dot.), operator(.rotate.), vec2_of
    use linkdyn_vec3, only: vec3, operator(+), operator(-), operator(*), operator(.cross.), operator(.dot.), &
        operator(.rotate.), operator(.unrotate.)
    implicit none (type, external)
    private
    public :: find_payloads, add_payload_wrench, add_payload_column, add_payload_energy, add_payload_power

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

    !> Add to the wrench of a link about `point`, link axes, what its payloads' motion asks for, less gravity.
    pure subroutine add_payload_wrench(model, l, point, state, force, moment)
        type(model_type), intent(in) :: model
        integer, intent(in) :: l
        real(wp), intent(in) :: point(3)
        type(kinematic_state), intent(in) :: state
        type(vec3), intent(inout) :: force, moment
        type(vec3) :: f, m
        integer :: i, o

        o = model%link(l)%orientation
        do i = 1, size(model%payload)
            if (model%payload(i)%link /= l) cycle
            call inertia_wrench(model%payload(i)%body, point, state%acceleration_body(0, l) - state%gravity_body(o), &
                                state%omega_body(o), state%alpha_body(0, o), f, m)
            force = force + state%payload(:, i)*f
            moment = moment + state%payload(:, i)*m
        end do
    end subroutine add_payload_wrench

    !> The same of a unit acceleration of coordinate k.
    pure subroutine add_payload_column(model, l, k, point, state, force, moment)
        type(model_type), intent(in) :: model
        integer, intent(in) :: l, k
        real(wp), intent(in) :: point(3)
        type(kinematic_state), intent(in) :: state
        type(vec3), intent(inout) :: force, moment
        type(vec3) :: f, m
        integer :: i

        do i = 1, size(model%payload)
            if (model%payload(i)%link /= l) cycle
            call inertia_column(model%payload(i)%body, point, state%acceleration_body(k, l), &
                                state%alpha_body(k, model%link(l)%orientation), f, m)
            force = force + state%payload(:, i)*f
            moment = moment + state%payload(:, i)*m
        end do
    end subroutine add_payload_column

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

    !> Add the power of payloads' inertia and weight: they change the energy of the links as loads do.
    subroutine add_payload_power(model, state, ahead, power)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state     !! with columns
        real(wp), intent(in) :: ahead(:, :)            !! accelerations found, less those given (lane, n_q)
        real(wp), intent(inout) :: power(lanes)        !! [W]
        type(vec3) :: force, moment, f, m
        type(vec2) :: flat_velocity, flat, arm
        real(wp) :: turning(lanes)
        real(wp), parameter :: origin(3) = 0
        integer :: i, k, o

        do i = 1, size(model%payload)
            associate (l => model%payload(i)%link, body => model%payload(i)%body, mass => state%payload(:, i))
                o = model%link(l)%orientation
                if (model%is_planar) then
                    arm = state%plane%rotation(o).rotate.body%cog(:2)
                    flat = carried(state%plane, level_given, l, o, arm) - vec2_of(model%gravity(:2))
                    turning = state%plane%angular(:, level_given, o)
                    do k = 1, size(ahead, 2)
                        if (.not. model%moves(k, l)) cycle
                        flat = flat + ahead(:, k)*carried(state%plane, k, l, o, arm)
                        turning = turning + ahead(:, k)*state%plane%angular(:, k, o)
                    end do
                    flat_velocity = carried(state%plane, level_velocity, l, o, arm)
                    power = power - mass*((flat.dot.flat_velocity) &
                                          + body%inertia(3, 3)*turning*state%plane%angular(:, level_velocity, o))
                else
                    call inertia_wrench(body, origin, state%acceleration_body(0, l) - state%gravity_body(o), &
                                        state%omega_body(o), state%alpha_body(0, o), force, moment)
                    do k = 1, size(ahead, 2)
                        if (.not. model%moves(k, l)) cycle
                        call inertia_column(body, origin, state%acceleration_body(k, l), state%alpha_body(k, o), f, m)
                        force = force + ahead(:, k)*f
                        moment = moment + ahead(:, k)*m
                    end do
                    power = power - mass*((force.dot.(state%rotation(o).unrotate.state%velocity(l))) &
                                          + (moment.dot.state%omega_body(o)))
                end if
            end associate
        end do
    end subroutine add_payload_power
end module linkdyn_payload_forces
