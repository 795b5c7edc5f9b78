!> Links that are welded together in a loop: to whoever places links they are one body.
!>
!> One of them leads. What holds the others is *carried* over to it, through the welds: the same joint, as the leading link has it.
!> So a loop closes as if the links were one, in closed form where there is one, and the others follow, each by a weld from the
!> one that leads. Equations, reactions and measures keep the joints as they are: a carried joint is one more in the model's list,
!> behind those that hold something and those by which coordinates lead, and steps and groups of the plan name it in place of the
!> real one.
module linkdyn_welded_links
    use linkdyn_assur_groups, only: grouping_type, groups_of_links
    use linkdyn_joint_table, only: joint_fixed, is_geared
    use linkdyn_kinds, only: wp
    use linkdyn_model, only: model_type, joint_type, side_of, list_joints_of_links
    use linkdyn_scene, only: coordinate_pose
    implicit none (type, external)
    private
    public :: welds_in_groups, lead_welded_links, name_carried_joints, forget_carried_joints
    public :: without_rounding, without_rounding_at_zero

    real(wp), parameter :: plain = 4*epsilon(1.0_wp)    !! so near to what it would be without rounding a number is that

    !> The axes of a link as the leading one has them.
    type :: axes_type
        real(wp) :: r(3, 3) = reshape([1, 0, 0, 0, 1, 0, 0, 0, 1], [3, 3])
        real(wp) :: origin(3) = 0                       !! [m]
    end type axes_type

    !> What is welded together.
    type :: welded_set
        integer, allocatable :: link(:)                 !! the leading one first
        integer, allocatable :: weld(:)                 !! by which each is reached; of the leading one 0
        type(axes_type), allocatable :: axes(:)         !! (link)
    end type welded_set

