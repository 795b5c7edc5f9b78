!> Extrapolation: a simple rule crosses one step with few substeps, with more, with more yet, and its results are extrapolated
!> to none. Each further column raises the order; how many there are follows the error as the step does.
!>
!> The columns of the table are independent of each other: each has a lane of its own, so that a step takes as many right-hand
!> sides in a row as its longest column. One solution then uses the lanes as an ensemble does.
!>
!> The table holds how far y goes, not where to: so rounding is that of the step, not of y.
!>
!> **Source**: Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, section II.9; Hairer, Wanner, II, section IV.9.
module linkdyn_extrapolation
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_lane_system, only: lane_system
    use linkdyn_one_step, only: one_step_method
    implicit none (type, external)
    private
    public :: extrapolation_method

    integer, parameter :: fewest = 3                      !! columns: with fewer nothing tells errors from rounding

    !> One run.
    type, abstract, extends(one_step_method) :: extrapolation_method
        integer :: most = fewest                          !! columns: more gain nothing, their differences drown in rounding
        integer :: power = 1                              !! of the substep in which the rule's error goes
        integer, allocatable :: n_substep(:)              !! of each column (most)
        real(wp), allocatable :: before(:, :), now(:, :)  !! scratch of the rule: ways from the start of the step (lane, n)
        real(wp), allocatable :: trial(:, :), rate(:, :)  !! (lane, n)
        real(wp), allocatable :: table(:, :)              !! the columns' results, then last entries of the rows (n, most)
        integer, private :: k = 5                         !! columns of the next step
        integer, private :: k_tried = 5                   !! of the step tried last
        real(wp), allocatable, private :: reach(:)        !! step that each number of columns could take next (most)
        real(wp), allocatable, private :: diagonal(:, :)  !! entries of the highest order of each row (n, most)
        real(wp), allocatable, private :: change(:, :)    !! of these from those before (n, most)
        integer :: row = 5                                !! of the step tried last, which its way was taken from
    contains
        procedure(cross_step), deferred :: cross
        procedure :: start_table
        procedure :: find_limit
        procedure :: try_step
        procedure :: propose
        procedure :: forget
    end type extrapolation_method

    abstract interface
        !> The rule on k columns, side by side: `table` gets how far each of them goes.
        subroutine cross_step(self, system, t, step, y, start_rate, k, again, has_failed)
            import :: extrapolation_method, lane_system, wp
            class(extrapolation_method), intent(inout) :: self
            class(lane_system), intent(inout) :: system
            real(wp), intent(in) :: t, step, y(:), start_rate(:)
            integer, intent(in) :: k
            logical, intent(in) :: again                  !! by the same formula as the last step tried
            logical, intent(out) :: has_failed
        end subroutine cross_step
    end interface

