!> What an interrupted sweep needs to go on: totals of the chunks that are done, and the samples that are kept.
!>
!> The checkpoint is written beside itself, brought to the disk and renamed, so that there is always a whole one,
!> whatever happens in between. Kept samples lie in a spool; the checkpoint has the mark that it must bear, and what lies
!> behind that is written once more.
module linkdyn_checkpoint
    use, intrinsic :: iso_fortran_env, only: int64
    use linkdyn_input, only: read_file_text
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_hash, only: hash_text
    use linkdyn_output_file, only: output_file, open_output, write_text, finish_text
    use linkdyn_path, only: path_exists
    use linkdyn_scene, only: law_spec
    use linkdyn_spool, only: spool_mark
    use linkdyn_status, only: status_type, fail, status_bad_input, status_io_error
    use linkdyn_sweep, only: sweep_run
    use linkdyn_sweep_totals, only: packed_size, pack_totals, unpack_totals
    use linkdyn_text, only: to_text
    use linkdyn_block, only: forms_multiply_adds
    use linkdyn_build, only: version
    implicit none (type, external)
    private
    public :: sweep_hash, write_checkpoint, read_checkpoint, checkpoint_name, has_checkpoint

    integer, parameter :: map_block = 4096         !! cells written at a time
    character(len=*), parameter :: magic = "linkdyn sweep checkpoint 2"//new_line("a")

