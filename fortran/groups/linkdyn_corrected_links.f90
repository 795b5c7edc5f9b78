!> Where a correction of Newton's method takes a group's links, how large it is, and how fast they move: what whoever closes the
!> group asks of each sample at each step. The rules are those of `linkdyn_newton_group` and `linkdyn_link_place`.
module linkdyn_corrected_links
    use linkdyn_attitude, only: rotation_by_quaternion
    use linkdyn_bodies, only: omega_of, world_axes
    use linkdyn_constants, only: two_pi
    use linkdyn_kinds, only: wp
    use linkdyn_mechanism, only: mechanism_type
    use linkdyn_model, only: model_type, group_type, link_freedom, place_size, reach_of
    use linkdyn_value, only: value, zero, one, constant, sqrt, sin, cos, max, abs, square, nearest_whole, &
        operator(+), operator(-), operator(*), operator(/)
    use linkdyn_vector, only: vector, vector_of, components, operator(+), operator(-), operator(*), operator(.dot.), &
        operator(.cross.), operator(.rotate.)
    implicit none (type, external)
    private
    public :: corrected_links, correct_links, fastest

    type :: corrected_links
        type(value), allocatable :: place(:, :)        !! of the group's links afterwards (place_size, link)
        type(value) :: largest                         !! shift or turn, lengths by the mechanism's size
        type(value) :: bounded                         !! the same without turns of nuts about their threads, which may be large
        type(value) :: distance                        !! from the world's origin before, the largest; at least the mechanism's size
    end type corrected_links

