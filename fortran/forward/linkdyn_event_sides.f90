!> Results just before and just behind the instants at which something happens in a forward run: an impact, a stop that lets go, a
!> brake that comes on. Forces jump there, and their largest values may lie between the samples of output.
!>
!> Each side is evaluated when the run stands there, as a sample of output is, and by the same procedures: what the run does next
!> does not feel it. Of the results those are kept that jump (`layout_of_jumps`).
module linkdyn_event_sides
    use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan
    use linkdyn_clutch_states, only: clutch_states
    use linkdyn_forward_block, only: open_block, complete_block
    use linkdyn_forward_run, only: forward_run
    use linkdyn_forward_samples, only: forward_results, output_samples, begin_samples, add_sample, find_forces
    use linkdyn_forward_system, only: event_witness, standing_lanes
    use linkdyn_kinds, only: wp
    use linkdyn_lane_count, only: lanes
    use linkdyn_motor_states, only: motor_states
    use linkdyn_result_kinds, only: result_status, is_made_of_forces
    use linkdyn_results, only: layout_type, block_type, layout_of_jumps, prepare_block, samples_width, variable_index
    use linkdyn_scene, only: n_event
    use linkdyn_status, only: sample_undefined
    use linkdyn_stop_states, only: stop_states
    implicit none (type, external)
    private
    public :: event_sides, watch_events, sort_by_events, n_side

    integer, parameter :: n_side = 2                   !! before, behind

    type, extends(event_witness) :: event_sides
        type(layout_type) :: layout                    !! of the results that are kept
        integer :: n = 0                               !! instants so far
        type(block_type) :: block                      !! two samples each, before and behind; not allocated: nobody looks
        type(forward_run), pointer, private :: run => null()
        type(block_type), private :: one               !! the side looked at
        integer, private :: n_log = 0                  !! entries before the instant
    contains
        procedure :: see => see_side
    end type event_sides

