!> Velocities and accelerations of links placed together, from the constraints of their joints.
!>
!> Whatever placed them, a closed form or iteration: the rates of the constraints are linear in the velocities, and the
!> second rates, with the same matrix, in the accelerations. Both are solved while tracing.
module linkdyn_group_rates
    use linkdyn_bodies, only: in_two_axes, world_axes, set_vector, forget_vector, omega_of, alpha_of, rotation_of, &
        acceleration_of_origin
    use linkdyn_constraint_rates, only: body_state, constraint_type, constraints_of_joint, constraints_of_variable, &
        errors_of, velocities_of, accelerations_of
    use linkdyn_mechanism, only: mechanism_type, watch
    use linkdyn_model, only: leads_within
    use linkdyn_system, only: system_type, unknown, require, solve, solved
    use linkdyn_value, only: value, zero
    use linkdyn_vector, only: vector, components, vector_of
    implicit none (type, external)
    private
    public :: group_constraints, list_constraints, move_group
    public :: make_velocities_unknown, make_accelerations_unknown, require_rates, require_second_rates

    !> All constraints of a group.
    type :: group_constraints
        integer, allocatable :: link(:)                !! the group's links
        logical, allocatable :: turns(:)               !! (link) with a turning of its own, the first of the group that has it
        type(constraint_type), allocatable :: of(:)
    end type group_constraints

