!> Norm of the inverse of a matrix, estimated on lanes from a few solutions with it and its transpose.
!>
!> The estimate is the size of a column of the inverse, so it is never too large; it has hardly ever been seen too small by
!> more than a factor 3, and mostly is exact.
!>
!> **Source**: N. J. Higham, *Accuracy and Stability of Numerical Algorithms*, 2nd ed. (2002), algorithm 15.4; LAPACK's xLACN2.
module linkdyn_condition_estimate
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_lane_sizes, only: find_sizes
    implicit none (type, external)
    private
    public :: linear_solver, estimate_inverse_norm

    integer, parameter :: most_columns = 4    !! of the inverse, looked at one after the other

    !> Whoever can solve with a matrix and its transpose.
    type, abstract :: linear_solver
    contains
        procedure(solve_interface), deferred :: solve
    end type linear_solver

    abstract interface
        subroutine solve_interface(self, is_transposed, x)
            import :: linear_solver, wp
            class(linear_solver), intent(inout) :: self
            logical, intent(in) :: is_transposed
            real(wp), intent(inout) :: x(:, :)     !! right-hand side, then solution (lane, n)
        end subroutine solve_interface
    end interface

contains

    !> 1-norm of diag(left) A^-1 diag(right). Each lane takes as many columns as it needs, whatever its neighbours do.
    subroutine estimate_inverse_norm(n, solver, left, right, norm)
        integer, intent(in) :: n
        class(linear_solver), intent(inout) :: solver                !! with A
        real(wp), intent(in) :: left(lanes, n), right(lanes, n)
        real(wp), intent(out) :: norm(lanes)
        real(wp), allocatable, dimension(:, :) :: x, direction       ! right-hand side and solution; signs of a column
        real(wp), dimension(lanes) :: found, largest
        integer, dimension(lanes) :: column, before
        logical, dimension(lanes) :: is_active, is_same
        integer :: i, k

        allocate (x(lanes, n), direction(lanes, n))
        x = 1/real(n, wp)
        call multiply()
        call find_sizes(n, x, norm)
        is_active = norm > 0                     ! and not NaN
        direction = sign(1.0_wp, x)
        call find_column()
        do k = 1, most_columns
            x = 0
            do i = 1, lanes
                x(i, column(i)) = 1
            end do
            call multiply()
            call find_sizes(n, x, found)
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
        call find_sizes(n, x, found)
        found = 2*found/(3*n)
        where (found > norm) norm = found

    contains

        !> x becomes diag(left) A^-1 diag(right) x.
        subroutine multiply()
            x = right*x
            call solver%solve(.false., x)
            x = left*x
        end subroutine multiply

        !> The column to which the direction points most.
        subroutine find_column()
            integer :: m

            x = left*direction
            call solver%solve(.true., x)
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
    end subroutine estimate_inverse_norm
end module linkdyn_condition_estimate
