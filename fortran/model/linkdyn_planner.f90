!> The planner: orders links and joints, once, into the program of steps that the kinematics walks.
!>
!> A link whose pose is a coordinate is known. A joint from a known link whose variables are all coordinates gives the
!> next link. What is left must fall apart into Assur groups between known links. A scene that cannot be planned is
!> refused with the names of the links and joints concerned.
module linkdyn_planner
    use linkdyn_kinds, only: wp
    use linkdyn_csp_plan, only: find_csp
    use linkdyn_model, only: model_type, step_type, step_pose, step_joint, step_ups, step_csp
    use linkdyn_scene, only: coordinate_joint, coordinate_pose, joint_n_variable, joint_revolute, joint_prismatic, &
        joint_cylindrical, joint_universal, joint_spherical, joint_kind_name
    use linkdyn_status, only: status_type, fail, status_bad_input
    use linkdyn_text, only: to_text, quoted
    implicit none (type, external)
    private
    public :: plan_steps, joint_constraints, mobility_of

    !> Constraints that a joint puts on two links in space, by kind.
    integer, parameter :: spatial_constraints(5) = [5, 5, 4, 4, 3]
    real(wp), parameter :: alignment = 64*epsilon(1.0_wp)   !! how far from exact a given direction may be by rounding

    !> Progress of the planning.
    type :: planning
        type(step_type), allocatable :: step(:)
        integer :: n_step = 0
        logical, allocatable :: known(:)        !! (0:n_link)
        logical, allocatable :: joint_used(:)   !! (n_joint)
        logical, allocatable :: coordinate_used(:)
    end type planning

