!> Was the process told to stop? Long work asks between its pieces and comes back early; its caller knows by asking again.
!>
!> The executable notes a first signal where a run can end by itself, else it ends at once and removes its part. Calls from Python
!> listen beside the program's own handler, and are made once more unless Python's handler raised.
module linkdyn_interrupt
    use, intrinsic :: iso_c_binding, only: c_int
    implicit none (type, external)
    private
    public :: interrupt_noted, is_interrupted, watch_interrupts, settle_signals, start_listening, stop_listening

    interface
        !> Signals that are write errors to us: a file beyond the allowed size.
        subroutine settle_signals() bind(c, name="linkdyn_settle_signals")
        end subroutine settle_signals

        !> Note the first interrupt (Ctrl-C, SIGTERM) instead of ending there; the second one ends the process.
        subroutine watch_interrupts() bind(c, name="linkdyn_watch_interrupts")
        end subroutine watch_interrupts

        !> Note Ctrl-C beside the program that called us, until `stop_listening`.
        subroutine start_listening() bind(c, name="linkdyn_start_listening")
        end subroutine start_listening

        subroutine stop_listening() bind(c, name="linkdyn_stop_listening")
        end subroutine stop_listening

        function c_interrupt() result(signal) bind(c, name="linkdyn_noted_interrupt")
            import :: c_int
            integer(c_int) :: signal
        end function c_interrupt
    end interface

contains

    !> Number of the signal noted; 0: none.
    integer function interrupt_noted()
        interrupt_noted = int(c_interrupt())
    end function interrupt_noted

    logical function is_interrupted()
        is_interrupted = c_interrupt() /= 0
    end function is_interrupted
end module linkdyn_interrupt
