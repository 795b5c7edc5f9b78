!> Hard stops where a run begins, and what has got past them.
module linkdyn_stop_starts
    use linkdyn_forward_system, only: forward_system
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_scene, only: stop_spec, n_event, n_stop, has_hard_stops
    use linkdyn_status, only: status_type, fail, status_bad_input
    use linkdyn_text, only: to_text, quoted
    implicit none (type, external)
    private
    public :: touch_width, refuse_beyond_stops, begin_at_stops, find_passed

contains

    !> Gap that is none, where a run begins: a start written with the stop's own number is at the stop.
    pure real(wp) function touch_width(stop)
        type(stop_spec), intent(in) :: stop

        touch_width = 1.0e-10_wp*max(1.0e-3_wp, abs(stop%bound))
    end function touch_width

    !> No run begins beyond a stop.
    subroutine refuse_beyond_stops(system, t, y, status)
        type(forward_system), intent(inout) :: system
        real(wp), intent(in) :: t                      !! [s]
        real(wp), intent(in) :: y(:, :)
        type(status_type), intent(inout) :: status
        real(wp) :: gap(lanes, n_event(system%model%scene))
        integer :: i

        if (.not. has_hard_stops(system%model%scene)) return
        call system%evaluate_guards(spread(t, 1, lanes), y, gap)
        do i = 1, n_stop(system%model%scene)
            associate (stop => system%model%scene%stop(i))
                if (.not. stop%is_hard .or. .not. gap(1, stop%event) < -touch_width(stop)) cycle
                call fail(status, status_bad_input, "stop "//quoted(stop%name)//": "//trim(stop%what)//" starts " &
                          //to_text(-gap(1, stop%event))//" beyond it (expected a start that the stop admits)")
                return
            end associate
        end do
    end subroutine refuse_beyond_stops

    !> What touches its stop where the run begins strikes it or rests there.
    subroutine begin_at_stops(system, t, y)
        type(forward_system), intent(inout) :: system
        real(wp), intent(in) :: t                      !! [s]
        real(wp), intent(inout) :: y(:, :)
        real(wp) :: gap(lanes, n_event(system%model%scene))
        logical :: touches(lanes, n_stop(system%model%scene))
        integer :: i

        if (.not. has_hard_stops(system%model%scene)) return
        call system%evaluate_guards(spread(t, 1, lanes), y, gap)
        do i = 1, size(touches, 2)
            associate (stop => system%model%scene%stop(i))
                touches(:, i) = stop%is_hard .and. abs(gap(:, stop%event)) <= touch_width(stop)
            end associate
        end do
        if (any(touches)) call system%meet_stops(spread(t, 1, lanes), y, touches)
    end subroutine begin_at_stops

    !> The first stop that each lane is beyond though nothing rests there; 0: none.
    subroutine find_passed(system, t, y, passed)
        type(forward_system), intent(inout) :: system
        real(wp), intent(in) :: t                      !! [s]
        real(wp), intent(in) :: y(:, :)
        integer, intent(out) :: passed(lanes)
        real(wp), parameter :: much = 1.0e3_wp         !! over what counts as touching: 1e-7 of the bound, 1e-10 at least
        real(wp) :: gap(lanes, n_event(system%model%scene))
        integer :: i

        passed = 0
        call system%evaluate_guards(spread(t, 1, lanes), y, gap)
        do i = n_stop(system%model%scene), 1, -1
            associate (stop => system%model%scene%stop(i))
                if (.not. stop%is_hard) cycle
                where (gap(:, stop%event) < -much*touch_width(stop) .and. .not. system%way%stops%rests(:, i)) passed = i
            end associate
        end do
    end subroutine find_passed
end module linkdyn_stop_starts
