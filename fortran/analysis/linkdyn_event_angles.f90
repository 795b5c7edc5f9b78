!> Angles that events look at, whose turns count: a measure that wraps is followed from one accepted state to the next.
module linkdyn_event_angles
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state
    use linkdyn_lane_count, only: lanes
    use linkdyn_measures, only: follow_angle
    use linkdyn_model, only: model_type
    implicit none (type, external)
    private
    public :: event_angles, prepare_angles, wraps_anywhere, follow_angles, angles_about

    type :: event_angles
        real(wp) :: t(lanes) = 0                               !! of the accepted state [s]
        integer, allocatable, private :: turning(:)            !! measures that wrap
        real(wp), allocatable, private :: angle(:, :)          !! they are here (lane, measure) [rad]
        real(wp), allocatable, private :: spin(:, :)           !! and turn so fast (lane, measure) [rad/s]
    end type event_angles

contains

    !> All measures are near where the scene has them.
    subroutine prepare_angles(model, angles)
        type(model_type), intent(in) :: model
        type(event_angles), intent(inout) :: angles
        integer :: i

        associate (measure => model%scene%laws%measure)
            allocate (angles%angle(lanes, size(measure)), angles%spin(lanes, size(measure)), source=0.0_wp)
            angles%turning = pack([(i, i=1, size(measure))], measure%wraps)
            do i = 1, size(measure)
                angles%angle(:, i) = measure(i)%near
            end do
        end associate
    end subroutine prepare_angles

    !> Is there a measure to follow?
    pure logical function wraps_anywhere(angles)
        type(event_angles), intent(in) :: angles

        wraps_anywhere = .false.
        if (allocated(angles%turning)) wraps_anywhere = size(angles%turning) > 0
    end function wraps_anywhere

    !> Where these angles have got to in a state.
    subroutine follow_angles(model, state, t, is_accepted, angles)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        real(wp), intent(in) :: t(lanes)                       !! [s]
        logical, intent(in) :: is_accepted(lanes)
        type(event_angles), intent(inout) :: angles
        real(wp) :: about(lanes, size(angles%angle, 2)), value(lanes), rate(lanes)
        integer :: i

        about = angles_about(angles, t)
        do i = 1, size(angles%turning)
            associate (k => angles%turning(i))
                call follow_angle(model, state, k, about(:, k), value, rate)
                where (is_accepted .and. abs(value) <= huge(1.0_wp))
                    angles%angle(:, k) = value
                    angles%spin(:, k) = rate
                end where
            end associate
        end do
        where (is_accepted) angles%t = t
    end subroutine follow_angles

    !> About where these angles are at other instants.
    pure function angles_about(angles, t) result(about)
        type(event_angles), intent(in) :: angles
        real(wp), intent(in) :: t(lanes)                       !! [s]
        real(wp) :: about(lanes, size(angles%angle, 2))        !! (lane, measure) [rad]

        about = angles%angle + angles%spin*spread(t - angles%t, 2, size(angles%angle, 2))
    end function angles_about
end module linkdyn_event_angles
