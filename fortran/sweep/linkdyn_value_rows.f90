!> Loops over the values of many samples, a row of entries each, written so that a compiler takes entries side by side.
module linkdyn_value_rows
    use linkdyn_kinds, only: wp
    implicit none (type, external)
    private
    public :: copy_rows, multiply_rows, take_lengths, widen_rows, raise_extremes, add_moments, at_once

    integer, parameter :: at_once = 4            !! samples that go into one store of what is reduced

contains

    !> Rows to where samples have them.
    pure subroutine copy_rows(m, n, from, which, n_entry, first, value)
        integer, intent(in) :: m, n                          !! numbers of a row; samples
        real(wp), intent(in) :: from(m, n)
        integer, intent(in) :: which(n)                      !! the samples, in order
        integer, intent(in) :: n_entry
        integer, intent(in) :: first                         !! entries before
        real(wp), intent(inout) :: value(n_entry, *)         !! (entry, sample)
        integer :: s, k

        if (n == 0) return
        if (m == n_entry .and. which(n) == n) then           ! whole rows of all samples, which are in order
            value(:, :n) = from
            return
        end if
        do s = 1, n
            do k = 1, m
                value(first + k, which(s)) = from(k, s)
            end do
        end do
    end subroutine copy_rows

    !> Products of two rows likewise.
    pure subroutine multiply_rows(m, n, from, by, which, n_entry, first, value)
        integer, intent(in) :: m, n
        real(wp), intent(in) :: from(m, n), by(m, n)
        integer, intent(in) :: which(n)
        integer, intent(in) :: n_entry, first
        real(wp), intent(inout) :: value(n_entry, *)
        integer :: s, k

        do s = 1, n
            do k = 1, m
                value(first + k, which(s)) = from(k, s)*by(k, s)
            end do
        end do
    end subroutine multiply_rows

    !> Lengths of vectors that are some of the numbers of each column of a row.
    pure subroutine take_lengths(n_component, m, n, before, n_part, from, which, n_entry, first, value)
        integer, intent(in) :: n_component                   !! numbers of a column
        integer, intent(in) :: m, n                          !! columns of a row; samples
        integer, intent(in) :: before, n_part                !! numbers of a column before the vector's; the vector's
        real(wp), intent(in) :: from(n_component, m, n)
        integer, intent(in) :: which(n)
        integer, intent(in) :: n_entry, first
        real(wp), intent(inout) :: value(n_entry, *)
        integer :: s, k

        do s = 1, n
            select case (n_part)
            case (1)
                do k = 1, m
                    value(first + k, which(s)) = abs(from(before + 1, k, s))
                end do
            case (2)
                do k = 1, m
                    value(first + k, which(s)) = sqrt(from(before + 1, k, s)**2 + from(before + 2, k, s)**2)
                end do
            case default
                do k = 1, m
                    value(first + k, which(s)) = sqrt(from(before + 1, k, s)**2 + from(before + 2, k, s)**2 &
                                                      + from(before + 3, k, s)**2)
                end do
            end select
        end do
    end subroutine take_lengths

    !> The largest sizes of entries, of some samples.
    pure subroutine widen_rows(n_entry, n, value, size_of)
        integer, intent(in) :: n_entry
        integer, intent(in) :: n                             !! samples: `at_once` or one
        real(wp), intent(in) :: value(n_entry, n)
        real(wp), intent(inout) :: size_of(n_entry)          !! (entry)
        integer :: k

        if (n == at_once) then
            do k = 1, n_entry
                size_of(k) = max(size_of(k), max(max(abs(value(k, 1)), abs(value(k, 2))), max(abs(value(k, 3)), abs(value(k, 4)))))
            end do
        else
            do k = 1, n_entry
                size_of(k) = max(size_of(k), abs(value(k, 1)))
            end do
        end if
    end subroutine widen_rows

    !> Extremes and the samples that have them, the first of equal ones. Written by least and largest values: a compiler takes
    !> entries side by side only where nothing is left as it was on a condition.
    pure subroutine raise_extremes(n_entry, n, value, sample, low, low_at, high, high_at)
        integer, intent(in) :: n_entry
        integer, intent(in) :: n                             !! samples, no more than `at_once`
        real(wp), intent(in) :: value(n_entry, n)
        real(wp), intent(in) :: sample                       !! number of the first
        real(wp), intent(inout), dimension(n_entry) :: low, low_at, high, high_at
        real(wp) :: first, most, place
        integer :: k, c(at_once)                             ! columns; of fewer samples the last one stands for the others

        c = [(min(k, n), k=1, at_once)]
        do k = 1, n_entry
            first = min(value(k, 1), value(k, c(2)))
            most = min(first, min(value(k, c(3)), value(k, c(4))))
            place = merge(merge(sample, sample + 1, value(k, 1) <= most), merge(sample + 2, sample + 3, value(k, c(3)) <= most), &
                          first <= most)
            low_at(k) = merge(place, low_at(k), most < low(k))
            low(k) = min(low(k), most)
        end do
        do k = 1, n_entry
            first = max(value(k, 1), value(k, c(2)))
            most = max(first, max(value(k, c(3)), value(k, c(4))))
            place = merge(merge(sample, sample + 1, value(k, 1) >= most), merge(sample + 2, sample + 3, value(k, c(3)) >= most), &
                          first >= most)
            high_at(k) = merge(place, high_at(k), most > high(k))
            high(k) = max(high(k), most)
        end do
    end subroutine raise_extremes

    !> Sums and sums of squares, in the order of the samples.
    pure subroutine add_moments(n_entry, n, value, total, square)
        integer, intent(in) :: n_entry
        integer, intent(in) :: n                             !! samples: `at_once` or one
        real(wp), intent(in) :: value(n_entry, n)
        real(wp), intent(inout), dimension(n_entry) :: total, square
        integer :: k

        if (n == at_once) then
            do k = 1, n_entry
                total(k) = (((total(k) + value(k, 1)) + value(k, 2)) + value(k, 3)) + value(k, 4)
                square(k) = (((square(k) + value(k, 1)**2) + value(k, 2)**2) + value(k, 3)**2) + value(k, 4)**2
            end do
        else
            do k = 1, n_entry
                total(k) = total(k) + value(k, 1)
                square(k) = square(k) + value(k, 1)**2
            end do
        end if
    end subroutine add_moments
end module linkdyn_value_rows
