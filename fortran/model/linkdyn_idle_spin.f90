!> Idle spins: links that may turn about the line through their joints while nothing else of the mechanism moves.
!>
!> A rod between two ball joints, both halves of a leg between balls, a piston rod in a cylindrical joint whose ball lies on its
!> axis, a shoe with a ball that slides on a plane, any of these in parts that are welded together. If the links that spin together
!> are bodies of revolution about that line, and nothing acts on them off it, no moment is ever about it: what does not spin at the
!> start never does, and neither forces nor the motion of anything else depend on it.
!>
!> *How it is settled.* One ball of each spin also keeps a direction across the line, in the spinning link, square to a
!> direction of the link beyond: it closes as a universal joint does. Where two links spin on either side of the same ball, a piston
!> in its bore and its shoe on the plate, one of them is held in its cylindrical joint, which closes as a slide does. The spin that
!> follows from this is not that of a free rod, but it has no inertia, since what a link has of it about the line is left out: a
!> rod that does not spin has no angular momentum along itself, and a thin rod none at all. So the moment that holds the spin is
!> zero by itself, and all forces are those of a rod that is free. The direction beyond must not come to lie along the line; it is
!> chosen where the mechanism starts (`linkdyn_spin_axes`).
module linkdyn_idle_spin
    use linkdyn_cross, only: cross
    use linkdyn_kinds, only: wp
    use linkdyn_model, only: model_type, side_of
    use linkdyn_scene, only: hold_spec, coordinate_joint, coordinate_pose, joint_revolute, joint_prismatic, &
        joint_cylindrical, joint_universal, joint_spherical, joint_fixed, joint_planar, frame_link, n_stop, n_clutch, &
        measure_spec, measure_joint, measure_attitude, measure_tilt, measure_twist, measure_turn, marker_axis_at
    use linkdyn_status, only: status_type, fail, status_bad_input
    use linkdyn_text, only: quoted
    implicit none (type, external)
    private
    public :: idle_spin, find_idle_spins, refuse_eccentric, refuse_unheld, hold_spins, square_to
    public :: distance_from, is_round              ! of the submodule

    !> Links that spin as one.
    type :: idle_spin
        integer, allocatable :: link(:)
        integer, allocatable :: ball(:)        !! joints at which the spin can be held
        integer, allocatable :: collar(:)      !! cylindrical joints that can do so instead
    end type idle_spin

    !> A straight line of a link.
    type :: line_type
        logical :: is_there = .false.
        real(wp) :: point(3) = 0               !! link axes [m]
        real(wp) :: axis(3) = 0                !! unit vector, link axes
    end type line_type

    !> A joint of a body, in the axes of one of its links.
    type :: body_joint
        integer :: kind = 0
        real(wp) :: point(3) = 0               !! [m]
        real(wp) :: axis(3) = 0
    end type body_joint

    !> How far from exact what is written in a scene may be, as a part of the link's size, of its largest moment of inertia:
    !> coordinates of points worked out from angles have a dozen digits or so.
    real(wp), parameter :: exact = 1.0e-9_wp

    interface
        ! ---- linkdyn_spin_obstacles
        !> What feels the spin of some links; empty: nothing.
        module function why_spin_matters(model, spin) result(why)
            type(model_type), intent(in) :: model
            type(idle_spin), intent(in) :: spin
            character(len=:), allocatable :: why
        end function why_spin_matters
    end interface

