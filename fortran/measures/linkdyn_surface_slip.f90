!> How surfaces slip of joints that have no variables: teeth and belts, by how their wheels turn in the carrier, and cams in a
!> plane, or under a roller, by how their follower passes them where both touch. As `linkdyn_friction` has it, with a sign and its
!> derivative, on lanes.
!>
!> Of teeth and belts the slip is linear in rates of joint variables, with constants. Of a cam, seen from it, with the normal n, the
!> axis z of a disc, or from that of a drum outwards, t = z x n, the follower's velocity v and angular velocity w, s = t.v - R w.z,
!> R to where a roller touches. As t turns about z it changes along n, along which points and centres of rollers have no velocity,
!> but a face has, whose t turns as it does. Round a drum all turns about the drum's axis besides.
module linkdyn_surface_slip
    use linkdyn_cam_contact, only: cam_contact, contact_of, marker_axis, marker_place
    use linkdyn_joint_rates, only: coordinate_of
    use linkdyn_joint_table, only: joint_cam, joint_n_variable
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state
    use linkdyn_lane_count, only: lanes
    use linkdyn_marker_motion, only: link_axes, turning_seen
    use linkdyn_model, only: model_type, gear_type
    use linkdyn_place_motion, only: seen_motion
    use linkdyn_planar_motion, only: level_velocity, level_given
    use linkdyn_scene, only: measure_spec, measure_marker, follower_flat, follower_roller
    use linkdyn_vec3, only: vec3, operator(-), operator(*), operator(.dot.), operator(.cross.), operator(.rotate.)
    implicit none (type, external)
    private
    public :: surface_slip, leads_slip, only_coordinate

