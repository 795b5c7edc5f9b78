!> Dyads with two slides: PRP (both outer joints slide) and PPR (an outer and the inner joint slide). All their
!> orientations are known, so the closure is linear: one assembly, singular only where the slides are parallel.
!>
!> PRP: the inner joint lies on two known lines. PPR: a known point is reached by two slides in turn.
module linkdyn_slide_dyads
    use linkdyn_dyad_map, only: dyad_map, make_dyad_map
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_vec2, only: vec2, operator(+), operator(-), operator(*), perp
    implicit none (type, external)
    private
    public :: map_prp, map_ppr, bias_prp, bias_ppr

contains

    !> Slides s1, s2 with s1 u1 - s2 u2 = gap: positions as well as rates.
    pure function map_prp(u1, u2) result(map)
        type(vec2), intent(in) :: u1, u2               !! unit vectors along the slides
        type(dyad_map) :: map

        map = make_dyad_map(u1, u2)
    end function map_prp

    !> Coriolis accelerations of the inner joint, seen from the two known links.
    pure function bias_prp(u1, u2, omega1, omega2, rate1, rate2) result(gap)
        type(vec2), intent(in) :: u1, u2
        real(wp), intent(in) :: omega1(lanes), omega2(lanes)    !! of the known links [rad/s]
        real(wp), intent(in) :: rate1(lanes), rate2(lanes)      !! of the slides [m/s]
        type(vec2) :: gap

        gap = (2*omega2*rate2)*perp(u2) - (2*omega1*rate1)*perp(u1)
    end function bias_prp

    !> Slides s1, s2 with s1 u1 + s2 u2 = gap.
    pure function map_ppr(u1, u2) result(map)
        type(vec2), intent(in) :: u1, u2
        type(dyad_map) :: map

        map = make_dyad_map(u1, -u2)
    end function map_ppr

    !> Coriolis accelerations of the hinge; all turns with the link that carries the first slide.
    pure function bias_ppr(u1, u2, omega, rate1, rate2) result(gap)
        type(vec2), intent(in) :: u1, u2
        real(wp), intent(in) :: omega(lanes)
        real(wp), intent(in) :: rate1(lanes), rate2(lanes)
        type(vec2) :: gap

        gap = (-2*omega)*perp(rate1*u1 + rate2*u2)
    end function bias_ppr
end module linkdyn_slide_dyads
