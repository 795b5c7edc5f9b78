!> Inverse dynamics of a batch: motion given; driving forces, joint reactions and joint motion out.
!>
!> Samples are independent. They are taken in blocks of `lanes`, blocks are shared out to threads, and a block's
!> arithmetic does not depend on which thread runs it, so the results do not either. A sample that fails is NaN.
module linkdyn_inverse
    use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan
    use linkdyn_equations, only: equations_type, equation_workspace, build_equations, prepare_workspace, solve_block, &
        solver_gauss_jordan, solver_lapack, solver_elimination, solver_reduced, solver_name, choose_solver
    use linkdyn_joint_rates, only: measure_joints, power_imbalance
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_model, only: model_type
    use linkdyn_reactions, only: collect_reactions
    use linkdyn_status, only: status_type, sample_ok
    use linkdyn_vec3, only: lane_of, mat3_lane
    implicit none (type, external)
    private
    public :: inverse_options, inverse_results, inverse_solver, prepare_inverse, run_inverse, run_prepared
    public :: solver_gauss_jordan, solver_lapack, solver_elimination, solver_reduced, solver_name, choose_solver

    type :: inverse_options
        integer :: solver = solver_elimination
        integer :: threads = 1
    end type inverse_options

    !> Where results go; what is not associated is not computed.
    type :: inverse_results
        real(wp), pointer :: driving_force(:, :) => null()      !! (n_actuator, n) [N, N m]
        real(wp), pointer :: reaction(:, :, :) => null()        !! (n_component, n_joint, n) world axes [N, N m]
        real(wp), pointer :: joint_variable(:, :) => null()     !! (n_variable, n) [m, rad]
        real(wp), pointer :: joint_rate(:, :) => null()         !! (n_variable, n)
        integer, pointer :: status(:) => null()                 !! (n) one of `sample_*`
        real(wp), pointer :: rcond(:) => null()                 !! (n) NaN where the solver has none
        real(wp), pointer :: error(:) => null()                 !! (n) NaN where the solver has none
        real(wp), pointer :: growth(:) => null()                !! (n) reciprocal pivot growth; NaN but for gauss-jordan
        real(wp), pointer :: power_imbalance(:) => null()       !! (n)
        real(wp), pointer :: position(:, :, :) => null()        !! (3, n_link, n) origins [m]
        real(wp), pointer :: rotation(:, :, :, :) => null()     !! (3, 3, n_link, n) columns: the link's axes
        integer :: n_fallback = 0                               !! samples that the elimination handed to the dense solver
    end type inverse_results

    !> Equations planned once for many batches of the same kind.
    type :: inverse_solver
        type(equations_type) :: equations
        integer :: threads = 1
    end type inverse_solver

