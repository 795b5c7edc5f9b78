!> Machine code of kernels: what the user asks for, and what runs. Numbers do not depend on it.
module linkdyn_code
    use, intrinsic :: iso_c_binding, only: c_int, c_char, c_double
    use linkdyn_kinds, only: wp
    use linkdyn_status, only: status_type, status_bad_input, fail
    use linkdyn_text, only: one_of
    implicit none (type, external)
    private
    public :: choose_code, check_code, code_in_use, code_name

    character(len=11), parameter :: code_name(4) = [character(len=11) :: "interpreter", "scalar", "avx2", "avx512"]

    interface
        function linkdyn_choose_code(name, name_len) result(is_known) bind(c)
            import :: c_int, c_char
            integer(c_int), value :: name_len
            character(kind=c_char), intent(in) :: name(name_len)
            integer(c_int) :: is_known
        end function linkdyn_choose_code

        function linkdyn_code_is_known() result(is_known) bind(c)
            import :: c_int
            integer(c_int) :: is_known
        end function linkdyn_code_is_known

        subroutine linkdyn_tell_code(text, room) bind(c)
            import :: c_int, c_char
            integer(c_int), value :: room
            character(kind=c_char), intent(out) :: text(room)    !! filled with blanks
        end subroutine linkdyn_tell_code
    end interface

contains

    !> The code of all kernels made from now on; empty: what the environment says, or what the processor runs fastest.
    subroutine choose_code(name, status)
        character(len=*), intent(in) :: name
        type(status_type), intent(out) :: status

        if (linkdyn_choose_code(name, len(name)) == 0) &
            call fail(status, status_bad_input, "code: '"//name//"' (expected "//one_of(code_name)//")")
    end subroutine choose_code

    !> Does the environment ask for something that there is?
    subroutine check_code(status)
        type(status_type), intent(inout) :: status
        character(len=64) :: wish

        if (linkdyn_code_is_known() /= 0) return
        call get_environment_variable("LINKDYN_CODE", wish)
        call fail(status, status_bad_input, "LINKDYN_CODE: '"//trim(wish)//"' (expected "//one_of(code_name)//")")
    end subroutine check_code

    !> One of the names; behind an interpreter that was not asked for, why.
    function code_in_use() result(text)
        character(len=:), allocatable :: text
        character(len=128) :: told

        told = code_name(1)
        if (precision(1.0_wp) == precision(1.0_c_double)) call linkdyn_tell_code(told, len(told))
        text = trim(told)
    end function code_in_use
end module linkdyn_code
