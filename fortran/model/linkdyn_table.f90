!> Tables of time: where instants lie among their knots, and what the cubic spline or the straight lines through these give.
!>
!> Outside its knots a table stays at rest at its end value.
module linkdyn_table
    use linkdyn_kinds, only: wp
    use linkdyn_scene, only: law_spec
    implicit none (type, external)
    private
    public :: table_place, find_places, evaluate_table, interval_of, fit_spline, fit_periodic_spline, lies_within

    !> Where an instant lies.
    type :: table_place
        integer :: interval                    !! between this knot and the next
        logical :: is_held                     !! the table stays at rest at this knot instead
        real(wp) :: h                          !! length of the interval [s]
        real(wp) :: a, b                       !! weights of its two ends
    end type table_place

contains

    !> Where instants lie. Each search starts at the interval found last: along increasing instants there is nothing to search.
    pure subroutine find_places(time, t, near, place)
        real(wp), intent(in) :: time(:)        !! knots [s], increasing
        real(wp), intent(in) :: t(:)           !! instants [s] (n)
        integer, intent(inout) :: near         !! any interval; it is left at the last one
        type(table_place), intent(out) :: place(:)     !! (n)
        real(wp) :: instant
        integer :: i, k, last

        last = size(time)
        do k = 1, size(t)
            ! An instant that misses the end by rounding alone (0.1*20 for 2) is the end, in motion.
            instant = t(k)
            if (t(k) < time(1)) then
                if (t(k) >= time(1) - slack(time)) instant = time(1)
            else if (t(k) > time(last)) then
                if (t(k) <= time(last) + slack(time)) instant = time(last)
            end if
            if (last == 1 .or. instant < time(1)) then
                place(k) = held_at(1)
            else if (instant > time(last)) then
                place(k) = held_at(last)
            else
                near = interval_of(time, instant, near)
                i = near
                associate (h => time(i + 1) - time(i))
                    place(k) = table_place(i, .false., h, (time(i + 1) - instant)/h, (instant - time(i))/h)
                end associate
            end if
        end do
    end subroutine find_places

    pure type(table_place) function held_at(knot)
        integer, intent(in) :: knot

        held_at = table_place(knot, .true., 0.0_wp, 1.0_wp, 0.0_wp)
    end function held_at

    !> Value of a table and its first two derivatives in time.
    pure subroutine evaluate_table(law, place, value, rate, acceleration)
        type(law_spec), intent(in) :: law
        type(table_place), intent(in) :: place(:)      !! (n)
        real(wp), intent(out) :: value(:)              !! (n)
        real(wp), intent(out), optional :: rate(:), acceleration(:)    !! (n), both or none
        integer :: k

        if (allocated(law%curvature)) then
            call evaluate_spline(law%knot, law%curvature, place, value, rate, acceleration)
            return
        end if
        do k = 1, size(place)
            associate (p => place(k), i => place(k)%interval)
                if (p%is_held) then
                    value(k) = law%knot(i)
                    if (present(rate)) rate(k) = 0
                else
                    value(k) = p%a*law%knot(i) + p%b*law%knot(i + 1)
                    if (present(rate)) rate(k) = (law%knot(i + 1) - law%knot(i))/p%h
                end if
            end associate
        end do
        if (present(rate)) acceleration = 0
    end subroutine evaluate_table

    pure subroutine evaluate_spline(knot, curvature, place, value, rate, acceleration)
        real(wp), intent(in) :: knot(:), curvature(:)
        type(table_place), intent(in) :: place(:)      !! (n)
        real(wp), intent(out) :: value(:)              !! (n)
        real(wp), intent(out), optional :: rate(:), acceleration(:)    !! (n)
        integer :: k

        do k = 1, size(place)
            associate (i => place(k)%interval, h => place(k)%h, a => place(k)%a, b => place(k)%b)
                if (place(k)%is_held) then
                    value(k) = knot(i)
                    if (present(rate)) rate(k) = 0
                    if (present(rate)) acceleration(k) = 0
                    cycle
                end if
                value(k) = a*knot(i) + b*knot(i + 1) + ((a**3 - a)*curvature(i) + (b**3 - b)*curvature(i + 1))*h**2/6
                if (.not. present(rate)) cycle
                rate(k) = (knot(i + 1) - knot(i))/h + ((3*b**2 - 1)*curvature(i + 1) - (3*a**2 - 1)*curvature(i))*h/6
                acceleration(k) = a*curvature(i) + b*curvature(i + 1)
            end associate
        end do
    end subroutine evaluate_spline

    !> The i with time(i) <= t < time(i + 1), kept within 1 .. n - 1: by steps that double, away from an interval that may be
    !> near, then by halving.
    pure integer function interval_of(time, t, near) result(low)
        real(wp), intent(in) :: time(:)        !! increasing (n), n > 1
        real(wp), intent(in) :: t
        integer, intent(in) :: near
        integer :: high, middle, step

        low = max(1, min(near, size(time) - 1))
        high = size(time)
        if (t >= time(low)) then
            step = 1
            do while (low + step < size(time))
                if (.not. t >= time(low + step)) then
                    high = low + step
                    exit
                end if
                low = low + step
                step = 2*step
            end do
        else
            high = low
            low = 1
        end if
        do while (high - low > 1)
            middle = low + (high - low)/2
            if (t >= time(middle)) then
                low = middle
            else
                high = middle
            end if
        end do
    end function interval_of

    !> By how much an instant may miss the range of a table and still be its end: some roundings.
    pure real(wp) function slack(time)
        real(wp), intent(in) :: time(:)

        slack = 16*epsilon(slack)*max(abs(time(1)), abs(time(size(time))))
    end function slack

    !> Second derivatives at the knots of the C2 cubic spline with not-a-knot ends.
    !>
    !> Three points give the parabola, two the straight line. The tridiagonal matrix is diagonally
    !> dominant whatever the spacing, so that it is eliminated without pivoting.
    !>
    !> **Source**: C. de Boor, A Practical Guide to Splines, rev. ed., Springer 2001, ch. IV.
    pure subroutine fit_spline(time, knot, curvature)
        real(wp), intent(in) :: time(:)        !! knots [s] (n), increasing
        real(wp), intent(in) :: knot(:)        !! values (n)
        real(wp), intent(out) :: curvature(:)  !! second derivatives (n)
        real(wp), allocatable :: h(:), slope(:), diagonal(:), upper(:)
        real(wp) :: lower
        integer :: i, n

        n = size(time)
        curvature = 0
        if (n < 3) return
        allocate (h(n - 1), slope(n - 1), diagonal(n), upper(n))
        h = time(2:) - time(:n - 1)
        slope = (knot(2:) - knot(:n - 1))/h
        if (n == 3) then
            curvature = 2*(slope(2) - slope(1))/(h(1) + h(2))
            return
        end if
        do i = 2, n - 1
            lower = h(i - 1)
            diagonal(i) = 2*(h(i - 1) + h(i))
            upper(i) = h(i)
            curvature(i) = 6*(slope(i) - slope(i - 1))
            ! The end curvatures continue the line through their two neighbours: put them in here.
            if (i == 2) then
                diagonal(i) = diagonal(i) + h(1)*(h(1) + h(2))/h(2)
                upper(i) = (h(2) - h(1))*(h(2) + h(1))/h(2)
            end if
            if (i == n - 1) then
                diagonal(i) = diagonal(i) + h(n - 1)*(h(n - 1) + h(n - 2))/h(n - 2)
                lower = (h(n - 2) - h(n - 1))*(h(n - 2) + h(n - 1))/h(n - 2)
            end if
            if (i > 2) then
                diagonal(i) = diagonal(i) - lower*upper(i - 1)/diagonal(i - 1)
                curvature(i) = curvature(i) - lower*curvature(i - 1)/diagonal(i - 1)
            end if
        end do
        curvature(n - 1) = curvature(n - 1)/diagonal(n - 1)
        do i = n - 2, 2, -1
            curvature(i) = (curvature(i) - upper(i)*curvature(i + 1))/diagonal(i)
        end do
        curvature(1) = curvature(2) + (curvature(2) - curvature(3))*h(1)/h(2)
        curvature(n) = curvature(n - 1) + (curvature(n - 1) - curvature(n - 2))*h(n - 1)/h(n - 2)
    end subroutine fit_spline

    !> Does an argument lie among the knots, to some roundings?
    pure elemental logical function lies_within(first, last, t)
        real(wp), intent(in) :: first, last    !! knots at both ends
        real(wp), intent(in) :: t

        lies_within = t >= first - slack([first, last]) .and. t <= last + slack([first, last])
    end function lies_within

    !> Second derivatives of the periodic C2 cubic spline: the last knot is the first one after a period, and has its value.
    !>
    !> The corners of the cyclic matrix are a correction of rank one (Sherman and Morrison).
    pure subroutine fit_periodic_spline(time, knot, curvature)
        real(wp), intent(in) :: time(:)        !! knots (n), increasing
        real(wp), intent(in) :: knot(:)        !! values (n), the last equal to the first
        real(wp), intent(out) :: curvature(:)  !! second derivatives (n)
        real(wp), allocatable :: h(:), slope(:), diagonal(:), right(:, :)
        real(wp) :: corner, factor
        integer :: i, m

        m = size(time) - 1                     ! different knots
        curvature = 0
        if (m < 2) return
        h = time(2:) - time(:m)
        slope = (knot(2:) - knot(:m))/h
        allocate (diagonal(m), right(m, 2))
        right = 0
        do i = 1, m
            associate (before => merge(m, i - 1, i == 1))
                diagonal(i) = 2*(h(before) + h(i))
                right(i, 1) = 6*(slope(i) - slope(before))
            end associate
        end do
        if (m == 2) then
            ! both neighbours of a knot are the other one
            associate (a => diagonal(1), b => h(1) + h(2))
                curvature(1) = (a*right(1, 1) - b*right(2, 1))/(a**2 - b**2)
                curvature(2) = (a*right(2, 1) - b*right(1, 1))/(a**2 - b**2)
            end associate
            curvature(3) = curvature(1)
            return
        end if
        corner = h(m)
        diagonal(1) = diagonal(1) - corner
        diagonal(m) = diagonal(m) - corner
        right(1, 2) = corner
        right(m, 2) = corner
        do i = 2, m
            factor = h(i - 1)/diagonal(i - 1)
            diagonal(i) = diagonal(i) - factor*h(i - 1)
            right(i, :) = right(i, :) - factor*right(i - 1, :)
        end do
        right(m, :) = right(m, :)/diagonal(m)
        do i = m - 1, 1, -1
            right(i, :) = (right(i, :) - h(i)*right(i + 1, :))/diagonal(i)
        end do
        factor = (right(1, 1) + right(m, 1))/(1 + right(1, 2) + right(m, 2))
        curvature(:m) = right(:, 1) - factor*right(:, 2)
        curvature(m + 1) = curvature(1)
    end subroutine fit_periodic_spline
end module linkdyn_table
