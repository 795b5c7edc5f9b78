!> A dataset into a netCDF-4 file, and samples behind it, as many as come.
module linkdyn_netcdf_dataset
    use, intrinsic :: iso_fortran_env, only: real64
    use linkdyn_dataset, only: dataset_type, dataset_variable, sample_variable
    use linkdyn_kinds, only: wp
    use linkdyn_netcdf_writer, only: netcdf_writer, attributes_type, open_netcdf, abandon_netcdf, put_attributes, put_strings, &
        check, chunk_length
    use linkdyn_status, only: status_type
    use netcdf, only: nf90_def_dim, nf90_def_var, nf90_put_att, nf90_put_var, nf90_double, nf90_int64, nf90_int, nf90_global, &
        nf90_unlimited
    implicit none (type, external)
    private
    public :: create_dataset, define_samples, put_samples

contains

    !> A file with all of the dataset.
    subroutine create_dataset(target, planar, attributes, dataset, writer, dimension_id, status)
        character(len=*), intent(in) :: target
        logical, intent(in) :: planar
        type(attributes_type), intent(in) :: attributes
        type(dataset_type), intent(in) :: dataset
        type(netcdf_writer), intent(out) :: writer
        integer, allocatable, intent(out) :: dimension_id(:)
        type(status_type), intent(inout) :: status
        integer :: i

        allocate (dimension_id(size(dataset%dimension)))
        call open_netcdf(target, writer, status)
        if (.not. status%is_ok()) return
        call put_attributes(planar, attributes, writer, status)
        do i = 1, size(dataset%attribute)
            associate (attribute => dataset%attribute(i))
                if (allocated(attribute%text)) then
                    call check(nf90_put_att(writer%id, nf90_global, trim(attribute%name), attribute%text), writer, status)
                else
                    call check(nf90_put_att(writer%id, nf90_global, trim(attribute%name), real(attribute%value, real64)), &
                        writer, status)
                end if
            end associate
        end do
        do i = 1, size(dataset%dimension)
            call check(nf90_def_dim(writer%id, trim(dataset%dimension(i)%name), dataset%dimension(i)%size, dimension_id(i)), &
                writer, status)
        end do
        do i = 1, size(dataset%variable)
            call put_variable(dataset, dataset%variable(i), dimension_id, writer, status)
        end do
        if (.not. status%is_ok()) call abandon_netcdf(writer)
    end subroutine create_dataset

    !> Define a variable with its attributes, and write it.
    subroutine put_variable(dataset, variable, dimension_id, writer, status)
        type(dataset_type), intent(in) :: dataset
        type(dataset_variable), intent(in) :: variable
        integer, intent(in) :: dimension_id(:)
        type(netcdf_writer), intent(in) :: writer
        type(status_type), intent(inout) :: status
        integer :: dims(size(variable%dim)), counts(size(variable%dim)), start(size(variable%dim)), n, id

        if (.not. status%is_ok()) return
        n = size(dims)
        dims = dimension_id(variable%dim(n:1:-1))
        counts = dataset%dimension(variable%dim(n:1:-1))%size
        start = 1
        if (allocated(variable%text)) then
            call put_strings(trim(variable%name), variable%text, dims(1), writer, status)
            return
        end if
        if (n == 0) then
            call check(nf90_def_var(writer%id, trim(variable%name), merge(nf90_int64, nf90_double, &
                allocated(variable%integer)), id), writer, status)
        else
            call check(nf90_def_var(writer%id, trim(variable%name), merge(nf90_int64, nf90_double, &
                allocated(variable%integer)), dims, id), writer, status)
        end if
        if (.not. status%is_ok()) return
        if (variable%long_name /= "") &
            call check(nf90_put_att(writer%id, id, "long_name", trim(variable%long_name)), writer, status)
        if (variable%units /= "") call check(nf90_put_att(writer%id, id, "units", trim(variable%units)), writer, status)
        if (variable%coordinates /= "") &
            call check(nf90_put_att(writer%id, id, "coordinates", trim(variable%coordinates)), writer, status)
        if (any(counts == 0)) return
        if (n == 0) then
            if (allocated(variable%integer)) then
                call check(nf90_put_var(writer%id, id, variable%integer(1)), writer, status)
            else
                call check(nf90_put_var(writer%id, id, real(variable%real(1), real64)), writer, status)
            end if
        else if (allocated(variable%integer)) then
            call check(nf90_put_var(writer%id, id, variable%integer, start, counts), writer, status)
        else
            call check(nf90_put_var(writer%id, id, real(variable%real, real64), start, counts), writer, status)
        end if
    end subroutine put_variable

    !> Variables along a dimension `sample` that grows.
    subroutine define_samples(dataset, dimension_id, variable, variable_id, writer, status)
        type(dataset_type), intent(in) :: dataset
        integer, intent(in) :: dimension_id(:)
        type(sample_variable), intent(in) :: variable(:)
        integer, allocatable, intent(out) :: variable_id(:)
        type(netcdf_writer), intent(in) :: writer
        type(status_type), intent(inout) :: status
        integer :: sample_id, i, n

        allocate (variable_id(size(variable)))
        call check(nf90_def_dim(writer%id, "sample", nf90_unlimited, sample_id), writer, status)
        do i = 1, size(variable)
            if (.not. status%is_ok()) return
            associate (v => variable(i))
                n = size(v%dim)
                call check(nf90_def_var(writer%id, trim(v%name), merge(nf90_int, nf90_double, v%is_integer), &
                    [dimension_id(v%dim(n:1:-1)), sample_id], variable_id(i), &
                    chunksizes=[dataset%dimension(v%dim(n:1:-1))%size, chunk_length(v%width, 0)]), writer, status)
                if (.not. status%is_ok()) return
                call check(nf90_put_att(writer%id, variable_id(i), "long_name", trim(v%long_name)), writer, status)
                if (v%units /= "") call check(nf90_put_att(writer%id, variable_id(i), "units", trim(v%units)), writer, status)
                if (v%coordinates /= "") &
                    call check(nf90_put_att(writer%id, variable_id(i), "coordinates", trim(v%coordinates)), writer, status)
            end associate
        end do
    end subroutine define_samples

    !> Some samples: their values stand variable after variable in each column.
    subroutine put_samples(dataset, variable, variable_id, first, values, writer, status)
        type(dataset_type), intent(in) :: dataset
        type(sample_variable), intent(in) :: variable(:)
        integer, intent(in) :: variable_id(:)
        integer, intent(in) :: first               !! from 1
        real(wp), intent(in) :: values(:, :)       !! (all values, sample)
        type(netcdf_writer), intent(in) :: writer
        type(status_type), intent(inout) :: status
        integer :: i, n, place

        place = 0
        do i = 1, size(variable)
            if (.not. status%is_ok()) return
            associate (v => variable(i), part => values(place + 1:place + variable(i)%width, :))
                n = size(v%dim)
                if (v%is_integer) then
                    call check(nf90_put_var(writer%id, variable_id(i), nint(reshape(part, [size(part)])), &
                        [spread(1, 1, n), first], [dataset%dimension(v%dim(n:1:-1))%size, size(values, 2)]), writer, status)
                else
                    call check(nf90_put_var(writer%id, variable_id(i), real(reshape(part, [size(part)]), real64), &
                        [spread(1, 1, n), first], [dataset%dimension(v%dim(n:1:-1))%size, size(values, 2)]), writer, status)
                end if
            end associate
            place = place + variable(i)%width
        end do
    end subroutine put_samples
end module linkdyn_netcdf_dataset
