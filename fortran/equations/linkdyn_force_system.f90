!> The equations of motion: joint reactions and driving forces in balance with what each link's motion asks for.
!>
!> For every moving link, about a point P of it,
!>
!>     sum of all forces that act                           = force of Newton and Euler
!>     sum of their moments about P, and of all moments     = moment of Newton and Euler
!>
!> Some of what acts is unknown: a reaction along every direction in which its joint transmits, and driving forces.
module linkdyn_force_system
    use linkdyn_acting, only: acting_type, turned, at_joint_variable
    use linkdyn_belts, only: belt_reaction
    use linkdyn_bodies, only: world_axes, own_axes, point_position
    use linkdyn_cam, only: cam
    use linkdyn_inertia_wrench, only: inertia_wrench, mass_properties
    use linkdyn_joint_table, only: along_axes, along_x_and_y, along_z, along_normal, is_geared
    use linkdyn_kinds, only: wp
    use linkdyn_layout, only: layout_type, about_cog, about_origin
    use linkdyn_mechanism, only: mechanism_type, wheel_wrench, wheel_push, properties_of, marker_point, marker_frame, &
        point_of_action, pair_of
    use linkdyn_model, only: holds_spin
    use linkdyn_scene, only: name_len, joint_spherical
    use linkdyn_system, only: system_type, unknown, require, solved
    use linkdyn_value, only: value, is_zero, abs, operator(+), operator(*)
    use linkdyn_vector, only: vector, rotation, zero_vector, unit_vector, components, operator(+), operator(-), operator(*), &
        operator(.cross.)
    implicit none (type, external)
    private
    public :: force_unknowns, unknown_note, add_reactions, add_unknown_drives, balance_links, reaction_of, push_of_teeth, label_len

    integer, parameter :: label_len = name_len + 4
    character(len=2), parameter :: component_name(6) = ["Fx", "Fy", "Fz", "Mx", "My", "Mz"]

    !> What an unknown is, for people who read the matrix.
    type :: unknown_note
        character(len=label_len) :: name = ""
        integer :: joint = 0                           !! at which it acts
        logical :: is_moment = .false.
        integer :: axis = 0                            !! of the world, along or about which it is; 0: none of these
        logical :: is_thread = .false.                 !! a force along a thread, with a moment
    end type unknown_note

    type :: force_unknowns
        type(acting_type), allocatable :: reaction(:)  !! (joint)
        type(acting_type), allocatable :: tooth(:)     !! of gears, on each of both links by itself
        type(value), allocatable :: mesh(:)            !! (gear) force along the pitch circles [N]
        type(value), allocatable :: press(:)           !! (cam) force on the follower along the curve's normal [N]
        type(value), allocatable :: effort(:)          !! (actuator) driving force or torque, known or unknown [N, N m]
        type(value), allocatable :: transmitted(:)     !! (actuator) what of it acts on the links: without the rotor's inertia
        logical :: wants_names = .false.               !! for a matrix that people read
        type(unknown_note), allocatable :: note(:)     !! of the unknowns, in their order
        character(len=label_len), allocatable :: equation(:)   !! of the equations, in theirs
    end type force_unknowns

