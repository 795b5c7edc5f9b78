!> How far the mechanism may move before its equations become singular or its reach ends.
!>
!> With u and v the singular vectors of the smallest singular value, sigma = u^T A v of the scaled equations (see
!> `linkdyn_condition`), the distance is sigma over its gradient. The gradient needs no elimination: sigma changes with A alone, and
!> A with the links' rotations and slides, which move along the acceleration columns, the velocities for unit rates of the
!> coordinates. So no position beyond a dead point is ever asked for, however near it is.
!>
!> That is so where sigma goes to zero as the distance does. Where a coordinate comes to its limit the links move as the root of the
!> distance, and sigma goes as the root, or, with slides that run away, as its third power; so which power it is is asked of how
!> the slope changes on the way (`power_of`).
!>
!> Where the links of a planar dyad come into line, the mechanism comes to the end of its reach. The equations may be regular
!> there, as those of an arm led by its tool are; so the determinant of each dyad's map has a distance of its own, and so has the
!> margin of every other loop, as it is watched where an assembly is followed. The shortest counts.
!>
!> The distance is one of the coordinates, angles times a characteristic length.
module linkdyn_singularity
    use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan
    use linkdyn_condition, only: condition_type, condition_space, singular_vectors, solve_poses, is_posed
    use linkdyn_closed_forms, only: see_dyad
    use linkdyn_force_map, only: typical_length
    use linkdyn_joint_motion, only: marker_axis
    use linkdyn_joint_rates, only: joint_view, view_joint, slide_column
    use linkdyn_joint_table, only: most_slides, n_slide, slide_axis
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state, prepare_kinematics
    use linkdyn_lane_count, only: lanes
    use linkdyn_equations_on_lanes, only: lane_space, run_on_lanes, free_lane_space
    use linkdyn_led_mechanism, only: evaluate_kinematics, lead_from_start, measure_margins, n_map
    use linkdyn_model, only: model_type, step_type, step_pose, is_dyad, attitude_angles
    use linkdyn_planar_motion, only: level_velocity, level_given
    use linkdyn_planar_rates, only: planar_joint_rate
    use linkdyn_pose, only: rpy_rotation, rotate_rpy
    use linkdyn_vec2, only: rot2, operator(+), operator(*)
    use linkdyn_vec3, only: vec3, operator(+), operator(*), operator(.cross.), operator(.dot.)
    implicit none (type, external)
    private
    public :: singularity_space, prepare_singularity, find_singularity_distance

    !> [rad] of a central difference: its error of second order is as small as rounding
    real(wp), parameter :: largest_turn = epsilon(1.0_wp)**(1.0_wp/3)
    !> The same of a second difference.
    real(wp), parameter :: small_turn = epsilon(1.0_wp)**0.25_wp

    !> Scratch of one thread.
    type :: singularity_space
        type(kinematic_state) :: going            !! the mechanism on its way to the singular position, at unit rate
        type(kinematic_state) :: moved            !! a little moved
        type(lane_space) :: of_matrix             !! its equations
        real(wp), allocatable :: left(:, :), right(:, :)    !! singular vectors, scaled back to the equations' own rows and columns
        real(wp), allocatable :: gradient(:, :)   !! of sigma (lane, n_q) [1/m], angles times the length
        real(wp), allocatable :: slide(:, :, :)   !! rates of the slides for a unit rate of a coordinate (lane, slide, n_joint)
        real(wp), allocatable :: unit(:)          !! what a unit of each coordinate counts (n_q) [m]
        real(wp), allocatable :: margin(:, :)     !! of the maps (lane, n_map)
        real(wp), allocatable :: drift(:, :, :)   !! their rates for unit rates of the coordinates (lane, n_map, n_q)
        real(wp), allocatable :: turned(:, :)     !! what the equations' change along the way makes of the right vector (lane, n)
        real(wp), allocatable :: solved(:, :)     !! and what solves that
    contains
        procedure :: free => free_singularity
    end type singularity_space

