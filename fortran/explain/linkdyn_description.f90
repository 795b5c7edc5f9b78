!> A scene and the layout of its results as JSON: how other languages learn names, units and shapes.
module linkdyn_description
    use linkdyn_assembly_words, only: assembly_list, chain_key
    use linkdyn_dataset, only: dataset_type, dataset_variable, sample_variable
    use linkdyn_given_attitudes, only: attitude_name
    use linkdyn_kinds, only: wp
    use linkdyn_model, only: model_type, step_type, gear_type, shared_reactions, gives_attitude, attitude_angles, step_pose, &
        step_parts
    use linkdyn_result_kinds, only: jumps, is_made_of_forces
    use linkdyn_results, only: layout_type, dimension_type, variable_type, dim_sample, n_dimension
    use linkdyn_scene, only: share_name, wants_instants, scene_type, link_spec, actuator_spec, coordinate_spec, &
        load_spec, marker_spec, spring_spec, stop_spec, cam_spec, follower_name, measure_joint, &
        n_event, n_stop, n_controller, n_clutch, side_opening, side_torque, side_voltage, effort_inverse, &
        law_none, law_over, frame_link, axes_link, joint_kind_name, joint_n_variable, joint_screw, variable_name, &
        idle_spins, n_holding, coordinate_joint, is_pose_part
    use linkdyn_shared_words, only: shared_components, shared_directions
    use linkdyn_text, only: to_text
    implicit none (type, external)
    private
    public :: scene_as_json, layout_as_json, dataset_as_json, assemblies_as_json

