!> Planar inverse dynamics: published reactions, agreement of the solvers, power, assembly along a motion, refusals.
module test_planar_inverse
    use, intrinsic :: iso_fortran_env, only: real64
    use linkdyn_result_kinds, only: result_driving_force, result_power_imbalance, result_reaction
    use linkdyn_assembly_trail, only: assembly_trail, sample_assembly, follow_assembly
    use linkdyn_builder, only: build_model
    use linkdyn_inverse, only: inverse_options, inverse_results, run_inverse, solver_gauss_jordan, solver_lapack, &
        solver_elimination, solver_reduced
    use linkdyn_kinds, only: wp
    use linkdyn_model, only: model_type
    use linkdyn_motion, only: sample_count, sample_times, evaluate_motion
    use linkdyn_planar_scenes, only: planar_scene, add_body, connect, drive, four_bar_chain
    use linkdyn_scene, only: scene_type
    use linkdyn_scene_reader, only: read_scene
    use linkdyn_status, only: status_type, status_bad_input, sample_ok
    use linkdyn_testing, only: test_error, unit_test, new_test, check, check_close
    use linkdyn_test_scenes, only: start_at
    use linkdyn_text, only: to_text
    implicit none (type, external)
    private
    public :: collect_planar_inverse

    real(wp), parameter :: pi = acos(-1.0_wp)
    real(wp), parameter :: printed = epsilon(1.0_real64)    !! of references that were computed in doubles

    !> A run along the motion of an example.
    type :: run_type
        type(model_type) :: model
        real(wp), allocatable :: force(:, :), reaction(:, :, :), imbalance(:)
        integer, allocatable :: status(:)
    end type run_type