contains

    !> Plan the equations for the results wanted.
    subroutine prepare_inverse(model, options, wants_reactions, solver, status)
        type(model_type), intent(in) :: model
        type(inverse_options), intent(in) :: options
        logical, intent(in) :: wants_reactions
        type(inverse_solver), intent(out) :: solver
        type(status_type), intent(inout) :: status

        solver%threads = max(1, options%threads)
        call build_equations(model, options%solver, wants_reactions, solver%equations, status)
    end subroutine prepare_inverse

    !> Plan and run one batch.
    !>
    !> **Errors**: `status_bad_input` if the number of actuators does not fit or the solver cannot give what is wanted.
    subroutine run_inverse(model, options, q, qd, qdd, load, results, status)
        type(model_type), intent(in) :: model
        type(inverse_options), intent(in) :: options
        real(wp), intent(in) :: q(:, :), qd(:, :), qdd(:, :)    !! (n_q, n)
        real(wp), intent(in) :: load(:, :, :)                   !! (6, n_load, n)
        type(inverse_results), intent(inout) :: results
        type(status_type), intent(out) :: status
        type(inverse_solver) :: solver

        call prepare_inverse(model, options, associated(results%reaction), solver, status)
        if (.not. status%is_ok()) return
        call run_prepared(model, solver, q, qd, qdd, load, results)
    end subroutine run_inverse

    !> Run one batch with equations planned before.
    subroutine run_prepared(model, solver, q, qd, qdd, load, results)
        type(model_type), intent(in) :: model
        type(inverse_solver), intent(in) :: solver
        real(wp), intent(in) :: q(:, :), qd(:, :), qdd(:, :)    !! (n_q, n)
        real(wp), intent(in) :: load(:, :, :)                   !! (6, n_load, n)
        type(inverse_results), intent(inout) :: results
        type(equation_workspace) :: workspace
        real(wp), allocatable :: reaction(:, :, :), variable(:, :), rate(:, :)
        real(wp) :: imbalance(lanes)
        integer :: n, n_block, block, n_fallback
        logical :: wants_rates

        n = size(q, 2)
        n_block = (n + lanes - 1)/lanes
        wants_rates = associated(results%joint_variable) .or. associated(results%joint_rate)
        n_fallback = 0

        !$omp parallel num_threads(solver%threads) default(shared) private(workspace, reaction, variable, rate, imbalance)
        call prepare_workspace(model, solver%equations, workspace)
        workspace%state%world_rates = wants_rates .or. associated(results%power_imbalance) &
                                      .or. solver%equations%solver == solver_reduced
        allocate (reaction(lanes, 6, model%n_joint), variable(lanes, model%n_variable), rate(lanes, model%n_variable))
        !$omp do schedule(static) reduction(+:n_fallback)
        do block = 1, n_block
            call gather(block, workspace)
            workspace%n_fallback = 0
            call solve_block(model, solver%equations, workspace)
            n_fallback = n_fallback + workspace%n_fallback
            if (associated(results%reaction)) &
                call collect_reactions(model, solver%equations%formulation, workspace%state, workspace%solution, reaction)
            if (wants_rates) call measure_joints(model, workspace%state, variable, rate)
            if (associated(results%power_imbalance)) &
                call power_imbalance(model, workspace%state, workspace%load, workspace%driving_force, imbalance)
            call scatter(block, workspace, reaction, variable, rate, imbalance)
        end do
        !$omp end do
        call workspace%free()
        !$omp end parallel
        results%n_fallback = n_fallback

    contains

        !> Samples into lanes; lanes beyond the last sample repeat it.
        subroutine gather(block, workspace)
            integer, intent(in) :: block
            type(equation_workspace), intent(inout) :: workspace
            integer :: lane, sample

            do lane = 1, lanes
                sample = min((block - 1)*lanes + lane, n)
                workspace%state%q(lane, :) = q(:, sample)
                workspace%state%qd(lane, :) = qd(:, sample)
                workspace%state%qdd(lane, :) = qdd(:, sample)
                if (model%n_load > 0) workspace%load(lane, :, :) = load(:, :, sample)
            end do
        end subroutine gather

        !> Lanes into samples; failed ones become NaN.
        subroutine scatter(block, workspace, reaction, variable, rate, imbalance)
            integer, intent(in) :: block
            type(equation_workspace), intent(in) :: workspace
            real(wp), intent(in) :: reaction(:, :, :), variable(:, :), rate(:, :), imbalance(:)
            real(wp) :: nan
            integer :: lane, sample, i
            logical :: failed

            nan = ieee_value(1.0_wp, ieee_quiet_nan)
            do lane = 1, min(lanes, n - (block - 1)*lanes)
                sample = (block - 1)*lanes + lane
                failed = workspace%status(lane) /= sample_ok
                if (associated(results%status)) results%status(sample) = workspace%status(lane)
                if (associated(results%driving_force)) then
                    results%driving_force(:, sample) = workspace%driving_force(lane, :)
                    if (failed) results%driving_force(:, sample) = nan
                end if
                if (associated(results%reaction)) then
                    results%reaction(:, :, sample) = reaction(lane, :, :)
                    if (failed) results%reaction(:, :, sample) = nan
                end if
                if (associated(results%joint_variable)) then
                    results%joint_variable(:, sample) = variable(lane, :)
                    if (failed) results%joint_variable(:, sample) = nan
                end if
                if (associated(results%joint_rate)) then
                    results%joint_rate(:, sample) = rate(lane, :)
                    if (failed) results%joint_rate(:, sample) = nan
                end if
                if (associated(results%rcond)) results%rcond(sample) = workspace%rcond(lane)
                if (associated(results%error)) results%error(sample) = workspace%error(lane)
                if (associated(results%growth)) results%growth(sample) = workspace%growth(lane)
                if (associated(results%power_imbalance)) results%power_imbalance(sample) = merge(nan, imbalance(lane), failed)
                if (associated(results%position)) then
                    do i = 1, model%n_link
                        results%position(:, i, sample) = lane_of(workspace%state%position(i), lane)
                    end do
                end if
                if (associated(results%rotation)) then
                    do i = 1, model%n_link
                        results%rotation(:, :, i, sample) = &
                            mat3_lane(workspace%state%rotation(model%link(i)%orientation), lane)
                    end do
                end if
            end do
        end subroutine scatter
    end subroutine run_prepared
end module linkdyn_inverse
