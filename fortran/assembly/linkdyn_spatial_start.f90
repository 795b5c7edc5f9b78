!> The assembly of a spatial mechanism at its start: in which of its ways each closed form closes, and where the links of
!> groups closed by iteration are.
!>
!> Of a closed form a `branch` written at the joint between its links decides, otherwise the nearest way (`linkdyn_start_distance`).
module linkdyn_spatial_start
    use linkdyn_closed_forms, only: closed_margin
    use linkdyn_kinematic_pass, only: run_step
    use linkdyn_kinematic_state, only: kinematic_state, prepare_kinematics
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_model, only: model_type, step_type, step_ups, step_csp, step_hung, step_between, &
        step_gimbal, step_group, may_turn, turns_in_two, by_branch, by_start, by_nothing
    use linkdyn_laws, only: start_of_coordinate
    use linkdyn_planar_start, only: start_group
    use linkdyn_start_choices, only: start_choices, place_all
    use linkdyn_start_distance, only: start_distance, measure_distance, is_nearer, has_start
    use linkdyn_step_part, only: describe_step
    use linkdyn_status, only: status_type
    implicit none (type, external)
    private
    public :: assemble_in_space, list_parts

contains

    !> Fill `model%start_q`, `model%branch` and the groups' starts.
    !>
    !> **Errors**: `status_bad_input` for a group that cannot be closed at the start.
    subroutine assemble_in_space(model, status, like)
        type(model_type), intent(inout) :: model
        type(status_type), intent(inout) :: status
        type(model_type), intent(in), optional :: like     !! a model that stands as this one will
        type(kinematic_state) :: state
        integer :: k

        if (.not. status%is_ok() .or. model%is_planar) return
        model%start_q = [(start_of_coordinate(model%scene, k), k=1, model%n_q)]
        allocate (model%branch(model%n_branch))
        allocate (model%chosen_by(model%n_branch))
        model%branch = 1
        model%chosen_by = by_branch
        if (.not. any(is_closed(model%step) .or. model%step%kind == step_ups .or. model%step%kind == step_group)) return
        call prepare_kinematics(model, 0, state)
        state%q = spread(model%start_q, 1, lanes)
        call place_all(model, state, by_branch, place_spatial_step, status, like)
    end subroutine assemble_in_space

    !> A step of the plan.
    subroutine place_spatial_step(model, i, choices, state, status, like)
        type(model_type), intent(inout) :: model
        integer, intent(in) :: i
        type(start_choices), intent(inout) :: choices
        type(kinematic_state), intent(inout) :: state
        type(status_type), intent(inout) :: status
        type(model_type), intent(in), optional :: like
        type(start_distance) :: nearest

        associate (step => model%step(i))
            if (is_closed(step)) then
                call choose_way(model, i, told_branch(model, i), state, nearest)
                if (step%has_branches .and. told_branch(model, i) == 0) choices%n_way(i) = 2
                if (choices%passed_over(i) > 0) call choose_way(model, i, -nint(model%branch(step%first)), state, nearest)
            end if
            if (step%kind == step_ups .and. step%branch /= 0) call choose_leg(model, i, state, like)
            if (step%kind == step_group) then
                call start_group(model, i, choices, state, status, like)
            else
                call run_step(model, step, state)
            end if
        end associate
    end subroutine place_spatial_step

    !> The branch written at the joint between the links of a closed form; 0: none. One that has no branches has one way.
    pure integer function told_branch(model, i) result(told)
        type(model_type), intent(in) :: model
        integer, intent(in) :: i                           !! step of the plan

        told = 1
        if (model%step(i)%has_branches) told = model%scene%joint(model%joint(model%step(i)%joint(2))%told)%branch
    end function told_branch

    !> Is it a closed form with ways to choose from?
    elemental logical function is_closed(step)
        type(step_type), intent(in) :: step

        is_closed = any(step%kind == [step_csp, step_hung]) .or. may_turn(step%kind)
    end function is_closed

    !> The way in which a closed form closes: its branch, and of a rod whichever way its universal joint is turned. Of the ways
    !> those that a `branch` leaves.
    recursive subroutine choose_way(model, i, told, state, nearest)
        type(model_type), intent(inout) :: model
        integer, intent(in) :: i                           !! step of the plan
        integer, intent(in) :: told                        !! this branch; 0: either
        type(kinematic_state), intent(inout) :: state
        type(start_distance), intent(out) :: nearest       !! of that way
        type(start_distance) :: distance
        integer :: branch, turn, least_turn, best(2)
        integer, allocatable :: link(:), joint(:)

        call list_parts(model, i, link, joint)
        associate (step => model%step(i))
            nearest%given = huge(1.0_wp)
            best = [merge(1, told, told == 0), 1]
            least_turn = merge(-1, 1, may_turn(step%kind))
            do branch = 1, -1, -2
                if (told /= 0 .and. branch /= told) cycle
                if (step%has_margin) state%branch(:, step%first) = branch
                do turn = 1, least_turn, -2
                    call turn_rod(model, i, turn)
                    call run_step(model, model%step(i), state)
                    call measure_way(model, i, state, distance)
                    if (.not. is_nearer(distance, 1, nearest%given(1), nearest%others(1))) cycle
                    nearest = distance
                    best = [branch, turn]
                end do
            end do
            call turn_rod(model, i, best(2))
            if (.not. step%has_margin) return
            if (.not. step%has_branches) best(1) = side_at_start(model, step, state)
            model%branch(step%first) = best(1)
            state%branch(:, step%first) = best(1)
            if (told == 0) model%chosen_by(step%first) = merge(by_start, by_nothing, has_start(model, link, joint))
        end associate
    end subroutine choose_way

    !> The nearest of a leg's ways: none of them can be left without taking the leg apart.
    subroutine choose_leg(model, i, state, like)
        type(model_type), intent(inout) :: model
        integer, intent(in) :: i                           !! step of the plan
        type(kinematic_state), intent(inout) :: state
        type(model_type), intent(in), optional :: like     !! a model that stands as this one will
        type(start_distance) :: nearest, distance
        integer :: way, best, i_like

        if (present(like)) then
            i_like = findloc(like%step%kind == step_ups .and. like%step%link(1) == model%step(i)%link(1) &
                             .and. like%step%branch /= 0, .true., dim=1)
            if (i_like > 0) then
                if (has_axes_of(like%step(i_like))) then
                    call take_way(way_of(like%step(i_like)))
                    return
                end if
            end if
        end if
        nearest%given = huge(1.0_wp)
        best = 0
        do way = 0, merge(7, 3, turns_in_two(model, model%step(i)))
            call take_way(way)
            call run_step(model, model%step(i), state)
            distance = measure_distance(model, model%step(i)%link(:2), model%step(i)%joint(:3), state, .false.)
            if (.not. is_nearer(distance, 1, nearest%given(1), nearest%others(1))) cycle
            nearest = distance
            best = way
        end do
        call take_way(best)

    contains

        !> Are its joints' axes those of that leg? What holds an idle spin may have others.
        pure logical function has_axes_of(step)
            type(step_type), intent(in) :: step
            integer :: k

            has_axes_of = all(step%joint(:3) == model%step(i)%joint(:3))
            do k = 1, 3
                if (.not. has_axes_of) return
                has_axes_of = all(like%joint(step%joint(k))%frame == model%joint(step%joint(k))%frame)
            end do
        end function has_axes_of

        !> A number of three bits.
        pure integer function way_of(step)
            type(step_type), intent(in) :: step

            way_of = count([step%branch < 0]) + 2*count([step%turn < 0]) + 4*count([step%far_turn < 0])
        end function way_of

        subroutine take_way(way)
            integer, intent(in) :: way

            associate (step => model%step(i))
                step%branch = merge(-1, 1, btest(way, 0))
                step%turn = merge(-1, 1, btest(way, 1))
                if (step%far_turn /= 0) step%far_turn = merge(-1, 1, btest(way, 2))
            end associate
            call describe_step(model, i)
        end subroutine take_way
    end subroutine choose_leg

    !> How far the way is from the start in which a step closes. A platform on rods counts with these, which stand behind it, and so
    !> does a gimbal with the link behind it.
    recursive subroutine measure_way(model, i, state, distance)
        type(model_type), intent(inout) :: model
        integer, intent(in) :: i
        type(kinematic_state), intent(inout) :: state
        type(start_distance), intent(out) :: distance
        type(start_distance) :: of_rod
        integer :: k, beyond

        associate (step => model%step(i))
            if (step%kind == step_gimbal) then
                ! the other link between counts with it
                beyond = sum(model%joint(step%joint(2))%link) - step%link(1)
                k = findloc(model%step%kind == step_between .and. model%step%link(1) == beyond, .true., dim=1)
                call run_step(model, model%step(k), state)
                distance = measure_distance(model, [step%link(1), beyond], step%joint(:3), state, .false.)
                return
            else if (step%kind /= step_hung) then
                distance = measure_distance(model, step%link(:step%n_link), step%joint(:step%n_link + 1), state, .false.)
                return
            end if
            distance = measure_distance(model, step%link(:step%n_link), [integer ::], state, .false.)
            do k = i + 1, last_rod_of(model, i)
                call choose_way(model, k, told_branch(model, k), state, of_rod)
                call run_step(model, model%step(k), state)
                distance%given = distance%given + of_rod%given
                distance%others = distance%others + of_rod%others
            end do
        end associate
    end subroutine measure_way

    !> The rod of a platform that has the margin of what holds its attitude.
    pure integer function last_rod_of(model, i) result(last)
        type(model_type), intent(in) :: model
        integer, intent(in) :: i                           !! step of the platform

        last = i + 1
        do while (.not. model%step(last)%has_margin)
            last = last + 1
        end do
    end function last_rod_of

    !> Links and joints of a step that count; of a platform on rods those of its rods besides.
    subroutine list_parts(model, i, link, joint)
        type(model_type), intent(in) :: model
        integer, intent(in) :: i
        integer, allocatable, intent(out) :: link(:), joint(:)
        integer :: k

        associate (step => model%step(i))
            link = step%link(:step%n_link)
            joint = step%joint(:step%n_link + 1)
            if (step%kind /= step_hung) return
            joint = [integer ::]
            do k = i + 1, last_rod_of(model, i)
                link = [link, model%step(k)%link(1)]
                joint = [joint, model%step(k)%joint(:2)]
            end do
        end associate
    end subroutine list_parts

    !> On which side of where its margin is zero a closed form is that closes in one way.
    integer function side_at_start(model, step, state) result(branch)
        type(model_type), intent(in) :: model
        type(step_type), intent(in) :: step
        type(kinematic_state), intent(inout) :: state
        real(wp), dimension(lanes) :: margin, drift

        call run_step(model, step, state)
        call closed_margin(model, step, state, margin, drift)
        branch = merge(-1, 1, margin(1) < 0)
    end function side_at_start

    !> Turn a rod or gimbal round and choose its kernels anew.
    subroutine turn_rod(model, i, turn)
        type(model_type), intent(inout) :: model
        integer, intent(in) :: i, turn

        if (model%step(i)%turn == turn .or. .not. may_turn(model%step(i)%kind)) return
        model%step(i)%turn = turn
        call describe_step(model, i)
    end subroutine turn_rod
end module linkdyn_spatial_start
