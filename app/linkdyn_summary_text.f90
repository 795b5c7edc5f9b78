!> The summary of a run as text.
module linkdyn_summary_text
    use linkdyn_choice, only: choices_in_words, sharing_in_words
    use linkdyn_code, only: code_in_use
    use linkdyn_columns, only: significant, left, right
    use linkdyn_event_log, only: event_log
    use linkdyn_event_words, only: side_in_words
    use linkdyn_inverse, only: solver_name, solver_reduced
    use linkdyn_kinds, only: wp
    use linkdyn_model, only: model_type, drives_share
    use linkdyn_results, only: layout_type, label_len, dim_actuator, dim_joint, dimension_type, dim_motor, dim_controller, &
        label_of_value
    use linkdyn_scene, only: scene_type, idle_spins, share_by_least_norm
    use linkdyn_shared_words, only: shares_in_words
    use linkdyn_status, only: sample_status_name
    use linkdyn_summary, only: summary_type, peak_type, event_type, error_peak_type, range_type, excess_type
    use linkdyn_text, only: to_text, quoted
    use linkdyn_time_mean, only: mean_of
    implicit none (type, external)
    private
    public :: print_summary, failure_text, reason_of_loss, passed_stops

contains

    !> The table.
    subroutine print_summary(model, layout, summary, solver, threads, seconds, output, unit, log)
        type(model_type), intent(in) :: model
        type(layout_type), intent(in) :: layout
        type(summary_type), intent(in) :: summary
        character(len=*), intent(in) :: solver
        integer, intent(in) :: threads
        real(wp), intent(in) :: seconds          !! spent computing
        character(len=*), intent(in) :: output       !! file written
        integer, intent(in) :: unit
        type(event_log), intent(in), optional :: log !! of a forward run
        integer :: n_solved

        if (len_trim(model%scene%title) > 0) write (unit, "(a)") trim(model%scene%title)
        write (unit, "(a)") "  "//to_text(summary%n_sample)//trim(merge(" sample ", " samples", summary%n_sample == 1))//", "// &
            gravity_text(model%scene)//", solver "//solver// &
            ", "//to_text(threads)//trim(merge(" thread ", " threads", threads == 1))
        n_solved = max(1, summary%n_sample - summary%failure%n)
        if (summary%has_force) &
            call print_range("driving force", named_units(layout%dimension(dim_actuator)), summary%drive, summary%has_time, unit, &
                             model, log)
        if (size(summary%motor%lowest) > 0) then
            call print_range("motor torque", named_units(layout%dimension(dim_motor), "N m"), summary%motor, summary%has_time, &
                             unit, model, log)
        end if
        if (summary%has_reaction) then
            write (unit, "(a)") ""
            call print_reaction("largest reaction force ", "N  ", summary%force, 0.0_wp)
            ! what is less is rounding of the forces, an arm's length away
            call print_reaction("largest reaction moment", "N m", summary%moment, epsilon(1.0_wp)**2*summary%force%value)
        else if (solver == trim(solver_name(solver_reduced))) then
            write (unit, "(a)") ""
            write (unit, "(a)") "  no reactions: the solver does without them"
        end if
        if (size(summary%worst) > 0) call print_errors(layout, summary%worst, summary%has_time, unit)
        write (unit, "(a)") ""
        if (idle_spins(model%scene) /= "") write (unit, "(a)") &
            "  idle spins       "//idle_spins(model%scene)//": held, nothing else depends on them"
        if (drives_share(model)) write (unit, "(a)") "  drives           "//sharing_in_words(model)
        if (model%share%n > 0) call print_shares()
        if (len(choices_in_words(model)) > 0) write (unit, "(a)") "  assembly         "//choices_in_words(model)
        write (unit, "(a)") "  failed samples   "//failure_text(summary)
        if (passed_stops(model%scene, summary) /= "") write (unit, "(a)") "  end stops        passed: " &
            //passed_stops(model%scene, summary)
        if (overloads(layout, summary) /= "") write (unit, "(a)") "  overloaded       "//overloads(layout, summary)
        if (pressures_above(model%scene, summary) /= "") write (unit, "(a)") "  above supply     " &
            //pressures_above(model%scene, summary)
        if (strokes_left(model%scene, summary) /= "") write (unit, "(a)") "  beyond stroke    " &
            //strokes_left(model%scene, summary)
        if (limits_reached(layout, summary) /= "") write (unit, "(a)") "  at their limits  "//limits_reached(layout, summary)
        call print_lifts()
        if (summary%n_passed > 0) write (unit, "(a)") "  change points    "//crossings_text(summary)
        if (summary%anew%n > 0) write (unit, "(a)") "  reassembled      from the start of the scene, at " &
            //times_text(summary%anew, summary%has_time)
        if (summary%roads%iterated > 0) write (unit, "(a)") "  closed           "//to_text(summary%roads%closed)// &
            " samples in closed form, "//to_text(summary%roads%iterated)//" by iteration"
        if (summary%roads%dense > 0) write (unit, "(a)") "  dense solver     took over "// &
            to_text(summary%roads%dense)//" samples with unreliable pivots"
        if (index(code_in_use(), " ") > 0) write (unit, "(a)") "  machine code     "//code_in_use()
        write (unit, "(a)") "  computing time   "//significant(1.0e6_wp*seconds/summary%n_sample)// &
            " us per sample, "//significant(seconds)//" s in all"
        write (unit, "(a)") "  results          "//output
    contains
        !> Which reactions are a choice among many.
        subroutine print_shares()
            write (unit, "(a)") "  not determined   "//shares_in_words(model)//": taken is "// &
                trim(merge("the least sum of squares ", "the least elastic energy ", &
                           model%scene%redundancy == share_by_least_norm))
        end subroutine print_shares

        !> Followers that nothing but their joint holds on their cams.
        subroutine print_lifts()
            integer :: j, k

            do j = 1, model%n_joint
                k = model%joint(j)%cam
                if (k == 0 .or. model%scene%joint(j)%cam%is_groove) cycle
                if (summary%lift(k)%n > 0) write (unit, "(a)") "  lifts            "//quoted(model%joint(j)%name)// &
                    ": the follower would leave its cam in "//significant(100*real(summary%lift(k)%n, wp)/n_solved)// &
                    " % of the samples ("//times_text(summary%lift(k), summary%has_time)//")"
            end do
        end subroutine print_lifts

        !> ", just before impact 'floor.min'"; blank of a sample.
        function beside_in_words(peak) result(text)
            type(peak_type), intent(in) :: peak
            character(len=:), allocatable :: text

            text = ""
            if (peak%beside > 0 .and. present(log)) text = ", "//side_in_words(model, log, peak%beside)
        end function beside_in_words

        subroutine print_reaction(what, unit_name, peak, least)
            character(len=*), intent(in) :: what, unit_name
            type(peak_type), intent(in) :: peak
            real(wp), intent(in) :: least                !! squared, as peaks are

            if (.not. peak%is_set) return
            if (.not. peak%value > least) then
                write (unit, "(a)") "  "//what//"  "//right("none", 12)
                return
            end if
            write (unit, "(a)") "  "//what//"  "//right(significant(sqrt(peak%value)), 12)//" "//unit_name//"  at "// &
                trim(layout%dimension(dim_joint)%label(peak%place))//", "//instant(peak%time, summary%has_time)// &
                beside_in_words(peak)
        end subroutine print_reaction
    end subroutine print_summary

    !> "A [N m]" for every entry of a dimension.
    pure function named_units(dimension, unit) result(name)
        type(dimension_type), intent(in) :: dimension
        character(len=*), intent(in), optional :: unit   !! of all; absent: of the entries
        character(len=label_len + 8) :: name(dimension%size)
        integer :: k

        do k = 1, size(name)
            if (present(unit)) then
                name(k) = trim(dimension%label(k))//" ["//unit//"]"
            else
                name(k) = trim(dimension%label(k))//" ["//trim(dimension%unit(k))//"]"
            end if
        end do
    end function named_units

    !> Extremes and rms values. Those that stand beside events have a mark, which is explained below.
    subroutine print_range(title, name, range, has_time, unit, model, log)
        character(len=*), intent(in) :: title
        character(len=*), intent(in) :: name(:)
        type(range_type), intent(in) :: range
        logical, intent(in) :: has_time              !! as of the summary
        integer, intent(in) :: unit
        type(model_type), intent(in) :: model
        type(event_log), intent(in), optional :: log !! of a forward run
        integer, parameter :: number_width = 12, time_width = 10
        character(len=:), allocatable :: beside
        real(wp) :: rms(size(name))
        integer :: k, width

        rms = sqrt(mean_of(range%square))
        width = max(len("driving force"), maxval(len_trim(name)))
        write (unit, "(a)") ""
        write (unit, "(a)") "  "//left(title, width)//right("lowest", number_width)// &
            right(clock(has_time), time_width)//right("highest", number_width)//right(clock(has_time), time_width)// &
            right("rms", number_width)
        do k = 1, size(name)
            if (.not. range%highest(k)%is_set) then
                write (unit, "(a)") "  "//left(name(k), width)//right("none", number_width)
                cycle
            end if
            write (unit, "(a)") "  "//left(name(k), width)// &
                right(significant(-range%lowest(k)%value), number_width)// &
                right(reading(range%lowest(k)%time, has_time), time_width)// &
                mark(range%lowest(k))//behind_mark(range%highest(k)%value)// &
                right(reading(range%highest(k)%time, has_time), time_width)// &
                mark(range%highest(k))//behind_mark(rms(k))
        end do
        beside = ""
        if (present(log)) call explain_marks()
        if (beside /= "") write (unit, "(a)") "  * "//beside

    contains

        !> Of an instant that is no sample's.
        pure character function mark(peak)
            type(peak_type), intent(in) :: peak

            mark = merge("*", " ", peak%beside > 0)
        end function mark

        !> A number in its column but for the first letter, which is blank.
        pure function behind_mark(value) result(text)
            real(wp), intent(in) :: value
            character(len=:), allocatable :: text

            text = right(significant(value), number_width)
            text = text(2:)
        end function behind_mark

        subroutine explain_marks()
            do k = 1, size(name)
                call add_words(range%lowest(k))
                call add_words(range%highest(k))
            end do
        end subroutine explain_marks

        !> What stands beside an event, each once.
        subroutine add_words(peak)
            type(peak_type), intent(in) :: peak
            character(len=:), allocatable :: words

            if (peak%beside == 0) return
            words = instant(peak%time, has_time)//": "//side_in_words(model, log, peak%beside)
            if (index(beside//"; ", words//"; ") > 0) return
            if (beside /= "") beside = beside//"; "
            beside = beside//words
        end subroutine add_words
    end subroutine print_range

    !> The largest estimated errors with their places; which of them is the worst beside the largest value of its kind.
    subroutine print_errors(layout, worst, has_time, unit)
        type(layout_type), intent(in) :: layout
        type(error_peak_type), intent(in) :: worst(:)
        logical, intent(in) :: has_time              !! as of the summary
        integer, intent(in) :: unit
        integer, parameter :: name_width = 24, number_width = 12, time_width = 10
        character(len=:), allocatable :: mark
        real(wp) :: relative(size(worst))
        integer :: i

        relative = worst%error%value/max(worst%largest, tiny(1.0_wp))
        write (unit, "(a)") ""
        write (unit, "(a)") "  "//left("estimated error", name_width)//right("largest", number_width)// &
            right("of at most", number_width)//right(clock(has_time), time_width)//"  of"
        do i = 1, size(worst)
            if (.not. worst(i)%error%is_set) cycle
            mark = ""
            if (i == maxloc(relative, 1)) mark = "  (the worst)"
            associate (variable => layout%variable(worst(i)%place))
                write (unit, "(a)") "  "//left(trim(variable%name)//" ["//trim(worst(i)%unit)//"]", name_width)// &
                    right(rounded(worst(i)%error%value), number_width)//right(significant(worst(i)%largest), number_width)// &
                    right(reading(worst(i)%error%time, has_time), time_width)//"  "// &
                    label_of_value(layout, variable, worst(i)%error%place)//mark
            end associate
        end do
    end subroutine print_errors

    !> An error: two digits say it all.
    pure function rounded(value) result(text)
        real(wp), intent(in) :: value
        character(len=:), allocatable :: text
        character(len=10) :: buffer

        if (.not. value <= huge(value)) then
            text = "infinite"
            return
        end if
        write (buffer, "(es10.1)") value
        text = trim(adjustl(buffer))
    end function rounded

    !> "none", or how many and where first.
    function failure_text(summary) result(text)
        type(summary_type), intent(in) :: summary
        character(len=:), allocatable :: text

        text = "none"
        if (summary%failure%n > 0) text = to_text(summary%failure%n)//" of "//to_text(summary%n_sample)// &
            ", first at "//instant(summary%failure%first, summary%has_time)//": "// &
            trim(sample_status_name(summary%first_failure))
        if (len_trim(summary%why) > 0) text = text//": "//trim(summary%why)
    end function failure_text

    !> When and why the assembly was lost first; blank if it was not.
    function reason_of_loss(summary) result(text)
        type(summary_type), intent(in) :: summary
        character(len=:), allocatable :: text

        text = ""
        if (len_trim(summary%why) > 0) text = instant(summary%failure%first, summary%has_time)//": "//trim(summary%why)
    end function reason_of_loss

    !> "motor of 'A' in 12 samples, first at t = 0.3 s, most at t = 0.4 s: 5.1 N m required, 4 N m available"; blank: none is
    !> overloaded.
    function overloads(layout, summary) result(text)
        type(layout_type), intent(in) :: layout
        type(summary_type), intent(in) :: summary
        character(len=:), allocatable :: text
        integer :: k

        text = ""
        do k = 1, size(summary%overload)
            associate (overload => summary%overload(k))
                call tell_excess("motor of "//quoted(layout%dimension(dim_motor)%label(k)), overload, &
                                 significant(overload%asked)//" N m", &
                                 significant(overload%asked - overload%lack%value)//" N m", summary%has_time, text)
            end associate
        end do
    end function overloads

    !> "cylinder at 'ram.P' in 12 samples, first at t = 0.3 s, most at t = 0.4 s: 145.2 bar required, 120 bar available"
    function pressures_above(scene, summary) result(text)
        type(scene_type), intent(in) :: scene
        type(summary_type), intent(in) :: summary
        character(len=:), allocatable :: text
        real(wp), parameter :: bar = 1.0e5_wp        !! [Pa]
        integer :: k

        text = ""
        do k = 1, size(summary%pressure)
            call tell_excess("cylinder at "//quoted(scene%actuator(k)%name), summary%pressure(k), &
                             significant(summary%pressure(k)%asked/bar)//" bar", &
                             significant(scene%actuator(k)%cylinder%supply/bar)//" bar", summary%has_time, text)
        end do
    end function pressures_above

    !> "cylinder at 'ram.P' in 12 samples, first at t = 0.3 s, most at t = 0.4 s: 1.15 m required, 0.6 m to 1.1 m available"
    function strokes_left(scene, summary) result(text)
        type(scene_type), intent(in) :: scene
        type(summary_type), intent(in) :: summary
        character(len=:), allocatable :: text
        integer :: k

        text = ""
        do k = 1, size(summary%stroke)
            associate (ends => scene%actuator(k)%cylinder%stroke)
                call tell_excess("cylinder at "//quoted(scene%actuator(k)%name), summary%stroke(k), &
                                 significant(summary%stroke(k)%asked)//" m", &
                                 significant(minval(ends))//" m to "//significant(maxval(ends))//" m", summary%has_time, text)
            end associate
        end do
    end function strokes_left

    !> One drive more in a list; nothing of one that has what is asked of it.
    subroutine tell_excess(what, excess, asked, there, has_time, text)
        character(len=*), intent(in) :: what         !! it is of
        type(excess_type), intent(in) :: excess
        character(len=*), intent(in) :: asked, there !! with their units
        logical, intent(in) :: has_time              !! as of the summary
        character(len=:), allocatable, intent(inout) :: text

        character(len=:), allocatable :: times

        if (.not. excess%lack%is_set) return
        times = "beside events"
        if (excess%event%n > 0) times = "in "//times_text(excess%event, has_time)
        if (text /= "") text = text//"; "
        text = text//what//" "//times//", most at "//instant(excess%lack%time, has_time)//": "//asked//" required, "//there &
               //" available"
    end subroutine tell_excess

    !> "t = 0.3 s", or "sample 3" where samples have no time.
    function instant(time, has_time) result(text)
        real(wp), intent(in) :: time
        logical, intent(in) :: has_time              !! as of the summary
        character(len=:), allocatable :: text

        text = "sample "//reading(time, has_time)
        if (has_time) text = "t = "//reading(time, has_time)//" s"
    end function instant

    !> The number in it.
    function reading(time, has_time) result(text)
        real(wp), intent(in) :: time
        logical, intent(in) :: has_time              !! as of the summary
        character(len=:), allocatable :: text

        text = significant(time)
        if (.not. has_time) text = to_text(nint(time))
    end function reading

    !> What stands above such numbers.
    function clock(has_time) result(text)
        logical, intent(in) :: has_time              !! as of the summary
        character(len=:), allocatable :: text

        text = "at sample"
        if (has_time) text = "at t [s]"
    end function clock

    !> "controller 'S' in 12 samples, first at t = 0.3 s"; blank: none was at a limit.
    function limits_reached(layout, summary) result(text)
        type(layout_type), intent(in) :: layout
        type(summary_type), intent(in) :: summary
        character(len=:), allocatable :: text
        integer :: k

        text = ""
        do k = 1, size(summary%limited)
            if (summary%limited(k)%n == 0) cycle
            if (text /= "") text = text//"; "
            text = text//"controller "//quoted(layout%dimension(dim_controller)%label(k))//" in " &
                   //times_text(summary%limited(k), summary%has_time)
        end do
    end function limits_reached

    !> "'floor.min' of joint 'h' by 12 samples, first at t = 0.3 s"; blank: none is passed.
    function passed_stops(scene, summary) result(text)
        type(scene_type), intent(in) :: scene
        type(summary_type), intent(in) :: summary
        character(len=:), allocatable :: text
        integer :: k

        text = ""
        if (.not. allocated(summary%beyond)) return
        do k = 1, size(summary%beyond)
            if (summary%beyond(k)%n == 0) cycle
            if (text /= "") text = text//"; "
            text = text//quoted(scene%stop(k)%name)//" of "//trim(scene%stop(k)%what)//" by " &
                   //times_text(summary%beyond(k), summary%has_time)
        end do
    end function passed_stops

    !> "3 samples, first at t = 0.72 s"
    function times_text(event, has_time) result(text)
        type(event_type), intent(in) :: event
        logical, intent(in) :: has_time              !! as of the summary
        character(len=:), allocatable :: text

        text = to_text(event%n)//trim(merge(" sample ", " samples", event%n == 1))//", first at "//instant(event%first, has_time)
    end function times_text

    !> "20 passed on the smooth continuation, the first before t = 0.72 s"
    function crossings_text(summary) result(text)
        type(summary_type), intent(in) :: summary
        character(len=:), allocatable :: text

        text = to_text(summary%n_passed)//" passed on the smooth continuation"
        if (summary%crossing%n > 0) text = text//", the first before "//instant(summary%crossing%first, summary%has_time)
    end function crossings_text

    function gravity_text(scene) result(text)
        type(scene_type), intent(in) :: scene
        character(len=:), allocatable :: text
        integer :: i

        if (all(scene%gravity == 0)) then
            text = "no gravity"
            return
        end if
        text = "gravity"
        do i = 1, merge(2, 3, scene%planar)
            text = text//" "//to_text(scene%gravity(i))
        end do
        text = text//" m/s2"
    end function gravity_text
end module linkdyn_summary_text
