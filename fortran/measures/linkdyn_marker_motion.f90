!> Links and their markers in motion, in space and in the plane alike, at any level (as in `linkdyn_planar_motion`). World axes.
module linkdyn_marker_motion
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state
    use linkdyn_model, only: model_type, orientation_of
    use linkdyn_planar_motion, only: level_velocity, level_given
    use linkdyn_planar_point, only: carried
    use linkdyn_point, only: point_velocity
    use linkdyn_scene, only: frame_link
    use linkdyn_vec2, only: vec2
    use linkdyn_vec3, only: vec3, mat3, operator(+), operator(-), operator(.cross.), operator(.rotate.), vec3_of, zero_vec3
    implicit none (type, external)
    private
    public :: locate_marker, marker_arm, link_origin, link_axes, link_turning, turning_seen, carried_point, in_space

contains

    !> A marker in motion.
    pure subroutine locate_marker(model, link, marker, state, point, velocity)
        type(model_type), intent(in) :: model
        integer, intent(in) :: link, marker            !! marker 0: the link's origin
        type(kinematic_state), intent(in) :: state
        type(vec3), intent(out) :: point, velocity
        type(vec3) :: arm

        arm = marker_arm(model, state, link, marker)
        point = link_origin(model, state, link) + arm
        velocity = carried_point(model, state, link, arm, level_velocity)
    end subroutine locate_marker

    !> From a link's origin to one of its markers [m].
    pure function marker_arm(model, state, link, marker) result(arm)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        integer, intent(in) :: link, marker            !! marker 0: the link's origin
        type(vec3) :: arm

        arm = zero_vec3()
        if (marker == 0) return
        if (link == frame_link) then
            arm = vec3_of(model%scene%frame%marker(marker)%at)
        else
            arm = link_axes(model, state, link).rotate.model%scene%link(link)%marker(marker)%at
        end if
    end function marker_arm

    !> Where a link's origin is [m].
    pure function link_origin(model, state, link) result(origin)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        integer, intent(in) :: link
        type(vec3) :: origin

        if (model%is_planar) then
            origin = in_space(state%plane%position(link))
        else
            origin = state%position(link)
        end if
    end function link_origin

    !> How a link stands.
    pure function link_axes(model, state, link) result(axes)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        integer, intent(in) :: link
        type(mat3) :: axes

        if (.not. model%is_planar) then
            axes = state%rotation(orientation_of(model, link))
            return
        end if
        associate (r => state%plane%rotation(orientation_of(model, link)))
            axes%x = in_space(vec2(r%c, r%s))
            axes%y = in_space(vec2(-r%s, r%c))
        end associate
        axes%z = vec3_of([0.0_wp, 0.0_wp, 1.0_wp])
    end function link_axes

    !> Angular velocity of a link, what a unit rate of a coordinate adds to it, or its angular acceleration.
    pure function link_turning(model, state, link, level) result(turning)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        integer, intent(in) :: link, level
        type(vec3) :: turning
        integer :: o

        o = orientation_of(model, link)
        if (model%is_planar) then
            turning = zero_vec3()
            turning%z = state%plane%angular(:, level, o)
        else if (level == level_velocity) then
            turning = state%omega(o)
        else
            turning = state%alpha(level, o)
        end if
    end function link_turning

    !> How the second of two links turns as the first one sees it, which turns itself.
    pure function turning_seen(model, state, link, level) result(turning)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        integer, intent(in) :: link(2), level
        type(vec3) :: turning, of_first

        turning = link_turning(model, state, link(2), level) - link_turning(model, state, link(1), level)
        if (level /= level_given) return
        of_first = link_turning(model, state, link(1), level_velocity)
        turning = turning - (of_first.cross.(link_turning(model, state, link(2), level_velocity) - of_first))
    end function turning_seen

    !> Velocity, column or acceleration of a point of a link.
    pure function carried_point(model, state, link, arm, level) result(motion)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        integer, intent(in) :: link, level
        type(vec3), intent(in) :: arm                  !! from the link's origin [m]
        type(vec3) :: motion
        integer :: o

        o = orientation_of(model, link)
        if (model%is_planar) then
            motion = in_space(carried(state%plane, level, link, o, vec2(arm%x, arm%y)))
        else if (level == level_velocity) then
            motion = point_velocity(state%velocity(link), state%omega(o), arm)
        else
            motion = point_velocity(state%acceleration(level, link), state%alpha(level, o), arm)
            if (level == level_given) motion = motion + (state%omega(o).cross.(state%omega(o).cross.arm))
        end if
    end function carried_point

    !> A vector of the plane as one in space.
    pure function in_space(v) result(w)
        type(vec2), intent(in) :: v
        type(vec3) :: w

        w%x = v%x
        w%y = v%y
        w%z = 0
    end function in_space
end module linkdyn_marker_motion
