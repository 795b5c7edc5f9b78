!> Sums that keep what rounding takes from them.
module linkdyn_exact_sum
    use linkdyn_kinds, only: wp
    implicit none (type, external)
    private
    public :: add_exactly

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
end module linkdyn_exact_sum
