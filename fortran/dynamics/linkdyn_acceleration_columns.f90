!> Forward dynamics in the one system of equations: accelerations of free coordinates are unknowns, driving forces that
!> are given are not.
!>
!> The formulation of inverse dynamics loses the columns of the given driving forces, which act as loads instead (see
!> `linkdyn_applied_wrenches`), and gets one column per free coordinate: minus the wrench that a unit acceleration of
!> the coordinate asks of every link it moves.
module linkdyn_acceleration_columns
    use linkdyn_formulation, only: formulation_type, wrench_column, matrix_entry
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state
    use linkdyn_lane_count, only: lanes
    use linkdyn_model, only: model_type
    use linkdyn_newton_euler, only: inertia_column
    use linkdyn_payload_forces, only: add_payload_column
    use linkdyn_planar_assembly, only: planar_inertia
    use linkdyn_rotors, only: moves_rotor, add_rotor_column, add_planar_rotor_column
    use linkdyn_vec2, only: vec2, zero_vec2
    use linkdyn_vec3, only: vec3, zero_vec3, operator(.rotate.)
    implicit none (type, external)
    private
    public :: acceleration_columns, append_accelerations, drop_drives, mark_applied, &
        assemble_accelerations

    !> What one coordinate contributes to the equations of one link.
    type :: acceleration_group
        integer :: link = 0, coordinate = 0
        integer :: first_slot = 0                      !! its entries stand in first_slot + 1, ... (n_component)
        logical :: of_link = .true.                    !! the link's own inertia; false: that of rotors alone
    end type acceleration_group

    !> The columns added to a formulation.
    type :: acceleration_columns
        integer, allocatable :: column(:)              !! unknown of each coordinate's acceleration; 0: given (n_q)
        type(acceleration_group), allocatable :: group(:)
        logical, allocatable :: rotor_acts(:)          !! (motor) its rotor's inertia is in the columns
    end type acceleration_columns

