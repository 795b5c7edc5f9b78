!> All assemblies of a mechanism that are found at its start.
!>
!> Steps of the plan are gone through in their order. Where one closes in several ways, by a branch or as one of the assemblies of
!> a group that many attempts find, each is taken, and the steps behind are gone through for each.
module linkdyn_assemblies
    use linkdyn_assembly_words, only: assembly_list, chooser_of, find_words
    use linkdyn_group_start, only: find_every_start, is_alike
    use linkdyn_joint_rates, only: measure_joints
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_pass, only: clear_flags, run_step
    use linkdyn_kinematic_state, only: kinematic_state, prepare_kinematics, link_position, link_rotation
    use linkdyn_lane_count, only: lanes
    use linkdyn_model, only: model_type, step_group
    implicit none (type, external)
    private
    public :: find_assemblies

    !> More than anybody looks through: branches multiply.
    integer, parameter :: most = 256

contains

    subroutine find_assemblies(model, list)
        type(model_type), intent(in) :: model
        type(assembly_list), intent(out) :: list
        type(kinematic_state) :: state
        integer :: branch(size(model%step)), chooser(size(model%step)), i

        chooser = [(chooser_of(model, model%step(i)), i=1, size(model%step))]
        list%chooser = pack(chooser, chooser > 0)
        allocate (list%variable(model%n_variable, most), list%branch(size(list%chooser), most), &
                  list%position(3, model%n_link, most), list%rotation(3, 3, model%n_link, most), list%state(most))
        call prepare_kinematics(model, 0, state)
        state%q = spread(model%start_q, 1, lanes)
        state%qd = 0
        state%qdd = 0
        branch = 0
        call go_on(model, 1, .true., branch, state, list)
        call find_words(model, list)
    end subroutine find_assemblies

    !> Steps from the i-th on; first the way of the start, which is so the first in the list.
    recursive subroutine go_on(model, i, as_start, branch, state, list)
        type(model_type), intent(in) :: model
        integer, intent(in) :: i
        logical, intent(in) :: as_start                !! so far all is as at the start
        integer, intent(inout) :: branch(:)
        type(kinematic_state), intent(in) :: state
        type(assembly_list), intent(inout) :: list
        type(kinematic_state) :: here
        integer :: way, first

        if (list%n == most) then
            list%is_complete = .false.
            return
        end if
        if (i > size(model%step)) then
            call note(model, branch, state, list)
            return
        end if
        associate (step => model%step(i))
            if (step%kind == step_group) then
                call try_places(model, i, as_start, branch, state, list)
            else if (step%has_branches) then
                first = nint(model%branch(step%first))
                do way = 1, 2
                    here = state
                    branch(i) = merge(first, -first, way == 1)
                    here%branch(:, step%first) = branch(i)
                    call clear_flags(here)
                    call run_step(model, step, here)
                    if (is_closed(here)) call go_on(model, i + 1, as_start .and. way == 1, branch, here, list)
                end do
                branch(i) = 0
            else
                here = state
                call clear_flags(here)
                call run_step(model, step, here)
                if (is_closed(here)) call go_on(model, i + 1, as_start, branch, here, list)
            end if
        end associate
    end subroutine go_on

    !> A group in all the places that attempts find for it.
    recursive subroutine try_places(model, i, as_start, branch, state, list)
        type(model_type), intent(in) :: model
        integer, intent(in) :: i
        logical, intent(in) :: as_start
        integer, intent(inout) :: branch(:)
        type(kinematic_state), intent(in) :: state
        type(assembly_list), intent(inout) :: list
        type(kinematic_state) :: here
        real(wp), allocatable :: place(:, :, :), start(:, :)
        logical :: is_exhausted
        integer :: k, l

        here = state
        call find_every_start(model, model%step(i), here, place, is_exhausted)
        list%is_complete = list%is_complete .and. is_exhausted
        associate (group => model%group(model%step(i)%first))
            if (as_start) then
                start = place(:, :, 1)
                do l = 1, size(group%link)
                    start(:, group%link(l)) = group%start(:, l)
                end do
                call close_there(start, .true.)
            end if
            do k = 1, size(place, 3)
                if (as_start) then
                    if (is_alike(model, group, place(:, :, k), start)) cycle
                end if
                call close_there(place(:, :, k), .false.)
            end do
        end associate

    contains

        recursive subroutine close_there(at, is_start)
            real(wp), intent(in) :: at(:, :)           !! places of all links; the group's count
            logical, intent(in) :: is_start

            here = state
            here%group%place = spread(at, 1, lanes)
            call clear_flags(here)
            call run_step(model, model%step(i), here)
            if (is_closed(here)) call go_on(model, i + 1, is_start, branch, here, list)
        end subroutine close_there
    end subroutine try_places

    pure logical function is_closed(state)
        type(kinematic_state), intent(in) :: state

        is_closed = .not. (state%unreachable(1) .or. state%not_converged(1) .or. state%singular(1))
    end function is_closed

    subroutine note(model, branch, state, list)
        type(model_type), intent(in) :: model
        integer, intent(in) :: branch(:)
        type(kinematic_state), intent(in) :: state
        type(assembly_list), intent(inout) :: list
        real(wp) :: variable(lanes, model%n_variable), rate(lanes, model%n_variable)
        integer :: l

        list%n = list%n + 1
        list%state(list%n) = state
        call measure_joints(model, state, variable, rate)
        list%variable(:, list%n) = variable(1, :)
        list%branch(:, list%n) = pack(branch, [(chooser_of(model, model%step(l)) > 0, l=1, size(model%step))])
        do l = 1, model%n_link
            list%position(:, l, list%n) = link_position(model, state, l, 1)
            list%rotation(:, :, l, list%n) = link_rotation(model, state, l, 1)
        end do
    end subroutine note
end module linkdyn_assemblies
