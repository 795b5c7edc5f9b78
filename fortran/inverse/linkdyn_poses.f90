!> Where the links are: kinematics alone, without equations, so that a scene can be drawn that has no actuators.
module linkdyn_poses
    use linkdyn_result_kinds, only: result_position, result_rotation
    use linkdyn_assembly_trail, only: assembly_trail, sample_assembly, place_sample
    use linkdyn_interrupt, only: is_interrupted
    use linkdyn_inverse, only: inverse_solver, inverse_results, place_by_record
    use linkdyn_joint_motion, only: relative_motion, relative_by_variables, turn_frame, turn_frame_back
    use linkdyn_gear_fit, only: gears_go_along
    use linkdyn_joint_table, only: is_geared, is_pose_part
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state, prepare_kinematics, link_position, link_rotation
    use linkdyn_lane_count, only: lanes
    use linkdyn_led_mechanism, only: evaluate_kinematics
    use linkdyn_motion_measures, only: released_fit
    use linkdyn_model, only: model_type, has_assemblies
    use linkdyn_scene, only: joint_n_variable, joint_cam
    use linkdyn_status, only: sample_ok, sample_unreachable, sample_not_converged, sample_branch_lost, sample_undefined
    use linkdyn_vec3, only: vec3, mat3, operator(+), operator(-), operator(.rotate.), operator(.unrotate.), &
        identity_mat3, zero_vec3, lane_of, mat3_lane
    implicit none (type, external)
    private
    public :: find_poses, poses_of_joints

