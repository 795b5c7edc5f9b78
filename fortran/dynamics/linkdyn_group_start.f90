!> The assembly of a spatial group at the start, found by many attempts side by side on the lanes.
!>
!> The first attempt sets out from the starting positions of the links, the second from links strung along the joints with
!> the joints' starting variables, the others from variables at random. Each is closed by Newton's method; of the assemblies
!> found the one nearest to what the scene says of the start is taken. The outcome depends on the scene alone.
module linkdyn_group_start
    use, intrinsic :: iso_fortran_env, only: int64
    use linkdyn_constants, only: pi
    use linkdyn_joint_motion, only: relative_motion, relative_by_variables, turn_frame, turn_frame_back, is_slide
    use linkdyn_joint_rates, only: measure_joints
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_pass, only: clear_flags, run_step
    use linkdyn_kinematic_state, only: kinematic_state
    use linkdyn_lane_count, only: lanes
    use linkdyn_mix, only: counter_uniform
    use linkdyn_model, only: model_type, group_type, step_type, orientation_of, place_size, scene_size
    use linkdyn_quaternion, only: quaternion_of_rpy, quaternion_of_rotation, rotation_of_quaternion
    use linkdyn_scene, only: joint_n_variable, joint_universal, joint_spherical
    use linkdyn_vec3, only: mat3, vec3, operator(+), operator(-), operator(*), operator(.dot.), operator(.rotate.)
    implicit none (type, external)
    private
    public :: find_group_start

    integer, parameter :: n_attempt = 64

