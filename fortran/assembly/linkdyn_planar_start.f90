!> The assembly of a planar mechanism at its start: which branch each dyad is on.
!>
!> A `branch` given at one of its joints decides. Otherwise the branch nearest to the starting positions that the scene
!> gives for the dyad's links and joints is taken. If the scene gives none but the links, left where their markers are
!> written, fit together at the start, that is their assembly. If nothing speaks, it is branch +1; with a slide inside the dyad that
!> leads, whose links are seldom drawn as they stand, the assembly nearest to joint variables of zero, as of larger groups.
!> Where loops behind do not close then, the next nearest (`linkdyn_start_choices`).
module linkdyn_planar_start
    use linkdyn_constants, only: pi
    use linkdyn_group_start, only: find_group_start, take_group_start
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_pass, only: run_step
    use linkdyn_kinematic_state, only: kinematic_state, prepare_kinematics
    use linkdyn_laws, only: start_of_coordinate
    use linkdyn_locked_coordinate, only: find_locked
    use linkdyn_model, only: model_type, step_type, group_type, step_prp, step_group, is_dyad, is_led_dyad, is_length, &
        by_branch, by_start, by_markers, by_nothing, orientation_of, scene_size
    use linkdyn_planar_motion, only: planar_motion
    use linkdyn_scene, only: joint_prismatic
    use linkdyn_start_choices, only: start_choices, place_all
    use linkdyn_start_distance, only: start_distance, measure_distance, is_nearer, has_start
    use linkdyn_status, only: status_type, fail, status_bad_input
    use linkdyn_text, only: quoted, to_text
    use linkdyn_vec2, only: operator(+), operator(-), operator(.rotate.), lane_of
    implicit none (type, external)
    private
    public :: assemble_start, start_group

    real(wp), parameter :: fit = 1.0e-6_wp    !! markers this near, relative to the scene's size, were meant to coincide

