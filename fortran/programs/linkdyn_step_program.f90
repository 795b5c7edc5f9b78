!> The program of a whole step of the classical Runge-Kutta method, for runs whose rates hang on the state alone: the rates are
!> traced once and stand for all stages, at each with its state in place of the first one.
!>
!> Beside where the step leads it tells whether that is to be believed, as whoever follows an assembly asks (`linkdyn_following`),
!> and what the state is judged by from which the step sets out.
module linkdyn_step_program
    use linkdyn_inputs, only: trace_request, sample_set, in_q, in_qd, in_quaternion, in_step, add_inputs
    use linkdyn_kinds, only: wp
    use linkdyn_margins, only: assembly_margins
    use linkdyn_model, only: model_type
    use linkdyn_motion_quantities, only: link_energy, gravity_energy
    use linkdyn_rate_program, only: trace_accelerations, attitude_rates, powers
    use linkdyn_record, only: record_type, open_record, close_record
    use linkdyn_scene_program, only: scene_program, output_list, add_output, make_scene_program
    use linkdyn_substitution, only: substitution, replace, substituted
    use linkdyn_system, only: solved
    use linkdyn_trace, only: traced_type, alarm_of, reach_of
    use linkdyn_value, only: value, zero, one, operator(+), operator(-), operator(*), min, max, abs, select
    implicit none (type, external)
    private
    public :: state_places, step_judge, step_inputs, step_outputs, inputs_of_step, make_step_program, out_steps

    integer, parameter :: out_steps = 106      !! all that the program gives, in the order of `step_outputs`

    !> Where everything stands in a state; whoever integrates knows.
    type :: state_places
        integer :: n = 0
        integer, allocatable :: position(:)    !! of a coordinate; 0: it has a quaternion (n_q)
        integer, allocatable :: rate(:)        !! (n_q)
        integer, allocatable :: quaternion(:)  !! its first number; 0: none (n_attitude)
        integer :: work = 0                    !! of the driving forces
        integer :: supplied = 0                !! by all forces but gravity
    end type state_places

    !> By what steps are believed.
    type :: step_judge
        logical :: follows = .false.           !! assemblies are told from each other; else the rest does not matter
        logical :: passes = .false.            !! the mechanism may pass change points
        real(wp) :: look_ahead = 0             !! how far margins are led on, in steps
        real(wp), allocatable :: least(:)      !! margins that are told from zero (n_branch)
        real(wp), allocatable :: farthest(:)   !! a coordinate may get (n_q) [m, rad]
    end type step_judge

    !> Where everything begins in block `in_step`, and among the outputs: what a step takes the one before gives, so that its
    !> outputs are the next one's inputs.
    type :: step_inputs
        integer :: n = 0
        integer :: length = 0                  !! of the step [s]
        integer :: ahead = 0                   !! from the state accepted last to where it begins [s]
        integer :: from = 0                    !! coordinates of the state accepted last (n_q)
        integer :: margin = 0, drift = 0       !! there, of the closed forms with two assemblies (n_branch) [1], [1/s]
        integer :: y = 0                       !! where the step begins; as an output, where it leads (n)
        integer :: rest = 0                    !! to be added to it, less than its last place (n)
    end type step_inputs

    !> Where the other outputs stand, behind these. Of them the state accepted last is the one where the step begins.
    type :: step_outputs
        integer :: n = 0
        integer :: kinetic = 0                 !! where the step begins: energy of links and rotors [J]
        integer :: energy = 0                  !! that with what gravity adds to it [J]
        integer :: certain = 0                 !! not above zero: at a stage rounding may have grown, a loop does not close, or an
                                               !! assembly may have been left; or it is not told where the step begins
        integer :: first = 0, last = 0         !! rates where the step begins, and at its last stage (n)
    end type step_outputs

