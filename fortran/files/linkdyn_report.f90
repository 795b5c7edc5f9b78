!> A report gathered as text before it goes out: libgfortran does not say when standard output takes no more, and names and
!> titles of a scene may hold anything.
module linkdyn_report
    use linkdyn_output_file, only: print_text
    use linkdyn_text, only: printable
    use linkdyn_status, only: status_type, fail, status_io_error
    implicit none (type, external)
    private
    public :: open_report, read_report, print_report

    character(len=*), parameter :: no_room = "no room for a temporary file (expected a folder in TMPDIR, or /tmp)"

contains

    !> A unit to write the report to.
    subroutine open_report(unit, status)
        integer, intent(out) :: unit
        type(status_type), intent(inout) :: status
        integer :: outcome

        open (newunit=unit, status="scratch", access="stream", form="formatted", action="readwrite", iostat=outcome)
        if (outcome /= 0) call fail(status, status_io_error, no_room)
    end subroutine open_report

    !> What was written, line by line; the unit is closed.
    subroutine read_report(unit, text, status)
        integer, intent(in) :: unit
        character(len=:), allocatable, intent(out) :: text
        type(status_type), intent(inout) :: status
        character(len=:), allocatable :: line
        integer :: place, size_written, outcome, length

        inquire (unit=unit, pos=size_written)
        size_written = size_written - 1
        allocate (character(len=size_written) :: text, line)
        rewind (unit, iostat=outcome)
        place = 0
        do while (place < size_written)
            read (unit, "(a)", iostat=outcome, size=length, advance="no") line
            if (outcome > 0 .or. is_iostat_end(outcome)) exit
            text(place + 1:) = line(:length)//new_line("a")
            place = place + length + 1
        end do
        close (unit, iostat=outcome)
        if (place /= size_written) call fail(status, status_io_error, no_room)    ! a full disk shows here
        text = printable(text, has_lines=.true.)
    end subroutine read_report

    !> To standard output.
    subroutine print_report(unit, status)
        integer, intent(in) :: unit
        type(status_type), intent(inout) :: status
        character(len=:), allocatable :: text

        call read_report(unit, text, status)
        if (status%is_ok()) call print_text(text, status)
    end subroutine print_report
end module linkdyn_report
