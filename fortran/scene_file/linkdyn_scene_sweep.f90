!> The table [sweep] of a scene file: axes, what is reduced and kept, bounds.
module linkdyn_scene_sweep
    use, intrinsic :: iso_fortran_env, only: int64
    use linkdyn_heard_tables, only: hearing, heard_table, list_tables, find_short_table, short_in_words
    use linkdyn_kinds, only: wp
    use linkdyn_scene, only: scene_type, load_spec, name_len, frame_link, law_over, has_limits, joint_cam, guide_of
    use linkdyn_scene_keys, only: scene_place, place_at, refuse, refuse_value, refuse_missing, allow_keys, require_table, &
        table_list, get_quantity, quantity_of, direction_of, get_text, get_word, get_flag, get_integer
    use linkdyn_scene_names, only: find_marker
    use linkdyn_scene_parameters, only: added_unit, check_parameter, is_there
    use linkdyn_status, only: status_type
    use linkdyn_suggest, only: suggestion
    use linkdyn_sweep_quantities, only: described => quantity_type, describe_quantity
    use linkdyn_sampling, only: most_sobol_dimensions
    use linkdyn_sweep_map, only: most_cells
    use linkdyn_sweep_plan, only: longest_table
    use linkdyn_sweep_spec, only: sweep_spec, axis_spec, bound_spec, segment_spec, swing_spec, axis_coordinate, axis_rate, &
        axis_acceleration, axis_load, axis_parameter, axis_time, sampling_linspace, sampling_values, sampling_random, &
        sampling_sobol, sampling_name, set_value, multiply_by, operation_name, quantity_name, n_quantity, quantity_motor_torque, &
        quantity_motor_speed, quantity_motor_power, quantity_motor_current, quantity_torque_margin, quantity_driving_force, &
        quantity_driving_position, quantity_driving_speed, quantity_driving_power, quantity_reaction, quantity_reaction_force, &
        quantity_reaction_moment, quantity_force_amplification, quantity_moment_amplification, quantity_swing, &
        quantity_clearance, quantity_contact_force, quantity_pressure_angle
    use linkdyn_sweep_totals, only: fixed_outcome
    use linkdyn_text, only: to_text, quoted, join
    use linkdyn_toml, only: toml_node, toml_array, toml_table, toml_string
    use linkdyn_units, only: quantity_type, plain_number, length, angle, speed, angular_rate, acceleration, force, moment, &
        time_span, wattage, per_second, dimension_text, usual_unit, si_unit_text
    use linkdyn_expression, only: measured_value
    use linkdyn_variables, only: measured_of_text
    use linkdyn_scene_variables, only: forbid_varied_variables
    implicit none (type, external)
    private
    public :: read_sweep

    character(len=2), parameter :: component_name(6) = ["Fx", "Fy", "Fz", "Mx", "My", "Mz"]
    character(len=12), parameter :: varied(6) = [character(len=12) :: "coordinate", "rate", "acceleration", "load", &
        "parameter", "time"]
    integer, parameter :: usual_quantities(7) = [quantity_driving_force, quantity_driving_position, quantity_driving_speed, &
        quantity_driving_power, quantity_reaction, quantity_reaction_force, quantity_reaction_moment]

    integer, parameter :: of_motors(5) = [quantity_motor_torque, quantity_motor_speed, quantity_motor_power, &
                                          quantity_motor_current, quantity_torque_margin]

