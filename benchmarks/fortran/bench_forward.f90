!> Forward dynamics of a scene on one thread: time per right-hand side, and states and times of every method.
!>
!> Usage: bench_forward SCENE END [STEPS [DIGITS [lanes]]]. Two CSV tables. Right-hand sides: solver on lanes, or the scene's
!> record; microseconds (best of several passes) of one run, which on lanes has a block to itself, per member of an
!> ensemble that fills the lanes, and, with the record, of all that such an ensemble does, by member and stage. Methods: name, step or tolerance, milliseconds for the whole run to END [s] of a scene
!> that has been run before, so that its record is there, right-hand sides, then q and qd at its end (NaN if it stopped). rk4 takes STEPS, 2 STEPS, ...
!> 128 STEPS steps (default 50); tolerances go from 1e-3 to 10**-DIGITS (default 13). With "lanes" these have no record.
!> These machines are shared: only ratios within one run mean much.
program bench_forward
    use, intrinsic :: iso_fortran_env, only: int64, output_unit, error_unit
    use linkdyn_builder, only: build_model
    use linkdyn_ensemble, only: run_ensemble
    use linkdyn_equations, only: solver_name, solver_reduced, solver_elimination
    use linkdyn_forward, only: forward_options, forward_results, forward_run, integrator_options, start_forward, &
        advance_forward, finish_forward, method_rk4, method_rkf45, method_rk8pd, method_msbdf, method_gbs, &
        method_seulex, method_name
    use linkdyn_forward_state, only: fill_start, scene_start
    use linkdyn_forward_system, only: forward_system, build_forward_system
    use linkdyn_kinds, only: wp, wp_name
    use linkdyn_lane_count, only: lanes
    use linkdyn_model, only: model_type
    use linkdyn_scene, only: scene_type
    use linkdyn_scene_reader, only: read_scene
    use linkdyn_shared_programs, only: shared_programs, hold_programs, leave_programs
    use linkdyn_status, only: status_type
    implicit none (type, external)
    character(len=256) :: file
    type(scene_type) :: scene
    type(model_type), target :: model
    type(status_type) :: status
    real(wp) :: t_end
    character(len=8) :: road
    integer :: n_first, n_digit
    type(shared_programs), pointer :: shared => null()

    file = "examples/stewart_forward/scene.toml"
    if (command_argument_count() > 0) call get_command_argument(1, file)
    t_end = number_given(2, 1.0_wp)
    n_first = nint(number_given(3, 50.0_wp))
    n_digit = nint(number_given(4, 13.0_wp))
    road = ""
    if (command_argument_count() > 4) call get_command_argument(5, road)
    write (output_unit, "(a,i0,a)") "# kind "//wp_name//", ", lanes, " lanes"
    call read_scene(trim(file), scene, status)
    if (status%is_ok()) call build_model(scene, model, status)
    if (status%is_ok()) call time_right_hand_sides(status)
    if (status%is_ok()) call time_methods(status)
    if (.not. status%is_ok()) then
        write (error_unit, "(a)") trim(status%message)
        error stop 2, quiet=.true.
    end if

