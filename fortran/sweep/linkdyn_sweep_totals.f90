!> What is left of many samples: extremes with their places, sums, histograms, counts.
!>
!> Samples are reduced batch by batch, batches of a chunk are joined in order, chunks are joined in order, so totals are the
!> same bits whoever computed the chunks.
module linkdyn_sweep_totals
    use, intrinsic :: iso_fortran_env, only: int64
    use linkdyn_exact_sum, only: add_exactly
    use linkdyn_kinds, only: wp
    use linkdyn_status, only: n_sample_status, sample_status_name
    use linkdyn_value_rows, only: raise_extremes, add_moments, at_once
    implicit none (type, external)
    private
    public :: totals_type, totals_shape, bins_type, empty_totals, reduce_samples, join_totals
    public :: pack_totals, unpack_totals, packed_size
    public :: code_feasible, code_no_model, n_fixed_code, first_bound, fixed_outcome

    integer, parameter :: code_feasible = 0                    !! then the codes of failed samples
    integer, parameter :: code_no_model = n_sample_status      !! the design is no mechanism
    integer, parameter :: n_fixed_code = n_sample_status + 1
    integer, parameter :: first_bound = n_fixed_code           !! code of bound 1
    character(len=13), parameter :: fixed_outcome(0:n_fixed_code - 1) = &
        [character(len=13) :: "feasible", sample_status_name(1:), "no_model"]

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

    !> The totals of some samples that follow each other, of one design.
    subroutine reduce_samples(shape, bins, n, value, code, counts, first, n_line, totals)
        type(totals_shape), intent(in) :: shape
        type(bins_type), intent(in) :: bins
        integer, intent(in) :: n                   !! samples
        real(wp), intent(in), contiguous :: value(:, :)    !! (n_entry, sample)
        integer, intent(in) :: code(:)             !! (sample) the outcome
        logical, intent(in) :: counts(:)           !! (sample) false: it is counted, but not reduced
        integer(int64), intent(in) :: first        !! number of the first sample
        integer(int64), intent(in) :: n_line       !! samples of a line; 0: there are no lines
        type(totals_type), intent(out) :: totals
        real(wp), dimension(shape%n_entry) :: low_at, high_at
        integer :: s, i, n_here

        call empty_totals(shape, totals)
        totals%n_sample = n
        totals%first_sample = first
        low_at = -1
        high_at = -1
        s = 1
        do while (s <= n)
            n_here = 1
            if (s + at_once - 1 <= n) then
                if (all(counts(s:s + at_once - 1))) n_here = at_once
            end if
            if (counts(s)) then
                call raise_extremes(shape%n_entry, n_here, value(:, s:s + n_here - 1), real(s - 1, wp), totals%low, low_at, &
                                    totals%high, high_at)
                if (shape%has_moments) &
                    call add_moments(shape%n_entry, n_here, value(:, s:s + n_here - 1), totals%sum, totals%square)
            end if
            s = s + n_here
        end do
        call count_outcomes(code, counts, totals%n_code, totals%n_reduced)
        do i = 1, size(shape%power)
            do s = 1, n
                if (counts(s)) totals%gain(i) = totals%gain(i) + max(value(shape%power(i), s), 0.0_wp)
            end do
        end do
        do i = 1, size(shape%histogram_of)
            do s = 1, n
                if (counts(s)) &
                    call add_to_bins(shape%n_bin, bins%from(i), bins%to(i), value(shape%histogram_of(i), s), totals%histogram(:, i))
            end do
        end do
        totals%low_at = merge(first + int(low_at, int64), -1_int64, low_at >= 0)
        totals%high_at = merge(first + int(high_at, int64), -1_int64, high_at >= 0)
        if (shape%determinant > 0 .and. n_line > 0) &
            call watch_sign(value(shape%determinant, :n), counts(:n), first, n_line, totals)
    end subroutine reduce_samples

    !> How many samples have come out how, and how many are reduced: mostly all.
    pure subroutine count_outcomes(code, counts, n_code, n_reduced)
        integer, intent(in) :: code(:)
        logical, intent(in) :: counts(:)
        integer(int64), intent(inout) :: n_code(0:)        !! by outcome
        integer(int64), intent(inout) :: n_reduced
        integer :: s

        n_reduced = n_reduced + count(counts)
        if (all(code == code_feasible)) then
            n_code(code_feasible) = n_code(code_feasible) + size(code)
            return
        end if
        do s = 1, size(code)
            n_code(code(s)) = n_code(code(s)) + 1
        end do
    end subroutine count_outcomes

    pure subroutine add_to_bins(n_bin, from, to, value, histogram)
        integer, intent(in) :: n_bin
        real(wp), intent(in) :: from, to, value
        integer(int64), intent(inout) :: histogram(0:n_bin + 1)
        real(wp) :: place
        integer :: bin

        place = (value - from)*(n_bin/(to - from))
        bin = 0
        if (place >= 0) bin = 1 + int(min(place, real(n_bin, wp)))
        if (value == to) bin = n_bin                ! the last bin holds its upper end
        histogram(bin) = histogram(bin) + 1
    end subroutine add_to_bins

    !> Changes of sign from one sample that counts to the next along a line: a singularity lies between.
    subroutine watch_sign(determinant, counts, first, n_line, totals)
        real(wp), intent(in) :: determinant(:)     !! (sample)
        logical, intent(in) :: counts(:)           !! (sample)
        integer(int64), intent(in) :: first        !! number of the first sample
        integer(int64), intent(in) :: n_line       !! samples of a line
        type(totals_type), intent(inout) :: totals
        integer(int64) :: sample
        real(wp) :: sign_here
        logical :: is_first_line
        integer :: s

        is_first_line = .true.
        do s = 1, size(determinant)
            sample = first + s - 1
            if (modulo(sample, n_line) == 0) then
                totals%last_sign = 0
                is_first_line = s == 1
            end if
            if (.not. (counts(s) .and. abs(determinant(s)) > 0)) cycle
            sign_here = sign(1.0_wp, determinant(s))
            if (totals%last_sign*sign_here < 0) then
                totals%n_crossing = totals%n_crossing + 1
                if (totals%first_crossing < 0) totals%first_crossing = sample
            end if
            if (totals%first_sign == 0 .and. is_first_line) then
                totals%first_sign = sign_here
                totals%first_sign_at = sample
            end if
            totals%last_sign = sign_here
        end do
    end subroutine watch_sign

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
        call add_exactly(next%sum_rest, totals%sum, totals%sum_rest)
        call add_exactly(next%square, totals%square, totals%square_rest)
        call add_exactly(next%square_rest, totals%square, totals%square_rest)
        call add_exactly(next%gain, totals%gain, totals%gain_rest)
        call add_exactly(next%gain_rest, totals%gain, totals%gain_rest)
    end subroutine join_totals

    !> A line that runs on from one part into the next.
    subroutine join_lines(next, n_line, totals)
        type(totals_type), intent(in) :: next
        integer(int64), intent(in) :: n_line
        type(totals_type), intent(inout) :: totals
        integer(int64) :: line_before, line_after

        line_before = (next%first_sample - 1)/n_line
        line_after = (next%first_sample + next%n_sample - 1)/n_line
        if (.not. abs(totals%first_sign) > 0 .and. next%first_sample/n_line == totals%first_sample/n_line) then
            totals%first_sign = next%first_sign
            totals%first_sign_at = next%first_sign_at
        end if
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

    !> The totals that these numbers of a checkpoint were.
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
