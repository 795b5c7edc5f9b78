!> Records of real numbers in a file, written and read at any place: what may be lost of it is known.
module linkdyn_spool
    use, intrinsic :: iso_c_binding, only: c_char, c_int, c_int64_t, c_ptr, c_loc
    use linkdyn_kinds, only: wp
    use linkdyn_output_file, only: linkdyn_close_write, remove_file
    use linkdyn_status, only: status_type, fail, status_io_error
    implicit none (type, external)
    private
    public :: spool_type, open_spool, write_spool, read_spool, sync_spool, close_spool

    type :: spool_type
        integer(c_int) :: descriptor = -1
        character(len=:), allocatable :: name
        integer :: width = 0                   !! numbers of a record
    end type spool_type

    interface
        function linkdyn_open_update(path, path_len, reason, reason_len) result(descriptor) bind(c)
            import :: c_char, c_int
            character(kind=c_char), intent(in) :: path(*)
            integer(c_int), value :: path_len
            character(kind=c_char), intent(inout) :: reason(*)
            integer(c_int), value :: reason_len
            integer(c_int) :: descriptor
        end function linkdyn_open_update

        function linkdyn_write_at(descriptor, offset, bytes, n, reason, reason_len) result(outcome) bind(c)
            import :: c_char, c_int, c_int64_t, c_ptr
            integer(c_int), value :: descriptor
            integer(c_int64_t), value :: offset, n
            type(c_ptr), value :: bytes
            character(kind=c_char), intent(inout) :: reason(*)
            integer(c_int), value :: reason_len
            integer(c_int) :: outcome
        end function linkdyn_write_at

        function linkdyn_read_at(descriptor, offset, bytes, n, reason, reason_len) result(outcome) bind(c)
            import :: c_char, c_int, c_int64_t, c_ptr
            integer(c_int), value :: descriptor
            integer(c_int64_t), value :: offset, n
            type(c_ptr), value :: bytes
            character(kind=c_char), intent(inout) :: reason(*)
            integer(c_int), value :: reason_len
            integer(c_int) :: outcome
        end function linkdyn_read_at

        function linkdyn_sync(descriptor, reason, reason_len) result(outcome) bind(c)
            import :: c_char, c_int
            integer(c_int), value :: descriptor
            character(kind=c_char), intent(inout) :: reason(*)
            integer(c_int), value :: reason_len
            integer(c_int) :: outcome
        end function linkdyn_sync
    end interface

contains

    !> Open or make a spool; what it holds stays.
    subroutine open_spool(name, width, spool, status)
        character(len=*), intent(in) :: name
        integer, intent(in) :: width           !! numbers of a record
        type(spool_type), intent(out) :: spool
        type(status_type), intent(inout) :: status
        character(len=128) :: reason

        spool%name = trim(name)
        spool%width = width
        spool%descriptor = linkdyn_open_update(spool%name, len(spool%name), reason, len(reason))
        if (spool%descriptor < 0) call spool_failed(spool, "written", reason, status)
    end subroutine open_spool

    !> Records first, first + 1, ...
    subroutine write_spool(spool, first, records, status)
        type(spool_type), intent(in) :: spool
        integer(c_int64_t), intent(in) :: first            !! from 0
        real(wp), intent(in), target, contiguous :: records(:, :)   !! (width, n)
        type(status_type), intent(inout) :: status
        character(len=128) :: reason
        integer(c_int64_t) :: bytes

        if (.not. status%is_ok() .or. size(records) == 0) return
        bytes = spool%width*(storage_size(records)/8)
        if (linkdyn_write_at(spool%descriptor, first*bytes, c_loc(records), size(records, 2)*bytes, reason, len(reason)) /= 0) &
            call spool_failed(spool, "written", reason, status)
    end subroutine write_spool

    subroutine read_spool(spool, first, records, status)
        type(spool_type), intent(in) :: spool
        integer(c_int64_t), intent(in) :: first            !! from 0
        real(wp), intent(out), target, contiguous :: records(:, :)  !! (width, n)
        type(status_type), intent(inout) :: status
        character(len=128) :: reason
        integer(c_int64_t) :: bytes

        if (.not. status%is_ok()) return
        bytes = spool%width*(storage_size(records)/8)
        if (linkdyn_read_at(spool%descriptor, first*bytes, c_loc(records), size(records, 2)*bytes, reason, len(reason)) /= 0) &
            call spool_failed(spool, "read", reason, status)
    end subroutine read_spool

    !> Bring what was written to the disk.
    subroutine sync_spool(spool, status)
        type(spool_type), intent(in) :: spool
        type(status_type), intent(inout) :: status
        character(len=128) :: reason

        if (spool%descriptor < 0 .or. .not. status%is_ok()) return
        if (linkdyn_sync(spool%descriptor, reason, len(reason)) /= 0) call spool_failed(spool, "written", reason, status)
    end subroutine sync_spool

    !> Close it, and remove it if it has served.
    subroutine close_spool(spool, is_done)
        type(spool_type), intent(inout) :: spool
        logical, intent(in) :: is_done
        character(len=128) :: reason
        integer(c_int) :: outcome

        if (spool%descriptor < 0) return
        outcome = linkdyn_close_write(spool%descriptor, reason, len(reason))
        spool%descriptor = -1
        if (is_done) call remove_file(spool%name)
    end subroutine close_spool

    subroutine spool_failed(spool, what, reason, status)
        type(spool_type), intent(in) :: spool
        character(len=*), intent(in) :: what, reason
        type(status_type), intent(inout) :: status

        call fail(status, status_io_error, spool%name//": cannot be "//what//": "//trim(reason))
    end subroutine spool_failed
end module linkdyn_spool
