!> The kinematic program: positions, velocities and acceleration columns of all links, step by step.
!>
!> One pass serves every analysis. Column 0 always carries the motion prescribed by q, qd, qdd; the further columns
!> are computed only if the state was prepared for them.
module linkdyn_kinematic_pass
    use linkdyn_led_coordinates, only: has_lost_turns
    use linkdyn_group_closing, only: move_loop
    use linkdyn_joint_table, only: n_slide
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state, keep_slide, velocities_only
    use linkdyn_lane_count, only: lanes
    use linkdyn_steps_on_lanes, only: kernel_use, begin_use, end_use, run_kernel, set_places, set_rates
    use linkdyn_model, only: model_type, step_type, step_pose, step_csp, step_group, is_dyad, link_freedom
    use linkdyn_newton_group, only: close_group
    use linkdyn_planar_motion, only: level_velocity, level_given
    use linkdyn_status, only: sample_unreachable, sample_singular, sample_not_converged, sample_branch_lost
    use linkdyn_step_kernels, only: of_places, of_velocities, of_accelerations, of_way
    use linkdyn_vec3, only: operator(.unrotate.)
    implicit none (type, external)
    private
    public :: run_program, run_step, clear_flags

contains

    !> Run the program on the block whose coordinates are in the state. Closed forms are on the branches of the state;
    !> groups are closed by iteration from where their links are.
    subroutine run_program(model, state)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(inout) :: state
        logical :: is_sure                               !! branches and iterations have no part in it so far
        integer :: i

        call clear_flags(state)
        state%has_margins = state%n_column == velocities_only
        is_sure = .true.
        do i = 1, size(model%step)
            is_sure = is_sure .and. model%step(i)%kind /= step_group
            call run_step(model, model%step(i), state)
            if (is_sure) state%out_of_reach = state%unreachable
            is_sure = is_sure .and. .not. model%step(i)%has_margin
        end do
        call flag_lost(state)
    end subroutine run_program

    !> Whatever went wrong in an earlier block is forgotten.
    pure subroutine clear_flags(state)
        type(kinematic_state), intent(inout) :: state

        state%unreachable = .false.
        state%out_of_reach = .false.
        state%singular = .false.
        state%not_converged = .false.
        state%branch_lost = .false.
        state%uncertainty = 0
        if (allocated(state%group%contraction)) state%group%contraction = 0
    end subroutine clear_flags

    !> Lanes to which their assembly could not be followed.
    pure subroutine flag_lost(state)
        type(kinematic_state), intent(inout) :: state

        state%unreachable = state%unreachable .or. state%way_status == sample_unreachable
        state%singular = state%singular .or. state%way_status == sample_singular
        state%not_converged = state%not_converged .or. state%way_status == sample_not_converged
        state%branch_lost = state%branch_lost .or. state%way_status == sample_branch_lost
    end subroutine flag_lost

    !> One step of the program; the steps before it have been run.
    subroutine run_step(model, step, state)
        type(model_type), intent(in) :: model
        type(step_type), intent(in) :: step
        type(kinematic_state), intent(inout) :: state
        integer :: k

        if (step%kind == step_group) then
            call close_group(model, step%first, state)
        else
            call run_closed_form(model, step, state)
        end if
        associate (part => model%part(step%number))
            do k = 1, size(part%given)
                ! what gears give from angles whose turns may be others
                if (part%given(k) > model%n_q) &
                    state%branch_lost = state%branch_lost .or. has_lost_turns(model, state, part%given(k))
            end do
            if (model%is_planar) return
            do k = 1, size(part%link)
                call turn_into_link(model, part%link(k), state)
            end do
        end associate
    end subroutine run_step

    !> A step whose links formulas place.
    subroutine run_closed_form(model, step, state)
        type(model_type), intent(in) :: model
        type(step_type), intent(in) :: step
        type(kinematic_state), intent(inout) :: state
        type(kernel_use) :: use
        real(wp), allocatable :: found(:, :)

        call begin_use(model, step%number, state, use)
        if (is_dyad(step%kind) .and. state%n_column == velocities_only) then
            call run_kernel(model, use, of_way, state, found, level_velocity)
            call take_way(model, step, use, found, state)
        else
            call run_kernel(model, use, of_places, state, found)
            call take_places(model, use, found, state)
            if (step%kind == step_csp) call close_loop(model, use, state)
            if (step%kind /= step_csp) call move_by_formulas(model, step, use, state)
        end if
        call end_use(use)
    end subroutine run_closed_form

    !> All levels, the given acceleration last, which needs the velocities.
    subroutine move_by_formulas(model, step, use, state)
        type(model_type), intent(in) :: model
        type(step_type), intent(in) :: step
        type(kernel_use), intent(in) :: use
        type(kinematic_state), intent(inout) :: state
        real(wp), allocatable :: found(:, :)
        integer :: level

        associate (part => model%part(step%number))
            call run_kernel(model, use, of_velocities, state, found, level_velocity)
            call set_rates(model, part, level_velocity, found, state)
            do level = 1, state%n_column
                call run_kernel(model, use, of_velocities, state, found, level)
                call set_rates(model, part, level, found, state)
            end do
            if (state%n_column >= 0) then
                call run_kernel(model, use, of_accelerations, state, found, level_given)
                call set_rates(model, part, level_given, found, state)
            end if
            if (step%kind == step_pose) call set_pose_columns(model, step, state)
            if (is_dyad(step%kind) .or. step%has_margin) &
                state%singular = state%singular .or. .not. (is_determined(found) .or. state%unreachable)
        end associate
    end subroutine move_by_formulas

    !> Where the links are, how far joints are slid, and which lanes cannot close.
    subroutine take_places(model, use, found, state)
        type(model_type), intent(in) :: model
        type(kernel_use), intent(in) :: use
        real(wp), intent(in) :: found(:, :)              !! (lane, number)
        type(kinematic_state), intent(inout) :: state
        real(wp) :: total(lanes)
        integer :: i, k, n

        associate (part => model%part(use%step), kernels => use%kernels)
            n = size(found, 2) - kernels%n_slide - kernels%n_closing
            call set_places(model, part, found(:, :n), state)
            total = 0
            do i = 1, n
                total = total + abs(found(:, i))
            end do
            state%unreachable = state%unreachable .or. .not. total <= huge(1.0_wp)
            do i = 1, size(part%joint)
                do k = 1, n_slide(model%joint(part%joint(i))%kind)
                    n = n + 1
                    call keep_slide(model, part%joint(i), k, found(:, n), state)
                end do
            end do
            do i = n + 1, size(found, 2)
                state%unreachable = state%unreachable .or. found(:, i) < 0
            end do
        end associate
    end subroutine take_places

    !> A dyad on a way: where its links are, how they move, its margin.
    subroutine take_way(model, step, use, found, state)
        type(model_type), intent(in) :: model
        type(step_type), intent(in) :: step
        type(kernel_use), intent(in) :: use
        real(wp), intent(in) :: found(:, :)              !! (lane, number)
        type(kinematic_state), intent(inout) :: state
        integer :: n, n_place

        n = size(found, 2) - 2
        n_place = n - step%n_link*link_freedom(model)
        call take_places(model, use, found(:, :n_place), state)
        call set_rates(model, model%part(use%step), level_velocity, found(:, n_place + 1:n), state)
        if (.not. step%has_margin) return
        state%margin(:, step%first) = found(:, n + 1)
        state%drift(:, step%first) = found(:, n + 2)
    end subroutine take_way

    !> At a dead point itself no motion is.
    pure function is_determined(found)
        real(wp), intent(in) :: found(:, :)              !! (lane, number)
        logical :: is_determined(lanes)
        integer :: k

        is_determined = .true.
        do k = 1, size(found, 2)
            is_determined = is_determined .and. abs(found(:, k)) <= huge(1.0_wp)
        end do
    end function is_determined

    !> How the links of a CSP group move. At a dead point itself that is not determined.
    subroutine close_loop(model, use, state)
        type(model_type), intent(in) :: model
        type(kernel_use), intent(in) :: use
        type(kinematic_state), intent(inout) :: state
        real(wp) :: matrix(lanes, (2*link_freedom(model))**2)
        real(wp) :: right(lanes, 2*link_freedom(model), 1 + max(0, state%n_column))
        real(wp) :: gap(lanes, 2*link_freedom(model), level_velocity:level_given)
        logical :: is_singular(lanes)

        call move_loop(model, use, state%n_column, state, matrix, right, gap, is_singular)
        state%singular = state%singular .or. (is_singular .and. .not. state%unreachable)
    end subroutine close_loop

    !> Columns of a pose are those of the velocity and the angular velocity, not of angles' rates.
    subroutine set_pose_columns(model, step, state)
        type(model_type), intent(in) :: model
        type(step_type), intent(in) :: step
        type(kinematic_state), intent(inout) :: state
        real(wp) :: rate(lanes, link_freedom(model))
        integer :: k

        if (model%is_planar) return
        do k = 1, merge(6, 0, state%n_column > 0)
            rate = 0
            rate(:, k) = 1
            call set_rates(model, model%part(step%number), step%coordinate(k), rate, state)
        end do
    end subroutine set_pose_columns

    !> Angular rates and the origin's acceleration in link axes, from those in world axes.
    subroutine turn_into_link(model, link, state)
        type(model_type), intent(in) :: model
        integer, intent(in) :: link
        type(kinematic_state), intent(inout) :: state
        integer :: o, k

        o = model%link(link)%orientation
        state%omega_body(o) = state%rotation(o).unrotate.state%omega(o)
        do k = 0, state%n_column
            state%alpha_body(k, o) = state%rotation(o).unrotate.state%alpha(k, o)
            state%acceleration_body(k, link) = state%rotation(o).unrotate.state%acceleration(k, link)
        end do
    end subroutine turn_into_link
end module linkdyn_kinematic_pass
