!> The pressure angles of cams.
module linkdyn_cam_measures
    use linkdyn_cam_contact, only: cam_contact, contact_of, marker_place, marker_axis
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state
    use linkdyn_model, only: model_type
    use linkdyn_scene, only: joint_prismatic, guide_of
    use linkdyn_vec3, only: vec3, operator(-), operator(.dot.), operator(.cross.)
    implicit none (type, external)
    private
    public :: measure_pressure_angles

contains

    !> Between the normal and the way on which its guide lets the follower go where the force acts, 0 to pi/2.
    subroutine measure_pressure_angles(model, state, angle)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        real(wp), intent(out) :: angle(:, :)             !! (lane, n_cam) [rad]
        type(cam_contact) :: contact
        type(vec3) :: way, across
        integer :: j, g, side

        angle = 0
        do j = 1, model%n_joint
            if (model%joint(j)%cam == 0) cycle
            g = guide_of(model%scene, j)
            if (g == 0) cycle
            contact = contact_of(model, state, j)
            associate (guide => model%joint(g))
                side = merge(2, 1, guide%link(1) == model%joint(j)%link(2))
                way = marker_axis(model, state, g, side, 3)
                if (guide%kind /= joint_prismatic) way = way.cross.(contact%point - marker_place(model, state, g, side))
                across = way.cross.contact%normal
                angle(:, model%joint(j)%cam) = atan2(sqrt(across.dot.across), abs(way.dot.contact%normal))
            end associate
        end do
    end subroutine measure_pressure_angles
end module linkdyn_cam_measures
