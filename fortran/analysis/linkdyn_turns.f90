!> Joint angles along a motion count their turns.
!>
!> An angle that is a coordinate is what the coordinate is; the others begin within half a turn of zero. Who has followed the angles
!> on their way, as a forward run does, says where they are about at each sample. Else they turn from sample to sample at the mean
!> of their rates at both ends of the straight way between these (`turn_at_mean_rates`), where that can be believed; whoever calls
!> looks closer where it cannot.
module linkdyn_turns
    use linkdyn_constants, only: pi, two_pi
    use linkdyn_joint_table, only: wraps, goes_round
    use linkdyn_joint_rates, only: coordinate_of
    use linkdyn_kinds, only: wp
    use linkdyn_model, only: model_type, is_length, scene_size
    use linkdyn_scene, only: joint_n_variable, joint_spherical, frame_link
    use linkdyn_whole_turns, only: told_turns, least_angle
    implicit none (type, external)
    private
    public :: turn_count, turning_angles, list_turning, turns_by_itself, count_sample, take_turns_off, turn_at_mean_rates
    public :: keeps_turns, size_of_step, largest_step

    !> Steps of coordinates that are longer leave room for a turn between alike rates [rad, or the scene's size].
    real(wp), parameter :: largest_step = pi/2
    !> Steps that are shorter turn nothing by much, wherever they lead: those between samples at rest are all rounding.
    real(wp), parameter :: least_step = sqrt(epsilon(1.0_wp))
    !> Cosine of a ball's middle angle below which only the sum or the difference of the others is told.
    real(wp), parameter :: at_pole = 1.0e-6_wp

    !> The last sample that had joint variables.
    type :: turn_count
        logical :: has_begun = .false.
        real(wp), allocatable :: before(:)             !! joint variables (n_variable)
        real(wp), allocatable :: about(:, :)           !! where angles of the next samples are; absent: nobody knows (n_variable, n)
        ! ---- where nobody knows
        real(wp), allocatable :: q(:), qd(:)           !! (n_q)
        logical :: by_quaternion = .false.             !! attitudes went by quaternions, so qd has angular velocities for them
        real(wp), allocatable :: rate(:)               !! of the joint variables (n_variable)
        real(wp), allocatable :: branch(:)             !! its assembly, see `sample_assembly`; absent: there is but one
        real(wp), allocatable :: set_out(:), place(:, :)
        integer :: n_in_vain = 0                       !! closer looks along the way that told nothing, since the last one that did
        integer :: n_piece = 0                         !! of ways looked at so far
    end type turn_count

    !> Joint variables that are angles of whole turns, as those are that go round, and coordinates.
    type :: turning_angles
        integer, allocatable :: joint(:)               !! whose they are
        integer, allocatable :: of_joint(:)            !! which of its variables
        integer, allocatable :: variable(:)            !! of all joint variables
        integer, allocatable :: coordinate(:)          !! that it is; 0: none
        logical, allocatable :: is_idle(:)             !! of a ball that an idle spin turns: it says nothing, and may pass its pole
        integer, allocatable :: middle(:)              !! the ball's middle angle, among all joint variables; 0: it is no ball's
        real(wp), allocatable :: weight(:)             !! of the coordinates in steps: lengths over the scene's size (n_q) [1, 1/m]
    end type turning_angles

contains

    !> The joint variables that may make whole turns, and what a step of each coordinate counts beside the others.
    pure subroutine list_turning(model, angles)
        type(model_type), intent(in) :: model
        type(turning_angles), intent(out) :: angles
        integer :: j, k, v, c

        allocate (angles%joint(0), angles%of_joint(0), angles%variable(0), angles%coordinate(0), angles%is_idle(0), &
                  angles%middle(0))
        do j = 1, model%n_joint
            do v = 1, joint_n_variable(model%joint(j)%told_kind)
                c = coordinate_of(model, j, v)
                if (.not. (goes_round(model%joint(j)%told_kind, v) .or. (c > 0 .and. wraps(model%joint(j)%told_kind, v)))) cycle
                angles%joint = [angles%joint, j]
                angles%of_joint = [angles%of_joint, v]
                angles%variable = [angles%variable, model%joint(j)%first_variable + v]
                angles%coordinate = [angles%coordinate, c]
                angles%is_idle = [angles%is_idle, is_idle(model, j)]
                angles%middle = [angles%middle, merge(model%joint(j)%first_variable + 2, 0, &
                                                      model%joint(j)%told_kind == joint_spherical)]
            end do
        end do
        allocate (angles%weight(model%n_q), source=1.0_wp)
        do k = 1, model%n_q
            if (is_length(model, k)) angles%weight(k) = 1/scene_size(model)
        end do
    end subroutine list_turning

    !> Has a scene an angle of whole turns that is no coordinate?
    pure logical function turns_by_itself(model)
        type(model_type), intent(in) :: model
        type(turning_angles) :: angles

        call list_turning(model, angles)
        turns_by_itself = any(angles%coordinate == 0)
    end function turns_by_itself

    !> Is a joint a ball on a link that spins idly?
    pure logical function is_idle(model, joint)
        type(model_type), intent(in) :: model
        integer, intent(in) :: joint

        associate (link => pack(model%joint(joint)%link, model%joint(joint)%link /= frame_link))
            is_idle = model%joint(joint)%told_kind == joint_spherical .and. any(model%link(link)%spin > 0)
        end associate
    end function is_idle

    !> The turns that a sample's angles have where they are about.
    pure subroutine count_sample(angles, about, value, q)
        type(turning_angles), intent(in) :: angles
        real(wp), intent(in) :: about(:)               !! (n_variable) [rad]
        real(wp), intent(inout) :: value(:)            !! joint variables (n_variable)
        real(wp), intent(in), optional :: q(:)         !! coordinates, which have theirs; absent: they are about, too
        real(wp) :: place
        integer :: i

        do i = 1, size(angles%variable)
            associate (v => angles%variable(i), k => angles%coordinate(i))
                place = about(v)
                if (present(q) .and. k > 0) place = q(k)
                value(v) = value(v) - two_pi*told_turns(value(v) - place)
            end associate
        end do
    end subroutine count_sample

    !> Angles of samples on their own are within half a turn of zero. Half a turn itself is told as one up, also where rounding, or
    !> the sign of a zero, has it the other way.
    pure subroutine take_turns_off(model, variable)
        type(model_type), intent(in) :: model
        real(wp), intent(inout) :: variable(:, :)      !! joint variables (n_variable, n)
        integer :: j, v

        do j = 1, model%n_joint
            do v = 1, joint_n_variable(model%joint(j)%told_kind)
                if (.not. goes_round(model%joint(j)%told_kind, v)) cycle
                associate (angle => variable(model%joint(j)%first_variable + v, :))
                    angle = angle - two_pi*told_turns(angle)
                end associate
            end do
        end do
    end subroutine take_turns_off

    !> How far a step of the coordinates goes: the largest angle of it, a length over the scene's size.
    pure real(wp) function size_of_step(angles, step) result(length)
        type(turning_angles), intent(in) :: angles
        real(wp), intent(in) :: step(:)                !! (n_q)

        length = maxval(abs(step)*angles%weight)
    end function size_of_step

    !> How far angles turn on a straight step of the coordinates: at the mean of their rates at both ends. Rates are those of the
    !> motion there, which leads along the step at one end at least.
    !>
    !> Believed where the step is a quarter turn at most, where rates differ by no more than a quarter turn, and where the angles
    !> as they are measured agree to an eighth of a turn. A turn that all this overlooks would have to come and go within the step.
    !> Angles that say nothing are not asked, nor are those of a ball at its pole, where rounding decides between two of them.
    pure subroutine turn_at_mean_rates(angles, q, q_there, qd, qd_there, rate, rate_there, value, value_there, turned, is_sure)
        type(turning_angles), intent(in) :: angles
        real(wp), intent(in), contiguous :: q(:), q_there(:)     !! at the step's beginning and end (n_q)
        real(wp), intent(in), contiguous :: qd(:), qd_there(:)   !! likewise
        real(wp), intent(in), contiguous :: rate(:), rate_there(:)      !! (n_variable)
        real(wp), intent(in), contiguous :: value(:), value_there(:)    !! but for whole turns (n_variable)
        real(wp), intent(out), contiguous :: turned(:)           !! (n_variable) [rad]
        logical, intent(out) :: is_sure
        real(wp) :: duration(2), at_end(2)
        integer :: i

        turned = 0
        call find_durations(angles%weight, q, q_there, qd, qd_there, duration, is_sure)
        if (.not. is_sure) return
        do i = 1, size(angles%variable)
            if (angles%coordinate(i) > 0) cycle
            associate (v => angles%variable(i))
                at_end(1) = rate(v)*duration(1)
                at_end(2) = rate_there(v)*duration(2)
                turned(v) = at_end(1) + at_end(2)
                if (angles%is_idle(i)) cycle
                if (is_at_pole(angles%middle(i))) then
                    turned(v) = least_angle(value_there(v) - value(v))
                    cycle
                end if
                if (all(duration /= 0)) is_sure = is_sure .and. abs(at_end(2) - at_end(1)) <= pi/4
                is_sure = is_sure .and. abs(least_angle(value_there(v) - value(v) - turned(v))) <= pi/4
            end associate
        end do

    contains

        pure logical function is_at_pole(middle)
            integer, intent(in) :: middle

            is_at_pole = .false.
            if (middle > 0) is_at_pole = min(abs(cos(value(middle))), abs(cos(value_there(middle)))) < at_pole
        end function is_at_pole
    end subroutine turn_at_mean_rates

    !> Does nothing turn by as much on a straight step as could be a turn, so that `turn_at_mean_rates` is surely sure and
    !> `count_sample` finds nothing to count? Angles have their turns at the beginning, and are told with the same ones at the end;
    !> coordinates are within a step of that. All joint variables are asked, which a compiler does side by side.
    pure logical function keeps_turns(angles, q, q_there, qd, qd_there, rate, rate_there, value, value_there) result(keeps)
        type(turning_angles), intent(in) :: angles
        real(wp), intent(in), contiguous :: q(:), q_there(:)     !! at the step's beginning and end (n_q)
        real(wp), intent(in), contiguous :: qd(:), qd_there(:)   !! likewise
        real(wp), intent(in), contiguous :: rate(:), rate_there(:)      !! (n_variable)
        real(wp), intent(in), contiguous :: value(:), value_there(:)    !! (n_variable)
        real(wp), parameter :: little = pi/8           ! half of what is believed of measured angles and of rates
        real(wp) :: duration(2)
        integer :: k, n_more

        call find_durations(angles%weight, q, q_there, qd, qd_there, duration, keeps)
        if (.not. keeps) return
        duration = abs(duration)
        n_more = 0
        do k = 1, size(value)
            ! written so that what is no number is more
            if (.not. (abs(value_there(k) - value(k)) <= little .and. &
                       abs(rate(k))*duration(1) + abs(rate_there(k))*duration(2) <= little)) n_more = n_more + 1
        end do
        keeps = n_more == 0
    end function keeps_turns

    !> How long each end's motion goes on to make a step: both together, or one alone where the motion turns back in between. Not
    !> found of a step that is too long, or along which neither leads.
    pure subroutine find_durations(weight, q, q_there, qd, qd_there, duration, is_found)
        real(wp), intent(in), contiguous :: weight(:)            !! of coordinates (n_q)
        real(wp), intent(in), contiguous :: q(:), q_there(:), qd(:), qd_there(:)    !! at both ends (n_q)
        real(wp), intent(out) :: duration(2)                     !! [s]
        logical, intent(out) :: is_found
        real(wp) :: step, rate(2)                                ! of one coordinate, weighted
        real(wp) :: longest, square, along(2), of_rate(2), mixed
        integer :: k

        longest = 0
        square = 0
        along = 0
        of_rate = 0
        mixed = 0
        do k = 1, size(q)
            step = (q_there(k) - q(k))*weight(k)
            rate(1) = qd(k)*weight(k)
            rate(2) = qd_there(k)*weight(k)
            longest = max(longest, abs(step))
            square = square + step*step
            along = along + step*rate
            of_rate = of_rate + rate*rate
            mixed = mixed + rate(1)*rate(2)
        end do
        duration = 0
        is_found = .not. longest > least_step
        if (is_found .or. .not. longest <= largest_step) return
        ! Ends that lead in opposite senses have no mean that means anything.
        if (along(1)*along(2) >= 0) then
            call compare(along(1) + along(2), of_rate(1) + 2*mixed + of_rate(2), duration(1), is_found)
            duration(2) = duration(1)
        end if
        if (.not. is_found) call compare(along(1), of_rate(1), duration(1), is_found)
        if (is_found) return
        duration(1) = 0
        call compare(along(2), of_rate(2), duration(2), is_found)

    contains

        !> A rate that leads along the step: given the product of both, and the rate's square.
        pure subroutine compare(along, of_rate, duration, is_along)
            real(wp), intent(in) :: along, of_rate
            real(wp), intent(out) :: duration
            logical, intent(out) :: is_along
            real(wp), parameter :: fair = 0.1_wp       !! of the step may lead elsewhere: of a quarter turn some degrees

            duration = 0
            is_along = of_rate > 0 .and. of_rate <= huge(1.0_wp)
            if (.not. is_along) return
            duration = along/of_rate
            is_along = square - duration*along <= fair**2*square
        end subroutine compare
    end subroutine find_durations
end module linkdyn_turns
