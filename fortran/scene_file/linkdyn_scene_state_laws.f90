!> Laws over the state of the mechanism in a scene file: the tables [measures] and [laws], and forces that follow them.
!>
!> A force is a law over the state if it is a table with the key `over`, or a text that mentions a measure, a law or `time`.
module linkdyn_scene_state_laws
    use linkdyn_constants, only: pi
    use linkdyn_csv, only: column_of
    use linkdyn_expression, only: measured_value, is_reserved, is_unit_name, name_letters
    use linkdyn_formula, only: formula_type, formula_node, add_node, node_number, node_symbol
    use linkdyn_joint_table, only: wraps
    use linkdyn_kinds, only: wp
    use linkdyn_scene, only: scene_type, law_spec, state_law, measure_spec, name_len, coordinate_joint, frame_link, measure_time, &
        measure_joint, measure_marker, measure_spring, measure_touch, measure_distance, measure_attitude, measure_tilt, &
        measure_twist, measure_turn, law_over
    use linkdyn_scene_joints, only: variable_quantity
    use linkdyn_scene_keys, only: scene_place, place_at, refuse, refuse_value, refuse_missing, allow_keys, require_table, &
        get_quantity, get_name, get_text, get_word, get_flag, text_of
    use linkdyn_scene_laws, only: table_shelf, table_reading, read_law, read_table_keys, column_in_si, table_law, spline, &
        straight_lines, require_positive
    use linkdyn_scene_names, only: find_marker, find_joint, find_variable, find_link
    use linkdyn_status, only: status_type, status_bad_input, fail
    use linkdyn_suggest, only: suggestion
    use linkdyn_spline, only: fit_spline, fit_periodic_spline
    use linkdyn_text, only: quoted, to_text
    use linkdyn_toml, only: toml_node, toml_table, toml_string, toml_array
    use linkdyn_units, only: quantity_type, n_dimension, dimension_text, si_unit_text, read_value, length, angle, time_span
    use linkdyn_variables, only: symbol_entry, formula_of_text
    implicit none (type, external)
    private
    public :: read_measures, read_named_laws, read_force_law, read_spring_law, read_coordinate_measure, add_joint_measure, &
        add_place_measure, pose_measure, measure_quantity, add_touch

    character(len=13), parameter :: over_key(9) = [character(len=13) :: "law", "table", "column", "over", "argument", &
        "interpolation", "period", "type", "at"]    ! the last two of actuators only