contains

    !> Fill `model%start_q`, `model%branch` and the groups' starts.
    subroutine assemble_start(model, status, like)
        type(model_type), intent(inout) :: model
        type(status_type), intent(inout) :: status
        type(model_type), intent(in), optional :: like     !! a model that stands as this one will
        type(kinematic_state) :: state
        integer :: k

        if (.not. status%is_ok() .or. .not. model%is_planar) return
        allocate (model%start_q(model%n_q), model%branch(model%n_dyad), model%chosen_by(model%n_dyad))
        model%branch = 1
        do k = 1, model%n_q
            model%start_q(k) = start_of_coordinate(model%scene, k)
        end do
        call prepare_kinematics(model, 0, state)
        do k = 1, model%n_q
            state%q(:, k) = model%start_q(k)
        end do
        state%qd = 0
        state%qdd = 0
        call place_all(model, state, by_nothing, place_planar_step, status, like)
    end subroutine assemble_start

    !> A step of the plan of a planar mechanism.
    subroutine place_planar_step(model, i, choices, state, status, like)
        type(model_type), intent(inout) :: model
        integer, intent(in) :: i
        type(start_choices), intent(inout) :: choices
        type(kinematic_state), intent(inout) :: state
        type(status_type), intent(inout) :: status
        type(model_type), intent(in), optional :: like

        associate (step => model%step(i))
            if (is_dyad(step%kind)) call choose_branch(model, i, choices, state, status)
            if (step%kind == step_group) then
                call start_group(model, i, choices, state, status, like)
            else
                call run_step(model, step, state)
            end if
        end associate
    end subroutine place_planar_step

    ! ---------------------------------------------------------------- dyads

    !> Choose one of a dyad's two assemblies: the branch asked for, else that nearest to how its links are drawn.
    subroutine choose_branch(model, i_step, choices, state, status)
        type(model_type), intent(inout) :: model
        integer, intent(in) :: i_step
        type(start_choices), intent(inout) :: choices
        type(kinematic_state), intent(inout) :: state
        type(status_type), intent(inout) :: status
        type(start_distance) :: distance(2)
        integer :: forced, i
        logical :: has_hints, fits, speaks

        associate (step => model%step(i_step))
            forced = forced_branch(model, step, status)
            if (step%kind == step_prp) call take_side(model, step, state)
            if (.not. step%has_branches) return
            associate (link => step%link(:step%n_link), joint => step%joint(:step%n_link + 1))
                has_hints = has_start(model, link, joint)
                fits = .false.
                ! a dyad that coordinates lead is led by more than where links are drawn
                if (.not. (has_hints .or. is_led_dyad(step))) fits = fits_as_written(model, link, joint, state%plane)
                speaks = has_hints .or. fits
                if (forced /= 0) then
                    model%branch(step%first) = forced
                    model%chosen_by(step%first) = by_branch
                else if (speaks .or. is_led_dyad(step)) then
                    if (speaks) model%chosen_by(step%first) = merge(by_start, by_markers, has_hints)
                    do i = 1, 2
                        state%branch(:, step%first) = 3 - 2*i
                        call run_step(model, step, state)
                        distance(i) = measure_distance(model, link, joint, state, fits)
                    end do
                    if (is_nearer(distance(2), 1, distance(1)%given(1), distance(1)%others(1))) model%branch(step%first) = -1
                end if
            end associate
            if (forced == 0) choices%n_way(i_step) = 2
            if (choices%passed_over(i_step) > 0) model%branch(step%first) = -model%branch(step%first)
            state%branch(:, step%first) = model%branch(step%first)
        end associate
    end subroutine choose_branch

    !> Note to which side one of two slides is turned off the other at the start.
    subroutine take_side(model, step, state)
        type(model_type), intent(inout) :: model
        type(step_type), intent(in) :: step
        type(kinematic_state), intent(inout) :: state
        logical :: is_lost(size(state%unreachable))

        is_lost = state%unreachable
        state%unreachable = .false.
        call run_step(model, step, state)
        if (state%unreachable(1)) model%branch(step%first) = -1
        state%unreachable = is_lost
        state%branch(:, step%first) = model%branch(step%first)
    end subroutine take_side

    !> The branch written at a joint of the dyad; 0: none.
    integer function forced_branch(model, step, status) result(branch)
        type(model_type), intent(in) :: model
        type(step_type), intent(in) :: step
        type(status_type), intent(inout) :: status
        integer :: i

        branch = 0
        do i = 1, step%n_link + 1
            associate (spec => model%scene%joint(model%joint(step%joint(i))%told))
                if (spec%branch == 0) cycle
                if (.not. step%has_branches) then
                    call fail(status, status_bad_input, "joint "//quoted(spec%name)//": 'branch' has no meaning here: " &
                              //"a dyad with two slides has one assembly")
                else if (branch == -spec%branch) then
                    call fail(status, status_bad_input, "joint "//quoted(spec%name)//": 'branch' contradicts that of " &
                              //"another joint of the same dyad")
                end if
                branch = spec%branch
            end associate
        end do
    end function forced_branch

    !> Do the joints close if the links are left where their markers are written?
    logical function fits_as_written(model, link, joint, plane)
        type(model_type), intent(in) :: model
        integer, intent(in) :: link(:), joint(:)
        type(planar_motion), intent(in) :: plane
        real(wp) :: gap(2), u(2)
        integer :: i

        fits_as_written = .true.
        do i = 1, size(joint)
            associate (joint => model%joint(joint(i)))
                gap = placed(joint%link(2), joint%point(:2, 2), .true.) - placed(joint%link(1), joint%point(:2, 1), .true.)
                if (joint%kind == joint_prismatic) then
                    u = placed(joint%link(1), joint%frame(:2, 3, 1), .false.)
                    gap = [0.0_wp, u(1)*gap(2) - u(2)*gap(1)]
                end if
                fits_as_written = fits_as_written .and. norm2(gap) <= fit*scene_size(model)
            end associate
        end do

    contains

        !> A point or direction of a link of the group as written, of another link where it is.
        function placed(l, v, is_point) result(w)
            integer, intent(in) :: l
            real(wp), intent(in) :: v(2)
            logical, intent(in) :: is_point
            real(wp) :: w(2)

            w = v
            if (any(link == l)) return
            w = lane_of(plane%rotation(orientation_of(model, l)).rotate.v, 1)
            if (is_point) w = w + lane_of(plane%position(l), 1)
        end function placed
    end function fits_as_written

    ! ---------------------------------------------------------------- groups

    !> Find the assembly of a group at the start, in a plane or in space.
    !>
    !> **Errors**: `status_bad_input` for a group that cannot be closed there.
    subroutine start_group(model, i, choices, state, status, like)
        type(model_type), intent(inout) :: model
        integer, intent(in) :: i                           !! step of the plan
        type(start_choices), intent(inout) :: choices
        type(kinematic_state), intent(inout) :: state
        type(status_type), intent(inout) :: status
        type(model_type), intent(in), optional :: like     !! a model that stands as this one will
        integer :: n_found
        logical :: is_known

        is_known = .false.
        if (present(like) .and. choices%passed_over(i) == 0) &
            call take_group_start(model, model%step(i), like, state, n_found, is_known)
        if (.not. is_known) call find_group_start(model, model%step(i), choices%passed_over(i), state, n_found)
        choices%n_way(i) = max(n_found, 1)
        associate (group => model%group(model%step(i)%first))
            group%n_found = n_found
            group%n_passed_over = choices%passed_over(i)
            group%chosen_by = merge(by_start, by_nothing, has_start(model, group%link, group%joint))
            call keep_group(model, group, state, status)
        end associate
    end subroutine start_group

    !> ", lift.P = 0.05 m", of a few coordinates.
    function places_in_words(model, state) result(text)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        character(len=:), allocatable :: text
        integer, parameter :: few = 3
        integer :: k

        text = ""
        if (model%n_q > few) return
        do k = 1, model%n_q
            text = text//", "//trim(model%scene%coordinate(k)%name)//" = "
            if (is_length(model, k)) then
                text = text//to_text(state%q(1, k))//" m"
            else
                text = text//to_text(state%q(1, k)*180/pi)//" deg"
            end if
        end do
    end function places_in_words

    !> Where the group's links have been placed at the start.
    subroutine keep_group(model, group, state, status)
        type(model_type), intent(in) :: model
        type(group_type), intent(inout) :: group
        type(kinematic_state), intent(in) :: state
        type(status_type), intent(inout) :: status
        integer :: i

        if (state%not_converged(1) .or. state%singular(1)) then
            call fail(status, status_bad_input, "link "//quoted(model%link(group%link(1))%name)//" and the links assembled with " &
                      //"it cannot be closed at the start"//places_in_words(model, state)//lock_in_words(model)//" (expected " &
                      //"coordinates within reach, and 'start' positions of these links near a closed assembly)")
            return
        end if
        do i = 1, size(group%link)
            group%start(:, i) = state%group%place(1, :, group%link(i))
        end do
    end subroutine keep_group

    !> Perhaps no start closes because of a coordinate that cannot move by itself. It may be so where the joints alone close, and
    !> nowhere else: with its arms crossed a Delta stands still.
    function lock_in_words(model) result(text)
        type(model_type), intent(in) :: model
        character(len=:), allocatable :: text
        logical :: follows
        integer :: k

        text = ""
        call find_locked(model, k, follows)
        if (k == 0) return
        text = ": out of reach, or coordinate "//quoted(model%scene%coordinate(k)%name)
        if (follows) then
            text = text//" cannot move by itself: the joints make it follow those before it"
        else
            text = text//" cannot move: the other joints hold it fast"
        end if
    end function lock_in_words
end module linkdyn_planar_start
