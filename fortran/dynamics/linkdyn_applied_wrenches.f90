!> Forces that are known from the motion: springs, and driving forces that are given. They act on the links as loads do.
module linkdyn_applied_wrenches
    use linkdyn_joint_rates, only: joint_view, view_joint, measure_variable
    use linkdyn_joint_motion, only: relative_axis
    use linkdyn_joint_table, only: is_slide
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state
    use linkdyn_lane_count, only: lanes
    use linkdyn_model, only: model_type, orientation_of
    use linkdyn_planar_motion, only: level_velocity
    use linkdyn_planar_point, only: carried
    use linkdyn_point, only: point_velocity
    use linkdyn_scene, only: frame_link, spring_spec, joint_prismatic
    use linkdyn_vec2, only: vec2, operator(+), operator(-), operator(*), operator(.cross.), operator(.rotate.), zero_vec2
    use linkdyn_vec3, only: vec3, operator(+), operator(-), operator(*), operator(.cross.), operator(.dot.), &
        operator(.rotate.), operator(.unrotate.), vec3_of, zero_vec3
    implicit none (type, external)
    private
    public :: clear_applied, apply_drive, apply_springs, spring_energy, spring_without_direction

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
        wrench = force*relative_axis(model%joint(j)%kind, variable, view%frame(1), view%frame(2))
        if (is_slide(model%joint(j)%kind, variable)) then
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
            if (joint%kind == joint_prismatic) then
                point = plane%position(joint%link(2)) + (plane%rotation(o(2)).rotate.joint%point(:2, 2))
                push = force*(plane%rotation(o(1)).rotate.joint%frame(:2, 3, 1))
                call apply_force(model, joint%link(2), in_space(point), in_space(push), state)
                call apply_force(model, joint%link(1), in_space(point), in_space((-1.0_wp)*push), state)
            else
                call apply_moment(model, joint%link(2), about_z(force), state)
                call apply_moment(model, joint%link(1), about_z(-force), state)
            end if
        end associate
    end subroutine apply_planar_drive

    !> A vector of the plane as one in space.
    pure function in_space(v) result(w)
        type(vec2), intent(in) :: v
        type(vec3) :: w

        w%x = v%x
        w%y = v%y
        w%z = 0
    end function in_space

    pure function about_z(moment) result(w)
        real(wp), intent(in) :: moment(lanes)
        type(vec3) :: w

        w = zero_vec3()
        w%z = moment
    end function about_z

    !> All springs of the scene. Needs angular rates in world axes.
    subroutine apply_springs(model, state)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(inout) :: state
        real(wp) :: value(lanes), rate(lanes)
        integer :: i

        do i = 1, size(model%scene%spring)
            associate (spring => model%scene%spring(i))
                if (spring%joint > 0) then
                    call measure_variable(model, state, spring%joint, spring%variable, spread(spring%rest, 1, lanes), &
                                          value, rate)
                    call apply_drive(model, spring%joint, spring%variable, -tension(spring, value, rate), state)
                else
                    call apply_between_markers(model, spring, state)
                end if
            end associate
        end do
    end subroutine apply_springs

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
        pull = tension(spring, distance, rate)*line
        call apply_force(model, spring%link(1), point(1), pull, state)
        call apply_force(model, spring%link(2), point(2), (-1.0_wp)*pull, state)
    end subroutine apply_between_markers

    !> Without rest and damping the force is stiffness times the way from one marker to the other: none where they coincide.
    pure logical function needs_direction(spring)
        type(spring_spec), intent(in) :: spring

        needs_direction = spring%rest /= 0 .or. spring%damping /= 0
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

    !> Energy stored in the springs.
    subroutine spring_energy(model, state, energy)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        real(wp), intent(out) :: energy(lanes)         !! [J]
        type(vec3) :: point(2), line
        real(wp) :: value(lanes), rate(lanes)
        logical :: ignored(lanes)
        integer :: i

        energy = 0
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

    !> Distance of a spring's two markers and how it changes.
    subroutine measure_distance(model, spring, state, point, line, distance, rate, is_lost)
        type(model_type), intent(in) :: model
        type(spring_spec), intent(in) :: spring
        type(kinematic_state), intent(in) :: state
        type(vec3), intent(out) :: point(2)            !! markers, world axes [m]
        type(vec3), intent(out) :: line                !! unit vector from the first to the second; zero where it is lost
        real(wp), intent(out) :: distance(lanes), rate(lanes)
        logical, intent(out) :: is_lost(lanes)         !! the direction: the markers coincide
        ! Rounding leaves the markers uncertain by a few eps of their distance from the origin. So close to each other half
        ! of the digits of their direction are gone.
        real(wp), parameter :: close = sqrt(epsilon(1.0_wp))
        type(vec3) :: velocity(2)
        real(wp) :: reach(lanes)
        integer :: side

        do side = 1, 2
            call locate_marker(model, spring%link(side), spring%marker(side), state, point(side), velocity(side))
        end do
        line = point(2) - point(1)
        distance = sqrt(line.dot.line)
        reach = sqrt(point(1).dot.point(1)) + sqrt(point(2).dot.point(2))
        is_lost = .not. distance > close*reach
        line = merge(0.0_wp, 1/max(distance, tiny(1.0_wp)), is_lost)*line
        rate = line.dot.(velocity(2) - velocity(1))
    end subroutine measure_distance

    pure function tension(spring, length, rate)
        type(spring_spec), intent(in) :: spring
        real(wp), intent(in) :: length(lanes), rate(lanes)    !! distance or joint variable, and its rate
        real(wp) :: tension(lanes)

        tension = spring%stiffness*(length - spring%rest) + spring%damping*rate
    end function tension

    !> A marker in motion, world axes.
    pure subroutine locate_marker(model, link, marker, state, point, velocity)
        type(model_type), intent(in) :: model
        integer, intent(in) :: link, marker
        type(kinematic_state), intent(in) :: state
        type(vec3), intent(out) :: point, velocity
        type(vec3) :: arm
        type(vec2) :: flat_arm
        integer :: o

        if (link == frame_link) then
            point = vec3_of(model%scene%frame%marker(marker)%at)
            velocity = zero_vec3()
        else if (model%is_planar) then
            o = model%link(link)%orientation
            flat_arm = state%plane%rotation(o).rotate.model%scene%link(link)%marker(marker)%at(:2)
            point = in_space(state%plane%position(link) + flat_arm)
            velocity = in_space(carried(state%plane, level_velocity, link, o, flat_arm))
        else
            o = model%link(link)%orientation
            arm = state%rotation(o).rotate.model%scene%link(link)%marker(marker)%at
            point = state%position(link) + arm
            velocity = point_velocity(state%velocity(link), state%omega(o), arm)
        end if
    end subroutine locate_marker

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
