!> Coordinates of a scene file and their motion.
module linkdyn_scene_motion
    use linkdyn_angles, only: angles_by_spin, is_near_pole, matrix_of_angles
    use linkdyn_kinds, only: wp
    use linkdyn_status, only: status_type
    use linkdyn_text, only: quoted
    use linkdyn_scene, only: scene_type, coordinate_spec, law_spec, joint_spec, frame_link, coordinate_joint, pose_position, &
        pose_attitude, n_holding, coordinate_pose, pose_component_name, joint_n_variable, variable_name, law_table
    use linkdyn_toml, only: toml_node, toml_table, toml_array
    use linkdyn_units, only: quantity_type, per_second, length, angle, speed, angular_rate
    use linkdyn_scene_keys, only: scene_place, place_at, line_text, refuse, refuse_value, allow_keys, require_table, &
        get_quantity, quantity_of, get_vector, get_flag, text_of
    use linkdyn_scene_attitudes, only: attitude_key, get_attitude, has_quaternions, quaternion_laws
    use linkdyn_scene_names, only: find_link, find_joint, find_variable, find_marker
    use linkdyn_scene_joints, only: variable_quantity
    use linkdyn_scene_pattern, only: repeated_tables, list_repeated, repeated_at
    use linkdyn_scene_laws, only: table_shelf, table_reading, read_law, read_table_keys, law_of_column, has_column, &
        constant_law, spline
    implicit none (type, external)
    private
    public :: read_coordinates, read_base, joint_variable_name

    integer, parameter :: planar_components(3) = [1, 2, 6]   !! x y yaw
    integer, parameter :: spatial_components(6) = [1, 2, 3, 4, 5, 6]

