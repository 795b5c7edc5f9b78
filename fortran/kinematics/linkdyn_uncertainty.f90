!> What rounding leaves of a motion near dead points and change points: one rule for all maps from the motion of known links
!> to that of others, closed forms and groups closed by iteration alike.
module linkdyn_uncertainty
    use linkdyn_kinds, only: wp
    implicit none (type, external)
    private
    public :: largest_uncertainty, uncertainty_of_motion, is_surely_certain

    !> Three digits: with fewer a rate, an acceleration or a force is not given as right.
    real(wp), parameter :: largest_uncertainty = 1.0e-3_wp

contains

    !> Uncertainty of the motion behind a map, and of the forces that it asks for, relative to these.
    !>
    !> With s the sine of a dyad's transmission angle, a rounding eps of the lengths moves the inner joint by eps/s and changes
    !> s by the part eps/s^2, and so the rates. Their error enters the accelerations squared in the rates, over s once more.
    !> Where the gap nearly lies in the way in which both links move it, rates and accelerations stay small, as at a change
    !> point, and so do the forces, which the error of the accelerations enters over s again. So it is where there is no gap at
    !> all, as in a parallelogram. A condition number of the map alone would not tell these places from a dead point, where
    !> accelerations are the gap over s, and all of them grow and keep their digits.
    elemental real(wp) function uncertainty_of_motion(sine, reach, speed, gap, acceleration, gap2, off) result(part)
        real(wp), intent(in) :: sine              !! of a dyad; of a group its margin, which takes the same part
        real(wp), intent(in) :: reach             !! on what radius the links' points turn [m]; huge: they do not
        real(wp), intent(in) :: speed             !! the largest found [m/s]
        real(wp), intent(in) :: gap               !! what the map was given for it [m/s]
        real(wp), intent(in) :: acceleration, gap2    !! likewise [m/s2]
        real(wp), intent(in), optional :: off     !! how many of their lengths the links are away; absent: one
        real(wp) :: turn, error, curve, whole, at_dead_point

        turn = epsilon(1.0_wp)/sine**2
        if (present(off)) turn = off*turn
        error = turn*(speed + gap)
        curve = speed**2/reach
        whole = max(acceleration, gap2, curve, tiny(1.0_wp))
        at_dead_point = sine*whole/max(gap2, tiny(1.0_wp))    ! it would be one
        part = max(turn, (turn*(acceleration + gap2) + 2*speed*error/(reach*sine))/whole &
                   *max(1/at_dead_point, min(at_dead_point, 1/sine)))
        ! At a dead point itself nothing is known.
        part = merge(part, huge(1.0_wp), part <= huge(1.0_wp))
    end function uncertainty_of_motion

    !> Is a group's uncertainty below the limit whatever its motion?
    !>
    !> With lengths as parts of the group's size a row of its constraints has no entry much beyond one, and four of them that
    !> count: what n rows are given for the motion is below 4 sqrt(n) times this. So, with s the margin, the uncertainty is
    !> below (4 + 8 sqrt(n)) eps/s^4, and as many times that as the links are away by sizes of the group. Twice that leaves room for
    !> rounding and for slides longer than the group is large.
    elemental logical function is_surely_certain(margin, n, off)
        real(wp), intent(in) :: margin
        integer, intent(in) :: n                  !! rows
        real(wp), intent(in) :: off               !! how far the links are from the world's origin, in sizes of the group; one at
                                                  !! least

        is_surely_certain = margin**4 > 2*(4 + 8*sqrt(real(n, wp)))*off*epsilon(1.0_wp)/largest_uncertainty
    end function is_surely_certain
end module linkdyn_uncertainty
