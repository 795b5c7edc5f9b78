!> The physics of a scene, run once on values: motion, equations, and what becomes of their unknowns.
module linkdyn_trace
    use linkdyn_acting, only: acting_type, at_joint_variable, at_place
    use linkdyn_base_wrenches, only: base_wrench
    use linkdyn_effort_laws, only: law_effort
    use linkdyn_drive_sharing, only: share_work
    use linkdyn_elimination, only: alarm_of_watched
    use linkdyn_friction, only: contact_motion, move_contacts, friction_wrench, holding_wrench, pressing_parts
    use linkdyn_force_system, only: force_unknowns, add_reactions, add_unknown_drives, balance_links, reaction_of, push_of_teeth
    use linkdyn_inputs, only: trace_request, sample_set, input_blocks, make_inputs, in_q, in_quaternion, in_qd, in_pull, in_base, &
        in_payload, in_qdd, in_load, in_target, in_effort, in_branch, in_place, in_number, in_friction, in_counted, in_motion, &
        in_stop, in_clutch, in_sense, in_unknown, in_shared, add_inputs
    use linkdyn_contact, only: n_press
    use linkdyn_kinds, only: wp
    use linkdyn_layout, only: layout_type
    use linkdyn_link_motion, only: motion_places, link_columns, place_motion, take_motion, take_columns, velocities_become
    use linkdyn_loads, only: apply_load
    use linkdyn_mechanism, only: mechanism_type, begin_mechanism, watch, properties_of, payload_properties
    use linkdyn_model, only: model_type, place_size, drives_share, friction_is_shared, feels_shares
    use linkdyn_operation, only: op_unknown
    use linkdyn_payload_wrenches, only: payload_wrench
    use linkdyn_placing, only: run_step
    use linkdyn_record, only: record_type, open_record_of_thread
    use linkdyn_rotor_forces, only: rotor_force
    use linkdyn_scene, only: n_stop, n_clutch
    use linkdyn_belts, only: apply_belt
    use linkdyn_springs, only: apply_spring
    use linkdyn_substitution, only: substitution, replace
    use linkdyn_system, only: system_type, unknown, solve, solved, take_solution
    use linkdyn_value, only: value, zero, one, is_zero, operator(+), operator(-), operator(*), min, abs
    use linkdyn_vector, only: vector
    implicit none (type, external)
    private
    public :: traced_type, begin_trace, trace_steps, trace_motion, trace_equations, trace_what_acts
    public :: trace_given_motion, trace_sharing, solve_equations, take_unknowns, are_among, in_motion_of
    public :: alarm_of, reach_of, pushes_of, pressed_by, driven_parts

    type :: traced_type
        type(input_blocks) :: in
        type(mechanism_type) :: mechanism
        type(system_type) :: system                        !! equations of motion
        type(force_unknowns) :: unknowns
        type(value), allocatable :: acceleration(:)        !! of the coordinates, known or unknown (n_q)
        type(value), allocatable :: beyond(:)              !! what is unknown of these; zero of others (n_q)
        type(value), allocatable :: virtual(:)             !! rates of theirs by which drives share the work; none: these do not
        type(value), allocatable :: place(:, :)            !! of links in groups closed by iteration (place_size, link)
        type(acting_type), allocatable :: acting(:)        !! what is known to act: loads, springs, friction
        type(motion_places) :: motion                      !! of links that move as they are told
        type(link_columns) :: columns                      !! there, if these are wanted
        type(contact_motion), allocatable :: contact(:)    !! not there: nothing rubs
        type(value), allocatable :: shared(:, :)           !! what reactions are that the equations leave open, beside those of the
                                                           !! released mechanism (6, joint); not there: nothing
    end type traced_type

