!> A forward run, alone or with an estimate of the error that it has gathered since its start.
!>
!> For the estimate two companions move through the same instants of output, one of them with much smaller steps. Each is a
!> mechanism similar to the scene's, of another size (`linkdyn_similar_model`), so it rounds differently from its data on. How
!> far the run is from them shows what its steps leave out and what rounding has made of it, grown as the motion makes errors
!> grow. A companion is a run like any other: it knows nothing of the one it watches.
!>
!> docs/theory.md gives the reasoning, docs/accuracy.md how well the estimates hold.
module linkdyn_forward_errors
    use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_positive_inf, ieee_is_nan
    use linkdyn_event_sides, only: event_sides, watch_events
    use linkdyn_forward, only: forward_options, forward_run, start_forward, interrupt_forward, finish_forward
    use linkdyn_forward_block, only: advance_block
    use linkdyn_integrator, only: tightened
    use linkdyn_kinds, only: wp
    use linkdyn_led_mechanism, only: follows_assembly
    use linkdyn_model, only: model_type, dyad_names
    use linkdyn_results, only: layout_type, variable_type, block_type, wanted_type, describe_results, prepare_block, &
        variable_index, samples_width, dim_component, estimated, estimate_of
    use linkdyn_result_kinds, only: result_time, result_q
    use linkdyn_roads, only: road_counts
    use linkdyn_similar_model, only: make_similar
    use linkdyn_status, only: status_type
    use linkdyn_whole_turns, only: least_angle
    implicit none (type, external)
    private
    public :: watched_run, start_watched, advance_watched, interrupt_watched, finish_watched, time_reached

    integer, parameter :: n_companion = 2
    ! Sizes that change the digits of numbers in general, but keep sums of a few digits exact: what folds flat exactly still does.
    real(wp), parameter :: scale_of(n_companion) = [1.25_wp, 0.75_wp]
    ! What their step and tolerances are divided by. The second one's steps differ from the run's, lest they round alike.
    real(wp), parameter :: step_part(n_companion) = [2.0_wp, 1.25_wp], tolerance_part(n_companion) = [100.0_wp, 3.0_wp]

    ! An estimate is `safety` times the largest of the differences and of `floor_part` epsilons of the whole force, moment
    ! or coordinate; `alone` times that where one companion only has come along. docs/accuracy.md shows how they were found.
    real(wp), parameter :: safety = 20, floor_part = 0.5_wp, alone = 5

    !> The same run of a similar mechanism.
    type :: companion_type
        type(model_type), pointer :: model => null()   !! `run` points to it
        type(forward_run) :: run
        real(wp) :: scale = 1                          !! its size
        type(layout_type) :: layout
        real(wp), allocatable :: t(:)                  !! instants to go through: those of output, and between them [s]
        integer :: n_done = 0                          !! of them
        type(block_type) :: block                      !! results at the instants of output
    end type companion_type

    !> A run under way, and its companions.
    type :: watched_run
        type(forward_run) :: run
        type(layout_type) :: layout                    !! of its results
        type(event_sides) :: sides                     !! results beside what happens, if somebody wants them
        type(companion_type), allocatable :: companion(:)    !! none: no estimate is wanted
        integer :: n_pending = 0                       !! instants that companions have yet to reach
        type(road_counts) :: roads                     !! theirs
        type(block_type) :: pending                    !! their results
        real(wp) :: t_given = 0                        !! last instant of which results were given [s]
    end type watched_run

