!> Friction in joints, on lanes: how contacts slide, what presses them, and the wrenches that come of it. See `linkdyn_contact`.
module linkdyn_joint_friction
    use linkdyn_applied_wrenches, only: apply_force, apply_moment
    use linkdyn_contact, only: contact_type, n_press, friction_of_speed, sliding_coefficient, lever_of, pressing, form_pin, &
        form_collar, form_ball, form_guide, form_bush, form_thread, form_plate
    use linkdyn_joint_rates, only: joint_view, view_joint
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state
    use linkdyn_lane_count, only: lanes
    use linkdyn_marker_motion, only: in_space
    use linkdyn_model, only: model_type, orientation_of
    use linkdyn_planar_motion, only: level_velocity
    use linkdyn_planar_point, only: carried
    use linkdyn_scene, only: joint_prismatic
    use linkdyn_vec2, only: vec2, operator(+), operator(-), operator(.rotate.)
    use linkdyn_vec3, only: vec3, operator(+), operator(-), operator(*), operator(.dot.), operator(.cross.), zero_vec3
    implicit none (type, external)
    private
    public :: contact_view, friction_space, prepare_friction, view_contacts, press_contacts, pressing_forces, &
        apply_friction, measure_friction

    !> A contact in motion, world axes.
    type :: contact_view
        type(vec3) :: point                    !! where its forces act [m]
        type(vec3) :: axis                     !! unit vector
        type(vec3) :: slide                    !! relative velocity of the surfaces along what is free [m/s]
        type(vec3) :: turn                     !! and relative angular velocity [rad/s]
        real(wp) :: factor(lanes)              !! friction over pressing force and speed (`friction_of_speed`) [s/m]
    end type contact_view

    !> All contacts of a mechanism on a block of lanes, then drives that lose some of what they transmit.
    type :: friction_space
        type(contact_view), allocatable :: at(:)           !! (contact); of drives their factor alone
        real(wp), allocatable :: press(:, :, :)            !! what they feel (lane, n_press, contact) [N]
        real(wp), allocatable :: amount(:, :)              !! friction over the speed of the surfaces [N s/m]; of drives
                                                           !! friction at the joint variable [N, N m] (lane, contact)
        real(wp), allocatable :: sense(:, :)               !! of contacts that may stick: they slide that way, +1 or -1, or hold, 2;
                                                           !! 0: smooth over their speed (lane, contact)
        real(wp), allocatable :: reaction(:, :, :)         !! (lane, n_component, n_joint) [N, N m]
    end type friction_space

