!> The planar dyads in closed form: where both links stand. How they move follows from their joints' constraints.
!>
!> R stands for a revolute, P for a prismatic joint, in the order outer, inner, outer. A and B are the outer joints' points
!> on known links, C is the inner joint. All positions are found by vectors, without an angle; where two assemblies meet
!> both are kept apart by a sign, the branch.
module linkdyn_dyads
    use linkdyn_bodies, only: point_position, rotation_of
    use linkdyn_kinds, only: wp
    use linkdyn_mechanism, only: mechanism_type, marker_point, marker_frame, set_slide, must_be_positive, root_of, &
        least_square
    use linkdyn_model, only: step_type, side_of, step_rrr, step_rrp, step_rpr, step_prp, step_ppr
    use linkdyn_value, only: value, zero, one, is_constant, operator(+), operator(-), operator(*), sqrt, abs, reciprocal, square
    use linkdyn_vector, only: vector, rotation, unit_vector, identity_rotation, operator(+), operator(-), operator(*), &
        operator(.dot.), operator(.rotate.)
    implicit none (type, external)
    private
    public :: place_dyad, find_ways
    public :: half_type, half_of, outer_point, led_shift, left_of, inner_point, inner_marker, led_axis, drawn_arm

    real(wp), parameter :: rounding = 8*epsilon(1.0_wp)    !! of squares that are products, relative to the lengths in them

    !> One of the dyad's links with its outer and its inner joint.
    type :: half_type
        integer :: link = 0                                !! at the outer joint
        integer :: tip = 0                                 !! at the inner joint: the link itself, or what slides on it
        integer :: led = 0                                 !! that slide; 0: there is none
        integer :: given = 0                               !! coordinate, or what gears lead, that gives its variable
        integer :: led_side = 0                            !! of the link in it
        integer :: known = 0                               !! link at the other side of the outer joint
        integer :: shift(2) = 0                            !! coordinates by which that link sees the outer joint's point; 0: there
                                                           !! are none
        integer :: outer = 0, inner = 0                    !! joints
        integer :: side = 0, inner_side = 0                !! of the link in the outer, of the tip in the inner one
        integer :: sense = 1                               !! +1: a slide at the outer joint grows as the link moves along its axis
    end type half_type

