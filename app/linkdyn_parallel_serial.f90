!> One process: the twin of linkdyn_parallel_mpi.f90 for builds without MPI.
module linkdyn_parallel
    use, intrinsic :: iso_fortran_env, only: int64
    use linkdyn_kinds, only: wp
    use linkdyn_status, only: status_type, fail, status_unavailable
    implicit none (type, external)
    private
    public :: start_processes, stop_processes, n_process, this_process, send_arrays, receive_arrays, share_integers, agree

contains

    !> Refuse to be one of several processes that know nothing of each other.
    subroutine start_processes(status)
        type(status_type), intent(inout) :: status
        character(len=*), parameter :: said_by(2) = [character(len=20) :: "OMPI_COMM_WORLD_SIZE", "PMI_SIZE"]
        character(len=16) :: number
        integer :: i, code

        do i = 1, size(said_by)
            call get_environment_variable(trim(said_by(i)), number, status=code)
            if (code == 0 .and. number /= "1" .and. number /= "") call fail(status, status_unavailable, &
                "linkdyn: started as "//trim(number)//" processes, but built without MPI (expected a build with -Dmpi=enabled)")
        end do
    end subroutine start_processes

    subroutine stop_processes()
    end subroutine stop_processes

    pure integer function n_process()
        n_process = 1
    end function n_process

    !> Number of this process, from 0; process 0 reads, writes and speaks.
    pure integer function this_process()
        this_process = 0
    end function this_process

    !> All processes must have come as far with the same work.
    subroutine agree(scene, hash, status)
        character(len=*), intent(in) :: scene
        integer(int64), intent(in) :: hash
        type(status_type), intent(inout) :: status
    end subroutine agree

    !> To process 0.
    subroutine send_arrays(reals, integers)
        real(wp), intent(in) :: reals(:)
        integer(int64), intent(in) :: integers(:)
    end subroutine send_arrays

    !> From another process.
    subroutine receive_arrays(from, reals, integers)
        integer, intent(in) :: from
        real(wp), intent(inout) :: reals(:)
        integer(int64), intent(inout) :: integers(:)
    end subroutine receive_arrays

    !> What process 0 has, for all.
    subroutine share_integers(integers)
        integer(int64), intent(inout) :: integers(:)
    end subroutine share_integers
end module linkdyn_parallel
