!> What is left of many samples: extremes with their places, sums, histograms, counts.
!>
!> Samples of a chunk are reduced one after the other on lanes, lanes are joined in order, chunks are joined in order,
!> so totals are the same bits whoever computed the chunks.
module linkdyn_sweep_totals
    use, intrinsic :: iso_fortran_env, only: int64
    use linkdyn_exact_sum, only: add_exactly
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_status, only: n_sample_status
    implicit none (type, external)
    private
    public :: totals_type, totals_shape, lane_totals, bins_type, empty_totals, start_lanes, reduce_lanes, count_lanes
    public :: join_lanes, join_totals, pack_totals, unpack_totals, packed_size, watch_lanes
    public :: code_feasible, code_no_model, n_fixed_code, first_bound

    integer, parameter :: code_feasible = 0                    !! then the codes of failed samples
    integer, parameter :: code_no_model = n_sample_status      !! the design is no mechanism
    integer, parameter :: n_fixed_code = n_sample_status + 1
    integer, parameter :: first_bound = n_fixed_code           !! code of bound 1

    !> How much there is to reduce.
    type :: totals_shape
        integer :: n_entry = 0
        integer :: n_code = n_fixed_code
        integer :: n_bin = 0
        integer, allocatable :: histogram_of(:)                !! entries with a histogram
        integer, allocatable :: power(:)                       !! entries whose positive part is summed, too
        logical :: has_moments = .true.
        integer :: determinant = 0                             !! entry whose sign is watched; 0: none
    end type totals_shape

    !> Bins of the histograms: one below, n_bin, one above.
    type :: bins_type
        real(wp), allocatable :: from(:), to(:)                !! (n_histogram)
    end type bins_type

    type :: totals_type
        integer(int64) :: n_sample = 0, n_reduced = 0
        integer(int64), allocatable :: n_code(:)               !! (0:n_code-1)
        real(wp), allocatable :: low(:), high(:)               !! (n_entry)
        integer(int64), allocatable :: low_at(:), high_at(:)   !! sample, from 0; -1: none
        real(wp), allocatable :: sum(:), sum_rest(:)           !! with what rounding left behind
        real(wp), allocatable :: square(:), square_rest(:)
        real(wp), allocatable :: gain(:), gain_rest(:)         !! (n_power) of positive parts
        integer(int64), allocatable :: histogram(:, :)         !! (0:n_bin+1, n_histogram)
        integer(int64) :: n_crossing = 0, first_crossing = -1  !! changes of sign; second sample of the first one
        real(wp) :: first_sign = 0, last_sign = 0              !! of the first line's first, of the last line's last sample
        integer(int64) :: first_sign_at = -1                   !! that count; 0: there is none
        integer(int64) :: first_sample = 0                     !! number of the first one
    end type totals_type

    !> The same for one chunk, on lanes.
    type :: lane_totals
        integer(int64) :: n_sample = 0
        integer(int64), allocatable :: n_code(:)
        real(wp), allocatable :: low(:, :), high(:, :)         !! (lane, n_entry)
        real(wp), allocatable :: low_at(:, :), high_at(:, :)   !! number of the block
        real(wp), allocatable :: sum(:, :), square(:, :)       !! (lane, n_entry)
        real(wp), allocatable :: gain(:, :)                    !! (lane, n_power)
        real(wp) :: n_reduced(lanes) = 0
        integer(int64), allocatable :: histogram(:, :)
        integer(int64) :: n_crossing = 0, first_crossing = -1
        real(wp) :: first_sign = 0, last_sign = 0
        integer(int64) :: first_sign_at = -1, n_watched = 0
        logical :: is_broken = .false.                         !! a new line began behind the first sample
    end type lane_totals