contains

    !> All idle spins of a mechanism in space, and the lines of their links.
    subroutine find_idle_spins(model, spin)
        type(model_type), intent(inout) :: model           !! its links learn of their spin
        type(idle_spin), allocatable, intent(out) :: spin(:)
        type(line_type) :: line(model%n_link)
        type(idle_spin) :: found(model%n_link)
        logical :: is_seen(model%n_link)
        integer :: l, n

        n = 0
        line = [(line_of(model, l), l=1, model%n_link)]
        is_seen = .false.
        do l = 1, model%n_link
            if (model%is_planar .or. is_seen(l) .or. .not. line(l)%is_there) cycle
            call collect_links(model, l, found(n + 1)%link)
            is_seen(pack(found(n + 1)%link, found(n + 1)%link /= frame_link)) = .true.
            found(n + 1)%ball = joints_of(model, found(n + 1)%link, joint_spherical)
            found(n + 1)%collar = joints_of(model, found(n + 1)%link, joint_cylindrical)
            if (.not. is_idle(model, found(n + 1), line)) cycle
            n = n + 1
            model%link(found(n)%link)%spin = n
        end do
        spin = found(:n)
        do l = 1, model%n_link
            if (model%link(l)%spin == 0) cycle
            model%link(l)%spin_point = line(l)%point
            model%link(l)%spin_axis = line(l)%axis
        end do
    end subroutine find_idle_spins

    !> The line on which all joints lie of a link and what is welded to it: balls with their centres, others with their axes. Of a
    !> planar joint it is square to the plane.
    pure function line_of(model, link) result(line)
        type(model_type), intent(in) :: model
        integer, intent(in) :: link
        type(line_type) :: line
        type(body_joint), allocatable :: joint(:)
        real(wp) :: size_of_body, span(3)
        integer :: i, ball

        joint = joints_of_body(model, link)
        if (size(joint) < 2) return
        ball = 0
        size_of_body = 0
        do i = 1, size(joint)
            size_of_body = max(size_of_body, maxval(abs(joint(i)%point)))
            if (joint(i)%kind == joint_spherical) then
                if (ball == 0) then
                    line%point = joint(i)%point
                else
                    span = joint(i)%point - line%point
                    if (norm2(span) > exact*size_of_body) line%axis = span/norm2(span)
                end if
                ball = ball + 1
            else if (any(joint(i)%kind == [joint_revolute, joint_prismatic, joint_cylindrical, joint_planar])) then
                line%axis = joint(i)%axis
            else
                return
            end if
        end do
        if (ball == 0 .or. all(line%axis == 0)) return
        do i = 1, size(joint)
            ! a plane holds a link wherever its marker is
            if (joint(i)%kind /= joint_planar .and. distance_from(line, joint(i)%point) > exact*size_of_body) return
            if (joint(i)%kind == joint_spherical) cycle
            if (norm2(cross(line%axis, joint(i)%axis)) > exact) return
        end do
        line%is_there = .true.
    end function line_of

    !> The joints of a link and of all that is welded to it but the welds themselves; none, if that is the frame.
    pure function joints_of_body(model, link) result(found)
        type(model_type), intent(in) :: model
        integer, intent(in) :: link                    !! in whose axes they are told
        type(body_joint), allocatable :: found(:)
        integer, allocatable :: member(:)
        real(wp) :: rotation(3, 3, model%n_link), position(3, model%n_link)    !! of members, seen from the link
        integer :: i, k, side, other

        allocate (found(0))
        member = [link]
        position(:, 1) = 0
        rotation(:, :, 1) = 0
        do k = 1, 3
            rotation(k, k, 1) = 1
        end do
        i = 0
        do while (i < size(member))
            i = i + 1
            do k = model%first_at(member(i)), model%first_at(member(i) + 1) - 1
                associate (joint => model%joint(model%joint_at(k)))
                    side = side_of(joint, member(i))
                    if (joint%kind /= joint_fixed) then
                        found = [found, body_joint(joint%kind, position(:, i) + matmul(rotation(:, :, i), joint%point(:, side)), &
                                                   matmul(rotation(:, :, i), joint%frame(:, 3, side)))]
                        cycle
                    end if
                    other = joint%link(3 - side)
                    if (other == frame_link) then
                        deallocate (found)
                        allocate (found(0))
                        return
                    end if
                    if (any(member == other)) cycle
                    member = [member, other]
                    associate (n => size(member))
                        rotation(:, :, n) = matmul(rotation(:, :, i), matmul(joint%frame(:, :, side), &
                                                                             transpose(joint%frame(:, :, 3 - side))))
                        position(:, n) = position(:, i) + matmul(rotation(:, :, i), joint%point(:, side)) &
                                         - matmul(rotation(:, :, n), joint%point(:, 3 - side))
                    end associate
                end associate
            end do
        end do
    end function joints_of_body

    pure real(wp) function distance_from(line, point)
        type(line_type), intent(in) :: line
        real(wp), intent(in) :: point(3)               !! link axes [m]

        distance_from = norm2(cross(line%axis, point - line%point))
    end function distance_from

    !> A link and all that slides and welds hold to it: they hand a spin on.
    pure subroutine collect_links(model, first, link)
        type(model_type), intent(in) :: model
        integer, intent(in) :: first
        integer, allocatable, intent(out) :: link(:)       !! the frame may be among them
        integer :: i, k, other

        link = [first]
        i = 0
        do while (i < size(link))
            i = i + 1
            if (link(i) == frame_link) cycle
            do k = model%first_at(link(i)), model%first_at(link(i) + 1) - 1
                associate (joint => model%joint(model%joint_at(k)))
                    other = joint%link(3 - side_of(joint, link(i)))
                    if (any(joint%kind == [joint_prismatic, joint_fixed]) .and. all(link /= other)) link = [link, other]
                end associate
            end do
        end do
    end subroutine collect_links

    !> The joints of a kind at some links but those that the scene leads: a coordinate of theirs has its place among their
    !> variables.
    pure function joints_of(model, link, kind) result(joint)
        type(model_type), intent(in) :: model
        integer, intent(in) :: link(:), kind
        integer, allocatable :: joint(:)
        integer :: j

        joint = pack([(j, j=1, model%n_joint)], [(model%joint(j)%kind == kind &
                                                  .and. any([link == model%joint(j)%link(1), link == model%joint(j)%link(2)]) &
                                                  .and. .not. is_led(j), j=1, model%n_joint)])

    contains

        pure logical function is_led(j)
            integer, intent(in) :: j

            is_led = any(model%scene%coordinate%kind == coordinate_joint .and. model%scene%coordinate%joint == j)
        end function is_led
    end function joints_of

    !> May the links spin, all of them about their lines, without anything that would lead or feel it?
    pure logical function is_idle(model, spin, line)
        type(model_type), intent(in) :: model
        type(idle_spin), intent(in) :: spin
        type(line_type), intent(in) :: line(:)
        integer :: i, j

        is_idle = all(spin%link /= frame_link) .and. size(spin%ball) > 0
        if (is_idle) is_idle = all(line(spin%link)%is_there)
        if (.not. is_idle) return
        do i = 1, size(model%scene%coordinate)
            associate (c => model%scene%coordinate(i))
                if (c%kind == coordinate_pose) is_idle = is_idle .and. all(spin%link /= c%link)
                if (c%kind == coordinate_joint) is_idle = is_idle .and. .not. leads(c%joint, c%variable)
            end associate
        end do
        do i = 1, size(model%scene%actuator)
            is_idle = is_idle .and. .not. leads(model%scene%actuator(i)%joint, model%scene%actuator(i)%variable)
        end do
        do i = 1, size(model%scene%spring)
            j = model%scene%spring(i)%joint
            if (j > 0) is_idle = is_idle .and. .not. leads(j, model%scene%spring(i)%variable)
        end do
        do i = 1, n_stop(model%scene)
            is_idle = is_idle .and. .not. turns(model%scene%laws%measure(model%scene%stop(i)%measure))
        end do
        do i = 1, n_clutch(model%scene)
            associate (clutch => model%scene%clutch(i))
                if (clutch%friction > 0) cycle
                do j = 1, clutch%n_side
                    is_idle = is_idle .and. .not. turns(model%scene%laws%measure(clutch%measure(j)))
                end do
            end associate
        end do

    contains

        !> Does what pushes along a measure turn one of the links?
        pure logical function turns(measure)
            type(measure_spec), intent(in) :: measure

            turns = .false.
            if (measure%kind == measure_joint) turns = leads(measure%joint, measure%variable)
            if (any(measure%kind == [measure_attitude, measure_twist, measure_turn])) turns = feels(measure%link)
            if (measure%kind == measure_tilt) turns = feels(measure%link) .and. leans(measure)
        end function turns

        !> Is one of two links among them?
        pure logical function feels(link)
            integer, intent(in) :: link(2)

            feels = any(spin%link == link(1)) .neqv. any(spin%link == link(2))
        end function feels

        !> Does an axis of a tilt turn with its link's spin?
        pure logical function leans(measure)
            type(measure_spec), intent(in) :: measure
            integer :: side

            leans = .false.
            do side = 1, 2
                associate (link => measure%link(side))
                    if (any(spin%link == link)) leans = leans &
                        .or. norm2(cross(line(link)%axis, marker_axis_at(model%scene, link, measure%marker(side)))) > exact
                end associate
            end do
        end function leans

        !> Is a joint variable an angle of one of the links?
        pure logical function leads(joint, variable)
            integer, intent(in) :: joint, variable

            associate (link => model%joint(joint)%link, kind => model%joint(joint)%kind)
                leads = feels(link)
                if (kind == joint_cylindrical .and. variable == 2) leads = .false.
            end associate
        end function leads
    end function is_idle

    ! ---------------------------------------------------------------- what must be so

    !> A spin that is idle by its joints alone, but not by its masses and forces.
    subroutine refuse_eccentric(model, spin, status)
        type(model_type), intent(in) :: model
        type(idle_spin), intent(in) :: spin(:)
        type(status_type), intent(inout) :: status
        character(len=:), allocatable :: why
        integer :: i

        do i = 1, size(spin)
            if (.not. status%is_ok()) return
            why = why_spin_matters(model, spin(i))
            if (why == "") cycle
            call fail(status, status_bad_input, spin_in_words(model, spin(i))//", and forces depend on how it does: "//why &
                      //" (expected a body of revolution about that line, with loads and springs on it, or a universal joint in " &
                      //"place of a spherical one)")
        end do
    end subroutine refuse_eccentric

    !> A spin for which no ball is left: two links that spin on either side of the same one.
    subroutine refuse_unheld(model, spin, hold, status)
        type(model_type), intent(in) :: model
        type(idle_spin), intent(in) :: spin(:)
        type(hold_spec), intent(in) :: hold(:)
        type(status_type), intent(inout) :: status
        integer :: i, k

        do i = 1, size(spin)
            if (.not. status%is_ok()) return
            if (any([(holds(hold(k), spin(i)), k=1, size(hold))])) cycle
            k = findloc(hold%joint, spin(i)%ball(1), dim=1)
            call fail(status, status_bad_input, spin_in_words(model, spin(i))//", and so may "//quoted(hold(k)%links)// &
                      " on the other side of "//quoted(model%joint(hold(k)%joint)%name)// &
                      ": neither is determined (expected a prismatic joint in place of a cylindrical one)")
        end do

    contains

        pure logical function holds(one, of)
            type(hold_spec), intent(in) :: one
            type(idle_spin), intent(in) :: of

            holds = any([of%ball, of%collar] == one%joint) .and. any(of%link == model%joint(one%joint)%link(one%side))
        end function holds
    end subroutine refuse_unheld

    !> Is an inertia that of a body of revolution about an axis?
    pure logical function is_round(inertia, axis)
        real(wp), intent(in) :: inertia(3, 3), axis(3)

        is_round = maxval(abs(inertia - round_inertia(inertia, axis) - along(inertia, axis)*dyad(axis))) &
                   <= exact*maxval(abs(inertia))
    end function is_round

    !> What it has across the axis.
    pure function round_inertia(inertia, axis) result(across)
        real(wp), intent(in) :: inertia(3, 3), axis(3)
        real(wp) :: across(3, 3)
        integer :: i

        across = -dyad(axis)
        do i = 1, 3
            across(i, i) = across(i, i) + 1
        end do
        across = (inertia(1, 1) + inertia(2, 2) + inertia(3, 3) - along(inertia, axis))/2*across
    end function round_inertia

    pure real(wp) function along(inertia, axis)
        real(wp), intent(in) :: inertia(3, 3), axis(3)

        along = dot_product(axis, matmul(inertia, axis))
    end function along

    pure function dyad(axis)
        real(wp), intent(in) :: axis(3)
        real(wp) :: dyad(3, 3)

        dyad = spread(axis, 2, 3)*spread(axis, 1, 3)
    end function dyad

    ! ---------------------------------------------------------------- how it is settled

    !> Let balls, and collars, hold the spins of their links.
    subroutine hold_spins(model, hold)
        type(model_type), intent(inout) :: model
        type(hold_spec), intent(in) :: hold(:)
        integer :: i, l, side

        do i = 1, size(hold)
            associate (joint => model%joint(hold(i)%joint))
                if (joint%told_kind == joint_cylindrical) then
                    joint%kind = joint_prismatic
                    cycle
                end if
                joint%kind = joint_universal
                do side = 1, 2
                    joint%frame(:, 3, side) = hold(i)%axis(:, side)
                    joint%frame(:, 1, side) = square_to(hold(i)%axis(:, side))
                    joint%frame(:, 2, side) = cross(joint%frame(:, 3, side), joint%frame(:, 1, side))
                end do
            end associate
        end do
        do l = 1, model%n_link
            associate (link => model%link(l))
                if (link%spin == 0) cycle
                link%inertia = round_inertia(link%inertia, link%spin_axis)
                link%is_diagonal = .not. any(abs([link%inertia(1, 2), link%inertia(2, 3), link%inertia(3, 1)]) > 0)
            end associate
        end do
    end subroutine hold_spins

    !> A unit vector square to another: y, z or x of the axes made so, the first that is far enough from it.
    pure function square_to(axis) result(v)
        real(wp), intent(in) :: axis(3)                !! unit vector
        real(wp) :: v(3)
        integer, parameter :: order(3) = [2, 3, 1]
        integer :: k

        ! one of three directions is at least arccos(1/sqrt(3)) away
        do k = 1, 3
            if (abs(axis(order(k))) < 0.6_wp) exit
        end do
        v = 0
        v(order(k)) = 1
        v = v - axis(order(k))*axis
        v = v/norm2(v)
    end function square_to

    ! ---------------------------------------------------------------- words

    !> "link 'rod' may spin about the line of its joints 'A' and 'B'"
    function spin_in_words(model, spin) result(text)
        type(model_type), intent(in) :: model
        type(idle_spin), intent(in) :: spin
        character(len=:), allocatable :: text, joints
        integer :: i

        text = "link "//quoted(model%link(spin%link(1))%name)
        if (size(spin%link) > 1) text = "links "//quoted(model%link(spin%link(1))%name)
        do i = 2, size(spin%link)
            text = text//", "//quoted(model%link(spin%link(i))%name)
        end do
        joints = ""
        do i = 1, model%n_joint
            associate (link => model%joint(i)%link)
                if (any(spin%link == link(1)) .eqv. any(spin%link == link(2))) cycle
                if (joints /= "") joints = joints//" and "
                joints = joints//quoted(model%joint(i)%name)
            end associate
        end do
        text = text//" may spin about the line of "//trim(merge("their", "its  ", size(spin%link) > 1))//" joints "//joints
    end function spin_in_words
end module linkdyn_idle_spin
