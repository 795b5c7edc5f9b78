!> What stops and clutches hold: how fast joint variables come away from stops, and how fast clutches slip. Both are numbered
!> together, stops first.
module linkdyn_held_variables
    use linkdyn_forward_state, only: state_layout
    use linkdyn_joint_rates, only: coordinate_of
    use linkdyn_joint_table, only: joint_spherical
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state
    use linkdyn_lane_count, only: lanes
    use linkdyn_model, only: model_type
    use linkdyn_place_motion, only: place_rate
    use linkdyn_planar_motion, only: level_velocity, level_given
    use linkdyn_scene, only: clutch_spec, n_stop, n_clutch
    use linkdyn_surface_slip, only: surface_slip, leads_slip, only_coordinate
    implicit none (type, external)
    private
    public :: held_accelerations, n_held, rates_held, measure_held, accelerations_with, away_from_stops, slips, &
        speed_of_sides, led_by, push_coordinates, still_coordinates, still_rates

    !> Accelerations away from stops and of slips, as they follow from those of the coordinates at one state.
    type :: held_accelerations
        logical :: is_measured = .false.               !! else it is of a state before
        real(wp), allocatable :: given(:, :)           !! with the accelerations that the state has (lane, n_held)
        real(wp), allocatable :: column(:, :, :)       !! what a unit of each coordinate's adds (lane, n_held, n_column)
    end type held_accelerations

