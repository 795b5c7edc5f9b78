!> Samples on their own, outside a motion: groups closed by iteration are led to each from the scene's start.
!>
!> Batches are often paths all the same. With somebody who makes the groups' steps (`group_closer`) only some samples are led
!> there, and from each of these to the next a stride goes over those between. It is believed where both its ends agree, and
!> where nothing can lie between their straight ways from the start that would keep a straight way to a sample between from its
!> place.
module linkdyn_settled_samples
    use linkdyn_assembly_trail, only: sample_assembly, make_room, keep_lane, keep_stride
    use linkdyn_group_motion, only: group_closer
    use linkdyn_interrupt, only: is_interrupted
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state, prepare_kinematics
    use linkdyn_lane_count, only: lanes
    use linkdyn_led_mechanism, only: lead_from_start
    use linkdyn_margin_source, only: margin_source
    use linkdyn_model, only: model_type, link_freedom, scene_size
    use linkdyn_status, only: sample_ok
    use linkdyn_stride, only: stride_type, make_stride, is_close
    use linkdyn_threads, only: team_size
    implicit none (type, external)
    private
    public :: settle_samples

contains

    !> Where the groups' links are, and how leading them there came out.
    subroutine settle_samples(model, threads, q, assembly, closer)
        type(model_type), intent(in) :: model
        integer, intent(in) :: threads               !! at most
        real(wp), intent(in) :: q(:, :)              !! (n_q, n)
        type(sample_assembly), intent(out) :: assembly
        class(group_closer), pointer, intent(in), optional :: closer    !! makes the groups' steps; null or absent: nobody else
        class(group_closer), pointer :: steps
        real(wp) :: least(size(model%group), size(q, 2))     ! sizes of the margins, on the way to a sample
        logical :: is_settled(size(q, 2))
        integer :: n, i, apart

        nullify (steps)
        if (present(closer)) steps => closer
        n = size(q, 2)
        call make_room(model, n, assembly)
        is_settled = .false.
        if (associated(steps)) then
            apart = steps%samples_at_once
            call lead_to(model, threads, q, [(i, i=1, n, apart)], steps, assembly, least)
            is_settled(::apart) = .true.
            !$omp parallel do num_threads(team_size(threads, n/apart)) schedule(dynamic)
            do i = 1, n - apart, apart
                call bridge(model, q, i, i + apart, steps, least, assembly, is_settled(i:i + apart))
            end do
            !$omp end parallel do
        end if
        call lead_to(model, threads, q, pack([(i, i=1, n)], .not. is_settled), steps, assembly, least)
    end subroutine settle_samples

    !> Lead the mechanism to some samples.
    subroutine lead_to(model, threads, q, which, closer, assembly, least)
        type(model_type), intent(in) :: model
        integer, intent(in) :: threads
        real(wp), intent(in) :: q(:, :)              !! (n_q, n)
        integer, intent(in) :: which(:)              !! their numbers
        class(group_closer), pointer, intent(in) :: closer
        type(sample_assembly), intent(inout) :: assembly
        real(wp), intent(inout) :: least(:, :)       !! (n_group, n)
        integer :: n_block

        n_block = (size(which) + lanes - 1)/lanes
        if (n_block == 0) return
        !$omp parallel num_threads(team_size(threads, n_block)) default(shared)
        call lead_blocks(model, n_block, q, which, closer, assembly, least)
        !$omp end parallel
    end subroutine lead_to

    !> Those blocks of samples that this thread takes.
    subroutine lead_blocks(model, n_block, q, which, closer, assembly, least)
        type(model_type), intent(in) :: model
        integer, intent(in) :: n_block
        real(wp), intent(in) :: q(:, :)
        integer, intent(in) :: which(:)
        class(group_closer), pointer, intent(in) :: closer
        type(sample_assembly), intent(inout) :: assembly    !! of all threads
        real(wp), intent(inout) :: least(:, :)
        type(kinematic_state) :: state
        real(wp) :: least_here(lanes, size(least, 1))
        integer :: block, before, lane, status(lanes)

        call prepare_kinematics(model, 0, state)
        state%group%closer => closer
        !$omp do schedule(dynamic)
        do block = 1, n_block
            if (is_interrupted()) cycle
            before = lanes*(block - 1)
            do lane = 1, lanes
                state%q(lane, :) = q(:, which(min(before + lane, size(which))))
            end do
            call lead_from_start(model, state, status, least_here)
            do lane = 1, min(lanes, size(which) - before)
                associate (sample => which(before + lane))
                    call keep_lane(model, state, lane, sample, assembly)
                    assembly%status(sample) = status(lane)
                    least(:, sample) = least_here(lane, :)
                end associate
            end do
        end do
        !$omp end do
    end subroutine lead_blocks

    !> Settle the samples between two that are, if a stride from the one comes to where the other is.
    !>
    !> The straight ways to those between lie in the triangle of both straight ways from the start, which is as wide as the
    !> stride at most. There a margin differs from those on its sides by about what it changes by along the stride.
    subroutine bridge(model, q, first, last, closer, least, assembly, is_settled)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: q(:, :)              !! (n_q, n)
        integer, intent(in) :: first, last           !! both settled
        class(group_closer), pointer, intent(in) :: closer
        real(wp), intent(in) :: least(:, :)          !! (n_group, n)
        type(sample_assembly), intent(inout) :: assembly
        logical, intent(inout) :: is_settled(first:)
        real(wp), parameter :: many = 4              !! times that change, and nothing is left to vanish
        class(margin_source), pointer :: nobody
        type(stride_type) :: stride
        real(wp) :: nothing(link_freedom(model), model%n_link), change
        integer :: g

        if (is_interrupted() .or. any(assembly%status([first, last]) /= sample_ok)) return
        nullify (nobody)
        call make_stride(model, q(:, first), q(:, first + 1:last), model%branch, assembly%place(:, :, first), closer, &
                         nobody, stride)
        if (stride%n_believed < last - first) return
        associate (margin => stride%groups%margin)
            nothing = 0
            if (.not. is_close(model, scene_size(model), stride%groups%place(:, :, last - first), assembly%place(:, :, last), &
                               nothing, abs(margin(:, last - first)))) return
            do g = 1, size(model%group)
                change = maxval(margin(g, :)) - minval(margin(g, :))
                if (.not. many*change <= minval(least(g, [first, last]))) return
            end do
        end associate
        call keep_stride(model, stride, model%branch, last - first - 1, first, assembly)
        is_settled(first + 1:last - 1) = .true.
    end subroutine bridge
end module linkdyn_settled_samples
