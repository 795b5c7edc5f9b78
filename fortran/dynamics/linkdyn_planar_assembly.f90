!> Values of the planar equations: the varying matrix entries, and the right-hand sides from Newton and Euler.
!>
!> Rows stand in world axes; only arms and the directions of slides turn.
module linkdyn_planar_assembly
    use linkdyn_formulation, only: formulation_type, incidence_type, wrench_column
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state
    use linkdyn_lane_count, only: lanes
    use linkdyn_model, only: model_type
    use linkdyn_planar_motion, only: planar_motion, level_given
    use linkdyn_planar_point, only: carried
    use linkdyn_scene, only: axes_link
    use linkdyn_vec2, only: vec2, operator(+), operator(-), operator(*), operator(.cross.), operator(.rotate.), &
        vec2_of, zero_vec2
    implicit none (type, external)
    private
    public :: assemble_planar_matrix, assemble_planar_right, planar_link_wrench, planar_inertia, &
        subtract_planar_applied

contains

    !> Fill slots 1..n_slot with the varying entries.
    subroutine assemble_planar_matrix(model, formulation, state, slot)
        type(model_type), intent(in) :: model
        type(formulation_type), intent(in) :: formulation
        type(kinematic_state), intent(in) :: state
        real(wp), intent(inout) :: slot(lanes, *)
        type(vec2) :: arm, direction
        integer :: i, g, k

        do i = 1, size(formulation%incidence)
            associate (incidence => formulation%incidence(i))
                if (.not. incidence%varies) cycle
                if (incidence%needs_arm) then
                    arm = vec2_of(incidence%arm(:2))
                    if (incidence%n_slide > 0) arm = arm + state%slide(:, 1, incidence%joint)*vec2_of(incidence%arm_slide(:2, 1))
                    arm = state%plane%rotation(model%link(incidence%link)%orientation).rotate.arm
                    if (model%joint(incidence%joint)%cam > 0) arm = contact_arm(model, formulation, incidence, state%plane)
                    arm = incidence%sign*arm
                end if
                do g = 1, size(incidence%group)
                    associate (group => incidence%group(g))
                        if (group%slides) slot(:, group%slide_slot(3)) = group%slide_fixed(3) &
                            + group%slide_rate(3, 1)*state%slide(:, 1, incidence%joint)
                        if (.not. group%needs_direction) cycle
                        associate (column => formulation%column(group%column))
                            if (column%cam > 0) then
                                direction = state%plane%contact(column%cam)%normal
                            else if (column%orientation == 0) then
                                direction = vec2_of(column%direction(:2))
                            else
                                direction = state%plane%rotation(column%orientation).rotate.column%direction(:2)
                            end if
                        end associate
                        if (group%needs_arm) slot(:, group%moment_slot(3)) = (arm.cross.direction) &
                            + incidence%sign*formulation%column(group%column)%couple(3, merge(1, 2, incidence%sign < 0))
                        k = group%force_slot(1)
                        if (k > 0) slot(:, k) = incidence%sign*direction%x
                        k = group%force_slot(2)
                        if (k > 0) slot(:, k) = incidence%sign*direction%y
                    end associate
                end do
            end associate
        end do
    end subroutine assemble_planar_matrix

    !> From the moment point of one of a cam's links to where the force acts.
    pure function contact_arm(model, formulation, incidence, plane) result(arm)
        type(model_type), intent(in) :: model
        type(formulation_type), intent(in) :: formulation
        type(incidence_type), intent(in) :: incidence
        type(planar_motion), intent(in) :: plane
        type(vec2) :: arm

        associate (l => incidence%link)
            arm = plane%contact(model%joint(incidence%joint)%cam)%point - plane%position(l) &
                  - (plane%rotation(model%link(l)%orientation).rotate.formulation%moment_point(:2, l))
        end associate
    end function contact_arm

    !> Fill the right-hand sides: slot(:, first + row) for every row that is not zero by rule.
    subroutine assemble_planar_right(model, formulation, state, load, first, slot)
        type(model_type), intent(in) :: model
        type(formulation_type), intent(in) :: formulation
        type(kinematic_state), intent(in) :: state
        real(wp), intent(in) :: load(:, :, :)         !! (lane, 6, n_load): force and moment [N, N m]
        integer, intent(in) :: first
        real(wp), intent(inout) :: slot(lanes, *)
        type(vec2) :: force
        real(wp) :: moment(lanes)
        integer :: l, row

        do l = 1, model%n_link
            if (.not. formulation%has_right(l)) cycle
            call planar_link_wrench(model, l, formulation%moment_point(:2, l), state, load, force, moment)
            row = first + 3*(l - 1)
            slot(:, row + 1) = force%x
            slot(:, row + 2) = force%y
            slot(:, row + 3) = moment
        end do
    end subroutine assemble_planar_right

    !> What a link's acceleration at one level asks for: m a_G, and I alpha + (G - point) x m a_G; less gravity at the
    !> level given.
    pure subroutine planar_inertia(model, l, point, level, plane, payload, force, moment)
        type(model_type), intent(in) :: model
        integer, intent(in) :: l
        real(wp), intent(in) :: point(2)              !! moment point, link axes [m]
        integer, intent(in) :: level                  !! the acceleration given, or a column
        type(planar_motion), intent(in) :: plane
        real(wp), intent(in) :: payload(:, :)         !! masses that links carry (lane, n_payload) [kg]
        type(vec2), intent(out) :: force              !! world axes
        real(wp), intent(out) :: moment(lanes)
        type(vec2) :: motion
        integer :: i, o

        o = model%link(l)%orientation
        associate (link => model%link(l))
            motion = carried(plane, level, l, o, plane%rotation(o).rotate.link%cog(:2))
            if (level == level_given) motion = motion - vec2_of(model%gravity(:2))
            force = link%mass*motion
            moment = link%inertia(3, 3)*plane%angular(:, level, o)
            if (any(link%cog(:2) /= point)) &
                moment = moment + ((plane%rotation(o).rotate.(link%cog(:2) - point)).cross.force)
        end associate
        do i = 1, size(model%payload)
            if (model%payload(i)%link /= l) cycle
            associate (body => model%payload(i)%body, mass => payload(:, i))
                motion = carried(plane, level, l, o, plane%rotation(o).rotate.body%cog(:2))
                if (level == level_given) motion = motion - vec2_of(model%gravity(:2))
                force = force + mass*motion
                moment = moment + mass*(body%inertia(3, 3)*plane%angular(:, level, o) &
                                        + ((plane%rotation(o).rotate.(body%cog(:2) - point)).cross.motion))
            end associate
        end do
    end subroutine planar_inertia

    !> What the joints must supply to a link: its inertia less gravity, loads, springs and given drives.
    subroutine planar_link_wrench(model, l, point, state, load, force, moment)
        type(model_type), intent(in) :: model
        integer, intent(in) :: l
        real(wp), intent(in) :: point(2)              !! moment point, link axes [m]
        type(kinematic_state), intent(in) :: state
        real(wp), intent(in) :: load(:, :, :)
        type(vec2), intent(out) :: force              !! world axes [N]
        real(wp), intent(out) :: moment(lanes)        !! [N m]

        if (model%link(l)%is_massless) then
            force = zero_vec2()
            moment = 0
        else
            call planar_inertia(model, l, point, level_given, state%plane, state%payload, force, moment)
        end if
        call subtract_planar_applied(model, l, point, state, load, force, moment)
    end subroutine planar_link_wrench

    !> Take off what acts on a link besides joints and gravity: loads, springs, given driving forces.
    subroutine subtract_planar_applied(model, l, point, state, load, force, moment)
        type(model_type), intent(in) :: model
        integer, intent(in) :: l
        real(wp), intent(in) :: point(2)              !! moment point, link axes [m]
        type(kinematic_state), intent(in) :: state
        real(wp), intent(in) :: load(:, :, :)
        type(vec2), intent(inout) :: force            !! world axes [N]
        real(wp), intent(inout) :: moment(lanes)      !! [N m]
        integer :: i

        do i = 1, model%n_load
            if (model%scene%load(i)%link == l) call subtract_load(model, i, point, state, load, force, moment)
        end do
        if (state%has_applied) then
            associate (plane => state%plane)
                force = force - plane%applied_force(l)
                moment = moment - plane%applied_moment(:, l) &
                         + ((plane%rotation(model%link(l)%orientation).rotate.point).cross.plane%applied_force(l))
            end associate
        end if
    end subroutine subtract_planar_applied

    subroutine subtract_load(model, i, point, state, load, force, moment)
        type(model_type), intent(in) :: model
        integer, intent(in) :: i
        real(wp), intent(in) :: point(2)
        type(kinematic_state), intent(in) :: state
        real(wp), intent(in) :: load(:, :, :)
        type(vec2), intent(inout) :: force
        real(wp), intent(inout) :: moment(lanes)
        type(vec2) :: f

        associate (spec => model%scene%load(i))
            associate (r => state%plane%rotation(model%link(spec%link)%orientation), &
                       at => model%scene%link(spec%link)%marker(spec%marker)%at(:2))
                f = vec2(load(:, 1, i), load(:, 2, i))
                if (spec%axes == axes_link) f = r.rotate.f
                force = force - f
                moment = moment - load(:, 6, i) - ((r.rotate.(at - point)).cross.f)
            end associate
        end associate
    end subroutine subtract_load
end module linkdyn_planar_assembly
