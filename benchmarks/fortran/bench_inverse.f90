!> Time per pose of every solver on the Stewart scenes, from coordinates to forces, in one run on one thread.
!>
!> Usage: bench_inverse [SCENE ...]; without arguments the examples. Writes one CSV line a scene, solver and want:
!> scene, solver, want, microseconds per pose (best of several passes), flops of the elimination, poses handed to the
!> dense solver. The first line gives the multiply-add peak of this core measured in the same run: these machines are
!> shared, so only ratios within one run mean much. `benchmarks/python/bench_inverse.py` adds the errors.
program bench_inverse
    use, intrinsic :: iso_fortran_env, only: int64, output_unit, error_unit
    use linkdyn_result_kinds, only: result_driving_force, result_reaction
    use linkdyn_builder, only: build_model
    use linkdyn_equation_kernels, only: answer_kernels, need_matrix, need_solving
    use linkdyn_equations, only: equations_type, build_equations, free_equations, solver_elimination
    use linkdyn_inverse, only: inverse_options, inverse_results, inverse_solver, motion_of, prepare_inverse, run_prepared, &
        solver_name, solver_reduced
    use linkdyn_kernel, only: kernel_type, count_of
    use linkdyn_kinds, only: wp, wp_name
    use linkdyn_lane_count, only: lanes
    use linkdyn_model, only: model_type
    use linkdyn_motion, only: evaluate_motion
    use linkdyn_scene, only: scene_type
    use linkdyn_scene_reader, only: read_scene
    use linkdyn_status, only: status_type
    implicit none (type, external)
    integer, parameter :: n_pose = 2048, n_pass = 5
    real(wp), parameter :: least_seconds = 0.05_wp    !! of one pass
    character(len=256) :: file
    integer :: i

    write (output_unit, "(a,f0.1,a,i0,a)") "# kind "//wp_name//", multiply-add peak ", peak_gflops(), " GFlop/s, ", lanes, " lanes"
    write (output_unit, "(a)") "scene,solver,want,us_per_pose,elimination_flops,fallbacks"
    if (command_argument_count() == 0) then
        call measure_scene("examples/stewart_drilling/scene.toml")
        call measure_scene("examples/stewart_tsai/scene.toml")
        call measure_scene("examples/stewart_aris/scene.toml")
    end if
    do i = 1, command_argument_count()
        call get_command_argument(i, file)
        call measure_scene(trim(file))
    end do

