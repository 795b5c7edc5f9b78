!> Dyad RRP: a link from the known point A to C, and a link that carries C and slides on a known link. The lecture's
!> PRR_links; which end is called first is a matter of the slide's line only.
!>
!> C runs along the unit vector u through the point C0 that it has at slide 0. Branch +1: C lies forward of A, along u.
module linkdyn_rrp_dyad
    use linkdyn_dyad_map, only: dyad_map, make_dyad_map, half_chord
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_vec2, only: vec2, operator(+), operator(-), operator(*), operator(.dot.), operator(.cross.), perp
    implicit none (type, external)
    private
    public :: locate_rrp, map_rrp, bias_rrp

contains

    !> Intersect the circle about A with the line.
    pure subroutine locate_rrp(d, u, length, branch, arm, slide, is_reachable)
        type(vec2), intent(in) :: d                    !! from A to C0 [m]
        type(vec2), intent(in) :: u                    !! unit vector along the slide
        real(wp), intent(in) :: length                 !! AC [m]
        real(wp), intent(in) :: branch(lanes)          !! +1 or -1
        type(vec2), intent(out) :: arm                 !! C - A [m]
        real(wp), intent(out) :: slide(lanes)          !! from C0 to C along u [m]
        logical, intent(out) :: is_reachable(lanes)
        real(wp), dimension(lanes) :: radius, height, forward

        radius = length
        height = u.cross.d
        call half_chord(radius, height, forward, is_reachable)
        forward = branch*forward
        arm = forward*u + height*perp(u)
        slide = forward - (d.dot.u)
    end subroutine locate_rrp

    !> Rates: angular velocity of the link AC, rate of the slide. The gap is the motion of C as a point of the known
    !> link that carries the slide, less that of A.
    pure function map_rrp(arm, u) result(map)
        type(vec2), intent(in) :: arm, u
        type(dyad_map) :: map

        map = make_dyad_map(perp(arm), u)
    end function map_rrp

    !> What the rates add to the gap of accelerations: centripetal and Coriolis.
    pure function bias_rrp(arm, u, omega, omega_slide, slide_rate) result(gap)
        type(vec2), intent(in) :: arm, u
        real(wp), intent(in) :: omega(lanes)           !! of the link AC [rad/s]
        real(wp), intent(in) :: omega_slide(lanes)     !! of the link that carries the slide [rad/s]
        real(wp), intent(in) :: slide_rate(lanes)      !! [m/s]
        type(vec2) :: gap

        gap = omega**2*arm + (2*omega_slide*slide_rate)*perp(u)
    end function bias_rrp
end module linkdyn_rrp_dyad
