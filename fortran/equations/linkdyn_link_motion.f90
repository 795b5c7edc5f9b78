!> Links that move as they are told: what the equations of motion take of a motion that somebody else has found.
!>
!> Where links stand and how they move comes in as numbers, so nothing is closed here and no pivot is chosen: the equations can be
!> written at any pose, also where a loop has lost all digits but a few. How the motion changes with a coordinate comes in as well,
!> by columns: what a unit acceleration of the coordinate adds to accelerations, which is what a unit rate of it is to velocities.
!> Of a link whose pose is given these are unit vectors.
!>
!> Rates of turnings, and accelerations of origins, stand in own axes; velocities and columns of origins in world axes. In a plane
!> there is no difference.
module linkdyn_link_motion
    use linkdyn_attitude, only: rotation_in_plane
    use linkdyn_bodies, only: own_axes, world_axes, set_vector
    use linkdyn_joint_kind, only: marker_pair
    use linkdyn_joint_table, only: n_slide, slide_axis
    use linkdyn_mechanism, only: mechanism_type, gravity_of, pair_of
    use linkdyn_model, only: model_type, step_pose
    use linkdyn_substitution, only: substitution, replace
    use linkdyn_value, only: value, zero, operator(+), operator(-), operator(*)
    use linkdyn_vector, only: vector, rotation, zero_vector, unit_vector, components, operator(+), operator(-), operator(*), &
        operator(.unrotate.)
    implicit none (type, external)
    private
    public :: motion_number, motion_places, link_columns, place_motion, take_motion, take_columns, velocities_become
    public :: of_rotation, of_omega, of_alpha, of_position, of_velocity, of_acceleration, of_slide

    ! ---- what a number of the motion is
    integer, parameter :: of_rotation = 1      !! 1 to 9: own axes in world axes, one after the other; in a plane 1: cosine, 2: sine
    integer, parameter :: of_omega = 2         !! own axes [rad/s]
    integer, parameter :: of_alpha = 3         !! own axes [rad/s2]
    integer, parameter :: of_position = 4      !! of an origin, world axes [m]
    integer, parameter :: of_velocity = 5      !! world axes [m/s]
    integer, parameter :: of_acceleration = 6  !! own axes, in a plane world axes [m/s2]; of a coordinate world axes
    integer, parameter :: of_slide = 7         !! of a joint's second marker along an axis of the first [m]

    !> One number.
    type :: motion_number
        integer :: what = 0                    !! one of the above
        integer :: level = 0                   !! 0: of the motion that is given; k: for a one of coordinate k
        integer :: of = 0                      !! turning, link or joint
        integer :: component = 0               !! of the vector; of slides their number
    end type motion_number

    !> Where numbers stand among the inputs of the motion.
    type :: motion_places
        type(motion_number), allocatable :: number(:)
        integer, allocatable, private :: first(:, :, :)    !! of a vector (what, level, of), less one; -1: there is none
        integer, allocatable, private :: pose(:)           !! step that gives the pose of a link in space; 0: none (link)
        integer, allocatable, private :: attitude(:)       !! of a link of this orientation; 0: of none (orientation)
    end type motion_places

    !> Motion for a unit rate of each coordinate.
    type :: link_columns
        type(vector), allocatable :: velocity(:, :)        !! of origins, world axes (n_q, link) [m]
        type(vector), allocatable :: omega(:, :)           !! of turnings, own axes (n_q, turning) [1]
    end type link_columns

