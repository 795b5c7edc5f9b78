!> Tables of time: where instants lie among their knots, and what the cubic spline or the straight lines through these give.
!>
!> Outside its knots a table stays at rest at its end value.
module linkdyn_table
    use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan
    use linkdyn_angles, only: angles_of_matrix, matrix_of_quaternion, spin_of_quaternion, angles_by_spin, is_near_pole
    use linkdyn_constants, only: two_pi
    use linkdyn_kinds, only: wp
    use linkdyn_scene, only: law_spec
    use linkdyn_spline, only: fit_spline
    implicit none (type, external)
    private
    public :: table_place, find_places, evaluate_table, attitude_at, spline_through, interval_of, lies_within

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

        if (law%angle > 0) then
            call evaluate_angle(law, place, value, rate, acceleration)
            return
        end if
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

    !> An angle of the attitude that a table of quaternions tells, with the turns of its knots. Near the pole its rates are not
    !> numbers: who wants motion there asks for `attitude_at`.
    pure subroutine evaluate_angle(law, place, value, rate, acceleration)
        type(law_spec), intent(in) :: law
        type(table_place), intent(in) :: place(:)      !! (n)
        real(wp), intent(out) :: value(:)              !! (n)
        real(wp), intent(out), optional :: rate(:), acceleration(:)    !! (n), both or none
        real(wp) :: p(4), omega(3), alpha(3), angle(3), of_rate(3), of_rate2(3), about
        integer :: k

        do k = 1, size(place)
            call attitude_at(law, place(k), p, omega, alpha)
            angle = angles_of_matrix(matrix_of_quaternion(p))
            associate (at => place(k))
                about = law%knot(at%interval)
                if (.not. at%is_held) about = at%a*law%knot(at%interval) + at%b*law%knot(at%interval + 1)
            end associate
            value(k) = angle(law%angle) + two_pi*anint((about - angle(law%angle))/two_pi)
            if (.not. present(rate)) cycle
            if (is_near_pole(angle)) then
                rate(k) = ieee_value(1.0_wp, ieee_quiet_nan)
                acceleration(k) = rate(k)
            else
                call angles_by_spin(angle, omega, alpha, of_rate, of_rate2)
                rate(k) = of_rate(law%angle)
                acceleration(k) = of_rate2(law%angle)
            end if
        end do
    end subroutine evaluate_angle

    !> The attitude that a table of quaternions tells: four splines, whose length has no part in it.
    pure subroutine attitude_at(law, place, p, omega, alpha)
        type(law_spec), intent(in) :: law
        type(table_place), intent(in) :: place
        real(wp), intent(out) :: p(4)                  !! w x y z, of a length near 1
        real(wp), intent(out) :: omega(3), alpha(3)    !! [rad/s, rad/s2]
        real(wp), dimension(1, 4) :: at, rate, rate2
        integer :: i

        do i = 1, 4
            call evaluate_spline(law%quaternion(:, i), law%bend(:, i), [place], at(:, i), rate(:, i), rate2(:, i))
        end do
        p = at(1, :)
        call spin_of_quaternion(p, rate(1, :), rate2(1, :), omega, alpha)
    end subroutine attitude_at

    !> The spline through knots that are no scene's, at instants within them, and its first two derivatives.
    subroutine spline_through(time, knot, t, value, rate, acceleration)
        real(wp), intent(in) :: time(:)                !! increasing, two at least
        real(wp), intent(in) :: knot(:)
        real(wp), intent(in) :: t(:)                   !! (n)
        real(wp), intent(out) :: value(:), rate(:), acceleration(:)    !! (n)
        real(wp), allocatable :: curvature(:)
        type(table_place), allocatable :: place(:)
        integer :: near

        allocate (curvature(size(time)), place(size(t)))
        near = 1
        call find_places(time, t, near, place)
        call fit_spline(time, knot, curvature)
        call evaluate_spline(knot, curvature, place, value, rate, acceleration)
    end subroutine spline_through

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

    !> How far an instant may miss the range of a table and still be its end: some roundings.
    pure real(wp) function slack(time)
        real(wp), intent(in) :: time(:)

        slack = 16*epsilon(slack)*max(abs(time(1)), abs(time(size(time))))
    end function slack

    !> Does an argument lie among the knots, to some roundings?
    pure elemental logical function lies_within(first, last, t)
        real(wp), intent(in) :: first, last    !! knots at both ends
        real(wp), intent(in) :: t

        lies_within = t >= first - slack([first, last]) .and. t <= last + slack([first, last])
    end function lies_within
end module linkdyn_table
