!> Rates of forward dynamics by records against those of the lanes, which share no formula with them: at random states, along
!> runs and ensembles, past change points; and what a record must leave to the lanes.
module test_recorded_rates
    use linkdyn_builder, only: build_model
    use linkdyn_ensemble, only: run_ensemble
    use linkdyn_forward, only: forward_options, forward_results, forward_run, integrator_options, start_forward, advance_forward, &
        finish_forward, method_gbs, method_rk4, method_seulex
    use linkdyn_forward_state, only: fill_start
    use linkdyn_step_ends, only: wants_looks
    use linkdyn_forward_system, only: forward_system, build_forward_system
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_model, only: model_type
    use linkdyn_motion, only: evaluate_motion
    use linkdyn_planar_scenes, only: four_bar_chain
    use linkdyn_scene, only: scene_type, effort_constant, effort_spring_damper, side_torque, n_clutch
    use linkdyn_scene_reader, only: read_scene
    use linkdyn_status, only: status_type
    use linkdyn_test_numbers, only: random_stream
    use linkdyn_test_scenes, only: stewart_scene, change_axes, move_frame, load_link
    use linkdyn_testing, only: test_error, unit_test, new_test, check, check_close
    use linkdyn_text, only: to_text
    implicit none (type, external)
    private
    public :: collect_recorded_rates

    !> Scenes closed without iteration, by laws of every kind: motors, springs, tables, torques, forces that a motion asks for.
    character(len=*), parameter :: example(15) = [character(len=34) :: "andrews/scene", "andrews/scene_forward", &
        "fivebar_motors/scene", "fivebar_parallel/scene", "flyball_governor/scene", "fourbar_constant_torque/scene", &
        "fourbar_start/scene", "n_fourbar/scene", "rcsp_start/scene", "sixbar_slider/scene_inclined", "slider_crank/scene", &
        "stephenson_iii/scene", "watt_i/scene", "stewart_forward/scene", "stewart_drilling/scene"]

    !> Scenes with groups closed by iteration, cams among them.
    character(len=*), parameter :: iterated(10) = [character(len=32) :: "examples/valve_train/scene", "tests/scenes/cam_lever", &
        "tests/scenes/excavator", "tests/scenes/planar_platform", "tests/scenes/rsur", "tests/scenes/boom_by_stroke", &
        "tests/scenes/fivebar_by_gears", "tests/scenes/fivebar_by_gears_3d", "tests/scenes/wheel_by_coupler", &
        "tests/scenes/platform_by_gear"]

    !> Watt I and Stephenson III multiply rounding by some hundreds where their dyads stretch; both roads round on their own.
    real(wp), parameter :: rounding = 4000*epsilon(1.0_wp)

