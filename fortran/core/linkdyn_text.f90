!> Numbers and names as text for messages and tables.
module linkdyn_text
    use, intrinsic :: iso_fortran_env, only: int64
    use linkdyn_kinds, only: wp
    implicit none (type, external)
    private
    public :: to_text, listed, quoted, join, one_of, printable, lower_case

    !> A value as its shortest plain text.
    interface to_text
        module procedure integer_to_text, real_to_text
    end interface to_text

contains

    pure function integer_to_text(value) result(text)
        integer, intent(in) :: value
        character(len=:), allocatable :: text
        character(len=11) :: buffer
        integer :: first

        call write_digits(value, buffer, first)
        text = buffer(first:)
    end function integer_to_text

    !> Each with a blank before it. Keys of steps and models are long lists of small numbers, made for each design of a sweep anew.
    pure function listed(numbers) result(text)
        integer, intent(in) :: numbers(:)
        character(len=:), allocatable :: text
        character(len=12*size(numbers)) :: all
        character(len=11) :: buffer
        integer :: i, first, n

        n = 0
        do i = 1, size(numbers)
            call write_digits(numbers(i), buffer, first)
            all(n + 1:n + 13 - first) = " "//buffer(first:)
            n = n + 13 - first
        end do
        text = all(:n)
    end function listed

    !> At the end of a buffer, from `first` on. (Formatted output takes ten times as long.)
    pure subroutine write_digits(value, buffer, first)
        integer, intent(in) :: value
        character(len=11), intent(out) :: buffer
        integer, intent(out) :: first
        integer(int64) :: rest

        rest = abs(int(value, int64))
        first = len(buffer) + 1
        do
            first = first - 1
            buffer(first:first) = achar(iachar("0") + int(modulo(rest, 10_int64)))
            rest = rest/10
            if (rest == 0) exit
        end do
        if (value >= 0) return
        first = first - 1
        buffer(first:first) = "-"
    end subroutine write_digits

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
            text = scientific(value)
            return
        end if
        text = trim(adjustl(buffer))
    end function real_to_text

    !> Six digits at most and a power of ten, "2.5e-4"; "Infinity" and "NaN" as Fortran writes them.
    pure function scientific(value) result(text)
        real(wp), intent(in) :: value
        character(len=:), allocatable :: text
        character(len=24) :: buffer
        integer :: letter, last, exponent

        write (buffer, "(es24.5e4)") value
        text = trim(adjustl(buffer))
        letter = index(text, "E")
        if (letter == 0 .or. .not. abs(value) <= huge(value)) return
        read (text(letter + 1:), *) exponent
        last = verify(text(:letter - 1), "0", back=.true.)
        if (text(last:last) == ".") last = last - 1
        text = text(:last)//"e"//to_text(exponent)
    end function scientific

    !> The name in single quotes, trimmed; of one longer than any name or usual path its beginning.
    pure function quoted(name) result(text)
        character(len=*), intent(in) :: name
        character(len=:), allocatable :: text
        integer, parameter :: longest = 200, shortened = 60
        integer :: n

        if (len_trim(name) <= longest) then
            text = "'"//trim(name)//"'"
            return
        end if
        n = shortened
        do while (n > 1 .and. is_inside_letter(name(n + 1:n + 1)))
            n = n - 1
        end do
        text = "'"//name(:n)//"...'"
    end function quoted

    !> Does a byte go on with a letter of UTF-8 that others have begun?
    pure logical function is_inside_letter(byte)
        character, intent(in) :: byte

        is_inside_letter = iand(ichar(byte), 192) == 128
    end function is_inside_letter

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

    !> Words to choose from: "a, b or c".
    pure function one_of(words) result(text)
        character(len=*), intent(in) :: words(:)
        character(len=:), allocatable :: text
        integer :: i

        text = trim(words(1))
        do i = 2, size(words) - 1
            text = text//", "//trim(words(i))
        end do
        if (size(words) > 1) text = text//" or "//trim(words(size(words)))
    end function one_of

    !> A text as a terminal may have it: control characters, which could move its cursor or rename its window, and bytes that
    !> are no UTF-8 become visible, `\x1b`. Line ends stay if the text may have several lines.
    pure function printable(text, has_lines) result(line)
        character(len=*), intent(in) :: text
        logical, intent(in), optional :: has_lines     !! default: no
        character(len=:), allocatable :: line
        character(len=:), allocatable :: buffer        ! a report may be too long for the stack
        logical :: keeps_lines
        integer :: i, n, length

        keeps_lines = .false.
        if (present(has_lines)) keeps_lines = has_lines
        allocate (character(len=4*len(text)) :: buffer)
        length = 0
        i = 1
        do while (i <= len(text))
            n = character_length(text(i:))
            if (n == 0 .and. .not. (keeps_lines .and. text(i:i) == new_line("a"))) then
                write (buffer(length + 1:length + 4), "(a, z2.2)") "\x", iachar(text(i:i))
                length = length + 4
            else
                buffer(length + 1:length + max(1, n)) = text(i:i + max(1, n) - 1)
                length = length + max(1, n)
            end if
            i = i + max(1, n)
        end do
        line = buffer(:length)
    end function printable

    !> Bytes of the character at the start of a text; 0: it is a control character, or turns or hides others, or is no UTF-8.
    pure integer function character_length(text) result(n)
        character(len=*), intent(in) :: text
        integer :: first, k

        first = iachar(text(1:1))
        n = 1
        if (first < 32 .or. first == 127) n = 0
        if (first < 128) return
        n = 0
        if (first >= 194 .and. first <= 223) n = 2
        if (first >= 224 .and. first <= 239) n = 3
        if (first >= 240 .and. first <= 244) n = 4
        if (n > len(text)) n = 0
        do k = 2, n
            if (iachar(text(k:k)) < 128 .or. iachar(text(k:k)) > 191) n = 0
            if (n == 0) return
        end do
        if (n == 2 .and. first == 194 .and. iachar(text(2:2)) < 160) n = 0    ! the second set of control characters
        if (n == 3) then
            if (directs(text(:3))) n = 0
        end if
    end function character_length

    !> Is a character of three bytes one that nobody sees: it turns the direction of what follows, has no width, or ends a line?
    pure logical function directs(character)
        character(len=3), intent(in) :: character

        select case (character(:2))
        case (achar(226)//achar(128))                  ! U+200B to U+200F, U+2028 to U+202E
            directs = (character(3:) >= achar(139) .and. character(3:) <= achar(143)) &
                      .or. (character(3:) >= achar(168) .and. character(3:) <= achar(174))
        case (achar(226)//achar(129))                  ! U+2060 to U+206F
            directs = character(3:) >= achar(160) .and. character(3:) <= achar(175)
        case default
            directs = character == achar(239)//achar(187)//achar(191)    ! U+FEFF
        end select
    end function directs

    !> The same in small letters, of those of ASCII.
    pure function lower_case(text) result(lower)
        character(len=*), intent(in) :: text
        character(len=len(text)) :: lower
        integer, parameter :: step = iachar("a") - iachar("A")
        integer :: i

        lower = text
        do i = 1, len(text)
            if (text(i:i) >= "A" .and. text(i:i) <= "Z") lower(i:i) = achar(iachar(text(i:i)) + step)
        end do
    end function lower_case
end module linkdyn_text
