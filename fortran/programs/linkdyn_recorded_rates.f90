!> Rates of forward dynamics by a record of the scene: traced once, run on single samples or on blocks of them.
!>
!> A record serves scenes whose loops all close in closed form. A sample at which it raises its alarm, near a dead point or
!> where a pivot fails, or that is not finite, is left to whoever solves with pivots of its own.
module linkdyn_recorded_rates
    use linkdyn_block, only: block_lanes
    use linkdyn_inputs, only: trace_request, sample_set, in_q, in_quaternion, in_qd, in_qdd, in_load, in_target, in_effort, &
        in_branch
    use linkdyn_kinds, only: wp
    use linkdyn_model, only: model_type
    use linkdyn_rate_program, only: rate_outputs, make_rate_program, out_rates
    use linkdyn_recorded_forces, only: plan_for_records
    use linkdyn_samples, only: sample_arrays, set_block
    use linkdyn_scene_program, only: scene_program, program_space, load_samples, run_samples, run_one_sample, output_target, &
        goes_to, free_scene_program, free_program_space
    implicit none (type, external)
    private
    public :: recorded_rates, rate_samples, record_rates, free_rates, make_rate_samples, free_rate_samples, run_rates

    !> A scene's record. Constant once it is made: threads share it.
    type :: recorded_rates
        logical :: is_usable = .false.                 !! false: the scene has no record
        type(model_type), pointer :: model => null()   !! planned for records
        type(scene_program) :: program
        type(rate_outputs) :: out
    end type recorded_rates

    !> Samples of one thread: what its record takes and gives.
    type :: rate_samples
        real(wp), pointer, contiguous :: q(:, :) => null(), qd(:, :) => null(), qdd(:, :) => null()    !! (n_q, sample)
        real(wp), pointer, contiguous :: quaternion(:, :) => null()    !! of attitudes (4 n_attitude, sample)
        real(wp), pointer, contiguous :: load(:, :) => null()          !! (6 n_load, sample) [N, N m]
        real(wp), pointer, contiguous :: target(:, :) => null()        !! of drives' laws: value and rate (2 n_actuator, sample)
        real(wp), pointer, contiguous :: effort(:, :) => null()        !! driving forces given (n_actuator, sample) [N, N m]
        real(wp), pointer, contiguous :: branch(:, :) => null()        !! (n_branch, sample)
        real(wp), pointer, contiguous :: found(:, :) => null()         !! as `rate_outputs` tells (value, sample)
        logical, allocatable :: is_left(:)                             !! nothing of it counts (sample)
        type(sample_arrays), private :: arrays
        type(program_space), private :: one, block
    end type rate_samples

contains

    !> Trace the scene. Poses are representative: pivots are chosen by them.
    subroutine record_rates(model, request, wants_power, pose, stand, recorded)
        type(model_type), intent(in) :: model
        type(trace_request), intent(in) :: request
        logical, intent(in) :: wants_power
        type(sample_set), intent(in) :: pose                   !! at which all loops close on the start's assembly
        real(wp), intent(in) :: stand(:, :, 0:)                !! axes and origins of the links at the first (3, 4, 0:n_link)
        type(recorded_rates), intent(out) :: recorded
        type(sample_set) :: sample

        allocate (recorded%model)
        if (pose%n == 0 .or. .not. plan_for_records(model, stand, recorded%model)) return
        sample = pose
        sample%of(in_branch)%x = spread(recorded%model%branch, 2, sample%n)
        call make_rate_program(recorded%model, request, wants_power, sample, recorded%program, recorded%out)
        recorded%is_usable = recorded%program%is_made
    end subroutine record_rates

    subroutine free_rates(recorded)
        type(recorded_rates), intent(inout) :: recorded

        call free_scene_program(recorded%program)
        if (associated(recorded%model)) deallocate (recorded%model)
        recorded%is_usable = .false.
    end subroutine free_rates

    !> Room for n samples.
    subroutine make_rate_samples(recorded, n, samples)
        type(recorded_rates), intent(in) :: recorded
        integer, intent(in) :: n
        type(rate_samples), intent(out) :: samples

        associate (model => recorded%model)
            call add(in_q, model%n_q, samples%q)
            call add(in_qd, model%n_q, samples%qd)
            call add(in_qdd, model%n_q, samples%qdd)
            call add(in_quaternion, 4*model%n_attitude, samples%quaternion)
            call add(in_load, 6*model%n_load, samples%load)
            call add(in_target, 2*model%n_actuator, samples%target)
            call add(in_effort, model%n_actuator, samples%effort)
            call add(in_branch, model%n_branch, samples%branch)
        end associate
        allocate (samples%found(recorded%out%n, n), samples%is_left(n))

    contains

        subroutine add(block, rows, x)
            integer, intent(in) :: block, rows
            real(wp), pointer, contiguous, intent(out) :: x(:, :)

            allocate (x(rows, n), source=0.0_wp)
            call set_block(samples%arrays, block, rows, n, x)
        end subroutine add
    end subroutine make_rate_samples

    subroutine free_rate_samples(samples)
        type(rate_samples), intent(inout) :: samples

        if (.not. associated(samples%found)) return
        deallocate (samples%q, samples%qd, samples%qdd, samples%quaternion, samples%load, samples%target, samples%effort, &
                    samples%branch, samples%found)
        call free_program_space(samples%one)
        call free_program_space(samples%block)
    end subroutine free_rate_samples

    !> Run the first n samples, but those that are left already; says which others are.
    subroutine run_rates(recorded, n, samples)
        type(recorded_rates), intent(in) :: recorded
        integer, intent(in) :: n
        type(rate_samples), intent(inout) :: samples
        type(output_target) :: to(1)
        integer :: first, count, i

        if (all(samples%is_left(:n))) return
        if (n == 1) then
            call run_one_sample(recorded%program, samples%arrays, samples%one, samples%found(:, 1))
        else
            to(1) = goes_to(out_rates, samples%found)
            do first = 1, n, block_lanes()
                count = min(block_lanes(), n - first + 1)
                call load_samples(recorded%program, samples%arrays, first, count, samples%block)
                call run_samples(recorded%program, samples%block, first, count, to)
            end do
        end if
        ! Written so that what is no number counts as an alarm.
        do i = 1, n
            samples%is_left(i) = samples%is_left(i) .or. .not. (samples%found(recorded%out%alarm, i) <= 1 &
                                                                .and. samples%found(recorded%out%reach, i) > 0 &
                                                                .and. sum(abs(samples%found(:, i))) <= huge(1.0_wp))
        end do
    end subroutine run_rates
end module linkdyn_recorded_rates
