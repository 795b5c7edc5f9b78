!> Where in a step a guard crosses zero first.
!>
!> A step that has been taken is looked through before it counts. Guards are taken at its ends, in its middle, where the solution
!> comes from a step taken again with half the length, and between these on the cubic that meets solution and rates at the ends.
!> How far the cubic misses the guard in the middle tells how much it may be believed. The step is settled for a guard if
!>
!> - it keeps its sign at all of these places and, with the parabolas through neighbouring ones, stays clear of zero by
!>   `margin` times that miss, or
!> - it changes its sign once.
!>
!> What is not settled is halved, and each half looked at in the same way, down to `most_pieces` of the step. Where a guard still
!> keeps its sign there but comes near zero, its nearest place is sought. So a guard that crosses zero and comes back within a step
!> is found, unless it turns twice within a quarter of the smallest piece. Behind a crossing, where velocities may have jumped, the
!> first quarter is looked at more and more closely towards its beginning.
!>
!> The instant is a root of the guard on solutions that the method itself finds, by steps of that length taken again: it is as
!> good as the method, to the last places of the clock, and the step then ends just behind it.
module linkdyn_crossings
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_lane_system, only: lane_system
    implicit none (type, external)
    private
    public :: step_taken, find_crossing, note_sides, most_pieces

    integer, parameter :: most_pieces = 16         !! of a step
    integer, parameter :: n_near = 10              !! places in the first quarter, each half as far from the beginning as the next
                                                   !! one
    real(wp), parameter :: margin = 4
    real(wp), parameter :: noise = 50*epsilon(1.0_wp)    !! of a guard's largest value so far: less than that has no sign

    !> A step from t: solution and rates at its ends.
    type, abstract :: step_taken
        logical :: is_one = .false.                !! all lanes have the same solution
        real(wp) :: t(lanes) = 0, length(lanes) = 0
        real(wp), allocatable :: y(:, :), rate(:, :)             !! where it begins (lane, n)
        real(wp), allocatable :: y_end(:, :), rate_end(:, :)     !! where it ends (lane, n)
        integer :: n_evaluation = 0                !! in looking within, so far (blocks)
    contains
        procedure(retake_step), deferred :: retake
        procedure :: follow
        procedure, non_overridable :: cubic_at, cubic_rate_at
    end type step_taken

    abstract interface
        !> The solution at a part of the step, by the method itself; not a number where it cannot be had.
        subroutine retake_step(self, system, share, y)
            import :: step_taken, lane_system, wp, lanes
            class(step_taken), intent(inout) :: self
            class(lane_system), intent(inout) :: system
            real(wp), intent(in) :: share(lanes)   !! of the length
            real(wp), intent(out) :: y(:, :)       !! (lane, n)
        end subroutine retake_step
    end interface

    !> What is known of the guards along the step, in pieces of equal length.
    type :: look_type
        integer :: n_piece = 1
        real(wp), allocatable :: y(:, :, :), rate(:, :, :)       !! at ends of pieces and in their middles (lane, n, 0:2 n_piece)
        real(wp), allocatable :: guard(:, :, :)                  !! at quarters of pieces (lane, n_guard, 0:4 n_piece)
        real(wp), allocatable :: miss(:, :, :)                   !! of the cubic in the middle (lane, n_guard, n_piece)
        real(wp), allocatable :: near(:, :, :)                   !! at the beginning, and places from there to the first quarter
                                                                 !! (lane, n_guard, 0:n_near + 1); not allocated: none are wanted
    end type look_type

