!> The planner: orders links and joints, once, into the program of steps that the kinematics walks.
!>
!> Links whose pose is given are known. Counting constraints takes the rest apart into the smallest groups that can be
!> placed one after the other (`linkdyn_assur_groups`): a single link is a step of an open chain, a pair with three
!> joints a dyad or a leg with a closed form, any other group is left to Newton's method. A scene that cannot be
!> planned is refused with the names of the links and joints concerned.
module linkdyn_planner
    use linkdyn_assur_groups, only: tie_type, grouping_type, find_groups, most_tied
    use linkdyn_cross, only: cross
    use linkdyn_gearing, only: lead_by_loose, forget_loose
    use linkdyn_joint_table, only: n_transmitted, is_geared, is_partial, is_pose_part, variable_name, pose_position
    use linkdyn_joined_joints, only: may_join, join_joints
    use linkdyn_kinds, only: wp
    use linkdyn_csp_plan, only: find_csp
    use linkdyn_dyad_plan, only: find_dyad, turn_round
    use linkdyn_model, only: model_type, joint_type, number_attitudes, step_type, step_pose, step_joint, step_ups, step_rrr, &
        step_rrp, step_rpr, step_prp, step_ppr, step_group, step_parts, step_rod, step_hung, step_between, step_gimbal, side_of, &
        link_freedom, place_size, rod_of, inner_of_rod, outer_of_rod, universal_of_rod, turns_in_two, beyond_leg, orientation_of
    use linkdyn_redundancy, only: redundancy_type, find_redundancy
    use linkdyn_rod_plan, only: name_rod_leg
    use linkdyn_shift_plan, only: shift_type, find_shift, find_hung, n_pair
    use linkdyn_scene, only: coordinate_joint, coordinate_pose, joint_n_variable, joint_kind_name, joint_prismatic, &
        joint_cylindrical, joint_universal, joint_spherical, joint_fixed, share_refused, share_name
    use linkdyn_status, only: status_type, fail, status_bad_input
    use linkdyn_text, only: to_text, quoted
    use linkdyn_welded_links, only: welds_in_groups, lead_welded_links, name_carried_joints, forget_carried_joints
    implicit none (type, external)
    private
    public :: plan_steps, joint_constraints, mobility_of

    integer, parameter :: most_named = 6                    !! links or joints listed in a message
    real(wp), parameter :: alignment = 64*epsilon(1.0_wp)   !! how far from exact a given direction may be by rounding

    !> Progress of the planning.
    type :: planning
        type(step_type), allocatable :: step(:)
        integer :: n_step = 0
        integer :: n_group = 0
        real(wp), allocatable :: stand(:, :, :) !! how the links stand; absent: which way legs and rods do is chosen at the start
        logical, allocatable :: known(:)        !! (0:n_link)
        logical, allocatable :: is_used(:)      !! sums that gears keep and that have given a variable (loose)
        integer, allocatable :: given(:, :)     !! coordinate or what some lead that gives a variable; 0: none (3, n_joint)
    end type planning

