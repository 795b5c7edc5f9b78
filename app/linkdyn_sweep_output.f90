!> Results of a sweep into a file: the reductions, and behind them the samples from the spool.
module linkdyn_sweep_output
    use, intrinsic :: iso_fortran_env, only: int64
    use linkdyn_dataset, only: dataset_type, find_dimension, add_dimension, add_texts
    use linkdyn_kinds, only: wp
    use linkdyn_netcdf_dataset, only: create_dataset, sample_variable, define_samples, put_samples
    use linkdyn_netcdf_writer, only: netcdf_writer, attributes_type, close_netcdf
    use linkdyn_spool, only: spool_type, read_spool
    use linkdyn_status, only: status_type
    use linkdyn_sweep, only: sweep_run
    use linkdyn_sweep_results, only: sweep_dataset
    use linkdyn_sweep_spec, only: quantity_name
    implicit none (type, external)
    private
    public :: write_sweep

    integer, parameter :: block_length = 16384           !! samples written at a time

contains

    subroutine write_sweep(name, attributes, run, spool, status)
        character(len=*), intent(in) :: name
        type(attributes_type), intent(in) :: attributes
        type(sweep_run), intent(in) :: run
        type(spool_type), intent(in) :: spool              !! read if samples are kept
        type(status_type), intent(inout) :: status
        type(dataset_type) :: dataset
        type(netcdf_writer) :: writer
        type(sample_variable), allocatable :: variable(:)
        integer, allocatable :: dimension_id(:)
        real(wp), allocatable :: records(:, :)
        integer(int64) :: first
        integer :: n

        call sweep_dataset(run, dataset)
        call create_dataset(name, run%scene%planar, attributes, dataset, writer, dimension_id, status)
        if (.not. status%is_ok()) return
        if (any(run%spec%keeps)) then
            call list_samples(run, dataset, variable)
            call define_samples(dataset, dimension_id, variable, writer, status)
            first = 0
            do while (first < run%plan%n_sample .and. status%is_ok())
                n = int(min(int(block_length, int64), run%plan%n_sample - first))
                if (allocated(records)) deallocate (records)
                allocate (records(spool%width, n))
                call read_spool(spool, first, records, status)
                call put_samples(dataset, variable, int(first) + 1, records, writer, status)
                first = first + n
            end do
        end if
        call close_netcdf(writer, status)
    end subroutine write_sweep

    !> The variables of a sample in the order of the spool's records.
    subroutine list_samples(run, dataset, variable)
        type(sweep_run), intent(in) :: run
        type(dataset_type), intent(in) :: dataset
        type(sample_variable), allocatable, intent(out) :: variable(:)
        type(sample_variable) :: new
        integer :: i, k

        new%name = "sample_outcome"
        new%long_name = "outcome of the sample: number, from 0, along the dimension outcome"
        new%units = "1"
        allocate (new%dim(0))
        new%is_integer = .true.
        variable = [new]
        new = sample_variable(name="sample_axis", long_name="values of the axes", coordinates="axis_unit", &
            dim=[find_dimension(dataset, "axis")])
        variable = [variable, new]
        do i = 1, size(run%row%quantity)
            associate (quantity => run%row%quantity(i))
                if (.not. run%spec%keeps(quantity%id)) cycle
                new = sample_variable(name=quantity_name(quantity%id), long_name=quantity%long_name, &
                    dim=[(find_dimension(dataset, trim(quantity%dim(k))), k=1, quantity%n_dim)])
                if (all(quantity%unit == quantity%unit(1))) then
                    new%units = quantity%unit(1)
                else
                    new%coordinates = trim(new%name)//"_unit"
                end if
                variable = [variable, new]
            end associate
        end do
    end subroutine list_samples
end module linkdyn_sweep_output