contains

    !> Totals of nothing.
    subroutine empty_totals(shape, totals)
        type(totals_shape), intent(in) :: shape
        type(totals_type), intent(out) :: totals
        integer :: n, n_power

        n = shape%n_entry
        n_power = size(shape%power)
        allocate (totals%n_code(0:shape%n_code - 1), source=0_int64)
        allocate (totals%low(n), source=huge(1.0_wp))
        allocate (totals%high(n), source=-huge(1.0_wp))
        allocate (totals%low_at(n), totals%high_at(n), source=-1_int64)
        if (.not. shape%has_moments) n = 0
        allocate (totals%sum(n), totals%sum_rest(n), totals%square(n), totals%square_rest(n), source=0.0_wp)
        allocate (totals%gain(n_power), totals%gain_rest(n_power), source=0.0_wp)
        allocate (totals%histogram(0:shape%n_bin + 1, size(shape%histogram_of)), source=0_int64)
    end subroutine empty_totals

    !> Make room the first time; then forget the last chunk.
    subroutine start_lanes(shape, part)
        type(totals_shape), intent(in) :: shape
        type(lane_totals), intent(inout) :: part
        integer :: n, n_moment

        n = shape%n_entry
        n_moment = merge(n, 0, shape%has_moments)
        if (allocated(part%low)) then
            if (size(part%histogram, 2) /= size(shape%histogram_of)) deallocate (part%low, part%high, part%low_at, &
                part%high_at, part%sum, part%square, part%gain, part%n_code, part%histogram)
        end if
        if (.not. allocated(part%low)) then
            allocate (part%low(lanes, n), part%high(lanes, n), part%low_at(lanes, n), part%high_at(lanes, n))
            allocate (part%sum(lanes, n_moment), part%square(lanes, n_moment), part%gain(lanes, size(shape%power)))
            allocate (part%n_code(0:shape%n_code - 1), part%histogram(0:shape%n_bin + 1, size(shape%histogram_of)))
        end if
        part%n_sample = 0
        part%n_code = 0
        part%low = huge(1.0_wp)
        part%high = -huge(1.0_wp)
        part%low_at = -1
        part%high_at = -1
        part%sum = 0
        part%square = 0
        part%gain = 0
        part%n_reduced = 0
        part%histogram = 0
        part%n_crossing = 0
        part%first_crossing = -1
        part%first_sign = 0
        part%last_sign = 0
        part%first_sign_at = -1
        part%n_watched = 0
        part%is_broken = .false.
    end subroutine start_lanes

    !> Take the values of one block in. Where a lane is not to be counted its values are NaN.
    subroutine reduce_lanes(shape, bins, value, counts, block, part)
        type(totals_shape), intent(in) :: shape
        type(bins_type), intent(in) :: bins
        real(wp), intent(in) :: value(lanes, shape%n_entry)
        logical, intent(in) :: counts(lanes)
        integer, intent(in) :: block               !! of the chunk, from 0
        type(lane_totals), intent(inout) :: part
        integer :: i

        call raise_extremes(shape%n_entry, value, real(block, wp), part%low, part%low_at, part%high, part%high_at)
        part%n_reduced = part%n_reduced + merge(1.0_wp, 0.0_wp, counts)
        if (shape%has_moments) then
            if (all(counts)) then
                call add_moments(shape%n_entry, value, part%sum, part%square)
            else
                call add_some_moments(shape%n_entry, value, counts, part%sum, part%square)
            end if
        end if
        do i = 1, size(shape%power)
            part%gain(:, i) = part%gain(:, i) + merge(max(value(:, shape%power(i)), 0.0_wp), 0.0_wp, counts)
        end do
        do i = 1, size(shape%histogram_of)
            call add_to_bins(shape%n_bin, bins%from(i), bins%to(i), value(:, shape%histogram_of(i)), counts, part%histogram(:, i))
        end do
    end subroutine reduce_lanes

    !> Written so that a NaN changes nothing, and without branches.
    pure subroutine raise_extremes(n, value, block, low, low_at, high, high_at)
        integer, intent(in) :: n
        real(wp), intent(in) :: value(lanes, n), block
        real(wp), intent(inout), dimension(lanes, n) :: low, low_at, high, high_at
        integer :: k, l

        do k = 1, n
            do l = 1, lanes
                low_at(l, k) = merge(block, low_at(l, k), value(l, k) < low(l, k))
                low(l, k) = merge(value(l, k), low(l, k), value(l, k) < low(l, k))
                high_at(l, k) = merge(block, high_at(l, k), value(l, k) > high(l, k))
                high(l, k) = merge(value(l, k), high(l, k), value(l, k) > high(l, k))
            end do
        end do
    end subroutine raise_extremes

    pure subroutine add_moments(n, value, sum, square)
        integer, intent(in) :: n
        real(wp), intent(in) :: value(lanes, n)
        real(wp), intent(inout), dimension(lanes, n) :: sum, square

        sum = sum + value
        square = square + value**2
    end subroutine add_moments

    pure subroutine add_some_moments(n, value, counts, sum, square)
        integer, intent(in) :: n
        real(wp), intent(in) :: value(lanes, n)
        logical, intent(in) :: counts(lanes)
        real(wp), intent(inout), dimension(lanes, n) :: sum, square
        integer :: k

        do k = 1, n
            sum(:, k) = sum(:, k) + merge(value(:, k), 0.0_wp, counts)
            square(:, k) = square(:, k) + merge(value(:, k)**2, 0.0_wp, counts)
        end do
    end subroutine add_some_moments

    pure subroutine add_to_bins(n_bin, from, to, value, counts, histogram)
        integer, intent(in) :: n_bin
        real(wp), intent(in) :: from, to, value(lanes)
        logical, intent(in) :: counts(lanes)
        integer(int64), intent(inout) :: histogram(0:n_bin + 1)
        real(wp) :: place
        integer :: l, bin

        do l = 1, lanes
            if (.not. counts(l)) cycle
            place = (value(l) - from)*(n_bin/(to - from))
            bin = 0
            if (place >= 0) bin = 1 + int(min(place, real(n_bin, wp)))
            if (value(l) == to) bin = n_bin         ! the last bin holds its upper end
            histogram(bin) = histogram(bin) + 1
        end do
    end subroutine add_to_bins

    !> Count the outcomes of a block.
    subroutine count_lanes(code, n, part)
        integer, intent(in) :: code(lanes)
        integer, intent(in) :: n                   !! samples in the block
        type(lane_totals), intent(inout) :: part
        integer :: l

        part%n_sample = part%n_sample + n
        if (all(code == code_feasible)) then
            part%n_code(code_feasible) = part%n_code(code_feasible) + n
        else
            do l = 1, n
                part%n_code(code(l)) = part%n_code(code(l)) + 1
            end do
        end if
    end subroutine count_lanes

    !> Changes of sign from one sample that counts to the next along a line: a singularity lies between.
    subroutine watch_lanes(determinant, n, first, n_line, part)
        real(wp), intent(in) :: determinant(lanes) !! NaN where the sample does not count
        integer, intent(in) :: n                   !! samples in the block
        integer(int64), intent(in) :: first        !! number of its first sample
        integer(int64), intent(in) :: n_line       !! samples of a line
        type(lane_totals), intent(inout) :: part
        integer(int64) :: sample
        real(wp) :: sign_here
        integer :: l

        do l = 1, n
            sample = first + l - 1
            if (modulo(sample, n_line) == 0) then
                part%last_sign = 0
                part%is_broken = part%is_broken .or. part%n_watched > 0
            end if
            part%n_watched = part%n_watched + 1
            if (.not. abs(determinant(l)) > 0) cycle
            sign_here = sign(1.0_wp, determinant(l))
            if (part%last_sign*sign_here < 0) then
                part%n_crossing = part%n_crossing + 1
                if (part%first_crossing < 0) part%first_crossing = sample
            end if
            if (part%first_sign == 0 .and. .not. part%is_broken) then
                part%first_sign = sign_here
                part%first_sign_at = sample
            end if
            part%last_sign = sign_here
        end do
    end subroutine watch_lanes

    !> A chunk's totals from its lanes.
    subroutine join_lanes(shape, part, first, totals)
        type(totals_shape), intent(in) :: shape
        type(lane_totals), intent(in) :: part
        integer(int64), intent(in) :: first        !! number of the chunk's first sample
        type(totals_type), intent(out) :: totals
        integer :: k, l

        call empty_totals(shape, totals)
        totals%n_sample = part%n_sample
        totals%n_reduced = nint(sum(part%n_reduced), int64)
        totals%n_code = part%n_code
        totals%histogram = part%histogram
        totals%n_crossing = part%n_crossing
        totals%first_crossing = part%first_crossing
        totals%first_sign = part%first_sign
        totals%last_sign = part%last_sign
        totals%first_sign_at = part%first_sign_at
        totals%first_sample = first
        do k = 1, shape%n_entry
            do l = 1, lanes
                call take_lower(part%low(l, k), place(part%low_at(l, k)), totals%low(k), totals%low_at(k))
                call take_higher(part%high(l, k), place(part%high_at(l, k)), totals%high(k), totals%high_at(k))
            end do
        end do
        do l = 1, lanes
            totals%sum = totals%sum + part%sum(l, :)
            totals%square = totals%square + part%square(l, :)
            totals%gain = totals%gain + part%gain(l, :)
        end do

    contains

        pure integer(int64) function place(block)
            real(wp), intent(in) :: block

            place = -1
            if (block >= 0) place = first + int(block, int64)*lanes + l - 1
        end function place
    end subroutine join_lanes

    !> The lower of two, of equal ones the first sample.
    pure subroutine take_lower(value, at, low, low_at)
        real(wp), intent(in) :: value
        integer(int64), intent(in) :: at
        real(wp), intent(inout) :: low
        integer(int64), intent(inout) :: low_at

        if (at < 0) return
        if (low_at >= 0 .and. (value > low .or. (value == low .and. at > low_at))) return
        low = value
        low_at = at
    end subroutine take_lower

    pure subroutine take_higher(value, at, high, high_at)
        real(wp), intent(in) :: value
        integer(int64), intent(in) :: at
        real(wp), intent(inout) :: high
        integer(int64), intent(inout) :: high_at

        if (at < 0) return
        if (high_at >= 0 .and. (value < high .or. (value == high .and. at > high_at))) return
        high = value
        high_at = at
    end subroutine take_higher

    !> Join the totals of the samples that follow.
    subroutine join_totals(next, n_line, totals)
        type(totals_type), intent(in) :: next
        integer(int64), intent(in) :: n_line
        type(totals_type), intent(inout) :: totals
        integer :: k

        if (next%n_sample == 0) return
        if (totals%n_sample == 0) totals%first_sample = next%first_sample
        if (n_line > 0) call join_lines(next, n_line, totals)
        if (totals%first_crossing < 0) totals%first_crossing = next%first_crossing
        totals%n_crossing = totals%n_crossing + next%n_crossing
        totals%n_sample = totals%n_sample + next%n_sample
        totals%n_reduced = totals%n_reduced + next%n_reduced
        totals%n_code = totals%n_code + next%n_code
        totals%histogram = totals%histogram + next%histogram
        do k = 1, size(totals%low)
            call take_lower(next%low(k), next%low_at(k), totals%low(k), totals%low_at(k))
            call take_higher(next%high(k), next%high_at(k), totals%high(k), totals%high_at(k))
        end do
        call add_exactly(next%sum, totals%sum, totals%sum_rest)
        call add_exactly(next%square, totals%square, totals%square_rest)
        call add_exactly(next%gain, totals%gain, totals%gain_rest)
    end subroutine join_totals

    !> A line that runs on from one part into the next.
    subroutine join_lines(next, n_line, totals)
        type(totals_type), intent(in) :: next
        integer(int64), intent(in) :: n_line
        type(totals_type), intent(inout) :: totals
        integer(int64) :: line_before, line_after

        line_before = (next%first_sample - 1)/n_line
        line_after = (next%first_sample + next%n_sample - 1)/n_line
        if (modulo(next%first_sample, n_line) == 0) totals%last_sign = 0
        if (totals%last_sign*next%first_sign < 0) then
            totals%n_crossing = totals%n_crossing + 1
            if (totals%first_crossing < 0) totals%first_crossing = next%first_sign_at
        end if
        if (line_after /= line_before .or. abs(next%last_sign) > 0) totals%last_sign = next%last_sign
    end subroutine join_lines

    ! ---------------------------------------------------------------- as plain arrays, for files and messages

    pure subroutine packed_size(shape, n_real, n_integer)
        type(totals_shape), intent(in) :: shape
        integer, intent(out) :: n_real, n_integer

        n_real = 2*shape%n_entry + merge(4*shape%n_entry, 0, shape%has_moments) + 2*size(shape%power) + 2
        n_integer = 6 + shape%n_code + 2*shape%n_entry + (shape%n_bin + 2)*size(shape%histogram_of)
    end subroutine packed_size

    subroutine pack_totals(totals, reals, integers)
        type(totals_type), intent(in) :: totals
        real(wp), intent(out) :: reals(:)
        integer(int64), intent(out) :: integers(:)

        reals = [totals%first_sign, totals%last_sign, totals%low, totals%high, totals%sum, totals%sum_rest, totals%square, &
                 totals%square_rest, totals%gain, totals%gain_rest]
        integers = [totals%n_sample, totals%n_reduced, totals%n_crossing, totals%first_crossing, totals%first_sample, &
                    totals%first_sign_at, totals%n_code, totals%low_at, totals%high_at, &
                    reshape(totals%histogram, [size(totals%histogram)])]
    end subroutine pack_totals

    subroutine unpack_totals(shape, reals, integers, totals)
        type(totals_shape), intent(in) :: shape
        real(wp), intent(in) :: reals(:)
        integer(int64), intent(in) :: integers(:)
        type(totals_type), intent(out) :: totals
        integer :: r, i

        call empty_totals(shape, totals)
        totals%first_sign = reals(1)
        totals%last_sign = reals(2)
        r = 2
        call take_reals(totals%low)
        call take_reals(totals%high)
        call take_reals(totals%sum)
        call take_reals(totals%sum_rest)
        call take_reals(totals%square)
        call take_reals(totals%square_rest)
        call take_reals(totals%gain)
        call take_reals(totals%gain_rest)
        totals%n_sample = integers(1)
        totals%n_reduced = integers(2)
        totals%n_crossing = integers(3)
        totals%first_crossing = integers(4)
        totals%first_sample = integers(5)
        totals%first_sign_at = integers(6)
        i = 6
        call take_integers(totals%n_code)
        call take_integers(totals%low_at)
        call take_integers(totals%high_at)
        totals%histogram = reshape(integers(i + 1:), [size(totals%histogram, 1), size(totals%histogram, 2)])

    contains

        subroutine take_reals(values)
            real(wp), intent(inout) :: values(:)

            values = reals(r + 1:r + size(values))
            r = r + size(values)
        end subroutine take_reals

        subroutine take_integers(values)
            integer(int64), intent(inout) :: values(:)

            values = integers(i + 1:i + size(values))
            i = i + size(values)
        end subroutine take_integers
    end subroutine unpack_totals
end module linkdyn_sweep_totals
