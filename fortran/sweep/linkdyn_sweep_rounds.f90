!> A sweep on its way, in rounds of chunks: by one process or several, in memory or with what is done kept beside its results, so
!> that what was interrupted can be gone on with.
!>
!> Rounds are as long as it takes to hear an interrupt and to tell how far the work is; the results do not depend on it. What is
!> kept belongs to the file that the results are for: checkpoint, spool of kept samples, and a lock that says who is at it.
module linkdyn_sweep_rounds
    use, intrinsic :: iso_fortran_env, only: int64
    use linkdyn_checkpoint, only: sweep_hash, write_checkpoint, read_checkpoint, checkpoint_name, has_checkpoint
    use linkdyn_clock, only: seconds_since
    use linkdyn_file_lock, only: file_lock, take_lock, release_lock
    use linkdyn_interrupt, only: is_interrupted
    use linkdyn_kinds, only: wp
    use linkdyn_output_file, only: output_file, open_output, discard_output, remove_file
    use linkdyn_path, only: resolve_path, refuse_inputs, path_other
    use linkdyn_processes, only: process_group
    use linkdyn_spool, only: spool_type, spool_mark, open_spool, reopen_spool, append_spool, sync_spool, close_spool
    use linkdyn_status, only: status_type, fail, status_bad_input, status_io_error
    use linkdyn_sweep, only: sweep_run, compute_chunks, join_chunks
    use linkdyn_sweep_chunk, only: kept_chunk, make_records
    use linkdyn_sweep_plan, only: samples_of_chunk
    use linkdyn_sweep_totals, only: totals_type, packed_size, pack_totals, unpack_totals
    implicit none (type, external)
    private
    public :: sweep_rounds, begin_rounds, keep_beside, compute_round, end_rounds, kept_width, most_kept

    real(wp), parameter :: round_seconds = 0.4_wp          !! of computing between two looks at the clock
    integer, parameter :: most_per_worker = 64             !! chunks of a thread in a round
    real(wp), parameter :: round_bytes = 64.0e6_wp         !! kept samples of a round
    real(wp), parameter :: costly = 20                     !! times as long a checkpoint's writing, at least, to the next one

    type :: sweep_rounds
        integer :: n_next = 0                              !! chunks of the next round, if as many are left
        integer, private :: n_worker = 1                   !! threads of all processes
        ! ---- kept beside the results, if they are for a file
        character(len=:), allocatable :: output            !! that file, behind all links
        real(wp) :: interval = 0                           !! seconds between two checkpoints
        type(spool_type) :: spool                          !! of kept samples
        type(file_lock), private :: lock
        integer(int64), private :: hash = 0                !! whose work it is
        integer(int64), private :: kept_at = 0             !! the last checkpoint, a count of the system clock
        real(wp), private :: keeping = 0                   !! what that took [s]
        logical, private :: has_kept = .false.             !! there is one, of this run
        ! ---- room for a round, which stays
        type(kept_chunk), allocatable, private :: kept(:)
    end type sweep_rounds

