!> One design of a sweep, planned, with the scratch of one thread.
module linkdyn_sweep_design
    use, intrinsic :: iso_fortran_env, only: int64
    use linkdyn_builder, only: build_model
    use linkdyn_clearance, only: rod, swing_joint, legs_of, swings_of
    use linkdyn_equations, only: equations_type, equation_workspace, build_equations, prepare_workspace
    use linkdyn_force_map, only: force_map, prepare_force_map
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_lock, only: hold_texts, release_texts
    use linkdyn_model, only: model_type
    use linkdyn_motion, only: evaluate_loads
    use linkdyn_scene, only: scene_type
    use linkdyn_status, only: status_type
    use linkdyn_sweep_plan, only: sweep_plan, sweep_cursor, axis_values
    use linkdyn_sweep_quantities, only: quantity_row
    use linkdyn_sweep_source, only: design_source
    use linkdyn_sweep_spec, only: sweep_spec, axis_time, quantity_reaction, quantity_reaction_force, &
        quantity_reaction_moment, quantity_force_amplification, quantity_moment_amplification, quantity_condition, &
        quantity_determinant, quantity_swing, quantity_clearance
    use linkdyn_sweep_totals, only: lane_totals
    implicit none (type, external)
    private
    public :: sweep_design, open_design, close_design

    type :: sweep_design
        integer(int64) :: number = -1                   !! of the design, from 0; -1: none
        type(status_type) :: status                     !! why it is no mechanism
        type(model_type) :: model
        type(equations_type) :: equations
        type(equation_workspace) :: workspace
        type(force_map) :: map
        type(swing_joint), allocatable :: swing(:)
        type(rod), allocatable :: rod(:)
        logical :: wants_reactions = .false., wants_map = .false., wants_condition = .false.
        logical :: needs_forces = .false.
        logical :: follows_motion = .false.             !! an axis is the time
        ! ---- SCRATCH
        type(sweep_cursor) :: cursor
        type(lane_totals) :: part
        real(wp), allocatable :: value(:, :)            !! (lane, entry)
        real(wp), allocatable :: rate(:, :)             !! of the actuators (lane, n_actuator)
        real(wp), allocatable :: reaction(:, :, :)      !! (lane, n_component, n_joint)
        real(wp), allocatable :: jacobian(:, :, :), force(:, :, :)
        real(wp) :: determinant(lanes) = 0
        real(wp), allocatable :: q(:, :), qd(:, :), qdd(:, :), load(:, :, :)   !! along the motion, by lanes
    end type sweep_design

