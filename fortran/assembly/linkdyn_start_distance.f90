!> How far an assembly is from what the scene says of its start: which of several is the nearest.
!>
!> A joint counts the squares of its variables' differences from its `start`, an angle within half a turn, a slide as a
!> part of the mechanism's size; a link that of its origin from its `start`, likewise, and of the angle between both
!> attitudes. A link that may spin idly counts by its line alone, and so does a ball joint of it. First counts what has a `start`.
!> Only where that does not tell assemblies apart the other joints do, from zero.
module linkdyn_start_distance
    use linkdyn_joint_table, only: is_slide, is_threaded, is_pose_part
    use linkdyn_joint_rates, only: measure_one_joint
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state
    use linkdyn_lane_count, only: lanes
    use linkdyn_model, only: model_type, orientation_of, scene_size
    use linkdyn_quaternion, only: quaternion_of_rpy, quaternion_of_rotation, rotation_of_quaternion, turn_between
    use linkdyn_scene, only: joint_n_variable, joint_spherical
    use linkdyn_vec3, only: vec3, mat3, vec3_of, operator(+), operator(-), operator(.dot.), operator(.rotate.), operator(.unrotate.)
    use linkdyn_whole_turns, only: least_angle
    implicit none (type, external)
    private
    public :: start_distance, measure_distance, is_nearer, has_start

    !> Distance of one assembly on each lane from the start that is asked for.
    type :: start_distance
        real(wp) :: given(lanes) = 0       !! from what has a start
        real(wp) :: others(lanes) = 0      !! of the other joints, from zero
    end type start_distance

