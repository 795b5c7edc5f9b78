!> More drives than freedoms: how they share the work.
!>
!> Virtual work gives one equation per coordinate, J^T u = tau, with the actuators' Jacobian J. Of all driving forces u that satisfy
!> it those with the least sum of ((u - p)/share)^2 are taken, p the preload: u = p + W J (J^T W J)^-1 (tau - J^T p), W =
!> diag(share^2), with one step of refinement, which gives back the digits that the product took. So to the forces without preload
!> comes that part of p which moves nothing.
!>
!> **Source**: J. Hollerbach, K. Suh, IEEE J. Robotics Autom. 3 (1987) 308; for parallel mechanisms A. Mueller, Redundant
!> actuation of parallel manipulators, in: Parallel Manipulators (2008).
module linkdyn_shared_drives
    use linkdyn_gauss_jordan, only: solve_gauss_jordan
    use linkdyn_joint_rates, only: actuator_columns, normal_matrix, work_columns
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state
    use linkdyn_lane_count, only: lanes
    use linkdyn_model, only: model_type
    implicit none (type, external)
    private
    public :: share_drives

contains

    !> Driving forces of the motion; known forces are applied already.
    subroutine share_drives(model, state, load, driving_force, is_singular)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        real(wp), intent(in) :: load(:, :, :)              !! (lane, 6, n_load)
        real(wp), intent(out) :: driving_force(:, :)       !! (lane, n_actuator) [N, N m]
        logical, intent(out) :: is_singular(lanes)         !! some coordinate is led by no drive here
        real(wp) :: jacobian(lanes, model%n_actuator, model%n_q), normal(lanes, model%n_q, model%n_q)
        real(wp) :: factors(lanes, model%n_q, model%n_q), tau(lanes, model%n_q), left(lanes, model%n_q, 1), growth(lanes)
        integer :: i, k, pass

        call actuator_columns(model, state, jacobian)
        call work_columns(model, state, load, tau)
        normal = normal_matrix(model, jacobian)
        driving_force = spread(model%scene%actuator%preload, 1, lanes)
        do pass = 1, 2
            do k = 1, model%n_q
                left(:, k, 1) = tau(:, k)
                do i = 1, model%n_actuator
                    left(:, k, 1) = left(:, k, 1) - jacobian(:, i, k)*driving_force(:, i)
                end do
            end do
            factors = normal
            call solve_gauss_jordan(model%n_q, 1, factors, left, growth, is_singular)
            do i = 1, model%n_actuator
                do k = 1, model%n_q
                    driving_force(:, i) = driving_force(:, i) + model%scene%actuator(i)%share**2*jacobian(:, i, k)*left(:, k, 1)
                end do
            end do
        end do
    end subroutine share_drives
end module linkdyn_shared_drives
