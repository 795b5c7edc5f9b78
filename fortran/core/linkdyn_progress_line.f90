!> A sign of life on the terminal, written by a timer of the system.
module linkdyn_progress_line
    use, intrinsic :: iso_c_binding, only: c_char, c_int
    implicit none (type, external)
    private
    public :: start_sign, set_sign, end_sign

    interface
        !> After two seconds, and every half second from then on, a line on standard error.
        subroutine start_sign() bind(c, name="linkdyn_start_sign")
        end subroutine start_sign

        subroutine c_set_sign(text, text_len) bind(c, name="linkdyn_set_sign")
            import :: c_char, c_int
            character(kind=c_char), intent(in) :: text(*)
            integer(c_int), value :: text_len
        end subroutine c_set_sign

        !> Wipe the line, and be silent.
        subroutine end_sign() bind(c, name="linkdyn_end_sign")
        end subroutine end_sign
    end interface

contains

    !> What the line says from now on, beside the seconds so far.
    subroutine set_sign(text)
        character(len=*), intent(in) :: text

        call c_set_sign(text, len(text))
    end subroutine set_sign
end module linkdyn_progress_line
