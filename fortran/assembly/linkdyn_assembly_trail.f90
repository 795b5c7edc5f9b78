!> The assembly along a motion: for each sample the branches of the closed forms and where the groups' links are.
!>
!> Samples are looked at in their order, `lanes` at a time. A step from one to the next that the rule of
!> `linkdyn_following` does not believe at once is led along the straight way in the space of the coordinates, in steps as
!> short as need be: first side by side with others, in a few tries, then on its own. A sample to which the way does not
!> lead keeps the status that says so.
!>
!> After such a stretch the motion goes on from the last sample before it, if a straight way leads on from there. Else
!> it begins anew at the first sample that is reached from the scene's start, as a sample on its own is. A way that leads
!> through where another one ended is not gone (`linkdyn_dead_end`): samples far beyond the end of an assembly cost little.
!>
!> A sample on its own, outside a motion, has the branches of the start, and its groups are led from the start. Where the
!> groups have come to is known of the samples of a motion, and of others after `settle_samples` (`linkdyn_settled_samples`).
!>
!> Where somebody has margins for many places at a time, steps are judged by them as far as they are believed.
module linkdyn_assembly_trail
    use linkdyn_agreement, only: agreement
    use linkdyn_constants, only: golden, least_accuracy
    use linkdyn_dead_end, only: dead_ends, is_end
    use linkdyn_following, only: way_report, is_step_sound, way_arrived
    use linkdyn_group_motion, only: group_closer
    use linkdyn_interrupt, only: is_interrupted
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_pass, only: run_program
    use linkdyn_kinematic_state, only: kinematic_state, prepare_kinematics, velocities_only
    use linkdyn_lane_count, only: lanes
    use linkdyn_led_mechanism, only: evaluate_kinematics, lead_mechanism, status_of_way, measure_margins, &
        follows_assembly, is_way_short, nearest_start
    use linkdyn_margin_source, only: margin_source
    use linkdyn_model, only: model_type, place_size, link_freedom
    use linkdyn_steps_on_lanes, only: place_rates
    use linkdyn_planar_motion, only: level_velocity
    use linkdyn_stride, only: stride_type, make_stride, is_close
    use linkdyn_status, only: sample_ok, sample_unreachable, sample_not_converged, sample_branch_lost
    use linkdyn_whole_turns, only: with_turns
    implicit none (type, external)
    private
    public :: assembly_trail, sample_assembly, lost_way, follow_assembly, longest_stride, make_room, place_sample, &
        keep_lane, begin_trail, judges_like_lanes, start_places
    public :: reached_straight, reached_crossing, reached_anew, reached_name

    integer, parameter :: shortest_stride = 64    !! samples

    ! ---- how a sample was reached
    integer, parameter :: reached_straight = 0    !! by continuity from the sample before, or it is on its own
    integer, parameter :: reached_crossing = 1    !! through a change point
    integer, parameter :: reached_anew = 2        !! from the start, after samples that could not be reached
    character(len=12), parameter :: reached_name(0:2) = [character(len=12) :: "continuous", "change_point", "anew"]

    !> A way on which an assembly was lost: from the last place that was reached.
    type :: lost_way
        integer :: sample = 0                       !! to which it was to lead; 0: none was lost
        integer :: status = sample_ok               !! one of `sample_*`
        integer :: map = 0                          !! at fault; 0: none in particular
        real(wp) :: reached = 0                     !! part of the way
        real(wp), allocatable :: from(:), to(:)     !! (n_q)
        real(wp), allocatable :: branch(:)          !! at its beginning (n_branch)
        real(wp), allocatable :: place(:, :)        !! (place_size, n_link)
    end type lost_way

    !> On which assembly each of some samples is to be computed.
    type :: sample_assembly
        real(wp), allocatable :: branch(:, :)       !! (n_branch, n)
        real(wp), allocatable :: q(:, :)            !! coordinates at which groups set out (n_q, n)
        real(wp), allocatable :: place(:, :, :)     !! of their links there (place_size, n_link, n); of samples that follow others
                                                    !! from 0 on
        real(wp), allocatable :: margin(:, :)       !! of the groups at the sample; 0: not there yet (n_group, n)
        integer, allocatable :: status(:)           !! one of `sample_*`: not ok where the assembly was not followed to (n)
        integer, allocatable :: reached(:)          !! one of `reached_*` (n)
        type(lost_way) :: lost                      !! the first
        real(wp), allocatable :: counted(:, :)      !! see `kinematic_state`; absent: no coordinate stands in (n_q, n)
    end type sample_assembly

    !> Where the motion stood last.
    type :: assembly_trail
        logical :: has_begun = .false.
        logical :: is_needed = .false.              !! the assembly may change
        logical :: is_lost = .false.                !! the last samples could not be reached
        logical :: stays = .false.                  !! what no way leads to is left: it does not begin anew from the scene's start
        integer :: n_crossed = 0                    !! change points passed up to the last sample that was
        real(wp), allocatable :: q(:)               !! of the last sample that was (n_q)
        real(wp), allocatable :: branch(:)          !! (n_branch)
        real(wp), allocatable :: place(:, :)        !! (place_size, n_link)
        type(kinematic_state) :: state
        type(stride_type) :: stride                 !! scratch
        ! ---- ends of the assembly, while it is lost
        type(dead_ends) :: beyond_last              !! on ways from the last sample that could be reached
        type(dead_ends) :: beyond_start             !! on ways from the scene's start, for groups
        integer :: n_way = 0                        !! ways gone in search of samples, so far
    end type assembly_trail

