!> Friction in joints: how contacts slide, the wrenches of friction of given amounts, and what of reactions presses. See
!> `linkdyn_contact`.
module linkdyn_friction
    use linkdyn_acting, only: acting_type, turned, at_joint_variable
    use linkdyn_belts, only: strand_forces
    use linkdyn_bodies, only: world_axes, omega_of, point_position
    use linkdyn_contact, only: contact_type, is_mesh, is_bare, lever_of, no_speed, slides_along_several, n_part, n_press, &
        form_pin, form_collar, form_ball, form_guide, form_bush, form_thread, form_plate, form_cam, form_mesh, form_worm, &
        form_belt
    use linkdyn_cam, only: cam
    use linkdyn_joint_kind, only: marker_pair
    use linkdyn_joint_table, only: joint_belt
    use linkdyn_joint_variables, only: joint_rates, move_pair
    use linkdyn_kinds, only: wp
    use linkdyn_mechanism, only: mechanism_type, told_marker_frame, marker_point, pair_of, wheel_wrench, wheel_push, &
        belt_wrench
    use linkdyn_value, only: value, constant, zero, one, is_zero, abs, sqrt, square, max, select, operator(+), &
        operator(-), operator(*), operator(/)
    use linkdyn_vector, only: vector, rotation, vector_of, zero_vector, components, operator(+), operator(-), operator(*), &
        operator(.dot.), operator(.cross.), operator(.rotate.)
    implicit none (type, external)
    private
    public :: contact_motion, move_contacts, friction_wrench, holding_wrench, pressing_parts, pressing_force

    !> A contact in motion, in the axes of a turning.
    type :: contact_motion
        integer :: turning = 0                 !! 0: world axes
        type(vector) :: axis                   !! unit vector
        type(vector) :: slide                  !! relative velocity of the surfaces along what is free [m/s]
        type(vector) :: turn                   !! and relative angular velocity [rad/s]
        type(vector) :: arm                    !! from the second link's marker to where the force acts [m]
        type(value) :: square                  !! of the speed of the surfaces [m2/s2]
        type(value) :: way                     !! of teeth: 1 where a force on the second wheel above zero drives it, -1 where it
                                               !! brakes it
    end type contact_motion

