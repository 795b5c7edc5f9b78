!> Clutches, brakes and locks in a run: which are closed, which hold, which way the others slip.
!>
!> A clutch that holds keeps its slip s at zero by the force f that this takes; one that slips gives f = -c sign(s), c its capacity.
!> At an instant at which clutches have no slip it is decided together which of them hold (`share_load`): with the accelerations of
!> their slips without them a and the response W to their forces, those that hold have a + W f = 0 and |f| <= c0, c0 >= c what a
!> clutch holds, and the others slip where a + W f takes them, against f. Of those whose joint variables go together |f| is the
!> length of a vector (`linkdyn_slip_parts`).
module linkdyn_clutch_states
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_scene, only: scene_type, n_clutch
    use linkdyn_slip_parts, only: find_way_loose, solve_together
    implicit none (type, external)
    private
    public :: clutch_states, prepare_clutches, holds_anywhere, is_clutched, only_slides, switch_clutches, set_guard, share_load, &
        response_beside
    public :: state_open, state_slips, state_holds

    integer, parameter :: state_open = 0, state_slips = 1, state_holds = 2

    type :: clutch_states
        logical, allocatable :: is_closed(:, :)        !! (lane, n_clutch)
        logical, allocatable :: holds(:, :)            !! it is closed and has no slip (lane, n_clutch)
        logical, allocatable :: is_spared(:, :)        !! it is closed and has no slip, and others hold it: it does nothing
                                                       !! (lane, n_clutch)
        real(wp), allocatable :: sense(:, :)           !! of the slip, +1 or -1; 0: it has none; of those that go together a unit
                                                       !! vector, which way they slipped at the accepted state (lane, n_clutch)
        real(wp), allocatable :: capacity(:, :)        !! at the state evaluated last, when it slips [N, N m] (lane, n_clutch)
        real(wp), allocatable :: rub(:, :)             !! force there of those that slip [N, N m] (lane, n_clutch)
        real(wp), allocatable :: force(:, :)           !! of all there [N, N m] (lane, n_clutch)
        real(wp), allocatable :: applied(:, :)         !! of it all but what joints rub that may stick [N, N m] (lane, n_clutch)
        real(wp), allocatable :: fastest(:, :)         !! slip so far; of those that go together of their surface [m/s, rad/s]
                                                       !! (lane, n_clutch)
        real(wp), allocatable :: ease(:, :)            !! largest response of a slip to its force so far [1/kg, ..] (lane, n_clutch)
        real(wp), allocatable :: kept(:, :)            !! where it holds the joint variables [m, rad] (lane, n_clutch)
        real(wp), allocatable :: switched(:, :)        !! last event that opened or closed it [s]; -huge: none (lane, n_clutch)
        logical, allocatable :: was_closed(:, :)       !! by it (lane, n_clutch)
        logical, allocatable :: was_held(:, :)         !! before what happens at an instant (lane, n_clutch)
        real(wp), allocatable :: loosened(:, :)        !! when it broke loose last [s]; -huge: never (lane, n_clutch)
        logical :: begins = .false.                    !! the run does: what is so from the start is no event
        real(wp) :: longest(lanes) = 0                 !! step since something holds [s]
        real(wp) :: t_accepted(lanes) = 0              !! [s]
    end type clutch_states

