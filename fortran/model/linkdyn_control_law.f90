!> What a controller makes of what it sees: P, I and D parts, limits, and what becomes of the integral there. It knows no body.
!>
!> A continuous one has its integral, and what a filter leaves of its D part, among the states of the integration. A sampled one
!> takes sums and differences of its samples, as a program on a processor does.
module linkdyn_control_law
    use linkdyn_kinds, only: wp
    use linkdyn_scene, only: controller_spec, windup_clamp, windup_back
    implicit none (type, external)
    private
    public :: control_sight, control_memory, control_continuously, control_a_sample

    !> What a controller sees.
    type :: control_sight
        real(wp) :: target = 0, target_rate = 0        !! [m, rad, ..; /s]
        real(wp) :: measured = 0, measured_rate = 0
        real(wp) :: feed = 0                           !! beside what its error asks for [N, N m, V]
    end type control_sight

    !> What a sampled controller remembers.
    type :: control_memory
        logical :: is_fresh = .true.                   !! there was no sample so far
        real(wp) :: integral = 0                       !! part of the output [N, N m, V]
        real(wp) :: slope = 0                          !! D part of the last sample [N, N m, V]
        real(wp) :: last = 0                           !! of what it takes differences
    end type control_memory

contains

    !> Output of a continuous controller, and rates of its states.
    elemental subroutine control_continuously(spec, sight, integral, slope, error, output, is_limited, integral_rate, slope_rate)
        type(controller_spec), intent(in) :: spec
        type(control_sight), intent(in) :: sight
        real(wp), intent(in) :: integral               !! I part [N, N m, V]
        real(wp), intent(in) :: slope                  !! D part behind its filter
        real(wp), intent(out) :: error                 !! target less what is measured
        real(wp), intent(out) :: output                !! [N, N m, V]
        logical, intent(out) :: is_limited
        real(wp), intent(out) :: integral_rate, slope_rate     !! [/s]
        real(wp) :: asked, damping

        error = sight%target - sight%measured
        damping = spec%kd*(sight%target_rate - sight%measured_rate)
        if (spec%damps_measured) damping = -spec%kd*sight%measured_rate
        slope_rate = 0
        if (spec%filter > 0) then
            slope_rate = (damping - slope)/spec%filter
            damping = slope
        end if
        asked = spec%kp*error + integral + damping + sight%feed
        output = within_limits(spec, asked)
        is_limited = abs(output - asked) > 0
        integral_rate = spec%ki*error
        if (spec%windup == windup_back) integral_rate = integral_rate + (output - asked)/spec%tracking_time
    end subroutine control_continuously

    !> Take one sample.
    elemental subroutine control_a_sample(spec, sight, memory, error, output, is_limited)
        type(controller_spec), intent(in) :: spec
        type(control_sight), intent(in) :: sight       !! rates are not looked at
        type(control_memory), intent(inout) :: memory
        real(wp), intent(out) :: error                 !! target less what is measured, as finely as it is measured
        real(wp), intent(out) :: output                !! [N, N m, V]
        logical, intent(out) :: is_limited
        real(wp) :: measured, compared, asked, growth

        measured = nearest_step(sight%measured, spec%resolution)
        error = sight%target - measured
        compared = error
        if (spec%damps_measured) compared = -measured
        if (memory%is_fresh) memory%last = compared
        memory%is_fresh = .false.
        memory%slope = (spec%filter*memory%slope + spec%kd*(compared - memory%last))/(spec%filter + spec%period)
        memory%last = compared
        growth = spec%ki*spec%period*error
        memory%integral = memory%integral + growth
        asked = spec%kp*error + memory%integral + memory%slope + sight%feed
        output = within_limits(spec, asked)
        is_limited = abs(output - asked) > 0
        if (is_limited .and. spec%windup == windup_clamp .and. (asked - output)*growth > 0) then
            memory%integral = memory%integral - growth
            output = within_limits(spec, asked - growth)
            is_limited = abs(output - (asked - growth)) > 0
        else if (is_limited .and. spec%windup == windup_back) then
            memory%integral = memory%integral + min(1.0_wp, spec%period/spec%tracking_time)*(output - asked)
        end if
        if (spec%output_resolution > 0) output = inner_step(spec, output)
    end subroutine control_a_sample

    !> What is no number stays none.
    elemental real(wp) function within_limits(spec, asked) result(output)
        type(controller_spec), intent(in) :: spec
        real(wp), intent(in) :: asked

        output = asked
        if (asked > spec%high) output = spec%high
        if (asked < spec%low) output = spec%low
    end function within_limits

    !> The nearest whole number of steps; a resolution of zero is as fine as can be.
    elemental real(wp) function nearest_step(number, resolution)
        real(wp), intent(in) :: number, resolution

        nearest_step = number
        if (resolution > 0) nearest_step = resolution*anint(number/resolution)
    end function nearest_step

    !> The nearest step of the output within its limits.
    elemental real(wp) function inner_step(spec, output) result(stepped)
        type(controller_spec), intent(in) :: spec
        real(wp), intent(in) :: output

        stepped = nearest_step(output, spec%output_resolution)
        if (stepped > spec%high) stepped = stepped - spec%output_resolution
        if (stepped < spec%low) stepped = stepped + spec%output_resolution
    end function inner_step
end module linkdyn_control_law
