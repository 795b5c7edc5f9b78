!> One design of a sweep, planned, with the scratch of one thread.
module linkdyn_sweep_design
    use, intrinsic :: iso_fortran_env, only: int64
    use linkdyn_result_kinds, only: result_contact_force, result_driving_force, result_driving_position, &
        result_driving_speed, result_joint_rate, result_joint_variable, result_pressure_angle, result_reaction, &
        result_transmission_force
    use linkdyn_builder, only: build_model
    use linkdyn_inverse, only: inverse_options, inverse_results, inverse_solver, prepare_inverse
    use linkdyn_kinds, only: wp
    use linkdyn_lock, only: hold_texts_to_lend, release_texts
    use linkdyn_model, only: model_type
    use linkdyn_motion, only: evaluate_loads
    use linkdyn_pose_measures, only: pose_measures, prepare_pose_measures
    use linkdyn_scene, only: scene_type
    use linkdyn_status, only: status_type, fail, status_bad_input
    use linkdyn_representatives, only: is_worth_own_record
    use linkdyn_sweep_plan, only: sweep_plan, axis_values
    use linkdyn_sweep_quantities, only: quantity_row
    use linkdyn_sweep_source, only: design_source
    use linkdyn_sweep_spec, only: sweep_spec, axis_time, needs_forces, quantity_driving_force, quantity_driving_position, &
        quantity_driving_speed, quantity_driving_power, quantity_reaction, quantity_reaction_force, quantity_reaction_moment, &
        quantity_contact_force, quantity_pressure_angle, &
        quantity_joint_variable, quantity_joint_rate, quantity_motor_torque, quantity_motor_speed, quantity_motor_power, &
        quantity_motor_current, quantity_torque_margin
    use linkdyn_text, only: quoted
    implicit none (type, external)
    private
    public :: sweep_design, sample_batch, open_design, close_design

    integer, parameter :: small_batch = 512     !! samples whose motion and results stay in the second cache
    integer, parameter :: large_batch = 4096    !! where loops are closed by iteration, samples share the way from the start

    !> Motion and loads of some samples.
    type :: sample_batch
        real(wp), allocatable :: q(:, :), qd(:, :), qdd(:, :)   !! (n_q, sample)
        real(wp), allocatable :: load(:, :, :)                  !! (6, n_load, sample)
        real(wp), allocatable :: t(:)                           !! [s] (sample)
    end type sample_batch

    type :: sweep_design
        integer(int64) :: number = -1                   !! of the design, from 0; -1: none
        type(status_type) :: status                     !! why it is no mechanism
        type(model_type) :: model
        type(inverse_solver), pointer :: motion => null()    !! kinematics alone, for bounds that need no forces
        type(inverse_solver), pointer :: forces => null()
        logical :: owns_solvers = .false.               !! false: they are those of another thread
        logical :: is_recorded = .false.                !! there are samples enough for records
        type(pose_measures) :: measures
        logical :: needs_motion = .false.               !! joint variables or rates
        logical :: needs_forces = .false.
        logical :: excludes_early = .false.             !! a bound may leave poses out before forces are computed
        logical :: follows_motion = .false.             !! an axis is the time
        ! ---- SCRATCH: a batch of samples
        integer :: room = 0                             !! samples
        type(sample_batch) :: batch, chosen             !! all, and those of them whose forces are computed
        type(inverse_results) :: of_motion, of_forces
        integer, allocatable :: code(:)                 !! (sample) see `linkdyn_sweep_totals`
        logical, allocatable :: counts(:)               !! (sample) it takes part in the reductions
        integer, allocatable :: which(:)                !! samples that are chosen
        integer(int64), allocatable :: cell(:)          !! (sample) of the map
        integer(int64), allocatable :: place(:, :)      !! along the groups of the plan (sample, group)
        real(wp), allocatable :: axis(:, :)             !! (sample, axis)
        real(wp), allocatable :: value(:, :)            !! (entry, sample)
        real(wp), allocatable :: of_pose(:, :)          !! (entry, pose)
        integer, allocatable :: pose_status(:)
    end type sweep_design

