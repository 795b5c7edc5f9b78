!> Do the joints of an over-constrained mechanism that let go of what others hold fit as the links move?
!>
!> Joints may fit in a pose alone: a platform on rods of one length, between rings of one size, has three freedoms by its rates
!> where its rods are lines of a hyperboloid, and one on the way from there. Sides of joints then part, by the first rates or by
!> the second.
module linkdyn_released_motion
    use linkdyn_joint_motion, only: turn_frame
    use linkdyn_joint_table, only: force_directions, moment_directions, is_geared, &
        along_z, along_axes, along_x_and_y, along_normal
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state
    use linkdyn_lane_count, only: lanes
    use linkdyn_marker_motion, only: link_origin, link_axes, link_turning, turning_seen, carried_point
    use linkdyn_model, only: model_type, is_released, scene_size, parts_slowly, parts_gently, stands_still
    use linkdyn_planar_motion, only: level_velocity, level_given
    use linkdyn_vec3, only: vec3, mat3, zero_vec3, operator(+), operator(-), operator(*), operator(.dot.), operator(.cross.), &
        operator(.rotate.)
    implicit none (type, external)
    private
    public :: released_joints_stay

    !> How the second link of a joint moves, as the first one sees it, at the second's marker.
    type :: parting_type
        type(mat3) :: first, second                    !! the markers' frames, world axes
        type(vec3) :: rate, omega                      !! [m/s], [rad/s]
        type(vec3) :: rate2, alpha                     !! [m/s2], [rad/s2]
    end type parting_type

contains

    !> Do they keep together by their rates, and by the second ones?
    function released_joints_stay(model, state, has_accelerations) result(stay)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        logical, intent(in) :: has_accelerations       !! that the motion gives
        logical :: stay(lanes)
        real(wp), dimension(lanes) :: speed, change, fastest, strongest
        type(parting_type) :: parting
        integer :: j

        stay = .true.
        if (model%share%n == 0) return
        call measure_motion(model, state, model%share%link, has_accelerations, speed, change)
        call measure_motion(model, state, [(j, j=1, model%n_link)], has_accelerations, fastest, strongest)
        do j = 1, model%n_joint
            if (.not. is_released(model%joint(j)) .or. is_geared(model%joint(j)%told_kind)) cycle
            call find_parting(model, state, j, has_accelerations, parting)
            stay = stay .and. parting_by(model, j, parting, parting%rate, parting%omega) &
                   <= parts_slowly*speed + stands_still*fastest
            if (.not. has_accelerations) cycle
            stay = stay .and. parting_by(model, j, parting, parting%rate2, parting%alpha, parting%omega) &
                   <= parts_gently*change + stands_still*strongest
        end do
    end function released_joints_stay

    !> How fast links move, and how that changes. A turning counts at the mechanism's size.
    subroutine measure_motion(model, state, link, has_accelerations, speed, change)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        integer, intent(in) :: link(:)
        logical, intent(in) :: has_accelerations
        real(wp), dimension(lanes), intent(out) :: speed, change    !! [m/s], [m/s2]
        integer :: i

        speed = 0
        change = 0
        do i = 1, size(link)
            speed = speed + square_of(link(i), level_velocity)
            if (has_accelerations) change = change + square_of(link(i), level_given)
        end do
        change = sqrt(change) + speed/scene_size(model)
        speed = sqrt(speed)

    contains

        function square_of(link, level) result(square)
            integer, intent(in) :: link, level
            real(wp) :: square(lanes)
            type(vec3) :: linear, angular

            linear = carried_point(model, state, link, zero_vec3(), level)
            angular = link_turning(model, state, link, level)
            square = (linear.dot.linear) + scene_size(model)**2*(angular.dot.angular)
        end function square_of
    end subroutine measure_motion

    subroutine find_parting(model, state, j, has_accelerations, parting)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        integer, intent(in) :: j
        logical, intent(in) :: has_accelerations
        type(parting_type), intent(out) :: parting
        type(vec3) :: arm(2), of_first

        associate (joint => model%joint(j), link => model%joint(j)%link)
            parting%first = turn_frame(link_axes(model, state, link(1)), joint%told_frame(:, :, 1))
            parting%second = turn_frame(link_axes(model, state, link(2)), joint%told_frame(:, :, 2))
            ! the first link is felt at the second's marker
            arm(2) = link_axes(model, state, link(2)) .rotate.joint%point(:, 2)
            arm(1) = link_origin(model, state, link(2)) + arm(2) - link_origin(model, state, link(1))
            parting%rate = carried_point(model, state, link(2), arm(2), level_velocity) &
                           - carried_point(model, state, link(1), arm(1), level_velocity)
            parting%omega = turning_seen(model, state, link, level_velocity)
            if (.not. has_accelerations) return
            of_first = link_turning(model, state, link(1), level_velocity)
            parting%rate2 = carried_point(model, state, link(2), arm(2), level_given) &
                            - carried_point(model, state, link(1), arm(1), level_given) - 2.0_wp*(of_first.cross.parting%rate)
            parting%alpha = turning_seen(model, state, link, level_given)
        end associate
    end subroutine find_parting

    !> How much of a motion, or of its acceleration, is along directions that the joint of the scene holds. [m/s] or [m/s2]
    function parting_by(model, j, parting, shift, turn, omega) result(most)
        type(model_type), intent(in) :: model
        integer, intent(in) :: j
        type(parting_type), intent(in) :: parting
        type(vec3), intent(in) :: shift, turn
        type(vec3), intent(in), optional :: omega      !! of accelerations: with what angular velocity it turns
        real(wp) :: most(lanes), leaning(lanes)

        most = 0
        associate (kind => model%joint(j)%told_kind, a => parting%first, b => parting%second)
            if (any(force_directions(kind) == [along_axes, along_x_and_y])) most = max(abs(a%x.dot.shift), abs(a%y.dot.shift))
            if (any(force_directions(kind) == [along_axes, along_z])) most = max(most, abs(a%z.dot.shift))
            leaning = 0
            select case (moment_directions(kind))
            case (along_normal)
                leaning = (b%z.cross.a%z) .dot.turn
                if (present(omega)) leaning = leaning + (a%z.dot.omega)*(b%z.dot.omega)
            case (along_axes, along_x_and_y)
                leaning = max(abs(a%x.dot.turn), abs(a%y.dot.turn))
                if (moment_directions(kind) == along_axes) leaning = max(leaning, abs(a%z.dot.turn))
            end select
            most = max(most, scene_size(model)*abs(leaning))
        end associate
    end function parting_by
end module linkdyn_released_motion
