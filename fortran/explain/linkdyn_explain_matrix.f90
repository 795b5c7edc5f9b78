!> The teaching view: the system [A]{F} = b of inverse dynamics written out as on the lecture's slides, world axes and
!> moments about the centres of mass, once in symbols and once in numbers.
module linkdyn_explain_matrix
    use linkdyn_equation_programs, only: equation_choice, written_equations, matrix_form, matrix_labels, open_equations, &
        close_equations, labels_of, make_matrix_program, fill_matrix, has_columns, as_lecture
    use linkdyn_force_system, only: unknown_note
    use linkdyn_given_numbers, only: prepare_numbers, take_numbers
    use linkdyn_inputs, only: sample_set
    use linkdyn_joint_table, only: is_geared
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state, prepare_kinematics
    use linkdyn_lane_count, only: lanes
    use linkdyn_equations_on_lanes, only: lane_numbers, lane_program, lane_space, prepare_lanes, run_on_lanes, free_lane_program, &
        free_lane_space
    use linkdyn_led_mechanism, only: evaluate_kinematics
    use linkdyn_model, only: model_type
    use linkdyn_motion, only: evaluate_motion
    implicit none (type, external)
    private
    public :: explain_first_instant

    integer, parameter :: label_len = 24, number_len = 12
    character(len=2), parameter :: component_name(6) = ["Fx", "Fy", "Fz", "Mx", "My", "Mz"]

    !> The system at one position, with the names of its rows and columns.
    type :: system_type
        real(wp), allocatable :: matrix(:, :), right(:)
        character(len=label_len), allocatable :: row(:), column(:)
        character(len=label_len), allocatable :: symbol(:, :)
    end type system_type

