!> `linkdyn sweep`: the sweep planned, large ones asked about, rounds with signs of life, results at the end.
module linkdyn_drive_sweep
    use, intrinsic :: iso_fortran_env, only: int64
    use linkdyn_checkpoint, only: sweep_hash
    use linkdyn_cli, only: command_line
    use linkdyn_clock, only: seconds_since
    use linkdyn_input, only: folder_of
    use linkdyn_kinds, only: wp
    use linkdyn_parallel, only: start_processes, stop_processes
    use linkdyn_processes, only: process_group
    use linkdyn_run_output, only: default_name, run_attributes, exit_done, exit_bad_input
    use linkdyn_scene, only: scene_type
    use linkdyn_scene_reader, only: read_scene, check_actuators
    use linkdyn_scene_variant, only: variants_of
    use linkdyn_status, only: status_type, fail, status_bad_input
    use linkdyn_sweep, only: sweep_run, start_sweep, compute_chunks, close_designs, finish_sweep
    use linkdyn_sweep_chunk, only: kept_chunk
    use linkdyn_sweep_output, only: write_sweep
    use linkdyn_sweep_plan, only: samples_of_chunk
    use linkdyn_sweep_rounds, only: sweep_rounds, begin_rounds, keep_beside, compute_round, end_rounds, kept_width
    use linkdyn_sweep_wishes, only: choose_kept
    use linkdyn_sweep_summary, only: print_sweep, sample_text
    use linkdyn_sweep_totals, only: totals_type
    use linkdyn_terminal, only: show_stage, show_progress, end_progress, say, duration_text
    implicit none (type, external)
    private
    public :: drive_sweep

    ! ---- up to these a sweep takes no hour, whatever the solver
    real(wp), parameter :: few_samples = 1.0e6_wp, few_designs = 1.0e4_wp
    ! ---- beyond these a sweep wants --yes
    real(wp), parameter :: many_samples = 1.0e10_wp, long_time = 3600, much_room = 4.0e9_wp

