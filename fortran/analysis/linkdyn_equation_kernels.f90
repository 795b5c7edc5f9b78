!> The kernels of one choice of equations: each is made when it is wanted first, and then serves all threads.
module linkdyn_equation_kernels
    use linkdyn_equation_programs, only: equation_choice, written_equations, matrix_form, open_equations, close_equations, &
        make_matrix_program, make_solving_program, make_answer_program, make_sliding_program, has_columns, nothing_else
    use linkdyn_inputs, only: sample_set
    use linkdyn_lane_programs, only: lane_program, prepare_lanes, free_lane_program
    use linkdyn_lock, only: hold_records, release_records, hold_texts, release_texts
    use linkdyn_model, only: model_type
    use linkdyn_representatives, only: representative_motions
    use linkdyn_row_order, only: order_rows
    use linkdyn_scene, only: pulls_in_line
    implicit none (type, external)
    private
    public :: equation_kernels, answer_kernels, make_kernels, free_kernels, need_matrix, need_solving, need_answers, need_sliding, &
        slides_or_pulls

    !> Kernels of some results.
    type :: answer_kernels
        integer, allocatable :: wanted(:)              !! `result_*`, `out_*`
        type(lane_program) :: solving                  !! unknowns and these, by pivots that serve representative poses
        integer, allocatable :: solved_for(:)          !! which unknowns come of it
        integer :: n_watched = 0                       !! pivots that raise its alarm where they become small
        type(lane_program) :: answers                  !! these, of unknowns that are given
        logical, private :: has_solving = .false., has_answers = .false.
        type(answer_kernels), pointer, private :: next => null()
    end type answer_kernels

    type :: equation_kernels
        type(equation_choice) :: choice
        logical :: wants_reactions = .true.            !! else the unknowns are driving forces and accelerations
        logical :: wants_right = .true.                !! right-hand sides beside the matrix
        logical :: wants_order = .false.               !! of the rows, so that no pivots are needed
        type(lane_program) :: matrix                   !! entries and right-hand sides
        type(matrix_form) :: form
        integer, allocatable :: place(:)               !! of the rows: in that order, if it is wanted
        type(lane_program) :: sliding                  !! what is asked before anything acts
        type(answer_kernels), pointer, private :: first => null()
        logical, private :: has_matrix = .false., has_sliding = .false.
    end type equation_kernels

