!> What the engineer wants to know first, gathered from the results block by block: peaks and rms of the driving forces, the largest
!> reaction, how many samples failed, what was asked of drives that they do not have.
module linkdyn_summary
    use linkdyn_assembly_trail, only: reached_crossing, reached_anew
    use linkdyn_cylinder_laws, only: cylinder_force
    use linkdyn_event_sides, only: n_side
    use linkdyn_kinds, only: wp
    use linkdyn_result_kinds, only: result_time, result_driving_force, result_motor_torque, result_reaction, result_status, &
        result_assembly, result_torque_margin, result_joint_variable, result_contact_force, result_controller_limited
    use linkdyn_results, only: layout_type, variable_type, block_type, view_values, label_len, dim_actuator, dim_motor, &
        dim_variable, dim_cam, dim_controller, variable_index, samples_width, estimated, estimate_of
    use linkdyn_roads, only: road_counts, operator(+)
    use linkdyn_scene, only: scene_type, cylinder_spec, has_hard_stops, n_stop, variable_name, measure_joint
    use linkdyn_status, only: sample_ok, sample_singular, message_len
    use linkdyn_time_mean, only: time_mean, start_mean, add_sample, join_means
    implicit none (type, external)
    private
    public :: summary_type, start_summary, add_to_summary, add_events_to_summary, join_summaries
    public :: peak_type, event_type, error_peak_type, range_type, excess_type

    real(wp), parameter :: touch = 1.0e-9_wp             !! [m, rad] a motion that ends at a stop is not beyond it
    real(wp), parameter :: rounded_share = 1.0e-9_wp     !! what is at its limit but for rounding is not beyond it

    !> A largest value with its place.
    type :: peak_type
        real(wp) :: value = 0
        real(wp) :: noted = 0    !! the value at `time`: that, but for rounding
        real(wp) :: time = 0
        integer :: place = 0     !! joint
        integer :: beside = 0    !! it is just before or behind an event, sample of these; 0: it is a sample of the run
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
        type(peak_type) :: error = peak_type()    !! `place`: of the value in a sample
        real(wp) :: largest = 0                   !! value
    end type error_peak_type

    !> How far values go.
    type :: range_type
        type(peak_type), allocatable :: lowest(:), highest(:)   !! of minus the value, of the value
        type(time_mean) :: square
    end type range_type

    !> Samples in which more is asked of a drive than it has.
    type :: excess_type
        type(event_type) :: event
        type(peak_type) :: lack                  !! the largest, also beside events
        real(wp) :: asked = 0                    !! there
    end type excess_type

    !> Figures gathered block by block.
    type :: summary_type
        integer :: n_sample = 0
        logical :: has_time = .true.                            !! else the number of a sample, from 0, stands for its instant
        integer :: n_before = 0                                 !! samples of the run before the first of these
        type(event_type) :: failure
        integer :: first_failure = sample_ok                    !! status of that sample
        character(len=message_len) :: why = ""                  !! it failed; blank: its status says it all
        type(event_type) :: crossing                            !! samples behind a change point that none before is behind
        integer :: n_passed = 0                                 !! change points, since the start of the motion
        type(event_type), allocatable :: beyond(:)              !! a stop that throws back (n_stop); not allocated: nobody has
                                                                !! looked
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

    subroutine start_summary(layout, summary, n_before)
        type(layout_type), intent(in) :: layout
        type(summary_type), intent(out) :: summary
        integer, intent(in), optional :: n_before    !! samples of the run that others sum up; absent: none
        integer :: i

        summary%has_time = variable_index(layout, result_time) > 0
        if (present(n_before)) summary%n_before = n_before
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

        call add_sample(t, is_good, value**2, range%square)
        if (is_good) call widen_range(value, t, range)
    end subroutine add_to_range

    pure subroutine widen_range(value, t, range, beside)
        real(wp), intent(in) :: value(:)
        real(wp), intent(in) :: t                    !! [s]
        type(range_type), intent(inout) :: range
        integer, intent(in), optional :: beside      !! as of `raise_peak`
        integer :: k

        do k = 1, size(value)
            call raise_peak(-value(k), t, k, range%lowest(k), beside)
            call raise_peak(value(k), t, k, range%highest(k), beside)
        end do
    end subroutine widen_range

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

        if (later%is_set) call raise_peak(later%value, later%time, later%place, peak, later%beside)
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
        real(wp), pointer :: force(:, :), torque(:, :), margin(:, :), reaction(:, :, :), press(:, :), variable(:, :)
        integer, pointer :: code(:), assembly(:), limited(:, :)
        real(wp) :: time(n)
        integer :: i, k, n_force

        time = instants_of(layout, block, n, summary)
        call view_values(layout, result_status, n, block, code)
        call view_values(layout, result_assembly, n, block, assembly)
        call view_values(layout, result_driving_force, n, block, force)
        call view_values(layout, result_motor_torque, n, block, torque)
        call view_values(layout, result_torque_margin, n, block, margin)
        call view_values(layout, result_reaction, n, block, reaction)
        call view_values(layout, result_contact_force, n, block, press)
        call view_values(layout, result_controller_limited, n, block, limited)
        call view_values(layout, result_joint_variable, n, block, variable)
        if (present(scene)) call look_at_stops(layout, scene, block, time, summary%beyond)
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
            call raise_reactions(n_force, reaction(:, :, i), time(i), summary)
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

    subroutine raise_reactions(n_force, reaction, t, summary, beside)
        integer, intent(in) :: n_force               !! components that are forces; the others are moments
        real(wp), intent(in) :: reaction(:, :)       !! (component, joint)
        real(wp), intent(in) :: t                    !! [s]
        type(summary_type), intent(inout) :: summary
        integer, intent(in), optional :: beside      !! as of `raise_peak`
        integer :: k

        do k = 1, size(reaction, 2)
            call raise_peak(sum(reaction(:n_force, k)**2), t, k, summary%force, beside)
            call raise_peak(sum(reaction(n_force + 1:, k)**2), t, k, summary%moment, beside)
        end do
    end subroutine raise_reactions

    !> Take in what is just before and just behind the events of a run: it takes no time, but may be the largest. Behind all blocks
    !> of samples.
    subroutine add_events_to_summary(layout, block, instant, summary)
        type(layout_type), intent(in) :: layout      !! of the results on both sides
        type(block_type), intent(in), target :: block    !! two samples an event
        real(wp), intent(in) :: instant(:)           !! of the events [s]
        type(summary_type), intent(inout) :: summary
        real(wp), pointer :: force(:, :), torque(:, :), margin(:, :), reaction(:, :, :)
        integer, pointer :: code(:)
        integer :: i, k, n

        n = n_side*size(instant)
        call view_values(layout, result_status, n, block, code)
        call view_values(layout, result_driving_force, n, block, force)
        call view_values(layout, result_motor_torque, n, block, torque)
        call view_values(layout, result_torque_margin, n, block, margin)
        call view_values(layout, result_reaction, n, block, reaction)
        do i = 1, n
            if (code(i) /= sample_ok) cycle
            associate (t => instant(1 + (i - 1)/n_side))
                if (associated(force)) call widen_range(force(:, i), t, summary%drive, i)
                if (associated(torque)) call widen_range(torque(:, i), t, summary%motor, i)
                do k = 1, size(summary%overload)
                    if (lacks_torque(torque(k, i), margin(k, i))) &
                        call raise_excess(-margin(k, i), abs(torque(k, i)), t, summary%overload(k), i)
                end do
                if (associated(reaction)) call raise_reactions(merge(2, 3, layout%planar), reaction(:, :, i), t, summary, i)
            end associate
        end do
    end subroutine add_events_to_summary

    !> When the samples are: their instants, or their numbers where they have none.
    function instants_of(layout, block, n, summary) result(time)
        type(layout_type), intent(in) :: layout
        type(block_type), intent(in), target :: block
        integer, intent(in) :: n                     !! samples
        type(summary_type), intent(in) :: summary    !! without them
        real(wp) :: time(n)
        real(wp), pointer :: instant(:)
        integer :: i

        call view_values(layout, result_time, n, block, instant)
        if (associated(instant)) then
            time = instant
        else
            time = [(summary%n_before + summary%n_sample + i - 1, i=1, n)]
        end if
    end function instants_of

    !> Motors with less torque than is asked of them, but for rounding: what is saturated is not beyond its limit.
    subroutine note_overload(torque, margin, t, overload)
        real(wp), intent(in) :: torque(:), margin(:) !! (motor) [N m]
        real(wp), intent(in) :: t                    !! [s]
        type(excess_type), intent(inout) :: overload(:)
        integer :: k

        do k = 1, size(overload)
            if (lacks_torque(torque(k), margin(k))) call note_excess(-margin(k), abs(torque(k)), t, overload(k))
        end do
    end subroutine note_overload

    elemental logical function lacks_torque(torque, margin)
        real(wp), intent(in) :: torque, margin       !! [N m]

        lacks_torque = margin < -rounded_share*abs(torque)
    end function lacks_torque

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
        call raise_excess(lack, asked, t, excess)
    end subroutine note_excess

    subroutine raise_excess(lack, asked, t, excess, beside)
        real(wp), intent(in) :: lack, asked
        real(wp), intent(in) :: t                    !! [s]
        type(excess_type), intent(inout) :: excess
        integer, intent(in), optional :: beside      !! as of `raise_peak`
        real(wp) :: noted

        noted = excess%lack%noted
        call raise_peak(lack, t, 1, excess%lack, beside)
        if (excess%lack%noted > noted) excess%asked = asked
    end subroutine raise_excess

    !> Later ones to those before.
    subroutine join_excess(part, whole)
        type(excess_type), intent(in) :: part
        type(excess_type), intent(inout) :: whole

        if (part%event%n == 0) return
        call join_events(part%event, whole%event)
        call join_peaks(part%lack, whole%lack)
        if (whole%lack%time == part%lack%time) whole%asked = part%asked
    end subroutine join_excess

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

    !> Samples beyond stops that throw back, as far as joint variables are among the results.
    subroutine look_at_stops(layout, scene, block, time, beyond)
        type(layout_type), intent(in) :: layout
        type(scene_type), intent(in) :: scene
        type(block_type), intent(in), target :: block
        real(wp), intent(in) :: time(:)              !! of the samples, as of `instants_of`
        type(event_type), allocatable, intent(inout) :: beyond(:)
        real(wp), pointer :: variable(:, :)
        integer :: i, k, v

        if (.not. has_hard_stops(scene)) return
        if (.not. allocated(beyond)) allocate (beyond(n_stop(scene)))
        call view_values(layout, result_joint_variable, size(time), block, variable)
        if (.not. associated(variable)) return
        do k = 1, n_stop(scene)
            associate (stop => scene%stop(k), measure => scene%laws%measure(scene%stop(k)%measure), &
                       label => layout%dimension(dim_variable)%label)
                if (measure%kind /= measure_joint .or. .not. stop%is_hard) cycle
                v = findloc(label, trim(scene%joint(measure%joint)%name)//"."// &
                            trim(variable_name(measure%variable, scene%joint(measure%joint)%kind)), dim=1)
                if (v == 0) cycle
                do i = 1, size(time)
                    if (stop%side*(variable(v, i) - stop%bound) > touch) call count_event(time(i), beyond(k))
                end do
            end associate
        end do
    end subroutine look_at_stops

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
    pure subroutine raise_peak(value, time, place, peak, beside)
        real(wp), intent(in) :: value, time
        integer, intent(in) :: place
        type(peak_type), intent(inout) :: peak
        integer, intent(in), optional :: beside        !! see there; absent: a sample of the run
        real(wp), parameter :: alike = 1.0e-12_wp      !! thousands of roundings, and no digit that is printed

        if (peak%is_set) then
            if (.not. value > peak%value) return
            peak%value = value
            if (value <= peak%noted + alike*abs(peak%noted)) return
        end if
        peak = peak_type(value=value, noted=value, time=time, place=place, is_set=.true.)
        if (present(beside)) peak%beside = beside
    end subroutine raise_peak
end module linkdyn_summary
