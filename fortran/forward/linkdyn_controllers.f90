!> The controllers of a run: what they remember, what they put out, and when they take samples.
!>
!> A sampled controller takes samples at instants counted from the start of the run. What comes of one takes effect when its delay
!> has passed, and stays until the next one does. All lanes take samples at the same instants.
module linkdyn_controllers
    use, intrinsic :: iso_fortran_env, only: int64
    use linkdyn_control_law, only: control_sight, control_memory, control_continuously, control_a_sample
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_scene, only: controller_spec, is_sampled
    implicit none (type, external)
    private
    public :: controllers_type, begin_controllers, next_instant, take_samples, put_out_samples, run_continuous

    type :: controllers_type
        integer :: n = 0
        real(wp) :: t_start = 0                        !! [s]
        real(wp), allocatable :: target(:, :)          !! as seen last (lane, n) [m, rad, ..]
        real(wp), allocatable :: error(:, :)           !! (lane, n) [m, rad, ..]
        real(wp), allocatable :: output(:, :)          !! in effect (lane, n) [N, N m, V]
        logical, allocatable :: is_limited(:, :)       !! (lane, n)
        integer :: blind = 0                           !! one whose output was no number since that was set to zero, on lane 1
        real(wp), allocatable :: integral_rate(:, :), slope_rate(:, :)     !! of continuous ones, as seen last (lane, n)
        integer(int64), allocatable, private :: n_taken(:), n_out(:)       !! samples taken, and in effect or past (n)
        type(control_memory), allocatable, private :: memory(:, :)         !! (lane, n)
        real(wp), allocatable, private :: waiting(:, :, :)                 !! outputs to come (lane, place, n)
        logical, allocatable, private :: waiting_limited(:, :, :)
    end type controllers_type

