!> Groups closed by iteration, at a block of samples side by side: Newton's method, and what a step is judged by.
!>
!> A column has one number of all samples, as those who make the steps (`group_closer`) take and give them: what looks after samples
!> one by one takes longer than the steps. The rules are those of `linkdyn_newton_rules`.
module linkdyn_group_block
    use linkdyn_group_motion, only: group_closer
    use linkdyn_kinds, only: wp
    use linkdyn_link_place, only: move_in_space, led_on_thread
    use linkdyn_model, only: model_type, group_type, place_size, link_freedom
    use linkdyn_newton_rules, only: judge_corrections, step_ahead
    implicit none (type, external)
    private
    public :: group_block, prepare_block, close_block, find_drift
    public :: take_sample, tell_sample, tell_samples, set_out, lead_links, lead_link, take_points, lay_curve
    public :: explain_shifts, explain_steps

    integer, parameter :: most_steps = 8            !! of Newton's method, which squares the error
    integer, parameter, public :: n_point = 6       !! that a curve is laid through
    !> What is left open of a step must be small against the distance, about the margin, at which another assembly may be.
    real(wp), parameter, public :: part_of_margin = 0.125_wp

    type :: group_block
        real(wp), allocatable :: at(:, :)           !! coordinates (sample, n_q)
        real(wp), allocatable :: way(:, :)          !! from there, for rates (sample, n_q)
        real(wp), allocatable :: branch(:, :)       !! of the closed forms (sample, n_branch)
        real(wp), allocatable :: place(:, :, :)     !! of the groups' links: predicted, then closed (sample, place_size, n_link)
        real(wp), allocatable :: from(:, :, :)      !! where they have come from: places likewise
        real(wp), allocatable :: shift(:, :, :)     !! shifts and turns that lead from there (sample, link_freedom, n_link)
        real(wp), allocatable :: rate(:, :, :)      !! along the way (sample, link_freedom, n_link)
        real(wp), allocatable :: speed(:, :)        !! the largest of a group's, lengths by the mechanism's size (sample, n_group)
        real(wp), allocatable :: margin(:, :)       !! (sample, n_group)
        real(wp), allocatable :: drift(:, :)        !! its rate along the way (sample, n_group)
        real(wp), allocatable :: thread(:, :)       !! angles of threads by their slides, with their turns (sample, thread) [rad]
        real(wp), allocatable :: thread_rate(:, :)  !! along the way (sample, thread)
        logical, allocatable :: is_closed(:)        !! (sample)
        logical :: only_leads = .false.             !! steps need not be as sure as where samples stay, see `group_closer`
        logical :: wants_rates = .true.             !! false: speeds do
        ! ---- scratch, for the largest group
        real(wp), allocatable, private :: ahead(:, :, :), velocity(:, :), corrected(:, :), turned(:, :), extent(:, :)
        real(wp), allocatable, private :: q(:, :), margin_here(:), before(:), contraction(:)
        logical, allocatable, private :: is_sure(:), is_under_way(:), takes(:)
    end type group_block

