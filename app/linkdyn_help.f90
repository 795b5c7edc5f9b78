!> The help, in general and of each command, as the tables of commands and options have it.
module linkdyn_help
    use linkdyn_options, only: command_type, command, command_in_python, option_type, option, is_option_of
    implicit none (type, external)
    private
    public :: print_help

    integer, parameter :: line_width = 112

contains

    !> Help on the command, or in general.
    subroutine print_help(number, unit)
        integer, intent(in) :: number                !! one of `command_*`
        integer, intent(in) :: unit

        if (number >= 1 .and. number <= size(command)) then
            call explain_command(number, unit)
        else
            call list_commands(unit)
        end if
    end subroutine print_help

    subroutine list_commands(unit)
        integer, intent(in) :: unit
        integer :: i

        write (unit, "(a)") "linkdyn: forces and motion of link mechanisms", ""
        do i = 1, size(command)
            call list_command(command(i), "")
        end do
        do i = 1, size(command_in_python)
            call list_command(command_in_python(i), "; needs the Python package")
        end do
        write (unit, "(a)") "", &
            "  linkdyn COMMAND --help            options of a command", &
            "  linkdyn --version", &
            "", &
            "Exit status: 0 done; 2 bad input or a file that cannot be written (one line says which", &
            "and why); 3 done, but some samples failed: they are flagged and NaN in the results."

    contains

        subroutine list_command(command, remark)
            type(command_type), intent(in) :: command
            character(len=*), intent(in) :: remark
            character(len=32) :: call_of_it

            call_of_it = "linkdyn "//trim(command%name)//" "//command%arguments
            write (unit, "(a)") "  "//call_of_it//"  "//trim(command%summary)//remark
        end subroutine list_command
    end subroutine list_commands

    subroutine explain_command(number, unit)
        integer, intent(in) :: number                !! one of `command_*`
        integer, intent(in) :: unit
        character(len=32) :: heads(size(option))
        integer :: i, indent

        write (unit, "(a)") "linkdyn "//trim(command(number)%name)//" "//trim(command(number)%arguments), ""
        call write_wrapped(unit, "", 0, trim(command(number)%text))
        write (unit, "(a)") ""
        heads = [(head_of(option(i)), i=1, size(option))]
        indent = maxval(len_trim(heads), mask=is_option_of(number, option)) + 3
        do i = 1, size(option)
            if (is_option_of(number, option(i))) call write_wrapped(unit, heads(i), indent, trim(option(i)%text))
        end do
    end subroutine explain_command

    !> "  -o, --output FILE"
    pure function head_of(option) result(head)
        type(option_type), intent(in) :: option
        character(len=32) :: head

        head = "  "//trim(option%name)//" "//option%value
        if (option%short /= "") head = "  "//option%short//", "//trim(option%name)//" "//option%value
    end function head_of

    !> A text in lines of the page's width, behind an indent whose first line has a head in it.
    subroutine write_wrapped(unit, head, indent, text)
        integer, intent(in) :: unit
        character(len=*), intent(in) :: head
        integer, intent(in) :: indent
        character(len=*), intent(in) :: text
        character(len=indent) :: margin
        integer :: first, last

        margin = head
        first = 1
        do while (first <= len(text))
            last = min(first + line_width - indent, len(text) + 1)
            if (last <= len(text)) last = first - 1 + index(text(first:last), " ", back=.true.)
            write (unit, "(a)") margin//text(first:last - 1)
            margin = ""
            first = last + 1
        end do
    end subroutine write_wrapped
end module linkdyn_help
