!> The states in which steps end, looked at by a record: each once, on one lane, for all who judge steps.
!>
!> What is seen are energies, margins of the closed forms, and how what is watched moves (`linkdyn_look_program`). A state of which
!> the record is not sure is left to the lanes, as everywhere.
module linkdyn_step_ends
    use linkdyn_bounce_watch, only: bounce_watch, prepare_bounce_watch
    use linkdyn_carried_assembly, only: carried_assembly, note_doubt
    use linkdyn_coordinate_watch, only: coordinate_watch, prepare_watch
    use linkdyn_forward_record, only: forward_record, use_forward_rates, free_forward_record, place_states, place_still, &
        close_near, is_led_there, doubt_far
    use linkdyn_forward_state, only: state_layout
    use linkdyn_joint_table, only: is_slide
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_led_mechanism, only: follows_assembly
    use linkdyn_look_program, only: look_choice
    use linkdyn_model, only: model_type
    use linkdyn_recorded_rates, only: recorded_rates, run_looks, run_looks_on_lanes, wire_looks
    use linkdyn_scene, only: joint_n_variable
    use linkdyn_scene_program, only: input_wiring
    use linkdyn_state_wires, only: columns_of_states
    use linkdyn_turns, only: turns_by_itself
    implicit none (type, external)
    private
    public :: forward_look, wants_looks, choose_looks, use_looks, free_looks
    public :: see_end, see_energies, angles_seen, seen_angles, is_seen, see_lanes, see_way

    !> What has been seen of a state on each lane.
    type :: seen_lanes
        real(wp), allocatable :: value(:, :)           !! the first, as `look_outputs` tells: of assemblies and energies (lane,
                                                       !! value)
        logical :: counts = .false.                    !! else the record is not sure of one
    end type seen_lanes

    type :: forward_look
        logical :: is_usable = .false.
        logical, private :: is_there = .false.         !! a state has been looked at, and is the first sample of these:
        type(forward_record) :: record
        real(wp), private :: t = 0                     !! it [s]
        real(wp), allocatable, private :: y(:)         !! (n)
        integer, allocatable, private :: angle(:)      !! joint variables that are seen as angles
        logical, allocatable, private :: by_nobody(:)  !! drives whose forces somebody gives: none (n_actuator)
        type(input_wiring), private :: by_columns      !! from where states come that are looked at on lanes
        type(seen_lanes) :: of_lanes
    end type forward_look

