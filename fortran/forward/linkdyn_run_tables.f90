!> Tables that forward runs, ensembles and simulators hear.
module linkdyn_run_tables
    use linkdyn_controlled_drives, only: wants_motion
    use linkdyn_equations, only: unknown_choice
    use linkdyn_forward_unknowns, only: choose_unknowns
    use linkdyn_heard_tables, only: hearing, heard_table, list_tables
    use linkdyn_model, only: model_type
    use linkdyn_scene, only: effort_inverse
    use linkdyn_status, only: status_type
    implicit none (type, external)
    private
    public :: list_run_tables, list_simulator_tables

contains

    !> Where the forces are those that a motion asks for, or a controller looks at it, that of all coordinates is heard.
    !>
    !> **Errors**: coordinates that cannot be driven as the scene says.
    subroutine list_run_tables(model, list, status)
        type(model_type), intent(in) :: model
        type(heard_table), allocatable, intent(out) :: list(:)
        type(status_type), intent(inout) :: status
        type(unknown_choice) :: unknown
        type(hearing) :: hearer

        allocate (list(0))
        if (.not. status%is_ok()) return
        call choose_unknowns(model, unknown, status)
        if (.not. status%is_ok()) return
        hearer%motions = wants_motion(model) .or. any(model%scene%actuator%law%kind == effort_inverse .and. .not. unknown%drive)
        hearer%starts = .true.
        hearer%drives = .true.
        hearer%controls = .true.
        call list_tables(model%scene, hearer, list)
    end subroutine list_run_tables

    !> Whoever steps gives what actuators do.
    subroutine list_simulator_tables(model, list)
        type(model_type), intent(in) :: model          !! of the simulator: no coordinate is driven
        type(heard_table), allocatable, intent(out) :: list(:)
        type(hearing) :: hearer

        hearer%motions = wants_motion(model)
        hearer%controls = .true.
        call list_tables(model%scene, hearer, list)
    end subroutine list_simulator_tables
end module linkdyn_run_tables
