!> Following an assembly along a straight way: by which rule a step is believed.
!>
!> At given coordinates a mechanism closes in several assemblies. Which of them it is in follows from where it comes
!> from: positions are continuous, and two assemblies meet only where a map of the mechanism is singular. A step from
!> one place to another is therefore believed only if
!>
!> - the tangent where the mechanism stands predicts the assembly found there: Newton's corrections from the place
!>   predicted shrink at least fourfold from one to the next, which is Kantorovich's condition for one single solution
!>   near that place;
!> - no map has changed the sign of its margin, nor would it do so within the step, led on by its rate from where the
!>   mechanism stands, or led back from where it was tried.
!>
!> Towards the end of an assembly places and margins go as the root of the distance from it. Where a margin has been seen to do
!> so, steps lead to a part of the distance to where it vanishes that takes the margin down by up to a tenth, and the tangents
!> are led on by that law: what is found must be believed as anywhere.
!>
!> A step that is not believed is shortened. Near a singular position steps so shrink with the distance from it, until
!> either the mechanism turns away from it, as close to it as that may be, or the margin falls below what rounding lets
!> one tell. There the assembly either ends, as at a limit of reach, or is crossed by another one, as in a parallelogram
!> lying flat: a *change point*. Beyond a change point the smooth continuation, which the tangent predicts, is taken, if
!> that is wished; else the assembly is lost.
!>
!> **Source**: P. Deuflhard, Newton Methods for Nonlinear Problems, Springer 2004, chapter 5 (path following, contraction
!> of a quarter); L. V. Kantorovich's theorem there in chapter 2.
module linkdyn_following
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    implicit none (type, external)
    private
    public :: follower, footing, way_report, follow_way, is_step_sound, doubt_unsound
    public :: way_arrived, way_at_singularity, way_ends, way_forks, way_too_long
    public :: largest_contraction, untrusted, look_ahead

    real(wp), parameter :: largest_contraction = 0.25_wp
    !> The margin of a closed form is the root of what is known to some roundings; below this it says nothing.
    real(wp), parameter :: untrusted = 7*sqrt(epsilon(1.0_wp))
    real(wp), parameter :: look_ahead = 1.5_wp      !! steps: a singular position at the very end of one must not be missed
    real(wp), parameter :: nearest_try = 0.6_wp     !! of the distance to where a margin would vanish: just less than 1/look_ahead
    real(wp), parameter :: same_margin = 5.0_wp     !! a margin beyond a change point and that before it differ less
    real(wp), parameter :: same_slope = 3.0_wp      !! so do its slopes near a change point and at it, and the links' speeds
    real(wp), parameter :: farthest = 1.0_wp        !! mechanism's sizes: how far links get in a step that begins at a singular
                                                    !! place
    real(wp), parameter :: well_told = 10.0_wp      !! margins: from so many least ones on they and their slopes are reliable
    real(wp), parameter :: least_step = 16*epsilon(1.0_wp)    !! of the way

    ! ---- how a way came out
    integer, parameter :: way_arrived = 0
    integer, parameter :: way_at_singularity = 1    !! it ends where the margin cannot be told from zero
    integer, parameter :: way_ends = 2              !! beyond some place the assembly cannot be closed
    integer, parameter :: way_forks = 3             !! assemblies meet on the way, and none is to be chosen
    integer, parameter :: way_too_long = 4          !! more steps than a way may take
    integer, parameter :: under_way = -1

    !> What is found where a mechanism stands or is tried.
    type :: footing
        logical :: is_closed(lanes) = .false.       !! by corrections that shrink as they must
        real(wp), allocatable :: margin(:, :)       !! smallest singular value of each map, signed: +, - assemblies (lane, n_map)
        real(wp), allocatable :: drift(:, :)        !! its rate, per whole way                                      (lane, n_map)
        real(wp), allocatable :: speed(:, :)        !! of the fastest link that the map places, likewise; 0: not told (lane, n_map)
        real(wp), allocatable :: shift(:, :)        !! of these links, the farthest from where the mechanism stands to here, part of
                                                    !! the mechanism's size; 0: not told                                  (lane,
                                                    !! n_map)
    end type footing

    !> A mechanism that stands on a straight way on every lane, and may be tried further on.
    type, abstract :: follower
        real(wp), allocatable :: least_margin(:)    !! below which a margin cannot be told from zero (n_map)
    contains
        procedure(try_place), deferred :: try
        procedure(take_place), deferred :: take
    end type follower

    !> How a way came out, on every lane.
    type :: way_report
        integer :: outcome(lanes) = way_arrived     !! one of `way_*`
        integer :: n_crossed(lanes) = 0             !! change points passed
        integer :: map(lanes) = 0                   !! at fault where the way was not finished; 0: none in particular
        real(wp) :: reached(lanes) = 0              !! part of the way
        logical :: is_limit(lanes) = .false.        !! of a way that ends: the margin at fault was going to zero as the root of the
                                                    !! distance where it could still be told well, as at a limit of reach
        real(wp), allocatable :: least(:, :)        !! the smallest size of a margin where the mechanism stood (lane, n_map)
    end type way_report

    abstract interface
        !> Predict by the tangent, correct, tell what is found.
        subroutine try_place(self, goes, part, lead, is_crossing, found)
            import :: follower, footing, wp, lanes
            class(follower), intent(inout) :: self
            logical, intent(in) :: goes(lanes)              !! false: nobody asks for what is found there
            real(wp), intent(in) :: part(lanes)             !! of the way
            real(wp), intent(in) :: lead(lanes)             !! how far the tangent is followed from where it stands: what is left of
                                                            !! that part, or more where places are known to run ahead
            logical, intent(in) :: is_crossing(:, :)        !! the map is tried on the far side of a change point (lane, n_map)
            type(footing), intent(inout) :: found
        end subroutine try_place

        !> Where the mechanism was tried it stands from now on.
        subroutine take_place(self, is_taken)
            import :: follower, lanes
            class(follower), intent(inout) :: self
            logical, intent(in) :: is_taken(lanes)
        end subroutine take_place
    end interface

