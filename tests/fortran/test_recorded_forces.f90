!> Inverse dynamics by records against inverse dynamics in lanes, which shares no formula with them: on the examples, on legs
!> in any axes, on groups closed by iteration, near dead points; and what a record leaves out.
module test_recorded_forces
    use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan
    use linkdyn_result_kinds, only: result_closure, result_contact_force, result_driving_force, result_joint_rate, &
        result_joint_variable, result_kinetic_energy, result_position, result_potential_energy, result_power_imbalance, &
        result_pressure_angle, result_reaction, result_rotation, result_transmission_angle
    use linkdyn_assembly_trail, only: assembly_trail, sample_assembly, follow_assembly, judges_like_lanes, reached_crossing
    use linkdyn_builder, only: build_model
    use linkdyn_curve, only: make_curve
    use linkdyn_representatives, only: representative_poses, need_poses
    use linkdyn_inverse, only: inverse_options, inverse_results, inverse_solver, motion_of, prepare_inverse, run_prepared
    use linkdyn_inverse_results, only: list_results
    use linkdyn_kinds, only: wp
    use linkdyn_model, only: model_type, step_ups, scene_size
    use linkdyn_motion, only: sample_count, sample_times, evaluate_motion
    use linkdyn_planar_scenes, only: four_bar_chain
    use linkdyn_recorded_forces, only: recorded_forces, record_forces, free_recorded
    use linkdyn_margin_source, only: margin_source
    use linkdyn_recorded_margins, only: recorded_margins, of_margins
    use linkdyn_samples, only: result_list
    use linkdyn_scene, only: scene_type, actuator_spec, cam_spec, joint_cam, joint_revolute, follower_point, follower_roller
    use linkdyn_scene_reader, only: read_scene
    use linkdyn_status, only: status_type, sample_ok
    use linkdyn_test_numbers, only: random_stream, random_walk
    use linkdyn_test_scenes, only: stewart_scene, stewart_on_carriage, change_axes, move_frame, load_link
    use linkdyn_testing, only: test_error, unit_test, new_test, check, check_close
    use linkdyn_text, only: to_text
    implicit none (type, external)
    private
    public :: collect_recorded_forces

    !> All scenes of the examples with as many drives as freedoms, all of them closed without iteration.
    character(len=*), parameter :: example(17) = [character(len=34) :: "andrews/scene", "fivebar_motors/scene", &
        "fivebar_parallel/scene", "fourbar/scene", "fourbar_start/scene", "rcsp_start/scene", "sixbar_slider/scene", &
        "sixbar_slider/scene_inclined", "slider_crank/scene", "stephenson_iii/scene", "stewart_aris/scene", &
        "stewart_drilling/scene", "stewart_forward/scene", "stewart_mathworks/scene", "stewart_taghirad/scene", &
        "stewart_tsai/scene", "watt_i/scene"]

    !> Scenes with groups closed by iteration: planar and spatial, one behind the other, with coordinates inside, closed by gears.
    character(len=*), parameter :: iterated(12) = [character(len=19) :: "boom_by_stroke", "cam_lever", "excavator", "hexaglide", &
        "planar_platform", "rsur", "rusr_parallelogram", "scissor_by_stroke", "fivebar_by_gears", "fivebar_by_gears_3d", &
        "wheel_by_coupler", "platform_by_gear"]

    !> Watt I and Stephenson III multiply rounding by some hundreds where their dyads stretch; both roads round on their own.
    real(wp), parameter :: rounding = 4000*epsilon(1.0_wp)
    !> The directions that joints let go of have, at the worst pose on the way, an eighth of the self-stress: that divides rounding.
    real(wp), parameter :: let_go = 8*rounding
    !> Takes long to be led from its start by lanes: asked for once.
    character(len=*), parameter :: large = "hexaglide"

    !> As near to a singular position as the hexaglide is at its start: margins of some thousandths enter forces cubed.
    real(wp), parameter :: near_singular = 1.0e-8_wp
    !> What both roads promise next to singular positions.
    real(wp), parameter :: three_digits = 1.0e-3_wp

    type :: batch_type
        real(wp), allocatable :: q(:, :), qd(:, :), qdd(:, :), load(:, :, :)
    end type batch_type