contains

    !> What a drawing or a script needs to know of the scene. Link 0 is the frame.
    function scene_as_json(model) result(text)
        type(model_type), intent(in) :: model
        character(len=:), allocatable :: text

        text = parts_as_json(model%scene, model)
    end function scene_as_json

    !> One list of each kind of part, in the order of their numbers.
    function parts_as_json(scene, model) result(text)
        type(scene_type), intent(in) :: scene
        type(model_type), intent(in) :: model
        character(len=:), allocatable :: text
        logical :: is_first
        integer :: i

        text = "{"//pair("title", string(scene%title))//","//pair("file", string(scene%file))//","// &
            pair("planar", logical_value(scene%planar))//","//pair("gravity", numbers(scene%gravity))//","// &
            pair("frame_moves", logical_value(scene%base%moves))//","// &
            pair("wants_instants", logical_value(wants_instants(scene)))//","// &
            pair("time", "{"//pair("first", number(scene%time%first))//","//pair("last", number(scene%time%last))// &
            ","//pair("n_sample", integer_value(scene%time%n_sample))//"}")
        text = text//',"links":['//link_object(scene%frame, "frame")
        do i = 1, size(scene%link)
            text = text//","//link_object(scene%link(i), trim(scene%link(i)%name))
        end do
        text = text//'],"joints":['
        do i = 1, n_holding(scene)
            text = text//separator(i)//joint_object(model, i)
        end do
        text = text//'],"coordinates":['
        do i = 1, size(scene%coordinate)
            text = text//separator(i)//coordinate_object(scene, scene%coordinate(i))
        end do
        text = text//'],"attitudes":['
        do i = 1, model%n_attitude
            text = text//separator(i)//attitude_object(model, i)
        end do
        text = text//'],"actuators":['
        do i = 1, size(scene%actuator)
            text = text//separator(i)//actuator_object(scene%actuator(i))
        end do
        text = text//'],"controllers":['
        do i = 1, n_controller(scene)
            text = text//separator(i)//named(scene%controller(i)%name, scene%controller(i)%unit)
        end do
        text = text//'],"clutches":['
        do i = 1, n_clutch(scene)
            text = text//separator(i)//named(scene%clutch(i)%name, scene%clutch(i)%unit)
        end do
        text = text//'],"motors":['
        do i = 1, size(model%motor)
            text = text//separator(i)//motor_object(scene%actuator(model%motor(i)%actuator))
        end do
        text = text//'],"cylinders":['
        is_first = .true.
        do i = 1, size(scene%actuator)
            if (.not. scene%actuator(i)%cylinder%is_given) cycle
            if (.not. is_first) text = text//","
            is_first = .false.
            text = text//cylinder_object(scene%actuator(i))
        end do
        text = text//'],"loads":['
        do i = 1, size(scene%load)
            text = text//separator(i)//load_object(scene, scene%load(i))
        end do
        text = text//'],"springs":['
        is_first = .true.
        do i = 1, size(scene%spring)
            if (gives_way_for_stop(scene, scene%spring(i))) cycle
            if (.not. is_first) text = text//","
            is_first = .false.
            text = text//spring_object(scene, scene%spring(i))
        end do
        text = text//'],"payloads":['
        do i = 1, size(scene%payload)
            associate (payload => scene%payload(i))
                text = text//separator(i)//"{"//pair("name", string(payload%name))//","//pair("link", integer_value(payload%link)) &
                       //","//pair("at", numbers(scene%link(payload%link)%marker(payload%marker)%at))//"," &
                       //pair("inertia", numbers(payload%inertia))//"}"
            end associate
        end do
        text = text//'],"variables":['
        do i = 1, size(scene%variable)
            text = text//separator(i)//"{"//pair("name", string(scene%variable(i)%name))//","// &
                pair("value", number(scene%variable(i)%value))//","//pair("unit", string(scene%variable(i)%unit))//"}"
        end do
        text = text//'],"events":['
        do i = 1, n_event(scene)
            text = text//separator(i)//string(scene%event(i)%name)
        end do
        text = text//'],"stops":['
        do i = 1, n_stop(scene)
            text = text//separator(i)//stop_object(scene, scene%stop(i))
        end do
        text = text//'],"spin_lines":['
        is_first = .true.
        do i = 1, size(model%link)
            if (model%link(i)%spin == 0) cycle
            if (.not. is_first) text = text//","
            is_first = .false.
            text = text//"{"//pair("link", integer_value(i))//","//pair("axis", numbers(model%link(i)%spin_axis))//"}"
        end do
        text = text//"],"//pair("idle_spins", string(idle_spins(scene)))//","// &
            pair("shared_reactions", string(shared_reactions(model)))//","// &
            pair("shared_components", string(shared_components(model)))//","// &
            pair("shared_directions", string(shared_directions(model)))//","// &
            pair("redundancy", string(trim(share_name(scene%redundancy))))
        if (size(scene%source) > 1) text = text//","//pair("text", string(scene%text))
        text = text//"}"
    end function parts_as_json

    !> An attitude that three coordinates tell: by which these begin, from 0, of what, and whether a table of quaternions leads it.
    function attitude_object(model, attitude) result(text)
        type(model_type), intent(in) :: model
        integer, intent(in) :: attitude
        character(len=:), allocatable :: text
        integer :: s, c(3)

        text = ""
        do s = 1, size(model%step)
            if (.not. gives_attitude(model, model%step(s))) cycle
            if (model%step(s)%first /= attitude) cycle
            c = attitude_angles(model%step(s))
            text = "{"//pair("name", string(attitude_name(model, attitude)))//","// &
                   pair("is_pose", logical_value(comes_with_place(model%step(s))))//","// &
                   pair("angles", numbers(real(c - 1, wp)))//","// &
                   pair("by_table", logical_value(model%scene%coordinate(c(1))%motion%angle > 0))//"}"
        end do
    end function attitude_object

    !> Are the coordinates before an attitude's angles the place of the same link, or of a marker of it?
    pure logical function comes_with_place(step)
        type(step_type), intent(in) :: step
        integer :: k

        comes_with_place = step%kind == step_pose
        if (step%kind == step_parts) comes_with_place = all(step%coordinate == [(step%coordinate(4) - 4 + k, k=1, 6)])
    end function comes_with_place

    !> Assemblies of a model, each with its branches, joint variables and places of the links.
    function assemblies_as_json(model, list) result(text)
        type(model_type), intent(in) :: model
        type(assembly_list), intent(in) :: list
        character(len=:), allocatable :: text
        integer :: i, j, k

        text = "{"//pair("is_complete", logical_value(list%is_complete))//',"branch_joint":['
        do i = 1, size(list%chooser)
            text = text//separator(i)//string(model%joint(list%chooser(i))%name)
        end do
        text = text//'],"start_variable":['
        do i = 1, size(list%telling)
            text = text//separator(i)//integer_value(list%telling(i) - 1)
        end do
        text = text//'],"chain_key":['
        do i = 1, size(list%telling)
            text = text//separator(i)//string(trim(chain_key(model, list%telling(i))))
        end do
        text = text//'],"placed_link":['
        do i = 1, size(list%placed)
            text = text//separator(i)//integer_value(list%placed(i) - 1)
        end do
        text = text//'],"link":['
        do i = 1, model%n_link
            text = text//separator(i)//string(model%link(i)%name)
        end do
        text = text//'],"variable":['
        k = 0
        do j = 1, model%n_joint
            do i = 1, joint_n_variable(model%joint(j)%told_kind)
                k = k + 1
                text = text//separator(k)//string(trim(model%joint(j)%name)//"."//variable_name(i, model%joint(j)%told_kind))
            end do
        end do
        text = text//'],"assemblies":['
        do i = 1, list%n
            text = text//separator(i)//'{"branch":['
            do k = 1, size(list%chooser)
                text = text//separator(k)//integer_value(list%branch(k, i))
            end do
            text = text//"],"//pair("variable", numbers(list%variable(:, i)))//"," &
                //pair("position", numbers([list%position(:, :, i)]))//"," &
                //pair("rotation", numbers([(transpose(list%rotation(:, :, k, i)), k=1, model%n_link)]))//"}"
        end do
        text = text//"]}"
    end function assemblies_as_json

    !> Dimensions with labels and units, variables with their dimensions: see `linkdyn_results`.
    function layout_as_json(layout) result(text)
        type(layout_type), intent(in) :: layout
        character(len=:), allocatable :: text
        integer :: i

        text = '{"dimensions":['
        do i = dim_sample, n_dimension
            text = text//separator(i)//dimension_object(layout%dimension(i))
        end do
        text = text//'],"variables":['
        do i = 1, size(layout%variable)
            text = text//separator(i)//variable_object(layout, layout%variable(i))
        end do
        text = text//"]}"
    end function layout_as_json

    !> Stops that give way are springs besides, with their names and lines, or along measures.
    pure logical function gives_way_for_stop(scene, spring) result(gives_way)
        type(scene_type), intent(in) :: scene
        type(spring_spec), intent(in) :: spring
        integer :: i

        gives_way = spring%measure > 0
        do i = 1, n_stop(scene)
            gives_way = gives_way .or. (scene%stop(i)%line == spring%line &
                                        .and. index(scene%stop(i)%name, trim(spring%name)//".") == 1)
        end do
    end function gives_way_for_stop

    !> A spring between markers, or at the variable of a joint, whose markers it then has.
    function spring_object(scene, spring) result(text)
        type(scene_type), intent(in) :: scene
        type(spring_spec), intent(in) :: spring
        character(len=:), allocatable :: text
        character(len=:), allocatable :: joint, variable
        integer :: link(2), marker(2)

        joint = ""
        variable = ""
        link = spring%link
        marker = spring%marker
        if (spring%joint > 0) then
            joint = trim(scene%joint(spring%joint)%name)
            variable = trim(variable_name(spring%variable, scene%joint(spring%joint)%kind))
            link = scene%joint(spring%joint)%link
            marker = scene%joint(spring%joint)%marker
        end if
        text = "{"//pair("name", string(spring%name))//","//pair("joint", string(joint))//","//pair("variable", string(variable)) &
               //',"links":['//integer_value(link(1))//","//integer_value(link(2))//'],"markers":[' &
               //string(marker_name(scene, link(1), marker(1)))//","//string(marker_name(scene, link(2), marker(2)))//"]," &
               //pair("stiffness", number(spring%stiffness))//","//pair("damping", number(spring%damping))//"," &
               //pair("rest", number(spring%rest))//","//pair("has_force", logical_value(spring%force%kind /= law_none))//"}"
    end function spring_object

    !> One side of an end stop.
    function stop_object(scene, stop) result(text)
        type(scene_type), intent(in) :: scene
        type(stop_spec), intent(in) :: stop
        character(len=:), allocatable :: text

        character(len=:), allocatable :: variable

        associate (measure => scene%laws%measure(stop%measure))
            variable = ""
            if (measure%kind == measure_joint) variable = trim(scene%joint(measure%joint)%name)//"." &
                //trim(variable_name(measure%variable, scene%joint(measure%joint)%kind))
        end associate
        text = "{"//pair("name", string(stop%name))//","//pair("what", string(stop%what))//"," &
               //pair("variable", string(variable))//","//pair("side", integer_value(stop%side))//"," &
               //pair("bound", number(stop%bound))//","//pair("is_hard", logical_value(stop%is_hard))//"}"
    end function stop_object

    function link_object(link, name) result(text)
        type(link_spec), intent(in) :: link
        character(len=*), intent(in) :: name
        character(len=:), allocatable :: text
        integer :: i

        text = "{"//pair("name", string(name))//","//pair("mass", number(link%mass))//","// &
            pair("cog", numbers(link%cog))//","//pair("inertia", numbers(link%inertia))//',"markers":['
        if (allocated(link%marker)) then
            do i = 1, size(link%marker)
                text = text//separator(i)//marker_object(link%marker(i))
            end do
        end if
        text = text//"]"
        if (allocated(link%mesh)) text = text//","//pair("mesh", string(link%mesh))//","//pair("mesh_unit", number(link%mesh_unit))
        text = text//"}"
    end function link_object

    function marker_object(marker) result(text)
        type(marker_spec), intent(in) :: marker
        character(len=:), allocatable :: text

        text = "{"//pair("name", string(marker%name))//","//pair("at", numbers(marker%at))//","// &
            pair("axis", numbers(marker%axis))//","//pair("x", numbers(marker%x_axis))//"}"
    end function marker_object

    function joint_object(model, j) result(text)
        type(model_type), intent(in) :: model
        integer, intent(in) :: j
        character(len=:), allocatable :: text

        associate (scene => model%scene, joint => model%scene%joint(j))
            text = "{"//pair("name", string(joint%name))//","//pair("type", string(joint_kind_name(joint%kind)))//","// &
                '"links":['//integer_value(joint%link(1))//","//integer_value(joint%link(2))//'],"markers":['// &
                string(marker_name(scene, joint%link(1), joint%marker(1)))//","// &
                string(marker_name(scene, joint%link(2), joint%marker(2)))//"]"
            if (joint%kind == joint_screw) text = text//","//pair("lead", number(joint%lead))
            if (model%joint(j)%gear > 0) text = text//gear_members(model, model%gear(model%joint(j)%gear))
            if (model%joint(j)%belt > 0) text = text//gear_members(model, model%belt(model%joint(j)%belt)%gear)
            if (model%joint(j)%cam > 0) text = text//cam_members(joint%cam)
            text = text//"}"
        end associate
    end function joint_object

    !> One that leads a link by a part of its pose has with it which, of which point, and seen from which link.
    function coordinate_object(scene, coordinate) result(text)
        type(scene_type), intent(in) :: scene
        type(coordinate_spec), intent(in) :: coordinate
        character(len=:), allocatable :: text

        text = named(coordinate%name, coordinate%unit)
        if (coordinate%kind /= coordinate_joint) return
        associate (part => scene%joint(coordinate%joint))
            if (.not. is_pose_part(part%kind)) return
            text = text(:len(text) - 1)//","//pair("component", string(variable_name(coordinate%variable, part%kind)))// &
                ',"links":['//integer_value(part%link(1))//","//integer_value(part%link(2))//'],'// &
                pair("marker", string(marker_name(scene, part%link(2), part%marker(2))))//"}"
        end associate
    end function coordinate_object

    !> What gears, racks and belts have besides: the wheels, and the sum of joint variables that stays.
    function gear_members(model, gear) result(text)
        type(model_type), intent(in) :: model
        type(gear_type), intent(in) :: gear
        character(len=:), allocatable :: text
        integer :: i, n

        text = ","//pair("carrier", integer_value(gear%carrier))//","//pair("radii", numbers(gear%radius))//","// &
            pair("pitch", numbers(gear%pitch))//","// &
            pair("lead_angle", number(model%scene%joint(gear%joint)%lead_angle))//","// &
            pair("crossed", logical_value(model%scene%joint(gear%joint)%is_turned_over))//","// &
            pair("stretches", logical_value(model%joint(gear%joint)%belt > 0))//',"tied":['
        n = 0
        do i = 1, model%n_joint
            if (joint_n_variable(model%joint(i)%kind) == 0) cycle
            associate (weight => gear%weight(model%joint(i)%first_variable + 1))
                if (weight == 0) cycle
                n = n + 1
                text = text//separator(n)//"{"//pair("joint", string(model%joint(i)%name))//","// &
                    pair("weight", number(weight))//"}"
            end associate
        end do
        text = text//"]"
    end function gear_members

    !> What cams have besides: the follower, and the curve as the spline that it is.
    function cam_members(cam) result(text)
        type(cam_spec), intent(in) :: cam
        character(len=:), allocatable :: text

        associate (curve => cam%curve)
            text = ","//pair("follower", string(follower_name(cam%follower)))//","//pair("radius", number(cam%radius))//","// &
                pair("side", integer_value(cam%side))//","//pair("groove", logical_value(cam%is_groove))//","// &
                pair("path", logical_value(cam%is_path))//","//pair("barrel", logical_value(cam%is_barrel))//","// &
                pair("ground", number(cam%ground))//',"curve":{'//pair("polar", logical_value(curve%is_polar))//","// &
                pair("u", numbers(curve%u))//","//pair("value", numbers([curve%value]))//","// &
                pair("second", numbers([curve%second]))//"}"
        end associate
    end function cam_members

    function load_object(scene, load) result(text)
        type(scene_type), intent(in) :: scene
        type(load_spec), intent(in) :: load
        character(len=:), allocatable :: text

        text = "{"//pair("name", string(load%name))//","//pair("link", integer_value(load%link))//","// &
            pair("marker", string(marker_name(scene, load%link, load%marker)))//","// &
            pair("axes", string(merge("link ", "world", load%axes == axes_link)))//","// &
            pair("follows_state", trim(merge("true ", "false", any([load%force%kind, load%moment%kind] == law_over))))//"}"
    end function load_object

    function marker_name(scene, link, marker) result(name)
        type(scene_type), intent(in) :: scene
        integer, intent(in) :: link, marker
        character(len=:), allocatable :: name

        if (marker == 0) then
            name = ""
        else if (link == frame_link) then
            name = trim(scene%frame%marker(marker)%name)
        else
            name = trim(scene%link(link)%marker(marker)%name)
        end if
    end function marker_name

    function dimension_object(dimension) result(text)
        type(dimension_type), intent(in) :: dimension
        character(len=:), allocatable :: text

        text = "{"//pair("name", string(dimension%name))
        if (allocated(dimension%label)) text = text//","//pair("labels", strings(dimension%label))
        if (allocated(dimension%unit)) text = text//","//pair("units", strings(dimension%unit))
        text = text//"}"
    end function dimension_object

    function variable_object(layout, variable) result(text)
        type(layout_type), intent(in) :: layout
        type(variable_type), intent(in) :: variable
        character(len=:), allocatable :: text

        text = "{"//pair("name", string(variable%name))//","//pair("long_name", string(variable%long_name))//","// &
            pair("units", string(variable%units))//","//pair("is_integer", logical_value(variable%is_integer))//","// &
            pair("dims", strings(layout%dimension(variable%dim(:variable%n_dim))%name))
        if (variable%length > 0) text = text//","//pair("length", number(variable%length))
        if (variable%is_integer) text = text//","//pair("flags", strings(variable%flag))
        text = text//","//pair("jumps", logical_value(jumps(variable%id) .and. any(is_made_of_forces(layout%variable%id))))//"}"
    end function variable_object

    function motor_object(actuator) result(text)
        type(actuator_spec), intent(in) :: actuator
        character(len=:), allocatable :: text

        associate (motor => actuator%motor)
            text = "{"//pair("name", string(actuator%name))//","//pair("ratio", number(motor%ratio))//"," &
                   //pair("inertia", number(motor%inertia))//","//pair("efficiency", number(motor%efficiency))//"," &
                   //pair("back_efficiency", number(motor%back_efficiency))//"," &
                   //pair("torque_constant", number(motor%torque_constant))//"," &
                   //pair("resistance", number(motor%resistance))//"," &
                   //pair("inductance", number(motor%inductance))//"}"
        end associate
    end function motor_object

    function cylinder_object(actuator) result(text)
        type(actuator_spec), intent(in) :: actuator
        character(len=:), allocatable :: text

        associate (cylinder => actuator%cylinder)
            text = "{"//pair("name", string(actuator%name))//","//pair("head_area", number(cylinder%area(1)))//"," &
                   //pair("rod_area", number(cylinder%area(2)))//","//pair("retracted", number(cylinder%stroke(1)))//"," &
                   //pair("extended", number(cylinder%stroke(2)))//","//pair("supply", number(cylinder%supply))//"," &
                   //pair("tank", number(cylinder%tank))//","//pair("dead_volumes", numbers(cylinder%dead_volume))//"," &
                   //pair("has_gas", logical_value(cylinder%has_gas))//","//pair("exponent", number(cylinder%exponent))//"," &
                   //pair("has_states", logical_value(actuator%law%side == side_opening))//"}"
        end associate
    end function cylinder_object

    !> An actuator, with the unit of what it is told, and whether a law tells it.
    function actuator_object(actuator) result(text)
        type(actuator_spec), intent(in) :: actuator
        character(len=:), allocatable :: text
        character(len=len(actuator%unit)) :: unit

        unit = actuator%unit
        if (actuator%law%side == side_torque) unit = "N m"
        if (actuator%law%side == side_voltage) unit = "V"
        if (actuator%law%side == side_opening) unit = "1"
        text = "{"//pair("name", string(actuator%name))//","//pair("unit", string(actuator%unit))//","// &
            pair("effort_unit", string(unit))//","// &
            pair("has_law", logical_value(actuator%law%kind /= effort_inverse))//"}"
    end function actuator_object

    function named(name, unit) result(text)
        character(len=*), intent(in) :: name, unit
        character(len=:), allocatable :: text

        text = "{"//pair("name", string(name))//","//pair("unit", string(unit))//"}"
    end function named

    pure function separator(i) result(text)
        integer, intent(in) :: i
        character(len=:), allocatable :: text

        text = ","
        if (i == 1) text = ""
    end function separator

    !> A dataset without its numbers, which come in the order of the variables: reals and integers each in one row.
    function dataset_as_json(dataset, kept) result(text)
        type(dataset_type), intent(in) :: dataset
        type(sample_variable), intent(in) :: kept(:)    !! along the samples
        character(len=:), allocatable :: text
        integer :: i, k

        text = '{"dimensions":{'
        do i = 1, size(dataset%dimension)
            text = text//separator(i)//pair(trim(dataset%dimension(i)%name), integer_value(dataset%dimension(i)%size))
        end do
        text = text//'},"variables":['
        do i = 1, size(dataset%variable)
            associate (variable => dataset%variable(i))
                text = text//separator(i)//"{"//pair("name", string(variable%name))//","// &
                    pair("dims", strings([(dataset%dimension(variable%dim(k))%name, k=1, size(variable%dim))]))//","// &
                    pair("long_name", string(variable%long_name))//","//pair("units", string(variable%units))//","// &
                    pair("kind", string(kind_of(variable)))
                if (allocated(variable%text)) text = text//","//pair("text", strings(variable%text))
                text = text//"}"
            end associate
        end do
        text = text//'],"kept":['
        do i = 1, size(kept)
            associate (variable => kept(i))
                text = text//separator(i)//"{"//pair("name", string(variable%name))//","// &
                    pair("dims", strings([(dataset%dimension(variable%dim(k))%name, k=1, size(variable%dim))]))//","// &
                    pair("long_name", string(variable%long_name))//","//pair("units", string(variable%units))//","// &
                    pair("is_integer", logical_value(variable%is_integer))//"}"
            end associate
        end do
        text = text//'],"attributes":{'
        do i = 1, size(dataset%attribute)
            associate (attribute => dataset%attribute(i))
                if (allocated(attribute%text)) then
                    text = text//separator(i)//pair(trim(attribute%name), string(attribute%text))
                else
                    text = text//separator(i)//pair(trim(attribute%name), numbers(attribute%value))
                end if
            end associate
        end do
        text = text//"}}"
    end function dataset_as_json

    pure function kind_of(variable) result(kind)
        type(dataset_variable), intent(in) :: variable
        character(len=7) :: kind

        kind = "text"
        if (allocated(variable%real)) kind = "real"
        if (allocated(variable%integer)) kind = "integer"
    end function kind_of

    pure function pair(key, value) result(text)
        character(len=*), intent(in) :: key, value
        character(len=:), allocatable :: text

        text = string(key)//":"//value
    end function pair

    !> A JSON string: quotes, backslashes and control characters escaped, blanks at the end dropped.
    pure function string(value) result(text)
        character(len=*), intent(in) :: value
        character(len=:), allocatable :: text
        character(len=6) :: escape
        integer :: i, n

        allocate (character(len=6*len_trim(value) + 2) :: text)
        n = 0
        call add('"', text, n)
        do i = 1, len_trim(value)
            select case (value(i:i))
            case ('"', "\")
                call add("\"//value(i:i), text, n)
            case (achar(0):achar(31))
                write (escape, '("\u", z4.4)') iachar(value(i:i))
                call add(escape, text, n)
            case default
                call add(value(i:i), text, n)
            end select
        end do
        call add('"', text, n)
        text = text(:n)
    end function string

    pure subroutine add(part, text, n)
        character(len=*), intent(in) :: part
        character(len=*), intent(inout) :: text
        integer, intent(inout) :: n             !! letters so far

        text(n + 1:n + len(part)) = part
        n = n + len(part)
    end subroutine add

    pure function strings(values) result(text)
        character(len=*), intent(in) :: values(:)
        character(len=:), allocatable :: text
        integer :: i

        text = "["
        do i = 1, size(values)
            text = text//separator(i)//string(values(i))
        end do
        text = text//"]"
    end function strings

    !> Enough digits to read the same number back. Most are 0 or 1, which need none of the time that formatted output takes.
    pure function number(value) result(text)
        real(wp), intent(in) :: value
        character(len=:), allocatable :: text
        real(wp), parameter :: many = 1.0e6_wp
        character(len=48) :: buffer
        character(len=16) :: form

        ! a zero has a sign, too
        if (abs(value) < many .and. (abs(value) >= 1 .or. sign(1.0_wp, value) > 0)) then
            if (value == anint(value)) then
                text = to_text(nint(value))//".0"
                return
            end if
        end if
        write (form, "('(es48.', i0, 'e4)')") precision(1.0_wp) + 2
        write (buffer, form) value
        text = trim(adjustl(buffer))
    end function number

    pure function numbers(values) result(text)
        real(wp), intent(in) :: values(:)
        character(len=:), allocatable :: text
        integer :: i

        text = "["
        do i = 1, size(values)
            text = text//separator(i)//number(values(i))
        end do
        text = text//"]"
    end function numbers

    pure function integer_value(value) result(text)
        integer, intent(in) :: value
        character(len=:), allocatable :: text

        text = to_text(value)
    end function integer_value

    pure function logical_value(value) result(text)
        logical, intent(in) :: value
        character(len=:), allocatable :: text

        text = trim(merge("true ", "false", value))
    end function logical_value
end module linkdyn_description
