!> Along which directions the equations leave a joint's force, or its moment, open.
!>
!> States of self-stress act on a joint along some directions only; what of its force is square to these is determined, and exact.
!> In a planar four-bar drawn in space forces are open across the plane, moments about axes that lie in it. Which directions these
!> are is looked at in many poses. Where they stay in the world's axes, components of results are determined or not, one by one.
!> Else they may stay in the axes of the joint, or of a link: those axes are taken in which the fewest directions are open.
module linkdyn_open_directions
    use linkdyn_cross, only: cross
    use linkdyn_kinds, only: wp
    use linkdyn_model, only: open_part_type, axes_of_world, axes_of_joint, axes_of_link
    use linkdyn_null_space, only: find_null_space
    implicit none (type, external)
    private
    public :: open_part_of, whole_part, axes_along

contains

    !> Part of a joint's force, or moment, that is open, from many poses.
    function open_part_of(stress, frame, rotation, link, nothing) result(part)
        real(wp), intent(in) :: stress(:, :, :)         !! of each state, world axes (3, state, pose)
        real(wp), intent(in) :: frame(:, :, :)          !! of the joint's first marker, world axes (3, 3, pose)
        real(wp), intent(in) :: rotation(:, :, 0:, :)   !! of the links, 0 the frame (3, 3, link, pose)
        integer, intent(in) :: link(2)                  !! that the joint connects
        real(wp), intent(in) :: nothing                 !! a part of a state of self-stress that is rounding
        type(open_part_type) :: part
        integer :: l, p

        part = seen_in(rotation(:, :, 0, :), axes_of_world, 0)
        call take(seen_in(frame, axes_of_joint, 0))
        do l = 1, 2
            call take(seen_in(rotation(:, :, link(l), :), axes_of_link, link(l)))
        end do
        do l = 1, ubound(rotation, 3)
            call take(seen_in(rotation(:, :, l, :), axes_of_link, l))
        end do
        do p = 1, 3
            part%world(p) = maxval(abs(stress(p, :, :))) > nothing
        end do
        do p = 1, size(stress, 3)
            part%n_at_once = max(part%n_at_once, size(span_of(stress(:, :, p), nothing), 2))
        end do

    contains

        function seen_in(axes, sort, l) result(seen)
            real(wp), intent(in) :: axes(:, :, :)       !! (3, 3, pose)
            integer, intent(in) :: sort, l
            type(open_part_type) :: seen
            real(wp), allocatable :: basis(:, :)
            real(wp) :: turned(3, size(stress, 2), size(stress, 3))
            integer :: k

            do k = 1, size(stress, 3)
                turned(:, :, k) = matmul(transpose(axes(:, :, k)), stress(:, :, k))
            end do
            basis = span_of(reshape(turned, [3, size(stress, 2)*size(stress, 3)]), nothing)
            seen%n = size(basis, 2)
            seen%direction(:, :seen%n) = basis
            seen%axes = sort
            seen%link = l
        end function seen_in

        !> Fewer directions are a better answer; of as many, those along axes. Only the third of a joint's axes means something.
        subroutine take(seen)
            type(open_part_type), intent(in) :: seen
            logical :: along(3)

            along = axes_along(seen)
            if (seen%axes == axes_of_joint .and. (.not. any(along) .or. (along(1) .neqv. along(2)))) return
            if (seen%n > part%n) return
            if (seen%n == part%n .and. (any(axes_along(part)) .or. .not. any(along))) return
            part = seen
        end subroutine take
    end function open_part_of

    !> All of a joint's force, or moment: in a mechanism that was not seen in several poses.
    pure function whole_part(is_planar, is_moment) result(part)
        logical, intent(in) :: is_planar, is_moment
        type(open_part_type) :: part

        part%world = .true.
        if (is_planar) part%world = [.not. is_moment, .not. is_moment, is_moment]
        part%n = count(part%world)
        part%n_at_once = part%n
        part%direction(:, :part%n) = units(part%world)
    end function whole_part

    !> The axes between which all open directions lie; none if these lie askew.
    pure function axes_along(part) result(along)
        type(open_part_type), intent(in) :: part
        logical :: along(3)
        real(wp), parameter :: askew = 1.0e-6_wp
        real(wp) :: length(3)

        length = norm2(part%direction(:, :part%n), 2)
        along = length > 0.5_wp
        if (any(abs(length - merge(1.0_wp, 0.0_wp, along)) > askew)) along = .false.
    end function axes_along

    !> An orthonormal basis of what vectors span; axes, where it can be made of them.
    function span_of(vector, nothing) result(basis)
        real(wp), intent(in) :: vector(:, :)            !! (3, vector)
        real(wp), intent(in) :: nothing
        real(wp), allocatable :: basis(:, :)            !! (3, direction)
        real(wp), allocatable :: across(:, :)
        type(open_part_type) :: found
        real(wp) :: longest

        longest = maxval(norm2(vector, 1))
        if (longest > nothing) then
            call find_null_space(transpose(vector), min(0.5_wp, nothing/longest), across)
        else
            across = units(spread(.true., 1, 3))
        end if
        found%n = 3 - size(across, 2)
        select case (found%n)
        case (1)
            found%direction(:, 1) = cross(across(:, 1), across(:, 2))
        case (2)
            found%direction(:, 1) = square_to(across(:, 1))
            found%direction(:, 2) = cross(across(:, 1), found%direction(:, 1))
        case (3)
            found%direction = units(spread(.true., 1, 3))
        end select
        basis = found%direction(:, :found%n)
        if (any(axes_along(found))) basis = units(axes_along(found))
    end function span_of

    pure function square_to(axis) result(v)
        real(wp), intent(in) :: axis(3)                 !! unit vector
        real(wp) :: v(3)

        v = 0
        v(minloc(abs(axis), dim=1)) = 1
        v = v - dot_product(v, axis)*axis
        v = v/norm2(v)
    end function square_to

    !> Axes, one behind the other.
    pure function units(along)
        logical, intent(in) :: along(3)
        real(wp) :: units(3, count(along))
        integer :: k, n

        units = 0
        n = 0
        do k = 1, 3
            if (.not. along(k)) cycle
            n = n + 1
            units(k, n) = 1
        end do
    end function units
end module linkdyn_open_directions
