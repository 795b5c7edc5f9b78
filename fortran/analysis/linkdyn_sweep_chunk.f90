!> One chunk of a sweep: from numbers of samples to totals, block by block in the cache. Nothing but what is reduced or
!> kept is computed.
module linkdyn_sweep_chunk
    use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan
    use, intrinsic :: iso_fortran_env, only: int64
    use linkdyn_clearance, only: swing_angle, smallest_gap
    use linkdyn_equations, only: solve_equations
    use linkdyn_force_map, only: evaluate_force_map, scaled_condition
    use linkdyn_interrupt, only: is_interrupted
    use linkdyn_joint_rates, only: actuator_rates, measure_joints, measure_variable
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_pass, only: evaluate_kinematics
    use linkdyn_lane_count, only: lanes
    use linkdyn_motion, only: evaluate_motion
    use linkdyn_reactions, only: collect_reactions
    use linkdyn_status, only: sample_ok, sample_unreachable, sample_singular, sample_not_converged, sample_undefined
    use linkdyn_sweep_design, only: sweep_design
    use linkdyn_sweep_map, only: sweep_map, map_part, cell_of, start_part, add_to_part
    use linkdyn_sweep_plan, only: sweep_plan, place_cursor, advance_cursor
    use linkdyn_sweep_quantities, only: quantity_row
    use linkdyn_sweep_spec, only: sweep_spec, axis_coordinate, axis_rate, axis_acceleration, axis_load, axis_time, &
        quantity_driving_force, quantity_driving_position, quantity_driving_speed, quantity_driving_power, &
        quantity_reaction, quantity_reaction_force, quantity_reaction_moment, quantity_joint_variable, quantity_joint_rate, &
        quantity_force_amplification, quantity_moment_amplification, quantity_condition, quantity_determinant, &
        quantity_swing, quantity_clearance, needs_forces
    use linkdyn_sweep_totals, only: totals_type, totals_shape, bins_type, start_lanes, reduce_lanes, count_lanes, &
        watch_lanes, join_lanes, code_feasible, code_no_model, first_bound
    implicit none (type, external)
    private
    public :: reduce_chunk, kept_chunk, make_records

    !> What is kept of every sample of a chunk.
    type :: kept_chunk
        integer :: n = 0
        integer, allocatable :: code(:)                 !! (sample)
        real(wp), allocatable :: axis(:, :)             !! (axis, sample)
        real(wp), allocatable :: value(:, :)            !! (kept entry, sample)
        type(map_part) :: map
    end type kept_chunk

