!> All assemblies of a mechanism that are found at its start.
!>
!> Steps of the plan are gone through in their order. Where one closes in several ways, by a branch or as one of the assemblies of
!> a group that many attempts find, each is taken, and the steps behind are gone through for each.
module linkdyn_assemblies
    use linkdyn_group_start, only: find_every_start, is_alike
    use linkdyn_joint_rates, only: measure_joints
    use linkdyn_joint_table, only: turns_about_point
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_pass, only: clear_flags, run_step
    use linkdyn_kinematic_state, only: kinematic_state, prepare_kinematics, link_position, link_rotation
    use linkdyn_lane_count, only: lanes
    use linkdyn_model, only: model_type, group_type, step_type, step_group, step_hung, is_dyad
    use linkdyn_scene, only: joint_prismatic, joint_spherical, joint_n_variable, is_pose_part
    implicit none (type, external)
    private
    public :: assembly_list, find_assemblies

    !> More than anybody looks through: branches multiply.
    integer, parameter :: most = 256

    !> What was found; the first is that of the start.
    type :: assembly_list
        integer :: n = 0
        logical :: is_complete = .true.                !! there were no more than are listed
        integer, allocatable :: chooser(:)             !! joints at which a branch can be chosen
        integer, allocatable :: telling(:)             !! joint variables whose starts choose
        integer, allocatable :: placed(:)              !! links whose starts choose, told by the scene or for want of such variables
        integer, allocatable :: branch(:, :)           !! at these joints: +1 or -1 (chooser, n)
        real(wp), allocatable :: variable(:, :)        !! joint variables [m, rad] (n_variable, n)
        real(wp), allocatable :: position(:, :, :)     !! origins of the links [m] (3, n_link, n)
        real(wp), allocatable :: rotation(:, :, :, :)  !! (3, 3, n_link, n)
    end type assembly_list

contains

    subroutine find_assemblies(model, list)
        type(model_type), intent(in) :: model
        type(assembly_list), intent(out) :: list
        type(kinematic_state) :: state
        integer :: branch(size(model%step)), chooser(size(model%step)), i

        chooser = [(chooser_of(model, model%step(i)), i=1, size(model%step))]
        list%chooser = pack(chooser, chooser > 0)
        call list_starts(model, list)
        allocate (list%variable(model%n_variable, most), list%branch(size(list%chooser), most), &
                  list%position(3, model%n_link, most), list%rotation(3, 3, model%n_link, most))
        call prepare_kinematics(model, 0, state)
        state%q = spread(model%start_q, 1, lanes)
        state%qd = 0
        state%qdd = 0
        branch = 0
        call go_on(model, 1, .true., branch, state, list)
    end subroutine find_assemblies

    !> The joint at which a step's branch can be written: between its links or, of a dyad, any of its own; of a platform on rods
    !> where the first of these ends. 0: none, or all of them are parts of chains, which have no such key.
    pure integer function chooser_of(model, step) result(joint)
        type(model_type), intent(in) :: model
        type(step_type), intent(in) :: step
        integer :: k

        joint = 0
        if (.not. step%has_branches) return
        if (.not. is_of_chain(model, step%joint(2))) joint = model%joint(step%joint(2))%told
        if (joint > 0 .or. .not. is_dyad(step%kind)) return
        do k = step%n_link + 1, 1, -1
            if (.not. is_of_chain(model, step%joint(k))) joint = model%joint(step%joint(k))%told
        end do
    end function chooser_of

    !> Such joints are called after their leg, with a dot. One that the scene calls so itself has a start, too.
    pure logical function is_of_chain(model, joint)
        type(model_type), intent(in) :: model
        integer, intent(in) :: joint

        is_of_chain = index(model%joint(joint)%name, ".") > 0
    end function is_of_chain

    !> What the keys `start` and `elbow` of a chain say: of a slide how far it is, else the angle between crank and rod.
    pure integer function variable_of_chain(model, step) result(variable)
        type(model_type), intent(in) :: model
        type(step_type), intent(in) :: step
        integer :: k

        associate (between => model%joint(step%joint(2)))
            variable = between%first_variable + merge(3, 1, model%joint(between%told)%told_kind == joint_spherical)
        end associate
        do k = 1, 3
            associate (joint => model%joint(step%joint(k)))
                if (joint%told_kind == joint_prismatic) variable = joint%first_variable + 1
            end associate
        end do
    end function variable_of_chain

    !> What starts can choose in groups closed by iteration: hinges and slides, but those that are coordinates; in a group that has
    !> none, links, but those that may spin idly. What the scene says of the start is told anew, of whatever link or joint: it
    !> counts beside them, and would choose another.
    subroutine list_starts(model, list)
        type(model_type), intent(in) :: model
        type(assembly_list), intent(inout) :: list
        logical :: turns_or_slides
        integer :: g, i, v

        allocate (list%telling(0), list%placed(0))
        do i = 1, size(model%step)
            associate (step => model%step(i))
                if (.not. step%has_branches .or. chooser_of(model, step) > 0) cycle
                if (step%kind == step_hung) then
                    list%placed = [list%placed, step%link(1)]
                else
                    list%telling = [list%telling, variable_of_chain(model, step)]
                end if
            end associate
        end do
        do g = 1, size(model%group)
            associate (group => model%group(g))
                turns_or_slides = .false.
                do i = 1, size(group%joint)
                    associate (joint => model%joint(group%joint(i)))
                        if (is_pose_part(joint%kind)) cycle
                        associate (is_simple => .not. turns_about_point(joint%told_kind))
                            if (.not. (is_simple .or. joint%has_start)) cycle
                            do v = 1, joint_n_variable(joint%told_kind)
                                if (group%coordinate(v, i) > 0) cycle
                                list%telling = [list%telling, joint%first_variable + v]
                                turns_or_slides = turns_or_slides .or. is_simple
                            end do
                        end associate
                    end associate
                end do
                if (turns_or_slides) then
                    list%placed = [list%placed, pack(group%link, model%scene%link(group%link)%has_start)]
                else
                    list%placed = [list%placed, telling_links(model, group)]
                end if
            end associate
        end do
    end subroutine list_starts

    !> Links of a group without hinges and slides whose places choose: the platforms, if it has legs about them; and those that the
    !> scene places.
    pure function telling_links(model, group) result(link)
        type(model_type), intent(in) :: model
        type(group_type), intent(in) :: group
        integer, allocatable :: link(:)
        integer, parameter :: of_a_leg = 2             !! joints
        logical :: tells(size(group%link))
        integer :: i

        tells = [(model%first_at(group%link(i) + 1) - model%first_at(group%link(i)) > of_a_leg, i=1, size(group%link))]
        if (.not. any(tells)) tells = model%link(group%link)%spin == 0
        link = pack(group%link, tells .or. model%scene%link(group%link)%has_start)
    end function telling_links

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
        call measure_joints(model, state, variable, rate)
        list%variable(:, list%n) = variable(1, :)
        list%branch(:, list%n) = pack(branch, [(chooser_of(model, model%step(l)) > 0, l=1, size(model%step))])
        do l = 1, model%n_link
            list%position(:, l, list%n) = link_position(model, state, l, 1)
            list%rotation(:, :, l, list%n) = link_rotation(model, state, l, 1)
        end do
    end subroutine note
end module linkdyn_assemblies