contains

    ! ---------------------------------------------------------------- numbers

    !> All numbers of a motion, in their order.
    subroutine place_motion(model, has_columns, places)
        type(model_type), intent(in) :: model
        logical, intent(in) :: has_columns     !! of the coordinates
        type(motion_places), intent(out) :: places
        logical, allocatable :: turns(:, :)    ! the coordinate turns the links of this orientation (n_q, orientation)
        integer :: o, l, j, k, n, most, n_level

        n_level = merge(model%n_q, 0, has_columns)
        most = max(model%n_orientation, model%n_link, size(model%joint))
        allocate (places%first(7, 0:n_level, most), source=-1)
        allocate (turns(n_level, 0:model%n_orientation), source=.false.)
        do l = 1, model%n_link
            associate (turned => turns(:, model%link(l)%orientation))
                turned = turned .or. model%moves(:n_level, l)
            end associate
        end do
        call find_poses(model, places)
        n = 0
        call pass()
        allocate (places%number(n))
        n = 0
        call pass()

    contains

        !> All numbers of the links' motion in their order: first rotations, then origins, then slides. Accelerations come in
        !> parts, one for each unknown.
        subroutine pass()
            do o = 1, model%n_orientation
                call add(of_rotation, 0, o, merge(2, 9, model%is_planar))
                call add(of_omega, 0, o, n_turning(model))
                call add(of_alpha, 0, o, n_turning(model))
                do k = 1, n_level
                    if (turns(k, o) .and. places%attitude(o) == 0) call add(of_alpha, k, o, n_turning(model))
                end do
            end do
            do l = 1, model%n_link
                call add(of_position, 0, l, n_origin(model))
                call add(of_velocity, 0, l, n_origin(model))
                call add(of_acceleration, 0, l, n_origin(model))
                do k = 1, n_level
                    if (model%moves(k, l) .and. places%pose(l) == 0) call add(of_acceleration, k, l, n_origin(model))
                end do
            end do
            do j = 1, size(model%joint)
                call add(of_slide, 0, j, n_slide(model%joint(j)%kind))
            end do
        end subroutine pass

        subroutine add(what, level, of, n_component)
            integer, intent(in) :: what, level, of, n_component
            integer :: c

            places%first(what, level, of) = n
            do c = 1, n_component
                n = n + 1
                if (allocated(places%number)) places%number(n) = motion_number(what, level, of, c)
            end do
        end subroutine add
    end subroutine place_motion

    !> Components of a rate of turning: in a plane that about z.
    pure integer function n_turning(model)
        type(model_type), intent(in) :: model

        n_turning = merge(1, 3, model%is_planar)
    end function n_turning

    !> Components of a vector of an origin: in a plane none across it.
    pure integer function n_origin(model)
        type(model_type), intent(in) :: model

        n_origin = merge(2, 3, model%is_planar)
    end function n_origin

    !> Links whose poses coordinates give.
    subroutine find_poses(model, places)
        type(model_type), intent(in) :: model
        type(motion_places), intent(inout) :: places
        integer :: i

        allocate (places%pose(model%n_link), places%attitude(0:model%n_orientation), source=0)
        if (model%is_planar) return
        do i = 1, size(model%step)
            associate (link => model%step(i)%link(1))
                if (model%step(i)%kind /= step_pose) cycle
                places%pose(link) = i
                places%attitude(model%link(link)%orientation) = i
            end associate
        end do
    end subroutine find_poses

    ! ---------------------------------------------------------------- motion

    !> Place and move all links.
    subroutine take_motion(places, v, mechanism)
        type(motion_places), intent(in) :: places
        type(value), intent(in) :: v(:)        !! as `places` lists them
        type(mechanism_type), intent(inout) :: mechanism
        type(rotation) :: r
        type(marker_pair) :: pair
        integer :: o, l, j, i, axes

        associate (model => mechanism%model, bodies => mechanism%bodies)
            axes = merge(world_axes, own_axes, model%is_planar)
            do o = 1, model%n_orientation
                bodies%turning(o)%r = rotation_at(model, places, v, o)
                call set_vector(bodies%turning(o)%omega, axes, vector_at(model, places, v, of_omega, 0, o))
                call set_vector(bodies%turning(o)%alpha, axes, vector_at(model, places, v, of_alpha, 0, o))
            end do
            do l = 1, model%n_link
                associate (body => bodies%body(l))
                    r = bodies%turning(body%turning)%r
                    body%position = vector_at(model, places, v, of_position, 0, l)
                    body%velocity = vector_at(model, places, v, of_velocity, 0, l)
                    associate (weight => merge_vectors(gravity_of(mechanism), r.unrotate.gravity_of(mechanism), model%is_planar))
                        call set_vector(body%acceleration, axes, vector_at(model, places, v, of_acceleration, 0, l) - weight)
                    end associate
                end associate
            end do
            do j = 1, size(model%joint)
                if (.not. mechanism%kind(j)%is%slides) cycle
                mechanism%slide(j) = zero_vector()
                do i = 1, n_slide(model%joint(j)%kind)
                    mechanism%slide(j) = mechanism%slide(j) + v(places%first(of_slide, 0, j) + i) &
                                         *unit_vector(slide_axis(i, model%joint(j)%kind))
                end do
                if (n_slide(model%joint(j)%kind) > 0) cycle
                pair = pair_of(mechanism, j)           ! a follower's marker goes wherever its cam leads it
                mechanism%slide(j) = pair%first.unrotate.pair%gap
            end do
        end associate
    end subroutine take_motion

    pure function merge_vectors(yes, no, condition) result(v)
        type(vector), intent(in) :: yes, no
        logical, intent(in) :: condition
        type(vector) :: v

        v = no
        if (condition) v = yes
    end function merge_vectors

    !> Columns of all links; accelerations of the coordinates beyond those that are in the motion are added to it.
    subroutine take_columns(places, v, beyond, mechanism, columns)
        type(motion_places), intent(in) :: places
        type(value), intent(in) :: v(:)        !! as `places` lists them
        type(value), intent(in) :: beyond(:)   !! (n_q)
        type(mechanism_type), intent(inout) :: mechanism
        type(link_columns), intent(out) :: columns
        type(vector) :: more
        integer :: o, l, k, axes

        associate (model => mechanism%model, bodies => mechanism%bodies)
            axes = merge(world_axes, own_axes, model%is_planar)
            allocate (columns%velocity(model%n_q, 0:model%n_link), columns%omega(model%n_q, 0:model%n_orientation))
            columns%velocity = zero_vector()
            columns%omega = zero_vector()
            do o = 1, model%n_orientation
                associate (turning => bodies%turning(o))
                    more = zero_vector()
                    do k = 1, model%n_q
                        columns%omega(k, o) = turning_column(model, places, v, k, o, turning%r)
                        more = more + beyond(k)*columns%omega(k, o)
                    end do
                    call set_vector(turning%alpha, axes, turning%alpha%v(axes) + more)
                end associate
            end do
            do l = 1, model%n_link
                associate (body => bodies%body(l))
                    more = zero_vector()
                    do k = 1, model%n_q
                        columns%velocity(k, l) = origin_column(model, places, v, k, l)
                        more = more + beyond(k)*columns%velocity(k, l)
                    end do
                    if (.not. model%is_planar) more = bodies%turning(body%turning)%r.unrotate.more
                    call set_vector(body%acceleration, axes, body%acceleration%v(axes) + more)
                end associate
            end do
        end associate
    end subroutine take_columns

    !> Own axes.
    function turning_column(model, places, v, k, o, r) result(column)
        type(model_type), intent(in) :: model
        type(motion_places), intent(in) :: places
        type(value), intent(in) :: v(:)
        integer, intent(in) :: k, o            !! coordinate, orientation
        type(rotation), intent(in) :: r
        type(vector) :: column
        integer :: c

        if (places%attitude(o) == 0) then
            column = vector_at(model, places, v, of_alpha, k, o)
            return
        end if
        column = zero_vector()
        c = findloc(model%step(places%attitude(o))%coordinate(4:6), k, dim=1)
        if (c > 0) column = r.unrotate.unit_vector(c)
    end function turning_column

    !> World axes.
    function origin_column(model, places, v, k, l) result(column)
        type(model_type), intent(in) :: model
        type(motion_places), intent(in) :: places
        type(value), intent(in) :: v(:)
        integer, intent(in) :: k, l            !! coordinate, link
        type(vector) :: column
        integer :: c

        if (places%pose(l) == 0) then
            column = vector_at(model, places, v, of_acceleration, k, l)
            return
        end if
        column = zero_vector()
        c = findloc(model%step(places%pose(l))%coordinate(1:3), k, dim=1)
        if (c > 0) column = unit_vector(c)
    end function origin_column

    !> A map by which what depends on velocities becomes what it is in another motion of the same links: of each coordinate's column
    !> so much.
    subroutine velocities_become(places, v, mechanism, columns, rate, map)
        type(motion_places), intent(in) :: places
        type(value), intent(in) :: v(:)        !! as `places` lists them
        type(mechanism_type), intent(in) :: mechanism
        type(link_columns), intent(in) :: columns
        type(value), intent(in) :: rate(:)     !! of the coordinates (n_q)
        type(substitution), intent(inout) :: map
        integer :: o, l, k

        associate (model => mechanism%model)
            do k = 1, model%n_q
                call replace(map, mechanism%qd(k), rate(k))
            end do
            do o = 1, model%n_orientation
                call put(of_omega, o, columns%omega(:, o))
            end do
            do l = 1, model%n_link
                call put(of_velocity, l, columns%velocity(:, l))
            end do
        end associate

    contains

        subroutine put(what, of, column)
            integer, intent(in) :: what, of
            type(vector), intent(in) :: column(:)
            type(vector) :: total
            type(value) :: c(3)
            integer :: i, at, n

            total = zero_vector()
            do k = 1, size(rate)
                total = total + rate(k)*column(k)
            end do
            c = components(total)
            n = n_origin(mechanism%model)
            if (what == of_omega) n = n_turning(mechanism%model)
            if (n == 1) c(1) = c(3)
            at = places%first(what, 0, of)
            do i = 1, n
                call replace(map, v(at + i), c(i))
            end do
        end subroutine put
    end subroutine velocities_become

    function rotation_at(model, places, v, o) result(r)
        type(model_type), intent(in) :: model
        type(motion_places), intent(in) :: places
        type(value), intent(in) :: v(:)
        integer, intent(in) :: o
        type(rotation) :: r

        associate (at => places%first(of_rotation, 0, o))
            if (model%is_planar) then
                r = rotation_in_plane(v(at + 1), v(at + 2))
            else
                r = rotation(vector(v(at + 1), v(at + 2), v(at + 3)), vector(v(at + 4), v(at + 5), v(at + 6)), &
                             vector(v(at + 7), v(at + 8), v(at + 9)))
            end if
        end associate
    end function rotation_at

    !> A vector of the motion; zero where it has no numbers.
    function vector_at(model, places, v, what, level, of) result(w)
        type(model_type), intent(in) :: model
        type(motion_places), intent(in) :: places
        type(value), intent(in) :: v(:)
        integer, intent(in) :: what, level, of
        type(vector) :: w

        w = zero_vector()
        associate (at => places%first(what, level, of))
            if (at < 0) return
            if (.not. model%is_planar) then
                w = vector(v(at + 1), v(at + 2), v(at + 3))
            else if (what == of_omega .or. what == of_alpha) then
                w = vector(zero(), zero(), v(at + 1))
            else
                w = vector(v(at + 1), v(at + 2), zero())
            end if
        end associate
    end function vector_at
end module linkdyn_link_motion
