!> Forces of the frame's motion on the links, as one who stands on the frame feels them: gravity that seems to turn and to change,
!> centrifugal and Coriolis forces. They act on the links as loads do.
!>
!> With the frame's angular velocity w and acceleration e, gravity g' = g + dg as it seems, and of a link its mass m, the place r
!> and the velocity v of its centre of mass, its inertia J there and its angular velocity u, all as seen from the frame,
!>
!>     force  = m (dg - e x r - w x (w x r) - 2 w x v)
!>     moment = -J (e + w x u) - w x J (w + u) - u x J w
!>
!> so that relative motion keeps the equations that it has on a frame at rest.
module linkdyn_base_forces
    use linkdyn_applied_wrenches, only: apply_force, apply_moment
    use linkdyn_base_motion, only: n_base, evaluate_base
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state
    use linkdyn_lane_count, only: lanes
    use linkdyn_marker_motion, only: in_space
    use linkdyn_model, only: model_type, link_type
    use linkdyn_newton_euler, only: inertia_times
    use linkdyn_planar_motion, only: level_velocity
    use linkdyn_planar_point, only: carried
    use linkdyn_vec2, only: vec2, operator(+), operator(.rotate.)
    use linkdyn_vec3, only: vec3, operator(+), operator(-), operator(*), operator(.cross.), operator(.rotate.), &
        operator(.unrotate.), zero_vec3
    implicit none (type, external)
    private
    public :: apply_base

contains

    !> Forces of the frame's motion at the instants of the lanes.
    subroutine apply_base(model, state)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(inout) :: state
        type(vec3) :: gravity, omega, alpha
        real(wp) :: one(lanes)
        integer :: l

        if (.not. model%scene%base%moves) return
        call find_base(model, state, gravity, omega, alpha)
        one = 1
        do l = 1, model%n_link
            if (.not. model%link(l)%is_massless) call push(model%link(l), l, one)
        end do
        do l = 1, size(model%payload)
            call push(model%payload(l)%body, model%payload(l)%link, state%payload(:, l))
        end do

    contains

        subroutine push(body, link, share)
            type(link_type), intent(in) :: body
            integer, intent(in) :: link                !! that it moves with
            real(wp), intent(in) :: share(lanes)       !! of the body's mass that is there

            if (model%is_planar) then
                call push_in_plane(model, body, link, share, gravity, omega%z, alpha%z, state)
            else
                call push_in_space(model, body, link, share, gravity, omega, alpha, state)
            end if
        end subroutine push
    end subroutine apply_base

    subroutine find_base(model, state, gravity, omega, alpha)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        type(vec3), intent(out) :: gravity, omega, alpha
        real(wp) :: now(n_base, 1), base(lanes, n_base)
        integer :: lane

        do lane = 1, lanes
            if (lane == 1) then
                call evaluate_base(model, state%time(1:1), now)
            else if (state%time(lane) /= state%time(lane - 1)) then
                call evaluate_base(model, state%time(lane:lane), now)
            end if
            base(lane, :) = now(:, 1)
        end do
        gravity = vec3(base(:, 1), base(:, 2), base(:, 3))
        omega = vec3(base(:, 4), base(:, 5), base(:, 6))
        alpha = vec3(base(:, 7), base(:, 8), base(:, 9))
    end subroutine find_base

    subroutine push_in_space(model, body, l, share, gravity, omega, alpha, state)
        type(model_type), intent(in) :: model
        type(link_type), intent(in) :: body
        integer, intent(in) :: l
        real(wp), intent(in) :: share(lanes)
        type(vec3), intent(in) :: gravity, omega, alpha    !! of the frame, world axes
        type(kinematic_state), intent(inout) :: state
        type(vec3) :: r, v, w, e, u, momentum
        integer :: o

        o = model%link(l)%orientation
        associate (turn => state%rotation(o))
            r = state%position(l) + (turn.rotate.body%cog)
            v = state%velocity(l) + (turn.rotate.(state%omega_body(o).cross.body%cog))
            call apply_force(model, l, r, (share*body%mass)*(gravity - (alpha.cross.r) - (omega.cross.(omega.cross.r)) &
                                                     - 2.0_wp*(omega.cross.v)), state)
            ! the moment in link axes
            u = state%omega_body(o)
            w = turn.unrotate.omega
            e = turn.unrotate.alpha
            momentum = inertia_times(body, w)
            u = inertia_times(body, e + (w.cross.u)) + (w.cross.(momentum + inertia_times(body, u))) + (u.cross.momentum)
            call apply_moment(model, l, turn.rotate.((-share)*u), state)
        end associate
    end subroutine push_in_space

    subroutine push_in_plane(model, body, l, share, gravity, omega, alpha, state)
        type(model_type), intent(in) :: model
        type(link_type), intent(in) :: body
        integer, intent(in) :: l
        real(wp), intent(in) :: share(lanes)
        type(vec3), intent(in) :: gravity
        real(wp), intent(in) :: omega(lanes), alpha(lanes)
        type(kinematic_state), intent(inout) :: state
        type(vec3) :: moment, force
        type(vec2) :: arm, r, v
        integer :: o

        o = model%link(l)%orientation
        associate (plane => state%plane)
            arm = plane%rotation(o).rotate.body%cog(:2)
            r = plane%position(l) + arm
            v = carried(plane, level_velocity, l, o, arm)
            force = zero_vec3()
            force%x = (share*body%mass)*(gravity%x + alpha*r%y + omega**2*r%x + 2*omega*v%y)
            force%y = (share*body%mass)*(gravity%y - alpha*r%x + omega**2*r%y - 2*omega*v%x)
            moment = zero_vec3()
            moment%z = -(share*body%inertia(3, 3))*alpha
            call apply_force(model, l, in_space(r), force, state)
            call apply_moment(model, l, moment, state)
        end associate
    end subroutine push_in_plane
end module linkdyn_base_forces
