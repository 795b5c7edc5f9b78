!> Error estimates: similar mechanisms have similar forces, estimates hold the solvers' differences, dead points say so.
module test_error_probe
    use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
    use linkdyn_result_kinds, only: result_driving_force, result_driving_force_error, result_error, result_reaction, &
        result_reaction_error
    use linkdyn_builder, only: build_model
    use linkdyn_inverse, only: inverse_options, inverse_results, run_inverse, solver_lapack, solver_elimination, &
        solver_gauss_jordan
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_model, only: model_type
    use linkdyn_planar_scenes, only: planar_scene, add_body, connect, drive, dyad_scene, triad_scene
    use linkdyn_scene, only: scene_type, spring_spec
    use linkdyn_similar_model, only: make_similar, coordinate_scale, drive_scale
    use linkdyn_status, only: status_type, sample_ok
    use linkdyn_test_numbers, only: random_stream, eps
    use linkdyn_test_scenes, only: stewart_scene, stewart_on_carriage, open_chain_scene
    use linkdyn_testing, only: test_error, unit_test, new_test, check, check_close
    implicit none (type, external)
    private
    public :: collect_error_probe

    integer, parameter :: n_scene = 7, n = 2*lanes + 3
    character(len=16), parameter :: scene_name(n_scene) = [character(len=16) :: "Stewart", "on a carriage", &
        "open chain", "springs", "RRR", "PRP", "triad"]

    !> One batch and what comes of it.
    type :: run_type
        real(wp), allocatable :: q(:, :), qd(:, :), qdd(:, :), load(:, :, :)
        type(inverse_results) :: results
    contains
        final :: release
    end type run_type

