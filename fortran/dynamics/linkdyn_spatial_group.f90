!> Constraints of any spatial Assur group, closed loops other than UPS legs and CSP groups, for Newton's method.
!>
!> Unknown are shift and turn of each link, seen from the world. A joint is a few constraints of two kinds: a gap between
!> its markers along some direction, and an angle of the second link against the first about some axis. Each is linear in
!> the links' rates, so positions (by Newton's method), velocities and columns of accelerations obey one matrix; what
!> velocities alone do to a constraint is its bias.
module linkdyn_spatial_group
    use linkdyn_constants, only: two_pi
    use linkdyn_gauss_jordan, only: solve_gauss_jordan
    use linkdyn_given, only: given_position, given_rate, given_acceleration, given_column
    use linkdyn_group_motion, only: size_of_rows
    use linkdyn_joint_motion, only: turn_frame, variables_of_relative, marker_axis
    use linkdyn_joint_table, only: is_slide, is_threaded, variable_axis, most_slides, slide_axis, n_slide, joint_universal, &
        along_z, force_directions, moment_directions, n_along, along_axes, &
        along_x_and_y, along_normal, pose_attitude
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state
    use linkdyn_lane_count, only: lanes
    use linkdyn_model, only: model_type, group_type, led_type, orientation_of, scene_size
    use linkdyn_planar_motion, only: level_velocity, level_given
    use linkdyn_planner, only: joint_constraints
    use linkdyn_point, only: point_column
    use linkdyn_quaternion, only: rotation_of_quaternion
    use linkdyn_vec3, only: vec3, mat3, operator(+), operator(-), operator(*), operator(.dot.), operator(.cross.), &
        operator(.rotate.), vec3_of, zero_vec3
    use linkdyn_whole_turns, only: least_angle
    implicit none (type, external)
    private
    public :: put_spatial_links, assemble_errors, assemble_errors_ahead, refuse_turned_joints, move_spatial_group
    public :: is_spatial_length, spatial_speed, angle_off_threads, take_spins_apart

    !> A joint of the group, world axes.
    type :: joint_view
        integer :: kind = 0
        integer :: link(2) = 0, o(2) = 0
        integer :: place(2) = 0            !! of its links among the group's; 0: known
        type(mat3) :: frame(2)             !! of the markers
        type(vec3) :: arm(2)               !! origins of the links to their markers
        type(vec3) :: gap                  !! from the first marker to the second
        real(wp) :: pitch = 0              !! of a screw [m/rad]
    end type joint_view

    !> One constraint.
    type :: closure_row
        logical :: turns = .false.         !! an angle, else a distance
        logical :: is_thread = .false.     !! a distance that an angle comes off
        type(vec3) :: u                    !! axis of the angle; direction of the distance
        type(vec3) :: arm(2)               !! distance: from the links' origins to where it is felt
        real(wp) :: error(lanes)           !! what Newton's method brings to zero
        real(wp) :: bias(lanes)            !! second derivative at zero accelerations
        type(vec3) :: twist                !! thread: axis of that angle, as long as a unit of it goes [m]
        integer :: coordinate = 0          !! given by it; 0: zero
        real(wp) :: unit = 1               !! what a unit of the coordinate makes of the error
    end type closure_row

    integer, parameter :: most_rows = 8    !! of a joint: its constraints and the coordinates at it

