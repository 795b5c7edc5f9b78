!> Mean over the samples of a run: the same as Python's (`linkdyn._cycle.averages`), gathered sample by sample and part by part.
!>
!> A sample stands for the time from half-way to the sample before to half-way to the one after; the first and the last for
!> the whole of their one gap. Evenly spaced samples so count alike, and so do those whose instants do not increase: poses
!> without time. A sample that failed stands for none.
module linkdyn_time_mean
    use linkdyn_kinds, only: wp
    implicit none (type, external)
    private
    public :: time_mean, start_mean, add_sample, join_means, mean_of

    !> What is known of samples that follow each other.
    type :: time_mean
        integer :: n = 0                               !! samples
        logical :: increases = .true.                  !! their instants do
        real(wp) :: t_first = 0, t_last = 0            !! [s]
        real(wp) :: first_gap = 0, last_gap = 0        !! between samples; 0: there is one only [s]
        ! ---- a weight of one, which is zero of a sample that failed, then the values (0:n_value)
        real(wp), allocatable :: first(:), last(:)     !! of the first sample and the last one
        real(wp), allocatable :: over_time(:)          !! sum over half the gaps on either side [s]
        real(wp), allocatable :: alike(:)              !! sum over the samples
    end type time_mean

contains

    !> No samples yet.
    pure subroutine start_mean(n_value, mean)
        integer, intent(in) :: n_value
        type(time_mean), intent(out) :: mean

        allocate (mean%first(0:n_value), mean%last(0:n_value), mean%over_time(0:n_value), mean%alike(0:n_value))
        mean%first = 0
        mean%last = 0
        mean%over_time = 0
        mean%alike = 0
    end subroutine start_mean

    !> One more sample, later than all before.
    pure subroutine add_sample(t, is_good, value, mean)
        real(wp), intent(in) :: t                      !! [s]
        logical, intent(in) :: is_good                 !! it has not failed: else its values are not looked at
        real(wp), intent(in) :: value(:)               !! (n_value)
        type(time_mean), intent(inout) :: mean
        real(wp) :: here(0:size(value))

        here = 0
        if (is_good) here = [1.0_wp, value]
        if (mean%n == 0) then
            mean%t_first = t
            mean%first = here
        else
            call pass_gap(t, here, mean)
        end if
        mean%alike = mean%alike + here
        mean%t_last = t
        mean%last = here
        mean%n = mean%n + 1
    end subroutine add_sample

    !> Add later samples to those before.
    pure subroutine join_means(part, whole)
        type(time_mean), intent(in) :: part
        type(time_mean), intent(inout) :: whole

        if (part%n == 0) return
        if (whole%n == 0) then
            whole = part
            return
        end if
        call pass_gap(part%t_first, part%first, whole)
        if (part%n > 1) whole%last_gap = part%last_gap
        whole%increases = whole%increases .and. part%increases
        whole%over_time = whole%over_time + part%over_time
        whole%alike = whole%alike + part%alike
        whole%t_last = part%t_last
        whole%last = part%last
        whole%n = whole%n + part%n
    end subroutine join_means

    !> From the last sample to one that follows: half of the gap is the one's, half the other's.
    pure subroutine pass_gap(t, next, mean)
        real(wp), intent(in) :: t                      !! of the next sample [s]
        real(wp), intent(in) :: next(0:)               !! its weight and values (0:n_value)
        type(time_mean), intent(inout) :: mean

        mean%last_gap = t - mean%t_last
        if (mean%n == 1) mean%first_gap = mean%last_gap
        mean%increases = mean%increases .and. mean%last_gap > 0
        mean%over_time = mean%over_time + mean%last_gap/2*(mean%last + next)
    end subroutine pass_gap

    !> The means of the values; 0 where every sample has failed.
    pure function mean_of(mean) result(value)
        type(time_mean), intent(in) :: mean
        real(wp) :: value(size(mean%alike) - 1)        !! (n_value)
        real(wp) :: total(0:size(mean%alike) - 1)

        total = mean%alike
        if (mean%increases .and. mean%n > 1) total = mean%over_time + (mean%first_gap*mean%first + mean%last_gap*mean%last)/2
        value = 0
        if (total(0) > 0) value = total(1:)/total(0)
    end function mean_of
end module linkdyn_time_mean
