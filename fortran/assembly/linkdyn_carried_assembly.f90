!> The assembly carried along a run of forward dynamics, on every lane: that of the last state accepted.
!>
!> An integrator tries positions ahead of the accepted one, in no fixed order, and may reject them. All of them are
!> computed on the branches of the accepted state, groups closed by iteration from where its tangent leads, unless the
!> step is not to be believed; then the straight way from the accepted position is followed (`linkdyn_following`). Where one
!> coordinate leads closed forms, all that has been followed is remembered: there nothing is to be doubted again.
module linkdyn_carried_assembly
    use linkdyn_assembly_trail, only: sample_assembly, keep_lane, reached_crossing
    use linkdyn_following, only: way_report, doubt_unsound, way_arrived, way_at_singularity, way_forks, &
        largest_contraction
    use linkdyn_group_motion, only: group_closer
    use linkdyn_group_stride, only: close_places
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_pass, only: run_program
    use linkdyn_kinematic_state, only: kinematic_state, prepare_kinematics
    use linkdyn_lane_count, only: lanes
    use linkdyn_led_mechanism, only: evaluate_kinematics, lead_mechanism, status_of_way, measure_margins, n_map, span_of, &
        follows_assembly, turned_to
    use linkdyn_model, only: model_type, link_freedom, place_size, gives_attitude, attitude_angles
    use linkdyn_steps_on_lanes, only: place_rates
    use linkdyn_newton_group, only: led_link
    use linkdyn_quaternion, only: quaternion_of_rpy
    use linkdyn_status, only: sample_ok, sample_unreachable, sample_branch_lost
    use linkdyn_whole_turns, only: with_turns
    implicit none (type, external)
    private
    public :: carried_assembly, begin_assembly, evaluate_assembled, evaluate_on_assembly, accept_assembly, accept_seen
    public :: stand_there, leave_turns_of, leave_standing, keep_evaluated, count_passed, note_doubt, note_far, longest_way, &
        farthest_way, secant, take_branches

    !> Strides of the way to a state that is tried: a turn, or six times the size. No step that goes farther tells what is between,
    !> and a method that controls its steps tries the like by the hundred.
    real(wp), parameter :: longest_step = 63

    !> Strides, half a turn: beyond these a loop may have passed two change points, of which a state tried tells nothing.
    real(wp), parameter :: farthest_told = 32

    type :: carried_assembly
        logical :: is_needed = .false.                 !! the assembly may change
        logical :: is_at_start = .true.                !! of the scene: nothing has been accepted yet
        real(wp) :: t(lanes) = 0                       !! accepted [s]
        real(wp), allocatable :: q(:, :)               !! there                          (lane, n_q)
        real(wp), allocatable :: quaternion(:, :, :)   !! of attitudes given by one      (lane, 4, n_attitude)
        real(wp), allocatable :: branch(:, :)          !!                                (lane, n_branch)
        real(wp), allocatable :: margin(:, :)          !! of the maps                    (lane, n_map)
        real(wp), allocatable :: drift(:, :)           !! its rate [1/s]                 (lane, n_map)
        real(wp), allocatable :: side(:, :)            !! the last margin that could be told from zero; 0: none yet (lane, n_map)
        real(wp), allocatable :: place(:, :, :)        !! of the groups' links           (lane, place_size, n_link)
        real(wp), allocatable :: column(:, :, :, :)    !! its rates for unit rates of q  (lane, link_freedom, n_link, n_q)
        real(wp), allocatable :: clear(:, :)           !! between which values of the one coordinate no change point is met, the
                                                       !! accepted one among them; not allocated: it is not the only one, or there
                                                       !! are groups (2, lane)
        integer :: n_crossed(lanes) = 0                !! change points passed since the start
        integer :: n_crossed_tried(lanes) = 0          !! on the way to the state tried last
        integer :: map_lost(lanes) = 0                 !! at fault where two assemblies met on a way tried near here; 0: none
        class(group_closer), pointer :: closer => null()   !! makes the groups' steps towards a state tried; null: lanes alone do
        type(kinematic_state) :: state                 !! scratch: positions and velocities of the state to be accepted
    end type carried_assembly

