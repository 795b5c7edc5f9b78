!> Friction that fits the reactions which it changes: one sample, by continuation.
!>
!> Reactions are linear in the friction of the contacts, friction is not in the reactions. Its coefficients grow from zero, where
!> there is none, to what they are; Newton's method follows. As long as the solution goes on smoothly the determinant of the
!> equations stays positive. Where it does not, forces grow beyond all bounds before friction is what it should be: the mechanism
!> holds itself fast.
module linkdyn_friction_balance
    use linkdyn_contact, only: contact_type, n_press, pressing, pressing_slope
    use linkdyn_kinds, only: wp
    implicit none (type, external)
    private
    public :: balance_friction, driven_press

    !> What teeth that drive wheels apart press contacts with: as large as the force along their pitch circles makes it, which is
    !> linear in the friction of the contacts, too.
    type :: driven_press
        integer, allocatable :: contact(:)             !! that feels it (n)
        real(wp), allocatable :: force(:)              !! without friction (n) [N]
        real(wp), allocatable :: slope(:, :)           !! its change with each amount (n, contact)
        real(wp), allocatable :: part(:, :)            !! what is felt for each newton of its size (n_press, n)
    end type driven_press

contains

    !> The amounts of friction at which each is `factor` times the force that presses.
    subroutine balance_friction(contact, factor, press, slope, amount, holding, driven)
        type(contact_type), intent(in) :: contact(:)
        real(wp), intent(in) :: factor(:)              !! (contact) [s/m]
        real(wp), intent(in) :: press(:, :)            !! without friction (n_press, contact) [N]
        real(wp), intent(in) :: slope(:, :, :)         !! its change with each amount (n_press, contact, contact)
        real(wp), intent(out) :: amount(:)             !! (contact) [N s/m]
        integer, intent(out) :: holding                !! the contact that holds the mechanism fast; 0: none does
        type(driven_press), intent(in), optional :: driven     !! beside `press`
        real(wp), parameter :: first_part = 0.25_wp, least_part = 1e-7_wp
        real(wp) :: part, step, tried(size(contact))
        logical :: is_found

        amount = 0
        holding = 0
        part = 0
        step = first_part
        do while (part < 1)
            tried = amount
            call follow(min(1.0_wp, part + step), tried, is_found)
            if (is_found) then
                part = min(1.0_wp, part + step)
                amount = tried
                step = 2*step
            else
                step = step/2
                if (step > least_part) cycle
                holding = most_involved(part + step, amount)
                return
            end if
        end do

    contains

        pure function pressures(amount) result(force)
            real(wp), intent(in) :: amount(:)
            real(wp) :: force(size(contact))
            integer :: i

            do i = 1, size(contact)
                force(i) = pressing(contact(i), felt_by(i, amount))
            end do
        end function pressures

        pure function felt_by(i, amount) result(felt)
            integer, intent(in) :: i                   !! contact
            real(wp), intent(in) :: amount(:)
            real(wp) :: felt(n_press)
            integer :: n

            felt = press(:, i) + matmul(slope(:, i, :), amount)
            if (.not. present(driven)) return
            do n = 1, size(driven%contact)
                if (driven%contact(n) == i) &
                    felt = felt + abs(driven%force(n) + dot_product(driven%slope(n, :), amount))*driven%part(:, n)
            end do
        end function felt_by

        !> What a contact feels changes so with each amount; where a force is zero its size does not.
        pure function felt_slope(i, amount) result(change)
            integer, intent(in) :: i                   !! contact
            real(wp), intent(in) :: amount(:)
            real(wp) :: change(n_press, size(contact)), force
            integer :: n, k

            change = slope(:, i, :)
            if (.not. present(driven)) return
            do n = 1, size(driven%contact)
                if (driven%contact(n) /= i) cycle
                force = driven%force(n) + dot_product(driven%slope(n, :), amount)
                if (.not. abs(force) > 0) cycle
                do k = 1, size(contact)
                    change(:, k) = change(:, k) + sign(driven%slope(n, k), driven%slope(n, k)*force)*driven%part(:, n)
                end do
            end do
        end function felt_slope

        !> What is left of a change of amounts behind what it makes itself by pressing.
        pure function left_over(part, amount) result(matrix)
            real(wp), intent(in) :: part               !! of the coefficients
            real(wp), intent(in) :: amount(:)
            real(wp) :: matrix(size(contact), size(contact)), felt(n_press), grows(n_press, size(contact))
            integer :: i, k

            do i = 1, size(contact)
                felt = pressing_slope(contact(i), felt_by(i, amount))
                grows = felt_slope(i, amount)
                do k = 1, size(contact)
                    matrix(i, k) = merge(1.0_wp, 0.0_wp, i == k) - part*factor(i)*dot_product(felt, grows(:, k))
                end do
            end do
        end function left_over

        !> On whose coefficient it hangs most that nothing is left: the largest product of both null vectors' components, which is
        !> how the eigenvalue that vanishes changes with each coefficient. What is only pressed by the others has no part in it,
        !> however hard.
        pure integer function most_involved(part, amount) result(most)
            real(wp), intent(in) :: part               !! of the coefficients
            real(wp), intent(in) :: amount(:)
            integer, parameter :: n_turn = 4
            real(wp), dimension(size(contact)) :: along, across
            real(wp) :: matrix(size(contact), size(contact))
            logical :: is_upright
            integer :: turn

            along = factor*pressures(amount)
            across = 1
            do turn = 1, n_turn
                matrix = left_over(part, amount)
                call solve(matrix, along, is_upright)
                matrix = transpose(left_over(part, amount))
                call solve(matrix, across, is_upright)
                along = along/maxval(abs(along))
                across = across/maxval(abs(across))
            end do
            most = maxloc(abs(along*across), dim=1)
            if (.not. all(abs(along*across) <= 1)) most = maxloc(merge(pressures(amount), 0.0_wp, factor > 0), dim=1)
        end function most_involved

        !> Newton's method at a part of the coefficients.
        subroutine follow(part, amount, is_found)
            real(wp), intent(in) :: part
            real(wp), intent(inout) :: amount(:)
            logical, intent(out) :: is_found
            integer, parameter :: most = 30
            real(wp), parameter :: enough = 4*epsilon(1.0_wp)
            real(wp) :: matrix(size(contact), size(contact)), before, change
            real(wp), dimension(size(contact)) :: right, force, size_of
            logical :: is_upright
            integer :: n

            is_found = .false.
            before = huge(1.0_wp)
            do n = 1, most
                force = pressures(amount)
                right = part*factor*force - amount
                matrix = left_over(part, amount)
                call solve(matrix, right, is_upright)
                if (.not. all(abs(right) <= huge(1.0_wp))) return
                amount = amount + right
                size_of = max(abs(amount), factor*maxval(force), tiny(1.0_wp))
                change = maxval(abs(right)/size_of)
                is_found = is_upright .and. all(amount >= 0) .and. &
                           (change <= enough .or. (change >= before .and. change <= sqrt(epsilon(1.0_wp))))
                if (is_found) return
                before = change
            end do
        end subroutine follow
    end subroutine balance_friction

    !> Solve linear equations by elimination with pivoting; upright if the determinant is positive.
    pure subroutine solve(matrix, right, is_upright)
        real(wp), intent(inout) :: matrix(:, :)
        real(wp), intent(inout) :: right(:)
        logical, intent(out) :: is_upright
        real(wp) :: row(size(right)), x
        integer :: i, k, p, n

        n = size(right)
        is_upright = .true.
        do k = 1, n
            p = k - 1 + maxloc(abs(matrix(k:, k)), dim=1)
            if (p /= k) then
                row = matrix(k, :)
                matrix(k, :) = matrix(p, :)
                matrix(p, :) = row
                x = right(k)
                right(k) = right(p)
                right(p) = x
                is_upright = .not. is_upright
            end if
            if (.not. matrix(k, k) > 0) is_upright = .not. is_upright
            do i = k + 1, n
                x = matrix(i, k)/matrix(k, k)
                matrix(i, k + 1:) = matrix(i, k + 1:) - x*matrix(k, k + 1:)
                right(i) = right(i) - x*right(k)
            end do
        end do
        do k = n, 1, -1
            right(k) = (right(k) - dot_product(matrix(k, k + 1:), right(k + 1:)))/matrix(k, k)
        end do
    end subroutine solve
end module linkdyn_friction_balance
