!> Records of real numbers in a file, one after the other. What it must hold up to some record is said by a mark: whose it is,
!> how many records, and a checksum of them. A mark kept elsewhere tells a spool that was lost, cut off, changed, or is another's.
module linkdyn_spool
    use, intrinsic :: iso_c_binding, only: c_char, c_int, c_int64_t, c_ptr, c_loc
    use linkdyn_kinds, only: wp
    use linkdyn_hash, only: hash_text
    use linkdyn_output_file, only: linkdyn_close_write, remove_file
    use linkdyn_status, only: status_type, fail, status_io_error
    implicit none (type, external)
    private
    public :: spool_type, spool_mark, open_spool, reopen_spool, append_spool, read_spool, check_spool, sync_spool, close_spool

    integer(c_int64_t), parameter :: head_bytes = 8        !! the identity stands in front
    integer, parameter :: block_length = 16384             !! records checked at a time

    type :: spool_mark
        integer(c_int64_t) :: identity = 0     !! no two spools have the same
        integer(c_int64_t) :: n = 0            !! records
        integer(c_int64_t) :: checksum = 0     !! of them
    end type spool_mark

    type :: spool_type
        integer(c_int) :: descriptor = -1
        character(len=:), allocatable :: name
        integer :: width = 0                   !! numbers of a record
        type(spool_mark) :: mark               !! of all that was written
    end type spool_type

    interface
        function linkdyn_open_update(path, path_len, is_new, reason, reason_len) result(descriptor) bind(c)
            import :: c_char, c_int
            character(kind=c_char), intent(in) :: path(*)
            integer(c_int), value :: path_len, is_new
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

        function linkdyn_fresh_bits() result(bits) bind(c)
            import :: c_int64_t
            integer(c_int64_t) :: bits
        end function linkdyn_fresh_bits
    end interface

