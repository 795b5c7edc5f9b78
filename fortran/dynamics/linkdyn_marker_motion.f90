!> Markers in motion: places and velocities in world axes.
module linkdyn_marker_motion
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state
    use linkdyn_model, only: model_type
    use linkdyn_planar_motion, only: level_velocity
    use linkdyn_planar_point, only: carried
    use linkdyn_point, only: point_velocity
    use linkdyn_scene, only: frame_link
    use linkdyn_vec2, only: vec2, operator(+), operator(.rotate.)
    use linkdyn_vec3, only: vec3, operator(+), operator(.rotate.), vec3_of, zero_vec3
    implicit none (type, external)
    private
    public :: locate_marker, in_space

contains

    !> A marker in motion, world axes.
    pure subroutine locate_marker(model, link, marker, state, point, velocity)
        type(model_type), intent(in) :: model
        integer, intent(in) :: link, marker            !! marker 0: the link's origin
        type(kinematic_state), intent(in) :: state
        type(vec3), intent(out) :: point, velocity
        type(vec3) :: arm
        type(vec2) :: flat_arm
        real(wp) :: at(3)
        integer :: o

        at = 0
        if (link == frame_link) then
            if (marker > 0) at = model%scene%frame%marker(marker)%at
            point = vec3_of(at)
            velocity = zero_vec3()
        else if (model%is_planar) then
            o = model%link(link)%orientation
            if (marker > 0) at = model%scene%link(link)%marker(marker)%at
            flat_arm = state%plane%rotation(o).rotate.at(:2)
            point = in_space(state%plane%position(link) + flat_arm)
            velocity = in_space(carried(state%plane, level_velocity, link, o, flat_arm))
        else
            o = model%link(link)%orientation
            if (marker > 0) at = model%scene%link(link)%marker(marker)%at
            arm = state%rotation(o).rotate.at
            point = state%position(link) + arm
            velocity = point_velocity(state%velocity(link), state%omega(o), arm)
        end if
    end subroutine locate_marker

    !> A vector of the plane as one in space.
    pure function in_space(v) result(w)
        type(vec2), intent(in) :: v
        type(vec3) :: w

        w%x = v%x
        w%y = v%y
        w%z = 0
    end function in_space
end module linkdyn_marker_motion
