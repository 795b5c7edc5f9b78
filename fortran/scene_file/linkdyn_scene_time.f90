!> Instants of the run along a scene's motion: the table [time], or what follows from the laws.
module linkdyn_scene_time
    use linkdyn_kinds, only: wp
    use linkdyn_constants, only: two_pi
    use linkdyn_status, only: status_type
    use linkdyn_text, only: to_text
    use linkdyn_heard_tables, only: hearing, heard_table, list_tables, find_short_table, short_in_words, table_in_words
    use linkdyn_scene, only: scene_type, law_spec, measure_spec, law_none, law_table, law_constant_rate, measure_joint, &
        coordinate_joint
    use linkdyn_laws, only: law_end, evaluate_law
    use linkdyn_table, only: lies_within
    use linkdyn_time_laws, only: owned_law, list_laws, part_motion, part_frame, part_payload, part_load
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
    type(span_type) function span_of(scene) result(span)
        type(scene_type), intent(in), target :: scene
        type(owned_law), allocatable :: list(:)
        integer :: i

        call list_laws(scene, list)
        do i = 1, size(list)
            if (any([part_motion, part_frame, part_payload, part_load] == list(i)%part)) call add_law(list(i)%law, span)
        end do
        ! A crank that turns for ever: one turn of it.
        do i = 1, size(scene%coordinate)
            associate (motion => scene%coordinate(i)%motion)
                if (motion%kind /= law_constant_rate .or. scene%coordinate(i)%unit /= "rad") cycle
                if (abs(motion%value(2)) > 0) span%law_end = max(span%law_end, two_pi/abs(motion%value(2)))
            end associate
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

    !> A table says nothing before its first row and after its last: neither about instants, nor about a coordinate that has a
    !> motion, whose course along the run is known.
    subroutine require_tables_cover(root, scene, status)
        type(scene_place), intent(in) :: root
        type(scene_type), intent(in) :: scene
        type(status_type), intent(inout) :: status
        type(heard_table), allocatable :: heard(:)
        type(scene_place) :: place
        integer :: i

        if (.not. status%is_ok()) return
        call list_tables(scene, hearing(), heard)
        i = find_short_table(heard, scene%time%first, scene%time%last)
        if (i > 0) then
            place = root
            place%what = heard(i)%owner
            call refuse(place, short_in_words(heard(i), scene%time%first, scene%time%last, "run"), status, heard(i)%line)
        end if
        do i = 1, size(heard)
            if (heard(i)%measure > 0) call require_state_cover(root, scene, heard(i), status)
        end do
    end subroutine require_tables_cover

    subroutine require_state_cover(root, scene, table, status)
        type(scene_place), intent(in) :: root
        type(scene_type), intent(in) :: scene
        type(heard_table), intent(in) :: table         !! over the state
        type(status_type), intent(inout) :: status
        type(scene_place) :: place
        real(wp) :: reached(2)
        logical :: is_known

        if (.not. status%is_ok()) return
        call find_range(scene, scene%laws%measure(table%measure), reached, is_known)
        if (.not. is_known) return
        if (all(lies_within(table%first, table%last, reached))) return
        place = root
        place%what = table%owner
        associate (law => scene%laws%law(table%number))
            call refuse(place, table_in_words(table)//" covers "//trim(law%over_name)//" = "//to_text(table%first)//" to "// &
                to_text(table%last)//" "//trim(law%over_unit)//" (expected "//to_text(reached(1))//" to "//to_text(reached(2))// &
                " "//trim(law%over_unit)//", which the motion passes)", status, table%line)
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

        reached = 0
        is_known = .false.
        if (measure%kind /= measure_joint) return
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
end module linkdyn_scene_time
