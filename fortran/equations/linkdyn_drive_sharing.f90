!> More drives than freedoms: how they share the work, as equations beside those of motion.
!>
!> Of all driving forces u that the motion allows, those with the least sum of (u - p)^2/share, p the preload, are
!>
!>     u = p + share s',
!>
!> s' the speeds of the driven variables in some motion of the mechanism: what differs from them by a strain has no power in
!> any motion, so it is square to this part of them. The rates of the coordinates in that motion are unknowns, as many as
!> equations of motion are left over.
!>
!> **Source**: J. Hollerbach, K. Suh, IEEE J. Robotics Autom. 3 (1987) 308; for parallel mechanisms A. Mueller, Redundant
!> actuation of parallel manipulators, in: Parallel Manipulators (2008).
module linkdyn_drive_sharing
    use linkdyn_joint_variables, only: variable_rate
    use linkdyn_mechanism, only: mechanism_type
    use linkdyn_substitution, only: substitution, substituted
    use linkdyn_system, only: system_type, require
    use linkdyn_value, only: value, constant, operator(-), operator(*)
    implicit none (type, external)
    private
    public :: share_work

contains

    !> Links are placed and move, and no driving force is known.
    subroutine share_work(mechanism, transmitted, map, system)
        type(mechanism_type), intent(in) :: mechanism
        type(value), intent(in) :: transmitted(:)      !! unknown driving forces, without the rotors' inertia (actuator) [N, N m]
        type(substitution), intent(inout) :: map       !! from velocities to those of that motion, whose rates are unknowns
        type(system_type), intent(inout) :: system
        type(value) :: speed
        integer :: i

        do i = 1, size(transmitted)
            associate (drive => mechanism%model%scene%actuator(i))
                speed = substituted(map, variable_rate(mechanism, drive%joint, drive%variable))
                call require(system, transmitted(i) - constant(drive%preload) - constant(drive%share)*speed)
            end associate
        end do
    end subroutine share_work
end module linkdyn_drive_sharing
