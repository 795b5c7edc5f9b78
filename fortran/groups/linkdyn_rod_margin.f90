!> How far a leg of crank or carriage and rod is from where its two assemblies meet, and how many digits its motion keeps there: by
!> the sine at which the rod stands on the way of its end. Links are placed; see `linkdyn_rod_leg`.
module linkdyn_rod_margin
    use linkdyn_bodies, only: world_axes, omega_of, alpha_of, point_position, rotation_of
    use linkdyn_joint_variables, only: variable_rate, variable_acceleration
    use linkdyn_mechanism, only: mechanism_type, marker_point, marker_frame
    use linkdyn_model, only: step_type
    use linkdyn_rod_leg, only: rod_leg_type, rod_leg_of
    use linkdyn_value, only: value, zero, operator(+), operator(-), operator(*), sqrt, reciprocal, abs, min, max
    use linkdyn_vector, only: vector, rotation, zero_vector, operator(+), operator(-), operator(*), operator(.dot.), &
        operator(.cross.), operator(.rotate.)
    implicit none (type, external)
    private
    public :: margin_of_rod, quality_of_rod

contains

    !> The sine, with the sign of the branch, and its rate: the way turns with the lead, the rod with itself.
    subroutine margin_of_rod(mechanism, step, margin, drift)
        type(mechanism_type), intent(in) :: mechanism
        type(step_type), intent(in) :: step
        type(value), intent(out) :: margin, drift
        type(rod_leg_type) :: leg
        type(vector) :: rod, way, omega
        type(value) :: per_lengths

        leg = rod_leg_of(mechanism, step)
        rod = rod_as_placed(mechanism, leg)
        way = way_as_placed(mechanism, leg)
        per_lengths = reciprocal(sqrt((rod.dot.rod)*(way.dot.way)))
        omega = omega_of(mechanism%bodies, leg%lead, world_axes) - omega_of(mechanism%bodies, leg%rod, world_axes)
        margin = -(per_lengths*(rod.dot.way))
        drift = -(per_lengths*(omega.dot.(way.cross.rod)))
    end subroutine margin_of_rod

    !> Sine, reach, speed, gap, acceleration, gap of accelerations, as `uncertainty_of_motion` takes them. A rod that comes to lie
    !> along the first axis of its universal joint is as uncertain as one that lies across the way of its end.
    function quality_of_rod(mechanism, step) result(q)
        type(mechanism_type), intent(in) :: mechanism
        type(step_type), intent(in) :: step
        type(value) :: q(6)
        type(rod_leg_type) :: leg
        type(rotation) :: frame
        type(vector) :: rod, way, across
        type(value) :: length, way_length, rate, rate_2

        leg = rod_leg_of(mechanism, step)
        rod = rod_as_placed(mechanism, leg)
        length = sqrt(rod.dot.rod)
        frame = marker_frame(mechanism, leg%universal, leg%holder_side)
        across = rod.cross.(rotation_of(mechanism%bodies, leg%holder) .rotate.frame%z)
        q(1) = sqrt(across.dot.across)*reciprocal(length)
        q(2) = length
        way = zero_vector()
        rate = zero()
        rate_2 = zero()
        if (leg%first > 0) call look_at_lead()
        call look(rate*way, omega_of(mechanism%bodies, leg%rod, world_axes) .cross.rod, q(3), q(4))
        call look(rate_2*way, alpha_of(mechanism%bodies, leg%rod, world_axes) .cross.rod, q(5), q(6))

    contains

        !> That is not known.
        subroutine look_at_lead()
            way = way_as_placed(mechanism, leg)
            way_length = sqrt(way.dot.way)
            rate = variable_rate(mechanism, leg%first, 1)
            rate_2 = variable_acceleration(mechanism, leg%first, 1)
            if (leg%first_side == 1) then
                rate = -rate
                rate_2 = -rate_2
            end if
            q(1) = min(abs(rod.dot.way)*reciprocal(length*way_length), q(1))
            if (leg%turns) q(2) = min(length, way_length)
        end subroutine look_at_lead

        !> The larger of what lead and rod do, and what both leave of each other: the motion of the known links.
        subroutine look(of_lead, of_rod, largest, gap)
            type(vector), intent(in) :: of_lead, of_rod
            type(value), intent(out) :: largest, gap
            type(vector) :: both

            both = of_lead + of_rod
            largest = sqrt(max(of_lead.dot.of_lead, of_rod.dot.of_rod))
            gap = sqrt(both.dot.both)
        end subroutine look
    end function quality_of_rod

    !> From the lead to the top, world axes.
    function rod_as_placed(mechanism, leg) result(rod)
        type(mechanism_type), intent(in) :: mechanism
        type(rod_leg_type), intent(in) :: leg
        type(vector) :: rod

        rod = point_position(mechanism%bodies, leg%top, marker_point(mechanism, leg%outer, 3 - leg%outer_side)) &
              - point_position(mechanism%bodies, leg%lead, marker_point(mechanism, leg%inner, leg%inner_side))
    end function rod_as_placed

    !> How the lead's end of the rod goes by a unit of angle or slide, world axes.
    function way_as_placed(mechanism, leg) result(way)
        type(mechanism_type), intent(in) :: mechanism
        type(rod_leg_type), intent(in) :: leg
        type(vector) :: way
        type(rotation) :: frame

        frame = marker_frame(mechanism, leg%first, leg%first_side)
        way = frame%z
        if (leg%turns) way = frame%z.cross.(marker_point(mechanism, leg%inner, leg%inner_side) &
                                            - marker_point(mechanism, leg%first, leg%first_side))
        way = rotation_of(mechanism%bodies, leg%lead) .rotate.way
    end function way_as_placed
end module linkdyn_rod_margin
