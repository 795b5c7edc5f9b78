!> A mechanism similar to a given one, of another size: what the error estimates compute again with.
!>
!> With all lengths, gravity and forces of loads and drives s times as large, moments, inertias and stiffnesses of turning
!> springs s**2 times, the forces are s times and the moments s**2 times those of the model, at the same angles and times,
!> and left to itself it moves alike. But for rounding: all numbers have other digits, so the data and every operation
!> round differently. Zeros stay zero and equal lengths stay equal, so the similar mechanism has the same equations.
module linkdyn_similar_model
    use, intrinsic :: iso_fortran_env, only: int64
    use linkdyn_contact, only: list_contacts, is_turning, is_mesh
    use linkdyn_curve, only: scale_curve
    use linkdyn_joint_table, only: is_slide, joint_rack, joint_belt
    use linkdyn_kinds, only: wp
    use linkdyn_model, only: model_type, gear_type, link_freedom, is_length, effort_power
    use linkdyn_scene, only: law_spec, effort_law, effort_constant, effort_table, effort_spring_damper, effort_dc_motor, &
        effort_pd, at_force, at_stiffness, at_damping, at_rest, at_pretension, at_torque_constant, law_harmonic, motor_spec, &
        cylinder_spec, n_clutch
    use linkdyn_step_part, only: describe_steps
    implicit none (type, external)
    private
    public :: make_similar, coordinate_scale, drive_scale, near_one

    ! Keys of what differs in the last place.
    integer, parameter :: of_start = 103, of_rate = 104, of_motion = 105, of_drive = 106, of_load = 107, of_base = 108, &
                          of_friction = 109, of_cam = 110, of_clutch = 111

