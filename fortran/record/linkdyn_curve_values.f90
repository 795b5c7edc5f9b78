!> Points of a record's curves as values, and how places found in them move.
module linkdyn_curve_values
    use linkdyn_operation, only: op_piece, op_nearest
    use linkdyn_piecewise, only: curve_of, which_of
    use linkdyn_record, only: record_type, open_record_of_thread
    use linkdyn_value, only: value, zero, piece_at, sin, cos, square, reciprocal, operator(+), operator(-), operator(*)
    implicit none (type, external)
    private
    public :: curve_point_values, slopes_of_look_up

    !> The point at a place, in the curve's axes, and two derivatives by the place.
    type :: curve_point_values
        type(value) :: at(2), first(2), second(2)
    end type curve_point_values

    interface curve_point_values
        module procedure point_at_place
    end interface curve_point_values

contains

    function point_at_place(curve, place) result(point)
        integer, intent(in) :: curve
        type(value), intent(in) :: place
        type(curve_point_values) :: point
        type(record_type), pointer :: record
        type(value) :: u(0:2), v(0:2), across
        integer :: k

        record => open_record_of_thread()
        do k = 0, 2
            u(k) = piece_at(curve, 1, k, place)
        end do
        do k = 0, merge(1, 2, record%curve(curve)%is_polar)
            v(k) = piece_at(curve, 2, k, place)
        end do
        if (record%curve(curve)%is_polar) then
            across = u(2) - u(0)*square(v(1))
            point%at = along(u(0), zero(), v(0))
            point%first = along(u(1), u(0)*v(1), v(0))
            point%second = along(across, u(1)*v(1) + u(1)*v(1), v(0))
        else
            point%at = [u(0), v(0)]
            point%first = [u(1), v(1)]
            point%second = [u(2), v(2)]
        end if
    end function point_at_place

    !> A vector that is given along the radius and square to it.
    function along(radial, across, angle) result(v)
        type(value), intent(in) :: radial, across, angle
        type(value) :: v(2)

        v = [radial*cos(angle) - across*sin(angle), radial*sin(angle) + across*cos(angle)]
    end function along

    !> Derivatives of what a look-up gives, by its operands; the second is zero where there is one.
    function slopes_of_look_up(kind, look, a, b, found) result(slope)
        integer, intent(in) :: kind, look          !! as nodes have them
        type(value), intent(in) :: a, b, found
        type(value) :: slope(2)
        type(curve_point_values) :: point
        type(value) :: growth

        slope = zero()
        associate (curve => curve_of(look), which => which_of(look))
            if (kind == op_piece) then
                if (modulo(which, 4) < 3) slope(1) = piece_at(curve, which/4 + 1, modulo(which, 4) + 1, a)
                return
            end if
            point = curve_point_values(curve, found)
        end associate
        associate (at => point%at, first => point%first, second => point%second)
            if (kind == op_nearest) then
                growth = square(first(1)) + square(first(2)) + (at(1) - a)*second(1) + (at(2) - b)*second(2)
            else
                growth = -(a*second(1) + b*second(2))
            end if
            slope(1) = first(1)*reciprocal(growth)
            slope(2) = first(2)*reciprocal(growth)
        end associate
    end function slopes_of_look_up
end module linkdyn_curve_values
