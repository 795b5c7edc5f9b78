!> How motors whose transmissions lose turn while impulses act.
!>
!> Impulses grow together, in proportion, from nothing to what they are. What transmissions lose of them depends on the way that
!> motors turn and on what drives: the rotor that it brakes, or the load that it speeds up. Where a motor turns back on the way,
!> the mechanism responds otherwise from there on. So the way has phases, from one motor that turns back to the next, and the
!> response is the mean of theirs by the parts of the impulses that fall to them,
!>
!>     v+ = v- + sum over phases (f_k+1 - f_k) W_k p,    the motor i turns back at f_i:  s'_i + (what p has changed up to f_i) = 0.
!>
!> No time passes, so no speed stays below that at which losses fade. A motor at rest turns the way it is pushed.
!>
!> What stops throw back then is told by energy (Stronge): the work that a stop gives back is the square of its restitution times
!> that which it has taken, whatever has become of the response in between. Where nothing turns back speeds have that ratio, too.
module linkdyn_impulse_path
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    implicit none (type, external)
    private
    public :: impulse_path, begin_path, most_trials, same_way, no_way

    integer, parameter :: most_trials = 60             !! of ways that impulses go
    real(wp), parameter :: same_way = 1.0e-10_wp       !! change of the way from trial to trial: that is it
    real(wp), parameter :: no_way = 1.0e-6_wp          !! change in the last one: there is none

    !> Impulses of stops and clutches, and the motors with losses.
    type :: impulse_path
        real(wp), allocatable :: along(:, :)           !! impulses, of any size (lane, n_held)
        real(wp), allocatable :: rate(:, :)            !! of the motors' joint variables before (lane, motor) [m/s, rad/s]
        real(wp), allocatable :: sense(:, :)           !! in which they move at first: +1, -1 (lane, motor)
        real(wp), allocatable :: turn(:, :)            !! part of the impulses at which they turn back; 1: they don't (lane, motor)
        real(wp), allocatable :: gain(:, :, :, :)      !! of these rates by a unit of each push in each phase (lane, motor, push,
                                                       !! phase)
        real(wp), allocatable :: response(:, :, :, :)  !! W of each phase (lane, of, by, phase)
        logical :: jams(lanes) = .false.               !! nothing moves along them for what transmissions lose
        real(wp), allocatable, private :: turn_before(:, :), found_before(:, :)    !! a trial ago (lane, motor)
    contains
        procedure :: n_phase, part_of_phase, sense_in_phase, is_used, follow, let_rest, throw_back, loss_beside_mean
    end type impulse_path

