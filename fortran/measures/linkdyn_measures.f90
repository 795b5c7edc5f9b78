!> What laws over the state depend on, measured: joint variables, markers, springs, their rates, and the instant.
!>
!> Needs positions and velocities, angular rates in world axes, and the instant of the state.
module linkdyn_measures
    use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan
    use linkdyn_joint_rates, only: measure_variable
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state
    use linkdyn_lane_count, only: lanes
    use linkdyn_constants, only: two_pi
    use linkdyn_formula, only: evaluate_formula
    use linkdyn_law_values, only: evaluate_laws
    use linkdyn_marker_motion, only: locate_marker
    use linkdyn_model, only: model_type
    use linkdyn_place_motion, only: place_value, place_rate
    use linkdyn_planar_motion, only: level_velocity
    use linkdyn_scene, only: measure_spec, spring_spec, measure_time, measure_joint, measure_spring, measure_touch, n_event, &
        n_clutch, pulls_in_line, least_openness, loses_itself_at_pole
    use linkdyn_vec3, only: vec3, operator(-), operator(*), operator(.dot.)
    implicit none (type, external)
    private
    public :: find_laws, find_measures, find_events, tell_events, find_kept, measure_distance, measure_spring_length
    public :: spring_without_direction

contains

    !> Values of all laws into the state.
    subroutine find_laws(model, state)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(inout) :: state
        real(wp) :: measure(lanes, size(model%scene%laws%measure))

        if (size(model%scene%laws%law) == 0) return
        call find_measures(model, state, measure)
        call evaluate_laws(model%scene%laws, measure, state%law, state%mode)
    end subroutine find_laws

    !> The numbers whose zeros are the scene's events. A run knows about where its angles are: they then count turns.
    subroutine find_events(model, state, about, value)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        real(wp), intent(in) :: about(:, :)            !! where measures that wrap are, within half a turn (lane, measure)
        real(wp), intent(out) :: value(:, :)           !! (lane, n_event)
        real(wp) :: measure(lanes, size(model%scene%laws%measure))

        call find_measures(model, state, measure)
        call tell_events(model, about, measure, value)
    end subroutine find_events

    !> The same of measures.
    subroutine tell_events(model, about, measure, value)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: about(:, :)            !! as of `find_events`
        real(wp), intent(inout) :: measure(:, :)       !! they come back with their turns counted (lane, measure)
        real(wp), intent(out) :: value(:, :)           !! (lane, n_event)
        real(wp) :: law(lanes, size(model%scene%laws%law)), mode(lanes)
        integer :: i

        call evaluate_laws(model%scene%laws, measure, law, mode)
        call count_turns(model, about, measure)
        do i = 1, n_event(model%scene)
            call evaluate_formula(model%scene%event(i)%formula, measure, law, value(:, i), mode)
        end do
    end subroutine tell_events

    !> What clutches keep: the first joint variable less the ratio times the second, with their turns.
    subroutine find_kept(model, state, about, value)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        real(wp), intent(in) :: about(:, :)            !! as of `find_events`
        real(wp), intent(out) :: value(:, :)           !! (lane, n_clutch)
        real(wp) :: measure(lanes, size(model%scene%laws%measure))
        integer :: i

        if (n_clutch(model%scene) == 0) return
        call find_measures(model, state, measure)
        call count_turns(model, about, measure)
        do i = 1, n_clutch(model%scene)
            associate (clutch => model%scene%clutch(i))
                value(:, i) = 0                        ! of surfaces no place tells how far they have slipped
                if (clutch%is_bare) cycle
                value(:, i) = measure(:, clutch%measure(1))
                if (clutch%n_side == 2) value(:, i) = value(:, i) - clutch%ratio*measure(:, clutch%measure(2))
            end associate
        end do
    end subroutine find_kept

    !> Measures that wrap, within half a turn of where they are about.
    pure subroutine count_turns(model, about, measure)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: about(:, :)            !! (lane, measure)
        real(wp), intent(inout) :: measure(:, :)       !! (lane, measure)
        integer :: i

        do i = 1, size(measure, 2)
            if (model%scene%laws%measure(i)%wraps) &
                measure(:, i) = measure(:, i) - two_pi*anint((measure(:, i) - about(:, i))/two_pi)
        end do
    end subroutine count_turns

    !> All measures, as the laws mean them: those of a similar mechanism at the size of the scene.
    subroutine find_measures(model, state, measure)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        real(wp), intent(out) :: measure(:, :)         !! (lane, measure)
        integer :: k

        associate (book => model%scene%laws)
            do k = 1, size(book%measure)
                call find_measure(model, book%measure(k), state, measure(:, k))
                if (book%measure(k)%length_power /= 0) measure(:, k) = measure(:, k)/book%scale**book%measure(k)%length_power
            end do
        end associate
    end subroutine find_measures

    !> The value of one measure, or its rate.
    subroutine find_measure(model, spec, state, number)
        type(model_type), intent(in) :: model
        type(measure_spec), intent(in) :: spec
        type(kinematic_state), intent(in) :: state
        real(wp), intent(out) :: number(lanes)
        integer, parameter :: pitch = 2
        real(wp), dimension(lanes) :: value, rate, angle, speed

        select case (spec%kind)
        case (measure_joint)
            call measure_variable(model, state, spec%joint, spec%variable, spread(spec%near, 1, lanes), value, rate)
            if (loses_itself_at_pole(model%scene, spec)) then
                call measure_variable(model, state, spec%joint, pitch, spread(0.0_wp, 1, lanes), angle, speed)
                where (cos(angle) < least_openness)
                    value = ieee_value(1.0_wp, ieee_quiet_nan)
                    rate = value
                end where
            end if
        case (measure_spring)
            call measure_spring_length(model, model%scene%spring(spec%spring), state, value, rate)
            value = value - model%scene%spring(spec%spring)%rest
        case (measure_touch)
            value = state%touch(:, spec%stop)
            rate = 0
        case (measure_time)
            value = state%time
            rate = 1
        case default
            if (spec%is_rate) then
                rate = place_rate(model, state, spec, level_velocity)
            else
                value = place_value(model, state, spec)
            end if
        end select
        if (spec%is_rate) then
            number = rate
        else
            number = value
        end if
    end subroutine find_measure

    !> Distance or joint variable of a spring, and its rate.
    subroutine measure_spring_length(model, spring, state, value, rate)
        type(model_type), intent(in) :: model
        type(spring_spec), intent(in) :: spring
        type(kinematic_state), intent(in) :: state
        real(wp), intent(out) :: value(lanes), rate(lanes)
        type(vec3) :: point(2), line
        logical :: ignored(lanes)

        if (spring%joint > 0) then
            call measure_variable(model, state, spring%joint, spring%variable, spread(spring%rest, 1, lanes), value, rate)
        else
            call measure_distance(model, spring, state, point, line, value, rate, ignored)
        end if
    end subroutine measure_spring_length

    !> The first spring whose force has no direction on a lane; 0: there is none.
    integer function spring_without_direction(model, state, lane) result(i)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state     !! of which the positions are known
        integer, intent(in) :: lane
        type(vec3) :: point(2), line
        real(wp) :: distance(lanes), rate(lanes)
        logical :: is_lost(lanes)

        do i = 1, size(model%scene%spring)
            associate (spring => model%scene%spring(i))
                if (.not. pulls_in_line(spring)) cycle
                call measure_distance(model, spring, state, point, line, distance, rate, is_lost)
                if (is_lost(lane)) return
            end associate
        end do
        i = 0
    end function spring_without_direction

    !> Distance of a spring's two markers and how it changes.
    subroutine measure_distance(model, spring, state, point, line, distance, rate, is_lost)
        type(model_type), intent(in) :: model
        type(spring_spec), intent(in) :: spring
        type(kinematic_state), intent(in) :: state
        type(vec3), intent(out) :: point(2)            !! markers, world axes [m]
        type(vec3), intent(out) :: line                !! unit vector from the first to the second; zero where it is lost
        real(wp), intent(out) :: distance(lanes), rate(lanes)
        logical, intent(out) :: is_lost(lanes)         !! the direction: the markers coincide
        ! Rounding leaves the markers uncertain by a few eps of their distance from the origin. So close to each other half
        ! of the digits of their direction are gone.
        real(wp), parameter :: close = sqrt(epsilon(1.0_wp))
        type(vec3) :: velocity(2)
        real(wp) :: reach(lanes)
        integer :: side

        do side = 1, 2
            call locate_marker(model, spring%link(side), spring%marker(side), state, point(side), velocity(side))
        end do
        line = point(2) - point(1)
        distance = sqrt(line.dot.line)
        reach = sqrt(point(1).dot.point(1)) + sqrt(point(2).dot.point(2))
        is_lost = .not. distance > close*reach
        line = merge(0.0_wp, 1/max(distance, tiny(1.0_wp)), is_lost)*line
        rate = line.dot.(velocity(2) - velocity(1))
    end subroutine measure_distance
end module linkdyn_measures
