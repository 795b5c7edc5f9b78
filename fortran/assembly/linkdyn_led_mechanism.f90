!> A mechanism led along a straight way in the space of its coordinates, from an assembly that is known.
!>
!> Its maps are those of the closed forms with a branch, whose margin is the sine of the transmission angle, and those of
!> the groups closed by iteration (`linkdyn_newton_group`). By which rule it is led says `linkdyn_following`.
!>
!> A free link's orientation goes its way about a fixed axis where it is given by a quaternion.
module linkdyn_led_mechanism
    use linkdyn_closed_forms, only: closed_margin
    use linkdyn_constants, only: two_pi
    use linkdyn_following, only: follower, footing, way_report, follow_way, way_at_singularity, way_ends, &
        way_forks, way_too_long
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_pass, only: run_program
    use linkdyn_kinematic_state, only: kinematic_state, velocities_only
    use linkdyn_lane_count, only: lanes
    use linkdyn_model, only: model_type, step_type, step_pose, step_prp, is_dyad, scene_size, &
        link_freedom, place_size, repeats, gives_attitude, attitude_angles
    use linkdyn_steps_on_lanes, only: place_rates
    use linkdyn_newton_group, only: n_shift, led_link
    use linkdyn_planar_motion, only: level_velocity
    use linkdyn_quaternion, only: quaternion_of_rpy, turned_by, turn_between
    use linkdyn_status, only: sample_ok, sample_unreachable, sample_singular, sample_not_converged, sample_branch_lost
    use linkdyn_whole_turns, only: nearest_turns, has_vague_turn
    implicit none (type, external)
    private
    public :: evaluate_kinematics, lead_from_start, lead_mechanism, status_of_way, measure_margins, n_map, span_of
    public :: follows_assembly, is_way_short, nearest_start, turned_to

    real(wp), parameter :: most_strides = 1000       !! of a way
    integer, parameter :: patience = 300, haste = 4  !! tries of a way beside those for its strides

    type, extends(follower) :: led_mechanism
        type(model_type), pointer :: model => null()
        type(kinematic_state), pointer :: state => null()
        logical :: follows_branches = .false.        !! else those of the closed forms stay as they are
        real(wp), allocatable :: from(:, :), to(:, :)        !! coordinates                      (lane, n_q)
        real(wp), allocatable :: turn(:, :, :)       !! of the attitudes given by quaternion     (lane, 3, n_attitude)
        real(wp), allocatable :: quaternion(:, :, :) !! at the way's beginning                   (lane, 4, n_attitude)
        real(wp), allocatable :: branch(:, :)        !!                                          (lane, n_branch)
        real(wp), allocatable :: place(:, :, :), rate(:, :, :)    !! of the groups' links, per whole way
                                                     !! (lane, place_size, n_link), (lane, link_freedom, n_link)
        real(wp), allocatable :: slide(:, :)         !! at the axes of slides, where the mechanism stands (lane, n_joint)
    contains
        procedure :: try => try_on_way
        procedure :: take => take_on_way
    end type led_mechanism

