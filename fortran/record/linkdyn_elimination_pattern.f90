!> Where a matrix may have entries other than zero while it is eliminated with partial pivoting, whichever rows are chosen for
!> pivots: of the rows among which there is a choice each may come to have what any of them has.
!>
!> **Source**: A. George, E. Ng, SIAM J. Sci. Stat. Comput. 8 (1987) 877.
module linkdyn_elimination_pattern
    use linkdyn_kinds, only: wp
    implicit none (type, external)
    private
    public :: elimination_pattern, find_pattern

    type :: elimination_pattern
        integer :: n = 0                                      !! unknowns
        integer :: n_slot = 0                                 !! at most n^2
        integer, allocatable :: slot(:, :)                    !! of an entry; 0: it is always zero (column, row)
        ! ---- of each column
        integer, allocatable :: pivot(:)                      !! the row into which its pivot comes
        integer, allocatable :: first_below(:), below(:)      !! other rows among which there may be the pivot, one behind the other
        integer, allocatable :: first_ahead(:), ahead(:)      !! columns behind it in which the pivot's row may have entries
        real(wp) :: sense = 1                                 !! of rows in this order: sign of the permutation
    end type elimination_pattern

contains

    !> From the places of the entries.
    pure subroutine find_pattern(n, row, column, pattern)
        integer, intent(in) :: n
        integer, intent(in) :: row(:), column(:)              !! (entry)
        type(elimination_pattern), intent(out) :: pattern
        logical :: has(n, n), is_left(n), chosen(n), behind(n)    ! (row, column), (row), (row), (column)
        integer :: i, j, k

        has = .false.
        do i = 1, size(row)
            has(row(i), column(i)) = .true.
        end do
        allocate (pattern%pivot(n), pattern%first_below(n + 1), pattern%first_ahead(n + 1), source=1)
        allocate (pattern%below(0), pattern%ahead(0))
        is_left = .true.
        do k = 1, n
            ! of a matrix that is always singular any row will do
            if (.not. any(is_left .and. has(:, k))) has(findloc(is_left, .true., dim=1), k) = .true.
            chosen = is_left .and. has(:, k)
            behind = any(has .and. spread(chosen, 2, n), dim=1) .and. [(j > k, j=1, n)]
            do j = k + 1, n
                if (behind(j)) has(:, j) = has(:, j) .or. chosen
            end do
            pattern%pivot(k) = findloc(chosen, .true., dim=1)
            is_left(pattern%pivot(k)) = .false.
            pattern%below = [pattern%below, pack([(i, i=1, n)], chosen .and. is_left)]
            pattern%ahead = [pattern%ahead, pack([(j, j=1, n)], behind)]
            pattern%first_below(k + 1) = size(pattern%below) + 1
            pattern%first_ahead(k + 1) = size(pattern%ahead) + 1
        end do
        pattern%n = n
        allocate (pattern%slot(n, n), source=0)
        do i = 1, n
            do j = 1, n
                if (.not. has(i, j)) cycle
                pattern%n_slot = pattern%n_slot + 1
                pattern%slot(j, i) = pattern%n_slot
            end do
        end do
        pattern%sense = sign_of(pattern%pivot)
    end subroutine find_pattern

    !> Sign of a permutation: each pair that stands the wrong way round turns it.
    pure real(wp) function sign_of(order)
        integer, intent(in) :: order(:)
        integer :: i

        sign_of = 1
        do i = 1, size(order)
            if (modulo(count(order(:i - 1) > order(i)), 2) == 1) sign_of = -sign_of
        end do
    end function sign_of
end module linkdyn_elimination_pattern