contains

    !> The solution along a step that all lanes share, at many places at once.
    subroutine follow(self, system, is_long, share, y, is_sure)
        class(step_taken), intent(inout) :: self
        class(lane_system), intent(inout) :: system
        logical, intent(in) :: is_long                     !! the cubic will hardly serve
        real(wp), intent(in) :: share(:)                   !! of the length (place)
        real(wp), intent(out) :: y(:, :)                   !! (place, n)
        logical, intent(out) :: is_sure                    !! as good as the method; else it is the cubic
        integer :: i

        is_sure = .false.
        do i = 1, size(share)
            y(i, :) = self%cubic_at(share(i))
        end do
    end subroutine follow

    !> The cubic that meets solution and rates at both ends, on the first lane.
    pure function cubic_at(self, share) result(y)
        class(step_taken), intent(in) :: self
        real(wp), intent(in) :: share                      !! of the step
        real(wp) :: y(size(self%y, 2))

        y = self%y(1, :) + (3 - 2*share)*share**2*(self%y_end(1, :) - self%y(1, :)) &
            + self%length(1)*share*(1 - share)*((1 - share)*self%rate(1, :) - share*self%rate_end(1, :))
    end function cubic_at

    !> How fast it goes on there, times the length.
    pure function cubic_rate_at(self, share) result(way)
        class(step_taken), intent(in) :: self
        real(wp), intent(in) :: share                      !! of the step
        real(wp) :: way(size(self%y, 2))

        way = 6*share*(1 - share)*(self%y_end(1, :) - self%y(1, :)) &
              + self%length(1)*((1 - share)*(1 - 3*share)*self%rate(1, :) + share*(3*share - 2)*self%rate_end(1, :))
    end function cubic_rate_at

    !> The first crossing that counts, on each lane.
    subroutine find_crossing(system, step, share, has_crossed, fewest)
        class(lane_system), intent(inout) :: system
        class(step_taken), intent(inout) :: step
        real(wp), intent(out) :: share(lanes)              !! of the step's length, just behind it; 1: there is none
        logical, intent(out) :: has_crossed(:, :)          !! there (lane, n_guard)
        integer, intent(in), optional :: fewest            !! pieces to look into; absent: one
        type(look_type) :: look
        real(wp), dimension(lanes, system%n_guard) :: from, to, side
        real(wp) :: dip(lanes, 4, system%n_guard)          ! before, at and behind it, and the sign there
        logical, dimension(lanes, system%n_guard) :: is_settled, is_found
        real(wp) :: root(lanes)
        integer :: i, least

        least = 1
        if (present(fewest)) least = fewest
        call begin_look(system, step, look)
        do
            call look_into(system, step, look)
            call judge(system, look, step%is_one, from, to, side, is_found, is_settled, dip)
            if ((all(is_settled) .and. look%n_piece >= least) .or. look%n_piece == most_pieces) exit
            call halve_pieces(system, step, look)
        end do
        share = 1
        has_crossed = .false.
        do i = 1, system%n_guard
            if (any(dip(:, 2, i) > 0)) &
                call search_dip(system, step, i, dip(:, :, i), from(:, i), to(:, i), side(:, i), is_found(:, i))
            if (.not. any(is_found(:, i))) cycle
            call find_root(system, step, i, is_found(:, i), side(:, i), from(:, i), to(:, i), root)
            where (is_found(:, i) .and. root < share)
                share = root
            end where
        end do
        if (any(is_found)) call note_crossed(system, step, is_found, side, to, share, has_crossed)
    end subroutine find_crossing

    !> The accepted state: on which side guards are from here. Of those that have crossed, whoever met that has said it.
    subroutine note_sides(system, t, y, has_crossed)
        class(lane_system), intent(inout) :: system
        real(wp), intent(in) :: t(lanes), y(:, :)
        logical, intent(in) :: has_crossed(:, :)           !! there (lane, n_guard)
        real(wp) :: guard(lanes, system%n_guard)
        integer :: i, lane

        call system%evaluate_guards(t, y, guard)
        if (.not. allocated(system%guard_scale)) allocate (system%guard_scale(lanes, system%n_guard), source=0*guard)
        if (.not. allocated(system%guard_side)) allocate (system%guard_side(lanes, system%n_guard), source=0*guard)
        system%guard_is_fresh = has_crossed
        where (abs(guard) <= huge(1.0_wp)) system%guard_scale = max(system%guard_scale, abs(guard))
        do i = 1, system%n_guard
            do lane = 1, lanes
                associate (side => system%guard_side(lane, i))
                    if (has_crossed(lane, i) .or. .not. abs(guard(lane, i)) > noise*system%guard_scale(lane, i)) cycle
                    ! A crossing that counts and that the step has not seen, by rounding at its end, is one of the next step.
                    if (abs(side) > 0 .and. counts(side, system%guard_direction(i))) cycle
                    side = sign(1.0_wp, guard(lane, i))
                end associate
            end do
        end do
    end subroutine note_sides

    !> Guards beyond zero at the instant found; of those at the same instant all count.
    subroutine note_crossed(system, step, is_found, side, to, share, has_crossed)
        class(lane_system), intent(inout) :: system
        class(step_taken), intent(inout) :: step
        logical, intent(in) :: is_found(:, :)
        real(wp), intent(in) :: side(:, :), to(:, :)
        real(wp), intent(in) :: share(lanes)
        logical, intent(inout) :: has_crossed(:, :)
        real(wp) :: y(lanes, system%n), guard(lanes, system%n_guard)
        integer :: i

        call step%retake(system, share, y)
        call system%evaluate_guards(step%t + share*step%length, y, guard)
        do i = 1, size(has_crossed, 2)
            has_crossed(:, i) = is_found(:, i) .and. side(:, i)*guard(:, i) <= 0
            ! To the last place the two differ where the step ends: the one that was found counts.
            has_crossed(:, i) = has_crossed(:, i) .or. (is_found(:, i) .and. to(:, i) <= share)
        end do
    end subroutine note_crossed

    ! ---------------------------------------------------------------- looking

    subroutine begin_look(system, step, look)
        class(lane_system), intent(inout) :: system
        class(step_taken), intent(in) :: step
        type(look_type), intent(inout) :: look

        allocate (look%y(lanes, system%n, 0:2), look%rate(lanes, system%n, 0:2))
        look%y(:, :, 0) = step%y
        look%rate(:, :, 0) = step%rate
        look%y(:, :, 2) = step%y_end
        look%rate(:, :, 2) = step%rate_end
    end subroutine begin_look

    !> Guards at all places of the pieces. At their ends and middles the solution is the method's.
    subroutine look_into(system, step, look)
        class(lane_system), intent(inout) :: system
        class(step_taken), intent(inout) :: step
        type(look_type), intent(inout) :: look
        real(wp), allocatable :: y(:, :, :), guard(:, :, :)
        real(wp), allocatable :: share(:)
        integer :: k, n, last

        n = look%n_piece
        last = 5*n
        if (step%is_one .or. any(system%guard_is_fresh)) last = 5*n + n_near
        ! First the solution at all quarters, then the cubics in the middles once more, then the places near the beginning.
        allocate (y(lanes, system%n, 0:last), guard(lanes, system%n_guard, 0:last), share(0:last))
        do k = 1, n
            call step%retake(system, spread((k - 0.5_wp)/n, 1, lanes), look%y(:, :, 2*k - 1))
        end do
        do k = 0, 4*n
            share(k) = 0.25_wp*k/n
            if (modulo(k, 2) == 0) then
                y(:, :, k) = look%y(:, :, k/2)
            else
                y(:, :, k) = on_cubic(step, look, k/4 + 1, 0.25_wp*modulo(k, 4))
            end if
        end do
        do k = 1, n
            share(4*n + k) = (k - 0.5_wp)/n
            y(:, :, 4*n + k) = on_cubic(step, look, k, 0.5_wp)
        end do
        do k = 1, last - 5*n
            share(5*n + k) = near_share(k)/n
            y(:, :, 5*n + k) = on_cubic(step, look, 1, near_share(k))
        end do
        call guards_at(system, step, share, y, guard)
        do k = 0, last
            where (abs(guard(:, :, k)) < noise*system%guard_scale) guard(:, :, k) = 0
        end do
        if (allocated(look%guard)) deallocate (look%guard)
        allocate (look%guard(lanes, system%n_guard, 0:4*n))
        look%guard = guard(:, :, :4*n)
        look%miss = abs(guard(:, :, 4*n + 1:5*n) - guard(:, :, 2:4*n - 2:4))
        if (last == 5*n) return
        if (.not. allocated(look%near)) allocate (look%near(lanes, system%n_guard, 0:n_near + 1))
        look%near(:, :, 0) = guard(:, :, 0)
        look%near(:, :, 1:n_near) = guard(:, :, 5*n + 1:)
        look%near(:, :, n_near + 1) = guard(:, :, 1)
    end subroutine look_into

    !> Where in the first piece a place near its beginning is; 0: at the beginning, n_near + 1: at the first quarter.
    elemental real(wp) function near_share(k)
        integer, intent(in) :: k

        near_share = 0
        if (k > 0) near_share = 0.25_wp*0.5_wp**(n_near + 1 - k)
    end function near_share

    !> The cubic of a piece.
    function on_cubic(step, look, piece, x) result(y)
        class(step_taken), intent(in) :: step
        type(look_type), intent(in) :: look
        integer, intent(in) :: piece
        real(wp), intent(in) :: x                          !! 0 to 1 in the piece
        real(wp) :: y(size(look%y, 1), size(look%y, 2))
        integer :: a, b, i

        a = 2*piece - 2
        b = 2*piece
        do i = 1, size(y, 2)
            y(:, i) = look%y(:, i, a) + (3 - 2*x)*x**2*(look%y(:, i, b) - look%y(:, i, a)) &
                      + (step%length/look%n_piece)*((x*(1 - x)**2)*look%rate(:, i, a) - (x**2*(1 - x))*look%rate(:, i, b))
        end do
    end function on_cubic

    !> Guards of several states of the step. One solution has its states side by side on the lanes.
    subroutine guards_at(system, step, share, y, guard)
        class(lane_system), intent(inout) :: system
        class(step_taken), intent(in) :: step
        real(wp), intent(in) :: share(:)                   !! (place)
        real(wp), intent(in) :: y(:, :, :)                 !! (lane, n, place)
        real(wp), intent(out) :: guard(:, :, :)            !! (lane, n_guard, place)
        real(wp) :: side_by_side(lanes, size(y, 2)), t(lanes), found(lanes, size(guard, 2))
        integer :: first, lane, place

        if (.not. step%is_one) then
            do place = 1, size(share)
                call system%evaluate_guards(step%t + share(place)*step%length, y(:, :, place), guard(:, :, place))
            end do
            return
        end if
        do first = 1, size(share), lanes
            do lane = 1, lanes
                place = min(first + lane - 1, size(share))
                side_by_side(lane, :) = y(1, :, place)
                t(lane) = step%t(1) + share(place)*step%length(1)
            end do
            call system%evaluate_guards(t, side_by_side, found)
            do lane = 1, min(lanes, size(share) - first + 1)
                guard(:, :, first + lane - 1) = spread(found(lane, :), 1, lanes)
            end do
        end do
    end subroutine guards_at

    !> Middles become ends.
    subroutine halve_pieces(system, step, look)
        class(lane_system), intent(inout) :: system
        class(step_taken), intent(in) :: step
        type(look_type), intent(inout) :: look
        real(wp), allocatable :: y(:, :, :), rate(:, :, :)
        logical :: failed(lanes)
        integer :: k, n

        n = 2*look%n_piece
        allocate (y(lanes, system%n, 0:2*n), rate(lanes, system%n, 0:2*n))
        do k = 0, n
            y(:, :, 2*k) = look%y(:, :, k)
            rate(:, :, 2*k) = look%rate(:, :, k)
            if (modulo(k, 2) == 0) cycle
            call system%evaluate(step%t + (real(k, wp)/n)*step%length, y(:, :, 2*k), rate(:, :, 2*k), failed)
        end do
        call move_alloc(y, look%y)
        call move_alloc(rate, look%rate)
        look%n_piece = n
    end subroutine halve_pieces

    ! ---------------------------------------------------------------- judging

    !> Along the step, on each lane and for each guard: between which places it crosses zero so that it counts, if so.
    subroutine judge(system, look, is_one, from, to, side, is_found, is_settled, dip)
        class(lane_system), intent(in) :: system
        type(look_type), intent(in) :: look
        logical, intent(in) :: is_one
        real(wp), intent(out) :: from(:, :), to(:, :)      !! shares of the step (lane, n_guard)
        real(wp), intent(out) :: side(:, :)                !! sign before (lane, n_guard)
        logical, intent(out) :: is_found(:, :), is_settled(:, :)
        real(wp), intent(out) :: dip(:, :, :)              !! the first place where it comes near zero before that: shares of
                                                           !! the step around it, 0: none; sign there (lane, 4, n_guard)
        integer :: lane, i

        do i = 1, system%n_guard
            do lane = 1, merge(1, lanes, is_one)
                call judge_guard(look, system%guard_direction(i), system%guard_side(lane, i), system%guard_is_fresh(lane, i), &
                                 lane, i, from(lane, i), to(lane, i), side(lane, i), is_found(lane, i), is_settled(lane, i), &
                                 dip(lane, :, i))
            end do
            if (.not. is_one) cycle
            from(:, i) = from(1, i)
            to(:, i) = to(1, i)
            side(:, i) = side(1, i)
            is_found(:, i) = is_found(1, i)
            is_settled(:, i) = is_settled(1, i)
            dip(:, :, i) = spread(dip(1, :, i), 1, lanes)
        end do
    end subroutine judge

    !> What one guard did in a step by the places looked at: the piece in which it crosses first, where it may dip to zero and back
    !> between them, and whether more places are needed to tell.
    pure subroutine judge_guard(look, direction, side_before, is_fresh, lane, i, from, to, side, is_found, is_settled, &
                                dip)
        type(look_type), intent(in) :: look
        integer, intent(in) :: direction
        real(wp), intent(in) :: side_before
        logical, intent(in) :: is_fresh
        integer, intent(in) :: lane, i
        real(wp), intent(out) :: from, to, side
        logical, intent(out) :: is_found, is_settled
        real(wp), intent(out) :: dip(4)
        real(wp) :: guard(0:4)
        integer :: piece, n_change, k, low

        from = 0
        to = 1
        side = side_before
        is_found = .false.
        is_settled = .true.
        dip = 0
        do piece = 1, look%n_piece
            guard = look%guard(lane, i, 4*piece - 4:4*piece)
            ! Where a crossing was just met the guard is zero but for rounding, on the side beyond.
            if (piece == 1 .and. (is_fresh .or. .not. guard(0)*side > 0)) guard(0) = 0
            if (piece == 1 .and. allocated(look%near)) then
                low = near_dip(side*look%near(lane, i, :))
                ! One that does not count is of interest if the guard comes back.
                k = merge(low + 1, n_near + 1, counts(side, direction))
                if (.not. counts(side, direction) .and. side*look%near(lane, i, n_near + 1) < 0) low = 0
                if (low > 0) dip = [near_share([low - 1, low, k])/look%n_piece, side]
            end if
            n_change = 0
            do k = 1, 4
                if (.not. abs(side) > 0 .and. abs(guard(k)) > 0) side = sign(1.0_wp, guard(k))
                if (.not. guard(k)*side*(-1)**n_change < 0) cycle
                n_change = n_change + 1
                if (n_change == 1) from = (piece - 1 + 0.25_wp*(k - 1))/look%n_piece
                if (n_change == 1) to = (piece - 1 + 0.25_wp*k)/look%n_piece
            end do
            select case (n_change)
            case (0)
                low = lowest_place(side*guard, margin*look%miss(lane, i, piece))
                ! A guard that has just crossed is small where the step begins; that is no dip.
                if (low == 0 .or. (low == 1 .and. piece == 1 .and. .not. abs(guard(0)) > 0)) cycle
                is_settled = .false.
                if (.not. dip(2) > 0) dip = [(piece - 1 + 0.25_wp*[low - 1, low, low + 1])/look%n_piece, side]
            case (1)
                is_found = counts(side, direction)
                if (is_found) then
                    ! The solution at quarters is the cubic's: the bracket is between places of the method.
                    from = 0.5_wp*floor(2*(from*look%n_piece) + 0.25_wp)/look%n_piece
                    to = from + 0.5_wp/look%n_piece
                    return
                end if
                side = -side
            case default
                is_settled = .false.
                if (look%n_piece < most_pieces) return
                ! The smallest pieces: what the method's own places tell.
                if (guard(2)*side < 0) then
                    is_found = counts(side, direction)
                    from = (piece - 1.0_wp)/look%n_piece
                    if (.not. is_found) then
                        side = -side
                        is_found = counts(side, direction) .and. guard(4)*side < 0
                        from = (piece - 0.5_wp)/look%n_piece
                    end if
                else if (guard(4)*side < 0) then
                    is_found = counts(side, direction)
                    from = (piece - 0.5_wp)/look%n_piece
                else if (.not. dip(2) > 0) then
                    ! The cubic alone has it beyond zero, at one of the quarters between.
                    low = merge(1, 3, guard(1)*side < 0)
                    dip = [(piece - 1 + 0.25_wp*[low - 1, low, low + 1])/look%n_piece, side]
                end if
                to = from + 0.5_wp/look%n_piece
                if (is_found) return
                if (guard(4)*side < 0) side = -side
            end select
        end do
    end subroutine judge_guard

    !> Does a crossing from this side count?
    pure logical function counts(side, direction)
        real(wp), intent(in) :: side
        integer, intent(in) :: direction

        counts = direction == 0 .or. direction*side < 0
    end function counts

    !> Where a guard, positive at its places, comes down to a bound: the inner place next to it; 0: nowhere. What is not a
    !> number tells nothing.
    pure integer function lowest_place(guard, bound) result(low)
        real(wp), intent(in) :: guard(0:4)
        real(wp), intent(in) :: bound
        real(wp) :: slope, bend, least
        integer :: k

        low = 0
        do k = 1, 3
            slope = (guard(k + 1) - guard(k - 1))/2
            bend = guard(k + 1) - 2*guard(k) + guard(k - 1)
            if (bend > 0 .and. abs(slope) < bend) then
                least = guard(k) - slope**2/(2*bend)
                if (least < 0 .or. (least < bound .and. least < guard(k)/2)) low = k
            end if
            if (low > 0) return
        end do
        if (any(guard(1:) < bound)) low = max(1, min(3, minloc(guard(1:), dim=1)))
    end function lowest_place

    !> The first place near the beginning where a guard is beyond zero; 0: there is none.
    pure integer function near_dip(guard)
        real(wp), intent(in) :: guard(0:)              !! positive before a crossing (0:n_near + 1)
        integer :: k

        near_dip = 0
        do k = n_near + 1, 1, -1
            if (guard(k) < 0) near_dip = k
        end do
    end function near_dip

    !> The lowest place of a guard near a dip, on the method's own solution: is it beyond zero there?
    subroutine search_dip(system, step, i, dip, from, to, side, is_found)
        class(lane_system), intent(inout) :: system
        class(step_taken), intent(inout) :: step
        integer, intent(in) :: i                           !! guard
        real(wp), intent(in) :: dip(lanes, 4)              !! as `judge` tells
        real(wp), intent(inout) :: from(lanes), to(lanes)  !! of a crossing
        real(wp), intent(inout) :: side(lanes)             !! before it
        logical, intent(inout) :: is_found(lanes)
        integer, parameter :: most_tries = 12
        real(wp), dimension(lanes) :: a, b, c, of_a, of_b, of_c, place, value, slope, bend, before
        logical :: is_open(lanes), counts_first(lanes)
        integer :: try, lane

        ! A dip behind a crossing, and one at its own side only.
        is_open = dip(:, 2) > 0 .and. .not. (is_found .and. from < dip(:, 2))
        before = side
        side = merge(dip(:, 4), side, is_open)
        a = dip(:, 1)
        b = dip(:, 2)
        c = dip(:, 3)
        call value_at(a, of_a)
        call value_at(b, of_b)
        call value_at(c, of_c)
        do try = 1, most_tries
            is_open = is_open .and. of_b >= 0 .and. c - a > 1.0e-7_wp
            if (.not. any(is_open)) exit
            slope = (of_c - of_b)/(c - b)
            bend = slope - (of_b - of_a)/(b - a)
            place = (a + b)/2 - ((of_b - of_a)/(b - a))*(c - a)/(2*merge(bend, 1.0_wp, bend > 0))
            where (.not. (bend > 0 .and. place > a .and. place < c)) place = merge((a + b)/2, (b + c)/2, b - a > c - b)
            where (abs(place - b) < 1.0e-3_wp*(c - a)) place = merge(b - 0.05_wp*(b - a), b + 0.05_wp*(c - b), b - a > c - b)
            where (.not. is_open) place = b
            call value_at(place, value)
            do lane = 1, lanes
                if (.not. is_open(lane)) cycle
                if (value(lane) < of_b(lane)) then
                    if (place(lane) < b(lane)) then
                        c(lane) = b(lane)
                        of_c(lane) = of_b(lane)
                    else
                        a(lane) = b(lane)
                        of_a(lane) = of_b(lane)
                    end if
                    b(lane) = place(lane)
                    of_b(lane) = value(lane)
                else if (place(lane) < b(lane)) then
                    a(lane) = place(lane)
                    of_a(lane) = value(lane)
                else
                    c(lane) = place(lane)
                    of_c(lane) = value(lane)
                end if
            end do
        end do
        is_open = dip(:, 2) > 0 .and. .not. (is_found .and. from < dip(:, 2)) .and. of_b < 0
        do lane = 1, lanes
            counts_first(lane) = counts(side(lane), system%guard_direction(i))
        end do
        where (is_open .and. counts_first)
            from = a
            to = b
            is_found = .true.
        elsewhere (is_open)
            from = b
            to = c
            side = -side
            is_found = .true.
        elsewhere
            side = before
        end where

    contains

        !> Positive before the crossing. What is noise is no dip: behind a release gaps grow from nothing.
        subroutine value_at(share, value)
            real(wp), intent(in) :: share(lanes)
            real(wp), intent(out) :: value(lanes)
            real(wp) :: y(lanes, system%n), guard(lanes, system%n_guard)

            call step%retake(system, share, y)
            call system%evaluate_guards(step%t + share*step%length, y, guard)
            value = side*guard(:, i)
            where (abs(value) < noise*system%guard_scale(:, i)) value = 0
        end subroutine value_at
    end subroutine search_dip

    ! ---------------------------------------------------------------- locating

    !> The root between two places of the step, as the near end of a bracket of some last places of the clock: by regula falsi
    !> as Anderson and Bjorck have it, halving where that is slow. The far end is told.
    subroutine find_root(system, step, i, is_wanted, side, from, to, root)
        class(lane_system), intent(inout) :: system
        class(step_taken), intent(inout) :: step
        integer, intent(in) :: i                           !! guard
        logical, intent(in) :: is_wanted(lanes)
        real(wp), intent(in) :: side(lanes)                !! sign where the bracket begins
        real(wp), intent(in) :: from(lanes)                !! shares of the step
        real(wp), intent(inout) :: to(lanes)               !! comes back as the root
        real(wp), intent(out) :: root(lanes)               !! far end of the bracket; 1 where none is wanted
        integer, parameter :: most_tries = 120
        real(wp), dimension(lanes) :: a, b, of_a, of_b, c, of_c, least, width, weight
        logical, dimension(lanes) :: is_open, is_slow, moved_a, moved_b, moves_b
        integer :: try

        a = from
        b = to
        is_open = is_wanted
        least = 2*spacing(max(abs(step%t), abs(step%t + step%length)))/max(step%length, tiny(1.0_wp))
        least = max(least, epsilon(1.0_wp))
        call value_at(a, of_a)
        call value_at(b, of_b)
        call leave_zero()
        is_slow = .false.
        moved_a = .false.
        moved_b = .false.
        do try = 1, most_tries
            width = b - a
            is_open = is_open .and. width > 2*least .and. of_b < 0
            if (.not. any(is_open)) exit
            c = b - of_b*width/min(of_b - of_a, -tiny(1.0_wp))
            where (is_slow .or. .not. (c > a .and. c < b)) c = a + width/2
            c = min(max(c, a + least), b - least)
            where (.not. is_open) c = b
            call value_at(c, of_c)
            moves_b = of_c <= 0
            where (is_open .and. moves_b)
                weight = 1 - of_c/of_b
                where (moved_b) of_a = of_a*merge(weight, 0.5_wp, weight > 0)
                b = c
                of_b = of_c
            elsewhere (is_open)
                weight = 1 - of_c/of_a
                where (moved_a) of_b = of_b*merge(weight, 0.5_wp, weight > 0)
                a = c
                where (of_c > 0) of_a = of_c
            end where
            moved_b = moves_b
            moved_a = .not. moves_b
            is_slow = b - a > width/2
        end do
        to = merge(b, to, is_wanted)
        root = merge(b, 1.0_wp, is_wanted)

    contains

        !> Positive before the crossing.
        subroutine value_at(share, value)
            real(wp), intent(in) :: share(lanes)
            real(wp), intent(out) :: value(lanes)
            real(wp) :: y(lanes, system%n), guard(lanes, system%n_guard)

            call step%retake(system, share, y)
            call system%evaluate_guards(step%t + share*step%length, y, guard)
            value = side*guard(:, i)
        end subroutine value_at

        !> The guard may be zero where the step begins, as it is where a crossing was just met: a place before the next one,
        !> by halving. If there is none, the next one is at once.
        subroutine leave_zero()
            integer, parameter :: most_halvings = digits(1.0_wp)
            logical :: is_zero(lanes)
            real(wp) :: place(lanes), value(lanes)
            integer :: n

            is_zero = is_open .and. (.not. of_a > 0 .or. (system%guard_is_fresh(:, i) .and. .not. a > 0))
            place = b
            do n = 1, most_halvings
                if (.not. any(is_zero)) return
                place = merge(a + (place - a)/2, b, is_zero)
                call value_at(place, value)
                where (is_zero .and. value > 0)
                    a = place
                    of_a = value
                    is_zero = .false.
                elsewhere (is_zero)
                    b = place
                    of_b = value
                end where
            end do
            is_open = is_open .and. .not. is_zero
        end subroutine leave_zero
    end subroutine find_root
end module linkdyn_crossings
