!> How friction hangs on the speed at which surfaces slide: c = mu(V) tanh(V/creep)/V, see `linkdyn_contact`.
module linkdyn_friction_law
    use linkdyn_contact, only: contact_type, sliding_coefficient
    use linkdyn_hyperbolic_tangent, only: find_tangents
    use linkdyn_kinds, only: wp
    implicit none (type, external)
    private
    public :: friction_of_speed, friction_of_speeds, friction_one_way

contains

    !> c: friction over the pressing force and the speed at which the surface slides.
    pure elemental real(wp) function friction_of_speed(contact, speed) result(c)
        type(contact_type), intent(in) :: contact
        real(wp), intent(in) :: speed         !! [m/s]
        real(wp) :: one(1)

        call friction_of_speeds(contact, 1, [speed], one)
        c = one(1)
    end function friction_of_speed

    !> The same of a contact that may stick and is known to slide one way: it rubs as a surface does that slides, however slowly;
    !> one that holds does not rub.
    pure elemental real(wp) function friction_one_way(contact, sense, speed) result(c)
        type(contact_type), intent(in) :: contact
        real(wp), intent(in) :: sense         !! largest part of its direction, above zero; beyond 1: it holds
        real(wp), intent(in) :: speed         !! [m/s]

        c = 0
        if (sense <= 1.5_wp) c = sliding_coefficient(contact, speed)/speed
    end function friction_one_way

    !> The same for one contact at many speeds.
    pure subroutine friction_of_speeds(contact, n, speed, c)
        type(contact_type), intent(in) :: contact
        integer, intent(in) :: n
        real(wp), intent(in) :: speed(n)      !! [m/s]
        real(wp), intent(out) :: c(n)         !! [s/m]
        integer :: i

        c = 0
        if (.not. (contact%coulomb > 0 .or. contact%static > 0)) return
        c = speed/contact%creep_speed
        call find_tangents(n, c)
        do i = 1, n
            if (speed(i) > 0) then
                c(i) = c(i)/speed(i)
            else
                c(i) = 1/contact%creep_speed
            end if
        end do
        if (contact%stribeck_speed > 0) then
            c = sliding_coefficient(contact, speed)*c
        else                                  ! which is the same at all speeds
            c = sliding_coefficient(contact, 0.0_wp)*c
        end if
    end subroutine friction_of_speeds
end module linkdyn_friction_law