contains

    !> Room for n samples, on the assembly of the start.
    subroutine make_room(model, n, assembly)
        type(model_type), intent(in) :: model
        integer, intent(in) :: n
        type(sample_assembly), intent(out) :: assembly
        real(wp) :: start(place_size(model), model%n_link)
        integer :: i

        call allocate_room(model, 1, n, assembly)
        do i = 1, n
            assembly%branch(:, i) = model%branch
        end do
        if (size(model%group) == 0) return
        start = start_places(model)
        do i = 1, n
            assembly%q(:, i) = model%start_q
            assembly%place(:, :, i) = start
            assembly%margin(:, i) = 0
        end do
    end subroutine make_room

    !> The same for samples of which each is given its assembly.
    subroutine allocate_room(model, first, n, assembly)
        type(model_type), intent(in) :: model
        integer, intent(in) :: first                !! place
        integer, intent(in) :: n
        type(sample_assembly), intent(out) :: assembly
        logical :: is_led(model%n_link)              ! by a group
        integer :: g, l

        allocate (assembly%branch(size(model%branch), n))
        allocate (assembly%status(n), source=sample_ok)
        allocate (assembly%reached(n), source=reached_straight)
        if (size(model%group) == 0) return
        allocate (assembly%q(model%n_q, n), assembly%margin(size(model%group), n))
        allocate (assembly%place(place_size(model), model%n_link, first:n))
        is_led = .false.
        do g = 1, size(model%group)
            is_led(model%group(g)%link) = .true.
        end do
        do l = 1, model%n_link
            if (.not. is_led(l)) assembly%place(:, l, :) = 0
        end do
    end subroutine allocate_room

    !> Places of the groups' links at the start; zero for other links.
    pure function start_places(model) result(place)
        type(model_type), intent(in) :: model
        real(wp) :: place(place_size(model), model%n_link)
        integer :: g

        place = 0
        do g = 1, size(model%group)
            place(:, model%group(g)%link) = model%group(g)%start
        end do
    end function start_places

    !> Put a lane of the state on the assembly of a sample.
    subroutine place_sample(model, assembly, sample, lane, state)
        type(model_type), intent(in) :: model
        type(sample_assembly), intent(in) :: assembly
        integer, intent(in) :: sample, lane
        type(kinematic_state), intent(inout) :: state

        if (model%n_branch > 0) state%branch(lane, :) = assembly%branch(:, sample)
        state%way_status(lane) = assembly%status(sample)
        if (allocated(assembly%counted)) state%counted(lane, :) = assembly%counted(:, sample)
        if (size(model%group) == 0) return
        state%group%start_q(lane, :) = assembly%q(:, sample)
        state%group%start_place(lane, :, :) = assembly%place(:, :, sample)
    end subroutine place_sample

    !> Where a lane's groups have been closed, for a sample.
    subroutine keep_lane(model, state, lane, sample, assembly)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        integer, intent(in) :: lane, sample
        type(sample_assembly), intent(inout) :: assembly

        if (model%n_branch > 0) assembly%branch(:, sample) = state%branch(lane, :)
        if (size(model%group) == 0) return
        assembly%q(:, sample) = with_turns(state%q(lane, :), state%turns(lane, :))
        assembly%place(:, :, sample) = state%group%place(lane, :, :)
        assembly%margin(:, sample) = state%group%margin(lane, :)
    end subroutine keep_lane

    !> Begin at the scene's start.
    subroutine begin_trail(model, trail)
        type(model_type), intent(in) :: model
        type(assembly_trail), intent(inout) :: trail

        trail%has_begun = .true.
        trail%is_needed = follows_assembly(model)
        if (.not. trail%is_needed) return
        trail%q = model%start_q
        trail%branch = model%branch
        trail%place = start_places(model)
        call prepare_kinematics(model, 0, trail%state)
    end subroutine begin_trail

    !> Assembly at samples that follow each other and those of the last call.
    subroutine follow_assembly(model, q, trail, assembly, margins, closer)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: q(:, :)              !! (n_q, n)
        type(assembly_trail), intent(inout) :: trail
        type(sample_assembly), intent(out) :: assembly
        class(margin_source), pointer, intent(in), optional :: margins    !! of closed forms, at many places at once
        class(group_closer), pointer, intent(in), optional :: closer      !! makes the groups' steps; null or absent: nobody else
        class(margin_source), pointer :: forms
        integer :: n_done, goal, stride, longest
        logical :: strides

        if (.not. trail%has_begun) call begin_trail(model, trail)
        if (.not. trail%is_needed) then
            call make_room(model, size(q, 2), assembly)
            return
        end if
        call allocate_room(model, 0, size(q, 2), assembly)
        nullify (forms)
        if (present(margins)) forms => margins
        if (present(closer)) trail%state%group%closer => closer
        strides = (associated(forms) .or. model%n_branch == 0) .and. &
                  (associated(trail%state%group%closer) .or. size(model%group) == 0)
        n_done = 0
        longest = longest_stride(model)
        stride = longest
        do while (n_done < size(q, 2))
            if (is_interrupted()) then
                call leave_rest(model, trail, n_done, assembly)
                exit
            end if
            if (trail%is_lost) then
                call search_on(model, q, trail, assembly, n_done)
                cycle
            end if
            if (strides) then
                goal = min(n_done + stride, size(q, 2))
                stride = min(longest, 2*stride)
                call stride_on(model, q(:, n_done + 1:goal), trail, assembly, n_done, forms)
                if (n_done == goal) cycle
                ! Where lanes have to help, what lies beyond may be in vain.
                stride = shortest_stride
            end if
            call go_on(model, q, trail, assembly, n_done)
        end do
        nullify (trail%state%group%closer)
    end subroutine follow_assembly

    !> Nobody goes on to the samples that are left.
    subroutine leave_rest(model, trail, n_done, assembly)
        type(model_type), intent(in) :: model
        type(assembly_trail), intent(in) :: trail
        integer, intent(in) :: n_done                !! samples dealt with
        type(sample_assembly), intent(inout) :: assembly
        integer :: i

        assembly%status(n_done + 1:) = sample_not_converged
        do i = n_done + 1, size(assembly%status)
            assembly%branch(:, i) = trail%branch
            if (size(model%group) == 0) cycle
            assembly%q(:, i) = trail%q
            assembly%place(:, :, i) = trail%place
            assembly%margin(:, i) = 0
        end do
    end subroutine leave_rest

    !> Samples of a stride: what is found of them stays in the cache.
    pure integer function longest_stride(model)
        type(model_type), intent(in) :: model
        integer, parameter :: room = 30000           !! numbers
        integer :: n

        n = model%n_q + model%n_branch
        if (size(model%group) > 0) n = n + place_size(model)*model%n_link
        longest_stride = shortest_stride*max(1, room/(shortest_stride*max(1, n)))
    end function longest_stride

    !> The trail has come to a lane's place.
    subroutine come_to(model, lane, q, trail)
        type(model_type), intent(in) :: model
        integer, intent(in) :: lane
        real(wp), intent(in) :: q(:)                 !! of the sample (n_q)
        type(assembly_trail), intent(inout) :: trail

        trail%is_lost = .false.
        call trail%beyond_last%forget()
        trail%q = q
        if (model%n_branch > 0) trail%branch = trail%state%branch(lane, :)
        if (size(model%group) > 0) trail%place = trail%state%group%place(lane, :, :)
    end subroutine come_to

    !> Put all lanes where the trail stands.
    subroutine stand_on_lanes(model, trail)
        type(model_type), intent(in) :: model
        type(assembly_trail), intent(inout) :: trail

        if (model%n_branch > 0) trail%state%branch = spread(trail%branch, 1, lanes)
        if (size(model%group) > 0) trail%state%group%place = spread(trail%place, 1, lanes)
        trail%state%way_status = sample_ok
    end subroutine stand_on_lanes

    ! ---------------------------------------------------------------- from sample to sample

    !> Take the next samples as long as every step is believed; if not even one is, lead the mechanism to it.
    subroutine go_on(model, q, trail, assembly, n_done)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: q(:, :)              !! (n_q, n)
        type(assembly_trail), intent(inout) :: trail
        type(sample_assembly), intent(inout) :: assembly
        integer, intent(inout) :: n_done             !! samples dealt with
        real(wp) :: at(lanes, model%n_q)
        logical :: is_closed(lanes), is_believed(lanes)
        integer :: n, lane, last

        ! The first lane stands where the trail does; lanes beyond the last sample repeat it.
        n = min(lanes - 1, size(q, 2) - n_done)
        at(1, :) = trail%q
        do lane = 2, lanes
            at(lane, :) = q(:, n_done + min(lane - 1, n))
        end do
        call judge_steps(model, at, n + 1, trail, is_closed, is_believed)
        if (.not. all(is_believed(2:n + 1))) call lead_steps(model, at, n + 1, is_closed, trail, is_believed)
        last = findloc([is_believed(2:n + 1), .false.], .false., dim=1)
        do lane = 2, last
            call keep_lane(model, trail%state, lane, n_done + lane - 1, assembly)
        end do
        n_done = n_done + last - 1
        if (last > 1) then
            call come_to(model, last, at(last, :), trail)
        else
            n_done = n_done + 1
            call lead_on(model, q(:, n_done), n_done, trail, assembly)
        end if
    end subroutine go_on

    !> Take the next samples, as long as every step is believed.
    subroutine stride_on(model, q, trail, assembly, n_done, margins)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: q(:, :)              !! of the next samples (n_q, n)
        type(assembly_trail), intent(inout) :: trail
        type(sample_assembly), intent(inout) :: assembly
        integer, intent(inout) :: n_done             !! samples dealt with
        class(margin_source), pointer, intent(in) :: margins    !! null: there are no closed forms
        real(wp) :: nowhere(0, 0, 0)
        integer :: n, i

        associate (closer => trail%state%group%closer)
            if (size(model%group) > 0) then
                assembly%place(:, :, n_done) = trail%place
                call make_stride(model, trail%q, q, trail%branch, closer, margins, &
                                 assembly%place(:, :, n_done:n_done + size(q, 2)), trail%stride)
            else
                call make_stride(model, trail%q, q, trail%branch, closer, margins, nowhere, trail%stride)
            end if
        end associate
        n = trail%stride%n_believed
        do i = n_done + 1, n_done + n
            assembly%branch(:, i) = trail%branch
        end do
        if (size(model%group) > 0) then
            assembly%q(:, n_done + 1:n_done + n) = trail%stride%at(:, 1:n)
            assembly%margin(:, n_done + 1:n_done + n) = trail%stride%groups%margin(:, 1:n)
            trail%place = assembly%place(:, :, n_done + n)
        end if
        n_done = n_done + n
        trail%q = trail%stride%at(:, n)
    end subroutine stride_on

    !> Are margins those that the lanes find? Asked once of each source, at representative places on the start's assembly:
    !> a difference would be a defect, and the lanes are believed.
    logical function judges_like_lanes(model, margins, pose) result(agrees)
        type(model_type), intent(in) :: model
        class(margin_source), intent(in) :: margins
        real(wp), intent(in) :: pose(:, :)           !! (n_q, pose)
        type(assembly_trail) :: trail
        real(wp), dimension(model%n_q, lanes) :: at, way
        real(wp), dimension(lanes, size(model%least_margin)) :: margin, drift
        real(wp), dimension(model%n_branch, lanes) :: margin_given, drift_given
        real(wp), allocatable :: place(:, :, :)      !! of groups' links (place_size, n_link, lane)
        real(wp) :: rate(lanes, link_freedom(model), model%n_link)
        logical :: is_closed(lanes), is_closed_given(lanes)
        type(agreement) :: of_both
        integer :: i, k

        agrees = .false.
        call begin_trail(model, trail)
        if (.not. trail%is_needed) return              ! nobody will ask for margins
        do i = 1, lanes
            at(:, i) = pose(:, min(i, size(pose, 2)))
            way(:, i) = [(modulo((i*model%n_q + k)*golden, 1.0_wp) - 0.5_wp, k=1, model%n_q)]
        end do
        call evaluate_places(model, transpose(at), transpose(way), trail, margin, drift, rate, is_closed)
        if (size(model%group) > 0) then
            place = reshape(trail%state%group%place, [place_size(model), model%n_link, lanes], order=[3, 1, 2])
        else
            allocate (place(0, 0, 0))
        end if
        call margins%find(at, way, trail%branch, place, margin_given, drift_given, is_closed_given)
        do i = 1, min(lanes, size(pose, 2))
            if (.not. (is_closed(i) .and. is_closed_given(i))) cycle
            associate (margin_here => margin(i, :model%n_branch), drift_here => drift(i, :model%n_branch))
                call of_both%note(all(abs(margin_here - margin_given(:, i)) <= least_accuracy) &
                                  .and. all(abs(drift_here - drift_given(:, i)) <= least_accuracy*(1 + abs(drift_here))))
            end associate
        end do
        agrees = of_both%is_reached()
    end function judges_like_lanes

    !> Which of the steps from each lane's place to the next one's are believed at once. The state has what was found there.
    subroutine judge_steps(model, at, n, trail, is_closed, is_believed)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: at(:, :)             !! (lane, n_q), the trail's own first
        integer, intent(in) :: n                     !! places; further lanes repeat the last
        type(assembly_trail), intent(inout) :: trail
        logical, intent(out) :: is_closed(lanes)     !! at a lane's place
        logical, intent(out) :: is_believed(lanes)   !! the step to a lane; of the first lane there is none
        real(wp), dimension(lanes, size(model%least_margin)) :: margin, drift
        real(wp) :: way(lanes, size(at, 2)), back(lanes), square(lanes)
        real(wp) :: rate(lanes, link_freedom(model), model%n_link)
        integer :: lane, m, k

        do lane = 1, lanes
            way(lane, :) = at(min(lane, n - 1) + 1, :) - at(min(lane, n - 1), :)
        end do
        call evaluate_places(model, at, way, trail, margin, drift, rate, is_closed)
        is_believed = is_closed
        ! Rates are those of the way to the next place; back along the way to a place they are led by as much of them as that
        ! way lies along it.
        back = 0
        square = 0
        do k = 1, size(way, 2)
            back(2:) = back(2:) + way(:lanes - 1, k)*way(2:, k)
            square = square + way(:, k)**2
        end do
        back = merge(back/max(square, tiny(1.0_wp)), 0.0_wp, square > 0)
        do m = 1, size(margin, 2)
            associate (least => model%least_margin(m))
                is_believed(2:) = is_believed(2:) .and. abs(margin(2:, m)) > least &
                                  .and. is_step_sound(least, margin(:lanes - 1, m), drift(:lanes - 1, m), margin(2:, m), &
                                                      back(2:)*drift(2:, m))
            end associate
        end do
        if (size(model%group) == 0) return
        ! The rates at both ends of a step must explain where the groups' links have gone.
        associate (place => trail%state%group%place)
            do lane = 2, n
                if (is_believed(lane)) is_believed(lane) = is_close( &
                    model, place(lane - 1, :, :), place(lane, :, :), &
                    rate(lane - 1, :, :), back(lane)*rate(lane, :, :), &
                    minval(abs(margin(lane - 1:lane, model%n_branch + 1:)), dim=1))
            end do
        end associate
    end subroutine judge_steps

    !> The mechanism on the branches of the trail, groups led from there, on each lane at a place of its own; margins and
    !> rates per way to the next lane's place.
    subroutine evaluate_places(model, at, way, trail, margin, drift, rate, is_closed)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: at(:, :)             !! (lane, n_q), the trail's own first
        real(wp), intent(in) :: way(:, :)            !! to the next place (lane, n_q)
        type(assembly_trail), intent(inout) :: trail
        real(wp), intent(out) :: margin(:, :), drift(:, :)    !! (lane, n_map)
        real(wp), intent(out) :: rate(:, :, :)       !! of the groups' links (lane, link_freedom, n_link)
        logical, intent(out) :: is_closed(lanes)
        type(way_report) :: report
        integer :: g, i

        call stand_on_lanes(model, trail)
        associate (state => trail%state)
            state%q = at
            is_closed = .true.
            if (size(model%group) > 0) then
                call lead_mechanism(model, any(at /= spread(trail%q, 1, lanes), dim=2), spread(trail%q, 1, lanes), .false., &
                                    state, report, is_hasty=.true.)
                is_closed = status_of_way(report%outcome) == sample_ok
                state%group%is_led = .true.
                state%group%moves = is_closed
            end if
            state%qd = way
            state%n_column = velocities_only
            call run_program(model, state)
            state%n_column = 0
            call measure_margins(model, state, margin, drift)
            is_closed = is_closed .and. .not. (state%unreachable .or. state%not_converged)
            if (size(model%group) == 0) return
            state%group%is_led = .false.
            do g = 1, size(model%group)
                do i = 1, size(model%group(g)%link)
                    associate (l => model%group(g)%link(i))
                        rate(:, :, l) = place_rates(model, state, l, level_velocity)
                    end associate
                end do
            end do
        end associate
    end subroutine evaluate_places

    !> Steps that are not believed at once are led, each on a lane of its own, from the place found at their beginning. One
    !> that is not long in coming to the place found at its end is believed.
    subroutine lead_steps(model, at, n, is_closed, trail, is_believed)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: at(:, :)             !! (lane, n_q), the trail's own first
        integer, intent(in) :: n                     !! places
        logical, intent(in) :: is_closed(lanes)      !! at a lane's place
        type(assembly_trail), intent(inout) :: trail !! its state has what was found at the places
        logical, intent(inout) :: is_believed(lanes) !! the step to a lane
        type(way_report) :: report
        real(wp) :: from(lanes, size(at, 2))
        real(wp), allocatable :: found(:, :, :)      !! places of the groups' links (lane, place_size, n_link)
        real(wp), allocatable :: margin(:, :)        !! there (lane, n_group)
        real(wp) :: nothing(link_freedom(model), model%n_link)
        logical :: goes(lanes)
        integer :: lane

        goes = .false.
        goes(2:n) = .not. is_believed(2:n) .and. is_closed(:n - 1) .and. is_closed(2:n)
        if (.not. any(goes)) return
        from(1, :) = at(1, :)
        from(2:, :) = at(:lanes - 1, :)
        associate (state => trail%state)
            if (size(model%group) > 0) then
                found = state%group%place
                margin = state%group%margin
                state%group%place(2:, :, :) = found(:lanes - 1, :, :)
            end if
            call lead_mechanism(model, goes, from, .true., state, report, is_hasty=.true.)
            goes = goes .and. report%outcome == way_arrived .and. report%n_crossed == 0
            if (model%n_branch > 0) state%branch = spread(trail%branch, 1, lanes)
            if (size(model%group) > 0) then
                nothing = 0
                do lane = 2, n
                    if (goes(lane)) goes(lane) = is_close(model, state%group%place(lane, :, :), &
                                                          found(lane, :, :), nothing, nothing, abs(state%group%margin(lane, :)))
                end do
                state%group%place = found
                state%group%margin = margin
            end if
        end associate
        is_believed = is_believed .or. goes
    end subroutine lead_steps

    !> Lead the mechanism to one sample.
    subroutine lead_on(model, q, sample, trail, assembly)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: q(:)                 !! (n_q)
        integer, intent(in) :: sample
        type(assembly_trail), intent(inout) :: trail
        type(sample_assembly), intent(inout) :: assembly
        type(way_report) :: report
        logical :: goes(lanes)
        integer :: lane

        call stand_on_lanes(model, trail)
        trail%state%q = spread(q, 1, lanes)
        goes = [(lane == 1, lane=1, lanes)]
        call lead_mechanism(model, goes, spread(trail%q, 1, lanes), .true., trail%state, report)
        call take_outcome(model, 1, report, sample, q, trail, assembly)
        trail%is_lost = any(assembly%status(sample) == [sample_unreachable, sample_not_converged, sample_branch_lost])
        if (trail%is_lost) call note_end(model, 1, report, q - trail%q, trail%state, trail%beyond_last)
        if (assembly%status(sample) == sample_ok .or. assembly%lost%sample > 0) return
        assembly%lost = lost_way(sample, assembly%status(sample), report%map(1), report%reached(1), trail%q, q, trail%branch, &
                                 trail%place)
    end subroutine lead_on

    !> What a way has come to, for its sample.
    subroutine take_outcome(model, lane, report, sample, q, trail, assembly)
        type(model_type), intent(in) :: model
        integer, intent(in) :: lane
        type(way_report), intent(in) :: report
        integer, intent(in) :: sample
        real(wp), intent(in) :: q(:)
        type(assembly_trail), intent(inout) :: trail
        type(sample_assembly), intent(inout) :: assembly

        assembly%status(sample) = status_of_way(report%outcome(lane))
        if (report%n_crossed(lane) > 0) assembly%reached(sample) = reached_crossing
        call keep_lane(model, trail%state, lane, sample, assembly)
        if (assembly%status(sample) /= sample_ok) return
        trail%n_crossed = trail%n_crossed + report%n_crossed(lane)
        call come_to(model, lane, q, trail)
    end subroutine take_outcome

    ! ---------------------------------------------------------------- after samples that could not be reached

    !> Look for the next sample that can be reached, from the last one that could or from the start.
    subroutine search_on(model, q, trail, assembly, n_done)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: q(:, :)              !! (n_q, n)
        type(assembly_trail), intent(inout) :: trail
        type(sample_assembly), intent(inout) :: assembly
        integer, intent(inout) :: n_done
        type(way_report) :: report
        type(kinematic_state) :: on_its_own
        integer :: n, lane

        n = min(lanes, size(q, 2) - n_done)
        call stand_on_lanes(model, trail)
        do lane = 1, lanes
            trail%state%q(lane, :) = q(:, n_done + min(lane, n))
        end do
        call prepare_kinematics(model, 0, on_its_own)
        on_its_own%group%closer => trail%state%group%closer
        on_its_own%q = trail%state%q
        call search_from_last(model, trail, report)
        if (.not. trail%stays) call search_from_start(model, trail, on_its_own)
        do lane = 1, n
            n_done = n_done + 1
            call take_outcome(model, lane, report, n_done, q(:, n_done), trail, assembly)
            if (assembly%status(n_done) == sample_ok) return
            if (trail%stays) cycle
            if (assembly%status(n_done) == sample_branch_lost .or. on_its_own%unreachable(lane) &
                .or. on_its_own%not_converged(lane) .or. on_its_own%singular(lane) .or. on_its_own%branch_lost(lane)) cycle
            assembly%status(n_done) = sample_ok
            assembly%reached(n_done) = reached_anew
            call keep_lane(model, on_its_own, lane, n_done, assembly)
            trail%state = on_its_own
            call come_to(model, lane, q(:, n_done), trail)
            return
        end do
    end subroutine search_on

    !> Ways from the last sample that could be reached to those of the trail's state.
    subroutine search_from_last(model, trail, report)
        type(model_type), intent(in) :: model
        type(assembly_trail), intent(inout) :: trail
        type(way_report), intent(out) :: report
        real(wp) :: way(lanes, model%n_q)
        integer :: before(lanes)                     ! the known end through which a way leads; 0: none
        logical :: goes(lanes)
        integer :: lane

        way = trail%state%q - spread(trail%q, 1, lanes)
        do lane = 1, lanes
            before(lane) = end_before(model, trail%beyond_last, way(lane, :), trail%state%q(lane, :))
        end do
        goes = before == 0
        trail%n_way = trail%n_way + count(goes)
        if (any(goes)) call lead_mechanism(model, goes, spread(trail%q, 1, lanes), .true., trail%state, report)
        do lane = 1, lanes
            if (goes(lane)) cycle
            associate (known => trail%beyond_last%kept(before(lane)))
                report%outcome(lane) = known%outcome
                report%n_crossed(lane) = known%n_crossed
                if (model%n_branch > 0) trail%state%branch(lane, :) = known%branch
                if (size(model%group) == 0) cycle
                trail%state%group%place(lane, :, :) = known%place
                trail%state%group%margin(lane, :) = known%margin
            end associate
        end do
        do lane = 1, lanes
            if (goes(lane)) call note_end(model, lane, report, way(lane, :), trail%state, trail%beyond_last)
        end do
    end subroutine search_from_last

    !> Samples as on their own, groups led from the scene's start.
    subroutine search_from_start(model, trail, state)
        type(model_type), intent(in) :: model
        type(assembly_trail), intent(inout) :: trail
        type(kinematic_state), intent(inout) :: state
        type(way_report) :: report
        real(wp) :: way(lanes, model%n_q)
        integer :: lane, before

        if (size(model%group) == 0) then
            call evaluate_kinematics(model, state)
            return
        end if
        way = state%q - nearest_start(model, state)
        do lane = 1, lanes
            before = end_before(model, trail%beyond_start, way(lane, :), state%q(lane, :))
            if (before > 0) state%way_status(lane) = status_of_way(trail%beyond_start%kept(before)%outcome)
        end do
        trail%n_way = trail%n_way + count(state%way_status == sample_ok)
        call evaluate_kinematics(model, state, report)
        do lane = 1, lanes
            call note_end(model, lane, report, way(lane, :), state, trail%beyond_start)
        end do
    end subroutine search_from_start

    !> The end of another way from the same place through which a way leads, if it is one that would be gone; 0: none that is known.
    pure integer function end_before(model, known, way, q) result(before)
        type(model_type), intent(in) :: model
        type(dead_ends), intent(in) :: known
        real(wp), intent(in) :: way(:), q(:)         !! q: to which it leads (n_q)

        before = 0
        if (is_way_short(model, way)) before = known%that_lies_before(way, abs(q) + abs(q - way), model%stride)
    end function end_before

    !> Remember the end of a way, if it has come to one.
    pure subroutine note_end(model, lane, report, way, state, known)
        type(model_type), intent(in) :: model
        integer, intent(in) :: lane
        type(way_report), intent(in) :: report
        real(wp), intent(in) :: way(:)               !! (n_q)
        type(kinematic_state), intent(in) :: state   !! where it ended; coordinates are those to which it was to lead
        type(dead_ends), intent(inout) :: known

        if (.not. (is_end(report%outcome(lane)) .and. is_way_short(model, way))) return
        call known%note(way, abs(state%q(lane, :)) + abs(state%q(lane, :) - way), model%stride, report%outcome(lane), &
                        report%reached(lane), report%n_crossed(lane))
        associate (newest => known%kept(known%newest))
            if (model%n_branch > 0) newest%branch = state%branch(lane, :)
            if (size(model%group) == 0) return
            newest%place = state%group%place(lane, :, :)
            newest%margin = state%group%margin(lane, :)
        end associate
    end subroutine note_end
end module linkdyn_assembly_trail
