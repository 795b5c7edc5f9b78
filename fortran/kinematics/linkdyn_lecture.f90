!> The lecture's kinematics modules under its names: points with their velocity and acceleration in and out, one call a
!> link or a pair of links, in the order in which the mechanism is walked.
!>
!> They are doors to the kernels of this folder, not a second implementation: positions come from the same closed forms,
!> velocities and accelerations from the same 2x2 maps as in the engine. `mode` is the lecture's assembly mode, +1 or -1.
!> Every argument holds `lanes` samples side by side.
!>
!> **Source**: the lecture on systematic kinematics and dynamics of link mechanisms; where its text carries an error, the
!> corrected formula is used and named here.
module linkdyn_lecture
    use linkdyn_dyad_map, only: dyad_map, solve_dyad
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_rrp_dyad, only: locate_rrp, map_rrp, bias_rrp
    use linkdyn_rrr_dyad, only: locate_rrr, map_rrr, bias_rrr
    use linkdyn_vec2, only: vec2, rot2, operator(+), operator(-), operator(*), operator(.dot.), operator(.cross.), &
        operator(.rotate.), perp, rot2_by_angle, direction_of, zero_vec2
    implicit none (type, external)
    private
    public :: point_motion, angle_motion, slide_motion, point_coefficients, angle_coefficients
    public :: crank_input, rrr_links, prr_links, coupler_point, link_angle
    public :: fd_crank_input, fd_rrr_links, fd_coupler_point

    !> The lecture's POINT: position, velocity, acceleration.
    type :: point_motion
        type(vec2) :: p, dp, ddp      !! [m, m/s, m/s2]
    end type point_motion

    !> The lecture's ANGLE.
    type :: angle_motion
        real(wp) :: the(lanes) = 0, dthe(lanes) = 0, ddthe(lanes) = 0    !! [rad, rad/s, rad/s2]
    end type angle_motion

    !> The lecture's VARIABLE: a slide.
    type :: slide_motion
        real(wp) :: v(lanes) = 0, dv(lanes) = 0, ddv(lanes) = 0          !! [m, m/s, m/s2]
    end type slide_motion

    !> Acceleration of a point, linear in the cranks' angular accelerations: the lecture's X" = sum A_k theta_k" + B and
    !> Y" = sum C_k theta_k" + D. `of(k)` is (A_k, C_k), `rest` is (B, D).
    type :: point_coefficients
        type(vec2), allocatable :: of(:)
        type(vec2) :: rest
    end type point_coefficients

    !> Angular acceleration: the lecture's phi" = sum E_k theta_k" + F.
    type :: angle_coefficients
        real(wp), allocatable :: of(:, :)      !! (lane, k)
        real(wp) :: rest(lanes) = 0
    end type angle_coefficients

