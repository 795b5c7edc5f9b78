!> How far some points are spread, wherever they are drawn: the same after they are shifted or turned together.
module linkdyn_breadth
    use linkdyn_kinds, only: wp
    implicit none (type, external)
    private
    public :: breadth

contains

    !> Half the largest distance between two points; none where rounding of their coordinates may have made it. Only points far from
    !> the middle are compared with each other: of thousands in a row, two.
    pure real(wp) function breadth(point)
        real(wp), intent(in) :: point(:, :)          !! (3, n)
        real(wp), parameter :: rounding = 64*epsilon(1.0_wp)
        real(wp) :: far(size(point, 2)), middle(3), least
        integer, allocatable :: outer(:)
        integer :: i, k, n

        breadth = 0
        n = size(point, 2)
        if (n < 2) return
        middle = sum(point, dim=2)/n
        far = [(norm2(point(:, i) - middle), i=1, n)]
        k = maxloc(far, dim=1)
        least = maxval([(norm2(point(:, i) - point(:, k)), i=1, n)])
        outer = pack([(i, i=1, n)], far >= least - far(k))
        do i = 1, size(outer)
            do k = 1, i - 1
                least = max(least, norm2(point(:, outer(i)) - point(:, outer(k))))
            end do
        end do
        if (least > rounding*maxval(abs(point))) breadth = least/2
    end function breadth
end module linkdyn_breadth