contains

    !> Poses of all moving links. A sample that cannot be assembled says so and is what the closure left.
    !>
    !> With a trail the samples follow each other and the assembly is followed by continuity; without one each sample is
    !> on the branch of the start. The solver keeps what large batches have of programs. When the process is told to stop the rest
    !> is left alone.
    subroutine find_poses(model, solver, q, position, rotation, sample_status, trail)
        type(model_type), intent(in) :: model
        type(inverse_solver), intent(in) :: solver      !! prepared for no forces
        real(wp), intent(in), contiguous :: q(:, :)     !! (n_q, n) [m, rad]
        real(wp), intent(out), contiguous, target :: position(:, :, :)      !! (3, n_link, n) origins, world [m]
        real(wp), intent(out), contiguous, target :: rotation(:, :, :, :)   !! (3, 3, n_link, n) columns: the link's axes
        integer, intent(out), contiguous, target :: sample_status(:)        !! (n) one of `sample_*`
        type(assembly_trail), intent(inout), optional :: trail
        type(sample_assembly) :: assembly
        type(inverse_results) :: results
        integer, allocatable :: left(:)
        integer :: sample

        if (size(q, 2) == 0) return
        call results%put(result_position, position)
        call results%put(result_rotation, rotation)
        results%status => sample_status
        sample_status = sample_ok
        call place_by_record(model, solver, q, results, assembly, left, trail)
        call place_on_lanes(model, q, assembly, left, position, rotation, sample_status)
        if (is_interrupted()) return
        do sample = 1, size(q, 2)
            if (sample_status(sample) /= sample_ok) cycle
            if (.not. gears_go_along(model, position(:, :, sample), rotation(:, :, :, sample))) &
                sample_status(sample) = sample_unreachable
            if (sample_status(sample) == sample_ok .and. .not. (all(abs(position(:, :, sample)) <= huge(1.0_wp)) &
                .and. all(abs(rotation(:, :, :, sample)) <= huge(1.0_wp)))) sample_status(sample) = sample_undefined
        end do
    end subroutine find_poses

    !> Some samples, each on its assembly.
    subroutine place_on_lanes(model, q, assembly, which, position, rotation, sample_status)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: q(:, :)                 !! (n_q, n) [m, rad]
        type(sample_assembly), intent(in) :: assembly
        integer, intent(in) :: which(:)                 !! their numbers
        real(wp), intent(inout) :: position(:, :, :)    !! (3, n_link, n)
        real(wp), intent(inout) :: rotation(:, :, :, :) !! (3, 3, n_link, n)
        integer, intent(inout) :: sample_status(:)      !! (n)
        type(kinematic_state) :: state
        integer :: first, lane, sample, i

        if (size(which) == 0) return
        call prepare_kinematics(model, 0, state)
        state%qd = 0
        state%qdd = 0
        do first = 1, size(which), lanes
            if (is_interrupted()) return
            do lane = 1, lanes
                sample = which(min(first + lane - 1, size(which)))
                state%q(lane, :) = q(:, sample)
                if (has_assemblies(model)) call place_sample(model, assembly, sample, lane, state)
            end do
            call evaluate_kinematics(model, state)
            if (model%share%n > 0) &
                state%unreachable = state%unreachable .or. .not. released_fit(model, [(i, i=1, model%n_joint)], state)
            do lane = 1, min(lanes, size(which) - first + 1)
                sample = which(first + lane - 1)
                sample_status(sample) = sample_ok
                if (state%not_converged(lane)) sample_status(sample) = sample_not_converged
                if (state%unreachable(lane)) sample_status(sample) = sample_unreachable
                if (state%branch_lost(lane)) sample_status(sample) = sample_branch_lost
                do i = 1, model%n_link
                    position(:, i, sample) = link_position(model, state, i, lane)
                    rotation(:, :, i, sample) = link_rotation(model, state, i, lane)
                end do
            end do
        end do
    end subroutine place_on_lanes

    !> Poses of all moving links from all joint variables: no loop is closed, so no assembly need be known. Where no joints lead
    !> to a link, a body that is led by its pose alone, nothing is told of the sample.
    subroutine poses_of_joints(model, variable, position, rotation, sample_status)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: variable(:, :)          !! (n_variable, n) [m, rad]
        real(wp), intent(out) :: position(:, :, :)      !! (3, n_link, n)
        real(wp), intent(out) :: rotation(:, :, :, :)   !! (3, 3, n_link, n)
        integer, intent(out) :: sample_status(:)        !! (n)
        type(mat3) :: turn(0:model%n_link)
        type(vec3) :: origin(0:model%n_link)
        integer :: joint(model%n_link), side(model%n_link), first, lane, sample, i

        call find_ways(model, joint, side)
        turn = identity_mat3()
        origin = zero_vec3()
        do first = 1, size(variable, 2), lanes
            do i = 1, model%n_link
                call go_through(model, joint(i), side(i), variable(:, first:), turn, origin)
            end do
            do lane = 1, min(lanes, size(variable, 2) - first + 1)
                sample = first + lane - 1
                do i = 1, model%n_link
                    position(:, i, sample) = lane_of(origin(i), lane)
                    rotation(:, :, i, sample) = mat3_lane(turn(i), lane)
                end do
                sample_status(sample) = merge(sample_ok, sample_unreachable, &
                                              all(joint > 0) .and. all(abs(position(:, :, sample)) <= huge(1.0_wp)))
            end do
        end do
    end subroutine poses_of_joints

    !> Joints through which the links are reached one after the other, and the side from which.
    subroutine find_ways(model, joint, side)
        type(model_type), intent(in) :: model
        integer, intent(out) :: joint(:), side(:)       !! (n_link)
        logical :: is_known(0:model%n_link)
        integer :: n, j, from

        is_known = .false.
        is_known(0) = .true.
        n = 0
        do while (n < model%n_link)
            search: do j = 1, model%n_joint
                if (.not. has_variables_that_place(model%joint(j)%told_kind)) cycle
                do from = 1, 2
                    associate (link => model%joint(j)%link)
                        if (.not. is_known(link(from)) .or. is_known(link(3 - from))) cycle
                        n = n + 1
                        joint(n) = j
                        side(n) = from
                        is_known(link(3 - from)) = .true.
                    end associate
                    exit search
                end do
            end do search
            if (j > model%n_joint) exit                 ! no joints lead to what is left
        end do
        joint(n + 1:) = 0
        side(n + 1:) = 0

    contains

        !> Has a kind variables that relate the places of two links? Wheels and cams leave them to other joints.
        pure logical function has_variables_that_place(kind)
            integer, intent(in) :: kind

            has_variables_that_place = .not. (is_geared(kind) .or. kind == joint_cam .or. is_pose_part(kind))
        end function has_variables_that_place
    end subroutine find_ways

    !> Place the link behind a joint, on all lanes.
    subroutine go_through(model, j, from, variable, turn, origin)
        type(model_type), intent(in) :: model
        integer, intent(in) :: j, from                  !! joint, side of the known link; 0: none
        real(wp), intent(in) :: variable(:, :)          !! (n_variable, samples from lane 1 on)
        type(mat3), intent(inout) :: turn(0:)
        type(vec3), intent(inout) :: origin(0:)
        type(relative_motion) :: motion
        type(mat3) :: frame
        real(wp), dimension(lanes, 3) :: q, zero
        integer :: lane, k

        if (j == 0) return
        zero = 0
        q = 0
        associate (joint => model%joint(j), known => model%joint(j)%link(from), link => model%joint(j)%link(3 - from))
            do lane = 1, lanes
                do k = 1, joint_n_variable(joint%told_kind)
                    q(lane, k) = variable(joint%first_variable + k, min(lane, size(variable, 2)))
                end do
            end do
            frame = turn_frame(turn(known), joint%told_frame(:, :, from))
            if (from == 2) frame = first_frame(frame)
            call relative_by_variables(joint%told_kind, frame, q, zero, zero, motion, joint%pitch)
            if (from == 1) frame = motion%frame
            if (from == 2) motion%slide = zero_vec3() - motion%slide
            turn(link) = turn_frame_back(frame, joint%told_frame(:, :, 3 - from))
            origin(link) = origin(known) + (turn(known).rotate.joint%point(:, from)) + motion%slide &
                           - (turn(link).rotate.joint%point(:, 3 - from))
        end associate

    contains

        !> The first marker's frame from the second's.
        type(mat3) function first_frame(second)
            type(mat3), intent(in) :: second
            type(relative_motion) :: alone
            type(mat3) :: e

            e = identity_mat3()
            associate (joint => model%joint(j))
                call relative_by_variables(joint%told_kind, e, q, zero, zero, alone, joint%pitch)
            end associate
            first_frame%x = second.rotate. (alone%frame.unrotate.e%x)
            first_frame%y = second.rotate. (alone%frame.unrotate.e%y)
            first_frame%z = second.rotate. (alone%frame.unrotate.e%z)
        end function first_frame
    end subroutine go_through
end module linkdyn_poses
