!> What decides how many digits the motion behind a closed form has: how its two links close the gap between them, of velocities and
!> of accelerations. See `linkdyn_uncertainty`.
module linkdyn_certainty
    use linkdyn_bodies, only: world_axes, omega_of, alpha_of
    use linkdyn_csp_group, only: csp_lines
    use linkdyn_dyads, only: half_type, half_of
    use linkdyn_hung_platform, only: quality_of_hanging
    use linkdyn_joint_variables, only: variable_rate, variable_acceleration
    use linkdyn_kinds, only: wp
    use linkdyn_mechanism, only: mechanism_type
    use linkdyn_model, only: step_type, step_rrr, step_rrp, step_rpr, step_prp, step_ppr, step_csp, step_hung, side_of, &
        has_rod, is_rod_leg
    use linkdyn_parallel_rods, only: margin_of_hold
    use linkdyn_rod_margin, only: quality_of_rod
    use linkdyn_value, only: value, constant, operator(+), operator(-), operator(*), sqrt, abs, max, min, reciprocal
    use linkdyn_vector, only: vector, operator(-), operator(*), operator(.dot.), operator(.cross.)
    implicit none (type, external)
    private
    public :: closing_quality

    integer, parameter :: n_quality = 6        !! sine, reach, speed, gap, acceleration, gap of accelerations

    real(wp), parameter :: endless = huge(1.0_wp)    !! reach of slides

contains

    !> In the order of `uncertainty_of_motion`. Links are placed and move; of a dyad its ways are found.
    function closing_quality(mechanism, step) result(q)
        type(mechanism_type), intent(in) :: mechanism
        type(step_type), intent(in) :: step
        type(value) :: q(n_quality)
        type(vector) :: way(2), normal, n, y, u
        type(value) :: rate(2), rate2(2), length(2), radius, hold, drift

        if (has_rod(step%kind)) then
            q = quality_of_rod(mechanism, step)
            if (step%has_margin .and. .not. is_rod_leg(step%kind)) then
                call margin_of_hold(mechanism, step, hold, drift)
                q(1) = min(q(1), abs(hold))
            end if
            return
        else if (step%kind == step_hung) then
            q = quality_of_hanging(mechanism, step)
            return
        else if (step%kind == step_csp) then
            ! The ball moves about the coupler's axis and along the slide; what counts is what lies across the axis.
            call csp_lines(mechanism, step, u, n, radius, y)
            way = [u.cross.n, y - (y.dot.u)*u]
            length = [radius, constant(1.0_wp)]
            q(1) = abs(n.dot.y)*reciprocal(radius)
            q(2) = radius
        else
            way = mechanism%ways(:, step%first)
            length = mechanism%way_length(:, step%first)
            normal = way(1) .cross.way(2)
            q(1) = abs(normal%z)*reciprocal(length(1)*length(2))
            q(2) = constant(endless)
            if (any(step%kind == [step_rrr, step_rrp, step_rpr])) q(2) = length(1)
            if (step%kind == step_rrr) q(2) = min(length(1), length(2))
        end if
        rate = rates_along(mechanism, step, .false.)
        rate2 = rates_along(mechanism, step, .true.)
        q(3) = largest(rate)
        q(4) = gap_of(rate)
        q(5) = largest(rate2)
        q(6) = gap_of(rate2)

    contains

        function largest(rate) result(speed)
            type(value), intent(in) :: rate(2)
            type(value) :: speed

            speed = max(abs(rate(1))*length(1), abs(rate(2))*length(2))
        end function largest

        !> What both leave of each other: the motion of the known links between which they are.
        function gap_of(rate) result(gap)
            type(value), intent(in) :: rate(2)
            type(value) :: gap
            type(vector) :: v

            v = rate(1)*way(1) - rate(2)*way(2)
            gap = sqrt(v.dot.v)
        end function gap_of
    end function closing_quality

    !> How fast both links go their ways.
    function rates_along(mechanism, step, is_second) result(rate)
        type(mechanism_type), intent(in) :: mechanism
        type(step_type), intent(in) :: step
        logical, intent(in) :: is_second           !! their accelerations
        type(value) :: rate(2)

        select case (step%kind)
        case (step_rrr)
            rate = [turn_of(1), turn_of(2)]
        case (step_rrp)
            rate = [turn_of(1), variable_of(3, 1, step%link(2))]
        case (step_rpr)
            rate = [turn_of(1), -variable_of(2, 1, inner_link())]
        case (step_prp)
            rate = [variable_of(1, 1, step%link(1)), variable_of(3, 1, step%link(2))]
        case (step_ppr)
            rate = [variable_of(1, 1, step%link(1)), -variable_of(2, 1, inner_link())]
        case (step_csp)
            rate = [variable_of(1, 1, step%link(1)), variable_of(3, 1, step%link(2))]
        end select

    contains

        !> Link of the dyad's second half, at the inner joint.
        integer function inner_link() result(link)
            type(half_type) :: half

            half = half_of(mechanism, step, 2)
            link = half%tip
        end function inner_link

        function turn_of(i) result(turn)
            integer, intent(in) :: i
            type(value) :: turn
            type(vector) :: v

            v = omega_of(mechanism%bodies, step%link(i), world_axes)
            if (is_second) v = alpha_of(mechanism%bodies, step%link(i), world_axes)
            turn = v%z
        end function turn_of

        !> Sign of a joint's variable, as it grows while the link moves and the other one stands.
        function variable_of(i, variable, link) result(v)
            integer, intent(in) :: i, variable, link
            type(value) :: v

            associate (j => step%joint(i))
                if (is_second) then
                    v = variable_acceleration(mechanism, j, variable)
                else
                    v = variable_rate(mechanism, j, variable)
                end if
                if (side_of(mechanism%model%joint(j), link) == 1) v = -v
            end associate
        end function variable_of
    end function rates_along
end module linkdyn_certainty
