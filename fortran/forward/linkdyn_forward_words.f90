!> What is told of a forward run in words: why it stopped, what was integrated, what rounding has left.
module linkdyn_forward_words
    use linkdyn_constants, only: two_pi
    use linkdyn_coordinate_watch, only: dead_coordinate
    use linkdyn_cylinder_states, only: end_of_cylinder
    use linkdyn_driven_reach, only: driven_out_in_words
    use linkdyn_exchange, only: choice_names
    use linkdyn_failure, only: failure_at, map_in_words, meeting_in_words
    use linkdyn_forward_run, only: forward_run
    use linkdyn_integrator, only: method_name, method_rk4, method_msbdf, stop_growth, stop_roughness, stop_pace, stop_law, &
        stop_length
    use linkdyn_kinds, only: wp
    use linkdyn_longest_step, only: too_long_steps_in_words
    use linkdyn_model, only: model_type
    use linkdyn_status, only: sample_ok, sample_unreachable, sample_branch_lost, sample_not_converged, sample_undefined
    use linkdyn_stiffest_part, only: find_stiffest
    use linkdyn_text, only: to_text, quoted
    implicit none (type, external)
    private
    public :: coordinates_in_words, tolerance_in_words, rounding_in_words, tell_stop, driven_through_in_words, no_stand_in, &
        without_end_in_words

    !> Behind the name of a coordinate of a pose, or of a joint with several axes.
    character(len=*), parameter :: no_stand_in = " comes to its dead point, where it turns back and the " &
        //"mechanism goes on (expected hinges or slides as coordinates: others can take their places)"

