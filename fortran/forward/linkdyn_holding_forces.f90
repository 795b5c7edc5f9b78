!> Driving forces that hold a mechanism where it is, at rest: against its weight and its springs, not against loads. What
!> controllers with the feed-forward "gravity" add.
module linkdyn_holding_forces
    use linkdyn_carried_assembly, only: carried_assembly, evaluate_assembled
    use linkdyn_equations, only: equations_type, equation_workspace, build_equations, free_equations, prepare_workspace, &
        solve_equations, &
        solver_reduced, solver_elimination
    use linkdyn_forward_state, only: state_layout, unpack_state
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_model, only: model_type
    use linkdyn_status, only: status_type
    implicit none (type, external)
    private
    public :: holding_forces, plan_holding_forces, find_holding_forces, free_holding_forces

    type :: holding_forces
        integer, allocatable :: status(:)              !! of those found last (lane)
        real(wp), allocatable :: force(:, :)           !! found last (lane, n_actuator) [N, N m]
        type(equations_type), private :: equations
        type(equation_workspace), private :: workspace
    end type holding_forces

contains

    subroutine plan_holding_forces(model, holding, status)
        type(model_type), intent(in) :: model
        type(holding_forces), intent(inout) :: holding
        type(status_type), intent(inout) :: status

        ! friction comes from reactions
        call build_equations(model, merge(solver_elimination, solver_reduced, size(model%contact) > 0), .false., &
                             holding%equations, status)
        if (.not. status%is_ok()) return
        call prepare_workspace(model, holding%equations, holding%workspace)
        holding%workspace%checks_accuracy = .false.    ! steps judge it
        allocate (holding%force(lanes, model%n_actuator), source=0.0_wp)
        allocate (holding%status(lanes), source=0)
    end subroutine plan_holding_forces

    !> Forces at the places of states, whatever their velocities.
    subroutine find_holding_forces(model, layout, t, y, turns, assembly, holding)
        type(model_type), intent(in) :: model
        type(state_layout), intent(in) :: layout
        real(wp), intent(in) :: t(lanes)               !! [s]
        real(wp), intent(in) :: y(:, :)                !! (lane, n)
        real(wp), intent(in) :: turns(:, :)            !! of angles that are not in y (lane, n)
        type(carried_assembly), intent(inout) :: assembly
        type(holding_forces), intent(inout) :: holding

        associate (workspace => holding%workspace)
            call unpack_state(model, layout, t, y, turns, workspace%state)
            workspace%state%qd = 0
            workspace%state%qdd = 0
            workspace%load = 0
            workspace%state%time = t
            call evaluate_assembled(model, t, assembly, workspace%state)
            call solve_equations(model, holding%equations, workspace)
            holding%force = workspace%driving_force
            holding%status = workspace%status
        end associate
    end subroutine find_holding_forces

    subroutine free_holding_forces(holding)
        type(holding_forces), intent(inout) :: holding

        call holding%workspace%free()
        call free_equations(holding%equations)
    end subroutine free_holding_forces
end module linkdyn_holding_forces
