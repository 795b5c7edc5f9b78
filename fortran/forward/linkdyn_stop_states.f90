!> End stops in a run: at which of them joint variables rest, what they push, how wide gaps are and how hard impacts have been.
module linkdyn_stop_states
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_model, only: model_type
    implicit none (type, external)
    private
    public :: stop_states, prepare_stops, rests_anywhere, hard_gaps, begin_gaps, rest_at_stop, leave_stop

    type :: stop_states
        logical, allocatable :: rests(:, :)            !! a joint variable rests at a stop (lane, n_stop)
        real(wp), allocatable :: push(:, :)            !! of stops at the state evaluated last, away from them (lane, n_stop) [N, N
                                                       !! m]
        real(wp), allocatable :: fastest(:, :)         !! impact so far (lane, n_stop) [m/s, rad/s]
        real(wp) :: hardest(lanes) = 0                 !! of all: speed by the root of the response to a push [sqrt(J)]
        real(wp), allocatable :: yielded(:, :)         !! depth at which contacts were found, by rounding and drift: their gaps
                                                       !! begin there (lane, n_stop) [m, rad]
        real(wp), allocatable :: widest(:, :)          !! gap so far, of stops at which something rests (lane, n_stop) [m, rad]
    end type stop_states

contains

    subroutine prepare_stops(n, stops)
        integer, intent(in) :: n
        type(stop_states), intent(out) :: stops

        allocate (stops%rests(lanes, n), source=.false.)
        allocate (stops%push(lanes, n), stops%yielded(lanes, n), stops%fastest(lanes, n), stops%widest(lanes, n), source=0.0_wp)
    end subroutine prepare_stops

    pure logical function rests_anywhere(stops)
        type(stop_states), intent(in) :: stops

        rests_anywhere = .false.
        if (allocated(stops%rests)) rests_anywhere = any(stops%rests)
    end function rests_anywhere

    !> Gaps of hard stops among the scene's events.
    subroutine hard_gaps(model, guard, gap)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: guard(:, :)            !! (lane, n_guard)
        real(wp), intent(out) :: gap(:, :)             !! (lane, n_stop); of other stops: none is closed
        integer :: i

        gap = huge(1.0_wp)
        do i = 1, size(gap, 2)
            associate (stop => model%scene%stop(i))
                if (stop%is_hard) gap(:, i) = guard(:, stop%event)
            end associate
        end do
    end subroutine hard_gaps

    !> Contacts that are closed and do not rest begin their gaps where they are: a variable that has drifted a little beyond its
    !> stop while it rested there, or that rounding leaves there, is not to come out first. One that is further beyond was lost.
    subroutine begin_gaps(model, gap, is_wanted, rested, stops)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: gap(:, :)              !! (lane, n_stop)
        logical, intent(in) :: is_wanted(lanes)
        logical, intent(in) :: rested(:, :)            !! until now (lane, n_stop)
        type(stop_states), intent(inout) :: stops
        real(wp), parameter :: small = 1.0e-7_wp       !! of the bound, 1e-10 at least
        real(wp) :: deepest
        integer :: i

        do i = 1, size(gap, 2)
            associate (stop => model%scene%stop(i), yielded => stops%yielded(:, i))
                deepest = small*max(1.0e-3_wp, abs(stop%bound))
                where (is_wanted .and. gap(:, i) > 0)
                    yielded = 0
                elsewhere (is_wanted .and. (rested(:, i) .or. (gap(:, i) + yielded < 0 .and. gap(:, i) + yielded > -deepest)))
                    yielded = max(0.0_wp, -gap(:, i))
                end where
            end associate
        end do
    end subroutine begin_gaps

    !> A joint variable comes to rest at a stop: the stop's push is looked out for from here.
    pure subroutine rest_at_stop(lane, stop, stops, guard_side, guard_scale)
        integer, intent(in) :: lane, stop
        type(stop_states), intent(inout) :: stops
        real(wp), intent(inout) :: guard_side, guard_scale     !! of the stop's event

        stops%rests(lane, stop) = .true.
        stops%widest(lane, stop) = guard_scale
        guard_scale = 0
        guard_side = 1
    end subroutine rest_at_stop

    !> A joint variable rests at a stop no more, if it did: its gap is looked out for.
    pure subroutine leave_stop(lane, stop, stops, guard_side, guard_scale)
        integer, intent(in) :: lane, stop
        type(stop_states), intent(inout) :: stops
        real(wp), intent(inout) :: guard_side, guard_scale     !! of the stop's event

        if (stops%rests(lane, stop)) guard_scale = stops%widest(lane, stop)
        stops%rests(lane, stop) = .false.
        stops%push(lane, stop) = 0
        guard_side = 1
    end subroutine leave_stop
end module linkdyn_stop_states
