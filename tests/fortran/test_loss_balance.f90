!> linkdyn_loss_balance: what several transmissions lose, against all sides that the powers might be on, tried one by one.
module test_loss_balance
    use linkdyn_kinds, only: wp
    use linkdyn_loss_balance, only: balance_losses
    use linkdyn_test_numbers, only: random_stream, dense_solution, eps
    use linkdyn_testing, only: test_error, unit_test, new_test, check, check_close
    use linkdyn_text, only: to_text
    implicit none (type, external)
    private
    public :: collect_loss_balance

    integer, parameter :: most = 6

contains

    subroutine collect_loss_balance(tests)
        type(unit_test), allocatable, intent(out) :: tests(:)

        tests = [ &
            new_test("one transmission by hand", test_one), &
            new_test("one solution where none locks itself", test_unique), &
            new_test("self-locking ones that cannot jam", test_self_locking), &
            new_test("nothing is transmitted", test_nothing), &
            new_test("no number is no answer", test_no_number)]
    end subroutine collect_loss_balance

    !> p (1 + h a) = p0 or p (1 - h b) = p0; with h b beyond one there are two solutions for p0 > 0, none for p0 < 0.
    subroutine test_one(error)
        type(test_error), intent(inout) :: error
        real(wp), parameter :: h = 0.8_wp, a = 1.5_wp
        real(wp) :: lost(1)
        logical :: is_unique

        call balance_losses(1, [11.0_wp], reshape([-h], [1, 1]), [a], [0.5_wp], lost, is_unique)
        call check(error, is_unique, "the motor drives")
        call check_close(error, lost, [a*11/(1 + h*a)], 4*eps*10, "lost while the motor drives")
        call balance_losses(1, [-6.0_wp], reshape([-h], [1, 1]), [a], [0.5_wp], lost, is_unique)
        call check(error, is_unique, "the load drives")
        call check_close(error, lost, [0.5_wp*6/(1 - h*0.5_wp)], 4*eps*10, "lost while the load drives")
        call balance_losses(1, [-6.0_wp], reshape([-h], [1, 1]), [a], [1.2_wp], lost, is_unique)
        call check(error, is_unique, "self-locking, its rotor heavy enough")
        call check_close(error, lost, [1.2_wp*6/(1 - h*1.2_wp)], 100*eps*180, "lost there")
        call balance_losses(1, [-6.0_wp], reshape([-h], [1, 1]), [a], [1.3_wp], lost, is_unique)
        call check(error, .not. is_unique, "it jams: no solution")
        call balance_losses(1, [6.0_wp], reshape([-h], [1, 1]), [a], [1.3_wp], lost, is_unique)
        call check(error, .not. is_unique, "it may jam: two solutions")
    end subroutine test_one

    subroutine test_unique(error)
        type(test_error), intent(inout) :: error

        call try_many(error, 0.98_wp, n_least=1200)
    end subroutine test_unique

    subroutine test_self_locking(error)
        type(test_error), intent(inout) :: error

        call try_many(error, 1.6_wp, n_least=200)
    end subroutine test_self_locking

    subroutine try_many(error, most_driven, n_least)
        type(test_error), intent(inout) :: error
        real(wp), intent(in) :: most_driven            !! largest share lost while loads drive
        integer, intent(in) :: n_least                 !! of all systems have one solution, for sure
        integer, parameter :: n_system = 200
        type(random_stream) :: stream
        real(wp) :: slope(most, most), press(most), driving(most), driven(most), lost(most), found(most)
        integer :: n, k, n_found, n_unique
        logical :: is_unique

        n_unique = 0
        do n = 1, most
            do k = 1, n_system
                call make_slope(stream, n, slope(:n, :n))
                press(:n) = stream%vector(n)
                driving(:n) = 1.5_wp*(1 + stream%vector(n))
                driven(:n) = most_driven*(1 + stream%vector(n))/2
                call balance_losses(n, press(:n), slope(:n, :n), driving(:n), driven(:n), lost(:n), is_unique)
                if (.not. is_unique) cycle
                n_unique = n_unique + 1
                call try_all_sides(n, press(:n), slope(:n, :n), driving(:n), driven(:n), found(:n), n_found)
                call check(error, n_found == 1, "solutions: "//to_text(n_found))
                call check_close(error, lost(:n), found(:n), 1.0e6_wp*eps*maxval(found(:n)), "lost")
            end do
        end do
        call check(error, n_unique >= n_least, "sure of "//to_text(n_unique))
    end subroutine try_many

    !> S = I W - 1, seen in random directions of motion; some rotors are without inertia.
    subroutine make_slope(stream, n, slope)
        type(random_stream), intent(inout) :: stream
        integer, intent(in) :: n
        real(wp), intent(out) :: slope(n, n)
        real(wp) :: root(n, n), mass(n, n), rotor(n), sense(n), unit(n)
        integer :: i

        do i = 1, n
            root(:, i) = stream%vector(n)
        end do
        rotor = max(stream%vector(n), 0.0_wp)
        sense = sign(1.0_wp, stream%vector(n))
        mass = matmul(root, transpose(root))
        do i = 1, n
            mass(i, i) = mass(i, i) + 0.1_wp + rotor(i)
        end do
        do i = 1, n
            unit = 0
            unit(i) = 1
            slope(:, i) = sense*sense(i)*(rotor*dense_solution(mass, unit) - unit)
        end do
    end subroutine make_slope

    !> What is lost on whichever sides the powers fit the sides that they are taken for.
    subroutine try_all_sides(n, press, slope, driving, driven, lost, n_found)
        integer, intent(in) :: n
        real(wp), intent(in) :: press(n), slope(n, n), driving(n), driven(n)
        real(wp), intent(out) :: lost(n)
        integer, intent(out) :: n_found
        real(wp) :: matrix(n, n), share(n), p(n)
        integer :: sides, i

        n_found = 0
        do sides = 0, 2**n - 1
            share = merge(driving, -driven, [(btest(sides, i - 1), i=1, n)])
            do i = 1, n
                matrix(:, i) = -slope(:, i)*share(i)
                matrix(i, i) = matrix(i, i) + 1
            end do
            p = dense_solution(matrix, press)
            if (.not. all((p > 0) .eqv. [(btest(sides, i - 1), i=1, n)])) cycle
            n_found = n_found + 1
            lost = share*p
        end do
    end subroutine try_all_sides

    subroutine test_nothing(error)
        type(test_error), intent(inout) :: error
        real(wp), parameter :: slope(2, 2) = reshape([-0.5_wp, 0.1_wp, 0.1_wp, -0.5_wp], [2, 2])
        real(wp) :: lost(2)
        logical :: is_unique

        call balance_losses(2, [0.0_wp, 0.0_wp], slope, [1.0_wp, 1.0_wp], [0.9_wp, 0.9_wp], lost, is_unique)
        call check(error, is_unique .and. all(abs(lost) <= 0), "nothing is lost")
        ! the second stands on the border between both sides
        call balance_losses(2, [1.0_wp, -0.1_wp/1.5_wp], slope, [1.0_wp, 1.0_wp], [0.9_wp, 0.9_wp], lost, is_unique)
        call check(error, is_unique, "a border is no obstacle")
        call check_close(error, lost, [1/1.5_wp, 0.0_wp], 16*eps, "lost there")
    end subroutine test_nothing

    subroutine test_no_number(error)
        type(test_error), intent(inout) :: error
        real(wp), parameter :: slope(2, 2) = reshape([-0.5_wp, 0.1_wp, 0.1_wp, -0.5_wp], [2, 2])
        real(wp) :: lost(2), nothing
        logical :: is_unique

        nothing = 0
        call balance_losses(2, [1.0_wp, 1.0_wp], slope*(nothing/nothing), [1.0_wp, 1.0_wp], [0.9_wp, 0.9_wp], lost, is_unique)
        call check(error, .not. is_unique, "not sure")
    end subroutine test_no_number
end module test_loss_balance
