!> What each link's motion asks for beyond loads and springs: the wrenches that drives and joints must supply; and the power
!> of those.
module linkdyn_link_wrenches
    use linkdyn_acting, only: acting_type, turned
    use linkdyn_bodies, only: own_axes, omega_of, alpha_of, rotation_of, point_acceleration
    use linkdyn_inertia_wrench, only: inertia_wrench, inertia_size
    use linkdyn_mechanism, only: mechanism_type, gravity_of, properties_of, point_of_action
    use linkdyn_system, only: solved
    use linkdyn_trace, only: traced_type
    use linkdyn_value, only: value, zero, square, operator(+), operator(-), operator(*)
    use linkdyn_vector, only: vector, vector_of, zero_vector, components, sum_of_magnitudes, operator(+), operator(-), &
        operator(*), operator(.dot.), operator(.cross.), operator(.unrotate.)
    implicit none (type, external)
    private
    public :: link_wrenches, wrench_sizes, applied_power

contains

    !> Force and moment about each link's origin, own axes.
    subroutine link_wrenches(traced, force, moment)
        type(traced_type), intent(in) :: traced
        type(vector), intent(out) :: force(:), moment(:)    !! (link) [N, N m]
        integer :: i, l

        do l = 1, traced%mechanism%model%n_link
            call inertia_wrench(traced%mechanism%bodies, l, properties_of(traced%mechanism, l), zero_vector(), own_axes, &
                                force(l), moment(l))
        end do
        do i = 1, size(traced%acting)
            call take_off(traced%mechanism, traced%acting(i), force, moment)
        end do
    end subroutine link_wrenches

    !> How large the parts are that `link_wrenches` adds up: inertia, weight, each that acts.
    subroutine wrench_sizes(traced, force, moment)
        type(traced_type), intent(inout) :: traced
        type(value), intent(out) :: force(:), moment(:)     !! (link) [N, N m]
        type(value) :: f, m, acceleration, turning
        integer :: i, l, side

        associate (mechanism => traced%mechanism)
            do l = 1, mechanism%model%n_link
                acceleration = size_of(point_acceleration(mechanism%bodies, l, zero_vector(), own_axes)) &
                               + size_of(gravity_of(mechanism))
                turning = size_of(alpha_of(mechanism%bodies, l, own_axes)) &
                          + square(size_of(omega_of(mechanism%bodies, l, own_axes)))
                call inertia_size(properties_of(mechanism, l), acceleration, turning, force(l), moment(l))
            end do
            do i = 1, size(traced%acting)
                associate (acting => traced%acting(i))
                    f = size_of(acting%force)
                    m = size_of(acting%moment)
                    if (acting%joint == 0) then
                        call add(acting%link, acting%point)
                        cycle
                    end if
                    do side = 1, 2
                        call add(mechanism%model%joint(acting%joint)%link(side), &
                                 point_of_action(mechanism, acting%joint, side))
                    end do
                end associate
            end do
        end associate

    contains

        !> Length of a vector in which unknown accelerations may stand.
        type(value) function size_of(v)
            type(vector), intent(in) :: v

            size_of = sum_of_magnitudes(vector_of(solved(traced%system, components(v))))
        end function size_of

        subroutine add(link, point)
            integer, intent(in) :: link
            type(vector), intent(in) :: point

            if (link == 0) return
            force(link) = force(link) + f
            moment(link) = moment(link) + m + sum_of_magnitudes(point)*f
        end subroutine add
    end subroutine wrench_sizes

    !> Power of loads and springs.
    function applied_power(traced) result(power)
        type(traced_type), intent(in) :: traced
        type(value) :: power                                !! [W]
        type(vector) :: force(traced%mechanism%model%n_link), moment(traced%mechanism%model%n_link), velocity
        integer :: i, l

        do l = 1, size(force)
            force(l) = zero_vector()
            moment(l) = zero_vector()
        end do
        do i = 1, size(traced%acting)
            call take_off(traced%mechanism, traced%acting(i), force, moment)
        end do
        power = zero()
        associate (bodies => traced%mechanism%bodies)
            do l = 1, size(force)
                velocity = rotation_of(bodies, l) .unrotate.bodies%body(l)%velocity
                power = power - (force(l) .dot.velocity) - (moment(l) .dot.omega_of(bodies, l, own_axes))
            end do
        end associate
    end function applied_power

    !> What acts is supplied already.
    subroutine take_off(mechanism, acting, force, moment)
        type(mechanism_type), intent(in) :: mechanism
        type(acting_type), intent(in) :: acting
        type(vector), intent(inout) :: force(:), moment(:)
        integer :: side

        if (acting%joint == 0) then
            call take(acting%link, acting%point, opposite=.false.)
            return
        end if
        do side = 1, 2
            call take(mechanism%model%joint(acting%joint)%link(side), point_of_action(mechanism, acting%joint, side), &
                      opposite=side == 1)
        end do

    contains

        subroutine take(link, point, opposite)
            integer, intent(in) :: link
            type(vector), intent(in) :: point
            logical, intent(in) :: opposite
            type(vector) :: f, m

            if (link == 0) return
            f = turned(mechanism%bodies, acting%force, acting%turning, mechanism%bodies%body(link)%turning)
            m = turned(mechanism%bodies, acting%moment, acting%turning, mechanism%bodies%body(link)%turning)
            if (opposite) then
                f = -f
                m = -m
            end if
            force(link) = force(link) - f
            moment(link) = moment(link) - m - (point.cross.f)
        end subroutine take
    end subroutine take_off
end module linkdyn_link_wrenches
