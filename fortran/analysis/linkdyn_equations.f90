!> The equations of motion on one block of lanes and their solvers.
!>
!> Per freedom either a driving force or the acceleration of a coordinate is unknown: inverse dynamics asks for all
!> driving forces, forward dynamics for all accelerations, and any mix is solved alike.
!>
!> Kernels write the equations down (`linkdyn_equation_programs`), of links that move as the lanes' kinematics has found; here they
!> are solved. `gauss-jordan`: the lecture's dense method on the lecture's equations; `gauss-jordan-plain`: without pivoting, rows
!> put in order once, for comparison only. `lapack`: dense with equilibration and refinement on the same equations. `elimination`:
!> by a kernel, with pivots that serve the scene; where one fails, on a lane, the same equations are solved densely. `reduced`:
!> virtual work, as many equations as coordinates, no reactions.
module linkdyn_equations
    use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan, ieee_is_finite
    use linkdyn_closed_forms, only: flag_closed_forms
    use linkdyn_result_kinds, only: result_driving_force, result_qdd, result_reaction, result_joint_push
    use linkdyn_cholesky, only: solve_cholesky
    use linkdyn_contact, only: contact_type, has_settled, most_rounds, n_part, n_press
    use linkdyn_dense, only: dense_workspace, solve_dense
    use linkdyn_equation_kernels, only: equation_kernels, answer_kernels, make_kernels, free_kernels, need_solving, need_answers, &
        need_sliding, slides_or_pulls, kernel_family, join_family, takes_numbers
    use linkdyn_equation_programs, only: equation_choice, fill_matrix, has_columns, as_lecture, sparsely, by_work, nothing_else, &
        out_solution, out_press, out_driven, out_square, out_transmitted
    use linkdyn_force_program, only: out_alarm, out_reach
    use linkdyn_friction_balance, only: balance_friction, driven_press
    use linkdyn_friction_state, only: friction_state, prepare_friction, find_factors, knows_slopes, pressing_forces, &
        linear_press, rubs_as_pressed
    use linkdyn_gauss_jordan, only: solve_gauss_jordan
    use linkdyn_given_numbers, only: prepare_numbers, take_numbers, take_pushes
    use linkdyn_inputs, only: in_effort, in_friction, in_sense, in_unknown, in_shared, in_stop, in_clutch
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state, prepare_kinematics, link_position, link_rotation
    use linkdyn_lane_count, only: lanes
    use linkdyn_equations_on_lanes, only: lane_numbers, lane_space, run_on_lanes, first_output, free_lane_space
    use linkdyn_led_mechanism, only: evaluate_kinematics
    use linkdyn_lossy_motors, only: lossy_motors
    use linkdyn_model, only: model_type, drives_share, friction_is_shared
    use linkdyn_motion_measures, only: released_fit
    use linkdyn_released_motion, only: released_joints_stay
    use linkdyn_shared_reactions, only: share_reactions
    use linkdyn_status, only: status_type, fail, status_bad_input, sample_ok, sample_unreachable, &
        sample_singular, sample_not_converged, sample_branch_lost, sample_undefined, sample_locked
    use linkdyn_text, only: one_of, to_text
    use linkdyn_transmission_losses, only: contacts_of_motors, begin_losses, press_losses, apply_losses
    use linkdyn_uncertainty, only: largest_uncertainty
    implicit none (type, external)
    private
    public :: equations_type, equation_workspace, unknown_choice, find_drives, build_equations, build_no_equations, &
        build_given_equations, free_equations
    public :: share_equations, prepare_workspace, want_of, solve_block, solve_equations, solve_again, solve_with_amounts
    public :: flag_locked, forces_at_work, found_of, renew_equations, share_block, wanted_to_share
    public :: solver_gauss_jordan, solver_lapack, solver_elimination, solver_reduced, solver_name, choose_solver
    public :: solver_gauss_jordan_plain

    integer, parameter :: solver_gauss_jordan = 1, solver_lapack = 2, solver_elimination = 3, solver_reduced = 4
    integer, parameter :: solver_gauss_jordan_plain = 5
    integer, parameter :: solver_none = 0                !! nothing is unknown
    character(len=18), parameter :: solver_name(5) = &
        [character(len=18) :: "gauss-jordan", "lapack", "elimination", "reduced", "gauss-jordan-plain"]

    !> What is unknown; the rest is given.
    type :: unknown_choice
        logical, allocatable :: acceleration(:)         !! of the coordinates (n_q)
        logical, allocatable :: drive(:)                !! driving forces (n_actuator)
    end type unknown_choice

    !> Equations ready to be solved: shared by all threads, constant but for kernels that are made when they are wanted.
    type :: equations_type
        integer :: solver = solver_elimination
        logical :: wants_reactions = .true.
        logical :: needs_columns = .false.              !! how motions change with the coordinates
        logical :: are_solved = .true.                  !! false: there are none, only the links' motion is wanted
        integer, allocatable :: lossy(:)                !! motors whose torque is given and whose transmission loses some of it
        type(contact_type), allocatable :: rub(:)       !! contacts of joints, then these transmissions
        integer, allocatable :: answer(:)               !! what is asked of the unknowns in any case: `result_*`, `out_*`
        type(unknown_choice) :: unknown
        type(equation_kernels), pointer :: kernels => null()
    end type equations_type

    !> Scratch and results of one block, one per thread.
    type :: equation_workspace
        type(kinematic_state) :: state
        integer :: n_used = lanes                       !! lanes that anyone looks at: others are not handed to the dense solver
        logical :: checks_accuracy = .true.             !! false: a sample near a dead point is taken as it comes
        logical :: checks_input = .true.                !! false: motion and loads are known to be finite
        real(wp), allocatable :: load(:, :, :)          !! (lane, 6, n_load)
        type(lane_numbers) :: numbers                   !! what the kernels take beside the motion
        real(wp), allocatable :: matrix(:, :, :)        !! solvers on lanes: (lane, row, column)
        real(wp), allocatable :: right(:, :, :)         !! (lane, row, 1)
        real(wp), allocatable :: lane_matrix(:, :), lane_right(:)
        type(dense_workspace) :: dense
        ! ---- RESULTS
        real(wp), allocatable :: driving_force(:, :)    !! (lane, n_actuator), in where given
        real(wp), allocatable :: transmitted(:, :)      !! the same without what rotors take (lane, n_actuator)
        real(wp), allocatable :: motor_force(:, :)      !! in: what lossy motors give at their joint variables (lane, n_actuator)
        real(wp), allocatable :: driving_rate(:, :)     !! in: rates of these (lane, n_actuator)
        real(wp), allocatable :: acceleration(:, :)     !! of the coordinates: what is given, plus what is solved for (lane, n_q)
        integer :: status(lanes) = sample_ok
        integer :: status_of_motion(lanes) = sample_ok  !! before any force was known
        logical :: is_doubtful(lanes) = .false.         !! nothing but the uncertainty of a group flags the motion
        real(wp) :: rcond(lanes) = 0, error(lanes) = 0  !! NaN where the solver has none
        real(wp) :: growth(lanes) = 0                   !! reciprocal pivot growth (gauss-jordan)
        logical :: fell_back(lanes) = .false.           !! the pivots of the kernel have failed on the lane
        type(friction_state) :: friction
        real(wp), allocatable :: sense(:, :)            !! of joint variables with lossy motors: +1, -1 (lane, lossy motor)
        ! ---- KERNELS and their slots
        type(answer_kernels), pointer, private :: solving => null(), answers => null()
        type(lane_space), private :: of_matrix, of_solving, of_sliding, of_answers
        integer, allocatable, private :: wanted(:)      !! results beside these, `result_*`, `out_*`
        logical, private :: has_sliding = .false.
        logical, private :: is_left(lanes) = .false.    !! by the elimination
        integer, private :: n_loaded = 0                !! lanes whose motion, loads and all else but forces the solving kernel has
    contains
        procedure :: free
    end type equation_workspace

