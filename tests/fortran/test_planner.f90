!> The planner: order of the steps, mobility, and refusals that name what is wrong.
module test_planner
    use linkdyn_builder, only: build_model
    use linkdyn_equation_kernels, only: need_matrix
    use linkdyn_equations, only: equations_type, build_equations, free_equations, solver_lapack
    use linkdyn_kinds, only: wp
    use linkdyn_model, only: model_type, step_pose, step_joint, step_ups
    use linkdyn_planner, only: mobility_of
    use linkdyn_scene, only: scene_type, joint_spherical
    use linkdyn_status, only: status_type, status_bad_input
    use linkdyn_test_scenes, only: stewart_scene, stewart_on_carriage, open_chain_scene, new_scene, add_joint, &
        add_joint_coordinates
    use linkdyn_testing, only: test_error, unit_test, new_test, check
    use linkdyn_text, only: to_text
    implicit none (type, external)
    private
    public :: collect_planner

    real(wp), parameter :: origin(3) = 0, z_axis(3) = [0.0_wp, 0.0_wp, 1.0_wp]

contains

    subroutine collect_planner(tests)
        type(unit_test), allocatable, intent(out) :: tests(:)

        tests = [ &
            new_test("Stewart platform", test_stewart), &
            new_test("Stewart platform on a carriage", test_carriage), &
            new_test("open chain", test_open_chain), &
            new_test("coordinates that move a link", test_moves), &
            new_test("links that slide on each other", test_orientations), &
            new_test("missing coordinate", test_missing_coordinate), &
            new_test("incomplete pose", test_incomplete_pose), &
            new_test("over-constraining joint", test_over_constrained), &
            new_test("coordinate too many", test_extra_coordinate), &
            new_test("universal joint backwards", test_backwards), &
            new_test("number of actuators", test_actuators), &
            new_test("no moving link", test_empty)]
    end subroutine collect_planner

    subroutine build(error, scene, model)
        type(test_error), intent(inout) :: error
        type(scene_type), intent(in) :: scene
        type(model_type), intent(out) :: model
        type(status_type) :: status

        call build_model(scene, model, status)
        call check(error, status%is_ok(), "planned: "//trim(status%message))
    end subroutine build

    subroutine check_refused(error, scene, words)
        type(test_error), intent(inout) :: error
        type(scene_type), intent(in) :: scene
        character(len=*), intent(in) :: words(:)    !! all must stand in the message
        type(model_type) :: model
        type(status_type) :: status

        call build_model(scene, model, status)
        call check_message(error, status, words)
    end subroutine check_refused

    subroutine check_message(error, status, words)
        type(test_error), intent(inout) :: error
        type(status_type), intent(in) :: status
        character(len=*), intent(in) :: words(:)
        integer :: i

        call check(error, status%code == status_bad_input, "refused")
        do i = 1, size(words)
            call check(error, index(status%message, trim(words(i))) > 0, &
                       "message names "//trim(words(i))//": "//trim(status%message))
        end do
    end subroutine check_message

    subroutine test_stewart(error)
        type(test_error), intent(inout) :: error
        type(scene_type) :: scene
        type(model_type) :: model
        type(equations_type) :: equations
        type(status_type) :: status
        integer :: i

        call stewart_scene(scene, .false.)
        call build(error, scene, model)
        if (.not. allocated(model%step)) return
        call check(error, size(model%step) == 7, "seven steps")
        call check(error, model%step(1)%kind == step_pose .and. model%step(1)%link(1) == 1, "the platform first")
        call check(error, all(model%step(2:)%kind == step_ups), "then the legs")
        call check(error, all(model%step(2:)%first == [(i, i=1, 6)]), "legs numbered")
        call check(error, .not. any(model%step%base_moves), "their base rests")
        call check(error, mobility_of(model) == 6, "mobility 6")
        call check(error, model%n_link == 13 .and. model%n_joint == 18 .and. model%n_leg == 6, "links, joints, legs")
        call check(error, model%n_row == 78, "78 equations")
        call build_equations(model, solver_lapack, .true., equations, status)
        call need_matrix(model, equations%kernels)
        call check(error, size(equations%kernels%form%right) == 78 .and. maxval(equations%kernels%form%column) == 78, "78 unknowns")
        call free_equations(equations)
    end subroutine test_stewart

    subroutine test_carriage(error)
        type(test_error), intent(inout) :: error
        type(scene_type) :: scene
        type(model_type) :: model

        call stewart_on_carriage(scene)
        call build(error, scene, model)
        if (.not. allocated(model%step)) return
        call check(error, size(model%step) == 9, "nine steps")
        call check(error, all(model%step(1:3)%kind == [step_pose, step_joint, step_joint]), "pose, rail, pivot")
        call check(error, all(model%step(4:)%kind == step_ups), "then the legs")
        call check(error, all(model%step(4:)%base_moves), "their base moves")
        call check(error, model%step(3)%from_second .and. .not. model%step(2)%from_second, "pivot written backwards")
        call check(error, mobility_of(model) == 8, "mobility 8")
    end subroutine test_carriage

    subroutine test_open_chain(error)
        type(test_error), intent(inout) :: error
        type(scene_type) :: scene
        type(model_type) :: model

        call open_chain_scene(scene, .true.)
        call build(error, scene, model)
        if (.not. allocated(model%step)) return
        call check(error, all(model%step%kind == step_joint), "open chain")
        call check(error, all(model%step%link(1) == [1, 2, 3, 4, 5]), "outwards from the frame")
        call check(error, all(model%step%from_second .eqv. [.true., .false., .true., .false., .false.]), "backwards joints")
        call check(error, mobility_of(model) == 9 .and. model%n_q == 9, "mobility 9")
        call check(error, model%n_variable == 9, "nine joint variables")
    end subroutine test_open_chain

    !> Behind the joints of an open chain lie all coordinates before it.
    subroutine test_moves(error)
        type(test_error), intent(inout) :: error
        type(scene_type) :: scene
        type(model_type) :: model
        integer, parameter :: last(4) = [1, 2, 4, 6]
        integer :: i

        call open_chain_scene(scene, .false.)
        call build(error, scene, model)
        if (.not. allocated(model%moves)) return
        do i = 1, 4
            call check(error, all(model%moves(:last(i), i)) .and. .not. any(model%moves(last(i) + 1:, i)), &
                       "coordinates of link "//to_text(i))
        end do
        call stewart_on_carriage(scene)
        call build(error, scene, model)
        call check(error, all(model%moves(:, 4:)), "a leg moves with its base and with the platform")
        call check(error, all(model%moves(:, 3) .eqv. [(i > 2, i=1, 8)]), "the platform with its pose alone")
        call check(error, all(model%moves(:, 1) .eqv. [(i == 1, i=1, 8)]), "the carriage with its slide alone")
    end subroutine test_moves

    subroutine test_orientations(error)
        type(test_error), intent(inout) :: error
        type(scene_type) :: scene
        type(model_type) :: model
        integer :: i

        call stewart_on_carriage(scene)
        call build(error, scene, model)
        call check(error, model%link(1)%orientation == 0, "a carriage on the frame never turns")
        call check(error, model%n_orientation == 8, "turntable, platform and one for each leg")
        do i = 4, 14, 2
            call check(error, model%link(i)%orientation == model%link(i + 1)%orientation, "lower and upper turn together")
        end do
        call open_chain_scene(scene, .false.)
        call build(error, scene, model)
        call check(error, model%n_orientation == 4, "slid links with other axes keep their own")
    end subroutine test_orientations

    subroutine test_missing_coordinate(error)
        type(test_error), intent(inout) :: error
        type(scene_type) :: scene

        call open_chain_scene(scene, .false.)
        scene%coordinate = scene%coordinate([1, 2, 3, 5, 6])    ! C.slide goes
        call check_refused(error, scene, [character(len=24) :: "mobility is 6", "5 coordinate(s)", "'link3'", "'link4'"])
    end subroutine test_missing_coordinate

    subroutine test_incomplete_pose(error)
        type(test_error), intent(inout) :: error
        type(scene_type) :: scene

        call stewart_scene(scene, .false.)
        scene%coordinate = scene%coordinate(:5)
        call check_refused(error, scene, [character(len=24) :: "'platform'", "yaw"])
    end subroutine test_incomplete_pose

    subroutine test_over_constrained(error)
        type(test_error), intent(inout) :: error
        type(scene_type) :: scene
        integer :: joint

        call open_chain_scene(scene, .false.)
        joint = add_joint(scene, "brace", joint_spherical, 0, origin, z_axis, 4, origin, z_axis)
        call check_refused(error, scene, [character(len=24) :: "one too many", "mobility is 3"])
    end subroutine test_over_constrained

    subroutine test_extra_coordinate(error)
        type(test_error), intent(inout) :: error
        type(scene_type) :: scene

        ! The slide of a leg already follows from the pose.
        call stewart_scene(scene, .false.)
        call add_joint_coordinates(scene, 2)
        call check_refused(error, scene, [character(len=24) :: "'leg1.P.slide'", "one too many", "mobility is 6"])
    end subroutine test_extra_coordinate

    subroutine test_backwards(error)
        type(test_error), intent(inout) :: error
        type(scene_type) :: scene

        call open_chain_scene(scene, .false.)
        scene%joint(4)%link = scene%joint(4)%link([2, 1])
        scene%joint(4)%marker = scene%joint(4)%marker([2, 1])
        call check_refused(error, scene, [character(len=24) :: "'U'", "exchange", "between"])
    end subroutine test_backwards

    subroutine test_actuators(error)
        type(test_error), intent(inout) :: error
        type(scene_type) :: scene
        type(model_type) :: model
        type(equations_type) :: equations
        type(status_type) :: status

        call stewart_scene(scene, .false.)
        scene%actuator = scene%actuator(:5)
        call build(error, scene, model)
        call build_equations(model, solver_lapack, .true., equations, status)
        call check_message(error, status, [character(len=40) :: "5 actuator(s) for 6"])
    end subroutine test_actuators

    subroutine test_empty(error)
        type(test_error), intent(inout) :: error
        type(scene_type) :: scene

        call new_scene(scene)
        call check_refused(error, scene, [character(len=24) :: "no moving link"])
    end subroutine test_empty
end module test_planner
