!> The mechanism while it is traced: the plan, its numbers as values, the inputs, and the motion found so far.
module linkdyn_mechanism
    use linkdyn_barrel_cam, only: barrel_cam
    use linkdyn_bodies, only: bodies_type, make_bodies, rotation_of, point_position
    use linkdyn_cam, only: cam
    use linkdyn_inertia_wrench, only: mass_properties
    use linkdyn_joint_kind, only: marker_pair
    use linkdyn_joint_kinds, only: joint_kind_box, make_joint_kind
    use linkdyn_joint_table, only: joint_cam, is_geared, is_partial
    use linkdyn_kinds, only: wp
    use linkdyn_model, only: model_type, step_type, step_ups, side_of, has_rod, rod_of, inner_of_rod, outer_of_rod, &
        universal_of_rod, only_shifts, turns_in_two
    use linkdyn_numbers, only: number_places, place_numbers, to_cog, to_inertia, to_frame, to_told_frame, to_couple, to_push, &
        to_pitch_point, to_line, to_lever, to_strand, to_total, to_weight, to_spring_point, of_drive
    use linkdyn_rates, only: rate_map, set_rate
    use linkdyn_record, only: constant_of
    use linkdyn_scene, only: cam_spec
    use linkdyn_system, only: system_type
    use linkdyn_value, only: value, zero, is_zero, is_constant, operator(+), operator(-), operator(*), sqrt, max, reciprocal
    use linkdyn_vector, only: vector, rotation, vector_of, components, zero_vector, unit_vector, identity_rotation, operator(+), &
        operator(-), operator(*), operator(.dot.), operator(.cross.), operator(.rotate.), operator(.unrotate.)
    implicit none (type, external)
    private
    public :: mechanism_type, begin_mechanism, properties_of, marker_point, marker_frame, point_of_action, has_slide
    public :: told_marker_frame
    public :: payload_properties
    public :: scene_rod, scene_line
    public :: set_slide, wheel_wrench, wheel_push, belt_wrench, pair_of, told_pair_of, gravity_of, in_own_axes
    public :: strand_numbers, belt_total, belt_weights
    public :: load_point, spring_numbers, spring_point, drive_numbers
    public :: watch, must_be_positive, root_of, scene_point_of_origin, scene_rotation, least_square

    !> Square of the sine of a transmission angle down to which rates and forces surely keep three digits, whatever the motion:
    !> their uncertainty is below 8 eps/sine**4. Twice that leaves room for rounding.
    real(wp), parameter :: least_square = sqrt(16*epsilon(1.0_wp)/1.0e-3_wp)

    !> From the axes in which the scene has a link to those in which it is traced.
    type :: own_axes_type
        type(rotation) :: r
        type(vector) :: shift                              !! of the scene's origin, own axes [m]
    end type own_axes_type

    type :: mechanism_type
        type(model_type), pointer :: model => null()
        type(number_places) :: at                          !! where numbers stand
        type(value), allocatable :: number(:)              !! those of the scene, constants or inputs
        type(value), allocatable :: pull(:)                !! of springs' own laws over the state (spring) [N, N m]
        type(value), allocatable :: payload(:)             !! masses that links carry (payload) [kg]
        type(joint_kind_box), allocatable :: kind(:)       !! (joint)
        type(joint_kind_box), allocatable :: told_kind(:)  !! (joint) by which its variables are measured
        type(own_axes_type), allocatable :: own(:)         !! (0:link)
        type(bodies_type) :: bodies
        type(value), allocatable :: q(:), qd(:), qdd(:)    !! coordinates, what they lead by gears; derivatives [m, rad]
        type(value), allocatable :: quaternion(:, :)       !! (4, pose) of links whose pose is given; absent: angles give it
        type(value), allocatable :: counted(:)             !! angles that coordinates stand in for, with their turns (n_q) [rad]
        logical, allocatable :: is_led(:)                  !! what joints that are placed add to a led variable is in it (led)
        type(rate_map) :: rates                            !! of the coordinates
        type(vector), allocatable :: slide(:)              !! (joint) of the second marker, axes of the first [m]; see `has_slide`
        type(vector), allocatable :: universal_axis(:)     !! (joint) first axis of a leg's universal joint in leg axes
        type(value), allocatable :: watched(:)             !! magnitudes that must stay below one
        logical :: is_solved = .true.                      !! false once a system had no pivots
        type(vector), allocatable :: ways(:, :)            !! (2, dyad) how its inner joint moves with each of its links
        type(value), allocatable :: way_length(:, :)       !! of these: where it never changes, from the scene's numbers
        type(value), allocatable :: positive(:)            !! what must be positive, or a loop cannot close, or hardly
        logical :: keeps_at_limits = .false.               !! loops that cannot close are laid out as far as they go
        type(value), allocatable :: closes(:)              !! there: what is negative where they do not
    end type mechanism_type

