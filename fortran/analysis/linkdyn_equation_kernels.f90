!> The kernels of one choice of equations: each is made when it is wanted first, and then serves all threads.
!>
!> Designs that differ in their numbers alone are a family: kernels are made of its head, whichever design wants them first, with
!> numbers for inputs, and serve all of them. So are those who solve the equations of one model time and again.
module linkdyn_equation_kernels
    use linkdyn_alike_models, only: describe_alike
    use linkdyn_equation_programs, only: equation_choice, written_equations, matrix_form, open_equations, close_equations, &
        make_matrix_program, make_solving_program, make_answer_program, make_sliding_program, has_columns, nothing_else
    use linkdyn_inputs, only: sample_set, in_number
    use linkdyn_equations_on_lanes, only: lane_program, prepare_lanes, free_lane_program
    use linkdyn_lock, only: hold_records, release_records, hold_texts, release_texts
    use linkdyn_model, only: model_type
    use linkdyn_numbers, only: numbers_of
    use linkdyn_representatives, only: representative_motions
    use linkdyn_row_order, only: order_rows
    use linkdyn_scene, only: pulls_in_line
    implicit none (type, external)
    private
    public :: equation_kernels, answer_kernels, make_kernels, free_kernels, need_matrix, need_solving, need_answers, need_sliding, &
        slides_or_pulls
    public :: kernel_family, found_family, found_for_one, find_family, join_family, end_family, takes_numbers

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
        type(kernel_family), pointer, private :: family => null()    !! that they serve; null: one model alone
        type(equation_kernels), pointer, private :: next => null()   !! of the family
    end type equation_kernels

    type :: kernel_family
        type(model_type), private :: head
        character(len=:), allocatable, private :: key  !! what models have in common; none: the head is all there is
        integer, allocatable, private :: varying(:)    !! numbers that are inputs; none: these are constants
        type(equation_kernels), pointer, private :: first => null()
        type(kernel_family), pointer :: next => null()     !! whoever lists families
    end type kernel_family

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

    ! ---------------------------------------------------------------- families

    !> Models like this one share kernels from now on, if there can be any.
    subroutine found_family(model, family)
        type(model_type), intent(in) :: model
        type(kernel_family), pointer, intent(out) :: family

        character(len=:), allocatable :: key
        integer, allocatable :: varying(:)

        nullify (family)
        call describe(model, key, varying)
        if (len(key) > 0) call found_described(model, key, varying, family)
    end subroutine found_family

    subroutine found_described(model, key, varying, family)
        type(model_type), intent(in) :: model
        character(len=*), intent(in) :: key
        integer, intent(in) :: varying(:)
        type(kernel_family), pointer, intent(out) :: family

        allocate (family)
        family%head = model
        family%key = key
        family%varying = varying
    end subroutine found_described

    subroutine describe(model, key, varying)
        type(model_type), intent(in) :: model
        character(len=:), allocatable, intent(out) :: key      !! what models have in common; empty: it is like none
        integer, allocatable, intent(out) :: varying(:)        !! numbers that are inputs

        call hold_texts()
        call describe_alike(model, key, varying)
        call release_texts()
    end subroutine describe

    !> The family of a list that a model belongs to: a new one, if it is the first of its kind. Null: it is like none, or differs in
    !> more than numbers from all of so many that kernels of its own are no loss.
    subroutine find_family(model, first, family)
        type(model_type), intent(in) :: model
        type(kernel_family), pointer, intent(inout) :: first
        type(kernel_family), pointer, intent(out) :: family
        integer, parameter :: most = 8
        character(len=:), allocatable :: key
        integer, allocatable :: varying(:)
        integer :: n

        call describe(model, key, varying)
        n = 0
        family => first
        do while (associated(family))
            if (family%key == key) return
            n = n + 1
            family => family%next
        end do
        if (len(key) == 0 .or. n == most) return
        call found_described(model, key, varying, family)
        family%next => first
        first => family
    end subroutine find_family

    !> All who solve a model's equations share kernels from now on.
    subroutine found_for_one(model, family)
        type(model_type), intent(in) :: model
        type(kernel_family), pointer, intent(out) :: family

        allocate (family)
        family%head = model
    end subroutine found_for_one

    !> Take the family's kernels in the place of one's own, of which none may be made yet; a model that is not like its head keeps
    !> its own.
    subroutine join_family(model, family, kernels)
        type(model_type), intent(in) :: model
        type(kernel_family), pointer, intent(in) :: family
        type(equation_kernels), pointer, intent(inout) :: kernels
        type(equation_kernels), pointer :: shared
        character(len=:), allocatable :: key
        integer, allocatable :: varying(:)

        if (allocated(family%key)) then
            call describe(model, key, varying)
            if (key /= family%key) return
        end if
        call hold_records()
        shared => family%first
        do while (associated(shared))
            if (are_same(shared, kernels)) exit
            shared => shared%next
        end do
        if (.not. associated(shared)) then
            call make_kernels(kernels%choice, kernels%wants_reactions, kernels%wants_order, shared)
            if (allocated(family%varying)) shared%choice%varying = family%varying
            shared%family => family
            shared%next => family%first
            family%first => shared
        end if
        call release_records()
        call free_kernels(kernels)
        kernels => shared
    end subroutine join_family

    pure logical function are_same(a, b)
        type(equation_kernels), intent(in) :: a, b

        are_same = a%choice%way == b%choice%way .and. (a%wants_reactions .eqv. b%wants_reactions) &
                   .and. (a%wants_order .eqv. b%wants_order) .and. (a%wants_right .eqv. b%wants_right)
        if (are_same) are_same = all(a%choice%drive_is_unknown .eqv. b%choice%drive_is_unknown) &
                                 .and. all(a%choice%acceleration_is_unknown .eqv. b%choice%acceleration_is_unknown)
    end function are_same

    !> Are the model's numbers among the inputs?
    pure logical function takes_numbers(kernels)
        type(equation_kernels), intent(in) :: kernels

        takes_numbers = allocated(kernels%choice%varying)
    end function takes_numbers

    !> Nobody may be using its kernels.
    subroutine end_family(family)
        type(kernel_family), pointer, intent(inout) :: family
        type(equation_kernels), pointer :: kernels

        if (.not. associated(family)) return
        do while (associated(family%first))
            kernels => family%first
            family%first => kernels%next
            nullify (kernels%family)
            call free_kernels(kernels)
        end do
        deallocate (family)
        nullify (family)
    end subroutine end_family

    ! ---------------------------------------------------------------- kernels

    !> Nobody may be using them. Those of a family stay with it.
    subroutine free_kernels(kernels)
        type(equation_kernels), pointer, intent(inout) :: kernels
        type(answer_kernels), pointer :: answers

        if (.not. associated(kernels)) return
        if (associated(kernels%family)) then
            nullify (kernels)
            return
        end if
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
        if (.not. kernels%has_matrix) call write_densely(traced_model(model, kernels), kernels, no_answers)
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
        if (.not. (kernels%has_matrix .and. answers%has_answers)) &
            call write_densely(traced_model(model, kernels), kernels, answers)
        call finish()
    end subroutine need_answers

    !> The model of which kernels are made: the head of their family, or the model itself.
    function traced_model(model, kernels) result(traced)
        type(model_type), intent(in), target :: model
        type(equation_kernels), intent(in) :: kernels
        type(model_type), pointer :: traced

        traced => model
        if (associated(kernels%family)) traced => kernels%family%head
    end function traced_model

    !> What is not there yet of both.
    subroutine write_densely(model, kernels, answers)
        type(model_type), intent(in) :: model
        type(equation_kernels), intent(inout) :: kernels
        type(answer_kernels), pointer, intent(in) :: answers   !! null: none
        type(written_equations), target :: equations
        type(sample_set) :: sample

        if (kernels%wants_order .and. .not. kernels%has_matrix) call find_samples(model, kernels, sample)
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

        call begin()
        call find_answers(wanted, kernels, answers)
        if (.not. answers%has_solving) call make_solving(traced_model(model, kernels), kernels, answers)
        call finish()
    end subroutine need_solving

    !> Representative samples, by which pivots are chosen.
    subroutine find_samples(model, kernels, sample)
        type(model_type), intent(in) :: model
        type(equation_kernels), intent(in) :: kernels
        type(sample_set), intent(out) :: sample

        call representative_motions(model, has_columns(model, kernels%choice), sample)
        if (allocated(kernels%choice%varying)) sample%of(in_number)%x = spread(numbers_of(model), 2, sample%n)
    end subroutine find_samples

    subroutine make_solving(model, kernels, answers)
        type(model_type), intent(in) :: model
        type(equation_kernels), intent(in) :: kernels
        type(answer_kernels), intent(inout) :: answers
        type(written_equations), target :: equations
        type(sample_set) :: sample

        answers%has_solving = .true.
        call find_samples(model, kernels, sample)
        if (sample%n == 0) return
        call open_equations(model, kernels%choice, sample, equations)
        call make_solving_program(model, equations, kernels%wants_reactions, answers%wanted, answers%solved_for, &
                                  answers%n_watched, answers%solving%program)
        call close_equations(equations)
        if (answers%solving%program%is_made) call prepare_lanes(model, has_columns(model, kernels%choice), answers%solving)
    end subroutine make_solving

    subroutine need_sliding(model, kernels)
        type(model_type), intent(in) :: model
        type(equation_kernels), intent(inout) :: kernels

        call begin()
        if (.not. kernels%has_sliding) then
            call make_sliding_program(model, kernels%choice, kernels%sliding%program)
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
