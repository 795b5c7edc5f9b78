!> The process and its terminal: progress line, end of the program.
module linkdyn_terminal
    use, intrinsic :: iso_c_binding, only: c_int
    use, intrinsic :: iso_fortran_env, only: error_unit, output_unit, int64, real64
    implicit none (type, external)
    private
    public :: progress_type, start_progress, show_progress, end_progress, seconds_since, leave_program

    real(real64), parameter :: patience = 2         !! seconds without a sign of life
    real(real64), parameter :: refresh = 0.5_real64 !! seconds between two signs

    !> A line on the terminal that says how far the run is.
    type :: progress_type
        logical :: is_wanted = .false.
        integer(int64) :: start = 0
        real(real64) :: last_shown = 0
        logical :: is_shown = .false.
    end type progress_type

    interface
        function linkdyn_is_terminal(descriptor) result(answer) bind(c)
            import :: c_int
            integer(c_int), value :: descriptor
            integer(c_int) :: answer
        end function linkdyn_is_terminal

        subroutine linkdyn_leave(status) bind(c)
            import :: c_int
            integer(c_int), value :: status
        end subroutine linkdyn_leave
    end interface

contains

    subroutine start_progress(is_quiet, progress)
        logical, intent(in) :: is_quiet
        type(progress_type), intent(out) :: progress
        integer(c_int), parameter :: error_descriptor = 2

        progress%is_wanted = .not. is_quiet .and. linkdyn_is_terminal(error_descriptor) /= 0
        call system_clock(progress%start)
    end subroutine start_progress

    !> Share done, rate and time left; nothing in a short run.
    subroutine show_progress(done, total, progress)
        integer, intent(in) :: done, total           !! samples
        type(progress_type), intent(inout) :: progress
        real(real64) :: elapsed

        if (.not. progress%is_wanted) return
        elapsed = seconds_since(progress%start)
        if (elapsed < patience .or. elapsed < progress%last_shown + refresh .or. done == 0) return
        progress%last_shown = elapsed
        progress%is_shown = .true.
        write (error_unit, "(a, i4, a, es9.2, a, i0, a)", advance="no") achar(13), int(100*(real(done, real64)/total)), &
            " % done, ", done/elapsed, " samples/s, ", ceiling(elapsed*(real(total - done, real64)/done)), " s left   "
        flush (error_unit)
    end subroutine show_progress

    !> Wipe the line.
    subroutine end_progress(progress)
        type(progress_type), intent(inout) :: progress

        if (progress%is_shown) write (error_unit, "(3a)", advance="no") achar(13), repeat(" ", 60), achar(13)
        flush (error_unit)
        progress%is_shown = .false.
    end subroutine end_progress

    real(real64) function seconds_since(start)
        integer(int64), intent(in) :: start          !! count of the system clock
        integer(int64) :: now, rate

        call system_clock(now, rate)
        seconds_since = real(now - start, real64)/real(rate, real64)
    end function seconds_since

    !> End with an exit status. Libraries' exit handlers are left out: after a full disk netCDF's would
    !> try once more and complain in its own words.
    subroutine leave_program(status)
        integer, intent(in) :: status

        flush (output_unit)
        flush (error_unit)
        call linkdyn_leave(status)
    end subroutine leave_program
end module linkdyn_terminal
