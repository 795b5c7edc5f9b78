!> The lecture's modules in mechanisms whose every part moves: loops closed, rates and accelerations against differences, and
!> the coefficient forms against the plain ones.
module test_lecture
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_lecture, only: point_motion, angle_motion, slide_motion, point_coefficients, angle_coefficients, &
        crank_input, rrr_links, prr_links, coupler_point, link_angle, &
        fd_crank_input, fd_rrr_links, fd_prr_links, fd_coupler_point
    use linkdyn_lecture_spatial, only: s_point_motion, attitude_motion, vector_coefficients, &
        s_crank_input, csp_links, s_coupler_point, fd_s_crank_input, fd_csp_links, fd_s_coupler_point
    use linkdyn_test_numbers, only: eps, stencil, difference_step, difference_error, largest_vec3
    use linkdyn_testing, only: test_error, unit_test, new_test, check, check_close
    use linkdyn_vec2, only: vec2, operator(+), operator(-), operator(*), operator(.dot.), operator(.unrotate.), &
        rot2_by_angle, zero_vec2
    use linkdyn_vec3, only: vec3, operator(+), operator(-), operator(*), operator(.cross.), operator(.rotate.), same_lanes, &
        vec3_of, zero_vec3
    implicit none (type, external)
    private
    public :: collect_lecture

    integer, parameter :: n_crank = 3
    real(wp), parameter :: closed = 32*eps    ! positions of order 1 through a few operations
    ! Derivatives up to the fifth of these motions are below 100.
    real(wp), parameter :: level = 100

    ! Arms of the spatial cranks; S seen from C and from P.
    real(wp), parameter :: b1(3) = [0.3_wp, 0.1_wp, 0.2_wp], b2(3) = [0.2_wp, -0.1_wp, 0.1_wp], b3(3) = [0.1_wp, 0.2_wp, -0.1_wp]
    real(wp), parameter :: s_c(3) = [1.0_wp, 0.6_wp, 0.2_wp], s_p(3) = [0.05_wp, 0.3_wp, -0.1_wp]

    !> All that is computed of a planar mechanism, in columns; each with its rate and acceleration.
    type :: planar_walk
        type(point_motion) :: point(8)
        type(angle_motion) :: angle(3)
        type(slide_motion) :: slide
        logical :: is_reachable(lanes) = .true.
    end type planar_walk

    type :: spatial_walk
        type(s_point_motion) :: point(7)      !! of cranks 1, 2, 3; C, S, P; a point of the coupler
        type(attitude_motion) :: frame(5)     !! of cranks 1, 2, 3; coupler; axes at its point
        logical :: is_reachable(lanes) = .true.
    end type spatial_walk

