!> Forward dynamics of a scene: driving forces given; motion, joint reactions, energies out.
!>
!> A run is started, advanced from chunk to chunk of output instants, so that a caller can write as it goes, and
!> finished. Kinks of the laws are hit exactly. The states of a chunk are turned into forces afterwards, on all lanes,
!> by the equations of inverse dynamics with the accelerations for unknowns. A run that cannot go on stops at its last
!> good instant and says so.
module linkdyn_forward
    use, intrinsic :: iso_fortran_env, only: int64
    use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan, ieee_is_finite
    use linkdyn_assembly_trail, only: sample_assembly, make_room
    use linkdyn_carried_assembly, only: keep_accepted
    use linkdyn_failure, only: failure_at
    use linkdyn_equations, only: build_equations, unknown_choice, solver_elimination
    use linkdyn_forward_state, only: fill_start, read_coordinates, scene_start
    use linkdyn_forward_system, only: forward_system, build_forward_system, choose_unknowns
    use linkdyn_integrator, only: integrator_type, integrator_options, choose_method, check_options, method_name, &
        method_rk4, method_rkf45, method_rk8pd, method_msbdf, method_gbs
    use linkdyn_inverse, only: inverse_results, inverse_solver, run_prepared
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_laws, only: law_kinks
    use linkdyn_model, only: model_type, has_assemblies
    use linkdyn_motion, only: evaluate_loads
    use linkdyn_scene, only: law_spec
    use linkdyn_status, only: status_type, fail, status_bad_input, sample_ok
    use linkdyn_text, only: to_text, quoted
    implicit none (type, external)
    private
    public :: forward_options, forward_results, forward_run, start_forward, advance_forward, interrupt_forward, finish_forward
    public :: run_forward, run_ensemble, integrator_options, choose_method, method_name
    public :: method_rk4, method_rkf45, method_rk8pd, method_msbdf, method_gbs

    type :: forward_options
        type(integrator_options) :: integrator
        real(wp) :: t_start = 0                        !! [s]
        integer :: stage_solver = 0                    !! of the right-hand side, which needs no reactions; 0: the fastest
        integer :: solver = solver_elimination         !! of the forces at output instants
        logical :: wants_reactions = .true.
        integer :: threads = 1
    end type forward_options

    !> Where the results of a chunk go; what is not associated is not computed.
    type :: forward_results
        real(wp), pointer :: q(:, :) => null()         !! (n_q, n) [m, rad]
        real(wp), pointer :: qd(:, :) => null()        !! (n_q, n)
        real(wp), pointer :: work(:) => null()         !! (n) of the driving forces since the start [J]
        real(wp), pointer :: step(:) => null()         !! (n) last step before the instant [s]
        type(inverse_results) :: forces                !! accelerations, forces, energies, closure, ... (n)
    end type forward_results

    !> A run under way.
    type :: forward_run
        type(model_type), pointer :: model => null()
        type(forward_system), pointer :: system => null()
        type(integrator_type) :: integrator
        type(inverse_solver) :: output                 !! equations at output instants
        integer :: threads = 1                         !! for them
        real(wp), allocatable :: y(:, :)               !! (lane, n)
        real(wp), allocatable :: kink(:)               !! instants at which a law changes its formula, increasing [s]
        logical :: has_stopped = .false.
        real(wp) :: good_until = 0                     !! [s]
        character(len=256) :: reason = ""              !! why it stopped
    end type forward_run

