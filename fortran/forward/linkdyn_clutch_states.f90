!> Clutches, brakes and locks in a run: which are closed, which hold, which way the others slip.
!>
!> A clutch that holds keeps its slip s at zero by the force f that this takes; one that slips gives f = -c sign(s), c its capacity. At an
!> instant at which clutches have no slip it is decided together which of them hold (`share_load`): with the accelerations of their slips
!> without them a and the response W to their forces, those that hold have a + W f = 0 and |f| <= c0, c0 >= c what a clutch holds, and
!> the others slip where a + W f takes them, against f.
module linkdyn_clutch_states
    use linkdyn_contact_forces, only: solve_held
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_scene, only: scene_type, n_clutch
    implicit none (type, external)
    private
    public :: clutch_states, prepare_clutches, holds_anywhere, is_clutched, switch_clutches, set_guard, share_load
    public :: state_open, state_slips, state_holds

    integer, parameter :: state_open = 0, state_slips = 1, state_holds = 2

    type :: clutch_states
        logical, allocatable :: is_closed(:, :)        !! (lane, n_clutch)
        logical, allocatable :: holds(:, :)            !! it is closed and has no slip (lane, n_clutch)
        real(wp), allocatable :: sense(:, :)           !! of the slip, +1 or -1; 0: it has none (lane, n_clutch)
        real(wp), allocatable :: capacity(:, :)        !! at the state evaluated last, when it slips [N, N m] (lane, n_clutch)
        real(wp), allocatable :: rub(:, :)             !! force there of those that slip [N, N m] (lane, n_clutch)
        real(wp), allocatable :: force(:, :)           !! of all there [N, N m] (lane, n_clutch)
        real(wp), allocatable :: applied(:, :)         !! of it all but what joints rub that may stick [N, N m] (lane, n_clutch)
        real(wp), allocatable :: fastest(:, :)         !! slip so far [m/s, rad/s] (lane, n_clutch)
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

        allocate (states%is_closed(lanes, n), states%holds(lanes, n), states%was_closed(lanes, n), states%was_held(lanes, n), &
                  source=.false.)
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

    !> What is looked out for of a clutch from here.
    pure subroutine set_guard(lane, i, states, guard_side, guard_scale)
        integer, intent(in) :: lane, i                 !! clutch
        type(clutch_states), intent(in) :: states
        real(wp), intent(inout) :: guard_side, guard_scale     !! of its event

        guard_side = 1
        guard_scale = 0
        if (.not. states%is_closed(lane, i) .or. states%holds(lane, i)) return
        guard_side = states%sense(lane, i)
        guard_scale = states%fastest(lane, i)
    end subroutine set_guard

    !> Which of the clutches without slip hold. Of what several could hold together the first take all: what is left for the
    !> others is none of it, until the first ones slip.
    pure subroutine share_load(response, apart, most, capacity, may_slip, holds, sense)
        real(wp), intent(in) :: response(:, :)         !! W [1/kg, ...] (of, by)
        real(wp), intent(in) :: apart(:)               !! a: without their forces
        real(wp), intent(in) :: most(:)                !! c0: what each holds; huge: whatever comes [N, N m]
        real(wp), intent(in) :: capacity(:)            !! c: what it takes when it slips [N, N m]
        logical, intent(in) :: may_slip(:)             !! false: it holds both ways, as a stop does at which something rests
        logical, intent(inout) :: holds(:)             !! those that have to slip do not; then those that hold
        real(wp), intent(inout) :: sense(:)            !! of those that have to slip; then of all that slip
        real(wp), parameter :: rounded = 1.0e-12_wp
        real(wp), dimension(size(apart)) :: force, left, load
        logical :: is_bound(size(apart))               ! it slips for good
        integer, allocatable :: held(:)
        integer :: i, k, turn

        is_bound = .not. holds
        do turn = 1, 4*size(apart)
            force = merge(0.0_wp, -sense*capacity, holds)
            left = apart + matmul(response, force)
            held = pack([(i, i=1, size(apart))], holds)
            force(held) = solve_held(response(held, held), -left(held))
            left = apart + matmul(response, force)
            load = 0
            where (holds .and. may_slip) load = abs(force)/max(most, tiny(1.0_wp))
            k = maxloc(load, dim=1)
            if (load(k) > 1 + rounded) then
                holds(k) = .false.
                sense(k) = -sign(1.0_wp, force(k))
                cycle
            end if
            ! Nothing moves what is driven on both sides.
            k = maxloc(abs(left), dim=1, mask=holds .and. may_slip)
            if (k > 0) then
                if (abs(left(k)) > 1.0e-8_wp*maxval(abs(apart))) then
                    holds(k) = .false.
                    is_bound(k) = .true.
                    sense(k) = sign(1.0_wp, left(k))
                    cycle
                end if
            end if
            ! What was let go of first may be held once others slip.
            k = minloc(sense*left, dim=1, mask=.not. (holds .or. is_bound))
            if (k == 0) exit
            if (.not. sense(k)*left(k) < -rounded*maxval(abs(apart))) exit
            holds(k) = .true.
            is_bound(k) = .true.
        end do
        where (holds) sense = 0
    end subroutine share_load
end module linkdyn_clutch_states
