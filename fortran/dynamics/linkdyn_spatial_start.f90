!> The assembly of a spatial mechanism at its start: which of its two ways each CSP group closes, and where the links of
!> groups closed by iteration are.
!>
!> Of a CSP group a `branch` written at the spherical joint decides. Otherwise it is the way nearest to the starting
!> positions that the scene gives for the group's links and slides; if it gives none, the farther meeting along the slide.
module linkdyn_spatial_start
    use linkdyn_group_start, only: find_group_start
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_pass, only: run_step
    use linkdyn_kinematic_state, only: kinematic_state, prepare_kinematics
    use linkdyn_lane_count, only: lanes
    use linkdyn_model, only: model_type, step_type, step_csp, step_group
    use linkdyn_planar_start, only: start_of_coordinate, keep_group
    use linkdyn_status, only: status_type
    use linkdyn_vec3, only: lane_of
    implicit none (type, external)
    private
    public :: assemble_in_space

contains

    !> Fill `model%start_q`, `model%branch` and the groups' starts.
    !>
    !> **Errors**: `status_bad_input` for a group that cannot be closed at the start.
    subroutine assemble_in_space(model, status)
        type(model_type), intent(inout) :: model
        type(status_type), intent(inout) :: status
        type(kinematic_state) :: state
        integer :: i, k

        if (.not. status%is_ok() .or. model%is_planar) return
        model%start_q = [(start_of_coordinate(model, k), k=1, model%n_q)]
        allocate (model%branch(model%n_branch))
        model%branch = 1
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
                    call find_group_start(model, step, state)
                    call keep_group(model, model%group(step%first), state, status)
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
        real(wp) :: distance(2)
        integer :: way

        associate (branch => model%branch(step%first))
            branch = model%scene%joint(step%joint(2))%branch
            if (branch == 0) then
                do way = 1, 2
                    state%branch(:, step%first) = 3 - 2*way
                    call run_step(model, step, state)
                    distance(way) = distance_to_start(model, step, state)
                end do
                branch = merge(-1, 1, distance(2) < distance(1))
            end if
            state%branch(:, step%first) = branch
        end associate
    end subroutine choose_branch

    !> How far lane 1 is from the starting positions given; zero if there are none.
    real(wp) function distance_to_start(model, step, state) result(distance)
        type(model_type), intent(in) :: model
        type(step_type), intent(in) :: step
        type(kinematic_state), intent(in) :: state
        integer :: i

        distance = 0
        do i = 1, 2
            associate (spec => model%scene%link(step%link(i)))
                if (spec%has_start) distance = distance + norm2(lane_of(state%position(step%link(i)), 1) - spec%start(:3))
            end associate
        end do
        ! The slide is the second variable of a cylindrical joint, the only one of a prismatic joint.
        do i = 1, 3, 2
            associate (spec => model%scene%joint(step%joint(i)))
                if (spec%has_start) distance = distance + abs(state%slide(1, step%joint(i)) - spec%start(merge(2, 1, i == 1)))
            end associate
        end do
    end function distance_to_start
end module linkdyn_spatial_start
