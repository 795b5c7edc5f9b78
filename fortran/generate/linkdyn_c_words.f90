!> Names, numbers and comments as C has them.
module linkdyn_c_words
    use linkdyn_kinds, only: wp
    use linkdyn_text, only: to_text, printable
    implicit none (type, external)
    private
    public :: c_identifier, c_distinct, c_number, c_numbers, c_comment, upper

    character(len=*), parameter :: small = "abcdefghijklmnopqrstuvwxyz", large = "ABCDEFGHIJKLMNOPQRSTUVWXYZ", digits = "0123456789"

contains

    !> A name as a part of an identifier: what C does not allow becomes an underline.
    pure function c_identifier(name) result(word)
        character(len=*), intent(in) :: name
        character(len=:), allocatable :: word
        integer :: i

        word = trim(name)
        do i = 1, len(word)
            if (verify(word(i:i), small//large//digits) > 0) word(i:i) = "_"
        end do
    end function c_identifier

    !> Names as identifiers behind a common beginning, all different: a number goes behind those that were there before.
    pure function c_distinct(name) result(word)
        character(len=*), intent(in) :: name(:)
        character(len=len(name) + 12) :: word(size(name))
        integer :: i, n

        do i = 1, size(name)
            word(i) = upper(c_identifier(name(i)))
            if (word(i) == "") word(i) = "_"
            n = 1
            do while (any(word(:i - 1) == word(i)))
                n = n + 1
                word(i) = upper(c_identifier(name(i)))//"_"//to_text(n)
            end do
        end do
    end function c_distinct

    pure function upper(text) result(word)
        character(len=*), intent(in) :: text
        character(len=len(text)) :: word
        integer :: i, k

        word = text
        do i = 1, len(text)
            k = index(small, text(i:i))
            if (k > 0) word(i:i) = large(k:k)
        end do
    end function upper

    !> A text within a comment: nothing in it ends the comment, begins another or stands for a character.
    pure function c_comment(text) result(line)
        character(len=*), intent(in) :: text
        character(len=:), allocatable :: line
        character(len=:), allocatable :: plain
        integer :: i

        plain = printable(trim(text))
        line = ""
        do i = 1, len(plain)
            if (i > 1) then
                if (any(plain(i - 1:i) == ["*/", "/*", "??"])) line = line//" "
            end if
            line = line//plain(i:i)
        end do
    end function c_comment

    !> The shortest decimal number that is read as this one, always with a point; 17 digits tell all numbers apart.
    pure function c_number(x) result(text)
        real(wp), intent(in) :: x
        character(len=:), allocatable :: text
        character(len=48) :: buffer
        real(wp) :: back
        integer :: n, least, most, e, exponent

        if (.not. abs(x) <= huge(x)) then
            text = "NAN"                               ! of math.h; nothing that depends on it counts
            return
        end if
        ! what more digits are read as is nearer: so many are enough, or more
        least = 1
        most = 17
        do while (least < most)
            n = (least + most)/2
            write (buffer, "(es48."//to_text(n - 1)//"e4)") x
            read (buffer, *) back
            if (back == x) then
                most = n
            else
                least = n + 1
            end if
        end do
        write (buffer, "(es48."//to_text(most - 1)//"e4)") x
        buffer = adjustl(buffer)
        e = index(buffer, "E")
        read (buffer(e + 1:), *) exponent
        associate (mantissa => buffer(:e - 1))
            text = merge("-", " ", mantissa(1:1) == "-")
            text = trim(text)//in_place(plain_digits(mantissa), exponent)
        end associate
    end function c_number

    !> Numbers with commas between.
    pure function c_numbers(x) result(text)
        real(wp), intent(in) :: x(:)
        character(len=:), allocatable :: text
        integer :: i

        text = ""
        do i = 1, size(x)
            if (i > 1) text = text//", "
            text = text//c_number(x(i))
        end do
    end function c_numbers

    pure function plain_digits(mantissa) result(digit)
        character(len=*), intent(in) :: mantissa
        character(len=:), allocatable :: digit
        integer :: i

        digit = ""
        do i = 1, len(mantissa)
            if (index(digits, mantissa(i:i)) > 0) digit = digit//mantissa(i:i)
        end do
        do while (len(digit) > 1 .and. digit(len(digit):) == "0")
            digit = digit(:len(digit) - 1)
        end do
    end function plain_digits

    !> Digits d.ddd times ten to a power, written out if that is short.
    pure function in_place(digit, exponent) result(text)
        character(len=*), intent(in) :: digit
        integer, intent(in) :: exponent
        character(len=:), allocatable :: text

        if (exponent >= 0 .and. exponent < 7) then
            text = digit//repeat("0", max(0, exponent + 1 - len(digit)))
            text = text(:exponent + 1)//"."//text(exponent + 2:)
            if (text(len(text):) == ".") text = text//"0"
        else if (exponent < 0 .and. exponent >= -4) then
            text = "0."//repeat("0", -exponent - 1)//digit
        else
            text = digit(1:1)//"."//digit(2:)
            if (len(digit) == 1) text = text//"0"
            text = text//"e"//to_text(exponent)
        end if
    end function in_place
end module linkdyn_c_words
