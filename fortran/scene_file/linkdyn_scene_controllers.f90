!> The tables [[controller]]: what drives an actuator in forward dynamics by comparing what it measures with a target.
module linkdyn_scene_controllers
    use linkdyn_constants, only: two_pi
    use linkdyn_expression, only: measured_value
    use linkdyn_kinds, only: wp
    use linkdyn_scene, only: scene_type, controller_spec, measure_spec, name_len, measure_time, measure_joint, measure_spring, &
        coordinate_joint, law_none, law_over, effort_controlled, is_sampled, side_joint, side_torque, side_voltage, side_opening, &
        is_at_motor, feed_law, feed_gravity, feed_inverse, windup_none, windup_clamp, windup_back
    use linkdyn_scene_forces, only: force_quantity
    use linkdyn_scene_joints, only: variable_quantity
    use linkdyn_scene_keys, only: scene_place, refuse, refuse_value, refuse_missing, allow_keys, counted, get_quantity, get_name, &
        get_word, get_integer, text_of
    use linkdyn_scene_laws, only: table_shelf, read_law, spline
    use linkdyn_scene_motor_limits, only: read_positive
    use linkdyn_scene_names, only: find_joint, find_variable
    use linkdyn_scene_pattern, only: repeated_tables, list_repeated, repeated_at
    use linkdyn_scene_state_laws, only: read_force_law, read_coordinate_measure, add_joint_measure, add_place_measure, &
        measure_quantity
    use linkdyn_status, only: status_type
    use linkdyn_suggest, only: suggestion
    use linkdyn_text, only: to_text, quoted
    use linkdyn_toml, only: toml_node, toml_table, toml_string
    use linkdyn_units, only: quantity_type, length, moment, voltage, time_span, valve_opening
    use linkdyn_variables, only: measured_of_text
    implicit none (type, external)
    private
    public :: read_controllers

    character(len=17), parameter :: controller_key(*) = [character(len=17) :: "name", "actuator", "at", "joint", "variable", &
        "coordinate", "measure", "target", "kp", "ki", "kd", "filter", "damps", "limit", "min", "max", "anti_windup", &
        "tracking_time", "feed_forward", "rate", "delay", "delay_samples", "resolution", "output_resolution"]
    character(len=9), parameter :: side_name(4) = [character(len=9) :: "joint", "motor", "terminals", "valve"]
    integer, parameter :: side_of(4) = [side_joint, side_torque, side_voltage, side_opening]
    real(wp), parameter :: most_samples = 1000     !! that a delay may last

