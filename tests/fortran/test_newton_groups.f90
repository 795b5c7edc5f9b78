!> Newton's method against closed forms and open chains: the same mechanism, every link placed by iteration.
!>
!> The two share the joints' data only. Between them the scenes have all kinds of joints, free and given, on the frame
!> and on moving links, and links that share an orientation with what they slide on.
module test_newton_groups
    use linkdyn_assembly_trail, only: sample_assembly, assembly_trail, follow_assembly, reached_crossing
    use linkdyn_builder, only: build_model
    use linkdyn_closing_programs, only: closing_programs, make_closing_programs
    use linkdyn_representatives, only: representative_poses, need_poses
    use linkdyn_group_block, only: group_block, prepare_block, take_sample, close_block, find_drift, lead_links, explain_shifts, &
        part_of_margin
    use linkdyn_group_motion, only: group_closer
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state, prepare_kinematics, link_position, link_rotation
    use linkdyn_lane_count, only: lanes
    use linkdyn_led_mechanism, only: evaluate_kinematics
    use linkdyn_link_place, only: moved_place, spun_place, led_on_thread, rate_at, turned_axis, motion_between
    use linkdyn_margin_source, only: margin_source
    use linkdyn_model, only: model_type, group_type, is_length, is_rod_leg, step_group, step_rod, step_hung
    use linkdyn_planar_motion, only: planar_motion
    use linkdyn_planar_scenes, only: dyad_scene
    use linkdyn_quaternion, only: turned_by
    use linkdyn_recorded_forces, only: recorded_forces, record_forces, free_recorded
    use linkdyn_recorded_margins, only: recorded_margins, of_margins
    use linkdyn_scene, only: scene_type
    use linkdyn_scene_reader, only: read_scene
    use linkdyn_settled_samples, only: settle_samples
    use linkdyn_status, only: status_type, sample_ok
    use linkdyn_short_steps, only: short_part, are_short
    use linkdyn_stride, only: stride_type, make_stride, is_close, is_step_believed
    use linkdyn_test_numbers, only: random_stream, random_walk, eps
    use linkdyn_test_scenes, only: stewart_scene, stewart_on_carriage, open_chain_scene
    use linkdyn_testing, only: test_error, unit_test, new_test, check, check_close
    use linkdyn_vec2, only: lane_of_vec2 => lane_of
    use linkdyn_vec3, only: lane_of
    implicit none (type, external)
    private
    public :: collect_newton_groups

    !> Of the samples of long motions: arithmetic in quadruple precision takes a hundred times as long.
    integer, parameter :: share = merge(1, 5, digits(1.0_wp) <= 53)

