!> Rate of sweeps against the bare rate of inverse dynamics, in one run, and with threads.
!>
!> Usage: bench_sweep [SCENE ...]; without arguments the drilling table and Tsai's platform. A table [sweep] over all
!> coordinates and one rate is appended to the scene. Writes one CSV line a scene and kind of sweep: scene, what is reduced,
!> threads, microseconds a sample (best of several passes), the same of bare inverse dynamics with as many results
!> on one thread, their ratio. Machines are shared: only the ratios mean much.
program bench_sweep
    use, intrinsic :: iso_fortran_env, only: int64, output_unit, error_unit
    use linkdyn_result_kinds, only: result_driving_force, result_reaction
    use linkdyn_builder, only: build_model
    use linkdyn_input, only: read_file_text, folder_of
    use linkdyn_inverse, only: inverse_options, inverse_results, inverse_solver, motion_of, prepare_inverse, run_prepared, &
        solver_elimination
    use linkdyn_kinds, only: wp, wp_name
    use linkdyn_lane_count, only: lanes
    use linkdyn_model, only: model_type
    use linkdyn_motion, only: evaluate_motion
    use linkdyn_scene, only: scene_type
    use linkdyn_scene_reader, only: parse_scene
    use linkdyn_scene_variant, only: variants_of
    use linkdyn_status, only: status_type
    use linkdyn_sweep, only: sweep_run, start_sweep, compute_chunks, finish_sweep
    use linkdyn_sweep_chunk, only: kept_chunk
    use linkdyn_sweep_totals, only: totals_type
    implicit none (type, external)
    integer, parameter :: n_pose = 2048, n_pass = 25
    character(len=*), parameter :: kind(6) = [character(len=40) :: "extremes of driving forces", "extremes of all forces", &
        "driving forces with means and histograms", "all forces with means", "amplification and condition", "strokes alone"]
    logical, parameter :: has_reactions(6) = [.false., .true., .false., .true., .false., .false.]
    character(len=*), parameter :: wish(6) = [character(len=160) :: &
        'moments = false'//new_line("a")//'reduce = ["driving_force"]', &
        'moments = false'//new_line("a")//'reduce = ["driving_force", "reaction", "reaction_force"]', &
        'histogram = { driving_force = true }'//new_line("a")//'reduce = ["driving_force"]', &
        'reduce = ["driving_force", "reaction", "reaction_force", "reaction_moment"]', &
        'moments = false'//new_line("a")//'reduce = ["driving_force", "force_amplification", "condition", "determinant"]', &
        'moments = false'//new_line("a")//'reduce = ["driving_position"]']
    character(len=256) :: file
    integer :: i

    write (output_unit, "(a, i0, a)") "# kind "//wp_name//", ", lanes, " lanes"
    write (output_unit, "(a)") "scene,reduced,threads,us_per_sample,us_bare,ratio"
    if (command_argument_count() == 0) then
        call measure_scene("examples/stewart_drilling/scene.toml")
        call measure_scene("examples/stewart_tsai/scene.toml")
    end if
    do i = 1, command_argument_count()
        call get_command_argument(i, file)
        call measure_scene(trim(file))
    end do

contains

    subroutine measure_scene(file)
        character(len=*), intent(in) :: file
        type(scene_type) :: scene, swept
        type(status_type) :: status
        character(len=:), allocatable :: text
        real(wp) :: bare(2)
        integer :: k, threads

        call read_file_text(file, file, text, status)
        if (status%is_ok()) call parse_scene(text, file, folder_of(file), scene, status)
        if (status%is_ok()) then
            bare = [seconds_bare(scene, .false.), seconds_bare(scene, .true.)]
            do k = 1, size(kind)
                call parse_scene(text//new_line("a")//sweep_table(scene, trim(wish(k))), file, folder_of(file), swept, status)
                if (.not. status%is_ok()) exit
                do threads = 1, 2
                    call measure_sweep(swept, trim(kind(k)), threads, bare(merge(2, 1, has_reactions(k))), status)
                end do
            end do
        end if
        if (.not. status%is_ok()) then
            write (error_unit, "(a)") trim(status%message)
            error stop 2, quiet=.true.
        end if
    end subroutine measure_scene

    !> All coordinates about their start, and one rate.
    function sweep_table(scene, wishes) result(text)
        type(scene_type), intent(in) :: scene
        character(len=*), intent(in) :: wishes
        character(len=:), allocatable :: text
        character(len=128) :: line
        integer :: i

        ! As long as the bare batch: short pieces find quiet moments on a machine that others use, too.
        text = "[sweep]"//new_line("a")//"chunk = 2048"//new_line("a")//wishes//new_line("a")
        if (size(scene%link(1)%marker) > 0) &
            text = text//'on = "'//trim(scene%link(1)%name)//"."//trim(scene%link(1)%marker(1)%name)//'"'//new_line("a")
        do i = 1, size(scene%coordinate)
            associate (c => scene%coordinate(i))
                write (line, "(3a, 2(es24.16, a))") 'coordinate = "', trim(c%name), '"'//new_line("a")//"linspace = [", &
                    c%start_position - 0.05_wp, ", ", c%start_position + 0.05_wp, ", 9]"
                text = text//"[[sweep.axis]]"//new_line("a")//trim(line)//new_line("a")
            end associate
        end do
        text = text//"[[sweep.axis]]"//new_line("a")//'rate = "'//trim(scene%coordinate(1)%name)//'"'//new_line("a")// &
            "values = [-0.1, 0.1]"//new_line("a")
    end function sweep_table

    !> Of a sample of a batch that lies in the cache.
    real(wp) function seconds_bare(scene, wants_reactions) result(best)
        type(scene_type), intent(in) :: scene
        logical, intent(in) :: wants_reactions
        type(model_type) :: model
        type(status_type) :: status
        type(inverse_solver) :: planned
        type(inverse_results) :: results
        real(wp), allocatable :: t(:)
        real(wp), allocatable, target :: q(:, :), qd(:, :), qdd(:, :), load(:, :, :)
        real(wp), allocatable, target :: driving_force(:, :), reaction(:, :, :)
        integer(int64) :: start, finish, rate
        integer :: i, k

        call build_model(scene, model, status)
        if (status%is_ok()) call prepare_inverse(model, inverse_options(), wants_reactions, planned, status)
        allocate (t(n_pose), q(model%n_q, n_pose), qd(model%n_q, n_pose), qdd(model%n_q, n_pose), &
                  load(6, model%n_load, n_pose), driving_force(model%n_actuator, n_pose), &
                  reaction(model%n_component, model%n_joint, n_pose))
        t = [(model%scene%time%first + (i - 1)*(model%scene%time%last - model%scene%time%first)/(n_pose - 1), i=1, n_pose)]
        call evaluate_motion(model, t, q, qd, qdd, load)
        call results%put(result_driving_force, driving_force)
        if (wants_reactions) call results%put(result_reaction, reaction)
        best = huge(1.0_wp)
        do k = 1, 8*n_pass
            call system_clock(start, rate)
            call run_prepared(model, planned, 1, motion_of(q, qd, qdd, load), results)
            call system_clock(finish)
            best = min(best, real(finish - start, wp)/real(rate, wp)/n_pose)
        end do
        call planned%free()
    end function seconds_bare

    subroutine measure_sweep(scene, what, threads, bare, status)
        type(scene_type), intent(in) :: scene
        character(len=*), intent(in) :: what
        integer, intent(in) :: threads
        real(wp), intent(in) :: bare                 !! seconds
        type(status_type), intent(inout) :: status
        type(sweep_run) :: run
        type(totals_type), allocatable :: part(:)
        type(kept_chunk), allocatable :: kept(:)
        integer(int64) :: start, finish, rate
        real(wp) :: best
        integer :: k

        call start_sweep(scene, variants_of(scene, folder_of(trim(scene%file))), solver_elimination, run, status)
        if (.not. status%is_ok()) return
        allocate (part(threads), kept(threads))
        best = huge(1.0_wp)
        do k = 1, 8*n_pass
            call system_clock(start, rate)
            call compute_chunks(run, 0_int64, 1_int64, threads, part, kept)
            call system_clock(finish)
            best = min(best, real(finish - start, wp)/real(rate, wp)/real(sum(part%n_sample), wp))
        end do
        write (output_unit, "(3a, i0, 3(a, f0.4))") trim(scene%file), ",", what//",", threads, ",", 1.0e6_wp*best, ",", &
            1.0e6_wp*bare, ",", best/bare
        call finish_sweep(run)
    end subroutine measure_sweep
end program bench_sweep
