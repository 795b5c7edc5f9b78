!> Events of a forward run in words.
module linkdyn_event_words
    use linkdyn_event_log, only: event_log, event_entry, kind_name, kind_crossing
    use linkdyn_event_sides, only: n_side
    use linkdyn_model, only: model_type
    use linkdyn_results, only: event_side
    use linkdyn_text, only: to_text, quoted
    implicit none (type, external)
    private
    public :: event_in_words, side_in_words

contains

    !> "0.45152 s impact 'floor.min', 7.97 N s, 7.06 J lost"
    function event_in_words(model, entry) result(text)
        type(model_type), intent(in) :: model
        type(event_entry), intent(in) :: entry
        character(len=:), allocatable :: text

        text = to_text(entry%t)//" s "//name_in_words(model, entry)
        if (entry%kind == kind_crossing) text = text//trim(merge(" up  ", " down", entry%direction > 0))
        if (entry%impulse > 0) text = text//", "//to_text(entry%impulse)//" "//unit_of_impulse(model, entry)
        if (entry%loss > 0) text = text//", "//to_text(entry%loss)//" J lost"
    end function event_in_words

    !> "just before impact 'floor.min'"
    function side_in_words(model, log, sample) result(text)
        type(model_type), intent(in) :: model
        type(event_log), intent(in) :: log
        integer, intent(in) :: sample                  !! of those beside events, see `sort_by_events`
        character(len=:), allocatable :: text

        text = "just "//event_side(1 + modulo(sample - 1, n_side))//" " &
               //name_in_words(model, log%entry(1 + (sample - 1)/n_side))
    end function side_in_words

    function name_in_words(model, entry) result(text)
        type(model_type), intent(in) :: model
        type(event_entry), intent(in) :: entry
        character(len=:), allocatable :: text

        text = trim(kind_name(entry%kind))//" "//quoted(model%scene%event(entry%event)%name)
    end function name_in_words

    pure function unit_of_impulse(model, entry) result(unit)
        type(model_type), intent(in) :: model
        type(event_entry), intent(in) :: entry
        character(len=:), allocatable :: unit

        associate (event => model%scene%event(entry%event))
            if (event%clutch > 0) then
                unit = trim(merge("N s  ", "N m s", model%scene%clutch(event%clutch)%unit == "N"))
                return
            end if
        end associate
        associate (stop => model%scene%stop(model%scene%event(entry%event)%stop))
            unit = trim(merge("N s  ", "N m s", model%scene%laws%measure(stop%measure)%length_power == 1))
        end associate
    end function unit_of_impulse
end module linkdyn_event_words
