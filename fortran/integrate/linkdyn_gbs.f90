!> The method of Gragg, Bulirsch and Stoer: the midpoint rule over one step with 2, 4, ..., 2k substeps, extrapolated to
!> none. Order 2k; k follows the error as the step does.
!>
!> The k columns of the table are independent of each other: each has a lane of its own, so that a step of order 2k takes
!> 2k + 1 right-hand sides in a row, as many as its longest column. One solution then uses the lanes as an ensemble does.
!> Gragg's smoothing ends each column: it looks at the rates where the step ends, so that none ends behind something unseen.
!>
!> The table holds how far y goes, not where to: so rounding is that of the step, not of y.
!>
!> **Source**: Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, section II.9.
module linkdyn_gbs
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_lane_system, only: lane_system
    use linkdyn_one_step, only: one_step_method
    implicit none (type, external)
    private
    public :: gbs_method

    ! More columns gain nothing in double precision: their differences drown in rounding.
    integer, parameter :: most = merge(9, 15, precision(1.0_wp) < 20), fewest = 3

    !> One run.
    type, extends(one_step_method) :: gbs_method
        integer, private :: k = 5                         !! columns of the next step
        integer, private :: k_tried = 5                   !! of the step tried last
        real(wp), private :: reach(most) = huge(1.0_wp)   !! step that each number of columns could take next
        real(wp), allocatable, private :: before(:, :), now(:, :)      !! way of two substeps from the start of the step (lane, n)
        real(wp), allocatable, private :: trial(:, :), rate(:, :)      !! (lane, n)
        real(wp), allocatable, private :: table(:, :)     !! last entries of the rows (n, most)
        real(wp), allocatable, private :: diagonal(:, :)  !! entries of the highest order of each row (n, most)
        real(wp), allocatable, private :: change(:, :)    !! of these from those before (n, most)
        integer, private :: row = 5                       !! of the step tried last, which its way was taken from
    contains
        procedure :: start
        procedure :: try_step => try_gbs
        procedure :: propose => propose_gbs
        procedure :: forget => forget_gbs
    end type gbs_method

