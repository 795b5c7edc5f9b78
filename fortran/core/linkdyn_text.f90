!> Numbers and names as text for messages and tables.
module linkdyn_text
    use linkdyn_kinds, only: wp
    implicit none (type, external)
    private
    public :: to_text, quoted, join

    !> A value as its shortest plain text.
    interface to_text
        module procedure integer_to_text, real_to_text
    end interface to_text

contains

    pure function integer_to_text(value) result(text)
        integer, intent(in) :: value
        character(len=:), allocatable :: text
        character(len=12) :: buffer

        write (buffer, "(i0)") value
        text = trim(buffer)
    end function integer_to_text

    !> Six significant digits, without trailing blanks.
    pure function real_to_text(value) result(text)
        real(wp), intent(in) :: value
        character(len=:), allocatable :: text
        character(len=24) :: buffer

        if (abs(value) >= 1.0e-3_wp .and. abs(value) < 1.0e6_wp) then
            write (buffer, "(f24.6)") value
            buffer = adjustl(buffer)
            do while (buffer(len_trim(buffer):) == "0")
                buffer(len_trim(buffer):) = " "
            end do
            if (buffer(len_trim(buffer):) == ".") buffer(len_trim(buffer):) = " "
        else if (value == 0) then
            buffer = "0"
        else
            write (buffer, "(es24.5)") value
        end if
        text = trim(adjustl(buffer))
    end function real_to_text

    !> The name in single quotes, trimmed.
    pure function quoted(name) result(text)
        character(len=*), intent(in) :: name
        character(len=:), allocatable :: text

        text = "'"//trim(name)//"'"
    end function quoted

    !> Quoted names in a row: 'a', 'b', 'c'.
    pure function join(names) result(text)
        character(len=*), intent(in) :: names(:)
        character(len=:), allocatable :: text
        integer :: i

        text = ""
        do i = 1, size(names)
            if (i > 1) text = text//", "
            text = text//quoted(names(i))
        end do
    end function join
end module linkdyn_text
