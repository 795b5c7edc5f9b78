!> A platform that hangs on three rods and does not turn, as that of a Delta robot led by its drives, in closed form on all levels.
!>
!> The platform stands as the base does. So the way r from its origin P to where a rod ends is known, and P is on a sphere about
!> c = e - r, e where the rod begins, with the rod's length L for its radius. Three rods, with the line p = P - c1 and
!>
!>     a = c2 - c1     b = c3 - c1     n = a x b     u = p . a = (L1^2 - L2^2 + a^2)/2     w = p . b = (L1^2 - L3^2 + b^2)/2
!>
!> give in the plane of the three centres, and off it to the side for which the branch stands,
!>
!>     p = (f x n + S n)/n^2     f = u b - w a     S = p . n      S^2 = L1^2 n^2 - f^2
!>
!> S = p1 . (p2 x p3) of the three rods is also what velocities and accelerations are divided by. Beyond S = 0 the spheres do not
!> meet: there two assemblies, the platform on either side of the centres, come together. docs/theory.md derives the formulas.
!> That the platform does not turn is the work of other rods or joints, which stand behind this step (`linkdyn_parallel_rods`).
module linkdyn_hung_platform
    use linkdyn_bodies, only: bodies_type, world_axes, own_axes, set_vector, omega_of, alpha_of, rotation_of, point_position, &
        point_velocity, point_acceleration, acceleration_field, field_times, arm_of
    use linkdyn_kinds, only: wp
    use linkdyn_mechanism, only: mechanism_type, marker_point, scene_line, root_of, least_square
    use linkdyn_model, only: step_type, side_of, base_of_hung, n_hung_rod
    use linkdyn_named_unknowns, only: named_vector
    use linkdyn_system, only: system_type
    use linkdyn_value, only: value, operator(+), operator(-), operator(*), sqrt, reciprocal, square, max, min, abs
    use linkdyn_vector, only: vector, rotation, operator(+), operator(-), operator(*), operator(.dot.), operator(.cross.), &
        operator(.unrotate.)
    implicit none (type, external)
    private
    public :: hang_on_rods, margin_of_hanging, quality_of_hanging

    real(wp), parameter :: rounding = 8*epsilon(1.0_wp)    !! of squares that are differences, relative to what is in them

    !> A rod between its lead, which is known, and the platform.
    type :: hung_rod
        integer :: lead = 0
        type(vector) :: begin, end             !! own axes of lead and platform [m]
        type(value) :: length                  !! [m]
    end type hung_rod

