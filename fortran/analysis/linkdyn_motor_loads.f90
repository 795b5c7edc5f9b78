!> From a driving force to the motor behind a gear or screw: torque, speed, power, current.
!>
!> The motor turns n times as fast as the joint variable s. Of the driving force F the part F' gets to the links, the rest accelerates the
!> rotor. With the efficiency eta while the motor drives (F' s' > 0), and eta_b while the load does,
!>
!>     torque = (F - F')/n + F'/(n eta),    or    (F - F')/n + F' eta_b/n.
!>
!> An eta_b below zero is that of a transmission which locks itself: the motor has to drive the load down, too. A motor slower than `still`
!> stands still, and the torque is F/n: friction then takes up to its share either way.
module linkdyn_motor_loads
    use linkdyn_kinds, only: wp
    use linkdyn_scene, only: motor_spec
    implicit none (type, external)
    private
    public :: motor_torque, is_self_locking, still

    real(wp), parameter :: still = 1.0e-6_wp           !! [rad/s]

contains

    !> Torque of a motor [N m].
    elemental real(wp) function motor_torque(motor, driving_force, transmitted, rate) result(torque)
        type(motor_spec), intent(in) :: motor
        real(wp), intent(in) :: driving_force          !! F [N, N m]
        real(wp), intent(in) :: transmitted            !! F' [N, N m]
        real(wp), intent(in) :: rate                   !! of the joint variable [m/s, rad/s]
        real(wp) :: factor

        factor = 1
        if (abs(motor%ratio*rate) > still) then
            if (transmitted*rate > 0) then
                factor = 1/motor%efficiency
            else if (transmitted*rate < 0) then
                factor = motor%back_efficiency
            end if
        end if
        torque = ((driving_force - transmitted) + transmitted*factor)/motor%ratio
    end function motor_torque

    !> Can the load not drive the motor?
    elemental logical function is_self_locking(motor)
        type(motor_spec), intent(in) :: motor

        is_self_locking = .not. motor%back_efficiency > 0
    end function is_self_locking
end module linkdyn_motor_loads
