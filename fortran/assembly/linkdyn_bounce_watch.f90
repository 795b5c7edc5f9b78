!> Does a step lead to a mechanism that was thrown back?
!>
!> At the dead point of a coordinate the mechanism moves on while the coordinate turns back: the state behind it has the same
!> coordinates as one before it, in which all joints turn the other way. A step over the dead point ends in that one unless
!> something is known of the way between. Joint rates tell: over a short step they change by what their accelerations make, and
!> where one has changed its sign without these the mechanism has been thrown back. Coordinates that can be exchanged
!> (`linkdyn_coordinate_watch`) never come that far, if steps are short enough to see them grow worse. So this is for those of
!> poses and of joints with several axes, and for all where the tolerances make no short steps.
module linkdyn_bounce_watch
    use linkdyn_joint_rates, only: joint_rate
    use linkdyn_joint_table, only: has_one_axis, is_pose_part
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state
    use linkdyn_lane_count, only: lanes
    use linkdyn_led_mechanism, only: follows_assembly
    use linkdyn_model, only: model_type, is_released, orientation_of
    use linkdyn_planar_motion, only: level_velocity, level_given
    use linkdyn_scene, only: coordinate_joint
    use linkdyn_vec3, only: vec3
    implicit none (type, external)
    private
    public :: bounce_watch, prepare_bounce_watch, watch_loose_steps, measure_rates, measure_end, look_at_end, note_start, gains_of

    !> Rates and accelerations at an instant: of hinges and slides, then, in space, of links' turns.
    type :: motion_type
        real(wp) :: t = 0                           !! [s]
        logical :: has_accelerations = .false.
        real(wp), allocatable :: rate(:, :)         !! [rad/s, m/s] (3, measured); of a joint the first component
        real(wp), allocatable :: acceleration(:, :) !! [rad/s2, m/s2] (3, measured)
    end type motion_type

    type :: bounce_watch
        logical :: is_on = .false.
        logical :: is_recorded = .false.            !! records tell what it asks of the end of a step
        logical :: is_ahead = .false.               !! a step that went further than the last accepted state has bounced
        real(wp), private :: t_bounced = 0          !! its end [s]
        real(wp), private :: least_rate = 0         !! smaller changes are errors: of what stands still, rounding
        integer, allocatable :: joint(:)            !! with one axis
        integer, allocatable :: link(:)             !! that turn in space
        type(motion_type), private :: start         !! of the step
        type(motion_type), private :: end           !! of the step tried last
    end type bounce_watch

