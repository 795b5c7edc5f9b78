!> Laws at motors in rates that come from a record: the record takes driving forces, and gives what of them is transmitted and how
!> all that it finds changes with each, so what transmissions lose follows from one run of it (`linkdyn_loss_balance`).
!>
!> Where joints rub, rates are not linear in driving forces: what is lost settles with friction (`linkdyn_recorded_friction`).
module linkdyn_recorded_motors
    use linkdyn_kinds, only: wp
    use linkdyn_loss_balance, only: lossy_samples, renew_losses
    use linkdyn_model, only: model_type
    use linkdyn_recorded_rates, only: recorded_rates, rate_samples, run_rates
    implicit none (type, external)
    private
    public :: settle_losses

contains

    !> Rates of the first n samples, whose laws have been applied, with what is lost taken off. A sample whose transmissions may jam
    !> is left.
    subroutine settle_losses(model, motors, recorded, n, samples)
        type(model_type), intent(in) :: model
        integer, intent(in) :: motors(:)               !! that lose
        type(recorded_rates), intent(in) :: recorded
        integer, intent(in) :: n
        type(rate_samples), intent(inout) :: samples   !! `effort`: in what motors give at their joints, out less what is lost
        type(lossy_samples) :: lossy
        integer :: s

        call look_at_motors(model, motors, n, samples, lossy)
        if (recorded%friction%is_made) then
            call run_rates(recorded, n, samples, laws_are_there=.true., lossy=lossy)
            return
        end if
        call run_rates(recorded, n, samples, laws_are_there=.true.)
        call find_losses(recorded, n, samples, lossy)
        call take_off(recorded, n, lossy%sense*lossy%lost, samples)
        do s = 1, n
            samples%effort(lossy%actuator, s) = lossy%efforts(s)
        end do
    end subroutine settle_losses

    !> What they give, and what part of that is lost on either side; nothing has been lost yet.
    subroutine look_at_motors(model, motors, n, samples, lossy)
        type(model_type), intent(in) :: model
        integer, intent(in) :: motors(:), n
        type(rate_samples), intent(in) :: samples
        type(lossy_samples), intent(out) :: lossy
        real(wp) :: turning(n)                         !! part of what is lost at speed
        integer :: j

        lossy%actuator = model%motor(motors)%actuator
        lossy%given = samples%effort(lossy%actuator, :n)
        allocate (lossy%sense, lossy%driving, lossy%driven, mold=lossy%given)
        allocate (lossy%lost(size(motors), n), source=0.0_wp)
        do j = 1, size(motors)
            associate (motor => model%scene%actuator(lossy%actuator(j))%motor, &
                       rate => samples%measured(samples%n_measure + lossy%actuator(j), :n))
                turning = tanh(abs(motor%ratio*rate)/motor%creep_speed)
                lossy%sense(j, :) = sign(1.0_wp, rate)
                lossy%driving(j, :) = turning*(1/motor%efficiency - 1)
                lossy%driven(j, :) = turning*(1 - motor%back_efficiency)
            end associate
        end do
    end subroutine look_at_motors

    !> What is lost, from what the record found while nothing was.
    subroutine find_losses(recorded, n, samples, lossy)
        type(recorded_rates), intent(in) :: recorded
        integer, intent(in) :: n
        type(rate_samples), intent(inout) :: samples
        type(lossy_samples), intent(inout) :: lossy
        real(wp) :: slope(size(lossy%actuator), size(lossy%actuator)), change
        logical :: is_unique
        integer :: s, i, k

        associate (first => recorded%out%transmitted, n_motor => size(lossy%actuator))
            do s = 1, n
                if (samples%is_left(s)) cycle
                do k = 1, n_motor
                    slope(:, k) = [(samples%found(s, slope_place(recorded, first + i - 1, k)), i=1, n_motor)]
                end do
                call renew_losses(samples%found(s, first:first + n_motor - 1), slope, s, lossy, is_unique, change)
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
