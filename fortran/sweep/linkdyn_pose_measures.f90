!> What hangs on the pose alone: how far joints swing, how near legs come to each other, how driving forces answer a load.
!>
!> Many samples of a sweep may be load cases at one pose, so these are found once a pose, on lanes.
module linkdyn_pose_measures
    use linkdyn_clearance, only: rod, swing_joint, legs_of, swings_of, swing_angle, smallest_gap
    use linkdyn_force_map, only: force_map, prepare_force_map, evaluate_force_map, scaled_condition
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state, prepare_kinematics
    use linkdyn_lane_count, only: lanes
    use linkdyn_led_mechanism, only: evaluate_kinematics
    use linkdyn_model, only: model_type
    use linkdyn_scene, only: marker_at
    use linkdyn_status, only: sample_ok, sample_unreachable, sample_singular, sample_not_converged, sample_branch_lost
    use linkdyn_sweep_quantities, only: quantity_row
    use linkdyn_sweep_spec, only: sweep_spec, quantity_force_amplification, quantity_moment_amplification, &
        quantity_condition, quantity_determinant, quantity_swing, quantity_clearance
    implicit none (type, external)
    private
    public :: pose_measures, prepare_pose_measures, measure_poses, belongs_to_pose

    !> Those of one design, with the scratch of one thread.
    type :: pose_measures
        logical :: are_wanted = .false., wants_map = .false.
        type(force_map) :: map
        type(swing_joint), allocatable :: swing(:)
        type(rod), allocatable :: rod(:)
        ! ---- SCRATCH
        type(kinematic_state) :: state
        real(wp), allocatable :: jacobian(:, :, :)          !! scaled (lane, n_actuator, n_q)
        real(wp), allocatable :: force(:, :, :)             !! of unit wrenches (lane, n_actuator, 6)
        real(wp) :: determinant(lanes) = 0
    end type pose_measures

