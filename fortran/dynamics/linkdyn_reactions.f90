!> From the solved unknowns to joint reactions: world axes, at the joint point (the second link's marker).
module linkdyn_reactions
    use linkdyn_assembly, only: column_direction
    use linkdyn_formulation, only: formulation_type
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state
    use linkdyn_lane_count, only: lanes
    use linkdyn_model, only: model_type
    use linkdyn_vec3, only: vec3, operator(+), operator(*), operator(.rotate.), zero_vec3
    implicit none (type, external)
    private
    public :: collect_reactions

contains

    !> Reaction wrenches of all joints: what the first link exerts on the second, driving forces not included.
    subroutine collect_reactions(model, formulation, state, solution, reaction)
        type(model_type), intent(in) :: model
        type(formulation_type), intent(in) :: formulation
        type(kinematic_state), intent(in) :: state
        real(wp), intent(in) :: solution(lanes, *)        !! unknowns in the order of the columns
        real(wp), intent(out) :: reaction(lanes, 6, *)    !! Fx Fy Fz Mx My Mz of each joint [N, N m]
        type(vec3) :: force, moment
        integer :: j

        do j = 1, model%n_joint
            call joint_part(formulation, state, j, .false., solution, model, force)
            call joint_part(formulation, state, j, .true., solution, model, moment)
            reaction(:, 1, j) = force%x
            reaction(:, 2, j) = force%y
            reaction(:, 3, j) = force%z
            reaction(:, 4, j) = moment%x
            reaction(:, 5, j) = moment%y
            reaction(:, 6, j) = moment%z
        end do
    end subroutine collect_reactions

    !> Sum of the forces (or of the moments) of one joint. Directions fixed in one link are summed in its axes and
    !> turned once.
    subroutine joint_part(formulation, state, j, is_moment, solution, model, total)
        type(formulation_type), intent(in) :: formulation
        type(kinematic_state), intent(in) :: state
        integer, intent(in) :: j
        logical, intent(in) :: is_moment
        real(wp), intent(in) :: solution(lanes, *)
        type(model_type), intent(in) :: model
        type(vec3), intent(out) :: total
        type(vec3) :: normal_part
        integer :: c, orientation
        logical :: has_normal

        total = zero_vec3()
        orientation = 0
        has_normal = .false.
        do c = formulation%first_column(j) + 1, formulation%first_column(j + 1)
            associate (column => formulation%column(c))
                if (column%is_moment .neqv. is_moment) cycle
                if (column%is_normal) then
                    normal_part = solution(:, c)*column_direction(model, column, state)
                    has_normal = .true.
                    cycle
                end if
                orientation = column%orientation
                select case (column%unit_axis)
                case (1)
                    total%x = total%x + solution(:, c)
                case (2)
                    total%y = total%y + solution(:, c)
                case (3)
                    total%z = total%z + solution(:, c)
                case default
                    total%x = total%x + solution(:, c)*column%direction(1)
                    total%y = total%y + solution(:, c)*column%direction(2)
                    total%z = total%z + solution(:, c)*column%direction(3)
                end select
            end associate
        end do
        if (orientation > 0) total = state%rotation(orientation).rotate.total
        if (has_normal) total = total + normal_part
    end subroutine joint_part
end module linkdyn_reactions
