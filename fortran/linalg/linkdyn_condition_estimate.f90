!> Norm of the inverse of a matrix, estimated on lanes from a few solutions with it and its transpose.
!>
!> The estimate is the size of a column of the inverse, so it is never too large; it has hardly ever been seen too small by
!> more than a factor 3, and mostly is exact.
!>
!> **Source**: N. J. Higham, *Accuracy and Stability of Numerical Algorithms*, 2nd ed. (2002), algorithm 15.4; LAPACK's xLACN2.
module linkdyn_condition_estimate
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_linear_record, only: linear_record, solve_recorded
    use linkdyn_slots, only: slot_store, make_slots
    implicit none (type, external)
    private
    public :: estimate_inverse_norm, estimate_space, prepare_estimate

    integer, parameter :: most_columns = 4    !! of the inverse, looked at one after the other

    !> Scratch of one thread.
    type :: estimate_space
        type(slot_store) :: work
        type(slot_store) :: x, direction          !! right-hand side and solution; signs of a column
    contains
        procedure :: free => free_space
    end type estimate_space

contains

    !> Make room for one thread.
    subroutine prepare_estimate(solve, solve_transposed, space)
        type(linear_record), intent(in) :: solve, solve_transposed
        type(estimate_space), intent(out) :: space

        call make_slots(solve%n + max(solve%n_step, solve_transposed%n_step) + 1, space%work)
        call make_slots(solve%n, space%x)
        call make_slots(solve%n, space%direction)
    end subroutine prepare_estimate

    subroutine free_space(self)
        class(estimate_space), intent(inout) :: self

        call self%work%free()
        call self%x%free()
        call self%direction%free()
    end subroutine free_space

    !> 1-norm of diag(left) A^-1 diag(right). Each lane takes as many columns as it needs, whatever its neighbours do.
    subroutine estimate_inverse_norm(solve, solve_transposed, slot, left, right, space, norm)
        type(linear_record), intent(in) :: solve, solve_transposed   !! with A and with its transpose
        real(wp), intent(in) :: slot(lanes, *)                       !! after the elimination
        real(wp), intent(in) :: left(lanes, solve%n), right(lanes, solve%n)
        type(estimate_space), intent(inout) :: space
        real(wp), intent(out) :: norm(lanes)

        call estimate_norm(solve, solve_transposed, slot, left, right, space%work%value, space%x%value, &
                           space%direction%value, norm)
    end subroutine estimate_inverse_norm

    subroutine estimate_norm(solve, solve_transposed, slot, left, right, work, x, direction, norm)
        type(linear_record), intent(in) :: solve, solve_transposed
        real(wp), intent(in) :: slot(lanes, *)
        real(wp), intent(in) :: left(lanes, solve%n), right(lanes, solve%n)
        real(wp), intent(inout) :: work(lanes, *)
        real(wp), intent(inout), dimension(lanes, solve%n) :: x, direction
        real(wp), intent(out) :: norm(lanes)
        real(wp), dimension(lanes) :: found, largest
        integer, dimension(lanes) :: column, before
        logical, dimension(lanes) :: is_active, is_same
        integer :: i, k, n

        n = solve%n
        x = 1/real(n, wp)
        call multiply()
        norm = size_of_x()
        is_active = norm > 0                     ! and not NaN
        direction = sign(1.0_wp, x)
        call find_column()
        do k = 1, most_columns
            x = 0
            do i = 1, lanes
                x(i, column(i)) = 1
            end do
            call multiply()
            found = size_of_x()
            is_same = .true.
            do i = 1, n
                is_same = is_same .and. sign(1.0_wp, x(:, i)) == direction(:, i)
            end do
            where (is_active .and. .not. found > norm) is_active = .false.
            where (is_active) norm = found
            is_active = is_active .and. .not. is_same
            if (k == most_columns .or. .not. any(is_active)) exit
            direction = sign(1.0_wp, x)
            before = column
            call find_column()
            is_active = is_active .and. column /= before
            if (.not. any(is_active)) exit
        end do
        ! A vector of mixed signs and growing entries, for matrices made to fool the above.
        do i = 1, n
            x(:, i) = (1 + real(i - 1, wp)/max(1, n - 1))*merge(1, -1, modulo(i, 2) == 1)
        end do
        call multiply()
        found = 2*size_of_x()/(3*n)
        where (found > norm) norm = found

    contains

        !> x becomes diag(left) A^-1 diag(right) x.
        subroutine multiply()
            x = right*x
            call solve_recorded(solve, slot, work, x)
            x = left*x
        end subroutine multiply

        pure function size_of_x() result(total)
            real(wp) :: total(lanes)
            integer :: m

            total = 0
            do m = 1, n
                total = total + abs(x(:, m))
            end do
        end function size_of_x

        !> The column to which the direction points most.
        subroutine find_column()
            integer :: m

            x = left*direction
            call solve_recorded(solve_transposed, slot, work, x)
            column = 1
            largest = -1
            do m = 1, n
                found = abs(right(:, m)*x(:, m))
                where (found > largest)
                    largest = found
                    column = m
                end where
            end do
        end subroutine find_column
    end subroutine estimate_norm
end module linkdyn_condition_estimate
