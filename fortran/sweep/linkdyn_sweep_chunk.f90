!> One chunk of a sweep: from numbers of samples to totals, batch by batch in the cache. Nothing but what is reduced or
!> kept is computed.
!>
!> Forces and motion of a batch are found as those of any other batch are (`run_prepared`), by the record of the scene where it
!> has one.
module linkdyn_sweep_chunk
    use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan
    use, intrinsic :: iso_fortran_env, only: int64
    use linkdyn_result_kinds, only: result_contact_force, result_driving_force, result_driving_position, &
        result_driving_speed, result_joint_rate, result_joint_variable, result_pressure_angle, result_reaction, &
        result_transmission_force
    use linkdyn_finite, only: all_are_finite
    use linkdyn_interrupt, only: is_interrupted
    use linkdyn_inverse, only: inverse_results, inverse_solver, motion_batch, motion_of, run_prepared, part_of_results
    use linkdyn_kinds, only: wp
    use linkdyn_model, only: model_type
    use linkdyn_motion, only: evaluate_motion
    use linkdyn_pose_measures, only: measure_poses, belongs_to_pose
    use linkdyn_motor_laws, only: available_torque
    use linkdyn_motor_loads, only: motor_torque
    use linkdyn_status, only: sample_ok, sample_undefined
    use linkdyn_sweep_design, only: sweep_design, sample_batch, open_design
    use linkdyn_sweep_map, only: sweep_map, map_part, find_cells, start_part, add_to_part
    use linkdyn_sweep_plan, only: sweep_plan, axis_columns, axis_values
    use linkdyn_sweep_quantities, only: quantity_row, quantity_type
    use linkdyn_sweep_source, only: design_source
    use linkdyn_sweep_spec, only: sweep_spec, bound_spec, axis_coordinate, axis_rate, axis_acceleration, axis_load, axis_time, &
        quantity_driving_force, quantity_driving_position, quantity_driving_speed, quantity_driving_power, &
        quantity_reaction, quantity_reaction_force, quantity_reaction_moment, quantity_joint_variable, quantity_joint_rate, &
        quantity_motor_torque, quantity_motor_speed, quantity_motor_power, quantity_motor_current, &
        quantity_torque_margin, quantity_contact_force, quantity_pressure_angle, needs_forces
    use linkdyn_sweep_totals, only: totals_type, totals_shape, bins_type, empty_totals, reduce_samples, join_totals, &
        code_feasible, code_no_model, first_bound
    use linkdyn_value_rows, only: copy_rows, multiply_rows, take_lengths
    implicit none (type, external)
    private
    public :: reduce_chunk, kept_chunk, make_records, ready_design, look_at_samples

    !> What is kept of every sample of a chunk.
    type :: kept_chunk
        integer :: n = 0
        integer, allocatable :: code(:)                 !! (sample)
        real(wp), allocatable :: axis(:, :)             !! (axis, sample)
        real(wp), allocatable :: value(:, :)            !! (kept entry, sample)
        type(map_part) :: map
    end type kept_chunk

