!> Pressures at the start of a run: those that the scene gives, or those that hold the mechanism where it is.
submodule (linkdyn_forward_system) linkdyn_forward_cylinders
    use linkdyn_cylinder_laws, only: holding_pressures, is_within_stroke, is_pressed
    use linkdyn_cylinder_states, only: put_pressures
    use linkdyn_gauss_jordan, only: solve_gauss_jordan
    use linkdyn_joint_rates, only: actuator_rates, measure_variable
    use linkdyn_scene, only: n_chamber
    use linkdyn_status, only: fail, status_bad_input
    use linkdyn_text, only: quoted, to_text
    implicit none (type, external)

    character(len=*), parameter :: expected_start = " (expected 'pressures' of the cylinder at the start)"

contains

    module procedure fill_cylinders
        integer :: i
        logical :: has_all

        if (all(self%layout%pressure == 0)) return
        call refuse_beyond_ends(self, t, y, status)
        if (.not. status%is_ok()) return
        if (present(given)) then
            do i = 1, self%model%n_actuator
                if (self%layout%pressure(i) == 0) cycle
                call put(self, i, spread(given(:, i), 1, lanes), y)
                if (.not. is_pressed(given(:, i))) call fail(status, status_bad_input, "pressure: one of actuator " &
                    //quoted(self%model%scene%actuator(i)%name)//" is below absolute vacuum "// &
                    "(expected gauge pressures, above the atmosphere's)")
            end do
        else
            has_all = .true.
            do i = 1, self%model%n_actuator
                associate (cylinder => self%model%scene%actuator(i)%cylinder)
                    if (self%layout%pressure(i) == 0) cycle
                    has_all = has_all .and. cylinder%has_start
                    if (cylinder%has_start) call put(self, i, spread(cylinder%start, 1, lanes), y)
                end associate
            end do
            if (.not. has_all) call hold_start(self, t, y, status)
        end if
    end procedure fill_cylinders

    !> Give cylinder i these pressures.
    subroutine put(self, i, pressure, y)
        class(forward_system), intent(in) :: self
        integer, intent(in) :: i
        real(wp), intent(in) :: pressure(:, :)         !! (lane, chamber) [Pa]
        real(wp), intent(inout) :: y(:, :)
        integer :: lane

        do lane = 1, lanes
            call put_pressures(self%model%scene%actuator(i)%cylinder, self%layout%pressure(i), pressure(lane, :), y(lane, :))
        end do
    end subroutine put

    !> Cylinders whose pressures nobody gives hold their slides: at rest nothing makes these move. Other drives do as their laws
    !> say.
    subroutine hold_start(self, t, y, status)
        class(forward_system), intent(in) :: self
        real(wp), intent(in) :: t                      !! [s]
        real(wp), intent(inout) :: y(:, :)
        type(status_type), intent(inout) :: status
        type(forward_system) :: probe
        integer, allocatable :: at(:)
        real(wp), allocatable :: force(:, :)
        real(wp) :: still(lanes, self%n)
        logical :: is_held(lanes)
        integer :: i, k

        at = pack([(i, i=1, self%model%n_actuator)], self%layout%pressure > 0 .and. &
                  .not. self%model%scene%actuator%cylinder%has_start)
        if (allocated(self%way%given_force)) probe%way%given_force = self%way%given_force
        call build_forward_system(self%model, 0, probe, status)
        if (status%is_ok()) then
            probe%may_be_torn = .true.                 ! by forces that are tried
            still = y
            do k = 1, self%model%n_q
                if (self%layout%rate(k) > 0) still(:, self%layout%rate(k)) = 0
            end do
            call probe%begin(t, still)
            allocate (force(lanes, size(at)))
            call find_holding(probe, t, at, still, force, is_held)
            do i = 1, size(at)
                call take_pressures(self, at(i), force(:, i), is_held, y, status)
            end do
        end if
        call probe%release()
    end subroutine hold_start

    !> Forces of cylinders by which the accelerations of their slides vanish, which are linear in them. Cylinders side by side
    !> share: of the forces that do it these are the smallest ones.
    !>
    !> The response R is symmetric and has no negative eigenvalue: x = x + (R + d)^-1 (b - R x) leaves what R does not see at zero,
    !> and of the error in the rest the part d/eigenvalue each time.
    subroutine find_holding(probe, t, at, still, force, is_held)
        type(forward_system), intent(inout) :: probe
        real(wp), intent(in) :: t                      !! [s]
        integer, intent(in) :: at(:)                   !! their actuators
        real(wp), intent(inout) :: still(:, :)         !! the start at rest
        real(wp), intent(out) :: force(:, :)           !! up along the joint variables (lane, at) [N]
        logical, intent(out) :: is_held(lanes)
        real(wp), dimension(lanes, size(at)) :: free, pushed
        real(wp), parameter :: small = 1.0e-7_wp       !! d over the trace of R
        integer, parameter :: n_round = 4
        real(wp), dimension(lanes, size(at), size(at)) :: response, damped
        real(wp) :: rest(lanes, size(at), 1), trace(lanes), growth(lanes), unit
        logical :: is_singular(lanes)
        integer :: i, round

        force = 0
        is_held = .true.
        call push(free)
        do i = 1, size(at)
            associate (cylinder => probe%model%scene%actuator(at(i))%cylinder)
                unit = cylinder%supply*sum(cylinder%area)
            end associate
            force(:, i) = unit
            call push(pushed)
            force(:, i) = 0
            response(:, :, i) = (pushed - free)/unit
        end do
        trace = 0
        do i = 1, size(at)
            trace = trace + response(:, i, i)
        end do
        do round = 1, n_round
            rest(:, :, 1) = -free
            damped = response
            do i = 1, size(at)
                rest(:, :, 1) = rest(:, :, 1) - response(:, :, i)*spread(force(:, i), 2, size(at))
                damped(:, i, i) = damped(:, i, i) + small*trace
            end do
            call solve_gauss_jordan(size(at), 1, damped, rest, growth, is_singular)
            is_held = is_held .and. .not. is_singular
            force = force + rest(:, :, 1)
        end do

    contains

        !> Accelerations of the slides under these forces.
        subroutine push(acceleration)
            real(wp), intent(out) :: acceleration(lanes, size(at))
            real(wp), dimension(lanes, probe%model%n_actuator) :: before, after
            real(wp) :: moving(lanes, probe%n), rate(lanes, probe%n)
            logical :: failed(lanes)
            integer :: k, lane

            do k = 1, size(at)
                associate (cylinder => probe%model%scene%actuator(at(k))%cylinder)
                    do lane = 1, lanes
                        call put_pressures(cylinder, probe%layout%pressure(at(k)), holding_pressures(cylinder, force(lane, k)), &
                                           still(lane, :))
                    end do
                end associate
            end do
            call probe%evaluate_on_lanes(spread(t, 1, lanes), still, rate, failed)
            is_held = is_held .and. .not. failed
            call actuator_rates(probe%model, probe%workspace%state, before)
            ! what a motion would be whose rates these accelerations are
            moving = still
            do k = 1, probe%model%n_q
                if (probe%layout%rate(k) > 0) moving(:, probe%layout%rate(k)) = probe%workspace%acceleration(:, k)
            end do
            call probe%evaluate_on_lanes(spread(t, 1, lanes), moving, rate, failed)
            call actuator_rates(probe%model, probe%workspace%state, after)
            acceleration = after(:, at) - before(:, at)
        end subroutine push
    end subroutine find_holding

    !> Pressures of cylinder i by which it holds.
    subroutine take_pressures(self, i, force, is_held, y, status)
        class(forward_system), intent(in) :: self
        integer, intent(in) :: i                       !! its actuator
        real(wp), intent(in) :: force(lanes)           !! [N]
        logical, intent(in) :: is_held(lanes)          !! else no force does it
        real(wp), intent(inout) :: y(:, :)
        type(status_type), intent(inout) :: status
        real(wp) :: pressure(lanes, n_chamber)
        integer :: lane

        associate (actuator => self%model%scene%actuator(i))
            do lane = 1, lanes
                pressure(lane, :) = holding_pressures(actuator%cylinder, force(lane))
                if (.not. (is_held(lane) .and. abs(force(lane)) <= huge(1.0_wp))) then
                    call fail(status, status_bad_input, "actuator "//quoted(actuator%name)//", cylinder: no force holds the start" &
                              //expected_start)
                else if (any(pressure(lane, :) < actuator%cylinder%tank .or. pressure(lane, :) > actuator%cylinder%supply)) then
                    call fail(status, status_bad_input, "actuator "//quoted(actuator%name)//", cylinder: to hold the start takes " &
                              //to_text(force(lane))//" N, which pressures between tank and supply do not give"//expected_start)
                end if
            end do
            call put(self, i, pressure, y)
        end associate
    end subroutine take_pressures

    !> A start beyond the ends of a stroke is none.
    subroutine refuse_beyond_ends(self, t, y, status)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t                      !! [s]
        real(wp), intent(in) :: y(:, :)
        type(status_type), intent(inout) :: status
        real(wp), dimension(lanes) :: place, speed
        integer :: i, lane

        call begin_assembly(self%model, t, self%way%assembly)
        call prepare_kinematics(self%model, 0, self%look)
        call self%look_closely(spread(t, 1, lanes), y)
        do i = 1, self%model%n_actuator
            if (self%layout%pressure(i) == 0) cycle
            associate (actuator => self%model%scene%actuator(i))
                call measure_variable(self%model, self%look, actuator%joint, actuator%variable, spread(0.0_wp, 1, lanes), &
                                      place, speed)
                do lane = 1, lanes
                    if (is_within_stroke(actuator%cylinder, place(lane))) cycle
                    call fail(status, status_bad_input, "actuator "//quoted(actuator%name)//", cylinder: it starts at " &
                              //to_text(place(lane))//" m, which is not within the stroke (expected " &
                              //"a start from "//to_text(actuator%cylinder%stroke(1))//" to " &
                              //to_text(actuator%cylinder%stroke(2))//" m)")
                end do
            end associate
        end do
    end subroutine refuse_beyond_ends
end submodule linkdyn_forward_cylinders
