!> Sizes of rows and columns, by which a matrix is scaled before its condition number is taken.
module linkdyn_equilibration
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    implicit none (type, external)
    private
    public :: measure_matrix, measure_entries

contains

    !> Largest entry of each row and, rows divided by it, of each column; the 1-norm of the matrix with both divided out.
    !> What is zero altogether has size one.
    pure subroutine measure_matrix(a, row_size, column_size, norm)
        real(wp), intent(in) :: a(:, :)                    !! (n, n)
        real(wp), intent(out) :: row_size(:), column_size(:)
        real(wp), intent(out) :: norm
        integer :: j

        row_size = maxval(abs(a), dim=2)
        where (.not. row_size > 0) row_size = 1
        norm = 0
        do j = 1, size(a, 2)
            column_size(j) = maxval(abs(a(:, j))/row_size)
            if (.not. column_size(j) > 0) column_size(j) = 1
            norm = max(norm, sum(abs(a(:, j))/row_size)/column_size(j))
        end do
    end subroutine measure_matrix

    !> The same of a sparse matrix, on lanes.
    pure subroutine measure_entries(n, row, column, entry, slot, row_size, column_size, norm)
        integer, intent(in) :: n
        integer, intent(in) :: row(:), column(:), entry(:)     !! of the nonzeros: place, and slot of the value
        real(wp), intent(in) :: slot(lanes, *)
        real(wp), intent(out), dimension(lanes, n) :: row_size, column_size
        real(wp), intent(out) :: norm(lanes)
        real(wp) :: row_factor(lanes, n), column_sum(lanes, n), scaled
        integer :: k, l

        ! Lane by lane, and a comparison where `max` would serve: so all lanes go at once.
        row_size = 0
        do k = 1, size(entry)
            do l = 1, lanes
                scaled = abs(slot(l, entry(k)))
                row_size(l, row(k)) = merge(scaled, row_size(l, row(k)), scaled > row_size(l, row(k)))
            end do
        end do
        row_factor = 1/row_size
        column_size = 0
        column_sum = 0
        do k = 1, size(entry)
            do l = 1, lanes
                scaled = abs(slot(l, entry(k)))*row_factor(l, row(k))
                column_sum(l, column(k)) = column_sum(l, column(k)) + scaled
                column_size(l, column(k)) = merge(scaled, column_size(l, column(k)), scaled > column_size(l, column(k)))
            end do
        end do
        norm = 0
        do k = 1, n
            do l = 1, lanes
                scaled = column_sum(l, k)/column_size(l, k)
                norm(l) = merge(scaled, norm(l), scaled > norm(l))
            end do
        end do
    end subroutine measure_entries
end module linkdyn_equilibration
