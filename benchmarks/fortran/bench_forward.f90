!> Forward dynamics of a scene: time per right-hand side, and error against time of every method, on one thread.
!>
!> Usage: bench_forward [SCENE [SECONDS]]. Two CSV tables. Right-hand sides: solver, kind (single: one run, so one block;
!> member: of an ensemble that fills the lanes), microseconds (best of several passes). Methods: name, step or tolerance,
!> milliseconds per simulated second, right-hand sides, largest error of the coordinates at the end against rk8pd at its
!> tightest. The first line gives the multiply-add peak of this core measured in the same run: these machines are shared,
!> so only ratios within one run mean much.
program bench_forward
    use, intrinsic :: iso_fortran_env, only: int64, output_unit, error_unit
    use linkdyn_builder, only: build_model
    use linkdyn_equations, only: solver_name, solver_reduced, solver_elimination
    use linkdyn_forward, only: forward_options, forward_results, forward_run, integrator_options, start_forward, &
        advance_forward, finish_forward, method_rk4, method_rkf45, method_rk8pd, method_msbdf, method_gbs, method_name
    use linkdyn_forward_state, only: fill_start, scene_start
    use linkdyn_forward_system, only: forward_system, build_forward_system
    use linkdyn_kinds, only: wp, wp_name
    use linkdyn_lane_count, only: lanes
    use linkdyn_model, only: model_type
    use linkdyn_scene, only: scene_type
    use linkdyn_scene_reader, only: read_scene
    use linkdyn_status, only: status_type
    implicit none (type, external)
    character(len=256) :: file, number
    type(scene_type) :: scene
    type(model_type), target :: model
    type(status_type) :: status
    real(wp) :: t_end
    integer :: stat

    file = "examples/stewart_forward/scene.toml"
    t_end = 1
    if (command_argument_count() > 0) call get_command_argument(1, file)
    if (command_argument_count() > 1) then
        call get_command_argument(2, number)
        read (number, *, iostat=stat) t_end
    end if
    write (output_unit, "(a,i0,a)") "# kind "//wp_name//", ", lanes, " lanes"
    call read_scene(trim(file), scene, status)
    if (status%is_ok()) call build_model(scene, model, status)
    if (status%is_ok()) call time_right_hand_sides(status)
    if (status%is_ok()) call compare_methods(status)
    if (.not. status%is_ok()) write (error_unit, "(a)") trim(status%message)

contains

    real(wp) function seconds()
        integer(int64) :: count, rate

        call system_clock(count, rate)
        seconds = real(count, wp)/real(rate, wp)
    end function seconds

    !> The same block serves one run or `lanes` members.
    subroutine time_right_hand_sides(status)
        type(status_type), intent(inout) :: status
        integer, parameter :: n_pass = 7, n_repeat = 4000
        integer, parameter :: solver(2) = [solver_reduced, solver_elimination]
        type(forward_system) :: system
        real(wp) :: q(model%n_q), qd(model%n_q), best, start
        real(wp), allocatable :: y(:, :), rate(:, :)
        logical :: failed(lanes)
        integer :: i, pass, repeat

        write (output_unit, "(a)") "solver,us_single,us_per_member,elimination_terms"
        do i = 1, size(solver)
            system = forward_system()
            call build_forward_system(model, solver(i), system, status)
            if (.not. status%is_ok()) return
            system%wants_work = .false.
            allocate (y(lanes, system%n), rate(lanes, system%n))
            call scene_start(model, 0.0_wp, q, qd)
            call fill_start(model, system%layout, spread(q, 1, lanes), spread(qd, 1, lanes), y)
            best = huge(1.0_wp)
            do pass = 1, n_pass
                start = seconds()
                do repeat = 1, n_repeat
                    call system%evaluate(spread(1.0e-3_wp*repeat, 1, lanes), y, rate, failed)
                end do
                best = min(best, (seconds() - start)/n_repeat)
            end do
            write (output_unit, "(a,2(',',f0.3),',',i0)") trim(solver_name(solver(i))), 1.0e6_wp*best, 1.0e6_wp*best/lanes, &
                system%equations%plan%n_term
            deallocate (y, rate)
            call system%release()
        end do
    end subroutine time_right_hand_sides

    subroutine compare_methods(status)
        type(status_type), intent(inout) :: status
        integer, parameter :: method(3) = [method_rkf45, method_rk8pd, method_gbs]
        real(wp) :: reference(model%n_q), q(model%n_q)
        integer :: i, k

        write (output_unit, "(a)") "method,setting,ms_per_second,right_hand_sides,error"
        call run_once(integrator_options(method=method_rk8pd, rtol=2.0e-15_wp, atol=2.0e-15_wp), 2.0e-15_wp, reference, status)
        if (.not. status%is_ok()) return
        do k = 1, 6
            call run_once(integrator_options(method=method_rk4, step=0.02_wp/2**k), 0.02_wp/2**k, q, status, reference)
        end do
        do i = 1, size(method)
            do k = 4, 13
                call run_once(integrator_options(method=method(i), rtol=10.0_wp**(-k), atol=10.0_wp**(-k)), &
                              10.0_wp**(-k), q, status, reference)
            end do
        end do
        do k = 4, 8
            call run_once(integrator_options(method=method_msbdf, rtol=10.0_wp**(-k), atol=10.0_wp**(-k)), &
                          10.0_wp**(-k), q, status, reference)
        end do
    end subroutine compare_methods

    subroutine run_once(options, setting, q_end, status, reference)
        type(integrator_options), intent(in) :: options
        real(wp), intent(in) :: setting
        real(wp), intent(out) :: q_end(:)
        type(status_type), intent(inout) :: status
        real(wp), intent(in), optional :: reference(:)
        type(forward_results) :: results
        type(forward_run) :: run
        real(wp), target :: q(model%n_q, 1)
        real(wp) :: start, taken
        integer :: n_good

        results%q => q
        call start_forward(model, forward_options(integrator=options, wants_reactions=.false.), run, status)
        if (.not. status%is_ok()) return
        start = seconds()
        call advance_forward(run, [t_end], results, n_good)
        taken = seconds() - start
        call finish_forward(run)
        q_end = q(:, 1)
        if (run%has_stopped) write (error_unit, "(a)") trim(run%reason)
        if (present(reference)) write (output_unit, "(a,',',es9.2,',',f0.3,',',i0,',',es9.2)") &
            trim(method_name(options%method)), setting, 1.0e3_wp*taken/t_end, run%integrator%n_evaluation, &
            maxval(abs(q_end - reference))
    end subroutine run_once
end program bench_forward
