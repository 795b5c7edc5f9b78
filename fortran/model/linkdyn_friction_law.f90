!> How friction hangs on the speed at which surfaces slide: c = mu(V) tanh(V/creep)/V, see `linkdyn_contact`.
module linkdyn_friction_law
    use linkdyn_contact, only: contact_type, sliding_coefficient
    use linkdyn_hyperbolic_tangent, only: find_tangents
    use linkdyn_kinds, only: wp
    implicit none (type, external)
    private
    public :: friction_of_speed, friction_of_speeds, friction_one_way, friction_slope

contains

    !> c: friction over the pressing force and the speed at which the surface slides.
    pure elemental real(wp) function friction_of_speed(contact, speed) result(c)
        type(contact_type), intent(in) :: contact
        real(wp), intent(in) :: speed         !! [m/s]
        real(wp) :: one(1, 1)

        call friction_of_speeds([contact], 1, reshape([speed], [1, 1]), one)
        c = one(1, 1)
    end function friction_of_speed

    !> How c changes with the square of the speed, of which it is a smooth function also at rest.
    pure elemental real(wp) function friction_slope(contact, square) result(slope)
        type(contact_type), intent(in) :: contact
        real(wp), intent(in) :: square        !! [m2/s2]
        real(wp), parameter :: small = 1.0e-3_wp      !! below it the series is exact, above it the difference
        real(wp) :: x2, t, t_slope

        slope = 0
        if (.not. rubs_drily(contact)) return
        x2 = max(square, 0.0_wp)/contact%creep_speed**2
        if (x2 > small) then
            t = tanh(sqrt(x2))/sqrt(x2)
            t_slope = ((1 - x2*t**2) - t)/(2*x2)
        else
            t = 1 - x2*(1/3.0_wp - x2*(2/15.0_wp - x2*(17/315.0_wp - x2*62/2835.0_wp)))
            t_slope = -1/3.0_wp + x2*(4/15.0_wp - x2*(17/105.0_wp - x2*248/2835.0_wp))
        end if
        slope = sliding_coefficient(contact, sqrt(max(square, 0.0_wp)))*t_slope/contact%creep_speed**3
        if (contact%stribeck_speed > 0) slope = slope - t/contact%creep_speed/contact%stribeck_speed**2 &
            *(sliding_coefficient(contact, sqrt(max(square, 0.0_wp))) - contact%coulomb)
    end function friction_slope

    !> The same of a contact that may stick and is known to slide one way: it rubs as a surface does that slides, however slowly;
    !> one that holds does not rub.
    pure elemental real(wp) function friction_one_way(contact, sense, speed) result(c)
        type(contact_type), intent(in) :: contact
        real(wp), intent(in) :: sense         !! largest part of its direction, above zero; beyond 1: it holds
        real(wp), intent(in) :: speed         !! [m/s]

        c = 0
        if (sense <= 1.5_wp) c = sliding_coefficient(contact, speed)/speed
    end function friction_one_way

    !> The same for contacts at many speeds each.
    pure subroutine friction_of_speeds(contact, n, speed, c)
        type(contact_type), intent(in) :: contact(:)
        integer, intent(in) :: n
        real(wp), intent(in) :: speed(n, size(contact))    !! [m/s]
        real(wp), intent(out) :: c(n, size(contact))       !! [s/m]
        real(wp) :: mu(n)
        integer :: k

        do k = 1, size(contact)
            c(:, k) = 0
            if (rubs_drily(contact(k))) c(:, k) = speed(:, k)/contact(k)%creep_speed
        end do
        call find_tangents(size(c), c)
        do k = 1, size(contact)
            if (.not. rubs_drily(contact(k))) cycle
            mu = sliding_coefficient(contact(k), 0.0_wp)
            if (contact(k)%stribeck_speed > 0) mu = sliding_coefficient(contact(k), speed(:, k))
            ! at rest what it comes to
            c(:, k) = mu*merge(c(:, k)/max(speed(:, k), tiny(1.0_wp)), 1/contact(k)%creep_speed, speed(:, k) > 0)
        end do
    end subroutine friction_of_speeds

    pure logical function rubs_drily(contact)
        type(contact_type), intent(in) :: contact

        rubs_drily = contact%coulomb > 0 .or. contact%static > 0
    end function rubs_drily
end module linkdyn_friction_law
