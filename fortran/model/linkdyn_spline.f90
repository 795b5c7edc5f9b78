!> Cubic splines with continuous second derivatives through given knots.
module linkdyn_spline
    use linkdyn_kinds, only: wp
    implicit none (type, external)
    private
    public :: fit_spline, fit_periodic_spline

contains

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
end module linkdyn_spline
