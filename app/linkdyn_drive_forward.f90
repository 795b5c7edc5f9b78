!> `linkdyn forward`: integrate from the scene's start, writing chunk by chunk.
module linkdyn_drive_forward
    use, intrinsic :: iso_fortran_env, only: int64
    use linkdyn_cli, only: command_line
    use linkdyn_clock, only: seconds_since
    use linkdyn_load_model, only: load_model
    use linkdyn_event_sides, only: sort_by_events
    use linkdyn_event_words, only: event_in_words
    use linkdyn_interrupt, only: watch_interrupts, interrupt_noted
    use linkdyn_forward, only: forward_options, forward_run, coordinates_in_words, tolerance_in_words, &
        rounding_in_words, method_name
    use linkdyn_kinds, only: wp
    use linkdyn_model, only: model_type
    use linkdyn_results, only: block_type, prepare_block, refuse_absent
    use linkdyn_roads, only: road_counts
    use linkdyn_run_output, only: output_type, open_results, put_results, note_result, note_roads, note_assembly, &
        note_events, close_results, exit_done, exit_bad_input, exit_samples_failed
    use linkdyn_scene, only: n_event
    use linkdyn_status, only: status_type, fail, status_bad_input
    use linkdyn_summary, only: summary_type, start_summary, add_to_summary, add_events_to_summary
    use linkdyn_summary_text, only: print_summary, failure_text
    use linkdyn_terminal, only: show_stage, show_share, say
    use linkdyn_text, only: to_text
    use linkdyn_forward_errors, only: watched_run, start_watched, advance_watched, interrupt_watched, finish_watched, &
        time_reached
    implicit none (type, external)
    private
    public :: drive_forward

    integer, parameter :: block_length = 256         !! samples integrated and written at a time, at most
    real(wp), parameter :: breath = 0.25_wp          !! seconds between two looks at interrupts and progress
    integer, parameter :: exit_of_signal = 128       !! plus its number, as shells have it

    !> Evenly spaced instants of output.
    type :: instants_type
        real(wp) :: first = 0, last = 0              !! [s]
        integer :: n = 0
    end type instants_type

