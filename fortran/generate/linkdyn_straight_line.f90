!> A kernel as single assignments, cut into parts: what text of it is written from.
!>
!> A kernel's slots are used again and again; here every result has a number of its own, and operands say what they are. Compilers
!> take long over a long function, so the line is cut, and values that later parts use are kept in places, which they share.
module linkdyn_straight_line
    use linkdyn_kernel, only: kernel_type
    implicit none (type, external)
    private
    public :: straight_line, operand_type, make_straight_line, part_of
    public :: from_input, from_constant, from_statement

    ! ---- what an operand is
    integer, parameter :: from_nothing = 0
    integer, parameter :: from_input = 1
    integer, parameter :: from_constant = 2
    integer, parameter :: from_statement = 3

    integer, parameter :: longest_part = 2000          !! statements: compilers take seconds over them, and more than in proportion

    type :: operand_type
        integer :: from = from_nothing
        integer :: at = 0                              !! number of the input, constant or statement
    end type operand_type

    type :: statement_type
        integer :: kind = 0                            !! `op_*`
        type(operand_type) :: operand(3)
        integer :: look = 0                            !! of a look-up: in which curve for what
        integer :: place = 0                           !! where later parts find the result; 0: none asks for it
    end type statement_type

    type :: straight_line
        type(statement_type), allocatable :: of(:)
        type(operand_type), allocatable :: output(:)
        integer, allocatable :: output_sign(:)         !! (output) +1 or -1
        integer :: n_part = 1
        integer :: n_place = 0
    end type straight_line

contains

    !> Slots are used again and again; statements name what they take by where it was made.
    subroutine make_straight_line(kernel, line)
        type(kernel_type), intent(in) :: kernel
        type(straight_line), intent(out) :: line
        type(operand_type), allocatable :: in_slot(:)
        integer :: g, k, first, i

        allocate (in_slot(0:kernel%n_slot))
        do i = 1, kernel%n_input
            in_slot(i) = operand_type(from_input, i)
        end do
        do i = 1, kernel%n_constant
            in_slot(kernel%n_input + i) = operand_type(from_constant, i)
        end do
        allocate (line%of(size(kernel%step)), line%output(kernel%n_output))
        k = 0
        first = 1
        do g = 1, size(kernel%group_end)
            do while (k < kernel%step_end(g))
                k = k + 1
                line%of(k)%kind = kernel%step(k)%kind
                line%of(k)%look = kernel%step(k)%look
                line%of(k)%operand = in_slot(kernel%step(k)%operand)
                in_slot(kernel%step(k)%result) = operand_type(from_statement, k)
            end do
            line%output(first:kernel%group_end(g)) = in_slot(kernel%output_slot(first:kernel%group_end(g)))
            first = kernel%group_end(g) + 1
        end do
        line%of = line%of(:k)                          ! no output needs what comes then
        line%output_sign = kernel%output_sign
        line%n_part = max(1, (k + longest_part - 1)/longest_part)
        call find_places(line)
    end subroutine make_straight_line

    !> The part in which a statement stands.
    elemental integer function part_of(k)
        integer, intent(in) :: k

        part_of = 1 + (k - 1)/longest_part
    end function part_of

    !> A place is free for another value in the part after the last that reads it.
    subroutine find_places(line)
        type(straight_line), intent(inout) :: line
        integer, allocatable :: last_part(:), free(:), freed_in(:)
        integer :: k, i, p, n_free

        last_part = part_of([(k, k=1, size(line%of))])
        allocate (free(size(line%of)), freed_in(size(line%of)))
        do k = 1, size(line%of)
            do i = 1, 3
                if (line%of(k)%operand(i)%from /= from_statement) cycle
                last_part(line%of(k)%operand(i)%at) = max(last_part(line%of(k)%operand(i)%at), part_of(k))
            end do
        end do
        n_free = 0
        p = 1
        freed_in = 0                                   ! of places: the part from which on others may have it
        do k = 1, size(line%of)
            if (part_of(k) > p) then
                p = part_of(k)
                do i = 1, line%n_place
                    if (freed_in(i) /= p) cycle
                    n_free = n_free + 1
                    free(n_free) = i
                end do
            end if
            if (last_part(k) == part_of(k)) cycle
            if (n_free > 0) then
                line%of(k)%place = free(n_free)
                n_free = n_free - 1
            else
                line%n_place = line%n_place + 1
                line%of(k)%place = line%n_place
            end if
            freed_in(line%of(k)%place) = last_part(k) + 1
        end do
    end subroutine find_places
end module linkdyn_straight_line
