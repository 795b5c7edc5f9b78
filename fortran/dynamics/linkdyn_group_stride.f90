!> Groups closed by iteration, at many samples of a motion one after the other: where their links are there, and what a step
!> is judged by.
!>
!> Samples are closed a block at a time, from places led on from the block before: along the curve through some samples that
!> lie behind, or, where that has not led near enough, by the tangents at the last of them. What is found does not depend on
!> where the iteration began but for rounding, as long as it is this assembly; whether it is, is judged by who asks.
!>
!> The rules are those of `linkdyn_newton_group`; the steps are somebody else's (`group_closer`). At a sample of which these are
!> not sure, or which the prediction does not lead near enough to, the stride ends.
module linkdyn_group_stride
    use linkdyn_following, only: largest_contraction
    use linkdyn_group_motion, only: group_closer
    use linkdyn_kinds, only: wp
    use linkdyn_link_place, only: moved_place, spun_place, turned_axis
    use linkdyn_model, only: model_type, group_type, place_size, link_freedom, scene_size
    use linkdyn_newton_group, only: is_small, watch_contraction, rounding_at, step_ahead, n_shift, largest_turn, &
        least_group_margin, take_spins_apart
    implicit none (type, external)
    private
    public :: group_stride, stride_groups, find_tangents, predicted, close_from, close_places

    integer, parameter :: most_steps = 8            !! of Newton's method, which squares the error
    integer, parameter :: n_behind = 6              !! samples that a curve is laid through

    !> What is found at samples. Of a stride the first one, numbered 0, is that from which it sets out.
    type :: group_stride
        real(wp), allocatable :: place(:, :, :)     !! of the groups' links (place_size, n_link, sample)
        real(wp), allocatable :: rate(:, :, :)      !! along the way from a sample (link_freedom, n_link, sample)
        real(wp), allocatable :: margin(:, :)       !! (n_group, sample)
        real(wp), allocatable :: drift(:, :)        !! its rate along the way (n_group, sample)
        real(wp), allocatable :: thread(:, :)       !! angles of threads by their slides, with their turns (thread, sample) [rad]
        real(wp), allocatable :: thread_rate(:, :)  !! along the way (thread, sample)
        ! ---- of strides with threads: the same along the way from the sample before, which may be another one
        real(wp), allocatable :: rate_there(:, :, :)     !! (link_freedom, n_link, sample)
        real(wp), allocatable :: thread_rate_there(:, :) !! (thread, sample)
        logical, allocatable :: is_closed(:)        !! (sample)
    end type group_stride

