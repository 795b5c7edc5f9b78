!> Several processes, over MPI.
module linkdyn_parallel
    use, intrinsic :: iso_fortran_env, only: int64
    use linkdyn_kinds, only: wp
    use linkdyn_processes, only: process_group
    use linkdyn_status, only: status_type, fail, status_bad_input, message_len
    use linkdyn_text, only: to_text
    use mpi_f08, only: mpi_init, mpi_finalize, mpi_comm_rank, mpi_comm_size, mpi_send, mpi_recv, mpi_bcast, &
        mpi_allgather, mpi_get_processor_name, mpi_comm_world, mpi_status_ignore, mpi_byte, mpi_max_processor_name
    implicit none (type, external)
    private
    public :: start_processes, stop_processes

    integer, parameter :: tag_reals = 1, tag_integers = 2

    type, extends(process_group) :: mpi_group
    contains
        procedure :: agree => agree_over_mpi
        procedure :: send => send_arrays
        procedure :: receive => receive_arrays
        procedure :: share => share_integers
    end type mpi_group

contains

    subroutine start_processes(group, status)
        class(process_group), allocatable, intent(out) :: group
        type(status_type), intent(inout) :: status

        call mpi_init()
        allocate (mpi_group :: group)
        call mpi_comm_size(mpi_comm_world, group%n)
        call mpi_comm_rank(mpi_comm_world, group%this)
    end subroutine start_processes

    subroutine stop_processes(group)
        class(process_group), intent(in) :: group

        call mpi_finalize()
    end subroutine stop_processes

    !> All processes must have come as far with the same work: where one has failed, or has another scene (a copy on its
    !> machine that is out of date), all fail, and with the same words.
    subroutine agree_over_mpi(self, scene, hash, status)
        class(mpi_group), intent(in) :: self
        character(len=*), intent(in) :: scene      !! its file
        integer(int64), intent(in) :: hash         !! of the work
        type(status_type), intent(inout) :: status
        character(len=message_len) :: message
        character(len=mpi_max_processor_name) :: machine
        integer(int64) :: own(2)
        integer(int64), allocatable :: every(:, :)
        integer :: p, length

        own = [merge(1_int64, 0_int64, status%is_ok()), hash]
        allocate (every(2, 0:self%n - 1))
        call mpi_allgather(own, size(own)*8, mpi_byte, every, size(own)*8, mpi_byte, mpi_comm_world)
        p = findloc(every(1, :) == 1 .and. every(2, :) == every(2, 0), .false., dim=1) - 1
        if (p < 0) return
        if (self%this == p) then
            call mpi_get_processor_name(machine, length)
            call fail(status, status_bad_input, scene//": it, or a table of it, is not what process 0 has (expected the same " &
                      //"files on every machine)")
            message = status%message
            if (p > 0) message = "process "//to_text(p)//" on "//machine(:length)//": "//status%message
        end if
        call mpi_bcast(message, len(message), mpi_byte, p, mpi_comm_world)
        call fail(status, status_bad_input, message)
        status%message = message
    end subroutine agree_over_mpi

    !> To process 0. As bytes: any precision.
    subroutine send_arrays(self, reals, integers)
        class(mpi_group), intent(in) :: self
        real(wp), intent(in) :: reals(:)
        integer(int64), intent(in) :: integers(:)

        call mpi_send(reals, size(reals)*(storage_size(reals)/8), mpi_byte, 0, tag_reals, mpi_comm_world)
        call mpi_send(integers, size(integers)*8, mpi_byte, 0, tag_integers, mpi_comm_world)
    end subroutine send_arrays

    !> From another process.
    subroutine receive_arrays(self, from, reals, integers)
        class(mpi_group), intent(in) :: self
        integer, intent(in) :: from
        real(wp), intent(inout) :: reals(:)
        integer(int64), intent(inout) :: integers(:)

        call mpi_recv(reals, size(reals)*(storage_size(reals)/8), mpi_byte, from, tag_reals, mpi_comm_world, mpi_status_ignore)
        call mpi_recv(integers, size(integers)*8, mpi_byte, from, tag_integers, mpi_comm_world, mpi_status_ignore)
    end subroutine receive_arrays

    !> What process 0 has, for all.
    subroutine share_integers(self, integers)
        class(mpi_group), intent(in) :: self
        integer(int64), intent(inout) :: integers(:)

        call mpi_bcast(integers, size(integers)*8, mpi_byte, 0, mpi_comm_world)
    end subroutine share_integers
end module linkdyn_parallel
