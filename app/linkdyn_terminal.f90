!> The process and its terminal: progress line, end of the program.
module linkdyn_terminal
    use, intrinsic :: iso_fortran_env, only: error_unit, output_unit, int64
    use linkdyn_kinds, only: wp
    use linkdyn_output_file, only: is_terminal, leave_process
    implicit none (type, external)
    private
    public :: progress_type, start_progress, show_progress, show_share, end_progress, seconds_since, duration_text, &
        leave_program

    real(wp), parameter :: patience = 2         !! seconds without a sign of life
    real(wp), parameter :: refresh = 0.5_wp !! seconds between two signs

    !> A line on the terminal that says how far the run is.
    type :: progress_type
        logical :: is_wanted = .false.
        integer(int64) :: start = 0
        real(wp) :: last_shown = 0
        logical :: is_shown = .false.
    end type progress_type

contains

    subroutine start_progress(is_quiet, progress)
        logical, intent(in) :: is_quiet
        type(progress_type), intent(out) :: progress
        integer, parameter :: error_descriptor = 2

        progress%is_wanted = .not. is_quiet .and. is_terminal(error_descriptor)
        call system_clock(progress%start)
    end subroutine start_progress

    !> Share done and time left of a run whose samples come at no even pace.
    subroutine show_share(share, progress)
        real(wp), intent(in) :: share                !! 0 to 1
        type(progress_type), intent(inout) :: progress
        real(wp) :: elapsed

        if (.not. is_due(progress, elapsed) .or. .not. share > 0) return
        write (error_unit, "(a, i4, 4a)", advance="no") achar(13), int(100*share), " % done, ", &
            duration_text(elapsed*(1 - share)/share), " left", repeat(" ", 12)
        flush (error_unit)
    end subroutine show_share

    !> Is it time for a sign of life?
    logical function is_due(progress, elapsed)
        type(progress_type), intent(inout) :: progress
        real(wp), intent(out) :: elapsed             !! since the start [s]

        elapsed = seconds_since(progress%start)
        is_due = progress%is_wanted .and. elapsed >= patience .and. elapsed >= progress%last_shown + refresh
        if (.not. is_due) return
        progress%last_shown = elapsed
        progress%is_shown = .true.
    end function is_due

    !> Share done, rate and time left; nothing in a short run.
    subroutine show_progress(done, total, progress)
        integer(int64), intent(in) :: done, total    !! samples
        type(progress_type), intent(inout) :: progress
        real(wp) :: elapsed

        if (done == 0) return
        if (.not. is_due(progress, elapsed)) return
        write (error_unit, "(a, i4, a, es9.2, 4a)", advance="no") achar(13), int(100*(real(done, wp)/total)), &
            " % done, ", done/elapsed, " samples/s, ", duration_text(elapsed*(real(total - done, wp)/done)), " left", &
            repeat(" ", 12)
        flush (error_unit)
    end subroutine show_progress

    !> "35 s", "12 min", "3.4 h", "51 days", "2.5 years"
    function duration_text(seconds) result(text)
        real(wp), intent(in) :: seconds
        character(len=:), allocatable :: text
        real(wp), parameter :: minute = 60, hour = 3600, day = 24*hour, year = 365.25_wp*day
        character(len=24) :: buffer

        if (seconds < 100) then
            write (buffer, "(i0, a)") ceiling(seconds), " s"
        else if (seconds < 100*minute) then
            write (buffer, "(i0, a)") nint(seconds/minute), " min"
        else if (seconds < 2*day) then
            write (buffer, "(f5.1, a)") seconds/hour, " h"
        else if (seconds < year) then
            write (buffer, "(i0, a)") nint(seconds/day), " days"
        else
            write (buffer, "(es9.1, a)") seconds/year, " years"
        end if
        text = trim(adjustl(buffer))
    end function duration_text

    !> Wipe the line.
    subroutine end_progress(progress)
        type(progress_type), intent(inout) :: progress

        if (progress%is_shown) write (error_unit, "(3a)", advance="no") achar(13), repeat(" ", 72), achar(13)
        flush (error_unit)
        progress%is_shown = .false.
    end subroutine end_progress

    real(wp) function seconds_since(start)
        integer(int64), intent(in) :: start          !! count of the system clock
        integer(int64) :: now, rate

        call system_clock(now, rate)
        seconds_since = real(now - start, wp)/real(rate, wp)
    end function seconds_since

    !> End with an exit status. Libraries' exit handlers are left out: after a full disk netCDF's would
    !> try once more and complain in its own words.
    subroutine leave_program(status)
        integer, intent(in) :: status

        flush (output_unit)
        flush (error_unit)
        call leave_process(status)
    end subroutine leave_program
end module linkdyn_terminal
