!> A file that is either there whole or not at all: written beside its target, renamed at the end.
module linkdyn_output_file
    use, intrinsic :: iso_c_binding, only: c_char, c_int
    use linkdyn_scene, only: path_len
    use linkdyn_status, only: status_type, fail, status_io_error
    use linkdyn_text, only: to_text
    implicit none (type, external)
    private
    public :: output_file, open_output, commit_output, discard_output, writing_failed

    integer, parameter :: path_missing = 0, path_file = 1, path_directory = 2   !! of linkdyn_output.h

    !> Where to write, and where the result goes.
    type :: output_file
        character(len=path_len) :: target = ""    !! as the user gave it
        character(len=path_len) :: part = ""      !! what is written to
        logical :: is_direct = .false.            !! a device or pipe: nothing to rename
    end type output_file

    interface
        function linkdyn_path_kind(path, path_len) result(kind) bind(c)
            import :: c_char, c_int
            character(kind=c_char), intent(in) :: path(*)
            integer(c_int), value :: path_len
            integer(c_int) :: kind
        end function linkdyn_path_kind

        function linkdyn_probe_write(path, path_len, reason, reason_len) result(outcome) bind(c)
            import :: c_char, c_int
            character(kind=c_char), intent(in) :: path(*)
            integer(c_int), value :: path_len
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

        function linkdyn_process_id() result(id) bind(c)
            import :: c_int
            integer(c_int) :: id
        end function linkdyn_process_id
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
        call probe(file, status)
        call linkdyn_remove_file(file%part, len_trim(file%part))
        if (status%is_ok()) call linkdyn_guard_file(file%part, len_trim(file%part))
    end subroutine open_output

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

    !> Report a failed write with the system's reason, or with `fallback` if the system has none.
    subroutine writing_failed(file, fallback, status)
        type(output_file), intent(in) :: file
        character(len=*), intent(in) :: fallback     !! what the library said
        type(status_type), intent(inout) :: status

        if (.not. file%is_direct) call probe(file, status)
        call fail(status, status_io_error, trim(file%target)//": cannot be written: "//trim(fallback))
    end subroutine writing_failed

    subroutine probe(file, status)
        type(output_file), intent(in) :: file
        type(status_type), intent(inout) :: status
        character(len=128) :: reason

        if (linkdyn_probe_write(file%part, len_trim(file%part), reason, len(reason)) /= 0) call fail(status, &
            status_io_error, trim(file%target)//": cannot be written: "//trim(reason))
    end subroutine probe
end module linkdyn_output_file
