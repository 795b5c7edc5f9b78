!> Forward dynamics as equations: what inverse dynamics asks for, given back, must return the motion.
module test_accelerations
    use linkdyn_result_kinds, only: result_closure, result_driving_force, result_joint_rate, result_joint_variable, &
        result_power_imbalance, result_qdd, result_reaction
    use linkdyn_builder, only: build_model
    use linkdyn_constants, only: two_pi
    use linkdyn_equations, only: unknown_choice, build_equations, find_drives
    use linkdyn_inverse, only: inverse_options, inverse_results, inverse_solver, motion_batch, motion_of, run_inverse, &
        run_prepared, &
        solver_gauss_jordan, solver_lapack, solver_elimination, solver_reduced, solver_name
    use linkdyn_kinds, only: wp
    use linkdyn_model, only: model_type
    use linkdyn_motion, only: evaluate_motion
    use linkdyn_planar_scenes, only: dyad_scene, triad_scene
    use linkdyn_scene, only: scene_type, law_harmonic
    use linkdyn_scene_reader, only: read_scene
    use linkdyn_status, only: status_type
    use linkdyn_testing, only: test_error, unit_test, new_test, check, check_close
    implicit none (type, external)
    private
    public :: collect_accelerations

    ! 78 equations with condition numbers of 30 to 3,000 at these states: some hundred roundings each way.
    real(wp), parameter :: tolerance = 3.0e4_wp*epsilon(1.0_wp)

    !> The motion of a scene and all forces that belong to it.
    type :: motion_case
        type(model_type) :: model
        real(wp), allocatable :: q(:, :), qd(:, :), qdd(:, :), load(:, :, :)
        real(wp), allocatable :: force(:, :), reaction(:, :, :)
    end type motion_case