contains

    subroutine collect_newton_groups(tests)
        type(unit_test), allocatable, intent(out) :: tests(:)

        tests = [ &
            new_test("UPS legs", test_stewart), &
            new_test("UPS legs on a carriage", test_carriage), &
            new_test("open chain", test_open_chain), &
            new_test("CSP group", test_csp), &
            new_test("crank or carriage and rod", test_rod_legs), &
            new_test("parallel rods", test_parallel_rods), &
            new_test("platforms on rods", test_hung_platforms), &
            new_test("dyads by a point", test_tip), &
            new_test("dyads", test_dyads), &
            new_test("slides parallel to a moving link", test_parallel_slides), &
            new_test("places of links", test_places), &
            new_test("spinning links", test_spins), &
            new_test("motions that are surely explained", test_explained), &
            new_test("recorded steps", test_recorded_steps), &
            new_test("recorded steps of screws", test_screws), &
            new_test("strides by recorded steps", test_strides), &
            new_test("short steps", test_short_steps)]
    end subroutine collect_newton_groups

    subroutine test_stewart(error)
        type(test_error), intent(inout) :: error
        type(scene_type) :: scene

        call stewart_scene(scene, .false.)
        call compare(error, scene)
    end subroutine test_stewart

    subroutine test_carriage(error)
        type(test_error), intent(inout) :: error
        type(scene_type) :: scene

        call stewart_on_carriage(scene)
        call compare(error, scene)
    end subroutine test_carriage

    subroutine test_open_chain(error)
        type(test_error), intent(inout) :: error
        type(scene_type) :: scene

        call open_chain_scene(scene, .false.)
        call compare(error, scene)
    end subroutine test_open_chain

    subroutine test_csp(error)
        type(test_error), intent(inout) :: error
        type(scene_type) :: scene
        type(status_type) :: status

        call read_scene("examples/rcsp_start/scene.toml", scene, status)
        call check(error, status%is_ok(), trim(status%message))
        if (status%is_ok()) call compare(error, scene)
    end subroutine test_csp

    !> Legs by name and link by link, in skew axes, either end of the rod in the universal joint, on the frame and on a link that
    !> moves.
    subroutine test_rod_legs(error)
        type(test_error), intent(inout) :: error
        type(scene_type) :: scene
        type(model_type) :: model
        type(status_type) :: status
        integer :: i

        call read_scene("tests/scenes/legs_with_rods.toml", scene, status)
        call check(error, status%is_ok(), trim(status%message))
        if (.not. status%is_ok()) return
        call build_model(scene, model, status)
        call check(error, count([(is_rod_leg(model%step(i)%kind), i=1, size(model%step))]) == 6, "six closed forms")
        call compare(error, scene)
    end subroutine test_rod_legs

    subroutine test_parallel_rods(error)
        type(test_error), intent(inout) :: error
        type(scene_type) :: scene
        type(model_type) :: model
        type(status_type) :: status

        call read_scene("tests/scenes/delta_by_tool.toml", scene, status)
        call check(error, status%is_ok(), trim(status%message))
        if (.not. status%is_ok()) return
        call build_model(scene, model, status)
        ! Numbers of a file are doubles: of more digits 0.9 - 0.1 is not 0.8, and no rods are equally long.
        if (precision(1.0_wp) > 20) return
        call check(error, count(model%step%kind == step_rod) == 3 .and. size(model%group) == 0, "three rods between known links")
        call compare(error, scene, by=0.1_wp)
    end subroutine test_parallel_rods

    !> Pairs of rods, and single ones between universal joints.
    subroutine test_hung_platforms(error)
        type(test_error), intent(inout) :: error
        character(len=40), parameter :: file(2) = [character(len=40) :: "examples/delta/scene.toml", &
                                                   "tests/scenes/delta_of_single_rods.toml"]
        type(scene_type) :: scene
        type(model_type) :: model
        type(status_type) :: status
        integer :: i

        do i = 1, size(file)
            call read_scene(trim(file(i)), scene, status)
            call check(error, status%is_ok(), trim(status%message))
            if (.not. status%is_ok()) return
            call build_model(scene, model, status)
            call check(error, count(model%step%kind == step_hung) == 1 .and. size(model%group) == 0, "a platform on rods")
            call compare(error, scene, by=0.1_wp)
            if (allocated(error%message)) return
        end do
    end subroutine test_hung_platforms

    !> Coordinates give a point of a link.
    subroutine test_tip(error)
        type(test_error), intent(inout) :: error
        type(scene_type) :: scene
        type(status_type) :: status

        call read_scene("tests/scenes/fivebar_by_tip.toml", scene, status)
        call check(error, status%is_ok(), trim(status%message))
        if (.not. status%is_ok()) return
        call compare(error, scene, by=0.05_wp)
    end subroutine test_tip

    subroutine test_dyads(error)
        type(test_error), intent(inout) :: error
        character(len=3), parameter :: signature(5) = ["RRR", "PRR", "RPR", "PRP", "PPR"]
        type(scene_type) :: scene
        integer :: i, led

        do led = 0, 3                              ! with slides inside that lead: in neither half, one, the other, both
            do i = 1, size(signature)
                call dyad_scene(signature(i), scene, led=led)
                call compare(error, scene, by=merge(0.2_wp, 0.05_wp, led == 0))
                if (allocated(error%message)) return
            end do
        end do
    end subroutine test_dyads

    !> A link whose axes are parallel to those of the link on which it slides has no orientation of its own.
    subroutine test_parallel_slides(error)
        type(test_error), intent(inout) :: error
        type(scene_type) :: scene
        integer :: first, second

        call dyad_scene("PRR", scene)
        associate (joint => scene%joint(3))
            first = joint%marker(1)
            second = joint%marker(2)
            scene%link(joint%link(2))%marker(second)%axis = scene%link(joint%link(1))%marker(first)%axis
            scene%link(joint%link(2))%marker(second)%x_axis = scene%link(joint%link(1))%marker(first)%x_axis
        end associate
        call compare(error, scene)
    end subroutine test_parallel_slides

    !> Positions, velocities, accelerations and columns of all links, at random states about the start.
    subroutine compare(error, scene, by)
        type(test_error), intent(inout) :: error
        type(scene_type), intent(in) :: scene
        real(wp), intent(in), optional :: by               !! so far at most, where not by 0.2 [m, rad]
        type(scene_type) :: started
        type(model_type) :: direct, iterated
        type(kinematic_state) :: known, found
        type(status_type) :: status
        type(random_stream) :: stream
        real(wp) :: scale, span
        integer :: i, l, k, o

        span = 0.2_wp
        if (present(by)) span = by
        call build_model(scene, direct, status)
        call check(error, status%is_ok(), trim(status%message))
        if (allocated(error%message)) return
        call prepare_kinematics(direct, direct%n_q, known)
        known%q = spread(direct%start_q, 1, lanes)
        call evaluate_kinematics(direct, known)
        call start_there(direct, known, scene, started)
        started%joint%branch = 0                       ! of closed forms only; the starts of the links say it
        call build_model(started, iterated, status, closed_forms=.false.)
        call check(error, status%is_ok(), trim(status%message))
        if (allocated(error%message)) return
        call check(error, count(iterated%step%kind == step_group) > 0, "by iteration")

        call prepare_kinematics(iterated, iterated%n_q, found)
        known%q = spread(direct%start_q, 1, lanes) + span*reshape(stream%vector(size(known%q)), shape(known%q))
        known%qd = reshape(stream%vector(size(known%q)), shape(known%q))
        known%qdd = reshape(stream%vector(size(known%q)), shape(known%q))
        found%q = known%q
        found%qd = known%qd
        found%qdd = known%qdd
        call evaluate_kinematics(direct, known)
        call evaluate_kinematics(iterated, found)
        call check(error, .not. any(known%unreachable .or. found%not_converged .or. found%singular), "closed")
        do i = 1, direct%n_link
            o = direct%link(i)%orientation
            do l = 1, lanes
                call same("position", link_position(direct, known, i, l), link_position(iterated, found, i, l))
                call same("rotation", reshape(link_rotation(direct, known, i, l), [9]), &
                          reshape(link_rotation(iterated, found, i, l), [9]))
                if (direct%is_planar) then
                    call same_in_plane(known%plane, found%plane)
                    cycle
                end if
                call same("angular velocity", lane_of(known%omega_body(o), l), lane_of(found%omega_body(o), l))
                do k = 0, direct%n_q
                    call same("acceleration", lane_of(known%acceleration_body(k, i), l), lane_of(found%acceleration_body(k, i), l))
                    call same("angular acceleration", lane_of(known%alpha_body(k, o), l), lane_of(found%alpha_body(k, o), l))
                end do
            end do
        end do
        do i = 1, direct%n_joint
            call same("slide "//trim(direct%joint(i)%name), known%slide(:, 1, i), found%slide(:, 1, i))
        end do

    contains

        subroutine same_in_plane(a, b)
            type(planar_motion), intent(in) :: a, b

            call same("angular rates and columns", a%angular(l, :, o), b%angular(l, :, o))
            do k = -1, direct%n_q
                call same("rates and columns", lane_of_vec2(a%linear(k, i), l), lane_of_vec2(b%linear(k, i), l))
            end do
        end subroutine same_in_plane

        !> Groups have condition numbers of some hundred, and rates of second order take them twice.
        subroutine same(what, expected, got)
            character(len=*), intent(in) :: what
            real(wp), intent(in) :: expected(:), got(:)

            scale = max(1.0_wp, maxval(abs(expected)))
            call check_close(error, got/scale, expected/scale, 1.0e4_wp*eps, what)
        end subroutine same
    end subroutine compare

    !> A place moved, and what has moved it, against rotations in lanes.
    subroutine test_places(error)
        type(test_error), intent(inout) :: error
        type(random_stream) :: stream
        real(wp) :: place(7), by(6), moved(7), turned(lanes, 4), angle
        integer :: k

        do k = 1, 8
            place = stream%vector(7)
            place(4:) = place(4:)/norm2(place(4:))
            by = stream%vector(6)
            by(4:) = by(4:)*10.0_wp**(-k)
            angle = norm2(by(4:))
            moved = moved_place(place, by)
            turned = turned_by(spread(place(4:), 1, lanes), spread(by(4:), 1, lanes))
            call check_close(error, moved(:3), place(:3) + by(:3), 4*eps, "shifted")
            call check_close(error, moved(4:), turned(1, :), angle**3/12 + 8*eps, "turned, but for its third power")
            call check_close(error, motion_between(place, [moved(:3), turned(1, :)]), by, 8*eps, "and back")
            call check_close(error, motion_between(place, [moved(:3), -turned(1, :)]), by, 8*eps, "with the opposite quaternion")
        end do
    end subroutine test_places

    !> Links that spin about an axis of their own by many turns, and turn a little besides, against two turns one after the other.
    subroutine test_spins(error)
        type(test_error), intent(inout) :: error
        type(random_stream) :: stream
        real(wp) :: place(7), axis(3), about(3), tilt(3), spin, moved(7)
        real(wp) :: turned(lanes, 4), nothing(6)
        integer :: k

        nothing = 0
        do k = 1, 8
            place = stream%vector(7)
            place(4:) = place(4:)/norm2(place(4:))
            axis = stream%vector(3)
            axis = axis/norm2(axis)
            about = turned_axis(place, axis)
            spin = 10*k*(-1)**k
            tilt = 1.0e-4_wp*stream%vector(3)
            tilt = tilt - dot_product(tilt, about)*about
            moved = spun_place(place, [0.1_wp, 0.2_wp, 0.3_wp, spin*about + tilt], axis, about)
            turned = turned_by(turned_by(spread(place(4:), 1, lanes), spread(spin*about, 1, lanes)), spread(tilt, 1, lanes))
            call check_close(error, moved(:3), place(:3) + [0.1_wp, 0.2_wp, 0.3_wp], 4*eps, "shifted")
            call check_close(error, motion_between(moved, [moved(:3), turned(1, :)]), nothing, 1.0e-12_wp, "turned")
            call check_close(error, norm2(turned_axis(moved, axis) - about), norm2(tilt), 1.0e-12_wp, "the axis by the tilt alone")
        end do
    end subroutine test_spins

    !> Steps of a loop with a screw: how far its nut has gone, with its turns; whether it is on its thread; and a stride of many
    !> turns, made by them alone.
    subroutine test_screws(error)
        type(test_error), intent(inout) :: error
        integer, parameter :: n = 240
        real(wp), parameter :: off(4) = [0.5_wp, 1.5_wp, 8*atan(1.0_wp) + 0.5_wp, -2.5_wp]    ! a nut, by so much [rad]
        type(model_type) :: model
        type(sample_assembly) :: found
        type(closing_programs), target :: closing
        class(group_closer), pointer :: closer
        class(margin_source), pointer :: margins
        type(stride_type) :: stride
        real(wp) :: q(1, 1), way(1, 1), branch(1, 0), margin(1), thread(1, 2)
        real(wp), allocatable :: place(:, :, :)
        logical :: is_sure(1)
        integer :: i, s, spindle

        call read_model(error, "screw_loop", model)
        if (allocated(error%message)) return
        q = 40
        way = 0.3_wp
        call settle_samples(model, 1, q, found)
        call make_closing_programs(model, q, found%place, found%margin, closing)
        call check(error, closing%is_usable, "there are programs")
        if (.not. closing%is_usable) return
        associate (group => model%group(1))
            spindle = findloc(group%link, model%joint(findloc(model%joint%name == "S", .true., dim=1))%link(2), dim=1)
            do i = 0, size(off)
                place = found%place
                associate (p => place(:, group%link(spindle), 1), axis => group%thread_axis(:, spindle))
                    if (i > 0) p = spun_place(p, [(0.0_wp, s=1, 3), off(i)*turned_axis(p, axis)], axis, turned_axis(p, axis))
                end associate
                call closing%make_steps(1, q, way, branch, reshape(place, [1, 7, model%n_link]), margin, is_sure, thread=thread)
                call check(error, is_sure(1) .eqv. (i == 0 .or. modulo(i, 2) == 1), "sure where a nut is near its thread")
                if (i == 0) call check_close(error, thread(1, :), [q, way], 1.0e-12_wp*q(1, 1), "the nut's turns, and their rate")
            end do
        end associate
        nullify (margins)
        closer => closing
        deallocate (place)
        allocate (place(7, model%n_link, 0:n), source=0.0_wp)
        place(:, :, 0) = start_of(model)
        call make_stride(model, model%start_q, reshape([(model%start_q + 0.5_wp*s, s=1, n)], [1, n]), model%branch, &
                         closer, margins, place, stride)
        call check(error, stride%n_believed == n, "a stride of twenty turns needs no lanes")
        call check_close(error, stride%groups%thread(1, n), model%start_q(1) + 0.5_wp*n, 1.0e-9_wp, "all of them")
        call closing%free()

    contains

        pure function start_of(model) result(place)
            type(model_type), intent(in) :: model
            real(wp) :: place(7, model%n_link)
            integer :: g

            place = 0
            do g = 1, size(model%group)
                place(:, model%group(g)%link) = model%group(g)%start
            end do
        end function start_of
    end subroutine test_screws

    !> Motions that a block of samples takes for explained, without an arctangent, are explained as angles are measured; and nothing
    !> but what lies near the bound, or turns far, is left to be measured.
    subroutine test_explained(error)
        type(test_error), intent(inout) :: error
        character(len=*), parameter :: name(2) = [character(len=15) :: "hexaglide", "planar_platform"]
        integer, parameter :: n = 16, n_draw = 200
        type(model_type) :: model
        type(group_block) :: block
        type(random_stream) :: stream
        real(wp) :: margin(n, 1), turn, open, by(6)
        real(wp), allocatable :: unit(:)
        logical :: is_explained(n)
        integer :: i, draw, k, l, s, m

        do i = 1, size(name)
            call read_model(error, trim(name(i)), model)
            if (allocated(error%message)) return
            block = group_block()
            call prepare_block(model, n, block)
            m = size(block%shift, 2)
            unit = [(merge(model%group(1)%size, 1.0_wp, k <= m/2 + modulo(m, 2)), k=1, m)]
            block%from = 0
            block%place = 0
            block%shift = 0
            do draw = 1, n_draw
                margin = 0.05_wp + 0.3_wp*abs(reshape(stream%vector(n), [n, 1]))
                block%margin = margin
                ! turns up to three radians, and what is left open up to twice the bound
                turn = 3*real(draw, wp)/n_draw
                open = 2*modulo(7*draw, n_draw)/real(n_draw, wp)
                do s = 1, n
                    do k = 1, size(model%group(1)%link)
                        l = model%group(1)%link(k)
                        block%from(s, :, l) = stream%vector(size(block%from, 2))
                        by = stream%vector(6)
                        by(4:) = turn*by(4:)/norm2(by(4:))
                        block%place(s, :3, l) = block%from(s, :3, l) + by(:3)
                        if (m == 6) call turn_link(by(4:), block%from(s, 4:, l), block%place(s, 4:, l))
                        block%shift(s, :, l) = 2*motion_between(block%from(s, :, l), block%place(s, :, l)) &
                                               + 2*open*part_of_margin*margin(s, 1)*unit*stream%vector(m)
                    end do
                end do
                block%rate = 0
                call explain_shifts(model, margin, block, is_explained)
                do s = 1, n
                    associate (is_measured => is_close(model, block%from(s, :, :), block%place(s, :, :), &
                                                       block%shift(s, :, :), block%rate(s, :, :), margin(s, :)))
                        call check(error, is_measured .or. .not. is_explained(s), trim(name(i))//": explained by angles, too")
                        if (turn < 0.2_wp .and. open < 0.9_wp) &
                            call check(error, is_explained(s), trim(name(i))//": what is explained is seen to be")
                    end associate
                end do
            end do
        end do

    contains

        !> A quaternion turned about x, y, z of the world, of either sign.
        pure subroutine turn_link(by, from, to)
            real(wp), intent(in) :: by(3), from(4)
            real(wp), intent(out) :: to(4)
            real(wp) :: w, v(3)

            w = cos(norm2(by)/2)
            v = sin(norm2(by)/2)*by/norm2(by)
            to(1) = w*from(1) - dot_product(v, from(2:))
            to(2:) = w*from(2:) + from(1)*v + [v(2)*from(4) - v(3)*from(3), v(3)*from(2) - v(1)*from(4), &
                                               v(1)*from(3) - v(2)*from(2)]
            if (from(1) > 0) to = -to
        end subroutine turn_link
    end subroutine test_explained

    !> Newton's step by a record: velocities are differences of places that the lanes have found, and links that were shifted a
    !> little are brought back.
    subroutine test_recorded_steps(error)
        type(test_error), intent(inout) :: error
        character(len=*), parameter :: name(3) = [character(len=18) :: "hexaglide", "rsur", "screw_loop"]
        real(wp), parameter :: h = 1.0e-5_wp           ! differences: errors of h^2 over cubed margins
        type(model_type) :: model
        type(sample_assembly) :: found
        type(closing_programs) :: closing
        type(random_stream) :: stream
        real(wp), allocatable :: q(:, :), way(:), correction(:, :), rate(:, :), place(:, :, :), corrected(:, :), extent(:, :)
        real(wp) :: margin(1), shift(3)
        logical :: is_sure(1)
        integer :: i, k, l, first

        do i = 1, size(name)
            call read_model(error, trim(name(i)), model)
            if (allocated(error%message)) return
            way = stream%vector(model%n_q)
            q = reshape([model%start_q, model%start_q - h*way, model%start_q + h*way], [model%n_q, 3])
            call settle_samples(model, 1, q, found)
            call make_closing_programs(model, q, found%place, found%margin, closing)
            call check(error, closing%is_usable, trim(name(i))//": margins are those of the lanes")
            if (.not. closing%is_usable) return
            associate (group => model%group(1))
                allocate (correction(1, size(group%unit)), rate(1, size(group%unit)))
                allocate (corrected(1, 7*size(group%link)), extent(1, 4))
                place = found%place(:, :, :1)
                shift = 1.0e-6_wp*stream%vector(3)
                place(:3, group%link(2), 1) = place(:3, group%link(2), 1) + shift
                call closing%make_steps(1, transpose(q(:, :1)), reshape(way, [1, model%n_q]), &
                                        reshape(model%branch, [1, model%n_branch]), reshape(place, [1, 7, model%n_link]), margin, &
                                        is_sure, correction, rate, corrected=corrected, extent=extent)
                call check(error, is_sure(1), trim(name(i))//": no alarm")
                call check_corrected(trim(name(i)), model, group, place(:, :, 1), correction(1, :), corrected(1, :), extent(1, :3))
                call check_close(error, extent(1, 4), max(fastest_of(reshape(rate(1, :), [6, size(group%link)])), &
                                                          fastest_led(model, group, way)), 1.0e-12_wp*extent(1, 4), &
                                 trim(name(i))//": how fast its links move, and those that they are joined to")
                do k = 1, size(group%link)
                    l = group%link(k)
                    first = 6*(k - 1)
                    call check_close(error, rate(1, first + 1:first + 3), (found%place(:3, l, 3) - found%place(:3, l, 2))/(2*h), &
                                     1.0e-4_wp*max(1.0_wp, maxval(abs(rate))), trim(name(i))//": velocities")
                    call check_close(error, correction(1, first + 1:first + 3), merge(shift, 0*shift, k == 2), 1.0e-9_wp, &
                                     trim(name(i))//": shifts taken back")
                end do
                deallocate (correction, rate, corrected, extent)
            end associate
            call closing%free()
        end do

    contains

        pure real(wp) function fastest_of(rate)
            real(wp), intent(in) :: rate(:, :)         !! (6, link)

            fastest_of = max(maxval(norm2(rate(:3, :), 1))/model%group(1)%size, maxval(norm2(rate(4:, :), 1)))
        end function fastest_of

        !> Of links on the frame that coordinates lead; their hinges are their origins.
        pure real(wp) function fastest_led(model, group, way) result(fastest)
            type(model_type), intent(in) :: model
            type(group_type), intent(in) :: group
            real(wp), intent(in) :: way(:)
            integer :: k

            fastest = 0
            do k = 1, model%n_q
                if (any(group%link == model%joint(model%scene%coordinate(k)%joint)%link(2))) cycle
                fastest = max(fastest, abs(way(k))/merge(group%size, 1.0_wp, is_length(model, k)))
            end do
        end function fastest_led

        !> Where the record says that a correction leads, and how large it is: against the places' own arithmetic.
        subroutine check_corrected(what, model, group, place, correction, corrected, extent)
            character(len=*), intent(in) :: what
            type(model_type), intent(in) :: model
            type(group_type), intent(in) :: group
            real(wp), intent(in) :: place(:, :), correction(:), corrected(:), extent(:)
            real(wp) :: by(6), there(7), about(3), bounded(6), largest, largest_bounded
            integer :: k

            largest = 0
            largest_bounded = 0
            do k = 1, size(group%link)
                associate (unit => group%unit(6*k - 5:6*k), stand => place(:, group%link(k)), axis => group%thread_axis(:, k), &
                           point => group%thread_point(:, k))
                    by = -correction(6*k - 5:6*k)
                    bounded = by
                    about = 0
                    if (any(abs(axis) > 0)) then
                        about = turned_axis(stand, axis)
                        there = led_on_thread(stand, by, axis, point)
                        by = rate_at(stand, by, point)
                        bounded = by
                    else
                        there = moved_place(stand, by)
                    end if
                    bounded(4:) = by(4:) - dot_product(by(4:), about)*about
                    call check_close(error, corrected(7*k - 6:7*k), there, 20*eps, what//": where a correction leads")
                    largest = max(largest, maxval(abs(by)/unit))
                    largest_bounded = max(largest_bounded, maxval(abs(bounded)/unit))
                end associate
            end do
            call check_close(error, extent, [largest, largest_bounded, max(group%size, &
                             maxval(abs(place(:3, group%link))))], 20*eps*maxval(extent), what//": how large it is")
        end subroutine check_corrected
    end subroutine test_recorded_steps

    !> Motions followed by strides of recorded steps and by lanes: the same assemblies, and the same words where one is lost.
    subroutine test_strides(error)
        type(test_error), intent(inout) :: error
        character(len=*), parameter :: name(7) = [character(len=18) :: "rsur", "rusr_parallelogram", "planar_platform", &
                                                  "excavator", "boom_by_stroke", "screw_loop", "hexaglide"]
        integer, parameter :: n = 240/share, first = 20 ! not whole numbers of strides
        type(model_type) :: model
        type(representative_poses) :: poses
        type(sample_assembly) :: by_lanes, by_strides
        type(recorded_forces), target :: recorded
        type(closing_programs), target :: closing
        integer :: i, s, n_reached, n_lost, n_crossed, n_short

        n_short = 0
        n_reached = 0
        n_crossed = 0
        n_lost = 0
        do i = 1, size(name)
            call read_model(error, trim(name(i)), model)
            if (allocated(error%message)) return
            call close_at_representatives(model, poses, closing)
            if (model%n_branch > 0) call record_forces(model, of_margins, poses%q, poses%stand, recorded, poses%assembly%place)
            if (closing%is_usable) then
                call follow_both(random_walk(model%start_q, n, 0.0005_wp))
                call follow_both(random_walk(model%start_q, n, 0.03_wp))
                call follow_both(to_and_fro(model%start_q, 10*n))
                ! More than a turn of a crank leads through change points.
                if (model%n_q == 1) call follow_both(reshape([(model%start_q + 0.03_wp*s, s=0, n - 1)], [1, n]))
                if (name(i) == "screw_loop") call follow_both(reshape([(model%start_q + 0.5_wp*s, s=0, n - 1)], [1, n]))
            end if
            call closing%free()
            if (model%n_branch > 0) call free_recorded(recorded)
        end do
        call check(error, n_reached > 5*n, "most of the walks are followed")
        call check(error, n_crossed > 0, "some through change points")
        call check(error, n_lost > n/2, "and some lead beyond where the mechanism closes")
        call check(error, n_short > 5*n, "many steps are so short that nobody asks for rates")

    contains

        subroutine follow_both(q)
            real(wp), intent(in) :: q(:, :)            !! (n_q, sample)
            type(assembly_trail) :: trail(2)
            type(recorded_margins), target :: by_record
            class(margin_source), pointer :: margins
            class(group_closer), pointer :: closer

            nullify (margins)
            by_record%record => recorded
            if (model%n_branch > 0) margins => by_record
            closer => closing
            call follow_assembly(model, q, trail(1), by_lanes)
            call follow_assembly(model, q(:, :first), trail(2), by_strides, margins, closer)
            call same(1, first)
            ! A trail goes on with the next samples.
            call follow_assembly(model, q(:, first + 1:), trail(2), by_strides, margins, closer)
            call same(first + 1, size(q, 2))
            if (allocated(trail(2)%stride%groups%is_short)) n_short = n_short + count(trail(2)%stride%groups%is_short)
            ! Each sample on its own.
            call settle_samples(model, 1, q, by_lanes)
            call settle_samples(model, 2, q, by_strides, closer)
            call same(1, size(q, 2))
        end subroutine follow_both

        !> By the lanes a sample is reached if by strides it is, and so on; places differ by rounding.
        subroutine same(from, to)
            integer, intent(in) :: from, to
            real(wp) :: apart
            integer :: g, k

            call check(error, all(by_strides%status == by_lanes%status(from:to)), trim(name(i))//": outcomes")
            call check(error, all(by_strides%reached == by_lanes%reached(from:to)), trim(name(i))//": how reached")
            call check(error, all(by_strides%branch == by_lanes%branch(:, from:to)), trim(name(i))//": branches")
            n_crossed = n_crossed + count(by_strides%reached == reached_crossing)
            do s = 1, to - from + 1
                if (by_strides%status(s) /= sample_ok) n_lost = n_lost + 1
                if (by_strides%status(s) /= sample_ok) cycle
                n_reached = n_reached + 1
                do g = 1, size(model%group)
                    apart = 0
                    do k = 1, size(model%group(g)%link)
                        associate (l => model%group(g)%link(k))
                            apart = max(apart, maxval(abs(motion_between(by_lanes%place(:, l, from + s - 1), &
                                                                         by_strides%place(:, l, s)))))
                        end associate
                    end do
                    call check(error, apart*minval(abs(by_strides%margin(:, s))) <= 1000*eps, trim(name(i))//": places")
                end do
            end do
        end subroutine same
    end subroutine test_strides

    !> A step that is short by its speed and by how far it leads is one that margins, their rates, and rates of places believe, too,
    !> as near to singular positions as may be. Much longer ones are not always.
    subroutine test_short_steps(error)
        type(test_error), intent(inout) :: error
        character(len=*), parameter :: name(6) = [character(len=18) :: "rsur", "rusr_parallelogram", "planar_platform", &
                                                  "excavator", "rssr", "hexaglide"]
        integer, parameter :: n = 400/share
        real(wp), parameter :: too_long = 32           !! of the length allowed
        type(model_type) :: model
        type(representative_poses) :: poses
        type(closing_programs) :: closing
        type(assembly_trail) :: trail, fresh
        type(sample_assembly) :: found
        type(random_stream) :: stream
        real(wp), allocatable :: q(:, :)
        integer :: i, s, n_short(2), n_believed(2)     ! of the lengths allowed and of those that are not

        n_short = 0
        n_believed = 0
        do i = 1, size(name)
            call read_model(error, trim(name(i)), model)
            if (allocated(error%message)) return
            call close_at_representatives(model, poses, closing)
            call check(error, closing%is_usable .and. short_part(model) > 0, trim(name(i))//": steps may be short")
            if (.not. closing%is_usable) return
            trail = fresh
            q = to_and_fro(model%start_q, n)
            call follow_assembly(model, q, trail, found)
            do s = 1, n
                if (found%status(s) /= sample_ok) cycle
                call try_step(1.0_wp, n_short(1), n_believed(1))
                call try_step(too_long, n_short(2), n_believed(2))
            end do
            call closing%free()
        end do
        call check(error, n_short(1) > n, "there are short steps")
        call check(error, n_believed(1) == n_short(1), "all of them are believed")
        call check(error, n_believed(2) < n_short(2), "longer ones are not")

    contains

        subroutine try_step(times, n_short, n_believed)
            real(wp), intent(in) :: times              !! the length of short steps
            integer, intent(inout) :: n_short, n_believed
            type(group_block) :: here, there
            real(wp) :: way(model%n_q), part
            logical :: is_believed

            part = times*short_part(model)
            way = stream%vector(model%n_q)
            call prepare_block(model, 1, here)
            call take_sample(model, found%place(:, :, s), 1, here)
            call stand(here, q(:, s), way)
            if (.not. (here%is_closed(1) .and. all(here%speed > 0))) return
            way = 0.8_wp*way*minval(part*abs(here%margin)/here%speed)
            call stand(here, q(:, s), way)
            there = here
            there%from = here%place
            there%shift = here%rate
            call lead_links(model, there)
            call stand(there, q(:, s) + way, way)
            if (.not. there%is_closed(1)) return
            if (.not. are_short(model, part, here%place(1, :, :), here%margin(1, :), there)) return
            n_short = n_short + 1
            is_believed = all(is_step_believed(model%least_margin(model%n_branch + 1:), here%margin(1, :), here%drift(1, :), &
                                               there%margin(1, :), there%drift(1, :)))
            if (is_believed) is_believed = is_close(model, here%place(1, :, :), there%place(1, :, :), &
                                                    here%rate(1, :, :), there%rate(1, :, :), &
                                                    min(abs(here%margin(1, :)), abs(there%margin(1, :))))
            if (is_believed) n_believed = n_believed + 1
        end subroutine try_step

        subroutine stand(block, q, way)
            type(group_block), intent(inout) :: block
            real(wp), intent(in) :: q(:), way(:)

            block%at(1, :) = q
            block%way(1, :) = way
            block%branch(1, :) = model%branch
            block%is_closed = .true.
            call close_block(model, closing, block)
            if (block%is_closed(1)) call find_drift(model, closing, block)
        end subroutine stand
    end subroutine test_short_steps

    !> Smoothly, to beyond where many a mechanism closes.
    pure function to_and_fro(start, n) result(q)
        real(wp), intent(in) :: start(:)
        integer, intent(in) :: n
        real(wp) :: q(size(start), n)
        real(wp), parameter :: farthest = 1.5_wp
        integer :: k, s

        do s = 1, n
            q(:, s) = start + [(sin(k + 4.0_wp)*farthest*(1 - cos(8*atan(1.0_wp)*(s - 1)/n))/2, k=1, size(start))]
        end do
    end function to_and_fro

    !> A model of one of the scenes of the tests.
    !> What would close by formulas with its cylinders inside is closed by iteration here.
    subroutine read_model(error, name, model)
        type(test_error), intent(inout) :: error
        character(len=*), intent(in) :: name
        type(model_type), intent(out) :: model
        !> These are closed by formulas, and here by iteration.
        character(len=*), parameter :: loop(4) = [character(len=18) :: "excavator", "boom_by_stroke", "rssr", &
                                                                 "rusr_parallelogram"]
        type(scene_type) :: scene
        type(status_type) :: status

        call read_scene("tests/scenes/"//name//".toml", scene, status)
        if (status%is_ok()) call build_model(scene, model, status, closed_forms=.not. any(name == loop))
        call check(error, status%is_ok(), trim(status%message))
    end subroutine read_model

    !> Programs of Newton's steps, at representative poses.
    subroutine close_at_representatives(model, poses, closing)
        type(model_type), intent(in) :: model
        type(representative_poses), intent(out) :: poses
        type(closing_programs), intent(inout) :: closing

        call need_poses(model, spread(model%start_q, 2, 1), poses)
        associate (n => size(poses%q, 2), there => poses%assembly)
            call make_closing_programs(model, poses%q, there%place(:, :, :n), there%margin(:, :n), closing)
        end associate
    end subroutine close_at_representatives

    !> The scene with its links' starting positions where a state has them.
    subroutine start_there(model, state, scene, started)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        type(scene_type), intent(in) :: scene
        type(scene_type), intent(out) :: started
        real(wp) :: r(3, 3)
        integer :: i

        started = scene
        do i = 1, model%n_link
            r = link_rotation(model, state, i, 1)
            started%link(i)%has_start = .true.
            started%link(i)%start(:3) = link_position(model, state, i, 1)
            started%link(i)%start(4:) = [atan2(-r(2, 3), r(3, 3)), atan2(r(1, 3), norm2(r(1, :2))), atan2(-r(1, 2), r(1, 1))]
        end do
    end subroutine start_there
end module test_newton_groups