contains

    ! ---------------------------------------------------------------- motion

    !> Module crank_input: the tip of a crank of given length on a pivot that may move. The crank's angle counts from that
    !> of its base link: theta + phi_base.
    pure subroutine crank_input(pivot, length, theta, base, tip)
        type(point_motion), intent(in) :: pivot
        real(wp), intent(in) :: length               !! [m]
        type(angle_motion), intent(in) :: theta
        type(angle_motion), intent(in) :: base       !! angle of the link that carries the pivot
        type(point_motion), intent(out) :: tip
        type(angle_motion) :: total
        type(vec2) :: arm

        total = sum_of(theta, base)
        arm = length*direction_of(rot2_by_angle(total%the))
        tip = rigid_point(pivot, arm, total)
    end subroutine crank_input

    pure function sum_of(a, b) result(c)
        type(angle_motion), intent(in) :: a, b
        type(angle_motion) :: c

        c%the = a%the + b%the
        c%dthe = a%dthe + b%dthe
        c%ddthe = a%ddthe + b%ddthe
    end function sum_of

    !> A point of a link from another and the link's angular motion.
    pure function rigid_point(from, arm, angle) result(point)
        type(point_motion), intent(in) :: from
        type(vec2), intent(in) :: arm
        type(angle_motion), intent(in) :: angle
        type(point_motion) :: point

        point%p = from%p + arm
        point%dp = from%dp + angle%dthe*perp(arm)
        point%ddp = from%ddp + angle%ddthe*perp(arm) - angle%dthe**2*arm
    end function rigid_point

    !> Module RRR_links: joint of two links of lengths L1 (from J1) and L2 (from J2). Mode +1: to the left of the way from
    !> J1 to J2.
    !>
    !> The lecture's closure by angles, its tan^-1(DY/DX) read as the two-argument arctangent, is replaced by the factored
    !> form of `linkdyn_rrr_dyad`, which keeps its digits near the dead points.
    pure subroutine rrr_links(j1, j2, length1, length2, mode, joint, is_reachable)
        type(point_motion), intent(in) :: j1, j2
        real(wp), intent(in) :: length1, length2     !! [m]
        integer, intent(in) :: mode                  !! +1 or -1
        type(point_motion), intent(out) :: joint
        logical, intent(out) :: is_reachable(lanes)
        type(vec2) :: arm1, arm2
        type(dyad_map) :: map
        type(angle_motion) :: link1, link2

        call locate_rrr(j2%p - j1%p, length1, length2, branch_of(mode), arm1, arm2, is_reachable)
        map = map_rrr(arm1, arm2)
        call solve_dyad(map, j2%dp - j1%dp, link1%dthe, link2%dthe)
        call solve_dyad(map, j2%ddp - j1%ddp + bias_rrr(arm1, arm2, link1%dthe, link2%dthe), link1%ddthe, link2%ddthe)
        joint = rigid_point(j1, arm1, link1)
    end subroutine rrr_links

    pure function branch_of(mode) result(branch)
        integer, intent(in) :: mode
        real(wp) :: branch(lanes)

        branch = real(mode, wp)
    end function branch_of

    !> Module PRR_links: a link of given length from `pivot` to the joint that a slider carries at (xi, eta) of its own
    !> axes, the rail passing through the point `rail` at the angle psi. Mode +1: the joint lies forward of the pivot,
    !> along the rail.
    pure subroutine prr_links(pivot, length, rail, psi, xi, eta, mode, slide, slider, joint, is_reachable)
        type(point_motion), intent(in) :: pivot
        real(wp), intent(in) :: length               !! [m]
        type(point_motion), intent(in) :: rail
        type(angle_motion), intent(in) :: psi
        real(wp), intent(in) :: xi, eta              !! [m]
        integer, intent(in) :: mode                  !! +1 or -1
        type(slide_motion), intent(out) :: slide     !! from the point of the rail to the slider
        type(point_motion), intent(out) :: slider, joint
        logical, intent(out) :: is_reachable(lanes)
        type(rot2) :: turn
        type(vec2) :: u, offset, arm, gap
        type(point_motion) :: base
        type(angle_motion) :: link
        type(dyad_map) :: map

        turn = rot2_by_angle(psi%the)
        u = direction_of(turn)
        offset = turn.rotate.[xi, eta]
        call locate_rrp(rail%p + offset - pivot%p, u, length, branch_of(mode), arm, slide%v, is_reachable)
        map = map_rrp(arm, u)
        base = rigid_point(rail, offset + slide%v*u, psi)
        call solve_dyad(map, base%dp - pivot%dp, link%dthe, slide%dv)
        gap = base%ddp - pivot%ddp + bias_rrp(arm, u, link%dthe, psi%dthe, slide%dv)
        call solve_dyad(map, gap, link%ddthe, slide%ddv)
        joint = rigid_point(pivot, arm, link)
        slider = rigid_point(joint, -offset, psi)
    end subroutine prr_links

    !> Module coupler_point: the point (xi, eta) of the link through J1 and J2, origin J1, xi towards J2; and the link's
    !> angle.
    pure subroutine coupler_point(j1, j2, xi, eta, point, angle)
        type(point_motion), intent(in) :: j1, j2
        real(wp), intent(in) :: xi, eta              !! [m]
        type(point_motion), intent(out) :: point
        type(angle_motion), intent(out) :: angle
        type(vec2) :: d
        real(wp) :: scale(lanes)

        call link_angle(j1, j2, angle)
        d = j2%p - j1%p
        scale = 1/sqrt(d.dot.d)
        point = rigid_point(j1, (xi*scale)*d + (eta*scale)*perp(d), angle)
    end subroutine coupler_point

    !> Module link_angle: angle of the line from J1 to J2, by the two-argument arctangent.
    pure subroutine link_angle(j1, j2, angle)
        type(point_motion), intent(in) :: j1, j2
        type(angle_motion), intent(out) :: angle
        type(vec2) :: d
        real(wp) :: inverse_square(lanes)

        d = j2%p - j1%p
        inverse_square = 1/(d.dot.d)
        angle%the = atan2(d%y, d%x)
        ! The distance is constant: d' = theta' perp(d), d" = theta" perp(d) - theta'^2 d.
        angle%dthe = inverse_square*(d.cross.(j2%dp - j1%dp))
        angle%ddthe = inverse_square*(d.cross.(j2%ddp - j1%ddp))
    end subroutine link_angle

    ! ---------------------------------------------------------------- coefficients of accelerations

    !> Module FD_CRANK_INPUT: coefficients of the tip of crank `k`. On a moving base its coefficients of phi_base" enter
    !> every column, and the rate in the footer is squared: -(theta' + phi_base')^2.
    pure subroutine fd_crank_input(pivot, length, theta, base, k, pivot_of, base_of, tip_of)
        type(point_motion), intent(in) :: pivot
        real(wp), intent(in) :: length
        type(angle_motion), intent(in) :: theta, base
        integer, intent(in) :: k                                   !! number of this crank
        type(point_coefficients), intent(in) :: pivot_of
        type(angle_coefficients), intent(in) :: base_of
        type(point_coefficients), intent(out) :: tip_of
        type(angle_coefficients) :: angle_of
        type(angle_motion) :: total

        total = sum_of(theta, base)
        angle_of = base_of
        angle_of%of(:, k) = angle_of%of(:, k) + 1
        tip_of = rigid_coefficients(pivot_of, length*direction_of(rot2_by_angle(total%the)), total%dthe, angle_of)
    end subroutine fd_crank_input

    pure function rigid_coefficients(from, arm, rate, angle_of) result(point_of)
        type(point_coefficients), intent(in) :: from
        type(vec2), intent(in) :: arm
        real(wp), intent(in) :: rate(lanes)                        !! angular velocity of the link [rad/s]
        type(angle_coefficients), intent(in) :: angle_of
        type(point_coefficients) :: point_of
        integer :: k

        allocate (point_of%of(size(from%of)))
        do k = 1, size(from%of)
            point_of%of(k) = from%of(k) + angle_of%of(:, k)*perp(arm)
        end do
        point_of%rest = from%rest + angle_of%rest*perp(arm) - rate**2*arm
    end function rigid_coefficients

    !> Module FD_RRR_LINKS: coefficients of the joint.
    !>
    !> Errors of the text put right: P_k and Q carry a minus between their terms, S has sin(beta) for sin(theta), and the
    !> rate (alpha' +- beta') is squared. The 2x2 map gives the same coefficients without P, Q, R, S.
    pure subroutine fd_rrr_links(j1, j2, length1, length2, mode, of1, of2, joint, joint_of, is_reachable)
        type(point_motion), intent(in) :: j1, j2
        real(wp), intent(in) :: length1, length2
        integer, intent(in) :: mode
        type(point_coefficients), intent(in) :: of1, of2
        type(point_motion), intent(out) :: joint                   !! position and velocity; no acceleration is known
        type(point_coefficients), intent(out) :: joint_of
        logical, intent(out) :: is_reachable(lanes)
        type(vec2) :: arm1, arm2
        type(dyad_map) :: map
        type(angle_motion) :: link1
        type(angle_coefficients) :: angle_of
        real(wp) :: rate2(lanes)
        integer :: k

        call locate_rrr(j2%p - j1%p, length1, length2, branch_of(mode), arm1, arm2, is_reachable)
        map = map_rrr(arm1, arm2)
        call solve_dyad(map, j2%dp - j1%dp, link1%dthe, rate2)
        joint = rigid_point(j1, arm1, link1)
        joint%ddp = zero_vec2()
        allocate (angle_of%of(lanes, size(of1%of)))
        call solve_dyad(map, of2%rest - of1%rest + bias_rrr(arm1, arm2, link1%dthe, rate2), angle_of%rest, rate2)
        do k = 1, size(of1%of)
            call solve_dyad(map, of2%of(k) - of1%of(k), angle_of%of(:, k), rate2)
        end do
        joint_of = rigid_coefficients(of1, arm1, link1%dthe, angle_of)
    end subroutine fd_rrr_links

    !> Module FD_COUPLER_POINT: coefficients of a point of the link through J1 and J2, and of the link's angle.
    !>
    !> Error of the text put right: F_i is divided by the square of the distance J1J2, not by L_1^2.
    pure subroutine fd_coupler_point(j1, j2, of1, of2, xi, eta, point_of, angle_of)
        type(point_motion), intent(in) :: j1, j2
        type(point_coefficients), intent(in) :: of1, of2
        real(wp), intent(in) :: xi, eta
        type(point_coefficients), intent(out) :: point_of
        type(angle_coefficients), intent(out) :: angle_of
        type(vec2) :: d
        real(wp) :: inverse_square(lanes), rate(lanes), scale(lanes)
        integer :: k

        d = j2%p - j1%p
        inverse_square = 1/(d.dot.d)
        rate = inverse_square*(d.cross.(j2%dp - j1%dp))
        allocate (angle_of%of(lanes, size(of1%of)))
        do k = 1, size(of1%of)
            angle_of%of(:, k) = inverse_square*(d.cross.(of2%of(k) - of1%of(k)))
        end do
        angle_of%rest = inverse_square*(d.cross.(of2%rest - of1%rest))
        scale = sqrt(inverse_square)
        point_of = rigid_coefficients(of1, (xi*scale)*d + (eta*scale)*perp(d), rate, angle_of)
    end subroutine fd_coupler_point
end module linkdyn_lecture