contains

    !> Look at what happens in a run from here on, if anything may and some force is among its results.
    subroutine watch_events(run, layout, sides)
        type(forward_run), intent(inout), target :: run    !! must outlive what looks at it
        type(layout_type), intent(in) :: layout        !! of the run's results
        type(event_sides), intent(inout), target :: sides  !! must outlive the run
        integer, parameter :: few = 16                 !! instants

        if (n_event(run%own%scene) == 0 .or. .not. any(is_made_of_forces(layout%variable%id))) return
        sides%layout = layout_of_jumps(layout)
        sides%run => run
        call prepare_block(sides%layout, 1, sides%one)
        call prepare_block(sides%layout, n_side*few, sides%block)
        run%system%witness => sides
    end subroutine watch_events

    !> What is kept, by the events of the log: two samples an event, before and behind. Nothing if nobody has looked.
    subroutine sort_by_events(sides, beside, block)
        type(event_sides), intent(in) :: sides
        integer, intent(in) :: beside(:)               !! as of the events' entries
        type(block_type), intent(out) :: block
        type(block_type) :: one
        integer :: i, k, width, from, to

        if (.not. allocated(sides%block%of)) return
        call prepare_block(sides%layout, n_side*size(beside), block)
        call prepare_block(sides%layout, 1, one)
        call leave_out(sides%layout, one)
        do i = 1, size(block%of)
            width = n_side*samples_width(sides%layout, sides%layout%variable(i))
            do k = 1, size(beside)
                to = (k - 1)*width
                from = (beside(k) - 1)*width
                if (allocated(block%of(i)%integer)) then
                    block%of(i)%integer(to + 1:to + width) = [one%of(i)%integer, one%of(i)%integer]
                    if (beside(k) > 0) block%of(i)%integer(to + 1:to + width) = sides%block%of(i)%integer(from + 1:from + width)
                else
                    block%of(i)%real(to + 1:to + width) = [one%of(i)%real, one%of(i)%real]
                    if (beside(k) > 0) block%of(i)%real(to + 1:to + width) = sides%block%of(i)%real(from + 1:from + width)
                end if
            end do
        end do
    end subroutine sort_by_events

    !> One side. Where nothing has been noted that is worth while no other side.
    subroutine see_side(self, t, y, is_behind)
        class(event_sides), intent(inout) :: self
        real(wp), intent(in) :: t                      !! [s]
        real(wp), intent(in) :: y(:, :)                !! (lane, n of the system)
        logical, intent(in) :: is_behind

        associate (log => self%run%system%way%log)
            if (.not. is_behind) self%n_log = log%n
            if (is_behind .and. log%n == self%n_log) return
            if (self%run%system%way%is_driven_through(1)) then
                call leave_out(self%layout, self%one)
            else
                call look_at_side(self%run, self%layout, t, y, is_behind, self%one)
            end if
            call keep(self%layout, self%one, n_side*self%n + merge(2, 1, is_behind), self%block)
            if (.not. is_behind) return
            self%n = self%n + 1
            log%entry(self%n_log + 1:log%n)%beside = self%n
        end associate
    end subroutine see_side

    !> What is there, as a sample; the run stands as it did.
    subroutine look_at_side(run, layout, t, y, is_behind, block)
        type(forward_run), intent(inout) :: run
        type(layout_type), intent(in) :: layout
        real(wp), intent(in) :: t                      !! of the event [s]
        real(wp), intent(in) :: y(:, :)                !! there (lane, n of the system)
        logical, intent(in) :: is_behind
        type(block_type), intent(inout) :: block
        type(clutch_states) :: clutch
        type(stop_states) :: stops
        type(motor_states) :: motors
        real(wp), allocatable :: side(:, :)
        real(wp) :: t_side
        integer :: n_crossed

        n_crossed = run%n_crossed                      ! counted from sample to sample of output
        clutch = run%system%way%clutch                 ! with what they hold and take at the state evaluated last
        stops = run%system%way%stops
        motors = run%system%way%motors
        side = y
        t_side = t + way_aside(run, t, is_behind)
        if (run%system%may_jump) call step_aside(run, t, t_side - t, side)
        call evaluate_side(run, layout, t_side, side, block)
        run%system%way%clutch = clutch
        run%system%way%stops = stops
        run%system%way%motors = motors
        run%n_crossed = n_crossed
    end subroutine look_at_side

    !> An event is found to the last places of the clock, and stands behind its zero; laws over time and state that jump with it do
    !> so by formulas of their own. Both sides are taken a little away from there.
    pure real(wp) function way_aside(run, t, is_behind) result(way)
        type(forward_run), intent(in) :: run
        real(wp), intent(in) :: t                      !! [s]
        logical, intent(in) :: is_behind
        integer, parameter :: last_places = 1024       !! of the clock: events stand some tens of them behind their zeros

        way = merge(1, -1, is_behind)*last_places*spacing(max(abs(t), run%system%span))
    end function way_aside

    !> The state a little away, along its rates.
    subroutine step_aside(run, t, way, y)
        type(forward_run), intent(inout) :: run
        real(wp), intent(in) :: t                      !! of the event [s]
        real(wp), intent(in) :: way                    !! [s]
        real(wp), intent(inout) :: y(:, :)             !! there (lane, n of the system)
        type(standing_lanes) :: standing
        real(wp) :: rate(lanes, size(y, 2))
        logical :: failed(lanes)

        call run%system%leave_standing_here(t, 1, standing)
        call run%system%evaluate_on_lanes(spread(t, 1, lanes), y, rate, failed, standing)
        if (.not. failed(1)) y = y + way*rate
    end subroutine step_aside

    !> Where the run stands, as a sample.
    subroutine evaluate_side(run, layout, t, y, block)
        type(forward_run), intent(inout) :: run
        type(layout_type), intent(in) :: layout
        real(wp), intent(in) :: t                      !! [s]
        real(wp), intent(in) :: y(:, :)                !! (lane, n of the system)
        type(block_type), intent(inout), target :: block
        type(output_samples) :: samples
        type(forward_results) :: results
        real(wp), allocatable, target :: brake(:, :)

        call open_block(run, layout, 1, block, brake, results)
        call begin_samples(run, [t], .false., samples)
        call add_sample(run, y, 1, samples, results)
        call find_forces(run, 1, samples, results)
        if (samples%n_found == 1) then
            call complete_block(layout, 1, block, results)
        else                                           ! an interrupt came between
            call results%forces%free()
            call leave_out(layout, block)
        end if
    end subroutine evaluate_side

    !> No sample stands there.
    subroutine leave_out(layout, block)
        type(layout_type), intent(in) :: layout
        type(block_type), intent(inout) :: block       !! of one sample
        integer :: i

        do i = 1, size(layout%variable)
            if (layout%variable(i)%is_integer) then
                block%of(i)%integer = 0
            else
                block%of(i)%real = ieee_value(1.0_wp, ieee_quiet_nan)
            end if
        end do
        block%of(variable_index(layout, result_status))%integer = sample_undefined
    end subroutine leave_out

    !> Put a sample in its place; the block grows as it must.
    subroutine keep(layout, one, sample, block)
        type(layout_type), intent(in) :: layout
        type(block_type), intent(in) :: one
        integer, intent(in) :: sample
        type(block_type), intent(inout) :: block
        type(block_type) :: longer
        integer :: i, width

        if (sample*samples_width(layout, layout%variable(1)) > size_of(1)) then
            call prepare_block(layout, 2*(sample - 1), longer)
            do i = 1, size(layout%variable)
                if (layout%variable(i)%is_integer) then
                    longer%of(i)%integer(:size_of(i)) = block%of(i)%integer
                else
                    longer%of(i)%real(:size_of(i)) = block%of(i)%real
                end if
            end do
            call move_alloc(longer%of, block%of)
        end if
        do i = 1, size(layout%variable)
            width = samples_width(layout, layout%variable(i))
            if (layout%variable(i)%is_integer) then
                block%of(i)%integer((sample - 1)*width + 1:sample*width) = one%of(i)%integer
            else
                block%of(i)%real((sample - 1)*width + 1:sample*width) = one%of(i)%real
            end if
        end do

    contains

        pure integer function size_of(i)
            integer, intent(in) :: i                   !! variable

            if (layout%variable(i)%is_integer) then
                size_of = size(block%of(i)%integer)
            else
                size_of = size(block%of(i)%real)
            end if
        end function size_of
    end subroutine keep
end module linkdyn_event_sides
