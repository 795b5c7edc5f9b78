!> Forces that are known from the motion: springs, and driving forces that are given. They act on the links as loads do.
module linkdyn_applied_wrenches
    use linkdyn_belt_measures, only: belt_wrench_on, strand_energy
    use linkdyn_joint_rates, only: joint_view, view_joint, driven_axis, measure_variable
    use linkdyn_joint_table, only: is_slide
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state
    use linkdyn_lane_count, only: lanes
    use linkdyn_marker_motion, only: locate_marker, in_space
    use linkdyn_measures, only: measure_distance
    use linkdyn_model, only: model_type, orientation_of
    use linkdyn_scene, only: frame_link, spring_spec, law_spec, joint_prismatic, axes_link, law_none, law_over
    use linkdyn_vec2, only: vec2, operator(+), operator(-), operator(*), operator(.cross.), operator(.rotate.), zero_vec2
    use linkdyn_vec3, only: vec3, operator(+), operator(-), operator(*), operator(.cross.), operator(.dot.), &
        operator(.rotate.), operator(.unrotate.), vec3_of, zero_vec3
    implicit none (type, external)
    private
    public :: clear_applied, apply_drive, apply_springs, apply_load_laws, apply_force, apply_moment, spring_energy
    public :: spring_without_direction

contains

    subroutine clear_applied(model, state)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(inout) :: state
        integer :: l

        state%undefined = .false.
        if (model%is_planar) then
            do l = 1, model%n_link
                state%plane%applied_force(l) = zero_vec2()
            end do
            state%plane%applied_moment = 0
            return
        end if
        do l = 1, model%n_link
            state%applied_force(l) = zero_vec3()
            state%applied_moment(l) = zero_vec3()
        end do
    end subroutine clear_applied

    !> A force or torque at a joint variable: on the second link, its opposite on the first.
    subroutine apply_drive(model, j, variable, force, state)
        type(model_type), intent(in) :: model
        integer, intent(in) :: j, variable             !! joint and its variable
        real(wp), intent(in) :: force(lanes)           !! [N, N m]
        type(kinematic_state), intent(inout) :: state
        type(joint_view) :: view
        type(vec3) :: wrench

        if (model%joint(j)%leg > 0) then
            ! Along z of both leg links, through both origins.
            associate (link => model%joint(j)%link)
                state%applied_force(link(2))%z = state%applied_force(link(2))%z + force
                state%applied_force(link(1))%z = state%applied_force(link(1))%z - force
            end associate
            return
        end if
        if (model%is_planar) then
            call apply_planar_drive(model, j, force, state)
            return
        end if
        call view_joint(model, state, j, state%velocity, state%omega, view)
        wrench = force*driven_axis(model, state, j, variable, view)
        if (is_slide(model%joint(j)%told_kind, variable)) then
            call apply_force(model, model%joint(j)%link(2), view%point, wrench, state)
            call apply_force(model, model%joint(j)%link(1), view%point, (-1.0_wp)*wrench, state)
        else
            call apply_moment(model, model%joint(j)%link(2), wrench, state)
            call apply_moment(model, model%joint(j)%link(1), (-1.0_wp)*wrench, state)
        end if
    end subroutine apply_drive

    subroutine apply_planar_drive(model, j, force, state)
        type(model_type), intent(in) :: model
        integer, intent(in) :: j
        real(wp), intent(in) :: force(lanes)
        type(kinematic_state), intent(inout) :: state
        type(vec2) :: point, push
        integer :: o(2)

        associate (joint => model%joint(j), plane => state%plane)
            o = [orientation_of(model, joint%link(1)), orientation_of(model, joint%link(2))]
            if (joint%told_kind == joint_prismatic) then
                point = plane%position(joint%link(2)) + (plane%rotation(o(2)).rotate.joint%point(:2, 2))
                push = force*(plane%rotation(o(1)).rotate.joint%told_frame(:2, 3, 1))
                call apply_force(model, joint%link(2), in_space(point), in_space(push), state)
                call apply_force(model, joint%link(1), in_space(point), in_space((-1.0_wp)*push), state)
            else
                call apply_moment(model, joint%link(2), about_z(force), state)
                call apply_moment(model, joint%link(1), about_z(-force), state)
            end if
        end associate
    end subroutine apply_planar_drive

    pure function about_z(moment) result(w)
        real(wp), intent(in) :: moment(lanes)
        type(vec3) :: w

        w = zero_vec3()
        w%z = moment
    end function about_z

    !> All springs of the scene, and belts that stretch. Needs angular rates in world axes.
    subroutine apply_springs(model, state)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(inout) :: state
        real(wp) :: value(lanes), rate(lanes)
        type(vec3) :: point, force, moment
        integer :: i, side

        do i = 1, size(model%scene%spring)
            associate (spring => model%scene%spring(i))
                if (spring%force%kind == law_over) &
                    state%undefined = state%undefined .or. .not. abs(state%law(:, spring%force%law)) <= huge(1.0_wp)
                if (spring%joint > 0) then
                    call measure_variable(model, state, spring%joint, spring%variable, spread(spring%rest, 1, lanes), &
                                          value, rate)
                    call apply_drive(model, spring%joint, spring%variable, -tension(model, spring, state, value, rate), state)
                else
                    call apply_between_markers(model, spring, state)
                end if
            end associate
        end do
        do i = 1, size(model%belt)
            do side = 1, 2
                call belt_wrench_on(model, i, side, state, point, force, moment)
                associate (link => model%joint(model%belt(i)%gear%joint)%link(side))
                    call apply_force(model, link, point, force, state)
                    call apply_moment(model, link, moment, state)
                end associate
            end do
        end do
    end subroutine apply_springs

    !> Components of loads that follow laws over the state. A law without a value leaves the sample undefined.
    subroutine apply_load_laws(model, state)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(inout) :: state
        real(wp) :: component(lanes, 6)
        type(vec3) :: point, velocity, force, moment
        integer :: i, k

        do i = 1, model%n_load
            associate (load => model%scene%load(i), scale => model%scene%laws%scale)
                if (.not. any([load%force%kind, load%moment%kind] == law_over)) cycle
                component = 0
                do k = 1, 3
                    call add_law(load%force(k), scale, component(:, k))
                    call add_law(load%moment(k), scale**2, component(:, 3 + k))
                end do
                force = vec3(component(:, 1), component(:, 2), component(:, 3))
                moment = vec3(component(:, 4), component(:, 5), component(:, 6))
                if (load%axes == axes_link) then
                    force = to_world(model, load%link, state, force)
                    moment = to_world(model, load%link, state, moment)
                end if
                call locate_marker(model, load%link, load%marker, state, point, velocity)
                call apply_force(model, load%link, point, force, state)
                call apply_moment(model, load%link, moment, state)
            end associate
        end do

    contains

        subroutine add_law(law, scale, component)
            type(law_spec), intent(in) :: law
            real(wp), intent(in) :: scale
            real(wp), intent(inout) :: component(lanes)

            if (law%kind /= law_over) return
            component = scale*state%law(:, law%law)
            state%undefined = state%undefined .or. .not. abs(component) <= huge(1.0_wp)
        end subroutine add_law
    end subroutine apply_load_laws

    !> A vector from the axes of a link.
    pure function to_world(model, link, state, v) result(w)
        type(model_type), intent(in) :: model
        integer, intent(in) :: link
        type(kinematic_state), intent(in) :: state
        type(vec3), intent(in) :: v
        type(vec3) :: w

        associate (o => orientation_of(model, link))
            if (model%is_planar) then
                w = in_space(state%plane%rotation(o).rotate.vec2(v%x, v%y))
                w%z = v%z
            else
                w = state%rotation(o).rotate.v
            end if
        end associate
    end function to_world

    !> A spring pulls its markers together along their line. Where they coincide that has no direction.
    subroutine apply_between_markers(model, spring, state)
        type(model_type), intent(in) :: model
        type(spring_spec), intent(in) :: spring
        type(kinematic_state), intent(inout) :: state
        type(vec3) :: point(2), line, pull
        real(wp) :: distance(lanes), rate(lanes)
        logical :: is_lost(lanes)

        call measure_distance(model, spring, state, point, line, distance, rate, is_lost)
        if (needs_direction(spring)) state%undefined = state%undefined .or. is_lost
        pull = tension(model, spring, state, distance, rate)*line
        call apply_force(model, spring%link(1), point(1), pull, state)
        call apply_force(model, spring%link(2), point(2), (-1.0_wp)*pull, state)
    end subroutine apply_between_markers

    !> Without rest and damping the force is stiffness times the way from one marker to the other: none where they coincide.
    pure logical function needs_direction(spring)
        type(spring_spec), intent(in) :: spring

        needs_direction = spring%rest /= 0 .or. spring%damping /= 0 .or. spring%force%kind /= law_none
    end function needs_direction

    !> The first spring whose force has no direction on a lane; 0: there is none.
    integer function spring_without_direction(model, state, lane) result(i)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state     !! of which the positions are known
        integer, intent(in) :: lane
        type(vec3) :: point(2), line
        real(wp) :: distance(lanes), rate(lanes)
        logical :: is_lost(lanes)

        do i = 1, size(model%scene%spring)
            associate (spring => model%scene%spring(i))
                if (spring%joint > 0 .or. .not. needs_direction(spring)) cycle
                call measure_distance(model, spring, state, point, line, distance, rate, is_lost)
                if (is_lost(lane)) return
            end associate
        end do
        i = 0
    end function spring_without_direction

    !> Energy stored in the springs and belts.
    subroutine spring_energy(model, state, energy)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        real(wp), intent(out) :: energy(lanes)         !! [J]
        type(vec3) :: point(2), line
        real(wp) :: value(lanes), rate(lanes), of_belt(lanes)
        logical :: ignored(lanes)
        integer :: i

        energy = 0
        do i = 1, size(model%belt)
            call strand_energy(model, i, state, of_belt)
            energy = energy + of_belt
        end do
        do i = 1, size(model%scene%spring)
            associate (spring => model%scene%spring(i))
                if (spring%joint > 0) then
                    call measure_variable(model, state, spring%joint, spring%variable, spread(spring%rest, 1, lanes), &
                                          value, rate)
                else
                    call measure_distance(model, spring, state, point, line, value, rate, ignored)
                end if
                energy = energy + spring%stiffness*(value - spring%rest)**2/2
            end associate
        end do
    end subroutine spring_energy

    !> What a spring pulls with; its own law gives on top.
    pure function tension(model, spring, state, length, rate)
        type(model_type), intent(in) :: model
        type(spring_spec), intent(in) :: spring
        type(kinematic_state), intent(in) :: state
        real(wp), intent(in) :: length(lanes), rate(lanes)    !! distance or joint variable, and its rate
        real(wp) :: tension(lanes)

        tension = spring%stiffness*(length - spring%rest) + spring%damping*rate
        if (spring%force%kind == law_over) tension = tension + state%law(:, spring%force%law)*law_scale(model, spring)
    end function tension

    !> Of a similar mechanism: its force over that of the law, or its moment.
    pure real(wp) function law_scale(model, spring) result(scale)
        type(model_type), intent(in) :: model
        type(spring_spec), intent(in) :: spring

        scale = model%scene%laws%scale
        if (spring%joint == 0) return
        if (.not. is_slide(model%joint(spring%joint)%told_kind, spring%variable)) scale = scale**2
    end function law_scale

    !> A force at a point, both in world axes.
    subroutine apply_force(model, link, point, force, state)
        type(model_type), intent(in) :: model
        integer, intent(in) :: link
        type(vec3), intent(in) :: point, force
        type(kinematic_state), intent(inout) :: state

        if (link == frame_link) return
        if (model%is_planar) then
            associate (plane => state%plane, f => vec2(force%x, force%y))
                plane%applied_force(link) = plane%applied_force(link) + f
                plane%applied_moment(:, link) = plane%applied_moment(:, link) &
                                                + ((vec2(point%x, point%y) - plane%position(link)).cross.f)
            end associate
            return
        end if
        associate (r => state%rotation(model%link(link)%orientation))
            state%applied_force(link) = state%applied_force(link) + (r.unrotate.force)
        end associate
        call apply_moment(model, link, (point - state%position(link)).cross.force, state)
    end subroutine apply_force

    !> A moment, world axes.
    subroutine apply_moment(model, link, moment, state)
        type(model_type), intent(in) :: model
        integer, intent(in) :: link
        type(vec3), intent(in) :: moment
        type(kinematic_state), intent(inout) :: state

        if (link == frame_link) return
        if (model%is_planar) then
            state%plane%applied_moment(:, link) = state%plane%applied_moment(:, link) + moment%z
            return
        end if
        associate (r => state%rotation(model%link(link)%orientation))
            state%applied_moment(link) = state%applied_moment(link) + (r.unrotate.moment)
        end associate
    end subroutine apply_moment
end module linkdyn_applied_wrenches
