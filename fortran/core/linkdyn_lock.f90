!> Locks of the process: for threads that OpenMP knows nothing of, too, and in builds without it.
!>
!> `hold_lock` is for lists that several threads change: held for a few instructions, and never twice by one thread.
!>
!> `hold_texts` is for the making of texts, thus for reading and planning scenes and for messages. gfortran keeps the length of
!> a text that a function returns in a static variable of the place that called it: two threads there at once would take each
!> other's. `hold_records` is for the making of what a scene's equations and steps keep for the next batch: who wants the same
!> meanwhile, waits. Scenes that are read make kernels, for their starts, and records that are made have messages, so both are one
!> lock: two would be taken in either order. A thread may hold it any number of times; members of a team that it leads must not
!> need it.
!>
!> `hold_texts_to_lend` is for a thread that assembles one of many designs: nobody else knows of that one yet. Where it computes for
!> long and makes no text it lends the lock to others, and takes it back afterwards; under any other hold nothing is lent.
module linkdyn_lock
    implicit none (type, external)
    private
    public :: hold_lock, release_lock, hold_texts, release_texts, hold_records, release_records
    public :: hold_texts_to_lend, lend_texts, take_texts_back

    interface
        subroutine hold_lock() bind(c, name="linkdyn_hold_lock")
        end subroutine hold_lock

        subroutine release_lock() bind(c, name="linkdyn_release_lock")
        end subroutine release_lock

        subroutine hold_texts() bind(c, name="linkdyn_hold_texts")
        end subroutine hold_texts

        subroutine release_texts() bind(c, name="linkdyn_release_texts")
        end subroutine release_texts

        subroutine hold_records() bind(c, name="linkdyn_hold_records")
        end subroutine hold_records

        subroutine release_records() bind(c, name="linkdyn_release_records")
        end subroutine release_records

        subroutine hold_texts_to_lend() bind(c, name="linkdyn_hold_texts_to_lend")
        end subroutine hold_texts_to_lend

        function lend_texts() bind(c, name="linkdyn_lend_texts") result(lent)
            integer :: lent                          !! to be handed to `take_texts_back`
        end function lend_texts

        subroutine take_texts_back(lent) bind(c, name="linkdyn_take_texts_back")
            integer, value :: lent
        end subroutine take_texts_back
    end interface
end module linkdyn_lock
