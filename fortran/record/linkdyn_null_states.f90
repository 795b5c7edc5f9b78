!> Sparse homogeneous equations that leave some unknowns open: the states that they allow, found while tracing.
!>
!>     A x = 0:    x = N z,    N has a one in each free unknown
!>
!> Which unknowns are free is chosen at representative samples: those are left that the others determine best, so that no entry of
!> N is much larger than one. How N follows from A is then recorded, with pivots that are watched.
!>
!> **Source**: for the choice, P. Businger, G. H. Golub, Numer. Math. 7 (1965) 269, orthogonalization with columns interchanged; the
!> length of what is left of a column is here the least at all samples.
module linkdyn_null_states
    use linkdyn_elimination, only: sparse_row, elimination_type, eliminate
    use linkdyn_kinds, only: wp
    use linkdyn_record, only: record_type, open_record_of_thread
    use linkdyn_system, only: system_type, list_rows
    use linkdyn_value, only: value, constant, zero, number_of, operator(*)
    implicit none (type, external)
    private
    public :: null_states, find_null_states

    real(wp), parameter :: depends = 1.0e-6_wp         !! part of a column's length that is left of one that others determine

    !> Entries of equations that follow from the others, parts of the largest: who has such equations knows them so far.
    real(wp), parameter :: says_nothing = 0.5e-6_wp

    integer, parameter :: enough = 8                   !! samples by which free unknowns are chosen

    type :: null_states
        logical :: is_found = .false.                  !! false: no such pivots at the samples
        logical, allocatable :: is_free(:)             !! (unknown)
        type(value), allocatable :: state(:, :)        !! (unknown, state)
        type(value), allocatable :: watched(:)         !! values whose magnitudes must stay below one
    end type null_states

contains

    !> The states of a system whose right sides are left out. Unknowns that are to be free if they can are solved for last.
    subroutine find_null_states(system, n_state, prefers_free, unit, counts, states)
        type(system_type), intent(inout) :: system
        integer, intent(in) :: n_state
        logical, intent(in) :: prefers_free(:)         !! (unknown)
        real(wp), intent(in) :: unit(:)                !! (unknown) of such size that all are alike
        logical, intent(in) :: counts(:)               !! (sample) there are as many states
        type(null_states), intent(out) :: states
        type(sparse_row) :: row(system%n_equation)
        type(elimination_type) :: elimination
        integer :: i

        call list_rows(system, row)
        do i = 1, size(row)
            row(i)%right = zero()
        end do
        call choose_free(row, system%n_unknown, n_state, prefers_free, unit, counts, states%is_free)
        if (count(states%is_free) /= n_state) return
        call eliminate(row, system%n_unknown, prefers_free, elimination, states%is_free)
        states%is_found = elimination%is_complete .and. system%forms%is_linear
        if (.not. states%is_found) return
        call move_alloc(elimination%state, states%state)
        states%watched = [elimination%watched, constant(1/says_nothing)*elimination%rest]
    end subroutine find_null_states

    !> Which unknowns are left by the others' columns, taken one after the other: the one that is most independent of those before.
    subroutine choose_free(row, n_unknown, n_state, prefers_free, unit, counts, is_free)
        type(sparse_row), intent(in) :: row(:)
        integer, intent(in) :: n_unknown, n_state
        logical, intent(in) :: prefers_free(:)         !! (unknown)
        real(wp), intent(in) :: unit(:)                !! (unknown)
        logical, intent(in) :: counts(:)               !! (sample)
        logical, allocatable, intent(out) :: is_free(:)    !! as many as states, or there is no such choice
        type(record_type), pointer :: record
        real(wp), allocatable :: column(:, :, :)       ! (row, unknown, sample)
        integer, allocatable :: sample(:)
        integer :: n, i, k, s, best

        record => open_record_of_thread()
        sample = pack([(s, s=1, record%n_sample)], counts)
        n = min(enough, size(sample))
        sample = sample([(1 + (size(sample) - 1)*(s - 1)/max(1, n - 1), s=1, n)])
        allocate (column(size(row), n_unknown, size(sample)), source=0.0_wp)
        do i = 1, size(row)
            do k = 1, row(i)%n
                associate (u => row(i)%column(k))
                    column(i, u, :) = number_at(row(i)%entry(k))*unit(u)
                end associate
            end do
        end do
        do s = 1, size(sample)
            do i = 1, n_unknown
                column(:, i, s) = column(:, i, s)/max(norm2(column(:, i, s)), tiny(1.0_wp))
            end do
        end do
        allocate (is_free(n_unknown), source=.true.)
        if (size(sample) == 0) is_free = .false.
        if (size(sample) == 0) return
        do n = 1, n_unknown - n_state
            do
                best = longest(is_free .and. .not. prefers_free)
                if (best == 0) best = longest(is_free)
                if (best > 0) exit
                call give_up_a_sample(best)
                if (best == 0) return
            end do
            is_free(best) = .false.
            do s = 1, size(sample)
                call take_away(column(:, :, s), best)
            end do
        end do

    contains

        function number_at(v) result(x)
            type(value), intent(in) :: v
            real(wp) :: x(size(sample)), all(record%n_sample)

            all = number_of(v)
            x = all(sample)
        end function number_at

        !> Longest of the columns asked for: the one of which most is left where least is; 0: nothing is left of any.
        integer function longest(is_meant)
            logical, intent(in) :: is_meant(:)         !! (unknown)
            real(wp) :: length, most
            integer :: u, p

            longest = 0
            most = depends
            do u = 1, n_unknown
                if (.not. is_meant(u)) cycle
                length = huge(1.0_wp)
                do p = 1, size(sample)
                    length = min(length, norm2(column(:, u, p)))
                end do
                if (length <= most) cycle
                most = length
                longest = u
            end do
        end function longest

        !> One at which there are more states than elsewhere, a singular position. Half may go.
        subroutine give_up_a_sample(given_up)
            integer, intent(out) :: given_up           !! 0: none
            real(wp) :: most(size(sample))
            integer :: u, p

            given_up = 0
            if (2*(size(sample) - 1) < min(enough, count(counts))) return
            most = 0
            do p = 1, size(sample)
                do u = 1, n_unknown
                    if (is_free(u)) most(p) = max(most(p), norm2(column(:, u, p)))
                end do
            end do
            given_up = minloc(most, dim=1)
            column = column(:, :, pack([(p, p=1, size(sample))], [(p /= given_up, p=1, size(sample))]))
            sample = pack(sample, [(p /= given_up, p=1, size(sample))])
        end subroutine give_up_a_sample

        !> What is left of the free columns beside another.
        subroutine take_away(a, taken)
            real(wp), intent(inout) :: a(:, :)         !! (row, unknown)
            integer, intent(in) :: taken
            real(wp) :: along(size(a, 1))
            integer :: u

            along = a(:, taken)/norm2(a(:, taken))
            do u = 1, n_unknown
                if (is_free(u)) a(:, u) = a(:, u) - dot_product(along, a(:, u))*along
            end do
        end subroutine take_away
    end subroutine choose_free
end module linkdyn_null_states