contains

    pure function checkpoint_name(output) result(name)
        character(len=*), intent(in) :: output
        character(len=:), allocatable :: name

        name = trim(output)//".checkpoint"
    end function checkpoint_name

    logical function has_checkpoint(output)
        character(len=*), intent(in) :: output

        has_checkpoint = path_exists(checkpoint_name(output))
    end function has_checkpoint

    !> A number that differs when results could: of the scene, its tables, the solver, the build, and
    !> whether the processor forms multiply-adds.
    integer(int64) function sweep_hash(run) result(hash)
        type(sweep_run), intent(in) :: run
        integer :: i, k

        hash = hash_text(0_int64, version)
        hash = hash_text(hash, to_text(lanes)//" "//to_text(digits(1.0_wp))//" "//to_text(run%solver)// &
                         merge(" fused", "      ", forms_multiply_adds()))
        hash = hash_text(hash, run%scene%text)
        do i = 1, size(run%spec%keeps)
            hash = hash_text(hash, merge("1", "0", run%spec%keeps(i)))
        end do
        do i = 1, size(run%scene%coordinate)
            call add_law(run%scene%coordinate(i)%motion)
        end do
        do i = 1, size(run%scene%payload)
            call add_law(run%scene%payload(i)%mass)
        end do
        do i = 1, size(run%scene%base%motion)
            call add_law(run%scene%base%motion(i))
        end do
        do i = 1, size(run%scene%load)
            do k = 1, 3
                call add_law(run%scene%load(i)%force(k))
                call add_law(run%scene%load(i)%moment(k))
            end do
        end do

    contains

        !> What came from a table.
        subroutine add_law(law)
            type(law_spec), intent(in) :: law

            if (.not. allocated(law%knot)) return
            hash = hash_text(hash, bytes_of(law%time))
            hash = hash_text(hash, bytes_of(law%knot))
        end subroutine add_law
    end function sweep_hash

    pure function bytes_of(values) result(bytes)
        real(wp), intent(in) :: values(:)
        character(len=size(values)*storage_size(values)/8) :: bytes

        bytes = transfer(values, bytes)
    end function bytes_of

    pure function bytes_of_integers(values) result(bytes)
        integer(int64), intent(in) :: values(:)
        character(len=size(values)*8) :: bytes

        bytes = transfer(values, bytes)
    end function bytes_of_integers

    !> Keep what has been joined so far.
    subroutine write_checkpoint(output, hash, run, mark, status)
        character(len=*), intent(in) :: output         !! of the results
        integer(int64), intent(in) :: hash
        type(sweep_run), intent(in) :: run
        type(spool_mark), intent(in) :: mark           !! of the samples kept so far
        type(status_type), intent(inout) :: status
        type(output_file) :: file
        real(wp), allocatable :: reals(:)
        integer(int64), allocatable :: integers(:)
        integer(int64) :: check, n_design
        integer :: n_real, n_integer, d

        call open_output(checkpoint_name(output), .true., file, status)
        if (.not. status%is_ok()) return
        n_design = min(run%n_done/run%plan%n_chunk_design + 1, run%plan%n_design)
        check = hash
        call put(magic)
        call put(bytes_of_integers([hash, run%n_done, n_design, run%first_bad, mark%identity, mark%n, mark%checksum]))
        call put(run%bad_design%message)
        call packed_size(run%shape, n_real, n_integer)
        allocate (reals(n_real), integers(n_integer))
        do d = 1, int(n_design)
            call pack_totals(run%total(d), reals, integers)
            call put(bytes_of(reals))
            call put(bytes_of_integers(integers))
        end do
        do d = 1, size(run%map%worst, 2), map_block
            call put(bytes_of(reshape(run%map%worst(:, d:min(d + map_block - 1, size(run%map%worst, 2))), &
                [size(run%map%worst, 1)*(min(d + map_block - 1, size(run%map%worst, 2)) - d + 1)])))
            call put(bytes_of_integers(run%map%n_feasible(d:min(d + map_block - 1, size(run%map%worst, 2)))))
        end do
        call write_text(file, bytes_of_integers([check]), status)
        call finish_text(file, status)

    contains

        subroutine put(bytes)
            character(len=*), intent(in) :: bytes

            call write_text(file, bytes, status)
            check = hash_text(check, bytes)
        end subroutine put
    end subroutine write_checkpoint

    !> Go on where the checkpoint stands. Refuses one of another scene.
    subroutine read_checkpoint(output, hash, run, mark, status)
        character(len=*), intent(in) :: output
        integer(int64), intent(in) :: hash
        type(sweep_run), intent(inout) :: run
        type(spool_mark), intent(out) :: mark          !! of the samples kept until then
        type(status_type), intent(inout) :: status
        integer, parameter :: head_bytes = 56
        character(len=:), allocatable :: text, name
        real(wp), allocatable :: reals(:)
        integer(int64), allocatable :: integers(:)
        integer(int64) :: head(head_bytes/8), check, last(1)
        integer :: n_real, n_integer, n, d, at

        name = checkpoint_name(output)
        call read_file_text(name, name, text, status)
        if (.not. status%is_ok()) return
        call packed_size(run%shape, n_real, n_integer)
        at = len(magic)
        if (len(text) < at + head_bytes) then
            call refuse_broken()
            return
        end if
        if (text(:at) /= magic) then
            call refuse_broken()
            return
        end if
        head = transfer(text(at + 1:at + head_bytes), head)
        if (head(1) /= hash) then
            call fail(status, status_bad_input, name//": was made from another scene, with other options or by another build "// &
                "(expected all as it was; to start anew, remove this file)")
            return
        end if
        if (head(2) < 0 .or. head(2) > run%plan%n_chunk .or. head(3) < 1 .or. head(3) > run%plan%n_design &
            .or. len(text, int64) /= at + head_bytes + len(run%bad_design%message) + 8 &
            + head(3)*(n_real*(storage_size(1.0_wp)/8) + 8_int64*n_integer) &
            + size(run%map%worst, kind=int64)*(storage_size(1.0_wp)/8) + size(run%map%n_feasible, kind=int64)*8) then
            call refuse_broken()
            return
        end if
        check = hash_text(hash, text(:at))
        check = hash_text(check, text(at + 1:at + head_bytes))
        at = at + head_bytes
        run%bad_design%message = text(at + 1:at + len(run%bad_design%message))
        check = hash_text(check, run%bad_design%message)
        at = at + len(run%bad_design%message)
        allocate (reals(n_real), integers(n_integer))
        do d = 1, int(head(3))
            reals = transfer(piece(n_real*(storage_size(1.0_wp)/8)), reals)
            integers = transfer(piece(8*n_integer), integers)
            call unpack_totals(run%shape, reals, integers, run%total(d))
        end do
        do d = 1, size(run%map%worst, 2), map_block
            n = min(map_block, size(run%map%worst, 2) - d + 1)
            run%map%worst(:, d:d + n - 1) = reshape(transfer(piece(n*size(run%map%worst, 1)*(storage_size(1.0_wp)/8)), &
                [1.0_wp]), [size(run%map%worst, 1), n])
            run%map%n_feasible(d:d + n - 1) = transfer(piece(8*n), [1_int64])
        end do
        last = transfer(text(at + 1:at + 8), last)
        if (last(1) /= check) then
            call refuse_broken()
            return
        end if
        run%n_done = head(2)
        run%first_bad = head(4)
        mark = spool_mark(head(5), head(6), head(7))
        if (run%first_bad >= 0) run%bad_design%code = status_bad_input

    contains

        function piece(n)
            integer, intent(in) :: n
            character(len=n) :: piece

            piece = text(at + 1:at + n)
            check = hash_text(check, piece)
            at = at + n
        end function piece

        subroutine refuse_broken()
            call fail(status, status_io_error, name//": is no checkpoint of this sweep, or damaged "// &
                "(to start anew, remove this file)")
        end subroutine refuse_broken
    end subroutine read_checkpoint
end module linkdyn_checkpoint
