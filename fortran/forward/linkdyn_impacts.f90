!> Impacts of an instant: which contacts throw back, which stay closed.
!>
!> The contacts that close strike together, and none pulls: with the velocities v- and v+ apart before and behind, the impulses p
!> and the response W to them,
!>
!>     v+ = v- + W p,    p >= 0,    v+ >= -e v-,    p (v+ + e v-) = 0
!>
!> with e = 0 for one that comes too slowly to be thrown back, or rests. So an impact may open a contact at rest. It may also close
!> one that had been left a moment ago: that strikes in its turn, in another round at the same instant. No round adds energy, for
!> the sum of p (v- + v+)/2 is that of (1 - e) p v-/2, and v- is not positive where p is.
!>
!> Locks that close take all slip s at once, and may lift what rests off its stop or press it there: with the impulses q of locks,
!>
!>     s- + W_ss q + W_sv p = 0,    v+ = v- + W_vs q + W_vv p >= 0,    p >= 0,    p v+ = 0
module linkdyn_impacts
    use linkdyn_contact_forces, only: solve_complementary, solve_held
    use linkdyn_kinds, only: wp
    implicit none (type, external)
    private
    public :: find_impacts, find_locking, find_resting

    integer, parameter :: most_rounds = 1000          !! of an instant; in the last one nothing is thrown back
    real(wp), parameter :: weak = 1.0e-6_wp            !! of the fastest impact at a stop: a slower one ends there
    real(wp), parameter :: weakest = 1.0e-9_wp         !! of the hardest one at any stop
    real(wp), parameter :: still = 1.0e-12_wp          !! of the hardest one: rounding of what does not move

