!> Results of the motion alone: energies, power balance, gaps, poses, transmission angles.
module linkdyn_motion_quantities
    use linkdyn_bodies, only: own_axes, world_axes, omega_of, point_position, point_velocity, rotation_of
    use linkdyn_inertia_wrench, only: mass_properties
    use linkdyn_joint_variables, only: within_half_a_turn, joint_rates
    use linkdyn_kinds, only: wp
    use linkdyn_mechanism, only: mechanism_type, properties_of, payload_properties, pair_of, gravity_of
    use linkdyn_rotor_forces, only: rotor_energy
    use linkdyn_belts, only: belt_energy
    use linkdyn_springs, only: spring_energy
    use linkdyn_value, only: value, zero, abs, max, atan2, operator(+), operator(-), operator(*)
    use linkdyn_vector, only: vector, rotation, components, operator(*), operator(.dot.), operator(.cross.)
    implicit none (type, external)
    private
    public :: all_joint_variables, all_joint_rates, transmission_angles, largest_gap
    public :: kinetic_energy, link_energy, potential_energy, gravity_energy
    public :: scene_position, scene_rotation, scene_velocity, scene_angular_velocity

contains

    !> Angles in (-pi, pi]: who knows what came before counts their turns.
    function all_joint_variables(mechanism) result(q)
        type(mechanism_type), intent(in) :: mechanism
        type(value), allocatable :: q(:)
        integer :: j

        allocate (q(0))
        do j = 1, mechanism%model%n_joint
            q = [q, within_half_a_turn(mechanism, j)]
        end do
    end function all_joint_variables

    function all_joint_rates(mechanism) result(qd)
        type(mechanism_type), intent(in) :: mechanism
        type(value), allocatable :: qd(:)
        integer :: j

        allocate (qd(0))
        do j = 1, mechanism%model%n_joint
            qd = [qd, joint_rates(mechanism, j)]
        end do
    end function all_joint_rates

    !> Transmission angles of the planar dyads: between the two ways in which the inner joint moves, with the one link and with the
    !> other. 0 at a dead point, a right angle at best.
    function transmission_angles(mechanism) result(angle)
        type(mechanism_type), intent(in) :: mechanism
        type(value) :: angle(mechanism%model%n_dyad)
        type(vector) :: normal
        integer :: i

        do i = 1, mechanism%model%n_dyad
            associate (way => mechanism%ways(:, i))
                normal = way(1) .cross.way(2)
                angle(i) = atan2(abs(normal%z), abs(way(1) .dot.way(2)))
            end associate
        end do
    end function transmission_angles

    !> Kinetic energy of all links, payloads and rotors [J].
    function kinetic_energy(mechanism) result(energy)
        type(mechanism_type), intent(in) :: mechanism
        type(value) :: energy
        integer :: l

        energy = link_energy(mechanism)
        do l = 1, size(mechanism%model%payload)
            energy = energy + energy_of(mechanism, mechanism%model%payload(l)%link, payload_properties(mechanism, l))
        end do
    end function kinetic_energy

    !> Kinetic energy of links and rotors alone: nothing changes their masses [J].
    function link_energy(mechanism) result(energy)
        type(mechanism_type), intent(in) :: mechanism
        type(value) :: energy
        integer :: l

        energy = zero()
        do l = 1, mechanism%model%n_link
            energy = energy + energy_of(mechanism, l, properties_of(mechanism, l))
        end do
        do l = 1, size(mechanism%model%motor)
            if (mechanism%model%motor(l)%inertia > 0) energy = energy + rotor_energy(mechanism, l)
        end do
    end function link_energy

    !> Kinetic energy of a body in a link [J].
    function energy_of(mechanism, link, p) result(energy)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: link
        type(mass_properties), intent(in) :: p
        type(value) :: energy
        type(vector) :: v, w
        type(value) :: h(3)
        integer :: k

        v = point_velocity(mechanism%bodies, link, p%cog)
        w = omega_of(mechanism%bodies, link, own_axes)
        do k = 1, 3
            h(k) = p%inertia(k, 1)*w%x + p%inertia(k, 2)*w%y + p%inertia(k, 3)*w%z
        end do
        energy = 0.5_wp*(p%mass*(v.dot.v) + (w%x*h(1) + w%y*h(2) + w%z*h(3)))
    end function energy_of

    !> Potential energy of gravity and links alone [J].
    function gravity_energy(mechanism) result(energy)
        type(mechanism_type), intent(in) :: mechanism
        type(value) :: energy
        type(mass_properties) :: p
        integer :: i

        energy = zero()
        do i = 1, mechanism%model%n_link
            p = properties_of(mechanism, i)
            energy = energy - p%mass*(gravity_of(mechanism) .dot.point_position(mechanism%bodies, i, p%cog))
        end do
    end function gravity_energy

    !> Potential energy of gravity and springs [J].
    function potential_energy(mechanism) result(energy)
        type(mechanism_type), intent(in) :: mechanism
        type(value) :: energy
        type(mass_properties) :: p
        integer :: i

        energy = gravity_energy(mechanism)
        do i = 1, size(mechanism%model%payload)
            p = payload_properties(mechanism, i)
            energy = energy - p%mass*(gravity_of(mechanism) &
                                      .dot.point_position(mechanism%bodies, mechanism%model%payload(i)%link, p%cog))
        end do
        do i = 1, size(mechanism%model%scene%spring)
            energy = energy + spring_energy(mechanism, i)
        end do
        do i = 1, size(mechanism%model%belt)
            energy = energy + belt_energy(mechanism, i)
        end do
    end function potential_energy

    !> Largest of the values that should vanish while the joints hold [m, rad].
    function largest_gap(mechanism) result(gap)
        type(mechanism_type), intent(in) :: mechanism
        type(value) :: gap
        type(value), allocatable :: c(:)
        integer :: j, k

        gap = zero()
        do j = 1, mechanism%model%n_joint
            c = mechanism%kind(j)%is%constraints(pair_of(mechanism, j))
            do k = 1, size(c)
                gap = max(abs(c(k)), gap)
            end do
        end do
    end function largest_gap

    !> Origin of a link as the scene has it, world axes.
    function scene_position(mechanism, l) result(p)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: l
        type(value) :: p(3)

        p = components(point_position(mechanism%bodies, l, mechanism%own(l)%shift))
    end function scene_position

    !> Axes of a link as the scene has them: its columns one after the other.
    function scene_rotation(mechanism, l) result(r)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: l
        type(value) :: r(9)
        type(rotation) :: turned_axes

        turned_axes = rotation_of(mechanism%bodies, l)*mechanism%own(l)%r
        r = [components(turned_axes%x), components(turned_axes%y), components(turned_axes%z)]
    end function scene_rotation

    !> Velocity of a link's origin as the scene has it, world axes.
    function scene_velocity(mechanism, l) result(v)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: l
        type(value) :: v(3)

        v = components(point_velocity(mechanism%bodies, l, mechanism%own(l)%shift))
    end function scene_velocity

    !> World axes.
    function scene_angular_velocity(mechanism, l) result(omega)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: l
        type(value) :: omega(3)

        omega = components(omega_of(mechanism%bodies, l, world_axes))
    end function scene_angular_velocity
end module linkdyn_motion_quantities
