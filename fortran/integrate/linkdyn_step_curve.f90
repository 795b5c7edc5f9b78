!> The solution within a step that was taken, as a polynomial, so that instants of output need no steps of their own.
!>
!> Its rates are those of the system at Chebyshev's places of the step. They are found by iteration: rates where the last
!> polynomial leads, their integral, and again. It begins with the cubic that meets solution and rates at both ends, and always
!> ends where the step has ended. All places of an iteration lie side by side on lanes, so that it takes as long as one
!> or two right-hand sides. It leaves a part of the error that is proportional to the step, which the method has made so short
!> that some ten iterations do.
!>
!> The polynomial is believed if the iterations have come to rest, if what its integral lacks to the end of the step is about the
!> error allowed there or less, and if its last terms are a small part of that. A kink of the rates within the step, or a step
!> longer than such a polynomial can follow, is seen by this; the caller then has to find another way.
!>
!> **Source**: Picard's iteration at Chebyshev's places: Clenshaw, Norton, The solution of nonlinear ordinary differential
!> equations in Chebyshev series, Computer Journal 6 (1963).
module linkdyn_step_curve
    use linkdyn_constants, only: pi
    use linkdyn_interrupt, only: is_interrupted
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_lane_system, only: lane_system
    implicit none (type, external)
    private
    public :: step_curve

    !> Pieces between places: more of them if fewer do not follow the longest steps that the methods of this precision take. The
    !> places within fill blocks of 16 lanes but for two.
    integer, parameter :: n_piece(2) = merge([15, 31], [31, 63], precision(1.0_wp) < 20)
    integer, parameter :: most_iterations = 24
    !> Of the error allowed: so much may stay open. Steps are better than they must be, and the curve is to be no worse.
    real(wp), parameter :: settled = 1.0e-3_wp
    real(wp), parameter :: rounding = 8*epsilon(1.0_wp)   !! of rates and their sums, relative
    !> What the integral lacks is the step's own error, which may be so much over the one allowed; what it makes of it is even.
    real(wp), parameter :: unexpected = 30
    !> Iterations that take off less than this part of what is open will not end in time.
    real(wp), parameter :: slow = 0.7_wp

    type :: step_curve
        logical :: is_there = .false.
        logical :: is_refused = .false.                   !! not to be believed for this step
        integer :: n_evaluation = 0                       !! blocks that the last one took
        real(wp), allocatable, private :: term(:, :)      !! of the way from where the step begins (n, term)
    contains
        procedure :: lay, way_at, forget
    end type step_curve

