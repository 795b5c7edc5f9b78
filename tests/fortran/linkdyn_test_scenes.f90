!> Scenes built in code, for tests of the engine that need no scene file.
module linkdyn_test_scenes
    use linkdyn_kinds, only: wp
    use linkdyn_model, only: model_type
    use linkdyn_payloads, only: take_payloads
    use linkdyn_scene, only: scene_type, link_spec, marker_spec, joint_spec, coordinate_spec, actuator_spec, load_spec, &
        joint_revolute, joint_prismatic, joint_cylindrical, joint_universal, joint_spherical, &
        joint_n_variable, variable_name, coordinate_joint, coordinate_pose, pose_component_name, axes_world, axes_link, law_spec, &
        law_harmonic, payload_spec
    use linkdyn_text, only: to_text
    implicit none (type, external)
    private
    public :: new_scene, add_link, add_joint, add_pose, add_joint_coordinates, add_actuator, add_load, add_ups_leg
    public :: stewart_scene, stewart_on_carriage, change_axes, open_chain_scene, start_at, move_frame, load_link
    public :: base_point, platform_point, universal_axis

    real(wp), parameter :: z_axis(3) = [0.0_wp, 0.0_wp, 1.0_wp], y_axis(3) = [0.0_wp, 1.0_wp, 0.0_wp]

    ! A Stewart platform of general shape [m].
    real(wp), parameter :: base_point(3, 6) = reshape([ &
        1.58_wp, 0.28_wp, 0.02_wp, -0.55_wp, 1.50_wp, 0.0_wp, -1.03_wp, 1.23_wp, -0.03_wp, &
        -1.03_wp, -1.23_wp, 0.0_wp, -0.55_wp, -1.50_wp, 0.01_wp, 1.58_wp, -0.28_wp, 0.0_wp], [3, 6])
    real(wp), parameter :: platform_point(3, 6) = reshape([ &
        0.74_wp, 0.82_wp, 0.0_wp, 0.34_wp, 1.05_wp, 0.02_wp, -1.08_wp, 0.23_wp, 0.0_wp, &
        -1.08_wp, -0.23_wp, -0.01_wp, 0.34_wp, -1.05_wp, 0.0_wp, 0.74_wp, -0.82_wp, 0.03_wp], [3, 6])
    real(wp), parameter :: universal_axis(3, 6) = reshape([ &
        0.54_wp, 0.84_wp, 0.0_wp, 0.45_wp, 0.89_wp, 0.1_wp, 1.0_wp, -0.05_wp, 0.0_wp, &
        1.0_wp, 0.05_wp, -0.2_wp, -0.45_wp, 0.89_wp, 0.0_wp, -0.54_wp, 0.84_wp, 0.05_wp], [3, 6])

