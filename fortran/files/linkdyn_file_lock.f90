!> A lock that one process holds at a time: the system releases it when the process ends, however that happens.
module linkdyn_file_lock
    use, intrinsic :: iso_c_binding, only: c_char, c_int
    use linkdyn_status, only: status_type, fail, status_bad_input, status_io_error
    implicit none (type, external)
    private
    public :: file_lock, take_lock, release_lock

    type :: file_lock
        character(len=:), allocatable, private :: name
        integer(c_int), private :: descriptor = -1
    end type file_lock

    interface
        function linkdyn_lock(path, path_len, reason, reason_len) result(descriptor) bind(c)
            import :: c_char, c_int
            character(kind=c_char), intent(in) :: path(*)
            integer(c_int), value :: path_len
            character(kind=c_char), intent(inout) :: reason(*)
            integer(c_int), value :: reason_len
            integer(c_int) :: descriptor
        end function linkdyn_lock

        subroutine linkdyn_unlock(descriptor, path, path_len) bind(c)
            import :: c_char, c_int
            integer(c_int), value :: descriptor
            character(kind=c_char), intent(in) :: path(*)
            integer(c_int), value :: path_len
        end subroutine linkdyn_unlock
    end interface

contains

    !> Take the lock that goes with an output file, or say who has it.
    subroutine take_lock(output, lock, status)
        character(len=*), intent(in) :: output
        type(file_lock), intent(out) :: lock
        type(status_type), intent(inout) :: status
        integer(c_int), parameter :: held_by_another = -2
        character(len=128) :: reason

        if (.not. status%is_ok()) return
        lock%name = trim(output)//".lock"
        lock%descriptor = linkdyn_lock(lock%name, len(lock%name), reason, len(reason))
        if (lock%descriptor == held_by_another) then
            if (reason == "") reason = "another process"
            call fail(status, status_bad_input, trim(output)//": "//trim(reason) &
                      //" is writing there (expected another --output, or to wait until it has ended)")
        else if (lock%descriptor < 0) then
            call fail(status, status_io_error, trim(output)//": cannot be written: "//trim(reason))
        end if
    end subroutine take_lock

    subroutine release_lock(lock)
        type(file_lock), intent(inout) :: lock

        if (lock%descriptor < 0) return
        call linkdyn_unlock(lock%descriptor, lock%name, len(lock%name))
        lock%descriptor = -1
    end subroutine release_lock
end module linkdyn_file_lock