contains

    subroutine prepare_friction(model, n, space)
        type(model_type), intent(in) :: model
        integer, intent(in) :: n                           !! contacts and drives
        type(friction_space), intent(out) :: space

        allocate (space%at(n), space%press(lanes, n_press, n), space%amount(lanes, n), space%sense(lanes, n), &
                  space%reaction(lanes, model%n_component, model%n_joint))
        space%press = 0
        space%amount = 0
        space%sense = 0
        space%reaction = 0
    end subroutine prepare_friction

    !> How the contacts slide. Needs angular rates in world axes.
    subroutine view_contacts(model, state, space)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        type(friction_space), intent(inout) :: space
        type(vec3) :: axis(2), velocity, omega
        real(wp) :: speed(lanes)
        integer :: i

        do i = 1, size(model%contact)
            associate (contact => model%contact(i), view => space%at(i))
                if (model%is_planar) then
                    call view_in_plane(model, state, contact%joint, view%point, axis, velocity, omega)
                else
                    call view_in_space(model, state, contact%joint, view%point, axis, velocity, omega)
                end if
                view%axis = axis(contact%side)
                view%slide = zero_vec3()
                view%turn = zero_vec3()
                select case (contact%form)
                case (form_pin, form_collar)
                    view%turn = along(view%axis, omega)
                case (form_ball)
                    view%turn = omega
                case (form_guide)
                    view%slide = along(view%axis, velocity)
                case (form_bush)
                    view%slide = along(view%axis, velocity)
                    view%turn = along(view%axis, omega)
                case (form_thread)
                    view%turn = along(view%axis, omega)
                    view%slide = contact%pitch*view%turn
                case (form_plate)
                    view%slide = velocity - along(view%axis, velocity)
                    view%turn = along(view%axis, omega)
                end select
                speed = sqrt((view%slide.dot.view%slide) + contact%radius**2*(view%turn.dot.view%turn))
                view%factor = friction_of_speed(contact, speed)
                if (any(abs(space%sense(:, i)) > 0)) call slide_one_way(contact, space%sense(:, i), view)
            end associate
        end do
    end subroutine view_contacts

    !> A contact that may stick: one that holds does not rub, one that slides does so the way it does, however slowly. Where it has come
    !> to rest but for rounding it is taken to slide at a speed that is none.
    subroutine slide_one_way(contact, sense, view)
        type(contact_type), intent(in) :: contact
        real(wp), intent(in) :: sense(lanes)
        type(contact_view), intent(inout) :: view
        real(wp), parameter :: none = 1.0e-9_wp        !! of the creep speed
        real(wp), dimension(lanes) :: rate, speed

        associate (lever => lever_of(contact))
            rate = view%axis.dot.view%turn
            if (contact%form == form_guide) rate = view%axis.dot.view%slide
            where (abs(sense) > 0) rate = sign(max(sign(1.0_wp, sense)*rate, none*contact%creep_speed/lever), sense)
            speed = lever*abs(rate)
            where (abs(sense) > 1)
                view%factor = 0
            elsewhere (abs(sense) > 0)
                view%factor = sliding_coefficient(contact, speed)/speed
            end where
            if (contact%form == form_guide) then
                call replace(rate, view%slide)
            else
                call replace(rate, view%turn)
            end if
        end associate

    contains

        subroutine replace(rate, along_axis)
            real(wp), intent(in) :: rate(lanes)
            type(vec3), intent(inout) :: along_axis
            type(vec3) :: other

            other = rate*view%axis
            where (abs(abs(sense) - 1) < 0.5_wp)
                along_axis%x = other%x
                along_axis%y = other%y
                along_axis%z = other%z
            end where
        end subroutine replace
    end subroutine slide_one_way

    pure function along(axis, v) result(part)
        type(vec3), intent(in) :: axis, v
        type(vec3) :: part

        part = (axis.dot.v)*axis
    end function along

    subroutine view_in_space(model, state, j, point, axis, velocity, omega)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        integer, intent(in) :: j
        type(vec3), intent(out) :: point, axis(2), velocity, omega
        type(joint_view) :: view

        call view_joint(model, state, j, state%velocity, state%omega, view)
        point = view%point
        axis = [view%frame(1)%z, view%frame(2)%z]
        velocity = view%slide_rate
        omega = view%omega
    end subroutine view_in_space

    subroutine view_in_plane(model, state, j, point, axis, velocity, omega)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        integer, intent(in) :: j
        type(vec3), intent(out) :: point, axis(2), velocity, omega
        type(vec2) :: arm(2), to
        integer :: o(2)

        associate (joint => model%joint(j), plane => state%plane)
            o = [orientation_of(model, joint%link(1)), orientation_of(model, joint%link(2))]
            arm(2) = plane%rotation(o(2)).rotate.joint%point(:2, 2)
            to = plane%position(joint%link(2)) + arm(2)
            arm(1) = to - plane%position(joint%link(1))
            point = in_space(to)
            velocity = in_space(carried(plane, level_velocity, joint%link(2), o(2), arm(2)) &
                                - carried(plane, level_velocity, joint%link(1), o(1), arm(1)))
            omega = zero_vec3()
            omega%z = plane%angular(:, level_velocity, o(2)) - plane%angular(:, level_velocity, o(1))
            axis(1) = zero_vec3()
            axis(1)%z = 1
            if (joint%kind == joint_prismatic) axis(1) = in_space(plane%rotation(o(1)).rotate.joint%frame(:2, 3, 1))
            axis(2) = axis(1)
        end associate
    end subroutine view_in_plane

    !> What the contacts feel of the reactions in `space%reaction`.
    subroutine press_contacts(model, space)
        type(model_type), intent(in) :: model
        type(friction_space), intent(inout) :: space
        type(vec3) :: force, moment, across, tilt
        real(wp) :: thrust(lanes)
        integer :: i

        do i = 1, size(model%contact)
            associate (contact => model%contact(i), axis => space%at(i)%axis, r => space%reaction(:, :, model%contact(i)%joint), &
                       press => space%press(:, :, i))
                if (model%is_planar) then
                    force = vec3(r(:, 1), r(:, 2), spread(0.0_wp, 1, lanes))
                    moment = zero_vec3()
                    moment%z = r(:, 3)
                else
                    force = vec3(r(:, 1), r(:, 2), r(:, 3))
                    moment = vec3(r(:, 4), r(:, 5), r(:, 6))
                end if
                press = 0
                thrust = axis.dot.force
                across = force - thrust*axis
                select case (contact%form)
                case (form_collar, form_plate)
                    press(:, 7) = thrust
                    cycle
                case (form_ball)
                    call set_end(force, press(:, 1:3))
                    cycle
                case (form_thread)
                    press(:, 7) = contact%slant*thrust
                case (form_guide)
                    if (contact%radius > 0) press(:, 7) = (axis.dot.moment)/contact%radius
                end select
                if (contact%length > 0) then
                    tilt = (1/contact%length)*(moment.cross.axis)
                    call set_end(0.5_wp*across + tilt, press(:, 1:3))
                    call set_end(0.5_wp*across - tilt, press(:, 4:6))
                else
                    call set_end(across, press(:, 1:3))
                end if
            end associate
        end do
    end subroutine press_contacts

    pure subroutine set_end(force, press)
        type(vec3), intent(in) :: force
        real(wp), intent(out) :: press(lanes, 3)

        press(:, 1) = force%x
        press(:, 2) = force%y
        press(:, 3) = force%z
    end subroutine set_end

    !> The forces that press.
    pure subroutine pressing_forces(contact, space, force)
        type(contact_type), intent(in) :: contact(:)   !! those of the space
        type(friction_space), intent(in) :: space
        real(wp), intent(out) :: force(:, :)           !! (lane, contact) [N]
        integer :: i, lane

        do i = 1, size(contact)
            do lane = 1, lanes
                force(lane, i) = pressing(contact(i), space%press(lane, :, i))
            end do
        end do
    end subroutine pressing_forces

    !> Friction of the amounts in `space`, and what is viscous, on the links.
    subroutine apply_friction(model, space, state)
        type(model_type), intent(in) :: model
        type(friction_space), intent(in) :: space
        type(kinematic_state), intent(inout) :: state
        type(vec3) :: force, moment
        integer :: i

        do i = 1, size(model%contact)
            call wrench_of(model, space, i, force, moment)
            associate (link => model%joint(model%contact(i)%joint)%link, point => space%at(i)%point)
                call apply_force(model, link(2), point, force, state)
                call apply_force(model, link(1), point, (-1.0_wp)*force, state)
                call apply_moment(model, link(2), moment, state)
                call apply_moment(model, link(1), (-1.0_wp)*moment, state)
            end associate
        end do
    end subroutine apply_friction

    !> What a contact does to the second link.
    pure subroutine wrench_of(model, space, i, force, moment)
        type(model_type), intent(in) :: model
        type(friction_space), intent(in) :: space
        integer, intent(in) :: i
        type(vec3), intent(out) :: force, moment

        associate (contact => model%contact(i), view => space%at(i), amount => space%amount(:, i))
            force = (-(amount + contact%slide_damping))*view%slide
            moment = (-(contact%radius**2*amount + contact%turn_damping))*view%turn
        end associate
    end subroutine wrench_of

    !> Friction of each joint, on its second link at its marker, world axes, and the power that it takes.
    subroutine measure_friction(model, space, clutch_force, wrench, loss)
        type(model_type), intent(in) :: model
        type(friction_space), intent(in) :: space
        real(wp), intent(in) :: clutch_force(:, :)     !! what holds joints that stick is friction as well (lane, n_clutch) [N, N m]
        real(wp), intent(out) :: wrench(lanes, model%n_component, model%n_joint)    !! [N, N m]
        real(wp), intent(out) :: loss(lanes, model%n_joint)                         !! [W]
        type(vec3) :: force, moment
        integer :: i, j

        wrench = 0
        loss = 0
        do i = 1, size(model%contact)
            call wrench_of(model, space, i, force, moment)
            j = model%contact(i)%joint
            loss(:, j) = loss(:, j) - (force.dot.space%at(i)%slide) - (moment.dot.space%at(i)%turn)
            call add(j, force, moment)
        end do
        do i = 1, size(clutch_force, 2)
            associate (clutch => model%scene%clutch(i))
                if (clutch%friction == 0) cycle
                j = findloc(model%contact%joint, clutch%joint(1), dim=1)
                force = zero_vec3()
                moment = clutch_force(:, i)*space%at(j)%axis
                if (model%contact(j)%form == form_guide) then
                    force = moment
                    moment = zero_vec3()
                end if
                call add(clutch%joint(1), force, moment)
            end associate
        end do

    contains

        subroutine add(j, force, moment)
            integer, intent(in) :: j
            type(vec3), intent(in) :: force, moment

            wrench(:, 1, j) = wrench(:, 1, j) + force%x
            wrench(:, 2, j) = wrench(:, 2, j) + force%y
            if (model%is_planar) then
                wrench(:, 3, j) = wrench(:, 3, j) + moment%z
                return
            end if
            wrench(:, 3, j) = wrench(:, 3, j) + force%z
            wrench(:, 4, j) = wrench(:, 4, j) + moment%x
            wrench(:, 5, j) = wrench(:, 5, j) + moment%y
            wrench(:, 6, j) = wrench(:, 6, j) + moment%z
        end subroutine add
    end subroutine measure_friction
end module linkdyn_joint_friction