contains

    !> Open a design, unless it is open already.
    !>
    !> Records are made from its first samples, whichever sample comes first, so that nothing hangs on that.
    subroutine ready_design(spec, plan, row, source, solver, number, design)
        type(sweep_spec), intent(in) :: spec
        type(sweep_plan), intent(in) :: plan
        type(quantity_row), intent(in) :: row
        class(design_source), intent(in) :: source
        integer, intent(in) :: solver                   !! one of `solver_*`
        integer(int64), intent(in) :: number            !! from 0
        type(sweep_design), intent(inout) :: design

        if (design%number == number) return
        call open_design(spec, plan, row, source, solver, number, design)
        if (design%status%is_ok() .and. design%is_recorded) &
            call look_at_samples(spec, plan, row, number*plan%n_pose, design%room, design)
    end subroutine ready_design

    !> Reduce the samples of one chunk of the open design. When the process is told to stop nothing of it can be used.
    subroutine reduce_chunk(spec, plan, row, shape, bins, map, keep, first, n, design, totals, kept)
        type(sweep_spec), intent(in) :: spec
        type(sweep_plan), intent(in) :: plan
        type(quantity_row), intent(in) :: row
        type(totals_shape), intent(in) :: shape
        type(bins_type), intent(in) :: bins
        type(sweep_map), intent(in) :: map
        integer, intent(in) :: keep(:)                  !! entries to be kept
        integer(int64), intent(in) :: first             !! number of the first sample, from 0
        integer, intent(in) :: n
        type(sweep_design), intent(inout) :: design
        type(totals_type), intent(out) :: totals
        type(kept_chunk), intent(inout) :: kept         !! room for `n` samples, or none
        type(totals_type) :: part
        integer :: done, n_here

        call empty_totals(shape, totals)
        if (map%is_wanted) call start_part(size(row%quantity), n, kept%map)
        if (.not. design%status%is_ok()) then
            totals%first_sample = first
            totals%n_sample = n
            totals%n_code(code_no_model) = n
            if (allocated(kept%code)) call keep_nothing(plan, first, n, kept)
            return
        end if
        do done = 0, n - 1, design%room
            if (is_interrupted()) exit
            n_here = min(design%room, n - done)
            call fill_batch(plan, first + done, n_here, design)
            call evaluate_batch(spec, plan, row, first + done, n_here, design)
            if (allocated(kept%code)) call keep_batch(spec, row, keep, done, n_here, design, kept)
            associate (code => design%code(:n_here), counts => design%counts(:n_here))
                if (map%is_wanted) then
                    call find_cells(map, design%place(:n_here, :), design%number, design%cell(:n_here))
                    call add_to_part(row, n_here, design%value, design%cell, counts, code == code_feasible, kept%map)
                end if
                call reduce_samples(shape, bins, n_here, design%value, code, counts, first + done, plan%n_line, part)
            end associate
            call join_totals(part, plan%n_line, totals)
        end do
    end subroutine reduce_chunk

    !> Evaluate some samples of the open design: what is found stands in the design's scratch.
    subroutine look_at_samples(spec, plan, row, first, n, design)
        type(sweep_spec), intent(in) :: spec
        type(sweep_plan), intent(in) :: plan
        type(quantity_row), intent(in) :: row
        integer(int64), intent(in) :: first             !! sample, from 0
        integer, intent(in) :: n                        !! samples, at most a batch
        type(sweep_design), intent(inout) :: design

        call fill_batch(plan, first, n, design)
        call evaluate_batch(spec, plan, row, first, n, design)
    end subroutine look_at_samples

    ! ---------------------------------------------------------------- what is kept

    subroutine keep_batch(spec, row, keep, done, n, design, kept)
        type(sweep_spec), intent(in) :: spec
        type(quantity_row), intent(in) :: row
        integer, intent(in) :: keep(:)
        integer, intent(in) :: done                     !! samples of the chunk before these
        integer, intent(in) :: n
        type(sweep_design), intent(in) :: design
        type(kept_chunk), intent(inout) :: kept
        real(wp) :: nan
        integer :: s

        nan = ieee_value(1.0_wp, ieee_quiet_nan)
        kept%code(done + 1:done + n) = design%code(:n)
        kept%axis(:, done + 1:done + n) = transpose(design%axis(:n, :))
        do s = 1, n
            associate (value => kept%value(:, done + s), code => design%code(s))
                value = design%value(keep, s)
                if (code == code_feasible) cycle
                if (code < first_bound) then
                    value = nan
                else if (is_excluded_early(spec%bound(code - first_bound + 1))) then
                    where (keep > row%n_early) value = nan         ! its forces were not computed
                end if
            end associate
        end do
    end subroutine keep_batch

    !> Keep nothing of a design that is no mechanism.
    subroutine keep_nothing(plan, first, n, kept)
        type(sweep_plan), intent(in) :: plan
        integer(int64), intent(in) :: first             !! number of the first sample, from 0
        integer, intent(in) :: n
        type(kept_chunk), intent(inout) :: kept
        integer :: s

        do s = 1, n
            kept%axis(:, s) = axis_values(plan, first + s - 1)
        end do
        kept%code(:n) = code_no_model
        kept%value(:, :n) = ieee_value(1.0_wp, ieee_quiet_nan)
    end subroutine keep_nothing

    !> What is kept of a chunk, sample after sample: outcome, axes, quantities.
    subroutine make_records(kept, n, records)
        type(kept_chunk), intent(in) :: kept
        integer, intent(in) :: n                        !! samples
        real(wp), intent(out) :: records(:, :)          !! (width, sample)
        integer :: n_axis

        n_axis = size(kept%axis, 1)
        records(1, :n) = kept%code(:n)
        records(2:n_axis + 1, :n) = kept%axis(:, :n)
        records(n_axis + 2:, :n) = kept%value(:, :n)
    end subroutine make_records

    ! ---------------------------------------------------------------- samples

    !> Axes, motion and loads of samples.
    subroutine fill_batch(plan, first, n, design)
        type(sweep_plan), intent(in) :: plan
        integer(int64), intent(in) :: first             !! number of the first sample, from 0
        integer, intent(in) :: n
        type(sweep_design), intent(inout) :: design
        integer :: i

        call axis_columns(plan, first, n, design%place, design%axis)
        associate (batch => design%batch)
            if (design%follows_motion) then
                i = findloc(plan%axis%spec%kind, axis_time, dim=1)
                call evaluate_motion(design%model, design%axis(:n, i), batch%q(:, :n), batch%qd(:, :n), batch%qdd(:, :n), &
                                     batch%load(:, :, :n))
                batch%t(:n) = design%axis(:n, i)
            end if
            do i = 1, size(plan%axis)
                associate (spec => plan%axis(i)%spec)
                    select case (spec%kind)
                    case (axis_coordinate)
                        batch%q(spec%target, :n) = design%axis(:n, i)
                    case (axis_rate)
                        batch%qd(spec%target, :n) = design%axis(:n, i)
                    case (axis_acceleration)
                        batch%qdd(spec%target, :n) = design%axis(:n, i)
                    case (axis_load)
                        batch%load(spec%component, spec%target, :n) = design%axis(:n, i)
                    end select
                end associate
            end do
        end associate
    end subroutine fill_batch

    !> All quantities of a batch, as far as it takes: forces only of samples that are within what can be said without them.
    subroutine evaluate_batch(spec, plan, row, first, n, design)
        type(sweep_spec), intent(in) :: spec
        type(sweep_plan), intent(in) :: plan
        type(quantity_row), intent(in) :: row
        integer(int64), intent(in) :: first             !! number of the first sample, from 0
        integer, intent(in) :: n
        type(sweep_design), intent(inout) :: design
        integer :: s, m

        associate (code => design%code(:n), counts => design%counts(:n))
            code = code_feasible
            if (design%measures%are_wanted) call take_poses(plan, row, first, n, design)
            if (associated(design%of_motion%status)) then
                call compute(design%model, design%motion, n, design%batch, design%of_motion)
                call take_motion(row, n, design%of_motion, design%value)
                where (code == code_feasible .and. design%of_motion%status(:n) /= sample_ok) code = design%of_motion%status(:n)
            end if
            if (design%excludes_early .or. .not. design%needs_forces) call judge(spec, row, .false., n, design)
            call find_who_counts(spec, code, counts)
            if (.not. design%needs_forces) return
            m = n
            if (design%excludes_early) then
                m = count(counts)
                design%which(:m) = pack([(s, s=1, n)], counts)
                call choose(design%which(:m), design%batch, design%chosen)
                call compute(design%model, design%forces, m, design%chosen, design%of_forces)
            else
                design%which(:n) = [(s, s=1, n)]
                call compute(design%model, design%forces, n, design%batch, design%of_forces)
                if (design%needs_motion) call take_motion(row, n, design%of_forces, design%value)
            end if
            call note_failures(design%of_forces%status(:m), design%which(:m), code)
            call take_forces(row, m, design)
            if (.not. design%excludes_early) call judge(spec, row, .false., n, design)
            call judge(spec, row, .true., n, design)
            call find_who_counts(spec, code, counts)
        end associate
    end subroutine evaluate_batch

    !> Samples whose forces could not be found. Mostly there are none.
    pure subroutine note_failures(status, which, code)
        integer, intent(in) :: status(:)                !! of the samples chosen
        integer, intent(in) :: which(:)
        integer, intent(inout) :: code(:)               !! of all samples
        integer :: s

        if (all(status == sample_ok)) return
        do s = 1, size(status)
            associate (outcome => status(s), here => code(which(s)))
                if (outcome /= sample_ok .and. (here == code_feasible .or. here >= first_bound)) here = outcome
            end associate
        end do
    end subroutine note_failures

    !> Those samples whose forces are wanted.
    subroutine choose(which, batch, chosen)
        integer, intent(in) :: which(:)
        type(sample_batch), intent(in) :: batch
        type(sample_batch), intent(inout) :: chosen
        integer :: s

        do s = 1, size(which)
            chosen%q(:, s) = batch%q(:, which(s))
            chosen%qd(:, s) = batch%qd(:, which(s))
            chosen%qdd(:, s) = batch%qdd(:, which(s))
            chosen%load(:, :, s) = batch%load(:, :, which(s))
            chosen%t(s) = batch%t(which(s))
        end do
    end subroutine choose

    !> The first samples of a batch as inverse dynamics has them, each on its own.
    subroutine compute(model, solver, n, batch, results)
        type(model_type), intent(in) :: model
        type(inverse_solver), intent(in) :: solver
        integer, intent(in) :: n
        type(sample_batch), intent(in), target :: batch
        type(inverse_results), intent(in) :: results
        type(inverse_results) :: here
        type(motion_batch) :: motion

        if (n == 0) return
        here = part_of_results(results, 1, n)
        motion = motion_of(batch%q(:, :n), batch%qd(:, :n), batch%qdd(:, :n), batch%load(:, :, :n))
        motion%t => batch%t(:n)
        call run_prepared(model, solver, 1, motion, here)
    end subroutine compute

    !> What hangs on the pose alone, found once for all load cases at it.
    subroutine take_poses(plan, row, first, n, design)
        type(sweep_plan), intent(in) :: plan
        type(quantity_row), intent(in) :: row
        integer(int64), intent(in) :: first             !! number of the first sample, from 0
        integer, intent(in) :: n
        type(sweep_design), intent(inout) :: design
        integer :: pose(n), leader(n), n_pose, s, k

        n_pose = 0
        do s = 1, n
            if (s == 1 .or. modulo(first + s - 1, plan%n_load_case) == 0) then
                n_pose = n_pose + 1
                leader(n_pose) = s
            end if
            pose(s) = n_pose
        end do
        call measure_poses(design%model, row, design%batch%q(:, leader(:n_pose)), design%measures, &
                           design%of_pose, design%pose_status)
        do s = 1, n
            if (design%pose_status(pose(s)) /= sample_ok) design%code(s) = design%pose_status(pose(s))
            do k = 1, size(row%quantity)
                associate (quantity => row%quantity(k))
                    if (belongs_to_pose(quantity%id)) design%value(quantity%first + 1:quantity%first + quantity%n, s) = &
                        design%of_pose(quantity%first + 1:quantity%first + quantity%n, pose(s))
                end associate
            end do
        end do
    end subroutine take_poses

    !> Joint variables and rates.
    subroutine take_motion(row, n, of, value)
        type(quantity_row), intent(in) :: row
        integer, intent(in) :: n                        !! samples
        type(inverse_results), intent(in) :: of
        real(wp), intent(inout) :: value(:, :)          !! (entry, sample)
        integer :: k

        do k = 1, size(row%quantity)
            associate (first => row%quantity(k)%first + 1, last => row%quantity(k)%first + row%quantity(k)%n)
                select case (row%quantity(k)%id)
                case (quantity_joint_variable)
                    value(first:last, :n) = of%of(result_joint_variable)%x(:, :n)
                case (quantity_joint_rate)
                    value(first:last, :n) = of%of(result_joint_rate)%x(:, :n)
                case (quantity_driving_position)
                    value(first:last, :n) = of%of(result_driving_position)%x(:, :n)
                case (quantity_driving_speed)
                    value(first:last, :n) = of%of(result_driving_speed)%x(:, :n)
                end select
            end associate
        end do
    end subroutine take_motion

    !> What follows from the forces of the samples chosen.
    subroutine take_forces(row, n, design)
        type(quantity_row), intent(in) :: row
        integer, intent(in) :: n
        type(sweep_design), intent(inout) :: design
        integer :: k, s, n_component, n_force

        n_component = design%model%n_component
        n_force = merge(2, 3, design%model%is_planar)
        do k = 1, size(row%quantity)
            associate (quantity => row%quantity(k), first => row%quantity(k)%first, which => design%which(:n), &
                       of => design%of_forces%of, value => design%value)
                if (.not. needs_forces(quantity%id)) cycle
                select case (quantity%id)
                case (quantity_driving_force)
                    call copy_rows(quantity%n, n, of(result_driving_force)%x(:, :n), which, row%n, first, value)
                case (quantity_driving_power)
                    call multiply_rows(quantity%n, n, of(result_driving_force)%x(:, :n), of(result_driving_speed)%x(:, :n), &
                                       which, row%n, first, value)
                case (quantity_contact_force)
                    call copy_rows(quantity%n, n, of(result_contact_force)%x(:, :n), which, row%n, first, value)
                case (quantity_pressure_angle)
                    call copy_rows(quantity%n, n, of(result_pressure_angle)%x(:, :n), which, row%n, first, value)
                case (quantity_reaction)
                    call copy_rows(quantity%n, n, of(result_reaction)%x(:, :n), which, row%n, first, value)
                case (quantity_reaction_force)
                    call take_lengths(n_component, quantity%n, n, 0, n_force, of(result_reaction)%x(:, :n), which, row%n, &
                                      first, value)
                case (quantity_reaction_moment)
                    call take_lengths(n_component, quantity%n, n, n_force, n_component - n_force, of(result_reaction)%x(:, :n), &
                                      which, row%n, first, value)
                case default
                    do s = 1, n
                        value(first + 1:first + quantity%n, which(s)) = motor_load(quantity%id, s)
                    end do
                end select
            end associate
        end do

    contains

        !> What the motors give in a sample.
        function motor_load(id, s) result(load)
            integer, intent(in) :: id, s
            real(wp) :: load(size(design%model%motor))
            real(wp) :: torque, speed
            integer :: i

            do i = 1, size(load)
                associate (of => design%of_forces%of, a => design%model%motor(i)%actuator, spec => design%model%scene%actuator)
                    speed = spec(a)%motor%ratio*of(result_driving_speed)%x(a, s)
                    torque = motor_torque(spec(a)%motor, of(result_driving_force)%x(a, s), of(result_transmission_force)%x(i, s), &
                                          of(result_driving_speed)%x(a, s))
                    select case (id)
                    case (quantity_motor_torque)
                        load(i) = torque
                    case (quantity_motor_speed)
                        load(i) = speed
                    case (quantity_motor_power)
                        load(i) = torque*speed
                    case (quantity_motor_current)
                        load(i) = torque/spec(a)%motor%torque_constant
                    case (quantity_torque_margin)
                        load(i) = available_torque(spec(a)%motor, speed, torque) - abs(torque)
                    end select
                end associate
            end do
        end function motor_load
    end subroutine take_forces

    ! ---------------------------------------------------------------- bounds

    !> The last check, that nothing that is not finite is reduced or kept, and the bounds: of what needs forces, or of the rest.
    subroutine judge(spec, row, is_late, n, design)
        type(sweep_spec), intent(in) :: spec
        type(quantity_row), intent(in) :: row
        logical, intent(in) :: is_late
        integer, intent(in) :: n
        type(sweep_design), intent(inout) :: design
        integer :: s, b, from, to

        from = merge(row%n_early + 1, 1, is_late)
        to = merge(row%n, row%n_early, is_late)
        if (has_no_bound(spec, is_late)) then
            ! mostly all is well, and numbers of all samples are looked at in one go
            if (from > to) return
            if (all_are_finite(size(design%value(:, :n), kind=int64), design%value)) return
        end if
        do s = 1, n
            associate (code => design%code(s), value => design%value(:, s))
                if (.not. takes_part(spec, code)) cycle
                if (.not. all_are_finite(int(to - from + 1, int64), value(from:to))) code = sample_undefined
                do b = 1, size(spec%bound)
                    if (needs_forces(spec%bound(b)%quantity) .neqv. is_late) cycle
                    ! The first bound that a sample does not keep; bounds that are no limits come first.
                    if (.not. (code == code_feasible .or. (.not. spec%bound(b)%is_limit .and. is_limit_code(spec, code)))) cycle
                    if (.not. keeps(spec%bound(b), row%quantity(row%place(spec%bound(b)%quantity)), value)) &
                        code = first_bound + b - 1
                end do
            end associate
        end do
    end subroutine judge

    !> Is nothing bounded that needs forces, or that needs none?
    pure logical function has_no_bound(spec, is_late)
        type(sweep_spec), intent(in) :: spec
        logical, intent(in) :: is_late
        integer :: b

        has_no_bound = .true.
        do b = 1, size(spec%bound)
            has_no_bound = has_no_bound .and. (needs_forces(spec%bound(b)%quantity) .neqv. is_late)
        end do
    end function has_no_bound

    !> Are all entries of a bound within it?
    pure logical function keeps(bound, quantity, value)
        type(bound_spec), intent(in) :: bound
        type(quantity_type), intent(in) :: quantity
        real(wp), intent(in) :: value(:)                !! (entry)

        associate (v => value(quantity%first + bound%entry))
            keeps = all(v >= bound%low .and. v <= bound%high)
        end associate
    end function keeps

    !> Does the code say that a pose is beyond a limit, but possible?
    pure elemental logical function is_limit_code(spec, code) result(is_limit)
        type(sweep_spec), intent(in) :: spec
        integer, intent(in) :: code

        is_limit = .false.
        if (code >= first_bound) is_limit = spec%bound(code - first_bound + 1)%is_limit
    end function is_limit_code

    pure subroutine find_who_counts(spec, code, counts)
        type(sweep_spec), intent(in) :: spec
        integer, intent(in) :: code(:)                  !! (sample)
        logical, intent(out) :: counts(:)               !! it takes part in the reductions

        counts = code == code_feasible
        if (any(spec%bound%is_limit)) counts = takes_part(spec, code)
    end subroutine find_who_counts

    !> Does a sample of this outcome take part in the reductions?
    pure elemental logical function takes_part(spec, code)
        type(sweep_spec), intent(in) :: spec
        integer, intent(in) :: code

        takes_part = code == code_feasible .or. is_limit_code(spec, code)
    end function takes_part

    !> Is a pose beyond this bound excluded before its forces are computed?
    pure logical function is_excluded_early(bound) result(is_excluded)
        type(bound_spec), intent(in) :: bound

        is_excluded = .not. bound%is_limit .and. .not. needs_forces(bound%quantity)
    end function is_excluded_early
end module linkdyn_sweep_chunk
