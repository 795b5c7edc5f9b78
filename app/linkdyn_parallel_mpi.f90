!> Several processes, over MPI.
module linkdyn_parallel
    use, intrinsic :: iso_fortran_env, only: int64
    use linkdyn_kinds, only: wp
    use linkdyn_status, only: status_type
    use mpi_f08, only: mpi_init, mpi_finalize, mpi_comm_rank, mpi_comm_size, mpi_send, mpi_recv, mpi_bcast, mpi_comm_world, &
        mpi_status_ignore, mpi_byte
    implicit none (type, external)
    private
    public :: start_processes, stop_processes, n_process, this_process, send_arrays, receive_arrays, share_integers

    integer, parameter :: tag_reals = 1, tag_integers = 2

contains

    subroutine start_processes(status)
        type(status_type), intent(inout) :: status

        call mpi_init()
    end subroutine start_processes

    subroutine stop_processes()
        call mpi_finalize()
    end subroutine stop_processes

    integer function n_process()
        call mpi_comm_size(mpi_comm_world, n_process)
    end function n_process

    !> Number of this process, from 0; process 0 reads, writes and speaks.
    integer function this_process()
        call mpi_comm_rank(mpi_comm_world, this_process)
    end function this_process

    !> To process 0. As bytes: any precision.
    subroutine send_arrays(reals, integers)
        real(wp), intent(in) :: reals(:)
        integer(int64), intent(in) :: integers(:)

        call mpi_send(reals, size(reals)*(storage_size(reals)/8), mpi_byte, 0, tag_reals, mpi_comm_world)
        call mpi_send(integers, size(integers)*8, mpi_byte, 0, tag_integers, mpi_comm_world)
    end subroutine send_arrays

    !> From another process.
    subroutine receive_arrays(from, reals, integers)
        integer, intent(in) :: from
        real(wp), intent(inout) :: reals(:)
        integer(int64), intent(inout) :: integers(:)

        call mpi_recv(reals, size(reals)*(storage_size(reals)/8), mpi_byte, from, tag_reals, mpi_comm_world, mpi_status_ignore)
        call mpi_recv(integers, size(integers)*8, mpi_byte, from, tag_integers, mpi_comm_world, mpi_status_ignore)
    end subroutine receive_arrays

    !> What process 0 has, for all.
    subroutine share_integers(integers)
        integer(int64), intent(inout) :: integers(:)

        call mpi_bcast(integers, size(integers)*8, mpi_byte, 0, mpi_comm_world)
    end subroutine share_integers
end module linkdyn_parallel
