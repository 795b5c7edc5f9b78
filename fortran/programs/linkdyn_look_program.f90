!> The program that looks at the states in which steps end: from coordinates, their rates and accelerations to all that steps are
!> judged by. It takes nothing that acts.
module linkdyn_look_program
    use linkdyn_bodies, only: world_axes, omega_of, alpha_of
    use linkdyn_inputs, only: trace_request, sample_set
    use linkdyn_joint_variables, only: one_variable, variable_rate, variable_acceleration
    use linkdyn_margins, only: assembly_margins
    use linkdyn_model, only: model_type
    use linkdyn_motion_quantities, only: link_energy, gravity_energy
    use linkdyn_record, only: record_type, open_record, close_record
    use linkdyn_scene_program, only: scene_program, output_list, add_output, make_scene_program
    use linkdyn_substitution, only: substitution, replace, substituted
    use linkdyn_trace, only: traced_type, trace_motion, alarm_of, reach_of
    use linkdyn_value, only: value, zero, one, operator(+)
    use linkdyn_vector, only: components
    implicit none (type, external)
    private
    public :: look_choice, look_outputs, make_look_program, out_looks

    integer, parameter :: out_looks = 105      !! all that the program gives, in the order of `look_outputs`
    integer, parameter :: the_one = 1          !! variable of a joint with one axis

    !> What is looked at beside energies and margins.
    type :: look_choice
        integer, allocatable :: joint(:)               !! with one axis, whose rate and acceleration are wanted
        integer, allocatable :: link(:)                !! whose angular velocity and acceleration are wanted
        integer, allocatable :: compared(:, :)         !! joint and place of variables whose rates by coordinates are wanted (2,
                                                       !! variable)
        integer, allocatable :: coordinate(:)          !! by a unit rate of each of these
        integer, allocatable :: angle(:, :)            !! joint and place of joint angles that are wanted with their rates (2,
                                                       !! angle)
    end type look_choice

    !> Where everything begins among the outputs of a sample. What tells assemblies and energies comes first, and can be had alone.
    type :: look_outputs
        integer :: n = 0
        integer :: kinetic = 0                 !! energy of links and rotors [J]
        integer :: energy = 0                  !! that with what gravity adds to it [J]
        integer :: alarm = 0                   !! beyond one, rounding may have grown; not a number if anything was none
        integer :: reach = 0                   !! not above zero: a loop does not close, or hardly
        integer :: margin = 0                  !! of the closed forms with two assemblies (n_branch)
        integer :: drift = 0                   !! its rate [1/s] (n_branch)
        integer :: n_of_assembly = 0           !! numbers up to here
        integer :: rate = 0                    !! of joints [rad/s, m/s], then of links (joint + 3 link)
        integer :: acceleration = 0            !! likewise [rad/s2, m/s2]
        integer :: compared = 0                !! rates for a unit rate of a coordinate (variable, coordinate)
        integer :: angle = 0                   !! of joints [rad], but for turns
        integer :: spin = 0                    !! their rates [rad/s]
    end type look_outputs

contains

    !> Trace the motion of a scene and compile what is looked at.
    subroutine make_look_program(model, request, choice, sample, program, out)
        type(model_type), intent(in) :: model
        type(trace_request), intent(in) :: request
        type(look_choice), intent(in) :: choice
        type(sample_set), intent(in) :: sample         !! representative
        type(scene_program), intent(inout) :: program
        type(look_outputs), intent(out) :: out
        type(trace_request) :: of_motion
        type(record_type), target :: record
        type(traced_type) :: traced
        type(output_list) :: list
        type(value), dimension(model%n_branch) :: margin, drift
        type(value), allocatable :: rate(:), acceleration(:), compared(:), angle(:), spin(:)
        type(value) :: kinetic

        of_motion = request
        if (allocated(of_motion%acceleration_is_unknown)) deallocate (of_motion%acceleration_is_unknown)
        call open_record(record, sample%n)
        call trace_motion(model, of_motion, sample, traced, merged=.false.)
        if (traced%mechanism%is_solved) then
            kinetic = link_energy(traced%mechanism)
            call assembly_margins(traced%mechanism, margin, drift)
            call measure_motion(traced, choice, rate, acceleration)
            compared = compared_rates(traced, choice)
            call measure_angles(traced, choice, angle, spin)
            call add_output(list, out_looks, [kinetic, kinetic + gravity_energy(traced%mechanism), alarm_of(traced), &
                                              reach_of(traced), margin, drift])
            call add_output(list, out_looks, [rate, acceleration, compared, angle, spin])
            call make_scene_program(record, traced%in, list, program)
            out = look_outputs(n=size(list%v), kinetic=1, energy=2, alarm=3, reach=4, margin=5, drift=5 + model%n_branch)
            out%n_of_assembly = list%n(1)
            out%rate = out%n_of_assembly + 1
            out%acceleration = out%rate + size(rate)
            out%compared = out%acceleration + size(acceleration)
            out%angle = out%compared + size(compared)
            out%spin = out%angle + size(angle)
        end if
        call close_record(record)
    end subroutine make_look_program

    !> How joints and links move that are looked at.
    subroutine measure_motion(traced, choice, rate, acceleration)
        type(traced_type), intent(in) :: traced
        type(look_choice), intent(in) :: choice
        type(value), allocatable, intent(out) :: rate(:), acceleration(:)
        integer :: i

        allocate (rate(0), acceleration(0))
        do i = 1, size(choice%joint)
            rate = [rate, variable_rate(traced%mechanism, choice%joint(i), the_one)]
            acceleration = [acceleration, variable_acceleration(traced%mechanism, choice%joint(i), the_one)]
        end do
        do i = 1, size(choice%link)
            rate = [rate, components(omega_of(traced%mechanism%bodies, choice%link(i), world_axes))]
            acceleration = [acceleration, components(alpha_of(traced%mechanism%bodies, choice%link(i), world_axes))]
        end do
    end subroutine measure_motion

    !> Joint angles, whose turns are followed from step to step.
    subroutine measure_angles(traced, choice, angle, spin)
        type(traced_type), intent(in) :: traced
        type(look_choice), intent(in) :: choice
        type(value), allocatable, intent(out) :: angle(:), spin(:)
        integer :: i

        allocate (angle(0), spin(0))
        do i = 1, size(choice%angle, 2)
            angle = [angle, one_variable(traced%mechanism, choice%angle(1, i), choice%angle(2, i))]
            spin = [spin, variable_rate(traced%mechanism, choice%angle(1, i), choice%angle(2, i))]
        end do
    end subroutine measure_angles

    !> Rates of joint variables if one coordinate moves alone.
    function compared_rates(traced, choice) result(compared)
        type(traced_type), intent(in) :: traced
        type(look_choice), intent(in) :: choice
        type(value), allocatable :: compared(:)
        type(value) :: alone(traced%mechanism%model%n_q)
        type(substitution), allocatable :: map
        integer :: i, k

        allocate (compared(0))
        do k = 1, size(choice%coordinate)
            alone = zero()
            alone(choice%coordinate(k)) = one()
            if (allocated(map)) deallocate (map)
            allocate (map)
            call replace(map, traced%mechanism%qd(:size(alone)), alone)
            do i = 1, size(choice%compared, 2)
                compared = [compared, substituted(map, variable_rate(traced%mechanism, choice%compared(1, i), &
                                                                     choice%compared(2, i)))]
            end do
        end do
    end function compared_rates
end module linkdyn_look_program
