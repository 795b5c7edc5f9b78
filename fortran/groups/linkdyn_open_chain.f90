!> Steps that place one link by coordinates: a pose that is given, and a link behind a joint, or behind the parts of a pose, whose
!> variables are.
module linkdyn_open_chain
    use linkdyn_attitude, only: rotation_by_angles, rotation_by_quaternion, rotation_in_plane, angular_velocity, &
        angular_acceleration
    use linkdyn_bodies, only: world_axes, own_axes, set_vector, omega_of, alpha_of, rotation_of, acceleration_of_origin, &
        acceleration_field, field_times
    use linkdyn_joint_kind, only: joint_shift
    use linkdyn_kinds, only: wp
    use linkdyn_mechanism, only: mechanism_type, marker_point, marker_frame, gravity_of
    use linkdyn_model, only: step_type
    use linkdyn_rates, only: rate_of
    use linkdyn_value, only: value, zero, operator(+), operator(-), operator(*)
    use linkdyn_vector, only: vector, rotation, vector_of, zero_vector, unit_vector, identity_rotation, operator(+), &
        operator(-), operator(*), operator(.cross.), operator(.rotate.), operator(.unrotate.)
    implicit none (type, external)
    private
    public :: take_pose, take_parts, walk_joint, walk_hinge, walk_slide

