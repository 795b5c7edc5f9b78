!> Joints that are written in parts: two hinges whose axes cross at right angles, with the cross between them, are a universal
!> joint, three such hinges in a point, with two links between, a spherical one, a hinge and a slide along it, with the sleeve
!> between, a cylindrical one.
!>
!> Closed forms know of the whole joint. So, to whoever plans, it joins the links at both ends, and the links between are placed
!> when these are. Equations, reactions and measures keep the hinges as they are, and the mass of the link
!> between. A joined joint is one more in the model's list, as is one carried over from another link (`linkdyn_welded_links`).
module linkdyn_joined_joints
    use linkdyn_assur_groups, only: grouping_type, groups_of_links
    use linkdyn_cross, only: cross
    use linkdyn_joint_table, only: joint_revolute, joint_prismatic, joint_cylindrical, joint_universal, joint_spherical
    use linkdyn_kinds, only: wp
    use linkdyn_model, only: model_type, joint_type, side_of, list_joints_of_links
    use linkdyn_welded_links, only: without_rounding, without_rounding_at_zero
    implicit none (type, external)
    private
    public :: may_join, join_joints

    real(wp), parameter :: alignment = 64*epsilon(1.0_wp)   !! how far from exact a given direction may be by rounding

    !> A joint of the link between: its markers on that, and on the link at its other side.
    type :: half_type
        integer :: joint = 0
        integer :: beyond = 0                               !! that link
        real(wp) :: sense = 1                               !! -1: its variables count the other way than from the first half on
        real(wp) :: start = 0                               !! of its variable, counted so [m, rad]
        real(wp) :: point(3) = 0, own_point(3) = 0          !! axes of the link beyond, of that between [m]
        real(wp) :: frame(3, 3) = 0, own_frame(3, 3) = 0
    end type half_type

