!> How far the mechanism may move, to first order, before its equations become singular or its reach ends.
!>
!> With u and v the singular vectors of the smallest singular value, sigma = u^T A v of the scaled equations (see
!> `linkdyn_condition`), the distance is sigma over its gradient. The gradient needs no elimination: sigma changes with A alone, and A
!> with the links' rotations and slides, which move along the acceleration columns, the velocities for unit rates of the
!> coordinates. So no position beyond a dead point is ever asked for, however near it is.
!>
!> Where the links of a planar dyad come into line, the mechanism comes to the end of its reach. The equations may be regular
!> there, as those of an arm led by its tool are; so the determinant of each dyad's map has a distance of its own,
!> and the shortest counts.
!>
!> The distance is one of the coordinates, angles times a characteristic length.
module linkdyn_singularity
    use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan
    use linkdyn_condition, only: condition_type, condition_space, singular_vectors, is_posed
    use linkdyn_closed_forms, only: see_dyad
    use linkdyn_force_map, only: typical_length
    use linkdyn_joint_rates, only: slide_column
    use linkdyn_joint_table, only: most_slides, n_slide
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state, prepare_kinematics
    use linkdyn_lane_count, only: lanes
    use linkdyn_lane_programs, only: lane_space, run_on_lanes, free_lane_space
    use linkdyn_led_mechanism, only: evaluate_kinematics
    use linkdyn_model, only: model_type, step_type, step_pose, step_joint, step_ups, is_dyad, attitude_angles
    use linkdyn_pose, only: rpy_rotation, rotate_rpy
    use linkdyn_vec2, only: rot2, operator(+), operator(*)
    use linkdyn_vec3, only: vec3, operator(+), operator(*), operator(.cross.), operator(.dot.)
    implicit none (type, external)
    private
    public :: singularity_space, prepare_singularity, find_singularity_distance

    !> [rad] of a central difference: its error of second order is as small as rounding
    real(wp), parameter :: largest_turn = epsilon(1.0_wp)**(1.0_wp/3)

    !> Scratch of one thread.
    type :: singularity_space
        type(kinematic_state) :: moved            !! the mechanism a little moved
        type(lane_space) :: of_matrix             !! its equations
        real(wp), allocatable :: left(:, :), right(:, :)    !! singular vectors, scaled back to the equations' own rows and columns
        real(wp), allocatable :: gradient(:, :)   !! of sigma (lane, n_q) [1/m], angles times the length
        real(wp), allocatable :: slide(:, :, :)   !! rates of the slides for a unit rate of a coordinate (lane, slide, n_joint)
        real(wp), allocatable :: unit(:)          !! what a unit of each coordinate counts (n_q) [m]
        logical :: may_fold = .false.             !! a coordinate may come to its limit: loops are closed
    contains
        procedure :: free => free_singularity
    end type singularity_space

contains

    !> Make room for one thread.
    subroutine prepare_singularity(model, condition, space)
        type(model_type), intent(in) :: model
        type(condition_type), intent(in) :: condition
        type(singularity_space), intent(out) :: space

        call prepare_kinematics(model, 0, space%moved)
        allocate (space%left(lanes, condition%n), space%right(lanes, condition%n))
        allocate (space%gradient(lanes, model%n_q), space%slide(lanes, most_slides, model%n_joint))
        space%unit = merge(1.0_wp, typical_length(model), model%scene%coordinate%unit == "m")
        space%may_fold = any(model%step%kind /= step_pose .and. model%step%kind /= step_joint .and. model%step%kind /= step_ups) &
                         .and. (model%is_planar .or. all(model%step%kind /= step_pose))
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
        real(wp) :: sigma(lanes), steepness(lanes)
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
        distance = abs(sigma)/steepness
        if (space%may_fold) call shorten_at_folds(model, state, sigma, steepness, space, distance)
        if (model%n_dyad > 0) call look_at_reach(model, state, space, distance)
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
        real(wp), dimension(lanes) :: determinant, product, lengths, steepness, way
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
            way = abs(determinant)/steepness
            call shorten_at_folds(model, state, determinant, steepness, space, way)
            where (way < distance) distance = way
        end do
    end subroutine look_at_reach

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

    !> Where a coordinate comes to its own limit, the links' velocities for a unit rate of it grow as 1/sqrt(distance) and sigma
    !> goes as sqrt(distance): sigma over its slope is then twice the distance. With the mechanism moving towards
    !> the singularity at unit rate, w its angular velocities and a their derivatives, c = distance*(a.w)/(w.w) is 1 there and
    !> nearly 0 where the velocities hardly change; 1 - c/2 of the distance is right in both.
    subroutine shorten_at_folds(model, state, sigma, steepness, space, distance)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        real(wp), intent(in) :: sigma(lanes), steepness(lanes)
        type(singularity_space), intent(inout) :: space
        real(wp), intent(inout) :: distance(lanes)
        real(wp), dimension(lanes) :: square, growth, fold
        integer :: k, o

        associate (moved => space%moved)
            moved%q = state%q
            moved%qdd = 0
            do k = 1, model%n_q
                moved%qd(:, k) = -sign(1.0_wp, sigma)*space%gradient(:, k)/(space%unit(k)*steepness)
            end do
            if (model%n_branch > 0) moved%branch = state%branch
            if (size(model%group) > 0) then
                moved%group%start_place = state%group%place
                moved%group%start_q = state%q
            end if
            call evaluate_kinematics(model, moved)
            square = 0
            growth = 0
            do o = 1, model%n_orientation
                if (model%is_planar) then
                    square = square + moved%plane%angular(:, -1, o)**2
                    growth = growth + moved%plane%angular(:, -1, o)*moved%plane%angular(:, 0, o)
                else
                    square = square + (moved%omega(o).dot.moved%omega(o))
                    growth = growth + (moved%omega(o).dot.moved%alpha(0, o))
                end if
            end do
        end associate
        fold = distance*growth/square
        distance = distance*(1 - 0.5_wp*merge(min(fold, 1.0_wp), 0.0_wp, fold > 0))
    end subroutine shorten_at_folds
end module linkdyn_singularity
