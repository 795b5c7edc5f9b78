!> Sizes of states side by side, which tell what is no number, or none any more.
module linkdyn_lane_sizes
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    implicit none (type, external)
    private
    public :: find_sizes

contains

    !> The sum of the sizes of each lane's numbers. Not a function: of one with an array for its result gfortran makes no vectors.
    pure subroutine find_sizes(n, y, total)
        integer, intent(in) :: n
        real(wp), intent(in) :: y(lanes, n)
        real(wp), intent(out) :: total(lanes)
        integer :: k

        total = 0
        do k = 1, n
            total = total + abs(y(:, k))
        end do
    end subroutine find_sizes
end module linkdyn_lane_sizes
