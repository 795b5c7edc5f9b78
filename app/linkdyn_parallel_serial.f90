!> One process: the twin of linkdyn_parallel_mpi.f90 for builds without MPI.
module linkdyn_parallel
    use linkdyn_processes, only: process_group
    use linkdyn_status, only: status_type, fail, status_unavailable
    implicit none (type, external)
    private
    public :: start_processes, stop_processes

contains

    !> Refuse to be one of several processes that know nothing of each other.
    subroutine start_processes(group, status)
        class(process_group), allocatable, intent(out) :: group
        type(status_type), intent(inout) :: status
        character(len=*), parameter :: said_by(2) = [character(len=20) :: "OMPI_COMM_WORLD_SIZE", "PMI_SIZE"]
        character(len=16) :: number
        integer :: i, code

        allocate (group)
        do i = 1, size(said_by)
            call get_environment_variable(trim(said_by(i)), number, status=code)
            if (code == 0 .and. number /= "1" .and. number /= "") call fail(status, status_unavailable, &
                "linkdyn: started as "//trim(number)//" processes, but built without MPI (expected a build with -Dmpi=enabled)")
        end do
    end subroutine start_processes

    subroutine stop_processes(group)
        class(process_group), intent(in) :: group
    end subroutine stop_processes
end module linkdyn_parallel