contains

    !> Slip [m/s; of wheels that turn against each other rad/s]; at level k for a unit rate of coordinate k; at the level of what is
    !> given its derivative. Needs angular rates in world axes.
    function surface_slip(model, state, j, level) result(rate)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        integer, intent(in) :: j                       !! joint
        integer, intent(in) :: level                   !! the velocity, what is given, or a column
        real(wp) :: rate(lanes)

        if (model%joint(j)%told_kind == joint_cam) then
            rate = slip_on_cam(model, state, j, level)
        else
            rate = slip_of_wheels(model, state, j, level)
        end if
    end function surface_slip

    function slip_of_wheels(model, state, j, level) result(rate)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        integer, intent(in) :: j, level
        real(wp) :: rate(lanes)
        integer :: side

        rate = 0
        associate (contact => model%contact(findloc(model%contact%joint, j, dim=1)))
            do side = 1, 2
                rate = rate + ((link_axes(model, state, contact%carrier) .rotate.contact%spin(:, side)) &
                               .dot.turning_seen(model, state, [contact%carrier, model%joint(j)%link(side)], level))
            end do
        end associate
    end function slip_of_wheels

    !> How fast the follower passes its cam where both touch, or its rate by that of a coordinate, as the level says.
    function slip_on_cam(model, state, j, level) result(rate)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        integer, intent(in) :: j, level
        real(wp) :: rate(lanes)
        type(cam_contact) :: contact
        type(measure_spec) :: follower
        type(vec3) :: axis, across, way, point, spin
        real(wp) :: reach, far(lanes)

        associate (spec => model%scene%joint(j))
            follower%kind = measure_marker
            follower%link = spec%link
            follower%marker = spec%marker
            reach = 0
            if (spec%cam%follower == follower_roller .and. .not. spec%cam%is_groove) reach = spec%cam%side*spec%cam%radius
            contact = contact_of(model, state, j)
            axis = marker_axis(model, state, j, 1, 3)
            across = axis
            if (spec%cam%is_barrel) call look_outwards()
            way = across.cross.contact%normal
            rate = (way.dot.seen_motion(model, state, follower, level)) &
                   - reach*(across.dot.turning_seen(model, state, spec%link, level))
            if (level /= level_given .or. .not. (spec%cam%is_barrel .or. spec%cam%follower == follower_flat)) return
            point = seen_motion(model, state, follower, level_velocity)
            spin = turning_seen(model, state, spec%link, level_velocity)
            if (spec%cam%is_barrel) then
                rate = rate + ((axis.cross.across) .dot.point)/far &
                       *(((axis.cross.way) .dot.point) - reach*((axis.cross.across) .dot.spin))
            else
                rate = rate - (axis.dot.spin)*(contact%normal.dot.point)
            end if
        end associate

    contains

        !> From a drum's axis to its follower.
        subroutine look_outwards()
            across = marker_place(model, state, j, 2) - marker_place(model, state, j, 1)
            across = across - (axis.dot.across)*axis
            far = sqrt(across.dot.across)
            across = (1/far)*across
        end subroutine look_outwards
    end function slip_on_cam

    !> Is a slip linear in the rates of the coordinates, with constants?
    pure logical function leads_slip(model, j)
        type(model_type), intent(in) :: model
        integer, intent(in) :: j                       !! joint
        real(wp) :: row(model%n_q)

        call find_row(model, j, row, leads_slip)
    end function leads_slip

    !> The coordinate that stands still where there is no slip; 0: not one alone.
    pure integer function only_coordinate(model, j) result(k)
        type(model_type), intent(in) :: model
        integer, intent(in) :: j                       !! joint
        real(wp), parameter :: rounding = 1.0e-12_wp
        real(wp) :: row(model%n_q)
        logical :: is_known

        k = 1
        if (model%n_q == 1) return
        k = 0
        call find_row(model, j, row, is_known)
        if (.not. is_known) return
        if (count(abs(row) > rounding*maxval(abs(row))) == 1) k = maxloc(abs(row), dim=1)
    end function only_coordinate

    !> What unit rates of the coordinates make of a slip.
    pure subroutine find_row(model, j, row, is_known)
        type(model_type), intent(in) :: model
        integer, intent(in) :: j                       !! joint
        real(wp), intent(out) :: row(:)                !! (n_q)
        logical, intent(out) :: is_known               !! it is always the same

        row = 0
        is_known = model%joint(j)%told_kind /= joint_cam
        if (.not. is_known) return
        if (model%joint(j)%gear > 0) then
            call add_wheels(model, j, model%gear(model%joint(j)%gear), row, is_known)
        else
            call add_wheels(model, j, model%belt(model%joint(j)%belt)%gear, row, is_known)
        end if
    end subroutine find_row

    pure subroutine add_wheels(model, j, wheels, row, is_known)
        type(model_type), intent(in) :: model
        integer, intent(in) :: j                       !! joint
        type(gear_type), intent(in) :: wheels
        real(wp), intent(inout) :: row(:)              !! (n_q)
        logical, intent(inout) :: is_known
        real(wp) :: part(2), pace
        integer :: i, k, side

        associate (contact => model%contact(findloc(model%contact%joint, j, dim=1)))
            part = [(dot_product(contact%spin(:, side), wheels%spin(:, side)), side=1, 2)]
        end associate
        do i = 1, model%n_joint
            if (joint_n_variable(model%joint(i)%told_kind) == 0) cycle
            pace = dot_product(part, wheels%pace(model%joint(i)%first_variable + 1, :))
            if (.not. abs(pace) > 0) cycle
            k = coordinate_of(model, i, 1)
            if (k > 0) then
                row(k) = row(k) + pace
            else
                call add_led(model, i, pace, row, is_known)
            end if
        end do
    end subroutine add_wheels

    !> A joint variable that gears make of the coordinates, and of nothing else.
    pure subroutine add_led(model, i, pace, row, is_known)
        type(model_type), intent(in) :: model
        integer, intent(in) :: i                       !! joint
        real(wp), intent(in) :: pace                   !! of the slip, over its variable's
        real(wp), intent(inout) :: row(:)              !! (n_q)
        logical, intent(inout) :: is_known
        integer :: k

        k = findloc(model%led%joint, i, dim=1)
        if (k > 0) then
            if (size(model%led(k)%source) == 0) then
                row = row + pace*model%led(k)%weight
                return
            end if
        end if
        is_known = .false.
    end subroutine add_led
end module linkdyn_surface_slip