contains

    subroutine collect_lecture(tests)
        type(unit_test), allocatable, intent(out) :: tests(:)

        tests = [new_test("planar loops", test_planar_closure), new_test("planar rates", test_planar_rates), &
                 new_test("planar coefficients", test_planar_coefficients), new_test("out of reach", test_reach), &
                 new_test("spatial loops", test_spatial_closure), new_test("spatial rates", test_spatial_rates), &
                 new_test("spatial coefficients", test_spatial_coefficients)]
    end subroutine collect_lecture

    !> Three cranks at changing rates; every lane at another instant.
    pure function cranks(t) result(theta)
        real(wp), intent(in) :: t(lanes)
        type(angle_motion) :: theta(n_crank)
        integer :: k

        do k = 1, n_crank
            theta(k)%the = 0.4_wp*k + (0.7_wp - 0.4_wp*k)*t + 0.3_wp*k*sin(t)
            theta(k)%dthe = 0.7_wp - 0.4_wp*k + 0.3_wp*k*cos(t)
            theta(k)%ddthe = -0.3_wp*k*sin(t)
        end do
    end function cranks

    pure function instants() result(t)
        real(wp) :: t(lanes)
        integer :: l

        t = [(0.2_wp + 0.5_wp*l/lanes, l=1, lanes)]
    end function instants

    pure function fixed_point(x, y) result(point)
        real(wp), intent(in) :: x, y
        type(point_motion) :: point

        point = point_motion(zero_vec2(), zero_vec2(), zero_vec2())
        point%p%x = x
        point%p%y = y
    end function fixed_point

    ! ---------------------------------------------------------------- planar

    !> A crank on a crank and a third crank carry an RRR dyad; its coupler carries a rail with a PRR dyad.
    pure function walk(t) result(w)
        real(wp), intent(in) :: t(lanes)
        type(planar_walk) :: w
        type(angle_motion) :: theta(n_crank)
        logical :: ok(lanes)

        theta = cranks(t)
        call crank_input(fixed_point(0.0_wp, 0.0_wp), 0.5_wp, theta(1), angle_motion(), w%point(1))
        call crank_input(w%point(1), 0.4_wp, theta(2), theta(1), w%point(2))
        call crank_input(fixed_point(1.2_wp, 0.1_wp), 0.3_wp, theta(3), angle_motion(), w%point(3))
        call rrr_links(w%point(2), w%point(3), 1.1_wp, 0.9_wp, 1, w%point(4), w%is_reachable)
        call coupler_point(w%point(2), w%point(4), 0.3_wp, -0.2_wp, w%point(5), w%angle(1))
        call link_angle(w%point(3), w%point(4), w%angle(2))
        call prr_links(w%point(3), 1.3_wp, w%point(5), w%angle(1), 0.2_wp, 0.1_wp, -1, w%slide, w%point(6), w%point(7), ok)
        call coupler_point(w%point(7), w%point(3), 0.1_wp, 0.25_wp, w%point(8), w%angle(3))
        w%is_reachable = w%is_reachable .and. ok
    end function walk

    subroutine test_planar_closure(error)
        type(test_error), intent(inout) :: error
        type(planar_walk) :: w
        type(vec2) :: offset

        w = walk(instants())
        call check(error, all(w%is_reachable), "assembled")
        call check_close(error, distance(2, 4), spread(1.1_wp, 1, lanes), closed, "first link of RRR")
        call check_close(error, distance(3, 4), spread(0.9_wp, 1, lanes), closed, "second link of RRR")
        call check_close(error, distance(3, 7), spread(1.3_wp, 1, lanes), closed, "link of PRR")
        offset = rot2_by_angle(w%angle(1)%the).unrotate.(w%point(6)%p - w%point(5)%p)
        call check_close(error, offset%x, w%slide%v, closed, "slide")
        call check_close(error, offset%y, spread(0.0_wp, 1, lanes), closed, "slider on its rail")
        offset = rot2_by_angle(w%angle(1)%the).unrotate.(w%point(7)%p - w%point(6)%p)
        call check_close(error, [offset%x, offset%y], [spread(0.2_wp, 1, lanes), spread(0.1_wp, 1, lanes)], closed, "its joint")
        call check_close(error, distance(5, 2), spread(norm2([0.3_wp, 0.2_wp]), 1, lanes), closed, "coupler point")

    contains

        function distance(i, j) result(d)
            integer, intent(in) :: i, j
            real(wp) :: d(lanes)
            type(vec2) :: way

            way = w%point(j)%p - w%point(i)%p
            d = sqrt(way.dot.way)
        end function distance
    end subroutine test_planar_closure

    subroutine test_planar_rates(error)
        type(test_error), intent(inout) :: error
        real(wp), allocatable :: value(:), rate(:), rate2(:), p(:), v(:), dp(:), dv(:), unused(:)
        integer :: k

        call flatten(walk(instants()), value, rate, rate2)
        allocate (dp(size(value)), dv(size(value)), source=0.0_wp)
        do k = -2, 2
            call flatten(walk(instants() + k*difference_step()), p, v, unused)
            dp = dp + stencil(k)*p/difference_step()
            dv = dv + stencil(k)*v/difference_step()
        end do
        call check_close(error, rate, dp, level*difference_error(), "rates")
        call check_close(error, rate2, dv, level*difference_error(), "accelerations")
    end subroutine test_planar_rates

    pure subroutine flatten(w, value, rate, rate2)
        type(planar_walk), intent(in) :: w
        real(wp), allocatable, intent(out) :: value(:), rate(:), rate2(:)
        integer :: i

        value = w%slide%v
        rate = w%slide%dv
        rate2 = w%slide%ddv
        do i = 1, size(w%point)
            value = [value, w%point(i)%p%x, w%point(i)%p%y]
            rate = [rate, w%point(i)%dp%x, w%point(i)%dp%y]
            rate2 = [rate2, w%point(i)%ddp%x, w%point(i)%ddp%y]
        end do
        do i = 1, size(w%angle)
            value = [value, w%angle(i)%the]
            rate = [rate, w%angle(i)%dthe]
            rate2 = [rate2, w%angle(i)%ddthe]
        end do
    end subroutine flatten

    !> The coefficients, summed with the cranks' accelerations, are the plain modules' accelerations.
    subroutine test_planar_coefficients(error)
        type(test_error), intent(inout) :: error
        type(planar_walk) :: w
        type(angle_motion) :: theta(n_crank), angle
        type(point_coefficients) :: ground, of(8)
        type(angle_coefficients) :: still, own, turn(3), slide_of
        type(point_motion) :: point(8)
        type(slide_motion) :: slide
        type(vec2) :: total
        logical :: ok(lanes)
        integer :: i

        theta = cranks(instants())
        w = walk(instants())
        allocate (ground%of(n_crank), still%of(lanes, n_crank))
        ground%of = zero_vec2()
        ground%rest = zero_vec2()
        still%of = 0
        own = still
        own%of(:, 1) = 1
        call fd_crank_input(fixed_point(0.0_wp, 0.0_wp), 0.5_wp, theta(1), angle_motion(), 1, ground, still, point(1), of(1))
        call fd_crank_input(point(1), 0.4_wp, theta(2), theta(1), 2, of(1), own, point(2), of(2))
        call fd_crank_input(fixed_point(1.2_wp, 0.1_wp), 0.3_wp, theta(3), angle_motion(), 3, ground, still, point(3), of(3))
        call fd_rrr_links(point(2), point(3), 1.1_wp, 0.9_wp, 1, of(2), of(3), point(4), of(4), ok)
        call fd_coupler_point(point(2), point(4), 0.3_wp, -0.2_wp, of(2), of(4), point(5), angle, of(5), turn(1))
        call fd_prr_links(point(3), 1.3_wp, point(5), angle, 0.2_wp, 0.1_wp, -1, of(3), of(5), turn(1), &
                          slide, point(6), point(7), slide_of, of(6), of(7), ok)
        call fd_coupler_point(point(7), point(3), 0.1_wp, 0.25_wp, of(7), of(3), point(8), angle, of(8), turn(3))
        do i = 1, size(of)
            total = planar_sum(of(i), theta)
            call check_close(error, [total%x, total%y], [w%point(i)%ddp%x, w%point(i)%ddp%y], level*eps, "point")
            call check_close(error, [point(i)%p%x, point(i)%dp%y], [w%point(i)%p%x, w%point(i)%dp%y], closed, "motion")
        end do
        call check_close(error, angle_sum(turn(1), theta), w%angle(1)%ddthe, level*eps, "angle of the coupler")
        call check_close(error, angle_sum(turn(3), theta), w%angle(3)%ddthe, level*eps, "angle of the link")
        call check_close(error, angle_sum(slide_of, theta), w%slide%ddv, level*eps, "slide")
    end subroutine test_planar_coefficients

    pure function planar_sum(of, theta) result(acceleration)
        type(point_coefficients), intent(in) :: of
        type(angle_motion), intent(in) :: theta(:)
        type(vec2) :: acceleration
        integer :: k

        acceleration = of%rest
        do k = 1, size(theta)
            acceleration = acceleration + theta(k)%ddthe*of%of(k)
        end do
    end function planar_sum

    pure function angle_sum(of, theta) result(acceleration)
        type(angle_coefficients), intent(in) :: of
        type(angle_motion), intent(in) :: theta(:)
        real(wp) :: acceleration(lanes)
        integer :: k

        acceleration = of%rest
        do k = 1, size(theta)
            acceleration = acceleration + theta(k)%ddthe*of%of(:, k)
        end do
    end function angle_sum

    !> Beyond their reach the links say so, lane by lane.
    subroutine test_reach(error)
        type(test_error), intent(inout) :: error
        type(point_motion) :: j2, joint, slider
        type(slide_motion) :: slide
        logical :: ok(lanes), want(lanes)
        integer :: l

        want = [(modulo(l, 2) == 1, l=1, lanes)]
        j2 = fixed_point(0.0_wp, 0.0_wp)
        j2%p%x = merge(1.9_wp, 2.1_wp, want)
        call rrr_links(fixed_point(0.0_wp, 0.0_wp), j2, 1.0_wp, 1.0_wp, 1, joint, ok)
        call check(error, all(ok .eqv. want), "RRR")
        j2%p%x = 0
        j2%p%y = merge(0.9_wp, 1.1_wp, want)
        call prr_links(fixed_point(0.0_wp, 0.0_wp), 1.0_wp, j2, angle_motion(), 0.0_wp, 0.0_wp, 1, slide, slider, joint, ok)
        call check(error, all(ok .eqv. want), "PRR")
    end subroutine test_reach

    ! ---------------------------------------------------------------- spatial

    !> A crank on a crank carries the axis of a CSP chain, a third crank its slide; all axes are askew.
    pure function walk_in_space(t) result(w)
        real(wp), intent(in) :: t(lanes)
        type(spatial_walk) :: w
        type(angle_motion) :: theta(n_crank)

        theta = cranks(t)
        call s_crank_input(still_point(0.0_wp), still_frame(0.4_wp), theta(1), b1, askew(0.5_wp), w%point(1), w%frame(1))
        call s_crank_input(w%point(1), w%frame(1), theta(2), b2, askew(-0.3_wp), w%point(2), w%frame(2))
        call s_crank_input(still_point(0.3_wp), still_frame(-0.2_wp), theta(3), b3, askew(0.2_wp), w%point(3), w%frame(3))
        call csp_links(w%point(2), w%frame(2), w%point(3), w%frame(3), s_c, s_p, 1, &
                       w%point(4), w%frame(4), w%point(5), w%point(6), w%is_reachable)
        call s_coupler_point(w%point(4), w%frame(4), b1, askew(1.1_wp), w%point(7), w%frame(5))
    end function walk_in_space

    pure function still_point(x) result(point)
        real(wp), intent(in) :: x
        type(s_point_motion) :: point

        point = s_point_motion(zero_vec3(), zero_vec3(), zero_vec3())
        point%p%x = x
    end function still_point

    pure function still_frame(angle) result(frame)
        real(wp), intent(in) :: angle
        type(attitude_motion) :: frame

        frame = attitude_motion(same_lanes(askew(angle)), zero_vec3(), zero_vec3())
    end function still_frame

    !> Rotation by an angle about x.
    pure function askew(angle) result(r)
        real(wp), intent(in) :: angle
        real(wp) :: r(3, 3)

        r(:, 1) = [1.0_wp, 0.0_wp, 0.0_wp]
        r(:, 2) = [0.0_wp, cos(angle), sin(angle)]
        r(:, 3) = [0.0_wp, -sin(angle), cos(angle)]
    end function askew

    subroutine test_spatial_closure(error)
        type(test_error), intent(inout) :: error
        type(spatial_walk) :: w

        w = walk_in_space(instants())
        call check(error, all(w%is_reachable), "assembled")
        call check_zero(w%point(5)%p - w%point(4)%p - (w%frame(4)%r.rotate.s_c), "S on the coupler")
        call check_zero(w%point(5)%p - w%point(6)%p - (w%frame(3)%r.rotate.s_p), "S on the output")
        call check_zero((w%point(4)%p - w%point(2)%p).cross.w%frame(2)%r%z, "C on its axis")
        call check_zero((w%point(6)%p - w%point(3)%p).cross.w%frame(3)%r%y, "P on its slide")
        call check_zero(w%frame(4)%r%z - w%frame(2)%r%z, "coupler along the axis")
        call check_zero((w%frame(4)%r%x.cross.w%frame(4)%r%y) - w%frame(4)%r%z, "a rotation")

    contains

        subroutine check_zero(v, what)
            type(vec3), intent(in) :: v
            character(len=*), intent(in) :: what

            call check(error, largest_vec3(v) <= closed, what)
        end subroutine check_zero
    end subroutine test_spatial_closure

    subroutine test_spatial_rates(error)
        type(test_error), intent(inout) :: error
        real(wp), allocatable :: value(:), rate(:), rate2(:), p(:), v(:), dp(:), dv(:), unused(:)
        integer :: k

        call flatten_in_space(walk_in_space(instants()), value, rate, rate2)
        allocate (dp(size(value)), dv(size(value)), source=0.0_wp)
        do k = -2, 2
            call flatten_in_space(walk_in_space(instants() + k*difference_step()), p, v, unused)
            dp = dp + stencil(k)*p/difference_step()
            dv = dv + stencil(k)*v/difference_step()
        end do
        call check_close(error, rate, dp, level*difference_error(), "rates")
        call check_close(error, rate2, dv, level*difference_error(), "accelerations")
    end subroutine test_spatial_rates

    !> Points, and the axes of the frames, which turn with omega.
    pure subroutine flatten_in_space(w, value, rate, rate2)
        type(spatial_walk), intent(in) :: w
        real(wp), allocatable, intent(out) :: value(:), rate(:), rate2(:)
        integer :: i, k

        allocate (value(0), rate(0), rate2(0))
        do i = 1, size(w%point)
            call append(value, w%point(i)%p)
            call append(rate, w%point(i)%dp)
            call append(rate2, w%point(i)%ddp)
        end do
        do i = 1, size(w%frame)
            associate (r => w%frame(i)%r, omega => w%frame(i)%omega, domega => w%frame(i)%domega)
                do k = 1, 3
                    associate (e => vec3_of(merge(1.0_wp, 0.0_wp, [1, 2, 3] == k)))
                        call append(value, r.rotate.e)
                        call append(rate, r.rotate.(omega.cross.e))
                        call append(rate2, r.rotate.((domega.cross.e) + (omega.cross.(omega.cross.e))))
                    end associate
                end do
            end associate
        end do
    end subroutine flatten_in_space

    pure subroutine append(list, v)
        real(wp), allocatable, intent(inout) :: list(:)
        type(vec3), intent(in) :: v

        list = [list, v%x, v%y, v%z]
    end subroutine append

    subroutine test_spatial_coefficients(error)
        type(test_error), intent(inout) :: error
        type(spatial_walk) :: w
        type(angle_motion) :: theta(n_crank)
        type(vector_coefficients) :: still, of(7), turn(5)
        type(s_point_motion) :: point(7)
        type(attitude_motion) :: frame(5)
        logical :: ok(lanes)
        integer :: i, k

        theta = cranks(instants())
        w = walk_in_space(instants())
        still%rest = zero_vec3()
        allocate (still%of(n_crank))
        still%of = zero_vec3()
        call fd_s_crank_input(still_point(0.0_wp), still_frame(0.4_wp), theta(1), b1, askew(0.5_wp), 1, still, still, &
                              point(1), frame(1), of(1), turn(1))
        call fd_s_crank_input(point(1), frame(1), theta(2), b2, askew(-0.3_wp), 2, of(1), turn(1), &
                              point(2), frame(2), of(2), turn(2))
        call fd_s_crank_input(still_point(0.3_wp), still_frame(-0.2_wp), theta(3), b3, askew(0.2_wp), 3, still, still, &
                              point(3), frame(3), of(3), turn(3))
        call fd_csp_links(point(2), frame(2), point(3), frame(3), s_c, s_p, 1, of(2), turn(2), of(3), turn(3), &
                          point(4), frame(4), point(5), point(6), of(4), turn(4), of(5), of(6), ok)
        call fd_s_coupler_point(point(4), frame(4), b1, askew(1.1_wp), of(4), turn(4), point(7), frame(5), of(7), turn(5))
        do i = 1, size(of)
            do k = 1, n_crank
                of(i)%rest = of(i)%rest + theta(k)%ddthe*of(i)%of(k)
            end do
            call check(error, largest_vec3(of(i)%rest - w%point(i)%ddp) <= level*eps, "point")
        end do
        do i = 1, size(turn)
            do k = 1, n_crank
                turn(i)%rest = turn(i)%rest + theta(k)%ddthe*turn(i)%of(k)
            end do
            call check(error, largest_vec3(turn(i)%rest - w%frame(i)%domega) <= level*eps, "attitude")
        end do
    end subroutine test_spatial_coefficients
end module test_lecture
