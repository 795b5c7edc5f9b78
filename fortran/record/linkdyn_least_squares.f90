!> Least squares while tracing: of all x = x0 + N z those with the least x C x, C diagonal.
!>
!> Normal equations (N' C N) z = -N' C x0, by square roots without roots. They square the condition of N; so what is found is
!> corrected once by what it leaves, which makes it as good as an orthogonal decomposition while the squared condition is far from
!> the rounding's reciprocal. Beyond, an alarm is raised.
!>
!> **Source**: A. Björck, Linear Algebra Appl. 88/89 (1987) 31, for the correction.
module linkdyn_least_squares
    use linkdyn_kinds, only: wp
    use linkdyn_value, only: value, zero, is_zero, is_constant, reciprocal, operator(+), operator(-), operator(*)
    implicit none (type, external)
    private
    public :: find_least

    !> Of the square of a column's length, what is left beside the others: less raises the alarm.
    real(wp), parameter :: least_part = 1.0e-6_wp

contains

    !> z, and what is watched of it.
    subroutine find_least(state, weight, start, z, watched, pull)
        type(value), intent(in) :: state(:, :)         !! N (part, state)
        real(wp), intent(in) :: weight(:)              !! C (part)
        type(value), intent(in) :: start(:)            !! x0 (part)
        type(value), intent(out) :: z(:)               !! (state)
        type(value), allocatable, intent(inout) :: watched(:)    !! values whose magnitudes must stay below one
        type(value), intent(in), optional :: pull(:)   !! p: the least of x C x - 2 p z; absent: zero (state)
        type(value) :: lower(size(z), size(z)), inverse(size(z)), more(size(z)), x(size(start))
        integer :: k, i

        if (size(z) == 0) return
        call factorize()
        z = solution(start)
        if (size(z) == 1) return
        x = start
        do k = 1, size(z)
            do i = 1, size(x)
                x(i) = x(i) + state(i, k)*z(k)
            end do
        end do
        more = solution(x)
        z = z + more

    contains

        !> N' C N = L D L'
        subroutine factorize()
            type(value) :: diagonal(size(z)), entry
            integer :: k, i, j

            do k = 1, size(z)
                do i = k, size(z)
                    entry = product_of(state(:, i), state(:, k))
                    if (i == k) diagonal(k) = entry
                    do j = 1, k - 1
                        entry = entry - lower(i, j)*(lower(k, j)*diagonal(j))
                    end do
                    if (i == k) then
                        inverse(k) = reciprocal(entry)
                        ! watched where it is the difference of what varies
                        if (k > 1 .and. .not. is_constant(entry)) &
                            watched = [watched, least_part*(diagonal(k)*inverse(k))]
                        diagonal(k) = entry
                    else
                        lower(i, k) = entry*inverse(k)
                    end if
                end do
            end do
        end subroutine factorize

        !> -(N' C N)^-1 (N' C x - p)
        function solution(x) result(z)
            type(value), intent(in) :: x(:)            !! (part)
            type(value) :: z(size(inverse))
            integer :: k, j

            do k = 1, size(z)
                z(k) = -product_of(state(:, k), x)
                if (present(pull)) z(k) = z(k) + pull(k)
                do j = 1, k - 1
                    z(k) = z(k) - lower(k, j)*z(j)
                end do
            end do
            do k = 1, size(z)
                z(k) = z(k)*inverse(k)
            end do
            do k = size(z) - 1, 1, -1
                do j = k + 1, size(z)
                    z(k) = z(k) - lower(j, k)*z(j)
                end do
            end do
        end function solution

        !> a' C b. Parts of one weight are weighted together.
        function product_of(a, b) result(total)
            type(value), intent(in) :: a(:), b(:)      !! (part)
            type(value) :: total, part
            logical :: is_done(size(a))
            integer :: i, k

            total = zero()
            is_done = weight <= 0                      ! bounded below by zero: no part of the sum
            do i = 1, size(a)
                if (is_done(i)) cycle
                part = zero()
                do k = i, size(a)
                    if (is_done(k) .or. abs(weight(k) - weight(i)) > 0) cycle
                    is_done(k) = .true.
                    if (.not. (is_zero(a(k)) .or. is_zero(b(k)))) part = part + a(k)*b(k)
                end do
                total = total + weight(i)*part
            end do
        end function product_of
    end subroutine find_least
end module linkdyn_least_squares