contains

    subroutine collect_error_probe(tests)
        type(unit_test), allocatable, intent(out) :: tests(:)

        tests = [ &
            new_test("similar mechanisms", test_similar), &
            new_test("estimates hold the solvers' differences", test_solvers), &
            new_test("an estimate depends on its sample alone", test_alone), &
            new_test("infinite at a dead point", test_dead_point)]
    end subroutine collect_error_probe

    subroutine take_model(error, which, model)
        type(test_error), intent(inout) :: error
        integer, intent(in) :: which
        type(model_type), intent(out) :: model
        type(scene_type) :: scene
        type(status_type) :: status

        select case (which)
        case (1)
            call stewart_scene(scene, .false.)
        case (2)
            call stewart_on_carriage(scene)
        case (3)
            call open_chain_scene(scene, .false.)
        case (4)
            call open_chain_scene(scene, .false.)
            scene%spring = [spring_spec(name="at a joint", joint=1, stiffness=70.0_wp, damping=4.0_wp, rest=0.3_wp), &
                            spring_spec(name="at another", joint=2, stiffness=50.0_wp, damping=3.0_wp, rest=0.2_wp), &
                            spring_spec(name="between", link=[1, 2], marker=[1, 1], stiffness=90.0_wp, damping=2.0_wp, rest=0.1_wp)]
        case (5)
            call dyad_scene("RRR", scene)
        case (6)
            call dyad_scene("PRP", scene)
        case default
            call triad_scene(scene)
        end select
        call build_model(scene, model, status)
        call check(error, status%is_ok(), trim(scene_name(which))//" planned: "//trim(status%message))
    end subroutine take_model

    !> Random motion about the start, random loads.
    subroutine make_batch(model, run)
        type(model_type), intent(in) :: model
        type(run_type), intent(out) :: run
        type(random_stream) :: stream

        run%q = spread(model%scene%coordinate%start_position, 2, n) + 0.05_wp*reshape(stream%vector(model%n_q*n), [model%n_q, n])
        run%qd = reshape(stream%vector(model%n_q*n), [model%n_q, n])
        run%qdd = 3*reshape(stream%vector(model%n_q*n), [model%n_q, n])
        run%load = 50*reshape(stream%vector(6*model%n_load*n), [6, model%n_load, n])
    end subroutine make_batch

    !> The motion and loads of one run for another; assigned as a whole, gfortran 12 would forget to finalize the other.
    subroutine copy_batch(from, to)
        type(run_type), intent(in) :: from
        type(run_type), intent(inout) :: to

        to%q = from%q
        to%qd = from%qd
        to%qdd = from%qdd
        to%load = from%load
    end subroutine copy_batch

    subroutine solve(error, model, solver, run)
        type(test_error), intent(inout) :: error
        type(model_type), intent(in) :: model
        integer, intent(in) :: solver
        type(run_type), intent(inout) :: run
        type(status_type) :: status
        integer, parameter :: told(5) = [result_driving_force, result_driving_force_error, result_reaction, result_reaction_error, &
                                         result_error]
        integer :: i

        call release(run)
        associate (results => run%results)
            allocate (results%status(n))
            do i = 1, size(told)
                call results%add(model, told(i), n)
            end do
            call run_inverse(model, inverse_options(solver=solver, wants_errors=.true.), run%q, run%qd, run%qdd, run%load, &
                             results, status)
        end associate
        call check(error, status%is_ok(), trim(status%message))
    end subroutine solve

    subroutine release(run)
        type(run_type), intent(inout) :: run

        if (.not. associated(run%results%status)) return
        deallocate (run%results%status)
        call run%results%free()
    end subroutine release

    !> The forces of a mechanism 1.7 times the size are 1.7 times as large, moments its square.
    subroutine test_similar(error)
        type(test_error), intent(inout) :: error
        real(wp), parameter :: scale = 1.7_wp
        type(model_type) :: model, similar
        type(run_type) :: one, other
        real(wp) :: tol
        real(wp), allocatable :: wrench(:, :), scaled(:, :)
        integer :: s, i, k, n_force

        do s = 1, n_scene
            call take_model(error, s, model)
            if (allocated(error%message)) return
            call make_similar(model, 1, scale, similar)
            call make_batch(model, one)
            call copy_batch(one, other)
            do k = 1, model%n_q
                other%q(k, :) = coordinate_scale(model, k, scale)*one%q(k, :)
                other%qd(k, :) = coordinate_scale(model, k, scale)*one%qd(k, :)
                other%qdd(k, :) = coordinate_scale(model, k, scale)*one%qdd(k, :)
            end do
            other%load(:3, :, :) = scale*one%load(:3, :, :)
            other%load(4:, :, :) = scale**2*one%load(4:, :, :)
            call solve(error, model, solver_lapack, one)
            call solve(error, similar, solver_lapack, other)
            if (allocated(error%message)) return
            call check(error, all(one%results%status == sample_ok), trim(scene_name(s))//": all solved")
            n_force = merge(2, 3, model%is_planar)
            do i = 1, n
                ! Far above rounding, which these poses amplify by some thousands, and far below what a wrong power of
                ! the scale does.
                tol = 1.0e5_wp*eps*maxval(abs([one%results%at(result_reaction, i), one%results%at(result_driving_force, i)]))
                wrench = reshape(one%results%at(result_reaction, i), [model%n_component, model%n_joint])
                scaled = reshape(other%results%at(result_reaction, i), shape(wrench))
                call check_close(error, scaled(:n_force, :)/scale, wrench(:n_force, :), &
                                 tol, trim(scene_name(s))//": forces")
                call check_close(error, scaled(n_force + 1:, :)/scale**2, wrench(n_force + 1:, :), tol, &
                                 trim(scene_name(s))//": moments")
                do k = 1, model%n_actuator
                    call check_close(error, other%results%of(result_driving_force)%x(k, i) &
                                     /drive_scale(model, k, scale), &
                                     one%results%of(result_driving_force)%x(k, i), tol, trim(scene_name(s))//": driving force")
                end do
            end do
        end do
    end subroutine test_similar

    !> Two solvers differ by no more than both estimates together; the estimates are no excuse for anything.
    subroutine test_solvers(error)
        type(test_error), intent(inout) :: error
        type(model_type) :: model
        type(run_type) :: one, other
        integer :: s

        do s = 1, n_scene
            call take_model(error, s, model)
            call make_batch(model, one)
            call copy_batch(one, other)
            call solve(error, model, solver_elimination, one)
            call solve(error, model, solver_gauss_jordan, other)
            if (allocated(error%message)) return
            call check(error, all(differences(result_driving_force) <= estimates(result_driving_force_error)), &
                       trim(scene_name(s))//": driving forces")
            call check(error, all(differences(result_reaction) <= estimates(result_reaction_error)), &
                       trim(scene_name(s))//": reactions")
            ! Such poses lose six digits at most, and no force is known better than to the floor.
            call check(error, all(one%results%of(result_error)%x < 1.0e6_wp*eps), trim(scene_name(s))//": small")
            call check(error, all(one%results%of(result_error)%x >= eps), trim(scene_name(s))//": not zero")
        end do

    contains

        function differences(id)
            integer, intent(in) :: id                  !! one of `result_*`
            real(wp), allocatable :: differences(:, :)

            differences = abs(one%results%of(id)%x - other%results%of(id)%x)
        end function differences

        function estimates(id)
            integer, intent(in) :: id                  !! one of `result_*`
            real(wp), allocatable :: estimates(:, :)

            estimates = one%results%of(id)%x + other%results%of(id)%x
        end function estimates
    end subroutine test_solvers

    !> The batch turned round: the same estimates.
    subroutine test_alone(error)
        type(test_error), intent(inout) :: error
        type(model_type) :: model
        type(run_type) :: one, other
        real(wp) :: tol
        integer :: s

        do s = 1, n_scene
            call take_model(error, s, model)
            call make_batch(model, one)
            other%q = one%q(:, n:1:-1)
            other%qd = one%qd(:, n:1:-1)
            other%qdd = one%qdd(:, n:1:-1)
            other%load = one%load(:, :, n:1:-1)
            call solve(error, model, solver_elimination, one)
            call solve(error, model, solver_elimination, other)
            if (allocated(error%message)) return
            ! A copy's last digits depend on the lane, and on how long neighbours keep an iteration going.
            tol = 1.0e4_wp*eps*maxval(abs(one%results%of(result_reaction)%x))
            call check(error, all(abs(one%results%of(result_reaction_error)%x &
                                      - other%results%of(result_reaction_error)%x(:, n:1:-1)) <= tol), &
                       trim(scene_name(s))//": reactions")
            tol = 1.0e4_wp*eps*maxval(abs(one%results%of(result_driving_force)%x))
            call check(error, all(abs(one%results%of(result_driving_force_error)%x &
                                      - other%results%of(result_driving_force_error)%x(:, n:1:-1)) <= tol), &
                       trim(scene_name(s))//": driving forces")
        end do
    end subroutine test_alone

    !> A dyad on a rail, stretched to the last bit: its forces have no digits, and the estimate says so.
    subroutine test_dead_point(error)
        type(test_error), intent(inout) :: error
        type(scene_type) :: scene
        type(model_type) :: model
        type(run_type) :: run
        type(status_type) :: status
        integer :: carriage, a, b, joint

        call planar_scene(scene)
        carriage = add_body(scene, "carriage")
        a = add_body(scene, "first")
        b = add_body(scene, "second")
        joint = connect(scene, "rail", "P", 0, [0.0_wp, 0.0_wp], carriage, [0.0_wp, 0.0_wp])
        call drive(scene, joint)
        joint = connect(scene, "A", "R", 0, [0.0_wp, 0.0_wp], a, [0.0_wp, 0.0_wp])
        joint = connect(scene, "C", "R", a, [0.7_wp, 0.0_wp], b, [0.0_wp, 0.0_wp])
        scene%joint(joint)%branch = 1
        joint = connect(scene, "B", "R", b, [0.6_wp, 0.0_wp], carriage, [0.0_wp, 0.0_wp])
        scene%coordinate(1)%start_position = 1
        call build_model(scene, model, status)
        call check(error, status%is_ok(), trim(status%message))
        if (allocated(error%message)) return
        call make_batch(model, run)
        run%q = 1
        run%q(1, n) = (0.7_wp + 0.6_wp)*(1 - epsilon(1.0_wp))
        call solve(error, model, solver_elimination, run)
        call check(error, all(run%results%of(result_error)%x(1, :n - 1) < 1.0e4_wp*eps), "away from it the estimate is small")
        if (run%results%status(n) == sample_ok) &
            call check(error, run%results%of(result_error)%x(1, n) > 0.01_wp, "no digits near full stretch")
    end subroutine test_dead_point
end module test_error_probe
