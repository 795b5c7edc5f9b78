!> Sizes of states side by side, which tell what is no number, or none any more.
module linkdyn_lane_sizes
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    implicit none (type, external)
    private
    public :: sizes_on_lanes

contains

    !> The sum of the sizes of each lane's numbers.
    pure function sizes_on_lanes(n, y) result(total)
        integer, intent(in) :: n
        real(wp), intent(in) :: y(lanes, n)
        real(wp) :: total(lanes)
        integer :: k

        total = 0
        do k = 1, n
            total = total + abs(y(:, k))
        end do
    end function sizes_on_lanes
end module linkdyn_lane_sizes