contains

    !> A link whose pose is given: x y z roll pitch yaw and their rates. With a quaternion, position and quaternion, and
    !> the rates are velocity and angular velocity.
    subroutine take_pose(mechanism, step, quaternion)
        type(mechanism_type), intent(inout) :: mechanism
        type(step_type), intent(in) :: step
        type(value), intent(in), optional :: quaternion(4)
        type(value), dimension(6) :: q, qd, qdd
        integer :: k

        do k = 1, 6
            q(k) = zero()
            qd(k) = zero()
            qdd(k) = zero()
            if (step%coordinate(k) == 0) cycle         ! in a plane there are x, y, yaw only
            q(k) = mechanism%q(step%coordinate(k))
            qd(k) = mechanism%qd(step%coordinate(k))
            qdd(k) = mechanism%qdd(step%coordinate(k))
        end do
        associate (body => mechanism%bodies%body(step%link(1)))
            body%position = vector_of(q(1:3))
            body%velocity = vector_of(qd(1:3))
            call set_vector(body%acceleration, world_axes, vector_of(qdd(1:3)) - gravity_of(mechanism))
            associate (turning => mechanism%bodies%turning(body%turning))
                if (present(quaternion)) then
                    turning%r = rotation_by_quaternion(quaternion)
                    call set_vector(turning%omega, world_axes, vector_of(qd(4:6)))
                    call set_vector(turning%alpha, world_axes, vector_of(qdd(4:6)))
                else
                    turning%r = rotation_by_angles(q(4:6))
                    call set_vector(turning%omega, world_axes, angular_velocity(q(4:6), qd(4:6)))
                    call set_vector(turning%alpha, world_axes, angular_acceleration(q(4:6), qd(4:6), qdd(4:6)))
                end if
            end associate
        end associate
    end subroutine take_pose

    !> A link whose parts of a pose, of a point and of the attitude, both as a known link sees them, give all of it; or of a point
    !> alone, where the link turns as the known one does.
    subroutine take_parts(mechanism, step, quaternion)
        type(mechanism_type), intent(inout) :: mechanism
        type(step_type), intent(in) :: step                !! joints: position, attitude
        type(value), intent(in), optional :: quaternion(4)    !! see `walk_joint`
        type(value), dimension(6) :: q, qd
        integer :: k

        do k = 1, 6
            q(k) = zero()
            qd(k) = zero()
            if (step%coordinate(k) == 0) cycle             ! in a plane there are x, y, yaw only
            q(k) = mechanism%q(step%coordinate(k))
            qd(k) = mechanism%qd(step%coordinate(k))
        end do
        if (step%joint(2) > 0) then
            call walk_joint(mechanism, step%joint(1), .false., q, qd, quaternion, step%joint(2))
        else
            call shift_along(mechanism, step%joint(1), q(:3))
        end if
    end subroutine take_parts

    !> A link that turns as the known one does and has a point of it as far from a point of that one as given.
    subroutine shift_along(mechanism, j, q)
        type(mechanism_type), intent(inout) :: mechanism
        integer, intent(in) :: j                           !! part of a pose: the position
        type(value), intent(in) :: q(3)                    !! axes of the first marker [m]
        type(rotation) :: frame(2)
        type(vector) :: s(3), rest(2)

        ! it is traced in axes that are parallel to those in which the scene has the known link
        frame = [marker_frame(mechanism, j, 1), mechanism%own(mechanism%model%joint(j)%link(1))%r*marker_frame(mechanism, j, 2)]
        s(1) = vector_of(q)
        s(2) = rate_of_vector(mechanism, s(1))
        s(3) = rate_of_vector(mechanism, s(2))
        rest = zero_vector()
        call walk_shift(mechanism, j, .false., rotation(frame(1) .unrotate.frame(2)%x, frame(1) .unrotate.frame(2)%y, &
                                                        frame(1) .unrotate.frame(2)%z), rest, s)
    end subroutine shift_along

    !> The link behind a joint whose variables and rates are known.
    !> Of a position without attitude another joint between the same links gives the turn.
    subroutine walk_joint(mechanism, j, from_second, q, qd, quaternion, attitude)
        type(mechanism_type), intent(inout) :: mechanism
        integer, intent(in) :: j                       !! joint
        logical, intent(in) :: from_second             !! its second link is known, the first is placed
        type(value), intent(in) :: q(:), qd(:)         !! its variables, whose rates the mechanism knows [m, rad]
        type(value), intent(in), optional :: quaternion(:)    !! attitude of a ball joint, or of that other one; the rates are then
                                                              !! about
                                                       !! the first marker's axes
        integer, intent(in), optional :: attitude      !! that other joint, whose variables follow
        type(joint_shift) :: shift
        type(vector) :: w(2), s(3)
        integer :: k, turner, n_before

        turner = j
        n_before = 0
        if (present(attitude)) then
            turner = attitude
            n_before = mechanism%kind(j)%is%n_variable
        end if
        associate (kind => mechanism%kind(turner)%is)
            shift = kind%shift(q(n_before + 1:))
            if (present(quaternion)) then
                shift%turn = rotation_by_quaternion(quaternion)
                shift%axis = [unit_vector(1), unit_vector(2), unit_vector(3)]
            end if
            w(1) = zero_vector()
            do k = 1, kind%n_variable
                if (.not. kind%is_slide(k)) w(1) = w(1) + qd(n_before + k)*shift%axis(k)
            end do
            w(2) = rate_of_vector(mechanism, w(1))
            s(1) = shift%slide
            if (n_before > 0) s(1) = vector_of(q(:n_before))
            s(2) = rate_of_vector(mechanism, s(1))
            s(3) = rate_of_vector(mechanism, s(2))
        end associate
        call walk_shift(mechanism, j, from_second, shift%turn, w, s, turner)
    end subroutine walk_joint

    !> The link at a side of a hinge, from the angle by which it is turned against the other link. The joint counts its second link
    !> against its first.
    subroutine walk_hinge(mechanism, j, side, cosine, sine, rates)
        type(mechanism_type), intent(inout) :: mechanism
        integer, intent(in) :: j, side
        type(value), intent(in) :: cosine, sine, rates(2)
        type(vector) :: rest(3)

        rest = zero_vector()
        if (side == 1) then
            call walk_shift(mechanism, j, .true., rotation_in_plane(cosine, -sine), [-rates(1), -rates(2)]*unit_vector(3), rest)
        else
            call walk_shift(mechanism, j, .false., rotation_in_plane(cosine, sine), rates*unit_vector(3), rest)
        end if
    end subroutine walk_hinge

    !> The link at a side of a slide, from how far it is along the axis from the other link, and the rates of that.
    subroutine walk_slide(mechanism, j, side, slide)
        type(mechanism_type), intent(inout) :: mechanism
        integer, intent(in) :: j, side
        type(value), intent(in) :: slide(3)
        type(vector) :: rest(2)

        rest = zero_vector()
        if (side == 1) then
            call walk_shift(mechanism, j, .true., identity_rotation(), rest, [-slide(1), -slide(2), -slide(3)]*unit_vector(3))
        else
            call walk_shift(mechanism, j, .false., identity_rotation(), rest, slide*unit_vector(3))
        end if
    end subroutine walk_slide

    !> The link behind a joint of which is known how it is turned and slid.
    !>
    !> With A the joint's first link and B its second, M their markers' frames, turn and slide s those of the joint, w the
    !> sum of the variables' axes times their rates, all in the first marker's axes:
    !>
    !>     R_B = R_A M_A turn M_B^T        omega_B = omega_A + M_A w        point of B's marker = point of A's + M_A s
    !>
    !> Either link may be the one known before.
    subroutine walk_shift(mechanism, j, from_second, marker_turn, rates, slide, attitude)
        type(mechanism_type), intent(inout) :: mechanism
        integer, intent(in) :: j                       !! joint
        logical, intent(in) :: from_second             !! B is known, A is placed
        type(rotation), intent(in) :: marker_turn      !! of the second marker, axes of the first
        type(vector), intent(in) :: rates(2)           !! w and its rate, axes of the first marker [rad/s, rad/s2]
        type(vector), intent(in) :: slide(3)           !! s, its rate and second rate, likewise [m, m/s, m/s2]
        integer, intent(in), optional :: attitude      !! joint between the same links whose markers' axes are meant; absent: j
        type(rotation) :: frame_a, frame_b, turn
        type(vector) :: arm_a, arm_b, w(2), s(3)       ! axes of A
        integer :: a, b, axes, turner

        turner = j
        if (present(attitude)) turner = attitude
        a = mechanism%model%joint(j)%link(1)
        b = mechanism%model%joint(j)%link(2)
        frame_a = marker_frame(mechanism, turner, 1)
        frame_b = marker_frame(mechanism, turner, 2)
        arm_a = marker_point(mechanism, j, 1)
        arm_b = marker_point(mechanism, j, 2)
        mechanism%slide(j) = slide(1)
        s = frame_a.rotate.slide
        w = frame_a.rotate.rates
        turn = rotation(frame_a.rotate.unturned(marker_turn, frame_b, 1), frame_a.rotate.unturned(marker_turn, frame_b, 2), &
                        frame_a.rotate.unturned(marker_turn, frame_b, 3))
        if (from_second) then
            call place_first()
        else
            call place_second()
        end if

    contains

        !> The link on the second side of the joint, from that on the first one.
        subroutine place_second()
            logical :: turns

            associate (bodies => mechanism%bodies)
                turns = bodies%body(a)%turning /= bodies%body(b)%turning
                if (turns) then
                    associate (new => bodies%turning(bodies%body(b)%turning))
                        new%r = rotation_of(bodies, a)*turn
                        call set_vector(new%omega, own_axes, turn.unrotate.(omega_of(bodies, a, own_axes) + w(1)))
                        call set_vector(new%omega, world_axes, omega_of(bodies, a, world_axes) + in_world(a, w(1)))
                        call set_vector(new%alpha, own_axes, turn.unrotate.(alpha_of(bodies, a, own_axes) + w(2) &
                                                                            + (omega_of(bodies, a, own_axes) .cross.w(1))))
                        call set_vector(new%alpha, world_axes, alpha_of(bodies, a, world_axes) + in_world(a, w(2)) &
                                        + (omega_of(bodies, a, world_axes) .cross.in_world(a, w(1))))
                    end associate
                end if
                associate (body => bodies%body(b))
                    body%position = bodies%body(a)%position + in_world(a, arm_a + s(1)) - in_world(b, arm_b)
                    body%velocity = bodies%body(a)%velocity + (omega_of(bodies, a, world_axes) .cross.in_world(a, arm_a + s(1))) &
                                    + in_world(a, s(2)) - (omega_of(bodies, b, world_axes) .cross.in_world(b, arm_b))
                    do axes = world_axes, own_axes
                        call set_vector(body%acceleration, axes, through(axes) - carried(b, arm_b, axes))
                    end do
                end associate
            end associate
        end subroutine place_second

        !> Acceleration of B's marker point by A's motion, in the world's axes or B's.
        function through(axes) result(acceleration)
            integer, intent(in) :: axes
            type(vector) :: acceleration

            acceleration = acceleration_of_origin(mechanism%bodies, a, axes) + carried(a, arm_a + s(1), axes) + relative(axes)
            if (axes == own_axes .and. mechanism%bodies%body(a)%turning /= mechanism%bodies%body(b)%turning) &
                acceleration = turn.unrotate.acceleration
        end function through

        !> The link on the first side of the joint, from that on the other one.
        subroutine place_first()
            logical :: turns
            type(vector) :: point

            associate (bodies => mechanism%bodies)
                turns = bodies%body(a)%turning /= bodies%body(b)%turning
                if (turns) then
                    associate (new => bodies%turning(bodies%body(a)%turning))
                        new%r = rotation(rotation_of(bodies, b) .rotate.row(turn, 1), rotation_of(bodies, b) .rotate.row(turn, 2), &
                                         rotation_of(bodies, b) .rotate.row(turn, 3))
                        call set_vector(new%omega, own_axes, (turn.rotate.omega_of(bodies, b, own_axes)) - w(1))
                        call set_vector(new%omega, world_axes, omega_of(bodies, b, world_axes) - (new%r.rotate.w(1)))
                        call set_vector(new%alpha, own_axes, (turn.rotate.alpha_of(bodies, b, own_axes)) - w(2) &
                                        - (new%omega%v(own_axes) .cross.w(1)))
                        call set_vector(new%alpha, world_axes, alpha_of(bodies, b, world_axes) - (new%r.rotate.w(2)) &
                                        - (new%omega%v(world_axes) .cross.(new%r.rotate.w(1))))
                    end associate
                end if
                associate (body => bodies%body(a))
                    body%position = bodies%body(b)%position + in_world(b, arm_b) - in_world(a, arm_a + s(1))
                    body%velocity = bodies%body(b)%velocity + (omega_of(bodies, b, world_axes) .cross.in_world(b, arm_b)) &
                                    - in_world(a, s(2)) - (omega_of(bodies, a, world_axes) .cross.in_world(a, arm_a + s(1)))
                    do axes = world_axes, own_axes
                        point = acceleration_of_origin(bodies, b, axes) + carried(b, arm_b, axes)
                        if (axes == own_axes .and. turns) point = turn.rotate.point
                        call set_vector(body%acceleration, axes, point - carried(a, arm_a + s(1), axes) - relative(axes))
                    end do
                end associate
            end associate
        end subroutine place_first

        !> What the slide adds, seen from A: its own acceleration, and Coriolis.
        function relative(axes) result(acceleration)
            integer, intent(in) :: axes
            type(vector) :: acceleration
            type(vector) :: rate, rate2

            rate = s(2)
            rate2 = s(3)
            if (axes == world_axes) then
                rate = in_world(a, rate)
                rate2 = in_world(a, rate2)
            end if
            acceleration = rate2 + 2.0_wp*(omega_of(mechanism%bodies, a, axes) .cross.rate)
        end function relative

        !> F arm: acceleration of a point of a link, less that of its origin.
        function carried(link, arm, axes) result(acceleration)
            integer, intent(in) :: link, axes
            type(vector), intent(in) :: arm
            type(vector) :: acceleration
            type(vector) :: r

            r = arm
            if (axes == world_axes) r = in_world(link, arm)
            acceleration = field_times(acceleration_field(mechanism%bodies, link, axes), r)
        end function carried

        function in_world(link, v) result(w)
            integer, intent(in) :: link
            type(vector), intent(in) :: v
            type(vector) :: w

            w = rotation_of(mechanism%bodies, link) .rotate.v
        end function in_world
    end subroutine walk_shift

    !> Axis k of link B in the first marker's axes: turn M_B^T e_k.
    function unturned(turn, frame, k) result(v)
        type(rotation), intent(in) :: turn, frame
        integer, intent(in) :: k
        type(vector) :: v

        v = turn.rotate.row(frame, k)
    end function unturned

    !> Row k of a rotation: axis k of the axes that it starts from, seen in its own.
    function row(r, k) result(v)
        type(rotation), intent(in) :: r
        integer, intent(in) :: k
        type(vector) :: v

        select case (k)
        case (1)
            v = vector(r%x%x, r%y%x, r%z%x)
        case (2)
            v = vector(r%x%y, r%y%y, r%z%y)
        case default
            v = vector(r%x%z, r%y%z, r%z%z)
        end select
    end function row

    function rate_of_vector(mechanism, v) result(rate)
        type(mechanism_type), intent(inout) :: mechanism
        type(vector), intent(in) :: v
        type(vector) :: rate

        rate = vector(rate_of(mechanism%rates, v%x), rate_of(mechanism%rates, v%y), rate_of(mechanism%rates, v%z))
    end function rate_of_vector
end module linkdyn_open_chain
