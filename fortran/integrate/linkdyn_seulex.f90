!> For stiff systems: Euler's rule, linearly implicit, over one step with 2, 3, 4, 6, 8, 12, ... substeps, extrapolated to none.
!>
!> A substep solves (1 - h J) d = h f(t + h, y) for its way d: one linear system, no iteration, and stiff components die out
!> however long h is. With any matrix J the error goes in powers of h, so J, by differences at the start of the step, need not
!> be exact; it makes the method stable. All columns take their substeps side by side, a lane each with a matrix of its own.
!>
!> **Source**: Deuflhard (1985), Recent progress in extrapolation methods for ordinary differential equations; Hairer, Wanner,
!> Solving Ordinary Differential Equations II, section IV.9.
module linkdyn_seulex
    use linkdyn_extrapolation, only: extrapolation_method
    use linkdyn_gauss_jordan, only: solve_gauss_jordan
    use linkdyn_interrupt, only: is_interrupted
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_lane_system, only: lane_system
    implicit none (type, external)
    private
    public :: seulex_method

    !> Substeps that make few right-hand sides of a high order and magnify rounding little.
    integer, parameter :: all_substeps(13) = [2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64, 96, 128]
    integer, parameter :: most = merge(10, 13, precision(1.0_wp) < 20)

    type, extends(extrapolation_method) :: seulex_method
        real(wp), allocatable, private :: jacobian(:, :)         !! of the rates (n, n)
        real(wp), allocatable, private :: inverse(:, :, :)       !! of the substeps' matrices (lane, n, n)
        real(wp), allocatable, private :: y_there(:)             !! where the Jacobian is from; not allocated: there is none
        real(wp), private :: t_there = 0
        real(wp), allocatable, private :: second_rate(:, :)      !! where each column's second substep begins (n, most)
        real(wp), allocatable, private :: late_slope(:, :)       !! of its last one but one (n, most)
        integer, private :: first = 1                            !! column on the first lane of `inverse`
    contains
        procedure :: start
        procedure :: cross
        procedure :: error_unseen
        procedure :: compares_end
    end type seulex_method