contains

    !> Number of constraints of a joint.
    pure integer function joint_constraints(kind)
        integer, intent(in) :: kind

        joint_constraints = spatial_constraints(kind)
    end function joint_constraints

    !> Mobility by counting: freedoms of the links less the constraints of the joints.
    pure integer function mobility_of(model)
        type(model_type), intent(in) :: model
        integer :: i

        mobility_of = 6*model%n_link
        do i = 1, model%n_joint
            mobility_of = mobility_of - joint_constraints(model%joint(i)%kind)
        end do
    end function mobility_of

    !> Fill `model%step`.
    subroutine plan_steps(model, status)
        type(model_type), intent(inout) :: model
        type(status_type), intent(inout) :: status
        type(planning) :: plan
        logical :: progress

        if (.not. status%is_ok()) return
        allocate (plan%step(model%n_link + 1), plan%known(0:model%n_link), plan%joint_used(model%n_joint), &
                  plan%coordinate_used(model%n_q))
        plan%known = .false.
        plan%known(0) = .true.
        plan%joint_used = .false.
        plan%coordinate_used = .false.

        call take_poses(model, plan, status)
        do while (status%is_ok() .and. .not. all(plan%known))
            progress = .false.
            call extend_open_chains(model, plan, progress, status)
            if (.not. progress) call close_ups_legs(model, plan, progress)
            if (.not. progress) call close_csp_group(model, plan, progress)
            if (.not. progress) call refuse_the_rest(model, plan, status)
        end do
        call refuse_leftovers(model, plan, status)
        if (.not. status%is_ok()) return
        model%step = plan%step(:plan%n_step)
        call mark_moved_links(model)
    end subroutine plan_steps

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
        integer :: i, j

        do i = 1, model%n_link
            step = step_type(kind=step_pose, n_link=1, link=[i, 0])
            do j = 1, model%n_q
                associate (c => model%scene%coordinate(j))
                    if (c%kind /= coordinate_pose .or. c%link /= i) cycle
                    step%coordinate(c%variable) = j
                    plan%coordinate_used(j) = .true.
                end associate
            end do
            if (all(step%coordinate == 0)) cycle
            if (any(step%coordinate == 0)) then
                call fail(status, status_bad_input, "link "//quoted(model%link(i)%name) &
                          //": a pose needs all six of x, y, z, roll, pitch, yaw")
                return
            end if
            model%n_pose = model%n_pose + 1
            step%first = model%n_pose
            call add_step(plan, step)
        end do
    end subroutine take_poses

    !> Joints from a known to an unknown link whose variables are all coordinates.
    subroutine extend_open_chains(model, plan, progress, status)
        type(model_type), intent(in) :: model
        type(planning), intent(inout) :: plan
        logical, intent(inout) :: progress
        type(status_type), intent(inout) :: status
        type(step_type) :: step
        integer :: j, i, n

        do j = 1, model%n_joint
            associate (joint => model%joint(j))
                if (plan%joint_used(j) .or. (plan%known(joint%link(1)) .eqv. plan%known(joint%link(2)))) cycle
                step = step_type(kind=step_joint, n_link=1, joint=[j, 0, 0])
                step%from_second = plan%known(joint%link(2))
                step%link(1) = merge(joint%link(1), joint%link(2), step%from_second)
                n = joint_n_variable(joint%kind)
                do i = 1, n
                    step%coordinate(i) = coordinate_of(model, j, i)
                end do
                if (any(step%coordinate(:n) == 0)) cycle
                if (step%from_second .and. n > 1 .and. joint%kind /= joint_cylindrical) then
                    call fail(status, status_bad_input, "joint "//quoted(joint%name)//": its coordinates need link " &
                              //quoted(model%link(joint%link(1))%name)//" to be known first; exchange the two markers of 'between'")
                    return
                end if
                plan%joint_used(j) = .true.
                plan%coordinate_used(step%coordinate(:n)) = .true.
                call add_step(plan, step)
                progress = .true.
            end associate
        end do
    end subroutine extend_open_chains

    !> The coordinate that gives a variable of a joint; 0 if none does.
    pure integer function coordinate_of(model, joint, variable)
        type(model_type), intent(in) :: model
        integer, intent(in) :: joint, variable
        integer :: i

        coordinate_of = 0
        do i = 1, model%n_q
            associate (c => model%scene%coordinate(i))
                if (c%kind == coordinate_joint .and. c%joint == joint .and. c%variable == variable) coordinate_of = i
            end associate
        end do
    end function coordinate_of

    !> UPS legs between known links: universal, prismatic, spherical, each leg link in the axes of `linkdyn_ups_leg`.
    subroutine close_ups_legs(model, plan, progress)
        type(model_type), intent(inout) :: model
        type(planning), intent(inout) :: plan
        logical, intent(inout) :: progress
        type(step_type) :: step
        integer :: u, p, s, lower, upper

        do u = 1, model%n_joint
            if (model%joint(u)%kind /= joint_universal .or. plan%joint_used(u)) cycle
            lower = model%joint(u)%link(2)
            if (.not. plan%known(model%joint(u)%link(1)) .or. plan%known(lower)) cycle
            p = other_joint(model, lower, joint_prismatic, 1)
            if (p == 0) cycle
            upper = model%joint(p)%link(2)
            s = other_joint(model, upper, joint_spherical, 1)
            if (s == 0 .or. plan%known(upper)) cycle
            if (.not. plan%known(model%joint(s)%link(2))) cycle
            if (.not. has_leg_axes(model, u, p, s)) cycle
            model%n_leg = model%n_leg + 1
            step = step_type(kind=step_ups, n_link=2, link=[lower, upper], joint=[u, p, s], first=model%n_leg)
            step%base_moves = model%joint(u)%link(1) > 0
            plan%joint_used([u, p, s]) = .true.
            model%joint(p)%leg = model%n_leg
            call add_step(plan, step)
            progress = .true.
            call need_world(model, model%joint(u)%link(1))
            call need_world(model, model%joint(s)%link(2))
        end do
    end subroutine close_ups_legs

    !> A CSP group between known links.
    subroutine close_csp_group(model, plan, progress)
        type(model_type), intent(in) :: model
        type(planning), intent(inout) :: plan
        logical, intent(inout) :: progress
        type(step_type) :: step

        call find_csp(model, plan%known, step, progress)
        if (.not. progress) return
        plan%joint_used(step%joint) = .true.
        call add_step(plan, step)
    end subroutine close_csp_group

    !> The joint of a kind in which the link is the first (1) or second (2), if its links have no other joints.
    pure integer function other_joint(model, link, kind, side)
        type(model_type), intent(in) :: model
        integer, intent(in) :: link, kind, side
        integer :: j, n_joint

        other_joint = 0
        n_joint = 0
        do j = 1, model%n_joint
            if (any(model%joint(j)%link == link)) n_joint = n_joint + 1
            if (model%joint(j)%kind == kind .and. model%joint(j)%link(side) == link) other_joint = j
        end do
        if (n_joint /= 2) other_joint = 0
    end function other_joint

    !> Are the markers where the closed form has them: U, P at the origin of lower, P, S at the origin of upper, slide
    !> along z, second universal axis along y?
    pure logical function has_leg_axes(model, u, p, s)
        type(model_type), intent(in) :: model
        integer, intent(in) :: u, p, s
        real(wp), parameter :: y(3) = [0, 1, 0], z(3) = [0, 0, 1]

        associate (universal => model%joint(u), prismatic => model%joint(p), spherical => model%joint(s))
            has_leg_axes = all(universal%point(:, 2) == 0) .and. all(prismatic%point == 0) &
                           .and. all(spherical%point(:, 1) == 0) &
                           .and. all(abs(universal%frame(:, 3, 2) - y) <= alignment) &
                           .and. all(abs(prismatic%frame(:, 3, 1) - z) <= alignment) &
                           .and. all(prismatic%frame(:, :, 1) == prismatic%frame(:, :, 2))
        end associate
    end function has_leg_axes

    subroutine need_world(model, link)
        type(model_type), intent(inout) :: model
        integer, intent(in) :: link

        if (link > 0) model%link(link)%needs_world = .true.
    end subroutine need_world

    !> Say why the remaining links cannot be placed.
    subroutine refuse_the_rest(model, plan, status)
        type(model_type), intent(in) :: model
        type(planning), intent(in) :: plan
        type(status_type), intent(inout) :: status
        character(len=:), allocatable :: names
        integer :: i, n_shown

        names = ""
        n_shown = 0
        do i = 1, model%n_link
            if (plan%known(i)) cycle
            n_shown = n_shown + 1
            if (n_shown == 4) names = names//", ..."
            if (n_shown > 3) cycle
            if (n_shown > 1) names = names//", "
            names = names//quoted(model%link(i)%name)
        end do
        if (mobility_of(model) > model%n_q) then
            call fail(status, status_bad_input, "mobility is "//to_text(mobility_of(model))//" but "//to_text(model%n_q) &
                      //" coordinate(s) are given: nothing determines link(s) "//names)
        else
            call fail(status, status_bad_input, "link(s) "//names//" cannot be placed from the coordinates given: no open " &
                      //"chain leads to them and they form no known group (UPS leg, CSP)")
        end if
    end subroutine refuse_the_rest

    !> Joints and coordinates that no step used contradict the others.
    subroutine refuse_leftovers(model, plan, status)
        type(model_type), intent(in) :: model
        type(planning), intent(in) :: plan
        type(status_type), intent(inout) :: status
        integer :: i

        if (.not. status%is_ok()) return
        do i = 1, model%n_joint
            if (plan%joint_used(i)) cycle
            associate (joint => model%joint(i))
                call fail(status, status_bad_input, "joint "//quoted(joint%name)//" ("//trim(joint_kind_name(joint%kind)) &
                          //") over-constrains its links by "//to_text(joint_constraints(joint%kind)) &
                              //": both are already determined by the coordinates and the other joints")
            end associate
            return
        end do
        do i = 1, model%n_q
            if (plan%coordinate_used(i)) cycle
            call fail(status, status_bad_input, "coordinate "//quoted(model%scene%coordinate(i)%name) &
                      //" is one too many: its link is already determined without it (mobility is " &
                      //to_text(mobility_of(model))//")")
            return
        end do
    end subroutine refuse_leftovers

    !> Which coordinate moves which link.
    subroutine mark_moved_links(model)
        type(model_type), intent(inout) :: model
        logical :: moved(model%n_q, 0:model%n_link)
        integer :: i, j

        moved = .false.
        do i = 1, size(model%step)
            associate (step => model%step(i))
                do j = 1, step%n_link
                    where (step_uses(step, model%n_q)) moved(:, step%link(j)) = .true.
                end do
                select case (step%kind)
                case (step_joint)
                    j = model%joint(step%joint(1))%link(merge(2, 1, step%from_second))
                    moved(:, step%link(1)) = moved(:, step%link(1)) .or. moved(:, j)
                case (step_ups)
                    do j = 1, 2
                        moved(:, step%link(j)) = moved(:, model%joint(step%joint(1))%link(1)) &
                                                 .or. moved(:, model%joint(step%joint(3))%link(2))
                    end do
                case (step_csp)
                    call move_csp_links(step)
                end select
            end associate
        end do
        model%moves = moved(:, 1:)

    contains

        !> Both links follow the link with the axis and the link with the slide.
        subroutine move_csp_links(step)
            type(step_type), intent(in) :: step
            integer :: axis_link, slide_link

            axis_link = sum(model%joint(step%joint(1))%link) - step%link(1)
            slide_link = sum(model%joint(step%joint(3))%link) - step%link(2)
            moved(:, step%link(1)) = moved(:, axis_link) .or. moved(:, slide_link)
            moved(:, step%link(2)) = moved(:, step%link(1))
        end subroutine move_csp_links
    end subroutine mark_moved_links

    pure function step_uses(step, n_q) result(uses)
        type(step_type), intent(in) :: step
        integer, intent(in) :: n_q
        logical :: uses(n_q)
        integer :: i

        do i = 1, n_q
            uses(i) = any(step%coordinate == i)
        end do
    end function step_uses
end module linkdyn_planner