contains

    !> Place both links. The branch is +1 or -1. How their joint moves with each of them is found besides.
    subroutine place_dyad(mechanism, step, branch)
        type(mechanism_type), intent(inout) :: mechanism
        type(step_type), intent(in) :: step
        type(value), intent(in) :: branch
        type(half_type) :: half(2)

        half(1) = half_of(mechanism, step, 1)
        half(2) = half_of(mechanism, step, 2)
        select case (step%kind)
        case (step_rrr)
            call place_rrr(mechanism, half, branch)
        case (step_rrp)
            call place_rrp(mechanism, half, branch)
        case (step_rpr)
            call place_rpr(mechanism, half, branch)
        case (step_prp)
            call place_prp(mechanism, half, branch)
        case (step_ppr)
            call place_ppr(mechanism, half)
        end select
        call place_tips(mechanism, half)
        call find_ways(mechanism, step)
    end subroutine place_dyad

    pure function half_of(mechanism, step, i) result(half)
        type(mechanism_type), intent(in) :: mechanism
        type(step_type), intent(in) :: step
        integer, intent(in) :: i
        type(half_type) :: half
        integer :: k

        half%link = step%link(i)
        half%tip = half%link
        half%outer = step%joint(2*i - 1)
        half%inner = step%joint(2)
        do k = 3, step%n_link
            associate (led => step%joint(k + 1))
                if (all(mechanism%model%joint(led)%link /= half%link)) cycle
                half%tip = step%link(k)
                half%led = led
                half%given = step%coordinate(k - 2)
                half%led_side = side_of(mechanism%model%joint(led), half%link)
            end associate
        end do
        half%side = side_of(mechanism%model%joint(half%outer), half%link)
        half%inner_side = side_of(mechanism%model%joint(half%inner), half%tip)
        half%known = mechanism%model%joint(half%outer)%link(3 - half%side)
        half%shift = step%coordinate(2*i + 1:2*i + 2)
    end function half_of

    ! ---------------------------------------------------------------- the five kinds

    !> Two circles meet: C from A along the line AB and across it.
    subroutine place_rrr(mechanism, half, branch)
        type(mechanism_type), intent(inout) :: mechanism
        type(half_type), intent(in) :: half(2)
        type(value), intent(in) :: branch
        type(vector) :: own(2), d, arm
        type(value) :: length(2), sum, difference, square_distance, distance, along, across, half_per_square

        own(1) = own_arm(mechanism, half(1))
        own(2) = own_arm(mechanism, half(2))
        length = sqrt(own.dot.own)
        sum = length(1) + length(2)
        difference = length(1) - length(2)
        d = outer_point(mechanism, half(2)) - outer_point(mechanism, half(1))
        square_distance = d.dot.d
        distance = sqrt(square_distance)
        half_per_square = 0.5_wp*reciprocal(square_distance)
        along = 0.5_wp + (sum*difference)*half_per_square
        ! The lengths first: a short distance added to a length would lose its digits.
        across = ((sum - distance)*(sum + distance))*((distance + difference)*(distance - difference))
        ! 16 times the square of the triangle's area: that of the sine, times (2 length(1) length(2))**2
        across = (branch*root_of(mechanism, across, (4*least_square)*square(length(1)*length(2)), &
                                 rounding*square(sum*(distance + abs(difference)))))*half_per_square
        arm = along*d + across*left_of(d)
        call hang(mechanism, half(1), turn_onto(own(1), arm))
        call hang(mechanism, half(2), turn_onto(own(2), arm - d))
    end subroutine place_rrr

    !> A circle about A meets the line of a slide: C0 is the inner joint at slide zero, u the slide's direction.
    subroutine place_rrp(mechanism, half, branch)
        type(mechanism_type), intent(inout) :: mechanism
        type(half_type), intent(in) :: half(2)
        type(value), intent(in) :: branch
        type(vector) :: own, u, d, arm
        type(value) :: length, height, forward

        own = own_arm(mechanism, half(1))
        length = sqrt(own.dot.own)
        call turn_with_known(mechanism, half(2))
        u = slide_direction(mechanism, half(2))
        d = point_at_zero(mechanism, half(2)) - outer_point(mechanism, half(1))
        height = left_of(u) .dot.d
        forward = branch*half_chord(mechanism, length, height)
        arm = forward*u + height*left_of(u)
        call hang(mechanism, half(1), turn_onto(own, arm))
        call slide_out(mechanism, half(2), u, forward - (d.dot.u))
    end subroutine place_rrp

    !> A pair of sliding links between two hinges: the pair turns so that B falls on its line.
    subroutine place_rpr(mechanism, half, branch)
        type(mechanism_type), intent(inout) :: mechanism
        type(half_type), intent(in) :: half(2)
        type(value), intent(in) :: branch
        type(rotation) :: r
        type(vector) :: axis(2), d, u, offset(2)
        type(value) :: height, distance2, forward, per
        integer :: i

        ! both links turn as one
        do i = 1, 2
            axis(i) = inner_axis(mechanism, half(i))
            offset(i) = own_arm(mechanism, half(i))
        end do
        ! of B beside the line through A, in slide axes
        height = (offset(1) .dot.left_of(axis(1))) - (offset(2) .dot.left_of(axis(2)))
        d = outer_point(mechanism, half(2)) - outer_point(mechanism, half(1))
        distance2 = d.dot.d
        forward = branch*half_chord(mechanism, sqrt(distance2), height)
        per = reciprocal(distance2)
        u = per*(forward*d - height*left_of(d))
        do i = 1, 2
            r = turn_onto(axis(i), u)
            call hang(mechanism, half(i), r)
        end do
    end subroutine place_rpr

    !> Two slides and a hinge between: C where both lines meet. As the lines become parallel C goes away without end, and what
    !> closes beyond is not what the motion comes to; the branch is the side on which the second line is turned off the first.
    subroutine place_prp(mechanism, half, branch)
        type(mechanism_type), intent(inout) :: mechanism
        type(half_type), intent(in) :: half(2)
        type(value), intent(in) :: branch
        type(vector) :: u(2), gap
        type(value) :: sine, per
        integer :: i

        do i = 1, 2
            call turn_with_known(mechanism, half(i))
            u(i) = slide_direction(mechanism, half(i))
        end do
        sine = left_of(u(1)) .dot.u(2)
        call must_turn_off(mechanism, sine, branch)
        gap = point_at_zero(mechanism, half(2)) - point_at_zero(mechanism, half(1))
        per = reciprocal(sine)
        call slide_out(mechanism, half(1), u(1), -(per*(left_of(u(2)) .dot.gap)))
        call slide_out(mechanism, half(2), u(2), -(per*(left_of(u(1)) .dot.gap)))
    end subroutine place_prp

    !> A slide on a known link, a slide on that slide, a hinge at B: everything turns with the known link.
    subroutine place_ppr(mechanism, half)
        type(mechanism_type), intent(inout) :: mechanism
        type(half_type), intent(in) :: half(2)
        type(vector) :: u(2), gap, inner, own
        type(value) :: per

        call turn_with_known(mechanism, half(1))
        u(1) = slide_direction(mechanism, half(1))
        u(2) = rotation_of(mechanism%bodies, half(1)%link) .rotate.inner_axis(mechanism, half(1))
        call must_be_positive(mechanism, square(left_of(u(1)) .dot.u(2)) - least_square)
        mechanism%bodies%turning(mechanism%bodies%body(half(2)%link)%turning)%r = &
            turn_onto(inner_axis(mechanism, half(2)), u(2))
        ! from the inner marker of the second link to its hinge
        own = rotation_of(mechanism%bodies, half(2)%link) .rotate.own_arm(mechanism, half(2))
        inner = point_at_zero(mechanism, half(1)) - own
        gap = outer_point(mechanism, half(2)) - inner
        per = reciprocal(left_of(u(1)) .dot.u(2))
        call slide_out(mechanism, half(1), u(1), -(per*(left_of(u(2)) .dot.gap)))
        call hang(mechanism, half(2), rotation_of(mechanism%bodies, half(2)%link))
    end subroutine place_ppr

    !> How the inner joint moves with each of the links, of a dyad that is placed: turned by a unit angle about its outer hinge, or
    !> along its slide.
    subroutine find_ways(mechanism, step)
        type(mechanism_type), intent(inout) :: mechanism
        type(step_type), intent(in) :: step
        type(half_type) :: half(2)
        type(vector) :: way(2)
        type(value) :: length(2)

        half(1) = half_of(mechanism, step, 1)
        half(2) = half_of(mechanism, step, 2)
        length = one()
        select case (step%kind)
        case (step_rrr)
            way = [arm_of_half(1), arm_of_half(2)]
            length = [length_of_half(1), length_of_half(2)]
        case (step_rrp)
            way = [left_of(arm_of_half(1)), slide_direction(mechanism, half(2))]
            length(1) = length_of_half(1)
        case (step_rpr)
            way = [left_of(outer_point(mechanism, half(2)) - outer_point(mechanism, half(1))), inner_direction()]
            length(1) = sqrt(way(1) .dot.way(1))
        case (step_prp)
            way = [slide_direction(mechanism, half(1)), slide_direction(mechanism, half(2))]
        case (step_ppr)
            way = [slide_direction(mechanism, half(1)), inner_direction()]
        end select
        mechanism%ways(:, step%first) = way
        mechanism%way_length(:, step%first) = length

    contains

        !> From the outer to the inner joint; both of an RRR dyad are turned by a right angle alike.
        function arm_of_half(i) result(arm)
            integer, intent(in) :: i
            type(vector) :: arm

            if (half(i)%led > 0) then
                arm = drawn_arm(mechanism, half(i))
            else
                arm = rotation_of(mechanism%bodies, half(i)%link) .rotate.own_arm(mechanism, half(i))
            end if
        end function arm_of_half

        !> Links do not grow, but for those with a slide inside.
        function length_of_half(i) result(length)
            integer, intent(in) :: i
            type(value) :: length
            type(vector) :: arm

            arm = own_arm(mechanism, half(i))
            length = sqrt(arm.dot.arm)
        end function length_of_half

        function inner_direction() result(u)
            type(vector) :: u
            type(rotation) :: frame

            frame = marker_frame(mechanism, half(1)%inner, half(1)%inner_side)
            u = rotation_of(mechanism%bodies, half(1)%tip) .rotate.frame%z
        end function inner_direction
    end subroutine find_ways

    ! ---------------------------------------------------------------- geometry

    !> Two lines are not parallel, and turned off each other to the side that the branch says; lines that do not turn stay there.
    subroutine must_turn_off(mechanism, sine, branch)
        type(mechanism_type), intent(inout) :: mechanism
        type(value), intent(in) :: sine, branch

        if (is_constant(sine)) then
            call must_be_positive(mechanism, square(sine) - least_square)
        else if (mechanism%keeps_at_limits) then
            mechanism%closes = [mechanism%closes, branch*sine]
        else
            call must_be_positive(mechanism, branch*sine - sqrt(least_square))
        end if
    end subroutine must_turn_off

    !> A vector of the plane turned left by a right angle.
    function left_of(v) result(w)
        type(vector), intent(in) :: v
        type(vector) :: w

        w = vector(-v%y, v%x, zero())
    end function left_of

    !> Rotation that turns a vector of the link onto a direction of the plane of any length ratio one.
    function turn_onto(own, arm) result(r)
        type(vector), intent(in) :: own                    !! in the link [m]
        type(vector), intent(in) :: arm                    !! as it stands, of the same length [m]
        type(rotation) :: r
        type(value) :: c, s, per

        per = reciprocal(own.dot.own)
        c = arm%x*(own%x*per) + arm%y*(own%y*per)
        s = arm%y*(own%x*per) - arm%x*(own%y*per)
        r%x = vector(c, s, zero())
        r%y = vector(-s, c, zero())
        r%z = unit_vector(3)
    end function turn_onto

    !> Half the chord that a line at a given height cuts from a circle.
    function half_chord(mechanism, radius, height) result(chord)
        type(mechanism_type), intent(inout) :: mechanism
        type(value), intent(in) :: radius, height
        type(value) :: chord
        type(value) :: product

        product = (radius - height)*(radius + height)
        chord = root_of(mechanism, product, least_square*square(radius), rounding*square(radius))
    end function half_chord

    ! ---------------------------------------------------------------- the halves

    !> From the outer to the inner joint in the link.
    function own_arm(mechanism, half) result(arm)
        type(mechanism_type), intent(in) :: mechanism
        type(half_type), intent(in) :: half
        type(vector) :: arm

        arm = inner_point(mechanism, half) - marker_point(mechanism, half%outer, half%side)
    end function own_arm

    !> The inner joint's point in the axes of the link: in a half with a slide by way of its tip.
    function inner_point(mechanism, half) result(point)
        type(mechanism_type), intent(in) :: mechanism
        type(half_type), intent(in) :: half
        type(vector) :: point

        point = inner_marker(mechanism, half)
        if (half%led == 0) return
        point = led_point(mechanism, half) &
                + in_link(mechanism, half, point - marker_point(mechanism, half%led, 3 - half%led_side))
    end function inner_point

    !> Where the slide inside a half has drawn the tip's marker, in the axes of the link.
    function led_point(mechanism, half) result(point)
        type(mechanism_type), intent(in) :: mechanism
        type(half_type), intent(in) :: half
        type(vector) :: point

        point = marker_point(mechanism, half%led, half%led_side) + mechanism%q(half%given)*led_axis(mechanism, half)
    end function led_point

    !> From the outer to the inner joint of a half with a slide, as it is placed, world axes.
    function drawn_arm(mechanism, half) result(arm)
        type(mechanism_type), intent(in) :: mechanism
        type(half_type), intent(in) :: half
        type(vector) :: arm

        arm = point_position(mechanism%bodies, half%tip, inner_marker(mechanism, half)) - outer_point(mechanism, half)
    end function drawn_arm

    !> The inner joint's point in the axes of the tip.
    function inner_marker(mechanism, half) result(point)
        type(mechanism_type), intent(in) :: mechanism
        type(half_type), intent(in) :: half
        type(vector) :: point

        point = marker_point(mechanism, half%inner, half%inner_side)
    end function inner_marker

    !> Direction of an inner slide in the axes of the link.
    function inner_axis(mechanism, half) result(u)
        type(mechanism_type), intent(in) :: mechanism
        type(half_type), intent(in) :: half
        type(vector) :: u
        type(rotation) :: frame

        frame = marker_frame(mechanism, half%inner, half%inner_side)
        u = in_link(mechanism, half, frame%z)
    end function inner_axis

    !> Where the tip goes as the slide inside a half grows, in the axes of the link.
    function led_axis(mechanism, half) result(u)
        type(mechanism_type), intent(in) :: mechanism
        type(half_type), intent(in) :: half
        type(vector) :: u
        type(rotation) :: frame

        frame = marker_frame(mechanism, half%led, half%led_side)
        u = frame%z
        if (half%led_side == 2) u = -u
    end function led_axis

    !> A vector of the tip in the axes of the link.
    function in_link(mechanism, half, v) result(w)
        type(mechanism_type), intent(in) :: mechanism
        type(half_type), intent(in) :: half
        type(vector), intent(in) :: v
        type(vector) :: w

        w = v
        if (half%led > 0) w = turn_of_tip(mechanism, half) .rotate.v
    end function in_link

    !> From the tip's axes to those of the link: the slide holds both markers parallel.
    function turn_of_tip(mechanism, half) result(r)
        type(mechanism_type), intent(in) :: mechanism
        type(half_type), intent(in) :: half
        type(rotation) :: r
        type(rotation) :: frame(2)

        r = identity_rotation()
        if (mechanism%bodies%body(half%tip)%turning == mechanism%bodies%body(half%link)%turning) return
        frame(1) = marker_frame(mechanism, half%led, half%led_side)
        frame(2) = marker_frame(mechanism, half%led, 3 - half%led_side)
        r = turn_onto(frame(2)%z, frame(1)%z)
    end function turn_of_tip

    !> The tips of halves that are placed.
    subroutine place_tips(mechanism, half)
        type(mechanism_type), intent(inout) :: mechanism
        type(half_type), intent(in) :: half(2)
        integer :: i

        do i = 1, 2
            if (half(i)%led == 0) cycle
            associate (bodies => mechanism%bodies, link => half(i)%link, tip => half(i)%tip)
                if (bodies%body(tip)%turning /= bodies%body(link)%turning) &
                    bodies%turning(bodies%body(tip)%turning)%r = rotation_of(bodies, link)*turn_of_tip(mechanism, half(i))
                bodies%body(tip)%position = point_position(bodies, link, led_point(mechanism, half(i))) &
                    - (rotation_of(bodies, tip) .rotate.marker_point(mechanism, half(i)%led, 3 - half(i)%led_side))
                call set_slide(mechanism, half(i)%led, mechanism%q(half(i)%given))
            end associate
        end do
    end subroutine place_tips

    !> Where the outer joint's point on the known link is; where coordinates give a point of the half, that is.
    function outer_point(mechanism, half) result(point)
        type(mechanism_type), intent(in) :: mechanism
        type(half_type), intent(in) :: half
        type(vector) :: point

        point = point_position(mechanism%bodies, half%known, marker_point(mechanism, half%outer, 3 - half%side))
        if (half%shift(1) > 0) point = point + led_shift(mechanism, half, mechanism%q)
    end function outer_point

    !> Coordinates of a point, or their rates, from the known link's marker on, world axes.
    function led_shift(mechanism, half, given) result(shift)
        type(mechanism_type), intent(in) :: mechanism
        type(half_type), intent(in) :: half
        type(value), intent(in) :: given(:)                !! all that is given [m]
        type(vector) :: shift
        type(rotation) :: frame

        frame = marker_frame(mechanism, half%outer, 3 - half%side)
        shift = rotation_of(mechanism%bodies, half%known) .rotate. &
                (frame.rotate.vector(given(half%shift(1)), given(half%shift(2)), zero()))
    end function led_shift

    !> The link hangs on its outer hinge, turned as given.
    subroutine hang(mechanism, half, r)
        type(mechanism_type), intent(inout) :: mechanism
        type(half_type), intent(in) :: half
        type(rotation), intent(in) :: r

        mechanism%bodies%turning(mechanism%bodies%body(half%link)%turning)%r = r
        mechanism%bodies%body(half%link)%position = outer_point(mechanism, half) &
                                                    - (r.rotate.marker_point(mechanism, half%outer, half%side))
    end subroutine hang

    !> A link on a slide of a known link turns with that.
    subroutine turn_with_known(mechanism, half)
        type(mechanism_type), intent(inout) :: mechanism
        type(half_type), intent(in) :: half
        type(rotation) :: own, known, r

        associate (bodies => mechanism%bodies)
            if (bodies%body(half%link)%turning == bodies%body(half%known)%turning) return
            own = marker_frame(mechanism, half%outer, half%side)
            known = marker_frame(mechanism, half%outer, 3 - half%side)
            r = rotation_of(bodies, half%known)
            bodies%turning(bodies%body(half%link)%turning)%r = turn_onto(own%z, r.rotate.known%z)
        end associate
    end subroutine turn_with_known

    !> Along which the link moves as its slide on the known link grows.
    function slide_direction(mechanism, half) result(u)
        type(mechanism_type), intent(in) :: mechanism
        type(half_type), intent(in) :: half
        type(vector) :: u
        type(rotation) :: frame

        frame = marker_frame(mechanism, half%outer, 3 - half%side)
        u = rotation_of(mechanism%bodies, half%known) .rotate.frame%z
    end function slide_direction

    !> Where the inner joint's point of a link on a slide is while the outer markers' points coincide.
    function point_at_zero(mechanism, half) result(point)
        type(mechanism_type), intent(in) :: mechanism
        type(half_type), intent(in) :: half
        type(vector) :: point

        point = outer_point(mechanism, half) + (rotation_of(mechanism%bodies, half%link) .rotate.own_arm(mechanism, half))
    end function point_at_zero

    !> The link stands `forward` along its slide.
    subroutine slide_out(mechanism, half, u, forward)
        type(mechanism_type), intent(inout) :: mechanism
        type(half_type), intent(in) :: half
        type(vector), intent(in) :: u
        type(value), intent(in) :: forward

        mechanism%bodies%body(half%link)%position = &
            outer_point(mechanism, half) + forward*u &
            - (rotation_of(mechanism%bodies, half%link) .rotate.marker_point(mechanism, half%outer, half%side))
        if (half%side == 1) then
            call set_slide(mechanism, half%outer, -forward)
        else
            call set_slide(mechanism, half%outer, forward)
        end if
    end subroutine slide_out
end module linkdyn_dyads
