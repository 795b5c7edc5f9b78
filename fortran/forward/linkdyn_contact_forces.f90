!> The few equations of contacts: which pushes give them the changes wanted. Lanes have contacts of their own.
module linkdyn_contact_forces
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    implicit none (type, external)
    private
    public :: solve_contacts, solve_complementary, solve_held

    real(wp), parameter :: least = 1.0e-10_wp          !! of a contact's response, what others leave of it

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
            call eliminate(matrix, x, least)
            push(lane, contact) = x
        end do
    end subroutine solve_contacts

    !> The same of one lane, where all are in contact and may pull as well.
    pure function solve_held(response, wanted) result(push)
        real(wp), intent(in) :: response(:, :)         !! (of, by)
        real(wp), intent(in) :: wanted(:)              !! changes
        real(wp) :: push(size(wanted)), matrix(size(wanted), size(wanted))

        matrix = response
        push = wanted
        call eliminate(matrix, push, least)
    end function solve_held

    !> Pushes of which none pulls, so that no contact closes further, and what opens is not pushed: with the response W and the
    !> speeds or accelerations b apart without them, p >= 0, W p + b >= 0, p (W p + b) = 0. W is symmetric and not negative, so
    !> this is the least of p W p/2 + b p over p >= 0, found as Lawson and Hanson do: the contact that closes fastest pushes too,
    !> and those that would pull for it are left out on the way there. Every such step is downhill, so they come to an end.
    pure subroutine solve_complementary(response, apart, push)
        real(wp), intent(in) :: response(:, :)         !! (of, by)
        real(wp), intent(in) :: apart(:)               !! without pushes
        real(wp), intent(out) :: push(:)
        real(wp), parameter :: slack = 1.0e-14_wp      !! of the largest that is apart, in contacts of equal mass
        real(wp), dimension(size(push)) :: mass, b, x, trial, left
        real(wp) :: matrix(size(push), size(push)), way
        logical, dimension(size(push)) :: pushes, may_push
        integer :: i, k, next, step

        push = 0
        x = 0
        pushes = .false.
        mass = 0
        do i = 1, size(push)
            if (response(i, i) > 0) mass(i) = 1/sqrt(response(i, i))
        end do
        may_push = mass > 0
        b = apart*mass
        do i = 1, size(push)
            matrix(:, i) = response(:, i)*mass*mass(i)
        end do
        do step = 1, 10*size(push)
            left = b + matmul(matrix, x)
            next = minloc(left, dim=1, mask=may_push .and. .not. pushes)
            if (next == 0) exit
            if (.not. left(next) < -slack*maxval(abs(b))) exit
            pushes(next) = .true.
            do
                call balance(trial, 1.0e-13_wp)
                if (.not. any(pushes .and. .not. trial > 0)) exit
                way = 1
                k = next
                do i = 1, size(push)
                    if (.not. pushes(i) .or. trial(i) > 0) cycle
                    if (x(i) > way*(x(i) - trial(i))) cycle
                    way = x(i)/max(x(i) - trial(i), tiny(way))
                    k = i
                end do
                ! Rounding alone has it closing.
                if (k == next .and. .not. x(next) > 0) may_push(next) = .false.
                x = x + way*(trial - x)
                x(k) = 0
                pushes(k) = .false.
                where (.not. pushes) x = 0
                if (.not. any(pushes)) exit
            end do
            if (any(pushes)) x = trial
        end do
        if (any(pushes)) then
            call balance(trial, 0.0_wp)
            if (.not. any(pushes .and. .not. trial > 0)) x = trial
        end if
        push = x*mass

    contains

        !> All that push keep their contacts as they are. Of contacts that move alike the one that wants most has its way.
        pure subroutine balance(trial, ridge)
            real(wp), intent(out) :: trial(:)
            real(wp), intent(in) :: ridge              !! of the diagonal; 0: none pushes that others hold already
            real(wp), allocatable :: part(:, :), rest(:)
            integer, allocatable :: chosen(:)
            integer :: i

            chosen = pack([(i, i=1, size(trial))], pushes)
            part = matrix(chosen, chosen)
            do i = 1, size(chosen)
                part(i, i) = part(i, i)*(1 + ridge)
            end do
            rest = -b(chosen)
            call eliminate(part, rest, max(ridge/10, merge(least, 0.0_wp, ridge <= 0)))
            trial = 0
            trial(chosen) = rest
        end subroutine balance
    end subroutine solve_complementary

    !> Gauss with pivots from the diagonal: the matrix is symmetric and not negative. Contacts that others hold already have
    !> no pivot left.
    pure subroutine eliminate(matrix, x, least_pivot)
        real(wp), intent(inout) :: matrix(:, :), x(:)
        real(wp), intent(in) :: least_pivot            !! over what was on the diagonal
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
            if (.not. matrix(k, k) > least_pivot*before(k)) then
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