contains

    !> Is there a link in a group that may be one between?
    pure logical function may_join(model, grouping)
        type(model_type), intent(in) :: model
        type(grouping_type), intent(in) :: grouping

        may_join = .false.
        if (model%is_planar) return
        may_join = size(links_between(model, grouping, groups_of_links(grouping, model%n_link))) > 0
    end function may_join

    !> Links of groups that may be between.
    pure function links_between(model, grouping, order) result(link)
        type(model_type), intent(in) :: model
        type(grouping_type), intent(in) :: grouping
        integer, intent(in) :: order(0:)
        integer, allocatable :: link(:)
        integer :: g, i

        allocate (link(0))
        do g = 1, grouping%n_group
            if (grouping%first(g + 1) - grouping%first(g) < 2) cycle
            do i = grouping%first(g), grouping%first(g + 1) - 1
                if (is_between(model, grouping%member(i), order)) link = [link, grouping%member(i)]
            end do
        end do
    end function links_between

    !> Joints of a link with those that are placed before, or with it. What hangs on it besides follows, wherever it is.
    pure function holding_joints(model, link, order) result(joint)
        type(model_type), intent(in) :: model
        integer, intent(in) :: link, order(0:)
        integer, allocatable :: joint(:)
        integer :: k

        allocate (joint(0))
        do k = model%first_at(link), model%first_at(link + 1) - 1
            associate (j => model%joint_at(k))
                if (order(sum(model%joint(j)%link) - link) <= order(link)) joint = [joint, j]
            end associate
        end do
    end function holding_joints

    !> Is a link held by two hinges, or a hinge and a slide, of which nothing is given, and by nothing else?
    pure logical function is_between(model, link, order)
        type(model_type), intent(in) :: model
        integer, intent(in) :: link, order(0:)
        integer :: k

        is_between = size(holding_joints(model, link, order)) == 2
        if (.not. is_between) return
        associate (joint => model%joint(holding_joints(model, link, order)))
            is_between = all(joint%kind == joint_revolute .or. joint%kind == joint_prismatic) &
                         .and. any(joint%kind == joint_revolute) .and. all(joint%kind == joint%told_kind) &
                         .and. .not. any(is_told_of(model, joint%told)) &
                         .and. all(model%joint(model%n_joint + 1:)%link(1) /= link) &
                         .and. all(model%joint(model%n_joint + 1:)%link(2) /= link)
        end associate
        do k = 1, size(model%gear)
            is_between = is_between .and. all(model%joint(model%gear(k)%joint)%link /= link) .and. model%gear(k)%carrier /= link
        end do
    end function is_between

    !> Is a joint's variable a coordinate, or do gears count with it?
    elemental logical function is_told_of(model, j)
        type(model_type), intent(in) :: model
        integer, intent(in) :: j
        integer :: i

        is_told_of = any(model%scene%coordinate%joint == j)
        do i = 1, size(model%led)
            is_told_of = is_told_of .or. model%led(i)%joint == j .or. any(model%led(i)%source == j)
        end do
        do i = 1, size(model%loose)
            is_told_of = is_told_of .or. any(model%loose(i)%joint == j)
        end do
    end function is_told_of

    !> Join the joints of links between; balls first, of which universal joints are a part.
    subroutine join_joints(model, grouping, n_between)
        type(model_type), intent(inout) :: model
        type(grouping_type), intent(in) :: grouping
        integer, intent(out) :: n_between               !! links between
        integer :: order(0:model%n_link), i
        integer, allocatable :: link(:)

        n_between = 0
        order = groups_of_links(grouping, model%n_link)
        link = links_between(model, grouping, order)
        do i = 1, size(link)
            call join_at(model, link(i), order, link, n_between)
        end do
        do i = 1, size(link)
            call join_at(model, link(i), order, [integer ::], n_between)
        end do
        if (n_between > 0) call list_joints_of_links(model)
    end subroutine join_joints

    !> Join the joints of a link between, and with it of one of the others beside it, if there are some.
    subroutine join_at(model, link, order, others, n_between)
        type(model_type), intent(inout) :: model
        integer, intent(in) :: link, order(0:), others(:)
        integer, intent(inout) :: n_between
        type(joint_type) :: joined
        type(half_type) :: half(2), next(2)
        logical :: is_one

        call look_at_halves(model, link, order, half)
        if (any(model%joint(half%joint)%joined > 0)) return
        if (size(others) > 0) then
            if (any(model%joint(half%joint)%kind /= joint_revolute)) return
            if (all(others /= half(2)%beyond)) call reverse(half)
            if (all(others /= half(2)%beyond)) return
            call look_at_halves(model, half(2)%beyond, order, next)
            if (any(model%joint(next%joint)%joined > 0) .or. any(model%joint(next%joint)%kind /= joint_revolute)) return
            if (next(1)%joint /= half(2)%joint) call reverse(next)
            if (next(1)%joint /= half(2)%joint .or. half(1)%beyond == next(2)%beyond) return
            call make_spherical(half, next, joined, is_one)
            if (is_one) call add_joined(model, [half, next(2)], joined)
            if (is_one) n_between = n_between + 2
        else
            if (half(1)%beyond == half(2)%beyond) return
            if (model%joint(half(1)%joint)%kind == joint_prismatic) then
                call make_cylindrical(half, joined, is_one)
            else
                call make_universal(half, joined, is_one)
            end if
            if (is_one) call add_joined(model, half, joined)
            if (is_one) n_between = n_between + 1
        end if
    end subroutine join_at

    !> The same halves from the other end on.
    pure subroutine reverse(half)
        type(half_type), intent(inout) :: half(2)

        half = half([2, 1])
        half%sense = -half%sense
        half%start = -half%start
    end subroutine reverse

    !> Both joints of a link between, a slide first.
    pure subroutine look_at_halves(model, link, order, half)
        type(model_type), intent(in) :: model
        integer, intent(in) :: link, order(0:)
        type(half_type), intent(out) :: half(2)
        integer :: k, side

        half%joint = holding_joints(model, link, order)
        if (model%joint(half(2)%joint)%kind == joint_prismatic) half = half([2, 1])
        do k = 1, 2
            associate (joint => model%joint(half(k)%joint), of => half(k))
                side = side_of(joint, link)
                of%beyond = joint%link(3 - side)
                of%sense = merge(1, -1, side == 3 - k)
                of%start = of%sense*joint%start(1)
                of%point = joint%point(:, 3 - side)
                of%frame = joint%told_frame(:, :, 3 - side)
                of%own_point = joint%point(:, side)
                of%own_frame = joint%told_frame(:, :, side)
            end associate
        end do
    end subroutine look_at_halves

    !> Two hinges, if their axes cross at right angles.
    pure subroutine make_universal(half, joined, is_one)
        type(half_type), intent(in) :: half(2)
        type(joint_type), intent(out) :: joined
        logical, intent(out) :: is_one
        real(wp) :: across(3), apart(3), second(3), bound

        associate (z1 => half(1)%own_frame(:, 3), z2 => half(2)%own_frame(:, 3))
            apart = half(2)%own_point - half(1)%own_point
            bound = alignment*maxval(abs([half(1)%own_point, half(2)%own_point]))
            across = cross(z1, z2)
            is_one = abs(dot_product(z1, z2)) <= alignment .and. abs(dot_product(apart, across)) <= bound
            if (.not. is_one) return
            joined%kind = joint_universal
            joined%point(:, 1) = half(1)%point + dot_product(apart, z1)*half(1)%frame(:, 3)
            joined%point(:, 2) = half(2)%point - dot_product(apart, z2)*half(2)%frame(:, 3)
            ! angles are zero where those of the hinges are: y of the first marker is then the second axis, x the same for both
            second = matmul(half(1)%frame, matmul(z2, half(1)%own_frame))
            joined%frame(:, :, 1) = reshape([cross(second, half(1)%frame(:, 3)), second, half(1)%frame(:, 3)], [3, 3])
            joined%frame(:, :, 2) = matmul(half(2)%frame, matmul(transpose(half(2)%own_frame), &
                                                                 reshape([-across, -z1, z2], [3, 3])))
        end associate
    end subroutine make_universal

    !> Three hinges, if each axis crosses the next at right angles in the same point. How far the last link is turned counts from
    !> where the hinges' variables are those of their start.
    pure subroutine make_spherical(half, next, joined, is_one)
        type(half_type), intent(in) :: half(2), next(2)     !! of the first link between, of the second, which begins with the joint
                                                            !! where the first ends
        type(joint_type), intent(out) :: joined
        logical, intent(out) :: is_one
        type(joint_type) :: pair(2)
        real(wp) :: bound

        call make_universal(half, pair(1), is_one)
        if (.not. is_one) return
        call make_universal(next, pair(2), is_one)
        if (.not. is_one) return
        bound = alignment*maxval(abs([half(1)%own_point, half(2)%own_point, next(1)%own_point, next(2)%own_point]))
        ! along the middle hinge the first axis crosses it where the third does
        is_one = abs(dot_product(half(2)%own_point - half(1)%own_point, half(2)%own_frame(:, 3)) &
                     + dot_product(next(2)%own_point - next(1)%own_point, next(1)%own_frame(:, 3))) <= bound
        if (.not. is_one) return
        joined%kind = joint_spherical
        joined%point(:, 1) = pair(1)%point(:, 1)
        joined%point(:, 2) = pair(2)%point(:, 2)
        joined%frame(:, :, 1) = half(1)%frame
        joined%frame(:, :, 2) = matmul(turn_back(next(2)), matmul(turn_back(half(2)), &
                                                                  matmul(half(1)%own_frame, turned_back(half(1)%start))))
    end subroutine make_spherical

    !> From the axes of the link between to those of the link beyond a hinge that stands as at its start.
    pure function turn_back(half) result(turn)
        type(half_type), intent(in) :: half
        real(wp) :: turn(3, 3)

        turn = matmul(half%frame, matmul(turned_back(half%start), transpose(half%own_frame)))
    end function turn_back

    !> About z, by the angle less than zero.
    pure function turned_back(angle) result(turn)
        real(wp), intent(in) :: angle
        real(wp) :: turn(3, 3)

        turn = reshape([cos(angle), -sin(angle), 0.0_wp, sin(angle), cos(angle), 0.0_wp, 0.0_wp, 0.0_wp, 1.0_wp], [3, 3])
    end function turned_back

    !> A slide and a hinge, if their axes are parallel.
    pure subroutine make_cylindrical(half, joined, is_one)
        type(half_type), intent(in) :: half(2)
        type(joint_type), intent(out) :: joined
        logical, intent(out) :: is_one

        is_one = norm2(cross(half(1)%own_frame(:, 3), half(2)%own_frame(:, 3))) <= alignment
        if (.not. is_one) return
        joined%kind = joint_cylindrical
        joined%frame(:, :, 1) = half(1)%frame
        joined%point(:, 1) = half(1)%point + matmul(half(1)%frame, matmul(half(2)%own_point - half(1)%own_point, half(1)%own_frame))
        joined%frame(:, :, 2) = matmul(half(2)%frame, matmul(transpose(half(2)%own_frame), half(1)%own_frame))
        joined%point(:, 2) = half(2)%point
    end subroutine make_cylindrical

    !> The joint of all its parts behind the others.
    pure subroutine add_joined(model, half, joined)
        type(model_type), intent(inout) :: model
        type(half_type), intent(in) :: half(:)
        type(joint_type), intent(inout) :: joined
        integer :: k, last

        last = size(half)
        associate (first => model%joint(half(1)%joint))
            joined%name = first%name
            joined%told = first%told
            joined%first_variable = first%first_variable
        end associate
        joined%told_kind = joined%kind
        joined%frame = without_rounding(joined%frame, 1.0_wp)
        joined%told_frame = joined%frame
        joined%point = without_rounding_at_zero(joined%point, max(maxval(abs(joined%point)), norm2(half(1)%own_point), &
                                                                  norm2(half(last)%own_point)))
        joined%link = [half(1)%beyond, half(last)%beyond]
        joined%has_start = any(model%joint(half%joint)%has_start)
        if (joined%kind == joint_universal) joined%start(:2) = half%start
        if (joined%kind == joint_cylindrical) joined%start(:2) = [half(2)%start, half(1)%start]
        model%joint = [model%joint, joined]
        do k = 1, last
            model%joint(half(k)%joint)%joined = size(model%joint)
            model%joint(half(k)%joint)%part = k
        end do
    end subroutine add_joined
end module linkdyn_joined_joints