contains

    !> Print the system for one position, velocity, acceleration and its loads.
    subroutine explain_matrix(model, q, qd, qdd, load, unit)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: q(:), qd(:), qdd(:)      !! (n_q)
        real(wp), intent(in) :: load(:, :)               !! (6, n_load)
        integer, intent(in) :: unit                      !! open for formatted writing
        type(system_type) :: system

        call build_system(model, q, qd, qdd, load, system)
        call write_system(system, unit)
    end subroutine explain_matrix

    !> The same where the scene's motion begins.
    subroutine explain_first_instant(model, unit)
        type(model_type), intent(in) :: model
        integer, intent(in) :: unit
        real(wp) :: q(model%n_q, 1), qd(model%n_q, 1), qdd(model%n_q, 1), load(6, model%n_load, 1)

        call evaluate_motion(model, [model%scene%time%first], q, qd, qdd, load)
        write (unit, "()")
        call explain_matrix(model, q(:, 1), qd(:, 1), qdd(:, 1), load(:, :, 1), unit)
    end subroutine explain_first_instant

    !> Assemble and label the system.
    subroutine build_system(model, q, qd, qdd, load, system)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: q(:), qd(:), qdd(:), load(:, :)
        type(system_type), intent(out) :: system
        type(equation_choice) :: choice
        type(written_equations), target :: equations
        type(matrix_form) :: form
        type(matrix_labels) :: labels
        type(lane_program) :: lane
        type(lane_space) :: space

        choice%way = as_lecture
        allocate (choice%drive_is_unknown(model%n_actuator), source=.true.)
        allocate (choice%acceleration_is_unknown(model%n_q), source=.false.)
        call open_equations(model, choice, sample_set(), equations, wants_names=.true.)
        labels = labels_of(equations)
        call make_matrix_program(equations, .true., form, lane%program)
        call close_equations(equations)
        call prepare_lanes(model, has_columns(model, choice), lane)
        call run_at(model, q, qd, qdd, load, has_columns(model, choice), lane, space)
        call take_system(model, form, labels, space%found(1, :), system)
        call free_lane_space(space)
        call free_lane_program(lane)
    end subroutine build_system

    !> The equations of motion. Those by which more drives than freedoms share the work come before them and have no names, and
    !> the unknowns that only these have come last.
    subroutine take_system(model, form, labels, found, system)
        type(model_type), intent(in) :: model
        type(matrix_form), intent(in) :: form
        type(matrix_labels), intent(in) :: labels
        real(wp), intent(in) :: found(:)               !! outputs of the kernel
        type(system_type), intent(inout) :: system
        real(wp) :: whole(form%n, form%n)
        integer :: before, i, j, k

        system%row = labels%equation
        system%column = labels%unknown%name
        before = form%n_row - size(system%row)
        call fill_matrix(form, found, whole)
        system%matrix = whole(before + 1:form%n_row, :size(system%column))
        allocate (system%symbol(size(system%row), size(system%column)))
        system%symbol = "."
        do k = 1, size(form%row)
            i = form%row(k) - before
            j = form%column(k)
            if (i > 0) system%symbol(i, j) = symbol_of(model, i, labels%unknown(j), form%output(k) == 0, form%constant(k))
        end do
        allocate (system%right(size(system%row)), source=0.0_wp)
        do i = 1, size(system%row)
            if (form%right(before + i) > 0) system%right(i) = found(form%right(before + i))
        end do
    end subroutine take_system

    !> Entries and right-hand sides of one position.
    subroutine run_at(model, q, qd, qdd, load, wants_columns, lane, space)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: q(:), qd(:), qdd(:), load(:, :)
        logical, intent(in) :: wants_columns           !! how the motion changes with the coordinates
        type(lane_program), intent(in) :: lane
        type(lane_space), intent(inout) :: space
        type(kinematic_state) :: state
        type(lane_numbers) :: numbers

        call prepare_kinematics(model, merge(model%n_q, 0, wants_columns), state)
        state%q = spread(q, 1, lanes)
        state%qd = spread(qd, 1, lanes)
        state%qdd = spread(qdd, 1, lanes)
        state%time = model%scene%time%first
        call evaluate_kinematics(model, state)
        call prepare_numbers(model, .false., numbers)
        call take_numbers(model, state, spread(load, 1, lanes), numbers)
        call run_on_lanes(lane, 1, state, numbers, space)
    end subroutine run_at

    !> An entry in symbols: J the joint, G the link's centre of mass, n the direction of a force across a slide, h the slide per
    !> angle of a thread, c the moment that comes with a tooth's force.
    function symbol_of(model, row, unknown, is_constant, number) result(symbol)
        type(model_type), intent(in) :: model
        integer, intent(in) :: row
        type(unknown_note), intent(in) :: unknown
        logical, intent(in) :: is_constant
        real(wp), intent(in) :: number                   !! of a constant
        character(len=label_len) :: symbol
        logical :: is_first, is_moment_row
        integer :: link, k

        associate (n => model%n_component)
            link = (row - 1)/n + 1
            k = row - n*(link - 1)
            if (model%is_planar .and. k == 3) k = 6
        end associate
        is_moment_row = k > 3
        is_first = model%joint(unknown%joint)%link(1) == link
        if (unknown%is_moment .neqv. is_moment_row) then
            if (model%is_planar .and. unknown%axis == 1) then
                symbol = merge("yJ-yG", "yG-yJ", is_first)
            else if (model%is_planar .and. unknown%axis == 2) then
                symbol = merge("xG-xJ", "xJ-xG", is_first)
            else
                symbol = merge("-", " ", is_first)//"(J-G)xn"
                if (unknown%is_thread) symbol = merge("-(J-G)xn+hn", " (J-G)xn-hn", is_first)
                if (is_geared(model%joint(unknown%joint)%kind)) symbol = merge("-(J-G)xn-c", " (J-G)xn+c", is_first)
            end if
        else if (is_constant .and. abs(number) == 1) then
            symbol = merge(" 1", "-1", number > 0)
        else
            symbol = merge("-n", " n", is_first)//component_name(k)(2:2)
        end if
        symbol = adjustl(symbol)
    end function symbol_of

    ! ---------------------------------------------------------------- printing

    !> Symbols, then numbers; zeros are points. Columns are as wide as their names.
    subroutine write_system(system, unit)
        type(system_type), intent(in) :: system
        integer, intent(in) :: unit
        character(len=number_len) :: right
        integer :: width, i, j

        width = 2 + max(number_len, maxval(len_trim(system%column)))
        write (unit, "(a)") "Equations of motion [A]{F} = b, world axes, moments about the centres of mass", &
            "(a joint's force acts on the second link of 'between'; J: joint, G: centre of mass of the row's link)"
        write (unit, "(/,a)") "In symbols"
        call write_header()
        do i = 1, size(system%row)
            write (unit, "(a)", advance="no") system%row(i)
            do j = 1, size(system%column)
                call write_cell(system%symbol(i, j))
            end do
            write (unit, "(a)") merge("  m a - m g - F ", "  I alpha - M   ", index(system%row(i), " F") > 0)
        end do
        write (unit, "(/,a)") "In numbers (SI units)"
        call write_header()
        do i = 1, size(system%row)
            write (unit, "(a)", advance="no") system%row(i)
            do j = 1, size(system%column)
                if (system%symbol(i, j) == ".") then
                    call write_cell(".")
                else
                    call write_cell(in_digits(system%matrix(i, j)))
                end if
            end do
            right = in_digits(system%right(i))
            write (unit, "(a)") " "//right
        end do

    contains

        subroutine write_header()
            integer :: k

            write (unit, "(a)", advance="no") repeat(" ", label_len)
            do k = 1, size(system%column)
                call write_cell(system%column(k))
            end do
            write (unit, "(a)") "  = b"
        end subroutine write_header

        !> Against the right edge of its column.
        subroutine write_cell(text)
            character(len=*), intent(in) :: text

            write (unit, "(a)", advance="no") repeat(" ", width - len_trim(text))//trim(text)
        end subroutine write_cell
    end subroutine write_system

    !> Zero without a sign.
    function in_digits(x) result(text)
        real(wp), intent(in) :: x
        character(len=number_len) :: text

        write (text, "(g12.5)") merge(x, 0.0_wp, abs(x) > 0)
    end function in_digits
end module linkdyn_explain_matrix
