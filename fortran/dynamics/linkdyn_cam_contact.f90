!> Where a follower touches its cam, on lanes.
!>
!> To second order a cam is the circle that fits its outline best where it is touched. So place, normal and curvature there are all
!> that velocities, accelerations and forces need, and these are exact.
module linkdyn_cam_contact
    use linkdyn_curve, only: curve_point, foot_of, touching_point
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_model, only: model_type, orientation_of
    use linkdyn_planar_motion, only: planar_motion
    use linkdyn_scene, only: follower_flat
    use linkdyn_vec2, only: vec2, operator(+), operator(-), operator(*), operator(.dot.), operator(.cross.), operator(.rotate.)
    implicit none (type, external)
    private
    public :: locate_contacts, locate_contact, asked_of_curve

contains

    !> Contacts of those of some joints that are cams, from where their links are.
    subroutine locate_contacts(model, joint, plane)
        type(model_type), intent(in) :: model
        integer, intent(in) :: joint(:)
        type(planar_motion), intent(inout) :: plane
        integer :: i

        do i = 1, size(joint)
            if (model%joint(joint(i))%cam > 0) call locate_contact(model, joint(i), plane)
        end do
    end subroutine locate_contacts

    !> What is asked of the curve, in the axes of the cam's marker: where the follower is, or the direction of its face.
    function asked_of_curve(model, j, plane) result(seen)
        type(model_type), intent(in) :: model
        integer, intent(in) :: j
        type(planar_motion), intent(in) :: plane
        type(vec2) :: seen, x
        integer :: o(2)

        associate (joint => model%joint(j))
            o = [orientation_of(model, joint%link(1)), orientation_of(model, joint%link(2))]
            x = plane%rotation(o(1)).rotate.joint%frame(:2, 1, 1)
            if (model%scene%joint(j)%cam%follower == follower_flat) then
                seen = in_frame(x, -1.0_wp*(plane%rotation(o(2)).rotate.joint%frame(:2, 3, 2)))
            else
                seen = in_frame(x, plane%position(joint%link(2)) + (plane%rotation(o(2)).rotate.joint%point(:2, 2)) &
                                   - (plane%position(joint%link(1)) + (plane%rotation(o(1)).rotate.joint%point(:2, 1))))
            end if
        end associate
    end function asked_of_curve

    !> That of one.
    subroutine locate_contact(model, j, plane)
        type(model_type), intent(in) :: model
        integer, intent(in) :: j
        type(planar_motion), intent(inout) :: plane
        type(vec2) :: centre, follower, seen, point, normal, x
        type(curve_point) :: found
        real(wp) :: off, round
        integer :: o(2), lane, before

        associate (joint => model%joint(j), cam => model%scene%joint(j)%cam, contact => plane%contact(model%joint(j)%cam))
            o = [orientation_of(model, joint%link(1)), orientation_of(model, joint%link(2))]
            centre = plane%position(joint%link(1)) + (plane%rotation(o(1)).rotate.joint%point(:2, 1))
            follower = plane%position(joint%link(2)) + (plane%rotation(o(2)).rotate.joint%point(:2, 2))
            x = plane%rotation(o(1)).rotate.joint%frame(:2, 1, 1)
            seen = asked_of_curve(model, j, plane)
            off = cam%side*cam%radius
            if (cam%is_path) off = 0
            do lane = 1, lanes
                ! a run on its own has the same on all lanes
                before = max(1, lane - 1)
                if (lane == 1 .or. seen%x(lane) /= seen%x(before) .or. seen%y(lane) /= seen%y(before)) then
                    if (cam%follower == follower_flat) then
                        found = touching_point(cam%curve, [seen%x(lane), seen%y(lane)])
                    else
                        found = foot_of(cam%curve, [seen%x(lane), seen%y(lane)])
                    end if
                end if
                round = 1/found%curvature
                if (cam%follower /= follower_flat) round = found%curvature/(1 + off*found%curvature)
                point%x(lane) = found%at(1) + off*found%normal(1)
                point%y(lane) = found%at(2) + off*found%normal(2)
                normal%x(lane) = found%normal(1)
                normal%y(lane) = found%normal(2)
                contact%round(lane) = round
            end do
            contact%point = centre + out_of_frame(x, point)
            contact%normal = out_of_frame(x, normal)
            if (cam%follower == follower_flat) contact%normal = -1.0_wp*(plane%rotation(o(2)).rotate.joint%frame(:2, 3, 2))
            contact%gap = contact%normal.dot.(follower - contact%point)
            contact%arm = 0
            if (cam%follower == follower_flat) then
                contact%arm = (contact%point - follower) .cross.contact%normal
            end if
        end associate
    end subroutine locate_contact

    !> A vector of the world in axes whose x is given, and back.
    pure function in_frame(x, v) result(w)
        type(vec2), intent(in) :: x, v
        type(vec2) :: w

        w = vec2(x.dot.v, x.cross.v)
    end function in_frame

    pure function out_of_frame(x, w) result(v)
        type(vec2), intent(in) :: x, w
        type(vec2) :: v

        v = vec2(x%x*w%x - x%y*w%y, x%y*w%x + x%x*w%y)
    end function out_of_frame
end module linkdyn_cam_contact