contains

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
        integer :: code(lanes), block, n_here
        logical :: counts(lanes)
        real(wp) :: axis(size(plan%axis), lanes)
        integer(int64) :: cell(lanes)

        call start_lanes(shape, design%part)
        if (map%is_wanted) call start_part(size(row%quantity), n, kept%map)
        if (.not. design%status%is_ok()) then
            design%part%n_sample = n
            design%part%n_code(code_no_model) = n
            call join_lanes(shape, design%part, first, totals)
            if (allocated(kept%code)) call keep_nothing()
            return
        end if
        call place_cursor(plan, first, design%cursor)
        do block = 0, (n - 1)/lanes
            if (is_interrupted()) exit
            n_here = min(lanes, n - block*lanes)
            call fill_lanes(plan, map, n_here, design, axis, cell)
            call evaluate_block(spec, row, n_here, design, code)
            call check_counts(spec, code, n_here, counts)
            if (allocated(kept%code)) call keep_block()
            if (map%is_wanted) call add_to_part(row, design%value, cell, counts, code == code_feasible, n_here, kept%map)
            if (.not. all(counts)) call blank_lanes(shape%n_entry, counts, design%value)
            call reduce_lanes(shape, bins, design%value, counts, block, design%part)
            call count_lanes(code, n_here, design%part)
            if (shape%determinant > 0 .and. plan%n_line > 0) call watch_lanes(design%value(:, shape%determinant), n_here, &
                first + int(block, int64)*lanes, plan%n_line, design%part)
        end do
        call join_lanes(shape, design%part, first, totals)

    contains

        subroutine keep_block()
            integer :: l, i

            do l = 1, n_here
                i = block*lanes + l
                kept%code(i) = code(l)
                kept%axis(:, i) = axis(:, l)
                kept%value(:, i) = design%value(l, keep)
                if (code(l) == code_feasible) cycle
                if (code(l) < first_bound) then
                    kept%value(:, i) = ieee_value(1.0_wp, ieee_quiet_nan)
                else if (is_excluded_early(spec, code(l))) then
                    ! Whether its forces were computed depends on its neighbours.
                    where (keep > row%n_early) kept%value(:, i) = ieee_value(1.0_wp, ieee_quiet_nan)
                end if
            end do
        end subroutine keep_block

        subroutine keep_nothing()
            integer :: i

            call place_cursor(plan, first, design%cursor)
            do i = 1, n
                kept%axis(:, i) = design%cursor%value
                call advance_cursor(plan, design%cursor)
            end do
            kept%code(:n) = code_no_model
            kept%value(:, :n) = ieee_value(1.0_wp, ieee_quiet_nan)
        end subroutine keep_nothing
    end subroutine reduce_chunk

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

    !> The next samples into lanes; lanes beyond the last one repeat it.
    subroutine fill_lanes(plan, map, n_here, design, axis_of_lane, cell)
        type(sweep_plan), intent(in) :: plan
        type(sweep_map), intent(in) :: map
        integer, intent(in) :: n_here
        type(sweep_design), intent(inout) :: design
        real(wp), intent(out) :: axis_of_lane(:, :)     !! (axis, lane)
        integer(int64), intent(out) :: cell(lanes)      !! of the map
        integer :: l, i

        do l = 1, lanes
            axis_of_lane(:, l) = design%cursor%value
            if (map%is_wanted) cell(l) = cell_of(map, design%cursor, design%number)
            if (l < n_here) call advance_cursor(plan, design%cursor)
        end do
        call advance_cursor(plan, design%cursor)
        if (design%follows_motion) call follow_motion(plan, design, axis_of_lane)
        associate (state => design%workspace%state)
            do i = 1, size(plan%axis)
                associate (spec => plan%axis(i)%spec)
                    select case (spec%kind)
                    case (axis_coordinate)
                        state%q(:, spec%target) = axis_of_lane(i, :)
                    case (axis_rate)
                        state%qd(:, spec%target) = axis_of_lane(i, :)
                    case (axis_acceleration)
                        state%qdd(:, spec%target) = axis_of_lane(i, :)
                    case (axis_load)
                        design%workspace%load(:, spec%component, spec%target) = axis_of_lane(i, :)
                    end select
                end associate
            end do
        end associate
    end subroutine fill_lanes

    !> Coordinates and loads of the scene's motion at the instants of the lanes.
    subroutine follow_motion(plan, design, axis_of_lane)
        type(sweep_plan), intent(in) :: plan
        type(sweep_design), intent(inout) :: design
        real(wp), intent(in) :: axis_of_lane(:, :)
        real(wp) :: t(lanes)
        integer :: i, l

        do i = 1, size(plan%axis)
            if (plan%axis(i)%spec%kind == axis_time) t = axis_of_lane(i, :)
        end do
        call evaluate_motion(design%model, t, design%q, design%qd, design%qdd, design%load)
        associate (workspace => design%workspace)
            do l = 1, lanes
                workspace%state%q(l, :) = design%q(:, l)
                workspace%state%qd(l, :) = design%qd(:, l)
                workspace%state%qdd(l, :) = design%qdd(:, l)
                if (design%model%n_load > 0) workspace%load(l, :, :) = design%load(:, :, l)
            end do
        end associate
    end subroutine follow_motion

    !> All quantities of a block, as far as it takes: forces only if some lane is within what can be said without them.
    subroutine evaluate_block(spec, row, n_here, design, code)
        type(sweep_spec), intent(in) :: spec
        type(quantity_row), intent(in) :: row
        integer, intent(in) :: n_here
        type(sweep_design), intent(inout) :: design
        integer, intent(out) :: code(lanes)             !! see `linkdyn_sweep_totals`
        logical :: counts(lanes)

        call evaluate_kinematics(design%model, design%workspace%state)
        associate (state => design%workspace%state)
            code = code_feasible
            where (state%singular) code = sample_singular
            where (state%not_converged) code = sample_not_converged
            where (state%unreachable) code = sample_unreachable
        end associate
        call evaluate_early(row, design)
        call flag_unsound(design%value(:, :row%n_early), code)
        call check_bounds(spec, row, .false., design%value, code)
        if (.not. design%needs_forces) return
        call check_counts(spec, code, n_here, counts)
        if (.not. any(counts)) return
        call solve_equations(design%model, design%equations, design%workspace)
        if (any(design%workspace%status /= sample_ok)) then
            where (counts .and. design%workspace%status /= sample_ok) code = design%workspace%status
        end if
        call evaluate_late(row, design)
        call flag_unsound(design%value(:, row%n_early + 1:), code)
        call check_bounds(spec, row, .true., design%value, code)
    end subroutine evaluate_block

    !> The last check: nothing that is not finite is reduced or kept.
    pure subroutine flag_unsound(value, code)
        real(wp), intent(in) :: value(:, :)             !! (lane, entry)
        integer, intent(inout) :: code(lanes)
        real(wp) :: total(lanes)
        integer :: k

        total = 0
        do k = 1, size(value, 2)
            total = total + abs(value(:, k))
        end do
        where ((code == code_feasible .or. code >= first_bound) .and. .not. total <= huge(1.0_wp)) code = sample_undefined
    end subroutine flag_unsound

    !> What needs no forces.
    subroutine evaluate_early(row, design)
        type(quantity_row), intent(in) :: row
        type(sweep_design), intent(inout) :: design
        real(wp) :: variable(lanes, design%model%n_variable), rate(lanes, design%model%n_variable), ignored(lanes), zero(lanes)
        integer :: i, p
        logical :: needs_all

        associate (model => design%model, state => design%workspace%state)
            needs_all = row%place(quantity_joint_variable) > 0 .or. row%place(quantity_joint_rate) > 0
            p = place(quantity_driving_position)
            if (needs_all) call measure_joints(model, state, variable, rate)
            if (p >= 0) then
                zero = 0
                do i = 1, model%n_actuator
                    associate (spec => model%scene%actuator(i))
                        call measure_variable(model, state, spec%joint, spec%variable, zero, design%value(:, p + i), ignored)
                    end associate
                end do
            end if
            if (row%place(quantity_driving_speed) > 0 .or. row%place(quantity_driving_power) > 0) &
                call actuator_rates(model, state, design%rate)
            if (row%place(quantity_driving_speed) > 0) then
                p = place(quantity_driving_speed)
                design%value(:, p + 1:p + model%n_actuator) = design%rate
            end if
            if (needs_all) then
                p = place(quantity_joint_variable)
                if (p >= 0) design%value(:, p + 1:p + model%n_variable) = variable
                p = place(quantity_joint_rate)
                if (p >= 0) design%value(:, p + 1:p + model%n_variable) = rate
            end if
            p = place(quantity_swing)
            if (p >= 0) then
                do i = 1, size(design%swing)
                    call swing_angle(model, design%swing(i), state, design%value(:, p + i))
                end do
            end if
            p = place(quantity_clearance)
            if (p >= 0) call smallest_gap(model, design%rod, state, design%value(:, p + 1))
            if (.not. design%wants_map) return
            call evaluate_force_map(model, design%map, state, design%jacobian, design%force, design%determinant)
            p = place(quantity_determinant)
            if (p >= 0) design%value(:, p + 1) = design%determinant
            p = place(quantity_force_amplification)
            if (p >= 0) then
                do i = 1, model%n_actuator
                    design%value(:, p + i) = row_length(design%force(:, i, 1:3))
                end do
            end if
            p = place(quantity_moment_amplification)
            if (p >= 0) then
                do i = 1, model%n_actuator
                    design%value(:, p + i) = row_length(design%force(:, i, 4:6))
                end do
            end if
            p = place(quantity_condition)
            if (p >= 0) call scaled_condition(model%n_q, design%jacobian, design%value(:, p + 1))
        end associate

    contains

        !> Where the entries of a quantity stand in the row; -1: it is not there.
        pure integer function place(id)
            integer, intent(in) :: id

            place = -1
            if (row%place(id) > 0) place = row%quantity(row%place(id))%first
        end function place
    end subroutine evaluate_early

    pure function row_length(v) result(length)
        real(wp), intent(in) :: v(:, :)                 !! (lane, 3)
        real(wp) :: length(lanes)

        length = sqrt(v(:, 1)**2 + v(:, 2)**2 + v(:, 3)**2)
    end function row_length

    !> What follows from the forces.
    subroutine evaluate_late(row, design)
        type(quantity_row), intent(in) :: row
        type(sweep_design), intent(inout) :: design
        integer :: i, j, k, p, n_force

        associate (model => design%model, value => design%value, force => design%workspace%driving_force)
            k = row%place(quantity_driving_force)
            if (k > 0) then
                p = row%quantity(k)%first
                value(:, p + 1:p + model%n_actuator) = force
            end if
            k = row%place(quantity_driving_power)
            if (k > 0) then
                p = row%quantity(k)%first
                value(:, p + 1:p + model%n_actuator) = force*design%rate
            end if
            if (.not. design%wants_reactions) return
            call collect_reactions(model, design%equations%formulation, design%workspace%state, design%workspace%solution, &
                                   design%reaction)
            n_force = merge(2, 3, model%is_planar)
            k = row%place(quantity_reaction)
            if (k > 0) then
                p = row%quantity(k)%first
                do j = 1, model%n_joint
                    do i = 1, model%n_component
                        p = p + 1
                        value(:, p) = design%reaction(:, i, j)
                    end do
                end do
            end if
            k = row%place(quantity_reaction_force)
            if (k > 0) then
                p = row%quantity(k)%first
                do j = 1, model%n_joint
                    value(:, p + j) = design%reaction(:, 1, j)**2 + design%reaction(:, 2, j)**2
                    if (n_force == 3) value(:, p + j) = value(:, p + j) + design%reaction(:, 3, j)**2
                    value(:, p + j) = sqrt(value(:, p + j))
                end do
            end if
            k = row%place(quantity_reaction_moment)
            if (k > 0) then
                p = row%quantity(k)%first
                do j = 1, model%n_joint
                    if (n_force == 2) value(:, p + j) = abs(design%reaction(:, 3, j))
                    if (n_force == 3) value(:, p + j) = row_length(design%reaction(:, 4:6, j))
                end do
            end if
        end associate
    end subroutine evaluate_late

    !> The first bound that a lane does not keep; bounds that are no limits come first.
    subroutine check_bounds(spec, row, is_late, value, code)
        type(sweep_spec), intent(in) :: spec
        type(quantity_row), intent(in) :: row
        logical, intent(in) :: is_late
        real(wp), intent(in) :: value(:, :)
        integer, intent(inout) :: code(lanes)
        integer :: b, i
        logical :: keeps(lanes)

        do b = 1, size(spec%bound)
            associate (bound => spec%bound(b))
                if (needs_forces(bound%quantity) .neqv. is_late) cycle
                keeps = .true.
                do i = 1, size(bound%entry)
                    associate (k => row%quantity(row%place(bound%quantity))%first + bound%entry(i))
                        keeps = keeps .and. value(:, k) >= bound%low .and. value(:, k) <= bound%high
                    end associate
                end do
                if (all(keeps)) cycle
                if (bound%is_limit) then
                    where (.not. keeps .and. code == code_feasible) code = first_bound + b - 1
                else
                    where (.not. keeps .and. (code == code_feasible .or. is_limit_code(spec, code))) code = first_bound + b - 1
                end if
            end associate
        end do
    end subroutine check_bounds

    !> Does the code say that a pose is beyond a limit, but possible?
    pure elemental logical function is_limit_code(spec, code) result(is_limit)
        type(sweep_spec), intent(in) :: spec
        integer, intent(in) :: code

        is_limit = .false.
        if (code >= first_bound) is_limit = spec%bound(code - first_bound + 1)%is_limit
    end function is_limit_code

    !> Is the pose excluded by what needs no forces?
    pure logical function is_excluded_early(spec, code) result(is_excluded)
        type(sweep_spec), intent(in) :: spec
        integer, intent(in) :: code                     !! of a bound

        associate (bound => spec%bound(code - first_bound + 1))
            is_excluded = .not. bound%is_limit .and. .not. needs_forces(bound%quantity)
        end associate
    end function is_excluded_early

    !> Which lanes take part in the reductions.
    subroutine check_counts(spec, code, n_here, counts)
        type(sweep_spec), intent(in) :: spec
        integer, intent(in) :: code(lanes), n_here
        logical, intent(out) :: counts(lanes)

        if (n_here == lanes .and. all(code == code_feasible)) then
            counts = .true.
            return
        end if
        counts = code == code_feasible .or. is_limit_code(spec, code)
        counts(n_here + 1:) = .false.
    end subroutine check_counts

    pure subroutine blank_lanes(n, counts, value)
        integer, intent(in) :: n
        logical, intent(in) :: counts(lanes)
        real(wp), intent(inout) :: value(lanes, n)
        real(wp) :: nan
        integer :: k

        nan = ieee_value(1.0_wp, ieee_quiet_nan)
        do k = 1, n
            where (.not. counts) value(:, k) = nan
        end do
    end subroutine blank_lanes
end module linkdyn_sweep_chunk
