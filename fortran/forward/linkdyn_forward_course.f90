!> The course of a forward run: from kink to kink of its laws, which are hit exactly, and from phase to phase.
!>
!> Where a coordinate comes to its dead point, another joint variable is integrated in its place: the run goes on in another phase.
module linkdyn_forward_course
    use linkdyn_builder, only: build_model
    use linkdyn_coordinate_watch, only: dead_coordinate
    use linkdyn_exchange, only: list_choices, exchange_scene, number_iterated
    use linkdyn_forward_kinks, only: collect_kinks, next_kink, pass_kink, is_there_by
    use linkdyn_forward_phase, only: forward_options, phase_box, enter_phase
    use linkdyn_forward_run, only: forward_run
    use linkdyn_forward_words, only: tell_stop
    use linkdyn_integrator, only: stop_event, stop_length
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_lock, only: hold_texts, release_texts
    use linkdyn_model, only: model_type
    use linkdyn_scene, only: scene_type
    use linkdyn_status, only: status_type
    use linkdyn_stop_starts, only: begin_at_stops
    implicit none (type, external)
    private
    public :: start_integrator, go_to

contains

    subroutine start_integrator(run, model, options, status)
        type(forward_run), intent(inout) :: run
        type(model_type), intent(in) :: model
        type(forward_options), intent(in) :: options
        type(status_type), intent(inout) :: status

        call collect_kinks(model, options%t_start, options%t_start + options%integrator%span, run%kinks)
        run%output = run%y
        call begin_at_stops(run%system, options%t_start, run%y)
        call run%system%begin_with_clutches(options%t_start, run%y)
        call run%integrator%start(options%integrator, run%system, options%t_start, run%y, status)
        where (run%system%way%is_driven_through) run%integrator%failed = .true.
    end subroutine start_integrator

    !> Integrate to t, stopping at every kink on the way. The run comes back before its phase changes if it `wants_outputs`: call
    !> again. Who witnesses events looks at the run meanwhile.
    subroutine go_to(run, t)
        type(forward_run), intent(inout), target :: run
        real(wp), intent(in) :: t

        character(len=:), allocatable :: reason
        real(wp) :: kink

        do
            kink = next_kink(run%kinks, run%system)
            if (.not. is_there_by(kink, t) .or. all(run%integrator%failed)) exit
            call advance_to(run, kink)
            if (run%integrator%is_paused .or. run%wants_outputs) return
            call pass_kink(run%kinks, run%system, run%integrator, run%y, kink)
        end do
        call advance_to(run, max(t, run%kinks%passed))
        if (run%wants_outputs) return
        run%good_until = run%integrator%good_until(1)
        run%has_stopped = run%integrator%failed(1)
        if (.not. run%has_stopped) return
        run%is_over = run%integrator%reason == stop_event .and. .not. run%system%way%is_driven_through(1)
        call hold_texts()
        call tell_stop(run, reason, run%beyond)
        run%reason = reason
        call release_texts()
    end subroutine go_to

    !> Integrate to t, from phase to phase. A run that cannot go on tries other coordinates, too.
    subroutine advance_to(run, t)
        type(forward_run), intent(inout), target :: run
        real(wp), intent(in) :: t
        real(wp) :: kink

        do
            ! Instants behind the last step are looked at before anything changes.
            if ((run%integrator%t > t .or. (run%integrator%t >= t .and. run%system%n_guard > 0)) &
                .and. .not. all(run%integrator%failed)) then
                continue
            else if (all(run%integrator%failed) .and. run%integrator%reason == stop_event) then
                exit
            else if (run%system%wants_rest .or. all(run%integrator%failed)) then
                run%wants_outputs = run%outputs_wait
                if (run%wants_outputs) return
                call change_phase(run)
            end if
            if (all(run%integrator%failed)) exit
            kink = next_kink(run%kinks, run%system)
            if (kink < huge(kink)) then
                call run%integrator%advance(run%system, t, run%y, run%output, max(t, kink))
            else
                call run%integrator%advance(run%system, t, run%y, run%output)
            end if
            if (run%integrator%is_paused .or. run%integrator%is_there) return
        end do
    end subroutine advance_to

    !> Exchange a coordinate that is near its dead point. If none can be had for it the run goes on as it is, until it
    !> is at that point.
    subroutine change_phase(run)
        type(forward_run), intent(inout) :: run
        logical :: is_new

        run%system%wants_rest = .false.
        if (.not. run%system%watch%is_on .or. (all(run%integrator%failed) .and. run%integrator%reason == stop_length)) return
        ! Between two steps a coordinate is exchanged once.
        if (run%integrator%n_step /= run%step_entered) run%n_exchanged = 0
        if (run%n_exchanged >= run%own%n_q .and. .not. all(run%integrator%failed)) return
        call run%system%look_at(spread(run%integrator%good_until(1), 1, lanes), run%y)
        is_new = .false.
        ! A phase that has failed at its first step is no improvement.
        if (run%options%switches .and. .not. (all(run%integrator%failed) .and. run%integrator%n_step == run%step_entered)) then
            call hold_texts()
            call find_better_phase(run, is_new)
            call release_texts()
        end if
        if (is_new) return
        run%system%watch%may_exchange = .false.
        run%dead_coordinate = dead_coordinate(run%system%watch, all(run%integrator%failed))
        if (run%dead_coordinate > 0) run%integrator%failed = .true.
    end subroutine change_phase

    !> Another choice of coordinates that leads on from here, with as few loops closed by iteration as can be had.
    subroutine find_better_phase(run, is_found)
        type(forward_run), intent(inout) :: run
        logical, intent(out) :: is_found
        real(wp), parameter :: least_ratio = 1.5_wp    !! every exchange is an improvement, so that they come to an end
        type(model_type), allocatable :: model(:)
        type(scene_type) :: scene
        type(status_type) :: status
        integer, allocatable :: choices(:, :), phase(:), n_iterated(:)
        integer :: i

        associate (from => run%known(run%phase)%phase)
            call list_choices(run%own, run%system%watch, from%choice, least_ratio, choices)
        end associate
        allocate (model(size(choices, 2)), phase(size(choices, 2)), n_iterated(size(choices, 2)))
        n_iterated = huge(1)
        do i = 1, size(choices, 2)
            call exchange_scene(run%own, choices(:, i), run%model, run%system%watch%state, scene)
            call build_model(scene, model(i), status)
            if (.not. status%is_ok()) cycle
            phase(i) = find_phase(run, choices(:, i))
            if (run%known(phase(i))%phase%is_refused) cycle
            n_iterated(i) = number_iterated(model(i))
            if (n_iterated(i) == 0) exit               ! all in closed form
        end do
        is_found = .false.
        do while (.not. is_found .and. any(n_iterated < huge(1)))
            i = minloc(n_iterated, 1)
            n_iterated(i) = huge(1)
            call try_phase(run, phase(i), model(i), is_found)
        end do
    end subroutine find_better_phase

    !> The number of a choice's phase, which is new if it was never looked for. A model serves all assemblies.
    integer function find_phase(run, choice) result(number)
        type(forward_run), intent(inout) :: run
        integer, intent(in) :: choice(:)

        do number = 1, size(run%known)
            if (all(run%known(number)%phase%choice == choice)) return
        end do
        run%known = [run%known, phase_box()]
        allocate (run%known(number)%phase)
        run%known(number)%phase%choice = choice
    end function find_phase

    !> Go on in a phase, with a model that starts at the position reached.
    subroutine try_phase(run, number, model, is_entered)
        type(forward_run), intent(inout) :: run
        integer, intent(in) :: number
        type(model_type), intent(in) :: model
        logical, intent(out) :: is_entered
        real(wp), allocatable :: y(:, :)
        type(status_type) :: status

        associate (t => run%integrator%good_until(1), phase => run%known(number)%phase)
            call enter_phase(run%own, run%options, run%known(run%phase)%phase, run%y, t, model, phase, y, is_entered, status)
            phase%is_refused = .not. status%is_ok()
            if (.not. is_entered) return
            run%output = y
            call move_alloc(y, run%y)
            run%model => phase%model
            run%system => phase%system
            run%phase = number
            run%step_entered = run%integrator%n_step
            run%n_exchanged = run%n_exchanged + 1
            run%later_phase = [run%later_phase, number]
            run%entered_at = [run%entered_at, t]
            call run%integrator%exchange_system(run%system, run%y, status)
        end associate
    end subroutine try_phase
end module linkdyn_forward_course