contains

    !> Close the groups at the samples, as far as that goes on from the first one.
    subroutine stride_groups(model, closer, at, way, branch, start, stride)
        type(model_type), intent(in) :: model
        class(group_closer), intent(in) :: closer
        real(wp), intent(in), contiguous :: at(:, 0:)          !! coordinates (n_q, 0:n)
        real(wp), intent(in), contiguous :: way(:, 0:)         !! from there (n_q, 0:n)
        real(wp), intent(in), contiguous :: branch(:, :)       !! of the closed forms (n_branch, 1)
        real(wp), intent(in) :: start(:, :)                    !! places at the first sample (place_size, n_link)
        type(group_stride), intent(out) :: stride
        integer :: n, block, first, last
        logical :: has_threads

        n = ubound(at, 2)
        has_threads = any(model%group%n_thread > 0)
        block = max(closer%samples_at_once, n_behind)
        call make_room(model, 0, n, stride)
        stride%place(:, :, 0) = start
        call close_samples(model, closer, at(:, :0), way(:, :0), branch, 0, 0, stride)
        first = 1
        do while (first <= n .and. stride%is_closed(first - 1))
            last = min(n, first + block - 1)
            ! quaternions of a spinning link lie on no polynomial
            if (first > block .and. .not. has_threads) then
                call lead_by_curve(model, first, last, block, stride%place)
                call close_samples(model, closer, at(:, first:last), way(:, first:last), branch, first, last, stride)
            end if
            if (.not. all(stride%is_closed(first:last))) then
                call lead_by_tangents(model, closer, at, branch, first, last, stride%place)
                call close_samples(model, closer, at(:, first:last), way(:, first:last), branch, first, last, stride)
            end if
            if (.not. all(stride%is_closed(first:last))) then
                if (.not. has_threads) exit
                ! far on tangents lead off a thread: from the last sample before that they are new ones
                last = first - 2 + findloc(stride%is_closed(first:last), .false., dim=1)
            end if
            if (last < first) exit
            first = last + 1
        end do
        if (has_threads) call find_rates_there(model, closer, at, way, branch, stride)
    end subroutine stride_groups

    !> Rates at the samples along the ways that lead to them. A screw turns by much on a short way: what a bend of the way adds to
    !> that must not be taken for something unexplained.
    subroutine find_rates_there(model, closer, at, way, branch, stride)
        type(model_type), intent(in) :: model
        class(group_closer), intent(in) :: closer
        real(wp), intent(in), contiguous :: at(:, 0:), way(:, 0:)
        real(wp), intent(in), contiguous :: branch(:, :)
        type(group_stride), intent(inout) :: stride
        real(wp), dimension(ubound(at, 2)) :: margin
        logical :: is_sure(ubound(at, 2))
        integer :: g, n, before

        allocate (stride%rate_there, source=stride%rate)
        allocate (stride%thread_rate_there, source=stride%thread_rate)
        if (size(at, 1) == 1) then
            call turn_to_way()
            return
        end if
        n = ubound(at, 2)
        before = 0
        do g = 1, size(model%group)
            call take_rates(model%group(g), model%group(g)%n_thread)
        end do

    contains

        !> Along the one coordinate all ways are parts of each other.
        subroutine turn_to_way()
            real(wp) :: part
            integer :: s

            do s = 1, ubound(at, 2)
                part = 0
                if (way(1, s) /= 0) part = way(1, s - 1)/way(1, s)
                stride%rate_there(:, :, s) = part*stride%rate(:, :, s)
                stride%thread_rate_there(:, s) = part*stride%thread_rate(:, s)
            end do
        end subroutine turn_to_way

        subroutine take_rates(group, n_thread)
            type(group_type), intent(in) :: group
            integer, intent(in) :: n_thread
            real(wp), dimension(size(group%unit), n) :: correction, velocity
            real(wp) :: turned(2*n_thread, n)
            integer :: s

            call closer%make_steps(g, at(:, 1:), way(:, :n - 1), branch, stride%place(:, :, 1:), correction, velocity, margin, &
                                   is_sure, turned)
            do s = 1, n
                stride%rate_there(:, group%link, s) = reshape(velocity(:, s), [link_freedom(model), size(group%link)])
            end do
            stride%thread_rate_there(before + 1:before + n_thread, 1:) = turned(n_thread + 1:, :)
            before = before + n_thread
        end subroutine take_rates
    end subroutine find_rates_there

    ! ---------------------------------------------------------------- predictions

    !> By the polynomial through samples of the block before.
    pure subroutine lead_by_curve(model, first, last, block, place)
        type(model_type), intent(in) :: model
        integer, intent(in) :: first, last, block              !! samples, and how many of them a block has
        real(wp), intent(inout) :: place(:, :, 0:)
        integer :: behind(n_behind), s, g, i, j
        real(wp) :: weight(n_behind)

        behind = [(first - 1 - (n_behind - j)*((block - 1)/(n_behind - 1)), j=1, n_behind)]
        do s = first, last
            do j = 1, n_behind
                weight(j) = product(real(s - behind, wp)/real(behind(j) - behind, wp), mask=behind /= behind(j))
            end do
            do g = 1, size(model%group)
                do i = 1, size(model%group(g)%link)
                    associate (l => model%group(g)%link(i))
                        place(:, l, s) = weight(1)*place(:, l, behind(1))
                        do j = 2, n_behind
                            place(:, l, s) = place(:, l, s) + weight(j)*place(:, l, behind(j))
                        end do
                    end associate
                end do
            end do
        end do
    end subroutine lead_by_curve

    !> By the rates at the last sample, one for each coordinate.
    subroutine lead_by_tangents(model, closer, at, branch, first, last, place)
        type(model_type), intent(in) :: model
        class(group_closer), intent(in) :: closer
        real(wp), intent(in), contiguous :: at(:, 0:)
        real(wp), intent(in), contiguous :: branch(:, :)
        integer, intent(in) :: first, last
        real(wp), intent(inout) :: place(:, :, 0:)
        type(group_stride) :: tangents
        integer :: s

        call find_tangents(model, closer, at(:, first - 1), branch, place(:, :, first - 1), tangents)
        do s = first, last
            place(:, :, s) = predicted(model, place(:, :, first - 1), tangents%rate, at(:, s) - at(:, first - 1))
        end do
    end subroutine lead_by_tangents

    !> Where tangents lead.
    pure function predicted(model, place, tangent, way) result(ahead)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: place(:, :)                    !! (place_size, n_link)
        real(wp), intent(in) :: tangent(:, :, :)               !! for each coordinate (link_freedom, n_link, n_q)
        real(wp), intent(in) :: way(:)                         !! (n_q)
        real(wp) :: ahead(size(place, 1), size(place, 2))
        real(wp) :: by(size(tangent, 1))
        integer :: g, i, k

        ahead = place
        do g = 1, size(model%group)
            do i = 1, size(model%group(g)%link)
                associate (l => model%group(g)%link(i))
                    by = 0
                    do k = 1, size(way)
                        by = by + way(k)*tangent(:, l, k)
                    end do
                    ahead(:, l) = led_place(model%group(g), i, place(:, l), by)
                end associate
            end do
        end do
    end function predicted

    !> A group's link on its way, on which it may spin about its thread.
    pure function led_place(group, i, place, by) result(ahead)
        type(group_type), intent(in) :: group
        integer, intent(in) :: i                               !! of its links
        real(wp), intent(in) :: place(:), by(:)
        real(wp) :: ahead(size(place))

        if (all(group%thread_axis(:, i) == 0)) then
            ahead = moved_place(place, by)
        else
            ahead = spun_place(place, by, group%thread_axis(:, i), turned_axis(place, group%thread_axis(:, i)))
        end if
    end function led_place

    !> Rates and drifts at a place, one for each coordinate.
    subroutine find_tangents(model, closer, q, branch, place, tangents)
        type(model_type), intent(in) :: model
        class(group_closer), intent(in) :: closer
        real(wp), intent(in) :: q(:)
        real(wp), intent(in), contiguous :: branch(:, :)       !! (n_branch, 1)
        real(wp), intent(in) :: place(:, :)
        type(group_stride), intent(out) :: tangents            !! (..., n_q)
        real(wp) :: unit(size(q), size(q))
        integer :: k

        unit = 0
        do k = 1, size(q)
            unit(k, k) = 1
        end do
        call close_from(model, closer, spread(q, 2, size(q)), unit, branch, spread(place, 3, size(q)), tangents)
    end subroutine find_tangents

    ! ---------------------------------------------------------------- closing

    !> Close the groups at samples that have nothing to do with each other, from places predicted.
    subroutine close_from(model, closer, at, way, branch, place, found)
        type(model_type), intent(in) :: model
        class(group_closer), intent(in) :: closer
        real(wp), intent(in), contiguous :: at(:, :), way(:, :)    !! coordinates, ways for rates (n_q, n)
        real(wp), intent(in), contiguous :: branch(:, :)       !! of the closed forms (n_branch, n, or 1 for all)
        real(wp), intent(in) :: place(:, :, :)                 !! predicted (place_size, n_link, n)
        type(group_stride), intent(out) :: found               !! (..., n)

        call make_room(model, 1, size(at, 2), found)
        found%place = place
        call close_samples(model, closer, at, way, branch, 1, size(at, 2), found)
    end subroutine close_from

    !> Close the groups at some samples, each with branches of its own, from places near to them: nothing of a way.
    subroutine close_places(model, closer, at, branch, place, margin, is_closed)
        type(model_type), intent(in) :: model
        class(group_closer), intent(in) :: closer
        real(wp), intent(in), contiguous :: at(:, :)           !! (n_q, sample)
        real(wp), intent(in), contiguous :: branch(:, :)       !! (n_branch, sample)
        real(wp), intent(inout), contiguous :: place(:, :, :)  !! (place_size, n_link, sample)
        real(wp), intent(out) :: margin(:, :)                  !! (n_group, sample)
        logical, intent(inout) :: is_closed(:)                 !! false: do not try (sample)
        real(wp) :: at_rest(size(at, 1), size(at, 2)), rate(link_freedom(model), model%n_link, size(at, 2))
        real(wp) :: thread(2*sum(model%group%n_thread), size(at, 2))
        integer :: g

        at_rest = 0
        margin = 0
        do g = 1, size(model%group)
            if (.not. any(is_closed)) return
            call close_group(model, g, closer, at, at_rest, branch, place, rate, margin(g, :), thread, is_closed)
        end do
    end subroutine close_places

    subroutine make_room(model, first, last, stride)
        type(model_type), intent(in) :: model
        integer, intent(in) :: first, last                     !! samples
        type(group_stride), intent(inout) :: stride

        allocate (stride%place(place_size(model), model%n_link, first:last))
        allocate (stride%rate(link_freedom(model), model%n_link, first:last), source=0.0_wp)
        allocate (stride%margin(size(model%group), first:last), stride%drift(size(model%group), first:last))
        allocate (stride%thread(sum(model%group%n_thread), first:last), stride%thread_rate(sum(model%group%n_thread), first:last))
        allocate (stride%is_closed(first:last), source=.false.)
    end subroutine make_room

    !> One group after the other, from the places predicted.
    subroutine close_samples(model, closer, at, way, branch, first, last, stride)
        type(model_type), intent(in) :: model
        class(group_closer), intent(in) :: closer
        real(wp), intent(in), contiguous :: at(:, :), way(:, :)    !! of these samples (n_q, last - first + 1)
        real(wp), intent(in), contiguous :: branch(:, :)       !! of the closed forms (n_branch, sample, or 1 for all)
        integer, intent(in) :: first, last                     !! samples of the stride
        type(group_stride), intent(inout) :: stride
        real(wp) :: thread(2*maxval(model%group%n_thread), size(at, 2))
        integer :: g, n, before

        before = 0
        stride%is_closed(first:last) = .true.
        do g = 1, size(model%group)
            call close_group(model, g, closer, at, way, branch, stride%place(:, :, first:last), stride%rate(:, :, first:last), &
                             stride%margin(g, first:last), thread, stride%is_closed(first:last))
            n = model%group(g)%n_thread
            stride%thread(before + 1:before + n, first:last) = thread(:n, :)
            stride%thread_rate(before + 1:before + n, first:last) = thread(n + 1:2*n, :)
            before = before + n
            if (.not. any(stride%is_closed(first:last))) return
        end do
        call find_drift(model, closer, at, way, branch, stride%place(:, :, first:last), stride%rate(:, :, first:last), &
                        stride%margin(:, first:last), stride%drift(:, first:last), stride%is_closed(first:last))
    end subroutine close_samples

    !> Newton's method at some samples; what does not converge as it must is not closed.
    subroutine close_group(model, g, closer, at, way, branch, place, rate, margin, thread, is_closed)
        type(model_type), intent(in) :: model
        integer, intent(in) :: g
        class(group_closer), intent(in) :: closer
        real(wp), intent(in), contiguous :: at(:, :), way(:, :)
        real(wp), intent(in), contiguous :: branch(:, :)
        real(wp), intent(inout), contiguous :: place(:, :, :)
        real(wp), intent(inout) :: rate(:, :, :)
        real(wp), intent(out) :: margin(:)
        real(wp), intent(inout) :: thread(:, :)                !! angles of its threads, then their rates, and room (number, sample)
        logical, intent(inout) :: is_closed(:)
        real(wp), dimension(size(model%group(g)%unit), size(at, 2)) :: correction, velocity
        real(wp) :: spin(size(model%group(g)%unit)), turned(2*model%group(g)%n_thread, size(at, 2))
        real(wp), dimension(size(at, 2)) :: margin_here, before, contraction
        logical, dimension(size(at, 2)) :: is_sure, is_under_way
        real(wp) :: largest, bounded, noise, extent
        logical :: spins
        integer :: step, s

        extent = scene_size(model)
        spins = model%group(g)%n_thread > 0
        is_under_way = is_closed
        before = huge(1.0_wp)
        contraction = 0
        margin = 0
        do step = 1, most_steps
            call closer%make_steps(g, at, way, branch, place, correction, velocity, margin_here, is_sure, turned)
            do s = 1, size(at, 2)
                if (.not. is_under_way(s)) cycle
                margin(s) = margin_here(s)
                if (spins) call take_spins_apart(model%group(g), place(:, :, s), correction(:, s), spin)
                largest = maxval(abs(correction(:, s))/model%group(g)%unit)
                bounded = largest
                if (spins) bounded = maxval(abs(correction(:, s) - spin)/model%group(g)%unit)
                noise = rounding_at(distance_of(model, model%group(g), extent, place(:, :, s)), extent) &
                        /max(abs(margin(s)), least_group_margin)
                if (step > 1) call watch_contraction(before(s), largest, noise, contraction(s))
                is_closed(s) = is_sure(s) .and. contraction(s) <= largest_contraction .and. bounded <= largest_turn
                is_under_way(s) = is_closed(s) .and. .not. is_small(largest, noise)
                before(s) = largest
                if (.not. is_closed(s)) cycle
                call move_links(model, model%group(g), -correction(:, s), place(:, :, s))
                thread(:size(turned, 1), s) = turned(:, s)
                if (.not. is_under_way(s)) &
                    rate(:, model%group(g)%link, s) = reshape(velocity(:, s), [size(rate, 1), size(model%group(g)%link)])
            end do
            if (.not. any(is_under_way)) return
        end do
        is_closed = is_closed .and. .not. is_under_way
    end subroutine close_group

    !> The margins' rates along the way, from the margins a little further on, where the links' velocities lead.
    subroutine find_drift(model, closer, at, way, branch, place, rate, margin, drift, is_closed)
        type(model_type), intent(in) :: model
        class(group_closer), intent(in) :: closer
        real(wp), intent(in), contiguous :: at(:, :), way(:, :)
        real(wp), intent(in), contiguous :: branch(:, :)
        real(wp), intent(in) :: place(:, :, :), rate(:, :, :)
        real(wp), intent(in) :: margin(:, :)                   !! (n_group, sample)
        real(wp), intent(out) :: drift(:, :)                   !! (n_group, sample)
        logical, intent(inout) :: is_closed(:)
        real(wp), allocatable :: correction(:, :), velocity(:, :)
        real(wp) :: ahead(size(place, 1), size(place, 2), size(place, 3)), q(size(at, 1), size(at, 2))
        real(wp), dimension(size(at, 2)) :: margin_ahead, step
        logical :: is_sure(size(at, 2))
        real(wp) :: extent, speed
        integer :: s, g, i

        extent = scene_size(model)
        do s = 1, size(at, 2)
            step(s) = huge(1.0_wp)
            do g = 1, size(model%group)
                speed = speed_of(model, model%group(g), extent, rate(:, :, s))
                if (speed > 0) step(s) = min(step(s), step_ahead(margin(g, s), speed))
            end do
            if (.not. step(s) < huge(1.0_wp)) step(s) = 0     ! nothing moves
            q(:, s) = at(:, s) + step(s)*way(:, s)
            do g = 1, size(model%group)
                do i = 1, size(model%group(g)%link)
                    associate (l => model%group(g)%link(i))
                        ahead(:, l, s) = moved_place(place(:, l, s), step(s)*rate(:, l, s))
                    end associate
                end do
            end do
        end do
        do g = 1, size(model%group)
            allocate (correction(size(model%group(g)%unit), size(at, 2)), velocity(size(model%group(g)%unit), size(at, 2)))
            call closer%make_steps(g, q, way, branch, ahead, correction, velocity, margin_ahead, is_sure)
            is_closed = is_closed .and. is_sure
            drift(g, :) = merge((margin_ahead - margin(g, :))/max(step, tiny(1.0_wp)), 0.0_wp, step > 0)
            deallocate (correction, velocity)
        end do
    end subroutine find_drift

    ! ---------------------------------------------------------------- one sample

    !> How far from the world's origin a group's links are, at least the mechanism's size.
    pure real(wp) function distance_of(model, group, extent, place) result(distance)
        type(model_type), intent(in) :: model
        type(group_type), intent(in) :: group
        real(wp), intent(in) :: extent                         !! the mechanism's size
        real(wp), intent(in) :: place(:, :)
        integer :: i

        distance = extent
        do i = 1, size(group%link)
            distance = max(distance, maxval(abs(place(:n_shift(model), group%link(i)))))
        end do
    end function distance_of

    !> The largest rate of a group's links, lengths by the mechanism's size.
    pure real(wp) function speed_of(model, group, extent, rate) result(speed)
        type(model_type), intent(in) :: model
        type(group_type), intent(in) :: group
        real(wp), intent(in) :: extent
        real(wp), intent(in) :: rate(:, :)
        integer :: i

        speed = 0
        do i = 1, size(group%link)
            associate (of_link => rate(:, group%link(i)), n => n_shift(model))
                speed = max(speed, sqrt(sum(of_link(:n)**2))/extent, sqrt(sum(of_link(n + 1:)**2)))
            end associate
        end do
    end function speed_of

    pure subroutine move_links(model, group, by, place)
        type(model_type), intent(in) :: model
        type(group_type), intent(in) :: group
        real(wp), intent(in) :: by(:)                          !! (row)
        real(wp), intent(inout) :: place(:, :)
        integer :: i

        do i = 1, size(group%link)
            associate (l => group%link(i), freedom => link_freedom(model))
                place(:, l) = led_place(group, i, place(:, l), by(freedom*(i - 1) + 1:freedom*i))
            end associate
        end do
    end subroutine move_links
end module linkdyn_group_stride
