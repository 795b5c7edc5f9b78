!> `linkdyn sweep`: rounds of chunks, checkpoints between them, results at the end.
module linkdyn_drive_sweep
    use, intrinsic :: iso_fortran_env, only: int64
    use linkdyn_checkpoint, only: sweep_hash, write_checkpoint, read_checkpoint, checkpoint_name, has_checkpoint
    use linkdyn_cli, only: command_line
    use linkdyn_input, only: folder_of
    use linkdyn_kinds, only: wp
    use linkdyn_file_lock, only: file_lock, take_lock, release_lock
    use linkdyn_output_file, only: output_file, open_output, discard_output, remove_file
    use linkdyn_parallel, only: start_processes, stop_processes, n_process, this_process, send_arrays, receive_arrays, &
        share_integers, agree
    use linkdyn_path, only: resolve_path, refuse_inputs, path_other
    use linkdyn_run_output, only: default_name, run_attributes, exit_done, exit_bad_input
    use linkdyn_scene, only: scene_type
    use linkdyn_scene_reader, only: read_scene, check_actuators
    use linkdyn_scene_variant, only: variants_of
    use linkdyn_spool, only: spool_type, spool_mark, open_spool, reopen_spool, append_spool, sync_spool, close_spool
    use linkdyn_status, only: status_type, fail, status_bad_input, status_io_error
    use linkdyn_sweep, only: sweep_run, start_sweep, compute_chunks, join_chunks, close_designs, finish_sweep
    use linkdyn_sweep_chunk, only: kept_chunk, make_records
    use linkdyn_sweep_output, only: write_sweep
    use linkdyn_sweep_plan, only: samples_of_chunk
    use linkdyn_sweep_wishes, only: choose_kept
    use linkdyn_sweep_summary, only: print_sweep, sample_text
    use linkdyn_sweep_totals, only: totals_type, packed_size, pack_totals, unpack_totals
    use linkdyn_terminal, only: show_stage, show_progress, end_progress, say, seconds_since, duration_text
    implicit none (type, external)
    private
    public :: drive_sweep

    real(wp), parameter :: round_seconds = 0.5_wp          !! of computing between two looks at the clock
    integer, parameter :: most_per_worker = 64             !! chunks of a thread in a round
    real(wp), parameter :: round_bytes = 64.0e6_wp         !! kept samples of a round
    real(wp), parameter :: costly = 20                     !! times as long a checkpoint's writing, at least, to the next one
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
        type(sweep_run) :: run
        type(spool_type) :: spool
        type(file_lock) :: lock
        type(status_type) :: status
        character(len=:), allocatable :: output
        integer(int64) :: start, hash, shared(2)
        real(wp) :: seconds
        logical :: is_first

        call start_processes(status)
        is_first = this_process() == 0
        if (.not. is_first) call end_progress()
        call show_stage("reading and planning")
        exit_status = exit_bad_input
        if (status%is_ok()) call prepare_run(config, run, status)
        hash = 0
        if (status%is_ok()) hash = sweep_hash(run)
        call agree(trim(config%scene), hash, status)
        if (status%is_ok() .and. is_first) then
            call choose_output(config, run%scene, output, status)
            call take_lock(output, lock, status)
            call take_up(config, output, hash, run, spool, status)
            if (status%is_ok() .and. .not. config%yes) call ask_consent(config, run, status)
        end if
        shared = [merge(1_int64, 0_int64, status%is_ok()), run%n_done]
        call share_integers(shared)
        call system_clock(start)
        if (shared(1) == 1 .and. status%is_ok()) then
            run%n_done = shared(2)
            call run_rounds(config, output, hash, spool, run, status)
        end if
        seconds = seconds_since(start)
        if (is_first) then
            if (status%is_ok()) call write_sweep(output, run_attributes(config, run%scene, ""), run, spool, status)
            call close_spool(spool, status%is_ok())
            if (status%is_ok()) call remove_file(checkpoint_name(output))
            call release_lock(lock)
            if (status%is_ok() .and. .not. config%quiet) call print_sweep(run, config%solver, config%options%threads, &
                n_process(), seconds, output, unit)
            if (.not. status%is_ok()) call say(status%message)
        end if
        if (status%is_ok()) exit_status = exit_done
        call finish_sweep(run)
        call stop_processes()
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

    !> Where the results go, behind all links: checkpoint, spool and lock stand beside that file.
    subroutine choose_output(config, scene, output, status)
        type(command_line), intent(in) :: config
        type(scene_type), intent(in) :: scene
        character(len=:), allocatable, intent(out) :: output
        type(status_type), intent(inout) :: status
        character(len=:), allocatable :: name
        integer :: kind

        name = default_name(config%scene)//"_sweep.nc"
        if (allocated(config%output)) name = config%output
        call resolve_path(name, output, kind, status)
        if (kind == path_other) call fail(status, status_io_error, name//": cannot be written: is a device or a pipe " &
                                          //"(expected a file name: a sweep keeps its checkpoint beside it)")
        call refuse_inputs(name, scene, status)
        call refuse_inputs(checkpoint_name(output), scene, status)
        call refuse_inputs(spool_name(output), scene, status)
    end subroutine choose_output

    pure function spool_name(output) result(name)
        character(len=*), intent(in) :: output
        character(len=:), allocatable :: name

        name = output//".spool"
    end function spool_name

    !> Find out at once whether the results can be written, and where an earlier run stands.
    subroutine take_up(config, output, hash, run, spool, status)
        type(command_line), intent(in) :: config
        character(len=*), intent(in) :: output
        integer(int64), intent(in) :: hash
        type(sweep_run), intent(inout) :: run
        type(spool_type), intent(inout) :: spool           !! opened if samples are kept
        type(status_type), intent(inout) :: status
        type(output_file) :: file
        type(spool_mark) :: mark
        integer :: width

        if (.not. status%is_ok()) return
        width = 1 + size(run%plan%axis) + size(run%keep)
        if (config%resume .and. has_checkpoint(output)) then
            call read_checkpoint(output, hash, run, mark, status)
            if (status%is_ok() .and. any(run%spec%keeps)) call reopen_spool(spool_name(output), width, mark, spool, status)
        else if (has_checkpoint(output)) then
            call fail(status, status_bad_input, checkpoint_name(output)//": an interrupted run is kept there "// &
                "(expected --resume to go on with it; to start anew, remove this file)")
        end if
        if (.not. status%is_ok()) return
        call open_output(output, .false., file, status)
        call discard_output(file)
        if (status%is_ok() .and. any(run%spec%keeps) .and. .not. allocated(spool%name)) &
            call open_spool(spool_name(output), width, spool, status)
    end subroutine take_up

    !> Large requests want to be meant: say how large.
    subroutine ask_consent(config, run, status)
        type(command_line), intent(in) :: config
        type(sweep_run), intent(inout) :: run
        type(status_type), intent(inout) :: status
        real(wp) :: seconds, bytes, n_left
        character(len=:), allocatable :: message

        n_left = real(run%plan%n_sample, wp) - real(run%n_done, wp)*real(run%plan%chunk, wp)
        bytes = 0
        if (any(run%spec%keeps)) bytes = 16*real(run%plan%n_sample, wp)*(1 + size(run%plan%axis) + size(run%keep))
        bytes = bytes + 8*real(size(run%map%worst), wp) &
                + real(run%plan%n_design, wp)*run%shape%n_entry*(64 + 16.0_wp*size(run%plan%axis))
        seconds = 0
        if (n_left > few_samples .or. run%plan%n_design > few_designs) &
            seconds = estimated_seconds(run, n_left)/(config%options%threads*n_process())
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

    !> Compute what is left, round by round. Rounds are as long as it takes; the results do not depend on it.
    subroutine run_rounds(config, output, hash, spool, run, status)
        type(command_line), intent(in) :: config
        character(len=*), intent(in) :: output
        integer(int64), intent(in) :: hash
        type(spool_type), intent(inout) :: spool
        type(sweep_run), intent(inout) :: run
        type(status_type), intent(inout) :: status
        type(totals_type), allocatable :: part(:)
        type(kept_chunk), allocatable :: kept(:)
        integer(int64) :: n_left, shared(1), run_start, round_start, kept_start, n_before
        real(wp) :: elapsed, spent, keeping
        integer :: n_worker, n_round, n_own, most, width

        n_worker = config%options%threads*n_process()
        most = most_per_worker
        width = 0
        if (any(run%spec%keeps)) width = 1 + size(run%plan%axis) + size(run%keep)
        if (run%map%is_wanted) width = width + 2 + size(run%row%quantity)
        if (width > 0) most = max(1, min(most, int(round_bytes/(8.0_wp*n_worker*run%plan%chunk*width))))
        call system_clock(run_start)
        kept_start = run_start
        n_before = run%n_done
        n_round = n_worker
        keeping = 0
        do
            n_left = run%plan%n_chunk - run%n_done
            shared = min(int(n_round, int64), n_left)
            if (.not. status%is_ok()) shared = 0
            call share_integers(shared)
            if (shared(1) == 0) exit
            n_round = int(shared(1))
            call system_clock(round_start)
            ! This process has chunks this_process() + 1, ... of the round.
            n_own = (n_round - this_process() + n_process() - 1)/n_process()
            if (allocated(part)) deallocate (part)
            allocate (part(n_own))
            if (allocated(kept)) then
                if (size(kept) < n_own) deallocate (kept)
            end if
            if (.not. allocated(kept)) allocate (kept(n_own))
            if (n_own > 0) call compute_chunks(run, run%n_done + this_process(), int(n_process(), int64), &
                config%options%threads, part, kept(:n_own))
            call gather_round(n_round, part, kept, spool, run, status)
            elapsed = seconds_since(round_start)
            call show_progress((run%n_done - n_before)*run%plan%chunk, (run%plan%n_chunk - n_before)*run%plan%chunk, run_start)
            spent = seconds_since(kept_start)
            if (this_process() == 0 .and. run%n_done < run%plan%n_chunk .and. &
                spent > max(config%checkpoint, costly*keeping)) then
                call system_clock(kept_start)
                call sync_spool(spool, status)
                if (status%is_ok()) call write_checkpoint(output, hash, run, spool%mark, status)
                keeping = seconds_since(kept_start)
                call system_clock(kept_start)
            end if
            n_round = n_worker*max(1, min(most, int(real(n_round, wp)/n_worker*max(0.5_wp, min(2.0_wp, &
                round_seconds/max(elapsed, 1.0e-6_wp))) + 0.5_wp)))
        end do
        call show_stage("writing")
        ! All is computed: whatever happens to the results while they are written, --resume will write them again.
        if (this_process() == 0 .and. status%is_ok() .and. seconds_since(run_start) > config%checkpoint) &
            call write_checkpoint(output, hash, run, spool%mark, status)
    end subroutine run_rounds

    !> All processes' chunks to process 0, joined and kept there in order.
    subroutine gather_round(n_round, part, kept, spool, run, status)
        integer, intent(in) :: n_round
        type(totals_type), intent(in) :: part(:)
        type(kept_chunk), intent(inout) :: kept(:)
        type(spool_type), intent(inout) :: spool
        type(sweep_run), intent(inout) :: run
        type(status_type), intent(inout) :: status
        type(totals_type) :: other(1)
        type(kept_chunk) :: other_kept(1)
        real(wp), allocatable :: reals(:), records(:, :)
        integer(int64), allocatable :: integers(:)
        integer(int64) :: design, first
        integer :: k, n, owner, own, n_real, n_integer

        call packed_size(run%shape, n_real, n_integer)
        allocate (reals(n_real), integers(n_integer))
        do k = 1, n_round
            owner = modulo(k - 1, n_process())
            own = (k - 1)/n_process() + 1
            call samples_of_chunk(run%plan, run%n_done, design, first, n)
            if (any(run%spec%keeps)) then
                if (allocated(records)) deallocate (records)
                allocate (records(1 + size(run%plan%axis) + size(run%keep), n))
                if (owner == this_process()) call make_records(kept(own), n, records)
            end if
            if (this_process() > 0) then
                if (owner == this_process()) then
                    call pack_totals(part(own), reals, integers)
                    call send_arrays(reals, integers)
                    call send_map(run, kept(own))
                    if (allocated(records)) call send_arrays(reshape(records, [size(records)]), integers(:0))
                end if
                run%n_done = run%n_done + 1
                cycle
            end if
            if (owner == 0) then
                call join_chunks(run, part(own:own), kept(own:own))
            else
                call receive_arrays(owner, reals, integers)
                call unpack_totals(run%shape, reals, integers, other(1))
                call receive_map(owner, run, other_kept(1))
                call join_chunks(run, other, other_kept)
                if (allocated(records)) call receive_records(owner, records)
            end if
            if (allocated(records)) call append_spool(spool, records, status)
        end do
    end subroutine gather_round

    !> A chunk's share of the map: its length, then its cells.
    subroutine send_map(run, kept)
        type(sweep_run), intent(in) :: run
        type(kept_chunk), intent(in) :: kept
        real(wp) :: no_reals(0)

        if (.not. run%map%is_wanted) return
        associate (map => kept%map)
            call send_arrays(no_reals, [int(map%n, int64)])
            call send_arrays(reshape(map%worst(:, :map%n), [size(map%worst, 1)*map%n]), &
                [map%cell(:map%n), map%n_feasible(:map%n)])
        end associate
    end subroutine send_map

    subroutine receive_map(owner, run, kept)
        integer, intent(in) :: owner
        type(sweep_run), intent(in) :: run
        type(kept_chunk), intent(inout) :: kept
        real(wp), allocatable :: reals(:)
        integer(int64), allocatable :: integers(:)
        integer(int64) :: n(1)
        real(wp) :: no_reals(0)

        if (.not. run%map%is_wanted) return
        call receive_arrays(owner, no_reals, n)
        allocate (reals(size(run%row%quantity)*n(1)), integers(2*n(1)))
        call receive_arrays(owner, reals, integers)
        kept%map%n = int(n(1))
        kept%map%cell = integers(:n(1))
        kept%map%n_feasible = integers(n(1) + 1:)
        kept%map%worst = reshape(reals, [size(run%row%quantity), int(n(1))])
    end subroutine receive_map

    subroutine receive_records(owner, records)
        integer, intent(in) :: owner
        real(wp), intent(inout) :: records(:, :)
        real(wp) :: flat(size(records))
        integer(int64) :: nothing(0)

        call receive_arrays(owner, flat, nothing)
        records = reshape(flat, shape(records))
    end subroutine receive_records
end module linkdyn_drive_sweep
