!> The processes that share the work of a sweep. This type is one process, which has nobody to speak with; programs over MPI
!> extend it.
module linkdyn_processes
    use, intrinsic :: iso_fortran_env, only: int64
    use linkdyn_kinds, only: wp
    use linkdyn_status, only: status_type
    implicit none (type, external)
    private
    public :: process_group

    type :: process_group
        integer :: n = 1                       !! processes
        integer :: this = 0                    !! number of this one; process 0 reads, writes and speaks
    contains
        procedure :: agree => agree_alone
        procedure :: send => send_to_nobody
        procedure :: receive => receive_from_nobody
        procedure :: share => share_with_nobody
    end type process_group

contains

    !> All processes must have come as far with the same work.
    subroutine agree_alone(self, scene, hash, status)
        class(process_group), intent(in) :: self
        character(len=*), intent(in) :: scene  !! its file
        integer(int64), intent(in) :: hash     !! of the work
        type(status_type), intent(inout) :: status
    end subroutine agree_alone

    !> To process 0.
    subroutine send_to_nobody(self, reals, integers)
        class(process_group), intent(in) :: self
        real(wp), intent(in) :: reals(:)
        integer(int64), intent(in) :: integers(:)
    end subroutine send_to_nobody

    !> From another process.
    subroutine receive_from_nobody(self, from, reals, integers)
        class(process_group), intent(in) :: self
        integer, intent(in) :: from
        real(wp), intent(inout) :: reals(:)
        integer(int64), intent(inout) :: integers(:)
    end subroutine receive_from_nobody

    !> What process 0 has, for all.
    subroutine share_with_nobody(self, integers)
        class(process_group), intent(in) :: self
        integer(int64), intent(inout) :: integers(:)
    end subroutine share_with_nobody
end module linkdyn_processes
