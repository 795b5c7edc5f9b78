!> How the equations are written down: in which axes and about which points, which entries are constant, which vary.
!>
!> The equations of motion of a link may be written in world axes or in its own, its moments taken about any of its
!> points; a joint's reaction may be resolved along any axes that suit the joint. None of this changes a force, but it
!> changes how many entries of the matrix vary or vanish. Two styles share everything else:
!> `style_lecture`: world axes and centres of mass, as on the slides; what the dense solvers and the teaching view use;
!> `style_sparse`: axes and points chosen, link by link and joint by joint, for the cheapest equations.
!>
!> Whether an entry is zero, constant or varying is decided here by rule, not by looking at numbers.
!>
!> A plane is space with a mask: of the six equations of a link it keeps force x, force y and moment z, of a joint's
!> wrench the forces in the plane and the moments about z. All the rest of this module is common.
module linkdyn_formulation
    use linkdyn_cross, only: cross
    use linkdyn_joint_table, only: along_axes, along_normal, along_z, n_along, force_directions, moment_directions, is_slide, &
        is_partial, &
        is_threaded, is_geared, variable_axis, most_slides, slide_axis, n_slide, joint_universal
    use linkdyn_kinds, only: wp
    use linkdyn_model, only: model_type, gear_type, orientation_of, side_of
    implicit none (type, external)
    private
    public :: formulation_type, wrench_column, entry_group, incidence_type, matrix_entry, reaction_part
    public :: build_formulation, style_lecture, style_sparse

    integer, parameter :: style_lecture = 1, style_sparse = 2

    ! Row of each of the six equations among a link's rows; 0: not in the plane.
    integer, parameter :: spatial_row(6) = [1, 2, 3, 4, 5, 6], planar_row(6) = [1, 2, 0, 0, 0, 3]

    ! Weights of the search for cheap equations, in flops: what an entry costs the elimination, a rotation, a cross product.
    integer, parameter :: cost_constant = 1, cost_varying = 4, cost_rotation = 15, cost_cross = 9

    integer, parameter :: most_groups = 9          !! unknowns of a joint: six, and its driving forces

    !> One unknown: a force or moment of a joint along a direction.
    type :: wrench_column
        integer :: joint = 0
        logical :: is_moment = .false.
        logical :: is_drive = .false.
        logical :: is_normal = .false.         !! square to both axes of a universal joint; `direction` is not used
        integer :: orientation = 0             !! axes in which `direction` is fixed; 0: world
        real(wp) :: direction(3) = 0
        integer :: unit_axis = 0               !! k if `direction` is axis k itself
        integer :: cam = 0                     !! the cam along whose normal it is; `direction` is not used, in a plane alone
        real(wp) :: couple(3, 2) = 0           !! moment with a unit force about the link's marker; reversed on the first [m]
    end type wrench_column

    !> A nonzero of the matrix.
    type :: matrix_entry
        integer :: row = 0, column = 0
        integer :: slot = 0                    !! where its value stands; 0: constant
        real(wp) :: value = 0                  !! of a constant
    end type matrix_entry

    !> What one unknown contributes to the equations of one link.
    type :: entry_group
        integer :: column = 0
        logical :: needs_direction = .false.   !! some slot needs the direction in row axes
        logical :: slides = .false.            !! some slot needs the slides
        logical :: needs_arm = .false.         !! some slot needs arm x direction
        integer :: force_slot(3) = 0           !! direction into the force rows (or the moment rows of a moment)
        integer :: moment_slot(3) = 0          !! arm x direction into the moment rows
        integer :: slide_slot(3) = 0           !! fixed + slides*rates into the moment rows
        real(wp) :: slide_fixed(3) = 0, slide_rate(3, most_slides) = 0
    end type entry_group

    !> A joint seen from one of its links.
    type :: incidence_type
        integer :: joint = 0, link = 0
        real(wp) :: sign = 1                   !! the reaction acts on the second link, its opposite on the first
        real(wp) :: arm(3) = 0                 !! from the moment point to the joint point, link axes; of a cam not used
        integer :: n_slide = 0                 !! of the joint that this link feels
        real(wp) :: arm_slide(3, most_slides) = 0   !! what a unit of each adds to the arm
        logical :: has_arm = .false., is_active = .false.
        logical :: needs_arm = .false.         !! some group needs arm x direction
        logical :: varies = .false.            !! some entry varies
        type(entry_group), allocatable :: group(:)
    end type incidence_type

    !> Force or moment of a joint, ready to be collected: component k is the unknown `unit_column(k)` in the axes of
    !> `orientation` (0: zero); a joint whose unknowns lie along other directions is not `is_plain`.
    type :: reaction_part
        logical :: is_plain = .true.
        integer :: unit_column(3) = 0
        integer :: orientation = 0
        integer :: normal_column = 0           !! unknown along the normal of a universal joint; 0: none
        integer :: couple_column = 0           !! force with which this moment comes; 0: none
    end type reaction_part

    !> The equations of a model in one style.
    type :: formulation_type
        integer :: style = 0
        integer :: n_unknown = 0
        integer :: n_slot = 0                              !! varying entries
        integer :: n_row = 0                               !! equations of a link: 3 or 6
        integer :: row(6) = 0                              !! of force x y z, moment x y z among them; 0: none
        logical, allocatable :: row_in_link(:)             !! equations in link axes, not world axes     (n_link)
        real(wp), allocatable :: moment_point(:, :)        !! link axes                                  (3, n_link)
        integer, allocatable :: force_axes(:)              !! 0 world, 1 or 2: of that link's marker     (n_joint)
        integer, allocatable :: moment_axes(:)             !! the same for moments                       (n_joint)
        integer, allocatable :: first_column(:)            !! unknowns of joint j: first_column(j)+1 ... (n_joint+1)
        integer, allocatable :: drive_column(:)            !!                                            (n_actuator)
        integer, allocatable :: first_drive(:)             !! driving forces at joint j: drive(first_drive(j)) ... (n_joint+1)
        integer, allocatable :: drive(:)                   !! actuators in the order of their joints     (n_actuator)
        type(wrench_column), allocatable :: column(:)      !!                                            (n_unknown)
        type(incidence_type), allocatable :: incidence(:)  !!                                            (2 n_joint)
        type(matrix_entry), allocatable :: entry(:)
        type(reaction_part), allocatable :: part(:, :)     !! force and moment of each joint             (2, n_joint)
        logical, allocatable :: has_right(:)               !! right-hand side of a link's rows is not zero by rule (n_link)
        logical, allocatable :: row_has_right(:)           !! the same row by row                        (n_row n_link)
    end type formulation_type