contains

    !> "slide of D until 0.251 s, then angle of A"; blank if no coordinate was exchanged.
    function coordinates_in_words(run) result(text)
        type(forward_run), intent(in) :: run
        character(len=:), allocatable :: text
        integer, parameter :: most = 4                 !! exchanges told one by one
        integer :: i, n

        text = ""
        if (.not. allocated(run%later_phase)) return
        n = size(run%later_phase)
        if (n == 0) return
        text = names_of(1)
        do i = 1, n
            if (i > most .and. i < n) cycle
            if (i == n .and. n > most + 1) text = text//", ... ("//to_text(n)//" exchanges)"
            text = text//" until "//to_text(run%entered_at(i))//" s, then "//names_of(run%later_phase(i))
        end do

    contains

        function names_of(phase) result(names)
            integer, intent(in) :: phase
            character(len=:), allocatable :: names

            names = choice_names(run%own, run%known(phase)%phase%choice)
        end function names_of
    end function coordinates_in_words

    !> "1e-4 relative (0.5 was asked for, too loose to judge steps by), 1e-9 absolute, in a step"; blank of a fixed step.
    function tolerance_in_words(run) result(text)
        type(forward_run), intent(in) :: run
        character(len=:), allocatable :: text

        text = ""
        associate (options => run%integrator%options)
            if (options%method == method_rk4) return
            text = to_text(options%rtol)//" relative"//not_as(options%asked(1))//", "//to_text(options%atol)//" absolute" &
                   //not_as(options%asked(2))//", in a step"
        end associate

    contains

        function not_as(asked) result(words)
            real(wp), intent(in) :: asked              !! 0: as it is
            character(len=:), allocatable :: words

            words = ""
            if (asked > 0) words = " ("//to_text(asked)//" was asked for, too loose to judge steps by)"
        end function not_as
    end function tolerance_in_words

    !> "left 4e-10 in 34 of 441 steps with errors above the tolerance, up to 3e-11"; blank if it did not.
    function rounding_in_words(run) result(text)
        type(forward_run), intent(in) :: run
        character(len=:), allocatable :: text

        text = ""
        associate (i => run%integrator)
            if (i%n_rough > 0) text = "left "//to_text(i%rough_in_all)//" in "//to_text(i%n_rough)//" of "//to_text(i%n_step) &
                                      //" steps with errors above the tolerance, up to "//to_text(i%roughest)
        end associate
    end function rounding_in_words

    !> Why a run stopped, and what that makes of the samples beyond.
    subroutine tell_stop(run, reason, status)
        type(forward_run), intent(in) :: run
        character(len=:), allocatable, intent(out) :: reason
        integer, intent(out) :: status                 !! of these: `sample_not_converged` where the mechanism could go on, but no
                                                       !! step can be taken, `sample_undefined` where a force has no value or
                                                       !! nothing is a number any more; `sample_ok` if that is told otherwise
        character(len=:), allocatable :: driven_out, too_stiff
        integer, parameter :: many_jumps = 100         !! evaluations on the other side than the one before: more than a passage
                                                       !! takes
        character(len=*), parameter :: no_other = ", and no other joint variable can take its place"
        integer :: stalled, lane

        reason = "stopped at t = "//to_text(run%good_until)//" s: "
        status = sample_ok
        ! However the steps have come to their end, by what they lost or by how short they became: this is why.
        stalled = 0
        if (.not. (run%is_over .or. run%system%way%is_driven_through(1) .or. has_blind_controller(run) &
                   .or. any([stop_growth, stop_pace, stop_length] == run%integrator%reason))) &
            stalled = run%system%stalled_coordinate(run%good_until, run%y)
        driven_out = ""
        if (.not. (run%is_over .or. run%system%way%is_driven_through(1))) driven_out = driven_out_in_words(run)
        if (run%is_over) then
            reason = reason//"event "//quoted(run%own%scene%event(run%system%way%final_event(1))%name)
        else if (run%system%way%is_driven_through(1)) then
            reason = reason//driven_through_in_words(run%own, run%system%way%final_event(1), run%system%way%is_jammed(1))
        else if (run%integrator%reason == stop_length) then
            status = sample_not_converged
            reason = reason//too_long_steps_in_words(run%system, 1, run%integrator%too_long_for(1), run%good_until, &
                                                     run%options%integrator%step, run%y)
        else if (driven_out /= "") then
            reason = reason//driven_out
        else if (run%dead_coordinate > 0) then
            reason = reason//"coordinate "//quoted(run%model%scene%coordinate(run%dead_coordinate)%name) &
                     //" comes to its dead point"
            if (run%options%switches) reason = reason//no_other
        else if (stalled > 0) then
            reason = reason//"coordinate "//quoted(run%model%scene%coordinate(stalled)%name)
            if (is_joint_itself(run, stalled)) then
                reason = reason//" comes to its dead point"
                if (run%options%switches) reason = reason//no_other
            else
                reason = reason//no_stand_in
            end if
        else if (meeting_map(run) > 0 .and. .not. (run%system%way%bounce%is_ahead &
                                                                  .and. run%model%scene%passes_change_points)) then
            ! where runs end at change points, what turns back there does so for that
            reason = reason//map_in_words(run%model, meeting_map(run))//" come to a change point" &
                     //meeting_in_words(run%model)
        else if (run%system%way%bounce%is_ahead .and. run%integrator%reason /= stop_pace) then
            ! steps that would not come to the end meet bounces as well, where they are too long
            if (run%system%way%bounce%is_recorded) then
                reason = reason//"a coordinate that is part of a pose or of a joint with several axes"//no_stand_in
            else
                reason = reason//"a coordinate comes to its dead point, and at these tolerances every step " &
                         //"leads to a mechanism that reverses"
            end if
        else if (has_blind_controller(run)) then
            reason = reason//"controller "//quoted(run%own%scene%controller(run%system%control%state%blind)%name) &
                     //" has no output: its measured value, its target or its feed-forward is undefined beyond"
        else if (has_come_to_end(run)) then
            reason = reason//end_of_cylinder(run%system%cylinders, run%model)
        else
            select case (run%integrator%reason)
            case (stop_growth)
                status = sample_undefined
                reason = reason//"the motion grows without bound"
            case (stop_roughness)
                status = sample_not_converged
                reason = reason//"rounding leaves too few digits of the rates, as it does where two assemblies meet"
            case (stop_law)
                reason = reason//"the energy would change by more than the forces supply: the links would jump to another assembly"
                reason = reason//too_long_in_words(run)
            case (stop_pace)
                status = sample_not_converged
                if (size(run%integrator%without_end(1)) > 0) then
                    reason = reason//without_end_in_words(run%own, run%integrator%without_end(1))
                else
                    reason = reason//"steps of "//to_text(run%integrator%last_step) &
                             //" s would not reach the end within the step limit"
                end if
                if (run%system%n_jump > many_jumps) reason = reason//": a law alternates between two values, "// &
                    "as a sign() does at rest (expected a law that changes over a small speed, tanh(v/v0))"
            case default
                ! whichever of the stages side by side has failed
                lane = findloc(run%system%workspace%status /= sample_ok, .true., dim=1)
                if (lane > 0) then
                    associate (of_stage => run%system%workspace%status(lane))
                        reason = reason//failure_at(run%model, run%system%workspace%state, of_stage, lane)//" beyond"
                        if (of_stage == sample_undefined) status = of_stage
                        if (of_stage == sample_not_converged) reason = reason//too_long_in_words(run)
                    end associate
                else
                    reason = reason//"the step size tends to zero, as it does where the equations of motion are singular"
                end if
            end select
            too_stiff = stiffness_in_words(run)
            if (too_stiff /= "") status = sample_not_converged
            reason = reason//too_stiff
        end if
    end subroutine tell_stop

    !> What happens again and again at an instant.
    function without_end_in_words(model, event) result(text)
        type(model_type), intent(in) :: model
        integer, intent(in) :: event(:)
        character(len=:), allocatable :: text
        integer :: k

        text = ""
        do k = 1, size(event)
            if (k > 1) text = text//", "
            text = text//quoted(model%scene%event(event(k))%name)
        end do
        text = "what happens at "//text//" follows on itself at this instant without end: " &
               //"who holds and who lets go there is not determined"
    end function without_end_in_words

    !> What is driven, or held, against an impulse.
    function driven_through_in_words(model, event, is_jammed) result(text)
        type(model_type), intent(in) :: model
        integer, intent(in) :: event                   !! of the stop or clutch that could not give it
        logical, intent(in) :: is_jammed               !! by what transmissions lose
        character(len=:), allocatable :: text

        if (is_jammed) then
            text = "what transmissions lose jams the mechanism where "
            if (model%scene%event(event)%clutch > 0) text = text//"clutch "
            if (model%scene%event(event)%clutch == 0) text = text//"stop "
            text = text//quoted(model%scene%event(event)%name)//" acts: nothing gives way to its impulse " &
                   //"(expected more 'rotor_inertia', or a higher 'back_efficiency')"
        else if (model%scene%event(event)%clutch > 0) then
            text = "nothing that clutch "//quoted(model%scene%event(event)%name) &
                   //" could join moves freely: both of its sides are driven, or held"
        else
            text = "what strikes stop "//quoted(model%scene%event(event)%name) &
                   //" is driven: no force of the stop changes its motion"
        end if
    end function driven_through_in_words

    !> Whose assemblies meet where the run has stopped; 0: nobody's. One that is to end exactly there tries no way beyond,
    !> which would tell: its steps come ever nearer.
    pure integer function meeting_map(run) result(map)
        type(forward_run), intent(in) :: run
        real(wp), parameter :: flat = 1.0e-2_wp        !! margin at which they are said to come to that

        associate (assembly => run%system%way%assembly)
            map = assembly%map_lost(1)
            if (map > 0 .or. run%model%scene%passes_change_points .or. run%integrator%reason /= stop_pace &
                .or. run%integrator%n_step == 0 .or. .not. allocated(assembly%margin)) return
            map = minloc(abs(assembly%margin(1, :)), dim=1)
            if (map == 0) return
            if (abs(assembly%margin(1, map)) > flat) map = 0
        end associate
    end function meeting_map

    !> Is a coordinate a hinge or slide itself, which another one could stand in for? Members of ensembles are not watched for that.
    pure logical function is_joint_itself(run, k)
        type(forward_run), intent(in) :: run
        integer, intent(in) :: k

        is_joint_itself = .false.
        if (allocated(run%system%watch%variable)) is_joint_itself = run%system%watch%variable(k) > 0
    end function is_joint_itself

    !> Has a cylinder come to where it cannot go on, where the mechanism itself could?
    pure logical function has_come_to_end(run)
        type(forward_run), intent(in) :: run

        has_come_to_end = run%system%cylinders%culprit > 0 .and. &
            .not. any(run%system%way%obstacle(1) == [sample_unreachable, sample_branch_lost, sample_not_converged])
    end function has_come_to_end

    !> Has a controller nothing to put out, where the mechanism itself could go on?
    pure logical function has_blind_controller(run)
        type(forward_run), intent(in) :: run

        has_blind_controller = run%system%control%state%blind > 0 .and. &
            .not. any(run%system%way%obstacle(1) == [sample_unreachable, sample_branch_lost, sample_not_converged])
    end function has_blind_controller

    !> What may be at fault of a method that does not shorten its steps for it; blank of others.
    function too_long_in_words(run) result(text)
        type(forward_run), intent(in) :: run
        character(len=:), allocatable :: text

        text = ""
        associate (method => run%integrator%options%method)
            if (any([method_rk4, method_msbdf] == method)) text = ", or "//trim(method_name(method))//" takes too long steps"
        end associate
    end function too_long_in_words

    !> What is too stiff for the steps of a run that cannot go on; blank if nothing is.
    function stiffness_in_words(run) result(text)
        type(forward_run), intent(in) :: run
        character(len=:), allocatable :: text, name
        real(wp), parameter :: part_of_turn = 1.0e-3_wp    !! [rad] of the fastest motion in the last step
        real(wp), parameter :: endless = 1.0e8_wp          !! [rad] of it in the run
        real(wp) :: rate, step

        text = ""
        if (run%integrator%reason == stop_roughness) return
        if (run%integrator%reason /= stop_law .and. run%integrator%n_step == run%step_entered) return
        call find_stiffest(run%model, run%good_until, run%y(1, :), name, rate)
        step = run%integrator%last_step
        if (run%options%integrator%method == method_rk4) step = run%options%integrator%step
        ! A law that is broken may be so for other reasons than the length of the step, and no step may have been taken before.
        if (run%integrator%reason == stop_law) step = 0
        if (rate*step < part_of_turn .and. rate*run%options%integrator%span < endless) return
        text = ": "//name//" is too stiff (its motion takes "//to_text(two_pi/rate)//" s)"
    end function stiffness_in_words
end module linkdyn_forward_words