contains

    !> Positions and all rates of the block whose coordinates are in the state. Groups closed by iteration are led there
    !> from the assembly that the state sets out from, by the shortest of the straight ways that differ by full turns of
    !> angles.
    subroutine evaluate_kinematics(model, state, report)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(inout) :: state
        type(way_report), intent(out), optional :: report    !! of the groups' ways
        type(way_report) :: ways
        integer :: told(lanes)

        if (size(model%group) == 0) then
            call run_program(model, state)
            return
        end if
        told = state%way_status
        call lead_groups(model, state, ways)
        call run_program(model, state)
        state%way_status = told
        if (present(report)) report = ways
    end subroutine evaluate_kinematics

    !> The same, but of motion only where the groups' links are, their margins there, and how leading them came out.
    subroutine lead_from_start(model, state, status, least)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(inout) :: state
        integer, intent(out) :: status(lanes)        !! one of `sample_*`
        real(wp), intent(out) :: least(:, :)         !! the smallest size of a margin on the way (lane, n_group)
        type(way_report) :: ways
        integer :: n_column

        n_column = state%n_column
        if (size(model%group) > 0) call lead_groups(model, state, ways)
        least = huge(1.0_wp)
        if (allocated(ways%least)) least = ways%least(:, model%n_branch + 1:)
        status = state%way_status
        state%way_status = sample_ok
        state%n_column = velocities_only
        state%group%is_led = .true.
        call run_program(model, state)
        state%group%is_led = .false.
        state%n_column = n_column
    end subroutine lead_from_start

    !> Groups to the coordinates of the state; where that fails the state's `way_status` says so, and they stay.
    subroutine lead_groups(model, state, report)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(inout) :: state
        type(way_report), intent(out) :: report
        real(wp) :: from(lanes, model%n_q)
        logical :: goes(lanes)
        integer :: k

        state%group%place = state%group%start_place
        from = nearest_start(model, state)
        do k = 1, model%n_q
            ! To an angle of so many turns rounding leaves no way.
            if (repeats(model, k)) where (has_vague_turn(state%q(:, k))) &
                state%way_status = sample_not_converged
        end do
        goes = any(from /= state%q, dim=2) .and. state%way_status == sample_ok
        if (any(goes)) then
            call lead_mechanism(model, goes, from, .false., state, report)
            where (goes) state%way_status = status_of_way(report%outcome)
        end if
        state%group%moves = state%way_status == sample_ok
    end subroutine lead_groups

    !> Where the groups' ways begin: at the start, by as many full turns of angles on as is nearest.
    pure function nearest_start(model, state) result(from)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        real(wp) :: from(lanes, model%n_q)

        from = turned_to(model, state%group%start_q, state%q)
    end function nearest_start

    !> Coordinates by as many full turns on, where the mechanism is the same, as is nearest to others.
    pure function turned_to(model, from, to) result(turned)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: from(:, :), to(:, :)   !! (lane, n_q)
        real(wp) :: turned(lanes, model%n_q)
        integer :: k

        turned = from
        do k = 1, model%n_q
            if (repeats(model, k)) turned(:, k) = turned(:, k) + two_pi*nearest_turns(to(:, k) - turned(:, k))
        end do
    end function turned_to

    !> Is a way one of no more strides than are gone?
    pure logical function is_way_short(model, way)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: way(:)               !! (n_q)

        is_way_short = all(abs(way) <= most_strides*model%stride)
    end function is_way_short

    !> The outcome of a way as the status of the sample at its end.
    elemental integer function status_of_way(outcome) result(status)
        integer, intent(in) :: outcome               !! one of `way_*`

        select case (outcome)
        case (way_at_singularity)
            status = sample_singular
        case (way_ends)
            status = sample_unreachable
        case (way_forks)
            status = sample_branch_lost
        case (way_too_long)
            status = sample_not_converged
        case default
            status = sample_ok
        end select
    end function status_of_way

    !> Can the mechanism change its assembly along a motion?
    pure logical function follows_assembly(model)
        type(model_type), intent(in) :: model

        follows_assembly = size(model%group) > 0 .or. any(model%step%has_margin)
    end function follows_assembly

    !> Lead the mechanism from `from` to the coordinates of the state on the lanes that go.
    !>
    !> At the beginning the state has the branches, and the groups' links where they are there; in the end those of
    !> the place reached.
    subroutine lead_mechanism(model, goes, from, follows_branches, state, report, quaternion, is_hasty, longest)
        type(model_type), intent(in), target :: model
        logical, intent(in) :: goes(lanes)
        real(wp), intent(in) :: from(:, :)                  !! (lane, n_q)
        logical, intent(in) :: follows_branches              !! else those of the closed forms stay as they are
        type(kinematic_state), intent(inout), target :: state
        type(way_report), intent(out) :: report
        real(wp), intent(in), optional :: quaternion(:, :, :)    !! at the beginning (lane, 4, n_attitude)
        logical, intent(in), optional :: is_hasty            !! a way that is not smooth is given up at once; absent: false
        real(wp), intent(in), optional :: longest            !! strides of a way that is gone; absent: `most_strides`
        type(led_mechanism) :: led
        real(wp), dimension(lanes, model%n_q) :: qd, qdd, span
        real(wp) :: target_quaternion(lanes, 4, model%n_attitude)
        real(wp), dimension(lanes) :: length
        real(wp) :: most
        logical :: is_short(lanes)
        integer :: n_column, k, spare_tries

        spare_tries = patience
        if (present(is_hasty)) spare_tries = merge(haste, patience, is_hasty)
        most = most_strides
        if (present(longest)) most = longest
        led%model => model
        led%state => state
        led%follows_branches = follows_branches
        led%from = from
        led%to = state%q
        led%branch = state%branch
        led%least_margin = model%least_margin
        led%slide = state%slide(:, 1, :)
        allocate (led%turn(lanes, 3, model%n_attitude))
        led%turn = 0
        target_quaternion = state%quaternion
        led%quaternion = state%quaternion
        if (present(quaternion)) then
            led%quaternion = quaternion
            do k = 1, model%n_attitude
                if (state%by_quaternion(k)) led%turn(:, :, k) = turn_between(quaternion(:, :, k), state%quaternion(:, :, k))
            end do
        end if
        if (size(model%group) > 0) then
            led%place = state%group%place
            allocate (led%rate(lanes, link_freedom(model), model%n_link))
            led%rate = 0
            state%group%is_led = .true.
        end if
        span = span_of(model, state, led%from, led%quaternion)
        length = 0
        do k = 1, model%n_q
            length = max(length, abs(span(:, k))/model%stride(k))
        end do
        qd = state%qd
        qdd = state%qdd
        n_column = state%n_column
        state%n_column = velocities_only
        state%qdd = 0

        is_short = length <= most
        call follow_way(led, goes .and. is_short, 1/max(1.0_wp, aint(min(length, most) + 1)), &
                        model%scene%passes_change_points, spare_tries, report)
        where (goes .and. .not. is_short) report%outcome = merge(way_too_long, way_ends, length <= huge(1.0_wp))

        state%n_column = n_column
        state%q = led%to
        state%qd = qd
        state%qdd = qdd
        state%quaternion = target_quaternion
        state%branch = led%branch
        if (size(model%group) == 0) return
        state%group%is_led = .false.
        state%group%is_idle = .false.
        state%group%place = led%place
    end subroutine lead_mechanism

    !> Closed at a part of the way, from where the tangent leads.
    subroutine try_on_way(self, goes, part, lead, is_crossing, found)
        class(led_mechanism), intent(inout) :: self
        logical, intent(in) :: goes(lanes)
        real(wp), intent(in) :: part(lanes), lead(lanes)
        logical, intent(in) :: is_crossing(:, :)
        type(footing), intent(inout) :: found
        integer :: k, l, g

        associate (model => self%model, state => self%state)
            do k = 1, model%n_q
                state%qd(:, k) = self%to(:, k) - self%from(:, k)
                state%q(:, k) = merge(self%to(:, k), self%from(:, k) + part*state%qd(:, k), part >= 1)
            end do
            call turn_attitudes(self, part)
            if (self%follows_branches) then
                state%branch = merge(-self%branch, self%branch, is_crossing(:, :model%n_branch))
            end if
            if (size(model%group) > 0) then
                do g = 1, size(model%group)
                    do k = 1, size(model%group(g)%link)
                        l = model%group(g)%link(k)
                        state%group%place(:, :, l) = led_link(model, model%group(g), k, self%place(:, :, l), &
                                                              spread(lead, 2, link_freedom(model))*self%rate(:, :, l))
                    end do
                end do
                state%group%moves = goes
                state%group%is_idle = .not. goes
            end if
            call run_program(model, state)
            call measure_margins(model, state, found%margin, found%drift)
            if (.not. self%follows_branches) then
                found%margin(:, :model%n_branch) = 1
                found%drift(:, :model%n_branch) = 0
            end if
            found%is_closed = .not. (state%unreachable .or. state%not_converged)
            do k = 1, size(model%step)
                if (model%step(k)%kind == step_prp) &
                    found%shift(:, model%step(k)%first) = shift_of_slides(model, model%step(k), state, self%slide)
            end do
            do g = 1, size(model%group)
                found%speed(:, model%n_branch + g) = speed_of_group(model, state, g)
                found%shift(:, model%n_branch + g) = shift_of_group(model, state, self%place, g)
            end do
        end associate
    end subroutine try_on_way

    !> Rate of the group's fastest link on the way: the largest of its components, lengths and angles alike.
    function speed_of_group(model, state, g) result(speed)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        integer, intent(in) :: g
        real(wp) :: speed(lanes)
        integer :: i

        speed = 0
        do i = 1, size(model%group(g)%link)
            speed = max(speed, maxval(abs(place_rates(model, state, model%group(g)%link(i), level_velocity)), dim=2))
        end do
    end function speed_of_group

    !> How far the group's links have gone from other places, the farthest along one axis, as a part of the group's size.
    function shift_of_group(model, state, place, g) result(shift)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        real(wp), intent(in) :: place(:, :, :)           !! (lane, place_size, n_link)
        integer, intent(in) :: g
        real(wp) :: shift(lanes)
        integer :: i

        shift = 0
        do i = 1, size(model%group(g)%link)
            associate (l => model%group(g)%link(i), n => n_shift(model))
                shift = max(shift, maxval(abs(state%group%place(:, :n, l) - place(:, :n, l)), dim=2))
            end associate
        end do
        shift = shift/model%group(g)%size
    end function shift_of_group

    !> How far a hinge has gone along both slides that carry it, as a part of the mechanism's size.
    pure function shift_of_slides(model, step, state, slide) result(shift)
        type(model_type), intent(in) :: model
        type(step_type), intent(in) :: step
        type(kinematic_state), intent(in) :: state
        real(wp), intent(in) :: slide(:, :)              !! from there (lane, n_joint)
        real(wp) :: shift(lanes)

        associate (outer => step%joint([1, 3]))
            shift = maxval(abs(state%slide(:, 1, outer) - slide(:, outer)), dim=2)/scene_size(model)
        end associate
    end function shift_of_slides

    !> Orientations given by quaternions, on the way.
    subroutine turn_attitudes(self, part)
        class(led_mechanism), intent(inout) :: self
        real(wp), intent(in) :: part(lanes)
        integer :: i

        associate (model => self%model, state => self%state)
            do i = 1, size(model%step)
                if (.not. gives_attitude(model, model%step(i))) cycle
                associate (p => model%step(i)%first)
                    if (.not. state%by_quaternion(p)) cycle
                    state%quaternion(:, :, p) = turned_by(self%quaternion(:, :, p), spread(part, 2, 3)*self%turn(:, :, p))
                    state%qd(:, attitude_angles(model%step(i))) = self%turn(:, :, p)
                end associate
            end do
        end associate
    end subroutine turn_attitudes

    !> Where the mechanism was tried it stands from now on, with its rates there.
    subroutine take_on_way(self, is_taken)
        class(led_mechanism), intent(inout) :: self
        logical, intent(in) :: is_taken(lanes)
        real(wp) :: rate(lanes, link_freedom(self%model))
        integer :: g, i, k, l

        associate (model => self%model, state => self%state)
            do k = 1, model%n_branch
                where (is_taken) self%branch(:, k) = state%branch(:, k)
            end do
            do k = 1, size(self%slide, 2)
                where (is_taken) self%slide(:, k) = state%slide(:, 1, k)
            end do
            do g = 1, size(model%group)
                do i = 1, size(model%group(g)%link)
                    l = model%group(g)%link(i)
                    rate = place_rates(model, state, l, level_velocity)
                    do k = 1, size(rate, 2)
                        where (is_taken) self%rate(:, k, l) = rate(:, k)
                    end do
                    do k = 1, place_size(model)
                        where (is_taken) self%place(:, k, l) = state%group%place(:, k, l)
                    end do
                end do
            end do
        end associate
    end subroutine take_on_way

    !> How far the coordinates of the state are from others, as the columns of rates count them: an attitude given by a
    !> quaternion, and any of a free link, by the turn between both, in the axes of its rates.
    function span_of(model, state, from, quaternion) result(span)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        real(wp), intent(in) :: from(:, :)               !! (lane, n_q)
        real(wp), intent(in) :: quaternion(:, :, :)      !! of poses that are given by one (lane, 4, n_attitude)
        real(wp) :: span(lanes, model%n_q)
        integer :: c(3), i

        span = state%q - from
        do i = 1, size(model%step)
            if (.not. gives_attitude(model, model%step(i))) cycle
            c = attitude_angles(model%step(i))
            associate (p => model%step(i)%first)
                if (state%by_quaternion(p)) then
                    span(:, c) = turn_between(quaternion(:, :, p), state%quaternion(:, :, p))
                else if (model%step(i)%kind == step_pose) then
                    span(:, c) = turn_between(quaternion_of_rpy(from(:, c(1)), from(:, c(2)), from(:, c(3))), &
                                              quaternion_of_rpy(state%q(:, c(1)), state%q(:, c(2)), state%q(:, c(3))))
                end if
            end associate
        end do
    end function span_of

    ! ---------------------------------------------------------------- margins

    !> Maps that tell assemblies apart: those of the closed forms with a branch, then those of the groups.
    pure integer function n_map(model)
        type(model_type), intent(in) :: model

        n_map = model%n_branch + size(model%group)
    end function n_map

    !> Margins of a state, and how fast they change with its velocities. The drift of groups is there on a way only.
    subroutine measure_margins(model, state, margin, drift)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        real(wp), intent(out) :: margin(:, :), drift(:, :)    !! (lane, n_map)
        integer :: i

        margin = 1
        drift = 0
        do i = 1, size(model%step)
            associate (step => model%step(i))
                if (.not. step%has_margin) cycle
                if (state%has_margins .and. is_dyad(step%kind)) then
                    margin(:, step%first) = state%margin(:, step%first)
                    drift(:, step%first) = state%drift(:, step%first)
                else
                    call closed_margin(model, step, state, margin(:, step%first), drift(:, step%first))
                end if
            end associate
        end do
        if (size(model%group) == 0) return
        margin(:, model%n_branch + 1:) = state%group%margin
        drift(:, model%n_branch + 1:) = state%group%drift
    end subroutine measure_margins
end module linkdyn_led_mechanism
