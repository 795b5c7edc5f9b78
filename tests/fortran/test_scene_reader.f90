!> linkdyn_scene_reader: what a scene file says arrives in the scene; mistakes are refused in words.
!>
!> Many more refusals lie as files in tests/cli/bad_scenes.
module test_scene_reader
    use linkdyn_kinds, only: wp
    use linkdyn_constants, only: pi
    use linkdyn_testing, only: test_error, unit_test, new_test, check, check_close
    use linkdyn_status, only: status_type, status_bad_input
    use linkdyn_scene, only: scene_type, joint_universal, joint_prismatic, joint_spherical, law_constant, &
        law_cycloidal_start, law_harmonic, law_none, axes_link, effort_dc_motor, effort_spring_damper, effort_pd
    use linkdyn_scene_reader, only: parse_scene, read_scene, check_actuators
    implicit none (type, external)
    private
    public :: collect_scene_reader

    character(len=1), parameter :: lf = achar(10)
    real(wp), parameter :: tolerance = 8*epsilon(1.0_wp)   !! of values of order 1: roundings of a unit factor

    character(len=*), parameter :: planar_head = 'space = "planar"'//lf//'frame = { markers = { O = [1, 2] } }'//lf
    character(len=*), parameter :: crank = '[[link]]'//lf//'name = "crank"'//lf//'mass = "1.5 kg"'//lf// &
        'cog = ["250 mm", 0]'//lf//'inertia = 0.2'//lf// &
        'markers = { A = [0, 0], B = { at = [1, 0], axis = [3, 4] } }'//lf
    character(len=*), parameter :: hinge = '[[joint]]'//lf//'name = "A"'//lf//'type = "revolute"'//lf// &
        'between = ["frame.O", "crank.A"]'//lf
    character(len=*), parameter :: turn = '[[coordinate]]'//lf//'joint = "A"'//lf// &
        'start = { position = "90 deg", velocity = "60 rpm" }'//lf// &
        'motion = { law = "cycloidal-start", speed = "120 rpm", duration = 2 }'//lf
    character(len=*), parameter :: planar = planar_head//crank//hinge//turn

    character(len=*), parameter :: platform = 'space = "spatial"'//lf//'gravity = [0, 0, "-9.81 m/s^2"]'//lf// &
        '[frame]'//lf//'markers = { B1 = [1, 0, 0], B2 = [0, 1, 0] }'//lf//'[[link]]'//lf//'name = "top"'//lf// &
        'mass = 2'//lf//'inertia = { diagonal = [1, 1, 1] }'//lf// &
        'markers = { P1 = [1, 0, 0], P2 = [0, 1, 0], tool = [0, 0, 1] }'//lf
    character(len=*), parameter :: legs = '[[chain]]'//lf//'type = "UPS"'//lf//'base = ["frame.B1", "frame.B2"]'//lf// &
        'platform = ["top.P1", "top.P2"]'//lf//'axis = [[0, 2, 0], [1, 0, 0]]'//lf// &
        'lower = { mass = 4, cog = [0, 0, 0.5], inertia = [4, 4, 1, 0, 0, 0] }'//lf// &
        'upper = [{ mass = 0 }, { mass = 3, inertia = [2, 2, 1, 0, 0, 0] }]'//lf

