!> Sums that keep what rounding takes from them.
module linkdyn_exact_sum
    use linkdyn_kinds, only: wp
    implicit none (type, external)
    private
    public :: add_exactly, add_all_exactly

contains

    !> Neumaier's summation: what rounding takes from the sum goes to the rest.
    elemental subroutine add_exactly(term, sum, rest)
        real(wp), intent(in) :: term
        real(wp), intent(inout) :: sum, rest
        real(wp) :: total

        total = sum + term
        if (abs(sum) >= abs(term)) then
            rest = rest + ((sum - total) + term)
        else
            rest = rest + ((term - total) + sum)
        end if
        sum = total
    end subroutine add_exactly

    !> The same of many sums side by side, none of which has a rest yet: without a question, which takes no longer than a few sums.
    pure subroutine add_all_exactly(n, term, sum, rest)
        integer, intent(in) :: n
        real(wp), intent(in) :: term(n)
        real(wp), intent(inout) :: sum(n)
        real(wp), intent(out) :: rest(n)
        real(wp) :: total, added
        integer :: i

        do i = 1, n
            total = sum(i) + term(i)
            added = total - sum(i)
            rest(i) = (sum(i) - (total - added)) + (term(i) - added)
            sum(i) = total
        end do
    end subroutine add_all_exactly
end module linkdyn_exact_sum
