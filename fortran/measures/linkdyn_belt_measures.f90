!> Belts that stretch, on lanes: how far, what their strands pull with, and what that does to the wheels.
module linkdyn_belt_measures
    use linkdyn_joint_rates, only: measure_variable
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state
    use linkdyn_lane_count, only: lanes
    use linkdyn_model, only: model_type
    use linkdyn_scene, only: at_stiffness, at_damping, at_pretension
    implicit none (type, external)
    private
    public :: measure_strands, measure_stretch, strand_energy

contains

    !> Tensions: of the strand that is taut while the first wheel drives forwards, and of the other. A strand does not push.
    subroutine measure_strands(model, i, state, tension)
        type(model_type), intent(in) :: model
        integer, intent(in) :: i                       !! belt
        type(kinematic_state), intent(in) :: state
        real(wp), intent(out) :: tension(lanes, 2)     !! [N]
        real(wp), dimension(lanes) :: stretch, rate, pull

        call measure_stretch(model, i, state, stretch, rate)
        associate (k => model%belt(i)%strand)
            pull = k(at_stiffness)*stretch + k(at_damping)*rate
            tension(:, 1) = max(k(at_pretension) + pull, 0.0_wp)
            tension(:, 2) = max(k(at_pretension) - pull, 0.0_wp)
        end associate
    end subroutine measure_strands

    !> Energy stored in both strands.
    subroutine strand_energy(model, i, state, energy)
        type(model_type), intent(in) :: model
        integer, intent(in) :: i
        type(kinematic_state), intent(in) :: state
        real(wp), intent(out) :: energy(lanes)         !! [J]
        real(wp), dimension(lanes) :: stretch, rate

        call measure_stretch(model, i, state, stretch, rate)
        associate (k => model%belt(i)%strand)
            energy = (max(k(at_pretension) + k(at_stiffness)*stretch, 0.0_wp)**2 &
                      + max(k(at_pretension) - k(at_stiffness)*stretch, 0.0_wp)**2)/(2*k(at_stiffness))
        end associate
    end subroutine strand_energy

    !> How far the wheels have turned against each other along the belt. Its angles are coordinates, or as good.
    subroutine measure_stretch(model, i, state, stretch, rate)
        type(model_type), intent(in) :: model
        integer, intent(in) :: i
        type(kinematic_state), intent(in) :: state
        real(wp), intent(out) :: stretch(lanes), rate(lanes)    !! [m], [m/s]
        real(wp), dimension(lanes) :: angle, speed
        real(wp), parameter :: near(lanes) = 0
        integer :: n

        associate (belt => model%belt(i))
            stretch = belt%gear%total
            rate = 0
            do n = 1, size(belt%joint)
                call measure_variable(model, state, belt%joint(n), 1, near, angle, speed)
                stretch = stretch - belt%weight(n)*angle
                rate = rate - belt%weight(n)*speed
            end do
        end associate
    end subroutine measure_stretch
end module linkdyn_belt_measures
