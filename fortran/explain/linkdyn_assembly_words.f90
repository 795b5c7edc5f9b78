!> What chooses each assembly of a mechanism in its scene: branches, starts of joint variables, starts of links.
!>
!> What says enough is found by trying: the scene is built anew with the words of each assembly, and more links of the groups that
!> are closed by iteration are placed until every assembly leads back to itself.
module linkdyn_assembly_words
    use linkdyn_angles, only: angles_of_matrix
    use linkdyn_builder, only: build_model
    use linkdyn_constants, only: pi
    use linkdyn_group_start, only: is_alike
    use linkdyn_joint_table, only: turns_about_point, is_slide
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state
    use linkdyn_model, only: model_type, group_type, step_type, step_hung, is_dyad
    use linkdyn_scene, only: scene_type, joint_prismatic, joint_cylindrical, joint_spherical, joint_n_variable, is_pose_part
    use linkdyn_spatial_start, only: list_parts
    use linkdyn_status, only: status_type
    implicit none (type, external)
    private
    public :: assembly_list, chooser_of, find_words, chain_key

    !> Which links of a group are placed: the first of these that chooses.
    integer, parameter :: platforms_if_needed = 0  !! those with legs about them, where nothing turns or slides
    integer, parameter :: platforms = 1
    integer, parameter :: held_links = 2           !! all but those that may spin idly
    integer, parameter :: every_link = 3
    integer, parameter :: as_joints = 4            !! and joints of chains that have no key: legs to be written out

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
        type(kinematic_state), allocatable :: state(:) !! in which it closes (n)
    end type assembly_list