contains

    !> Welds between links that are placed together.
    pure function welds_in_groups(model, grouping) result(weld)
        type(model_type), intent(in) :: model
        type(grouping_type), intent(in) :: grouping
        integer, allocatable :: weld(:)
        integer :: group(0:model%n_link), j

        group = groups_of_links(grouping, model%n_link)
        allocate (weld(0))
        if (.not. any(model%joint(:model%n_joint)%kind == joint_fixed)) return
        do j = 1, model%n_joint
            associate (l => model%joint(j)%link)
                if (model%joint(j)%kind /= joint_fixed .or. any(l == 0)) cycle
                if (group(l(1)) == group(l(2))) weld = [weld, j]
            end associate
        end do
    end function welds_in_groups

    !> Hang what holds welded links on one of them, and the others on that. Sets from which gears count stay as they are.
    subroutine lead_welded_links(model, weld, any_lead)
        type(model_type), intent(inout) :: model
        integer, intent(in) :: weld(:)
        logical, intent(out) :: any_lead
        type(welded_set) :: set
        logical :: is_seen(model%n_link)
        integer :: i, side

        any_lead = .false.
        is_seen = .false.
        do i = 1, size(weld)
            if (is_seen(model%joint(weld(i))%link(1))) cycle
            call collect(model, weld, leading_link(model, weld, model%joint(weld(i))%link(1)), set)
            is_seen(set%link) = .true.
            if (feeds_gears(model, set%link)) cycle
            call carry_joints(model, set)
            any_lead = .true.
        end do
        if (any_lead) call list_joints_of_links(model)
    end subroutine lead_welded_links

    !> The link of a set that leads: one that coordinates place, else one whose start the scene gives, else that with the most
    !> joints.
    integer function leading_link(model, weld, link) result(leading)
        type(model_type), intent(in) :: model
        integer, intent(in) :: weld(:), link            !! link: any of the set
        type(welded_set) :: set
        integer :: i, best, rank

        call collect(model, weld, link, set)
        leading = link
        best = -1
        do i = 1, size(set%link)
            associate (l => set%link(i))
                rank = model%first_at(l + 1) - model%first_at(l)
                if (model%scene%link(l)%has_start) rank = rank + model%n_joint
                if (is_led(l)) rank = rank + 2*model%n_joint
                if (is_posed(l)) rank = rank + 4*model%n_joint
                if (rank < best .or. (rank == best .and. l > leading)) cycle
                best = rank
                leading = l
            end associate
        end do

    contains

        pure logical function is_posed(l)
            integer, intent(in) :: l

            is_posed = any(model%scene%coordinate%kind == coordinate_pose .and. model%scene%coordinate%link == l)
        end function is_posed

        !> By a part of its pose?
        pure logical function is_led(l)
            integer, intent(in) :: l

            is_led = any(model%joint(model%n_joint + 1:)%link(2) == l)
        end function is_led
    end function leading_link

    !> All that welds join to a link, and where each stands on it.
    pure subroutine collect(model, weld, leading, set)
        type(model_type), intent(in) :: model
        integer, intent(in) :: weld(:), leading
        type(welded_set), intent(out) :: set
        integer :: i, k, next

        set%link = [leading]
        set%weld = [0]
        set%axes = [axes_type()]
        i = 0
        do while (i < size(set%link))
            i = i + 1
            do k = 1, size(weld)
                associate (joint => model%joint(weld(k)))
                    if (all(joint%link /= set%link(i))) cycle
                    next = sum(joint%link) - set%link(i)
                    if (any(set%link == next)) cycle
                    set%axes = [set%axes, axes_beyond(joint, side_of(joint, set%link(i)), set%axes(i))]
                    set%link = [set%link, next]
                    set%weld = [set%weld, weld(k)]
                end associate
            end do
        end do
    end subroutine collect

    !> The axes of the link beyond a weld. Those that are parallel are so exactly.
    pure function axes_beyond(weld, side, here) result(beyond)
        type(joint_type), intent(in) :: weld
        integer, intent(in) :: side                     !! of the link that is known
        type(axes_type), intent(in) :: here             !! its axes
        type(axes_type) :: beyond
        real(wp) :: turn(3, 3)

        associate (frame => weld%frame, point => weld%point)
            turn = reshape([1, 0, 0, 0, 1, 0, 0, 0, 1], [3, 3])
            if (any(frame(:, :, side) /= frame(:, :, 3 - side))) &
                turn = without_rounding(matmul(frame(:, :, side), transpose(frame(:, :, 3 - side))), 1.0_wp)
            beyond%r = without_rounding(matmul(here%r, turn), 1.0_wp)
            beyond%origin = here%origin + matmul(here%r, point(:, side) - matmul(turn, point(:, 3 - side)))
        end associate
    end function axes_beyond

    !> Numbers that would be whole multiples of a unit, were it not for rounding. A number that is not leaves kernels more to do.
    elemental real(wp) function without_rounding(x, unit) result(y)
        real(wp), intent(in) :: x, unit

        y = x
        if (abs(x - unit*anint(x/unit)) <= plain*unit) y = unit*anint(x/unit)
    end function without_rounding

    !> A number among others of such a size that would be zero.
    elemental real(wp) function without_rounding_at_zero(x, size) result(y)
        real(wp), intent(in) :: x, size

        y = merge(0.0_wp, x, abs(x) <= plain*size)
    end function without_rounding_at_zero

    !> Do gears count from joints of the set? By how much is said of the joints as they are.
    pure logical function feeds_gears(model, link)
        type(model_type), intent(in) :: model
        integer, intent(in) :: link(:)
        integer :: i

        feeds_gears = .false.
        do i = 1, size(model%led)
            feeds_gears = feeds_gears .or. any(is_held([model%led(i)%joint, model%led(i)%source]))
        end do
        do i = 1, size(model%loose)
            feeds_gears = feeds_gears .or. any(is_held(model%loose(i)%joint))
        end do

    contains

        elemental logical function is_held(j)
            integer, intent(in) :: j

            is_held = any(link == model%joint(j)%link(1)) .or. any(link == model%joint(j)%link(2))
        end function is_held
    end function feeds_gears

    !> The joints of a set's links as the leading one has them; welds lead from that to each of the others.
    subroutine carry_joints(model, set)
        type(model_type), intent(inout) :: model
        type(welded_set), intent(in) :: set
        integer :: j, side, i

        do j = 1, size(model%joint)
            if (is_geared(model%joint(j)%told_kind)) cycle
            i = findloc(set%weld, j, dim=1)
            if (i > 0) then
                call weld_to_leading(set, i, model%joint(j))
                cycle
            end if
            do side = 1, 2
                i = findloc(set%link, model%joint(j)%link(side), dim=1)
                if (i > 1) call carry_marker(set%link(1), set%axes(i), side, model%joint(j))
            end do
        end do
    end subroutine carry_joints

    pure subroutine carry_marker(leading, axes, side, joint)
        integer, intent(in) :: leading, side
        type(axes_type), intent(in) :: axes
        type(joint_type), intent(inout) :: joint

        associate (point => joint%point(:, side), scale => maxval(abs([axes%origin, joint%point(:, side)])))
            point = axes%origin + matmul(axes%r, point)
            point = without_rounding_at_zero(point, scale)
        end associate
        joint%frame(:, :, side) = without_rounding(matmul(axes%r, joint%frame(:, :, side)), 1.0_wp)
        joint%told_frame(:, :, side) = without_rounding(matmul(axes%r, joint%told_frame(:, :, side)), 1.0_wp)
        joint%link(side) = leading
    end subroutine carry_marker

    !> A weld between the leading link and the i-th, at the origin of this one.
    pure subroutine weld_to_leading(set, i, weld)
        type(welded_set), intent(in) :: set
        integer, intent(in) :: i
        type(joint_type), intent(inout) :: weld
        type(axes_type) :: axes

        axes = axes_type()
        weld%link = set%link([1, i])
        weld%point(:, 1) = set%axes(i)%origin
        weld%frame(:, :, 1) = set%axes(i)%r
        weld%point(:, 2) = axes%origin
        weld%frame(:, :, 2) = axes%r
        weld%told_frame = weld%frame
    end subroutine weld_to_leading

    !> Joints are as the scene has them again, and those that a plan has been made with follow behind them.
    subroutine name_carried_joints(model, real_joint)
        type(model_type), intent(inout) :: model        !! planned
        type(joint_type), intent(in) :: real_joint(:)
        integer :: name(0:size(model%joint)), i, j

        name = [(j, j=0, size(model%joint))]
        do j = 1, size(real_joint)
            if (is_real(model%joint(j), real_joint(j))) cycle
            model%joint = [model%joint, model%joint(j)]
            name(j) = size(model%joint)
            model%joint(name(j))%joined = 0
            model%joint(name(j))%part = 0
        end do
        do j = 1, size(real_joint)
            associate (leg => model%joint(j)%leg, attitude => model%joint(j)%attitude)
                model%joint(j) = real_joint(j)
                model%joint(j)%leg = leg
                model%joint(j)%attitude = attitude
            end associate
        end do
        do i = 1, size(model%step)
            model%step(i)%joint = name(model%step(i)%joint)
        end do
        do i = 1, size(model%group)
            model%group(i)%joint = name(model%group(i)%joint)
        end do
        call list_joints_of_links(model)

    contains

        pure logical function is_real(a, b)
            type(joint_type), intent(in) :: a, b

            is_real = all(a%link == b%link) .and. all(a%point == b%point) .and. all(a%frame == b%frame)
        end function is_real
    end subroutine name_carried_joints

    !> The model as it was before it was planned.
    subroutine forget_carried_joints(model)
        type(model_type), intent(inout) :: model
        integer :: j

        if (all(model%joint%told == [(j, j=1, size(model%joint))])) return
        model%joint = pack(model%joint, model%joint%told == [(j, j=1, size(model%joint))])
        call list_joints_of_links(model)
    end subroutine forget_carried_joints
end module linkdyn_welded_links
