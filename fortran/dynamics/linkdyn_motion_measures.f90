!> Figures of a motion: energies, how well the loops are closed.
module linkdyn_motion_measures
    use linkdyn_applied_wrenches, only: spring_energy
    use linkdyn_joint_rates, only: joint_view, view_joint
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state
    use linkdyn_lane_count, only: lanes
    use linkdyn_model, only: model_type
    use linkdyn_newton_euler, only: inertia_times
    use linkdyn_point, only: point_velocity
    use linkdyn_scene, only: joint_revolute, joint_prismatic, joint_cylindrical, joint_universal
    use linkdyn_vec3, only: vec3, operator(+), operator(-), operator(*), operator(.dot.), operator(.cross.), &
        operator(.rotate.), operator(.unrotate.)
    implicit none (type, external)
    private
    public :: measure_energy, measure_closure, add_columns

contains

    !> Kinetic energy, and potential energy of gravity (zero at the world's origin) and springs.
    subroutine measure_energy(model, state, kinetic, potential)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        real(wp), intent(out) :: kinetic(lanes), potential(lanes)    !! [J]
        type(vec3) :: velocity, arm
        integer :: l, o

        kinetic = 0
        call spring_energy(model, state, potential)
        do l = 1, model%n_link
            associate (link => model%link(l))
                o = link%orientation
                velocity = (state%rotation(o).unrotate.state%velocity(l)) + (state%omega_body(o).cross.link%cog)
                kinetic = kinetic + (link%mass*(velocity.dot.velocity) &
                                     + (state%omega_body(o).dot.inertia_times(link, state%omega_body(o))))/2
                arm = state%position(l) + (state%rotation(o).rotate.link%cog)
                potential = potential - link%mass*(arm.dot.model%gravity)
            end associate
        end do
    end subroutine measure_energy

    !> The largest distance or angle by which the two sides of a joint miss each other.
    subroutine measure_closure(model, state, gap)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        real(wp), intent(out) :: gap(lanes)    !! [m, rad]
        type(joint_view) :: view
        type(vec3) :: apart
        integer :: j

        gap = 0
        do j = 1, model%n_joint
            call view_joint(model, state, j, state%velocity, state%omega, view)
            apart = view%slide
            associate (kind => model%joint(j)%kind, first => view%frame(1), second => view%frame(2))
                if (kind == joint_prismatic .or. kind == joint_cylindrical) &
                    apart = apart - (apart.dot.first%z)*first%z
                gap = max(gap, sqrt(apart.dot.apart))
                select case (kind)
                case (joint_revolute, joint_cylindrical)
                    gap = max(gap, length_of(first%z.cross.second%z))
                case (joint_prismatic)
                    gap = max(gap, length_of(first%z.cross.second%z), length_of(first%x.cross.second%x))
                case (joint_universal)
                    gap = max(gap, abs(first%z.dot.second%z))
                end select
            end associate
        end do
    end subroutine measure_closure

    pure function length_of(v) result(length)
        type(vec3), intent(in) :: v
        real(wp) :: length(lanes)

        length = sqrt(v.dot.v)
    end function length_of

    !> Put accelerations found for the coordinates into column 0.
    subroutine add_columns(model, acceleration, state)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: acceleration(lanes, model%n_q)
        type(kinematic_state), intent(inout) :: state
        integer :: k, l, o

        do k = 1, model%n_q
            do o = 1, model%n_orientation
                state%alpha_body(0, o) = state%alpha_body(0, o) + acceleration(:, k)*state%alpha_body(k, o)
            end do
            do l = 1, model%n_link
                state%acceleration_body(0, l) = state%acceleration_body(0, l) + acceleration(:, k)*state%acceleration_body(k, l)
            end do
        end do
    end subroutine add_columns
end module linkdyn_motion_measures
