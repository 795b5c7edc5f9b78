!> The cross product of plain vectors; `linkdyn_vec3` has that of vectors on lanes.
module linkdyn_cross
    use linkdyn_kinds, only: wp
    implicit none (type, external)
    private
    public :: cross

contains

    pure function cross(a, b) result(c)
        real(wp), intent(in) :: a(3), b(3)
        real(wp) :: c(3)

        c = [a(2)*b(3) - a(3)*b(2), a(3)*b(1) - a(1)*b(3), a(1)*b(2) - a(2)*b(1)]
    end function cross
end module linkdyn_cross
