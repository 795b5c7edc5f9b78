!> The teaching view: the system [A]{F} = b of inverse dynamics written out as on the lecture's slides, world axes and
!> moments about the centres of mass, once in symbols and once in numbers.
module linkdyn_explain_matrix
    use linkdyn_acceleration_columns, only: mark_applied
    use linkdyn_applied_wrenches, only: clear_applied, apply_springs, apply_load_laws
    use linkdyn_base_forces, only: apply_base
    use linkdyn_payload_forces, only: find_payloads
    use linkdyn_assembly, only: assemble_matrix, assemble_right
    use linkdyn_formulation, only: formulation_type, matrix_entry, build_formulation, style_lecture
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state, prepare_kinematics
    use linkdyn_lane_count, only: lanes
    use linkdyn_led_mechanism, only: evaluate_kinematics
    use linkdyn_measures, only: find_laws
    use linkdyn_model, only: model_type
    use linkdyn_motion, only: evaluate_motion
    use linkdyn_slots, only: slot_store, make_slots
    use linkdyn_text, only: to_text
    implicit none (type, external)
    private
    public :: explain_matrix, explain_first_instant, write_system, system_type, build_system

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
        type(formulation_type) :: formulation
        type(kinematic_state) :: state
        type(slot_store) :: slot
        real(wp) :: lane_load(lanes, 6, model%n_load)
        integer :: k

        call build_formulation(model, style_lecture, formulation)
        call mark_applied(model, spread(.false., 1, model%n_actuator), formulation)
        call prepare_kinematics(model, 0, state)
        state%has_applied = size(model%scene%spring) + size(model%belt) + size(model%scene%laws%law) > 0 .or. model%scene%base%moves
        state%world_rates = .true.
        state%q = spread(q, 1, lanes)
        state%qd = spread(qd, 1, lanes)
        state%qdd = spread(qdd, 1, lanes)
        lane_load = spread(load, 1, lanes)
        call make_slots(formulation%n_slot + model%n_row, slot)
        call evaluate_kinematics(model, state)
        state%time = model%scene%time%first
        call find_payloads(model, state)
        if (state%has_applied) then
            call clear_applied(model, state)
            call find_laws(model, state)
            call apply_springs(model, state)
            call apply_load_laws(model, state)
            call apply_base(model, state)
        end if
        call assemble_matrix(model, formulation, state, slot%value)
        call assemble_right(model, formulation, state, lane_load, formulation%n_slot, slot%value)
        call label_rows(model, formulation, system)
        call label_columns(model, formulation, system)
        allocate (system%matrix(model%n_row, formulation%n_unknown), system%right(model%n_row), &
                  system%symbol(model%n_row, formulation%n_unknown))
        system%matrix = 0
        system%symbol = "."
        do k = 1, size(formulation%entry)
            associate (entry => formulation%entry(k))
                system%matrix(entry%row, entry%column) = entry%value
                if (entry%slot > 0) system%matrix(entry%row, entry%column) = slot%value(1, entry%slot)
                system%symbol(entry%row, entry%column) = symbol_of(model, formulation, entry)
            end associate
        end do
        system%right = merge(slot%value(1, formulation%n_slot + 1:formulation%n_slot + model%n_row), 0.0_wp, &
                             formulation%row_has_right)
        call slot%free()
    end subroutine build_system

    ! ---------------------------------------------------------------- labels

    subroutine label_rows(model, formulation, system)
        type(model_type), intent(in) :: model
        type(formulation_type), intent(in) :: formulation
        type(system_type), intent(inout) :: system
        integer :: l, k

        allocate (system%row(model%n_row))
        do l = 1, model%n_link
            do k = 1, 6
                if (formulation%row(k) == 0) cycle
                system%row(formulation%n_row*(l - 1) + formulation%row(k)) = trim(model%link(l)%name)//" "//component_name(k)
            end do
        end do
    end subroutine label_rows

    subroutine label_columns(model, formulation, system)
        type(model_type), intent(in) :: model
        type(formulation_type), intent(in) :: formulation
        type(system_type), intent(inout) :: system
        integer :: c, n_force, n_moment, joint

        allocate (system%column(formulation%n_unknown))
        joint = 0
        do c = 1, formulation%n_unknown
            associate (column => formulation%column(c))
                if (column%joint /= joint) then
                    n_force = 0
                    n_moment = 0
                end if
                joint = column%joint
                if (column%is_moment) n_moment = n_moment + 1
                if (.not. column%is_moment) n_force = n_force + 1
                associate (name => model%joint(joint)%name)
                    if (column%is_drive) then
                        system%column(c) = trim(merge("tau ", "F   ", column%is_moment))//" " &
                                           //model%scene%actuator(findloc(formulation%drive_column, c, dim=1))%name
                    else if (model%joint(column%joint)%gear > 0) then
                        system%column(c) = trim(name)//" Ft"
                    else if (column%unit_axis > 0 .and. column%orientation == 0) then
                        system%column(c) = trim(name)//" "//component_name(column%unit_axis + merge(3, 0, column%is_moment))
                    else if (model%is_planar) then
                        system%column(c) = trim(name)//" "//merge("Mz", "Fn", column%is_moment)
                    else
                        system%column(c) = trim(name)//" "//merge("M", "F", column%is_moment) &
                                           //to_text(merge(n_moment, n_force, column%is_moment))
                    end if
                end associate
            end associate
        end do
    end subroutine label_columns

    !> An entry in symbols: J the joint, G the link's centre of mass, n the direction of a force across a slide, h the slide per
    !> angle of a thread, c the moment that comes with a tooth's force.
    function symbol_of(model, formulation, entry) result(symbol)
        type(model_type), intent(in) :: model
        type(formulation_type), intent(in) :: formulation
        type(matrix_entry), intent(in) :: entry
        character(len=label_len) :: symbol
        logical :: is_first, is_moment_row
        integer :: link, row, k

        associate (column => formulation%column(entry%column), n => formulation%n_row)
            link = (entry%row - 1)/n + 1
            row = entry%row - n*(link - 1)
            k = findloc(formulation%row, row, dim=1)
            is_moment_row = k > 3
            is_first = model%joint(column%joint)%link(1) == link
            if (column%is_moment .neqv. is_moment_row) then
                if (model%is_planar .and. column%unit_axis == 1 .and. column%orientation == 0) then
                    symbol = merge("yJ-yG", "yG-yJ", is_first)
                else if (model%is_planar .and. column%unit_axis == 2 .and. column%orientation == 0) then
                    symbol = merge("xG-xJ", "xJ-xG", is_first)
                else
                    symbol = merge("-", " ", is_first)//"(J-G)xn"
                    if (any(column%couple /= 0)) symbol = merge("-(J-G)xn+hn", " (J-G)xn-hn", is_first)
                    if (model%joint(column%joint)%gear > 0) symbol = merge("-(J-G)xn-c", " (J-G)xn+c", is_first)
                end if
            else if (entry%slot == 0 .and. abs(entry%value) == 1) then
                symbol = merge(" 1", "-1", entry%value > 0)
            else
                symbol = merge("-n", " n", is_first)//component_name(k)(2:2)
            end if
        end associate
        symbol = adjustl(symbol)
    end function symbol_of

    ! ---------------------------------------------------------------- printing

    !> Symbols, then numbers; zeros are points.
    subroutine write_system(system, unit)
        type(system_type), intent(in) :: system
        integer, intent(in) :: unit
        character(len=number_len) :: cell
        integer :: i, j

        write (unit, "(a)") "Equations of motion [A]{F} = b, world axes, moments about the centres of mass", &
            "(a joint's force acts on the second link of 'between'; J: joint, G: centre of mass of the row's link)"
        write (unit, "(/,a)") "In symbols"
        call write_header(system, unit)
        do i = 1, size(system%row)
            write (unit, "(a)", advance="no") system%row(i)
            do j = 1, size(system%column)
                cell = system%symbol(i, j)
                write (unit, "(a)", advance="no") adjustr(cell)
            end do
            write (unit, "(a)") merge("  m a - m g - F ", "  I alpha - M   ", index(system%row(i), " F") > 0)
        end do
        write (unit, "(/,a)") "In numbers (SI units)"
        call write_header(system, unit)
        do i = 1, size(system%row)
            write (unit, "(a)", advance="no") system%row(i)
            do j = 1, size(system%column)
                cell = "."
                if (system%symbol(i, j) /= ".") write (cell, "(g12.5)") system%matrix(i, j)
                write (unit, "(a)", advance="no") adjustr(cell)
            end do
            write (cell, "(g12.5)") system%right(i)
            write (unit, "(a)") " "//cell
        end do
    end subroutine write_system

    subroutine write_header(system, unit)
        type(system_type), intent(in) :: system
        integer, intent(in) :: unit
        character(len=number_len) :: cell
        integer :: j

        write (unit, "(a)", advance="no") repeat(" ", label_len)
        do j = 1, size(system%column)
            cell = system%column(j)
            write (unit, "(a)", advance="no") adjustr(cell)
        end do
        write (unit, "(a)") "  = b"
    end subroutine write_header
end module linkdyn_explain_matrix
