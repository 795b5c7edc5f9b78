!> The CSP group: two links between a cylinder axis and a slide, both of known motion, joined by a spherical joint.
!>
!> The coupler turns about and slides along the axis (point L, direction u); the output slides along y; S is common to
!> both. With w = S - L, sigma = w.u and n = w - sigma u, the length of n is fixed: S lies on a cylinder about the axis,
!> which the slide's line meets twice. Everything else follows from n.n = const by differentiation. The group is singular
!> where n.y = 0: the slide touches the cylinder. The sign of n.y is the branch.
!>
!> **Source**: the lecture's CSP_LINKS and FD_CSP_LINKS, whose formulas its text leaves out; derived here for an axis and
!> a slide that move in any way.
module linkdyn_csp
    use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_uncertainty, only: largest_uncertainty
    use linkdyn_vec3, only: vec3, operator(+), operator(-), operator(*), operator(.dot.), operator(.cross.)
    implicit none (type, external)
    private
    public :: csp_group, locate_csp, drop_uncertain_rates, move_csp, accelerate_csp

    !> A group in its position, world axes.
    type :: csp_group
        type(vec3) :: u, y                   !! axis of the cylinder, direction of the slide: unit vectors
        type(vec3) :: w                      !! from the point of the axis to S [m]
        type(vec3) :: n                      !! from the axis to S, square to it [m]
        type(vec3) :: m                      !! u x n
        real(wp) :: sigma(lanes)             !! along the axis to the foot of n [m]
        real(wp) :: slide(lanes)             !! of the output [m]
        real(wp) :: per_slope(lanes)         !! 1/(n.y)
        real(wp) :: per_radius2(lanes)       !! 1/n.n
        real(wp) :: sigma_rate(lanes), slide_rate(lanes), turn_rate(lanes)    !! turn: of the coupler about the axis
        type(vec3) :: w_rate, u_rate
    end type csp_group

contains

    !> Position. A slide that misses the cylinder leaves values that are not finite.
    pure subroutine locate_csp(span, axis, direction, radius, branch, group)
        type(vec3), intent(in) :: span       !! from the point of the axis to S at slide = 0 [m]
        type(vec3), intent(in) :: axis, direction
        real(wp), intent(in) :: radius       !! distance of S from the axis [m]
        real(wp), intent(in) :: branch(lanes)    !! +1: the farther meeting along the slide; -1: the nearer
        type(csp_group), intent(inout) :: group
        type(vec3) :: a, b
        real(wp), dimension(lanes) :: aa, ab, bb, root

        group%u = axis
        group%y = direction
        a = span - (span.dot.axis)*axis
        b = direction - (direction.dot.axis)*axis
        aa = a.dot.a
        ab = a.dot.b
        bb = b.dot.b
        root = sqrt(ab**2 - bb*(aa - radius**2))
        ! The root that adds up first; the other from the product of both: no digits cancel.
        where (ab*branch > 0)
            group%slide = -(aa - radius**2)/(ab + branch*root)
        elsewhere
            group%slide = (branch*root - ab)/bb
        end where
        group%w = span + group%slide*direction
        group%sigma = group%w.dot.axis
        group%n = group%w - group%sigma*axis
        group%m = axis.cross.group%n
        group%per_slope = 1/(group%n.dot.direction)
        group%per_radius2 = 1/(group%n.dot.group%n)
    end subroutine locate_csp

    !> No rates where next to nothing of them is certain: so near to where the slide touches the cylinder that the last digits
    !> of the position move the meeting by much of its way from there.
    !>
    !> Across the axis the slide runs at a distance h from it, and n.y is the root of (y.y)(n.n - h^2) in that plane: an
    !> error of h changes it by the share h error y.y/(n.y)^2.
    pure subroutine drop_uncertain_rates(error, group)
        real(wp), intent(in) :: error(lanes)    !! of the position [m]
        type(csp_group), intent(inout) :: group
        real(wp), dimension(lanes) :: across, h

        across = 1 - (group%u.dot.group%y)**2
        h = sqrt(max(0.0_wp, (group%n.dot.group%n) - 1/(group%per_slope**2*across)))
        where (.not. h*error*across*group%per_slope**2 <= largest_uncertainty) &
            group%per_slope = ieee_value(1.0_wp, ieee_quiet_nan)
    end subroutine drop_uncertain_rates

    !> Velocity: rates of the slide, along and about the axis.
    pure subroutine move_csp(span_rate, omega, group)
        type(vec3), intent(in) :: span_rate  !! velocity of S with the slide held, less that of the point of the axis [m/s]
        type(vec3), intent(in) :: omega      !! angular velocity of the link that carries the axis [rad/s]
        type(csp_group), intent(inout) :: group

        group%u_rate = omega.cross.group%u
        group%slide_rate = (group%n.dot.(group%sigma*group%u_rate - span_rate))*group%per_slope
        group%w_rate = span_rate + group%slide_rate*group%y
        group%sigma_rate = (group%w_rate.dot.group%u) + (group%w.dot.group%u_rate)
        group%turn_rate = ((group%w_rate - (omega.cross.group%w)).dot.group%m)*group%per_radius2
    end subroutine move_csp

    !> Acceleration of the slide and of the turn about the axis.
    pure subroutine accelerate_csp(group, span_acceleration, omega, alpha, slide_rate2, turn_rate2)
        type(csp_group), intent(in) :: group
        type(vec3), intent(in) :: span_acceleration    !! of S with the slide at constant rate, less that of the axis [m/s2]
        type(vec3), intent(in) :: omega, alpha         !! of the link that carries the axis [rad/s, rad/s2]
        real(wp), intent(out) :: slide_rate2(lanes), turn_rate2(lanes)
        type(vec3) :: e, u_rate2, n_rate2, coupler_omega, coupler_alpha

        associate (u => group%u, n => group%n, sigma => group%sigma)
            u_rate2 = (alpha.cross.u) + (omega.cross.group%u_rate)
            e = group%w_rate - sigma*group%u_rate
            slide_rate2 = (n.dot.(group%sigma_rate*group%u_rate + sigma*u_rate2 - span_acceleration)) - (e.dot.e) &
                          + group%sigma_rate*(group%w_rate.dot.u)
            slide_rate2 = slide_rate2*group%per_slope
            ! n turns with the coupler; its part along u does not matter here.
            n_rate2 = span_acceleration + slide_rate2*group%y - (2*group%sigma_rate)*group%u_rate - sigma*u_rate2
            coupler_omega = omega + group%turn_rate*u
            coupler_alpha = alpha + group%turn_rate*group%u_rate
            n_rate2 = n_rate2 - (coupler_alpha.cross.n) - (coupler_omega.cross.(coupler_omega.cross.n))
            turn_rate2 = (n_rate2.dot.group%m)*group%per_radius2
        end associate
    end subroutine accelerate_csp
end module linkdyn_csp