contains

    !> Values kept of a sample; 0: nothing is kept.
    pure integer function kept_width(run) result(width)
        type(sweep_run), intent(in) :: run

        width = 0
        if (any(run%spec%keeps)) width = 1 + size(run%plan%axis) + size(run%keep)
    end function kept_width

    subroutine begin_rounds(threads, group, rounds)
        integer, intent(in) :: threads                     !! of a process
        class(process_group), intent(in) :: group
        type(sweep_rounds), intent(inout) :: rounds

        rounds%n_worker = max(1, threads)*group%n
        rounds%n_next = rounds%n_worker
        call system_clock(rounds%kept_at)
    end subroutine begin_rounds

    !> Chunks of a thread in a round.
    pure integer function most_chunks(run, rounds) result(most)
        type(sweep_run), intent(in) :: run
        type(sweep_rounds), intent(in) :: rounds
        integer :: width

        most = most_per_worker
        width = kept_width(run)
        if (run%map%is_wanted) width = width + 2 + size(run%row%quantity)
        if (width > 0) most = max(1, min(most, int(round_bytes/(8.0_wp*rounds%n_worker*run%plan%chunk*width))))
    end function most_chunks

    !> Samples of a round at most.
    pure integer(int64) function most_kept(run, rounds)
        type(sweep_run), intent(in) :: run
        type(sweep_rounds), intent(in) :: rounds

        most_kept = min(int(rounds%n_next, int64)*run%plan%chunk, run%plan%n_sample)
    end function most_kept

    ! ---------------------------------------------------------------- beside the results

    !> The results are for a file: take its lock, find out at once whether it can be written, and go on where an earlier run stands.
    !>
    !> **Errors**: `status_bad_input` if another process is at it, or an interrupted run is kept there that is not to be gone on
    !> with; `status_io_error` for what cannot be read or written.
    subroutine keep_beside(name, resumes, interval, to_resume, run, rounds, status)
        character(len=*), intent(in) :: name               !! of the results
        logical, intent(in) :: resumes                     !! an interrupted run is gone on with, if there is one
        real(wp), intent(in) :: interval                   !! seconds between two checkpoints
        character(len=*), intent(in) :: to_resume          !! how to ask for that, in words
        type(sweep_run), intent(inout) :: run
        type(sweep_rounds), intent(inout) :: rounds
        type(status_type), intent(inout) :: status
        integer :: kind

        if (.not. status%is_ok()) return
        rounds%interval = interval
        call resolve_path(name, rounds%output, kind, status)
        if (kind == path_other) call fail(status, status_io_error, name//": cannot be written: is a device or a pipe " &
                                          //"(expected a file name: a sweep keeps its checkpoint beside it)")
        call refuse_inputs(name, run%scene, status)
        call refuse_inputs(checkpoint_name(rounds%output), run%scene, status)
        call refuse_inputs(spool_name(rounds%output), run%scene, status)
        rounds%hash = sweep_hash(run)
        call take_lock(rounds%output, rounds%lock, status)
        call take_up(resumes, to_resume, run, rounds, status)
        call system_clock(rounds%kept_at)
    end subroutine keep_beside

    pure function spool_name(output) result(name)
        character(len=*), intent(in) :: output
        character(len=:), allocatable :: name

        name = output//".spool"
    end function spool_name

    !> Where an earlier run stands, and whether the results can be written.
    subroutine take_up(resumes, to_resume, run, rounds, status)
        logical, intent(in) :: resumes
        character(len=*), intent(in) :: to_resume
        type(sweep_run), intent(inout) :: run
        type(sweep_rounds), intent(inout) :: rounds
        type(status_type), intent(inout) :: status
        type(output_file) :: file
        type(spool_mark) :: mark
        integer :: width

        if (.not. status%is_ok()) return
        width = kept_width(run)
        associate (output => rounds%output)
            if (resumes .and. has_checkpoint(output)) then
                call read_checkpoint(output, rounds%hash, run, mark, status)
                if (status%is_ok() .and. width > 0) call reopen_spool(spool_name(output), width, mark, rounds%spool, status)
            else if (has_checkpoint(output)) then
                call fail(status, status_bad_input, checkpoint_name(output)//": an interrupted run is kept there (expected " &
                          //to_resume//" to go on with it; to start anew, remove this file)")
            end if
            if (.not. status%is_ok()) return
            call open_output(output, .false., file, status)
            call discard_output(file)
            if (status%is_ok() .and. width > 0 .and. .not. allocated(rounds%spool%name)) &
                call open_spool(spool_name(output), width, rounds%spool, status)
        end associate
    end subroutine take_up

    !> Keep where the run stands.
    subroutine keep(run, rounds, status)
        type(sweep_run), intent(in) :: run
        type(sweep_rounds), intent(inout) :: rounds
        type(status_type), intent(inout) :: status
        integer(int64) :: start

        call system_clock(start)
        call sync_spool(rounds%spool, status)
        if (status%is_ok()) call write_checkpoint(rounds%output, rounds%hash, run, rounds%spool%mark, status)
        rounds%keeping = seconds_since(start)
        rounds%has_kept = status%is_ok()
        call system_clock(rounds%kept_at)
    end subroutine keep

    !> The end: the results are there (`is_done`), and nothing is kept any more; or the run was interrupted, and is kept as it
    !> stands.
    subroutine end_rounds(run, is_done, rounds, status)
        type(sweep_run), intent(in) :: run
        logical, intent(in) :: is_done
        type(sweep_rounds), intent(inout) :: rounds
        type(status_type), intent(inout) :: status

        if (.not. allocated(rounds%output)) return
        if (.not. is_done .and. status%is_ok() .and. run%n_done > 0) call keep(run, rounds, status)
        ! without a checkpoint nobody can go on with the spool
        call close_spool(rounds%spool, is_done .or. .not. has_checkpoint(rounds%output))
        if (is_done) call remove_file(checkpoint_name(rounds%output))
        call release_lock(rounds%lock)
        deallocate (rounds%output)
    end subroutine end_rounds

    ! ---------------------------------------------------------------- rounds

    !> Compute the next chunks, join them in their order, and keep what is to be kept. After the last one there is nothing to do.
    !>
    !> An interrupt leaves the round out: nothing of it is joined.
    subroutine compute_round(threads, group, run, rounds, status, records, n_record)
        integer, intent(in) :: threads                     !! of this process
        class(process_group), intent(in) :: group
        type(sweep_run), intent(inout) :: run
        type(sweep_rounds), intent(inout) :: rounds
        type(status_type), intent(inout) :: status
        real(wp), intent(inout), optional :: records(:, :) !! kept samples of the round, if no file keeps them (kept_width,
                                                           !! most_kept)
        integer, intent(out), optional :: n_record         !! how many these are
        type(totals_type), allocatable :: part(:)
        integer(int64) :: shared(1), start
        integer :: n_round, n_own

        if (present(n_record)) n_record = 0
        shared = min(int(rounds%n_next, int64), run%plan%n_chunk - run%n_done)
        if (.not. status%is_ok()) shared = 0
        call group%share(shared)
        n_round = int(shared(1))
        if (n_round == 0) return
        call system_clock(start)
        ! This process has chunks group%this + 1, group%this + 1 + group%n, ... of the round.
        n_own = (n_round - group%this + group%n - 1)/group%n
        allocate (part(n_own))
        if (allocated(rounds%kept)) then
            if (size(rounds%kept) < n_own) deallocate (rounds%kept)
        end if
        if (.not. allocated(rounds%kept)) allocate (rounds%kept(n_own))
        if (n_own > 0) call compute_chunks(run, run%n_done + group%this, int(group%n, int64), threads, part, rounds%kept(:n_own))
        if (is_interrupted()) return
        call gather_round(n_round, part, group, run, rounds, status, records, n_record)
        call choose_next(n_round, seconds_since(start), run, rounds)
        if (group%this > 0 .or. .not. allocated(rounds%output)) return
        ! All is computed in the end: whatever happens to the results while they are written, they can be written again.
        if (merge(seconds_since(rounds%kept_at) > max(rounds%interval, costly*rounds%keeping), &
                  rounds%has_kept .or. seconds_since(rounds%kept_at) > rounds%interval, run%n_done < run%plan%n_chunk) &
            .and. status%is_ok()) call keep(run, rounds, status)
    end subroutine compute_round

    !> A round that takes about as long as rounds should, by what the last one took.
    pure subroutine choose_next(n_round, seconds, run, rounds)
        integer, intent(in) :: n_round                     !! chunks of the last one
        real(wp), intent(in) :: seconds
        type(sweep_run), intent(in) :: run
        type(sweep_rounds), intent(inout) :: rounds
        real(wp) :: factor

        factor = max(0.5_wp, min(2.0_wp, round_seconds/max(seconds, 1.0e-6_wp)))
        associate (n => rounds%n_worker)
            rounds%n_next = n*max(1, min(most_chunks(run, rounds), int(real(n_round, wp)/n*factor + 0.5_wp)))
        end associate
    end subroutine choose_next

    !> All processes' chunks to process 0, joined and kept there in order.
    subroutine gather_round(n_round, part, group, run, rounds, status, kept_records, n_record)
        integer, intent(in) :: n_round
        type(totals_type), intent(in) :: part(:)
        class(process_group), intent(in) :: group
        type(sweep_run), intent(inout) :: run
        type(sweep_rounds), intent(inout) :: rounds
        type(status_type), intent(inout) :: status
        real(wp), intent(inout), optional :: kept_records(:, :)
        integer, intent(inout), optional :: n_record
        type(totals_type) :: other(1)
        type(kept_chunk) :: other_kept(1)
        real(wp), allocatable :: reals(:), records(:, :)
        integer(int64), allocatable :: integers(:)
        integer(int64) :: design, first
        integer :: k, n, owner, own, n_real, n_integer, width

        width = kept_width(run)
        call packed_size(run%shape, n_real, n_integer)
        allocate (reals(n_real), integers(n_integer))
        do k = 1, n_round
            owner = modulo(k - 1, group%n)
            own = (k - 1)/group%n + 1
            call samples_of_chunk(run%plan, run%n_done, design, first, n)
            if (width > 0) then
                if (allocated(records)) deallocate (records)
                allocate (records(width, n))
                if (owner == group%this) call make_records(rounds%kept(own), n, records)
            end if
            if (group%this > 0) then
                if (owner == group%this) then
                    call pack_totals(part(own), reals, integers)
                    call group%send(reals, integers)
                    call send_map(group, run, rounds%kept(own))
                    if (allocated(records)) call group%send(reshape(records, [size(records)]), integers(:0))
                end if
                run%n_done = run%n_done + 1
                cycle
            end if
            if (owner == 0) then
                call join_chunks(run, part(own:own), rounds%kept(own:own))
            else
                call group%receive(owner, reals, integers)
                call unpack_totals(run%shape, reals, integers, other(1))
                call receive_map(group, owner, run, other_kept(1))
                call join_chunks(run, other, other_kept)
                if (allocated(records)) call receive_records(group, owner, records)
            end if
            if (.not. allocated(records)) cycle
            if (allocated(rounds%output)) then
                call append_spool(rounds%spool, records, status)
            else if (present(kept_records)) then
                kept_records(:, n_record + 1:n_record + n) = records
                n_record = n_record + n
            end if
        end do
    end subroutine gather_round

    !> A chunk's share of the map: its length, then its cells.
    subroutine send_map(group, run, kept)
        class(process_group), intent(in) :: group
        type(sweep_run), intent(in) :: run
        type(kept_chunk), intent(in) :: kept
        real(wp) :: no_reals(0)

        if (.not. run%map%is_wanted) return
        associate (map => kept%map)
            call group%send(no_reals, [int(map%n, int64)])
            call group%send(reshape(map%worst(:, :map%n), [size(map%worst, 1)*map%n]), [map%cell(:map%n), map%n_feasible(:map%n)])
        end associate
    end subroutine send_map

    subroutine receive_map(group, owner, run, kept)
        class(process_group), intent(in) :: group
        integer, intent(in) :: owner
        type(sweep_run), intent(in) :: run
        type(kept_chunk), intent(inout) :: kept
        real(wp), allocatable :: reals(:)
        integer(int64), allocatable :: integers(:)
        integer(int64) :: n(1)
        real(wp) :: no_reals(0)

        if (.not. run%map%is_wanted) return
        call group%receive(owner, no_reals, n)
        allocate (reals(size(run%row%quantity)*n(1)), integers(2*n(1)))
        call group%receive(owner, reals, integers)
        kept%map%n = int(n(1))
        kept%map%cell = integers(:n(1))
        kept%map%n_feasible = integers(n(1) + 1:)
        kept%map%worst = reshape(reals, [size(run%row%quantity), int(n(1))])
    end subroutine receive_map

    subroutine receive_records(group, owner, records)
        class(process_group), intent(in) :: group
        integer, intent(in) :: owner
        real(wp), intent(inout) :: records(:, :)
        real(wp) :: flat(size(records))
        integer(int64) :: nothing(0)

        call group%receive(owner, flat, nothing)
        records = reshape(flat, shape(records))
    end subroutine receive_records
end module linkdyn_sweep_rounds
