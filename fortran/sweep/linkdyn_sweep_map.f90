!> Maps of a sweep: the worst of every quantity, and how many samples are feasible, in each cell of a grid over some of
!> the axes.
!>
!> Largest values and counts do not depend on the order in which they are joined.
module linkdyn_sweep_map
    use, intrinsic :: iso_fortran_env, only: int64
    use linkdyn_kinds, only: wp
    use linkdyn_sweep_plan, only: sweep_plan
    use linkdyn_sweep_quantities, only: quantity_row
    use linkdyn_sweep_spec, only: sweep_spec, quantity_determinant, quantity_clearance
    use linkdyn_value_rows, only: widen_rows, at_once
    implicit none (type, external)
    private
    public :: sweep_map, map_part, make_map, find_cells, start_part, add_to_part, join_part, is_least, most_cells

    integer(int64), parameter :: most_cells = 100000000_int64
    real(wp), parameter :: nothing = -huge(1.0_wp)

    type :: sweep_map
        logical :: is_wanted = .false.
        integer, allocatable :: axis(:)                    !! of the sweep, slowest first
        integer, allocatable :: group(:)                   !! of the plan
        integer(int64), allocatable :: stride(:)
        integer(int64) :: n_cell = 0                       !! of one design
        real(wp), allocatable :: worst(:, :)               !! (quantity, cell of all designs); least ones with a minus
        integer(int64), allocatable :: n_feasible(:)       !! (cell of all designs)
    end type sweep_map

    !> The same for one chunk: cells in the order in which they were met, some of them several times.
    type :: map_part
        integer :: n = 0
        integer(int64), allocatable :: cell(:)
        real(wp), allocatable :: worst(:, :)               !! (quantity, n)
        integer(int64), allocatable :: n_feasible(:)
    end type map_part

