!> Preloads of drives: do they strain anything?
!>
!> Drives hold against each other along forces u that move nothing, J^T u = 0. What of a drive's own direction e lies there is
!> 1 - e^T W J (J^T W J)^-1 J^T e: where that is zero no other drive can hold against it.
module linkdyn_preloads
    use linkdyn_gauss_jordan, only: solve_gauss_jordan
    use linkdyn_joint_rates, only: actuator_columns, normal_matrix
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state, prepare_kinematics
    use linkdyn_lane_count, only: lanes
    use linkdyn_led_mechanism, only: evaluate_kinematics
    use linkdyn_model, only: model_type
    use linkdyn_scene, only: share_refused
    use linkdyn_status, only: status_type, fail, status_bad_input
    use linkdyn_text, only: quoted
    implicit none (type, external)
    private
    public :: refuse_idle_preloads

    real(wp), parameter :: idle = 1.0e-9_wp              !! part of a drive's direction that moves nothing

contains

    !> A preload that no other drive can hold against, at the start and near it.
    subroutine refuse_idle_preloads(model, status)
        type(model_type), intent(in) :: model
        type(status_type), intent(inout) :: status
        real(wp) :: part(model%n_actuator)
        integer :: i

        if (.not. status%is_ok() .or. all(model%scene%actuator%preload == 0)) return
        part = 0
        if (model%n_actuator > model%n_q .and. model%scene%redundancy /= share_refused) call find_parts(model, part)
        do i = 1, model%n_actuator
            if (model%scene%actuator(i)%preload == 0 .or. part(i) > idle .or. .not. status%is_ok()) cycle
            call fail(status, status_bad_input, "actuator "//quoted(model%scene%actuator(i)%name) &
                      //": its 'preload' has no effect, as no other drive can hold against it (expected more drives than " &
                      //"coordinates, among those that it shares the work with)")
        end do
    end subroutine refuse_idle_preloads

    !> What of each drive's direction moves nothing, at most.
    subroutine find_parts(model, part)
        type(model_type), intent(in) :: model
        real(wp), intent(out) :: part(:)
        type(kinematic_state) :: state
        real(wp) :: jacobian(lanes, model%n_actuator, model%n_q), normal(lanes, model%n_q, model%n_q)
        real(wp) :: left(lanes, model%n_q, model%n_actuator), growth(lanes), own(lanes)
        logical :: is_singular(lanes)
        integer :: i, k, lane

        call prepare_kinematics(model, model%n_q, state)
        do k = 1, model%n_q
            state%q(:, k) = [(model%start_q(k) + (lane - 1)*model%stride(k)/(lanes*sqrt(real(k, wp))), lane=1, lanes)]
        end do
        call evaluate_kinematics(model, state)
        call actuator_columns(model, state, jacobian)
        normal = normal_matrix(model, jacobian)
        do k = 1, model%n_q
            left(:, k, :) = jacobian(:, :, k)
        end do
        call solve_gauss_jordan(model%n_q, model%n_actuator, normal, left, growth, is_singular)
        part = 0
        do i = 1, model%n_actuator
            own = 1
            do k = 1, model%n_q
                own = own - model%scene%actuator(i)%share*jacobian(:, i, k)*left(:, k, i)
            end do
            do lane = 1, lanes
                if (state%unreachable(lane) .or. state%not_converged(lane) .or. state%singular(lane) .or. is_singular(lane)) cycle
                part(i) = max(part(i), own(lane))
            end do
        end do
    end subroutine find_parts
end module linkdyn_preloads
