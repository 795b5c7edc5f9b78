!> Groups closed by iteration, at many samples of a motion one after the other: where their links are there, and what a step
!> is judged by.
!>
!> Samples are closed a block at a time, from places led on from the block before: along the curve through some samples that
!> lie behind, or, where that has not led near enough, by the tangents at the last of them. What is found does not depend on
!> where the iteration began but for rounding, as long as it is this assembly; whether it is, is judged by who asks.
!>
!> Newton's method is that of `linkdyn_group_block`. At a sample of which its steps are not sure, or which the prediction does not
!> lead near enough to, the stride ends. Blocks of short steps (`linkdyn_short_steps`) take one step of Newton's method and nothing
!> else, and the next stride goes on along their curve.
module linkdyn_group_stride
    use linkdyn_group_block, only: group_block, prepare_block, close_block, find_drift, take_sample, tell_sample, tell_samples, &
        lead_link, n_point, take_points, lay_curve, explain_steps
    use linkdyn_group_motion, only: group_closer
    use linkdyn_kinds, only: wp
    use linkdyn_model, only: model_type, group_type, place_size, link_freedom
    use linkdyn_short_steps, only: short_part, moves_shortly, are_short
    implicit none (type, external)
    private
    public :: group_stride, left_behind, stride_groups, find_tangents, predict, close_places, share_along

    !> What is found at samples. Of a stride the first one, numbered 0, is that from which it sets out.
    type :: group_stride
        real(wp), allocatable :: place(:, :, :)     !! of the groups' links (place_size, n_link, sample); of strides who asks has
                                                    !! them
        real(wp), allocatable :: rate(:, :, :)      !! along the way from a sample (link_freedom, n_link, sample)
        real(wp), allocatable :: margin(:, :)       !! (n_group, sample)
        real(wp), allocatable :: drift(:, :)        !! its rate along the way (n_group, sample)
        real(wp), allocatable :: thread(:, :)       !! angles of threads by their slides, with their turns (thread, sample) [rad]
        real(wp), allocatable :: thread_rate(:, :)  !! along the way (thread, sample)
        ! ---- of strides with threads: the same along the way from the sample before, which may be another one
        real(wp), allocatable :: rate_there(:, :, :)     !! (link_freedom, n_link, sample)
        real(wp), allocatable :: thread_rate_there(:, :) !! (thread, sample)
        logical, allocatable :: is_closed(:)        !! (sample)
        logical, allocatable :: is_explained(:)     !! of strides: rates explain surely how links have come from the sample before
        logical, allocatable :: is_short(:)         !! of strides: the step from the sample before is believed without rates and
                                                    !! drifts
    end type group_stride

    !> What a stride leaves to the one that sets out where it ended.
    type :: left_behind
        logical :: has_curve = .false.              !! through samples of its last block
        logical :: is_short = .false.               !! steps are
        real(wp), allocatable :: through(:, :, :)   !! (n_point, place_size, n_link)
        real(wp), allocatable :: margin(:)          !! at its last sample (n_group)
        real(wp), allocatable :: place(:, :)        !! there (place_size, n_link)
    end type left_behind