contains

    real(wp) function seconds()
        integer(int64) :: count, rate

        call system_clock(count, rate)
        seconds = real(count, wp)/real(rate, wp)
    end function seconds

    real(wp) function number_given(i, default) result(number)
        integer, intent(in) :: i
        real(wp), intent(in) :: default
        character(len=32) :: text

        number = default
        if (command_argument_count() < i) return
        call get_command_argument(i, text)
        read (text, *) number
    end function number_given

    !> On lanes the same block serves one run or `lanes` members. Near the start, where no assembly is in doubt.
    subroutine time_right_hand_sides(status)
        type(status_type), intent(inout) :: status
        integer, parameter :: solver(3) = [solver_reduced, solver_elimination, 0]     !! 0: the record
        type(forward_system) :: system, new_system
        real(wp) :: q(model%n_q), qd(model%n_q), single, block, whole
        real(wp), allocatable :: y(:, :)
        integer :: i

        write (output_unit, "(a)") "solver,us_single,us_per_member,us_of_ensemble"
        do i = 1, size(solver)
            system = new_system
            call build_forward_system(model, solver(i), system, status)
            if (.not. status%is_ok()) return
            system%wants_work = .false.
            allocate (y(lanes, system%n))
            call scene_start(model, 0.0_wp, q, qd)
            call fill_start(model, system%layout, spread(q, 1, lanes), spread(qd, 1, lanes), y)
            call system%begin(0.0_wp, y)
            if (solver(i) == 0) call system%make_record(0.0_wp)
            single = time_rates(system, y, is_alone=.true.)
            block = time_rates(system, y, is_alone=.false.)
            if (solver(i) > 0) then
                write (output_unit, "(a,2(',',f0.4),',')") trim(solver_name(solver(i))), 1.0e6_wp*single, 1.0e6_wp*block/lanes
            else if (system%n_by_record > 0) then
                call time_ensemble(q, qd, whole, status)
                write (output_unit, "(a,3(',',f0.4))") "record", 1.0e6_wp*single, 1.0e6_wp*block/lanes, 1.0e6_wp*whole
            end if
            deallocate (y)
            call system%release()
        end do
    end subroutine time_right_hand_sides

    !> Time of a stage of a member of an ensemble, with its part of all that is done beside the stages; the best of some passes. All
    !> members begin alike, and go a little of the way to the end.
    subroutine time_ensemble(q, qd, best, status)
        real(wp), intent(in) :: q(:), qd(:)
        real(wp), intent(out) :: best
        type(status_type), intent(inout) :: status
        integer, parameter :: n_member = 4*lanes, n_step = 2000, n_stage = 4, n_pass = 5
        type(forward_options) :: options
        real(wp) :: q_end(model%n_q, 1, n_member), qd_end(model%n_q, 1, n_member), good_until(n_member), start
        integer :: n_crossed(n_member), outcome(n_member), pass

        call hold_programs(shared)
        best = huge(1.0_wp)
        associate (step => t_end/(128*n_first))
            options = options_of(integrator_options(method=method_rk4, step=step))
            do pass = 0, n_pass                            ! the first one makes the record
                start = seconds()
                call run_ensemble(model, options, spread(q, 2, n_member), spread(qd, 2, n_member), [n_step*step], q_end, qd_end, &
                                  good_until, n_crossed, outcome, status)
                if (pass > 0) best = min(best, (seconds() - start)/(real(n_member, wp)*n_step*n_stage))
            end do
        end associate
        call leave_programs(shared)
    end subroutine time_ensemble

    !> Time of one evaluation, of a state or of a block of them; the best of some passes.
    real(wp) function time_rates(system, y, is_alone) result(best)
        type(forward_system), intent(inout) :: system
        real(wp), intent(in), contiguous :: y(:, :)
        logical, intent(in) :: is_alone
        integer, parameter :: n_pass = 7
        real(wp), parameter :: shortest = 5.0e-3_wp        !! a pass [s]
        real(wp) :: start, instant(lanes), rate(lanes, system%n), alone(system%n), rate_alone(system%n)
        logical :: failed(lanes)
        integer :: pass, repeat, n_repeat

        alone = y(1, :)
        best = huge(1.0_wp)
        n_repeat = 10
        do pass = 1, n_pass
            start = seconds()
            do repeat = 1, n_repeat
                if (is_alone) then
                    call system%evaluate_alone(1.0e-9_wp*repeat, alone, rate_alone, failed(1))
                else
                    instant = 1.0e-9_wp*repeat
                    call system%evaluate(instant, y, rate, failed)
                end if
            end do
            best = min(best, (seconds() - start)/n_repeat)
            n_repeat = min(100000, max(10, ceiling(shortest/best)))
        end do
    end function time_rates

    subroutine time_methods(status)
        type(status_type), intent(inout) :: status
        integer, parameter :: method(5) = [method_rkf45, method_rk8pd, method_gbs, method_seulex, method_msbdf]
        integer, parameter :: most_digits(5) = [13, 13, 13, 10, 8]
        real(wp) :: setting
        integer :: i, k

        call hold_programs(shared)
        call run_a_little(status)
        if (.not. status%is_ok()) return
        write (output_unit, "(a)") "method,setting,ms,right_hand_sides,state"
        do k = 0, 7
            setting = t_end/(n_first*2**k)
            call time_method(integrator_options(method=method_rk4, step=setting), setting, status)
        end do
        do i = 1, size(method)
            do k = 3, min(n_digit, most_digits(i))
                setting = 10.0_wp**(-k)
                call time_method(integrator_options(method=method(i), step=t_end/n_first, rtol=setting, atol=setting), &
                                 setting, status)
                if (.not. status%is_ok()) exit
            end do
        end do
        call leave_programs(shared)
    end subroutine time_methods

    !> The first run makes the record.
    subroutine run_a_little(status)
        type(status_type), intent(inout) :: status
        type(forward_run) :: run
        type(forward_results) :: results
        integer :: n_done

        call start_forward(model, options_of(integrator_options(method=method_rk4, step=1.0e-3_wp*t_end)), run, status)
        if (status%is_ok()) call advance_forward(run, [1.0e-3_wp*t_end], results, n_done)
        call finish_forward(run)
    end subroutine run_a_little

    type(forward_options) function options_of(method) result(options)
        type(integrator_options), intent(in) :: method

        options%integrator = method
        options%wants_reactions = .false.
        options%by_record = road /= "lanes"
        options%shared => shared
    end function options_of

    !> The best of some runs, or one, if it takes long.
    subroutine time_method(options, setting, status)
        type(integrator_options), intent(in) :: options
        real(wp), intent(in) :: setting
        type(status_type), intent(inout) :: status
        integer, parameter :: n_most = 15
        real(wp), parameter :: enough = 0.03_wp            !! [s] in all
        type(forward_results) :: results
        type(forward_run) :: run, new_run
        real(wp), target :: q(model%n_q, 1), qd(model%n_q, 1)
        real(wp) :: start, taken, best, total
        integer :: n_good, n_evaluation, i

        results%q => q
        results%qd => qd
        best = huge(1.0_wp)
        total = 0
        do i = 1, n_most
            run = new_run
            call start_forward(model, options_of(options), run, status)
            if (.not. status%is_ok()) return
            start = seconds()
            call advance_forward(run, [t_end], results, n_good)
            taken = seconds() - start
            n_evaluation = run%integrator%n_evaluation
            call finish_forward(run)
            best = min(best, taken)
            total = total + taken
            if (total > enough) exit
        end do
        write (output_unit, "(a,',',es9.3,',',es11.4,',',i0,*(:,',',es24.16))") trim(method_name(options%method)), setting, &
            1.0e3_wp*best, n_evaluation, q, qd
        flush (output_unit)
    end subroutine time_method
end program bench_forward
