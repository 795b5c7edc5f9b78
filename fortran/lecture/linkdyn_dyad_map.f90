!> The linear map of a planar dyad: one 2x2 system serves velocities and every column of accelerations, whatever the group.
!>
!> Two unknown rates r1, r2 (angular rates of links, rates of slides) close the gap that the known links leave:
!>     r1 first - r2 second = gap
!> `first` and `second` are how the gap moves for a unit rate. Their cross product vanishes at the dead points; divided by
!> both lengths it is the sine of the transmission angle.
!>
!> The lecture's road, which shares nothing with that of the records: constraints of the joints, differentiated.
module linkdyn_dyad_map
    use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_uncertainty, only: largest_uncertainty
    use linkdyn_vec2, only: vec2, operator(-), operator(*), operator(.cross.), operator(.dot.)
    implicit none (type, external)
    private
    public :: dyad_map, make_dyad_map, solve_dyad, drop_uncertain, half_chord

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