contains

    subroutine collect_accelerations(tests)
        type(unit_test), allocatable, intent(out) :: tests(:)

        tests = [ &
            new_test("accelerations from driving forces, every solver", test_forward), &
            new_test("legs of any shape, with loads", test_general_legs), &
            new_test("some coordinates driven, some free", test_mixed), &
            new_test("every planar step", test_planar_steps), &
            new_test("mixed in the plane", test_planar_mixed), &
            new_test("loops closed, power balanced", test_measures), &
            new_test("CSP group", test_csp)]
    end subroutine collect_accelerations

    !> A scene at instants of its motion, its forces by LAPACK.
    subroutine make_case(name, case, error, skewed)
        character(len=*), intent(in) :: name
        type(motion_case), intent(out) :: case
        type(test_error), intent(inout) :: error
        logical, intent(in), optional :: skewed       !! links of no symmetry, the loads on a leg
        type(scene_type) :: scene
        type(status_type) :: status

        call read_scene("examples/"//name//"/scene.toml", scene, status)
        call check(error, status%is_ok(), trim(status%message))
        if (present(skewed)) call skew(scene)
        if (status%is_ok()) call make_case_of(scene, case, error)
    end subroutine make_case

    subroutine make_case_of(scene, case, error)
        type(scene_type), intent(in) :: scene
        type(motion_case), intent(out), target :: case
        type(test_error), intent(inout) :: error
        integer, parameter :: n = 21
        type(status_type) :: status
        type(inverse_results) :: results
        real(wp) :: t(n)
        integer :: i

        call build_model(scene, case%model, status)
        call check(error, status%is_ok(), trim(status%message))
        if (.not. status%is_ok()) return
        associate (m => case%model)
            t = [(scene%time%first + (scene%time%last - scene%time%first)*(i - 0.5_wp)/n, i=1, n)]
            allocate (case%q(m%n_q, n), case%qd(m%n_q, n), case%qdd(m%n_q, n), case%load(6, m%n_load, n), &
                      case%force(m%n_actuator, n), case%reaction(m%n_component, m%n_joint, n))
            call evaluate_motion(m, t, case%q, case%qd, case%qdd, case%load)
            call results%put(result_driving_force, case%force)
            call results%put(result_reaction, case%reaction)
            call run_inverse(m, inverse_options(solver=solver_lapack), case%q, case%qd, case%qdd, case%load, results, status)
        end associate
        call check(error, status%is_ok(), trim(status%message))
    end subroutine make_case_of

    !> Every link gets a centre of mass off its axes and products of inertia, each its own; loads go to the last leg.
    subroutine skew(scene)
        type(scene_type), intent(inout) :: scene
        integer :: l

        do l = 1, size(scene%link)
            scene%link(l)%cog = scene%link(l)%cog + [0.05_wp, -0.03_wp, 0.02_wp]*(1 + 0.1_wp*l)
            scene%link(l)%inertia(4:6) = scene%link(l)%inertia(4:6) &
                                         + [0.10_wp, -0.07_wp, 0.04_wp]*(1 + 0.1_wp*l)*scene%link(l)%inertia(1)
        end do
        do l = 1, size(scene%load)
            scene%load(l)%link = size(scene%link) - modulo(l, 2)
            scene%load(l)%marker = 1
        end do
    end subroutine skew

    !> Solve for what is unknown and compare with the case.
    subroutine compare(case, unknown, solver, error)
        type(motion_case), intent(in), target :: case
        type(unknown_choice), intent(in) :: unknown
        integer, intent(in) :: solver
        type(test_error), intent(inout) :: error
        type(inverse_solver) :: forward
        type(inverse_results) :: results
        type(status_type) :: status
        real(wp), target :: qdd(case%model%n_q, size(case%q, 2)), force(case%model%n_actuator, size(case%q, 2))
        real(wp), target :: reaction(case%model%n_component, case%model%n_joint, size(case%q, 2))
        real(wp), target :: given_qdd(case%model%n_q, size(case%q, 2)), given_force(case%model%n_actuator, size(case%q, 2))
        real(wp) :: scale
        type(motion_batch) :: motion
        integer :: k

        call build_equations(case%model, solver, solver /= solver_reduced, forward%equations, status, unknown)
        call check(error, status%is_ok(), trim(status%message))
        if (.not. status%is_ok()) return
        call results%put(result_qdd, qdd)
        call results%put(result_driving_force, force)
        if (solver /= solver_reduced) call results%put(result_reaction, reaction)
        do k = 1, size(case%q, 2)
            given_qdd(:, k) = merge(0.0_wp, case%qdd(:, k), unknown%acceleration)
            given_force(:, k) = merge(0.0_wp, case%force(:, k), unknown%drive)
        end do
        motion = motion_of(case%q, case%qd, given_qdd, case%load)
        motion%given_force => given_force
        call run_prepared(case%model, forward, 1, motion, results)
        call forward%free()
        ! At constant rates the accelerations found are what is left of much larger ones.
        scale = max(maxval(abs(case%qdd)), maxval(abs(case%qd))**2)
        call check_close(error, qdd, case%qdd, tolerance*scale, trim(solver_name(solver))//": accelerations")
        call check_close(error, force, case%force, tolerance*maxval(abs(case%force)), &
                         trim(solver_name(solver))//": driving forces")
        if (solver == solver_reduced) return
        call check_close(error, reshape(reaction, [size(reaction)]), reshape(case%reaction, [size(reaction)]), &
                         tolerance*maxval(abs(case%reaction)), trim(solver_name(solver))//": reactions")
    end subroutine compare

    subroutine test_forward(error)
        type(test_error), intent(inout) :: error
        type(motion_case) :: case
        type(unknown_choice) :: unknown
        character(len=18), parameter :: scene(4) = [character(len=18) :: "stewart_drilling", "stewart_tsai", "stewart_aris", &
            "rcsp_start"]
        integer :: i, solver

        do i = 1, size(scene)
            call make_case(trim(scene(i)), case, error)
            if (allocated(error%message)) return
            unknown = find_drives(case%model)
            unknown%acceleration = .true.
            unknown%drive = .false.
            do solver = solver_gauss_jordan, solver_reduced
                call compare(case, unknown, solver, error)
            end do
        end do
    end subroutine test_forward

    !> Position driven, orientation free: three driving forces found, three given.
    !> Legs carried by the platform (`reduced`) against columns for every link.
    subroutine test_general_legs(error)
        type(test_error), intent(inout) :: error
        type(motion_case) :: case
        type(unknown_choice) :: unknown

        call make_case("stewart_drilling", case, error, skewed=.true.)
        if (allocated(error%message)) return
        call check(error, size(case%load, 2) > 0, "the scene has loads")
        unknown = find_drives(case%model)
        call compare(case, unknown, solver_reduced, error)
        unknown%acceleration = .true.
        unknown%drive = .false.
        call compare(case, unknown, solver_reduced, error)
    end subroutine test_general_legs

    subroutine test_mixed(error)
        type(test_error), intent(inout) :: error
        type(motion_case) :: case
        type(unknown_choice) :: unknown
        integer :: solver

        call make_case("stewart_drilling", case, error)
        if (allocated(error%message)) return
        unknown = find_drives(case%model)
        unknown%drive = [.true., .false., .true., .false., .true., .false.]
        unknown%acceleration = [.false., .false., .false., .true., .true., .true.]
        do solver = solver_gauss_jordan, solver_reduced
            call compare(case, unknown, solver, error)
        end do
    end subroutine test_mixed

    !> Every planar dyad between two moving links, a group closed by iteration, and the planar examples.
    subroutine test_planar_steps(error)
        type(test_error), intent(inout) :: error
        character(len=3), parameter :: signature(6) = ["RRR", "RRP", "PRR", "RPR", "PRP", "PPR"]
        character(len=16), parameter :: name(7) = [character(len=16) :: "fourbar", "sixbar_slider", "fivebar_parallel", &
            "slider_crank", "andrews", "watt_i", "stephenson_iii"]
        type(scene_type) :: scene
        type(motion_case) :: case
        integer :: i

        do i = 1, size(signature)
            call dyad_scene(signature(i), scene)
            call set_in_motion(scene)
            call make_case_of(scene, case, error)
            if (.not. allocated(error%message)) call compare_all(case, error)
            if (allocated(error%message)) return
        end do
        call triad_scene(scene)
        call set_in_motion(scene)
        call make_case_of(scene, case, error)
        if (.not. allocated(error%message)) call compare_all(case, error)
        do i = 1, size(name)
            if (allocated(error%message)) return
            call make_case(trim(name(i)), case, error)
            if (.not. allocated(error%message)) call compare_all(case, error)
        end do
    end subroutine test_planar_steps

    !> All accelerations from all driving forces, by every solver.
    subroutine compare_all(case, error)
        type(motion_case), intent(in) :: case
        type(test_error), intent(inout) :: error
        type(unknown_choice) :: unknown
        integer :: solver

        unknown = find_drives(case%model)
        unknown%acceleration = .true.
        unknown%drive = .false.
        do solver = solver_gauss_jordan, solver_reduced
            call compare(case, unknown, solver, error)
        end do
    end subroutine compare_all

    !> Harmonic motion about the start, another for each coordinate.
    subroutine set_in_motion(scene)
        type(scene_type), intent(inout) :: scene
        integer :: k

        do k = 1, size(scene%coordinate)
            associate (c => scene%coordinate(k))
                c%motion%kind = law_harmonic
                c%motion%value = [c%start_position, 0.05_wp, 3.0_wp + k, 0.3_wp*k]
            end associate
        end do
        scene%time%last = 1
    end subroutine set_in_motion

    !> One crank of a dyad driven, the other free.
    subroutine test_planar_mixed(error)
        type(test_error), intent(inout) :: error
        type(scene_type) :: scene
        type(motion_case) :: case
        type(unknown_choice) :: unknown
        integer :: solver

        call dyad_scene("RRP", scene)
        call set_in_motion(scene)
        call make_case_of(scene, case, error)
        if (allocated(error%message)) return
        unknown = find_drives(case%model)
        unknown%drive = [.true., .false.]
        unknown%acceleration = [.false., .true.]
        do solver = solver_gauss_jordan, solver_reduced
            call compare(case, unknown, solver, error)
        end do
    end subroutine test_planar_mixed

    subroutine test_measures(error)
        type(test_error), intent(inout) :: error
        type(motion_case), target :: case
        type(unknown_choice) :: unknown
        type(inverse_solver) :: forward
        type(inverse_results) :: results
        type(status_type) :: status
        real(wp), allocatable, target :: gap(:), imbalance(:), no_acceleration(:, :)
        real(wp), allocatable :: zero(:)
        type(motion_batch) :: motion
        integer :: n

        call make_case("stewart_drilling", case, error)
        if (allocated(error%message)) return
        unknown = find_drives(case%model)
        unknown%acceleration = .true.
        unknown%drive = .false.
        call build_equations(case%model, solver_elimination, .false., forward%equations, status, unknown)
        n = size(case%q, 2)
        allocate (gap(n), imbalance(n))
        allocate (zero(n), source=0.0_wp)
        call results%put(result_closure, gap)
        call results%put(result_power_imbalance, imbalance)
        no_acceleration = 0*case%qdd
        motion = motion_of(case%q, case%qd, no_acceleration, case%load)
        motion%given_force => case%force
        call run_prepared(case%model, forward, 1, motion, results)
        call forward%free()
        call check_close(error, gap, zero, 16*epsilon(1.0_wp), "closure [m]")
        call check_close(error, imbalance, zero, tolerance, "power imbalance")
    end subroutine test_measures

    !> The CSP group: joints closed, reactions without power, velocities that are differences of positions and velocity
    !> columns that make them.
    subroutine test_csp(error)
        type(test_error), intent(inout) :: error
        type(motion_case) :: case
        type(inverse_results) :: results
        type(status_type) :: status
        integer, parameter :: n = 21
        integer, parameter :: plain(4) = [1, 2, 3, 7]
        real(wp), parameter :: h = epsilon(1.0_wp)**(1.0_wp/3)
        real(wp), target, dimension(n) :: gap, imbalance
        real(wp), target, dimension(7, n) :: variable, ahead, behind, rate, rate_ahead, rate_behind
        real(wp) :: zero(n)

        call make_case("rcsp_start", case, error)
        if (allocated(error%message)) return
        zero = 0
        call results%put(result_closure, gap)
        call results%put(result_power_imbalance, imbalance)
        call results%put(result_joint_variable, variable)
        call results%put(result_joint_rate, rate)
        call run_inverse(case%model, inverse_options(), case%q, case%qd, case%qdd, case%load, results, status)
        call check_close(error, gap, zero, 16*epsilon(1.0_wp), "closure")
        call check_close(error, imbalance, zero, tolerance, "power imbalance")
        call check(error, all(maxval(abs(rate), 2) > 0.1_wp), "the joints move")
        nullify (results%of(result_closure)%x, results%of(result_power_imbalance)%x)
        call results%put(result_joint_variable, ahead)
        call results%put(result_joint_rate, rate_ahead)
        call run_inverse(case%model, inverse_options(), case%q + h*case%qd, case%qd + h*case%qdd, case%qdd, case%load, &
                         results, status)
        call results%put(result_joint_variable, behind)
        call results%put(result_joint_rate, rate_behind)
        call run_inverse(case%model, inverse_options(), case%q - h*case%qd, case%qd - h*case%qdd, case%qdd, case%load, &
                         results, status)
        ahead = ahead - behind
        ahead = ahead - two_pi*nint(ahead/two_pi)    ! angles pass from pi to -pi
        ! Central differences keep two thirds of the digits.
        call check_close(error, ahead(plain, :)/(2*h), rate(plain, :), 1.0e3_wp*h**2, "rates of R, C and P")
    end subroutine test_csp
end module test_accelerations