contains

    !> The tables [[coordinate]]: one coordinate for a joint variable, three or six for a link's pose.
    subroutine read_coordinates(root, shelf, scene, status)
        type(scene_place), intent(in) :: root
        type(table_shelf), intent(inout) :: shelf
        type(scene_type), intent(inout) :: scene
        type(status_type), intent(inout) :: status
        type(repeated_tables) :: tables
        type(scene_place) :: place
        integer, allocatable :: components(:)
        integer :: i, n, next

        call list_repeated(root, "coordinate", scene%planar, .false., tables, status)
        if (.not. status%is_ok()) return
        n = size(tables%table)
        components = merge_components(scene%planar)
        allocate (scene%coordinate(n*size(components)))
        next = 1
        do i = 1, n
            place = repeated_at(root, tables, i, "coordinate")
            call read_coordinate(place, components, shelf, scene, next, status)
            if (.not. status%is_ok()) return
        end do
        scene%coordinate = scene%coordinate(:next - 1)
        call refuse_doubles(root, scene%coordinate, status)
    end subroutine read_coordinates

    subroutine read_coordinate(place, components, shelf, scene, next, status)
        type(scene_place), intent(inout) :: place
        integer, intent(in) :: components(:)
        type(table_shelf), intent(inout) :: shelf
        type(scene_type), intent(inout) :: scene
        integer, intent(inout) :: next                 !! free place in the scene's list
        type(status_type), intent(inout) :: status
        type(toml_node) :: joint, link, part, marker, relative
        integer :: n

        joint = place%node%get("joint")
        link = place%node%get("link")
        part = place%node%get("components")
        marker = place%node%get("marker")
        relative = place%node%get("relative_to")
        call allow_keys(place, [character(len=11) :: "joint", "variable", "link", "components", "marker", "relative_to", "start", &
                                "motion", "driven"], status)
        if (count([joint%is_present(), link%is_present(), marker%is_present()]) > 1) then
            call refuse(place, "has more than one of 'joint', 'link' and 'marker' (expected one of them)", status)
        else if (joint%is_present()) then
            call read_joint_coordinate(place, shelf, scene, scene%coordinate(next), status)
            next = next + 1
        else if (marker%is_present() .or. (link%is_present() .and. (part%is_present() .or. relative%is_present()))) then
            call read_part_of_pose(place, components, shelf, scene, scene%coordinate(next:), n, status)
            next = next + n
        else if (link%is_present()) then
            call read_pose(place, components, shelf, scene, scene%coordinate(next:next + size(components) - 1), status)
            next = next + size(components)
        else
            call refuse(place, "missing key 'joint', 'link' or 'marker' (expected the name of a joint, of a link, "// &
                "or ""link.marker"")", status)
        end if
    end subroutine read_coordinate

    !> A variable of a joint.
    subroutine read_joint_coordinate(place, shelf, scene, coordinate, status)
        type(scene_place), intent(inout) :: place
        type(table_shelf), intent(inout) :: shelf
        type(scene_type), intent(in) :: scene
        type(coordinate_spec), intent(inout) :: coordinate
        type(status_type), intent(inout) :: status
        type(quantity_type) :: quantity
        type(toml_node) :: node

        call allow_keys(place, [character(len=8) :: "joint", "variable", "start", "motion", "driven"], status)
        call find_joint(scene, place, coordinate%joint, status)
        if (.not. status%is_ok()) return
        call find_variable(scene, place, coordinate%joint, coordinate%variable, status)
        coordinate%kind = coordinate_joint
        coordinate%line = place%line
        coordinate%name = joint_variable_name(scene, coordinate%joint, coordinate%variable)
        place%what = "coordinate "//quoted(coordinate%name)
        quantity = variable_quantity(scene%joint(coordinate%joint)%kind, coordinate%variable)
        coordinate%unit = quantity%unit(:4)
        call read_start(place, "start", quantity, coordinate, status)
        if (.not. coordinate%has_start) coordinate%start_position = scene%joint(coordinate%joint)%start(coordinate%variable)
        node = place%node%get("motion")
        if (node%is_present()) call read_law(place, "motion", node, quantity, coordinate%start_position, &
            coordinate%name, spline, shelf, coordinate%motion, status)
        call read_driven(place, coordinate%is_driven, status)
        if (node%is_present()) return
        coordinate%has_start = coordinate%has_start .or. abs(coordinate%start_position) > 0
    end subroutine read_joint_coordinate

    !> A position, or position and velocity.
    subroutine read_start(place, key, quantity, coordinate, status)
        type(scene_place), intent(in) :: place
        character(len=*), intent(in) :: key
        type(quantity_type), intent(in) :: quantity
        type(coordinate_spec), intent(inout) :: coordinate
        type(status_type), intent(inout) :: status
        type(scene_place) :: inner
        type(toml_node) :: node
        logical :: found

        node = place%node%get(key)
        if (node%kind() == toml_table) then
            inner = place_at(place, node, trim(place%what)//", "//key)
            call allow_keys(inner, [character(len=8) :: "position", "velocity"], status)
            call get_quantity(inner, "position", quantity, coordinate%start_position, status, coordinate%has_start)
            call get_quantity(inner, "velocity", per_second(quantity), coordinate%start_velocity, status, found)
        else if (node%is_present()) then
            coordinate%has_start = .true.
            call quantity_of(place, key, node, quantity, coordinate%start_position, status)
        end if
    end subroutine read_start

    !> Does a forward run too follow the motion?
    subroutine read_driven(place, is_driven, status)
        type(scene_place), intent(in) :: place
        logical, intent(inout) :: is_driven
        type(status_type), intent(inout) :: status
        type(toml_node) :: motion

        call get_flag(place, "driven", is_driven, status)
        motion = place%node%get("motion")
        if (status%is_ok() .and. is_driven .and. .not. motion%is_present()) call refuse(place, "is driven but has no "// &
            "motion (expected motion = { law = .. }, or no 'driven')", status)
    end subroutine read_driven

    !> The pose of a link.
    subroutine read_pose(place, components, shelf, scene, coordinate, status)
        type(scene_place), intent(inout) :: place
        integer, intent(in) :: components(:)           !! of x y z roll pitch yaw
        type(table_shelf), intent(inout) :: shelf
        type(scene_type), intent(in) :: scene
        type(coordinate_spec), intent(inout) :: coordinate(:)
        type(status_type), intent(inout) :: status
        type(quantity_type) :: quantity
        integer :: i, link

        call find_link(scene, place, "link", link, status)
        call refuse_frame(place, "link", link, status)
        if (.not. status%is_ok()) return
        place%what = "coordinate "//quoted(scene%link(link)%name)
        call allow_keys(place, [character(len=6) :: "link", "start", "motion", "driven"], status)
        do i = 1, size(components)
            quantity = component_quantity(components(i))
            coordinate(i)%kind = coordinate_pose
            coordinate(i)%link = link
            coordinate(i)%variable = components(i)
            coordinate(i)%unit = quantity%unit(:4)
            coordinate(i)%name = trim(scene%link(link)%name)//"."//pose_component_name(components(i))
            coordinate(i)%line = place%line
        end do
        call read_pose_start(place, scene%planar, coordinate, status)
        call begin_at_link(place, scene, link, [0.0_wp, 0.0_wp, 0.0_wp], components, coordinate)
        call read_pose_motion(place, scene%planar, components, shelf, coordinate, status)
        call read_driven(place, coordinate(1)%is_driven, status)
        coordinate%is_driven = coordinate(1)%is_driven
    end subroutine read_pose

    !> Where neither a start nor a motion says where a pose begins, that is where the link's own start has it; so do components and
    !> laws that a motion leaves open.
    subroutine begin_at_link(place, scene, link, point, components, coordinate)
        type(scene_place), intent(in) :: place
        type(scene_type), intent(in) :: scene
        integer, intent(in) :: link
        real(wp), intent(in) :: point(3)               !! of the link, whose place x y z are, in its axes [m]
        integer, intent(in) :: components(:)           !! of x y z roll pitch yaw, as the frame sees them
        type(coordinate_spec), intent(inout) :: coordinate(:)
        type(toml_node) :: motion
        real(wp) :: start(6)

        if (.not. scene%link(link)%has_start) return
        motion = place%node%get("motion")
        start = scene%link(link)%start
        start(:3) = start(:3) + matmul(matrix_of_angles(start(4:)), point)
        where (.not. coordinate%has_start)
            coordinate%start_position = start(components)
            coordinate%has_start = .not. motion%is_present()
        end where
    end subroutine begin_at_link

    subroutine refuse_frame(place, key, link, status)
        type(scene_place), intent(in) :: place
        character(len=*), intent(in) :: key
        integer, intent(in) :: link
        type(status_type), intent(inout) :: status

        if (status%is_ok() .and. link == frame_link) call refuse_value(place, key, place%node%get(key), &
            "names the frame: the frame does not move (expected a moving link)", status)
    end subroutine refuse_frame

    !> Some components of a link's pose, of one of its points, or as another link sees them: variables of parts of poses, which are
    !> added to the joints. The rest of the pose follows from the loops.
    subroutine read_part_of_pose(place, possible, shelf, scene, coordinate, n, status)
        type(scene_place), intent(inout) :: place
        integer, intent(in) :: possible(:)             !! of x y z roll pitch yaw
        type(table_shelf), intent(inout) :: shelf
        type(scene_type), intent(inout) :: scene
        type(coordinate_spec), intent(inout) :: coordinate(:)
        integer, intent(out) :: n                      !! coordinates read
        type(status_type), intent(inout) :: status
        type(joint_spec) :: part
        type(quantity_type) :: quantity
        type(toml_node) :: node, start
        real(wp) :: point(3)
        type(scene_place) :: inner
        character(len=:), allocatable :: name
        integer, allocatable :: components(:)
        character(len=5), allocatable :: known(:)
        logical :: is_whole
        integer :: i, link, reference, marker

        n = 0
        call allow_keys(place, [character(len=11) :: "link", "marker", "components", "relative_to", "start", "motion", "driven"], &
                        status)
        marker = 0
        node = place%node%get("marker")
        if (node%is_present()) then
            call find_marker(scene, place, "marker", node, link, marker, status)
            call refuse_frame(place, "marker", link, status)
        else
            call find_link(scene, place, "link", link, status)
            call refuse_frame(place, "link", link, status)
        end if
        if (.not. status%is_ok()) return
        name = trim(scene%link(link)%name)
        if (marker > 0) name = name//"."//trim(scene%link(link)%marker(marker)%name)
        reference = frame_link
        node = place%node%get("relative_to")
        if (node%is_present()) call find_link(scene, place, "relative_to", reference, status)
        if (status%is_ok() .and. reference == link) call refuse_value(place, "relative_to", node, &
            "= "//quoted(scene%link(link)%name)//" is the link itself (expected another link)", status)
        call read_components(place, possible, components, status)
        if (.not. status%is_ok()) return
        place%what = "coordinate "//quoted(name)
        part%link = [reference, link]
        part%line = place%line
        n = size(components)
        is_whole = n == size(possible) .and. marker == 0 .and. reference == frame_link
        do i = 1, n
            associate (c => coordinate(i), is_position => components(i) <= 3)
                quantity = component_quantity(components(i))
                part%kind = merge(pose_position, pose_attitude, is_position)
                part%name = name//trim(merge(" position", " attitude", is_position))
                part%marker = [0, merge(marker, 0, is_position)]
                if (is_whole) then
                    c%kind = coordinate_pose
                    c%link = link
                    c%variable = components(i)
                else
                    c%kind = coordinate_joint
                    call place_of_part(scene, part, c%joint)
                    c%variable = components(i) - merge(0, 3, is_position)
                end if
                c%unit = quantity%unit(:4)
                c%name = name//"."//pose_component_name(components(i))
                c%line = place%line
            end associate
        end do
        known = pose_component_name(components)
        start = place%node%get("start")
        if (n == size(possible) .and. tells_whole_pose(start)) then
            call read_pose_start(place, scene%planar, coordinate(:n), status)
        else if (start%is_present()) then
            inner = place_at(place, start, trim(place%what)//", start")
            call require_table(inner, "a table with the components, { "//trim(known(1))//" = .. }", status)
            call allow_keys(inner, known, status)
            do i = 1, n
                call read_start(inner, trim(known(i)), component_quantity(components(i)), coordinate(i), status)
            end do
        end if
        point = 0
        if (marker > 0) point = scene%link(link)%marker(marker)%at
        if (reference == frame_link) call begin_at_link(place, scene, link, point, components, coordinate(:n))
        call read_pose_motion(place, scene%planar, components, shelf, coordinate(:n), status)
        call read_driven(place, coordinate(1)%is_driven, status)
        coordinate(:n)%is_driven = coordinate(1)%is_driven
    end subroutine read_part_of_pose

    !> Is a start written as that of a link's pose, not component by component?
    logical function tells_whole_pose(start)
        type(toml_node), intent(in) :: start
        character(len=*), parameter :: key(*) = [character(len=16) :: "position", "velocity", "angle", "angular_rate", &
                                                 attitude_key, "angular_rates", "angular_velocity"]
        type(toml_node) :: node
        integer :: i

        tells_whole_pose = .false.
        do i = 1, size(key)
            node = start%get(trim(key(i)))
            tells_whole_pose = tells_whole_pose .or. node%is_present()
        end do
    end function tells_whole_pose

    !> The key `components`: each once, in the order of x y z roll pitch yaw.
    subroutine read_components(place, possible, components, status)
        type(scene_place), intent(in) :: place
        integer, intent(in) :: possible(:)
        integer, allocatable, intent(out) :: components(:)
        type(status_type), intent(inout) :: status
        character(len=:), allocatable :: word, expected
        type(toml_node) :: node, item
        logical :: is_named(6), is_text
        integer :: i, k

        components = possible
        node = place%node%get("components")
        if (.not. node%is_present() .or. .not. status%is_ok()) return
        expected = "(expected a list of some of"
        do i = 1, size(possible)
            expected = expected//" '"//trim(pose_component_name(possible(i)))//"'"
        end do
        expected = expected//")"
        if (node%kind() /= toml_array .or. node%count() == 0) then
            call refuse_value(place, "components", node, "is "//node%kind_text()//" "//expected, status)
            return
        end if
        is_named = .false.
        do i = 1, node%count()
            item = node%at(i)
            call text_of(place, item, word, is_text)
            k = 0
            if (is_text) k = findloc(pose_component_name == word, .true., dim=1)
            if (k > 0) then
                if (all(possible /= k)) k = 0
            end if
            if (k == 0) then
                call refuse_value(place, "components", item, "holds what is no component of a pose here "//expected, status)
                return
            else if (is_named(k)) then
                call refuse_value(place, "components", item, "names one twice "//expected, status)
                return
            end if
            is_named(k) = .true.
        end do
        components = pack(possible, is_named(possible))
    end subroutine read_components

    !> The number of a part of a pose among the joints; it is added if it is not there.
    subroutine place_of_part(scene, part, place)
        type(scene_type), intent(inout) :: scene
        type(joint_spec), intent(in) :: part
        integer, intent(out) :: place

        do place = n_holding(scene) + 1, size(scene%joint)
            associate (other => scene%joint(place))
                if (other%kind == part%kind .and. all(other%link == part%link) &
                    .and. all(other%marker == part%marker)) return
            end associate
        end do
        scene%joint = [scene%joint, part]
        place = size(scene%joint)
    end subroutine place_of_part

    !> position, angles and their rates at the start.
    subroutine read_pose_start(place, planar, coordinate, status)
        type(scene_place), intent(in) :: place
        logical, intent(in) :: planar
        type(coordinate_spec), intent(inout) :: coordinate(:)
        type(status_type), intent(inout) :: status
        type(scene_place) :: inner
        type(toml_node) :: node
        real(wp), dimension(3) :: angles, omega, rate, rate2
        logical :: has_position, has_angle, has_spin, found
        integer :: n

        if (.not. status%is_ok()) return
        node = place%node%get("start")
        if (.not. node%is_present()) return
        inner = place_at(place, node, trim(place%what)//", start")
        angles = 0
        if (planar) then
            call require_table(inner, "a table, { position = [x, y], angle = .. }", status)
            call allow_keys(inner, [character(len=12) :: "position", "angle", "velocity", "angular_rate"], status)
            call get_quantity(inner, "angle", angle, coordinate(3)%start_position, status, has_angle)
            call get_quantity(inner, "angular_rate", angular_rate, coordinate(3)%start_velocity, status, found)
        else
            call require_table(inner, "a table, { position = [x, y, z], angles = [roll, pitch, yaw] }", status)
            call allow_keys(inner, [character(len=16) :: "position", attitude_key, "velocity", "angular_rates", &
                                    "angular_velocity"], status)
            call get_attitude(inner, angles, status, has_angle)
            if (has_angle) coordinate(4:)%start_position = angles
            call get_vector(inner, "angular_rates", angular_rate, coordinate(4:)%start_velocity, status, found)
            call get_vector(inner, "angular_velocity", angular_rate, omega, status, has_spin)
            if (has_spin .and. status%is_ok()) then
                if (found) call refuse(inner, "'angular_velocity' stands beside 'angular_rates' (expected one of them)", status)
                if (is_near_pole(angles)) call refuse(inner, "'angular_velocity' where pitch is within 3 degrees of a right "// &
                    "angle: the rates of roll and yaw do not tell it (expected other axes of the link, or 'angular_rates')", status)
                call angles_by_spin(angles, omega, [0.0_wp, 0.0_wp, 0.0_wp], rate, rate2)
                coordinate(4:)%start_velocity = rate
            end if
        end if
        n = merge(2, 3, planar)
        call get_vector(inner, "position", length, coordinate(:n)%start_position, status, has_position)
        call get_vector(inner, "velocity", speed, coordinate(:n)%start_velocity, status, found)
        coordinate%has_start = has_position .or. has_angle
    end subroutine read_pose_start

    !> The motion of the frame: laws as those of a link's pose. What is left out is zero.
    subroutine read_base(root, shelf, scene, status)
        type(scene_place), intent(in) :: root
        type(table_shelf), intent(inout) :: shelf
        type(scene_type), intent(inout) :: scene
        type(status_type), intent(inout) :: status
        type(scene_place) :: place
        type(toml_node) :: node, motion
        type(coordinate_spec), allocatable :: component(:)
        integer, allocatable :: components(:)
        integer :: i

        node = root%node%get("frame")
        if (.not. status%is_ok() .or. .not. node%is_present()) return
        motion = node%get("motion")
        if (.not. motion%is_present()) return
        place = place_at(root, node, "frame")
        components = merge_components(scene%planar)
        allocate (component(size(components)))
        call read_pose_motion(place, scene%planar, components, shelf, component, status)
        do i = 1, size(components)
            if (.not. status%is_ok()) return
            associate (law => component(i)%motion)
                if (law%kind == law_table .and. .not. allocated(law%curvature)) call refuse(place, "motion, "// &
                    trim(pose_component_name(components(i)))//": straight lines between rows have jumps of velocity and no "// &
                    "accelerations (expected interpolation = ""spline"")", status)
            end associate
        end do
        if (.not. status%is_ok()) return
        scene%base%moves = .true.
        scene%base%line = place%line
        scene%base%motion(components) = component%motion
    end subroutine read_base

    !> One table with a column for each component, or a law each; what is left out stays at its start.
    subroutine read_pose_motion(place, planar, components, shelf, coordinate, status)
        type(scene_place), intent(in) :: place
        logical, intent(in) :: planar
        integer, intent(in) :: components(:)
        type(table_shelf), intent(inout) :: shelf
        type(coordinate_spec), intent(inout) :: coordinate(:)
        type(status_type), intent(inout) :: status
        character(len=*), parameter :: expected = &
            "{ table = ""file.csv"" }, or a law for each component: { x = { law = .. }, ... }"
        type(scene_place) :: inner
        type(table_reading) :: reading
        type(toml_node) :: node, item
        character(len=:), allocatable :: component
        character(len=5) :: known(size(components) + 1)     ! in a constructor gfortran 12 leaks the copy of a section
        type(law_spec) :: of_quaternions(3)
        logical :: turns
        integer :: i

        if (.not. status%is_ok()) return
        node = place%node%get("motion")
        if (.not. node%is_present()) return
        inner = place_at(place, node, trim(place%what)//", motion")
        call require_table(inner, expected, status)
        if (.not. status%is_ok()) return
        item = node%get("law")
        if (item%is_present()) then
            call refuse(inner, "one law cannot move all components (expected "//expected//")", status)
            return
        end if
        item = node%get("table")
        if (item%is_present()) then
            call allow_keys(inner, [character(len=13) :: "table", "time", "interpolation"], status)
            call read_table_keys(inner, spline, shelf, reading, status)
            turns = .false.
            if (status%is_ok() .and. any(components > 3) .and. .not. planar) turns = has_quaternions(shelf, reading)
            if (turns) call quaternion_laws(inner, shelf, reading, of_quaternions, status)
        else
            known(:size(components)) = pose_component_name(components)
            known(size(components) + 1) = "table"
            call allow_keys(inner, known, status)
        end if
        do i = 1, size(components)
            if (.not. status%is_ok()) return
            component = trim(pose_component_name(components(i)))
            if (item%is_present() .and. turns .and. components(i) > 3) then
                if (has_column(shelf, reading, component)) call refuse(inner, "the table has the column "//quoted(component)// &
                    " beside quaternions (expected one of them)", status)
                coordinate(i)%motion = of_quaternions(components(i) - 3)
            else if (item%is_present()) then
                call law_of_column(shelf, reading, component, component_quantity(components(i)), &
                    coordinate(i)%motion, status)
            else
                call read_component(component, coordinate(i), component_quantity(components(i)))
            end if
        end do

    contains

        subroutine read_component(name, one, quantity)
            character(len=*), intent(in) :: name
            type(coordinate_spec), intent(inout) :: one
            type(quantity_type), intent(in) :: quantity
            type(toml_node) :: law

            law = node%get(name)
            if (law%is_present()) then
                call read_law(inner, name, law, quantity, one%start_position, name, spline, shelf, one%motion, status)
            else
                one%motion = constant_law(one%start_position)
            end if
        end subroutine read_component
    end subroutine read_pose_motion

    !> "J1" for a joint with one variable, "C.slide" for one with several.
    pure function joint_variable_name(scene, joint, variable) result(name)
        type(scene_type), intent(in) :: scene
        integer, intent(in) :: joint, variable
        character(len=:), allocatable :: name

        name = trim(scene%joint(joint)%name)
        if (joint_n_variable(scene%joint(joint)%kind) == 1) return
        name = name//"."//trim(variable_name(variable, scene%joint(joint)%kind))
    end function joint_variable_name

    !> Components of a pose in the plane or in space.
    pure function merge_components(planar) result(components)
        logical, intent(in) :: planar
        integer, allocatable :: components(:)

        if (planar) then
            components = planar_components
        else
            components = spatial_components
        end if
    end function merge_components

    pure type(quantity_type) function component_quantity(component) result(quantity)
        integer, intent(in) :: component               !! of x y z roll pitch yaw

        quantity = angle
        if (component <= 3) quantity = length
    end function component_quantity

    subroutine refuse_doubles(root, coordinate, status)
        type(scene_place), intent(in) :: root
        type(coordinate_spec), intent(in) :: coordinate(:)
        type(status_type), intent(inout) :: status
        type(scene_place) :: place
        integer :: i, j

        do i = 2, size(coordinate)
            do j = 1, i - 1
                if (coordinate(i)%name /= coordinate(j)%name) cycle
                place = root
                place%what = "coordinate "//quoted(coordinate(i)%name)
                call refuse(place, "is already declared on "//line_text(place, coordinate(j)%line, coordinate(i)%line)// &
                    " (expected each coordinate once)", status, coordinate(i)%line)
                return
            end do
        end do
    end subroutine refuse_doubles
end module linkdyn_scene_motion
