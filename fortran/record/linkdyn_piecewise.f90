!> Closed curves in pieces: what the look-ups of a record ask of tables.
!>
!> Two components are cubic polynomials on each piece, x and y or radius and angle. A *place* is the number of a piece, counted
!> from 0, and the part of the way through it. So a piece is found without a search, and derivatives by the place are
!> polynomials too. Which place is nearest to a point, or farthest in a direction, is found by a search among the points at
!> which pieces begin and by Newton's method between bounds: it depends on nothing that was asked before.
!>
!> `c/linkdyn_lanes_curve.h` does the same on lanes.
module linkdyn_piecewise
    use linkdyn_kinds, only: wp
    use linkdyn_operation, only: op_piece, op_nearest
    implicit none (type, external)
    private
    public :: piecewise_curve, look_up, look_at, curve_of, which_of, packed, most_steps, nearly

    integer, parameter :: most_steps = 60
    real(wp), parameter :: small = 0.78_wp         !! angle of a piece up to which sine and cosine take no reduction [rad]
    real(wp), parameter :: nearly = sqrt(epsilon(1.0_wp))/64    !! Newton's method squares what is left

    type :: piecewise_curve
        logical :: is_polar = .false.              !! radius and angle, which grows evenly on each piece; else x and y
        real(wp), allocatable :: c(:, :, :)        !! coefficients of powers 0 to 3 of the part (4, n, 2)
        real(wp), allocatable :: knot(:, :)        !! points at which pieces begin (2, n)
        real(wp), allocatable :: axis(:, :)        !! and their directions, if it is polar (2, n)
    end type piecewise_curve

