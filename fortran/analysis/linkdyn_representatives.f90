!> Poses that stand for a scene: pivots that serve there serve elsewhere.
module linkdyn_representatives
    use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
    use, intrinsic :: iso_fortran_env, only: int64
    use linkdyn_assembly_trail, only: sample_assembly, make_room, keep_lane
    use linkdyn_closing_programs, only: closing_programs, make_closing_programs
    use linkdyn_constants, only: golden
    use linkdyn_inputs, only: sample_set, in_motion
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state, prepare_kinematics, link_position, link_rotation
    use linkdyn_lane_count, only: lanes
    use linkdyn_equation_programs, only: make_motion_program
    use linkdyn_equations_on_lanes, only: lane_numbers, lane_program, lane_space, prepare_lanes, run_on_lanes, free_lane_program, &
        free_lane_space
    use linkdyn_led_mechanism, only: evaluate_kinematics, measure_margins, n_map
    use linkdyn_lock, only: hold_texts, release_texts
    use linkdyn_model, only: model_type, gives_attitude, attitude_angles, scene_size
    use linkdyn_motion, only: evaluate_motion
    implicit none (type, external)
    private
    public :: few_links, is_worth_own_record, representative_poses, need_poses, make_closer, set_in_motion, representative_motions

    integer, parameter :: n_wanted_pose = 32    !! that stand for the scene
    !> Links of mechanisms whose records are made at once: that takes some milliseconds, and as much for every further thirty or so.
    integer, parameter :: few_links = 50

    !> Poses that stand for a scene, and how it is assembled there. Chosen once: groups closed by iteration are led to each from the
    !> start.
    type :: representative_poses
        real(wp), allocatable :: q(:, :)                        !! (n_q, n), n at most n_wanted_pose; not allocated: not chosen yet
        type(sample_assembly) :: assembly                       !! there
        real(wp), allocatable :: stand(:, :, :)                 !! axes and origins of the links at the first (3, 4, 0:n_link)
    end type representative_poses