contains

    ! ---------------------------------------------------------------- measures

    !> The table [measures], and `time`, which is always there.
    subroutine read_measures(root, scene, shelf, status)
        type(scene_place), intent(in) :: root
        type(scene_type), intent(in) :: scene
        type(table_shelf), intent(inout) :: shelf
        type(status_type), intent(inout) :: status
        type(scene_place) :: place
        type(toml_node) :: node
        type(measure_spec) :: measure
        character(len=:), allocatable :: key
        integer :: i, line

        allocate (shelf%book%measure(0), shelf%book%law(0))
        if (.not. status%is_ok()) return
        call add_measure(root, measure_spec(name="time", kind=measure_time), time_span, shelf)
        node = root%node%get("measures")
        if (.not. node%is_present()) return
        place = place_at(root, node, "measures")
        call require_table(place, "a table of names, written [measures]", status)
        do i = 1, node%count()
            if (.not. status%is_ok()) return
            call node%key(i, key, line)
            call require_symbol_name(root, "measure", key, line, status)
            measure = measure_spec(name=key)
            if (status%is_ok()) call read_measure(root, node%get(key), line, scene, measure, shelf, status)
        end do
    end subroutine read_measures

    !> One measure: { joint = .. }, { coordinate = .. }, { marker = .., component = .. }, { between = [.., ..] },
    !> { axes = [.., ..] } or { twist = [.., ..] }, each with rate = true for how fast it changes.
    subroutine read_measure(root, node, line, scene, measure, shelf, status)
        type(scene_place), intent(in) :: root
        type(toml_node), intent(in) :: node
        integer, intent(in) :: line
        type(scene_type), intent(in) :: scene
        type(measure_spec), intent(inout) :: measure
        type(table_shelf), intent(inout) :: shelf
        type(status_type), intent(inout) :: status
        type(scene_place) :: place
        type(toml_node) :: joint, coordinate, marker, between, axes, twist, unwanted
        type(quantity_type) :: quantity
        logical :: found

        place = place_at(root, node, "measure "//quoted(measure%name))
        place%line = line
        call require_table(place, "a table, { joint = .. }, { coordinate = .. }, { marker = .., component = .. }, "// &
            "{ between = [.., ..] }, { axes = [.., ..] } or { twist = [.., ..] }", status)
        if (.not. status%is_ok()) return
        unwanted = node%get("acceleration")
        if (unwanted%is_present()) call refuse(place, "forces that depend on accelerations would depend on themselves "// &
            "(expected a place or its rate)", status)
        call allow_keys(place, [character(len=11) :: "joint", "variable", "coordinate", "marker", "component", "relative_to", &
            "between", "axes", "twist", "rate", "near"], status)
        if (.not. status%is_ok()) return
        joint = node%get("joint")
        coordinate = node%get("coordinate")
        marker = node%get("marker")
        between = node%get("between")
        axes = node%get("axes")
        twist = node%get("twist")
        if (count([joint%is_present(), coordinate%is_present(), marker%is_present(), between%is_present(), axes%is_present(), &
                   twist%is_present()]) /= 1) then
            call refuse(place, "needs one of 'joint', 'coordinate', 'marker', 'between', 'axes' and 'twist' "// &
                "(expected exactly one)", status)
            return
        end if
        call get_flag(place, "rate", measure%is_rate, status)
        if (marker%is_present()) then
            call allow_keys(place, [character(len=11) :: "marker", "component", "relative_to", "rate"], status)
            call read_marker(place, marker, scene, measure, status)
        else if (between%is_present()) then
            call allow_keys(place, [character(len=7) :: "between", "rate"], status)
            measure%kind = measure_distance
            call read_pair(place, "between", between, scene, measure, status)
        else if (axes%is_present()) then
            call allow_keys(place, [character(len=4) :: "axes", "rate"], status)
            measure%kind = measure_tilt
            call read_pair(place, "axes", axes, scene, measure, status)
        else if (twist%is_present()) then
            call allow_keys(place, [character(len=5) :: "twist", "rate", "near"], status)
            measure%kind = measure_twist
            call read_pair(place, "twist", twist, scene, measure, status)
            if (status%is_ok() .and. scene%planar) call refuse_value(place, "twist", twist, &
                "is for spatial scenes (expected a joint's angle or a coordinate)", status)
        else if (joint%is_present()) then
            call allow_keys(place, [character(len=8) :: "joint", "variable", "rate", "near"], status)
            call find_joint(scene, place, measure%joint, status)
            if (.not. status%is_ok()) return
            call find_variable(scene, place, measure%joint, measure%variable, status)
            measure%kind = measure_joint
        else
            call allow_keys(place, [character(len=10) :: "coordinate", "rate", "near"], status)
            call read_coordinate_measure(place, scene, measure, status)
        end if
        if (.not. status%is_ok()) return
        quantity = measure_quantity(scene, measure)
        call get_quantity(place, "near", quantity, measure%near, status, found)
        if (found .and. (measure%is_rate .or. quantity%unit /= "rad")) call refuse_value(place, "near", node%get("near"), &
            "belongs to an angle, which is taken within half a turn of it (expected none)", status)
        measure%wraps = counts_no_turns(scene, measure)
        if (status%is_ok()) call add_measure(place, measure, quantity, shelf)
    end subroutine read_measure

    !> A joint variable, or its rate, that no formula of the file names.
    subroutine add_joint_measure(scene, joint, variable, near, is_rate, shelf, number)
        type(scene_type), intent(in) :: scene
        integer, intent(in) :: joint, variable
        real(wp), intent(in) :: near                   !! an angle that is no coordinate is taken within half a turn of this [rad]
        logical, intent(in) :: is_rate
        type(table_shelf), intent(inout) :: shelf
        integer, intent(out) :: number                 !! of the measure

        call add_place_measure(scene, measure_spec(kind=measure_joint, joint=joint, variable=variable), near, is_rate, shelf, &
                               number)
    end subroutine add_joint_measure

    !> A place, or its rate, that no formula of the file names.
    subroutine add_place_measure(scene, spec, near, is_rate, shelf, number)
        type(scene_type), intent(in) :: scene
        type(measure_spec), intent(in) :: spec
        real(wp), intent(in) :: near                   !! an angle that counts no turns is taken within half a turn of this [rad]
        logical, intent(in) :: is_rate
        type(table_shelf), intent(inout) :: shelf
        integer, intent(out) :: number                 !! of the measure
        type(measure_spec) :: measure
        type(quantity_type) :: quantity

        measure = spec
        measure%name = ""
        measure%near = near
        measure%is_rate = is_rate
        measure%wraps = counts_no_turns(scene, measure)
        quantity = measure_quantity(scene, measure)
        measure%length_power = quantity%power(2)
        shelf%book%measure = [shelf%book%measure, measure]
        number = size(shelf%book%measure)
    end subroutine add_place_measure

    !> What a place is measured in.
    pure function measure_quantity(scene, measure) result(quantity)
        type(scene_type), intent(in) :: scene
        type(measure_spec), intent(in) :: measure
        type(quantity_type) :: quantity

        quantity = length
        if (any(measure%kind == [measure_attitude, measure_tilt, measure_twist, measure_turn])) quantity = angle
        if (measure%kind == measure_joint) quantity = variable_quantity(scene%joint(measure%joint)%kind, measure%variable)
    end function measure_quantity

    !> Is a measure an angle but for whole turns? A coordinate counts them.
    pure logical function counts_no_turns(scene, measure)
        type(scene_type), intent(in) :: scene
        type(measure_spec), intent(in) :: measure

        counts_no_turns = .false.
        if (measure%is_rate) return
        counts_no_turns = any(measure%kind == [measure_attitude, measure_twist])
        if (measure%kind == measure_joint) counts_no_turns = &
            wraps(scene%joint(measure%joint)%kind, measure%variable) .and. .not. is_coordinate(scene, measure)
    end function counts_no_turns

    !> Whether a side of a soft stop is touched.
    subroutine add_touch(stop, shelf, number)
        integer, intent(in) :: stop
        type(table_shelf), intent(inout) :: shelf
        integer, intent(out) :: number                 !! of the measure

        shelf%book%measure = [shelf%book%measure, measure_spec(kind=measure_touch, stop=stop)]
        number = size(shelf%book%measure)
    end subroutine add_touch

    !> Is the joint variable of a measure a coordinate, which counts turns?
    pure logical function is_coordinate(scene, measure)
        type(scene_type), intent(in) :: scene
        type(measure_spec), intent(in) :: measure

        is_coordinate = any(scene%coordinate%kind == coordinate_joint .and. scene%coordinate%joint == measure%joint .and. &
                            scene%coordinate%variable == measure%variable)
    end function is_coordinate

    subroutine read_marker(place, node, scene, measure, status)
        type(scene_place), intent(in) :: place
        type(toml_node), intent(in) :: node
        type(scene_type), intent(in) :: scene
        type(measure_spec), intent(inout) :: measure
        type(status_type), intent(inout) :: status
        type(toml_node) :: relative

        call find_marker(scene, place, "marker", node, measure%link(2), measure%marker(2), status)
        relative = place%node%get("relative_to")
        if (relative%is_present()) call find_link(scene, place, "relative_to", measure%link(1), status)
        if (status%is_ok() .and. relative%is_present() .and. measure%link(1) == measure%link(2)) call refuse_value(place, &
            "relative_to", relative, "is the marker's own link (expected another link)", status)
        call get_word(place, "component", [character(len=1) :: "x", "y", "z"], measure%component, status)
        measure%kind = measure_marker
        if (status%is_ok() .and. scene%planar .and. measure%component == 3) call refuse_value(place, "component", &
            place%node%get("component"), "= 'z', which planar scenes do not have (expected x or y)", status)
    end subroutine read_marker

    !> The two markers that a measure is between.
    subroutine read_pair(place, key, node, scene, measure, status)
        type(scene_place), intent(in) :: place
        character(len=*), intent(in) :: key            !! "between": how far they are apart; "axes", "twist": how theirs stand
        type(toml_node), intent(in) :: node
        type(scene_type), intent(in) :: scene
        type(measure_spec), intent(inout) :: measure
        type(status_type), intent(inout) :: status
        integer :: side

        if (node%kind() /= toml_array .or. node%count() /= 2) then
            call refuse_value(place, key, node, "is not a pair (expected two markers)", status)
            return
        end if
        do side = 1, 2
            call find_marker(scene, place, key, node%at(side), measure%link(side), measure%marker(side), status)
        end do
        if (status%is_ok() .and. measure%link(1) == measure%link(2)) call refuse_value(place, key, node, &
            "names markers of one link (expected markers of two)", status)
    end subroutine read_pair

    !> Key `coordinate`: measured as the joint variable, the place or the angle of a link that it is.
    subroutine read_coordinate_measure(place, scene, measure, status)
        type(scene_place), intent(in) :: place
        type(scene_type), intent(in) :: scene
        type(measure_spec), intent(inout) :: measure
        type(status_type), intent(inout) :: status
        character(len=name_len) :: name
        integer :: k

        call get_name(place, "coordinate", name, status)
        if (.not. status%is_ok()) return
        k = findloc(scene%coordinate%name, name, dim=1)
        if (k == 0) then
            call refuse_value(place, "coordinate", place%node%get("coordinate"), "= "//quoted(name)//": there is no such "// &
                "coordinate (expected the name of a coordinate)"//suggestion(name, (scene%coordinate%name)), status)
            return
        end if
        associate (coordinate => scene%coordinate(k))
            if (coordinate%kind == coordinate_joint) then
                measure%kind = measure_joint
                measure%joint = coordinate%joint
                measure%variable = coordinate%variable
            else
                measure = pose_measure(frame_link, coordinate%link, 0, coordinate%variable, measure)
            end if
        end associate
    end subroutine read_coordinate_measure

    !> A component of the pose of a link or of its point, as another link sees it; the rest is that of another measure.
    pure function pose_measure(reference, link, marker, component, other) result(measure)
        integer, intent(in) :: reference, link, marker
        integer, intent(in) :: component               !! 1 .. 6: x y z roll pitch yaw
        type(measure_spec), intent(in) :: other
        type(measure_spec) :: measure
        logical :: is_angle

        is_angle = component > 3
        measure = other
        measure%kind = merge(measure_attitude, measure_marker, is_angle)
        measure%component = component - merge(3, 0, is_angle)
        measure%joint = 0
        measure%link = [reference, link]
        measure%marker = [0, marker]
    end function pose_measure

    !> Onto the shelf, and its name among the symbols of formulas.
    subroutine add_measure(place, measure, quantity, shelf)
        type(scene_place), intent(in) :: place
        type(measure_spec), intent(in) :: measure
        type(quantity_type), intent(in) :: quantity    !! of what is measured
        type(table_shelf), intent(inout) :: shelf
        type(symbol_entry) :: symbol
        integer :: n

        n = size(shelf%book%measure) + 1
        shelf%book%measure = [shelf%book%measure, measure]
        shelf%book%measure(n)%length_power = quantity%power(2)
        symbol%name = measure%name
        symbol%symbol = n
        symbol%power = quantity%power
        if (measure%is_rate) symbol%power(3) = symbol%power(3) - 1
        call place%variables%add_symbol(symbol)
    end subroutine add_measure

    !> A name that formulas can have, and that means nothing else.
    subroutine require_symbol_name(root, what, key, line, status)
        type(scene_place), intent(in) :: root
        character(len=*), intent(in) :: what           !! measure, law
        character(len=*), intent(in) :: key
        integer, intent(in) :: line
        type(status_type), intent(inout) :: status
        type(scene_place) :: place
        integer :: i

        place = root
        place%what = what//" "//quoted(key(:min(len(key), name_len)))
        if (len(key) == 0 .or. len(key) > name_len .or. verify(key, name_letters) > 0 .or. &
            scan(key(:min(1, len(key))), "0123456789") > 0) then
            call refuse(place, "this cannot be a name in formulas (expected 1 to "//to_text(name_len)// &
                " letters, digits and '_', no digit first)", status, line)
        else if (is_reserved(key) .or. any([character(len=7) :: "time", "stretch", "rate"] == key)) then
            call refuse(place, "this name has a meaning in formulas (expected another name)", status, line)
        else if (is_unit_name(key)) then
            call refuse(place, "this is the name of a unit, which formulas would take it for (expected another name)", status, line)
        else if (root%variables%has(key)) then
            call refuse(place, "there is a variable of that name (expected another name)", status, line)
        else if (allocated(root%variables%symbol)) then
            do i = 1, size(root%variables%symbol)
                if (root%variables%symbol(i)%name == key) &
                    call refuse(place, "there is a measure of that name (expected another name)", status, line)
            end do
        end if
    end subroutine require_symbol_name

    ! ---------------------------------------------------------------- named laws

    !> The table [laws], each law behind those that it takes.
    subroutine read_named_laws(root, shelf, status)
        type(scene_place), intent(in) :: root
        type(table_shelf), intent(inout) :: shelf
        type(status_type), intent(inout) :: status
        type(scene_place) :: place
        type(toml_node) :: node
        character(len=:), allocatable :: key
        character(len=name_len), allocatable :: name(:)
        integer, allocatable :: line(:)
        logical, allocatable :: is_read(:), takes(:, :)
        integer :: i, k, n

        if (.not. status%is_ok()) return
        node = root%node%get("laws")
        if (.not. node%is_present()) return
        place = place_at(root, node, "laws")
        call require_table(place, "a table of names with formulas or tables, written [laws]", status)
        if (.not. status%is_ok()) return
        n = node%count()
        allocate (name(n), line(n), is_read(n), takes(n, n))
        is_read = .false.
        do i = 1, n
            call node%key(i, key, line(i))
            call require_symbol_name(root, "law", key, line(i), status)
            if (.not. status%is_ok()) return
            name(i) = key
        end do
        do i = 1, n
            do k = 1, n
                takes(i, k) = law_mentions(node%get(trim(name(i))), trim(name(k)))
            end do
        end do
        do k = 1, n
            do i = 1, n
                if (is_read(i) .or. any(takes(i, :) .and. .not. is_read)) cycle
                call read_named_law(root, node%get(trim(name(i))), trim(name(i)), line(i), shelf, status)
                if (.not. status%is_ok()) return
                is_read(i) = .true.
            end do
        end do
        if (.not. all(is_read)) call refuse_circle(root, name, line, takes, .not. is_read, status)
    end subroutine read_named_laws

    !> Does a law name another one?
    logical function law_mentions(node, name) result(mentions)
        type(toml_node), intent(in) :: node
        character(len=*), intent(in) :: name
        type(toml_node) :: over
        character(len=:), allocatable :: text
        logical :: is_one
        integer :: first, n

        over = node
        if (node%kind() == toml_table) over = node%get("over")
        mentions = .false.
        call over%get_text(text, is_one)
        if (.not. is_one) return
        first = 1
        do while (first <= len(text))
            n = verify(text(first:)//" ", name_letters) - 1
            if (n == len(name)) mentions = mentions .or. text(first:first + n - 1) == name
            first = first + max(1, n)
        end do
    end function law_mentions

    subroutine refuse_circle(root, name, line, takes, is_left, status)
        type(scene_place), intent(in) :: root
        character(len=name_len), intent(in) :: name(:)
        integer, intent(in) :: line(:)
        logical, intent(in) :: takes(:, :), is_left(:)
        type(status_type), intent(inout) :: status
        type(scene_place) :: place
        character(len=:), allocatable :: circle
        logical :: is_in(size(name))
        integer :: i, k

        is_in = is_left
        do k = 1, size(name)                           ! what nobody in the circle takes hangs on it from outside
            do i = 1, size(name)
                if (is_in(i)) is_in(i) = any(takes(:, i) .and. is_in)
            end do
        end do
        circle = ""
        do i = 1, size(name)
            if (.not. is_in(i)) cycle
            if (circle /= "") circle = circle//", "
            circle = circle//quoted(name(i))
        end do
        i = findloc(is_in, .true., dim=1)
        place = root
        place%what = "law "//quoted(name(i))
        call refuse(place, "depends on itself ("//circle//") (expected measures and other laws)", status, line(i))
    end subroutine refuse_circle

    !> A law over the state: a formula, a number, or a table with 'over'.
    subroutine read_named_law(root, node, name, line, shelf, status)
        type(scene_place), intent(in) :: root
        type(toml_node), intent(in) :: node
        character(len=*), intent(in) :: name
        integer, intent(in) :: line
        type(table_shelf), intent(inout) :: shelf
        type(status_type), intent(inout) :: status
        type(scene_place) :: place
        type(state_law) :: law
        type(measured_value) :: found
        type(symbol_entry) :: symbol
        character(len=:), allocatable :: text, problem
        logical :: is_one

        place = root
        place%line = line
        place%what = "law "//quoted(name)
        law%name = place%what
        if (node%kind() == toml_table) then
            place = place_at(place, node, trim(place%what))
            place%line = line
            call read_over(place, shelf, law, found, status)
        else
            call text_of(place, node, text, is_one)
            if (is_one) then
                call formula_of_text(text, place%variables, found, law%formula, problem)
                if (problem /= "" .and. index(problem, "(expected") == 0) problem = problem// &
                    " (expected a formula of measures, laws and numbers, or a table with 'over')"
                if (problem /= "") call refuse(place, "= "//problem, status)
            else
                call node%get_number(found%value, is_one)
                if (.not. is_one) call refuse(place, "is "//node%kind_text()//" (expected a formula in a text, or a table with "// &
                    "'over')", status)
                if (is_one .and. .not. abs(found%value) <= huge(found%value)) call refuse(place, "is not a finite number "// &
                    "(expected a formula of measures, laws and numbers, or a table with 'over')", status)
            end if
            if (found%node == 0) call add_node(law%formula, formula_node(node_number, number=found%value))
        end if
        if (.not. status%is_ok()) return
        law%wraps = formula_wraps(shelf, law%formula)
        shelf%book%law = [shelf%book%law, law]
        symbol%name = name
        symbol%symbol = -size(shelf%book%law)
        symbol%power = found%power
        symbol%has_unit = found%has_unit
        call root%variables%add_symbol(symbol)
    end subroutine read_named_law

    ! ---------------------------------------------------------------- forces

    !> A force or moment: a law of time, or one over the state.
    subroutine read_force_law(place, key, node, quantity, usual_column, shelf, law, status)
        type(scene_place), intent(in) :: place
        character(len=*), intent(in) :: key            !! what to call it in messages
        type(toml_node), intent(in) :: node
        type(quantity_type), intent(in) :: quantity
        character(len=*), intent(in) :: usual_column   !! of a table that names none; blank: it must
        type(table_shelf), intent(inout) :: shelf
        type(law_spec), intent(out) :: law
        type(status_type), intent(inout) :: status
        type(scene_place) :: inner
        type(state_law) :: over
        type(toml_node) :: over_node
        type(measured_value) :: found
        character(len=:), allocatable :: text, problem
        logical :: is_text

        if (.not. status%is_ok()) return
        over%name = trim(place%what)//", "//key
        is_text = .false.
        if (node%kind() == toml_table) then
            over_node = node%get("over")
            if (.not. over_node%is_present()) then
                call read_law(place, key, node, quantity, 0.0_wp, usual_column, straight_lines, shelf, law, status)
                return
            end if
            inner = place_at(place, node, trim(place%what)//", "//key)
            call read_over(inner, shelf, over, found, status, quantity, usual_column)
        else
            if (node%kind() == toml_string) call text_of(place, node, text, is_text)
            if (is_text) is_text = place%variables%mentions_symbol(text)
            if (.not. is_text) then
                place%variables%sees_symbols = .true.          ! an unknown name may be meant for one
                call read_law(place, key, node, quantity, 0.0_wp, usual_column, straight_lines, shelf, law, status)
                place%variables%sees_symbols = .false.
                return
            end if
            call formula_of_text(text, place%variables, found, over%formula, problem)
            if (problem == "") problem = misfit_of(text, found, quantity)
            if (problem /= "") then
                call refuse_value(place, key, node, "= "//problem//" (expected "//trim(quantity%name)//")", status)
                return
            end if
            if (found%node == 0) call add_node(over%formula, formula_node(node_number, number=found%value))
        end if
        if (.not. status%is_ok()) return
        shelf%book%law = [shelf%book%law, over]
        law%kind = law_over
        law%law = size(shelf%book%law)
    end subroutine read_force_law

    !> Radians are not looked at: stiffness in N m times an angle is a moment as well.
    function misfit_of(text, found, quantity) result(problem)
        character(len=*), intent(in) :: text
        type(measured_value), intent(in) :: found
        type(quantity_type), intent(in) :: quantity
        character(len=:), allocatable :: problem

        problem = ""
        if (found%has_unit .and. any(found%power(:4) /= quantity%power(:4))) &
            problem = quoted(text)//" is "//dimension_text(found%power)
    end function misfit_of

    !> The force of a spring over `stretch` and `rate`, which mean this spring here.
    subroutine read_spring_law(place, node, position, effort, spring, shelf, law, status)
        type(scene_place), intent(in) :: place
        type(toml_node), intent(in) :: node
        type(quantity_type), intent(in) :: position    !! of its length or angle
        type(quantity_type), intent(in) :: effort      !! force or moment
        integer, intent(in) :: spring                  !! its number
        type(table_shelf), intent(inout) :: shelf
        type(law_spec), intent(out) :: law
        type(status_type), intent(inout) :: status
        integer :: n_symbol

        if (.not. status%is_ok()) return
        if (place%variables%has("stretch") .or. place%variables%has("rate")) then
            call refuse_value(place, "force", node, "takes 'stretch' and 'rate' for the spring's own, and there is a variable "// &
                "of that name (expected another name of the variable)", status)
            return
        end if
        n_symbol = size(place%variables%symbol)
        call add_measure(place, measure_spec(name="stretch", kind=measure_spring, spring=spring), position, shelf)
        call add_measure(place, measure_spec(name="rate", kind=measure_spring, spring=spring, is_rate=.true.), position, shelf)
        call read_force_law(place, "force", node, effort, "", shelf, law, status)
        call place%variables%drop_symbols(n_symbol)
        if (status%is_ok() .and. law%kind /= law_over) call refuse_value(place, "force", node, &
            "takes neither 'stretch' nor 'rate' nor a measure (expected a formula, or a table over one of them)", status)
    end subroutine read_spring_law

    ! ---------------------------------------------------------------- tables

    !> A table over a measure or a law.
    subroutine read_over(place, shelf, law, found, status, quantity, usual_column)
        type(scene_place), intent(in) :: place
        type(table_shelf), intent(inout) :: shelf
        type(state_law), intent(inout) :: law
        type(measured_value), intent(out) :: found     !! dimension of the column
        type(status_type), intent(inout) :: status
        type(quantity_type), intent(in), optional :: quantity    !! what is expected; absent: what the table says
        character(len=*), intent(in), optional :: usual_column
        type(table_reading) :: reading
        type(symbol_entry) :: symbol
        type(quantity_type) :: of_argument, of_column
        character(len=:), allocatable :: column, argument
        real(wp), allocatable :: knot(:), value(:)
        logical :: has_column, has_argument, has_period
        integer :: n_key

        n_key = size(over_key) - 2
        if (present(usual_column)) n_key = n_key + merge(2, 0, usual_column /= "")
        call allow_keys(place, over_key(:n_key), status)
        call find_over(place, symbol, status)
        call read_table_keys(place, straight_lines, shelf, reading, status)
        call get_text(place, "column", column, status, has_column)
        call get_text(place, "argument", argument, status, has_argument)
        if (.not. status%is_ok()) return
        if (.not. has_argument) argument = trim(symbol%name)
        if (.not. has_column) then
            column = ""
            if (present(usual_column)) column = trim(usual_column)
            if (column == "") call refuse_missing(place, "column", "the name of a column of the table", status)
            if (.not. status%is_ok()) return
        end if
        of_argument = quantity_of_power(symbol%power)
        associate (table => shelf%place(reading%table)%table)
            if (present(quantity)) then
                of_column = quantity
            else
                call quantity_of_column(table, column, of_column, found, status)
            end if
            call column_in_si(table, argument, of_argument, knot, status)
            call column_in_si(table, column, of_column, value, status)
            if (status%is_ok()) call table_law(table, argument, knot, value, straight_lines, law%table, status, &
                trim(of_argument%unit))
        end associate
        law%over = symbol%symbol
        law%over_name = symbol%name
        law%over_unit = of_argument%unit
        call get_quantity(place, "period", of_argument, law%period, status, has_period)
        if (has_period) call close_period(place, shelf, law, status)
        if (.not. status%is_ok()) return
        if (size(law%table%time) < 2) then
            call refuse(place, "the table has a single row (expected two or more)", status)
            return
        end if
        if (reading%interpolation /= spline) return
        allocate (law%table%curvature(size(law%table%time)))
        if (has_period) then
            call fit_periodic_spline(law%table%time, law%table%knot, law%table%curvature)
        else
            call fit_spline(law%table%time, law%table%knot, law%table%curvature)
        end if
    end subroutine read_over

    !> What the table is over: the name of a measure or of another law.
    subroutine find_over(place, symbol, status)
        type(scene_place), intent(in) :: place
        type(symbol_entry), intent(out) :: symbol
        type(status_type), intent(inout) :: status
        character(len=:), allocatable :: text
        integer :: i

        call get_text(place, "over", text, status)
        if (.not. status%is_ok()) return
        do i = 1, size(place%variables%symbol)
            if (place%variables%symbol(i)%name /= text) cycle
            symbol = place%variables%symbol(i)
            return
        end do
        call refuse_value(place, "over", place%node%get("over"), "= "//quoted(text)//": there is no such measure or law "// &
            "(expected a name of [measures] or [laws], or 'time')"//suggestion(text, (place%variables%symbol%name)), status)
    end subroutine find_over

    !> Rows of one period: the first row closes it, unless the last one does.
    subroutine close_period(place, shelf, law, status)
        type(scene_place), intent(in) :: place
        type(table_shelf), intent(in) :: shelf
        type(state_law), intent(inout) :: law
        type(status_type), intent(inout) :: status
        real(wp), parameter :: close = 1.0e-9_wp
        real(wp), parameter :: longest_gap = 20            ! 360 beside a table in degrees is radians: 57 times as much
        type(toml_node) :: node
        real(wp) :: span, turns
        integer :: n

        if (.not. status%is_ok()) return
        node = place%node%get("period")
        call require_positive(place, "period", law%period, trim(law%over_unit), status)
        if (.not. status%is_ok()) return
        n = size(law%table%time)
        span = law%table%time(n) - law%table%time(1)
        if (span > law%period*(1 + close)) then
            call refuse_value(place, "period", node, "= "//to_text(law%period)//" "//trim(law%over_unit)// &
                " is less than the table's "//to_text(span)//" "//trim(law%over_unit)//" (expected rows of one period)", status)
        else if (law%period > longest_gap*span .and. n > 1) then
            call refuse_value(place, "period", node, "= "//to_text(law%period)//" "//trim(law%over_unit)// &
                " is more than "//to_text(nint(longest_gap))//" times the table's "//to_text(span)//" "//trim(law%over_unit)// &
                " (expected rows all along one period; is the unit right?)", status)
        else if (span < law%period*(1 - close)) then
            law%table%time = [law%table%time, law%table%time(1) + law%period]
            law%table%knot = [law%table%knot, law%table%knot(1)]
        else if (abs(law%table%knot(n) - law%table%knot(1)) > close*maxval(abs(law%table%knot))) then
            call refuse(place, "the table does not close: its first row has "//to_text(law%table%knot(1))// &
                ", its last, a period on, "//to_text(law%table%knot(n))//" (expected the same)", status)
        else
            law%table%time(n) = law%table%time(1) + law%period
            law%table%knot(n) = law%table%knot(1)
        end if
        if (.not. status%is_ok() .or. .not. comes_from_wrapping(shelf, law%over)) return
        turns = law%period/(2*pi)
        if (turns <= 1 + close .and. abs(1/turns - anint(1/turns)) < close) return
        call refuse_value(place, "period", node, "= "//to_text(law%period)//" rad over "//quoted(law%over_name)// &
            ", an angle that counts no turns as it is no coordinate (expected a whole part of a turn, or the angle of a "// &
            "coordinate)", status)
    end subroutine close_period

    !> Does a measure, or what a law is made of, leave out turns?
    pure logical function comes_from_wrapping(shelf, symbol) result(wraps)
        type(table_shelf), intent(in) :: shelf
        integer, intent(in) :: symbol

        if (symbol > 0) then
            wraps = shelf%book%measure(symbol)%wraps
        else
            wraps = shelf%book%law(-symbol)%wraps
        end if
    end function comes_from_wrapping

    !> The same of a formula.
    pure logical function formula_wraps(shelf, formula) result(wraps)
        type(table_shelf), intent(in) :: shelf
        type(formula_type), intent(in) :: formula
        integer :: i

        wraps = .false.
        do i = 1, formula%n
            if (formula%node(i)%op == node_symbol) wraps = wraps .or. comes_from_wrapping(shelf, formula%node(i)%a)
        end do
    end function formula_wraps

    pure type(quantity_type) function quantity_of_power(power) result(quantity)
        integer, intent(in) :: power(n_dimension)

        quantity%name = dimension_text(power)
        quantity%unit = adjustl(si_unit_text(power))
        quantity%power = power
    end function quantity_of_power

    !> What a column of a table is, by the unit in its header.
    subroutine quantity_of_column(table, column, quantity, found, status)
        use linkdyn_scene, only: table_spec
        type(table_spec), intent(in) :: table
        character(len=*), intent(in) :: column
        type(quantity_type), intent(out) :: quantity
        type(measured_value), intent(out) :: found
        type(status_type), intent(inout) :: status
        character(len=:), allocatable :: problem
        real(wp) :: value
        integer :: i

        if (.not. status%is_ok()) return
        call column_of(table, column, i, status)
        if (.not. status%is_ok()) return
        if (table%unit(i) /= "") then
            call read_value("1 "//trim(table%unit(i)), value, found%has_unit, found%power, problem)
            if (problem /= "") call fail(status, status_bad_input, trim(table%file)//": column "//quoted(column)//": "// &
                problem//" (expected a unit in brackets)")
        end if
        quantity = quantity_of_power(found%power)
    end subroutine quantity_of_column
end module linkdyn_scene_state_laws
