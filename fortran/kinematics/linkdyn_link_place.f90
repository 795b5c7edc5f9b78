!> Where a single link stands: x, y and angle in a plane; in space x, y, z and a quaternion w, x, y, z of any length but zero.
module linkdyn_link_place
    use linkdyn_cross, only: cross
    use linkdyn_kinds, only: wp
    implicit none (type, external)
    private
    public :: moved_place, move_in_space, spun_place, led_on_thread, place_at, rate_at, motion_between, turned_axis

contains

    !> A place after a small shift and turn, in space about x, y, z of the world.
    pure function moved_place(place, by) result(moved)
        real(wp), intent(in) :: place(:)             !! (place_size)
        real(wp), intent(in) :: by(:)                !! (link_freedom)
        real(wp) :: moved(size(place))

        moved = place
        if (size(place) == 3) then
            moved = moved + by
        else
            call move_in_space(moved, by)
        end if
    end function moved_place

    !> The same in space, where it is. The turn comes out shorter by the twelfth part of its third power.
    pure subroutine move_in_space(place, by)
        real(wp), intent(inout) :: place(7)
        real(wp), intent(in) :: by(6)
        real(wp) :: half(3), w, x, y, z, part

        place(:3) = place(:3) + by(:3)
        ! (1, turn/2) times the quaternion
        half = by(4:)/2
        w = place(4) - (half(1)*place(5) + half(2)*place(6) + half(3)*place(7))
        x = place(5) + (half(1)*place(4) + half(2)*place(7) - half(3)*place(6))
        y = place(6) + (half(2)*place(4) + half(3)*place(5) - half(1)*place(7))
        z = place(7) + (half(3)*place(4) + half(1)*place(6) - half(2)*place(5))
        part = 1/sqrt(w*w + x*x + y*y + z*z)
        place(4:) = part*[w, x, y, z]
    end subroutine move_in_space

    !> The same of a link that may spin fast about an axis of its own through its origin: that turn first, whatever its size and
    !> exactly, then the rest. One turn about an axis that is nearly its own would take the axis round in a circle, and leave it
    !> nearly where it was.
    pure function spun_place(place, by, axis, about) result(moved)
        real(wp), intent(in) :: place(:)             !! (7)
        real(wp), intent(in) :: by(:)                !! (6)
        real(wp), intent(in) :: axis(3)              !! link axes
        real(wp), intent(in) :: about(3)             !! the same where the rates are those that have led by so much, world axes
        real(wp) :: moved(size(place))
        real(wp) :: angle, s, c

        angle = dot_product(by(4:), about)
        s = sin(angle/2)
        c = cos(angle/2)
        ! about its own axis: from the right
        moved(:3) = place(:3)
        moved(4) = c*place(4) - s*dot_product(axis, place(5:))
        moved(5:) = c*place(5:) + s*(place(4)*axis + cross(place(5:), axis))
        moved = moved_place(moved, [by(:3), by(4:) - angle*about])
    end function spun_place

    !> The same of a link whose origin may be anywhere: its thread's axis goes through `point`, which is shifted as if nothing spun.
    !> An origin beside the axis goes round in a circle; by the shift of its own it would go along the tangent, for many turns
    !> metres.
    pure function led_on_thread(place, by, axis, point) result(moved)
        real(wp), intent(in) :: place(:)             !! (7)
        real(wp), intent(in) :: by(:)                !! shift of the origin, and turn (6)
        real(wp), intent(in) :: axis(3), point(3)    !! link axes
        real(wp) :: moved(size(place))

        moved = spun_place(place_at(place, point), rate_at(place, by, point), axis, turned_axis(place, axis))
        moved = place_at(moved, -point)
    end function led_on_thread

    !> Where a link would stand if it had its origin at one of its points.
    pure function place_at(place, point) result(there)
        real(wp), intent(in) :: place(:)             !! (7)
        real(wp), intent(in) :: point(3)             !! link axes
        real(wp) :: there(size(place))

        there(:3) = place(:3) + turned_axis(place, point)
        there(4:) = place(4:)
    end function place_at

    !> The rate that it would have then, or small shift and turn.
    pure function rate_at(place, rate, point) result(there)
        real(wp), intent(in) :: place(:)             !! (7)
        real(wp), intent(in) :: rate(:)              !! (6)
        real(wp), intent(in) :: point(3)             !! link axes
        real(wp) :: there(size(rate))

        there(:3) = rate(:3) + cross(rate(4:), turned_axis(place, point))
        there(4:) = rate(4:)
    end function rate_at

    !> A direction of a link, world axes.
    pure function turned_axis(place, axis) result(about)
        real(wp), intent(in) :: place(:)             !! (7)
        real(wp), intent(in) :: axis(3)              !! link axes
        real(wp) :: about(3), across(3)

        across = (2/sum(place(4:)**2))*cross(place(5:), axis)
        about = axis + place(4)*across + cross(place(5:), across)
    end function turned_axis

    !> The shift and the turn, at most half a one, that take one place to another: along its axis, world axes.
    pure function motion_between(from, to) result(by)
        real(wp), intent(in) :: from(:), to(:)       !! (place_size)
        real(wp) :: by(merge(3, 6, size(from) == 3)) !! (link_freedom)
        real(wp), parameter :: small = sqrt(epsilon(1.0_wp))
        real(wp) :: w, turn(3), length

        if (size(from) == 3) then
            by = to - from
            return
        end if
        by(:3) = to(:3) - from(:3)
        ! to times the conjugate of from
        w = dot_product(to(4:), from(4:))
        turn(1) = from(4)*to(5) - to(4)*from(5) + from(6)*to(7) - from(7)*to(6)
        turn(2) = from(4)*to(6) - to(4)*from(6) - from(5)*to(7) + from(7)*to(5)
        turn(3) = from(4)*to(7) - to(4)*from(7) + from(5)*to(6) - from(6)*to(5)
        length = sqrt(sum(turn**2))
        ! 2 atan(length/w)/length; of a small turn two thirds of its square are left out
        if (length <= small*abs(w)) then
            by(4:) = turn*(2/w)
        else
            by(4:) = turn*(sign(2*atan2(length, abs(w)), w)/length)
        end if
    end function motion_between
end module linkdyn_link_place
