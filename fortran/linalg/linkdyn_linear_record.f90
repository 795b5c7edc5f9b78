!> Solving with the pivots and multipliers that an elimination has left, and solving transposed.
!>
!> How a right-hand side becomes the unknowns is a list of steps
!>     out = (base - sum of coefficient*value + sum of coefficient*value) * scale
!> each linear in the values before it. The list solves A x = b; the list of the same steps turned round, the last first,
!> A^T x = b: whatever the elimination does to rows (orders, scales, turns) needs no thought of its own.
!>
!> **Source**: the transpose of a straight-line program, as in A. Griewank, A. Walther, *Evaluating Derivatives*, 2nd ed.
!> (2008), ch. 3.
module linkdyn_linear_record
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    implicit none (type, external)
    private
    public :: linear_record, solve_recorded, transposed

    !> The steps. Values are numbered: right-hand sides 1..n, then the result of each step; value n + n_step + 1 is zero.
    type :: linear_record
        integer :: n = 0                            !! unknowns
        integer :: n_step = 0
        integer :: one = 0                          !! slot of the constant 1
        integer, allocatable :: base(:)             !! value (n_step)
        integer, allocatable :: scale(:)            !! slot of a final factor; 0: none
        integer, allocatable :: last_minus(:)       !! end of the terms subtracted
        integer, allocatable :: last_plus(:)        !! end of the terms added; the next step's start after it
        integer, allocatable :: coefficient(:)      !! slots of the terms
        integer, allocatable :: value(:)            !! of the terms
        integer, allocatable :: solution(:)         !! value of each unknown (n)
        real(wp), allocatable :: sign(:)            !! the unknown is sign*value (n)
    end type linear_record

contains

    !> x of A x = b on lanes.
    !>
    !> **Cost**: 2 flops a term.
    pure subroutine solve_recorded(record, slot, work, x)
        type(linear_record), intent(in) :: record
        real(wp), intent(in) :: slot(lanes, *)                          !! after the elimination
        real(wp), intent(inout) :: work(lanes, *)                         !! room for n + n_step + 1 values
        real(wp), intent(inout) :: x(lanes, record%n)                   !! in: b; out: x
        real(wp) :: sum(lanes)
        integer :: t, k, term

        work(:, :record%n) = x
        work(:, record%n + record%n_step + 1) = 0
        term = 0
        do t = 1, record%n_step
            sum = work(:, record%base(t))
            do k = term + 1, record%last_minus(t)
                sum = sum - slot(:, record%coefficient(k))*work(:, record%value(k))
            end do
            do k = record%last_minus(t) + 1, record%last_plus(t)
                sum = sum + slot(:, record%coefficient(k))*work(:, record%value(k))
            end do
            if (record%scale(t) > 0) sum = sum*slot(:, record%scale(t))
            work(:, record%n + t) = sum
            term = record%last_plus(t)
        end do
        do k = 1, record%n
            x(:, k) = record%sign(k)*work(:, record%solution(k))
        end do
    end subroutine solve_recorded

    !> The record that solves A^T x = b with the same pivots and multipliers.
    !>
    !> Turned round, a step hands what its result is worth to its values: so each value collects from all steps that use it,
    !> the last one first, and a right-hand side of A^T is what an unknown is worth.
    function transposed(record) result(other)
        type(linear_record), intent(in) :: record
        type(linear_record) :: other
        integer, allocatable :: owner(:), coefficient(:), value(:), factor(:)    ! of what is collected
        integer :: first, t, k, v, s, n_value

        n_value = record%n + record%n_step
        allocate (owner(0))
        allocate (coefficient(0), value(0), factor(0))
        do k = 1, record%n
            call collect(record%solution(k), record%one, k, nint(record%sign(k)))
        end do
        do t = record%n_step, 1, -1
            v = number(record%n + t)
            if (record%base(t) <= n_value) call collect(record%base(t), record%one, v, 1)
            first = 1
            if (t > 1) first = record%last_plus(t - 1) + 1
            do k = first, record%last_plus(t)
                call collect(record%value(k), record%coefficient(k), v, merge(-1, 1, k <= record%last_minus(t)))
            end do
        end do

        other%n = record%n
        other%n_step = n_value
        other%one = record%one
        allocate (other%base(n_value), other%scale(n_value), other%last_minus(n_value), other%last_plus(n_value))
        allocate (other%coefficient(0), other%value(0))
        other%base = record%n + n_value + 1
        other%scale = 0
        do s = 1, n_value
            v = n_value + 1 - s
            if (v > record%n) other%scale(s) = record%scale(v - record%n)
            k = findloc(owner == v .and. coefficient == record%one .and. factor > 0, .true., dim=1)
            if (k > 0) then
                other%base(s) = value(k)
                owner(k) = 0
            end if
            other%coefficient = [other%coefficient, pack(coefficient, owner == v .and. factor < 0)]
            other%value = [other%value, pack(value, owner == v .and. factor < 0)]
            other%last_minus(s) = size(other%value)
            other%coefficient = [other%coefficient, pack(coefficient, owner == v .and. factor > 0)]
            other%value = [other%value, pack(value, owner == v .and. factor > 0)]
            other%last_plus(s) = size(other%value)
        end do
        other%solution = [(number(k), k=1, record%n)]
        other%sign = [(1.0_wp, k=1, record%n)]

    contains

        !> What value v of the record is worth, as a value of the other.
        pure integer function number(v)
            integer, intent(in) :: v

            number = record%n + n_value + 1 - v
        end function number

        subroutine collect(v, by, from, sign_here)
            integer, intent(in) :: v, by, from, sign_here

            owner = [owner, v]
            coefficient = [coefficient, by]
            value = [value, from]
            factor = [factor, sign_here]
        end subroutine collect
    end function transposed
end module linkdyn_linear_record