contains

    !> The joint at which a step's branch can be written: between its links or, of a dyad, any of its own; of a platform on rods
    !> where the first of these ends. 0: none, or all of them are parts of chains, which have no such key.
    pure integer function chooser_of(model, step) result(joint)
        type(model_type), intent(in) :: model
        type(step_type), intent(in) :: step
        integer :: k

        joint = 0
        if (.not. step%has_branches) return
        if (.not. is_of_chain(model%joint(step%joint(2))%name)) joint = model%joint(step%joint(2))%told
        if (joint > 0 .or. .not. is_dyad(step%kind)) return
        do k = step%n_link + 1, 1, -1
            if (.not. is_of_chain(model%joint(step%joint(k))%name)) joint = model%joint(step%joint(k))%told
        end do
    end function chooser_of

    !> Such joints and links are called after their leg, with a dot. One that the scene calls so itself has a start, too.
    pure logical function is_of_chain(name)
        character(len=*), intent(in) :: name

        is_of_chain = index(name, ".") > 0
    end function is_of_chain

    !> The key of a chain that says what a joint variable of it is at the start, of a crank's rod to which side it is turned;
    !> blank: it is no chain's, or one's that has no key for it.
    pure character(len=5) function chain_key(model, variable) result(key)
        type(model_type), intent(in) :: model
        integer, intent(in) :: variable            !! of the model
        integer :: j, k, leg

        key = ""
        j = joint_of(model, variable)
        if (.not. is_of_chain(model%joint(j)%name)) return
        if (is_in_group(model, j) .and. .not. model%scene%joint(j)%has_start) return
        key = "start"
        if (is_slide(model%joint(j)%told_kind, variable - model%joint(j)%first_variable)) return
        leg = index(model%joint(j)%name, ".")
        do k = 1, j - 1
            ! the drive is the first joint of a leg with a crank
            if (model%joint(k)%name(:leg) == model%joint(j)%name(:leg)) key = "elbow"
        end do
    end function chain_key

    pure logical function is_in_group(model, j)
        type(model_type), intent(in) :: model
        integer, intent(in) :: j
        integer :: g

        is_in_group = any([(any(model%group(g)%joint == j), g=1, size(model%group))])
    end function is_in_group

    pure integer function joint_of(model, variable) result(joint)
        type(model_type), intent(in) :: model
        integer, intent(in) :: variable

        joint = findloc(model%joint(:model%n_joint)%first_variable < variable .and. &
                        variable <= model%joint(:model%n_joint)%first_variable &
                        + joint_n_variable(model%joint(:model%n_joint)%told_kind), .true., dim=1)
    end function joint_of

    !> What the keys `start` and `elbow` of a chain say: of a slide how far it is, else the angle between crank and rod.
    pure integer function variable_of_chain(model, step) result(variable)
        type(model_type), intent(in) :: model
        type(step_type), intent(in) :: step
        integer :: k

        variable = model%joint(step%joint(2))%first_variable + told_variable(model, step%joint(2))
        do k = 1, 3
            associate (joint => model%joint(step%joint(k)))
                if (joint%told_kind == joint_prismatic) variable = joint%first_variable + 1
            end associate
        end do
    end function variable_of_chain

    !> The variable of a chain's joint that its keys say.
    pure integer function told_variable(model, j) result(v)
        type(model_type), intent(in) :: model
        integer, intent(in) :: j

        v = 1
        associate (kind => model%joint(model%joint(j)%told)%told_kind)
            if (kind == joint_cylindrical) v = 2
            if (kind == joint_spherical) v = 3
        end associate
    end function told_variable

    !> Fill `list%telling` and `list%placed`.
    subroutine find_words(model, list)
        type(model_type), intent(in) :: model
        type(assembly_list), intent(inout) :: list
        integer :: extent(size(model%group)), extent_now
        logical :: chooses(size(model%group))

        extent = platforms_if_needed
        call list_starts(model, extent, list)
        if (list%n == 1) return
        do extent_now = platforms, as_joints
            call try_words(model, list, chooses)
            if (all(chooses)) return
            where (.not. chooses) extent = extent_now
            call list_starts(model, extent, list)
        end do
    end subroutine find_words

    !> What starts can choose in steps whose branch cannot be written, and in groups. What the scene says of the start is told anew,
    !> of whatever link or joint: it counts beside them, and would choose another.
    subroutine list_starts(model, extent, list)
        type(model_type), intent(in) :: model
        integer, intent(in) :: extent(:)           !! of the groups
        type(assembly_list), intent(inout) :: list
        integer, allocatable :: link(:), joint(:)
        integer :: i, k

        list%telling = [integer ::]
        list%placed = [integer ::]
        do i = 1, size(model%step)
            associate (step => model%step(i))
                if (.not. step%has_branches .or. chooser_of(model, step) > 0) cycle
                if (step%kind == step_hung) then
                    list%placed = [list%placed, step%link(1)]
                else
                    list%telling = [list%telling, variable_of_chain(model, step)]
                end if
                call list_parts(model, i, link, joint)
                do k = 1, size(link)
                    if (any(list%placed == link(k)) .or. .not. model%scene%link(link(k))%has_start) cycle
                    list%placed = [list%placed, link(k)]
                end do
                do k = 1, size(joint)
                    call tell_joint(joint(k), .false., .false.)
                end do
            end associate
        end do
        do i = 1, size(model%group)
            associate (group => model%group(i))
                do k = 1, size(group%joint)
                    call tell_joint(group%joint(k), extent(i) < held_links .or. extent(i) == as_joints, extent(i) == as_joints)
                end do
                list%placed = [list%placed, telling_links(model, group, extent(i))]
            end associate
        end do

    contains

        !> A joint that the scene starts; with `is_asked` any that a start can choose, but its variables that are coordinates.
        subroutine tell_joint(j, is_asked, in_chains)
            integer, intent(in) :: j
            logical, intent(in) :: is_asked
            logical, intent(in) :: in_chains       !! it may be a chain's that has no key for it
            integer :: v, g

            associate (joint => model%joint(j))
                if (is_pose_part(joint%kind)) return
                if (.not. joint%has_start) then
                    if (.not. is_asked .or. turns_about_point(joint%told_kind)) return
                    if (is_of_chain(joint%name) .and. .not. in_chains) return
                end if
                do v = 1, joint_n_variable(joint%told_kind)
                    if (is_of_chain(joint%name) .and. .not. in_chains .and. v /= told_variable(model, j)) cycle
                    if (any(list%telling == joint%first_variable + v)) cycle
                    do g = 1, size(model%group)
                        if (any(model%group(g)%joint == j)) exit
                    end do
                    if (g <= size(model%group)) then
                        if (model%group(g)%coordinate(v, findloc(model%group(g)%joint, j, dim=1)) > 0) cycle
                    end if
                    list%telling = [list%telling, joint%first_variable + v]
                end do
            end associate
        end subroutine tell_joint
    end subroutine list_starts

    !> Links of a group whose places choose, and those that the scene places; those of chains have no start.
    pure function telling_links(model, group, extent) result(link)
        type(model_type), intent(in) :: model
        type(group_type), intent(in) :: group
        integer, intent(in) :: extent
        integer, allocatable :: link(:)
        integer, parameter :: of_a_leg = 2             !! joints
        logical :: tells(size(group%link)), is_named(size(group%link))
        integer :: i

        is_named = [(.not. is_of_chain(model%link(group%link(i))%name), i=1, size(group%link))]
        tells = [(model%first_at(group%link(i) + 1) - model%first_at(group%link(i)) > of_a_leg, i=1, size(group%link))]
        if (.not. any(tells) .or. extent >= held_links) tells = model%link(group%link)%spin == 0
        if (extent >= every_link) tells = .true.
        if (extent == platforms_if_needed) tells = tells .and. .not. has_simple_joint(model, group)
        link = pack(group%link, is_named .and. (tells .or. model%scene%link(group%link)%has_start))
    end function telling_links

    !> Is there a hinge or slide whose start can be told, and is no coordinate?
    pure logical function has_simple_joint(model, group) result(has)
        type(model_type), intent(in) :: model
        type(group_type), intent(in) :: group
        integer :: i, n

        has = .false.
        do i = 1, size(group%joint)
            associate (joint => model%joint(group%joint(i)))
                if (is_pose_part(joint%kind)) cycle
                if (turns_about_point(joint%told_kind)) cycle
                if (is_of_chain(joint%name) .and. .not. joint%has_start) cycle
                n = joint_n_variable(joint%told_kind)
                has = has .or. any(group%coordinate(:n, i) == 0)
            end associate
        end do
    end function has_simple_joint

    ! ---------------------------------------------------------------- do they choose?

    !> Does each group of each assembly close so again, if the scene says its words?
    subroutine try_words(model, list, chooses)
        type(model_type), intent(in) :: model
        type(assembly_list), intent(in) :: list
        logical, intent(out) :: chooses(:)         !! (group)
        type(scene_type) :: told
        type(model_type) :: again
        type(status_type) :: status
        integer :: g, n

        chooses = .true.
        told = model%scene
        if (allocated(told%hold)) deallocate (told%hold)    ! of idle spins: by how links stand
        do n = 1, list%n
            if (.not. any(chooses)) return
            call tell_starts(model, list, n, told)
            call build_model(told, again, status)
            do g = 1, size(model%group)
                if (chooses(g)) chooses(g) = status%is_ok()
                if (chooses(g)) chooses(g) = closes_so(model, g, again, list%state(n)%group%place(1, :, :))
            end do
        end do
    end subroutine try_words

    !> Does a group close at the start of another model as in an assembly of its own?
    pure logical function closes_so(model, g, again, place) result(does)
        type(model_type), intent(in) :: model
        integer, intent(in) :: g
        type(model_type), intent(in) :: again
        real(wp), intent(in) :: place(:, :)        !! of all links; the group's count
        real(wp) :: there(size(place, 1), size(place, 2))
        integer :: i, k, l

        there = place
        does = .false.
        do i = 1, size(again%group)
            do k = 1, size(again%group(i)%link)
                l = again%group(i)%link(k)
                if (.not. any(model%group(g)%link == l)) cycle
                there(:, l) = again%group(i)%start(:, k)
                does = .true.
            end do
        end do
        if (does) does = is_alike(model, model%group(g), there, place)
    end function closes_so

    !> Write an assembly's words into the scene as who reads them would.
    subroutine tell_starts(model, list, n, scene)
        type(model_type), intent(in) :: model
        type(assembly_list), intent(in) :: list
        integer, intent(in) :: n                   !! the assembly
        type(scene_type), intent(inout) :: scene
        real(wp) :: value
        integer :: i, j, v

        scene%joint(list%chooser)%branch = list%branch(:, n)
        do i = 1, size(list%telling)
            scene%joint(joint_of(model, list%telling(i)))%start = 0
        end do
        do i = 1, size(list%telling)
            j = joint_of(model, list%telling(i))
            v = list%telling(i) - model%joint(j)%first_variable
            value = list%variable(list%telling(i), n)
            if (chain_key(model, list%telling(i)) == "elbow") value = sign(pi/2, value)
            scene%joint(j)%has_start = .true.
            scene%joint(j)%start(v) = value
        end do
        do i = 1, size(list%placed)
            associate (spec => scene%link(list%placed(i)))
                spec%has_start = .true.
                spec%start = [list%position(:, list%placed(i), n), angles_of_matrix(list%rotation(:, :, list%placed(i), n))]
            end associate
        end do
    end subroutine tell_starts
end module linkdyn_assembly_words