contains

    !> Read, plan and make room. What another thread has planned of it is shared.
    subroutine open_design(spec, plan, row, source, solver, number, design, like)
        type(sweep_spec), intent(in) :: spec
        type(sweep_plan), intent(in) :: plan
        type(quantity_row), intent(in) :: row
        class(design_source), intent(in) :: source
        integer, intent(in) :: solver                   !! one of `solver_*`
        integer(int64), intent(in) :: number            !! from 0
        type(sweep_design), intent(inout) :: design
        type(sweep_design), intent(in), optional :: like     !! the same design
        type(scene_type) :: scene

        call close_design(design)
        design%number = number
        if (present(like)) then
            design%status = like%status
            design%model = like%model
        else
            ! several threads open designs at once
            call hold_texts_to_lend()
            call source%make(axis_values(plan, number*plan%n_pose), scene, design%status)
            if (design%status%is_ok()) call build_model(scene, design%model, design%status, like=source%first)
            call release_texts()
        end if
        if (design%status%is_ok()) call plan_design(spec, plan, row, design)
        if (design%status%is_ok()) then
            if (present(like)) then
                design%motion => like%motion
                design%forces => like%forces
            else
                call plan_equations(plan, row, source, solver, design)
            end if
        end if
        if (design%status%is_ok()) call make_room(plan, row, design)
    end subroutine open_design

    !> What has to be computed.
    subroutine plan_design(spec, plan, row, design)
        type(sweep_spec), intent(in) :: spec
        type(sweep_plan), intent(in) :: plan
        type(quantity_row), intent(in) :: row
        type(sweep_design), intent(inout) :: design
        integer :: b, i

        design%needs_motion = any(row%place([quantity_driving_position, quantity_driving_speed, quantity_joint_variable, &
                                             quantity_joint_rate]) > 0)
        design%needs_forces = row%n_early < row%n
        do b = 1, size(spec%bound)
            associate (bound => spec%bound(b))
                if (.not. (needs_forces(bound%quantity) .or. bound%is_limit)) design%excludes_early = .true.
            end associate
        end do
        do i = 1, size(plan%axis)
            design%follows_motion = design%follows_motion .or. plan%axis(i)%spec%kind == axis_time
        end do
        design%is_recorded = is_worth_own_record(design%model, plan%n_pose)
        call prepare_pose_measures(spec, row, design%model, design%measures)
    end subroutine plan_design

    !> Plan by which equations a design is solved. The map of forces has none of its own, but there must be as many actuators as
    !> freedoms.
    subroutine plan_equations(plan, row, source, solver, design)
        type(sweep_plan), intent(in) :: plan
        type(quantity_row), intent(in) :: row
        class(design_source), intent(in) :: source
        integer, intent(in) :: solver
        type(sweep_design), intent(inout) :: design
        type(inverse_options) :: options

        allocate (design%motion, design%forces)
        design%owns_solvers = .true.
        options%solver = solver
        options%n_expected = int(min(plan%n_pose, int(huge(1), int64)))
        options%by_record = design%is_recorded
        options%family => source%family
        if (design%needs_forces .or. design%measures%wants_map) call prepare_inverse(design%model, options, &
            any(row%place([quantity_reaction, quantity_reaction_force, quantity_reaction_moment, quantity_contact_force]) > 0), &
            design%forces, &
            design%status)
        if (design%measures%wants_map .and. design%model%n_actuator > design%model%n_q) call fail(design%status, status_bad_input, &
            "actuator "//quoted(design%model%scene%actuator(design%model%n_actuator)%name)//": there are more actuators than " &
            //"coordinates: quantities of the map between both (condition, determinant, amplifications) are not known then")
        options%wants_forces = .false.
        if (design%status%is_ok()) call prepare_inverse(design%model, options, .false., design%motion, design%status)
    end subroutine plan_equations

    subroutine make_room(plan, row, design)
        type(sweep_plan), intent(in) :: plan
        type(quantity_row), intent(in) :: row
        type(sweep_design), intent(inout) :: design

        associate (model => design%model, n => design%room)
            n = merge(small_batch, large_batch, size(model%group) == 0)
            n = int(min(int(n, int64), plan%chunk, plan%n_pose))
            call make_batch(model, n, design%batch)
            call make_resting(model, design%batch)
            if (design%excludes_early) call make_batch(model, n, design%chosen)
            allocate (design%code(n), design%counts(n), design%which(n), design%cell(n))
            allocate (design%place(n, size(plan%group)), design%axis(n, size(plan%axis)))
            allocate (design%value(row%n, n), source=0.0_wp)
            if (design%measures%are_wanted) allocate (design%of_pose(row%n_early, n), design%pose_status(n))
        end associate
        call make_targets(row, design)
    end subroutine make_room

    subroutine make_batch(model, n, batch)
        type(model_type), intent(in) :: model
        integer, intent(in) :: n
        type(sample_batch), intent(out) :: batch

        allocate (batch%q(model%n_q, n), batch%qd(model%n_q, n), batch%qdd(model%n_q, n), batch%load(6, model%n_load, n), &
                  batch%t(n))
    end subroutine make_batch

    !> A coordinate that no axis varies rests at its start; loads are those of the first instant.
    subroutine make_resting(model, batch)
        type(model_type), intent(in) :: model
        type(sample_batch), intent(inout) :: batch
        integer :: s

        call evaluate_loads(model, [model%scene%time%first], batch%load(:, :, :1))
        do s = 1, size(batch%q, 2)
            batch%q(:, s) = model%scene%coordinate%start_position
            batch%load(:, :, s) = batch%load(:, :, 1)
        end do
        batch%qd = 0
        batch%qdd = 0
        batch%t = model%scene%time%first
    end subroutine make_resting

    !> Where results of a batch go. Motion alone is asked for if it may exclude a pose, or if there are no forces.
    subroutine make_targets(row, design)
        type(quantity_row), intent(in) :: row
        type(sweep_design), intent(inout) :: design
        logical :: is_apart, wants_motors

        is_apart = design%excludes_early .or. .not. design%needs_forces
        associate (model => design%model, n => design%room)
            if (is_apart .and. design%needs_motion) then
                allocate (design%of_motion%status(n))
                call add_motion(row, model, n, design%of_motion)
            end if
            if (.not. design%needs_forces) return
            allocate (design%of_forces%status(n))
            if (.not. is_apart) call add_motion(row, model, n, design%of_forces)
            wants_motors = any(row%place([quantity_motor_torque, quantity_motor_speed, quantity_motor_power, &
                                          quantity_motor_current, quantity_torque_margin]) > 0)
            call want(result_transmission_force, wants_motors)
            call want(result_driving_speed, row%place(quantity_driving_power) > 0 .or. wants_motors)
            call want(result_driving_force, any(row%place([quantity_driving_force, quantity_driving_power]) > 0) .or. wants_motors)
            call want(result_reaction, any(row%place([quantity_reaction, quantity_reaction_force, quantity_reaction_moment]) > 0))
            call want(result_contact_force, row%place(quantity_contact_force) > 0)
            call want(result_pressure_angle, row%place(quantity_pressure_angle) > 0)
        end associate

    contains

        subroutine want(id, is_wanted)
            integer, intent(in) :: id                   !! one of `result_*`
            logical, intent(in) :: is_wanted

            if (is_wanted) call design%of_forces%add(design%model, id, design%room)
        end subroutine want
    end subroutine make_targets

    !> Room for joint variables and rates.
    subroutine add_motion(row, model, n, results)
        type(quantity_row), intent(in) :: row
        type(model_type), intent(in) :: model
        integer, intent(in) :: n                        !! samples
        type(inverse_results), intent(inout) :: results

        if (row%place(quantity_joint_variable) > 0) call results%add(model, result_joint_variable, n)
        if (row%place(quantity_joint_rate) > 0) call results%add(model, result_joint_rate, n)
        if (row%place(quantity_driving_position) > 0) call results%add(model, result_driving_position, n)
        if (row%place(quantity_driving_speed) > 0) call results%add(model, result_driving_speed, n)
    end subroutine add_motion

    !> Give everything back.
    subroutine close_design(design)
        type(sweep_design), intent(inout) :: design

        if (design%number < 0) return
        if (design%owns_solvers) then
            call design%motion%free()
            call design%forces%free()
            deallocate (design%motion, design%forces)
        end if
        call free_targets(design%of_motion)
        call free_targets(design%of_forces)
        call forget(design)

    contains

        !> To a fresh one: the components are deallocated on the way in.
        subroutine forget(old)
            type(sweep_design), intent(out) :: old

            old%number = -1
        end subroutine forget
    end subroutine close_design

    subroutine free_targets(results)
        type(inverse_results), intent(inout) :: results

        if (associated(results%status)) deallocate (results%status)
        call results%free()
    end subroutine free_targets
end module linkdyn_sweep_design
