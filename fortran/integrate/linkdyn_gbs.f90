!> The method of Gragg, Bulirsch and Stoer: the midpoint rule over one step with 2, 4, ..., 2k substeps, extrapolated to
!> none. Order 2k, of 2k + 1 right-hand sides in a row.
!>
!> Gragg's smoothing ends each column: it looks at the rates where the step ends, so that none ends behind something unseen.
!>
!> The midpoint rule has a second solution, which swings from substep to substep: even ones go one way, odd ones another. Where
!> rates turn over within one substep, as friction does where a block comes to rest, it grows, and smoothing takes the mean: the
!> same for every number of substeps, hence without any estimated error, and not the solution. So the swing that smoothing takes
!> off is extrapolated as well: with no substeps nothing may be left of it.
!>
!> **Source**: Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, section II.9; the swing: theorem 9.2 there.
module linkdyn_gbs
    use linkdyn_extrapolation, only: extrapolation_method
    use linkdyn_interrupt, only: is_interrupted
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_lane_system, only: lane_system
    implicit none (type, external)
    private
    public :: gbs_method

    ! More columns gain nothing: their differences drown in rounding.
    integer, parameter :: most = merge(9, 15, precision(1.0_wp) < 20)

    type, extends(extrapolation_method) :: gbs_method
        real(wp), allocatable, private :: swing(:, :)     !! of each column at its end (n, most)
    contains
        procedure :: start
        procedure :: cross
        procedure :: error_unseen
    end type gbs_method

contains

    subroutine start(self, n, rtol)
        class(gbs_method), intent(inout) :: self
        integer, intent(in) :: n
        real(wp), intent(in) :: rtol                      !! local error allowed
        integer :: j

        ! One column more for every factor of 100 in the tolerance, about the best order there.
        call self%start_table(n, n_substep=[(2*j, j=1, most)], power=2, k=nint(1 - log10(rtol)/2))
        if (allocated(self%swing)) deallocate (self%swing)
        allocate (self%swing(n, self%most))
    end subroutine start

    !> What is left of the swing. Where there is nothing but the solution it shrinks row by row, but may be far behind the way's own
    !> errors: so it counts only if the last row has taken little off it, and if it is larger than such errors explain.
    subroutine error_unseen(self, step, start_rate, end_rate, error)
        class(gbs_method), intent(inout) :: self
        real(wp), intent(in) :: step
        real(wp), intent(in) :: start_rate(:), end_rate(:)
        real(wp), intent(out) :: error(:)
        real(wp), dimension(size(error)) :: left, taken_off
        real(wp), parameter :: behind = 100, shrinking = 0.2_wp

        call self%find_limit(self%swing, left, taken_off)
        error = merge(abs(left)/behind, 0.0_wp, abs(left) > shrinking*abs(taken_off))
    end subroutine error_unseen

    !> The midpoint rule on all columns, the longest one first: those under way are always the first lanes.
    subroutine cross(self, system, t, step, y, start_rate, k, again, has_failed)
        class(gbs_method), intent(inout) :: self
        class(lane_system), intent(inout) :: system
        real(wp), intent(in) :: t, step, y(:), start_rate(:)
        integer, intent(in) :: k
        logical, intent(in) :: again
        logical, intent(out) :: has_failed
        real(wp) :: substep(lanes), instant(lanes)
        integer :: column(lanes), longest, n_used, m, i, l
        logical :: failed(lanes)

        has_failed = .false.
        do longest = k, 1, -lanes
            column = [(max(1, longest - l), l=0, lanes - 1)]
            substep = step/(2*column)
            do i = 1, size(y)
                self%before(:, i) = 0
                self%now(:, i) = substep*start_rate(i)
            end do
            n_used = min(lanes, longest)
            do m = 1, 2*longest
                if (2*column(n_used) < m) n_used = n_used - 1
                instant = t + m*substep
                if (2*column(n_used) == m) instant(n_used) = t + step
                do i = 1, size(y)
                    self%trial(:, i) = y(i) + self%now(:, i)
                end do
                call system%evaluate_first(n_used, instant, self%trial, self%rate, failed)
                self%n_evaluation = self%n_evaluation + 1
                has_failed = any(failed) .or. is_interrupted()
                if (has_failed) return
                if (2*column(n_used) == m) call end_column(self, n_used, column(n_used), substep(n_used))
                do i = 1, size(y)
                    self%trial(:, i) = self%before(:, i) + (2*substep)*self%rate(:, i)
                    self%before(:, i) = self%now(:, i)
                    self%now(:, i) = self%trial(:, i)
                end do
            end do
        end do
        has_failed = .not. all(abs(self%table(:, :k)) <= huge(1.0_wp))
    end subroutine cross

    !> A column has arrived: Gragg's smoothing, and the swing that it takes off.
    pure subroutine end_column(self, lane, column, substep)
        class(gbs_method), intent(inout) :: self
        integer, intent(in) :: lane, column
        real(wp), intent(in) :: substep

        self%table(:, column) = (self%now(lane, :) + self%before(lane, :) + substep*self%rate(lane, :))/2
        self%swing(:, column) = self%now(lane, :) - self%table(:, column)
    end subroutine end_column
end module linkdyn_gbs
