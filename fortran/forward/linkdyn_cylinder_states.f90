!> Hydraulic cylinders in a run: their forces from the pressures that are states, and how valves and motion change these.
!>
!> In y pressures stand in parts of the supply's, so that tolerances of the steps mean the same as of other states.
module linkdyn_cylinder_states
    use linkdyn_cylinder_laws, only: cylinder_force, valve_flows, pressure_rates, is_within_stroke, is_pressed
    use linkdyn_forward_record, only: forward_record
    use linkdyn_forward_state, only: state_layout
    use linkdyn_equations, only: equation_workspace
    use linkdyn_joint_rates, only: measure_variable
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_model, only: model_type
    use linkdyn_scene, only: cylinder_spec, n_chamber
    use linkdyn_text, only: quoted
    implicit none (type, external)
    private
    public :: cylinder_states, prepare_cylinders, drive_by_cylinders, drive_record_by_cylinders, pack_pressure_rates, &
        pressures_of_state, put_pressures, end_of_cylinder

    !> At the states evaluated last.
    type :: cylinder_states
        real(wp), allocatable :: pressure(:, :, :)     !! (lane, chamber, n_actuator) [Pa]
        real(wp), allocatable :: flow(:, :, :)         !! through the valve into chambers (lane, chamber, n_actuator) [m3/s]
        real(wp), allocatable :: rate(:, :, :)         !! of pressures (lane, chamber, n_actuator) [Pa/s]
        integer :: impossible(lanes) = 0               !! a cylinder beyond its stroke, or with oil torn apart; 0: none
        integer :: culprit = 0                         !! the last one of these since it was set to zero; 0: none
        logical :: is_torn = .false.                   !! it was its oil; else its stroke
    end type cylinder_states

