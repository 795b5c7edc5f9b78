!> A file that is either there whole or not at all: written beside its target, renamed at the end. Links are followed. What is
!> no file (a device, a pipe, /dev/stdout) is written through to, and never replaced.
module linkdyn_output_file
    use, intrinsic :: iso_c_binding, only: c_char, c_int
    use linkdyn_path, only: resolve_path, path_file, path_missing
    use linkdyn_status, only: status_type, fail, status_io_error
    use linkdyn_text, only: quoted
    implicit none (type, external)
    private
    public :: output_file, open_output, commit_output, discard_output, writing_failed
    public :: write_text, finish_text, print_text
    public :: is_terminal, leave_process, remove_file
    public :: linkdyn_close_write    ! of c/, for other files that are open by descriptor

    integer, parameter :: probe_blocks = 256   !! 16 MiB are more than a library tried to write at once
    integer, parameter :: longest_path = 4095

    !> Where to write, and where the result goes.
    type :: output_file
        character(len=:), allocatable :: target   !! as the user gave it
        character(len=:), allocatable :: place    !! the same behind all links
        character(len=:), allocatable :: part     !! what is written to; not there: the target itself
        logical :: is_through = .false.           !! a device or pipe: nothing to rename
        integer(c_int) :: descriptor = -1         !! of a text file, or of what is written through to, while it is open
    end type output_file

    interface
        subroutine linkdyn_name_part(target, target_len, part, part_len) bind(c)
            import :: c_char, c_int
            character(kind=c_char), intent(in) :: target(*)
            integer(c_int), value :: target_len
            character(kind=c_char), intent(inout) :: part(*)
            integer(c_int), value :: part_len
        end subroutine linkdyn_name_part

        subroutine linkdyn_remove_leftovers(target, target_len) bind(c)
            import :: c_char, c_int
            character(kind=c_char), intent(in) :: target(*)
            integer(c_int), value :: target_len
        end subroutine linkdyn_remove_leftovers

        function linkdyn_open_part(part, part_len, target, target_len, reason, reason_len) result(descriptor) bind(c)
            import :: c_char, c_int
            character(kind=c_char), intent(in) :: part(*), target(*)
            integer(c_int), value :: part_len, target_len
            character(kind=c_char), intent(inout) :: reason(*)
            integer(c_int), value :: reason_len
            integer(c_int) :: descriptor
        end function linkdyn_open_part

        function linkdyn_open_through(path, path_len, reason, reason_len) result(descriptor) bind(c)
            import :: c_char, c_int
            character(kind=c_char), intent(in) :: path(*)
            integer(c_int), value :: path_len
            character(kind=c_char), intent(inout) :: reason(*)
            integer(c_int), value :: reason_len
            integer(c_int) :: descriptor
        end function linkdyn_open_through

        function linkdyn_open_scratch(path, path_len, reason, reason_len) result(descriptor) bind(c)
            import :: c_char, c_int
            character(kind=c_char), intent(inout) :: path(*)
            integer(c_int), value :: path_len
            character(kind=c_char), intent(inout) :: reason(*)
            integer(c_int), value :: reason_len
            integer(c_int) :: descriptor
        end function linkdyn_open_scratch

        function linkdyn_copy_file(from, from_len, descriptor, reason, reason_len) result(outcome) bind(c)
            import :: c_char, c_int
            character(kind=c_char), intent(in) :: from(*)
            integer(c_int), value :: from_len, descriptor
            character(kind=c_char), intent(inout) :: reason(*)
            integer(c_int), value :: reason_len
            integer(c_int) :: outcome
        end function linkdyn_copy_file

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

    !> Find out at once whether the target can be written, and make the part. Parts that killed runs left are removed.
    subroutine open_output(target, is_text, file, status)
        character(len=*), intent(in) :: target
        logical, intent(in) :: is_text            !! to be written by `write_text`; otherwise by a library, to the part
        type(output_file), intent(out) :: file
        type(status_type), intent(inout) :: status
        integer :: kind

        file%target = trim(target)
        if (.not. status%is_ok()) return
        call resolve_path(target, file%place, kind, status)
        if (.not. status%is_ok()) return
        select case (kind)
        case (path_missing, path_file)
            call open_part(is_text, file, status)
        case default
            call open_through(is_text, file, status)
        end select
    end subroutine open_output

    !> Beside the target, on the same disk.
    subroutine open_part(is_text, file, status)
        logical, intent(in) :: is_text
        type(output_file), intent(inout) :: file
        type(status_type), intent(inout) :: status
        character(len=longest_path) :: name
        character(len=128) :: reason

        call linkdyn_remove_leftovers(file%place, len(file%place))
        call linkdyn_name_part(file%place, len(file%place), name, len(name))
        call linkdyn_guard_file(name, len_trim(name))
        file%descriptor = linkdyn_open_part(name, len_trim(name), file%place, len(file%place), reason, len(reason))
        if (file%descriptor < 0) then
            call linkdyn_guard_file("", 0)
            call say_why(file, reason, status)
            return
        end if
        file%part = trim(name)
        call probe(file, 1, status)
        if (.not. is_text) call close_text(file, status)
        if (.not. status%is_ok()) call discard_output(file)
    end subroutine open_part

    !> A device or pipe takes text as it comes. A library needs a file to move about in, which goes through at the end.
    subroutine open_through(is_text, file, status)
        logical, intent(in) :: is_text
        type(output_file), intent(inout) :: file
        type(status_type), intent(inout) :: status
        character(len=128) :: reason

        file%is_through = .true.
        file%descriptor = linkdyn_open_through(file%place, len(file%place), reason, len(reason))
        if (file%descriptor < 0) call say_why(file, reason, status)
        if (is_text .or. .not. status%is_ok()) return
        call make_scratch(file%part, status)
        if (status%is_ok()) call linkdyn_guard_file(file%part, len(file%part))
    end subroutine open_through

    !> A file of our own in TMPDIR, or /tmp, that no other process could have made before.
    subroutine make_scratch(name, status)
        character(len=:), allocatable, intent(out) :: name
        type(status_type), intent(inout) :: status
        character(len=longest_path) :: buffer
        character(len=128) :: reason
        integer(c_int) :: descriptor

        name = ""
        descriptor = linkdyn_open_scratch(buffer, len(buffer), reason, len(reason))
        if (descriptor < 0) then
            call fail(status, status_io_error, "no room for a temporary file: "//trim(reason)//" (expected a folder in TMPDIR)")
            return
        end if
        name = trim(buffer)
        descriptor = linkdyn_close_write(descriptor, reason, len(reason))
    end subroutine make_scratch

    !> Append text as it is.
    subroutine write_text(file, text, status)
        type(output_file), intent(in) :: file
        character(len=*), intent(in) :: text
        type(status_type), intent(inout) :: status
        character(len=128) :: reason

        if (.not. status%is_ok()) return
        if (linkdyn_write_text(file%descriptor, text, len(text), reason, len(reason)) /= 0) call say_why(file, reason, status)
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
        if (linkdyn_close_write(file%descriptor, reason, len(reason)) /= 0) call say_why(file, reason, status)
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
        type(output_file), intent(inout) :: file
        type(status_type), intent(inout) :: status
        character(len=128) :: reason

        if (.not. allocated(file%part)) return
        if (file%is_through) then
            if (linkdyn_copy_file(file%part, len(file%part), file%descriptor, reason, len(reason)) /= 0) &
                call say_why(file, reason, status)
            call discard_output(file)
            return
        end if
        if (linkdyn_replace_file(file%part, len(file%part), file%place, len(file%place), reason, len(reason)) /= 0) then
            call say_why(file, reason, status)
            call discard_output(file)
        end if
        call linkdyn_guard_file("", 0)
    end subroutine commit_output

    !> Remove what was written so far, as far as that can be.
    subroutine discard_output(file)
        type(output_file), intent(inout) :: file
        type(status_type) :: ignored

        call close_text(file, ignored)
        if (.not. allocated(file%part)) return
        call linkdyn_remove_file(file%part, len(file%part))
        deallocate (file%part)
        call linkdyn_guard_file("", 0)
    end subroutine discard_output

    !> Report a failed write of a library with the system's reason: `fallback` where that cannot be found out.
    subroutine writing_failed(file, fallback, status)
        type(output_file), intent(in) :: file
        character(len=*), intent(in) :: fallback     !! what the library said
        type(status_type), intent(inout) :: status

        if (allocated(file%part)) call probe(file, probe_blocks, status)
        call say_why(file, fallback, status)
    end subroutine writing_failed

    subroutine say_why(file, reason, status)
        type(output_file), intent(in) :: file
        character(len=*), intent(in) :: reason
        type(status_type), intent(inout) :: status

        character(len=:), allocatable :: folder, why
        logical :: is_there

        why = trim(reason)
        folder = file%place(:index(file%place, "/", back=.true.))
        if (folder /= "") then
            inquire (file=folder//".", exist=is_there)
            if (.not. is_there) why = "there is no folder "//quoted(file%target(:index(file%target, "/", back=.true.) - 1))
        end if
        call fail(status, status_io_error, file%target//": cannot be written: "//why)
    end subroutine say_why

    subroutine remove_file(path)
        character(len=*), intent(in) :: path

        call linkdyn_remove_file(path, len_trim(path))
    end subroutine remove_file

    !> True if the stream is read by a person: 1 standard output, 2 standard error.
    logical function is_terminal(descriptor)
        integer, intent(in) :: descriptor

        is_terminal = linkdyn_is_terminal(int(descriptor, c_int)) /= 0
    end function is_terminal

    !> End the process without the exit handlers of libraries, which may try to write once more.
    subroutine leave_process(status)
        integer, intent(in) :: status                !! exit status

        call linkdyn_leave(int(status, c_int))
    end subroutine leave_process

    !> Write to the part and report why it fails.
    subroutine probe(file, n_block, status)
        type(output_file), intent(in) :: file
        integer, intent(in) :: n_block               !! of 64 KiB
        type(status_type), intent(inout) :: status
        character(len=128) :: reason

        if (linkdyn_probe_write(file%part, len(file%part), n_block, reason, len(reason)) /= 0) call say_why(file, reason, status)
    end subroutine probe
end module linkdyn_output_file