contains

    !> The solver of a name.
    subroutine choose_solver(text, solver, status)
        character(len=*), intent(in) :: text
        integer, intent(out) :: solver
        type(status_type), intent(inout) :: status
        integer :: i

        solver = solver_elimination
        do i = 1, size(solver_name)
            if (text == solver_name(i)) then
                solver = i
                return
            end if
        end do
        call fail(status, status_bad_input, "solver '"//trim(text)//"' is not known (expected "//one_of(solver_name)//")")
    end subroutine choose_solver

    !> Inverse dynamics: all driving forces are unknown, all accelerations given.
    pure function find_drives(model) result(unknown)
        type(model_type), intent(in) :: model
        type(unknown_choice) :: unknown

        allocate (unknown%acceleration(model%n_q), unknown%drive(model%n_actuator))
        unknown%acceleration = .false.
        unknown%drive = .true.
    end function find_drives

    !> Choose what the kernels have to find. Nothing said of the unknowns: inverse dynamics.
    subroutine build_equations(model, solver, wants_reactions, equations, status, unknown, has_motor_laws)
        type(model_type), intent(in) :: model
        integer, intent(in) :: solver
        logical, intent(in) :: wants_reactions
        type(equations_type), intent(out) :: equations
        type(status_type), intent(inout) :: status
        type(unknown_choice), intent(in), optional :: unknown
        logical, intent(in), optional :: has_motor_laws    !! given forces come from the scene's laws, also those at motors; absent:
                                                           !! false
        type(equation_choice) :: choice

        equations%solver = solver
        equations%unknown = find_drives(model)
        if (present(unknown)) equations%unknown = unknown
        allocate (equations%lossy(0))
        if (present(has_motor_laws)) then
            if (has_motor_laws) equations%lossy = lossy_motors(model, .not. equations%unknown%drive)
        end if
        equations%rub = [model%contact, contacts_of_motors(model, equations%lossy)]
        equations%wants_reactions = wants_reactions .or. size(model%contact) > 0      ! which friction comes from
        if (solver == solver_reduced .and. wants_reactions) then
            call fail(status, status_bad_input, "solver 'reduced' has no reactions (expected another solver, or others wanted)")
            return
        else if (solver == solver_reduced .and. size(model%contact) > 0) then
            call fail(status, status_bad_input, "solver 'reduced' has no reactions, which friction at joint '" &
                      //trim(model%joint(model%contact(1)%joint)%name)//"' comes from (expected another solver)")
            return
        end if
        associate (u => equations%unknown)
            if (.not. (drives_share(model) .and. all(u%drive)) .or. any(u%acceleration)) then
                if (count(u%drive) + count(u%acceleration) /= model%n_q) then
                    call refuse_count(model, u, model%n_q - count(u%drive) - count(u%acceleration), status)
                    return
                end if
            end if
            select case (solver)
            case (solver_elimination)
                choice%way = sparsely
            case (solver_reduced)
                choice%way = by_work
            case default
                choice%way = as_lecture
            end select
            choice%drive_is_unknown = u%drive
            choice%acceleration_is_unknown = u%acceleration
        end associate
        equations%needs_columns = has_columns(model, choice)
        equations%answer = [result_driving_force, out_transmitted, result_qdd]
        if (size(model%contact) > 0) equations%answer = [equations%answer, out_press]
        if (size(model%driven) > 0) equations%answer = [equations%answer, out_driven]
        if (friction_is_shared(model)) equations%answer = [equations%answer, result_reaction, result_joint_push]
        call make_kernels(choice, equations%wants_reactions, solver == solver_gauss_jordan_plain, equations%kernels)
    end subroutine build_equations

    !> The numbers of the model have changed: kernels have to be made anew.
    subroutine renew_equations(equations, workspace)
        type(equations_type), intent(inout) :: equations
        type(equation_workspace), intent(inout) :: workspace
        type(equation_kernels), pointer :: kernels

        call workspace%free()
        call make_kernels(equations%kernels%choice, equations%kernels%wants_reactions, equations%kernels%wants_order, kernels)
        call free_kernels(equations%kernels)
        equations%kernels => kernels
    end subroutine renew_equations

    !> Kernels of all that differ from the head of a family in numbers alone, if the model is one of these. Nothing may have been
    !> solved yet.
    subroutine share_equations(model, family, equations)
        type(model_type), intent(in) :: model
        type(kernel_family), pointer, intent(in) :: family     !! null: there is none
        type(equations_type), intent(inout) :: equations

        if (associated(family) .and. associated(equations%kernels)) call join_family(model, family, equations%kernels)
    end subroutine share_equations

    !> No unknowns: motion and driving forces are given, and results follow, such as the balance of power.
    subroutine build_given_equations(model, equations)
        type(model_type), intent(in) :: model
        type(equations_type), intent(out) :: equations
        type(equation_choice) :: choice

        equations%solver = solver_none
        equations%unknown%acceleration = spread(.false., 1, model%n_q)
        equations%unknown%drive = spread(.false., 1, model%n_actuator)
        allocate (equations%lossy(0), equations%rub(0))
        equations%wants_reactions = .false.
        equations%answer = [result_driving_force, out_transmitted, result_qdd]
        choice%way = nothing_else
        choice%drive_is_unknown = equations%unknown%drive
        choice%acceleration_is_unknown = equations%unknown%acceleration
        equations%needs_columns = has_columns(model, choice)
        call make_kernels(choice, .false., .false., equations%kernels)
    end subroutine build_given_equations

    !> Give the kernels back. Nobody may be using them.
    subroutine free_equations(equations)
        type(equations_type), intent(inout) :: equations

        call free_kernels(equations%kernels)
    end subroutine free_equations

    !> No equations: where the links are and how they move, which takes no actuators.
    subroutine build_no_equations(model, equations)
        type(model_type), intent(in) :: model
        type(equations_type), intent(out) :: equations

        equations%unknown = find_drives(model)
        allocate (equations%lossy(0), equations%rub(0))
        equations%wants_reactions = .false.
        equations%are_solved = .false.
    end subroutine build_no_equations

    !> As many driving forces and accelerations must be unknown as the mechanism has freedoms.
    subroutine refuse_count(model, unknown, n_missing, status)
        type(model_type), intent(in) :: model
        type(unknown_choice), intent(in) :: unknown
        integer, intent(in) :: n_missing
        type(status_type), intent(inout) :: status

        if (any(unknown%acceleration)) then
            call fail(status, status_bad_input, "forward dynamics needs as many actuators with the law 'inverse' as " &
                      //"coordinates are driven: "//to_text(count(unknown%drive))//" actuator(s) for " &
                      //to_text(count(.not. unknown%acceleration))//" driven coordinate(s)")
        else
            call fail(status, status_bad_input, "inverse dynamics needs as many actuators as the mechanism has freedoms: " &
                      //to_text(model%n_actuator)//" actuator(s) for "//to_text(model%n_actuator + n_missing))
        end if
    end subroutine refuse_count

    ! ---------------------------------------------------------------- one block

    !> Make room for one thread.
    subroutine prepare_workspace(model, equations, workspace)
        type(model_type), intent(in) :: model
        type(equations_type), intent(in) :: equations
        type(equation_workspace), intent(out) :: workspace

        call prepare_kinematics(model, merge(model%n_q, 0, equations%needs_columns), workspace%state)
        allocate (workspace%load(lanes, 6, model%n_load), workspace%driving_force(lanes, model%n_actuator), &
                  workspace%transmitted(lanes, model%n_actuator), workspace%acceleration(lanes, model%n_q), source=0.0_wp)
        allocate (workspace%wanted(0))
        if (.not. equations%are_solved) return
        call prepare_numbers(model, takes_numbers(equations%kernels), workspace%numbers)
        call prepare_friction(size(equations%rub), size(model%driven), workspace%friction)
        allocate (workspace%sense(lanes, size(equations%lossy)), source=1.0_wp)
        allocate (workspace%motor_force(lanes, model%n_actuator), workspace%driving_rate(lanes, model%n_actuator), source=0.0_wp)
    end subroutine prepare_workspace

    !> What is asked of the unknowns from now on, beside driving forces and accelerations: ask `found_of` for it.
    subroutine want_of(workspace, wanted)
        type(equation_workspace), intent(inout) :: workspace
        integer, intent(in) :: wanted(:)                !! `result_*`, `out_*`

        if (size(workspace%wanted) == size(wanted)) then
            if (all(workspace%wanted == wanted)) return
        end if
        call workspace%free()
        workspace%wanted = wanted
    end subroutine want_of

    subroutine free(self)
        class(equation_workspace), intent(inout) :: self

        call free_lane_space(self%of_matrix)
        call free_lane_space(self%of_solving)
        call free_lane_space(self%of_sliding)
        call free_lane_space(self%of_answers)
        nullify (self%solving, self%answers)
        self%has_sliding = .false.
        self%n_loaded = 0
    end subroutine free

    !> Kinematics, assembly and solution of the block whose coordinates and loads are in the workspace.
    subroutine solve_block(model, equations, workspace)
        type(model_type), intent(in) :: model
        type(equations_type), intent(in) :: equations
        type(equation_workspace), intent(inout) :: workspace

        call evaluate_kinematics(model, workspace%state)
        if (equations%are_solved) then
            call solve_equations(model, equations, workspace)
        else
            call judge_motion(model, .false., workspace)
        end if
    end subroutine solve_block

    !> What can be said of the lanes before any force is known.
    subroutine judge_motion(model, has_forces, workspace)
        type(model_type), intent(in) :: model
        logical, intent(in) :: has_forces               !! accelerations count
        type(equation_workspace), intent(inout) :: workspace
        integer :: k

        workspace%rcond = ieee_value(1.0_wp, ieee_quiet_nan)
        workspace%error = workspace%rcond
        workspace%growth = workspace%rcond
        workspace%status = sample_ok
        where (workspace%state%singular) workspace%status = sample_singular
        workspace%is_doubtful = .false.
        if (workspace%checks_accuracy) call flag_uncertain(model, workspace)
        if (model%share%n > 0) then
            where (.not. released_fit(model, [(k, k=1, model%n_joint)], workspace%state)) workspace%status = sample_unreachable
            ! rates at a singular position tell nothing
            where (workspace%status == sample_ok .and. .not. released_joints_stay(model, workspace%state, has_forces)) &
                workspace%status = sample_unreachable
        end if
        where (workspace%state%not_converged) workspace%status = sample_not_converged
        where (workspace%state%unreachable) workspace%status = sample_unreachable
        where (workspace%state%branch_lost) workspace%status = sample_branch_lost
        if (.not. workspace%checks_input) return
        ! Also what no force depends on, such as the rates of massless links.
        call flag_not_finite(workspace%state%q, sample_unreachable, workspace%status)
        call flag_not_finite(workspace%state%qd, sample_unreachable, workspace%status)
        call flag_not_finite(workspace%state%qdd, sample_unreachable, workspace%status)
        do k = 1, model%n_load
            call flag_not_finite(workspace%load(:, :, k), sample_unreachable, workspace%status)
        end do
    end subroutine judge_motion

    !> Solution where the kinematics is up to date. Driving forces that are found are those with what the rotors take.
    subroutine solve_equations(model, equations, workspace, is_free_of_friction)
        type(model_type), intent(in) :: model
        type(equations_type), intent(in) :: equations
        type(equation_workspace), intent(inout) :: workspace
        logical, intent(in), optional :: is_free_of_friction   !! how much contacts rub is found otherwise; absent: false
        logical :: rubs

        call judge_motion(model, .true., workspace)
        workspace%n_loaded = 0
        call take_numbers(model, workspace%state, workspace%load, workspace%numbers)
        call find_sliding(model, equations, workspace)
        workspace%friction%has_slope = .false.
        where (workspace%status == sample_ok .and. workspace%state%undefined) workspace%status = sample_undefined
        workspace%status_of_motion = workspace%status
        rubs = .true.
        if (present(is_free_of_friction)) rubs = .not. is_free_of_friction
        if (rubs) then
            call solve_with_friction(model, equations, workspace)
        else
            workspace%friction%amount = 0
            workspace%state%holding = 0
            call solve_with_amounts(model, equations, workspace)
        end if
    end subroutine solve_equations

    !> The same once more, where nothing but the pushes of stops and the forces of clutches has changed.
    subroutine solve_again(model, equations, workspace)
        type(model_type), intent(in) :: model
        type(equations_type), intent(in) :: equations
        type(equation_workspace), intent(inout) :: workspace

        workspace%status = workspace%status_of_motion
        call take_pushes(workspace%state, workspace%numbers)
        call solve_with_friction(model, equations, workspace)
    end subroutine solve_again

    !> The same with as much friction as `workspace%friction%amount` says. What presses then is told.
    subroutine solve_with_amounts(model, equations, workspace)
        type(model_type), intent(in) :: model
        type(equations_type), intent(in) :: equations
        type(equation_workspace), intent(inout) :: workspace

        call take_pushes(workspace%state, workspace%numbers)
        call solve_forces(model, equations, workspace)
        call press_losses(model, equations%lossy, workspace%sense, workspace%transmitted, workspace%friction)
    end subroutine solve_with_amounts

    subroutine solve_with_friction(model, equations, workspace)
        type(model_type), intent(in) :: model
        type(equations_type), intent(in) :: equations
        type(equation_workspace), intent(inout) :: workspace

        workspace%friction%amount = 0
        workspace%state%holding = 0
        call solve_forces(model, equations, workspace)
        if (size(equations%rub) > 0) call settle_friction(model, equations, workspace)
        if (equations%solver /= solver_reduced) return
        call flag_not_finite(workspace%driving_force, sample_undefined, workspace%status)
        call flag_not_finite(workspace%acceleration, sample_undefined, workspace%status)
    end subroutine solve_with_friction

    !> Unknowns with the friction that is there, and what follows of them.
    subroutine solve_forces(model, equations, workspace)
        type(model_type), intent(in) :: model
        type(equations_type), intent(in) :: equations
        type(equation_workspace), intent(inout) :: workspace

        call apply_losses(model, equations%lossy, workspace%sense, workspace%friction, workspace%motor_force, &
                          workspace%driving_force)
        workspace%numbers%of(in_effort)%x = workspace%driving_force
        workspace%numbers%of(in_friction)%x = workspace%friction%amount(:, :size(model%contact))
        workspace%numbers%of(in_shared)%x = 0
        call solve_once(model, equations, workspace)
        if (friction_is_shared(model)) then
            call share_on_lanes(model, workspace)
            call solve_once(model, equations, workspace)   ! what presses, with what joints share
        end if
        workspace%driving_force = found_of(workspace, result_driving_force, model%n_actuator)
        workspace%transmitted = found_of(workspace, out_transmitted, model%n_actuator)
        workspace%acceleration = found_of(workspace, result_qdd, model%n_q)
        if (size(model%contact) == 0) return
        associate (n => size(model%contact))
            workspace%friction%press(:, :, :n) = reshape(found_of(workspace, out_press, n_press*n), [lanes, n_press, n])
        end associate
        if (size(model%driven) > 0) workspace%friction%driven = &
            reshape(found_of(workspace, out_driven, (n_press + 1)*size(model%driven)), shape(workspace%friction%driven))
    end subroutine solve_forces

    !> The equations with the numbers that are there.
    subroutine solve_once(model, equations, workspace)
        type(model_type), intent(in) :: model
        type(equations_type), intent(in) :: equations
        type(equation_workspace), intent(inout) :: workspace

        if (equations%solver == solver_elimination) then
            call solve_by_kernel(model, equations, workspace)
        else
            workspace%is_left = .true.
        end if
        if (any(workspace%is_left)) call solve_with_pivots(model, equations, workspace)
    end subroutine solve_once

    !> What joints share of reactions that the equations leave open, as friction feels it.
    subroutine share_on_lanes(model, workspace)
        type(model_type), intent(in) :: model
        type(equation_workspace), intent(inout) :: workspace
        real(wp), dimension(lanes, model%n_component, model%n_joint) :: before, reaction
        integer, allocatable :: column(:)
        integer :: j

        before = reshape(found_of(workspace, result_reaction, size(before)/lanes), shape(before))
        reaction = before
        call share_block(model, workspace, reaction, workspace%status)
        column = [1, 2, 3, 4, 5, 6]
        if (model%is_planar) column = [1, 2, 6]
        associate (shared => workspace%numbers%of(in_shared)%x)
            do j = 1, model%n_joint
                shared(:, 6*(j - 1) + column) = reaction(:, :, j) - before(:, :, j)
            end do
        end associate
    end subroutine share_on_lanes

    !> Reactions of the block that is solved, with what joints share of those that the equations leave open. Lanes that are not used
    !> repeat the last.
    subroutine share_block(model, workspace, reaction, status)
        type(model_type), intent(in) :: model
        type(equation_workspace), intent(in) :: workspace      !! of links that give way what joints push is wanted
                                                               !! (`wanted_to_share`)
        real(wp), intent(inout) :: reaction(:, :, :)   !! (lane, n_component, n_joint) [N, N m]
        integer, intent(inout) :: status(:)            !! `sample_*`: joints may gape (lane)
        real(wp) :: position(3, model%n_link, lanes), rotation(3, 3, model%n_link, lanes)
        real(wp), dimension(model%n_component, model%n_joint, lanes) :: shared, push
        real(wp) :: at_joints(lanes, model%n_component, model%n_joint)
        integer :: lane, l

        at_joints = 0
        if (size(model%arm) > 0) &
            at_joints = reshape(found_of(workspace, result_joint_push, size(at_joints)/lanes), shape(at_joints))
        associate (n => workspace%n_used)
            do lane = 1, n
                shared(:, :, lane) = reaction(lane, :, :)
                push(:, :, lane) = at_joints(lane, :, :)
                do l = 1, model%n_link
                    position(:, l, lane) = link_position(model, workspace%state, l, lane)
                    rotation(:, :, l, lane) = link_rotation(model, workspace%state, l, lane)
                end do
            end do
            call share_reactions(model, 1, position(:, :, :n), rotation(:, :, :, :n), status(:n), [(l, l=1, n)], &
                                 shared(:, :, :n), push(:, :, :n))
            do lane = 1, lanes
                reaction(lane, :, :) = shared(:, :, min(lane, n))
            end do
            status(n + 1:) = status(n)
        end associate
    end subroutine share_block

    !> What a block must find for its reactions to be shared afterwards.
    pure function wanted_to_share(model) result(wanted)
        type(model_type), intent(in) :: model
        integer, allocatable :: wanted(:)

        allocate (wanted(0))
        if (size(model%arm) > 0) wanted = [result_joint_push]
    end function wanted_to_share

    !> Values of a result of the block that is solved: one of those wanted.
    function found_of(workspace, id, n) result(values)
        type(equation_workspace), intent(in) :: workspace
        integer, intent(in) :: id                       !! `result_*`, `out_*`
        integer, intent(in) :: n                        !! values a sample
        real(wp) :: values(lanes, n)
        integer :: first, k

        if (.not. all(workspace%is_left)) then
            first = first_output(workspace%solving%solving, id)
            values = workspace%of_solving%found(:, first:first + n - 1)
        end if
        if (.not. any(workspace%is_left)) return
        first = first_output(workspace%answers%answers, id)
        do k = 1, n
            where (workspace%is_left) values(:, k) = workspace%of_answers%found(:, first + k - 1)
        end do
    end function found_of

    !> What is asked of the unknowns.
    pure function wanted_of(equations, workspace) result(wanted)
        type(equations_type), intent(in) :: equations
        type(equation_workspace), intent(in) :: workspace
        integer, allocatable :: wanted(:)

        wanted = [equations%answer, workspace%wanted]
    end function wanted_of

    ! ---------------------------------------------------------------- friction

    !> How contacts slide and drives turn, and whether springs have a direction.
    subroutine find_sliding(model, equations, workspace)
        type(model_type), intent(in) :: model
        type(equations_type), intent(in) :: equations
        type(equation_workspace), intent(inout) :: workspace
        integer :: first

        call begin_losses(model, equations%lossy, workspace%driving_rate, workspace%friction, workspace%sense)
        if (.not. slides_or_pulls(model)) return
        if (.not. workspace%has_sliding) call need_sliding(model, equations%kernels)
        workspace%has_sliding = .true.
        workspace%numbers%of(in_sense)%x = reshape(workspace%friction%sense(:, :, :size(model%contact)), &
                                                   [lanes, n_part*size(model%contact)])
        call run_on_lanes(equations%kernels%sliding, workspace%n_used, workspace%state, workspace%numbers, workspace%of_sliding)
        associate (lane => equations%kernels%sliding, found => workspace%of_sliding%found)
            first = first_output(lane, out_square)
            call find_factors(model%contact, found(:, first:first + size(model%contact) - 1), workspace%friction)
            first = first_output(lane, out_reach)
            workspace%state%undefined = workspace%state%undefined .or. .not. found(:, first) > 0
        end associate
    end subroutine find_sliding

    !> About the largest force at work: what drives and loads give, and what everything weighs. What comes of these and is not more
    !> than their rounding is nothing.
    pure real(wp) function forces_at_work(model, workspace, lane) result(force)
        type(model_type), intent(in) :: model
        type(equation_workspace), intent(in) :: workspace
        integer, intent(in) :: lane

        force = norm2(model%gravity)*(sum(model%link%mass) + sum(workspace%state%payload(lane, :)))
        force = max(force, maxval(abs(workspace%driving_force(lane, :))), maxval(abs(workspace%load(lane, :, :))))
    end function forces_at_work

    !> Friction that fits the reactions which it changes. Most mechanisms are rubbed little: what friction makes of the reactions
    !> is put in again until nothing changes. Where that does not come to rest soon, friction grows from zero (`balance_friction`).
    !> What drives lose is found that way at once: they are few, and a poor screw loses more than half. So is all else where it is
    !> known already what each contact does, or costs less to find than rounds.
    subroutine settle_friction(model, equations, workspace)
        type(model_type), intent(in) :: model
        type(equations_type), intent(in) :: equations
        type(equation_workspace), intent(inout) :: workspace
        real(wp), dimension(lanes, size(equations%rub)) :: force, force_before
        real(wp), dimension(lanes) :: change, change_before
        logical :: is_settled(lanes), has_come(lanes)
        integer :: n, i, lane

        is_settled = workspace%status /= sample_ok
        is_settled(workspace%n_used + 1:) = .true.
        call find_pressing_forces(model, equations, workspace, force_before)
        change_before = 1                              ! from no friction to some
        do n = 1, rounds_worth_while(model, equations, workspace)
            do i = 1, size(equations%rub)
                where (.not. is_settled) workspace%friction%amount(:, i) = workspace%friction%factor(:, i)*force_before(:, i)
            end do
            call spare_lanes_follow()
            call solve_forces(model, equations, workspace)
            call find_pressing_forces(model, equations, workspace, force)
            change = maxval(abs(force - force_before), dim=2)/max(maxval(force, dim=2), tiny(1.0_wp))
            has_come = .not. is_settled .and. has_settled(change, change_before)
            do i = 1, size(equations%rub)
                where (has_come) workspace%friction%amount(:, i) = workspace%friction%factor(:, i)*force(:, i)
            end do
            is_settled = is_settled .or. has_come
            if (all(is_settled)) then
                call spare_lanes_follow()
                call solve_forces(model, equations, workspace)
                return
            end if
            force_before = force
            change_before = change
        end do
        call continue_friction(model, equations, workspace, is_settled)
        call spare_lanes_follow()
        call solve_forces(model, equations, workspace)
        call find_pressing_forces(model, equations, workspace, force)
        do lane = 1, workspace%n_used
            if (is_settled(lane) .or. workspace%status(lane) /= sample_ok) cycle
            if (.not. rubs_as_pressed(workspace%friction%factor(lane, :), force(lane, :), workspace%friction%amount(lane, :), &
                                      forces_at_work(model, workspace, lane))) workspace%status(lane) = sample_not_converged
        end do

    contains

        !> Lanes that nobody looks at are like the last of the others, and what they give is taken for its.
        subroutine spare_lanes_follow()
            integer :: lane

            associate (friction => workspace%friction, last => workspace%n_used)
                do lane = last + 1, lanes
                    friction%amount(lane, :) = friction%amount(last, :)
                end do
            end associate
        end subroutine spare_lanes_follow
    end subroutine settle_friction

    !> Rounds of putting friction in again before what each contact does is looked at. Where joints share reactions a round costs
    !> as much as that.
    pure integer function rounds_worth_while(model, equations, workspace) result(n)
        type(model_type), intent(in) :: model
        type(equations_type), intent(in) :: equations
        type(equation_workspace), intent(in) :: workspace

        n = 0
        if (size(model%contact) == 0 .or. knows_slopes(workspace%friction, workspace%n_used)) return
        n = most_rounds
        if (friction_is_shared(model)) n = min(n, size(equations%rub) + 2)
    end function rounds_worth_while

    subroutine find_pressing_forces(model, equations, workspace, force)
        type(model_type), intent(in) :: model
        type(equations_type), intent(in) :: equations
        type(equation_workspace), intent(inout) :: workspace
        real(wp), intent(out) :: force(:, :)           !! (lane, contact) [N]

        call press_losses(model, equations%lossy, workspace%sense, workspace%transmitted, workspace%friction)
        call pressing_forces(equations%rub, workspace%friction, force)
    end subroutine find_pressing_forces

    !> The friction of lanes that are not settled, from what each contact's does to all. Where none fits, a joint holds fast.
    subroutine continue_friction(model, equations, workspace, is_settled)
        type(model_type), intent(in) :: model
        type(equations_type), intent(in) :: equations
        type(equation_workspace), intent(inout) :: workspace
        logical, intent(in) :: is_settled(lanes)
        real(wp), dimension(lanes, size(equations%rub)) :: settled, force
        real(wp), allocatable :: press(:, :, :), mesh(:, :)
        type(driven_press) :: driven
        integer :: lane

        associate (friction => workspace%friction)
            settled = friction%amount
            if (any(abs(settled) > 0)) then
                friction%amount = 0
                call solve_forces(model, equations, workspace)
            end if
            call find_pressing_forces(model, equations, workspace, force)
            press = linear_press(model%driven, friction)
            mesh = friction%driven(:, 0, :)
            driven%contact = model%driven%contact
            if (.not. knows_slopes(friction, workspace%n_used)) &
                call find_slopes(model, equations, press, mesh, maxval(force, dim=2), workspace)
            friction%amount = settled
            do lane = 1, workspace%n_used
                if (is_settled(lane) .or. workspace%status(lane) /= sample_ok) cycle
                driven%force = mesh(lane, :)
                driven%slope = friction%mesh_slope(lane, :, :)
                driven%part = friction%driven(lane, 1:, :)
                call balance_friction(equations%rub, friction%factor(lane, :), press(lane, :, :), friction%slope(lane, :, :, :), &
                                      friction%amount(lane, :), workspace%state%holding(lane), &
                                      driven)
                call flag_locked(model, equations, lane, workspace)
            end do
        end associate
    end subroutine continue_friction

    !> A lane that one of `equations%rub` holds fast, if one does: contacts are told as such, transmissions by their motors.
    subroutine flag_locked(model, equations, lane, workspace)
        type(model_type), intent(in) :: model
        type(equations_type), intent(in) :: equations
        integer, intent(in) :: lane
        type(equation_workspace), intent(inout) :: workspace

        associate (holding => workspace%state%holding(lane), n_contact => size(model%contact))
            if (holding == 0) return
            workspace%status(lane) = sample_locked
            if (holding > n_contact) holding = n_contact + equations%lossy(holding - n_contact)
        end associate
    end subroutine flag_locked

    !> What each contact's friction does to all that presses.
    subroutine find_slopes(model, equations, press, mesh, largest, workspace)
        type(model_type), intent(in) :: model
        type(equations_type), intent(in) :: equations
        real(wp), intent(in) :: press(:, :, :)         !! where nothing rubs (lane, n_press, contact) [N]
        real(wp), intent(in) :: mesh(:, :)             !! forces of teeth there (lane, model%driven) [N]
        real(wp), intent(in) :: largest(:)             !! of the forces there (lane) [N]
        type(equation_workspace), intent(inout) :: workspace
        real(wp) :: force(lanes, size(equations%rub)), one(lanes), felt(lanes, n_press, size(equations%rub))
        integer :: k, lane

        associate (friction => workspace%friction)
            do k = 1, size(equations%rub)
                ! about as much as it will be, for the digits' sake
                one = friction%factor(:, k)*largest
                friction%amount = 0
                friction%amount(:, k) = one
                call solve_forces(model, equations, workspace)
                call find_pressing_forces(model, equations, workspace, force)
                felt = linear_press(model%driven, friction)
                do lane = 1, lanes
                    friction%slope(lane, :, :, k) = (felt(lane, :, :) - press(lane, :, :))/max(one(lane), tiny(1.0_wp))
                    friction%mesh_slope(lane, :, k) = (friction%driven(lane, 0, :) - mesh(lane, :))/max(one(lane), tiny(1.0_wp))
                end do
                friction%has_slope(:, k) = one > 0
            end do
        end associate
    end subroutine find_slopes

    !> A sample whose motion or forces have lost their digits to a dead point or a change point is as good as singular,
    !> whatever the solver.
    subroutine flag_uncertain(model, workspace)
        type(model_type), intent(in) :: model
        type(equation_workspace), intent(inout) :: workspace
        logical :: is_uncertain(lanes)

        call flag_closed_forms(model, workspace%state, is_uncertain)
        workspace%is_doubtful = workspace%state%uncertainty > largest_uncertainty .and. .not. is_uncertain &
                                .and. workspace%status == sample_ok .and. .not. (workspace%state%unreachable &
                                .or. workspace%state%not_converged .or. workspace%state%branch_lost)
        where (is_uncertain .or. workspace%is_doubtful) workspace%status = sample_singular
        ! nothing is known of what has squares of speeds in it, were it as far from a singular position as may be
        where (workspace%status == sample_singular .and. .not. sum(workspace%state%qd**2, dim=2) <= huge(1.0_wp) &
               .and. all(abs(workspace%state%qd) <= huge(1.0_wp), dim=2)) workspace%status = sample_undefined
    end subroutine flag_uncertain

    !> A motion or load that is not finite has no forces, and a force that is not is none.
    pure subroutine flag_not_finite(value, outcome, status)
        real(wp), intent(in) :: value(:, :)          !! (lane, any)
        integer, intent(in) :: outcome               !! what such samples are, one of `sample_*`
        integer, intent(inout) :: status(lanes)
        real(wp) :: total(lanes)
        integer :: k

        total = 0
        do k = 1, size(value, 2)
            total = total + abs(value(:, k))
        end do
        where (status == sample_ok .and. .not. total <= huge(1.0_wp)) status = outcome
    end subroutine flag_not_finite

    ! ---------------------------------------------------------------- solvers

    !> The kernel's own elimination; lanes on which a pivot fails are left.
    subroutine solve_by_kernel(model, equations, workspace)
        type(model_type), intent(in) :: model
        type(equations_type), intent(in) :: equations
        type(equation_workspace), intent(inout) :: workspace
        integer, parameter :: forces(*) = [in_effort, in_friction, in_shared, in_stop, in_clutch]
        integer :: first

        if (.not. associated(workspace%solving)) &
            call need_solving(model, wanted_of(equations, workspace), equations%kernels, workspace%solving)
        workspace%is_left = .true.
        associate (lane => workspace%solving%solving, which => workspace%solving%solved_for)
            if (.not. lane%program%is_made) return
            if (workspace%n_loaded == workspace%n_used) then
                call run_on_lanes(lane, workspace%n_used, workspace%state, workspace%numbers, workspace%of_solving, forces)
            else
                call run_on_lanes(lane, workspace%n_used, workspace%state, workspace%numbers, workspace%of_solving)
            end if
            workspace%n_loaded = workspace%n_used
            first = first_output(lane, out_solution)
            workspace%numbers%of(in_unknown)%x(:, which) = workspace%of_solving%found(:, first:first + size(which) - 1)
            ! Written so that a NaN counts as an alarm.
            workspace%is_left = .not. workspace%of_solving%found(:, first_output(lane, out_alarm)) <= 1 &
                                .and. workspace%status == sample_ok
        end associate
    end subroutine solve_by_kernel

    !> Lanes that are left, from matrix and right-hand sides.
    subroutine solve_with_pivots(model, equations, workspace)
        type(model_type), intent(in) :: model
        type(equations_type), intent(in) :: equations
        type(equation_workspace), intent(inout) :: workspace

        if (.not. associated(workspace%answers)) &
            call need_answers(model, wanted_of(equations, workspace), equations%kernels, workspace%answers)
        if (equations%solver /= solver_none) &
            call run_on_lanes(equations%kernels%matrix, workspace%n_used, workspace%state, workspace%numbers, workspace%of_matrix)
        select case (equations%solver)
        case (solver_none)
        case (solver_gauss_jordan, solver_gauss_jordan_plain)
            call solve_by_gauss_jordan(equations, workspace)
        case (solver_reduced)
            call solve_reduced(equations, workspace)
        case default
            call solve_densely(equations, workspace)
        end select
        if (equations%solver == solver_elimination) workspace%fell_back = workspace%fell_back &
            .or. (workspace%is_left .and. workspace%status == sample_ok)    ! what is not assembled nobody solves
        call run_on_lanes(workspace%answers%answers, workspace%n_used, workspace%state, workspace%numbers, workspace%of_answers)
    end subroutine solve_with_pivots

    !> Lane by lane by LAPACK or what stands for it.
    subroutine solve_densely(equations, workspace)
        type(equations_type), intent(in) :: equations
        type(equation_workspace), intent(inout) :: workspace
        real(wp) :: rcond, error
        integer :: lane
        logical :: is_singular

        do lane = 1, workspace%n_used
            if (.not. workspace%is_left(lane) .or. workspace%status(lane) /= sample_ok) cycle
            call solve_one_densely(equations, lane, workspace, rcond, error, is_singular)
            if (workspace%status(lane) /= sample_ok) cycle
            if (is_singular) workspace%status(lane) = sample_singular
            workspace%rcond(lane) = rcond
            workspace%error(lane) = error
            workspace%numbers%of(in_unknown)%x(lane, :equations%kernels%form%n) = workspace%lane_right
        end do
    end subroutine solve_densely

    !> One lane; the solution is left in the workspace's `lane_right`. What is not finite is flagged.
    subroutine solve_one_densely(equations, lane, workspace, rcond, error, is_singular)
        type(equations_type), intent(in) :: equations
        integer, intent(in) :: lane
        type(equation_workspace), intent(inout) :: workspace
        real(wp), intent(out) :: rcond, error          !! 0 if it is not finite
        logical, intent(out) :: is_singular
        integer :: k

        rcond = 0
        error = 0
        is_singular = .false.
        associate (form => equations%kernels%form, found => workspace%of_matrix%found)
            if (.not. allocated(workspace%lane_matrix)) then   ! large systems have none to spare
                allocate (workspace%lane_matrix(form%n, form%n), workspace%lane_right(form%n))
                call workspace%dense%prepare(form%n)
            end if
            call fill_matrix(form, found(lane, :), workspace%lane_matrix)
            workspace%lane_right = 0
            do k = 1, form%n
                if (form%right(k) > 0) workspace%lane_right(k) = found(lane, form%right(k))
            end do
        end associate
        if (all(ieee_is_finite(workspace%lane_matrix)) .and. all(ieee_is_finite(workspace%lane_right))) then
            call solve_dense(workspace%dense, workspace%lane_matrix, workspace%lane_right, rcond, error, is_singular)
        else
            workspace%status(lane) = sample_undefined
        end if
    end subroutine solve_one_densely

    !> Matrix and right-hand sides of all lanes side by side.
    subroutine fill_lanes(equations, workspace, place)
        type(equations_type), intent(in) :: equations
        type(equation_workspace), intent(inout) :: workspace
        logical, intent(in) :: place                    !! rows in the order that needs no pivots
        integer :: k, row

        associate (form => equations%kernels%form, found => workspace%of_matrix%found)
            if (.not. allocated(workspace%matrix)) &
                allocate (workspace%matrix(lanes, form%n, form%n), workspace%right(lanes, form%n, 1))
            workspace%matrix = 0
            do k = 1, size(form%row)
                row = placed(form%row(k))
                if (form%output(k) == 0) then
                    workspace%matrix(:, row, form%column(k)) = form%constant(k)
                else
                    workspace%matrix(:, row, form%column(k)) = found(:, form%output(k))
                end if
            end do
            workspace%right = 0
            do k = 1, form%n
                if (form%right(k) > 0) workspace%right(:, placed(k), 1) = found(:, form%right(k))
            end do
        end associate

    contains

        pure integer function placed(row)
            integer, intent(in) :: row

            placed = row
            if (place) placed = equations%kernels%place(row)
        end function placed
    end subroutine fill_lanes

    subroutine solve_by_gauss_jordan(equations, workspace)
        type(equations_type), intent(in) :: equations
        type(equation_workspace), intent(inout) :: workspace
        real(wp) :: least(lanes, 2)
        logical :: is_singular(lanes), is_plain

        is_plain = equations%solver == solver_gauss_jordan_plain
        call fill_lanes(equations, workspace, is_plain)
        associate (n => equations%kernels%form%n)
            call solve_gauss_jordan(n, 1, workspace%matrix, workspace%right, workspace%growth, is_singular, &
                                    pivoting=.not. is_plain, least=least)
            workspace%numbers%of(in_unknown)%x(:, :n) = workspace%right(:, :, 1)
        end associate
        ! half of the digits went where nobody could choose another pivot
        if (is_plain) is_singular = is_singular .or. workspace%growth < sqrt(epsilon(1.0_wp))
        where (is_singular .and. workspace%status == sample_ok) workspace%status = sample_singular
        call judge_small_pivots(equations, least, workspace)
    end subroutine solve_by_gauss_jordan

    !> Where a pivot is so small that rounding may have made it, the dense solver's condition number says whether the sample is
    !> singular: one rule for all solvers. That takes all rows and columns for as large as each other: one that is nothing but
    !> rounding is told by its size.
    subroutine judge_small_pivots(equations, least, workspace)
        type(equations_type), intent(in) :: equations
        real(wp), intent(in) :: least(lanes, 2)        !! pivot, over the largest entry of its column, and of the matrix
        type(equation_workspace), intent(inout) :: workspace
        real(wp) :: rcond, error
        logical :: is_singular
        integer :: lane

        do lane = 1, workspace%n_used
            if (minval(least(lane, :)) > sqrt(epsilon(1.0_wp)) .or. workspace%status(lane) /= sample_ok) cycle
            call solve_one_densely(equations, lane, workspace, rcond, error, is_singular)
            is_singular = is_singular .or. least(lane, 2) <= epsilon(1.0_wp)
            if (is_singular .and. workspace%status(lane) == sample_ok) workspace%status(lane) = sample_singular
        end do
    end subroutine judge_small_pivots

    !> Virtual work. Where accelerations alone are unknown their matrix, minus the mass matrix, is symmetric.
    subroutine solve_reduced(equations, workspace)
        type(equations_type), intent(in) :: equations
        type(equation_workspace), intent(inout) :: workspace
        real(wp) :: least(lanes, 2)
        logical :: is_singular(lanes)

        least = 1
        call fill_lanes(equations, workspace, .false.)
        associate (n => equations%kernels%form%n)
            if (all(equations%unknown%acceleration)) then
                workspace%matrix = -workspace%matrix
                workspace%right = -workspace%right
                call solve_cholesky(n, workspace%matrix, workspace%right(:, :, 1), is_singular)
            else
                call solve_gauss_jordan(n, 1, workspace%matrix, workspace%right, workspace%growth, is_singular, least=least)
            end if
            workspace%numbers%of(in_unknown)%x(:, :n) = workspace%right(:, :, 1)
        end associate
        where (is_singular .and. workspace%status == sample_ok) workspace%status = sample_singular
        call judge_small_pivots(equations, least, workspace)
    end subroutine solve_reduced
end module linkdyn_equations