contains

    !> Inputs, and a mechanism of which nothing is placed yet. Unknown accelerations of coordinates become unknowns of the
    !> equations.
    subroutine begin_trace(model, request, sample, traced)
        type(model_type), intent(in) :: model
        type(trace_request), intent(in) :: request
        type(sample_set), intent(in) :: sample
        type(traced_type), intent(inout) :: traced
        integer :: k

        call make_inputs(model, request, sample, traced%in)
        associate (in => traced%in%of)
            allocate (traced%beyond(model%n_q))
            traced%beyond = zero()
            if (allocated(request%acceleration_is_unknown)) then
                do k = 1, model%n_q
                    if (request%acceleration_is_unknown(k)) traced%beyond(k) = unknown(traced%system)
                end do
            end if
            traced%acceleration = in(in_qdd)%v + traced%beyond
            call begin_mechanism(model, in(in_number)%v, in(in_q)%v, in(in_qd)%v, traced%acceleration, traced%mechanism, &
                                 in_scene_axes=request%motion_is_given)
            traced%mechanism%pull = in(in_pull)%v
            traced%mechanism%payload = in(in_payload)%v
            traced%mechanism%counted = in(in_counted)%v
            if (request%by_quaternion) traced%mechanism%quaternion = reshape(in(in_quaternion)%v, [4, model%n_attitude])
            traced%place = reshape(in(in_place)%v, [place_size(model), model%n_link])
        end associate
    end subroutine begin_trace

    !> The first steps of the plan. Accelerations of links in groups become unknowns, too, if they are to be `merged` into the
    !> equations, which keeps these sparse.
    subroutine trace_steps(n_step, merged, traced, is_needed)
        integer, intent(in) :: n_step
        logical, intent(in) :: merged
        type(traced_type), intent(inout) :: traced
        logical, intent(in), optional :: is_needed(:)      !! (step) absent: all are
        type(value) :: way
        integer :: i

        associate (branch => traced%in%of(in_branch)%v, step => traced%mechanism%model%step)
            do i = 1, n_step
                if (present(is_needed)) then
                    if (.not. is_needed(i)) cycle
                end if
                way = one()
                if (step(i)%has_margin) way = branch(step(i)%first)
                if (merged) then
                    call run_step(traced%mechanism, step(i), way, traced%place, traced%system)
                else
                    call run_step(traced%mechanism, step(i), way, traced%place)
                end if
            end do
        end associate
    end subroutine trace_steps

    !> Inputs and the motion of all links.
    subroutine trace_motion(model, request, sample, traced, merged)
        type(model_type), intent(in) :: model
        type(trace_request), intent(in) :: request
        type(sample_set), intent(in) :: sample
        type(traced_type), intent(inout) :: traced
        logical, intent(in) :: merged

        call begin_trace(model, request, sample, traced)
        call trace_steps(size(model%step), merged, traced)
    end subroutine trace_motion

    !> Inputs, and the motion of all links as inputs.
    subroutine trace_given_motion(model, request, sample, traced)
        type(model_type), intent(in) :: model
        type(trace_request), intent(in) :: request     !! `motion_is_given`
        type(sample_set), intent(in) :: sample
        type(traced_type), intent(inout) :: traced

        call begin_trace(model, request, sample, traced)
        call place_motion(model, request%has_columns, traced%motion)
        associate (in => traced%in%of)
            call take_motion(traced%motion, in(in_motion)%v, traced%mechanism)
            if (request%has_columns) call take_columns(traced%motion, in(in_motion)%v, traced%beyond, traced%mechanism, &
                                                       traced%columns)
            if (request%has_friction .and. friction_is_shared(model)) &
                traced%shared = reshape(in(in_shared)%v, [6, model%n_joint])
        end associate
    end subroutine trace_given_motion

    !> A map by which velocities become those of another motion: of the same coordinates other rates.
    subroutine in_motion_of(traced, rate, map)
        type(traced_type), intent(in) :: traced
        type(value), intent(in) :: rate(:)             !! of the coordinates (n_q)
        type(substitution), intent(inout) :: map

        if (.not. allocated(traced%columns%velocity)) then
            call replace(map, traced%mechanism%qd(:size(rate)), rate)
            return
        end if
        call velocities_become(traced%motion, traced%in%of(in_motion)%v, traced%mechanism, traced%columns, rate, map)
    end subroutine in_motion_of

    !> Equations of all links.
    subroutine trace_equations(request, layout, traced)
        type(trace_request), intent(in) :: request
        type(layout_type), intent(in) :: layout
        type(traced_type), intent(inout) :: traced

        call add_reactions(traced%mechanism, layout, traced%system, traced%unknowns)
        call trace_what_acts(request, traced)
        call trace_sharing(request, traced)
        call balance_links(traced%mechanism, layout, traced%acting, traced%system, traced%unknowns)
    end subroutine trace_equations

    !> More drives than freedoms, all of them unknown in a motion that is given.
    subroutine trace_sharing(request, traced)
        type(trace_request), intent(in) :: request
        type(traced_type), intent(inout) :: traced
        type(substitution) :: map
        logical :: shares
        integer :: k

        shares = drives_share(traced%mechanism%model)
        if (allocated(request%drive_is_unknown)) shares = shares .and. all(request%drive_is_unknown)
        if (allocated(request%acceleration_is_unknown)) shares = shares .and. .not. any(request%acceleration_is_unknown)
        allocate (traced%virtual(merge(traced%mechanism%model%n_q, 0, shares)))
        if (.not. shares) return
        do k = 1, size(traced%virtual)
            traced%virtual(k) = unknown(traced%system)
        end do
        call in_motion_of(traced, traced%virtual, map)
        call share_work(traced%mechanism, traced%unknowns%transmitted, map, traced%system)
    end subroutine trace_sharing

    !> Driving forces, unknown or given, loads, springs and friction.
    subroutine trace_what_acts(request, traced)
        type(trace_request), intent(in) :: request
        type(traced_type), intent(inout) :: traced
        type(acting_type), allocatable :: spring(:)
        logical, allocatable :: drive_is_unknown(:)
        integer :: i

        associate (model => traced%mechanism%model)
            drive_is_unknown = [(.true., i=1, model%n_actuator)]
            if (allocated(request%drive_is_unknown)) drive_is_unknown = request%drive_is_unknown
            if (.not. allocated(traced%unknowns%effort)) &
                allocate (traced%unknowns%effort(model%n_actuator), traced%unknowns%transmitted(model%n_actuator))
            call add_unknown_drives(traced%mechanism, drive_is_unknown, traced%system, traced%unknowns)
            do i = 1, model%n_actuator
                if (drive_is_unknown(i)) cycle
                if (request%motion_is_given .or. request%efforts_are_given) then
                    traced%unknowns%effort(i) = traced%in%of(in_effort)%v(i)
                else
                    traced%unknowns%effort(i) = given_effort(traced, i)
                end if
                traced%unknowns%transmitted(i) = traced%unknowns%effort(i)
            end do
            do i = 1, size(model%motor)
                if (model%motor(i)%inertia > 0) call turn_rotor(model%motor(i)%actuator, rotor_force(traced%mechanism, i))
            end do
            allocate (traced%acting(0))
            do i = 1, model%n_load
                associate (component => traced%in%of(in_load)%v(6*i - 5:6*i))
                    if (.not. all(is_zero(component))) traced%acting = &
                        [traced%acting, apply_load(traced%mechanism, i, component)]
                end associate
            end do
            do i = 1, size(model%scene%spring)
                call apply_spring(traced%mechanism, i, spring)
                traced%acting = [traced%acting, spring]
            end do
            do i = 1, size(model%belt)
                traced%acting = [traced%acting, apply_belt(traced%mechanism, i)]
            end do
            do i = 1, size(model%payload)
                traced%acting = [traced%acting, payload_wrench(traced%mechanism, i)]
            end do
            do i = 1, n_stop(model%scene)
                associate (stop => model%scene%stop(i), force => traced%in%of(in_stop)%v(i))
                    if (.not. is_zero(force)) traced%acting = [traced%acting, &
                        at_place(traced%mechanism, model%scene%laws%measure(stop%measure), real(-stop%side, wp)*force)]
                end associate
            end do
            do i = 1, n_clutch(model%scene)
                associate (clutch => model%scene%clutch(i), force => traced%in%of(in_clutch)%v(i))
                    if (clutch%friction > 0) then
                        if (.not. is_zero(force)) &
                            traced%acting = [traced%acting, holding_wrench(traced%mechanism, clutch%joint(1), &
                                                               clutch%variable(1), force)]
                    else
                        call push(clutch%measure(1), force)
                    end if
                    if (clutch%n_side == 2) call push(clutch%measure(2), -clutch%ratio*force)
                end associate
            end do
            if (request%has_friction) call move_contacts(traced%mechanism, traced%in%of(in_sense)%v, traced%contact)
            do i = 1, merge(size(model%contact), 0, request%has_friction)
                traced%acting = [traced%acting, friction_wrench(traced%mechanism, i, traced%contact(i), &
                                                                traced%in%of(in_friction)%v(i))]
            end do
            if (.not. model%scene%base%moves) return
            do i = 1, model%n_link
                if (.not. model%link(i)%is_massless) traced%acting = &
                    [traced%acting, base_wrench(traced%mechanism, i, properties_of(traced%mechanism, i), traced%in%of(in_base)%v)]
            end do
            do i = 1, size(model%payload)
                traced%acting = [traced%acting, base_wrench(traced%mechanism, model%payload(i)%link, &
                                                            payload_properties(traced%mechanism, i), traced%in%of(in_base)%v)]
            end do
        end associate

    contains

        !> A known force or torque along what a measure tells.
        subroutine push(measure, force)
            integer, intent(in) :: measure
            type(value), intent(in) :: force

            if (is_zero(force)) return
            associate (spec => traced%mechanism%model%scene%laws%measure(measure))
                traced%acting = [traced%acting, at_place(traced%mechanism, spec, force)]
            end associate
        end subroutine push

        !> What a rotor's acceleration takes comes from the drive, and does not get to the links.
        subroutine turn_rotor(actuator, force)
            integer, intent(in) :: actuator
            type(value), intent(in) :: force

            associate (unknowns => traced%unknowns)
                if (drive_is_unknown(actuator)) then
                    unknowns%effort(actuator) = unknowns%transmitted(actuator) + force
                else
                    unknowns%transmitted(actuator) = unknowns%effort(actuator) - force
                end if
            end associate
        end subroutine turn_rotor
    end subroutine trace_what_acts

    !> What acts at joints beside their reactions: drives, springs, friction.
    function pushes_of(traced) result(push)
        type(traced_type), intent(in) :: traced
        type(acting_type), allocatable :: push(:)
        integer :: i

        push = pack(traced%acting, traced%acting%joint > 0)
        do i = 1, traced%mechanism%model%n_actuator
            associate (actuator => traced%mechanism%model%scene%actuator(i))
                push = [push, at_joint_variable(traced%mechanism, actuator%joint, actuator%variable, &
                                                traced%unknowns%transmitted(i))]
            end associate
        end do
    end function pushes_of

    !> What a contact feels of its joint's reaction, with what it has of reactions that are shared and what drives wheels apart.
    function pressed_by(traced, i) result(press)
        type(traced_type), intent(inout) :: traced
        integer, intent(in) :: i                       !! contact
        type(value) :: press(n_press)                  !! [N]
        type(acting_type) :: whole
        type(value) :: r(6)

        associate (mechanism => traced%mechanism, joint => traced%mechanism%model%contact(i)%joint)
            if (.not. allocated(traced%shared) .or. .not. feels_shares(mechanism%model, joint)) then
                press = solved(traced%system, pressing_parts(mechanism, i, traced%contact(i), traced%unknowns%reaction(joint)))
                call add_driven_apart()
                return
            end if
            r = reaction_of(mechanism, traced%unknowns, traced%system, joint) + traced%shared(:, joint)
            whole%joint = joint
            whole%force = vector(r(1), r(2), r(3))
            whole%moment = vector(r(4), r(5), r(6))
            press = pressing_parts(mechanism, i, traced%contact(i), whole)
        end associate

    contains

        subroutine add_driven_apart()
            type(value) :: part(0:n_press)
            integer :: n

            do n = 1, size(traced%mechanism%model%driven)
                if (traced%mechanism%model%driven(n)%contact /= i) cycle
                part = driven_parts(traced, n)
                press = press + abs(part(0))*part(1:)
            end do
        end subroutine add_driven_apart
    end function pressed_by

    !> What a contact feels of teeth that drive wheels apart: the force along their pitch circles (0), and what it feels for each
    !> newton of its size.
    function driven_parts(traced, n) result(part)
        type(traced_type), intent(inout) :: traced
        integer, intent(in) :: n                       !! of `model%driven`
        type(value) :: part(0:n_press)

        associate (mechanism => traced%mechanism, driven => traced%mechanism%model%driven(n))
            part(0) = solved(traced%system, traced%unknowns%mesh(driven%gear))
            part(1:) = driven%sense*pressing_parts(mechanism, driven%contact, traced%contact(driven%contact), &
                push_of_teeth(mechanism, driven%gear, mechanism%model%contact(driven%contact)%joint))
        end associate
    end function driven_parts

    !> Driving force of an actuator whose force is not unknown.
    function given_effort(traced, i) result(effort)
        type(traced_type), intent(in) :: traced
        integer, intent(in) :: i
        type(value) :: effort
        type(value) :: target(2)

        associate (in => traced%in%of)
            target = in(in_target)%v(2*i - 1:2*i)
            if (any(in(in_effort)%which == i)) target(1) = in(in_effort)%v(i)
        end associate
        effort = law_effort(traced%mechanism, i, target(1), target(2))
    end function given_effort

    !> Which unknowns of the equations are among some values.
    function are_among(traced, v) result(are)
        type(traced_type), intent(in) :: traced
        type(value), intent(in) :: v(:)
        logical :: are(traced%system%n_unknown)
        type(record_type), pointer :: record
        integer :: k

        record => open_record_of_thread()
        are = .false.
        do k = 1, size(v)
            if (record%kind(v(k)%node) /= op_unknown) cycle
            are = are .or. traced%system%number(:traced%system%n_unknown) == record%operand(1, v(k)%node)
        end do
    end function are_among

    !> Eliminate the unknowns, those wanted last.
    subroutine solve_equations(traced, is_last)
        type(traced_type), intent(inout) :: traced
        logical, intent(in), optional :: is_last(:)        !! (unknown)

        call solve(traced%system, is_last)
        call watch(traced%mechanism, traced%system)
    end subroutine solve_equations

    !> The unknowns are inputs: somebody has found them.
    subroutine take_unknowns(sample, traced)
        type(sample_set), intent(in) :: sample
        type(traced_type), intent(inout) :: traced

        call add_inputs(in_unknown, traced%system%n_unknown, sample, traced%in)
        call take_solution(traced%system, traced%in%of(in_unknown)%v)
    end subroutine take_unknowns

    !> Beyond one, rounding may have grown. Not a number if anything was none.
    function alarm_of(traced) result(alarm)
        type(traced_type), intent(in) :: traced
        type(value) :: alarm

        alarm = alarm_of_watched(traced%mechanism%watched)
    end function alarm_of

    !> Smallest of the values that must be positive. One if nothing can fail.
    function reach_of(traced) result(reach)
        type(traced_type), intent(in) :: traced
        type(value) :: reach
        integer :: i

        reach = one()
        do i = 1, size(traced%mechanism%positive)
            reach = min(traced%mechanism%positive(i), reach)
        end do
    end function reach_of
end module linkdyn_trace
