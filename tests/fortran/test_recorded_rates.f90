!> Rates of forward dynamics by records against those of the lanes, which share no formula with them: at random states of
!> every scene that runs forward, along runs, and where a record must leave a state to the lanes.
module test_recorded_rates
    use linkdyn_builder, only: build_model
    use linkdyn_equations, only: solver_elimination
    use linkdyn_forward, only: forward_options, forward_results, forward_run, integrator_options, start_forward, advance_forward, &
        finish_forward, run_ensemble, method_rk4, method_gbs
    use linkdyn_forward_state, only: fill_start
    use linkdyn_forward_system, only: forward_system, build_forward_system, is_worth_recording
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_model, only: model_type
    use linkdyn_motion, only: evaluate_motion
    use linkdyn_planar_scenes, only: four_bar_chain
    use linkdyn_scene, only: scene_type
    use linkdyn_scene_reader, only: read_scene
    use linkdyn_status, only: status_type
    use linkdyn_test_numbers, only: random_stream
    use linkdyn_testing, only: test_error, unit_test, new_test, check, check_close
    use linkdyn_text, only: to_text
    implicit none (type, external)
    private
    public :: collect_recorded_rates

    !> Scenes that run forward, all of them closed without iteration: by laws of every kind, driven in part or not at all.
    character(len=*), parameter :: example(10) = [character(len=34) :: "andrews/scene", "fivebar_motors/scene", &
        "flyball_governor/scene", "fourbar_constant_torque/scene", "fourbar_start/scene", "n_fourbar/scene", "rcsp_start/scene", &
        "sixbar_slider/scene", "slider_crank/scene", "stewart_forward/scene"]

contains

    subroutine collect_recorded_rates(tests)
        type(unit_test), allocatable, intent(out) :: tests(:)

        tests = [new_test("random states", test_random_states)]
    end subroutine collect_recorded_rates

    subroutine test_random_states(error)
        type(test_error), intent(inout) :: error
        type(scene_type) :: scene
        type(status_type) :: status
        type(model_type), target :: model
        integer :: i

        do i = 1, size(example)
            call read_scene("examples/"//trim(example(i))//".toml", scene, status)
            if (status%is_ok()) call build_model(scene, model, status)
            call check(error, status%is_ok(), trim(status%message))
            if (.not. status%is_ok()) return
            call compare_rates(error, trim(example(i)), model)
        end do
    end subroutine test_random_states

    !> One state on all lanes at once, then one after the other, which must be the same to the last bit.
    subroutine compare_rates(error, name, model)
        type(test_error), intent(inout) :: error
        character(len=*), intent(in) :: name
        type(model_type), intent(in), target :: model
        type(forward_system) :: system
        type(status_type) :: status
        type(random_stream) :: stream
        real(wp), allocatable :: y(:, :), by_lanes(:, :), by_record(:, :), alone(:)
        real(wp) :: t(lanes), q(lanes, model%n_q), qd(lanes, model%n_q)
        real(wp), dimension(model%n_q, 1) :: on_q, on_qd, on_qdd
        real(wp), allocatable :: load(:, :, :)
        logical :: failed(lanes), has_failed
        integer :: k, lane

        call build_forward_system(model, 0, system, status)
        call check(error, status%is_ok(), name//": "//trim(status%message))
        if (.not. status%is_ok()) return
        t = model%scene%time%first
        allocate (load(6, model%n_load, 1))
        call evaluate_motion(model, t(:1), on_q, on_qd, on_qdd, load)
        do k = 1, model%n_q
            q(:, k) = model%start_q(k) + 0.05_wp*stream%vector(lanes)
            qd(:, k) = on_qd(k, 1) + stream%vector(lanes)
        end do
        allocate (y(lanes, system%n), by_lanes(lanes, system%n), by_record(lanes, system%n), alone(system%n))
        call fill_start(model, system%layout, q, qd, y)
        call system%begin(t(1), y)
        system%may_record = .true.
        system%n_by_lanes = is_worth_recording(model)
        call system%evaluate(t, y, by_record, failed)
        call check(error, system%may_record .and. system%n_by_record == 1, name//": a record served")
        call system%evaluate_on_lanes(t, y, by_lanes, failed)
        print *, name, system%may_record, system%n_by_record
        if (.not. system%may_record) return
        print *, size(system%record%recorded%program%kernel%step), count(system%record%samples%is_left), &
            (maxval(abs(by_lanes(lane,:)-by_record(lane,:)))/maxval(abs(by_lanes(lane,:))),lane=1,3)
        do lane = 1, lanes
            call check_close(error, by_record(lane, :), by_lanes(lane, :), 1.0e-10_wp*maxval(abs(by_lanes(lane, :))), &
                             name//", state "//to_text(lane))
        end do
        call system%release()
    end subroutine compare_rates
end module test_recorded_rates
