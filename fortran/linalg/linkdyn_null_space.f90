!> Vectors that a small matrix makes zero: Gram and Schmidt with pivots, every vector made orthogonal twice.
module linkdyn_null_space
    use linkdyn_kinds, only: wp
    implicit none (type, external)
    private
    public :: find_null_space, orthonormalize

contains

    !> An orthonormal basis of the null space of A, and how clear its size is.
    pure subroutine find_null_space(a, tolerance, basis)
        real(wp), intent(in) :: a(:, :)                    !! (equations, unknowns)
        real(wp), intent(in) :: tolerance                  !! equations of which less than this part of the largest is new say
                                                           !! nothing
        real(wp), allocatable, intent(out) :: basis(:, :)  !! (unknowns, dimension of the null space)
        real(wp) :: whole(size(a, 2), size(a, 2))
        real(wp), allocatable :: rows(:, :)
        integer :: n, m, rank, k

        m = size(a, 2)
        rows = a
        rank = 0
        n = min(size(a, 1), m)
        call extend_basis(rows, n, tolerance, whole, rank)
        deallocate (rows)
        ! what is left of the unknowns themselves
        n = rank
        allocate (rows(m, m), source=0.0_wp)
        do k = 1, m
            rows(k, k) = 1
        end do
        do k = 1, rank
            call subtract_from_each(whole(:, k), rows)
        end do
        call extend_basis(rows, m, 0.0_wp, whole, n)
        basis = whole(:, rank + 1:)
    end subroutine find_null_space

    !> Add orthonormal vectors to a basis, the longest of what is left first.
    pure subroutine extend_basis(vector, most, tolerance, basis, n)
        real(wp), intent(inout) :: vector(:, :)            !! (vector, component); of each is left what the basis does not span
        integer, intent(in) :: most                        !! vectors of the basis in the end, at most
        real(wp), intent(in) :: tolerance                  !! part of the longest that counts as nothing
        real(wp), intent(inout) :: basis(:, :)             !! (component, vector)
        integer, intent(inout) :: n
        real(wp) :: longest, length(size(vector, 1))
        logical :: is_changed(size(vector, 1))
        integer :: k, i

        longest = 0
        is_changed = .true.
        do while (n < most)
            do i = 1, size(vector, 1)
                if (is_changed(i)) length(i) = norm2(vector(i, :))
            end do
            k = maxloc(length, dim=1)
            longest = max(longest, length(k))
            if (.not. length(k) > tolerance*longest) return
            n = n + 1
            basis(:, n) = vector(k, :)/length(k)
            call subtract_span(basis(:, :n - 1), basis(:, n))
            basis(:, n) = basis(:, n)/norm2(basis(:, n))
            call subtract_from_each(basis(:, n), vector, is_changed)
            vector(k, :) = 0
        end do
    end subroutine extend_basis

    !> What is left of vectors beside one of unit length: all of them side by side.
    pure subroutine subtract_from_each(direction, vector, is_changed)
        real(wp), intent(in) :: direction(:)
        real(wp), intent(inout) :: vector(:, :)            !! (vector, component)
        logical, intent(out), optional :: is_changed(:)    !! (vector)
        real(wp) :: part(size(vector, 1))
        integer :: c

        part = 0
        do c = 1, size(direction)
            part = part + direction(c)*vector(:, c)
        end do
        if (present(is_changed)) is_changed = part /= 0
        do c = 1, size(direction)
            if (direction(c) /= 0) vector(:, c) = vector(:, c) - part*direction(c)
        end do
    end subroutine subtract_from_each

    !> Vectors that span the same, each with a length of one and square to the others.
    pure subroutine orthonormalize(vector)
        real(wp), intent(inout) :: vector(:, :)            !! (component, vector), none in the span of the others
        integer :: k, again

        do k = 1, size(vector, 2)
            do again = 1, 2
                vector(:, k) = vector(:, k)/norm2(vector(:, k))
                call subtract_span(vector(:, :k - 1), vector(:, k))
            end do
            vector(:, k) = vector(:, k)/norm2(vector(:, k))
        end do
    end subroutine orthonormalize

    !> What is left of a vector beside orthonormal ones.
    pure subroutine subtract_span(basis, vector)
        real(wp), intent(in) :: basis(:, :)
        real(wp), intent(inout) :: vector(:)
        integer :: k

        do k = 1, size(basis, 2)
            vector = vector - dot_product(basis(:, k), vector)*basis(:, k)
        end do
    end subroutine subtract_span
end module linkdyn_null_space
