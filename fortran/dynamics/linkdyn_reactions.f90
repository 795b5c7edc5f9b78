!> From the solved unknowns to joint reactions: world axes, at the joint point (the second link's marker).
module linkdyn_reactions
    use linkdyn_assembly, only: column_direction
    use linkdyn_belt_measures, only: belt_wrench_on
    use linkdyn_formulation, only: formulation_type, wrench_column
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state
    use linkdyn_lane_count, only: lanes
    use linkdyn_model, only: model_type, holds_spin
    use linkdyn_vec2, only: vec2, operator(*), operator(.rotate.)
    use linkdyn_vec3, only: vec3, operator(+), operator(*), operator(.rotate.), zero_vec3, vec3_of
    implicit none (type, external)
    private
    public :: solution_type, collect_reactions, unknown

    !> Where the unknowns stand: unknown k is sign(k)*value(:, slot(k)); slot 0 is zero.
    type :: solution_type
        real(wp), pointer, contiguous :: value(:, :) => null()    !! (lane, slot)
        integer, allocatable :: slot(:)                           !! (n_unknown)
        real(wp), allocatable :: sign(:)                          !! (n_unknown)
    end type solution_type

contains

    !> One unknown on all lanes.
    pure function unknown(solution, k) result(x)
        type(solution_type), intent(in) :: solution
        integer, intent(in) :: k    !! 0: zero
        real(wp) :: x(lanes)
        integer :: slot

        slot = 0
        if (k > 0) slot = solution%slot(k)
        if (slot == 0) then
            x = 0
        else
            x = solution%sign(k)*solution%value(:, slot)
        end if
    end function unknown

    !> Reaction wrenches of all joints: what the first link exerts on the second, driving forces not included.
    subroutine collect_reactions(model, formulation, state, solution, reaction)
        type(model_type), intent(in) :: model
        type(formulation_type), intent(in) :: formulation
        type(kinematic_state), intent(in) :: state
        type(solution_type), intent(in) :: solution
        real(wp), intent(out) :: reaction(lanes, model%n_component, *)    !! Fx Fy Fz Mx My Mz, planar Fx Fy Mz [N, N m]
        type(vec3) :: total, point, force, moment
        integer :: i, j, half

        if (model%is_planar) then
            call collect_planar_reactions(model, formulation, state, solution, reaction)
            return
        end if
        do j = 1, model%n_joint
            do half = 1, 2
                associate (part => formulation%part(half, j))
                    total%x = unknown(solution, part%unit_column(1))
                    total%y = unknown(solution, part%unit_column(2))
                    total%z = unknown(solution, part%unit_column(3))
                    if (.not. part%is_plain) call add_slanted(formulation, solution, j, half == 2, total)
                    if (part%orientation > 0) total = state%rotation(part%orientation).rotate.total
                    ! what holds an idle spin takes no moment
                    if (part%normal_column > 0 .and. .not. holds_spin(model%joint(j))) &
                        total = total + unknown(solution, part%normal_column) &
                                *column_direction(model, formulation%column(part%normal_column), state)
                    if (part%couple_column > 0) total = total + unknown(solution, part%couple_column) &
                        *couple_of(formulation%column(part%couple_column), state)
                end associate
                reaction(:, 3*half - 2, j) = total%x
                reaction(:, 3*half - 1, j) = total%y
                reaction(:, 3*half, j) = total%z
            end do
        end do
        do i = 1, size(model%belt)
            call belt_wrench_on(model, i, 2, state, point, force, moment)
            j = model%belt(i)%gear%joint
            reaction(:, 1, j) = force%x
            reaction(:, 2, j) = force%y
            reaction(:, 3, j) = force%z
            reaction(:, 4, j) = moment%x
            reaction(:, 5, j) = moment%y
            reaction(:, 6, j) = moment%z
        end do
    end subroutine collect_reactions

    !> Moment that comes with a unit force, on the second link about its marker, world axes.
    pure function couple_of(column, state) result(couple)
        type(wrench_column), intent(in) :: column
        type(kinematic_state), intent(in) :: state
        type(vec3) :: couple

        couple = vec3_of(column%couple(:, 2))
        if (column%orientation > 0) couple = state%rotation(column%orientation).rotate.couple
    end function couple_of

    !> The same for a planar mechanism: Fx, Fy, Mz.
    subroutine collect_planar_reactions(model, formulation, state, solution, reaction)
        type(model_type), intent(in) :: model
        type(formulation_type), intent(in) :: formulation
        type(kinematic_state), intent(in) :: state
        type(solution_type), intent(in) :: solution
        real(wp), intent(out) :: reaction(lanes, 3, *)
        type(vec2) :: force
        type(vec3) :: total, point, pull, moment
        integer :: i, j

        do j = 1, model%n_joint
            associate (part => formulation%part(1, j))
                force = vec2(unknown(solution, part%unit_column(1)), unknown(solution, part%unit_column(2)))
                if (.not. part%is_plain) then
                    total = zero_vec3()
                    call add_slanted(formulation, solution, j, .false., total)
                    force = vec2(force%x + total%x, force%y + total%y)
                end if
                if (part%orientation > 0) force = state%plane%rotation(part%orientation).rotate.force
            end associate
            if (model%joint(j)%cam > 0) &
                force = unknown(solution, formulation%first_column(j) + 1)*state%plane%contact(model%joint(j)%cam)%normal
            reaction(:, 1, j) = force%x
            reaction(:, 2, j) = force%y
            associate (part => formulation%part(2, j))
                reaction(:, 3, j) = unknown(solution, part%unit_column(3))
                if (part%couple_column > 0) reaction(:, 3, j) = reaction(:, 3, j) &
                    + formulation%column(part%couple_column)%couple(3, 2)*unknown(solution, part%couple_column)
            end associate
            if (model%joint(j)%cam > 0) &
                reaction(:, 3, j) = unknown(solution, formulation%first_column(j) + 1)*state%plane%contact(model%joint(j)%cam)%arm
        end do
        do i = 1, size(model%belt)
            call belt_wrench_on(model, i, 2, state, point, pull, moment)
            j = model%belt(i)%gear%joint
            reaction(:, 1, j) = pull%x
            reaction(:, 2, j) = pull%y
            reaction(:, 3, j) = moment%z
        end do
    end subroutine collect_planar_reactions

    !> Unknowns along directions that are not axes of the link.
    subroutine add_slanted(formulation, solution, j, is_moment, total)
        type(formulation_type), intent(in) :: formulation
        type(solution_type), intent(in) :: solution
        integer, intent(in) :: j
        logical, intent(in) :: is_moment
        type(vec3), intent(inout) :: total
        real(wp) :: x(lanes)
        integer :: c

        do c = formulation%first_column(j) + 1, formulation%first_column(j + 1)
            associate (column => formulation%column(c))
                if ((column%is_moment .neqv. is_moment) .or. column%is_normal .or. column%unit_axis > 0) cycle
                x = unknown(solution, c)
                total%x = total%x + x*column%direction(1)
                total%y = total%y + x*column%direction(2)
                total%z = total%z + x*column%direction(3)
            end associate
        end do
    end subroutine add_slanted
end module linkdyn_reactions
