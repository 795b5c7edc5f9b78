!> Inverse dynamics of batches: four solvers, Newton-Euler of every link, power, threads, failed and singular samples.
module test_inverse
    use, intrinsic :: ieee_arithmetic, only: ieee_is_nan, ieee_is_finite, ieee_value, ieee_quiet_nan
    use linkdyn_result_kinds, only: result_driving_force, result_error, result_growth, result_joint_rate, &
        result_joint_variable, result_power_imbalance, result_rcond, result_reaction
    use linkdyn_alike_models, only: describe_alike
    use linkdyn_builder, only: build_model
    use linkdyn_cross, only: cross
    use linkdyn_equation_kernels, only: kernel_family, found_family, end_family
    use linkdyn_equations, only: equations_type, build_equations, share_equations, free_equations
    use linkdyn_inverse, only: inverse_options, inverse_results, run_inverse, solver_gauss_jordan, solver_lapack, &
        solver_elimination, solver_reduced, solver_name
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state, prepare_kinematics
    use linkdyn_lane_count, only: lanes
    use linkdyn_led_mechanism, only: evaluate_kinematics
    use linkdyn_model, only: model_type
    use linkdyn_scene, only: scene_type, joint_revolute, joint_prismatic, joint_cylindrical, joint_universal, joint_spherical, &
        axes_link
    use linkdyn_scene_reader, only: read_scene
    use linkdyn_status, only: status_type, status_bad_input, sample_ok, sample_unreachable, sample_singular
    use linkdyn_test_numbers, only: random_stream, eps
    use linkdyn_test_scenes, only: stewart_scene, stewart_on_carriage, open_chain_scene, new_scene, add_link, add_pose, &
        add_load, add_ups_leg, start_at, base_point, platform_point
    use linkdyn_testing, only: test_error, unit_test, new_test, check, check_close
    use linkdyn_text, only: to_text
    use linkdyn_vec3, only: lane_of, mat3_lane
    implicit none (type, external)
    private
    public :: collect_inverse

    real(wp), parameter :: pi = acos(-1.0_wp)
    integer, parameter :: n_scene = 4
    character(len=16), parameter :: scene_name(n_scene) = &
        [character(len=16) :: "Stewart", "massless legs", "on a carriage", "open chain"]

    !> Samples to be computed.
    type :: batch_type
        integer :: n = 0
        real(wp), allocatable :: q(:, :), qd(:, :), qdd(:, :), load(:, :, :)
    end type batch_type