contains

    !> Nothing has been placed but the frame.
    subroutine begin_mechanism(model, number, q, qd, qdd, mechanism, in_scene_axes)
        type(model_type), intent(in), target :: model
        type(value), intent(in) :: number(:)               !! as `linkdyn_numbers` lists them
        type(value), intent(in) :: q(:), qd(:), qdd(:)
        type(mechanism_type), intent(out) :: mechanism
        logical, intent(in), optional :: in_scene_axes     !! all links are traced in the axes of the scene, as they are told;
                                                           !! absent: false

        mechanism%model => model
        call place_numbers(model, mechanism%at)
        mechanism%number = number
        call make_kinds(mechanism)
        call choose_own_axes(mechanism, in_scene_axes)
        allocate (mechanism%is_led(size(model%led)), source=.false.)
        mechanism%q = [q, led_values(mechanism, q, .true.)]
        mechanism%qd = [qd, led_values(mechanism, qd, .false.)]
        mechanism%qdd = [qdd, led_values(mechanism, qdd, .false.)]
        call set_rate(mechanism%rates, q, qd)
        call set_rate(mechanism%rates, qd, qdd)
        allocate (mechanism%slide(size(model%joint)), mechanism%universal_axis(size(model%joint)), mechanism%watched(0), &
                  mechanism%positive(0), mechanism%closes(0), mechanism%ways(2, model%n_dyad), &
                  mechanism%way_length(2, model%n_dyad))
        call make_bodies(model%link%orientation, gravity_of(mechanism), mechanism%bodies)
    end subroutine begin_mechanism

    !> Joint variables that gears make of the coordinates, or their rates; what placed joints add is not in these.
    function led_values(mechanism, q, with_offset) result(led)
        type(mechanism_type), intent(in) :: mechanism
        type(value), intent(in) :: q(:)
        logical, intent(in) :: with_offset
        type(value), allocatable :: led(:)
        integer :: i, k

        allocate (led(size(mechanism%at%led)))
        do i = 1, size(led)
            associate (at => mechanism%at%led(i))
                led(i) = zero()
                if (with_offset) led(i) = mechanism%number(at)
                do k = 1, size(q)
                    led(i) = led(i) + mechanism%number(at + k)*q(k)
                end do
            end associate
        end do
    end function led_values

    !> Force between two wheels of a unit of its unknown, and the moment with it about a marker, in the axes of their carrier:
    !> on the second link, on the first both reversed.
    subroutine wheel_wrench(mechanism, g, side, force, couple)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: g, side
        type(vector), intent(out) :: force, couple

        associate (r => mechanism%own(mechanism%model%gear(g)%carrier)%r, at => mechanism%at%gear(g))
            force = r.rotate.point_at(mechanism, at)
            couple = r.rotate.point_at(mechanism, at + to_couple(side))
        end associate
    end subroutine wheel_wrench

    !> What drives the second wheel off the first, for a unit of the size of that force, and where; in the axes of the carrier.
    subroutine wheel_push(mechanism, g, push, pitch)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: g
        type(vector), intent(out) :: push, pitch

        associate (r => mechanism%own(mechanism%model%gear(g)%carrier)%r, at => mechanism%at%gear(g))
            push = r.rotate.point_at(mechanism, at + to_push)
        end associate
        pitch = in_own_axes(mechanism, mechanism%model%gear(g)%carrier, &
                            point_at(mechanism, mechanism%at%gear(g) + to_pitch_point))
    end subroutine wheel_push

    !> What a belt that stretches does to one of its wheels, as above: for a unit of the difference of its tensions, and of their
    !> sum.
    subroutine belt_wrench(mechanism, i, side, difference, couple, line, lever)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: i, side
        type(vector), intent(out) :: difference, couple    !! force [1] and moment [m], of the difference
        type(vector), intent(out) :: line, lever           !! of the sum

        associate (r => mechanism%own(mechanism%model%belt(i)%gear%carrier)%r, at => mechanism%at%belt(i))
            difference = r.rotate.point_at(mechanism, at)
            couple = r.rotate.point_at(mechanism, at + to_couple(side))
            line = r.rotate.point_at(mechanism, at + to_line)
            lever = zero_vector()
            if (side == 2) lever = r.rotate.point_at(mechanism, at + to_lever)
        end associate
    end subroutine belt_wrench

    !> Stiffness, damping and pretension of a strand.
    function strand_numbers(mechanism, i) result(k)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: i
        type(value) :: k(3)

        associate (at => mechanism%at%belt(i) + to_strand)
            k = mechanism%number(at:at + 2)
        end associate
    end function strand_numbers

    !> What stays of the sum of variables of a rigid belt.
    function belt_total(mechanism, i) result(total)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: i
        type(value) :: total

        total = mechanism%number(mechanism%at%belt(i) + to_total)
    end function belt_total

    !> The weights of the variables in that sum.
    function belt_weights(mechanism, i) result(weight)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: i
        type(value) :: weight(size(mechanism%model%belt(i)%joint))

        associate (at => mechanism%at%belt(i) + to_weight)
            weight = mechanism%number(at:at + size(weight) - 1)
        end associate
    end function belt_weights

    !> Each joint with its own numbers.
    subroutine make_kinds(mechanism)
        type(mechanism_type), intent(inout) :: mechanism
        integer :: j

        associate (joint => mechanism%model%joint)
            allocate (mechanism%kind(size(joint)), mechanism%told_kind(size(joint)))
            do j = 1, size(joint)
                call make_joint_kind(joint(j)%kind, mechanism%kind(j))
                call make_joint_kind(joint(j)%told_kind, mechanism%told_kind(j))
                if (joint(j)%kind == joint_cam) &
                    call take_cam(mechanism%model%scene%joint(joint(j)%told)%cam, mechanism%model%is_planar, mechanism%kind(j))
                ! what is left of a slide slides as it does
                if (is_partial(joint(j)%kind)) mechanism%kind(j)%is%slides = mechanism%told_kind(j)%is%slides
                if (.not. mechanism%kind(j)%is%is_threaded) cycle
                mechanism%kind(j)%is%pitch = mechanism%number(mechanism%at%pitch(j))
                mechanism%told_kind(j)%is%pitch = mechanism%kind(j)%is%pitch
            end do
        end associate
    end subroutine make_kinds

    !> A cam with its curve, across its axis or about it.
    subroutine take_cam(spec, is_planar, box)
        type(cam_spec), intent(in) :: spec
        logical, intent(in) :: is_planar
        type(joint_kind_box), intent(inout) :: box

        if (spec%is_barrel) then
            deallocate (box%is)
            allocate (barrel_cam :: box%is)
            call box%is%describe(joint_cam)
        end if
        select type (kind => box%is)
        class is (cam)
            call kind%take(spec, is_planar)
        end select
    end subroutine take_cam

    ! ---------------------------------------------------------------- numbers of the scene

    function gravity_of(mechanism) result(g)
        type(mechanism_type), intent(in) :: mechanism
        type(vector) :: g

        g = point_at(mechanism, mechanism%at%gravity)
    end function gravity_of

    !> Mass properties in the axes in which a link is traced.
    function properties_of(mechanism, link) result(p)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: link
        type(mass_properties) :: p
        type(value) :: tensor(3, 3)
        type(vector) :: column(3)
        integer :: k

        associate (at => mechanism%at%link(link), r => mechanism%own(link)%r)
            p%mass = mechanism%number(at)
            p%cog = in_own_axes(mechanism, link, point_at(mechanism, at + to_cog))
            associate (i => mechanism%number(at + to_inertia:at + to_inertia + 5))
                tensor = reshape([i(1), i(4), i(6), i(4), i(2), i(5), i(6), i(5), i(3)], [3, 3])
            end associate
            ! R I R^T
            do k = 1, 3
                column(k) = r.rotate.vector_of(tensor(:, k))
            end do
            do k = 1, 3
                associate (row => r.rotate.vector_of([part(column(1), k), part(column(2), k), part(column(3), k)]))
                    p%inertia(k, :) = components(row)
                end associate
            end do
        end associate
    end function properties_of

    !> Mass properties of a payload, in the axes in which its link is traced.
    function payload_properties(mechanism, i) result(p)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: i
        type(mass_properties) :: p
        type(vector) :: column(3)
        integer :: k

        associate (body => mechanism%model%payload(i)%body, link => mechanism%model%payload(i)%link)
            p%mass = mechanism%payload(i)
            p%cog = in_own_axes(mechanism, link, vector_of(body%cog))
            associate (r => mechanism%own(link)%r)
                ! m R I R^T
                do k = 1, 3
                    column(k) = r.rotate.vector_of(body%inertia(:, k))
                end do
                do k = 1, 3
                    p%inertia(k, :) = components(p%mass*(r.rotate.vector_of([part(column(1), k), part(column(2), k), &
                                                                            part(column(3), k)])))
                end do
            end associate
        end associate
    end function payload_properties

    function part(v, k) result(x)
        type(vector), intent(in) :: v
        integer, intent(in) :: k
        type(value) :: x
        type(value) :: c(3)

        c = components(v)
        x = c(k)
    end function part

    !> A point of a link, from the axes in which the scene has it to those in which the link is traced.
    function in_own_axes(mechanism, link, point) result(p)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: link
        type(vector), intent(in) :: point              !! [m]
        type(vector) :: p

        p = mechanism%own(link)%shift + (mechanism%own(link)%r.rotate.point)
    end function in_own_axes

    !> Origin of the axes in which the scene has a link, own axes.
    function scene_point_of_origin(mechanism, link) result(p)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: link
        type(vector) :: p

        p = mechanism%own(link)%shift
    end function scene_point_of_origin

    !> From the axes in which the scene has a link to the world's.
    function scene_rotation(mechanism, link) result(r)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: link
        type(rotation) :: r

        r = rotation_of(mechanism%bodies, link)*mechanism%own(link)%r
    end function scene_rotation

    !> A joint's marker, own axes.
    function marker_point(mechanism, joint, side) result(p)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: joint, side                 !! side: 1 or 2
        type(vector) :: p

        p = in_own_axes(mechanism, mechanism%model%joint(joint)%link(side), scene_point(mechanism, joint, side))
    end function marker_point

    !> Where a joint's reaction and drives act, the second marker's point, on either of its links, own axes.
    function point_of_action(mechanism, joint, side) result(p)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: joint, side                 !! side: 1 or 2
        type(vector) :: p

        if (side == 1 .and. is_geared(mechanism%model%joint(joint)%told_kind)) then
            ! holds no markers together
            associate (bodies => mechanism%bodies, link => mechanism%model%joint(joint)%link)
                p = rotation_of(bodies, link(1)) .unrotate. &
                    (point_position(bodies, link(2), marker_point(mechanism, joint, 2)) - bodies%body(link(1))%position)
            end associate
            return
        end if
        p = marker_point(mechanism, joint, side)
        if (side == 1 .and. has_slide(mechanism, joint)) &
            p = p + (marker_frame(mechanism, joint, 1) .rotate.mechanism%slide(joint))
    end function point_of_action

    !> Has a step said, or has been measured, how far the joint's markers are apart?
    logical function has_slide(mechanism, joint)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: joint

        has_slide = mechanism%slide(joint)%z%node > 0
    end function has_slide

    !> The joint's markers are so far apart along z of the first.
    subroutine set_slide(mechanism, joint, along_z)
        type(mechanism_type), intent(inout) :: mechanism
        integer, intent(in) :: joint
        type(value), intent(in) :: along_z                 !! [m]

        mechanism%slide(joint) = vector(zero(), zero(), along_z)
    end subroutine set_slide

    !> Frame of a joint's marker: from the marker's axes to the link's own.
    function marker_frame(mechanism, joint, side) result(f)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: joint, side
        type(rotation) :: f

        f = mechanism%own(mechanism%model%joint(joint)%link(side))%r*scene_frame(mechanism, joint, side)
    end function marker_frame

    !> The same in the frames by which its variables are told, and along which it is driven.
    function told_marker_frame(mechanism, joint, side) result(f)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: joint, side
        type(rotation) :: f

        f = mechanism%own(mechanism%model%joint(joint)%link(side))%r&
            *frame_at(mechanism, mechanism%at%marker(side, joint) + to_told_frame)
    end function told_marker_frame

    !> A joint's marker as the scene has it, link axes.
    function scene_point(mechanism, joint, side) result(p)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: joint, side
        type(vector) :: p

        p = point_at(mechanism, mechanism%at%marker(side, joint))
    end function scene_point

    function scene_frame(mechanism, joint, side) result(f)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: joint, side
        type(rotation) :: f

        f = frame_at(mechanism, mechanism%at%marker(side, joint) + to_frame)
    end function scene_frame

    function frame_at(mechanism, k) result(f)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: k
        type(rotation) :: f

        f = rotation(point_at(mechanism, k), point_at(mechanism, k + 3), point_at(mechanism, k + 6))
    end function frame_at

    !> The axes in which each link is traced: the scene's, but those of a leg for a leg's links: z from its first end to its
    !> last, y along the second axis of the universal joint, origins in both ends; and likewise of a rod: z from crank or
    !> carriage on, its origin there;
    !> of a link that only shifts those of the link as which it stands.
    subroutine choose_own_axes(mechanism, in_scene_axes)
        type(mechanism_type), intent(inout) :: mechanism
        logical, intent(in), optional :: in_scene_axes
        integer :: i, l

        allocate (mechanism%own(0:mechanism%model%n_link))
        do l = 0, mechanism%model%n_link
            mechanism%own(l)%r = identity_rotation()
            mechanism%own(l)%shift = zero_vector()
        end do
        if (present(in_scene_axes)) then
            if (in_scene_axes) return
        end if
        do i = 1, size(mechanism%model%step)
            associate (step => mechanism%model%step(i))
                if (step%kind == step_ups) call choose_axes_of_leg(mechanism, step)
                if (has_rod(step%kind)) call choose_axes_of_rod(mechanism, step)
                if (only_shifts(step)) mechanism%own(step%link(1))%r = frame_at(mechanism, mechanism%at%stance(i))
            end associate
        end do
    end subroutine choose_own_axes

    subroutine choose_axes_of_leg(mechanism, step)
        type(mechanism_type), intent(inout) :: mechanism
        type(step_type), intent(in) :: step
        type(rotation) :: frame
        type(vector) :: y
        integer :: side(2)

        associate (joint => mechanism%model%joint, u => step%joint(1), slide => step%joint(2), s => step%joint(3))
            side = [side_of(joint(u), step%link(1)), side_of(joint(slide), step%link(1))]
            frame = scene_frame(mechanism, u, side(1))
            y = frame%z
            if (step%turn < 0) y = -y
            frame = scene_frame(mechanism, slide, side(2))
            call set_axes(mechanism%own(step%link(1)), y, along(frame%z), scene_point(mechanism, u, side(1)))
            frame = scene_frame(mechanism, slide, 3 - side(2))
            call set_axes(mechanism%own(step%link(2)), y_of_upper(y), along(frame%z), &
                          scene_point(mechanism, s, side_of(joint(s), step%link(2))))
        end associate

    contains

        function y_of_upper(y_of_lower) result(y)
            type(vector), intent(in) :: y_of_lower
            type(vector) :: y
            type(rotation) :: frame
            integer :: side

            if (turns_in_two(mechanism%model, step)) then
                frame = scene_frame(mechanism, step%joint(3), side_of(mechanism%model%joint(step%joint(3)), step%link(2)))
                y = frame%z
                if (step%far_turn < 0) y = -y
            else
                ! the slide keeps both links parallel: y in its frame is the same for both
                side = side_of(mechanism%model%joint(step%joint(2)), step%link(1))
                frame = scene_frame(mechanism, step%joint(2), side)
                y = frame.unrotate.y_of_lower
                frame = scene_frame(mechanism, step%joint(2), 3 - side)
                y = frame.rotate.y
            end if
        end function y_of_upper

        function along(slide_axis) result(z)
            type(vector), intent(in) :: slide_axis
            type(vector) :: z

            z = slide_axis
            if (step%branch < 0) z = -z
        end function along
    end subroutine choose_axes_of_leg

    subroutine choose_axes_of_rod(mechanism, step)
        type(mechanism_type), intent(inout) :: mechanism
        type(step_type), intent(in) :: step
        type(rotation) :: frame
        type(vector) :: y
        integer :: u

        associate (joint => mechanism%model%joint, rod => rod_of(step), inner => inner_of_rod(step))
            u = universal_of_rod(mechanism%model, step)
            frame = scene_frame(mechanism, u, side_of(joint(u), rod))
            y = frame%z
            if (step%turn < 0) y = -y
            call set_axes(mechanism%own(rod), y, direction_of(scene_rod(mechanism, step)), &
                          scene_point(mechanism, inner, side_of(joint(inner), rod)))
        end associate
    end subroutine choose_axes_of_rod

    subroutine set_axes(own, y, z, origin)
        type(own_axes_type), intent(inout) :: own
        type(vector), intent(in) :: y, z, origin           !! axes of the scene
        type(vector) :: x

        x = y.cross.z
        own%r = rotation(vector(x%x, y%x, z%x), vector(x%y, y%y, z%y), vector(x%z, y%z, z%z))
        own%shift = -(own%r.rotate.origin)
    end subroutine set_axes

    !> From a rod's inner joint to its outer one, axes of the scene.
    function scene_rod(mechanism, step) result(rod)
        type(mechanism_type), intent(in) :: mechanism
        type(step_type), intent(in) :: step
        type(vector) :: rod

        rod = scene_line(mechanism, inner_of_rod(step), outer_of_rod(step), rod_of(step))
    end function scene_rod

    !> From one joint of a link to another one, axes of the scene.
    function scene_line(mechanism, from, to, link) result(line)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: from, to, link
        type(vector) :: line

        associate (joint => mechanism%model%joint)
            line = scene_point(mechanism, to, side_of(joint(to), link)) - scene_point(mechanism, from, side_of(joint(from), link))
        end associate
    end function scene_line

    !> A vector of unit length; one along an axis is exact.
    function direction_of(v) result(u)
        type(vector), intent(in) :: v
        type(vector) :: u
        type(value) :: c(3)
        integer :: k

        c = components(v)
        do k = 1, 3
            if (.not. (is_constant(c(k)) .and. count(is_zero(c)) == 2) .or. is_zero(c(k))) cycle
            u = unit_vector(k)
            if (constant_of(c(k)) < 0) u = -u
            return
        end do
        u = reciprocal(sqrt(v.dot.v))*v
    end function direction_of

    !> Where a load acts, own axes.
    function load_point(mechanism, i) result(p)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: i
        type(vector) :: p

        p = in_own_axes(mechanism, mechanism%model%scene%load(i)%link, point_at(mechanism, mechanism%at%load(i)))
    end function load_point

    !> Stiffness, damping, rest.
    function spring_numbers(mechanism, i) result(k)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: i
        type(value) :: k(3)

        k = mechanism%number(mechanism%at%spring(i):mechanism%at%spring(i) + 2)
    end function spring_numbers

    !> Where a spring holds one of its links, own axes.
    function spring_point(mechanism, i, side) result(p)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: i, side
        type(vector) :: p

        p = in_own_axes(mechanism, mechanism%model%scene%spring(i)%link(side), &
                        point_at(mechanism, mechanism%at%spring(i) + to_spring_point(side)))
    end function spring_point

    !> Parameters of a drive, as `effort_law` lists them.
    function drive_numbers(mechanism, i) result(k)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: i
        type(value) :: k(of_drive)

        k = mechanism%number(mechanism%at%drive(i):mechanism%at%drive(i) + of_drive - 1)
    end function drive_numbers

    function point_at(mechanism, k) result(p)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: k
        type(vector) :: p

        p = vector_of(mechanism%number(k:k + 2))
    end function point_at

    ! ---------------------------------------------------------------- joints of placed links

    !> Both markers of a joint as they stand, in the frames by which its variables are told.
    function told_pair_of(mechanism, joint) result(pair)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: joint
        type(marker_pair) :: pair

        pair = pair_of(mechanism, joint)
        if (mechanism%model%joint(joint)%kind == mechanism%model%joint(joint)%told_kind) return
        pair%first = told(1)
        pair%second = told(2)

    contains

        function told(side) result(frame)
            integer, intent(in) :: side
            type(rotation) :: frame

            associate (link => mechanism%model%joint(joint)%link(side))
                frame = rotation_of(mechanism%bodies, link)*told_marker_frame(mechanism, joint, side)
            end associate
        end function told
    end function told_pair_of

    !> Both markers of a joint as they stand.
    function pair_of(mechanism, joint) result(pair)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: joint
        type(marker_pair) :: pair

        associate (link => mechanism%model%joint(joint)%link, bodies => mechanism%bodies)
            pair%first = rotation_of(bodies, link(1))*marker_frame(mechanism, joint, 1)
            pair%second = rotation_of(bodies, link(2))*marker_frame(mechanism, joint, 2)
            pair%gap = point_position(bodies, link(2), marker_point(mechanism, joint, 2)) &
                       - point_position(bodies, link(1), marker_point(mechanism, joint, 1))
        end associate
    end function pair_of

    ! ---------------------------------------------------------------- conditions

    !> The alarms of a system that was solved become the mechanism's.
    subroutine watch(mechanism, system)
        type(mechanism_type), intent(inout) :: mechanism
        type(system_type), intent(in) :: system

        mechanism%is_solved = mechanism%is_solved .and. system%is_solved
        if (system%is_solved) mechanism%watched = [mechanism%watched, system%watched]
    end subroutine watch

    !> A value that is not positive where a loop cannot close, or where digits are lost because it hardly can.
    subroutine must_be_positive(mechanism, v)
        type(mechanism_type), intent(inout) :: mechanism
        type(value), intent(in) :: v

        mechanism%positive = [mechanism%positive, v]
    end subroutine must_be_positive

    !> Root of a square that is negative where a loop cannot close.
    function root_of(mechanism, square, least, rounding) result(root)
        type(mechanism_type), intent(inout) :: mechanism
        type(value), intent(in) :: square
        type(value), intent(in) :: least                   !! below this digits are lost
        type(value), intent(in) :: rounding                !! what rounding alone may take from zero
        type(value) :: root

        if (mechanism%keeps_at_limits) then
            mechanism%closes = [mechanism%closes, square + rounding]
            root = sqrt(max(square, zero()))
        else
            call must_be_positive(mechanism, square - least)
            root = sqrt(square)
        end if
    end function root_of
end module linkdyn_mechanism
