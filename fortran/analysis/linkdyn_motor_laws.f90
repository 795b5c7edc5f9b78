!> From what the law of an actuator gives to the torque of its motor: the torque itself, or the voltage of a direct current motor,
!> whose turning rotor induces a voltage against it; the largest torque that a motor has at a speed; and the brake on its shaft.
module linkdyn_motor_laws
    use linkdyn_kinds, only: wp
    use linkdyn_scene, only: motor_spec, switch_spec, actuator_spec, side_voltage, law_none
    implicit none (type, external)
    private
    public :: torque_of_law, available_torque, brake_torque, is_on, has_winding, current_rate

contains

    !> Torque of a motor: what its law asks for, as far as the motor has it.
    elemental real(wp) function torque_of_law(motor, side, law, speed) result(torque)
        type(motor_spec), intent(in) :: motor
        integer, intent(in) :: side                    !! `side_torque` or `side_voltage`
        real(wp), intent(in) :: law                    !! what it gives [N m, V]
        real(wp), intent(in) :: speed                  !! of the motor [rad/s]
        real(wp) :: largest

        torque = law
        if (side == side_voltage) torque = motor%torque_constant*(law - motor%torque_constant*speed)/motor%resistance
        largest = available_torque(motor, speed, torque)
        ! what is no number stays none
        if (torque > largest) torque = largest
        if (torque < -largest) torque = -largest
    end function torque_of_law

    !> Does the current of a motor follow its voltage late, so that it is a state of forward runs?
    elemental logical function has_winding(actuator)
        type(actuator_spec), intent(in) :: actuator

        has_winding = actuator%law%side == side_voltage .and. actuator%motor%inductance > 0
    end function has_winding

    !> What of the voltage resistance and turning rotor leave makes the current grow. Where that would lead it past what limits
    !> leave of it, the drive cuts the voltage: its current controller leads the current there as fast as it can, in a small part of
    !> the time that the winding takes by itself.
    elemental real(wp) function current_rate(motor, voltage, current, speed) result(rate)
        type(motor_spec), intent(in) :: motor
        real(wp), intent(in) :: voltage, current       !! [V, A]
        real(wp), intent(in) :: speed                  !! of the motor [rad/s]
        real(wp), parameter :: pace = 100              !! of the controller over that of the winding
        real(wp) :: forwards, backwards, along

        rate = (voltage - motor%resistance*current - motor%torque_constant*speed)/motor%inductance
        forwards = available_torque(motor, speed, 1.0_wp)
        if (.not. forwards < huge(forwards)) return
        backwards = available_torque(motor, speed, -1.0_wp)
        along = pace*motor%resistance/motor%inductance
        if (rate > along*(forwards/motor%torque_constant - current)) rate = along*(forwards/motor%torque_constant - current)
        if (rate < along*(-backwards/motor%torque_constant - current)) rate = along*(-backwards/motor%torque_constant - current)
    end function current_rate

    !> The largest torque of a motor at a speed, driving or braking: what its limits leave of it.
    elemental real(wp) function available_torque(motor, speed, wanted) result(torque)
        type(motor_spec), intent(in) :: motor
        real(wp), intent(in) :: speed                  !! [rad/s]
        real(wp), intent(in) :: wanted                 !! torque, for its sign: one against the motion brakes

        torque = huge(torque)
        if (motor%largest_torque > 0) torque = motor%largest_torque
        if (motor%largest_current > 0) torque = min(torque, motor%torque_constant*motor%largest_current)
        if (motor%largest_power > 0) then
            if (torque*abs(speed) > motor%largest_power) torque = motor%largest_power/abs(speed)
        end if
        if (motor%torque_curve%kind /= law_none) torque = min(torque, torque_on_curve(abs(speed), wanted*speed < 0))

    contains

        !> Straight lines between its rows. Beyond the last one nothing drives, but for a steep slope, so that no law jumps there.
        !> What brakes is no less than in the last row that has a torque, however fast: a motor at its top speed can be stopped.
        pure real(wp) function torque_on_curve(at, brakes)
            real(wp), intent(in) :: at
            logical, intent(in) :: brakes
            real(wp), parameter :: slope_share = 0.01_wp    !! of the last speed
            integer :: k, n
            real(wp) :: part

            associate (knot => motor%torque_curve%time, value => motor%torque_curve%knot)
                n = size(knot)
                if (brakes) then
                    k = findloc(value > 0, .true., dim=1, back=.true.)     ! the first row has one
                    if (at >= knot(k)) then
                        torque_on_curve = value(k)
                        return
                    end if
                end if
                if (at >= knot(n)) then
                    torque_on_curve = value(n)*max(0.0_wp, 1 - (at - knot(n))/(slope_share*knot(n)))
                    return
                end if
                k = 1
                do while (at >= knot(k + 1))
                    k = k + 1
                end do
                part = (at - knot(k))/(knot(k + 1) - knot(k))
                torque_on_curve = (1 - part)*value(k) + part*value(k + 1)
            end associate
        end function torque_on_curve
    end function available_torque

    !> What the brake takes of a motor's torque, if there is one and it is on: against the motion, smooth near rest as friction is.
    elemental real(wp) function brake_torque(motor, t, switched, was_on, speed) result(torque)
        type(motor_spec), intent(in) :: motor
        real(wp), intent(in) :: t, switched            !! as of `is_on` [s]
        logical, intent(in) :: was_on
        real(wp), intent(in) :: speed                  !! [rad/s]

        torque = 0
        if (.not. motor%brake%is_given) return
        if (is_on(motor%brake%switch_spec, t, switched, was_on)) torque = motor%brake%torque*tanh(speed/motor%creep_speed)
    end function brake_torque

    !> Is a brake or clutch on? What has happened last counts: that it began so, an instant that has come, an event.
    elemental logical function is_on(switch, t, switched, was_on) result(is)
        type(switch_spec), intent(in) :: switch
        real(wp), intent(in) :: t                      !! [s]
        real(wp), intent(in) :: switched               !! instant of the last event that switched it, at most t; -huge: none did
        logical, intent(in) :: was_on                  !! behind that event
        real(wp) :: last

        is = switch%begins_on
        last = -huge(t)
        if (switched > last) then
            is = was_on
            last = switched
        end if
        if (has_come(switch%from, t) .and. switch%from >= last) then
            is = .true.
            last = switch%from
        end if
        if (has_come(switch%until, t) .and. switch%until >= last) is = .false.
    end function is_on

    !> An instant that is none never comes.
    elemental logical function has_come(instant, t)
        real(wp), intent(in) :: instant, t             !! [s]
        real(wp), parameter :: close = 1.0e-14_wp       !! that is the instant, written in other digits

        has_come = instant < huge(instant) .and. instant <= t + close*abs(t)
    end function has_come
end module linkdyn_motor_laws
