!> How near the equations of motion are to being singular, whatever solver is used.
!>
!> The condition number is that of the lecture's equations: world axes, moments about the centres of mass, as
!> `linkdyn explain --matrix` prints them; each row divided by its largest entry, then each column, so that
!> neither units nor the sizes of links count. It comes from kernels that solve them for any right-hand side
!> (`linkdyn_inverse_matrix`).
module linkdyn_condition
    use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan, ieee_is_finite
    use linkdyn_condition_estimate, only: linear_solver, estimate_inverse_norm
    use linkdyn_constants, only: golden
    use linkdyn_dense, only: dense_workspace, solve_dense, solve_scaled
    use linkdyn_equation_kernels, only: equation_kernels, make_kernels, free_kernels, need_matrix
    use linkdyn_equation_programs, only: equation_choice, fill_matrix, has_columns, as_lecture
    use linkdyn_equations, only: unknown_choice
    use linkdyn_equilibration, only: measure_entries
    use linkdyn_force_program, only: out_alarm
    use linkdyn_inputs, only: sample_set, in_found, in_motion, in_unknown, in_transposed
    use linkdyn_inverse_matrix, only: make_inverse_matrix
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state
    use linkdyn_lane_count, only: lanes
    use linkdyn_equations_on_lanes, only: lane_numbers, lane_program, lane_space, prepare_lanes, run_on_lanes, first_output, &
        free_lane_program, free_lane_space
    use linkdyn_model, only: model_type
    use linkdyn_representatives, only: representative_motions
    implicit none (type, external)
    private
    public :: condition_type, condition_space, make_condition, free_condition, prepare_condition, eliminate_block, find_rcond, &
        singular_vectors, solve_poses, is_posed

    integer, parameter :: n_iteration = 6     !! for singular vectors

    !> The equations and their solution: constant, shared by all threads.
    type :: condition_type
        integer :: n = 0                                        !! equations
        type(equation_kernels), pointer :: kernels => null()    !! the matrix
        type(lane_program) :: pose, solve, solve_transposed     !! not made: no pivots serve
        integer, allocatable :: given(:)                        !! blocks that these take beside the motion, and beside what they
                                                                !! find
    end type condition_type

    !> Solutions on a block of lanes.
    type, extends(linear_solver) :: lane_inverse
        type(condition_type), pointer :: condition => null()
        type(kinematic_state), pointer :: state => null()       !! of the poses, during a call
        type(lane_numbers) :: numbers
        type(lane_space) :: of_solve, of_transposed
        logical :: is_loaded(2) = .false.                       !! what these take of the pose
    contains
        procedure :: solve => solve_on_lanes
    end type lane_inverse

    !> Scratch of one thread.
    type :: condition_space
        type(lane_inverse) :: inverse
        type(lane_space) :: of_matrix, of_pose
        real(wp), allocatable :: entry(:, :)                    !! of the nonzeros (lane, nonzero)
        real(wp), allocatable :: row_size(:, :), column_size(:, :)  !! largest entries (lane, n)
        real(wp) :: norm(lanes) = 0                             !! of the scaled equations
        real(wp) :: alarm(lanes) = 0                            !! of the elimination
        real(wp), allocatable :: matrix(:, :), right(:)         !! of a lane that the kernels cannot serve
        type(dense_workspace) :: dense
    contains
        procedure :: free => free_space
    end type condition_space