contains

    !> Start a run, with companions where errors are wanted. Errors: as `start_forward`.
    subroutine start_watched(model, options, wanted, watched, status)
        type(model_type), intent(in), target :: model  !! must outlive the run
        type(forward_options), intent(in) :: options
        type(wanted_type), intent(in) :: wanted
        type(watched_run), intent(inout), target :: watched    !! must stay where it is while the run lasts
        type(status_type), intent(inout) :: status
        type(wanted_type) :: needed
        integer :: i

        watched%t_given = options%t_start
        allocate (watched%companion(merge(n_companion, 0, wanted%errors)))
        call start_forward(model, options, watched%run, status)
        if (.not. status%is_ok()) return
        call describe_results(model%scene, wanted, .true., watched%layout, is_forward=.true., dyad=dyad_names(model), &
                              follows_assembly=follows_assembly(model))
        if (options%sees_events) call watch_events(watched%run, watched%layout, watched%sides)
        needed = wanted_type(wanted%driving_force, wanted%reaction, wanted%joint_variable, power=.false., checks=.false., &
                             friction=.false.)
        do i = 1, size(watched%companion)
            associate (companion => watched%companion(i))
                companion%scale = scale_of(i)
                allocate (companion%model)
                call make_similar(model, i, companion%scale, companion%model)
                call start_forward(companion%model, companion_options(options, i), companion%run, status)
                if (.not. status%is_ok()) return
                call describe_results(model%scene, needed, .true., companion%layout, is_forward=.true.)
            end associate
        end do
    end subroutine start_watched

    !> What companion i runs with.
    function companion_options(options, i) result(own)
        type(forward_options), intent(in) :: options
        integer, intent(in) :: i
        type(forward_options) :: own

        own = options
        nullify (own%shared)                           ! of other numbers
        own%events_end = .false.
        own%sees_events = .false.
        own%integrator = tightened(options%integrator)
        own%integrator%step = own%integrator%step/step_part(i)    ! of adaptive methods the first one, from which the others grow
        own%integrator%rtol = other_tolerance(own%integrator%rtol, i)
        own%integrator%atol = other_tolerance(own%integrator%atol, i)
    end function companion_options

    !> A smaller tolerance. Where smaller ones only gather rounding a larger one serves as well, since its steps differ.
    pure real(wp) function other_tolerance(tolerance, i) result(other)
        real(wp), intent(in) :: tolerance
        integer, intent(in) :: i                       !! companion
        real(wp), parameter :: finest = 45*epsilon(1.0_wp)

        other = max(tolerance/tolerance_part(i), finest)
        if (other > tolerance/2) other = (1 + i)*tolerance
    end function other_tolerance

    !> Go on through the instants t, increasing, and fill their results. With a time limit the call may come back after
    !> fewer of them, or none: call again with the rest.
    subroutine advance_watched(watched, t, block, roads, n_done, seconds)
        type(watched_run), intent(inout), target :: watched
        real(wp), intent(in) :: t(:)                   !! [s]
        type(block_type), intent(inout), target :: block
        type(road_counts), intent(out) :: roads        !! of the run itself
        integer, intent(out) :: n_done                 !! instants dealt with; the others of the block are not filled
        real(wp), intent(in), optional :: seconds      !! come back after about that time
        integer :: i

        n_done = 0
        if (watched%n_pending == 0) then
            call advance_block(watched%run, watched%layout, t, block, roads, n_done, seconds)
            if (size(watched%companion) == 0 .or. n_done == 0) return
            call prepare_block(watched%layout, n_done, watched%pending)
            call copy_samples(watched%layout, block, 0, 1, n_done, watched%pending, 0)
            call send_companions(watched, block%of(variable_index(watched%layout, result_time))%real(:n_done))
            watched%roads = roads
            roads = road_counts()
            n_done = 0
        end if
        do i = 1, size(watched%companion)
            call follow(watched%companion(i), seconds)
            if (watched%companion(i)%n_done < size(watched%companion(i)%t)) return
        end do
        n_done = watched%n_pending
        roads = watched%roads
        call copy_samples(watched%layout, watched%pending, 0, 1, n_done, block, 0)
        do i = 1, size(estimated)
            call estimate_errors(watched, estimated(i), estimate_of(i), block)
        end do
        watched%n_pending = 0
        watched%t_given = block%of(variable_index(watched%layout, result_time))%real(n_done)
    end subroutine advance_watched

    !> Have the companions go to these instants, with a stop between any two: steps that end at the instants of output would
    !> otherwise be the same whatever the tolerance.
    subroutine send_companions(watched, t)
        type(watched_run), intent(inout) :: watched
        real(wp), intent(in) :: t(:)
        real(wp) :: before(size(t))
        integer :: i, n

        n = size(t)
        watched%n_pending = n
        before = [watched%t_given, t(:n - 1)]
        do i = 1, size(watched%companion)
            associate (companion => watched%companion(i))
                companion%n_done = 0
                companion%t = [reshape(transpose(reshape([before + (t - before)/2, t], [n, 2])), [2*n])]
                call prepare_block(companion%layout, n, companion%block)
            end associate
        end do
    end subroutine send_companions

    !> On through its instants; of those between, the second of each pair alone is of interest.
    subroutine follow(companion, seconds)
        type(companion_type), intent(inout) :: companion
        real(wp), intent(in), optional :: seconds
        type(block_type) :: block
        type(road_counts) :: ignored
        integer :: n, first

        associate (t => companion%t(companion%n_done + 1:))
            if (size(t) == 0) return
            call prepare_block(companion%layout, size(t), block)
            call advance_block(companion%run, companion%layout, t, block, ignored, n, seconds)
        end associate
        first = modulo(companion%n_done + 1, 2)        ! skip what lies between
        call copy_samples(companion%layout, block, first, 2, (companion%n_done + n)/2 - companion%n_done/2, companion%block, &
                          companion%n_done/2)
        companion%n_done = companion%n_done + n
    end subroutine follow

    !> Copy n samples, every `stride`th after the first `skipped` of one block, behind `kept` samples of another.
    subroutine copy_samples(layout, from, skipped, stride, n, to, kept)
        type(layout_type), intent(in) :: layout        !! of both
        type(block_type), intent(in) :: from
        integer, intent(in) :: skipped, stride, n, kept
        type(block_type), intent(inout) :: to
        integer :: i, k, width, source, place

        do i = 1, size(layout%variable)
            width = samples_width(layout, layout%variable(i))
            do k = 1, n
                source = (skipped + (k - 1)*stride)*width
                place = (kept + k - 1)*width
                if (layout%variable(i)%is_integer) then
                    to%of(i)%integer(place + 1:place + width) = from%of(i)%integer(source + 1:source + width)
                else
                    to%of(i)%real(place + 1:place + width) = from%of(i)%real(source + 1:source + width)
                end if
            end do
        end do
    end subroutine copy_samples

    !> The errors of one variable at the instants that all have reached.
    subroutine estimate_errors(watched, id, error_id, block)
        type(watched_run), intent(in) :: watched
        integer, intent(in) :: id, error_id            !! of `result_*`
        type(block_type), intent(inout) :: block
        real(wp), allocatable :: back(:, :), other(:, :)
        integer :: place, place_of_error, k, i, n

        place = variable_index(watched%layout, id)
        place_of_error = variable_index(watched%layout, error_id)
        if (place_of_error == 0) return
        associate (variable => watched%layout%variable(place), layout => watched%layout)
            n = samples_width(layout, variable)
            allocate (back(n, n_companion), other(n, n_companion))
            do i = 1, n_companion
                back(:, i) = factors_back(variable, n, watched%companion(i)%scale)
            end do
            do k = 1, watched%n_pending
                do i = 1, n_companion
                    associate (companion => watched%companion(i))
                        other(:, i) = back(:, i)*values_of(companion%layout, companion%block, id, k, n)
                    end associate
                end do
                associate (value => block%of(place)%real((k - 1)*n + 1:k*n))
                    block%of(place_of_error)%real((k - 1)*n + 1:k*n) = &
                        error_of(value, other, magnitude(layout, variable, value), id == result_q .and. back(:, 1) == 1)
                end associate
            end do
        end associate
    end subroutine estimate_errors

    !> Values of a variable in one sample.
    pure function values_of(layout, block, id, k, n) result(value)
        type(layout_type), intent(in) :: layout
        type(block_type), intent(in) :: block
        integer, intent(in) :: id, k, n                !! variable, sample, number of values
        real(wp) :: value(n)

        value = block%of(variable_index(layout, id))%real((k - 1)*n + 1:k*n)
    end function values_of

    !> The error of some values, from what the companions have in their place; infinite where none of them has come along.
    pure function error_of(value, other, size_of, is_angle) result(error)
        real(wp), intent(in) :: value(:)
        real(wp), intent(in) :: other(:, :)            !! (value, companion)
        real(wp), intent(in) :: size_of(:)             !! of what each value is a part of
        logical, intent(in) :: is_angle(:)             !! of an orientation, that may have jumped by a turn
        real(wp) :: error(size(value)), difference(size(value))
        integer :: n_lost(size(value)), i

        error = 0
        n_lost = 0
        do i = 1, size(other, 2)
            difference = other(:, i) - value
            where (is_angle) difference = least_angle(difference)
            where (abs(difference) <= huge(1.0_wp))
                error = max(error, abs(difference))
            elsewhere
                n_lost = n_lost + 1
            end where
        end do
        ! What is zero in all of them is zero by its nature.
        where (error > 0 .or. value /= 0) error = safety*max(error, floor_part*epsilon(1.0_wp)*size_of)
        where (n_lost > 0) error = alone*error
        where (n_lost == size(other, 2)) error = ieee_value(1.0_wp, ieee_positive_inf)
        where (ieee_is_nan(value)) error = value
    end function error_of

    !> What brings the values of a companion back to size, by their units.
    pure function factors_back(variable, n, scale) result(factor)
        type(variable_type), intent(in) :: variable
        integer, intent(in) :: n                       !! values of a sample
        real(wp), intent(in) :: scale
        real(wp) :: factor(n)
        integer :: i

        do i = 1, n
            select case (variable%entry_unit(1 + modulo(i - 1, size(variable%entry_unit))))
            case ("m", "m/s", "m/s2", "N")
                factor(i) = 1/scale
            case ("N m")
                factor(i) = 1/scale**2
            case default                               ! angles
                factor(i) = 1
            end select
        end do
    end function factors_back

    !> Size of what each value is a part of: a force or moment of all its components, anything else of itself.
    pure function magnitude(layout, variable, value) result(size_of)
        type(layout_type), intent(in) :: layout
        type(variable_type), intent(in) :: variable
        real(wp), intent(in) :: value(:)
        real(wp) :: size_of(size(value))
        integer :: n, n_force, i

        size_of = abs(value)
        if (variable%dim(variable%n_dim) /= dim_component) return
        n = layout%dimension(dim_component)%size
        n_force = merge(2, 3, layout%planar)
        do i = 0, size(value) - 1, n
            size_of(i + 1:i + n_force) = maxval(abs(value(i + 1:i + n_force)))
            size_of(i + n_force + 1:i + n) = maxval(abs(value(i + n_force + 1:i + n)))
        end do
    end function magnitude

    !> Instant that the run and its companions have reached in the mean: where all of the work stands.
    pure real(wp) function time_reached(watched) result(t)
        type(watched_run), intent(in) :: watched
        integer :: i

        t = watched%run%integrator%t
        do i = 1, size(watched%companion)
            t = t + watched%companion(i)%run%integrator%t
        end do
        t = t/(1 + size(watched%companion))
    end function time_reached

    !> End the run where it is. Instants that the companions have not reached yet are not given any more.
    subroutine interrupt_watched(watched)
        type(watched_run), intent(inout) :: watched

        call interrupt_forward(watched%run)
    end subroutine interrupt_watched

    !> Release what the run and its companions hold.
    subroutine finish_watched(watched)
        type(watched_run), intent(inout) :: watched
        integer :: i

        call finish_forward(watched%run)
        if (.not. allocated(watched%companion)) return
        do i = 1, size(watched%companion)
            if (.not. associated(watched%companion(i)%model)) cycle
            call finish_forward(watched%companion(i)%run)
            deallocate (watched%companion(i)%model)
        end do
    end subroutine finish_watched
end module linkdyn_forward_errors
