!> Does a step lead to a mechanism that was thrown back?
!>
!> At the dead point of a coordinate the mechanism moves on while the coordinate turns back: the state behind it has the same
!> coordinates as one before it, in which all joints turn the other way. A step over the dead point ends in that one unless
!> something is known of the way between. Joint rates tell: over a short step they change by what their accelerations make, and
!> where one has changed its sign without these the mechanism has been thrown back. Coordinates that can be exchanged
!> (`linkdyn_coordinate_watch`) never come that far; this is for those of poses and of joints with several axes.
module linkdyn_bounce_watch
    use linkdyn_coordinate_watch, only: has_one_axis
    use linkdyn_joint_rates, only: joint_rate
    use linkdyn_joint_table, only: is_pose_part
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state
    use linkdyn_lane_count, only: lanes
    use linkdyn_led_mechanism, only: follows_assembly
    use linkdyn_model, only: model_type, is_released
    use linkdyn_planar_motion, only: level_velocity, level_given
    use linkdyn_scene, only: coordinate_joint
    implicit none (type, external)
    private
    public :: bounce_watch, prepare_bounce_watch, look_at_end, note_start

    !> Rates and accelerations of hinges and slides at an instant.
    type :: motion_type
        real(wp) :: t = 0                           !! [s]
        logical :: has_accelerations = .false.
        real(wp), allocatable :: rate(:)            !! [rad/s, m/s] (joint)
        real(wp), allocatable :: acceleration(:)    !! [rad/s2, m/s2] (joint)
    end type motion_type

    type :: bounce_watch
        logical :: is_on = .false.
        logical :: is_ahead = .false.               !! a step that went further than the last accepted state has bounced
        real(wp), private :: t_bounced = 0          !! its end [s]
        integer, allocatable, private :: joint(:)   !! with one axis
        type(motion_type), private :: start         !! of the step
        type(motion_type), private :: end           !! of the step tried last
    end type bounce_watch

contains

    subroutine prepare_bounce_watch(model, is_free, watch)
        type(model_type), intent(in) :: model
        logical, intent(in) :: is_free(:)           !! coordinates that are not driven (n_q)
        type(bounce_watch), intent(out) :: watch
        integer :: j

        watch%joint = pack([(j, j=1, model%n_joint)], [(is_measured(j), j=1, model%n_joint)])
        allocate (watch%start%rate(size(watch%joint)), watch%start%acceleration(size(watch%joint)), source=0.0_wp)
        watch%end = watch%start
        watch%is_on = follows_assembly(model) .and. size(watch%joint) > 0 .and. any(is_free .and. .not. may_be_exchanged())

    contains

        pure logical function is_measured(j)
            integer, intent(in) :: j

            associate (joint => model%joint(j))
                is_measured = has_one_axis(joint%kind) .and. .not. is_released(joint) &
                              .and. .not. any([on_leg(joint%link(1)), on_leg(joint%link(2))])
            end associate
        end function is_measured

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

    !> Look at the end of a step that is tried, its columns at hand.
    subroutine look_at_end(model, state, t, qdd, watch, has_bounced)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        real(wp), intent(in) :: t                   !! [s]
        real(wp), intent(in) :: qdd(:)              !! accelerations of the coordinates that the state lacks (n_q)
        type(bounce_watch), intent(inout) :: watch
        logical, intent(out) :: has_bounced         !! on the way there
        integer :: i, k

        watch%end%t = t
        watch%end%has_accelerations = .true.
        do i = 1, size(watch%joint)
            associate (j => watch%joint(i))
                watch%end%rate(i) = rate_at(model, state, j, level_velocity)
                watch%end%acceleration(i) = rate_at(model, state, j, level_given)
                do k = 1, model%n_q
                    watch%end%acceleration(i) = watch%end%acceleration(i) + rate_at(model, state, j, k)*qdd(k)
                end do
            end associate
        end do
        has_bounced = is_thrown_back(watch)
        if (.not. has_bounced) return
        watch%is_ahead = .true.
        watch%t_bounced = t
    end subroutine look_at_end

    !> An accepted state: the end of the step tried last, or another one, of which no accelerations are known.
    subroutine note_start(model, state, t, watch)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        real(wp), intent(in) :: t                   !! [s]
        type(bounce_watch), intent(inout) :: watch
        integer :: i

        if (watch%end%has_accelerations .and. watch%end%t == t) then
            watch%start = watch%end
        else
            watch%start%t = t
            watch%start%has_accelerations = .false.
            watch%start%rate = [(rate_at(model, state, watch%joint(i), level_velocity), i=1, size(watch%joint))]
        end if
        watch%end%has_accelerations = .false.
        watch%is_ahead = watch%is_ahead .and. t < watch%t_bounced
    end subroutine note_start

    !> Has a joint changed the sense in which it moves, or lost its speed, and no acceleration made it?
    pure logical function is_thrown_back(watch)
        type(bounce_watch), intent(in) :: watch
        real(wp), parameter :: many = 8             !! times what constant accelerations would make
        real(wp), parameter :: large = 0.5_wp       !! part of a rate that resolved steps do not lose unseen
        real(wp), parameter :: seen = 1.0e-6_wp     !! part of the largest rate that is no rounding
        real(wp), dimension(size(watch%joint)) :: change, acceleration, explained
        real(wp) :: least

        associate (before => watch%start, now => watch%end)
            least = seen*max(maxval(abs(before%rate)), maxval(abs(now%rate)))
            ! the larger one may come of rounding near the dead point
            acceleration = abs(now%acceleration)
            if (before%has_accelerations) acceleration = min(acceleration, abs(before%acceleration))
            explained = many*(now%t - before%t)*acceleration
            change = abs(now%rate - before%rate)
            is_thrown_back = any(change > max(least, large*max(abs(before%rate), abs(now%rate)), explained))
        end associate
    end function is_thrown_back

    real(wp) function rate_at(model, state, j, level)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        integer, intent(in) :: j, level
        integer, parameter :: the_one = 1           !! variable of a joint with one axis
        real(wp) :: rate(lanes)

        rate = joint_rate(model, state, j, the_one, level)
        rate_at = rate(1)
    end function rate_at
end module linkdyn_bounce_watch
