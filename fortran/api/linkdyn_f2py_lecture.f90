!> Flat layer for f2py: the lecture's modules, block by block over n samples.
!>
!> Samples come last (C order in Python: first). A point is (x, y, their rates, their accelerations), an angle or a slide
!> (value, rate, acceleration); in space a point has nine numbers, an attitude 15: rotation matrix by rows, angular velocity,
!> its derivative. Coefficients stand in columns: first the part without the cranks, then crank by crank. What cannot be
!> assembled is NaN.
!> Kinds here are c_double and c_int only: f2py takes any other real kind for a C float.
module linkdyn_f2py_lecture
    use, intrinsic :: iso_c_binding, only: c_double, c_int
    use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan
    use linkdyn_lane_count, only: lanes
    use linkdyn_lecture, only: point_motion, angle_motion, slide_motion, point_coefficients, angle_coefficients, &
        crank_input, rrr_links, prr_links, coupler_point, link_angle, &
        fd_crank_input, fd_rrr_links, fd_prr_links, fd_coupler_point
    use linkdyn_lecture_spatial, only: s_point_motion, attitude_motion, vector_coefficients, &
        s_crank_input, csp_links, s_coupler_point, fd_s_crank_input, fd_csp_links, fd_s_coupler_point
    use linkdyn_vec3, only: vec3
    implicit none
    private
    public :: api_crank_input, api_rrr_links, api_prr_links, api_coupler_point, api_link_angle
    public :: api_fd_crank_input, api_fd_rrr_links, api_fd_prr_links, api_fd_coupler_point
    public :: api_s_crank_input, api_csp_links, api_s_coupler_point
    public :: api_fd_s_crank_input, api_fd_csp_links, api_fd_s_coupler_point

