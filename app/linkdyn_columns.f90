!> Numbers and words in columns.
module linkdyn_columns
    use linkdyn_kinds, only: wp
    implicit none (type, external)
    private
    public :: significant, left, right

contains

    !> Six significant digits, as a plain number where that is readable.
    pure function significant(value) result(text)
        real(wp), intent(in) :: value
        character(len=:), allocatable :: text
        character(len=32) :: buffer, form
        integer :: exponent

        buffer = "0"
        if (value /= 0) then
            exponent = floor(log10(abs(value)))
            if (exponent >= -4 .and. exponent < 7) then
                write (form, "('(f32.', i0, ')')") max(0, 5 - exponent)
                write (buffer, form) value
            else
                write (buffer, "(es32.5)") value
            end if
        end if
        text = trim(adjustl(buffer))
        if (index(text, ".") == len(text)) text = text(:len(text) - 1)
        if (index(text, ".") == 1) text = "0"//text
        if (index(text, "-.") == 1) text = "-0"//text(2:)
    end function significant

    pure function right(text, width) result(padded)
        character(len=*), intent(in) :: text
        integer, intent(in) :: width
        character(len=max(width, len(text) + 1)) :: padded

        padded = repeat(" ", len(padded) - len(text))//text
    end function right

    pure function left(text, width) result(padded)
        character(len=*), intent(in) :: text
        integer, intent(in) :: width
        character(len=width) :: padded

        padded = text
    end function left
end module linkdyn_columns
