!> The program of forward dynamics: from coordinates, their rates and what acts to accelerations, with the elimination of
!> all reactions inside. Where all accelerations are given it finds driving forces, for the stages of forward runs.
module linkdyn_rate_program
    use linkdyn_attitude, only: quaternion_rates
    use linkdyn_force_program, only: trace_redundancy
    use linkdyn_inputs, only: trace_request, sample_set, in_effort
    use linkdyn_joint_variables, only: variable_rate
    use linkdyn_layout, only: sparse_layout
    use linkdyn_link_wrenches, only: applied_power
    use linkdyn_lossy_motors, only: lossy_motors
    use linkdyn_margins, only: assembly_margins
    use linkdyn_model, only: model_type, counts_for_another, friction_is_shared, gives_attitude, attitude_angles
    use linkdyn_recorded_friction, only: friction_programs, compile_with_friction
    use linkdyn_rates, only: rate_map, set_rate, rate_of
    use linkdyn_record, only: record_type, open_record, close_record
    use linkdyn_scene_program, only: scene_program, output_list, add_output, make_scene_program
    use linkdyn_system, only: solved
    use linkdyn_trace, only: traced_type, trace_motion, trace_equations, solve_equations, are_among, &
        alarm_of, reach_of
    use linkdyn_value, only: value, zero, one, operator(+), operator(*)
    implicit none (type, external)
    private
    public :: rate_outputs, make_rate_program, trace_accelerations, attitude_rates, powers, out_rates

    integer, parameter :: out_rates = 103      !! all that the program gives, in the order of `rate_outputs`

    !> Where everything stands among the outputs of a sample. What comes first is linear in driving forces, unless something rubs.
    type :: rate_outputs
        integer :: n = 0
        integer :: acceleration = 0            !! of the coordinates (n_q)
        integer :: effort = 0                  !! driving forces [N, N m] (n_actuator); 0: they are given
        integer :: transmitted = 0             !! of driving forces, behind rotors, where a transmission loses of it [N, N m] (lossy
                                               !! motor)
        integer :: work = 0                    !! power of the driving forces [W]
        integer :: supplied = 0                !! of all forces but gravity [W]
        integer :: margin = 0                  !! of the closed forms with two assemblies (n_branch)
        integer :: drift = 0                   !! its rate [1/s] (n_branch)
        integer :: counted = 0                 !! rates of the angles that coordinates stand in for [rad/s] (n_q, of others zero)
        integer :: quaternion = 0              !! rates of attitudes that are given so [1/s] (4 n_attitude); 0: by their angles
        integer :: alarm = 0                   !! beyond one, rounding may have grown; not a number if anything was none
        integer :: reach = 0                   !! not above zero: a loop does not close, or hardly
        integer :: slope = 0                   !! what is linear, with the driving force of each lossy motor (n_linear, lossy
                                               !! motor); 0: something rubs
        integer :: n_linear = 0
    end type rate_outputs