contains

    subroutine prepare_cylinders(n_actuator, cylinders)
        integer, intent(in) :: n_actuator
        type(cylinder_states), intent(inout) :: cylinders

        allocate (cylinders%pressure(lanes, n_chamber, n_actuator), cylinders%flow(lanes, n_chamber, n_actuator), &
                  cylinders%rate(lanes, n_chamber, n_actuator), source=0.0_wp)
    end subroutine prepare_cylinders

    !> Forces of cylinders whose valves open as far as their laws say.
    subroutine drive_by_cylinders(model, layout, y, workspace, cylinders)
        type(model_type), intent(in) :: model
        type(state_layout), intent(in) :: layout
        real(wp), intent(in) :: y(:, :)                !! (lane, n)
        type(equation_workspace), intent(inout) :: workspace   !! motion of the states, and what laws give
        type(cylinder_states), intent(inout) :: cylinders
        real(wp), dimension(lanes) :: place, speed
        integer :: i, lane

        cylinders%impossible = 0
        do i = 1, model%n_actuator
            if (layout%pressure(i) == 0) cycle
            associate (spec => model%scene%actuator(i))
                call measure_variable(model, workspace%state, spec%joint, spec%variable, spread(0.0_wp, 1, lanes), place, speed)
            end associate
            do lane = 1, lanes
                call drive(model, layout, i, lane, y, place(lane), speed(lane), workspace%driving_force(lane, i), cylinders)
            end do
        end do
    end subroutine drive_by_cylinders

    !> The same in a record's samples, whose states are placed.
    subroutine drive_record_by_cylinders(model, layout, n, y, record, cylinders)
        type(model_type), intent(in) :: model
        type(state_layout), intent(in) :: layout
        integer, intent(in) :: n                       !! samples
        real(wp), intent(in) :: y(:, :)                !! (lane, n)
        type(forward_record), intent(inout) :: record
        type(cylinder_states), intent(inout) :: cylinders
        integer :: i, lane, at

        cylinders%impossible = 0
        associate (samples => record%samples)
            do i = 1, model%n_actuator
                if (layout%pressure(i) == 0) cycle
                at = samples%n_measure + i
                do lane = 1, n
                    call drive(model, layout, i, lane, y, samples%measured(at + model%n_actuator, lane), &
                               samples%measured(at, lane), samples%effort(i, lane), cylinders)
                end do
            end do
        end associate
    end subroutine drive_record_by_cylinders

    !> From the opening of its valve to the force of a cylinder; how its pressures change is found on the way.
    subroutine drive(model, layout, i, lane, y, place, speed, effort, cylinders)
        type(model_type), intent(in) :: model
        type(state_layout), intent(in) :: layout
        integer, intent(in) :: i, lane                 !! actuator, lane
        real(wp), intent(in) :: y(:, :)                !! (lane, n)
        real(wp), intent(in) :: place, speed           !! of the joint variable [m, m/s]
        real(wp), intent(inout) :: effort              !! opening in, force out [1, N]
        type(cylinder_states), intent(inout) :: cylinders
        real(wp), dimension(n_chamber) :: pressure, flow

        associate (cylinder => model%scene%actuator(i)%cylinder)
            pressure = pressures_of_state(cylinder, layout%pressure(i), y(lane, :))
            flow = valve_flows(cylinder, effort, pressure)
            cylinders%pressure(lane, :, i) = pressure
            cylinders%flow(lane, :, i) = flow
            cylinders%rate(lane, :, i) = pressure_rates(cylinder, flow, pressure, place, speed)
            effort = cylinder_force(cylinder, pressure)
            if (is_within_stroke(cylinder, place) .and. is_pressed(pressure)) return
            cylinders%impossible(lane) = i
            cylinders%culprit = i
            cylinders%is_torn = is_within_stroke(cylinder, place)
        end associate
    end subroutine drive

    !> Rates of the pressures that are in y. Lanes that are not used are like the last one.
    subroutine pack_pressure_rates(model, layout, n_used, cylinders, rate)
        type(model_type), intent(in) :: model
        type(state_layout), intent(in) :: layout
        integer, intent(in) :: n_used                  !! lanes
        type(cylinder_states), intent(in) :: cylinders
        real(wp), intent(inout) :: rate(:, :)          !! (lane, n)
        integer :: i, k, lane

        do i = 1, size(layout%pressure)
            if (layout%pressure(i) == 0) cycle
            do k = 1, n_chamber
                rate(:, layout%pressure(i) + k - 1) = cylinders%rate([(min(lane, n_used), lane=1, size(rate, 1))], k, i) &
                    /model%scene%actuator(i)%cylinder%supply
            end do
        end do
    end subroutine pack_pressure_rates

    !> In words: what the last one cannot do that was to.
    function end_of_cylinder(cylinders, model) result(text)
        type(cylinder_states), intent(in) :: cylinders
        type(model_type), intent(in) :: model
        character(len=:), allocatable :: text

        text = "the cylinder of actuator "//quoted(model%scene%actuator(cylinders%culprit)%name)
        if (cylinders%is_torn) then
            text = text//" would put the oil of a chamber under tension: cavitation (expected 'air' in the oil, " &
                   //"which then fills the chamber)"
        else
            text = text//" has come to an end of its stroke (expected an end stop there)"
        end if
    end function end_of_cylinder

    !> Pressures of a cylinder, from where those of its chambers begin in a state.
    pure function pressures_of_state(cylinder, place, y) result(pressure)
        type(cylinder_spec), intent(in) :: cylinder
        integer, intent(in) :: place
        real(wp), intent(in) :: y(:)                   !! (n)
        real(wp) :: pressure(n_chamber)                !! [Pa]

        pressure = cylinder%supply*y(place:place + n_chamber - 1)
    end function pressures_of_state

    !> Give a state these pressures.
    pure subroutine put_pressures(cylinder, place, pressure, y)
        type(cylinder_spec), intent(in) :: cylinder
        integer, intent(in) :: place
        real(wp), intent(in) :: pressure(n_chamber)    !! [Pa]
        real(wp), intent(inout) :: y(:)                !! (n)

        y(place:place + n_chamber - 1) = pressure/cylinder%supply
    end subroutine put_pressures
end module linkdyn_cylinder_states
