!> Figures of a motion: energies, how well the loops are closed.
module linkdyn_motion_measures
    use linkdyn_belt_measures, only: strand_energy
    use linkdyn_cam_contact, only: cam_contact, contact_of
    use linkdyn_joint_rates, only: joint_view, view_joint, told_frame, joint_rate
    use linkdyn_joint_table, only: force_directions, moment_directions, is_threaded, is_geared, &
        along_z, along_axes, along_x_and_y, &
        along_normal, joint_prismatic, &
        joint_fixed
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state
    use linkdyn_lane_count, only: lanes
    use linkdyn_link_inertia, only: inertia_times
    use linkdyn_measures, only: measure_spring_length
    use linkdyn_model, only: model_type, orientation_of, is_released, scene_size, gapes
    use linkdyn_planar_motion, only: planar_motion, level_velocity
    use linkdyn_planar_point, only: carried
    use linkdyn_vec2, only: vec2, operator(+), operator(-), operator(*), operator(.dot.), operator(.cross.), &
        operator(.rotate.), vec2_of
    use linkdyn_vec3, only: vec3, mat3, operator(+), operator(-), operator(*), operator(.dot.), operator(.cross.), &
        operator(.rotate.), operator(.unrotate.)
    implicit none (type, external)
    private
    public :: measure_energy, spring_energy, measure_closure, released_fit

