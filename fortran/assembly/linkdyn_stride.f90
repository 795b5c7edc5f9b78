!> A stride: samples of a motion one after the other, and how far the steps from each to the next are believed.
!>
!> The rule is that of `linkdyn_following`: no margin vanishes within a step, neither led on from its beginning nor led back
!> from its end, and the rates at both ends explain where the groups' links have gone.
module linkdyn_stride
    use linkdyn_following, only: is_step_sound
    use linkdyn_group_block, only: part_of_margin
    use linkdyn_group_motion, only: group_closer
    use linkdyn_group_stride, only: group_stride, left_behind, stride_groups, share_along
    use linkdyn_kinds, only: wp
    use linkdyn_link_place, only: motion_between, spun_place, place_at, rate_at, turned_axis
    use linkdyn_margin_source, only: margin_source
    use linkdyn_model, only: model_type, link_freedom
    use linkdyn_threads_of_group, only: surely_same_turn
    implicit none (type, external)
    private
    public :: stride_type, make_stride, is_step_believed, is_close, is_turn_kept

    !> The first sample is that from which the stride sets out.
    type :: stride_type
        real(wp), allocatable :: at(:, :)            !! coordinates (n_q, 0:n)
        real(wp), allocatable :: way(:, :)           !! to the next sample (n_q, 0:n)
        real(wp), allocatable :: margin(:, :)        !! (n_map, 0:n)
        real(wp), allocatable :: drift(:, :)         !! its rate along the way (n_map, 0:n)
        logical, allocatable :: is_closed(:)         !! (0:n)
        type(group_stride) :: groups
        type(left_behind) :: behind                  !! the groups
        integer :: n_believed = 0                    !! samples up to which all steps are believed
    end type stride_type