contains

    !> Check, plan, and place the mechanism at its start.
    !>
    !> **Errors**: `status_bad_input` for options or a scene that cannot be run; a start that cannot be assembled;
    !> `status_unavailable` for a method that this build lacks.
    subroutine start_forward(model, options, run, status)
        type(model_type), intent(in), target :: model  !! must outlive the run
        type(forward_options), intent(in) :: options
        type(forward_run), intent(inout) :: run
        type(status_type), intent(inout) :: status
        type(unknown_choice) :: unknown
        real(wp) :: q(model%n_q), qd(model%n_q), rate(lanes, 13*model%n_q + 1)
        logical :: failed(lanes)

        run%model => model
        call check_options(options%integrator, status)
        if (.not. status%is_ok()) return
        allocate (run%system)
        call build_forward_system(model, options%stage_solver, run%system, status)
        call choose_unknowns(model, unknown, status)
        if (status%is_ok()) call build_equations(model, options%solver, options%wants_reactions, &
                                                 run%output%equations, status, unknown)
        if (.not. status%is_ok()) return
        run%threads = max(1, options%threads)
        allocate (run%y(lanes, run%system%n))
        call scene_start(model, options%t_start, q, qd)
        call fill_start(model, run%system%layout, spread(q, 1, lanes), spread(qd, 1, lanes), run%y)
        call run%system%begin(options%t_start, run%y)
        call run%system%evaluate(spread(options%t_start, 1, lanes), run%y, rate(:, :run%system%n), failed)
        if (failed(1)) then
            call fail(status, status_bad_input, "the mechanism cannot be computed at its start: " &
                      //failure_at(model, run%system%workspace%state, run%system%workspace%status(1), 1))
            return
        end if
        call collect_kinks(model, run%kink)
        run%good_until = options%t_start
        call run%integrator%start(options%integrator, run%system, options%t_start, status)
    end subroutine start_forward

    !> Go on through the output instants t, increasing, and fill their results; those beyond where the run stops are NaN.
    !>
    !> With a time limit the run comes back when it has passed, after `n_done` instants, which may be none: call again
    !> with the rest. That changes nothing in the results.
    subroutine advance_forward(run, t, results, n_done, seconds)
        type(forward_run), intent(inout) :: run
        real(wp), intent(in) :: t(:)                   !! [s] (n)
        type(forward_results), intent(inout) :: results
        integer, intent(out) :: n_done                 !! instants dealt with
        real(wp), intent(in), optional :: seconds      !! of computing time, about
        real(wp), allocatable :: q(:, :), qd(:, :), qdd(:, :), force(:, :), load(:, :, :)
        type(sample_assembly) :: assembly
        real(wp) :: work
        integer :: i

        if (has_assemblies(run%model)) call make_room(run%model, size(t), assembly)
        associate (m => run%model, n => size(t))
            allocate (q(m%n_q, n), qd(m%n_q, n), qdd(m%n_q, n), force(m%n_actuator, n), load(6, m%n_load, n))
            ! A sample that is not reached is computed from NaN, which flags it like any that fails.
            q = ieee_value(1.0_wp, ieee_quiet_nan)
            qd = q
            qdd = q
            force = ieee_value(1.0_wp, ieee_quiet_nan)
        end associate
        call evaluate_loads(run%model, t, load)
        run%integrator%pause_at = pause_after(seconds)
        n_done = 0
        do i = 1, size(t)
            if (.not. run%has_stopped) call go_to(run, t(i))
            if (run%integrator%is_paused) exit
            work = ieee_value(1.0_wp, ieee_quiet_nan)
            if (.not. run%has_stopped) then
                call take_output(run, t(i), q(:, i), qd(:, i), qdd(:, i), force(:, i))
                call keep_accepted(run%model, run%system%assembly, i, assembly)
                work = run%y(1, run%system%layout%work)
            end if
            if (associated(results%work)) results%work(i) = work
            if (associated(results%step)) results%step(i) = run%integrator%last_step
            n_done = i
        end do
        call run_prepared(run%model, run%output, run%threads, q(:, :n_done), qd(:, :n_done), qdd(:, :n_done), &
                          load(:, :, :n_done), results%forces, force(:, :n_done), known=assembly)
        if (associated(results%q)) results%q = q
        if (associated(results%qd)) results%qd = qd
    end subroutine advance_forward

    !> Count of the system clock after some seconds from now.
    integer(int64) function pause_after(seconds) result(count)
        real(wp), intent(in), optional :: seconds
        integer(int64) :: rate

        count = huge(count)
        if (.not. present(seconds)) return
        call system_clock(count, rate)
        count = count + int(seconds*real(rate, wp), int64)
    end function pause_after

    !> Integrate to t, stopping at every kink on the way.
    subroutine go_to(run, t)
        type(forward_run), intent(inout) :: run
        real(wp), intent(in) :: t
        integer :: i

        do i = 1, size(run%kink)
            if (run%kink(i) <= run%integrator%t .or. run%kink(i) >= t) cycle
            call run%integrator%advance(run%system, run%kink(i), run%y)
            if (run%integrator%is_paused) return
            call run%integrator%reset()
        end do
        call run%integrator%advance(run%system, t, run%y)
        run%good_until = run%integrator%good_until(1)
        run%has_stopped = run%integrator%failed(1)
        if (run%has_stopped) run%reason = reason_of_stop(run)
    end subroutine go_to

    function reason_of_stop(run) result(reason)
        type(forward_run), intent(in) :: run
        character(len=:), allocatable :: reason

        reason = "stopped at t = "//to_text(run%good_until)//" s: "
        if (run%system%workspace%status(1) /= sample_ok) then
            reason = reason//failure_at(run%model, run%system%workspace%state, run%system%workspace%status(1), 1)//" beyond"
        else if (run%integrator%has_shrunk) then
            reason = reason//"the steps shrink to nothing, as they do where the equations of motion are singular"
        else
            reason = reason//"the motion grows without bound"
        end if
    end function reason_of_stop

    !> Coordinates and given driving forces at the instant reached.
    subroutine take_output(run, t, q, qd, qdd, force)
        type(forward_run), intent(inout) :: run
        real(wp), intent(in) :: t
        real(wp), intent(out) :: q(:), qd(:), qdd(:), force(:)
        real(wp) :: instant(lanes), rate(lanes, run%system%n)
        real(wp), dimension(lanes, run%model%n_q) :: lane_q, lane_qd, lane_qdd
        logical :: failed(lanes)

        instant = t
        call run%system%evaluate(instant, run%y, rate, failed)
        force = run%system%workspace%driving_force(1, :)
        call read_coordinates(run%model, run%system%layout, instant, run%y, run%system%workspace%state, lane_q, lane_qd, lane_qdd)
        q = lane_q(1, :)
        qd = lane_qd(1, :)
        qdd = lane_qdd(1, :)
    end subroutine take_output

    !> End the run where it is, between two steps.
    subroutine interrupt_forward(run)
        type(forward_run), intent(inout) :: run

        run%has_stopped = .true.
        run%good_until = run%integrator%good_until(1)
        run%reason = "interrupted at t = "//to_text(run%good_until)//" s"
    end subroutine interrupt_forward

    !> Release what the run holds.
    subroutine finish_forward(run)
        type(forward_run), intent(inout) :: run

        call run%integrator%finish()
        if (.not. associated(run%system)) return
        call run%system%release()
        deallocate (run%system)
    end subroutine finish_forward

    !> A whole run: t are the output instants, increasing. A run that stops early is no error: see `run`.
    subroutine run_forward(model, options, t, results, run, status)
        type(model_type), intent(in), target :: model
        type(forward_options), intent(in) :: options
        real(wp), intent(in) :: t(:)                   !! [s] (n)
        type(forward_results), intent(inout) :: results
        type(forward_run), intent(inout) :: run        !! statistics; why and where it stopped
        type(status_type), intent(inout) :: status
        integer :: n_done

        call start_forward(model, options, run, status)
        if (status%is_ok()) call advance_forward(run, t, results, n_done)
        call finish_forward(run)
    end subroutine run_forward

    !> Many runs from different starts by rk4, `lanes` at once: coordinates and rates at the output instants.
    subroutine run_ensemble(model, options, q_start, qd_start, t, q, qd, good_until, status)
        type(model_type), intent(in), target :: model
        type(forward_options), intent(in) :: options   !! the method must be rk4
        real(wp), intent(in) :: q_start(:, :), qd_start(:, :)    !! (n_q, n_member)
        real(wp), intent(in) :: t(:)                   !! [s] (n)
        real(wp), intent(out) :: q(:, :, :), qd(:, :, :)         !! (n_q, n, n_member); NaN once a member has stopped
        real(wp), intent(out) :: good_until(:)         !! last good instant (n_member) [s]
        type(status_type), intent(inout) :: status
        type(status_type) :: block_status
        integer :: block

        if (options%integrator%method /= method_rk4) call fail(status, status_bad_input, "an ensemble runs at a fixed step, " &
            //"not by "//quoted(trim(method_name(options%integrator%method)))//" (expected method rk4)")
        call check_options(options%integrator, status)
        if (.not. status%is_ok()) return
        !$omp parallel do num_threads(max(1, options%threads)) private(block_status) schedule(dynamic)
        do block = 1, (size(q_start, 2) + lanes - 1)/lanes
            block_status = status_type()
            call run_block(block, block_status)
            !$omp critical (linkdyn_ensemble_status)
            if (status%is_ok()) status = block_status
            !$omp end critical (linkdyn_ensemble_status)
        end do
        !$omp end parallel do

    contains

        !> One block of members; lanes beyond the last member repeat it.
        subroutine run_block(block, status)
            integer, intent(in) :: block
            type(status_type), intent(inout) :: status
            type(forward_run) :: run
            integer :: member(lanes), i

            member = [(min((block - 1)*lanes + i, size(q_start, 2)), i=1, lanes)]
            run%model => model
            allocate (run%system)
            call build_forward_system(model, options%stage_solver, run%system, status)
            if (status%is_ok()) then
                run%system%wants_work = .false.
                allocate (run%y(lanes, run%system%n))
                call fill_start(model, run%system%layout, transpose(q_start(:, member)), transpose(qd_start(:, member)), run%y)
                call run%system%begin(options%t_start, run%y)
                call collect_kinks(model, run%kink)
                call run%integrator%start(options%integrator, run%system, options%t_start, status)
                do i = 1, size(t)
                    call go_to(run, t(i))
                    call store(run, member, t(i), i)
                end do
                do i = 1, lanes
                    good_until(member(i)) = run%integrator%good_until(i)
                end do
            end if
            call finish_forward(run)
        end subroutine run_block

        subroutine store(run, member, instant, i)
            type(forward_run), intent(inout) :: run
            integer, intent(in) :: member(lanes), i
            real(wp), intent(in) :: instant
            real(wp), dimension(lanes, model%n_q) :: lane_q, lane_qd, lane_qdd
            integer :: lane

            call read_coordinates(model, run%system%layout, spread(instant, 1, lanes), run%y, run%system%workspace%state, &
                                  lane_q, lane_qd, lane_qdd)
            do lane = 1, lanes
                if (run%integrator%failed(lane)) then
                    lane_q(lane, :) = ieee_value(1.0_wp, ieee_quiet_nan)
                    lane_qd(lane, :) = lane_q(lane, :)
                end if
                q(:, i, member(lane)) = lane_q(lane, :)
                qd(:, i, member(lane)) = lane_qd(lane, :)
            end do
        end subroutine store
    end subroutine run_ensemble

    ! ---------------------------------------------------------------- kinks

    !> Instants at which any law of the scene changes its formula, increasing.
    subroutine collect_kinks(model, kink)
        type(model_type), intent(in) :: model
        real(wp), allocatable, intent(out) :: kink(:)
        integer :: i, k

        allocate (kink(0))
        do i = 1, model%n_q
            call add_kinks(model%scene%coordinate(i)%motion, kink)
        end do
        do i = 1, model%n_actuator
            call add_kinks(model%scene%actuator(i)%drive%target, kink)
        end do
        do i = 1, model%n_load
            do k = 1, 3
                call add_kinks(model%scene%load(i)%force(k), kink)
                call add_kinks(model%scene%load(i)%moment(k), kink)
            end do
        end do
    end subroutine collect_kinks

    !> Merge the kinks of a law into a sorted list without doubles.
    subroutine add_kinks(law, kink)
        type(law_spec), intent(in) :: law
        real(wp), allocatable, intent(inout) :: kink(:)
        real(wp), allocatable :: new(:)
        integer :: i

        call law_kinks(law, new)
        do i = 1, size(new)
            if (any(kink == new(i))) cycle
            kink = [pack(kink, kink < new(i)), new(i), pack(kink, kink > new(i))]
        end do
    end subroutine add_kinks
end module linkdyn_forward
