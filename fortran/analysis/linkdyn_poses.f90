!> Where the links are: kinematics alone, without equations, so that a scene can be drawn that has no actuators.
module linkdyn_poses
    use linkdyn_assembly_trail, only: assembly_trail, sample_assembly, follow_assembly, make_room, place_sample
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_pass, only: evaluate_kinematics
    use linkdyn_kinematic_state, only: kinematic_state, prepare_kinematics, link_position, link_rotation
    use linkdyn_lane_count, only: lanes
    use linkdyn_model, only: model_type, has_assemblies
    use linkdyn_status, only: sample_ok, sample_unreachable, sample_not_converged
    implicit none (type, external)
    private
    public :: find_poses

contains

    !> Poses of all moving links. A sample that cannot be assembled says so and is what the closure left.
    !>
    !> With a trail the samples follow each other and the assembly is followed by continuity; without one each sample is
    !> on the branch of the start.
    subroutine find_poses(model, q, position, rotation, sample_status, trail)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: q(:, :)                 !! (n_q, n) [m, rad]
        real(wp), intent(out) :: position(:, :, :)      !! (3, n_link, n) origins, world [m]
        real(wp), intent(out) :: rotation(:, :, :, :)   !! (3, 3, n_link, n) columns: the link's axes
        integer, intent(out) :: sample_status(:)        !! (n) one of `sample_*`
        type(assembly_trail), intent(inout), optional :: trail
        type(kinematic_state) :: state
        type(sample_assembly) :: assembly
        integer :: first, lane, sample, i

        if (has_assemblies(model) .and. size(q, 2) > 0) then
            if (present(trail)) then
                call follow_assembly(model, q, trail, assembly)
            else
                call make_room(model, size(q, 2), assembly)
            end if
        end if
        call prepare_kinematics(model, 0, state)
        state%qd = 0
        state%qdd = 0
        do first = 1, size(q, 2), lanes
            do lane = 1, lanes
                sample = min(first + lane - 1, size(q, 2))
                state%q(lane, :) = q(:, sample)
                if (has_assemblies(model)) call place_sample(model, assembly, sample, lane, state)
            end do
            call evaluate_kinematics(model, state)
            do lane = 1, min(lanes, size(q, 2) - first + 1)
                sample = first + lane - 1
                sample_status(sample) = sample_ok
                if (state%not_converged(lane)) sample_status(sample) = sample_not_converged
                if (state%unreachable(lane)) sample_status(sample) = sample_unreachable
                do i = 1, model%n_link
                    position(:, i, sample) = link_position(model, state, i, lane)
                    rotation(:, :, i, sample) = link_rotation(model, state, i, lane)
                end do
            end do
        end do
    end subroutine find_poses
end module linkdyn_poses
