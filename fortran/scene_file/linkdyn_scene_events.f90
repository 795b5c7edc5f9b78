!> Events and end stops of a scene file: what a forward run looks out for.
!>
!> A side of an end stop is an event whose formula is its gap. A soft stop is a spring besides, without stiffness or damping of
!> its own, whose law over the state is the one-sided force: whatever works for laws works for it.
module linkdyn_scene_events
    use linkdyn_constants, only: pi, two_pi
    use linkdyn_expression, only: measured_value
    use linkdyn_formula, only: formula_type, formula_node, add_node, node_number, node_symbol, node_add, node_subtract, &
        node_multiply, node_divide, node_negate, node_max, node_if, node_sqrt, node_tanh, node_abs
    use linkdyn_joint_table, only: joint_spherical, is_pose_part, pose_attitude
    use linkdyn_kinds, only: wp
    use linkdyn_scene, only: scene_type, event_spec, stop_spec, spring_spec, friction_spec, state_law, measure_spec, law_over, &
        name_len, is_place, measure_joint, measure_marker, measure_distance, measure_tilt
    use linkdyn_scene_forces, only: read_stiffness
    use linkdyn_scene_friction, only: read_size, usual_creep_speed
    use linkdyn_scene_keys, only: scene_place, refuse, refuse_value, refuse_missing, allow_keys, get_quantity, get_name, get_word, &
        get_text
    use linkdyn_scene_laws, only: require_positive, table_shelf
    use linkdyn_scene_names, only: find_joint, find_variable
    use linkdyn_scene_pattern, only: repeated_tables, list_repeated, repeated_at
    use linkdyn_scene_state_laws, only: read_coordinate_measure, add_place_measure, pose_measure, measure_quantity, add_touch
    use linkdyn_status, only: status_type
    use linkdyn_suggest, only: suggestion
    use linkdyn_text, only: to_text, quoted
    use linkdyn_toml, only: toml_node
    use linkdyn_units, only: quantity_type, plain_number, speed
    use linkdyn_variables, only: formula_of_text
    implicit none (type, external)
    private
    public :: read_events, read_stops

    integer, parameter :: side_of(2) = [-1, 1]
    character(len=3), parameter :: side_key(2) = ["min", "max"]

