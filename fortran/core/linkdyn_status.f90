!> How procedures say that something went wrong: a code and one line of text, never a `stop`.
!>
!> A whole call fails with a `status_type`; a single sample of a batch fails with one of the
!> `sample_*` codes, so that its neighbours are untouched.
module linkdyn_status
    implicit none (type, external)
    private
    public :: status_type, fail
    public :: status_ok, status_bad_input, status_io_error, status_unavailable, status_internal, status_interrupted
    public :: sample_ok, sample_unreachable, sample_singular, sample_not_converged, sample_undefined, sample_branch_lost, &
        sample_locked
    public :: n_sample_status
    public :: sample_status_name
    public :: message_len

    integer, parameter :: message_len = 512
    integer, parameter :: status_ok = 0            !! nothing to report
    integer, parameter :: status_bad_input = 2     !! the scene or an argument is wrong
    integer, parameter :: status_io_error = 4      !! a file could not be read or written
    integer, parameter :: status_unavailable = 5   !! built without the library this needs
    integer, parameter :: status_internal = 6      !! a defect of linkdyn
    integer, parameter :: status_interrupted = 8   !! told to stop: nothing of what was asked for can be used

    integer, parameter :: sample_ok = 0            !! solved
    integer, parameter :: sample_unreachable = 1   !! a loop cannot close at this position, or not on the assembly followed
    integer, parameter :: sample_singular = 2      !! the equations have no unique solution here
    integer, parameter :: sample_not_converged = 3 !! an iteration ran out of steps
    integer, parameter :: sample_undefined = 4     !! a force has no direction here, or a value is beyond all numbers
    integer, parameter :: sample_branch_lost = 5   !! two assemblies meet on the way: which of them it is cannot be told
    integer, parameter :: sample_locked = 6        !! friction holds the mechanism fast: no forces can keep up this motion
    integer, parameter :: n_sample_status = 7
    character(len=13), parameter :: sample_status_name(0:n_sample_status - 1) = &
        [character(len=13) :: "ok", "unreachable", "singular", "not_converged", "undefined", "branch_lost", "locked"]

    !> Outcome of a call: `code` is one of the `status_*` constants, `message` one line for people.
    type :: status_type
        integer :: code = status_ok
        character(len=message_len) :: message = ""
    contains
        procedure :: is_ok
    end type status_type

contains

    !> Record a failure. The first failure stays: later ones are consequences of it.
    pure subroutine fail(status, code, message)
        type(status_type), intent(inout) :: status
        integer, intent(in) :: code              !! one of the `status_*` constants
        character(len=*), intent(in) :: message  !! what, where, and what was expected

        if (status%code /= status_ok) return
        status%code = code
        status%message = message
    end subroutine fail

    !> True while nothing went wrong.
    pure logical function is_ok(self)
        class(status_type), intent(in) :: self

        is_ok = self%code == status_ok
    end function is_ok
end module linkdyn_status
