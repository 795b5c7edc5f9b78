!> Attitudes as rotation matrices, from Fortran: those of the angles that a scene's motion has, tilted to and fro.
!>
!> Usage: main SCENE
program main
    use, intrinsic :: iso_c_binding, only: c_double, c_int
    use linkdyn, only: linkdyn_scene, into, linkdyn_message, linkdyn_ok
    implicit none (type, external)
    integer, parameter :: n = 5
    type(linkdyn_scene) :: scene
    character(len=1024) :: file
    real(c_double) :: q(6, n), rates(6, n), load(6, 0, n), attitude(15, 1, n), t(n), s(3), c(3)
    real(c_double), allocatable, target :: by_angle(:, :), by_matrix(:, :)
    integer(c_int) :: status(n)
    integer :: code, i

    call get_command_argument(1, file)
    call scene%open_file(file, code)
    call check()
    t = [(0.1_c_double*i, i=1, n)]
    call scene%motion(t, q, attitude(:6, 1, :), rates, load, code)
    call check()
    rates = 0
    q(4:, :) = q(4:, :) + reshape([(sin(1.0_c_double*i), i=1, 3*n)], [3, n])/5
    allocate (by_angle(scene%count("actuator"), n), by_matrix(scene%count("actuator"), n))
    call scene%inverse(q, rates, rates, load, [into("driving_force", by_angle)], status, code)
    call check()
    attitude = 0
    do i = 1, n
        s = sin(q(4:, i))
        c = cos(q(4:, i))
        attitude(:9, 1, i) = [c(2)*c(3), -c(2)*s(3), s(2), &
                              c(1)*s(3) + s(1)*s(2)*c(3), c(1)*c(3) - s(1)*s(2)*s(3), -s(1)*c(2), &
                              s(1)*s(3) - c(1)*s(2)*c(3), s(1)*c(3) + c(1)*s(2)*s(3), c(1)*c(2)]
    end do
    q(4:, :) = 0
    call scene%inverse_attitudes(q, rates, rates, attitude, load, [into("driving_force", by_matrix)], status, code)
    call check()
    if (any(status /= 0)) error stop "a sample failed"
    print "(es10.3)", maxval(abs(by_matrix - by_angle))/maxval(abs(by_angle))
    attitude(:9, 1, 3) = -attitude(:9, 1, 3)
    call scene%inverse_attitudes(q, rates, rates, attitude, load, [into("driving_force", by_matrix)], status, code)
    print "(a)", linkdyn_message()
    call scene%inverse_attitudes(q, rates, rates, attitude(:12, :, :), load, [into("driving_force", by_matrix)], status, code)
    print "(a)", linkdyn_message()

contains

    subroutine check()

        if (code == linkdyn_ok) return
        print "(a)", linkdyn_message()
        error stop 1
    end subroutine check
end program main
