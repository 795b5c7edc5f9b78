!> What a scene's records take, in words: operations of inverse dynamics from a motion to forces, and of forward dynamics from
!> a state to accelerations, by kind.
module linkdyn_explain_record
    use linkdyn_result_kinds, only: result_driving_force, result_reaction
    use linkdyn_equations, only: unknown_choice
    use linkdyn_forward_record, only: make_forward_rates
    use linkdyn_forward_state, only: state_layout, plan_layout
    use linkdyn_forward_unknowns, only: choose_unknowns
    use linkdyn_kernel, only: kernel_type, count_of
    use linkdyn_model, only: model_type
    use linkdyn_recorded_forces, only: recorded_forces, record_forces, free_recorded
    use linkdyn_recorded_rates, only: recorded_rates, free_rates
    use linkdyn_representatives, only: representative_poses, need_poses
    use linkdyn_status, only: status_type
    use linkdyn_text, only: to_text
    implicit none (type, external)
    private
    public :: explain_record, in_words

    character(len=*), parameter :: indent = "      "

contains

    subroutine explain_record(model, poses, unit)
        type(model_type), intent(in) :: model
        type(representative_poses), intent(inout) :: poses
        integer, intent(in) :: unit            !! open for formatted writing

        write (unit, "(/,a)") "Record of inverse dynamics"
        call need_poses(model, spread(model%start_q, 2, 1), poses)
        call explain_program("all unknowns", [result_driving_force, result_reaction])
        call explain_program("driving forces only", [result_driving_force])
        call explain_rates(model, poses, unit)
        write (unit, "(/,2x,a)") "Operations are sums, products and the like: a core does billions of them a second."

    contains

        subroutine explain_program(what, wanted)
            character(len=*), intent(in) :: what
            integer, intent(in) :: wanted(:)
            type(recorded_forces) :: recorded

            call record_forces(model, wanted, poses%q, poses%stand, recorded, poses%assembly%place)
            if (recorded%is_usable) then
                write (unit, "(2x,a)") what//": "//in_words(recorded%program%kernel)
            else if (size(wanted) > 1) then
                write (unit, "(2x,a)") "none: samples are computed by the equations above"
            end if
            call free_recorded(recorded)
        end subroutine explain_program
    end subroutine explain_record

    !> Explain the record of rates of a scene that can run forward by one.
    subroutine explain_rates(model, poses, unit)
        type(model_type), intent(in) :: model
        type(representative_poses), intent(inout) :: poses
        integer, intent(in) :: unit
        type(unknown_choice) :: unknown
        type(state_layout) :: layout
        type(recorded_rates) :: recorded
        type(status_type) :: status

        call choose_unknowns(model, unknown, status)
        if (.not. status%is_ok()) return
        if (.not. any(unknown%acceleration)) return
        call plan_layout(model, unknown%acceleration, layout)
        call make_forward_rates(model, layout, unknown, .true., poses, recorded)
        if (recorded%is_usable) then
            write (unit, "(/,a)") "Record of forward dynamics"
            write (unit, "(2x,a)") "rates: "//in_words(recorded%program%kernel)
        end if
        call free_rates(recorded)
    end subroutine explain_rates

    !> Operations a sample, those of one kind together, in lines that a page holds.
    function in_words(kernel) result(text)
        type(kernel_type), intent(in) :: kernel
        character(len=:), allocatable :: text
        integer, parameter :: most = 84
        integer :: start                         ! where the last line begins

        text = to_text(count_of(kernel, ""))//" operations a sample:"//new_line("a")//indent
        start = len(text) - len(indent)
        call add(number("multiply_add") + number("multiply_subtract") + number("subtract_product"), &
                 "product with a sum", "products with a sum")
        call add(number("multiply"), "product", "products")
        call add(number("add") + number("subtract"), "sum", "sums")
        call add(number("reciprocal"), "division", "divisions")
        call add(number("root"), "root", "roots")
        call add(number("sine") + number("cosine"), "sine or cosine", "sines and cosines")
        call add(number("arctangent"), "angle", "angles")
        call add(number("minimum") + number("maximum") + number("absolute") + number("select") + number("whole"), &
                 "choice", "choices")
        call add(number("piece") + number("nearest") + number("farthest"), "look-up in a curve", "look-ups in curves")

    contains

        integer function number(name)
            character(len=*), intent(in) :: name

            number = count_of(kernel, name)
        end function number

        subroutine add(n, one, many)
            integer, intent(in) :: n
            character(len=*), intent(in) :: one, many
            character(len=:), allocatable :: what

            if (n == 0) return
            what = many
            if (n == 1) what = one
            if (len(text) > start + len(indent)) text = text//","
            if (len(text) - start + len(what) + 8 > most) then
                text = text//new_line("a")//indent
                start = len(text) - len(indent)
            else if (len(text) > start + len(indent)) then
                text = text//" "
            end if
            text = text//to_text(n)//" "//what
        end subroutine add
    end function in_words
end module linkdyn_explain_record
