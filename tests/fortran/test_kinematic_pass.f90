!> The kinematic pass: velocities, accelerations and columns of every link against differences along a smooth motion.
module test_kinematic_pass
    use linkdyn_builder, only: build_model
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state, prepare_kinematics
    use linkdyn_lane_count, only: lanes
    use linkdyn_led_mechanism, only: evaluate_kinematics
    use linkdyn_model, only: model_type
    use linkdyn_pose, only: rpy_rotation, rotate_rpy, angular_velocity_rpy
    use linkdyn_scene, only: scene_type, coordinate_pose
    use linkdyn_status, only: status_type
    use linkdyn_test_numbers, only: random_stream, eps, stencil, difference_step, difference_error, skew_part
    use linkdyn_test_scenes, only: stewart_scene, stewart_on_carriage, open_chain_scene
    use linkdyn_testing, only: test_error, unit_test, new_test, check, check_close
    use linkdyn_vec3, only: vec3, operator(+), operator(-), operator(*), operator(.unrotate.), lane_of, mat3_lane, zero_vec3
    implicit none (type, external)
    private
    public :: collect_kinematic_pass

contains

    subroutine collect_kinematic_pass(tests)
        type(unit_test), allocatable, intent(out) :: tests(:)

        tests = [ &
            new_test("Stewart platform", test_stewart), &
            new_test("Stewart platform on a carriage", test_carriage), &
            new_test("open chain", test_open_chain), &
            new_test("joints stay closed", test_closure), &
            new_test("column 0 alone is the same", test_one_column)]
    end subroutine collect_kinematic_pass

    subroutine test_stewart(error)
        type(test_error), intent(inout) :: error
        type(scene_type) :: scene

        call stewart_scene(scene, .false.)
        call compare(error, scene)
    end subroutine test_stewart

    subroutine test_carriage(error)
        type(test_error), intent(inout) :: error
        type(scene_type) :: scene

        call stewart_on_carriage(scene)
        call compare(error, scene)
    end subroutine test_carriage

    subroutine test_open_chain(error)
        type(test_error), intent(inout) :: error
        type(scene_type) :: scene

        call open_chain_scene(scene, .true.)
        call compare(error, scene)
    end subroutine test_open_chain

    ! ---------------------------------------------------------------- motion

    subroutine prepare(error, scene, n_column, model, state, seed)
        type(test_error), intent(inout) :: error
        type(scene_type), intent(in) :: scene
        logical, intent(in) :: n_column                       !! all columns, or column 0 alone
        type(model_type), intent(out) :: model
        type(kinematic_state), intent(out) :: state
        real(wp), allocatable, intent(out) :: seed(:, :, :)   !! mean, amplitude and phase (lane, n_q, 3)
        type(random_stream) :: stream
        type(status_type) :: status
        integer :: k

        call build_model(scene, model, status)
        call check(error, status%is_ok(), "planned: "//trim(status%message))
        call prepare_kinematics(model, merge(model%n_q, 0, n_column), state)
        allocate (seed(lanes, model%n_q, 3))
        seed = reshape(0.2_wp*stream%vector(size(seed)), shape(seed))
        do k = 1, model%n_q
            seed(:, k, 1) = seed(:, k, 1) + scene%coordinate(k)%start_position
        end do
    end subroutine prepare

    subroutine move(model, seed, t, state)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: seed(:, :, :), t
        type(kinematic_state), intent(inout) :: state

        state%q = seed(:, :, 1) + seed(:, :, 2)*sin(t + seed(:, :, 3))
        state%qd = seed(:, :, 2)*cos(t + seed(:, :, 3))
        state%qdd = -seed(:, :, 2)*sin(t + seed(:, :, 3))
        call evaluate_kinematics(model, state)
    end subroutine move

    ! ---------------------------------------------------------------- comparison

    subroutine compare(error, scene)
        type(test_error), intent(inout) :: error
        type(scene_type), intent(in) :: scene
        type(model_type) :: model
        type(kinematic_state) :: state
        real(wp), allocatable :: seed(:, :, :)

        call prepare(error, scene, .true., model, state, seed)
        if (allocated(error%message)) return
        call compare_rates(error, model, state, seed)
        call compare_columns(error, model, state, seed)
    end subroutine compare

    !> Velocities and accelerations against differences in time.
    subroutine compare_rates(error, model, state, seed)
        type(test_error), intent(inout) :: error
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(inout) :: state
        real(wp), intent(in) :: seed(:, :, :)
        real(wp) :: turning(3, 3, lanes, model%n_link)
        real(wp), dimension(3, lanes, model%n_link) :: velocity, acceleration, alpha
        real(wp) :: part, tol
        character(len=:), allocatable :: name
        integer :: i, k, l, o

        turning = 0
        velocity = 0
        acceleration = 0
        alpha = 0
        do k = -2, 2
            call move(model, seed, k*difference_step(), state)
            part = stencil(k)/difference_step()
            do i = 1, model%n_link
                o = model%link(i)%orientation
                do l = 1, lanes
                    turning(:, :, l, i) = turning(:, :, l, i) + part*mat3_lane(state%rotation(o), l)
                    velocity(:, l, i) = velocity(:, l, i) + part*lane_of(state%position(i), l)
                    acceleration(:, l, i) = acceleration(:, l, i) + part*lane_of(state%velocity(i), l)
                    alpha(:, l, i) = alpha(:, l, i) + part*lane_of(state%omega(o), l)
                end do
            end do
        end do

        call move(model, seed, 0.0_wp, state)
        tol = 1000*difference_error()
        call check(error, .not. any(state%unreachable), "reachable")
        do i = 1, model%n_link
            o = model%link(i)%orientation
            name = trim(model%link(i)%name)
            do l = 1, lanes
                call check_close(error, lane_of(state%velocity(i), l), velocity(:, l, i), tol, name//": velocity")
                call check_close(error, lane_of(state%acceleration(0, i), l), acceleration(:, l, i), tol, name//": acceleration")
                call check_close(error, lane_of(state%omega(o), l), &
                                 skew_part(mat3_lane(state%rotation(o), l), turning(:, :, l, i)), tol, name//": omega")
                call check_close(error, lane_of(state%alpha(0, o), l), alpha(:, l, i), tol, name//": alpha")
                call check_close(error, lane_of(state%omega_body(o), l), &
                                 lane_of(state%rotation(o) .unrotate.state%omega(o), l), 100*eps, name//": omega in link axes")
                call check_close(error, lane_of(state%alpha_body(0, o), l), &
                                 lane_of(state%rotation(o) .unrotate.state%alpha(0, o), l), 100*eps, name//": alpha in link axes")
                call check_close(error, lane_of(state%acceleration_body(0, i), l), &
                                 lane_of(state%rotation(o) .unrotate.state%acceleration(0, i), l), 100*eps, &
                                 name//": acceleration in link axes")
            end do
        end do
        call check(error, maxval(abs(velocity)) > 0.01_wp .and. maxval(abs(alpha)) > 0.01_wp, "something moves")
    end subroutine compare_rates

    !> A unit more of one coordinate's second derivative: the difference of accelerations is its column, or, for an
    !> angle of a pose, the sum of the columns along its axis.
    subroutine compare_columns(error, model, state, seed)
        type(test_error), intent(inout) :: error
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(inout) :: state
        real(wp), intent(in) :: seed(:, :, :)
        type(vec3) :: acceleration(model%n_link), alpha(0:model%n_orientation), want
        real(wp) :: weight(lanes, model%n_q), kept(lanes)
        character(len=:), allocatable :: name
        integer :: i, k, l, o

        call move(model, seed, 0.0_wp, state)
        acceleration = state%acceleration(0, 1:)
        alpha = state%alpha(0, :)
        do k = 1, model%n_q
            call weights(model, state, k, weight)
            kept = state%qdd(:, k)
            state%qdd(:, k) = state%qdd(:, k) + 1
            call evaluate_kinematics(model, state)
            do i = 1, model%n_link
                o = model%link(i)%orientation
                name = trim(model%link(i)%name)//", "//trim(model%scene%coordinate(k)%name)
                want = combination(weight, state%acceleration(:, i))
                do l = 1, lanes
                    call check_close(error, lane_of(state%acceleration(0, i) - acceleration(i), l), lane_of(want, l), &
                                     500*eps, name//": column of the acceleration")
                end do
                want = combination(weight, state%alpha(:, o))
                do l = 1, lanes
                    call check_close(error, lane_of(state%alpha(0, o) - alpha(o), l), lane_of(want, l), &
                                     500*eps, name//": column of alpha")
                end do
                want = combination(weight, state%acceleration_body(:, i))
                do l = 1, lanes
                    call check_close(error, lane_of(state%rotation(o) .unrotate. (state%acceleration(0, i) - acceleration(i)), l), &
                                     lane_of(want, l), 500*eps, name//": column of the acceleration in link axes")
                end do
                want = combination(weight, state%alpha_body(:, o))
                do l = 1, lanes
                    call check_close(error, lane_of(state%rotation(o) .unrotate. (state%alpha(0, o) - alpha(o)), l), &
                                     lane_of(want, l), 500*eps, name//": column of alpha in link axes")
                end do
                if (.not. model%moves(k, i)) call check(error, maxval(abs(lane_of(state%acceleration(0, i) - acceleration(i), 1))) &
                                                        <= 0, name//": does not move")
            end do
            state%qdd(:, k) = kept
        end do
    end subroutine compare_columns

    !> How much of each column a unit of coordinate k is: columns of a pose belong to the components of its angular
    !> acceleration, not to its angles.
    subroutine weights(model, state, k, weight)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        integer, intent(in) :: k
        real(wp), intent(out) :: weight(lanes, model%n_q)
        type(rpy_rotation) :: turn
        type(vec3) :: axis
        real(wp) :: rate(lanes, 3)
        integer :: first

        weight = 0
        weight(:, k) = 1
        associate (c => model%scene%coordinate(k))
            if (c%kind /= coordinate_pose .or. c%variable <= 3) return
            first = k - c%variable + 4
            call rotate_rpy(state%q(:, first), state%q(:, first + 1), state%q(:, first + 2), turn)
            rate = 0
            rate(:, c%variable - 3) = 1
            axis = angular_velocity_rpy(turn, rate)
            weight(:, first) = axis%x
            weight(:, first + 1) = axis%y
            weight(:, first + 2) = axis%z
        end associate
    end subroutine weights

    function combination(weight, column) result(total)
        real(wp), intent(in) :: weight(:, :)
        type(vec3), intent(in) :: column(0:)
        type(vec3) :: total
        integer :: k

        total = zero_vec3()
        do k = 1, size(weight, 2)
            total = total + weight(:, k)*column(k)
        end do
    end function combination

    ! ---------------------------------------------------------------- more

    !> Both markers of a joint without slide are one point; legs have their length.
    subroutine test_closure(error)
        type(test_error), intent(inout) :: error
        type(scene_type) :: scene
        integer :: i

        do i = 1, 3
            select case (i)
            case (1)
                call stewart_scene(scene, .false.)
            case (2)
                call stewart_on_carriage(scene)
            case default
                call open_chain_scene(scene, .true.)
            end select
            call close_joints(error, scene)
        end do
    end subroutine test_closure

    subroutine close_joints(error, scene)
        type(test_error), intent(inout) :: error
        type(scene_type), intent(in) :: scene
        type(model_type) :: model
        type(kinematic_state) :: state
        real(wp), allocatable :: seed(:, :, :)
        real(wp) :: point(3, 2), r(3, 3)
        integer :: j, l, side

        call prepare(error, scene, .false., model, state, seed)
        if (allocated(error%message)) return
        call move(model, seed, 0.4_wp, state)
        do j = 1, model%n_joint
            associate (joint => model%joint(j))
                do l = 1, lanes
                    do side = 1, 2
                        r = rotation_of(joint%link(side))
                        point(:, side) = lane_of(state%position(joint%link(side)), l) + matmul(r, joint%point(:, side))
                        if (side == 1) point(:, 1) = point(:, 1) + state%slide(l, 1, j)*matmul(r, joint%frame(:, 3, 1))
                    end do
                    call check_close(error, point(:, 2), point(:, 1), 100*eps, trim(joint%name)//" closed")
                end do
            end associate
        end do

    contains

        function rotation_of(link) result(m)
            integer, intent(in) :: link
            real(wp) :: m(3, 3)
            integer :: o

            o = 0
            if (link > 0) o = model%link(link)%orientation
            m = mat3_lane(state%rotation(o), l)
        end function rotation_of
    end subroutine close_joints

    subroutine test_one_column(error)
        type(test_error), intent(inout) :: error
        type(scene_type) :: scene
        type(model_type) :: model
        type(kinematic_state) :: all_columns, one_column
        real(wp), allocatable :: seed(:, :, :)
        integer :: i, l

        call stewart_on_carriage(scene)
        call prepare(error, scene, .true., model, all_columns, seed)
        call move(model, seed, 0.1_wp, all_columns)
        call prepare(error, scene, .false., model, one_column, seed)
        call move(model, seed, 0.1_wp, one_column)
        do i = 1, model%n_link
            do l = 1, lanes
                call check_close(error, lane_of(one_column%acceleration_body(0, i), l), &
                                 lane_of(all_columns%acceleration_body(0, i), l), 0.0_wp, "acceleration")
                call check_close(error, lane_of(one_column%alpha_body(0, model%link(i)%orientation), l), &
                                 lane_of(all_columns%alpha_body(0, model%link(i)%orientation), l), 0.0_wp, "alpha")
            end do
        end do
    end subroutine test_one_column
end module test_kinematic_pass