contains

    subroutine make_kernels(choice, wants_reactions, wants_order, kernels)
        type(equation_choice), intent(in) :: choice
        logical, intent(in) :: wants_reactions, wants_order
        type(equation_kernels), pointer, intent(out) :: kernels

        allocate (kernels)
        kernels%choice = choice
        kernels%wants_reactions = wants_reactions
        kernels%wants_order = wants_order
        kernels%has_matrix = choice%way == nothing_else    ! there is none
    end subroutine make_kernels

    !> Nobody may be using them.
    subroutine free_kernels(kernels)
        type(equation_kernels), pointer, intent(inout) :: kernels
        type(answer_kernels), pointer :: answers

        if (.not. associated(kernels)) return
        do while (associated(kernels%first))
            answers => kernels%first
            kernels%first => answers%next
            call free_lane_program(answers%solving)
            call free_lane_program(answers%answers)
            deallocate (answers)
        end do
        call free_lane_program(kernels%matrix)
        call free_lane_program(kernels%sliding)
        deallocate (kernels)
        nullify (kernels)
    end subroutine free_kernels

    !> Those of some results, nothing of which is made yet.
    subroutine find_answers(wanted, kernels, answers)
        integer, intent(in) :: wanted(:)               !! `result_*`, `out_*`
        type(equation_kernels), intent(inout) :: kernels
        type(answer_kernels), pointer, intent(out) :: answers

        answers => kernels%first
        do while (associated(answers))
            if (size(answers%wanted) == size(wanted)) then
                if (all(answers%wanted == wanted)) return
            end if
            answers => answers%next
        end do
        allocate (answers)
        answers%wanted = wanted
        answers%next => kernels%first
        kernels%first => answers
    end subroutine find_answers

    !> The matrix.
    subroutine need_matrix(model, kernels)
        type(model_type), intent(in) :: model
        type(equation_kernels), intent(inout) :: kernels
        type(answer_kernels), pointer :: no_answers

        nullify (no_answers)
        call begin()
        if (.not. kernels%has_matrix) call write_densely(model, kernels, no_answers)
        call finish()
    end subroutine need_matrix

    !> The matrix, and what the unknowns give that somebody finds with it.
    subroutine need_answers(model, wanted, kernels, answers)
        type(model_type), intent(in) :: model
        integer, intent(in) :: wanted(:)               !! `result_*`, `out_*`
        type(equation_kernels), intent(inout) :: kernels
        type(answer_kernels), pointer, intent(out) :: answers

        call begin()
        call find_answers(wanted, kernels, answers)
        if (.not. (kernels%has_matrix .and. answers%has_answers)) call write_densely(model, kernels, answers)
        call finish()
    end subroutine need_answers

    !> What is not there yet of both.
    subroutine write_densely(model, kernels, answers)
        type(model_type), intent(in) :: model
        type(equation_kernels), intent(inout) :: kernels
        type(answer_kernels), pointer, intent(in) :: answers   !! null: none
        type(written_equations), target :: equations
        type(sample_set) :: sample

        if (kernels%wants_order .and. .not. kernels%has_matrix) &
            call representative_motions(model, has_columns(model, kernels%choice), sample)
        call open_equations(model, kernels%choice, sample, equations)
        if (.not. kernels%has_matrix) then
            call make_matrix_program(equations, kernels%wants_right, kernels%form, kernels%matrix%program)
            call prepare_lanes(model, has_columns(model, kernels%choice), kernels%matrix)
            associate (form => kernels%form)
                kernels%place = order_rows(form%n, form%row, form%column, form%sample)
            end associate
            kernels%has_matrix = .true.
        end if
        if (associated(answers)) then
            if (.not. answers%has_answers) then
                call make_answer_program(model, equations, answers%wanted, answers%answers%program)
                call prepare_lanes(model, has_columns(model, kernels%choice), answers%answers)
                answers%has_answers = .true.
            end if
        end if
        call close_equations(equations)
    end subroutine write_densely

    !> Elimination: ask `solving%program%is_made` whether pivots have served.
    subroutine need_solving(model, wanted, kernels, answers)
        type(model_type), intent(in) :: model
        integer, intent(in) :: wanted(:)               !! `result_*`, `out_*`
        type(equation_kernels), intent(inout) :: kernels
        type(answer_kernels), pointer, intent(out) :: answers
        type(written_equations), target :: equations
        type(sample_set) :: sample

        call begin()
        call find_answers(wanted, kernels, answers)
        if (.not. answers%has_solving) then
            call representative_motions(model, has_columns(model, kernels%choice), sample)
            if (sample%n > 0) then
                call open_equations(model, kernels%choice, sample, equations)
                call make_solving_program(model, equations, kernels%wants_reactions, wanted, answers%solved_for, &
                                          answers%n_watched, answers%solving%program)
                call close_equations(equations)
                if (answers%solving%program%is_made) &
                    call prepare_lanes(model, has_columns(model, kernels%choice), answers%solving)
            end if
            answers%has_solving = .true.
        end if
        call finish()
    end subroutine need_solving

    subroutine need_sliding(model, kernels)
        type(model_type), intent(in) :: model
        type(equation_kernels), intent(inout) :: kernels

        call begin()
        if (.not. kernels%has_sliding) then
            call make_sliding_program(model, kernels%sliding%program)
            call prepare_lanes(model, .false., kernels%sliding)
            kernels%has_sliding = .true.
        end if
        call finish()
    end subroutine need_sliding

    !> Can anything slide in a joint, or a spring lose its direction?
    pure logical function slides_or_pulls(model)
        type(model_type), intent(in) :: model

        slides_or_pulls = size(model%contact) > 0 .or. any(pulls_in_line(model%scene%spring))
    end function slides_or_pulls

    subroutine begin()
        call hold_records()
        call hold_texts()
    end subroutine begin

    subroutine finish()
        call release_texts()
        call release_records()
    end subroutine finish
end module linkdyn_equation_kernels
