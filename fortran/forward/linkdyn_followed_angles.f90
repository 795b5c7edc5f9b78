!> Angles of joints whose turns count along a forward run: those that events look at, and those that are results. They are
!> followed from one accepted state to the next, whichever instants are asked for.
!>
!> Of the values that a measured angle may have, that one is taken to which it has turned at the mean of its rates at both ends.
!> Along a short way the errors of that are small, and a turn more or less would need rates quite different in between. Where a step
!> is no such way (`looks_for_angles`) the angles are followed through places within it, as many as are needed.
module linkdyn_followed_angles
    use linkdyn_constants, only: pi, two_pi
    use linkdyn_joint_rates, only: measure_joints, measure_variable
    use linkdyn_joint_table, only: goes_round, is_slide
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state
    use linkdyn_lane_count, only: lanes
    use linkdyn_model, only: model_type
    use linkdyn_place_motion, only: place_value, place_rate
    use linkdyn_planar_motion, only: level_velocity
    use linkdyn_scene, only: joint_n_variable
    use linkdyn_turns, only: turning_angles, list_turning
    use linkdyn_whole_turns, only: told_turns
    implicit none (type, external)
    private
    public :: followed_angles, followed_from, prepare_measured_angles, prepare_joint_angles, wraps_anywhere, follow_angles, &
        follow_seen, looks_for_angles, follow_within, angles_about, note_nearest, angles_at

    !> Places of the last step through which the angles were followed, on lane 1: its beginning, some within, its end.
    type :: way_type
        integer :: n = 0
        integer :: n_asked = 0                                 !! places within that were asked for; some may not be had
        real(wp), allocatable :: t(:)                          !! (place) [s]
        real(wp), allocatable :: angle(:, :), spin(:, :)       !! (number, place) [rad], [rad/s]
        real(wp), allocatable :: pace(:)                       !! of the joint angle that turns fastest (place) [rad/s]
    end type way_type

    type :: followed_angles
        real(wp) :: t(lanes) = 0                               !! of the accepted state [s]
        integer, allocatable, private :: joint(:)              !! whose they are; 0: of a link's attitude
        integer, allocatable, private :: variable(:)           !! of the joint
        integer, allocatable, private :: place(:)              !! among the numbers that they belong to
        logical, allocatable, private :: counts(:)             !! a coordinate counts its turns itself
        logical, allocatable, private :: is_measured(:)        !! which numbers are such angles, and have no turns of their own
        real(wp), allocatable, private :: angle(:, :)          !! they are here (lane, number) [rad]
        real(wp), allocatable, private :: spin(:, :)           !! and turn so fast (lane, number) [rad/s]
        type(way_type), private :: way
    end type followed_angles

    !> Places of steps from which angles are followed to states within these, a place a lane.
    type :: followed_from
        real(wp) :: t(lanes) = 0                               !! [s]
        real(wp), allocatable :: angle(:, :), spin(:, :)       !! (lane, number) [rad], [rad/s]
        real(wp), allocatable :: accepted(:, :)                !! where the step has led (lane, number) [rad]
    end type followed_from