contains

    subroutine make_map(spec, plan, n_quantity, map)
        type(sweep_spec), intent(in) :: spec
        type(sweep_plan), intent(in) :: plan
        integer, intent(in) :: n_quantity
        type(sweep_map), intent(out) :: map
        integer :: i, g

        map%is_wanted = size(spec%map_axis) > 0
        map%axis = spec%map_axis
        allocate (map%group(size(map%axis)), map%stride(size(map%axis)))
        map%n_cell = 1
        do i = size(map%axis), 1, -1
            do g = 1, size(plan%group)
                if (any(plan%group(g)%axis == map%axis(i))) map%group(i) = g
            end do
            map%stride(i) = map%n_cell
            map%n_cell = map%n_cell*plan%group(map%group(i))%n
        end do
        if (.not. map%is_wanted) map%n_cell = 0
        allocate (map%worst(n_quantity, map%n_cell*plan%n_design), source=nothing)
        allocate (map%n_feasible(map%n_cell*plan%n_design), source=0_int64)
    end subroutine make_map

    !> The cells of samples, from 1.
    pure subroutine find_cells(map, place, design, cell)
        type(sweep_map), intent(in) :: map
        integer(int64), intent(in) :: place(:, :)          !! of each sample along the groups of the plan (sample, group)
        integer(int64), intent(in) :: design               !! from 0
        integer(int64), intent(out) :: cell(:)             !! (sample)
        integer :: i

        cell = design*map%n_cell + 1
        do i = 1, size(map%group)
            cell = cell + place(:, map%group(i))*map%stride(i)
        end do
    end subroutine find_cells

    !> Room for a chunk of n samples.
    subroutine start_part(n_quantity, n, part)
        integer, intent(in) :: n_quantity, n
        type(map_part), intent(inout) :: part

        part%n = 0
        if (allocated(part%cell)) then
            if (size(part%cell) >= n) return
            deallocate (part%cell, part%worst, part%n_feasible)
        end if
        allocate (part%cell(n), part%worst(n_quantity, n), part%n_feasible(n))
    end subroutine start_part

    !> Take samples in.
    subroutine add_to_part(row, n, value, cell, counts, is_feasible, part)
        type(quantity_row), intent(in) :: row
        integer, intent(in) :: n                           !! samples
        real(wp), intent(in), contiguous :: value(:, :)    !! (entry, sample)
        integer(int64), intent(in) :: cell(:)              !! (sample)
        logical, intent(in) :: counts(:), is_feasible(:)   !! (sample)
        type(map_part), intent(inout) :: part
        real(wp) :: largest(row%n)                         ! sizes of entries, of the samples of a cell
        integer :: first, last

        first = 1
        do while (first <= n)
            last = first
            do while (last < n)
                if (cell(last + 1) /= cell(first)) exit
                last = last + 1
            end do
            if (part%n == 0) then
                call begin_cell(cell(first), part)
            else if (part%cell(part%n) /= cell(first)) then
                call begin_cell(cell(first), part)
            end if
            part%n_feasible(part%n) = part%n_feasible(part%n) + count(is_feasible(first:last))
            if (any(counts(first:last))) then
                call find_largest(value(:, first:last), counts(first:last), largest)
                call take_worst(row, value(:, first:last), counts(first:last), largest, part%worst(:, part%n))
            end if
            first = last + 1
        end do
    end subroutine add_to_part

    subroutine begin_cell(cell, part)
        integer(int64), intent(in) :: cell
        type(map_part), intent(inout) :: part

        part%n = part%n + 1
        part%cell(part%n) = cell
        part%worst(:, part%n) = nothing
        part%n_feasible(part%n) = 0
    end subroutine begin_cell

    !> The largest sizes of entries, of samples that count.
    pure subroutine find_largest(value, counts, largest)
        real(wp), intent(in), contiguous :: value(:, :)    !! (entry, sample)
        logical, intent(in) :: counts(:)                   !! (sample)
        real(wp), intent(out) :: largest(:)                !! (entry)
        integer :: s, n_here

        largest = 0
        s = 1
        do while (s <= size(counts))
            n_here = 1
            if (s + at_once - 1 <= size(counts)) then
                if (all(counts(s:s + at_once - 1))) n_here = at_once
            end if
            if (counts(s)) call widen_rows(size(value, 1), n_here, value(:, s:s + n_here - 1), largest)
            s = s + n_here
        end do
    end subroutine find_largest

    !> The worst entry of each quantity, with a minus where the least is the worst.
    pure subroutine take_worst(row, value, counts, largest, worst)
        type(quantity_row), intent(in) :: row
        real(wp), intent(in) :: value(:, :)                !! (entry, sample)
        logical, intent(in) :: counts(:)                   !! (sample)
        real(wp), intent(in) :: largest(:)                 !! (entry)
        real(wp), intent(inout) :: worst(:)                !! (quantity)
        integer :: i, s

        do i = 1, size(row%quantity)
            associate (first => row%quantity(i)%first + 1, last => row%quantity(i)%first + row%quantity(i)%n)
                select case (row%quantity(i)%id)
                case (quantity_clearance)
                    do s = 1, size(counts)
                        if (counts(s)) worst(i) = max(worst(i), -minval(value(first:last, s)))
                    end do
                case (quantity_determinant)
                    do s = 1, size(counts)
                        if (counts(s)) worst(i) = max(worst(i), -minval(abs(value(first:last, s))))
                    end do
                case default
                    if (last >= first) worst(i) = max(worst(i), maxval(largest(first:last)))
                end select
            end associate
        end do
    end subroutine take_worst

    subroutine join_part(part, map)
        type(map_part), intent(in) :: part
        type(sweep_map), intent(inout) :: map
        integer :: i

        do i = 1, part%n
            associate (cell => part%cell(i))
                map%worst(:, cell) = max(map%worst(:, cell), part%worst(:, i))
                map%n_feasible(cell) = map%n_feasible(cell) + part%n_feasible(i)
            end associate
        end do
    end subroutine join_part

    !> Is the worst of a quantity its least value?
    pure logical function is_least(id)
        integer, intent(in) :: id

        is_least = id == quantity_determinant .or. id == quantity_clearance
    end function is_least
end module linkdyn_sweep_map
