!> What a group closed by iteration asks of its links, on a block of lanes: its kernels, fed with where links are and how they move.
!>
!> The matrix of the constraints serves the errors of places, velocities, and accelerations; it is solved here, with pivots for each
!> lane.
module linkdyn_group_closing
    use linkdyn_joint_table, only: n_slide
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state, keep_slide
    use linkdyn_lane_count, only: lanes
    use linkdyn_steps_on_lanes, only: kernel_use, run_kernel, set_rates
    use linkdyn_model, only: model_type, group_type, orientation_of
    use linkdyn_patterned_elimination, only: eliminate_by_pattern
    use linkdyn_planar_motion, only: level_velocity, level_given
    use linkdyn_quaternion, only: rotation_of_quaternion
    use linkdyn_step_kernels, only: of_errors, of_velocities, of_accelerations, of_looks
    use linkdyn_vec2, only: vec2, rot2_by_angle
    use linkdyn_vec3, only: vec3
    implicit none (type, external)
    private
    public :: put_links, assemble_errors, assemble_ahead, move_loop, look_at_joints, angle_off_threads

contains

    !> The iterate as rotations and positions.
    subroutine put_links(model, group, state)
        type(model_type), intent(in) :: model
        type(group_type), intent(in) :: group
        type(kinematic_state), intent(inout) :: state
        integer :: i

        do i = 1, size(group%link)
            associate (l => group%link(i), o => orientation_of(model, group%link(i)), place => state%group%place)
                if (model%is_planar) then
                    state%plane%position(l) = vec2(place(:, 1, l), place(:, 2, l))
                    if (group%turns(i)) state%plane%rotation(o) = rot2_by_angle(place(:, 3, l))
                else
                    state%position(l) = vec3(place(:, 1, l), place(:, 2, l), place(:, 3, l))
                    if (group%turns(i)) state%rotation(o) = rotation_of_quaternion(place(:, 4:7, l))
                end if
            end associate
        end do
    end subroutine put_links

    ! ---------------------------------------------------------------- errors and their matrix

    !> Errors where the links stand, and how the links make them.
    subroutine assemble_errors(model, use, state, matrix, error)
        type(model_type), intent(in) :: model
        type(kernel_use), intent(in) :: use
        type(kinematic_state), intent(in) :: state
        real(wp), intent(inout) :: matrix(lanes, *)      !! as `elimination_pattern` stores it (lane, slot)
        real(wp), intent(out) :: error(:, :)             !! (lane, row)
        real(wp), allocatable :: found(:, :)

        call run_kernel(model, use, of_errors, state, found)
        call fill_matrix(use, found, matrix)
        error = found(:, size(found, 2) - size(error, 2) + 1:)
    end subroutine assemble_errors

    !> The matrix a little further on, where the links' velocities lead.
    subroutine assemble_ahead(model, use, step, state, matrix)
        type(model_type), intent(in) :: model
        type(kernel_use), intent(in) :: use
        real(wp), intent(in) :: step(lanes)
        type(kinematic_state), intent(in) :: state
        real(wp), intent(inout) :: matrix(lanes, *)      !! (lane, slot)
        real(wp), allocatable :: found(:, :)

        call run_kernel(model, use, of_errors, state, found, ahead=step)
        call fill_matrix(use, found, matrix)
    end subroutine assemble_ahead

    pure subroutine fill_matrix(use, found, matrix)
        type(kernel_use), intent(in) :: use
        real(wp), intent(in) :: found(:, :)
        real(wp), intent(inout) :: matrix(lanes, *)      !! (lane, slot)
        integer :: k, slot

        associate (form => use%kernels%form, pattern => use%kernels%pattern)
            matrix(:, :pattern%n_slot) = 0
            do k = 1, size(form%row)
                slot = pattern%slot(form%column(k), form%row(k))
                if (form%output(k) > 0) then
                    matrix(:, slot) = found(:, form%output(k))
                else
                    matrix(:, slot) = form%constant(k)
                end if
            end do
        end associate
    end subroutine fill_matrix

    ! ---------------------------------------------------------------- velocities and accelerations

    !> All levels but the given acceleration at once, then that one, which needs the velocities. On a way there are velocities only.
    subroutine move_loop(model, use, n_column, state, matrix, right, gap, is_singular)
        type(model_type), intent(in) :: model
        type(kernel_use), intent(in) :: use
        integer, intent(in) :: n_column                  !! `velocities_only`, or columns
        type(kinematic_state), intent(inout) :: state
        real(wp), intent(inout) :: matrix(lanes, *)      !! scratch (lane, slot)
        real(wp), intent(out) :: right(:, :, :)          !! likewise (lane, row, 1 + columns)
        real(wp), intent(out) :: gap(:, :, level_velocity:)    !! right-hand sides of both levels (lane, row, level)
        logical, intent(out) :: is_singular(lanes)
        real(wp), allocatable :: entry(:, :), found(:, :)
        real(wp) :: determinant(lanes)
        integer :: n_right, level

        n_right = 1 + max(n_column, 0)
        call run_kernel(model, use, of_errors, state, entry)
        call run_kernel(model, use, of_velocities, state, found, level_velocity)
        right(:, :, 1) = found
        gap(:, :, level_velocity) = found
        do level = 1, n_column
            call run_kernel(model, use, of_velocities, state, found, level)
            right(:, :, level + 1) = found
        end do
        call fill_matrix(use, entry, matrix)
        call eliminate_by_pattern(use%kernels%pattern, n_right, matrix, right(:, :, :n_right), is_singular, determinant)
        associate (part => model%part(use%step))
            call set_rates(model, part, level_velocity, right(:, :, 1), state)
            do level = 1, n_column
                call set_rates(model, part, level, right(:, :, level + 1), state)
            end do
            if (n_column < 0) return
            call run_kernel(model, use, of_accelerations, state, found, level_given)
            right(:, :, 1) = found
            gap(:, :, level_given) = found
            call fill_matrix(use, entry, matrix)
            call eliminate_by_pattern(use%kernels%pattern, 1, matrix, right(:, :, :1), is_singular, determinant)
            call set_rates(model, part, level_given, right(:, :, 1), state)
        end associate
    end subroutine move_loop

    ! ---------------------------------------------------------------- joints

    !> How far joints are slid. An axis turned end for end satisfies the equations but is no assembly of the
    !> joint.
    subroutine look_at_joints(model, use, state)
        type(model_type), intent(in) :: model
        type(kernel_use), intent(in) :: use
        type(kinematic_state), intent(inout) :: state
        real(wp), allocatable :: found(:, :)
        integer :: i, k, n

        call run_kernel(model, use, of_looks, state, found)
        n = 0
        associate (joint => model%part(use%step)%joint)
            do i = 1, size(joint)
                do k = 1, n_slide(model%joint(joint(i))%kind)
                    n = n + 1
                    call keep_slide(model, joint(i), k, found(:, n), state)
                end do
            end do
            do i = n + 1, n + use%kernels%n_facing
                state%not_converged = state%not_converged .or. found(:, i) < 0
            end do
        end associate
    end subroutine look_at_joints

    !> Angle by which the nut that is farthest off its thread is off it, where the iteration stands.
    function angle_off_threads(model, use, state) result(angle)
        type(model_type), intent(in) :: model
        type(kernel_use), intent(in) :: use
        type(kinematic_state), intent(in) :: state
        real(wp) :: angle(lanes)
        real(wp), allocatable :: found(:, :)

        call run_kernel(model, use, of_looks, state, found)
        angle = maxval(abs(found(:, size(found, 2) - use%kernels%n_thread + 1:)), dim=2)
    end function angle_off_threads
end module linkdyn_group_closing
