!> A crank or carriage and the rod behind it, between two known links, in closed form on all levels: RUS and PUS legs, and a rocker
!> with the rod that drives it. Where the lead is known, too, the rod alone.
!>
!> The *lead*, crank or carriage, hangs on the base by a hinge or slide. One end of the rod is at the lead, E, the other, P, at the
!> top; one is in a universal joint, the other in a ball. E goes along a circle or line, P is known, and so is the rod's length L:
!> in the axes of the base's marker, w from its point to P, n = (nx, ny, nz) to E,
!>
!>     slide:   nx, ny fixed              nz = wz + S              S^2 = L^2 - (wx - nx)^2 - (wy - ny)^2
!>     hinge:   nz fixed, |nx, ny| = r    (nx, ny) = (C (wx, wy) + S (-wy, wx))/h^2       h = |wx, wy|
!>              C = (h^2 + r^2 + (wz - nz)^2 - L^2)/2              S^2 = r^2 h^2 - C^2
!>
!> with the branch for the sign of S: +1 is the carriage farther along its slide, or the crank turned on from where P is, about its
!> hinge's axis. With t the way of E by a unit of the lead's variable, rod . t = -S, by which velocities and accelerations are
!> divided. docs/theory.md derives the formulas.
module linkdyn_rod_leg
    use linkdyn_bodies, only: bodies_type, world_axes, own_axes, set_vector, omega_of, alpha_of, point_position, point_velocity, &
        point_acceleration, carried_velocity, carried_acceleration, rotation_of
    use linkdyn_kinds, only: wp
    use linkdyn_line_turning, only: turning_of_line, turning_of_line_2
    use linkdyn_mechanism, only: mechanism_type, marker_point, marker_frame, scene_rod, root_of, must_be_positive, least_square
    use linkdyn_model, only: step_type, step_rus, side_of, is_rod_leg, rod_of, inner_of_rod, outer_of_rod, universal_of_rod
    use linkdyn_named_unknowns, only: named, named_vector
    use linkdyn_open_chain, only: walk_hinge, walk_slide
    use linkdyn_system, only: system_type
    use linkdyn_value, only: value, zero, declare_inverse, operator(+), operator(-), operator(*), sqrt, reciprocal, square, abs
    use linkdyn_vector, only: vector, rotation, zero_vector, unit_vector, operator(+), operator(-), &
        operator(*), operator(.dot.), operator(.cross.), operator(.rotate.), operator(.unrotate.)
    implicit none (type, external)
    private
    public :: rod_leg_type, rod_leg_of, close_rod_leg, close_rod

    real(wp), parameter :: rounding = 8*epsilon(1.0_wp)    !! of squares that are differences, relative to what is in them

    !> Links and joints of the leg. Sides are the leg's own: of the lead at the base, at the rod; of the rod at the top.
    type :: rod_leg_type
        integer :: base = 0, lead = 0, rod = 0, top = 0
        integer :: first = 0, inner = 0, outer = 0         !! joints, from the base on; of a rod alone no first
        integer :: first_side = 0, inner_side = 0, outer_side = 0
        integer :: universal = 0                           !! inner or outer joint
        integer :: holder = 0                              !! of the universal joint's first axis: lead or top
        integer :: holder_side = 0
        logical :: turns = .false.                         !! the lead is a crank
    end type rod_leg_type

    !> Where the lead's end of the rod is, and how it goes.
    type :: lead_type
        type(value) :: cosine, sine                        !! of the crank's angle, from the base
        type(value) :: slide                               !! of the carriage [m]
        type(value) :: s                                   !! see above
        type(vector) :: rod                                !! from E to P, world axes [m]
        type(vector) :: way                                !! t, world axes [m, 1]
        type(vector) :: bend                               !! of a crank: how t changes with its angle [m]
        type(value) :: rate, rate_2                        !! of angle or slide
    end type lead_type

