!> Blocks whose lanes all hold the same, as those of a run on its own do: what one lane gives all of them give.
module linkdyn_same_lanes
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    implicit none (type, external)
    private
    public :: is_same_on_all

contains

    !> Does every lane have the same n numbers? A NaN is the same as nothing.
    pure logical function is_same_on_all(n, x)
        integer, intent(in) :: n
        real(wp), intent(in) :: x(lanes, n)
        integer :: k

        is_same_on_all = .false.
        do k = 1, n
            if (.not. all(x(2:, k) == x(1, k))) return
        end do
        is_same_on_all = .true.
    end function is_same_on_all
end module linkdyn_same_lanes
