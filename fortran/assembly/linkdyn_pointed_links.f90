!> Legs and rods between links whose places are known point to where they end.
!>
!> What stands between a universal or ball joint at one known link and such a joint at another, a rod, or both halves of a leg with
!> its slide, is turned about the first so that its end lies towards the second. A platform whose start is given so has its legs
!> near to where they belong, and Newton's method keeps it there.
module linkdyn_pointed_links
    use linkdyn_cross, only: cross
    use linkdyn_joint_table, only: is_slide, turns_about_point
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state
    use linkdyn_lane_count, only: lanes
    use linkdyn_model, only: model_type, group_type, orientation_of, point_on
    use linkdyn_quaternion, only: turned_by, turned_vector
    use linkdyn_scene, only: joint_n_variable
    use linkdyn_vec3, only: lane_of, mat3_lane
    implicit none (type, external)
    private
    public :: point_links

    !> A link with the joint about which it is turned, the link that its slide carries, 0: none, and the joint at the end.
    type :: pointer_type
        integer :: link = 0, pivot = 0
        integer :: slides = 0
        integer :: end = 0
    end type pointer_type

contains

    !> Links of a group on a lane: those that the scene gives a start, and those that hang on known ones by joints that are given,
    !> are where they belong.
    subroutine point_links(model, group, lane, state)
        type(model_type), intent(in) :: model
        type(group_type), intent(in) :: group
        integer, intent(in) :: lane
        type(kinematic_state), intent(inout) :: state
        type(pointer_type) :: found
        logical :: is_known(0:model%n_link)
        integer :: i

        is_known = known_links(model, group)
        do i = 1, size(group%link)
            if (is_known(group%link(i))) cycle
            found = pointer_of(model, group%link(i), is_known)
            if (found%end > 0) call turn(model, group, lane, found, state)
        end do
    end subroutine point_links

    pure function known_links(model, group) result(is_known)
        type(model_type), intent(in) :: model
        type(group_type), intent(in) :: group
        logical :: is_known(0:model%n_link)
        integer :: i, round

        is_known = .true.
        is_known(group%link) = model%scene%link(group%link)%has_start
        do round = 1, size(group%link)
            do i = 1, size(group%joint)
                associate (joint => model%joint(group%joint(i)), n => joint_n_variable(model%joint(group%joint(i))%told_kind))
                    if (n == 0 .or. any(group%coordinate(:n, i) == 0)) cycle
                    if (any(is_known(joint%link))) is_known(joint%link) = .true.
                end associate
            end do
        end do
    end function known_links

    !> How a link is pivoted on a known one, and where it ends at another.
    pure function pointer_of(model, link, is_known) result(found)
        type(model_type), intent(in) :: model
        integer, intent(in) :: link
        logical, intent(in) :: is_known(0:)
        type(pointer_type) :: found
        integer :: k, m

        found%link = link
        found%pivot = pivot_at(link, 0)
        if (found%pivot == 0) return
        found%end = pivot_at(link, found%pivot)
        do k = model%first_at(link), model%first_at(link + 1) - 1
            if (found%end > 0) exit
            associate (joint => model%joint(model%joint_at(k)))
                m = sum(joint%link) - link
                if (is_known(m) .or. .not. is_slide(joint%told_kind, 1)) cycle
                found%slides = m
                found%end = pivot_at(m, found%pivot)
            end associate
        end do

    contains

        !> A universal or ball joint between a link and a known one, but not this joint; 0: there is none.
        pure integer function pivot_at(link, but) result(pivot)
            integer, intent(in) :: link, but
            integer :: k

            pivot = 0
            do k = model%first_at(link), model%first_at(link + 1) - 1
                associate (joint => model%joint(model%joint_at(k)))
                    if (model%joint_at(k) == but .or. .not. turns_about_point(joint%told_kind)) cycle
                    if (is_known(sum(joint%link) - link)) pivot = model%joint_at(k)
                end associate
            end do
        end function pivot_at
    end function pointer_of

    !> Move the pivot to its place, and turn link and slide about it.
    subroutine turn(model, group, lane, found, state)
        type(model_type), intent(in) :: model
        type(group_type), intent(in) :: group
        integer, intent(in) :: lane
        type(pointer_type), intent(in) :: found
        type(kinematic_state), intent(inout) :: state
        real(wp), dimension(3) :: pivot, moved, from, to, axis
        real(wp) :: along, across
        integer :: far, other, i

        far = merge(found%link, found%slides, found%slides == 0)
        other = sum(model%joint(found%pivot)%link) - found%link
        pivot = marker(found%pivot, other)
        moved = pivot - marker(found%pivot, found%link)
        from = marker(found%end, far) + moved - pivot
        to = marker(found%end, sum(model%joint(found%end)%link) - far) - pivot
        axis = cross(from, to)
        across = norm2(axis)
        along = dot_product(from, to)
        if (across > 0) axis = axis*(atan2(across, along)/across)
        do i = 1, merge(1, 2, found%slides == 0)
            associate (place => state%group%place(lane, :, merge(found%link, far, i == 1)))
                call put(place)
            end associate
        end do

    contains

        subroutine put(place)
            real(wp), intent(inout) :: place(:)
            real(wp) :: q(lanes, 4), position(3)

            q = turned_by(spread([1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp], 1, lanes), spread(axis, 1, lanes))
            position = place(:3) + moved - pivot
            place(:3) = pivot + turned_vector(q(1, :), position)
            q = turned_by(spread(place(4:7), 1, lanes), spread(axis, 1, lanes))
            place(4:7) = q(1, :)
        end subroutine put

        !> Place of a joint's marker on a link, in the world [m].
        function marker(j, l) result(at)
            integer, intent(in) :: j, l
            real(wp) :: at(3)

            associate (point => point_on(model%joint(j), l))
                if (any(group%link == l)) then
                    at = state%group%place(lane, :3, l) + turned_vector(state%group%place(lane, 4:7, l), point)
                else
                    at = lane_of(state%position(l), lane) + matmul(mat3_lane(state%rotation(orientation_of(model, l)), lane), point)
                end if
            end associate
        end function marker
    end subroutine turn
end module linkdyn_pointed_links
