!> The program of a linearization: how accelerations change as a state and what acts on it change along a direction.
!>
!> A direction is an input: the kernel is twice as long as that of the rates, however many columns a linearization has, and finds a
!> column for each sample. Differentiation goes through the elimination, so columns are as exact as accelerations.
!>
!> Where links of groups stand, which are closed by iteration, is an input, too. As the coordinates go along a direction these links
!> go with the velocities that the same rates of the coordinates give them, and velocities are in the record.
!>
!> What laws make of the state is found outside, by a first run, which has how their measures change; efforts, pulls and loads of
!> the second run change with them.
module linkdyn_linear_program
    use linkdyn_attitude, only: quaternion_rates
    use linkdyn_block, only: block_lanes
    use linkdyn_bodies, only: world_axes, omega_of
    use linkdyn_effort_laws, only: law_effort, compares_motion
    use linkdyn_friction, only: pressing_force
    use linkdyn_inputs, only: trace_request, sample_set, in_q, in_qd, in_load, in_target, in_effort, in_place, in_pull, &
        in_friction, in_direction, add_inputs
    use linkdyn_joint_variables, only: variable_rate
    use linkdyn_kinds, only: wp
    use linkdyn_measure_program, only: measured
    use linkdyn_model, only: model_type, place_size
    use linkdyn_motion_quantities, only: all_joint_variables, all_joint_rates
    use linkdyn_rate_program, only: trace_accelerations
    use linkdyn_rates, only: rate_map, set_rate, rate_of
    use linkdyn_record, only: record_type, open_record, close_record
    use linkdyn_scene, only: side_joint
    use linkdyn_scene_program, only: scene_program, program_space, sample_arrays, output_list, add_output, make_scene_program, &
        load_samples, run_samples, goes_to, free_program_space
    use linkdyn_system, only: solved
    use linkdyn_trace, only: traced_type, alarm_of, reach_of, pressed_by
    use linkdyn_value, only: value, zero
    use linkdyn_vector, only: components
    implicit none (type, external)
    private
    public :: direction_places, linear_outputs, directions_of, make_linear_program, run_linear

    integer, parameter :: out_linear = 107     !! all that the program gives, in the order of `linear_outputs`

    !> Where everything begins in block `in_direction`.
    type :: direction_places
        integer :: q = 0, qd = 0               !! of the coordinates (n_q)
        integer :: effort = 0                  !! driving forces (n_actuator)
        integer :: pull = 0                    !! of springs' own laws over the state (n_spring)
        integer :: load = 0                    !! (6 n_load)
        integer :: friction = 0                !! of contacts, over their speed (n_contact)
        integer :: n = 0
    end type direction_places

    !> Where everything begins among the outputs of a sample. Of all but the last two the changes follow, in the same order.
    type :: linear_outputs
        integer :: n = 0                       !! outputs in all
        integer :: change = 0                  !! from an output to how it changes
        integer :: acceleration = 0            !! of the coordinates (n_q)
        integer :: variable = 0                !! joint variables, then their rates (2 n_variable)
        integer :: measure = 0                 !! what laws over the state hang on, but for time (measure)
        integer :: effort = 0                  !! of actuators whose laws compare the motion of their joints; 0 of others
                                               !! (n_actuator)
        integer :: driven = 0                  !! rates of the variables that motors drive; 0 of others (n_actuator)
        integer :: press = 0                   !! what presses contacts, if something rubs (n_contact) [N]
        integer :: square = 0                  !! of the speeds at which they slide (n_contact) [m2/s2]
        integer :: alarm = 0, reach = 0        !! as of the rates
    end type linear_outputs

