!> A kernel as functions in C: one statement an operation, its inputs by name, its outputs where they go.
module linkdyn_c_body
    use linkdyn_c_curves, only: find_curve
    use linkdyn_c_words, only: c_number
    use linkdyn_kernel, only: kernel_type
    use linkdyn_operation, only: op_add, op_subtract, op_multiply, op_reciprocal, op_root, op_sine, op_cosine, op_arctangent, &
        op_minimum, op_maximum, op_absolute, op_select, op_whole, op_piece, op_nearest, op_farthest
    use linkdyn_piecewise, only: piecewise_curve, curve_of, which_of
    use linkdyn_schedule, only: op_multiply_add, op_multiply_subtract, op_subtract_product
    use linkdyn_straight_line, only: straight_line, operand_type, make_straight_line, part_of, from_input, from_constant, &
        from_statement
    use linkdyn_text, only: to_text
    implicit none (type, external)
    private
    public :: c_value, c_pointer, c_routine, make_routine, write_routine, write_calls, is_handed, uses_operation, take_curves

    integer, parameter :: text_len = 256

    !> A number outside the kernel.
    type :: c_value
        character(len=text_len) :: is = ""             !! `in->q[0]`
        character(len=32) :: local = ""                !! an input's name within a part
        character(len=text_len) :: comment = ""
    end type c_value

    !> What parts are handed, if they use it.
    type :: c_pointer
        character(len=text_len) :: declaration = ""    !! `struct work *restrict work`
        character(len=16) :: begin = ""                !! of all values behind it, `work->`
    end type c_pointer

    !> A kernel ready to be written.
    type :: c_routine
        character(len=:), allocatable :: name
        type(kernel_type), private :: kernel
        type(straight_line) :: line
        type(c_value), allocatable, private :: input(:), output(:)
        type(c_pointer), allocatable, private :: pointer(:)    !! the first is that of places
        logical, allocatable, private :: takes(:, :)   !! (pointer, part)
        integer, allocatable, private :: first_of(:)   !! output that a statement is; 0: none (statement)
        integer, allocatable, private :: next_of(:)    !! another one that is the same (output)
        integer, allocatable, private :: curve(:)      !! what those are called in which it looks up (curve of the kernel)
    end type c_routine