contains

    !> All contacts.
    subroutine move_contacts(mechanism, sense, contact)
        type(mechanism_type), intent(in) :: mechanism
        type(value), intent(in) :: sense(:)            !! of contacts that may stick, as of `friction_state`, one after the other
        type(contact_motion), allocatable, intent(out) :: contact(:)
        integer :: i

        allocate (contact(size(mechanism%model%contact)))
        do i = 1, size(contact)
            call move_contact(mechanism, i, sense(n_part*(i - 1) + 1:n_part*i), contact(i))
        end do
    end subroutine move_contacts

    !> How surfaces rub in one contact: what slides and turns on what, about which axis, at which arm.
    subroutine move_contact(mechanism, i, sense, motion)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: i
        type(value), intent(in) :: sense(n_part)
        type(contact_motion), intent(out) :: motion
        type(rotation) :: frame
        type(value), allocatable :: rate(:)

        associate (contact => mechanism%model%contact(i), bodies => mechanism%bodies)
            associate (link => mechanism%model%joint(contact%joint)%link)
                motion%slide = zero_vector()
                motion%turn = zero_vector()
                motion%arm = zero_vector()
                if (contact%form == form_cam) then
                    call pass_cam(mechanism, contact%joint, motion)
                else if (contact%form == form_worm) then
                    call pass_thread(mechanism, contact%joint, motion)
                else if (contact%form == form_belt) then
                    call pass_belt(mechanism, contact%joint, motion)
                    motion%way = way_of_power(mechanism, i)
                else if (contact%form == form_ball .or. contact%form == form_mesh) then
                    motion%axis = zero_vector()
                    motion%turn = omega_of(bodies, link(2), world_axes) - omega_of(bodies, link(1), world_axes)
                    if (contact%form == form_mesh) then
                        motion%way = way_of_power(mechanism, i)
                    else if (.not. all(is_zero(sense))) then
                        motion%turn = turn_one_way(mechanism, contact, sense, motion%turn)
                    end if
                else
                    motion%turning = bodies%body(link(contact%side))%turning
                    frame = told_marker_frame(mechanism, contact%joint, contact%side)
                    motion%axis = frame%z
                    rate = joint_rates(mechanism, contact%joint)
                    if (any(contact%form == [form_pin, form_collar])) rate = [rate(contact%side)]
                    rate = one_way(contact, sense, rate)
                    select case (contact%form)
                    case (form_pin, form_collar)
                        motion%turn = rate(1)*frame%z
                    case (form_guide)
                        motion%slide = rate(1)*frame%z
                    case (form_bush)
                        motion%turn = rate(1)*frame%z
                        motion%slide = rate(2)*frame%z
                    case (form_thread)
                        motion%turn = rate(1)*frame%z
                        motion%slide = contact%pitch*motion%turn
                    case (form_plate)
                        motion%slide = rate(1)*frame%x + rate(2)*frame%y
                        motion%turn = rate(3)*frame%z
                    end select
                end if
            end associate
            if (is_bare(contact) .and. .not. all(is_zero(sense))) call pass_one_way(mechanism, i, sense, motion)
            motion%square = contact%pass**2*(motion%slide.dot.motion%slide) + contact%radius**2*(motion%turn.dot.motion%turn)
        end associate
    end subroutine move_contact

    !> Which way power flows through teeth whose force is above zero: by how the first wheel turns in the carrier.
    function way_of_power(mechanism, i) result(way)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: i
        type(value) :: way
        type(vector) :: force, couple

        way = one()
        associate (contact => mechanism%model%contact(i), bodies => mechanism%bodies)
            if (contact%slant == contact%back) return  ! it does not matter
            call unit_wrench(mechanism, contact%joint, 1, force, couple)
            way = select(turned(bodies, couple, bodies%body(carrier_of(mechanism, contact%joint))%turning, 0) &
                         .dot. spin_of(mechanism, contact%joint, 1), one(), -one())
        end associate
    end function way_of_power

    !> What a unit along the pitch circles does to a wheel, as `wheel_wrench` has it; of belts that stretch, too.
    subroutine unit_wrench(mechanism, j, side, force, couple)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: j, side                 !! joint, side: 1 or 2
        type(vector), intent(out) :: force, couple
        type(vector) :: line, lever

        associate (joint => mechanism%model%joint(j))
            if (joint%gear > 0) then
                call wheel_wrench(mechanism, joint%gear, side, force, couple)
            else
                call belt_wrench(mechanism, joint%belt, side, force, couple, line, lever)
            end if
        end associate
    end subroutine unit_wrench

    !> The link in which both wheels turn.
    integer function carrier_of(mechanism, j)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: j                       !! joint

        associate (model => mechanism%model)
            if (model%joint(j)%gear > 0) then
                carrier_of = model%gear(model%joint(j)%gear)%carrier
            else
                carrier_of = model%belt(model%joint(j)%belt)%gear%carrier
            end if
        end associate
    end function carrier_of

    !> Angular velocity of a wheel in the carrier, world axes.
    function spin_of(mechanism, j, side) result(spin)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: j, side                 !! joint, side: 1 or 2
        type(vector) :: spin

        spin = omega_of(mechanism%bodies, mechanism%model%joint(j)%link(side), world_axes) &
               - omega_of(mechanism%bodies, carrier_of(mechanism, j), world_axes)
    end function spin_of

    !> How a follower passes its cam where both touch: the velocity of the one against the other, of a roller that with which it
    !> rolls.
    subroutine pass_cam(mechanism, j, motion)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: j                       !! joint
        type(contact_motion), intent(inout) :: motion
        type(marker_pair) :: pair
        type(vector) :: omega, gap_rate, way

        pair = pair_of(mechanism, j)
        motion%axis = zero_vector()
        call move_pair(mechanism, j, pair, omega, gap_rate)
        select type (kind => mechanism%kind(j)%is)
        class is (cam)
            motion%arm = kind%off_marker(pair)
            motion%slide = gap_rate + (omega.cross.motion%arm)
            if (.not. kind%rolls) return
            way = kind%roller_way(pair)
            motion%slide = (way.dot.motion%slide)*way
        end select
    end subroutine pass_cam

    !> How the teeth of a wheel pass the thread of its worm, where their pitch surfaces touch: both turn about their markers, seen
    !> from the carrier.
    subroutine pass_thread(mechanism, j, motion)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: j                       !! joint
        type(contact_motion), intent(inout) :: motion
        type(vector) :: push, pitch, passes(2)
        integer :: side

        motion%axis = zero_vector()
        motion%way = one()
        call wheel_push(mechanism, mechanism%model%joint(j)%gear, push, pitch)
        pitch = point_position(mechanism%bodies, carrier_of(mechanism, j), pitch)
        do side = 1, 2
            motion%arm = pitch - place_of_marker(mechanism, j, side)
            passes(side) = spin_of(mechanism, j, side) .cross.motion%arm
        end do
        motion%slide = passes(2) - passes(1)
    end subroutine pass_thread

    function place_of_marker(mechanism, j, side) result(p)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: j, side                 !! joint, side: 1 or 2
        type(vector) :: p                              !! world axes [m]

        p = point_position(mechanism%bodies, mechanism%model%joint(j)%link(side), marker_point(mechanism, j, side))
    end function place_of_marker

    !> How the wheels of a belt turn against each other, if it is crossed; else how they pass each other half way between their
    !> axes. Both have a couple that brakes each of them alike.
    subroutine pass_belt(mechanism, j, motion)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: j                       !! joint
        type(contact_motion), intent(inout) :: motion

        motion%axis = zero_vector()
        if (mechanism%model%scene%joint(j)%is_turned_over) then
            motion%turn = spin_of(mechanism, j, 2) - spin_of(mechanism, j, 1)
        else
            motion%arm = 0.5_wp*(place_of_marker(mechanism, j, 1) - place_of_marker(mechanism, j, 2))
            motion%slide = (spin_of(mechanism, j, 1) + spin_of(mechanism, j, 2)) .cross.motion%arm
        end if
    end subroutine pass_belt

    !> Surfaces that may stick of a joint without variables. What teeth lose hangs on which way power flows: while they are held it
    !> is not asked for, and their force is what is felt.
    subroutine pass_one_way(mechanism, i, sense, motion)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: i                       !! contact
        type(value), intent(in) :: sense(n_part)
        type(contact_motion), intent(inout) :: motion
        type(vector) :: way
        type(value) :: rate(1)

        way = surface_way(mechanism, i)
        associate (contact => mechanism%model%contact(i))
            if (contact%radius > 0) then
                rate = one_way(contact, sense, [way.dot.motion%turn])
                motion%turn = rate(1)*way
            else
                rate = one_way(contact, sense, [way.dot.motion%slide])
                motion%slide = rate(1)*way
            end if
            if (is_mesh(contact) .and. contact%slant /= contact%back) &
                motion%way = select(1.5_wp - abs(sense(1)), select(rate(1), one(), -one()), one())
        end associate
    end subroutine pass_one_way

    !> Along which such surfaces slide, or about which wheels turn against each other: a unit vector, world axes. Of teeth and belts
    !> it is fixed in the carrier.
    function surface_way(mechanism, i) result(way)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: i                       !! contact
        type(vector) :: way

        associate (contact => mechanism%model%contact(i), carrier => mechanism%model%contact(i)%carrier, bodies => mechanism%bodies)
            if (contact%form == form_cam) then
                way = zero_vector()
                select type (kind => mechanism%kind(contact%joint)%is)
                class is (cam)
                    way = kind%roller_way(pair_of(mechanism, contact%joint))
                end select
            else
                way = turned(bodies, mechanism%own(carrier)%r.rotate.vector_of(contact%way), bodies%body(carrier)%turning, 0)
            end if
        end associate
    end function surface_way

    !> The rates of a contact that may stick: where it slides one way, that way, however slowly. Where it has come to rest but for
    !> rounding it is taken to slide at a speed that is none. What goes across stays as it is.
    function one_way(contact, sense, rate) result(r)
        type(contact_type), intent(in) :: contact
        type(value), intent(in) :: sense(n_part)       !! a unit vector, or anything else: the rates as they are
        type(value), intent(in) :: rate(:)             !! of the joint variables along which it slides
        type(value) :: r(size(rate))
        type(value) :: along, square, across, least
        integer :: k

        r = rate
        if (all(is_zero(sense))) return
        if (.not. slides_along_several(contact)) then
            least = constant(no_speed(contact)/lever_of(contact, 1))
            r(1) = select(0.5_wp - abs(abs(sense(1)) - 1.0_wp), sense(1)*max(sense(1)*rate(1), least), rate(1))
            return
        end if
        along = zero()
        square = zero()
        do k = 1, size(rate)
            along = along + lever_of(contact, k)*(sense(k)*rate(k))
            square = square + sense(k)*sense(k)
        end do
        do k = 1, size(rate)
            if (.not. lever_of(contact, k) > 0) cycle
            across = rate(k) - (1/lever_of(contact, k))*(sense(k)*along)
            r(k) = across + (no_speed(contact)/lever_of(contact, k))*sense(k)
            r(k) = select(along - no_speed(contact), rate(k), r(k))
            r(k) = select(0.5_wp - abs(square - 1.0_wp), r(k), rate(k))
        end do
    end function one_way

    !> The same of a ball, about the axes of its first marker.
    function turn_one_way(mechanism, contact, sense, turn) result(one)
        type(mechanism_type), intent(in) :: mechanism
        type(contact_type), intent(in) :: contact
        type(value), intent(in) :: sense(n_part)
        type(vector), intent(in) :: turn               !! world axes [rad/s]
        type(vector) :: one, axis(3)
        type(rotation) :: frame
        type(value) :: rate(3)
        integer :: k

        associate (bodies => mechanism%bodies, link => mechanism%model%joint(contact%joint)%link(1))
            frame = told_marker_frame(mechanism, contact%joint, 1)
            axis = [frame%x, frame%y, frame%z]
            do k = 1, 3
                axis(k) = turned(bodies, axis(k), bodies%body(link)%turning, 0)
                rate(k) = axis(k) .dot.turn
            end do
        end associate
        rate = one_way(contact, sense, rate)
        one = rate(1)*axis(1) + rate(2)*axis(2) + rate(3)*axis(3)
    end function turn_one_way

    !> What a contact does to the second link, the opposite to the first.
    function friction_wrench(mechanism, i, motion, amount) result(acting)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: i
        type(contact_motion), intent(in) :: motion
        type(value), intent(in) :: amount              !! of friction, over the speed of the surfaces [N s/m]
        type(acting_type) :: acting

        associate (contact => mechanism%model%contact(i))
            acting%joint = contact%joint
            acting%turning = motion%turning
            acting%force = -((contact%pass**2*(amount + contact%slide_damping))*motion%slide)
            acting%moment = (motion%arm.cross.acting%force) - (contact%radius**2*amount + contact%turn_damping)*motion%turn
        end associate
    end function friction_wrench

    !> What holds a joint variable that sticks, by its force there. A thread holds along its surface, as it would rub: what presses
    !> its flanks is then the reaction. So do teeth, belts and cams, which have no variables.
    function holding_wrench(mechanism, joint, variable, force) result(acting)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: joint, variable
        type(value), intent(in) :: force               !! [N, N m]
        type(acting_type) :: acting
        integer :: i

        i = findloc(mechanism%model%contact%joint, joint, dim=1)
        if (i > 0) then                                ! a stop may hold what does not rub
            if (is_bare(mechanism%model%contact(i))) then
                acting = holding_surface(mechanism, i, force)
                return
            end if
        end if
        acting = at_joint_variable(mechanism, joint, variable, force)
        do i = 1, size(mechanism%model%contact)
            associate (contact => mechanism%model%contact(i))
                if (contact%joint /= joint .or. contact%form /= form_thread) cycle
                acting%moment = (1/lever_of(contact, 1)**2)*acting%moment
                acting%force = contact%pitch*acting%moment
                acting%moment = contact%radius**2*acting%moment
            end associate
        end do
    end function holding_wrench

    !> What holds the surfaces of a joint without variables, where and as they would rub.
    function holding_surface(mechanism, i, force) result(acting)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: i                       !! contact
        type(value), intent(in) :: force               !! [N, N m]
        type(acting_type) :: acting
        type(contact_motion) :: motion
        type(value) :: smooth(n_part)

        smooth = zero()
        call move_contact(mechanism, i, smooth, motion)
        acting%joint = mechanism%model%contact(i)%joint
        if (mechanism%model%contact(i)%radius > 0) then
            acting%force = zero_vector()
            acting%moment = force*surface_way(mechanism, i)
        else
            acting%force = force*surface_way(mechanism, i)
            acting%moment = motion%arm.cross.acting%force
        end if
    end function holding_surface

    !> What a contact feels of its joint's reaction: as on lanes, the forces at both ends and one along the axis.
    function pressing_parts(mechanism, i, motion, reaction) result(press)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: i
        type(contact_motion), intent(in) :: motion
        type(acting_type), intent(in) :: reaction
        type(value) :: press(n_press)                  !! [N]
        type(vector) :: force, moment, across, tilt
        type(value) :: thrust

        press = zero()
        associate (contact => mechanism%model%contact(i), bodies => mechanism%bodies)
            if (is_mesh(contact)) then
                press(7) = motion%way*force_along(mechanism, contact%joint, reaction)
                return
            end if
            if (contact%form == form_ball .or. contact%form == form_cam) then
                press(1:3) = components(reaction%force)
                return
            end if
            force = turned(bodies, reaction%force, reaction%turning, motion%turning)
            thrust = motion%axis.dot.force
            if (contact%form == form_collar .or. contact%form == form_plate) then
                press(7) = thrust
                return
            end if
            across = force - thrust*motion%axis
            if (contact%form == form_thread) press(7) = contact%slant*thrust
            if (contact%length > 0 .or. (contact%form == form_guide .and. contact%radius > 0)) &
                moment = turned(bodies, reaction%moment, reaction%turning, motion%turning)
            if (contact%form == form_guide .and. contact%radius > 0) press(7) = (1/contact%radius)*(motion%axis.dot.moment)
            if (contact%length > 0) then
                tilt = (1/contact%length)*(moment.cross.motion%axis)
                press(1:3) = components(0.5_wp*across + tilt)
                press(4:6) = components(0.5_wp*across - tilt)
            else
                press(1:3) = components(across)
            end if
        end associate
    end function pressing_parts

    !> The force along the pitch circles, from the reaction of a gear, rack or belt, or from how far a belt is stretched.
    function force_along(mechanism, j, reaction) result(size)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: j                       !! joint
        type(acting_type), intent(in) :: reaction
        type(value) :: size
        type(vector) :: direction, couple, whole
        type(value) :: tension(2)

        associate (bodies => mechanism%bodies, joint => mechanism%model%joint(j))
            if (joint%belt > 0) then
                tension = strand_forces(mechanism, joint%belt)
                size = tension(1) - tension(2)
                return
            end if
            call unit_wrench(mechanism, j, 2, direction, couple)
            whole = reaction%force
            if (joint%told_kind == joint_belt) then    ! with equal radii it is a moment alone
                direction = couple
                whole = reaction%moment
            end if
            size = (direction .dot. turned(bodies, whole, reaction%turning, bodies%body(carrier_of(mechanism, j))%turning)) &
                   /(direction.dot.direction)
        end associate
    end function force_along

    !> The force that presses, from what a contact feels.
    function pressing_force(mechanism, i, press) result(force)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: i
        type(value), intent(in) :: press(n_press)      !! [N]
        type(value) :: force

        associate (contact => mechanism%model%contact(i))
            if (is_mesh(contact)) then
                force = (0.5_wp*(contact%slant + contact%back))*abs(press(7)) + (0.5_wp*(contact%slant - contact%back))*press(7)
            else
                force = size_of(press(1:3)) + size_of(press(4:6)) + abs(press(7)) + contact%preload
            end if
        end associate
    end function pressing_force

    function size_of(v) result(s)
        type(value), intent(in) :: v(3)
        type(value) :: s

        if (count(is_zero(v)) == 2) then
            s = abs(v(1)) + abs(v(2)) + abs(v(3))      ! one number
        else
            s = sqrt(square(v(1)) + square(v(2)) + square(v(3)))
        end if
    end function size_of
end module linkdyn_friction
