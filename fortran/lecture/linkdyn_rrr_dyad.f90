!> Dyad RRR: two links between known points A and B, joined at C. The lecture's RRR_links.
!>
!> With d = B - A and D = |d|:
!>     C = A + a d + branch h perp(d),   a = (L1^2 - L2^2 + D^2)/(2 D^2),
!>     h^2 = (L1+L2-D)(L1+L2+D)(D+L1-L2)(D-L1+L2)/(4 D^4)
!> in place of the lecture's angles: no arc cosine, and the factors keep their digits near the dead points.
!> Branch +1: C lies to the left of the way from A to B.
module linkdyn_rrr_dyad
    use linkdyn_dyad_map, only: dyad_map, make_dyad_map
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_vec2, only: vec2, operator(+), operator(-), operator(*), operator(.dot.), perp
    implicit none (type, external)
    private
    public :: locate_rrr, map_rrr, bias_rrr

    real(wp), parameter :: rounding = 8*epsilon(1.0_wp)   !! of the factors, relative to the lengths

contains

    !> Close the triangle.
    pure subroutine locate_rrr(d, length1, length2, branch, arm1, arm2, is_reachable)
        type(vec2), intent(in) :: d                          !! from A to B [m]
        real(wp), intent(in) :: length1, length2             !! AC and BC [m]
        real(wp), intent(in) :: branch(lanes)                !! +1 or -1
        type(vec2), intent(out) :: arm1, arm2                !! C - A, C - B [m]
        logical, intent(out) :: is_reachable(lanes)
        real(wp), dimension(lanes) :: square, distance, along, across

        square = d.dot.d
        distance = sqrt(square)
        along = 0.5_wp + (length1 - length2)*(length1 + length2)/(2*square)
        ! The lengths first: a short distance added to a length would lose its digits.
        across = (length1 + length2 - distance)*(length1 + length2 + distance) &
                 *(distance + (length1 - length2))*(distance - (length1 - length2))
        is_reachable = across >= -rounding*(length1 + length2)**2*(distance + abs(length1 - length2))**2
        across = sqrt(max(across, 0.0_wp))/(2*square)
        arm1 = along*d + (branch*across)*perp(d)
        arm2 = arm1 - d
    end subroutine locate_rrr

    !> Rates are the links' angular velocities; the gap is the motion of B less that of A.
    pure function map_rrr(arm1, arm2) result(map)
        type(vec2), intent(in) :: arm1, arm2
        type(dyad_map) :: map

        map = make_dyad_map(perp(arm1), perp(arm2))
    end function map_rrr

    !> What the angular velocities add to the gap of accelerations.
    pure function bias_rrr(arm1, arm2, omega1, omega2) result(gap)
        type(vec2), intent(in) :: arm1, arm2
        real(wp), intent(in) :: omega1(lanes), omega2(lanes)
        type(vec2) :: gap

        gap = omega1**2*arm1 - omega2**2*arm2
    end function bias_rrr
end module linkdyn_rrr_dyad