contains

    !> The tables [[event]].
    subroutine read_events(root, scene, status)
        type(scene_place), intent(in) :: root
        type(scene_type), intent(inout) :: scene
        type(status_type), intent(inout) :: status
        type(repeated_tables) :: tables
        type(scene_place) :: place
        integer :: i, k

        allocate (scene%event(0), scene%stop(0))
        call list_repeated(root, "event", scene%planar, .false., tables, status)
        if (.not. status%is_ok()) return
        do i = 1, size(tables%table)
            place = repeated_at(root, tables, i, "event")
            scene%event = [scene%event, event_spec()]
            call read_event(place, scene%event(i), status)
            if (.not. status%is_ok()) return
            k = findloc(scene%event(:i)%name, scene%event(i)%name, dim=1)
            if (k < i) call refuse(place, "there is an event of that name (expected another name)", status)
        end do
    end subroutine read_events

    subroutine read_event(place, event, status)
        type(scene_place), intent(inout) :: place
        type(event_spec), intent(inout) :: event
        type(status_type), intent(inout) :: status
        character(len=name_len) :: name
        integer :: direction, action
        logical :: found

        event%line = place%line
        call get_name(place, "name", name, status)
        if (.not. status%is_ok()) return
        event%name = name
        place%what = "event "//quoted(name)
        call allow_keys(place, [character(len=9) :: "name", "when", "direction", "do"], status)
        call read_when(place, event%formula, status)
        direction = 3
        call get_word(place, "direction", [character(len=4) :: "down", "up", "both"], direction, status, found)
        action = 1
        call get_word(place, "do", [character(len=4) :: "note", "stop"], action, status, found)
        event%direction = 2*direction - 3
        if (direction == 3) event%direction = 0
        event%ends_run = action == 2
    end subroutine read_event

    !> What crosses zero.
    subroutine read_when(place, formula, status)
        type(scene_place), intent(in) :: place
        type(formula_type), intent(inout) :: formula
        type(status_type), intent(inout) :: status
        character(len=*), parameter :: expected = &
            "(expected a formula of measures and laws that crosses zero, such as ""x - 12 mm"")"
        character(len=:), allocatable :: text, problem
        type(measured_value) :: found

        call get_text(place, "when", text, status)
        if (.not. status%is_ok()) return
        call formula_of_text(text, place%variables, found, formula, problem)
        if (problem /= "") then
            call refuse_value(place, "when", place%node%get("when"), "= "//problem//" "//expected, status)
        else if (found%node == 0) then
            call refuse_value(place, "when", place%node%get("when"), "= "//quoted(text)//" does not depend on the motion "// &
                expected, status)
        end if
    end subroutine read_when

    !> The tables [[stop]].
    subroutine read_stops(root, shelf, scene, status)
        type(scene_place), intent(in) :: root
        type(table_shelf), intent(inout) :: shelf
        type(scene_type), intent(inout) :: scene
        type(status_type), intent(inout) :: status
        type(repeated_tables) :: tables
        type(scene_place) :: place
        integer :: i

        call list_repeated(root, "stop", scene%planar, .false., tables, status)
        if (.not. status%is_ok()) return
        do i = 1, size(tables%table)
            place = repeated_at(root, tables, i, "stop")
            call read_stop(place, shelf, scene, status)
            if (.not. status%is_ok()) return
        end do
    end subroutine read_stops

    !> One end stop: both of its sides.
    subroutine read_stop(place, shelf, scene, status)
        type(scene_place), intent(inout) :: place
        type(table_shelf), intent(inout) :: shelf
        type(scene_type), intent(inout) :: scene
        type(status_type), intent(inout) :: status
        type(stop_spec) :: bumper
        type(measure_spec) :: measure
        type(quantity_type) :: quantity
        type(toml_node) :: node(2)
        character(len=name_len) :: name
        type(friction_spec) :: rub
        real(wp) :: bound(2), value(2), near
        logical :: has(2), is_spring
        integer :: k, rate

        bumper%line = place%line
        call get_name(place, "name", name, status)
        if (.not. status%is_ok()) return
        place%what = "stop "//quoted(name)
        call allow_keys(place, [character(len=11) :: "name", "joint", "variable", "coordinate", "measure", "min", "max", &
            "restitution", "stiffness", "damping", "coulomb", "creep_speed"], status)
        call read_place(place, shelf, scene, measure, bumper%what, status)
        if (.not. status%is_ok()) return
        quantity = measure_quantity(scene, measure)
        do k = 1, 2
            call get_quantity(place, side_key(k), quantity, bound(k), status, has(k))
        end do
        if (.not. status%is_ok()) return
        if (.not. any(has)) then
            call refuse(place, "missing key 'min' or 'max' (expected at least one)", status)
        else if (all(has) .and. .not. bound(1) < bound(2)) then
            call refuse_value(place, "max", place%node%get("max"), "= "//to_text(bound(2))//" is not above 'min' "// &
                "(expected more than "//to_text(bound(1))//" "//trim(quantity%unit)//")", status)
        else if (any(scene%stop%name == trim(name)//".min" .or. scene%stop%name == trim(name)//".max")) then
            call refuse(place, "there is a stop of that name (expected another name)", status)
        end if
        if (status%is_ok() .and. measure%kind == measure_tilt .and. any(has .and. .not. (bound > 0 .and. bound < pi))) then
            k = findloc(has .and. .not. (bound > 0 .and. bound < pi), .true., dim=1)
            call refuse_value(place, side_key(k), place%node%get(side_key(k)), "= "//to_text(bound(k))//" rad: where axes are "// &
                "parallel a tilt has no direction (expected an angle between 0 and 180 deg)", status)
        end if
        if (measure%kind == measure_distance .and. any(has .and. bound <= 0)) then
            k = findloc(has .and. bound <= 0, .true., dim=1)
            call refuse_value(place, side_key(k), place%node%get(side_key(k)), "= "//to_text(bound(k))// &
                ": where markers meet a distance has no direction (expected more than zero)", status)
        end if
        node = [place%node%get("stiffness"), place%node%get("damping")]
        is_spring = node(1)%is_present() .or. node(2)%is_present()
        call read_restitution(place, scene, measure, is_spring, bumper, status)
        if (.not. status%is_ok()) return
        value = 0
        if (is_spring) then
            call read_stiffness(place, quantity%unit == "rad", value, status)
            do k = 1, 2
                if (status%is_ok() .and. value(k) < 0) call refuse_value(place, trim(merge("stiffness", "damping  ", k == 1)), &
                    node(k), "= "//to_text(value(k))//" would attract (expected zero or more)", status)
            end do
            if (status%is_ok() .and. .not. any(value > 0)) call refuse(place, "has neither stiffness nor damping above zero: "// &
                "it stops nothing (expected one of them, or no such stop)", status)
            if (.not. status%is_ok()) return
        end if
        call read_rubbing(place, measure, is_spring, rub, status)
        if (.not. status%is_ok()) return
        near = sum(bound, mask=has)/count(has)
        call add_place_measure(scene, measure, near, .false., shelf, bumper%measure)
        if (is_spring .and. all(has) .and. shelf%book%measure(bumper%measure)%wraps .and. bound(2) - bound(1) >= two_pi) then
            call refuse_value(place, "max", place%node%get("max"), "= "//to_text(bound(2))//" rad: the angle counts no turns, "// &
                "a force of it is taken within half a turn of the middle between both sides, and neither is ever met (expected "// &
                "less than 360 deg between them, 'restitution', or a stop of a coordinate)", status)
            return
        end if
        call add_place_measure(scene, measure, 0.0_wp, .true., shelf, rate)
        do k = 1, 2
            if (.not. has(k)) cycle
            bumper%name = trim(name)//"."//side_key(k)
            bumper%side = side_of(k)
            bumper%bound = bound(k)
            call add_side(bumper, scene)
        end do
        if (.not. is_spring) return
        call add_spring(name, bumper, has, bound, value, rate, shelf, scene)
        if (rub%coulomb > 0) call add_rubbing(name, bumper, rub, shelf, scene)
    end subroutine read_stop

    !> What is stopped: a joint variable, a coordinate or a measure.
    subroutine read_place(place, shelf, scene, measure, what, status)
        type(scene_place), intent(in) :: place
        type(table_shelf), intent(in) :: shelf
        type(scene_type), intent(in) :: scene
        type(measure_spec), intent(out) :: measure
        character(len=*), intent(inout) :: what        !! what messages call it
        type(status_type), intent(inout) :: status
        character(len=10), parameter :: key(3) = [character(len=10) :: "joint", "coordinate", "measure"]
        character(len=name_len) :: name
        type(toml_node) :: node(3)
        integer :: k

        do k = 1, size(key)
            node(k) = place%node%get(trim(key(k)))
        end do
        if (count([(node(k)%is_present(), k=1, size(key))]) /= 1) then
            call refuse(place, "needs one of 'joint', 'coordinate' and 'measure' (expected exactly one)", status)
            return
        end if
        k = findloc([(node(k)%is_present(), k=1, size(key))], .true., dim=1)
        call get_name(place, trim(key(k)), name, status)
        what = trim(key(k))//" "//quoted(name)
        select case (k)
        case (1)
            measure%kind = measure_joint
            call find_joint(scene, place, measure%joint, status)
            if (status%is_ok()) call find_variable(scene, place, measure%joint, measure%variable, status)
            return
        case (2)
            call read_coordinate_measure(place, scene, measure, status)
        case (3)
            call find_place(place, node(k), name, shelf, measure, status)
        end select
        node(1) = place%node%get("variable")
        if (node(1)%is_present()) call refuse_value(place, "variable", node(1), "belongs to a joint (expected none)", status)
        if (.not. status%is_ok() .or. measure%kind /= measure_joint) return
        associate (part => scene%joint(measure%joint))
            if (is_pose_part(part%kind)) measure = pose_measure(part%link(1), part%link(2), part%marker(2), measure%variable &
                                                                + merge(3, 0, part%kind == pose_attitude), measure)
        end associate
    end subroutine read_place

    !> A measure of the scene by its name. It must be a place: a stop of a speed would be no stop.
    subroutine find_place(place, node, name, shelf, measure, status)
        type(scene_place), intent(in) :: place
        type(toml_node), intent(in) :: node
        character(len=*), intent(in) :: name
        type(table_shelf), intent(in) :: shelf
        type(measure_spec), intent(inout) :: measure
        type(status_type), intent(inout) :: status
        integer :: k

        if (.not. status%is_ok()) return
        k = findloc(shelf%book%measure%name, name, dim=1)
        if (k == 0) then
            call refuse_value(place, "measure", node, "= "//quoted(name)//": there is no such measure (expected a name of "// &
                "[measures])"//suggestion(name, (shelf%book%measure%name)), status)
        else if (.not. is_place(shelf%book%measure(k))) then
            call refuse_value(place, "measure", node, "= "//quoted(name)//" is not a position "// &
                "(expected a joint variable, a marker's coordinate, a distance, a tilt or an angle of [measures], "// &
                "not a rate)", status)
        else
            measure = shelf%book%measure(k)
        end if
    end subroutine find_place

    !> A stop throws back, or it gives way.
    subroutine read_restitution(place, scene, measure, is_spring, bumper, status)
        type(scene_place), intent(in) :: place
        type(scene_type), intent(in) :: scene
        type(measure_spec), intent(in) :: measure
        logical, intent(in) :: is_spring
        type(stop_spec), intent(inout) :: bumper
        type(status_type), intent(inout) :: status

        call get_quantity(place, "restitution", plain_number, bumper%restitution, status, bumper%is_hard)
        if (.not. status%is_ok()) return
        if (bumper%is_hard .eqv. is_spring) then
            call refuse(place, "needs either 'restitution' or 'stiffness' and 'damping' (expected one of them)", status)
        else if (.not. (bumper%restitution >= 0 .and. bumper%restitution <= 1)) then
            call refuse_value(place, "restitution", place%node%get("restitution"), "= "//to_text(bumper%restitution)// &
                " (expected a number from 0 to 1)", status)
        else if (bumper%is_hard .and. measure%kind == measure_joint) then
            if (scene%joint(measure%joint)%kind == joint_spherical) call refuse_value(place, "restitution", &
                place%node%get("restitution"), "is for joints with axes (expected another joint, a tilt of [measures], or "// &
                "'stiffness')", status)
        end if
    end subroutine read_restitution

    !> Across the push a soft stop of a place may rub: a foot on its floor.
    subroutine read_rubbing(place, measure, is_spring, rub, status)
        type(scene_place), intent(in) :: place
        type(measure_spec), intent(in) :: measure
        logical, intent(in) :: is_spring
        type(friction_spec), intent(out) :: rub        !! %coulomb, %creep_speed
        type(status_type), intent(inout) :: status
        type(toml_node) :: node
        logical :: has_coulomb, has_creep

        if (.not. status%is_ok()) return
        call read_size(place, "coulomb", plain_number, rub%coulomb, has_coulomb, status)
        rub%creep_speed = usual_creep_speed
        call read_size(place, "creep_speed", speed, rub%creep_speed, has_creep, status)
        if (has_creep) call require_positive(place, "creep_speed", rub%creep_speed, "m/s", status)
        if (.not. status%is_ok()) return
        node = place%node%get("coulomb")
        if (has_creep .and. .not. has_coulomb) then
            call refuse_missing(place, "coulomb", "the coefficient of friction", status)
        else if (has_coulomb .and. .not. is_spring) then
            call refuse_value(place, "coulomb", node, "is for stops that give way (expected 'stiffness' and 'damping' in place "// &
                "of 'restitution')", status)
        else if (has_coulomb .and. measure%kind /= measure_marker) then
            call refuse_value(place, "coulomb", node, "is for the coordinate of a marker or link, whose surface lies across it "// &
                "(expected a measure { marker = .., component = .. }; joints rub by [[friction]])", status)
        end if
    end subroutine read_rubbing

    !> One side, and its gap as an event: positive while there is no contact.
    subroutine add_side(bumper, scene)
        type(stop_spec), intent(in) :: bumper
        type(scene_type), intent(inout) :: scene
        type(event_spec) :: event
        integer :: gap

        event%name = bumper%name
        event%stop = size(scene%stop) + 1
        event%direction = merge(-1, 0, bumper%is_hard)
        event%line = bumper%line
        gap = depth(event%formula, bumper)
        call add_node(event%formula, formula_node(node_negate, a=gap))
        scene%event = [scene%event, event]
        scene%stop = [scene%stop, bumper]
        scene%stop(event%stop)%event = size(scene%event)
    end subroutine add_side

    !> How far a place is past the bound of a side, as a node.
    integer function depth(formula, bumper) result(node)
        type(formula_type), intent(inout) :: formula
        type(stop_spec), intent(in) :: bumper

        call add_node(formula, formula_node(node_symbol, a=bumper%measure))
        call add_node(formula, formula_node(node_number, number=bumper%bound))
        node = formula%n
        if (bumper%side > 0) then
            call add_node(formula, formula_node(node_subtract, a=node - 1, b=node))
        else
            call add_node(formula, formula_node(node_subtract, a=node, b=node - 1))
        end if
        node = formula%n
    end function depth

    !> The one-sided springs of a soft stop, as a law of a spring: what it pulls with at `max` less what it pushes with at `min`.
    subroutine add_spring(name, bumper, has, bound, value, rate, shelf, scene)
        character(len=*), intent(in) :: name
        type(stop_spec), intent(in) :: bumper            !! measure and line are those of both sides
        logical, intent(in) :: has(2)
        real(wp), intent(in) :: bound(2), value(2)     !! stiffness and damping
        integer, intent(in) :: rate                    !! measure
        type(table_shelf), intent(inout) :: shelf
        type(scene_type), intent(inout) :: scene
        type(state_law) :: law
        type(stop_spec) :: side
        type(spring_spec) :: spring
        integer :: k, total, push, touch

        law%name = "stop "//quoted(name)
        total = 0
        do k = 1, 2
            if (.not. has(k)) cycle
            side = bumper
            side%side = side_of(k)
            side%bound = bound(k)
            ! the sides were added last, in this order
            call add_touch(size(scene%stop) - count(has(k + 1:)), shelf, touch)
            push = one_sided_force(law%formula, side, value, rate, touch)
            if (k == 1) call add_node(law%formula, formula_node(node_negate, a=push))
            if (total > 0) call add_node(law%formula, formula_node(node_add, a=total, b=push))
            total = law%formula%n
        end do
        law%wraps = shelf%book%measure(bumper%measure)%wraps
        shelf%book%law = [shelf%book%law, law]
        spring%name = name
        associate (measure => shelf%book%measure(bumper%measure))
            select case (measure%kind)
            case (measure_joint)
                spring%joint = measure%joint
                spring%variable = measure%variable
            case (measure_distance)
                spring%link = measure%link
                spring%marker = measure%marker
            case default
                spring%measure = bumper%measure
            end select
        end associate
        spring%force%kind = law_over
        spring%force%law = size(shelf%book%law)
        spring%line = bumper%line
        scene%spring = [scene%spring, spring]
    end subroutine add_spring

    !> Friction of a soft stop whose push is the law that was added last: springs along the directions across it, whose laws pull
    !> back what slides with coulomb times the push.
    subroutine add_rubbing(name, bumper, rub, shelf, scene)
        character(len=*), intent(in) :: name
        type(stop_spec), intent(in) :: bumper
        type(friction_spec), intent(in) :: rub
        type(table_shelf), intent(inout) :: shelf
        type(scene_type), intent(inout) :: scene
        character(len=1), parameter :: component_name(3) = ["x", "y", "z"]
        type(measure_spec) :: along
        type(spring_spec) :: spring
        integer, allocatable :: component(:), rate(:)
        integer :: i, push

        push = size(shelf%book%law)
        along = shelf%book%measure(bumper%measure)
        component = pack([1, 2, 3], [1, 2, 3] /= along%component .and. ([1, 2, 3] < 3 .or. .not. scene%planar))
        allocate (rate(size(component)))
        do i = 1, size(component)
            along%component = component(i)
            call add_place_measure(scene, along, 0.0_wp, .true., shelf, rate(i))
        end do
        do i = 1, size(component)
            along%component = component(i)
            spring%name = trim(name)//"."//component_name(component(i))
            spring%line = bumper%line
            call add_place_measure(scene, along, 0.0_wp, .false., shelf, spring%measure)
            shelf%book%law = [shelf%book%law, state_law(name="stop "//quoted(name), formula=rubbing(rub, push, rate, rate(i)))]
            spring%force%kind = law_over
            spring%force%law = size(shelf%book%law)
            scene%spring = [scene%spring, spring]
        end do
    end subroutine add_rubbing

    !> coulomb |push| tanh(V/creep) v/V, V the speed of which v is a component.
    function rubbing(rub, push, rate, own) result(formula)
        type(friction_spec), intent(in) :: rub
        integer, intent(in) :: push                    !! law
        integer, intent(in) :: rate(:), own            !! measures: the speed's components, the one along which it pulls
        type(formula_type) :: formula
        real(wp), parameter :: still = 1.0e-9_wp       !! of the creep speed: there it is none
        integer :: i, square, speed_node

        square = 0
        do i = 1, size(rate)
            call add_node(formula, formula_node(node_symbol, a=rate(i)))
            call add_node(formula, formula_node(node_multiply, a=formula%n, b=formula%n))
            if (square > 0) call add_node(formula, formula_node(node_add, a=square, b=formula%n))
            square = formula%n
        end do
        call add_node(formula, formula_node(node_sqrt, a=square))
        call add_node(formula, formula_node(node_number, number=still*rub%creep_speed))
        call add_node(formula, formula_node(node_max, a=formula%n - 1, b=formula%n))
        speed_node = formula%n
        call add_node(formula, formula_node(node_number, number=1/rub%creep_speed))
        call add_node(formula, formula_node(node_multiply, a=speed_node, b=formula%n))
        call add_node(formula, formula_node(node_tanh, a=formula%n))
        call add_node(formula, formula_node(node_divide, a=formula%n, b=speed_node))
        call add_node(formula, formula_node(node_symbol, a=own))
        call add_node(formula, formula_node(node_multiply, a=formula%n - 1, b=formula%n))
        call add_node(formula, formula_node(node_symbol, a=-push))
        call add_node(formula, formula_node(node_abs, a=formula%n))
        call add_node(formula, formula_node(node_multiply, a=formula%n - 2, b=formula%n))
        call add_node(formula, formula_node(node_number, number=rub%coulomb))
        call add_node(formula, formula_node(node_multiply, a=formula%n - 1, b=formula%n))
    end function rubbing

    !> Stiffness times depth and damping times its rate, in contact and never a pull, as a node.
    integer function one_sided_force(formula, bumper, value, rate, touch) result(node)
        type(formula_type), intent(inout) :: formula
        type(stop_spec), intent(in) :: bumper
        real(wp), intent(in) :: value(2)               !! stiffness, damping
        integer, intent(in) :: rate, touch             !! measures
        real(wp), parameter :: any_depth = 1.0e12_wp   !! [m, rad]
        integer :: deep, is_touched, zero

        deep = depth(formula, bumper)
        ! A run knows whether there is contact; who does not takes the depth.
        call add_node(formula, formula_node(node_symbol, a=touch))
        call add_node(formula, formula_node(node_number, number=any_depth))
        call add_node(formula, formula_node(node_multiply, a=formula%n - 1, b=formula%n))
        call add_node(formula, formula_node(node_add, a=deep, b=formula%n))
        is_touched = formula%n
        call add_node(formula, formula_node(node_number, number=value(1)))
        call add_node(formula, formula_node(node_multiply, a=formula%n, b=deep))
        node = formula%n
        call add_node(formula, formula_node(node_symbol, a=rate))
        call add_node(formula, formula_node(node_number, number=bumper%side*value(2)))
        call add_node(formula, formula_node(node_multiply, a=formula%n - 1, b=formula%n))
        call add_node(formula, formula_node(node_add, a=node, b=formula%n))
        call add_node(formula, formula_node(node_number, number=0.0_wp))
        zero = formula%n
        call add_node(formula, formula_node(node_max, a=zero - 1, b=zero))
        call add_node(formula, formula_node(node_if, a=is_touched, b=formula%n, c=zero))
        node = formula%n
    end function one_sided_force
end module linkdyn_scene_events