contains

    !> Number of constraints of a joint.
    pure integer function joint_constraints(model, kind)
        type(model_type), intent(in) :: model
        integer, intent(in) :: kind

        joint_constraints = sum(n_transmitted(kind, model%is_planar))
    end function joint_constraints

    !> Mobility by counting: freedoms of the links less the constraints of the joints.
    pure integer function mobility_of(model)
        type(model_type), intent(in) :: model
        integer :: i

        mobility_of = link_freedom(model)*model%n_link
        do i = 1, model%n_joint
            mobility_of = mobility_of - joint_constraints(model, model%joint(i)%kind)
        end do
    end function mobility_of

    !> Fill `model%step`.
    subroutine plan_steps(model, status, closed_forms, stand, briefly)
        type(model_type), intent(inout) :: model
        type(status_type), intent(inout) :: status
        logical, intent(in), optional :: closed_forms    !! see `model_type`; absent: as the model was planned before
        real(wp), intent(in), optional :: stand(:, :, 0:)    !! axes and origins of the links at a pose (3, 4, 0:n_link): legs and
                                                         !! rods are closed as they stand there
        logical, intent(in), optional :: briefly         !! nobody will read why joints over-constrain their links: to find the
                                                         !! words takes longer than to plan; absent: false
        type(planning) :: plan
        type(grouping_type) :: grouping
        type(model_type) :: before
        integer, allocatable :: tie_coordinate(:), weld(:)
        logical :: is_planned, may_be_joined

        if (.not. status%is_ok()) return
        if (present(closed_forms)) model%closed_forms = closed_forms
        call forget_carried_joints(model)
        call find_order(model, stand, plan, grouping, tie_coordinate, status)
        if (.not. status%is_ok()) return
        if (grouping%excess > 0) call refuse_excess(model, grouping, tie_coordinate, status, briefly)
        if (grouping%lack > 0) call refuse_lack(model, grouping, status)
        if (.not. status%is_ok()) return
        weld = welds_in_groups(model, grouping)
        if (.not. model%closed_forms) weld = [integer ::]
        may_be_joined = model%closed_forms .and. may_join(model, grouping)
        if (size(weld) > 0 .or. may_be_joined) before = model
        is_planned = .false.
        if (size(weld) > 0) call plan_otherwise(before, weld, .false., model, is_planned, stand)
        if (.not. is_planned) call place_groups(model, grouping, plan, status)
        may_be_joined = status%is_ok() .and. (may_be_joined .or. is_planned)
        if (may_be_joined) may_be_joined = n_iterated(model) > 0
        if (may_be_joined) call plan_with_joined_joints(before, weld, model, stand)
    end subroutine plan_steps

    !> Joints that are written in parts are taken for whole ones where that leaves fewer links to iteration, besides those between
    !> the parts.
    subroutine plan_with_joined_joints(before, weld, model, stand)
        type(model_type), intent(in) :: before         !! not planned yet
        integer, intent(in) :: weld(:)                 !! see `plan_otherwise`
        type(model_type), intent(inout) :: model       !! planned
        real(wp), intent(in), optional :: stand(:, :, 0:)    !! see `plan_steps`
        type(model_type) :: joined
        logical :: is_planned

        call plan_otherwise(before, weld, .true., joined, is_planned, stand)
        if (.not. is_planned) return
        if (n_iterated(joined) + count(joined%step%kind == step_between .or. joined%step%kind == step_gimbal) < n_iterated(model)) &
            model = joined
    end subroutine plan_with_joined_joints

    !> Links closed by iteration.
    pure integer function n_iterated(model)
        type(model_type), intent(in) :: model
        integer :: g

        n_iterated = sum([(size(model%group(g)%link), g=1, size(model%group))])
    end function n_iterated

    !> The groups of links, in the order in which they can be placed.
    subroutine find_order(model, stand, plan, grouping, tie_coordinate, status)
        type(model_type), intent(inout) :: model
        real(wp), intent(in), optional :: stand(:, :, 0:)    !! see `plan_steps`
        type(planning), intent(out) :: plan
        type(grouping_type), intent(out) :: grouping
        integer, allocatable, intent(out) :: tie_coordinate(:)    !! see `list_ties`
        type(status_type), intent(inout) :: status
        type(tie_type), allocatable :: tie(:)

        if (present(stand)) allocate (plan%stand, source=stand)
        call forget_loose(model)
        allocate (plan%is_used(size(model%loose)), source=.false.)
        allocate (plan%step(model%n_link + 1), plan%known(0:model%n_link), plan%given(3, size(model%joint)))
        plan%known = .false.
        plan%known(0) = .true.
        call take_poses(model, plan, status)
        if (.not. status%is_ok()) return
        call list_ties(model, plan, tie, tie_coordinate)
        call find_groups(link_freedom(model), plan%known(1:), model%n_joint, tie, grouping)
    end subroutine find_order

    !> Find the steps that place the groups.
    subroutine place_groups(model, grouping, plan, status)
        type(model_type), intent(inout) :: model
        type(grouping_type), intent(in) :: grouping
        type(planning), intent(inout) :: plan
        type(status_type), intent(inout) :: status
        integer :: g

        allocate (model%group(model%n_link))
        do g = 1, grouping%n_group
            call place_group(model, grouping%member(grouping%first(g):grouping%first(g + 1) - 1), plan, status)
            if (.not. status%is_ok()) return
        end do
        model%step = plan%step(:plan%n_step)
        model%group = model%group(:plan%n_group)
        call number_attitudes(model)
        call mark_moved_links(model)
    end subroutine place_groups

    !> Plan with links that are welded together in a loop as one link, perhaps with joints in parts as one joint. If that leads to
    !> no plan, the model is left as it was before.
    subroutine plan_otherwise(before, weld, joins, model, is_planned, stand)
        type(model_type), intent(in) :: before         !! not planned yet
        integer, intent(in) :: weld(:)                 !! between links that are placed together
        logical, intent(in) :: joins                   !! joints in parts are one
        type(model_type), intent(inout) :: model
        logical, intent(out) :: is_planned
        real(wp), intent(in), optional :: stand(:, :, 0:)    !! see `plan_steps`
        type(planning) :: plan
        type(grouping_type) :: grouping
        type(status_type) :: status
        integer, allocatable :: tie_coordinate(:)
        integer :: n_between

        model = before
        call lead_welded_links(model, weld, is_planned)
        if (is_planned .or. joins) call find_order(model, stand, plan, grouping, tie_coordinate, status)
        if (joins .and. is_good()) then
            call join_joints(model, grouping, n_between)
            is_planned = n_between > 0
            if (is_planned) call find_order(model, stand, plan, grouping, tie_coordinate, status)
        end if
        is_planned = is_planned .and. is_good()
        if (is_planned) call place_groups(model, grouping, plan, status)
        is_planned = is_planned .and. is_good()
        if (is_planned) then
            call name_carried_joints(model, before%joint)
        else
            model = before
        end if

    contains

        pure logical function is_good()
            is_good = status%is_ok() .and. grouping%excess == 0 .and. grouping%lack == 0
        end function is_good
    end subroutine plan_otherwise

    subroutine add_step(plan, step)
        type(planning), intent(inout) :: plan
        type(step_type), intent(in) :: step

        plan%n_step = plan%n_step + 1
        plan%step(plan%n_step) = step
        plan%known(step%link(:step%n_link)) = .true.
    end subroutine add_step

    !> Links whose pose is given.
    subroutine take_poses(model, plan, status)
        type(model_type), intent(inout) :: model
        type(planning), intent(inout) :: plan
        type(status_type), intent(inout) :: status
        type(step_type) :: step
        integer :: given(6, model%n_link), needed(6), i, j

        needed = merge([1, 1, 0, 0, 0, 1], [1, 1, 1, 1, 1, 1], model%is_planar)
        given = 0
        do j = 1, model%n_q
            associate (c => model%scene%coordinate(j))
                if (c%kind == coordinate_pose) given(c%variable, c%link) = j
            end associate
        end do
        do i = 1, model%n_link
            if (all(given(:, i) == 0)) cycle
            if (any(needed == 1 .and. given(:, i) == 0)) then
                call fail(status, status_bad_input, "link "//quoted(model%link(i)%name) &
                          //": a pose needs all of "//trim(merge("x, y, yaw                ", "x, y, z, roll, pitch, yaw", &
                                                                 model%is_planar)))
                return
            end if
            step = step_type(kind=step_pose, n_link=1, coordinate=given(:, i))
            step%link(1) = i
            call add_step(plan, step)
        end do
    end subroutine take_poses

    !> Joints, then coordinates given at joints, as constraints between links; known links are link 0.
    subroutine list_ties(model, plan, tie, tie_coordinate)
        type(model_type), intent(in) :: model
        type(planning), intent(inout) :: plan
        type(tie_type), allocatable, intent(out) :: tie(:)
        integer, allocatable, intent(out) :: tie_coordinate(:)    !! beyond the coordinates what they lead by gears; 0: a joint
        integer :: j, n

        n = model%n_joint + model%n_q + size(model%led) + size(model%loose)
        allocate (tie(n), tie_coordinate(n))
        tie_coordinate = 0
        plan%given = 0
        do j = 1, model%n_joint
            tie(j) = tie_type(unknown_links(j), joint_constraints(model, model%joint(j)%kind))
            ! the ties of gears are in the variables that they lead
            if (is_geared(model%joint(j)%told_kind)) tie(j) = tie_type()
            if (model%joint(j)%joined > 0) tie(j) = tie_of_part(j)
        end do
        n = model%n_joint
        do j = 1, model%n_q
            associate (c => model%scene%coordinate(j))
                if (c%kind /= coordinate_joint) cycle
                n = n + 1
                tie(n) = tie_type(unknown_links(c%joint), 1)
                tie_coordinate(n) = j
                plan%given(c%variable, c%joint) = j
            end associate
        end do
        do j = 1, size(model%led)
            n = n + 1
            tie(n) = tie_type(unknown_links(model%led(j)%joint), 1)
            tie_coordinate(n) = model%n_q + j
            plan%given(model%led(j)%variable, model%led(j)%joint) = model%n_q + j
        end do
        do j = 1, size(model%loose)
            n = n + 1
            tie(n) = tie_type(tied_links(model%loose(j)%joint), 1)
            tie_coordinate(n) = model%n_q + size(model%led) + j
        end do
        tie = tie(:n)
        tie_coordinate = tie_coordinate(:n)

    contains

        !> The joint whose parts are given ties the links at both ends, and each link between to what tells where it is.
        pure type(tie_type) function tie_of_part(j) result(tie)
            integer, intent(in) :: j

            associate (whole => model%joint(j)%joined)
                select case (model%joint(j)%part)
                case (1)
                    tie = tie_type(unknown_links(whole), joint_constraints(model, model%joint(whole)%kind))
                case (2)
                    tie = tie_type(tied_links([model%joint(whole)%told, whole]), link_freedom(model))
                case default
                    tie = tie_type(tied_links([j, part_of(model, whole, 2)]), link_freedom(model))
                end select
            end associate
        end function tie_of_part

        pure function unknown_links(joint) result(link)
            integer, intent(in) :: joint
            integer :: link(most_tied)

            link = tied_links([joint])
        end function unknown_links

        !> The unknown ones among the links of some joints, each once.
        pure function tied_links(joint) result(link)
            integer, intent(in) :: joint(:)
            integer :: link(most_tied)
            integer :: i, side, n

            link = 0
            n = 0
            do i = 1, size(joint)
                do side = 1, 2
                    associate (l => model%joint(joint(i))%link(side))
                        if (plan%known(l) .or. any(link == l) .or. n == most_tied) cycle
                        n = n + 1
                        link(n) = l
                    end associate
                end do
            end do
        end function tied_links
    end subroutine list_ties

    ! ---------------------------------------------------------------- groups

    !> Find the step that places a group.
    subroutine place_group(model, member, plan, status)
        type(model_type), intent(inout) :: model
        integer, intent(in) :: member(:)
        type(planning), intent(inout) :: plan
        type(status_type), intent(inout) :: status
        integer :: n_before

        n_before = plan%n_step
        if (size(member) == 1) call lead_link(model, member(1), plan)
        call lead_in_group(model, member, plan)
        if (model%closed_forms) call place_directly()
        if (status%is_ok() .and. plan%n_step == n_before) call add_newton_group(model, member, plan, status)
        call refuse_gear_in_group(model, plan, status)

    contains

        !> By an open chain or a closed form, if there is one.
        subroutine place_directly()
            if (size(member) == 1) call extend_open_chain(model, member(1), plan, status)
            if (size(member) == 1 .and. plan%n_step == n_before) call place_by_parts(model, member(1), plan)
            if (size(member) == 1 .and. plan%n_step == n_before) call close_between(model, member(1), plan)
            if (model%is_planar) call close_dyad(model, member, plan, status)
            if (.not. model%is_planar .and. size(member) == 2) then
                call close_leg(model, member, plan)
                if (plan%n_step == n_before) call close_csp_group(model, member, plan)
                if (plan%n_step == n_before) call close_rod_leg(model, member, plan)
            end if
            if (.not. model%is_planar .and. size(member) > 2) then
                call close_shift(model, member, plan)
                if (plan%n_step == n_before) call close_hung(model, member, plan)
            end if
        end subroutine place_directly
    end subroutine place_group

    !> Gears from links that are placed already may give the variable of a joint that a link hangs on.
    subroutine lead_link(model, link, plan)
        type(model_type), intent(inout) :: model
        integer, intent(in) :: link
        type(planning), intent(inout) :: plan
        integer :: i, k, j, s

        do i = 1, size(model%loose)
            if (plan%is_used(i)) cycle
            do k = 1, size(model%loose(i)%joint)
                j = model%loose(i)%joint(k)
                if (all(model%joint(j)%link /= link)) cycle
                if (.not. plan%known(model%joint(j)%link(3 - side_of(model%joint(j), link)))) cycle
                if (count([(.not. all(plan%known(model%joint(model%loose(i)%joint(s))%link)), &
                            s=1, size(model%loose(i)%joint))]) > 1) cycle
                call lead_by_sum(model, i, j, plan)
                return
            end do
        end do
    end subroutine lead_link

    !> A group may close by way of gears: each such sum gives the variable of one of the group's joints from the others in it, which
    !> are placed before, or with it.
    subroutine lead_in_group(model, member, plan)
        type(model_type), intent(inout) :: model
        integer, intent(in) :: member(:)
        type(planning), intent(inout) :: plan
        logical :: is_here(0:model%n_link)
        integer :: i, k, j, s, best

        is_here = plan%known
        is_here(member) = .true.
        do i = 1, size(model%loose)
            if (plan%is_used(i)) cycle
            if (.not. all([(all(is_here(model%joint(model%loose(i)%joint(s))%link)), s=1, size(model%loose(i)%joint))])) cycle
            ! the one that turns most: whole turns of the others are likelier whole ones of it, and need not be counted
            best = 0
            do k = 1, size(model%loose(i)%joint)
                j = model%loose(i)%joint(k)
                if (all(plan%known(model%joint(j)%link)) .or. plan%given(1, j) > 0) cycle
                if (best > 0) then
                    if (abs(model%loose(i)%part(k)) >= abs(model%loose(i)%part(best))) cycle
                end if
                best = k
            end do
            if (best > 0) call lead_by_sum(model, i, model%loose(i)%joint(best), plan)
        end do
    end subroutine lead_in_group

    !> Sum i gives the variable of joint j.
    subroutine lead_by_sum(model, i, j, plan)
        type(model_type), intent(inout) :: model
        integer, intent(in) :: i, j
        type(planning), intent(inout) :: plan

        call lead_by_loose(model, i, j)
        plan%is_used(i) = .true.
        plan%given(1, j) = model%n_q + size(model%led)
    end subroutine lead_by_sum

    !> Gears by which a group would have to close are not taken.
    subroutine refuse_gear_in_group(model, plan, status)
        type(model_type), intent(in) :: model
        type(planning), intent(in) :: plan
        type(status_type), intent(inout) :: status
        integer :: i, s

        do i = 1, size(model%loose)
            if (.not. status%is_ok()) return
            if (plan%is_used(i)) cycle
            if (.not. all([(all(plan%known(model%joint(model%loose(i)%joint(s))%link)), s=1, size(model%loose(i)%joint))])) cycle
            associate (gear => model%joint(model%gear(model%loose(i)%gear)%joint))
                call fail(status, status_bad_input, trim(joint_kind_name(gear%kind))//" "//quoted(gear%name) &
                          //": a loop would have to close by it, which is not done (expected a coordinate among the variables of " &
                          //"joints "//joint_names(model, model%loose(i)%joint) &
                          //", or coordinates that place their links one after the other)")
            end associate
        end do
    end subroutine refuse_gear_in_group

    !> A link behind a joint from a known link whose variables are all coordinates.
    subroutine extend_open_chain(model, link, plan, status)
        type(model_type), intent(inout) :: model
        integer, intent(in) :: link
        type(planning), intent(inout) :: plan
        type(status_type), intent(inout) :: status
        type(step_type) :: step
        integer :: i, j, n

        do i = model%first_at(link), model%first_at(link + 1) - 1
            j = model%joint_at(i)
            associate (joint => model%joint(j))
                n = joint_n_variable(joint%kind)
                if (is_partial(joint%kind) .or. joint%cam > 0) cycle
                if (any(plan%given(:n, j) == 0) .or. .not. plan%known(joint%link(3 - side_of(joint, link)))) cycle
                step = step_type(kind=step_joint, n_link=1)
                step%link(1) = link
                step%joint(1) = j
                step%from_second = side_of(joint, link) == 1
                step%coordinate(:n) = plan%given(:n, j)
                if (step%from_second .and. n > 1 .and. joint%kind /= joint_cylindrical) then
                    call fail(status, status_bad_input, "joint "//quoted(joint%name)//": its coordinates need link " &
                              //quoted(model%link(joint%link(1))%name)//" to be known first; exchange the two markers of 'between'")
                    return
                end if
            end associate
            call add_step(plan, step)
            if (model%joint(j)%kind == joint_fixed) call turn_follower(model, j, link)
            return
        end do
    end subroutine extend_open_chain

    !> A link that is welded on may turn as one that is placed beside it: as the one that it follows does, or in axes that nobody
    !> else has.
    pure subroutine turn_follower(model, weld, link)
        type(model_type), intent(inout) :: model
        integer, intent(in) :: weld, link

        if (model%link(link)%orientation == orientation_of(model, sum(model%joint(weld)%link) - link)) return
        call turn_by_itself(model, link)
    end subroutine turn_follower

    !> Let a link turn in axes that nobody else has.
    pure subroutine turn_by_itself(model, link)
        type(model_type), intent(inout) :: model
        integer, intent(in) :: link

        associate (o => model%link(link)%orientation)
            if (o > 0 .and. count(model%link%orientation == o) == 1) return
            model%n_orientation = model%n_orientation + 1
            o = model%n_orientation
        end associate
    end subroutine turn_by_itself

    !> A link whose pose is given by its parts, all of them as one known link sees them: one of its points, say, or bit by bit.
    subroutine place_by_parts(model, link, plan)
        type(model_type), intent(in) :: model
        integer, intent(in) :: link
        type(planning), intent(inout) :: plan
        type(step_type) :: step
        logical :: needed(6)
        integer :: part(2), i, j

        part = 0
        do j = model%n_joint + 1, size(model%joint)
            associate (joint => model%joint(j))
                if (joint%link(2) /= link .or. all(plan%given(:, j) == 0)) cycle
                if (.not. plan%known(joint%link(1))) return
                i = merge(1, 2, joint%kind == pose_position)
                if (part(i) > 0) return
                part(i) = j
            end associate
        end do
        if (any(part == 0)) return
        if (model%joint(part(1))%link(1) /= model%joint(part(2))%link(1)) return
        step = step_type(kind=step_parts, n_link=1, coordinate=[plan%given(:, part(1)), plan%given(:, part(2))])
        step%link(1) = link
        step%joint(:2) = part
        needed = .true.
        if (model%is_planar) needed(3:5) = .false.
        if (any(needed .neqv. step%coordinate > 0)) return
        call add_step(plan, step)
    end subroutine place_by_parts

    !> A cross or sleeve between known links, whose joints are one to whoever has placed these; or the first of two links between.
    subroutine close_between(model, link, plan)
        type(model_type), intent(inout) :: model
        integer, intent(in) :: link
        type(planning), intent(inout) :: plan
        type(step_type) :: step
        integer :: j, k, whole, first

        whole = 0
        first = 0
        do j = 1, model%n_joint
            if (model%joint(j)%joined == 0 .or. all(model%joint(j)%link /= link)) cycle
            if (whole > 0) first = min(first, model%joint(j)%part)
            if (whole == 0) first = model%joint(j)%part
            whole = model%joint(j)%joined
        end do
        if (whole == 0) return
        step = step_type(kind=step_between, n_link=1)
        step%link(1) = link
        if (model%joint(whole)%kind == joint_spherical .and. first == 1) then
            step%kind = step_gimbal
            step%joint(:3) = [(part_of(model, whole, k), k=1, 3)]
            step%turn = 1
            if (allocated(plan%stand)) step%turn = gimbal_as_it_stands(model, plan%stand, step%joint(:3), link)
        else
            step%joint(:2) = [(part_of(model, whole, k), k=first, first + 1)]
        end if
        call add_step(plan, step)
        call turn_follower(model, step%joint(1), link)
    end subroutine close_between

    !> A part of a joint in parts.
    pure integer function part_of(model, whole, k) result(j)
        type(model_type), intent(in) :: model
        integer, intent(in) :: whole, k

        j = findloc(model%joint%joined == whole .and. model%joint%part == k, .true., dim=1)
    end function part_of

    !> +1 where the second of three hinges points as first x third does, or -1.
    pure integer function gimbal_as_it_stands(model, stand, hinge, link) result(turn)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: stand(:, :, 0:)        !! (3, 4, 0:n_link)
        integer, intent(in) :: hinge(3)
        integer, intent(in) :: link                    !! between the first two
        integer :: beyond

        beyond = sum(model%joint(hinge(2))%link) - link
        turn = merge(1, -1, dot_product(axis_on(2, link), cross(axis_on(1, link), axis_on(3, beyond))) > 0)

    contains

        pure function axis_on(k, link) result(axis)
            integer, intent(in) :: k, link
            real(wp) :: axis(3)

            axis = matmul(stand(:, :3, link), model%joint(hinge(k))%frame(:, 3, side_of(model%joint(hinge(k)), link)))
        end function axis_on
    end function gimbal_as_it_stands

    !> The three joints of a pair of links: to a known link, between them, to a known link. Zero if there are others.
    pure function joints_of_pair(model, pair, plan) result(joint)
        type(model_type), intent(in) :: model
        integer, intent(in) :: pair(2)
        type(planning), intent(in) :: plan
        integer :: joint(3)
        integer :: side, i, j, other, place

        joint = 0
        do side = 1, 2
            do i = model%first_at(pair(side)), model%first_at(pair(side) + 1) - 1
                j = model%joint_at(i)
                other = model%joint(j)%link(3 - side_of(model%joint(j), pair(side)))
                place = 0
                if (other == pair(3 - side)) then
                    place = 2
                else if (plan%known(other)) then
                    place = 2*side - 1
                end if
                if (place == 0) cycle
                if (joint(place) /= 0 .and. joint(place) /= j) then
                    joint = 0
                    return
                end if
                joint(place) = j
            end do
        end do
        if (any(joint == 0)) joint = 0
    end function joints_of_pair

    !> A planar dyad: by its signature of revolute and prismatic joints.
    subroutine close_dyad(model, member, plan, status)
        type(model_type), intent(inout) :: model
        integer, intent(in) :: member(:)
        type(planning), intent(inout) :: plan
        type(status_type), intent(inout) :: status
        type(step_type) :: step
        logical :: found
        character(len=3) :: signature

        call find_dyad(model, member, plan%known, plan%given, step, found)
        if (.not. found) return
        signature = signature_of(model, step)
        if (signature == "PRR" .or. signature == "RPP") then
            call turn_round(step)
            signature = signature_of(model, step)
        end if
        select case (signature)
        case ("RRR")
            step%kind = step_rrr
        case ("RRP")
            step%kind = step_rrp
        case ("RPR")
            step%kind = step_rpr
        case ("PRP")
            step%kind = step_prp
        case ("PPR")
            step%kind = step_ppr
        case default
            call fail(status, status_bad_input, "links "//link_names(model, member)//" are held by three slides, " &
                      //joint_names(model, step%joint(:3))//", which leave a shift free and fix the angle twice " &
                      //"(expected a revolute joint among them)")
            return
        end select
        model%n_dyad = model%n_dyad + 1
        model%n_branch = model%n_dyad
        step%first = model%n_dyad
        step%has_branches = any(step%kind == [step_rrr, step_rrp, step_rpr])
        step%has_margin = step%has_branches .or. step%kind == step_prp
        call add_step(plan, step)
    end subroutine close_dyad

    pure function signature_of(model, step) result(signature)
        type(model_type), intent(in) :: model
        type(step_type), intent(in) :: step
        character(len=3) :: signature
        integer :: i

        do i = 1, 3
            signature(i:i) = merge("P", "R", model%joint(step%joint(i))%kind == joint_prismatic)
        end do
    end function signature_of

    !> Any other group.
    subroutine add_newton_group(model, member, plan, status)
        type(model_type), intent(inout) :: model
        integer, intent(in) :: member(:)
        type(planning), intent(inout) :: plan
        type(status_type), intent(inout) :: status
        type(step_type) :: step
        logical :: is_member(0:model%n_link)
        integer :: i, j, l

        plan%n_group = plan%n_group + 1
        is_member = .false.
        is_member(member) = .true.
        associate (group => model%group(plan%n_group))
            group%link = member
            allocate (group%joint(0))
            do i = 1, size(member)
                l = member(i)
                do j = model%first_at(l), model%first_at(l + 1) - 1
                    associate (joint => model%joint(model%joint_at(j)))
                        if (.not. all(is_member(joint%link) .or. plan%known(joint%link))) cycle
                        if (all(is_member(joint%link)) .and. joint%link(2) == l) cycle    ! listed from its first link
                        group%joint = [group%joint, model%joint_at(j)]
                    end associate
                end do
            end do
            do j = model%n_joint + 1, size(model%joint)
                if (.not. is_pose_part(model%joint(j)%kind)) cycle
                if (any(is_member(model%joint(j)%link)) .and. all(is_member(model%joint(j)%link) &
                    .or. plan%known(model%joint(j)%link))) group%joint = [group%joint, j]
            end do
            group%coordinate = plan%given(:, group%joint)
            allocate (group%start(place_size(model), size(member)))
            group%turns = [(has_own_orientation(i), i=1, size(member))]
            do i = 1, size(group%joint)
                associate (joint => model%joint(group%joint(i)))
                    if (joint%kind == joint_spherical .and. any(group%coordinate(:, i) > 0)) &
                        call fail(status, status_bad_input, "joint "//quoted(joint%name)//": the angles of a spherical " &
                                  //"joint can be coordinates in an open chain only")
                end associate
            end do
        end associate
        step = step_type(kind=step_group, n_link=0, first=plan%n_group)
        call add_step(plan, step)
        plan%known(member) = .true.

    contains

        !> Or that of a link placed before, or of another of the group's?
        pure logical function has_own_orientation(i)
            integer, intent(in) :: i
            integer :: o, l

            o = model%link(member(i))%orientation
            has_own_orientation = o > 0 .and. all(model%link(member(:i - 1))%orientation /= o)
            do l = 1, model%n_link
                if (plan%known(l) .and. model%link(l)%orientation == o) has_own_orientation = .false.
            end do
        end function has_own_orientation
    end subroutine add_newton_group

    !> A CSP group between known links.
    subroutine close_csp_group(model, member, plan)
        type(model_type), intent(inout) :: model
        integer, intent(in) :: member(2)
        type(planning), intent(inout) :: plan
        type(step_type) :: step
        logical :: found

        call find_csp(model, plan%known, step, found)
        if (.not. found) return
        if (all(step%link(1) /= member) .or. all(step%link(2) /= member)) return
        model%n_branch = model%n_branch + 1
        step%first = model%n_branch
        step%has_branches = .true.
        step%has_margin = .true.
        call add_step(plan, step)
    end subroutine close_csp_group

    !> A crank or carriage and the rod behind it, between known links. The rod turns in axes that nobody else has.
    subroutine close_rod_leg(model, member, plan)
        type(model_type), intent(inout) :: model
        integer, intent(in) :: member(2)
        type(planning), intent(inout) :: plan
        type(step_type) :: step
        logical :: found

        step = step_type(n_link=2)
        step%link(:2) = member
        step%joint(:3) = joints_of_pair(model, member, plan)
        if (any(step%joint(:3) == 0)) return
        if (any(plan%given(:, step%joint(:3)) > 0)) return
        call name_rod_leg(model, step, found)
        if (found) call add_rod_leg(model, step, plan)
    end subroutine close_rod_leg

    subroutine add_rod_leg(model, leg, plan)
        type(model_type), intent(inout) :: model
        type(step_type), intent(in) :: leg             !! links, joints and kind
        type(planning), intent(inout) :: plan
        type(step_type) :: step

        step = leg
        step%has_branches = .true.
        call add_margin(model, step)
        call add_rod(model, step, plan)
    end subroutine add_rod_leg

    subroutine add_margin(model, step)
        type(model_type), intent(inout) :: model
        type(step_type), intent(inout) :: step

        model%n_branch = model%n_branch + 1
        step%first = model%n_branch
        step%has_margin = .true.
    end subroutine add_margin

    !> Whatever else there is in the step, its rod turns in axes that nobody else has.
    subroutine add_rod(model, step, plan)
        type(model_type), intent(inout) :: model
        type(step_type), intent(inout) :: step
        type(planning), intent(inout) :: plan

        step%turn = 1
        if (allocated(plan%stand)) step%turn = turn_as_it_stands(model, plan%stand, universal_of_rod(model, step), rod_of(step), &
            point_as_it_stands(model, plan%stand, outer_of_rod(step), rod_of(step)) &
            - point_as_it_stands(model, plan%stand, inner_of_rod(step), rod_of(step)))
        call add_step(plan, step)
        call turn_by_itself(model, rod_of(step))
    end subroutine add_rod

    !> A platform that parallel rods keep from turning, led by where it is: itself, its legs of lead and one rod each, then the
    !> other rods, of which the last tells how surely all of them hold it.
    subroutine close_shift(model, member, plan)
        type(model_type), intent(inout) :: model
        integer, intent(in) :: member(:)
        type(planning), intent(inout) :: plan
        type(shift_type) :: shift
        type(step_type) :: step
        logical :: found
        integer :: i

        call find_shift(model, member, plan%known, plan%given, shift, found)
        if (.not. found) return
        step = step_type(kind=step_parts, n_link=1, stance=shift%stance)
        step%link(1) = shift%platform
        step%joint(1) = shift%position
        step%coordinate(:3) = plan%given(:, shift%position)
        call add_step(plan, step)
        call turn_by_itself(model, shift%platform)
        do i = 1, n_pair
            call add_rod_leg(model, shift%leg(1, i), plan)
        end do
        do i = 1, n_pair
            call add_lone_rod(model, shift, 2, i, plan)
        end do
    end subroutine close_shift

    !> The same platform where its leads are known: itself, by one rod of each pair, then these and the other rods.
    subroutine close_hung(model, member, plan)
        type(model_type), intent(inout) :: model
        integer, intent(in) :: member(:)
        type(planning), intent(inout) :: plan
        type(shift_type) :: shift
        type(step_type) :: step
        logical :: found
        integer :: i, k

        call find_hung(model, member, plan%known, plan%given, shift, found)
        if (.not. found) return
        step = step_type(kind=step_hung, n_link=1, has_branches=.true., stance=shift%stance)
        step%link(1) = shift%platform
        step%joint(:2*n_pair + 1) = [(shift%leg(1, i)%joint(2:3), i=1, n_pair), shift%leg(1, 1)%joint(1)]
        call add_margin(model, step)
        call add_step(plan, step)
        call turn_by_itself(model, shift%platform)
        do k = 1, shift%n_rod
            do i = 1, n_pair
                call add_lone_rod(model, shift, k, i, plan)
            end do
        end do
    end subroutine close_hung

    !> Rod k of a pair, both ends of which are known; the last of all has the margin of what holds the platform's attitude.
    subroutine add_lone_rod(model, shift, k, pair, plan)
        type(model_type), intent(inout) :: model
        type(shift_type), intent(in) :: shift
        integer, intent(in) :: k, pair
        type(planning), intent(inout) :: plan
        type(step_type) :: step
        integer :: i

        step = step_type(kind=step_rod, n_link=1)
        step%link(1) = rod_of(shift%leg(k, pair))
        step%joint(:2) = shift%leg(k, pair)%joint(2:3)
        if (k == shift%n_rod .and. pair == n_pair) then
            do i = 1, n_pair
                associate (own => shift%leg(:, 1 + mod(pair + i - 2, n_pair)))
                    if (k == 1) step%joint(2*i - 1:2*i) = own(1)%joint(2:3)
                    if (k == 2) step%joint(3*i - 2:3*i) = [own(2)%joint(2:3), outer_of_rod(own(1))]
                end associate
            end do
            call add_margin(model, step)
        end if
        call add_rod(model, step, plan)
    end subroutine add_lone_rod

    !> A UPS or UCU leg between known links, in whatever axes and order it is written.
    subroutine close_leg(model, member, plan)
        type(model_type), intent(inout) :: model
        integer, intent(in) :: member(2)
        type(planning), intent(inout) :: plan
        type(step_type) :: step

        step = step_type(kind=step_ups, n_link=2)
        step%link(:2) = member
        step%joint(:3) = joints_of_pair(model, member, plan)
        if (any(step%joint(:3) == 0)) return
        if (any(plan%given(:, step%joint(:3)) > 0)) return
        if (model%joint(step%joint(1))%kind /= joint_universal) call turn_round(step)
        if (.not. is_straight_leg(model, step)) return
        model%n_leg = model%n_leg + 1
        step%first = model%n_leg
        step%base_moves = beyond_leg(model, step, 1) > 0
        model%joint(step%joint(2))%leg = model%n_leg
        if (allocated(plan%stand)) then
            call note_ways(model, plan%stand, step)
        else if (.not. is_leg_of_chain(model, step)) then
            step%branch = 1
            step%turn = 1
            if (turns_in_two(model, step)) step%far_turn = 1
        end if
        call add_step(plan, step)
        if (allocated(plan%stand)) call turn_alone(model, step)
    end subroutine close_leg

    !> The halves turn in axes that nobody else has.
    subroutine turn_alone(model, leg)
        type(model_type), intent(inout) :: model
        type(step_type), intent(in) :: leg
        integer :: half

        do half = 1, 2
            if (half == 1 .or. turns_in_two(model, leg)) model%n_orientation = model%n_orientation + 1
            model%link(leg%link(half))%orientation = model%n_orientation
        end do
    end subroutine turn_alone

    !> Is it a UPS leg written from base to platform as a chain writes it: U, P at the origin of lower, P, S at the origin of upper,
    !> slide along z, second universal axis along y? Which way such a leg stands needs no asking.
    pure logical function is_leg_of_chain(model, step)
        type(model_type), intent(in) :: model
        type(step_type), intent(in) :: step
        real(wp), parameter :: y(3) = [0, 1, 0], z(3) = [0, 0, 1]

        associate (universal => model%joint(step%joint(1)), prismatic => model%joint(step%joint(2)), &
                   spherical => model%joint(step%joint(3)), lower => step%link(1), upper => step%link(2))
            is_leg_of_chain = prismatic%kind == joint_prismatic .and. universal%link(2) == lower &
                              .and. all(prismatic%link == [lower, upper]) .and. spherical%link(1) == upper
            if (.not. is_leg_of_chain) return
            is_leg_of_chain = all(universal%point(:, 2) == 0) .and. all(prismatic%point == 0) &
                              .and. all(spherical%point(:, 1) == 0) &
                              .and. all(abs(universal%frame(:, 3, 2) - y) <= alignment) &
                              .and. all(abs(prismatic%frame(:, 3, 1) - z) <= alignment) &
                              .and. all(prismatic%frame(:, :, 1) == prismatic%frame(:, :, 2))
        end associate
    end function is_leg_of_chain

    !> Are there a universal joint at its first end, a slide along the line between both ends, square to the second axis of that
    !> joint, and a ball at the last end? Or a cylindrical joint, which lies in that line, and another universal joint?
    logical function is_straight_leg(model, step)
        type(model_type), intent(in) :: model
        type(step_type), intent(in) :: step
        real(wp) :: off(3, 2), axis(3, 2), bound
        integer :: half, kind(3)
        logical :: turn_as_one

        kind = model%joint(step%joint(:3))%kind
        turn_as_one = all(kind == [joint_universal, joint_prismatic, joint_spherical])
        is_straight_leg = turn_as_one .or. all(kind == [joint_universal, joint_cylindrical, joint_universal])
        if (.not. is_straight_leg) return
        bound = 0
        do half = 1, 2
            call see_half(half, off(:, half), axis(:, half))
        end do
        if (turn_as_one) then
            off(:, 1) = off(:, 1) - off(:, 2)
            off(:, 2) = 0
            axis(:, 2) = 0
        end if
        is_straight_leg = all(abs(off(:2, :)) <= bound) .and. all(abs(axis(3, :)) <= alignment)

    contains

        !> From the end of a half to the slide's marker, and the universal joint's second axis, in the slide's frame.
        subroutine see_half(half, off, axis)
            integer, intent(in) :: half
            real(wp), intent(out) :: off(3), axis(3)
            integer :: side, its_side

            associate (end => model%joint(step%joint(2*half - 1)), slide => model%joint(step%joint(2)))
                side = side_of(slide, step%link(half))
                its_side = side_of(end, step%link(half))
                associate (frame => slide%frame(:, :, side))
                    off = matmul(slide%point(:, side) - end%point(:, its_side), frame)
                    axis = matmul(end%frame(:, 3, its_side), frame)
                end associate
                bound = max(bound, alignment*maxval(abs([slide%point(:, side), end%point(:, its_side)])))
            end associate
        end subroutine see_half
    end function is_straight_leg

    !> A leg closes in four ways, or eight: drawn out along its slide's axis or against it, and its halves turned about that or not.
    subroutine note_ways(model, stand, step)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: stand(:, :, 0:)        !! (3, 4, 0:n_link)
        type(step_type), intent(inout) :: step
        real(wp) :: span(3), slide(3)

        associate (prismatic => model%joint(step%joint(2)), lower => step%link(1), upper => step%link(2))
            span = point_as_it_stands(model, stand, step%joint(3), upper) - point_as_it_stands(model, stand, step%joint(1), lower)
            slide = matmul(stand(:, :3, lower), prismatic%frame(:, 3, side_of(prismatic, lower)))
            step%branch = merge(1, -1, dot_product(span, slide) > 0)
            step%turn = turn_as_it_stands(model, stand, step%joint(1), lower, span)
            if (turns_in_two(model, step)) step%far_turn = turn_as_it_stands(model, stand, step%joint(3), upper, span)
        end associate
    end subroutine note_ways

    !> +1 where the second axis of a universal joint, which its link has, points as span x first axis does, or -1.
    pure integer function turn_as_it_stands(model, stand, universal, link, span) result(turn)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: stand(:, :, 0:)        !! (3, 4, 0:n_link)
        integer, intent(in) :: universal, link
        real(wp), intent(in) :: span(3)
        real(wp) :: axis(3, 2)
        integer :: side

        associate (joint => model%joint(universal))
            side = side_of(joint, link)
            axis(:, 1) = matmul(stand(:, :3, joint%link(3 - side)), joint%frame(:, 3, 3 - side))
            axis(:, 2) = matmul(stand(:, :3, link), joint%frame(:, 3, side))
            turn = merge(1, -1, dot_product(axis(:, 2), cross(span, axis(:, 1))) > 0)
        end associate
    end function turn_as_it_stands

    !> A joint's point on one of its links.
    pure function point_as_it_stands(model, stand, j, link) result(point)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: stand(:, :, 0:)        !! (3, 4, 0:n_link)
        integer, intent(in) :: j, link
        real(wp) :: point(3)

        associate (joint => model%joint(j))
            point = stand(:, 4, link) + matmul(stand(:, :3, link), joint%point(:, side_of(joint, link)))
        end associate
    end function point_as_it_stands

    ! ---------------------------------------------------------------- refusals

    !> Joints that contradict each other, or coordinates for what is determined without them.
    subroutine refuse_excess(model, grouping, tie_coordinate, status, briefly)
        type(model_type), intent(in) :: model
        type(grouping_type), intent(in) :: grouping
        integer, intent(in) :: tie_coordinate(:)
        type(status_type), intent(inout) :: status
        logical, intent(in), optional :: briefly
        integer :: failed, i
        integer, allocatable :: joint(:), link(:)
        type(redundancy_type) :: redundancy
        type(joint_type) :: led_joint

        if (present(briefly)) then
            if (briefly) then
                call fail(status, status_bad_input, "joints over-constrain their links")
                return
            end if
        end if
        failed = tie_coordinate(grouping%failed_tie)
        if (failed > model%n_q + size(model%led)) then
            led_joint = model%joint(model%loose(failed - model%n_q - size(model%led))%joint(1))
        else if (failed > model%n_q) then
            led_joint = model%joint(model%led(failed - model%n_q)%joint)
        end if
        joint = pack([(i, i=1, model%n_joint)], grouping%tie_at_fault(:model%n_joint))
        link = pack([(i, i=1, model%n_link)], grouping%link_at_fault)
        redundancy = find_redundancy(model, link, joint)
        if (redundancy%is_known .and. redundancy%count > 0) then
            call refuse_redundancy(model, joint, link, redundancy, status)
        else if (failed > model%n_q) then
            call fail(status, status_bad_input, "gears give the "//trim(variable_name(1, led_joint%kind))//" of joint " &
                      //quoted(led_joint%name)//", which joints "//joint_names(model, joint) &
                      //" and the coordinates determine without them (mobility is "//to_text(mobility_of(model))//", " &
                      //to_text(model%n_q)//" coordinate(s) given)")
        else if (failed > 0) then
            call fail(status, status_bad_input, "coordinate "//quoted(model%scene%coordinate(failed)%name) &
                      //" is one too many: joints "//joint_names(model, joint)//" and the other coordinates determine its links " &
                      //"without it (mobility is "//to_text(mobility_of(model))//", "//to_text(model%n_q)//" coordinate(s) given)" &
                      //hint_of_gap(redundancy%gap))
        else if (size(link) == 0) then
            call fail(status, status_bad_input, "joint "//joint_names(model, joint)//" over-constrains its links by " &
                      //to_text(grouping%excess)//": both are already determined by the coordinates")
        else
            call fail(status, status_bad_input, "joints "//joint_names(model, joint)//" over-constrain links " &
                      //link_names(model, link)//" by "//to_text(grouping%excess)//hint_of_gap(redundancy%gap))
        end if
    end subroutine refuse_excess

    !> What numbers with too few digits make of a mechanism that moves by its proportions.
    pure function hint_of_gap(gap) result(hint)
        character(len=*), intent(in) :: gap            !! "joint 'D' stays open by .."; empty: none
        character(len=:), allocatable :: hint

        hint = ""
        if (gap /= "") hint = "; closed as far as they can be, "//gap &
            //" (expected less than a millionth of the mechanism's size: numbers with more digits, or joints that hold less)"
    end function hint_of_gap

    !> Directions that a loop holds more often than once, though it may move: reactions there cannot be told apart.
    subroutine refuse_redundancy(model, joint, link, redundancy, status)
        type(model_type), intent(in) :: model
        integer, intent(in) :: joint(:), link(:)
        type(redundancy_type), intent(in) :: redundancy
        type(status_type), intent(inout) :: status
        character(len=:), allocatable :: what, remedy

        what = "1 constraint direction is redundant, held by the other joints already: "
        if (redundancy%count > 1) what = to_text(redundancy%count) &
            //" constraint directions are redundant, held by the other joints already: "
        remedy = ""
        if (redundancy%remedy /= "") remedy = "; "//redundancy%remedy
        if (remedy == "" .and. model%scene%redundancy /= share_refused) remedy = "; redundancy = " &
            //quoted(trim(share_name(model%scene%redundancy)))//" needs joints that can let go of just these: none that is a " &
            //"coordinate, has a branch or is tied by gears can, and a screw lets go of all but its thread or of nothing " &
            //"(expected joints that hold less, or a guide for what screws carry)"
        call fail(status, status_bad_input, "joints "//joint_names(model, joint)//" over-constrain links " &
                  //link_names(model, link)//": "//what//redundancy%directions//remedy)
    end subroutine refuse_redundancy

    subroutine refuse_lack(model, grouping, status)
        type(model_type), intent(in) :: model
        type(grouping_type), intent(in) :: grouping
        type(status_type), intent(inout) :: status
        integer :: i, n

        n = count(grouping%link_at_fault)
        call fail(status, status_bad_input, "mobility is "//to_text(mobility_of(model))//" but "//to_text(model%n_q) &
                  //" coordinate(s) "//trim(merge("is ", "are", model%n_q == 1))//" given: nothing determines " &
                  //trim(merge("link ", "links", n == 1))//" " &
                  //link_names(model, pack([(i, i=1, model%n_link)], grouping%link_at_fault)) &
                  //hint_of_spin(model, grouping%link_at_fault))
    end subroutine refuse_lack

    !> What most often leaves a freedom in space: rods and legs that spin between two spherical joints.
    function hint_of_spin(model, at_fault) result(hint)
        type(model_type), intent(in) :: model
        logical, intent(in) :: at_fault(:)
        character(len=:), allocatable :: hint
        integer :: l, n_spinning
        integer, allocatable :: member(:), ball(:)
        logical :: is_seen(model%n_link)

        hint = ""
        n_spinning = 0
        is_seen = .false.
        do l = 1, model%n_link
            if (is_seen(l) .or. .not. at_fault(l)) cycle
            call collect_between_balls(model, l, member, ball)
            is_seen(pack(member, member > 0)) = .true.
            if (any(member == 0) .or. size(ball) /= 2) cycle
            n_spinning = n_spinning + 1
            if (n_spinning > 1) cycle
            hint = "; "//trim(merge("link ", "links", size(member) == 1))//" "//link_names(model, member) &
                   //" can spin between "//trim(merge("its  ", "their", size(member) == 1))//" spherical joints " &
                   //joint_names(model, ball)//" (make one of them universal)"
        end do
        if (n_spinning > 1) hint = hint//", and so can "//to_text(n_spinning - 1)//" more"
    end function hint_of_spin

    !> The links that hang together without spherical joints, and the spherical joints around them.
    subroutine collect_between_balls(model, link, member, ball)
        type(model_type), intent(in) :: model
        integer, intent(in) :: link
        integer, allocatable, intent(out) :: member(:)     !! 0 is the frame
        integer, allocatable, intent(out) :: ball(:)
        integer :: i, k, other

        member = [link]
        ball = [integer ::]
        i = 0
        do while (i < size(member))
            i = i + 1
            if (member(i) == 0) cycle
            do k = model%first_at(member(i)), model%first_at(member(i) + 1) - 1
                associate (joint => model%joint(model%joint_at(k)))
                    if (joint%kind == joint_spherical) then
                        ball = [ball, model%joint_at(k)]
                    else
                        other = joint%link(3 - side_of(joint, member(i)))
                        if (all(member /= other)) member = [member, other]
                    end if
                end associate
            end do
        end do
    end subroutine collect_between_balls

    function link_names(model, link) result(names)
        type(model_type), intent(in) :: model
        integer, intent(in) :: link(:)
        character(len=:), allocatable :: names

        names = names_in_a_row(model%link(link)%name)
    end function link_names

    function joint_names(model, joint) result(names)
        type(model_type), intent(in) :: model
        integer, intent(in) :: joint(:)
        character(len=:), allocatable :: names

        names = names_in_a_row(model%joint(joint)%name)
    end function joint_names

    function names_in_a_row(name) result(names)
        character(len=*), intent(in) :: name(:)
        character(len=:), allocatable :: names
        integer :: i

        names = ""
        do i = 1, min(size(name), most_named)
            if (i > 1) names = names//", "
            names = names//quoted(name(i))
        end do
        if (size(name) > most_named) names = names//" and "//to_text(size(name) - most_named)//" more"
    end function names_in_a_row

    ! ---------------------------------------------------------------- what moves what

    !> Which coordinate moves which link.
    subroutine mark_moved_links(model)
        type(model_type), intent(inout) :: model
        logical, allocatable :: moved(:, :)
        integer :: i, j

        allocate (moved(model%n_q, 0:model%n_link))
        moved = .false.
        do i = 1, size(model%step)
            associate (step => model%step(i))
                if (step%kind == step_group) then
                    associate (group => model%group(step%first))
                        call move_together(group%link, [group%joint, sources(pack(group%coordinate, group%coordinate > 0))], &
                                           moving(pack(group%coordinate, group%coordinate > 0)))
                    end associate
                else
                    call move_together(step%link(:step%n_link), &
                                       [pack(step%joint, step%joint > 0), sources(pack(step%coordinate, step%coordinate > 0))], &
                                       moving(pack(step%coordinate, step%coordinate > 0)))
                end if
            end associate
        end do
        allocate (model%moves(model%n_q, model%n_link))
        model%moves = moved(:, 1:)

    contains

        !> Coordinates behind what is given.
        function moving(given) result(coordinate)
            integer, intent(in) :: given(:)
            integer, allocatable :: coordinate(:)
            integer :: i, k

            coordinate = pack(given, given <= model%n_q)
            do k = 1, size(given)
                if (given(k) <= model%n_q) cycle
                associate (weight => model%led(given(k) - model%n_q)%weight)
                    coordinate = [coordinate, pack([(i, i=1, model%n_q)], weight /= 0)]
                end associate
            end do
        end function moving

        !> Joints behind what is given.
        function sources(given) result(joint)
            integer, intent(in) :: given(:)
            integer, allocatable :: joint(:)
            integer :: k

            joint = [integer ::]
            do k = 1, size(given)
                if (given(k) > model%n_q) joint = [joint, model%led(given(k) - model%n_q)%source]
            end do
        end function sources

        !> Links move with the step's coordinates and with whatever moves the links that the joints hold them to.
        subroutine move_together(link, joint, coordinate)
            integer, intent(in) :: link(:), joint(:), coordinate(:)
            logical :: any_move(model%n_q)

            any_move = .false.
            any_move(coordinate) = .true.
            do j = 1, size(joint)
                any_move = any_move .or. moved(:, model%joint(joint(j))%link(1)) .or. moved(:, model%joint(joint(j))%link(2))
            end do
            do j = 1, size(link)
                moved(:, link(j)) = any_move
            end do
        end subroutine move_together
    end subroutine mark_moved_links
end module linkdyn_planner
