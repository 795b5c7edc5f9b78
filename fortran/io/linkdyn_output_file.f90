!> A file that is either there whole or not at all: written beside its target, renamed at the end.
module linkdyn_output_file
    use, intrinsic :: iso_c_binding, only: c_char, c_int
    use linkdyn_scene, only: path_len
    use linkdyn_status, only: status_type, fail, status_io_error
    use linkdyn_text, only: to_text
    implicit none (type, external)
    private
    public :: output_file, open_output, commit_output, discard_output, writing_failed
    public :: open_text, write_text, close_text, finish_text, print_text
    public :: is_terminal, leave_process, watch_interrupts, interrupt_noted, path_exists, remove_file
    public :: linkdyn_close_write    ! of c/, for other files that are open by descriptor

    integer, parameter :: path_missing = 0, path_file = 1, path_directory = 2   !! of linkdyn_output.h

    integer, parameter :: probe_blocks = 256   !! 16 MiB are more than a library tried to write at once

    !> Where to write, and where the result goes.
    type :: output_file
        character(len=path_len) :: target = ""    !! as the user gave it
        character(len=path_len) :: part = ""      !! what is written to
        logical :: is_direct = .false.            !! a device or pipe: nothing to rename
        integer :: descriptor = -1                !! of a text file while it is open
    end type output_file

    interface
        function linkdyn_path_kind(path, path_len) result(kind) bind(c)
            import :: c_char, c_int
            character(kind=c_char), intent(in) :: path(*)
            integer(c_int), value :: path_len
            integer(c_int) :: kind
        end function linkdyn_path_kind

        function linkdyn_probe_write(path, path_len, n_block, reason, reason_len) result(outcome) bind(c)
            import :: c_char, c_int
            character(kind=c_char), intent(in) :: path(*)
            integer(c_int), value :: path_len, n_block
            character(kind=c_char), intent(inout) :: reason(*)
            integer(c_int), value :: reason_len
            integer(c_int) :: outcome
        end function linkdyn_probe_write

        function linkdyn_replace_file(from, from_len, to, to_len, reason, reason_len) result(outcome) bind(c)
            import :: c_char, c_int
            character(kind=c_char), intent(in) :: from(*), to(*)
            integer(c_int), value :: from_len, to_len
            character(kind=c_char), intent(inout) :: reason(*)
            integer(c_int), value :: reason_len
            integer(c_int) :: outcome
        end function linkdyn_replace_file

        function linkdyn_open_write(path, path_len, reason, reason_len) result(descriptor) bind(c)
            import :: c_char, c_int
            character(kind=c_char), intent(in) :: path(*)
            integer(c_int), value :: path_len
            character(kind=c_char), intent(inout) :: reason(*)
            integer(c_int), value :: reason_len
            integer(c_int) :: descriptor
        end function linkdyn_open_write

        function linkdyn_write_text(descriptor, text, text_len, reason, reason_len) result(outcome) bind(c)
            import :: c_char, c_int
            integer(c_int), value :: descriptor
            character(kind=c_char), intent(in) :: text(*)
            integer(c_int), value :: text_len
            character(kind=c_char), intent(inout) :: reason(*)
            integer(c_int), value :: reason_len
            integer(c_int) :: outcome
        end function linkdyn_write_text

        function linkdyn_close_write(descriptor, reason, reason_len) result(outcome) bind(c)
            import :: c_char, c_int
            integer(c_int), value :: descriptor
            character(kind=c_char), intent(inout) :: reason(*)
            integer(c_int), value :: reason_len
            integer(c_int) :: outcome
        end function linkdyn_close_write

        subroutine linkdyn_remove_file(path, path_len) bind(c)
            import :: c_char, c_int
            character(kind=c_char), intent(in) :: path(*)
            integer(c_int), value :: path_len
        end subroutine linkdyn_remove_file

        subroutine linkdyn_guard_file(path, path_len) bind(c)
            import :: c_char, c_int
            character(kind=c_char), intent(in) :: path(*)
            integer(c_int), value :: path_len
        end subroutine linkdyn_guard_file

        subroutine linkdyn_watch_interrupts() bind(c)
        end subroutine linkdyn_watch_interrupts

        function linkdyn_interrupt() result(signal) bind(c)
            import :: c_int
            integer(c_int) :: signal
        end function linkdyn_interrupt

        function linkdyn_process_id() result(id) bind(c)
            import :: c_int
            integer(c_int) :: id
        end function linkdyn_process_id

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

    !> Choose the name to write to and find out at once whether it can be written.
    subroutine open_output(target, allow_device, file, status)
        character(len=*), intent(in) :: target
        logical, intent(in) :: allow_device       !! a device or pipe is written to as it is
        type(output_file), intent(out) :: file
        type(status_type), intent(inout) :: status
        integer(c_int) :: kind

        file%target = target
        kind = linkdyn_path_kind(target, len_trim(target))
        select case (kind)
        case (path_directory)
            call fail(status, status_io_error, trim(target)//": cannot be written: is a folder (expected a file name)")
            return
        case (path_missing, path_file)
            file%part = trim(target)//"."//to_text(int(linkdyn_process_id()))//".part"
        case default
            file%is_direct = .true.
            file%part = target
            if (.not. allow_device) call fail(status, status_io_error, &
                trim(target)//": cannot be written: is a device or a pipe (expected a file name, or --csv)")
            return
        end select
        call linkdyn_guard_file(file%part, len_trim(file%part))
        call probe(file, 1, status)
        call linkdyn_remove_file(file%part, len_trim(file%part))
    end subroutine open_output

    !> Start writing text to it.
    subroutine open_text(file, status)
        type(output_file), intent(inout) :: file
        type(status_type), intent(inout) :: status
        character(len=128) :: reason

        file%descriptor = linkdyn_open_write(file%part, len_trim(file%part), reason, len(reason))
        if (file%descriptor < 0) call writing_failed(file, reason, status)
    end subroutine open_text

    !> Append text as it is.
    subroutine write_text(file, text, status)
        type(output_file), intent(in) :: file
        character(len=*), intent(in) :: text
        type(status_type), intent(inout) :: status
        character(len=128) :: reason

        if (.not. status%is_ok()) return
        if (linkdyn_write_text(file%descriptor, text, len(text), reason, len(reason)) /= 0) &
            call writing_failed(file, reason, status)
    end subroutine write_text

    !> Write to standard output, and find out whether it took the text.
    subroutine print_text(text, status)
        character(len=*), intent(in) :: text
        type(status_type), intent(inout) :: status
        integer(c_int), parameter :: standard_output = 1
        character(len=128) :: reason

        if (len(text) == 0) return
        if (linkdyn_write_text(standard_output, text, len(text), reason, len(reason)) /= 0) &
            call fail(status, status_io_error, "standard output: cannot be written: "//trim(reason))
    end subroutine print_text

    subroutine close_text(file, status)
        type(output_file), intent(inout) :: file
        type(status_type), intent(inout) :: status
        character(len=128) :: reason

        if (file%descriptor < 0) return
        if (linkdyn_close_write(file%descriptor, reason, len(reason)) /= 0) call writing_failed(file, reason, status)
        file%descriptor = -1
    end subroutine close_text

    !> Close the file and put it in its place. After a failure nothing is left behind.
    subroutine finish_text(file, status)
        type(output_file), intent(inout) :: file
        type(status_type), intent(inout) :: status

        call close_text(file, status)
        if (status%is_ok()) then
            call commit_output(file, status)
        else
            call discard_output(file)
        end if
    end subroutine finish_text

    !> Put the finished file in its place.
    subroutine commit_output(file, status)
        type(output_file), intent(in) :: file
        type(status_type), intent(inout) :: status
        character(len=128) :: reason

        if (file%is_direct) return
        if (linkdyn_replace_file(file%part, len_trim(file%part), file%target, len_trim(file%target), &
            reason, len(reason)) /= 0) then
            call fail(status, status_io_error, trim(file%target)//": cannot be written: "//trim(reason))
            call discard_output(file)
        end if
        call linkdyn_guard_file("", 0)
    end subroutine commit_output

    !> Remove what was written so far.
    subroutine discard_output(file)
        type(output_file), intent(in) :: file

        if (file%is_direct .or. len_trim(file%part) == 0) return
        call linkdyn_remove_file(file%part, len_trim(file%part))
        call linkdyn_guard_file("", 0)
    end subroutine discard_output

    !> Report a failed write with the system's reason: `fallback` where that is known already or cannot be found out.
    subroutine writing_failed(file, fallback, status)
        type(output_file), intent(in) :: file
        character(len=*), intent(in) :: fallback     !! what the system or the library said
        type(status_type), intent(inout) :: status

        if (.not. file%is_direct .and. file%descriptor < 0) call probe(file, probe_blocks, status)
        call fail(status, status_io_error, trim(file%target)//": cannot be written: "//trim(fallback))
    end subroutine writing_failed

    logical function path_exists(path)
        character(len=*), intent(in) :: path

        path_exists = linkdyn_path_kind(path, len_trim(path)) /= path_missing
    end function path_exists

    subroutine remove_file(path)
        character(len=*), intent(in) :: path

        call linkdyn_remove_file(path, len_trim(path))
    end subroutine remove_file

    !> True if the stream is read by a person: 1 standard output, 2 standard error.
    logical function is_terminal(descriptor)
        integer, intent(in) :: descriptor

        is_terminal = linkdyn_is_terminal(int(descriptor, c_int)) /= 0
    end function is_terminal

    !> Note the first interrupt (Ctrl-C, SIGTERM) instead of ending there.
    subroutine watch_interrupts()
        call linkdyn_watch_interrupts()
    end subroutine watch_interrupts

    !> Number of the signal noted; 0: none.
    integer function interrupt_noted()
        interrupt_noted = int(linkdyn_interrupt())
    end function interrupt_noted

    !> End the process without the exit handlers of libraries, which may try to write once more.
    subroutine leave_process(status)
        integer, intent(in) :: status                !! exit status

        call linkdyn_leave(int(status, c_int))
    end subroutine leave_process

    !> Write to the file and report why it fails.
    subroutine probe(file, n_block, status)
        type(output_file), intent(in) :: file
        integer, intent(in) :: n_block               !! of 64 KiB
        type(status_type), intent(inout) :: status
        character(len=128) :: reason

        if (linkdyn_probe_write(file%part, len_trim(file%part), n_block, reason, len(reason)) /= 0) &
            call fail(status, status_io_error, trim(file%target)//": cannot be written: "//trim(reason))
    end subroutine probe
end module linkdyn_output_file
