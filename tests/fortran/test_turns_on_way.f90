!> Turns of joint angles along a motion, where rates at the samples do not tell: how closely the way between them is looked at,
!> counted in its pieces.
module test_turns_on_way
    use linkdyn_assembly_trail, only: assembly_trail
    use linkdyn_builder, only: build_model
    use linkdyn_result_kinds, only: result_joint_variable
    use linkdyn_constants, only: pi
    use linkdyn_inverse, only: inverse_options, inverse_results, inverse_solver, motion_of, prepare_inverse, run_prepared
    use linkdyn_kinds, only: wp
    use linkdyn_model, only: model_type
    use linkdyn_scene, only: scene_type
    use linkdyn_scene_reader, only: parse_scene
    use linkdyn_status, only: status_type, sample_ok
    use linkdyn_testing, only: test_error, unit_test, new_test, check
    use linkdyn_text, only: to_text
    use linkdyn_turns, only: turn_count
    implicit none (type, external)
    private
    public :: collect_turns_on_way

    !> A trolley above the foot of a leg that stands upright below it: the leg's first axis.
    character(len=*), parameter :: lf = new_line("a"), inertia = 'inertia = [1, 1, 1, 0, 0, 0]'//lf, trolley = &
        'space = "spatial"'//lf//'gravity = [0, 0, -9.81]'//lf//'[frame.markers]'//lf// &
        'F = { at = [0, 0, 0], axis = [0, 0, 1] }'//lf//'X = { at = [0, 0, 1], axis = [1, 0, 0] }'//lf// &
        '[[link]]'//lf//'name = "bridge"'//lf//'mass = 1'//lf//inertia//'start = { position = [0, 0, 1] }'//lf// &
        'markers = { X = { at = [0, 0, 0], axis = [1, 0, 0] }, Y = { at = [0, 0, 0], axis = [0, 1, 0] } }'//lf// &
        '[[link]]'//lf//'name = "trolley"'//lf//'mass = 1'//lf//inertia//'start = { position = [0, 0, 1] }'//lf// &
        'markers = { Y = { at = [0, 0, 0], axis = [0, 1, 0] }, S = [0, 0, 0] }'//lf// &
        '[[link]]'//lf//'name = "lower"'//lf//'mass = 1'//lf//inertia// &
        'markers = { U = { at = [0, 0, 0], axis = [1, 0, 0] }, P = { at = [0, 0, 0], axis = [0, 0, 1] } }'//lf// &
        '[[link]]'//lf//'name = "upper"'//lf//'mass = 1'//lf//inertia// &
        'markers = { P = { at = [0, 0, 0], axis = [0, 0, 1] }, S = [0, 0, 0] }'//lf// &
        '[[joint]]'//lf//'name = "X"'//lf//'type = "prismatic"'//lf//'between = ["frame.X", "bridge.X"]'//lf// &
        '[[joint]]'//lf//'name = "Y"'//lf//'type = "prismatic"'//lf//'between = ["bridge.Y", "trolley.Y"]'//lf// &
        '[[joint]]'//lf//'name = "U"'//lf//'type = "universal"'//lf//'between = ["frame.F", "lower.U"]'//lf// &
        '[[joint]]'//lf//'name = "P"'//lf//'type = "prismatic"'//lf//'between = ["lower.P", "upper.P"]'//lf// &
        '[[joint]]'//lf//'name = "S"'//lf//'type = "spherical"'//lf//'between = ["upper.S", "trolley.S"]'//lf// &
        '[[coordinate]]'//lf//'joint = "X"'//lf//'start = 0.1'//lf// &
        '[[coordinate]]'//lf//'joint = "Y"'//lf//'start = 0.05'//lf

    !> Two wheels of one size, meshing.
    character(len=*), parameter :: wheels = 'space = "planar"'//lf// &
        '[frame]'//lf//'markers = { A = [0, 0], B = [0.2, 0] }'//lf// &
        '[[link]]'//lf//'name = "first"'//lf//'mass = 1'//lf//'inertia = 0.1'//lf//'markers = { O = [0, 0] }'//lf// &
        '[[link]]'//lf//'name = "second"'//lf//'mass = 1'//lf//'inertia = 0.1'//lf//'markers = { O = [0, 0] }'//lf// &
        '[[joint]]'//lf//'name = "A"'//lf//'type = "revolute"'//lf//'between = ["frame.A", "first.O"]'//lf// &
        '[[joint]]'//lf//'name = "B"'//lf//'type = "revolute"'//lf//'between = ["frame.B", "second.O"]'//lf// &
        '[[joint]]'//lf//'name = "mesh"'//lf//'type = "gear"'//lf//'between = ["first.O", "second.O"]'//lf// &
        'teeth = [20, 20]'//lf//'[[coordinate]]'//lf//'joint = "A"'//lf

