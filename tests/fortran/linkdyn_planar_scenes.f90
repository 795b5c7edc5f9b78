!> Planar scenes built in code.
module linkdyn_planar_scenes
    use linkdyn_kinds, only: wp
    use linkdyn_scene, only: scene_type, joint_revolute, joint_prismatic
    use linkdyn_test_scenes, only: new_scene, add_link, add_joint, add_joint_coordinates, add_actuator, start_at
    use linkdyn_text, only: to_text
    implicit none (type, external)
    private
    public :: planar_scene, add_body, connect, drive, dyad_scene, triad_scene, four_bar_chain

contains

    subroutine planar_scene(scene)
        type(scene_type), intent(out) :: scene

        call new_scene(scene)
        scene%planar = .true.
        scene%gravity = [0.4_wp, -9.805_wp, 0.0_wp]
    end subroutine planar_scene

    integer function add_body(scene, name) result(index)
        type(scene_type), intent(inout) :: scene
        character(len=*), intent(in) :: name

        index = add_link(scene, name, 2.0_wp, [0.1_wp, -0.05_wp, 0.0_wp], [0.0_wp, 0.0_wp, 0.3_wp, 0.0_wp, 0.0_wp, 0.0_wp])
    end function add_body

    !> A joint between points of two links; for a slide with its direction in each.
    integer function connect(scene, name, kind, first, at1, second, at2, angle1, angle2) result(joint)
        type(scene_type), intent(inout) :: scene
        character(len=*), intent(in) :: name
        character(len=1), intent(in) :: kind          !! R or P
        integer, intent(in) :: first, second
        real(wp), intent(in) :: at1(2), at2(2)
        real(wp), intent(in), optional :: angle1, angle2
        real(wp) :: axis1(3), axis2(3)

        axis1 = [1.0_wp, 0.0_wp, 0.0_wp]
        axis2 = axis1
        if (present(angle1)) axis1 = [cos(angle1), sin(angle1), 0.0_wp]
        if (present(angle2)) axis2 = [cos(angle2), sin(angle2), 0.0_wp]
        joint = add_joint(scene, name, merge(joint_prismatic, joint_revolute, kind == "P"), &
                          first, [at1, 0.0_wp], axis1, second, [at2, 0.0_wp], axis2)
        if (kind == "R") then
            scene%joint(joint)%start = 0
            call use_x_axis(first, scene%joint(joint)%marker(1))
            call use_x_axis(second, scene%joint(joint)%marker(2))
        end if

    contains

        subroutine use_x_axis(link, marker)
            integer, intent(in) :: link, marker

            if (link == 0) then
                scene%frame%marker(marker)%x_axis = [1.0_wp, 0.0_wp, 0.0_wp]
            else
                scene%link(link)%marker(marker)%x_axis = [1.0_wp, 0.0_wp, 0.0_wp]
            end if
        end subroutine use_x_axis
    end function connect

    subroutine drive(scene, joint)
        type(scene_type), intent(inout) :: scene
        integer, intent(in) :: joint

        call add_joint_coordinates(scene, joint)
        call add_actuator(scene, joint, 1)
    end subroutine drive

    !> A dyad between two driven links; or between the frame and a link on a rail, to stretch it. In its halves there may be slides
    !> that lead: 1 in the first, 2 in the second, 3 in both.
    subroutine dyad_scene(signature, scene, on_rail, led)
        character(len=3), intent(in) :: signature
        type(scene_type), intent(out) :: scene
        logical, intent(in), optional :: on_rail
        integer, intent(in), optional :: led
        integer :: a, b, x, y, tip(2), joint
        logical :: is_led(2)

        call planar_scene(scene)
        if (present(on_rail)) then
            a = add_body(scene, "carriage")
            x = add_body(scene, "x")
            y = add_body(scene, "y")
            joint = connect(scene, "rail", "P", 0, [0.0_wp, 0.0_wp], a, [0.0_wp, 0.0_wp])
            call drive(scene, joint)
            joint = connect(scene, "outer1", "R", 0, [0.0_wp, 0.0_wp], x, [0.0_wp, 0.0_wp])
            joint = connect(scene, "inner", "R", x, [0.5_wp, 0.0_wp], y, [0.6_wp, 0.0_wp])
            joint = connect(scene, "outer2", "R", a, [0.0_wp, 0.0_wp], y, [0.0_wp, 0.0_wp])
            scene%joint(3)%branch = 1
            call start_at(scene, [0.8_wp])
            return
        end if
        a = add_body(scene, "a")
        b = add_body(scene, "b")
        x = add_body(scene, "x")
        y = add_body(scene, "y")
        tip = [x, y]
        is_led = .false.
        if (present(led)) is_led = [btest(led, 0), btest(led, 1)]
        if (is_led(1)) tip(1) = add_body(scene, "x2")
        if (is_led(2)) tip(2) = add_body(scene, "y2")
        joint = connect(scene, "A", "R", 0, [0.0_wp, 0.0_wp], a, [0.0_wp, 0.1_wp])
        call drive(scene, joint)
        joint = connect(scene, "B", "R", b, [0.05_wp, 0.0_wp], 0, [1.0_wp, 0.1_wp])
        call drive(scene, joint)
        joint = connect(scene, "outer1", signature(1:1), a, [0.3_wp, 0.1_wp], x, [0.02_wp, 0.01_wp], 0.9_wp, 0.2_wp)
        if (signature(2:2) == "R") then
            joint = connect(scene, "inner", "R", tip(2), [0.55_wp, 0.1_wp], tip(1), [0.7_wp, -0.1_wp])
        else
            joint = connect(scene, "inner", "P", tip(2), [0.05_wp, 0.1_wp], tip(1), [0.07_wp, -0.1_wp], 2.0_wp, -0.3_wp)
        end if
        joint = connect(scene, "outer2", signature(3:3), y, [0.03_wp, -0.04_wp], b, [-0.2_wp, 0.15_wp], 0.4_wp, 1.9_wp)
        scene%joint(4)%branch = merge(1, 0, index("RRR RRP PRR RPR", signature) > 0)
        if (is_led(1)) then
            joint = connect(scene, "inside1", "P", x, [0.1_wp, 0.05_wp], tip(1), [0.2_wp, 0.0_wp], 0.3_wp, 0.1_wp)
            call drive(scene, joint)
        end if
        if (is_led(2)) then
            joint = connect(scene, "inside2", "P", tip(2), [0.2_wp, 0.03_wp], y, [0.1_wp, -0.05_wp], -0.2_wp, 0.6_wp)
            call drive(scene, joint)
        end if
        call start_at(scene, [0.4_wp, -0.3_wp, pack([0.15_wp, -0.15_wp], is_led)])
    end subroutine dyad_scene

    !> A platform on three rods with a crank: a triad, which no dyad places.
    subroutine triad_scene(scene)
        type(scene_type), intent(out) :: scene
        integer :: crank, rod(3), plate, joint, i
        real(wp), parameter :: foot(2, 2) = reshape([1.5_wp, -0.2_wp, 0.6_wp, 1.8_wp], [2, 2])
        real(wp), parameter :: corner(2, 3) = reshape([0.0_wp, 0.0_wp, 0.7_wp, 0.1_wp, 0.3_wp, 0.6_wp], [2, 3])
        real(wp), parameter :: start(2) = [0.5_wp, 0.5_wp]
        real(wp) :: tip(2), length

        call planar_scene(scene)
        crank = add_body(scene, "crank")
        plate = add_body(scene, "plate")
        scene%link(plate)%start(:2) = start
        scene%link(plate)%has_start = .true.
        joint = connect(scene, "crank", "R", 0, [0.0_wp, 0.0_wp], crank, [0.0_wp, 0.0_wp])
        call drive(scene, joint)
        do i = 1, 3
            rod(i) = add_body(scene, "rod"//to_text(i))
            if (i == 1) tip = 0.3_wp*[cos(0.4_wp), sin(0.4_wp)]
            if (i > 1) tip = foot(:, i - 1)
            length = norm2(start + corner(:, i) - tip)
            scene%link(rod(i))%start([1, 2, 6]) = [tip, atan2(start(2) + corner(2, i) - tip(2), start(1) + corner(1, i) - tip(1))]
            scene%link(rod(i))%has_start = .true.
            if (i == 1) joint = connect(scene, "foot1", "R", crank, [0.3_wp, 0.0_wp], rod(i), [0.0_wp, 0.0_wp])
            if (i > 1) joint = connect(scene, "foot"//to_text(i), "R", 0, tip, rod(i), [0.0_wp, 0.0_wp])
            joint = connect(scene, "corner"//to_text(i), "R", rod(i), [length, 0.0_wp], plate, corner(:, i))
        end do
        call start_at(scene, [0.4_wp])
    end subroutine triad_scene

    !> N four-bars in a row: the follower of one is the crank of the next.
    subroutine four_bar_chain(n, scene)
        integer, intent(in) :: n
        type(scene_type), intent(out) :: scene
        integer :: crank, coupler, follower, joint, i
        real(wp), parameter :: origin(2) = 0

        call planar_scene(scene)
        crank = add_body(scene, "crank")
        joint = connect(scene, "O", "R", 0, origin, crank, origin)
        call drive(scene, joint)
        do i = 1, n
            coupler = add_body(scene, "coupler"//to_text(i))
            follower = add_body(scene, "follower"//to_text(i))
            joint = connect(scene, "A"//to_text(i), "R", crank, [0.0_wp, 1.0_wp], coupler, origin)
            joint = connect(scene, "B"//to_text(i), "R", follower, [0.0_wp, 1.0_wp], coupler, [1.0_wp, 0.0_wp])
            scene%joint(joint)%branch = -1
            joint = connect(scene, "C"//to_text(i), "R", 0, [real(i, wp), 0.0_wp], follower, origin)
            crank = follower
        end do
        call start_at(scene, [0.3_wp])
    end subroutine four_bar_chain
end module linkdyn_planar_scenes