contains

    !> Places and margins of all samples of a stride, from where the last one ended if it goes on from there.
    subroutine make_stride(model, from, q, branch, closer, margins, place, stride)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: from(:)              !! coordinates where it sets out (n_q)
        real(wp), intent(in) :: q(:, :)              !! of the samples (n_q, n)
        real(wp), intent(in) :: branch(:)            !! of the closed forms, all along (n_branch)
        class(group_closer), pointer, intent(in) :: closer      !! null: there are no groups
        class(margin_source), pointer, intent(in) :: margins    !! of the closed forms; null: there are none
        !> Of the groups' links: at the beginning, then at all samples (place_size, n_link, 0:n); empty: there are none
        real(wp), intent(inout), contiguous :: place(:, :, 0:)
        type(stride_type), intent(inout) :: stride   !! as it was left, its room is used again
        integer :: n, i
        logical :: goes_on

        n = size(q, 2)
        goes_on = ends_at(stride, from, place)
        if (allocated(stride%at)) then
            if (ubound(stride%at, 2) /= n) deallocate (stride%at, stride%way, stride%margin, stride%drift, stride%is_closed)
        end if
        if (.not. allocated(stride%at)) then
            allocate (stride%at(size(q, 1), 0:n), stride%way(size(q, 1), 0:n), stride%is_closed(0:n))
            allocate (stride%margin(size(model%least_margin), 0:n), stride%drift(size(model%least_margin), 0:n))
        end if
        stride%margin = 1
        stride%drift = 0
        stride%is_closed = .true.
        associate (at => stride%at, way => stride%way)
            at(:, 0) = from
            at(:, 1:) = q
            way(:, :n - 1) = at(:, 1:) - at(:, :n - 1)
            way(:, n) = way(:, n - 1)
        end associate
        if (size(model%group) > 0) then
            call stride_groups(model, closer, stride%at, stride%way, reshape(branch, [size(branch), 1]), goes_on, &
                               stride%behind, place, stride%groups)
            stride%is_closed = stride%groups%is_closed
            stride%margin(model%n_branch + 1:, :) = stride%groups%margin
            stride%drift(model%n_branch + 1:, :) = stride%groups%drift
        end if
        if (associated(margins)) call judge_closed_forms(model%n_branch, margins, branch, place, stride)
        do i = 1, n
            if (model%n_branch == 0 .and. size(model%group) > 0) then
                if (stride%groups%is_short(i)) cycle
            end if
            if (.not. is_sample_believed(model, place, stride, i)) exit
        end do
        stride%n_believed = i - 1
    end subroutine make_stride

    !> Has a stride of groups come to a place, all the way?
    pure logical function ends_at(stride, at, place)
        type(stride_type), intent(in) :: stride
        real(wp), intent(in) :: at(:), place(:, :, :)    !! the latter the first

        ends_at = allocated(stride%at) .and. allocated(stride%behind%place)
        if (.not. ends_at) return
        associate (n => ubound(stride%at, 2))
            ends_at = stride%n_believed == n .and. all(stride%at(:, n) == at) .and. all(stride%behind%place == place(:, :, 1))
        end associate
    end function ends_at

    subroutine judge_closed_forms(n_branch, margins, branch, place, stride)
        integer, intent(in) :: n_branch
        class(margin_source), intent(in) :: margins
        real(wp), intent(in) :: branch(:)
        real(wp), intent(in), contiguous :: place(:, :, :)
        type(stride_type), intent(inout) :: stride
        real(wp), dimension(n_branch, size(stride%is_closed)) :: margin, drift
        logical :: is_closed(size(stride%is_closed))

        call margins%find(stride%at, stride%way, branch, place, margin, drift, is_closed)
        stride%is_closed = stride%is_closed .and. is_closed
        stride%margin(:n_branch, :) = margin
        stride%drift(:n_branch, :) = drift
    end subroutine judge_closed_forms

    !> The step to a sample from the one before.
    pure logical function is_sample_believed(model, place, stride, i) result(is_believed)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: place(:, :, 0:)
        type(stride_type), intent(in) :: stride
        integer, intent(in) :: i
        real(wp) :: back, rate(link_freedom(model), model%n_link)
        integer :: n                                 ! maps to be asked: of groups none, where the step is short

        is_believed = stride%is_closed(i - 1) .and. stride%is_closed(i)
        if (.not. is_believed) return
        n = size(model%least_margin)
        if (size(model%group) > 0) then
            if (stride%groups%is_short(i)) n = model%n_branch
        end if
        if (n > 0) then
            back = share_along(stride%way(:, i - 1), stride%way(:, i))
            is_believed = all(is_step_believed(model%least_margin(:n), stride%margin(:n, i - 1), stride%drift(:n, i - 1), &
                                               stride%margin(:n, i), back*stride%drift(:n, i)))
        end if
        if (.not. is_believed .or. n == model%n_branch) return
        associate (groups => stride%groups)
            if (groups%is_explained(i)) return
            rate = back*groups%rate(:, :, i)
            if (allocated(groups%rate_there)) then
                rate = groups%rate_there(:, :, i)
                is_believed = all(is_turn_kept(groups%thread(:, i - 1), groups%thread(:, i), &
                                               (groups%thread_rate(:, i - 1) + groups%thread_rate_there(:, i))/2))
                if (.not. is_believed) return
            end if
            is_believed = is_close(model, place(:, :, i - 1), place(:, :, i), &
                                   groups%rate(:, :, i - 1), rate, min(abs(groups%margin(:, i - 1)), abs(groups%margin(:, i))))
        end associate
    end function is_sample_believed

    !> Is a nut on the turn of its thread to which it has come? A turn is a small way, which tells nothing of margins.
    elemental logical function is_turn_kept(from, to, explained) result(is_kept)
        real(wp), intent(in) :: from, to, explained  !! angles, and their change [rad]

        is_kept = abs(to - from - explained) < surely_same_turn
    end function is_turn_kept

    !> Does a margin not vanish within a step, nor at its end?
    elemental logical function is_step_believed(least, margin, drift, margin_there, drift_there) result(is_believed)
        real(wp), intent(in) :: least                !! that can be told from zero
        real(wp), intent(in) :: margin, drift        !! at the beginning; its rate for the whole step
        real(wp), intent(in) :: margin_there, drift_there    !! at the end

        is_believed = abs(margin_there) > least .and. is_step_sound(least, margin, drift, margin_there, drift_there)
    end function is_step_believed

    !> Are the groups' links where they have come from other places as the mean of the rates there and here explains? What is left
    !> open must be small against the distance, about the margin, at which another assembly may be.
    pure logical function is_close(model, from, to, rate_from, rate_to, margin)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: from(:, :), to(:, :) !! (place_size, n_link)
        real(wp), intent(in) :: rate_from(:, :), rate_to(:, :)    !! shifts and turns (link_freedom, n_link)
        real(wp), intent(in) :: margin(:)            !! (n_group)
        real(wp) :: moved(link_freedom(model)), open
        integer :: g, i, n

        is_close = .true.
        n = merge(2, 3, model%is_planar)
        do g = 1, size(model%group)
            open = 0
            do i = 1, size(model%group(g)%link)
                associate (l => model%group(g)%link(i), axis => model%group(g)%thread_axis(:, i))
                    if (all(axis == 0)) then
                        moved = motion_between(from(:, l), to(:, l)) - (rate_from(:, l) + rate_to(:, l))/2
                    else
                        moved = left_of_spin(from(:, l), to(:, l), rate_from(:, l), rate_to(:, l), axis, &
                                             model%group(g)%thread_point(:, i))
                    end if
                    open = max(open, maxval(abs(moved(:n)))/model%group(g)%size, maxval(abs(moved(n + 1:))))
                end associate
            end do
            is_close = is_close .and. open <= part_of_margin*margin(g)
        end do
    end function is_close

    !> What is left of the motion of a link that may have spun several times between two places. Rates at both of them, each about
    !> the axis as it stands there, are together those about the axis in between. Shifts are those of a point on it.
    pure function left_of_spin(from, to, rate_from, rate_to, axis, point) result(left)
        real(wp), intent(in) :: from(:), to(:)       !! (7)
        real(wp), intent(in) :: rate_from(:), rate_to(:)    !! (6)
        real(wp), intent(in) :: axis(3), point(3)    !! link axes
        real(wp) :: left(6)
        real(wp) :: about(3), explained(6)

        about = turned_axis(from, axis) + turned_axis(to, axis)
        explained = (rate_at(from, rate_from, point) + rate_at(to, rate_to, point))/2
        left = motion_between(spun_place(place_at(from, point), explained, axis, about/max(norm2(about), tiny(1.0_wp))), &
                              place_at(to, point))
    end function left_of_spin
end module linkdyn_stride