contains

    !> Impacts in rounds: what closes is pushed apart, and may drive other contacts together, until none closes any more or these
    !> are `most_rounds`.
    pure subroutine find_impacts(response, restitution, touches, strikes, fastest, hardest, speed, impulse, has_struck, is_closed, &
                                  loss)
        real(wp), intent(in) :: response(:, :)         !! W [1/kg, ...] (of, by)
        real(wp), intent(in) :: restitution(:)
        logical, intent(in) :: touches(:)              !! their gaps are closed
        logical, intent(in) :: strikes(:)              !! of them, what has come to its stop now
        real(wp), intent(inout) :: fastest(:)          !! impact so far at each stop [m/s, rad/s]
        real(wp), intent(inout) :: hardest             !! of all stops: speed by the root of the response [sqrt(J)]
        real(wp), intent(inout) :: speed(:)            !! apart: before and behind [m/s, rad/s]
        real(wp), intent(out) :: impulse(:)            !! [N s, N m s]
        logical, intent(out) :: has_struck(:)
        logical, intent(out) :: is_closed(:)           !! stays where it is, for all that impacts can do
        real(wp), intent(out) :: loss                  !! of energy [J]
        real(wp), dimension(size(speed)) :: ease, least, wanted
        real(wp), allocatable :: push(:), change(:)
        logical, dimension(size(speed)) :: closes, takes_part, came
        integer, allocatable :: contact(:)
        integer :: round, i

        came = speed < 0
        ease = [(sqrt(max(response(i, i), 0.0_wp)), i=1, size(speed))]
        impulse = 0
        loss = 0
        has_struck = .false.
        do round = 1, most_rounds
            do i = 1, size(speed)
                if (touches(i) .and. ease(i) > 0) hardest = max(hardest, -speed(i)/ease(i))
            end do
            least = still*hardest*ease
            closes = touches .and. speed < -least
            if (round == 1) closes = closes .or. (strikes .and. speed <= least)
            if (.not. any(closes)) exit
            where (closes)
                has_struck = .true.
                fastest = max(fastest, -speed)
            end where
            takes_part = touches .and. (speed <= least .or. round == most_rounds)
            wanted = -restitution*speed
            where (.not. (closes .and. wanted > max(weak*fastest, weakest*hardest*ease)) .or. round == most_rounds) &
                wanted = 0
            contact = pack([(i, i=1, size(speed))], takes_part)
            allocate (push(size(contact)))
            call solve_complementary(response(contact, contact), speed(contact) - wanted(contact), push)
            change = matmul(response(:, contact), push)
            loss = loss - dot_product(push, speed(contact) + change(contact)/2)
            speed = speed + change
            impulse(contact) = impulse(contact) + push
            if (.not. any(push > 0)) exit
            deallocate (push)
        end do
        ! What begins at its stop, at rest, and is drawn away from there has struck nothing.
        has_struck = has_struck .and. (came .or. impulse > 0)
        is_closed = touches .and. abs(speed) <= 10*still*hardest*ease
    end subroutine find_impacts

    !> Impulses of locks that close, and of stops at which something rests.
    pure subroutine find_locking(response, locks, rests, rate, hardest, impulse, opens, gives_way)
        real(wp), intent(in) :: response(:, :)         !! W of stops and locks [1/kg, ...] (of, by)
        logical, intent(in) :: locks(:), rests(:)      !! which of these take part, as locks and as stops
        real(wp), intent(in) :: rate(:)                !! slips and speeds apart before [m/s, rad/s]
        real(wp), intent(inout) :: hardest             !! impact so far: speed by the root of the response [sqrt(J)]
        real(wp), intent(out) :: impulse(:)            !! [N s, N m s]
        logical, intent(out) :: opens(:)               !! a stop at which nothing rests any more
        logical, intent(out) :: gives_way(:)           !! a stop onto which locks press what is driven
        real(wp), parameter :: none = 1.0e-10_wp       !! of a speed or response: rounding
        real(wp), allocatable :: alone(:), force(:, :), own(:, :), apart(:), push(:), least(:)
        integer, allocatable :: lock(:), rest(:)
        integer :: i

        lock = pack([(i, i=1, size(locks))], locks)
        rest = pack([(i, i=1, size(rests))], rests)
        allocate (force(size(lock), size(rest)), push(size(rest)))
        alone = solve_held(response(lock, lock), -rate(lock))
        do i = 1, size(rest)
            force(:, i) = solve_held(response(lock, lock), response(lock, rest(i)))
        end do
        own = response(rest, rest) - matmul(response(rest, lock), force)
        apart = rate(rest) + matmul(response(rest, lock), alone)
        do i = 1, size(rest)
            if (own(i, i) > none*response(rest(i), rest(i))) cycle
            own(:, i) = 0                              ! what it stops is held by locks
            own(i, :) = 0
        end do
        call solve_complementary(own, apart, push)
        impulse = 0
        impulse(rest) = push
        impulse(lock) = alone - matmul(force, push)
        apart = apart + matmul(own, push)
        hardest = max(hardest, hardest_slip())
        least = none*hardest_slip()*[(sqrt(max(response(rest(i), rest(i)), 0.0_wp)), i=1, size(rest))]
        opens = .false.
        opens(rest) = apart > least
        gives_way = .false.
        gives_way(rest) = apart < -least .and. least > 0

    contains

        !> The fastest slip, by the root of the response [sqrt(J)].
        pure real(wp) function hardest_slip()
            integer :: i

            hardest_slip = 0
            do i = 1, size(lock)
                associate (ease => response(lock(i), lock(i)))
                    if (ease > 0) hardest_slip = max(hardest_slip, abs(rate(lock(i)))/sqrt(ease))
                end associate
            end do
        end function hardest_slip
    end subroutine find_locking

    !> Which of the contacts that have no speed rest: those that push, of accelerations apart and pushes, none negative. One that
    !> leaves so slowly that it would come back before rounding let its gap be seen, or the clock tell the two impacts apart, has no
    !> speed either.
    pure subroutine find_resting(response, touches, speed, away, widest, least_gap, least_time, is_closed, rests)
        real(wp), intent(in) :: response(:, :)         !! W [1/kg, ...] (of, by)
        logical, intent(in) :: touches(:)              !! their gaps are closed
        real(wp), intent(in) :: speed(:)               !! apart [m/s, rad/s]
        real(wp), intent(in) :: away(:)                !! accelerations apart without pushes [m/s^2, rad/s^2]
        real(wp), intent(in) :: widest(:)              !! gap so far [m, rad]
        real(wp), intent(in) :: least_gap(:)           !! that rounding of the place lets be seen [m, rad]
        real(wp), intent(in) :: least_time             !! that the clock tells apart [s]
        logical, intent(inout) :: is_closed(:)         !! has no speed
        logical, intent(out) :: rests(:)
        real(wp), parameter :: at_rest = 1.0e-13_wp    !! of the largest acceleration: others hold it already
        real(wp), parameter :: low = 1.0e-13_wp        !! of the widest gap so far: a bounce of that height is none
        real(wp) :: left(size(rests)), height(size(rests))
        real(wp), allocatable :: push(:)
        logical :: is_low(size(rests))
        integer, allocatable :: contact(:)
        integer :: i, turn

        height = max(low*widest, least_gap)
        do turn = 1, size(rests) + 1
            contact = pack([(i, i=1, size(rests))], is_closed)
            if (allocated(push)) deallocate (push)
            allocate (push(size(contact)))
            call solve_complementary(response(contact, contact), away(contact), push)
            left = away + matmul(response(:, contact), push)
            is_low = touches .and. .not. is_closed .and. left < 0 .and. speed >= 0 &
                     .and. (speed**2 <= 2*height*abs(left) .or. 2*speed <= least_time*abs(left))
            if (.not. any(is_low)) exit
            is_closed = is_closed .or. is_low
        end do
        rests = .false.
        rests(contact) = push > 0 .or. left(contact) <= at_rest*maxval(abs(away(contact)))
    end subroutine find_resting
end module linkdyn_impacts