contains

    ! ---------------------------------------------------------------- planar

    subroutine api_crank_input(n, pivot, length, theta, base, tip)
        integer(c_int), intent(in) :: n
        real(c_double), intent(in) :: pivot(6, n), length, theta(3, n), base(3, n)
        real(c_double), intent(out) :: tip(6, n)
        type(point_motion) :: tip_block
        integer :: i

        do i = 1, n, lanes
            call crank_input(point_at(pivot, i), length, angle_at(theta, i), angle_at(base, i), tip_block)
            call put_point(tip_block, i, tip)
        end do
    end subroutine api_crank_input

    subroutine api_rrr_links(n, j1, j2, length1, length2, mode, joint)
        integer(c_int), intent(in) :: n, mode
        real(c_double), intent(in) :: j1(6, n), j2(6, n), length1, length2
        real(c_double), intent(out) :: joint(6, n)
        type(point_motion) :: joint_block
        logical :: is_reachable(lanes)
        integer :: i

        do i = 1, n, lanes
            call rrr_links(point_at(j1, i), point_at(j2, i), length1, length2, int(mode), joint_block, is_reachable)
            call put_point(joint_block, i, joint)
            call drop_lanes(is_reachable, i, joint)
        end do
    end subroutine api_rrr_links

    subroutine api_prr_links(n, pivot, length, rail, psi, xi, eta, mode, slide, slider, joint)
        integer(c_int), intent(in) :: n, mode
        real(c_double), intent(in) :: pivot(6, n), length, rail(6, n), psi(3, n), xi, eta
        real(c_double), intent(out) :: slide(3, n), slider(6, n), joint(6, n)
        type(slide_motion) :: slide_block
        type(point_motion) :: slider_block, joint_block
        logical :: is_reachable(lanes)
        integer :: i

        do i = 1, n, lanes
            call prr_links(point_at(pivot, i), length, point_at(rail, i), angle_at(psi, i), xi, eta, int(mode), &
                slide_block, slider_block, joint_block, is_reachable)
            call put_slide(slide_block, i, slide)
            call put_point(slider_block, i, slider)
            call put_point(joint_block, i, joint)
            call drop_lanes(is_reachable, i, slide)
            call drop_lanes(is_reachable, i, slider)
            call drop_lanes(is_reachable, i, joint)
        end do
    end subroutine api_prr_links

    subroutine api_coupler_point(n, j1, j2, xi, eta, point, angle)
        integer(c_int), intent(in) :: n
        real(c_double), intent(in) :: j1(6, n), j2(6, n), xi, eta
        real(c_double), intent(out) :: point(6, n), angle(3, n)
        type(point_motion) :: point_block
        type(angle_motion) :: angle_block
        integer :: i

        do i = 1, n, lanes
            call coupler_point(point_at(j1, i), point_at(j2, i), xi, eta, point_block, angle_block)
            call put_point(point_block, i, point)
            call put_angle(angle_block, i, angle)
        end do
    end subroutine api_coupler_point

    subroutine api_link_angle(n, j1, j2, angle)
        integer(c_int), intent(in) :: n
        real(c_double), intent(in) :: j1(6, n), j2(6, n)
        real(c_double), intent(out) :: angle(3, n)
        type(angle_motion) :: angle_block
        integer :: i

        do i = 1, n, lanes
            call link_angle(point_at(j1, i), point_at(j2, i), angle_block)
            call put_angle(angle_block, i, angle)
        end do
    end subroutine api_link_angle

    subroutine api_fd_crank_input(n, n_column, pivot, length, theta, base, crank, pivot_of, base_of, tip, tip_of)
        integer(c_int), intent(in) :: n, n_column, crank     ! number of the crank, from 1
        real(c_double), intent(in) :: pivot(6, n), length, theta(3, n), base(3, n)
        real(c_double), intent(in) :: pivot_of(2, n_column, n), base_of(n_column, n)
        real(c_double), intent(out) :: tip(6, n), tip_of(2, n_column, n)
        type(point_motion) :: tip_block
        type(point_coefficients) :: tip_of_block
        integer :: i

        do i = 1, n, lanes
            call fd_crank_input(point_at(pivot, i), length, angle_at(theta, i), angle_at(base, i), int(crank), &
                point_of_at(pivot_of, i), angle_of_at(base_of, i), tip_block, tip_of_block)
            call put_point(tip_block, i, tip)
            call put_point_of(tip_of_block, i, tip_of)
        end do
    end subroutine api_fd_crank_input

    subroutine api_fd_rrr_links(n, n_column, j1, j2, length1, length2, mode, of1, of2, joint, joint_of)
        integer(c_int), intent(in) :: n, n_column, mode
        real(c_double), intent(in) :: j1(6, n), j2(6, n), length1, length2, of1(2, n_column, n), of2(2, n_column, n)
        real(c_double), intent(out) :: joint(6, n), joint_of(2, n_column, n)
        type(point_motion) :: joint_block
        type(point_coefficients) :: joint_of_block
        logical :: is_reachable(lanes)
        integer :: i

        do i = 1, n, lanes
            call fd_rrr_links(point_at(j1, i), point_at(j2, i), length1, length2, int(mode), &
                point_of_at(of1, i), point_of_at(of2, i), joint_block, joint_of_block, is_reachable)
            call put_point(joint_block, i, joint)
            call put_point_of(joint_of_block, i, joint_of)
            call drop_lanes(is_reachable, i, joint)
            call drop_columns(is_reachable, i, joint_of)
        end do
    end subroutine api_fd_rrr_links

    subroutine api_fd_prr_links(n, n_column, pivot, length, rail, psi, xi, eta, mode, pivot_of, rail_of, psi_of, &
            slide, slider, joint, slide_of, slider_of, joint_of)
        integer(c_int), intent(in) :: n, n_column, mode
        real(c_double), intent(in) :: pivot(6, n), length, rail(6, n), psi(3, n), xi, eta
        real(c_double), intent(in) :: pivot_of(2, n_column, n), rail_of(2, n_column, n), psi_of(n_column, n)
        real(c_double), intent(out) :: slide(3, n), slider(6, n), joint(6, n)
        real(c_double), intent(out) :: slide_of(n_column, n), slider_of(2, n_column, n), joint_of(2, n_column, n)
        type(slide_motion) :: slide_block
        type(point_motion) :: slider_block, joint_block
        type(angle_coefficients) :: slide_of_block
        type(point_coefficients) :: slider_of_block, joint_of_block
        logical :: is_reachable(lanes)
        integer :: i

        do i = 1, n, lanes
            call fd_prr_links(point_at(pivot, i), length, point_at(rail, i), angle_at(psi, i), xi, eta, int(mode), &
                point_of_at(pivot_of, i), point_of_at(rail_of, i), angle_of_at(psi_of, i), &
                slide_block, slider_block, joint_block, slide_of_block, slider_of_block, joint_of_block, is_reachable)
            call put_slide(slide_block, i, slide)
            call put_point(slider_block, i, slider)
            call put_point(joint_block, i, joint)
            call put_angle_of(slide_of_block, i, slide_of)
            call put_point_of(slider_of_block, i, slider_of)
            call put_point_of(joint_of_block, i, joint_of)
            call drop_lanes(is_reachable, i, slide)
            call drop_lanes(is_reachable, i, slider)
            call drop_lanes(is_reachable, i, joint)
            call drop_lanes(is_reachable, i, slide_of)
            call drop_columns(is_reachable, i, slider_of)
            call drop_columns(is_reachable, i, joint_of)
        end do
    end subroutine api_fd_prr_links

    subroutine api_fd_coupler_point(n, n_column, j1, j2, xi, eta, of1, of2, point, angle, point_of, angle_of)
        integer(c_int), intent(in) :: n, n_column
        real(c_double), intent(in) :: j1(6, n), j2(6, n), xi, eta, of1(2, n_column, n), of2(2, n_column, n)
        real(c_double), intent(out) :: point(6, n), angle(3, n), point_of(2, n_column, n), angle_of(n_column, n)
        type(point_motion) :: point_block
        type(angle_motion) :: angle_block
        type(point_coefficients) :: point_of_block
        type(angle_coefficients) :: angle_of_block
        integer :: i

        do i = 1, n, lanes
            call fd_coupler_point(point_at(j1, i), point_at(j2, i), xi, eta, point_of_at(of1, i), point_of_at(of2, i), &
                point_block, angle_block, point_of_block, angle_of_block)
            call put_point(point_block, i, point)
            call put_angle(angle_block, i, angle)
            call put_point_of(point_of_block, i, point_of)
            call put_angle_of(angle_of_block, i, angle_of)
        end do
    end subroutine api_fd_coupler_point

    ! ---------------------------------------------------------------- spatial

    subroutine api_s_crank_input(n, joint, frame, theta, b, r_ab, point, attitude)
        integer(c_int), intent(in) :: n
        real(c_double), intent(in) :: joint(9, n), frame(15, n), theta(3, n), b(3), r_ab(3, 3)
        real(c_double), intent(out) :: point(9, n), attitude(15, n)
        type(s_point_motion) :: point_block
        type(attitude_motion) :: attitude_block
        integer :: i

        do i = 1, n, lanes
            call s_crank_input(s_point_at(joint, i), attitude_at(frame, i), angle_at(theta, i), b, r_ab, &
                point_block, attitude_block)
            call put_s_point(point_block, i, point)
            call put_attitude(attitude_block, i, attitude)
        end do
    end subroutine api_s_crank_input

    subroutine api_csp_links(n, axis_point, axis_frame, slide_point, slide_frame, s_c, s_p, mode, &
            c_point, c_frame, s_point, p_point)
        integer(c_int), intent(in) :: n, mode
        real(c_double), intent(in) :: axis_point(9, n), axis_frame(15, n), slide_point(9, n), slide_frame(15, n)
        real(c_double), intent(in) :: s_c(3), s_p(3)
        real(c_double), intent(out) :: c_point(9, n), c_frame(15, n), s_point(9, n), p_point(9, n)
        type(s_point_motion) :: c_block, s_block, p_block
        type(attitude_motion) :: frame_block
        logical :: is_reachable(lanes)
        integer :: i

        do i = 1, n, lanes
            call csp_links(s_point_at(axis_point, i), attitude_at(axis_frame, i), s_point_at(slide_point, i), &
                attitude_at(slide_frame, i), s_c, s_p, int(mode), c_block, frame_block, s_block, p_block, is_reachable)
            call put_s_point(c_block, i, c_point)
            call put_attitude(frame_block, i, c_frame)
            call put_s_point(s_block, i, s_point)
            call put_s_point(p_block, i, p_point)
            call drop_lanes(is_reachable, i, c_point)
            call drop_lanes(is_reachable, i, c_frame)
            call drop_lanes(is_reachable, i, s_point)
            call drop_lanes(is_reachable, i, p_point)
        end do
    end subroutine api_csp_links

    subroutine api_s_coupler_point(n, origin, frame, m, r_mg, point, attitude)
        integer(c_int), intent(in) :: n
        real(c_double), intent(in) :: origin(9, n), frame(15, n), m(3), r_mg(3, 3)
        real(c_double), intent(out) :: point(9, n), attitude(15, n)
        type(s_point_motion) :: point_block
        type(attitude_motion) :: attitude_block
        integer :: i

        do i = 1, n, lanes
            call s_coupler_point(s_point_at(origin, i), attitude_at(frame, i), m, r_mg, point_block, attitude_block)
            call put_s_point(point_block, i, point)
            call put_attitude(attitude_block, i, attitude)
        end do
    end subroutine api_s_coupler_point

    subroutine api_fd_s_crank_input(n, n_column, joint, frame, theta, b, r_ab, crank, joint_of, frame_of, &
            point, attitude, point_of, attitude_of)
        integer(c_int), intent(in) :: n, n_column, crank     ! number of the crank, from 1
        real(c_double), intent(in) :: joint(9, n), frame(15, n), theta(3, n), b(3), r_ab(3, 3)
        real(c_double), intent(in) :: joint_of(3, n_column, n), frame_of(3, n_column, n)
        real(c_double), intent(out) :: point(9, n), attitude(15, n), point_of(3, n_column, n), attitude_of(3, n_column, n)
        type(s_point_motion) :: point_block
        type(attitude_motion) :: attitude_block
        type(vector_coefficients) :: point_of_block, attitude_of_block
        integer :: i

        do i = 1, n, lanes
            call fd_s_crank_input(s_point_at(joint, i), attitude_at(frame, i), angle_at(theta, i), b, r_ab, int(crank), &
                vector_of_at(joint_of, i), vector_of_at(frame_of, i), &
                point_block, attitude_block, point_of_block, attitude_of_block)
            call put_s_point(point_block, i, point)
            call put_attitude(attitude_block, i, attitude)
            call put_vector_of(point_of_block, i, point_of)
            call put_vector_of(attitude_of_block, i, attitude_of)
        end do
    end subroutine api_fd_s_crank_input

    subroutine api_fd_csp_links(n, n_column, axis_point, axis_frame, slide_point, slide_frame, s_c, s_p, mode, &
            axis_point_of, axis_frame_of, slide_point_of, slide_frame_of, &
            c_point, c_frame, s_point, p_point, c_point_of, c_frame_of, s_point_of, p_point_of)
        integer(c_int), intent(in) :: n, n_column, mode
        real(c_double), intent(in) :: axis_point(9, n), axis_frame(15, n), slide_point(9, n), slide_frame(15, n)
        real(c_double), intent(in) :: s_c(3), s_p(3)
        real(c_double), intent(in) :: axis_point_of(3, n_column, n), axis_frame_of(3, n_column, n)
        real(c_double), intent(in) :: slide_point_of(3, n_column, n), slide_frame_of(3, n_column, n)
        real(c_double), intent(out) :: c_point(9, n), c_frame(15, n), s_point(9, n), p_point(9, n)
        real(c_double), intent(out) :: c_point_of(3, n_column, n), c_frame_of(3, n_column, n)
        real(c_double), intent(out) :: s_point_of(3, n_column, n), p_point_of(3, n_column, n)
        type(s_point_motion) :: c_block, s_block, p_block
        type(attitude_motion) :: frame_block
        type(vector_coefficients) :: c_of, frame_of, s_of, p_of
        logical :: is_reachable(lanes)
        integer :: i

        do i = 1, n, lanes
            call fd_csp_links(s_point_at(axis_point, i), attitude_at(axis_frame, i), s_point_at(slide_point, i), &
                attitude_at(slide_frame, i), s_c, s_p, int(mode), vector_of_at(axis_point_of, i), &
                vector_of_at(axis_frame_of, i), vector_of_at(slide_point_of, i), vector_of_at(slide_frame_of, i), &
                c_block, frame_block, s_block, p_block, c_of, frame_of, s_of, p_of, is_reachable)
            call put_s_point(c_block, i, c_point)
            call put_attitude(frame_block, i, c_frame)
            call put_s_point(s_block, i, s_point)
            call put_s_point(p_block, i, p_point)
            call put_vector_of(c_of, i, c_point_of)
            call put_vector_of(frame_of, i, c_frame_of)
            call put_vector_of(s_of, i, s_point_of)
            call put_vector_of(p_of, i, p_point_of)
            call drop_lanes(is_reachable, i, c_point)
            call drop_lanes(is_reachable, i, c_frame)
            call drop_lanes(is_reachable, i, s_point)
            call drop_lanes(is_reachable, i, p_point)
            call drop_columns(is_reachable, i, c_point_of)
            call drop_columns(is_reachable, i, c_frame_of)
            call drop_columns(is_reachable, i, s_point_of)
            call drop_columns(is_reachable, i, p_point_of)
        end do
    end subroutine api_fd_csp_links

    subroutine api_fd_s_coupler_point(n, n_column, origin, frame, m, r_mg, origin_of, frame_of, &
            point, attitude, point_of, attitude_of)
        integer(c_int), intent(in) :: n, n_column
        real(c_double), intent(in) :: origin(9, n), frame(15, n), m(3), r_mg(3, 3)
        real(c_double), intent(in) :: origin_of(3, n_column, n), frame_of(3, n_column, n)
        real(c_double), intent(out) :: point(9, n), attitude(15, n), point_of(3, n_column, n), attitude_of(3, n_column, n)
        type(s_point_motion) :: point_block
        type(attitude_motion) :: attitude_block
        type(vector_coefficients) :: point_of_block, attitude_of_block
        integer :: i

        do i = 1, n, lanes
            call fd_s_coupler_point(s_point_at(origin, i), attitude_at(frame, i), m, r_mg, vector_of_at(origin_of, i), &
                vector_of_at(frame_of, i), point_block, attitude_block, point_of_block, attitude_of_block)
            call put_s_point(point_block, i, point)
            call put_attitude(attitude_block, i, attitude)
            call put_vector_of(point_of_block, i, point_of)
            call put_vector_of(attitude_of_block, i, attitude_of)
        end do
    end subroutine api_fd_s_coupler_point

    ! ---------------------------------------------------------------- into lanes

    !> Lanes from the sample `first` on; the last block is filled up with the last sample.
    pure function lanes_at(values, row, first) result(lane)
        real(c_double), intent(in) :: values(:, :)
        integer, intent(in) :: row, first
        real(c_double) :: lane(lanes)
        integer :: l

        lane = [(values(row, min(first + l - 1, size(values, 2))), l=1, lanes)]
    end function lanes_at

    pure function point_at(values, first) result(point)
        real(c_double), intent(in) :: values(:, :)
        integer, intent(in) :: first
        type(point_motion) :: point

        point%p%x = lanes_at(values, 1, first)
        point%p%y = lanes_at(values, 2, first)
        point%dp%x = lanes_at(values, 3, first)
        point%dp%y = lanes_at(values, 4, first)
        point%ddp%x = lanes_at(values, 5, first)
        point%ddp%y = lanes_at(values, 6, first)
    end function point_at

    pure function angle_at(values, first) result(angle)
        real(c_double), intent(in) :: values(:, :)
        integer, intent(in) :: first
        type(angle_motion) :: angle

        angle = angle_motion(lanes_at(values, 1, first), lanes_at(values, 2, first), lanes_at(values, 3, first))
    end function angle_at

    pure function point_of_at(values, first) result(of)
        real(c_double), intent(in) :: values(:, :, :)
        integer, intent(in) :: first
        type(point_coefficients) :: of
        integer :: k

        of%rest%x = lanes_at(values(:, 1, :), 1, first)
        of%rest%y = lanes_at(values(:, 1, :), 2, first)
        allocate (of%of(size(values, 2) - 1))
        do k = 1, size(of%of)
            of%of(k)%x = lanes_at(values(:, k + 1, :), 1, first)
            of%of(k)%y = lanes_at(values(:, k + 1, :), 2, first)
        end do
    end function point_of_at

    pure function angle_of_at(values, first) result(of)
        real(c_double), intent(in) :: values(:, :)
        integer, intent(in) :: first
        type(angle_coefficients) :: of
        integer :: k

        of%rest = lanes_at(values, 1, first)
        allocate (of%of(lanes, size(values, 1) - 1))
        do k = 1, size(of%of, 2)
            of%of(:, k) = lanes_at(values, k + 1, first)
        end do
    end function angle_of_at

    !> Three rows from `row` on.
    pure function vector_at(values, row, first) result(v)
        real(c_double), intent(in) :: values(:, :)
        integer, intent(in) :: row, first
        type(vec3) :: v

        v%x = lanes_at(values, row, first)
        v%y = lanes_at(values, row + 1, first)
        v%z = lanes_at(values, row + 2, first)
    end function vector_at

    pure function s_point_at(values, first) result(point)
        real(c_double), intent(in) :: values(:, :)
        integer, intent(in) :: first
        type(s_point_motion) :: point

        point = s_point_motion(vector_at(values, 1, first), vector_at(values, 4, first), vector_at(values, 7, first))
    end function s_point_at

    pure function attitude_at(values, first) result(attitude)
        real(c_double), intent(in) :: values(:, :)
        integer, intent(in) :: first
        type(attitude_motion) :: attitude
        type(vec3) :: row(3)

        row = [vector_at(values, 1, first), vector_at(values, 4, first), vector_at(values, 7, first)]
        attitude%r%x = vec3(row(1)%x, row(2)%x, row(3)%x)
        attitude%r%y = vec3(row(1)%y, row(2)%y, row(3)%y)
        attitude%r%z = vec3(row(1)%z, row(2)%z, row(3)%z)
        attitude%omega = vector_at(values, 10, first)
        attitude%domega = vector_at(values, 13, first)
    end function attitude_at

    pure function vector_of_at(values, first) result(of)
        real(c_double), intent(in) :: values(:, :, :)
        integer, intent(in) :: first
        type(vector_coefficients) :: of
        integer :: k

        of%rest = vector_at(values(:, 1, :), 1, first)
        allocate (of%of(size(values, 2) - 1))
        do k = 1, size(of%of)
            of%of(k) = vector_at(values(:, k + 1, :), 1, first)
        end do
    end function vector_of_at

    ! ---------------------------------------------------------------- out of lanes

    pure subroutine put_lanes(lane, row, first, values)
        real(c_double), intent(in) :: lane(lanes)
        integer, intent(in) :: row, first
        real(c_double), intent(inout) :: values(:, :)
        integer :: count

        count = min(lanes, size(values, 2) - first + 1)
        values(row, first:first + count - 1) = lane(:count)
    end subroutine put_lanes

    pure subroutine put_point(point, first, values)
        type(point_motion), intent(in) :: point
        integer, intent(in) :: first
        real(c_double), intent(inout) :: values(:, :)

        call put_lanes(point%p%x, 1, first, values)
        call put_lanes(point%p%y, 2, first, values)
        call put_lanes(point%dp%x, 3, first, values)
        call put_lanes(point%dp%y, 4, first, values)
        call put_lanes(point%ddp%x, 5, first, values)
        call put_lanes(point%ddp%y, 6, first, values)
    end subroutine put_point

    pure subroutine put_angle(angle, first, values)
        type(angle_motion), intent(in) :: angle
        integer, intent(in) :: first
        real(c_double), intent(inout) :: values(:, :)

        call put_lanes(angle%the, 1, first, values)
        call put_lanes(angle%dthe, 2, first, values)
        call put_lanes(angle%ddthe, 3, first, values)
    end subroutine put_angle

    pure subroutine put_slide(slide, first, values)
        type(slide_motion), intent(in) :: slide
        integer, intent(in) :: first
        real(c_double), intent(inout) :: values(:, :)

        call put_lanes(slide%v, 1, first, values)
        call put_lanes(slide%dv, 2, first, values)
        call put_lanes(slide%ddv, 3, first, values)
    end subroutine put_slide

    pure subroutine put_point_of(of, first, values)
        type(point_coefficients), intent(in) :: of
        integer, intent(in) :: first
        real(c_double), intent(inout) :: values(:, :, :)
        integer :: k

        call put_lanes(of%rest%x, 1, first, values(:, 1, :))
        call put_lanes(of%rest%y, 2, first, values(:, 1, :))
        do k = 1, size(of%of)
            call put_lanes(of%of(k)%x, 1, first, values(:, k + 1, :))
            call put_lanes(of%of(k)%y, 2, first, values(:, k + 1, :))
        end do
    end subroutine put_point_of

    pure subroutine put_angle_of(of, first, values)
        type(angle_coefficients), intent(in) :: of
        integer, intent(in) :: first
        real(c_double), intent(inout) :: values(:, :)
        integer :: k

        call put_lanes(of%rest, 1, first, values)
        do k = 1, size(of%of, 2)
            call put_lanes(of%of(:, k), k + 1, first, values)
        end do
    end subroutine put_angle_of

    pure subroutine put_vector(v, row, first, values)
        type(vec3), intent(in) :: v
        integer, intent(in) :: row, first
        real(c_double), intent(inout) :: values(:, :)

        call put_lanes(v%x, row, first, values)
        call put_lanes(v%y, row + 1, first, values)
        call put_lanes(v%z, row + 2, first, values)
    end subroutine put_vector

    pure subroutine put_s_point(point, first, values)
        type(s_point_motion), intent(in) :: point
        integer, intent(in) :: first
        real(c_double), intent(inout) :: values(:, :)

        call put_vector(point%p, 1, first, values)
        call put_vector(point%dp, 4, first, values)
        call put_vector(point%ddp, 7, first, values)
    end subroutine put_s_point

    pure subroutine put_attitude(attitude, first, values)
        type(attitude_motion), intent(in) :: attitude
        integer, intent(in) :: first
        real(c_double), intent(inout) :: values(:, :)

        associate (r => attitude%r)
            call put_vector(vec3(r%x%x, r%y%x, r%z%x), 1, first, values)
            call put_vector(vec3(r%x%y, r%y%y, r%z%y), 4, first, values)
            call put_vector(vec3(r%x%z, r%y%z, r%z%z), 7, first, values)
        end associate
        call put_vector(attitude%omega, 10, first, values)
        call put_vector(attitude%domega, 13, first, values)
    end subroutine put_attitude

    pure subroutine put_vector_of(of, first, values)
        type(vector_coefficients), intent(in) :: of
        integer, intent(in) :: first
        real(c_double), intent(inout) :: values(:, :, :)
        integer :: k

        call put_vector(of%rest, 1, first, values(:, 1, :))
        do k = 1, size(of%of)
            call put_vector(of%of(k), 1, first, values(:, k + 1, :))
        end do
    end subroutine put_vector_of

    !> Samples that cannot be assembled become NaN.
    subroutine drop_lanes(is_reachable, first, values)
        logical, intent(in) :: is_reachable(lanes)
        integer, intent(in) :: first
        real(c_double), intent(inout) :: values(:, :)
        integer :: l

        do l = 1, min(lanes, size(values, 2) - first + 1)
            if (.not. is_reachable(l)) values(:, first + l - 1) = ieee_value(1.0_c_double, ieee_quiet_nan)
        end do
    end subroutine drop_lanes

    subroutine drop_columns(is_reachable, first, values)
        logical, intent(in) :: is_reachable(lanes)
        integer, intent(in) :: first
        real(c_double), intent(inout) :: values(:, :, :)
        integer :: k

        do k = 1, size(values, 2)
            call drop_lanes(is_reachable, first, values(:, k, :))
        end do
    end subroutine drop_columns
end module linkdyn_f2py_lecture
