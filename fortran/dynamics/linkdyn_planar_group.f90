!> Constraints of any planar Assur group (triads and larger, joints with given variables), for Newton's method.
!>
!> Unknown are x, y and the angle of each link. A hinge closes two gaps, a slide an angle and a distance across it, a weld two
!> gaps and the angle; a joint whose variable is a coordinate, or led by gears, one more, and so does each coordinate at a part of a pose.
!> Velocities and accelerations obey the Jacobian of the same gaps.
module linkdyn_planar_group
    use linkdyn_cam_contact, only: locate_contacts
    use linkdyn_given, only: given_position, given_rate, given_acceleration, given_column
    use linkdyn_gauss_jordan, only: solve_gauss_jordan
    use linkdyn_group_motion, only: size_of_rows
    use linkdyn_joint_table, only: most_slides, is_pose_part, is_partial, joint_plate, joint_loose, joint_cam, n_transmitted
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state
    use linkdyn_lane_count, only: lanes
    use linkdyn_model, only: model_type, group_type, led_type, orientation_of, scene_size
    use linkdyn_planar_motion, only: planar_motion, planar_contact, level_velocity, level_given
    use linkdyn_planar_point, only: carried
    use linkdyn_scene, only: joint_prismatic, joint_fixed, pose_position, pose_attitude, follower_flat
    use linkdyn_vec2, only: vec2, operator(+), operator(-), operator(*), operator(.dot.), operator(.cross.), &
        operator(.rotate.), perp, rot2, rot2_by_angle, zero_vec2, vec2_of
    implicit none (type, external)
    private
    public :: put_planar_links, assemble_gaps, assemble_gaps_ahead, move_planar_group, is_planar_length, planar_speed

    !> A joint of the group, world axes.
    type :: joint_view
        logical :: slides = .false.
        logical :: is_line = .false.       !! a point of the second link on a line of the first
        logical :: is_fixed = .false.
        logical :: is_cam = .false.        !! on a line, too, which turns as the contact goes along the curve
        integer :: sees = 1                !! side of the link from which the line or slide is seen to stand still
        real(wp) :: round(lanes) = 0       !! of a cam: curvature of the path on which a roller's centre goes; of a face zero
        logical :: is_position = .false., is_attitude = .false.    !! parts of a pose: nothing but coordinates
        integer :: link(2) = 0, o(2) = 0
        integer :: place(2) = 0            !! of its links among the group's; 0: known
        type(vec2) :: arm(2)               !! origins to where the gap is measured
        type(vec2) :: gap                  !! second less first marker; of a cam as far as it is off the curve
        type(vec2) :: u                    !! along the slide; of a part of a pose: x of the first marker
        real(wp) :: turn(lanes)            !! second less first marker's direction [rad]
    end type joint_view