contains

    !> Fill `scene%sweep`. Markers that carry a load only in the sweep get one in the scene.
    subroutine read_sweep(root, scene, added, status)
        type(scene_place), intent(in) :: root
        type(scene_type), intent(inout) :: scene
        type(added_unit), allocatable, intent(out) :: added(:)    !! of the axes
        type(status_type), intent(inout) :: status
        type(scene_place) :: place
        type(toml_node) :: node

        allocate (scene%sweep%axis(0), scene%sweep%bound(0), scene%sweep%segment(0), scene%sweep%swing(0), &
                  scene%sweep%map_axis(0), added(0))
        if (.not. status%is_ok()) return
        node = root%node%get("sweep")
        if (.not. node%is_present()) return
        place = place_at(root, node, "sweep")
        scene%sweep%is_given = .true.
        call place%variables%forget()
        call require_table(place, "a table with axes, written [sweep] and [[sweep.axis]]", status)
        call allow_keys(place, [character(len=11) :: "axis", "combination", "reduce", "moments", "histogram", "keep", "map", "on", &
            "length", "constraint", "limit", "clearance", "swing", "chunk"], status)
        call read_axes(place, root%node, scene, added, status)
        call read_wishes(place, scene, status)
        call read_map(place, scene%sweep, status)
        call read_bounds(place, "constraint", .false., scene, status)
        call read_bounds(place, "limit", .true., scene, status)
        call read_bodies(place, scene, status)
        call read_swings(place, scene, status)
        call check_wishes(place, scene, status)
        call forbid_varied_variables(place, place%variables, scene, status)
    end subroutine read_sweep

    ! ---------------------------------------------------------------- axes

    subroutine read_axes(place, root, scene, added, status)
        type(scene_place), intent(in) :: place
        type(toml_node), intent(in) :: root
        type(scene_type), intent(inout) :: scene
        type(added_unit), allocatable, intent(inout) :: added(:)
        type(status_type), intent(inout) :: status
        type(toml_node) :: list
        character(len=name_len), allocatable :: group(:)
        integer :: i, n, combination
        logical :: found

        call table_list(place, "axis", list, n, status)
        if (status%is_ok() .and. n == 0) call refuse(place, "has no axis (expected at least one [[sweep.axis]])", status)
        combination = 1
        call get_word(place, "combination", [character(len=7) :: "product", "zip"], combination, status, found)
        if (.not. status%is_ok()) return
        deallocate (scene%sweep%axis)
        deallocate (added)
        allocate (scene%sweep%axis(n), group(n), added(n))
        do i = 1, n
            call read_axis(place_at(place, list%at(i), "sweep axis "//to_text(i)), root, scene, scene%sweep%axis(i), group(i), &
                added(i), status)
            if (.not. status%is_ok()) return
        end do
        call refuse_motions_at_rest(place, list, root, scene%sweep%axis, status)
        call form_groups(place, group, combination == 2, scene%sweep, status)
    end subroutine read_axes

    !> Without an axis over time coordinates rest at their starts: what moves them has no part in any sample, but where a motion
    !> begins is the start of a coordinate that says none.
    subroutine refuse_motions_at_rest(place, list, root, axis, status)
        type(scene_place), intent(in) :: place
        type(toml_node), intent(in) :: list, root
        type(axis_spec), intent(in) :: axis(:)
        type(status_type), intent(inout) :: status
        character(len=:), allocatable :: path
        integer :: i, k, end_of_name

        if (any(axis%kind == axis_time)) return
        do i = 1, size(axis)
            if (axis(i)%kind /= axis_parameter) cycle
            do k = 1, size(axis(i)%parameter)
                path = trim(axis(i)%parameter(k)%path)
                end_of_name = index(path, ".motion.") - 1
                if (index(path, "coordinate.") /= 1 .or. end_of_name < 0 .or. .not. status%is_ok()) cycle
                if (.not. is_there(root, path(:end_of_name)//".start")) cycle
                if (is_there(root, path(:end_of_name)//".start.velocity") .and. &
                    .not. is_there(root, path(:end_of_name)//".start.position")) cycle
                call refuse(place_at(place, list%at(i), "sweep axis "//to_text(i)), "parameter "//quoted(path) &
                    //" changes nothing: without an axis over time the coordinate rests at its 'start' (expected an axis with " &
                    //"time = true, or no 'start')", status)
            end do
        end do
    end subroutine refuse_motions_at_rest

    !> One axis: what is varied, in which unit, over which values, and the group that it moves along with.
    subroutine read_axis(at, root, scene, axis, group, added, status)
        type(scene_place), intent(in) :: at
        type(toml_node), intent(in) :: root
        type(scene_type), intent(inout) :: scene
        type(axis_spec), intent(out) :: axis
        character(len=name_len), intent(out) :: group
        type(added_unit), intent(out) :: added
        type(status_type), intent(inout) :: status
        type(scene_place) :: place
        type(quantity_type) :: quantity
        character(len=:), allocatable :: text
        type(toml_node) :: node
        logical :: found, says_no_unit
        integer :: i

        place = at
        axis%line = place%line
        group = ""
        call require_table(place, "a table", status)
        call allow_keys(place, [character(len=15) :: varied, "component", "as", "weights", "group", "name", &
            sampling_name], status)
        do i = 1, size(varied)
            node = place%node%get(varied(i))
            if (.not. node%is_present() .or. .not. status%is_ok()) cycle
            if (axis%kind > 0) then
                call refuse(place, "has both "//quoted(varied(axis%kind))//" and "//quoted(varied(i))// &
                    " (expected one of them)", status)
                return
            end if
            axis%kind = i
        end do
        if (.not. status%is_ok()) return
        quantity = plain_number
        select case (axis%kind)
        case (axis_coordinate, axis_rate, axis_acceleration)
            call find_coordinate(place, trim(varied(axis%kind)), scene, axis, quantity, status)
        case (axis_load)
            call find_load(place, scene, axis, quantity, status)
        case (axis_parameter)
            call read_parameter(place, root, axis, quantity, status)
        case (axis_time)
            call read_time_axis(place, scene, axis, quantity, status)
        case default
            call refuse(place, "does not say what it varies (expected one of "//join(varied)//")", status)
        end select
        if (.not. status%is_ok()) return
        place%what = "sweep axis "//quoted(axis%name)
        if (axis%kind /= axis_load) call refuse_key(place, "component", "a load", status)
        if (axis%kind /= axis_parameter) call refuse_key(place, "as", "a parameter", status)
        if (axis%kind /= axis_parameter) call refuse_key(place, "weights", "a parameter", status)
        says_no_unit = quantity%name == ""
        call read_values(place, quantity, axis, status)
        if (axis%kind == axis_time) call require_tables_cover(place, scene, axis, status)
        added%is_there = says_no_unit .and. quantity%name /= ""
        if (added%is_there) added%text = si_unit_text(quantity%power)
        call get_text(place, "group", text, status, found)
        if (found) group = text
        call get_text(place, "name", text, status, found)
        if (found) axis%name = text
    end subroutine read_axis

    subroutine refuse_key(place, key, owner, status)
        type(scene_place), intent(in) :: place
        character(len=*), intent(in) :: key, owner
        type(status_type), intent(inout) :: status
        type(toml_node) :: node

        node = place%node%get(key)
        if (node%is_present()) call refuse_value(place, key, node, "belongs to an axis over "//owner// &
            " (expected none here)", status)
    end subroutine refuse_key

    !> The coordinate under a key, and what its values are.
    subroutine find_coordinate(place, key, scene, axis, quantity, status)
        type(scene_place), intent(in) :: place
        character(len=*), intent(in) :: key
        type(scene_type), intent(in) :: scene
        type(axis_spec), intent(inout) :: axis
        type(quantity_type), intent(out) :: quantity
        type(status_type), intent(inout) :: status
        character(len=:), allocatable :: name
        logical :: is_length

        call get_text(place, key, name, status)
        if (.not. status%is_ok()) return
        axis%target = findloc(scene%coordinate%name == name, .true., dim=1)
        if (axis%target == 0) then
            call refuse_value(place, key, place%node%get(key), "= "//quoted(name)// &
                ": there is no such coordinate (expected one of "//join(scene%coordinate%name)//")"// &
                suggestion(name, (scene%coordinate%name)), status)
            return
        end if
        is_length = scene%coordinate(axis%target)%unit == "m"
        select case (axis%kind)
        case (axis_coordinate)
            quantity = angle
            if (is_length) quantity = length
            axis%name = name
        case (axis_rate)
            quantity = angular_rate
            if (is_length) quantity = speed
            axis%name = "rate of "//name
        case default
            quantity = per_second(angular_rate)
            if (is_length) quantity = acceleration
            axis%name = "acceleration of "//name
            quantity%unit = trim(scene%coordinate(axis%target)%unit)//"/s2"
        end select
        axis%unit = quantity%unit
    end subroutine find_coordinate

    !> A component of a load of the scene, or of one on a marker that has none yet.
    subroutine find_load(place, scene, axis, quantity, status)
        type(scene_place), intent(in) :: place
        type(scene_type), intent(inout) :: scene
        type(axis_spec), intent(inout) :: axis
        type(quantity_type), intent(out) :: quantity
        type(status_type), intent(inout) :: status
        character(len=:), allocatable :: name
        type(load_spec) :: load
        integer :: i

        call get_text(place, "load", name, status)
        call get_word(place, "component", component_name, axis%component, status)
        if (.not. status%is_ok()) return
        if (scene%planar .and. all(axis%component /= [1, 2, 6])) call refuse_value(place, "component", &
            place%node%get("component"), "= "//quoted(component_name(axis%component))// &
            " leaves the plane (expected one of 'Fx', 'Fy', 'Mz')", status)
        do i = 1, size(scene%load)
            if (scene%load(i)%name /= name) cycle
            if (axis%target > 0) call refuse_value(place, "load", place%node%get("load"), "= "//quoted(name)// &
                ": there are several loads on that marker (expected one)", status)
            axis%target = i
            associate (component => merge(scene%load(i)%force(1 + modulo(axis%component - 1, 3))%kind, &
                                          scene%load(i)%moment(1 + modulo(axis%component - 1, 3))%kind, axis%component <= 3))
                if (component == law_over) call refuse_value(place, "component", place%node%get("component"), &
                    "= "//quoted(component_name(axis%component))//" follows a law over the state, which an axis cannot replace "// &
                    "(expected another component, or an axis over a number of that law)", status)
            end associate
        end do
        if (axis%target == 0) then
            load%name = name
            load%line = place%line
            call find_marker(scene, place, "load", place%node%get("load"), load%link, load%marker, status)
            if (status%is_ok() .and. load%link == frame_link) call refuse_value(place, "load", place%node%get("load"), &
                "= "//quoted(name)//": a load on the frame moves nothing (expected a marker of a moving link)", status)
            if (.not. status%is_ok()) return
            scene%load = [scene%load, load]
            axis%target = size(scene%load)
        end if
        quantity = force
        if (axis%component > 3) quantity = moment
        axis%unit = quantity%unit
        axis%name = component_name(axis%component)//" on "//name
    end subroutine find_load

    !> One path, or a list of them with weights.
    subroutine read_parameter(place, root, axis, quantity, status)
        type(scene_place), intent(in) :: place
        type(toml_node), intent(in) :: root
        type(axis_spec), intent(inout) :: axis
        type(quantity_type), intent(inout) :: quantity          !! of its values; without a name where the file does not say
        type(status_type), intent(inout) :: status
        type(measured_value) :: number
        type(toml_node) :: node, item, weights
        character(len=:), allocatable :: path
        logical :: found, is_text
        integer :: i

        call get_word(place, "as", operation_name, axis%operation, status, found)
        node = place%node%get("parameter")
        weights = place%node%get("weights")
        if (.not. status%is_ok()) return
        if (node%kind() == toml_array) then
            if (node%count() == 0) call refuse_value(place, "parameter", node, "names nothing (expected paths)", status)
            allocate (axis%parameter(node%count()))
            do i = 1, size(axis%parameter)
                item = node%at(i)
                call item%get_text(path, is_text)
                if (.not. is_text .and. status%is_ok()) call refuse_value(place, "parameter", node, "holds "// &
                    item%kind_text()//" (expected paths such as 'link.rocker.mass')", status)
                if (is_text) axis%parameter(i)%path = path
            end do
        else
            call get_text(place, "parameter", path, status)
            allocate (axis%parameter(1))
            axis%parameter(1)%path = path
        end if
        if (.not. status%is_ok()) return
        if (weights%is_present()) then
            if (weights%kind() /= toml_array .or. weights%count() /= size(axis%parameter)) then
                call refuse_value(place, "weights", weights, "does not fit (expected a list of "// &
                    to_text(size(axis%parameter))//" numbers, one a path)", status)
                return
            end if
            do i = 1, size(axis%parameter)
                call quantity_of(place, "weights", weights%at(i), plain_number, axis%parameter(i)%weight, status)
            end do
        end if
        do i = 1, size(axis%parameter)
            call check_parameter(place, root, axis%parameter(i)%path, axis%operation /= set_value, number, status)
            call refuse_unheard(place, axis%parameter(i)%path, status)
            if (axis%operation == multiply_by) cycle
            if (i == 1) quantity%power = number%power
            quantity%name = ""
            if (number%has_unit .and. all(number%power == quantity%power)) quantity%name = dimension_text(number%power)
        end do
        axis%name = trim(axis%parameter(1)%path)
        if (size(axis%parameter) > 1) axis%name = trim(axis%name)//", ..."
        if (axis%operation /= set_value) axis%name = trim(operation_name(axis%operation))//" of "//axis%name
        axis%unit = merge("1 ", "SI", axis%operation == multiply_by)
        if (axis%operation /= multiply_by .and. number%has_unit .and. usual_unit(quantity%power) /= "") &
            axis%unit = usual_unit(quantity%power)
    end subroutine read_parameter

    !> A sweep is of inverse dynamics, which does not ask what drives and controllers do of themselves.
    subroutine refuse_unheard(place, path, status)
        type(scene_place), intent(in) :: place
        character(len=*), intent(in) :: path
        type(status_type), intent(inout) :: status
        character(len=*), parameter :: forward_alone(*) = [character(len=10) :: "controller", "event"]
        ! of an actuator: what its force becomes in a motor's winding, a brake or a cylinder no quantity of a sweep tells
        character(len=*), parameter :: of_actuator(*) = [character(len=18) :: ".law.", ".drive.resistance", ".drive.inductance", &
                                                         ".drive.creep_speed", ".drive.brake.", ".cylinder."]
        logical :: is_of_actuator
        integer :: i
        character(len=:), allocatable :: table

        table = path(:scan(path//".", ".[") - 1)
        if (status%is_ok() .and. table == "variables") then
            if (.not. place%variables%was_used(path(len(table) + 2:))) call refuse(place, "parameter "//quoted(path)// &
                " changes nothing: no number of the scene refers to that variable (expected one that is used)", status)
        end if
        if (status%is_ok() .and. table == "time" .and. path /= "time.start") call refuse(place, "parameter "//quoted(path)// &
            " changes nothing: samples of a sweep are those of its axes (expected an axis with time = true)", status)
        is_of_actuator = table == "actuator" .and. any([(index(path, trim(of_actuator(i))) > 0, i=1, size(of_actuator))])
        if (.not. (any(forward_alone == table) .or. is_of_actuator)) return
        if (status%is_ok()) call refuse(place, "parameter "//quoted(path)//" only affects forward runs, and a sweep is of "// &
            "inverse dynamics (expected what the mechanism is, or how it moves; Scene.with_ and Scene.forward instead)", status)
    end subroutine refuse_unheard

    !> Along the motion of the scene.
    subroutine read_time_axis(place, scene, axis, quantity, status)
        type(scene_place), intent(in) :: place
        type(scene_type), intent(in) :: scene
        type(axis_spec), intent(inout) :: axis
        type(quantity_type), intent(out) :: quantity
        type(status_type), intent(inout) :: status
        logical :: is_wanted

        is_wanted = .false.
        call get_flag(place, "time", is_wanted, status)
        if (status%is_ok() .and. .not. is_wanted) call refuse_value(place, "time", place%node%get("time"), &
            "is false (expected true, or another key)", status)
        quantity = time_span
        axis%name = "time"
        axis%unit = "s"
    end subroutine read_time_axis

    !> A table says nothing about instants before its first row and after its last.
    subroutine require_tables_cover(place, scene, axis, status)
        type(scene_place), intent(in) :: place
        type(scene_type), intent(in) :: scene
        type(axis_spec), intent(in) :: axis
        type(status_type), intent(inout) :: status
        type(heard_table), allocatable :: heard(:)
        real(wp) :: first, last
        integer :: short

        if (.not. status%is_ok()) return
        first = min(axis%from, axis%to)
        last = max(axis%from, axis%to)
        if (allocated(axis%value)) then
            first = minval(axis%value)
            last = maxval(axis%value)
        end if
        call list_tables(scene, hearing(), heard)
        short = find_short_table(heard, first, last)
        if (short > 0) call refuse(place, "leaves what is known of "//trim(heard(short)%owner)//": "// &
            short_in_words(heard(short), first, last, "sweep"), status)
    end subroutine require_tables_cover

    !> The values of an axis, in one of the forms of `sampling_name`.
    subroutine read_values(place, quantity, axis, status)
        type(scene_place), intent(in) :: place
        type(quantity_type), intent(inout) :: quantity
        type(axis_spec), intent(inout) :: axis
        type(status_type), intent(inout) :: status
        type(scene_place) :: inner
        type(toml_node) :: node
        integer :: i, n

        do i = 1, size(sampling_name)
            node = place%node%get(sampling_name(i))
            if (.not. node%is_present() .or. .not. status%is_ok()) cycle
            if (axis%sampling > 0) call refuse(place, "has both "//quoted(sampling_name(axis%sampling))//" and "// &
                quoted(sampling_name(i))//" (expected one of them)", status)
            axis%sampling = i
        end do
        if (.not. status%is_ok()) return
        if (axis%sampling == 0) then
            call refuse(place, "has no values (expected one of "//join(sampling_name)//")", status)
            return
        end if
        node = place%node%get(sampling_name(axis%sampling))
        select case (axis%sampling)
        case (sampling_linspace)
            if (node%kind() /= toml_array .or. node%count() /= 3) then
                call refuse_value(place, "linspace", node, "does not fit (expected [from, to, n])", status)
                return
            end if
            call value_of(place, "linspace", node%at(1), quantity, axis, axis%from, status)
            call value_of(place, "linspace", node%at(2), quantity, axis, axis%to, status)
            call count_of(place, "linspace", node%at(3), axis%n, status)
        case (sampling_values)
            if (node%kind() /= toml_array) then
                call refuse_value(place, "values", node, "is "//node%kind_text()//" (expected a list)", status)
                return
            end if
            axis%n = node%count()
            if (axis%n == 0) call refuse_value(place, "values", node, "is empty (expected at least one value)", status)
            allocate (axis%value(axis%n), source=0.0_wp)
            do i = 1, node%count()
                call value_of(place, "values", node%at(i), quantity, axis, axis%value(i), status)
            end do
        case default
            inner = place_at(place, node, trim(place%what)//", "//trim(sampling_name(axis%sampling)))
            call require_table(inner, "a table, { from = .., to = .., n = .. }", status)
            call allow_keys(inner, [character(len=4) :: "from", "to", "n", "seed"], status)
            call need(inner, "from", axis%from)
            call need(inner, "to", axis%to)
            if (status%is_ok()) then
                node = inner%node%get("n")
                if (.not. node%is_present()) call refuse_missing(inner, "n", "the number of samples", status)
                call count_of(inner, "n", node, axis%n, status)
            end if
            n = 0
            call get_integer(inner, "seed", n, status, axis%is_shifted)
            axis%seed = n
        end select
        if (status%is_ok() .and. .not. abs(axis%to - axis%from) <= huge(axis%from)) call refuse_value(place, &
            trim(sampling_name(axis%sampling)), node, "exceeds the range of numbers (expected ends less far apart)", &
            status)

    contains

        subroutine need(inner, key, value)
            type(scene_place), intent(in) :: inner
            character(len=*), intent(in) :: key
            real(wp), intent(inout) :: value
            type(toml_node) :: item

            if (.not. status%is_ok()) return
            item = inner%node%get(key)
            if (.not. item%is_present()) call refuse_missing(inner, key, "one end of the range", status)
            call value_of(inner, key, item, quantity, axis, value, status)
        end subroutine need
    end subroutine read_values

    !> A value of an axis; that of a parameter may have any unit of its dimension, which the file says, or else its first value.
    subroutine value_of(place, key, node, quantity, axis, value, status)
        type(scene_place), intent(in) :: place
        character(len=*), intent(in) :: key
        type(toml_node), intent(in) :: node
        type(quantity_type), intent(inout) :: quantity
        type(axis_spec), intent(in) :: axis
        real(wp), intent(inout) :: value
        type(status_type), intent(inout) :: status
        type(measured_value) :: found
        character(len=:), allocatable :: text, problem
        logical :: is_text

        if (.not. status%is_ok()) return
        if (axis%kind == axis_parameter .and. node%kind() == toml_string) then
            call node%get_text(text, is_text)
            call measured_of_text(text, place%variables, found, problem)
            value = found%value
            if (problem /= "") then
                call refuse_value(place, key, node, "= "//problem//" (expected a number, or a text with its unit)", status)
            else if (found%has_unit .and. quantity%name /= "" .and. any(found%power(:4) /= quantity%power(:4))) then
                call refuse_value(place, key, node, "= "//quoted(text)//" is "//dimension_text(found%power)//" (expected "// &
                    trim(quantity%name)//")", status)
            else if (found%has_unit) then
                quantity%power = found%power
                quantity%name = dimension_text(found%power)
            end if
        else
            call quantity_of(place, key, node, merge(plain_number, quantity, axis%kind == axis_parameter), value, status)
        end if
    end subroutine value_of

    !> How many values.
    subroutine count_of(place, key, node, n, status)
        type(scene_place), intent(in) :: place
        character(len=*), intent(in) :: key
        type(toml_node), intent(in) :: node
        integer(int64), intent(out) :: n
        type(status_type), intent(inout) :: status
        integer :: number
        logical :: is_one

        n = 1
        if (.not. status%is_ok()) return
        call node%get_integer(number, is_one)
        if (.not. is_one) then
            call refuse_value(place, key, node, "is no number of values (expected an integer from 1 on)", status)
        else if (number < 1) then
            call refuse_value(place, key, node, "= "//to_text(number)//" makes an empty axis (expected 1 or more)", status)
        else
            n = number
        end if
    end subroutine count_of

    !> Axes of one group advance together, so they have as many values each.
    subroutine form_groups(place, group, is_zip, spec, status)
        type(scene_place), intent(in) :: place
        character(len=*), intent(in) :: group(:)
        logical, intent(in) :: is_zip                  !! all axes without a group are one
        type(sweep_spec), intent(inout) :: spec
        type(status_type), intent(inout) :: status
        integer :: i, j, n_sobol, n_sampled

        spec%n_group = 0
        n_sampled = 0
        do i = 1, size(spec%axis)
            associate (axis => spec%axis(i))
                do j = 1, i - 1
                    if (group(j) == group(i) .and. (group(i) /= "" .or. is_zip)) axis%group = spec%axis(j)%group
                    if (axis%kind /= axis_parameter .and. axis%name == spec%axis(j)%name) call refuse(place, "axis "// &
                        quoted(axis%name)//" is there twice (expected each once)", status, axis%line)
                    if (replaces(axis, spec%axis(j))) call refuse(place, "axis "//quoted(axis%name)//" replaces what axis "// &
                        quoted(spec%axis(j)%name)//" gives (expected one axis over it, or a factor or an offset behind a value)", &
                        status, axis%line)
                end do
                if (axis%group == 0) then
                    spec%n_group = spec%n_group + 1
                    axis%group = spec%n_group
                end if
                j = findloc(spec%axis%group, axis%group, dim=1)
                if (axis%n /= spec%axis(j)%n) call refuse(place, "axes "//quoted(spec%axis(j)%name)//" and "// &
                    quoted(axis%name)//" of one group have "//to_text(int(spec%axis(j)%n))//" and "// &
                    to_text(int(axis%n))//" values (expected as many)", status, axis%line)
                if ((axis%kind == axis_parameter) .neqv. (spec%axis(j)%kind == axis_parameter)) call refuse(place, "axes "// &
                    quoted(spec%axis(j)%name)//" and "//quoted(axis%name)//" are of one group, but only one is a parameter "// &
                    "(expected groups of their own: designs run outside poses)", status, axis%line)
                if (axis%sampling < sampling_random) cycle
                ! Random numbers of any two axes are independent; a Sobol sequence is that of its group.
                n_sampled = n_sampled + 1
                axis%dimension = n_sampled
                if (axis%sampling /= sampling_sobol) cycle
                n_sobol = count(spec%axis(:i)%group == axis%group .and. spec%axis(:i)%sampling == sampling_sobol)
                axis%dimension = n_sobol
                if (n_sobol > most_sobol_dimensions) call refuse(place, "a Sobol sequence of more than "// &
                    to_text(most_sobol_dimensions)//" axes (expected fewer, or latin-hypercube)", status, axis%line)
            end associate
        end do
    end subroutine form_groups

    !> Whether an axis puts its values where an earlier one, of another name perhaps, has put its own.
    pure logical function replaces(axis, earlier)
        type(axis_spec), intent(in) :: axis, earlier
        integer :: k

        replaces = axis%kind == earlier%kind
        if (.not. replaces) return
        if (axis%kind == axis_parameter) then
            replaces = axis%operation == set_value .and. any([(any(earlier%parameter%path == axis%parameter(k)%path), &
                                                               k=1, size(axis%parameter))])
        else
            replaces = axis%target == earlier%target .and. axis%component == earlier%component
        end if
    end function replaces

    ! ---------------------------------------------------------------- what is reduced and kept

    !> Quantities that are reduced and kept, and what they are asked with.
    subroutine read_wishes(place, scene, status)
        type(scene_place), intent(in) :: place
        type(scene_type), intent(inout) :: scene
        type(status_type), intent(inout) :: status
        logical :: found, flag

        associate (spec => scene%sweep)
            call read_quantities(place, "reduce", spec%wants, status, found)
            if (.not. found) spec%wants(usual_quantities) = .true.
            if (.not. found .and. any(scene%joint%kind == joint_cam)) spec%wants(quantity_contact_force) = .true.
            if (.not. found .and. any(scene%actuator%motor%is_given)) &
                spec%wants([quantity_motor_torque, quantity_motor_speed, quantity_motor_power]) = .true.
            if (.not. found .and. any(has_limits(scene%actuator%motor))) spec%wants(quantity_torque_margin) = .true.
            call read_quantities(place, "keep", spec%keeps, status, found)
            flag = .true.
            call get_flag(place, "moments", flag, status)
            spec%extremes_only = .not. flag
            call get_quantity(place, "length", length, spec%length, status, found)
            if (found .and. status%is_ok() .and. .not. spec%length > 0) call refuse_value(place, "length", &
                place%node%get("length"), "= "//to_text(spec%length)//" m (expected a length above zero)", status)
            call get_integer(place, "chunk", spec%chunk, status, found)
            if (status%is_ok() .and. (spec%chunk < 1 .or. spec%chunk > 1048576)) call refuse_value(place, "chunk", &
                place%node%get("chunk"), "= "//to_text(spec%chunk)//" (expected 1 to 1048576 samples)", status)
        end associate
        call read_tool(place, scene, status)
        call read_histograms(place, scene, status)
    end subroutine read_wishes

    !> Where unit wrenches act: at the marker named, else where the only load does.
    subroutine read_tool(place, scene, status)
        type(scene_place), intent(in) :: place
        type(scene_type), intent(inout) :: scene
        type(status_type), intent(inout) :: status
        character(len=:), allocatable :: key
        logical :: found

        associate (spec => scene%sweep)
            call get_text(place, "on", key, status, found)
            if (found) then
                spec%tool = key
                call find_marker(scene, place, "on", place%node%get("on"), spec%tool_link, spec%tool_marker, status)
                if (status%is_ok() .and. spec%tool_link == frame_link) call refuse_value(place, "on", place%node%get("on"), &
                    "= "//quoted(key)//": a wrench on the frame moves nothing (expected a marker of a moving link)", status)
            else if (size(scene%load) == 1) then
                spec%tool = scene%load(1)%name
                spec%tool_link = scene%load(1)%link
                spec%tool_marker = scene%load(1)%marker
            end if
        end associate
    end subroutine read_tool

    !> `histogram = { driving_force = true, bins = 64 }`: what is asked for so is reduced, too.
    subroutine read_histograms(place, scene, status)
        type(scene_place), intent(in) :: place
        type(scene_type), intent(inout) :: scene
        type(status_type), intent(inout) :: status
        type(scene_place) :: inner
        type(toml_node) :: node, item
        character(len=:), allocatable :: key
        integer :: i, id, line
        logical :: found, flag, is_flag

        associate (spec => scene%sweep)
            node = place%node%get("histogram")
            if (.not. node%is_present() .or. .not. status%is_ok()) return
            inner = place_at(place, node, "sweep, histogram")
            call require_table(inner, "a table such as { driving_force = true, bins = 64 }", status)
            call allow_keys(inner, [character(len=20) :: "bins", quantity_name], status)
            call get_integer(inner, "bins", spec%n_bin, status, found)
            if (status%is_ok() .and. (spec%n_bin < 1 .or. spec%n_bin > 100000)) call refuse_value(inner, "bins", &
                inner%node%get("bins"), "= "//to_text(spec%n_bin)//" (expected 1 to 100000)", status)
            do i = 1, inner%node%count()
                call inner%node%key(i, key, line)
                id = findloc(quantity_name == key, .true., dim=1)
                if (id == 0 .or. .not. status%is_ok()) cycle
                item = inner%node%get(key)
                if (item%kind() == toml_table) then
                    call read_range(scene, place_at(inner, item, "sweep, histogram of "//key), id, status)
                else
                    call item%get_flag(flag, is_flag)
                    if (.not. is_flag) call refuse_value(inner, key, item, "is "//item%kind_text()// &
                        " (expected true, or a table { from = .., to = .. })", status)
                    if (is_flag .and. .not. flag) cycle
                end if
                spec%has_histogram(id) = .true.
                spec%wants(id) = .true.
            end do
        end associate
    end subroutine read_histograms

    subroutine read_range(scene, place, id, status)
        type(scene_type), intent(inout) :: scene
        type(scene_place), intent(in) :: place
        integer, intent(in) :: id
        type(status_type), intent(inout) :: status
        type(described) :: quantity

        call describe_quantity(scene, id, quantity)
        call allow_keys(place, [character(len=4) :: "from", "to"], status)
        call get_quantity(place, "from", quantity_in(quantity%unit(1)), scene%sweep%bin_from(id), status)
        call get_quantity(place, "to", quantity_in(quantity%unit(1)), scene%sweep%bin_to(id), status)
        if (status%is_ok() .and. .not. scene%sweep%bin_to(id) > scene%sweep%bin_from(id)) &
            call refuse(place, "'to' is not above 'from' (expected a range)", status)
    end subroutine read_range

    !> The axes over which a map is kept: each alone in its group, with values in order.
    subroutine read_map(place, spec, status)
        type(scene_place), intent(in) :: place
        type(sweep_spec), intent(inout) :: spec
        type(status_type), intent(inout) :: status
        type(toml_node) :: node, item
        character(len=:), allocatable :: name
        logical :: is_text
        real(wp) :: n_cell
        integer :: i, k

        if (.not. status%is_ok()) return
        node = place%node%get("map")
        if (.not. node%is_present()) return
        if (node%kind() /= toml_array) then
            call refuse_value(place, "map", node, "is "//node%kind_text()//" (expected a list of axes)", status)
            return
        end if
        n_cell = 1
        do i = 1, node%count()
            item = node%at(i)
            call item%get_text(name, is_text)
            k = 0
            if (is_text) k = findloc(spec%axis%name == name, .true., dim=1)
            if (k == 0) then
                call refuse_value(place, "map", node, "holds "//quoted(name)//" (expected some of the axes "// &
                    join(spec%axis%name)//")"//suggestion(name, (spec%axis%name)), status)
                return
            end if
            if (any(spec%map_axis == k)) call refuse_value(place, "map", node, "holds "//quoted(name)//" twice", status)
            if (spec%axis(k)%kind == axis_parameter) call refuse_value(place, "map", node, "holds "//quoted(name)// &
                ": every design has a map of its own (expected axes over poses or loads)", status)
            if (spec%axis(k)%sampling >= sampling_random .or. count(spec%axis%group == spec%axis(k)%group) > 1) &
                call refuse_value(place, "map", node, "holds "//quoted(name)// &
                ": its values form no grid (expected an axis with linspace or values, in no group)", status)
            spec%map_axis = [spec%map_axis, k]
            n_cell = n_cell*real(spec%axis(k)%n, wp)
        end do
        if (n_cell > most_cells .or. any(spec%axis(spec%map_axis)%n > longest_table)) call refuse_value(place, "map", node, &
            "has too many cells (expected at most 1e8, 65536 along an axis)", status)
    end subroutine read_map

    !> A list of names of quantities, or "all".
    subroutine read_quantities(place, key, chosen, status, found)
        type(scene_place), intent(in) :: place
        character(len=*), intent(in) :: key
        logical, intent(inout) :: chosen(n_quantity)
        type(status_type), intent(inout) :: status
        logical, intent(out) :: found
        type(toml_node) :: node, item
        character(len=:), allocatable :: name
        logical :: is_text
        integer :: i, id

        found = .false.
        if (.not. status%is_ok()) return
        node = place%node%get(key)
        found = node%is_present()
        if (.not. found) return
        if (node%kind() /= toml_array) then
            call refuse_value(place, key, node, "is "//node%kind_text()//" (expected a list of "//join(quantity_name)//")", status)
            return
        end if
        do i = 1, node%count()
            item = node%at(i)
            call item%get_text(name, is_text)
            id = 0
            if (is_text) id = findloc(quantity_name == name, .true., dim=1)
            if (id == 0) then
                call refuse_value(place, key, item, "holds "//quoted(name)//" (expected some of "//join(quantity_name)//")"// &
                    suggestion(name, quantity_name), status)
                return
            end if
            chosen(id) = .true.
        end do
    end subroutine read_quantities

    !> What a wish needs must be there.
    subroutine check_wishes(place, scene, status)
        type(scene_place), intent(in) :: place
        type(scene_type), intent(inout) :: scene
        type(status_type), intent(inout) :: status
        integer :: id

        associate (spec => scene%sweep)
            spec%wants = spec%wants .or. spec%keeps
            if (.not. any(spec%wants) .and. status%is_ok()) &
                call refuse(place, "'reduce' names nothing (expected some of "//join(quantity_name)//")", status)
            if (spec%tool_link == 0 .and. any(spec%wants([quantity_force_amplification, quantity_moment_amplification]))) &
                call refuse_missing(place, "on", "the marker on which unit forces and moments act, for amplification", status)
            if (scene%planar .and. spec%wants(quantity_swing)) &
                call refuse(place, "'swing' is for spatial scenes (expected 'joint_variable' in a plane)", status)
            if (scene%planar .and. spec%wants(quantity_clearance)) &
                call refuse(place, "'clearance' is for spatial scenes: links of a plane lie beside each other", status)
            do id = 1, n_quantity
                if (spec%wants(id) .and. status%is_ok()) call refuse_without_motors(place, scene, id, status)
                if (spec%wants(id) .and. status%is_ok()) call refuse_without_cams(place, scene, id, status)
            end do
        end associate
    end subroutine check_wishes

    !> Motors must be there of which something is told.
    subroutine refuse_without_motors(place, scene, id, status)
        type(scene_place), intent(in) :: place
        type(scene_type), intent(in) :: scene
        integer, intent(in) :: id                         !! of the quantity
        type(status_type), intent(inout) :: status

        if (.not. any(id == of_motors)) return
        if (.not. any(scene%actuator%motor%is_given)) then
            call refuse(place, quoted(quantity_name(id))//" is for scenes with motors (expected an actuator with the "// &
                "key 'drive')", status)
        else if (id == quantity_motor_current .and. .not. any(scene%actuator%motor%torque_constant > 0)) then
            call refuse(place, quoted(quantity_name(id))//" needs the 'torque_constant' of drives, which they do not have", status)
        else if (id == quantity_torque_margin .and. .not. any(has_limits(scene%actuator%motor))) then
            call refuse(place, quoted(quantity_name(id))//" needs limits of drives, which they do not have (expected "// &
                "'torque_limit', 'current_limit' or 'torque_curve')", status)
        end if
    end subroutine refuse_without_motors

    !> Cams must be there of which something is told, and a guide of each follower.
    subroutine refuse_without_cams(place, scene, id, status)
        type(scene_place), intent(in) :: place
        type(scene_type), intent(in) :: scene
        integer, intent(in) :: id                         !! of the quantity
        type(status_type), intent(inout) :: status
        integer :: j

        if (.not. any(id == [quantity_contact_force, quantity_pressure_angle])) return
        if (.not. any(scene%joint%kind == joint_cam)) call refuse(place, quoted(quantity_name(id)) &
            //" is for scenes with cams (expected a joint of type 'cam')", status)
        if (id == quantity_contact_force) return
        do j = 1, size(scene%joint)
            if (scene%joint(j)%kind /= joint_cam .or. .not. status%is_ok()) cycle
            if (guide_of(scene, j) == 0) call refuse(place, quoted(quantity_name(id))//": the follower of "// &
                quoted(scene%joint(j)%name)//" has no guide (expected one hinge or slide that holds it on the frame)", status)
        end do
    end subroutine refuse_without_cams

    ! ---------------------------------------------------------------- bounds

    subroutine read_bounds(place, key, is_limit, scene, status)
        type(scene_place), intent(in) :: place
        character(len=*), intent(in) :: key
        logical, intent(in) :: is_limit
        type(scene_type), intent(inout) :: scene
        type(status_type), intent(inout) :: status
        type(toml_node) :: list
        type(bound_spec) :: bound
        integer :: i, n

        call table_list(place, key, list, n, status)
        do i = 1, n
            call read_bound(place_at(place, list%at(i), "sweep "//key//" "//to_text(i)), scene, bound, status)
            if (.not. status%is_ok()) return
            bound%is_limit = is_limit
            scene%sweep%bound = [scene%sweep%bound, bound]
            scene%sweep%wants(bound%quantity) = .true.
        end do
    end subroutine read_bounds

    subroutine read_bound(place, scene, bound, status)
        type(scene_place), intent(in) :: place
        type(scene_type), intent(in) :: scene
        type(bound_spec), intent(out) :: bound
        type(status_type), intent(inout) :: status
        type(described) :: quantity
        type(quantity_type) :: dimension
        character(len=:), allocatable :: name
        logical :: has_name, has_min, has_max

        bound%line = place%line
        call allow_keys(place, [character(len=4) :: "of", "at", "min", "max", "name"], status)
        call get_word(place, "of", quantity_name, bound%quantity, status)
        if (.not. status%is_ok()) return
        if (scene%planar .and. (bound%quantity == quantity_swing .or. bound%quantity == quantity_clearance)) then
            call refuse_value(place, "of", place%node%get("of"), "= "//quoted(quantity_name(bound%quantity))// &
                " is for spatial scenes (expected another quantity)", status)
            return
        end if
        call refuse_without_motors(place, scene, bound%quantity, status)
        if (status%is_ok()) call refuse_without_cams(place, scene, bound%quantity, status)
        if (.not. status%is_ok()) return
        call describe_quantity(scene, bound%quantity, quantity)
        call choose_entries(place, quantity, bound%entry, status)
        if (.not. status%is_ok()) return
        dimension = quantity_in(quantity%unit(bound%entry(1)))
        if (any(quantity%unit(bound%entry) /= quantity%unit(bound%entry(1)))) then
            call refuse(place, "bounds entries of different units, "//trim(quantity%unit(bound%entry(1)))//" and others "// &
                "(expected 'at' to name those of one unit)", status)
            return
        end if
        call get_quantity(place, "min", dimension, bound%low, status, has_min)
        call get_quantity(place, "max", dimension, bound%high, status, has_max)
        if (status%is_ok() .and. .not. (has_min .or. has_max)) &
            call refuse(place, "missing key 'min' or 'max' (expected at least one)", status)
        if (status%is_ok() .and. bound%low > bound%high) call refuse(place, "'min' = "//to_text(bound%low)//" is above 'max' = "// &
            to_text(bound%high)//" (expected no pose to be excluded by both)", status)
        call get_text(place, "name", name, status, has_name)
        bound%name = quantity_name(bound%quantity)
        if (.not. has_name .or. .not. status%is_ok()) return
        bound%name = name
        if (name == "" .or. any(fixed_outcome == name)) call refuse_value(place, "name", place%node%get("name"), &
            "= "//quoted(name)//" (expected another name than those of other outcomes, "//join(fixed_outcome)//")", status)
    end subroutine read_bound

    !> The entries that `at` names, by label; all if it is absent. A joint stands for all its components.
    subroutine choose_entries(place, quantity, entry, status)
        type(scene_place), intent(in) :: place
        type(described), intent(in) :: quantity
        integer, allocatable, intent(out) :: entry(:)
        type(status_type), intent(inout) :: status
        type(toml_node) :: node, item
        character(len=:), allocatable :: name
        logical :: is_text
        integer :: i, k, n

        node = place%node%get("at")
        if (.not. node%is_present()) then
            entry = [(k, k=1, quantity%n)]
            if (quantity%n == 0) call refuse(place, "there is nothing it could bound in this scene", status)
            return
        end if
        allocate (entry(0))
        n = 1
        if (node%kind() == toml_array) n = node%count()
        do i = 1, n
            item = node
            if (node%kind() == toml_array) item = node%at(i)
            call item%get_text(name, is_text)
            k = 0
            if (is_text) k = findloc(quantity%label == name, .true., dim=1)
            if (k == 0) then
                call refuse_value(place, "at", node, "holds "//quoted(name)//" (expected some of "//join(quantity%label)//")"// &
                    suggestion(name, quantity%label), status)
                return
            end if
            entry = [entry, k]
        end do
        if (n == 0) call refuse_value(place, "at", node, "is empty (expected some of "//join(quantity%label)//")", status)
    end subroutine choose_entries

    !> What a unit of results measures.
    pure type(quantity_type) function quantity_in(unit) result(quantity)
        character(len=*), intent(in) :: unit

        select case (unit)
        case ("N")
            quantity = force
        case ("N m")
            quantity = moment
        case ("m")
            quantity = length
        case ("rad")
            quantity = angle
        case ("m/s")
            quantity = speed
        case ("rad/s")
            quantity = angular_rate
        case ("W")
            quantity = wattage
        case ("1/m")
            quantity = quantity_type("a force per moment", "2 1/m", "1/m", [0, -1, 0, 0, 0])
        case default
            quantity = plain_number
        end select
    end function quantity_in

    ! ---------------------------------------------------------------- bodies and neutral directions

    !> `clearance = { diameter = 0.1, segments = [..] }`: bodies whose distances are looked at.
    subroutine read_bodies(place, scene, status)
        type(scene_place), intent(in) :: place
        type(scene_type), intent(inout) :: scene
        type(status_type), intent(inout) :: status
        type(scene_place) :: inner
        type(toml_node) :: node, list
        logical :: found
        integer :: i

        if (.not. status%is_ok()) return
        node = place%node%get("clearance")
        if (.not. node%is_present()) return
        inner = place_at(place, node, "sweep, clearance")
        call require_table(inner, "a table, { diameter = .. }", status)
        call allow_keys(inner, [character(len=8) :: "diameter", "segments"], status)
        call get_quantity(inner, "diameter", length, scene%sweep%leg_diameter, status, found)
        if (status%is_ok() .and. scene%sweep%leg_diameter < 0) call refuse_value(inner, "diameter", &
            inner%node%get("diameter"), "is negative (expected a length)", status)
        if (.not. status%is_ok()) return
        list = inner%node%get("segments")
        if (.not. list%is_present()) return
        deallocate (scene%sweep%segment)
        allocate (scene%sweep%segment(list%count()))
        do i = 1, list%count()
            call read_segment(list%at(i), scene%sweep%segment(i))
        end do
        if (list%count() < 2) call refuse_value(inner, "segments", list, "has fewer than two (expected pairs of markers)", status)

    contains

        subroutine read_segment(pair, segment)
            type(toml_node), intent(in) :: pair
            type(segment_spec), intent(out) :: segment
            integer :: side

            segment%diameter = scene%sweep%leg_diameter
            if (.not. status%is_ok()) return
            if (pair%kind() /= toml_array .or. pair%count() /= 2) then
                call refuse_value(inner, "segments", pair, "holds something else (expected pairs of markers)", status)
                return
            end if
            do side = 1, 2
                call find_marker(scene, inner, "segments", pair%at(side), segment%link(side), segment%marker(side), status)
            end do
        end subroutine read_segment
    end subroutine read_bodies

    !> `swing = { "leg1.S" = [0, 0, 1] }`: neutral directions of joints in the axes of the link that is not the leg.
    subroutine read_swings(place, scene, status)
        type(scene_place), intent(in) :: place
        type(scene_type), intent(inout) :: scene
        type(status_type), intent(inout) :: status
        type(scene_place) :: inner
        type(toml_node) :: node
        character(len=:), allocatable :: key
        type(swing_spec) :: swing
        type(described) :: quantity
        integer :: i, line

        if (.not. status%is_ok()) return
        node = place%node%get("swing")
        if (.not. node%is_present()) return
        inner = place_at(place, node, "sweep, swing")
        call require_table(inner, "a table of joints and their neutral directions", status)
        call describe_quantity(scene, quantity_swing, quantity)
        do i = 1, inner%node%count()
            if (.not. status%is_ok()) return
            call inner%node%key(i, key, line)
            if (all(quantity%label /= key)) then
                call refuse(inner, "there is no universal or spherical joint "//quoted(key)//" (expected one of "// &
                    join(quantity%label)//")", status, line)
                return
            end if
            swing%joint = findloc(scene%joint%name == key, .true., dim=1)
            call direction_of(inner, key, inner%node%get(key), swing%neutral, status)
            scene%sweep%swing = [scene%sweep%swing, swing]
        end do
    end subroutine read_swings
end module linkdyn_scene_sweep