contains

    subroutine start(self, n, rtol)
        class(gbs_method), intent(inout) :: self
        integer, intent(in) :: n
        real(wp), intent(in) :: rtol                      !! local error allowed

        if (allocated(self%before)) deallocate (self%before, self%now, self%trial, self%rate, self%table, &
                                                    self%diagonal, self%change)
        allocate (self%before(lanes, n), self%now(lanes, n), self%trial(lanes, n), self%rate(lanes, n), self%table(n, most), &
                  self%diagonal(n, most), self%change(n, most))
        ! One column more for every factor of 100 in the tolerance, about the best order there.
        self%k = min(most, max(fewest, nint(1 - log10(rtol)/2)))
        self%n_evaluation = 0
        call self%forget()
    end subroutine start

    subroutine forget_gbs(self)
        class(gbs_method), intent(inout) :: self

        self%reach = huge(1.0_wp)
    end subroutine forget_gbs

    !> One step by as many columns as are due, or, if it is shorter than they could take, by fewer.
    subroutine try_gbs(self, system, t, step, y, rate, way, error, failed, again)
        class(gbs_method), intent(inout) :: self
        class(lane_system), intent(inout) :: system
        real(wp), intent(in) :: t, step
        real(wp), intent(in) :: y(:), rate(:)
        real(wp), intent(out) :: way(:), error(:)
        logical, intent(out) :: failed
        logical, intent(in) :: again

        if (.not. again) self%k_tried = columns_for(self, abs(step))
        way = 0
        error = 0
        call cross_step(self, system, t, step, y, rate, self%k_tried, failed)
        if (failed) return
        call extrapolate(self, self%k_tried)
        if (.not. again) self%row = best_row(self, max(abs(y), abs(step*rate), abs(self%diagonal(:, self%k_tried))))
        way = self%diagonal(:, self%row)
        error = self%change(:, self%row)
        if (self%row < self%k_tried) error = max(abs(error), abs(self%change(:, self%row + 1)))
    end subroutine try_gbs

    !> The row of the table with the least error: the last one, unless rounding, which rows magnify the more the higher
    !> their order is, has made it worse. A row is as far off as it is from both neighbours.
    pure integer function best_row(self, size_of)
        class(gbs_method), intent(in) :: self
        real(wp), intent(in) :: size_of(:)                !! what each component compares with (n)
        real(wp) :: gap(most), error, least
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
        class(gbs_method), intent(in) :: self
        real(wp), intent(in) :: step

        k = self%k
        if (any(self%reach(fewest:self%k) >= huge(1.0_wp))) return
        do k = fewest, self%k - 1
            if (self%reach(k) >= step) return
        end do
    end function columns_for

    !> The midpoint rule on all columns, side by side.
    subroutine cross_step(self, system, t, step, y, start_rate, k, has_failed)
        class(gbs_method), intent(inout) :: self
        class(lane_system), intent(inout) :: system
        real(wp), intent(in) :: t, step, y(:), start_rate(:)
        integer, intent(in) :: k
        logical, intent(out) :: has_failed
        real(wp) :: substep(lanes), instant(lanes), next(lanes)
        integer :: column(lanes), first, m, i, l
        logical :: failed(lanes)

        has_failed = .false.
        do first = 1, k, lanes
            ! Lanes to spare do what the longest column does.
            column = [(min(first + l - 1, k), l=1, lanes)]
            substep = step/(2*column)
            do i = 1, size(y)
                self%before(:, i) = 0
                self%now(:, i) = substep*start_rate(i)
            end do
            do m = 1, 2*column(lanes)
                ! A column that has arrived stays.
                instant = merge(t + m*substep, t + step, m < 2*column)
                do i = 1, size(y)
                    self%trial(:, i) = y(i) + self%now(:, i)
                end do
                system%n_used = min(lanes, k - first + 1)
                call system%evaluate(instant, self%trial, self%rate, failed)
                system%n_used = lanes
                self%n_evaluation = self%n_evaluation + 1
                has_failed = any(failed .and. m <= 2*column)
                if (has_failed) return
                do i = 1, size(y)
                    next = self%before(:, i) + (2*substep)*self%rate(:, i)
                    where (m < 2*column)
                        self%before(:, i) = self%now(:, i)
                        self%now(:, i) = next
                    elsewhere (m == 2*column)
                        self%now(:, i) = (self%now(:, i) + self%before(:, i) + substep*self%rate(:, i))/2
                    end where
                end do
            end do
            do l = 1, lanes
                self%table(:, column(l)) = self%now(l, :)
            end do
        end do
        has_failed = .not. all(abs(self%table(:, :k)) <= huge(1.0_wp))
    end subroutine cross_step

    !> Aitken and Neville's table in the square of the substep, in place.
    pure subroutine extrapolate(self, k)
        class(gbs_method), intent(inout) :: self
        integer, intent(in) :: k
        integer :: i, j

        self%change = huge(1.0_wp)
        do j = 2, k
            ! Entry i of the row before becomes entry i of this row; table(:, i) holds the row from its end.
            do i = j - 1, 1, -1
                self%change(:, j) = (self%table(:, i + 1) - self%table(:, i))/((real(j, wp)/i)**2 - 1)
                self%table(:, i) = self%table(:, i + 1) + self%change(:, j)
            end do
            self%diagonal(:, j) = self%table(:, 1)
        end do
    end subroutine extrapolate

    !> Step and number of columns that should come cheapest, from the errors of all columns so far.
    subroutine propose_gbs(self, step, allowed, is_accepted, next)
        class(gbs_method), intent(inout) :: self
        real(wp), intent(in) :: step
        real(wp), intent(in) :: allowed(:)
        logical, intent(in) :: is_accepted
        real(wp), intent(out) :: next
        real(wp), parameter :: safety = 0.8_wp, least = 0.1_wp, largest = 4.0_wp, shorter = 0.9_wp
        real(wp) :: cost(most), error
        integer :: j, k

        k = self%k_tried
        cost = huge(1.0_wp)
        do j = fewest, k
            error = maxval(abs(self%change(:, j))/allowed)
            ! The difference of two entries behaves as the entry of the lower order: step**(2j - 1).
            self%reach(j) = safety*step*max(error, tiny(1.0_wp))**(-1/real(2*j - 1, wp))
            cost(j) = (2*j + 2)/self%reach(j)
        end do
        self%k = fewest - 1 + minloc(cost(fewest:k), 1)
        next = self%reach(self%k)
        ! Where the highest order tried came cheapest, the next higher one may be cheaper still.
        if (is_accepted .and. self%k == k .and. k < most) then
            if (k == fewest .or. cost(k) < 0.9_wp*cost(max(fewest, k - 1))) then
                self%k = k + 1
                next = next*(2*k + 4)/real(2*k + 2, wp)
                self%reach(k + 1) = next
            end if
        end if
        next = min(merge(largest, shorter, is_accepted)*step, max(least*step, next))
    end subroutine propose_gbs
end module linkdyn_gbs
