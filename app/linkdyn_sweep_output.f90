!> Results of a sweep into a file: the reductions, and behind them the samples from the spool.
module linkdyn_sweep_output
    use, intrinsic :: iso_fortran_env, only: int64
    use linkdyn_dataset, only: dataset_type, sample_variable
    use linkdyn_kinds, only: wp
    use linkdyn_netcdf_dataset, only: create_dataset, define_samples, put_samples
    use linkdyn_netcdf_writer, only: netcdf_writer, attributes_type, close_netcdf
    use linkdyn_spool, only: spool_type, read_spool, check_spool
    use linkdyn_status, only: status_type
    use linkdyn_sweep, only: sweep_run
    use linkdyn_sweep_results, only: sweep_dataset, kept_variables
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
        integer, allocatable :: dimension_id(:), variable_id(:)
        real(wp), allocatable :: records(:, :)
        integer(int64) :: first
        integer :: n

        call sweep_dataset(run, dataset)
        call create_dataset(name, run%scene%planar, attributes, dataset, writer, dimension_id, status)
        if (.not. status%is_ok()) return
        if (any(run%spec%keeps)) then
            call kept_variables(run, dataset, variable)
            call define_samples(dataset, dimension_id, variable, variable_id, writer, status)
            call check_spool(spool, status)
            first = 0
            do while (first < run%plan%n_sample .and. status%is_ok())
                n = int(min(int(block_length, int64), run%plan%n_sample - first))
                if (allocated(records)) deallocate (records)
                allocate (records(spool%width, n))
                call read_spool(spool, first, records, status)
                call put_samples(dataset, variable, variable_id, int(first) + 1, records, writer, status)
                first = first + n
            end do
        end if
        call close_netcdf(writer, status)
    end subroutine write_sweep
end module linkdyn_sweep_output
