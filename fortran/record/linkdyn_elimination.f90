!> Elimination while tracing: sparse linear equations with values for entries are solved once, symbolically.
!>
!> Pivots are chosen by the operations that they cost (Markowitz' rule, with constants and ones for free) among those whose
!> numbers are large enough at every representative sample and of one sign, so that they do not vanish in between, either.
!> Where no column has such a pivot, as with a crank that turns all the way round, two rows are turned into each other. Each
!> pivot that varies is watched: the system's `alarm` grows beyond one where a pivot has become so small that rounding may
!> have grown with it.
!>
!> Columns may stay free, of rows that do not determine them: what the others then are for a one in each, and nothing on the
!> right, are the states that the rows allow.
module linkdyn_elimination
    use linkdyn_folding, only: product_in_any_order
    use linkdyn_kinds, only: wp
    use linkdyn_record, only: record_type, open_record_of_thread, number_of, numbers_at
    use linkdyn_value, only: value, zero, one, is_zero, is_one, is_constant, reciprocal, constant, &
        operator(+), operator(-), operator(*), square
    implicit none (type, external)
    private
    public :: sparse_row, elimination_type, eliminate, alarm_of_watched

    real(wp), parameter :: pivot_threshold = 0.05_wp   !! of the largest number that the pivot must eliminate
    real(wp), parameter :: no_pivot = 1.0e-11_wp       !! of the largest number of its row: nothing but rounding
    real(wp), parameter :: largest_growth = 64         !! of a reciprocal pivot beyond the representative samples, before an alarm
    integer, parameter :: cost_of_reciprocal = 8       !! in multiplications
    integer, parameter :: largest_count = 400          !! entries that a pivot's exact cost is counted for
    integer, parameter :: unacceptable = huge(1)

    !> One equation: sum of entry * unknown = right.
    type :: sparse_row
        integer :: n = 0
        integer, allocatable :: column(:)
        type(value), allocatable :: entry(:)
        type(value) :: right
    end type sparse_row

    !> What came of it.
    type :: elimination_type
        type(value), allocatable :: solution(:)        !! (column)
        type(value), allocatable :: state(:, :)        !! (column, free column)
        type(value), allocatable :: rest(:)            !! what rows say of free columns alone, by their largest entry: zero, if they
                                                       !! follow from the others
        type(value), allocatable :: watched(:)         !! values whose magnitudes must stay below one
        type(value) :: determinant                     !! its sign is that of the matrix', or the opposite at every sample
        logical :: is_complete = .false.               !! false: no pivots were found; there is no solution
        integer :: n_turned = 0                        !! pairs of rows turned into each other
    end type elimination_type

    type :: index_list
        integer :: n = 0
        integer, allocatable :: item(:)
    end type index_list

    !> A row that has served as pivot row: unknown = (right - rest of the row) * inverse
    type :: pivot_step
        integer :: column = 0
        type(sparse_row) :: row
        type(value) :: inverse
        logical :: is_scaled = .false.                 !! the row was divided by the pivot already
    end type pivot_step

    type :: candidate
        integer :: cost = unacceptable
        real(wp) :: quality = 0                        !! smallest over largest number of the pivot
        integer :: row = 0
        logical :: has_both_signs = .false.            !! it vanishes somewhere between the samples
    end type candidate

    type :: work_type
        type(record_type), pointer :: record
        type(sparse_row), allocatable :: row(:)
        type(index_list), allocatable :: column(:)     !! rows in which a column stands
        real(wp), allocatable :: scale(:)              !! (row) one over its largest number
        integer, allocatable :: turned_for(:)          !! (row) the column in which its entry is a sum of squares; 0: none
        logical, allocatable :: is_active(:)           !! (sample) is it looked at?
        logical, allocatable :: is_open(:)             !! (column) not solved for yet
        logical, allocatable :: is_next(:)             !! (column) open, and none stands before it: a pivot is looked for here
        type(candidate), allocatable :: best(:)        !! (column)
        logical, allocatable :: is_stale(:)            !! (column) the best must be looked for again
        type(index_list) :: stale                      !! columns, those among them that are stale and next
        integer :: n_leaf = 1                          !! of the contest: a power of two, as many as columns at least
        integer, allocatable :: winner(:)              !! contests between columns for the next pivot: `winner(1)` has won, that of
                                                       !! two follows from places 2k and 2k + 1, leaves are the columns; 0: none
        integer :: n_sample = 0
    end type work_type

contains

    !> Sum of the squares of what is watched, each once: velocities, accelerations and forces are often found by the same pivots.
    function alarm_of_watched(watched) result(alarm)
        type(value), intent(in) :: watched(:)
        type(value) :: alarm
        integer :: i

        alarm = zero()
        do i = 1, size(watched)
            if (all(watched(:i - 1)%node /= watched(i)%node)) alarm = alarm + square(watched(i))
        end do
    end function alarm_of_watched

    !> Solve for all columns, or for all that are not free.
    subroutine eliminate(row, n_column, is_last, elimination, is_free)
        type(sparse_row), intent(inout) :: row(:)      !! as many as columns to be solved for, or more that follow; used up
        integer, intent(in) :: n_column
        logical, intent(in) :: is_last(:)              !! (column) to be solved for after the others
        type(elimination_type), intent(out) :: elimination
        logical, intent(in), optional :: is_free(:)    !! (column) for these there are states, no solution; absent: none
        type(work_type) :: work
        type(pivot_step), allocatable :: step(:)
        type(candidate) :: pivot
        integer :: n_step, n_turned, u, i
        logical :: found, is_used(size(row)), has_order

        call begin(row, n_column, work)
        if (present(is_free)) work%is_open = .not. is_free
        allocate (step(count(work%is_open)), elimination%watched(0))
        elimination%determinant = one()
        is_used = .false.
        has_order = .false.
        do n_step = 1, size(step)
            if (.not. has_order) call let_come_next(work, work%is_open .and. .not. is_last)
            has_order = .true.
            n_turned = 0
            do
                call choose_pivot(work, u, pivot)
                if (u > 0 .and. .not. pivot%has_both_signs) exit
                found = .false.
                ! What no pair of rows makes better, two far too different in size, would be turned for ever.
                if (n_turned < n_column) call turn_rows(work, found)
                if (found) then
                    n_turned = n_turned + 1
                    elimination%n_turned = elimination%n_turned + 1
                else if (u > 0) then
                    exit
                else if (any(work%is_open .and. .not. work%is_next)) then
                    call let_come_next(work, (work%is_open))   ! what was to come last costs operations now, but no sample
                    has_order = .false.
                else
                    call give_up_a_sample(work, found)
                    if (.not. found) return
                end if
            end do
            elimination%determinant = elimination%determinant*entry_of(work%row(pivot%row), u)
            call apply_pivot(work, u, pivot%row, step(n_step), elimination%watched)
            is_used(pivot%row) = .true.
            if (work%winner(1) == 0 .and. work%stale%n == 0) has_order = .false.   ! all that were next are solved for
        end do
        if (present(is_free)) then
            call find_states(step, is_free, elimination%state)
            allocate (elimination%rest(0))
            do i = 1, size(work%row)
                if (is_used(i)) cycle
                elimination%rest = [elimination%rest, constant(work%scale(i))*work%row(i)%entry(:work%row(i)%n)]
            end do
        else
            call substitute_back(step, n_column, elimination%solution)
        end if
        elimination%is_complete = .true.
    end subroutine eliminate

    !> Rows and columns that know of each other. Samples at which a number is none have no say in choices.
    subroutine begin(row, n_column, work)
        type(sparse_row), intent(inout) :: row(:)
        integer, intent(in) :: n_column
        type(work_type), intent(inout) :: work
        integer :: i, k

        work%record => open_record_of_thread()
        work%n_sample = work%record%n_sample
        allocate (work%row(size(row)), work%column(n_column), work%scale(size(row)), work%is_open(n_column), &
                  work%turned_for(size(row)), work%best(n_column), work%is_stale(n_column), work%is_active(work%n_sample), &
                  work%is_next(n_column), work%stale%item(n_column))
        do while (work%n_leaf < n_column)
            work%n_leaf = 2*work%n_leaf
        end do
        allocate (work%winner(2*work%n_leaf - 1))
        work%turned_for = 0
        work%is_open = .true.
        work%is_next = .false.
        work%is_stale = .true.
        work%is_active = .true.
        do i = 1, size(row)
            work%row(i) = row(i)
            do k = 1, row(i)%n
                call append(work%column(row(i)%column(k)), i)
                where (.not. size_of(work, row(i)%entry(k)) <= huge(1.0_wp)) work%is_active = .false.
            end do
        end do
        do i = 1, size(row)
            call find_scale(work, i)
        end do
    end subroutine begin

    !> One over the largest number that stands in a row.
    subroutine find_scale(work, i)
        type(work_type), intent(inout) :: work
        integer, intent(in) :: i
        real(wp) :: largest
        integer :: k

        largest = 0
        do k = 1, work%row(i)%n
            largest = max(largest, maxval(size_of(work, work%row(i)%entry(k)), mask=work%is_active))
        end do
        work%scale(i) = 1
        if (largest > 0) work%scale(i) = 1/largest
    end subroutine find_scale

    !> Magnitudes at the representative samples.
    function size_of(work, v) result(x)
        type(work_type), intent(in) :: work
        type(value), intent(in) :: v
        real(wp) :: x(work%n_sample)

        x = abs(numbers_at(work%record, v%node))
    end function size_of

    ! ---------------------------------------------------------------- choosing

    !> Look for pivots in some of the columns; in all that are open, if these are none.
    subroutine let_come_next(work, is_next)
        type(work_type), intent(inout) :: work
        logical, intent(in) :: is_next(:)              !! (column)
        integer :: u, k

        work%is_next = is_next
        if (.not. any(is_next)) work%is_next = work%is_open
        work%stale%n = 0
        work%winner = 0
        do u = 1, size(work%column)
            if (.not. work%is_next(u)) cycle
            if (work%is_stale(u)) then
                call append(work%stale, u)
            else
                work%winner(work%n_leaf - 1 + u) = entrant(work, u)
            end if
        end do
        do k = work%n_leaf - 1, 1, -1
            work%winner(k) = better_of(work, work%winner(2*k), work%winner(2*k + 1))
        end do
    end subroutine let_come_next

    !> The best pivot of a column must be looked for again.
    subroutine note_stale(work, u)
        type(work_type), intent(inout) :: work
        integer, intent(in) :: u

        if (work%is_stale(u)) return
        work%is_stale(u) = .true.
        if (work%is_next(u)) call append(work%stale, u)
    end subroutine note_stale

    !> The column and its row that cost least, of those whose pivots keep their sign, if there are any.
    subroutine choose_pivot(work, chosen, pivot)
        type(work_type), intent(inout) :: work
        integer, intent(out) :: chosen                 !! 0: no column has an acceptable pivot
        type(candidate), intent(out) :: pivot
        integer :: k, u

        do k = 1, work%stale%n
            u = work%stale%item(k)
            if (work%is_next(u)) call find_best(work, u)
            work%is_stale(u) = .false.
            call compete(work, u)
        end do
        work%stale%n = 0
        chosen = work%winner(1)
        if (chosen > 0) pivot = work%best(chosen)
    end subroutine choose_pivot

    !> Who wins now that a column has another best pivot, or is solved for.
    subroutine compete(work, u)
        type(work_type), intent(inout) :: work
        integer, intent(in) :: u
        integer :: place

        place = work%n_leaf - 1 + u
        work%winner(place) = entrant(work, u)
        do while (place > 1)
            place = place/2
            work%winner(place) = better_of(work, work%winner(2*place), work%winner(2*place + 1))
        end do
    end subroutine compete

    !> The column, if it has a pivot to offer.
    pure integer function entrant(work, u)
        type(work_type), intent(in) :: work
        integer, intent(in) :: u

        entrant = 0
        if (work%is_next(u) .and. work%best(u)%cost /= unacceptable) entrant = u
    end function entrant

    !> The first of two columns, unless the second one's pivot is better.
    pure integer function better_of(work, u, v)
        type(work_type), intent(in) :: work
        integer, intent(in) :: u, v                    !! 0: none

        better_of = max(u, v)
        if (min(u, v) == 0) return
        better_of = u
        if (is_better(work%best(v), work%best(u))) better_of = v
    end function better_of

    pure logical function is_better(a, b)
        type(candidate), intent(in) :: a, b

        if (a%has_both_signs .neqv. b%has_both_signs) then
            is_better = b%has_both_signs
        else if (a%cost /= b%cost) then
            is_better = a%cost < b%cost
        else if (a%quality /= b%quality) then
            is_better = a%quality > b%quality
        else
            is_better = a%row < b%row
        end if
    end function is_better

    subroutine find_best(work, u)
        type(work_type), intent(inout) :: work
        integer, intent(in) :: u
        type(candidate) :: c
        real(wp) :: size_in(work%n_sample, work%column(u)%n)   ! of the column's entries, by their rows' largest
        real(wp) :: largest(work%n_sample)
        integer :: k, i

        do k = 1, work%column(u)%n
            i = work%column(u)%item(k)
            size_in(:, k) = size_of(work, entry_of(work%row(i), u))*work%scale(i)
        end do
        largest = maxval(size_in, dim=2)
        work%best(u) = candidate()
        do k = 1, work%column(u)%n
            call judge(work, work%column(u)%item(k), u, size_in(:, k), largest, c)
            if (c%cost == unacceptable) cycle
            if (work%best(u)%cost == unacceptable .or. is_better(c, work%best(u))) work%best(u) = c
        end do
    end subroutine find_best

    !> What a pivot costs, in operations, and how even its numbers are.
    subroutine judge(work, i, u, m, largest, c)
        type(work_type), intent(in) :: work
        integer, intent(in) :: i, u
        real(wp), intent(in), dimension(work%n_sample) :: m, largest   !! size of the pivot, largest one in its column
        type(candidate), intent(out) :: c
        type(value) :: pivot, e
        integer :: k, t, n_target, n_other, cost
        logical :: is_unit

        if (any(m < no_pivot .and. work%is_active)) return
        if (any(m < pivot_threshold*largest .and. work%is_active)) return

        pivot = entry_of(work%row(i), u)
        n_target = work%column(u)%n - 1
        n_other = work%row(i)%n - 1
        is_unit = is_one(pivot)
        cost = 2*n_other
        if (.not. is_unit) then
            if (.not. is_constant(pivot) .and. work%record%inverse(pivot%node) == 0) cost = cost + cost_of_reciprocal
            cost = cost + max(1, min(n_target, n_other + merge(0, 1, is_zero(work%row(i)%right))))
        end if
        if (n_target*n_other > largest_count) then
            cost = cost + 2*n_target*n_other
        else
            do k = 1, work%column(u)%n
                t = work%column(u)%item(k)
                if (t == i) cycle
                e = entry_of(work%row(t), u)
                cost = cost + cost_of_target(work%row(i), work%row(t), u, is_constant(e) .and. is_constant(pivot), &
                                             is_one(e) .and. is_unit)
            end do
        end if
        c%cost = cost
        c%quality = minval(m, mask=work%is_active)/max(tiny(1.0_wp), maxval(m, mask=work%is_active))
        c%row = i
        associate (number => number_of(pivot))
            c%has_both_signs = any(number > 0 .and. work%is_active) .and. any(number < 0 .and. work%is_active)
        end associate
    end subroutine judge

    !> Operations to take one row out of another.
    integer function cost_of_target(pivot_row, target, u, is_constant_multiplier, is_unit_multiplier) result(cost)
        type(sparse_row), intent(in) :: pivot_row, target
        integer, intent(in) :: u
        logical, intent(in) :: is_constant_multiplier, is_unit_multiplier
        integer :: k

        cost = merge(0, 2, is_zero(pivot_row%right))
        do k = 1, pivot_row%n
            if (pivot_row%column(k) == u) cycle
            if (is_constant_multiplier .and. is_constant(pivot_row%entry(k))) cycle
            if (any(target%column(:target%n) == pivot_row%column(k))) cost = cost + 1
            if (.not. (is_unit_multiplier .or. is_one(pivot_row%entry(k)))) cost = cost + 1
        end do
    end function cost_of_target

    !> None of the next columns has a pivot that is large enough everywhere, and in between: two rows into each other. With a and
    !> b in a column, a row1 + b row2 has a a + b b there, and a row2 - b row1 nothing.
    subroutine turn_rows(work, found)
        type(work_type), intent(inout) :: work
        logical, intent(out) :: found
        real(wp), dimension(work%n_sample) :: m, others, s
        real(wp) :: quality, best_quality
        integer :: u, x, y, k, i, j, best(3), length, best_length

        found = .false.
        best_length = huge(1)
        best_quality = 0
        best = 0
        do u = 1, size(work%column)
            if (.not. work%is_next(u)) cycle
            associate (c => work%column(u))
                do x = 1, c%n
                    do y = x + 1, c%n
                        i = c%item(x)
                        j = c%item(y)
                        m = sqrt((size_of(work, entry_of(work%row(i), u))*work%scale(i))**2 &
                                 + (size_of(work, entry_of(work%row(j), u))*work%scale(j))**2)
                        others = 0
                        do k = 1, c%n
                            if (k == x .or. k == y) cycle
                            s = size_of(work, entry_of(work%row(c%item(k)), u))*work%scale(c%item(k))
                            others = max(others, s)
                        end do
                        if (any(m < no_pivot .and. work%is_active)) cycle
                        if (any(m < pivot_threshold*others .and. work%is_active)) cycle
                        quality = minval(m, mask=work%is_active)/maxval(m, mask=work%is_active)
                        if (quality < pivot_threshold) cycle
                        length = n_together(work%row(i), work%row(j))
                        if (length > best_length .or. (length == best_length .and. quality <= best_quality)) cycle
                        best_length = length
                        best_quality = quality
                        best = [i, j, u]
                    end do
                end do
            end associate
        end do
        found = best(3) > 0
        if (found) call turn_pair(work, best(1), best(2), best(3))
    end subroutine turn_rows

    !> Columns that two rows have together.
    pure integer function n_together(a, b)
        type(sparse_row), intent(in) :: a, b
        integer :: k

        n_together = a%n
        do k = 1, b%n
            if (all(a%column(:a%n) /= b%column(k))) n_together = n_together + 1
        end do
    end function n_together

    !> Two equations with an unknown whose entries may vanish in turn, never both: turned against each other, so that one has the
    !> root of the sum of their squares, and the other none.
    subroutine turn_pair(work, i, j, u)
        type(work_type), intent(inout) :: work
        integer, intent(in) :: i, j, u
        type(sparse_row) :: first, second, with, without
        type(value) :: a, b
        integer :: k

        first = scaled_row(work%row(i), constant(work%scale(i)))
        second = scaled_row(work%row(j), constant(work%scale(j)))
        a = entry_of(first, u)
        b = entry_of(second, u)
        with = scaled_row(first, a)
        call add_row(with, second, b)
        call drop_entry(first, u)
        call drop_entry(second, u)
        without = scaled_row(second, a)
        call add_row(without, first, -b)
        call replace(i, with)
        call replace(j, without)
        work%turned_for([i, j]) = [u, 0]

    contains

        subroutine replace(i, new)
            integer, intent(in) :: i
            type(sparse_row), intent(in) :: new

            do k = 1, work%row(i)%n
                call remove(work%column(work%row(i)%column(k)), i)
                call note_stale(work, work%row(i)%column(k))
            end do
            work%row(i) = new
            do k = 1, new%n
                call append(work%column(new%column(k)), i)
                call note_stale(work, new%column(k))
            end do
            call find_scale(work, i)
            if (work%scale(i) > 1/no_pivot) work%scale(i) = 1     ! of scaled rows nothing is left but rounding
        end subroutine replace
    end subroutine turn_pair

    !> A sample at which nothing serves as pivot is given up: such poses will raise the alarm. Half may go.
    subroutine give_up_a_sample(work, found)
        type(work_type), intent(inout) :: work
        logical, intent(out) :: found
        real(wp) :: m(work%n_sample), best(work%n_sample)
        integer :: u, k, i

        found = 2*(count(work%is_active) - 1) >= work%n_sample
        if (.not. found) return
        best = 0
        do u = 1, size(work%column)
            if (.not. work%is_next(u)) cycle
            m = 0
            do k = 1, work%column(u)%n
                i = work%column(u)%item(k)
                m = max(m, size_of(work, entry_of(work%row(i), u))*work%scale(i))
            end do
            where (m > 0) best = best + log(m)
            where (.not. m > 0) best = best - 100
        end do
        work%is_active(minloc(best, dim=1, mask=work%is_active)) = .false.
        work%is_stale = .true.
        call let_come_next(work, (work%is_next))
    end subroutine give_up_a_sample

    ! ---------------------------------------------------------------- doing

    !> Take an unknown out of all other equations. A pivot that varies is watched: by how much may its inverse grow?
    subroutine apply_pivot(work, u, i, step, watched)
        type(work_type), intent(inout) :: work
        integer, intent(in) :: u, i
        type(pivot_step), intent(out) :: step
        type(value), allocatable, intent(inout) :: watched(:)
        type(value) :: pivot, inverse, l
        real(wp) :: growth
        integer :: k, t, n_target
        integer, allocatable :: targets(:)

        pivot = entry_of(work%row(i), u)
        inverse = reciprocal(pivot)
        growth = largest_growth
        if (work%turned_for(i) == u) growth = growth**2    ! a sum of squares, in a row that shrinks with their root
        if (.not. is_constant(pivot)) watched = [watched, inverse*constant( &
            1/(growth*maxval(size_of(work, inverse), mask=work%is_active)))]
        call drop_entry(work%row(i), u)
        n_target = work%column(u)%n - 1
        step%column = u
        step%inverse = inverse
        step%is_scaled = is_one(pivot) .or. n_target > work%row(i)%n + merge(0, 1, is_zero(work%row(i)%right))
        if (step%is_scaled) work%row(i) = scaled_row(work%row(i), inverse)
        targets = pack(work%column(u)%item(:work%column(u)%n), work%column(u)%item(:work%column(u)%n) /= i)
        do k = 1, size(targets)
            t = targets(k)
            l = entry_of(work%row(t), u)
            if (.not. step%is_scaled) l = l*inverse
            call drop_entry(work%row(t), u)
            call take_out(work, t, work%row(i), l)
        end do
        do k = 1, work%row(i)%n
            call remove(work%column(work%row(i)%column(k)), i)
            call note_stale(work, work%row(i)%column(k))
        end do
        work%is_open(u) = .false.
        work%is_next(u) = .false.
        call compete(work, u)
        step%row = work%row(i)
    end subroutine apply_pivot

    !> row t - l * pivot row
    subroutine take_out(work, t, pivot_row, l)
        type(work_type), intent(inout) :: work
        integer, intent(in) :: t
        type(sparse_row), intent(in) :: pivot_row
        type(value), intent(in) :: l
        type(value) :: new
        integer :: k, at

        do k = 1, pivot_row%n
            at = place_in(work%row(t), pivot_row%column(k))
            if (at == 0) then
                call put_entry(work%row(t), pivot_row%column(k), -product_in_any_order(l, pivot_row%entry(k)))
                call append(work%column(pivot_row%column(k)), t)
            else
                new = work%row(t)%entry(at) - product_in_any_order(l, pivot_row%entry(k))
                work%row(t)%entry(at) = new
                if (is_zero(new)) then
                    call drop_entry(work%row(t), pivot_row%column(k))
                    call remove(work%column(pivot_row%column(k)), t)
                end if
            end if
        end do
        work%row(t)%right = work%row(t)%right - l*pivot_row%right
        work%turned_for(t) = 0
        do k = 1, work%row(t)%n
            call note_stale(work, work%row(t)%column(k))
        end do
    end subroutine take_out

    subroutine substitute_back(step, n_column, solution)
        type(pivot_step), intent(in) :: step(:)
        integer, intent(in) :: n_column
        type(value), allocatable, intent(out) :: solution(:)
        type(value) :: x
        integer :: s, k

        allocate (solution(n_column))
        do s = size(step), 1, -1
            x = step(s)%row%right
            do k = 1, step(s)%row%n
                x = x - step(s)%row%entry(k)*solution(step(s)%row%column(k))
            end do
            if (.not. step(s)%is_scaled) x = x*step(s)%inverse
            solution(step(s)%column) = x
        end do
    end subroutine substitute_back

    !> A one in each free column by itself, and what follows of the others.
    subroutine find_states(step, is_free, state)
        type(pivot_step), intent(in) :: step(:)
        logical, intent(in) :: is_free(:)              !! (column)
        type(value), allocatable, intent(out) :: state(:, :)    !! (column, free column)
        type(value) :: x
        integer :: f, u, s, k

        allocate (state(size(is_free), count(is_free)), source=zero())
        f = 0
        do u = 1, size(is_free)
            if (.not. is_free(u)) cycle
            f = f + 1
            state(u, f) = one()
            do s = size(step), 1, -1
                x = zero()
                do k = 1, step(s)%row%n
                    x = x - step(s)%row%entry(k)*state(step(s)%row%column(k), f)
                end do
                if (.not. step(s)%is_scaled) x = x*step(s)%inverse
                state(step(s)%column, f) = x
            end do
        end do
    end subroutine find_states

    ! ---------------------------------------------------------------- rows and lists

    pure integer function place_in(row, column)
        type(sparse_row), intent(in) :: row
        integer, intent(in) :: column

        do place_in = row%n, 1, -1
            if (row%column(place_in) == column) return
        end do
    end function place_in

    pure function entry_of(row, column) result(e)
        type(sparse_row), intent(in) :: row
        integer, intent(in) :: column              !! one that stands in the row
        type(value) :: e

        e = row%entry(place_in(row, column))
    end function entry_of

    pure subroutine put_entry(row, column, entry)
        type(sparse_row), intent(inout) :: row
        integer, intent(in) :: column
        type(value), intent(in) :: entry

        if (row%n == size(row%column)) then
            row%column = [row%column, row%column, 0]
            row%entry = [row%entry, row%entry, entry]
        end if
        row%n = row%n + 1
        row%column(row%n) = column
        row%entry(row%n) = entry
    end subroutine put_entry

    pure subroutine drop_entry(row, column)
        type(sparse_row), intent(inout) :: row
        integer, intent(in) :: column
        integer :: at

        at = place_in(row, column)
        row%column(at) = row%column(row%n)
        row%entry(at) = row%entry(row%n)
        row%n = row%n - 1
    end subroutine drop_entry

    function scaled_row(row, factor) result(r)
        type(sparse_row), intent(in) :: row
        type(value), intent(in) :: factor
        type(sparse_row) :: r

        r%n = row%n
        r%column = row%column(:row%n)
        r%entry = factor*row%entry(:row%n)
        r%right = factor*row%right
    end function scaled_row

    !> row + factor * other
    subroutine add_row(row, other, factor)
        type(sparse_row), intent(inout) :: row
        type(sparse_row), intent(in) :: other
        type(value), intent(in) :: factor
        type(value) :: new
        integer :: k, at

        do k = 1, other%n
            at = place_in(row, other%column(k))
            if (at == 0) then
                call put_entry(row, other%column(k), factor*other%entry(k))
            else
                new = row%entry(at) + factor*other%entry(k)
                row%entry(at) = new
                if (is_zero(new)) call drop_entry(row, other%column(k))
            end if
        end do
        row%right = row%right + factor*other%right
    end subroutine add_row

    pure subroutine append(list, item)
        type(index_list), intent(inout) :: list
        integer, intent(in) :: item

        if (.not. allocated(list%item)) allocate (list%item(4))
        if (list%n == size(list%item)) list%item = [list%item, list%item]
        list%n = list%n + 1
        list%item(list%n) = item
    end subroutine append

    pure subroutine remove(list, item)
        type(index_list), intent(inout) :: list
        integer, intent(in) :: item
        integer :: at

        at = findloc(list%item(:list%n), item, dim=1)
        if (at == 0) return
        list%item(at) = list%item(list%n)
        list%n = list%n - 1
    end subroutine remove
end module linkdyn_elimination
