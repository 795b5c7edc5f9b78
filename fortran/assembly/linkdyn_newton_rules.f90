!> Rules of Newton's iteration for groups of links, whoever makes its steps: when it has arrived, and when it is not believed.
module linkdyn_newton_rules
    use linkdyn_following, only: largest_contraction, untrusted
    use linkdyn_kinds, only: wp
    implicit none (type, external)
    private
    public :: is_small, watch_contraction, rounding_at, step_ahead, judge_corrections
    public :: small_step, largest_turn, least_group_margin

    ! Newton's method squares the error: after a correction below this, the next error is below rounding.
    real(wp), parameter :: small_step = 1.0e-2_wp*sqrt(epsilon(1.0_wp))
    real(wp), parameter :: largest_turn = 0.5_wp     !! [rad] of a link in one step
    real(wp), parameter :: rounding = 16*epsilon(1.0_wp)    !! of a constraint
    !> Below this a margin is not told from zero: rounding e leaves places uncertain by e/margin, and their tangents by
    !> e/margin^2, which must stay small where two assemblies cross.
    real(wp), parameter :: least_group_margin = 10*untrusted

contains

    !> Is a correction so small that none need follow?
    elemental logical function is_small(largest, noise)
        real(wp), intent(in) :: largest
        real(wp), intent(in) :: noise        !! what rounding alone makes of it

        is_small = largest <= max(small_step, noise)
    end function is_small

    !> The correction that rounding of the constraints makes at a margin of one, at a distance from the world's origin.
    elemental real(wp) function rounding_at(distance, scene_size) result(noise)
        real(wp), intent(in) :: distance     !! of the group's links, the largest, or the mechanism's size
        real(wp), intent(in) :: scene_size

        noise = rounding*distance/scene_size
    end function rounding_at

    !> Two corrections, one after the other, tell whether the place predicted was near enough.
    elemental subroutine watch_contraction(before, largest, noise, contraction)
        real(wp), intent(in) :: before, largest, noise
        real(wp), intent(inout) :: contraction

        if (is_small(before, noise) .or. is_small(largest, noise)) return
        contraction = max(contraction, largest/before)
    end subroutine watch_contraction

    !> How far to look ahead for a margin's rate: a small part of the distance to where it may vanish at the nearest.
    elemental real(wp) function step_ahead(margin, speed) result(step)
        real(wp), intent(in) :: margin
        real(wp), intent(in) :: speed                    !! of the group's links along the way
        real(wp), parameter :: part = 1.0e-3_wp, longest = 1.0e-4_wp

        step = min(part*abs(margin), longest)/max(speed, tiny(1.0_wp))
    end function step_ahead

    !> Steps that somebody has made at some samples, each from a place predicted: where the iteration is not believed any more, and
    !> where it goes on.
    pure subroutine judge_corrections(is_first, largest, bounded, distance, scene_size, margin, is_sure, before, contraction, &
                                      is_closed, is_under_way)
        logical, intent(in) :: is_first                  !! step
        real(wp), intent(in) :: largest(:)               !! correction (sample)
        real(wp), intent(in) :: bounded(:)               !! the same without turns about threads (sample)
        real(wp), intent(in) :: distance(:)              !! from the world's origin (sample)
        real(wp), intent(in) :: scene_size
        real(wp), intent(in) :: margin(:)                !! (sample)
        logical, intent(in) :: is_sure(:)                !! of the step (sample)
        real(wp), intent(inout) :: before(:), contraction(:)    !! the last correction; the worst so far (sample)
        logical, intent(inout) :: is_closed(:), is_under_way(:) !! others are not looked at (sample)
        real(wp) :: noise
        integer :: s

        do s = 1, size(margin)
            if (.not. is_under_way(s)) cycle
            noise = rounding_at(distance(s), scene_size)/max(abs(margin(s)), least_group_margin)
            if (.not. is_first) call watch_contraction(before(s), largest(s), noise, contraction(s))
            is_closed(s) = is_sure(s) .and. contraction(s) <= largest_contraction .and. bounded(s) <= largest_turn
            is_under_way(s) = is_closed(s) .and. .not. is_small(largest(s), noise)
            before(s) = largest(s)
        end do
    end subroutine judge_corrections
end module linkdyn_newton_rules