contains

    !> Choose the style's axes and points and describe every entry.
    subroutine build_formulation(model, style, formulation)
        type(model_type), intent(in) :: model
        integer, intent(in) :: style
        type(formulation_type), intent(out) :: formulation
        integer :: i

        formulation%style = style
        formulation%n_row = model%n_component
        formulation%row = merge(planar_row, spatial_row, model%is_planar)
        allocate (formulation%row_in_link(model%n_link), formulation%moment_point(3, model%n_link), &
                  formulation%force_axes(model%n_joint), formulation%moment_axes(model%n_joint), &
                  formulation%has_right(model%n_link))
        formulation%row_in_link = .false.
        formulation%has_right = .not. model%link%is_massless
        do i = 1, model%n_load
            if (model%scene%load(i)%link > 0) formulation%has_right(model%scene%load(i)%link) = .true.
        end do
        formulation%row_has_right = [(spread(formulation%has_right(i), 1, formulation%n_row), i=1, model%n_link)]
        do i = 1, model%n_link
            formulation%moment_point(:, i) = model%link(i)%cog
        end do
        do i = 1, model%n_joint
            formulation%force_axes(i) = merge(0, 1, force_directions(model%joint(i)%kind) == along_axes)
            formulation%moment_axes(i) = merge(0, 1, moment_directions(model%joint(i)%kind) == along_axes)
        end do
        call list_drives(model, formulation)
        call list_columns(model, formulation)
        if (style == style_sparse) call choose_axes_and_points(model, formulation)
        call list_entries(model, formulation)
        call list_parts(model, formulation)
    end subroutine build_formulation

    ! ---------------------------------------------------------------- unknowns

    !> Actuators by joint.
    subroutine list_drives(model, formulation)
        type(model_type), intent(in) :: model
        type(formulation_type), intent(inout) :: formulation
        integer :: place(model%n_joint + 1), i

        place = 0
        do i = 1, model%n_actuator
            associate (j => model%scene%actuator(i)%joint)
                place(j + 1) = place(j + 1) + 1
            end associate
        end do
        place(1) = 1
        do i = 1, model%n_joint
            place(i + 1) = place(i) + place(i + 1)
        end do
        formulation%first_drive = place
        allocate (formulation%drive(model%n_actuator))
        do i = 1, model%n_actuator
            associate (j => model%scene%actuator(i)%joint)
                formulation%drive(place(j)) = i
                place(j) = place(j) + 1
            end associate
        end do
    end subroutine list_drives

    !> The unknowns, joint by joint, driving forces last.
    subroutine list_columns(model, formulation)
        type(model_type), intent(in) :: model
        type(formulation_type), intent(inout) :: formulation
        type(wrench_column) :: column(6)
        integer :: j, n, n_here

        allocate (formulation%first_column(model%n_joint + 1), formulation%drive_column(model%n_actuator))
        n = 0
        do j = 1, model%n_joint
            formulation%first_column(j) = n
            call joint_columns(model, formulation, j, column, n_here)
            n = n + n_here
        end do
        formulation%first_column(model%n_joint + 1) = n
        formulation%drive_column = [(n + j, j=1, model%n_actuator)]
        formulation%n_unknown = n + model%n_actuator
        allocate (formulation%column(formulation%n_unknown))
        do j = 1, model%n_joint
            call renew_columns(model, formulation, j)
        end do
    end subroutine list_columns

    !> The unknowns of one joint in its present axes.
    subroutine renew_columns(model, formulation, j)
        type(model_type), intent(in) :: model
        type(formulation_type), intent(inout) :: formulation
        integer, intent(in) :: j
        type(wrench_column) :: column(6)
        integer :: n, k

        call joint_columns(model, formulation, j, column, n)
        formulation%column(formulation%first_column(j) + 1:formulation%first_column(j + 1)) = column(:n)
        do k = formulation%first_drive(j), formulation%first_drive(j + 1) - 1
            associate (actuator => formulation%drive(k))
                formulation%column(formulation%drive_column(actuator)) = drive_column_of(model, formulation, actuator)
            end associate
        end do
    end subroutine renew_columns

    !> The reaction of one joint.
    subroutine joint_columns(model, formulation, j, column, n)
        type(model_type), intent(in) :: model
        type(formulation_type), intent(in) :: formulation
        integer, intent(in) :: j
        type(wrench_column), intent(out) :: column(6)
        integer, intent(out) :: n

        n = 0
        call add_columns(force_directions(model%joint(j)%kind), formulation%force_axes(j), .false.)
        if (is_threaded(model%joint(j)%kind)) call add_thread()
        if (is_geared(model%joint(j)%kind)) call add_tooth(model%gear(model%joint(j)%gear))
        if (model%joint(j)%cam > 0) call add_column(wrench_column(joint=j, cam=model%joint(j)%cam), .false.)
        call add_columns(moment_directions(model%joint(j)%kind), formulation%moment_axes(j), .true.)

    contains

        !> The power of force and moment vanishes while the slide follows the angle.
        subroutine add_thread()
            type(wrench_column) :: thread

            thread = along_marker_axis(model, j, formulation%force_axes(j), 3)
            thread%couple = spread(-model%joint(j)%pitch*thread%direction, 2, 2)
            call add_column(thread, .false.)
        end subroutine add_thread

        !> One force between both links, in the carrier's axes.
        subroutine add_tooth(gear)
            type(gear_type), intent(in) :: gear

            call add_column(wrench_column(joint=j, orientation=orientation_of(model, gear%carrier), direction=gear%direction, &
                                          couple=gear%couple), .false.)
        end subroutine add_tooth

        subroutine add_columns(directions, axes, is_moment)
            integer, intent(in) :: directions          !! one of `along_*`
            integer, intent(in) :: axes                !! 0 world, 1 or 2: of that link
            logical, intent(in) :: is_moment
            integer :: k

            do k = 1, n_along(directions)
                select case (directions)
                case (along_axes)
                    call add_column(along_link_axis(model, j, axes, k), is_moment)
                case (along_normal)
                    call add_column(wrench_column(joint=j, is_normal=.true.), is_moment)
                case default
                    call add_column(along_marker_axis(model, j, axes, merge(3, k, directions == along_z)), is_moment)
                end select
            end do
        end subroutine add_columns

        !> Unless the plane does not know it.
        subroutine add_column(candidate, is_moment)
            type(wrench_column), intent(in) :: candidate
            logical, intent(in) :: is_moment
            integer :: first

            first = merge(4, 1, is_moment)
            if (model%is_planar .and. any(candidate%direction /= 0 .and. formulation%row(first:first + 2) == 0)) return
            n = n + 1
            column(n) = candidate
            column(n)%is_moment = is_moment
        end subroutine add_column
    end subroutine joint_columns

    !> Driving force or torque of an actuator.
    pure function drive_column_of(model, formulation, actuator) result(column)
        type(model_type), intent(in) :: model
        type(formulation_type), intent(in) :: formulation
        integer, intent(in) :: actuator
        type(wrench_column) :: column
        integer :: side

        associate (spec => model%scene%actuator(actuator))
            associate (kind => model%joint(spec%joint)%told_kind)
                side = max(1, merge(formulation%force_axes(spec%joint), formulation%moment_axes(spec%joint), &
                                    is_slide(kind, spec%variable)))
                if (kind == joint_universal) side = spec%variable
                ! axes across the common one are those of the first marker
                if (variable_axis(spec%variable, kind) < 3 .or. model%joint(spec%joint)%kind /= kind) side = 1
                column = along_marker_axis(model, spec%joint, side, variable_axis(spec%variable, kind), as_told=.true.)
                column%is_moment = .not. is_slide(kind, spec%variable)
            end associate
        end associate
        column%is_drive = .true.
    end function drive_column_of

    !> Along axis k of the world (0) or of the first or second link.
    pure function along_link_axis(model, j, side, k) result(column)
        type(model_type), intent(in) :: model
        integer, intent(in) :: j, side, k
        type(wrench_column) :: column

        column = wrench_column(joint=j, unit_axis=k)
        if (side > 0) column%orientation = orientation_of(model, model%joint(j)%link(side))
        column%direction(k) = 1
    end function along_link_axis

    !> Along axis k of the marker on the first or second link.
    pure function along_marker_axis(model, j, side, k, as_told) result(column)
        type(model_type), intent(in) :: model
        integer, intent(in) :: j, side, k
        logical, intent(in), optional :: as_told       !! of the joint as the scene has it
        type(wrench_column) :: column
        integer :: i

        column = wrench_column(joint=j, orientation=orientation_of(model, model%joint(j)%link(side)))
        column%direction = model%joint(j)%frame(:, k, side)
        if (present(as_told)) column%direction = model%joint(j)%told_frame(:, k, side)
        do i = 1, 3
            if (column%direction(i) == 1 .and. count(column%direction /= 0) == 1) column%unit_axis = i
        end do
    end function along_marker_axis

    !> How each joint's reaction is put together from the unknowns.
    subroutine list_parts(model, formulation)
        type(model_type), intent(in) :: model
        type(formulation_type), intent(inout) :: formulation
        integer :: j, c

        allocate (formulation%part(2, model%n_joint))
        do j = 1, model%n_joint
            do c = formulation%first_column(j) + 1, formulation%first_column(j + 1)
                associate (column => formulation%column(c), &
                           part => formulation%part(merge(2, 1, formulation%column(c)%is_moment), j))
                    if (column%is_normal) then
                        part%normal_column = c
                        cycle
                    end if
                    if (any(column%couple /= 0)) formulation%part(2, j)%couple_column = c
                    part%orientation = column%orientation
                    if (column%unit_axis == 0) then
                        part%is_plain = .false.
                    else
                        part%unit_column(column%unit_axis) = c
                    end if
                end associate
            end do
        end do
    end subroutine list_parts

    ! ---------------------------------------------------------------- entries

    !> A joint seen from its first (1) or second (2) link, its groups described, slots not yet numbered:
    !> a positive slot means varying, `value` holds what is constant.
    subroutine describe_incidence(model, formulation, j, side, incidence, value)
        type(model_type), intent(in) :: model
        type(formulation_type), intent(in) :: formulation
        integer, intent(in) :: j, side
        type(incidence_type), intent(inout) :: incidence
        real(wp), intent(out) :: value(:, :)    !! constants (6, n_group)
        integer :: n, n_group, i, c

        incidence%joint = j
        incidence%link = model%joint(j)%link(side)
        incidence%sign = merge(-1.0_wp, 1.0_wp, side == 1)
        incidence%is_active = incidence%link > 0
        value = 0
        if (.not. incidence%is_active) return
        associate (joint => model%joint(j))
            ! The joint point is the second link's marker; seen from the first link it slides.
            incidence%arm = joint%point(:, side) - formulation%moment_point(:, incidence%link)
            incidence%n_slide = merge(n_slide(joint%kind), 0, side == 1)
            incidence%arm_slide = 0
            do i = 1, incidence%n_slide
                incidence%arm_slide(:, i) = joint%frame(:, slide_axis(i, joint%kind), 1)
            end do
            incidence%has_arm = incidence%n_slide > 0 .or. any(incidence%arm /= 0) .or. joint%cam > 0
        end associate

        n = formulation%first_column(j + 1) - formulation%first_column(j)
        n_group = n + formulation%first_drive(j + 1) - formulation%first_drive(j)
        if (allocated(incidence%group)) then
            if (size(incidence%group) /= n_group) deallocate (incidence%group)
        end if
        if (.not. allocated(incidence%group)) allocate (incidence%group(n_group))
        do i = 1, n
            call describe_group(model, formulation, formulation%first_column(j) + i, incidence, incidence%group(i), value(:, i))
        end do
        do i = n + 1, n_group
            c = formulation%drive_column(formulation%drive(formulation%first_drive(j) + i - n - 1))
            call describe_group(model, formulation, c, incidence, incidence%group(i), value(:, i))
        end do
    end subroutine describe_incidence

    !> One unknown in the equations of one link.
    subroutine describe_group(model, formulation, c, incidence, group, value)
        type(model_type), intent(in) :: model
        type(formulation_type), intent(in) :: formulation
        integer, intent(in) :: c
        type(incidence_type), intent(in) :: incidence
        type(entry_group), intent(out) :: group
        real(wp), intent(out) :: value(6)
        integer :: first

        call describe_in_space(model, formulation, c, incidence, group, value)
        if (.not. model%is_planar) return
        ! Outside the plane there is nothing.
        first = merge(4, 1, formulation%column(c)%is_moment)
        where (formulation%row == 0) value = 0
        where (formulation%row(first:first + 2) == 0) group%force_slot = 0
        where (formulation%row(4:) == 0) group%moment_slot = 0
        where (formulation%row(4:) == 0) group%slide_slot = 0
        group%slides = any(group%slide_slot > 0)
        group%needs_arm = any(group%moment_slot > 0)
        group%needs_direction = group%needs_arm .or. any(group%force_slot > 0)
    end subroutine describe_group

    !> The same in all six equations.
    subroutine describe_in_space(model, formulation, c, incidence, group, value)
        type(model_type), intent(in) :: model
        type(formulation_type), intent(in) :: formulation
        integer, intent(in) :: c
        type(incidence_type), intent(in) :: incidence
        type(entry_group), intent(out) :: group
        real(wp), intent(out) :: value(6)
        logical :: is_fixed, rows_turn, zero(3)
        real(wp) :: couple(3)
        integer :: rows, k

        value = 0
        group%column = c
        associate (column => formulation%column(c), link => model%link(incidence%link))
            rows = merge(link%orientation, 0, formulation%row_in_link(incidence%link))
            rows_turn = rows /= link%orientation         ! arms turn against the rows
            is_fixed = .not. column%is_normal .and. column%cam == 0 .and. column%orientation == rows
            ! The z axis is the same for all that moves in a plane.
            is_fixed = is_fixed .or. (model%is_planar .and. column%is_moment)
            if (column%is_moment) then
                if (is_fixed) then
                    value(4:6) = incidence%sign*column%direction
                else
                    zero = .false.
                    if (column%is_normal .and. .not. rows_turn) zero = normal_is_zero(model, column%joint, incidence%link)
                    where (.not. zero) group%force_slot = 1
                    group%needs_direction = .true.
                end if
                return
            end if

            if (is_fixed) then
                value(1:3) = incidence%sign*column%direction
            else if (any(column%direction /= 0) .or. column%is_normal .or. column%cam > 0) then
                group%force_slot = 1
                group%needs_direction = .true.
            end if
            couple = column%couple(:, merge(1, 2, incidence%sign < 0))
            if (.not. incidence%has_arm .and. (is_fixed .or. model%is_planar)) then
                value(4:6) = incidence%sign*couple
                return
            end if
            if (.not. incidence%has_arm .and. all(couple == 0)) return
            if (is_fixed .and. .not. rows_turn) then
                group%slide_fixed = incidence%sign*(cross(incidence%arm, column%direction) + couple)
                do k = 1, incidence%n_slide
                    group%slide_rate(:, k) = incidence%sign*cross(incidence%arm_slide(:, k), column%direction)
                end do
                do k = 1, 3
                    if (any(group%slide_rate(k, :) /= 0)) then
                        group%slides = .true.
                        group%slide_slot(k) = 1
                    else
                        value(3 + k) = group%slide_fixed(k)
                    end if
                end do
            else
                do k = 1, 3
                    ! Component k of arm x direction needs the other two components of the direction, a couple its own.
                    if (is_fixed) then
                        if (all(pack(column%direction, [1, 2, 3] /= k) == 0) .and. couple(k) == 0) cycle
                    end if
                    group%moment_slot(k) = 1
                end do
                group%needs_direction = .true.
                group%needs_arm = .true.
            end if
        end associate
    end subroutine describe_in_space

    !> Components of the normal of a universal joint that vanish in the axes of one of its links: the one along its axis.
    pure function normal_is_zero(model, j, link) result(zero)
        type(model_type), intent(in) :: model
        integer, intent(in) :: j, link
        logical :: zero(3)
        integer :: side

        zero = .false.
        do side = 1, 2
            if (model%joint(j)%link(side) /= link) cycle
            associate (axis => model%joint(j)%frame(:, 3, side))
                if (count(axis /= 0) == 1) zero = axis /= 0
            end associate
        end do
    end function normal_is_zero

    pure logical function any_varies(group)
        type(entry_group), intent(in) :: group(:)
        integer :: g

        any_varies = .false.
        do g = 1, size(group)
            any_varies = any_varies .or. group(g)%needs_direction .or. group(g)%slides
        end do
    end function any_varies

    !> Number the varying entries and list all nonzeros.
    subroutine list_entries(model, formulation)
        type(model_type), intent(in) :: model
        type(formulation_type), intent(inout) :: formulation
        type(matrix_entry), allocatable :: entry(:)
        real(wp) :: value(6, most_groups)
        integer :: j, side, i, g, n_entry

        allocate (formulation%incidence(2*model%n_joint), entry(2*6*formulation%n_unknown))
        n_entry = 0
        formulation%n_slot = 0
        do j = 1, model%n_joint
            do side = 1, 2
                i = 2*(j - 1) + side
                call describe_incidence(model, formulation, j, side, formulation%incidence(i), value)
                if (.not. formulation%incidence(i)%is_active) cycle
                associate (incidence => formulation%incidence(i))
                    incidence%needs_arm = any(incidence%group%needs_arm)
                    incidence%varies = any_varies(incidence%group)
                    do g = 1, size(incidence%group)
                        call list_group(incidence%group(g), formulation%n_row*(incidence%link - 1), &
                                        formulation%column(incidence%group(g)%column)%is_moment, value(:, g))
                    end do
                end associate
            end do
        end do
        formulation%entry = entry(:n_entry)

    contains

        subroutine list_group(group, row, is_moment, value)
            type(entry_group), intent(inout) :: group
            integer, intent(in) :: row
            logical, intent(in) :: is_moment
            real(wp), intent(in) :: value(6)
            integer :: k

            do k = 1, 3
                call number_slot(group%force_slot(k), row + formulation%row(k + merge(3, 0, is_moment)), group%column)
                call number_slot(group%moment_slot(k), row + formulation%row(3 + k), group%column)
                call number_slot(group%slide_slot(k), row + formulation%row(3 + k), group%column)
            end do
            do k = 1, 6
                if (value(k) == 0) cycle
                n_entry = n_entry + 1
                entry(n_entry) = matrix_entry(row + formulation%row(k), group%column, 0, value(k))
            end do
        end subroutine list_group

        subroutine number_slot(slot, row, column)
            integer, intent(inout) :: slot
            integer, intent(in) :: row, column

            if (slot == 0) return
            formulation%n_slot = formulation%n_slot + 1
            slot = formulation%n_slot
            n_entry = n_entry + 1
            entry(n_entry) = matrix_entry(row, column, slot, 0.0_wp)
        end subroutine number_slot
    end subroutine list_entries

    ! ---------------------------------------------------------------- the search for cheap equations

    !> Improve one link or one joint at a time until nothing gets cheaper.
    subroutine choose_axes_and_points(model, formulation)
        type(model_type), intent(in) :: model
        type(formulation_type), intent(inout) :: formulation
        integer, parameter :: most_sweeps = 6
        integer :: sweep, i
        logical :: improved

        ! Start from link axes for links with two joints: their equations then hardly vary.
        do i = 1, model%n_link
            formulation%row_in_link(i) = count_joints(model, i) <= 2 .and. .not. model%is_planar
            if (count_joints(model, i) > 0) formulation%moment_point(:, i) = joint_point(model, i, 1)
        end do
        do sweep = 1, most_sweeps
            improved = .false.
            do i = 1, model%n_joint
                call improve_joint(model, formulation, i, improved)
            end do
            do i = 1, model%n_link
                call improve_link(model, formulation, i, improved)
            end do
            if (.not. improved) exit
        end do
    end subroutine choose_axes_and_points

    pure integer function count_joints(model, link)
        type(model_type), intent(in) :: model
        integer, intent(in) :: link

        count_joints = model%first_at(link + 1) - model%first_at(link)
    end function count_joints

    !> The point of the link's n-th joint, link axes; its centre of mass for n = 0.
    pure function joint_point(model, link, n) result(point)
        type(model_type), intent(in) :: model
        integer, intent(in) :: link, n
        real(wp) :: point(3)

        if (n == 0) then
            point = model%link(link)%cog
        else
            associate (joint => model%joint(model%joint_at(model%first_at(link) + n - 1)))
                point = joint%point(:, side_of(joint, link))
            end associate
        end if
    end function joint_point

    subroutine improve_joint(model, formulation, j, improved)
        type(model_type), intent(in) :: model
        type(formulation_type), intent(inout) :: formulation
        integer, intent(in) :: j
        logical, intent(inout) :: improved
        integer :: force, moment, kept(2), cost, best

        kept = [formulation%force_axes(j), formulation%moment_axes(j)]
        best = joint_cost(model, formulation, j)
        ! its axes are the first link's, or nobody's
        if (is_partial(model%joint(j)%kind) .or. model%joint(j)%cam > 0) return
        do force = merge(0, 1, force_directions(model%joint(j)%kind) == along_axes), 2
            do moment = merge(0, 1, moment_directions(model%joint(j)%kind) == along_axes), 2
                formulation%force_axes(j) = force
                formulation%moment_axes(j) = moment
                call renew_columns(model, formulation, j)
                cost = joint_cost(model, formulation, j)
                if (cost >= best) cycle
                best = cost
                kept = [force, moment]
                improved = .true.
            end do
        end do
        formulation%force_axes(j) = kept(1)
        formulation%moment_axes(j) = kept(2)
        call renew_columns(model, formulation, j)
    end subroutine improve_joint

    !> Cost of a joint's entries in both links, and of turning its reaction into world axes.
    integer function joint_cost(model, formulation, j)
        type(model_type), intent(in) :: model
        type(formulation_type), intent(in) :: formulation
        integer, intent(in) :: j
        integer :: c

        joint_cost = incidence_cost(model, formulation, j, 1) + incidence_cost(model, formulation, j, 2)
        c = formulation%first_column(j) + 1
        if (c > formulation%first_column(j + 1)) return
        if (formulation%column(c)%orientation > 0) joint_cost = joint_cost + cost_rotation
        c = formulation%first_column(j + 1)
        if (formulation%column(c)%is_moment .and. formulation%column(c)%orientation > 0) &
            joint_cost = joint_cost + cost_rotation
    end function joint_cost

    subroutine improve_link(model, formulation, link, improved)
        type(model_type), intent(in) :: model
        type(formulation_type), intent(inout) :: formulation
        integer, intent(in) :: link
        logical, intent(inout) :: improved
        real(wp) :: point(3), kept_point(3)
        logical :: kept_row
        integer :: n, axes, cost, best

        kept_row = formulation%row_in_link(link)
        kept_point = formulation%moment_point(:, link)
        best = link_cost(model, formulation, link)
        do n = 0, count_joints(model, link)
            point = joint_point(model, link, n)    ! n = 0: the centre of mass
            do axes = 0, merge(0, 1, model%is_planar)    ! in a plane the world's axes make constants of most entries
                formulation%row_in_link(link) = axes == 1
                formulation%moment_point(:, link) = point
                cost = link_cost(model, formulation, link)
                if (cost >= best) cycle
                best = cost
                kept_row = axes == 1
                kept_point = point
                improved = .true.
            end do
        end do
        formulation%row_in_link(link) = kept_row
        formulation%moment_point(:, link) = kept_point
    end subroutine improve_link

    !> Cost of a link's entries, and of turning its inertia into the axes of the rows.
    integer function link_cost(model, formulation, link)
        type(model_type), intent(in) :: model
        type(formulation_type), intent(in) :: formulation
        integer, intent(in) :: link
        integer :: i, j

        link_cost = 0
        if (.not. formulation%row_in_link(link)) link_cost = 2*cost_rotation
        do i = model%first_at(link), model%first_at(link + 1) - 1
            j = model%joint_at(i)
            link_cost = link_cost + incidence_cost(model, formulation, j, side_of(model%joint(j), link))
        end do
    end function link_cost

    integer function incidence_cost(model, formulation, j, side)
        type(model_type), intent(in) :: model
        type(formulation_type), intent(in) :: formulation
        integer, intent(in) :: j, side
        type(incidence_type) :: incidence
        real(wp) :: value(6, most_groups)
        integer :: g
        logical :: arm_turns

        incidence_cost = 0
        call describe_incidence(model, formulation, j, side, incidence, value)
        if (.not. incidence%is_active) return
        arm_turns = .false.
        do g = 1, size(incidence%group)
            associate (group => incidence%group(g), column => formulation%column(incidence%group(g)%column))
                incidence_cost = incidence_cost + cost_constant*count(value(:, g) /= 0) &
                                 + cost_varying*(sum(group%force_slot) + sum(group%moment_slot) + sum(group%slide_slot))
                if (group%needs_direction .and. column%unit_axis == 0 .and. column%orientation > 0) &
                    incidence_cost = incidence_cost + cost_rotation
                if (group%needs_direction .and. formulation%row_in_link(incidence%link)) &
                    incidence_cost = incidence_cost + cost_rotation
                if (group%needs_arm) incidence_cost = incidence_cost + cost_cross
                arm_turns = arm_turns .or. (group%needs_arm .and. .not. formulation%row_in_link(incidence%link))
            end associate
        end do
        if (arm_turns) incidence_cost = incidence_cost + cost_rotation
    end function incidence_cost
end module linkdyn_formulation
