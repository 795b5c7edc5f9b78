!> Planar dyads and groups inside a mechanism: loops closed to rounding, velocities and columns against differences.
module test_planar_dyads
    use linkdyn_builder, only: build_model
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state, prepare_kinematics
    use linkdyn_lane_count, only: lanes
    use linkdyn_led_mechanism, only: evaluate_kinematics, measure_margins
    use linkdyn_model, only: model_type, orientation_of, step_rrr, step_rrp, step_rpr, step_prp, step_ppr, step_group
    use linkdyn_planar_scenes, only: dyad_scene, triad_scene
    use linkdyn_scene, only: scene_type, joint_prismatic
    use linkdyn_status, only: status_type
    use linkdyn_testing, only: test_error, unit_test, new_test, check, check_close
    use linkdyn_vec2, only: vec2, operator(+), operator(-), operator(.rotate.), operator(.cross.)
    implicit none (type, external)
    private
    public :: collect_planar_dyads

    real(wp), parameter :: closed = 32*epsilon(1.0_wp)     ! positions of order 1 through a few operations

contains

    subroutine collect_planar_dyads(tests)
        type(unit_test), allocatable, intent(out) :: tests(:)

        tests = [new_test("RRR", test_rrr), new_test("RRP", test_rrp), new_test("PRR", test_prr), &
                 new_test("RPR", test_rpr), new_test("PRP", test_prp), new_test("PPR", test_ppr), &
                 new_test("triad", test_triad), new_test("dead point", test_dead_point)]
    end subroutine collect_planar_dyads

    subroutine test_rrr(error)
        type(test_error), intent(inout) :: error
        call check_dyad(error, "RRR", step_rrr)
    end subroutine test_rrr

    subroutine test_rrp(error)
        type(test_error), intent(inout) :: error
        call check_dyad(error, "RRP", step_rrp)
    end subroutine test_rrp

    subroutine test_prr(error)
        type(test_error), intent(inout) :: error
        call check_dyad(error, "PRR", step_rrp)
    end subroutine test_prr

    subroutine test_rpr(error)
        type(test_error), intent(inout) :: error
        call check_dyad(error, "RPR", step_rpr)
    end subroutine test_rpr

    subroutine test_prp(error)
        type(test_error), intent(inout) :: error
        call check_dyad(error, "PRP", step_prp)
    end subroutine test_prp

    subroutine test_ppr(error)
        type(test_error), intent(inout) :: error
        call check_dyad(error, "PPR", step_ppr)
    end subroutine test_ppr

    subroutine test_triad(error)
        type(test_error), intent(inout) :: error
        type(scene_type) :: scene

        call triad_scene(scene)
        call check_scene(error, scene, step_group)
    end subroutine test_triad

    !> Both known links of the dyad move, so that no term of the bias vanishes; without and with slides inside that lead.
    subroutine check_dyad(error, signature, kind)
        type(test_error), intent(inout) :: error
        character(len=3), intent(in) :: signature
        integer, intent(in) :: kind
        type(scene_type) :: scene
        integer :: led

        do led = 0, 3
            call dyad_scene(signature, scene, led=led)
            call check_scene(error, scene, kind)
        end do
    end subroutine check_dyad

    subroutine check_scene(error, scene, kind)
        type(test_error), intent(inout) :: error
        type(scene_type), intent(in) :: scene
        integer, intent(in) :: kind
        type(model_type) :: model
        type(status_type) :: status
        type(kinematic_state) :: state

        call build_model(scene, model, status)
        call check(error, status%is_ok(), "planned: "//trim(status%message))
        if (.not. status%is_ok()) return
        call check(error, any(model%step%kind == kind), "closed by the step expected")
        call prepare_kinematics(model, model%n_q, state)
        call check_closure(error, model, state)
        call check_rates(error, model, state)
    end subroutine check_scene

    !> Lane l of a block about the start; `shift` moves coordinate k.
    subroutine set_state(model, state, k, shift)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(inout) :: state
        integer, intent(in) :: k
        real(wp), intent(in) :: shift
        integer :: lane, i

        do lane = 1, lanes
            do i = 1, model%n_q
                state%q(lane, i) = model%start_q(i) + 0.08_wp*(lane - lanes/2)/lanes*(-1)**i
                state%qd(lane, i) = 0.7_wp - 0.4_wp*i + 0.05_wp*lane
                state%qdd(lane, i) = -1.1_wp + 0.9_wp*i
            end do
        end do
        if (k > 0) state%q(:, k) = state%q(:, k) + shift
        call evaluate_kinematics(model, state)
    end subroutine set_state

    subroutine check_closure(error, model, state)
        type(test_error), intent(inout) :: error
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(inout) :: state
        type(vec2) :: point(2), direction(2)
        real(wp) :: gap(lanes)
        integer :: j, side

        call set_state(model, state, 0, 0.0_wp)
        call check(error, .not. any(state%unreachable .or. state%not_converged), "all samples close")
        do j = 1, model%n_joint
            associate (joint => model%joint(j))
                do side = 1, 2
                    associate (r => state%plane%rotation(orientation_of(model, joint%link(side))))
                        point(side) = state%plane%position(joint%link(side)) + (r.rotate.joint%point(:2, side))
                        direction(side) = r.rotate.joint%frame(:2, 3, side)
                    end associate
                end do
                point(1) = point(2) - point(1)
                if (joint%kind == joint_prismatic) then
                    gap = abs(direction(1).cross.point(1)) + abs(direction(1).cross.direction(2))
                else
                    gap = abs(point(1)%x) + abs(point(1)%y)
                end if
                call check(error, maxval(gap) <= closed, "joint "//trim(joint%name)//" is closed")
            end associate
        end do
    end subroutine check_closure

    !> Columns are derivatives of positions; velocity and acceleration follow from them along a path.
    subroutine check_rates(error, model, state)
        type(test_error), intent(inout) :: error
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(inout) :: state
        real(wp), parameter :: step = 2.0e-5_wp
        type(kinematic_state) :: beside(-2:2)
        type(vec2) :: column
        integer :: i, k, m

        beside = state
        call set_state(model, state, 0, 0.0_wp)
        do k = 1, model%n_q
            do m = -2, 2
                call set_state(model, beside(m), k, m*step)
            end do
            do i = 1, model%n_link
                column = state%plane%linear(k, i)
                call check_slope(column%x, position(i, 1), "x column")
                call check_slope(column%y, position(i, 2), "y column")
            end do
        end do
        do m = -2, 2
            call move_along(beside(m), m*step)
        end do
        do i = 1, model%n_link
            call check_slope(state%plane%linear(-1, i)%x, position(i, 1), "velocity")
            call check_slope(state%plane%linear(0, i)%y, [(beside(m)%plane%linear(-1, i)%y, m=-2, 2)], "acceleration")
            associate (o => model%link(i)%orientation)
                call check_slope(state%plane%angular(:, 0, o), [(beside(m)%plane%angular(:, -1, o), m=-2, 2)], &
                                 "angular acceleration")
            end associate
        end do
        ! of hinges that slide apart, how their line changes is left out of the rate
        if (model%n_dyad > 0 .and. all(model%step%kind /= step_rpr)) call check_margin()

    contains

        subroutine check_margin()
            real(wp) :: margin(lanes, 1), drift(lanes, 1), along(lanes, -2:2)

            do m = -2, 2
                call measure_margins(model, beside(m), margin, drift)
                along(:, m) = margin(:, 1)
            end do
            call measure_margins(model, state, margin, drift)
            call check_slope(drift(:, 1), along, "margin")
        end subroutine check_margin

        function position(link, axis)
            integer, intent(in) :: link, axis
            real(wp) :: position(lanes*5)

            if (axis == 1) position = [(beside(m)%plane%position(link)%x, m=-2, 2)]
            if (axis == 2) position = [(beside(m)%plane%position(link)%y, m=-2, 2)]
        end function position

        !> `rate` is the slope of the values at -2 ... 2 steps. Differences over one and over two steps tell how far the
        !> narrower one may be off: its truncation is a third of what they disagree by. The rest is rounding, a hundredfold
        !> where a loop is near a fold.
        subroutine check_slope(rate, values, what)
            real(wp), intent(in) :: rate(lanes), values(lanes, -2:2)
            character(len=*), intent(in) :: what
            real(wp) :: narrow(lanes), wide(lanes)

            narrow = (values(:, 1) - values(:, -1))/(2*step)
            wide = (values(:, 2) - values(:, -2))/(4*step)
            call check_close(error, rate, narrow, maxval(abs(wide - narrow)) + 100*epsilon(step)/step, what)
        end subroutine check_slope

        subroutine move_along(other, t)
            type(kinematic_state), intent(inout) :: other
            real(wp), intent(in) :: t

            other%q = state%q + t*state%qd + t**2/2*state%qdd
            other%qd = state%qd + t*state%qdd
            other%qdd = state%qdd
            call evaluate_kinematics(model, other)
        end subroutine move_along
    end subroutine check_rates

    !> Beyond full stretch a sample is unreachable, its neighbours are not; the error before it is that of the data.
    subroutine test_dead_point(error)
        type(test_error), intent(inout) :: error
        type(scene_type) :: scene
        type(model_type) :: model
        type(status_type) :: status
        type(kinematic_state) :: state
        real(wp) :: reach(lanes), want(lanes)
        integer :: i

        call dyad_scene("RRR", scene, on_rail=.true.)
        call build_model(scene, model, status)
        call check(error, status%is_ok(), trim(status%message))
        if (.not. status%is_ok()) return
        call prepare_kinematics(model, 0, state)
        ! The base slides away; the two links of length 0.5 and 0.6 are stretched at 1.1.
        reach = [(1.1_wp - 10.0_wp**(-i), i=1, lanes)]
        reach(lanes) = 1.2_wp
        state%q(:, 1) = reach
        state%qd = 0
        state%qdd = 0
        call evaluate_kinematics(model, state)
        call check(error, state%unreachable(lanes), "too far is unreachable")
        call check(error, .not. any(state%unreachable(:lanes - 1)), "neighbours are not")
        want = acos(min(1.0_wp, (0.25_wp + reach**2 - 0.36_wp)/(reach)))
        do i = 1, min(6, lanes - 1)
            associate (r => state%plane%rotation(model%link(2)%orientation))
                call check(error, abs(atan2(r%s(i), r%c(i)) - want(i)) <= 16*epsilon(1.0_wp)/want(i), "angle near the dead point")
            end associate
        end do
    end subroutine test_dead_point
end module test_planar_dyads
