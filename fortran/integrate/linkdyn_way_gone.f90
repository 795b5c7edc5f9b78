!> How far a solution has gone, and how large an absolute error its components are allowed therefore.
!>
!> A tolerance of 1e-9 m is nothing to a crane and everything to a stage that oscillates by a micrometre, and no scene says which it
!> is. The motion does: where the way gone so far is less than 0.01 (m, rad, m/s, ...) the tolerance is that much smaller. So a
!> small motion has digits, too, and machines of the usual sizes take the steps that they always took.
!>
!> What moves less than a hundredth of what moves most beside it is resolved as though it moved that much, and nothing more
!> finely than numbers about 1 are rounded, unless the tolerance itself asks for it: what ought to stand still has only rounding
!> to go by.
!>
!> What is added up of large numbers that cancel has its size from beside it: the work of drives, which is zero as long as a heavy
!> machine only turns, is one of its kinetic energy. And where a force acts, work knows no more than places do: a machine that its
!> drives hold at rest moves by rounding, which their forces make a work of rounding, however large that is beside 1 J.
module linkdyn_way_gone
    use linkdyn_kinds, only: wp
    implicit none (type, external)
    private
    public :: way_gone_type, family_place, family_rate, family_alone, beside_others

    integer, parameter :: family_alone = 0       !! of a component that is like no other
    integer, parameter :: family_place = 1       !! places, angles
    integer, parameter :: family_rate = 2        !! and their rates
    real(wp), parameter :: beside_others = 1.0e-2_wp    !! part of what moves most in a family that all of it is taken to move

    type :: way_gone_type
        private
        real(wp), allocatable :: origin(:)       !! where the solution began (n)
        real(wp), allocatable :: furthest(:)     !! from there, so far (n)
        integer, allocatable :: family(:)        !! one of `family_*` (n)
        real(wp), allocatable :: beside(:)       !! size of what it stands beside; 0: nothing (n)
        real(wp), allocatable :: per_place(:)    !! of it a place is worth; 0: nothing (n)
    contains
        procedure :: start, note, absolute_error
    end type way_gone_type

contains

    subroutine start(self, y, family, beside, per_place)
        class(way_gone_type), intent(inout) :: self
        real(wp), intent(in) :: y(:)             !! (n)
        integer, intent(in), optional :: family(:)     !! absent: all alone (n)
        real(wp), intent(in), optional :: beside(:)    !! absent: nothing (n)
        real(wp), intent(in), optional :: per_place(:) !! absent: nothing (n)
        integer :: i

        self%origin = y
        self%furthest = [(0.0_wp, i=1, size(y))]
        self%family = [(family_alone, i=1, size(y))]
        if (present(family)) self%family = family
        self%beside = [(0.0_wp, i=1, size(y))]
        if (present(beside)) self%beside = beside
        self%per_place = [(0.0_wp, i=1, size(y))]
        if (present(per_place)) self%per_place = per_place
    end subroutine start

    !> The solution has come to y.
    pure subroutine note(self, y)
        class(way_gone_type), intent(inout) :: self
        real(wp), intent(in) :: y(:)             !! (n)

        self%furthest = max(self%furthest, abs(y - self%origin))
    end subroutine note

    !> That is allowed on the way to y.
    pure function absolute_error(self, y, atol) result(error)
        class(way_gone_type), intent(in) :: self
        real(wp), intent(in) :: y(:)             !! (n)
        real(wp), intent(in) :: atol             !! the tolerance
        real(wp) :: error(size(y)), unit(size(y))
        real(wp), parameter :: enough = 0.01_wp, least = 8*epsilon(1.0_wp)
        integer :: f

        unit = max(1.0_wp, self%beside)
        error = atol*max(self%furthest, abs(y - self%origin), self%beside)/enough
        do f = family_place, family_rate
            where (self%family == f) error = max(error, beside_others*min(atol, maxval(error, self%family == f)))
        end do
        error = max(min(atol*unit, max(error, least*unit)), least*self%per_place)
    end function absolute_error
end module linkdyn_way_gone