contains

    !> The step is another one.
    subroutine forget(self)
        class(step_curve), intent(inout) :: self

        self%is_there = .false.
        self%is_refused = .false.
    end subroutine forget

    !> Find the polynomial of a step.
    subroutine lay(self, system, t, length, y, way, rate, rate_end, allowed)
        class(step_curve), intent(inout) :: self
        class(lane_system), intent(inout) :: system
        real(wp), intent(in) :: t, length
        real(wp), intent(in) :: y(:), way(:)              !! where the step begins, and from there to its end (n)
        real(wp), intent(in) :: rate(:), rate_end(:)      !! at both (n)
        real(wp), intent(in) :: allowed(:)                !! error (n)
        real(wp) :: close(size(y))
        integer :: n_jump, i
        logical :: wants_more

        n_jump = system%n_jump                            ! who counts them has counted those of this step
        self%n_evaluation = 0
        self%is_there = .false.
        close = max(settled*allowed, rounding*max(abs(y), abs(way), abs(length)*max(abs(rate), abs(rate_end))))
        call begin_with_cubic()
        do i = 1, size(n_piece)
            call iterate(self, system, t, length, y, way, rate, rate_end, allowed, close, n_piece(i), wants_more)
            if (.not. wants_more) exit
        end do
        self%is_refused = .not. (self%is_there .or. is_interrupted())
        system%n_jump = n_jump

    contains

        !> The one that meets solution and rates at both ends.
        subroutine begin_with_cubic()
            real(wp), dimension(size(y)) :: even, odd

            even = length*(rate - rate_end)
            odd = (length*(rate + rate_end) - 2*way)/32
            self%term = reshape([way/2 + even/16, way/2 - odd, -even/16, odd], [size(y), 4])
        end subroutine begin_with_cubic
    end subroutine lay

    !> From a polynomial to a better one, with so many pieces, as far as that goes.
    subroutine iterate(self, system, t, length, y, way, rate, rate_end, allowed, close, n, wants_more)
        class(step_curve), intent(inout) :: self
        class(lane_system), intent(inout) :: system
        real(wp), intent(in) :: t, length, y(:), way(:), rate(:), rate_end(:), allowed(:)
        real(wp), intent(in) :: close(:)                  !! what may stay open (n)
        integer, intent(in) :: n                          !! pieces
        logical, intent(out) :: wants_more                !! of them
        real(wp) :: f(size(y), 0:n)                       ! rates at the places
        real(wp), dimension(size(y), n - 1) :: along, now ! ways to those within
        real(wp) :: integral(0:n, n + 2), value(n + 2, n - 1), lacks(size(y)), open, before, last
        integer :: iteration
        logical :: has_failed

        wants_more = .false.
        call prepare_terms(integral, value)
        f(:, 0) = rate
        f(:, n) = rate_end
        along = matmul(self%term, value(:size(self%term, 2), :))
        before = huge(before)
        do iteration = 1, most_iterations
            call find_rates(system, t, length, y, along, f(:, 1:n - 1), self%n_evaluation, has_failed)
            if (has_failed) return
            self%term = matmul(f, (length/2)*integral)
            ! Every polynomial of these is one at the end.
            lacks = way - sum(self%term, dim=2)
            self%term(:, 1) = self%term(:, 1) + lacks/2
            self%term(:, 2) = self%term(:, 2) + lacks/2
            now = matmul(self%term, value)
            open = maxval(maxval(abs(now - along), dim=2)/close)
            last = maxval(maxval(abs(self%term(:, n:)), dim=2)/close)
            along = now
            if (.not. open <= huge(open)) return
            if (iteration > 1 .and. open*min(1.0_wp, open/before) <= max(1.0_wp, last)) exit
            if (iteration > 2 .and. .not. open < slow*before) return
            before = open
        end do
        wants_more = last > 1
        self%is_there = iteration <= most_iterations .and. last <= 1 .and. all(abs(lacks) <= unexpected*allowed)
    end subroutine iterate

    !> Rates at the places within the step.
    subroutine find_rates(system, t, length, y, along, rate, n_evaluation, has_failed)
        class(lane_system), intent(inout) :: system
        real(wp), intent(in) :: t, length, y(:)
        real(wp), intent(in) :: along(:, :)               !! ways there (n, place)
        real(wp), intent(out) :: rate(:, :)               !! (n, place)
        integer, intent(inout) :: n_evaluation
        logical, intent(out) :: has_failed
        real(wp), dimension(lanes, size(y)) :: state, found
        real(wp) :: instant(lanes)
        logical :: failed(lanes)
        integer :: first, n_used, lane, i

        do first = 1, size(along, 2), lanes
            n_used = min(lanes, size(along, 2) - first + 1)
            do lane = 1, lanes
                i = first + min(lane, n_used) - 1         ! lanes to spare do what the last does
                instant(lane) = t + length*((1 + place(i, size(along, 2) + 1))/2)
                state(lane, :) = y + along(:, i)
            end do
            system%n_used = n_used
            call system%evaluate(instant, state, found, failed)
            system%n_used = lanes
            n_evaluation = n_evaluation + 1
            has_failed = any(failed(:n_used)) .or. is_interrupted()
            if (has_failed) return
            rate(:, first:first + n_used - 1) = transpose(found(:n_used, :))
        end do
        has_failed = .not. all(abs(rate) <= huge(1.0_wp))
    end subroutine find_rates

    !> The way from where the step begins.
    pure function way_at(self, share) result(way)
        class(step_curve), intent(in) :: self
        real(wp), intent(in) :: share                     !! of the step
        real(wp) :: way(size(self%term, 1))
        real(wp), dimension(size(way)) :: later, last
        real(wp) :: x
        integer :: k

        ! Clenshaw's sum
        x = 2*share - 1
        way = 0
        later = 0
        do k = size(self%term, 2), 2, -1
            last = way
            way = self%term(:, k) + 2*x*way - later
            later = last
        end do
        way = self%term(:, 1) + x*way - later
    end function way_at

    ! ---------------------------------------------------------------- Chebyshev's polynomials on [-1, 1]

    !> Place i of 0 to n, ends among them.
    elemental real(wp) function place(i, n)
        integer, intent(in) :: i, n

        place = -cos(pi*i/n)
    end function place

    !> Terms of the integral from the beginning by values at the places; values within by terms.
    pure subroutine prepare_terms(integral, value)
        real(wp), intent(out) :: integral(0:, :)          !! (place, term)
        real(wp), intent(out) :: value(:, :)              !! (term, place within)
        real(wp) :: term(0:size(integral, 1) - 1, 0:size(integral, 2))    ! of the rates
        integer :: n, i, k

        n = size(integral, 1) - 1
        term = 0
        do k = 0, n
            do i = 0, n
                term(i, k) = 2*at_place(k, i)/n
                if (i == 0 .or. i == n) term(i, k) = term(i, k)/2
                if (k == n) term(i, k) = term(i, k)/2     ! and of k = 0, but the rule below counts that twice
            end do
        end do
        integral(:, 1) = 0
        do k = 1, n + 1
            integral(:, k + 1) = (term(:, k - 1) - term(:, k + 1))/(2*k)
            integral(:, 1) = integral(:, 1) - (-1)**k*integral(:, k + 1)
        end do
        do i = 1, n - 1
            do k = 0, n + 1
                value(k + 1, i) = at_place(k, i)
            end do
        end do

    contains

        !> Polynomial k at place i.
        pure real(wp) function at_place(k, i)
            integer, intent(in) :: k, i

            at_place = cos(pi*modulo(k*(n - i), 2*n)/n)
        end function at_place
    end subroutine prepare_terms
end module linkdyn_step_curve