contains

    !> Is a record worth while for one of many designs that have all kernels but this in common? It takes as long as some hundred
    !> samples a link on lanes.
    pure logical function is_worth_own_record(model, n)
        type(model_type), intent(in) :: model
        integer(int64), intent(in) :: n                !! samples of the design
        integer, parameter :: samples_a_link = 500

        is_worth_own_record = n >= int(samples_a_link, int64)*model%n_link
    end function is_worth_own_record

    !> A block of poses, the last of them on the lanes left over, with rates and accelerations as chance has them.
    pure subroutine set_in_motion(pose, first, q, qd, qdd)
        real(wp), intent(in) :: pose(:, :)                      !! (n_q, n)
        integer, intent(in) :: first                            !! on the first lane
        real(wp), intent(out) :: q(:, :), qd(:, :)              !! (lane, n_q)
        real(wp), intent(out), optional :: qdd(:, :)
        integer :: lane, i, k

        do lane = 1, lanes
            i = min(first + lane - 1, size(pose, 2))
            q(lane, :) = pose(:, i)
            qd(lane, :) = [(modulo((i*size(q, 2) + k)*golden, 1.0_wp) - 0.5_wp, k=1, size(q, 2))]
            if (present(qdd)) qdd(lane, :) = [(modulo((i*size(q, 2) + k)*golden + 0.3_wp, 1.0_wp) - 0.5_wp, k=1, size(q, 2))]
        end do
    end subroutine set_in_motion

    !> Choose the poses, unless that is done.
    subroutine need_poses(model, batch, poses)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: batch(:, :)                     !! (n_q, n)
        type(representative_poses), intent(inout) :: poses

        if (allocated(poses%q)) return
        allocate (poses%stand(3, 4, 0:model%n_link))
        call choose_poses(model, batch, poses%q, poses%assembly, poses%stand)
    end subroutine need_poses

    !> Programs of Newton's steps of all groups.
    subroutine make_closer(model, batch, poses, closing)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: batch(:, :)                     !! (n_q, n)
        type(representative_poses), intent(inout) :: poses
        type(closing_programs), intent(inout) :: closing

        call need_poses(model, batch, poses)
        call hold_texts()
        associate (n => size(poses%q, 2), there => poses%assembly)
            call make_closing_programs(model, poses%q, there%place(:, :, :n), there%margin(:, :n), closing)
        end associate
        call release_texts()
    end subroutine make_closer

    !> Poses that stand for the scene, at which all loops close; of a batch's own, if none of the others does.
    subroutine choose_poses(model, batch, pose, assembly, stand)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: batch(:, :)                     !! (n_q, n)
        real(wp), allocatable, intent(out) :: pose(:, :)        !! (n_q, at most n_wanted_pose)
        type(sample_assembly), intent(out) :: assembly          !! there
        real(wp), intent(out) :: stand(:, :, 0:)                !! axes and origins of the links at the first (3, 4, 0:n_link)
        type(kinematic_state) :: state
        integer :: block, first, lane, attempt

        allocate (pose(model%n_q, 0))
        call make_room(model, n_wanted_pose, assembly)
        stand = spread(reshape([1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp], &
                               [3, 4]), 3, 1 + model%n_link)
        call prepare_kinematics(model, 0, state)
        do attempt = 1, 2
            do block = 1, 8*n_wanted_pose/lanes + 8
                call candidate_poses(model, block, state)
                call add_poses(must_be_clear=attempt == 1)
                if (size(pose, 2) == n_wanted_pose) return
            end do
            if (size(pose, 2) > 0) return
        end do
        do block = 1, 8*n_wanted_pose/lanes + 8
            first = 1 + (block - 1)*lanes
            if (first > size(batch, 2)) exit
            state%q = transpose(batch(:, [(min(first + lane, size(batch, 2)), lane=0, lanes - 1)]))
            call add_poses(must_be_clear=.false.)
            if (size(pose, 2) == n_wanted_pose) return
        end do

    contains

        subroutine add_poses(must_be_clear)
            logical, intent(in) :: must_be_clear
            logical :: is_clear(lanes)
            integer :: lane

            call evaluate_kinematics(model, state)
            is_clear = .not. (state%unreachable .or. state%not_converged .or. state%singular)
            if (must_be_clear) is_clear = is_clear .and. stands_clear(model, state)
            do lane = 1, lanes
                if (.not. is_clear(lane)) cycle
                if (size(pose, 2) == n_wanted_pose) return
                if (size(pose, 2) == 0) call note_stand(lane)
                pose = reshape([pose, state%q(lane, :)], [model%n_q, size(pose, 2) + 1])
                call keep_lane(model, state, lane, size(pose, 2), assembly)
            end do
        end subroutine add_poses

        subroutine note_stand(lane)
            integer, intent(in) :: lane
            integer :: i

            do i = 1, model%n_link
                stand(:, :3, i) = link_rotation(model, state, i, lane)
                stand(:, 4, i) = link_position(model, state, i, lane)
            end do
        end subroutine note_stand
    end subroutine choose_poses

    !> How the links stand there, at rest, as numbers; with columns of the coordinates, if these are wanted. None may be found.
    subroutine representative_motions(model, has_columns, sample)
        type(model_type), intent(in) :: model
        logical, intent(in) :: has_columns
        type(sample_set), intent(out) :: sample
        type(kinematic_state) :: state
        type(lane_program) :: motion
        type(lane_numbers) :: nothing_else
        type(lane_space) :: space
        real(wp), allocatable :: x(:, :)
        integer :: attempt

        call make_motion_program(model, has_columns, motion%program)
        call prepare_lanes(model, has_columns, motion)
        call prepare_kinematics(model, merge(model%n_q, 0, has_columns), state)
        allocate (x(motion%program%program%n_output, n_wanted_pose))
        do attempt = 1, 2
            call collect(must_be_clear=attempt == 1)
            if (sample%n > 0) exit
        end do
        sample%of(in_motion)%x = x(:, :sample%n)
        call free_lane_space(space)
        call free_lane_program(motion)

    contains

        subroutine collect(must_be_clear)
            logical, intent(in) :: must_be_clear
            logical :: is_clear(lanes)
            integer :: block, lane

            do block = 1, 8*n_wanted_pose/lanes + 8
                call candidate_poses(model, block, state)
                call evaluate_kinematics(model, state)
                is_clear = .not. state%unreachable
                if (must_be_clear) is_clear = is_clear .and. stands_clear(model, state)
                call run_on_lanes(motion, lanes, state, nothing_else, space)
                do lane = 1, lanes
                    if (.not. (is_clear(lane) .and. all(ieee_is_finite(space%found(lane, :))))) cycle
                    sample%n = sample%n + 1
                    x(:, sample%n) = space%found(lane, :)
                    if (sample%n == n_wanted_pose) return
                end do
            end do
        end subroutine collect
    end subroutine representative_motions

    !> Are all dyads away from their change points, and attitudes from the poles of their angles? A pose beside one stands for
    !> nothing but itself: no pivot that is good elsewhere is good there, least of all where several dyads come to theirs at once.
    function stands_clear(model, state) result(is_clear)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        logical :: is_clear(lanes)
        real(wp), parameter :: least_sine = 0.1_wp     !! of the angle between the rods of a dyad, or two axes of angles: a digit
        real(wp), dimension(lanes, n_map(model)) :: margin, drift
        integer :: i

        call measure_margins(model, state, margin, drift)
        is_clear = all(abs(margin(:, :model%n_branch)) >= least_sine, dim=2)
        do i = 1, size(model%step)
            if (.not. gives_attitude(model, model%step(i))) cycle
            associate (angle => attitude_angles(model%step(i)))
                is_clear = is_clear .and. abs(cos(state%q(:, angle(2)))) >= least_sine
            end associate
        end do
    end function stands_clear

    !> A block of poses that stand for the scene: its motion, and for every other pose a step away from it, so that
    !> no entry is small merely because the motion is special.
    subroutine candidate_poses(model, block, state)
        type(model_type), intent(in) :: model
        integer, intent(in) :: block
        type(kinematic_state), intent(inout) :: state
        real(wp), parameter :: turn_step = 0.4_wp, length_step = 0.1_wp               !! [rad], [part of the scene's size]
        real(wp) :: q(model%n_q, 1), qd(model%n_q, 1), qdd(model%n_q, 1), load(6, model%n_load, 1), t(1), step, number
        integer :: lane, k

        do lane = 1, lanes
            number = real((block - 1)*lanes + lane, wp)
            t = model%scene%time%first + modulo(number*golden, 1.0_wp)*(model%scene%time%last - model%scene%time%first)
            call evaluate_motion(model, t, q, qd, qdd, load)
            do k = 1, model%n_q
                state%q(lane, k) = q(k, 1)
                if (modulo((block - 1)*lanes + lane, 2) == 1) cycle
                step = turn_step
                if (model%scene%coordinate(k)%unit == "m") step = length_step*scene_size(model)
                state%q(lane, k) = q(k, 1) + step*(2*modulo(number*golden*(k + 1) + 0.37_wp*k, 1.0_wp) - 1)
            end do
        end do
        state%qd = 0
        state%qdd = 0
    end subroutine candidate_poses
end module linkdyn_representatives