contains

    ! ---------------------------------------------------------------- which of a record's curves, and what of it

    !> One number for a curve, a component and the order of a derivative by the place.
    pure integer function look_at(curve, component, order) result(look)
        integer, intent(in) :: curve
        integer, intent(in) :: component           !! 1, 2
        integer, intent(in) :: order               !! 0 to 3

        look = 8*curve + 4*(component - 1) + order
    end function look_at

    pure elemental integer function curve_of(look)
        integer, intent(in) :: look

        curve_of = look/8
    end function curve_of

    !> Component and order.
    pure elemental integer function which_of(look)
        integer, intent(in) :: look

        which_of = modulo(look, 8)
    end function which_of

    !> All of a curve in one row, as look-ups on lanes read it.
    pure function packed(curve) result(row)
        type(piecewise_curve), intent(in) :: curve
        real(wp), allocatable :: row(:)
        real(wp) :: form

        form = 0
        if (curve%is_polar) form = merge(1.0_wp, 2.0_wp, all(abs(curve%c(2, :, 2)) <= small))
        row = [real(size(curve%knot, 2), wp), form, curve%c, curve%knot(1, :), curve%knot(2, :)]
        if (curve%is_polar) row = [row, curve%axis(1, :), curve%axis(2, :)]
    end function packed

    ! ---------------------------------------------------------------- looking up

    !> Result of a look-up; b is ignored where it takes one operand.
    pure real(wp) function look_up(curve, kind, which, a, b) result(r)
        type(piecewise_curve), intent(in) :: curve
        integer, intent(in) :: kind                !! `op_piece`, `op_nearest`, `op_farthest`
        integer, intent(in) :: which
        real(wp), intent(in) :: a, b

        if (kind == op_piece) then
            r = piece(curve, which/4 + 1, modulo(which, 4), a)
        else
            r = best_place(curve, kind == op_nearest, a, b)
        end if
    end function look_up

    !> A component, or a derivative of it by the place. Beyond the ends the first and the last piece go on.
    pure real(wp) function piece(curve, component, order, place) result(r)
        type(piecewise_curve), intent(in) :: curve
        integer, intent(in) :: component, order
        real(wp), intent(in) :: place
        real(wp) :: within
        integer :: i

        within = merge(place, 0.0_wp, place > 0)   ! of what is no number, too
        i = int(merge(within, real(size(curve%knot, 2) - 1, wp), within < size(curve%knot, 2) - 1))
        r = polynomial(curve%c(:, i + 1, component), order, place - i)
    end function piece

    pure real(wp) function polynomial(c, order, t) result(r)
        real(wp), intent(in) :: c(4), t
        integer, intent(in) :: order

        select case (order)
        case (0)
            r = c(1) + t*(c(2) + t*(c(3) + t*c(4)))
        case (1)
            r = c(2) + t*(2*c(3) + t*(3*c(4)))
        case (2)
            r = 2*c(3) + t*(6*c(4))
        case default
            r = 6*c(4) + 0*t                       ! no number stays none
        end select
    end function polynomial

    !> From the best point at which a piece begins to the best place about it: the zero of what grows along the curve there.
    pure real(wp) function best_place(curve, is_nearest, a, b) result(place)
        type(piecewise_curve), intent(in) :: curve
        logical, intent(in) :: is_nearest          !! to the point (a, b); else farthest in that direction
        real(wp), intent(in) :: a, b
        real(wp) :: best, far, slope, growth, low, high, part, next, move
        logical :: is_sound
        integer :: i, k, n, step

        n = size(curve%knot, 2)
        i = 0
        best = 0
        do k = 0, n - 1
            associate (x => curve%knot(1, k + 1), y => curve%knot(2, k + 1))
                far = (x - a)*(x - a) + (y - b)*(y - b)
                if (.not. is_nearest) far = -(x*a + y*b)
            end associate
            if (k > 0 .and. .not. far < best) cycle
            best = far
            i = k
        end do
        call look(curve, is_nearest, i, 0.0_wp, a, b, slope, growth)
        part = 0
        if (slope > 0) then
            i = modulo(i - 1, n)
            part = 1
        end if
        low = 0
        high = 1
        do step = 1, most_steps
            call look(curve, is_nearest, i, part, a, b, slope, growth)
            if (slope > 0) then
                high = part
            else
                low = part
            end if
            next = part - slope/growth
            is_sound = growth > 0 .and. next >= low .and. next <= high
            if (.not. is_sound) next = (low + high)*0.5_wp
            move = abs(next - part)
            part = next
            if (move <= epsilon(1.0_wp) .or. (is_sound .and. move <= nearly)) exit
        end do
        place = i + part
    end function best_place

    !> What vanishes at the best place, and how it grows with the part of piece i. Polar in axes along the radius and square to it,
    !> which have turned since the piece began.
    pure subroutine look(curve, is_nearest, i, part, a, b, slope, growth)
        type(piecewise_curve), intent(in) :: curve
        logical, intent(in) :: is_nearest
        integer, intent(in) :: i
        real(wp), intent(in) :: part, a, b
        real(wp), intent(out) :: slope, growth
        real(wp) :: u(0:2), c(2), c1(2), c2(2), p(2), q(2), turned

        u = [polynomial(curve%c(:, i + 1, 1), 0, part), polynomial(curve%c(:, i + 1, 1), 1, part), &
             polynomial(curve%c(:, i + 1, 1), 2, part)]
        if (curve%is_polar) then
            associate (axis => curve%axis(:, i + 1), v => curve%c(2, i + 1, 2))
                q = [axis(1)*a + axis(2)*b, axis(1)*b - axis(2)*a]
                turned = v*part
                p = [cos(turned)*q(1) + sin(turned)*q(2), cos(turned)*q(2) - sin(turned)*q(1)]
                c = [u(0), 0.0_wp]
                c1 = [u(1), u(0)*v]
                c2 = [u(2) - u(0)*v*v, 2*u(1)*v]
            end associate
        else
            p = [a, b]
            c = [u(0), polynomial(curve%c(:, i + 1, 2), 0, part)]
            c1 = [u(1), polynomial(curve%c(:, i + 1, 2), 1, part)]
            c2 = [u(2), polynomial(curve%c(:, i + 1, 2), 2, part)]
        end if
        if (is_nearest) then
            slope = (c(1) - p(1))*c1(1) + (c(2) - p(2))*c1(2)
            growth = (c1(1)*c1(1) + c1(2)*c1(2)) + ((c(1) - p(1))*c2(1) + (c(2) - p(2))*c2(2))
        else
            slope = -(c1(1)*p(1) + c1(2)*p(2))
            growth = -(c2(1)*p(1) + c2(2)*p(2))
        end if
    end subroutine look
end module linkdyn_piecewise
