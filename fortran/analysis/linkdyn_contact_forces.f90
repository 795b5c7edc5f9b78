!> The few equations of contacts: which pushes give them the changes wanted. Lanes have contacts of their own.
module linkdyn_contact_forces
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    implicit none (type, external)
    private
    public :: solve_contacts

contains

    !> Pushes of those in contact; the others push nothing. A contact on which no push has an effect gets none.
    pure subroutine solve_contacts(response, is_in_contact, wanted, push)
        real(wp), intent(in) :: response(:, :, :)      !! change of a contact by the unit push of one (lane, of, by)
        logical, intent(in) :: is_in_contact(:, :)     !! (lane, contact)
        real(wp), intent(in) :: wanted(:, :)           !! changes (lane, contact)
        real(wp), intent(out) :: push(:, :)            !! (lane, contact)
        real(wp), allocatable :: matrix(:, :), x(:)
        integer, allocatable :: contact(:)
        integer :: lane, i

        push = 0
        do lane = 1, lanes
            contact = pack([(i, i=1, size(push, 2))], is_in_contact(lane, :))
            if (size(contact) == 0) cycle
            matrix = response(lane, contact, contact)
            x = wanted(lane, contact)
            call eliminate(matrix, x)
            push(lane, contact) = x
        end do
    end subroutine solve_contacts

    !> Gauss with pivots from the diagonal: the matrix is symmetric and not negative. Contacts that others hold already have
    !> no pivot left.
    pure subroutine eliminate(matrix, x)
        real(wp), intent(inout) :: matrix(:, :), x(:)
        real(wp), parameter :: least = 1.0e-10_wp      !! pivot over what was on the diagonal
        real(wp) :: before(size(x)), factor
        logical :: is_done(size(x))
        integer :: i, k, row, n, order(size(x))

        n = size(x)
        before = [(abs(matrix(i, i)), i=1, n)]
        is_done = .false.
        order = 0
        do i = 1, n
            k = maxloc([(matrix(row, row)/max(before(row), tiny(1.0_wp)), row=1, n)], dim=1, mask=.not. is_done)
            is_done(k) = .true.
            if (.not. matrix(k, k) > least*before(k)) then
                matrix(k, k) = 0
                cycle
            end if
            order(i) = k
            do row = 1, n
                if (is_done(row)) cycle
                factor = matrix(row, k)/matrix(k, k)
                matrix(row, :) = matrix(row, :) - factor*matrix(k, :)
                x(row) = x(row) - factor*x(k)
            end do
        end do
        is_done = .false.
        do i = n, 1, -1
            k = order(i)
            if (k == 0) cycle
            x(k) = (x(k) - sum(matrix(k, :)*x, mask=is_done))/matrix(k, k)
            is_done(k) = .true.
        end do
        where (.not. is_done) x = 0
    end subroutine eliminate
end module linkdyn_contact_forces
