!> Forces of the frame's motion on the links, as one who stands on the frame feels them.
!>
!> **Source**: theory, the frame moves. With the frame's angular velocity w and acceleration e, the gravity that there seems to be
!> besides, dg, and of a link the place r and velocity v of its centre of mass and its angular velocity u, as seen from the frame:
!> force m (dg - e x r - w x (w x r) - 2 w x v), moment -J (e + w x u) - w x J (w + u) - u x J w.
module linkdyn_base_wrenches
    use linkdyn_acting, only: acting_type
    use linkdyn_base_motion, only: n_base
    use linkdyn_bodies, only: own_axes, omega_of, rotation_of, point_position, point_velocity
    use linkdyn_inertia_wrench, only: mass_properties
    use linkdyn_kinds, only: wp
    use linkdyn_mechanism, only: mechanism_type
    use linkdyn_value, only: value, operator(+), operator(*)
    use linkdyn_vector, only: vector, vector_of, operator(+), operator(-), operator(*), operator(.cross.), operator(.rotate.), &
        operator(.unrotate.)
    implicit none (type, external)
    private
    public :: base_wrench

contains

    !> On one link or on what it carries, at the centre of mass, world axes.
    function base_wrench(mechanism, l, p, base) result(acting)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: l                       !! link
        type(mass_properties), intent(in) :: p         !! its own, or those of a payload
        type(value), intent(in) :: base(n_base)        !! as `linkdyn_base_motion` has them
        type(acting_type) :: acting
        type(vector) :: gravity, w, e, u, r, v, momentum

        gravity = vector_of(base(1:3))
        w = vector_of(base(4:6))
        e = vector_of(base(7:9))
        r = point_position(mechanism%bodies, l, p%cog)
        v = point_velocity(mechanism%bodies, l, p%cog)
        acting%link = l
        acting%point = p%cog
        acting%force = p%mass*(gravity - (e.cross.r) - (w.cross.((w.cross.r) + 2.0_wp*v)))
        ! the moment in link axes
        u = omega_of(mechanism%bodies, l, own_axes)
        w = rotation_of(mechanism%bodies, l) .unrotate.w
        e = rotation_of(mechanism%bodies, l) .unrotate.e
        momentum = times(p%inertia, w)
        acting%moment = rotation_of(mechanism%bodies, l) .rotate.(-(times(p%inertia, e + (w.cross.u)) &
                                                                   + (w.cross.(momentum + times(p%inertia, u))) &
                                                                   + (u.cross.momentum)))
    end function base_wrench

    function times(tensor, v) result(h)
        type(value), intent(in) :: tensor(3, 3)
        type(vector), intent(in) :: v
        type(vector) :: h
        type(value) :: c(3)
        integer :: k

        do k = 1, 3
            c(k) = tensor(k, 1)*v%x + tensor(k, 2)*v%y + tensor(k, 3)*v%z
        end do
        h = vector_of(c)
    end function times
end module linkdyn_base_wrenches