contains

    !> Before the first sample.
    subroutine begin_controllers(spec, t, control)
        type(controller_spec), intent(in) :: spec(:)
        real(wp), intent(in) :: t                      !! [s]
        type(controllers_type), intent(out) :: control
        integer :: n_place, i

        control%n = size(spec)
        control%t_start = t
        allocate (control%target(lanes, control%n), control%error(lanes, control%n), control%output(lanes, control%n), &
                  control%integral_rate(lanes, control%n), control%slope_rate(lanes, control%n), source=0.0_wp)
        allocate (control%is_limited(lanes, control%n), source=.false.)
        allocate (control%n_taken(control%n), control%n_out(control%n), source=0_int64)
        allocate (control%memory(lanes, control%n))
        n_place = 1
        do i = 1, control%n
            if (is_sampled(spec(i))) n_place = max(n_place, ceiling(spec(i)%delay/spec(i)%period) + 2)
            ! what stays before the first sample takes effect is within the limits
            control%output(:, i) = min(max(0.0_wp, spec(i)%low), spec(i)%high)
        end do
        allocate (control%waiting(lanes, n_place, control%n), source=0.0_wp)
        allocate (control%waiting_limited(lanes, n_place, control%n), source=.false.)
    end subroutine begin_controllers

    !> The next instant at which a controller takes a sample, or one takes effect; huge: none.
    pure real(wp) function next_instant(spec, control) result(next)
        type(controller_spec), intent(in) :: spec(:)
        type(controllers_type), intent(in) :: control
        integer :: i

        next = huge(next)
        do i = 1, control%n
            if (.not. is_sampled(spec(i))) cycle
            next = min(next, sampling(spec(i), control, control%n_taken(i)))
            if (control%n_out(i) < control%n_taken(i)) next = min(next, effect(spec(i), control, control%n_out(i)))
        end do
    end function next_instant

    !> Instant of sample number k, from 0 on.
    pure real(wp) function sampling(spec, control, k)
        type(controller_spec), intent(in) :: spec
        type(controllers_type), intent(in) :: control
        integer(int64), intent(in) :: k

        sampling = control%t_start + k*spec%period
    end function sampling

    !> Instant at which it takes effect; after whole samples that of another sample, to the last digit.
    pure real(wp) function effect(spec, control, k)
        type(controller_spec), intent(in) :: spec
        type(controllers_type), intent(in) :: control
        integer(int64), intent(in) :: k
        real(wp), parameter :: close = 1.0e-9_wp       !! of a period
        real(wp) :: samples

        samples = spec%delay/spec%period
        if (abs(samples - anint(samples)) < close) then
            effect = sampling(spec, control, k + nint(samples, int64))
        else
            effect = sampling(spec, control, k) + spec%delay
        end if
    end function effect

    !> Has an instant come? One that rounding of the caller's puts a little ahead has.
    pure logical function has_come(spec, instant, t)
        type(controller_spec), intent(in) :: spec
        real(wp), intent(in) :: instant, t             !! [s]
        real(wp), parameter :: close = 1.0e-9_wp       !! of a period

        has_come = instant <= t + max(close*spec%period, 4*spacing(t))
    end function has_come

    !> Take the samples that are due.
    subroutine take_samples(spec, t, sight, control)
        type(controller_spec), intent(in) :: spec(:)
        real(wp), intent(in) :: t                      !! [s]
        type(control_sight), intent(in) :: sight(:, :) !! (lane, n)
        type(controllers_type), intent(inout) :: control
        integer :: i, place

        do i = 1, control%n
            if (.not. is_sampled(spec(i))) cycle
            if (.not. has_come(spec(i), sampling(spec(i), control, control%n_taken(i)), t)) cycle
            place = place_of(control, control%n_taken(i))
            control%target(:, i) = sight(:, i)%target
            call control_a_sample(spec(i), sight(:, i), control%memory(:, i), control%error(:, i), &
                                  control%waiting(:, place, i), control%waiting_limited(:, place, i))
            control%n_taken(i) = control%n_taken(i) + 1
        end do
    end subroutine take_samples

    !> Samples whose delay has passed take effect.
    subroutine put_out_samples(spec, t, control)
        type(controller_spec), intent(in) :: spec(:)
        real(wp), intent(in) :: t                      !! [s]
        type(controllers_type), intent(inout) :: control
        integer :: i, place

        do i = 1, control%n
            do while (control%n_out(i) < control%n_taken(i))
                if (.not. has_come(spec(i), effect(spec(i), control, control%n_out(i)), t)) exit
                place = place_of(control, control%n_out(i))
                control%output(:, i) = control%waiting(:, place, i)
                control%is_limited(:, i) = control%waiting_limited(:, place, i)
                control%n_out(i) = control%n_out(i) + 1
                call note_blind(i, control)
            end do
        end do
    end subroutine put_out_samples

    !> Where a sample waits.
    pure integer function place_of(control, k)
        type(controllers_type), intent(in) :: control
        integer(int64), intent(in) :: k

        place_of = 1 + int(modulo(k, size(control%waiting, 2, int64)))
    end function place_of

    !> Outputs of continuous controllers at states, and rates of what they have among these.
    subroutine run_continuous(spec, sight, integral, slope, control)
        type(controller_spec), intent(in) :: spec(:)
        type(control_sight), intent(in) :: sight(:, :) !! (lane, n)
        real(wp), intent(in) :: integral(:, :), slope(:, :)    !! (lane, n)
        type(controllers_type), intent(inout) :: control
        integer :: i

        do i = 1, control%n
            if (is_sampled(spec(i))) cycle
            control%target(:, i) = sight(:, i)%target
            call control_continuously(spec(i), sight(:, i), integral(:, i), slope(:, i), control%error(:, i), &
                                      control%output(:, i), control%is_limited(:, i), control%integral_rate(:, i), &
                                      control%slope_rate(:, i))
            call note_blind(i, control)
        end do
    end subroutine run_continuous

    pure subroutine note_blind(i, control)
        integer, intent(in) :: i
        type(controllers_type), intent(inout) :: control

        if (control%blind == 0 .and. .not. abs(control%output(1, i)) <= huge(1.0_wp)) control%blind = i
    end subroutine note_blind
end module linkdyn_controllers