contains

    !> Run and report; the exit status says how it went.
    subroutine drive_forward(config, unit, exit_status)
        type(command_line), intent(in) :: config
        integer, intent(in) :: unit                  !! for the summary
        integer, intent(out) :: exit_status
        type(model_type), target :: model
        type(watched_run), target :: watched
        type(output_type) :: output
        type(summary_type) :: summary
        type(status_type) :: status
        type(instants_type) :: instants
        real(wp) :: seconds

        exit_status = exit_bad_input
        call load_model(config%scene, .false., model, status)
        if (status%is_ok() .and. allocated(config%want)) call refuse_absent(config%want, model%scene, status)
        if (status%is_ok()) call choose_times(config, model, instants, status)
        if (status%is_ok()) call start_watched(model, options_of(config, instants%first, instants%last), config%wanted, watched, &
                                               status)
        if (status%is_ok()) then
            call open_results(config, model, watched%layout, instants%n, output, status, may_end_early=.true.)
        else if (index(status%message, config%scene//":") /= 1) then
            status%message = config%scene//": "//trim(status%message)
        end if
        if (status%is_ok()) call run_blocks(watched, instants, output, summary, seconds, status)
        if (.not. status%is_ok()) then
            call finish_watched(watched)
            call say(status%message)
            return
        end if
        if (.not. config%quiet) then
            call print_summary(model, watched%layout, summary, config%solver, config%options%threads, seconds, &
                               output%name, unit, watched%run%system%way%log)
            call print_statistics(watched%run, unit)
        end if
        exit_status = exit_done
        if (watched%run%has_stopped) then
            call say(trim(config%scene)//": "//trim(watched%run%reason))
        else if (summary%failure%n > 0) then
            call say(trim(config%scene)//": failed samples: "//failure_text(summary))
        end if
        if (summary%failure%n > 0 .or. (watched%run%has_stopped .and. .not. watched%run%is_over)) exit_status = exit_samples_failed
        if (interrupt_noted() > 0) exit_status = exit_of_signal + interrupt_noted()
        call finish_watched(watched)
    end subroutine drive_forward

    function options_of(config, t_start, t_end) result(options)
        type(command_line), intent(in) :: config
        real(wp), intent(in) :: t_start, t_end        !! [s]
        type(forward_options) :: options

        options%integrator = config%integrator
        options%integrator%span = t_end - t_start
        options%t_start = t_start
        options%solver = config%options%solver
        options%wants_reactions = config%wanted%reaction
        options%wants_rcond = config%wanted%rcond
        options%switches = config%switches
        options%threads = config%options%threads
        options%sees_events = .true.
    end function options_of

    !> Instants of output: the scene's, unless the command says otherwise.
    subroutine choose_times(config, model, instants, status)
        type(command_line), intent(in) :: config
        type(model_type), intent(in) :: model
        type(instants_type), intent(out) :: instants
        type(status_type), intent(inout) :: status
        integer, parameter :: usual_n_sample = 201
        real(wp) :: first, last
        integer :: n

        first = model%scene%time%first
        last = merge(config%until, model%scene%time%last, config%has_until)
        n = merge(config%n_sample, model%scene%time%n_sample, config%n_sample > 0)
        if (n < 2 .and. config%n_sample == 0) n = usual_n_sample
        if (.not. (last > first .and. last <= huge(last))) then
            call fail(status, status_bad_input, trim(config%scene)//": a run from "//to_text(first)//" s to " &
                      //to_text(last)//" s has no duration (expected [time] end, or --until)")
            return
        end if
        instants = instants_type(first, last, n)
    end subroutine choose_times

    !> Some of the instants.
    pure function times_of(instants, from, n) result(t)
        type(instants_type), intent(in) :: instants
        integer, intent(in) :: from, n               !! number of the first one, from 1, and how many
        real(wp) :: t(n)                             !! [s]
        integer :: i

        t = [(instants%first + (instants%last - instants%first)*(real(i - 1, wp)/max(1, instants%n - 1)), i=from, from + n - 1)]
        if (from + n - 1 == instants%n) t(n) = instants%last
    end function times_of

    !> Block by block to the last output instant, or to where the run ends or is interrupted.
    subroutine run_blocks(watched, instants, output, summary, seconds, status)
        type(watched_run), intent(inout), target :: watched
        type(instants_type), intent(in) :: instants
        type(output_type), intent(inout) :: output
        type(summary_type), intent(out) :: summary
        real(wp), intent(out) :: seconds              !! spent computing
        type(status_type), intent(inout) :: status
        type(block_type) :: block
        integer(int64) :: start, run_start
        type(road_counts) :: roads
        integer :: first, n, n_done

        call prepare_block(watched%layout, min(block_length, instants%n), block)
        call start_summary(watched%layout, summary)
        call system_clock(run_start)
        seconds = 0
        first = 1
        call watch_interrupts()
        do while (first <= instants%n)
            if (watched%run%is_over .and. watched%n_pending == 0) exit
            n = min(block_length, instants%n - first + 1)
            call system_clock(start)
            call advance_watched(watched, times_of(instants, first, n), block, roads, n_done, breath)
            seconds = seconds + seconds_since(start)
            if (n_done > 0) call put_results(watched%layout, block, first, n_done, output, status)
            if (.not. status%is_ok()) exit
            call add_to_summary(watched%layout, block, n_done, roads, watched%run%n_passed, summary)
            first = first + n_done
            call show_share((time_reached(watched) - instants%first)/(instants%last - instants%first), run_start)
            if (interrupt_noted() == 0 .or. first > instants%n) cycle
            call interrupt_watched(watched)
            exit
        end do
        call show_stage("writing")
        call note_run(watched%run, output, status)
        if (watched%run%system%way%log%n > 0) call tell_events(watched, output, summary, status)
        call note_roads(summary%roads, output, status)
        call note_assembly(watched%layout, summary, output, status)
        call close_results(output, status)
    end subroutine run_blocks

    !> What has happened, with what stands beside it, which is no sample, but may be the largest.
    subroutine tell_events(watched, output, summary, status)
        type(watched_run), intent(in) :: watched
        type(output_type), intent(inout) :: output
        type(summary_type), intent(inout) :: summary
        type(status_type), intent(inout) :: status
        type(block_type) :: block

        associate (log => watched%run%system%way%log, sides => watched%sides)
            call sort_by_events(sides, log%entry(:log%n)%beside, block)
            call note_events(watched%run%own%scene, log, sides%layout, block, output, status)
            if (allocated(block%of)) call add_events_to_summary(sides%layout, block, log%entry(:log%n)%t, summary)
        end associate
    end subroutine tell_events

    !> How the run went, for the file.
    subroutine note_run(run, output, status)
        type(forward_run), intent(in) :: run
        type(output_type), intent(inout) :: output
        type(status_type), intent(inout) :: status

        associate (i => run%integrator)
            call note_result("method", trim(method_name(i%options%method)), output, status)
            call note_result("steps", i%n_step, output, status)
            call note_result("rejected_steps", i%n_rejected, output, status)
            call note_result("right_hand_sides", i%n_evaluation, output, status)
            call note_result("tolerance", tolerance_in_words(run), output, status)
            call note_result("rounding", rounding_in_words(run), output, status)
            call note_result("stopped", trim(run%reason), output, status)
            call note_result("coordinates_integrated", coordinates_in_words(run), output, status)
        end associate
    end subroutine note_run

    !> How the integrator fared.
    subroutine print_statistics(run, unit)
        type(forward_run), intent(in) :: run
        integer, intent(in) :: unit

        associate (i => run%integrator)
            write (unit, "(a)") "  integrator       "//trim(method_name(i%options%method))//", "//to_text(i%n_step) &
                //" steps, "//to_text(i%n_rejected)//" rejected, "//to_text(i%n_evaluation)//" right-hand sides"
            if (len(tolerance_in_words(run)) > 0) write (unit, "(a)") "  tolerance        "//tolerance_in_words(run)
            if (i%n_step > 0) write (unit, "(a)") "  steps            "//to_text(i%shortest_step)//" to " &
                //to_text(i%longest_step)//" s"
        end associate
        call print_events(run, unit)
        if (len(rounding_in_words(run)) > 0) write (unit, "(a)") "  rounding         "//rounding_in_words(run)
        if (len(coordinates_in_words(run)) > 0) write (unit, "(a)") "  coordinates      "//coordinates_in_words(run)
    end subroutine print_statistics

    !> What has happened: the first events one by one, then how many of each there were.
    subroutine print_events(run, unit)
        type(forward_run), intent(in) :: run
        integer, intent(in) :: unit
        integer, parameter :: most = 12
        integer :: i

        if (n_event(run%own%scene) == 0) return
        associate (log => run%system%way%log)
            if (log%n == 0) write (unit, "(a)") "  events           none"
            do i = 1, min(log%n, most)
                write (unit, "(a)") merge("  events           ", repeat(" ", 19), i == 1)// &
                    event_in_words(run%own, log%entry(i))
            end do
            if (log%n > most) write (unit, "(a)") "                   ... "//to_text(log%n)//" in all"
        end associate
    end subroutine print_events
end module linkdyn_drive_forward
