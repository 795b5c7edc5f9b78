!> Ways followed on curves that are known: x^2 = (e - s)^2 + d^2 and x^2 = e - s + w (e - s)^2 over the part s of the way.
!>
!> The second one ends at e, the first one passes e at a distance d, however small; x is place and margin at once.
module test_following
    use linkdyn_following, only: follower, footing, way_report, follow_way, way_arrived, way_ends
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_testing, only: test_error, unit_test, new_test, check, check_close
    implicit none (type, external)
    private
    public :: collect_following

    !> A point on such a curve on every lane.
    type, extends(follower) :: point_on_curve
        real(wp) :: end = 0, bend = 0                  !! e, w
        real(wp) :: clear = -1                         !! d; negative: the curve ends
        real(wp), dimension(lanes) :: x = 0, rate = 0, tried = 0, rate_tried = 0
        integer :: n_tried = 0
    contains
        procedure :: try => try_point
        procedure :: take => take_point
    end type point_on_curve

contains

    subroutine collect_following(tests)
        type(unit_test), allocatable, intent(out) :: tests(:)

        tests = [ &
            new_test("an end is found in few tries", test_end), &
            new_test("what turns away in time goes on", test_passing)]
    end subroutine collect_following

    subroutine test_end(error)
        type(test_error), intent(inout) :: error
        type(point_on_curve) :: point
        type(way_report) :: report
        integer :: i

        do i = 0, 4
            call set_out(0.3_wp + 0.15_wp*i, 0.4_wp*i, -1.0_wp, point)
            call follow_way(point, spread(.true., 1, lanes), spread(0.2_wp, 1, lanes), .false., 300, report)
            call check(error, all(report%outcome == way_ends), "it ends")
            call check_close(error, report%reached, spread(point%end, 1, lanes), 1.0e-12_wp, "where the curve does")
            ! where each step leaves three fifths of the margin, six decades take three times as many
            call check(error, point%n_tried < 40, "in few tries")
        end do
    end subroutine test_end

    subroutine test_passing(error)
        type(test_error), intent(inout) :: error
        type(point_on_curve) :: point
        type(way_report) :: report
        integer :: i

        do i = 1, 5
            call set_out(0.5_wp, 0.0_wp, 10.0_wp**(-i), point)
            call follow_way(point, spread(.true., 1, lanes), spread(0.2_wp, 1, lanes), .false., 300, report)
            call check(error, all(report%outcome == way_arrived), "it goes on")
            call check_close(error, point%x, sqrt((point%end - spread(1.0_wp, 1, lanes))**2 + point%clear**2), 1.0e-12_wp, &
                             "on its own branch")
        end do
    end subroutine test_passing

    subroutine set_out(end, bend, clear, point)
        real(wp), intent(in) :: end, bend, clear
        type(point_on_curve), intent(out) :: point

        point%end = end
        point%bend = bend
        point%clear = clear
        point%least_margin = [1.0e-6_wp]
        point%x = sqrt(square_at(point, spread(0.0_wp, 1, lanes)))
    end subroutine set_out

    pure function square_at(point, s) result(square)
        type(point_on_curve), intent(in) :: point
        real(wp), intent(in) :: s(lanes)
        real(wp) :: square(lanes)

        if (point%clear < 0) then
            square = (point%end - s)*(1 + point%bend*(point%end - s))
        else
            square = (point%end - s)**2 + point%clear**2
        end if
    end function square_at

    !> Newton's method from where the tangent leads, as far as its corrections shrink as they must.
    subroutine try_point(self, goes, part, lead, is_crossing, found)
        class(point_on_curve), intent(inout) :: self
        logical, intent(in) :: goes(lanes)
        real(wp), intent(in) :: part(lanes), lead(lanes)
        logical, intent(in) :: is_crossing(:, :)
        type(footing), intent(inout) :: found
        real(wp), dimension(lanes) :: square, slope, correction, before
        integer :: i

        self%n_tried = self%n_tried + 1
        square = square_at(self, part)
        self%tried = self%x + lead*self%rate
        found%is_closed = goes
        before = huge(1.0_wp)
        do i = 1, 20
            correction = (self%tried**2 - square)/(2*self%tried)
            found%is_closed = found%is_closed .and. abs(correction) <= max(before/4, 1.0e-14_wp/abs(self%tried))
            self%tried = self%tried - correction
            before = abs(correction)
        end do
        slope = 2*(part - self%end)
        if (self%clear < 0) slope = -1 - 2*self%bend*(self%end - part)
        self%rate_tried = slope/(2*self%tried)
        found%margin(:, 1) = self%tried
        found%drift(:, 1) = self%rate_tried
    end subroutine try_point

    subroutine take_point(self, is_taken)
        class(point_on_curve), intent(inout) :: self
        logical, intent(in) :: is_taken(lanes)

        where (is_taken)
            self%x = self%tried
            self%rate = self%rate_tried
        end where
    end subroutine take_point
end module test_following
