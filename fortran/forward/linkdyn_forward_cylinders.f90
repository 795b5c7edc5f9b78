!> Pressures at the start of a run: those that the scene gives, or those that hold the mechanism where it is.
submodule (linkdyn_forward_system) linkdyn_forward_cylinders
    use linkdyn_cylinder_laws, only: holding_pressures, is_within_stroke
    use linkdyn_cylinder_states, only: put_pressures
    use linkdyn_holding_forces, only: holding_forces, plan_holding_forces, find_holding_forces, free_holding_forces
    use linkdyn_joint_rates, only: measure_variable
    use linkdyn_status, only: fail, status_bad_input
    use linkdyn_text, only: quoted, to_text
    implicit none (type, external)

    character(len=*), parameter :: expected_start = " (expected 'pressures' of the cylinder at the start)"

contains

    module procedure fill_cylinders
        integer :: i
        logical :: has_all

        if (all(self%layout%pressure == 0)) return
        if (present(given)) then
            do i = 1, self%model%n_actuator
                if (self%layout%pressure(i) > 0) call put(self, i, spread(given(:, i), 1, lanes), y)
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
        call refuse_beyond_ends(self, t, y, status)
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

    !> Cylinders whose pressures nobody gives hold the mechanism, at rest, against weights, springs and loads.
    subroutine hold_start(self, t, y, status)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t                      !! [s]
        real(wp), intent(inout) :: y(:, :)
        type(status_type), intent(inout) :: status
        type(holding_forces) :: holding
        real(wp) :: pressure(lanes, n_chamber)
        integer :: i, lane

        i = findloc(self%layout%pressure > 0 .and. .not. self%model%scene%actuator%cylinder%has_start, .true., dim=1)
        if (self%model%n_actuator /= self%model%n_q) then
            call fail(status, status_bad_input, "actuator "//quoted(self%model%scene%actuator(i)%name)//", cylinder: what " &
                      //"holds the start cannot be told, with "//to_text(self%model%n_actuator)//" actuators for " &
                      //to_text(self%model%n_q)//" coordinates"//expected_start)
            return
        end if
        call plan_holding_forces(self%model, holding, status)
        if (status%is_ok()) then
            call begin_assembly(self%model, t, self%assembly)
            call find_holding_forces(self%model, self%layout, spread(t, 1, lanes), y, self%turns, self%assembly, holding, &
                                     with_loads=.true.)
            do i = 1, self%model%n_actuator
                if (self%layout%pressure(i) == 0 .or. self%model%scene%actuator(i)%cylinder%has_start) cycle
                do lane = 1, lanes
                    call hold(holding%force(lane, i), holding%status(lane))
                end do
                call put(self, i, pressure, y)
            end do
        end if
        call free_holding_forces(holding)

    contains

        !> Pressures of cylinder i on a lane.
        subroutine hold(force, sample_status)
            real(wp), intent(in) :: force              !! that holds there [N]
            integer, intent(in) :: sample_status       !! of it

            associate (actuator => self%model%scene%actuator(i))
                pressure(lane, :) = holding_pressures(actuator%cylinder, force)
                if (sample_status /= sample_ok) then
                    call fail(status, status_bad_input, "actuator "//quoted(actuator%name)//", cylinder: no force holds the start" &
                              //expected_start)
                else if (any(pressure(lane, :) < actuator%cylinder%tank .or. pressure(lane, :) > actuator%cylinder%supply)) then
                    call fail(status, status_bad_input, "actuator "//quoted(actuator%name)//", cylinder: to hold the start takes " &
                              //to_text(force)//" N, which pressures between tank and supply do not give"//expected_start)
                end if
            end associate
        end subroutine hold
    end subroutine hold_start

    !> A start beyond the ends of a stroke is none.
    subroutine refuse_beyond_ends(self, t, y, status)
        class(forward_system), intent(inout) :: self
        real(wp), intent(in) :: t                      !! [s]
        real(wp), intent(in) :: y(:, :)
        type(status_type), intent(inout) :: status
        real(wp), dimension(lanes) :: place, speed
        integer :: i, lane

        if (.not. status%is_ok()) return
        call begin_assembly(self%model, t, self%assembly)
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
