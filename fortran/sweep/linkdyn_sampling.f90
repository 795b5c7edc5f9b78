!> Points of sampled axes, each a function of its number alone, so that any part of a sequence can be computed on any
!> thread or machine, and again after a break.
!>
!> A library's generator of Sobol points walks through its sequence from the start; this one goes to any point at once.
module linkdyn_sampling
    use, intrinsic :: iso_fortran_env, only: int64
    use linkdyn_kinds, only: wp
    use linkdyn_hash, only: counter_bits, counter_uniform
    implicit none (type, external)
    private
    public :: sobol_directions, sobol_point, latin_point, random_point, most_sobol_dimensions

    integer, parameter :: most_sobol_dimensions = 32
    integer, parameter :: n_sobol_bit = 52           !! of a point, and of the numbers of points
    integer, parameter :: most_degree = 7

    ! Primitive polynomials, highest power first, and the first direction numbers of the dimensions from the second on.
    ! **Source**: Joe, Kuo (2008), SIAM J. Sci. Comput. 30:2635, table new-joe-kuo-6.
    integer, parameter :: polynomial(2:most_sobol_dimensions) = [3, 7, 11, 13, 19, 25, 37, 41, 47, 55, 59, 61, 67, 91, &
        97, 103, 109, 115, 131, 137, 143, 145, 157, 167, 171, 185, 191, 193, 203, 211, 213]
    integer, parameter :: first_numbers(most_degree, 2:most_sobol_dimensions) = reshape([ &
        1, 0, 0, 0, 0, 0, 0, &
        1, 3, 0, 0, 0, 0, 0, &
        1, 3, 1, 0, 0, 0, 0, &
        1, 1, 1, 0, 0, 0, 0, &
        1, 1, 3, 3, 0, 0, 0, &
        1, 3, 5, 13, 0, 0, 0, &
        1, 1, 5, 5, 17, 0, 0, &
        1, 1, 5, 5, 5, 0, 0, &
        1, 1, 7, 11, 19, 0, 0, &
        1, 1, 5, 1, 1, 0, 0, &
        1, 1, 1, 3, 11, 0, 0, &
        1, 3, 5, 5, 31, 0, 0, &
        1, 3, 3, 9, 7, 49, 0, &
        1, 1, 1, 15, 21, 21, 0, &
        1, 3, 1, 13, 27, 49, 0, &
        1, 1, 1, 15, 7, 5, 0, &
        1, 3, 1, 15, 13, 25, 0, &
        1, 1, 5, 5, 19, 61, 0, &
        1, 3, 7, 11, 23, 15, 103, &
        1, 3, 7, 13, 13, 15, 69, &
        1, 1, 3, 13, 7, 35, 63, &
        1, 3, 5, 9, 1, 25, 53, &
        1, 3, 1, 13, 9, 35, 107, &
        1, 3, 1, 5, 27, 61, 31, &
        1, 1, 5, 11, 19, 41, 61, &
        1, 3, 5, 3, 3, 13, 69, &
        1, 1, 7, 13, 1, 19, 1, &
        1, 3, 7, 5, 13, 19, 59, &
        1, 1, 3, 9, 25, 29, 41, &
        1, 3, 5, 13, 23, 1, 55, &
        1, 3, 7, 3, 13, 59, 17], [most_degree, most_sobol_dimensions - 1])

contains

    !> Direction numbers of one dimension, as numerators over 2**n_sobol_bit.
    pure function sobol_directions(dimension) result(direction)
        integer, intent(in) :: dimension              !! from 1 to `most_sobol_dimensions`
        integer(int64) :: direction(n_sobol_bit)
        integer(int64) :: m(n_sobol_bit)
        integer :: degree, k, j

        m = 1
        if (dimension > 1) then
            degree = bit_size(0) - 1 - leadz(polynomial(dimension))
            m(:degree) = first_numbers(:degree, dimension)
            do k = degree + 1, n_sobol_bit
                m(k) = ieor(m(k - degree), shiftl(m(k - degree), degree))
                do j = 1, degree - 1
                    if (btest(polynomial(dimension), degree - j)) m(k) = ieor(m(k), shiftl(m(k - j), j))
                end do
            end do
        end if
        do k = 1, n_sobol_bit
            direction(k) = shiftl(m(k), n_sobol_bit - k)
        end do
    end function sobol_directions

    !> Coordinate in [0, 1) of a point of the sequence, in the order of its Gray code as everywhere.
    pure real(wp) function sobol_point(direction, number, shift) result(u)
        integer(int64), intent(in) :: direction(n_sobol_bit)
        integer(int64), intent(in) :: number          !! from 0
        integer(int64), intent(in) :: shift           !! bits by which the whole sequence is moved; 0: not at all
        integer(int64) :: gray, point

        gray = ieor(number, shiftr(number, 1))
        point = iand(shift, maskr(n_sobol_bit, int64))
        do while (gray /= 0)
            point = ieor(point, direction(trailz(gray) + 1))
            gray = iand(gray, gray - 1)
        end do
        u = real(point, wp)*2.0_wp**(-n_sobol_bit)
    end function sobol_point

    !> A point of a Latin hypercube in one dimension: each of the n equal parts of [0, 1) holds one of the n points.
    pure real(wp) function latin_point(seed, dimension, n, number) result(u)
        integer(int64), intent(in) :: seed, n
        integer, intent(in) :: dimension
        integer(int64), intent(in) :: number          !! from 0 to n - 1

        u = (real(permuted(seed, dimension, n, number), wp) &
             + counter_uniform(seed, int(2*dimension, int64), number))/real(n, wp)
    end function latin_point

    !> A random number in [0, 1).
    pure real(wp) function random_point(seed, dimension, number) result(u)
        integer(int64), intent(in) :: seed, number
        integer, intent(in) :: dimension

        u = counter_uniform(seed, int(2*dimension, int64), number)
    end function random_point

    !> Where a random permutation of 0..n-1 takes a number.
    !>
    !> Four rounds of a Feistel network permute all numbers of an even count of bits; a number that leaves 0..n-1 is
    !> permuted on until it is back, which takes less than four goes on average.
    pure integer(int64) function permuted(seed, dimension, n, number) result(image)
        integer(int64), intent(in) :: seed, n, number
        integer, intent(in) :: dimension
        integer(int64) :: left, right, kept, mask
        integer :: n_half, round

        n_half = max(1, int(bit_size(n) - leadz(n - 1) + 1)/2)
        mask = maskr(n_half, int64)
        image = number
        do
            left = shiftr(image, n_half)
            right = iand(image, mask)
            do round = 1, 4
                kept = right
                right = ieor(left, iand(mask, counter_bits(seed, int(2*dimension + 1, int64), 4*right + round)))
                left = kept
            end do
            image = ior(shiftl(left, n_half), right)
            if (image < n) return
        end do
    end function permuted
end module linkdyn_sampling
