!> Joint variables and rates of a planar mechanism.
module linkdyn_planar_rates
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state
    use linkdyn_lane_count, only: lanes
    use linkdyn_model, only: model_type, orientation_of
    use linkdyn_planar_motion, only: level_velocity
    use linkdyn_planar_point, only: carried
    use linkdyn_scene, only: joint_prismatic, joint_n_variable
    use linkdyn_vec2, only: vec2, operator(+), operator(-), operator(.dot.), operator(.cross.), operator(.rotate.)
    implicit none (type, external)
    private
    public :: measure_planar_joints, measure_planar_variable, planar_joint_rate

contains

    !> All joint variables and rates: angles in (-pi, pi].
    subroutine measure_planar_joints(model, state, variable, rate)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        real(wp), intent(out) :: variable(lanes, *), rate(lanes, *)    !! (lane, n_variable) [m, rad]
        integer :: j, k

        do j = 1, model%n_joint
            if (joint_n_variable(model%joint(j)%told_kind) == 0) cycle
            k = model%joint(j)%first_variable + 1
            call measure_planar_variable(model, state, j, variable(:, k), rate(:, k))
        end do
    end subroutine measure_planar_joints

    !> One joint variable and its rate.
    pure subroutine measure_planar_variable(model, state, j, variable, rate)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        integer, intent(in) :: j
        real(wp), intent(out) :: variable(lanes), rate(lanes)
        type(vec2) :: x(2), gap
        integer :: side

        rate = planar_joint_rate(model, state, j, level_velocity)
        if (model%joint(j)%kind == joint_prismatic) then
            variable = state%slide(:, 1, j)
            return
        else if (model%joint(j)%told_kind == joint_prismatic) then
            call find_slide(model, state, j, x(1), gap)
            variable = x(1).dot.gap
            return
        end if
        do side = 1, 2
            x(side) = state%plane%rotation(orientation_of(model, model%joint(j)%link(side))) &
                      .rotate.model%joint(j)%told_frame(:2, 1, side)
        end do
        variable = atan2(x(1).cross.x(2), x(1).dot.x(2))
    end subroutine measure_planar_variable

    !> The direction of a slide, and what lies between its markers.
    pure subroutine find_slide(model, state, j, direction, gap)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        integer, intent(in) :: j
        type(vec2), intent(out) :: direction, gap
        type(vec2) :: point(2)
        integer :: side, o

        associate (joint => model%joint(j), plane => state%plane)
            do side = 2, 1, -1
                o = orientation_of(model, joint%link(side))
                point(side) = plane%position(joint%link(side)) + (plane%rotation(o).rotate.joint%point(:2, side))
            end do
            direction = plane%rotation(o).rotate.joint%told_frame(:2, 3, 1)
        end associate
        gap = point(2) - point(1)
    end subroutine find_slide

    !> Rate of a joint's variable; at level k for a unit rate of coordinate k; at the level of what is given its
    !> acceleration (that of Coriolis is square to a slide).
    pure function planar_joint_rate(model, state, j, level) result(rate)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        integer, intent(in) :: j
        integer, intent(in) :: level      !! the velocity, what is given, or a column
        real(wp) :: rate(lanes)
        type(vec2) :: arm(2), gap
        integer :: side, o(2)

        associate (joint => model%joint(j), plane => state%plane)
            o = [orientation_of(model, joint%link(1)), orientation_of(model, joint%link(2))]
            if (joint%told_kind /= joint_prismatic) then
                rate = plane%angular(:, level, o(2)) - plane%angular(:, level, o(1))
                return
            end if
            do side = 1, 2
                arm(side) = plane%rotation(o(side)).rotate.joint%point(:2, side)
            end do
            ! The first link is felt at the second's marker.
            gap = plane%position(joint%link(2)) + arm(2) - plane%position(joint%link(1))
            rate = (carried(plane, level, joint%link(2), o(2), arm(2)) - carried(plane, level, joint%link(1), o(1), gap)) &
                   .dot.(plane%rotation(o(1)).rotate.joint%told_frame(:2, 3, 1))
        end associate
    end function planar_joint_rate
end module linkdyn_planar_rates