contains

    !> Take the columns of given driving forces out of the unknowns; `drive_column` becomes 0.
    subroutine drop_drives(model, is_given, formulation)
        type(model_type), intent(in) :: model
        logical, intent(in) :: is_given(:)             !! (n_actuator)
        type(formulation_type), intent(inout) :: formulation
        logical :: keep(formulation%n_unknown)
        integer :: number(formulation%n_unknown)       !! new number of a column
        integer :: i, g

        keep = .true.
        keep(pack(formulation%drive_column, is_given)) = .false.
        number = [(count(keep(:i)), i=1, size(keep))]
        formulation%column = pack(formulation%column, keep)
        formulation%entry = pack(formulation%entry, keep(formulation%entry%column))
        formulation%entry%column = number(formulation%entry%column)
        do i = 1, size(formulation%incidence)
            associate (incidence => formulation%incidence(i))
                if (.not. incidence%is_active) cycle
                incidence%group = pack(incidence%group, keep(incidence%group%column))
                do g = 1, size(incidence%group)
                    incidence%group(g)%column = number(incidence%group(g)%column)
                end do
            end associate
        end do
        do i = 1, model%n_actuator
            formulation%drive_column(i) = merge(0, number(formulation%drive_column(i)), is_given(i))
        end do
        formulation%n_unknown = count(keep)
    end subroutine drop_drives

    !> Springs, friction and given driving forces act on massless links too: their right-hand sides are not zero then.
    subroutine mark_applied(model, is_given, formulation)
        type(model_type), intent(in) :: model
        logical, intent(in) :: is_given(:)             !! (n_actuator)
        type(formulation_type), intent(inout) :: formulation
        integer :: i

        do i = 1, model%n_actuator
            if (is_given(i)) call mark(model%joint(model%scene%actuator(i)%joint)%link)
        end do
        do i = 1, size(model%scene%spring)
            associate (spring => model%scene%spring(i))
                if (spring%joint > 0) then
                    call mark(model%joint(spring%joint)%link)
                else
                    call mark(spring%link)
                end if
            end associate
        end do
        do i = 1, size(model%belt)
            call mark(model%joint(model%belt(i)%gear%joint)%link)
        end do
        do i = 1, size(model%contact)
            call mark(model%joint(model%contact(i)%joint)%link)
        end do

    contains

        subroutine mark(link)
            integer, intent(in) :: link(2)
            integer :: side

            do side = 1, 2
                if (link(side) == 0) cycle
                formulation%has_right(link(side)) = .true.
                associate (n => formulation%n_row)
                    formulation%row_has_right(n*(link(side) - 1) + 1:n*link(side)) = .true.
                end associate
            end do
        end subroutine mark
    end subroutine mark_applied

    !> Append a column for every free coordinate.
    subroutine append_accelerations(model, is_free, rotor_acts, formulation, columns)
        type(model_type), intent(in) :: model
        logical, intent(in) :: is_free(:)              !! (n_q)
        logical, intent(in) :: rotor_acts(:)           !! (motor) it drives with a given force
        type(formulation_type), intent(inout) :: formulation
        type(acceleration_columns), intent(out) :: columns
        type(matrix_entry) :: entry(model%n_component)
        type(acceleration_group) :: group
        integer :: k, l, i

        allocate (columns%column(model%n_q), columns%group(0))
        columns%column = 0
        columns%rotor_acts = rotor_acts
        do k = 1, model%n_q
            if (.not. is_free(k)) cycle
            formulation%n_unknown = formulation%n_unknown + 1
            columns%column(k) = formulation%n_unknown
            do l = 1, model%n_link
                group = acceleration_group(link=l, coordinate=k, first_slot=formulation%n_slot, &
                                           of_link=model%moves(k, l) .and. .not. model%link(l)%is_massless)
                if (.not. (group%of_link .or. moves_rotor(model, rotor_acts, l, k))) cycle
                columns%group = [columns%group, group]
                do i = 1, model%n_component
                    entry(i) = matrix_entry(row=model%n_component*(l - 1) + i, column=formulation%n_unknown, &
                                            slot=formulation%n_slot + i)
                end do
                formulation%n_slot = formulation%n_slot + model%n_component
                formulation%entry = [formulation%entry, entry]
            end do
        end do
    end subroutine append_accelerations

    !> Fill the slots of the acceleration columns. Needs the acceleration columns of the kinematics.
    subroutine assemble_accelerations(model, formulation, columns, state, slot)
        type(model_type), intent(in) :: model
        type(formulation_type), intent(in) :: formulation
        type(acceleration_columns), intent(in) :: columns
        type(kinematic_state), intent(in) :: state
        real(wp), intent(inout) :: slot(lanes, *)
        type(vec3) :: force, moment
        integer :: i, o

        if (model%is_planar) then
            call assemble_in_plane(model, formulation, columns, state, slot)
            return
        end if
        do i = 1, size(columns%group)
            associate (l => columns%group(i)%link, k => columns%group(i)%coordinate, first => columns%group(i)%first_slot)
                o = model%link(l)%orientation
                force = zero_vec3()
                moment = zero_vec3()
                if (columns%group(i)%of_link) then
                    call inertia_column(model%link(l), formulation%moment_point(:, l), state%acceleration_body(k, l), &
                                        state%alpha_body(k, o), force, moment)
                    if (size(model%payload) > 0) &
                        call add_payload_column(model, l, k, formulation%moment_point(:, l), state, force, moment)
                end if
                if (any(columns%rotor_acts)) call add_rotor_column(model, columns%rotor_acts, l, k, &
                                                                   formulation%moment_point(:, l), state, force, moment)
                if (.not. formulation%row_in_link(l)) then
                    force = state%rotation(o).rotate.force
                    moment = state%rotation(o).rotate.moment
                end if
                slot(:, first + 1) = -force%x
                slot(:, first + 2) = -force%y
                slot(:, first + 3) = -force%z
                slot(:, first + 4) = -moment%x
                slot(:, first + 5) = -moment%y
                slot(:, first + 6) = -moment%z
            end associate
        end do
    end subroutine assemble_accelerations

    subroutine assemble_in_plane(model, formulation, columns, state, slot)
        type(model_type), intent(in) :: model
        type(formulation_type), intent(in) :: formulation
        type(acceleration_columns), intent(in) :: columns
        type(kinematic_state), intent(in) :: state
        real(wp), intent(inout) :: slot(lanes, *)
        type(vec2) :: force
        real(wp) :: moment(lanes)
        integer :: i

        do i = 1, size(columns%group)
            associate (l => columns%group(i)%link, k => columns%group(i)%coordinate, first => columns%group(i)%first_slot)
                force = zero_vec2()
                moment = 0
                if (columns%group(i)%of_link) &
                    call planar_inertia(model, l, formulation%moment_point(:2, l), k, state%plane, state%payload, force, moment)
                if (any(columns%rotor_acts)) call add_planar_rotor_column(model, columns%rotor_acts, l, k, &
                                                                          formulation%moment_point(:2, l), state, force, moment)
                slot(:, first + 1) = -force%x
                slot(:, first + 2) = -force%y
                slot(:, first + 3) = -moment
            end associate
        end do
    end subroutine assemble_in_plane
end module linkdyn_acceleration_columns
