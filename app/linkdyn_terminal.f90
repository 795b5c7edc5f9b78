!> The process and its terminal: signs of life, messages, end of the program.
!>
!> A line on the terminal says every half second how far the work is, however long a single piece of it takes: a timer of the
!> system writes it (c/linkdyn_progress_line.c), and the work only says what there is to tell.
module linkdyn_terminal
    use, intrinsic :: iso_fortran_env, only: error_unit, output_unit, int64
    use linkdyn_clock, only: seconds_since
    use linkdyn_kinds, only: wp
    use linkdyn_output_file, only: is_terminal, leave_process
    use linkdyn_progress_line, only: start_sign, set_sign, end_sign
    use linkdyn_text, only: printable, to_text
    implicit none (type, external)
    private
    public :: start_progress, show_stage, show_progress, show_share, end_progress, say, duration_text, leave_program

contains

    !> Begin to give signs of life, unless nobody would see them or wants to.
    subroutine start_progress(is_quiet)
        logical, intent(in) :: is_quiet
        integer, parameter :: error_descriptor = 2

        if (.not. is_quiet .and. is_terminal(error_descriptor)) call start_sign()
    end subroutine start_progress

    !> What is done now, where no share of it can be told.
    subroutine show_stage(stage)
        character(len=*), intent(in) :: stage

        call set_sign(stage)
    end subroutine show_stage

    !> Share done and time left of a run whose samples come at no even pace.
    subroutine show_share(share, start)
        real(wp), intent(in) :: share                !! 0 to 1
        integer(int64), intent(in) :: start          !! of the run, a count of the system clock

        if (share > 0) call set_sign(to_text(int(100*min(share, 1.0_wp)))//" % done, " &
                                     //duration_text(seconds_since(start)*(1 - share)/share)//" left")
    end subroutine show_share

    !> Share done, rate and time left.
    subroutine show_progress(done, total, start)
        integer(int64), intent(in) :: done, total    !! samples
        integer(int64), intent(in) :: start          !! of the run, a count of the system clock
        character(len=10) :: rate
        real(wp) :: elapsed

        if (done == 0) return
        elapsed = seconds_since(start)
        write (rate, "(es9.2)") done/max(elapsed, tiny(elapsed))
        call set_sign(to_text(int(100*(real(done, wp)/total)))//" % done, "//trim(adjustl(rate))//" samples/s, " &
                      //duration_text(elapsed*(real(total - done, wp)/done))//" left")
    end subroutine show_progress

    !> Wipe the line.
    subroutine end_progress()
        call end_sign()
    end subroutine end_progress

    !> One line on standard error.
    subroutine say(message)
        character(len=*), intent(in) :: message

        call end_progress()
        write (error_unit, "(a)") printable(trim(message))
        flush (error_unit)
    end subroutine say

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

    !> End with an exit status. Libraries' exit handlers are left out: after a full disk netCDF's would
    !> try once more and complain in its own words.
    subroutine leave_program(status)
        integer, intent(in) :: status

        call end_progress()
        flush (output_unit)
        flush (error_unit)
        call leave_process(status)
    end subroutine leave_program
end module linkdyn_terminal