contains

    !> Trace a scene and compile its rates. Without pivots that serve the samples no program is made.
    subroutine make_rate_program(model, request, wants_power, sample, program, out, friction)
        type(model_type), intent(in) :: model
        type(trace_request), intent(in) :: request
        logical, intent(in) :: wants_power         !! else it is zero
        type(sample_set), intent(in) :: sample     !! representative: pivots are chosen by them
        type(scene_program), intent(inout) :: program
        type(rate_outputs), intent(out) :: out
        type(friction_programs), intent(inout) :: friction    !! made if joints rub: `program` is then the last of them
        type(record_type), target :: record
        type(traced_type) :: traced
        type(output_list) :: list
        type(value), dimension(model%n_branch) :: margin, drift
        type(value), allocatable :: effort(:), quaternion(:), linear(:), transmitted(:), slope(:)
        type(value) :: power(2)
        integer, allocatable :: lossy(:)       !! actuators

        call open_record(record, sample%n)
        call trace_accelerations(model, request, sample, traced)
        if (traced%mechanism%is_solved) then
            call assembly_margins(traced%mechanism, margin, drift)
            power = zero()
            if (wants_power) power = powers(traced)
            allocate (effort(0))
            if (.not. any(request%acceleration_is_unknown)) effort = solved(traced%system, traced%unknowns%effort)
            lossy = model%motor(lossy_motors(model, .not. request%drive_is_unknown))%actuator
            transmitted = solved(traced%system, traced%unknowns%transmitted(lossy))
            linear = [solved(traced%system, traced%acceleration), effort, transmitted, power]
            quaternion = attitude_rates(traced)
            ! where something rubs what is lost has settled with it
            allocate (slope(0))
            if (.not. allocated(traced%contact)) slope = slopes_with(traced, lossy, linear)
            call add_output(list, out_rates, [linear, margin, drift, counted_rates(traced), quaternion, &
                                              alarm_of(traced), reach_of(traced), slope])
            if (allocated(traced%contact)) then
                call compile_with_friction(record, traced, list, friction, program, traced%in%of(in_effort)%v(lossy), &
                                           [transmitted, slopes_with(traced, lossy, transmitted)])
            else
                call make_scene_program(record, traced%in, list, program)
            end if
            call take_place(model%n_q, out%acceleration)
            call take_place(size(effort), out%effort)
            call take_place(size(lossy), out%transmitted)
            call take_place(1, out%work)
            call take_place(1, out%supplied)
            out%n_linear = out%n
            call take_place(model%n_branch, out%margin)
            call take_place(model%n_branch, out%drift)
            call take_place(model%n_q, out%counted)
            call take_place(size(quaternion), out%quaternion)
            call take_place(1, out%alarm)
            call take_place(1, out%reach)
            call take_place(size(slope), out%slope)
        end if
        call close_record(record)

    contains

        !> The next places, of so many numbers; 0 of none.
        subroutine take_place(n, first)
            integer, intent(in) :: n
            integer, intent(out) :: first

            first = merge(out%n + 1, 0, n > 0)
            out%n = out%n + n
        end subroutine take_place
    end subroutine make_rate_program

    !> Trace motion and equations into the open record, and solve these; ask `mechanism%is_solved` whether pivots have served.
    subroutine trace_accelerations(model, request, sample, traced)
        type(model_type), intent(in) :: model
        type(trace_request), intent(in) :: request
        type(sample_set), intent(in) :: sample
        type(traced_type), intent(inout) :: traced

        call trace_motion(model, request, sample, traced, merged=.true.)
        call trace_equations(request, sparse_layout(model), traced)
        call solve_equations(traced, is_last=are_wanted(traced))
        if (allocated(traced%contact) .and. friction_is_shared(model)) call trace_redundancy([integer ::], traced)
    end subroutine trace_accelerations

    !> Unknown accelerations of the coordinates, or driving forces if there are none, are solved for last: reactions, which
    !> nobody wants, are not computed behind them.
    function are_wanted(traced) result(is_last)
        type(traced_type), intent(in) :: traced
        logical :: is_last(traced%system%n_unknown)

        is_last = .false.
        if (allocated(traced%contact)) return      ! friction comes from reactions
        is_last = are_among(traced, traced%acceleration)
        if (.not. any(is_last)) is_last = are_among(traced, [traced%unknowns%transmitted, traced%virtual])
    end function are_wanted

    !> How values change with the driving forces of some actuators, one after the other.
    function slopes_with(traced, actuator, v) result(slope)
        type(traced_type), intent(in) :: traced
        integer, intent(in) :: actuator(:)
        type(value), intent(in) :: v(:)
        type(value) :: slope(size(v)*size(actuator))
        type(rate_map) :: map
        integer :: j, k

        do j = 1, size(actuator)
            map = rate_map()
            call set_rate(map, traced%in%of(in_effort)%v(actuator(j)), one())
            do k = 1, size(v)
                slope(size(v)*(j - 1) + k) = rate_of(map, v(k))
            end do
        end do
    end function slopes_with

    !> Rates of the angles that coordinates stand in for; zero of others.
    function counted_rates(traced) result(rate)
        type(traced_type), intent(in) :: traced
        type(value) :: rate(traced%mechanism%model%n_q)
        integer :: k

        rate = zero()
        associate (model => traced%mechanism%model)
            do k = 1, model%n_q
                if (counts_for_another(model, k)) rate(k) = variable_rate( &
                    traced%mechanism, model%scene%coordinate(k)%for_joint, model%scene%coordinate(k)%for_variable)
            end do
        end associate
    end function counted_rates

    !> Rates of attitudes, where quaternions give them: their angular velocities stand in place of the rates of angles.
    function attitude_rates(traced) result(rate)
        type(traced_type), intent(in) :: traced
        type(value), allocatable :: rate(:)
        integer :: i

        associate (mechanism => traced%mechanism, model => traced%mechanism%model)
            if (.not. allocated(mechanism%quaternion)) then
                allocate (rate(0))
                return
            end if
            allocate (rate(4*model%n_attitude))
            do i = 1, size(model%step)
                if (.not. gives_attitude(model, model%step(i))) cycle
                associate (p => model%step(i)%first)
                    rate(4*p - 3:4*p) = quaternion_rates(mechanism%quaternion(:, p), mechanism%qd(attitude_angles(model%step(i))))
                end associate
            end do
        end associate
    end function attitude_rates

    !> Power of the driving forces, and of all forces but gravity.
    function powers(traced) result(power)
        type(traced_type), intent(inout) :: traced
        type(value) :: power(2)                    !! [W]
        integer :: i

        power(1) = zero()
        do i = 1, traced%mechanism%model%n_actuator
            associate (actuator => traced%mechanism%model%scene%actuator(i))
                power(1) = power(1) + solved(traced%system, traced%unknowns%effort(i)) &
                           *variable_rate(traced%mechanism, actuator%joint, actuator%variable)
            end associate
        end do
        power(2) = power(1) + solved(traced%system, applied_power(traced))
    end function powers
end module linkdyn_rate_program
