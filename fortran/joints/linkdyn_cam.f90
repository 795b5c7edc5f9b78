!> The cam: a point, the centre of a roller or a straight face of the second link on a curve of the first, in a plane.
!>
!> To second order a cam is the circle that fits its curve best where it is touched. So place, normal and curvature there, which
!> `touch` finds, count as fixed in the cam, and velocities and accelerations are exact all the same.
module linkdyn_cam
    use linkdyn_curve, only: curve_type
    use linkdyn_curve_values, only: curve_point_values
    use linkdyn_joint_kind, only: joint_kind, marker_pair
    use linkdyn_kinds, only: wp
    use linkdyn_partial_joints, only: loose
    use linkdyn_piecewise, only: piecewise_curve
    use linkdyn_record, only: add_curve
    use linkdyn_scene, only: cam_spec, follower_flat
    use linkdyn_value, only: value, zero, constant, nearest_place, farthest_place, sqrt, square, reciprocal, operator(+), &
        operator(-), operator(*)
    use linkdyn_vector, only: vector, operator(+), operator(-), operator(*), operator(.dot.)
    implicit none (type, external)
    private
    public :: cam, cam_touch, pieces_of

    !> Where curve and follower touch, in the axes of the first marker.
    type :: cam_touch
        type(value) :: at(2)                       !! the point; of a roller its centre's on the path of that [m]
        type(value) :: normal(2)                   !! outwards
        type(value) :: round                       !! curvature of that path [1/m]; of a face the curve's radius [m]
        type(value) :: seen(2)                     !! the second marker's point [m]
    end type cam_touch

    type, extends(loose) :: cam
        integer, private :: curve = 0              !! number among the record's
        logical, private :: is_face = .false.
        real(wp), private :: off = 0               !! of the roller's centre from the curve, outwards [m]
    contains
        procedure :: take
        procedure :: constraints
        procedure :: standing
        procedure :: touch
        procedure :: normal
        procedure :: point
        procedure :: arm
    end type cam

contains

    !> What the scene says of it; the curve becomes one of the open record's.
    subroutine take(self, spec)
        class(cam), intent(inout) :: self
        type(cam_spec), intent(in) :: spec

        self%slides = .true.                       ! its force acts at the second marker, wherever that is
        self%is_face = spec%follower == follower_flat
        self%off = spec%side*spec%radius
        if (spec%is_path) self%off = 0
        self%curve = add_curve(pieces_of(spec%curve))
    end subroutine take

    !> A spline as polynomials of the part of the way between two knots.
    pure function pieces_of(curve) result(pieces)
        type(curve_type), intent(in) :: curve
        type(piecewise_curve) :: pieces
        integer :: i, k, n

        n = size(curve%u) - 1
        pieces%is_polar = curve%is_polar
        pieces%knot = curve%knot
        if (curve%is_polar) pieces%axis = reshape([([cos(curve%u(i)), sin(curve%u(i))], i=1, n)], [2, n])
        allocate (pieces%c(4, n, 2), source=0.0_wp)
        do i = 1, n
            associate (h => curve%u(i + 1) - curve%u(i))
                do k = 1, size(curve%value, 2)
                    associate (y => curve%value(i:i + 1, k), m => curve%second(i:i + 1, k))
                        pieces%c(:, i, k) = [y(1), (y(2) - y(1)) - h**2*(2*m(1) + m(2))/6, h**2*m(1)/2, h**2*(m(2) - m(1))/6]
                    end associate
                end do
                if (curve%is_polar) pieces%c(:2, i, 2) = [curve%u(i), h]
            end associate
        end do
    end function pieces_of

    !> How far the follower is off, along the normal. The other term vanishes, and has the second rate that the normal's turning
    !> leaves.
    function constraints(self, pair) result(c)
        class(cam), intent(in) :: self
        type(marker_pair), intent(in) :: pair
        type(value), allocatable :: c(:)
        type(cam_touch) :: touch
        type(vector) :: centre
        type(value) :: off(2)

        touch = self%touch(pair)
        if (self%is_face) then
            centre = (touch%at(1) - touch%round*touch%normal(1))*pair%first%x &
                     + (touch%at(2) - touch%round*touch%normal(2))*pair%first%y
            c = [((centre - pair%gap) .dot.pair%second%z) - touch%round]
            return
        end if
        off = touch%seen - touch%at
        c = [(touch%normal(1)*off(1) + touch%normal(2)*off(2)) &
             + (0.5_wp*touch%round)*square(touch%normal(1)*off(2) - touch%normal(2)*off(1))]
    end function constraints

    !> The circle that the cam is there.
    function standing(self, pair) result(v)
        class(cam), intent(in) :: self
        type(marker_pair), intent(in) :: pair
        type(value), allocatable :: v(:)
        type(cam_touch) :: touch

        touch = self%touch(pair)
        v = [touch%at, touch%normal, touch%round]
        if (self%is_face) v = [touch%at - touch%round*touch%normal, touch%round]
    end function standing

    !> Found from where the markers are alone.
    function touch(self, pair) result(found)
        class(cam), intent(in) :: self
        type(marker_pair), intent(in) :: pair
        type(cam_touch) :: found
        type(curve_point_values) :: foot
        type(value) :: scale, curvature

        found%seen = [pair%gap .dot.pair%first%x, pair%gap .dot.pair%first%y]
        if (self%is_face) then
            found%normal = [-(pair%second%z .dot.pair%first%x), -(pair%second%z .dot.pair%first%y)]
            foot = curve_point_values(self%curve, farthest_place(self%curve, found%normal(1), found%normal(2)))
        else
            foot = curve_point_values(self%curve, nearest_place(self%curve, found%seen(1), found%seen(2)))
        end if
        associate (first => foot%first, second => foot%second)
            scale = reciprocal(sqrt(square(first(1)) + square(first(2))))
            curvature = (first(1)*second(2) - first(2)*second(1))*(scale*square(scale))
            found%at = foot%at
            if (self%is_face) then
                found%round = reciprocal(curvature)
            else
                found%normal = [scale*first(2), -(scale*first(1))]
                found%at = found%at + constant(self%off)*found%normal
                found%round = curvature*reciprocal(1.0_wp + self%off*curvature)
            end if
        end associate
    end function touch

    !> Along which the follower is pressed, world axes.
    function normal(self, pair) result(n)
        class(cam), intent(in) :: self
        type(marker_pair), intent(in) :: pair
        type(vector) :: n
        type(cam_touch) :: touch

        touch = self%touch(pair)
        n = touch%normal(1)*pair%first%x + touch%normal(2)*pair%first%y
    end function normal

    !> From the first marker's point to where the force acts, world axes [m].
    function point(self, pair) result(p)
        class(cam), intent(in) :: self
        type(marker_pair), intent(in) :: pair
        type(vector) :: p
        type(cam_touch) :: touch

        touch = self%touch(pair)
        p = touch%at(1)*pair%first%x + touch%at(2)*pair%first%y
    end function point

    !> Moment about the second marker of a unit force there: a face is pressed beside it [m].
    function arm(self, pair) result(length)
        class(cam), intent(in) :: self
        type(marker_pair), intent(in) :: pair
        type(value) :: length
        type(cam_touch) :: touch

        length = zero()
        if (.not. self%is_face) return
        touch = self%touch(pair)
        length = (touch%at(1) - touch%seen(1))*touch%normal(2) - (touch%at(2) - touch%seen(2))*touch%normal(1)
    end function arm
end module linkdyn_cam
