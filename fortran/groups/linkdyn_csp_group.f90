!> The CSP group in closed form: coupler on a cylindrical joint, output on a slide, a ball between them. Where the ball's
!> line along the slide meets the cylinder that the ball describes about the other axis.
module linkdyn_csp_group
    use linkdyn_bodies, only: point_position, rotation_of
    use linkdyn_mechanism, only: mechanism_type, marker_point, marker_frame, set_slide, must_be_positive, least_square
    use linkdyn_model, only: step_type, side_of
    use linkdyn_value, only: value, operator(+), operator(-), operator(*), operator(/), sqrt, reciprocal, select, square
    use linkdyn_vector, only: vector, rotation, operator(+), operator(-), operator(*), operator(.dot.), operator(.cross.), &
        operator(.rotate.), operator(.unrotate.)
    implicit none (type, external)
    private
    public :: place_csp, csp_lines

contains

    !> Links of the step: coupler, output; joints: cylindrical, spherical, prismatic. Branch +1: the farther meeting along
    !> the slide, -1: the nearer.
    subroutine place_csp(mechanism, step, branch)
        type(mechanism_type), intent(inout) :: mechanism
        type(step_type), intent(in) :: step
        type(value), intent(in) :: branch
        type(rotation) :: own_frame, axis_frame, slide_frame, frame
        type(vector) :: own_axis_point, own_s, offset, u, y, to_s, axis_point, span, a, b, w, n, m
        type(value) :: aa, ab, bb, radius2, root, slide, sigma, per
        integer :: c, s, p, side_c, side_s, side_p, known_c, known_p    ! sides of the group's links; known links

        c = step%joint(1)
        s = step%joint(2)
        p = step%joint(3)
        associate (model => mechanism%model, bodies => mechanism%bodies, coupler => step%link(1), output => step%link(2))
            side_c = side_of(model%joint(c), coupler)
            side_s = side_of(model%joint(s), coupler)
            side_p = side_of(model%joint(p), output)
            known_c = model%joint(c)%link(3 - side_c)
            known_p = model%joint(p)%link(3 - side_p)
            axis_frame = rotation_of(bodies, known_c)*marker_frame(mechanism, c, 3 - side_c)
            slide_frame = rotation_of(bodies, known_p)*marker_frame(mechanism, p, 3 - side_p)
            if (bodies%body(output)%turning /= bodies%body(known_p)%turning) then
                own_frame = marker_frame(mechanism, p, side_p)
                bodies%turning(bodies%body(output)%turning)%r = turned_back(slide_frame, own_frame)
            end if

            ! S on the coupler, in its marker's frame: radial x, y, axial z
            own_frame = marker_frame(mechanism, c, side_c)
            own_axis_point = marker_point(mechanism, c, side_c)
            own_s = marker_point(mechanism, s, side_s)
            offset = own_frame.unrotate.(own_s - own_axis_point)
            radius2 = square(offset%x) + square(offset%y)

            ! where the slide's line meets the cylinder
            u = axis_frame%z
            y = slide_frame%z
            to_s = rotation_of(bodies, output) .rotate.(marker_point(mechanism, s, 3 - side_s) - marker_point(mechanism, p, side_p))
            axis_point = point_position(bodies, known_c, marker_point(mechanism, c, 3 - side_c))
            span = point_position(bodies, known_p, marker_point(mechanism, p, 3 - side_p)) + to_s - axis_point
            a = span - (span.dot.u)*u
            b = y - (y.dot.u)*u
            aa = (a.dot.a) - radius2
            ab = a.dot.b
            bb = b.dot.b
            root = square(ab) - bb*aa
            ! where they meet at a sharp angle: root is that of the sine, times radius2 bb
            call must_be_positive(mechanism, root - least_square*(radius2*bb))
            root = branch*sqrt(root)
            ! The root that adds up first; the other from the product of both: no digits cancel.
            slide = select(ab*branch, -(aa*reciprocal(ab + root)), (root - ab)*reciprocal(bb))
            w = span + slide*y
            sigma = w.dot.u
            n = w - sigma*u
            m = u.cross.n
            per = reciprocal(n.dot.n)

            frame%x = per*(offset%x*n - offset%y*m)
            frame%y = per*(offset%y*n + offset%x*m)
            frame%z = u
            bodies%turning(bodies%body(coupler)%turning)%r = turned_back(frame, own_frame)
            bodies%body(coupler)%position = axis_point + w - (rotation_of(bodies, coupler) .rotate.own_s)
            bodies%body(output)%position = axis_point + w &
                                           - (rotation_of(bodies, output) .rotate.marker_point(mechanism, s, 3 - side_s))
            call set_slide(mechanism, c, counted_from(side_c, sigma - offset%z))
            call set_slide(mechanism, p, counted_from(side_p, slide))
        end associate
    end subroutine place_csp

    !> A slide that a link has made, as its joint counts it: the second link against the first.
    function counted_from(side, slide) result(counted)
        integer, intent(in) :: side                    !! of the link
        type(value), intent(in) :: slide
        type(value) :: counted

        counted = slide
        if (side == 1) counted = -slide
    end function counted_from

    !> A link's rotation from the frame of its marker as it stands and as it is fixed in the link.
    function turned_back(frame, own) result(r)
        type(rotation), intent(in) :: frame, own
        type(rotation) :: r

        r%x = frame.rotate.vector(own%x%x, own%y%x, own%z%x)
        r%y = frame.rotate.vector(own%x%y, own%y%y, own%z%y)
        r%z = frame.rotate.vector(own%x%z, own%y%z, own%z%z)
    end function turned_back

    !> The lines of a placed group: the coupler's axis, the radius of the ball about it, which turns with the coupler, and the
    !> slide's direction, which turns with the output; world axes.
    subroutine csp_lines(mechanism, step, axis, radius, length, slide)
        type(mechanism_type), intent(in) :: mechanism
        type(step_type), intent(in) :: step
        type(vector), intent(out) :: axis, radius, slide   !! the radius [m], unit vectors
        type(value), intent(out) :: length                 !! of the radius, a constant of the coupler [m]
        type(rotation) :: of_axis, of_slide
        integer :: side

        associate (coupler => step%link(1), output => step%link(2), joint => mechanism%model%joint)
            side = side_of(joint(step%joint(1)), coupler)
            of_axis = marker_frame(mechanism, step%joint(1), side)
            radius = marker_point(mechanism, step%joint(2), side_of(joint(step%joint(2)), coupler)) &
                     - marker_point(mechanism, step%joint(1), side)
            radius = radius - (radius.dot.of_axis%z)*of_axis%z
            length = sqrt(radius.dot.radius)
            radius = rotation_of(mechanism%bodies, coupler) .rotate.radius
            axis = rotation_of(mechanism%bodies, coupler) .rotate.of_axis%z
            of_slide = marker_frame(mechanism, step%joint(3), side_of(joint(step%joint(3)), output))
            slide = rotation_of(mechanism%bodies, output) .rotate.of_slide%z
        end associate
    end subroutine csp_lines
end module linkdyn_csp_group
