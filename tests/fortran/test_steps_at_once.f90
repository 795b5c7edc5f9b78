!> Whole steps of ensembles by one kernel against the same steps stage by stage, and ensembles that take them against such that
!> are evaluated on lanes: past whole turns and change points, where steps break the law of energy, and whoever shares a block.
module test_steps_at_once
    use linkdyn_builder, only: build_model
    use linkdyn_ensemble, only: run_ensemble
    use linkdyn_forward, only: forward_options, integrator_options, method_rk4
    use linkdyn_forward_state, only: fill_start
    use linkdyn_forward_system, only: forward_system, build_forward_system
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_lane_system, only: whole_steps
    use linkdyn_model, only: model_type
    use linkdyn_planar_scenes, only: four_bar_chain
    use linkdyn_rk4, only: rk4_workspace, rk4_step
    use linkdyn_scene, only: scene_type, effort_constant
    use linkdyn_scene_reader, only: read_scene
    use linkdyn_status, only: status_type
    use linkdyn_test_numbers, only: random_stream
    use linkdyn_testing, only: test_error, unit_test, new_test, check, check_close
    use linkdyn_text, only: to_text
    implicit none (type, external)
    private
    public :: collect_steps_at_once

    !> Scenes whose rates hang on the state alone: with change points, six branches, springs, a dyad in space, a quaternion.
    character(len=*), parameter :: scenes(5) = [character(len=40) :: "examples/fourbar_constant_torque/scene", &
        "examples/andrews/scene_forward", "examples/n_fourbar/scene", "examples/flyball_governor/scene", &
        "tests/fortran/scenes/free_body"]

    integer, parameter :: n_step = 40

    !> What an ensemble comes to.
    type :: ensemble_results
        real(wp), allocatable :: q(:, :, :), qd(:, :, :), good_until(:)
        integer, allocatable :: n_crossed(:), outcome(:)
    end type ensemble_results