contains

    !> The iterate as rotations and positions.
    subroutine put_planar_links(model, group, state)
        type(model_type), intent(in) :: model
        type(group_type), intent(in) :: group
        type(kinematic_state), intent(inout) :: state
        integer :: i

        do i = 1, size(group%link)
            associate (l => group%link(i), place => state%group%place)
                state%plane%position(l) = vec2(place(:, 1, l), place(:, 2, l))
                if (group%turns(i)) state%plane%rotation(orientation_of(model, l)) = rot2_by_angle(place(:, 3, l))
            end associate
        end do
        call locate_contacts(model, group%joint, state%plane)
    end subroutine put_planar_links

    ! ---------------------------------------------------------------- gaps and their Jacobian

    function view_of(model, group, j, plane) result(view)
        type(model_type), intent(in) :: model
        type(group_type), intent(in) :: group
        integer, intent(in) :: j
        type(planar_motion), intent(in) :: plane
        type(joint_view) :: view
        type(vec2) :: point(2), direction(2)
        integer :: side, axis

        associate (joint => model%joint(j))
            view%slides = joint%kind == joint_prismatic
            view%is_fixed = joint%kind == joint_fixed
            view%is_line = joint%kind == joint_plate
            view%is_position = joint%kind == pose_position
            view%is_attitude = joint%kind == pose_attitude
            view%is_cam = joint%kind == joint_cam
            axis = merge(3, 1, view%slides .or. view%is_line)
            do side = 1, 2
                view%link(side) = joint%link(side)
                view%o(side) = orientation_of(model, joint%link(side))
                view%place(side) = findloc(group%link, joint%link(side), dim=1)
                view%arm(side) = plane%rotation(view%o(side)).rotate.joint%point(:2, side)
                point(side) = plane%position(joint%link(side)) + view%arm(side)
                direction(side) = plane%rotation(view%o(side)).rotate.joint%frame(:2, axis, side)
            end do
        end associate
        view%gap = point(2) - point(1)
        view%u = direction(1)
        view%turn = atan2(direction(1).cross.direction(2), direction(1).dot.direction(2))
        if (view%is_cam) call see_contact()
        ! Across a slide the first link is felt at the second's marker.
        if (view%slides .or. view%is_position .or. (view%is_line .and. .not. view%is_cam)) view%arm(1) = view%arm(1) + view%gap

    contains

        !> A roller's centre on a path fixed in the cam; or, seen from the follower, the centre of the outline's curvature on a line
        !> beside the face.
        subroutine see_contact()
            type(vec2) :: meets
            integer :: s

            associate (contact => plane%contact(model%joint(j)%cam))
                view%is_line = .true.
                view%u = contact%normal
                meets = point(2)
                if (model%scene%joint(j)%cam%follower == follower_flat) then
                    view%sees = 2
                    meets = contact%point - contact%round*contact%normal
                else
                    view%round = contact%round
                end if
                do s = 1, 2
                    view%arm(s) = meets - plane%position(view%link(s))
                end do
                view%gap = contact%gap*contact%normal
            end associate
        end subroutine see_contact
    end function view_of

    !> Gaps at the iterate and how the links close them.
    subroutine assemble_gaps(model, group, state, matrix, right)
        type(model_type), intent(in) :: model
        type(group_type), intent(in) :: group
        type(kinematic_state), intent(inout) :: state
        real(wp), intent(out) :: matrix(:, :, :), right(:, :)
        type(joint_view) :: view
        integer :: i, row, c

        matrix = 0
        row = 0
        do i = 1, size(group%joint)
            view = view_of(model, group, group%joint(i), state%plane)
            if (view%is_position .or. view%is_attitude) then
                call put_part(group%coordinate(:, i))
                cycle
            end if
            if (model%joint(group%joint(i))%kind == joint_loose) cycle
            if (view%is_line) then
                row = row + 1
                call put_row(view, view%u, row, matrix)
                right(:, row) = view%u.dot.view%gap
                cycle
            end if
            c = group%coordinate(1, i)
            if (view%slides) then
                ! in the order of the joint's constraints, which records have, too
                call put_row(view, perp(view%u), row + 1, matrix)
                right(:, row + 1) = view%u.cross.view%gap
                call put_turn_row(view, row + 2, matrix)
                right(:, row + 2) = view%turn
                state%slide(:, 1, group%joint(i)) = view%u.dot.view%gap
            else
                call put_row(view, vec2_of([1.0_wp, 0.0_wp]), row + 1, matrix)
                call put_row(view, vec2_of([0.0_wp, 1.0_wp]), row + 2, matrix)
                right(:, row + 1) = view%gap%x
                right(:, row + 2) = view%gap%y
            end if
            row = row + 2
            if (view%is_fixed) then
                row = row + 1
                call put_turn_row(view, row, matrix)
                right(:, row) = view%turn
            end if
            if (c == 0) cycle
            row = row + 1
            if (view%slides) then
                call put_row(view, view%u, row, matrix)
                right(:, row) = (view%u.dot.view%gap) - given_position(model, state, c)
            else
                call put_turn_row(view, row, matrix)
                right(:, row) = least_turn(view%turn - given_position(model, state, c))
            end if
            if (c > model%n_q) call take_sources_off(model%led(c - model%n_q))
        end do

    contains

        !> What gears make of other joints of the group, for its own.
        subroutine take_sources_off(led)
            type(led_type), intent(in) :: led
            type(joint_view) :: source
            real(wp) :: part(lanes, 1, 3*size(group%link))
            integer :: s

            do s = 1, size(led%source)
                source = view_of(model, group, led%source(s), state%plane)
                if (all(source%place == 0)) cycle
                part = 0
                if (source%slides) then
                    call put_row(source, source%u, 1, part)
                else
                    call put_turn_row(source, 1, part)
                end if
                matrix(:, row, :) = matrix(:, row, :) - led%source_weight(s)*part(:, 1, :)
            end do
        end subroutine take_sources_off

        !> Position along x and y, or the angle.
        subroutine put_part(coordinate)
            integer, intent(in) :: coordinate(3)
            type(vec2) :: u
            integer :: k

            do k = 1, 3
                if (coordinate(k) == 0) cycle
                row = row + 1
                if (view%is_attitude) then
                    call put_turn_row(view, row, matrix)
                    right(:, row) = least_turn(view%turn - state%q(:, coordinate(k)))
                else
                    u = part_axis(view, k)
                    call put_row(view, u, row, matrix)
                    right(:, row) = (u.dot.view%gap) - state%q(:, coordinate(k))
                end if
            end do
        end subroutine put_part
    end subroutine assemble_gaps

    !> Along which the position is measured: x or y of the first marker.
    pure function part_axis(view, k) result(u)
        type(joint_view), intent(in) :: view
        integer, intent(in) :: k           !! 1, 2
        type(vec2) :: u

        u = view%u
        if (k == 2) u = perp(view%u)
    end function part_axis

    !> Which of the rows of `assemble_gaps` are distances.
    pure function is_planar_length(model, group) result(is_length)
        type(model_type), intent(in) :: model
        type(group_type), intent(in) :: group
        logical :: is_length(3*size(group%link))
        logical :: slides
        integer :: i, k, row

        row = 0
        do i = 1, size(group%joint)
            if (is_pose_part(model%joint(group%joint(i))%kind)) then
                do k = 1, count(group%coordinate(:, i) > 0)
                    row = row + 1
                    is_length(row) = model%joint(group%joint(i))%kind == pose_position
                end do
                cycle
            end if
            if (is_partial(model%joint(group%joint(i))%kind) .or. model%joint(group%joint(i))%cam > 0) then
                k = sum(n_transmitted(model%joint(group%joint(i))%kind, model%is_planar))
                is_length(row + 1:row + k) = .true.
                row = row + k
                cycle
            end if
            slides = model%joint(group%joint(i))%kind == joint_prismatic
            is_length(row + 1:row + 2) = [.true., .not. slides]
            row = row + 2
            if (model%joint(group%joint(i))%kind == joint_fixed) then
                row = row + 1
                is_length(row) = .false.
            end if
            if (group%coordinate(1, i) == 0) cycle
            row = row + 1
            is_length(row) = slides
        end do
    end function is_planar_length

    !> The matrix a little further on, where the links' velocities lead.
    subroutine assemble_gaps_ahead(model, group, step, state, matrix, right)
        type(model_type), intent(in) :: model
        type(group_type), intent(in) :: group
        real(wp), intent(in) :: step(lanes)
        type(kinematic_state), intent(inout) :: state    !! unchanged
        real(wp), intent(out) :: matrix(:, :, :), right(:, :)
        type(rot2) :: rotation(0:model%n_orientation)
        type(vec2) :: position(0:model%n_link)
        type(planar_contact) :: contact(model%n_cam)
        real(wp) :: slide(lanes, most_slides, size(model%joint)), turn(lanes)
        integer :: o, l

        associate (plane => state%plane)
            rotation = plane%rotation
            position = plane%position
            slide = state%slide
            contact = plane%contact
            do o = 0, model%n_orientation
                turn = step*plane%angular(:, level_velocity, o)
                plane%rotation(o) = rot2(rotation(o)%c - turn*rotation(o)%s, rotation(o)%s + turn*rotation(o)%c)
            end do
            do l = 0, model%n_link
                plane%position(l) = position(l) + step*plane%linear(level_velocity, l)
            end do
            call locate_contacts(model, group%joint, plane)
            call assemble_gaps(model, group, state, matrix, right)
            plane%contact = contact
            plane%rotation = rotation
            plane%position = position
            state%slide = slide
        end associate
    end subroutine assemble_gaps_ahead

    !> The largest of the links' angular rates of a level, and of their rates by the mechanism's size.
    pure function planar_speed(model, group, state, level) result(speed)
        type(model_type), intent(in) :: model
        type(group_type), intent(in) :: group
        type(kinematic_state), intent(in) :: state
        integer, intent(in) :: level                     !! of velocity, of the given acceleration
        real(wp) :: speed(lanes)
        integer :: i

        speed = 0
        associate (plane => state%plane)
            do i = 1, size(group%link)
                associate (v => plane%linear(level, group%link(i)))
                    speed = max(speed, abs(v%x)/scene_size(model), abs(v%y)/scene_size(model), &
                                abs(plane%angular(:, level, orientation_of(model, group%link(i)))))
                end associate
            end do
        end associate
    end function planar_speed

    !> The angle brought to (-pi, pi].
    pure function least_turn(angle) result(least)
        real(wp), intent(in) :: angle(lanes)
        real(wp) :: least(lanes)

        least = atan2(sin(angle), cos(angle))
    end function least_turn

    !> How the gap along a direction grows with the links' coordinates.
    subroutine put_row(view, direction, row, matrix)
        type(joint_view), intent(in) :: view
        type(vec2), intent(in) :: direction
        integer, intent(in) :: row
        real(wp), intent(inout) :: matrix(:, :, :)
        real(wp) :: sign
        integer :: side, k

        do side = 1, 2
            if (view%place(side) == 0) cycle
            sign = merge(-1.0_wp, 1.0_wp, side == 1)
            k = 3*(view%place(side) - 1)
            matrix(:, row, k + 1) = sign*direction%x
            matrix(:, row, k + 2) = sign*direction%y
            matrix(:, row, k + 3) = sign*(view%arm(side).cross.direction)
        end do
    end subroutine put_row

    subroutine put_turn_row(view, row, matrix)
        type(joint_view), intent(in) :: view
        integer, intent(in) :: row
        real(wp), intent(inout) :: matrix(:, :, :)

        if (view%place(1) > 0) matrix(:, row, 3*view%place(1)) = -1
        if (view%place(2) > 0) matrix(:, row, 3*view%place(2)) = 1
    end subroutine put_turn_row

    ! ---------------------------------------------------------------- velocities and accelerations

    !> All levels but the given acceleration at once, then that one, which needs the velocities. On a way there are
    !> velocities only.
    subroutine move_planar_group(model, group, state)
        type(model_type), intent(in) :: model
        type(group_type), intent(in) :: group
        type(kinematic_state), intent(inout) :: state
        real(wp) :: growth(lanes)
        logical :: is_singular(lanes)
        integer :: n, n_column, level

        n = 3*size(group%link)
        n_column = merge(0, state%n_column, state%group%is_led)
        associate (matrix => state%group%matrix, right => state%group%right)
            call rest_links(model, group, state%plane)
            call assemble_gaps(model, group, state, matrix(:, :n, :n), right(:, :n, 1))
            call assemble_level(model, group, state, level_velocity, right(:, :n, 1))
            state%group%gap(:, level_velocity) = size_of_rows(group, right(:, :n, 1))
            do level = 1, n_column
                call assemble_level(model, group, state, level, right(:, :n, level + 1))
            end do
            call solve_gauss_jordan(n, n_column + 1, matrix(:, :n, :n), right(:, :n, :n_column + 1), growth, is_singular)
            call take_level(model, group, right(:, :n, 1), level_velocity, state%plane)
            do level = 1, n_column
                call take_level(model, group, right(:, :n, level + 1), level, state%plane)
            end do
            if (state%group%is_led) return
            call assemble_gaps(model, group, state, matrix(:, :n, :n), right(:, :n, 1))
            call assemble_level(model, group, state, level_given, right(:, :n, 1))
            state%group%gap(:, level_given) = size_of_rows(group, right(:, :n, 1))
            call solve_gauss_jordan(n, 1, matrix(:, :n, :n), right(:, :n, :1), growth, is_singular)
            call take_level(model, group, right(:, :n, 1), level_given, state%plane)
        end associate
    end subroutine move_planar_group

    subroutine rest_links(model, group, plane)
        type(model_type), intent(in) :: model
        type(group_type), intent(in) :: group
        type(planar_motion), intent(inout) :: plane
        integer :: i, level

        do i = 1, size(group%link)
            if (group%turns(i)) plane%angular(:, :, orientation_of(model, group%link(i))) = 0
            do level = lbound(plane%linear, 1), ubound(plane%linear, 1)
                plane%linear(level, group%link(i)) = zero_vec2()
            end do
        end do
    end subroutine rest_links

    !> How fast the gaps would open if the group's links had no rates at this level.
    subroutine assemble_level(model, group, state, level, right)
        type(model_type), intent(in) :: model
        type(group_type), intent(in) :: group
        type(kinematic_state), intent(in) :: state
        integer, intent(in) :: level
        real(wp), intent(out) :: right(:, :)
        type(joint_view) :: view
        type(vec2) :: opening
        real(wp) :: turning(lanes)
        integer :: i, k, row, c

        row = 0
        do i = 1, size(group%joint)
            view = view_of(model, group, group%joint(i), state%plane)
            opening = opening_of(state%plane, view, level)
            if ((view%slides .or. view%is_position .or. view%is_line) .and. level == level_given) opening = opening &
                - (2*state%plane%angular(:, level_velocity, view%o(view%sees)))*perp(opening_of(state%plane, view, level_velocity))
            turning = state%plane%angular(:, level, view%o(2)) - state%plane%angular(:, level, view%o(1))
            if (view%is_position .or. view%is_attitude) then
                do k = 1, 3
                    if (group%coordinate(k, i) == 0) cycle
                    row = row + 1
                    right(:, row) = turning - given_at_level(group%coordinate(k, i))
                    if (view%is_position) right(:, row) = (part_axis(view, k).dot.opening) &
                                                          - given_at_level(group%coordinate(k, i))
                end do
                cycle
            end if
            if (model%joint(group%joint(i))%kind == joint_loose) cycle
            if (view%is_line) then
                row = row + 1
                right(:, row) = view%u.dot.opening
                if (view%is_cam .and. level == level_given) then
                    associate (along => view%u.cross.opening_of(state%plane, view, level_velocity))
                        right(:, row) = right(:, row) + view%round*along**2
                    end associate
                end if
                cycle
            end if
            if (view%slides) then
                right(:, row + 1) = view%u.cross.opening
                right(:, row + 2) = turning
            else
                right(:, row + 1) = opening%x
                right(:, row + 2) = opening%y
            end if
            row = row + 2
            if (view%is_fixed) then
                row = row + 1
                right(:, row) = turning
            end if
            c = group%coordinate(1, i)
            if (c == 0) cycle
            row = row + 1
            right(:, row) = merge(view%u.dot.opening, turning, view%slides) - given_at_level(c)
        end do

    contains

        !> What the level gives of a coordinate.
        function given_at_level(c) result(given)
            integer, intent(in) :: c
            real(wp) :: given(lanes)

            select case (level)
            case (level_velocity)
                given = given_rate(model, state, c)
            case (level_given)
                given = given_acceleration(model, state, c)
            case default
                given = given_column(model, state, c, level)
            end select
        end function given_at_level
    end subroutine assemble_level

    pure function opening_of(plane, view, level) result(opening)
        type(planar_motion), intent(in) :: plane
        type(joint_view), intent(in) :: view
        integer, intent(in) :: level
        type(vec2) :: opening

        opening = carried(plane, level, view%link(2), view%o(2), view%arm(2)) &
                  - carried(plane, level, view%link(1), view%o(1), view%arm(1))
    end function opening_of

    subroutine take_level(model, group, right, level, plane)
        type(model_type), intent(in) :: model
        type(group_type), intent(in) :: group
        real(wp), intent(in) :: right(:, :)
        integer, intent(in) :: level
        type(planar_motion), intent(inout) :: plane
        integer :: i

        do i = 1, size(group%link)
            plane%linear(level, group%link(i)) = vec2(-right(:, 3*i - 2), -right(:, 3*i - 1))
            if (group%turns(i)) plane%angular(:, level, orientation_of(model, group%link(i))) = -right(:, 3*i)
        end do
    end subroutine take_level
end module linkdyn_planar_group
