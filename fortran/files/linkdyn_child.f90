!> Another program: a text for it to read, and what it prints.
module linkdyn_child
    use, intrinsic :: iso_c_binding, only: c_char, c_int, c_int64_t, c_ptr, c_null_char
    use linkdyn_input, only: take_text
    implicit none (type, external)
    private
    public :: word_type, run_program

    !> One word of a command line.
    type :: word_type
        character(len=:), allocatable :: text
    end type word_type

    interface
        function linkdyn_run_program(words, n_word, input, input_len, output, size) result(status) bind(c)
            import :: c_char, c_int, c_int64_t, c_ptr
            character(kind=c_char), intent(in) :: words(*), input(*)
            integer(c_int), value :: n_word
            integer(c_int64_t), value :: input_len
            type(c_ptr), intent(out) :: output
            integer(c_int64_t), intent(out) :: size
            integer(c_int) :: status
        end function linkdyn_run_program
    end interface

contains

    !> Run a program to its end. It ends when a signal ends this one.
    subroutine run_program(word, input, output, exit_status)
        type(word_type), intent(in) :: word(:)                   !! path and arguments
        character(len=*), intent(in) :: input
        character(len=:), allocatable, intent(out) :: output
        integer, intent(out) :: exit_status                      !! -1: it could not be run, or a signal ended it
        character(len=:), allocatable :: words
        type(c_ptr) :: data
        integer(c_int64_t) :: n
        integer :: i

        words = ""
        do i = 1, size(word)
            words = words//word(i)%text//c_null_char
        end do
        exit_status = int(linkdyn_run_program(words, size(word), input, len(input, c_int64_t), data, n))
        call take_text(data, n, output)
    end subroutine run_program
end module linkdyn_child
