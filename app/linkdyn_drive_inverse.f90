!> `linkdyn inverse`: run along the scene's motion in blocks of samples, so that memory does not grow
!> with the length of the run. Results that are written are computed block by block, each by all threads; where
!> only the summary is kept, threads take groups of blocks and meet at the end only.
module linkdyn_drive_inverse
    use, intrinsic :: iso_fortran_env, only: int64
    use linkdyn_assembly_trail, only: assembly_trail
    use linkdyn_block_results, only: put_into_block
    use linkdyn_cli, only: command_line
    use linkdyn_clock, only: seconds_since
    use linkdyn_force_map, only: typical_length
    use linkdyn_inverse, only: inverse_results, inverse_solver, motion_batch, motion_of, prepare_inverse, run_prepared
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_led_mechanism, only: follows_assembly
    use linkdyn_model, only: model_type, dyad_names, has_assemblies
    use linkdyn_given_attitudes, only: refuse_way_past_pole, turn_by_quaternion, attitude_size
    use linkdyn_heard_tables, only: refuse_instants
    use linkdyn_coarse_sampling, only: coarse_in_words
    use linkdyn_motion, only: evaluate_motion, evaluate_loads, sample_count, sample_times
    use linkdyn_results, only: wanted_type, layout_type, block_type, describe_results, refuse_absent, prepare_block, &
        view_values, samples_width, find_driving_power, view_motor_loads, flag_unsound, variable_index
    use linkdyn_result_kinds, only: result_time, result_q, result_qd, result_qdd, result_driving_force, &
        result_driving_speed, result_driving_power, result_joint_rate, result_transmission_force, result_assembly
    use linkdyn_run_output, only: output_type, open_results, put_results, note_result, note_roads, note_assembly, close_results, &
        exit_done, exit_bad_input, exit_samples_failed
    use linkdyn_scene, only: has_hard_stops, scene_type
    use linkdyn_states_file, only: states_type, read_states
    use linkdyn_status, only: status_type
    use linkdyn_summary, only: summary_type, start_summary, add_to_summary, join_summaries
    use linkdyn_summary_text, only: print_summary, failure_text, reason_of_loss, passed_stops
    use linkdyn_terminal, only: show_stage, show_progress, say
    use linkdyn_load_model, only: load_model
    use linkdyn_threads, only: team_size
    use linkdyn_turns, only: turn_count
    implicit none (type, external)
    private
    public :: drive_inverse

    character(len=*), parameter :: spline_rates = "of the spline through the positions"    !! where --states has no rates
    integer, parameter :: written_block = 16384      !! samples computed and written at a time
    integer, parameter :: passing_block = 2048       !! samples whose results stay in the cache until they are summed up
    integer, parameter :: most_values = 2**24        !! computed at a time: a large mechanism has fewer samples in a block
    integer, parameter :: most_groups = 1024         !! of blocks: every group has a summary of its own

    !> Values that are computed but not stored.
    type :: scratch_type
        real(wp), allocatable :: load(:, :, :)            !! (6, n_load, n)
        real(wp), allocatable :: nothing(:, :)            !! coordinates of a structure, which has none (0, n)
        real(wp), allocatable :: time(:)                  !! at which loads act on states without one [s] (n)
    end type scratch_type