contains

    pure function directions_of(model) result(at)
        type(model_type), intent(in) :: model
        type(direction_places) :: at

        at%q = 1
        at%qd = at%q + model%n_q
        at%effort = at%qd + model%n_q
        at%pull = at%effort + model%n_actuator
        at%load = at%pull + size(model%scene%spring)
        at%friction = at%load + 6*model%n_load
        at%n = at%friction + size(model%contact) - 1
    end function directions_of

    !> Trace a scene and compile its linearization. Without pivots that serve the samples no program is made.
    subroutine make_linear_program(model, request, sample, program, out)
        type(model_type), intent(in) :: model
        type(trace_request), intent(in) :: request     !! all efforts are given, attitudes by their angles
        type(sample_set), intent(in) :: sample         !! representative: pivots are chosen by them
        type(scene_program), intent(inout) :: program
        type(linear_outputs), intent(out) :: out
        type(record_type), target :: record
        type(traced_type) :: traced
        type(output_list) :: list
        type(rate_map) :: map
        type(direction_places) :: at
        type(value), allocatable :: found(:), change(:)
        integer :: k

        call open_record(record, sample%n)
        call trace_accelerations(model, request, sample, traced)
        if (traced%mechanism%is_solved) then
            at = directions_of(model)
            call add_inputs(in_direction, at%n, sample, traced%in)
            found = solved(traced%system, traced%acceleration)
            call put([all_joint_variables(traced%mechanism), all_joint_rates(traced%mechanism)], out%variable)
            call put(measures(traced), out%measure)
            call put(efforts_by_motion(traced), out%effort)
            call put(driven_rates(traced), out%driven)
            call put(pressing_forces(traced), out%press)
            if (allocated(traced%contact)) call put(traced%contact%square, out%square)
            call go_along(traced, map)
            allocate (change(size(found)))
            do k = 1, size(found)
                change(k) = rate_of(map, found(k))
            end do
            call add_output(list, out_linear, [found, change, alarm_of(traced), reach_of(traced)])
            call make_scene_program(record, traced%in, list, program)
            out%acceleration = 1
            out%change = size(found)
            out%alarm = 2*size(found) + 1
            out%reach = out%alarm + 1
            out%n = out%reach
        end if
        call close_record(record)

    contains

        subroutine put(v, first)
            type(value), intent(in) :: v(:)
            integer, intent(out) :: first

            first = size(found) + 1
            found = [found, v]
        end subroutine put
    end subroutine make_linear_program

    !> A map by which inputs change along the direction.
    subroutine go_along(traced, map)
        type(traced_type), intent(in) :: traced
        type(rate_map), intent(inout) :: map
        type(direction_places) :: at

        at = directions_of(traced%mechanism%model)
        associate (along => traced%in%of(in_direction)%v)
            call set_rates(in_q, along(at%q:at%qd - 1))
            call set_rates(in_qd, along(at%qd:at%effort - 1))
            call set_rates(in_effort, along(at%effort:at%pull - 1))
            call set_rates(in_pull, along(at%pull:at%load - 1))
            call set_rates(in_load, along(at%load:at%friction - 1))
            call set_rates(in_friction, along(at%friction:at%n))
            call set_rates(in_place, place_rates(traced, along(at%q:at%qd - 1)))
        end associate

    contains

        !> Of those numbers of a block that are inputs.
        subroutine set_rates(block, rate)
            integer, intent(in) :: block
            type(value), intent(in) :: rate(:)

            associate (in => traced%in%of(block))
                call set_rate(map, in%v(in%which), rate(in%which))
            end associate
        end subroutine set_rates
    end subroutine go_along

    !> How places of links in groups change as the coordinates go: velocities are linear in the coordinates' rates.
    function place_rates(traced, along) result(rate)
        type(traced_type), intent(in) :: traced
        type(value), intent(in) :: along(:)            !! (n_q)
        type(value) :: rate(place_size(traced%mechanism%model)*traced%mechanism%model%n_link)
        type(rate_map) :: map
        type(value) :: turning(3), shift(3)
        integer :: g, i, l, n

        rate = zero()
        call set_rate(map, traced%in%of(in_qd)%v, along)
        n = place_size(traced%mechanism%model)
        associate (mechanism => traced%mechanism)
            do g = 1, size(mechanism%model%group)
                do i = 1, size(mechanism%model%group(g)%link)
                    l = mechanism%model%group(g)%link(i)
                    shift = along_map(components(mechanism%bodies%body(l)%velocity))
                    turning = along_map(components(omega_of(mechanism%bodies, l, world_axes)))
                    if (mechanism%model%is_planar) then
                        rate(n*(l - 1) + 1:n*l) = [shift(:2), turning(3)]
                    else
                        rate(n*(l - 1) + 1:n*l) = [shift, quaternion_rates(traced%place(4:, l), turning)]
                    end if
                end do
            end do
        end associate

    contains

        function along_map(velocity) result(rate)
            type(value), intent(in) :: velocity(3)
            type(value) :: rate(3)
            integer :: k

            do k = 1, 3
                rate(k) = rate_of(map, velocity(k))
            end do
        end function along_map
    end function place_rates

    !> What laws over the state depend on; of time nothing.
    function measures(traced) result(measure)
        type(traced_type), intent(in) :: traced
        type(value) :: measure(size(traced%mechanism%model%scene%laws%measure))
        integer :: k

        do k = 1, size(measure)
            measure(k) = measured(traced%mechanism, traced%mechanism%model%scene%laws%measure(k))
        end do
    end function measures

    !> Driving forces by laws that compare the motion of a joint.
    function efforts_by_motion(traced) result(effort)
        type(traced_type), intent(in) :: traced
        type(value) :: effort(traced%mechanism%model%n_actuator)
        integer :: i

        effort = zero()
        associate (target => traced%in%of(in_target)%v)
            do i = 1, size(effort)
                if (compares_motion(traced%mechanism%model%scene%actuator(i)%law)) &
                    effort(i) = law_effort(traced%mechanism, i, target(2*i - 1), target(2*i))
            end do
        end associate
    end function efforts_by_motion

    !> How fast the joint variables move that motors drive whose laws are about them.
    function driven_rates(traced) result(rate)
        type(traced_type), intent(in) :: traced
        type(value) :: rate(traced%mechanism%model%n_actuator)
        integer :: i

        rate = zero()
        do i = 1, size(rate)
            associate (actuator => traced%mechanism%model%scene%actuator(i))
                if (actuator%law%side /= side_joint) &
                    rate(i) = variable_rate(traced%mechanism, actuator%joint, actuator%variable)
            end associate
        end do
    end function driven_rates

    !> What presses the surfaces that rub; none if nothing does.
    function pressing_forces(traced) result(force)
        type(traced_type), intent(inout) :: traced
        type(value), allocatable :: force(:)
        integer :: i

        allocate (force(0))
        if (.not. allocated(traced%contact)) return
        do i = 1, size(traced%contact)
            force = [force, pressing_force(traced%mechanism, i, pressed_by(traced, i))]
        end do
    end function pressing_forces

    !> Run all samples, a direction each.
    subroutine run_linear(program, arrays, n, found, is_bad)
        type(scene_program), intent(in) :: program
        type(sample_arrays), intent(in) :: arrays
        integer, intent(in) :: n
        real(wp), intent(inout), target, contiguous :: found(:, :)     !! as `linear_outputs` tells (value, sample)
        logical, intent(out) :: is_bad                 !! a number is not finite
        type(program_space) :: space
        logical :: not_finite(n)
        integer :: first, count

        not_finite = .false.
        do first = 1, n, block_lanes()
            count = min(block_lanes(), n - first + 1)
            call load_samples(program, arrays, first, count, space)
            call run_samples(program, space, first, count, [goes_to(out_linear, found)], not_finite(first:first + count - 1))
        end do
        call free_program_space(space)
        is_bad = any(not_finite)
    end subroutine run_linear
end module linkdyn_linear_program
