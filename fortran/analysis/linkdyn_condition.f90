!> How near the equations of motion are to being singular, whatever solver is used.
!>
!> The condition number is that of the lecture's equations: world axes, moments about the centres of mass, as
!> `linkdyn explain --matrix` prints them; each row divided by its largest entry, then each column, so that
!> neither units nor the sizes of links count. It comes from an elimination plan of its own, whose pivots and
!> multipliers serve any right-hand side.
module linkdyn_condition
    use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan, ieee_is_finite
    use linkdyn_acceleration_columns, only: assemble_accelerations
    use linkdyn_assembly, only: assemble_matrix
    use linkdyn_condition_estimate, only: estimate_space, prepare_estimate, estimate_inverse_norm
    use linkdyn_dense, only: dense_workspace, solve_dense
    use linkdyn_elimination_plan, only: elimination_plan, sparse_system, make_factor_plan
    use linkdyn_elimination_run, only: run_plan, load_constants
    use linkdyn_equilibration, only: measure_entries
    use linkdyn_equations, only: equations_type, unknown_choice, build_equations, sample_system, fill_lane_matrix, solver_lapack
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state
    use linkdyn_lane_count, only: lanes
    use linkdyn_linear_record, only: linear_record, transposed
    use linkdyn_model, only: model_type
    use linkdyn_slots, only: slot_store, make_slots
    use linkdyn_status, only: status_type
    implicit none (type, external)
    private
    public :: condition_type, condition_space, make_condition, prepare_condition, find_rcond

    !> The equations and their elimination: constant, shared by all threads.
    type :: condition_type
        type(equations_type) :: equations
        type(elimination_plan) :: plan
        type(linear_record) :: solve, solve_transposed
        integer, allocatable :: row(:), column(:), entry(:)     !! of the nonzeros: place, and slot of the value
    end type condition_type

    !> Scratch of one thread.
    type :: condition_space
        type(slot_store) :: slot
        type(estimate_space) :: estimate
        type(slot_store) :: row_size, column_size           !! largest entries (lane, n)
        real(wp), allocatable :: matrix(:, :), right(:)             !! of a lane that the plan cannot serve
        type(dense_workspace) :: dense
    contains
        procedure :: free => free_condition
    end type condition_space

contains

    !> Equations for the same unknowns, and their elimination.
    subroutine make_condition(model, unknown, condition, status)
        type(model_type), intent(in) :: model
        type(unknown_choice), intent(in) :: unknown
        type(condition_type), intent(out) :: condition
        type(status_type), intent(inout) :: status
        type(sparse_system) :: system
        integer :: k

        call build_equations(model, solver_lapack, .true., condition%equations, status, unknown)
        if (.not. status%is_ok()) return
        call sample_system(model, condition%equations, system)
        if (size(system%value, 1) == 0) return
        call make_factor_plan(system, condition%plan, condition%solve)
        if (.not. condition%plan%is_complete) return
        condition%solve_transposed = transposed(condition%solve)
        condition%row = system%row
        condition%column = system%column
        condition%entry = system%slot
        ! Constants stand behind everything else, once each.
        do k = 1, size(system%slot)
            if (system%slot(k) == 0) condition%entry(k) = slot_of(system%value(1, k))
        end do

    contains

        !> Slot of a constant.
        integer function slot_of(value)
            real(wp), intent(in) :: value
            integer :: place

            associate (plan => condition%plan)
                place = findloc(plan%constant, value, dim=1)
                if (place == 0) then
                    plan%n_slot = plan%n_slot + 1
                    plan%constant = [plan%constant, value]
                    plan%constant_slot = [plan%constant_slot, plan%n_slot]
                    place = size(plan%constant)
                end if
                slot_of = plan%constant_slot(place)
            end associate
        end function slot_of
    end subroutine make_condition

    !> Make room for one thread.
    subroutine prepare_condition(condition, space)
        type(condition_type), intent(in) :: condition
        type(condition_space), intent(out) :: space

        associate (n => condition%equations%formulation%n_unknown)
            call make_slots(n, space%row_size)
            call make_slots(n, space%column_size)
        end associate
        call make_slots(max(condition%equations%formulation%n_slot, condition%plan%n_slot), space%slot)
        if (.not. condition%plan%is_complete) return
        call load_constants(condition%plan, space%slot%value)
        call prepare_estimate(condition%solve, condition%solve_transposed, space%estimate)
    end subroutine prepare_condition

    subroutine free_condition(self)
        class(condition_space), intent(inout) :: self

        call self%slot%free()
        call self%row_size%free()
        call self%column_size%free()
        call self%estimate%free()
    end subroutine free_condition

    !> Reciprocal condition number of the equations at the poses in `state`, in the 1-norm; NaN where there is no pose.
    subroutine find_rcond(model, condition, state, space, rcond)
        type(model_type), intent(in) :: model
        type(condition_type), intent(in) :: condition
        type(kinematic_state), intent(in) :: state
        type(condition_space), intent(inout) :: space
        real(wp), intent(out) :: rcond(lanes)
        real(wp) :: alarm(lanes), norm(lanes), norm_of_inverse(lanes)
        integer :: lane

        associate (equations => condition%equations, slot => space%slot%value)
            call assemble_matrix(model, equations%formulation, state, slot)
            call assemble_accelerations(model, equations%formulation, equations%accelerations, state, slot)
            alarm = huge(1.0_wp)
            if (condition%plan%is_complete) then
                call measure_entries(condition%solve%n, condition%row, condition%column, condition%entry, slot, &
                                     space%row_size%value, space%column_size%value, norm)
                call run_plan(condition%plan, slot, alarm)
                call estimate_inverse_norm(condition%solve, condition%solve_transposed, slot, space%column_size%value, &
                                           space%row_size%value, space%estimate, norm_of_inverse)
                rcond = 1/(norm*norm_of_inverse)
            end if
        end associate
        do lane = 1, lanes
            if (state%unreachable(lane) .or. state%not_converged(lane) .or. state%singular(lane)) then
                rcond(lane) = ieee_value(1.0_wp, ieee_quiet_nan)
            else if (.not. (alarm(lane) <= 1 .and. ieee_is_finite(rcond(lane)))) then
                call take_lane(condition%equations, lane, space, rcond(lane))
            end if
        end do
    end subroutine find_rcond

    !> One lane by the dense solver.
    subroutine take_lane(equations, lane, space, rcond)
        type(equations_type), intent(in) :: equations
        integer, intent(in) :: lane
        type(condition_space), intent(inout) :: space
        real(wp), intent(out) :: rcond
        real(wp) :: error_bound
        logical :: is_singular

        associate (n => equations%formulation%n_unknown)
            if (.not. allocated(space%matrix)) allocate (space%matrix(n, n), space%right(n))
        end associate
        call fill_lane_matrix(equations%formulation, space%slot%value, lane, space%matrix)
        space%right = 0
        rcond = ieee_value(1.0_wp, ieee_quiet_nan)
        if (all(ieee_is_finite(space%matrix))) &
            call solve_dense(space%dense, space%matrix, space%right, rcond, error_bound, is_singular)
    end subroutine take_lane
end module linkdyn_condition