contains

    !> A new spool, in place of what was there.
    subroutine open_spool(name, width, spool, status)
        character(len=*), intent(in) :: name
        integer, intent(in) :: width           !! numbers of a record
        type(spool_type), intent(out) :: spool
        type(status_type), intent(inout) :: status
        integer(c_int64_t), target :: identity(1)
        character(len=128) :: reason

        call open_file(name, width, 1_c_int, spool, status)
        if (.not. status%is_ok()) return
        identity = linkdyn_fresh_bits()
        spool%mark = spool_mark(identity(1), 0, identity(1))
        if (linkdyn_write_at(spool%descriptor, 0_c_int64_t, c_loc(identity), head_bytes, reason, len(reason)) /= 0) &
            call spool_failed(spool, "written", reason, status)
    end subroutine open_spool

    !> Go on with a spool that must hold what the mark says; what lies behind is written once more.
    subroutine reopen_spool(name, width, mark, spool, status)
        character(len=*), intent(in) :: name
        integer, intent(in) :: width           !! numbers of a record
        type(spool_mark), intent(in) :: mark
        type(spool_type), intent(out) :: spool
        type(status_type), intent(inout) :: status
        integer(c_int64_t), target :: identity(1)
        character(len=128) :: reason

        call open_file(name, width, 0_c_int, spool, status)
        if (.not. status%is_ok()) return
        identity = 0
        if (linkdyn_read_at(spool%descriptor, 0_c_int64_t, c_loc(identity), head_bytes, reason, len(reason)) /= 0) &
            identity = mark%identity - 1
        if (identity(1) /= mark%identity) then
            call refuse(spool, status)
            return
        end if
        spool%mark = mark
        call check_spool(spool, status)
    end subroutine reopen_spool

    subroutine open_file(name, width, is_new, spool, status)
        character(len=*), intent(in) :: name
        integer, intent(in) :: width
        integer(c_int), intent(in) :: is_new
        type(spool_type), intent(inout) :: spool
        type(status_type), intent(inout) :: status
        character(len=128) :: reason

        spool%name = trim(name)
        spool%width = width
        spool%descriptor = linkdyn_open_update(spool%name, len(spool%name), is_new, reason, len(reason))
        if (spool%descriptor < 0) call spool_failed(spool, trim(merge("written", "read   ", is_new == 1)), reason, status)
    end subroutine open_file

    !> The next records.
    subroutine append_spool(spool, records, status)
        type(spool_type), intent(inout) :: spool
        real(wp), intent(in), target, contiguous :: records(:, :)   !! (width, n)
        type(status_type), intent(inout) :: status
        character(len=128) :: reason

        if (.not. status%is_ok() .or. size(records) == 0) return
        if (linkdyn_write_at(spool%descriptor, place_of(spool, spool%mark%n), c_loc(records), &
            size(records, 2)*record_bytes(spool), reason, len(reason)) /= 0) then
            call spool_failed(spool, "written", reason, status)
            return
        end if
        call add_to_checksum(records, spool%mark%checksum)
        spool%mark%n = spool%mark%n + size(records, 2)
    end subroutine append_spool

    subroutine read_spool(spool, first, records, status)
        type(spool_type), intent(in) :: spool
        integer(c_int64_t), intent(in) :: first            !! from 0
        real(wp), intent(out), target, contiguous :: records(:, :)  !! (width, n)
        type(status_type), intent(inout) :: status
        character(len=128) :: reason

        if (.not. status%is_ok()) return
        if (linkdyn_read_at(spool%descriptor, place_of(spool, first), c_loc(records), size(records, 2)*record_bytes(spool), &
            reason, len(reason)) /= 0) call refuse(spool, status)
    end subroutine read_spool

    !> Read it through: it must hold what was written.
    subroutine check_spool(spool, status)
        type(spool_type), intent(in) :: spool
        type(status_type), intent(inout) :: status
        real(wp), allocatable :: records(:, :)
        integer(c_int64_t) :: first, checksum

        if (spool%descriptor < 0) return
        checksum = spool%mark%identity
        first = 0
        do while (first < spool%mark%n .and. status%is_ok())
            if (allocated(records)) deallocate (records)
            allocate (records(spool%width, min(int(block_length, c_int64_t), spool%mark%n - first)))
            call read_spool(spool, first, records, status)
            if (status%is_ok()) call add_to_checksum(records, checksum)
            first = first + size(records, 2)
        end do
        if (checksum /= spool%mark%checksum) call refuse(spool, status)
    end subroutine check_spool

    !> Record by record: the same however they come together.
    pure subroutine add_to_checksum(records, checksum)
        real(wp), intent(in) :: records(:, :)
        integer(c_int64_t), intent(inout) :: checksum
        character(len=size(records, 1)*storage_size(records)/8) :: bytes
        integer :: i

        do i = 1, size(records, 2)
            bytes = transfer(records(:, i), bytes)
            checksum = hash_text(checksum, bytes)
        end do
    end subroutine add_to_checksum

    pure integer(c_int64_t) function record_bytes(spool)
        type(spool_type), intent(in) :: spool

        record_bytes = int(spool%width, c_int64_t)*(storage_size(1.0_wp)/8)
    end function record_bytes

    !> Where a record stands in the file.
    pure integer(c_int64_t) function place_of(spool, record)
        type(spool_type), intent(in) :: spool
        integer(c_int64_t), intent(in) :: record           !! from 0

        place_of = head_bytes + record*record_bytes(spool)
    end function place_of

    !> Bring what was written to the disk.
    subroutine sync_spool(spool, status)
        type(spool_type), intent(in) :: spool
        type(status_type), intent(inout) :: status
        character(len=128) :: reason

        if (spool%descriptor < 0 .or. .not. status%is_ok()) return
        if (linkdyn_sync(spool%descriptor, reason, len(reason)) /= 0) call spool_failed(spool, "written", reason, status)
    end subroutine sync_spool

    !> Close it, and remove it if it has served.
    subroutine close_spool(spool, is_removed)
        type(spool_type), intent(inout) :: spool
        logical, intent(in) :: is_removed                  !! nobody goes on with it
        character(len=128) :: reason
        integer(c_int) :: outcome

        if (spool%descriptor < 0) return
        outcome = linkdyn_close_write(spool%descriptor, reason, len(reason))
        spool%descriptor = -1
        if (is_removed) call remove_file(spool%name)
    end subroutine close_spool

    subroutine refuse(spool, status)
        type(spool_type), intent(in) :: spool
        type(status_type), intent(inout) :: status

        call fail(status, status_io_error, spool%name//": does not hold the kept samples of this run: it was cut off, changed, " &
                  //"or belongs to another (to start anew, remove it and the checkpoint)")
    end subroutine refuse

    subroutine spool_failed(spool, what, reason, status)
        type(spool_type), intent(in) :: spool
        character(len=*), intent(in) :: what, reason
        type(status_type), intent(inout) :: status

        call fail(status, status_io_error, spool%name//": cannot be "//what//": "//trim(reason))
    end subroutine spool_failed
end module linkdyn_spool
