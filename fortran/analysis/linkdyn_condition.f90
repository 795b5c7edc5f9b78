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
    use linkdyn_constants, only: golden
    use linkdyn_dense, only: dense_workspace, solve_dense, solve_scaled
    use linkdyn_elimination_plan, only: elimination_plan, sparse_system, make_factor_plan
    use linkdyn_elimination_run, only: run_plan, load_constants
    use linkdyn_equilibration, only: measure_entries
    use linkdyn_equations, only: equations_type, unknown_choice, build_equations, sample_system, fill_lane_matrix, solver_lapack
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state
    use linkdyn_lane_count, only: lanes
    use linkdyn_linear_record, only: linear_record, solve_recorded, transposed
    use linkdyn_model, only: model_type
    use linkdyn_slots, only: slot_store, make_slots
    use linkdyn_status, only: status_type
    implicit none (type, external)
    private
    public :: condition_type, condition_space, make_condition, prepare_condition, eliminate_block, find_rcond, singular_vectors, &
        is_posed

    integer, parameter :: n_iteration = 6     !! for singular vectors

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
        real(wp) :: norm(lanes) = 0                         !! of the scaled equations
        real(wp) :: alarm(lanes) = 0                        !! of the elimination
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
        if (size(system%value, 1) > 0) call make_factor_plan(system, condition%plan, condition%solve)
        if (condition%plan%is_complete) then
            condition%solve_transposed = transposed(condition%solve)
        else
            condition%plan%n_slot = condition%equations%formulation%n_slot
            condition%plan%constant = [real(wp) ::]
            condition%plan%constant_slot = [integer ::]
        end if
        condition%row = system%row
        condition%column = system%column
        condition%entry = system%slot
        ! Constants stand behind everything else, once each.
        do k = 1, size(system%slot)
            if (system%slot(k) == 0) condition%entry(k) = slot_of(condition%equations%formulation%entry(k)%value)
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
        call make_slots(condition%plan%n_slot, space%slot)
        call load_constants(condition%plan, space%slot%value)
        if (condition%plan%is_complete) call prepare_estimate(condition%solve, condition%solve_transposed, space%estimate)
    end subroutine prepare_condition

    subroutine free_condition(self)
        class(condition_space), intent(inout) :: self

        call self%slot%free()
        call self%row_size%free()
        call self%column_size%free()
        call self%estimate%free()
    end subroutine free_condition

    !> Assemble the equations at the poses in `state` and eliminate.
    subroutine eliminate_block(model, condition, state, space)
        type(model_type), intent(in) :: model
        type(condition_type), intent(in) :: condition
        type(kinematic_state), intent(in) :: state
        type(condition_space), intent(inout) :: space

        associate (equations => condition%equations, slot => space%slot%value)
            call assemble_matrix(model, equations%formulation, state, slot)
            call assemble_accelerations(model, equations%formulation, equations%accelerations, state, slot)
            call measure_entries(equations%formulation%n_unknown, condition%row, condition%column, condition%entry, slot, &
                                 space%row_size%value, space%column_size%value, space%norm)
            space%alarm = huge(1.0_wp)
            if (condition%plan%is_complete) call run_plan(condition%plan, slot, space%alarm)
        end associate
    end subroutine eliminate_block

    !> Reciprocal condition number of the equations eliminated, in the 1-norm; NaN where there is no pose.
    subroutine find_rcond(condition, state, space, rcond)
        type(condition_type), intent(in) :: condition
        type(kinematic_state), intent(in) :: state
        type(condition_space), intent(inout) :: space
        real(wp), intent(out) :: rcond(lanes)
        integer :: lane

        if (condition%plan%is_complete) then
            call estimate_inverse_norm(condition%solve, condition%solve_transposed, space%slot%value, space%column_size%value, &
                                       space%row_size%value, space%estimate, rcond)
            rcond = 1/(space%norm*rcond)
        end if
        do lane = 1, lanes
            if (.not. is_posed(state, lane)) then
                rcond(lane) = ieee_value(1.0_wp, ieee_quiet_nan)
            else if (.not. (space%alarm(lane) <= 1 .and. ieee_is_finite(rcond(lane)))) then
                call take_lane(condition%equations, lane, space, rcond(lane))
            end if
        end do
    end subroutine find_rcond

    !> Singular vectors of the smallest singular value of the scaled equations by inverse iteration, and that value. The vectors
    !> are scaled back, so that left^T A right is sigma with the equations' own entries.
    subroutine singular_vectors(condition, state, space, left, right, sigma)
        type(condition_type), intent(in) :: condition
        type(kinematic_state), intent(in) :: state
        type(condition_space), intent(inout) :: space
        real(wp), intent(out), dimension(lanes, condition%equations%formulation%n_unknown) :: left, right
        real(wp), intent(out) :: sigma(lanes)
        integer :: k, lane, n

        n = condition%equations%formulation%n_unknown
        associate (row_size => space%row_size%value, column_size => space%column_size%value, slot => space%slot%value)
            if (condition%plan%is_complete) call iterate_on_lanes(condition, slot, row_size, column_size, &
                                                                  space%estimate%work%value, left, right)
            do lane = 1, lanes
                if (space%alarm(lane) <= 1 .or. .not. is_posed(state, lane)) cycle
                call iterate_on_lane(condition%equations, lane, space, left(lane, :), right(lane, :))
            end do
            left = left/row_size
            right = right/column_size
            sigma = 0
            do k = 1, size(condition%entry)
                sigma = sigma + slot(:, condition%entry(k))*(left(:, condition%row(k))*right(:, condition%column(k)))
            end do
        end associate
    end subroutine singular_vectors

    !> Inverse iteration: the value sought is amplified against the next one by the square of their ratio each time.
    subroutine iterate_on_lanes(condition, slot, row_size, column_size, work, left, right)
        type(condition_type), intent(in) :: condition
        real(wp), intent(in) :: slot(lanes, *)
        real(wp), intent(in), dimension(lanes, condition%solve%n) :: row_size, column_size
        real(wp), intent(inout) :: work(lanes, *)
        real(wp), intent(out), dimension(lanes, condition%solve%n) :: left, right
        integer :: i, k

        do k = 1, condition%solve%n
            left(:, k) = spread_start(k)
        end do
        do i = 1, n_iteration
            right = row_size*left
            call solve_recorded(condition%solve, slot, work, right)
            right = column_size*right
            call normalize(condition%solve%n, right)
            left = column_size*right
            call solve_recorded(condition%solve_transposed, slot, work, left)
            left = row_size*left
            call normalize(condition%solve%n, left)
        end do
    end subroutine iterate_on_lanes

    !> The same for one lane with dense factors.
    subroutine iterate_on_lane(equations, lane, space, left, right)
        type(equations_type), intent(in) :: equations
        integer, intent(in) :: lane
        type(condition_space), intent(inout) :: space
        real(wp), intent(out) :: left(:), right(:)
        real(wp) :: x(size(left)), rcond
        integer :: i, k

        call take_lane(equations, lane, space, rcond)
        x = [(spread_start(k), k=1, size(x))]
        do i = 1, n_iteration
            call solve_scaled(space%dense, .false., x)
            x = x/norm2(x)
            right = x
            call solve_scaled(space%dense, .true., x)
            x = x/norm2(x)
            left = x
        end do
    end subroutine iterate_on_lane

    !> A component of a vector that is square to none in particular.
    pure real(wp) function spread_start(k)
        integer, intent(in) :: k

        spread_start = 0.5_wp + modulo(k*golden, 1.0_wp)
    end function spread_start

    !> Is there a pose on the lane?
    pure logical function is_posed(state, lane)
        type(kinematic_state), intent(in) :: state
        integer, intent(in) :: lane

        is_posed = .not. (state%unreachable(lane) .or. state%not_converged(lane) .or. state%singular(lane))
    end function is_posed

    pure subroutine normalize(n, x)
        integer, intent(in) :: n
        real(wp), intent(inout) :: x(lanes, n)
        real(wp) :: size_here(lanes)
        integer :: k

        size_here = 0
        do k = 1, n
            size_here = size_here + x(:, k)**2
        end do
        size_here = 1/sqrt(size_here)
        do k = 1, n
            x(:, k) = x(:, k)*size_here
        end do
    end subroutine normalize

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
