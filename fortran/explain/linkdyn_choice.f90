!> Which assembly a mechanism has at its start, and what decided it, in words.
module linkdyn_choice
    use linkdyn_model, only: model_type, step_type, step_csp, step_rus, step_pus, step_hung, step_group, is_led_dyad, &
        by_branch, by_start, by_markers, by_fit
    use linkdyn_text, only: to_text, join
    implicit none (type, external)
    private
    public :: has_choice, choice_in_words, choices_in_words, sharing_in_words

contains

    !> Are there several assemblies to choose from?
    pure logical function has_choice(model, step)
        type(model_type), intent(in) :: model
        type(step_type), intent(in) :: step

        has_choice = step%has_branches
        if (step%kind == step_group) has_choice = model%group(step%first)%n_found /= 1
    end function has_choice

    !> "branch +1, nearest to 'start'", "one of 4, nearest to joint variables of zero".
    function choice_in_words(model, step) result(text)
        type(model_type), intent(in) :: model
        type(step_type), intent(in) :: step
        character(len=:), allocatable :: text
        integer :: chosen_by

        if (step%kind == step_group) then
            chosen_by = model%group(step%first)%chosen_by
            text = ""
            if (model%group(step%first)%n_found > 1) text = "one of "//to_text(model%group(step%first)%n_found)//" found, "
        else
            chosen_by = model%chosen_by(step%first)
            text = "branch "//trim(merge("+1", "-1", model%branch(step%first) > 0))//", "
        end if
        select case (chosen_by)
        case (by_branch)
            text = text//"as 'branch' says"
        case (by_start)
            text = text//trim(merge("nearest to 'start'", "as 'start' says   ", len(text) > 0))
        case (by_markers)
            text = text//"as the markers are written"
        case (by_fit)
            text = text//"for all joints to fit"
        case default
            if (any(step%kind == [step_group, step_csp, step_rus, step_pus, step_hung]) .or. is_led_dyad(step)) then
                text = text//"nearest to joint variables of zero"
            else
                text = text//"since nothing says otherwise"
            end if
        end select
        if (step%kind /= step_group) return
        if (model%group(step%first)%n_passed_over > 0) text = text//" of those with which the loops behind close"
    end function choice_in_words

    !> The same for all loops of a mechanism, in one line; blank if there was no choice.
    function choices_in_words(model) result(text)
        type(model_type), intent(in) :: model
        character(len=:), allocatable :: text
        integer, parameter :: most = 3           !! loops told one by one
        integer :: i, n

        text = ""
        n = 0
        do i = 1, size(model%step)
            associate (step => model%step(i))
                if (.not. has_choice(model, step)) cycle
                n = n + 1
                if (n > most) cycle
                if (n > 1) text = text//"; "
                if (step%kind == step_group) then
                    text = text//join(model%link(model%group(step%first)%link)%name)
                else
                    text = text//join(model%link(step%link(:step%n_link))%name)
                end if
                text = text//": "//choice_in_words(model, step)
            end associate
        end do
        if (n > most) text = text//"; and "//to_text(n - most)//" more"
    end function choices_in_words

    !> What decides between more drives than freedoms.
    function sharing_in_words(model) result(text)
        type(model_type), intent(in) :: model
        character(len=:), allocatable :: text

        text = to_text(model%n_actuator)//" drives share the work of "//to_text(model%n_q) &
               //trim(merge(" coordinate ", " coordinates", model%n_q == 1))//": taken is the least sum of squares"
    end function sharing_in_words
end module linkdyn_choice