contains

    !> Read, plan and make room, unless this design is open already.
    subroutine open_design(spec, plan, row, source, solver, number, design)
        type(sweep_spec), intent(in) :: spec
        type(sweep_plan), intent(in) :: plan
        type(quantity_row), intent(in) :: row
        class(design_source), intent(in) :: source
        integer, intent(in) :: solver                   !! one of `solver_*`
        integer(int64), intent(in) :: number            !! from 0
        type(sweep_design), intent(inout) :: design
        type(scene_type) :: scene

        if (design%number == number) return
        call close_design(design)
        design%number = number
        associate (place => row%place)
            design%wants_reactions = any(place([quantity_reaction, quantity_reaction_force, quantity_reaction_moment]) > 0)
            design%wants_condition = place(quantity_condition) > 0
            design%wants_map = design%wants_condition .or. any(place([quantity_force_amplification, &
                quantity_moment_amplification, quantity_determinant]) > 0)
            design%needs_forces = row%n_early < row%n
        end associate
        ! several threads open designs at once
        call hold_texts()
        call source%make(axis_values(plan, number*plan%n_pose), scene, design%status)
        if (design%status%is_ok()) call build_model(scene, design%model, design%status)
        call release_texts()
        if (design%status%is_ok()) &
            call build_equations(design%model, solver, design%wants_reactions, design%equations, design%status)
        if (design%status%is_ok()) call make_room(spec, plan, row, design)
    end subroutine open_design

    subroutine make_room(spec, plan, row, design)
        type(sweep_spec), intent(in) :: spec
        type(sweep_plan), intent(in) :: plan
        type(quantity_row), intent(in) :: row
        type(sweep_design), intent(inout) :: design
        real(wp) :: t(1), point(3)
        integer :: i, k

        associate (model => design%model, place => row%place)
            point = 0
            if (spec%tool_link > 0) point = model%scene%link(spec%tool_link)%marker(spec%tool_marker)%at
            if (design%wants_map) then
                call prepare_force_map(model, spec%tool_link, point, spec%length, design%map)
                design%equations%needs_columns = design%map%needs_columns
            end if
            call prepare_workspace(model, design%equations, design%workspace)
            design%workspace%state%world_rates = .true.
            if (design%map%needs_columns .and. design%wants_map) design%workspace%state%carries_legs = .false.
            if (place(quantity_swing) > 0) call choose_neutrals()
            if (place(quantity_clearance) > 0) call choose_rods()
            allocate (design%value(lanes, row%n), design%rate(lanes, model%n_actuator))
            if (design%wants_reactions) allocate (design%reaction(lanes, model%n_component, model%n_joint))
            if (design%wants_map) allocate (design%jacobian(lanes, model%n_actuator, model%n_q), &
                                            design%force(lanes, model%n_actuator, 6))
            design%value = 0
            allocate (design%q(model%n_q, lanes), design%qd(model%n_q, lanes), design%qdd(model%n_q, lanes), &
                      design%load(6, model%n_load, lanes))
            ! A coordinate that no axis varies rests at its start; loads are those of the first instant.
            t = model%scene%time%first
            call evaluate_loads(model, t, design%load(:, :, :1))
            do i = 1, lanes
                design%workspace%state%q(i, :) = model%scene%coordinate%start_position
                if (model%n_load > 0) design%workspace%load(i, :, :) = design%load(:, :, 1)
            end do
            design%workspace%state%qd = 0
            design%workspace%state%qdd = 0
            if (model%n_branch > 0) design%workspace%state%branch = spread(model%branch, 1, lanes)
        end associate
        design%follows_motion = .false.
        do i = 1, size(plan%axis)
            design%follows_motion = design%follows_motion .or. plan%axis(i)%spec%kind == axis_time
        end do

    contains

        !> Directions that the scene gives take the place of those at the start.
        subroutine choose_neutrals()
            integer :: k, j

            call swings_of(design%model, design%swing)
            do k = 1, size(spec%swing)
                do j = 1, size(design%swing)
                    if (design%swing(j)%joint == spec%swing(k)%joint) design%swing(j)%neutral = spec%swing(k)%neutral
                end do
            end do
        end subroutine choose_neutrals

        !> Bodies that the scene gives take the place of the legs.
        subroutine choose_rods()
            integer :: k, side

            if (size(spec%segment) == 0) then
                design%rod = legs_of(design%model, spec%leg_diameter)
                return
            end if
            allocate (design%rod(size(spec%segment)))
            do k = 1, size(spec%segment)
                associate (segment => spec%segment(k))
                    design%rod(k)%radius = segment%diameter/2
                    design%rod(k)%link = segment%link
                    do side = 1, 2
                        if (segment%link(side) == 0) then
                            design%rod(k)%point(:, side) = design%model%scene%frame%marker(segment%marker(side))%at
                        else
                            design%rod(k)%point(:, side) = &
                                design%model%scene%link(segment%link(side))%marker(segment%marker(side))%at
                        end if
                    end do
                end associate
            end do
        end subroutine choose_rods
    end subroutine make_room

    !> Give everything back.
    subroutine close_design(design)
        type(sweep_design), intent(inout) :: design

        if (design%number < 0) return
        if (allocated(design%value)) call design%workspace%free()
        call forget(design)

    contains

        !> To a fresh one: the components are deallocated on the way in.
        subroutine forget(old)
            type(sweep_design), intent(out) :: old

            old%number = -1
        end subroutine forget
    end subroutine close_design
end module linkdyn_sweep_design
