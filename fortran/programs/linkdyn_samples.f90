!> Batches of samples: what is given for each, and where its results go.
module linkdyn_samples
    use linkdyn_kinds, only: wp
    use linkdyn_scene_program, only: sample_arrays
    implicit none (type, external)
    private
    public :: sample_arrays, result_target, result_list, most_results, add_target, set_block

    integer, parameter :: most_results = 24

    !> Where the values of one result go.
    type :: result_target
        real(wp), pointer, contiguous :: x(:, :) => null()    !! (values of a sample, sample)
        logical :: is_own = .false.                           !! made for this place
    end type result_target

    !> All results that are wanted of a batch.
    type :: result_list
        integer :: n = 0
        integer :: id(most_results) = 0                       !! each one of `result_*`
        type(result_target) :: of(most_results)
        integer, pointer, contiguous :: status(:) => null()   !! (sample) one of `sample_*`
    end type result_list

contains

    subroutine add_target(list, id, n, samples, x)
        type(result_list), intent(inout) :: list
        integer, intent(in) :: id
        integer, intent(in) :: n, samples              !! values of a sample, and samples
        real(wp), intent(in), target :: x(n, samples)

        list%n = list%n + 1
        list%id(list%n) = id
        list%of(list%n)%x => x
    end subroutine add_target

    !> A block of numbers of a batch: n numbers for each sample, or one column for all.
    subroutine set_block(arrays, block, n, samples, x)
        type(sample_arrays), intent(inout) :: arrays
        integer, intent(in) :: block                   !! one of `in_*`
        integer, intent(in) :: n, samples
        real(wp), intent(in), target :: x(n, samples)

        arrays%of(block)%x => x
    end subroutine set_block
end module linkdyn_samples