contains

    !> The frame of a mechanism begins to sway and turn, in motion at any instant.
    subroutine move_frame(model)
        type(model_type), intent(inout) :: model
        logical, parameter :: is_planar(6) = [.true., .true., .false., .false., .false., .true.]
        integer :: k

        model%scene%base%moves = .true.
        do k = 1, 6
            if (model%is_planar .and. .not. is_planar(k)) cycle
            model%scene%base%motion(k) = law_spec(kind=law_harmonic, &
                                                  value=[0.1_wp*k, 0.3_wp, 1 + 0.3_wp*k, 0.4_wp + 0.7_wp*k])
        end do
    end subroutine move_frame

    !> The first link gets something to carry whose mass changes.
    subroutine load_link(model)
        type(model_type), intent(inout) :: model

        deallocate (model%scene%payload, model%payload)
        allocate (model%scene%payload(1))
        model%scene%payload(1) = payload_spec(name="first", link=1, marker=1, mass=law_spec( &
            kind=law_harmonic, value=[3.0_wp, 1.0_wp, 2.0_wp, 0.5_wp]))
        call take_payloads(model)
    end subroutine load_link

    ! ---------------------------------------------------------------- parts

    subroutine new_scene(scene)
        type(scene_type), intent(out) :: scene

        allocate (scene%link(0), scene%joint(0), scene%coordinate(0), scene%actuator(0), scene%load(0), scene%spring(0))
        allocate (scene%frame%marker(0))
        scene%frame%name = "frame"
        scene%gravity = [0.3_wp, -0.2_wp, -9.805_wp]
        scene%has_gravity = .true.
        scene%time%n_sample = 1
    end subroutine new_scene

    !> A link; returns its index.
    integer function add_link(scene, name, mass, cog, inertia) result(index)
        type(scene_type), intent(inout) :: scene
        character(len=*), intent(in) :: name
        real(wp), intent(in) :: mass, cog(3), inertia(6)    !! [kg, m, kg m2]: Ixx Iyy Izz Ixy Iyz Izx
        type(link_spec) :: link

        link%name = name
        link%mass = mass
        link%cog = cog
        link%inertia = inertia
        allocate (link%marker(0))
        scene%link = [scene%link, link]
        index = size(scene%link)
    end function add_link

    !> A marker on a link (0: the frame), its x axis the image of x under the smallest turn from z to the axis.
    integer function add_marker(scene, link, at, axis) result(index)
        type(scene_type), intent(inout) :: scene
        integer, intent(in) :: link
        real(wp), intent(in) :: at(3), axis(3)
        type(marker_spec) :: marker
        real(wp) :: a(3)

        a = axis/norm2(axis)
        marker%at = at
        marker%axis = a
        marker%x_axis = [1.0_wp, 0.0_wp, 0.0_wp] - a(1)/(1 + a(3))*(a + z_axis)
        if (link == 0) then
            scene%frame%marker = [scene%frame%marker, marker]
            index = size(scene%frame%marker)
        else
            scene%link(link)%marker = [scene%link(link)%marker, marker]
            index = size(scene%link(link)%marker)
        end if
    end function add_marker

    !> A joint between points of two links (0: the frame); returns its index.
    integer function add_joint(scene, name, kind, first, at1, axis1, second, at2, axis2) result(index)
        type(scene_type), intent(inout) :: scene
        character(len=*), intent(in) :: name
        integer, intent(in) :: kind, first, second
        real(wp), intent(in), dimension(3) :: at1, axis1, at2, axis2
        type(joint_spec) :: joint

        joint%name = name
        joint%kind = kind
        joint%link = [first, second]
        joint%marker(1) = add_marker(scene, first, at1, axis1)
        joint%marker(2) = add_marker(scene, second, at2, axis2)
        scene%joint = [scene%joint, joint]
        index = size(scene%joint)
    end function add_joint

    !> The pose of a link as six coordinates.
    subroutine add_pose(scene, link)
        type(scene_type), intent(inout) :: scene
        integer, intent(in) :: link
        type(coordinate_spec) :: coordinate
        integer :: k

        do k = 1, 6
            coordinate%name = trim(scene%link(link)%name)//"."//trim(pose_component_name(k))
            coordinate%unit = merge("m  ", "rad", k <= 3)
            coordinate%kind = coordinate_pose
            coordinate%variable = k
            coordinate%link = link
            scene%coordinate = [scene%coordinate, coordinate]
        end do
    end subroutine add_pose

    !> All variables of a joint as coordinates.
    subroutine add_joint_coordinates(scene, joint)
        type(scene_type), intent(inout) :: scene
        integer, intent(in) :: joint
        type(coordinate_spec) :: coordinate
        integer :: k

        do k = 1, joint_n_variable(scene%joint(joint)%kind)
            associate (variable => variable_name(k, scene%joint(joint)%kind))
                coordinate%name = trim(scene%joint(joint)%name)//"."//trim(variable)
                coordinate%unit = merge("m  ", "rad", variable == "slide")
            end associate
            coordinate%kind = coordinate_joint
            coordinate%variable = k
            coordinate%joint = joint
            scene%coordinate = [scene%coordinate, coordinate]
        end do
    end subroutine add_joint_coordinates

    subroutine add_actuator(scene, joint, variable)
        type(scene_type), intent(inout) :: scene
        integer, intent(in) :: joint, variable
        type(actuator_spec) :: actuator

        actuator%name = scene%joint(joint)%name
        actuator%joint = joint
        actuator%variable = variable
        scene%actuator = [scene%actuator, actuator]
    end subroutine add_actuator

    subroutine add_load(scene, link, at, axes)
        type(scene_type), intent(inout) :: scene
        integer, intent(in) :: link, axes
        real(wp), intent(in) :: at(3)
        type(load_spec) :: load

        load%name = trim(scene%link(link)%name)//".load"//to_text(size(scene%load) + 1)
        load%link = link
        load%marker = add_marker(scene, link, at, z_axis)
        load%axes = axes
        scene%load = [scene%load, load]
    end subroutine add_load

    !> Start positions of all coordinates, about which the representative poses lie.
    subroutine start_at(scene, q)
        type(scene_type), intent(inout) :: scene
        real(wp), intent(in) :: q(:)

        scene%coordinate%start_position = q
        scene%coordinate%has_start = .true.
    end subroutine start_at

    !> Two links and three joints between a point of the base (0: the frame) and a point of the platform, driven.
    subroutine add_ups_leg(scene, name, base, base_at, axis, platform, platform_at, massless)
        type(scene_type), intent(inout) :: scene
        character(len=*), intent(in) :: name
        integer, intent(in) :: base, platform
        real(wp), intent(in), dimension(3) :: base_at, axis, platform_at
        logical, intent(in) :: massless
        real(wp), parameter :: origin(3) = 0
        real(wp) :: part
        integer :: lower, upper, joint

        part = merge(0.0_wp, 1.0_wp, massless)
        lower = add_link(scene, name//".lower", 45*part, [0.02_wp, -0.01_wp, 0.55_wp]*part, &
                         [4.6_wp, 4.9_wp, 0.35_wp, 0.05_wp, -0.1_wp, 0.2_wp]*part)
        upper = add_link(scene, name//".upper", 18*part, [0.0_wp, 0.015_wp, -0.6_wp]*part, &
                         [2.2_wp, 2.16_wp, 0.06_wp, -0.02_wp, 0.03_wp, 0.01_wp]*part)
        joint = add_joint(scene, name//".U", joint_universal, base, base_at, axis, lower, origin, y_axis)
        joint = add_joint(scene, name//".P", joint_prismatic, lower, origin, z_axis, upper, origin, z_axis)
        call add_actuator(scene, joint, 1)
        joint = add_joint(scene, name//".S", joint_spherical, upper, origin, z_axis, platform, platform_at, z_axis)
    end subroutine add_ups_leg

    ! ---------------------------------------------------------------- scenes

    !> A Stewart platform of six UPS legs on the frame, with loads on the platform in world and in link axes.
    subroutine stewart_scene(scene, massless_legs)
        type(scene_type), intent(out) :: scene
        logical, intent(in) :: massless_legs
        integer :: platform, i

        call new_scene(scene)
        platform = add_platform(scene)
        do i = 1, 6
            call add_ups_leg(scene, "leg"//to_text(i), 0, base_point(:, i), universal_axis(:, i), &
                             platform, platform_point(:, i), massless_legs)
        end do
        call start_at(scene, [0.05_wp, -0.04_wp, 1.9_wp, 0.0_wp, 0.0_wp, 0.0_wp])
    end subroutine stewart_scene

    !> Links of legs are written in turned and shifted axes.
    subroutine change_axes(scene)
        type(scene_type), intent(inout) :: scene
        real(wp) :: r(3, 3), shift(3), tensor(3, 3)
        integer :: i, k

        do i = 1, size(scene%link)
            if (index(scene%link(i)%name, "leg") == 0) cycle
            r = turned(0.3_wp*i, -0.7_wp + 0.2_wp*i)
            shift = [0.1_wp, -0.02_wp*i, 0.3_wp]
            associate (link => scene%link(i))
                do k = 1, size(link%marker)
                    link%marker(k)%at = matmul(r, link%marker(k)%at) + shift
                    link%marker(k)%axis = matmul(r, link%marker(k)%axis)
                    link%marker(k)%x_axis = matmul(r, link%marker(k)%x_axis)
                end do
                link%cog = matmul(r, link%cog) + shift
                associate (j => link%inertia)
                    tensor = reshape([j(1), j(4), j(6), j(4), j(2), j(5), j(6), j(5), j(3)], [3, 3])
                end associate
                tensor = matmul(matmul(r, tensor), transpose(r))
                link%inertia = [tensor(1, 1), tensor(2, 2), tensor(3, 3), tensor(1, 2), tensor(2, 3), tensor(3, 1)]
            end associate
        end do
    end subroutine change_axes

    pure function turned(a, b) result(r)
        real(wp), intent(in) :: a, b                   !! about z, then about x [rad]
        real(wp) :: r(3, 3)

        r = matmul(reshape([1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, cos(b), sin(b), 0.0_wp, -sin(b), cos(b)], [3, 3]), &
                   reshape([cos(a), sin(a), 0.0_wp, -sin(a), cos(a), 0.0_wp, 0.0_wp, 0.0_wp, 1.0_wp], [3, 3]))
    end function turned

    !> The same on a turntable that stands on a carriage: coordinates slide, angle, then the pose of the platform.
    subroutine stewart_on_carriage(scene)
        type(scene_type), intent(out) :: scene
        real(wp), parameter :: origin(3) = 0
        integer :: platform, carriage, turntable, joint, i

        call new_scene(scene)
        carriage = add_link(scene, "carriage", 300.0_wp, [0.1_wp, 0.05_wp, -0.2_wp], &
                            [40.0_wp, 55.0_wp, 60.0_wp, 2.0_wp, -3.0_wp, 1.0_wp])
        turntable = add_link(scene, "turntable", 250.0_wp, [-0.05_wp, 0.02_wp, -0.1_wp], &
                             [30.0_wp, 35.0_wp, 50.0_wp, -2.0_wp, 1.5_wp, 0.5_wp])
        joint = add_joint(scene, "rail", joint_prismatic, 0, [0.0_wp, 0.1_wp, 0.0_wp], [1.0_wp, 0.2_wp, 0.1_wp], &
                          carriage, origin, [1.0_wp, 0.2_wp, 0.1_wp])
        call add_joint_coordinates(scene, joint)
        call add_actuator(scene, joint, 1)
        ! Written backwards, the planner must walk it from its second link.
        joint = add_joint(scene, "pivot", joint_revolute, turntable, [0.0_wp, 0.0_wp, -0.2_wp], [0.1_wp, -0.2_wp, 1.0_wp], &
                          carriage, [0.1_wp, 0.0_wp, 0.1_wp], [0.0_wp, 0.1_wp, 1.0_wp])
        call add_joint_coordinates(scene, joint)
        call add_actuator(scene, joint, 1)
        platform = add_platform(scene)
        do i = 1, 6
            call add_ups_leg(scene, "leg"//to_text(i), turntable, base_point(:, i), universal_axis(:, i), &
                             platform, platform_point(:, i), .false.)
        end do
        call start_at(scene, [0.05_wp, 0.1_wp, 0.05_wp, -0.04_wp, 2.2_wp, 0.0_wp, 0.0_wp, 0.0_wp])
    end subroutine stewart_on_carriage

    integer function add_platform(scene) result(platform)
        type(scene_type), intent(inout) :: scene

        platform = add_link(scene, "platform", 850.0_wp, [0.08_wp, -0.05_wp, 0.35_wp], &
                            [310.0_wp, 285.0_wp, 420.0_wp, -12.5_wp, -9.5_wp, 18.0_wp])
        call add_pose(scene, platform)
        call add_load(scene, platform, [0.2_wp, 0.1_wp, 0.3_wp], axes_world)
        call add_load(scene, platform, [-0.1_wp, 0.3_wp, 0.4_wp], axes_link)
    end function add_platform

    !> Revolute (backwards), prismatic, cylindrical (backwards), universal and, if wanted, spherical joint in a row; every
    !> joint variable is a coordinate and, but for those of the spherical joint, driven.
    subroutine open_chain_scene(scene, with_spherical)
        type(scene_type), intent(out) :: scene
        logical, intent(in) :: with_spherical
        integer :: link(5), joint(5), n, i, k

        call new_scene(scene)
        n = merge(5, 4, with_spherical)
        do i = 1, n
            link(i) = add_link(scene, "link"//to_text(i), 10.0_wp/i, [0.1_wp*i, -0.05_wp, 0.2_wp], &
                               [2.0_wp, 2.5_wp, 3.0_wp, 0.3_wp, -0.2_wp, 0.1_wp]/i)
        end do
        joint(1) = add_joint(scene, "R", joint_revolute, link(1), [0.1_wp, 0.0_wp, 0.2_wp], [0.2_wp, 0.1_wp, 1.0_wp], &
                             0, [0.5_wp, -0.2_wp, 0.1_wp], [-0.1_wp, 0.3_wp, 1.0_wp])
        joint(2) = add_joint(scene, "P", joint_prismatic, link(1), [0.4_wp, 0.1_wp, 0.0_wp], [1.0_wp, 0.3_wp, 0.2_wp], &
                             link(2), [-0.2_wp, 0.1_wp, 0.1_wp], [0.9_wp, -0.1_wp, 0.4_wp])
        joint(3) = add_joint(scene, "C", joint_cylindrical, link(3), [0.2_wp, 0.2_wp, -0.1_wp], [0.0_wp, 1.0_wp, 0.3_wp], &
                             link(2), [0.3_wp, 0.0_wp, 0.2_wp], [0.4_wp, 0.2_wp, 1.0_wp])
        joint(4) = add_joint(scene, "U", joint_universal, link(3), [0.1_wp, 0.4_wp, 0.2_wp], [1.0_wp, 0.1_wp, 0.2_wp], &
                             link(4), [0.0_wp, -0.3_wp, 0.1_wp], [0.2_wp, 1.0_wp, -0.1_wp])
        if (with_spherical) &
            joint(5) = add_joint(scene, "S", joint_spherical, link(4), [0.3_wp, 0.2_wp, 0.1_wp], [0.3_wp, 0.1_wp, 1.0_wp], &
                                 link(5), [0.1_wp, -0.1_wp, -0.2_wp], [0.0_wp, 0.2_wp, 1.0_wp])
        do i = 1, n
            call add_joint_coordinates(scene, joint(i))
            if (scene%joint(joint(i))%kind == joint_spherical) cycle
            do k = 1, joint_n_variable(scene%joint(joint(i))%kind)
                call add_actuator(scene, joint(i), k)
            end do
        end do
        call add_load(scene, link(n), [0.2_wp, 0.1_wp, 0.3_wp], axes_world)
        call add_load(scene, link(2), [-0.1_wp, 0.3_wp, 0.4_wp], axes_link)
    end subroutine open_chain_scene
end module linkdyn_test_scenes