contains

    pure type(step_inputs) function inputs_of_step(model, n) result(in)
        type(model_type), intent(in) :: model
        integer, intent(in) :: n               !! numbers of a state

        in = step_inputs(length=1, ahead=2, from=3, margin=3 + model%n_q)
        in%drift = in%margin + model%n_branch
        in%y = in%drift + model%n_branch
        in%rest = in%y + n
        in%n = in%rest + n - 1
    end function inputs_of_step

    !> Trace a scene and compile a step. Without pivots that serve the samples no program is made.
    subroutine make_step_program(model, request, wants_power, places, judge, sample, program, out)
        type(model_type), intent(in) :: model
        type(trace_request), intent(in) :: request
        logical, intent(in) :: wants_power         !! else nothing is supplied
        type(state_places), intent(in) :: places
        type(step_judge), intent(in) :: judge
        type(sample_set), intent(in) :: sample     !! representative: pivots are chosen by them
        type(scene_program), intent(inout) :: program
        type(step_outputs), intent(out) :: out
        type(record_type), target :: record
        type(traced_type) :: traced

        call open_record(record, sample%n)
        call trace_accelerations(model, request, sample, traced)
        if (traced%mechanism%is_solved) call trace_step(record, wants_power, places, judge, sample, traced, program, out)
        call close_record(record)
    end subroutine make_step_program

    !> The step from the rates, whose trace is there.
    subroutine trace_step(record, wants_power, places, judge, sample, traced, program, out)
        type(record_type), intent(in) :: record
        logical, intent(in) :: wants_power
        type(state_places), intent(in) :: places
        type(step_judge), intent(in) :: judge
        type(sample_set), intent(in) :: sample
        type(traced_type), intent(inout) :: traced
        type(scene_program), intent(inout) :: program
        type(step_outputs), intent(out) :: out
        real(wp), parameter :: part(2:4) = [0.5_wp, 0.5_wp, 1.0_wp], weight(2:4) = [2.0_wp, 2.0_wp, 1.0_wp]
        type(output_list) :: list
        type(step_inputs) :: at
        type(value), dimension(places%n) :: y, rate, of_stage, total, way, sum, added
        type(value), dimension(traced%mechanism%model%n_branch) :: margin, drift, margin_there, drift_there
        type(value) :: kinetic, alarm, reach, sound, judged(2)
        integer :: i

        at = inputs_of_step(traced%mechanism%model, places%n)
        call add_inputs(in_step, at%n, sample, traced%in)
        associate (x => traced%in%of(in_step)%v, q => traced%in%of(in_q)%v)
            call state_and_rates(traced, places, at, wants_power, y, rate)
            call assembly_margins(traced%mechanism, margin, drift)
            alarm = alarm_of(traced)
            reach = reach_of(traced)
            judged = [alarm, reach]
            kinetic = link_energy(traced%mechanism)
            sound = min(soundness(judge, places, x(at%from:at%margin - 1), x(at%margin:at%drift - 1), x(at%drift:at%y - 1), y, &
                                  margin, drift, x(at%ahead)), least_told(judge, margin))
            of_stage = rate
            total = rate
            do i = 2, 4
                call go_to_stage(part(i)*x(at%length))
                total = total + weight(i)*of_stage
            end do
            way = ((1.0_wp/6)*x(at%length))*total + x(at%rest:at%n)
            sum = y + way
            added = sum - y
            call add_output(list, out_steps, [x(at%length), x(at%length), q, margin, drift, sum, &
                                              (y - (sum - added)) + (way - added)])
            call add_output(list, out_steps, [kinetic, kinetic + gravity_energy(traced%mechanism), &
                                              select(alarm - 1.0_wp, -one(), min(reach, sound)), rate, of_stage])
        end associate
        call make_scene_program(record, traced%in, list, program)
        out = step_outputs(n=at%n + 3 + 2*places%n, kinetic=at%n + 1, energy=at%n + 2, certain=at%n + 3, first=at%n + 4, &
                           last=at%n + 4 + places%n)

    contains

        !> Rates at the state to which those of the stage before lead, and whether they count.
        subroutine go_to_stage(ahead)
            type(value), intent(in) :: ahead
            type(substitution) :: map
            type(value) :: stage(places%n), there(2)

            stage = y + ahead*of_stage
            call replace(map, y, stage)
            of_stage = substituted(map, rate)
            there = substituted(map, judged)
            alarm = max(there(1), alarm)
            reach = min(there(2), reach)
            margin_there = substituted(map, margin)
            drift_there = substituted(map, drift)
            sound = min(soundness(judge, places, traced%in%of(in_q)%v, margin, drift, stage, margin_there, &
                                  drift_there, ahead), sound)
        end subroutine go_to_stage
    end subroutine trace_step

    !> The numbers of a state, and its rates.
    subroutine state_and_rates(traced, places, at, wants_power, y, rate)
        type(traced_type), intent(inout) :: traced
        type(state_places), intent(in) :: places
        type(step_inputs), intent(in) :: at
        logical, intent(in) :: wants_power
        type(value), intent(out) :: y(:), rate(:)
        type(value), allocatable :: acceleration(:), turning(:)
        type(value) :: power(2)
        integer :: k, p

        acceleration = solved(traced%system, traced%acceleration)
        turning = attitude_rates(traced)
        associate (in => traced%in%of)
            do k = 1, size(acceleration)
                y(places%rate(k)) = in(in_qd)%v(k)
                rate(places%rate(k)) = acceleration(k)
                if (places%position(k) == 0) cycle
                y(places%position(k)) = in(in_q)%v(k)
                rate(places%position(k)) = in(in_qd)%v(k)
            end do
            do p = 1, size(places%quaternion)
                if (places%quaternion(p) == 0) cycle
                associate (first => places%quaternion(p), of => [(4*p - 3 + k, k=0, 3)])
                    y(first:first + 3) = in(in_quaternion)%v(of)
                    rate(first:first + 3) = turning(of)
                end associate
            end do
            y(places%work) = in(in_step)%v(at%y + places%work - 1)
            y(places%supplied) = in(in_step)%v(at%y + places%supplied - 1)
        end associate
        power = zero()
        if (wants_power) power = powers(traced)
        rate(places%work) = power(1)
        rate(places%supplied) = power(2)
    end subroutine state_and_rates

    !> Above zero where each map tells on which side it is: between such states no change point is passed that soundness does not
    !> see.
    function least_told(judge, margin) result(told)
        type(step_judge), intent(in) :: judge
        type(value), intent(in) :: margin(:)           !! (n_branch)
        type(value) :: told
        integer :: m

        told = one()
        if (.not. judge%follows) return
        do m = 1, size(margin)
            told = min(abs(margin(m)) - judge%least(m), told)
        end do
    end function least_told

    !> Above zero where the way from the accepted state surely has kept each map on its side, and is not so far that its end would
    !> not tell: `doubt_unsound`, `note_doubt` and `note_far` ask the same on lanes.
    function soundness(judge, places, from, before, drift_before, y, now, drift_now, ahead) result(sound)
        type(step_judge), intent(in) :: judge
        type(state_places), intent(in) :: places
        type(value), intent(in) :: from(:)             !! coordinates of the accepted state (n_q)
        type(value), intent(in) :: before(:), drift_before(:)  !! its margins and their rates (n_branch)
        type(value), intent(in) :: y(:)                !! the state tried
        type(value), intent(in) :: now(:), drift_now(:)        !! there
        type(value), intent(in) :: ahead               !! how long the way takes [s]
        type(value) :: sound, lead
        integer :: k, m

        sound = one()
        if (.not. judge%follows) return
        lead = judge%look_ahead*ahead
        do m = 1, size(now)
            associate (least => judge%least(m))
                sound = min(select(abs(before(m)) - least, min(before(m)*(before(m) + lead*drift_before(m)), before(m)*now(m)), &
                                   one()), sound)
                sound = min(select(abs(now(m)) - least, now(m)*(now(m) - lead*drift_now(m)), one()), sound)
                if (.not. judge%passes) sound = min(abs(now(m)) - least, sound)
            end associate
        end do
        do k = 1, merge(size(from), 0, size(now) > 0)
            if (places%position(k) > 0) sound = min(judge%farthest(k) - abs(y(places%position(k)) - from(k)), sound)
        end do
    end function soundness
end module linkdyn_step_program
