!> Time against error of every method on one scene: solvers of inverse dynamics, integrators of forward dynamics.
!>
!> Each method is run until its time can be told; its result is compared with a reference that the caller has, from the
!> quadruple twin, or with the most careful result of our own.
module linkdyn_study
    use, intrinsic :: iso_fortran_env, only: int64
    use linkdyn_result_kinds, only: result_driving_force, result_reaction
    use linkdyn_assembly_trail, only: assembly_trail
    use linkdyn_forward, only: forward_options, forward_results, forward_run, start_forward, advance_forward, &
        finish_forward, method_name, method_rk4, method_rk8pd, method_gbs
    use linkdyn_inverse, only: inverse_options, inverse_results, inverse_solver, motion_batch, motion_of, prepare_inverse, &
        run_prepared, solver_lapack, solver_reduced, solver_gauss_jordan_plain, solver_name
    use linkdyn_kinds, only: wp
    use linkdyn_model, only: model_type
    use linkdyn_shared_programs, only: hold_programs, leave_programs
    use linkdyn_status, only: status_type, fail, status_bad_input, sample_ok
    use linkdyn_text, only: to_text
    implicit none (type, external)
    private
    public :: study_row, study_states, keep_computable, study_inverse, study_forward, recommend, warn_of_growth, &
        warn_of_reference

    !> One method, one setting.
    type :: study_row
        character(len=8) :: analysis = ""        !! inverse or forward
        character(len=18) :: method = ""
        character(len=24) :: setting = ""        !! "tol 1e-8", "step 0.001"; blank: none
        real(wp) :: seconds = 0                  !! a sample, or the whole run
        real(wp) :: error = 0                    !! relative; huge: the run failed
        integer :: n_step = 0                    !! of an integrator
    end type study_row

    !> Samples of the inverse part.
    type :: study_states
        real(wp), allocatable :: t(:), q(:, :), qd(:, :), qdd(:, :), load(:, :, :)
    end type study_states

    real(wp), parameter :: least_seconds = 0.02_wp    !! of a measurement
    real(wp), parameter :: most_seconds = 4.0_wp      !! a method that took longer goes no further down its ladder
    real(wp), parameter :: unstable = 1.0e4_wp        !! growth of errors from a tenth of a run to its end; even motions have 100 at
                                                      !! most