contains

    subroutine collect_turns_on_way(tests)
        type(unit_test), allocatable, intent(out) :: tests(:)

        tests = [new_test("a leg led over its pole again and again", test_pole), &
                 new_test("rates that nobody else wants", test_own_rates)]
    end subroutine collect_turns_on_way

    !> So close to the pole that no pieces of the way tell how the leg's first axis turns: after some looks in vain few more are
    !> close ones. Farther from it one tells, and the count goes on from there.
    subroutine test_pole(error)
        type(test_error), intent(inout) :: error
        integer, parameter :: n = 1000
        real(wp), parameter :: side = 0.1_wp
        type(scene_type) :: scene
        type(model_type) :: model
        type(status_type) :: status
        type(inverse_solver) :: solver
        type(assembly_trail) :: trail
        type(turn_count) :: turns
        real(wp) :: before
        integer :: i

        call parse_scene(trolley, "trolley.toml", "", scene, status)
        if (status%is_ok()) call build_model(scene, model, status)
        if (status%is_ok()) call prepare_inverse(model, inverse_options(wants_forces=.false.), .false., solver, status)
        call check(error, status%is_ok(), trim(status%message))
        if (allocated(error%message)) return
        call go([(side*(-1)**i, i=1, n)], 1.0e-6_wp)
        call check(error, turns%n_in_vain >= n - 1, "no look tells: "//to_text(turns%n_in_vain))
        call check(error, turns%n_piece <= 450*n, to_text(turns%n_piece)//" pieces of ways")
        call go([side], 0.03_wp)
        before = turns%before(model%joint(findloc(model%joint%name, "U", dim=1))%first_variable + 1)
        call go([-side], 0.03_wp)
        call check(error, turns%n_in_vain == 0, "a look tells")
        associate (now => turns%before(model%joint(findloc(model%joint%name, "U", dim=1))%first_variable + 1))
            call check(error, abs(abs(now - before) - (pi - 2*atan(0.3_wp))) < 1.0e-9_wp, &
                       "it has turned by "//to_text(now - before))
        end associate
        call solver%free()

    contains

        subroutine go(x, y)
            real(wp), intent(in) :: x(:), y
            type(inverse_results) :: results
            real(wp), target :: q(2, size(x)), none(2, size(x)), load(6, model%n_load, size(x))
            real(wp), target :: variable(model%n_variable, size(x))
            integer, target :: told(size(x))

            q(1, :) = x
            q(2, :) = y
            none = 0
            load = 0
            call results%put(result_joint_variable, variable)
            results%status(1:size(x)) => told
            call run_prepared(model, solver, 1, motion_of(q, none, none, load), results, trail=trail, turns=turns)
            call check(error, all(told == sample_ok), "all samples are found")
        end subroutine go
    end subroutine test_pole

    !> Half of what a step of this size may turn an angle by is told by the rates at its ends alone: no closer looks are taken,
    !> though the caller wants variables only.
    subroutine test_own_rates(error)
        type(test_error), intent(inout) :: error
        integer, parameter :: n = 1000
        real(wp), parameter :: step = 1.2_wp
        type(scene_type) :: scene
        type(model_type) :: model
        type(status_type) :: status
        type(inverse_solver) :: solver
        type(inverse_results) :: results
        type(assembly_trail) :: trail
        type(turn_count) :: turns
        real(wp), target :: q(1, n), qd(1, n), qdd(1, n), load(6, 0, n)
        real(wp), allocatable, target :: variable(:, :)
        integer, target :: told(n)
        integer :: i

        call parse_scene(wheels, "wheels.toml", "", scene, status)
        if (status%is_ok()) call build_model(scene, model, status)
        if (status%is_ok()) call prepare_inverse(model, inverse_options(wants_forces=.false.), .false., solver, status)
        call check(error, status%is_ok(), trim(status%message))
        if (allocated(error%message)) return
        q(1, :) = [(step*i, i=0, n - 1)]
        qd = 1
        qdd = 0
        allocate (variable(model%n_variable, n))
        call results%put(result_joint_variable, variable)
        results%status(1:n) => told
        call run_prepared(model, solver, 1, motion_of(q, qd, qdd, load), results, trail=trail, turns=turns)
        call check(error, all(told == sample_ok), "all samples are found")
        associate (driven => model%joint(findloc(model%joint%name, "B", dim=1))%first_variable + 1)
            call check(error, all(abs(variable(driven, :) + q(1, :)) < 1.0e-9_wp), "a wheel turns as its gear says")
        end associate
        call check(error, turns%n_piece == 0, to_text(turns%n_piece)//" pieces of ways")
        call solver%free()
    end subroutine test_own_rates
end module test_turns_on_way
