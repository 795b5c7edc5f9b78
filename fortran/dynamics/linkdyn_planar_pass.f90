!> The kinematic program of planar mechanisms: positions, then velocities and acceleration columns level by level.
!>
!> Every moving link hangs on a joint, by a hinge whose angular rate is known or on a slide whose rate is known. An open
!> chain gives that rate; a dyad's 2x2 map yields it for both its links; so one procedure moves any link.
module linkdyn_planar_pass
    use linkdyn_given, only: given_position, given_rate, given_acceleration, given_column, has_lost_turns
    use linkdyn_dyad_map, only: dyad_map, solve_dyad, uncertainty_of_dyad_motion
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state
    use linkdyn_lane_count, only: lanes
    use linkdyn_model, only: model_type, step_type, step_pose, step_joint, step_rrr, step_rrp, step_rpr, step_prp, &
        orientation_of, side_of
    use linkdyn_planar_motion, only: planar_motion, level_velocity, level_given
    use linkdyn_rpr_dyad, only: locate_rpr, map_rpr, bias_rpr
    use linkdyn_rrp_dyad, only: locate_rrp, map_rrp, bias_rrp, drift_rrp
    use linkdyn_rrr_dyad, only: locate_rrr, map_rrr, bias_rrr, drift_rrr
    use linkdyn_scene, only: joint_prismatic
    use linkdyn_slide_dyads, only: map_prp, map_ppr, bias_prp, bias_ppr
    use linkdyn_vec2, only: vec2, operator(+), operator(-), operator(*), operator(.dot.), operator(.rotate.), perp, rot2_by_angle, &
        rot2_of_directions
    use linkdyn_planar_point, only: carried, carry
    implicit none (type, external)
    private
    public :: run_planar_step, map_placed, hang_planar_link, uncertainty_of_dyad

    !> A link hanging on a known link by a joint.
    type :: hanger
        integer :: known = 0, known_side = 1, o_known = 0
        integer :: link = 0, o = 0
        integer :: joint = 0
        logical :: slides = .false.
        type(vec2) :: hold                 !! from the known link's origin to the moving link's marker
        type(vec2) :: arm                  !! from the moving link's origin to its marker
        type(vec2) :: u                    !! along the slide, world
        real(wp) :: sense = 1              !! -1: the known link is the joint's second
        real(wp) :: slide_rate(lanes) = 0
    end type hanger