contains

    subroutine collect_planar_inverse(tests)
        type(unit_test), allocatable, intent(out) :: tests(:)

        tests = [new_test("Watt I", test_watt), new_test("Stephenson III", test_stephenson), &
                 new_test("numbers of unknowns", test_unknowns), new_test("solvers agree", test_solvers), &
                 new_test("power balance", test_power), new_test("parallelogram", test_parallelogram), &
                 new_test("near-parallelogram", test_near_parallelogram), new_test("long chain", test_chain), &
                 new_test("refusals", test_refusals)]
    end subroutine collect_planar_inverse

    subroutine run_example(error, name, solver, run)
        type(test_error), intent(inout) :: error
        character(len=*), intent(in) :: name
        integer, intent(in) :: solver
        type(run_type), intent(out), target :: run
        type(scene_type) :: scene
        type(status_type) :: status
        type(inverse_options) :: options
        type(inverse_results) :: results
        real(wp), allocatable :: t(:), q(:, :), qd(:, :), qdd(:, :), load(:, :, :)
        integer :: n

        call read_scene("examples/"//name, scene, status)
        if (status%is_ok()) call build_model(scene, run%model, status)
        call check(error, status%is_ok(), trim(status%message))
        if (.not. status%is_ok()) return
        n = sample_count(run%model)
        allocate (t(n))
        call sample_times(run%model, 1, t)
        associate (m => run%model)
            allocate (q(m%n_q, n), qd(m%n_q, n), qdd(m%n_q, n), load(6, m%n_load, n))
            allocate (run%force(m%n_actuator, n), run%reaction(3, m%n_joint, n), run%imbalance(n), run%status(n))
            call evaluate_motion(m, t, q, qd, qdd, load)
        end associate
        options%solver = solver
        options%in_order = .true.
        call results%put(result_driving_force, run%force)
        results%status => run%status
        call results%put(result_power_imbalance, run%imbalance)
        if (solver /= solver_reduced) call results%put(result_reaction, run%reaction)
        call run_inverse(run%model, options, q, qd, qdd, load, results, status)
        call check(error, status%is_ok(), trim(status%message))
        call check(error, all(run%status == sample_ok), name//": all samples are solved")
    end subroutine run_example

    !> PMKS reference data v1 print 17 digits; both mechanisms multiply rounding by about 100 at this position.
    subroutine test_watt(error)
        type(test_error), intent(inout) :: error
        type(run_type) :: run
        real(wp), parameter :: want(2, 7) = reshape([ &
            -617.28870708788463_wp, -176.5348377830598_wp, 614.49231917424265_wp, 216.48286927983295_wp, &
            417.90280632453232_wp, -49.763470876510645_wp, 197.86310237893218_wp, 100.67854343389192_wp, &
            199.99881276287579_wp, -3.3391333188193983_wp, -112.55851511205553_wp, -52.452619617719733_wp, &
            152.23576170524279_wp, -150.95805411779756_wp], [2, 7])

        call run_example(error, "watt_i/scene.toml", solver_elimination, run)
        if (.not. allocated(run%force)) return
        call check_close(error, run%force(1, 1), 1844.3174729930561_wp, 500*printed*1844, "torque")
        call check_close(error, run%reaction(:2, :, 1), want, 500*printed*617, "reactions")
    end subroutine test_watt

    subroutine test_stephenson(error)
        type(test_error), intent(inout) :: error
        type(run_type) :: run

        call run_example(error, "stephenson_iii/scene.toml", solver_elimination, run)
        if (.not. allocated(run%force)) return
        call check_close(error, run%force(1, 1), -243.85439295323431_wp, 100*printed*244, "torque")
        call check_close(error, run%reaction(:2, 1, 1), [25.763681188202462_wp, -8.1298906525976307_wp], &
                         100*printed*27, "reaction at A")
        call check_close(error, run%reaction(:2, 2, 1), [-20.280567632041709_wp, 24.281209315633109_wp], &
                         100*printed*31, "reaction at B")
    end subroutine test_stephenson

    !> The lecture's counts.
    subroutine test_unknowns(error)
        type(test_error), intent(inout) :: error
        type(run_type) :: run

        call run_example(error, "fourbar/scene.toml", solver_elimination, run)
        call check(error, run%model%n_row == 9, "four-bar: 9")
        call run_example(error, "sixbar_slider/scene.toml", solver_elimination, run)
        call check(error, run%model%n_row == 15, "six-bar: 15")
        call run_example(error, "fivebar_parallel/scene.toml", solver_elimination, run)
        call check(error, run%model%n_row == 12, "five-bar: 12")
    end subroutine test_unknowns

    subroutine test_solvers(error)
        type(test_error), intent(inout) :: error
        character(len=40), parameter :: name(4) = [character(len=40) :: "sixbar_slider/scene_inclined.toml", &
            "fivebar_parallel/scene.toml", "slider_crank/scene.toml", "andrews/scene.toml"]
        integer, parameter :: other(3) = [solver_gauss_jordan, solver_lapack, solver_reduced]
        type(run_type) :: run, again
        real(wp) :: tol
        integer :: i, k

        do i = 1, size(name)
            call run_example(error, trim(name(i)), solver_elimination, run)
            do k = 1, size(other)
                call run_example(error, trim(name(i)), other(k), again)
                if (allocated(error%message)) return
                ! The condition of these systems is below 1e4.
                tol = 1.0e4_wp*epsilon(1.0_wp)*maxval(abs(run%force))
                call check_close(error, again%force, run%force, tol, trim(name(i))//": driving force")
                if (other(k) == solver_reduced) cycle
                tol = 1.0e4_wp*epsilon(1.0_wp)*maxval(abs(run%reaction))
                call check(error, maxval(abs(again%reaction - run%reaction)) <= tol, trim(name(i))//": reactions")
            end do
        end do
    end subroutine test_solvers

    subroutine test_power(error)
        type(test_error), intent(inout) :: error
        character(len=40), parameter :: name(5) = [character(len=40) :: "sixbar_slider/scene.toml", &
            "sixbar_slider/scene_inclined.toml", "fourbar/scene.toml", "slider_crank/scene.toml", "andrews/scene.toml"]
        type(run_type) :: run
        integer :: i

        do i = 1, size(name)
            call run_example(error, trim(name(i)), solver_elimination, run)
            if (allocated(error%message)) return
            call check(error, maxval(abs(run%imbalance)) <= 1.0e-12_wp, trim(name(i))//": power balance")
        end do
    end subroutine test_power

    ! ---------------------------------------------------------------- assembly along a motion

    !> Crank 1, coupler 2, follower 1 + excess, ground 2.
    subroutine parallelogram(excess, model, status)
        real(wp), intent(in) :: excess
        type(model_type), intent(out) :: model
        type(status_type), intent(out) :: status
        type(scene_type) :: scene
        real(wp), parameter :: origin(2) = 0
        integer :: crank, coupler, follower, joint

        call planar_scene(scene)
        crank = add_body(scene, "crank")
        coupler = add_body(scene, "coupler")
        follower = add_body(scene, "follower")
        joint = connect(scene, "O", "R", 0, origin, crank, origin)
        call drive(scene, joint)
        joint = connect(scene, "A", "R", crank, [1.0_wp, 0.0_wp], coupler, origin)
        joint = connect(scene, "B", "R", coupler, [2.0_wp, 0.0_wp], follower, [1 + excess, 0.0_wp])
        joint = connect(scene, "C", "R", 0, [2.0_wp, 0.0_wp], follower, origin)
        scene%joint(3)%branch = 1
        call start_at(scene, [0.5_wp])
        call build_model(scene, model, status)
    end subroutine parallelogram

    !> Through the change points at 0 and pi the follower stays parallel: the branch changes at each.
    subroutine test_parallelogram(error)
        type(test_error), intent(inout) :: error
        integer, parameter :: n = 721
        type(model_type) :: model
        type(status_type) :: status
        type(assembly_trail) :: trail
        type(sample_assembly) :: assembly
        real(wp) :: q(1, n)
        integer :: i

        call parallelogram(0.0_wp, model, status)
        call check(error, status%is_ok(), trim(status%message))
        q(1, :) = [(0.5_wp + 4*pi*(i - 1)/(n - 1), i=1, n)]
        call follow_assembly(model, q, trail, assembly)
        do i = 1, n
            call check(error, assembly%branch(1, i)*sin(q(1, i)) > 0, "stays a parallelogram at sample "//to_text(i))
        end do
    end subroutine test_parallelogram

    !> A follower longer by 1e-6 never passes a dead point: it is a crank-rocker, and its branch stays.
    subroutine test_near_parallelogram(error)
        type(test_error), intent(inout) :: error
        integer, parameter :: n = 721
        type(model_type) :: model
        type(status_type) :: status
        type(assembly_trail) :: trail
        type(sample_assembly) :: assembly
        real(wp) :: q(1, n)
        integer :: i

        call parallelogram(1.0e-6_wp, model, status)
        call check(error, status%is_ok(), trim(status%message))
        q(1, :) = [(0.5_wp + 4*pi*(i - 1)/(n - 1), i=1, n)]
        call follow_assembly(model, q, trail, assembly)
        call check(error, all(assembly%branch > 0), "turns back before the dead point")
    end subroutine test_near_parallelogram

    !> Planning and solving 1,000 links takes no square of their number.
    subroutine test_chain(error)
        type(test_error), intent(inout) :: error
        integer, parameter :: n = 200
        type(scene_type) :: scene
        type(model_type) :: model
        type(status_type) :: status
        type(inverse_options) :: options
        type(inverse_results) :: results
        real(wp) :: q(1, 1), load(6, 0, 1)
        real(wp), target :: imbalance(1), force(1, 1)
        integer, target :: sample_status(1)

        call four_bar_chain(n, scene)
        call build_model(scene, model, status)
        call check(error, status%is_ok(), trim(status%message))
        call check(error, size(model%step) == n + 1, "a crank and n dyads")
        q = 0.35_wp
        call results%put(result_power_imbalance, imbalance)
        call results%put(result_driving_force, force)
        results%status => sample_status
        call run_inverse(model, options, q, 1 + 0*q, 0*q, load, results, status)
        call check(error, status%is_ok() .and. all(sample_status == sample_ok), "solved "//trim(status%message))
        call check(error, abs(imbalance(1)) <= 1.0e-12_wp, "power balance")
    end subroutine test_chain

    ! ---------------------------------------------------------------- refusals

    subroutine test_refusals(error)
        type(test_error), intent(inout) :: error
        type(scene_type) :: scene
        real(wp), parameter :: origin(2) = 0
        integer :: joint, brace

        ! A five-bar with one crank driven.
        call four_bar_chain(1, scene)
        brace = add_body(scene, "brace")
        joint = connect(scene, "D", "R", 2, [0.5_wp, 0.5_wp], brace, origin)
        call refused(scene, [character(len=40) :: "mobility is 2 but 1 coordinate", "nothing determines link 'brace'"])
        joint = connect(scene, "E", "R", brace, [1.0_wp, 0.0_wp], 0, [2.0_wp, 2.0_wp])
        call refused(scene, [character(len=40) :: "one too many", "mobility is 0"])
        joint = connect(scene, "F", "R", brace, [0.5_wp, 0.1_wp], 1, [0.0_wp, 0.5_wp])
        call refused(scene, [character(len=40) :: "joints", "over-constrain links", "by 2"])

    contains

        subroutine refused(scene, words)
            type(scene_type), intent(in) :: scene
            character(len=*), intent(in) :: words(:)
            type(model_type) :: model
            type(status_type) :: status
            integer :: i

            call build_model(scene, model, status)
            call check(error, status%code == status_bad_input, "refused")
            do i = 1, size(words)
                call check(error, index(status%message, trim(words(i))) > 0, trim(words(i))//" in: "//trim(status%message))
            end do
        end subroutine refused
    end subroutine test_refusals
end module test_planar_inverse
