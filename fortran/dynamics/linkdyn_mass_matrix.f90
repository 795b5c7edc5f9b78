!> The mass matrix of the free coordinates: what a unit acceleration of one asks, by virtual work, of each of all.
module linkdyn_mass_matrix
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state
    use linkdyn_lane_count, only: lanes
    use linkdyn_model, only: model_type
    use linkdyn_newton_euler, only: inertia_column
    use linkdyn_planar_assembly, only: planar_inertia
    use linkdyn_vec2, only: vec2, operator(.dot.)
    use linkdyn_vec3, only: vec3, operator(.dot.)
    implicit none (type, external)
    private
    public :: mass_matrix

contains

    !> mass(:, i, k): generalized inertia force of coordinate i for a unit acceleration of coordinate k. Symmetric.
    !> Needs the acceleration columns.
    subroutine mass_matrix(model, state, mass)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        real(wp), intent(out) :: mass(lanes, model%n_q, model%n_q)
        real(wp), parameter :: origin(3) = 0
        type(vec3) :: force, moment
        type(vec2) :: plane_force
        real(wp) :: plane_moment(lanes)
        integer :: i, k, l, o

        mass = 0
        do l = 1, model%n_link
            if (model%link(l)%is_massless) cycle
            o = model%link(l)%orientation
            do k = 1, model%n_q
                if (.not. model%moves(k, l)) cycle
                if (model%is_planar) then
                    call planar_inertia(model, l, origin(:2), k, state%plane, plane_force, plane_moment)
                else
                    call inertia_column(model%link(l), origin, state%acceleration_body(k, l), state%alpha_body(k, o), force, moment)
                end if
                do i = 1, k
                    if (.not. model%moves(i, l)) cycle
                    if (model%is_planar) then
                        mass(:, i, k) = mass(:, i, k) + (plane_force.dot.state%plane%linear(i, l)) &
                                        + plane_moment*state%plane%angular(:, i, o)
                    else
                        mass(:, i, k) = mass(:, i, k) + (force.dot.state%acceleration_body(i, l)) &
                                        + (moment.dot.state%alpha_body(i, o))
                    end if
                end do
            end do
        end do
        do k = 2, model%n_q
            do i = 1, k - 1
                mass(:, k, i) = mass(:, i, k)
            end do
        end do
    end subroutine mass_matrix
end module linkdyn_mass_matrix
