!> Angles of joints whose turns count along a forward run: those that events look at, and those that are results. They are followed
!> from one accepted state to the next, whichever instants are asked for.
!>
!> Of the values that a measured angle may have, that one is taken to which it has turned at the mean of its rates at both ends: steps
!> are so short that their errors are small, and a turn more or less would need rates quite different in between.
module linkdyn_followed_angles
    use linkdyn_constants, only: two_pi
    use linkdyn_joint_rates, only: measure_one_joint, measure_variable
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state
    use linkdyn_lane_count, only: lanes
    use linkdyn_model, only: model_type
    use linkdyn_turns, only: turning_angles, list_turning
    implicit none (type, external)
    private
    public :: followed_angles, prepare_measured_angles, prepare_joint_angles, wraps_anywhere, follow_angles, angles_about, angles_at

    type :: followed_angles
        real(wp) :: t(lanes) = 0                               !! of the accepted state [s]
        integer, allocatable, private :: joint(:)              !! whose they are
        integer, allocatable, private :: variable(:)           !! of the joint
        integer, allocatable, private :: place(:)              !! among the numbers that they belong to
        logical, allocatable, private :: counts(:)             !! a coordinate counts its turns itself
        real(wp), allocatable, private :: angle(:, :)          !! they are here (lane, number) [rad]
        real(wp), allocatable, private :: spin(:, :)           !! and turn so fast (lane, number) [rad/s]
    end type followed_angles

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
        allocate (angles%angle(lanes, model%n_variable), angles%spin(lanes, model%n_variable), source=0.0_wp)
    end subroutine prepare_joint_angles

    !> Is there an angle to follow?
    pure logical function wraps_anywhere(angles)
        type(followed_angles), intent(in) :: angles

        wraps_anywhere = .false.
        if (allocated(angles%counts)) wraps_anywhere = .not. all(angles%counts)
    end function wraps_anywhere

    !> Where these angles have got to in a state.
    subroutine follow_angles(model, state, t, is_accepted, angles)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        real(wp), intent(in) :: t(lanes)                       !! [s]
        logical, intent(in) :: is_accepted(lanes)
        type(followed_angles), intent(inout) :: angles
        real(wp), dimension(lanes, size(angles%angle, 2)) :: angle, spin
        integer :: i

        call measure_angles(model, state, t, angles, angle, spin)
        do i = 1, size(angles%place)
            associate (k => angles%place(i))
                where (is_accepted .and. abs(angle(:, k)) <= huge(1.0_wp))
                    angles%angle(:, k) = angle(:, k)
                    angles%spin(:, k) = spin(:, k)
                end where
            end associate
        end do
        where (is_accepted) angles%t = t
    end subroutine follow_angles

    !> These angles in a state that a step from the accepted one leads to.
    function angles_at(model, state, t, angles) result(angle)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        real(wp), intent(in) :: t(lanes)                       !! [s]
        type(followed_angles), intent(in) :: angles
        real(wp), dimension(lanes, size(angles%angle, 2)) :: angle, spin    ! (lane, number) [rad], [rad/s]

        call measure_angles(model, state, t, angles, angle, spin)
    end function angles_at

    subroutine measure_angles(model, state, t, angles, angle, spin)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        real(wp), intent(in) :: t(lanes)                       !! [s]
        type(followed_angles), intent(in) :: angles
        real(wp), intent(out), dimension(lanes, size(angles%angle, 2)) :: angle, spin    !! (lane, number) [rad], [rad/s]
        real(wp), dimension(lanes, 3) :: value, rate   ! of one joint
        real(wp) :: about(lanes)
        integer :: i, last

        angle = angles%angle
        spin = angles%spin
        last = 0
        do i = 1, size(angles%place)
            associate (k => angles%place(i), j => angles%joint(i), v => angles%variable(i))
                if (angles%counts(i)) then
                    call measure_variable(model, state, j, v, angles%angle(:, k), angle(:, k), spin(:, k))
                    cycle
                end if
                if (j /= last) call measure_one_joint(model, state, j, value, rate)
                last = j
                spin(:, k) = rate(:, v)
                about = angles%angle(:, k) + (angles%spin(:, k) + spin(:, k))/2*(t - angles%t)
                angle(:, k) = value(:, v) - two_pi*anint((value(:, v) - about)/two_pi)
            end associate
        end do
    end subroutine measure_angles

    !> About where these angles are at other instants.
    pure function angles_about(angles, t) result(about)
        type(followed_angles), intent(in) :: angles
        real(wp), intent(in) :: t(lanes)                       !! [s]
        real(wp) :: about(lanes, size(angles%angle, 2))        !! (lane, number) [rad]

        about = angles%angle + angles%spin*spread(t - angles%t, 2, size(angles%angle, 2))
    end function angles_about
end module linkdyn_followed_angles
