!> Dead points of coordinates are told by ratios of speeds that have no size and no unit.
module test_coordinate_watch
    use linkdyn_builder, only: build_model
    use linkdyn_coordinate_watch, only: coordinate_watch, prepare_watch, compare_rates, is_near_dead_point, &
        dead_coordinate
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_led_mechanism, only: evaluate_kinematics
    use linkdyn_model, only: model_type
    use linkdyn_planar_scenes, only: planar_scene, add_body, connect, drive, four_bar_chain
    use linkdyn_scene, only: scene_type
    use linkdyn_status, only: status_type
    use linkdyn_test_scenes, only: start_at, stewart_scene
    use linkdyn_testing, only: test_error, unit_test, new_test, check, check_close
    implicit none (type, external)
    private
    public :: collect_coordinate_watch

    real(wp), parameter :: origin(2) = 0

contains

    subroutine collect_coordinate_watch(tests)
        type(unit_test), allocatable, intent(out) :: tests(:)

        tests = [ &
            new_test("slider-crank by its slider, of any size", test_slider_crank), &
            new_test("change points are none", test_change_point), &
            new_test("pose coordinates are not watched", test_pose)]
    end subroutine collect_coordinate_watch

    !> Crank r, rod 3 r on a rail through the pivot, the slide given by the crank's angle.
    subroutine slider_crank(r, angle, model, watch, error)
        real(wp), intent(in) :: r, angle
        type(model_type), intent(out) :: model
        type(coordinate_watch), intent(out) :: watch
        type(test_error), intent(inout) :: error
        type(scene_type) :: scene
        type(status_type) :: status
        integer :: crank, rod, slider, joint

        call planar_scene(scene)
        crank = add_body(scene, "crank")
        rod = add_body(scene, "rod")
        slider = add_body(scene, "slider")
        joint = connect(scene, "A", "R", 0, origin, crank, origin)
        joint = connect(scene, "B", "R", crank, [r, 0.0_wp], rod, origin)
        joint = connect(scene, "C", "R", rod, [3*r, 0.0_wp], slider, origin)
        joint = connect(scene, "D", "P", 0, origin, slider, origin)
        call drive(scene, joint)
        call start_at(scene, [r*cos(angle) + sqrt(9*r**2 - (r*sin(angle))**2)])
        call build_model(scene, model, status)
        call check(error, status%is_ok(), trim(status%message))
        call prepare_watch(model, [.true.], watch)
        call check(error, watch%is_on, "watched")
        watch%state%q = spread(model%start_q, 1, lanes)
        watch%state%qd = 0
        watch%state%qdd = 0
        call evaluate_kinematics(model, watch%state)
        call compare_rates(model, watch%state, watch)
    end subroutine slider_crank

    !> Against the derivative of the slide by the crank's angle, written down by hand.
    subroutine test_slider_crank(error)
        type(test_error), intent(inout) :: error
        real(wp), parameter :: angle(4) = [1.5_wp, 0.3_wp, 0.06_wp, 3.0e-4_wp]
        real(wp), parameter :: size(3) = [1.0e-6_wp, 1.0_wp, 1.0e3_wp]
        type(model_type) :: model
        type(coordinate_watch) :: watch
        real(wp) :: want, slope, tolerance
        integer :: i, k

        do i = 1, 4
            do k = 1, 3
                call slider_crank(size(k), angle(i), model, watch, error)
                slope = sin(angle(i)) + sin(angle(i))*cos(angle(i))/sqrt(9 - sin(angle(i))**2)
                want = 1/slope
                ! The slide is given to a rounding, which moves the crank by 1/(angle**2) of that.
                tolerance = 64*epsilon(1.0_wp)*want/angle(i)**2
                call check_close(error, abs(watch%ratio(1, 1)), want, tolerance, "speed of the crank's pin")
                ! The rod's turn against the slider is felt at its end.
                call check_close(error, abs(watch%ratio(3, 1)), want*cos(angle(i))/sqrt(1 - (sin(angle(i))/3)**2), tolerance, &
                                 "speed of the rod's pin")
                call check(error, watch%ratio(4, 1) == 0, "the coordinate itself is no candidate")
                watch%least = 1                      ! what it was half-way of its stroke
                call check(error, is_near_dead_point(watch) .eqv. i >= 3, "near")
                call check(error, (dead_coordinate(watch, .true.) == 1) .eqv. i >= 2, "near enough where nothing else goes")
                call check(error, (dead_coordinate(watch, .false.) == 1) .eqv. i == 4, "dead")
            end do
        end do
        call slider_crank(1.0_wp, 0.06_wp, model, watch, error)
        call check(error, .not. is_near_dead_point(watch), "no better before: it is built like that")
    end subroutine test_slider_crank

    !> A parallelogram nearly flat: its follower still turns as its crank does.
    subroutine test_change_point(error)
        type(test_error), intent(inout) :: error
        type(scene_type) :: scene
        type(model_type) :: model
        type(coordinate_watch) :: watch
        type(status_type) :: status
        integer :: i

        do i = 1, 4
            call four_bar_chain(1, scene)
            ! The crank's arm is its y axis: flat at a quarter turn.
            call start_at(scene, [acos(-1.0_wp)/2 - 10.0_wp**(-i)])
            call build_model(scene, model, status)
            call check(error, status%is_ok(), trim(status%message))
            call prepare_watch(model, [.true.], watch)
            watch%state%q = spread(model%start_q, 1, lanes)
            watch%state%qd = 0
            watch%state%qdd = 0
            call evaluate_kinematics(model, watch%state)
            call compare_rates(model, watch%state, watch)
            call check_close(error, maxval(abs(watch%ratio)), 1.0_wp, 64*epsilon(1.0_wp)*10.0_wp**(2*i), "as fast as the crank")
        end do
    end subroutine test_change_point

    subroutine test_pose(error)
        type(test_error), intent(inout) :: error
        type(scene_type) :: scene
        type(model_type) :: model
        type(coordinate_watch) :: watch
        type(status_type) :: status

        call stewart_scene(scene, .false.)
        call build_model(scene, model, status)
        call prepare_watch(model, spread(.true., 1, model%n_q), watch)
        call check(error, status%is_ok() .and. .not. watch%is_on, "nothing to watch")
    end subroutine test_pose
end module test_coordinate_watch
