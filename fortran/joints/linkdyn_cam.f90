!> The cam: a point, the centre of a roller or a straight face of the second link on a curve of the first, across an axis. In space
!> all is looked at along that axis, on which the follower may stand anywhere; a face that leans against it is the line that is
!> seen.
!>
!> To second order a cam is the circle that fits its curve best where it is touched. So place, normal and curvature there, which
!> `touch` finds, count as fixed in the cam, and velocities and accelerations are exact all the same.
module linkdyn_cam
    use linkdyn_curve, only: curve_type
    use linkdyn_curve_values, only: curve_point_values
    use linkdyn_joint_kind, only: marker_pair
    use linkdyn_kinds, only: wp
    use linkdyn_partial_joints, only: loose
    use linkdyn_piecewise, only: piecewise_curve
    use linkdyn_record, only: add_curve
    use linkdyn_scene, only: cam_spec, follower_flat, follower_roller
    use linkdyn_value, only: value, one, constant, nearest_place, farthest_place, sqrt, square, reciprocal, operator(+), &
        operator(-), operator(*)
    use linkdyn_vector, only: vector, zero_vector, operator(+), operator(*), operator(.dot.), operator(.cross.)
    implicit none (type, external)
    private
    public :: cam, pieces_of, take_follower

    !> Where curve and follower touch, in the axes of the first marker.
    type :: cam_touch
        type(value) :: at(2)                       !! the point; of a roller its centre's on the path of that [m]
        type(value) :: normal(2)                   !! outwards
        type(value) :: round                       !! curvature of that path [1/m]; of a face the curve's radius [m]
        type(value) :: seen(2)                     !! the second marker's point [m]
        type(value) :: stretch                     !! of a face that leans: one over what is seen of its normal
    end type cam_touch

    type, extends(loose) :: cam
        integer, private :: curve = 0              !! number among the record's
        logical, private :: is_face = .false.
        logical, private :: is_planar = .false.
        real(wp), private :: off = 0               !! of the roller's centre from the curve, outwards [m]
        real(wp) :: reach = 0                      !! from a roller's centre back to where it touches; in a groove nobody knows on
                                                   !! which side [m]
        logical :: rolls = .false.
    contains
        procedure :: take
        procedure :: constraints
        procedure :: standing
        procedure :: touch
        procedure :: normal
        procedure :: point
        procedure :: moment
        procedure :: off_marker
        procedure :: roller_way
    end type cam

contains

    !> What the scene says of it; the curve becomes one of the open record's.
    subroutine take(self, spec, is_planar)
        class(cam), intent(inout) :: self
        type(cam_spec), intent(in) :: spec
        logical, intent(in) :: is_planar

        call take_follower(self, spec)
        self%is_planar = is_planar
        self%is_face = spec%follower == follower_flat
        self%off = spec%side*spec%radius
        if (spec%is_path) self%off = 0
        self%curve = add_curve(pieces_of(spec%curve))
    end subroutine take

    !> What cams of all kinds have.
    subroutine take_follower(self, spec)
        class(cam), intent(inout) :: self
        type(cam_spec), intent(in) :: spec

        self%slides = .true.                       ! its force acts at the second marker, wherever that is
        self%rolls = spec%follower == follower_roller
        if (.not. spec%is_groove) self%reach = spec%side*spec%radius
    end subroutine take_follower

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
        type(value) :: off(2)

        touch = self%touch(pair)
        if (self%is_face) then
            off = touch%seen - (touch%at - touch%round*touch%normal)    ! from the circle's centre
            c = [touch%normal(1)*off(1) + touch%normal(2)*off(2) - touch%round]
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
            found%stretch = one()
            if (.not. self%is_planar) found%stretch = reciprocal(sqrt(square(found%normal(1)) + square(found%normal(2))))
            found%normal = found%stretch*found%normal
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

    !> About the second marker of a unit force there: a face is pressed beside it [m].
    function moment(self, pair) result(m)
        class(cam), intent(in) :: self
        type(marker_pair), intent(in) :: pair
        type(vector) :: m
        type(cam_touch) :: touch
        type(value) :: arm

        m = zero_vector()
        if (.not. self%is_face) return
        touch = self%touch(pair)
        arm = (touch%at(1) - touch%seen(1))*touch%normal(2) - (touch%at(2) - touch%seen(2))*touch%normal(1)
        m = arm*pair%first%z
        if (.not. self%is_planar) m = m + ((arm*touch%stretch)*(pair%first%z.dot.pair%second%z))*self%normal(pair)
    end function moment

    !> From the second marker to where surfaces rub, world axes [m].
    function off_marker(self, pair) result(off)
        class(cam), intent(in) :: self
        type(marker_pair), intent(in) :: pair
        type(vector) :: off
        type(cam_touch) :: touch

        if (self%is_face) then
            touch = self%touch(pair)
            off = (touch%at(1) - touch%seen(1))*pair%first%x + (touch%at(2) - touch%seen(2))*pair%first%y
        else
            off = constant(-self%reach)*self%normal(pair)
        end if
    end function off_marker

    !> Along which a roller rolls, world axes.
    function roller_way(self, pair) result(way)
        class(cam), intent(in) :: self
        type(marker_pair), intent(in) :: pair
        type(vector) :: way

        way = pair%first%z.cross.self%normal(pair)
    end function roller_way
end module linkdyn_cam
