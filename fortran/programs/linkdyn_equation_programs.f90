!> The equations of motion as kernels, of links that move as they are told.
!>
!> Equations may be written down in several ways; for each there is the matrix with its right-hand side, for whoever solves them
!> with pivots of his own, and what follows of the unknowns that he has found. Written sparsely they are solved by a kernel as well,
!> with pivots that serve representative samples; it tells where they do not.
module linkdyn_equation_programs
    use linkdyn_catalogue, only: quantity_values
    use linkdyn_effort_laws, only: law_effort, compares_motion
    use linkdyn_elimination, only: sparse_row
    use linkdyn_force_program, only: out_alarm, out_reach
    use linkdyn_force_system, only: unknown_note, label_len
    use linkdyn_friction, only: move_contacts
    use linkdyn_inputs, only: trace_request, sample_set, input_blocks, make_inputs, in_sense, in_target, in_motion
    use linkdyn_kinds, only: wp
    use linkdyn_layout, only: sparse_layout, lecture_layout
    use linkdyn_model, only: model_type, drives_share
    use linkdyn_rate_program, only: powers
    use linkdyn_record, only: record_type, open_record, close_record, constant_of
    use linkdyn_scene_program, only: scene_program, output_list, add_output, make_scene_program
    use linkdyn_springs, only: keep_direction, needs_direction
    use linkdyn_system, only: list_rows, solved
    use linkdyn_trace, only: traced_type, trace_given_motion, trace_equations, trace_what_acts, &
        solve_equations, take_unknowns, are_among, alarm_of, reach_of, pressed_by, driven_parts
    use linkdyn_value, only: value, zero, is_constant, is_zero, number_of
    use linkdyn_virtual_work, only: trace_work
    implicit none (type, external)
    private
    public :: equation_choice, written_equations, matrix_form, matrix_labels, as_lecture, sparsely, by_work, nothing_else
    public :: open_equations, close_equations, labels_of, make_matrix_program, make_solving_program, make_answer_program, &
        make_sliding_program, make_drive_program, make_motion_program, write_equations, has_columns, list_entries, fill_matrix
    public :: out_solution, out_press, out_driven, out_powers, out_square, out_transmitted, out_drives

    ! ---- ways to write equations down
    integer, parameter :: as_lecture = 1       !! six of each link, world axes, moments about its centre of mass
    integer, parameter :: sparsely = 2         !! the same, with few entries that vary
    integer, parameter :: by_work = 3          !! virtual work, one of each coordinate
    integer, parameter :: nothing_else = 4     !! none: motion and driving forces are given

    ! ---- outputs beside the results of the catalogue
    integer, parameter :: out_matrix = 111     !! entries and right-hand sides that are not constant
    integer, parameter :: out_solution = 112   !! unknowns that are wanted
    integer, parameter :: out_press = 113      !! what contacts feel of reactions (n_press, contact) [N]
    integer, parameter :: out_driven = 119     !! of that, what drives wheels apart (0:n_press, model%driven): `driven_parts`
    integer, parameter :: out_powers = 114     !! of driving forces, and of all forces but gravity [W]
    integer, parameter :: out_square = 115     !! of the speeds of contacts' surfaces (contact) [m2/s2]
    integer, parameter :: out_transmitted = 116    !! driving forces without what rotors take (n_actuator) [N, N m]
    integer, parameter :: out_drives = 117         !! what laws of drives give by the motion of their joints (n_actuator) [N, N m]
    integer, parameter :: out_motion = 118         !! the motion that is given, as numbers

    !> Which equations, and what they are to be solved for.
    type :: equation_choice
        integer :: way = sparsely
        logical, allocatable :: drive_is_unknown(:)        !! (n_actuator)
        logical, allocatable :: acceleration_is_unknown(:) !! (n_q)
        integer, allocatable :: varying(:)                 !! numbers of the scene that are inputs; absent: none
    end type equation_choice

    !> The matrix, nonzero by nonzero: constants, or outputs of its kernel.
    type :: matrix_form
        integer :: n_row = 0                               !! equations; one without unknowns is none
        integer :: n = 0                                   !! equations or unknowns, whichever are more: what is missing is zero
        integer, allocatable :: row(:), column(:)
        integer, allocatable :: output(:)                  !! of a nonzero; 0: it is constant
        real(wp), allocatable :: constant(:)
        real(wp), allocatable :: sample(:, :)              !! at representative samples (sample, nonzero)
        integer, allocatable :: right(:)                   !! output of a right-hand side; 0: it is zero (row)
    end type matrix_form

    !> What rows and columns are, for people.
    type :: matrix_labels
        type(unknown_note), allocatable :: unknown(:)
        character(len=label_len), allocatable :: equation(:)
    end type matrix_labels

    !> Equations that are written down in a record of their own, which is open: kernels are made of it one after the other.
    type :: written_equations
        type(record_type) :: record
        type(traced_type) :: traced
        integer :: n_sample = 0
    end type written_equations