contains

    !> Does the scene say anything of the start of some links and joints?
    pure logical function has_start(model, link, joint)
        type(model_type), intent(in) :: model
        integer, intent(in) :: link(:), joint(:)

        has_start = any(model%scene%link(link)%has_start) .or. any(model%joint(joint)%has_start)
    end function has_start

    !> Distance of some links and the joints between them.
    function measure_distance(model, link, joint, state, as_written) result(distance)
        type(model_type), intent(in) :: model
        integer, intent(in) :: link(:), joint(:)
        type(kinematic_state), intent(in) :: state
        logical, intent(in) :: as_written      !! links without a start count, too, from where their markers are written
        type(start_distance) :: distance
        real(wp) :: square(lanes)
        integer :: i

        do i = 1, size(link)
            if (.not. (as_written .or. model%scene%link(link(i))%has_start)) cycle
            distance%given = distance%given + square_of_link(model, link(i), state)
        end do
        do i = 1, size(joint)
            if (is_pose_part(model%joint(joint(i))%kind)) cycle
            square = square_of_joint(model, joint(i), state)
            if (spins(model, joint(i))) then
                ! an idle spin counts last
                if (model%joint(joint(i))%has_start) distance%others = distance%others + square
                square = square_of_lines(model, joint(i), state)
            end if
            if (model%joint(joint(i))%has_start) then
                distance%given = distance%given + square
            else
                distance%others = distance%others + square
            end if
        end do
    end function measure_distance

    !> How far a link is from where the scene draws it: lengths in the mechanism's size, with the angle of the turn, squared.
    function square_of_link(model, l, state) result(square)
        type(model_type), intent(in) :: model
        integer, intent(in) :: l
        type(kinematic_state), intent(in) :: state
        real(wp) :: square(lanes), turn(lanes, 3), attitude(lanes, 4)
        type(vec3) :: off
        integer :: o

        o = orientation_of(model, l)
        associate (start => model%scene%link(l)%start)
            if (model%is_planar) then
                associate (p => state%plane%position(l), r => state%plane%rotation(o))
                    square = ((p%x - start(1))**2 + (p%y - start(2))**2)/scene_size(model)**2 &
                             + atan2(r%s*cos(start(6)) - r%c*sin(start(6)), r%c*cos(start(6)) + r%s*sin(start(6)))**2
                end associate
            else
                attitude = quaternion_of_rpy(spread(start(4), 1, lanes), spread(start(5), 1, lanes), spread(start(6), 1, lanes))
                off = state%position(l) - vec3_of(start(:3))
                if (model%link(l)%spin > 0) then
                    associate (line => model%link(l), now => state%rotation(o), written => rotation_of_quaternion(attitude))
                        off = off + ((now.rotate.line%spin_point) - (written.rotate.line%spin_point))
                        square = angle_between(now.rotate.line%spin_axis, written.rotate.line%spin_axis)**2
                    end associate
                else
                    turn = turn_between(attitude, quaternion_of_rotation(state%rotation(o)))
                    square = sum(turn**2, dim=2)
                end if
                square = square + (off.dot.off)/scene_size(model)**2
            end if
        end associate
    end function square_of_link

    function square_of_joint(model, j, state) result(square)
        type(model_type), intent(in) :: model
        integer, intent(in) :: j
        type(kinematic_state), intent(in) :: state
        real(wp) :: square(lanes)
        real(wp) :: variable(lanes, 3), rate(lanes, 3), off(lanes)
        integer :: v

        call measure_one_joint(model, state, j, variable, rate)
        square = 0
        associate (joint => model%joint(j))
            do v = 1, joint_n_variable(joint%told_kind)
                off = variable(:, v) - joint%start(v)
                if (is_slide(joint%told_kind, v)) then
                    off = off/scene_size(model)
                else if (is_threaded(joint%told_kind)) then
                    off = off*joint%pitch/scene_size(model)    ! turns count as the way that they go
                else
                    off = least_angle(off)
                end if
                square = square + off**2
            end do
        end associate
    end function square_of_joint

    !> Is a joint a ball of a link that may spin idly?
    pure logical function spins(model, j)
        type(model_type), intent(in) :: model
        integer, intent(in) :: j

        spins = model%joint(j)%told_kind == joint_spherical .and. any(spin_of(model, j) > 0)
    end function spins

    !> The idle spins of a joint's links; 0: none.
    pure function spin_of(model, j) result(spin)
        type(model_type), intent(in) :: model
        integer, intent(in) :: j
        integer :: spin(2), side

        spin = 0
        do side = 1, 2
            associate (link => model%joint(j)%link(side))
                if (link > 0) spin(side) = model%link(link)%spin
            end associate
        end do
    end function spin_of

    !> Distance of a joint with a link that spins: by the line of the link that spins as the other link sees it; if both spin, by
    !> the angle between both lines.
    function square_of_lines(model, j, state) result(square)
        type(model_type), intent(in) :: model
        integer, intent(in) :: j
        type(kinematic_state), intent(in) :: state
        real(wp) :: square(lanes)
        real(wp) :: variable(lanes, 3), rate(lanes, 3)
        type(mat3) :: now, at_start
        real(wp) :: line(3, 2)
        integer :: side

        call measure_one_joint(model, state, j, variable, rate)
        now = rotation_of_quaternion(quaternion_of_rpy(variable(:, 1), variable(:, 2), variable(:, 3)))
        associate (start => spread(model%joint(j)%start, 1, lanes))
            at_start = rotation_of_quaternion(quaternion_of_rpy(start(:, 1), start(:, 2), start(:, 3)))
        end associate
        do side = 1, 2
            line(:, side) = 0
            if (model%joint(j)%link(side) == 0) cycle
            line(:, side) = matmul(transpose(model%joint(j)%told_frame(:, :, side)), &
                                   model%link(model%joint(j)%link(side))%spin_axis)
        end do
        associate (spin => spin_of(model, j), a => vec3_of(line(:, 1)), b => vec3_of(line(:, 2)))
            if (all(spin > 0)) then
                square = (angle_between(a, now.rotate.b) - angle_between(a, at_start.rotate.b))**2
            else if (spin(1) > 0) then
                square = angle_between(now.unrotate.a, at_start.unrotate.a)**2
            else
                square = angle_between(now.rotate.b, at_start.rotate.b)**2
            end if
        end associate
    end function square_of_lines

    !> Angle between two unit vectors.
    pure function angle_between(a, b) result(angle)
        type(vec3), intent(in) :: a, b
        real(wp) :: angle(lanes)
        type(vec3) :: apart, together

        apart = a - b
        together = a + b
        angle = 2*atan2(sqrt(apart.dot.apart), sqrt(together.dot.together))
    end function angle_between

    !> Is the assembly on a lane nearer than the nearest so far? Differences that rounding makes do not count: of equals the first
    !> stays.
    pure logical function is_nearer(distance, lane, given, others)
        type(start_distance), intent(in) :: distance
        integer, intent(in) :: lane
        real(wp), intent(in) :: given, others      !! of the nearest so far; huge: none
        real(wp), parameter :: tie = 1.0e-6_wp

        is_nearer = distance%given(lane) < given - tie
        if (abs(distance%given(lane) - given) <= tie) is_nearer = distance%others(lane) < others - tie
    end function is_nearer
end module linkdyn_start_distance