contains

    !> Go the whole way on the lanes that go.
    subroutine follow_way(self, goes, stride, passes, spare_tries, report)
        class(follower), intent(inout) :: self
        logical, intent(in) :: goes(lanes)
        real(wp), intent(in) :: stride(lanes)               !! longest step, part of the way
        logical, intent(in) :: passes                       !! change points are passed, on the smooth continuation
        integer, intent(in) :: spare_tries                  !! beside those for strides; a change point takes some 50
        type(way_report), intent(out) :: report
        type(footing) :: stands, tried
        logical, dimension(lanes, size(self%least_margin)) :: is_crossing
        logical, dimension(lanes) :: is_sound, is_first, is_at_limit
        logical :: is_root(lanes, size(self%least_margin))  !! the margin goes to zero as the root of the distance
        logical :: was_root(lanes, size(self%least_margin)) !! it did, where it could still be told well
        real(wp), dimension(lanes) :: target, lead, step
        real(wp) :: slope(lanes, size(self%least_margin))   !! of the margins, where they could still be told well; 0: never
        real(wp) :: pace(lanes, size(self%least_margin))    !! of the links, likewise
        real(wp) :: side(lanes, size(self%least_margin))    !! the margins that could be told last; 0: none
        integer :: n, lane, most(lanes)

        report%outcome = merge(under_way, way_arrived, goes)
        allocate (report%least(lanes, size(self%least_margin)), source=huge(1.0_wp))
        if (.not. any(goes)) return
        call set_out()
        most = spare_tries + 2*ceiling(1/merge(stride, 1.0_wp, goes))
        do n = 1, maxval(most, mask=goes)
            where (report%outcome == under_way .and. n > most) report%outcome = way_too_long
            if (all(report%outcome /= under_way)) exit
            call choose_targets()
            call self%try(report%outcome == under_way, target, lead, is_crossing, tried)
            call judge_places()
            call self%take(is_sound)
            do lane = 1, lanes
                if (report%outcome(lane) /= under_way) cycle
                if (is_sound(lane)) then
                    call go_on(lane)
                else if (is_at_limit(lane)) then
                    call give_up_crossing(lane)
                else
                    call turn_back(lane)
                end if
            end do
        end do
        where (report%outcome == under_way) report%outcome = way_too_long

    contains

        !> Stand at the beginning of the way.
        subroutine set_out()
            allocate (stands%margin(lanes, size(self%least_margin)), stands%drift(lanes, size(self%least_margin)))
            allocate (stands%speed(lanes, size(self%least_margin)), source=0.0_wp)
            allocate (stands%shift(lanes, size(self%least_margin)), source=0.0_wp)
            tried = stands
            is_crossing = .false.
            is_first = .true.
            slope = 0
            pace = 0
            side = 0
            is_root = .false.
            was_root = .false.
            lead = 0
            step = min(1.0_wp, stride)
            call self%try(goes, report%reached, lead, is_crossing, stands)
            call self%take(goes)
            report%least = abs(stands%margin)
            where (goes .and. .not. stands%is_closed) report%outcome = way_ends
            call note_side(side, stands%margin, spread(self%least_margin, 1, lanes), .false.)
        end subroutine set_out

        !> Where to try next. A way that would end at a change point ends before it.
        subroutine choose_targets()
            target = report%reached
            lead = 0
            is_crossing = .false.
            is_at_limit = .false.
            do lane = 1, lanes
                if (report%outcome(lane) /= under_way) cycle
                call choose_target(self%least_margin, stands, lane, slope(lane, :), side(lane, :), is_root(lane, :), &
                                   is_first(lane), report%reached(lane), step(lane), target(lane), lead(lane), &
                                   is_crossing(lane, :))
                is_at_limit(lane) = any(is_crossing(lane, :))
                if (.not. is_at_limit(lane)) cycle
                report%map(lane) = findloc(is_crossing(lane, :), .true., dim=1)
                if (target(lane) < 1) cycle
                report%outcome(lane) = way_at_singularity
                target(lane) = report%reached(lane)
                lead(lane) = 0
                is_crossing(lane, :) = .false.
            end do
        end subroutine choose_targets

        !> Which of the places tried are of the same assembly. Beyond a change point that is not to be passed none is.
        subroutine judge_places()
            do lane = 1, lanes
                is_sound(lane) = report%outcome(lane) == under_way .and. tried%is_closed(lane)
                if (is_sound(lane)) is_sound(lane) = is_place_sound(self%least_margin, stands, tried, lane, side(lane, :), &
                                                     target(lane) - report%reached(lane), is_crossing(lane, :))
                if (.not. (is_sound(lane) .and. is_at_limit(lane)) .or. passes) cycle
                report%outcome(lane) = way_forks
                is_sound(lane) = .false.
            end do
        end subroutine judge_places

        !> Stand where it was tried, and learn from the step how the margins go on.
        subroutine go_on(lane)
            integer, intent(in) :: lane
            real(wp) :: taken

            taken = target(lane) - report%reached(lane)
            step(lane) = min(stride(lane), merge(0.5_wp, 2.0_wp, is_at_limit(lane))*taken)
            if (is_at_limit(lane)) report%n_crossed(lane) = report%n_crossed(lane) + 1
            is_first(lane) = .false.
            call look_for_roots(stands%margin(lane, :), stands%drift(lane, :), tried%margin(lane, :), tried%drift(lane, :), &
                                is_root(lane, :))
            report%least(lane, :) = min(report%least(lane, :), abs(tried%margin(lane, :)), &
                                        least_between(stands%margin(lane, :), taken*stands%drift(lane, :), &
                                                      tried%margin(lane, :), taken*tried%drift(lane, :)))
            stands%margin(lane, :) = tried%margin(lane, :)
            call note_side(side(lane, :), tried%margin(lane, :), self%least_margin, is_crossing(lane, :))
            stands%drift(lane, :) = tried%drift(lane, :)
            stands%speed(lane, :) = tried%speed(lane, :)
            report%reached(lane) = target(lane)
            report%map(lane) = 0
            where (abs(stands%margin(lane, :)) >= well_told*self%least_margin)
                slope(lane, :) = abs(stands%drift(lane, :))
                pace(lane, :) = stands%speed(lane, :)
                was_root(lane, :) = is_root(lane, :)
            end where
            if (target(lane) < 1) return
            report%outcome(lane) = way_arrived
            if (all(abs(stands%margin(lane, :)) > self%least_margin)) return
            report%outcome(lane) = way_at_singularity
            report%map(lane) = minloc(abs(stands%margin(lane, :))/self%least_margin, 1)
        end subroutine go_on

        !> Nothing closes beyond, or not as a crossing would. Towards the end of an assembly links move without bound, and the
        !> margin goes as the root of the distance, ever more steeply, unless places grow without bound, too, as those of slides
        !> along axes that become parallel; where one is crossed both keep their slopes.
        subroutine give_up_crossing(lane)
            integer, intent(in) :: lane
            logical :: grows

            associate (m => report%map(lane))
                grows = (slope(lane, m) > 0 .and. abs(stands%drift(lane, m)) > same_slope*slope(lane, m)) &
                        .or. (pace(lane, m) > 0 .and. stands%speed(lane, m) > same_slope*pace(lane, m)) &
                        .or. tried%shift(lane, m) > farthest
            end associate
            report%outcome(lane) = merge(way_ends, way_forks, grows .or. .not. tried%is_closed(lane))
            report%is_limit(lane) = was_root(lane, report%map(lane))
        end subroutine give_up_crossing

        !> A shorter step next time, unless it would be none.
        subroutine turn_back(lane)
            integer, intent(in) :: lane
            real(wp), parameter :: near = 100           !! times the least margin

            step(lane) = (target(lane) - report%reached(lane))/2
            if (step(lane) > least_step) return
            report%map(lane) = minloc(abs(stands%margin(lane, :))/self%least_margin, 1)
            report%outcome(lane) = way_too_long
            if (any(abs(stands%margin(lane, :)) <= near*self%least_margin)) report%outcome(lane) = way_ends
        end subroutine turn_back
    end subroutine follow_way

    !> Remember on which side a margin is, if it can be told from zero, or has just been taken through it.
    elemental subroutine note_side(side, margin, least_margin, has_crossed)
        real(wp), intent(inout) :: side
        real(wp), intent(in) :: margin, least_margin
        logical, intent(in) :: has_crossed

        if (abs(margin) > least_margin .or. has_crossed) side = margin
    end subroutine note_side

    !> How small a margin becomes within a step, that goes down at the beginning and up at the end: where both tangents meet.
    elemental real(wp) function least_between(before, drift_before, now, drift_now) result(least)
        real(wp), intent(in) :: before, drift_before        !! rates for the whole step
        real(wp), intent(in) :: now, drift_now

        least = min(abs(before), abs(now))
        if (before*drift_before >= 0 .or. now*drift_now <= 0 .or. before*now <= 0) return
        least = abs(before) - abs(drift_before)*(abs(before) - abs(now) + abs(drift_now))/(abs(drift_before) + abs(drift_now))
        least = max(0.0_wp, min(least, abs(before), abs(now)))
    end function least_between

    !> Does a margin go to zero as the root of the distance? Then its product with its rate stays, which is halved with a margin
    !> that goes there straight. Asked wherever it has changed enough to tell the two apart.
    elemental subroutine look_for_roots(before, drift_before, now, drift_now, is_root)
        real(wp), intent(in) :: before, drift_before        !! at one place
        real(wp), intent(in) :: now, drift_now              !! at the next
        logical, intent(inout) :: is_root
        real(wp), parameter :: told = 0.8_wp, alike = 0.1_wp

        if (abs(now) > told*abs(before)) then
            is_root = is_root .and. now*drift_now < 0
        else
            is_root = now*drift_now < 0 .and. abs(now*drift_now - before*drift_before) <= alike*abs(before*drift_before)
        end if
    end subroutine look_for_roots

    !> The next place to be tried: one from which no margin led on would vanish; at a margin that cannot be told from zero
    !> and goes to it, the mirror of the place on the far side.
    pure subroutine choose_target(least_margin, stands, lane, slope, side, is_root, is_first, reached, step, target, lead, &
                                  is_crossing)
        real(wp), intent(in) :: least_margin(:)             !! (n_map)
        type(footing), intent(in) :: stands
        integer, intent(in) :: lane
        real(wp), intent(in) :: slope(:)                    !! of the margins some way before; 0: not known
        real(wp), intent(in) :: side(:)                     !! their last value that could be told; 0: none
        logical, intent(in) :: is_root(:)                   !! they go to zero as roots
        logical, intent(in) :: is_first                     !! position alone does not say which way a singular one is left
        real(wp), intent(in) :: reached, step
        real(wp), intent(out) :: target
        real(wp), intent(out) :: lead                       !! how far the tangent is followed to there
        logical, intent(out) :: is_crossing(:)              !! (n_map)
        real(wp) :: longest, mirrored, end, vanishing(size(least_margin))
        integer :: m

        longest = step
        end = huge(1.0_wp)
        mirrored = 0
        is_crossing = .false.
        vanishing = huge(1.0_wp)
        do m = 1, size(least_margin)
            associate (margin => stands%margin(lane, m), drift => stands%drift(lane, m))
                if (margin*drift < 0) vanishing(m) = abs(margin/drift)
                if (abs(margin) > least_margin(m) .and. is_root(m)) then
                    ! led on straight, a root vanishes at twice its distance
                    end = min(end, vanishing(m)/2)
                    longest = min(longest, part_of_root(abs(margin), least_margin(m))*vanishing(m)/2)
                else if (abs(margin) > least_margin(m)) then
                    longest = min(longest, nearest_try*vanishing(m))
                else if (.not. is_first .and. (margin*drift < 0 .or. margin*side(m) < 0)) then
                    ! It goes to zero, or has just passed it.
                    is_crossing(m) = .true.
                    mirrored = max(mirrored, 2*least_margin(m)/merge(slope(m), abs(drift), slope(m) > 0))
                end if
            end associate
        end do
        if (mirrored > 0) then
            longest = mirrored
            is_crossing = is_crossing .or. vanishing < mirrored
        end if
        target = min(1.0_wp, reached + longest)
        if (1 - target < longest/16) target = 1     ! no splinters at the end
        lead = target - reached
        if (.not. any(is_crossing) .and. lead < end) lead = 2*lead/(1 + sqrt(1 - lead/end))
    end subroutine choose_target

    !> Part of the distance to where a margin vanishes as a root: that after which so much of the margin is left as can be hit by
    !> tangents led on as a root. What else moves the links there counts the less the smaller the margin is.
    elemental real(wp) function part_of_root(margin, least_margin) result(part)
        real(wp), intent(in) :: margin, least_margin        !! size, and what can be told from zero
        real(wp), parameter :: most_left = 0.6_wp, least_left = 0.1_wp, others = 8
        real(wp) :: left

        left = min(most_left, max(least_left, others*margin))
        left = max(left, min(most_left, least_margin/(2*margin)))
        part = 1 - left**2
    end function part_of_root

    !> Is the place found where it was tried that to which the mechanism gets?
    pure logical function is_place_sound(least_margin, stands, tried, lane, side, step, is_crossing) result(is_sound)
        real(wp), intent(in) :: least_margin(:)
        type(footing), intent(in) :: stands, tried
        integer, intent(in) :: lane
        real(wp), intent(in) :: side(:)                     !! the margins that could be told last; 0: none
        real(wp), intent(in) :: step                        !! part of the way
        logical, intent(in) :: is_crossing(:)
        real(wp) :: before, now
        integer :: m

        is_sound = .true.
        do m = 1, size(least_margin)
            before = stands%margin(lane, m)
            now = tried%margin(lane, m)
            ! Beyond a place to which links go without end, as slides do along axes that become parallel, they come from the other
            ! end of the world: what closes there is not what the mechanism gets to.
            if (abs(before) <= least_margin(m)) is_sound = is_sound .and. tried%shift(lane, m) <= farthest
            if (is_crossing(m)) then
                is_sound = is_sound .and. merge(side(m), before, side(m) /= 0)*now < 0 &
                           .and. abs(now) <= same_margin*max(abs(before), least_margin(m))
            else
                is_sound = is_sound .and. is_step_sound(least_margin(m), before, step*stands%drift(lane, m), &
                                                        now, step*tried%drift(lane, m))
            end if
        end do
    end function is_place_sound

    !> May a map's margin be believed to have kept its sign over a step? A margin that cannot be told from zero is no
    !> witness.
    pure elemental logical function is_step_sound(least_margin, before, drift_before, now, drift_now) result(is_sound)
        real(wp), intent(in) :: least_margin
        real(wp), intent(in) :: before, drift_before        !! where the mechanism stands; rate per step
        real(wp), intent(in) :: now, drift_now              !! where it was tried
        real(wp) :: doubt(1)

        doubt = 0
        call doubt_unsound(1, least_margin, [before], [drift_before], [now], [drift_now], [1.0_wp], doubt)
        is_sound = .not. doubt(1) > 0
    end function is_step_sound

    !> On lanes, of one map: where it may not be believed doubt grows, which is 0 where nothing speaks against it. A number, and
    !> written without branches: it takes a vector at a time.
    pure subroutine doubt_unsound(n, least_margin, before, drift_before, now, drift_now, step, doubt)
        integer, intent(in) :: n                            !! lanes
        real(wp), intent(in) :: least_margin
        real(wp), intent(in), dimension(n) :: before, drift_before, now, drift_now     !! rates per unit of the steps
        real(wp), intent(in) :: step(n)
        real(wp), intent(inout) :: doubt(n)
        integer :: lane

        do lane = 1, n
            associate (leads_to => before(lane)*(before(lane) + look_ahead*(step(lane)*drift_before(lane))), &
                       comes_from => now(lane)*(now(lane) - look_ahead*(step(lane)*drift_now(lane))))
                doubt(lane) = doubt(lane) + merge(1.0_wp, 0.0_wp, abs(before(lane)) > least_margin) &
                              *(merge(0.0_wp, 1.0_wp, leads_to > 0) + merge(1.0_wp, 0.0_wp, before(lane)*now(lane) < 0)) &
                              + merge(1.0_wp, 0.0_wp, abs(now(lane)) > least_margin)*merge(0.0_wp, 1.0_wp, comes_from > 0)
            end associate
        end do
    end subroutine doubt_unsound
end module linkdyn_following