contains

    !> Measures that wrap; all measures are near where the scene has them.
    subroutine prepare_measured_angles(model, angles)
        type(model_type), intent(in) :: model
        type(followed_angles), intent(inout) :: angles
        integer :: i

        associate (measure => model%scene%laws%measure)
            angles%place = pack([(i, i=1, size(measure))], measure%wraps)
            angles%joint = measure(angles%place)%joint
            angles%variable = measure(angles%place)%variable
            angles%counts = spread(.false., 1, size(angles%place))
            angles%is_measured = measure%wraps
            angles%angle = spread(measure%near, 1, lanes)
            angles%spin = 0*angles%angle
        end associate
    end subroutine prepare_measured_angles

    !> All joint variables that are angles of whole turns; those that are no coordinates begin within half a turn of zero.
    subroutine prepare_joint_angles(model, angles)
        type(model_type), intent(in) :: model                  !! with the coordinates that results are told in
        type(followed_angles), intent(out) :: angles
        type(turning_angles) :: turning

        call list_turning(model, turning)
        angles%joint = turning%joint
        angles%variable = turning%of_joint
        angles%place = turning%variable
        angles%counts = turning%coordinate > 0
        allocate (angles%is_measured(model%n_variable), source=.false.)
        angles%is_measured(angles%place) = .not. angles%counts
        allocate (angles%angle(lanes, model%n_variable), angles%spin(lanes, model%n_variable), source=0.0_wp)
    end subroutine prepare_joint_angles

    !> Is there an angle to follow?
    pure logical function wraps_anywhere(angles)
        type(followed_angles), intent(in) :: angles

        wraps_anywhere = .false.
        if (allocated(angles%counts)) wraps_anywhere = .not. all(angles%counts)
    end function wraps_anywhere

    ! ---------------------------------------------------------------- from step to step

    !> Where these angles have got to in a state, by the rates at both ends of the step.
    subroutine follow_angles(model, state, t, is_accepted, angles)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        real(wp), intent(in) :: t(lanes)                       !! [s]
        logical, intent(in) :: is_accepted(lanes)
        type(followed_angles), intent(inout) :: angles
        real(wp), dimension(lanes, size(angles%angle, 2)) :: value, spin
        real(wp) :: pace(lanes)
        integer :: k

        call measure_angles(model, state, angles, angles%angle, value, spin, pace)
        do k = 1, size(value, 2)
            if (angles%is_measured(k)) &
                value(:, k) = turned_to(value(:, k), angles%angle(:, k), angles%spin(:, k), spin(:, k), t - angles%t)
            where (is_accepted .and. abs(value(:, k)) <= huge(1.0_wp))
                angles%angle(:, k) = value(:, k)
                angles%spin(:, k) = spin(:, k)
            end where
        end do
        where (is_accepted) angles%t = t
        if (is_accepted(1)) call begin_way(angles, pace(1))
    end subroutine follow_angles

    !> The same of joint angles that somebody else has seen, on all lanes.
    subroutine follow_seen(model, t, angle, rate, angles)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: t                              !! [s]
        real(wp), intent(in) :: angle(:), rate(:)              !! of the joint variables; of slides 0 (n_variable) [rad], [rad/s]
        type(followed_angles), intent(inout) :: angles         !! of joints
        real(wp) :: spin
        integer :: i

        do i = 1, size(angles%place)
            associate (k => angles%place(i), kind => model%joint(angles%joint(i))%told_kind, v => angles%variable(i))
                spin = merge(rate(k), 0.0_wp, angles%counts(i) .or. goes_round(kind, v))
                angles%angle(:, k) = turned_to(angle(k), angles%angle(1, k), angles%spin(1, k), spin, t - angles%t(1))
                angles%spin(:, k) = spin
            end associate
        end do
        angles%t = t
        call begin_way(angles, maxval(abs(rate)))
    end subroutine follow_seen

    !> The value that a measured angle has behind a way along which it turns at the mean of its rates.
    elemental real(wp) function turned_to(value, before, spin_before, spin, duration) result(angle)
        real(wp), intent(in) :: value                          !! but for whole turns [rad]
        real(wp), intent(in) :: before                         !! [rad]
        real(wp), intent(in) :: spin_before, spin              !! [rad/s]
        real(wp), intent(in) :: duration                       !! [s]

        angle = value - two_pi*told_turns(value - (before + (spin_before + spin)/2*duration))
    end function turned_to

    !> A step has led to the accepted state; nothing within it is known.
    subroutine begin_way(angles, pace)
        type(followed_angles), intent(inout) :: angles
        real(wp), intent(in) :: pace                           !! there [rad/s]
        type(way_type) :: way

        call make_room(2, size(angles%angle, 2), way)
        associate (last => angles%way)
            if (last%n > 0) call add_place(last%t(last%n), last%angle(:, last%n), last%spin(:, last%n), last%pace(last%n), way)
        end associate
        call add_place(angles%t(1), angles%angle(1, :), angles%spin(1, :), pace, way)
        angles%way = way
    end subroutine begin_way

    pure subroutine make_room(n_place, n_number, way)
        integer, intent(in) :: n_place, n_number
        type(way_type), intent(out) :: way

        allocate (way%t(n_place), way%pace(n_place), way%angle(n_number, n_place), way%spin(n_number, n_place))
    end subroutine make_room

    pure subroutine add_place(t, angle, spin, pace, way)
        real(wp), intent(in) :: t, angle(:), spin(:), pace
        type(way_type), intent(inout) :: way

        way%n = way%n + 1
        way%t(way%n) = t
        way%angle(:, way%n) = angle
        way%spin(:, way%n) = spin
        way%pace(way%n) = pace
    end subroutine add_place

    ! ---------------------------------------------------------------- within a step

    !> At how many places within the step, at equal distances, the angles have to be looked at; 0: they are followed surely.
    pure integer function looks_for_angles(angles) result(n)
        type(followed_angles), intent(in) :: angles
        integer, parameter :: most = 1023                      !! of a step: of joints that turn evenly the ends tell enough
        real(wp), parameter :: spare = 1.25_wp                 !! what turns faster in between
        real(wp) :: n_quarter

        n = 0
        if (.not. wraps_anywhere(angles) .or. angles%way%n < 2) return
        associate (way => angles%way)
            if (way%n_asked >= most .or. is_followed(angles)) return
            n_quarter = maxval(way%pace(:way%n))*(way%t(way%n) - way%t(1))/(pi/2)
            n = min(most, max(2*way%n_asked + 1, ceiling(min(spare*n_quarter, real(most, wp)))))
        end associate
    end function looks_for_angles

    !> Is each part of the way so short that a turn more or less would be seen? No joint turns by more than a quarter turn along it,
    !> by the rates at its ends, rates differ by no more than that, and the measured angles agree with them to an eighth of a turn.
    pure logical function is_followed(angles)
        type(followed_angles), intent(in) :: angles
        real(wp) :: duration, by_rates(size(angles%is_measured)), apart(size(angles%is_measured))
        integer :: i

        is_followed = .true.
        associate (way => angles%way)
            do i = 2, way%n
                duration = way%t(i) - way%t(i - 1)
                by_rates = (way%spin(:, i - 1) + way%spin(:, i))/2*duration
                apart = (way%spin(:, i) - way%spin(:, i - 1))*duration
                is_followed = maxval(way%pace(i - 1:i))*duration <= pi/2 .and. .not. any(angles%is_measured .and. &
                    (abs(apart) > pi/2 .or. abs(way%angle(:, i) - way%angle(:, i - 1) - by_rates) > pi/4))
                if (.not. is_followed) return
            end do
        end associate
    end function is_followed

    !> Follow the angles through places within the step, which come in blocks: in the order of their instants, the first
    !> `n` of a state's lanes. The last block leads to the step's end.
    subroutine follow_within(model, state, t, n, first, n_place, angles)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        real(wp), intent(in) :: t(lanes)                       !! [s]
        integer, intent(in) :: n
        integer, intent(in) :: first, n_place                  !! number of the block's first place, and how many there are in all
        type(followed_angles), intent(inout) :: angles
        real(wp), dimension(lanes, size(angles%angle, 2)) :: value, spin
        real(wp) :: pace(lanes)
        integer :: lane

        if (first == 1) call begin_anew(n_place, angles)
        call measure_angles(model, state, angles, angles%angle, value, spin, pace)
        do lane = 1, n
            ! a place that cannot be had tells nothing
            if (all(abs(value(lane, :)) <= huge(1.0_wp))) call go_on(t(lane), value(lane, :), spin(lane, :), pace(lane), angles)
        end do
        if (first + n - 1 == n_place) call come_to_end(angles)
    end subroutine follow_within

    !> Leave of the way its beginning, with room for places behind it; behind these its end waits.
    subroutine begin_anew(n_place, angles)
        integer, intent(in) :: n_place
        type(followed_angles), intent(inout) :: angles
        type(way_type) :: way

        call make_room(n_place + 3, size(angles%angle, 2), way)
        associate (known => angles%way)
            call add_place(known%t(1), known%angle(:, 1), known%spin(:, 1), known%pace(1), way)
            way%pace(n_place + 3) = known%pace(known%n)
            way%n_asked = n_place
        end associate
        angles%way = way
    end subroutine begin_anew

    !> From the last place to the next.
    pure subroutine go_on(t, value, spin, pace, angles)
        real(wp), intent(in) :: t                              !! [s]
        real(wp), intent(in) :: value(:)                       !! but for whole turns (number) [rad]
        real(wp), intent(in) :: spin(:), pace                  !! (number) [rad/s]
        type(followed_angles), intent(inout) :: angles
        real(wp) :: angle(size(value))

        associate (way => angles%way)
            angle = merge(turned_to(value, way%angle(:, way%n), way%spin(:, way%n), spin, t - way%t(way%n)), value, &
                          angles%is_measured)
            call add_place(t, angle, spin, pace, way)
        end associate
    end subroutine go_on

    !> The accepted state once more, with the turns that have been seen on the way.
    pure subroutine come_to_end(angles)
        type(followed_angles), intent(inout) :: angles
        real(wp) :: pace

        pace = angles%way%pace(size(angles%way%pace))
        call go_on(angles%t(1), angles%angle(1, :), angles%spin(1, :), pace, angles)
        angles%angle = spread(angles%way%angle(:, angles%way%n), 1, lanes)
    end subroutine come_to_end

    ! ---------------------------------------------------------------- asked for

    !> From where the angles are followed to an instant of the last step, from a lane on: the nearest place on its way.
    subroutine note_nearest(angles, t, lane, from)
        type(followed_angles), intent(in) :: angles
        real(wp), intent(in) :: t                              !! [s]
        integer, intent(in) :: lane
        type(followed_from), intent(inout) :: from
        integer :: i, k

        if (.not. allocated(angles%angle)) return              ! nobody follows any
        if (.not. allocated(from%accepted)) allocate (from%angle, from%spin, from%accepted, source=angles%angle)
        i = 1
        if (wraps_anywhere(angles)) i = minloc(abs(angles%way%t(:angles%way%n) - t), dim=1)
        do k = 1, size(angles%angle, 2)
            from%accepted(lane:, k) = angles%angle(1, k)
            if (.not. angles%is_measured(k)) cycle
            from%angle(lane:, k) = angles%way%angle(k, i)
            from%spin(lane:, k) = angles%way%spin(k, i)
        end do
        if (wraps_anywhere(angles)) from%t(lane:) = angles%way%t(i)
    end subroutine note_nearest

    !> These angles in states, from such places.
    function angles_at(model, state, t, angles, from) result(angle)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        real(wp), intent(in) :: t(lanes)                       !! [s]
        type(followed_angles), intent(in) :: angles
        type(followed_from), intent(in) :: from
        real(wp), dimension(lanes, size(angles%angle, 2)) :: angle, spin    ! (lane, number) [rad], [rad/s]
        real(wp) :: pace(lanes)
        integer :: k

        call measure_angles(model, state, angles, from%accepted, angle, spin, pace)
        if (.not. wraps_anywhere(angles)) return
        do k = 1, size(angle, 2)
            if (angles%is_measured(k)) &
                angle(:, k) = turned_to(angle(:, k), from%angle(:, k), from%spin(:, k), spin(:, k), t - from%t)
        end do
    end function angles_at

    !> Angles as a state has them: measured ones but for whole turns. An angle that does not go round needs no rate to be followed.
    subroutine measure_angles(model, state, angles, near, value, spin, pace)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        type(followed_angles), intent(in) :: angles
        real(wp), intent(in) :: near(:, :)             !! where the angles have got to (lane, number) [rad]
        real(wp), intent(out), dimension(lanes, size(angles%angle, 2)) :: value, spin    !! (lane, number) [rad], [rad/s]
        real(wp), intent(out) :: pace(lanes)           !! of the joint angle that turns fastest [rad/s]
        real(wp), dimension(lanes, model%n_variable) :: variable, rate
        integer :: i

        value = near
        spin = angles%spin
        variable = 0
        rate = 0
        call measure_joints(model, state, variable, rate)
        where (.not. abs(rate) <= huge(1.0_wp)) rate = 0
        pace = pace_of(model, rate)
        do i = 1, size(angles%place)
            associate (k => angles%place(i), j => angles%joint(i), v => angles%variable(i))
                if (j == 0) then
                    call measure_attitude(model, state, k, value(:, k), spin(:, k))
                    pace = max(pace, abs(spin(:, k)))
                    cycle
                end if
                if (angles%counts(i)) then
                    call measure_variable(model, state, j, v, near(:, k), value(:, k), spin(:, k))
                    cycle
                end if
                value(:, k) = variable(:, model%joint(j)%first_variable + v)
                spin(:, k) = rate(:, model%joint(j)%first_variable + v)
                if (.not. goes_round(model%joint(j)%told_kind, v)) spin(:, k) = 0
            end associate
        end do
    end subroutine measure_angles

    !> An angle of a link's attitude, by its measure.
    subroutine measure_attitude(model, state, k, value, spin)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        integer, intent(in) :: k                       !! measure
        real(wp), intent(out), dimension(lanes) :: value, spin    !! [rad], [rad/s]
        integer, parameter :: pitch = 2                !! goes no way round

        associate (spec => model%scene%laws%measure(k))
            value = place_value(model, state, spec)
            spin = place_rate(model, state, spec, level_velocity)
            if (spec%component == pitch) spin = 0
        end associate
        where (.not. abs(spin) <= huge(1.0_wp)) spin = 0
    end subroutine measure_attitude

    !> How fast the joint angle turns that is the fastest.
    pure function pace_of(model, rate) result(pace)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: rate(:, :)             !! of the joint variables (lane, n_variable)
        real(wp) :: pace(lanes)                        ! [rad/s]
        integer :: j, v

        pace = 0
        do j = 1, model%n_joint
            do v = 1, joint_n_variable(model%joint(j)%told_kind)
                if (.not. is_slide(model%joint(j)%told_kind, v)) pace = max(pace, abs(rate(:, model%joint(j)%first_variable + v)))
            end do
        end do
    end function pace_of

    !> About where these angles are at other instants.
    pure function angles_about(angles, t) result(about)
        type(followed_angles), intent(in) :: angles
        real(wp), intent(in) :: t(lanes)                       !! [s]
        real(wp) :: about(lanes, size(angles%angle, 2))        !! (lane, number) [rad]

        about = angles%angle + angles%spin*spread(t - angles%t, 2, size(angles%angle, 2))
    end function angles_about
end module linkdyn_followed_angles
