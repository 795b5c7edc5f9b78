!> The linear map of a planar dyad: one 2x2 system serves velocities and every column of accelerations, whatever the group.
!>
!> Two unknown rates r1, r2 (angular rates of links, rates of slides) close the gap that the known links leave:
!>     r1 first - r2 second = gap
!> `first` and `second` are how the gap moves for a unit rate. Their cross product vanishes at the dead points; divided by
!> both lengths it is the sine of the transmission angle.
module linkdyn_dyad_map
    use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_uncertainty, only: largest_uncertainty, uncertainty_of_motion
    use linkdyn_vec2, only: vec2, operator(-), operator(*), operator(.cross.), operator(.dot.)
    implicit none (type, external)
    private
    public :: dyad_map, make_dyad_map, solve_dyad, lengths_of, transmission_angle
    public :: drop_uncertain, half_chord, uncertainty_of_dyad_motion, is_surely_certain

    type :: dyad_map
        type(vec2) :: first, second         !! [m] for a rotation, 1 for a slide
        real(wp) :: determinant(lanes)      !! first x second
        real(wp) :: inverse(lanes)          !! of the determinant
    end type dyad_map

contains

    pure function make_dyad_map(first, second) result(map)
        type(vec2), intent(in) :: first, second
        type(dyad_map) :: map

        map%first = first
        map%second = second
        map%determinant = first.cross.second
        map%inverse = 1/map%determinant
    end function make_dyad_map

    pure subroutine solve_dyad(map, gap, rate1, rate2)
        type(dyad_map), intent(in) :: map
        type(vec2), intent(in) :: gap
        real(wp), intent(out) :: rate1(lanes), rate2(lanes)

        rate1 = map%inverse*(gap.cross.map%second)
        rate2 = map%inverse*(gap.cross.map%first)
    end subroutine solve_dyad

    !> No rates where next to nothing of them is certain: so near a dead point that the last digits of the position turn the
    !> links by much of the transmission angle.
    !>
    !> A gap of the size of the position's error turns links by up to error*reach/|det|, reach being the length of the
    !> motions that rotations make, and the determinant changes with the angle by first.second.
    pure subroutine drop_uncertain(error, reach, map)
        real(wp), intent(in) :: error(lanes)          !! of the position [m]
        real(wp), intent(in) :: reach(lanes)
        type(dyad_map), intent(inout) :: map
        real(wp) :: share(lanes)

        share = error*reach*abs(map%first.dot.map%second)*map%inverse**2
        where (.not. share <= largest_uncertainty) map%inverse = ieee_value(1.0_wp, ieee_quiet_nan)
    end subroutine drop_uncertain

    !> Product of the lengths of both columns: the determinant divided by it is the sine of the transmission angle, 0 at a
    !> dead point.
    pure function lengths_of(map) result(product)
        type(dyad_map), intent(in) :: map
        real(wp) :: product(lanes)

        product = sqrt((map%first.dot.map%first)*(map%second.dot.map%second))
    end function lengths_of

    !> Transmission angle [rad], 0 (a dead point) to pi/2 (best): between the two ways in which the gap can be closed. Of
    !> hinged links it is the angle between the links, folded into the first quadrant.
    pure function transmission_angle(map) result(angle)
        type(dyad_map), intent(in) :: map
        real(wp) :: angle(lanes)

        angle = atan2(abs(map%determinant), abs(map%first.dot.map%second))
    end function transmission_angle

    !> What rounding of the lengths makes of the motion behind a dyad, and of forces (see `linkdyn_uncertainty`).
    pure function uncertainty_of_dyad_motion(map, reach, speed1, speed2, acceleration1, acceleration2) result(part)
        type(dyad_map), intent(in) :: map
        real(wp), intent(in) :: reach(lanes)                  !! of the shorter hinged link [m]; huge: slides alone
        real(wp), intent(in), dimension(lanes) :: speed1, speed2                  !! rates found: of `first` and `second`
        real(wp), intent(in), dimension(lanes) :: acceleration1, acceleration2    !! likewise
        real(wp) :: part(lanes)
        real(wp), dimension(lanes) :: size1, size2

        size1 = sqrt(map%first.dot.map%first)
        size2 = sqrt(map%second.dot.map%second)
        part = uncertainty_of_motion(abs(map%determinant)/(size1*size2), reach, &
                                     max(abs(speed1)*size1, abs(speed2)*size2), &
                                     length_of(speed1*map%first - speed2*map%second), &
                                     max(abs(acceleration1)*size1, abs(acceleration2)*size2), &
                                     length_of(acceleration1*map%first - acceleration2*map%second))
    end function uncertainty_of_dyad_motion

    !> Is `uncertainty_of_motion` below `largest_uncertainty` whatever the motion? No gap exceeds twice the speed, and none of
    !> the three parts the `whole`; so it is below 8 eps/s^4. Twice that leaves room for rounding.
    pure function is_surely_certain(map) result(is_certain)
        type(dyad_map), intent(in) :: map
        logical :: is_certain(lanes)
        real(wp), parameter :: least_square = sqrt(16*epsilon(1.0_wp)/largest_uncertainty)    !! of the sine

        is_certain = map%determinant**2 > least_square*(map%first.dot.map%first)*(map%second.dot.map%second)
    end function is_surely_certain

    pure function length_of(v) result(length)
        type(vec2), intent(in) :: v
        real(wp) :: length(lanes)

        length = sqrt(v.dot.v)
    end function length_of

    !> Square root of (radius - distance)(radius + distance), the half chord of a circle: kept factored, it has all its
    !> digits near zero. What rounding alone pushed below zero is zero; beyond that the circle is out of reach.
    pure subroutine half_chord(radius, distance, half, is_reachable)
        real(wp), intent(in) :: radius(lanes), distance(lanes)    !! [m]; distance of either sign
        real(wp), intent(out) :: half(lanes)
        logical, intent(out) :: is_reachable(lanes)
        real(wp), parameter :: rounding = 8*epsilon(1.0_wp)
        real(wp) :: square(lanes)

        square = (radius - distance)*(radius + distance)
        is_reachable = square >= -rounding*radius**2
        half = sqrt(max(square, 0.0_wp))
    end subroutine half_chord
end module linkdyn_dyad_map
