!> Mathematical constants in working precision.
module linkdyn_constants
    use linkdyn_kinds, only: wp
    implicit none (type, external)
    private
    public :: pi, two_pi

    real(wp), parameter :: pi = 3.14159265358979323846264338327950288419716939937510_wp
    real(wp), parameter :: two_pi = 2*pi
end module linkdyn_constants