contains

    !> Leave out the states at which there are no forces.
    !>
    !> **Errors**: `status_bad_input` if none is left.
    subroutine keep_computable(model, states, status)
        type(model_type), intent(in) :: model
        type(study_states), intent(inout) :: states
        type(status_type), intent(inout) :: status
        real(wp) :: value(model%n_actuator + model%n_component*model%n_joint, size(states%t))
        real(wp) :: seconds
        logical :: good(size(states%t))
        integer, allocatable :: kept(:)
        integer :: i

        call run_solver(model, states, solver_lapack, value, good, seconds, status)
        if (.not. status%is_ok()) return
        if (.not. any(good)) then
            call fail(status, status_bad_input, "no sample of the motion has forces ('linkdyn inverse' says why)")
            return
        end if
        kept = pack([(i, i=1, size(good))], good)
        states%t = states%t(kept)
        states%q = states%q(:, kept)
        states%qd = states%qd(:, kept)
        states%qdd = states%qdd(:, kept)
        states%load = states%load(:, :, kept)
    end subroutine keep_computable

    !> All solvers on some samples along the motion. Errors: largest difference of a force or moment from the reference,
    !> relative to the sample's largest, over all samples; huge of a solver that leaves a sample without forces.
    subroutine study_inverse(model, states, exact, row, status)
        type(model_type), intent(in) :: model
        type(study_states), intent(in) :: states
        real(wp), intent(in), optional :: exact(:, :)    !! driving forces, reactions (n_actuator + components, n)
        type(study_row), allocatable, intent(out) :: row(:)
        type(status_type), intent(inout) :: status
        real(wp) :: value(model%n_actuator + model%n_component*model%n_joint, size(states%t))
        real(wp) :: reference(size(value, 1), size(value, 2))
        real(wp) :: seconds
        integer :: s, i, n_value
        logical :: good(size(states%t))

        allocate (row(0))
        call run_solver(model, states, solver_lapack, reference, good, seconds, status)
        if (present(exact)) reference = exact
        if (.not. status%is_ok()) return
        do s = 1, size(solver_name)
            call run_solver(model, states, s, value, good, seconds, status)
            if (.not. status%is_ok()) return
            row = [row, study_row("inverse", solver_name(s), "", seconds)]
            n_value = merge(model%n_actuator, size(value, 1), s == solver_reduced)
            if (.not. all(good)) then
                row(size(row))%error = huge(1.0_wp)
                cycle
            end if
            do i = 1, size(states%t)
                row(size(row))%error = max(row(size(row))%error, &
                    maxval(abs(value(:n_value, i) - reference(:n_value, i))) &
                    /max(maxval(abs(reference(:n_value, i))), tiny(1.0_wp)))
            end do
        end do
    end subroutine study_inverse

    !> One solver: its forces, and seconds a sample.
    subroutine run_solver(model, states, solver, value, good, seconds, status)
        type(model_type), intent(in) :: model
        type(study_states), intent(in), target :: states
        integer, intent(in) :: solver
        real(wp), intent(out) :: value(:, :)
        logical, intent(out) :: good(:)
        real(wp), intent(out) :: seconds
        type(status_type), intent(inout) :: status
        type(inverse_solver) :: planned
        type(inverse_results) :: results
        real(wp), target :: force(model%n_actuator, size(states%t))
        real(wp), allocatable, target :: reaction(:, :, :)
        integer, target :: outcome(size(states%t))
        integer(int64) :: start, finish, rate
        integer :: n_repeat, i

        value = 0
        seconds = 0
        good = .false.
        call prepare_inverse(model, inverse_options(solver=solver), solver /= solver_reduced, planned, status)
        if (.not. status%is_ok()) return
        allocate (reaction(model%n_component, model%n_joint, size(states%t)))
        reaction = 0
        call results%put(result_driving_force, force)
        results%status => outcome
        if (solver /= solver_reduced) call results%put(result_reaction, reaction)
        n_repeat = 1
        do
            call system_clock(start, rate)
            do i = 1, n_repeat
                call run_once()
            end do
            call system_clock(finish)
            seconds = real(finish - start, wp)/real(rate, wp)
            if (seconds >= least_seconds) exit
            n_repeat = 2*n_repeat
        end do
        seconds = seconds/n_repeat/size(states%t)
        value(:model%n_actuator, :) = force
        value(model%n_actuator + 1:, :) = reshape(reaction, [model%n_component*model%n_joint, size(states%t)])
        good = outcome == sample_ok
        call planned%free()

    contains

        subroutine run_once()
            type(assembly_trail) :: trail
            type(motion_batch) :: motion

            motion = motion_of(states%q, states%qd, states%qdd, states%load)
            motion%t => states%t
            call run_prepared(model, planned, 1, motion, results, trail=trail)
        end subroutine run_once
    end subroutine run_solver

    !> All integrators down a ladder of tolerances or steps. Error: largest difference of a coordinate at the output
    !> instants, relative to the largest length, or to the largest angle or 1 rad.
    subroutine study_forward(model, t, exact, row, tenfold, astray, status)
        type(model_type), intent(in), target :: model
        real(wp), intent(in) :: t(:)                     !! instants of output [s]
        real(wp), intent(in), optional :: exact(:, :)    !! (n_q, n)
        type(study_row), allocatable, intent(out) :: row(:)
        real(wp), intent(out) :: tenfold                 !! time in which errors grow tenfold [s]; 0: they do not grow like that
        real(wp), intent(out) :: astray(2)               !! error of the reference where methods that agree tell it, and by how much
                                                         !! these differ; 0: nothing speaks against it
        type(status_type), intent(inout) :: status
        ! The last is for methods of high order.
        real(wp), parameter :: tolerance(*) = [1.0e-4_wp, 1.0e-6_wp, 1.0e-8_wp, 1.0e-10_wp, 1.0e-12_wp, 1.0e-14_wp]
        integer, parameter :: n_step(*) = [50, 200, 800, 3200, 12800]    !! of a fixed step, over the run
        real(wp), parameter :: tightest = 1.0e-13_wp
        type(forward_options) :: options
        type(status_type) :: outcome
        real(wp), dimension(model%n_q, size(t)) :: q, reference, by_runge_kutta, by_extrapolation
        real(wp) :: seconds, span
        real(wp), allocatable :: growth(:)
        integer :: method, k, n_taken
        logical :: is_done, are_done(2)

        allocate (row(0), growth(0))
        tenfold = 0
        astray = 0
        are_done = .false.
        span = t(size(t)) - t(1)
        options%wants_reactions = .false.
        options%t_start = t(1)
        options%integrator%step = min(1.0e-3_wp, span/10)
        options%integrator%method = method_gbs
        options%integrator%rtol = tightest
        options%integrator%atol = tightest
        call hold_programs(options%shared)                ! one record for all
        call run_integrator(model, options, t, reference, seconds, n_taken, is_done, status)
        if (.not. status%is_ok()) then
            call leave_programs(options%shared)
            return
        end if
        if (present(exact)) reference = exact
        do method = 1, size(method_name)
            options%integrator%method = method
            do k = 1, merge(size(tolerance), size(n_step), method == method_rk8pd .or. method == method_gbs)
                options%integrator%rtol = tolerance(k)
                options%integrator%atol = tolerance(k)
                options%integrator%step = min(1.0e-3_wp, span/10)
                if (method == method_rk4) options%integrator%step = span/n_step(k)
                outcome = status_type()
                call run_integrator(model, options, t, q, seconds, n_taken, is_done, outcome)
                if (.not. outcome%is_ok()) exit           ! a build without this method
                row = [row, study_row("forward", method_name(method), setting_of(options), seconds, &
                                      worst_difference(model, q, reference, is_done), n_taken)]
                if (tells_growth(row(size(row))%error)) growth = [growth, growth_of(model, q, reference)]
                if (method == method_rk8pd .and. is_done) by_runge_kutta = q
                if (method == method_gbs .and. is_done) by_extrapolation = q
                if (method == method_rk8pd) are_done(1) = is_done
                if (method == method_gbs) are_done(2) = is_done
                if (seconds > most_seconds) exit
            end do
        end do
        call leave_programs(options%shared)
        if (all(are_done)) astray = error_of_reference(model, by_runge_kutta, by_extrapolation, reference)
        if (size(growth) == 0) return
        if (median(growth) > unstable) tenfold = (t(size(t)) - t(2))/log10(median(growth))
    end subroutine study_forward

    !> How far a reference is off, and how far two results of different methods are from each other, if these agree far
    !> better with each other than with it: what is wrong is the reference then, and no error above says anything. 0: they do not.
    pure function error_of_reference(model, one, other, reference) result(astray)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: one(:, :), other(:, :), reference(:, :)
        real(wp) :: astray(2)
        real(wp), parameter :: far = 1000                !! over what they differ by
        real(wp), parameter :: rounding = 1.0e-15_wp

        astray(1) = min(worst_difference(model, one, reference, .true.), worst_difference(model, other, reference, .true.))
        astray(2) = worst_difference(model, one, other, .true.)
        if (astray(1) < far*max(astray(2), rounding)) astray = 0
    end function error_of_reference

    !> Is an error at the end small enough to have grown all the way, and more than rounding?
    pure logical function tells_growth(error)
        real(wp), intent(in) :: error

        tells_growth = error < 1.0e-3_wp .and. error > 1.0e-12_wp
    end function tells_growth

    !> Error at the last instant over that at the second; the first is the start.
    pure real(wp) function growth_of(model, q, reference) result(growth)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: q(:, :), reference(:, :)
        real(wp) :: error(2)
        integer :: i

        do i = 1, 2
            associate (at => merge(2, size(q, 2), i == 1))
                error(i) = worst_difference(model, q(:, at:at), reference(:, at:at), .true.)
            end associate
        end do
        growth = error(2)/max(error(1), epsilon(1.0_wp))
    end function growth_of

    pure real(wp) function median(values)
        real(wp), intent(in) :: values(:)
        integer :: i

        ! The value that no more than half of them exceed.
        median = maxval(values)
        do i = 1, size(values)
            if (2*count(values > values(i)) <= size(values)) median = min(median, values(i))
        end do
    end function median

    !> What to tell of a motion in which errors grow; blank where they do not.
    function warn_of_growth(tenfold) result(text)
        real(wp), intent(in) :: tenfold                  !! [s]; 0: they do not
        character(len=:), allocatable :: text
        integer, parameter :: n_digit = 15
        character(len=16) :: figure(2)

        text = ""
        if (.not. tenfold > 0) return
        write (figure, "(g0.2)") [tenfold, n_digit*tenfold]
        text = "unstable motion: errors grow tenfold every "//trim(figure(1))//" s; after some "//trim(figure(2)) &
               //" s nothing is left of double precision"
    end function warn_of_growth

    !> What to tell of a reference that is not to be believed; blank where nothing speaks against it.
    function warn_of_reference(astray) result(text)
        real(wp), intent(in) :: astray(2)                !! see `study_forward`
        character(len=:), allocatable :: text
        character(len=16) :: figure(2)

        text = ""
        if (.not. astray(1) > 0) return
        write (figure, "(es0.1)") astray
        text = "the reference is wrong: rk8pd and gbs agree to "//trim(figure(2))//" and differ from it by "//trim(figure(1)) &
               //"; errors of that size are its own"
    end function warn_of_reference

    pure function setting_of(options) result(text)
        type(forward_options), intent(in) :: options
        character(len=24) :: text

        if (options%integrator%method == method_rk4) then
            text = "step "//to_text(options%integrator%step)//" s"
        else
            text = "tol 1e"//to_text(nint(log10(options%integrator%rtol)))
        end if
    end function setting_of

    !> Errors of lengths relative to the largest length, of angles to the largest angle or 1 rad.
    pure real(wp) function worst_difference(model, q, reference, is_done) result(worst)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: q(:, :), reference(:, :)
        logical, intent(in) :: is_done
        logical :: of_kind(size(q, 1))
        real(wp) :: largest
        integer :: kind, k

        worst = huge(1.0_wp)
        if (.not. is_done) return
        worst = 0
        do kind = 1, 2
            of_kind = model%scene%coordinate%unit == "m" .eqv. kind == 1
            largest = maxval(abs(reference), mask=spread(of_kind, 2, size(q, 2)))
            if (kind == 2) largest = max(largest, 1.0_wp)
            do k = 1, size(q, 1)
                if (of_kind(k)) worst = max(worst, maxval(abs(q(k, :) - reference(k, :)))/max(largest, tiny(1.0_wp)))
            end do
        end do
    end function worst_difference

    !> One run, repeated until its time can be told.
    subroutine run_integrator(model, options, t, q, seconds, n_taken, is_done, status)
        type(model_type), intent(in), target :: model
        type(forward_options), intent(in) :: options
        real(wp), intent(in) :: t(:)
        real(wp), intent(out), target :: q(:, :)
        real(wp), intent(out) :: seconds
        integer, intent(out) :: n_taken
        logical, intent(out) :: is_done
        type(status_type), intent(inout) :: status
        integer :: n_repeat

        q = 0
        seconds = 0
        n_taken = 0
        is_done = .false.
        n_repeat = 0
        do while (seconds < least_seconds)
            call run_once()
            if (.not. status%is_ok()) return
            n_repeat = n_repeat + 1
        end do
        seconds = seconds/n_repeat

    contains

        !> The clock stands while the run is planned.
        subroutine run_once()
            type(forward_run) :: run
            type(forward_results) :: results
            integer(int64) :: start, finish, rate
            integer :: n_good

            call start_forward(model, options, run, status)
            if (status%is_ok()) then
                results%q => q
                call system_clock(start, rate)
                call advance_forward(run, t, results, n_good)
                call system_clock(finish)
                seconds = seconds + real(finish - start, wp)/real(rate, wp)
                n_taken = run%integrator%n_step
                is_done = .not. run%has_stopped
            end if
            call finish_forward(run)
        end subroutine run_once
    end subroutine run_integrator

    !> "for 1e-6 use rk8pd, tol 1e-8: 4.00 ms": the quickest row of an analysis that is good
    !> enough; blank if none is.
    function recommend(row, analysis, target) result(text)
        type(study_row), intent(in) :: row(:)
        character(len=*), intent(in) :: analysis
        real(wp), intent(in) :: target
        character(len=:), allocatable :: text
        character(len=16) :: figure
        integer :: i, best

        best = 0
        do i = 1, size(row)
            if (row(i)%analysis /= analysis .or. row(i)%error > target) cycle
            ! No reactions; for comparison only.
            if (any(row(i)%method == solver_name([solver_reduced, solver_gauss_jordan_plain]))) cycle
            if (best > 0) then
                if (row(i)%seconds >= row(best)%seconds) cycle
            end if
            best = i
        end do
        text = ""
        if (best == 0) return
        text = "for 1e"//to_text(nint(log10(target)))//" use "//trim(row(best)%method)
        if (row(best)%setting /= "") text = text//", "//trim(row(best)%setting)
        if (analysis == "inverse") then
            write (figure, "(g0.3)") 1.0e6_wp*row(best)%seconds
            text = text//": "//trim(figure)//" us a sample"
        else
            write (figure, "(g0.3)") 1.0e3_wp*row(best)%seconds
            text = text//": "//trim(figure)//" ms"
        end if
    end function recommend
end module linkdyn_study
