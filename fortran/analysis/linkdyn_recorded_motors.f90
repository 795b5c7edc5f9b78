!> Laws at motors in rates that come from a record: the record takes driving forces, and gives what of them is transmitted and how all
!> that it finds changes with each, so what transmissions lose follows from one run of it (`linkdyn_loss_balance`).
!>
!> Where joints rub, rates are not linear in driving forces: the record is run again with what has been lost taken off, until
!> that no longer changes.
module linkdyn_recorded_motors
    use linkdyn_contact, only: has_settled, most_rounds
    use linkdyn_kinds, only: wp
    use linkdyn_loss_balance, only: balance_losses
    use linkdyn_model, only: model_type
    use linkdyn_recorded_rates, only: recorded_rates, rate_samples, run_rates
    implicit none (type, external)
    private
    public :: settle_losses

contains

    !> Rates of the first n samples, whose laws have been applied, with what is lost taken off. A sample whose transmissions may jam is left.
    subroutine settle_losses(model, lossy, recorded, n, samples)
        type(model_type), intent(in) :: model
        integer, intent(in) :: lossy(:)                !! motors
        type(recorded_rates), intent(in) :: recorded
        integer, intent(in) :: n
        type(rate_samples), intent(inout) :: samples   !! `effort`: in what motors give at their joints, out less what is lost
        real(wp), dimension(size(lossy), n) :: given, sense, turning, lost
        integer :: at(size(lossy)), j

        at = model%motor(lossy)%actuator
        given = samples%effort(at, :n)
        do j = 1, size(lossy)
            associate (motor => model%scene%actuator(at(j))%motor, rate => samples%measured(samples%n_measure + at(j), :n))
                turning(j, :) = tanh(abs(motor%ratio*rate)/motor%creep_speed)
                sense(j, :) = sign(1.0_wp, rate)
            end associate
        end do
        lost = 0
        call run_rates(recorded, n, samples, laws_are_there=.true.)
        call find_losses(model, at, recorded, n, sense, turning, samples, lost)
        if (recorded%friction%is_made) then
            call go_round(model, at, recorded, n, given, sense, turning, samples, lost)
        else
            call take_off(recorded, n, sense*lost, samples)
        end if
        samples%effort(at, :n) = given - sense*lost
    end subroutine settle_losses

    !> The same where joints rub: until what is lost no longer changes what does. A sample that rests keeps what it has: what becomes of
    !> one does not hang on those beside it.
    subroutine go_round(model, at, recorded, n, given, sense, turning, samples, lost)
        type(model_type), intent(in) :: model
        integer, intent(in) :: at(:)                   !! actuators of the motors
        type(recorded_rates), intent(in) :: recorded
        integer, intent(in) :: n
        real(wp), intent(in), dimension(:, :) :: given, sense, turning     !! (motor, sample)
        type(rate_samples), intent(inout) :: samples
        real(wp), intent(inout) :: lost(:, :)          !! (motor, sample)
        real(wp) :: next(size(at), n), change, change_before(n)
        logical :: rests(n)
        integer :: round, s

        rests = .false.
        change_before = 1                              ! from nothing lost to some
        do round = 1, most_rounds
            samples%effort(at, :n) = given - sense*lost
            call run_rates(recorded, n, samples, laws_are_there=.true.)
            if (all(rests .or. samples%is_left(:n))) return
            next = lost
            call find_losses(model, at, recorded, n, sense, turning, samples, next)
            do s = 1, n
                if (rests(s)) cycle
                change = maxval(abs(next(:, s) - lost(:, s)))/max(maxval(next(:, s)), tiny(1.0_wp))
                rests(s) = has_settled(change, change_before(s))
                lost(:, s) = next(:, s)
                change_before(s) = change
            end do
        end do
        samples%is_left(:n) = .true.
    end subroutine go_round

    !> What is lost, from what the record found while other amounts were: in exchange for these.
    subroutine find_losses(model, at, recorded, n, sense, turning, samples, lost)
        type(model_type), intent(in) :: model
        integer, intent(in) :: at(:)                   !! actuators of the motors
        type(recorded_rates), intent(in) :: recorded
        integer, intent(in) :: n
        real(wp), intent(in) :: sense(:, :)            !! of the joint variable: +1, -1 (motor, sample)
        real(wp), intent(in) :: turning(:, :)          !! part of what is lost at speed (motor, sample)
        type(rate_samples), intent(inout) :: samples
        real(wp), intent(inout) :: lost(:, :)          !! (motor, sample) [N, N m]
        real(wp) :: slope(size(at), size(at)), press(size(at)), driving(size(at)), driven(size(at))
        logical :: is_unique
        integer :: s, i, k

        associate (motor => model%scene%actuator(at)%motor, out => recorded%out)
            do s = 1, n
                if (samples%is_left(s)) cycle
                do k = 1, size(at)
                    do i = 1, size(at)
                        slope(i, k) = -sense(i, s)*sense(k, s) &
                                      *samples%found(s, slope_place(recorded, out%transmitted + i - 1, k))
                    end do
                end do
                press = sense(:, s)*samples%found(s, out%transmitted:out%transmitted + size(at) - 1) - matmul(slope, lost(:, s))
                driving = turning(:, s)*(1/motor%efficiency - 1)
                driven = turning(:, s)*(1 - motor%back_efficiency)
                call balance_losses(size(at), press, slope, driving, driven, lost(:, s), is_unique)
                samples%is_left(s) = .not. is_unique
            end do
        end associate
    end subroutine find_losses

    !> Rates follow driving forces along straight lines.
    pure subroutine take_off(recorded, n, force, samples)
        type(recorded_rates), intent(in) :: recorded
        integer, intent(in) :: n
        real(wp), intent(in) :: force(:, :)            !! lost, along the joint variable (motor, sample) [N, N m]
        type(rate_samples), intent(inout) :: samples
        integer :: i, k

        do k = 1, size(force, 1)
            do i = 1, recorded%out%n_linear
                associate (found => samples%found(:n, i), slope => samples%found(:n, slope_place(recorded, i, k)))
                    samples%found(:n, i) = found - slope*force(k, :n)
                end associate
            end do
        end do
    end subroutine take_off

    !> Where the record tells how one of its linear outputs changes with the driving force of one of the motors.
    pure integer function slope_place(recorded, output, motor) result(place)
        type(recorded_rates), intent(in) :: recorded
        integer, intent(in) :: output, motor

        place = recorded%out%slope + (motor - 1)*recorded%out%n_linear + output - 1
    end function slope_place
end module linkdyn_recorded_motors