contains

    !> Make room for one thread.
    subroutine prepare_singularity(model, condition, space)
        type(model_type), intent(in) :: model
        type(condition_type), intent(in) :: condition
        type(singularity_space), intent(out) :: space

        call prepare_kinematics(model, 0, space%going)
        call prepare_kinematics(model, 0, space%moved)
        allocate (space%left(lanes, condition%n), space%right(lanes, condition%n))
        allocate (space%gradient(lanes, model%n_q), space%slide(lanes, most_slides, model%n_joint))
        space%unit = merge(1.0_wp, typical_length(model), model%scene%coordinate%unit == "m")
        allocate (space%turned(lanes, condition%n), space%solved(lanes, condition%n))
        allocate (space%margin(lanes, n_map(model)), space%drift(lanes, n_map(model), model%n_q))
    end subroutine prepare_singularity

    subroutine free_singularity(self)
        class(singularity_space), intent(inout) :: self

        call free_lane_space(self%of_matrix)
    end subroutine free_singularity

    !> Distance [m] of the block whose equations `condition_space` has eliminated; NaN where there is none to be had.
    !>
    !> Needs acceleration columns of all links.
    subroutine find_singularity_distance(model, condition, state, factors, space, distance)
        type(model_type), intent(in) :: model
        type(condition_type), intent(in) :: condition
        type(kinematic_state), intent(in) :: state
        type(condition_space), intent(inout) :: factors
        type(singularity_space), intent(inout) :: space
        real(wp), intent(out) :: distance(lanes)
        real(wp), dimension(lanes) :: sigma, steepness, curvature
        integer :: k, lane

        call singular_vectors(condition, state, factors, space%left, space%right, sigma)
        do k = 1, model%n_q
            call change_of_sigma(model, condition, state, k, factors, space, space%gradient(:, k))
        end do
        if (.not. model%is_planar) call take_angles_of_poses(model, state, space%gradient)
        steepness = 0
        do k = 1, model%n_q
            space%gradient(:, k) = space%gradient(:, k)/space%unit(k)
            steepness = steepness + space%gradient(:, k)**2
        end do
        steepness = sqrt(steepness)
        call go_there(model, state, sigma, steepness, space)
        distance = abs(sigma)/steepness
        call curvature_of_sigma(model, condition, state, sigma, factors, space, curvature)
        distance = distance*power_of(sigma, steepness, curvature)
        if (model%n_dyad > 0) call look_at_reach(model, state, space, distance)
        if (n_map(model) > model%n_dyad) call look_at_loops(model, state, space, distance)
        do lane = 1, lanes
            if (.not. is_posed(state, lane)) distance(lane) = ieee_value(1.0_wp, ieee_quiet_nan)
        end do
    end subroutine find_singularity_distance

    !> Columns of a pose are those of its angular velocity, its coordinates are angles: each turns about an axis of its own.
    subroutine take_angles_of_poses(model, state, gradient)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        real(wp), intent(inout) :: gradient(:, :)      !! (lane, n_q)
        type(rpy_rotation) :: attitude
        type(vec3) :: of_turn
        integer :: i

        do i = 1, size(model%step)
            if (model%step(i)%kind /= step_pose) cycle
            associate (c => attitude_angles(model%step(i)))
                call rotate_rpy(state%q(:, c(1)), state%q(:, c(2)), state%q(:, c(3)), attitude)
                of_turn = vec3(gradient(:, c(1)), gradient(:, c(2)), gradient(:, c(3)))
                gradient(:, c(2)) = of_turn.dot.attitude%pitch_axis
                gradient(:, c(3)) = of_turn.dot.attitude%r%z
            end associate
        end do
    end subroutine take_angles_of_poses

    !> The way until the links of some dyad are in line, if it is shorter.
    subroutine look_at_reach(model, state, space, distance)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        type(singularity_space), intent(inout) :: space
        real(wp), intent(inout) :: distance(lanes)
        real(wp), dimension(lanes) :: determinant, product, lengths, steepness, curvature, way
        integer :: i, k

        do i = 1, size(model%step)
            if (.not. is_dyad(model%step(i)%kind)) cycle
            call see_dyad(model, model%step(i), state, determinant, product, lengths)
            steepness = 0
            do k = 1, model%n_q
                call change_of_determinant(model, state, model%step(i), k, space, space%gradient(:, k))
                space%gradient(:, k) = space%gradient(:, k)/space%unit(k)
                steepness = steepness + space%gradient(:, k)**2
            end do
            steepness = sqrt(steepness)
            call go_there(model, state, determinant, steepness, space)
            way = abs(determinant)/steepness
            call curvature_of_determinant(model, model%step(i), space, curvature)
            way = way*power_of(determinant, steepness, curvature)
            where (way < distance) distance = way
        end do
    end subroutine look_at_reach

    !> The way until the margin of some other loop is gone, if it is much shorter: where the equations become singular by that loop,
    !> too, sigma tells better how far away it is.
    subroutine look_at_loops(model, state, space, distance)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        type(singularity_space), intent(inout) :: space
        real(wp), intent(inout) :: distance(lanes)
        real(wp), parameter :: much = 1.0_wp/3        !! 2/3 of a distance, the third power of a root taken for the first, halved
        real(wp), dimension(lanes) :: steepness, way, by_sigma
        real(wp) :: least(lanes, size(model%group))
        logical :: is_of_dyad(n_map(model))
        integer :: status(lanes), i, k, m

        do k = 1, model%n_q
            call stand_there(model, state, space%going)
            space%going%qd = 0
            space%going%qd(:, k) = 1/space%unit(k)
            call lead_from_start(model, space%going, status, least)
            call measure_margins(model, space%going, space%margin, space%drift(:, :, k))
        end do
        by_sigma = distance
        is_of_dyad = .false.
        do i = 1, size(model%step)
            if (is_dyad(model%step(i)%kind)) is_of_dyad(model%step(i)%first) = .true.
        end do
        do m = 1, size(is_of_dyad)
            if (is_of_dyad(m)) cycle
            space%gradient = space%drift(:, m, :)
            steepness = sqrt(sum(space%gradient**2, 2))
            call go_there(model, state, space%margin(:, m), steepness, space)
            way = abs(space%margin(:, m))/steepness
            way = way*power_by_speeds(model, space%going, way)
            where (way < much*by_sigma .and. way < distance) distance = way
        end do
    end subroutine look_at_loops

    !> The power of the distance as which a margin goes to zero, one or a half: where it is a half, the links' velocities w for a
    !> unit rate grow as 1/sqrt(distance). With their derivatives a, distance*(a.w)/(w.w) is 1 there, as the distance taken is twice
    !> the true one, and nearly 0 where they hardly change.
    function power_by_speeds(model, going, distance) result(power)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: going
        real(wp), intent(in) :: distance(lanes)       !! taken for the first power
        real(wp), dimension(lanes) :: power, square, growth
        integer :: o

        square = 0
        growth = 0
        do o = 1, model%n_orientation
            if (model%is_planar) then
                square = square + going%plane%angular(:, level_velocity, o)**2
                growth = growth + going%plane%angular(:, level_velocity, o)*going%plane%angular(:, level_given, o)
            else
                square = square + (going%omega(o).dot.going%omega(o))
                growth = growth + (going%omega(o).dot.going%alpha(0, o))
            end if
        end do
        growth = distance*growth/square
        power = 1 - 0.5_wp*merge(min(growth, 1.0_wp), 0.0_wp, growth > 0)
    end function power_by_speeds

    !> Derivative of the determinant of a dyad's map for a unit rate of a coordinate: a product of two vectors that turn, or
    !> become longer, along the links' velocities, so the central difference is exact but for the third order.
    subroutine change_of_determinant(model, state, step, k, space, change)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        type(step_type), intent(in) :: step
        integer, intent(in) :: k
        type(singularity_space), intent(inout) :: space
        real(wp), intent(out) :: change(lanes)
        real(wp), dimension(lanes) :: determinant, product, lengths, speed, part
        integer :: way

        call largest_speed(model, state, k, space%slide, speed)
        part = merge(largest_turn/max(speed, tiny(1.0_wp)), 0.0_wp, speed > 0)
        change = 0
        do way = -1, 1, 2
            call move(model, state, k, way*part, space)
            call see_dyad(model, step, space%moved, determinant, product, lengths)
            change = change + way*determinant
        end do
        change = merge(change/(2*part), 0.0_wp, part > 0)
    end subroutine change_of_determinant

    !> Derivative of u^T A v for a unit rate of a coordinate: a central difference along the links' velocities. The entries of A are
    !> products of up to three rotations and slides, so all but the third order drops out.
    subroutine change_of_sigma(model, condition, state, k, factors, space, change)
        type(model_type), intent(in) :: model
        type(condition_type), intent(in) :: condition
        type(kinematic_state), intent(in) :: state
        integer, intent(in) :: k
        type(condition_space), intent(in) :: factors
        type(singularity_space), intent(inout) :: space
        real(wp), intent(out) :: change(lanes)
        real(wp) :: speed(lanes), step(lanes)
        integer :: i, way

        call largest_speed(model, state, k, space%slide, speed)
        step = merge(largest_turn/max(speed, tiny(1.0_wp)), 0.0_wp, speed > 0)
        change = 0
        do way = -1, 1, 2
            call move(model, state, k, way*step, space)
            call run_on_lanes(condition%kernels%matrix, lanes, space%moved, factors%inverse%numbers, space%of_matrix)
            associate (form => condition%kernels%form, found => space%of_matrix%found)
                do i = 1, size(form%row)
                    if (form%output(i) > 0) change = change + way*found(:, form%output(i)) &
                        *(space%left(:, form%row(i))*space%right(:, form%column(i)))
                end do
            end associate
        end do
        change = merge(change/(2*step), 0.0_wp, step > 0)
    end subroutine change_of_sigma

    !> Rates of the slides, and the largest rate of any rotation or slide, which counts by the characteristic length.
    subroutine largest_speed(model, state, k, slide, speed)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        integer, intent(in) :: k
        real(wp), intent(out) :: slide(lanes, most_slides, model%n_joint)
        real(wp), intent(out) :: speed(lanes)
        real(wp) :: length
        integer :: o, j, i

        length = typical_length(model)
        speed = 0
        do o = 1, model%n_orientation
            if (model%is_planar) then
                speed = max(speed, abs(state%plane%angular(:, k, o)))
            else
                speed = max(speed, sqrt(state%alpha(k, o).dot.state%alpha(k, o)))
            end if
        end do
        slide = 0
        do j = 1, model%n_joint
            do i = 1, n_slide(model%joint(j)%kind)
                slide(:, i, j) = slide_column(model, state, j, i, k)
                speed = max(speed, abs(slide(:, i, j))/length)
            end do
        end do
    end subroutine largest_speed

    !> Rotations and slides after a small step of a coordinate, to first order; in the plane places too.
    subroutine move(model, state, k, step, space)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        integer, intent(in) :: k
        real(wp), intent(in) :: step(lanes)
        type(singularity_space), intent(inout) :: space
        real(wp) :: angle(lanes)
        integer :: o, j, l, i

        associate (moved => space%moved)
            if (model%is_planar) then
                do l = 1, model%n_link
                    moved%plane%position(l) = state%plane%position(l) + step*state%plane%linear(k, l)
                end do
            end if
            do o = 1, model%n_orientation
                if (model%is_planar) then
                    associate (r => state%plane%rotation(o))
                        angle = step*state%plane%angular(:, k, o)
                        moved%plane%rotation(o) = rot2(r%c - angle*r%s, r%s + angle*r%c)
                    end associate
                else
                    associate (r => state%rotation(o), turn => step*state%alpha(k, o))
                        moved%rotation(o)%x = r%x + (turn.cross.r%x)
                        moved%rotation(o)%y = r%y + (turn.cross.r%y)
                        moved%rotation(o)%z = r%z + (turn.cross.r%z)
                    end associate
                end if
            end do
            do j = 1, model%n_joint
                do i = 1, most_slides
                    moved%slide(:, i, j) = state%slide(:, i, j) + step*space%slide(:, i, j)
                end do
            end do
        end associate
    end subroutine move

    !> The power of the distance as which something goes to zero: if it is C d^p along the way, its slope and how that changes tell
    !> p, wherever one is. Near one it is one: on the way to a simple zero, too, slopes change a little. Nothing is below a root;
    !> what looks so is one, and half of what it looks like mends the first order that the root alone leaves.
    elemental real(wp) function power_of(value, steepness, curvature) result(power)
        real(wp), intent(in) :: value, steepness, curvature     !! and its first and second derivative towards zero
        real(wp), parameter :: root = 0.5_wp, most = 1.5_wp     !! of roots, of roots with slides that run away
        real(wp), parameter :: simple = 0.1_wp, other = 0.3_wp  !! so far off one: it is one; it is as found
        real(wp) :: share, off

        power = 1
        share = 1 - value*curvature/steepness**2
        if (.not. abs(share) <= huge(share)) return
        power = most
        if (share*most > 1) power = 1/share
        if (power < root) power = sqrt(root*max(power, 0.8_wp*root))
        off = min(max((abs(power - 1) - simple)/(other - simple), 0.0_wp), 1.0_wp)
        power = 1 + off*(power - 1)
    end function power_of

    !> The mechanism where it is, moving towards zero of what has this gradient in `space`, at unit rate.
    subroutine go_there(model, state, value, steepness, space)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        real(wp), intent(in) :: value(lanes), steepness(lanes)
        type(singularity_space), intent(inout) :: space
        integer :: k

        call stand_there(model, state, space%going)
        do k = 1, model%n_q
            space%going%qd(:, k) = -sign(1.0_wp, value)*space%gradient(:, k)/(space%unit(k)*steepness)
        end do
        call evaluate_kinematics(model, space%going)
    end subroutine go_there

    !> The same place and assembly.
    subroutine stand_there(model, state, going)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        type(kinematic_state), intent(inout) :: going

        going%q = state%q
        going%by_quaternion = state%by_quaternion
        going%quaternion = state%quaternion
        going%qdd = 0
        if (model%n_branch > 0) going%branch = state%branch
        if (size(model%group) > 0) then
            going%group%start_place = state%group%place
            going%group%start_q = state%q
        end if
    end subroutine stand_there

    !> Second derivative of sigma along the way, of the equations bordered with its singular vectors, which has the value and the
    !> slope of sigma itself: with ' along the way, u^T A'' v - 2 u^T A' A^-1 A' v + 2 (u^T A' v)^2/sigma.
    subroutine curvature_of_sigma(model, condition, state, sigma, factors, space, curvature)
        type(model_type), intent(in) :: model
        type(condition_type), intent(in) :: condition
        type(kinematic_state), intent(in) :: state
        real(wp), intent(in) :: sigma(lanes)
        type(condition_space), intent(inout) :: factors
        type(singularity_space), intent(inout) :: space
        real(wp), intent(out) :: curvature(lanes)
        real(wp) :: rate(lanes, size(condition%kernels%form%row))      ! of the entries of A
        real(wp), dimension(lanes) :: step, slope, bend
        real(wp), parameter :: weight(-1:1) = [1, -2, 1]
        integer :: i, way

        step = step_on_way(model, space%going)
        rate = 0
        curvature = 0
        associate (form => condition%kernels%form, left => space%left, right => space%right)
            do way = -1, 1
                call move_on(model, way*step, space)
                call run_on_lanes(condition%kernels%matrix, lanes, space%moved, factors%inverse%numbers, space%of_matrix)
                do i = 1, size(form%row)
                    if (form%output(i) == 0) cycle
                    associate (entry => space%of_matrix%found(:, form%output(i)))
                        curvature = curvature + weight(way)*entry*(left(:, form%row(i))*right(:, form%column(i)))
                        rate(:, i) = rate(:, i) + way*entry/(2*step)
                    end associate
                end do
            end do
            space%turned = 0
            do i = 1, size(form%row)
                space%turned(:, form%row(i)) = space%turned(:, form%row(i)) + rate(:, i)*right(:, form%column(i))
            end do
            space%solved = space%turned
            call solve_poses(condition, state, factors, space%solved)
            bend = 0
            do i = 1, size(form%row)
                bend = bend + rate(:, i)*(left(:, form%row(i))*space%solved(:, form%column(i)))
            end do
            slope = sum(left*space%turned, 2)
        end associate
        curvature = curvature/step**2 - 2*bend + 2*slope**2/sigma
    end subroutine curvature_of_sigma

    !> Second derivative of a dyad's determinant along the way.
    subroutine curvature_of_determinant(model, step, space, curvature)
        type(model_type), intent(in) :: model
        type(step_type), intent(in) :: step
        type(singularity_space), intent(inout) :: space
        real(wp), intent(out) :: curvature(lanes)
        real(wp), dimension(lanes) :: determinant, product, lengths, part
        real(wp), parameter :: weight(-1:1) = [1, -2, 1]
        integer :: way

        part = step_on_way(model, space%going)
        curvature = 0
        do way = -1, 1
            call move_on(model, way*part, space)
            call see_dyad(model, step, space%moved, determinant, product, lengths)
            curvature = curvature + weight(way)*determinant
        end do
        curvature = curvature/part**2
    end subroutine curvature_of_determinant

    !> A step along the way that turns the fastest link a little. Slides may run as they do: equations are linear in them.
    function step_on_way(model, going) result(step)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: going
        real(wp) :: step(lanes), speed(lanes)
        integer :: o

        speed = 1/typical_length(model)
        do o = 1, model%n_orientation
            if (model%is_planar) then
                speed = max(speed, abs(going%plane%angular(:, level_velocity, o)))
            else
                speed = max(speed, sqrt(going%omega(o).dot.going%omega(o)))
            end if
        end do
        step = small_turn/speed
    end function step_on_way

    !> Rotations, places and slides a little further on the way, to second order.
    subroutine move_on(model, step, space)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: step(lanes)
        type(singularity_space), intent(inout) :: space
        real(wp) :: half_square(lanes)
        type(joint_view) :: view
        integer :: o, l, j, i

        half_square = 0.5_wp*step**2
        associate (moved => space%moved, going => space%going)
            if (model%is_planar) then
                do l = 0, model%n_link
                    moved%plane%position(l) = going%plane%position(l) + step*going%plane%linear(level_velocity, l) &
                                              + half_square*going%plane%linear(level_given, l)
                end do
                do o = 0, model%n_orientation
                    associate (r => going%plane%rotation(o), omega => going%plane%angular(:, level_velocity, o), &
                               alpha => going%plane%angular(:, level_given, o))
                        moved%plane%rotation(o) = rot2(1 - half_square*omega**2, step*omega + half_square*alpha)*r
                    end associate
                end do
            else
                do l = 0, model%n_link
                    moved%position(l) = going%position(l) + step*going%velocity(l) + half_square*going%acceleration(0, l)
                end do
                do o = 0, model%n_orientation
                    associate (r => going%rotation(o))
                        moved%rotation(o)%x = further(r%x, going%omega(o), going%alpha(0, o))
                        moved%rotation(o)%y = further(r%y, going%omega(o), going%alpha(0, o))
                        moved%rotation(o)%z = further(r%z, going%omega(o), going%alpha(0, o))
                    end associate
                end do
            end if
            do j = 1, model%n_joint
                do i = 1, n_slide(model%joint(j)%kind)
                    if (model%is_planar) then
                        moved%slide(:, i, j) = going%slide(:, i, j) + step*planar_joint_rate(model, going, j, level_velocity) &
                                               + half_square*planar_joint_rate(model, going, j, level_given)
                    else
                        call view_joint(model, moved, j, going%velocity, going%omega, view)
                        moved%slide(:, i, j) = view%slide.dot.marker_axis(view%frame(1), slide_axis(i, model%joint(j)%kind))
                    end if
                end do
            end do
        end associate

    contains

        function further(axis, omega, alpha)
            type(vec3), intent(in) :: axis, omega, alpha
            type(vec3) :: further

            further = axis + step*(omega.cross.axis) + half_square*((alpha.cross.axis) + (omega.cross.(omega.cross.axis)))
        end function further
    end subroutine move_on
end module linkdyn_singularity