contains

    !> Links of the step: lead, rod; joints: hinge or slide, inner, outer.
    subroutine close_rod_leg(mechanism, step, branch, equations)
        type(mechanism_type), intent(inout) :: mechanism
        type(step_type), intent(in) :: step
        type(value), intent(in) :: branch
        type(system_type), intent(inout), optional :: equations    !! where accelerations stay unknown, if they do
        type(rod_leg_type) :: leg
        type(lead_type) :: lead
        type(value) :: length
        type(vector) :: own_rod, p_point, e, v(2), a(2)    ! place of E; velocities and accelerations of E, P

        leg = rod_leg_of(mechanism, step)
        own_rod = scene_rod(mechanism, step)
        length = sqrt(own_rod.dot.own_rod)
        p_point = marker_point(mechanism, leg%outer, 3 - leg%outer_side)
        call place_lead(mechanism, leg, length, point_position(mechanism%bodies, leg%top, p_point), branch, lead)
        e = point_position(mechanism%bodies, leg%top, p_point) - lead%rod
        v(2) = point_velocity(mechanism%bodies, leg%top, p_point)
        a(2) = point_acceleration(mechanism%bodies, leg%top, p_point, world_axes)
        if (present(equations)) a(2) = named_vector(equations, a(2))
        call move_lead(mechanism%bodies, leg%base, e, lead, v, a, equations)
        call put_lead(mechanism, leg, lead)
        call put_rod(mechanism, leg, length, lead%rod, e, v, a)
    end subroutine close_rod_leg

    !> A rod alone. Link of the step: the rod; joints: inner, outer.
    subroutine close_rod(mechanism, step)
        type(mechanism_type), intent(inout) :: mechanism
        type(step_type), intent(in) :: step
        type(rod_leg_type) :: leg
        type(vector) :: own_rod, end(2), p(2), v(2), a(2)    ! both ends on the known links; places, velocities, accelerations
        integer :: link(2), k

        leg = rod_leg_of(mechanism, step)
        own_rod = scene_rod(mechanism, step)
        link = [leg%lead, leg%top]
        end = [marker_point(mechanism, leg%inner, leg%inner_side), marker_point(mechanism, leg%outer, 3 - leg%outer_side)]
        do k = 1, 2
            p(k) = point_position(mechanism%bodies, link(k), end(k))
            v(k) = point_velocity(mechanism%bodies, link(k), end(k))
            a(k) = point_acceleration(mechanism%bodies, link(k), end(k), world_axes)
        end do
        call put_rod(mechanism, leg, sqrt(own_rod.dot.own_rod), p(2) - p(1), p(1), v, a)
    end subroutine close_rod

    pure function rod_leg_of(mechanism, step) result(leg)
        type(mechanism_type), intent(in) :: mechanism
        type(step_type), intent(in) :: step
        type(rod_leg_type) :: leg

        associate (joint => mechanism%model%joint)
            leg%turns = step%kind == step_rus
            leg%rod = rod_of(step)
            leg%inner = inner_of_rod(step)
            leg%outer = outer_of_rod(step)
            leg%inner_side = 3 - side_of(joint(leg%inner), leg%rod)
            leg%outer_side = side_of(joint(leg%outer), leg%rod)
            leg%lead = joint(leg%inner)%link(leg%inner_side)
            if (is_rod_leg(step%kind)) then
                leg%first = step%joint(1)
                leg%first_side = side_of(joint(leg%first), leg%lead)
                leg%base = joint(leg%first)%link(3 - leg%first_side)
            end if
            leg%top = joint(leg%outer)%link(3 - leg%outer_side)
            leg%universal = universal_of_rod(mechanism%model, step)
            leg%holder_side = 3 - side_of(joint(leg%universal), leg%rod)
            leg%holder = joint(leg%universal)%link(leg%holder_side)
        end associate
    end function rod_leg_of

    ! ---------------------------------------------------------------- crank or carriage

    subroutine place_lead(mechanism, leg, length, p, branch, lead)
        type(mechanism_type), intent(inout) :: mechanism
        type(rod_leg_type), intent(in) :: leg
        type(value), intent(in) :: length              !! of the rod [m]
        type(vector), intent(in) :: p                  !! world axes [m]
        type(value), intent(in) :: branch
        type(lead_type), intent(out) :: lead
        type(rotation) :: own_frame, base_frame, to_world
        type(vector) :: w, own                         ! to P, axes of the base's marker; to E, of the lead's

        base_frame = marker_frame(mechanism, leg%first, 3 - leg%first_side)
        to_world = rotation_of(mechanism%bodies, leg%base)*base_frame
        w = to_world.unrotate.(p - point_position(mechanism%bodies, leg%base, &
                                                  marker_point(mechanism, leg%first, 3 - leg%first_side)))
        own_frame = marker_frame(mechanism, leg%first, leg%first_side)
        own = own_frame.unrotate.(marker_point(mechanism, leg%inner, leg%inner_side) &
                                  - marker_point(mechanism, leg%first, leg%first_side))
        if (leg%turns) then
            call place_crank(mechanism, own, w, length, branch, lead)
        else
            call place_carriage(mechanism, own, w, length, branch, lead)
        end if
        lead%rod = to_world.rotate.lead%rod
        lead%way = to_world.rotate.lead%way
        lead%bend = to_world.rotate.lead%bend
    end subroutine place_lead

    !> Vectors in the axes of the base's marker.
    subroutine place_crank(mechanism, own, w, length, branch, lead)
        type(mechanism_type), intent(inout) :: mechanism
        type(vector), intent(in) :: own, w
        type(value), intent(in) :: length, branch
        type(lead_type), intent(inout) :: lead
        type(vector) :: n, rise
        type(value) :: radius_2, distance_2, total, c, per

        rise = vector(zero(), zero(), w%z - own%z)
        radius_2 = square(own%x) + square(own%y)
        distance_2 = square(w%x) + square(w%y)
        total = distance_2 + radius_2 + square(rise%z)
        c = 0.5_wp*(total - square(length))
        ! the sine between rod and way, times their lengths
        lead%s = branch*root_of(mechanism, radius_2*distance_2 - square(c), least_square*(radius_2*square(length)), &
                                rounding*(radius_2*distance_2 + abs(c)*(total + square(length))))
        per = reciprocal(distance_2)
        n = vector(per*(c*w%x - lead%s*w%y), per*(c*w%y + lead%s*w%x), own%z)
        per = reciprocal(radius_2)
        lead%cosine = per*(own%x*n%x + own%y*n%y)
        lead%sine = per*(own%x*n%y - own%y*n%x)
        lead%slide = zero()
        lead%rod = w - n
        lead%way = vector(-n%y, n%x, zero())
        lead%bend = vector(-n%x, -n%y, zero())
    end subroutine place_crank

    !> Place a carriage on a slide in the plane of its rod, as a crank is.
    subroutine place_carriage(mechanism, own, w, length, branch, lead)
        type(mechanism_type), intent(inout) :: mechanism
        type(vector), intent(in) :: own, w
        type(value), intent(in) :: length, branch
        type(lead_type), intent(inout) :: lead
        type(value) :: aside_2

        lead%rod = w - own
        aside_2 = square(lead%rod%x) + square(lead%rod%y)
        lead%s = branch*root_of(mechanism, square(length) - aside_2, least_square*square(length), &
                                rounding*(square(length) + aside_2))
        lead%slide = lead%rod%z + lead%s
        lead%rod%z = -lead%s
        lead%way = unit_vector(3)
        lead%bend = zero_vector()
    end subroutine place_carriage

    !> Rates of angle or slide, for the rod to keep its length; by them E moves. P moves already.
    subroutine move_lead(bodies, base, e, lead, v, a, equations)
        type(bodies_type), intent(in) :: bodies
        integer, intent(in) :: base
        type(vector), intent(in) :: e                  !! place of E, world axes [m]
        type(lead_type), intent(inout) :: lead
        type(vector), intent(inout) :: v(2), a(2)      !! of E and P
        type(system_type), intent(inout), optional :: equations
        type(value) :: per

        per = -reciprocal(lead%s)
        v(1) = carried_velocity(bodies, base, e)
        lead%rate = per*(lead%rod.dot.(v(2) - v(1)))
        v(1) = v(1) + lead%rate*lead%way
        a(1) = carried_acceleration(bodies, base, e) + square(lead%rate)*lead%bend &
               + (2.0_wp*lead%rate)*(omega_of(bodies, base, world_axes) .cross.lead%way)
        lead%rate_2 = per*((lead%rod.dot.(a(2) - a(1))) + ((v(2) - v(1)) .dot.(v(2) - v(1))))
        if (present(equations)) lead%rate_2 = named(equations, lead%rate_2)
        a(1) = a(1) + lead%rate_2*lead%way
    end subroutine move_lead

    subroutine put_lead(mechanism, leg, lead)
        type(mechanism_type), intent(inout) :: mechanism
        type(rod_leg_type), intent(in) :: leg
        type(lead_type), intent(in) :: lead

        if (leg%turns) then
            call walk_hinge(mechanism, leg%first, leg%first_side, lead%cosine, lead%sine, [lead%rate, lead%rate_2])
        else
            call walk_slide(mechanism, leg%first, leg%first_side, [lead%slide, lead%rate, lead%rate_2])
        end if
    end subroutine put_lead

    ! ---------------------------------------------------------------- rod

    !> Both ends are known: E is the origin of its axes, z points to P, y is the second axis of its universal joint.
    subroutine put_rod(mechanism, leg, length, rod, e, v, a)
        type(mechanism_type), intent(inout) :: mechanism
        type(rod_leg_type), intent(in) :: leg
        type(value), intent(in) :: length              !! [m]
        type(vector), intent(in) :: rod, e             !! from E to P; place of E, world axes [m]
        type(vector), intent(in) :: v(2), a(2)         !! velocities and accelerations of E and P
        type(rotation) :: axes, frame
        type(vector) :: u, across, w, b, beta, along
        type(value) :: per_length, c, m, per_m, k

        associate (bodies => mechanism%bodies)
            frame = marker_frame(mechanism, leg%universal, leg%holder_side)
            u = rotation_of(bodies, leg%holder) .rotate.frame%z
            per_length = reciprocal(length)
            axes%z = per_length*rod
            across = axes%z.cross.u
            ! a rod along the first axis of its universal joint has lost its second
            call must_be_positive(mechanism, (across.dot.across) - least_square)
            m = sqrt(across.dot.across)
            per_m = reciprocal(m)
            call declare_inverse(m, per_m)
            axes%y = per_m*across
            c = axes%z.dot.u
            k = c*per_m
            axes%x = per_m*u - k*axes%z

            along = axes.unrotate.(v(2) - v(1))
            b = axes.unrotate.omega_of(bodies, leg%holder, world_axes)
            w = turning_of_line(per_length, k, along, b)
            along = axes.unrotate.(a(2) - a(1))
            beta = axes.unrotate.alpha_of(bodies, leg%holder, world_axes)

            bodies%body(leg%rod)%position = e
            bodies%body(leg%rod)%velocity = v(1)
            call set_vector(bodies%body(leg%rod)%acceleration, world_axes, a(1))
            call set_vector(bodies%body(leg%rod)%acceleration, own_axes, axes.unrotate.a(1))
            associate (turning => bodies%turning(bodies%body(leg%rod)%turning))
                turning%r = axes
                call set_vector(turning%omega, own_axes, w)
                call set_vector(turning%alpha, own_axes, turning_of_line_2(per_length, k, zero(), w, along, b, beta))
            end associate
        end associate
    end subroutine put_rod
end module linkdyn_rod_leg
