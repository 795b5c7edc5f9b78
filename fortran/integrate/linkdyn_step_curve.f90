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
    integer, parameter :: strip = 8                       !! rows of one state that are worked on together
    !> Of the error allowed: so much may stay open. Steps are better than they must be, and the curve is to be no worse.
    real(wp), parameter :: settled = 1.0e-3_wp
    real(wp), parameter :: rounding = 8*epsilon(1.0_wp)   !! of rates and their sums, relative
    !> What the integral lacks is the step's own error, which may be so much over the one allowed; what it makes of it is even.
    real(wp), parameter :: unexpected = 30

    !> What so many pieces have for all steps.
    type :: curve_table
        integer :: n = 0                                  !! pieces; 0: not made
        real(wp), allocatable :: share(:)                 !! places within, as parts of the step (n - 1)
        real(wp), allocatable :: integral(:, :)           !! terms of the way by rates at the places (0:n, n + 2)
        real(wp), allocatable :: value(:, :)              !! values within by terms (n + 2, n - 1)
    end type curve_table

    type :: step_curve
        logical :: is_there = .false.
        logical :: is_refused = .false.                   !! not to be believed for this step
        integer :: n_evaluation = 0                       !! blocks that the last one took
        real(wp), allocatable, private :: term(:, :)      !! of the way from where the step begins (n, term)
        type(curve_table), private :: table(size(n_piece))
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
            if (self%table(i)%n == 0) call make_table(n_piece(i), self%table(i))
            call iterate(self, system, t, length, y, way, rate, rate_end, allowed, close, self%table(i), wants_more)
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

    !> From a polynomial to a better one, with the pieces of a table, as far as that goes.
    subroutine iterate(self, system, t, length, y, way, rate, rate_end, allowed, close, table, wants_more)
        class(step_curve), intent(inout) :: self
        class(lane_system), intent(inout) :: system
        real(wp), intent(in) :: t, length, y(:), way(:), rate(:), rate_end(:), allowed(:)
        real(wp), intent(in) :: close(:)                  !! what may stay open (n)
        type(curve_table), intent(in) :: table
        logical, intent(out) :: wants_more                !! pieces
        real(wp) :: f(strips(y), 0:table%n)               ! rates at the places
        real(wp), dimension(strips(y), table%n - 1) :: along, now  ! ways to those within
        real(wp) :: term(strips(y), table%n + 2), integral(0:table%n, table%n + 2)
        real(wp) :: lacks(size(y)), open, before, last
        integer :: iteration, n
        logical :: has_failed

        n = size(y)
        wants_more = .false.
        f = 0
        f(:n, 0) = rate
        f(:n, table%n) = rate_end
        term = 0
        term(:n, :size(self%term, 2)) = self%term
        call combine(term, table%value, along)
        before = huge(before)
        integral = (length/2)*table%integral
        do iteration = 1, most_iterations
            call find_rates(system, t, length, y, table%share, along(:n, :), f(:n, 1:table%n - 1), self%n_evaluation, has_failed)
            if (has_failed) return
            call combine(f, integral, term)
            ! Every polynomial of these is one at the end.
            lacks = way - sum(term(:n, :), dim=2)
            term(:n, 1) = term(:n, 1) + lacks/2
            term(:n, 2) = term(:n, 2) + lacks/2
            call combine(term, table%value, now)
            open = maxval(maxval(abs(now(:n, :) - along(:n, :)), dim=2)/close)
            last = maxval(maxval(abs(term(:n, table%n:)), dim=2)/close)
            along = now
            if (.not. open <= huge(open)) return
            if (iteration > 1 .and. open*min(1.0_wp, open/before) <= max(1.0_wp, last)) exit
            if (iteration > 2 .and. .not. will_end(iteration, open, open/before)) return
            before = open
        end do
        self%term = term(:n, :)
        wants_more = last > 1
        self%is_there = iteration <= most_iterations .and. last <= 1 .and. all(abs(lacks) <= unexpected*allowed)
    end subroutine iterate

    !> Rows that so many numbers take in whole strips.
    pure integer function strips(y)
        real(wp), intent(in) :: y(:)

        strips = strip*((size(y) + strip - 1)/strip)
    end function strips

    !> The matrix product columns*weight, strip by strip: its sums stay in registers.
    pure subroutine combine(columns, weight, found)
        real(wp), contiguous, intent(in) :: columns(:, :)     !! (row, k)
        real(wp), contiguous, intent(in) :: weight(:, :)      !! (k, j)
        real(wp), contiguous, intent(out) :: found(:, :)      !! (row, j)
        real(wp) :: total(strip)
        integer :: first, j, k

        do first = 1, size(found, 1), strip
            do j = 1, size(found, 2)
                total = 0
                do k = 1, size(columns, 2)
                    total = total + columns(first:first + strip - 1, k)*weight(k, j)
                end do
                found(first:first + strip - 1, j) = total
            end do
        end do
    end subroutine combine

    !> Will what is open have been settled in time? The k-th iteration leaves the part c/k of it, c the step times the largest rate
    !> at which errors grow or fade.
    pure logical function will_end(iteration, open, part)
        integer, intent(in) :: iteration                  !! done
        real(wp), intent(in) :: open                      !! what is, over what may stay so
        real(wp), intent(in) :: part                      !! of it that the last one has left
        real(wp) :: ahead
        integer :: k

        ahead = log(max(open, tiny(open)))
        do k = iteration + 1, most_iterations
            ahead = ahead + log(max(iteration*part/k, tiny(part)))
        end do
        will_end = ahead < 0
    end function will_end

    !> Rates at the places within the step.
    subroutine find_rates(system, t, length, y, share, along, rate, n_evaluation, has_failed)
        class(lane_system), intent(inout) :: system
        real(wp), intent(in) :: t, length, y(:)
        real(wp), intent(in) :: share(:)                  !! of the length up to the places
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
            do lane = 1, n_used
                i = first + lane - 1
                instant(lane) = t + length*share(i)
                state(lane, :) = y + along(:, i)
            end do
            call system%evaluate_first(n_used, instant, state, found, failed)
            n_evaluation = n_evaluation + 1
            has_failed = any(failed) .or. is_interrupted()
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

    !> Places, and what leads from values there to terms and back.
    pure subroutine make_table(n, table)
        integer, intent(in) :: n                          !! pieces
        type(curve_table), intent(out) :: table
        real(wp) :: term(0:n, 0:n + 2)                    ! of the rates
        integer :: i, k

        table%n = n
        table%share = [((1 - cos(pi*i/n))/2, i=1, n - 1)]
        term = 0
        do k = 0, n
            do i = 0, n
                term(i, k) = 2*at_place(k, i)/n
                if (i == 0 .or. i == n) term(i, k) = term(i, k)/2
                if (k == n) term(i, k) = term(i, k)/2     ! and of k = 0, but the rule below counts that twice
            end do
        end do
        allocate (table%integral(0:n, n + 2), source=0.0_wp)
        do k = 1, n + 1
            table%integral(:, k + 1) = (term(:, k - 1) - term(:, k + 1))/(2*k)
            table%integral(:, 1) = table%integral(:, 1) - (-1)**k*table%integral(:, k + 1)
        end do
        table%value = reshape([((at_place(k, i), k=0, n + 1), i=1, n - 1)], [n + 2, n - 1])

    contains

        !> Polynomial k at place i of 0 to n, ends among them.
        pure real(wp) function at_place(k, i)
            integer, intent(in) :: k, i

            at_place = cos(pi*modulo(k*(n - i), 2*n)/n)
        end function at_place
    end subroutine make_table
end module linkdyn_step_curve