contains

    !> Whose rates are compared over a step: of joints about or along one axis, and of links that turn in space.
    subroutine prepare_bounce_watch(model, is_free, watch)
        type(model_type), intent(in) :: model
        logical, intent(in) :: is_free(:)           !! coordinates that are not driven (n_q)
        type(bounce_watch), intent(out) :: watch
        integer :: i, j, n

        watch%joint = pack([(j, j=1, model%n_joint)], [(is_measured(j), j=1, model%n_joint)])
        watch%link = pack([(i, i=1, model%n_link)], .not. model%is_planar)
        n = size(watch%joint) + size(watch%link)
        allocate (watch%start%rate(3, n), watch%start%acceleration(3, n), source=0.0_wp)
        watch%end = watch%start
        watch%is_on = follows_assembly(model) .and. n > 0 &
                      .and. (any(is_free .and. .not. may_be_exchanged()) .or. (any(is_free) .and. has_joints_of_several_axes()))
        watch%is_recorded = watch%is_on

    contains

        pure logical function is_measured(j)
            integer, intent(in) :: j

            associate (joint => model%joint(j))
                is_measured = has_one_axis(joint%kind) .and. .not. is_released(joint) &
                              .and. .not. any([on_leg(joint%link(1)), on_leg(joint%link(2))])
            end associate
        end function is_measured

        pure logical function has_joints_of_several_axes()
            integer :: j

            has_joints_of_several_axes = .not. (model%is_planar &
                                                .or. all(has_one_axis(model%joint(:model%n_joint)%kind)))
        end function has_joints_of_several_axes

        pure logical function on_leg(link)
            integer, intent(in) :: link

            on_leg = link > 0 .and. any(model%leg%lower == link .or. model%leg%upper == link)
        end function on_leg

        pure function may_be_exchanged() result(may)
            logical :: may(model%n_q)
            integer :: k

            do k = 1, model%n_q
                associate (c => model%scene%coordinate(k))
                    may(k) = c%kind == coordinate_joint
                    if (may(k)) may(k) = has_one_axis(model%joint(c%joint)%kind) .and. .not. is_pose_part(model%joint(c%joint)%kind)
                end associate
            end do
        end function may_be_exchanged
    end subroutine prepare_bounce_watch

    !> Watch the coordinates that can be exchanged, too, where steps may be so long that their dead points go unseen.
    subroutine watch_loose_steps(model, is_free, rtol, atol, watch)
        type(model_type), intent(in) :: model
        logical, intent(in) :: is_free(:)           !! coordinates that are not driven (n_q)
        real(wp), intent(in) :: rtol, atol          !! of the steps
        type(bounce_watch), intent(inout) :: watch
        real(wp), parameter :: loose = 1.0e-5_wp    !! ten times below where one of some hundred runs first leapt

        watch%least_rate = atol
        if (max(rtol, atol) > loose) &
            watch%is_on = follows_assembly(model) .and. any(is_free) .and. size(watch%joint) + size(watch%link) > 0
    end subroutine watch_loose_steps

    !> Rates in a state of what is watched.
    function measure_rates(model, state, watch) result(rate)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        type(bounce_watch), intent(in) :: watch
        real(wp) :: rate(3, size(watch%joint) + size(watch%link))    ! [rad/s, m/s]

        rate = rates_at(model, state, watch, level_velocity)
    end function measure_rates

    !> Rates and accelerations at the end of a step that is tried, its columns at hand.
    subroutine measure_end(model, state, qdd, watch, rate, acceleration)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        real(wp), intent(in) :: qdd(:)              !! accelerations of the coordinates that the state lacks (n_q)
        type(bounce_watch), intent(in) :: watch
        real(wp), intent(out), dimension(:, :) :: rate, acceleration    !! [rad/s, m/s], [rad/s2, m/s2] (3, measured)
        integer :: k

        rate = rates_at(model, state, watch, level_velocity)
        acceleration = rates_at(model, state, watch, level_given)
        do k = 1, model%n_q
            acceleration = acceleration + rates_at(model, state, watch, k)*qdd(k)
        end do
    end subroutine measure_end

    !> Look at the end of a step that is tried.
    pure subroutine look_at_end(t, rate, acceleration, watch, has_bounced)
        real(wp), intent(in) :: t                   !! [s]
        real(wp), intent(in), dimension(:, :) :: rate, acceleration    !! there (3, measured)
        type(bounce_watch), intent(inout) :: watch
        logical, intent(out) :: has_bounced         !! on the way there

        watch%end%t = t
        watch%end%has_accelerations = .true.
        watch%end%rate = rate
        watch%end%acceleration = acceleration
        has_bounced = is_thrown_back(watch)
        if (.not. has_bounced) return
        watch%is_ahead = .true.
        watch%t_bounced = t
    end subroutine look_at_end

    !> An accepted state: the end of the step tried last, or another one, of which no accelerations are known.
    pure subroutine note_start(t, rate, watch)
        real(wp), intent(in) :: t                   !! [s]
        real(wp), intent(in) :: rate(:, :)          !! (3, measured)
        type(bounce_watch), intent(inout) :: watch

        if (watch%end%has_accelerations .and. watch%end%t == t) then
            watch%start = watch%end
        else
            watch%start%t = t
            watch%start%has_accelerations = .false.
            watch%start%rate = rate
        end if
        watch%end%has_accelerations = .false.
        watch%is_ahead = watch%is_ahead .and. t < watch%t_bounced
    end subroutine note_start

    !> Has a joint or link changed the sense in which it moves, or lost its speed, and no acceleration made it?
    pure logical function is_thrown_back(watch)
        type(bounce_watch), intent(in) :: watch
        real(wp), parameter :: many = 8             !! times what constant accelerations would make
        real(wp), parameter :: large = 0.02_wp      !! part of a rate that resolved steps do not lose unseen
        real(wp), parameter :: seen = 1.0e-6_wp     !! part of the largest rate that is no rounding
        real(wp), dimension(size(watch%start%rate, 2)) :: was, is, change, acceleration
        real(wp) :: least

        associate (before => watch%start, now => watch%end)
            was = norm2(before%rate, dim=1)
            is = norm2(now%rate, dim=1)
            change = norm2(now%rate - before%rate, dim=1)
            least = max(seen*max(maxval(was), maxval(is)), watch%least_rate)
            ! the larger one may come of rounding near the dead point
            acceleration = norm2(now%acceleration, dim=1)
            if (before%has_accelerations) acceleration = min(acceleration, norm2(before%acceleration, dim=1))
            is_thrown_back = any(change > max(least, large*max(was, is), many*(now%t - before%t)*acceleration))
        end associate
    end function is_thrown_back

    !> The largest rate that a unit rate of each coordinate makes. Needs columns.
    function gains_of(model, state, watch) result(gain)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        type(bounce_watch), intent(in) :: watch
        real(wp) :: gain(model%n_q)
        integer :: k

        gain = [(maxval(norm2(rates_at(model, state, watch, k), dim=1)), k=1, model%n_q)]
    end function gains_of

    !> What is measured of the velocity, of the acceleration that is given, or of a column.
    function rates_at(model, state, watch, level) result(rate)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        type(bounce_watch), intent(in) :: watch
        integer, intent(in) :: level
        real(wp) :: rate(3, size(watch%joint) + size(watch%link))
        integer, parameter :: the_one = 1           !! variable of a joint with one axis
        real(wp) :: of_joint(lanes)
        type(vec3) :: turn
        integer :: i

        rate = 0
        do i = 1, size(watch%joint)
            of_joint = joint_rate(model, state, watch%joint(i), the_one, level)
            rate(1, i) = of_joint(1)
        end do
        do i = 1, size(watch%link)
            associate (o => orientation_of(model, watch%link(i)))
                if (level == level_velocity) then
                    turn = state%omega(o)
                else
                    turn = state%alpha(level, o)
                end if
            end associate
            rate(:, size(watch%joint) + i) = [turn%x(1), turn%y(1), turn%z(1)]
        end do
    end function rates_at
end module linkdyn_bounce_watch