contains

    !> Leave the group closed on every lane of the state; flagged `not_converged` if no attempt succeeds.
    subroutine find_group_start(model, step, state)
        type(model_type), intent(in) :: model
        type(step_type), intent(in) :: step
        type(kinematic_state), intent(inout) :: state      !! the steps before have been run, all lanes alike
        real(wp) :: distance(lanes), nearest, best(place_size(model), model%n_link)
        logical :: has_closed(lanes), has_link_start
        integer :: first, lane

        associate (group => model%group(step%first))
            has_link_start = any(model%scene%link(group%link)%has_start)
            nearest = huge(1.0_wp)
            do first = 1, n_attempt, lanes
                call string_links(model, group, first, state)
                if (first == 1) call put_as_given(model, group, state)
                call clear_flags(state)
                call run_step(model, step, state)
                has_closed = .not. (state%not_converged .or. state%singular)
                distance = distance_to_start(model, group, has_link_start, state)
                if (first == 1 .and. has_link_start .and. has_closed(1)) distance(1) = -1
                do lane = 1, min(lanes, n_attempt - first + 1)
                    if (.not. has_closed(lane) .or. .not. distance(lane) < nearest) cycle
                    nearest = distance(lane)
                    best = state%group%place(lane, :, :)
                end do
                if (nearest < 0) exit
            end do
            if (nearest == huge(1.0_wp)) return
            state%group%place = spread(best, 1, lanes)
            call clear_flags(state)
            call run_step(model, step, state)
        end associate
    end subroutine find_group_start

    !> The first attempt: the links' starting positions, else where their markers are written.
    subroutine put_as_given(model, group, state)
        type(model_type), intent(in) :: model
        type(group_type), intent(in) :: group
        type(kinematic_state), intent(inout) :: state
        real(wp) :: quaternion(lanes, 4)
        integer :: i

        do i = 1, size(group%link)
            associate (start => model%scene%link(group%link(i))%start)
                quaternion = given_quaternion(start)
                state%group%place(1, :, group%link(i)) = [start(:3), quaternion(1, :)]
            end associate
        end do
    end subroutine put_as_given

    function given_quaternion(start) result(quaternion)
        real(wp), intent(in) :: start(6)       !! x y z roll pitch yaw
        real(wp) :: quaternion(lanes, 4)

        quaternion = quaternion_of_rpy(spread(start(4), 1, lanes), spread(start(5), 1, lanes), spread(start(6), 1, lanes))
    end function given_quaternion

    ! ---------------------------------------------------------------- links along joints

    !> Attempts `first`, `first + 1`, ...: each link of the group placed through one of its joints.
    subroutine string_links(model, group, first, state)
        type(model_type), intent(in) :: model
        type(group_type), intent(in) :: group
        integer, intent(in) :: first
        type(kinematic_state), intent(inout) :: state
        logical :: is_placed(0:model%n_link)
        integer :: i, j, from, round

        is_placed = .true.
        is_placed(group%link) = .false.
        state%group%place = 0
        state%group%place(:, 4, :) = 1
        do round = 1, size(group%link)
            do i = 1, size(group%joint)
                j = group%joint(i)
                associate (link => model%joint(j)%link)
                    if (is_placed(link(1)) .eqv. is_placed(link(2))) cycle
                    from = merge(1, 2, is_placed(link(1)))
                    call hang_link(model, group, j, from, variables(i), state)
                    is_placed(link(3 - from)) = .true.
                end associate
            end do
        end do

    contains

        !> Of joint i of the group: given by a coordinate, else its start, and beyond the second attempt any.
        function variables(i) result(q)
            integer, intent(in) :: i
            real(wp) :: q(lanes, 3), reach
            integer :: v, lane, attempt

            q = 0
            associate (spec => model%scene%joint(group%joint(i)))
                do v = 1, joint_n_variable(spec%kind)
                    if (group%coordinate(v, i) > 0) then
                        q(:, v) = state%q(:, group%coordinate(v, i))
                        cycle
                    end if
                    reach = merge(scene_size(model), pi, is_slide(spec%kind, v))
                    do lane = 1, lanes
                        attempt = first + lane - 1
                        q(lane, v) = spec%start(v)
                        if (attempt > 2) q(lane, v) = q(lane, v) + reach &
                                     *(2*counter_uniform(int(group%joint(i), int64), int(v, int64), int(attempt, int64)) - 1)
                    end do
                end do
            end associate
        end function variables
    end subroutine string_links

    !> The link on the other side of a joint, from the link at side `from`.
    subroutine hang_link(model, group, j, from, variable, state)
        type(model_type), intent(in) :: model
        type(group_type), intent(in) :: group
        integer, intent(in) :: j, from
        real(wp), intent(in) :: variable(lanes, 3)
        type(kinematic_state), intent(inout) :: state
        type(relative_motion) :: motion
        type(mat3) :: frame, r
        type(vec3) :: origin
        real(wp) :: q(lanes, 3), zero(lanes, 3)
        integer :: known, link, o

        associate (joint => model%joint(j))
            known = joint%link(from)
            link = joint%link(3 - from)
            o = orientation_of(model, link)
            ! Walked backwards, revolute, prismatic and cylindrical joints have their variables reversed; of universal and
            ! spherical joints some attitude is taken.
            q = merge(variable, -variable, from == 1)
            zero = 0
            frame = turn_frame(state%rotation(orientation_of(model, known)), joint%frame(:, :, from))
            call relative_by_variables(joint%kind, frame, q, zero, zero, motion)
            r = state%rotation(o)
            if (group%turns(findloc(group%link, link, dim=1))) r = turn_frame_back(motion%frame, joint%frame(:, :, 3 - from))
            state%rotation(o) = r
            origin = state%position(known) + (state%rotation(orientation_of(model, known)).rotate.joint%point(:, from)) &
                     + motion%slide - (r.rotate.joint%point(:, 3 - from))
            state%position(link) = origin
            associate (place => state%group%place)
                place(:, 1, link) = origin%x
                place(:, 2, link) = origin%y
                place(:, 3, link) = origin%z
                place(:, 4:, link) = quaternion_of_rotation(r)
            end associate
        end associate
    end subroutine hang_link

    ! ---------------------------------------------------------------- distance

    !> How far each lane is from what the scene says: of the links' starts if it gives any, else of the joints', which are
    !> zero where not given. Angles as chords, lengths as parts of the mechanism's size.
    function distance_to_start(model, group, has_link_start, state) result(distance)
        type(model_type), intent(in) :: model
        type(group_type), intent(in) :: group
        logical, intent(in) :: has_link_start
        type(kinematic_state), intent(in) :: state
        real(wp) :: distance(lanes)
        real(wp), dimension(lanes, model%n_variable) :: variable, rate
        type(mat3) :: r
        type(vec3) :: gap
        integer :: i, v

        distance = 0
        do i = 1, size(group%link)
            associate (l => group%link(i), spec => model%scene%link(group%link(i)))
                if (.not. spec%has_start) cycle
                gap = state%position(l)
                distance = distance + ((gap%x - spec%start(1))**2 + (gap%y - spec%start(2))**2 + (gap%z - spec%start(3))**2) &
                           /scene_size(model)**2
                r = rotation_of_quaternion(given_quaternion(spec%start))
                associate (here => state%rotation(orientation_of(model, l)))
                    distance = distance + 3 - (here%x.dot.r%x) - (here%y.dot.r%y) - (here%z.dot.r%z)
                end associate
            end associate
        end do
        call measure_joints(model, state, variable, rate)
        do i = 1, size(group%joint)
            associate (spec => model%scene%joint(group%joint(i)), first => model%joint(group%joint(i))%first_variable)
                if (.not. spec%has_start .and. (has_link_start .or. any(spec%kind == [joint_universal, joint_spherical]))) cycle
                do v = 1, joint_n_variable(spec%kind)
                    if (is_slide(spec%kind, v)) then
                        distance = distance + ((variable(:, first + v) - spec%start(v))/scene_size(model))**2
                    else
                        distance = distance + 2 - 2*cos(variable(:, first + v) - spec%start(v))
                    end if
                end do
            end associate
        end do
    end function distance_to_start
end module linkdyn_group_start
