!> Equations written as expressions: `require` says that an expression of unknowns is zero, `solve` finds them.
!>
!>     x = unknown(system, "F")
!>     call require(system, x*arm - moment)
!>     call solve(system, ...)
!>     force = solved(system, x)
module linkdyn_system
    use linkdyn_elimination, only: sparse_row, elimination_type, eliminate
    use linkdyn_linear_form, only: linear_form, linear_forms, find_linear_form
    use linkdyn_record, only: new_unknown, record_type, open_record_of_thread
    use linkdyn_value, only: value, zero, operator(+), operator(-), operator(*)
    implicit none (type, external)
    private
    public :: system_type, unknown, require, solve, take_solution, solved, list_rows

    !> Equations of one open record.
    type :: system_type
        type(linear_forms) :: forms
        type(linear_form), allocatable :: equation(:)  !! rest + sum of coefficient * unknown = 0
        integer :: n_equation = 0
        integer, allocatable :: number(:)              !! numbers of the unknowns to be solved for
        integer :: n_unknown = 0
        integer, allocatable :: place(:)              !! (unknown of the record) in `number`; 0: of another system
        type(value), allocatable :: solution(:)        !! (as in `number`)
        type(value), allocatable :: watched(:)         !! magnitudes that must stay below one
        type(value) :: determinant                     !! its sign, or the opposite at every sample
        logical :: is_solved = .false.
    end type system_type

    !> `require(system, expression)`: it is zero.
    interface require
        module procedure require_one, require_many
    end interface require
    !> `solved(system, expression)`: the expression with the unknowns found.
    interface solved
        module procedure solve_one, solve_many
    end interface solved

contains

    !> A new unknown of the system.
    function unknown(system) result(x)
        type(system_type), intent(inout) :: system
        type(value) :: x
        type(record_type), pointer :: record

        x = new_unknown()
        system%forms%first = min(system%forms%first, x%node)
        record => open_record_of_thread()
        if (.not. allocated(system%number)) allocate (system%number(64))
        if (system%n_unknown == size(system%number)) system%number = [system%number, system%number]
        system%n_unknown = system%n_unknown + 1
        system%number(system%n_unknown) = record%operand(1, x%node)
    end function unknown

    subroutine require_many(system, expression)
        type(system_type), intent(inout) :: system
        type(value), intent(in) :: expression(:)
        integer :: k

        do k = 1, size(expression)
            call require_one(system, expression(k))
        end do
    end subroutine require_many

    !> The expression is zero. One without unknowns says nothing.
    subroutine require_one(system, expression)
        type(system_type), intent(inout) :: system
        type(value), intent(in) :: expression
        type(linear_form) :: form
        type(linear_form), allocatable :: more(:)

        call find_linear_form(system%forms, expression, form)
        if (size(form%unknown) == 0) return
        if (.not. allocated(system%equation)) allocate (system%equation(64))
        if (system%n_equation == size(system%equation)) then
            allocate (more(2*system%n_equation))
            more(:system%n_equation) = system%equation
            call move_alloc(more, system%equation)
        end if
        system%n_equation = system%n_equation + 1
        system%equation(system%n_equation) = form
    end subroutine require_one

    !> Solve for all unknowns of the system; unknowns of others stay in the solution.
    subroutine solve(system, is_last)
        type(system_type), intent(inout) :: system
        logical, intent(in), optional :: is_last(:)    !! (as in `number`) solved for after the others
        type(sparse_row) :: row(system%n_equation)
        type(elimination_type) :: elimination
        logical :: last(system%n_unknown)

        call list_rows(system, row)
        last = .false.
        if (present(is_last)) last = is_last
        call eliminate(row, system%n_unknown, last, elimination)
        system%is_solved = elimination%is_complete .and. system%forms%is_linear
        if (.not. system%is_solved) then
            ! whoever traces on writes nonsense into a record that is thrown away
            if (allocated(system%solution)) deallocate (system%solution)
            allocate (system%solution(system%n_unknown), source=zero())
            return
        end if
        call move_alloc(elimination%solution, system%solution)
        call move_alloc(elimination%watched, system%watched)
        system%determinant = elimination%determinant
    end subroutine solve

    !> The unknowns have been found elsewhere.
    subroutine take_solution(system, solution)
        type(system_type), intent(inout) :: system
        type(value), intent(in) :: solution(:)         !! (as in `number`)

        call find_places(system)
        system%solution = solution
        allocate (system%watched(0))
        system%is_solved = .true.
    end subroutine take_solution

    !> The equations as rows of its unknowns.
    subroutine list_rows(system, row)
        type(system_type), intent(inout) :: system
        type(sparse_row), intent(out) :: row(:)        !! (equation)
        type(record_type), pointer :: record
        integer :: i

        record => open_record_of_thread()
        call find_places(system)
        do i = 1, system%n_equation
            row(i) = row_of(system%equation(i), system%place, record)
        end do
    end subroutine list_rows

    !> Which unknowns of the record are the system's.
    subroutine find_places(system)
        type(system_type), intent(inout) :: system
        type(record_type), pointer :: record
        integer :: k

        record => open_record_of_thread()
        if (allocated(system%place)) deallocate (system%place)
        allocate (system%place(record%n_unknown))
        system%place = 0
        do k = 1, system%n_unknown
            system%place(system%number(k)) = k
        end do
    end subroutine find_places

    !> An equation as a row: what is not to be solved for goes to the right.
    function row_of(equation, place, record) result(row)
        type(linear_form), intent(in) :: equation
        integer, intent(in) :: place(:)                !! of each unknown of the record in the row; 0: of another system
        type(record_type), intent(in) :: record
        type(sparse_row) :: row
        integer :: k

        allocate (row%column(size(equation%unknown)), row%entry(size(equation%unknown)))
        row%right = -equation%rest
        do k = 1, size(equation%unknown)
            if (place(equation%unknown(k)) > 0) then
                row%n = row%n + 1
                row%column(row%n) = place(equation%unknown(k))
                row%entry(row%n) = equation%coefficient(k)
            else
                row%right = row%right - equation%coefficient(k)*unknown_value(record, equation%unknown(k))
            end if
        end do
    end function row_of

    !> The value of an unknown of the record, by its number.
    function unknown_value(record, number) result(x)
        type(record_type), intent(in) :: record
        integer, intent(in) :: number
        type(value) :: x

        x = value(record%node_of_unknown(number), 1)
    end function unknown_value

    function solve_many(system, expression) result(v)
        type(system_type), intent(inout) :: system
        type(value), intent(in) :: expression(:)
        type(value) :: v(size(expression))
        integer :: k

        do k = 1, size(expression)
            v(k) = solve_one(system, expression(k))
        end do
    end function solve_many

    !> An expression of unknowns, once they are found.
    function solve_one(system, expression) result(v)
        type(system_type), intent(inout) :: system
        type(value), intent(in) :: expression
        type(value) :: v
        type(linear_form) :: form
        type(record_type), pointer :: record
        integer :: k, at

        record => open_record_of_thread()
        call find_linear_form(system%forms, expression, form)
        v = form%rest
        do k = 1, size(form%unknown)
            at = 0
            if (form%unknown(k) <= size(system%place)) at = system%place(form%unknown(k))
            if (at > 0) then
                v = v + form%coefficient(k)*system%solution(at)
            else
                v = v + form%coefficient(k)*unknown_value(record, form%unknown(k))
            end if
        end do
    end function solve_one
end module linkdyn_system