contains

    pure logical function compares_end(self)
        class(seulex_method), intent(in) :: self

        compares_end = .true.
    end function compares_end

    !> A kink of the rates within the first substep or the last one of the longest column is met by no column, or, if it comes by
    !> the clock, by all in that substep alone, which makes an error proportional to it that is extrapolated to none: all agree. But
    !> rates at the columns' second substeps, extrapolated as their ways are, are those at the step's start; and slopes of their
    !> last ones but one, which no kink behind changes, are those at its end. If rates there are others, the way lacks no more than
    !> half of a substep times the difference: less of stiff components, and of what they had to make good at the start the substeps
    !> behind leave little.
    subroutine error_unseen(self, step, start_rate, end_rate, error)
        class(seulex_method), intent(inout) :: self
        real(wp), intent(in) :: step
        real(wp), intent(in) :: start_rate(:), end_rate(:)
        real(wp), intent(out) :: error(:)

        error = missed_by(self, self%second_rate, start_rate, 1 + self%n_substep(1)) + missed_by(self, self%late_slope, end_rate, 1)
        error = abs(step)/(2*self%n_substep(self%row))*error
    end subroutine error_unseen

    !> How far from what it is to come to the extrapolation of a table has ended, beyond ten times the way that its last row has led
    !> it: stiff components converge slowly, and that is in the step's error. Rows behind a kink agree.
    function missed_by(self, table, goal, n_damped) result(missed)
        class(seulex_method), intent(in) :: self
        real(wp), intent(inout) :: table(:, :)            !! (n, most)
        real(wp), intent(in) :: goal(:)                   !! (n)
        integer, intent(in) :: n_damped                   !! substeps that damp it
        real(wp), dimension(size(goal)) :: missed, limit, way
        real(wp), parameter :: explained = 10
        integer :: i

        call self%find_limit(table, limit, way)
        missed = goal - limit
        associate (inverse => self%inverse(max(self%row, self%first) - self%first + 1, :, :))
            do i = 1, n_damped
                missed = matmul(inverse, missed)
                way = matmul(inverse, way)
            end do
        end associate
        missed = max(0.0_wp, abs(missed) - explained*abs(way))
    end function missed_by

    subroutine start(self, n, rtol)
        class(seulex_method), intent(inout) :: self
        integer, intent(in) :: n
        real(wp), intent(in) :: rtol                      !! local error allowed

        if (allocated(self%jacobian)) deallocate (self%jacobian, self%inverse)
        if (allocated(self%y_there)) deallocate (self%y_there)
        allocate (self%jacobian(n, n), self%inverse(lanes, n, n))
        ! About the best order there.
        call self%start_table(n, all_substeps(:most), power=1, k=nint(1.5_wp - 0.6_wp*log10(rtol)))
        if (allocated(self%second_rate)) deallocate (self%second_rate, self%late_slope)
        allocate (self%second_rate(n, self%most), self%late_slope(n, self%most))
    end subroutine start

    !> The rule on all columns.
    subroutine cross(self, system, t, step, y, start_rate, k, again, has_failed)
        class(seulex_method), intent(inout) :: self
        class(lane_system), intent(inout) :: system
        real(wp), intent(in) :: t, step, y(:), start_rate(:)
        integer, intent(in) :: k
        logical, intent(in) :: again
        logical, intent(out) :: has_failed
        real(wp) :: substep(lanes), instant(lanes)
        integer :: n_substep(lanes), column(lanes), first, n_used, m, i, j, l
        logical :: failed(lanes)

        if (.not. again) call need_jacobian(self, system, t, step, y, start_rate)
        has_failed = .false.
        do first = 1, k, lanes
            ! lanes to spare do what the longest column does
            column = [(min(first + l - 1, k), l=1, lanes)]
            n_used = min(lanes, k - first + 1)
            n_substep = self%n_substep(column)
            substep = step/n_substep
            call invert(self, substep, has_failed)
            if (has_failed) return
            self%now = 0
            do m = 1, n_substep(lanes)
                ! A column that has arrived stays.
                instant = merge(t + m*substep, t + step, m < n_substep)
                do i = 1, size(y)
                    self%trial(:, i) = y(i) + self%now(:, i)
                end do
                call system%evaluate_first(n_used, instant, self%trial, self%rate, failed)
                self%n_evaluation = self%n_evaluation + 1
                has_failed = any(failed .and. m <= n_substep) .or. is_interrupted()
                if (has_failed) return
                do i = 1, size(y)
                    self%before(:, i) = 0
                    do j = 1, size(y)
                        self%before(:, i) = self%before(:, i) + self%inverse(:, i, j)*(substep*self%rate(:, j))
                    end do
                end do
                do i = 1, size(y)
                    where (m <= n_substep) self%now(:, i) = self%now(:, i) + self%before(:, i)
                end do
                do l = 1, n_used
                    if (m == 2) self%second_rate(:, column(l)) = self%rate(l, :)
                    if (m == n_substep(l) - 1) self%late_slope(:, column(l)) = self%before(l, :)/substep(l)
                end do
            end do
            do l = 1, n_used
                self%table(:, column(l)) = self%now(l, :)
            end do
            self%first = first
        end do
        has_failed = .not. all(abs(self%table(:, :k)) <= huge(1.0_wp))
    end subroutine cross

    !> The inverse of 1 - h J, with the substep h of each lane.
    subroutine invert(self, substep, is_singular)
        class(seulex_method), intent(inout) :: self
        real(wp), intent(in) :: substep(lanes)
        logical, intent(out) :: is_singular
        real(wp) :: matrix(lanes, size(self%jacobian, 1), size(self%jacobian, 1)), growth(lanes)
        logical :: lane_is_singular(lanes)
        integer :: n, i, j

        n = size(self%jacobian, 1)
        do j = 1, n
            do i = 1, n
                matrix(:, i, j) = -substep*self%jacobian(i, j)
            end do
            matrix(:, j, j) = matrix(:, j, j) + 1
        end do
        self%inverse = 0
        do j = 1, n
            self%inverse(:, j, j) = 1
        end do
        call solve_gauss_jordan(n, n, matrix, self%inverse, growth, lane_is_singular)
        is_singular = any(lane_is_singular)
    end subroutine invert

    !> The Jacobian at the start of the step, by differences, unless it is from there.
    subroutine need_jacobian(self, system, t, step, y, start_rate)
        class(seulex_method), intent(inout) :: self
        class(lane_system), intent(inout) :: system
        real(wp), intent(in) :: t, step, y(:), start_rate(:)
        real(wp), parameter :: third = 1/3.0_wp            ! of the digits: where truncation and rounding balance
        real(wp) :: nudge(size(y)), mode
        integer :: n_jump

        if (allocated(self%y_there)) then
            if (self%t_there == t .and. all(self%y_there == y)) return
        end if
        nudge = epsilon(1.0_wp)**third*max(abs(y), abs(step*start_rate), 1.0e-3_wp)
        mode = system%mode(1)
        n_jump = system%n_jump
        call find_jacobian(self, system, t, y, nudge, start_rate, mode)
        ! what the nudges have met is not on the way of the step
        system%n_jump = n_jump
        call system%watch_jumps(mode, start_rate)
        self%t_there = t
        self%y_there = y
    end subroutine need_jacobian

    !> Central differences: one component is moved on two lanes, ahead and back. Beside a jump of the rates the difference is that
    !> of the side without it.
    subroutine find_jacobian(self, system, t, y, nudge, start_rate, mode)
        class(seulex_method), intent(inout) :: self
        class(lane_system), intent(inout) :: system
        real(wp), intent(in) :: t, y(:), nudge(:)
        real(wp), intent(in) :: start_rate(:), mode       !! rates at y, and their number among jumps
        real(wp) :: instant(lanes)
        integer :: first, last, ahead, back, beyond, i
        logical :: failed(lanes), is_beyond(lanes)

        do first = 1, size(y), lanes/2
            last = min(size(y), first + lanes/2 - 1)
            instant = t
            self%trial = spread(y, 1, lanes)
            do i = first, last
                self%trial(lane_of(i), i) = y(i) + nudge(i)
                self%trial(lane_of(i) + 1, i) = y(i) - nudge(i)
            end do
            call system%evaluate_first(lane_of(last) + 1, instant, self%trial, self%rate, failed)
            self%n_evaluation = self%n_evaluation + 1
            is_beyond = abs(system%mode - mode) > 0
            do i = first, last
                ahead = lane_of(i)
                back = ahead + 1
                if (is_beyond(ahead) .neqv. is_beyond(back)) then
                    beyond = merge(ahead, back, is_beyond(ahead))
                    self%trial(beyond, i) = y(i)
                    self%rate(beyond, :) = start_rate
                    failed(beyond) = .false.
                end if
                self%jacobian(:, i) = (self%rate(ahead, :) - self%rate(back, :))/(self%trial(ahead, i) - self%trial(back, i))
                ! Where there are no rates to either side any matrix will do.
                if (failed(ahead) .or. failed(back) .or. .not. all(abs(self%jacobian(:, i)) <= huge(1.0_wp))) &
                    self%jacobian(:, i) = 0
            end do
        end do

    contains

        !> The first of a component's two lanes.
        pure integer function lane_of(i)
            integer, intent(in) :: i

            lane_of = 2*(i - first) + 1
        end function lane_of
    end subroutine find_jacobian
end module linkdyn_seulex
