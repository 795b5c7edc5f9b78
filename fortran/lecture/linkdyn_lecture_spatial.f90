!> The lecture's kinematics modules for mechanisms in space, under its names: S_CRANK_INPUT, CSP_LINKS, S_COUPLER_POINT and
!> their coefficient forms FD_...
!>
!> Doors to the kernels of this folder, as in `linkdyn_lecture`, and made the same way: a coefficient form calls the plain one.
!> As in the lecture, angular velocities and their derivatives are in the axes of the link that they belong to.
!>
!> **Source**: the lecture on systematic kinematics and dynamics of link mechanisms; where its text carries an error, the
!> corrected formula is used and named here.
module linkdyn_lecture_spatial
    use linkdyn_csp, only: csp_group, locate_csp, drop_uncertain_rates, move_csp, accelerate_csp
    use linkdyn_joint_motion, only: relative_motion, relative_by_variables, turn_frame
    use linkdyn_joint_table, only: joint_revolute
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_lecture, only: angle_motion
    use linkdyn_point, only: point_velocity, point_acceleration
    use linkdyn_vec3, only: vec3, mat3, operator(+), operator(-), operator(*), operator(.dot.), operator(.cross.), &
        operator(.rotate.), operator(.unrotate.), zero_vec3
    implicit none (type, external)
    private
    public :: s_point_motion, attitude_motion, vector_coefficients
    public :: s_crank_input, csp_links, s_coupler_point
    public :: fd_s_crank_input, fd_csp_links, fd_s_coupler_point

    real(wp), parameter :: rounding = 4*epsilon(1.0_wp)    !! of positions given and of the closure, relative to their lengths

    !> A point in space.
    type :: s_point_motion
        type(vec3) :: p, dp, ddp                  !! world axes [m, m/s, m/s2]
    end type s_point_motion

    !> Attitude of a link or of axes fixed in it.
    type :: attitude_motion
        type(mat3) :: r                           !! the lecture's [R_.]: from the link's axes to world axes
        type(vec3) :: omega, domega               !! angular velocity and its derivative, link axes [rad/s, rad/s2]
    end type attitude_motion

    !> Coefficients of a vector: of the acceleration of a point, the lecture's [C_.] and d_., or of an angular
    !> acceleration, [C_omega.] and d_omega.
    type :: vector_coefficients
        type(vec3), allocatable :: of(:)          !! by number of the crank
        type(vec3) :: rest
    end type vector_coefficients

