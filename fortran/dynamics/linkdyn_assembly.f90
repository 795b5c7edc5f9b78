!> The one assembler: values of the varying matrix entries and of the right-hand sides, for any scene and style.
!>
!> Equations of link l, in the axes and about the point of the formulation:
!>     sum of joint wrenches (unknown) = inertia wrench - gravity - external loads (known).
module linkdyn_assembly
    use linkdyn_formulation, only: formulation_type, wrench_column, incidence_type, entry_group
    use linkdyn_joint_motion, only: turn_frame
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state
    use linkdyn_lane_count, only: lanes
    use linkdyn_model, only: model_type
    use linkdyn_newton_euler, only: inertia_wrench
    use linkdyn_payload_forces, only: add_payload_wrench
    use linkdyn_planar_assembly, only: assemble_planar_matrix, assemble_planar_right
    use linkdyn_scene, only: axes_link
    use linkdyn_vec3, only: vec3, mat3, operator(+), operator(-), operator(*), operator(.cross.), &
        operator(.rotate.), operator(.unrotate.), vec3_of, zero_vec3
    implicit none (type, external)
    private
    public :: assemble_matrix, assemble_right, column_direction, link_wrench, subtract_applied

contains

    ! ---------------------------------------------------------------- matrix

    !> Fill slots 1..n_slot with the varying entries.
    subroutine assemble_matrix(model, formulation, state, slot)
        type(model_type), intent(in) :: model
        type(formulation_type), intent(in) :: formulation
        type(kinematic_state), intent(in) :: state
        real(wp), intent(inout) :: slot(lanes, *)
        type(vec3) :: arm, direction, moment
        integer :: i, k, g, o

        if (model%is_planar) then
            call assemble_planar_matrix(model, formulation, state, slot)
            return
        end if
        do i = 1, size(formulation%incidence)
            associate (incidence => formulation%incidence(i))
                if (.not. incidence%varies) cycle
                o = model%link(incidence%link)%orientation
                if (incidence%needs_arm) then
                    arm = vec3_of(incidence%arm)
                    do k = 1, incidence%n_slide
                        arm = arm + state%slide(:, k, incidence%joint)*vec3_of(incidence%arm_slide(:, k))
                    end do
                    if (.not. formulation%row_in_link(incidence%link)) arm = state%rotation(o).rotate.arm
                end if
                do g = 1, size(incidence%group)
                    associate (group => incidence%group(g))
                        if (group%slides) &
                            call put_slides(group, incidence%n_slide, state%slide(:, :, incidence%joint), slot)
                        if (.not. group%needs_direction) cycle
                        direction = direction_in_rows(model, formulation, incidence, &
                                                      formulation%column(group%column), state)
                        if (incidence%sign < 0) direction = -direction
                        call put(group%force_slot, direction, slot)
                        if (.not. group%needs_arm) cycle
                        moment = arm.cross.direction
                        if (any(formulation%column(group%column)%couple /= 0)) moment = moment &
                            + incidence%sign*couple_in_rows(model, formulation, incidence, formulation%column(group%column), state)
                        call put(group%moment_slot, moment, slot)
                    end associate
                end do
            end associate
        end do
    end subroutine assemble_matrix

    !> Direction of an unknown in the axes of a link's equations.
    pure function direction_in_rows(model, formulation, incidence, column, state) result(direction)
        type(model_type), intent(in) :: model
        type(formulation_type), intent(in) :: formulation
        type(incidence_type), intent(in) :: incidence
        type(wrench_column), intent(in) :: column
        type(kinematic_state), intent(in) :: state
        type(vec3) :: direction, axis

        if (.not. formulation%row_in_link(incidence%link)) then
            direction = column_direction(model, column, state)
            return
        end if
        associate (r => state%rotation(model%link(incidence%link)%orientation), joint => model%joint(incidence%joint))
            if (.not. column%is_normal) then
                direction = r.unrotate.column_direction(model, column, state)
            else if (incidence%link == joint%link(2)) then
                ! The link's own axis is fixed in it: only the other one need be turned.
                axis = r.unrotate.universal_axis(model, incidence%joint, 1, state)
                direction = axis.cross.joint%frame(:, 3, 2)
            else
                axis = r.unrotate.universal_axis(model, incidence%joint, 2, state)
                direction = -(axis.cross.joint%frame(:, 3, 1))
            end if
        end associate
    end function direction_in_rows

    !> Moment that comes with a unit force about the link's own marker, in the axes of its equations; on the second link.
    pure function couple_in_rows(model, formulation, incidence, column, state) result(couple)
        type(model_type), intent(in) :: model
        type(formulation_type), intent(in) :: formulation
        type(incidence_type), intent(in) :: incidence
        type(wrench_column), intent(in) :: column
        type(kinematic_state), intent(in) :: state
        type(vec3) :: couple

        couple = vec3_of(column%couple(:, merge(1, 2, incidence%sign < 0)))
        if (column%orientation > 0) couple = state%rotation(column%orientation).rotate.couple
        if (formulation%row_in_link(incidence%link)) &
            couple = state%rotation(model%link(incidence%link)%orientation).unrotate.couple
    end function couple_in_rows

    !> Direction of an unknown in world axes.
    pure function column_direction(model, column, state) result(direction)
        type(model_type), intent(in) :: model
        type(wrench_column), intent(in) :: column
        type(kinematic_state), intent(in) :: state
        type(vec3) :: direction

        if (column%is_normal) then
            direction = universal_normal(model, column%joint, state)
        else if (column%orientation == 0) then
            direction = vec3_of(column%direction)
        else
            associate (r => state%rotation(column%orientation))
                select case (column%unit_axis)
                case (1)
                    direction = r%x
                case (2)
                    direction = r%y
                case (3)
                    direction = r%z
                case default
                    direction = r.rotate.column%direction
                end select
            end associate
        end if
    end function column_direction

    !> Square to both axes of a universal joint: the axis of the moment it transmits.
    pure function universal_normal(model, j, state) result(normal)
        type(model_type), intent(in) :: model
        integer, intent(in) :: j
        type(kinematic_state), intent(in) :: state
        type(vec3) :: normal

        normal = universal_axis(model, j, 1, state).cross.universal_axis(model, j, 2, state)
    end function universal_normal

    !> Axis of a joint on its first or second link, world axes.
    pure function universal_axis(model, j, side, state) result(axis)
        type(model_type), intent(in) :: model
        integer, intent(in) :: j, side
        type(kinematic_state), intent(in) :: state
        type(vec3) :: axis

        associate (joint => model%joint(j))
            if (joint%link(side) == 0) then
                axis = vec3_of(joint%frame(:, 3, side))
            else
                axis = state%rotation(model%link(joint%link(side))%orientation).rotate.joint%frame(:, 3, side)
            end if
        end associate
    end function universal_axis

    pure subroutine put(where_to, v, slot)
        integer, intent(in) :: where_to(3)
        type(vec3), intent(in) :: v
        real(wp), intent(inout) :: slot(lanes, *)

        if (where_to(1) > 0) slot(:, where_to(1)) = v%x
        if (where_to(2) > 0) slot(:, where_to(2)) = v%y
        if (where_to(3) > 0) slot(:, where_to(3)) = v%z
    end subroutine put

    pure subroutine put_slides(group, n, slide, slot)
        type(entry_group), intent(in) :: group
        integer, intent(in) :: n                      !! slides of the joint
        real(wp), intent(in) :: slide(:, :)           !! (lane, slide) [m]
        real(wp), intent(inout) :: slot(lanes, *)
        integer :: k, i

        do k = 1, 3
            if (group%slide_slot(k) == 0) cycle
            associate (entry => slot(:, group%slide_slot(k)))
                entry = group%slide_fixed(k) + slide(:, 1)*group%slide_rate(k, 1)
                do i = 2, n
                    entry = entry + slide(:, i)*group%slide_rate(k, i)
                end do
            end associate
        end do
    end subroutine put_slides

    ! ---------------------------------------------------------------- right-hand side

    !> Fill the right-hand sides: slot(:, first + row) for every row that is not zero by rule.
    subroutine assemble_right(model, formulation, state, load, first, slot)
        type(model_type), intent(in) :: model
        type(formulation_type), intent(in) :: formulation
        type(kinematic_state), intent(in) :: state
        real(wp), intent(in) :: load(:, :, :)         !! (lane, 6, n_load): force and moment, axes as in the scene [N, N m]
        integer, intent(in) :: first
        real(wp), intent(inout) :: slot(lanes, *)
        type(vec3) :: force, moment
        integer :: l, row, o

        if (model%is_planar) then
            call assemble_planar_right(model, formulation, state, load, first, slot)
            return
        end if
        do l = 1, model%n_link
            if (.not. formulation%has_right(l)) cycle
            call link_wrench(model, l, formulation%moment_point(:, l), state, load, force, moment)
            if (.not. formulation%row_in_link(l)) then
                o = model%link(l)%orientation
                force = state%rotation(o).rotate.force
                moment = state%rotation(o).rotate.moment
            end if
            row = first + 6*(l - 1)
            slot(:, row + 1) = force%x
            slot(:, row + 2) = force%y
            slot(:, row + 3) = force%z
            slot(:, row + 4) = moment%x
            slot(:, row + 5) = moment%y
            slot(:, row + 6) = moment%z
        end do
    end subroutine assemble_right

    !> What the joints must supply to a link: inertia less gravity less loads, link axes, about `point`.
    subroutine link_wrench(model, l, point, state, load, force, moment)
        type(model_type), intent(in) :: model
        integer, intent(in) :: l
        real(wp), intent(in) :: point(3)
        type(kinematic_state), intent(in) :: state
        real(wp), intent(in) :: load(:, :, :)
        type(vec3), intent(out) :: force, moment
        integer :: o

        o = model%link(l)%orientation
        if (model%link(l)%is_massless) then
            force = zero_vec3()
            moment = force
        else
            call inertia_wrench(model%link(l), point, state%acceleration_body(0, l) - state%gravity_body(o), &
                                state%omega_body(o), state%alpha_body(0, o), force, moment)
        end if
        if (size(model%payload) > 0) call add_payload_wrench(model, l, point, state, force, moment)
        call subtract_applied(model, l, point, state, load, force, moment)
    end subroutine link_wrench

    !> Take off what acts on a link besides joints and gravity: loads, springs, given driving forces.
    subroutine subtract_applied(model, l, point, state, load, force, moment)
        type(model_type), intent(in) :: model
        integer, intent(in) :: l
        real(wp), intent(in) :: point(3)
        type(kinematic_state), intent(in) :: state
        real(wp), intent(in) :: load(:, :, :)
        type(vec3), intent(inout) :: force, moment
        integer :: i

        do i = 1, model%n_load
            if (model%scene%load(i)%link == l) &
                call subtract_load(model, i, point, state%rotation(model%link(l)%orientation), load, force, moment)
        end do
        if (.not. state%has_applied) return
        force = force - state%applied_force(l)
        moment = moment - state%applied_moment(l)
        if (any(point /= 0)) moment = moment - (state%applied_force(l).cross.point)
    end subroutine subtract_applied

    subroutine subtract_load(model, i, point, rotation, load, force, moment)
        type(model_type), intent(in) :: model
        integer, intent(in) :: i
        real(wp), intent(in) :: point(3)
        type(mat3), intent(in) :: rotation
        real(wp), intent(in) :: load(:, :, :)
        type(vec3), intent(inout) :: force, moment
        type(vec3) :: f, m
        real(wp) :: arm(3)

        f = vec3(load(:, 1, i), load(:, 2, i), load(:, 3, i))
        m = vec3(load(:, 4, i), load(:, 5, i), load(:, 6, i))
        associate (spec => model%scene%load(i))
            if (spec%axes /= axes_link) then
                f = rotation.unrotate.f
                m = rotation.unrotate.m
            end if
            arm = model%scene%link(spec%link)%marker(spec%marker)%at - point
        end associate
        force = force - f
        moment = moment - m + (f.cross.arm)
    end subroutine subtract_load
end module linkdyn_assembly
