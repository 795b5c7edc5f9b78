!> linkdyn from Fortran: the reactions along a scene's motion, and a forward run that goes back to a state it had.
!>
!> Usage: main SCENE
program main
    use, intrinsic :: iso_c_binding, only: c_double, c_int
    use, intrinsic :: iso_fortran_env, only: error_unit
    use linkdyn, only: linkdyn_scene, linkdyn_run, into, linkdyn_message, linkdyn_ok
    implicit none (type, external)
    type(linkdyn_scene) :: scene
    character(len=1024) :: file
    integer :: code

    if (command_argument_count() /= 1) call give_up("usage: main SCENE")
    call get_command_argument(1, file)
    call scene%open_file(file, code)
    call check(code)
    call find_largest_reactions()
    call simulate()
    call scene%close(code)
    call check(code)

contains

    !> Every call says how it went.
    subroutine check(code)
        integer, intent(in) :: code

        if (code == linkdyn_ok) return
        call give_up(linkdyn_message())
    end subroutine check

    !> One line; `error stop` would write where in the program that is, besides.
    subroutine give_up(why)
        character(len=*), intent(in) :: why

        write (error_unit, "(a)") why
        stop 1, quiet=.true.
    end subroutine give_up

    !> The largest force in each joint over 4 s.
    subroutine find_largest_reactions()
        integer, parameter :: n = 401
        real(c_double), allocatable :: q(:, :), qd(:, :), qdd(:, :), load(:, :, :)
        real(c_double), allocatable, target :: reaction(:, :, :)
        real(c_double) :: t(n)
        integer(c_int) :: status(n)
        integer :: i, j, n_q, n_force

        n_q = scene%count("coordinate")
        n_force = merge(2, 3, scene%count("component") == 3)
        allocate (q(n_q, n), qd(n_q, n), qdd(n_q, n), load(6, scene%count("load"), n))
        allocate (reaction(scene%count("component"), scene%count("joint"), n))
        t = [(4.0_c_double*(i - 1)/(n - 1), i=1, n)]
        call scene%motion(t, q, qd, qdd, load, code)
        call check(code)
        call scene%inverse(q, qd, qdd, load, [into("reaction", reaction)], status, code, threads=2, in_order=.true.)
        call check(code)
        do j = 1, size(reaction, 2)
            print "(a, 1x, g0.10, a)", scene%name("joint", j), &
                maxval(norm2(reaction(:n_force, j, :), dim=1), mask=status == 0), " N"
        end do
    end subroutine find_largest_reactions

    !> A forward run, and back to where it was: the state says where the links are.
    subroutine simulate()
        type(linkdyn_run) :: run
        real(c_double), allocatable :: q(:), qd(:), variable(:)
        real(c_double), target :: energy(1)
        real(c_double) :: t
        integer :: again

        allocate (q(scene%count("coordinate")), qd(scene%count("coordinate")), variable(scene%count("variable")))
        call scene%start(0.0_c_double, run, code)
        call check(code)
        call run%advance(1.0_c_double, code)
        call check(code)
        call run%get_state(t, q, qd, code, variable)
        call check(code)
        do again = 1, 2
            call run%advance(2.0_c_double, code)
            call check(code)
            call run%get_result(into("kinetic_energy", energy), code)
            call check(code)
            print "(a, g0.10, a)", "kinetic energy at 2 s: ", energy(1), " J"
            call run%set_state(t, q, qd, code, variable)
            call check(code)
        end do
        call run%finish(code)
        call check(code)
    end subroutine simulate
end program main
