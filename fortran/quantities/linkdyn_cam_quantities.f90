!> What is told of cams: the force with which follower and curve press, and the pressure angle.
module linkdyn_cam_quantities
    use linkdyn_bodies, only: point_position
    use linkdyn_cam, only: cam
    use linkdyn_joint_kind, only: marker_pair
    use linkdyn_mechanism, only: mechanism_type, marker_point, pair_of
    use linkdyn_scene, only: joint_prismatic, guide_of
    use linkdyn_system, only: solved
    use linkdyn_trace, only: traced_type
    use linkdyn_value, only: value, zero, abs, atan2, sqrt, operator(-)
    use linkdyn_vector, only: vector, operator(+), operator(-), operator(.dot.), operator(.cross.)
    implicit none (type, external)
    private
    public :: contact_forces, pressure_angles

contains

    !> Above zero where a follower is pressed against its cam; in a groove, away from the cam's inside [N].
    function contact_forces(traced) result(force)
        type(traced_type), intent(inout) :: traced
        type(value), allocatable :: force(:)           !! (n_cam)
        integer :: j

        force = solved(traced%system, traced%unknowns%press)
        associate (model => traced%mechanism%model)
            do j = 1, model%n_joint
                if (model%joint(j)%cam == 0) cycle
                if (model%scene%joint(j)%cam%side < 0) force(model%joint(j)%cam) = -force(model%joint(j)%cam)
            end do
        end associate
    end function contact_forces

    !> Between the normal and the way on which its guide lets the follower go where the force acts, 0 to pi/2.
    function pressure_angles(mechanism) result(angle)
        type(mechanism_type), intent(in) :: mechanism
        type(value), allocatable :: angle(:)           !! (n_cam) [rad]
        type(marker_pair) :: pair
        type(vector) :: way, normal, across
        integer :: j, g

        allocate (angle(mechanism%model%n_cam))
        angle = zero()
        associate (model => mechanism%model)
            do j = 1, model%n_joint
                if (model%joint(j)%cam == 0) cycle
                g = guide_of(model%scene, j)
                if (g == 0) cycle
                pair = pair_of(mechanism, j)
                way = way_of_follower(mechanism, j, g, pair)
                select type (kind => mechanism%kind(j)%is)
                class is (cam)
                    normal = kind%normal(pair)
                end select
                across = way.cross.normal
                angle(model%joint(j)%cam) = atan2(sqrt(across.dot.across), abs(way.dot.normal))
            end do
        end associate
    end function pressure_angles

    !> Along a slide, or about a hinge; of any length.
    function way_of_follower(mechanism, j, guide, pair) result(way)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: j, guide                !! joints: the cam, and what guides its follower
        type(marker_pair), intent(in) :: pair          !! of the cam
        type(vector) :: way
        type(marker_pair) :: guided
        type(vector) :: touched
        integer :: side

        associate (joint => mechanism%model%joint(guide), cam_joint => mechanism%model%joint(j), bodies => mechanism%bodies)
            side = merge(2, 1, joint%link(1) == cam_joint%link(2))
            guided = pair_of(mechanism, guide)
            way = guided%first%z
            if (side == 2) way = guided%second%z
            if (joint%kind == joint_prismatic) return
            touched = point_position(bodies, cam_joint%link(1), marker_point(mechanism, j, 1))
            select type (kind => mechanism%kind(j)%is)
            class is (cam)
                touched = touched + kind%point(pair)
            end select
            way = way.cross.(touched - point_position(bodies, joint%link(side), marker_point(mechanism, guide, side)))
        end associate
    end function way_of_follower
end module linkdyn_cam_quantities