contains

    subroutine correct_links(model, group, place, correction, corrected)
        type(model_type), intent(in) :: model
        type(group_type), intent(in) :: group
        type(value), intent(in) :: place(:, :)         !! (place_size, link of the mechanism)
        type(value), intent(in) :: correction(:)       !! to be taken from there (row)
        type(corrected_links), intent(out) :: corrected
        type(value), dimension(link_freedom(model)) :: by, bounded
        integer :: i, n, n_shift

        n = link_freedom(model)
        n_shift = merge(2, 3, model%is_planar)
        allocate (corrected%place(place_size(model), size(group%link)))
        corrected%largest = zero()
        corrected%bounded = zero()
        corrected%distance = constant(group%size)
        do i = 1, size(group%link)
            associate (l => group%link(i), unit => group%unit(n*(i - 1) + 1:n*i))
                by = -correction(n*(i - 1) + 1:n*i)
                bounded = by
                corrected%place(:, i) = place(:, l)
                if (any(abs(group%thread_axis(:, i)) > 0)) then
                    call move_origin(group%thread_point(:, i), corrected%place(:, i), by)
                    call spin(group%thread_axis(:, i), corrected%place(:, i), by, bounded)
                    call move(bounded, corrected%place(:, i))
                    call move_origin(-group%thread_point(:, i), corrected%place(:, i))
                else
                    call move(bounded, corrected%place(:, i))
                end if
                call widen(corrected%largest, by, unit)
                call widen(corrected%bounded, bounded, unit)
                call widen(corrected%distance, place(:n_shift, l), spread(1.0_wp, 1, n_shift))
            end associate
        end do
    end subroutine correct_links

    !> Another point of a link for its origin, such as stays where it is as the link spins; shifts then are those of that point.
    subroutine move_origin(to, place, by)
        real(wp), intent(in) :: to(3)                  !! link axes
        type(value), intent(inout) :: place(:)         !! (7)
        type(value), intent(inout), optional :: by(:)  !! (6)
        type(vector) :: arm

        if (all(abs(to) <= 0)) return
        arm = rotation_by_quaternion(place(4:)) .rotate.vector_of(constant(to))
        place(:3) = place(:3) + components(arm)
        if (present(by)) by(:3) = by(:3) + components(vector_of(by(4:)) .cross.arm)
    end subroutine move_origin

    !> A nut on its thread: the turn about that first, exactly; whole turns, which change nothing, are taken off.
    subroutine spin(axis, place, by, bounded)
        real(wp), intent(in) :: axis(3)                !! link axes
        type(value), intent(inout) :: place(:)         !! (7)
        type(value), intent(inout) :: by(:)            !! (6)
        type(value), intent(out) :: bounded(:)         !! what of it is left (6)
        type(vector) :: about, own, imaginary
        type(value) :: angle, whole, s, c

        own = vector_of(constant(axis))
        about = rotation_by_quaternion(place(4:)) .rotate.own
        angle = vector_of(by(4:)) .dot.about
        whole = constant(two_pi)*nearest_whole(constant(1/two_pi)*angle)
        bounded(:3) = by(:3)
        bounded(4:) = components(vector_of(by(4:)) - angle*about)
        by(4:) = components(vector_of(by(4:)) - whole*about)
        s = sin(constant(0.5_wp)*(angle - whole))
        c = cos(constant(0.5_wp)*(angle - whole))
        ! about its own axis: from the right
        imaginary = vector_of(place(5:))
        place(5:) = c*place(5:) + s*components(place(4)*own + (imaginary .cross.own))
        place(4) = c*place(4) - s*(own .dot.imaginary)
    end subroutine spin

    !> A small shift and turn, in space about x, y, z of the world.
    subroutine move(by, place)
        type(value), intent(in) :: by(:)               !! (link_freedom)
        type(value), intent(inout) :: place(:)         !! (place_size)
        type(value) :: half(3), turned(4)

        if (size(place) == 3) then
            place = place + by
            return
        end if
        place(:3) = place(:3) + by(:3)
        ! (1, turn/2) times the quaternion
        half = constant(0.5_wp)*by(4:)
        turned(1) = place(4) - (half(1)*place(5) + half(2)*place(6) + half(3)*place(7))
        turned(2) = place(5) + (half(1)*place(4) + half(2)*place(7) - half(3)*place(6))
        turned(3) = place(6) + (half(2)*place(4) + half(3)*place(5) - half(1)*place(7))
        turned(4) = place(7) + (half(3)*place(4) + half(1)*place(6) - half(2)*place(5))
        place(4:) = (one()/sqrt(square(turned(1)) + square(turned(2)) + square(turned(3)) + square(turned(4))))*turned
    end subroutine move

    !> The largest velocity or angular velocity of a group's links and of those that they are joined to, lengths by their unit.
    function fastest(mechanism, group, rate) result(speed)
        type(mechanism_type), intent(in) :: mechanism
        type(group_type), intent(in) :: group
        type(value), intent(in) :: rate(:)             !! of the group's links (row)
        type(value) :: speed
        type(value) :: largest
        integer :: i, n, n_shift, side

        n = link_freedom(mechanism%model)
        n_shift = merge(2, 3, mechanism%model%is_planar)
        largest = zero()
        do i = 1, size(group%link)
            associate (of_link => rate(n*(i - 1) + 1:n*i))
                call note(of_link(:n_shift), of_link(n_shift + 1:), group%unit(n*(i - 1) + 1))
            end associate
        end do
        do i = 1, size(group%joint)
            do side = 1, 2
                associate (l => mechanism%model%joint(group%joint(i))%link(side))
                    if (l == 0 .or. any(group%link == l)) cycle
                    call note(components(mechanism%bodies%body(l)%velocity), &
                              components(omega_of(mechanism%bodies, l, world_axes)), &
                              max(group%size, reach_of(mechanism%model, group%joint, l)))
                end associate
            end do
        end do
        speed = sqrt(largest)

    contains

        subroutine note(shift, turn, unit)
            type(value), intent(in) :: shift(:), turn(:)
            real(wp), intent(in) :: unit               !! of shifts [m]

            largest = max(largest, max(constant(1/unit**2)*sum_of_squares(shift), sum_of_squares(turn)))
        end subroutine note
    end function fastest

    function sum_of_squares(x) result(s)
        type(value), intent(in) :: x(:)
        type(value) :: s
        integer :: k

        s = zero()
        do k = 1, size(x)
            s = s + square(x(k))
        end do
    end function sum_of_squares

    subroutine widen(largest, x, unit)
        type(value), intent(inout) :: largest
        type(value), intent(in) :: x(:)
        real(wp), intent(in) :: unit(:)
        integer :: i

        do i = 1, size(x)
            largest = max(largest, abs(constant(1/unit(i))*x(i)))
        end do
    end subroutine widen
end module linkdyn_corrected_links
