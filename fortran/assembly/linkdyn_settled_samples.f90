!> Samples on their own, outside a motion: groups closed by iteration are led to each from the scene's start.
!>
!> With somebody who makes the groups' steps (`group_closer`) they are led to the nodes of a grid in the space of the
!> coordinates, as far as there are samples about, and samples are closed from the node nearest to them. That is believed where
!> the step from there is, by the rule of `linkdyn_following`, and where nothing can lie between the straight ways from the
!> start to the node and to the sample that would end the latter elsewhere. What a sample gives depends on no other one. Nodes, and
!> samples for which none serves, are led by these steps alone where they lead there; the lanes lead the others.
!>
!> Few samples do not pay for nodes of their own; nodes that they had are kept (`known_nodes`), for those who ask for pose after
!> pose: who comes back to where somebody has been finds what he would find without, and sooner.
module linkdyn_settled_samples
    use, intrinsic :: iso_fortran_env, only: int64
    use linkdyn_assembly_trail, only: sample_assembly, make_room, keep_lane, start_places
    use linkdyn_constants, only: pi
    use linkdyn_group_block, only: group_block, prepare_block, set_out, lead_links, close_block, find_drift, explain_shifts, &
        tell_sample
    use linkdyn_group_motion, only: group_closer
    use linkdyn_group_stride, only: group_stride, find_tangents
    use linkdyn_interrupt, only: is_interrupted
    use linkdyn_kinds, only: wp
    use linkdyn_kinematic_state, only: kinematic_state, prepare_kinematics
    use linkdyn_lane_count, only: lanes
    use linkdyn_led_groups, only: lead_places
    use linkdyn_led_mechanism, only: lead_from_start, is_way_short
    use linkdyn_lock, only: hold_lock, release_lock
    use linkdyn_hash, only: counter_bits
    use linkdyn_model, only: model_type, repeats, link_freedom
    use linkdyn_status, only: sample_ok, sample_unreachable
    use linkdyn_stride, only: is_step_believed, is_close, is_turn_kept
    use linkdyn_threads, only: team_size
    use linkdyn_whole_turns, only: least_angle, has_vague_turn
    implicit none (type, external)
    private
    public :: settle_samples, known_nodes

    !> Nodes of the grid that samples are near to.
    type :: node_list
        integer :: n = 0
        logical, allocatable :: repeats(:)           !! coordinates: full turns change nothing (n_q)
        real(wp), allocatable :: q(:, :)             !! (n_q, n)
        integer(int64), allocatable :: cell(:, :)    !! of the grid (n_q, n)
        integer, allocatable :: of(:)                !! the node of each sample; 0: none (sample)
        real(wp), allocatable :: least(:, :)         !! sizes of the margins on the way there (n_group, n)
        type(sample_assembly) :: found               !! at the nodes
        type(group_stride) :: start                  !! tangents at the start
        type(group_stride), allocatable :: tangents(:)    !! there (n)
    end type node_list

    !> One node, as it was found.
    type :: settled_node
        real(wp), allocatable :: q(:)
        integer :: status = sample_ok
        real(wp), allocatable :: place(:, :), least(:)
        type(group_stride) :: tangents
    end type settled_node

    !> Nodes of earlier calls, by their cells; a new one takes the place of an older one that it meets. Threads share it.
    type :: known_nodes
        type(settled_node), allocatable, private :: at(:)
    end type known_nodes

    real(wp), parameter :: part_of_stride(3) = [1.0_wp, 0.5_wp, 0.1_wp]    !! how far nodes are apart

