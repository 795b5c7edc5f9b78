!> Whole files and decimal numbers, over the C glue: fast, and the same in every locale.
module linkdyn_input
    use, intrinsic :: iso_c_binding, only: c_ptr, c_null_ptr, c_int, c_int64_t, c_double, c_char, &
        c_f_pointer
    use linkdyn_kinds, only: wp
    use linkdyn_status, only: status_type, status_bad_input, fail
    implicit none (type, external)
    private
    public :: read_file_text, take_text, is_utf16, parse_number, put_number, number_length, folder_of, path_in_folder

    integer(c_int), parameter :: file_ok = 0, file_missing = 1, file_directory = 2, file_denied = 3

    !> Digits with which a number of the working precision is read back to the same value, and room for them with sign,
    !> point and exponent.
    integer, parameter :: n_digit = ceiling(1 + digits(1.0_wp)*log10(2.0_wp))
    integer, parameter :: exponent_length = ceiling(log10(real(range(1.0_wp), wp)))
    integer, parameter :: number_length = n_digit + exponent_length + 4

    interface
        integer(c_int) function c_file_read(path, path_len, data, size, message, message_len) &
            bind(c, name="linkdyn_file_read")
            import :: c_ptr, c_char, c_int, c_int64_t
            character(kind=c_char), intent(in) :: path(*)
            integer(c_int), value :: path_len
            type(c_ptr), intent(out) :: data
            integer(c_int64_t), intent(out) :: size
            character(kind=c_char), intent(inout) :: message(*)
            integer(c_int), value :: message_len
        end function c_file_read

        subroutine c_file_free(data) bind(c, name="linkdyn_file_free")
            import :: c_ptr
            type(c_ptr), value :: data
        end subroutine c_file_free

        pure subroutine c_parse_number(text, text_len, value, n_used) bind(c, name="linkdyn_parse_number")
            import :: c_char, c_int, c_double
            character(kind=c_char), intent(in) :: text(*)
            integer(c_int), value :: text_len
            real(c_double), intent(out) :: value
            integer(c_int), intent(out) :: n_used
        end subroutine c_parse_number

        integer(c_int) function c_format_number(value, text, text_len) bind(c, name="linkdyn_format_number")
            import :: c_char, c_int, c_double
            real(c_double), value :: value
            character(kind=c_char), intent(inout) :: text(*)
            integer(c_int), value :: text_len
        end function c_format_number
    end interface

contains

    !> Read a whole file. Says apart what is missing, a directory, closed to us, or empty.
    subroutine read_file_text(file, where, text, status)
        character(len=*), intent(in) :: file
        character(len=*), intent(in) :: where  !! start of the message: the file, or where it was asked for
        character(len=:), allocatable, intent(out) :: text
        type(status_type), intent(inout) :: status
        type(c_ptr) :: data
        character(len=128) :: reason
        integer(c_int) :: outcome
        integer(c_int64_t) :: n

        data = c_null_ptr
        reason = ""
        outcome = c_file_read(trim(file), int(len_trim(file), c_int), data, n, reason, int(len(reason), c_int))
        select case (outcome)
        case (file_ok)
            if (n == 0) call fail(status, status_bad_input, where//": the file is empty")
        case (file_missing)
            call fail(status, status_bad_input, where//": there is no such file")
        case (file_directory)
            call fail(status, status_bad_input, where//": this is a directory (expected a file)")
        case (file_denied)
            call fail(status, status_bad_input, where//": the file may not be read (permission denied)")
        case default
            call fail(status, status_bad_input, where//": the file cannot be read ("//trim(reason)//")")
        end select
        if (outcome /= file_ok) n = 0
        call take_text(data, n, text)
    end subroutine read_file_text

    !> Bytes that the C glue allocated; they are freed.
    subroutine take_text(data, n, text)
        type(c_ptr), intent(in) :: data
        integer(c_int64_t), intent(in) :: n
        character(len=:), allocatable, intent(out) :: text
        character(kind=c_char), pointer :: characters(:)
        integer(c_int64_t) :: i

        allocate (character(len=n) :: text)
        if (n > 0) call c_f_pointer(data, characters, [n])
        do i = 1, n
            text(i:i) = characters(i)
        end do
        call c_file_free(data)
    end subroutine take_text

    !> The decimal number at the start of a text.
    !>
    !> Read in double precision in every build, so that builds of different precision compute the
    !> same problem.
    pure subroutine parse_number(text, value, n_used)
        character(len=*), intent(in) :: text
        real(wp), intent(out) :: value         !! may be infinite or NaN if it is so written
        integer, intent(out) :: n_used         !! characters it takes; 0: there is no number
        real(c_double) :: c_value
        integer(c_int) :: c_used

        call c_parse_number(text, int(len(text), c_int), c_value, c_used)
        n_used = int(c_used)
        value = real(c_value, wp)
    end subroutine parse_number

    !> Write a number with as many digits as reading it back to the same value takes: in double precision as few as do.
    subroutine put_number(value, text, n_used)
        real(wp), intent(in) :: value
        character(len=number_length), intent(out) :: text
        integer, intent(out) :: n_used
        character(len=16) :: number_form

        if (digits(value) == digits(1.0_c_double)) then
            n_used = int(c_format_number(real(value, c_double), text, int(len(text), c_int)))
        else
            write (number_form, "('(es', i0, '.', i0, 'e', i0, ')')") number_length, n_digit - 1, exponent_length
            write (text, number_form) value
            text = adjustl(text)
            n_used = len_trim(text)
        end if
    end subroutine put_number

    !> A text as Windows writes it where it says "Unicode".
    pure logical function is_utf16(text)
        character(len=*), intent(in) :: text
        character(len=*), parameter :: mark = achar(255)//achar(254)

        is_utf16 = index(text, mark) == 1
    end function is_utf16

    !> The folder of a file, with its last slash; empty for the current one.
    pure function folder_of(file) result(folder)
        character(len=*), intent(in) :: file
        character(len=:), allocatable :: folder

        folder = file(:index(file, "/", back=.true.))
    end function folder_of

    !> A file named in a scene: relative names start at the scene's folder.
    pure function path_in_folder(folder, file) result(path)
        character(len=*), intent(in) :: folder, file
        character(len=:), allocatable :: path

        if (index(file, "/") == 1 .or. len_trim(folder) == 0) then
            path = trim(file)
        else if (folder(len_trim(folder):len_trim(folder)) == "/") then
            path = trim(folder)//trim(file)
        else
            path = trim(folder)//"/"//trim(file)
        end if
    end function path_in_folder
end module linkdyn_input
