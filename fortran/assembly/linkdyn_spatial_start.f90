!> The assembly of a spatial mechanism at its start: which of its two ways each CSP group closes, and where the links of
!> groups closed by iteration are.
!>
!> Of a CSP group a `branch` written at the spherical joint decides, otherwise the nearer way (`linkdyn_start_distance`).
module linkdyn_spatial_start
    use linkdyn_kinematic_pass, only: run_step
    use linkdyn_kinematic_state, only: kinematic_state, prepare_kinematics
    use linkdyn_lane_count, only: lanes
    use linkdyn_model, only: model_type, step_type, step_csp, step_group, by_branch, by_start, by_nothing
    use linkdyn_laws, only: start_of_coordinate
    use linkdyn_planar_start, only: start_group
    use linkdyn_start_distance, only: start_distance, measure_distance, is_nearer, has_start
    use linkdyn_status, only: status_type
    implicit none (type, external)
    private
    public :: assemble_in_space

contains

    !> Fill `model%start_q`, `model%branch` and the groups' starts.
    !>
    !> **Errors**: `status_bad_input` for a group that cannot be closed at the start.
    subroutine assemble_in_space(model, status, like)
        type(model_type), intent(inout) :: model
        type(status_type), intent(inout) :: status
        type(model_type), intent(in), optional :: like     !! a model that stands as this one will
        type(kinematic_state) :: state
        integer :: i, k

        if (.not. status%is_ok() .or. model%is_planar) return
        model%start_q = [(start_of_coordinate(model%scene, k), k=1, model%n_q)]
        allocate (model%branch(model%n_branch))
        model%branch = 1
        allocate (model%chosen_by(model%n_branch), source=by_branch)
        if (.not. any(model%step%kind == step_csp .or. model%step%kind == step_group)) return
        do i = 1, size(model%group)
            model%group(i)%start = 0
        end do
        call prepare_kinematics(model, 0, state)
        state%q = spread(model%start_q, 1, lanes)
        do i = 1, size(model%step)
            associate (step => model%step(i))
                if (step%kind == step_csp) call choose_branch(model, step, state)
                if (step%kind == step_group) then
                    call start_group(model, step, state, status, like)
                else
                    call run_step(model, step, state)
                end if
            end associate
            if (.not. status%is_ok()) return
        end do
    end subroutine assemble_in_space

    !> The way in which a CSP group closes.
    subroutine choose_branch(model, step, state)
        type(model_type), intent(inout) :: model
        type(step_type), intent(in) :: step
        type(kinematic_state), intent(inout) :: state
        type(start_distance) :: distance(2)
        integer :: way

        associate (branch => model%branch(step%first))
            branch = model%scene%joint(step%joint(2))%branch
            if (branch == 0) then
                do way = 1, 2
                    state%branch(:, step%first) = 3 - 2*way
                    call run_step(model, step, state)
                    distance(way) = measure_distance(model, step%link(:2), step%joint(:3), state, .false.)
                end do
                branch = merge(-1, 1, is_nearer(distance(2), 1, distance(1)%given(1), distance(1)%others(1)))
                model%chosen_by(step%first) = merge(by_start, by_nothing, has_start(model, step%link(:2), step%joint(:3)))
            end if
            state%branch(:, step%first) = branch
        end associate
    end subroutine choose_branch
end module linkdyn_spatial_start