contains

    !> Where the groups' links are, and how leading them there came out.
    subroutine settle_samples(model, threads, q, assembly, closer, known)
        type(model_type), intent(in) :: model
        integer, intent(in) :: threads               !! at most
        real(wp), intent(in) :: q(:, :)              !! (n_q, n)
        type(sample_assembly), intent(out) :: assembly
        class(group_closer), pointer, intent(in), optional :: closer    !! makes the groups' steps; null or absent: nobody else
        type(known_nodes), intent(inout), optional :: known             !! of these steps
        integer, parameter :: many = 256             !! samples, of which some may share a node: of fewer, no bit depends on the
                                                     !! others
        integer, parameter :: worth = 2              !! samples a node, on average: leading to it takes some samples' time
        class(group_closer), pointer :: steps
        real(wp), allocatable :: least(:, :)
        logical, dimension(size(q, 2)) :: is_settled, is_promising
        integer :: i

        nullify (steps)
        if (present(closer)) steps => closer
        call make_room(model, size(q, 2), assembly)
        is_settled = .false.
        is_promising = associated(steps)
        if (size(q, 2) >= many) then
            do i = 1, size(part_of_stride)
                call settle_about_nodes(model, threads, q, part_of_stride(i), worth, steps, assembly, is_promising, is_settled, &
                                        known)
            end do
        else if (present(known)) then
            call settle_about_nodes(model, threads, q, part_of_stride(2), 1, steps, assembly, is_promising, is_settled, known)
        end if
        call lead_to(model, threads, q, numbers_of(.not. is_settled), steps, assembly, least)
    end subroutine settle_samples

    pure function numbers_of(is_one) result(which)
        logical, intent(in) :: is_one(:)
        integer, allocatable :: which(:)
        integer :: i

        which = pack([(i, i=1, size(is_one))], is_one)
    end function numbers_of

    !> Settle those of the promising samples for which a node is near enough. The others of those whose node could be reached
    !> are promising still.
    subroutine settle_about_nodes(model, threads, q, part, worth, closer, assembly, is_promising, is_settled, known)
        type(model_type), intent(in) :: model
        integer, intent(in) :: threads
        real(wp), intent(in) :: q(:, :)              !! (n_q, n)
        real(wp), intent(in) :: part                 !! of a stride: how far nodes are apart
        integer, intent(in) :: worth                 !! samples that a node must have, on average
        class(group_closer), pointer, intent(in) :: closer
        type(sample_assembly), intent(inout) :: assembly
        logical, intent(inout) :: is_promising(:), is_settled(:)    !! (n)
        type(known_nodes), intent(inout), optional :: known
        type(node_list) :: node
        integer, allocatable :: which(:), ready(:)
        logical, allocatable :: serves(:), is_now(:)
        integer :: i

        which = numbers_of(is_promising)
        if (size(which) == 0) return
        call find_nodes(model, q, which, part, min(size(which)/worth, most_nodes(model)), node)
        if (node%n == 0) return
        call need_nodes(model, threads, closer, node, known)
        call find_tangents(model, closer, model%start_q, reshape(model%branch, [model%n_branch, 1]), start_places(model), &
                           node%start)
        serves = [.false., (is_settled_node(node, i), i=1, node%n)]
        ready = pack(which, serves(node%of(which) + 1))
        allocate (is_now(size(ready)), source=.false.)
        !$omp parallel num_threads(team_size(threads, size(ready)/closer%samples_at_once)) default(shared)
        call settle_blocks(model, q, ready, closer, node, assembly, is_now)
        !$omp end parallel
        is_settled(ready) = is_now
        serves = [.false., node%found%status == sample_ok]
        is_promising(which) = serves(node%of(which) + 1) .and. .not. is_settled(which)
    end subroutine settle_about_nodes

    pure logical function is_settled_node(node, k)
        type(node_list), intent(in) :: node
        integer, intent(in) :: k

        is_settled_node = node%found%status(k) == sample_ok
        if (is_settled_node) is_settled_node = all(node%tangents(k)%is_closed)
    end function is_settled_node

    ! ---------------------------------------------------------------- nodes

    !> The nodes that are not known are reached, and known from now on.
    subroutine need_nodes(model, threads, closer, node, known)
        type(model_type), intent(in) :: model
        integer, intent(in) :: threads
        class(group_closer), pointer, intent(in) :: closer
        type(node_list), intent(inout) :: node
        type(known_nodes), intent(inout), optional :: known
        integer, parameter :: most_known = 4096
        logical :: is_known(node%n)

        call make_room(model, node%n, node%found)
        allocate (node%least(size(model%group), node%n), node%tangents(node%n))
        is_known = .false.
        if (present(known)) then
            call hold_lock()
            call recall_nodes(known, node, is_known)
            call release_lock()
        end if
        if (all(is_known)) return
        call reach_nodes(model, threads, numbers_of(.not. is_known), closer, node)
        if (.not. present(known) .or. is_interrupted()) return    ! not all may have been reached
        call hold_lock()
        call remember_nodes(numbers_of(.not. is_known), node, min(most_known, most_nodes(model)), known)
        call release_lock()
    end subroutine need_nodes

    subroutine recall_nodes(known, node, is_known)
        type(known_nodes), intent(in) :: known
        type(node_list), intent(inout) :: node
        logical, intent(inout) :: is_known(:)        !! (node)
        integer :: i

        if (.not. allocated(known%at)) return
        do i = 1, node%n
            associate (one => known%at(place_of(node%cell(:, i), size(known%at))))
                if (.not. allocated(one%q)) cycle
                if (any(one%q /= node%q(:, i))) cycle
                node%found%status(i) = one%status
                node%found%place(:, :, i) = one%place
                node%least(:, i) = one%least
                node%tangents(i) = one%tangents
                is_known(i) = .true.
            end associate
        end do
    end subroutine recall_nodes

    subroutine remember_nodes(which, node, most, known)
        integer, intent(in) :: which(:)
        type(node_list), intent(in) :: node
        integer, intent(in) :: most                  !! nodes that are kept
        type(known_nodes), intent(inout) :: known
        integer :: i

        if (.not. allocated(known%at)) allocate (known%at(max(1, most)))
        do i = 1, size(which)
            associate (k => which(i))
                associate (one => known%at(place_of(node%cell(:, k), size(known%at))))
                    one%q = node%q(:, k)
                    one%status = node%found%status(k)
                    one%place = node%found%place(:, :, k)
                    one%least = node%least(:, k)
                    one%tangents = node%tangents(k)
                end associate
            end associate
        end do
    end subroutine remember_nodes

    !> How many nodes are kept at most, so that their tangents find room.
    pure integer function most_nodes(model) result(most)
        type(model_type), intent(in) :: model
        integer, parameter :: room = 4000000         !! numbers

        most = room/(link_freedom(model)*model%n_link*max(1, model%n_q))
    end function most_nodes

    !> The nodes nearest to samples; none, if there are too many.
    subroutine find_nodes(model, q, which, part, most, node)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: q(:, :)              !! (n_q, n)
        integer, intent(in) :: which(:)              !! the samples' numbers
        real(wp), intent(in) :: part                 !! of a stride: how far nodes are apart
        integer, intent(in) :: most
        type(node_list), intent(inout) :: node
        real(wp) :: from_start(size(q, 1))
        integer(int64) :: cell(size(q, 1))
        integer, allocatable :: table(:)             ! nodes at places that follow from their cells; 0: free
        integer :: i, k, place

        node%repeats = [(repeats(model, k), k=1, size(q, 1))]
        allocate (node%q(size(q, 1), most), node%cell(size(q, 1), most), node%of(size(q, 2)), table(0:4*most))
        table = 0
        node%of = 0
        do i = 1, size(which)
            call find_way(model, node%repeats, q(:, which(i)), from_start)
            if (.not. all(abs(from_start)/model%stride <= huge(1))) cycle
            ! To an angle of so many turns rounding leaves no way: lanes say so.
            if (any(node%repeats .and. has_vague_turn(q(:, which(i))))) cycle
            cell = nint(from_start/(part*model%stride), int64)
            ! To a node beyond half a turn the shortest way leads round the other side.
            if (any(node%repeats .and. abs(part*model%stride*cell) > pi)) cycle
            place = place_of(cell, size(table)) - 1
            do while (table(place) > 0)
                if (all(node%cell(:, table(place)) == cell)) exit
                place = modulo(place + 1, size(table))
            end do
            if (table(place) == 0) then
                if (node%n == most) then
                    node%n = 0
                    return
                end if
                node%n = node%n + 1
                table(place) = node%n
                node%cell(:, node%n) = cell
                node%q(:, node%n) = model%start_q + part*model%stride*cell
            end if
            node%of(which(i)) = table(place)
        end do
    end subroutine find_nodes

    !> Along which the mechanism is led: by the shortest of the ways that differ by full turns of angles.
    pure subroutine find_way(model, repeats, q, way)
        type(model_type), intent(in) :: model
        logical, intent(in) :: repeats(:)
        real(wp), intent(in) :: q(:)
        real(wp), intent(out) :: way(:)

        way = q - model%start_q
        where (repeats) way = least_angle(way)
    end subroutine find_way

    !> Where a cell is in a table of so many places, counted from one.
    pure integer function place_of(cell, n) result(place)
        integer(int64), intent(in) :: cell(:)
        integer, intent(in) :: n
        integer(int64) :: hash
        integer :: k

        hash = 0
        do k = 1, size(cell)
            hash = counter_bits(hash, int(k, int64), cell(k))
        end do
        place = 1 + int(modulo(hash, int(n, int64)))
    end function place_of

    !> Lead the mechanism to some nodes, and find the tangents there.
    subroutine reach_nodes(model, threads, which, closer, node)
        type(model_type), intent(in) :: model
        integer, intent(in) :: threads
        integer, intent(in) :: which(:)
        class(group_closer), pointer, intent(in) :: closer
        type(node_list), intent(inout) :: node
        real(wp), allocatable :: least(:, :)
        integer :: i

        call lead_to(model, threads, node%q(:, :node%n), which, closer, node%found, least)
        node%least(:, which) = least(:, which)
        !$omp parallel do num_threads(team_size(threads, size(which))) schedule(dynamic)
        do i = 1, size(which)
            associate (k => which(i))
                if (node%found%status(k) /= sample_ok) cycle
                call find_tangents(model, closer, node%q(:, k), reshape(model%branch, [model%n_branch, 1]), &
                                   node%found%place(:, :, k), node%tangents(k))
            end associate
        end do
        !$omp end parallel do
    end subroutine reach_nodes

    !> Those blocks of samples that this thread takes.
    subroutine settle_blocks(model, q, which, closer, node, assembly, is_settled)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: q(:, :)              !! (n_q, n)
        integer, intent(in) :: which(:)              !! the samples' numbers
        class(group_closer), intent(in) :: closer
        type(node_list), intent(in) :: node
        type(sample_assembly), intent(inout) :: assembly    !! of all threads
        logical, intent(inout) :: is_settled(:)      !! (size(which))
        type(group_block) :: block
        integer :: i, at_once

        at_once = closer%samples_at_once
        !$omp do schedule(dynamic)
        do i = 1, size(which), at_once
            associate (last => min(size(which), i + at_once - 1))
                if (.not. is_interrupted()) &
                    call settle_block(model, q, which(i:last), closer, node, assembly, is_settled(i:last), block)
            end associate
        end do
        !$omp end do
    end subroutine settle_blocks

    !> Close some samples from their nodes, and settle those for which that may be believed.
    subroutine settle_block(model, q, which, closer, node, assembly, is_settled, block)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: q(:, :)              !! (n_q, n)
        integer, intent(in) :: which(:)              !! the samples' numbers
        class(group_closer), intent(in) :: closer
        type(node_list), intent(in) :: node
        type(sample_assembly), intent(inout) :: assembly
        logical, intent(inout) :: is_settled(:)      !! (size(which))
        type(group_block), intent(inout) :: block    !! scratch
        real(wp) :: way(size(q, 1))
        real(wp), dimension(size(which), size(q, 1)) :: along, across
        real(wp) :: margin(size(which), size(model%group))     ! at the nodes
        logical :: is_explained(size(which))
        integer :: i

        call prepare_block(model, size(which), block)
        do i = 1, size(which)
            associate (sample => which(i), k => node%of(which(i)))
                call find_way(model, node%repeats, q(:, sample), way)
                block%at(i, :) = q(:, sample)
                along(i, :) = node%q(:, k) - model%start_q
                block%way(i, :) = way - along(i, :)
                block%branch(i, :) = model%branch(:model%n_branch)
                call set_out(model, i, node%found%place(:, :, k), node%tangents(k)%rate, block)
                margin(i, :) = node%tangents(k)%margin(:, 1)
            end associate
        end do
        call lead_links(model, block)
        block%is_closed = .true.
        call close_block(model, closer, block)
        if (.not. any(block%is_closed)) return
        call find_drift(model, closer, block)
        call explain_shifts(model, margin, block, is_explained)
        call find_across(along, block%way, model%stride, across)
        do i = 1, size(which)
            associate (sample => which(i), k => node%of(which(i)))
                if (.not. block%is_closed(i)) cycle
                if (.not. keeps_margins(model, node%start, node%tangents(k), node%least(:, k), across(i, :), block, i)) cycle
                if (.not. is_explained(i)) is_explained(i) = is_close_to_node(model, node, k, block, i)
                if (.not. is_explained(i)) cycle
                assembly%q(:, sample) = block%at(i, :)
                call tell_sample(model, size(which), size(block%place, 2), block%place, i, assembly%place(:, :, sample))
                assembly%margin(:, sample) = block%margin(i, :)
                is_settled(i) = .true.
            end associate
        end do
    end subroutine settle_block

    !> Can what was found from a node be but where a straight way from the start leads, as far as margins and threads tell?
    !>
    !> The step from the node must be believed. The straight way to the sample lies beside that to the node, as far as the step
    !> leads across it, at most. There a margin differs by about what it changes by across, unless the way leads through a narrow
    !> place: what changes there nobody has asked.
    pure logical function keeps_margins(model, start, tangents, least, across, found, i) result(keeps)
        type(model_type), intent(in) :: model
        type(group_stride), intent(in) :: start, tangents    !! at the start and at the node
        real(wp), intent(in) :: least(:)             !! sizes of the margins on the way there (n_group)
        real(wp), intent(in) :: across(:)            !! of the way from there (n_q)
        type(group_block), intent(in) :: found
        integer, intent(in) :: i                     !! the sample in it
        real(wp), parameter :: many = 4              !! times that change, and nothing is left to vanish
        real(wp), parameter :: wide = 0.8_wp         !! of the margins at both ends is left all along
        real(wp) :: drift, change, turned
        integer :: g, j

        keeps = .true.
        do g = 1, size(least)
            drift = 0
            change = 0
            do j = 1, size(across)
                drift = drift + found%way(i, j)*tangents%drift(g, j)
                change = change + abs(across(j)*tangents%drift(g, j))
            end do
            keeps = least(g) >= wide*min(abs(start%margin(g, 1)), abs(tangents%margin(g, 1))) .and. &
                    many*change <= least(g) .and. &
                    is_step_believed(model%least_margin(model%n_branch + g), tangents%margin(g, 1), drift, found%margin(i, g), &
                                     found%drift(i, g))
            if (.not. keeps) return
        end do
        do g = 1, size(found%thread, 2)
            turned = found%thread_rate(i, g)
            do j = 1, size(across)
                turned = turned + found%way(i, j)*tangents%thread_rate(g, j)
            end do
            keeps = is_turn_kept(tangents%thread(g, 1), found%thread(i, g), turned/2)
            if (.not. keeps) return
        end do
    end function keeps_margins

    !> Are the links of a sample where the tangents at its node and its own rates explain that they have come from there?
    pure logical function is_close_to_node(model, node, k, found, i) result(is_like)
        type(model_type), intent(in) :: model
        type(node_list), intent(in) :: node
        integer, intent(in) :: k                     !! the node
        type(group_block), intent(in) :: found       !! led there by `shift`
        integer, intent(in) :: i                     !! the sample in it

        is_like = is_close(model, node%found%place(:, :, k), found%place(i, :, :), &
                           found%shift(i, :, :), found%rate(i, :, :), &
                           min(abs(node%tangents(k)%margin(:, 1)), abs(found%margin(i, :))))
    end function is_close_to_node

    !> The parts of ways that are square to others, in units of the coordinates. Rounding is no part of them.
    pure subroutine find_across(along, way, unit, across)
        real(wp), intent(in) :: along(:, :), way(:, :)    !! (sample, n_q)
        real(wp), intent(in) :: unit(:)                   !! (n_q)
        real(wp), intent(out) :: across(:, :)
        real(wp), dimension(size(way, 1)) :: square, share
        integer :: k

        square = 0
        share = 0
        do k = 1, size(unit)
            square = square + (along(:, k)/unit(k))**2
            share = share + (along(:, k)/unit(k))*(way(:, k)/unit(k))
        end do
        share = merge(share/max(square, tiny(1.0_wp)), 0.0_wp, square > 0)
        do k = 1, size(unit)
            across(:, k) = way(:, k) - along(:, k)*share
            where (abs(across(:, k)) <= 16*epsilon(1.0_wp)*(abs(along(:, k)) + abs(way(:, k)))) across(:, k) = 0
        end do
    end subroutine find_across

    ! ---------------------------------------------------------------- by lanes

    !> Lead the mechanism to some samples.
    subroutine lead_to(model, threads, q, which, closer, assembly, least)
        type(model_type), intent(in) :: model
        integer, intent(in) :: threads
        real(wp), intent(in) :: q(:, :)              !! (n_q, n)
        integer, intent(in) :: which(:)              !! their numbers
        class(group_closer), pointer, intent(in) :: closer
        type(sample_assembly), intent(inout) :: assembly
        real(wp), allocatable, intent(out) :: least(:, :)    !! sizes of the margins on the ways there (n_group, n)
        logical :: is_known(size(q, 2))
        integer, allocatable :: left(:)

        allocate (least(size(model%group), size(q, 2)))
        if (size(which) == 0) return
        is_known = .false.
        ! closed forms may be out of reach on the way, which lanes see
        if (associated(closer) .and. model%n_branch == 0) then
            !$omp parallel num_threads(team_size(threads, size(which)/lanes)) default(shared)
            call lead_by_steps(model, q, which, closer, assembly, least, is_known)
            !$omp end parallel
        end if
        left = pack(which, .not. is_known(which))
        if (size(left) == 0) return
        associate (n_block => (size(left) + lanes - 1)/lanes)
            !$omp parallel num_threads(team_size(threads, n_block)) default(shared)
            call lead_blocks(model, n_block, q, left, closer, assembly, least)
            !$omp end parallel
        end associate
    end subroutine lead_to

    !> Those blocks of samples that this thread takes, by somebody else's steps alone. Where these do not lead lanes find out more.
    subroutine lead_by_steps(model, q, which, closer, assembly, least, is_known)
        type(model_type), intent(in) :: model
        real(wp), intent(in) :: q(:, :)
        integer, intent(in) :: which(:)
        class(group_closer), intent(in) :: closer
        type(sample_assembly), intent(inout) :: assembly    !! of all threads
        real(wp), intent(inout) :: least(:, :)
        logical, intent(inout) :: is_known(:)        !! how the way came out (n)
        real(wp) :: way(model%n_q), from(model%n_q, lanes), to(model%n_q, lanes)
        real(wp) :: place(size(assembly%place, 1), size(assembly%place, 2), lanes)
        real(wp), dimension(size(model%group), lanes) :: margin, least_here
        real(wp) :: longest(lanes)                   ! steps
        logical :: repeats_here(model%n_q), goes(lanes), has_arrived(lanes), is_out_of_reach(lanes)
        integer :: first, n, lane, k

        repeats_here = [(repeats(model, k), k=1, model%n_q)]
        !$omp do schedule(dynamic)
        do first = 1, size(which), lanes
            if (is_interrupted()) cycle
            n = min(lanes, size(which) - first + 1)
            goes = .false.
            longest = 1
            do lane = 1, n
                associate (sample => which(first + lane - 1))
                    call find_way(model, repeats_here, q(:, sample), way)
                    goes(lane) = is_way_short(model, way) .and. any(abs(way) > 0) &
                                 .and. .not. any(repeats_here .and. has_vague_turn(q(:, sample)))
                    if (.not. goes(lane)) cycle
                    longest(lane) = 1/aint(maxval(abs(way)/model%stride) + 1)
                    from(:, lane) = merge(q(:, sample) - way, model%start_q, repeats_here)
                    to(:, lane) = q(:, sample)
                    place(:, :, lane) = assembly%place(:, :, sample)
                end associate
            end do
            call lead_places(model, closer, goes(:n), from(:, :n), to(:, :n), spread(model%branch(:0), 2, n), &
                             place(:, :, :n), margin(:, :n), has_arrived(:n), longest, least_here(:, :n), is_out_of_reach(:n))
            do lane = 1, n
                associate (sample => which(first + lane - 1))
                    is_known(sample) = has_arrived(lane) .or. is_out_of_reach(lane)
                    if (is_out_of_reach(lane)) assembly%status(sample) = sample_unreachable
                    if (.not. has_arrived(lane)) cycle
                    assembly%q(:, sample) = q(:, sample)
                    assembly%place(:, :, sample) = place(:, :, lane)
                    assembly%margin(:, sample) = margin(:, lane)
                    assembly%status(sample) = sample_ok
                    least(:, sample) = least_here(:, lane)
                end associate
            end do
        end do
        !$omp end do
    end subroutine lead_by_steps

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
end module linkdyn_settled_samples
