!> Forward runs against motions that are known: the scene's own, driven by what inverse dynamics asks for.
module test_forward
    use linkdyn_result_kinds, only: result_closure, result_kinetic_energy, result_potential_energy, result_power_imbalance
    use linkdyn_builder, only: build_model
    use linkdyn_ensemble, only: run_ensemble
    use linkdyn_forward, only: forward_options, forward_results, forward_run, integrator_options, &
        method_rk4, method_rkf45, method_rk8pd, method_msbdf, method_gbs, method_seulex, method_name
    use linkdyn_kinds, only: wp
    use linkdyn_model, only: model_type
    use linkdyn_motion, only: evaluate_motion
    use linkdyn_ode_gsl, only: has_gsl
    use linkdyn_scene, only: scene_type, effort_constant
    use linkdyn_scene_reader, only: read_scene
    use linkdyn_status, only: status_type, status_bad_input
    use linkdyn_testing, only: test_error, unit_test, new_test, check, check_close
    use linkdyn_whole_run, only: run_forward
    implicit none (type, external)
    private
    public :: collect_forward

    real(wp), parameter :: t_end = 0.5_wp

contains

    subroutine collect_forward(tests)
        type(unit_test), allocatable, intent(out) :: tests(:)

        tests = [ &
            new_test("rk4 has order 4", test_order), &
            new_test("adaptive methods keep their tolerance", test_adaptive), &
            new_test("energy and work in balance", test_energy), &
            new_test("an ensemble is many single runs", test_ensemble), &
            new_test("a run that leaves the workspace stops", test_stop), &
            new_test("options that cannot work", test_refusals)]
    end subroutine collect_forward

    subroutine make_model(model, error)
        type(model_type), intent(out) :: model
        type(test_error), intent(inout) :: error
        type(scene_type) :: scene
        type(status_type) :: status

        call read_scene("examples/stewart_tsai/scene.toml", scene, status)
        if (status%is_ok()) call build_model(scene, model, status)
        call check(error, status%is_ok(), trim(status%message))
    end subroutine make_model

    !> Largest error of the coordinates at the end, against the scene's motion.
    subroutine measure_error(model, options, gap, error)
        type(model_type), intent(in) :: model
        type(integrator_options), intent(in) :: options
        real(wp), intent(out) :: gap
        type(test_error), intent(inout) :: error
        type(forward_results) :: results
        type(forward_run) :: run
        type(status_type) :: status
        real(wp), target :: q(model%n_q, 1)
        real(wp) :: want(model%n_q, 1), qd(model%n_q, 1), qdd(model%n_q, 1), load(6, model%n_load, 1)

        results%q => q
        call run_forward(model, forward_options(integrator=options, wants_reactions=.false.), [t_end], results, run, status)
        call check(error, status%is_ok(), trim(status%message))
        call check(error, .not. run%has_stopped, trim(run%reason))
        call evaluate_motion(model, [t_end], want, qd, qdd, load)
        gap = maxval(abs(q - want))
    end subroutine measure_error

    subroutine test_order(error)
        type(test_error), intent(inout) :: error
        type(model_type) :: model
        real(wp) :: gap(3), order
        integer :: i
        character(len=80) :: text

        call make_model(model, error)
        if (allocated(error%message)) return
        do i = 1, 3
            call measure_error(model, integrator_options(method=method_rk4, step=0.02_wp/2**i), gap(i), error)
        end do
        order = log(gap(2)/gap(3))/log(2.0_wp)
        write (text, "(a, f6.3, a, 3es10.2)") "order ", order, ", errors ", gap
        ! The next term of the error, a factor h smaller, is still felt at these steps.
        call check(error, abs(order - 4) < 0.15_wp .and. gap(3) < 1.0e-6_wp, trim(text))
    end subroutine test_order

    subroutine test_adaptive(error)
        type(test_error), intent(inout) :: error
        integer, parameter :: method(5) = [method_rkf45, method_rk8pd, method_gbs, method_seulex, method_msbdf]
        ! Errors of single steps add up over the run and grow with the motion itself, by a factor of some tens here; the
        ! multistep method controls its error less tightly.
        real(wp), parameter :: allowance(5) = [1.0e2_wp, 1.0e2_wp, 1.0e2_wp, 1.0e2_wp, 1.0e4_wp]
        real(wp), parameter :: tolerance = 1.0e-9_wp
        type(model_type) :: model
        real(wp) :: gap
        character(len=80) :: text
        integer :: i

        call make_model(model, error)
        if (allocated(error%message)) return
        do i = 1, size(method)
            if (.not. (has_gsl .or. any(method(i) == [method_gbs, method_seulex]))) cycle
            call measure_error(model, integrator_options(method=method(i), rtol=tolerance, atol=tolerance), gap, error)
            write (text, "(2a, es10.2)") trim(method_name(method(i))), ": error ", gap
            call check(error, gap <= allowance(i)*tolerance, trim(text))
        end do
    end subroutine test_adaptive

    !> A platform let go with constant forces: kinetic and potential energy change by the work done.
    subroutine test_energy(error)
        type(test_error), intent(inout) :: error
        integer, parameter :: n = 5
        type(model_type) :: model
        type(forward_results) :: results
        type(forward_run) :: run
        type(status_type) :: status
        real(wp), dimension(n), target :: kinetic, potential, work, gap, imbalance
        real(wp) :: total(n), zero(n)

        call make_model(model, error)
        if (allocated(error%message)) return
        model%scene%actuator%law%kind = effort_constant
        model%scene%actuator%law%value(1) = [3.0_wp, 4.0_wp, 5.0_wp, 3.0_wp, 4.0_wp, 5.0_wp]
        results%work => work
        call results%forces%put(result_kinetic_energy, kinetic)
        call results%forces%put(result_potential_energy, potential)
        call results%forces%put(result_closure, gap)
        call results%forces%put(result_power_imbalance, imbalance)
        call run_forward(model, forward_options(integrator=integrator_options(method=method_rk4, step=5.0e-4_wp)), &
                         [0.0_wp, 0.05_wp, 0.1_wp, 0.15_wp, 0.2_wp], results, run, status)
        call check(error, status%is_ok() .and. .not. run%has_stopped, trim(status%message)//trim(run%reason))
        total = kinetic + potential - work
        zero = 0
        call check(error, maxval(kinetic) > 0.1_wp, "the platform moves")
        ! Four hundred steps of error h**5 each; the energies are of order ten.
        call check_close(error, total - total(1), zero, 1.0e-9_wp, "energy less work [J]")
        call check_close(error, gap, zero, 16*epsilon(1.0_wp), "closure")
        call check_close(error, imbalance, zero, 1.0e4_wp*epsilon(1.0_wp), "power imbalance")
    end subroutine test_energy

    subroutine test_ensemble(error)
        type(test_error), intent(inout) :: error
        integer, parameter :: n_member = 19, n = 2
        type(model_type) :: model
        type(forward_options) :: options
        type(forward_results) :: results
        type(forward_run) :: run
        type(status_type) :: status
        real(wp), dimension(6, n_member) :: q_start, qd_start
        real(wp), dimension(6, n, n_member) :: q, qd
        real(wp), target :: q_single(6, n)
        real(wp) :: q0(6, 1), qd0(6, 1), qdd0(6, 1), load(6, 1, 1), good_until(n_member)
        integer :: n_crossed(n_member), outcome(n_member)
        integer :: i

        call make_model(model, error)
        if (allocated(error%message)) return
        model%scene%actuator%law%kind = effort_constant     ! the law of a motion would refuse a start off it
        call evaluate_motion(model, [0.0_wp], q0, qd0, qdd0, load(:, :model%n_load, :))
        do i = 1, n_member
            q_start(:, i) = q0(:, 1) + 1.0e-3_wp*i
            qd_start(:, i) = qd0(:, 1)
        end do
        options%integrator = integrator_options(method=method_rk4, step=0.01_wp)
        options%threads = 2
        call run_ensemble(model, options, q_start, qd_start, [0.1_wp, 0.2_wp], q, qd, good_until, n_crossed, outcome, status)
        call check(error, status%is_ok(), trim(status%message))
        call check(error, all(good_until == 0.2_wp) .and. all(outcome == 0), "all members arrive")
        i = n_member - 1
        model%scene%coordinate%has_start = .true.
        model%scene%coordinate%start_position = q_start(:, i)
        model%scene%coordinate%start_velocity = qd_start(:, i)
        results%q => q_single
        call run_forward(model, options, [0.1_wp, 0.2_wp], results, run, status)
        call check(error, status%is_ok(), trim(status%message))
        call check_close(error, q_single, q(:, :, i), 64*epsilon(1.0_wp), "the same motion")
    end subroutine test_ensemble

    !> Forces that throw the platform out of reach or up in speed without bound.
    subroutine test_stop(error)
        type(test_error), intent(inout) :: error
        type(model_type) :: model
        type(forward_results) :: results
        type(forward_run) :: run
        type(status_type) :: status
        real(wp), target :: q(6, 3)

        call make_model(model, error)
        if (allocated(error%message)) return
        model%scene%actuator%law%kind = effort_constant
        model%scene%actuator%law%value(1) = 1.0e200_wp
        results%q => q
        call run_forward(model, forward_options(integrator=integrator_options(method=method_rk4, step=0.01_wp)), &
                         [0.0_wp, 1.0_wp, 2.0_wp], results, run, status)
        call check(error, status%is_ok(), trim(status%message))
        call check(error, run%has_stopped .and. run%good_until < 1.0_wp, "stopped")
        call check(error, index(run%reason, "stopped at t = ") == 1, trim(run%reason))
        call check(error, all(q(:, 1) == q(:, 1)) .and. all(q(:, 2:) /= q(:, 2:)), "good samples kept, the rest NaN")
    end subroutine test_stop

    subroutine test_refusals(error)
        type(test_error), intent(inout) :: error
        type(model_type) :: model
        real(wp) :: nan

        call make_model(model, error)
        if (allocated(error%message)) return
        nan = 0
        nan = nan/nan
        call refuse(integrator_options(step=0.0_wp), "step = 0")
        call refuse(integrator_options(step=nan), "step = NaN")
        call refuse(integrator_options(rtol=0.0_wp), "rtol = 0")
        call refuse(integrator_options(atol=-1.0_wp), "atol = -1")

    contains

        subroutine refuse(options, start)
            type(integrator_options), intent(in) :: options
            character(len=*), intent(in) :: start
            type(forward_results) :: results
            type(forward_run) :: run
            type(status_type) :: status

            call run_forward(model, forward_options(integrator=options), [1.0_wp], results, run, status)
            call check(error, status%code == status_bad_input .and. index(status%message, start) == 1, trim(status%message))
        end subroutine refuse
    end subroutine test_refusals
end module test_forward