contains

    subroutine collect_steps_at_once(tests)
        type(unit_test), allocatable, intent(out) :: tests(:)

        tests = [new_test("they lead to where their stages lead", test_stages), &
                 new_test("what is left to the stages", test_doubt), &
                 new_test("whole turns", test_turns), new_test("change points", test_change_points), &
                 new_test("steps too long for the law of energy", test_long_steps), &
                 new_test("who shares a block does not matter", test_company)]
    end subroutine collect_steps_at_once

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

    subroutine test_stages(error)
        type(test_error), intent(inout) :: error
        type(model_type), target :: model
        integer :: i

        do i = 1, size(scenes)
            call load_model(error, scenes(i), model)
            if (.not. allocated(error%message)) call compare_with_stages(error, trim(scenes(i)), model)
        end do
    end subroutine test_stages

    !> Steps in a row from random states: all at once, and each stage by stage and accepted by itself.
    subroutine compare_with_stages(error, name, model)
        type(test_error), intent(inout) :: error
        character(len=*), intent(in) :: name
        type(model_type), intent(in), target :: model
        real(wp), parameter :: length = 1.0e-5_wp      !! [s]
        type(forward_system) :: system, by_stages
        type(status_type) :: status
        type(whole_steps) :: steps
        type(rk4_workspace) :: work
        type(random_stream) :: stream
        real(wp), dimension(lanes, model%n_q) :: q, qd
        real(wp), allocatable :: y(:, :), there(:, :), begin(:, :), rest(:, :)
        real(wp) :: t(lanes)
        logical :: failed(lanes)
        integer :: k

        call build_forward_system(model, 0, system, status)
        if (status%is_ok()) call build_forward_system(model, 0, by_stages, status)
        call check(error, status%is_ok(), name//": "//trim(status%message))
        if (.not. status%is_ok()) return
        do k = 1, model%n_q
            q(:, k) = model%start_q(k) + 0.02_wp*stream%vector(lanes)
            qd(:, k) = stream%vector(lanes)
        end do
        allocate (y(lanes, system%n), there(lanes, system%n), begin(lanes, system%n))
        call fill_start(model, system%layout, q, qd, y)
        there = y
        allocate (rest(lanes, system%n), source=0.0_wp)
        system%way%n_before_record = 0
        call system%begin(0.0_wp, y)
        call system%make_record(0.0_wp)
        call system%make_steps_at_once(0.0_wp, length, y)
        call system%begin(0.0_wp, y)
        call system%use_steps(0.0_wp)
        call system%take_whole_steps(0.0_wp, length, n_step, y, begin, rest, steps)
        call check(error, steps%n == n_step .and. .not. steps%is_accepted, &
                   name//": all steps are taken at once: "//to_text(steps%n))
        call work%prepare(by_stages%n)
        call by_stages%begin(0.0_wp, there)
        do k = 1, n_step
            t = (k - 1)*length
            call rk4_step(by_stages, t, spread(length, 1, lanes), there, work, failed)
            call check(error, .not. any(failed), name//": stage by stage none fails")
            t = k*length
            if (k < n_step) call by_stages%accept(t, there, .not. failed)
        end do
        do k = 1, system%n
            call check_close(error, y(:, k), there(:, k), 4000*epsilon(1.0_wp)*maxval(abs([there(:, k), 1.0_wp])), &
                             name//", number "//to_text(k))
            call check_close(error, begin(:, k), work%begin(:, k), 4000*epsilon(1.0_wp)*maxval(abs([there(:, k), 1.0_wp])), &
                             name//", where the last step begins, number "//to_text(k))
        end do
        if (system%way%assembly%is_needed) then
            call check_close(error, system%way%assembly%t, by_stages%way%assembly%t, 1.0e-12_wp, name//": accepted, at")
            call check_close(error, [system%way%assembly%margin], [by_stages%way%assembly%margin], 1.0e5_wp*epsilon(1.0_wp), &
                             name//": margins")
        end if
        call system%release()
        call by_stages%release()
    end subroutine compare_with_stages

    !> A step is taken at once where the record serves all of its stages, and nowhere else: long and short ones from random states,
    !> the same on all lanes.
    subroutine test_doubt(error)
        type(test_error), intent(inout) :: error
        integer, parameter :: n_state = 300
        character(len=*), parameter :: scene(2) = [character(len=40) :: scenes(3), "examples/watt_i/scene"]
        type(model_type), target :: model
        type(forward_system) :: system, new_system
        type(status_type) :: status
        type(whole_steps) :: steps
        type(rk4_workspace) :: work
        type(random_stream) :: stream
        real(wp), allocatable :: y(:, :), there(:, :), begin(:, :)
        real(wp) :: q(lanes, 1), qd(lanes, 1), random(3), length
        logical :: failed(lanes)
        integer :: i, k, n_before, n_taken

        do i = 1, size(scene)
            call load_model(error, scene(i), model)
            if (allocated(error%message)) return
            model%scene%actuator%law%kind = effort_constant
            system = new_system
            call build_forward_system(model, 0, system, status)
            call check(error, status%is_ok(), trim(scene(i))//": "//trim(status%message))
            if (.not. status%is_ok()) return
            allocate (y(lanes, system%n), there(lanes, system%n), begin(lanes, system%n))
            system%way%n_before_record = 0
            n_taken = 0
            do k = 1, n_state
                random = stream%vector(3)
                q = model%start_q(1) + merge(0.0_wp, 1.5_wp*random(1), k == 1)
                qd = 20*random(2)
                length = 10**(-2.5_wp + 1.5_wp*random(3))
                call fill_start(model, system%layout, q, qd, y)
                call system%begin(0.0_wp, y)
                if (k == 1) then
                    call system%make_record(0.0_wp)
                    call system%make_steps_at_once(0.0_wp, 1.0e-4_wp, y)
                    call system%use_steps(0.0_wp)
                    call system%begin(0.0_wp, y)
                end if
                there = y
                call work%prepare(system%n)
                n_before = system%n_by_record
                call rk4_step(system, spread(0.0_wp, 1, lanes), spread(length, 1, lanes), there, work, failed)
                associate (serves => system%n_by_record == n_before + 4)
                    work%rest = 0
                    call system%take_whole_steps(0.0_wp, length, 1, y, begin, work%rest, steps)
                    call check(error, (steps%n == 1) .eqv. serves, trim(scene(i))//", state "//to_text(k))
                    if (steps%n == 0) call check(error, .not. any(steps%is_sure), "no lane is sure")
                end associate
                n_taken = n_taken + steps%n
            end do
            call check(error, n_taken > 0 .and. n_taken < n_state, &
                       trim(scene(i))//": some are taken, some left: "//to_text(n_taken))
            deallocate (y, there, begin)
            call system%release()
        end do
    end subroutine test_doubt

    subroutine run(error, model, q, qd, length, t, by_record, results)
        type(test_error), intent(inout) :: error
        type(model_type), intent(in), target :: model
        real(wp), intent(in) :: q(:, :), qd(:, :)      !! (n_q, member)
        real(wp), intent(in) :: length, t(:)           !! [s]
        logical, intent(in) :: by_record
        type(ensemble_results), intent(out) :: results
        type(forward_options) :: options
        type(status_type) :: status

        options%integrator = integrator_options(method=method_rk4, step=length)
        options%by_record = by_record
        associate (n => size(q, 2))
            allocate (results%q(model%n_q, size(t), n), results%qd(model%n_q, size(t), n), results%good_until(n), &
                      results%n_crossed(n), results%outcome(n))
        end associate
        call run_ensemble(model, options, q, qd, t, results%q, results%qd, results%good_until, results%n_crossed, &
                          results%outcome, status)
        call check(error, status%is_ok(), trim(status%message))
    end subroutine run

    !> The same members at once and on lanes: outcomes are the same, numbers but for rounding.
    subroutine compare_with_lanes(error, what, model, q, qd, length, t, rounding, results)
        type(test_error), intent(inout) :: error
        character(len=*), intent(in) :: what
        type(model_type), intent(in), target :: model
        real(wp), intent(in) :: q(:, :), qd(:, :)      !! (n_q, member)
        real(wp), intent(in) :: length, t(:)           !! [s]
        real(wp), intent(in) :: rounding               !! part of the largest
        type(ensemble_results), intent(out) :: results !! at once
        type(ensemble_results) :: on_lanes

        call run(error, model, q, qd, length, t, .true., results)
        call run(error, model, q, qd, length, t, .false., on_lanes)
        if (allocated(error%message)) return
        call check(error, all(results%outcome == on_lanes%outcome), what//": outcomes")
        call check(error, all(results%n_crossed == on_lanes%n_crossed), what//": change points")
        call check_close(error, results%good_until, on_lanes%good_until, 1.0e-9_wp, what//": last good instants")
        call check(error, all(ieee_same(results%q, on_lanes%q)), what//": who has stopped when")
        call check_close(error, told(results%q), told(on_lanes%q), rounding*maxval(abs(told(on_lanes%q))), what//": coordinates")
        call check_close(error, told(results%qd), told(on_lanes%qd), rounding*maxval(abs(told(on_lanes%qd))), what//": rates")
    end subroutine compare_with_lanes

    !> Is either a number, or both none?
    pure elemental logical function ieee_same(a, b) result(same)
        real(wp), intent(in) :: a, b

        same = (a <= huge(a)) .eqv. (b <= huge(b))
    end function ieee_same

    pure function told(x) result(numbers)
        real(wp), intent(in) :: x(:, :, :)
        real(wp), allocatable :: numbers(:)

        numbers = pack(x, x <= huge(1.0_wp))
    end function told

    !> Cranks that turn fast, to and fro: angles go on without their turns.
    subroutine test_turns(error)
        type(test_error), intent(inout) :: error
        integer, parameter :: n = lanes + 5
        type(model_type), target :: model
        type(ensemble_results) :: results
        real(wp) :: q(1, n), qd(1, n)
        integer :: i

        call load_model(error, scenes(1), model)
        if (allocated(error%message)) return
        q(1, :) = [(model%start_q(1) + 2.0_wp*i/n, i=1, n)]
        qd(1, :) = [(-60.0_wp + 120.0_wp*i/n, i=1, n)]
        call compare_with_lanes(error, "fast cranks", model, q, qd, 5.0e-4_wp, [0.1_wp, 0.5_wp], 1.0e-10_wp, results)
        if (allocated(error%message)) return
        call check(error, maxval(results%q(1, 2, :)) > 10 .and. minval(results%q(1, 2, :)) < -10, "whole turns were made")
    end subroutine test_turns

    subroutine chain_model(error, model)
        type(test_error), intent(inout) :: error
        type(model_type), intent(out) :: model
        type(scene_type) :: scene
        type(status_type) :: status

        call four_bar_chain(1, scene)
        deallocate (scene%actuator)
        allocate (scene%actuator(0))
        call build_model(scene, model, status)
        call check(error, status%is_ok(), trim(status%message))
    end subroutine chain_model

    !> A parallelogram passes its change points on lanes, stage by stage; its neighbours in the block do not wait for it.
    subroutine test_change_points(error)
        type(test_error), intent(inout) :: error
        integer, parameter :: n = lanes + 3
        type(model_type), target :: model
        type(ensemble_results) :: results
        real(wp) :: q(1, n), qd(1, n)
        integer :: i

        call chain_model(error, model)
        if (allocated(error%message)) return
        q(1, :) = [(0.2_wp + 0.6_wp*i/n, i=1, n)]
        qd(1, :) = [(4.0_wp*i/n - 2, i=1, n)]
        ! a unit in the last place of the start comes to 3e-10 rad/s of the fastest, on lanes
        call compare_with_lanes(error, "parallelograms", model, q, qd, 2.0e-3_wp, [0.4_wp, 0.8_wp], 1.0e6_wp*epsilon(1.0_wp), &
                                results)
        if (allocated(error%message)) return
        call check(error, any(results%n_crossed > 0) .and. any(results%n_crossed == 0), "some pass change points, some none")
    end subroutine test_change_points

    !> Some members move too fast for the step: they stop where they stop stage by stage.
    subroutine test_long_steps(error)
        type(test_error), intent(inout) :: error
        integer, parameter :: n = 16                   ! however many lanes there are: some stop on the way
        type(model_type), target :: model
        type(ensemble_results) :: results
        real(wp) :: q(1, n), qd(1, n)
        integer :: i

        call load_model(error, scenes(1), model)
        if (allocated(error%message)) return
        q(1, :) = [(model%start_q(1) + 1.6_wp*i/n, i=1, n)]
        qd(1, :) = [(32.0_wp*i/n, i=1, n)]
        call compare_with_lanes(error, "long steps", model, q, qd, 0.04_wp, [2.4_wp, 6.0_wp], 1.0e-7_wp, results)
        if (allocated(error%message)) return
        call check(error, any(results%outcome /= 0) .and. any(results%outcome == 0), "some stop, some do not")
        call check(error, any(results%good_until > 0.03_wp .and. results%good_until < 5.9_wp), "on the way")
    end subroutine test_long_steps

    !> Members that pass change points, and such that stop, have no part in what becomes of the others: to the last bit.
    subroutine test_company(error)
        type(test_error), intent(inout) :: error
        integer, parameter :: n = lanes
        type(model_type), target :: model
        type(ensemble_results) :: together, alone
        real(wp) :: q(1, n), qd(1, n)
        integer :: i

        call chain_model(error, model)
        if (allocated(error%message)) return
        q(1, :) = [(0.2_wp + 0.6_wp*i/n, i=1, n)]
        qd(1, :) = [(4.0_wp*i/n - 2, i=1, n)]
        call run(error, model, q, qd, 5.0e-3_wp, [1.2_wp], .true., together)
        do i = 1, n
            call run(error, model, q(:, i:i), qd(:, i:i), 5.0e-3_wp, [1.2_wp], .true., alone)
            if (allocated(error%message)) return
            call check(error, alone%outcome(1) == together%outcome(i), "outcome of member "//to_text(i))
            if (together%outcome(i) /= 0) cycle
            call check(error, all(abs(alone%q(:, :, 1) - together%q(:, :, i)) <= 0) .and. &
                       all(abs(alone%qd(:, :, 1) - together%qd(:, :, i)) <= 0), "member "//to_text(i)//", bit by bit")
        end do
    end subroutine test_company
end module test_steps_at_once
