!> Gears that were let go because the joints tie their wheels already: do they go along with the mechanism, as it was assembled?
module linkdyn_gear_fit
    use linkdyn_gear_gap, only: gear_gap
    use linkdyn_joint_table, only: joint_kind_name
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state, prepare_kinematics, link_position, link_rotation
    use linkdyn_lane_count, only: lanes
    use linkdyn_led_mechanism, only: evaluate_kinematics
    use linkdyn_model, only: model_type, is_released, scene_size, gapes
    use linkdyn_status, only: status_type, fail, status_bad_input
    use linkdyn_text, only: to_text, quoted
    implicit none (type, external)
    private
    public :: gears_fit, gears_go_along, settle_phases

    integer, parameter :: n_near = 4                     !! positions near the start that are looked at, and the start
    real(wp), parameter :: step = 0.05_wp                !! to the next, in strides

contains

    !> Does every gear that was let go keep its sum near the start?
    logical function gears_fit(model)
        type(model_type), intent(in) :: model
        real(wp) :: first(size(model%gear)), changed(size(model%gear))
        integer :: g

        gears_fit = .true.
        if (.not. any_to_check(model)) return
        call find_gaps(model, first, changed)
        do g = 1, size(model%gear)
            if (.not. is_to_check(model, g)) cycle
            gears_fit = gears_fit .and. changed(g) <= gapes*scene_size(model)
        end do
    end function gears_fit

    !> The same where the links are.
    pure logical function gears_go_along(model, position, rotation)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: position(:, :), rotation(:, :, :)    !! of links (3, n_link), (3, 3, n_link)
        integer :: g

        gears_go_along = .true.
        do g = 1, size(model%gear)
            if (.not. is_to_check(model, g)) cycle
            gears_go_along = gears_go_along .and. &
                             abs(gear_gap(model, model%gear(g), position, rotation)) <= gapes*scene_size(model)
        end do
    end function gears_go_along

    !> Such a gear without a `phase` takes that which fits at the start.
    !>
    !> Of a model that is planned.
    !>
    !> **Errors**: `status_bad_input` if a gear locks the mechanism, or stands otherwise than its `phase` says.
    subroutine settle_phases(model, status)
        type(model_type), intent(inout) :: model
        type(status_type), intent(inout) :: status
        real(wp) :: first(size(model%gear)), changed(size(model%gear))
        character(len=:), allocatable :: name
        integer :: g

        if (.not. any_to_check(model)) return
        call find_gaps(model, first, changed)
        do g = 1, size(model%gear)
            if (.not. is_to_check(model, g)) cycle
            associate (gear => model%gear(g), joint => model%joint(model%gear(g)%joint))
                name = trim(joint_kind_name(joint%told_kind))//" "//quoted(joint%name)
                if (changed(g) > gapes*scene_size(model)) then
                    call fail(status, status_bad_input, name//" locks the mechanism as it is assembled at the start: its joints " &
                              //"move the wheels in another ratio (expected another 'branch' or 'start' of theirs, or no "// &
                              trim(joint_kind_name(joint%told_kind))//")")
                else if (.not. model%scene%joint(gear%joint)%has_phase) then
                    gear%total = gear%total + first(g)
                else if (abs(first(g)) > gapes*scene_size(model)) then
                    call fail(status, status_bad_input, name//": its phase is not that of the wheels, which joints hold already " &
                              //"(expected none here, or one that differs by "//to_text(first(g)/gear%second)//")")
                end if
            end associate
        end do
    end subroutine settle_phases

    !> Is it a gear that was let go, and do loops of joints, not other gears alone, make it fit?
    pure logical function is_to_check(model, g)
        type(model_type), intent(in) :: model
        integer, intent(in) :: g

        is_to_check = is_released(model%joint(model%gear(g)%joint)) .and. .not. model%gear(g)%follows
    end function is_to_check

    pure logical function any_to_check(model)
        type(model_type), intent(in) :: model
        integer :: g

        any_to_check = any([(is_to_check(model, g), g=1, size(model%gear))])
    end function any_to_check

    !> Gaps at the start, and by how much they change at most near it.
    subroutine find_gaps(model, first, changed)
        type(model_type), intent(in) :: model
        real(wp), intent(out) :: first(:), changed(:)    !! [m] (gear)
        type(kinematic_state) :: state
        real(wp) :: position(3, model%n_link), rotation(3, 3, model%n_link), gap
        integer :: g, k, l, lane

        call prepare_kinematics(model, 0, state)
        state%q = spread(model%start_q, 1, lanes)
        do lane = 2, min(n_near, lanes)
            do k = 1, model%n_q
                state%q(lane, k) = state%q(lane, k) + step*(lane - 1)/sqrt(real(k, wp))*model%stride(k)
            end do
        end do
        call evaluate_kinematics(model, state)
        first = 0
        changed = 0
        do lane = 1, min(n_near, lanes)
            if (state%unreachable(lane) .or. state%not_converged(lane) .or. state%singular(lane)) cycle
            do l = 1, model%n_link
                position(:, l) = link_position(model, state, l, lane)
                rotation(:, :, l) = link_rotation(model, state, l, lane)
            end do
            do g = 1, size(model%gear)
                if (.not. is_to_check(model, g)) cycle
                gap = gear_gap(model, model%gear(g), position, rotation)
                if (lane == 1) first(g) = gap
                changed(g) = max(changed(g), abs(gap - first(g)))
            end do
        end do
    end subroutine find_gaps
end module linkdyn_gear_fit
