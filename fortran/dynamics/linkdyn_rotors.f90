!> Rotors of motors behind gears and screws, on lanes.
!>
!> A rotor of inertia J that turns n times as fast as a joint variable s has at that variable the inertia I = n^2 J: its energy is
!> I s'^2/2, and I s'' of the driving force does not get to the links. Where driving forces are unknown, what gets to the links is found as ever
!> and I s'' comes on top. Where they are given, -I s'' acts at the joint beside them: what of s'' is known already as an applied force, what
!> unknown accelerations of coordinates add as a part of their columns.
!>
!> Of motors without inertia nothing is computed.
module linkdyn_rotors
    use linkdyn_applied_wrenches, only: apply_drive
    use linkdyn_joint_rates, only: joint_view, view_joint, driven_axis, joint_rate
    use linkdyn_joint_table, only: is_slide
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state
    use linkdyn_lane_count, only: lanes
    use linkdyn_model, only: model_type, motor_type, orientation_of
    use linkdyn_planar_motion, only: level_velocity, level_given
    use linkdyn_scene, only: joint_prismatic
    use linkdyn_vec2, only: vec2, operator(+), operator(-), operator(*), operator(.cross.), operator(.rotate.)
    use linkdyn_vec3, only: vec3, operator(+), operator(-), operator(*), operator(.cross.), operator(.unrotate.)
    implicit none (type, external)
    private
    public :: apply_rotors, moves_rotor, add_rotor_column, add_planar_rotor_column, add_rotor_mass, rotor_accelerations
    public :: rotor_energy, applied_rotor_power

