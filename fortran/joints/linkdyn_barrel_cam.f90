!> The cam that goes round a drum: the point or roller's centre of the second link at a height over the angle about the first
!> marker's axis. A groove in a cylinder, or the face end of one.
!>
!> To second order such a cam is the parabola over the angle that fits it best where the follower is. So direction, height and two
!> derivatives there count as fixed in the cam (`linkdyn_cam`), and the sine of the angle from there stands for the angle.
module linkdyn_barrel_cam
    use linkdyn_cam, only: cam, pieces_of, take_follower
    use linkdyn_joint_kind, only: marker_pair
    use linkdyn_kinds, only: wp
    use linkdyn_piecewise, only: piecewise_curve
    use linkdyn_record, only: add_curve
    use linkdyn_scene, only: cam_spec
    use linkdyn_value, only: value, nearest_place, piece_at, sqrt, square, reciprocal, operator(+), operator(-), operator(*)
    use linkdyn_vector, only: vector, operator(+), operator(-), operator(*), operator(.dot.), operator(.cross.)
    implicit none (type, external)
    private
    public :: barrel_cam

    !> The cam at the angle at which the follower is.
    type :: drum_touch
        type(value) :: seen(3)                     !! the follower, in the axes of the first marker [m]
        type(value) :: far                         !! its distance from the axis [m]
        type(value) :: towards(2)                  !! unit vector across the axis
        type(value) :: height, slope, bend         !! and derivatives by the angle [m]
    end type drum_touch

    type, extends(cam) :: barrel_cam
        integer, private :: heights = 0            !! number among the record's curves: a radius that stands for the height
        integer, private :: round = 0              !! and that of a circle with the same places
        real(wp), private :: ground = 0            !! height where that radius is zero [m]
    contains
        procedure :: take
        procedure :: constraints
        procedure :: standing
        procedure :: normal
        procedure :: point
        procedure :: roller_way
    end type barrel_cam

contains

    !> What the scene says of it.
    subroutine take(self, spec, is_planar)
        class(barrel_cam), intent(inout) :: self
        type(cam_spec), intent(in) :: spec
        logical, intent(in) :: is_planar
        type(piecewise_curve) :: pieces

        call take_follower(self, spec)
        self%ground = spec%ground
        pieces = pieces_of(spec%curve)
        self%heights = add_curve(pieces)
        pieces%c(:, :, 1) = 0
        pieces%c(1, :, 1) = 1
        pieces%knot = pieces%axis
        self%round = add_curve(pieces)
    end subroutine take

    !> How far the follower is above the cam.
    function constraints(self, pair) result(c)
        class(barrel_cam), intent(in) :: self
        type(marker_pair), intent(in) :: pair
        type(value), allocatable :: c(:)
        type(drum_touch) :: touch
        type(value) :: turned

        touch = touch_of(self, pair)
        turned = (touch%towards(1)*touch%seen(2) - touch%towards(2)*touch%seen(1))*reciprocal(touch%far)
        c = [touch%seen(3) - touch%height - touch%slope*turned - (0.5_wp*touch%bend)*square(turned)]
    end function constraints

    !> The parabola that the cam is there.
    function standing(self, pair) result(v)
        class(barrel_cam), intent(in) :: self
        type(marker_pair), intent(in) :: pair
        type(value), allocatable :: v(:)
        type(drum_touch) :: touch

        touch = touch_of(self, pair)
        v = [touch%towards, touch%height, touch%slope, touch%bend]
    end function standing

    !> Found from where the markers are alone.
    function touch_of(self, pair) result(found)
        class(barrel_cam), intent(in) :: self
        type(marker_pair), intent(in) :: pair
        type(drum_touch) :: found
        type(value) :: place, per_angle

        found%seen = [pair%gap .dot.pair%first%x, pair%gap .dot.pair%first%y, pair%gap .dot.pair%first%z]
        found%far = sqrt(square(found%seen(1)) + square(found%seen(2)))
        found%towards = [reciprocal(found%far)*found%seen(1), reciprocal(found%far)*found%seen(2)]
        place = nearest_place(self%round, found%towards(1), found%towards(2))
        per_angle = reciprocal(piece_at(self%round, 2, 1, place))
        found%height = self%ground + piece_at(self%heights, 1, 0, place)
        found%slope = per_angle*piece_at(self%heights, 1, 1, place)
        found%bend = square(per_angle)*piece_at(self%heights, 1, 2, place)
    end function touch_of

    !> Along which the follower is pressed, up the axis as far as the slope lets it, world axes.
    function normal(self, pair) result(n)
        class(barrel_cam), intent(in) :: self
        type(marker_pair), intent(in) :: pair
        type(vector) :: n
        type(drum_touch) :: touch
        type(value) :: steepness, upright

        touch = touch_of(self, pair)
        steepness = touch%slope*reciprocal(touch%far)
        upright = reciprocal(sqrt(1.0_wp + square(steepness)))
        n = upright*(pair%first%z + steepness*(touch%towards(2)*pair%first%x - touch%towards(1)*pair%first%y))
    end function normal

    !> From the first marker's point to where the force acts, world axes [m].
    function point(self, pair) result(p)
        class(barrel_cam), intent(in) :: self
        type(marker_pair), intent(in) :: pair
        type(vector) :: p

        p = pair%gap
    end function point

    !> Along which a roller rolls whose axis goes through that of the drum, world axes.
    function roller_way(self, pair) result(way)
        class(barrel_cam), intent(in) :: self
        type(marker_pair), intent(in) :: pair
        type(vector) :: way
        type(drum_touch) :: touch

        touch = touch_of(self, pair)
        way = (touch%towards(1)*pair%first%x + touch%towards(2)*pair%first%y) .cross.self%normal(pair)
    end function roller_way
end module linkdyn_barrel_cam
