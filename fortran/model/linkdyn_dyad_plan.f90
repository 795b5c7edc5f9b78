!> Recognise a planar dyad: two halves, each held to a known link, and to each other.
!>
!> A half is a link, or two that a slide holds together whose variable is given: a cylinder that is told its stroke is as rigid as
!> a rod. So a boom with its cylinder closes as two rods do. A half of which coordinates give a point, the tip of a robot, is held
!> to the link that they are seen from as by a hinge.
module linkdyn_dyad_plan
    use linkdyn_joint_table, only: is_partial, pose_position
    use linkdyn_model, only: model_type, step_type, leads_within
    use linkdyn_scene, only: joint_prismatic
    implicit none (type, external)
    private
    public :: find_dyad, turn_round

contains

    !> The dyad that some links make; `found` is false if they make none. Its kind is left open.
    pure subroutine find_dyad(model, member, known, given, step, found)
        type(model_type), intent(in) :: model
        integer, intent(in) :: member(:)         !! links to be placed
        logical, intent(in) :: known(0:)         !! links placed already
        integer, intent(in) :: given(:, :)       !! coordinate or what some lead that gives a variable; 0: none (3, joint)
        type(step_type), intent(out) :: step
        logical, intent(out) :: found
        integer, allocatable :: joint(:), led(:), free(:)
        integer :: half(0:model%n_link)          ! of a link: 1 holds the first link of the inner joint; 0: it is no member
        integer :: outer(2), inner, i, h

        found = .false.
        step%n_link = size(member)
        if (step%n_link < 2 .or. step%n_link > size(step%link)) return
        joint = joints_of(model, member, known)
        led = pack(joint, is_led(joint))
        free = pack(joint, .not. is_led(joint))
        if (size(free) /= 3 .or. size(led) /= size(member) - 2) return
        if (.not. all(holds_plainly(free))) return
        call halve(led, half)
        if (maxval(half) /= 2) return
        outer = 0
        inner = 0
        do i = 1, 3
            associate (l => model%joint(free(i))%link)
                if (all(half(l) > 0)) then
                    inner = free(i)
                else
                    outer(sum(half(l))) = free(i)
                end if
            end associate
        end do
        if (inner == 0 .or. any(outer == 0)) return
        if (half(model%joint(inner)%link(1)) == half(model%joint(inner)%link(2))) return
        step%joint(:3) = [outer(1), inner, outer(2)]
        if (half(model%joint(inner)%link(1)) == 2) step%joint(:3) = step%joint([3, 2, 1])
        do h = 1, 2
            associate (l => model%joint(step%joint(2*h - 1))%link)
                step%link(h) = merge(l(1), l(2), half(l(1)) > 0)
            end associate
            if (model%joint(step%joint(2*h - 1))%kind == pose_position) &
                step%coordinate(2*h + 1:2*h + 2) = given(:2, step%joint(2*h - 1))
        end do
        do i = 1, size(led)
            associate (l => model%joint(led(i))%link)
                step%joint(3 + i) = led(i)
                step%link(2 + i) = merge(l(2), l(1), any(step%link(:2) == l(1)))
                step%coordinate(i) = given(1, led(i))
            end associate
            ! what the dyad itself leads by gears is not known before it is closed
            if (given(1, led(i)) <= model%n_q) cycle
            if (any(leads_within(model%led(given(1, led(i)) - model%n_q), joint))) return
        end do
        ! a slide beside the way from hinge to hinge holds nothing of it
        found = all([(any(model%joint(inner)%link == step%link(2 + i)), i=1, size(led))])

    contains

        !> A slide between two members whose variable is given.
        elemental logical function is_led(j)
            integer, intent(in) :: j
            integer :: side

            is_led = model%joint(j)%kind == joint_prismatic .and. given(1, j) > 0 &
                     .and. all([(any(member == model%joint(j)%link(side)), side=1, 2)])
        end function is_led

        elemental logical function holds_plainly(j)
            integer, intent(in) :: j

            if (model%joint(j)%kind == pose_position) then
                holds_plainly = all(given(:2, j) > 0) .and. known(model%joint(j)%link(1))
            else
                holds_plainly = given(1, j) == 0 .and. .not. is_partial(model%joint(j)%kind) .and. model%joint(j)%cam == 0
            end if
        end function holds_plainly

        !> Members that a slide holds together are one half; no more than two are.
        pure subroutine halve(led, half)
            integer, intent(in) :: led(:)
            integer, intent(out) :: half(0:)
            integer :: k, s, n

            half = 0
            n = 0
            do k = 1, size(member)
                if (half(member(k)) > 0) cycle
                n = n + 1
                half(member(k)) = n
                do s = 1, size(led)
                    if (any(model%joint(led(s))%link == member(k))) half(model%joint(led(s))%link) = n
                end do
            end do
        end subroutine halve
    end subroutine find_dyad

    !> The same dyad, its second half first.
    pure subroutine turn_round(step)
        type(step_type), intent(inout) :: step

        step%link(:2) = step%link([2, 1])
        step%joint(:3) = step%joint([3, 2, 1])
        step%coordinate(3:6) = step%coordinate([5, 6, 3, 4])
    end subroutine turn_round

    !> Joints between some links, and from these to known ones; those last by which coordinates lead links.
    pure function joints_of(model, member, known) result(joint)
        type(model_type), intent(in) :: model
        integer, intent(in) :: member(:)
        logical, intent(in) :: known(0:)
        integer, allocatable :: joint(:)
        integer :: i, j, k, side

        allocate (joint(0))
        do i = 1, size(member)
            do k = model%first_at(member(i)), model%first_at(member(i) + 1) - 1
                associate (j => model%joint_at(k))
                    if (any(joint == j)) cycle
                    if (is_inside(j)) joint = [joint, j]
                end associate
            end do
        end do
        do j = model%n_joint + 1, size(model%joint)
            if (is_inside(j)) joint = [joint, j]
        end do

    contains

        pure logical function is_inside(j)
            integer, intent(in) :: j

            associate (link => model%joint(j)%link)
                is_inside = all([(known(link(side)) .or. any(member == link(side)), side=1, 2)]) &
                            .and. any([(any(member == link(side)), side=1, 2)])
            end associate
        end function is_inside
    end function joints_of
end module linkdyn_dyad_plan
