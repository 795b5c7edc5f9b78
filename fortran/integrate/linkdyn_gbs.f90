!> The method of Gragg, Bulirsch and Stoer: the midpoint rule over one step with 2, 4, ..., 2k substeps, extrapolated to
!> none. Order 2k; step and k follow the error.
!>
!> The k columns of the table are independent of each other: each has a lane of its own, so that a step of order 2k takes
!> 2k + 1 right-hand sides in a row, as many as its longest column. One solution then uses the lanes as an ensemble does.
!>
!> The table holds how far y goes, not where to: so rounding is that of the step, not of y. What it takes from y is added at
!> the next step.
!>
!> **Source**: Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, section II.9.
module linkdyn_gbs
    use linkdyn_exact_sum, only: add_exactly
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_lane_system, only: lane_system
    implicit none (type, external)
    private
    public :: gbs_method

    ! More columns gain nothing in double precision: their differences drown in rounding.
    integer, parameter :: most = merge(9, 15, precision(1.0_wp) < 20), fewest = 3

    !> One run.
    type :: gbs_method
        integer :: n_evaluation = 0                       !! right-hand sides (blocks)
        integer :: n_rejected = 0
        real(wp), private :: rtol = 0, atol = 0
        integer, private :: k = 5                         !! columns of the next step
        logical, private :: knows_rate = .false.          !! at the point reached
        real(wp), private :: reach(most) = huge(1.0_wp)   !! step that each number of columns could take next
        real(wp), allocatable, private :: before(:, :), now(:, :)      !! way of two substeps from the start of the step (lane, n)
        real(wp), allocatable, private :: trial(:, :), rate(:, :), start_rate(:, :)    !! (lane, n)
        real(wp), allocatable, private :: table(:, :)     !! last entries of the rows (n, most)
        real(wp), allocatable, private :: rest(:)         !! to be added to y, less than its last place (n)
    contains
        procedure :: start, take_step, reset
    end type gbs_method