contains

    subroutine measure_scene(file)
        character(len=*), intent(in) :: file
        type(scene_type) :: scene
        type(model_type) :: model
        type(status_type) :: status
        integer :: solver, want

        call read_scene(file, scene, status)
        if (status%is_ok()) call build_model(scene, model, status)
        do solver = 1, size(solver_name)
            do want = 1, 2
                if (solver == solver_reduced .and. want == 1) cycle
                if (status%is_ok()) call measure_solver(file, model, solver, want == 1, status)
            end do
        end do
        if (.not. status%is_ok()) then
            write (error_unit, "(a)") trim(status%message)
            error stop 2, quiet=.true.
        end if
    end subroutine measure_scene

    subroutine measure_solver(file, model, solver, wants_reactions, status)
        character(len=*), intent(in) :: file
        type(model_type), intent(in) :: model
        integer, intent(in) :: solver
        logical, intent(in) :: wants_reactions
        type(status_type), intent(inout) :: status
        type(inverse_solver) :: planned
        type(inverse_results) :: results
        real(wp), allocatable :: t(:), q(:, :), qd(:, :), qdd(:, :), load(:, :, :)
        real(wp), allocatable, target :: driving_force(:, :), reaction(:, :, :)
        real(wp) :: best
        integer :: i, n_repeat, flops

        call prepare_inverse(model, inverse_options(solver=solver), wants_reactions, planned, status)
        if (.not. status%is_ok()) return
        allocate (t(n_pose), q(model%n_q, n_pose), qd(model%n_q, n_pose), qdd(model%n_q, n_pose), &
                  load(6, model%n_load, n_pose), driving_force(model%n_actuator, n_pose), &
                  reaction(model%n_component, model%n_joint, n_pose))
        t = [(model%scene%time%first + (i - 1)*(model%scene%time%last - model%scene%time%first)/(n_pose - 1), i=1, n_pose)]
        call evaluate_motion(model, t, q, qd, qdd, load)
        call results%put(result_driving_force, driving_force)
        if (wants_reactions) call results%put(result_reaction, reaction)

        n_repeat = 1
        do while (seconds_of(model, planned, q, qd, qdd, load, results, n_repeat) < least_seconds)
            n_repeat = 2*n_repeat
        end do
        best = huge(1.0_wp)
        do i = 1, n_pass
            best = min(best, seconds_of(model, planned, q, qd, qdd, load, results, n_repeat)/n_repeat)
        end do
        flops = 0
        if (solver == solver_elimination) flops = elimination_flops(model, wants_reactions)
        write (output_unit, "(a,',',a,',',a,',',f0.4,',',i0,',',i0)") file, trim(solver_name(solver)), &
            trim(merge("all          ", "driving_force", wants_reactions)), 1.0e6_wp*best/n_pose, flops, results%roads%dense
        call planned%free()
    end subroutine measure_solver

    !> Flops of the elimination alone: of the kernel that writes the equations down and solves them, less those of the one that
    !> writes them down.
    integer function elimination_flops(model, wants_reactions) result(n)
        type(model_type), intent(in) :: model
        logical, intent(in) :: wants_reactions
        type(equations_type) :: equations
        type(answer_kernels), pointer :: answers
        type(status_type) :: status

        call build_equations(model, solver_elimination, wants_reactions, equations, status)
        call need_matrix(model, equations%kernels)
        call need_solving(model, [integer ::], equations%kernels, answers)
        n = flops_of(answers%solving%program%kernel) - flops_of(equations%kernels%matrix%program%kernel)
        call free_equations(equations)
    end function elimination_flops

    !> A product with a sum counts as two.
    integer function flops_of(kernel) result(n)
        type(kernel_type), intent(in) :: kernel

        n = count_of(kernel, "") + count_of(kernel, "multiply_add") + count_of(kernel, "multiply_subtract") &
            + count_of(kernel, "subtract_product")
    end function flops_of

    !> Wall time of some passes over the batch.
    real(wp) function seconds_of(model, planned, q, qd, qdd, load, results, n_repeat)
        type(model_type), intent(in) :: model
        type(inverse_solver), intent(in) :: planned
        real(wp), intent(in), contiguous, target :: q(:, :), qd(:, :), qdd(:, :), load(:, :, :)
        type(inverse_results), intent(inout) :: results
        integer, intent(in) :: n_repeat
        integer(int64) :: start, finish, rate
        integer :: k

        call system_clock(start, rate)
        do k = 1, n_repeat
            call run_prepared(model, planned, 1, motion_of(q, qd, qdd, load), results)
        end do
        call system_clock(finish)
        seconds_of = real(finish - start, wp)/real(rate, wp)
    end function seconds_of

    !> Multiply-add peak of one core as this compiler reaches it: independent chains that stay in registers.
    real(wp) function peak_gflops()
        integer, parameter :: n_chain = 12, n_step = 2000000
        real(wp) :: chain(8, n_chain), factor(8)
        integer(int64) :: start, finish, rate
        integer :: i, k

        chain = 1
        factor = 1 + epsilon(1.0_wp)
        call system_clock(start, rate)
        do i = 1, n_step
            do k = 1, n_chain
                chain(:, k) = chain(:, k)*factor + factor
            end do
        end do
        call system_clock(finish)
        peak_gflops = 2.0e-9_wp*n_step*size(chain)*real(rate, wp)/real(finish - start, wp)
        if (sum(chain) < 0) write (error_unit, "(a)") "the chains must not be optimized away"
    end function peak_gflops
end program bench_inverse