contains

    !> The iterate as rotations and positions.
    subroutine put_spatial_links(model, group, state)
        type(model_type), intent(in) :: model
        type(group_type), intent(in) :: group
        type(kinematic_state), intent(inout) :: state
        integer :: i

        do i = 1, size(group%link)
            associate (l => group%link(i), place => state%group%place)
                state%position(l) = vec3(place(:, 1, l), place(:, 2, l), place(:, 3, l))
                if (group%turns(i)) state%rotation(orientation_of(model, l)) = rotation_of_quaternion(place(:, 4:7, l))
            end associate
        end do
    end subroutine put_spatial_links

    !> An axis turned end for end satisfies the equations but is no assembly of the joint.
    subroutine refuse_turned_joints(model, group, state)
        type(model_type), intent(in) :: model
        type(group_type), intent(in) :: group
        type(kinematic_state), intent(inout) :: state
        type(joint_view) :: view
        integer :: i

        do i = 1, size(group%joint)
            view = view_of(model, group, group%joint(i), state)
            select case (moment_directions(view%kind))
            case (along_x_and_y, along_axes)
                state%not_converged = state%not_converged .or. (view%frame(1)%z.dot.view%frame(2)%z) < 0
                if (moment_directions(view%kind) == along_axes) &
                    state%not_converged = state%not_converged .or. (view%frame(1)%x.dot.view%frame(2)%x) < 0
            end select
        end do
    end subroutine refuse_turned_joints

    ! ---------------------------------------------------------------- threads

    !> By what angle the nut that is farthest off its thread is off it, where the iteration stands.
    function angle_off_threads(model, group, state) result(angle)
        type(model_type), intent(in) :: model
        type(group_type), intent(in) :: group
        type(kinematic_state), intent(in) :: state
        real(wp) :: angle(lanes)
        type(joint_view) :: view
        integer :: i

        angle = 0
        do i = 1, size(group%joint)
            if (.not. is_threaded(model%joint(group%joint(i))%kind)) cycle
            view = view_of(model, group, group%joint(i), state)
            angle = max(angle, abs(angle_ahead(view)))
        end do
    end function angle_off_threads

    !> What the slide of a nut makes of its angle, less the angle; but for whole turns.
    pure function angle_ahead(view) result(angle)
        type(joint_view), intent(in) :: view
        real(wp) :: angle(lanes)

        associate (first => view%frame(1), second => view%frame(2))
            angle = (view%gap.dot.first%z)/view%pitch - atan2(second%x.dot.first%y, second%x.dot.first%x)
        end associate
        angle = atan2(sin(angle), cos(angle))
    end function angle_ahead

    !> Of a correction the turns of links about the axes of their threads: a small way along a thread is a large angle about it.
    !> Whole turns, which change nothing, are taken off the correction itself.
    subroutine take_spins_apart(model, group, state, correction, spin)
        type(model_type), intent(in) :: model
        type(group_type), intent(in) :: group
        type(kinematic_state), intent(in) :: state
        real(wp), intent(inout) :: correction(:, :)      !! (lane, row)
        real(wp), intent(out) :: spin(:, :)              !! (lane, row)
        type(joint_view) :: view
        type(vec3) :: about
        real(wp) :: angle(lanes)
        integer :: i, side, k

        spin = 0
        do i = 1, size(group%joint)
            if (.not. is_threaded(model%joint(group%joint(i))%kind)) cycle
            view = view_of(model, group, group%joint(i), state)
            do side = 1, 2
                if (view%place(side) == 0) cycle
                k = 6*(view%place(side) - 1) + 3
                about = view%frame(side)%z
                angle = correction(:, k + 1)*about%x + correction(:, k + 2)*about%y + correction(:, k + 3)*about%z
                call add(-two_pi*anint(angle/two_pi), correction)
                call add(least_angle(angle), spin)
            end do
        end do

    contains

        subroutine add(angle, to)
            real(wp), intent(in) :: angle(lanes)
            real(wp), intent(inout) :: to(:, :)

            to(:, k + 1) = to(:, k + 1) + angle*about%x
            to(:, k + 2) = to(:, k + 2) + angle*about%y
            to(:, k + 3) = to(:, k + 3) + angle*about%z
        end subroutine add
    end subroutine take_spins_apart

    ! ---------------------------------------------------------------- constraints

    function view_of(model, group, j, state) result(view)
        type(model_type), intent(in) :: model
        type(group_type), intent(in) :: group
        integer, intent(in) :: j
        type(kinematic_state), intent(in) :: state
        type(joint_view) :: view
        integer :: side

        associate (joint => model%joint(j))
            view%kind = joint%kind
            view%link = joint%link
            view%pitch = joint%pitch
            do side = 1, 2
                view%o(side) = orientation_of(model, joint%link(side))
                view%place(side) = findloc(group%link, joint%link(side), dim=1)
                view%frame(side) = turn_frame(state%rotation(view%o(side)), joint%frame(:, :, side))
                view%arm(side) = state%rotation(view%o(side)).rotate.joint%point(:, side)
            end do
        end associate
        view%gap = state%position(view%link(2)) + view%arm(2) - state%position(view%link(1)) - view%arm(1)
    end function view_of

    !> The constraints of a joint, and those of the coordinates that give its variables.
    subroutine list_rows(model, view, coordinate, state, row, n)
        type(model_type), intent(in) :: model
        type(joint_view), intent(in) :: view
        integer, intent(in) :: coordinate(3)
        type(kinematic_state), intent(in) :: state
        type(closure_row), intent(out) :: row(most_rows)
        integer, intent(out) :: n
        real(wp) :: variable(lanes, 3), rate(lanes, 3)
        integer :: k

        n = 0
        associate (first => view%frame(1), second => view%frame(2))
            select case (force_directions(view%kind))
            case (along_x_and_y)
                call add_distance_along(first%x)
                call add_distance_along(first%y)
            case (along_z)
                call add_distance_along(first%z)
            case (along_axes)
                call add_distance(vec3_of([1.0_wp, 0.0_wp, 0.0_wp]))
                call add_distance(vec3_of([0.0_wp, 1.0_wp, 0.0_wp]))
                call add_distance(vec3_of([0.0_wp, 0.0_wp, 1.0_wp]))
            end select
            select case (moment_directions(view%kind))
            case (along_normal)
                call add_right_angle(second%z, first%z)
            case (along_x_and_y, along_axes)
                call add_right_angle(second%z, first%x)
                call add_right_angle(second%z, first%y)
                if (moment_directions(view%kind) == along_axes) call add_right_angle(second%x, first%y)
            end select
            if (is_threaded(view%kind)) call add_thread()
            if (all(coordinate == 0)) return
            call variables_of_relative(view%kind, first, second, view%gap, zero_vec3(), zero_vec3(), variable, rate, view%pitch)
            do k = 1, 3
                if (coordinate(k) == 0) cycle
                if (view%kind == pose_attitude) then
                    call add_attitude_angle(k)
                else if (is_slide(view%kind, k)) then
                    call add_distance_along(marker_axis(first, variable_axis(k, view%kind)))
                    row(n)%error = variable(:, k) - given_position(model, state, coordinate(k))
                else if (is_threaded(view%kind)) then
                    ! the slide tells a screw's angle, and its turns
                    call add_distance_along(first%z)
                    row(n)%unit = view%pitch
                    row(n)%error = view%pitch*(variable(:, k) - given_position(model, state, coordinate(k)))
                else if (view%kind == joint_universal .and. k == 2) then
                    call add_angle(second%z, view%o(2), variable(:, k) - given_position(model, state, coordinate(k)))
                else
                    call add_angle(first%z, view%o(1), variable(:, k) - given_position(model, state, coordinate(k)))
                end if
                row(n)%coordinate = coordinate(k)
            end do
        end associate

    contains

        !> The gap along a direction of the world.
        subroutine add_distance(u)
            type(vec3), intent(in) :: u

            n = n + 1
            row(n)%u = u
            row(n)%arm = view%arm
            row(n)%error = u.dot.view%gap
            row(n)%bias = u.dot.(centripetal(2) - centripetal(1))
        end subroutine add_distance

        !> The gap along a direction that turns with the first link, which is therefore felt at the second's marker.
        subroutine add_distance_along(u)
            type(vec3), intent(in) :: u
            type(vec3) :: opening

            call add_distance(u)
            row(n)%arm(1) = view%arm(1) + view%gap
            associate (omega => state%omega(view%o(1)))
                opening = point_velocity_of(2) - point_velocity_of(1)
                row(n)%bias = row(n)%bias + 2.0_wp*(opening.dot.(omega.cross.u)) + (view%gap.dot.(omega.cross.(omega.cross.u)))
            end associate
        end subroutine add_distance_along

        !> The slide along z less what the angle about it makes of it, but for whole turns.
        subroutine add_thread()

            call add_distance_along(view%frame(1)%z)
            associate (first => view%frame(1))
                row(n)%is_thread = .true.
                row(n)%twist = (-view%pitch)*first%z
                row(n)%error = view%pitch*angle_ahead(view)
                row(n)%bias = row(n)%bias - view%pitch &
                              *((state%omega(view%o(2)) - state%omega(view%o(1))).dot.(state%omega(view%o(1)).cross.first%z))
            end associate
        end subroutine add_thread

        !> Directions of the second and of the first link that stay square to each other.
        subroutine add_right_angle(a, b)
            type(vec3), intent(in) :: a, b

            n = n + 1
            row(n)%turns = .true.
            row(n)%u = a.cross.b
            row(n)%error = a.dot.b
            associate (w2 => state%omega(view%o(2)), w1 => state%omega(view%o(1)))
                row(n)%bias = ((w2.cross.(w2.cross.a)).dot.b) + 2.0_wp*((w2.cross.a).dot.(w1.cross.b)) &
                              + (a.dot.(w1.cross.(w1.cross.b)))
            end associate
        end subroutine add_right_angle

        !> The angle about an axis fixed to one of the links.
        subroutine add_angle(axis, o, error)
            type(vec3), intent(in) :: axis
            integer, intent(in) :: o
            real(wp), intent(in) :: error(lanes)

            n = n + 1
            row(n)%turns = .true.
            row(n)%u = axis
            row(n)%error = atan2(sin(error), cos(error))
            row(n)%bias = (state%omega(view%o(2)) - state%omega(view%o(1))).dot.(state%omega(o).cross.axis)
        end subroutine add_angle

        !> Roll, pitch or yaw of a measured attitude. The angular velocity of the second link against the first is the sum of their
        !> rates about the axes e: x of the first marker, the pitch axis, z of the second. What is square to the other two
        !> axes tells a rate.
        subroutine add_attitude_angle(k)
            integer, intent(in) :: k
            type(vec3) :: e(3), across
            real(wp) :: rate(lanes, 3), per(lanes), error(lanes)

            associate (first => view%frame(1), second => view%frame(2), w1 => state%omega(view%o(1)), w2 => state%omega(view%o(2)))
                e(1) = first%x
                e(3) = second%z
                across = e(3).cross.e(1)
                per = 1/sqrt(across.dot.across)
                e(2) = per*across
                if (k /= 2) across = e(modulo(k, 3) + 1).cross.e(modulo(k + 1, 3) + 1)
                n = n + 1
                row(n)%turns = .true.
                row(n)%u = per*across
                error = variable(:, k) - state%q(:, coordinate(k))
                row(n)%error = atan2(sin(error), cos(error))
                rate(:, 1) = per*((w2 - w1).dot.(e(2).cross.e(3)))
                rate(:, 2) = (w2 - w1).dot.e(2)
                rate(:, 3) = per*((w2 - w1).dot.(e(1).cross.e(2)))
                row(n)%bias = -(row(n)%u.dot.(rate(:, 1)*(w1.cross.e(1)) + rate(:, 2)*((w1 + rate(:, 1)*e(1)).cross.e(2)) &
                                              + rate(:, 3)*(w2.cross.e(3))))
            end associate
        end subroutine add_attitude_angle

        pure function centripetal(side) result(a)
            integer, intent(in) :: side
            type(vec3) :: a

            associate (omega => state%omega(view%o(side)))
                a = omega.cross.(omega.cross.view%arm(side))
            end associate
        end function centripetal

        pure function point_velocity_of(side) result(v)
            integer, intent(in) :: side
            type(vec3) :: v

            v = point_column(state%velocity(view%link(side)), state%omega(view%o(side)), view%arm(side))
        end function point_velocity_of
    end subroutine list_rows

    !> Errors at the iterate, and how the links make them: the matrix.
    subroutine assemble_errors(model, group, state, matrix, right)
        type(model_type), intent(in) :: model
        type(group_type), intent(in) :: group
        type(kinematic_state), intent(inout) :: state
        real(wp), intent(out) :: matrix(:, :, :), right(:, :)
        type(joint_view) :: view
        type(closure_row) :: row(most_rows)
        integer :: i, k, n, first

        matrix = 0
        first = 0
        do i = 1, size(group%joint)
            view = view_of(model, group, group%joint(i), state)
            do k = 1, n_slide(view%kind)
                state%slide(:, k, group%joint(i)) = view%gap.dot.marker_axis(view%frame(1), slide_axis(k, view%kind))
            end do
            call list_rows(model, view, group%coordinate(:, i), state, row, n)
            do k = 1, n
                call put_row(view, row(k), matrix(:, first + k, :))
                right(:, first + k) = row(k)%error
                if (row(k)%coordinate > model%n_q) call take_sources_off(model%led(row(k)%coordinate - model%n_q), row(k)%unit)
            end do
            first = first + n
        end do

    contains

        !> What gears make of other joints of the group, for a variable of this one.
        subroutine take_sources_off(led, unit)
            type(led_type), intent(in) :: led
            real(wp), intent(in) :: unit
            type(joint_view) :: source
            type(closure_row) :: of_source
            real(wp) :: part(lanes, 6*size(group%link))
            integer :: s

            do s = 1, size(led%source)
                source = view_of(model, group, led%source(s), state)
                if (all(source%place == 0)) cycle
                of_source%turns = .not. is_slide(source%kind, 1)
                of_source%u = source%frame(1)%z
                of_source%arm = source%arm
                of_source%arm(1) = source%arm(1) + source%gap
                part = 0
                call put_row(source, of_source, part)
                matrix(:, first + k, :) = matrix(:, first + k, :) - unit*led%source_weight(s)*part
            end do
        end subroutine take_sources_off
    end subroutine assemble_errors

    !> Which of the rows of `assemble_errors` are distances.
    pure function is_spatial_length(model, group) result(is_length)
        type(model_type), intent(in) :: model
        type(group_type), intent(in) :: group
        logical :: is_length(6*size(group%link))
        integer :: i, k, n, row

        row = 0
        do i = 1, size(group%joint)
            associate (kind => model%joint(group%joint(i))%kind)
                n = joint_constraints(model, kind)
                is_length(row + 1:row + n) = [(k <= n_along(force_directions(kind)) .or. (k == n .and. is_threaded(kind)), k=1, n)]
                row = row + n
                do k = 1, 3
                    if (group%coordinate(k, i) == 0) cycle
                    row = row + 1
                    is_length(row) = is_slide(kind, k) .or. is_threaded(kind)
                end do
            end associate
        end do
    end function is_spatial_length

    !> The matrix a little further on, where the links' velocities lead.
    subroutine assemble_errors_ahead(model, group, step, state, matrix, right)
        type(model_type), intent(in) :: model
        type(group_type), intent(in) :: group
        real(wp), intent(in) :: step(lanes)
        type(kinematic_state), intent(inout) :: state    !! unchanged
        real(wp), intent(out) :: matrix(:, :, :), right(:, :)
        type(mat3) :: rotation(0:model%n_orientation)
        type(vec3) :: position(0:model%n_link), turn
        real(wp) :: slide(lanes, most_slides, size(model%joint))
        integer :: o, l

        rotation = state%rotation
        position = state%position
        slide = state%slide
        do o = 0, model%n_orientation
            turn = step*state%omega(o)
            associate (r => rotation(o))
                state%rotation(o) = mat3(r%x + (turn.cross.r%x), r%y + (turn.cross.r%y), r%z + (turn.cross.r%z))
            end associate
        end do
        do l = 0, model%n_link
            state%position(l) = position(l) + step*state%velocity(l)
        end do
        call assemble_errors(model, group, state, matrix, right)
        state%rotation = rotation
        state%position = position
        state%slide = slide
    end subroutine assemble_errors_ahead

    !> The largest of the links' angular rates of a level, and of their rates by the mechanism's size.
    pure function spatial_speed(model, group, state, level) result(speed)
        type(model_type), intent(in) :: model
        type(group_type), intent(in) :: group
        type(kinematic_state), intent(in) :: state
        integer, intent(in) :: level                     !! of velocity, of the given acceleration
        real(wp) :: speed(lanes)
        type(vec3) :: linear, angular
        integer :: i

        speed = 0
        do i = 1, size(group%link)
            associate (l => group%link(i), o => orientation_of(model, group%link(i)))
                linear = state%velocity(l)
                angular = state%omega(o)
                if (level == level_given) then
                    linear = state%acceleration(0, l)
                    angular = state%alpha(0, o)
                end if
            end associate
            speed = max(speed, sqrt(angular.dot.angular), sqrt(linear.dot.linear)/scene_size(model))
        end do
    end function spatial_speed

    subroutine put_row(view, row, entry)
        type(joint_view), intent(in) :: view
        type(closure_row), intent(in) :: row
        real(wp), intent(inout) :: entry(:, :)     !! (lane, column)
        type(vec3) :: u, lever
        integer :: side, k

        do side = 1, 2
            if (view%place(side) == 0) cycle
            k = 6*(view%place(side) - 1)
            u = merge(-1.0_wp, 1.0_wp, side == 1)*row%u
            lever = u
            if (.not. row%turns) then
                entry(:, k + 1) = u%x
                entry(:, k + 2) = u%y
                entry(:, k + 3) = u%z
                lever = row%arm(side).cross.u
                if (row%is_thread) lever = lever + merge(-1.0_wp, 1.0_wp, side == 1)*row%twist
            end if
            entry(:, k + 4) = lever%x
            entry(:, k + 5) = lever%y
            entry(:, k + 6) = lever%z
        end do
    end subroutine put_row

    ! ---------------------------------------------------------------- velocities and accelerations

    !> Velocities and columns at once, then the acceleration, whose bias needs the velocities. On a way there are
    !> velocities only.
    subroutine move_spatial_group(model, group, state)
        type(model_type), intent(in) :: model
        type(group_type), intent(in) :: group
        type(kinematic_state), intent(inout) :: state
        real(wp) :: growth(lanes)
        logical :: is_singular(lanes)
        integer :: n, n_column, k

        n = 6*size(group%link)
        n_column = merge(0, state%n_column, state%group%is_led)
        associate (matrix => state%group%matrix, right => state%group%right)
            call rest_links(model, group, state)
            call assemble_errors(model, group, state, matrix(:, :n, :n), right(:, :n, 1))
            call assemble_rates(model, group, state, state%velocity, state%omega, level_velocity, right(:, :n, 1))
            state%group%gap(:, level_velocity) = size_of_rows(group, right(:, :n, 1))
            do k = 1, n_column
                call assemble_rates(model, group, state, state%acceleration(k, :), state%alpha(k, :), k, right(:, :n, k + 1))
            end do
            call solve_gauss_jordan(n, n_column + 1, matrix(:, :n, :n), right(:, :n, :n_column + 1), growth, is_singular)
            call take_rates(model, group, right(:, :n, 1), state%velocity, state%omega)
            do k = 1, n_column
                call take_rates(model, group, right(:, :n, k + 1), state%acceleration(k, :), state%alpha(k, :))
            end do
            if (state%group%is_led) return
            call assemble_errors(model, group, state, matrix(:, :n, :n), right(:, :n, 1))
            call assemble_rates(model, group, state, state%acceleration(0, :), state%alpha(0, :), level_given, right(:, :n, 1))
            state%group%gap(:, level_given) = size_of_rows(group, right(:, :n, 1))
            call solve_gauss_jordan(n, 1, matrix(:, :n, :n), right(:, :n, :1), growth, is_singular)
            call take_rates(model, group, right(:, :n, 1), state%acceleration(0, :), state%alpha(0, :))
        end associate
    end subroutine move_spatial_group

    !> Variables that gears make of the group's own begin from its links at rest.
    subroutine rest_links(model, group, state)
        type(model_type), intent(in) :: model
        type(group_type), intent(in) :: group
        type(kinematic_state), intent(inout) :: state
        integer :: i, k

        if (all(group%coordinate(1, :) <= model%n_q)) return
        do i = 1, size(group%link)
            associate (l => group%link(i), o => orientation_of(model, group%link(i)))
                state%velocity(l) = zero_vec3()
                if (group%turns(i)) state%omega(o) = zero_vec3()
                do k = 0, state%n_column
                    state%acceleration(k, l) = zero_vec3()
                    if (group%turns(i)) state%alpha(k, o) = zero_vec3()
                end do
            end associate
        end do
    end subroutine rest_links

    !> How fast the constraints would change if the group's links had no rates at this level, less what the coordinates
    !> prescribe.
    subroutine assemble_rates(model, group, state, linear, angular, level, right)
        type(model_type), intent(in) :: model
        type(group_type), intent(in) :: group
        type(kinematic_state), intent(in) :: state
        type(vec3), intent(in) :: linear(0:), angular(0:)    !! rates of the links' origins, of the orientations
        integer, intent(in) :: level
        real(wp), intent(out) :: right(:, :)
        type(joint_view) :: view
        type(closure_row) :: row(most_rows)
        integer :: i, k, n, first, side

        first = 0
        do i = 1, size(group%joint)
            view = view_of(model, group, group%joint(i), state)
            call list_rows(model, view, group%coordinate(:, i), state, row, n)
            do k = 1, n
                associate (rate => right(:, first + k), c => row(k)%coordinate)
                    rate = 0
                    if (level == level_given) rate = row(k)%bias
                    do side = 1, 2
                        if (view%place(side) > 0) cycle
                        rate = rate + merge(-1, 1, side == 1)*known_rate(side)
                    end do
                    if (c == 0) cycle
                    if (level == level_velocity) rate = rate - row(k)%unit*given_rate(model, state, c)
                    if (level == level_given) rate = rate - row(k)%unit*given_acceleration(model, state, c)
                    if (level > level_given) rate = rate - row(k)%unit*given_column(model, state, c, level)
                end associate
            end do
            first = first + n
        end do

    contains

        pure function known_rate(side) result(rate)
            integer, intent(in) :: side
            real(wp) :: rate(lanes)

            if (row(k)%turns) then
                rate = row(k)%u.dot.angular(view%o(side))
            else
                rate = row(k)%u.dot.point_column(linear(view%link(side)), angular(view%o(side)), row(k)%arm(side))
                if (row(k)%is_thread) rate = rate + (row(k)%twist.dot.angular(view%o(side)))
            end if
        end function known_rate
    end subroutine assemble_rates

    subroutine take_rates(model, group, right, linear, angular)
        type(model_type), intent(in) :: model
        type(group_type), intent(in) :: group
        real(wp), intent(in) :: right(:, :)
        type(vec3), intent(inout) :: linear(0:), angular(0:)
        integer :: i, k

        do i = 1, size(group%link)
            k = 6*(i - 1)
            linear(group%link(i)) = vec3(-right(:, k + 1), -right(:, k + 2), -right(:, k + 3))
            if (.not. group%turns(i)) cycle
            angular(orientation_of(model, group%link(i))) = vec3(-right(:, k + 4), -right(:, k + 5), -right(:, k + 6))
        end do
    end subroutine take_rates
end module linkdyn_spatial_group
