!> The lecture's kinematics modules under its names: points with their velocity and acceleration in and out, one call a
!> link or a pair of links, in the order in which the mechanism is walked.
!>
!> They are the lecture's road: closed forms, and for rates a 2x2 map for each pair of links. The engine goes another one, records
!> of the joints' constraints, and tests compare both. `mode` is the lecture's assembly mode, +1 or -1. Every argument holds `lanes`
!> samples side by side. The modules for mechanisms in space are in `linkdyn_lecture_spatial`.
!>
!> The coefficient forms FD_... need no formulas of their own. Accelerations are affine in the cranks' angular
!> accelerations, so the part without them (B, D, F) is the plain module's acceleration for the parts without them going
!> in; and the coefficients of a crank (A_k, C_k, E_k) are its acceleration for the coefficients going in at zero
!> velocity, where nothing but the linear part is left.
!>
!> **Source**: the lecture on systematic kinematics and dynamics of link mechanisms; where its text carries an error, the
!> corrected formula is used and named here.
module linkdyn_lecture
    use linkdyn_dyad_map, only: dyad_map, solve_dyad, drop_uncertain
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
    public :: fd_crank_input, fd_rrr_links, fd_prr_links, fd_coupler_point

    real(wp), parameter :: rounding = 4*epsilon(1.0_wp)    !! of positions given and of the closure, relative to their lengths

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
        type(vec2), allocatable :: of(:)       !! by number of the crank
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
    !> form of `linkdyn_rrr_dyad`, which keeps its digits near the dead points. At these points themselves rates are NaN.
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
        call drop_uncertain(rounding*(length_of(j1%p) + length_of(j2%p) + length1 + length2), &
                            spread(length1 + length2, 1, lanes), map)
        call solve_dyad(map, j2%dp - j1%dp, link1%dthe, link2%dthe)
        call solve_dyad(map, j2%ddp - j1%ddp + bias_rrr(arm1, arm2, link1%dthe, link2%dthe), link1%ddthe, link2%ddthe)
        joint = rigid_point(j1, arm1, link1)
    end subroutine rrr_links

    pure function length_of(v) result(length)
        type(vec2), intent(in) :: v
        real(wp) :: length(lanes)

        length = sqrt(v.dot.v)
    end function length_of

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
        call drop_uncertain(rounding*(length_of(pivot%p) + length_of(rail%p) + length_of(offset) + length), &
                            spread(1.0_wp, 1, lanes), map)
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

    !> Module FD_CRANK_INPUT: the tip of crank `k`, with its coefficients.
    !>
    !> Error of the text put right: in the footer the rate is squared, -(theta' + phi')^2, as in its coefficients.
    pure subroutine fd_crank_input(pivot, length, theta, base, k, pivot_of, base_of, tip, tip_of)
        type(point_motion), intent(in) :: pivot
        real(wp), intent(in) :: length                             !! [m]
        type(angle_motion), intent(in) :: theta, base
        integer, intent(in) :: k                                   !! number of this crank
        type(point_coefficients), intent(in) :: pivot_of
        type(angle_coefficients), intent(in) :: base_of
        type(point_motion), intent(out) :: tip                     !! accelerated as by cranks at constant rates
        type(point_coefficients), intent(out) :: tip_of
        type(angle_motion) :: turned
        type(point_motion) :: column
        integer :: i

        turned = theta
        turned%ddthe = 0
        call crank_input(point_rest(pivot, pivot_of), length, turned, angle_rest(base, base_of), tip)
        tip_of%rest = tip%ddp
        allocate (tip_of%of(size(pivot_of%of)))
        turned%dthe = 0
        do i = 1, size(tip_of%of)
            turned%ddthe = merge(1.0_wp, 0.0_wp, i == k)
            call crank_input(point_column(pivot, pivot_of, i), length, turned, angle_column(base, base_of, i), column)
            tip_of%of(i) = column%ddp
        end do
    end subroutine fd_crank_input

    !> Module FD_RRR_LINKS: the joint of two links, with its coefficients.
    !>
    !> Errors of the text put right: P_k and Q carry a minus between their terms, Q lacks the cube of DX below and has
    !> dDY DX twice, S has sin(beta) for sin(theta), and the rate (alpha' +- beta') is squared. With the map's 2x2 system
    !> none of P, Q, R, S is needed; the tests compare with the corrected ones.
    pure subroutine fd_rrr_links(j1, j2, length1, length2, mode, of1, of2, joint, joint_of, is_reachable)
        type(point_motion), intent(in) :: j1, j2
        real(wp), intent(in) :: length1, length2                   !! [m]
        integer, intent(in) :: mode                                !! +1 or -1
        type(point_coefficients), intent(in) :: of1, of2
        type(point_motion), intent(out) :: joint                   !! accelerated as by cranks at constant rates
        type(point_coefficients), intent(out) :: joint_of
        logical, intent(out) :: is_reachable(lanes)
        type(point_motion) :: column
        integer :: i

        call rrr_links(point_rest(j1, of1), point_rest(j2, of2), length1, length2, mode, joint, is_reachable)
        joint_of%rest = joint%ddp
        allocate (joint_of%of(size(of1%of)))
        do i = 1, size(joint_of%of)
            call rrr_links(point_column(j1, of1, i), point_column(j2, of2, i), length1, length2, mode, column, is_reachable)
            joint_of%of(i) = column%ddp
        end do
    end subroutine fd_rrr_links

    !> Module FD_PRR_LINKS: slider and joint of a link and a slider, with their coefficients. The text names the module
    !> and leaves its formulas out.
    pure subroutine fd_prr_links(pivot, length, rail, psi, xi, eta, mode, pivot_of, rail_of, psi_of, &
            slide, slider, joint, slide_of, slider_of, joint_of, is_reachable)
        type(point_motion), intent(in) :: pivot, rail
        type(angle_motion), intent(in) :: psi
        real(wp), intent(in) :: length, xi, eta                    !! [m]
        integer, intent(in) :: mode                                !! +1 or -1
        type(point_coefficients), intent(in) :: pivot_of, rail_of
        type(angle_coefficients), intent(in) :: psi_of
        type(slide_motion), intent(out) :: slide                   !! accelerated as by cranks at constant rates
        type(point_motion), intent(out) :: slider, joint           !! likewise
        type(angle_coefficients), intent(out) :: slide_of          !! of the slide's acceleration
        type(point_coefficients), intent(out) :: slider_of, joint_of
        logical, intent(out) :: is_reachable(lanes)
        type(slide_motion) :: slide_column
        type(point_motion) :: slider_column, joint_column
        integer :: i, n

        call prr_links(point_rest(pivot, pivot_of), length, point_rest(rail, rail_of), angle_rest(psi, psi_of), xi, eta, mode, &
                       slide, slider, joint, is_reachable)
        slide_of%rest = slide%ddv
        slider_of%rest = slider%ddp
        joint_of%rest = joint%ddp
        n = size(pivot_of%of)
        allocate (slide_of%of(lanes, n), slider_of%of(n), joint_of%of(n))
        do i = 1, n
            call prr_links(point_column(pivot, pivot_of, i), length, point_column(rail, rail_of, i), &
                           angle_column(psi, psi_of, i), xi, eta, mode, slide_column, slider_column, joint_column, is_reachable)
            slide_of%of(:, i) = slide_column%ddv
            slider_of%of(i) = slider_column%ddp
            joint_of%of(i) = joint_column%ddp
        end do
    end subroutine fd_prr_links

    !> Module FD_COUPLER_POINT: a point of the link through J1 and J2 and the link's angle, with their coefficients.
    !>
    !> Errors of the text put right: F_i is divided by the square of the distance J1J2, not by L_1^2; the F in B_C and D_C
    !> is F_i, and D_B is D_C.
    pure subroutine fd_coupler_point(j1, j2, xi, eta, of1, of2, point, angle, point_of, angle_of)
        type(point_motion), intent(in) :: j1, j2
        real(wp), intent(in) :: xi, eta                            !! [m]
        type(point_coefficients), intent(in) :: of1, of2
        type(point_motion), intent(out) :: point                   !! accelerated as by cranks at constant rates
        type(angle_motion), intent(out) :: angle                   !! likewise
        type(point_coefficients), intent(out) :: point_of
        type(angle_coefficients), intent(out) :: angle_of
        type(point_motion) :: column
        type(angle_motion) :: turn_column
        integer :: i, n

        call coupler_point(point_rest(j1, of1), point_rest(j2, of2), xi, eta, point, angle)
        point_of%rest = point%ddp
        angle_of%rest = angle%ddthe
        n = size(of1%of)
        allocate (point_of%of(n), angle_of%of(lanes, n))
        do i = 1, n
            call coupler_point(point_column(j1, of1, i), point_column(j2, of2, i), xi, eta, column, turn_column)
            point_of%of(i) = column%ddp
            angle_of%of(:, i) = turn_column%ddthe
        end do
    end subroutine fd_coupler_point

    !> The point, accelerated as by cranks at constant rates.
    pure function point_rest(point, of) result(rest)
        type(point_motion), intent(in) :: point
        type(point_coefficients), intent(in) :: of
        type(point_motion) :: rest

        rest = point_motion(point%p, point%dp, of%rest)
    end function point_rest

    pure function angle_rest(angle, of) result(rest)
        type(angle_motion), intent(in) :: angle
        type(angle_coefficients), intent(in) :: of
        type(angle_motion) :: rest

        rest = angle_motion(angle%the, angle%dthe, of%rest)
    end function angle_rest

    !> The point at zero velocity, accelerated by crank k alone.
    pure function point_column(point, of, k) result(column)
        type(point_motion), intent(in) :: point
        type(point_coefficients), intent(in) :: of
        integer, intent(in) :: k
        type(point_motion) :: column

        column = point_motion(point%p, zero_vec2(), of%of(k))
    end function point_column

    pure function angle_column(angle, of, k) result(column)
        type(angle_motion), intent(in) :: angle
        type(angle_coefficients), intent(in) :: of
        integer, intent(in) :: k
        type(angle_motion) :: column

        column%the = angle%the
        column%ddthe = of%of(:, k)
    end function angle_column
end module linkdyn_lecture
