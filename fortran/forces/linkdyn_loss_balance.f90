!> What transmissions lose, where what each of them transmits is linear in what all of them lose: one sample, in closed form.
!>
!> Of n motors p_i is transmitted in the direction of the motion, and r_i lost of it,
!>
!>     p = p0 + S r,    r_i = c_i |p_i|,    c_i = a_i where p_i > 0 (the motor drives),  b_i where p_i < 0 (the load does),
!>
!> linear once the sides are known on which the powers are. S = I W - 1 with the rotors' inertias I at their joints, a diagonal
!> matrix, and W, symmetric, by which the joints yield to forces: no force moves rotors alone more than its own does, so that
!> I^(1/2) W I^(1/2) has no eigenvalue beyond one, and -S is similar to a symmetric matrix H of which none lies outside 0 and 1. So
!> the determinant of 1 - S diag(d) is above zero for all d with d_i > -1: where no transmission locks itself (b_i < 1), there is
!> one solution and no other. Where some do there is as long as 1 - H^(1/2) diag(b) H^(1/2) is positive definite: as long as
!> elimination, with all loads driving, meets positive pivots. Beyond that forces may have several solutions or none, and whoever
!> asks has to ask how they grow.
!>
!> The sides are found by the rule of the least number: if one of the p_i is not on its side, the first such changes it. Where all
!> determinants are above zero that comes to an end (K. G. Murty, 1974), after a round or two.
module linkdyn_loss_balance
    use linkdyn_kinds, only: wp
    implicit none (type, external)
    private
    public :: balance_losses, lossy_samples, renew_losses

    !> Less than this is lost of digits where pivots are positive.
    real(wp), parameter :: least_pivot = 1e-4_wp

    !> Samples of motors whose torques are given and whose transmissions lose some of them.
    type :: lossy_samples
        integer, allocatable :: actuator(:)            !! (motor)
        real(wp), allocatable :: given(:, :)           !! what motors give at their joints [N, N m] (motor, sample)
        real(wp), allocatable :: sense(:, :)           !! which way the joint variable goes: +1, -1 (motor, sample)
        real(wp), allocatable :: driving(:, :), driven(:, :)   !! a, b (motor, sample)
        real(wp), allocatable :: lost(:, :)            !! r (motor, sample) [N, N m]
    contains
        procedure :: efforts
    end type lossy_samples

contains

    !> Driving forces that are left of a sample's.
    pure function efforts(self, sample) result(effort)
        class(lossy_samples), intent(in) :: self
        integer, intent(in) :: sample
        real(wp) :: effort(size(self%actuator))

        effort = self%given(:, sample) - self%sense(:, sample)*self%lost(:, sample)
    end function efforts

    !> What is lost of a sample, from what has been transmitted while other amounts were: in exchange for these.
    pure subroutine renew_losses(transmitted, slope, sample, lossy, is_unique, change)
        real(wp), intent(in) :: transmitted(:)         !! along the joint variables [N, N m] (motor)
        real(wp), intent(in) :: slope(:, :)            !! how it changes with driving forces (motor, of motor)
        integer, intent(in) :: sample
        type(lossy_samples), intent(inout) :: lossy
        logical, intent(out) :: is_unique              !! false: it may not be the only solution
        real(wp), intent(out) :: change                !! of what is lost, relative to the largest
        real(wp), dimension(size(transmitted)) :: press, before
        real(wp) :: yields(size(transmitted), size(transmitted))
        integer :: k

        associate (sense => lossy%sense(:, sample), lost => lossy%lost(:, sample))
            do k = 1, size(transmitted)
                yields(:, k) = -sense*sense(k)*slope(:, k)
            end do
            press = sense*transmitted - matmul(yields, lost)
            before = lost
            call balance_losses(size(transmitted), press, yields, lossy%driving(:, sample), lossy%driven(:, sample), lost, &
                                is_unique)
            change = maxval(abs(lost - before))/max(maxval(lost), tiny(1.0_wp))
        end associate
    end subroutine renew_losses

    !> What is lost.
    pure subroutine balance_losses(n, press, slope, driving, driven, lost, is_unique)
        integer, intent(in) :: n                       !! transmissions
        real(wp), intent(in) :: press(n)               !! p0 [N, N m]
        real(wp), intent(in) :: slope(n, n)            !! S
        real(wp), intent(in) :: driving(n), driven(n)  !! a, b
        real(wp), intent(out) :: lost(n)               !! r [N, N m]
        logical, intent(out) :: is_unique              !! false: there may be another solution, or none; nothing else is told
        integer, parameter :: most_rounds = 64         !! all sides of six transmissions
        real(wp) :: matrix(n, n), found(n), share(n)
        logical :: drives(n)                           !! the motor, not the load
        integer :: i, round

        lost = 0
        is_unique = .true.
        if (any(driven >= 1)) then
            call form(driven, spread(.false., 1, n), matrix)
            found = press
            call eliminate(n, matrix, found, is_unique)
            if (.not. is_unique) return
        end if
        drives = press > 0
        do round = 1, most_rounds
            share = merge(driving, driven, drives)
            call form(share, drives, matrix)
            found = press
            call eliminate(n, matrix, found, is_unique)
            if (.not. is_unique) return
            i = first_elsewhere()
            if (i == 0) then
                lost = share*abs(found)
                return
            end if
            drives(i) = .not. drives(i)
        end do
        is_unique = .false.

    contains

        !> 1 - S d, where the sides of the powers make d of the shares.
        pure subroutine form(share, drives, matrix)
            real(wp), intent(in) :: share(n)
            logical, intent(in) :: drives(n)
            real(wp), intent(out) :: matrix(n, n)
            integer :: k

            do k = 1, n
                matrix(:, k) = -slope(:, k)*merge(share(k), -share(k), drives(k))
                matrix(k, k) = matrix(k, k) + 1
            end do
        end subroutine form

        !> The first that is transmitted to the other side than it was taken for, but for rounding; 0: none. What is zero is on
        !> either side.
        pure integer function first_elsewhere() result(i)
            real(wp) :: noise

            noise = 16*epsilon(1.0_wp)*max(maxval(abs(press)), maxval(abs(found)))
            do i = 1, n
                if (merge(found(i) < -noise, found(i) > noise, drives(i))) return
            end do
            i = 0
        end function first_elsewhere
    end subroutine balance_losses

    !> Solve, without pivoting: principal minors are positive.
    pure subroutine eliminate(n, matrix, right, is_positive)
        integer, intent(in) :: n
        real(wp), intent(inout) :: matrix(n, n)
        real(wp), intent(inout) :: right(n)            !! out: the solution
        logical, intent(out) :: is_positive            !! all pivots are; also false for what is no number
        real(wp) :: factor
        integer :: i, k

        is_positive = .true.
        do k = 1, n
            is_positive = is_positive .and. matrix(k, k) > least_pivot
            do i = k + 1, n
                factor = matrix(i, k)/matrix(k, k)
                matrix(i, k + 1:) = matrix(i, k + 1:) - factor*matrix(k, k + 1:)
                right(i) = right(i) - factor*right(k)
            end do
        end do
        do k = n, 1, -1
            right(k) = (right(k) - dot_product(matrix(k, k + 1:), right(k + 1:)))/matrix(k, k)
        end do
    end subroutine eliminate
end module linkdyn_loss_balance