contains

    !> Begin on the assembly of the scene's start.
    subroutine begin_assembly(model, t, assembly)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: t                      !! [s]
        type(carried_assembly), intent(out) :: assembly
        integer :: i

        assembly%is_needed = follows_assembly(model)
        if (.not. assembly%is_needed) return
        assembly%t = t
        assembly%q = spread(model%start_q, 1, lanes)
        assembly%branch = spread(model%branch, 1, lanes)
        allocate (assembly%margin(lanes, n_map(model)), assembly%drift(lanes, n_map(model)))
        assembly%margin = 0                            ! which says nothing
        assembly%drift = 0
        assembly%side = assembly%margin
        call prepare_kinematics(model, merge(model%n_q, 0, size(model%group) > 0), assembly%state)
        allocate (assembly%quaternion(lanes, 4, model%n_attitude))
        do i = 1, size(model%step)
            if (.not. gives_attitude(model, model%step(i))) cycle
            associate (q => assembly%q, c => attitude_angles(model%step(i)), p => model%step(i)%first)
                assembly%quaternion(:, :, p) = quaternion_of_rpy(q(:, c(1)), q(:, c(2)), q(:, c(3)))
            end associate
        end do
        if (size(model%group) == 0) then
            if (model%n_q == 1 .and. model%n_attitude == 0) assembly%clear = spread(assembly%q(:, 1), 1, 2)
            return
        end if
        assembly%place = assembly%state%group%start_place
        allocate (assembly%column(lanes, link_freedom(model), model%n_link, model%n_q))
        assembly%column = 0
    end subroutine begin_assembly

    !> Be where a state has been computed, far from the start: what is tried next sets out from there.
    subroutine stand_there(model, state, assembly)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        type(carried_assembly), intent(inout) :: assembly

        assembly%q = state%q
        if (allocated(assembly%clear)) assembly%clear = spread(assembly%q(:, 1), 1, 2)
        assembly%place = state%group%place
        call measure_margins(model, state, assembly%margin, assembly%drift)
        assembly%drift = 0
    end subroutine stand_there

    !> A coordinate goes on without some of its turns, and so do the ways from here.
    subroutine leave_turns_of(k, turns, assembly)
        integer, intent(in) :: k                       !! coordinate
        real(wp), intent(in) :: turns(lanes)
        type(carried_assembly), intent(inout) :: assembly
        integer :: m

        assembly%q(:, k) = with_turns(assembly%q(:, k), -turns)
        if (.not. allocated(assembly%clear)) return
        do m = 1, 2
            assembly%clear(m, :) = with_turns(assembly%clear(m, :), -turns)
        end do
    end subroutine leave_turns_of

    !> Branches of the closed forms on which states are tried.
    pure subroutine take_branches(model, assembly, n, branch, are_new)
        type(model_type), intent(in) :: model
        type(carried_assembly), intent(in) :: assembly
        integer, intent(in) :: n                       !! of the first lanes
        real(wp), intent(inout), contiguous :: branch(:, :)    !! (n_branch, lane)
        logical, intent(inout) :: are_new              !! set where one differs from what was there
        integer :: k, lane, n_new

        n_new = 0
        do k = 1, model%n_branch
            if (assembly%is_needed) then
                do lane = 1, n
                    if (branch(k, lane) /= assembly%branch(lane, k)) n_new = n_new + 1
                    branch(k, lane) = assembly%branch(lane, k)
                end do
            else
                do lane = 1, n
                    if (branch(k, lane) /= model%branch(k)) n_new = n_new + 1
                    branch(k, lane) = model%branch(k)
                end do
            end if
        end do
        are_new = are_new .or. n_new > 0
    end subroutine take_branches

    !> Let another assembly stand where the first lane does, from a lane on: states are evaluated from there later.
    subroutine leave_standing(assembly, lane, there)
        type(carried_assembly), intent(in) :: assembly
        integer, intent(in) :: lane
        type(carried_assembly), intent(inout) :: there
        integer :: i

        if (.not. assembly%is_needed) return
        if (.not. there%is_needed) then
            there%is_needed = .true.
            there%is_at_start = assembly%is_at_start
            there%q = assembly%q
            there%quaternion = assembly%quaternion
            there%branch = assembly%branch
            there%margin = assembly%margin
            there%drift = assembly%drift
            there%side = assembly%side
            if (allocated(assembly%clear)) there%clear = assembly%clear
            if (allocated(assembly%place)) there%place = assembly%place
            if (allocated(assembly%column)) there%column = assembly%column
        end if
        there%closer => assembly%closer
        there%t(lane:) = assembly%t(1)
        there%n_crossed(lane:) = assembly%n_crossed(1)
        do i = lane, lanes
            there%q(i, :) = assembly%q(1, :)
            there%quaternion(i, :, :) = assembly%quaternion(1, :, :)
            there%branch(i, :) = assembly%branch(1, :)
            there%margin(i, :) = assembly%margin(1, :)
            there%drift(i, :) = assembly%drift(1, :)
            there%side(i, :) = assembly%side(1, :)
            if (allocated(assembly%clear)) there%clear(:, i) = assembly%clear(:, 1)
            if (allocated(assembly%place)) there%place(i, :, :) = assembly%place(1, :, :)
            if (allocated(assembly%column)) there%column(i, :, :, :) = assembly%column(1, :, :, :)
        end do
    end subroutine leave_standing

    !> Kinematics of a state tried; on the assembly that leads there, if there are several.
    subroutine evaluate_assembled(model, t, assembly, state)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: t(lanes)               !! [s]
        type(carried_assembly), intent(inout) :: assembly
        type(kinematic_state), intent(inout) :: state

        if (assembly%is_needed) then
            call evaluate_on_assembly(model, t, assembly, state)
        else
            call evaluate_kinematics(model, state)
        end if
    end subroutine evaluate_assembled

    !> Kinematics of a state tried, on the assembly that leads there: to where a run begins from the scene's start, without the full
    !> turns that lead nowhere, as to a sample on its own.
    subroutine evaluate_on_assembly(model, t, assembly, state)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: t(lanes)               !! [s]
        type(carried_assembly), intent(inout) :: assembly
        type(kinematic_state), intent(inout) :: state
        type(way_report) :: report
        real(wp), dimension(lanes, n_map(model)) :: margin, drift
        real(wp) :: from(lanes, model%n_q)
        logical :: doubtful(lanes), arrives(lanes)

        if (assembly%is_at_start) then
            assembly%q = turned_to(model, assembly%q, state%q)
            if (allocated(assembly%clear)) assembly%clear = spread(assembly%q(:, 1), 1, 2)
        end if
        if (model%n_branch > 0) state%branch = assembly%branch
        state%way_status = sample_ok
        if (size(model%group) > 0) then
            call predict_places(model, assembly, state)
            if (associated(assembly%closer)) call close_ahead(model, assembly%closer, state)
            state%group%moves = .true.
        end if
        call run_program(model, state)
        assembly%n_crossed_tried = 0
        doubtful = is_doubtful(model, assembly, t, state)
        if (allocated(assembly%clear)) doubtful = doubtful .and. (state%unreachable .or. .not. is_clear(assembly, state%q(:, 1)))
        where (state%out_of_reach)
            state%way_status = sample_unreachable
            doubtful = .false.
        end where
        if (.not. any(doubtful)) return
        call stand_where(model, doubtful, assembly, state)
        state%group%closer => assembly%closer
        from = assembly%q
        if (allocated(assembly%clear)) from(:, 1) = max(assembly%clear(1, :), min(assembly%clear(2, :), state%q(:, 1)))
        if (assembly%is_at_start) then
            call lead_mechanism(model, doubtful, from, .true., state, report, assembly%quaternion)
        else
            call lead_mechanism(model, doubtful, from, .true., state, report, assembly%quaternion, longest=longest_step)
        end if
        nullify (state%group%closer)
        assembly%n_crossed_tried = report%n_crossed
        if (.not. model%scene%passes_change_points) then
            where (report%outcome == way_at_singularity) report%outcome = way_forks
        end if
        arrives = report%outcome == way_arrived .or. report%outcome == way_at_singularity
        where (doubtful .and. .not. arrives) state%way_status = status_of_way(report%outcome)
        where (state%way_status == sample_branch_lost) assembly%map_lost = report%map
        if (size(model%group) > 0) state%group%moves = arrives
        call run_program(model, state)
        if (.not. allocated(assembly%clear)) return
        call measure_margins(model, state, margin, drift)
        call note_clear(doubtful .and. report%outcome == way_arrived .and. report%n_crossed == 0 &
                        .and. all(state%branch == assembly%branch, dim=2) .and. are_told(model, margin), state%q(:, 1), assembly)
    end subroutine evaluate_on_assembly

    !> Has the way to where the coordinate is been followed?
    pure function is_clear(assembly, q)
        type(carried_assembly), intent(in) :: assembly
        real(wp), intent(in) :: q(lanes)
        logical :: is_clear(lanes)

        is_clear = q >= assembly%clear(1, :) .and. q <= assembly%clear(2, :)
    end function is_clear

    !> The way from the accepted state to where the coordinate is, on some lanes, meets no change point.
    pure subroutine note_clear(is_sound, q, assembly)
        logical, intent(in) :: is_sound(lanes)
        real(wp), intent(in) :: q(lanes)
        type(carried_assembly), intent(inout) :: assembly

        where (is_sound)
            assembly%clear(1, :) = min(assembly%clear(1, :), q)
            assembly%clear(2, :) = max(assembly%clear(2, :), q)
        end where
    end subroutine note_clear

    !> The groups' links where the tangent at the accepted position leads.
    subroutine predict_places(model, assembly, state)
        type(model_type), intent(in) :: model
        type(carried_assembly), intent(in) :: assembly
        type(kinematic_state), intent(inout) :: state
        real(wp) :: span(lanes, model%n_q), shift(lanes, link_freedom(model))
        integer :: g, i, k

        span = span_of(model, state, assembly%q, assembly%quaternion)
        do g = 1, size(model%group)
            do i = 1, size(model%group(g)%link)
                associate (l => model%group(g)%link(i))
                    shift = 0
                    do k = 1, model%n_q
                        shift = shift + spread(span(:, k), 2, link_freedom(model))*assembly%column(:, :, l, k)
                    end do
                    state%group%place(:, :, l) = led_link(model, model%group(g), i, assembly%place(:, :, l), shift)
                end associate
            end do
        end do
    end subroutine predict_places

    !> The groups' links where somebody else's steps lead from there: lanes find little left to do. What does not converge as it
    !> must stays where it is predicted.
    subroutine close_ahead(model, closer, state)
        type(model_type), intent(in) :: model
        class(group_closer), intent(in) :: closer
        type(kinematic_state), intent(inout) :: state
        real(wp) :: at(model%n_q, lanes), branch(model%n_branch, lanes), place(place_size(model), model%n_link, lanes)
        real(wp) :: margin(size(model%group), lanes)
        logical :: is_closed(lanes)
        integer :: lane, g

        at = transpose(state%q)
        if (model%n_branch > 0) branch = transpose(state%branch)
        do lane = 1, lanes
            place(:, :, lane) = state%group%place(lane, :, :)
        end do
        is_closed = .true.
        call close_places(model, closer, at, branch, place, margin, is_closed)
        do lane = 1, lanes
            if (.not. is_closed(lane)) cycle
            do g = 1, size(model%group)
                associate (link => model%group(g)%link)
                    state%group%place(lane, :, link) = place(:, link, lane)
                end associate
            end do
        end do
    end subroutine close_ahead

    !> The doubtful lanes back to the accepted assembly, where their way begins.
    subroutine stand_where(model, doubtful, assembly, state)
        type(model_type), intent(in) :: model
        logical, intent(in) :: doubtful(lanes)
        type(carried_assembly), intent(in) :: assembly
        type(kinematic_state), intent(inout) :: state
        integer :: k, l

        if (size(model%group) == 0) return
        do l = 1, model%n_link
            do k = 1, size(assembly%place, 2)
                where (doubtful) state%group%place(:, k, l) = assembly%place(:, k, l)
            end do
        end do
    end subroutine stand_where

    !> Is the step from the accepted state to the one tried not to be believed as it is?
    function is_doubtful(model, assembly, t, state) result(doubtful)
        type(model_type), intent(in) :: model
        type(carried_assembly), intent(in) :: assembly
        real(wp), intent(in) :: t(lanes)
        type(kinematic_state), intent(in) :: state
        logical :: doubtful(lanes)
        real(wp), dimension(lanes, n_map(model)) :: margin, drift
        real(wp) :: ahead(lanes), least(n_map(model))
        real(wp) :: way(lanes, model%n_q), doubt(lanes)
        integer :: m

        doubt = 0
        way = span_of(model, state, assembly%q, assembly%quaternion)
        do m = 1, merge(model%n_q, 0, model%n_branch > 0)      ! groups' corrections from the tangent tell
            call note_far(lanes, spread(0.0_wp, 1, lanes), way(:, m), model%stride(m), doubt)
        end do
        ahead = t - assembly%t
        call measure_margins(model, state, margin, drift)
        ! On the wrong branch the loops behind the dyad may not close.
        doubtful = state%unreachable
        if (size(model%group) > 0) then
            doubtful = doubtful .or. state%not_converged .or. .not. state%group%contraction <= largest_contraction
            do m = model%n_branch + 1, size(margin, 2)
                drift(:, m) = secant(assembly%margin(:, m), margin(:, m), ahead)
            end do
        end if
        least = model%least_margin
        do m = 1, size(margin, 2)
            call note_doubt(lanes, model%scene%passes_change_points, least(m), assembly%margin(:, m), assembly%drift(:, m), &
                            margin(:, m), drift(:, m), ahead, doubt)
        end do
        doubtful = doubtful .or. doubt > 0
    end function is_doubtful

    !> How far a step may be meant to go, so that its stages do tell of the assembly.
    pure elemental real(wp) function longest_way(stride)
        real(wp), intent(in) :: stride
        real(wp), parameter :: well_within = 0.45_wp   !! rates grow on the way

        longest_way = well_within*farthest_way(stride)
    end function longest_way

    !> How far a coordinate may get on a way whose end tells of the assembly.
    pure elemental real(wp) function farthest_way(stride)
        real(wp), intent(in) :: stride

        farthest_way = farthest_told*stride
    end function farthest_way

    !> Doubt grows where a coordinate's way is so far that its end does not tell of the assembly.
    pure subroutine note_far(n, accepted, tried, stride, doubt)
        integer, intent(in) :: n                       !! lanes
        real(wp), intent(in) :: accepted(n), tried(n)
        real(wp), intent(in) :: stride
        real(wp), intent(inout) :: doubt(n)
        integer :: lane

        do lane = 1, n
            doubt(lane) = doubt(lane) + merge(1.0_wp, 0.0_wp, abs(tried(lane) - accepted(lane)) > farthest_way(stride))
        end do
    end subroutine note_far

    !> Doubt grows where a map may have left its assembly on the steps to states tried, one a lane.
    pure subroutine note_doubt(n, passes_change_points, least_margin, before, drift_before, now, drift_now, ahead, doubt)
        integer, intent(in) :: n                       !! lanes
        logical, intent(in) :: passes_change_points
        real(wp), intent(in) :: least_margin
        real(wp), intent(in), dimension(n) :: before, drift_before     !! accepted margins; their rates [1/s]
        real(wp), intent(in), dimension(n) :: now, drift_now           !! tried
        real(wp), intent(in) :: ahead(n)               !! how long the steps are [s]
        real(wp), intent(inout) :: doubt(n)

        call doubt_unsound(n, least_margin, before, drift_before, now, drift_now, ahead, doubt)
        ! From where it is not told on which side it is, a mechanism would leave to either.
        if (.not. passes_change_points) doubt = doubt + merge(1.0_wp, 0.0_wp, abs(now) <= least_margin)
    end subroutine note_doubt

    !> Go on to a new accepted state: `assembly%state` holds its coordinates and rates.
    subroutine accept_assembly(model, t, is_accepted, assembly)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: t(lanes)               !! [s]
        logical, intent(in) :: is_accepted(lanes)      !! other lanes stay where they are
        type(carried_assembly), intent(inout) :: assembly
        real(wp), dimension(lanes, n_map(model)) :: margin, drift
        logical :: goes(lanes)
        integer :: g, i, k

        call evaluate_on_assembly(model, t, assembly, assembly%state)
        call measure_margins(model, assembly%state, margin, drift)
        associate (state => assembly%state)
            goes = is_accepted .and. .not. (state%unreachable .or. state%not_converged .or. state%branch_lost)
            do g = 1, size(model%group)
                do i = 1, size(model%group(g)%link)
                    associate (l => model%group(g)%link(i))
                        do k = 1, model%n_q
                            assembly%column(:, :, l, k) = merge(place_rates(model, state, l, k), assembly%column(:, :, l, k), &
                                                                spread(goes, 2, link_freedom(model)))
                        end do
                    end associate
                end do
            end do
        end associate
        call go_on_to_state(model, t, goes, margin, drift, assembly)
    end subroutine accept_assembly

    !> The same where somebody else has looked at the accepted states, and left no doubt that they are on this assembly. The groups'
    !> links are at one place on all lanes. `assembly%state` holds coordinates and rates, no more.
    subroutine accept_seen(model, t, is_accepted, margin, drift, place, column, assembly)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: t(lanes)               !! [s]
        logical, intent(in) :: is_accepted(lanes)
        real(wp), intent(in), contiguous :: margin(:, :)           !! (lane, n_map)
        real(wp), intent(in) :: drift(:, :)            !! of the closed forms [1/s] (lane, n_branch)
        real(wp), intent(in) :: place(:, :)            !! of the groups' links (place_size, n_link)
        real(wp), intent(in) :: column(:, :, :)        !! likewise, rates (link_freedom, n_link, n_q)
        type(carried_assembly), intent(inout) :: assembly
        real(wp) :: drifts(lanes, n_map(model))
        integer :: g, i, k

        drifts = 0
        drifts(:, :model%n_branch) = drift
        if (model%n_branch > 0) assembly%state%branch = assembly%branch
        do g = 1, size(model%group)
            do i = 1, size(model%group(g)%link)
                associate (l => model%group(g)%link(i))
                    assembly%state%group%place(:, :, l) = spread(place(:, l), 1, lanes)
                    do k = 1, model%n_q
                        assembly%column(:, :, l, k) = merge(spread(column(:, l, k), 1, lanes), assembly%column(:, :, l, k), &
                                                            spread(is_accepted, 2, link_freedom(model)))
                    end do
                end associate
            end do
        end do
        assembly%n_crossed_tried = 0
        call go_on_to_state(model, t, is_accepted, margin, drifts, assembly)
    end subroutine accept_seen

    !> The state of the assembly is where the next steps set out from.
    subroutine go_on_to_state(model, t, goes, margin, drift, assembly)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: t(lanes)               !! [s]
        logical, intent(in) :: goes(lanes)             !! other lanes stay where they are
        real(wp), intent(in), contiguous :: margin(:, :)           !! (lane, n_map)
        real(wp), intent(inout), contiguous :: drift(:, :)         !! its rate [1/s]; that of groups is found here (lane, n_map)
        type(carried_assembly), intent(inout) :: assembly
        logical :: all_go
        integer :: g, i, m, n_crossed(lanes)

        all_go = all(goes)
        if (any(goes)) assembly%is_at_start = .false.
        n_crossed = assembly%n_crossed
        do m = model%n_branch + 1, size(margin, 2)
            drift(:, m) = secant(assembly%margin(:, m), margin(:, m), t - assembly%t)
        end do
        call count_crossings(model, margin, goes, assembly)
        if (allocated(assembly%clear)) &
            call keep_clear(model, margin, goes, assembly%n_crossed /= n_crossed &
                            .or. any(assembly%state%branch /= assembly%branch, dim=2), assembly%state%q(:, 1), assembly)
        call forget_map_lost(model, margin, goes, assembly%map_lost)
        call go_on(1, all_go, goes, t, assembly%t)
        call go_on(size(margin, 2), all_go, goes, margin, assembly%margin)
        call go_on(size(margin, 2), all_go, goes, drift, assembly%drift)
        associate (state => assembly%state)
            call go_on(model%n_q, all_go, goes, state%q, assembly%q)
            call go_on(4*model%n_attitude, all_go, goes, state%quaternion, assembly%quaternion)
            call go_on(model%n_branch, all_go, goes, state%branch, assembly%branch)
            do g = 1, size(model%group)
                do i = 1, size(model%group(g)%link)
                    associate (l => model%group(g)%link(i))
                        call go_on(size(assembly%place, 2), all_go, goes, state%group%place(:, :, l), assembly%place(:, :, l))
                    end associate
                end do
            end do
        end associate
    end subroutine go_on_to_state

    !> What is clear seen from a new accepted state: where a change point has been passed, or is too near to tell, nothing but that.
    pure subroutine keep_clear(model, margin, goes, has_crossed, q, assembly)
        type(model_type), intent(in) :: model
        real(wp), intent(in), contiguous :: margin(:, :)           !! (lane, n_map)
        logical, intent(in), dimension(lanes) :: goes, has_crossed
        real(wp), intent(in) :: q(lanes)
        type(carried_assembly), intent(inout) :: assembly
        logical :: is_told(lanes)
        integer :: m

        is_told = .not. has_crossed .and. are_told(model, margin)
        call note_clear(goes .and. is_told, q, assembly)
        do m = 1, 2
            where (goes .and. .not. is_told) assembly%clear(m, :) = q
        end do
    end subroutine keep_clear

    !> Can all margins be told from zero?
    pure function are_told(model, margin)
        type(model_type), intent(in) :: model
        real(wp), intent(in), contiguous :: margin(:, :)           !! (lane, n_map)
        logical :: are_told(lanes)
        integer :: m

        are_told = .true.
        do m = 1, size(margin, 2)
            are_told = are_told .and. abs(margin(:, m)) > model%least_margin(m)
        end do
    end function are_told

    !> Numbers of the lanes that go are what they have come to.
    pure subroutine go_on(n, all_go, goes, come_to, x)
        integer, intent(in) :: n
        logical, intent(in) :: all_go
        logical, intent(in) :: goes(lanes)
        real(wp), intent(in) :: come_to(lanes, n)
        real(wp), intent(inout) :: x(lanes, n)
        integer :: k

        if (all_go) then
            x = come_to
        else
            do k = 1, n
                x(:, k) = merge(come_to(:, k), x(:, k), goes)
            end do
        end if
    end subroutine go_on

    !> Change points passed by an accepted step.
    subroutine count_crossings(model, margin, goes, assembly)
        type(model_type), intent(in) :: model
        real(wp), intent(in), contiguous :: margin(:, :)           !! (lane, n_map)
        logical, intent(in) :: goes(lanes)
        type(carried_assembly), intent(inout) :: assembly
        integer :: m

        where (goes) assembly%n_crossed = assembly%n_crossed + crossed(model, assembly, margin)
        do m = 1, size(margin, 2)
            associate (least => model%least_margin(m))
                call take_sides(goes, margin(:, m), least, assembly%side(:, m))
            end associate
        end do
    end subroutine count_crossings

    !> Of the lanes that go, where a margin can be told from zero.
    pure subroutine take_sides(goes, margin, least, side)
        logical, intent(in) :: goes(lanes)
        real(wp), intent(in) :: margin(lanes), least
        real(wp), intent(inout) :: side(lanes)
        integer :: lane

        do lane = 1, lanes
            side(lane) = merge(margin(lane), side(lane), goes(lane) .and. abs(margin(lane)) > least)
        end do
    end subroutine take_sides

    !> Change points between the accepted state and the one evaluated last: those of the way to it, or, where it set out from
    !> too near one to tell, those seen by the sides on which the mechanism was and is. Loops that lie flat together, as those of
    !> a row of parallelograms do, are at one change point.
    pure function crossed(model, assembly, margin) result(n)
        type(model_type), intent(in) :: model
        type(carried_assembly), intent(in) :: assembly
        real(wp), intent(in), contiguous :: margin(:, :)           !! (lane, n_map)
        integer :: n(lanes)
        integer :: n_seen(lanes)                       ! maps that are on their other sides
        integer :: lane, m

        n = assembly%n_crossed_tried
        n_seen = 0
        do m = 1, size(margin, 2)
            n_seen = n_seen + merge(1, 0, is_crossed(assembly%side(:, m), margin(:, m), model%least_margin(m)))
        end do
        if (all(n_seen == 0)) return
        do lane = 1, lanes
            if (n_seen(lane) == 0) cycle
            associate (side => assembly%side(lane, :), now => margin(lane, :))
                n(lane) = max(n(lane), number_of_places(pack(side, is_crossed(side, now, model%least_margin)), &
                                                        pack(now, is_crossed(side, now, model%least_margin))))
            end associate
        end do
    end function crossed

    !> Is a margin that can be told from zero on the other side of it?
    elemental logical function is_crossed(side, margin, least)
        real(wp), intent(in) :: side, margin, least

        is_crossed = abs(margin) > least .and. side*margin < 0
    end function is_crossed

    !> At how many places margins change their signs between two states, as far as straight lines can tell.
    pure integer function number_of_places(before, now) result(n)
        real(wp), intent(in) :: before(:), now(:)      !! of opposite signs
        real(wp), parameter :: together = 0.01_wp      !! of the way
        real(wp) :: place(size(now))
        integer :: m

        place = before/(before - now)
        n = 0
        do m = 1, size(place)
            if (all(abs(place(:m - 1) - place(m)) > together)) n = n + 1
        end do
    end function number_of_places

    !> Change points passed since the start up to the state evaluated last, which may lie before the one accepted: a step that has
    !> to pass a rough place goes beyond the samples within it.
    function count_passed(model, t, assembly, state) result(n)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: t(lanes)               !! of the state [s]
        type(carried_assembly), intent(in) :: assembly
        type(kinematic_state), intent(in) :: state
        integer :: n(lanes)
        real(wp), dimension(lanes, n_map(model)) :: margin, drift

        n = assembly%n_crossed
        if (.not. assembly%is_needed) return
        call measure_margins(model, state, margin, drift)
        n = n + merge(1, -1, t >= assembly%t)*crossed(model, assembly, margin)
    end function count_passed

    !> A change point that was tried counts until the mechanism has got away from it.
    subroutine forget_map_lost(model, margin, goes, map_lost)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: margin(:, :)           !! (lane, n_map)
        logical, intent(in) :: goes(lanes)
        integer, intent(inout) :: map_lost(lanes)
        real(wp), parameter :: away = 1000             !! least margins: a step that ends so near is the last before steps vanish
        real(wp) :: least(n_map(model))
        integer :: lane

        if (all(map_lost == 0)) return
        least = model%least_margin
        do lane = 1, lanes
            associate (m => map_lost(lane))
                if (m == 0 .or. .not. goes(lane)) cycle
                if (abs(margin(lane, m)) > away*least(m)) m = 0
            end associate
        end do
    end subroutine forget_map_lost

    !> Rate of a margin between two instants; 0 where that before says nothing.
    elemental real(wp) function secant(before, now, duration) result(rate)
        real(wp), intent(in) :: before, now
        real(wp), intent(in) :: duration               !! [s]

        rate = 0
        if (before*now > 0 .and. duration /= 0) rate = (now - before)/duration
    end function secant

    !> The assembly of a lane of a state evaluated, for a sample; and whether change points have been passed since the one before.
    subroutine keep_evaluated(model, t, assembly, state, lane, sample, samples, n_crossed)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: t                      !! of the sample [s]
        type(carried_assembly), intent(in) :: assembly
        type(kinematic_state), intent(in) :: state
        integer, intent(in) :: lane, sample
        type(sample_assembly), intent(inout) :: samples
        integer, intent(inout) :: n_crossed            !! change points, up to the sample before, to this one
        integer :: passed(lanes)

        if (.not. assembly%is_needed) return
        call keep_lane(model, state, lane, sample, samples)
        passed = count_passed(model, spread(t, 1, lanes), assembly, state)
        if (passed(lane) /= n_crossed) samples%reached(sample) = reached_crossing
        n_crossed = passed(lane)
    end subroutine keep_evaluated
end module linkdyn_carried_assembly