contains

    ! ---------------------------------------------------------------- motion

    !> Module S_CRANK_INPUT: the point B of a crank that turns by theta about the z axis of a joint R.
    pure subroutine s_crank_input(joint, frame, theta, b, r_ab, point, attitude)
        type(s_point_motion), intent(in) :: joint       !! R
        type(attitude_motion), intent(in) :: frame      !! [R_R]: the joint's axes in the link before
        type(angle_motion), intent(in) :: theta
        real(wp), intent(in) :: b(3)                    !! from R to B, crank axes [R_R][theta] [m]
        real(wp), intent(in) :: r_ab(3, 3)              !! columns: axes fixed at B, in crank axes
        type(s_point_motion), intent(out) :: point
        type(attitude_motion), intent(out) :: attitude  !! [R_B]
        type(relative_motion) :: motion
        type(vec3) :: carrier_omega
        real(wp), dimension(lanes, 3) :: q, qd, qdd

        q = 0
        qd = 0
        qdd = 0
        q(:, 1) = theta%the
        qd(:, 1) = theta%dthe
        qdd(:, 1) = theta%ddthe
        call relative_by_variables(joint_revolute, frame%r, q, qd, qdd, motion)
        carrier_omega = frame%r.rotate.frame%omega
        motion%alpha = motion%alpha + (frame%r.rotate.frame%domega) + (carrier_omega.cross.motion%omega)
        motion%omega = motion%omega + carrier_omega
        point = carried_point(joint, motion%frame.rotate.b, motion%omega, motion%alpha)
        attitude = attitude_from(turn_frame(motion%frame, r_ab), motion%omega, motion%alpha)
    end subroutine s_crank_input

    !> A point of a link from another; all in world axes.
    pure function carried_point(from, arm, omega, alpha) result(point)
        type(s_point_motion), intent(in) :: from
        type(vec3), intent(in) :: arm, omega, alpha
        type(s_point_motion) :: point

        point%p = from%p + arm
        point%dp = point_velocity(from%dp, omega, arm)
        point%ddp = point_acceleration(from%ddp, omega, alpha, arm)
    end function carried_point

    pure function attitude_from(r, omega, alpha) result(attitude)
        type(mat3), intent(in) :: r
        type(vec3), intent(in) :: omega, alpha          !! world axes
        type(attitude_motion) :: attitude

        attitude = attitude_motion(r, r.unrotate.omega, r.unrotate.alpha)
    end function attitude_from

    !> Module CSP_LINKS: a coupler that turns about and slides along a moving axis, and an output that slides along another,
    !> joined by a spherical joint S.
    !>
    !> Mode +1: the farther meeting of the slide's line with the cylinder on which S lies, along the slide; -1: the nearer.
    pure subroutine csp_links(axis_point, axis_frame, slide_point, slide_frame, s_c, s_p, mode, &
            c_point, c_frame, s_point, p_point, is_reachable)
        type(s_point_motion), intent(in) :: axis_point     !! L_C, on the axis of the cylindrical joint
        type(attitude_motion), intent(in) :: axis_frame    !! [R_LC]: z is that axis
        type(s_point_motion), intent(in) :: slide_point    !! L_P, on the line of the slide
        type(attitude_motion), intent(in) :: slide_frame   !! [R_LP]: y is the direction of the slide
        real(wp), intent(in) :: s_c(3)                     !! from C to S, coupler axes: z along the axis [m]
        real(wp), intent(in) :: s_p(3)                     !! from P to S, output axes [m]
        integer, intent(in) :: mode                        !! +1 or -1
        type(s_point_motion), intent(out) :: c_point       !! C, of the coupler
        type(attitude_motion), intent(out) :: c_frame      !! [R_C]
        type(s_point_motion), intent(out) :: s_point       !! S
        type(s_point_motion), intent(out) :: p_point       !! P; the output has the attitude [R_LP]
        logical, intent(out) :: is_reachable(lanes)
        type(csp_group) :: group
        type(s_point_motion) :: held
        type(vec3) :: omega_c, alpha_c, omega_p, alpha_p, to_s, arm
        real(wp) :: slide_rate2(lanes), turn_rate2(lanes)
        type(mat3) :: r

        omega_c = axis_frame%r.rotate.axis_frame%omega
        alpha_c = axis_frame%r.rotate.axis_frame%domega
        omega_p = slide_frame%r.rotate.slide_frame%omega
        alpha_p = slide_frame%r.rotate.slide_frame%domega
        to_s = slide_frame%r.rotate.s_p
        call locate_csp(slide_point%p + to_s - axis_point%p, axis_frame%r%z, slide_frame%r%y, norm2(s_c(:2)), &
                        spread(real(mode, wp), 1, lanes), group)
        is_reachable = abs(group%slide) <= huge(1.0_wp)
        call drop_uncertain_rates(rounding*(length_of(slide_point%p) + length_of(axis_point%p) + norm2(s_c) + norm2(s_p)), group)

        ! S as a point of the link that carries the slide, then with the slide's own motion and its Coriolis part.
        held = carried_point(slide_point, to_s + group%slide*group%y, omega_p, alpha_p)
        call move_csp(held%dp - axis_point%dp, omega_c, group)
        held%ddp = held%ddp + (2*group%slide_rate)*(omega_p.cross.group%y)
        call accelerate_csp(group, held%ddp - axis_point%ddp, omega_c, alpha_c, slide_rate2, turn_rate2)
        s_point%p = held%p
        s_point%dp = held%dp + group%slide_rate*group%y
        s_point%ddp = held%ddp + slide_rate2*group%y

        r%x = group%per_radius2*(s_c(1)*group%n - s_c(2)*group%m)
        r%y = group%per_radius2*(s_c(2)*group%n + s_c(1)*group%m)
        r%z = group%u
        alpha_c = alpha_c + turn_rate2*group%u + group%turn_rate*group%u_rate
        omega_c = omega_c + group%turn_rate*group%u
        c_frame = attitude_from(r, omega_c, alpha_c)
        arm = (-1.0_wp)*(r.rotate.s_c)
        c_point = carried_point(s_point, arm, omega_c, alpha_c)
        p_point = carried_point(s_point, (-1.0_wp)*to_s, omega_p, alpha_p)
    end subroutine csp_links

    pure function length_of(v) result(length)
        type(vec3), intent(in) :: v
        real(wp) :: length(lanes)

        length = sqrt(v.dot.v)
    end function length_of

    !> Module S_COUPLER_POINT: a point of a link from another, with axes of its own.
    pure subroutine s_coupler_point(origin, frame, m, r_mg, point, attitude)
        type(s_point_motion), intent(in) :: origin      !! M
        type(attitude_motion), intent(in) :: frame      !! [R_M]
        real(wp), intent(in) :: m(3)                    !! from M to G, axes [R_M] [m]
        real(wp), intent(in) :: r_mg(3, 3)              !! columns: axes fixed at G, in axes [R_M]
        type(s_point_motion), intent(out) :: point      !! G
        type(attitude_motion), intent(out) :: attitude  !! [R_G]
        type(vec3) :: omega, alpha

        omega = frame%r.rotate.frame%omega
        alpha = frame%r.rotate.frame%domega
        point = carried_point(origin, frame%r.rotate.m, omega, alpha)
        attitude = attitude_from(turn_frame(frame%r, r_mg), omega, alpha)
    end subroutine s_coupler_point

    ! ---------------------------------------------------------------- coefficients of accelerations

    !> Module FD_S_CRANK_INPUT: the point B of crank `k`, with its coefficients.
    !>
    !> Errors of the text put right: d_B is short of d_R; [R_AB] is missing in [d_RB]; the angular terms want
    !> [R_AB]^T ([theta]^T C_omegaR + e_z) with e_z in C, and [theta']^T omega_R in d.
    pure subroutine fd_s_crank_input(joint, frame, theta, b, r_ab, k, joint_of, frame_of, point, attitude, point_of, attitude_of)
        type(s_point_motion), intent(in) :: joint
        type(attitude_motion), intent(in) :: frame
        type(angle_motion), intent(in) :: theta
        real(wp), intent(in) :: b(3), r_ab(3, 3)
        integer, intent(in) :: k                                   !! number of this crank
        type(vector_coefficients), intent(in) :: joint_of, frame_of
        type(s_point_motion), intent(out) :: point                 !! accelerated as by cranks at constant rates
        type(attitude_motion), intent(out) :: attitude             !! likewise
        type(vector_coefficients), intent(out) :: point_of, attitude_of
        type(s_point_motion) :: column
        type(attitude_motion) :: turn_column
        type(angle_motion) :: turned
        integer :: i

        turned = theta
        turned%ddthe = 0
        call s_crank_input(point_rest(joint, joint_of), attitude_rest(frame, frame_of), turned, b, r_ab, point, attitude)
        call start_coefficients(point%ddp, size(joint_of%of), point_of)
        call start_coefficients(attitude%domega, size(joint_of%of), attitude_of)
        turned%dthe = 0
        do i = 1, size(joint_of%of)
            turned%ddthe = merge(1.0_wp, 0.0_wp, i == k)
            call s_crank_input(point_column(joint, joint_of, i), attitude_column(frame, frame_of, i), turned, b, r_ab, &
                               column, turn_column)
            point_of%of(i) = column%ddp
            attitude_of%of(i) = turn_column%domega
        end do
    end subroutine fd_s_crank_input

    !> Module FD_CSP_LINKS: C, S and P with their coefficients. The text names the module and leaves its formulas out; they
    !> are derived in `linkdyn_csp`.
    pure subroutine fd_csp_links(axis_point, axis_frame, slide_point, slide_frame, s_c, s_p, mode, &
            axis_point_of, axis_frame_of, slide_point_of, slide_frame_of, &
            c_point, c_frame, s_point, p_point, c_point_of, c_frame_of, s_point_of, p_point_of, is_reachable)
        type(s_point_motion), intent(in) :: axis_point, slide_point
        type(attitude_motion), intent(in) :: axis_frame, slide_frame
        real(wp), intent(in) :: s_c(3), s_p(3)
        integer, intent(in) :: mode                                !! +1 or -1
        type(vector_coefficients), intent(in) :: axis_point_of, axis_frame_of, slide_point_of, slide_frame_of
        type(s_point_motion), intent(out) :: c_point, s_point, p_point    !! accelerated as by cranks at constant rates
        type(attitude_motion), intent(out) :: c_frame              !! likewise
        type(vector_coefficients), intent(out) :: c_point_of, c_frame_of, s_point_of, p_point_of
        logical, intent(out) :: is_reachable(lanes)
        type(s_point_motion) :: c_column, s_column, p_column
        type(attitude_motion) :: turn_column
        integer :: i, n

        call csp_links(point_rest(axis_point, axis_point_of), attitude_rest(axis_frame, axis_frame_of), &
                       point_rest(slide_point, slide_point_of), attitude_rest(slide_frame, slide_frame_of), s_c, s_p, mode, &
                       c_point, c_frame, s_point, p_point, is_reachable)
        n = size(axis_point_of%of)
        call start_coefficients(c_point%ddp, n, c_point_of)
        call start_coefficients(c_frame%domega, n, c_frame_of)
        call start_coefficients(s_point%ddp, n, s_point_of)
        call start_coefficients(p_point%ddp, n, p_point_of)
        do i = 1, n
            call csp_links(point_column(axis_point, axis_point_of, i), attitude_column(axis_frame, axis_frame_of, i), &
                           point_column(slide_point, slide_point_of, i), attitude_column(slide_frame, slide_frame_of, i), &
                           s_c, s_p, mode, c_column, turn_column, s_column, p_column, is_reachable)
            c_point_of%of(i) = c_column%ddp
            c_frame_of%of(i) = turn_column%domega
            s_point_of%of(i) = s_column%ddp
            p_point_of%of(i) = p_column%ddp
        end do
    end subroutine fd_csp_links

    !> Module FD_S_COUPLER_POINT: a point of a link, with its coefficients. Right as printed, in link axes.
    pure subroutine fd_s_coupler_point(origin, frame, m, r_mg, origin_of, frame_of, point, attitude, point_of, attitude_of)
        type(s_point_motion), intent(in) :: origin
        type(attitude_motion), intent(in) :: frame
        real(wp), intent(in) :: m(3), r_mg(3, 3)
        type(vector_coefficients), intent(in) :: origin_of, frame_of
        type(s_point_motion), intent(out) :: point                 !! accelerated as by cranks at constant rates
        type(attitude_motion), intent(out) :: attitude             !! likewise
        type(vector_coefficients), intent(out) :: point_of, attitude_of
        type(s_point_motion) :: column
        type(attitude_motion) :: turn_column
        integer :: i

        call s_coupler_point(point_rest(origin, origin_of), attitude_rest(frame, frame_of), m, r_mg, point, attitude)
        call start_coefficients(point%ddp, size(origin_of%of), point_of)
        call start_coefficients(attitude%domega, size(origin_of%of), attitude_of)
        do i = 1, size(origin_of%of)
            call s_coupler_point(point_column(origin, origin_of, i), attitude_column(frame, frame_of, i), m, r_mg, &
                                 column, turn_column)
            point_of%of(i) = column%ddp
            attitude_of%of(i) = turn_column%domega
        end do
    end subroutine fd_s_coupler_point

    pure subroutine start_coefficients(rest, n, of)
        type(vec3), intent(in) :: rest
        integer, intent(in) :: n
        type(vector_coefficients), intent(out) :: of

        of%rest = rest
        allocate (of%of(n))
    end subroutine start_coefficients

    !> The point, accelerated as by cranks at constant rates.
    pure function point_rest(point, of) result(rest)
        type(s_point_motion), intent(in) :: point
        type(vector_coefficients), intent(in) :: of
        type(s_point_motion) :: rest

        rest = s_point_motion(point%p, point%dp, of%rest)
    end function point_rest

    pure function attitude_rest(frame, of) result(rest)
        type(attitude_motion), intent(in) :: frame
        type(vector_coefficients), intent(in) :: of
        type(attitude_motion) :: rest

        rest = attitude_motion(frame%r, frame%omega, of%rest)
    end function attitude_rest

    !> The point at zero velocity, accelerated by crank k alone.
    pure function point_column(point, of, k) result(column)
        type(s_point_motion), intent(in) :: point
        type(vector_coefficients), intent(in) :: of
        integer, intent(in) :: k
        type(s_point_motion) :: column

        column = s_point_motion(point%p, zero_vec3(), of%of(k))
    end function point_column

    pure function attitude_column(frame, of, k) result(column)
        type(attitude_motion), intent(in) :: frame
        type(vector_coefficients), intent(in) :: of
        integer, intent(in) :: k
        type(attitude_motion) :: column

        column = attitude_motion(frame%r, zero_vec3(), of%of(k))
    end function attitude_column
end module linkdyn_lecture_spatial