contains

    !> Link of the step: the platform. Joints: of each rod the one at its lead and the one at the platform; then the hinge or slide
    !> of the first lead, as whose base the platform turns.
    subroutine hang_on_rods(mechanism, step, branch, equations)
        type(mechanism_type), intent(inout) :: mechanism
        type(step_type), intent(in) :: step
        type(value), intent(in) :: branch
        type(system_type), intent(inout), optional :: equations    !! where accelerations stay unknown, if they do
        type(hung_rod) :: rod(n_hung_rod)
        type(vector) :: centre(n_hung_rod), p(n_hung_rod)          ! of the spheres; from there to the origin
        integer :: k

        rod = rods_of(mechanism, step)
        call turn_with_base(mechanism, step)
        do k = 1, n_hung_rod
            centre(k) = point_position(mechanism%bodies, rod(k)%lead, rod(k)%begin) &
                        - arm_of(mechanism%bodies, step%link(1), rod(k)%end)
        end do
        p(1) = meeting_point(mechanism, centre(2) - centre(1), centre(3) - centre(1), rod%length, branch)
        mechanism%bodies%body(step%link(1))%position = centre(1) + p(1)
        do k = 2, n_hung_rod
            p(k) = p(1) - (centre(k) - centre(1))
        end do
        call move_platform(mechanism%bodies, step%link(1), rod, p, equations)
    end subroutine hang_on_rods

    function rods_of(mechanism, step) result(rod)
        type(mechanism_type), intent(in) :: mechanism
        type(step_type), intent(in) :: step
        type(hung_rod) :: rod(n_hung_rod)
        type(vector) :: line
        integer :: k, side, link

        do k = 1, n_hung_rod
            associate (inner => step%joint(2*k - 1), outer => step%joint(2*k), joint => mechanism%model%joint)
                side = side_of(joint(outer), step%link(1))
                rod(k)%end = marker_point(mechanism, outer, side)
                link = joint(outer)%link(3 - side)
                side = side_of(joint(inner), link)
                rod(k)%lead = joint(inner)%link(3 - side)
                rod(k)%begin = marker_point(mechanism, inner, 3 - side)
                line = scene_line(mechanism, inner, outer, link)
                rod(k)%length = sqrt(line.dot.line)
            end associate
        end do
    end function rods_of

    ! ---------------------------------------------------------------- places

    !> The axes in which it is traced are parallel always to those in which the scene has the base.
    subroutine turn_with_base(mechanism, step)
        type(mechanism_type), intent(inout) :: mechanism
        type(step_type), intent(in) :: step
        type(rotation) :: turn                                     ! from the platform's axes to those in which the base is traced
        integer :: base

        base = base_of_hung(mechanism%model, step)
        turn = mechanism%own(base)%r
        associate (bodies => mechanism%bodies)
            associate (new => bodies%turning(bodies%body(step%link(1))%turning))
                if (bodies%body(step%link(1))%turning == bodies%body(base)%turning) return
                new%r = rotation_of(bodies, base)*turn
                call set_vector(new%omega, own_axes, turn.unrotate.omega_of(bodies, base, own_axes))
                call set_vector(new%omega, world_axes, omega_of(bodies, base, world_axes))
                call set_vector(new%alpha, own_axes, turn.unrotate.alpha_of(bodies, base, own_axes))
                call set_vector(new%alpha, world_axes, alpha_of(bodies, base, world_axes))
            end associate
        end associate
    end subroutine turn_with_base

    !> From the first centre.
    function meeting_point(mechanism, a, b, length, branch) result(p)
        type(mechanism_type), intent(inout) :: mechanism
        type(vector), intent(in) :: a, b               !! from the first centre to the others [m]
        type(value), intent(in) :: length(n_hung_rod)  !! [m]
        type(value), intent(in) :: branch
        type(vector) :: p
        type(vector) :: n, f
        type(value) :: length_2(n_hung_rod), a_2, b_2, n_2, s, whole(2)

        length_2 = square(length)
        a_2 = a.dot.a
        b_2 = b.dot.b
        n = a.cross.b
        n_2 = n.dot.n
        f = (0.5_wp*(length_2(1) - length_2(2) + a_2))*b - (0.5_wp*(length_2(1) - length_2(3) + b_2))*a
        ! what is in f, of which rounding takes its part
        whole = [square(length_2(1) + length_2(2) + a_2)*b_2, square(length_2(1) + length_2(3) + b_2)*a_2]
        s = branch*root_of(mechanism, length_2(1)*n_2 - (f.dot.f), least_square*(length_2(1)*length_2(2)*length_2(3)), &
                           rounding*(length_2(1)*a_2*b_2 + whole(1) + whole(2)))
        p = reciprocal(n_2)*((f.cross.n) + s*n)
    end function meeting_point

    ! ---------------------------------------------------------------- rates

    !> Each rod keeps its length: p . (v - v of its centre) = 0, and once more.
    subroutine move_platform(bodies, platform, rod, p, equations)
        type(bodies_type), intent(inout) :: bodies
        integer, intent(in) :: platform
        type(hung_rod), intent(in) :: rod(:)
        type(vector), intent(in) :: p(:)               !! from the centres to the origin, world axes [m]
        type(system_type), intent(inout), optional :: equations
        type(vector) :: v, a, arm, of_centre(n_hung_rod), across(n_hung_rod), past
        type(value) :: along(n_hung_rod)
        integer :: k

        do k = 1, n_hung_rod
            across(k) = p(1 + mod(k, n_hung_rod)) .cross.p(1 + mod(k + 1, n_hung_rod))
            arm = arm_of(bodies, platform, rod(k)%end)
            of_centre(k) = point_velocity(bodies, rod(k)%lead, rod(k)%begin) - (omega_of(bodies, platform, world_axes) .cross.arm)
            along(k) = p(k) .dot.of_centre(k)
        end do
        v = solution(along)
        do k = 1, n_hung_rod
            arm = arm_of(bodies, platform, rod(k)%end)
            past = v - of_centre(k)
            along(k) = (p(k) .dot.(point_acceleration(bodies, rod(k)%lead, rod(k)%begin, world_axes) &
                                   - field_times(acceleration_field(bodies, platform, world_axes), arm))) - (past.dot.past)
        end do
        a = solution(along)
        if (present(equations)) a = named_vector(equations, a)
        associate (body => bodies%body(platform), r => rotation_of(bodies, platform))
            body%velocity = v
            call set_vector(body%acceleration, world_axes, a)
            call set_vector(body%acceleration, own_axes, r.unrotate.a)
        end associate

    contains

        !> With given components along the three rods, times their lengths.
        function solution(along) result(x)
            type(value), intent(in) :: along(:)
            type(vector) :: x

            x = reciprocal(p(1) .dot.across(1))*(along(1)*across(1) + along(2)*across(2) + along(3)*across(3))
        end function solution
    end subroutine move_platform

    ! ---------------------------------------------------------------- margin

    !> S over the three lengths, with the sign of the branch, and its rate. Links have places and velocities.
    subroutine margin_of_hanging(mechanism, step, margin, drift)
        type(mechanism_type), intent(in) :: mechanism
        type(step_type), intent(in) :: step
        type(value), intent(out) :: margin, drift
        type(vector) :: p(n_hung_rod), rate(n_hung_rod)
        type(value) :: per_lengths

        call see_rods(mechanism, step, p, rate)
        per_lengths = reciprocal(sqrt((p(1) .dot.p(1))*(p(2) .dot.p(2))*(p(3) .dot.p(3))))
        margin = per_lengths*(p(1) .dot.(p(2) .cross.p(3)))
        drift = per_lengths*((rate(1) .dot.(p(2) .cross.p(3))) + (rate(2) .dot.(p(3) .cross.p(1))) &
                             + (rate(3) .dot.(p(1) .cross.p(2))))
    end subroutine margin_of_hanging

    !> In the order of `uncertainty_of_motion`: how the rods' upper ends go past the lower ones is found, how the lower ones go past
    !> each other is given.
    function quality_of_hanging(mechanism, step) result(q)
        type(mechanism_type), intent(in) :: mechanism
        type(step_type), intent(in) :: step
        type(value) :: q(6)
        type(vector) :: p(n_hung_rod), rate(n_hung_rod), rate_2(n_hung_rod)
        type(value) :: drift

        call margin_of_hanging(mechanism, step, q(1), drift)
        q(1) = abs(q(1))
        call see_rods(mechanism, step, p, rate, rate_2)
        q(2) = sqrt(min(p(1) .dot.p(1), min(p(2) .dot.p(2), p(3) .dot.p(3))))
        call look(rate, q(3), q(4))
        call look(rate_2, q(5), q(6))

    contains

        subroutine look(of_rod, largest, gap)
            type(vector), intent(in) :: of_rod(:)
            type(value), intent(out) :: largest, gap
            type(vector) :: apart(2)

            apart = [of_rod(2) - of_rod(1), of_rod(3) - of_rod(1)]
            largest = sqrt(max(of_rod(1) .dot.of_rod(1), max(of_rod(2) .dot.of_rod(2), of_rod(3) .dot.of_rod(3))))
            gap = sqrt(max(apart(1) .dot.apart(1), apart(2) .dot.apart(2)))
        end subroutine look
    end function quality_of_hanging

    !> The rods as the platform sees them, which turns as the base does; how their rates grow only where links have accelerations.
    subroutine see_rods(mechanism, step, p, rate, rate_2)
        type(mechanism_type), intent(in) :: mechanism
        type(step_type), intent(in) :: step
        type(vector), intent(out) :: p(:), rate(:)                 !! from lead to platform, world axes [m], [m/s]
        type(vector), intent(out), optional :: rate_2(:)           !! [m/s2]
        type(hung_rod) :: rod(n_hung_rod)
        type(vector) :: omega
        integer :: k

        rod = rods_of(mechanism, step)
        associate (bodies => mechanism%bodies, platform => step%link(1))
            omega = omega_of(bodies, platform, world_axes)
            do k = 1, n_hung_rod
                p(k) = point_position(bodies, platform, rod(k)%end) - point_position(bodies, rod(k)%lead, rod(k)%begin)
                rate(k) = point_velocity(bodies, platform, rod(k)%end) - point_velocity(bodies, rod(k)%lead, rod(k)%begin) &
                          - (omega.cross.p(k))
                if (.not. present(rate_2)) cycle
                rate_2(k) = point_acceleration(bodies, platform, rod(k)%end, world_axes) &
                            - point_acceleration(bodies, rod(k)%lead, rod(k)%begin, world_axes) &
                            - field_times(acceleration_field(bodies, platform, world_axes), p(k)) - 2.0_wp*(omega.cross.rate(k))
            end do
        end associate
    end subroutine see_rods
end module linkdyn_hung_platform
