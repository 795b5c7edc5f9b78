!> The null space of a sparse matrix whose pattern never changes: pivots are chosen once, at representative samples.
!>
!> Elimination takes as many pivots as the rank; the unknowns that are left are free, and each makes one vector of the null space.
!> A sample where a pivot has become too small for that, or where the rank is another, is not sure: `find_null_space` decides then.
!>
!> **Source**: Markowitz, Management Science 3 (1957) 255, for the choice of pivots.
module linkdyn_null_space_plan
    use linkdyn_kinds, only: wp
    use linkdyn_null_space, only: orthonormalize
    implicit none (type, external)
    private
    public :: null_space_plan, plan_null_space, find_null_space_by_plan

    real(wp), parameter :: threshold = 0.1_wp            !! a pivot is at least this part of its unknown's largest entry
    real(wp), parameter :: largest_factor = 1.0e3_wp     !! by which a pivot's equation is taken from another
    real(wp), parameter :: least_pivot = 1.0e-4_wp       !! of entries about one
    real(wp), parameter :: says_nothing = 1.0e-9_wp      !! entries of equations that follow from the others

    !> A pivot and what it meets.
    type :: pivot_type
        integer :: equation = 0, unknown = 0
        integer, allocatable :: below(:)                 !! equations that still have the unknown
        integer, allocatable :: beside(:)                !! the other unknowns of its equation
    end type pivot_type

    type :: null_space_plan
        type(pivot_type), allocatable :: pivot(:)
        integer, allocatable :: free(:)                  !! unknowns
        integer, allocatable :: rest(:)                  !! equations that follow from the others
    end type null_space_plan

contains

    !> Choose the pivots: the cheapest of those that are large enough at every sample.
    pure subroutine plan_null_space(sample, pattern, n_free, plan)
        real(wp), intent(in) :: sample(:, :, :)          !! the matrix (equation, unknown, sample), entries about one
        logical, intent(in) :: pattern(:, :)             !! where it may have an entry (equation, unknown)
        integer, intent(in) :: n_free                    !! dimension of the null space
        type(null_space_plan), intent(out) :: plan
        real(wp) :: a(size(sample, 1), size(sample, 2), size(sample, 3))
        logical :: has(size(sample, 1), size(sample, 2)), is_open(size(sample, 1)), is_free(size(sample, 2))
        integer :: k, i, j, p

        a = sample
        has = pattern
        is_open = .true.
        is_free = .true.
        allocate (plan%pivot(size(sample, 2) - n_free))
        do k = 1, size(plan%pivot)
            associate (pivot => plan%pivot(k))
                call choose_pivot(a, has, is_open, is_free, pivot%equation, pivot%unknown)
                is_open(pivot%equation) = .false.
                is_free(pivot%unknown) = .false.
                pivot%below = pack([(i, i=1, size(is_open))], is_open .and. has(:, pivot%unknown))
                pivot%beside = pack([(j, j=1, size(is_free))], is_free .and. has(pivot%equation, :))
                has(pivot%below, pivot%beside) = .true.
                do p = 1, size(a, 3)
                    call eliminate(pivot, a(:, :, p))
                end do
            end associate
        end do
        plan%free = pack([(j, j=1, size(is_free))], is_free)
        plan%rest = pack([(i, i=1, size(is_open))], is_open)
    end subroutine plan_null_space

    !> The pivot that fills in least (Markowitz) among those that are large enough at every sample; the largest one if none is.
    pure subroutine choose_pivot(a, has, is_open, is_free, equation, unknown)
        real(wp), intent(in) :: a(:, :, :)               !! what is left (equation, unknown, sample)
        logical, intent(in) :: has(:, :), is_open(:), is_free(:)
        integer, intent(out) :: equation, unknown
        real(wp) :: part, largest_part
        real(wp) :: scale(size(a, 3))
        integer :: cost, least_cost, in_equation(size(has, 1)), i, j, p

        in_equation = count(has .and. spread(is_free, 1, size(has, 1)), dim=2)
        equation = findloc(is_open, .true., dim=1)
        unknown = findloc(is_free, .true., dim=1)
        least_cost = huge(1)
        largest_part = 0
        do j = 1, size(has, 2)
            if (.not. is_free(j)) cycle
            do p = 1, size(a, 3)
                scale(p) = min(1.0_wp, 1/max(maxval(abs(a(:, j, p)), mask=is_open), tiny(1.0_wp)))
            end do
            do i = 1, size(has, 1)
                if (.not. (is_open(i) .and. has(i, j))) cycle
                part = huge(1.0_wp)
                do p = 1, size(a, 3)
                    part = min(part, abs(a(i, j, p))*scale(p))
                end do
                cost = (in_equation(i) - 1)*(count(is_open .and. has(:, j)) - 1)
                if (part < threshold) then
                    ! the largest, as long as none is large enough
                    if (least_cost < huge(1) .or. part <= largest_part) cycle
                else
                    if (cost > least_cost .or. (cost == least_cost .and. part <= largest_part)) cycle
                    least_cost = cost
                end if
                largest_part = part
                equation = i
                unknown = j
            end do
        end do
    end subroutine choose_pivot

    !> Take a pivot's equation from those that still have its unknown.
    pure subroutine eliminate(pivot, a)
        type(pivot_type), intent(in) :: pivot
        real(wp), intent(inout) :: a(:, :)               !! (equation, unknown)
        real(wp) :: factor(size(pivot%below)), entry
        integer :: i, j

        factor = a(pivot%below, pivot%unknown)/a(pivot%equation, pivot%unknown)
        do j = 1, size(pivot%beside)
            associate (column => pivot%beside(j))
                entry = a(pivot%equation, column)
                do i = 1, size(pivot%below)
                    a(pivot%below(i), column) = a(pivot%below(i), column) - factor(i)*entry
                end do
            end associate
        end do
    end subroutine eliminate

    !> An orthonormal basis of the null space.
    pure subroutine find_null_space_by_plan(plan, a, basis, is_sure)
        type(null_space_plan), intent(in) :: plan
        real(wp), intent(inout) :: a(:, :)               !! (equation, unknown); what is left of it
        real(wp), intent(out) :: basis(:, :)             !! (unknown, free unknown)
        logical, intent(out) :: is_sure
        real(wp) :: entry
        integer :: k, j

        is_sure = .false.
        do k = 1, size(plan%pivot)
            associate (pivot => plan%pivot(k))
                entry = abs(a(pivot%equation, pivot%unknown))
                if (.not. entry >= least_pivot) return
                if (any(abs(a(pivot%below, pivot%unknown)) > largest_factor*entry)) return
                call eliminate(pivot, a)
            end associate
        end do
        if (any(abs(a(plan%rest, plan%free)) > says_nothing)) return
        basis = 0
        do k = 1, size(plan%free)
            basis(plan%free(k), k) = 1
        end do
        do k = size(plan%pivot), 1, -1
            associate (pivot => plan%pivot(k))
                do j = 1, size(pivot%beside)
                    basis(pivot%unknown, :) = basis(pivot%unknown, :) - a(pivot%equation, pivot%beside(j))*basis(pivot%beside(j), :)
                end do
                basis(pivot%unknown, :) = basis(pivot%unknown, :)/a(pivot%equation, pivot%unknown)
            end associate
        end do
        call orthonormalize(basis)
        is_sure = .true.
    end subroutine find_null_space_by_plan
end module linkdyn_null_space_plan
