!> What the engineer wants to know first: peaks and rms of the driving forces, the largest reaction,
!> how many samples failed, how long it took.
module linkdyn_summary
    use linkdyn_assembly_trail, only: reached_crossing, reached_anew
    use linkdyn_cylinder_laws, only: cylinder_force
    use linkdyn_inverse, only: solver_name, solver_reduced
    use linkdyn_choice, only: choices_in_words, sharing_in_words
    use linkdyn_kinds, only: wp
    use linkdyn_model, only: model_type, drives_share
    use linkdyn_results, only: layout_type, variable_type, block_type, view_values, label_len, dim_actuator, dim_joint, &
        dimension_type, dim_motor, dim_variable, dim_cam, dim_controller, variable_index, samples_width, label_of_value, &
        estimated, estimate_of
    use linkdyn_result_kinds, only: result_time, result_driving_force, result_motor_torque, result_reaction, &
        result_status, result_assembly, result_torque_margin, result_joint_variable, result_contact_force, &
        result_controller_limited
    use linkdyn_code, only: code_in_use
    use linkdyn_roads, only: road_counts, operator(+)
    use linkdyn_scene, only: scene_type, cylinder_spec, idle_spins, has_hard_stops, n_stop, variable_name, share_by_least_norm, &
        measure_joint
    use linkdyn_shared_words, only: shares_in_words
    use linkdyn_status, only: sample_ok, sample_singular, sample_status_name, message_len
    use linkdyn_text, only: to_text, quoted
    use linkdyn_time_mean, only: time_mean, start_mean, add_sample, join_means, mean_of
    implicit none (type, external)
    private
    public :: summary_type, start_summary, add_to_summary, join_summaries, print_summary, failure_text, reason_of_loss, &
        passed_stops, significant, left, right

    real(wp), parameter :: touch = 1.0e-9_wp             !! [m, rad] a motion that ends at a stop is not beyond it
    real(wp), parameter :: rounded_share = 1.0e-9_wp     !! what is at its limit but for rounding is not beyond it

    !> A largest value with its place.
    type :: peak_type
        real(wp) :: value = 0
        real(wp) :: noted = 0    !! the value at `time`: that, but for rounding
        real(wp) :: time = 0
        integer :: place = 0     !! joint
        logical :: is_set = .false.
    end type peak_type

    !> How often something happened, and when first.
    type :: event_type
        integer :: n = 0
        real(wp) :: first = 0    !! [s]
    end type event_type

    !> The largest estimated error of one kind of result in one unit.
    type :: error_peak_type
        integer :: place = 0, place_of_error = 0    !! of the variable and of its error in the layout
        character(len=label_len) :: unit = ""
        type(peak_type) :: error                 !! `place`: of the value in a sample
        real(wp) :: largest = 0                  !! value
    end type error_peak_type

    !> How far values go.
    type :: range_type
        type(peak_type), allocatable :: lowest(:), highest(:)   !! of minus the value, of the value
        type(time_mean) :: square
    end type range_type

    !> Samples in which more is asked of a drive than it has.
    type :: excess_type
        type(event_type) :: event
        type(peak_type) :: lack                  !! the largest
        real(wp) :: asked = 0                    !! there
    end type excess_type

    !> Figures gathered block by block.
    type :: summary_type
        integer :: n_sample = 0
        type(event_type) :: failure
        integer :: first_failure = sample_ok                    !! status of that sample
        character(len=message_len) :: why = ""                  !! it failed; blank: its status says it all
        type(event_type) :: crossing                            !! samples behind a change point that none before is behind
        integer :: n_passed = 0                                 !! change points, since the start of the motion
        type(event_type), allocatable :: beyond(:)              !! a stop that throws back (n_stop); not allocated: nobody has looked
        type(event_type), allocatable :: lift(:)                !! of a follower off its cam (n_cam)
        type(event_type), allocatable :: limited(:)             !! of a controller's output (n_controller)
        type(event_type) :: anew                                !! the assembly was found from the start, after failures
        type(road_counts) :: roads
        logical :: has_force = .false., has_reaction = .false.
        type(range_type) :: drive                               !! driving forces
        type(range_type) :: motor                               !! torques of motors
        type(excess_type), allocatable :: overload(:)           !! of motors with limits [N m]
        type(excess_type), allocatable :: pressure(:)           !! of a cylinder above its supply (n_actuator) [Pa]
        type(excess_type), allocatable :: stroke(:)             !! of its slide beyond its ends (n_actuator) [m]
        type(peak_type) :: force, moment                        !! largest reaction, its square
        type(error_peak_type), allocatable :: worst(:)          !! none: no errors were estimated
    end type summary_type