contains

    !> Room for n samples.
    subroutine prepare_block(model, n, block)
        type(model_type), intent(in) :: model
        integer, intent(in) :: n
        type(group_block), intent(inout) :: block
        integer :: n_row, g

        if (allocated(block%at)) then
            if (size(block%at, 1) == n) return
            block = group_block()
        end if
        n_row = 0
        do g = 1, size(model%group)
            n_row = max(n_row, size(model%group(g)%unit))
        end do
        allocate (block%at(n, model%n_q), block%way(n, model%n_q), block%q(n, model%n_q), block%branch(n, model%n_branch))
        allocate (block%place(n, place_size(model), model%n_link), block%ahead(n, place_size(model), model%n_link), &
                  block%from(n, place_size(model), model%n_link))
        allocate (block%shift(n, link_freedom(model), model%n_link), block%rate(n, link_freedom(model), model%n_link))
        block%rate = 0
        allocate (block%margin(n, size(model%group)), block%drift(n, size(model%group)), block%speed(n, size(model%group)))
        block%margin = 0
        block%speed = 0
        allocate (block%thread(n, sum(model%group%n_thread)), block%thread_rate(n, sum(model%group%n_thread)))
        allocate (block%velocity(n, n_row), block%corrected(n, place_size(model)*n_row/link_freedom(model)), block%extent(n, 4))
        allocate (block%turned(n, 2*maxval(model%group%n_thread)))
        allocate (block%margin_here(n), block%before(n), block%contraction(n))
        allocate (block%is_closed(n), block%is_sure(n), block%is_under_way(n), block%takes(n))
    end subroutine prepare_block

    ! ---------------------------------------------------------------- samples come and go

    !> Places of the groups' links, of one sample.
    pure subroutine take_sample(model, place, s, block)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: place(:, :)                    !! (place_size, n_link)
        integer, intent(in) :: s
        type(group_block), intent(inout) :: block
        integer :: g, i

        do g = 1, size(model%group)
            do i = 1, size(model%group(g)%link)
                block%place(s, :, model%group(g)%link(i)) = place(:, model%group(g)%link(i))
            end do
        end do
    end subroutine take_sample

    !> The other way, likewise of rates.
    pure subroutine tell_sample(model, n, m, columns, s, row)
        type(model_type), intent(in) :: model
        integer, intent(in) :: n, m                            !! samples; numbers of a link
        real(wp), intent(in) :: columns(n, m, *)               !! (sample, number, link)
        integer, intent(in) :: s
        real(wp), intent(inout) :: row(m, *)                   !! (number, link)
        integer :: g, i, k

        do g = 1, size(model%group)
            do i = 1, size(model%group(g)%link)
                associate (l => model%group(g)%link(i))
                    do k = 1, m
                        row(k, l) = columns(s, k, l)
                    end do
                end associate
            end do
        end do
    end subroutine tell_sample

    !> Places of all samples.
    pure subroutine tell_samples(model, block, place)
        type(model_type), intent(in) :: model
        type(group_block), intent(in) :: block
        real(wp), intent(inout) :: place(place_size(model), model%n_link, size(block%is_closed))
        integer :: g, i

        do g = 1, size(model%group)
            do i = 1, size(model%group(g)%link)
                associate (l => model%group(g)%link(i))
                    call turn_columns(size(place, 3), size(place, 1), size(place, 1)*size(place, 2), block%place(:, :, l), &
                                      place(1, l, 1))
                end associate
            end do
        end do
    end subroutine tell_samples

    !> Columns become rows, `apart` numbers from one to the next.
    pure subroutine turn_columns(n, m, apart, column, row)
        integer, intent(in) :: n, m, apart
        real(wp), intent(in) :: column(n, m)
        real(wp), intent(inout) :: row(apart, *)               !! of which the first m are written
        integer :: s

        if (m == 3) then
            do s = 1, n
                row(1, s) = column(s, 1)
                row(2, s) = column(s, 2)
                row(3, s) = column(s, 3)
            end do
        else
            do s = 1, n
                row(1, s) = column(s, 1)
                row(2, s) = column(s, 2)
                row(3, s) = column(s, 3)
                row(4, s) = column(s, 4)
                row(5, s) = column(s, 5)
                row(6, s) = column(s, 6)
                row(7, s) = column(s, 7)
            end do
        end if
    end subroutine turn_columns

    !> One sample's links at a place from which tangents lead: `lead_links` takes them along.
    pure subroutine set_out(model, s, place, tangent, block)
        type(model_type), intent(in) :: model
        integer, intent(in) :: s
        real(wp), intent(in) :: place(place_size(model), model%n_link)
        !> For each coordinate of the way
        real(wp), intent(in) :: tangent(link_freedom(model), model%n_link, model%n_q)
        type(group_block), intent(inout) :: block
        integer :: g, i

        do g = 1, size(model%group)
            do i = 1, size(model%group(g)%link)
                associate (l => model%group(g)%link(i))
                    call set_out_link(size(block%at, 1), s, size(place, 1), size(tangent, 1), size(tangent, 2), size(tangent, 3), &
                                      place(:, l), tangent(1, l, 1), block%way, block%from(:, :, l), block%shift(:, :, l))
                end associate
            end do
        end do
    end subroutine set_out

    pure subroutine set_out_link(n, s, n_place, m, n_link, n_q, place, tangent, way, from, shift)
        integer, intent(in) :: n, s                            !! samples; the one that sets out
        integer, intent(in) :: n_place, m                      !! numbers of a place and of a rate
        integer, intent(in) :: n_link, n_q
        real(wp), intent(in) :: place(n_place)
        real(wp), intent(in) :: tangent(m*n_link, *)           !! those of this link come first (number, coordinate)
        real(wp), intent(in) :: way(n, n_q)
        real(wp), intent(inout) :: from(n, n_place), shift(n, m)
        real(wp) :: by(6)
        integer :: j, k

        do k = 1, n_place
            from(s, k) = place(k)
        end do
        by = 0
        if (m == 6) then                                       ! six at a time
            do j = 1, n_q
                by = by + way(s, j)*tangent(:6, j)
            end do
        else
            do j = 1, n_q
                by(:3) = by(:3) + way(s, j)*tangent(:3, j)
            end do
        end if
        do k = 1, m
            shift(s, k) = by(k)
        end do
    end subroutine set_out_link

    !> Links from where they have come from by `shift`.
    pure subroutine lead_links(model, block)
        type(model_type), intent(in) :: model
        type(group_block), intent(inout) :: block
        real(wp) :: by(link_freedom(model)), place(place_size(model))
        integer :: g, i, s

        do g = 1, size(model%group)
            do i = 1, size(model%group(g)%link)
                associate (l => model%group(g)%link(i))
                    block%place(:, :, l) = block%from(:, :, l)
                    if (all(model%group(g)%thread_axis(:, i) == 0)) then
                        call move_links(size(block%at, 1), size(block%place, 2), block%shift(:, :, l), block%place(:, :, l))
                        cycle
                    end if
                    do s = 1, size(block%at, 1)
                        by = block%shift(s, :, l)
                        place = block%place(s, :, l)
                        call lead_link(model%group(g), i, by, place)
                        block%place(s, :, l) = place
                    end do
                end associate
            end do
        end do
    end subroutine lead_links

    !> Places of some samples of the block, through which a curve is to be laid.
    pure subroutine take_points(model, block, sample, point)
        type(model_type), intent(in) :: model
        type(group_block), intent(in) :: block
        integer, intent(in) :: sample(n_point)
        real(wp), intent(out), contiguous :: point(:, :, :)    !! (n_point, place_size, n_link)
        integer :: g, i, k

        do g = 1, size(model%group)
            do i = 1, size(model%group(g)%link)
                associate (l => model%group(g)%link(i))
                    do k = 1, size(point, 2)
                        point(:, k, l) = block%place(sample, k, l)
                    end do
                end associate
            end do
        end do
    end subroutine take_points

    !> Places on the polynomial through others.
    pure subroutine lay_curve(model, weight, point, block)
        type(model_type), intent(in) :: model
        real(wp), intent(in), contiguous :: weight(:, :)       !! (sample or more, n_point)
        real(wp), intent(in), contiguous :: point(:, :, :)     !! (n_point, place_size, n_link)
        type(group_block), intent(inout) :: block
        integer :: g, i, k

        do g = 1, size(model%group)
            do i = 1, size(model%group(g)%link)
                associate (l => model%group(g)%link(i))
                    do k = 1, size(point, 2)
                        call add_weighted(size(block%at, 1), size(weight, 1), weight, point(:, k, l), block%place(:, k, l))
                    end do
                end associate
            end do
        end do
    end subroutine lay_curve

    pure subroutine add_weighted(n, n_weight, weight, x, total)
        integer, intent(in) :: n, n_weight
        real(wp), intent(in) :: weight(n_weight, n_point), x(n_point)
        real(wp), intent(out) :: total(n)
        integer :: s

        do s = 1, n
            total(s) = weight(s, 1)*x(1) + weight(s, 2)*x(2) + weight(s, 3)*x(3) + weight(s, 4)*x(4) + weight(s, 5)*x(5) &
                       + weight(s, 6)*x(6)
        end do
    end subroutine add_weighted

    !> A group's link on its way, on which it may spin about its thread.
    pure subroutine lead_link(group, i, by, place)
        type(group_type), intent(in) :: group
        integer, intent(in) :: i                               !! of its links
        real(wp), intent(in), contiguous :: by(:)
        real(wp), intent(inout), contiguous :: place(:)

        if (size(place) == 3) then
            place = place + by
        else if (all(group%thread_axis(:, i) == 0)) then
            call move_in_space(place, by)
        else
            place = led_on_thread(place, by, group%thread_axis(:, i), group%thread_point(:, i))
        end if
    end subroutine lead_link

    !> A link after small shifts and turns, at all samples: `moved_place`.
    pure subroutine move_links(n, n_place, by, place)
        integer, intent(in) :: n                               !! samples
        integer, intent(in) :: n_place                         !! numbers of a place
        real(wp), intent(in) :: by(n, *)                       !! (sample, link_freedom)
        real(wp), intent(inout) :: place(n, n_place)
        real(wp) :: half(3), w, x, y, z, part
        integer :: s, k

        do k = 1, 3
            do s = 1, n
                place(s, k) = place(s, k) + by(s, k)
            end do
        end do
        if (n_place == 3) return
        do s = 1, n
            half = [by(s, 4)/2, by(s, 5)/2, by(s, 6)/2]
            w = place(s, 4) - (half(1)*place(s, 5) + half(2)*place(s, 6) + half(3)*place(s, 7))
            x = place(s, 5) + (half(1)*place(s, 4) + half(2)*place(s, 7) - half(3)*place(s, 6))
            y = place(s, 6) + (half(2)*place(s, 4) + half(3)*place(s, 5) - half(1)*place(s, 7))
            z = place(s, 7) + (half(3)*place(s, 4) + half(1)*place(s, 6) - half(2)*place(s, 5))
            part = 1/sqrt(w*w + x*x + y*y + z*z)
            place(s, 4) = part*w
            place(s, 5) = part*x
            place(s, 6) = part*y
            place(s, 7) = part*z
        end do
    end subroutine move_links

    ! ---------------------------------------------------------------- closing

    !> One group after the other, from the places predicted, at samples that are marked as closed: what does not converge as it must
    !> is not any more.
    subroutine close_block(model, closer, block)
        type(model_type), intent(in) :: model
        class(group_closer), intent(in) :: closer
        type(group_block), intent(inout) :: block
        integer :: g, n_before

        n_before = 0
        do g = 1, size(model%group)
            if (.not. any(block%is_closed)) return
            call close_group(model%group(g), g, n_before, closer, block)
            n_before = n_before + model%group(g)%n_thread
        end do
    end subroutine close_block

    !> Newton's method. Samples that have arrived stay: what one gives must not depend on those beside it.
    subroutine close_group(group, g, n_before, closer, block)
        type(group_type), intent(in) :: group
        integer, intent(in) :: g                               !! its number
        integer, intent(in) :: n_before                        !! threads of groups before it
        class(group_closer), intent(in) :: closer
        type(group_block), intent(inout) :: block
        integer :: step, n, n_row, n_place

        n = size(block%at, 1)
        n_row = size(group%unit)
        n_place = size(block%place, 2)
        block%is_under_way = block%is_closed
        block%before = huge(1.0_wp)
        block%contraction = 0
        where (block%is_closed) block%margin(:, g) = 0
        do step = 1, most_steps
            call make_steps()
            call put_where(n, block%is_under_way, block%margin_here, block%margin(:, g))
            block%takes = block%is_under_way
            call judge_corrections(step == 1, block%extent(:, 1), block%extent(:, 2), block%extent(:, 3), group%size, &
                                   block%margin(:, g), block%is_sure, block%before, block%contraction, block%is_closed, &
                                   block%is_under_way)
            block%takes = block%takes .and. block%is_closed
            call put_links(group, n, n_place, block%takes, block%corrected, block%place)
            call put_threads()
            call put_where(n, block%takes, block%extent(:, 4), block%speed(:, g))
            block%takes = block%takes .and. .not. block%is_under_way
            if (block%wants_rates .and. any(block%takes)) &
                call put_links(group, n, n_row/size(group%link), block%takes, block%velocity, block%rate)
            if (.not. any(block%is_under_way)) return
        end do
        block%is_closed = block%is_closed .and. .not. block%is_under_way

    contains

        subroutine make_steps()

            associate (corrected => block%corrected(:, :n_place*size(group%link)))
                if (block%wants_rates) then
                    call closer%make_steps(g, block%at, block%way, block%branch, block%place, block%margin_here, block%is_sure, &
                                           rate=block%velocity(:, :n_row), thread=block%turned(:, :2*group%n_thread), &
                                           corrected=corrected, extent=block%extent, only_leads=block%only_leads)
                else
                    call closer%make_steps(g, block%at, block%way, block%branch, block%place, block%margin_here, block%is_sure, &
                                           corrected=corrected, extent=block%extent)
                end if
            end associate
        end subroutine make_steps

        subroutine put_threads()
            integer :: i

            do i = 1, group%n_thread
                call put_where(n, block%takes, block%turned(:, i), block%thread(:, n_before + i))
                call put_where(n, block%takes, block%turned(:, group%n_thread + i), block%thread_rate(:, n_before + i))
            end do
        end subroutine put_threads
    end subroutine close_group

    !> Numbers of a group's links, one link after the other, to where those of all links are.
    pure subroutine put_links(group, n, m, takes, of_group, all_links)
        type(group_type), intent(in) :: group
        integer, intent(in) :: n, m                            !! samples; numbers of a link
        logical, intent(in) :: takes(n)
        real(wp), intent(in) :: of_group(n, *)
        real(wp), intent(inout) :: all_links(n, m, *)
        integer :: i, k

        if (all(takes)) then
            do i = 1, size(group%link)
                all_links(:, :, group%link(i)) = of_group(:, m*(i - 1) + 1:m*i)
            end do
        else if (any(takes)) then
            do i = 1, size(group%link)
                do k = 1, m
                    call put_where(n, takes, of_group(:, m*(i - 1) + k), all_links(:, k, group%link(i)))
                end do
            end do
        end if
    end subroutine put_links

    pure subroutine put_where(n, takes, x, y)
        integer, intent(in) :: n
        logical, intent(in) :: takes(n)
        real(wp), intent(in) :: x(n)
        real(wp), intent(inout) :: y(n)

        where (takes) y = x
    end subroutine put_where

    ! ---------------------------------------------------------------- judging

    !> The margins' rates along the way, from the margins a little further on, where the links' velocities lead. Where these are not
    !> sure a sample is not closed.
    subroutine find_drift(model, closer, block)
        type(model_type), intent(in) :: model
        class(group_closer), intent(in) :: closer
        type(group_block), intent(inout) :: block
        integer :: g, i, k, n, n_place

        n = size(block%at, 1)
        n_place = size(block%place, 2)
        associate (step => block%before)
            step = huge(1.0_wp)
            do g = 1, size(model%group)
                step = merge(min(step, step_ahead(block%margin(:, g), block%speed(:, g))), step, block%speed(:, g) > 0)
            end do
            where (.not. step < huge(1.0_wp)) step = 0         ! nothing moves
            do k = 1, size(block%q, 2)
                block%q(:, k) = block%at(:, k) + step*block%way(:, k)
            end do
            do g = 1, size(model%group)
                do i = 1, size(model%group(g)%link)
                    associate (l => model%group(g)%link(i))
                        do k = 1, size(block%rate, 2)
                            block%velocity(:, k) = step*block%rate(:, k, l)
                        end do
                        block%ahead(:, :, l) = block%place(:, :, l)
                        call move_links(n, n_place, block%velocity, block%ahead(:, :, l))
                    end associate
                end do
            end do
            do g = 1, size(model%group)
                call closer%make_steps(g, block%q, block%way, block%branch, block%ahead, block%margin_here, block%is_sure, &
                                       only_leads=block%only_leads)
                block%is_closed = block%is_closed .and. block%is_sure
                block%drift(:, g) = merge((block%margin_here - block%margin(:, g))/max(step, tiny(1.0_wp)), 0.0_wp, step > 0)
            end do
        end associate
    end subroutine find_drift

    !> Where is it surely explained how all links have come from other places: by the mean of `shift` and of their rates? Of other
    !> samples `is_close` of `linkdyn_stride` tells, which knows threads, too, and measures angles.
    pure subroutine explain_shifts(model, margin, block, is_explained)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: margin(:, :)                   !! where they have come from (sample, n_group)
        type(group_block), intent(inout) :: block
        logical, intent(out) :: is_explained(:)                !! (sample)
        real(wp) :: along(size(margin, 1))
        integer :: g, i, n

        n = size(margin, 1)
        is_explained = all(model%group%n_thread == 0)
        if (n == 0 .or. .not. all(is_explained)) return
        along = 1
        do g = 1, size(model%group)
            block%before = min(abs(margin(:, g)), abs(block%margin(:, g)))
            do i = 1, size(model%group(g)%link)
                associate (l => model%group(g)%link(i))
                    call compare_motion(n, n, size(block%place, 2), model%group(g)%size, block%from(1, 1, l), &
                                        block%place(1, 1, l), block%shift(1, 1, l), block%rate(1, 1, l), n, along, block%before, &
                                        is_explained, block%contraction)
                end associate
            end do
        end do
    end subroutine explain_shifts

    !> The same of steps from each sample to the next, the first from one before. Rates lead along the ways from these.
    pure subroutine explain_steps(model, place, rate, margin, back, block, is_explained)
        type(model_type), intent(in) :: model
        real(wp), intent(in), contiguous :: place(:, :), rate(:, :)    !! of the sample before (number, n_link)
        real(wp), intent(in) :: margin(:)                      !! there (n_group)
        real(wp), intent(in), contiguous :: back(:)            !! of the way from a sample what leads along the way to it (sample)
        type(group_block), intent(inout) :: block
        logical, intent(out), contiguous :: is_explained(:)    !! (sample)
        integer :: g, i, n, n_place

        n = size(block%at, 1)
        n_place = size(block%place, 2)
        is_explained = all(model%group%n_thread == 0)
        if (.not. is_explained(1)) return
        do g = 1, size(model%group)
            block%before = abs(block%margin(:, g))
            block%before(2:) = min(block%before(2:), abs(block%margin(:n - 1, g)))
            block%before(1) = min(block%before(1), abs(margin(g)))
            do i = 1, size(model%group(g)%link)
                associate (l => model%group(g)%link(i))
                    call compare_motion(1, 1, n_place, model%group(g)%size, place(:, l), block%place(1, 1, l), rate(:, l), &
                                        block%rate(1, 1, l), n, back, block%before, is_explained, block%contraction)
                    if (n > 1) call compare_motion(n - 1, n, n_place, model%group(g)%size, block%place(1, 1, l), &
                                                   block%place(2, 1, l), block%rate(1, 1, l), block%rate(2, 1, l), n, back(2:), &
                                                   block%before(2:), is_explained(2:), block%contraction)
                end associate
            end do
        end do
    end subroutine explain_steps

    !> One link: does the mean of the rates at both ends of a step explain how it has come there? With x the tangent of half an
    !> angle, that is 2 (x - x^3/3) to within 2/5 x^5.
    pure subroutine compare_motion(n, n_from, n_place, whole, from, to, rate_from, rate_to, n_to, back, margin, is_explained, &
                                   open)
        integer, intent(in) :: n                               !! steps
        integer, intent(in) :: n_from, n_to                    !! from one number of a sample to its next
        integer, intent(in) :: n_place                         !! numbers of a place
        real(wp), intent(in) :: whole                          !! the group's size
        real(wp), intent(in) :: from(n_from, *), to(n_to, *)   !! places
        real(wp), intent(in) :: rate_from(n_from, *), rate_to(n_to, *)
        real(wp), intent(in) :: back(n)                        !! times the latter along the step
        real(wp), intent(in) :: margin(n)
        logical, intent(inout) :: is_explained(n)
        real(wp), intent(out) :: open(n)                       !! what is left of the step
        real(wp) :: w, turn(3), square, part, left(6)
        integer :: s

        if (n_place == 3) then
            do s = 1, n
                left(1) = to(s, 1) - from(s, 1) - (rate_from(s, 1) + back(s)*rate_to(s, 1))/2
                left(2) = to(s, 2) - from(s, 2) - (rate_from(s, 2) + back(s)*rate_to(s, 2))/2
                left(3) = to(s, 3) - from(s, 3) - (rate_from(s, 3) + back(s)*rate_to(s, 3))/2
                open(s) = max(abs(left(1))/whole, abs(left(2))/whole, abs(left(3)))
            end do
        else
            do s = 1, n
                ! to times the conjugate of from
                w = to(s, 4)*from(s, 4) + to(s, 5)*from(s, 5) + to(s, 6)*from(s, 6) + to(s, 7)*from(s, 7)
                turn(1) = from(s, 4)*to(s, 5) - to(s, 4)*from(s, 5) + from(s, 6)*to(s, 7) - from(s, 7)*to(s, 6)
                turn(2) = from(s, 4)*to(s, 6) - to(s, 4)*from(s, 6) - from(s, 5)*to(s, 7) + from(s, 7)*to(s, 5)
                turn(3) = from(s, 4)*to(s, 7) - to(s, 4)*from(s, 7) + from(s, 5)*to(s, 6) - from(s, 6)*to(s, 5)
                part = 1/w
                square = (turn(1)**2 + turn(2)**2 + turn(3)**2)*part**2
                part = 2*part*(1 - square/3)
                left(1) = to(s, 1) - from(s, 1) - (rate_from(s, 1) + back(s)*rate_to(s, 1))/2
                left(2) = to(s, 2) - from(s, 2) - (rate_from(s, 2) + back(s)*rate_to(s, 2))/2
                left(3) = to(s, 3) - from(s, 3) - (rate_from(s, 3) + back(s)*rate_to(s, 3))/2
                left(4) = part*turn(1) - (rate_from(s, 4) + back(s)*rate_to(s, 4))/2
                left(5) = part*turn(2) - (rate_from(s, 5) + back(s)*rate_to(s, 5))/2
                left(6) = part*turn(3) - (rate_from(s, 6) + back(s)*rate_to(s, 6))/2
                open(s) = max(abs(left(1)), abs(left(2)), abs(left(3)))/whole
                open(s) = max(open(s), abs(left(4)), abs(left(5)), abs(left(6))) + 0.4_wp*square**2*max(1.0_wp, square)
            end do
        end if
        do s = 1, n
            is_explained(s) = is_explained(s) .and. open(s) <= part_of_margin*margin(s)
        end do
    end subroutine compare_motion
end module linkdyn_group_block
