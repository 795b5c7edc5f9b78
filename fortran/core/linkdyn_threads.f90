!> How many threads share some work.
module linkdyn_threads
    use, intrinsic :: iso_c_binding, only: c_int
    implicit none (type, external)
    private
    public :: team_size

    interface
        function c_team_size(wanted, n_task) result(size) bind(c, name="linkdyn_team_size")
            import :: c_int
            integer(c_int), value :: wanted, n_task
            integer(c_int) :: size
        end function c_team_size
    end interface

contains

    !> Threads for so many tasks: no more than the machine has a use for, and one alone in a process forked from one that had
    !> several, whose other threads did not come along. Results do not depend on it.
    integer function team_size(wanted, n_task)
        integer, intent(in) :: wanted                !! by the user
        integer, intent(in) :: n_task

        team_size = int(c_team_size(int(wanted, c_int), int(n_task, c_int)))
    end function team_size
end module linkdyn_threads