contains

    subroutine start_summary(layout, summary)
        type(layout_type), intent(in) :: layout
        type(summary_type), intent(out) :: summary
        integer :: i

        call start_range(layout%dimension(dim_actuator)%size, summary%drive)
        call start_range(merge(layout%dimension(dim_motor)%size, 0, variable_index(layout, result_motor_torque) > 0), summary%motor)
        allocate (summary%overload(merge(layout%dimension(dim_motor)%size, 0, variable_index(layout, result_torque_margin) > 0)))
        allocate (summary%pressure(layout%dimension(dim_actuator)%size), summary%stroke(layout%dimension(dim_actuator)%size))
        allocate (summary%worst(0), summary%lift(layout%dimension(dim_cam)%size))
        allocate (summary%limited(layout%dimension(dim_controller)%size))
        do i = 1, size(estimate_of)
            call add_worst(layout, variable_index(layout, estimated(i)), variable_index(layout, estimate_of(i)), summary%worst)
        end do
    end subroutine start_summary

    subroutine start_range(n, range)
        integer, intent(in) :: n
        type(range_type), intent(out) :: range

        allocate (range%lowest(n), range%highest(n))
        call start_mean(n, range%square)
    end subroutine start_range

    subroutine add_to_range(value, t, is_good, range)
        real(wp), intent(in) :: value(:)
        real(wp), intent(in) :: t                    !! [s]
        logical, intent(in) :: is_good               !! a sample that failed has no values, but its time
        type(range_type), intent(inout) :: range
        integer :: k

        call add_sample(t, is_good, value**2, range%square)
        if (.not. is_good) return
        do k = 1, size(value)
            call raise_peak(-value(k), t, k, range%lowest(k))
            call raise_peak(value(k), t, k, range%highest(k))
        end do
    end subroutine add_to_range

    subroutine join_ranges(part, whole)
        type(range_type), intent(in) :: part
        type(range_type), intent(inout) :: whole
        integer :: k

        call join_means(part%square, whole%square)
        do k = 1, size(whole%lowest)
            call join_peaks(part%lowest(k), whole%lowest(k))
            call join_peaks(part%highest(k), whole%highest(k))
        end do
    end subroutine join_ranges

    subroutine join_peaks(later, peak)
        type(peak_type), intent(in) :: later
        type(peak_type), intent(inout) :: peak

        if (later%is_set) call raise_peak(later%value, later%time, later%place, peak)
    end subroutine join_peaks

    !> A place for the largest error of a result in each of its units.
    subroutine add_worst(layout, place, place_of_error, worst)
        type(layout_type), intent(in) :: layout
        integer, intent(in) :: place, place_of_error    !! in the layout; 0: not there
        type(error_peak_type), allocatable, intent(inout) :: worst(:)
        integer :: i

        if (place == 0 .or. place_of_error == 0) return
        associate (unit => layout%variable(place)%entry_unit)
            do i = 1, size(unit)
                if (any(unit(:i - 1) == unit(i))) cycle
                worst = [worst, error_peak_type(place, place_of_error, unit(i))]
            end do
        end associate
    end subroutine add_worst

    !> Take a block in. Failed samples count as such and nowhere else.
    subroutine add_to_summary(layout, block, n, roads, n_passed, summary, lost_sample, why, scene)
        type(layout_type), intent(in) :: layout
        type(block_type), intent(in), target :: block
        integer, intent(in) :: n                     !! samples
        type(road_counts), intent(in) :: roads       !! theirs
        integer, intent(in) :: n_passed              !! change points from the start of the motion to the last sample
        type(summary_type), intent(inout) :: summary
        integer, intent(in), optional :: lost_sample !! of the block: to which the assembly could not be followed; 0: none
        character(len=*), intent(in), optional :: why
        type(scene_type), intent(in), optional :: scene  !! whose motion is given: end stops may be passed, and what cylinders can
        real(wp), parameter :: rounding = 1.0e-9_wp  !! of a force that is none, by the largest of the sample
        real(wp), pointer :: time(:), force(:, :), torque(:, :), margin(:, :), reaction(:, :, :), press(:, :), variable(:, :)
        integer, pointer :: code(:), assembly(:), limited(:, :)
        integer :: i, k, n_force

        call view_values(layout, result_time, n, block, time)
        call view_values(layout, result_status, n, block, code)
        call view_values(layout, result_assembly, n, block, assembly)
        call view_values(layout, result_driving_force, n, block, force)
        call view_values(layout, result_motor_torque, n, block, torque)
        call view_values(layout, result_torque_margin, n, block, margin)
        call view_values(layout, result_reaction, n, block, reaction)
        call view_values(layout, result_contact_force, n, block, press)
        call view_values(layout, result_controller_limited, n, block, limited)
        call view_values(layout, result_joint_variable, n, block, variable)
        if (present(scene)) call look_at_stops(layout, scene, block, n, summary%beyond)
        summary%has_force = associated(force)
        summary%has_reaction = associated(reaction)
        summary%n_sample = summary%n_sample + n
        summary%roads = summary%roads + roads
        summary%n_passed = max(summary%n_passed, n_passed)
        n_force = merge(2, 3, layout%planar)
        do i = 1, n
            if (summary%has_force) call add_to_range(force(:, i), time(i), code(i) == sample_ok, summary%drive)
            if (associated(torque)) call add_to_range(torque(:, i), time(i), code(i) == sample_ok, summary%motor)
            if (associated(assembly) .and. any(code(i) == [sample_ok, sample_singular])) then
                if (assembly(i) == reached_crossing) call count_event(time(i), summary%crossing)
            end if
            if (code(i) /= sample_ok) then
                if (summary%failure%n == 0) then
                    summary%first_failure = code(i)
                    if (present(lost_sample)) summary%why = merge(why, repeat(" ", len(why)), lost_sample == i)
                end if
                call count_event(time(i), summary%failure)
                cycle
            end if
            if (associated(assembly)) then
                if (assembly(i) == reached_anew) call count_event(time(i), summary%anew)
            end if
            if (associated(margin)) call note_overload(torque(:, i), margin(:, i), time(i), summary%overload)
            if (present(scene)) call note_cylinders(i)
            if (associated(limited)) call note_limits(limited(:, i) > 0, time(i), summary%limited)
            do k = 1, size(summary%worst)
                call note_errors(layout, block, i, time(i), summary%worst(k))
            end do
            if (.not. summary%has_reaction) cycle
            do k = 1, size(summary%lift)
                if (press(k, i) < -rounding*maxval(abs(reaction(:n_force, :, i)))) call count_event(time(i), summary%lift(k))
            end do
            do k = 1, size(reaction, 2)
                call raise_peak(sum(reaction(:n_force, k, i)**2), time(i), k, summary%force)
                call raise_peak(sum(reaction(n_force + 1:, k, i)**2), time(i), k, summary%moment)
            end do
        end do

    contains

        !> What the motion asks of cylinders in a sample, as far as forces and joint variables are among the results.
        subroutine note_cylinders(i)
            integer, intent(in) :: i                 !! sample
            integer :: k

            do k = 1, size(scene%actuator)
                associate (cylinder => scene%actuator(k)%cylinder)
                    if (.not. cylinder%is_given) cycle
                    if (associated(force)) call note_pressure(cylinder, force(k, i), time(i), summary%pressure(k))
                    if (associated(variable)) call note_stroke(cylinder, variable(layout%actuator_variable(k), i), time(i), &
                                                               summary%stroke(k))
                end associate
            end do
        end subroutine note_cylinders
    end subroutine add_to_summary

    !> Motors with less torque than is asked of them, but for rounding: what is saturated is not beyond its limit.
    subroutine note_overload(torque, margin, t, overload)
        real(wp), intent(in) :: torque(:), margin(:) !! (motor) [N m]
        real(wp), intent(in) :: t                    !! [s]
        type(excess_type), intent(inout) :: overload(:)
        integer :: k

        do k = 1, size(overload)
            if (margin(k) < -rounded_share*abs(torque(k))) call note_excess(-margin(k), abs(torque(k)), t, overload(k))
        end do
    end subroutine note_overload

    !> Pressure of the side that pushes while the other is at the tank's: what a force asks for at least.
    pure real(wp) function pressure_asked(cylinder, force) result(pressure)
        type(cylinder_spec), intent(in) :: cylinder
        real(wp), intent(in) :: force                !! up along the joint variable [N]
        real(wp) :: out, push

        out = sign(1.0_wp, cylinder_force(cylinder, [1.0_wp, 0.0_wp]))     ! where pressure in the head pushes
        push = out*force + cylinder%tank*(cylinder%area(2) - cylinder%area(1))
        pressure = cylinder%tank + max(push/cylinder%area(1), -push/cylinder%area(2))
    end function pressure_asked

    !> Is more asked of a cylinder than its supply presses, with its other side at the tank?
    subroutine note_pressure(cylinder, force, t, excess)
        type(cylinder_spec), intent(in) :: cylinder
        real(wp), intent(in) :: force                !! up along the joint variable [N]
        real(wp), intent(in) :: t                    !! [s]
        type(excess_type), intent(inout) :: excess
        real(wp) :: asked

        asked = pressure_asked(cylinder, force)
        if (asked > (1 + rounded_share)*cylinder%supply) call note_excess(asked - cylinder%supply, asked, t, excess)
    end subroutine note_pressure

    !> Is its slide asked to be where the cylinder does not reach?
    subroutine note_stroke(cylinder, place, t, excess)
        type(cylinder_spec), intent(in) :: cylinder
        real(wp), intent(in) :: place                !! of the joint variable [m]
        real(wp), intent(in) :: t                    !! [s]
        type(excess_type), intent(inout) :: excess
        real(wp) :: beyond

        beyond = max(minval(cylinder%stroke) - place, place - maxval(cylinder%stroke))
        if (beyond > touch) call note_excess(beyond, place, t, excess)
    end subroutine note_stroke

    subroutine note_excess(lack, asked, t, excess)
        real(wp), intent(in) :: lack, asked
        real(wp), intent(in) :: t                    !! [s]
        type(excess_type), intent(inout) :: excess

        call count_event(t, excess%event)
        call raise_peak(lack, t, 1, excess%lack)
        if (excess%lack%time == t) excess%asked = asked
    end subroutine note_excess

    !> Later ones to those before.
    subroutine join_excess(part, whole)
        type(excess_type), intent(in) :: part
        type(excess_type), intent(inout) :: whole

        if (part%event%n == 0) return
        call join_events(part%event, whole%event)
        call join_peaks(part%lack, whole%lack)
        if (whole%lack%time == part%lack%time) whole%asked = part%asked
    end subroutine join_excess

    !> "motor of 'A' in 12 samples, first at t = 0.3 s, most at t = 0.4 s: 5.1 N m required, 4 N m available"; blank: none is overloaded.
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
                                 significant(overload%asked - overload%lack%value)//" N m", text)
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
                             significant(scene%actuator(k)%cylinder%supply/bar)//" bar", text)
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
                                 significant(minval(ends))//" m to "//significant(maxval(ends))//" m", text)
            end associate
        end do
    end function strokes_left

    !> One drive more in a list; nothing of one that has what is asked of it.
    subroutine tell_excess(what, excess, asked, there, text)
        character(len=*), intent(in) :: what         !! it is of
        type(excess_type), intent(in) :: excess
        character(len=*), intent(in) :: asked, there !! with their units
        character(len=:), allocatable, intent(inout) :: text

        if (excess%event%n == 0) return
        if (text /= "") text = text//"; "
        text = text//what//" in "//times_text(excess%event)//", most at t = "//significant(excess%lack%time)//" s: " &
               //asked//" required, "//there//" available"
    end subroutine tell_excess

    !> Controllers whose outputs are at a limit.
    pure subroutine note_limits(is_limited, t, limited)
        logical, intent(in) :: is_limited(:)
        real(wp), intent(in) :: t                    !! [s]
        type(event_type), intent(inout) :: limited(:)
        integer :: k

        do k = 1, size(limited)
            if (is_limited(k)) call count_event(t, limited(k))
        end do
    end subroutine note_limits

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
            text = text//"controller "//quoted(layout%dimension(dim_controller)%label(k))//" in "//times_text(summary%limited(k))
        end do
    end function limits_reached

    !> Samples beyond stops that throw back, as far as joint variables are among the results.
    subroutine look_at_stops(layout, scene, block, n, beyond)
        type(layout_type), intent(in) :: layout
        type(scene_type), intent(in) :: scene
        type(block_type), intent(in), target :: block
        integer, intent(in) :: n                     !! samples
        type(event_type), allocatable, intent(inout) :: beyond(:)
        real(wp), pointer :: time(:), variable(:, :)
        integer :: i, k, v

        if (.not. has_hard_stops(scene)) return
        if (.not. allocated(beyond)) allocate (beyond(n_stop(scene)))
        call view_values(layout, result_time, n, block, time)
        call view_values(layout, result_joint_variable, n, block, variable)
        if (.not. associated(variable)) return
        do k = 1, n_stop(scene)
            associate (stop => scene%stop(k), measure => scene%laws%measure(scene%stop(k)%measure), &
                       label => layout%dimension(dim_variable)%label)
                if (measure%kind /= measure_joint .or. .not. stop%is_hard) cycle
                v = findloc(label, trim(scene%joint(measure%joint)%name)//"."// &
                            trim(variable_name(measure%variable, scene%joint(measure%joint)%kind)), dim=1)
                if (v == 0) cycle
                do i = 1, n
                    if (stop%side*(variable(v, i) - stop%bound) > touch) call count_event(time(i), beyond(k))
                end do
            end associate
        end do
    end subroutine look_at_stops

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
            text = text//quoted(scene%stop(k)%name)//" of "//trim(scene%stop(k)%what)//" by "//times_text(summary%beyond(k))
        end do
    end function passed_stops

    pure subroutine count_event(time, event)
        real(wp), intent(in) :: time
        type(event_type), intent(inout) :: event

        if (event%n == 0) event%first = time
        event%n = event%n + 1
    end subroutine count_event

    !> Errors of one kind and unit in a sample.
    subroutine note_errors(layout, block, sample, time, worst)
        type(layout_type), intent(in) :: layout
        type(block_type), intent(in) :: block
        integer, intent(in) :: sample
        real(wp), intent(in) :: time
        type(error_peak_type), intent(inout) :: worst
        integer :: i, n, before

        associate (variable => layout%variable(worst%place), value => block%of(worst%place)%real, &
                   error => block%of(worst%place_of_error)%real)
            n = samples_width(layout, variable)
            before = (sample - 1)*n
            do i = 1, n
                if (unit_of(variable, i) /= worst%unit) cycle
                worst%largest = max(worst%largest, abs(value(before + i)))
                call raise_peak(error(before + i), time, i, worst%error)
            end do
        end associate
    end subroutine note_errors

    pure function unit_of(variable, item) result(unit)
        type(variable_type), intent(in) :: variable
        integer, intent(in) :: item                  !! of the values of a sample
        character(len=label_len) :: unit

        unit = variable%entry_unit(1 + modulo(item - 1, size(variable%entry_unit)))
    end function unit_of

    !> Add the figures of later samples to those of all before them.
    subroutine join_summaries(part, whole)
        type(summary_type), intent(in) :: part
        type(summary_type), intent(inout) :: whole
        integer :: k

        whole%has_force = part%has_force
        whole%has_reaction = part%has_reaction
        if (whole%failure%n == 0) then
            whole%first_failure = part%first_failure
            whole%why = part%why
        end if
        call join_events(part%failure, whole%failure)
        call join_events(part%crossing, whole%crossing)
        whole%n_passed = max(whole%n_passed, part%n_passed)
        call join_events(part%anew, whole%anew)
        do k = 1, size(whole%lift)
            call join_events(part%lift(k), whole%lift(k))
        end do
        do k = 1, size(whole%limited)
            call join_events(part%limited(k), whole%limited(k))
        end do
        if (allocated(part%beyond) .and. .not. allocated(whole%beyond)) allocate (whole%beyond(size(part%beyond)))
        if (allocated(part%beyond)) then
            do k = 1, size(part%beyond)
                call join_events(part%beyond(k), whole%beyond(k))
            end do
        end if
        whole%n_sample = whole%n_sample + part%n_sample
        whole%roads = whole%roads + part%roads
        call join_ranges(part%drive, whole%drive)
        call join_ranges(part%motor, whole%motor)
        do k = 1, size(whole%overload)
            call join_excess(part%overload(k), whole%overload(k))
        end do
        do k = 1, size(whole%pressure)
            call join_excess(part%pressure(k), whole%pressure(k))
            call join_excess(part%stroke(k), whole%stroke(k))
        end do
        call join_peaks(part%force, whole%force)
        call join_peaks(part%moment, whole%moment)
        do k = 1, size(whole%worst)
            call join_peaks(part%worst(k)%error, whole%worst(k)%error)
            whole%worst(k)%largest = max(whole%worst(k)%largest, part%worst(k)%largest)
        end do
    end subroutine join_summaries

    !> Later ones to those before.
    pure subroutine join_events(part, whole)
        type(event_type), intent(in) :: part
        type(event_type), intent(inout) :: whole

        if (whole%n == 0) whole%first = part%first
        whole%n = whole%n + part%n
    end subroutine join_events

    !> Note a peak; of values that are alike but for rounding, as a symmetric motion has, the first: which of them is the largest
    !> differs from machine to machine.
    pure subroutine raise_peak(value, time, place, peak)
        real(wp), intent(in) :: value, time
        integer, intent(in) :: place
        type(peak_type), intent(inout) :: peak
        real(wp), parameter :: alike = 1.0e-12_wp      !! thousands of roundings, and no digit that is printed

        if (peak%is_set) then
            if (.not. value > peak%value) return
            peak%value = value
            if (value <= peak%noted + alike*abs(peak%noted)) return
        end if
        peak = peak_type(value, value, time, place, .true.)
    end subroutine raise_peak

    !> The table.
    subroutine print_summary(model, layout, summary, solver, threads, seconds, output, unit)
        type(model_type), intent(in) :: model
        type(layout_type), intent(in) :: layout
        type(summary_type), intent(in) :: summary
        character(len=*), intent(in) :: solver
        integer, intent(in) :: threads
        real(wp), intent(in) :: seconds          !! spent computing
        character(len=*), intent(in) :: output       !! file written
        integer, intent(in) :: unit
        integer :: n_solved

        if (len_trim(model%scene%title) > 0) write (unit, "(a)") trim(model%scene%title)
        write (unit, "(a)") "  "//to_text(summary%n_sample)//trim(merge(" sample ", " samples", summary%n_sample == 1))//", "// &
            gravity_text(model%scene)//", solver "//solver// &
            ", "//to_text(threads)//trim(merge(" thread ", " threads", threads == 1))
        n_solved = max(1, summary%n_sample - summary%failure%n)
        if (summary%has_force) &
            call print_range("driving force", named_units(layout%dimension(dim_actuator)), summary%drive, unit)
        if (size(summary%motor%lowest) > 0) then
            call print_range("motor torque", named_units(layout%dimension(dim_motor), "N m"), summary%motor, unit)
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
        if (size(summary%worst) > 0) call print_errors(layout, summary%worst, unit)
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
            //times_text(summary%anew)
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
                    " % of the samples ("//times_text(summary%lift(k))//")"
            end do
        end subroutine print_lifts

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
                trim(layout%dimension(dim_joint)%label(peak%place))//", t = "//significant(peak%time)//" s"
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

    subroutine print_range(title, name, range, unit)
        character(len=*), intent(in) :: title
        character(len=*), intent(in) :: name(:)
        type(range_type), intent(in) :: range
        integer, intent(in) :: unit
        integer, parameter :: number_width = 12, time_width = 10
        real(wp) :: rms(size(name))
        integer :: k, width

        rms = sqrt(mean_of(range%square))
        width = max(len("driving force"), maxval(len_trim(name)))
        write (unit, "(a)") ""
        write (unit, "(a)") "  "//left(title, width)//right("lowest", number_width)// &
            right("at t [s]", time_width)//right("highest", number_width)//right("at t [s]", time_width)// &
            right("rms", number_width)
        do k = 1, size(name)
            if (.not. range%highest(k)%is_set) then
                write (unit, "(a)") "  "//left(name(k), width)//right("none", number_width)
                cycle
            end if
            write (unit, "(a)") "  "//left(name(k), width)// &
                right(significant(-range%lowest(k)%value), number_width)// &
                right(significant(range%lowest(k)%time), time_width)// &
                right(significant(range%highest(k)%value), number_width)// &
                right(significant(range%highest(k)%time), time_width)// &
                right(significant(rms(k)), number_width)
        end do
    end subroutine print_range

    !> The largest estimated errors with their places; which of them is the worst beside the largest value of its kind.
    subroutine print_errors(layout, worst, unit)
        type(layout_type), intent(in) :: layout
        type(error_peak_type), intent(in) :: worst(:)
        integer, intent(in) :: unit
        integer, parameter :: name_width = 24, number_width = 12, time_width = 10
        character(len=:), allocatable :: mark
        real(wp) :: relative(size(worst))
        integer :: i

        relative = worst%error%value/max(worst%largest, tiny(1.0_wp))
        write (unit, "(a)") ""
        write (unit, "(a)") "  "//left("estimated error", name_width)//right("largest", number_width)// &
            right("of at most", number_width)//right("at t [s]", time_width)//"  of"
        do i = 1, size(worst)
            if (.not. worst(i)%error%is_set) cycle
            mark = ""
            if (i == maxloc(relative, 1)) mark = "  (the worst)"
            associate (variable => layout%variable(worst(i)%place))
                write (unit, "(a)") "  "//left(trim(variable%name)//" ["//trim(worst(i)%unit)//"]", name_width)// &
                    right(rounded(worst(i)%error%value), number_width)//right(significant(worst(i)%largest), number_width)// &
                    right(significant(worst(i)%error%time), time_width)//"  "// &
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
            ", first at t = "//significant(summary%failure%first)//" s: "// &
            trim(sample_status_name(summary%first_failure))
        if (len_trim(summary%why) > 0) text = text//": "//trim(summary%why)
    end function failure_text

    !> When and why the assembly was lost first; blank if it was not.
    function reason_of_loss(summary) result(text)
        type(summary_type), intent(in) :: summary
        character(len=:), allocatable :: text

        text = ""
        if (len_trim(summary%why) > 0) text = "t = "//significant(summary%failure%first)//" s: "//trim(summary%why)
    end function reason_of_loss

    !> "3 samples, first at t = 0.72 s"
    function times_text(event) result(text)
        type(event_type), intent(in) :: event
        character(len=:), allocatable :: text

        text = to_text(event%n)//trim(merge(" sample ", " samples", event%n == 1))//", first at t = "//significant(event%first) &
               //" s"
    end function times_text

    !> "20 passed on the smooth continuation, the first before t = 0.72 s"
    function crossings_text(summary) result(text)
        type(summary_type), intent(in) :: summary
        character(len=:), allocatable :: text

        text = to_text(summary%n_passed)//" passed on the smooth continuation"
        if (summary%crossing%n > 0) text = text//", the first before t = "//significant(summary%crossing%first)//" s"
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

    !> Six significant digits, as a plain number where that is readable.
    pure function significant(value) result(text)
        real(wp), intent(in) :: value
        character(len=:), allocatable :: text
        character(len=32) :: buffer, form
        integer :: exponent

        buffer = "0"
        if (value /= 0) then
            exponent = floor(log10(abs(value)))
            if (exponent >= -4 .and. exponent < 7) then
                write (form, "('(f32.', i0, ')')") max(0, 5 - exponent)
                write (buffer, form) value
            else
                write (buffer, "(es32.5)") value
            end if
        end if
        text = trim(adjustl(buffer))
        if (index(text, ".") == len(text)) text = text(:len(text) - 1)
        if (index(text, ".") == 1) text = "0"//text
        if (index(text, "-.") == 1) text = "-0"//text(2:)
    end function significant

    pure function right(text, width) result(padded)
        character(len=*), intent(in) :: text
        integer, intent(in) :: width
        character(len=max(width, len(text) + 1)) :: padded

        padded = repeat(" ", len(padded) - len(text))//text
    end function right

    pure function left(text, width) result(padded)
        character(len=*), intent(in) :: text
        integer, intent(in) :: width
        character(len=width) :: padded

        padded = text
    end function left
end module linkdyn_summary
