!> Dyad RPR: two links that slide on each other, hinged at the known points A and B (oscillating cylinder, quick return).
!>
!> Both links share one orientation. B lies at the fixed height n beside the slide's line through A; how far along it
!> is the unknown. Branch +1: B lies forward of A, along the slide u.
module linkdyn_rpr_dyad
    use linkdyn_dyad_map, only: dyad_map, make_dyad_map, half_chord
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_vec2, only: vec2, operator(+), operator(-), operator(*), operator(.dot.), perp
    implicit none (type, external)
    private
    public :: locate_rpr, map_rpr, bias_rpr

contains

    !> Turn the pair so that B falls on its line.
    pure subroutine locate_rpr(d, height, branch, u, forward, is_reachable)
        type(vec2), intent(in) :: d                    !! from A to B [m]
        real(wp), intent(in) :: height                 !! of B beside the line through A, along perp(u) [m]
        real(wp), intent(in) :: branch(lanes)          !! +1 or -1
        type(vec2), intent(out) :: u                   !! unit vector along the slide
        real(wp), intent(out) :: forward(lanes)        !! from A to B along u [m]
        logical, intent(out) :: is_reachable(lanes)
        real(wp) :: square(lanes), fixed(lanes)

        square = d.dot.d
        fixed = height
        call half_chord(sqrt(square), fixed, forward, is_reachable)
        is_reachable = is_reachable .and. square > 0
        forward = branch*forward
        u = (1/square)*(forward*d - height*perp(d))
    end subroutine locate_rpr

    !> Rates: angular velocity of both links, rate of the slide. The gap is the motion of B less that of A.
    pure function map_rpr(d, u) result(map)
        type(vec2), intent(in) :: d, u
        type(dyad_map) :: map

        map = make_dyad_map(perp(d), -u)
    end function map_rpr

    !> What the rates add to the gap of accelerations: centripetal and Coriolis.
    pure function bias_rpr(d, u, omega, slide_rate) result(gap)
        type(vec2), intent(in) :: d, u
        real(wp), intent(in) :: omega(lanes), slide_rate(lanes)
        type(vec2) :: gap

        gap = omega**2*d - (2*omega*slide_rate)*perp(u)
    end function bias_rpr
end module linkdyn_rpr_dyad