contains

    !> Impulses go straight along, until it is known how they turn motors back.
    subroutine begin_path(along, rate, path)
        real(wp), intent(in) :: along(:, :), rate(:, :)
        type(impulse_path), intent(out) :: path

        path%along = along
        path%rate = rate
        path%sense = sign(1.0_wp, rate)
        allocate (path%turn(lanes, size(rate, 2)), source=1.0_wp)
        if (size(rate, 2) == 0) return                 ! responses do not depend on the way
        allocate (path%gain(lanes, size(rate, 2), size(along, 2), size(rate, 2) + 1), &
                  path%response(lanes, size(along, 2), size(along, 2), size(rate, 2) + 1), source=0.0_wp)
    end subroutine begin_path

    pure integer function n_phase(self)
        class(impulse_path), intent(in) :: self

        n_phase = size(self%rate, 2) + 1
    end function n_phase

    !> Does anything of any impulse fall to a phase? The first one is always looked at.
    pure logical function is_used(self, phase)
        class(impulse_path), intent(in) :: self
        integer, intent(in) :: phase

        is_used = phase == 1 .or. any(self%part_of_phase(phase) > 0)
    end function is_used

    !> How much of the impulses falls to a phase.
    pure function part_of_phase(self, phase) result(part)
        class(impulse_path), intent(in) :: self
        integer, intent(in) :: phase
        real(wp) :: part(lanes)
        integer :: lane

        part = [(begin_of_phase(self%turn(lane, :), phase + 1) - begin_of_phase(self%turn(lane, :), phase), lane=1, lanes)]
    end function part_of_phase

    !> The way that motors turn in a phase.
    pure function sense_in_phase(self, phase) result(sense)
        class(impulse_path), intent(in) :: self
        integer, intent(in) :: phase
        real(wp) :: sense(lanes, size(self%sense, 2))
        integer :: lane

        do lane = 1, lanes
            sense(lane, :) = merge(-self%sense(lane, :), self%sense(lane, :), has_turned(self%turn(lane, :), phase))
        end do
    end function sense_in_phase

    !> Where a phase begins: where one more motor turns back; behind the last one, the end.
    pure real(wp) function begin_of_phase(turn, phase) result(part)
        real(wp), intent(in) :: turn(:)
        integer, intent(in) :: phase
        integer :: i

        part = 0
        if (phase > size(turn) + 1) part = 1
        if (phase == 1 .or. phase > size(turn) + 1) return
        do i = 1, size(turn)
            if (rank_of(turn, i) == phase - 1) part = turn(i)
        end do
    end function begin_of_phase

    pure function has_turned(turn, phase)
        real(wp), intent(in) :: turn(:)
        integer, intent(in) :: phase
        logical :: has_turned(size(turn))
        integer :: i

        has_turned = [(rank_of(turn, i) < phase, i=1, size(turn))]
    end function has_turned

    !> The how-manieth to turn back.
    pure integer function rank_of(turn, i)
        real(wp), intent(in) :: turn(:)
        integer, intent(in) :: i

        rank_of = count(turn < turn(i)) + count(turn(:i) == turn(i))
    end function rank_of

    !> How far impulses, and what motors do while they grow, go another way than that along which responses were found, as parts of
    !> the whole. If they do, responses are to be found once more, along them.
    function follow(self, is_struck, impulse) result(change)
        class(impulse_path), intent(inout) :: self
        logical, intent(in) :: is_struck(lanes)
        real(wp), intent(in) :: impulse(:, :)          !! (lane, n_held)
        real(wp) :: change(lanes)
        real(wp), dimension(size(impulse, 2)) :: way, way_before
        real(wp), dimension(lanes, size(self%rate, 2)) :: found, last
        integer :: lane

        change = 0
        last = self%turn
        found = self%turn
        do lane = 1, lanes
            if (.not. is_struck(lane)) cycle
            way = impulse(lane, :)/max(maxval(abs(impulse(lane, :))), tiny(1.0_wp))
            way_before = self%along(lane, :)/max(maxval(abs(self%along(lane, :))), tiny(1.0_wp))
            change(lane) = maxval(abs(way - way_before))
            call turn_motors(self, lane, impulse(lane, :), found(lane, :), change(lane))
            change(lane) = max(change(lane), maxval([0.0_wp, abs(found(lane, :) - last(lane, :))]))
        end do
        call draw_nearer(self, found)
        self%turn_before = last
        self%found_before = found
        self%along = impulse
    end function follow

    !> Where motors turn back. Each goes on as before its own turn; those at rest learn which way they are pushed.
    subroutine turn_motors(self, lane, impulse, turn, change)
        class(impulse_path), intent(inout) :: self
        integer, intent(in) :: lane
        real(wp), intent(in) :: impulse(:)
        real(wp), intent(inout) :: turn(:)             !! (motor)
        real(wp), intent(inout) :: change
        real(wp) :: rate(size(turn)), slope(size(turn)), first, last, whole
        logical :: is_ahead(size(turn)), is_beyond(size(turn))
        integer :: phase, i

        rate = self%rate(lane, :)
        slope = matmul(self%gain(lane, :, :, 1), impulse)
        do i = 1, size(turn)
            if (rate(i) /= 0 .or. slope(i)*self%sense(lane, i) >= 0) cycle
            self%sense(lane, i) = -self%sense(lane, i)
            change = 1
        end do
        turn = 1
        is_ahead = .true.
        do phase = 1, size(turn) + 1
            first = begin_of_phase(self%turn(lane, :), phase)
            last = begin_of_phase(self%turn(lane, :), phase + 1)
            if (phase > 1 .and. first == last) cycle
            slope = matmul(self%gain(lane, :, :, phase), impulse)
            is_beyond = has_turned(self%turn(lane, :), phase + 1)
            do i = 1, size(turn)
                if (.not. is_ahead(i) .or. self%rate(lane, i) == 0) cycle
                whole = merge(1.0_wp, last, is_beyond(i)) - first
                if (self%sense(lane, i)*(rate(i) + whole*slope(i)) < 0) turn(i) = min(first - rate(i)/slope(i), 1.0_wp)
            end do
            is_ahead = is_ahead .and. .not. is_beyond .and. turn >= 1
            rate = rate + (last - first)*slope
        end do
        ! What turns back and is pushed forward again sticks.
        self%jams(lane) = self%jams(lane) .or. any(turn < 1 .and. self%turn(lane, :) < 1 &
                                                   .and. self%sense(lane, :)*rate > no_way*abs(self%rate(lane, :)))
    end subroutine turn_motors

    !> The next trial: a part that is a straight line of the one before is found by the secant.
    subroutine draw_nearer(self, found)
        class(impulse_path), intent(inout) :: self
        real(wp), intent(in) :: found(:, :)            !! for what was tried (lane, motor)
        real(wp), dimension(lanes, size(found, 2)) :: tried, miss, miss_before

        tried = self%turn
        self%turn = found
        if (.not. allocated(self%found_before)) return
        miss = found - tried
        miss_before = self%found_before - self%turn_before
        where (found < 1 .and. miss /= 0 .and. miss /= miss_before)
            self%turn = tried - miss*(tried - self%turn_before)/(miss - miss_before)
        end where
        where (.not. (self%turn > 0 .and. self%turn < 1)) self%turn = found
    end subroutine draw_nearer

    !> Ratios of speeds behind and before at which stops give back as much energy as they should: the next ones to try, once it is
    !> known how motors turn with these.
    subroutine throw_back(self, speed, restitution, ratio, change)
        class(impulse_path), intent(inout) :: self
        real(wp), intent(in) :: speed(:, :)            !! apart, before (lane, n_stop)
        real(wp), intent(in) :: restitution(:)         !! (n_stop)
        real(wp), intent(inout) :: ratio(:, :)         !! (lane, n_stop)
        real(wp), intent(out) :: change(lanes)         !! of the ratios
        real(wp) :: taken, given, next
        integer :: lane, i

        change = 0
        do i = 1, size(restitution)
            do lane = 1, lanes
                if (.not. self%along(lane, i) > 0 .or. .not. ratio(lane, i) > 0) cycle
                call work_of_stop(self, lane, i, speed(lane, i), taken, given)
                next = ratio(lane, i)
                if (given > 0) next = next*restitution(i)*sqrt(taken/given)
                change(lane) = max(change(lane), abs(next - ratio(lane, i)))
                ratio(lane, i) = next
            end do
        end do
        if (allocated(self%found_before)) deallocate (self%found_before, self%turn_before)
    end subroutine throw_back

    !> What cannot be driven back is not thrown back.
    subroutine let_rest(self, is_struck, ratio, has_given_up)
        class(impulse_path), intent(inout) :: self
        logical, intent(in) :: is_struck(lanes)
        real(wp), intent(inout) :: ratio(:, :)         !! (lane, n_stop)
        logical, intent(out) :: has_given_up           !! a ratio has become zero: all is to be tried anew
        real(wp), parameter :: nothing = 1.0e-9_wp     !! of the response at first: that is none
        integer :: lane, phase, i

        has_given_up = .false.
        do phase = 2, self%n_phase()
            if (.not. self%is_used(phase)) cycle
            do i = 1, size(ratio, 2)
                do lane = 1, lanes
                    if (.not. (is_struck(lane) .and. ratio(lane, i) > 0)) cycle
                    associate (first => self%response(lane, i, i, 1), now => self%response(lane, i, i, phase))
                        if (now > nothing*first .or. .not. first > 0) cycle
                    end associate
                    ratio(lane, i) = 0
                    self%turn(lane, :) = 1
                    has_given_up = .true.
                end do
            end do
        end do
        if (has_given_up .and. allocated(self%found_before)) deallocate (self%found_before, self%turn_before)
    end subroutine let_rest

    !> Work that a stop takes while its impulse grows, and gives back.
    pure subroutine work_of_stop(self, lane, i, speed, taken, given)
        class(impulse_path), intent(in) :: self
        integer, intent(in) :: lane, i
        real(wp), intent(in) :: speed                  !! apart, before
        real(wp), intent(out) :: taken, given          !! [J]
        real(wp) :: part, from, to
        integer :: phase

        taken = 0
        given = 0
        from = speed
        do phase = 1, self%n_phase()
            part = begin_of_phase(self%turn(lane, :), phase + 1) - begin_of_phase(self%turn(lane, :), phase)
            if (.not. part > 0) cycle
            to = from + part*dot_product(self%response(lane, i, :, phase), self%along(lane, :))
            taken = taken - self%along(lane, i)*part*mean_below_zero(from, to)
            given = given - self%along(lane, i)*part*mean_below_zero(-from, -to)
            from = to
        end do
    end subroutine work_of_stop

    !> Mean of what is below zero of a straight line.
    elemental real(wp) function mean_below_zero(from, to) result(mean)
        real(wp), intent(in) :: from, to

        mean = (min(from, 0.0_wp) + min(to, 0.0_wp))/2
        if (from*to < 0) mean = mean*abs(min(from, to)/(from - to))
    end function mean_below_zero

    !> Speeds go no straight line while impulses grow: what stops and clutches take beside the mean of speeds before and behind [J].
    pure function loss_beside_mean(self, impulse) result(loss)
        class(impulse_path), intent(in) :: self
        real(wp), intent(in) :: impulse(:, :)          !! (lane, n_held)
        real(wp) :: loss(lanes)
        real(wp) :: gained, gain, first, last
        integer :: lane, phase

        loss = 0
        do lane = 1, lanes
            gained = 0
            do phase = 1, self%n_phase()
                first = begin_of_phase(self%turn(lane, :), phase)
                last = begin_of_phase(self%turn(lane, :), phase + 1)
                gain = (last - first)*dot_product(impulse(lane, :), matmul(self%response(lane, :, :, phase), impulse(lane, :)))
                loss(lane) = loss(lane) - (last - first)*(gained + gain/2)
                gained = gained + gain
            end do
            loss(lane) = loss(lane) + gained/2
        end do
    end function loss_beside_mean
end module linkdyn_impulse_path
