!> What the equations of forward dynamics are solved for, and how.
module linkdyn_forward_unknowns
    use linkdyn_equations, only: unknown_choice, solver_elimination, solver_reduced
    use linkdyn_forward_state, only: choose_free
    use linkdyn_model, only: model_type
    use linkdyn_motor_states, only: motors_have_laws
    use linkdyn_scene, only: effort_inverse
    use linkdyn_status, only: status_type
    implicit none (type, external)
    private
    public :: choose_unknowns, fastest_solver

contains

    !> Which accelerations and driving forces are unknown: driven coordinates get their force from the drives `inverse`.
    subroutine choose_unknowns(model, unknown, status)
        type(model_type), intent(in) :: model
        type(unknown_choice), intent(out) :: unknown
        type(status_type), intent(inout) :: status

        call choose_free(model, unknown%acceleration, status)
        allocate (unknown%drive(model%n_actuator))
        unknown%drive = model%scene%actuator%law%kind == effort_inverse .and. .not. all(unknown%acceleration)
    end subroutine choose_unknowns

    !> Virtual work of platforms on legs, whose coordinates move all links, and where links are many and coordinates few;
    !> elimination else.
    pure integer function fastest_solver(model, unknown) result(solver)
        type(model_type), intent(in) :: model
        type(unknown_choice), intent(in) :: unknown
        integer, parameter :: many = 20                    !! links a coordinate

        solver = solver_elimination
        if (.not. all(unknown%acceleration) .or. size(model%contact) > 0) return     ! friction comes from reactions
        if (motors_have_laws(model)) return
        ! Where pivots fail, near a change point, the dense solver of a long chain would take 100 times as long.
        if (model%n_leg > 0 .or. model%n_link > many*model%n_q) solver = solver_reduced
    end function fastest_solver
end module linkdyn_forward_unknowns
