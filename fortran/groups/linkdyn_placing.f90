!> The steps of the plan, one after the other: where every link stands and how it moves.
module linkdyn_placing
    use linkdyn_attitude, only: rotation_about_z, rotation_by_quaternion
    use linkdyn_csp_group, only: place_csp
    use linkdyn_dyads, only: place_dyad
    use linkdyn_group_rates, only: group_constraints, list_constraints, move_group
    use linkdyn_hung_platform, only: hang_on_rods
    use linkdyn_joint_kind, only: marker_pair
    use linkdyn_led_variables, only: complete_led, watch_own_turns
    use linkdyn_leg, only: close_leg
    use linkdyn_link_between, only: close_between, close_gimbal
    use linkdyn_mechanism, only: mechanism_type, has_slide, pair_of
    use linkdyn_model, only: step_type, step_pose, step_joint, step_parts, step_ups, step_csp, step_rus, step_pus, &
        step_rod, step_hung, step_between, step_gimbal, step_group, is_dyad
    use linkdyn_open_chain, only: take_pose, take_parts, walk_joint
    use linkdyn_parallel_rods, only: must_hold
    use linkdyn_rod_leg, only: close_rod_leg, close_rod
    use linkdyn_system, only: system_type
    use linkdyn_value, only: value, zero
    use linkdyn_vector, only: vector, vector_of, operator(.unrotate.)
    implicit none (type, external)
    private
    public :: run_step, place_links, place_group, closes_loop, list_step_constraints