contains

    subroutine collect_recorded_rates(tests)
        type(unit_test), allocatable, intent(out) :: tests(:)

        tests = [new_test("random states", test_random_states), &
                 new_test("groups closed by iteration", test_iterated), new_test("a free body", test_free_body), &
                 new_test("a frame that moves", test_moving_frame), &
                 new_test("controllers", test_controllers), new_test("stand-ins", test_stand_ins), &
                 new_test("legs in any axes", test_legs), &
                 new_test("a run", test_run), new_test("instants closer than steps", test_close_instants), &
                 new_test("forces of a motion", test_motion_forces), &
                 new_test("change points", test_change_points), &
                 new_test("stages far ahead", test_stages_ahead), &
                 new_test("motors elsewhere", test_motors_elsewhere), new_test("a cylinder", test_cylinder), &
                 new_test("motors that lose and joints that rub", test_lossy), &
                 new_test("six motors that lose", test_lossy_legs), &
                 new_test("an ensemble", test_ensemble)]
    end subroutine collect_recorded_rates

    subroutine load_model(error, name, model)
        type(test_error), intent(inout) :: error
        character(len=*), intent(in) :: name           !! path without its ending
        type(model_type), intent(out) :: model
        type(scene_type) :: scene
        type(status_type) :: status

        call read_scene(trim(name)//".toml", scene, status)
        if (status%is_ok()) call build_model(scene, model, status)
        call check(error, status%is_ok(), trim(name)//": "//trim(status%message))
    end subroutine load_model

    subroutine test_random_states(error)
        type(test_error), intent(inout) :: error
        type(model_type), target :: model
        integer :: i

        do i = 1, size(example)
            call load_model(error, "examples/"//example(i), model)
            if (allocated(error%message)) return
            call compare_rates(error, trim(example(i)), model)
        end do
    end subroutine test_random_states

    subroutine test_iterated(error)
        type(test_error), intent(inout) :: error
        type(model_type), target :: model
        integer :: i

        do i = 1, size(iterated)
            call load_model(error, iterated(i), model)
            if (allocated(error%message)) return
            call compare_rates(error, trim(iterated(i)), model)
        end do
    end subroutine test_iterated

    !> One continuous, with an integral and a filter among the states, one that has taken a sample.
    subroutine test_controllers(error)
        type(test_error), intent(inout) :: error
        type(model_type), target :: model

        call load_model(error, "tests/scenes/controlled_arm", model)
        if (allocated(error%message)) return
        call compare_rates(error, "controlled_arm", model)
    end subroutine test_controllers

    !> A crank that stands in for the rocker, whose spring is wound by more turns than its rest tells; the crank's own spring is at
    !> the angle nearest to its rest, however often it has gone round.
    subroutine test_stand_ins(error)
        type(test_error), intent(inout) :: error
        character(len=*), parameter :: name(2) = [character(len=16) :: "fourbar_start", "slider_crank"]
        integer, parameter :: last = 4                 ! joint on the frame: a rocker, a piston
        type(model_type), target :: model
        type(scene_type) :: scene
        type(status_type) :: status
        integer :: i

        do i = 1, size(name)
            call read_scene("examples/"//trim(name(i))//"/scene.toml", scene, status)
            scene%actuator = [scene%actuator(1), scene%actuator(1)]
            scene%actuator(2)%joint = last
            scene%actuator(2)%name = scene%joint(last)%name
            scene%actuator%law%kind = effort_spring_damper
            scene%actuator(1)%law%value(:3) = [3.0_wp, 0.2_wp, 0.4_wp]
            scene%actuator(2)%law%value(:3) = [20.0_wp, 0.3_wp, -4.0_wp]
            if (status%is_ok()) call build_model(scene, model, status)
            call check(error, status%is_ok(), trim(name(i))//": "//trim(status%message))
            if (.not. status%is_ok()) return
            model%scene%coordinate(1)%for_joint = last
            model%scene%coordinate(1)%for_variable = 1
            call compare_rates(error, trim(name(i))//", standing in", model)
        end do
    end subroutine test_stand_ins

    !> Legs in any axes of a platform whose attitude is integrated as a quaternion, closed at once.
    subroutine test_legs(error)
        type(test_error), intent(inout) :: error
        type(model_type), target :: model
        type(scene_type) :: scene
        type(status_type) :: status

        call stewart_scene(scene, massless_legs=.false.)
        call change_axes(scene)
        scene%actuator%law%kind = effort_constant
        scene%actuator%law%value(1) = 400
        call build_model(scene, model, status)
        call check(error, status%is_ok(), trim(status%message))
        if (.not. status%is_ok()) return
        call check(error, size(model%group) == 0, "closed at once")
        call compare_rates(error, "legs in any axes", model)
    end subroutine test_legs

    subroutine test_moving_frame(error)
        type(test_error), intent(inout) :: error
        type(model_type), target :: model
        integer :: i

        do i = 1, size(example), 2
            call load_model(error, "examples/"//example(i), model)
            if (allocated(error%message)) return
            call move_frame(model)
            call load_link(model)
            call compare_rates(error, trim(example(i))//", moving", model)
        end do
    end subroutine test_moving_frame

    !> A state on each lane, then each alone; then with three turns more of every angle, which motors and springs feel.
    subroutine compare_rates(error, name, model)
        type(test_error), intent(inout) :: error
        character(len=*), intent(in) :: name
        type(model_type), intent(in), target :: model
        type(forward_system) :: system
        type(status_type) :: status
        type(random_stream) :: stream
        real(wp), allocatable :: y(:, :), by_lanes(:, :), by_record(:, :), alone(:)
        real(wp) :: t(lanes), q(lanes, model%n_q), qd(lanes, model%n_q), load(6, model%n_load, 1)
        real(wp), dimension(model%n_q, 1) :: on_q, on_qd, on_qdd
        logical :: failed(lanes), has_failed
        integer :: k, lane, turns

        call build_forward_system(model, 0, system, status)
        call check(error, status%is_ok(), name//": "//trim(status%message))
        if (.not. status%is_ok()) return
        t = model%scene%time%first
        call evaluate_motion(model, t(:1), on_q, on_qd, on_qdd, load)
        do k = 1, model%n_q
            q(:, k) = model%start_q(k) + 0.05_wp*stream%vector(lanes)
            qd(:, k) = on_qd(k, 1) + stream%vector(lanes)
        end do
        allocate (y(lanes, system%n), by_lanes(lanes, system%n), by_record(lanes, system%n), alone(system%n))
        call fill_start(model, system%layout, q, qd, y)
        do k = 1, model%n_actuator
            if (system%layout%pressure(k) > 0) y(:, system%layout%pressure(k)) = 0.6_wp
        end do
        call system%begin(t(1), y)
        call system%begin_with_clutches(t(1), y)
        call system%make_record(t(1))
        call check(error, system%may_record, name//": a record was made, and agreed with the lanes")
        if (.not. system%may_record) return
        ! what closes at once there and by iteration here is looked at on lanes
        if (wants_looks(model) .and. size(system%record%recorded%model%group) == size(model%group)) &
            call check(error, system%looks%is_usable, name//": it sees the ends of steps as the lanes do")
        do turns = 0, 3, 3
            where (spread(system%is_angle, 1, lanes)) system%turns = turns
            call system%evaluate_on_lanes(t, y, by_lanes, failed)
            call check(error, .not. any(failed), name//": the lanes can")
            system%n_by_record = 0
            call system%evaluate(t, y, by_record, failed)
            if (turns == 0) call check(error, system%n_by_record == 1, name//": the record serves all states")
            do lane = 1, lanes
                call check_close(error, by_record(lane, :), by_lanes(lane, :), rounding*maxval(abs(by_lanes(lane, :))), &
                                 name//", state "//to_text(lane)//", turns "//to_text(turns))
                ! alone it is the first lane, whose joints that may stick slide their own way
                if (lane > 1 .and. n_clutch(model%scene) > 0) cycle
                call system%evaluate_alone(t(lane), y(lane, :), alone, has_failed)
                call check(error, .not. has_failed, name//": alone")
                call check_close(error, alone, by_lanes(lane, :), rounding*maxval(abs(by_lanes(lane, :))), &
                                 name//", state "//to_text(lane)//" alone")
            end do
        end do
        call system%release()
    end subroutine compare_rates

    !> Its attitude is integrated as a quaternion, whose length steps do not keep.
    subroutine test_free_body(error)
        type(test_error), intent(inout) :: error
        type(model_type), target :: model
        type(forward_system) :: system
        type(status_type) :: status
        real(wp), allocatable :: y(:, :), by_lanes(:, :), by_record(:, :)
        real(wp) :: t(lanes)
        logical :: failed(lanes)
        type(random_stream) :: stream
        integer :: k, lane

        call load_model(error, "tests/fortran/scenes/free_body", model)
        if (allocated(error%message)) return
        call build_forward_system(model, 0, system, status)
        call check(error, status%is_ok(), trim(status%message))
        if (.not. status%is_ok()) return
        t = 0
        allocate (y(lanes, system%n), by_lanes(lanes, system%n), by_record(lanes, system%n))
        call fill_start(model, system%layout, spread(model%start_q, 1, lanes), spread(0*model%start_q, 1, lanes), y)
        call system%begin(t(1), y)
        call system%make_record(t(1))
        call check(error, system%may_record, "a record was made, and agreed with the lanes")
        if (.not. system%may_record) return
        do k = 1, system%n
            y(:, k) = y(:, k) + 0.1_wp*stream%vector(lanes)
        end do
        call system%evaluate_on_lanes(t, y, by_lanes, failed)
        call system%evaluate(t, y, by_record, failed)
        call check(error, system%n_by_record == 1, "the record serves all states")
        do lane = 1, lanes
            call check_close(error, by_record(lane, :), by_lanes(lane, :), rounding*maxval(abs(by_lanes(lane, :))), &
                             "state "//to_text(lane))
        end do
        call system%release()
    end subroutine test_free_body

    !> One run: what it comes to, and how many evaluations were by the record alone.
    subroutine run_to_end(error, model, options, by_record, t, q, n_by_record, n_of_motion)
        type(test_error), intent(inout) :: error
        type(model_type), intent(in), target :: model
        type(integrator_options), intent(in) :: options
        logical, intent(in) :: by_record
        real(wp), intent(in) :: t(:)                   !! [s]
        real(wp), intent(out), target :: q(:, :)       !! (n_q, n)
        integer, intent(out) :: n_by_record
        integer, intent(out), optional :: n_of_motion
        type(forward_results) :: results
        type(forward_run) :: run
        type(status_type) :: status
        integer :: n_done

        results%q => q
        n_by_record = 0
        call start_forward(model, forward_options(integrator=options, wants_reactions=.false., by_record=by_record), run, status)
        call check(error, status%is_ok(), trim(status%message))
        if (status%is_ok()) then
            call advance_forward(run, t, results, n_done)
            n_by_record = run%system%n_by_record
            if (present(n_of_motion)) n_of_motion = run%system%of_motion%n_by_record
            call check(error, n_done == size(t) .and. .not. run%has_stopped, "the run comes to its end: "//trim(run%reason))
        end if
        call finish_forward(run)
    end subroutine run_to_end

    !> The same steps of an example with one coordinate by both roads.
    subroutine run_both_roads(error, example, t, by_lanes, by_record, n_by_record, n_of_motion)
        type(test_error), intent(inout) :: error
        character(len=*), intent(in) :: example
        real(wp), intent(in) :: t(:)                   !! [s]
        real(wp), intent(out), target :: by_lanes(:, :), by_record(:, :)    !! (1, n)
        integer, intent(out) :: n_by_record
        integer, intent(out), optional :: n_of_motion  !! forces of the motion by a record
        type(model_type), target :: model
        integer :: n_unasked

        call load_model(error, "examples/"//example//"/scene", model)
        associate (options => integrator_options(method=method_rk4, step=1.0e-3_wp))
            call run_to_end(error, model, options, .false., t, by_lanes, n_unasked)
            call run_to_end(error, model, options, .true., t, by_record, n_by_record, n_of_motion)
        end associate
        call check(error, n_unasked == 0, "no record unless asked for")
    end subroutine run_both_roads

    !> The same steps by both roads: they part by rounding alone.
    subroutine test_run(error)
        type(test_error), intent(inout) :: error
        real(wp), parameter :: t(3) = [0.5_wp, 1.0_wp, 1.5_wp]
        real(wp) :: by_lanes(1, size(t)), by_record(1, size(t))
        integer :: n_by_record

        call run_both_roads(error, "fourbar_constant_torque", t, by_lanes, by_record, n_by_record)
        call check(error, n_by_record > 4000, "nearly all rates come from the record: "//to_text(n_by_record))
        call check_close(error, by_record, by_lanes, 1.0e5_wp*epsilon(1.0_wp)*maxval(abs(by_lanes)), "crank")
    end subroutine test_run

    !> Instants of output closer than the steps are steps, too: that many are worth a record, however few steps there are.
    subroutine test_close_instants(error)
        type(test_error), intent(inout) :: error
        integer, parameter :: n = 2000
        type(model_type), target :: model
        real(wp) :: t(n), close(1, n), ends(1, 2)
        integer :: n_by_record, n_unasked, i

        t = [(0.5_wp*i/n, i=1, n)]
        call load_model(error, "examples/fourbar_constant_torque/scene", model)
        associate (options => integrator_options(method=method_gbs))
            call run_to_end(error, model, options, .true., t, close, n_by_record)
            call run_to_end(error, model, options, .false., t([n/2, n]), ends, n_unasked)
        end associate
        call check(error, n_by_record > n, "nearly all rates come from the record: "//to_text(n_by_record))
        call check_close(error, close(:, [n/2, n]), ends, 1.0e-8_wp, "crank")
    end subroutine test_close_instants

    !> Drives that apply what the scene's motion asks for: the crank keeps to its law by either road.
    subroutine test_motion_forces(error)
        type(test_error), intent(inout) :: error
        real(wp), parameter :: t(2) = [1.0_wp, 2.0_wp], still(2) = [0.004_wp, 0.012_wp]
        real(wp) :: by_lanes(1, size(t)), by_record(1, size(t))
        integer :: n_by_record, n_of_motion

        call run_both_roads(error, "fourbar_start", t, by_lanes, by_record, n_by_record, n_of_motion)
        call check(error, n_of_motion > 3000, "nearly all forces come from the record: "//to_text(n_of_motion))
        call check_close(error, by_record, by_lanes, 1.0e5_wp*epsilon(1.0_wp)*maxval(abs(by_lanes)), "crank")
        ! A shaft that needs no force for a while: numbers that are all rounding say nothing of the record.
        call run_both_roads(error, "valve_train", still, by_lanes, by_record, n_by_record, n_of_motion)
        call check(error, n_of_motion > 30, "forces of the shaft come from the record: "//to_text(n_of_motion))
        call check_close(error, by_record, by_lanes, 1.0e-9_wp, "shaft")
    end subroutine test_motion_forces

    !> Loops closed by iteration, by a method whose steps take a crank half a turn on: the stages in between are led there.
    subroutine test_stages_ahead(error)
        type(test_error), intent(inout) :: error
        integer, parameter :: method(2) = [method_gbs, method_seulex]
        real(wp), parameter :: t(2) = [0.4_wp, 0.8_wp]
        type(model_type), target :: model
        real(wp) :: by_lanes(1, size(t)), by_record(1, size(t))
        integer :: n_by_record, n_unasked, i

        call load_model(error, "examples/spatial_slider_crank/scene", model)
        do i = 1, size(method)
            associate (options => integrator_options(method=method(i), rtol=1.0e-11_wp, atol=1.0e-11_wp))
                call run_to_end(error, model, options, .false., t, by_lanes, n_unasked)
                call run_to_end(error, model, options, .true., t, by_record, n_by_record)
            end associate
            call check(error, n_by_record > 400, "nearly all rates come from the record: "//to_text(n_by_record))
            call check_close(error, by_record, by_lanes, 1.0e-7_wp, "crank")
        end do
    end subroutine test_stages_ahead

    !> Motors with losses, a winding and a brake, at joints that are no coordinates.
    subroutine test_motors_elsewhere(error)
        type(test_error), intent(inout) :: error
        character(len=*), parameter :: name(2) = [character(len=16) :: "fivebar_pick", "hoist"]
        type(model_type), target :: model
        integer :: i

        do i = 1, size(name)
            call load_model(error, "examples/"//trim(name(i))//"/scene", model)
            if (allocated(error%message)) return
            call compare_rates(error, trim(name(i)), model)
        end do
    end subroutine test_motors_elsewhere

    !> Motors of a mechanism that lose in their gears; friction in its joints hangs on that, and that on it; joints that stick
    !> slide.
    subroutine test_lossy(error)
        type(test_error), intent(inout) :: error
        character(len=*), parameter :: name(3) = &
            [character(len=24) :: "fivebar_lossy", "rubbing/fivebar", "rubbing/fivebar_sticking"]
        type(model_type), target :: model
        integer :: i

        do i = 1, size(name)
            call load_model(error, "tests/scenes/"//trim(name(i)), model)
            if (allocated(error%message)) return
            call check(error, size(model%contact) == merge(0, 5, i == 1), trim(name(i))//": joints rub")
            call check(error, size(model%motor) == 2, trim(name(i))//": motors drive")
            call compare_rates(error, trim(name(i)), model)
        end do
    end subroutine test_lossy

    !> The legs of a platform, some driven by their motors and some by their loads, each on its own efficiencies.
    subroutine test_lossy_legs(error)
        type(test_error), intent(inout) :: error
        type(model_type), target :: model
        type(scene_type) :: scene
        type(status_type) :: status
        integer :: i

        call read_scene("examples/stewart_forward/scene.toml", scene, status)
        do i = 1, size(scene%actuator)
            scene%actuator(i)%law%kind = effort_constant
            scene%actuator(i)%law%side = side_torque
            scene%actuator(i)%law%value(1) = 0.002_wp*(-1)**i*i
            scene%actuator(i)%motor%is_given = .true.
            scene%actuator(i)%motor%ratio = 600
            scene%actuator(i)%motor%inertia = 1.0e-5_wp
            scene%actuator(i)%motor%efficiency = 1 - 0.1_wp*i
            scene%actuator(i)%motor%back_efficiency = 0.9_wp - 0.12_wp*i
        end do
        if (status%is_ok()) call build_model(scene, model, status)
        call check(error, status%is_ok(), trim(status%message))
        if (.not. status%is_ok()) return
        call check(error, size(model%motor) == 6, "six motors")
        call compare_rates(error, "lossy legs", model)
    end subroutine test_lossy_legs

    !> A cylinder between two links that move, its valve half open.
    subroutine test_cylinder(error)
        type(test_error), intent(inout) :: error
        type(model_type), target :: model

        call load_model(error, "examples/loader_crane/scene", model)
        if (allocated(error%message)) return
        model%scene%time%first = 1
        call compare_rates(error, "loader_crane", model)
    end subroutine test_cylinder

    !> A parallelogram through its change points: near them the lanes follow the assembly, elsewhere the record serves. It turns
    !> as a point mass would on its path, whatever the assembly, as long as it stays a parallelogram.
    subroutine test_change_points(error)
        type(test_error), intent(inout) :: error
        real(wp), parameter :: t(4) = [1.0_wp, 2.0_wp, 3.0_wp, 4.0_wp]
        real(wp) :: by_lanes(1, size(t)), by_record(1, size(t))
        integer :: n_by_record

        call run_both_roads(error, "n_fourbar", t, by_lanes, by_record, n_by_record)
        call check(error, abs(by_lanes(1, size(t)) - by_lanes(1, 1)) > acos(-1.0_wp), "change points are passed")
        call check(error, n_by_record > 100, "the record serves between them: "//to_text(n_by_record))
        call check_close(error, by_record, by_lanes, 1.0e-6_wp, "crank")
    end subroutine test_change_points

    !> Members share one record, and each goes its own way, past change points, too.
    subroutine test_ensemble(error)
        type(test_error), intent(inout) :: error
        integer, parameter :: n_member = lanes + 3
        type(scene_type) :: scene
        type(model_type), target :: model
        type(status_type) :: status
        type(forward_options) :: options
        real(wp) :: q_start(1, n_member), qd_start(1, n_member), q(1, 2, n_member, 2), qd(1, 2, n_member, 2), good_until(n_member)
        real(wp) :: apart(n_member)
        integer :: n_crossed(n_member, 2), outcome(n_member), i, road

        call four_bar_chain(1, scene)
        deallocate (scene%actuator)
        allocate (scene%actuator(0))
        call build_model(scene, model, status)
        call check(error, status%is_ok(), trim(status%message))
        if (.not. status%is_ok()) return
        q_start(1, :) = [(0.2_wp + 0.6_wp*i/n_member, i=1, n_member)]
        qd_start(1, :) = [(3.0_wp*i/n_member - 1, i=1, n_member)]
        options%integrator = integrator_options(method=method_rk4, step=2.0e-3_wp)
        do road = 1, 2
            options%by_record = road == 1
            call run_ensemble(model, options, q_start, qd_start, [0.4_wp, 0.8_wp], q(:, :, :, road), qd(:, :, :, road), &
                              good_until, n_crossed(:, road), outcome, status)
            call check(error, status%is_ok() .and. all(good_until == 0.8_wp) .and. all(outcome == 0), "all arrive")
        end do
        call check(error, any(n_crossed(:, 1) > 0) .and. all(n_crossed(:, 1) == n_crossed(:, 2)), "change points passed")
        ! A stage within m of a change point multiplies rounding by 1/m and more, and one in 1/m comes so near: most members are
        ! apart by some thousand roundings, and now and then one, by the machine's rounding another, by far more.
        apart = [(maxval(abs(q(:, :, i, 1) - q(:, :, i, 2))), i=1, n_member)]/maxval(abs(q))
        call check(error, count(apart <= 1.0e4_wp*epsilon(1.0_wp)) >= nint(0.8_wp*n_member), "coordinates of most members")
        call check(error, all(apart <= sqrt(epsilon(1.0_wp))), "coordinates")
        call check(error, all(apart <= 100*epsilon(1.0_wp) .or. n_crossed(:, 1) > 0), "coordinates without change points")
    end subroutine test_ensemble
end module test_recorded_rates