contains

    !> Is a quantity one of these?
    pure logical function belongs_to_pose(id) result(belongs)
        integer, intent(in) :: id                           !! one of `quantity_*`

        belongs = any(id == [quantity_swing, quantity_clearance]) .or. follows_from_map(id)
    end function belongs_to_pose

    pure logical function follows_from_map(id) result(follows)
        integer, intent(in) :: id                           !! one of `quantity_*`

        follows = any(id == [quantity_force_amplification, quantity_moment_amplification, quantity_condition, quantity_determinant])
    end function follows_from_map

    !> What is constant for a design, and room.
    subroutine prepare_pose_measures(spec, row, model, measures)
        type(sweep_spec), intent(in) :: spec
        type(quantity_row), intent(in) :: row
        type(model_type), intent(in) :: model
        type(pose_measures), intent(out) :: measures
        real(wp) :: point(3)
        integer :: k, n_column

        do k = 1, size(row%quantity)
            measures%are_wanted = measures%are_wanted .or. belongs_to_pose(row%quantity(k)%id)
            measures%wants_map = measures%wants_map .or. follows_from_map(row%quantity(k)%id)
        end do
        if (.not. measures%are_wanted) return
        n_column = 0
        if (measures%wants_map) then
            point = 0
            if (spec%tool_link > 0) point = model%scene%link(spec%tool_link)%marker(spec%tool_marker)%at
            call prepare_force_map(model, spec%tool_link, point, spec%length, measures%map)
            if (measures%map%needs_columns) n_column = model%n_q
            allocate (measures%jacobian(lanes, model%n_actuator, model%n_q), measures%force(lanes, model%n_actuator, 6))
        end if
        call prepare_kinematics(model, n_column, measures%state)
        associate (state => measures%state)
            state%qd = 0
            state%qdd = 0
            if (model%n_branch > 0) state%branch = spread(model%branch, 1, lanes)
        end associate
        if (row%place(quantity_swing) > 0) call choose_neutrals(spec, model, measures%swing)
        if (row%place(quantity_clearance) > 0) call choose_rods(spec, model, measures%rod)
    end subroutine prepare_pose_measures

    !> Directions that the scene gives take the place of those at the start.
    subroutine choose_neutrals(spec, model, swing)
        type(sweep_spec), intent(in) :: spec
        type(model_type), intent(in) :: model
        type(swing_joint), allocatable, intent(out) :: swing(:)
        integer :: k, j

        call swings_of(model, swing)
        do k = 1, size(spec%swing)
            do j = 1, size(swing)
                if (swing(j)%joint == spec%swing(k)%joint) swing(j)%neutral = spec%swing(k)%neutral
            end do
        end do
    end subroutine choose_neutrals

    !> Bodies that the scene gives take the place of the legs.
    subroutine choose_rods(spec, model, rods)
        type(sweep_spec), intent(in) :: spec
        type(model_type), intent(in) :: model
        type(rod), allocatable, intent(out) :: rods(:)
        integer :: k, side

        if (size(spec%segment) == 0) then
            rods = legs_of(model, spec%leg_diameter)
            return
        end if
        allocate (rods(size(spec%segment)))
        do k = 1, size(spec%segment)
            associate (segment => spec%segment(k))
                rods(k)%radius = segment%diameter/2
                rods(k)%link = segment%link
                do side = 1, 2
                    rods(k)%point(:, side) = marker_at(model%scene, segment%link(side), segment%marker(side))
                end do
            end associate
        end do
    end subroutine choose_rods

    !> All that is wanted of some poses.
    subroutine measure_poses(model, row, q, measures, value, status)
        type(model_type), intent(in) :: model
        type(quantity_row), intent(in) :: row
        real(wp), intent(in) :: q(:, :)                     !! (n_q, pose)
        type(pose_measures), intent(inout) :: measures
        real(wp), intent(inout) :: value(:, :)              !! (entry of the row, pose); others stay as they are
        integer, intent(out) :: status(:)                   !! (pose) one of `sample_*`
        real(wp) :: on_lanes(lanes, row%n_early)
        integer :: first, lane, n, k

        do first = 1, size(q, 2), lanes
            n = min(lanes, size(q, 2) - first + 1)
            associate (state => measures%state)
                do lane = 1, lanes
                    state%q(lane, :) = q(:, first + min(lane, n) - 1)
                end do
                call evaluate_kinematics(model, state)
                status(first:first + n - 1) = sample_ok
                where (state%singular(:n)) status(first:first + n - 1) = sample_singular
                where (state%not_converged(:n)) status(first:first + n - 1) = sample_not_converged
                where (state%unreachable(:n)) status(first:first + n - 1) = sample_unreachable
                where (state%branch_lost(:n)) status(first:first + n - 1) = sample_branch_lost
            end associate
            call measure_lanes(model, row, measures, on_lanes)
            do k = 1, size(row%quantity)
                associate (quantity => row%quantity(k))
                    if (.not. belongs_to_pose(quantity%id)) cycle
                    value(quantity%first + 1:quantity%first + quantity%n, first:first + n - 1) = &
                        transpose(on_lanes(:n, quantity%first + 1:quantity%first + quantity%n))
                end associate
            end do
        end do
    end subroutine measure_poses

    !> Those of the poses on the lanes.
    subroutine measure_lanes(model, row, measures, value)
        type(model_type), intent(in) :: model
        type(quantity_row), intent(in) :: row
        type(pose_measures), intent(inout) :: measures
        real(wp), intent(inout) :: value(:, :)              !! (lane, entry)
        integer :: k, i

        if (measures%wants_map) call evaluate_force_map(model, measures%map, measures%state, measures%jacobian, measures%force, &
                                                        measures%determinant)
        do k = 1, size(row%quantity)
            associate (first => row%quantity(k)%first, n => row%quantity(k)%n)
                select case (row%quantity(k)%id)
                case (quantity_swing)
                    do i = 1, n
                        call swing_angle(model, measures%swing(i), measures%state, value(:, first + i))
                    end do
                case (quantity_clearance)
                    call smallest_gap(model, measures%rod, measures%state, value(:, first + 1))
                case (quantity_determinant)
                    value(:, first + 1) = measures%determinant
                case (quantity_force_amplification)
                    do i = 1, n
                        value(:, first + i) = row_length(measures%force(:, i, 1:3))
                    end do
                case (quantity_moment_amplification)
                    do i = 1, n
                        value(:, first + i) = row_length(measures%force(:, i, 4:6))
                    end do
                case (quantity_condition)
                    call scaled_condition(model%n_q, measures%jacobian, value(:, first + 1))
                end select
            end associate
        end do
    end subroutine measure_lanes

    pure function row_length(v) result(length)
        real(wp), intent(in) :: v(:, :)                     !! (lane, 3)
        real(wp) :: length(lanes)

        length = sqrt(v(:, 1)**2 + v(:, 2)**2 + v(:, 3)**2)
    end function row_length
end module linkdyn_pose_measures