contains

    !> Stops and clutches together.
    pure integer function n_held(model)
        type(model_type), intent(in) :: model

        n_held = n_stop(model%scene) + n_clutch(model%scene)
    end function n_held

    !> Velocities or accelerations away from stops, and of the slips of clutches.
    function rates_held(model, state, level) result(rate)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        integer, intent(in) :: level
        real(wp) :: rate(lanes, n_held(model))

        rate(:, :n_stop(model%scene)) = away_from_stops(model, state, level)
        rate(:, n_stop(model%scene) + 1:) = slips(model, state, level)
    end function rates_held

    subroutine measure_held(model, state, held)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state     !! with its columns
        type(held_accelerations), intent(inout) :: held
        integer :: k

        held%given = rates_held(model, state, level_given)
        if (.not. allocated(held%column)) allocate (held%column(lanes, n_held(model), state%n_column))
        do k = 1, state%n_column
            held%column(:, :, k) = rates_held(model, state, k)
        end do
        held%is_measured = .true.
    end subroutine measure_held

    !> Where coordinates accelerate otherwise than the state measured says.
    pure function accelerations_with(held, change) result(away)
        type(held_accelerations), intent(in) :: held
        real(wp), intent(in) :: change(:, :)           !! (lane, n_q)
        real(wp) :: away(lanes, size(held%given, 2))
        integer :: i, k

        away = held%given
        do k = 1, size(held%column, 3)
            do i = 1, size(away, 2)
                away(:, i) = away(:, i) + change(:, k)*held%column(:, i, k)
            end do
        end do
    end function accelerations_with

    !> Velocities or accelerations of what is stopped away from its stops.
    function away_from_stops(model, state, level) result(rate)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        integer, intent(in) :: level
        real(wp) :: rate(lanes, n_stop(model%scene))
        integer :: i

        do i = 1, size(rate, 2)
            associate (stop => model%scene%stop(i))
                rate(:, i) = 0
                if (stop%is_hard) rate(:, i) = -stop%side*place_rate(model, state, model%scene%laws%measure(stop%measure), level)
            end associate
        end do
    end function away_from_stops

    !> Slips of clutches, or how fast they change.
    function slips(model, state, level) result(rate)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        integer, intent(in) :: level
        real(wp) :: rate(lanes, n_clutch(model%scene))
        integer :: i

        do i = 1, size(rate, 2)
            associate (clutch => model%scene%clutch(i))
                rate(:, i) = rate_of_side(model, state, clutch, 1, level)
                if (clutch%n_side == 2) rate(:, i) = rate(:, i) - clutch%ratio*rate_of_side(model, state, clutch, 2, level)
            end associate
        end do
    end function slips

    function rate_of_side(model, state, clutch, side, level) result(rate)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        type(clutch_spec), intent(in) :: clutch
        integer, intent(in) :: side, level
        real(wp) :: rate(lanes)

        if (clutch%is_bare) then
            rate = surface_slip(model, state, clutch%joint(side), level)
        else
            rate = place_rate(model, state, model%scene%laws%measure(clutch%measure(side)), level)
        end if
    end function rate_of_side

    !> Rates on both sides of a clutch of two.
    function speed_of_sides(model, state, i) result(speed)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        integer, intent(in) :: i                       !! clutch
        real(wp) :: speed(lanes)

        speed = 0
        associate (clutch => model%scene%clutch(i))
            if (clutch%n_side == 2) speed = abs(rate_of_side(model, state, clutch, 1, level_velocity)) &
                                            + abs(clutch%ratio*rate_of_side(model, state, clutch, 2, level_velocity))
        end associate
    end function speed_of_sides

    !> Are a clutch's joint variables coordinates, or linear in them?
    pure logical function led_by(model, clutch)
        type(model_type), intent(in) :: model
        type(clutch_spec), intent(in) :: clutch
        integer :: k

        if (clutch%is_bare) then
            led_by = leads_slip(model, clutch%joint(1))
            return
        end if
        led_by = coordinate_of(model, clutch%joint(1), clutch%variable(1)) > 0
        if (.not. led_by) return
        if (model%joint(clutch%joint(1))%told_kind == joint_spherical) &   ! turning about an axis changes all of its angles
            led_by = all([(coordinate_of(model, clutch%joint(1), k) > 0, k=1, 3)])
        if (clutch%n_side == 2) led_by = led_by .and. coordinate_of(model, clutch%joint(2), clutch%variable(2)) > 0
    end function led_by

    !> Rates of coordinates behind pushes or impulses.
    subroutine push_coordinates(layout, takes_part, impulse, of_coordinates, y)
        type(state_layout), intent(in) :: layout
        logical, intent(in) :: takes_part(:, :)        !! (lane, by)
        real(wp), intent(in) :: impulse(:, :)          !! (lane, by)
        real(wp), intent(in) :: of_coordinates(:, :, :)     !! what a unit of each gives them (lane, n_q, by)
        real(wp), intent(inout) :: y(:, :)             !! (lane, n)
        integer :: i, k

        do i = 1, size(impulse, 2)
            do k = 1, size(layout%rate)
                if (layout%rate(k) == 0) cycle
                where (takes_part(:, i)) y(:, layout%rate(k)) = y(:, layout%rate(k)) + impulse(:, i)*of_coordinates(:, k, i)
            end do
        end do
    end subroutine push_coordinates

    !> A coordinate that is held has no velocity and no acceleration, to the last digit: so it does not creep, however long.
    subroutine still_coordinates(model, layout, holds, rate)
        type(model_type), intent(in) :: model
        type(state_layout), intent(in) :: layout
        logical, intent(in) :: holds(:, :)             !! (lane, n_clutch)
        real(wp), intent(inout) :: rate(:, :)          !! velocities or accelerations of coordinates (lane, n_q)
        integer :: i, k

        do i = 1, n_clutch(model%scene)
            associate (clutch => model%scene%clutch(i))
                if (clutch%n_side == 2) cycle
                k = coordinate_of(model, clutch%joint(1), clutch%variable(1))
                if (clutch%is_bare) k = only_coordinate(model, clutch%joint(1))
                if (k == 0) cycle
                if (layout%rate(k) == 0) cycle         ! it is driven
                where (holds(:, i)) rate(:, k) = 0
            end associate
        end do
    end subroutine still_coordinates

    !> The same of the velocities in y.
    subroutine still_rates(model, layout, holds, y)
        type(model_type), intent(in) :: model
        type(state_layout), intent(in) :: layout
        logical, intent(in) :: holds(:, :)             !! (lane, n_clutch)
        real(wp), intent(inout) :: y(:, :)             !! (lane, n)
        real(wp) :: rates(lanes, model%n_q)
        integer :: k

        associate (place => layout%rate)
            rates = 0
            do k = 1, size(place)
                if (place(k) > 0) rates(:, k) = y(:, place(k))
            end do
            call still_coordinates(model, layout, holds, rates)
            do k = 1, size(place)
                if (place(k) > 0) y(:, place(k)) = rates(:, k)
            end do
        end associate
    end subroutine still_rates
end module linkdyn_held_variables
