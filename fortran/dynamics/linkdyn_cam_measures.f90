!> The pressure angles of cams.
module linkdyn_cam_measures
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state
    use linkdyn_model, only: model_type, orientation_of
    use linkdyn_scene, only: joint_prismatic, guide_of
    use linkdyn_vec2, only: vec2, operator(+), operator(-), operator(.dot.), operator(.cross.), operator(.rotate.), perp
    implicit none (type, external)
    private
    public :: measure_pressure_angles

contains

    !> Between the normal and the way on which its guide lets the follower go where the force acts, 0 to pi/2.
    subroutine measure_pressure_angles(model, state, angle)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        real(wp), intent(out) :: angle(:, :)             !! (lane, n_cam) [rad]
        type(vec2) :: way, pivot
        integer :: j, g, l, o, side

        angle = 0
        do j = 1, model%n_joint
            if (model%joint(j)%cam == 0) cycle
            g = guide_of(model%scene, j)
            if (g == 0) cycle
            associate (guide => model%joint(g), plane => state%plane, contact => state%plane%contact(model%joint(j)%cam))
                side = merge(2, 1, guide%link(1) == model%joint(j)%link(2))
                l = guide%link(side)
                o = orientation_of(model, l)
                if (guide%kind == joint_prismatic) then
                    way = plane%rotation(o).rotate.guide%frame(:2, 3, side)
                else
                    pivot = plane%position(l) + (plane%rotation(o).rotate.guide%point(:2, side))
                    way = perp(contact%point - pivot)
                end if
                angle(:, model%joint(j)%cam) = atan2(abs(way.cross.contact%normal), abs(way.dot.contact%normal))
            end associate
        end do
    end subroutine measure_pressure_angles
end module linkdyn_cam_measures
