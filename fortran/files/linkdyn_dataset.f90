!> A named set of arrays on named dimensions, in memory: what netCDF files and xarray hold, before either knows of it.
module linkdyn_dataset
    use, intrinsic :: iso_fortran_env, only: int64
    use linkdyn_kinds, only: wp
    implicit none (type, external)
    private
    public :: dataset_type, dataset_variable, sample_variable
    public :: add_dimension, add_reals, add_integers, add_texts, add_attribute, find_dimension, text_len

    integer, parameter :: item_len = 64
    integer, parameter :: text_len = 192

    type :: dataset_dimension
        character(len=item_len) :: name = ""
        integer :: size = 0
    end type dataset_dimension

    !> One array; of its three kinds of values one is allocated.
    type :: dataset_variable
        character(len=item_len) :: name = ""
        character(len=text_len) :: long_name = ""
        character(len=item_len) :: units = ""              !! blank: none
        character(len=text_len) :: coordinates = ""        !! names of variables that say more of the entries (CF)
        integer, allocatable :: dim(:)                     !! slowest first
        real(wp), allocatable :: real(:)                   !! last dimension fastest
        integer(int64), allocatable :: integer(:)
        character(len=text_len), allocatable :: text(:)
    end type dataset_variable

    !> A variable along samples: its values come chunk by chunk.
    type :: sample_variable
        character(len=item_len) :: name = ""
        character(len=text_len) :: long_name = ""
        character(len=item_len) :: units = ""
        character(len=text_len) :: coordinates = ""
        integer, allocatable :: dim(:)                     !! behind the sample, slowest first
        integer :: width = 1                               !! values of one sample
        logical :: is_integer = .false.
    end type sample_variable

    type :: dataset_attribute
        character(len=item_len) :: name = ""
        character(len=:), allocatable :: text
        real(wp), allocatable :: value(:)                  !! instead of the text
    end type dataset_attribute

    type :: dataset_type
        type(dataset_dimension), allocatable :: dimension(:)
        type(dataset_variable), allocatable :: variable(:)
        type(dataset_attribute), allocatable :: attribute(:)
    end type dataset_type

contains

    !> A dimension, once.
    subroutine add_dimension(dataset, name, size_of)
        type(dataset_type), intent(inout) :: dataset
        character(len=*), intent(in) :: name
        integer, intent(in) :: size_of

        if (.not. allocated(dataset%dimension)) &
            allocate (dataset%dimension(0), dataset%variable(0), dataset%attribute(0))
        if (find_dimension(dataset, name) > 0) return
        dataset%dimension = [dataset%dimension, dataset_dimension(name, size_of)]
    end subroutine add_dimension

    !> Number of a dimension by its name; 0 if it is not there.
    pure integer function find_dimension(dataset, name) result(number)
        type(dataset_type), intent(in) :: dataset
        character(len=*), intent(in) :: name

        do number = size(dataset%dimension), 1, -1
            if (dataset%dimension(number)%name == name) return
        end do
    end function find_dimension

    subroutine add_reals(dataset, name, dims, values, long_name, units, coordinates)
        type(dataset_type), intent(inout) :: dataset
        character(len=*), intent(in) :: name
        character(len=*), intent(in) :: dims               !! names, slowest first, with blanks between
        real(wp), intent(in) :: values(:)
        character(len=*), intent(in) :: long_name, units
        character(len=*), intent(in), optional :: coordinates
        type(dataset_variable) :: variable

        call describe(dataset, name, dims, long_name, variable)
        variable%units = units
        if (present(coordinates)) variable%coordinates = adjustl(coordinates)
        variable%real = values
        dataset%variable = [dataset%variable, variable]
    end subroutine add_reals

    subroutine add_integers(dataset, name, dims, values, long_name)
        type(dataset_type), intent(inout) :: dataset
        character(len=*), intent(in) :: name, dims
        integer(int64), intent(in) :: values(:)
        character(len=*), intent(in) :: long_name
        type(dataset_variable) :: variable

        call describe(dataset, name, dims, long_name, variable)
        variable%units = "1"
        variable%integer = values
        dataset%variable = [dataset%variable, variable]
    end subroutine add_integers

    !> Labels.
    subroutine add_texts(dataset, name, dims, values)
        type(dataset_type), intent(inout) :: dataset
        character(len=*), intent(in) :: name, dims
        character(len=*), intent(in) :: values(:)
        type(dataset_variable) :: variable
        integer :: i

        call describe(dataset, name, dims, "", variable)
        allocate (variable%text(size(values)))
        do i = 1, size(values)
            variable%text(i) = values(i)
        end do
        dataset%variable = [dataset%variable, variable]
    end subroutine add_texts

    subroutine describe(dataset, name, dims, long_name, variable)
        type(dataset_type), intent(in) :: dataset
        character(len=*), intent(in) :: name, dims, long_name
        type(dataset_variable), intent(out) :: variable
        integer :: first, last

        variable%name = name
        variable%long_name = long_name
        allocate (variable%dim(0))
        first = 1
        do while (first <= len_trim(dims))
            if (dims(first:first) == " ") then
                first = first + 1
                cycle
            end if
            last = first + scan(dims(first:)//" ", " ") - 2
            variable%dim = [variable%dim, find_dimension(dataset, dims(first:last))]
            first = last + 1
        end do
    end subroutine describe

    subroutine add_attribute(dataset, name, text, value)
        type(dataset_type), intent(inout) :: dataset
        character(len=*), intent(in) :: name
        character(len=*), intent(in), optional :: text
        real(wp), intent(in), optional :: value(:)
        type(dataset_attribute) :: attribute

        attribute%name = name
        if (present(text)) attribute%text = text
        if (present(value)) attribute%value = value
        dataset%attribute = [dataset%attribute, attribute]
    end subroutine add_attribute
end module linkdyn_dataset