contains

    !> Kinetic energy, that of rotors too, and potential energy of gravity (zero at the world's origin) and springs.
    subroutine measure_energy(model, state, kinetic, potential)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        real(wp), intent(out) :: kinetic(lanes), potential(lanes)    !! [J]
        type(vec3) :: velocity, arm
        integer :: l, o

        call rotor_energy(model, state, kinetic)
        call spring_energy(model, state, potential)
        if (model%is_planar) then
            call add_planar_energy(model, state%plane, kinetic, potential)
            return
        end if
        do l = 1, model%n_link
            associate (link => model%link(l))
                o = link%orientation
                velocity = (state%rotation(o).unrotate.state%velocity(l)) + (state%omega_body(o).cross.link%cog)
                kinetic = kinetic + (link%mass*(velocity.dot.velocity) &
                                     + (state%omega_body(o).dot.inertia_times(link, state%omega_body(o))))/2
                arm = state%position(l) + (state%rotation(o).rotate.link%cog)
                potential = potential - link%mass*(arm.dot.model%gravity)
            end associate
        end do
    end subroutine measure_energy

    subroutine add_planar_energy(model, plane, kinetic, potential)
        type(model_type), intent(in) :: model
        type(planar_motion), intent(in) :: plane
        real(wp), intent(inout) :: kinetic(lanes), potential(lanes)
        type(vec2) :: velocity, arm
        integer :: l, o

        do l = 1, model%n_link
            associate (link => model%link(l))
                o = link%orientation
                arm = plane%rotation(o).rotate.link%cog(:2)
                velocity = carried(plane, level_velocity, l, o, arm)
                kinetic = kinetic + (link%mass*(velocity.dot.velocity) &
                                     + link%inertia(3, 3)*plane%angular(:, level_velocity, o)**2)/2
                potential = potential - link%mass*((plane%position(l) + arm).dot.vec2_of(model%gravity(:2)))
            end associate
        end do
    end subroutine add_planar_energy

    !> Energy stored in the springs and belts.
    subroutine spring_energy(model, state, energy)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        real(wp), intent(out) :: energy(lanes)         !! [J]
        real(wp), dimension(lanes) :: length, rate, of_belt
        integer :: i

        energy = 0
        do i = 1, size(model%belt)
            call strand_energy(model, i, state, of_belt)
            energy = energy + of_belt
        end do
        do i = 1, size(model%scene%spring)
            associate (spring => model%scene%spring(i))
                if (spring%measure > 0) cycle
                call measure_spring_length(model, spring, state, length, rate)
                energy = energy + spring%stiffness*(length - spring%rest)**2/2
            end associate
        end do
    end subroutine spring_energy

    !> Energy of the rotors of motors behind gears and screws: I s'^2/2 of a joint variable s at which they have the inertia I.
    subroutine rotor_energy(model, state, energy)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        real(wp), intent(out) :: energy(lanes)         !! [J]
        integer :: i

        energy = 0
        do i = 1, size(model%motor)
            associate (motor => model%motor(i))
                if (motor%inertia > 0) energy = energy + motor%inertia/2 &
                    *joint_rate(model, state, motor%joint, motor%variable, level_velocity)**2
            end associate
        end do
    end subroutine rotor_energy

    !> The largest distance or angle by which the two sides of a joint miss each other.
    subroutine measure_closure(model, state, gap)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        real(wp), intent(out) :: gap(lanes)    !! [m, rad]
        type(cam_contact) :: contact
        integer :: j

        gap = 0
        do j = 1, model%n_joint
            if (model%joint(j)%cam > 0) then
                contact = contact_of(model, state, j)
                gap = max(gap, abs(contact%gap))
            else if (.not. is_geared(model%joint(j)%told_kind)) then
                gap = max(gap, gap_of_joint(model, state, j))
            end if
        end do
    end subroutine measure_closure

    !> Do those of some joints fit that let go of what others hold? Of loops that close without these directions they need not.
    function released_fit(model, joint, state) result(fit)
        type(model_type), intent(in) :: model
        integer, intent(in) :: joint(:)
        type(kinematic_state), intent(in) :: state
        logical :: fit(lanes)
        integer :: i

        fit = .true.
        do i = 1, size(joint)
            if (is_geared(model%joint(joint(i))%told_kind)) cycle
            if (is_released(model%joint(joint(i)))) fit = fit .and. gap_of_joint(model, state, joint(i)) <= gapes*scene_size(model)
        end do
    end function released_fit

    !> Distance by which the sides of a joint miss each other, as the scene has it.
    function gap_of_joint(model, state, j) result(gap)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        integer, intent(in) :: j
        real(wp) :: gap(lanes)                 !! [m, rad]
        type(joint_view) :: view
        type(vec3) :: apart
        type(mat3) :: first, second
        integer :: kind

        if (model%is_planar) then
            gap = planar_gap(model, state%plane, j)
            return
        end if
        call view_joint(model, state, j, state%velocity, state%omega, view)
        apart = view%slide
        kind = model%joint(j)%kind
        first = view%frame(1)
        second = view%frame(2)
        if (is_released(model%joint(j))) then
            kind = model%joint(j)%told_kind
            first = told_frame(model, state, j, 1, view)
            second = told_frame(model, state, j, 2, view)
        end if
        if (force_directions(kind) == along_x_and_y) apart = apart - (apart.dot.first%z)*first%z
        if (force_directions(kind) == along_z) apart = (apart.dot.first%z)*first%z
        gap = sqrt(apart.dot.apart)
        if (is_threaded(kind)) gap = max(gap, abs(model%joint(j)%pitch)*thread_gap(view, model%joint(j)%pitch))
        select case (moment_directions(kind))
        case (along_x_and_y)
            gap = max(gap, apart_by(first%z, second%z))
        case (along_axes)
            gap = max(gap, apart_by(first%z, second%z), apart_by(first%x, second%x))
        case (along_normal)
            gap = max(gap, abs(first%z.dot.second%z))
        end select
    end function gap_of_joint

    !> Between two unit vectors: the sine of the angle, one if that is more than right.
    pure function apart_by(a, b) result(sine)
        type(vec3), intent(in) :: a, b
        real(wp) :: sine(lanes)

        sine = length_of(a.cross.b)
        where ((a.dot.b) < 0) sine = 1
    end function apart_by

    pure function planar_gap(model, plane, j) result(gap)
        type(model_type), intent(in) :: model
        type(planar_motion), intent(in) :: plane
        integer, intent(in) :: j
        real(wp) :: gap(lanes)
        type(vec2) :: apart, point(2), axis(2)
        integer :: side, o

        associate (joint => model%joint(j))
            do side = 1, 2
                o = orientation_of(model, joint%link(side))
                point(side) = plane%position(joint%link(side)) + (plane%rotation(o).rotate.joint%point(:2, side))
                axis(side) = plane%rotation(o).rotate.joint%told_frame(:2, merge(3, 1, joint%told_kind == joint_prismatic), side)
            end do
            apart = point(2) - point(1)
            if (joint%told_kind == joint_prismatic) then
                gap = max(abs(axis(1).cross.apart), abs(axis(1).cross.axis(2)))
            else
                gap = sqrt(apart.dot.apart)
                if (joint%told_kind == joint_fixed) gap = max(gap, abs(axis(1).cross.axis(2)))
            end if
        end associate
    end function planar_gap

    !> Angle by which a nut is off its thread.
    pure function thread_gap(view, pitch) result(angle)
        type(joint_view), intent(in) :: view
        real(wp), intent(in) :: pitch                  !! [m/rad]
        real(wp) :: angle(lanes)

        associate (first => view%frame(1), second => view%frame(2))
            angle = (view%slide.dot.first%z)/pitch - atan2(second%x.dot.first%y, second%x.dot.first%x)
        end associate
        angle = abs(atan2(sin(angle), cos(angle)))
    end function thread_gap

    pure function length_of(v) result(length)
        type(vec3), intent(in) :: v
        real(wp) :: length(lanes)

        length = sqrt(v.dot.v)
    end function length_of
end module linkdyn_motion_measures