contains

    !> A step with a closed form, on the block whose coordinates are in the state.
    subroutine run_planar_step(model, step, state)
        type(model_type), intent(in) :: model
        type(step_type), intent(in) :: step
        type(kinematic_state), intent(inout) :: state

        select case (step%kind)
        case (step_pose)
            call take_pose(model, step, state)
        case (step_joint)
            call walk_joint(model, step, state)
        case (step_rrr)
            call close_rrr(model, step, state)
        case (step_rrp)
            call close_rrp(model, step, state)
        case (step_rpr)
            call close_rpr(model, step, state)
        case default
            call close_slides(model, step, state)
        end select
    end subroutine run_planar_step

    ! ---------------------------------------------------------------- links whose motion is given

    !> A link whose x, y and angle are coordinates.
    subroutine take_pose(model, step, state)
        type(model_type), intent(in) :: model
        type(step_type), intent(in) :: step
        type(kinematic_state), intent(inout) :: state
        integer :: l, o

        l = step%link(1)
        o = model%link(l)%orientation
        associate (plane => state%plane, c => step%coordinate)
            plane%rotation(o) = rot2_by_angle(state%q(:, c(6)))
            plane%position(l) = vec2(state%q(:, c(1)), state%q(:, c(2)))
            plane%angular(:, level_velocity, o) = state%qd(:, c(6))
            plane%linear(level_velocity, l) = vec2(state%qd(:, c(1)), state%qd(:, c(2)))
            plane%angular(:, level_given, o) = state%qdd(:, c(6))
            plane%linear(level_given, l) = vec2(state%qdd(:, c(1)), state%qdd(:, c(2)))
            if (state%n_column <= 0) return
            plane%linear(c(1), l)%x = 1
            plane%linear(c(2), l)%y = 1
            plane%angular(:, c(6), o) = 1
        end associate
    end subroutine take_pose

    !> Open chain: a crank or slider on a known link, or what is welded to it. The lecture's crank_input, also on a moving link.
    subroutine walk_joint(model, step, state)
        type(model_type), intent(in) :: model
        type(step_type), intent(in) :: step
        type(kinematic_state), intent(inout) :: state
        type(hanger) :: h
        real(wp) :: variable(lanes), rate(lanes)
        integer :: level, c

        c = step%coordinate(1)
        h = hanger_of(model, step%joint(1), step%link(1))
        variable = 0
        if (c > 0) then
            variable = h%sense*given_position(model, state, c)
            state%branch_lost = state%branch_lost .or. has_lost_turns(model, state, c)
        end if
        if (h%slides) then
            call turn_with_known(model, h, state%plane)
            call place_on_slide(model, h, variable, state)
        else
            call turn_by_angle(model, h, variable, state%plane)
            call place_on_hinge(model, h, state%plane)
        end if
        do level = level_velocity, state%n_column
            rate = 0
            if (c > 0) then
                select case (level)
                case (level_velocity)
                    rate = h%sense*given_rate(model, state, c)
                case (level_given)
                    rate = h%sense*given_acceleration(model, state, c)
                case default
                    rate = h%sense*given_column(model, state, c, level)
                end select
            end if
            ! The coordinate is relative; a hinge is told the link's own angular rate.
            if (.not. h%slides) rate = rate + state%plane%angular(:, level, h%o_known)
            call move_link(h, level, rate, state%plane)
        end do
    end subroutine walk_joint

    !> Place a link by one of its joints and that joint's variable; no rates.
    subroutine hang_planar_link(model, j, link, variable, state)
        type(model_type), intent(in) :: model
        integer, intent(in) :: j, link
        real(wp), intent(in) :: variable(lanes)
        type(kinematic_state), intent(inout) :: state
        type(hanger) :: h

        h = hanger_of(model, j, link)
        if (h%slides) then
            call turn_with_known(model, h, state%plane)
            call place_on_slide(model, h, h%sense*variable, state)
        else
            call turn_by_angle(model, h, h%sense*variable, state%plane)
            call place_on_hinge(model, h, state%plane)
        end if
    end subroutine hang_planar_link

    ! ---------------------------------------------------------------- hangers

    pure function hanger_of(model, j, link) result(h)
        type(model_type), intent(in) :: model
        integer, intent(in) :: j, link
        type(hanger) :: h

        associate (joint => model%joint(j))
            h%joint = j
            h%known_side = 3 - side_of(joint, link)
            h%known = joint%link(h%known_side)
            h%o_known = orientation_of(model, h%known)
            h%link = link
            h%o = orientation_of(model, link)
            h%slides = joint%kind == joint_prismatic
            h%sense = merge(1.0_wp, -1.0_wp, h%known_side == 1)
        end associate
    end function hanger_of

    !> The link's own marker at its joint, link axes.
    pure function own_point(model, h) result(point)
        type(model_type), intent(in) :: model
        type(hanger), intent(in) :: h
        real(wp) :: point(2)

        point = model%joint(h%joint)%point(:2, 3 - h%known_side)
    end function own_point

    !> Across a slide both links turn alike, up to the directions of their markers.
    pure subroutine turn_with_known(model, h, plane)
        type(model_type), intent(in) :: model
        type(hanger), intent(in) :: h
        type(planar_motion), intent(inout) :: plane

        if (h%o == h%o_known) return
        associate (joint => model%joint(h%joint))
            plane%rotation(h%o) = rot2_of_directions(joint%frame(:2, 3, 3 - h%known_side), &
                                                     plane%rotation(h%o_known).rotate.joint%frame(:2, 3, h%known_side))
        end associate
    end subroutine turn_with_known

    !> Turn the link against the known one by the joint's angle, counted between the markers' x axes. A welded link may share
    !> the known one's rotation.
    pure subroutine turn_by_angle(model, h, angle, plane)
        type(model_type), intent(in) :: model
        type(hanger), intent(in) :: h
        real(wp), intent(in) :: angle(lanes)
        type(planar_motion), intent(inout) :: plane

        if (h%o == h%o_known) return
        associate (joint => model%joint(h%joint))
            plane%rotation(h%o) = rot2_by_angle(angle)
            if (all(joint%frame(:2, 1, 1) == joint%frame(:2, 1, 2))) then
                if (h%o_known > 0) plane%rotation(h%o) = plane%rotation(h%o_known)*plane%rotation(h%o)
            else
                plane%rotation(h%o) = rot2_of_directions(joint%frame(:2, 1, 3 - h%known_side), &
                    plane%rotation(h%o_known).rotate.(plane%rotation(h%o).rotate.joint%frame(:2, 1, h%known_side)))
            end if
        end associate
    end subroutine turn_by_angle

    !> The known link's marker, from its origin, world axes.
    pure function hold_of(model, h, plane) result(hold)
        type(model_type), intent(in) :: model
        type(hanger), intent(in) :: h
        type(planar_motion), intent(in) :: plane
        type(vec2) :: hold

        hold = plane%rotation(h%o_known).rotate.model%joint(h%joint)%point(:2, h%known_side)
    end function hold_of

    pure subroutine place_on_hinge(model, h, plane)
        type(model_type), intent(in) :: model
        type(hanger), intent(inout) :: h
        type(planar_motion), intent(inout) :: plane

        h%hold = hold_of(model, h, plane)
        h%arm = plane%rotation(h%o).rotate.own_point(model, h)
        plane%position(h%link) = plane%position(h%known) + h%hold - h%arm
    end subroutine place_on_hinge

    !> `forward`: from the known link's marker to the moving link's, along the slide.
    pure subroutine place_on_slide(model, h, forward, state)
        type(model_type), intent(in) :: model
        type(hanger), intent(inout) :: h
        real(wp), intent(in) :: forward(lanes)
        type(kinematic_state), intent(inout) :: state

        h%u = slide_axis(model, h, state%plane)
        state%slide(:, 1, h%joint) = h%sense*forward
        h%hold = hold_of(model, h, state%plane) + forward*h%u
        h%arm = state%plane%rotation(h%o).rotate.own_point(model, h)
        state%plane%position(h%link) = state%plane%position(h%known) + h%hold - h%arm
    end subroutine place_on_slide

    pure function slide_axis(model, h, plane) result(u)
        type(model_type), intent(in) :: model
        type(hanger), intent(in) :: h
        type(planar_motion), intent(in) :: plane
        type(vec2) :: u

        u = plane%rotation(h%o_known).rotate.model%joint(h%joint)%frame(:2, 3, h%known_side)
    end function slide_axis

    !> One level of the link's motion. `rate`: of its angle (hinge) or of the slide, forward.
    pure subroutine move_link(h, level, rate, plane)
        type(hanger), intent(inout) :: h
        integer, intent(in) :: level
        real(wp), intent(in) :: rate(lanes)
        type(planar_motion), intent(inout) :: plane
        type(vec2) :: marker

        marker = carried(plane, level, h%known, h%o_known, h%hold)
        if (h%slides) then
            marker = marker + rate*h%u
            if (level == level_velocity) h%slide_rate = rate
            if (level == level_given) &
                marker = marker + (2*plane%angular(:, level_velocity, h%o_known)*h%slide_rate)*perp(h%u)
            if (h%o /= h%o_known) plane%angular(:, level, h%o) = plane%angular(:, level, h%o_known)
        else
            plane%angular(:, level, h%o) = rate
        end if
        plane%linear(level, h%link) = carry(plane, level, marker, h%o, -h%arm)
    end subroutine move_link

    ! ---------------------------------------------------------------- dyads

    !> Two hinged links between known links. The lecture's RRR_links.
    subroutine close_rrr(model, step, state)
        type(model_type), intent(in) :: model
        type(step_type), intent(in) :: step
        type(kinematic_state), intent(inout) :: state
        type(hanger) :: h1, h2
        type(vec2) :: arm1, arm2, gap
        real(wp) :: fixed1(2), fixed2(2), rate1(lanes), rate2(lanes)
        logical :: is_reachable(lanes)
        integer :: level

        h1 = hanger_of(model, step%joint(1), step%link(1))
        h2 = hanger_of(model, step%joint(3), step%link(2))
        fixed1 = inner_point(model, step, 1) - own_point(model, h1)
        fixed2 = inner_point(model, step, 2) - own_point(model, h2)
        associate (plane => state%plane, map => state%plane%dyad(step%first))
            gap = (plane%position(h2%known) + hold_of(model, h2, plane)) &
                  - (plane%position(h1%known) + hold_of(model, h1, plane))
            call locate_rrr(gap, norm2(fixed1), norm2(fixed2), state%branch(:, step%first), arm1, arm2, is_reachable)
            state%unreachable = state%unreachable .or. .not. is_reachable
            plane%rotation(h1%o) = rot2_of_directions(fixed1, arm1)
            plane%rotation(h2%o) = rot2_of_directions(fixed2, arm2)
            call place_on_hinge(model, h1, plane)
            call place_on_hinge(model, h2, plane)
            map = map_rrr(arm1, arm2)
            call watch_dead_point(map, is_reachable, state)
            do level = level_velocity, state%n_column
                gap = carried(plane, level, h2%known, h2%o_known, h2%hold) - carried(plane, level, h1%known, h1%o_known, h1%hold)
                if (level == level_given) gap = gap + bias_rrr(arm1, arm2, rate1, rate2)
                call solve_dyad(map, gap, rate1, rate2)
                if (level <= level_given) call keep_rates(step%first, level, rate1, rate2, plane)
                if (level == level_velocity) plane%drift(:, step%first) = drift_rrr(arm1, arm2, rate1, rate2)
                call move_link(h1, level, rate1, plane)
                call move_link(h2, level, rate2, plane)
            end do
        end associate
    end subroutine close_rrr

    !> A hinged link and a link on a slide. The lecture's PRR_links.
    subroutine close_rrp(model, step, state)
        type(model_type), intent(in) :: model
        type(step_type), intent(in) :: step
        type(kinematic_state), intent(inout) :: state
        type(hanger) :: h1, h2
        type(vec2) :: arm, gap, u, reach, inner
        real(wp) :: fixed(2), forward(lanes), rate1(lanes), rate2(lanes), omega(lanes)
        logical :: is_reachable(lanes)
        integer :: level

        h1 = hanger_of(model, step%joint(1), step%link(1))
        h2 = hanger_of(model, step%joint(3), step%link(2))
        fixed = inner_point(model, step, 1) - own_point(model, h1)
        associate (plane => state%plane, map => state%plane%dyad(step%first))
            call turn_with_known(model, h2, plane)
            u = slide_axis(model, h2, plane)
            ! The inner joint at slide 0, from the origin of the known link.
            reach = hold_of(model, h2, plane) + (plane%rotation(h2%o).rotate.(inner_point(model, step, 2) - own_point(model, h2)))
            gap = plane%position(h2%known) + reach - (plane%position(h1%known) + hold_of(model, h1, plane))
            call locate_rrp(gap, u, norm2(fixed), state%branch(:, step%first), arm, forward, is_reachable)
            state%unreachable = state%unreachable .or. .not. is_reachable
            plane%rotation(h1%o) = rot2_of_directions(fixed, arm)
            call place_on_hinge(model, h1, plane)
            call place_on_slide(model, h2, forward, state)
            inner = reach + forward*u
            map = map_rrp(arm, u)
            call watch_dead_point(map, is_reachable, state)
            do level = level_velocity, state%n_column
                gap = carried(plane, level, h2%known, h2%o_known, inner) - carried(plane, level, h1%known, h1%o_known, h1%hold)
                omega = plane%angular(:, level_velocity, h2%o_known)
                if (level == level_given) gap = gap + bias_rrp(arm, u, rate1, omega, rate2)
                call solve_dyad(map, gap, rate1, rate2)
                if (level <= level_given) call keep_rates(step%first, level, rate1, rate2, plane)
                if (level == level_velocity) plane%drift(:, step%first) = drift_rrp(arm, u, rate1, omega)
                call move_link(h1, level, rate1, plane)
                call move_link(h2, level, rate2, plane)
            end do
        end associate
    end subroutine close_rrp

    !> Two hinged links that slide on each other.
    subroutine close_rpr(model, step, state)
        type(model_type), intent(in) :: model
        type(step_type), intent(in) :: step
        type(kinematic_state), intent(inout) :: state
        type(hanger) :: h1, h2
        type(vec2) :: d, u, gap
        real(wp) :: axis(2), offset(2), forward(lanes), rate1(lanes), rate2(lanes)
        logical :: is_reachable(lanes)
        integer :: level

        h1 = hanger_of(model, step%joint(1), step%link(1))
        h2 = hanger_of(model, step%joint(3), step%link(2))
        associate (plane => state%plane, map => state%plane%dyad(step%first), inner => model%joint(step%joint(2)))
            axis = inner%frame(:2, 3, 1)
            offset = in_slide_axes(inner%point(:2, 1) - own_point(model, h1), axis) &
                     + in_slide_axes(own_point(model, h2) - inner%point(:2, 2), inner%frame(:2, 3, 2))
            d = (plane%position(h2%known) + hold_of(model, h2, plane)) - (plane%position(h1%known) + hold_of(model, h1, plane))
            call locate_rpr(d, offset(2), state%branch(:, step%first), u, forward, is_reachable)
            state%unreachable = state%unreachable .or. .not. is_reachable
            state%slide(:, 1, step%joint(2)) = forward - offset(1)
            plane%rotation(h1%o) = rot2_of_directions(axis, u)
            if (h2%o /= h1%o) plane%rotation(h2%o) = rot2_of_directions(inner%frame(:2, 3, 2), u)
            call place_on_hinge(model, h1, plane)
            call place_on_hinge(model, h2, plane)
            map = map_rpr(d, u)
            call watch_dead_point(map, is_reachable, state)
            do level = level_velocity, state%n_column
                gap = carried(plane, level, h2%known, h2%o_known, h2%hold) - carried(plane, level, h1%known, h1%o_known, h1%hold)
                if (level == level_given) gap = gap + bias_rpr(d, u, rate1, rate2)
                call solve_dyad(map, gap, rate1, rate2)
                if (level <= level_given) call keep_rates(step%first, level, rate1, rate2, plane)
                if (level == level_velocity) plane%drift(:, step%first) = rate2
                call move_link(h1, level, rate1, plane)
                call move_link(h2, level, rate1, plane)
            end do
        end associate
    end subroutine close_rpr

    !> PRP and PPR: all orientations are known, two slides close the gap.
    subroutine close_slides(model, step, state)
        type(model_type), intent(in) :: model
        type(step_type), intent(in) :: step
        type(kinematic_state), intent(inout) :: state
        type(hanger) :: h1, h2, inner
        type(vec2) :: u1, u2, reach1, reach2, gap, bias
        real(wp) :: forward1(lanes), forward2(lanes), rate1(lanes), rate2(lanes)
        logical :: is_prp
        integer :: level

        is_prp = step%kind == step_prp
        h1 = hanger_of(model, step%joint(1), step%link(1))
        h2 = hanger_of(model, step%joint(3), step%link(2))
        associate (plane => state%plane, map => state%plane%dyad(step%first))
            call turn_with_known(model, h1, plane)
            u1 = slide_axis(model, h1, plane)
            reach1 = hold_of(model, h1, plane) + (plane%rotation(h1%o).rotate.(inner_point(model, step, 1) - own_point(model, h1)))
            if (is_prp) then
                call turn_with_known(model, h2, plane)
                u2 = slide_axis(model, h2, plane)
                reach2 = hold_of(model, h2, plane) &
                         + (plane%rotation(h2%o).rotate.(inner_point(model, step, 2) - own_point(model, h2)))
                map = map_prp(u1, u2)
            else
                inner = hanger_of(model, step%joint(2), step%link(2))
                call turn_with_known(model, inner, plane)
                u2 = slide_axis(model, inner, plane)
                h2%hold = hold_of(model, h2, plane)
                reach2 = h2%hold - (plane%rotation(h2%o).rotate.(own_point(model, h2) - inner_point(model, step, 2)))
                map = map_ppr(u1, u2)
            end if
            call watch_dead_point(map, spread(.true., 1, lanes), state)
            gap = (plane%position(h2%known) + reach2) - (plane%position(h1%known) + reach1)
            call solve_dyad(map, gap, forward1, forward2)
            call place_on_slide(model, h1, forward1, state)
            if (is_prp) then
                call place_on_slide(model, h2, forward2, state)
                reach1 = reach1 + forward1*u1
                reach2 = reach2 + forward2*u2
            else
                call place_on_hinge(model, h2, plane)
                state%slide(:, 1, step%joint(2)) = inner%sense*forward2
                reach2 = h2%hold
                reach1 = plane%position(h2%known) + reach2 - plane%position(h1%known)
            end if
            do level = level_velocity, state%n_column
                gap = carried(plane, level, h2%known, h2%o_known, reach2) - carried(plane, level, h1%known, h1%o_known, reach1)
                if (level == level_given) then
                    if (is_prp) then
                        bias = bias_prp(u1, u2, plane%angular(:, level_velocity, h1%o_known), &
                                        plane%angular(:, level_velocity, h2%o_known), rate1, rate2)
                    else
                        bias = bias_ppr(u1, u2, plane%angular(:, level_velocity, h1%o_known), rate1, rate2)
                    end if
                    gap = gap + bias
                end if
                call solve_dyad(map, gap, rate1, rate2)
                if (level <= level_given) call keep_rates(step%first, level, rate1, rate2, plane)
                call move_link(h1, level, rate1, plane)
                if (is_prp) then
                    call move_link(h2, level, rate2, plane)
                else
                    call move_link(h2, level, plane%angular(:, level, h1%o_known), plane)
                end if
            end do
        end associate
    end subroutine close_slides

    !> The map of a dyad whose links were placed by another program of the same mechanism.
    pure function map_placed(model, step, plane) result(map)
        type(model_type), intent(in) :: model
        type(step_type), intent(in) :: step            !! the dyad
        type(planar_motion), intent(in) :: plane
        type(dyad_map) :: map
        type(hanger) :: h1, h2

        h1 = hanger_of(model, step%joint(1), step%link(1))
        h2 = hanger_of(model, step%joint(3), step%link(2))
        select case (step%kind)
        case (step_rrr)
            map = map_rrr(arm_of(h1, 1), arm_of(h2, 2))
        case (step_rrp)
            map = map_rrp(arm_of(h1, 1), slide_axis(model, h2, plane))
        case (step_rpr)
            map = map_rpr((plane%position(h2%known) + hold_of(model, h2, plane)) &
                          - (plane%position(h1%known) + hold_of(model, h1, plane)), &
                          plane%rotation(h1%o).rotate.model%joint(step%joint(2))%frame(:2, 3, 1))
        case (step_prp)
            map = map_prp(slide_axis(model, h1, plane), slide_axis(model, h2, plane))
        case default
            map = map_ppr(slide_axis(model, h1, plane), &
                          slide_axis(model, hanger_of(model, step%joint(2), step%link(2)), plane))
        end select

    contains

        !> From the hinge on a known link to the inner hinge.
        pure function arm_of(h, i) result(arm)
            type(hanger), intent(in) :: h
            integer, intent(in) :: i
            type(vec2) :: arm

            arm = plane%rotation(h%o).rotate.(inner_point(model, step, i) - own_point(model, h))
        end function arm_of
    end function map_placed

    !> The inner joint's marker on link 1 or 2 of the dyad, link axes.
    pure function inner_point(model, step, i) result(point)
        type(model_type), intent(in) :: model
        type(step_type), intent(in) :: step
        integer, intent(in) :: i
        real(wp) :: point(2)

        associate (inner => model%joint(step%joint(2)))
            point = inner%point(:2, side_of(inner, step%link(i)))
        end associate
    end function inner_point

    !> A vector in link axes resolved along and across a direction.
    pure function in_slide_axes(v, axis) result(c)
        real(wp), intent(in) :: v(2), axis(2)
        real(wp) :: c(2)

        c = [v(1)*axis(1) + v(2)*axis(2), axis(1)*v(2) - axis(2)*v(1)]
    end function in_slide_axes

    pure subroutine keep_rates(dyad, level, rate1, rate2, plane)
        integer, intent(in) :: dyad, level
        real(wp), intent(in) :: rate1(lanes), rate2(lanes)
        type(planar_motion), intent(inout) :: plane

        plane%rate(:, 1, level, dyad) = rate1
        plane%rate(:, 2, level, dyad) = rate2
    end subroutine keep_rates

    !> Relative uncertainty of the motion behind a dyad, and of forces.
    pure function uncertainty_of_dyad(model, step, plane) result(part)
        type(model_type), intent(in) :: model
        type(step_type), intent(in) :: step            !! the dyad
        type(planar_motion), intent(in) :: plane
        real(wp) :: part(lanes)
        real(wp) :: reach(lanes)

        associate (map => plane%dyad(step%first), rate => plane%rate(:, :, :, step%first))
            reach = huge(1.0_wp)
            if (any(step%kind == [step_rrr, step_rrp, step_rpr])) reach = sqrt(map%first.dot.map%first)
            if (step%kind == step_rrr) reach = min(reach, sqrt(map%second.dot.map%second))
            part = uncertainty_of_dyad_motion(map, reach, rate(:, 1, 1), rate(:, 2, 1), rate(:, 1, 2), rate(:, 2, 2))
        end associate
    end function uncertainty_of_dyad

    !> At a dead point itself rates are not determined.
    pure subroutine watch_dead_point(map, is_reachable, state)
        type(dyad_map), intent(in) :: map
        logical, intent(in) :: is_reachable(lanes)
        type(kinematic_state), intent(inout) :: state

        state%singular = state%singular .or. (is_reachable .and. map%determinant == 0)
    end subroutine watch_dead_point
end module linkdyn_planar_pass