contains

    ! ---------------------------------------------------------------- unknowns

    !> Reactions of all joints as unknowns.
    subroutine add_reactions(mechanism, layout, system, unknowns)
        type(mechanism_type), intent(in) :: mechanism
        type(layout_type), intent(in) :: layout
        type(system_type), intent(inout) :: system
        type(force_unknowns), intent(inout) :: unknowns
        integer :: j

        allocate (unknowns%reaction(mechanism%model%n_joint), unknowns%effort(mechanism%model%n_actuator), &
                  unknowns%transmitted(mechanism%model%n_actuator))
        allocate (unknowns%note(0), unknowns%equation(0), unknowns%tooth(0), unknowns%press(mechanism%model%n_cam), &
                  unknowns%mesh(size(mechanism%model%gear)))
        do j = 1, mechanism%model%n_joint
            call add_reaction(mechanism, layout%unknown_side(j), j, system, unknowns)
        end do
    end subroutine add_reactions

    !> What one joint passes on, as unknowns along the directions in which its kind holds: forces, moments, and what comes with
    !> them.
    subroutine add_reaction(mechanism, side, j, system, unknowns)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: side                    !! in the axes of this link; 0: world axes
        integer, intent(in) :: j
        type(system_type), intent(inout) :: system
        type(force_unknowns), intent(inout) :: unknowns
        type(acting_type) :: acting

        associate (joint => mechanism%model%joint(j), kind => mechanism%kind(j)%is)
            acting%joint = j
            if (is_geared(joint%kind)) then
                call add_tooth(joint%gear)
                return
            end if
            if (side > 0) acting%turning = mechanism%bodies%body(joint%link(side))%turning
            if (joint%cam > 0) then
                call add_press(joint%cam)
                return
            end if
            acting%force = sum_along(kind%forces, is_force=.true.)
            acting%moment = zero_vector()
            if (kind%is_threaded) call add_thread(kind%pitch)
            acting%moment = acting%moment + sum_along(kind%moments, is_force=.false.)
            unknowns%reaction(j) = acting
        end associate

    contains

        !> One force between two wheels, in the axes of their carrier. The moments of both links are about their own markers.
        subroutine add_tooth(g)
            integer, intent(in) :: g
            type(acting_type) :: half
            type(value) :: size
            type(vector) :: force, couple
            integer :: s

            size = unknown(system)
            unknowns%mesh(g) = size
            call note("Ft", is_moment=.false., axis=0, is_thread=.false.)
            do s = 1, 2
                call wheel_wrench(mechanism, g, s, force, couple)
                half%link = mechanism%model%joint(j)%link(s)
                half%turning = mechanism%bodies%body(mechanism%model%gear(g)%carrier)%turning
                half%point = marker_point(mechanism, j, s)
                half%force = size*force
                half%moment = size*couple
                if (s == 2) then
                    acting%turning = half%turning
                    acting%force = half%force
                    acting%moment = half%moment
                    unknowns%reaction(j) = acting
                else
                    half%force = -half%force
                    half%moment = -half%moment
                end if
                unknowns%tooth = [unknowns%tooth, half]
            end do
        end subroutine add_tooth

        !> One force, along the normal where the curve is touched; a face is pressed beside its marker.
        subroutine add_press(c)
            integer, intent(in) :: c

            unknowns%press(c) = unknown(system)
            call note("Fn", is_moment=.false., axis=0, is_thread=.false.)
            associate (size => unknowns%press(c))
                select type (kind => mechanism%kind(j)%is)
                class is (cam)
                    acting%force = size*turned(mechanism%bodies, kind%normal(pair_of(mechanism, j)), 0, acting%turning)
                    acting%moment = size*turned(mechanism%bodies, kind%moment(pair_of(mechanism, j)), 0, acting%turning)
                end select
            end associate
            unknowns%reaction(j) = acting
        end subroutine add_press

        !> A force along the axis and the moment about it that comes with it: together they have no power.
        subroutine add_thread(pitch)
            type(value), intent(in) :: pitch           !! [m/rad]
            type(rotation) :: frame
            type(vector) :: thrust

            frame = frame_in(max(side, 1))
            thrust = zero_vector()
            call add(frame%z, .true., "F3", 0, thrust, is_thread=.true.)
            acting%force = acting%force + thrust
            acting%moment = -(pitch*thrust)
        end subroutine add_thread

        function sum_along(directions, is_force) result(total)
            integer, intent(in) :: directions
            logical, intent(in) :: is_force
            type(vector) :: total
            type(rotation) :: frame
            integer :: k

            total = zero_vector()
            select case (directions)
            case (along_axes)
                do k = 1, 3
                    call add(unit_vector(k), is_force, component_name(merge(k, k + 3, is_force)), merge(k, 0, side == 0), total)
                end do
            case (along_x_and_y)
                frame = frame_in(max(side, 1))
                call add(frame%x, is_force, merge("F1", "M1", is_force), 0, total)
                call add(frame%y, is_force, merge("F2", "M2", is_force), 0, total)
            case (along_z)
                frame = frame_in(max(side, 1))
                call add(frame%z, is_force, merge("F1", "M1", is_force), 0, total)
            case (along_normal)
                call add(normal(), is_force, merge("F1", "M1", is_force), 0, total)
            end select
        end function sum_along

        !> One more unknown. In a plane nothing acts across it: such an unknown does not exist.
        subroutine add(direction, is_force, name, axis, total, is_thread)
            type(vector), intent(in) :: direction
            logical, intent(in) :: is_force
            character(len=2), intent(in) :: name
            integer, intent(in) :: axis                !! of the world; 0: none of these
            type(vector), intent(inout) :: total
            logical, intent(in), optional :: is_thread !! absent: false
            character(len=2) :: own_name

            own_name = name
            if (mechanism%model%is_planar) then
                if (is_force .and. is_zero(direction%x) .and. is_zero(direction%y)) return
                if (.not. is_force .and. is_zero(direction%z)) return
                if (name(2:) == "1" .or. name(2:) == "2") own_name = merge("Fn", "Mz", is_force)
            end if
            total = total + unknown(system)*direction
            call note(own_name, .not. is_force, axis, present(is_thread))
        end subroutine add

        subroutine note(name, is_moment, axis, is_thread)
            character(len=2), intent(in) :: name
            logical, intent(in) :: is_moment, is_thread
            integer, intent(in) :: axis

            if (unknowns%wants_names) unknowns%note = [unknowns%note, unknown_note( &
                trim(mechanism%model%joint(j)%name)//" "//name, j, is_moment, axis, is_thread)]
        end subroutine note

        !> Frame of one marker in the axes of the unknowns.
        function frame_in(s) result(frame)
            integer, intent(in) :: s
            type(rotation) :: frame

            associate (from => mechanism%bodies%body(mechanism%model%joint(j)%link(s))%turning)
                frame = marker_frame(mechanism, j, s)
                frame%x = turned(mechanism%bodies, frame%x, from, acting%turning)
                frame%y = turned(mechanism%bodies, frame%y, from, acting%turning)
                frame%z = turned(mechanism%bodies, frame%z, from, acting%turning)
            end associate
        end function frame_in

        !> Square to both axes of a universal joint. A leg knows that of its base in its own axes.
        function normal() result(n)
            type(vector) :: n
            type(rotation) :: frame
            type(vector) :: axis(2)
            integer :: s

            do s = 1, 2
                if (side == 3 - s .and. mechanism%universal_axis(j)%x%node > 0) then
                    axis(s) = mechanism%universal_axis(j)
                else
                    frame = frame_in(s)
                    axis(s) = frame%z
                end if
            end do
            n = axis(1) .cross.axis(2)
        end function normal
    end subroutine add_reaction

    !> Driving forces of some actuators as unknowns: what acts on the links, and nothing yet of rotors.
    subroutine add_unknown_drives(mechanism, is_unknown, system, unknowns)
        type(mechanism_type), intent(in) :: mechanism
        logical, intent(in) :: is_unknown(:)           !! (actuator)
        type(system_type), intent(inout) :: system
        type(force_unknowns), intent(inout) :: unknowns
        character(len=3) :: symbol
        integer :: i

        do i = 1, size(is_unknown)
            if (.not. is_unknown(i)) cycle
            unknowns%transmitted(i) = unknown(system)
            unknowns%effort(i) = unknowns%transmitted(i)
            if (.not. unknowns%wants_names) cycle
            associate (actuator => mechanism%model%scene%actuator(i))
                symbol = merge("F  ", "tau", mechanism%kind(actuator%joint)%is%is_slide(actuator%variable))
                unknowns%note = [unknowns%note, unknown_note(trim(symbol)//" "//actuator%name, actuator%joint, &
                                                             symbol == "tau")]
            end associate
        end do
    end subroutine add_unknown_drives

    ! ---------------------------------------------------------------- equations

    !> All links' equations. Efforts of all actuators must be there, unknown or not.
    subroutine balance_links(mechanism, layout, acting, system, unknowns)
        type(mechanism_type), intent(in) :: mechanism
        type(layout_type), intent(in) :: layout
        type(acting_type), intent(in) :: acting(:)     !! what is known: loads, springs
        type(system_type), intent(inout) :: system
        type(force_unknowns), intent(inout) :: unknowns
        type(acting_type), allocatable :: all(:)
        integer, allocatable :: first(:), which(:)
        integer :: i, l

        associate (model => mechanism%model)
            all = [pack(unknowns%reaction, model%joint(:model%n_joint)%gear == 0), unknowns%tooth, &
                   (at_joint_variable(mechanism, model%scene%actuator(i)%joint, model%scene%actuator(i)%variable, &
                                      unknowns%transmitted(i)), i=1, model%n_actuator), acting]
            call sort_by_links(mechanism, all, first, which)
            do l = 1, model%n_link
                call balance_link(mechanism, layout, l, all(which(first(l):first(l + 1) - 1)), system, unknowns)
            end do
        end associate
    end subroutine balance_links

    !> What acts on link l is which(first(l):first(l + 1) - 1).
    subroutine sort_by_links(mechanism, acting, first, which)
        type(mechanism_type), intent(in) :: mechanism
        type(acting_type), intent(in) :: acting(:)
        integer, allocatable, intent(out) :: first(:), which(:)
        integer :: link(2, size(acting)), n(0:mechanism%model%n_link), i, side, l

        n = 0
        do i = 1, size(acting)
            link(:, i) = [acting(i)%link, 0]
            if (acting(i)%joint > 0) link(:, i) = mechanism%model%joint(acting(i)%joint)%link
            n(link(:, i)) = n(link(:, i)) + 1
        end do
        allocate (first(mechanism%model%n_link + 1), which(sum(n(1:))))
        first(1) = 1
        do l = 1, mechanism%model%n_link
            first(l + 1) = first(l) + n(l)
        end do
        n(1:) = first(:mechanism%model%n_link)
        do i = 1, size(acting)
            do side = 1, 2
                l = link(side, i)
                if (l == 0) cycle
                which(n(l)) = i
                n(l) = n(l) + 1
            end do
        end do
    end subroutine sort_by_links

    !> Six equations of a link; in a plane the three that say something.
    subroutine balance_link(mechanism, layout, l, acting, system, unknowns)
        type(mechanism_type), intent(in) :: mechanism
        type(layout_type), intent(in) :: layout
        integer, intent(in) :: l
        type(acting_type), intent(in) :: acting(:)     !! on this link
        type(system_type), intent(inout) :: system
        type(force_unknowns), intent(inout) :: unknowns
        type(mass_properties) :: properties
        type(vector) :: force, moment, p, f, m
        type(value) :: row(6)
        integer :: axes, turning, n_before, i, k

        axes = merge(own_axes, world_axes, layout%in_own_axes(l))
        turning = merge(mechanism%bodies%body(l)%turning, 0, layout%in_own_axes(l))
        properties = properties_of(mechanism, l)
        select case (layout%moment_joint(l))
        case (about_origin)
            p = zero_vector()
        case (about_cog)
            p = properties%cog
        case default
            p = own_marker(layout%moment_joint(l))
        end select
        call inertia_wrench(mechanism%bodies, l, properties, p, axes, force, moment)
        force = -force
        moment = -moment
        do i = 1, size(acting)
            f = turned(mechanism%bodies, acting(i)%force, acting(i)%turning, turning)
            m = turned(mechanism%bodies, acting(i)%moment, acting(i)%turning, turning)
            if (is_first(acting(i))) then
                f = -f
                m = -m
            end if
            force = force + f
            moment = moment + m + (arm_to(acting(i)) .cross.f)
        end do
        row = [components(force), components(moment)]
        do k = 1, 6
            if (mechanism%model%is_planar .and. any(k == [3, 4, 5])) cycle
            n_before = system%n_equation
            call require(system, row(k))
            if (unknowns%wants_names .and. system%n_equation > n_before) unknowns%equation = &    ! one without unknowns is none
                [character(len=label_len) :: unknowns%equation, trim(mechanism%model%link(l)%name)//" "//component_name(k)]
        end do

    contains

        !> Is the link the first of the joint at which this acts?
        logical function is_first(acting)
            type(acting_type), intent(in) :: acting

            is_first = .false.
            if (acting%joint > 0) is_first = mechanism%model%joint(acting%joint)%link(1) == l
        end function is_first

        !> The link's own marker of a joint, own axes.
        function own_marker(j) result(point)
            integer, intent(in) :: j
            type(vector) :: point

            point = marker_point(mechanism, j, merge(1, 2, mechanism%model%joint(j)%link(1) == l))
        end function own_marker

        !> From P to where it acts, at a joint the second marker's point, in the axes of the equations.
        function arm_to(acting) result(arm)
            type(acting_type), intent(in) :: acting
            type(vector) :: arm

            if (acting%joint == 0) then
                arm = acting%point - p
            else
                arm = point_of_action(mechanism, acting%joint, merge(1, 2, is_first(acting))) - p
            end if
            arm = turned(mechanism%bodies, arm, mechanism%bodies%body(l)%turning, turning)
        end function arm_to
    end subroutine balance_link

    !> A joint's reaction in world axes, once the equations are solved: Fx Fy Fz Mx My Mz of the first link on the second.
    function reaction_of(mechanism, unknowns, system, j) result(r)
        type(mechanism_type), intent(in) :: mechanism
        type(force_unknowns), intent(in) :: unknowns
        type(system_type), intent(inout) :: system
        integer, intent(in) :: j
        type(value) :: r(6)
        integer :: g, k

        if (mechanism%model%joint(j)%belt > 0) then
            r = belt_reaction(mechanism, mechanism%model%joint(j)%belt)
            return
        end if
        associate (acting => unknowns%reaction(j), bodies => mechanism%bodies)
            r(:3) = solved(system, components(turned(bodies, acting%force, acting%turning, 0)))
            if (holds_spin(mechanism%model%joint(j)) .and. mechanism%model%joint(j)%told_kind == joint_spherical) then
                r(4:) = components(zero_vector())        ! what holds an idle spin takes no moment
            else
                r(4:) = solved(system, components(turned(bodies, acting%moment, acting%turning, 0)))
            end if
        end associate
        do g = 1, size(mechanism%model%gear)
            associate (gear => mechanism%model%gear(g))
                if (gear%joint == j .and. size(gear%carries) > 0) r = r + driven_apart(mechanism, unknowns, system, g, j)
                do k = 1, size(gear%carries)
                    if (abs(gear%carries(k)) == j) &
                        r = r + real(sign(1, gear%carries(k)), wp)*driven_apart(mechanism, unknowns, system, g, j)
                end do
            end associate
        end do
    end function reaction_of

    !> Force by which a gear's teeth drive its second wheel off the first, and its moment about a joint's second marker: as large as
    !> that along the pitch circles makes it, whose size has a kink. It moves nothing, so the equations do without; whoever holds
    !> both wheels against each other takes it.
    function driven_apart(mechanism, unknowns, system, g, j) result(wrench)
        type(mechanism_type), intent(in) :: mechanism
        type(force_unknowns), intent(in) :: unknowns
        type(system_type), intent(inout) :: system
        integer, intent(in) :: g, j
        type(value) :: wrench(6)
        type(acting_type) :: acting

        acting = push_of_teeth(mechanism, g, j)
        wrench = abs(solved(system, unknowns%mesh(g)))*[components(acting%force), components(acting%moment)]
    end function driven_apart

    !> The same for a force along the pitch circles of one newton, in world axes.
    function push_of_teeth(mechanism, g, j) result(acting)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: g, j                    !! gear, joint
        type(acting_type) :: acting
        type(vector) :: push, pitch, at

        call wheel_push(mechanism, g, push, pitch)
        associate (carrier => mechanism%model%gear(g)%carrier, joint => mechanism%model%joint(j), bodies => mechanism%bodies)
            pitch = point_position(bodies, carrier, pitch)
            at = point_position(bodies, joint%link(2), marker_point(mechanism, j, 2))
            acting%joint = j
            acting%force = turned(bodies, push, bodies%body(carrier)%turning, 0)
            acting%moment = (pitch - at) .cross.acting%force
        end associate
    end function push_of_teeth
end module linkdyn_force_system
