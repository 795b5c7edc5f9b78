!> Rotors of motors behind gears and screws.
!>
!> A rotor of inertia J that turns n times as fast as a joint variable s has the energy n^2 J s'^2/2; what its acceleration takes of
!> the driving force is n^2 J s''.
module linkdyn_rotor_forces
    use linkdyn_joint_variables, only: variable_rate, variable_acceleration
    use linkdyn_kinds, only: wp
    use linkdyn_mechanism, only: mechanism_type
    use linkdyn_value, only: value, operator(*)
    implicit none (type, external)
    private
    public :: rotor_force, rotor_energy, rotor_power

contains

    !> What the rotor of motor i takes.
    function rotor_force(mechanism, i) result(force)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: i
        type(value) :: force                           !! [N, N m]

        associate (motor => mechanism%model%motor(i))
            force = inertia(mechanism, i)*variable_acceleration(mechanism, motor%joint, motor%variable)
        end associate
    end function rotor_force

    function rotor_energy(mechanism, i) result(energy)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: i
        type(value) :: energy                          !! [J]
        type(value) :: rate

        associate (motor => mechanism%model%motor(i))
            rate = variable_rate(mechanism, motor%joint, motor%variable)
        end associate
        energy = 0.5_wp*(inertia(mechanism, i)*(rate*rate))
    end function rotor_energy

    !> Power by which the energy of the rotor grows.
    function rotor_power(mechanism, i) result(power)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: i
        type(value) :: power                           !! [W]

        associate (motor => mechanism%model%motor(i))
            power = rotor_force(mechanism, i)*variable_rate(mechanism, motor%joint, motor%variable)
        end associate
    end function rotor_power

    !> At the joint variable [kg, kg m2].
    function inertia(mechanism, i)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: i
        type(value) :: inertia

        inertia = mechanism%number(mechanism%at%motor(i))
    end function inertia
end module linkdyn_rotor_forces
