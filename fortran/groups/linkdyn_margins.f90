!> How far a closed form is from where its two assemblies meet, and how fast it gets there.
!>
!> The margin is the sine of the transmission angle, with a sign that tells the assemblies apart: of a planar dyad between
!> the two ways in which its inner joint moves, of the CSP group between the slide and the radius of the ball about the
!> coupler's axis, of a leg with a rod between this and the way of its end; of three rods on which a platform hangs the
!> volume between them, see `linkdyn_hung_platform`; of those that hold its attitude see `linkdyn_parallel_rods`. Who integrates
!> a motion judges by it whether a step may have left an assembly.
module linkdyn_margins
    use linkdyn_bodies, only: world_axes, omega_of, point_velocity
    use linkdyn_csp_group, only: csp_lines
    use linkdyn_dyads, only: half_type, half_of, inner_marker, drawn_arm
    use linkdyn_hung_platform, only: margin_of_hanging
    use linkdyn_joint_table, only: joint_prismatic
    use linkdyn_mechanism, only: mechanism_type, marker_point
    use linkdyn_model, only: step_type, step_rrr, step_rrp, step_rpr, step_prp, step_csp, step_rus, step_pus, step_rod, step_hung, &
        side_of
    use linkdyn_parallel_rods, only: margin_of_hold
    use linkdyn_rod_margin, only: margin_of_rod
    use linkdyn_value, only: value, zero, one, operator(+), operator(-), operator(*), reciprocal
    use linkdyn_vector, only: vector, operator(-), operator(*), operator(.dot.), operator(.cross.)
    implicit none (type, external)
    private
    public :: assembly_margins

contains

    !> Margins of all closed forms that have two assemblies, and their rates; of others one and zero. Links are placed and
    !> move.
    subroutine assembly_margins(mechanism, margin, drift)
        type(mechanism_type), intent(in) :: mechanism
        type(value), intent(out) :: margin(:), drift(:)    !! (n_branch) [1], [1/s]
        integer :: i

        margin = one()
        drift = zero()
        do i = 1, size(mechanism%model%step)
            associate (step => mechanism%model%step(i), k => mechanism%model%step(i)%first)
                select case (step%kind)
                case (step_rrr, step_rrp, step_prp)
                    call margin_of_turning(mechanism, step, margin(k), drift(k))
                case (step_rpr)
                    call margin_of_pair(mechanism, step, margin(k), drift(k))
                case (step_csp)
                    call margin_of_csp(mechanism, step, margin(k), drift(k))
                case (step_rus, step_pus)
                    call margin_of_rod(mechanism, step, margin(k), drift(k))
                case (step_hung)
                    call margin_of_hanging(mechanism, step, margin(k), drift(k))
                case (step_rod)
                    if (step%has_margin) call margin_of_hold(mechanism, step, margin(k), drift(k))
                end select
            end associate
        end do
    end subroutine assembly_margins

    !> Each way turns with its link; where a slide inside the dyad draws a link out, with the line between the outer and the inner
    !> hinge.
    subroutine margin_of_turning(mechanism, step, margin, drift)
        type(mechanism_type), intent(in) :: mechanism
        type(step_type), intent(in) :: step
        type(value), intent(out) :: margin, drift
        type(vector) :: normal
        type(value) :: per_lengths

        associate (way => mechanism%ways(:, step%first))
            per_lengths = per_lengths_of(mechanism, step)
            normal = way(1) .cross.way(2)
            margin = per_lengths*normal%z
            drift = per_lengths*((turn_of_way(mechanism, step, 2) - turn_of_way(mechanism, step, 1))*(way(1) .dot.way(2)))
        end associate
    end subroutine margin_of_turning

    !> How fast a way turns.
    function turn_of_way(mechanism, step, i) result(turn)
        type(mechanism_type), intent(in) :: mechanism
        type(step_type), intent(in) :: step
        integer, intent(in) :: i
        type(value) :: turn
        type(half_type) :: half
        type(vector) :: omega, arm, rate, normal

        half = half_of(mechanism, step, i)
        omega = omega_of(mechanism%bodies, half%link, world_axes)
        turn = omega%z
        if (half%led == 0 .or. mechanism%model%joint(half%outer)%kind == joint_prismatic) return
        arm = drawn_arm(mechanism, half)
        rate = point_velocity(mechanism%bodies, half%tip, inner_marker(mechanism, half)) &
               - point_velocity(mechanism%bodies, half%link, marker_point(mechanism, half%outer, half%side))
        normal = arm.cross.rate
        turn = normal%z*reciprocal(arm.dot.arm)
    end function turn_of_way

    !> Margin of a pair of sliding links between two hinges, A and B: the first way is the line AB turned left, the second, along
    !> the slide, turns with the pair. The sine is that of the slide's length; how the line's own length changes is left out, as it
    !> does not turn anything.
    subroutine margin_of_pair(mechanism, step, margin, drift)
        type(mechanism_type), intent(in) :: mechanism
        type(step_type), intent(in) :: step
        type(value), intent(out) :: margin, drift
        type(vector) :: omega, normal, line_rate
        type(value) :: per_lengths

        associate (way => mechanism%ways(:, step%first))
            per_lengths = per_lengths_of(mechanism, step)
            normal = way(1) .cross.way(2)
            omega = omega_of(mechanism%bodies, step%link(1), world_axes)
            line_rate = hinge_velocity(2) - hinge_velocity(1)
            margin = -(per_lengths*normal%z)
            drift = per_lengths*((line_rate.dot.way(2)) - omega%z*(way(1) .dot.way(2)))
        end associate

    contains

        function hinge_velocity(half) result(v)
            integer, intent(in) :: half
            type(vector) :: v
            integer :: joint

            joint = step%joint(2*half - 1)
            v = point_velocity(mechanism%bodies, step%link(half), &
                               marker_point(mechanism, joint, side_of(mechanism%model%joint(joint), step%link(half))))
        end function hinge_velocity
    end subroutine margin_of_pair

    !> The radius of the ball about the coupler's axis turns with the coupler, the slide's direction with the output.
    subroutine margin_of_csp(mechanism, step, margin, drift)
        type(mechanism_type), intent(in) :: mechanism
        type(step_type), intent(in) :: step
        type(value), intent(out) :: margin, drift
        type(vector) :: axis, radius, slide, omega
        type(value) :: length, per_radius

        call csp_lines(mechanism, step, axis, radius, length, slide)
        per_radius = reciprocal(length)
        omega = omega_of(mechanism%bodies, step%link(1), world_axes) - omega_of(mechanism%bodies, step%link(2), world_axes)
        margin = per_radius*(radius.dot.slide)
        drift = per_radius*(omega.dot.(radius.cross.slide))
    end subroutine margin_of_csp

    !> One over the product of the lengths of both ways.
    function per_lengths_of(mechanism, step) result(per)
        type(mechanism_type), intent(in) :: mechanism
        type(step_type), intent(in) :: step
        type(value) :: per

        associate (length => mechanism%way_length(:, step%first))
            per = reciprocal(length(1)*length(2))
        end associate
    end function per_lengths_of
end module linkdyn_margins
