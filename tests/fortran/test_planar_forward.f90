!> Forward runs in the plane, against motions that are known by other roads.
module test_planar_forward
    use linkdyn_result_kinds, only: result_closure, result_kinetic_energy, result_potential_energy
    use linkdyn_builder, only: build_model
    use linkdyn_constants, only: pi
    use linkdyn_ensemble, only: run_ensemble
    use linkdyn_forward, only: forward_options, forward_results, forward_run, integrator_options, &
        default_method, method_rk4
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state, prepare_kinematics
    use linkdyn_lane_count, only: lanes
    use linkdyn_led_mechanism, only: evaluate_kinematics
    use linkdyn_model, only: model_type
    use linkdyn_motion, only: evaluate_motion
    use linkdyn_planar_scenes, only: planar_scene, connect, drive, dyad_scene, triad_scene, four_bar_chain
    use linkdyn_scene, only: scene_type, spring_spec, effort_constant, joint_revolute
    use linkdyn_scene_reader, only: read_scene
    use linkdyn_status, only: status_type
    use linkdyn_test_scenes, only: new_scene, add_link, add_joint, add_joint_coordinates, start_at
    use linkdyn_testing, only: test_error, unit_test, new_test, check, check_close
    use linkdyn_whole_run, only: run_forward
    implicit none (type, external)
    private
    public :: collect_planar_forward

    real(wp), parameter :: origin(2) = 0