contains

    subroutine collect_scene_reader(tests)
        type(unit_test), allocatable, intent(out) :: tests(:)

        tests = [ &
            new_test("planar scene", test_planar), &
            new_test("UPS chain", test_chain), &
            new_test("markers and their axes", test_markers), &
            new_test("pose of a link", test_pose), &
            new_test("loads", test_loads), &
            new_test("drives", test_drives), &
            new_test("springs", test_springs), &
            new_test("instants", test_time), &
            new_test("inertia of a body", test_inertia), &
            new_test("number of actuators", test_actuators), &
            new_test("names with dots", test_dotted_names), &
            new_test("refusals", test_refusals), &
            new_test("files that are none", test_files)]
    end subroutine collect_scene_reader

    subroutine test_planar(error)
        type(test_error), intent(inout) :: error
        type(scene_type) :: scene

        call read_good(error, planar, scene)
        if (allocated(error%message)) return
        call check(error, scene%planar .and. .not. scene%has_gravity, "planar, no gravity")
        call check_close(error, scene%link(1)%mass, 1.5_wp, 0.0_wp, "mass")
        call check_close(error, scene%link(1)%cog, [0.25_wp, 0.0_wp, 0.0_wp], tolerance, "cog")
        call check_close(error, scene%frame%marker(1)%at, [1.0_wp, 2.0_wp, 0.0_wp], 0.0_wp, "point of the frame")
        call check_close(error, scene%link(1)%marker(1)%axis, [1.0_wp, 0.0_wp, 0.0_wp], 0.0_wp, "default direction of a slide")
        call check_close(error, scene%link(1)%marker(2)%axis, [0.6_wp, 0.8_wp, 0.0_wp], tolerance, "direction of a slide")
        call check(error, all(scene%joint(1)%link == [0, 1]) .and. all(scene%joint(1)%marker == 1), "joint")
        associate (coordinate => scene%coordinate(1))
            call check(error, coordinate%name == "A" .and. coordinate%unit == "rad", "coordinate")
            call check_close(error, [coordinate%start_position, coordinate%start_velocity], [pi/2, 2*pi], tolerance, "start")
            call check(error, coordinate%motion%kind == law_cycloidal_start, "law")
            call check_close(error, coordinate%motion%value(:3), [pi/2, 4*pi, 2.0_wp], 2*tolerance, &
                "law starts at the coordinate's start")
        end associate
        call check_close(error, [scene%time%first, scene%time%last], [0.0_wp, 2.0_wp], 0.0_wp, "time of the run")
        call check(error, scene%time%n_sample == 201, "samples")
        call check(error, scene%text == planar, "the text is kept")
    end subroutine test_planar

    subroutine test_chain(error)
        type(test_error), intent(inout) :: error
        type(scene_type) :: scene

        call read_good(error, platform//legs, scene)
        if (allocated(error%message)) return
        call check(error, size(scene%link) == 5 .and. size(scene%joint) == 6 .and. size(scene%actuator) == 2, "sizes")
        call check(error, all(scene%link(2:3)%name == ["leg1.lower", "leg1.upper"]), "links")
        call check(error, all(scene%joint(4:6)%name == ["leg2.U", "leg2.P", "leg2.S"]), "joints")
        call check(error, all(scene%joint(4:6)%kind == [joint_universal, joint_prismatic, joint_spherical]), "kinds")
        call check(error, all(scene%joint(4)%link == [0, 4]) .and. all(scene%joint(5)%link == [4, 5]) .and. &
            all(scene%joint(6)%link == [5, 1]), "what the joints join")
        associate (base => scene%frame%marker(scene%joint(4)%marker(1)), top => scene%link(1)%marker(scene%joint(6)%marker(2)))
            call check_close(error, base%at, [0.0_wp, 1.0_wp, 0.0_wp], 0.0_wp, "base point of leg 2")
            call check_close(error, base%axis, [1.0_wp, 0.0_wp, 0.0_wp], 0.0_wp, "its axis")
            call check(error, top%name == "P2", "its point of the platform")
        end associate
        call check_close(error, scene%link(4)%marker(scene%joint(4)%marker(2))%axis, [0.0_wp, 1.0_wp, 0.0_wp], 0.0_wp, &
            "second axis of the universal joint")
        call check_close(error, scene%link(4)%marker(scene%joint(5)%marker(1))%axis, [0.0_wp, 0.0_wp, 1.0_wp], 0.0_wp, "slide")
        call check_close(error, [scene%link(3)%mass, scene%link(5)%mass], [0.0_wp, 3.0_wp], 0.0_wp, "masses one a leg")
        call check(error, scene%actuator(2)%name == "leg2.P" .and. scene%actuator(2)%unit == "N" .and. &
            scene%actuator(2)%joint == 5, "actuator")
        call read_good(error, platform//legs//"actuated = false"//lf//'names = ["a", "b"]'//lf, scene)
        call check(error, size(scene%actuator) == 0 .and. scene%link(4)%name == "b.lower", "own names, not driven")
    end subroutine test_chain

    !> Frames of markers: right-handed, x as asked or carried along by the smallest rotation.
    subroutine test_markers(error)
        type(test_error), intent(inout) :: error
        type(scene_type) :: scene
        integer :: i

        call read_good(error, replaced(platform, "P1 = [1, 0, 0]", "P1 = { at = [1, 0, 0], axis = [0, 0, -5] }, " &
            //"P3 = { at = [0, 0, 0], axis = [1, 2, -2], x = [1, 1, 1] }, P4 = { at = [0, 0, 0], axis = [1, 0, 0] }, " &
            //"P5 = { at = [0, 0, 0], axis = [1e-9, 0, -1] }"), scene)
        if (allocated(error%message)) return
        associate (marker => scene%link(1)%marker)
            do i = 1, size(marker)
                call check_close(error, [norm2(marker(i)%axis), norm2(marker(i)%x_axis)], [1.0_wp, 1.0_wp], tolerance, "lengths")
                call check_close(error, dot_product(marker(i)%axis, marker(i)%x_axis), 0.0_wp, tolerance, "square")
            end do
            call check_close(error, marker(1)%axis, [0.0_wp, 0.0_wp, -1.0_wp], 0.0_wp, "P1 in the order of the file")
            call check_close(error, marker(1)%x_axis, [1.0_wp, 0.0_wp, 0.0_wp], tolerance, "x carried half a turn about x")
            call check_close(error, marker(3)%x_axis, [0.0_wp, 0.0_wp, -1.0_wp], tolerance, "x carried a quarter turn about y")
            call check_close(error, marker(2)%axis, [1.0_wp, 2.0_wp, -2.0_wp]/3, tolerance, "P3 axis")
        end associate
    end subroutine test_markers

    subroutine test_pose(error)
        type(test_error), intent(inout) :: error
        type(scene_type) :: scene

        call read_good(error, platform//legs//'[[coordinate]]'//lf//'link = "top"'//lf// &
            'start = { position = [1, 2, 3], angles = ["180 deg", 0, 0] }'//lf// &
            'motion = { x = { law = "harmonic", amplitude = "10 mm", frequency = "2 Hz" }, z = 7 }'//lf, scene)
        if (allocated(error%message)) return
        call check(error, size(scene%coordinate) == 6, "six coordinates")
        call check(error, scene%coordinate(1)%name == "top.x" .and. scene%coordinate(6)%name == "top.yaw", "names")
        call check(error, all(scene%coordinate%unit == ["m  ", "m  ", "m  ", "rad", "rad", "rad"]), "units")
        call check(error, scene%coordinate(1)%motion%kind == law_harmonic, "law of x")
        call check_close(error, scene%coordinate(1)%motion%value(2:3), [0.01_wp, 4*pi], 4*tolerance, "its values")
        call check(error, all(scene%coordinate(2:)%motion%kind == law_constant), "the others stay")
        call check_close(error, scene%coordinate(2)%motion%value(1), 2.0_wp, 0.0_wp, "where they start")
        call check_close(error, scene%coordinate(3)%motion%value(1), 7.0_wp, 0.0_wp, "or are put")
        call check_close(error, scene%coordinate(4)%motion%value(1), pi, tolerance, "in radians")
        call check_close(error, scene%time%last, 0.5_wp, tolerance, "a period")
        call read_good(error, planar_head//crank//'[[coordinate]]'//lf//'link = "crank"'//lf, scene)
        call check(error, size(scene%coordinate) == 3, "three coordinates in the plane")
        call check(error, scene%coordinate(3)%name == "crank.yaw" .and. scene%coordinate(3)%motion%kind == law_none, "no motion")
        call check(error, scene%time%n_sample == 0, "nothing to run along")
    end subroutine test_pose

    subroutine test_loads(error)
        type(test_error), intent(inout) :: error
        type(scene_type) :: scene

        call read_good(error, platform//'[[load]]'//lf//'on = "top.tool"'//lf//'axes = "link"'//lf// &
            'force = ["2 kN", 0, { law = "harmonic", amplitude = "1 N", frequency = 3 }]'//lf, scene)
        if (allocated(error%message)) return
        call check(error, scene%load(1)%axes == axes_link .and. scene%load(1)%link == 1, "load")
        call check_close(error, scene%load(1)%force(1)%value(1), 2000.0_wp, 0.0_wp, "Fx")
        call check(error, scene%load(1)%force(3)%kind == law_harmonic, "Fz")
        call check(error, all(scene%load(1)%moment%kind == law_constant), "no moment")
        call read_good(error, planar//'[[load]]'//lf//'on = "crank.B"'//lf//'moment = "3 N*m"'//lf, scene)
        call check_close(error, scene%load(1)%moment(3)%value(1), 3.0_wp, 0.0_wp, "planar moment")
    end subroutine test_loads

    subroutine test_drives(error)
        type(test_error), intent(inout) :: error
        type(scene_type) :: scene
        character(len=*), parameter :: driven = planar//'[[actuator]]'//lf//'joint = "A"'//lf

        call read_good(error, driven//'law = { type = "dc-motor", n = 10, eta = "80 %", K_T = "0.22 N*m/A", '// &
            'K_E = "0.22 V*s/rad", K_P = "100 V/rad", R_a = "3 ohm", target = "90 deg" }'//lf, scene)
        if (allocated(error%message)) return
        call check(error, scene%actuator(1)%law%kind == effort_dc_motor .and. scene%actuator(1)%unit == "N m", "motor")
        call check_close(error, scene%actuator(1)%law%value(:6), [10.0_wp, 0.8_wp, real(0.22d0, wp), real(0.22d0, wp), &
            100.0_wp, 3.0_wp], tolerance, "its constants")
        call check_close(error, scene%actuator(1)%law%target%value(1), pi/2, tolerance, "its target")
        call read_good(error, driven//'law = { type = "spring-damper", stiffness = "20 N*m/rad", rest = "180 deg" }'//lf, scene)
        call check(error, scene%actuator(1)%law%kind == effort_spring_damper, "spring")
        call check_close(error, scene%actuator(1)%law%value(:3), [20.0_wp, 0.0_wp, pi], tolerance, "its values")
        call read_good(error, driven//'law = { type = "pd", stiffness = 5, damping = 2, target = { law = "harmonic", '// &
            'amplitude = 1, frequency = 2 } }'//lf, scene)
        call check(error, scene%actuator(1)%law%kind == effort_pd, "pd")
        call check(error, scene%actuator(1)%law%target%kind == law_harmonic, "moving target")
    end subroutine test_drives

    subroutine test_springs(error)
        type(test_error), intent(inout) :: error
        type(scene_type) :: scene

        call read_good(error, planar//'[[spring]]'//lf//'name = "s"'//lf//'between = ["frame.O", "crank.B"]'//lf// &
            'stiffness = "2 kN/m"'//lf//'rest = "70 mm"'//lf//'[[spring]]'//lf//'name = "d"'//lf//'joint = "A"'//lf// &
            'damping = "3 N*m*s/rad"'//lf, scene)
        if (allocated(error%message)) return
        call check_close(error, [scene%spring(1)%stiffness, scene%spring(1)%rest], [2000.0_wp, 0.07_wp], tolerance, "values")
        call check(error, all(scene%spring(1)%link == [0, 1]) .and. scene%spring(1)%joint == 0, "between markers")
        call check(error, scene%spring(2)%joint == 1, "at a joint")
        call check_close(error, scene%spring(2)%damping, 3.0_wp, tolerance, "damping")
    end subroutine test_springs

    subroutine test_time(error)
        type(test_error), intent(inout) :: error
        type(scene_type) :: scene
        character(len=*), parameter :: hold = planar_head//crank//hinge//'[[coordinate]]'//lf//'joint = "A"'//lf//'motion = 1'//lf
        character(len=*), parameter :: spin = planar_head//crank//hinge//'[[coordinate]]'//lf//'joint = "A"'//lf// &
            'motion = { law = "constant-rate", rate = "120 rpm" }'//lf

        call read_good(error, planar//'[time]'//lf//'end = "500 ms"'//lf//'step = 0.1'//lf, scene)
        call check(error, scene%time%n_sample == 6, "both ends are samples")
        call read_good(error, planar//'[time]'//lf//'start = 1'//lf//'samples = 11'//lf, scene)
        call check_close(error, [scene%time%first, scene%time%last], [1.0_wp, 2.0_wp], 0.0_wp, "end from the law")
        call check(error, scene%time%n_sample == 11, "samples")
        call read_good(error, hold, scene)
        call check(error, scene%time%n_sample == 1, "nothing moves: one sample")
        call read_good(error, spin, scene)
        call check_close(error, scene%time%last, 0.5_wp, tolerance, "one turn")
        call check_close(error, scene%coordinate(1)%start_velocity, 4*pi, 4*tolerance, "starts in motion")
    end subroutine test_time

    !> Rods, plates and points are limits that exist; beyond them nothing does.
    subroutine test_inertia(error)
        type(test_error), intent(inout) :: error

        call accept("[1, 1, 1, 0, 0, 0]")
        call accept("[1, 1, 0, 0, 0, 0]")            ! a rod
        call accept("[0.1, 0.2, 0.3, 0, 0, 0]")      ! a plate; 0.1 + 0.2 rounds above 0.3
        call accept("[0, 0, 0, 0, 0, 0]")            ! a point
        call accept("[0.75, 0.75, 0.5, 0.25, 0.25, -0.25]")   ! a rod along (1, -1, 1), nearly
        call accept("[2, 2, 2, -1, -1, -1]")         ! a rod along (1, 1, 1): principal moments 0, 3, 3
        call refuse("[2, 2, 2, -1.001, -1, -1]", "positive definite")
        call refuse("[1, 1, 2.001, 0, 0, 0]", "triangle")
        call refuse("[2.001, 1, 1, 0, 0, 0]", "triangle")
        call refuse("[1.5, 1.5, 2, 1.2, 0, 0]", "triangle")   ! principal moments 0.3, 2.7, 2
        call accept("[1.5, 1.5, 2, 1.2, 0, 0]"//lf//"inertia_check = false")

    contains

        subroutine accept(tensor)
            character(len=*), intent(in) :: tensor
            type(scene_type) :: scene

            call read_good(error, replaced(platform, "{ diagonal = [1, 1, 1] }", tensor), scene)
        end subroutine accept

        subroutine refuse(tensor, fragment)
            character(len=*), intent(in) :: tensor, fragment

            call read_bad(error, replaced(platform, "{ diagonal = [1, 1, 1] }", tensor), fragment)
        end subroutine refuse
    end subroutine test_inertia

    subroutine test_actuators(error)
        type(test_error), intent(inout) :: error
        type(scene_type) :: scene
        type(status_type) :: status

        call read_good(error, planar//'[[actuator]]'//lf//'joint = "A"'//lf, scene)
        call check_actuators(scene, status)
        call check(error, status%is_ok(), "one for one "//status%message)
        call read_good(error, planar, scene)
        call check_actuators(scene, status)
        call check(error, index(status%message, "too few actuators: 0 actuators for 1 coordinate") > 0, status%message)
    end subroutine test_actuators

    !> A chain's links hold a dot in their names, and can be referred to.
    subroutine test_dotted_names(error)
        type(test_error), intent(inout) :: error
        type(scene_type) :: scene

        call read_good(error, platform//legs//'[[load]]'//lf//'on = "leg2.lower.U"'//lf//'force = [1, 0, 0]'//lf, scene)
        if (allocated(error%message)) return
        call check(error, scene%load(1)%link == 4 .and. scene%load(1)%marker == 1, "leg2.lower.U")
    end subroutine test_dotted_names

    subroutine test_refusals(error)
        type(test_error), intent(inout) :: error

        call read_bad(error, replaced(planar, "mass =", "mas ="), &
            "t.toml:5: link 'crank': unknown key 'mas'; did you mean 'mass'?")
        call read_bad(error, replaced(planar, 'mass = "1.5 kg"'//lf, ""), "t.toml:3: link 'crank': missing key 'mass'")
        call read_bad(error, replaced(planar, '"1.5 kg"', '"1.5 m"'), "t.toml:5: link 'crank': key 'mass' = '1.5 m' is a length")
        call read_bad(error, replaced(planar, "crank.A", "crank.Q"), "link 'crank' has no marker 'Q'")
        call read_bad(error, planar//crank, "there is another link of that name on line 3")
        call read_bad(error, planar//"[study]", "unknown key 'study'")
        call read_bad(error, planar//"title = [", "this is not TOML")
        call read_bad(error, "", "the scene is empty")
        call read_bad(error, replaced(planar, '"1.5 kg"', '"1'//'\n'//'5 kg"'), "'1"//new_line("a")//"5 kg'")
    end subroutine test_refusals

    subroutine test_files(error)
        type(test_error), intent(inout) :: error

        call expect("no-such-file.toml", "no-such-file.toml: there is no such file")
        call expect("tests", "tests: this is a directory")
        call expect(repeat("x", 2000), "longer than 1024 letters")
        call expect("", "there is no such file")

    contains

        subroutine expect(file, fragment)
            character(len=*), intent(in) :: file, fragment
            type(scene_type) :: scene
            type(status_type) :: status

            call read_scene(file, scene, status)
            call check(error, status%code == status_bad_input .and. index(status%message, fragment) > 0, &
                "got '"//trim(status%message)//"', want '"//fragment//"'")
        end subroutine expect
    end subroutine test_files

    subroutine read_good(error, text, scene)
        type(test_error), intent(inout) :: error
        character(len=*), intent(in) :: text
        type(scene_type), intent(out) :: scene
        type(status_type) :: status

        call parse_scene(text, "t.toml", "", scene, status)
        call check(error, status%is_ok(), status%message)
    end subroutine read_good

    subroutine read_bad(error, text, fragment)
        type(test_error), intent(inout) :: error
        character(len=*), intent(in) :: text
        character(len=*), intent(in) :: fragment       !! of the message
        type(scene_type) :: scene
        type(status_type) :: status

        call parse_scene(text, "t.toml", "", scene, status)
        call check(error, status%code == status_bad_input .and. index(status%message, fragment) > 0, &
            "got '"//trim(status%message)//"', want '"//fragment//"'")
    end subroutine read_bad

    !> The text with the first `old` replaced.
    function replaced(text, old, new) result(changed)
        character(len=*), intent(in) :: text, old, new
        character(len=:), allocatable :: changed
        integer :: i

        i = index(text, old)
        changed = text(:i - 1)//new//text(i + len(old):)
    end function replaced
end module test_scene_reader
