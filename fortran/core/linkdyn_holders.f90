!> How many hold a thing that the last one of them frees. They may come and go on any thread.
module linkdyn_holders
    use linkdyn_lock, only: hold_lock, release_lock
    implicit none (type, external)
    private
    public :: holder_count

    type :: holder_count
        integer, private :: n = 0                      !! changed under the lock alone
    contains
        procedure :: come
        procedure :: go
    end type holder_count

contains

    subroutine come(self)
        class(holder_count), intent(inout) :: self

        call hold_lock()
        self%n = self%n + 1
        call release_lock()
    end subroutine come

    subroutine go(self, is_last)
        class(holder_count), intent(inout) :: self
        logical, intent(out) :: is_last                !! nobody is left

        call hold_lock()
        self%n = self%n - 1
        is_last = self%n == 0
        call release_lock()
    end subroutine go
end module linkdyn_holders