contains

    subroutine prepare_clutches(n, states)
        integer, intent(in) :: n
        type(clutch_states), intent(out) :: states

        allocate (states%is_closed(lanes, n), states%holds(lanes, n), states%is_spared(lanes, n), states%was_closed(lanes, n), &
                  states%was_held(lanes, n), source=.false.)
        allocate (states%sense(lanes, n), states%capacity(lanes, n), states%rub(lanes, n), states%force(lanes, n), &
                  states%applied(lanes, n), states%fastest(lanes, n), states%kept(lanes, n), &
                  states%ease(lanes, n), source=0.0_wp)
        allocate (states%switched(lanes, n), states%loosened(lanes, n), source=-huge(1.0_wp))
    end subroutine prepare_clutches

    !> Does a clutch hold?
    pure logical function holds_anywhere(states)
        type(clutch_states), intent(in) :: states

        holds_anywhere = .false.
        if (allocated(states%holds)) holds_anywhere = any(states%holds)
    end function holds_anywhere

    !> Is one closed?
    pure logical function is_clutched(states)
        type(clutch_states), intent(in) :: states

        is_clutched = .false.
        if (allocated(states%is_closed)) is_clutched = any(states%is_closed)
    end function is_clutched

    !> Is nothing closed but joints that may stick, and does none of them?
    pure logical function only_slides(scene, states)
        type(scene_type), intent(in) :: scene
        type(clutch_states), intent(in) :: states
        integer :: i

        only_slides = .not. holds_anywhere(states)
        if (.not. allocated(states%is_closed)) return
        do i = 1, n_clutch(scene)
            if (scene%clutch(i)%friction == 0) only_slides = only_slides .and. .not. any(states%is_closed(:, i))
        end do
    end function only_slides

    !> An event opens or closes the clutches that wait for it.
    subroutine switch_clutches(scene, lane, event, t, states, is_closed)
        type(scene_type), intent(in) :: scene
        integer, intent(in) :: lane, event
        real(wp), intent(in) :: t                      !! [s]
        type(clutch_states), intent(inout) :: states
        logical, intent(inout) :: is_closed(:, :)      !! from here (lane, n_clutch)
        integer :: i

        do i = 1, n_clutch(scene)
            associate (clutch => scene%clutch(i))
                if (.not. any([clutch%from_event, clutch%until_event] == event)) cycle
                is_closed(lane, i) = clutch%from_event == event
                states%was_closed(lane, i) = is_closed(lane, i)
                states%switched(lane, i) = t
            end associate
        end do
    end subroutine switch_clutches

    !> What is looked out for of a clutch from here; of those that go together how far they still slip the way they did.
    pure subroutine set_guard(lane, i, is_part, states, guard_side, guard_scale)
        integer, intent(in) :: lane, i                 !! clutch
        logical, intent(in) :: is_part                 !! it goes with others
        type(clutch_states), intent(in) :: states
        real(wp), intent(inout) :: guard_side, guard_scale     !! of its event

        guard_side = 1
        guard_scale = 0
        if (.not. states%is_closed(lane, i) .or. states%holds(lane, i) .or. states%is_spared(lane, i)) return
        if (.not. is_part) guard_side = states%sense(lane, i)
        guard_scale = states%fastest(lane, i)
    end subroutine set_guard

    !> Which of the clutches without slip hold. Of what several could hold together the first take all: what is left for the
    !> others is none of it, until the first ones slip. What slips by its load alone, and cannot move since others hold all of it
    !> without its help, is spared: it neither holds nor slips.
    subroutine share_load(lead, lever, response, apart, most, capacity, may_slip, may_spare, holds, sense)
        integer, intent(in) :: lead(:)                 !! the same of all that go together
        real(wp), intent(in) :: lever(:)               !! speed of their surface over each slip; of others 1
        real(wp), intent(in) :: response(:, :)         !! W [1/kg, ...] (of, by)
        real(wp), intent(in) :: apart(:)               !! a: without their forces
        real(wp), intent(in) :: most(:)                !! c0: what each holds; huge: whatever comes [N, N m]
        real(wp), intent(in) :: capacity(:)            !! c: what it takes when it slips [N, N m]
        logical, intent(in) :: may_slip(:)             !! false: it holds both ways, as a stop does at which something rests
        logical, intent(in) :: may_spare(:)            !! it may do nothing where others hold it
        logical, intent(inout) :: holds(:)             !! those that have to slip do not; then those that hold
        real(wp), intent(inout) :: sense(:)            !! of those that have to slip; then of all that slip
        integer, parameter :: most_ways = 40           !! so often at most may surfaces turn that begin to slide
        real(wp), parameter :: rounded = 1.0e-12_wp
        real(wp), parameter :: still = 1.0e-8_wp       !! of the largest that is apart
        real(wp), dimension(size(apart)) :: force, left, load
        logical, dimension(size(apart)) :: is_bound    ! it slips for good
        logical, dimension(size(apart)) :: is_part     ! it goes with others
        logical :: has_turned
        integer, allocatable :: held(:)
        integer :: i, k, turn

        is_bound = .not. holds
        is_part = [(count(lead == lead(i)) > 1, i=1, size(apart))]
        do turn = 1, 4*size(apart) + merge(most_ways, 0, any(is_part))
            call find_loads()
            k = maxloc(load, dim=1)
            if (load(k) > 1 + rounded) then
                call let_go(k, -force/lever)
                cycle
            end if
            ! Nothing moves what is driven on both sides.
            k = maxloc(abs(left), dim=1, mask=holds .and. may_slip)
            if (k > 0) then
                if (abs(left(k)) > still*maxval(abs(apart))) then
                    call let_go(k, lever*left)
                    where (lead == lead(k)) is_bound = .true.
                    cycle
                end if
            end if
            ! What was let go of first may be held once others slip.
            call turn_surfaces(has_turned)
            if (has_turned) cycle
            k = minloc(sense*left, dim=1, mask=.not. (holds .or. is_bound .or. is_part))
            if (k == 0) exit
            if (.not. sense(k)*left(k) < -rounded*maxval(abs(apart))) exit
            holds(k) = .true.
            is_bound(k) = .true.
        end do
        do i = 1, size(apart)
            if (may_slip(i) .and. may_spare(i) .and. .not. (holds(i) .or. is_part(i))) call spare(i)
        end do
        where (holds) sense = 0

    contains

        !> What those that hold take, over what each holds, and what then moves.
        subroutine find_loads()
            integer :: k

            force = merge(0.0_wp, -sense*capacity, holds)
            left = apart + matmul(response, force)
            held = pack([(k, k=1, size(apart))], holds)
            force(held) = solve_together(lead(held), lever(held), response(held, held), -left(held))
            left = apart + matmul(response, force)
            load = [(norm2(pack(force/max(most, tiny(1.0_wp)), lead == lead(k))), k=1, size(apart))]
            where (.not. (holds .and. may_slip)) load = 0
        end subroutine find_loads

        !> It slips no way where the others hold without it.
        subroutine spare(k)
            integer, intent(in) :: k
            real(wp), parameter :: rigid = 1.0e-8_wp   !! of its response alone: that is none
            real(wp) :: told

            ! its slip turns back while others move on
            if (abs(left(k)) > still*maxval(abs(apart))) return
            if (size(held) == 0) return
            if (response(k, k) - dot_product(response(k, held), solve_together(lead(held), lever(held), response(held, held), &
                                                                              response(held, k))) > rigid*response(k, k)) return
            told = sense(k)
            sense(k) = 0
            call find_loads()
            if (.not. any(load > 1 + rounded)) return
            sense(k) = told
            call find_loads()
        end subroutine spare

        !> It slips, and what goes with it, this way.
        subroutine let_go(k, way)
            integer, intent(in) :: k
            real(wp), intent(in) :: way(:)             !! of surfaces

            associate (length => norm2(pack(way, lead == lead(k))))
                where (lead == lead(k))
                    holds = .false.
                    sense = way/length
                end where
            end associate
        end subroutine let_go

        !> Surfaces that begin to slide along several joint variables do so the way that they keep, or may be held.
        subroutine turn_surfaces(has_turned)
            logical, intent(out) :: has_turned
            real(wp), parameter :: turned = 1.0e-10_wp
            integer, allocatable :: part(:)
            real(wp), allocatable :: own(:, :), way(:)
            logical :: is_held
            integer :: i

            has_turned = .false.
            do i = 1, size(apart)
                if (holds(i) .or. .not. is_part(i) .or. findloc(lead, lead(i), dim=1) /= i) cycle
                part = pack([(k, k=1, size(apart))], lead == lead(i))
                own = response_beside(response, part, held, lead, lever)
                way = sense(part)
                call find_way_loose(response_beside(response, part, part(:0), lead, lever), own, capacity(i)/lever(i), &
                                    lever(part)*left(part), way, is_held)
                if (is_held .and. .not. is_bound(i)) then
                    holds(part) = .true.
                    is_bound(part) = .true.
                    has_turned = .true.
                    return
                end if
                has_turned = has_turned .or. norm2(way - sense(part)) > turned
                sense(part) = way
            end do
        end subroutine turn_surfaces
    end subroutine share_load

    !> What the slips of one surface answer to forces there, as it slides, while others hold.
    pure function response_beside(response, part, held, lead, lever) result(own)
        real(wp), intent(in) :: response(:, :)         !! of all (of, by)
        integer, intent(in) :: part(:), held(:)        !! which these are, and the others
        integer, intent(in) :: lead(:)
        real(wp), intent(in) :: lever(:)               !! both as of `share_load`
        real(wp) :: own(size(part), size(part))
        integer :: k

        own = response(part, part)
        do k = 1, size(part)
            own(:, k) = own(:, k) - matmul(response(part, held), &
                                        solve_together(lead(held), lever(held), response(held, held), response(held, part(k))))
            own(:, k) = lever(part)*own(:, k)*lever(part(k))
        end do
    end function response_beside
end module linkdyn_clutch_states