contains

    !> Is there something to be seen of a scene's steps: does an assembly have to be kept, or turns of joints be counted?
    pure logical function wants_looks(model)
        type(model_type), intent(in) :: model

        wants_looks = follows_assembly(model) .or. turns_by_itself(model)
    end function wants_looks

    !> What is to be seen of a scene's steps: it hangs on the model alone, so that all who share a record see the same.
    subroutine choose_looks(model, is_free, choice)
        type(model_type), intent(in) :: model
        logical, intent(in) :: is_free(:)              !! coordinates that are not driven (n_q)
        type(look_choice), intent(out) :: choice
        type(coordinate_watch) :: watch
        type(bounce_watch) :: bounce
        integer :: v, k

        allocate (choice%joint(0), choice%link(0), choice%compared(2, 0), choice%coordinate(0))
        choice%angle = angles_to_see(model)
        call prepare_bounce_watch(model, is_free, bounce)
        if (bounce%is_on) then
            choice%joint = bounce%joint
            choice%link = bounce%link
        end if
        call prepare_watch(model, is_free, watch)
        if (.not. watch%is_on) return
        choice%coordinate = pack([(k, k=1, model%n_q)], watch%variable > 0)
        choice%compared = reshape([(watch%joint(v), watch%place(v), v=1, model%n_variable)], [2, model%n_variable])
        choice%compared = choice%compared(:, pack([(v, v=1, model%n_variable)], watch%is_candidate))
    end subroutine choose_looks

    !> All joint angles, by joint and place in it: what of them turns by itself is followed by how fast any of them turns. None, if
    !> nothing does.
    pure function angles_to_see(model) result(angle)
        type(model_type), intent(in) :: model
        integer, allocatable :: angle(:, :)            ! (2, angle)
        integer, allocatable :: listed(:)
        integer :: j, v

        allocate (listed(0))
        do j = 1, merge(model%n_joint, 0, turns_by_itself(model))
            do v = 1, joint_n_variable(model%joint(j)%told_kind)
                if (.not. is_slide(model%joint(j)%told_kind, v)) listed = [listed, j, v]
            end do
        end do
        angle = reshape(listed, [2, size(listed)/2])
    end function angles_to_see

    !> Use a record of the scene, if that can look.
    subroutine use_looks(model, layout, recorded, look)
        type(model_type), intent(in) :: model
        type(state_layout), intent(in) :: layout
        type(recorded_rates), intent(in) :: recorded
        type(forward_look), intent(out) :: look

        look%is_usable = recorded%is_usable .and. recorded%looks%is_made .and. wants_looks(model)
        if (.not. look%is_usable) return
        call use_forward_rates(model, layout, recorded, .false., .false., look%record)
        look%angle = angles_seen(model)
        look%by_nobody = spread(.false., 1, model%n_actuator)
        call wire_looks(recorded, columns_of_states(model, look%record%wires), look%by_columns)
        allocate (look%of_lanes%value(lanes, recorded%look%n_of_assembly))
    end subroutine use_looks

    !> Which joint variables are seen as angles.
    pure function angles_seen(model) result(variable)
        type(model_type), intent(in) :: model
        integer, allocatable :: variable(:)
        integer, allocatable :: angle(:, :)

        angle = angles_to_see(model)
        variable = model%joint(angle(1, :))%first_variable + angle(2, :)
    end function angles_seen

    !> Joint angles and their rates in the state that has been seen; 0 for slides.
    pure subroutine seen_angles(look, angle, spin)
        type(forward_look), intent(in) :: look
        real(wp), intent(out) :: angle(:), spin(:)     !! (n_variable) [rad], [rad/s]

        angle = 0
        spin = 0
        associate (out => look%record%recorded%look, seen => look%record%samples%seen(:, 1), n => size(look%angle))
            angle(look%angle) = seen(out%angle:out%angle + n - 1)
            spin(look%angle) = seen(out%spin:out%spin + n - 1)
        end associate
    end subroutine seen_angles

    subroutine free_looks(look)
        type(forward_look), intent(inout) :: look

        call free_forward_record(look%record)
        look%is_usable = .false.
        look%is_there = .false.
    end subroutine free_looks

    !> Is this the state that has been seen?
    pure logical function is_seen(look, t, y)
        type(forward_look), intent(in) :: look
        real(wp), intent(in) :: t, y(:)                !! [s], (n)

        is_seen = look%is_there
        if (is_seen) is_seen = t == look%t .and. all(y == look%y)
    end function is_seen

    !> Look at the state of which the run's record has just found the rates.
    subroutine see_end(model, layout, t, y, turns, assembly, acceleration, evaluated, look)
        type(model_type), intent(in) :: model
        type(state_layout), intent(in) :: layout
        real(wp), intent(in) :: t, y(:)                !! [s], (n)
        real(wp), intent(in) :: turns(:, :)            !! of angles that are not in y (lane, n)
        type(carried_assembly), intent(in) :: assembly
        real(wp), intent(in) :: acceleration(:)        !! (n_q)
        type(forward_record), intent(in) :: evaluated  !! it is the first sample of
        type(forward_look), intent(inout) :: look

        associate (samples => look%record%samples, from => evaluated%samples)
            call place_states(model, layout, assembly, 1, [t], reshape(y, [1, size(y)]), turns, &
                              look%by_nobody, look%record)
            samples%place(:, 1) = from%place(:, 1)
            samples%group_margin(:, 1) = from%group_margin(:, 1)
            samples%qdd(:, 1) = acceleration
            samples%is_left(1) = samples%is_left(1) .or. from%is_left(1)
        end associate
        call run_looks(look%record%recorded, 1, look%record%samples)
        call note_first(t, y, evaluated, look)
    end subroutine see_end

    !> One that groups were led to, step by step, is left to the lanes, which count what they pass.
    subroutine note_first(t, y, evaluated, look)
        real(wp), intent(in) :: t, y(:)
        type(forward_record), intent(in) :: evaluated
        type(forward_look), intent(inout) :: look

        look%is_there = .not. (look%record%samples%is_left(1) .or. is_led_there(evaluated))
        look%t = t
        look%y = y
    end subroutine note_first

    !> Look at accepted states, one a lane, of a scene without groups. Nothing of it counts unless all that matter leave no doubt
    !> that they are on the accepted assembly.
    subroutine see_lanes(model, layout, t, y, turns, matters, assembly, look)
        type(model_type), intent(in) :: model
        type(state_layout), intent(in) :: layout
        real(wp), intent(in) :: t(lanes)               !! [s]
        real(wp), intent(in), contiguous :: y(:, :)    !! (lane, n)
        real(wp), intent(in) :: turns(:, :)            !! of angles that are not in y (lane, n)
        logical, intent(in) :: matters(lanes)
        type(carried_assembly), intent(in) :: assembly
        type(forward_look), intent(inout) :: look
        real(wp), dimension(lanes) :: ahead, doubt
        integer :: m

        call look_at_lanes(model, layout, t, y, turns, assembly, look)
        ahead = t - assembly%t
        doubt = 0
        call doubt_far(model, layout, assembly, lanes, lanes, y, doubt)
        associate (seen => look%of_lanes%value, out => look%record%recorded%look)
            do m = 1, model%n_branch
                call note_doubt(lanes, model%scene%passes_change_points, model%least_margin(m), assembly%margin(:, m), &
                                assembly%drift(:, m), seen(:, out%margin + m - 1), seen(:, out%drift + m - 1), ahead, doubt)
            end do
        end associate
        look%of_lanes%counts = .not. any((look%record%samples%is_left(:lanes) .or. doubt > 0) .and. matters)
    end subroutine see_lanes

    !> The same of places along one way, the first of which is on the accepted assembly. Nothing of it counts unless each next place
    !> is as surely on it: beyond a change point it would be another one that is seen.
    subroutine see_way(model, layout, t, y, turns, assembly, look)
        type(model_type), intent(in) :: model
        type(state_layout), intent(in) :: layout
        real(wp), intent(in) :: t(lanes)               !! [s]
        real(wp), intent(in), contiguous :: y(:, :)    !! (lane, n)
        real(wp), intent(in) :: turns(:, :)            !! of angles that are not in y (lane, n)
        type(carried_assembly), intent(in) :: assembly
        type(forward_look), intent(inout) :: look
        integer, parameter :: n_step = lanes - 1
        real(wp), dimension(n_step) :: step, doubt
        integer :: m

        call look_at_lanes(model, layout, t, y, turns, assembly, look)
        step = t(2:) - t(:n_step)
        doubt = 0
        associate (seen => look%of_lanes%value, out => look%record%recorded%look)
            do m = 1, model%n_branch
                associate (margin => seen(:, out%margin + m - 1), drift => seen(:, out%drift + m - 1))
                    call note_doubt(n_step, .false., model%least_margin(m), margin(:n_step), drift(:n_step), margin(2:), &
                                    drift(2:), step, doubt)
                end associate
            end do
        end associate
        look%of_lanes%counts = .not. (any(doubt > 0) .or. any(look%record%samples%is_left(:lanes)))
    end subroutine see_way

    subroutine look_at_lanes(model, layout, t, y, turns, assembly, look)
        type(model_type), intent(in) :: model
        type(state_layout), intent(in) :: layout
        real(wp), intent(in) :: t(lanes)               !! [s]
        real(wp), intent(in), contiguous :: y(:, :)    !! (lane, n)
        real(wp), intent(in) :: turns(:, :)
        type(carried_assembly), intent(in) :: assembly
        type(forward_look), intent(inout) :: look

        look%is_there = .false.
        if (look%record%motion_stands_still) then
            call place_still(model, layout, assembly, lanes, lanes, y, look%record)
        else
            call place_states(model, layout, assembly, lanes, t, y, turns, look%by_nobody, look%record)
        end if
        call run_looks_on_lanes(look%record%recorded, look%by_columns, y, look%record%samples, look%of_lanes%value)
    end subroutine look_at_lanes

    !> Energies of the state of which the run's record has just found the rates, and of some very near to it. The first is the state
    !> that has been seen from here on.
    subroutine see_energies(model, layout, t, y, turns, assembly, acceleration, evaluated, look, energy, kinetic, are_seen)
        type(model_type), intent(in) :: model
        type(state_layout), intent(in) :: layout
        real(wp), intent(in) :: t, y(:, :)             !! [s], (n, state)
        real(wp), intent(in) :: turns(:, :)            !! of angles that are not in y (lane, n)
        type(carried_assembly), intent(in) :: assembly
        real(wp), intent(in) :: acceleration(:)        !! of the first (n_q)
        type(forward_record), intent(in) :: evaluated
        type(forward_look), intent(inout) :: look
        real(wp), intent(out) :: energy(:), kinetic(:) !! [J] (state)
        logical, intent(out) :: are_seen               !! false: the record is not sure of one
        real(wp) :: lane_y(lanes, size(y, 1))
        integer :: last, first, lane, n

        ! the block with the state itself comes last
        last = size(y, 2) - modulo(size(y, 2) - 1, lanes)
        do first = last, 1, -lanes
            n = min(lanes, size(y, 2) - first + 1)
            do lane = 1, lanes
                lane_y(lane, :) = y(:, min(first + lane - 1, size(y, 2)))
            end do
            call place_states(model, layout, assembly, n, spread(t, 1, lanes), lane_y, turns, &
                              look%by_nobody, look%record)
            call close_near(model, evaluated, n, look%record)
            associate (samples => look%record%samples, out => look%record%recorded%look)
                samples%qdd(:, :n) = spread(acceleration, 2, n)
                call run_looks(look%record%recorded, n, samples)
                energy(first:first + n - 1) = samples%seen(out%energy, :n)
                kinetic(first:first + n - 1) = samples%seen(out%kinetic, :n)
                are_seen = .not. any(samples%is_left(:n))
            end associate
            if (.not. are_seen) exit
        end do
        look%is_there = .false.
        if (are_seen) call note_first(t, y(:, 1), evaluated, look)
    end subroutine see_energies
end module linkdyn_step_ends