contains

    !> Compute and report; the exit status says how it went.
    subroutine drive_inverse(config, unit, exit_status)
        type(command_line), intent(in) :: config
        integer, intent(in) :: unit                   !! for the summary
        integer, intent(out) :: exit_status
        type(model_type) :: model
        type(inverse_solver) :: solver
        type(layout_type) :: layout
        type(output_type) :: output
        type(summary_type) :: summary
        type(states_type) :: states
        type(status_type) :: status
        character(len=:), allocatable :: coarse
        real(wp) :: seconds
        integer :: n_sample

        exit_status = exit_bad_input
        call load_model(config%scene, .true., model, status)
        if (status%is_ok() .and. allocated(config%want)) call refuse_absent(config%want, model%scene, status)
        n_sample = sample_count(model)
        if (allocated(config%states)) then
            if (status%is_ok()) call read_states(config%states, model, states, status)
            if (status%is_ok()) then
                n_sample = size(states%time)
                call refuse_instants(model%scene, states%time, .false., status)
                if (.not. status%is_ok()) status%message = config%states//": "//trim(status%message)
            end if
        end if
        if (status%is_ok()) call prepare_inverse(model, config%options, config%wanted%reaction, solver, status)
        if (status%is_ok()) then
            call describe_results(model%scene, wanted_of(config, model%scene), follow_each_other(states), layout, &
                                  dyad=dyad_names(model), &
                                  length=typical_length(model), follows_assembly=follows_assembly(model))
            call open_results(config, model, layout, n_sample, output, status)
        end if
        if (status%is_ok() .and. states%has_spline_rates) call note_result("rates", spline_rates, output, status)
        coarse = ""
        if (status%is_ok() .and. .not. allocated(states%time)) then
            coarse = sampling_in_words(model, n_sample)
            call note_result("coarse_sampling", coarse, output, status)
        end if
        if (status%is_ok()) call run_blocks(config, model, solver, layout, states, n_sample, output, summary, seconds, status)
        call solver%free()
        if (.not. status%is_ok()) then
            call say(status%message)
            return
        end if
        if (.not. config%quiet) call print_summary(model, layout, summary, config%solver, &
            config%options%threads, seconds, output%name, unit)
        if (states%has_spline_rates .and. .not. config%quiet) write (unit, "(a)") "  rates            "//spline_rates
        if (coarse /= "" .and. .not. config%quiet) write (unit, "(a)") "  sampling         "//coarse
        exit_status = exit_done
        if (summary%failure%n == 0) return
        exit_status = exit_samples_failed
        call say(trim(config%scene)//": failed samples: "//failure_text(summary))
    end subroutine drive_inverse

    !> Do the scene's samples lie too far from each other? So many that nobody could look at them all are not looked at.
    function sampling_in_words(model, n_sample) result(text)
        type(model_type), intent(in) :: model
        integer, intent(in) :: n_sample
        character(len=:), allocatable :: text
        integer, parameter :: most_samples = 100000
        real(wp), allocatable :: t(:), load(:, :, :), q(:, :), qd(:, :), qdd(:, :)

        text = ""
        if (n_sample > most_samples) return
        allocate (t(n_sample), load(6, model%n_load, n_sample), q(model%n_q, n_sample))
        allocate (qd, qdd, mold=q)
        call sample_times(model, 1, t)
        call evaluate_motion(model, t, q, qd, qdd, load)
        text = coarse_in_words(model, t, q, qd, qdd)
    end function sampling_in_words

    !> What is computed: where nothing is written, what the summary tells of.
    function wanted_of(config, scene) result(wanted)
        type(command_line), intent(in) :: config
        type(scene_type), intent(in) :: scene
        type(wanted_type) :: wanted

        wanted = config%wanted
        if (config%no_output .and. .not. allocated(config%want)) &
            wanted%joint_variable = has_hard_stops(scene) .or. any(scene%actuator%cylinder%is_given)
    end function wanted_of

    !> Compute, store and sum up block by block.
    subroutine run_blocks(config, model, solver, layout, states, n_sample, output, summary, seconds, status)
        type(command_line), intent(in) :: config
        type(model_type), intent(in) :: model
        type(inverse_solver), intent(in) :: solver
        type(layout_type), intent(in) :: layout
        type(states_type), intent(in) :: states       !! not allocated: the scene's motion
        integer, intent(in) :: n_sample
        type(output_type), intent(inout) :: output
        type(summary_type), intent(out) :: summary
        real(wp), intent(out) :: seconds              !! spent computing, mean of the threads
        type(status_type), intent(inout) :: status
        type(assembly_trail) :: trail
        type(turn_count), allocatable :: turns        !! if results are kept or stops looked for: then blocks come in their order
        type(summary_type), allocatable :: part(:)    !! of each group: joined in order, whichever thread made it
        integer(int64) :: run_start
        integer :: length, n_block, n_group, n_taker, n_helper, n_done, k
        logical :: counts_turns, is_in_order

        length = merge(passing_block, written_block, output%is_none)
        length = max(lanes, min(length, most_values/width_of(layout)/lanes*lanes))
        n_block = (n_sample - 1)/length + 1
        n_group = min(n_block, most_groups)
        ! Where assemblies are followed along the motion, or turns are counted, blocks are taken in their order.
        counts_turns = .not. output%is_none .or. has_hard_stops(model%scene)
        is_in_order = counts_turns .or. has_assemblies(model)
        n_taker = 1
        if (.not. is_in_order) n_taker = team_size(config%options%threads, n_group)
        n_helper = merge(config%options%threads, 1, is_in_order)
        allocate (part(n_group))
        if (counts_turns) allocate (turns)
        n_done = 0
        seconds = 0
        call system_clock(run_start)
        !$omp parallel num_threads(n_taker) default(shared)
        call take_groups()
        !$omp end parallel
        seconds = seconds/n_taker
        call start_summary(layout, summary)
        do k = 1, n_group
            if (status%is_ok()) call join_summaries(part(k), summary)
        end do
        call show_stage("writing")
        call note_roads(summary%roads, output, status)
        call note_assembly(layout, summary, output, status)
        if (variable_index(layout, result_assembly) > 0) call note_result("failure", reason_of_loss(summary), output, status)
        if (has_hard_stops(model%scene)) call note_result("beyond_stops", passed_stops(model%scene, summary), output, status)
        call close_results(output, status)

    contains

        !> What one thread does: group k has the blocks from just behind (k-1)/n_group of all to k/n_group of all.
        subroutine take_groups()
            type(block_type) :: block
            type(scratch_type) :: scratch
            integer :: k, i, first, n

            n = min(length, n_sample)
            call prepare_block(layout, n, block)
            call prepare_scratch(model, n, scratch)
            !$omp do schedule(dynamic, 1)
            do k = 1, n_group
                call start_summary(layout, part(k), int(int(k - 1, int64)*n_block/n_group)*length)
                do i = int(int(k - 1, int64)*n_block/n_group), int(int(k, int64)*n_block/n_group) - 1
                    first = i*length + 1
                    n = min(length, n_sample - first + 1)
                    call take_block(first, n, block, scratch, part(k))
                end do
            end do
            !$omp end do
        end subroutine take_groups

        subroutine take_block(first, n, block, scratch, part)
            integer, intent(in) :: first, n           !! number of the first sample, and how many
            type(block_type), intent(inout) :: block
            type(scratch_type), intent(inout) :: scratch
            type(summary_type), intent(inout) :: part
            integer(int64) :: start
            real(wp) :: elapsed
            type(inverse_results) :: results

            if (.not. status%is_ok()) return
            call system_clock(start)
            call compute_block(model, solver, n_helper, layout, states, first, n, block, scratch, trail, turns, results, status)
            if (.not. status%is_ok()) return
            elapsed = seconds_since(start)
            if (.not. output%is_none) call put_results(layout, block, first, n, output, status)
            call add_to_summary(layout, block, n, results%roads, trail%n_crossed, part, results%lost_sample, &
                                results%lost_in_words, model%scene)
            !$omp critical (linkdyn_progress)
            seconds = seconds + elapsed
            n_done = n_done + n
            call show_progress(int(n_done, int64), int(n_sample, int64), run_start)
            !$omp end critical (linkdyn_progress)
        end subroutine take_block
    end subroutine run_blocks

    !> Are the samples instants of a motion? States without time stand alone, each.
    pure logical function follow_each_other(states)
        type(states_type), intent(in) :: states       !! not allocated: the scene's motion

        follow_each_other = states%is_motion .or. .not. allocated(states%time)
    end function follow_each_other

    !> Values of a sample.
    pure integer function width_of(layout) result(width)
        type(layout_type), intent(in) :: layout
        integer :: k

        width = 0
        do k = 1, size(layout%variable)
            width = width + samples_width(layout, layout%variable(k))
        end do
    end function width_of

    !> Room for what the run needs beside what it stores.
    subroutine prepare_scratch(model, n, scratch)
        type(model_type), intent(in) :: model
        integer, intent(in) :: n
        type(scratch_type), intent(out) :: scratch

        allocate (scratch%load(6, model%n_load, n), scratch%nothing(0, n), scratch%time(n))
    end subroutine prepare_scratch

    !> Motion, loads and inverse dynamics of some instants.
    subroutine compute_block(model, solver, threads, layout, states, first, n, block, scratch, trail, turns, results, status)
        type(model_type), intent(in) :: model
        type(inverse_solver), intent(in) :: solver
        integer, intent(in) :: threads
        type(layout_type), intent(in) :: layout
        type(states_type), intent(in) :: states       !! not allocated: the scene's motion
        integer, intent(in) :: first, n               !! number of the first sample, and how many
        type(block_type), intent(inout), target :: block
        type(scratch_type), intent(inout), target :: scratch
        type(assembly_trail), intent(inout) :: trail  !! instants follow each other
        type(turn_count), allocatable, intent(inout) :: turns    !! not allocated: turns are not counted
        type(inverse_results), intent(out) :: results !! where they are in the block, and what is said of all
        type(status_type), intent(inout) :: status
        real(wp), pointer :: time(:), speed(:, :), power(:, :)
        real(wp), pointer, contiguous :: q(:, :), qd(:, :), qdd(:, :)
        ! of samples near poles, which quaternions alone may pass
        real(wp) :: attitude(attitude_size, model%n_attitude, merge(n, 0, allocated(states%attitude) &
                                                                    .or. any(model%scene%coordinate%motion%angle > 0)))
        real(wp), allocatable, target :: turned(:, :, :)    ! absent: all attitudes go by their angles
        real(wp), allocatable, target :: spin(:, :), spin_rate(:, :)
        type(motion_batch) :: motion
        logical :: stands_alone

        call view_values(layout, result_time, n, block, time)
        if (.not. associated(time)) time => scratch%time(:n)
        call view_values(layout, result_q, n, block, q)
        call view_values(layout, result_qd, n, block, qd)
        call view_values(layout, result_qdd, n, block, qdd)
        if (model%n_q == 0) then
            q => scratch%nothing(:, :n)
            qd => q
            qdd => q
        end if
        call view_values(layout, result_driving_speed, n, block, speed)
        call view_values(layout, result_driving_power, n, block, power)
        call put_into_block(layout, n, block, [result_qdd, result_driving_speed], results)
        if (associated(power) .or. results%wants(result_transmission_force)) then
            call results%add(model, result_driving_force, n)
            call results%add(model, result_joint_rate, n)
        end if
        if (allocated(states%time)) then
            time = states%time(first:first + n - 1)
            q = states%q(:, first:first + n - 1)
            qd = states%qd(:, first:first + n - 1)
            qdd = states%qdd(:, first:first + n - 1)
            call evaluate_loads(model, time, scratch%load(:, :, :n))
            attitude = 0
            if (allocated(states%attitude)) attitude = states%attitude(:, :, first:first + n - 1)
        else
            call sample_times(model, first, time)
            call evaluate_motion(model, time, q, qd, qdd, scratch%load(:, :, :n), attitude)
        end if
        stands_alone = .not. follow_each_other(states)
        if (any(attitude /= 0)) then
            if (.not. stands_alone) call refuse_way_past_pole(model, attitude, time, status)
            if (.not. status%is_ok()) return
            call turn_by_quaternion(model, attitude, qd, qdd, spin, spin_rate, turned)
            qd => spin
            qdd => spin_rate
        end if
        motion = motion_of(q, qd, qdd, scratch%load(:, :, :n))
        motion%t => time
        if (allocated(turned)) motion%quaternion => turned
        if (stands_alone) then
            call run_prepared(model, solver, threads, motion, results)
        else
            call run_prepared(model, solver, threads, motion, results, trail=trail, turns=turns)
        end if
        if (associated(power)) &
            call find_driving_power(layout, results%of(result_driving_force)%x, results%of(result_joint_rate)%x, speed, power)
        call view_motor_loads(layout, results%of(result_driving_force)%x, results%of(result_transmission_force)%x, &
                              results%of(result_joint_rate)%x, n, block)
        call results%free()
        call flag_unsound(layout, n, block)
    end subroutine compute_block
end module linkdyn_drive_inverse