contains

    !> Write the equations down; pivots are chosen by the samples.
    subroutine open_equations(model, choice, sample, equations, wants_names)
        type(model_type), intent(in) :: model
        type(equation_choice), intent(in) :: choice
        type(sample_set), intent(in) :: sample             !! representative; none, if nothing is solved
        type(written_equations), intent(inout), target :: equations
        logical, intent(in), optional :: wants_names       !! of rows and columns; absent: false

        call open_record(equations%record, sample%n)
        equations%n_sample = sample%n
        if (present(wants_names)) equations%traced%unknowns%wants_names = wants_names
        call write_equations(model, choice, sample, equations%traced)
    end subroutine open_equations

    subroutine close_equations(equations)
        type(written_equations), intent(inout) :: equations

        call close_record(equations%record)
    end subroutine close_equations

    !> Entries and right-hand sides; with samples what entries are there.
    subroutine make_matrix_program(equations, with_right, form, program)
        type(written_equations), intent(inout) :: equations
        logical, intent(in) :: with_right                  !! else entries alone
        type(matrix_form), intent(out) :: form
        type(scene_program), intent(inout) :: program
        type(sparse_row), allocatable :: row(:)
        type(output_list) :: out

        allocate (row(equations%traced%system%n_equation))
        call list_rows(equations%traced%system, row)
        call list_entries(row, equations%traced%system%n_unknown, equations%n_sample, with_right, form, out)
        call make_scene_program(equations%record, equations%traced%in, out, program)
    end subroutine make_matrix_program

    !> What rows and columns are.
    function labels_of(equations) result(labels)
        type(written_equations), intent(in) :: equations
        type(matrix_labels) :: labels

        labels = matrix_labels(equations%traced%unknowns%note, equations%traced%unknowns%equation)
    end function labels_of

    !> What varies are outputs, row after row.
    subroutine list_entries(row, n_unknown, n_sample, with_right, form, out)
        type(sparse_row), intent(in) :: row(:)
        integer, intent(in) :: n_unknown, n_sample
        logical, intent(in) :: with_right
        type(matrix_form), intent(out) :: form
        type(output_list), intent(out) :: out
        type(value), allocatable :: varying(:)
        integer :: i, k, n, n_varying

        form%n_row = size(row)
        form%n = max(form%n_row, n_unknown)
        n = sum(row%n)
        allocate (form%row(n), form%column(n), form%output(n), form%right(form%n), source=0)
        allocate (form%constant(n), form%sample(n_sample, n), source=0.0_wp)
        allocate (varying(n + form%n_row))
        n = 0
        n_varying = 0
        do i = 1, form%n_row
            do k = 1, row(i)%n
                n = n + 1
                form%row(n) = i
                form%column(n) = row(i)%column(k)
                form%sample(:, n) = number_of(row(i)%entry(k))
                if (is_constant(row(i)%entry(k))) then
                    form%constant(n) = real(constant_of(row(i)%entry(k)), wp)
                else
                    form%output(n) = place_of(row(i)%entry(k))
                end if
            end do
            if (with_right .and. .not. is_zero(row(i)%right)) form%right(i) = place_of(row(i)%right)
        end do
        call add_output(out, out_matrix, varying(:n_varying))

    contains

        integer function place_of(v)
            type(value), intent(in) :: v

            n_varying = n_varying + 1
            varying(n_varying) = v
            place_of = n_varying
        end function place_of
    end subroutine list_entries

    !> Unknowns that are wanted and what follows of them, by pivots that serve the samples; without such pivots no program is made.
    subroutine make_solving_program(model, equations, wants_reactions, wanted, which, n_watched, program)
        type(model_type), intent(in) :: model
        type(written_equations), intent(inout) :: equations
        logical, intent(in) :: wants_reactions             !! else driving forces and accelerations alone
        integer, intent(in) :: wanted(:)                   !! `result_*`, `out_*`
        integer, allocatable, intent(out) :: which(:)      !! of the unknowns come, in this order
        integer, intent(out) :: n_watched                  !! pivots that raise the alarm where they become small
        type(scene_program), intent(inout) :: program
        type(output_list) :: out
        logical, allocatable :: is_wanted(:)
        integer :: k

        associate (traced => equations%traced)
            is_wanted = are_among(traced, [traced%unknowns%transmitted, traced%beyond])
            if (wants_reactions) then
                is_wanted = .true.
                call solve_equations(traced)
            else
                call solve_equations(traced, is_last=is_wanted)
            end if
            which = pack([(k, k=1, size(is_wanted))], is_wanted)
            n_watched = size(traced%mechanism%watched)
            if (.not. traced%mechanism%is_solved) return
            call add_output(out, out_solution, traced%system%solution(which))
            call add_output(out, out_alarm, [alarm_of(traced)])
            call list_answers(model, wanted, traced, out)
            call make_scene_program(equations%record, traced%in, out, program)
        end associate
    end subroutine make_solving_program

    !> What follows of unknowns that somebody has found.
    subroutine make_answer_program(model, equations, wanted, program)
        type(model_type), intent(in) :: model
        type(written_equations), intent(inout) :: equations
        integer, intent(in) :: wanted(:)                   !! `result_*`, `out_*`
        type(scene_program), intent(inout) :: program
        type(output_list) :: out

        associate (traced => equations%traced)
            call take_unknowns(sample_set(equations%n_sample), traced)
            call list_answers(model, wanted, traced, out)
            call make_scene_program(equations%record, traced%in, out, program)
        end associate
    end subroutine make_answer_program

    subroutine list_answers(model, wanted, traced, out)
        type(model_type), intent(in) :: model
        integer, intent(in) :: wanted(:)                   !! `result_*`, `out_*`
        type(traced_type), intent(inout) :: traced
        type(output_list), intent(inout) :: out
        integer :: i, k

        do k = 1, size(wanted)
            select case (wanted(k))
            case (out_transmitted)
                call add_output(out, wanted(k), solved(traced%system, traced%unknowns%transmitted))
            case (out_press)
                call add_output(out, wanted(k), [(pressed_by(traced, i), i=1, size(model%contact))])
            case (out_driven)
                call add_output(out, wanted(k), [(driven_parts(traced, i), i=1, size(model%driven))])
            case (out_powers)
                call add_output(out, wanted(k), powers(traced))
            case default
                call add_output(out, wanted(k), quantity_values(traced, wanted(k)))
            end select
        end do
    end subroutine list_answers

    !> How fast the surfaces of contacts slide, and whether springs have a direction: what is asked before anything acts.
    subroutine make_sliding_program(model, choice, program)
        type(model_type), intent(in) :: model
        type(equation_choice), intent(in) :: choice         !! of the equations that ask: which numbers vary
        type(scene_program), intent(inout) :: program
        type(record_type), target :: record
        type(traced_type) :: traced
        type(trace_request) :: request
        type(output_list) :: out
        integer :: i

        request%motion_is_given = .true.
        if (allocated(choice%varying)) request%varying = choice%varying
        call open_record(record, 0)
        call trace_given_motion(model, request, sample_set(), traced)
        call move_contacts(traced%mechanism, traced%in%of(in_sense)%v, traced%contact)
        call add_output(out, out_square, traced%contact%square)
        do i = 1, size(model%scene%spring)
            if (model%scene%spring(i)%joint == 0 .and. needs_direction(traced%mechanism, i)) &
                call keep_direction(traced%mechanism, i)
        end do
        call add_output(out, out_reach, [reach_of(traced)])
        call make_scene_program(record, traced%in, out, program)
        call close_record(record)
    end subroutine make_sliding_program

    !> What laws of drives give that compare the motion of a joint with a position and a speed wanted; zero of others.
    subroutine make_drive_program(model, program)
        type(model_type), intent(in) :: model
        type(scene_program), intent(inout) :: program
        type(record_type), target :: record
        type(traced_type) :: traced
        type(trace_request) :: request
        type(output_list) :: out
        type(value) :: force(model%n_actuator)
        integer :: i

        request%motion_is_given = .true.
        request%drive_is_unknown = spread(.false., 1, model%n_actuator)
        call open_record(record, 0)
        call trace_given_motion(model, request, sample_set(), traced)
        force = zero()
        associate (target => traced%in%of(in_target)%v)
            do i = 1, model%n_actuator
                if (compares_motion(model%scene%actuator(i)%law)) &
                    force(i) = law_effort(traced%mechanism, i, target(2*i - 1), target(2*i))
            end do
        end associate
        call add_output(out, out_drives, force)
        call make_scene_program(record, traced%in, out, program)
        call close_record(record)
    end subroutine make_drive_program

    !> The motion as it comes in: whoever runs this on lanes has its numbers.
    subroutine make_motion_program(model, has_columns, program)
        type(model_type), intent(in) :: model
        logical, intent(in) :: has_columns
        type(scene_program), intent(inout) :: program
        type(record_type), target :: record
        type(trace_request) :: request
        type(input_blocks) :: in
        type(output_list) :: out

        request%motion_is_given = .true.
        request%has_columns = has_columns
        call open_record(record, 0)
        call make_inputs(model, request, sample_set(), in)
        call add_output(out, out_motion, in%of(in_motion)%v)
        call make_scene_program(record, in, out, program)
        call close_record(record)
    end subroutine make_motion_program

    !> Do the equations ask how the motion changes with the coordinates?
    pure logical function has_columns(model, choice) result(has)
        type(model_type), intent(in) :: model
        type(equation_choice), intent(in) :: choice

        has = choice%way == by_work .or. any(choice%acceleration_is_unknown) .or. drives_share(model)
    end function has_columns

    !> Motion, what acts, and the equations that are chosen.
    subroutine write_equations(model, choice, sample, traced)
        type(model_type), intent(in) :: model
        type(equation_choice), intent(in) :: choice
        type(sample_set), intent(in) :: sample
        type(traced_type), intent(inout) :: traced
        type(trace_request) :: request

        request%motion_is_given = .true.
        request%has_columns = has_columns(model, choice)
        request%has_friction = size(model%contact) > 0
        request%drive_is_unknown = choice%drive_is_unknown
        request%acceleration_is_unknown = choice%acceleration_is_unknown
        if (allocated(choice%varying)) request%varying = choice%varying
        allocate (request%has_load(6, model%n_load))
        request%has_load = .true.
        call trace_given_motion(model, request, sample, traced)
        select case (choice%way)
        case (as_lecture)
            call trace_equations(request, lecture_layout(model), traced)
        case (sparsely)
            call trace_equations(request, sparse_layout(model), traced)
        case (by_work)
            call trace_work(request, traced)
        case (nothing_else)
            call trace_what_acts(request, traced)
        end select
    end subroutine write_equations

    !> The matrix of one sample.
    pure subroutine fill_matrix(form, found, matrix)
        type(matrix_form), intent(in) :: form
        real(wp), intent(in) :: found(:)                !! outputs of its kernel
        real(wp), intent(out) :: matrix(:, :)
        integer :: k

        matrix = 0
        do k = 1, size(form%row)
            matrix(form%row(k), form%column(k)) = form%constant(k)
            if (form%output(k) > 0) matrix(form%row(k), form%column(k)) = found(form%output(k))
        end do
    end subroutine fill_matrix
end module linkdyn_equation_programs
