!> Where a follower touches its cam, on lanes, world axes.
module linkdyn_cam_contact
    use linkdyn_curve, only: curve_point, foot_of, touching_point, radius_at
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state
    use linkdyn_lane_count, only: lanes
    use linkdyn_marker_motion, only: link_axes, link_origin
    use linkdyn_model, only: model_type
    use linkdyn_scene, only: cam_spec, follower_flat
    use linkdyn_vec3, only: vec3, operator(+), operator(-), operator(*), operator(.dot.), operator(.rotate.)
    implicit none (type, external)
    private
    public :: cam_contact, contact_of, angle_on_cam, marker_place, marker_axis

    type :: cam_contact
        type(vec3) :: point                              !! on the line of the force: a roller's centre, where a face is touched [m]
        type(vec3) :: normal                             !! from the cam to what is outside of it
        real(wp) :: gap(lanes) = 0                       !! between follower and curve [m]
    end type cam_contact

contains

    !> From where the links are.
    function contact_of(model, state, j) result(contact)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        integer, intent(in) :: j                         !! joint
        type(cam_contact) :: contact
        real(wp) :: asked(lanes, 3), point(lanes, 3), normal(lanes, 3)
        integer :: lane, before

        associate (cam => model%scene%joint(j)%cam)
            asked = asked_of_curve(model, state, j)
            do lane = 1, lanes
                ! a run on its own has the same on all lanes
                before = max(1, lane - 1)
                if (lane == 1 .or. any(abs(asked(lane, :) - asked(before, :)) > 0)) then
                    call find_contact(cam, asked(lane, :), point(lane, :), normal(lane, :))
                else
                    point(lane, :) = point(before, :)
                    normal(lane, :) = normal(before, :)
                end if
            end do
            contact%point = marker_place(model, state, j, 1) + in_space(model, state, j, point)
            contact%normal = in_space(model, state, j, normal)
            if (cam%follower == follower_flat) call see_along_axis(model, state, j, contact)
            contact%gap = contact%normal.dot.(marker_place(model, state, j, 2) - contact%point)
        end associate
    end function contact_of

    !> A face, seen along the cam's axis: the line that it is there, where its marker is.
    subroutine see_along_axis(model, state, j, contact)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        integer, intent(in) :: j                         !! joint
        type(cam_contact), intent(inout) :: contact
        type(vec3) :: axis, normal

        axis = marker_axis(model, state, j, 1, 3)
        normal = -1.0_wp*marker_axis(model, state, j, 2, 3)
        normal = normal - (axis.dot.normal)*axis
        contact%normal = (1/sqrt(normal.dot.normal))*normal
        contact%point = contact%point + (axis.dot.(marker_place(model, state, j, 2) - contact%point))*axis
    end subroutine see_along_axis

    !> The direction in which a cam is touched, about its axis [rad].
    function angle_on_cam(model, state, j) result(angle)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        integer, intent(in) :: j
        real(wp) :: angle(lanes)
        real(wp) :: asked(lanes, 3)

        asked = asked_of_curve(model, state, j)
        angle = atan2(asked(:, 2), asked(:, 1))
    end function angle_on_cam

    !> Where the follower is, or the direction of its face, in the axes of the cam's marker.
    function asked_of_curve(model, state, j) result(asked)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        integer, intent(in) :: j
        real(wp) :: asked(lanes, 3)
        type(vec3) :: seen
        integer :: k

        if (model%scene%joint(j)%cam%follower == follower_flat) then
            seen = -1.0_wp*marker_axis(model, state, j, 2, 3)
        else
            seen = marker_place(model, state, j, 2) - marker_place(model, state, j, 1)
        end if
        do k = 1, 3
            asked(:, k) = marker_axis(model, state, j, 1, k) .dot.seen
        end do
    end function asked_of_curve

    !> One point of the curve or path, and its normal, in the axes of the cam's marker.
    pure subroutine find_contact(cam, asked, point, normal)
        type(cam_spec), intent(in) :: cam
        real(wp), intent(in) :: asked(3)
        real(wp), intent(out) :: point(3), normal(3)
        type(curve_point) :: found
        real(wp) :: far, radius, slope

        if (cam%is_barrel) then
            far = norm2(asked(:2))
            call radius_at(cam%curve, atan2(asked(2), asked(1)), radius, slope)
            point = [asked(:2), cam%ground + radius]
            normal = [slope*asked(2)/far**2, -slope*asked(1)/far**2, 1.0_wp]
            normal = normal/norm2(normal)
            return
        end if
        if (cam%follower == follower_flat) then
            found = touching_point(cam%curve, asked(:2))
        else
            found = foot_of(cam%curve, asked(:2))
            if (.not. cam%is_path) found%at = found%at + cam%side*cam%radius*found%normal
        end if
        point = [found%at, merge(0.0_wp, asked(3), cam%follower == follower_flat)]
        normal = [found%normal, 0.0_wp]
    end subroutine find_contact

    !> A joint's marker.
    function marker_place(model, state, j, side) result(place)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        integer, intent(in) :: j, side
        type(vec3) :: place

        associate (link => model%joint(j)%link(side))
            place = link_origin(model, state, link) + (link_axes(model, state, link) .rotate.model%joint(j)%point(:, side))
        end associate
    end function marker_place

    !> One of its axes.
    function marker_axis(model, state, j, side, k) result(axis)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        integer, intent(in) :: j, side, k
        type(vec3) :: axis

        axis = link_axes(model, state, model%joint(j)%link(side)) .rotate.model%joint(j)%frame(:, k, side)
    end function marker_axis

    !> A vector that is given in the axes of the cam's marker.
    function in_space(model, state, j, v) result(w)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        integer, intent(in) :: j
        real(wp), intent(in) :: v(:, :)                  !! (lane, 3)
        type(vec3) :: w

        w = v(:, 1)*marker_axis(model, state, j, 1, 1) + v(:, 2)*marker_axis(model, state, j, 1, 2) &
            + v(:, 3)*marker_axis(model, state, j, 1, 3)
    end function in_space
end module linkdyn_cam_contact