contains

    !> Compute and report; the exit status says how it went.
    subroutine drive_sweep(config, unit, exit_status)
        type(command_line), intent(in) :: config
        integer, intent(in) :: unit                        !! for the table
        integer, intent(out) :: exit_status
        class(process_group), allocatable :: group
        type(sweep_run) :: run
        type(sweep_rounds) :: rounds
        type(status_type) :: status, at_end
        character(len=:), allocatable :: output
        integer(int64) :: start, hash, shared(2)
        real(wp) :: seconds
        logical :: is_first

        call start_processes(group, status)
        is_first = group%this == 0
        if (.not. is_first) call end_progress()
        call show_stage("reading and planning")
        exit_status = exit_bad_input
        if (status%is_ok()) call prepare_run(config, run, status)
        hash = 0
        if (status%is_ok()) hash = sweep_hash(run)
        call group%agree(trim(config%scene), hash, status)
        if (status%is_ok()) call begin_rounds(config%options%threads, group, rounds)
        if (status%is_ok() .and. is_first) then
            output = default_name(config%scene)//"_sweep.nc"
            if (allocated(config%output)) output = config%output
            call keep_beside(output, config%resume, config%checkpoint, "--resume", run, rounds, status)
            if (status%is_ok() .and. .not. config%yes) call ask_consent(config, group%n, run, status)
        end if
        shared = [merge(1_int64, 0_int64, status%is_ok()), run%n_done]
        call group%share(shared)
        call system_clock(start)
        if (shared(1) == 1 .and. status%is_ok()) then
            run%n_done = shared(2)
            call run_rounds(config%options%threads, group, run, rounds, status)
        end if
        seconds = seconds_since(start)
        if (is_first) then
            if (status%is_ok()) call write_sweep(rounds%output, run_attributes(config, run%scene), run, rounds%spool, status)
            if (status%is_ok() .and. .not. config%quiet) call print_sweep(run, config%solver, config%options%threads, &
                group%n, seconds, rounds%output, unit)
            ! what was interrupted is kept as it was last: the next run says what is wrong with it
            at_end = status
            call end_rounds(run, status%is_ok(), rounds, at_end)
            if (.not. status%is_ok()) call say(status%message)
        end if
        if (status%is_ok()) exit_status = exit_done
        call finish_sweep(run)
        call stop_processes(group)
    end subroutine drive_sweep

    !> Read the scene and plan the sweep.
    subroutine prepare_run(config, run, status)
        type(command_line), intent(in) :: config
        type(sweep_run), intent(out) :: run
        type(status_type), intent(inout) :: status
        type(scene_type) :: scene

        call read_scene(config%scene, scene, status)
        if (status%is_ok()) call check_actuators(scene, status)
        if (.not. status%is_ok()) return
        if (allocated(config%keep)) call choose_kept(config%keep, scene%sweep, status)
        if (.not. status%is_ok() .and. index(status%message, "keep:") == 1) &
            status%message = "linkdyn: --"//trim(status%message)
        if (status%is_ok()) call start_sweep(scene, variants_of(scene, folder_of(trim(config%scene))), &
            config%options%solver, run, status)
    end subroutine prepare_run

    !> Large requests want to be meant: say how large.
    subroutine ask_consent(config, n_process, run, status)
        type(command_line), intent(in) :: config
        integer, intent(in) :: n_process
        type(sweep_run), intent(inout) :: run
        type(status_type), intent(inout) :: status
        real(wp) :: seconds, bytes, n_left
        character(len=:), allocatable :: message

        n_left = real(run%plan%n_sample, wp) - real(run%n_done, wp)*real(run%plan%chunk, wp)
        bytes = 16*real(run%plan%n_sample, wp)*kept_width(run)
        bytes = bytes + 8*real(size(run%map%worst), wp) &
                + real(run%plan%n_design, wp)*run%shape%n_entry*(64 + 16.0_wp*size(run%plan%axis))
        seconds = 0
        if (n_left > few_samples .or. run%plan%n_design > few_designs) &
            seconds = estimated_seconds(run, n_left)/(config%options%threads*n_process)
        if (n_left <= many_samples .and. seconds <= long_time .and. bytes <= much_room) return
        message = trim(config%scene)//": "//sample_text(run%plan%n_sample)//" samples take about "//duration_text(seconds)
        if (bytes > 1.0e6_wp) message = message//" and "//room_text(bytes)//" on the disk"
        call fail(status, status_bad_input, message//" (expected --yes to start all the same, or fewer samples)")
    end subroutine ask_consent

    !> Measured on the first chunk: planning its design, and its samples.
    real(wp) function estimated_seconds(run, n_left) result(seconds)
        type(sweep_run), intent(inout) :: run
        real(wp), intent(in) :: n_left                     !! samples
        type(totals_type) :: part(1)
        type(kept_chunk) :: kept(1)
        integer(int64) :: start, design, first
        real(wp) :: pass_seconds(2)
        integer :: n, pass

        call close_designs(run)
        do pass = 1, 2                                    ! the first one plans
            call system_clock(start)
            call compute_chunks(run, 0_int64, 1_int64, 1, part, kept)
            pass_seconds(pass) = seconds_since(start)
        end do
        call samples_of_chunk(run%plan, 0_int64, design, first, n)
        seconds = n_left*pass_seconds(2)/n &
                  + real(run%plan%n_design, wp)*max(0.0_wp, pass_seconds(1) - pass_seconds(2))
    end function estimated_seconds

    !> "12 MB"
    pure function room_text(bytes) result(text)
        real(wp), intent(in) :: bytes
        character(len=:), allocatable :: text
        character(len=24) :: buffer

        if (bytes < 1.0e9_wp) then
            write (buffer, "(i0, a)") nint(bytes/1.0e6_wp), " MB"
        else if (bytes < 1.0e12_wp) then
            write (buffer, "(f6.1, a)") bytes/1.0e9_wp, " GB"
        else
            write (buffer, "(es9.1, a)") bytes/1.0e12_wp, " TB"
        end if
        text = trim(adjustl(buffer))
    end function room_text

    !> Compute what is left, round by round.
    subroutine run_rounds(threads, group, run, rounds, status)
        integer, intent(in) :: threads
        class(process_group), intent(in) :: group
        type(sweep_run), intent(inout) :: run
        type(sweep_rounds), intent(inout) :: rounds
        type(status_type), intent(inout) :: status
        integer(int64) :: start, n_before, n_first

        call system_clock(start)
        n_first = run%n_done
        do
            n_before = run%n_done
            call compute_round(threads, group, run, rounds, status)
            if (run%n_done == n_before) exit
            call show_progress((run%n_done - n_first)*run%plan%chunk, (run%plan%n_chunk - n_first)*run%plan%chunk, start)
        end do
        call show_stage("writing")
    end subroutine run_rounds
end module linkdyn_drive_sweep
