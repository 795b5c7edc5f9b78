!> The equations of motion on one block of lanes and their solvers, all fed by the one assembler.
!>
!> Per freedom either a driving force or the acceleration of a coordinate is unknown: inverse dynamics asks for all
!> driving forces, forward dynamics for all accelerations, and any mix is solved alike.
!>
!> `gauss-jordan`: the lecture's dense method on the lecture's equations; `gauss-jordan-plain`: without pivoting, rows put in
!> order once, for comparison only. `lapack`: dense with equilibration and
!> refinement on the same equations. `elimination`: the planned sparse elimination, the default. `reduced`: virtual
!> work, as many equations as coordinates, no reactions.
module linkdyn_equations
    use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan, ieee_is_finite
    use linkdyn_acceleration_columns, only: acceleration_columns, append_accelerations, drop_drives, mark_applied, &
        assemble_accelerations
    use linkdyn_applied_wrenches, only: clear_applied, apply_drive, apply_springs, apply_load_laws
    use linkdyn_base_forces, only: apply_base
    use linkdyn_payload_forces, only: find_payloads
    use linkdyn_assembly, only: assemble_matrix, assemble_right
    use linkdyn_assembly_trail, only: sample_assembly, make_room, keep_lane
    use linkdyn_cholesky, only: solve_cholesky
    use linkdyn_contact, only: contact_type, has_settled, most_rounds
    use linkdyn_constants, only: golden
    use linkdyn_dense, only: dense_workspace, solve_dense
    use linkdyn_dyad_map, only: is_surely_certain
    use linkdyn_elimination_plan, only: elimination_plan, sparse_system, make_plan
    use linkdyn_elimination_run, only: run_plan, load_constants
    use linkdyn_formulation, only: formulation_type, build_formulation, style_lecture, style_sparse
    use linkdyn_friction_balance, only: balance_friction
    use linkdyn_gauss_jordan, only: solve_gauss_jordan
    use linkdyn_joint_friction, only: friction_space, prepare_friction, view_contacts, press_contacts, pressing_forces, &
        apply_friction
    use linkdyn_joint_rates, only: actuator_columns, work_columns
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state, prepare_kinematics, link_position, link_rotation
    use linkdyn_lane_count, only: lanes
    use linkdyn_led_mechanism, only: evaluate_kinematics, measure_margins, n_map
    use linkdyn_mass_matrix, only: mass_matrix
    use linkdyn_measures, only: find_laws
    use linkdyn_model, only: model_type, is_dyad, has_rotors, gives_attitude, attitude_angles, drives_share
    use linkdyn_motion, only: evaluate_motion
    use linkdyn_motion_measures, only: released_fit
    use linkdyn_planar_pass, only: uncertainty_of_dyad
    use linkdyn_reactions, only: solution_type, unknown, collect_reactions
    use linkdyn_rotors, only: apply_rotors, add_rotor_mass, rotor_accelerations
    use linkdyn_row_order, only: order_rows
    use linkdyn_scene, only: n_stop, has_hard_stops, n_clutch, share_refused
    use linkdyn_shared_drives, only: share_drives
    use linkdyn_slots, only: slot_store, make_slots
    use linkdyn_status, only: status_type, fail, status_bad_input, sample_ok, sample_unreachable, &
        sample_singular, sample_not_converged, sample_branch_lost, sample_undefined, sample_locked
    use linkdyn_text, only: to_text
    use linkdyn_transmission_losses, only: lossy_motors, contacts_of_motors, begin_losses, press_losses, apply_losses
    use linkdyn_uncertainty, only: largest_uncertainty
    implicit none (type, external)
    private
    public :: equations_type, equation_workspace, unknown_choice, find_drives, build_equations, &
        build_no_equations
    public :: prepare_workspace, solve_block, solve_equations, sample_system, choose_poses, fill_lane_matrix
    public :: solver_gauss_jordan, solver_lapack, solver_elimination, solver_reduced, solver_name, choose_solver
    public :: solver_gauss_jordan_plain

    integer, parameter :: solver_gauss_jordan = 1, solver_lapack = 2, solver_elimination = 3, solver_reduced = 4
    integer, parameter :: solver_gauss_jordan_plain = 5
    character(len=18), parameter :: solver_name(5) = &
        [character(len=18) :: "gauss-jordan", "lapack", "elimination", "reduced", "gauss-jordan-plain"]

    integer, parameter :: n_wanted_pose = 32    !! that stand for the scene

    !> What is unknown; the rest is given.
    type :: unknown_choice
        logical, allocatable :: acceleration(:)         !! of the coordinates (n_q)
        logical, allocatable :: drive(:)                !! driving forces (n_actuator)
    end type unknown_choice

    !> Equations ready to be solved: constant, shared by all threads.
    type :: equations_type
        integer :: solver = solver_elimination
        logical :: wants_reactions = .true.
        logical :: needs_world = .false.                !! angular rates in world axes of all links
        logical :: needs_columns = .false.              !! acceleration columns, though no equation needs them
        logical :: are_solved = .true.                  !! false: there are none, only the links' motion is wanted
        logical, allocatable :: rotor_acts(:)           !! (motor) its rotor has inertia, and its driving force is given
        integer, allocatable :: lossy(:)                !! motors whose torque is given and whose transmission loses some of it
        type(contact_type), allocatable :: rub(:)       !! contacts of joints, then these transmissions
        logical :: shares_drives = .false.              !! there are more drives than freedoms: these come first, then the reactions
        type(unknown_choice) :: unknown
        type(formulation_type) :: formulation
        type(acceleration_columns) :: accelerations
        type(elimination_plan) :: plan
        integer, allocatable :: place(:)                !! of each row in the matrix of the plain method (n_row)
    end type equations_type

    !> Scratch and results of one block, one per thread.
    type :: equation_workspace
        type(kinematic_state) :: state
        type(slot_store) :: slot
        integer :: n_used = lanes                       !! lanes that anyone looks at: others are not handed to the dense solver
        logical :: checks_accuracy = .true.             !! false: a sample near a dead point is taken as it comes
        logical :: checks_input = .true.                !! false: motion and loads are known to be finite
        real(wp), allocatable :: load(:, :, :)          !! (lane, 6, n_load)
        real(wp), allocatable :: matrix(:, :, :)        !! dense solvers: (lane, row, column)
        real(wp), allocatable :: right(:, :, :)         !! (lane, row, 1)
        real(wp), allocatable :: lane_matrix(:, :), lane_right(:)
        type(dense_workspace) :: dense
        ! ---- RESULTS
        type(solution_type) :: solution                 !! points into the slots
        real(wp), allocatable :: driving_force(:, :)    !! (lane, n_actuator), in where given
        real(wp), allocatable :: motor_force(:, :)      !! in: what lossy motors give at their joint variables (lane, n_actuator)
        real(wp), allocatable :: driving_rate(:, :)     !! in: rates of these (lane, n_actuator)
        real(wp), allocatable :: acceleration(:, :)     !! of the coordinates: what is given, plus what is solved for (lane, n_q)
        real(wp), allocatable :: rotor_acceleration(:, :)   !! of driven joint variables, 0 without inertia there (lane, n_motor)
        integer :: status(lanes) = sample_ok
        real(wp) :: rcond(lanes) = 0, error(lanes) = 0  !! NaN where the solver has none
        real(wp) :: growth(lanes) = 0                   !! reciprocal pivot growth (gauss-jordan)
        logical :: fell_back(lanes) = .false.           !! the plan handed the lane to the dense solver
        type(friction_space) :: friction
        real(wp), allocatable :: sense(:, :)            !! of joint variables with lossy motors: +1, -1 (lane, lossy motor)
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
        call fail(status, status_bad_input, "solver '"//trim(text)//"' is not known (expected gauss-jordan, lapack, " &
                  //"elimination, reduced or gauss-jordan-plain)")
    end subroutine choose_solver

    !> Inverse dynamics: all driving forces are unknown, all accelerations given.
    pure function find_drives(model) result(unknown)
        type(model_type), intent(in) :: model
        type(unknown_choice) :: unknown

        allocate (unknown%acceleration(model%n_q), unknown%drive(model%n_actuator))
        unknown%acceleration = .false.
        unknown%drive = .true.
    end function find_drives

    !> Choose the formulation and, for the elimination, make the plan. Nothing said of the unknowns: inverse dynamics.
    subroutine build_equations(model, solver, wants_reactions, equations, status, unknown, has_motor_laws)
        type(model_type), intent(in) :: model
        integer, intent(in) :: solver
        logical, intent(in) :: wants_reactions
        type(equations_type), intent(out) :: equations
        type(status_type), intent(inout) :: status
        type(unknown_choice), intent(in), optional :: unknown
        logical, intent(in), optional :: has_motor_laws    !! given forces come from the scene's laws, also those at motors; absent: false

        equations%solver = solver
        equations%unknown = find_drives(model)
        if (present(unknown)) equations%unknown = unknown
        if (.not. present(unknown)) call share_among_drives(model, equations)
        equations%rotor_acts = model%motor%inertia > 0 .and. .not. equations%unknown%drive(model%motor%actuator) &
                               .and. .not. equations%shares_drives
        allocate (equations%lossy(0))
        if (present(has_motor_laws)) then
            if (has_motor_laws) equations%lossy = lossy_motors(model, .not. equations%unknown%drive)
        end if
        equations%rub = [model%contact, contacts_of_motors(model, equations%lossy)]
        equations%wants_reactions = wants_reactions .or. size(model%contact) > 0      ! which friction comes from
        equations%needs_world = size(model%scene%spring) > 0 .or. size(model%scene%laws%law) > 0 .or. size(model%contact) > 0 &
                                .or. equations%shares_drives .or. has_rotors(model) &
                                .or. (solver == solver_reduced .and. .not. all(model%leg%is_carried))
        if (solver == solver_reduced .and. wants_reactions) then
            call fail(status, status_bad_input, "solver 'reduced' has no reactions (expected another solver, or others wanted)")
            return
        else if (solver == solver_reduced .and. size(model%contact) > 0) then
            call fail(status, status_bad_input, "solver 'reduced' has no reactions, which friction at joint '" &
                      //trim(model%joint(model%contact(1)%joint)%name)//"' comes from (expected another solver)")
            return
        end if
        call build_formulation(model, merge(style_sparse, style_lecture, solver == solver_elimination), &
                               equations%formulation)
        call drop_drives(model, .not. equations%unknown%drive, equations%formulation)
        call mark_applied(model, .not. equations%unknown%drive, equations%formulation)
        call append_accelerations(model, equations%unknown%acceleration, equations%rotor_acts, equations%formulation, &
                                  equations%accelerations)
        if (equations%formulation%n_unknown /= model%n_row) then
            call refuse_count(model, equations%unknown, model%n_row - equations%formulation%n_unknown, status)
            return
        end if
        if (solver == solver_elimination) call plan_elimination(model, equations)
        if (solver == solver_gauss_jordan_plain) call put_in_order(model, equations)
    end subroutine build_equations

    !> More drives than freedoms: with driving forces that are known, reactions and accelerations are found, these as given.
    pure subroutine share_among_drives(model, equations)
        type(model_type), intent(in) :: model
        type(equations_type), intent(inout) :: equations

        equations%shares_drives = drives_share(model)
        if (.not. equations%shares_drives) return
        equations%unknown%drive = .false.
        equations%unknown%acceleration = .true.
    end subroutine share_among_drives

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

    !> Columns of the kinematics that the equations need.
    pure integer function n_column_of(model, equations)
        type(model_type), intent(in) :: model
        type(equations_type), intent(in) :: equations

        n_column_of = 0
        if (equations%solver == solver_reduced .or. any(equations%unknown%acceleration) .or. equations%needs_columns) &
            n_column_of = model%n_q
    end function n_column_of

    ! ---------------------------------------------------------------- the plan

    !> Values at representative poses, then the plan.
    subroutine plan_elimination(model, equations)
        type(model_type), intent(in) :: model
        type(equations_type), intent(inout) :: equations
        type(sparse_system) :: system

        call sample_system(model, equations, system)
        if (size(system%value, 1) == 0) return
        associate (formulation => equations%formulation)
            system%is_wanted = equations%wants_reactions
            system%is_wanted(pack(formulation%drive_column, formulation%drive_column > 0)) = .true.
            system%is_wanted(pack(equations%accelerations%column, equations%accelerations%column > 0)) = .true.
        end associate
        call make_plan(system, equations%plan)
    end subroutine plan_elimination

    !> An order of rows that serves the representative poses.
    subroutine put_in_order(model, equations)
        type(model_type), intent(in) :: model
        type(equations_type), intent(inout) :: equations
        type(sparse_system) :: system

        call sample_system(model, equations, system)
        equations%place = order_rows(system)
    end subroutine put_in_order

    !> The equations with values at representative poses; all unknowns are wanted.
    subroutine sample_system(model, equations, system)
        type(model_type), intent(in) :: model
        type(equations_type), intent(in) :: equations
        type(sparse_system), intent(out) :: system
        type(kinematic_state) :: state
        type(slot_store) :: slot
        real(wp) :: value(lanes, size(equations%formulation%entry))
        real(wp), allocatable :: good(:, :)
        integer :: block, lane, k, n_good, attempt
        logical :: is_clear(lanes)

        call prepare_kinematics(model, n_column_of(model, equations), state)
        call make_slots(equations%formulation%n_slot + 1, slot)
        allocate (good(n_wanted_pose, size(value, 2)))
        n_good = 0
        do attempt = 1, 2
            call collect(must_be_clear=attempt == 1)
            if (n_good > 0) exit
        end do
        call slot%free()
        associate (formulation => equations%formulation)
            system%n = formulation%n_unknown
            system%row = formulation%entry%row
            system%column = formulation%entry%column
            system%slot = formulation%entry%slot
            system%value = good(:n_good, :)
            system%right_slot = [(merge(formulation%n_slot + k, 0, formulation%row_has_right(k)), k=1, model%n_row)]
            system%is_wanted = spread(.true., 1, system%n)
        end associate

    contains

        subroutine collect(must_be_clear)
            logical, intent(in) :: must_be_clear

            do block = 1, 8*n_wanted_pose/lanes + 8
                call representative_poses(model, block, state)
                call evaluate_kinematics(model, state)
                call assemble_matrix(model, equations%formulation, state, slot%value)
                call assemble_accelerations(model, equations%formulation, equations%accelerations, state, slot%value)
                do k = 1, size(value, 2)
                    associate (entry => equations%formulation%entry(k))
                        value(:, k) = entry%value
                        if (entry%slot > 0) value(:, k) = slot%value(:, entry%slot)
                    end associate
                end do
                is_clear = .not. state%unreachable
                if (must_be_clear) is_clear = is_clear .and. stands_clear(model, state)
                do lane = 1, lanes
                    if (.not. (is_clear(lane) .and. all(ieee_is_finite(value(lane, :))))) cycle
                    n_good = n_good + 1
                    good(n_good, :) = value(lane, :)
                    if (n_good == n_wanted_pose) return
                end do
            end do
        end subroutine collect
    end subroutine sample_system

    !> Are all dyads away from their change points, and attitudes from the poles of their angles? A pose beside one stands for
    !> nothing but itself: no pivot that is good elsewhere is good there, least of all where several dyads come to theirs at once.
    function stands_clear(model, state) result(is_clear)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        logical :: is_clear(lanes)
        real(wp), parameter :: least_sine = 0.1_wp     !! of the angle between the rods of a dyad, or two axes of angles: a digit
        real(wp), dimension(lanes, n_map(model)) :: margin, drift
        integer :: i

        call measure_margins(model, state, margin, drift)
        is_clear = all(abs(margin(:, :model%n_branch)) >= least_sine, dim=2)
        do i = 1, size(model%step)
            if (.not. gives_attitude(model, model%step(i))) cycle
            associate (angle => attitude_angles(model%step(i)))
                is_clear = is_clear .and. abs(cos(state%q(:, angle(2)))) >= least_sine
            end associate
        end do
    end function stands_clear

    !> Poses that stand for the scene, at which all loops close; of a batch's own, if none of the others does.
    subroutine choose_poses(model, batch, pose, assembly, stand)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: batch(:, :)                     !! (n_q, n)
        real(wp), allocatable, intent(out) :: pose(:, :)        !! (n_q, at most n_wanted_pose)
        type(sample_assembly), intent(out) :: assembly          !! there
        real(wp), intent(out) :: stand(:, :, 0:)                !! axes and origins of the links at the first (3, 4, 0:n_link)
        type(kinematic_state) :: state
        integer :: block, first, lane, attempt

        allocate (pose(model%n_q, 0))
        call make_room(model, n_wanted_pose, assembly)
        stand = spread(reshape([1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp], &
                               [3, 4]), 3, 1 + model%n_link)
        call prepare_kinematics(model, 0, state)
        do attempt = 1, 2
            do block = 1, 8*n_wanted_pose/lanes + 8
                call representative_poses(model, block, state)
                call add_poses(must_be_clear=attempt == 1)
                if (size(pose, 2) == n_wanted_pose) return
            end do
            if (size(pose, 2) > 0) return
        end do
        do block = 1, 8*n_wanted_pose/lanes + 8
            first = 1 + (block - 1)*lanes
            if (first > size(batch, 2)) exit
            state%q = transpose(batch(:, [(min(first + lane, size(batch, 2)), lane=0, lanes - 1)]))
            call add_poses(must_be_clear=.false.)
            if (size(pose, 2) == n_wanted_pose) return
        end do

    contains

        subroutine add_poses(must_be_clear)
            logical, intent(in) :: must_be_clear
            logical :: is_clear(lanes)
            integer :: lane

            call evaluate_kinematics(model, state)
            is_clear = .not. (state%unreachable .or. state%not_converged .or. state%singular)
            if (must_be_clear) is_clear = is_clear .and. stands_clear(model, state)
            do lane = 1, lanes
                if (.not. is_clear(lane)) cycle
                if (size(pose, 2) == n_wanted_pose) return
                if (size(pose, 2) == 0) call note_stand(lane)
                pose = reshape([pose, state%q(lane, :)], [model%n_q, size(pose, 2) + 1])
                call keep_lane(model, state, lane, size(pose, 2), assembly)
            end do
        end subroutine add_poses

        subroutine note_stand(lane)
            integer, intent(in) :: lane
            integer :: i

            do i = 1, model%n_link
                stand(:, :3, i) = link_rotation(model, state, i, lane)
                stand(:, 4, i) = link_position(model, state, i, lane)
            end do
        end subroutine note_stand
    end subroutine choose_poses

    !> A block of poses that stand for the scene: its motion, and for every other pose a step away from it, so that
    !> no entry is small merely because the motion is special.
    subroutine representative_poses(model, block, state)
        type(model_type), intent(in) :: model
        integer, intent(in) :: block
        type(kinematic_state), intent(inout) :: state
        real(wp), parameter :: turn_step = 0.4_wp, length_step = 0.1_wp               !! [rad], [part of the scene's size]
        real(wp) :: q(model%n_q, 1), qd(model%n_q, 1), qdd(model%n_q, 1), load(6, model%n_load, 1), t(1), step, number
        integer :: lane, k

        do lane = 1, lanes
            number = real((block - 1)*lanes + lane, wp)
            t = model%scene%time%first + modulo(number*golden, 1.0_wp)*(model%scene%time%last - model%scene%time%first)
            call evaluate_motion(model, t, q, qd, qdd, load)
            do k = 1, model%n_q
                state%q(lane, k) = q(k, 1)
                if (modulo((block - 1)*lanes + lane, 2) == 1) cycle
                step = turn_step
                if (model%scene%coordinate(k)%unit == "m") step = length_step*scene_size(model)
                state%q(lane, k) = q(k, 1) + step*(2*modulo(number*golden*(k + 1) + 0.37_wp*k, 1.0_wp) - 1)
            end do
        end do
        state%qd = 0
        state%qdd = 0
    end subroutine representative_poses

    !> A length typical of the scene: the largest distance of a marker from the origin of its link.
    pure real(wp) function scene_size(model)
        type(model_type), intent(in) :: model
        integer :: j, side

        scene_size = 0
        do j = 1, model%n_joint
            do side = 1, 2
                scene_size = max(scene_size, norm2(model%joint(j)%point(:, side)))
            end do
        end do
    end function scene_size

    ! ---------------------------------------------------------------- one block

    !> Make room for one thread.
    subroutine prepare_workspace(model, equations, workspace)
        type(model_type), intent(in) :: model
        type(equations_type), intent(in) :: equations
        type(equation_workspace), intent(out) :: workspace
        integer :: n

        n = equations%formulation%n_unknown
        call prepare_kinematics(model, n_column_of(model, equations), workspace%state)
        workspace%state%has_applied = equations%are_solved .and. &
                                      (size(model%scene%spring) + size(model%belt) + size(model%scene%laws%law) > 0 &
                                       .or. model%scene%base%moves .or. has_hard_stops(model%scene) .or. n_clutch(model%scene) > 0 &
                                       .or. size(model%contact) > 0 &
                                       .or. .not. all(equations%unknown%drive))
        workspace%state%world_rates = equations%needs_world
        workspace%state%carries_legs = equations%solver == solver_reduced .and. .not. has_rotors(model)
        if (equations%are_solved) call place_solution(model, equations, workspace)
        allocate (workspace%load(lanes, 6, model%n_load), workspace%driving_force(lanes, model%n_actuator), &
                  workspace%acceleration(lanes, model%n_q), workspace%rotor_acceleration(lanes, size(model%motor)))
        workspace%rotor_acceleration = 0
        workspace%driving_force = 0
        workspace%load = 0
        if (.not. equations%are_solved) return
        if (size(equations%rub) > 0) call prepare_friction(model, size(equations%rub), workspace%friction)
        allocate (workspace%sense(lanes, size(equations%lossy)), workspace%motor_force(lanes, model%n_actuator), &
                  workspace%driving_rate(lanes, model%n_actuator))
        workspace%sense = 1
        workspace%motor_force = 0
        workspace%driving_rate = 0
        select case (equations%solver)
        case (solver_gauss_jordan, solver_gauss_jordan_plain)
            allocate (workspace%matrix(lanes, n, n), workspace%right(lanes, n, 1))
        case (solver_lapack)
            call prepare_dense(n, workspace)
        case (solver_reduced)
            allocate (workspace%matrix(lanes, model%n_q, model%n_q), workspace%right(lanes, model%n_q, 1))
        end select
    end subroutine prepare_workspace

    !> Room for dense solution; the elimination asks for it when the first lane falls back, since large systems have none
    !> to spare.
    subroutine prepare_dense(n, workspace)
        integer, intent(in) :: n
        type(equation_workspace), intent(inout) :: workspace

        allocate (workspace%lane_matrix(n, n), workspace%lane_right(n))
        call workspace%dense%prepare(n)
    end subroutine prepare_dense

    !> Slots for entries, right-hand sides, the plan's intermediate values; the unknowns stand where the plan leaves
    !> them, or behind everything else.
    subroutine place_solution(model, equations, workspace)
        type(model_type), intent(in) :: model
        type(equations_type), intent(in) :: equations
        type(equation_workspace), intent(inout) :: workspace
        integer :: n, n_given, k

        n = equations%formulation%n_unknown
        n_given = equations%formulation%n_slot + model%n_row
        if (equations%plan%is_complete) then
            call make_slots(max(n_given, equations%plan%n_slot), workspace%slot)
            call load_constants(equations%plan, workspace%slot%value)
            workspace%solution%slot = equations%plan%solution_slot
            workspace%solution%sign = equations%plan%solution_sign
        else
            call make_slots(n_given + n, workspace%slot)
            workspace%solution%slot = [(n_given + k, k=1, n)]
            workspace%solution%sign = [(1.0_wp, k=1, n)]
        end if
        workspace%solution%value => workspace%slot%value
    end subroutine place_solution

    subroutine free(self)
        class(equation_workspace), intent(inout) :: self

        self%solution%value => null()
        call self%slot%free()
    end subroutine free

    !> Store the dense solution of one lane.
    subroutine store_lane(solution, lane, x)
        type(solution_type), intent(inout) :: solution
        integer, intent(in) :: lane
        real(wp), intent(in) :: x(:)
        integer :: k

        do k = 1, size(x)
            if (solution%slot(k) > 0) solution%value(lane, solution%slot(k)) = solution%sign(k)*x(k)
        end do
    end subroutine store_lane

    !> Kinematics, assembly and solution of the block whose coordinates and loads are in the workspace.
    subroutine solve_block(model, equations, workspace)
        type(model_type), intent(in) :: model
        type(equations_type), intent(in) :: equations
        type(equation_workspace), intent(inout) :: workspace

        call evaluate_kinematics(model, workspace%state)
        if (equations%are_solved) then
            call solve_equations(model, equations, workspace)
        else
            call judge_motion(model, workspace)
        end if
    end subroutine solve_block

    !> What can be said of the lanes before any force is known.
    subroutine judge_motion(model, workspace)
        type(model_type), intent(in) :: model
        type(equation_workspace), intent(inout) :: workspace
        integer :: k

        workspace%rcond = ieee_value(1.0_wp, ieee_quiet_nan)
        workspace%error = workspace%rcond
        workspace%growth = workspace%rcond
        workspace%status = sample_ok
        where (workspace%state%singular) workspace%status = sample_singular
        if (workspace%checks_accuracy) call flag_uncertain(model, workspace)
        if (model%share%n > 0) then
            where (.not. released_fit(model, [(k, k=1, model%n_joint)], workspace%state)) workspace%status = sample_unreachable
        end if
        where (workspace%state%not_converged) workspace%status = sample_not_converged
        where (workspace%state%unreachable) workspace%status = sample_unreachable
        where (workspace%state%branch_lost) workspace%status = sample_branch_lost
        if (.not. workspace%checks_input) return
        ! Also what no force depends on, such as the rates of massless links.
        call flag_not_finite(workspace%state%q, workspace%status)
        call flag_not_finite(workspace%state%qd, workspace%status)
        call flag_not_finite(workspace%state%qdd, workspace%status)
        do k = 1, model%n_load
            call flag_not_finite(workspace%load(:, :, k), workspace%status)
        end do
    end subroutine judge_motion

    !> Assembly and solution where the kinematics is up to date. Driving forces that are found are those with what the rotors take.
    subroutine solve_equations(model, equations, workspace)
        type(model_type), intent(in) :: model
        type(equations_type), intent(in) :: equations
        type(equation_workspace), intent(inout) :: workspace
        integer :: i

        call find_unknowns(model, equations, workspace)
        if (.not. has_rotors(model)) return
        call rotor_accelerations(model, workspace%state, workspace%acceleration - workspace%state%qdd, workspace%rotor_acceleration)
        do i = 1, size(model%motor)
            associate (a => model%motor(i)%actuator)
                if (.not. equations%rotor_acts(i)) workspace%driving_force(:, a) = workspace%driving_force(:, a) &
                    + model%motor(i)%inertia*workspace%rotor_acceleration(:, i)
            end associate
        end do
    end subroutine solve_equations

    subroutine find_unknowns(model, equations, workspace)
        type(model_type), intent(in) :: model
        type(equations_type), intent(in) :: equations
        type(equation_workspace), intent(inout) :: workspace

        call judge_motion(model, workspace)
        call find_payloads(model, workspace%state)
        if (workspace%state%has_applied) then
            if (size(equations%rub) > 0) call begin_friction(model, equations, workspace)
            call apply_known_forces(model, equations, workspace)
            where (workspace%status == sample_ok .and. workspace%state%undefined) workspace%status = sample_undefined
        end if
        if (equations%shares_drives) then
            call drive_together(model, workspace)
            workspace%acceleration = workspace%state%qdd
            if (equations%solver == solver_reduced .or. .not. equations%wants_reactions) return
        end if
        call solve_forces(model, equations, workspace)
        if (size(equations%rub) > 0) call settle_friction(model, equations, workspace)
        if (equations%solver /= solver_reduced) return
        call flag_not_finite(workspace%driving_force, workspace%status)
        call flag_not_finite(workspace%acceleration, workspace%status)
    end subroutine find_unknowns

    !> Assembly and solution with the forces applied to the links.
    subroutine solve_forces(model, equations, workspace)
        type(model_type), intent(in) :: model
        type(equations_type), intent(in) :: equations
        type(equation_workspace), intent(inout) :: workspace
        integer :: k

        workspace%acceleration = workspace%state%qdd
        if (equations%solver == solver_reduced) then
            call solve_reduced(model, equations%unknown, equations%rotor_acts, workspace)
            return
        end if
        associate (formulation => equations%formulation)
            call assemble_matrix(model, formulation, workspace%state, workspace%slot%value)
            call assemble_accelerations(model, formulation, equations%accelerations, workspace%state, workspace%slot%value)
            call assemble_right(model, formulation, workspace%state, workspace%load, formulation%n_slot, workspace%slot%value)
            select case (equations%solver)
            case (solver_gauss_jordan)
                call solve_by_gauss_jordan(model, formulation, [(k, k=1, model%n_row)], .true., workspace)
            case (solver_gauss_jordan_plain)
                call solve_by_gauss_jordan(model, formulation, equations%place, .false., workspace)
            case (solver_lapack)
                do k = 1, workspace%n_used
                    if (workspace%status(k) == sample_ok) call solve_lane(model, formulation, workspace, k)
                end do
            case default
                call solve_by_plan(model, equations, workspace)
            end select
            do k = 1, model%n_actuator
                if (equations%unknown%drive(k)) &
                    workspace%driving_force(:, k) = unknown(workspace%solution, formulation%drive_column(k))
            end do
            if (equations%shares_drives) return            ! accelerations are those given
            do k = 1, model%n_q
                if (.not. equations%unknown%acceleration(k)) cycle
                workspace%acceleration(:, k) = workspace%acceleration(:, k) &
                                               + unknown(workspace%solution, equations%accelerations%column(k))
            end do
        end associate
    end subroutine solve_forces

    ! ---------------------------------------------------------------- friction

    !> How contacts slide and drives turn; none of them rubs yet but for what is viscous.
    subroutine begin_friction(model, equations, workspace)
        type(model_type), intent(in) :: model
        type(equations_type), intent(in) :: equations
        type(equation_workspace), intent(inout) :: workspace

        if (size(model%contact) > 0) call view_contacts(model, workspace%state, workspace%friction)
        call begin_losses(model, equations%lossy, workspace%driving_rate, workspace%friction, workspace%sense)
        workspace%friction%amount = 0
        workspace%state%holding = 0
    end subroutine begin_friction

    !> Friction that fits the reactions which it changes. Most mechanisms are rubbed little: what friction makes of the reactions
    !> is put in again until nothing changes. Where that does not come to rest soon, friction grows from zero (`balance_friction`). What
    !> drives lose is found that way at once: they are few, and a poor screw loses more than half.
    subroutine settle_friction(model, equations, workspace)
        type(model_type), intent(in) :: model
        type(equations_type), intent(in) :: equations
        type(equation_workspace), intent(inout) :: workspace
        real(wp), parameter :: misfit = 1e-6_wp
        real(wp), dimension(lanes, size(equations%rub)) :: force, force_before
        real(wp), dimension(lanes) :: change, change_before
        logical :: is_settled(lanes), has_come(lanes)
        integer :: n, i, lane

        is_settled = workspace%status /= sample_ok
        is_settled(workspace%n_used + 1:) = .true.
        call find_pressing_forces(model, equations, workspace, force_before)
        change_before = 1                              ! from no friction to some
        do n = 1, merge(most_rounds, 0, size(model%contact) > 0)
            do i = 1, size(equations%rub)
                where (.not. is_settled) workspace%friction%amount(:, i) = workspace%friction%at(i)%factor*force_before(:, i)
            end do
            call spare_lanes_follow()
            call solve_again(model, equations, workspace)
            call find_pressing_forces(model, equations, workspace, force)
            change = maxval(abs(force - force_before), dim=2)/max(maxval(force, dim=2), tiny(1.0_wp))
            has_come = .not. is_settled .and. has_settled(change, change_before)
            do i = 1, size(equations%rub)
                where (has_come) workspace%friction%amount(:, i) = workspace%friction%at(i)%factor*force(:, i)
            end do
            is_settled = is_settled .or. has_come
            if (all(is_settled)) then
                call spare_lanes_follow()
                call solve_again(model, equations, workspace)
                return
            end if
            force_before = force
            change_before = change
        end do
        call continue_friction(model, equations, workspace, is_settled)
        call spare_lanes_follow()
        call solve_again(model, equations, workspace)
        call find_pressing_forces(model, equations, workspace, force)
        do i = 1, size(equations%rub)
            do lane = 1, workspace%n_used
                if (is_settled(lane) .or. workspace%status(lane) /= sample_ok) cycle
                associate (found => workspace%friction%at(i)%factor(lane)*force(lane, i))
                    if (.not. abs(found - workspace%friction%amount(lane, i)) <= misfit*max(found, &
                        workspace%friction%at(i)%factor(lane)*maxval(force(lane, :)))) workspace%status(lane) = sample_not_converged
                end associate
            end do
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

    !> Solve with the present friction.
    subroutine solve_again(model, equations, workspace)
        type(model_type), intent(in) :: model
        type(equations_type), intent(in) :: equations
        type(equation_workspace), intent(inout) :: workspace

        call apply_known_forces(model, equations, workspace)
        call solve_forces(model, equations, workspace)
    end subroutine solve_again

    subroutine find_pressing_forces(model, equations, workspace, force)
        type(model_type), intent(in) :: model
        type(equations_type), intent(in) :: equations
        type(equation_workspace), intent(inout) :: workspace
        real(wp), intent(out) :: force(:, :)           !! (lane, contact) [N]

        if (size(model%contact) > 0) then
            call collect_reactions(model, equations%formulation, workspace%state, workspace%solution, workspace%friction%reaction)
            call press_contacts(model, workspace%friction)
        end if
        if (size(equations%lossy) > 0) then
            call rotor_accelerations(model, workspace%state, workspace%acceleration - workspace%state%qdd, &
                                     workspace%rotor_acceleration)
            call press_losses(model, equations%lossy, workspace%sense, workspace%driving_force, workspace%rotor_acceleration, &
                              workspace%friction)
        end if
        call pressing_forces(equations%rub, workspace%friction, force)
    end subroutine find_pressing_forces

    !> The friction of lanes that are not settled, from what each contact's does to all. Where none fits, a joint holds fast.
    subroutine continue_friction(model, equations, workspace, is_settled)
        type(model_type), intent(in) :: model
        type(equations_type), intent(in) :: equations
        type(equation_workspace), intent(inout) :: workspace
        logical, intent(in) :: is_settled(lanes)
        real(wp), dimension(lanes, size(equations%rub)) :: settled, force
        real(wp), dimension(lanes) :: largest, one
        real(wp), allocatable :: press(:, :, :), slope(:, :, :, :)
        real(wp) :: factor(size(equations%rub))
        integer :: i, k, lane

        associate (n => size(equations%rub), friction => workspace%friction)
            settled = friction%amount
            allocate (slope(lanes, size(friction%press, 2), n, n))
            if (any(abs(settled) > 0)) then
                friction%amount = 0
                call solve_again(model, equations, workspace)
            end if
            call find_pressing_forces(model, equations, workspace, force)
            press = friction%press
            largest = maxval(force, dim=2)
            do k = 1, n
                ! about as much as it will be, for the digits' sake
                one = friction%at(k)%factor*largest
                friction%amount = 0
                friction%amount(:, k) = one
                call solve_again(model, equations, workspace)
                call find_pressing_forces(model, equations, workspace, force)
                do lane = 1, lanes
                    slope(lane, :, :, k) = (friction%press(lane, :, :) - press(lane, :, :))/max(one(lane), tiny(1.0_wp))
                end do
            end do
            friction%amount = settled
            do lane = 1, workspace%n_used
                if (is_settled(lane) .or. workspace%status(lane) /= sample_ok) cycle
                factor = [(friction%at(i)%factor(lane), i=1, n)]
                call balance_friction(equations%rub, factor, press(lane, :, :), slope(lane, :, :, :), friction%amount(lane, :), &
                                      workspace%state%holding(lane))
                if (workspace%state%holding(lane) == 0) cycle
                workspace%status(lane) = sample_locked
                associate (holding => workspace%state%holding(lane), n_contact => size(model%contact))
                    if (holding > n_contact) holding = n_contact + equations%lossy(holding - n_contact)
                end associate
            end do
        end associate
    end subroutine continue_friction

    !> Springs, laws over the state and given driving forces become wrenches on the links.
    subroutine apply_known_forces(model, equations, workspace)
        type(model_type), intent(in) :: model
        type(equations_type), intent(in) :: equations
        type(equation_workspace), intent(inout) :: workspace
        integer :: i

        call clear_applied(model, workspace%state)
        call find_laws(model, workspace%state)
        call apply_springs(model, workspace%state)
        call apply_load_laws(model, workspace%state)
        call apply_base(model, workspace%state)
        do i = 1, n_stop(model%scene)
            associate (stop => model%scene%stop(i))
                if (stop%is_hard) call apply_drive(model, stop%joint, stop%variable, &
                                                   -stop%side*workspace%state%stop_force(:, i), workspace%state)
            end associate
        end do
        call apply_clutches(model, workspace%state)
        if (size(model%contact) > 0) call apply_friction(model, workspace%friction, workspace%state)
        if (equations%shares_drives) return                ! nobody knows yet what drives apply
        if (any(equations%rotor_acts)) call apply_rotors(model, equations%rotor_acts, workspace%state)
        call apply_losses(model, equations%lossy, workspace%sense, workspace%friction, workspace%motor_force, &
                          workspace%driving_force)
        do i = 1, model%n_actuator
            if (.not. equations%unknown%drive(i)) call apply_actuator(model, i, workspace)
        end do
    end subroutine apply_known_forces

    !> What clutches pass on: at their first joint variable, and over the ratio back at the second.
    subroutine apply_clutches(model, state)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(inout) :: state
        integer :: i

        do i = 1, n_clutch(model%scene)
            associate (clutch => model%scene%clutch(i), force => state%clutch_force(:, i))
                call apply_drive(model, clutch%joint(1), clutch%variable(1), force, state)
                if (clutch%n_side == 2) &
                    call apply_drive(model, clutch%joint(2), clutch%variable(2), -clutch%ratio*force, state)
            end associate
        end do
    end subroutine apply_clutches

    subroutine apply_actuator(model, i, workspace)
        type(model_type), intent(in) :: model
        integer, intent(in) :: i
        type(equation_workspace), intent(inout) :: workspace

        associate (spec => model%scene%actuator(i))
            call apply_drive(model, spec%joint, spec%variable, workspace%driving_force(:, i), workspace%state)
        end associate
    end subroutine apply_actuator

    !> What drives apply that share the work.
    subroutine drive_together(model, workspace)
        type(model_type), intent(in) :: model
        type(equation_workspace), intent(inout) :: workspace
        logical :: is_singular(lanes)
        integer :: i

        call share_drives(model, workspace%state, workspace%load, workspace%driving_force, is_singular)
        where (is_singular .and. workspace%status == sample_ok) workspace%status = sample_singular
        call flag_not_finite(workspace%driving_force, workspace%status)
        do i = 1, model%n_actuator
            call apply_actuator(model, i, workspace)
        end do
    end subroutine drive_together

    !> A sample whose motion or forces have lost their digits to a dead point or a change point is as good as singular,
    !> whatever the solver.
    subroutine flag_uncertain(model, workspace)
        type(model_type), intent(in) :: model
        type(equation_workspace), intent(inout) :: workspace
        integer :: i

        where (workspace%state%uncertainty > largest_uncertainty) workspace%status = sample_singular
        do i = 1, size(model%step)
            if (.not. is_dyad(model%step(i)%kind)) cycle
            if (all(is_surely_certain(workspace%state%plane%dyad(model%step(i)%first)))) cycle
            where (uncertainty_of_dyad(model, model%step(i), workspace%state%plane) > largest_uncertainty) &
                workspace%status = sample_singular
        end do
    end subroutine flag_uncertain

    !> A motion or load that is not finite has no forces.
    pure subroutine flag_not_finite(value, status)
        real(wp), intent(in) :: value(:, :)          !! (lane, any)
        integer, intent(inout) :: status(lanes)
        real(wp) :: total(lanes)
        integer :: k

        total = 0
        do k = 1, size(value, 2)
            total = total + abs(value(:, k))
        end do
        where (status == sample_ok .and. .not. total <= huge(1.0_wp)) status = sample_unreachable
    end subroutine flag_not_finite

    subroutine solve_by_plan(model, equations, workspace)
        type(model_type), intent(in) :: model
        type(equations_type), intent(in) :: equations
        type(equation_workspace), intent(inout) :: workspace
        real(wp) :: alarm(lanes)
        integer :: lane

        alarm = huge(1.0_wp)
        if (equations%plan%is_complete) call run_plan(equations%plan, workspace%slot%value, alarm)
        if (all(alarm <= 1)) return
        do lane = 1, workspace%n_used
            ! Written so that a NaN counts as an alarm.
            if (alarm(lane) <= 1 .or. workspace%status(lane) /= sample_ok) cycle
            call solve_lane(model, equations%formulation, workspace, lane)
            workspace%fell_back(lane) = .true.
        end do
    end subroutine solve_by_plan

    !> One lane by the dense solver, from the same slots.
    subroutine solve_lane(model, formulation, workspace, lane)
        type(model_type), intent(in) :: model
        type(formulation_type), intent(in) :: formulation
        type(equation_workspace), intent(inout) :: workspace
        integer, intent(in) :: lane
        logical :: is_singular
        integer :: k

        if (.not. allocated(workspace%lane_matrix)) call prepare_dense(formulation%n_unknown, workspace)
        call fill_lane_matrix(formulation, workspace%slot%value, lane, workspace%lane_matrix)
        workspace%lane_right = 0
        do k = 1, model%n_row
            if (formulation%row_has_right(k)) &
                workspace%lane_right(k) = workspace%slot%value(lane, formulation%n_slot + k)
        end do
        if (.not. all(ieee_is_finite(workspace%lane_matrix)) .or. .not. all(ieee_is_finite(workspace%lane_right))) then
            workspace%status(lane) = sample_unreachable
            return
        end if
        call solve_dense(workspace%dense, workspace%lane_matrix, workspace%lane_right, workspace%rcond(lane), &
                         workspace%error(lane), is_singular)
        if (is_singular) workspace%status(lane) = sample_singular
        call store_lane(workspace%solution, lane, workspace%lane_right)
    end subroutine solve_lane

    !> The matrix of one lane, from its slots.
    pure subroutine fill_lane_matrix(formulation, slot, lane, matrix)
        type(formulation_type), intent(in) :: formulation
        real(wp), intent(in) :: slot(lanes, *)
        integer, intent(in) :: lane
        real(wp), intent(out) :: matrix(:, :)
        integer :: k

        matrix = 0
        do k = 1, size(formulation%entry)
            associate (entry => formulation%entry(k))
                matrix(entry%row, entry%column) = entry%value
                if (entry%slot > 0) matrix(entry%row, entry%column) = slot(lane, entry%slot)
            end associate
        end do
    end subroutine fill_lane_matrix

    subroutine solve_by_gauss_jordan(model, formulation, place, pivoting, workspace)
        type(model_type), intent(in) :: model
        type(formulation_type), intent(in) :: formulation
        integer, intent(in) :: place(:)                 !! of each row in the matrix
        logical, intent(in) :: pivoting
        type(equation_workspace), intent(inout) :: workspace
        logical :: is_singular(lanes)
        integer :: k

        workspace%matrix = 0
        do k = 1, size(formulation%entry)
            associate (entry => formulation%entry(k))
                if (entry%slot == 0) then
                    workspace%matrix(:, place(entry%row), entry%column) = entry%value
                else
                    workspace%matrix(:, place(entry%row), entry%column) = workspace%slot%value(:, entry%slot)
                end if
            end associate
        end do
        workspace%right = 0
        do k = 1, model%n_row
            if (formulation%row_has_right(k)) workspace%right(:, place(k), 1) = &
                workspace%slot%value(:, formulation%n_slot + k)
        end do
        call solve_gauss_jordan(formulation%n_unknown, 1, workspace%matrix, workspace%right, workspace%growth, is_singular, &
                                pivoting=pivoting)
        do k = 1, formulation%n_unknown
            workspace%slot%value(:, workspace%solution%slot(k)) = workspace%right(:, k, 1)
        end do
        where (is_singular .and. workspace%status == sample_ok) workspace%status = sample_singular
    end subroutine solve_by_gauss_jordan

    !> Virtual work, one equation per coordinate: (actuators' Jacobian)^T unknown driving forces - mass matrix * unknown
    !> accelerations = work of given inertia, gravity, loads and given driving forces.
    subroutine solve_reduced(model, unknown, rotor_acts, workspace)
        type(model_type), intent(in) :: model
        type(unknown_choice), intent(in) :: unknown
        logical, intent(in) :: rotor_acts(:)               !! (motor)
        type(equation_workspace), intent(inout) :: workspace
        real(wp) :: jacobian(lanes, model%n_actuator, model%n_q), mass(lanes, model%n_q, model%n_q)
        logical :: is_singular(lanes)
        integer :: i, n

        call work_columns(model, workspace%state, workspace%load, workspace%right(:, :, 1))
        if (any(unknown%acceleration)) then
            call mass_matrix(model, workspace%state, mass)
            call add_rotor_mass(model, rotor_acts, workspace%state, mass)
        end if
        if (all(unknown%acceleration)) then
            workspace%right = -workspace%right
            call solve_cholesky(model%n_q, mass, workspace%right(:, :, 1), is_singular)
            workspace%acceleration = workspace%acceleration + workspace%right(:, :, 1)
        else
            call actuator_columns(model, workspace%state, jacobian)
            n = 0
            do i = 1, model%n_actuator
                if (unknown%drive(i)) call add_column(jacobian(:, i, :))
            end do
            do i = 1, model%n_q
                if (unknown%acceleration(i)) call add_column(-mass(:, :, i))
            end do
            call solve_gauss_jordan(model%n_q, 1, workspace%matrix, workspace%right, workspace%growth, is_singular)
            n = 0
            do i = 1, model%n_actuator
                if (unknown%drive(i)) call take_solution(workspace%driving_force(:, i))
            end do
            do i = 1, model%n_q
                if (.not. unknown%acceleration(i)) cycle
                call take_solution(workspace%acceleration(:, i))
                workspace%acceleration(:, i) = workspace%acceleration(:, i) + workspace%state%qdd(:, i)
            end do
        end if
        where (is_singular .and. workspace%status == sample_ok) workspace%status = sample_singular

    contains

        subroutine add_column(column)
            real(wp), intent(in) :: column(lanes, model%n_q)

            n = n + 1
            workspace%matrix(:, :, n) = column
        end subroutine add_column

        subroutine take_solution(value)
            real(wp), intent(out) :: value(lanes)

            n = n + 1
            value = workspace%right(:, n, 1)
        end subroutine take_solution
    end subroutine solve_reduced
end module linkdyn_equations