contains

    subroutine collect_inverse(tests)
        type(unit_test), allocatable, intent(out) :: tests(:)

        tests = [ &
            new_test("solvers agree", test_solvers), &
            new_test("Newton-Euler of every link", test_balance), &
            new_test("what a joint cannot transmit", test_transmission), &
            new_test("power balance", test_power), &
            new_test("joint variables", test_joint_variables), &
            new_test("driving forces alone", test_driving_only), &
            new_test("threads", test_threads), &
            new_test("length zero", test_unreachable), &
            new_test("not a number", test_nan), &
            new_test("Fichter's singular pose", test_singular_pose), &
            new_test("towards the singular pose", test_near_singular), &
            new_test("singular in every pose", test_architecture), &
            new_test("reduced has no reactions", test_reduced_refusal), &
            new_test("designs share kernels", test_family), &
            new_test("designs with gears, motors, friction, laws, cams share kernels", test_families_of_features)]
    end subroutine collect_inverse

    ! ---------------------------------------------------------------- set-up

    subroutine take_scene(error, which, model, batch)
        type(test_error), intent(inout) :: error
        integer, intent(in) :: which
        type(model_type), intent(out) :: model
        type(batch_type), intent(out) :: batch
        type(scene_type) :: scene

        select case (which)
        case (1)
            call stewart_scene(scene, .false.)
        case (2)
            call stewart_scene(scene, .true.)
        case (3)
            call stewart_on_carriage(scene)
        case default
            call open_chain_scene(scene, .false.)
        end select
        call plan(error, scene, model)
        call make_batch(model, 2*lanes + 3, batch)
    end subroutine take_scene

    subroutine plan(error, scene, model)
        type(test_error), intent(inout) :: error
        type(scene_type), intent(in) :: scene
        type(model_type), intent(out) :: model
        type(status_type) :: status

        call build_model(scene, model, status)
        call check(error, status%is_ok(), "planned: "//trim(status%message))
    end subroutine plan

    !> Random motion about the start, random loads.
    subroutine make_batch(model, n, batch)
        type(model_type), intent(in) :: model
        integer, intent(in) :: n
        type(batch_type), intent(out) :: batch
        type(random_stream) :: stream

        batch%n = n
        batch%q = spread(model%scene%coordinate%start_position, 2, n) &
                  + 0.25_wp*reshape(stream%vector(model%n_q*n), [model%n_q, n])
        batch%qd = reshape(stream%vector(model%n_q*n), [model%n_q, n])
        batch%qdd = 3*reshape(stream%vector(model%n_q*n), [model%n_q, n])
        batch%load = 500*reshape(stream%vector(6*model%n_load*n), [6, model%n_load, n])
    end subroutine make_batch

    !> Run a batch; every kind of result is made room for (reactions only if wanted).
    subroutine solve(error, model, batch, solver, results, threads, reactions)
        type(test_error), intent(inout) :: error
        type(model_type), intent(in) :: model
        type(batch_type), intent(in) :: batch
        integer, intent(in) :: solver
        type(inverse_results), intent(inout) :: results
        integer, intent(in), optional :: threads
        logical, intent(in), optional :: reactions
        type(inverse_options) :: options
        type(status_type) :: status
        integer, parameter :: told(8) = [result_driving_force, result_rcond, result_error, result_growth, &
            result_power_imbalance, result_joint_variable, result_joint_rate, result_reaction]
        logical :: wants_reactions
        integer :: i

        call release(results)
        wants_reactions = solver /= solver_reduced
        if (present(reactions)) wants_reactions = reactions
        options%solver = solver
        if (present(threads)) options%threads = threads
        associate (n => batch%n)
            allocate (results%status(n))
            do i = 1, merge(size(told), size(told) - 1, wants_reactions)
                call results%add(model, told(i), n)
            end do
        end associate
        call run_inverse(model, options, batch%q, batch%qd, batch%qdd, batch%load, results, status)
        call check(error, status%is_ok(), trim(solver_name(solver))//": "//trim(status%message))
    end subroutine solve

    subroutine release(results)
        type(inverse_results), intent(inout) :: results

        if (associated(results%status)) deallocate (results%status)
        call results%free()
    end subroutine release

    !> The largest force or moment of a sample.
    real(wp) function size_of(results, i)
        type(inverse_results), intent(in) :: results
        integer, intent(in) :: i

        size_of = maxval(abs(results%at(result_driving_force, i)))
        if (results%wants(result_reaction)) size_of = max(size_of, maxval(abs(results%at(result_reaction, i))))
    end function size_of

    ! ---------------------------------------------------------------- solvers

    subroutine test_solvers(error)
        type(test_error), intent(inout) :: error
        type(model_type) :: model
        type(batch_type) :: batch
        type(inverse_results) :: want, got
        integer, parameter :: solvers(3) = [solver_gauss_jordan, solver_elimination, solver_reduced]
        character(len=:), allocatable :: what
        real(wp) :: tol
        integer :: s, k, i

        do s = 1, n_scene
            call take_scene(error, s, model, batch)
            call solve(error, model, batch, solver_lapack, want)
            call check(error, all(want%status == sample_ok), trim(scene_name(s))//": all solved")
            call check(error, all(want%of(result_rcond)%x > 1.0e-8_wp), trim(scene_name(s))//": well-conditioned")
            call check(error, all(want%of(result_error)%x < 1000*eps/want%of(result_rcond)%x), trim(scene_name(s))//": error bound")
            do k = 1, size(solvers)
                what = trim(scene_name(s))//", "//trim(solver_name(solvers(k)))
                call solve(error, model, batch, solvers(k), got)
                if (allocated(error%message)) return
                call check(error, all(got%status == sample_ok), what//": all solved")
                if (solvers(k) == solver_elimination) call check(error, got%roads%dense == 0, what//": no fallback")
                do i = 1, batch%n
                    tol = 100*eps/want%of(result_rcond)%x(1, i)*size_of(want, i)
                    call check_close(error, got%at(result_driving_force, i), want%at(result_driving_force, i), tol, &
                                     what//": driving force")
                    if (solvers(k) == solver_reduced) cycle
                    call check_close(error, got%at(result_reaction, i), want%at(result_reaction, i), tol, what//": reaction")
                end do
            end do
        end do
        call release(want)
        call release(got)
    end subroutine test_solvers

    subroutine test_driving_only(error)
        type(test_error), intent(inout) :: error
        type(model_type) :: model
        type(batch_type) :: batch
        type(inverse_results) :: want, got
        integer :: s, i

        do s = 1, n_scene
            call take_scene(error, s, model, batch)
            call solve(error, model, batch, solver_lapack, want)
            call solve(error, model, batch, solver_elimination, got, reactions=.false.)
            if (allocated(error%message)) return
            call check(error, got%roads%dense == 0, "no fallback")
            do i = 1, batch%n
                call check_close(error, got%at(result_driving_force, i), want%at(result_driving_force, i), &
                                 100*eps/want%of(result_rcond)%x(1, i)*size_of(want, i), trim(scene_name(s)))
            end do
        end do
        call release(want)
        call release(got)
    end subroutine test_driving_only

    subroutine test_reduced_refusal(error)
        type(test_error), intent(inout) :: error
        type(model_type) :: model
        type(batch_type) :: batch
        type(inverse_results) :: results
        type(inverse_options) :: options
        type(status_type) :: status

        call take_scene(error, 1, model, batch)
        call results%add(model, result_reaction, batch%n)
        options%solver = solver_reduced
        call run_inverse(model, options, batch%q, batch%qd, batch%qdd, batch%load, results, status)
        call check(error, status%code == status_bad_input .and. index(status%message, "reduced") > 0, "refused by name")
        call results%free()
    end subroutine test_reduced_refusal

    ! ---------------------------------------------------------------- balance

    subroutine test_balance(error)
        type(test_error), intent(inout) :: error
        type(model_type) :: model
        type(batch_type) :: batch
        type(inverse_results) :: results
        integer, parameter :: solvers(3) = [solver_gauss_jordan, solver_lapack, solver_elimination]
        integer :: s, k, i

        do s = 1, n_scene
            call take_scene(error, s, model, batch)
            do k = 1, size(solvers)
                call solve(error, model, batch, solvers(k), results)
                if (allocated(error%message)) return
                do i = 1, batch%n, 7
                    ! Backward stable elimination: rounding of the largest wrench, whatever the condition.
                    call check(error, unbalanced(model, batch, results, i) <= 1000*eps, &
                               trim(scene_name(s))//", "//trim(solver_name(solvers(k)))//": "// &
                               to_text(unbalanced(model, batch, results, i)/eps)//" eps")
                end do
            end do
        end do
        call release(results)
    end subroutine test_balance

    !> What Newton-Euler of the links leaves over, relative to the largest wrench: reactions, driving forces, loads and
    !> gravity summed link by link in world axes, about the centre of mass.
    real(wp) function unbalanced(model, batch, results, i) result(worst)
        type(model_type), intent(in) :: model
        type(batch_type), intent(in) :: batch
        type(inverse_results), intent(in) :: results
        integer, intent(in) :: i
        type(kinematic_state) :: state
        real(wp), dimension(3, model%n_link) :: force, moment, cog
        real(wp) :: r(3, 3), omega(3), alpha(3), arm(3), h(3), at(3), f(3), m(3), largest
        real(wp), allocatable :: wrench(:, :)
        integer :: l, j, k, o, side, link

        call prepare_kinematics(model, 0, state)
        state%q = spread(batch%q(:, i), 1, lanes)
        state%qd = spread(batch%qd(:, i), 1, lanes)
        state%qdd = spread(batch%qdd(:, i), 1, lanes)
        call evaluate_kinematics(model, state)

        largest = 0
        do l = 1, model%n_link
            o = model%link(l)%orientation
            r = mat3_lane(state%rotation(o), 1)
            omega = lane_of(state%omega(o), 1)
            alpha = lane_of(state%alpha(0, o), 1)
            arm = matmul(r, model%scene%link(l)%cog)
            cog(:, l) = lane_of(state%position(l), 1) + arm
            force(:, l) = -model%scene%link(l)%mass*(lane_of(state%acceleration(0, l), 1) - model%scene%gravity &
                                                     + cross(alpha, arm) + cross(omega, cross(omega, arm)))
            h = matmul(r, matmul(tensor(model%scene%link(l)%inertia), matmul(transpose(r), omega)))
            moment(:, l) = -matmul(r, matmul(tensor(model%scene%link(l)%inertia), matmul(transpose(r), alpha))) - cross(omega, h)
            largest = max(largest, maxval(abs(force(:, l))), maxval(abs(moment(:, l))))
        end do

        do j = 1, model%n_load
            associate (spec => model%scene%load(j))
                r = mat3_lane(state%rotation(model%link(spec%link)%orientation), 1)
                f = batch%load(1:3, j, i)
                m = batch%load(4:6, j, i)
                if (spec%axes == axes_link) then
                    f = matmul(r, f)
                    m = matmul(r, m)
                end if
                at = lane_of(state%position(spec%link), 1) + matmul(r, model%scene%link(spec%link)%marker(spec%marker)%at)
                call act(spec%link, 1)
            end associate
        end do

        wrench = reshape(results%at(result_reaction, i), [6, model%n_joint])
        do j = 1, model%n_joint
            at = joint_point(model, state, j)
            f = wrench(1:3, j)
            m = wrench(4:6, j)
            do k = 1, model%n_actuator
                associate (drive => model%scene%actuator(k))
                    if (drive%joint /= j) cycle
                    side = 1
                    if (model%joint(j)%kind == joint_universal) side = drive%variable
                    arm = results%of(result_driving_force)%x(k, i)*joint_axis(model, state, j, side)
                    if (model%joint(j)%kind == joint_prismatic .or. &
                        (model%joint(j)%kind == joint_cylindrical .and. drive%variable == 2)) then
                        f = f + arm
                    else
                        m = m + arm
                    end if
                end associate
            end do
            do side = 1, 2
                link = model%joint(j)%link(side)
                if (link > 0) call act(link, merge(1, -1, side == 2))
            end do
        end do
        worst = max(maxval(abs(force)), maxval(abs(moment)))/largest

    contains

        !> Let the wrench act on a link, or its opposite.
        subroutine act(link, sign)
            integer, intent(in) :: link, sign

            force(:, link) = force(:, link) + sign*f
            moment(:, link) = moment(:, link) + sign*(m + cross(at - cog(:, link), f))
            largest = max(largest, maxval(abs(f)), maxval(abs(m)))
        end subroutine act
    end function unbalanced

    pure function tensor(t) result(m)
        real(wp), intent(in) :: t(6)
        real(wp) :: m(3, 3)

        m = reshape([t(1), t(4), t(6), t(4), t(2), t(5), t(6), t(5), t(3)], [3, 3])
    end function tensor

    !> The marker on the second link, world.
    function joint_point(model, state, j) result(at)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        integer, intent(in) :: j
        real(wp) :: at(3)
        integer :: link, o

        link = model%joint(j)%link(2)
        o = 0
        if (link > 0) o = model%link(link)%orientation
        at = lane_of(state%position(link), 1) + matmul(mat3_lane(state%rotation(o), 1), model%joint(j)%point(:, 2))
    end function joint_point

    !> Axis of the marker on one of the links, world.
    function joint_axis(model, state, j, side) result(axis)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        integer, intent(in) :: j, side
        real(wp) :: axis(3)
        integer :: o

        o = 0
        if (model%joint(j)%link(side) > 0) o = model%link(model%joint(j)%link(side))%orientation
        axis = matmul(mat3_lane(state%rotation(o), 1), model%joint(j)%frame(:, 3, side))
    end function joint_axis

    !> No moment about a free axis, no force along a slide: those belong to the drive.
    subroutine test_transmission(error)
        type(test_error), intent(inout) :: error
        type(model_type) :: model
        type(batch_type) :: batch
        type(inverse_results) :: results
        type(kinematic_state) :: state
        real(wp) :: axis(3, 2), tol, f(3), m(3)
        real(wp), allocatable :: wrench(:, :)
        character(len=:), allocatable :: name
        integer :: s, i, j

        do s = 1, n_scene
            call take_scene(error, s, model, batch)
            call solve(error, model, batch, solver_elimination, results)
            if (allocated(error%message)) return
            call prepare_kinematics(model, 0, state)
            do i = 1, batch%n, 9
                state%q = spread(batch%q(:, i), 1, lanes)
                state%qd = 0
                state%qdd = 0
                call evaluate_kinematics(model, state)
                tol = 100*eps*size_of(results, i)
                wrench = reshape(results%at(result_reaction, i), [6, model%n_joint])
                do j = 1, model%n_joint
                    axis(:, 1) = joint_axis(model, state, j, 1)
                    axis(:, 2) = joint_axis(model, state, j, 2)
                    f = wrench(1:3, j)
                    m = wrench(4:6, j)
                    name = trim(model%joint(j)%name)
                    associate (kind => model%joint(j)%kind)
                        if (kind == joint_prismatic .or. kind == joint_cylindrical) &
                            call check_close(error, dot_product(f, axis(:, 1)), 0.0_wp, tol, name//": force along the slide")
                        if (kind == joint_revolute .or. kind == joint_cylindrical .or. kind == joint_universal) &
                            call check_close(error, dot_product(m, axis(:, 1)), 0.0_wp, tol, name//": moment about the axis")
                        if (kind == joint_universal) &
                            call check_close(error, dot_product(m, axis(:, 2)), 0.0_wp, tol, name//": moment about axis 2")
                        if (kind == joint_spherical) call check_close(error, m, [0.0_wp, 0.0_wp, 0.0_wp], tol, name//": moment")
                    end associate
                end do
            end do
        end do
        call release(results)
    end subroutine test_transmission

    subroutine test_power(error)
        type(test_error), intent(inout) :: error
        type(model_type) :: model
        type(batch_type) :: batch
        type(inverse_results) :: results
        integer :: s, k

        do s = 1, n_scene
            call take_scene(error, s, model, batch)
            do k = solver_gauss_jordan, solver_reduced
                call solve(error, model, batch, k, results)
                if (allocated(error%message)) return
                call check_close(error, results%of(result_power_imbalance)%x(1, :), spread(0.0_wp, 1, batch%n), 100*eps, &
                                 trim(scene_name(s))//", "//trim(solver_name(k)))
            end do
        end do
        call release(results)
    end subroutine test_power

    !> In an open chain the joint variables are the coordinates, backwards joints included; a leg's slide is its length.
    subroutine test_joint_variables(error)
        type(test_error), intent(inout) :: error
        type(model_type) :: model
        type(batch_type) :: batch
        type(inverse_results) :: results
        real(wp) :: span(3), c(3), s(3), r(3, 3)
        integer :: i, k

        call take_scene(error, 4, model, batch)
        call solve(error, model, batch, solver_elimination, results)
        call check_close(error, results%of(result_joint_variable)%x, batch%q, 100*eps, "variables are the coordinates")
        call check_close(error, results%of(result_joint_rate)%x, batch%qd, 200*eps, "rates are theirs")

        call take_scene(error, 1, model, batch)
        call solve(error, model, batch, solver_elimination, results)
        do i = 1, batch%n
            c = cos(batch%q(4:6, i))
            s = sin(batch%q(4:6, i))
            ! Rx Ry Rz written out.
            r(:, 1) = [c(2)*c(3), c(1)*s(3) + s(1)*s(2)*c(3), s(1)*s(3) - c(1)*s(2)*c(3)]
            r(:, 2) = [-c(2)*s(3), c(1)*c(3) - s(1)*s(2)*s(3), s(1)*c(3) + c(1)*s(2)*s(3)]
            r(:, 3) = [s(2), -s(1)*c(2), c(1)*c(2)]
            do k = 1, 6
                span = batch%q(1:3, i) + matmul(r, platform_point(:, k)) - base_point(:, k)
                ! Variables of a leg: two angles, the slide, three angles.
                call check_close(error, results%of(result_joint_variable)%x(6*k - 3, i), norm2(span), 50*eps, &
                                 "length of leg "//to_text(k))
            end do
        end do
        call release(results)
    end subroutine test_joint_variables

    ! ---------------------------------------------------------------- threads and failures

    subroutine test_threads(error)
        type(test_error), intent(inout) :: error
        type(model_type) :: model
        type(batch_type) :: batch
        type(inverse_results) :: want, got
        integer :: threads, k

        call take_scene(error, 3, model, batch)
        call make_batch(model, 5*lanes + 2, batch)
        do k = solver_gauss_jordan, solver_reduced
            call solve(error, model, batch, k, want, threads=1)
            do threads = 2, 3
                call solve(error, model, batch, k, got, threads=threads)
                if (allocated(error%message)) return
                call check_close(error, got%of(result_driving_force)%x, want%of(result_driving_force)%x, 0.0_wp, "driving force")
                call check_close(error, got%of(result_power_imbalance)%x, want%of(result_power_imbalance)%x, 0.0_wp, "power")
                call check_close(error, got%of(result_joint_rate)%x, want%of(result_joint_rate)%x, 0.0_wp, "joint rates")
                if (k /= solver_reduced) call check_close(error, got%of(result_reaction)%x, &
                                                          want%of(result_reaction)%x, 0.0_wp, "reaction")
                call check(error, all(got%status == want%status), "status")
            end do
        end do
        call release(want)
        call release(got)
    end subroutine test_threads

    !> A platform joint exactly on its base joint.
    subroutine test_unreachable(error)
        type(test_error), intent(inout) :: error
        type(scene_type) :: scene
        type(model_type) :: model
        type(batch_type) :: batch, spoilt
        integer :: k

        call stewart_scene(scene, .false.)
        ! Points that the machine adds and subtracts without rounding.
        do k = 1, size(scene%frame%marker)
            scene%frame%marker(k)%at = anint(64*scene%frame%marker(k)%at)/64
        end do
        do k = 1, size(scene%link(1)%marker)
            scene%link(1)%marker(k)%at = anint(64*scene%link(1)%marker(k)%at)/64
        end do
        call plan(error, scene, model)
        if (allocated(error%message)) return
        call make_batch(model, lanes + 3, batch)
        spoilt = batch
        k = max(1, lanes - 1)
        spoilt%q(1:3, k) = model%joint(1)%point(:, 1) - model%joint(3)%point(:, 2)
        spoilt%q(4:6, k) = 0
        call compare_spoilt(error, model, batch, spoilt, k, .true.)
    end subroutine test_unreachable

    !> NaN among the coordinates, the rates, the accelerations, the loads.
    subroutine test_nan(error)
        type(test_error), intent(inout) :: error
        type(model_type) :: model
        type(batch_type) :: batch, spoilt
        real(wp) :: nan
        integer :: s, k

        nan = ieee_value(1.0_wp, ieee_quiet_nan)
        do s = 1, n_scene
            call take_scene(error, s, model, batch)
            k = lanes + 1
            spoilt = batch
            spoilt%q(model%n_q, k) = nan
            call compare_spoilt(error, model, batch, spoilt, k, .false.)
            spoilt = batch
            spoilt%qd(1, k) = nan
            call compare_spoilt(error, model, batch, spoilt, k, .false.)
            spoilt = batch
            spoilt%qdd(1, k) = nan
            call compare_spoilt(error, model, batch, spoilt, k, .false.)
            spoilt = batch
            spoilt%load(5, 1, k) = nan
            call compare_spoilt(error, model, batch, spoilt, k, .false.)
        end do
    end subroutine test_nan

    !> Sample k fails, is NaN, and nothing else changes by a bit.
    subroutine compare_spoilt(error, model, batch, spoilt, k, is_unreachable)
        type(test_error), intent(inout) :: error
        type(model_type), intent(in) :: model
        type(batch_type), intent(in) :: batch, spoilt
        integer, intent(in) :: k
        logical, intent(in) :: is_unreachable
        type(inverse_results) :: want, got
        character(len=:), allocatable :: what
        integer :: solver, i

        do solver = solver_gauss_jordan, solver_reduced
            what = trim(solver_name(solver))
            call solve(error, model, batch, solver, want)
            call solve(error, model, spoilt, solver, got)
            if (allocated(error%message)) return
            call check(error, got%status(k) /= sample_ok, what//": flagged")
            if (is_unreachable) call check(error, got%status(k) == sample_unreachable, what//": flagged as unreachable")
            call check(error, all(ieee_is_nan(got%at(result_driving_force, k))), what//": driving forces are NaN")
            if (got%wants(result_reaction)) call check(error, all(ieee_is_nan(got%at(result_reaction, k))), &
                                                          what//": reactions are NaN")
            do i = 1, batch%n
                if (i == k) cycle
                call check(error, got%status(i) == want%status(i), what//": neighbours' status")
                call check_close(error, got%at(result_driving_force, i), want%at(result_driving_force, i), 0.0_wp, &
                                 what//": neighbours")
                if (got%wants(result_reaction)) &
                    call check_close(error, got%at(result_reaction, i), want%at(result_reaction, i), 0.0_wp, &
                                                               what//": neighbours' reactions")
            end do
        end do
        call release(want)
        call release(got)
    end subroutine compare_spoilt

    ! ---------------------------------------------------------------- singular poses

    !> Octahedral platform: three double joints on each triangle. Turned by 90 degrees about z from where the triangles
    !> are opposed, it has a finite screw motion about z that no leg resists.
    !>
    !> **Source**: Fichter, Int. J. Robotics Research 5 (1986) 157.
    subroutine octahedral_scene(scene)
        type(scene_type), intent(out) :: scene
        real(wp) :: base(3), top(3)
        integer :: platform, i, side

        call new_scene(scene)
        platform = add_link(scene, "platform", 100.0_wp, [0.02_wp, -0.03_wp, 0.1_wp], &
                            [10.0_wp, 12.0_wp, 20.0_wp, 0.5_wp, -0.3_wp, 0.2_wp])
        call add_pose(scene, platform)
        call add_load(scene, platform, [0.1_wp, 0.2_wp, 0.3_wp], axes_link)
        do i = 1, 3
            base = [cos((i - 1)*2*pi/3), sin((i - 1)*2*pi/3), 0.0_wp]
            do side = -1, 1, 2
                top = [cos((i - 1)*2*pi/3 + side*pi/3), sin((i - 1)*2*pi/3 + side*pi/3), 0.0_wp]
                call add_ups_leg(scene, "leg"//to_text(2*i + (side - 1)/2), 0, base, &
                                 [-base(2), base(1), 0.3_wp]/sqrt(1.09_wp), platform, top, .false.)
            end do
        end do
        call start_at(scene, [0.02_wp, 0.03_wp, 1.2_wp, 0.0_wp, 0.0_wp, 0.0_wp])
    end subroutine octahedral_scene

    subroutine test_singular_pose(error)
        type(test_error), intent(inout) :: error
        type(scene_type) :: scene
        type(model_type) :: model
        type(batch_type) :: batch
        type(inverse_results) :: results
        integer :: solver, k

        call octahedral_scene(scene)
        call plan(error, scene, model)
        if (allocated(error%message)) return
        call make_batch(model, lanes, batch)
        k = max(1, lanes - 1)
        batch%q(:, k) = [0.0_wp, 0.0_wp, 1.1_wp, 0.0_wp, 0.0_wp, pi/2]
        do solver = solver_gauss_jordan, solver_elimination
            call solve(error, model, batch, solver, results)
            call check(error, is_told(results, k), trim(solver_name(solver))//": told")
            call check(error, count([(is_told(results, k), k=1, batch%n)]) == 1, trim(solver_name(solver))//": no other sample")
        end do
        call release(results)
    end subroutine test_singular_pose

    !> Was the user warned: by the status, by rcond, or (gauss-jordan has neither) by forces beyond all measure.
    logical function is_told(results, i)
        type(inverse_results), intent(in) :: results
        integer, intent(in) :: i

        is_told = results%status(i) == sample_singular .or. results%of(result_rcond)%x(1, i) < 1000*eps
        if (.not. is_told .and. ieee_is_finite(results%of(result_growth)%x(1, i))) is_told = size_of(results, i) > 1.0e-3_wp/eps
    end function is_told

    !> Closer and closer to the singular pose the forces grow without bound, but the elimination's stay as good as
    !> LAPACK's: within the condition of each other, and the links as well balanced.
    subroutine test_near_singular(error)
        type(test_error), intent(inout) :: error
        type(scene_type) :: scene
        type(model_type) :: model
        type(batch_type) :: batch
        type(inverse_results) :: want, got
        real(wp) :: rest(2)
        integer :: k

        call octahedral_scene(scene)
        call plan(error, scene, model)
        if (allocated(error%message)) return
        call make_batch(model, 8, batch)
        do k = 1, batch%n
            batch%q(:, k) = [0.0_wp, 0.0_wp, 1.1_wp, 0.0_wp, 0.0_wp, pi/2 - 0.1_wp**k]
        end do
        call solve(error, model, batch, solver_lapack, want)
        call solve(error, model, batch, solver_elimination, got)
        do k = 1, batch%n
            call check(error, want%status(k) == sample_ok .and. got%status(k) == sample_ok, to_text(k)//": solved")
            call check_close(error, got%at(result_driving_force, k), want%at(result_driving_force, k), &
                             100*eps/want%of(result_rcond)%x(1, k)*size_of(want, k), to_text(k)//": driving force")
            call check_close(error, got%at(result_reaction, k), want%at(result_reaction, k), &
                             100*eps/want%of(result_rcond)%x(1, k)*size_of(want, k), to_text(k)//": reaction")
            if (allocated(error%message)) return
            rest = [unbalanced(model, batch, want, k), unbalanced(model, batch, got, k)]
            ! LAPACK leaves a few eps; fixed pivots may leave what they are allowed in a regular pose, and no more.
            call check(error, rest(2) <= 10*rest(1) + 1000*eps, to_text(k)//": balance "//to_text(rest(2)/eps)//" eps, LAPACK " &
                       //to_text(rest(1)/eps)//" eps")
        end do
        call check(error, size_of(want, 8) > 1.0e5_wp*size_of(want, 1), "the forces do grow")
        call check(error, want%of(result_rcond)%x(1, 8) < 1.0e-5_wp*want%of(result_rcond)%x(1, 1), "and so does the condition")
        call release(want)
        call release(got)
    end subroutine test_near_singular

    !> Regular hexagons of joints, corresponding corners joined: no pose is regular. Not one sample may pass for solved.
    !>
    !> **Source**: Ma, Angeles, Proc. IEEE Int. Conf. Robotics and Automation (1991) 1542.
    subroutine test_architecture(error)
        type(test_error), intent(inout) :: error
        type(scene_type) :: scene
        type(model_type) :: model
        type(batch_type) :: batch
        type(inverse_results) :: results
        real(wp) :: corner(3)
        integer :: platform, i, solver

        call new_scene(scene)
        platform = add_link(scene, "platform", 100.0_wp, [0.02_wp, -0.03_wp, 0.1_wp], &
                            [10.0_wp, 12.0_wp, 20.0_wp, 0.5_wp, -0.3_wp, 0.2_wp])
        call add_pose(scene, platform)
        do i = 1, 6
            corner = [cos(i*pi/3), sin(i*pi/3), 0.0_wp]
            call add_ups_leg(scene, "leg"//to_text(i), 0, corner, [-corner(2), corner(1), 0.3_wp]/sqrt(1.09_wp), &
                             platform, 0.6_wp*corner, .false.)
        end do
        call start_at(scene, [0.02_wp, 0.03_wp, 1.2_wp, 0.1_wp, 0.0_wp, 0.1_wp])
        call plan(error, scene, model)
        if (allocated(error%message)) return
        call make_batch(model, lanes + 1, batch)
        do solver = solver_gauss_jordan, solver_elimination
            call solve(error, model, batch, solver, results)
            if (allocated(error%message)) return
            call check(error, all([(is_told(results, i), i=1, batch%n)]), trim(solver_name(solver))//": told")
        end do
        call release(results)
    end subroutine test_architecture

    !> Of models that differ in their numbers, not of one in which another number is zero, which leaves terms out.
    subroutine test_family(error)
        type(test_error), intent(inout) :: error
        integer, parameter :: head = 1, alike = 2, other = 3
        type(scene_type) :: scene
        type(model_type) :: model(3)
        type(equations_type) :: equations(3)
        type(kernel_family), pointer :: family
        type(status_type) :: status
        integer :: i

        do i = head, other
            call stewart_scene(scene, .false.)
            scene%link(1)%mass = 1.5_wp*i
            scene%link(1)%cog = [0.1_wp, 0.2_wp, merge(0.0_wp, 0.3_wp, i == other)]
            call build_model(scene, model(i), status)
            call check(error, status%is_ok(), "it is planned")
            call build_equations(model(i), solver_elimination, .true., equations(i), status)
            call check(error, status%is_ok(), "its equations are chosen")
        end do
        call found_family(model(head), family)
        call check(error, associated(family), "a hexapod has a family")
        if (.not. associated(family)) return
        do i = head, other
            call share_equations(model(i), family, equations(i))
        end do
        call check(error, associated(equations(head)%kernels, equations(alike)%kernels), "another mass")
        call check(error, .not. associated(equations(head)%kernels, equations(other)%kernels), "another zero")
        do i = head, other
            call free_equations(equations(i))
        end do
        call end_family(family)
    end subroutine test_family

    !> Another mass is another design of the same family, whatever there is beside links and joints; another surface is not.
    subroutine test_families_of_features(error)
        type(test_error), intent(inout) :: error
        character(len=16), parameter :: name(9) = [character(len=16) :: "delta", "hoist", "knuckle_press", "planetary_crank", &
            "screw_lift", "shaper", "ship_hexapod", "thread_guide", "valve_train"]
        character(len=:), allocatable :: key, other_key
        integer, allocatable :: varying(:)
        type(scene_type) :: scene
        type(model_type) :: model
        type(status_type) :: status
        integer :: i

        do i = 1, size(name)
            call read_scene("examples/"//trim(name(i))//"/scene.toml", scene, status)
            if (status%is_ok()) call build_model(scene, model, status)
            call check(error, status%is_ok(), trim(name(i))//" is planned")
            if (allocated(error%message)) return
            call describe_alike(model, key, varying)
            call check(error, len(key) > 0 .and. size(varying) > 0, trim(name(i))//" has a family")
            model%link%mass = 1.5_wp*model%link%mass
            call describe_alike(model, other_key, varying)
            call check(error, key == other_key, trim(name(i))//": another mass")
            if (size(model%contact) == 0) cycle
            model%contact(1)%radius = 1.5_wp*model%contact(1)%radius + 0.001_wp
            call describe_alike(model, other_key, varying)
            call check(error, key /= other_key, trim(name(i))//": another surface")
        end do
    end subroutine test_families_of_features
end module test_inverse
