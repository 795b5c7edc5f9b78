!> From a driving force to the motor behind a gear or screw: torque, speed, power, current, and what the transmission loses.
!>
!> The motor turns n times as fast as the joint variable s. Of the driving force F the part F' gets to the links, the rest
!> accelerates the rotor, and the motor gives what friction in the transmission takes besides: n T = F + R. With the efficiency eta
!> while the motor drives (F' s' > 0), and eta_b while the load does,
!>
!>     R = F' (1/eta - 1),    or    F' (eta_b - 1).
!>
!> An eta_b below zero is that of a transmission which locks itself: the motor has to drive the load down, too. A motor slower than
!> `still` stands still, and R is zero: friction then takes up to its share either way. In forward runs by laws at the motor R goes
!> to zero as tanh(n s'/creep), as the motion has it there (`linkdyn_transmission_losses`).
module linkdyn_motor_loads
    use linkdyn_kinds, only: wp
    use linkdyn_scene, only: motor_spec
    implicit none (type, external)
    private
    public :: motor_torque, transmission_friction, is_self_locking

    real(wp), parameter :: still = 1.0e-6_wp           !! [rad/s]

contains

    !> Torque of a motor [N m].
    elemental real(wp) function motor_torque(motor, driving_force, transmitted, rate) result(torque)
        type(motor_spec), intent(in) :: motor
        real(wp), intent(in) :: driving_force          !! F [N, N m]
        real(wp), intent(in) :: transmitted            !! F' [N, N m]
        real(wp), intent(in) :: rate                   !! of the joint variable [m/s, rad/s]

        torque = (driving_force + transmission_friction(motor, transmitted, rate))/motor%ratio
    end function motor_torque

    !> R: what friction in the transmission takes, at the joint variable [N, N m].
    elemental real(wp) function transmission_friction(motor, transmitted, rate) result(friction)
        type(motor_spec), intent(in) :: motor
        real(wp), intent(in) :: transmitted            !! F' [N, N m]
        real(wp), intent(in) :: rate                   !! of the joint variable [m/s, rad/s]

        friction = 0
        if (transmitted*rate > 0) then
            friction = transmitted*(1/motor%efficiency - 1)
        else if (transmitted*rate < 0) then
            friction = transmitted*(motor%back_efficiency - 1)
        end if
        associate (speed => abs(motor%ratio*rate))
            if (motor%creeps) then
                friction = friction*tanh(speed/motor%creep_speed)
            else if (.not. speed > still) then
                friction = 0
            end if
        end associate
    end function transmission_friction

    !> Can the load not drive the motor?
    elemental logical function is_self_locking(motor)
        type(motor_spec), intent(in) :: motor

        is_self_locking = .not. motor%back_efficiency > 0
    end function is_self_locking
end module linkdyn_motor_loads
