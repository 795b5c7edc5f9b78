!> Kernels that code is made of against the engine: those that find what it finds, and those of another mechanism, which must be
!> told.
module test_kernel_check
    use linkdyn_builder, only: build_model
    use linkdyn_result_kinds, only: result_qdd, result_driving_force, result_reaction, result_joint_variable, &
        result_joint_rate, result_position, result_rotation, result_velocity, result_angular_velocity
    use linkdyn_code_kernel, only: controller_kernel, make_controller_kernel
    use linkdyn_equations, only: equations_type, unknown_choice, build_equations, build_no_equations, free_equations, &
        solver_elimination
    use linkdyn_forward_unknowns, only: choose_unknowns
    use linkdyn_inputs, only: trace_request, sample_set
    use linkdyn_kernel_check, only: compare_kernel, kernel_agrees, kernel_differs
    use linkdyn_kinds, only: wp
    use linkdyn_model, only: model_type
    use linkdyn_recorded_forces, only: prepare_forces
    use linkdyn_representatives, only: representative_poses, need_poses
    use linkdyn_scene, only: scene_type
    use linkdyn_scene_reader, only: read_scene
    use linkdyn_status, only: status_type
    use linkdyn_testing, only: test_error, unit_test, new_test, check
    implicit none (type, external)
    private
    public :: collect_kernel_check

    character(len=*), parameter :: example(5) = [character(len=32) :: "examples/fourbar/scene", "examples/stewart_forward/scene", &
        "examples/n_fourbar/scene", "tests/scenes/excavator", "tests/scenes/ball_joint"]

    !> These close in closed forms: of others a kernel is told all places, or all angles, wherever joints are.
    integer, parameter :: n_closed = 3

contains

    subroutine collect_kernel_check(tests)
        type(unit_test), allocatable, intent(out) :: tests(:)

        tests = [new_test("forward", test_forward), new_test("kinematics", test_kinematics), new_test("inverse", test_inverse)]
    end subroutine collect_kernel_check

    subroutine test_forward(error)
        type(test_error), intent(inout) :: error
        integer :: i

        do i = 1, size(example)
            call ask(error, trim(example(i)), "forward", [result_qdd, result_driving_force, result_reaction])
        end do
    end subroutine test_forward

    subroutine test_kinematics(error)
        type(test_error), intent(inout) :: error
        integer, parameter :: told(*) = [result_joint_variable, result_joint_rate, result_position, result_rotation, &
                                         result_velocity, result_angular_velocity]
        integer :: i, k

        do i = 1, n_closed
            do k = 1, size(told)
                call ask(error, trim(example(i)), "kinematics", told(k:k))
            end do
        end do
    end subroutine test_kinematics

    subroutine test_inverse(error)
        type(test_error), intent(inout) :: error

        call ask(error, "examples/fourbar/scene", "inverse", [result_driving_force])
        call ask(error, "tests/scenes/excavator", "inverse", [result_reaction])
    end subroutine test_inverse

    !> A kernel of the mechanism agrees; one whose links are heavier, or whose joints are elsewhere, does not.
    subroutine ask(error, name, kind, wanted)
        type(test_error), intent(inout) :: error
        character(len=*), intent(in) :: name, kind
        integer, intent(in) :: wanted(:)
        type(model_type) :: model, other
        type(model_type), target :: own
        type(equations_type) :: equations
        type(unknown_choice) :: unknown
        type(representative_poses) :: poses
        type(trace_request) :: request
        type(sample_set) :: sample
        type(controller_kernel) :: kernel, wrong, drives
        type(status_type) :: status
        logical :: is_planned
        integer :: verdict, j

        if (allocated(error%message)) return
        call load_model(error, name, model)
        if (allocated(error%message)) return
        call need_poses(model, spread(model%start_q, 2, 1), poses)
        other = model
        if (kind == "kinematics") then
            do j = 1, other%n_joint
                ! of one side: a mechanism in scale would turn alike
                other%joint(j)%point(:, 2) = 1.05_wp*other%joint(j)%point(:, 2)
            end do
        else
            other%link%mass = 1.01_wp*other%link%mass
        end if
        call make(model, kernel)
        if (kind == "forward") call make_controller_kernel(own, request, [result_qdd, result_driving_force], sample, drives)
        call make(other, wrong)
        select case (kind)
        case ("forward")
            call build_equations(model, solver_elimination, .true., equations, status, unknown)
        case ("inverse")
            call build_equations(model, solver_elimination, .true., equations, status)
        case default
            call build_no_equations(model, equations)
        end select
        call check(error, status%is_ok(), name//": "//trim(status%message))
        call compare_kernel(model, equations, poses%assembly, sample, kernel, drives, verdict)
        call check(error, verdict == kernel_agrees, name//", "//kind//": does not agree")
        call compare_kernel(model, equations, poses%assembly, sample, wrong, drives, verdict)
        call check(error, verdict == kernel_differs, name//", "//kind//": of another mechanism, and nothing is said")
        call free_equations(equations)

    contains

        subroutine make(of, kernel)
            type(model_type), intent(in) :: of
            type(controller_kernel), intent(out) :: kernel

            call prepare_forces(of, poses%q, poses%stand, own, request, sample, is_planned, poses%assembly%place)
            if (own%is_planar) request%has_load(3:5, :) = .false.
            if (kind == "kinematics") deallocate (request%has_load)
            if (kind == "forward") then
                call choose_unknowns(model, unknown, status)
                request%drive_is_unknown = unknown%drive
                request%acceleration_is_unknown = unknown%acceleration
            end if
            call make_controller_kernel(own, request, wanted, sample, kernel)
            call check(error, kernel%is_made, name//", "//kind//": no kernel")
        end subroutine make
    end subroutine ask

    subroutine load_model(error, name, model)
        type(test_error), intent(inout) :: error
        character(len=*), intent(in) :: name           !! path without its ending
        type(model_type), intent(out) :: model
        type(scene_type) :: scene
        type(status_type) :: status

        call read_scene(name//".toml", scene, status)
        if (status%is_ok()) call build_model(scene, model, status)
        call check(error, status%is_ok(), name//": "//trim(status%message))
    end subroutine load_model
end module test_kernel_check