contains

    subroutine collect_planar_forward(tests)
        type(unit_test), allocatable, intent(out) :: tests(:)

        tests = [ &
            new_test("columns are central differences", test_columns), &
            new_test("four-bar started: order 4 in the step", test_start_order), &
            new_test("four-bar started: the default method to rounding", test_start_closely), &
            new_test("double pendulum by the textbook", test_double_pendulum), &
            new_test("the same pendulum in space", test_in_space), &
            new_test("energy with springs and slides", test_energy), &
            new_test("parallelogram through its change points", test_change_points), &
            new_test("ensemble on its own assemblies", test_ensemble), &
            new_test("one crank driven, one free", test_driven)]
    end subroutine collect_planar_forward

    !> Columns of positions' derivatives in every kind of step, open chains included.
    subroutine test_columns(error)
        type(test_error), intent(inout) :: error
        character(len=3), parameter :: signature(6) = ["RRR", "RRP", "PRR", "RPR", "PRP", "PPR"]
        type(scene_type) :: scene
        integer :: i

        do i = 1, size(signature)
            call dyad_scene(signature(i), scene)
            call compare_columns(scene, signature(i), error)
        end do
        call triad_scene(scene)
        call compare_columns(scene, "triad", error)
        call double_pendulum(scene)
        call start_at(scene, [0.3_wp, -0.8_wp])
        call compare_columns(scene, "open chain", error)
    end subroutine test_columns

    subroutine compare_columns(scene, name, error)
        type(scene_type), intent(in) :: scene
        character(len=*), intent(in) :: name
        type(test_error), intent(inout) :: error
        real(wp), parameter :: h = epsilon(1.0_wp)**(1.0_wp/3)
        type(model_type) :: model
        type(status_type) :: status
        type(kinematic_state) :: state, ahead, behind
        real(wp) :: got(3), want(3)
        integer :: k, l, o

        call build_model(scene, model, status)
        call check(error, status%is_ok(), name//": "//trim(status%message))
        if (.not. status%is_ok()) return
        call prepare_kinematics(model, model%n_q, state)
        call prepare_kinematics(model, 0, ahead)
        call prepare_kinematics(model, 0, behind)
        state%q = spread(model%start_q, 1, lanes)
        call evaluate_kinematics(model, state)
        do k = 1, model%n_q
            ahead%q = state%q
            behind%q = state%q
            ahead%q(:, k) = state%q(:, k) + h
            behind%q(:, k) = state%q(:, k) - h
            call evaluate_kinematics(model, ahead)
            call evaluate_kinematics(model, behind)
            do l = 1, model%n_link
                o = model%link(l)%orientation
                associate (a => ahead%plane, b => behind%plane)
                    got = [state%plane%linear(k, l)%x(1), state%plane%linear(k, l)%y(1), state%plane%angular(1, k, o)]
                    want = [a%position(l)%x(1) - b%position(l)%x(1), a%position(l)%y(1) - b%position(l)%y(1), &
                            asin(a%rotation(o)%s(1)*b%rotation(o)%c(1) - a%rotation(o)%c(1)*b%rotation(o)%s(1))]/(2*h)
                end associate
                ! Central differences keep two thirds of the digits; third derivatives are of order ten here.
                call check_close(error, got, want, 1.0e2_wp*h**2, name//": columns of "//trim(model%link(l)%name))
                call check(error, model%moves(k, l) .or. all(got == 0), name//": moved by its coordinates only")
            end do
        end do
    end subroutine compare_columns

    ! ---------------------------------------------------------------- the lecture's four-bar

    subroutine fourbar(model, error)
        type(model_type), intent(out) :: model
        type(test_error), intent(inout) :: error
        type(scene_type) :: scene
        type(status_type) :: status

        call read_scene("examples/fourbar/scene.toml", scene, status)
        if (status%is_ok()) call build_model(scene, model, status)
        call check(error, status%is_ok(), trim(status%message))
    end subroutine fourbar

    !> Largest error of the crank over the first 3 s, the end of the start-up at 2 s included.
    real(wp) function start_error(model, options, error) result(gap)
        type(model_type), intent(in) :: model
        type(integrator_options), intent(in) :: options
        type(test_error), intent(inout) :: error
        real(wp), parameter :: t(4) = [0.0_wp, 1.0_wp, 2.5_wp, 3.0_wp]
        type(forward_results) :: results
        type(forward_run) :: run
        type(status_type) :: status
        real(wp), target :: q(1, 4), closure(4)
        real(wp) :: want(1, 4), qd(1, 4), qdd(1, 4), load(6, model%n_load, 4)

        results%q => q
        call results%forces%put(result_closure, closure)
        call run_forward(model, forward_options(integrator=options), t, results, run, status)
        call check(error, status%is_ok() .and. .not. run%has_stopped, trim(status%message)//trim(run%reason))
        call evaluate_motion(model, t, want, qd, qdd, load)
        gap = maxval(abs(q - want))
        ! Lengths are of order ten.
        call check(error, all(closure <= 64*epsilon(1.0_wp)), "closure")
    end function start_error

    subroutine test_start_order(error)
        type(test_error), intent(inout) :: error
        type(model_type) :: model
        real(wp) :: gap(3), order(2)
        integer :: i
        character(len=90) :: text

        call fourbar(model, error)
        if (allocated(error%message)) return
        do i = 1, 3
            gap(i) = start_error(model, integrator_options(method=method_rk4, step=0.05_wp/2**i), error)
        end do
        order = log(gap(:2)/gap(2:))/log(2.0_wp)
        write (text, "(a, 2f7.3, a, 3es10.2)") "order ", order, ", errors ", gap
        ! The next term of the error, a factor h smaller, is still felt at these steps.
        call check(error, abs(order(2) - 4) < 0.15_wp .and. gap(3) < 1.0e-6_wp, trim(text))
    end subroutine test_start_order

    subroutine test_start_closely(error)
        type(test_error), intent(inout) :: error
        type(model_type) :: model
        real(wp) :: gap
        character(len=30) :: text

        call fourbar(model, error)
        if (allocated(error%message)) return
        gap = start_error(model, integrator_options(method=default_method, rtol=1.0e-14_wp, atol=1.0e-14_wp), error)
        write (text, "(a, es10.2)") "error", gap
        ! Some hundred steps' rounding, grown by the motion's own instability, a factor of some ten in 3 s.
        call check(error, gap <= 1.0e-12_wp, trim(text))
    end subroutine test_start_closely

    ! ---------------------------------------------------------------- pendulums

    !> Two rods, each turning about the end of the one before; the second angle is relative.
    subroutine double_pendulum(scene)
        type(scene_type), intent(out) :: scene
        integer :: rod(2), joint

        call planar_scene(scene)
        scene%gravity = [0.0_wp, -9.805_wp, 0.0_wp]
        rod(1) = add_link(scene, "upper", 1.3_wp, [0.4_wp, 0.0_wp, 0.0_wp], [0.0_wp, 0.0_wp, 0.09_wp, 0.0_wp, 0.0_wp, 0.0_wp])
        rod(2) = add_link(scene, "lower", 0.7_wp, [0.3_wp, 0.0_wp, 0.0_wp], [0.0_wp, 0.0_wp, 0.05_wp, 0.0_wp, 0.0_wp, 0.0_wp])
        joint = connect(scene, "A", "R", 0, origin, rod(1), origin)
        call add_joint_coordinates(scene, joint)
        joint = connect(scene, "B", "R", rod(1), [0.9_wp, 0.0_wp], rod(2), origin)
        call add_joint_coordinates(scene, joint)
    end subroutine double_pendulum

    !> Run a scene from its start by rk4 to some instants.
    subroutine swing(scene, step, t, q, error, total_energy)
        type(scene_type), intent(in) :: scene
        real(wp), intent(in) :: step, t(:)
        real(wp), intent(out), target :: q(:, :)
        type(test_error), intent(inout) :: error
        real(wp), intent(out), optional :: total_energy(:)
        type(model_type), target :: model
        type(forward_results) :: results
        type(forward_run) :: run
        type(status_type) :: status
        real(wp), dimension(size(t)), target :: kinetic, potential, work

        call build_model(scene, model, status)
        results%q => q
        results%work => work
        call results%forces%put(result_kinetic_energy, kinetic)
        call results%forces%put(result_potential_energy, potential)
        if (status%is_ok()) call run_forward(model, forward_options( &
            integrator=integrator_options(method=method_rk4, step=step)), t, results, run, status)
        call check(error, status%is_ok() .and. .not. run%has_stopped, trim(status%message)//trim(run%reason))
        if (present(total_energy)) total_energy = kinetic + potential - work
    end subroutine swing

    !> What the energy changes by beside the work is the error of rk4: half the step leaves a sixteenth, of small errors at least an
    !> eighth; the rest is rounding of some hundred steps.
    subroutine check_energy(scene, t, q, error, what)
        type(scene_type), intent(in) :: scene
        real(wp), intent(in) :: t(:)
        real(wp), intent(out), target :: q(:, :)
        type(test_error), intent(inout) :: error
        character(len=*), intent(in) :: what
        real(wp), parameter :: step = 5.0e-4_wp
        real(wp), dimension(size(t)) :: coarse, fine, same

        call swing(scene, 2*step, t, q, error, coarse)
        call swing(scene, step, t, q, error, fine)
        same = fine(1)
        call check_close(error, fine, same, maxval(abs(coarse - coarse(1)))/8 + 500*epsilon(1.0_wp)*maxval(abs(fine)), what)
    end subroutine check_energy

    !> Lagrange's equations in absolute angles a, b from the x axis, written down by hand:
    !> (I1 + m1 c1^2 + m2 l^2) a" + m2 l c2 (cos(a - b) b" + sin(a - b) b'^2) = -g (m1 c1 + m2 l) cos a
    !> (I2 + m2 c2^2) b" + m2 l c2 (cos(a - b) a" - sin(a - b) a'^2) = -g m2 c2 cos b
    pure function textbook(y) result(rate)
        real(wp), intent(in) :: y(4)    !! a b a' b'
        real(wp) :: rate(4)
        real(wp), parameter :: m1 = 1.3_wp, m2 = 0.7_wp, c1 = 0.4_wp, c2 = 0.3_wp, l = 0.9_wp, i1 = 0.09_wp, i2 = 0.05_wp, &
            g = 9.805_wp
        real(wp) :: m11, m12, m22, f1, f2

        m11 = i1 + m1*c1**2 + m2*l**2
        m22 = i2 + m2*c2**2
        m12 = m2*l*c2*cos(y(1) - y(2))
        f1 = -g*(m1*c1 + m2*l)*cos(y(1)) - m2*l*c2*sin(y(1) - y(2))*y(4)**2
        f2 = -g*m2*c2*cos(y(2)) + m2*l*c2*sin(y(1) - y(2))*y(3)**2
        rate = [y(3), y(4), (m22*f1 - m12*f2)/(m11*m22 - m12**2), (m11*f2 - m12*f1)/(m11*m22 - m12**2)]
    end function textbook

    subroutine test_double_pendulum(error)
        type(test_error), intent(inout) :: error
        integer, parameter :: n = 500
        real(wp), parameter :: h = 1.0e-3_wp
        type(scene_type) :: scene
        real(wp) :: q(2, 1), y(4), k(4, 4)
        integer :: i

        call double_pendulum(scene)
        call start_at(scene, [0.3_wp, -0.8_wp])
        scene%coordinate%start_velocity = [1.5_wp, -4.0_wp]
        call swing(scene, h, [n*h], q, error)
        y = [0.3_wp, -0.5_wp, 1.5_wp, -2.5_wp]
        do i = 1, n
            k(:, 1) = textbook(y)
            k(:, 2) = textbook(y + h/2*k(:, 1))
            k(:, 3) = textbook(y + h/2*k(:, 2))
            k(:, 4) = textbook(y + h*k(:, 3))
            y = y + h/6*(k(:, 1) + 2*k(:, 2) + 2*k(:, 3) + k(:, 4))
        end do
        ! The same method with the same step: but for rounding and a factor h for the relative angle, the same numbers.
        call check_close(error, q(:, 1), [y(1), y(2) - y(1)], 1.0e4_wp*epsilon(1.0_wp), "angles")
    end subroutine test_double_pendulum

    !> The same masses and inertias as a spatial scene with parallel axes.
    subroutine test_in_space(error)
        type(test_error), intent(inout) :: error
        type(scene_type) :: flat, space
        real(wp), parameter :: up(3) = [0.0_wp, 0.0_wp, 1.0_wp]
        real(wp), dimension(2, 3) :: q, q_space
        integer :: rod(2), joint

        call double_pendulum(flat)
        call start_at(flat, [0.3_wp, -0.8_wp])
        call new_scene(space)
        space%gravity = flat%gravity
        rod(1) = add_link(space, "upper", 1.3_wp, [0.4_wp, 0.0_wp, 0.0_wp], [0.02_wp, 0.08_wp, 0.09_wp, 0.0_wp, 0.0_wp, 0.0_wp])
        rod(2) = add_link(space, "lower", 0.7_wp, [0.3_wp, 0.0_wp, 0.0_wp], [0.01_wp, 0.05_wp, 0.05_wp, 0.0_wp, 0.0_wp, 0.0_wp])
        joint = add_joint(space, "A", joint_revolute, 0, 0*up, up, rod(1), 0*up, up)
        call add_joint_coordinates(space, joint)
        joint = add_joint(space, "B", joint_revolute, rod(1), [0.9_wp, 0.0_wp, 0.0_wp], up, rod(2), 0*up, up)
        call add_joint_coordinates(space, joint)
        call start_at(space, [0.3_wp, -0.8_wp])
        call swing(flat, 2.0e-3_wp, [0.1_wp, 0.3_wp, 0.6_wp], q, error)
        call swing(space, 2.0e-3_wp, [0.1_wp, 0.3_wp, 0.6_wp], q_space, error)
        call check(error, maxval(abs(q(:, 3) - q(:, 1))) > 0.5_wp, "it swings")
        call check_close(error, q, q_space, 1.0e4_wp*epsilon(1.0_wp), "angles")
    end subroutine test_in_space

    ! ---------------------------------------------------------------- energy

    !> Springs between points and at joints, a damped one taken out, on a dyad with slides; nothing else drives it.
    subroutine test_energy(error)
        type(test_error), intent(inout) :: error
        character(len=3), parameter :: signature(4) = ["RRR", "RRP", "RPR", "PRP"]
        real(wp), parameter :: t(3) = [0.0_wp, 0.1_wp, 0.2_wp]
        type(scene_type) :: scene
        type(spring_spec) :: spring(3)
        real(wp) :: q(2, 3)
        integer :: i

        ! From the frame's marker A to the far marker of the dyad's first link; at an outer joint; at the inner joint.
        spring(1) = spring_spec(link=[0, 3], marker=[1, 2], stiffness=40.0_wp, rest=0.4_wp)
        spring(2) = spring_spec(joint=3, stiffness=20.0_wp, rest=0.2_wp)
        spring(3) = spring_spec(joint=4, stiffness=15.0_wp, rest=-0.1_wp)
        do i = 1, size(signature)
            call dyad_scene(signature(i), scene)
            scene%spring = spring
            scene%actuator%law%kind = effort_constant
            scene%actuator(1)%law%value(1) = 2.5_wp
            scene%actuator(2)%law%value(1) = -1.5_wp
            call check_energy(scene, t, q, error, signature(i)//": energy less work [J]")
            call check(error, maxval(abs(q(:, 3) - q(:, 1))) > 0.02_wp, signature(i)//" moves")
        end do
    end subroutine test_energy

    ! ---------------------------------------------------------------- assemblies

    !> A row of parallelograms with equal rods is one pendulum: phi" = c sin(phi) from the vertical.
    subroutine test_change_points(error)
        type(test_error), intent(inout) :: error
        integer, parameter :: n = 2
        ! Elliptic functions to twenty digits at t = 1 s, from phi = 0 with a tip speed of 1 m/s.
        real(wp), parameter :: want(2) = [-0.195020301949435_wp, -0.980799205662174_wp]
        type(scene_type) :: scene
        real(wp) :: q(1, 1), total(1)
        integer :: i

        call four_bar_chain(n, scene)
        scene%gravity = [0.0_wp, -9.81_wp, 0.0_wp]
        do i = 1, size(scene%link)
            scene%link(i)%mass = 1
            scene%link(i)%cog = 0
            scene%link(i)%cog(merge(2, 1, scene%link(i)%name(1:7) /= "coupler")) = 0.5_wp
            scene%link(i)%inertia(3) = 1.0_wp/12
        end do
        deallocate (scene%actuator)
        allocate (scene%actuator(0))
        call start_at(scene, [0.0_wp])
        scene%coordinate%start_velocity = -1
        call swing(scene, 5.0e-4_wp, [1.0_wp], q, error, total)
        ! A stage of rk4 may come near a change point, where accelerations lose digits; on the wrong branch nothing is right.
        call check_close(error, [-sin(q(1, 1)), cos(q(1, 1))], want, 1.0e-5_wp, "tip of the crank")
    end subroutine test_change_points

    !> Members start on either side of a change point; each goes its own way, as it does alone.
    subroutine test_ensemble(error)
        type(test_error), intent(inout) :: error
        integer, parameter :: n_member = 7
        type(scene_type) :: scene
        type(model_type) :: model
        type(status_type) :: status
        type(forward_options) :: options
        real(wp) :: q_start(1, n_member), qd_start(1, n_member), q(1, 1, n_member), qd(1, 1, n_member), alone(1, 1)
        real(wp) :: good_until(n_member)
        integer :: n_crossed(n_member), outcome(n_member)
        integer :: i

        call four_bar_chain(1, scene)
        deallocate (scene%actuator)
        allocate (scene%actuator(0))
        call start_at(scene, [0.3_wp])
        call build_model(scene, model, status)
        q_start(1, :) = [(0.2_wp + 0.1_wp*i, i=1, n_member)]
        qd_start(1, :) = [(0.5_wp*i - 1, i=1, n_member)]
        options%integrator = integrator_options(method=method_rk4, step=2.0e-3_wp)
        call run_ensemble(model, options, q_start, qd_start, [0.8_wp], q, qd, good_until, n_crossed, outcome, status)
        call check(error, status%is_ok() .and. all(good_until == 0.8_wp) .and. all(outcome == 0), "all arrive")
        call check(error, minval(q) < pi/2 .and. maxval(q) > pi/2 + 1, "some pass the change point")
        do i = 1, n_member
            call start_at(scene, q_start(:, i))
            scene%coordinate%start_velocity = qd_start(:, i)
            call swing(scene, 2.0e-3_wp, [0.8_wp], alone, error)
            ! On another lane rounding may differ, and a change point multiplies it by some thousand.
            call check_close(error, alone(1, 1), q(1, 1, i), 1.0e5_wp*epsilon(1.0_wp), "a member as alone")
        end do
    end subroutine test_ensemble

    !> The first crank follows its law, the second is free and driven by a constant torque.
    subroutine test_driven(error)
        type(test_error), intent(inout) :: error
        type(scene_type) :: scene
        real(wp), parameter :: t(3) = [0.0_wp, 0.1_wp, 0.2_wp]
        real(wp) :: q(2, 3)

        call dyad_scene("RRR", scene)
        scene%coordinate(1)%is_driven = .true.
        scene%coordinate(1)%motion%kind = 2
        scene%coordinate(1)%motion%value(:2) = [0.4_wp, 1.5_wp]
        scene%actuator(2)%law%kind = effort_constant
        scene%actuator(2)%law%value(1) = -1.5_wp
        call check_energy(scene, t, q, error, "energy less the work of both drives [J]")
        call check_close(error, q(1, :), 0.4_wp + 1.5_wp*t, 4*epsilon(1.0_wp), "the driven crank follows its law")
        call check(error, abs(q(2, 3) - q(2, 1)) > 0.02_wp, "the free one moves")
    end subroutine test_driven
end module test_planar_forward