contains

    !> One step. Links of a group that is closed by iteration stand at given places.
    subroutine run_step(mechanism, step, branch, place, equations)
        type(mechanism_type), intent(inout) :: mechanism
        type(step_type), intent(in) :: step
        type(value), intent(in) :: branch              !! +1 or -1, read where a step has two ways to close
        type(value), intent(in) :: place(:, :)         !! x, y, angle, or x y z and a quaternion (place_size, link)
        type(system_type), intent(inout), optional :: equations    !! where accelerations stay unknown, if they do
        type(group_constraints) :: constraints

        if (step%kind == step_group) then
            call place_group(mechanism, step%first, place, constraints)
        else
            call place_links(mechanism, step, branch, equations)
            if (closes_loop(step)) call list_step_constraints(mechanism, step, constraints)
        end if
        if (closes_loop(step)) call move_group(mechanism, constraints, equations)
        call measure_slides(mechanism, step_joints(mechanism, step))
    end subroutine run_step

    !> Where a step in closed form places its links; how they move, too, but where that is left to the constraints of a loop.
    subroutine place_links(mechanism, step, branch, equations)
        type(mechanism_type), intent(inout) :: mechanism
        type(step_type), intent(in) :: step
        type(value), intent(in) :: branch
        type(system_type), intent(inout), optional :: equations
        type(value), allocatable :: quaternion(:)

        if (allocated(mechanism%quaternion) .and. any(step%kind == [step_pose, step_joint, step_parts]) .and. step%first > 0) &
            quaternion = mechanism%quaternion(:, step%first)
        select case (step%kind)
        case (step_pose)
            call take_pose(mechanism, step, quaternion)
        case (step_joint)
            associate (k => pack(step%coordinate, step%coordinate > 0))
                call complete_led(mechanism, k, [integer ::])
                call walk_joint(mechanism, step%joint(1), step%from_second, mechanism%q(k), mechanism%qd(k), quaternion)
            end associate
        case (step_parts)
            call take_parts(mechanism, step, quaternion)
        case (step_ups)
            call close_leg(mechanism, step, equations)
        case (step_csp)
            call place_csp(mechanism, step, branch)
        case (step_rus, step_pus)
            call close_rod_leg(mechanism, step, branch, equations)
        case (step_rod)
            call close_rod(mechanism, step)
            if (step%has_margin) call must_hold(mechanism, step)
        case (step_between)
            call close_between(mechanism, step)
        case (step_gimbal)
            call close_gimbal(mechanism, step)
        case (step_hung)
            call hang_on_rods(mechanism, step, branch, equations)
        case default
            call complete_led(mechanism, pack(step%coordinate, step%coordinate > 0), [integer ::])
            call place_dyad(mechanism, step, branch)
        end select
    end subroutine place_links

    !> Is the motion of a step's links that of a loop's constraints?
    pure logical function closes_loop(step)
        type(step_type), intent(in) :: step

        closes_loop = step%kind == step_group .or. step%kind == step_csp .or. is_dyad(step%kind)
    end function closes_loop

    !> Constraints of a closed form, whose links are placed; of slides inside it also what their variables are.
    subroutine list_step_constraints(mechanism, step, constraints)
        type(mechanism_type), intent(in) :: mechanism
        type(step_type), intent(in) :: step
        type(group_constraints), intent(out) :: constraints
        integer :: given(3, step%n_link + 1)

        given = 0
        given(:2, 1) = step%coordinate(3:4)
        given(:2, 3) = step%coordinate(5:6)
        given(1, 4:) = step%coordinate(:step%n_link - 2)
        call list_constraints(mechanism, step%link(:step%n_link), step%joint(:step%n_link + 1), given, constraints)
    end subroutine list_step_constraints

    !> Joints that a step closes.
    function step_joints(mechanism, step) result(joint)
        type(mechanism_type), intent(in) :: mechanism
        type(step_type), intent(in) :: step
        integer, allocatable :: joint(:)

        if (step%kind == step_group) then
            joint = mechanism%model%group(step%first)%joint
        else
            joint = pack(step%joint, step%joint > 0)
        end if
    end function step_joints

    !> A group closed by iteration, where it stands.
    subroutine place_group(mechanism, g, place, constraints)
        type(mechanism_type), intent(inout) :: mechanism
        integer, intent(in) :: g                       !! number of the group
        type(value), intent(in) :: place(:, :)         !! as above
        type(group_constraints), intent(out) :: constraints

        associate (group => mechanism%model%group(g))
            call complete_led(mechanism, pack(group%coordinate, group%coordinate > 0), group%joint)
            call take_places(mechanism, group%link, place)
            call watch_own_turns(mechanism, pack(group%coordinate, group%coordinate > 0), group%joint)
            call list_constraints(mechanism, group%link, group%joint, group%coordinate, constraints)
        end associate
    end subroutine place_group

    subroutine take_places(mechanism, link, place)
        type(mechanism_type), intent(inout) :: mechanism
        integer, intent(in) :: link(:)
        type(value), intent(in) :: place(:, :)
        integer :: i

        do i = 1, size(link)
            associate (body => mechanism%bodies%body(link(i)))
                if (mechanism%model%is_planar) then
                    body%position = vector(place(1, link(i)), place(2, link(i)), zero())
                else
                    body%position = vector_of(place(:3, link(i)))
                end if
                if (any(mechanism%bodies%turning(body%turning)%omega%is_known)) cycle
                if (any(mechanism%bodies%body(link(:i - 1))%turning == body%turning)) cycle
                if (mechanism%model%is_planar) then
                    mechanism%bodies%turning(body%turning)%r = rotation_about_z(place(3, link(i)))
                else
                    mechanism%bodies%turning(body%turning)%r = rotation_by_quaternion(place(4:, link(i)))
                end if
            end associate
        end do
    end subroutine take_places

    !> Where the second markers stand seen from the first, where no step has said it.
    subroutine measure_slides(mechanism, joint)
        type(mechanism_type), intent(inout) :: mechanism
        integer, intent(in) :: joint(:)
        type(marker_pair) :: pair
        integer :: i

        do i = 1, size(joint)
            if (.not. (has_slide(mechanism, joint(i)) .or. mechanism%kind(joint(i))%is%slides)) cycle
            if (.not. has_slide(mechanism, joint(i))) then
                pair = pair_of(mechanism, joint(i))
                mechanism%slide(joint(i)) = pair%first.unrotate.pair%gap
            end if
            associate (model => mechanism%model, told => mechanism%model%joint(joint(i))%told)
                if (model%joint(told)%kind == model%joint(joint(i))%kind) mechanism%slide(told) = mechanism%slide(joint(i))
            end associate
        end do
    end subroutine measure_slides
end module linkdyn_placing