contains

    !> Close the groups at the samples, as far as that goes on from the first one.
    subroutine stride_groups(model, closer, at, way, branch, goes_on, behind, place, stride)
        type(model_type), intent(in) :: model
        class(group_closer), intent(in) :: closer
        real(wp), intent(in), contiguous :: at(:, 0:)          !! coordinates (n_q, 0:n)
        real(wp), intent(in), contiguous :: way(:, 0:)         !! from there (n_q, 0:n)
        real(wp), intent(in), contiguous :: branch(:, :)       !! of the closed forms (n_branch, 1)
        logical, intent(in) :: goes_on                         !! the first sample is the last of the stride before
        type(left_behind), intent(inout) :: behind             !! of that one, then of this one
        real(wp), intent(inout), contiguous :: place(:, :, 0:) !! of the first sample's links; found at the others (.., n_link, 0:n)
        type(group_stride), intent(inout) :: stride            !! as it was left, its room is used again
        type(group_block) :: block
        integer :: n, at_once, first, last, point(n_point)
        real(wp), allocatable :: weight(:, :)                  ! of points (sample of a block, point)
        real(wp) :: part
        logical :: has_threads

        n = ubound(at, 2)
        has_threads = any(model%group%n_thread > 0)
        part = short_part(model)
        at_once = max(closer%samples_at_once, n_point)
        point = [(at_once - (n_point - first)*((at_once - 1)/(n_point - 1)), first=1, n_point)]
        weight = weights_of(point, at_once)
        if (.not. goes_on) behind = left_behind()
        if (allocated(stride%rate)) then
            if (ubound(stride%rate, 3) /= n .or. has_threads) stride = group_stride()
        end if
        if (.not. allocated(stride%rate)) call make_room(model, 0, n, stride)
        stride%is_closed = .false.
        stride%is_explained = .false.
        stride%is_short = .false.
        if (behind%is_short) then
            stride%margin(:, 0) = behind%margin
            stride%is_closed(0) = .true.
        else
            call close_samples(model, closer, at(:, :0), way(:, :0), branch, 0, block, place(:, :, :0), stride)
        end if
        first = 1
        do while (first <= n .and. stride%is_closed(first - 1))
            last = min(n, first + at_once - 1)
            if (behind%is_short) then
                call close_shortly(model, closer, at(:, first:last), way(:, first - 1:last - 1), branch, first, part, weight, &
                                   behind, block, place(:, :, first - 1:last), stride)
                if (behind%is_short) then
                    call leave_behind()
                else
                    ! how its margin changes nobody has asked yet
                    last = first - 1
                    call close_samples(model, closer, at(:, last:last), way(:, last:last), branch, last, block, &
                                       place(:, :, last:last), stride)
                end if
                first = last + 1
                cycle
            end if
            ! quaternions of a spinning link lie on no polynomial
            if (behind%has_curve .and. .not. has_threads) then
                call prepare_block(model, last - first + 1, block)
                call lay_curve(model, weight, behind%through, block)
                call close_led(model, closer, at(:, first:last), way(:, first:last), branch, first, block, &
                               place(:, :, first:last), stride)
            end if
            if (.not. all(stride%is_closed(first:last))) then
                call lead_by_tangents(model, closer, at, branch, first, last, place)
                call close_samples(model, closer, at(:, first:last), way(:, first:last), branch, first, block, &
                                   place(:, :, first:last), stride)
            end if
            if (.not. all(stride%is_closed(first:last))) then
                if (.not. has_threads) exit
                ! far on tangents lead off a thread: from the last sample before that they are new ones
                last = first - 2 + findloc(stride%is_closed(first:last), .false., dim=1)
            end if
            if (last < first) exit
            if (last - first + 1 == size(block%is_closed)) call explain_block()
            behind%is_short = last - first + 1 == at_once .and. moves_shortly(part, block)
            call leave_behind()
            first = last + 1
        end do
        if (has_threads) call find_rates_there(model, closer, at, way, branch, place, stride)

    contains

        !> What the next block, or the next stride, goes on from.
        subroutine leave_behind()
            behind%has_curve = last - first + 1 == at_once
            behind%is_short = behind%is_short .and. behind%has_curve
            behind%margin = stride%margin(:, last)
            behind%place = place(:, :, last)
            if (.not. behind%has_curve) return
            if (.not. allocated(behind%through)) allocate (behind%through(n_point, size(place, 1), size(place, 2)))
            call take_points(model, block, point, behind%through)
        end subroutine leave_behind

        subroutine explain_block()
            real(wp) :: back(last - first + 1)
            integer :: s

            do s = first, last
                back(s - first + 1) = share_along(way(:, s - 1), way(:, s))
            end do
            associate (before => first - 1)
                call explain_steps(model, place(:, :, before), stride%rate(:, :, before), stride%margin(:, before), back, &
                                   block, stride%is_explained(first:last))
            end associate
            ! others are looked at by their rates
            call keep_rates(model, merge(last, first, all(stride%is_explained(first:last))), last, block, stride)
        end subroutine explain_block
    end subroutine stride_groups

    !> The part of a way that leads along another one.
    pure real(wp) function share_along(way, other) result(share)
        real(wp), intent(in) :: way(:), other(:)     !! (n_q)
        real(wp) :: square

        square = dot_product(other, other)
        share = 0
        if (square > 0) share = dot_product(way, other)/square
    end function share_along

    !> Rates at the samples along the ways that lead to them. A screw turns by much on a short way: what a bend of the way adds to
    !> that must not be taken for something unexplained.
    subroutine find_rates_there(model, closer, at, way, branch, place, stride)
        type(model_type), intent(in) :: model
        class(group_closer), intent(in) :: closer
        real(wp), intent(in), contiguous :: at(:, 0:), way(:, 0:)
        real(wp), intent(in), contiguous :: branch(:, :)
        real(wp), intent(in) :: place(:, :, 0:)
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
            real(wp) :: velocity(n, size(group%unit)), turned(n, 2*n_thread)
            integer :: s

            call closer%make_steps(g, transpose(at(:, 1:)), transpose(way(:, :n - 1)), spread(branch(:, 1), 1, n), &
                                   columns_of(place(:, :, 1:)), margin, is_sure, rate=velocity, thread=turned)
            do s = 1, n
                stride%rate_there(:, group%link, s) = reshape(velocity(s, :), [link_freedom(model), size(group%link)])
            end do
            stride%thread_rate_there(before + 1:before + n_thread, 1:) = transpose(turned(:, n_thread + 1:))
            before = before + n_thread
        end subroutine take_rates
    end subroutine find_rates_there

    ! ---------------------------------------------------------------- predictions

    !> Weights of a block's samples in polynomials through them, for the samples of the next block.
    pure function weights_of(point, n) result(weight)
        integer, intent(in) :: point(:), n
        real(wp) :: weight(n, size(point))
        integer :: s, j

        do j = 1, size(point)
            do s = 1, n
                weight(s, j) = product(real(n + s - point, wp)/real(point(j) - point, wp), mask=point /= point(j))
            end do
        end do
    end function weights_of

    !> Predict places by the rates at the last sample, one for each coordinate.
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
            place(:, :, s) = place(:, :, first - 1)
            call predict(model, tangents%rate, at(:, s) - at(:, first - 1), place(:, :, s))
        end do
    end subroutine lead_by_tangents

    !> Where tangents lead.
    pure subroutine predict(model, tangent, way, place)
        type(model_type), intent(in) :: model
        real(wp), intent(in), contiguous :: tangent(:, :, :)   !! for each coordinate (link_freedom, n_link, n_q)
        real(wp), intent(in) :: way(:)                         !! (n_q)
        real(wp), intent(inout), contiguous :: place(:, :)     !! (place_size, n_link)
        real(wp) :: by(size(tangent, 1))
        integer :: g, i, k

        do g = 1, size(model%group)
            do i = 1, size(model%group(g)%link)
                associate (l => model%group(g)%link(i))
                    by = 0
                    do k = 1, size(way)
                        by = by + way(k)*tangent(:, l, k)
                    end do
                    call lead_link(model%group(g), i, by, place(:, l))
                end associate
            end do
        end do
    end subroutine predict

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
        type(group_stride), intent(inout) :: found             !! (..., n or more); as it was left, its room is used again
        type(group_block) :: block
        real(wp), allocatable :: room(:, :, :)

        if (allocated(found%place)) then
            if (size(found%place, 3) < size(at, 2)) found = group_stride()
        end if
        if (.not. allocated(found%place)) then
            call make_room(model, 1, size(at, 2), found)
            allocate (found%place(place_size(model), model%n_link, size(at, 2)))
        end if
        found%place(:, :, :size(at, 2)) = place
        call move_alloc(found%place, room)
        call close_samples(model, closer, at, way, branch, 1, block, room, found)
        call move_alloc(room, found%place)
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
        type(group_block) :: block
        integer :: s

        call prepare_block(model, size(at, 2), block)
        block%at = transpose(at)
        block%way = 0
        block%branch = transpose(branch)
        block%is_closed = is_closed
        do s = 1, size(at, 2)
            call take_sample(model, place(:, :, s), s, block)
        end do
        call close_block(model, closer, block)
        call tell_samples(model, block, place)
        margin = transpose(block%margin)
        is_closed = block%is_closed
    end subroutine close_places

    subroutine make_room(model, first, last, stride)
        type(model_type), intent(in) :: model
        integer, intent(in) :: first, last                     !! samples
        type(group_stride), intent(inout) :: stride

        allocate (stride%rate(link_freedom(model), model%n_link, first:last), source=0.0_wp)
        allocate (stride%margin(size(model%group), first:last), stride%drift(size(model%group), first:last), source=0.0_wp)
        allocate (stride%thread(sum(model%group%n_thread), first:last), stride%thread_rate(sum(model%group%n_thread), first:last))
        allocate (stride%is_closed(first:last), stride%is_explained(first:last), stride%is_short(first:last), source=.false.)
    end subroutine make_room

    !> From where the curve leads, if all steps are short.
    subroutine close_shortly(model, closer, at, way, branch, first, part, weight, behind, block, place, stride)
        type(model_type), intent(in) :: model
        class(group_closer), intent(in) :: closer
        real(wp), intent(in), contiguous :: at(:, :), way(:, :)    !! of the samples, the ways to them (n_q, sample)
        real(wp), intent(in), contiguous :: branch(:, :)       !! of the closed forms (n_branch, 1)
        integer, intent(in) :: first                           !! sample of the stride
        real(wp), intent(in) :: part                           !! `short_part`
        real(wp), intent(in), contiguous :: weight(:, :)       !! (sample or more, n_point)
        type(left_behind), intent(inout) :: behind             !! steps are short; whether these are
        type(group_block), intent(inout) :: block
        real(wp), intent(inout), contiguous :: place(:, :, 0:) !! of the sample before; found at the others
        type(group_stride), intent(inout) :: stride

        call prepare_block(model, size(at, 2), block)
        call lay_curve(model, weight, behind%through, block)
        call stand_at(at, way, branch, block)
        block%wants_rates = .false.
        call close_block(model, closer, block)
        block%wants_rates = .true.
        behind%is_short = are_short(model, part, place(:, :, 0), stride%margin(:, first - 1), block)
        behind%has_curve = all(block%is_closed)
        if (.not. behind%is_short) return
        call tell_block(model, first, block, place(:, :, 1:), stride)
        stride%is_short(first:first + size(at, 2) - 1) = .true.
    end subroutine close_shortly

    !> From places predicted.
    subroutine close_samples(model, closer, at, way, branch, first, block, place, stride)
        type(model_type), intent(in) :: model
        class(group_closer), intent(in) :: closer
        real(wp), intent(in), contiguous :: at(:, :), way(:, :)    !! of the samples (n_q, sample)
        real(wp), intent(in), contiguous :: branch(:, :)       !! of the closed forms (n_branch, sample, or 1 for all)
        integer, intent(in) :: first                           !! sample of the stride
        type(group_block), intent(inout) :: block              !! scratch
        real(wp), intent(inout), contiguous :: place(:, :, :)  !! predicted, then found (place_size, n_link, sample)
        type(group_stride), intent(inout) :: stride
        integer :: s

        call prepare_block(model, size(at, 2), block)
        do s = 1, size(at, 2)
            call take_sample(model, place(:, :, s), s, block)
        end do
        call close_led(model, closer, at, way, branch, first, block, place, stride)
        call keep_rates(model, first, first + size(at, 2) - 1, block, stride)
    end subroutine close_samples

    !> From the places predicted, which the block has.
    subroutine close_led(model, closer, at, way, branch, first, block, place, stride)
        type(model_type), intent(in) :: model
        class(group_closer), intent(in) :: closer
        real(wp), intent(in), contiguous :: at(:, :), way(:, :)    !! of the samples (n_q, sample)
        real(wp), intent(in), contiguous :: branch(:, :)       !! of the closed forms (n_branch, sample, or 1 for all)
        integer, intent(in) :: first                           !! sample of the stride
        type(group_block), intent(inout) :: block
        real(wp), intent(inout), contiguous :: place(:, :, :)  !! (place_size, n_link, sample)
        type(group_stride), intent(inout) :: stride
        integer :: s

        call stand_at(at, way, branch, block)
        call close_block(model, closer, block)
        if (any(block%is_closed)) call find_drift(model, closer, block)
        call tell_block(model, first, block, place, stride)
        do s = 1, size(at, 2)
            associate (k => first + s - 1)
                stride%drift(:, k) = block%drift(s, :)
                stride%thread(:, k) = block%thread(s, :)
                stride%thread_rate(:, k) = block%thread_rate(s, :)
            end associate
        end do
    end subroutine close_led

    !> The block's samples, all to be closed.
    pure subroutine stand_at(at, way, branch, block)
        real(wp), intent(in), contiguous :: at(:, :), way(:, :)    !! (n_q, sample)
        real(wp), intent(in), contiguous :: branch(:, :)       !! (n_branch, sample, or 1 for all)
        type(group_block), intent(inout) :: block
        integer :: k, s

        do k = 1, size(at, 1)
            do s = 1, size(at, 2)
                block%at(s, k) = at(k, s)
                block%way(s, k) = way(k, s)
            end do
        end do
        do k = 1, size(branch, 1)
            do s = 1, size(at, 2)
                block%branch(s, k) = branch(k, min(s, size(branch, 2)))
            end do
        end do
        block%is_closed = .true.
    end subroutine stand_at

    !> Where the block's links are, and margins there.
    subroutine tell_block(model, first, block, place, stride)
        type(model_type), intent(in) :: model
        integer, intent(in) :: first                           !! sample of the stride
        type(group_block), intent(in) :: block
        real(wp), intent(inout), contiguous :: place(:, :, :)  !! (place_size, n_link, sample)
        type(group_stride), intent(inout) :: stride
        integer :: s, n

        n = size(block%is_closed)
        stride%is_closed(first:first + n - 1) = block%is_closed
        call tell_samples(model, block, place)
        do s = 1, n
            stride%margin(:, first + s - 1) = block%margin(s, :)
        end do
    end subroutine tell_block

    !> The block's last rates, for whoever asks.
    subroutine keep_rates(model, first, last, block, stride)
        type(model_type), intent(in) :: model
        integer, intent(in) :: first, last                     !! samples of the stride, of which the last is the block's
        type(group_block), intent(in) :: block
        type(group_stride), intent(inout) :: stride
        integer :: s, n

        n = size(block%is_closed)
        do s = first, last
            call tell_sample(model, n, size(stride%rate, 1), block%rate, n - last + s, stride%rate(:, :, s))
        end do
    end subroutine keep_rates

    !> Samples side by side.
    pure function columns_of(x) result(columns)
        real(wp), intent(in) :: x(:, :, :)                     !! (..., sample)
        real(wp) :: columns(size(x, 3), size(x, 1), size(x, 2))

        columns = reshape(x, shape(columns), order=[2, 3, 1])
    end function columns_of
end module linkdyn_group_stride
