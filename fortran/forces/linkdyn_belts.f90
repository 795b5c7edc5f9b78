!> Belts that stretch: two strands, each a spring with a damper that cannot push, between two wheels.
!>
!> With s how far the wheels have turned against each other along the belt, strands carry T0 + k s + d s' and T0 - k s - d s', or
!> nothing where that is below zero. Their difference turns the wheels, their sum draws the shafts together.
module linkdyn_belts
    use linkdyn_acting, only: acting_type, turned
    use linkdyn_kinds, only: wp
    use linkdyn_joint_variables, only: one_variable, variable_rate
    use linkdyn_mechanism, only: mechanism_type, belt_wrench, strand_numbers, belt_total, belt_weights, &
        marker_point
    use linkdyn_scene, only: at_stiffness, at_damping, at_pretension
    use linkdyn_value, only: value, zero, operator(+), operator(-), operator(*), operator(/), max, square
    use linkdyn_vector, only: vector, components, operator(+), operator(*)
    implicit none (type, external)
    private
    public :: apply_belt, belt_energy, strand_forces, belt_reaction

contains

    !> What a belt does to both of its wheels.
    function apply_belt(mechanism, i) result(acting)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: i
        type(acting_type) :: acting(2)
        type(value) :: tension(2), difference, total
        type(vector) :: pull, couple, line, lever
        integer :: side

        tension = strand_forces(mechanism, i)
        associate (gear => mechanism%model%belt(i)%gear)
            do side = 1, 2
                call belt_wrench(mechanism, i, side, pull, couple, line, lever)
                difference = tension(1) - tension(2)
                total = tension(1) + tension(2)
                if (side == 1) then
                    difference = -difference
                    total = -total
                end if
                acting(side)%link = mechanism%model%joint(gear%joint)%link(side)
                acting(side)%point = marker_point(mechanism, gear%joint, side)
                acting(side)%turning = mechanism%bodies%body(gear%carrier)%turning
                acting(side)%force = difference*pull + total*line
                acting(side)%moment = difference*couple + total*lever
            end do
        end associate
    end function apply_belt

    !> Force and moment on the second wheel, about its marker, world axes [N, N m].
    function belt_reaction(mechanism, i) result(r)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: i
        type(value) :: r(6)
        type(acting_type) :: acting(2)

        acting = apply_belt(mechanism, i)
        r(:3) = components(turned(mechanism%bodies, acting(2)%force, acting(2)%turning, 0))
        r(4:) = components(turned(mechanism%bodies, acting(2)%moment, acting(2)%turning, 0))
    end function belt_reaction

    !> Tensions: of the strand that is taut while the first wheel drives forwards, and of the other [N].
    function strand_forces(mechanism, i) result(tension)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: i
        type(value) :: tension(2)
        type(value) :: stretch, rate, pull
        type(value) :: k(3)

        k = strand_numbers(mechanism, i)
        call measure_stretch(mechanism, i, stretch, rate)
        pull = k(at_stiffness)*stretch + k(at_damping)*rate
        tension(1) = max(k(at_pretension) + pull, zero())
        tension(2) = max(k(at_pretension) - pull, zero())
    end function strand_forces

    !> Energy stored in both strands [J].
    function belt_energy(mechanism, i) result(energy)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: i
        type(value) :: energy
        type(value) :: stretch, rate, pull
        type(value) :: k(3)

        k = strand_numbers(mechanism, i)
        call measure_stretch(mechanism, i, stretch, rate)
        pull = k(at_stiffness)*stretch
        energy = (square(max(k(at_pretension) + pull, zero())) + square(max(k(at_pretension) - pull, zero()))) &
                 /(2.0_wp*k(at_stiffness))
    end function belt_energy

    !> How far the wheels have turned against each other along the belt, and how fast [m, m/s].
    subroutine measure_stretch(mechanism, i, stretch, rate)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: i
        type(value), intent(out) :: stretch, rate
        integer :: n

        stretch = belt_total(mechanism, i)
        rate = zero()
        associate (joint => mechanism%model%belt(i)%joint, weight => belt_weights(mechanism, i))
            do n = 1, size(joint)
                stretch = stretch - weight(n)*one_variable(mechanism, joint(n), 1)
                rate = rate - weight(n)*variable_rate(mechanism, joint(n), 1)
            end do
        end associate
    end subroutine measure_stretch
end module linkdyn_belts