contains

    !> Make room, and begin with about the best order for the tolerance.
    subroutine start_table(self, n, n_substep, power, k)
        class(extrapolation_method), intent(inout) :: self
        integer, intent(in) :: n
        integer, intent(in) :: n_substep(:)               !! of each column, growing
        integer, intent(in) :: power
        integer, intent(in) :: k                          !! columns to begin with

        if (allocated(self%before)) deallocate (self%before, self%now, self%trial, self%rate, self%table, &
                                                    self%diagonal, self%change, self%reach)
        self%n_substep = n_substep
        self%most = size(n_substep)
        self%power = power
        associate (most => self%most)
            allocate (self%before(lanes, n), self%now(lanes, n), self%trial(lanes, n), self%rate(lanes, n), self%table(n, most), &
                      self%diagonal(n, most), self%change(n, most), self%reach(most))
            self%k = min(most, max(fewest, k))
        end associate
        self%n_evaluation = 0
        call self%forget()
    end subroutine start_table

    subroutine forget(self)
        class(extrapolation_method), intent(inout) :: self

        self%reach = huge(1.0_wp)
    end subroutine forget

    !> One step by as many columns as are due, or, if it is shorter than they could take, by fewer.
    subroutine try_step(self, system, t, step, y, rate, way, error, failed, again)
        class(extrapolation_method), intent(inout) :: self
        class(lane_system), intent(inout) :: system
        real(wp), intent(in) :: t, step
        real(wp), intent(in) :: y(:), rate(:)
        real(wp), intent(out) :: way(:), error(:)
        logical, intent(out) :: failed
        logical, intent(in) :: again

        if (.not. again) self%k_tried = columns_for(self, abs(step))
        way = 0
        error = 0
        call self%cross(system, t, step, y, rate, self%k_tried, again, failed)
        if (failed) return
        call extrapolate(self, self%k_tried)
        if (.not. again) self%row = best_row(self, max(abs(y), abs(step*rate), abs(self%diagonal(:, self%k_tried))))
        way = self%diagonal(:, self%row)
        error = self%change(:, self%row)
        if (self%row < self%k_tried) error = max(abs(error), abs(self%change(:, self%row + 1)))
    end subroutine try_step

    !> The row of the table with the least error: the last one, unless rounding, which rows magnify the more the higher
    !> their order is, has made it worse. A row is as far off as it is from both neighbours.
    pure integer function best_row(self, size_of)
        class(extrapolation_method), intent(in) :: self
        real(wp), intent(in) :: size_of(:)                !! what each component compares with (n)
        real(wp) :: gap(self%most), error, least
        integer :: j

        do j = fewest, self%k_tried
            gap(j) = maxval(abs(self%change(:, j))/max(size_of, tiny(1.0_wp)))
        end do
        best_row = self%k_tried
        least = gap(self%k_tried)
        do j = self%k_tried - 1, fewest, -1
            error = max(gap(j), gap(j + 1))
            if (.not. error < least) cycle
            least = error
            best_row = j
        end do
    end function best_row

    !> Fewest columns that reach the end of a step.
    pure integer function columns_for(self, step) result(k)
        class(extrapolation_method), intent(in) :: self
        real(wp), intent(in) :: step

        k = self%k
        if (any(self%reach(fewest:self%k) >= huge(1.0_wp))) return
        do k = fewest, self%k - 1
            if (self%reach(k) >= step) return
        end do
    end function columns_for

    !> Aitken and Neville's table in a power of the substep, in place.
    pure subroutine extrapolate(self, k)
        class(extrapolation_method), intent(inout) :: self
        integer, intent(in) :: k
        integer :: j

        self%change = huge(1.0_wp)
        do j = 2, k
            call add_row(self, j, self%table, self%change(:, j))
            self%diagonal(:, j) = self%table(:, 1)
        end do
    end subroutine extrapolate

    !> The row of a table that begins with column j. Entry i of the row before becomes entry i of this one; `table(:, i)` holds the
    !> row from its end.
    pure subroutine add_row(self, j, table, change)
        class(extrapolation_method), intent(in) :: self
        integer, intent(in) :: j
        real(wp), intent(inout) :: table(:, :)            !! (n, j at least)
        real(wp), intent(out) :: change(:)                !! that made the entry of the highest order (n)
        integer :: i

        do i = j - 1, 1, -1
            associate (ratio => real(self%n_substep(j), wp)/self%n_substep(i))
                change = (table(:, i + 1) - table(:, i))/(ratio**self%power - 1)
            end associate
            table(:, i) = table(:, i + 1) + change
        end do
    end subroutine add_row

    !> What else the columns have found in a step leads to with no substeps, up to the row that its way was taken from, and how far
    !> its last row has led it.
    pure subroutine find_limit(self, table, limit, change)
        class(extrapolation_method), intent(in) :: self
        real(wp), intent(inout) :: table(:, :)            !! of each column, then last entries of the rows (n, most)
        real(wp), intent(out) :: limit(:), change(:)      !! (n)
        real(wp) :: before(size(limit)), last(size(limit))
        integer :: j

        do j = 2, self%row
            before = table(:, 1)
            call add_row(self, j, table, last)
        end do
        limit = table(:, 1)
        change = limit - before
    end subroutine find_limit

    !> Step and number of columns that should come cheapest, from the errors of all columns so far.
    subroutine propose(self, step, allowed, is_accepted, next)
        class(extrapolation_method), intent(inout) :: self
        real(wp), intent(in) :: step
        real(wp), intent(in) :: allowed(:)
        logical, intent(in) :: is_accepted
        real(wp), intent(out) :: next
        real(wp), parameter :: safety = 0.8_wp, least = 0.1_wp, largest = 4.0_wp, shorter = 0.9_wp
        real(wp) :: cost(self%most), error
        integer :: j, k

        k = self%k_tried
        cost = huge(1.0_wp)
        do j = fewest, k
            error = maxval(abs(self%change(:, j))/allowed)
            ! The difference of two entries behaves as the entry of the lower order.
            self%reach(j) = safety*step*max(error, tiny(1.0_wp))**(-1/real(self%power*(j - 1) + 1, wp))
            cost(j) = work_of(self, j)/self%reach(j)
        end do
        self%k = fewest - 1 + minloc(cost(fewest:k), 1)
        next = self%reach(self%k)
        ! Where the highest order tried came cheapest, the next higher one may be cheaper still.
        if (is_accepted .and. self%k == k .and. k < self%most) then
            if (k == fewest .or. cost(k) < 0.9_wp*cost(max(fewest, k - 1))) then
                self%k = k + 1
                next = next*work_of(self, k + 1)/real(work_of(self, k), wp)
                self%reach(k + 1) = next
            end if
        end if
        next = min(merge(largest, shorter, is_accepted)*step, max(least*step, next))
    end subroutine propose

    !> Right-hand sides of a step with so many columns: those of the longest, and where it begins and ends.
    pure integer function work_of(self, k) result(work)
        class(extrapolation_method), intent(in) :: self
        integer, intent(in) :: k

        work = self%n_substep(k) + 2
    end function work_of
end module linkdyn_extrapolation