contains

    !> What rotors take of given driving forces at the accelerations given, as applied forces.
    subroutine apply_rotors(model, acts, state)
        type(model_type), intent(in) :: model
        logical, intent(in) :: acts(:)                 !! (motor) its driving force is given
        type(kinematic_state), intent(inout) :: state
        integer :: i

        do i = 1, size(model%motor)
            associate (motor => model%motor(i))
                state%rotor_force(:, i) = 0
                if (.not. acts(i)) cycle
                state%rotor_force(:, i) = -motor%inertia*joint_rate(model, state, motor%joint, motor%variable, level_given)
                call apply_drive(model, motor%joint, motor%variable, state%rotor_force(:, i), state)
            end associate
        end do
    end subroutine apply_rotors

    !> Power of these forces.
    subroutine applied_rotor_power(model, state, power)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        real(wp), intent(out) :: power(lanes)          !! [W]
        integer :: i

        power = 0
        do i = 1, size(model%motor)
            associate (motor => model%motor(i))
                if (motor%inertia > 0) power = power + state%rotor_force(:, i) &
                    *joint_rate(model, state, motor%joint, motor%variable, level_velocity)
            end associate
        end do
    end subroutine applied_rotor_power

    subroutine rotor_energy(model, state, energy)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        real(wp), intent(out) :: energy(lanes)         !! [J]
        integer :: i

        energy = 0
        do i = 1, size(model%motor)
            associate (motor => model%motor(i))
                if (motor%inertia > 0) energy = energy + motor%inertia/2 &
                    *joint_rate(model, state, motor%joint, motor%variable, level_velocity)**2
            end associate
        end do
    end subroutine rotor_energy

    !> Accelerations of the driven joint variables whose motors have inertia; 0 of others.
    subroutine rotor_accelerations(model, state, ahead, acceleration)
        type(model_type), intent(in) :: model
        type(kinematic_state), intent(in) :: state
        real(wp), intent(in) :: ahead(:, :)            !! of the coordinates, found less given (lane, n_q); without columns: all zero
        real(wp), intent(out) :: acceleration(:, :)    !! (lane, n_motor) [m/s2, rad/s2]
        integer :: i, k

        acceleration = 0
        do i = 1, size(model%motor)
            associate (motor => model%motor(i))
                if (.not. motor%inertia > 0) cycle
                acceleration(:, i) = joint_rate(model, state, motor%joint, motor%variable, level_given)
                do k = 1, min(size(ahead, 2), state%n_column)
                    acceleration(:, i) = acceleration(:, i) &
                                         + ahead(:, k)*joint_rate(model, state, motor%joint, motor%variable, k)
                end do
            end associate
        end do
    end subroutine rotor_accelerations

    ! ---------------------------------------------------------------- columns

    !> Does a rotor's inertia act on a link while a coordinate moves?
    pure logical function moves_rotor(model, acts, l, k)
        type(model_type), intent(in) :: model
        logical, intent(in) :: acts(:)                 !! (motor)
        integer, intent(in) :: l, k                    !! link, coordinate
        integer :: i, side

        moves_rotor = .false.
        do i = 1, size(model%motor)
            if (.not. acts(i)) cycle
            associate (link => model%joint(model%motor(i)%joint)%link)
                if (.not. any(link == l)) cycle
                do side = 1, 2
                    if (link(side) > 0) moves_rotor = moves_rotor .or. model%moves(k, link(side))
                end do
            end associate
        end do
    end function moves_rotor

    !> What the rotors at a link ask of it for a unit acceleration of coordinate k.
    subroutine add_rotor_column(model, acts, l, k, point, state, force, moment)
        type(model_type), intent(in) :: model
        logical, intent(in) :: acts(:)                 !! (motor)
        integer, intent(in) :: l, k
        real(wp), intent(in) :: point(3)               !! of the moments, link axes [m]
        type(kinematic_state), intent(in) :: state
        type(vec3), intent(inout) :: force, moment     !! link axes
        type(joint_view) :: view
        type(vec3) :: push
        integer :: i

        do i = 1, size(model%motor)
            if (.not. acts(i)) cycle
            if (.not. any(model%joint(model%motor(i)%joint)%link == l)) cycle
            associate (motor => model%motor(i), r => state%rotation(model%link(l)%orientation))
                call view_joint(model, state, motor%joint, state%velocity, state%omega, view)
                push = pull_of(model, motor, l, k, state)*driven_axis(model, state, motor%joint, motor%variable, view)
                push = r.unrotate.push
                if (is_slide(model%joint(motor%joint)%told_kind, motor%variable)) then
                    force = force + push
                    moment = moment + ((r.unrotate. (view%point - state%position(l))).cross.push)
                    moment = moment + (push.cross.point)
                else
                    moment = moment + push
                end if
            end associate
        end do
    end subroutine add_rotor_column

    !> The same in a plane, world axes.
    subroutine add_planar_rotor_column(model, acts, l, k, point, state, force, moment)
        type(model_type), intent(in) :: model
        logical, intent(in) :: acts(:)
        integer, intent(in) :: l, k
        real(wp), intent(in) :: point(2)               !! link axes [m]
        type(kinematic_state), intent(in) :: state
        type(vec2), intent(inout) :: force
        real(wp), intent(inout) :: moment(lanes)
        type(vec2) :: push, arm
        integer :: i, o(2)

        do i = 1, size(model%motor)
            if (.not. acts(i)) cycle
            associate (motor => model%motor(i), joint => model%joint(model%motor(i)%joint), plane => state%plane)
                if (.not. any(joint%link == l)) cycle
                if (joint%told_kind == joint_prismatic) then
                    o = [orientation_of(model, joint%link(1)), orientation_of(model, joint%link(2))]
                    push = pull_of(model, motor, l, k, state)*(plane%rotation(o(1)).rotate.joint%told_frame(:2, 3, 1))
                    arm = plane%position(joint%link(2)) + (plane%rotation(o(2)).rotate.joint%point(:2, 2)) &
                          - (plane%position(l) + (plane%rotation(model%link(l)%orientation).rotate.point))
                    force = force + push
                    moment = moment + (arm.cross.push)
                else
                    moment = moment + pull_of(model, motor, l, k, state)
                end if
            end associate
        end do
    end subroutine add_planar_rotor_column

    !> Size of what a rotor asks of one of its links.
    function pull_of(model, motor, l, k, state) result(pull)
        type(model_type), intent(in) :: model
        type(motor_type), intent(in) :: motor
        integer, intent(in) :: l, k
        type(kinematic_state), intent(in) :: state
        real(wp) :: pull(lanes)                        !! [kg, kg m] or [kg m, kg m2]

        pull = motor%inertia*joint_rate(model, state, motor%joint, motor%variable, k)
        if (model%joint(motor%joint)%link(1) == l) pull = -pull
    end function pull_of

    !> The share of rotors in the mass matrix: I (ds/dq)(ds/dq)^T each.
    subroutine add_rotor_mass(model, acts, state, mass)
        type(model_type), intent(in) :: model
        logical, intent(in) :: acts(:)                 !! (motor)
        type(kinematic_state), intent(in) :: state     !! with columns
        real(wp), intent(inout) :: mass(:, :, :)       !! (lane, n_q, n_q)
        real(wp) :: rate(lanes, size(mass, 2))
        integer :: i, k, m

        do i = 1, size(model%motor)
            if (.not. acts(i)) cycle
            associate (motor => model%motor(i))
                do k = 1, size(mass, 2)
                    rate(:, k) = joint_rate(model, state, motor%joint, motor%variable, k)
                end do
                do k = 1, size(mass, 2)
                    do m = 1, size(mass, 2)
                        mass(:, m, k) = mass(:, m, k) + motor%inertia*rate(:, m)*rate(:, k)
                    end do
                end do
            end associate
        end do
    end subroutine add_rotor_mass
end module linkdyn_rotors
