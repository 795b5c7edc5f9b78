!> An order of rows chosen once, in which elimination needs no pivoting as long as the values stay like those at hand.
!>
!> For comparison with methods that choose their pivots: equations in the order of links and joints have zeros on the diagonal.
module linkdyn_row_order
    use linkdyn_elimination_plan, only: sparse_system
    use linkdyn_kinds, only: wp
    implicit none (type, external)
    private
    public :: order_rows

contains

    !> Where each row goes. Column by column the row is taken whose entry is, at the worst of the representative poses, the
    !> largest part of the column's largest.
    pure function order_rows(system) result(place)
        type(sparse_system), intent(in) :: system
        integer :: place(system%n)
        real(wp), allocatable :: a(:, :, :)          !! (pose, row, column)
        real(wp) :: quality, best_quality
        integer :: k, i, j, best, row(system%n)

        place = [(k, k=1, system%n)]
        if (size(system%value, 1) == 0) return
        allocate (a(size(system%value, 1), system%n, system%n))
        a = 0
        do k = 1, size(system%row)
            a(:, system%row(k), system%column(k)) = system%value(:, k)
        end do
        row = place
        do k = 1, system%n
            best = k
            best_quality = -1
            do i = k, system%n
                quality = minval(abs(a(:, row(i), k))/max(maxval(abs(a(:, row(k:), k)), dim=2), tiny(1.0_wp)))
                if (quality <= best_quality) cycle
                best = i
                best_quality = quality
            end do
            row([k, best]) = row([best, k])
            do i = k + 1, system%n
                if (all(a(:, row(i), k) == 0)) cycle
                do j = k + 1, system%n
                    where (a(:, row(k), k) /= 0) a(:, row(i), j) = a(:, row(i), j) - a(:, row(i), k)/a(:, row(k), k)*a(:, row(k), j)
                end do
            end do
        end do
        do k = 1, system%n
            place(row(k)) = k
        end do
    end function order_rows
end module linkdyn_row_order
