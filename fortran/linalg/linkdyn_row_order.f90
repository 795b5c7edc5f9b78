!> An order of rows chosen once, in which elimination needs no pivoting as long as the values stay like those at hand.
!>
!> For comparison with methods that choose their pivots: equations in the order of links and joints have zeros on the diagonal.
module linkdyn_row_order
    use linkdyn_kinds, only: wp
    implicit none (type, external)
    private
    public :: order_rows

contains

    !> Where each row goes. Column by column the row is taken whose entry is, at the worst of the representative poses, the
    !> largest part of the column's largest.
    pure function order_rows(n, at_row, at_column, value) result(place)
        integer, intent(in) :: n                     !! equations
        integer, intent(in) :: at_row(:), at_column(:)    !! of the nonzeros
        real(wp), intent(in) :: value(:, :)          !! of these (pose, nonzero); without poses the order stays
        integer :: place(n)
        real(wp), allocatable :: a(:, :, :)          !! (pose, row, column)
        real(wp) :: quality, best_quality
        integer :: k, i, j, best, row(n)

        place = [(k, k=1, n)]
        if (size(value, 1) == 0) return
        allocate (a(size(value, 1), n, n))
        a = 0
        do k = 1, size(at_row)
            a(:, at_row(k), at_column(k)) = value(:, k)
        end do
        row = place
        do k = 1, n
            best = k
            best_quality = -1
            do i = k, n
                quality = minval(abs(a(:, row(i), k))/max(maxval(abs(a(:, row(k:), k)), dim=2), tiny(1.0_wp)))
                if (quality <= best_quality) cycle
                best = i
                best_quality = quality
            end do
            row([k, best]) = row([best, k])
            do i = k + 1, n
                if (all(a(:, row(i), k) == 0)) cycle
                do j = k + 1, n
                    where (a(:, row(k), k) /= 0) a(:, row(i), j) = a(:, row(i), j) - a(:, row(i), k)/a(:, row(k), k)*a(:, row(k), j)
                end do
            end do
        end do
        do k = 1, n
            place(row(k)) = k
        end do
    end function order_rows
end module linkdyn_row_order
