!> Instants of the run along a scene's motion: the table [time], or what follows from the laws.
module linkdyn_scene_time
    use linkdyn_kinds, only: wp
    use linkdyn_constants, only: two_pi
    use linkdyn_status, only: status_type
    use linkdyn_text, only: to_text, quoted
    use linkdyn_scene, only: scene_type, law_spec, measure_spec, law_none, law_table, law_over, law_constant_rate, &
        measure_time, measure_joint, coordinate_joint
    use linkdyn_laws, only: law_end, evaluate_law
    use linkdyn_table, only: lies_within
    use linkdyn_toml, only: toml_node
    use linkdyn_units, only: time_span
    use linkdyn_scene_keys, only: scene_place, place_at, refuse, refuse_value, refuse_missing, allow_keys, &
        require_table, get_quantity, get_integer
    use linkdyn_scene_laws, only: require_positive
    implicit none (type, external)
    private
    public :: read_time

    integer, parameter :: usual_n_sample = 201     !! of a run that does not say

    !> Where all tables of a scene have values, and how long its laws last.
    type :: span_type
        real(wp) :: first = -huge(1.0_wp)
        real(wp) :: last = huge(1.0_wp)
        real(wp) :: law_end = 0
    end type span_type

contains

    !> Fill `scene%time`, and refuse instants for which a table has no values.
    subroutine read_time(root, scene, status)
        type(scene_place), intent(in) :: root
        type(scene_type), intent(inout) :: scene
        type(status_type), intent(inout) :: status
        type(scene_place) :: place
        type(toml_node) :: node
        type(span_type) :: span
        real(wp) :: step
        logical :: has_start, has_end, has_step, has_samples

        if (.not. status%is_ok()) return
        node = root%node%get("time")
        if (.not. node%is_present()) then
            if (size(scene%coordinate) == 0) return
            if (any(scene%coordinate%motion%kind == law_none)) return
        end if
        place = place_at(root, node, "time")
        if (node%is_present()) then
            call require_table(place, "a table with start, end, and step or samples, written [time]", status)
            call allow_keys(place, [character(len=7) :: "start", "end", "step", "samples"], status)
        end if
        span = span_of(scene)
        associate (time => scene%time)
            time%first = 0
            if (span%first > 0 .or. span%last < 0) time%first = span%first
            call get_quantity(place, "start", time_span, time%first, status, has_start)
            time%last = max(time%first, span%law_end)
            call get_quantity(place, "end", time_span, time%last, status, has_end)
            call get_quantity(place, "step", time_span, step, status, has_step)
            call get_integer(place, "samples", time%n_sample, status, has_samples)
            if (.not. status%is_ok()) return
            if (has_step .and. has_samples) then
                call refuse(place, "has both 'step' and 'samples' (expected one of them)", status)
            else if (time%last < time%first) then
                call refuse(place, "ends at "//to_text(time%last)//" s, before it starts at "//to_text(time%first)// &
                    " s (expected an end after the start)", status)
            else if (has_samples) then
                call check_samples(place, time%n_sample, time%last > time%first, has_end, status)
            else if (has_step) then
                call require_positive(place, "step", step, "s", status)
                call samples_of_step(place, step, time%last - time%first, time%n_sample, status)
            else
                time%n_sample = merge(usual_n_sample, 1, time%last > time%first)
            end if
        end associate
        call require_tables_cover(root, scene, status)
    end subroutine read_time

    !> Two samples or more for a stretch of time, one for an instant.
    subroutine check_samples(place, n_sample, is_stretch, has_end, status)
        type(scene_place), intent(in) :: place
        integer, intent(in) :: n_sample
        logical, intent(in) :: is_stretch, has_end
        type(status_type), intent(inout) :: status

        if (is_stretch .and. n_sample < 2) then
            call refuse_value(place, "samples", place%node%get("samples"), "= "//to_text(n_sample)// &
                " (expected two or more, both ends included)", status)
        else if (n_sample < 1) then
            call refuse_value(place, "samples", place%node%get("samples"), "= "//to_text(n_sample)// &
                " (expected one or more)", status)
        else if (.not. is_stretch .and. n_sample > 1 .and. .not. has_end) then
            call refuse_missing(place, "end", "a time: no law of this scene has an end", status)
        else if (.not. is_stretch .and. n_sample > 1) then
            call refuse_value(place, "samples", place%node%get("samples"), "= "//to_text(n_sample)// &
                " for a single instant (expected 1, or an end after the start)", status)
        end if
    end subroutine check_samples

    !> Both ends are samples, so the step must divide the time between them.
    subroutine samples_of_step(place, step, duration, n_sample, status)
        type(scene_place), intent(in) :: place
        real(wp), intent(in) :: step, duration         !! [s]
        integer, intent(out) :: n_sample
        type(status_type), intent(inout) :: status
        real(wp) :: n_step

        n_sample = 1
        if (.not. status%is_ok()) return
        n_step = duration/step
        if (.not. n_step < real(huge(n_sample), wp)/2) then
            call refuse_value(place, "step", place%node%get("step"), "= "//to_text(step)//" s makes too many samples "// &
                "(expected a larger step)", status)
        else if (abs(n_step - anint(n_step)) > 1.0e-6_wp .or. (duration > 0 .and. n_step < 0.5_wp)) then
            call refuse_value(place, "step", place%node%get("step"), "= "//to_text(step)//" s does not divide the "// &
                to_text(duration)//" s from start to end (expected a whole number of steps)", status)
        else
            n_sample = nint(n_step) + 1
        end if
    end subroutine samples_of_step

    !> The range that all tables share, and the latest end of the laws.
    pure type(span_type) function span_of(scene) result(span)
        type(scene_type), intent(in) :: scene
        integer :: i, j

        do i = 1, size(scene%coordinate)
            associate (motion => scene%coordinate(i)%motion)
                call add_law(motion, span)
                ! A crank that turns for ever: one turn of it.
                if (motion%kind == law_constant_rate .and. scene%coordinate(i)%unit == "rad") then
                    if (abs(motion%value(2)) > 0) span%law_end = max(span%law_end, two_pi/abs(motion%value(2)))
                end if
            end associate
        end do
        do i = 1, size(scene%base%motion)
            call add_law(scene%base%motion(i), span)
        end do
        do i = 1, size(scene%payload)
            call add_law(scene%payload(i)%mass, span)
        end do
        do i = 1, size(scene%load)
            do j = 1, 3
                call add_law(scene%load(i)%force(j), span)
                call add_law(scene%load(i)%moment(j), span)
            end do
        end do
    end function span_of

    pure subroutine add_law(law, span)
        type(law_spec), intent(in) :: law
        type(span_type), intent(inout) :: span

        span%law_end = max(span%law_end, law_end(law))
        if (law%kind /= law_table) return
        span%first = max(span%first, law%time(1))
        span%last = min(span%last, law%time(size(law%time)))
    end subroutine add_law

    !> A table says nothing about instants before its first row and after its last.
    subroutine require_tables_cover(root, scene, status)
        type(scene_place), intent(in) :: root
        type(scene_type), intent(in) :: scene
        type(status_type), intent(inout) :: status
        integer :: i, j

        do i = 1, size(scene%coordinate)
            associate (coordinate => scene%coordinate(i))
                call require_cover(root, scene, coordinate%motion, "coordinate "//quoted(coordinate%name), &
                    coordinate%line, status)
            end associate
        end do
        do i = 1, size(scene%payload)
            associate (payload => scene%payload(i))
                call require_cover(root, scene, payload%mass, "payload on "//quoted(payload%name), payload%line, status)
            end associate
        end do
        do i = 1, size(scene%base%motion)
            call require_cover(root, scene, scene%base%motion(i), "motion of the frame", scene%base%line, status)
        end do
        do i = 1, size(scene%load)
            do j = 1, 3
                associate (load => scene%load(i))
                    call require_cover(root, scene, load%force(j), "load on "//quoted(load%name), load%line, status)
                    call require_cover(root, scene, load%moment(j), "load on "//quoted(load%name), load%line, status)
                    call require_state_cover(root, scene, load%force(j), "load on "//quoted(load%name), load%line, status)
                    call require_state_cover(root, scene, load%moment(j), "load on "//quoted(load%name), load%line, status)
                end associate
            end do
        end do
    end subroutine require_tables_cover

    !> A table over the instant or over a coordinate that has a motion: what it is entered with along the run is known.
    subroutine require_state_cover(root, scene, spec, what, line, status)
        type(scene_place), intent(in) :: root
        type(scene_type), intent(in) :: scene
        type(law_spec), intent(in) :: spec
        character(len=*), intent(in) :: what
        integer, intent(in) :: line
        type(status_type), intent(inout) :: status
        type(scene_place) :: place
        real(wp) :: reached(2)
        logical :: is_known

        if (.not. status%is_ok() .or. spec%kind /= law_over) return
        associate (law => scene%laws%law(spec%law))
            if (law%over <= 0 .or. law%period > 0) return
            call find_range(scene, scene%laws%measure(law%over), reached, is_known)
            if (.not. is_known) return
            associate (knot => law%table%time, n => size(law%table%time))
                if (all(lies_within(knot(1), knot(n), reached))) return
                place = root
                place%what = what
                call refuse(place, "its table covers "//trim(law%over_name)//" = "//to_text(knot(1))//" to "//to_text(knot(n))// &
                    " "//trim(law%over_unit)//" (expected "//to_text(reached(1))//" to "//to_text(reached(2))//" "// &
                    trim(law%over_unit)//", which the motion passes)", status, line)
            end associate
        end associate
    end subroutine require_state_cover

    !> Smallest and largest value of a measure at the instants of the run, if the coordinates' motion tells.
    subroutine find_range(scene, measure, reached, is_known)
        type(scene_type), intent(in) :: scene
        type(measure_spec), intent(in) :: measure
        real(wp), intent(out) :: reached(2)
        logical, intent(out) :: is_known
        real(wp) :: q, rate, rate2
        integer :: i, k

        reached = [scene%time%first, scene%time%last]
        is_known = measure%kind == measure_time
        if (is_known .or. measure%kind /= measure_joint) return
        do k = 1, size(scene%coordinate)
            associate (c => scene%coordinate(k))
                if (c%kind /= coordinate_joint .or. c%joint /= measure%joint .or. c%variable /= measure%variable) cycle
                if (c%motion%kind == law_none) return
                is_known = .true.
                reached = [huge(q), -huge(q)]
                do i = 1, max(1, scene%time%n_sample)
                    call evaluate_law(c%motion, instant(i), q, rate, rate2)
                    if (measure%is_rate) q = rate
                    reached = [min(reached(1), q), max(reached(2), q)]
                end do
            end associate
        end do

    contains

        pure real(wp) function instant(i)
            integer, intent(in) :: i

            instant = scene%time%first
            if (scene%time%n_sample > 1) instant = scene%time%first + (scene%time%last - scene%time%first) &
                                                                      *(real(i - 1, wp)/real(scene%time%n_sample - 1, wp))
        end function instant
    end subroutine find_range

    subroutine require_cover(root, scene, law, what, line, status)
        type(scene_place), intent(in) :: root
        type(scene_type), intent(in) :: scene
        type(law_spec), intent(in) :: law
        character(len=*), intent(in) :: what
        integer, intent(in) :: line
        type(status_type), intent(inout) :: status
        type(scene_place) :: place
        real(wp) :: slack, first, last

        if (.not. status%is_ok() .or. law%kind /= law_table) return
        first = law%time(1)
        last = law%time(size(law%time))
        slack = 16*epsilon(slack)*max(abs(first), abs(last))    ! as evaluate_law allows
        if (scene%time%first >= first - slack .and. scene%time%last <= last + slack) return
        place = root
        place%what = what
        call refuse(place, "its table covers "//to_text(first)//" s to "//to_text(last)//" s (expected "// &
            to_text(scene%time%first)//" s to "//to_text(scene%time%last)//" s, the time of the run)", status, line)
    end subroutine require_cover
end module linkdyn_scene_time
