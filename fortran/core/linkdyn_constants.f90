!> Constants: of mathematics, in working precision, and of what results promise.
module linkdyn_constants
    use linkdyn_kinds, only: wp
    implicit none (type, external)
    private
    public :: pi, two_pi, golden, least_accuracy

    real(wp), parameter :: pi = 3.14159265358979323846264338327950288419716939937510_wp
    real(wp), parameter :: two_pi = 2*pi
    !> Golden section: the fractions of its multiples spread evenly, however many they are.
    real(wp), parameter :: golden = 0.61803398874989484820458683436563811772_wp

    !> Relative accuracy that every number given as right has at least. Six digits are more than any mechanism is made to, and
    !> leave the three that each of position, velocity and acceleration may lose on the way of double precision's fifteen.
    real(wp), parameter :: least_accuracy = 1.0e-6_wp
end module linkdyn_constants
