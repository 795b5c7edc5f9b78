!> Turns of joint angles along a batch: at the mean of the rates from sample to sample, and where these do not tell, along the way.
submodule (linkdyn_inverse) linkdyn_inverse_turns
    use linkdyn_result_kinds, only: result_joint_rate, result_joint_variable
    use linkdyn_constants, only: two_pi
    use linkdyn_interrupt, only: is_interrupted
    use linkdyn_assembly_trail, only: begin_trail, reached_anew
    use linkdyn_status, only: sample_ok, sample_unreachable, sample_branch_lost
    use linkdyn_turns, only: turning_angles, list_turning, count_sample, turn_at_mean_rates, keeps_turns, size_of_step, &
        largest_step
    implicit none (type, external)

contains

    module procedure count_turns_about
        type(turning_angles) :: angles
        integer :: i

        call list_turning(model, angles)
        do i = 1, size(variable, 2)
            call count_sample(angles, turns%about(:, i), variable(:, i))
        end do
    end procedure count_turns_about

    module procedure count_turns_on_way
        type(turning_angles) :: angles
        type(inverse_solver) :: solver                     ! of motion alone
        type(inverse_options) :: options
        type(status_type) :: status
        real(wp), dimension(size(variable, 1)) :: about, told, whole    ! whole turns of the last sample, as angles
        logical :: is_sure, has_turned
        integer :: i, last                                 ! sample of this batch; 0: one of the batch before

        call list_turning(model, angles)
        if (size(angles%variable) == 0) return
        last = 0
        whole = 0
        has_turned = .false.
        do i = 1, size(variable, 2)
            if (goes_on_alike(i)) then
                if (has_turned) variable(:, i) = told
                last = i
                cycle
            end if
            if (.not. all(abs(variable(:, i)) + abs(rate(:, i)) <= huge(1.0_wp))) cycle
            about = 0
            if (goes_by_quaternion(i)) then
                ! rates of angles do not tell the way there: an angle is within half a turn of the one before
            else if (turns%has_begun .and. any(angles%coordinate == 0) .and. .not. is_anew(assembly, i)) then
                if (last > 0) then
                    call turn_at_mean_rates(angles, q(:, last), q(:, i), qd(:, last), qd(:, i), rate(:, last), rate(:, i), &
                                            variable(:, last), variable(:, i), about, is_sure)
                else
                    call turn_at_mean_rates(angles, turns%q, q(:, i), turns%qd, qd(:, i), turns%rate, rate(:, i), &
                                            turns%before, variable(:, i), about, is_sure)
                end if
                if (.not. (is_sure .or. is_interrupted())) call look_closer(i)
            end if
            if (last > 0) then
                about = variable(:, last) + about
            else if (turns%has_begun) then
                about = turns%before + about
            end if
            told = variable(:, i)
            call count_sample(angles, about, variable(:, i), q(:, i))
            whole = two_pi*anint((variable(:, i) - told)/two_pi)
            has_turned = any(whole /= 0)
            turns%has_begun = .true.
            last = i
        end do
        call come_to_last()
        if (solver%is_prepared()) call solver%free()

    contains

        !> Has a sample surely the turns of the last one, as nearly always?
        logical function goes_on_alike(i)
            integer, intent(in) :: i

            goes_on_alike = .false.
            if (last == 0) return
            if (goes_by_quaternion(i) .or. is_anew(assembly, i)) return
            told = variable(:, i) + whole
            goes_on_alike = keeps_turns(angles, q(:, last), q(:, i), qd(:, last), qd(:, i), rate(:, last), rate(:, i), &
                                        variable(:, last), told)
        end function goes_on_alike

        !> Does a sample, or the one before?
        logical function goes_by_quaternion(i)
            integer, intent(in) :: i

            goes_by_quaternion = turned(i)
            if (last > 0) then
                goes_by_quaternion = goes_by_quaternion .or. turned(last)
            else
                goes_by_quaternion = goes_by_quaternion .or. turns%by_quaternion
            end if
        end function goes_by_quaternion

        !> Along the way from the last sample.
        subroutine look_closer(i)
            integer, intent(in) :: i

            if (.not. solver%is_prepared()) then
                options%wants_forces = .false.
                options%by_record = .false.
                call prepare_inverse(model, options, .false., solver, status)
                call step_alike()
            end if
            call come_to_last()
            call turn_on_way(model, solver, angles, turns, q(:, i), about)
        end subroutine look_closer

        !> Groups are led as they were from sample to sample, if programs were made for that.
        subroutine step_alike()
            if (.not. associated(closing)) return
            if (.not. closing%is_tried) return
            solver%places%closing => closing               ! which is somebody else's
            solver%n_expected = worth_closing
        end subroutine step_alike

        subroutine come_to_last()
            if (last == 0) return
            turns%before = variable(:, last)
            turns%rate = rate(:, last)
            turns%q = q(:, last)
            turns%qd = qd(:, last)
            turns%by_quaternion = turned(last)
            if (.not. allocated(assembly%branch)) return
            turns%branch = assembly%branch(:, last)
            if (.not. allocated(assembly%place)) return
            turns%set_out = assembly%q(:, last)
            turns%place = assembly%place(:, :, last)
        end subroutine come_to_last
    end procedure count_turns_on_way

    !> Was a sample reached from elsewhere than the last one?
    pure logical function is_anew(assembly, i)
        type(sample_assembly), intent(in) :: assembly
        integer, intent(in) :: i

        is_anew = .false.
        if (allocated(assembly%reached)) is_anew = assembly%reached(i) == reached_anew
    end function is_anew

    !> How far angles turn on the straight way from the last sample, in pieces as short as need be. Where no pieces tell, 0: what is
    !> nearest is taken.
    !>
    !> If some pieces do not tell, the next ones are as short as the fastest angle of these asks for. Work is bounded: by the number
    !> of pieces, by the patience with one way (a way that ends is not gone in pieces again and again), and, after many looks in
    !> vain, as along a motion that rushes through everything, by looking closely at a few samples only until one tells.
    subroutine turn_on_way(model, solver, angles, from, to, turned)
        type(model_type), intent(in) :: model
        type(inverse_solver), intent(in) :: solver
        type(turning_angles), intent(in) :: angles
        type(turn_count), intent(inout) :: from
        real(wp), intent(in) :: to(:)                      !! (n_q)
        real(wp), intent(out) :: turned(:)                 !! (n_variable) [rad]
        integer, parameter :: most = 4096                  !! pieces: in a quarter turn one of these turns an angle by less than a
                                                           !! quarter turn wherever rates of 4000 are not exceeded
        integer, parameter :: few = 64                     !! pieces of a look that is expected to be in vain
        integer, parameter :: many = 16                    !! looks in vain, after which one in so many is a close one
        integer, parameter :: finer = 16                   !! times as many pieces, where the way was too long for those before
        real(wp) :: n_piece, n_told
        logical :: is_sure, has_ended, ended_before
        integer :: n, longest

        turned = 0
        longest = most
        if (from%n_in_vain >= many .and. modulo(from%n_in_vain, many) > 0) longest = few
        from%n_in_vain = from%n_in_vain + 1
        n_piece = 2*size_of_step(angles, to - from%q)/largest_step
        if (.not. n_piece <= longest) return           ! a way so long, or to no place at all
        n = 2*ceiling(n_piece/2)
        has_ended = .false.
        do
            ended_before = has_ended
            from%n_piece = from%n_piece + n
            call turn_in_pieces(model, solver, angles, from, to, n, turned, is_sure, has_ended, n_told)
            if (is_sure .or. 2*n > longest .or. (has_ended .and. ended_before) .or. is_interrupted()) exit
            if (.not. n_told > 0) n_told = real(finer, wp)*n
            n = 2*ceiling(min(max(2.0_wp*n, n_told), real(longest, wp))/2)
        end do
        if (is_sure) then
            from%n_in_vain = 0
        else
            turned = 0
        end if
    end subroutine turn_on_way

    !> The same in so many pieces. Places in between at which the motion is not known are left out. Where pieces do not tell:
    !> whether the way ends, and how many pieces turn no angle by more than a quarter turn each, by the rates where it has been (0:
    !> it is too long a way to get to its end in so few pieces).
    subroutine turn_in_pieces(model, solver, angles, from, to, n, turned, is_sure, has_ended, n_told)
        type(model_type), intent(in) :: model
        type(inverse_solver), intent(in) :: solver
        type(turning_angles), intent(in) :: angles
        type(turn_count), intent(in) :: from
        real(wp), intent(in) :: to(:)                      !! (n_q)
        integer, intent(in) :: n
        real(wp), intent(out) :: turned(:)                 !! (n_variable) [rad]
        logical, intent(out) :: is_sure, has_ended
        real(wp), intent(out) :: n_told
        real(wp), dimension(model%n_q, 0:n), target :: q, qd, qdd
        real(wp), dimension(model%n_variable, 0:n), target :: variable, rate
        integer, target :: status(0:n)
        real(wp), target :: load(6, model%n_load, 0:n)
        real(wp) :: piece(size(turned))
        type(inverse_results) :: results
        type(assembly_trail) :: trail
        logical :: is_piece_sure
        integer :: i, last

        do i = 0, n
            q(:, i) = from%q + (to - from%q)*(real(i, wp)/n)
        end do
        q(:, n) = to
        qd = spread(to - from%q, 2, n + 1)
        qdd = 0
        load = 0
        call results%put(result_joint_variable, variable)
        call results%put(result_joint_rate, rate)
        results%status(1:n + 1) => status
        if (allocated(from%branch)) then
            call begin_trail(model, trail)
            trail%q = from%q
            trail%branch = from%branch
            if (allocated(from%place)) then
                trail%q = from%set_out
                trail%place = from%place
            end if
            trail%stays = .true.
        end if
        call run_prepared(model, solver, 1, motion_of(q, qd, qdd, load), results, trail=trail)
        turned = 0
        n_told = 0
        last = 0
        has_ended = any(status(n) == [sample_unreachable, sample_branch_lost])
        is_sure = all(status([0, n]) == sample_ok)
        if (.not. is_sure) return
        do i = 1, n
            if (status(i) /= sample_ok) cycle
            call turn_at_mean_rates(angles, q(:, last), q(:, i), qd(:, last), qd(:, i), rate(:, last), rate(:, i), &
                                    variable(:, last), variable(:, i), piece, is_piece_sure)
            is_sure = is_sure .and. is_piece_sure
            turned = turned + piece
            n_told = max(n_told, n*maxval(abs(piece))/largest_step)
            last = i
        end do
    end subroutine turn_in_pieces
end submodule linkdyn_inverse_turns
