!> Margins along the way of a step that is to be accepted: whether what its ends tell of the assembly is all that has happened
!> between.
!>
!> A loop that passes two change points within a step has a margin of the same sign at both ends, and rates there that say nothing.
!> So margins are looked at in some places of the step. Of a closed form the margin is the sine of an angle: where it goes no more
!> than one from place to place, at the largest of its rates, no two change points fit between two places. A step is gone at once if
!> each map changes the sign of its margin once at most.
module linkdyn_margins_within
    use linkdyn_kinds, only: wp
    implicit none (type, external)
    private
    public :: find_part_of_margins

    real(wp), parameter :: most_change = 1             !! of a margin, from place to place at its largest rate
    real(wp), parameter :: well_within = 0.9_wp        !! of what may be gone: a step of just that might be found too long again

contains

    !> How much of the step may be gone at once.
    pure subroutine find_part_of_margins(least_margin, margin, drift, n_branch, length, part)
        real(wp), intent(in) :: least_margin(:)        !! below which a margin has no sign (n_map)
        real(wp), intent(in) :: margin(:, :)           !! at places from the step's beginning to its end, equally far apart; not a
                                                       !! number where it cannot be told (place, n_map)
        real(wp), intent(in) :: drift(:, :)            !! its rate [1/s] (place, n_map)
        integer, intent(in) :: n_branch                !! of the first maps, closed forms, rates are known
        real(wp), intent(in) :: length                 !! of the step [s]
        real(wp), intent(out) :: part                  !! 1: all of it
        real(wp) :: change
        integer :: m

        part = 1
        do m = 1, size(margin, 2)
            part = min(part, part_before_return(least_margin(m), margin(:, m)))
            if (m > n_branch) cycle
            change = maxval(abs(drift(:, m)), mask=abs(drift(:, m)) <= huge(1.0_wp))*abs(length)/(size(margin, 1) - 1)
            if (change > most_change) part = min(part, well_within*most_change/change)
        end do
        if (part < 1) call end_away(minval(abs(margin), dim=2), part)
    end subroutine find_part_of_margins

    !> No step ends near a change point if it can end elsewhere: rates are rounding there.
    pure subroutine end_away(margin, part)
        real(wp), intent(in) :: margin(:)              !! the least one at each place; not a number where it cannot be told
        real(wp), intent(inout) :: part
        integer :: place

        place = 1 + int(part*(size(margin) - 1))
        if (place < 3) return
        part = real(maxloc(margin(2:place), 1, mask=margin(2:place) <= huge(1.0_wp)), wp)/(size(margin) - 1)
    end subroutine end_away

    !> Up to the last place before the sign of a margin changes for the second time; 1: it does not.
    pure real(wp) function part_before_return(least_margin, margin) result(part)
        real(wp), intent(in) :: least_margin
        real(wp), intent(in) :: margin(:)              !! (place)
        real(wp) :: side
        integer :: place, n_change, last

        part = 1
        side = 0
        n_change = 0
        last = 1
        do place = 1, size(margin)
            if (.not. abs(margin(place)) > least_margin) cycle
            if (margin(place)*side < 0) n_change = n_change + 1
            if (n_change == 2) then
                part = max(1, last - 1)/real(size(margin) - 1, wp)
                return
            end if
            side = margin(place)
            last = place
        end do
    end function part_before_return
end module linkdyn_margins_within
