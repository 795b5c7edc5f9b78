!> Motion of a point fixed to a planar link, at any level: velocity, acceleration, or one of its columns.
module linkdyn_planar_point
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_planar_motion, only: planar_motion, level_velocity, level_given
    use linkdyn_vec2, only: vec2, operator(+), operator(-), operator(*), perp
    implicit none (type, external)
    private
    public :: carried

contains

    !> The point at `arm` from the link's origin. The lecture's coupler_point.
    pure function carried(plane, level, link, o, arm) result(motion)
        type(planar_motion), intent(in) :: plane
        integer, intent(in) :: level, link
        integer, intent(in) :: o          !! orientation of the link
        type(vec2), intent(in) :: arm     !! world axes [m]
        type(vec2) :: motion
        real(wp) :: square(lanes)

        motion = plane%linear(level, link) + plane%angular(:, level, o)*perp(arm)
        if (level /= level_given) return
        square = plane%angular(:, level_velocity, o)**2
        motion = motion - square*arm
    end function carried
end module linkdyn_planar_point
