!> The mass matrix of the coordinates: what a unit acceleration of one asks, by virtual work, of each of all.
!>
!> Each link has a 6x6 inertia about its origin: wrench (force, moment) per acceleration of the origin and angular
!> acceleration, world axes. Legs that a link carries add theirs; the link's columns turn the sum into its share.
module linkdyn_mass_matrix
    use linkdyn_carried_legs, only: add_leg_inertia
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state
    use linkdyn_lane_count, only: lanes
    use linkdyn_model, only: model_type, link_type
    use linkdyn_newton_euler, only: inertia_times
    use linkdyn_planar_assembly, only: planar_inertia
    use linkdyn_vec2, only: vec2, operator(.dot.)
    use linkdyn_vec3, only: vec3, mat3, operator(-), operator(*), operator(.cross.), &
        operator(.rotate.)
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
        integer :: i, k

        mass = 0
        if (model%is_planar) then
            call add_planar_links(model, state, mass)
        else
            call add_spatial_links(model, state, mass)
        end if
        do k = 2, model%n_q
            do i = 1, k - 1
                mass(:, k, i) = mass(:, i, k)
            end do
        end do
    end subroutine mass_matrix

    subroutine add_spatial_links(model, state, mass)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        real(wp), intent(inout) :: mass(lanes, model%n_q, model%n_q)
        real(wp), dimension(lanes, 6, 6) :: inertia, of_unit
        integer :: l, i, k

        do l = 1, model%n_link
            if (state%carries_legs .and. model%link(l)%is_carried_leg) cycle
            call own_inertia(model%link(l), state%rotation(model%link(l)%orientation), inertia)
            do i = 1, size(model%payload)
                if (model%payload(i)%link /= l) cycle
                call own_inertia(model%payload(i)%body, state%rotation(model%link(l)%orientation), of_unit)
                do k = 1, 6
                    inertia(:, :, k) = inertia(:, :, k) + spread(state%payload(:, i), 2, 6)*of_unit(:, :, k)
                end do
            end do
            if (state%carries_legs) call add_leg_inertia(model, state, l, inertia)
            if (model%link(l)%pose > 0) then
                call add_pose(model%n_q, model%step(model%link(l)%pose)%coordinate, inertia, mass)
            else
                call add_by_columns(model, state, l, inertia, mass)
            end if
        end do
    end subroutine add_spatial_links

    subroutine add_planar_links(model, state, mass)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        real(wp), intent(inout) :: mass(lanes, model%n_q, model%n_q)
        real(wp), parameter :: origin(2) = 0
        type(vec2) :: force
        real(wp) :: moment(lanes)
        integer :: i, k, l

        do l = 1, model%n_link
            if (model%link(l)%is_massless) cycle
            do k = 1, model%n_q
                if (.not. model%moves(k, l)) cycle
                call planar_inertia(model, l, origin, k, state%plane, state%payload, force, moment)
                do i = 1, k
                    if (.not. model%moves(i, l)) cycle
                    mass(:, i, k) = mass(:, i, k) + (force.dot.state%plane%linear(i, l)) &
                                    + moment*state%plane%angular(:, i, model%link(l)%orientation)
                end do
            end do
        end do
    end subroutine add_planar_links

    !> Upper triangle of a link's inertia: mass, mass times arm of the centre, tensor about the origin.
    pure subroutine own_inertia(link, rotation, inertia)
        type(link_type), intent(in) :: link
        type(mat3), intent(in) :: rotation
        real(wp), intent(out) :: inertia(lanes, 6, 6)
        type(vec3) :: moment, column
        integer :: k

        inertia = 0
        if (link%is_massless) return
        do k = 1, 3
            inertia(:, k, k) = link%mass
        end do
        moment = link%mass*(rotation.rotate.link%cog)
        inertia(:, 1, 5) = moment%z
        inertia(:, 1, 6) = -moment%y
        inertia(:, 2, 4) = -moment%z
        inertia(:, 2, 6) = moment%x
        inertia(:, 3, 4) = moment%y
        inertia(:, 3, 5) = -moment%x
        column = about_origin(vec3(rotation%x%x, rotation%y%x, rotation%z%x))
        inertia(:, 4, 4) = column%x
        column = about_origin(vec3(rotation%x%y, rotation%y%y, rotation%z%y))
        inertia(:, 4, 5) = column%x
        inertia(:, 5, 5) = column%y
        column = about_origin(vec3(rotation%x%z, rotation%y%z, rotation%z%z))
        inertia(:, 4, 6) = column%x
        inertia(:, 5, 6) = column%y
        inertia(:, 6, 6) = column%z

    contains

        !> Tensor about the origin times an axis given in link axes, world axes.
        pure function about_origin(axis) result(h)
            type(vec3), intent(in) :: axis
            type(vec3) :: h

            ! (axis x c) = -(c x axis): the moment of the centre's inertia force is m c x (axis x c).
            h = rotation.rotate.(inertia_times(link, axis) - link%mass*((axis.cross.link%cog).cross.link%cog))
        end function about_origin
    end subroutine own_inertia

    !> A pose moves its link by unit columns.
    pure subroutine add_pose(n_q, coordinate, inertia, mass)
        integer, intent(in) :: n_q
        integer, intent(in) :: coordinate(6)
        real(wp), intent(in) :: inertia(lanes, 6, 6)
        real(wp), intent(inout) :: mass(lanes, n_q, n_q)
        integer :: i, k, first, last

        do k = 1, 6
            do i = 1, k
                first = min(coordinate(i), coordinate(k))
                last = max(coordinate(i), coordinate(k))
                mass(:, first, last) = mass(:, first, last) + inertia(:, i, k)
            end do
        end do
    end subroutine add_pose

    pure subroutine add_by_columns(model, state, link, inertia, mass)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        integer, intent(in) :: link
        real(wp), intent(in) :: inertia(lanes, 6, 6)
        real(wp), intent(inout) :: mass(lanes, model%n_q, model%n_q)
        real(wp), dimension(lanes, 6) :: column, wrench
        integer :: i, k, m, n

        do k = 1, model%n_q
            if (.not. model%moves(k, link)) cycle
            column = column_of(k)
            wrench = 0
            do m = 1, 6
                do n = 1, 6
                    wrench(:, m) = wrench(:, m) + inertia(:, min(m, n), max(m, n))*column(:, n)
                end do
            end do
            do i = 1, k
                if (.not. model%moves(i, link)) cycle
                mass(:, i, k) = mass(:, i, k) + sum(wrench*column_of(i), 2)
            end do
        end do

    contains

        pure function column_of(k) result(column)
            integer, intent(in) :: k
            real(wp) :: column(lanes, 6)

            associate (a => state%acceleration(k, link), alpha => state%alpha(k, model%link(link)%orientation))
                column(:, 1) = a%x
                column(:, 2) = a%y
                column(:, 3) = a%z
                column(:, 4) = alpha%x
                column(:, 5) = alpha%y
                column(:, 6) = alpha%z
            end associate
        end function column_of
    end subroutine add_by_columns
end module linkdyn_mass_matrix