contains

    subroutine read_controllers(root, shelf, scene, status)
        type(scene_place), intent(in) :: root
        type(table_shelf), intent(inout) :: shelf
        type(scene_type), intent(inout) :: scene
        type(status_type), intent(inout) :: status
        type(repeated_tables) :: tables
        type(scene_place) :: place
        type(controller_spec) :: controller
        integer :: i

        allocate (scene%controller(0))
        call list_repeated(root, "controller", scene%planar, .false., tables, status)
        if (.not. status%is_ok()) return
        do i = 1, size(tables%table)
            place = repeated_at(root, tables, i, "controller")
            controller = controller_spec(line=place%line)
            call read_controller(place, shelf, scene, controller, status)
            if (.not. status%is_ok()) return
            if (any(scene%controller%name == controller%name)) &
                call refuse(place, "there is a controller of that name (expected another name)", status)
            scene%controller = [scene%controller, controller]
            associate (drive => scene%actuator(controller%actuator)%law)
                drive%kind = effort_controlled
                drive%side = controller%side
            end associate
        end do
    end subroutine read_controllers

    subroutine read_controller(place, shelf, scene, controller, status)
        type(scene_place), intent(inout) :: place
        type(table_shelf), intent(inout) :: shelf
        type(scene_type), intent(in) :: scene
        type(controller_spec), intent(inout) :: controller
        type(status_type), intent(inout) :: status
        type(quantity_type) :: measured, output
        logical :: found

        call find_actuator(place, scene, controller%actuator, status)
        if (.not. status%is_ok()) return
        controller%name = scene%actuator(controller%actuator)%name
        call get_name(place, "name", controller%name, status, found)
        place%what = "controller "//quoted(controller%name)
        call allow_keys(place, controller_key, status)
        call refuse_second_law(place, scene, controller%actuator, status)
        if (.not. status%is_ok()) return
        call read_output(place, scene, controller, output, status)
        call read_measured(place, shelf, scene, controller, measured, status)
        if (.not. status%is_ok()) return
        controller%unit = measured%unit
        controller%output_unit = output%unit(:4)
        call read_rate(place, controller, status)
        call read_target(place, measured, shelf, scene, controller, status)
        call read_gains(place, measured, output, controller, status)
        call read_limits(place, output, controller, status)
        call read_windup(place, controller, status)
        call read_feed(place, output, shelf, scene, controller, status)
        call read_sampling(place, measured, output, controller, status)
    end subroutine read_controller

    !> What it drives.
    subroutine find_actuator(place, scene, actuator, status)
        type(scene_place), intent(in) :: place
        type(scene_type), intent(in) :: scene
        integer, intent(out) :: actuator
        type(status_type), intent(inout) :: status
        character(len=name_len) :: name

        actuator = 0
        call get_name(place, "actuator", name, status)
        if (.not. status%is_ok()) return
        actuator = findloc(scene%actuator%name, name, dim=1)
        if (actuator == 0) call refuse_value(place, "actuator", place%node%get("actuator"), "= "//quoted(name)// &
            ": there is no such actuator (expected the name of an [[actuator]], which is that of its joint)"// &
            suggestion(name, (scene%actuator%name)), status)
    end subroutine find_actuator

    !> An actuator does one thing.
    subroutine refuse_second_law(place, scene, actuator, status)
        type(scene_place), intent(in) :: place
        type(scene_type), intent(in) :: scene
        integer, intent(in) :: actuator
        type(status_type), intent(inout) :: status
        integer :: i

        if (.not. status%is_ok()) return
        associate (spec => scene%actuator(actuator))
            i = findloc(scene%controller%actuator, actuator, dim=1)
            if (i > 0) then
                call refuse_value(place, "actuator", place%node%get("actuator"), "= "//quoted(spec%name)// &
                    " is driven by controller "//quoted(scene%controller(i)%name)//" already "// &
                    "(expected one for each actuator)", status)
            else if (spec%has_law) then
                call refuse_value(place, "actuator", place%node%get("actuator"), "= "//quoted(spec%name)// &
                    " has a 'law' of its own (expected an actuator without one)", status)
            end if
        end associate
    end subroutine refuse_second_law

    !> Where the output acts, and so what it is.
    subroutine read_output(place, scene, controller, output, status)
        type(scene_place), intent(in) :: place
        type(scene_type), intent(in) :: scene
        type(controller_spec), intent(inout) :: controller
        type(quantity_type), intent(out) :: output
        type(status_type), intent(inout) :: status
        integer :: choice
        logical :: found

        choice = 1
        call get_word(place, "at", side_name, choice, status, found)
        controller%side = side_of(choice)
        associate (actuator => scene%actuator(controller%actuator))
            output = force_quantity(scene%joint(actuator%joint)%kind, actuator%variable)
            if (controller%side == side_torque) output = moment
            if (controller%side == side_voltage) output = voltage
            if (controller%side == side_opening) then
                output = valve_opening
                controller%low = -1                    ! a valve opens no farther
                controller%high = 1
            end if
            if (status%is_ok() .and. controller%side == side_opening .and. .not. actuator%cylinder%is_given) &
                call refuse_value(place, "at", place%node%get("at"), "= 'valve': actuator "//quoted(actuator%name)// &
                    " has no cylinder (expected a 'cylinder' of the actuator: { bore = '80 mm', .. })", status)
            if (status%is_ok() .and. is_at_motor(controller%side) .and. .not. actuator%motor%is_given) &
                call refuse_value(place, "at", place%node%get("at"), "= "//quoted(trim(side_name(choice)))//": actuator "// &
                    quoted(actuator%name)//" has no motor (expected a 'drive' of the actuator: { ratio = 50, .. })", status)
        end associate
    end subroutine read_output

    !> What is kept at the target: the actuator's joint variable, another one, a coordinate, or a measure.
    subroutine read_measured(place, shelf, scene, controller, measured, status)
        type(scene_place), intent(in) :: place
        type(table_shelf), intent(inout) :: shelf
        type(scene_type), intent(in) :: scene
        type(controller_spec), intent(inout) :: controller
        type(quantity_type), intent(out) :: measured
        type(status_type), intent(inout) :: status
        type(toml_node) :: node(3)
        integer :: joint, variable

        measured = length
        if (.not. status%is_ok()) return
        node = [place%node%get("joint"), place%node%get("coordinate"), place%node%get("measure")]
        if (count([node(1)%is_present(), node(2)%is_present(), node(3)%is_present()]) > 1) then
            call refuse(place, "has more than one of 'joint', 'coordinate' and 'measure' (expected one, or none: it is then "// &
                "the actuator's joint variable)", status)
            return
        end if
        if (node(3)%is_present()) then
            call read_measure(place, shelf, scene, controller, measured, status)
        else if (node(2)%is_present()) then
            call read_coordinate(place, shelf, scene, controller, measured, status)
        else
            joint = scene%actuator(controller%actuator)%joint
            variable = scene%actuator(controller%actuator)%variable
            if (node(1)%is_present()) then
                call find_joint(scene, place, joint, status)
                if (status%is_ok()) call find_variable(scene, place, joint, variable, status)
            end if
            if (status%is_ok()) call measure_variable(scene, joint, variable, shelf, controller, measured)
        end if
    end subroutine read_measured

    !> A joint variable, and how fast it changes.
    subroutine measure_variable(scene, joint, variable, shelf, controller, measured)
        type(scene_type), intent(in) :: scene
        integer, intent(in) :: joint, variable
        type(table_shelf), intent(inout) :: shelf
        type(controller_spec), intent(inout) :: controller
        type(quantity_type), intent(out) :: measured

        measured = variable_quantity(scene%joint(joint)%kind, variable)
        call add_joint_measure(scene, joint, variable, 0.0_wp, .false., shelf, controller%measure)
        call add_joint_measure(scene, joint, variable, 0.0_wp, .true., shelf, controller%rate_measure)
    end subroutine measure_variable

    !> A measure of the scene; how fast it changes is known unless it is a rate itself.
    subroutine read_measure(place, shelf, scene, controller, measured, status)
        type(scene_place), intent(in) :: place
        type(table_shelf), intent(inout) :: shelf
        type(scene_type), intent(in) :: scene
        type(controller_spec), intent(inout) :: controller
        type(quantity_type), intent(out) :: measured
        type(status_type), intent(inout) :: status
        character(len=name_len) :: name
        type(measure_spec) :: measure

        measured = length
        call get_name(place, "measure", name, status)
        if (.not. status%is_ok()) return
        controller%measure = findloc(shelf%book%measure%name, name, dim=1)
        if (controller%measure > 0) measure = shelf%book%measure(controller%measure)
        if (controller%measure == 0 .or. measure%kind == measure_time .or. measure%kind == measure_spring) then
            call refuse_value(place, "measure", place%node%get("measure"), "= "//quoted(name)//": there is no such measure "// &
                "(expected a name of [measures])"//suggestion(name, (shelf%book%measure%name)), status)
            return
        end if
        measured = measure_quantity(scene, measure)
        if (measure%is_rate) then
            measured = rate_of(measured)
        else
            call add_rate(shelf, controller)
        end if
    end subroutine read_measure

    !> How fast the measure changes that the controller keeps at its target.
    subroutine add_rate(shelf, controller)
        type(table_shelf), intent(inout) :: shelf
        type(controller_spec), intent(inout) :: controller
        type(measure_spec) :: measure

        measure = shelf%book%measure(controller%measure)
        measure%name = ""
        measure%is_rate = .true.
        measure%wraps = .false.
        shelf%book%measure = [shelf%book%measure, measure]
        controller%rate_measure = size(shelf%book%measure)
    end subroutine add_rate

    !> A coordinate: a joint variable, or a component of a pose.
    subroutine read_coordinate(place, shelf, scene, controller, measured, status)
        type(scene_place), intent(in) :: place
        type(table_shelf), intent(inout) :: shelf
        type(scene_type), intent(in) :: scene
        type(controller_spec), intent(inout) :: controller
        type(quantity_type), intent(out) :: measured
        type(status_type), intent(inout) :: status
        type(measure_spec) :: measure

        measured = length
        call read_coordinate_measure(place, scene, measure, status)
        if (.not. status%is_ok()) return
        measured = measure_quantity(scene, measure)
        call add_place_measure(scene, measure, 0.0_wp, .false., shelf, controller%measure)
        call add_rate(shelf, controller)
    end subroutine read_coordinate

    !> What the measured value is to be.
    subroutine read_target(place, measured, shelf, scene, controller, status)
        type(scene_place), intent(in) :: place
        type(quantity_type), intent(in) :: measured
        type(table_shelf), intent(inout) :: shelf
        type(scene_type), intent(in) :: scene
        type(controller_spec), intent(inout) :: controller
        type(status_type), intent(inout) :: status
        type(toml_node) :: node, over
        character(len=:), allocatable :: text
        logical :: is_text

        if (.not. status%is_ok()) return
        node = place%node%get("target")
        if (.not. node%is_present()) then
            call refuse_missing(place, "target", trim(measured%name)//", a law, a formula, or 'motion'", status)
            return
        end if
        if (node%kind() == toml_string) then
            call text_of(place, node, text, is_text)
            controller%follows_motion = text == "motion"
        end if
        if (controller%follows_motion) then
            call follow_motion(place, node, shelf, scene, controller, status)
            return
        end if
        if (node%kind() == toml_table) then
            over = node%get("over")
            if (.not. over%is_present()) then
                call read_law(place, "target", node, measured, 0.0_wp, "", spline, shelf, controller%target, status)
                return
            end if
        end if
        call read_force_law(place, "target", node, measured, "", shelf, controller%target, status)
    end subroutine read_target

    !> The target is what the scene's motion has there; of a coordinate that is its law.
    subroutine follow_motion(place, node, shelf, scene, controller, status)
        type(scene_place), intent(in) :: place
        type(toml_node), intent(in) :: node
        type(table_shelf), intent(in) :: shelf
        type(scene_type), intent(in) :: scene
        type(controller_spec), intent(inout) :: controller
        type(status_type), intent(inout) :: status
        integer :: k

        associate (measure => shelf%book%measure(controller%measure))
            do k = 1, size(scene%coordinate)
                associate (coordinate => scene%coordinate(k))
                    if (measure%kind /= measure_joint .or. measure%is_rate .or. coordinate%kind /= coordinate_joint) cycle
                    if (coordinate%joint /= measure%joint .or. coordinate%variable /= measure%variable) cycle
                    if (coordinate%motion%kind == law_none) then
                        call refuse_value(place, "target", node, "= 'motion': coordinate "//quoted(coordinate%name)// &
                            " has none (expected a 'motion' of the coordinate)", status)
                        return
                    end if
                    controller%target = coordinate%motion
                    controller%follows_motion = .false.
                    return
                end associate
            end do
        end associate
        call require_motion(place, "target", node, scene, status)
    end subroutine follow_motion

    !> The scene's own motion is asked for.
    subroutine require_motion(place, key, node, scene, status)
        type(scene_place), intent(in) :: place
        character(len=*), intent(in) :: key
        type(toml_node), intent(in) :: node
        type(scene_type), intent(in) :: scene
        type(status_type), intent(inout) :: status
        integer :: k

        do k = 1, size(scene%coordinate)
            if (scene%coordinate(k)%motion%kind /= law_none) cycle
            call refuse_value(place, key, node, "follows the motion of the scene, and coordinate "// &
                quoted(scene%coordinate(k)%name)//" has none (expected a 'motion' of each coordinate)", status)
            return
        end do
    end subroutine require_motion

    !> kp, ki, kd and what kd is about.
    subroutine read_gains(place, measured, output, controller, status)
        type(scene_place), intent(in) :: place
        type(quantity_type), intent(in) :: measured, output
        type(controller_spec), intent(inout) :: controller
        type(status_type), intent(inout) :: status
        logical :: found, has_damps
        integer :: choice

        call get_quantity(place, "kp", gain(output, measured, 0), controller%kp, status, found)
        call get_quantity(place, "ki", gain(output, measured, -1), controller%ki, status, found)
        call get_quantity(place, "kd", gain(output, measured, 1), controller%kd, status, found)
        choice = 1
        call get_word(place, "damps", [character(len=8) :: "error", "measured"], choice, status, has_damps)
        controller%damps_measured = choice == 2
        call read_positive(place, "filter", time_span, "s", controller%filter, status)
        if (.not. status%is_ok()) return
        associate (kp => controller%kp, ki => controller%ki, kd => controller%kd)
            if (.not. any(abs([kp, ki, kd]) > 0)) then
                call refuse(place, "has no gain (expected one of 'kp', 'ki', 'kd' that is not zero)", status)
            else if (any([kp, ki, kd] > 0) .and. any([kp, ki, kd] < 0)) then
                call refuse(place, "its gains have different signs: kp = "//to_text(kp)//", ki = "//to_text(ki)//", kd = "// &
                    to_text(kd)//" (expected one sign: that of how its output changes what it measures)", status)
            else if (controller%filter > 0 .and. .not. abs(kd) > 0) then
                call refuse_value(place, "filter", place%node%get("filter"), "is that of 'kd', which is not there "// &
                    "(expected 'kd', or no filter)", status)
            else if (has_damps .and. .not. abs(kd) > 0) then
                call refuse_value(place, "damps", place%node%get("damps"), "is of 'kd', which is not there (expected 'kd', "// &
                    "or no such key)", status)
            else if (abs(kd) > 0 .and. controller%rate_measure == 0 .and. .not. is_sampled(controller)) then
                call refuse_value(place, "kd", place%node%get("kd"), "asks for an acceleration: what is measured is a rate "// &
                    "(expected none, or a sampled controller, with 'rate')", status)
            else if (abs(kd) > 0 .and. controller%target%kind == law_over .and. .not. controller%damps_measured .and. &
                     .not. is_sampled(controller)) then
                call refuse_value(place, "kd", place%node%get("kd"), "asks for the rate of a target that depends on the "// &
                    "motion (expected damps = ""measured"", or a sampled controller, with 'rate')", status)
            end if
        end associate
    end subroutine read_gains

    !> A gain: output over what is measured, times a power of time.
    pure type(quantity_type) function gain(output, measured, seconds)
        type(quantity_type), intent(in) :: output, measured
        integer, intent(in) :: seconds
        character(len=:), allocatable :: unit
        character(len=2) :: behind(-1:1)

        behind = ["/s", "  ", "*s"]
        unit = trim(output%unit)
        if (unit == "N m") unit = "N*m"
        if (index(measured%unit, "/s") > 0) then
            unit = unit//"/("//trim(measured%unit)//")"
        else
            unit = unit//"/"//trim(measured%unit)
        end if
        gain%name = "a gain in "//unit//behind(seconds)
        gain%example = "20 "//unit//behind(seconds)
        gain%power = output%power - measured%power
        gain%power(3) = gain%power(3) + seconds
        gain%angle_is_optional = .true.
    end function gain

    !> The rate of a length or an angle.
    pure type(quantity_type) function rate_of(quantity)
        type(quantity_type), intent(in) :: quantity

        rate_of = quantity
        rate_of%name = "a speed"
        if (quantity%unit == "rad") rate_of%name = "an angular rate"
        rate_of%unit = trim(quantity%unit)//"/s"
        rate_of%example = "0.5 "//trim(quantity%unit)//"/s"
        rate_of%power(3) = rate_of%power(3) - 1
        rate_of%angle_is_optional = quantity%unit == "rad"
    end function rate_of

    !> What the output stays within.
    subroutine read_limits(place, output, controller, status)
        type(scene_place), intent(in) :: place
        type(quantity_type), intent(in) :: output
        type(controller_spec), intent(inout) :: controller
        type(status_type), intent(inout) :: status
        real(wp) :: limit
        logical :: has_limit, has_low, has_high

        call get_quantity(place, "limit", output, limit, status, has_limit)
        call get_quantity(place, "min", output, controller%low, status, has_low)
        call get_quantity(place, "max", output, controller%high, status, has_high)
        if (.not. status%is_ok()) return
        if (has_limit .and. (has_low .or. has_high)) then
            call refuse_value(place, "limit", place%node%get("limit"), "stands beside 'min' or 'max' "// &
                "(expected 'limit' for both ways, or 'min' and 'max')", status)
        else if (has_limit) then
            if (.not. limit > 0) call refuse_value(place, "limit", place%node%get("limit"), "= "//to_text(limit)// &
                " (expected a number above zero, in "//trim(output%unit)//")", status)
            controller%low = -limit
            controller%high = limit
        else if (has_low .and. has_high .and. .not. controller%low < controller%high) then
            call refuse_value(place, "max", place%node%get("max"), "= "//to_text(controller%high)//" is not above 'min' "// &
                "(expected more than "//to_text(controller%low)//" "//trim(output%unit)//")", status)
        end if
    end subroutine read_limits

    !> What becomes of the integral at the limits: a sampled one is held, a continuous one led back.
    subroutine read_windup(place, controller, status)
        type(scene_place), intent(in) :: place
        type(controller_spec), intent(inout) :: controller
        type(status_type), intent(inout) :: status
        logical :: is_limited, found, has_time

        is_limited = controller%high < huge(1.0_wp) .or. controller%low > -huge(1.0_wp)
        controller%windup = merge(windup_clamp, windup_back, is_sampled(controller))
        call get_word(place, "anti_windup", [character(len=16) :: "none", "clamp", "back-calculation"], controller%windup, status, &
            found)
        call read_positive(place, "tracking_time", time_span, "s", controller%tracking_time, status)
        has_time = controller%tracking_time > 0
        if (.not. status%is_ok()) return
        if ((found .or. has_time) .and. .not. (is_limited .and. abs(controller%ki) > 0)) then
            call refuse(place, trim(merge("key 'anti_windup'  ", "key 'tracking_time'", found))// &
                " is about an integral at a limit (expected 'ki' and one of 'limit', 'min', 'max')", status)
        else if (controller%windup == windup_clamp .and. .not. is_sampled(controller)) then
            call refuse_value(place, "anti_windup", place%node%get("anti_windup"), "= 'clamp' switches the integral on and "// &
                "off, which a continuous controller cannot (expected ""back-calculation"", ""none"", or 'rate' beside it)", status)
        else if (has_time .and. controller%windup /= windup_back) then
            call refuse_value(place, "tracking_time", place%node%get("tracking_time"), "is that of anti_windup = "// &
                """back-calculation"" (expected that, or no time)", status)
        end if
        if (.not. (is_limited .and. abs(controller%ki) > 0)) controller%windup = windup_none
        if (.not. status%is_ok() .or. controller%windup /= windup_back .or. has_time) return
        controller%tracking_time = usual_time(controller)
        if (.not. controller%tracking_time > 0) call refuse_missing(place, "tracking_time", "in which the integral is led back "// &
            "at a limit, for example '0.1 s'; with 'kp' there is a usual one", status)
    end subroutine read_windup

    !> Integral time, or its geometric mean with the derivative time.
    pure real(wp) function usual_time(controller) result(time)
        type(controller_spec), intent(in) :: controller

        time = controller%kp/controller%ki
        if (abs(controller%kd) > 0) time = sqrt(controller%kd/controller%ki)
    end function usual_time

    !> What goes out beside what the error asks for.
    subroutine read_feed(place, output, shelf, scene, controller, status)
        type(scene_place), intent(in) :: place
        type(quantity_type), intent(in) :: output
        type(table_shelf), intent(inout) :: shelf
        type(scene_type), intent(in) :: scene
        type(controller_spec), intent(inout) :: controller
        type(status_type), intent(inout) :: status
        type(toml_node) :: node
        character(len=:), allocatable :: text
        logical :: is_text

        node = place%node%get("feed_forward")
        if (.not. (status%is_ok() .and. node%is_present())) return
        text = ""
        if (node%kind() == toml_string) call text_of(place, node, text, is_text)
        select case (text)
        case ("gravity")
            controller%feed = feed_gravity
        case ("inverse")
            controller%feed = feed_inverse
            call require_motion(place, "feed_forward", node, scene, status)
        case default
            controller%feed = feed_law
            call read_force_law(place, "feed_forward", node, output, "", shelf, controller%feed_law, status)
            return
        end select
        if (.not. status%is_ok()) return
        if (controller%side == side_voltage) then
            call refuse_value(place, "feed_forward", node, "= "//quoted(text)//" is a force, and the output a voltage "// &
                "(expected at = ""motor"" or ""joint"", or a formula)", status)
        else if (controller%side == side_opening) then
            call refuse_value(place, "feed_forward", node, "= "//quoted(text)//" is a force, and the output opens a valve "// &
                "(expected a formula)", status)
        else if (size(scene%actuator) /= size(scene%coordinate)) then
            call refuse_value(place, "feed_forward", node, "= "//quoted(text)//" wants as many actuators as coordinates, and "// &
                "there are "//counted(size(scene%actuator), "actuator")//" for "//counted(size(scene%coordinate), "coordinate")// &
                " (expected as many, or a formula)", status)
        end if
    end subroutine read_feed

    !> How often it takes samples: "1 kHz", "1000/s", 1000.
    subroutine read_rate(place, controller, status)
        type(scene_place), intent(in) :: place
        type(controller_spec), intent(inout) :: controller
        type(status_type), intent(inout) :: status
        character(len=*), parameter :: expected = " (expected samples in a second, for example '1 kHz')"
        type(toml_node) :: node
        type(measured_value) :: found
        character(len=:), allocatable :: text, problem
        logical :: is_one
        real(wp) :: rate

        node = place%node%get("rate")
        if (.not. (status%is_ok() .and. node%is_present())) return
        call node%get_number(rate, is_one)
        if (.not. is_one) then
            call text_of(place, node, text, is_one)
            if (.not. is_one) then
                call refuse_value(place, "rate", node, "is "//node%kind_text()//expected, status)
                return
            end if
            call measured_of_text(text, place%variables, found, problem)
            if (problem == "" .and. found%has_unit .and. (any(found%power(:4) /= [0, 0, -1, 0]) .or. &
                                                          all(found%power(5) /= [0, 1]))) problem = quoted(text)//" is no rate"
            if (problem /= "") then
                call refuse_value(place, "rate", node, "= "//problem//expected, status)
                return
            end if
            rate = found%value
            if (found%has_unit .and. found%power(5) == 1) rate = rate/two_pi     ! of turns: "1 kHz"
        end if
        if (.not. (rate > 0 .and. rate <= huge(rate))) then
            call refuse_value(place, "rate", node, "= "//to_text(rate)//expected, status)
            return
        end if
        controller%period = 1/rate
        if (abs(controller%period - nearest_decimal(controller%period)) < 4*spacing(controller%period)) &
            controller%period = nearest_decimal(controller%period)
    end subroutine read_rate

    !> 1 kHz is one sample in exactly a millisecond, whatever rounding makes of its turns.
    pure real(wp) function nearest_decimal(number)
        real(wp), intent(in) :: number
        character(len=32) :: text

        write (text, "(es32.12)") number
        read (text, *) nearest_decimal
    end function nearest_decimal

    !> Delay, and how finely it measures and puts out.
    subroutine read_sampling(place, measured, output, controller, status)
        type(scene_place), intent(in) :: place
        type(quantity_type), intent(in) :: measured, output
        type(controller_spec), intent(inout) :: controller
        type(status_type), intent(inout) :: status
        logical :: has_delay, has_samples
        integer :: n

        call get_quantity(place, "delay", time_span, controller%delay, status, has_delay)
        call get_integer(place, "delay_samples", n, status, has_samples)
        call read_positive(place, "resolution", measured, trim(measured%unit), controller%resolution, status)
        call read_positive(place, "output_resolution", output, trim(output%unit), controller%output_resolution, status)
        if (.not. status%is_ok()) return
        if (has_delay .and. has_samples) then
            call refuse_value(place, "delay", place%node%get("delay"), "stands beside 'delay_samples' "// &
                "(expected one of them)", status)
        else if (.not. is_sampled(controller) .and. (has_delay .or. has_samples)) then
            call refuse_continuous(trim(merge("delay        ", "delay_samples", has_delay)))
        else if (.not. is_sampled(controller) .and. controller%resolution > 0) then
            call refuse_continuous("resolution")
        else if (.not. is_sampled(controller) .and. controller%output_resolution > 0) then
            call refuse_continuous("output_resolution")
        else if (has_samples) then
            if (n < 0 .or. n > most_samples) call refuse_value(place, "delay_samples", place%node%get("delay_samples"), &
                "= "//to_text(n)//" (expected 0 to "//to_text(nint(most_samples))//")", status)
            controller%delay = n*controller%period
        else if (has_delay .and. .not. (controller%delay >= 0 .and. controller%delay <= most_samples*controller%period)) then
            call refuse_value(place, "delay", place%node%get("delay"), "= "//to_text(controller%delay)//" s (expected zero or "// &
                "more, at most "//to_text(nint(most_samples))//" samples)", status)
        else if (controller%output_resolution > controller%high - controller%low) then
            call refuse_value(place, "output_resolution", place%node%get("output_resolution"), "= "// &
                to_text(controller%output_resolution)//" is coarser than its limits are apart (expected less)", status)
        end if

    contains

        subroutine refuse_continuous(key)
            character(len=*), intent(in) :: key

            call refuse_value(place, key, place%node%get(key), "is that of a sampled controller (expected 'rate' beside it, "// &
                "for example '1 kHz')", status)
        end subroutine refuse_continuous
    end subroutine read_sampling
end module linkdyn_scene_controllers