contains

    subroutine collect_recorded_forces(tests)
        type(unit_test), allocatable, intent(out) :: tests(:)

        tests = [new_test("examples", test_examples), new_test("following a motion", test_following), &
                 new_test("legs in any axes", test_legs), new_test("a leg that is not straight", test_bent_leg), &
                 new_test("dead points", test_dead_points), new_test("groups closed by iteration", test_iterated), &
                 new_test("cams", test_cams), &
                 new_test("over-constrained", test_over_constrained), &
                 new_test("a frame that moves", test_moving_frame), new_test("shared drives", test_shared_drives), &
                 new_test("dead points of groups", test_dead_groups), new_test("recorded steps", test_recorded_steps), &
                 new_test("samples that are no numbers", test_no_numbers), new_test("what is left out", test_left_out), &
                 new_test("linear in links", test_linear)]
    end subroutine collect_recorded_forces

    subroutine load_model(error, path, model)
        type(test_error), intent(inout) :: error
        character(len=*), intent(in) :: path           !! without its ending
        type(model_type), intent(out) :: model
        !> Closed by formulas, and here by iteration.
        character(len=*), parameter :: loop(3) = [character(len=32) :: "tests/scenes/boom_by_stroke", "tests/scenes/excavator", &
                                                  "tests/scenes/rusr_parallelogram"]
        type(scene_type) :: scene
        type(status_type) :: status

        call read_scene(trim(path)//".toml", scene, status)
        if (status%is_ok()) call build_model(scene, model, status, closed_forms=.not. any(loop == path))
        call check(error, status%is_ok(), trim(status%message))
    end subroutine load_model

    subroutine test_examples(error)
        type(test_error), intent(inout) :: error
        type(model_type) :: model
        type(batch_type) :: batch
        integer :: i

        do i = 1, size(example)
            call load_model(error, "examples/"//example(i), model)
            if (allocated(error%message)) return
            call follow_motion(model, batch)
            call compare_roads(error, trim(example(i)), model, batch)
        end do
    end subroutine test_examples

    !> Along random walks, which lead through change points, to dead points and beyond, samples are found on the same assembly
    !> and lost at the same places, whoever has the margins.
    subroutine test_following(error)
        type(test_error), intent(inout) :: error
        type(scene_type) :: scene
        type(status_type) :: status
        type(model_type) :: model
        type(recorded_forces), target :: recorded
        type(recorded_margins), target :: by_record
        class(margin_source), pointer :: margins
        type(assembly_trail) :: trail(2), new_trail
        type(sample_assembly) :: assembly(2)
        type(representative_poses) :: poses, no_poses
        real(wp), allocatable :: q(:, :)
        integer, parameter :: n = 300, first = 200     ! not whole numbers of strides
        character(len=len(example)) :: name
        integer :: i, scale, n_lost, n_crossed

        n_lost = 0
        n_crossed = 0
        do i = 1, size(example) + 2
            if (i <= size(example)) then
                name = example(min(i, size(example)))
                call load_model(error, "examples/"//name, model)
            else
                name = "parallelograms"                ! one alone can be closed on the wrong assembly as well
                call four_bar_chain(i - size(example), scene)
                call build_model(scene, model, status)
            end if
            if (allocated(error%message)) return
            if (model%n_branch == 0) cycle
            poses = no_poses
            call need_poses(model, spread(model%start_q, 2, 1), poses)
            call record_forces(model, of_margins, poses%q, poses%stand, recorded, poses%assembly%place)
            by_record%record => recorded
            margins => by_record
            call check(error, recorded%is_usable, trim(name)//": there is a record of margins")
            if (.not. recorded%is_usable) cycle
            call check(error, judges_like_lanes(model, margins, poses%q), trim(name)//": margins as in lanes")
            do scale = 0, 2, 2
                q = random_walk(model%start_q, n, 0.003_wp*6.0_wp**scale)
                trail = new_trail
                call follow_assembly(model, q, trail(1), assembly(1))
                call follow_assembly(model, q(:, :first), trail(2), assembly(2), margins)
                call check(error, all(assembly(2)%branch == assembly(1)%branch(:, :first)), trim(name)//": branches")
                call check(error, all(assembly(2)%status == assembly(1)%status(:first)), trim(name)//": outcomes")
                call check(error, all(assembly(2)%reached == assembly(1)%reached(:first)), trim(name)//": how reached")
                ! A trail goes on with the next samples.
                call follow_assembly(model, q(:, first + 1:), trail(2), assembly(2), margins)
                call check(error, all(assembly(2)%branch == assembly(1)%branch(:, first + 1:)), trim(name)//": branches, later")
                call check(error, all(assembly(2)%status == assembly(1)%status(first + 1:)), trim(name)//": outcomes, later")
                n_lost = n_lost + count(assembly(1)%status /= sample_ok)
                n_crossed = n_crossed + count(assembly(1)%reached == reached_crossing)
            end do
            call free_recorded(recorded)
        end do
        call check(error, n_lost > 100, "the walks lead to dead points")
        call check(error, n_crossed > 0, "and through change points")
    end subroutine test_following

    subroutine follow_motion(model, batch)
        type(model_type), intent(in) :: model
        type(batch_type), intent(out) :: batch
        real(wp), allocatable :: t(:)
        integer :: n

        n = sample_count(model)
        allocate (t(n), batch%q(model%n_q, n), batch%qd(model%n_q, n), batch%qdd(model%n_q, n), batch%load(6, model%n_load, n))
        call sample_times(model, 1, t)
        call evaluate_motion(model, t, batch%q, batch%qd, batch%qdd, batch%load)
    end subroutine follow_motion

    subroutine move_at_random(model, n, reach, batch)
        type(model_type), intent(in) :: model
        integer, intent(in) :: n
        real(wp), intent(in) :: reach                  !! about the start [m, rad]
        type(batch_type), intent(out) :: batch
        type(random_stream) :: stream

        batch%q = spread(model%start_q, 2, n) + reach*reshape(stream%vector(model%n_q*n), [model%n_q, n])
        batch%qd = reshape(stream%vector(model%n_q*n), [model%n_q, n])
        batch%qdd = 3*reshape(stream%vector(model%n_q*n), [model%n_q, n])
        batch%load = 500*reshape(stream%vector(6*model%n_load*n), [6, model%n_load, n])
    end subroutine move_at_random

    !> All results that both roads have.
    subroutine run_road(error, model, batch, by_record, results, trail, steps_are_recorded)
        type(test_error), intent(inout) :: error
        type(model_type), intent(in) :: model
        type(batch_type), intent(in), target :: batch
        logical, intent(in) :: by_record
        type(inverse_results), intent(out) :: results
        type(assembly_trail), intent(inout), optional :: trail    !! samples follow each other
        logical, intent(in), optional :: steps_are_recorded    !! Newton's, which is looked at
        type(inverse_solver) :: solver
        type(recorded_forces), pointer :: recorded
        type(result_list) :: list
        type(status_type) :: status
        integer, parameter :: told(13) = [result_driving_force, result_reaction, result_joint_variable, result_joint_rate, &
            result_power_imbalance, result_kinetic_energy, result_potential_energy, result_closure, result_position, &
            result_rotation, result_transmission_angle, result_contact_force, result_pressure_angle]
        integer :: n, i

        n = size(batch%q, 2)
        allocate (results%status(n))
        do i = 1, merge(size(told), size(told) - 2, model%n_cam > 0)    ! those of cams are the last two
            call results%add(model, told(i), n)
        end do
        call prepare_inverse(model, inverse_options(by_record=by_record), .true., solver, status)
        call check(error, status%is_ok(), trim(status%message))
        call run_prepared(model, solver, 2, motion_of(batch%q, batch%qd, batch%qdd, batch%load), results, trail=trail)
        if (by_record) then
            call list_results(results, n, list)
            recorded => solver%records%find(list%id(:list%n))
            call check(error, associated(recorded), "a record was made")
            if (associated(recorded)) call check(error, recorded%is_usable, "and agreed with the lanes")
        end if
        if (present(steps_are_recorded) .and. by_record) then
            call check(error, associated(solver%places%closing), "there are Newton's steps")
            if (allocated(error%message)) return
            if (steps_are_recorded) call check(error, solver%places%closing%is_usable, "Newton's steps are recorded")
        end if
        call solver%free()
    end subroutine run_road

    subroutine free_results(results)
        type(inverse_results), intent(inout) :: results

        deallocate (results%status)
        call results%free()
    end subroutine free_results

    subroutine compare_roads(error, name, model, batch, in_order, accuracy, steps_are_recorded)
        type(test_error), intent(inout) :: error
        character(len=*), intent(in) :: name
        type(model_type), intent(in) :: model
        type(batch_type), intent(in) :: batch
        logical, intent(in), optional :: in_order      !! samples follow each other; absent: each is on its own
        real(wp), intent(in), optional :: accuracy     !! near singular positions; absent: rounding
        logical, intent(in), optional :: steps_are_recorded    !! Newton's, which is looked at
        type(inverse_results) :: lanes, record
        type(assembly_trail) :: trail(2)
        real(wp) :: tolerance
        integer :: i, n_vague

        tolerance = rounding
        n_vague = 0
        if (present(accuracy)) tolerance = accuracy
        ! where forces scatter about as much as they may, roads that round otherwise say the one or the other
        if (tolerance > let_go) n_vague = size(batch%q, 2)/50

        if (present(in_order)) then
            call run_road(error, model, batch, .false., lanes, trail(1))
            call run_road(error, model, batch, .true., record, trail(2), steps_are_recorded)
        else
            call run_road(error, model, batch, .false., lanes)
            call run_road(error, model, batch, .true., record, steps_are_recorded=steps_are_recorded)
        end if
        call check(error, count(lanes%status /= record%status) <= n_vague, name//": the same outcomes")
        do i = 1, size(batch%q, 2)
            if (lanes%status(i) /= sample_ok .or. record%status(i) /= sample_ok) cycle
            ! a driving force that happens to vanish has the rounding of the reactions
            call alike([lanes%at(result_driving_force, i), lanes%at(result_reaction, i)], &
                       [record%at(result_driving_force, i), record%at(result_reaction, i)], "forces")
            ! half a turn either way is the same
            call alike(cos(lanes%at(result_joint_variable, i)), cos(record%at(result_joint_variable, i)), "joint variables")
            call alike(sin(lanes%at(result_joint_variable, i)), sin(record%at(result_joint_variable, i)), "joint variables")
            call check(error, all(abs(record%at(result_joint_variable, i)) - abs(lanes%at(result_joint_variable, i)) < 1), &
                       name//": angles within half a turn")
            call alike(lanes%at(result_joint_rate, i), record%at(result_joint_rate, i), "joint rates")
            call check_close(error, [record%at(result_position, i)], [lanes%at(result_position, i)], &
                             tolerance*max(scene_size(model), maxval(abs(lanes%at(result_position, i)))), name//": positions")
            call alike([lanes%at(result_rotation, i)], [record%at(result_rotation, i)], "rotations")
            call alike([lanes%of(result_kinetic_energy)%x(1, i)], [record%of(result_kinetic_energy)%x(1, i)], "kinetic energy")
            call alike([lanes%of(result_potential_energy)%x(1, i)], [record%of(result_potential_energy)%x(1, i)], &
                       "potential energy")
            call alike(lanes%at(result_transmission_angle, i), record%at(result_transmission_angle, i), "transmission angles")
            if (model%n_cam > 0) then
                call alike([maxval(abs(lanes%at(result_reaction, i))), lanes%at(result_contact_force, i)], &
                           [maxval(abs(record%at(result_reaction, i))), record%at(result_contact_force, i)], "contact forces")
                call check_close(error, record%at(result_pressure_angle, i), lanes%at(result_pressure_angle, i), tolerance, &
                                 name//": pressure angles")
            end if
            call check(error, all(record%at(result_power_imbalance, i) &
                                  <= max(tolerance, 10*lanes%at(result_power_imbalance, i))), name//": power")
        end do
        call free_results(lanes)
        call free_results(record)

    contains

        subroutine alike(a, b, what)
            real(wp), intent(in) :: a(:), b(:)
            character(len=*), intent(in) :: what
            real(wp) :: scale

            if (size(a) == 0) return
            scale = maxval(abs(a))
            if (what == "joint variables") scale = 1       ! a sine or cosine may vanish
            call check_close(error, b, a, tolerance*scale, name//", sample "//to_text(i)//": "//what)
        end subroutine alike
    end subroutine compare_roads

    !> Along the scenes' motions in order, and about their start each on its own.
    subroutine test_iterated(error)
        type(test_error), intent(inout) :: error
        type(model_type) :: model
        type(batch_type) :: batch
        real(wp) :: accuracy
        integer :: i

        do i = 1, size(iterated)
            if (iterated(i) == large) cycle
            call load_model(error, "tests/scenes/"//iterated(i), model)
            if (allocated(error%message)) return
            call follow_motion(model, batch)
            ! the parallelogram goes through its change points
            accuracy = merge(three_digits, near_singular, iterated(i) == "rusr_parallelogram")
            if (size(batch%q, 2) > 1) &                 ! else the scene has no motion
                call compare_roads(error, trim(iterated(i))//" in order", model, batch, in_order=.true., accuracy=accuracy)
            call move_at_random(model, 140, 0.005_wp, batch)
            call compare_roads(error, trim(iterated(i))//" about its start", model, batch, accuracy=accuracy)
        end do
    end subroutine test_iterated

    !> Reactions that the equations leave open; all samples are the record's.
    subroutine test_over_constrained(error)
        type(test_error), intent(inout) :: error
        character(len=*), parameter :: shared(2) = [character(len=9) :: "agile_eye", "tripteron"]
        type(model_type) :: model
        type(batch_type) :: batch
        integer :: i

        do i = 1, size(shared)
            call load_model(error, "examples/"//trim(shared(i))//"/scene", model)
            if (allocated(error%message)) return
            call check(error, model%share%n > 0, trim(shared(i))//": the equations leave something open")
            call follow_motion(model, batch)
            call compare_roads(error, trim(shared(i))//" in order", model, batch, in_order=.true., accuracy=let_go)
            call move_at_random(model, 140, 0.01_wp, batch)
            call compare_roads(error, trim(shared(i))//" about its start", model, batch, accuracy=let_go)
        end do
    end subroutine test_over_constrained

    !> Followers of all kinds on curves of both kinds: where they are touched, and all that follows from it.
    subroutine test_cams(error)
        type(test_error), intent(inout) :: error
        integer, parameter :: n = 280
        character(len=*), parameter :: what(6) = [character(len=18) :: "path of the centre", "roller", "roller inside", "point", &
                                                  "points", "flat"]
        type(scene_type) :: scene
        type(status_type) :: status
        type(model_type) :: model
        type(batch_type) :: batch
        integer :: i, s

        do i = 1, size(what)
            call read_scene(merge("tests/scenes/cam_lever.toml    ", "examples/valve_train/scene.toml", i == 6), scene, status)
            call check(error, status%is_ok(), trim(status%message))
            if (.not. status%is_ok()) return
            if (i < 6) call change_cam(scene%joint(findloc(scene%joint%kind, joint_cam, dim=1))%cam)
            call build_model(scene, model, status)
            call check(error, status%is_ok(), trim(what(i))//": "//trim(status%message))
            if (.not. status%is_ok()) return
            call move_at_random(model, n, 0.0_wp, batch)
            ! on the rise and the fall: during a dwell nothing has power
            batch%q(1, :) = [(-1.0_wp + 2.0_wp*s/n, s=1, n)]
            call compare_roads(error, trim(what(i))//", in order", model, batch, in_order=.true., steps_are_recorded=.true.)
            call compare_roads(error, trim(what(i)), model, batch, steps_are_recorded=.true.)
        end do

    contains

        subroutine change_cam(cam)
            type(cam_spec), intent(inout) :: cam
            real(wp), allocatable :: point(:, :)

            if (i == 1) return
            cam%is_path = .false.
            cam%radius = merge(0.0_wp, 0.003_wp, i >= 4)
            cam%follower = merge(follower_point, follower_roller, i >= 4)
            if (i == 3) cam%side = -1
            if (i < 5) return
            point = cam%curve%knot
            call make_curve(point(1, :), point(2, :), cam%curve)
        end subroutine change_cam
    end subroutine test_cams

    !> Closed forms and a group, in the plane and in space, with something to carry that changes.
    subroutine test_moving_frame(error)
        type(test_error), intent(inout) :: error
        character(len=*), parameter :: scene(6) = [character(len=34) :: "examples/fourbar/scene", "examples/watt_i/scene", &
            "examples/stewart_tsai/scene", "examples/rcsp_start/scene", "tests/scenes/excavator", "tests/scenes/rsur"]
        type(model_type) :: model
        type(batch_type) :: batch
        integer :: i

        do i = 1, size(scene)
            call load_model(error, scene(i), model)
            if (allocated(error%message)) return
            call move_frame(model)
            call load_link(model)
            if (size(model%group) == 0) then
                call follow_motion(model, batch)
                call compare_roads(error, trim(scene(i))//", moving", model, batch)
            else
                call move_at_random(model, 140, 0.005_wp, batch)
                call compare_roads(error, trim(scene(i))//", moving", model, batch, accuracy=near_singular)
            end if
        end do
    end subroutine test_moving_frame

    !> The first drive twice, and one more at another hinge, all of different strength and strained against each other.
    subroutine test_shared_drives(error)
        type(test_error), intent(inout) :: error
        character(len=*), parameter :: name(6) = [character(len=34) :: "examples/fourbar/scene", &
            "examples/fivebar_parallel/scene", "examples/rcsp_start/scene", "examples/stewart_tsai/scene", &
            "tests/scenes/excavator", "tests/scenes/rsur"]
        type(scene_type) :: scene
        type(status_type) :: status
        type(model_type) :: model
        type(batch_type) :: batch
        integer :: i

        do i = 1, size(name)
            call read_scene(trim(name(i))//".toml", scene, status)
            call add_drives(scene)
            if (status%is_ok()) call build_model(scene, model, status)
            call check(error, status%is_ok(), trim(name(i))//": "//trim(status%message))
            if (.not. status%is_ok()) return
            call move_at_random(model, 140, 0.005_wp, batch)
            call compare_roads(error, trim(name(i))//", shared", model, batch, &
                               accuracy=merge(near_singular, rounding, size(model%group) > 0))
        end do
    end subroutine test_shared_drives

    subroutine add_drives(scene)
        type(scene_type), intent(inout) :: scene
        type(actuator_spec) :: more(2)
        integer :: j, n

        more = scene%actuator(1)
        more(1)%name = trim(more(1)%name)//":second"
        more%share = [0.5_wp, 2.0_wp]
        more%preload = [30.0_wp, 0.0_wp]
        n = 1
        do j = size(scene%joint), 1, -1
            if (scene%joint(j)%kind /= joint_revolute .or. any(scene%actuator%joint == j)) cycle
            more(2)%name = scene%joint(j)%name
            more(2)%joint = j
            more(2)%variable = 1
            more(2)%unit = "N m"
            n = 2
            exit
        end do
        scene%actuator = [scene%actuator, more(:n)]
    end subroutine add_drives

    !> Enough samples for Newton's steps to be recorded, too: the same assemblies and forces as by those of the lanes, in order and
    !> each on its own, over turns of the cranks and through change points.
    subroutine test_recorded_steps(error)
        type(test_error), intent(inout) :: error
        integer, parameter :: n = 260                  ! from 256 on
        type(model_type) :: model
        type(batch_type) :: batch
        real(wp) :: reach, accuracy
        integer :: i, k, s

        do i = 1, size(iterated)
            if (iterated(i) /= "rsur" .and. digits(1.0_wp) > digits(1.0d0)) cycle    ! minutes
            call load_model(error, "tests/scenes/"//iterated(i), model)
            if (allocated(error%message)) return
            call move_at_random(model, n, 0.0_wp, batch)
            ! far enough for some to be out of reach
            reach = merge(7.0_wp, 0.05_wp, iterated(i) == "rsur" .or. iterated(i) == "rusr_parallelogram")
            ! of its folds the lanes take long to be sure
            if (iterated(i) == large) reach = 0.01_wp
            do s = 1, n
                batch%q(:, s) = batch%q(:, s) + [(reach*sin(0.01_wp*k*s), k=1, model%n_q)]
            end do
            accuracy = merge(three_digits, near_singular, iterated(i) == "rusr_parallelogram")
            call compare_roads(error, trim(iterated(i))//", steps recorded, in order", model, batch, in_order=.true., &
                               accuracy=accuracy, steps_are_recorded=.true.)
            if (iterated(i) == large) cycle
            call compare_roads(error, trim(iterated(i))//", steps recorded", model, batch, accuracy=accuracy, &
                               steps_are_recorded=.true.)
        end do
    end subroutine test_recorded_steps

    !> A parallelogram in space, closed by iteration, led through its change point and past it closely: the record gives what is
    !> surely certain, the lanes say what is not.
    subroutine test_dead_groups(error)
        type(test_error), intent(inout) :: error
        integer, parameter :: n = 400
        type(model_type) :: model
        type(batch_type) :: batch
        integer :: i

        call load_model(error, "tests/scenes/rusr_parallelogram", model)
        if (allocated(error%message)) return
        call move_at_random(model, n, 0.0_wp, batch)
        batch%q(1, :) = acos(-1.0_wp) - [(10**(-7.0_wp*i/n), i=1, n)]
        call compare_roads(error, "towards the change point", model, batch, in_order=.true., accuracy=three_digits)
    end subroutine test_dead_groups

    !> The links of the legs in axes of their own, the ball joints written first: closed at once in lanes and in a record, or
    !> iterated.
    subroutine test_legs(error)
        type(test_error), intent(inout) :: error
        type(scene_type) :: scene
        type(model_type) :: model
        type(status_type) :: status
        type(batch_type) :: batch
        integer :: which

        do which = 1, 4
            if (modulo(which, 2) == 1) call stewart_scene(scene, .false.)
            if (modulo(which, 2) == 0) call stewart_on_carriage(scene)
            call change_axes(scene)
            call build_model(scene, model, status, closed_forms=which <= 2)
            call check(error, status%is_ok(), trim(status%message))
            if (.not. status%is_ok()) return
            call check(error, count(model%step%kind == step_ups) == merge(6, 0, which <= 2), "closed at once, or iterated")
            call move_at_random(model, 140, 0.1_wp, batch)
            call compare_roads(error, "legs "//to_text(which), model, batch)
        end do
    end subroutine test_legs

    !> A slide beside the line from U to S makes another mechanism, which has no closed form: its leg is iterated.
    subroutine test_bent_leg(error)
        type(test_error), intent(inout) :: error
        type(scene_type) :: scene
        type(model_type) :: model
        type(status_type) :: status
        type(batch_type) :: batch
        integer :: i

        call stewart_scene(scene, .false.)
        do i = 1, size(scene%link)
            if (scene%link(i)%name /= "leg3.upper") cycle
            scene%link(i)%marker(1)%at = scene%link(i)%marker(1)%at + [0.01_wp, 0.0_wp, 0.0_wp]
        end do
        call build_model(scene, model, status)
        call check(error, status%is_ok(), trim(status%message))
        if (.not. status%is_ok()) return
        call check(error, size(model%group) > 0, "iterated")
        call move_at_random(model, 140, 0.1_wp, batch)
        call compare_roads(error, "a bent leg", model, batch)
    end subroutine test_bent_leg

    !> Towards the change point of a parallelogram both roads flag the same samples, and keep three digits of the others.
    subroutine test_dead_points(error)
        type(test_error), intent(inout) :: error
        integer, parameter :: n = 400
        type(scene_type) :: scene
        type(model_type) :: model
        type(status_type) :: status
        type(batch_type) :: batch
        type(inverse_results) :: lanes, record
        integer :: i

        call four_bar_chain(1, scene)
        call build_model(scene, model, status)
        call check(error, status%is_ok(), trim(status%message))
        call move_at_random(model, n, 0.0_wp, batch)
        batch%q(1, :) = acos(-1.0_wp)/2 + [(10**(-12.0_wp*i/n), i=1, n)]*[(-1.0_wp, 1.0_wp, i=1, n/2)]
        call run_road(error, model, batch, .false., lanes)
        call run_road(error, model, batch, .true., record)
        call check(error, any(lanes%status /= sample_ok), "samples are flagged")
        call check(error, all(lanes%status == record%status), "the same outcomes")
        do i = 1, n
            if (lanes%status(i) /= sample_ok) cycle
            call check_close(error, record%at(result_driving_force, i), lanes%at(result_driving_force, i), &
                             1.0e-3_wp*maxval(abs(lanes%at(result_reaction, i))), "driving force")
        end do
        call free_results(lanes)
        call free_results(record)
    end subroutine test_dead_points

    subroutine test_no_numbers(error)
        type(test_error), intent(inout) :: error
        type(scene_type) :: scene
        type(model_type) :: model
        type(status_type) :: status
        type(batch_type) :: batch
        type(inverse_results) :: lanes, record
        real(wp) :: nan

        nan = ieee_value(1.0_wp, ieee_quiet_nan)
        call stewart_scene(scene, massless_legs=.true.)
        call build_model(scene, model, status)
        call move_at_random(model, 37, 0.1_wp, batch)
        batch%q(3, 2) = nan
        batch%qd(1, 19) = huge(1.0_wp)
        batch%qdd(6, 30) = -huge(1.0_wp)
        batch%load(:, :, 35) = nan
        call run_road(error, model, batch, .false., lanes)
        call run_road(error, model, batch, .true., record)
        call check(error, count(record%status /= sample_ok) == 4, "four samples are flagged")
        call check(error, all(lanes%status == record%status), "as in lanes")
        call free_results(lanes)
        call free_results(record)
    end subroutine test_no_numbers

    !> A record computes what is wanted, and of a planar scene nothing out of the plane.
    subroutine test_left_out(error)
        type(test_error), intent(inout) :: error
        type(scene_type) :: scene
        type(model_type) :: model
        type(status_type) :: status
        integer :: all_forces, driving_force, without_mass

        call four_bar_chain(1, scene)
        call build_model(scene, model, status)
        all_forces = operations(model, [result_driving_force, result_reaction])
        driving_force = operations(model, [result_driving_force])
        call check(error, all_forces <= 200, "a planar four-bar takes "//to_text(all_forces)//" operations")
        call check(error, driving_force < all_forces, "reactions that nobody wants are left out")
        call stewart_scene(scene, massless_legs=.false.)
        call build_model(scene, model, status)
        all_forces = operations(model, [result_driving_force, result_reaction])
        call stewart_scene(scene, massless_legs=.true.)
        call build_model(scene, model, status)
        without_mass = operations(model, [result_driving_force, result_reaction])
        call check(error, 3*without_mass < 2*all_forces, "massless legs have no inertia: "//to_text(without_mass)//" for " &
                   //to_text(all_forces))
    end subroutine test_left_out

    integer function operations(model, wanted)
        type(model_type), intent(in) :: model
        integer, intent(in) :: wanted(:)
        type(recorded_forces) :: recorded
        type(representative_poses) :: poses

        call need_poses(model, spread(model%start_q, 2, 1), poses)
        call record_forces(model, wanted, poses%q, poses%stand, recorded, poses%assembly%place)
        operations = huge(1)
        if (recorded%is_usable) operations = size(recorded%program%kernel%step)
        call free_recorded(recorded)
    end function operations

    subroutine test_linear(error)
        type(test_error), intent(inout) :: error
        integer :: n(3), i
        type(scene_type) :: scene
        type(model_type) :: model
        type(status_type) :: status

        do i = 1, 3
            call four_bar_chain(10*i, scene)
            call build_model(scene, model, status)
            n(i) = operations(model, [result_driving_force, result_reaction])
        end do
        call check(error, abs(n(3) - 2*n(2) + n(1)) <= n(1)/10, "operations of 10, 20 and 30 four-bars: "//to_text(n(1))//", " &
                   //to_text(n(2))//", "//to_text(n(3)))
    end subroutine test_linear
end module test_recorded_forces
