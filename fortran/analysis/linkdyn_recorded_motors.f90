!> Laws at motors in rates that come from a record: the record takes driving forces and gives what of them is transmitted, linear in
!> each other, so what transmissions lose is found from a few runs of it, as the lanes find it from a few solutions of their equations
!> (`linkdyn_transmission_losses`): one as it is, one for each transmission, and the caller's with what was found.
module linkdyn_recorded_motors
    use linkdyn_contact, only: contact_type, n_press
    use linkdyn_friction_balance, only: balance_friction
    use linkdyn_kinds, only: wp
    use linkdyn_model, only: model_type
    use linkdyn_recorded_rates, only: recorded_rates, rate_samples, run_rates
    use linkdyn_transmission_losses, only: lossy_motors
    implicit none (type, external)
    private
    public :: motors_can_be_recorded, settle_losses

contains

    !> Can a record serve the scene's laws at motors, if there are any?
    pure logical function motors_can_be_recorded(model) result(can)
        type(model_type), intent(in) :: model

        can = .true.
        ! friction in joints would not be linear in driving forces
        if (size(model%contact) > 0) can = size(lossy_motors(model, spread(.true., 1, model%n_actuator))) == 0
    end function motors_can_be_recorded

    !> Take what is lost off the driving forces of the first n samples, whose laws have been applied. A sample whose transmission jams is left.
    subroutine settle_losses(model, lossy, contact, recorded, n, samples)
        type(model_type), intent(in) :: model
        integer, intent(in) :: lossy(:)                !! motors
        type(contact_type), intent(in) :: contact(:)   !! their transmissions
        type(recorded_rates), intent(in) :: recorded
        integer, intent(in) :: n
        type(rate_samples), intent(inout) :: samples   !! `effort`: in what motors give at their joints, out less what is lost
        real(wp), dimension(size(lossy), n) :: factor, sense, given, press, unit
        real(wp) :: slope(size(lossy), size(lossy), n), felt(n_press, size(lossy)), response(n_press, size(lossy), size(lossy))
        real(wp) :: amount(size(lossy))
        integer :: j, s, holding, at(size(lossy))

        at = model%motor(lossy)%actuator
        do j = 1, size(lossy)
            associate (motor => model%scene%actuator(at(j))%motor, rate => samples%measured(samples%n_measure + at(j), :n))
                factor(j, :) = tanh(abs(motor%ratio*rate)/motor%creep_speed)
                sense(j, :) = sign(1.0_wp, rate)
            end associate
        end do
        given = samples%effort(at, :n)
        call run_rates(recorded, n, samples, laws_are_there=.true.)
        if (all(samples%is_left(:n))) return
        press = pressing()
        do j = 1, size(lossy)
            ! about as much as there is, for the digits' sake
            unit(j, :) = max(maxval(abs(press), dim=1), tiny(1.0_wp))
            samples%effort(at(j), :n) = given(j, :) - sense(j, :)*unit(j, :)
            call run_rates(recorded, n, samples, laws_are_there=.true.)
            samples%effort(at(j), :n) = given(j, :)
            slope(:, j, :) = (pressing() - press)/spread(unit(j, :), 1, size(lossy))
        end do
        felt = 0
        response = 0
        do s = 1, n
            if (samples%is_left(s)) cycle
            felt(n_press, :) = press(:, s)
            response(n_press, :, :) = slope(:, :, s)
            call balance_friction(contact, factor(:, s), felt, response, amount, holding)
            if (holding > 0) samples%is_left(s) = .true.
            samples%effort(at, s) = given(:, s) - sense(:, s)*amount
        end do

    contains

        !> What is transmitted, in the direction of the motion, at the forces tried last.
        function pressing() result(press)
            real(wp) :: press(size(lossy), n)

            press = sense*transpose(samples%found(:n, recorded%out%transmitted + at - 1))
        end function pressing
    end subroutine settle_losses
end module linkdyn_recorded_motors