contains

    subroutine start(self, n, rtol, atol)
        class(gbs_method), intent(inout) :: self
        integer, intent(in) :: n
        real(wp), intent(in) :: rtol, atol                !! local error allowed

        if (allocated(self%before)) &
            deallocate (self%before, self%now, self%trial, self%rate, self%start_rate, self%table, self%rest)
        allocate (self%before(lanes, n), self%now(lanes, n), self%trial(lanes, n), self%rate(lanes, n), &
                  self%start_rate(lanes, n), self%table(n, most), self%rest(n))
        self%rtol = rtol
        self%atol = atol
        ! One column more for every factor of 100 in the tolerance, about the best order there.
        self%k = min(most, max(fewest, nint(1 - log10(rtol)/2)))
        self%n_evaluation = 0
        self%n_rejected = 0
        call self%reset()
    end subroutine start

    !> The right-hand side has a kink here, or y was changed: what was learnt does not hold beyond.
    subroutine reset(self)
        class(gbs_method), intent(inout) :: self

        self%reach = huge(1.0_wp)
        self%knows_rate = .false.
        self%rest = 0
    end subroutine reset

    !> One accepted step towards t_end, never beyond.
    subroutine take_step(self, system, t, t_end, h, y, ok)
        class(gbs_method), intent(inout) :: self
        class(lane_system), intent(inout) :: system
        real(wp), intent(inout) :: t
        real(wp), intent(in) :: t_end
        real(wp), intent(inout) :: h                      !! in: to try; out: proposed for the next step
        real(wp), intent(inout) :: y(:)
        logical, intent(out) :: ok                        !! false: no step can be taken; t and y are as before
        real(wp), parameter :: cut_after_failure = 0.25_wp
        real(wp) :: step, t_next, error(most), way(size(y)), next(size(y)), rest(size(y)), kept(size(y))
        logical :: is_last, has_failed
        integer :: k, i

        ok = .false.
        has_failed = .false.
        if (.not. self%knows_rate) call evaluate_alone(self, system, t, y, has_failed)
        if (has_failed) return
        k = self%k
        step = h
        do
            is_last = step >= t_end - t
            if (is_last) then
                step = t_end - t
                k = columns_for(self, step, k)
            end if
            if (t + step == t .or. .not. step > 0) return
            t_next = t + step
            if (is_last) t_next = t_end
            call cross_step(self, system, t, step, y, k, has_failed)
            if (.not. has_failed) then
                call extrapolate(self, y, k, error, way)
                if (error(k) <= 1) then
                    next = y
                    rest = 0
                    call add_exactly(way + self%rest, next, rest)
                    ! The step ends where rates can be had: the next one starts with them.
                    kept = self%start_rate(1, :)
                    call evaluate_alone(self, system, t_next, next, has_failed)
                    if (.not. has_failed) exit
                    do i = 1, size(y)
                        self%start_rate(:, i) = kept(i)
                    end do
                else
                    call propose(self, step, error, k, h)
                    step = min(h, 0.9_wp*step)
                    k = min(k, self%k)
                end if
            end if
            if (has_failed) step = cut_after_failure*step
            self%n_rejected = self%n_rejected + 1
        end do
        t = t_next
        y = next
        self%rest = rest
        call propose(self, step, error, k, h)
        ok = .true.
    end subroutine take_step

    !> Rates at the start of a step, the same on all lanes.
    subroutine evaluate_alone(self, system, t, y, has_failed)
        class(gbs_method), intent(inout) :: self
        class(lane_system), intent(inout) :: system
        real(wp), intent(in) :: t, y(:)
        logical, intent(out) :: has_failed
        real(wp) :: instant(lanes)
        logical :: failed(lanes)
        integer :: i

        instant = t
        do i = 1, size(y)
            self%trial(:, i) = y(i)
        end do
        call system%evaluate(instant, self%trial, self%start_rate, failed)
        self%n_evaluation = self%n_evaluation + 1
        has_failed = failed(1)
        self%knows_rate = .not. has_failed
    end subroutine evaluate_alone

    !> Fewest columns that reach the end of a step cut short.
    pure integer function columns_for(self, step, k_now) result(k)
        class(gbs_method), intent(in) :: self
        real(wp), intent(in) :: step
        integer, intent(in) :: k_now

        if (any(self%reach(fewest:k_now) >= huge(1.0_wp))) then
            k = k_now
        else
            do k = fewest, k_now - 1
                if (self%reach(k) >= step) return
            end do
        end if
    end function columns_for

    !> The midpoint rule on all columns, side by side.
    subroutine cross_step(self, system, t, step, y, k, has_failed)
        class(gbs_method), intent(inout) :: self
        class(lane_system), intent(inout) :: system
        real(wp), intent(in) :: t, step, y(:)
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
                self%now(:, i) = substep*self%start_rate(:, i)
            end do
            do m = 1, 2*column(lanes) - 1
                ! A column that has arrived stays.
                instant = merge(t + m*substep, t + step, m < 2*column)
                do i = 1, size(y)
                    self%trial(:, i) = y(i) + self%now(:, i)
                end do
                call system%evaluate(instant, self%trial, self%rate, failed)
                self%n_evaluation = self%n_evaluation + 1
                has_failed = any(failed .and. m < 2*column)
                if (has_failed) return
                do i = 1, size(y)
                    next = self%before(:, i) + (2*substep)*self%rate(:, i)
                    where (m < 2*column)
                        self%before(:, i) = self%now(:, i)
                        self%now(:, i) = next
                    end where
                end do
            end do
            do l = 1, lanes
                self%table(:, column(l)) = self%now(l, :)
            end do
        end do
        has_failed = .not. all(abs(self%table(:, :k)) <= huge(1.0_wp))
    end subroutine cross_step

    !> Aitken and Neville's table in the square of the substep, in place; the error of each diagonal entry, 1 being allowed.
    pure subroutine extrapolate(self, y, k, error, way)
        class(gbs_method), intent(inout) :: self
        real(wp), intent(in) :: y(:)
        integer, intent(in) :: k
        real(wp), intent(out) :: error(most), way(:)
        real(wp) :: change(size(y))
        integer :: i, j

        error = huge(1.0_wp)
        do j = 1, k
            ! Entry i of the row before becomes entry i of this row; table(:, i) holds the row from its end.
            do i = j - 1, 1, -1
                change = (self%table(:, i + 1) - self%table(:, i))/((real(j, wp)/i)**2 - 1)
                self%table(:, i) = self%table(:, i + 1) + change
            end do
            if (j > 1) error(j) = maxval(abs(change)/(self%atol + self%rtol*max(abs(y), abs(y + self%table(:, 1)))))
        end do
        way = self%table(:, 1)
    end subroutine extrapolate

    !> Step and number of columns that should come cheapest, from the errors of all columns so far.
    pure subroutine propose(self, step, error, k, next)
        class(gbs_method), intent(inout) :: self
        real(wp), intent(in) :: step, error(most)
        integer, intent(in) :: k                          !! columns tried
        real(wp), intent(out) :: next
        real(wp), parameter :: safety = 0.8_wp, least = 0.1_wp, largest = 4.0_wp
        real(wp) :: cost(most)
        integer :: j

        cost = huge(1.0_wp)
        do j = fewest, k
            ! The difference of two entries behaves as the entry of the lower order: step**(2j - 1).
            self%reach(j) = safety*step*max(error(j), tiny(1.0_wp))**(-1/real(2*j - 1, wp))
            cost(j) = (2*j + 1)/self%reach(j)
        end do
        self%k = fewest - 1 + minloc(cost(fewest:k), 1)
        next = self%reach(self%k)
        ! Where the highest order tried came cheapest, the next higher one may be cheaper still.
        if (self%k == k .and. k < most) then
            if (k == fewest .or. cost(k) < 0.9_wp*cost(max(fewest, k - 1))) then
                self%k = k + 1
                next = next*(2*k + 3)/real(2*k + 1, wp)
                self%reach(k + 1) = next
            end if
        end if
        next = min(largest*step, max(least*step, next))
    end subroutine propose
end module linkdyn_gbs