contains

    !> Constraints of the joints, and of those variables that are coordinates.
    subroutine list_constraints(mechanism, link, joint, coordinate, constraints)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: link(:), joint(:)
        integer, intent(in) :: coordinate(:, :)        !! that gives a joint's variable; 0: none (3, joint)
        type(group_constraints), intent(out) :: constraints
        integer, allocatable :: leader(:)
        type(value), allocatable :: weight(:)
        integer :: i, k, n, t

        constraints%link = link
        allocate (constraints%turns(size(link)), constraints%of(size(joint) + count(coordinate > 0)))
        do i = 1, size(link)
            t = mechanism%bodies%body(link(i))%turning
            constraints%turns(i) = .not. any(mechanism%bodies%turning(t)%omega%is_known) &
                                   .and. all(mechanism%bodies%body(link(:i - 1))%turning /= t)
        end do
        n = 0
        do i = 1, size(joint)
            n = n + 1
            constraints%of(n) = constraints_of_joint(mechanism, joint(i), any(coordinate(:, i) > 0))
            do k = 1, 3
                if (coordinate(k, i) == 0) cycle
                n = n + 1
                call find_leaders(coordinate(k, i))
                constraints%of(n) = constraints_of_variable(mechanism, joint(i), k, coordinate(k, i), leader, weight)
            end do
        end do

    contains

        !> Joints of the group that lead what is given as number c.
        subroutine find_leaders(c)
            integer, intent(in) :: c
            integer, allocatable :: which(:)
            integer :: s

            which = [integer ::]
            leader = [integer ::]
            associate (n_q => mechanism%model%n_q)
                if (c > n_q) then
                    which = pack([(s, s=1, size(mechanism%model%led(c - n_q)%source))], &
                                 leads_within(mechanism%model%led(c - n_q), joint))
                    leader = mechanism%model%led(c - n_q)%source(which)
                    which = mechanism%at%led(c - n_q) + n_q + which
                end if
            end associate
            weight = mechanism%number(which)
        end subroutine find_leaders
    end subroutine list_constraints

    !> Velocities and accelerations of a group whose links are placed. With a system of equations the accelerations stay
    !> unknowns of it; else they are solved for at once.
    subroutine move_group(mechanism, constraints, equations)
        type(mechanism_type), intent(inout) :: mechanism
        type(group_constraints), intent(in) :: constraints
        type(system_type), intent(inout), optional :: equations
        type(system_type) :: velocities, accelerations

        call make_velocities_unknown(mechanism, constraints, velocities)
        call require_rates(mechanism, constraints, velocities)
        call solve(velocities)
        call watch(mechanism, velocities)
        call settle_velocities(mechanism, constraints, velocities)
        if (present(equations)) then
            call make_accelerations_unknown(mechanism, constraints, equations)
            call require_second_rates(mechanism, constraints, equations)
        else
            call make_accelerations_unknown(mechanism, constraints, accelerations)
            call require_second_rates(mechanism, constraints, accelerations)
            call solve(accelerations)
            mechanism%is_solved = mechanism%is_solved .and. accelerations%is_solved
            call settle_accelerations(mechanism, constraints, accelerations)
        end if
    end subroutine move_group

    !> Rates of the constraints become equations; their errors come in the same order.
    subroutine require_rates(mechanism, constraints, system, error)
        type(mechanism_type), intent(in) :: mechanism
        type(group_constraints), intent(in) :: constraints
        type(system_type), intent(inout) :: system
        type(value), allocatable, intent(out), optional :: error(:)    !! (equation)
        type(value), allocatable :: rate(:), c(:)
        integer :: i, k, n_before

        if (present(error)) allocate (error(0))
        do i = 1, size(constraints%of)
            associate (body => states(mechanism, constraints%of(i)%link))
                rate = velocities_of(constraints%of(i), body)
                if (present(error)) c = errors_of(constraints%of(i), body)
            end associate
            do k = 1, size(rate)
                n_before = system%n_equation
                call require(system, rate(k))
                if (present(error) .and. system%n_equation > n_before) error = [error, c(k)]
            end do
        end do
    end subroutine require_rates

    subroutine require_second_rates(mechanism, constraints, system)
        type(mechanism_type), intent(in) :: mechanism
        type(group_constraints), intent(in) :: constraints
        type(system_type), intent(inout) :: system
        integer :: i

        do i = 1, size(constraints%of)
            call require(system, accelerations_of(constraints%of(i), states(mechanism, constraints%of(i)%link)))
        end do
    end subroutine require_second_rates

    ! ---------------------------------------------------------------- states of links

    !> What is known, or unknown, of links.
    function states(mechanism, link) result(state)
        type(mechanism_type), intent(in) :: mechanism
        integer, intent(in) :: link(:)
        type(body_state) :: state(size(link))
        integer :: side

        associate (bodies => mechanism%bodies)
            do side = 1, size(link)
                associate (body => bodies%body(link(side)))
                    state(side)%position = body%position
                    state(side)%r = rotation_of(bodies, link(side))
                    state(side)%velocity = body%velocity
                    state(side)%omega = omega_of(bodies, link(side), world_axes)
                    if (.not. any(body%acceleration%is_known)) cycle
                    state(side)%acceleration = acceleration_of_origin(bodies, link(side), world_axes)
                    state(side)%alpha = alpha_of(bodies, link(side), world_axes)
                end associate
            end do
        end associate
    end function states

    subroutine make_velocities_unknown(mechanism, constraints, system)
        type(mechanism_type), intent(inout) :: mechanism
        type(group_constraints), intent(in) :: constraints
        type(system_type), intent(inout) :: system
        integer :: i

        do i = 1, size(constraints%link)
            associate (body => mechanism%bodies%body(constraints%link(i)))
                body%velocity = unknown_shift(mechanism, system)
                if (constraints%turns(i)) &
                    call set_vector(mechanism%bodies%turning(body%turning)%omega, world_axes, unknown_turn(mechanism, system))
            end associate
        end do
    end subroutine make_velocities_unknown

    subroutine settle_velocities(mechanism, constraints, system)
        type(mechanism_type), intent(inout) :: mechanism
        type(group_constraints), intent(in) :: constraints
        type(system_type), intent(inout) :: system
        integer :: i

        do i = 1, size(constraints%link)
            associate (body => mechanism%bodies%body(constraints%link(i)))
                body%velocity = solved_vector(system, body%velocity)
                if (constraints%turns(i)) call settle(mechanism%bodies%turning(body%turning)%omega, system)
            end associate
        end do
    end subroutine settle_velocities

    subroutine make_accelerations_unknown(mechanism, constraints, system)
        type(mechanism_type), intent(inout) :: mechanism
        type(group_constraints), intent(in) :: constraints
        type(system_type), intent(inout) :: system
        integer :: i

        do i = 1, size(constraints%link)
            associate (body => mechanism%bodies%body(constraints%link(i)))
                call set_vector(body%acceleration, world_axes, unknown_shift(mechanism, system))
                if (constraints%turns(i)) &
                    call set_vector(mechanism%bodies%turning(body%turning)%alpha, world_axes, unknown_turn(mechanism, system))
            end associate
        end do
    end subroutine make_accelerations_unknown

    subroutine settle_accelerations(mechanism, constraints, system)
        type(mechanism_type), intent(inout) :: mechanism
        type(group_constraints), intent(in) :: constraints
        type(system_type), intent(inout) :: system
        integer :: i

        do i = 1, size(constraints%link)
            associate (body => mechanism%bodies%body(constraints%link(i)))
                call settle(body%acceleration, system)
                if (constraints%turns(i)) call settle(mechanism%bodies%turning(body%turning)%alpha, system)
            end associate
        end do
    end subroutine settle_accelerations

    subroutine settle(pair, system)
        type(in_two_axes), intent(inout) :: pair
        type(system_type), intent(inout) :: system
        type(vector) :: v

        v = solved_vector(system, pair%v(world_axes))
        call forget_vector(pair)
        call set_vector(pair, world_axes, v)
    end subroutine settle

    function solved_vector(system, v) result(w)
        type(system_type), intent(inout) :: system
        type(vector), intent(in) :: v
        type(vector) :: w

        w = vector_of(solved(system, components(v)))
    end function solved_vector

    !> In a plane links shift along x and y and turn about z.
    function unknown_shift(mechanism, system) result(v)
        type(mechanism_type), intent(in) :: mechanism
        type(system_type), intent(inout) :: system
        type(vector) :: v

        v%x = unknown(system)
        v%y = unknown(system)
        if (mechanism%model%is_planar) then
            v%z = zero()
        else
            v%z = unknown(system)
        end if
    end function unknown_shift

    function unknown_turn(mechanism, system) result(v)
        type(mechanism_type), intent(in) :: mechanism
        type(system_type), intent(inout) :: system
        type(vector) :: v

        if (mechanism%model%is_planar) then
            v%x = zero()
            v%y = zero()
        else
            v%x = unknown(system)
            v%y = unknown(system)
        end if
        v%z = unknown(system)
    end function unknown_turn
end module linkdyn_group_rates