contains

    !> The similar model of size `scale`; different numbers `copy` of it differ in the last place of what has no size. A forward
    !> run may plan its scene once more, with other coordinates, so the scene is scaled with the model.
    subroutine make_similar(model, copy, scale, similar)
        type(model_type), intent(in) :: model
        integer, intent(in) :: copy
        real(wp), intent(in) :: scale                !! s
        type(model_type), intent(out) :: similar

        similar = model
        similar%gravity = scale*model%gravity
        similar%scene%gravity = scale*model%scene%gravity
        similar%scene%laws%scale = scale*model%scene%laws%scale
        call scale_base(model, copy, scale, similar)
        call scale_links(model, scale, similar)
        call scale_payloads(model, scale, similar)
        call scale_joints(model, copy, scale, similar)
        call scale_gears(model, scale, similar)
        call scale_shares(model, scale, similar)
        call scale_springs(model, scale, similar)
        call scale_frictions(model, copy, scale, similar)
        call scale_clutches(model, copy, scale, similar)
        call list_contacts(similar%scene, similar%contact)
        call scale_meshes(model, scale, similar)
        call scale_coordinates(model, copy, scale, similar)
        call scale_actuators(model, copy, scale, similar)
        call scale_rotors(model, scale, similar)
        call scale_loads(model, copy, scale, similar)
        call scale_groups(model, scale, similar)
        call describe_steps(similar)
    end subroutine make_similar

    !> How the frame moves.
    subroutine scale_base(model, copy, scale, similar)
        type(model_type), intent(in) :: model
        integer, intent(in) :: copy
        real(wp), intent(in) :: scale
        type(model_type), intent(inout) :: similar
        integer :: k

        do k = 1, size(model%scene%base%motion)
            call scale_law(merge(scale, 1.0_wp, k <= 3), [copy, of_base, k], similar%scene%base%motion(k))
        end do
    end subroutine scale_base

    !> Bodies that links carry for a while.
    subroutine scale_payloads(model, scale, similar)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: scale
        type(model_type), intent(inout) :: similar
        integer :: i

        do i = 1, size(model%payload)
            similar%payload(i)%body%cog = scale*model%payload(i)%body%cog
            similar%payload(i)%body%inertia = scale**2*model%payload(i)%body%inertia
            similar%scene%payload(i)%inertia = scale**2*model%scene%payload(i)%inertia
        end do
    end subroutine scale_payloads

    !> Where links are at the start, their markers, those of the frame, and how mass lies about them.
    subroutine scale_links(model, scale, similar)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: scale
        type(model_type), intent(inout) :: similar
        integer :: i, k

        do i = 1, model%n_link
            similar%link(i)%cog = scale*model%link(i)%cog
            similar%link(i)%inertia = scale**2*model%link(i)%inertia
            similar%scene%link(i)%cog = scale*model%scene%link(i)%cog
            similar%scene%link(i)%inertia = scale**2*model%scene%link(i)%inertia
            similar%scene%link(i)%start(:3) = scale*model%scene%link(i)%start(:3)
            do k = 1, size(model%scene%link(i)%marker)
                similar%scene%link(i)%marker(k)%at = scale*model%scene%link(i)%marker(k)%at
            end do
        end do
        do k = 1, size(model%scene%frame%marker)
            similar%scene%frame%marker(k)%at = scale*model%scene%frame%marker(k)%at
        end do
    end subroutine scale_links

    !> Where joints are on their links, leads of screws, cams, and where they start.
    subroutine scale_joints(model, copy, scale, similar)
        type(model_type), intent(in) :: model
        integer, intent(in) :: copy
        real(wp), intent(in) :: scale
        type(model_type), intent(inout) :: similar
        integer :: i, k

        do i = 1, size(model%joint)
            similar%joint(i)%point = scale*model%joint(i)%point
            similar%joint(i)%pitch = scale*model%joint(i)%pitch
            similar%joint(i)%reach = scale*model%joint(i)%reach
            similar%joint(i)%frame = other_rounding(copy, model%joint(i)%frame)
            if (model%joint(i)%told /= i) cycle
            similar%scene%joint(i)%lead = scale*model%scene%joint(i)%lead
            similar%scene%joint(i)%cam%radius = scale*model%scene%joint(i)%cam%radius
            similar%scene%joint(i)%cam%ground = scale*model%scene%joint(i)%cam%ground
            associate (curve => similar%scene%joint(i)%cam%curve)
                if (allocated(curve%u)) &
                    call scale_curve(scale, [(near_one([copy, of_cam, i, k]), k=1, size(curve%u) - 1)], curve)
            end associate
            do k = 1, size(model%scene%joint(i)%start)
                if (is_slide(model%joint(i)%told_kind, k)) similar%scene%joint(i)%start(k) = scale*model%scene%joint(i)%start(k)
            end do
        end do
    end subroutine scale_joints

    !> Moments of springs that turn joints go as the square; those between markers keep stiffness, as force over length.
    subroutine scale_springs(model, scale, similar)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: scale
        type(model_type), intent(inout) :: similar
        integer :: i

        do i = 1, size(model%scene%spring)
            associate (spring => similar%scene%spring(i))
                if (is_angular(model, spring%joint, spring%variable)) then
                    spring%stiffness = scale**2*spring%stiffness
                    spring%damping = scale**2*spring%damping
                else
                    spring%rest = scale*spring%rest
                end if
            end associate
        end do
    end subroutine scale_springs

    !> Coefficients of friction have no size: they differ in the last place.
    subroutine scale_frictions(model, copy, scale, similar)
        type(model_type), intent(in) :: model
        integer, intent(in) :: copy
        real(wp), intent(in) :: scale
        type(model_type), intent(inout) :: similar
        integer :: i

        do i = 1, size(model%scene%friction)
            associate (friction => similar%scene%friction(i))
                if (is_turning(model%scene%joint(friction%joint)%kind)) friction%viscous = scale**2*friction%viscous
                friction%stribeck_speed = scale*friction%stribeck_speed
                friction%creep_speed = scale*friction%creep_speed
                friction%radius = scale*friction%radius
                friction%length = scale*friction%length
                friction%collar = scale*friction%collar
                friction%preload = scale*friction%preload
                friction%coulomb = near_one([copy, of_friction, i])*friction%coulomb
                friction%static = near_one([copy, of_friction, i])*friction%static
            end associate
        end do
    end subroutine scale_frictions

    !> What clutches hold: forces along slides, moments about axes.
    subroutine scale_clutches(model, copy, scale, similar)
        type(model_type), intent(in) :: model
        integer, intent(in) :: copy
        real(wp), intent(in) :: scale
        type(model_type), intent(inout) :: similar
        integer :: i

        do i = 1, n_clutch(model%scene)
            associate (clutch => similar%scene%clutch(i))
                call scale_law(merge(scale, scale**2, clutch%unit == "N"), [copy, of_clutch, i], clutch%capacity)
            end associate
        end do
    end subroutine scale_clutches

    !> Contacts of teeth, which are found with the plan and not from the scene alone.
    subroutine scale_meshes(model, scale, similar)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: scale
        type(model_type), intent(inout) :: similar
        integer :: i

        do i = 1, size(model%contact)
            if (.not. is_mesh(model%contact(i))) cycle
            similar%contact(i)%radius = scale*model%contact(i)%radius
            similar%contact(i)%pass = model%contact(i)%pass
            similar%contact(i)%slant = model%contact(i)%slant
            similar%contact(i)%back = model%contact(i)%back
            similar%contact(i)%carrier = model%contact(i)%carrier
            similar%contact(i)%way = model%contact(i)%way
            similar%contact(i)%spin = merge(1.0_wp, scale, model%contact(i)%radius > 0)*model%contact(i)%spin
        end do
    end subroutine scale_meshes

    !> Angles have no size: they differ in the last place instead.
    subroutine scale_coordinates(model, copy, scale, similar)
        type(model_type), intent(in) :: model
        integer, intent(in) :: copy
        real(wp), intent(in) :: scale
        type(model_type), intent(inout) :: similar
        real(wp) :: own_scale
        integer :: i

        do i = 1, model%n_q
            own_scale = coordinate_scale(model, i, scale)
            similar%start_q(i) = own_scale*near_one([copy, of_start, i])*model%start_q(i)
            similar%stride(i) = own_scale*model%stride(i)
            associate (coordinate => similar%scene%coordinate(i))
                coordinate%start_position = own_scale*near_one([copy, of_start, i])*coordinate%start_position
                coordinate%start_velocity = own_scale*near_one([copy, of_rate, i])*coordinate%start_velocity
                call scale_law(own_scale, [copy, of_motion, i], coordinate%motion)
            end associate
        end do
    end subroutine scale_coordinates

    !> Laws of drives, with what their motors and cylinders are.
    subroutine scale_actuators(model, copy, scale, similar)
        type(model_type), intent(in) :: model
        integer, intent(in) :: copy
        real(wp), intent(in) :: scale
        type(model_type), intent(inout) :: similar
        integer :: i

        do i = 1, model%n_actuator
            call scale_drive(scale**effort_power(model, i), drive_scale(model, i, scale) == scale, scale, [copy, of_drive, i], &
                             similar%scene%actuator(i)%law)
            call scale_motor(drive_scale(model, i, scale) == scale, scale, similar%scene%actuator(i)%motor)
            if (model%scene%actuator(i)%cylinder%is_given) call scale_cylinder(scale, similar%scene%actuator(i)%cylinder)
            similar%scene%actuator(i)%preload = drive_scale(model, i, scale)*model%scene%actuator(i)%preload
        end do
    end subroutine scale_actuators

    !> Inertias of rotors, as they are about their joints' axes.
    subroutine scale_rotors(model, scale, similar)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: scale
        type(model_type), intent(inout) :: similar
        integer :: i

        do i = 1, size(model%motor)
            associate (motor => similar%motor(i))
                if (.not. is_slide(model%joint(motor%joint)%told_kind, motor%variable)) motor%inertia = scale**2*motor%inertia
            end associate
        end do
    end subroutine scale_rotors

    !> Forces and moments of loads.
    subroutine scale_loads(model, copy, scale, similar)
        type(model_type), intent(in) :: model
        integer, intent(in) :: copy
        real(wp), intent(in) :: scale
        type(model_type), intent(inout) :: similar
        integer :: i, k

        do i = 1, model%n_load
            do k = 1, 3
                call scale_law(scale, [copy, of_load, i, k], similar%scene%load(i)%force(k))
                call scale_law(scale**2, [copy, of_load, i, 3 + k], similar%scene%load(i)%moment(k))
            end do
        end do
    end subroutine scale_loads

    !> Where groups that are closed by iteration start from: lengths among their links' freedoms come first.
    subroutine scale_groups(model, scale, similar)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: scale
        type(model_type), intent(inout) :: similar
        integer :: i, n_length

        do i = 1, size(model%group)
            n_length = link_freedom(model) - merge(1, 3, model%is_planar)
            similar%group(i)%start(:n_length, :) = scale*model%group(i)%start(:n_length, :)
        end do
    end subroutine scale_groups

    !> What joints share by: how they and the links' arms give way, so that all energies are s**2 times those of the model, and how
    !> far they are off.
    pure subroutine scale_shares(model, scale, similar)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: scale
        type(model_type), intent(inout) :: similar
        integer :: i

        do i = 1, size(model%scene%joint)
            associate (joint => similar%scene%joint(i))
                joint%stiffness(3:) = scale**2*joint%stiffness(3:)
                joint%misfit(:3) = scale*joint%misfit(:3)
            end associate
        end do
        do i = 1, size(model%arm)
            similar%arm(i)%row(4:, :) = model%arm(i)%row(4:, :)/scale
        end do
    end subroutine scale_shares

    !> Radii and slides.
    pure subroutine scale_gears(model, scale, similar)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: scale
        type(model_type), intent(inout) :: similar
        real(wp) :: own_scale
        integer :: i, k

        do i = 1, size(model%gear)
            associate (spec => model%scene%joint(model%gear(i)%joint), scaled => similar%scene%joint(model%gear(i)%joint))
                call scale_gear(scale, similar%gear(i))
                if (spec%kind == joint_belt) scaled%wheel = scale*spec%wheel
                if (spec%kind == joint_rack) scaled%phase = scale*spec%phase
            end associate
        end do
        do i = 1, size(model%belt)
            associate (belt => similar%belt(i), spec => similar%scene%joint(model%belt(i)%gear%joint))
                call scale_gear(scale, belt%gear)
                belt%lever = scale*belt%lever
                belt%weight = scale*belt%weight
                belt%strand(at_pretension) = scale*belt%strand(at_pretension)
                spec%wheel = scale*spec%wheel
                spec%strand(at_pretension) = scale*spec%strand(at_pretension)
            end associate
        end do
        do i = 1, size(model%led)
            associate (led => model%led(i))
                own_scale = merge(scale, 1.0_wp, is_slide(model%joint(led%joint)%kind, led%variable))
                similar%led(i)%offset = own_scale*led%offset
                do k = 1, model%n_q
                    similar%led(i)%weight(k) = own_scale/coordinate_scale(model, k, scale)*led%weight(k)
                end do
                do k = 1, size(led%source)
                    similar%led(i)%source_weight(k) = own_scale*led%source_weight(k) &
                        /merge(scale, 1.0_wp, is_slide(model%joint(led%source(k))%kind, 1))
                end do
            end associate
        end do
    end subroutine scale_gears

    pure subroutine scale_gear(scale, gear)
        real(wp), intent(in) :: scale
        type(gear_type), intent(inout) :: gear

        gear%couple = scale*gear%couple
        gear%total = scale*gear%total
        gear%radius = scale*gear%radius
        gear%curvature = gear%curvature/scale
        gear%distance = scale*gear%distance
        gear%pitch = scale*gear%pitch
    end subroutine scale_gear

    !> What a coordinate is multiplied by: angles stay.
    pure real(wp) function coordinate_scale(model, i, scale)
        type(model_type), intent(in) :: model
        integer, intent(in) :: i
        real(wp), intent(in) :: scale

        coordinate_scale = merge(scale, 1.0_wp, is_length(model, i))
    end function coordinate_scale

    !> What a driving force is multiplied by; a torque by its square.
    pure real(wp) function drive_scale(model, i, scale)
        type(model_type), intent(in) :: model
        integer, intent(in) :: i
        real(wp), intent(in) :: scale

        associate (actuator => model%scene%actuator(i))
            drive_scale = merge(scale, scale**2, is_slide(model%joint(actuator%joint)%told_kind, actuator%variable))
        end associate
    end function drive_scale

    !> A motor turns as it did: of voltages and torque constants the torque is the product.
    pure subroutine scale_motor(is_sliding, scale, motor)
        logical, intent(in) :: is_sliding
        real(wp), intent(in) :: scale                !! of lengths
        type(motor_spec), intent(inout) :: motor

        if (is_sliding) motor%ratio = motor%ratio/scale
        motor%torque_constant = scale*motor%torque_constant
        motor%largest_torque = scale**2*motor%largest_torque
        motor%largest_power = scale**2*motor%largest_power
        motor%largest_current = scale*motor%largest_current
        if (allocated(motor%torque_curve%knot)) motor%torque_curve%knot = scale**2*motor%torque_curve%knot
        motor%brake%torque = scale**2*motor%brake%torque
    end subroutine scale_motor

    !> Pressures stay: areas grow as forces do, volumes as areas and ways.
    pure subroutine scale_cylinder(scale, cylinder)
        real(wp), intent(in) :: scale                !! of lengths
        type(cylinder_spec), intent(inout) :: cylinder

        cylinder%stroke = scale*cylinder%stroke
        cylinder%area = scale*cylinder%area
        cylinder%dead_volume = scale**2*cylinder%dead_volume
        cylinder%flow = scale**2*cylinder%flow
        cylinder%conductance = scale**2*cylinder%conductance
        cylinder%leakage = scale**2*cylinder%leakage
    end subroutine scale_cylinder

    !> Does a spring turn a joint, so that its stiffness is a moment per angle?
    pure logical function is_angular(model, joint, variable)
        type(model_type), intent(in) :: model
        integer, intent(in) :: joint, variable       !! 0: a spring between markers

        is_angular = .false.
        if (joint > 0) is_angular = .not. is_slide(model%joint(joint)%told_kind, variable)
    end function is_angular

    !> The law of a drive along a slide, or about an axis.
    pure subroutine scale_drive(force_scale, is_sliding, scale, key, drive)
        real(wp), intent(in) :: force_scale          !! of the driving force
        logical, intent(in) :: is_sliding
        real(wp), intent(in) :: scale                !! of lengths
        integer, intent(in) :: key(:)                !! of the drive, for `near_one`
        type(effort_law), intent(inout) :: drive
        real(wp) :: stiffness_scale, position_scale

        stiffness_scale = merge(1.0_wp, scale**2, is_sliding)
        position_scale = merge(scale, 1.0_wp, is_sliding)
        select case (drive%kind)
        case (effort_constant)
            drive%value(at_force) = force_scale*near_one(key)*drive%value(at_force)
        case (effort_table)
            call scale_law(force_scale, key, drive%target)
        case (effort_spring_damper)
            drive%value([at_stiffness, at_damping]) = stiffness_scale*drive%value([at_stiffness, at_damping])
            drive%value(at_rest) = position_scale*drive%value(at_rest)
        case (effort_dc_motor)
            drive%value(at_torque_constant) = stiffness_scale*drive%value(at_torque_constant)
            call scale_law(position_scale, key, drive%target)
        case (effort_pd)
            drive%value([at_stiffness, at_damping]) = stiffness_scale*drive%value([at_stiffness, at_damping])
            call scale_law(position_scale, key, drive%target)
        end select
    end subroutine scale_drive

    !> Values scaled, each another number in its last place. Durations stay, so that kinks do.
    pure subroutine scale_law(scale, key, law)
        real(wp), intent(in) :: scale
        integer, intent(in) :: key(:)                !! of the law, for `near_one`
        type(law_spec), intent(inout) :: law
        integer :: i

        do i = 1, merge(4, 2, law%kind == law_harmonic)
            law%value(i) = merge(scale, 1.0_wp, i <= 2)*near_one([key, i])*law%value(i)
        end do
        if (law%kind == law_harmonic) law%course = 0    ! its frequency and phase are its own now
        if (allocated(law%knot)) law%knot = [(scale*near_one([key, i])*law%knot(i), i=1, size(law%knot))]
        if (allocated(law%curvature)) law%curvature = scale*law%curvature
    end subroutine scale_law

    !> A component of an axis as it may be rounded as well: off by half a unit in the last place to one. Axes along x, y, z
    !> stay what they are, equal components stay equal.
    elemental real(wp) function other_rounding(copy, value) result(other)
        integer, intent(in) :: copy
        real(wp), intent(in) :: value

        other = value
        if (abs(value) /= 1) other = value*near_one([copy, nint(value*2.0_wp**29)])
    end function other_rounding

    !> A factor off 1 by half an epsilon to one, up or down, pseudo-random: the same for the same key.
    pure real(wp) function near_one(key) result(factor)
        integer, intent(in) :: key(:)
        integer(int64), parameter :: modulus = 2147483647_int64, multiplier = 48271_int64    ! Park and Miller's
        integer(int64) :: state
        integer :: i, k
        real(wp) :: amount

        state = 1
        do i = 1, size(key)
            state = modulo(state + key(i), modulus)
            do k = 1, 3
                state = modulo(multiplier*(state + 12345), modulus)
            end do
        end do
        amount = 2*real(state, wp)/real(modulus, wp) - 1    ! -1 ... 1
        factor = 1 + epsilon(1.0_wp)*(sign(0.5_wp, amount) + 0.5_wp*amount)
    end function near_one
end module linkdyn_similar_model
