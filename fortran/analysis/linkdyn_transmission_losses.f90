!> What gears and screws lose where the motor's torque is given, on lanes.
!>
!> Of the force n T that the motor of torque T gives at the joint variable s, and of which its rotor takes I s'', friction in the
!> transmission takes R against the motion, and F' = n T - R - I s'' gets to the links. An efficiency says how large R is by what is
!> transmitted,
!>
!>     R = c |F'| tanh(n s'/creep),   c = 1/eta - 1 while the motor drives (F' s' > 0),   1 - eta_b while the load does,
!>
!> so it is one more friction that comes from the forces it changes: `linkdyn_equations` finds it together with that of joints. A
!> drive is a contact of the form `form_drive` there, pressed by F' in the direction of the motion; its `factor` is |tanh|, its
!> `amount` |R|.
module linkdyn_transmission_losses
    use linkdyn_contact, only: contact_type, form_drive
    use linkdyn_friction_state, only: friction_state
    use linkdyn_kinds, only: wp
    use linkdyn_model, only: model_type
    implicit none (type, external)
    private
    public :: contacts_of_motors, begin_losses, press_losses, apply_losses

contains

    !> Transmissions of motors as contacts.
    pure function contacts_of_motors(model, lossy) result(contact)
        type(model_type), intent(in) :: model
        integer, intent(in) :: lossy(:)
        type(contact_type) :: contact(size(lossy))
        integer :: i

        do i = 1, size(lossy)
            associate (motor => model%scene%actuator(model%motor(lossy(i))%actuator)%motor)
                contact(i)%form = form_drive
                contact(i)%joint = model%motor(lossy(i))%joint
                contact(i)%coulomb = 1/motor%efficiency - 1
                contact(i)%static = 1 - motor%back_efficiency
            end associate
        end do
    end function contacts_of_motors

    !> How the motors turn; nothing is lost yet.
    pure subroutine begin_losses(model, lossy, rate, friction, sense)
        type(model_type), intent(in) :: model
        integer, intent(in) :: lossy(:)
        real(wp), intent(in) :: rate(:, :)             !! of the driven joint variables (lane, n_actuator) [m/s, rad/s]
        type(friction_state), intent(inout) :: friction
        real(wp), intent(out) :: sense(:, :)           !! of the joint variable: +1, -1 (lane, lossy motor)
        integer :: i, k

        do i = 1, size(lossy)
            k = size(friction%factor, 2) - size(lossy) + i
            associate (a => model%motor(lossy(i))%actuator)
                associate (motor => model%scene%actuator(a)%motor)
                    friction%factor(:, k) = tanh(abs(motor%ratio*rate(:, a))/motor%creep_speed)
                end associate
                sense(:, i) = sign(1.0_wp, rate(:, a))
            end associate
            friction%amount(:, k) = 0
        end do
    end subroutine begin_losses

    !> What is transmitted, in the direction of the motion.
    pure subroutine press_losses(model, lossy, sense, transmitted, friction)
        type(model_type), intent(in) :: model
        integer, intent(in) :: lossy(:)
        real(wp), intent(in) :: sense(:, :)
        real(wp), intent(in) :: transmitted(:, :)      !! of driving forces, less what is lost and what rotors take (lane,
                                                       !! n_actuator)
        type(friction_state), intent(inout) :: friction
        integer :: i, k

        do i = 1, size(lossy)
            k = size(friction%factor, 2) - size(lossy) + i
            friction%press(:, :, k) = 0
            friction%press(:, 7, k) = sense(:, i)*transmitted(:, model%motor(lossy(i))%actuator)
        end do
    end subroutine press_losses

    !> Driving forces of these motors: what they give, less what is lost.
    pure subroutine apply_losses(model, lossy, sense, friction, motor_force, driving_force)
        type(model_type), intent(in) :: model
        integer, intent(in) :: lossy(:)
        real(wp), intent(in) :: sense(:, :)
        type(friction_state), intent(in) :: friction
        real(wp), intent(in) :: motor_force(:, :)      !! n T (lane, n_actuator) [N, N m]
        real(wp), intent(inout) :: driving_force(:, :) !! (lane, n_actuator)
        integer :: i

        do i = 1, size(lossy)
            associate (a => model%motor(lossy(i))%actuator)
                driving_force(:, a) = motor_force(:, a) - sense(:, i)*friction%amount(:, size(friction%factor, 2) - size(lossy) + i)
            end associate
        end do
    end subroutine apply_losses
end module linkdyn_transmission_losses