contains

    !> Equations for the same unknowns, and their solution.
    subroutine make_condition(model, unknown, condition)
        type(model_type), intent(in) :: model
        type(unknown_choice), intent(in) :: unknown
        type(condition_type), intent(out) :: condition
        type(equation_choice) :: choice
        type(sample_set) :: sample

        choice%way = as_lecture
        choice%drive_is_unknown = unknown%drive
        choice%acceleration_is_unknown = unknown%acceleration
        call make_kernels(choice, .true., .false., condition%kernels)
        condition%kernels%wants_right = .false.
        call need_matrix(model, condition%kernels)
        condition%n = condition%kernels%form%n
        allocate (condition%given(0))
        call note_given(condition%kernels%matrix, condition%given)
        call representative_motions(model, has_columns(model, choice), sample)
        if (sample%n == 0) return
        call make_inverse_matrix(model, choice, sample, condition%pose%program, condition%solve%program, &
                                 condition%solve_transposed%program)
        if (.not. condition%pose%program%is_made) return
        call prepare_lanes(model, has_columns(model, choice), condition%pose)
        call prepare_lanes(model, has_columns(model, choice), condition%solve)
        call prepare_lanes(model, has_columns(model, choice), condition%solve_transposed)
        call note_given(condition%pose, condition%given)
        call note_given(condition%solve, condition%given)
        call note_given(condition%solve_transposed, condition%given)
    end subroutine make_condition

    !> What a kernel takes that only its user knows, such as masses of payloads.
    subroutine note_given(lane, given)
        type(lane_program), intent(in) :: lane
        integer, allocatable, intent(inout) :: given(:)    !! blocks
        integer :: k

        do k = 1, size(lane%program%input)
            associate (block => lane%program%input(k)%block)
                if (any(block == [in_motion, in_found, in_unknown, in_transposed, given])) cycle
                given = [given, block]
            end associate
        end do
    end subroutine note_given

    !> Nobody may be using it.
    subroutine free_condition(condition)
        type(condition_type), intent(inout) :: condition

        call free_kernels(condition%kernels)
        call free_lane_program(condition%pose)
        call free_lane_program(condition%solve)
        call free_lane_program(condition%solve_transposed)
    end subroutine free_condition

    !> Make room for one thread.
    subroutine prepare_condition(condition, space)
        type(condition_type), intent(in), target :: condition
        type(condition_space), intent(out) :: space

        associate (n => condition%n)
            allocate (space%entry(lanes, size(condition%kernels%form%row)), space%row_size(lanes, n), space%column_size(lanes, n))
            space%inverse%condition => condition
            if (.not. condition%pose%program%is_made) return
            associate (of => space%inverse%numbers%of, n_pose => first_output(condition%pose, out_alarm) - 1)
                allocate (of(in_found)%x(lanes, n_pose), of(in_unknown)%x(lanes, n), of(in_transposed)%x(lanes, n))
            end associate
        end associate
    end subroutine prepare_condition

    subroutine free_space(self)
        class(condition_space), intent(inout) :: self

        call free_lane_space(self%of_matrix)
        call free_lane_space(self%of_pose)
        call free_lane_space(self%inverse%of_solve)
        call free_lane_space(self%inverse%of_transposed)
    end subroutine free_space

    !> The equations at the poses in `state`, and what their solution takes of these.
    subroutine eliminate_block(condition, state, given, space)
        type(condition_type), intent(in) :: condition
        type(kinematic_state), intent(in) :: state
        type(lane_numbers), intent(in) :: given                     !! what the equations take beside the motion
        type(condition_space), intent(inout) :: space
        integer :: k

        do k = 1, size(condition%given)
            space%inverse%numbers%of(condition%given(k))%x = given%of(condition%given(k))%x
        end do
        call run_on_lanes(condition%kernels%matrix, lanes, state, space%inverse%numbers, space%of_matrix)
        associate (form => condition%kernels%form, found => space%of_matrix%found, numbers => space%inverse%numbers)
            do k = 1, size(form%row)
                if (form%output(k) > 0) then
                    space%entry(:, k) = found(:, form%output(k))
                else
                    space%entry(:, k) = form%constant(k)
                end if
            end do
            call measure_entries(condition%n, form%row, form%column, [(k, k=1, size(form%row))], space%entry, &
                                 space%row_size, space%column_size, space%norm)
            space%alarm = huge(1.0_wp)
            if (.not. condition%pose%program%is_made) return
            call run_on_lanes(condition%pose, lanes, state, numbers, space%of_pose)
            space%alarm = space%of_pose%found(:, first_output(condition%pose, out_alarm))
            numbers%of(in_found)%x = space%of_pose%found(:, :size(numbers%of(in_found)%x, 2))
            space%inverse%is_loaded = .false.
        end associate
    end subroutine eliminate_block

    !> One solution at the poses of the block.
    subroutine solve_on_lanes(self, is_transposed, x)
        class(lane_inverse), intent(inout) :: self
        logical, intent(in) :: is_transposed
        real(wp), intent(inout) :: x(:, :)                  !! (lane, n)

        if (is_transposed) then
            call run(self%condition%solve_transposed, 2, in_transposed, self%of_transposed)
        else
            call run(self%condition%solve, 1, in_unknown, self%of_solve)
        end if

    contains

        subroutine run(lane, i, block, space)
            type(lane_program), intent(in) :: lane
            integer, intent(in) :: i, block
            type(lane_space), intent(inout) :: space

            self%numbers%of(block)%x = x
            if (self%is_loaded(i)) then
                call run_on_lanes(lane, lanes, self%state, self%numbers, space, only_blocks=[block])
            else
                call run_on_lanes(lane, lanes, self%state, self%numbers, space)
            end if
            self%is_loaded(i) = .true.
            x = space%found
        end subroutine run
    end subroutine solve_on_lanes

    !> Reciprocal condition number of the equations, in the 1-norm; NaN where there is no pose.
    subroutine find_rcond(condition, state, space, rcond)
        type(condition_type), intent(in) :: condition
        type(kinematic_state), intent(in), target :: state
        type(condition_space), intent(inout) :: space
        real(wp), intent(out) :: rcond(lanes)
        integer :: lane

        space%inverse%state => state
        if (condition%pose%program%is_made) then
            call estimate_inverse_norm(condition%n, space%inverse, space%column_size, space%row_size, rcond)
            rcond = 1/(space%norm*rcond)
        end if
        do lane = 1, lanes
            if (.not. is_posed(state, lane)) then
                rcond(lane) = ieee_value(1.0_wp, ieee_quiet_nan)
            else if (.not. (space%alarm(lane) <= 1 .and. ieee_is_finite(rcond(lane)))) then
                call take_lane(condition, lane, space, rcond(lane))
            end if
        end do
    end subroutine find_rcond

    !> Singular vectors of the smallest singular value of the scaled equations by inverse iteration, and that value. The vectors
    !> are scaled back, so that left^T A right is sigma with the equations' own entries.
    subroutine singular_vectors(condition, state, space, left, right, sigma)
        type(condition_type), intent(in) :: condition
        type(kinematic_state), intent(in), target :: state
        type(condition_space), intent(inout) :: space
        real(wp), intent(out), dimension(lanes, condition%n) :: left, right
        real(wp), intent(out) :: sigma(lanes)
        integer :: k, lane

        space%inverse%state => state
        if (condition%pose%program%is_made) call iterate_on_lanes(condition%n, space, left, right)
        do lane = 1, lanes
            if (space%alarm(lane) <= 1 .or. .not. is_posed(state, lane)) cycle
            call iterate_on_lane(condition, lane, space, left(lane, :), right(lane, :))
        end do
        left = left/space%row_size
        right = right/space%column_size
        sigma = 0
        associate (form => condition%kernels%form)
            do k = 1, size(form%row)
                sigma = sigma + space%entry(:, k)*(left(:, form%row(k))*right(:, form%column(k)))
            end do
        end associate
    end subroutine singular_vectors

    !> One solution of the equations at the poses of the block, in their own rows and columns.
    subroutine solve_poses(condition, state, space, x)
        type(condition_type), intent(in) :: condition
        type(kinematic_state), intent(in), target :: state
        type(condition_space), intent(inout) :: space
        real(wp), intent(inout) :: x(lanes, condition%n)     !! in: right-hand side; out: solution
        real(wp) :: given(lanes, condition%n), of_lane(condition%n), rcond
        integer :: lane

        given = x
        space%inverse%state => state
        if (condition%pose%program%is_made) call space%inverse%solve(.false., x)
        do lane = 1, lanes
            if (space%alarm(lane) <= 1 .or. .not. is_posed(state, lane)) cycle
            call take_lane(condition, lane, space, rcond)
            of_lane = given(lane, :)/space%row_size(lane, :)
            call solve_scaled(space%dense, .false., of_lane)
            x(lane, :) = of_lane/space%column_size(lane, :)
        end do
    end subroutine solve_poses

    !> Inverse iteration: the value sought is amplified against the next one by the square of their ratio each time.
    subroutine iterate_on_lanes(n, space, left, right)
        integer, intent(in) :: n
        type(condition_space), intent(inout) :: space
        real(wp), intent(out), dimension(lanes, n) :: left, right
        integer :: i, k

        do k = 1, n
            left(:, k) = spread_start(k)
        end do
        do i = 1, n_iteration
            right = space%row_size*left
            call space%inverse%solve(.false., right)
            right = space%column_size*right
            call normalize(n, right)
            left = space%column_size*right
            call space%inverse%solve(.true., left)
            left = space%row_size*left
            call normalize(n, left)
        end do
    end subroutine iterate_on_lanes

    !> The same for one lane with dense factors.
    subroutine iterate_on_lane(condition, lane, space, left, right)
        type(condition_type), intent(in) :: condition
        integer, intent(in) :: lane
        type(condition_space), intent(inout) :: space
        real(wp), intent(out) :: left(:), right(:)
        real(wp) :: x(size(left)), rcond
        integer :: i, k

        call take_lane(condition, lane, space, rcond)
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
    subroutine take_lane(condition, lane, space, rcond)
        type(condition_type), intent(in) :: condition
        integer, intent(in) :: lane
        type(condition_space), intent(inout) :: space
        real(wp), intent(out) :: rcond
        real(wp) :: error_bound
        logical :: is_singular

        if (.not. allocated(space%matrix)) allocate (space%matrix(condition%n, condition%n), space%right(condition%n))
        call fill_matrix(condition%kernels%form, space%of_matrix%found(lane, :), space%matrix)
        space%right = 0
        rcond = ieee_value(1.0_wp, ieee_quiet_nan)
        if (all(ieee_is_finite(space%matrix))) &
            call solve_dense(space%dense, space%matrix, space%right, rcond, error_bound, is_singular)
    end subroutine take_lane
end module linkdyn_condition
