!> Angles of many turns: whole turns are counted apart, so that what is left rounds as an angle of the first turn does.
!>
!> At a thousand turns the last place of an angle is 9e-13 rad. Forces found there are off by as much in one step as in
!> the first turn by a thousand steps.
module linkdyn_whole_turns
    use linkdyn_constants, only: two_pi
    use linkdyn_exact_sum, only: add_exactly
    use linkdyn_kinds, only: wp
    implicit none (type, external)
    private
    public :: whole_turns, take_off, with_turns, nearest_turns, told_turns, least_angle, has_vague_turn, may_have_turns, &
        may_any_have_turns

    !> A turn in pieces of 30 bits, more than twice the digits of any kind of real.
    integer, parameter :: piece(0:7) = [6, 304067908, 280256794, 412666961, 470212838, 575800476, 71644134, 243286391]
    integer, parameter :: width = 30
    !> Less than half a turn.
    real(wp), parameter :: surely_none = 3

    !> Turns whose products with a piece are exact in double precision.
    real(wp), parameter :: most = 2.0_wp**22

contains

    !> What is left of an angle, or of a difference of two, without whole turns: within half a turn of zero.
    elemental real(wp) function least_angle(angle) result(least)
        real(wp), intent(in) :: angle      !! [rad]

        least = angle - two_pi*nearest_turns(angle)
    end function least_angle

    !> The number of whole turns nearest to an angle: mostly none, which is told without a division and a call.
    elemental real(wp) function nearest_turns(angle) result(turns)
        real(wp), intent(in) :: angle      !! [rad]

        turns = 0
        if (may_have_turns(angle)) turns = anint(angle/two_pi)
    end function nearest_turns

    !> Is an angle, or no number, more than surely less than half a turn away from zero?
    elemental logical function may_have_turns(angle)
        real(wp), intent(in) :: angle      !! [rad]

        may_have_turns = .not. abs(angle) <= surely_none
    end function may_have_turns

    !> Is one of some angles? Written without branches, as it is asked after each step on lanes.
    pure logical function may_any_have_turns(n, angle)
        integer, intent(in) :: n
        real(wp), intent(in) :: angle(n)   !! [rad]
        integer :: i, n_near

        n_near = 0
        do i = 1, n
            n_near = n_near + merge(1, 0, abs(angle(i)) <= surely_none)
        end do
        may_any_have_turns = n_near < n
    end function may_any_have_turns

    !> The same of an angle that is told: half a turn is half a turn up, whichever way rounding has it. What is left is in
    !> (-pi, pi], but for rounding.
    elemental real(wp) function told_turns(angle) result(turns)
        real(wp), intent(in) :: angle      !! [rad]
        real(wp), parameter :: rounding = 256*epsilon(1.0_wp)*two_pi     ! of angles by way of some links

        turns = nearest_turns(angle - rounding)
    end function told_turns

    !> Has an angle so many turns that rounding leaves less than half of the digits of its rest?
    elemental logical function has_vague_turn(angle)
        real(wp), intent(in) :: angle      !! [rad]

        has_vague_turn = spacing(angle) > sqrt(epsilon(1.0_wp))
    end function has_vague_turn

    !> Turns without which an angle is within half a turn of zero.
    elemental real(wp) function whole_turns(angle) result(turns)
        real(wp), intent(in) :: angle      !! [rad]

        turns = nearest_turns(angle)
        turns = sign(min(abs(turns), most), turns)
    end function whole_turns

    !> An angle without these turns, to the last digit of its rest.
    elemental subroutine take_off(turns, angle, rest)
        real(wp), intent(in) :: turns      !! a whole number
        real(wp), intent(inout) :: angle   !! [rad]
        real(wp), intent(inout) :: rest    !! of it, less than its last place
        real(wp) :: small
        integer :: i

        do i = 0, ubound(piece, 1)
            call add_exactly(-turns*scale(real(piece(i), wp), -width*i), angle, rest)
        end do
        small = rest
        rest = 0
        call add_exactly(small, angle, rest)
    end subroutine take_off

    !> The whole angle, rounded once.
    elemental real(wp) function with_turns(angle, turns) result(whole)
        real(wp), intent(in) :: angle, turns
        real(wp) :: rest

        whole = angle
        if (turns == 0) return
        rest = 0
        call take_off(-turns, whole, rest)
    end function with_turns
end module linkdyn_whole_turns
