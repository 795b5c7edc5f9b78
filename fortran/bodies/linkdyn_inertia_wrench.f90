!> Newton and Euler: the wrench that a link's motion asks for.
!>
!> About a point P of the link, with c from P to the centre of mass and the tensor I about P,
!>
!>     force  = m a(P) + F (m c),    F: field of accelerations, a(r) = a(P) + F r
!>     moment = I alpha + omega x I omega + m c x a(P)
!>
!> Accelerations are less gravity, so this is the wrench that joints and loads must supply.
module linkdyn_inertia_wrench
    use linkdyn_bodies, only: bodies_type, world_axes, own_axes, acceleration_field, field_times, rotation_of, omega_of, &
        alpha_of, point_acceleration, arm_of
    use linkdyn_value, only: value, abs, operator(+), operator(-), operator(*)
    use linkdyn_vector, only: vector, components, sum_of_magnitudes, zero_vector, operator(+), operator(-), operator(*), &
        operator(.cross.), operator(.rotate.)
    implicit none (type, external)
    private
    public :: mass_properties, inertia_wrench, inertia_size

    !> Mass properties of one link, link axes.
    type :: mass_properties
        type(value) :: mass                            !! [kg]
        type(vector) :: cog                            !! [m]
        type(value) :: inertia(3, 3)                   !! about the centre of mass [kg m2]
    end type mass_properties

contains

    !> Force and moment about a point of the link.
    subroutine inertia_wrench(bodies, link, properties, point, axes, force, moment)
        type(bodies_type), intent(in) :: bodies
        integer, intent(in) :: link
        type(mass_properties), intent(in) :: properties
        type(vector), intent(in) :: point              !! moment point, link axes [m]
        integer, intent(in) :: axes                    !! of the result
        type(vector), intent(out) :: force, moment     !! [N, N m]
        type(vector) :: a, mc

        mc = properties%mass*(properties%cog - point)
        if (axes == world_axes) mc = arm_of(bodies, link, mc)
        a = point_acceleration(bodies, link, point, axes)
        force = properties%mass*a + field_times(acceleration_field(bodies, link, axes), mc)
        moment = turning_moment(omega_of(bodies, link, own_axes), alpha_of(bodies, link, own_axes), &
                                inertia_about(properties, point))
        if (axes == world_axes) moment = rotation_of(bodies, link) .rotate.moment
        moment = moment + (mc.cross.a)
    end subroutine inertia_wrench

    !> How large the parts of that wrench about the origin are, inertia and weight apart: what its rounding is measured by
    !> where they balance each other.
    subroutine inertia_size(properties, acceleration, turning, force, moment)
        type(mass_properties), intent(in) :: properties
        type(value), intent(in) :: acceleration        !! how large: of the origin, and gravity [m/s2]
        type(value), intent(in) :: turning             !! how large: alpha and omega squared [1/s2]
        type(value), intent(out) :: force, moment      !! [N, N m]
        type(value) :: mc, i(3, 3)
        integer :: k, l

        mc = properties%mass*sum_of_magnitudes(properties%cog)
        force = properties%mass*acceleration + turning*mc
        moment = mc*acceleration
        i = inertia_about(properties, zero_vector())
        do l = 1, 3
            do k = 1, l
                moment = moment + turning*abs(i(k, l))
            end do
        end do
    end subroutine inertia_size

    !> Inertia tensor about a point: the parallel axes.
    function inertia_about(properties, point) result(tensor)
        type(mass_properties), intent(in) :: properties
        type(vector), intent(in) :: point
        type(value) :: tensor(3, 3)
        type(value) :: c(3), square
        integer :: i, k

        c = components(properties%cog - point)
        square = c(1)*c(1) + c(2)*c(2) + c(3)*c(3)
        do k = 1, 3
            do i = 1, 3
                tensor(i, k) = properties%inertia(i, k) - properties%mass*(c(i)*c(k))
                if (i == k) tensor(i, k) = properties%inertia(i, k) + properties%mass*(square - c(i)*c(k))
            end do
        end do
    end function inertia_about

    !> I alpha + omega x I omega, sorted by products of the angular velocity, which the field of accelerations has too.
    function turning_moment(w, a, i) result(moment)
        type(vector), intent(in) :: w, a               !! omega, alpha, link axes
        type(value), intent(in) :: i(3, 3)
        type(vector) :: moment
        type(value) :: xx, yy, zz, xy, yz, zx

        xx = w%x*w%x
        yy = w%y*w%y
        zz = w%z*w%z
        xy = w%x*w%y
        yz = w%y*w%z
        zx = w%z*w%x
        moment%x = i(1, 1)*a%x + (i(3, 3) - i(2, 2))*yz + i(2, 3)*(yy - zz) - i(1, 2)*(zx - a%y) + i(3, 1)*(xy + a%z)
        moment%y = i(2, 2)*a%y + (i(1, 1) - i(3, 3))*zx + i(3, 1)*(zz - xx) - i(2, 3)*(xy - a%z) + i(1, 2)*(yz + a%x)
        moment%z = i(3, 3)*a%z + (i(2, 2) - i(1, 1))*xy + i(1, 2)*(xx - yy) - i(3, 1)*(yz - a%x) + i(2, 3)*(zx + a%y)
    end function turning_moment
end module linkdyn_inertia_wrench