contains

    subroutine make_routine(name, kernel, input, output, pointer, routine)
        character(len=*), intent(in) :: name
        type(kernel_type), intent(in) :: kernel
        type(c_value), intent(in) :: input(:), output(:)
        type(c_pointer), intent(in) :: pointer(:)      !! the first one has the places `w`
        type(c_routine), intent(out) :: routine
        integer :: p

        routine%name = name
        routine%kernel = kernel
        routine%input = input
        routine%output = output
        routine%pointer = pointer
        call make_straight_line(kernel, routine%line)
        call list_outputs(routine)
        allocate (routine%takes(size(pointer), routine%line%n_part))
        do p = 1, routine%line%n_part
            routine%takes(:, p) = pointers_of(routine, p)
        end do
    end subroutine make_routine

    subroutine list_outputs(routine)
        type(c_routine), intent(inout) :: routine
        integer :: i

        allocate (routine%first_of(size(routine%line%of)), routine%next_of(size(routine%line%output)))
        routine%first_of = 0
        routine%next_of = 0
        do i = size(routine%line%output), 1, -1
            associate (output => routine%line%output(i))
                if (output%from /= from_statement) cycle
                routine%next_of(i) = routine%first_of(output%at)
                routine%first_of(output%at) = i
            end associate
        end do
    end subroutine list_outputs

    !> Which pointers a part uses.
    function pointers_of(routine, p) result(takes)
        type(c_routine), intent(in) :: routine
        integer, intent(in) :: p
        logical :: takes(size(routine%pointer))
        logical :: reads(size(routine%input))
        integer :: k

        takes = .false.
        reads = inputs_of(routine, p)
        do k = 1, size(reads)
            if (reads(k)) call note(routine%input(k)%is)
        end do
        do k = 1, size(routine%output)
            if (part_of_output(routine%line, k) == p) call note(routine%output(k)%is)
        end do
        do k = 1, size(routine%line%of)
            associate (statement => routine%line%of(k))
                if (part_of(k) /= p) cycle
                takes(1) = takes(1) .or. statement%place > 0 &
                           .or. any(statement%operand%from == from_statement .and. part_of(statement%operand%at) < p)
            end associate
        end do

    contains

        subroutine note(text)
            character(len=*), intent(in) :: text
            integer :: i

            do i = 1, size(takes)
                takes(i) = takes(i) .or. index(text, trim(routine%pointer(i)%begin)) == 1
            end do
        end subroutine note
    end function pointers_of

    !> Which inputs a part reads.
    function inputs_of(routine, p) result(reads)
        type(c_routine), intent(in) :: routine
        integer, intent(in) :: p
        logical :: reads(size(routine%input))
        integer :: k, i

        reads = .false.
        do k = 1, size(routine%line%of)
            if (part_of(k) /= p) cycle
            do i = 1, 3
                associate (operand => routine%line%of(k)%operand(i))
                    if (operand%from == from_input) reads(operand%at) = .true.
                end associate
            end do
        end do
        do k = 1, size(routine%line%output)
            associate (output => routine%line%output(k))
                if (output%from == from_input .and. part_of_output(routine%line, k) == p) reads(output%at) = .true.
            end associate
        end do
    end function inputs_of

    !> The part in which an output is handed out: where it is made; the last one, if nothing makes it.
    pure integer function part_of_output(line, k) result(p)
        type(straight_line), intent(in) :: line
        integer, intent(in) :: k

        p = line%n_part
        if (line%output(k)%from == from_statement) p = part_of(line%output(k)%at)
    end function part_of_output

    !> The curves in which a routine looks up, among those of others.
    subroutine take_curves(routine, shelf)
        type(c_routine), intent(inout) :: routine
        type(piecewise_curve), allocatable, intent(inout) :: shelf(:)
        integer :: k

        allocate (routine%curve(size(routine%kernel%curve)), source=0)
        do k = 1, size(routine%line%of)
            associate (look => routine%line%of(k)%look)
                if (look == 0) cycle
                if (routine%curve(curve_of(look)) > 0) cycle
                call find_curve(routine%kernel%curve(curve_of(look)), shelf, routine%curve(curve_of(look)))
            end associate
        end do
    end subroutine take_curves

    !> All parts, one after the other.
    subroutine write_routine(routine, unit)
        type(c_routine), intent(in) :: routine
        integer, intent(in) :: unit
        integer :: p, k, next

        next = 1
        do p = 1, routine%line%n_part
            write (unit, "(a)") &
                "static void "//part_name(routine, p)//"("//pointers(routine, p, routine%pointer%declaration)//")", "{"
            call write_inputs(routine, p, unit)
            do k = 1, size(routine%line%of)
                if (part_of(k) /= p) cycle
                call announce_output(routine, k, next, unit)
                call write_statement(routine, k, unit)
            end do
            do k = 1, size(routine%output)
                if (routine%line%output(k)%from == from_statement .or. p < routine%line%n_part) cycle
                call write_output(routine, k, p, unit)
            end do
            write (unit, "(a)") "}", ""
        end do
    end subroutine write_routine

    !> Calls of all parts, in a function that has the pointers under the names given.
    subroutine write_calls(routine, indent, argument, unit)
        type(c_routine), intent(in) :: routine
        integer, intent(in) :: indent
        character(len=*), intent(in) :: argument(:)    !! (pointer)
        integer, intent(in) :: unit
        integer :: p

        do p = 1, routine%line%n_part
            write (unit, "(a)") repeat(" ", indent)//part_name(routine, p)//"("//pointers(routine, p, argument)//");"
        end do
    end subroutine write_calls

    !> Does any part take the pointer of this number?
    pure logical function is_handed(routine, pointer)
        type(c_routine), intent(in) :: routine
        integer, intent(in) :: pointer

        is_handed = any(routine%takes(pointer, :))
    end function is_handed

    function part_name(routine, p) result(name)
        type(c_routine), intent(in) :: routine
        integer, intent(in) :: p
        character(len=:), allocatable :: name

        name = routine%name
        if (routine%line%n_part > 1) name = name//"_"//to_text(p)
    end function part_name

    !> What a part takes, in the words of its declaration or of a call.
    function pointers(routine, p, as) result(text)
        type(c_routine), intent(in) :: routine
        integer, intent(in) :: p
        character(len=*), intent(in) :: as(:)          !! (pointer)
        character(len=:), allocatable :: text
        integer :: i

        text = ""
        do i = 1, size(routine%pointer)
            if (.not. routine%takes(i, p)) cycle
            if (text /= "") text = text//", "
            text = text//trim(as(i))
        end do
    end function pointers

    !> Names for what a part reads.
    subroutine write_inputs(routine, p, unit)
        type(c_routine), intent(in) :: routine
        integer, intent(in) :: p, unit
        logical :: reads(size(routine%input))
        integer :: k

        reads = inputs_of(routine, p)
        do k = 1, size(reads)
            if (.not. reads(k)) cycle
            associate (input => routine%input(k))
                write (unit, "(a)") "    const double "//trim(input%local)//" = "//trim(input%is)//"; /* " &
                    //trim(input%comment)//" */"
            end associate
        end do
        if (any(reads)) write (unit, "(a)") ""
    end subroutine write_inputs

    !> Operations stand in the order of the outputs that need them first: say which one comes next.
    subroutine announce_output(routine, k, next, unit)
        type(c_routine), intent(in) :: routine
        integer, intent(in) :: k                       !! statement
        integer, intent(inout) :: next                 !! output
        integer, intent(in) :: unit
        integer :: before

        before = next
        do while (next <= size(routine%line%output))
            if (routine%line%output(next)%from == from_statement .and. routine%line%output(next)%at >= k) exit
            next = next + 1
        end do
        if (next > size(routine%line%output)) return
        if (k > 1 .and. next == before) return
        write (unit, "(a)") "    /* "//trim(routine%output(next)%comment)//" */"
    end subroutine announce_output

    subroutine write_statement(routine, k, unit)
        type(c_routine), intent(in) :: routine
        integer, intent(in) :: k, unit
        integer :: i

        write (unit, "(a)") "    const double t"//to_text(k)//" = "//expression(routine, k)//";"
        if (routine%line%of(k)%place > 0) &
            write (unit, "(a)") "    "//place_name(routine, routine%line%of(k)%place)//" = t"//to_text(k)//";"
        i = routine%first_of(k)
        do while (i > 0)
            call write_output(routine, i, part_of(k), unit)
            i = routine%next_of(i)
        end do
    end subroutine write_statement

    subroutine write_output(routine, i, p, unit)
        type(c_routine), intent(in) :: routine
        integer, intent(in) :: i, p, unit

        write (unit, "(a)") "    "//trim(routine%output(i)%is)//" = " &
            //trim(merge("-", " ", routine%line%output_sign(i) < 0))//operand_text(routine, routine%line%output(i), p)//";"
    end subroutine write_output

    !> What a statement computes.
    function expression(routine, k) result(text)
        type(c_routine), intent(in) :: routine
        integer, intent(in) :: k
        character(len=:), allocatable :: text
        character(len=:), allocatable :: a, b, c

        associate (operand => routine%line%of(k)%operand, p => part_of(k))
            a = operand_text(routine, operand(1), p)
            b = operand_text(routine, operand(2), p)
            c = operand_text(routine, operand(3), p)
        end associate
        select case (routine%line%of(k)%kind)
        case (op_add)
            text = a//" + "//b
        case (op_subtract)
            text = a//" - "//b
        case (op_multiply)
            text = a//"*"//b
        case (op_reciprocal)
            text = "1.0/"//a
        case (op_root)
            text = "sqrt("//a//")"
        case (op_sine)
            text = "sin("//a//")"
        case (op_cosine)
            text = "cos("//a//")"
        case (op_arctangent)
            text = "atan2("//a//", "//b//")"
        case (op_minimum)
            text = a//" < "//b//" ? "//a//" : "//b
        case (op_maximum)
            text = a//" > "//b//" ? "//a//" : "//b
        case (op_absolute)
            text = "fabs("//a//")"
        case (op_select)
            text = a//" > 0.0 ? "//b//" : "//c
        case (op_whole)
            text = "nearbyint("//a//")"
        case (op_piece)
            associate (which => which_of(routine%line%of(k)%look))
                text = "along("//curve_text()//", "//to_text(which/4)//", "//to_text(modulo(which, 4))//", "//a//")"
            end associate
        case (op_nearest)
            text = "best_place("//curve_text()//", 1, "//a//", "//b//")"
        case (op_farthest)
            text = "best_place("//curve_text()//", 0, "//a//", "//b//")"
        case (op_multiply_add)
            text = "multiply_add("//a//", "//b//", "//c//")"
        case (op_multiply_subtract)
            text = "multiply_add("//a//", "//b//", -"//c//")"
        case (op_subtract_product)
            text = "multiply_add(-"//a//", "//b//", "//c//")"
        end select

    contains

        function curve_text() result(name)
            character(len=:), allocatable :: name

            name = "&curve_"//to_text(routine%curve(curve_of(routine%line%of(k)%look)))
        end function curve_text
    end function expression

    !> An operand as a part has it.
    function operand_text(routine, operand, p) result(text)
        type(c_routine), intent(in) :: routine
        type(operand_type), intent(in) :: operand
        integer, intent(in) :: p
        character(len=:), allocatable :: text

        text = ""
        select case (operand%from)
        case (from_input)
            text = trim(routine%input(operand%at)%local)
        case (from_constant)
            text = c_number(routine%kernel%constant(operand%at))
            if (text(1:1) == "-") text = "("//text//")"
        case (from_statement)
            text = "t"//to_text(operand%at)
            if (part_of(operand%at) < p) text = place_name(routine, routine%line%of(operand%at)%place)
        end select
    end function operand_text

    function place_name(routine, place) result(name)
        type(c_routine), intent(in) :: routine
        integer, intent(in) :: place
        character(len=:), allocatable :: name

        name = trim(routine%pointer(1)%begin)//"w["//to_text(place - 1)//"]"
    end function place_name

    logical function uses_operation(routine, kind)
        type(c_routine), intent(in) :: routine
        integer, intent(in) :: kind(:)                 !! `op_*`
        integer :: k

        uses_operation = .false.
        do k = 1, size(routine%line%of)
            uses_operation = uses_operation .or. any(routine%line%of(k)%kind == kind)
        end do
    end function uses_operation
end module linkdyn_c_body
